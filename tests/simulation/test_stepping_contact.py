"""Lines that are stepped from outside touch themselves though their scene says that they hang straight."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid

WIDTH, LENGTH, END = 0.02, 4.0, 3.2
HOSE = {
    "length": LENGTH, "mass": 0.4, "diameter": WIDTH, "axial_stiffness": 1e5, "bending_stiffness": 0.005,
    "torsional_stiffness": 0.004, "damping": {"mass": 0.5},
}  # fmt: skip
FAR = [0, 0, -LENGTH + 0.5 * WIDTH]
COMMON = {"time": {"duration": END, "step": 0.01}, "output": {"every": 0.1}}


def cable() -> tuple[hybrid.Simulation, Any]:
    ends = {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": {"kind": "pinned", "position": FAR}}
    scene = {"cable": {"sections": [HOSE]}, "model": "rod", "mesh": {"cells": 80}, "initial": "equilibrium"}
    lines = hybrid.Simulation(hybrid.validate_scene(scene | COMMON | {"ends": ends, "dimension": 3}))
    return lines, lambda x: lines.set_end("end", x)


def system() -> tuple[hybrid.Simulation, Any]:
    line = {"start": "a", "end": "b", "model": "rod", "mesh": {"cells": 80}, "sections": [HOSE]}
    points = {"a": {"position": [0, 0, 0]}, "b": {"position": FAR}}
    lines = hybrid.Simulation(COMMON | {"points": points, "lines": {"hose": line}})
    return lines, lambda x: lines.set_point("b", x)


def place(t: float) -> np.ndarray:
    """Up on an arc to the other end, and past the leg there, which it meets from t = 3 s on."""
    x = min(t / 3.0, 1.0)
    return np.array([0.6 * np.sin(np.pi * x) - 0.4 * max(t - 3.0, 0.0), 0.0, FAR[2] + 3.5 * x])


@pytest.mark.long
@pytest.mark.parametrize("begin", [cable, system])
def test_it_touches_itself_and_goes_back_before_that(begin: Any) -> None:
    """What is taken back takes its contact along: the same state, bit for bit, at the same time again."""
    stepped, to = begin()
    with stepped as lines:
        for t in np.arange(1, 33) * 0.1:
            to(place(t))
            if t == pytest.approx(1.0):
                before = lines.save()
                for later in (1.0, 1.5, 2.0, 2.5, 3.0, END):
                    to(place(later))
                    lines.advance(later)
                lines.restore(before)
                to(place(t))
            lines.advance(min(t, END))
        found = lines.result()
    again, to = begin()
    with again as lines:
        for t in np.arange(1, 33) * 0.1:
            to(place(t))
            lines.advance(min(t, END))
        plain = lines.result()
    for result in (found, plain):
        line = result.lines["hose"] if result.lines else result
        assert "line touches itself" in {event.kind for event in line.events}
        assert float(line["self_distance/distance"]) > 0.75 * WIDTH
    one, other = ((x.lines["hose"] if x.lines else x).position for x in (found, plain))
    assert np.array_equal(one, other)
