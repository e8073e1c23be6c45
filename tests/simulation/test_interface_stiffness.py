"""The interface stiffness of an end, from the factors of the last step: against differences of the same step."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.kernels.state.report import FORCE_A
from tests.inside import OnlyLine
from tests.scenes import cable_scene, pinned_at

EXAMPLES = Path(__file__).parents[2] / "examples"
SHIFT = 1e-5  # m
SECTION = {"length": 20.0, "mass": 3.0, "axial_stiffness": 2e5, "diameter": 0.03}
STIFF = SECTION | {"bending_stiffness": 40.0, "torsional_stiffness": 30.0, "damping": {"stiffness": 0.02, "mass": 0.1}}
PINNED = {"kind": "pinned", "position": [0, 0, 0]}
CLAMPED = {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, -1]}


def scene(section: dict[str, Any], start: dict[str, Any], model: str, **more: Any) -> dict[str, Any]:
    return cable_scene(section, start, pinned_at(15, 1, -2), model=model, mesh=24, time=(2.0, 0.05)) | more


BED = {"fluid": {"density": 1025.0}, "seabed": {"z": -5.0, "stiffness": 2e4, "damping": 500.0, "friction": 0.6}}
SCENES = {
    "catenary": scene(SECTION, PINNED, "catenary"),
    "inextensible": scene({k: v for k, v in SECTION.items() if k != "axial_stiffness"}, PINNED, "catenary"),
    "rod": scene(STIFF, CLAMPED, "rod"),
    "seabed": scene(STIFF | {"drag": {"normal": 1.2}}, PINNED, "rod", environment=BED),
    "in a plane": scene(STIFF, CLAMPED, "rod", dimension=2, ends={"start": CLAMPED, "end": pinned_at(15, 0, -2)}),
}


def report_now(cable: Any) -> np.ndarray:
    """Forces of the state of now: the report of a step is of the iterate before the last correction."""
    line = OnlyLine(cable)
    line.run.ends_of_now()
    line.run.solver.evaluate_forces(line.run.state, line.run.t)
    return line.work.report


@pytest.mark.long
@pytest.mark.parametrize("end", ["start", "end"])
@pytest.mark.parametrize("name", list(SCENES))
def test_it_is_what_differences_of_the_step_give(name: str, end: str) -> None:
    given = SCENES[name]
    place, axes = np.array(given["ends"][end]["position"], float), (0, 2) if name == "in a plane" else (0, 1, 2)
    with hybrid.Simulation(given) as cable:
        k = ("start", "end").index(end)
        cable.set_end(end, place + np.array([0.01, 0.0, 0.02]), [0.1, 0.0, 0.2])
        cable.advance(0.2)
        saved, place = cable.save(), place + np.array([0.015, 0.0, 0.03])

        def step(shift: np.ndarray) -> None:
            cable.restore(saved)
            cable.set_end(end, place + shift, [0.1, 0.0, 0.2])
            cable.step()

        def force(shift: np.ndarray) -> np.ndarray:
            step(shift)
            return report_now(cable)[FORCE_A + 3 * k : FORCE_A + 3 * k + 3].copy()

        step(np.zeros(3))
        found = cable.stiffness(end)
        before = cable.state.position
        for axis in axes:
            shift = SHIFT * np.eye(3)[axis]
            expected = -(force(shift) - force(-shift)) / (2.0 * SHIFT)
            assert found[:, axis] == pytest.approx(expected, abs=1e-6 * np.abs(found).max())
        step(np.zeros(3))
        assert np.array_equal(cable.state.position, before)  # asking changes nothing


def test_before_the_first_step_it_is_that_of_a_step_to_come() -> None:
    """Of a line that stays at rest it is the same after the step."""
    with hybrid.Simulation(SCENES["rod"]) as cable:
        first = cable.stiffness("end")
        cable.set_end("end", [15, 1, -2])
        cable.step()
        assert cable.stiffness("end") == pytest.approx(first, rel=1e-6, abs=1e-6 * np.abs(first).max())


def test_what_is_not_held_has_none() -> None:
    free = scene(STIFF, CLAMPED, "rod", ends={"start": CLAMPED, "end": "free"})
    with hybrid.Simulation(free) as cable:
        with pytest.raises(ValueError, match="is not held"):
            cable.stiffness("end")
        with pytest.raises(ValueError, match="expected 'start' or 'end'"):
            cable.stiffness("middle")
        assert np.linalg.eigvalsh(0.5 * (cable.stiffness("start") + cable.stiffness("start").T)).min() > 0.0
