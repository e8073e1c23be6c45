"""Pairs of features against closed forms, and against the same line computed by something else."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from tests.combinations.pairs import BASE, ZONES, S, Tables
from tests.problems import tables_with

EXACT: Tables = {"output.exact": True}


def ran(**changes: Any) -> hybrid.Result:
    """The tiny scene of the pairs with these changes, by key."""
    return hybrid.run(tables_with(BASE, EXACT | changes))


def apart(one: hybrid.Result, two: hybrid.Result, field: str = "position") -> float:
    """Largest difference over the largest value."""
    return float(np.abs(one[field] - two[field]).max() / np.abs(one[field]).max())


# --- rotary inertia, of zones that move -----------------------------------------------------------

HEAVY = {S + "rotary_inertia": [0.6, 0.9]}  # kg m: as much kinetic energy as the mass has, in waves of 2 m


@pytest.mark.parametrize("rods", [[[0, 12]], [[0, 4], [8, 12]]])
@pytest.mark.parametrize("torque", [0.0, 2e-3])
def test_rods_of_zones_that_move_have_the_inertia_of_rods_that_stay(rods: list[list[float]], torque: float) -> None:
    whole = len(rods) == 1
    stays: Tables = {"model": "rod"} if whole else {"model": ZONES, "mesh": None}
    moves = {"model": {"kind": "adaptive", "force_rod": rods} | ({} if whole else {"force_catenary": [[4, 8]]})}
    more = {S + "tension_torque": torque} if torque else {}
    one, two, without = ran(**stays, **HEAVY, **more), ran(**moves, **HEAVY, **more), ran(**stays, **more)
    assert apart(one, two) < 1e-9
    assert apart(one, two, "energy/kinetic") < 1e-6
    assert apart(one, without) > 1e-4


def test_a_taut_line_whose_rods_come_and_go_is_as_slow_as_that_of_rayleigh() -> None:
    """omega^2 = (T k^2 + EI k^4)/(m + J k^2), k = n pi/L, of a line with hinged ends."""
    pull, EI, EA, J, mass, length = 400.0, 200.0, 1e7, 3.0, 2.0, 10.0
    section = {"length": length, "mass": mass, "axial_stiffness": EA, "bending_stiffness": EI,
               "torsional_stiffness": 100.0, "rotary_inertia": J}  # fmt: skip
    far = {"kind": "pinned", "position": [length * (1.0 + pull / EA), 0, 0]}
    found = hybrid.modes(
        {
            "environment": {"gravity": 0.0}, "cable": {"sections": [section]}, "initial": "equilibrium",
            "ends": {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": far},
            "model": {"kind": "adaptive", "force_rod": [[0, length]]}, "mesh": {"cells": 100},
        },
        20,
    )  # fmt: skip
    omega = np.array([2.0 * np.pi / x.period for x in found.modes])
    for n in (1, 2, 3):
        k = n * np.pi / length
        expected = np.sqrt((pull * k**2 + EI * k**4) / (mass + J * k**2))
        assert np.sum(np.abs(omega / expected - 1.0) < 1e-3) == 2  # in both planes


def test_energy_of_rods_with_inertia_that_come_and_go_is_booked() -> None:
    """What a switch puts in, that of inertia included, is in work/zones; what is left for the scheme stays small."""
    model = {"kind": "adaptive", "hold_time": 0.1, "tolerance": 0.02}
    motion = {"travel": {"by": [-4.0, 0, 0], "over": 2.0}}
    far = {"kind": "pinned", "position": [11.4, 0, 0], "motion": motion}
    more = {"ends.end": far, "time": {"duration": 3.0, "step": 0.01}, "mesh.cells": 48}
    moved = ran(model=model, **HEAVY, **more)
    booked = np.abs(np.diff(moved["work/zones"])).sum()
    own = max(np.abs(ran(model=kind, **HEAVY, **more)["work/scheme"]).max() for kind in ("rod", "catenary"))
    assert sum(x.kind in ("split", "grow") for x in moved.events) > 5 and booked > 0.0
    assert np.abs(moved["work/scheme"]).max() <= 2.0 * own + 0.1 * booked
