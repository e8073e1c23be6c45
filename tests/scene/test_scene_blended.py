"""Motion files that do not start at rest where the end is, blended in by a ramp."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hybrid
from hybrid.scene.motion import EndMotion
from hybrid.scene.motion_tables import Motion
from tests.scenes import cable_scene, pinned_at

PLACE = np.array([3.0, 0.0, 1.0])
RAMP, W = 5.0, 2.0


def table(folder: Path, kink: bool = False) -> str:
    """A circle of 0.5 m whose centre is 0.2 m beside the end: it begins with an offset and with 1 m/s."""
    t = np.arange(0.0, 12.01, 0.1)
    z = 1.0 + 0.5 * np.cos(W * t) + (0.6 * np.maximum(t - 6.05, 0.0) if kink else 0.0)
    rows = np.column_stack([3.2 + 0.5 * np.sin(W * t), t, z, 0.0 * t])
    path = folder / "circle.csv"
    np.savetxt(path, rows, delimiter=",", header="x,t,z,y", comments="", fmt="%.12g")
    return str(path)


def scene(file: str, **motion: float) -> hybrid.Scene:
    return hybrid.validate_scene(cable_scene(
        {"length": 5.0, "mass": 0.5, "axial_stiffness": 1e4}, pinned_at(0, 0, 0),
        {"kind": "pinned", "position": PLACE.tolist(), "motion": {"file": file, **motion}}, model="catenary", mesh=20,
        time=(10.0, 0.05), output=0.5
    ))  # fmt: skip


def test_it_starts_at_rest_and_is_the_file_after_the_ramp(tmp_path: Path) -> None:
    """C2 at the start; exactly the circle from then on (spline of 31 rows a period: 1e-5 of its radius)."""
    motion = EndMotion(Motion(file=table(tmp_path), ramp=RAMP), PLACE)
    place, speed = motion.at_time(0.0)[:2]
    assert place.tolist() == PLACE.tolist() and not speed.any()
    h = 1e-4
    assert np.linalg.norm(motion.at_time(h)[1]) < 1e-6
    for t in (0.7, 2.2, 4.9, 6.3, 9.0):
        change = (motion.at_time(t + h)[0] - motion.at_time(t - h)[0]) / (2 * h)
        np.testing.assert_allclose(motion.at_time(t)[1], change, rtol=0, atol=1e-6)
    for t in (5.0, 6.3, 9.0):
        circle = [3.2 + 0.5 * np.sin(W * t), 0.0, 1.0 + 0.5 * np.cos(W * t)]
        np.testing.assert_allclose(motion.at_time(t)[0], circle, rtol=0, atol=1e-5)


def test_a_run_says_how_it_is_blended_in(tmp_path: Path) -> None:
    with hybrid.run(scene(table(tmp_path), ramp=RAMP)) as result:
        (event,) = (e for e in result.events if e.kind == "motion blended in")
        assert "0.5385 m" in event.text and "over 5 s" in event.text and event.s_a == 5.0
        end = result.position[result.t >= RAMP, -1]
        t = result.t[result.t >= RAMP]
        np.testing.assert_allclose(end[:, 0], 3.2 + 0.5 * np.sin(W * t), rtol=0, atol=1e-5)


def test_a_run_of_several_lines_says_it_of_points(tmp_path: Path) -> None:
    """Of the point, once, whatever number of lines ends there."""
    line = {
        "sections": [{"length": 5.0, "mass": 0.5, "axial_stiffness": 1e4}],
        "model": "catenary",
        "mesh": {"cells": 5},
    }
    motion = {"file": table(tmp_path), "ramp": RAMP}
    with hybrid.run({
        "points": {"low": {"position": [0, 0, 0]}, "far": {"position": [6, 0, 0]},
                   "eye": {"position": PLACE.tolist(), "motion": motion}},
        "lines": {"one": line | {"start": "low", "end": "eye"}, "two": line | {"start": "eye", "end": "far"}},
        "time": {"duration": 0.2, "step": 0.05},
    }) as result:  # fmt: skip
        (event,) = (e for e in result.events if e.kind == "motion blended in")
        assert "points.eye" in event.text and "0.5385 m" in event.text and "over 5 s" in event.text


@pytest.mark.parametrize(
    ("motion", "kink", "text"),
    [({}, False, r"the position of this end at the start[\s\S]*or give `ramp"), ({"ramp": 5.0}, True, "a smooth velocity"),
     ({"ramp": 0.1}, False, "a ramp of at least 3 time steps")],
)  # fmt: skip
def test_what_is_refused(tmp_path: Path, motion: dict[str, float], kink: bool, text: str) -> None:
    with pytest.raises(hybrid.SceneError, match=text):
        hybrid.run(scene(table(tmp_path, kink), **motion))
