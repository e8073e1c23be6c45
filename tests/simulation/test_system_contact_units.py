"""A system in contact in other units: the same motion, and the same end where a catenary goes slack."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid

UNITS = (1.0, 1000.0, 0.001)  # lengths of a metre: m, mm, km; the density of the line is the same in all
WIDTH = 0.02


def scene(u: float, model: str) -> dict[str, Any]:
    """A U whose ends come together, on a tail whose far end heaves so that it goes slack."""
    hose = {
        "length": 4 * u, "mass": 0.4 * u**2, "diameter": WIDTH * u, "axial_stiffness": 1e5 * u**4,
        "bending_stiffness": 0.005 * u**6, "torsional_stiffness": 0.004 * u**6, "damping": {"mass": 0.2},
    }  # fmt: skip
    closer = {"travel": {"by": [1.22 * u, 0.95 * WIDTH * u, 0.0], "over": 1.2}}
    heave = {"heave": {"amplitude": 0.4 * u, "period": 1.0}, "ramp": 1.0}
    return {
        "environment": {"gravity": 9.81 * u},
        "points": {
            "low": {"position": [0, 0, 0], "motion": closer},
            "high": {"position": [1.2 * u, 0, 0.45 * u], "motion": heave},
            "free": {"kind": "free", "initial_guess": [1.1 * u, 0, 0]},
        },
        "lines": {
            "hose": {"start": "low", "end": "free", "model": "rod", "mesh": {"cells": 64}, "sections": [hose],
                     "contact": {"friction": 0.3}},
            "tail": {"start": "free", "end": "high", "model": model, "mesh": {"cells": 16},
                     "sections": [hose | {"length": u}]},
        },
        "time": {"duration": 2.5, "step": 2.0**-7}, "output": {"every": 0.125, "points": 65},
    }  # fmt: skip


@pytest.mark.long
def test_the_same_motion_in_every_unit() -> None:
    """Round-off grows to 1e-12 m by the end."""
    first, *others = (hybrid.run(scene(u, "rod"), progress=False) for u in UNITS)
    assert any(event.kind == "line touches itself" for event in first.events)
    kinds = [(event.t, event.kind) for event in first.events if event.kind != "implausible"]  # numbers of other units
    for u, other in zip(UNITS[1:], others, strict=True):
        for name, line in first.lines.items():
            assert np.abs(other.lines[name].position / u - line.position).max() < 1e-9
        assert [(event.t, event.kind) for event in other.events if event.kind != "implausible"] == kinds


def test_a_tail_that_goes_slack_stops_at_the_same_time_in_every_unit() -> None:
    stops = []
    for u in UNITS:
        with pytest.raises(hybrid.ComputationError, match="compression") as stopped:
            hybrid.run(scene(u, "catenary"), progress=False)
        stops.append((stopped.value.t, stopped.value.s / u))
    assert stops == [pytest.approx(stops[0], rel=1e-6)] * len(UNITS)
