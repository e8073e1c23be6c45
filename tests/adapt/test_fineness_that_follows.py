"""Cells that follow the curvature at another fineness, as runs to compare with have it; beside hinges; their number."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from adapt_cases import cable, hanging, layout, on, state_on, still

import hybrid
from hybrid.adapt.manager import DomainManager
from hybrid.kernels.binding import Table
from hybrid.kernels.state import Floats, no_sea
from hybrid.kernels.zone_step import blank_zone_job, plan_nodes
from hybrid.model.resolution import wants_survey
from hybrid.simulation.run_sample import compared_cells, mean_cells
from hybrid.store.records import MeshHistory, ZoneHistory, there
from hybrid.store.records import Zone as ZoneRow


def planned(shape, fineness=1.0, share=0.02, leaving=(), every=1) -> Floats:
    """Nodes that a rod of 8 base cells on a shape asks for, from 64/every cells in each; leaving: base cells let go."""
    what, zones = cable(10.0), layout(np.linspace(0.0, 10.0, 9), 64, "R" * 8)
    zones = zones._replace(here=np.arange(8 * 64 + 1) % every == 0)
    line = on(what, zones)
    state = state_on(line, shape, 1e4)
    manager = DomainManager(what, zones, 1e3, 1.0, np.ones(8, int), 1.0, curvature_error=share, fineness=fineness)
    manager.evaluate_criteria(line, no_sea(line.h.size), still(), state, 0.0)
    manager.zones.next_rod[:] = True
    manager.zones.leaving[list(leaving)] = True
    table = Table(blank_zone_job())
    table.bind(line=line, new=state, zones=manager.zones)
    for _ in range(5):  # for so long two cells must be too short before they become one
        plan_nodes(table.numbers)
    return zones._replace(here=manager.zones.plan.copy()).nodes


@pytest.mark.parametrize("share", [0.1, 0.4], ids=["by curvature", "by turn"])
def test_finer_cells_are_shorter_whatever_their_length_is_by(share: float) -> None:
    """Dyadic parts: at twice the fineness all but the transitions are halves.

    A limit that stayed the same at every fineness would hide its error from runs that are compared.
    """
    shape = hanging(0.8, 5.0)[0]
    found = [planned(shape, x, share) for x in (0.5, 1.0, 2.0)]
    inner = [x[abs(x - 5.0) < 2.5] for x in found]
    for coarse, fine in pairwise(inner):
        assert set(coarse) <= set(fine)
        assert 1.9 < np.diff(coarse).min() / np.diff(fine).min() < 2.1
        assert 1.5 < fine.size / coarse.size < 2.5


def test_no_cells_are_spent_on_the_layer_of_a_hinge() -> None:
    """Where a rod is let go its neighbour ends as at a hinge: the kink there is no bend of the line.

    The same kink within a rod asks for the shortest cells.
    """
    angle = 0.02

    def shape(s: Floats) -> Floats:
        after = np.maximum(s - 5.0, 0.0)
        return np.column_stack([s - after * (1.0 - np.cos(angle)), 0.0 * s, after * np.sin(angle) + 1e-3 * s * s])

    kinked, hinged = (planned(shape, leaving=x, every=16) for x in ((), range(4, 8)))
    near = [float(np.diff(x)[abs(x[:-1] - 5.0) < 0.5].min()) for x in (kinked, hinged)]
    assert near[1] > 4.0 * near[0], near


FOLLOWS = {
    "environment": {"fluid": {"density": 1025}},
    "cable": {"sections": [{"length": 60, "mass": 1.0, "diameter": 0.03, "bending_stiffness": 20.0}]},
    "ends": {
        "start": {"kind": "pinned", "position": [0, 0, 0]},
        "end": {"kind": "pinned", "position": [40, 0, -20], "motion": {"surge": {"amplitude": 1, "period": 6}, "ramp": 12}},
    },
    "initial": "equilibrium",
    "model": {"kind": "adaptive", "curvature_error": 0.1},
    "time": {"duration": 6.0},
    "accuracy": {"curvature": "10%"},
}  # fmt: skip


def test_runs_are_compared_by_the_cells_beyond_those_that_stay() -> None:
    """Base cells are as many at any fineness; where there are no others a finer run is no finer."""
    zones = layout(np.linspace(0.0, 10.0, 9), 8, "R" * 8)
    model = type("Model", (), {"layout": zones, "cells": 64})
    assert (compared_cells(model, 30.4), compared_cells(model, 8.0), compared_cells(model)) == (22, 1, 8)
    s = np.linspace(0.0, 1.0, 101)
    words = np.array([there(s, s[::k]) for k in (1, 10, 50)])
    assert mean_cells(words) == pytest.approx((100 + 10 + 2) / 3.0)
    assert not wants_survey(hybrid.validate_scene(FOLLOWS))


def test_mesh_of_a_result_has_the_nodes_of_catenaries_too() -> None:
    """Cells of catenaries follow as those of rods do."""
    s = np.linspace(0.0, 4.0, 9)
    words = np.array([there(s, s[[0, 1, 4, 6, 8]])])
    zones = ZoneHistory(np.array([0, 0]), [ZoneRow("rod", 0.0, 2.0), ZoneRow("catenary", 2.0, 4.0)], 1)
    (mesh,) = MeshHistory(s, np.isin(s, (0.0, 2.0, 4.0)), zones, words)
    assert mesh.s.tolist() == [0.0, 0.5, 2.0, 3.0, 4.0]
    assert list(mesh.kinds) == ["rod", "rod", "catenary", "catenary"]
