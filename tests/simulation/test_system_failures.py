"""Lines that break from a point, and points that give way, in mid-motion."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bits import differences

import hybrid
from hybrid.errors import SceneError
from tests.scenes import line_between

SECTION = {"length": 12.0, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e5, "bending_stiffness": 20.0}


def scene(lines: dict[str, Any] | None = None, points: dict[str, Any] | None = None, **more: Any) -> dict[str, Any]:
    """A weight on two lines."""
    at = {
        "left": {"position": [-8, 0, 0]}, "right": {"position": [8, 0, 0]},
        "weight": {"initial_guess": [0, 0, -8], "mass": 30.0},
    }  # fmt: skip
    both = {"a": {"start": "left", "end": "weight"}, "b": {"start": "weight", "end": "right"}}
    for name, line in both.items():
        line.update({"sections": [SECTION], "mesh": {"cells": 12}, **(lines or {}).get(name, {})})  # type: ignore[arg-type]
    for name, keys in (points or {}).items():
        at[name].update(keys)  # type: ignore[attr-defined]
    time = {"duration": 1.5, "step": 0.01}
    return {"points": at, "lines": both, "time": time, "output": {"every": 0.05, "points": 13}} | more


def masses() -> np.ndarray:
    out = np.full(13, 2.0)
    out[[0, -1]] *= 0.5
    return out


def test_a_line_that_breaks_from_its_anchor_leaves_what_it_carried_to_the_others() -> None:
    """The weight swings on the line that is left; nothing pulls at the broken end, and the anchor stays."""
    with hybrid.run(scene(lines={"b": {"break_at": {"time": 0.5}}})) as result:
        event = next(x for x in result.events if x.kind == "end released")
        assert event.t == 0.5 and "line b breaks from point right" in event.text and event.energy == 0.0
        after = result.t > 0.5 + 1e-9
        assert np.abs(result["points/right/force"][after]).max() == 0.0
        assert result["points/right/position"][-1].tolist() == [8, 0, 0]
        loose = result.lines["b"].position[-1, -1]
        assert np.linalg.norm(loose - [8, 0, 0]) > 2.0
        joint = result.lines["a"].position[:, -1] - result.lines["b"].position[:, 0]
        assert np.abs(joint).max() < 1e-9


@pytest.mark.parametrize("end", ["start", "end"])
def test_lines_that_break_from_all_fall_as_bodies(end: str) -> None:
    """Both come loose from both of their ends: the centre of mass is on the parabola of free fall."""
    points = {"left": {"break_at": {"time": 0.3}}, "right": {"break_at": {"time": 0.3}}}
    lines = {"b" if end == "start" else "a": {"break_at": {"time": 0.3, "end": end}}}
    with hybrid.run(scene(lines, points)) as result:
        t = result.t[result.t > 0.3 + 1e-9] - 0.3
        name = next(iter(lines))
        r = result.lines[name].position
        centre = np.einsum("i,tik->tk", masses(), r) / masses().sum()
        np.testing.assert_allclose(centre[7:, 2] - centre[6, 2], -0.5 * 9.81 * t**2, rtol=0, atol=2e-5)
        np.testing.assert_allclose(centre[7:, 0], centre[6, 0], rtol=0, atol=2e-5)
        r = result.lines["a" if name == "b" else "b"].position
        m = np.append(masses(), 30.0)
        with_weight = np.concatenate([r, result["points/weight/position"][:, None]], axis=1)
        centre = np.einsum("i,tik->tk", m, with_weight) / m.sum()
        np.testing.assert_allclose(centre[7:, 2] - centre[6, 2], -0.5 * 9.81 * t**2, rtol=0, atol=2e-5)


def test_the_pull_of_an_end_that_came_loose_has_no_direction() -> None:
    """Its force is what Newton leaves: from then on angles are unknown, and ranges are those of before."""
    kinds = ("azimuth", "declination", "end_angle", "vertical_force")
    asked = {kind: {"kind": kind, "line": "b", "end": "end"} for kind in kinds}
    asked["end_angle"]["direction"] = [0, 0, 1]
    output = {"every": 0.01, "points": 13, "quantities": asked}
    breaking = hybrid.run(scene(lines={"b": {"break_at": {"time": 0.5}}}, output=output))
    with breaking as result, hybrid.run(scene(output=output)) as whole:
        after = result.t > 0.5 + 1e-9  # an output at the break is of the moment before
        for kind in kinds:
            known = whole[kind][whole.t < 0.5 + 1e-9]
            assert np.isfinite(known).all()
            np.testing.assert_array_equal(result[kind][~after], known)
            if kind == "vertical_force":
                assert (result[kind][after] == 0.0).all()
                known = np.append(known, 0.0)
            else:
                assert np.isnan(result[kind][after]).all()
            np.testing.assert_allclose(result[f"extremes/{kind}"], [known.min(), known.max()], rtol=1e-9)


def test_a_line_breaks_after_the_step_in_which_its_force_is_too_large() -> None:
    with hybrid.run(scene()) as still:
        pull = float(np.linalg.norm(still["points/right/force"][0]))
    moves = {"right": {"motion": {"heave": {"amplitude": 0.5, "period": 0.6}, "ramp": 0.6}}}
    with hybrid.run(scene({"b": {"break_at": {"tension": 1.5 * pull}}}, moves, output={"every": 0.01})) as result:
        event = next(x for x in result.events if x.kind == "end released")
        force = np.linalg.norm(result["points/right/force"], axis=1)
        before, after = result.t < event.t - 1e-9, result.t > event.t + 1e-9
        assert 0.1 < event.t < 1.4 and force[before].max() <= 1.5 * pull and force[after].max() < 1e-6
        assert force[~before & ~after] > 1.5 * pull  # as of one cable, an output there is of the moment before
        moved = result["points/right/position"][-1] - [8, 0, 0]  # the support goes on moving
        assert moved[2] == pytest.approx(0.5 * np.sin(2 * np.pi * 1.5 / 0.6), abs=1e-9)


def test_energy_after_a_break_is_kept_to_second_order() -> None:
    lost = []
    for step in (0.01, 0.0025):
        made = scene({"b": {"break_at": {"time": 0.5}}}, time={"duration": 1.5, "step": step})
        with hybrid.run(made) as result:
            lost.append(max(float(np.abs(line.work["scheme"]).max()) for line in result.lines.values()))
    assert lost[1] < 0.4 * lost[0] < 0.02 * 30 * 9.81 * 5, lost


def test_a_clamped_line_breaks_from_a_body_as_from_a_point() -> None:
    """Shape, end forces and energies, the energy of the clamp that is lost included."""
    rod = SECTION | {"length": 4.0, "axial_stiffness": 1e4, "bending_stiffness": 200.0}
    line = {"start": "a", "end": "b", "sections": [rod], "mesh": {"cells": 8}, "break_at": {"time": 0.2},
            "connections": {"start": {"tangent": [1, 0, 0]}, "end": {"tangent": [0, 0, -1]}}}  # fmt: skip
    more = {"time": {"duration": 0.6, "step": 0.01}, "output": {"every": 0.05, "points": 9}, "lines": {"l": line}}
    at = {"a": {"position": [0, 0, 0]}}
    body = {
        "bodies": {"hull": {"position": [2.5, 0, 0]}},
        "points": at | {"b": {"body": "hull", "place": [0, 0, -2.5]}},
    }
    both = [hybrid.run(more | x) for x in ({"points": at | {"b": {"position": [2.5, 0, -2.5]}}}, body)]
    one, two = (x.lines["l"] for x in both)
    lost, also = (next(x.energy for x in r.events if x.kind == "end released") for r in both)
    assert lost < -0.1 and also == pytest.approx(lost, rel=1e-6)
    assert np.linalg.norm(one.position[-1, -1] - one.position[0, -1]) > 0.1
    assert np.abs(one.position - two.position).max() < 1e-7
    assert two.bending_moment[5, -1] == 0.0 < one.bending_moment[4, -1]  # at the break: of the moment before
    assert np.abs(one.bending_moment - two.bending_moment).max() < 1e-9 * one.bending_moment.max()
    assert np.abs(one["energy/kinetic"] - two["energy/kinetic"]).max() < 1e-9 * one["energy/kinetic"].max()
    assert np.abs(one["work/end"] - two["work/end"]).max() < 1e-9 * one["energy/kinetic"].max()
    for x in both:
        assert np.abs(x["points/b/moment"][-1]).max() == 0.0 < np.abs(x["points/b/moment"][0]).max()


def test_a_mooring_of_a_body_breaks() -> None:
    """A body on two lines keeps the momentum that the other line gives it, and its fairlead goes on with it."""
    bodies = {"float": {"initial_guess": [0, 0, -8], "mass": 40.0, "inertia": [4.0, 4.0, 4.0]}}
    points = {
        "left": {"position": [-8, 0, 0]}, "right": {"position": [8, 0, 0]},
        "port": {"body": "float", "place": [-0.3, 0, 0.2], "break_at": {"time": 0.5}},
        "starboard": {"body": "float", "place": [0.3, 0, 0.2]},
    }  # fmt: skip
    lines = {
        "a": line_between("left", "port", SECTION, mesh=12),
        "b": line_between("starboard", "right", SECTION, mesh=12, break_at={"time": 0.8, "end": "start"}),
    }
    time = {"duration": 1.2, "step": 0.01}
    made = {"points": points, "bodies": bodies, "lines": lines, "time": time}
    with hybrid.run(made) as result:
        force = result["bodies/float/force"]
        assert np.abs(force[result.t > 0.8 + 1e-9]).max() < 1e-9
        v = result["bodies/float/velocity"]
        fall = v[-1, 2] - v[np.argmin(np.abs(result.t - 0.9)), 2]
        assert fall == pytest.approx(-9.81 * (result.t[-1] - 0.9), abs=1e-9)
        arm = result["points/starboard/position"][-1] - result["bodies/float/position"][-1]
        assert np.linalg.norm(arm) == pytest.approx(np.hypot(0.3, 0.2), abs=1e-9)
        assert [x.t for x in result.events if x.kind == "end released"] == [0.5, 0.8]


@pytest.mark.long
@pytest.mark.parametrize("times", [(0.625, 0.75), (0.6267, 0.7567)])  # between two steps of 1/64 s, too
def test_a_line_breaks_after_the_end_of_a_run_that_is_continued(tmp_path: Path, times: tuple[float, float]) -> None:
    """Lines and points that break at times behind the end of a run, which goes on as the longer run, bit for bit."""
    short, whole = tmp_path / "short.h5", tmp_path / "whole.h5"
    breaks = {"b": {"break_at": {"time": times[0]}}}, {"left": {"break_at": {"time": times[1]}}}
    more: dict[str, Any] = {"output": {"every": 0.25}}
    hybrid.run(scene(*breaks, time={"duration": 1.0, "step": 1 / 64}, **more), whole).close()
    hybrid.run(scene(*breaks, time={"duration": 0.5, "step": 1 / 64}, **more), short).close()
    hybrid.resume(short, until=1.0).close()
    assert [x for x in differences(whole, short) if not x.endswith("/scene")] == []  # each says its duration
    with hybrid.open(short) as result:
        assert [x.t for x in result.events if x.kind == "end released"] == [*times]


@pytest.mark.parametrize(
    ("lines", "points", "words"),
    [
        ({"a": {"break_at": {}}}, {}, "time or tension"),
        ({"a": {"break_at": {"time": 1.0}}, "b": {"break_at": {"time": 1.0, "end": "start"}}}, {}, "carries what is left"),
        ({}, {"weight": {"break_at": {"time": 1.0}}}, "break_at"),
    ],
)  # fmt: skip
def test_what_cannot_break_is_refused(lines: dict[str, Any], points: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneError) as refused:
        hybrid.run(scene(lines, points))
    assert words in str(refused.value)
