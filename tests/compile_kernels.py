"""Compile the kernels that most tests call, one half of them: `python tests/compile_kernels.py solvers`, or `rest`.

With `tests` behind it those, too, that few scenes call and many tests, among them what the features of scenes do: a
wheel goes without (release/build_wheel.py).

The first half is what marches along lines, the second what is around: zones, cells, payout, contact, bodies, outputs.
Started together (conftest.py) they keep two cores busy.  Kernels that share laws are in one half: what both need, a
sixth of the code, is read by numba twice.
"""

from __future__ import annotations

import gc
import os
import sys
from importlib import import_module
from pathlib import Path

import numpy as np

import hybrid
from hybrid.simulation.first_use import payout_kernels
from tests.scenes import cable_scene, line_between, network_scene, pinned_at

CABLE = {"length": 20, "mass": 2, "diameter": 0.03, "axial_stiffness": 1e6, "bending_stiffness": 20}
CABLE |= {"drag": {"normal": 1.2}, "added_mass": {"normal": 1}}
SCENE = cable_scene(
    CABLE, pinned_at(0, 0, -9), pinned_at(14, 0, 0, motion={"heave": {"amplitude": 0.1, "period": 4}, "ramp": 4}),
    fluid={"density": 1025}, seabed={"z": -9, "stiffness": 1e3}, mesh=12, time=(0.2, 0.1)
)  # fmt: skip
LINE = {"start": "low", "end": "free", "model": "rod", "mesh": {"cells": 12}, "sections": [CABLE]}
LINES = network_scene(
    {"low": {"position": [0, 0, 0]}, "high": {"position": [12, 0, 0]},
     "free": {"kind": "free", "initial_guess": [11, 0, 0]}},
    {"a": LINE | {"contact": {"self": True, "friction": 0.3}},
     "b": LINE | line_between("free", "high", CABLE | {"length": 5}, model="catenary")},
    fluid={"density": 1025}, time=(0.2, 0.1)
)  # fmt: skip

# The longest first: who comes second to a kernel loads it, or waits.
BY_TABLE = {
    "solvers": """run.newton.in_space run.newton.in_plane run.newton.solve_network run.network.begin_line
        run.network_run.sample_network run.network.book_network_step""",
    "rest": """mesh.zone_step.advance_zones mesh.cell_changes.begin_switch mesh.cell_changes.end_switch
        mesh.zone_step.plan_nodes mesh.zone_step.read_arcs mesh.zone_transfer.transfer mesh.cell_changes.plan_cells
        mesh.cell_changes.clear_state mesh.cell_changes.renew mesh.remesh.put_cells mesh.remesh.begin_cells
        mesh.remesh.end_cells contact.self_contact.contact_task contact.self_distance.watch_itself
        junctions.lines_contact.touch_network junctions.lines_contact.shared_task
        contact.self_contact_pairs.observe_points junctions.sheaves_and_winches.wind_lines junctions.sheaves_and_winches.spin_sheaves
        junctions.junctions.twist_lines junctions.junctions.join_lines junctions.body_contact.meet_bodies
        watch.named_quantities.note_quantities run.network_run.run_network""",
}

IN_TESTS = "run.network_tangents.advance_in_plane run.network_tangents.advance_joined"  # solvers, too


def main(half: str, for_tests: bool) -> None:
    gc.disable()  # numba leaves a hundred MB of garbage per large kernel: cheaper left than searched for
    os.cpu_count = lambda: 1  # or each run below would start a process that compiles beside it
    table = np.zeros(0, np.int64)
    for name in [*BY_TABLE[half].split(), *(IN_TESTS.split() if for_tests and half == "solvers" else ())]:
        file, function = name.rsplit(".", 1)
        getattr(import_module(f"hybrid.kernels.{file}"), function).compile_unless_busy(table)
    if half == "rest":
        for kernel in payout_kernels():
            kernel.compile_unless_busy(table)
        hybrid.run({**SCENE, "dimension": 3}, progress=False)
        hybrid.run(LINES, progress=False)
        return
    hybrid.run({**SCENE, "dimension": 2}, progress=False)
    if for_tests:
        sys.path.insert(0, str(Path(__file__).parents[1]))
        from tests.combinations.pairs import FEATURES, scene_of

        for feature in FEATURES:
            hybrid.run(scene_of(feature), progress=False)


if __name__ == "__main__":
    main(sys.argv[1], for_tests="tests" in sys.argv[2:])
    os._exit(0)  # nor is it searched for at the end
