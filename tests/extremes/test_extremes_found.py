"""What the extremes have found, each mended or said: one small test for every one."""

from __future__ import annotations

import numpy as np
import pytest
from every import CASES, FAMILIES, PAGE, listed, page, parameters, read
from extreme import MODELS, X, Z, clamped, free, pinned, scene
from rods import rod

import hybrid


def kinds(result) -> list[str]:
    return [event.kind for event in result.events]


def solved(tables):
    what = hybrid.validate_scene(tables)
    return hybrid.run(what) if "time" in tables else hybrid.static(what)


def test_round_off_of_bending_is_no_buckling():
    """EI/h^3 eps outweighed a slight pull: a straight, taut rod was refused as unstable; a pressed one still is not straight."""
    taut = scene(rod(1.1, 1.1e4), pinned(), free(8.4e-5 * X), "rod", 400)
    assert np.abs(solved(taut).tension / 8.4e-5 - 1).max() < 1e-9
    load = 1.2 * np.pi**2 / 4 * 1.1e4 / 1.1**2
    pressed = scene(rod(1.1, 1.1e4), clamped((0, 0, 0), X), free(-load * X), "rod", 400)
    assert np.linalg.norm(solved(pressed).position[0, -1, 1:]) > 0.1


def test_a_rod_let_go_does_not_rest_where_it_would_buckle():
    """Round-off of no tension, and what falls, were called a rod at rest that would buckle."""
    start = {"kind": "straight", "direction": [0.3, 0, 0.9]}
    falling = scene(
        rod(1.0, 10.0), pinned(), free(), "rod", 10, 9.81, initial=start, time={"duration": 0.1, "step": 0.01}
    )
    assert "unstable" not in kinds(solved(falling))
    thrown = start | {"origin": [0, 0, 0]}
    loose = scene(rod(1.0, 10.0), free(), free(), "rod", 10, 9.81, initial=thrown, time={"duration": 0.1, "step": 0.01})
    assert "unstable" not in kinds(solved(loose))


@pytest.mark.parametrize(("steps", "said"), [(6, True), (8, True), (20, False), (100, False)])
def test_steps_too_long_for_the_motion_are_said(steps, said):
    """A pendulum in six steps a period is off by a third of its swing after one, and nothing said so."""
    period = 2 * np.pi * np.sqrt(2 / 3 / 9.81)
    start = {"kind": "straight", "direction": [0.1, 0, -1]}
    time = {"duration": 2 * period, "step": period / steps}
    swing = scene(rod(1.0, 100.0, 0.1), pinned(), free(), "rod", 8, 9.81, initial=start, time=time)
    assert ("coarse step" in kinds(solved(swing))) == said


@pytest.mark.parametrize("angle", [1e-3, 1e-2])
def test_a_clamp_a_little_askew_has_a_moment_that_the_mesh_must_see(angle):
    """Below three degrees nothing was said, and the moment was 2 EI/h where it is sqrt(EI T)."""
    pull = 1e3 * (np.cos(angle) * X + np.sin(angle) * Z)
    coarse, fine = (scene(rod(10.0, 1.0), clamped((0, 0, 0), X), free(pull), "rod", n) for n in (30, 2000))
    assert "unresolved bend" in kinds(solved(coarse))
    found = solved(fine)
    assert not found.events
    assert np.linalg.norm(found.bending_moment[0, 0]) == pytest.approx(angle * np.sqrt(1e3), rel=0.01)


@pytest.mark.parametrize(
    ("model", "said"), [("rod", "unresolved bend"), ("adaptive", "bending at point load neglected")]
)
def test_the_bend_at_a_point_load_is_resolved_or_said(model, said):
    tables = scene(rod(10.0, 1e-3, 1e-6), pinned(), free(1e3 * X), model, 30, 9.81)
    tables["cable"]["attachments"] = [{"kind": "clump", "at": 5.0, "mass": 1.0}]
    assert said in kinds(solved(tables))


def test_a_torque_passes_through_zones_that_move():
    turned = clamped(10.0 * X, X, motion={"roll": {"amplitude": 90, "period": 4}, "ramp": 1})
    line = rod(10.0, 1.0, 1.0, axial_stiffness=1e6, rotary_inertia=0.0)
    tables = scene(line, clamped((0, 0, 0), X), turned, "adaptive", 20, 0.0, time={"duration": 1, "step": 0.02})
    tables["ends"]["end"]["position"] = [10.001, 0, 0]
    found = solved(tables)
    assert "torque neglected" not in kinds(found)
    np.testing.assert_allclose(found["torque"][-1], np.radians(90.0) / 10.0, rtol=1e-9)  # GJ 1 N m2, 10 m


@pytest.mark.long
def test_steps_in_which_an_end_rolls_too_far_are_cut():
    """Fifty turns in eighty steps passed as a few: beyond half a turn a step the way cannot be known."""
    turned = clamped(X, X, motion={"roll": {"amplitude": 18_000, "period": 4}, "ramp": 1})
    line, time = rod(1.0, 1.0, axial_stiffness=1e6), {"duration": 1, "step": 0.0125}
    tables = scene(line, clamped((0, 0, 0), X), turned | {"position": [1.01, 0, 0]}, "rod", 400, 0.0, time=time)
    result = solved(tables)
    assert "steps cut" in kinds(result)
    assert np.abs(result.torque[-1] / (100 * np.pi) - 1).max() < 1e-9


@pytest.mark.parametrize(("stiff", "said"), [(None, True), (1e5, False)])
def test_the_peak_of_an_impact_on_an_inextensible_line_is_reported(stiff, said):
    end = pinned((7, 0, 0), motion={"travel": {"by": [2.95, 0, 0], "over": 0.5}})
    line = rod(10.0, 1e-3, 0.1) | ({"axial_stiffness": stiff} if stiff else {})
    tables = scene(line, pinned(), end, "rod", 30, 9.81, time={"duration": 0.7, "step": 0.001})
    try:
        assert ("snap" in kinds(solved(tables))) == said
    except hybrid.ComputationError as stopped:
        assert said and stopped.outcome is hybrid.Outcome.GAINS_ENERGY


def test_tiny_steps_of_many_cells():
    """All cells of a line are rounded the same way: that is no tension, and Newton need not find it."""
    start = {"kind": "straight", "direction": [0, 0, -1], "velocity": [0.6, -0.48, 0.64], "origin": [0, 0, 0]}
    time = {"duration": 2e-5, "step": 1e-6}
    line = rod(4.0, 1.9e-6, 0.1, rotary_inertia=0.0)
    result = solved(scene(line, free(), free(), "rod", 2000, 9.81, initial=start, time=time))
    assert np.abs(result.velocity[-1] - [0.6, -0.48, 0.64 - 9.81 * 2e-5]).max() < 1e-9


def test_a_light_line_that_hangs_from_a_stiff_rod():
    """Straight along its clamp is no place to look for what hangs from the first joint."""
    mass = 2.1e-3 * 0.0047 / 24.0**3 / 9.81
    result = solved(scene(rod(24.0, 0.0047, mass), clamped((0, 0, 0), X), free(), "zones", 320, 9.81))
    assert result.position[0, -1] == pytest.approx([7.2, 0, -16.8], abs=0.01)


def test_a_fold_within_a_cell_is_named():
    line = {"length": 10.0, "mass": 1.0}
    with pytest.raises(hybrid.ComputationError, match="folds within a cell"):
        solved(scene(line, pinned(), pinned(), "catenary", 21, 9.81))


def test_a_coarse_polygon_is_no_catenary():
    line = {"length": 10.0, "mass": 1.0}
    assert "unresolved bend" in kinds(solved(scene(line, pinned(), pinned(9.5 * X), "catenary", 2, 9.81)))
    assert not solved(scene(line, pinned(), pinned(9.5 * X), "catenary", 10, 9.81)).events


# --- the page ---


def test_the_page_lists_every_case(pytestconfig):
    if pytestconfig.getoption("--write-extremes"):
        return
    assert set(listed()) == {case.key for case in CASES}, "run: pytest tests/extremes -m 'not bench' --write-extremes"
    text = PAGE.read_text(encoding="utf-8")
    assert f"{len(CASES)} cases" in text and text == page(read()), "the page is that of its table"
    assert "wrong" not in listed().values()


def test_cases_are_many_and_different():
    assert len(CASES) >= 300
    assert len({case.key for case in CASES}) == len(CASES)
    for model in MODELS:
        assert sum(case.model == model for case in CASES) >= 50, model
    assert len(FAMILIES) >= 15


# --- the cases ---


@pytest.mark.long
@pytest.mark.parametrize("case", parameters(CASES))
def test_extremes(case, assert_honest):
    assert_honest(case)
