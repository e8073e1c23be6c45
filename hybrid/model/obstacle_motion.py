"""How obstacles of a scene move, as arrays for kernels.laws.obstacle_motion, and those that are set from outside."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hybrid.errors import SceneError
from hybrid.kernels.state.obstacle_rows import (
    AXIS,
    BEARING,
    BEGAN,
    CARRIED,
    INERTIA,
    MEETS_FROM,
    MEETS_TO,
    OFFSET,
    RAMP,
    RATE,
    RIDES,
    SIDE,
    STILL_AXIS,
    STILL_SIDE,
    SWEEP,
    TURNED,
)
from hybrid.kernels.state.state import NO_CARRIED, NO_MOVES, Floats, Moves
from hybrid.model.driven_end import PATH, DrivenEnd
from hybrid.model.ends import Motion, table_of_motions
from hybrid.scene.body_shapes import Carried, CarriedBox, CarriedCylinder
from hybrid.scene.motion import Elevation, EndMotion
from hybrid.scene.schema import LineScene


class Courses(NamedTuple):
    """How obstacles move: Sea.courses and Sea.carried, and those that are set from outside, by name."""

    moves: Moves
    carried: Floats
    driven: dict[str, DrivenEnd]


def courses_of(scene: LineScene, rows: Floats, waves: Floats, ramp: float, elevation: Elevation) -> Courses:
    """How the obstacles of a scene move; rows: (M, OBSTACLE) of them at t = 0.

    waves: as of `Surroundings.waves_of_vessels`, ramp: s, over which they grow; elevation: of the surface, as of
    scene.motion.EndMotion.
    """
    if not any(x.moves for x in scene.obstacles.values()):
        return Courses(NO_MOVES, NO_CARRIED, {})
    count, still = len(scene.obstacles), np.eye(3)
    position, frame = np.array([x.at for x in scene.obstacles.values()], float), np.tile(still.ravel(), (count, 1))
    carried, paths = np.zeros((count, CARRIED)), np.zeros((count, PATH))
    carried[:, STILL_AXIS : STILL_AXIS + 3], carried[:, TURNED : TURNED + 9] = rows[:, AXIS : AXIS + 3], frame
    carried[:, STILL_SIDE : STILL_SIDE + 3] = rows[:, SIDE : SIDE + 3]
    motions: dict[int, Motion | DrivenEnd] = {}
    driven = {}
    carried[:, MEETS_FROM], carried[:, MEETS_TO] = -np.inf, np.inf  # what comes off a reel at the start has s < 0
    for k, (name, x) in enumerate(scene.obstacles.items()):
        if isinstance(x, Carried):
            position[k], frame[k] = x.origin, np.array(x.body_axes).T.ravel()
            carried[k, OFFSET : OFFSET + 3], carried[k, RIDES] = x.place, 1.0
            carried[k, BEGAN:SWEEP], carried[k, TURNED : TURNED + 9] = [*x.origin, *x.origin], frame[k]
            carried[k, STILL_AXIS : STILL_AXIS + 3] = x.own_axis if isinstance(x, CarriedCylinder) else (0.0, 0.0, 1.0)
            if isinstance(x, CarriedBox):
                carried[k, STILL_AXIS : STILL_AXIS + 3], carried[k, STILL_SIDE : STILL_SIDE + 3], _ = x.own_axes
            carried[k, SWEEP : SWEEP + 9] = still.ravel()
        elif x.from_outside:
            motions[k] = driven[name] = DrivenEnd(paths[k], position[k], frame[k], True, True)
        elif x.motion is not None:
            try:
                motions[k] = EndMotion(x.motion, x.at, still, elevation, (waves, ramp, True))
            except SceneError as error:
                raise SceneError(
                    [replace(each, where=f"obstacles.{name}.{each.where}") for each in error.complaints]
                ) from None
        spin = getattr(x, "spin", None)
        if spin is not None:
            carried[k, RATE], carried[k, RAMP] = spin.rate, spin.ramp
        bearing = getattr(x, "bearing", None)
        if bearing is not None:
            carried[k, INERTIA], carried[k, BEARING] = bearing.inertia, bearing.damping
    return Courses(table_of_motions(motions, position, frame, paths, frame), carried, driven)
