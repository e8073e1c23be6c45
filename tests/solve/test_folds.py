"""Folds of more than a right angle between two cells of a cable: a line hangs in a tight one, and none stands on one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.errors import ComputationError, Outcome
from hybrid.kernels.state.state import Line, State
from hybrid.model.network import NetworkModel, build_system
from hybrid.scene.network import Network
from hybrid.scene.root import in_full
from hybrid.simulation.equilibrium import equilibrium_of, group_of
from hybrid.solve.flaws import FOLDED, folds
from hybrid.solve.lines_at_rest import lines_at_rest
from hybrid.solve.network_solver import NO_BODIES
from hybrid.solve.stepper import NetworkState
from tests.scenes import pinned_at


def hairpin(cells: int, model: str = "rod", apart: float = 0.0, **more: Any) -> dict[str, Any]:
    """A line of 20 m between points next to each other, which bends over (EI/w)^(1/3) = 0.3 m where it is a rod."""
    section = {"length": 20.0, "mass": 1.0, "diameter": 0.01, "bending_stiffness": 0.25}
    ends = {"start": pinned_at(0, 0, 0), "end": pinned_at(apart, 0, 0)}
    cable = {"sections": [section]} | more
    return {"cable": cable, "ends": ends, "initial": "equilibrium", "model": model, "mesh": {"cells": cells}}


def model_of(tables: dict[str, Any]) -> tuple[Network, NetworkModel]:
    network = in_full(hybrid.validate_scene(tables))
    return network, build_system(network)


def rest_of(tables: dict[str, Any]) -> tuple[Line, State]:
    network, model = model_of(tables)
    return model.models[0].line, equilibrium_of(network, model, 0.0).state.lines[0]


def test_no_rod_stands_on_a_fold() -> None:
    """Newton's first answer on 21 cells turns by 173 deg into a cell that presses with 10.1 N, more than its weight."""
    _, model = model_of(hairpin(21))
    first = NetworkState([model.models[0].start])
    with pytest.raises(ComputationError) as refused:
        lines_at_rest(group_of(model, 0.0, NO_BODIES), [("the first shape", first)], quick=True)
    assert refused.value.outcome == Outcome.FOLDED
    assert refused.value.s == pytest.approx(10.0, abs=2.0)
    assert "would show the bend" in str(refused.value)
    line, state = rest_of(hairpin(21))
    assert state.T.min() > -9.81 * 20.0 / 21.0
    assert np.degrees(folds(line, state).max()) == pytest.approx(98.5, abs=1.0)
    assert state.r[:, 2].min() == pytest.approx(-10.0, abs=0.5)


@pytest.mark.parametrize(("kind", "lowest"), [("rod", -9.98), ("catenary", -9.99)])
def test_a_line_that_hangs_in_a_fold_is_right_to_a_cell_and_says_so(kind: str, lowest: float) -> None:
    found = hybrid.static(hairpin(20, kind, 0.4))
    (said,) = [event for event in found.events if event.kind == "unresolved bend"]
    assert said.s_a == pytest.approx(10.0)
    assert "add cells" in said.text or "cells of" in said.text
    assert np.asarray(found.position)[-1][:, 2].min() == pytest.approx(lowest, abs=0.05)


@pytest.mark.parametrize("model", ["rod", "catenary"])
def test_a_point_load_makes_a_true_kink(model: str) -> None:
    """A clump, in air, and a float without mass, in water that nothing drags, pull a line into two strands."""
    clump = {"attachments": [{"kind": "clump", "at": 10.0, "mass": 100.0}]}
    line, state = rest_of(hairpin(20, model, 0.4, **clump))
    chords = state.e / np.linalg.norm(state.e, axis=1)[:, None]
    assert chords[9] @ chords[10] < np.cos(FOLDED)
    assert folds(line, state)[10] == 0.0
    assert "unresolved bend" not in {
        event.kind for event in hybrid.static(hairpin(20, "catenary", 0.4, **clump)).events
    }


def test_a_float_without_mass_is_a_point_load() -> None:
    lift = {"attachments": [{"kind": "float", "at": 10.0, "buoyancy": 2000.0}]}
    tables = hairpin(20, "rod", 0.4, **lift) | {"environment": {"fluid": {"density": 1000.0}}}
    line, state = rest_of(tables)
    chords = state.e / np.linalg.norm(state.e, axis=1)[:, None]
    assert chords[9] @ chords[10] < np.cos(FOLDED)
    assert folds(line, state)[10] == 0.0
