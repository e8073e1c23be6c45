"""Lines over a drum: scenes of capstans, in which what holds and what slides has a closed form."""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.scenes import cable_scene, pinned_at

Tables = dict[str, Any]
STRAND, DRUM = 0.01, 0.3  # m, radius of the rope and of the drum
CENTRELINE = STRAND + DRUM


def half_turn(radius: float, light: float, heavy: float) -> list[list[float]]:
    """Corners of a line over half a drum about the y axis, whose ends hang so far below its axis, m."""
    over = [[radius * np.cos(x), 0.0, radius * np.sin(x)] for x in np.linspace(np.pi, 0.0, 17)]
    return [[-radius, 0.0, -light], *over, [radius, 0.0, -heavy]]


def drum(friction: float, radius: float = DRUM) -> Tables:
    return {"drum": {"kind": "cylinder", "at": [0, 0, 0], "axis": [0, 1, 0], "radius": radius, "friction": friction}}


def capstan(friction: float, pull: float, model: str = "catenary", cells: int = 200) -> Tables:
    """A weightless rope over half a drum, held at one end and pulled at the other: by 10 N, then slowly by `pull`.

    It is long at the end that is held, so that it has slid everywhere once the pull has grown.
    """
    length = float(3.3 + np.pi * CENTRELINE)
    section = {"length": length, "mass": 0.1, "diameter": 2 * STRAND, "axial_stiffness": 2e4,
               "bending_stiffness": 1e-5, "damping": {"mass": 20.0}}  # fmt: skip
    pulled = {"kind": "free", "force": {"history": [[0, 0, 0, -10], [1.5, 0, 0, -pull]]}}
    return cable_scene(
        section, pinned_at(-CENTRELINE, 0, -3.0), pulled, gravity=0, obstacles=drum(friction),
        initial={"kind": "equilibrium", "points": half_turn(CENTRELINE, 3.0, 0.3)}, model=model, mesh=cells,
        contact={"self": False}, time=(2.0, 0.01), output=(0.1, 101)
    )  # fmt: skip


def heavy_capstan(friction: float) -> Tables:
    """A rope of 1 mm over half a drum of 50 mm; its light end is held and slowly moved up, so that it slides."""
    R, light, heavy = 0.051, 0.15, 0.9 if friction < 0.5 else 1.8
    section = {"length": float(light + heavy + np.pi * R), "mass": 0.01, "diameter": 0.002, "axial_stiffness": 1e3,
               "bending_stiffness": 1e-9, "damping": {"mass": 2.0}}  # fmt: skip
    up = {"velocity": [0, 0, 0.01], "ramp": 0.2}
    return cable_scene(
        section, pinned_at(-R, 0, -light, motion=up), {"kind": "free"}, obstacles=drum(friction, 0.05),
        initial={"kind": "equilibrium", "points": half_turn(R, light, heavy)}, model="rod", mesh=240,
        contact={"self": False}, time=(1.5, 0.005), output=(0.1, 101)
    )  # fmt: skip


def over_pipe(**more: Any) -> Tables:
    """A rope that hangs between two points and lies over a pipe on its way, askew."""
    section = {"length": 12.0, "mass": 2.0, "diameter": 0.05, "axial_stiffness": 1e5, "bending_stiffness": 5.0,
               "damping": {"mass": 0.5}}  # fmt: skip
    pipe = {"kind": "cylinder", "at": [4, 0, -1.7], "axis": [0.1, 1, 0.05], "radius": 1.2, "friction": 0.3}
    travel = {"travel": {"by": [0.3, 0.3, 0.2], "over": 1.0}}
    return cable_scene(
        section, pinned_at(0, 0, 0), pinned_at(10, 0, 3, motion=travel), obstacles={"pipe": pipe}, model="rod", mesh=64,
        contact={"self": False}, time=(2.0, 0.02), output=(0.2, 65)
    ) | more  # fmt: skip


def over_beam(beam: Tables) -> Tables:
    """The rope over a beam in place of the pipe, askew."""
    at = {"at": [4, 0, -1.7], "rotation": [5, -10, 15], "friction": 0.3}
    return over_pipe(obstacles={"beam": beam | at}, mesh={"cells": 120}, output={"every": 0.2, "points": 121})


def paid_over_drum(
    friction: float, rate: float, clear: float = 0.3, model: str = "rod", clamp: bool = False, winch: str = "end",
    h: float = 0.03, **more: Any,
) -> Tables:  # fmt: skip
    """A weightless line, pulled by 8 N, that a winch pays out over two radians of a drum; clear: m, from drum to winch."""
    turn, far = 2.0, 1.0
    arc = np.array([[np.cos(x), 0.0, np.sin(x)] for x in np.linspace(0.0, turn, 25)]) * CENTRELINE
    along = np.array([-np.sin(turn), 0.0, np.cos(turn)])
    points = [[CENTRELINE, 0.0, -far], *arc.tolist(), *([(arc[-1] + clear * along).tolist()] if clear else [])]
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    section = {"length": length, "mass": 0.1, "diameter": 2 * STRAND, "axial_stiffness": 2e4,
               "bending_stiffness": 0.01, "damping": {"mass": 0.5}}  # fmt: skip
    held = {"kind": "pinned", "position": points[-1], "payout": {"rate": rate, "ramp": 0.4}}
    if clamp:
        held |= {"kind": "clamped", "tangent": (along if winch == "end" else -along).tolist()}
    pulled = {"kind": "free", "force": [0, 0, -8.0]}
    ends = {"start": pulled, "end": held} if winch == "end" else {"start": held, "end": pulled}
    return {
        "environment": {"gravity": 0}, "cable": {"sections": [section]}, "obstacles": drum(friction), "ends": ends,
        "initial": {"kind": "equilibrium", "points": points if winch == "end" else points[::-1]},
        "model": model, "mesh": {"cells": round(length / h)}, "contact": {"self": False},
        "time": {"duration": 3.0, "step": 0.01}, "output": {"every": 0.05, "points": 41},
    } | more  # fmt: skip
