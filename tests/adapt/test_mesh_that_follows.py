"""Cells that follow the curvature: what a result says of its mesh, and what an accuracy may change of them."""

from __future__ import annotations

import numpy as np

import hybrid
from hybrid.accuracy.passes import free_in
from hybrid.model.resolution import wants_survey
from hybrid.store.records import MeshHistory, ZoneHistory, there
from hybrid.store.records import Zone as ZoneRow

SCENE = {
    "environment": {"fluid": {"density": 1025}},
    "cable": {"sections": [{"length": 60, "mass": 1.0, "diameter": 0.03, "bending_stiffness": 20.0}]},
    "ends": {
        "start": {"kind": "pinned", "position": [0, 0, 0]},
        "end": {"kind": "pinned", "position": [40, 0, -20]},
    },
    "initial": "equilibrium",
    "model": {"kind": "adaptive", "curvature_error": 0.1},
    "time": {"duration": 6.0},
    "accuracy": {"curvature": "10%"},
}  # fmt: skip


def test_mesh_of_a_result_has_the_nodes_of_catenaries_too() -> None:
    """Cells of catenaries follow as those of rods do."""
    s = np.linspace(0.0, 4.0, 9)
    words = np.array([there(s, s[[0, 1, 4, 6, 8]])])
    zones = ZoneHistory(np.array([0, 0]), [ZoneRow("rod", 0.0, 2.0), ZoneRow("catenary", 2.0, 4.0)], 1)
    (mesh,) = MeshHistory(s, np.isin(s, (0.0, 2.0, 4.0)), zones, words)
    assert mesh.s.tolist() == [0.0, 0.5, 2.0, 3.0, 4.0]
    assert list(mesh.kinds) == ["rod", "rod", "catenary", "catenary"]


def test_no_pre_run_and_no_stricter_zones_where_cells_follow() -> None:
    """A pre-run places no cells there, and the tolerance that it made stricter shortened all cells of the line.

    The share of the curvature decides what is rod.
    """
    follows = hybrid.validate_scene(SCENE)
    stays = hybrid.validate_scene(SCENE | {"model": {"kind": "adaptive"}})
    assert wants_survey(stays) and free_in(stays).zones
    assert not wants_survey(follows) and not free_in(follows).zones and free_in(follows).mesh
