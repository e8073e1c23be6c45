"""What the two ends impose at a time t: positions, frames, forces, moments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import dist, hypot, sqrt
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np

from hybrid.kernels.state.state import (
    PLACE_THERE,
    RIDES,
    SEAT_THERE,
    TURNS_FREELY,
    TURNS_WITH_BODY,
    Ends,
    Floats,
    Moves,
    no_moves,
)
from hybrid.scene.motion import MotionTerms
from hybrid.scene.motion_tables import GivenLoad

# A prescribed tangent within this angle (rad) of the cable's own counts as the same: round-off of typed numbers.
SAME_DIRECTION = 1e-6
CONSTANT: Floats = np.zeros((0, 4))  # history of a load that has none


def first_director(tangent: Sequence[float], normal: Sequence[float] | None = None) -> Floats:
    """Unit vector normal to `tangent`, in the plane of `normal` or, without one, away from the nearest axis."""
    t = np.array(tangent, float) / np.linalg.norm(tangent)
    seed = np.array(normal, float) if normal is not None else np.eye(3)[int(np.argmin(np.abs(t)))]
    a = seed - np.dot(seed, t) * t
    a = a / np.linalg.norm(a)
    a -= np.dot(a, t) * t
    return a / np.linalg.norm(a)


def transported(first: Floats, tangents: Floats) -> Floats:
    """`first`, normal to tangents[0], carried without twist along all `tangents` (n, 3)."""
    t = tangents / np.linalg.norm(tangents, axis=1)[:, None]
    out = np.empty_like(t)
    out[0] = first
    if len(t) > 2 and not (t @ first).any() and np.array_equal(first / sqrt(first.dot(first)), first):
        out[:] = first  # normal to the plane that the tangents lie in
        return out
    both = t[:-1] + t[1:]
    for i in range(1, len(t)):
        a, d = out[i - 1], t[i]
        b, along = a, a.dot(d)
        if along != 0.0:  # it is not, in a plane that the director is normal to
            c = 1.0 + float(t[i - 1].dot(d))
            # a fold has no smallest rotation: any director normal to both will do, and a rod refuses the fold later
            b = a - along / c * both[i - 1] if c > 1e-12 else a
            b = b - b.dot(d) * d
        out[i] = b / sqrt(b.dot(b))
    return out


class Motion(Protocol):
    """A prescribed motion: position (3,), velocity (3,), frame (3, 3) or None, angular velocity (3,) at a time."""

    base: Floats

    def at_time(self, t: float) -> tuple[Floats, Floats, Floats | None, Floats]: ...

    def turn_from(self, frame: Floats) -> None: ...

    def terms(self) -> MotionTerms: ...


class EndLoad(NamedTuple):
    """A force (N) or moment (N m) on end 0 or 1 that acts until a time (s).

    ramp: time (s) over which it grows from nothing; None: at once, unless the end is `brought_in`.
    history: (R, 4) rows t, x, y, z, linear between them; `value` is then the largest of them; no rows: constant.
    """

    what: Literal["force", "moment"]
    end: int
    value: Floats
    until: float
    ramp: float | None
    history: Floats = CONSTANT

    def grown(self, t: float) -> Floats:
        """The load (3,) at t (s), as far as it has grown."""
        part, _ = rise(t, self.ramp or 0.0)
        return np.asarray(part * self.at_time(t))

    def at_time(self, t: float) -> Floats:
        """The load (3,) at t (s), when it has grown; at infinity: as at 0, as motions."""
        if not len(self.history):
            return self.value
        t = t if np.isfinite(t) else 0.0
        return np.array([np.interp(t, self.history[:, 0], column) for column in self.history[:, 1:].T])


def end_load(given: GivenLoad, end: int) -> EndLoad:
    """The load that a scene gives an end: its largest value, and the rows (R, 4) of its history, if it has one."""
    largest = max(given.values, key=lambda v: float(np.dot(v, v)))
    until = np.inf if given.until is None else given.until
    rows = np.array(given.rows, float).reshape(-1, 4)
    return EndLoad(given.what, end, np.array(largest, float), until, given.ramp, rows)


def table_of_loads(loads: Sequence[EndLoad]) -> tuple[Floats, Floats]:
    """What kernels.laws.end_motion reads of loads: as Moves.loads and Moves.history."""
    rows = np.cumsum([0, *(len(x.history) for x in loads)])
    table = [
        (x.end, x.what == "moment", *x.value, x.ramp or 0.0, a, b)
        for x, a, b in zip(loads, rows[:-1], rows[1:], strict=True)
    ]
    return np.array(table, float).reshape(-1, 8), np.concatenate([CONSTANT, *(x.history for x in loads)])


def table_of_motions(
    motions: Mapping[int, Motion | DrivenEnd], position: Floats, frame: Floats, paths: Floats, seats: Floats
) -> Moves:
    """What kernels.laws.end_motion reads of n ends, or obstacles, that move by motions or from outside; without loads.

    position: (n, 3) m and frame: (n, 9) without motion; paths: (n, PATH), kept; seats: (n, 9) of ends that turn freely
    on a body.
    """
    moves = no_moves(len(position))
    position, frame = position.copy(), frame.copy()
    harmonics: list[tuple[float, ...]] = []
    knots, cubics = [np.zeros(0)], [np.zeros((0, 6, 4))]
    for k, motion in motions.items():
        if isinstance(motion, DrivenEnd):
            moves.driven[k] = motion.held, motion.turns
            continue
        terms = motion.terms()
        position[k] = motion.base
        if terms.ride is not None:
            axes, place, seat = terms.ride
            frame[k], moves.fairlead[k, PLACE_THERE:SEAT_THERE] = axes.ravel(), place
            moves.fairlead[k, RIDES] = TURNS_FREELY if seat is None else TURNS_WITH_BODY
            moves.fairlead[k, SEAT_THERE:] = seats[k] if seat is None else seat.ravel()
        moves.prescribed[k] = terms.translates, terms.rotates
        moves.ramp[k], moves.velocity[k], moves.velocity_ramp[k] = terms.ramp, terms.velocity, terms.velocity_ramp
        moves.travel[k], moves.follows[k] = terms.travel, terms.follows
        harmonics += [(k, *h) for h in terms.harmonics]
        first = sum(x.size for x in knots)
        moves.file[k] = first, first + max(terms.knots.size - 1, 0)
        knots.append(terms.knots)
        cubics.append(terms.cubics)
    waves = np.array(harmonics).reshape(-1, 5)
    moves = moves._replace(harmonics=waves, knots=np.concatenate(knots), cubics=np.concatenate(cubics))
    return moves._replace(position=position, frame=frame, paths=paths)


class EndConditions:
    """Evaluates both ends into the arrays of `Ends`.

    `breaks` lists the times at which a load stops (a step must end there).
    """

    def __init__(
        self,
        held: Sequence[bool],
        position: Floats,
        frame: Floats,
        loads: Sequence[EndLoad],
        motions: Mapping[int, Motion | DrivenEnd],
    ) -> None:
        zero = np.zeros((2, 3))
        self.values = Ends(np.array(held, np.int8), position.copy(), frame.copy(), zero, zero.copy(), zero.copy())
        self.velocity = np.zeros((2, 3))
        self.breaks = sorted({x.until for x in loads if np.isfinite(x.until)})
        self._loads, self.motions = tuple(loads), dict(motions)
        self._given = (frame.copy(), np.zeros((2, 3)))  # frames and their spins without motion
        self._turns: dict[int, tuple[Floats, float]] = {}  # end -> axis and angle still to go at t = 0
        self._bring_in = 1.0  # s
        self._moves: Moves | None = None  # made when first asked for
        self.released = np.zeros(2, int)  # 1 where an end was held and has been let go
        self._set: set[tuple[str, int]] = set()  # loads that are set from outside
        self._paths = np.zeros((2, PATH))  # of ends that are set from outside
        self.set_loads(0.0)
        self.at_time(np.inf)

    @property
    def moments(self) -> Floats:
        """The moments (2, 3) N m that are given at the ends, when they have grown to their full size."""
        out = np.zeros((2, 3))
        for x in self._loads:
            if x.what == "moment":
                out[x.end] += x.value
        return out

    def set_loads(self, t: float) -> None:
        """Choose the loads that act just after t."""
        self._moves = None
        self._acting = [x for x in self._loads if t < x.until]
        self._growing_until = max((x.ramp or 0.0 for x in self._acting), default=0.0)
        if any(len(x.history) for x in self._acting):
            self._growing_until = np.inf
        self._grown = False

    def go_on_from(self, old: EndConditions, t: float) -> None:
        """Take the place of other conditions at t (s): tangents that are being turned in go on."""
        self.copy_frames(old)
        self._turns, self._bring_in = dict(old._turns), old._bring_in
        ramped = {(x.what, x.end): x.ramp for x in old._loads}
        self._loads = tuple(
            x._replace(ramp=ramped.get((x.what, x.end), x.ramp)) if x.ramp is None else x for x in self._loads
        )
        self.set_loads(t)
        self.at_time(t)

    def released_at(self, k: int, t: float) -> EndConditions:
        """The same from t (s) on with end k free; its motion and its direction are over."""
        held, position = self.values.held.tolist(), self.values.position.copy()
        held[k], position[k] = 0, 0.0
        motions = {j: motion for j, motion in self.motions.items() if j != k}
        out = EndConditions(held, position, self._given[0], self._loads, motions)
        out.released[:] = self.released
        out.released[k] = 1
        out._turns, out._bring_in = {j: x for j, x in self._turns.items() if j != k}, self._bring_in
        out._set, out._paths, out.breaks = set(self._set), self._paths, self.breaks
        out.set_loads(t)
        out.at_time(t)
        return out

    def copy_frames(self, old: EndConditions) -> None:
        """Stand at rest as other conditions do: what no scene says of a frame hangs on the shape it started from."""
        self._stand_at(old._given[0])

    def _stand_at(self, frame: Floats) -> None:
        self._given, self._moves = (frame.copy(), self._given[1]), None
        self.values.frame[:] = frame
        for k, motion in self.motions.items():
            motion.turn_from(frame[k].reshape(3, 3))

    def checkpoint(self) -> dict[str, Any]:
        """What hangs on the shape that the run started from, and where the ends are."""
        turns = np.zeros((2, 4))
        for k, (axis, angle) in self._turns.items():
            turns[k] = [*axis, angle]
        ramps = np.array([x.ramp or 0.0 for x in self._loads])
        given = {"frame": self._given[0], "turns": turns, "bring_in": self._bring_in, "ramps": ramps}
        return given | {"position": self.values.position, "released": self.released.copy()}

    def restore(self, saved: Mapping[str, Any], t: float) -> float:
        """Go on at t (s) as `checkpoint` has said; ValueError where that cannot be.

        Returns the distance (m) of an end from where it was then: 0 if it moves as before.
        """
        if not (saved["bring_in"] > 0.0 and saved["ramps"].min(initial=0.0) >= 0.0):
            raise ValueError("a time that is not positive")
        if not np.array_equal(saved["released"], self.released):
            raise ValueError("other ends are let go than were")
        same = not (self._loads or self._turns or saved["turns"].any()) and np.array_equal(
            saved["frame"], self._given[0]
        )
        moves = self._moves if same else None  # of a run that has gone on since, and comes back
        self._stand_at(saved["frame"])
        self._turns = {k: (x[:3], float(x[3])) for k, x in enumerate(saved["turns"]) if x[3]}
        self._bring_in = saved["bring_in"]
        ramps = saved["ramps"].tolist()
        self._loads = tuple(x._replace(ramp=ramp or None) for x, ramp in zip(self._loads, ramps, strict=True))
        self.set_loads(t)
        self._moves = moves
        self.at_time(t)
        return float(np.abs(saved["position"] - self.values.position).max())

    def at_time(self, t: float) -> Ends:
        """Positions, frames and loads at t; the arrays returned are overwritten by the next call.

        t = infinity asks for what is given when everything has grown and turned in (motions stand at 0).
        """
        for k, motion in self.motions.items():
            position, velocity, frame, spin = motion.at_time(t if np.isfinite(t) else 0.0)
            self.values.position[k] = position
            self.velocity[k] = velocity
            if frame is not None:
                self.values.frame[k] = frame.ravel()
                self.values.spin[k] = spin
        if self._turns:
            self._turn(t)
        if t < self._growing_until or not self._grown:
            self._grow(t)
        return self.values

    def moves(self) -> Moves:
        """The same as arrays for kernels.laws.end_motion: loads that act now, frames and motions as they are now."""
        if self._moves is None:
            self._moves = self._as_moves()
        return self._moves

    def moves_from_here(self) -> Moves:
        """The same for ends whose frames have been settled since, as those of lines that are clamped at points are."""
        moves = self.moves()
        frame = moves.frame.copy()
        for k in (0, 1):
            if k not in self.motions and k not in self._turns:
                frame[k] = self.values.frame[k]
        return moves._replace(frame=frame)

    def drive(self, k: int) -> DrivenEnd:
        """From now on end k is set from outside; its motion, if it has one, is over."""
        values = self.values
        held, turns = bool(values.held[k]), bool(values.frame[k].any())
        end = DrivenEnd(self._paths[k], values.position[k], values.frame[k].reshape(3, 3), held, turns)
        self.motions, self._moves = {**self.motions, k: end}, None
        return end

    def load(self, what: Literal["force", "moment"], k: int, value: Floats, t: float) -> None:
        """From t (s), now, this force (N) or moment (N m) acts on end k, for good, instead of what did."""
        for row, x in enumerate(self._acting):
            if (what, k) in self._set and (x.what, x.end) == (what, k):
                x.value[:] = value
                if self._moves is not None:
                    self._moves.loads[row, 2:5] = value
                self._grown = False
                return
        self._set.add((what, k))
        others = [x for x in self._loads if (x.what, x.end) != (what, k)]
        self._loads = (*others, EndLoad(what, k, np.array(value, float), np.inf, None))
        self.set_loads(t)

    def keep_loads(self) -> Any:
        """The loads of both ends, those that have ended included, to come back to."""
        return tuple(x._replace(value=x.value.copy()) for x in self._loads), set(self._set)

    def bring_back_loads(self, kept: Any, t: float) -> None:
        """Be loaded again as when `keep_loads` was called, at t (s)."""
        loads, was_set = kept
        if not (loads or self._loads):
            return
        self._loads, self._set = tuple(x._replace(value=x.value.copy()) for x in loads), set(was_set)
        self.set_loads(t)

    def _as_moves(self) -> Moves:
        moves = table_of_motions(self.motions, self.values.position, self._given[0], self._paths, self.values.frame)
        missing = np.zeros((2, 4))
        for k, (axis, angle) in self._turns.items():
            missing[k] = [*axis, angle]
        loads, history = table_of_loads(self._acting)
        return moves._replace(missing=missing, bring_in=float(self._bring_in), loads=loads, history=history)

    def _grow(self, t: float) -> None:
        self._grown = t >= self._growing_until
        self.values.force[:] = 0.0
        self.values.moment[:] = 0.0
        for load in self._acting:
            (self.values.force if load.what == "force" else self.values.moment)[load.end] += load.grown(t)

    def acceleration(self, t: float, dt: float) -> Floats:
        """Accelerations (2, 3) of the ends at t, m/s2, by a central difference of their velocities over dt."""
        if not self.motions:
            return np.zeros((2, 3))
        self.at_time(t + 0.5 * dt)
        after = self.velocity.copy()
        self.at_time(t - 0.5 * dt)
        out = (after - self.velocity) / dt
        self.at_time(t)
        return np.asarray(out)

    def bring_in(
        self, chords: tuple[Floats, Floats], which: Sequence[bool], duration: float
    ) -> list[tuple[int, float]]:
        """Let tangents start as the cable lies, and reach their given directions after `duration` s, at ends `which`.

        chords: directions (3,) of the first and last cell at t = 0.  A tangent imposed at once on a cable
        that does not have it is an impact whose strength depends on the mesh alone; a force on such an end
        grows with it.  Returns (end, angle in rad) of those concerned.
        """
        for k in range(2):
            tangent = self.values.frame[k].reshape(3, 3)[:, 2]
            axis = np.cross(chords[k], tangent)
            sine, cosine = float(np.linalg.norm(axis)), float(np.dot(chords[k], tangent))
            angle = float(np.arctan2(sine, cosine))
            if which[k] and angle > SAME_DIRECTION:
                if sine < 1e-9:  # opposite: any axis across will do
                    axis, sine = first_director(tangent), 1.0
                self._turns[k] = (axis / sine, angle)
        self._bring_in = duration
        self._loads = tuple(
            x._replace(ramp=duration) if x.end in self._turns and x.ramp is None else x for x in self._loads
        )
        self.set_loads(0.0)
        self.at_time(0.0)
        return [(k, angle) for k, (_, angle) in self._turns.items()]

    def _turn(self, t: float) -> None:
        part, rate = rise(t, self._bring_in)
        for k, (axis, angle) in self._turns.items():
            if k not in self.motions:
                self.values.frame[k], self.values.spin[k] = self._given[0][k], self._given[1][k]
            if part < 1.0:
                back = rotation(-angle * (1.0 - part) * axis)
                self.values.frame[k] = (back @ self.values.frame[k].reshape(3, 3)).ravel()
                self.values.spin[k] = back @ self.values.spin[k] + axis * angle * rate


def rise(t: float, duration: float) -> tuple[float, float]:
    """A rise from 0 to 1 with continuous first and second derivative, and its rate (1/s); duration 0: 1 at once."""
    if duration == 0.0:
        return 1.0, 0.0
    x = min(max(t / duration, 0.0), 1.0)
    return x**3 * (10.0 - 15.0 * x + 6.0 * x * x), 30.0 * x * x * (1.0 - x) ** 2 / duration


# An end that is set from outside, step by step: where it is to be at the end of the next step, and the way there.
#
# The laws are those of laws.end_motion.driven_position and driven_frame, which move the end within compiled steps.

# Columns of a path.
FROM = 0  # begin, s
TO = 1  # end, s
AT = 2  # 3, position at the begin, m
SPEED = 5  # 3, velocity there, m/s
THERE = 8  # 3, position at the end, m
SPEED_THERE = 11  # 3, velocity there, m/s
FRAME = 14  # 9, at the begin
TURN = 23  # 3, rotation vector
PATH = 26
# Columns of what is known of its velocities.
IMPLIED = 0  # whether the last one followed from the places
STEPS = 1  # of a window
GONE = 2  # 3, how far the places go in it, m
SAID = 5  # 3, and how far the velocities that are given, m
APART = 8  # how far both are apart in all windows, m
WAY = 9  # how far they go in all windows, m
WINDOWS = 10  # their number
TOLD = 11  # whether it was reported that they contradict each other
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
    ) -> None:
        """From where it is at `begin` (s) to a place at `end`; turn: rotation vector in the axes of its frame, rad.

        velocity: (3,) m/s there, None: in one step that which the places imply, else at rest; one_step: whether the way
        is a step of the run.
        """
        path, numbers, record = self.path, self._numbers, self.record
        before = self._mean_velocity() if velocity is None and one_step else (STILL, 0.0)
        if begin < numbers[TO]:  # on its way
            path[AT:SPEED], path[SPEED:THERE], frame, _ = self.at_time(begin)
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
            velocity = STILL
            if one_step:  # at the end of the parabola through three places: by trapezoids velocities add up to the way
                (mean, dt), (earlier, took) = self._mean_velocity(), before  # of the way before, 0 s: it stood still
                velocity = np.asarray(mean + (mean - np.asarray(earlier)) * (dt / (dt + (took or dt))))
            record[:] = 0.0
            record[IMPLIED] = one_step
        numbers[SPEED_THERE], numbers[SPEED_THERE + 1], numbers[SPEED_THERE + 2] = velocity
        numbers[TURN], numbers[TURN + 1], numbers[TURN + 2] = turn
        if one_step and not self._counted[IMPLIED]:
            self._compare()

    def stay(self, begin: float, end: float, one_step: bool) -> None:
        """Be where it is at `begin` (s) until `end`; at rest there, unless its velocity follows from its places."""
        self.set(begin, end, self.at_time(begin)[0], None if self.record[IMPLIED] else STILL, STILL, one_step)

    def _mean_velocity(self) -> tuple[Vector, float]:
        """Mean velocity (3,) m/s of the way that is over, and how long that took, s; of none: zeros."""
        p = self.path
        dt = float(p[TO] - p[FROM])
        return ((p[THERE:SPEED_THERE] - p[AT:SPEED]) / dt, dt) if dt > 0.0 else (STILL, 0.0)

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

    def at_time(self, t: float) -> tuple[Floats, Floats, Floats, Floats]:
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
