"""Steps in real time: never more Newton iterations than allowed; what was cut short is said, counted and right soon."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from test_stepping import driven, heave, touchdown

import hybrid
from tests.said import ONE, both_ways, line_of, said

PINNED = "ends.end={kind: pinned, position: [205, 0, 0]}"
LONG = "time={duration: 20, step: 0.2}"


def stepped(
    most: int | None, model: str = "rod", steps: int = 100, network: bool = False
) -> tuple[np.ndarray, hybrid.Result, int]:
    forces = []
    scene = said(touchdown(f"model={model}", PINNED, LONG), network)
    with hybrid.Simulation(scene, most_iterations=most) as cable:
        for k in range(steps):
            place = heave(0.2 * (k + 1))
            if network:
                cable.set_point("end", *place)
            else:
                cable.set_end("end", *place)
            cable.step()
            forces.append(cable.forces(ONE)[1] if network else cable.forces().end)
        count = cable.cut_short
        return np.array(forces), cable.result(), count


@both_ways
@pytest.mark.parametrize("model", ["rod", "catenary"])
def test_no_step_takes_more_and_the_motion_is_nearly_the_same(model: str, network: bool) -> None:
    full, reference, none = stepped(None, model, network=network)
    assert none == 0 and line_of(reference)["steps/iterations"].max() > 3
    assert not [e for e in reference.events if e.kind == "iterations cut"]
    off = []
    for most in (1, 2, 3):
        forces, result, count = stepped(most, model, network=network)
        assert line_of(result)["steps/iterations"].max() == most
        assert count > 0
        told = [e for e in result.events if e.kind == "iterations cut"]
        assert [e.value for e in told[1:]] == [count] and told[0].value is None
        assert f"after {most} Newton iterations" in told[0].text and f"{count} of 100 steps" in told[1].text
        assert float(told[0].text.split("changed it by ")[1].split()[0]) > 0.0
        off.append(np.abs(forces - full).max() / np.abs(full).max())
    assert off[2] < 0.2 * off[1] < 0.04 * off[0] < 0.04 * 0.1


def test_what_needs_no_more_has_the_same_bits() -> None:
    full, _, _ = stepped(None)
    bounded, result, count = stepped(20)
    assert count == 0 and np.array_equal(full, bounded)
    assert "iterations cut" not in {e.kind for e in result.events}


@pytest.mark.parametrize("model", ["rod", "{kind: adaptive, tolerance: 2.0e-5}"])
def test_what_is_taken_back_is_not_counted(model: str) -> None:
    with hybrid.Simulation(touchdown(f"model={model}", PINNED, LONG), most_iterations=1) as cable:
        saved = cable.save()
        cable.set_end("end", *heave(0.2))
        for _ in range(3):
            cable.restore(saved)
            for k in range(10):
                cable.set_end("end", *heave(0.2 * (k + 1)))
                cable.step()
            count = cable.cut_short
        assert 0 < count <= 10
        result = cable.result()
    assert [e.value for e in result.events if e.kind == "iterations cut"][1:] == [count]


def test_a_step_that_is_refused_says_that_its_iterations_are_used_up() -> None:
    with hybrid.Simulation(touchdown("model=catenary", PINNED), most_iterations=3) as cable:
        saved = cable.save()
        cable.set_end("end", [150.0, 0.0, 0.0])
        with pytest.raises(hybrid.ComputationError, match="the 3 iterations that a step may take are used up"):
            cable.step()
        cable.restore(saved)
        driven(cable, 2)
        assert cable.t == pytest.approx(0.1)


@pytest.mark.parametrize("most", [0, -1, 2.5, "3", True, np.nan, [2]])
def test_a_number_that_is_none_is_refused(most: Any) -> None:
    with pytest.raises(ValueError, match="most_iterations: expected a whole number of at least 1"):
        hybrid.Simulation(touchdown("model=catenary", PINNED), most_iterations=most)
