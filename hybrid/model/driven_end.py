"""An end that is set from outside, step by step: where it is to be at the end of the next step, and the way there.

The laws are those of laws.end_motion.driven_position and driven_frame, which move the end within compiled steps.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import dist, hypot
from typing import Any

import numpy as np

from hybrid.kernels.state.state import Floats

# Columns of a path: begin and end (s), position and velocity at both (m, m/s), frame at the begin, rotation vector.
FROM, TO, AT, SPEED, THERE, SPEED_THERE, FRAME, TURN = 0, 1, 2, 5, 8, 11, 14, 23
PATH = 26
# Columns of what is known of its velocities: whether the last one followed from the places; of a window, its steps, how
# far the places and the velocities given go in it (m); how far both are apart and go in all windows (m), their number;
# whether it was said that they contradict each other.
IMPLIED, STEPS, GONE, SAID, APART, WAY, WINDOWS, TOLD = 0, 1, 2, 5, 8, 9, 10, 11
RECORD = 12
# Steps over which places and velocities are compared: a motion that begins or changes within one is none of it.
WINDOW = 4
# Windows after which velocities may be said to contradict the places, and the part of the way that they then miss.
ENOUGH, CONTRADICTS = 4, 0.4
LEAST_WAY = 1e-6  # m, of all windows: a shorter one is what the solver of another program leaves of a thing that rests
STILL = (0.0, 0.0, 0.0)
CONTRADICTED = (
    "the motion follows the places, work and energy the velocities: leave velocity out, or give that at the end of the "
    "step, in m/s"
)
Vector = tuple[float, float, float] | Floats


class DrivenEnd:
    """One end, as `EndConditions` asks its motions; `path` is its row of `Moves.paths`."""

    def __init__(self, path: Floats, position: Floats, frame: Floats, held: bool, turns: bool) -> None:
        """path: (PATH,) filled here; position: (3,) m; frame: (3, 3); held, turns: what is set of it."""
        self.path, self.held, self.turns, self.record = path, held, turns, np.zeros(RECORD)
        # The same, of which one number costs a third of what numpy takes, and three a tenth of an array of them.
        self._numbers: Any = path.data
        self._counted: Any = self.record.data
        self.stand(position, frame)

    def set(
        self, begin: float, end: float, position: Vector, velocity: Vector | None, turn: Vector, one_step: bool = False
    ) -> None:  # fmt: skip
        """From where it is at `begin` (s) to a place at `end`; turn: rotation vector in the axes of its frame, rad.

        velocity: (3,) m/s there, None: in one step that which the places imply, else at rest; one_step: whether the way
        is a step of the run.
        """
        path, numbers, record = self.path, self._numbers, self.record
        before = self._mean_velocity() if velocity is None and one_step else (STILL, 0.0)
        if begin < numbers[TO]:  # on its way
            path[AT:SPEED], path[SPEED:THERE], frame, _ = self.at(begin)
            path[FRAME:TURN] = np.ravel(frame)
        else:
            numbers[AT:THERE] = numbers[THERE:FRAME]
            if numbers[TURN] or numbers[TURN + 1] or numbers[TURN + 2]:
                path[FRAME:TURN] = np.ravel(path[FRAME:TURN].reshape(3, 3) @ rotation(path[TURN:PATH]))
        numbers[FROM], numbers[TO] = begin, end
        numbers[THERE], numbers[THERE + 1], numbers[THERE + 2] = position
        if velocity is None:
            if record[IMPLIED] and not one_step:
                path[SPEED:THERE] = 0.0
            velocity = self._implied(*before) if one_step else STILL
            record[:] = 0.0
            record[IMPLIED] = one_step
        numbers[SPEED_THERE], numbers[SPEED_THERE + 1], numbers[SPEED_THERE + 2] = velocity
        numbers[TURN], numbers[TURN + 1], numbers[TURN + 2] = turn
        if one_step and not self._counted[IMPLIED]:
            self._compare()

    def stay(self, begin: float, end: float, one_step: bool) -> None:
        """Be where it is at `begin` (s) until `end`; at rest there, unless its velocity follows from its places."""
        self.set(begin, end, self.at(begin)[0], None if self.record[IMPLIED] else STILL, STILL, one_step)

    def _mean_velocity(self) -> tuple[Vector, float]:
        """Mean velocity (3,) m/s of the way that is over, and how long that took, s; of none: zeros."""
        p = self.path
        dt = float(p[TO] - p[FROM])
        return ((p[THERE:SPEED_THERE] - p[AT:SPEED]) / dt, dt) if dt > 0.0 else (STILL, 0.0)

    def _implied(self, before: Vector, earlier: float) -> Floats:
        """Velocity (3,) m/s at the end of the parabola through the last three places.

        before: mean velocity (3,) m/s of the way before this one, earlier: s, how long that took; 0: it stood still.
        By trapezoids the velocities of a motion from rest to rest add up to its way.
        """
        mean, dt = self._mean_velocity()
        return np.asarray(mean + (mean - np.asarray(before)) * (dt / (dt + (earlier or dt))))

    def _compare(self) -> None:
        """Count how far the places, and the velocities that are given, go in this step."""
        p, counted = self._numbers, self._counted
        half = 0.5 * (p[TO] - p[FROM])
        for k in range(3):
            counted[GONE + k] += p[THERE + k] - p[AT + k]
            counted[SAID + k] += half * (p[SPEED + k] + p[SPEED_THERE + k])
        counted[STEPS] += 1.0
        if counted[STEPS] == WINDOW:
            self.record[APART:WINDOWS] = self._compared()
            counted[WINDOWS] += 1.0
            self.record[STEPS:APART] = 0.0

    def _compared(self) -> tuple[float, float]:
        """How far places and velocities are apart, and the way they go, with the window that is not over, m."""
        gone, said = self.record[GONE:SAID].tolist(), self.record[SAID:APART].tolist()
        way = max(hypot(*gone), hypot(*said))
        return self._counted[APART] + dist(gone, said), self._counted[WAY] + way

    def contradiction(self, soon: bool = False) -> str:
        """How far the velocities that are given miss the way of the places, in words; empty: they are not known to.

        soon: whether less than ENOUGH windows may say so, since something else has failed.
        """
        if not soon and (self._counted[STEPS] or self._counted[WINDOWS] < ENOUGH):
            return ""
        apart, way = self._compared()
        if way < LEAST_WAY or not apart > CONTRADICTS * way:
            return ""
        steps = int(WINDOW * self.record[WINDOWS] + self.record[STEPS])
        return f"the velocities given miss {apart:.3g} of {way:.3g} m of its way in {steps} steps"

    @property
    def is_reported(self) -> bool:
        """Whether a contradiction has been reported."""
        return bool(self._counted[TOLD])

    def keep(self) -> Floats:
        """(PATH + RECORD,) what `bring_back` takes."""
        return np.concatenate([self.path, self.record])

    def bring_back(self, kept: Floats) -> None:
        """Be on the way of then."""
        self.path[:], self.record[:] = kept[:PATH], kept[PATH:]

    def at(self, t: float) -> tuple[Floats, Floats, Floats, Floats]:
        """Position (3,) m, velocity (3,) m/s, frame (3, 3), angular velocity (3,) 1/s at t (s); inertial."""
        p = self.path
        dt = max(p[TO] - p[FROM], 0.0)
        x = 1.0 if not t < p[TO] else max((t - p[FROM]) / dt, 0.0)
        frame, turn = p[FRAME:TURN].reshape(3, 3), p[TURN:PATH]
        if turn.any():
            turned, spin = frame @ rotation(x * turn), frame @ turn / dt if dt > 0.0 else np.zeros(3)
        else:
            turned, spin = frame.copy(), np.zeros(3)
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
        self.path[:] = self.record[:] = 0.0
        self.path[AT:SPEED] = self.path[THERE:SPEED_THERE] = position
        self.path[FRAME:TURN] = columns

    def turn_from(self, frame: Floats) -> None:
        """Stand in another frame (3, 3)."""
        self.path[FRAME:TURN], self.path[TURN:PATH] = np.ravel(frame), 0.0


def contradictions(driven: Mapping[str, DrivenEnd], soon: bool = False) -> str:
    """What velocities contradict the places that are set, in words; empty: none.

    driven: what is set, by name; soon: as of `DrivenEnd.contradiction`; else each is told once.
    """
    found = ""
    for name, end in driven.items():
        if (soon or not end.is_reported) and (text := end.contradiction(soon)):
            end.record[TOLD] = 1.0
            found += f"{name}: {text}; "
    return found and f"{found}{CONTRADICTED}"


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
