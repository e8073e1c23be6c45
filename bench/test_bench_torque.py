"""Torque through catenary zones: the table of torque, distance and cost against rods (docs/theory.md, 15).

pytest bench/test_bench_torque.py -m bench -n 0 -s
"""

from __future__ import annotations

import statistics
import time
from typing import Any

import numpy as np
import pytest

import hybrid
from tests.inside import OnlyLine

pytestmark = pytest.mark.bench

RODS = ({"rod": 12, "cells": 48}, {"rod": 36, "cells": 144}, {"rod": 12, "cells": 48})
MIDDLE = (RODS[0], {"catenary": 36, "cells": 144}, RODS[2])


def sag(turns: float, zones: Any, holds: bool = True, **more: Any) -> hybrid.Scene:
    """60 m of cable in a current across, one end twisted against the other, or turning freely."""
    section = {
        "length": 60.0, "mass": 0.6, "diameter": 0.02, "bending_stiffness": 10.0, "torsional_stiffness": 8.0,
        "drag": {"normal": 1.2}, "damping": {"mass": 0.2},
    }  # fmt: skip
    start = {"kind": "clamped", "position": [0, 0, 0], "tangent": [0.75, 0, -0.66], "normal": [0, 1, 0]}
    end = {"kind": "clamped", "position": [55, 0, 0], "tangent": [0.75, 0, 0.66], "normal": [0, 1, 0]}
    end |= {"turns": turns} if holds else {"swivel": True}
    fluid = {"density": 1000.0, "current": {"kind": "uniform", "velocity": [0.0, 0.3, 0.0]}}
    return hybrid.validate_scene(
        {
            "environment": {"gravity": 9.81, "fluid": fluid}, "cable": {"sections": [section]},
            "ends": {"start": start, "end": end | more.pop("end", {})}, "initial": "equilibrium",
            "model": {"kind": "zones", "zones": zones}, **more,
        }
    )  # fmt: skip


def test_table() -> None:
    """Torque within 2e-5 of rods at 4, 20 and 60 turns."""
    print("\nturns  torque (N m)  error of torque  distance/L")
    for turns in (4, 20, 60):
        rod, mixed = hybrid.static(sag(turns, RODS)), hybrid.static(sag(turns, MIDDLE))
        torque = float(rod["torque"][0].mean())
        error = abs(float(mixed["torque"][0].mean()) / torque - 1.0)
        apart = float(np.linalg.norm(rod["position"][0] - mixed["position"][0], axis=1).max()) / 60.0
        print(f"{turns:5}  {torque:12.4g}  {error:15.1e}  {apart:10.1e}")
        assert error < 2e-5


def test_cost_of_motion() -> None:
    """At most 5 % more than a line that carries none: medians of pairs of runs, CPU time."""
    moved = {"motion": {"sway": {"amplitude": 2.0, "period": 8.0}, "ramp": 3.0}}
    more = {"time": {"duration": 12.0, "step": 0.01}, "output": {"every": 1.0}, "end": moved}
    ratios, spent = [], {}
    for _ in range(6):
        for holds in (True, False):
            began = time.process_time()
            hybrid.run(sag(4, MIDDLE, holds, **{k: dict(x) for k, x in more.items()}))
            spent[holds] = time.process_time() - began
        ratios.append(spent[True] / spent[False])
    ratio = statistics.median(ratios[1:])
    print(f"\ntorque costs {100.0 * (ratio - 1.0):.1f} % of a run (asked: 5 %)")
    assert ratio < 1.05


def test_cost_of_the_time_loop() -> None:
    """The same without start and file: medians of pairs of stretches of 0.5 s, in turn first and second, CPU time."""
    moved = {"motion": {"sway": {"amplitude": 2.0, "period": 8.0}, "ramp": 3.0}}
    more = {"time": {"duration": 40.0, "step": 0.01}, "output": {"every": 1.0}, "end": moved}
    simulations = {
        holds: hybrid.Simulation(sag(4, MIDDLE, holds, **{k: dict(x) for k, x in more.items()}))
        for holds in (True, False)
    }
    ratios, spent, iterations = [], {}, {True: 0, False: 0}
    for k in range(61):
        for holds in (True, False) if k % 2 else (False, True):
            simulation = simulations[holds]
            began = time.process_time()
            simulation.advance(simulation.t + 0.5)
            spent[holds] = time.process_time() - began
            iterations[holds] += OnlyLine(simulation).iterations
        ratios.append(spent[True] / spent[False])
    ratio = statistics.median(ratios[1:])
    more_iterations = iterations[True] / iterations[False] - 1.0
    print(
        f"\ntorque costs {100.0 * (ratio - 1.0):.1f} % of the time loop (asked: 5 %), {100.0 * more_iterations:.1f} % "
        "more iterations (asked: 3 %)"
    )
    assert ratio < 1.05 and more_iterations < 0.03
