"""Pairs of what twists a line, each against what it must be."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from tests.combinations.pairs import ADAPTIVE, BASE, CLAMP, END, FAR, START, ZONES, S, Tables, as_network
from tests.problems import tables_with

# --- turns of an end beside a swivel --------------------------------------------------------------


@pytest.mark.parametrize("model", ["rod", ZONES, ADAPTIVE], ids=["rod", "zones", "moves"])
def test_a_swivel_lets_the_turns_of_an_end_go_back(model: Any) -> None:
    """Whatever the number of turns, also more than cells could hold: the line without them, and no torque at all."""
    swivel: Tables = {"cable.attachments": [{"kind": "swivel", "at": 5.0}], START: CLAMP, END: FAR, "model": model}
    swivel |= {"mesh": None} if model is ZONES else {}
    plain = hybrid.run(tables_with(BASE, swivel))
    held = hybrid.run(tables_with(BASE, swivel | {"cable.attachments": [], END + ".turns": 0.7}))
    assert np.abs(held["torque"]).max() > 1.0
    for turns in (0.7, -5.3, 200.0):
        tables = tables_with(BASE, swivel | {END + ".turns": turns})
        system = as_network(tables)
        for found in (hybrid.run(tables), hybrid.run(system).lines["cable"]):
            assert np.abs(found.position - plain.position).max() < 1e-9
            assert np.abs(found["torque"]).max() < 1e-9
        what = next(x for x in hybrid.plan(tables).contents if x.what.startswith("twist by"))
        assert not what.on and "swivel at s = 5 m lets it turn back" in what.why and not what.event


# --- swivels beside sections that have a direction ------------------------------------------------

BESIDE: Tables = {
    "length": 12.0,
    "mass": 2.0,
    "axial_stiffness": 1e5,
    "torsional_stiffness": 15.0,
    "damping": {"mass": 0.5},
}
IN_PLANE, DOWN = [0.0, 1.0, 0.0], [-0.8, 0.0, 1.0]  # axes of the section at the far clamp: along the normal, or not


def over_a_swivel(beside: Tables, normal: list[float], cells: int = 24, model: Any = "rod") -> hybrid.Result:
    """A section on both sides of a swivel, whose sides lie as their clamps have them, in a vertical plane."""
    far = FAR | {"normal": normal}
    return hybrid.run(tables_with(BASE, {
        "cable": {"sections": [BESIDE | beside], "attachments": [{"kind": "swivel", "at": 5.0}]}, START: CLAMP, END: far,
        "mesh": {"cells": cells}, "model": model,
    }))  # fmt: skip


def of_two_sections(before: Tables, after: Tables, cells: int = 24, model: Any = "rod") -> hybrid.Result:
    """Two sections that meet without a swivel where it is."""
    sections = [BESIDE | {"length": 5.0} | before, BESIDE | {"length": 7.0} | after]
    return hybrid.run(tables_with(BASE, {
        "cable": {"sections": sections}, START: CLAMP, END: FAR, "mesh": {"cells": cells}, "model": model,
    }))  # fmt: skip


@pytest.mark.parametrize("model", ["rod", ADAPTIVE], ids=["rod", "moves"])
def test_sides_of_a_swivel_that_lie_across_each_other_bend_as_two_sections(model: Any) -> None:
    """In their plane one bends about its first axis and the other about its second: sections of EI_1 and of EI_2."""
    if model == "rod":
        found = over_a_swivel({"bending_stiffness": [20.0, 8.0]}, DOWN)
        same = of_two_sections({"bending_stiffness": 20.0}, {"bending_stiffness": 8.0})
        assert np.abs(found.position - same.position).max() < 1e-9
        assert np.abs(found["bending_moment"] - same["bending_moment"])[:, [0, 3, 9, 12]].max() < 1e-8
    kappa = {"bending_stiffness": 20.0, "intrinsic_curvature": [0.1, 0, 0]}
    against = kappa | {"intrinsic_curvature": [-0.1, 0, 0]}
    found, same = over_a_swivel(kappa, [0.0, -1.0, 0.0], model=model), of_two_sections(kappa, against, model=model)
    assert np.abs(found.position - same.position).max() < 1e-9
    assert np.abs(found["torque"]).max() < 1e-9


def test_what_curves_without_load_is_straight_over_the_cell_of_a_swivel() -> None:
    """The bend that its element does not have is of the first order in the cells, against a line without a swivel."""
    kappa = {"bending_stiffness": 20.0, "intrinsic_curvature": [0.1, 0, 0]}
    off = [
        np.abs(over_a_swivel(kappa, IN_PLANE, n).position - of_two_sections(kappa, kappa, n).position).max()
        for n in (48, 96, 192)
    ]
    assert np.log2(np.array(off[:-1]) / off[1:]) == pytest.approx(1.0, abs=0.1)


def test_layers_that_slip_do_not_feel_the_twist_of_a_swivel() -> None:
    """Its sides may be turned by any angle against each other: the line is the same, without torque."""
    slip: Tables = {
        S + "bending_stiffness": 8.0,
        S + "bending_slip": [{"stiffness": 12.0, "moment": 0.4, "per_tension": 1e-3}, {"stiffness": 5.0, "moment": 0.5}],
        "cable.attachments": [{"kind": "swivel", "at": 5.0}], START: CLAMP, END: FAR,
    }  # fmt: skip
    plain = hybrid.run(tables_with(BASE, slip))
    for turns in (0.2, 0.4):
        found = hybrid.run(tables_with(BASE, slip | {END + ".turns": turns}))
        assert np.abs(found.position - plain.position).max() < 1e-9
        assert np.abs(found["torque"]).max() < 1e-9


@pytest.mark.parametrize("stiffness", [20.0, [20.0, 8.0]])
def test_a_swivel_at_a_clamp_that_holds_a_direction_says_so(stiffness: Any) -> None:
    tables = tables_with(BASE, {
        "cable": {"sections": [BESIDE | {"bending_stiffness": stiffness}]}, START: CLAMP | {"swivel": True}, END: FAR,
        "mesh": {"cells": 24}, "model": "rod", "time.duration": 0.1,
    })  # fmt: skip
    told = [e.text for e in hybrid.run(tables).events if e.kind == "ignored"]
    assert any("free turning at the swivel of ends.start" in x for x in told) == isinstance(stiffness, list)
