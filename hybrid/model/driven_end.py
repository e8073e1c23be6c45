"""An end that is set from outside, step by step: where it is to be at the end of the next step, and the way there.

The laws are those of laws.end_motion.driven_position and driven_frame, which move the end within compiled steps.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hybrid.kernels.state.state import Floats

# Columns of a path: begin and end (s), position and velocity at both (m, m/s), frame at the begin, rotation vector.
FROM, TO, AT, SPEED, THERE, SPEED_THERE, FRAME, TURN = 0, 1, 2, 5, 8, 11, 14, 23
PATH = 26
Vector = tuple[float, float, float] | Floats


class DrivenEnd:
    """One end, as `EndConditions` asks its motions; `path` is its row of `Moves.paths`."""

    def __init__(self, path: Floats, position: Floats, frame: Floats, held: bool, turns: bool) -> None:
        """path: (PATH,) filled here; position: (3,) m; frame: (3, 3); held, turns: what is set of it."""
        self.path, self.held, self.turns = path, held, turns
        self._numbers: Any = path.data  # the same, of which one number costs a third of what numpy takes
        self.stand(position, frame)

    def set(self, begin: float, end: float, position: Vector, velocity: Vector, turn: Vector) -> None:
        """From where it is at `begin` (s) to a place at `end`; turn: rotation vector in the axes of its frame, rad."""
        path, numbers = self.path, self._numbers
        if begin < numbers[TO]:  # on its way
            path[AT:SPEED], path[SPEED:THERE], frame, _ = self.at(begin)
            path[FRAME:TURN] = np.ravel(frame)
        else:
            numbers[AT:THERE] = numbers[THERE:FRAME]
            if numbers[TURN] or numbers[TURN + 1] or numbers[TURN + 2]:
                path[FRAME:TURN] = np.ravel(path[FRAME:TURN].reshape(3, 3) @ rotation(path[TURN:PATH]))
        numbers[FROM], numbers[TO] = begin, end
        numbers[THERE], numbers[THERE + 1], numbers[THERE + 2] = position
        numbers[SPEED_THERE], numbers[SPEED_THERE + 1], numbers[SPEED_THERE + 2] = velocity
        numbers[TURN], numbers[TURN + 1], numbers[TURN + 2] = turn

    def at(self, t: float) -> tuple[Floats, Floats, Floats, Floats]:
        """Position (3,) m, velocity (3,) m/s, frame (3, 3), angular velocity (3,) 1/s at t (s); inertial."""
        p = self.path
        dt = max(p[TO] - p[FROM], 0.0)
        x = 1.0 if not t < p[TO] else max((t - p[FROM]) / dt, 0.0)
        frame, turn = p[FRAME:TURN].reshape(3, 3), p[TURN:PATH]
        spin = frame @ turn / dt if dt > 0.0 else np.zeros(3)
        turned = frame @ rotation(x * turn)
        if x == 1.0:
            return p[THERE:SPEED_THERE].copy(), p[SPEED_THERE:FRAME].copy(), turned, spin
        change = p[THERE:SPEED_THERE] - p[AT:SPEED]
        a, b = dt * p[SPEED:THERE] - change, change - dt * p[SPEED_THERE:FRAME]
        value = (1.0 - x) * p[AT:SPEED] + x * p[THERE:SPEED_THERE] + x * (1.0 - x) * ((1.0 - x) * a + x * b)
        rate = change + (1.0 - x) * (1.0 - 3.0 * x) * a + x * (2.0 - 3.0 * x) * b
        return value, rate / dt, turned, spin

    def stand(self, position: Floats, frame: Floats) -> None:
        """Rest at a place (3,) m in a frame (9,) or (3, 3)."""
        columns = np.array(frame, float).ravel()  # perhaps those of the path
        self.path[:] = 0.0
        self.path[AT:SPEED] = self.path[THERE:SPEED_THERE] = position
        self.path[FRAME:TURN] = columns

    def turn_from(self, frame: Floats) -> None:
        """Stand in another frame (3, 3)."""
        self.path[FRAME:TURN], self.path[TURN:PATH] = np.ravel(frame), 0.0


def rotation(vector: Floats) -> Floats:
    """Rotation matrix (3, 3) of a rotation vector, rad (Rodrigues)."""
    angle = float(np.sqrt(vector @ vector))
    x, y, z = vector
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    a, b = (np.sin(angle) / angle, (1.0 - np.cos(angle)) / angle**2) if angle > 1e-4 else (1.0 - angle**2 / 6.0, 0.5)
    return np.asarray(np.eye(3) + a * K + b * (K @ K))


def rotation_vector(matrix: Floats) -> Floats:
    """Rotation vector, rad, below a half turn, of a rotation matrix (3, 3)."""
    sine = 0.5 * np.array([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]])
    size = float(np.sqrt(sine @ sine))
    angle = float(np.arctan2(size, 0.5 * (np.trace(matrix) - 1.0)))
    return sine * (angle / size) if size > 1e-12 else sine
