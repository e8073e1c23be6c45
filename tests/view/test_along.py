"""Quantities that jump, in pictures and facts: curves have a gap, and both values count."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.view import animation, panels
from hybrid.view.curves import along, kept
from hybrid.view.figure import Line, Panel
from hybrid.view.summary import Fact, facts_of
from tests.scenes import cable_scene, clamped_at, pinned_at

CLUMP = 4.1  # m, where it hangs


@pytest.fixture(scope="module")
def swing() -> hybrid.Result:
    """A chain of 10 m with a clump that swings from its end at s = 10 m."""
    scene: dict[str, Any] = cable_scene(
        {"length": 10.0, "mass": 2.0, "axial_stiffness": 1e6}, "free", pinned_at(0, 0, 0),
        attachments=[{"kind": "clump", "at": CLUMP, "mass": 50.0}],
        initial={"kind": "straight", "direction": [-0.3, 0, 1.0]}, model="catenary", mesh=20, time=(1.0, 0.02),
        output={"points": 11, "every": 0.1, "errors": True}
    )  # fmt: skip
    return hybrid.run(hybrid.validate_scene(scene))


def cantilever(**allowed: float) -> hybrid.Result:
    """Two sections clamped at s = 0 under their weight: the softer one, from s = 0.6 m on, bends most just there."""
    section = {"mass": 0.05, "axial_stiffness": 1e7}
    parts = [
        section | {"length": 0.6, "bending_stiffness": 400.0},
        section | {"length": 0.4, "bending_stiffness": 50.0},
    ]
    for part, radius in zip(parts, allowed.values(), strict=bool(allowed)):
        part["min_bend_radius"] = radius
    scene: dict[str, Any] = cable_scene(parts, clamped_at([0, 0, 0], [1, 0, 0]), "free", model="rod", mesh=100)
    return hybrid.static(hybrid.validate_scene(scene))


def fact(result: hybrid.Result, key: str) -> Fact:
    (found,) = [f for f in facts_of(result) if f.key == key]
    return found


def lines(panel: Panel) -> list[Line]:
    return [item for item in panel.items if isinstance(item, Line)]


def test_curves_along_the_cable_have_a_gap_at_a_jump(swing: hybrid.Result) -> None:
    (curve,) = lines(panels.profiles(swing, "tension"))
    (k,) = np.flatnonzero(np.isnan(curve.y))
    assert curve.x[k - 1 : k + 2].tolist() == [CLUMP] * 3
    ratio = curve.y[k + 1] / curve.y[k - 1]
    assert ratio == pytest.approx(swing["right/tension"][-1, 0] / swing.tension[-1, swing.s == CLUMP][0])
    assert ratio > 3.0  # 41 + 50 kg hang there, and 8.2 kg below
    (height,) = lines(panels.profiles(swing, "z"))
    assert np.isfinite(height.y).all() and np.array_equal(height.x, swing.s)


def test_ranges_have_the_gap_at_all_times(swing: hybrid.Result) -> None:
    (panel,) = (p for p in panels.ranges(swing, kept(swing)) if p.key == "range-tension")
    assert len(lines(panel)) == 4
    for line in lines(panel):
        assert np.isnan(line.y).sum() == 1 and line.x[np.isnan(line.y)] == CLUMP
    moving = lines(panel)[-1]
    assert moving.frames is not None and moving.frames.shape == (11, moving.x.size)
    assert np.isnan(moving.frames[:, moving.x == CLUMP]).sum() == 11


def test_histories_at_a_jump_are_two(swing: hybrid.Result) -> None:
    curves = lines(panels.history(swing, "tension", [2.0, CLUMP]))
    assert [x.label for x in curves] == ["s = 2 m", "s = 4.1 m, before the point", "s = 4.1 m, after it"]
    ratio = curves[2].y[1:] / curves[1].y[1:]
    assert ratio == pytest.approx(swing["right/tension"][1:, 0] / swing.tension[1:, swing.s == CLUMP][:, 0])
    assert len(lines(panels.history(swing, "position", [CLUMP], component=0))) == 1


@pytest.mark.long
def test_pages_and_films_of_jumps_are_made(swing: hybrid.Result, tmp_path: Path) -> None:
    assert hybrid.report(swing, tmp_path / "swing.html").stat().st_size > 1e5
    hybrid.plot(swing, path=tmp_path / "swing.png")
    assert animation.animate(swing, tmp_path / "swing.gif").frames == 11


def test_the_largest_value_may_be_the_one_on_the_right() -> None:
    bent = cantilever()
    found = along(bent, "curvature")
    assert [found.side(k) for k in np.flatnonzero(found.s == 0.6)] == [-1, 1] and found.side(0) == 0
    right = float(bent["right/curvature"][0, 0])
    assert right > 1.04 * bent.curvature.max()
    told = fact(bent, "bend")
    assert told.values["radius"] == pytest.approx(1.0 / right) and told.s == 0.6


def test_each_side_is_held_against_its_own_limit() -> None:
    """Curvature 6.1e-4 1/m at the clamp, 9.8e-5 and 7.8e-4 1/m on the two sides of the seam."""
    good = cantilever(stiff=1400.0, soft=1000.0)
    assert good["right/min_bend_radius"].tolist() == [1000.0]
    assert good["min_bend_radius"][good.s == 0.6].tolist() == [1400.0]
    told = fact(good, "bend")
    assert told.weight == "note" and told.values["ratio"] is None  # its error is not estimated
    bad = fact(cantilever(stiff=1000.0, soft=1400.0), "bend")
    assert bad.weight == "alarm" and bad.values["ratio"] > 1.05 and bad.values["allowed"] == 1400.0
    assert cantilever()["right/bending_stiffness"].tolist() == [50.0]


def test_torque_is_held_against_the_stiffness_of_its_side(swing: hybrid.Result) -> None:
    found = along(bent := cantilever(), "torque")
    stiffness = found.of(bent, "bending_stiffness")
    assert stiffness is not None and stiffness[found.s == 0.6].tolist() == [400.0, 50.0]
    tension = along(swing, "tension")
    error = tension.of(swing, "errors/total/tension")  # the file has one value at a point
    assert error is not None and error.shape == tension.values.shape
    assert tension.of(swing, "bending_stiffness") is None
