"""The stiffness of a line at rest against what its equations change by, each unknown moved both ways."""

from __future__ import annotations

import numpy as np
import pytest

import hybrid
from hybrid.designs.line_at_rest import displaced
from hybrid.designs.network_at_rest import at_rest
from hybrid.kernels.algebra.block_elimination import SIZE
from hybrid.linear.matrices import linear_line
from hybrid.solve.stepper import JoinedLine
from tests.scenes import cable_scene, clamped_at
from tests.solve.test_bed_of_depths import hill, mooring

ROD = {
    "length": 100.0, "mass": 10.0, "diameter": 0.08, "axial_stiffness": 1e6, "bending_stiffness": 400.0,
    "torsional_stiffness": 300.0, "drag": {"normal": 1.2, "tangential": 0.03},
}  # fmt: skip
SHEARED = [
    {"z": -100, "velocity": [0.1, 0, 0]},
    {"z": 0, "velocity": [0.4, 0.3, 0]},
    {"z": 30, "velocity": [1.2, 0.3, 0]},
]
BALL = {"kind": "sphere", "at": [30, 0.3, -12], "radius": 2.0}
FLOAT = {"kind": "float", "at": 50.0, "mass": 20.0, "volume": 1.2, "height": 1.0, "drag_area": 0.5}


def scene(surface=15.0, attachments=(), without=(), current=(0.5, 0.1, 0.0), more=None, **section):
    """A rod in a current, clamped at both ends."""
    section = {key: x for key, x in (ROD | section).items() if key not in without}
    return hybrid.validate_scene(cable_scene(
        section, clamped_at([0, 0, 0], [1, 0, 1], normal=[0, 1, 0]), clamped_at([60, 0, 20], [1, 0, 0.6], normal=[0, 1, 0]),
        attachments=[*attachments], fluid={"density": 1025, "surface": surface, "current": current}, model="rod", mesh=14
    ) | (more or {}))  # fmt: skip


SCENES = {
    "torque of tension": lambda: scene(tension_torque=0.05),
    "torque of tension by a table": lambda: scene(
        tension_torque=0.05, tension_strain=[[0, 0], [0.01, 2e4], [0.03, 2e5]], without=["axial_stiffness"]
    ),
    "torque of tension, a rope that creeps": lambda: scene(
        tension_torque=0.05, dynamic_stiffness={"constant": 3e6, "per_tension": 20.0, "relaxation_time": 10.0},
        creep={"per_decade": 1e-3, "loaded": 10.0},
    ),
    "two stiffnesses, curled": lambda: scene(bending_stiffness=[400, 900], intrinsic_curvature=[0.02, 0.01, 0.005]),
    "moment by a table": lambda: scene(
        moment_curvature=[[0, 0], [0.02, 8], [0.2, 40], [1, 100]], without=["bending_stiffness"]
    ),
    "tension by a table": lambda: scene(
        tension_strain=[[0, 0], [0.01, 2e4], [0.03, 2e5]], without=["axial_stiffness"]
    ),
    "layers that slip, stiffer under tension": lambda: scene(
        bending_slip=[{"stiffness": 800, "moment": 2, "per_tension": 1e-3}, {"stiffness": 300, "moment": 40}],
        stiffness_per_tension=0.05, damping={"stiffness": 0.01},
    ),
    "a restrictor on two stiffnesses": lambda: scene(
        attachments=[{"kind": "bend_restrictor", "range": [0, 60], "radius": 60.0, "locked_stiffness": 2e3}],
        bending_stiffness=[400, 900], intrinsic_curvature=[0.01, 0.005, 0],
    ),
    "in soil": lambda: scene(more={"environment": {
        "fluid": {"density": 1025}, "seabed": {"z": -13, "soil": {"shear_strength": 100, "gradient": 500}}}}),
    "at the surface, in a sheared current": lambda: scene(
        3.0, [FLOAT], current={"kind": "profile", "table": SHEARED}
    ),
    "on a ball": lambda: scene(more={"obstacles": {"ball": BALL}, "contact": {"self": False}}),
    "on a hill": lambda: mooring(hill(), mesh={"cells": 30}),
}  # fmt: skip


@pytest.mark.parametrize("what", SCENES)
def test_it_is_what_the_equations_change_by(what):
    made = SCENES[what]()
    rest = at_rest(made, ["tension@0"])
    line, state = rest.lines[0], rest.lines[0].state.copy()
    here, free_ends = line.here, line.here.ends._replace(held=np.zeros(2, np.int8))
    joined = JoinedLine(
        here.model.line, here.sea, free_ends, here.model.length, here.model.tension_scale, -np.inf, (-1, -1)
    )
    linear = linear_line(joined, "cable", state, sticks=False, quick=False)
    free = np.flatnonzero(rest._network.lines[0].free)
    K = (linear.stiffness + linear.by_layers).toarray()[free]
    chord, pull = np.linalg.norm(state.e, axis=1).min(), np.abs(state.T).max()
    steps, kinds = {0: 1e-5 * pull, 4: 1e-6}, free % SIZE
    for unknown in free:
        step = steps.get(unknown % SIZE, 1e-6 * chord)
        q = np.zeros((2, len(state.r), SIZE))
        q[:, unknown // SIZE, unknown % SIZE] = 1.0
        moved, left = displaced(state, q, np.array([step, -step])), []
        for k in (0, 1):
            for name, x in moved.items():
                getattr(line._still, name)[:] = x[k]
            left.append(line._left(line.here)[0][free])
        off = np.abs((left[1] - left[0]) / (2.0 * step) - K[:, unknown])
        for kind in range(SIZE):  # of equations of one unit
            rows, columns = kinds == kind, free[kinds == unknown % SIZE]
            if rows.any():
                size, rounded = np.abs(K[rows][:, columns]).max(), 1e-9 * np.abs(K[rows]).max()
                assert off[rows].max() < max(1e-5 * size, rounded), (unknown, kind)
