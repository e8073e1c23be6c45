"""Lines that are stepped from outside touch themselves though their scene says that they hang straight."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from tests.said import both_ways, line_of, said

WIDTH, LENGTH, END = 0.02, 4.0, 3.2
HOSE = {
    "length": LENGTH, "mass": 0.4, "diameter": WIDTH, "axial_stiffness": 1e5, "bending_stiffness": 0.005,
    "torsional_stiffness": 0.004, "damping": {"mass": 0.5},
}  # fmt: skip
FAR = [0, 0, -LENGTH + 0.5 * WIDTH]
SCENE = {
    "cable": {"sections": [HOSE]}, "model": "rod", "mesh": {"cells": 80}, "initial": "equilibrium", "dimension": 3,
    "ends": {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": {"kind": "pinned", "position": FAR}},
    "time": {"duration": END, "step": 0.01}, "output": {"every": 0.1},
}  # fmt: skip


def place(t: float) -> np.ndarray:
    """Up on an arc to the other end, and past the leg there, which it meets from t = 3 s on."""
    x = min(t / 3.0, 1.0)
    return np.array([0.6 * np.sin(np.pi * x) - 0.4 * max(t - 3.0, 0.0), 0.0, FAR[2] + 3.5 * x])


def led_through(scene: dict[str, Any], back: bool) -> hybrid.Result:
    """The end is led until the line touches itself; back: once it is taken back to 1 s from there."""
    with hybrid.Simulation(scene) as lines:
        to = (lambda x: lines.set_point("end", x)) if "points" in scene else (lambda x: lines.set_end("end", x))
        for t in np.arange(1, 33) * 0.1:
            to(place(t))
            if back and t == pytest.approx(1.0):
                before = lines.save()
                for later in (1.0, 1.5, 2.0, 2.5, 3.0, END):
                    to(place(later))
                    lines.advance(later)
                lines.restore(before)
                to(place(t))
            lines.advance(min(t, END))
        return line_of(lines.result())


@pytest.mark.long
@both_ways
def test_it_touches_itself_and_goes_back_before_that(network: bool) -> None:
    """What is taken back takes its contact along: the same state, bit for bit, at the same time again."""
    found = [led_through(said(SCENE, network), back) for back in (True, False)]
    for line in found:
        assert "line touches itself" in {event.kind for event in line.events}
        assert float(line["self_distance/distance"]) > 0.75 * WIDTH
    assert np.array_equal(found[0].position, found[1].position)
