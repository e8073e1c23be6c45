"""A bending stiffness that grows with tension: the clamp of a taut line in closed form, at rest and in motion; energy."""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import Any

import numpy as np
import pytest
from test_moment_tables import ANGLE
from test_moment_tables import taut as with_law

import hybrid
from hybrid.errors import ComputationError, Outcome, SceneError
from tests.scenes import cable_scene

EI, GROWS = 1e4, 0.3  # N m2, m2
BEGIN, END = 5e4, 2e4  # N


def taut(cells: int, pull: Any, dimension: int | None = None, **section: Any) -> dict[str, Any]:
    law = {"bending_stiffness": EI, "stiffness_per_tension": GROWS} | section
    force = {"history": pull} if isinstance(pull, list) else [pull * cos(ANGLE), 0, pull * sin(ANGLE)]
    more = {"dimension": dimension} if dimension else {}
    return with_law(cells, {k: x for k, x in law.items() if x}, force, **more)


def of_clamp(pull: float, grows: float = GROWS) -> float:
    """Moment at the clamp: M dM = -EI(T cos a) T sin a da along the line, a the angle to the pull, EI = EI_0 + c T cos a."""
    return sqrt(2.0 * pull * (EI * (1.0 - cos(ANGLE)) + 0.5 * grows * pull * sin(ANGLE) ** 2))


def falling(step: float, over: float) -> dict[str, Any]:
    """The pull falls in a second, and the line comes to rest."""
    rows = [[0.0, *(BEGIN * x for x in (cos(ANGLE), 0, sin(ANGLE)))]]
    rows += [[t, *(END * x for x in (cos(ANGLE), 0, sin(ANGLE)))] for t in (1.0, over)]
    return taut(80, rows, damping=60.0) | {
        "time": {"duration": over, "step": step},
        "output": {"every": step, "points": 81, "exact": True},
    }


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_clamp_of_a_taut_line(dimension: int) -> None:
    """Moment and curvature there, with order 2 in the cells; without it 11 % less moment, 30 % more curvature and more."""
    off = []
    for cells in (100, 200):
        found = hybrid.static(taut(cells, BEGIN, dimension))
        off.append(abs(float(found.bending_moment[0, 0]) / of_clamp(BEGIN) - 1.0))
        kappa = of_clamp(BEGIN) / (EI + GROWS * BEGIN * cos(ANGLE))
        assert found.curvature[0, 0] == pytest.approx(kappa, rel=1e-2)
    print(f"moment off by {off[0]:.1e} and {off[1]:.1e}")
    assert off[1] < 2e-3 and off[0] / off[1] > 1.7
    assert of_clamp(BEGIN) > 1.5 * of_clamp(BEGIN, 0.0)


@pytest.mark.long
def test_a_pull_that_falls_leads_to_the_rest_under_it_and_its_energy_is_booked() -> None:
    """The end of the motion is the equilibrium; what no work accounts for falls with the step."""
    rest = hybrid.static(taut(80, END))
    left = []
    for step in (0.01, 0.005):
        found = hybrid.run(falling(step, 4.0))
        assert found.bending_moment[-1, 0] == pytest.approx(float(rest.bending_moment[0, 0]), rel=1e-4)
        assert found.bending_moment[0, 0] == pytest.approx(of_clamp(BEGIN), rel=5e-3)
        booked = float(found["work/hysteresis"][-1])
        left.append(abs(float(found["work/scheme"][-1])))
        print(f"step {step} s: {booked:.3f} J of tension that changes the stiffness, {left[-1]:.4f} J left over")
        assert booked < -50.0  # stored energy falls with the stiffness
    assert left[1] < 1e-2 * abs(booked) and left[1] < 0.6 * left[0]


def heaved(grows: float) -> dict[str, Any]:
    """A line that is bent to 0.4 1/m between clamps of which one is moved up and down."""
    section = {
        "length": 10.0,
        "mass": 2.0,
        "axial_stiffness": 1e6,
        "bending_stiffness": 100.0,
        "damping": {"mass": 0.5},
    }
    motion = {"heave": {"amplitude": 0.5, "period": 2.0}, "ramp": 2.0}
    clamp = {"kind": "clamped", "tangent": [1, 0, 0]}
    return cable_scene(
        section | {"stiffness_per_tension": grows}, clamp | {"position": [0, 0, 0]},
        clamp | {"position": [9.85, 0, 0], "motion": motion}, model="rod", contact={"self": False}, mesh=40,
        time=(4.0, 0.005), output=(0.1, 21)
    )  # fmt: skip


def test_energy_that_the_law_creates_is_told_or_stops_the_run() -> None:
    """It has no potential: K_T kappa^2/2 of 4, 8 and 15 % create 3, 28 and more than 100 % of what is put in."""
    assert "gains energy" not in {x.kind for x in hybrid.run(heaved(0.3)).events}
    (told,) = (x for x in hybrid.run(heaved(1.0)).events if x.kind == "gains energy")
    assert "with stiffness by tension" in told.text and "less stiffness_per_tension" in told.text
    with pytest.raises(ComputationError) as stopped:
        hybrid.run(heaved(2.0))
    assert stopped.value.outcome == Outcome.GAINS_ENERGY and "stiffness_per_tension" in str(stopped.value)


def test_no_stiffness_without_bending_and_refusals() -> None:
    with pytest.raises(SceneError, match="left without tension"):
        hybrid.validate_scene(taut(10, BEGIN, bending_stiffness=0))
    with pytest.raises(SceneError, match="what tension adds to stiffness"):
        hybrid.validate_scene(taut(10, BEGIN) | {"model": "adaptive", "time": {"duration": 1.0, "step": 0.1}})


def test_a_constant_tension_is_a_constant_stiffness() -> None:
    """A straight cantilever under a pull and a small moment bends as one of EI + c T does."""
    pull = [1e4, 0.0, 0.0]
    found = []
    for law in (
        {"stiffness_per_tension": GROWS},
        {"stiffness_per_tension": 0.0, "bending_stiffness": EI + GROWS * 1e4},
    ):
        tables = taut(40, 0.0, **law)
        tables["ends"]["end"] = {"kind": "free", "force": pull, "moment": [0, 1.0, 0]}
        found.append(np.asarray(hybrid.static(tables).position[0, :, 2]))
    np.testing.assert_allclose(found[0], found[1], atol=1e-6 * np.abs(found[1]).max())
