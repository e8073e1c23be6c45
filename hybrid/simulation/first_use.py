"""The first use on a machine: which kernels a scene calls, and their compilation in two processes."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np

from hybrid.kernels.laws.obstacles import stored_energy
from hybrid.kernels.machine.compile import entry, is_warm
from hybrid.kernels.mesh.remesh import ask_cells, change_cells, put_cells
from hybrid.kernels.state.report import SEABED
from hybrid.model.build import Model, build
from hybrid.model.payout import payout_of
from hybrid.model.resolution import first_resolution, wants_errors
from hybrid.scene.analysis import Equilibrium, RodModel, RodZone, ZonesModel
from hybrid.scene.plane import EXACT, TYPED, plane_of
from hybrid.scene.root import Scene
from hybrid.scene.schema import LineScene, reachable_obstacles

# What is compiled together, by the kernel that stands for it: the last.
SOLVER = ("run.newton.in_plane", "run.newton.in_space")
OUTPUTS = "watch.observed_outputs.observe_outputs"
ZONES = "mesh.zone_step.advance_zones"
CRITERIA = "mesh.zone_step.evaluate_criteria"
ZONE_CHANGES = "mesh.cell_changes.begin_switch", "mesh.cell_changes.end_switch", "mesh.cell_changes.renew"
STABILITY, TOUCHING = "laws.out_of_plane.wrong_pivots_at_rest", "contact.self_contact.contact_task"
# Steps, equilibria, lines that are joined or touch, those that are paid out.
OF_JOINED = "run.newton.solve_network", "junctions.junctions.join_lines"
STEPS_OF_LINES, REST_OF_LINES = "run.network_run.run_network", "run.network_run.sample_network"
BOOKS_OF_LINES, START_OF_LINES = "run.network.book_network_step", "run.network.begin_line"
# What several of these call, each compiled once: extremes and criteria of zones of a state, its energies.
EXTREMES, WEIGHED = "watch.extremes.note_extremes", "mesh.zone_step.evaluate"
ENERGIES = "march.energies.observe"
TOUCHING_LINES = "junctions.lines_contact.touch_network", "junctions.lines_contact.shared_task"
PAIRS = "contact.self_contact_pairs.observe_points"  # what pairs of them press on each other with
PAYOUT_OF_LINES = "reel.payout.pay_out", "reel.payout.stand_among", "mesh.remesh.change_cells"  # this one: the rest

PAID_ZONES = "reel.payout_nodes.carry_zones"  # of lines whose zones move

NO_TABLE = np.zeros(0, np.int64)  # of which only the type counts

# A cable for the second process to compile with; nothing is computed of it.
SAMPLE = {
    "cable": {"sections": [{"length": 10, "mass": 1, "axial_stiffness": 1e6, "bending_stiffness": 1}]},
    "ends": {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": {"kind": "pinned", "position": [9, 0, 0]}},
    "initial": "equilibrium",
    "model": "adaptive",
    "mesh": {"cells": 8},
    "time": {"duration": 0.1, "step": 0.1},
}


def kernels_of(scene: Scene, static: bool = False) -> list[str]:
    """The kernels that a run of a scene calls, as room.file.function, by the last of each family; the solver's first.

    static: those of its equilibrium, whose stability is judged where there are rods and no end moments.  Whether a line
    is in a plane follows from the scene; rarely its first shape leaves the plane.
    """
    lines = {name: scene.asked_scene(name) for name in scene.lines}
    pairs = scene.meeting_pairs
    together = {x for pair in pairs for x in pair}
    together |= {name for name, x in scene.lines.items() if scene.is_joined(x.start) or scene.is_joined(x.end)}
    alone = {name: x for name, x in lines.items() if name not in together}
    planar = {name: x for name, x in alone.items() if not _is_in_space(x, scene.dimension)}
    found = [SOLVER[0]] * bool(planar) + [SOLVER[1]] * (len(planar) < len(lines))
    found += [START_OF_LINES, EXTREMES, ENERGIES, OUTPUTS]
    found += [REST_OF_LINES] if static else [STEPS_OF_LINES, BOOKS_OF_LINES]
    touch_themselves = any(x.contact.self for x in lines.values())
    if together or touch_themselves:
        found += OF_JOINED
    rods = {name for name, x in lines.items() if _has_rods(x) or wants_errors(x)}  # others are compared with these
    if any(_is_judged(x, static) for name, x in planar.items() if name in rods):
        found.append(STABILITY)
    if scene.time is not None and scene.adaptive:
        found += [WEIGHED, *([CRITERIA] if static else [*ZONE_CHANGES, ZONES])]
    if not static and any(payout_of(x) is not None for x in lines.values()):
        found += [*PAYOUT_OF_LINES, *([PAID_ZONES] if scene.adaptive else [])]
    if pairs or touch_themselves:
        found += TOUCHING_LINES
    if pairs:
        found.append(PAIRS)
    if touch_themselves:
        found.append(TOUCHING)
    return found


def _is_in_space(scene: LineScene, dimension: int | None) -> bool:
    """Whether a line is not computed in a plane, whatever it does."""
    tables = scene.environment, scene.cable, scene.ends, scene.initial
    leaves = plane_of(*tables, TYPED if dimension == 2 else EXACT)[1]
    return dimension == 3 or bool(scene.contact.self or reachable_obstacles(scene) or leaves)


def _is_judged(scene: LineScene, static: bool) -> bool:
    """Whether the stability of an equilibrium with rods is."""
    turned = any(load.what == "moment" for end in scene.ends.both for load in end.loads)
    return (static or isinstance(scene.initial, Equilibrium)) and not turned


def _has_rods(scene: LineScene) -> bool:
    """Whether part of the cable is a rod from the beginning; zones that move (adaptive) may have none."""
    zones = scene.model.zones if isinstance(scene.model, ZonesModel) else ()
    return isinstance(scene.model, RodModel) or any(isinstance(zone, RodZone) for zone in zones)


def is_ready(name: str) -> bool:
    """Whether a kernel is compiled, in this process or on disk, where a look takes 0.2 ms."""
    return bool(entry(name).signatures) or is_warm([name])


def compile_beside(scene: Scene, static: bool = False) -> None:
    """Let a second process compile what a scene calls besides the solver, which this one compiles meanwhile.

    Each waits for what the other is compiling (machine.compile).  Does nothing where all is compiled, or where there is
    one core.  static: for its equilibrium alone.
    """
    needed = [*kernels_of(scene, static)[1:], *([] if static else [REST_OF_LINES])]  # beside the solver
    missing = [name for name in needed if not is_ready(name)]
    frozen = getattr(sys, "frozen", False)  # an application made by PyInstaller would start itself again
    if missing and (os.cpu_count() or 1) > 1 and sys.executable and not frozen:
        command = command_to_compile(missing)
        nothing = subprocess.DEVNULL
        streams = {"stdin": nothing, "stdout": nothing, "stderr": nothing}
        Thread(target=subprocess.run, args=(command,), kwargs=streams, daemon=True).start()  # which waits for its end


def command_to_compile(names: Sequence[str]) -> list[str]:
    """Command of a process that compiles kernels with this package, wherever it is started.

    -P: a file of the present folder that is called as a module of this package or of Python is not run.  Its end
    searches for no garbage, of which numba leaves much.
    """
    package = str(Path(__file__).parents[2])
    call = f"from hybrid.simulation.first_use import compile_all; compile_all({list(names)}); os._exit(0)"
    return [sys.executable, "-P", "-c", f"import os, sys; sys.path.insert(0, {package!r}); {call}"]


def compile_all(names: Sequence[str]) -> None:
    """Compile kernels in this process, but for what another one is compiling.

    What shares its laws with a solver comes last: by then the process that compiles the solver may have it, too.
    """
    scene = Scene.model_validate(SAMPLE).asked_scene("")
    model = build(scene)
    _compile_by_table(names, ENERGIES, EXTREMES, WEIGHED, *OF_JOINED)
    if ZONES in names or CRITERIA in names:
        _compile_criteria(scene, model)
    _compile_by_table(names, *ZONE_CHANGES, ZONES)
    if OUTPUTS in names:
        _compile_outputs(model)
    if PAYOUT_OF_LINES[2] in names:
        for kernel in payout_kernels():
            kernel.compile_unless_busy(NO_TABLE)
    _compile_by_table(names, TOUCHING, *TOUCHING_LINES, PAIRS, *PAYOUT_OF_LINES[:2], PAID_ZONES)
    _compile_by_table(names, STEPS_OF_LINES, BOOKS_OF_LINES, REST_OF_LINES, START_OF_LINES, SOLVER[1])


def _compile_by_table(names: Sequence[str], *kernels: str) -> None:
    """Those kernels, among those of these names, that take one table, and those that others call."""
    for name in kernels:
        if name in names:
            entry(name).compile_unless_busy(NO_TABLE)


def payout_kernels() -> tuple[Any, ...]:
    """All that a line calls that is paid out, in the order in which a run asks for it; each takes one table."""
    from hybrid.kernels.mesh import cell_changes
    from hybrid.kernels.reel import payout, payout_nodes

    first = (
        payout.pay_out,
        payout.stand_among,
        payout.iterate,
        payout.fit_line,
        payout.stand_still,
        payout.lengthen,
        payout.limit_next_step,
        payout.put_forces_on,
        payout.remove_forces,
        payout_nodes.carry_node,
    )
    line = payout_nodes.change_line, payout_nodes.fit_changed, payout_nodes.book_change, payout_nodes.renew_run
    planner = payout_nodes.node_due, payout_nodes.plan_node, payout_nodes.keep_reel, payout_nodes.make_line
    forces = cell_changes.before_forces, cell_changes.after_forces
    return *first, *line, *planner, *forces, put_cells, ask_cells, change_cells


def _compile_outputs(model: Model) -> None:
    from hybrid.kernels.watch.observed_outputs import observe_bed, observe_outputs

    observe_outputs(np.zeros((0, 0), np.int64))
    if model.line.bits & SEABED:
        observe_bed(np.zeros((0, 0), np.int64), model.sea.values)
    stored_energy(model.line, model.sea.values, model.start.r)


def _compile_criteria(scene: LineScene, model: Model) -> None:
    from hybrid.zones.change import manager_for

    manager = manager_for(scene, model, first_resolution(scene), None)
    manager.evaluate_criteria(model.line, model.sea.values, model.ends.values, model.start, 0.0)
    manager.initial_rods(model.start)
    manager.review(0.0, model.start)
