"""Rods that are curved without load, and lines with swivels, while they are paid out or taken in."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from tests.problems import tables_with

LENGTH = 8.0
SECTION = {
    "length": LENGTH, "mass": 1.0, "diameter": 0.05, "axial_stiffness": 1e5, "bending_stiffness": 60.0,
    "torsional_stiffness": 50.0, "damping": {"mass": 2.0},
}  # fmt: skip
CURL = [0.25, 0.2, 0.1]
FAR = {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, 0.5], "normal": [0, 1, 0]}
NEAR = {"kind": "clamped", "position": [6, 0, 1], "tangent": [1, 0, 0.6], "normal": [0, 1, 0]}


def sagging(rate: float | None, duration: float, near: dict[str, Any], **changes: Any) -> dict[str, Any]:
    paid = {} if rate is None else {"payout": {"rate": rate, "ramp": 4.0}}
    scene = {
        "environment": {"gravity": 9.81}, "cable": {"sections": [SECTION]},
        "ends": {"start": FAR, "end": near | paid}, "initial": "equilibrium", "model": "rod", "mesh": {"cells": 40},
        "contact": {"self": False}, "time": {"duration": duration, "step": duration / 800},
        "output": {"every": duration / 10, "points": 17},
    }  # fmt: skip
    return dict(tables_with(scene, changes))


def test_a_curved_rod_that_is_paid_out_freely_follows_its_own_arc() -> None:
    """Without weight it leaves the clamp along the circle of its curvature, and has no moment: a closed form."""
    kappa, rate, begin, EI = 0.5, 0.1, 2.0, 60.0
    section = {"length": begin, "mass": 1.0, "diameter": 0.05, "axial_stiffness": 1e6, "bending_stiffness": EI,
               "torsional_stiffness": EI, "intrinsic_curvature": [0, kappa, 0]}  # fmt: skip
    winch = {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, 0], "normal": [0, 0, 1]}
    result = hybrid.run({
        "environment": {"gravity": 0}, "cable": {"sections": [section]}, "initial": "equilibrium", "model": "rod",
        "ends": {"start": {"kind": "free"}, "end": winch | {"payout": {"rate": rate, "ramp": 4.0}}},
        "mesh": {"cells": 20}, "contact": {"self": False}, "time": {"duration": 12.0, "step": 0.01},
        "output": {"every": 2.0, "points": 5},
    })  # fmt: skip
    out = result["payout/length"]
    assert out[-1] == pytest.approx(begin + rate * 10.0, abs=1e-9)
    way = np.array([np.sin(kappa * out), 0.0 * out, 1.0 - np.cos(kappa * out)]).T / kappa
    assert np.abs(np.abs(result.position[:, 0]) - way).max() < 1e-3 * begin  # of the free end, s = 0
    assert result["energy/bending"].max() < 1e-5 * 0.5 * EI * kappa**2 * begin


@pytest.mark.parametrize("rate", [0.3, -0.3])
def test_energy_that_comes_with_curved_material_is_booked(rate: float) -> None:
    """The scheme is left with a thousandth of a joule of the 3 J that bending changes by, at a clamp where bends stay."""
    result = hybrid.run(sagging(rate, 4.0, NEAR, **{"cable.sections.0.intrinsic_curvature": CURL}))
    assert abs(result["work/scheme"][-1]) < 2e-3
    assert abs(result["energy/bending"][-1] - result["energy/bending"][0]) > 3.0


def test_a_curved_rod_comes_to_rest_where_one_of_its_length_does() -> None:
    """Paid out slowly, in damping: the equilibrium of the longer line, from which one that is straight is far."""
    near = {"kind": "pinned", "position": [6, 0, 1]}
    curled = {"cable.sections.0.intrinsic_curvature": CURL}
    slowly = hybrid.run(sagging(0.02, 40.0, near, **curled))
    long = float(slowly["payout/length"][-1])
    s = slowly.s[slowly.s <= LENGTH]
    rest, straight = (
        hybrid.static(sagging(None, 40.0, near, **{"cable.sections.0.length": long} | more)) for more in (curled, {})
    )
    there, other = (np.array([np.interp(s, x.s, x.position[-1, :, k]) for k in range(3)]).T for x in (rest, straight))
    found = slowly.position[-1, : s.size]
    assert np.abs(found - there).max() < 5e-3
    assert np.abs(found - other).max() > 0.1


def test_a_swivel_near_the_far_end_of_a_line_that_is_paid_out_lets_it_turn() -> None:
    """The far clamp turns by 1 rad: torque GJ/L of what is out without a swivel, and none with it but by inertia."""
    turn = {"roll": {"amplitude": float(np.degrees(1.0)), "period": 16.0, "phase": -90}, "ramp": 2.0}
    taut = {
        "ends.start": FAR | {"tangent": [1, 0, 0], "motion": turn}, "environment.gravity": 0.0,
        "cable.sections.0.damping": {"mass": 0.5}, "time.step": 0.01,
    }  # fmt: skip
    near = NEAR | {"position": [8.1, 0, 0], "tangent": [1, 0, 0]}
    swivel = {"cable.attachments": [{"kind": "swivel", "at": 1.0}]}
    plain, free = (hybrid.run(sagging(0.005, 8.0, near, **taut, **x)) for x in ({}, swivel))
    out = plain["payout/length"][-1]
    assert out == pytest.approx(LENGTH + 0.005 * 6.0, abs=1e-9)
    assert np.abs(plain["torque"][-1]).max() == pytest.approx(SECTION["torsional_stiffness"] / out, rel=1e-3)
    assert np.abs(free["torque"]).max() < 1e-3 * np.abs(plain["torque"]).max()
    assert free.position[-1] == pytest.approx(
        np.array([np.interp(free.s, plain.s, plain.position[-1, :, k]) for k in range(3)]).T, abs=1e-6 * LENGTH
    )
