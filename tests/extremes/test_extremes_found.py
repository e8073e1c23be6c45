"""What the extremes have found, each mended or said, that no family of cases shows by itself."""

from __future__ import annotations

import numpy as np
import pytest
from every import CASES, FAMILIES, PAGE, listed, page, parameters, read
from extreme import MODELS, X, clamped, free, pinned, scene
from rods import rod

import hybrid
from tests.said import kinds


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


@pytest.mark.parametrize(("stiff", "said"), [(None, True), (1e5, False)])
def test_the_peak_of_an_impact_on_an_inextensible_line_is_reported(stiff, said):
    end = pinned((7, 0, 0), motion={"travel": {"by": [2.95, 0, 0], "over": 0.5}})
    line = rod(10.0, 1e-3, 0.1) | ({"axial_stiffness": stiff} if stiff else {})
    tables = scene(line, pinned(), end, "rod", 30, 9.81, time={"duration": 0.7, "step": 0.001})
    try:
        assert ("snap" in kinds(solved(tables))) == said
    except hybrid.ComputationError as stopped:
        assert said and stopped.outcome is hybrid.Outcome.GAINS_ENERGY


def test_a_light_line_that_hangs_from_a_stiff_rod():
    """Straight along its clamp is no place to look for what hangs from the first joint."""
    mass = 2.1e-3 * 0.0047 / 24.0**3 / 9.81
    result = solved(scene(rod(24.0, 0.0047, mass), clamped((0, 0, 0), X), free(), "zones", 320, 9.81))
    assert result.position[0, -1] == pytest.approx([7.2, 0, -16.8], abs=0.01)


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
