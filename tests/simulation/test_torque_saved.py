"""How a line answers to the torques through its zones serves for several steps, and goes with what is saved."""

import numpy as np
import pytest

import hybrid
from tests.inside import OnlyLine


@pytest.fixture(scope="module")
def simulation():
    section = {"length": 6.0, "mass": 0.6, "diameter": 0.02, "bending_stiffness": 10.0, "torsional_stiffness": 8.0}
    sway = {"motion": {"sway": {"amplitude": 0.5, "period": 4.0}, "ramp": 1.0}}
    clamp = {"kind": "clamped", "normal": [0, 1, 0]}
    scene = hybrid.validate_scene(
        {
            "environment": {"gravity": 9.81}, "cable": {"sections": [section | {"damping": {"mass": 0.2}}]},
            "ends": {"start": clamp | {"position": [0, 0, 0], "tangent": [0.75, 0, -0.66]},
                     "end": clamp | {"position": [5.5, 0, 0], "tangent": [0.75, 0, 0.66], "turns": 2.0} | sway},
            "initial": "equilibrium", "time": {"duration": 5.0, "step": 0.01}, "output": {"every": 1.0},
            "model": {"kind": "zones", "zones": [{"rod": 1.5, "cells": 6}, {"catenary": 3, "cells": 12}, {"rod": 1.5, "cells": 6}]},
        }
    )  # fmt: skip
    return hybrid.Simulation(scene)


def answers(simulation):
    return OnlyLine(simulation).work.torsion


def test_answers_serve_for_steps_of_the_same_length(simulation):
    """Round-off of the times of steps is no other length: answers were found anew in every step."""
    simulation.advance(0.5)
    served = []
    for _ in range(12):
        simulation.advance(simulation.t + 0.01)
        served.append(int(answers(simulation).known[1]))
    assert max(served) > 10, f"iterations that answers served: {served}"


def test_what_is_saved_between_goes_on_bit_for_bit(simulation):
    simulation.advance(1.0)
    for _ in range(20):  # to somewhere between two times at which they are found
        simulation.advance(simulation.t + 0.01)
        if answers(simulation).known[1] == 10.0:
            break
    saved, until, columns = simulation.save(), simulation.t + 0.3, answers(simulation).columns.copy()
    simulation.advance(until)
    whole = {name: np.copy(x) for name, x in simulation.state._asdict().items()}
    assert np.abs(columns).max() > 0.0
    simulation.restore(saved)
    simulation.advance(until)
    for name, x in simulation.state._asdict().items():
        np.testing.assert_array_equal(x, whole[name], err_msg=name)
