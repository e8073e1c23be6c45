"""Prescribed motion of an end: position, velocity, frame and angular velocity at any time.

Motion has to start from rest and stay smooth: `motion_checks` refuses what does not.

Symbols: A amplitude, w = 2 pi / period, p phase; ramp r(t) = 10 x^3 - 15 x^4 + 6 x^5 with
x = t / ramp (C2 at both ends), which multiplies a file as well; harmonic r(t) A sin(w t + p);
steady travel V times the integral of r; rotation R = Rz Ry Rx applied to the base frame;
eta(x, y, t) height of the surface above still water, followed where the end is.  Everything adds
up, in inertial axes, angles in radians inside, degrees in the scene.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid.errors import Complaint, SceneError
from hybrid.scene.end_loads import Triple
from hybrid.scene.motion_file import Record, RecordRefused, continuous, read_record, spline, vectors_of
from hybrid.scene.motion_tables import SHIFTS, TURNS, Harmonic, Motion, Vessel, smooth_step
from hybrid.scene.rao_file import drift_harmonics, point_harmonics

Array = NDArray[np.float64]

# Height of the surface above still water [m], its rate [m/s] and its slopes along x and y, at x, y [m], t [s].
Elevation = Callable[[float, float, float], tuple[float, float, float, float]]


class MotionTerms(NamedTuple):
    """What a motion adds up from, as numbers, for an evaluation elsewhere.

    translates, rotates: whether it moves and turns the end; harmonics: axis (0 to 2 along x, y, z, 3 to 5 about them),
    amplitude [m or rad], angular frequency [1/s], phase [rad]; ramp [s], 0: none; velocity [m/s] and its ramp [s],
    0: no velocity; travel: the way [m], its beginning and its duration [s], 0: no travel; follows: the surface of the
    sea; knots: (K,) [s] of a file; cubics: (K, 6, 4) from each knot on, highest power first [m, rad]; ride: of an end
    on a body that moves so, the axes (3, 3) of that without motion, the place (3,) [m] of the end in these, and the
    frame (3, 3) with which it turns there, None: it turns freely.
    """

    translates: bool
    rotates: bool
    harmonics: tuple[tuple[float, ...], ...]
    ramp: float
    velocity: tuple[float, ...]
    velocity_ramp: float
    travel: tuple[float, ...]
    follows: bool
    knots: Array
    cubics: Array
    ride: tuple[Array, Array, Array | None] | None = None


class EndMotion:
    """The motion of one end as a function of time.

    motion: the scene's table, or None for an end at rest; position: (3,) m, inertial, where the end
    is held (None for a guided end); frame: (3, 3), columns a1, a2, tangent in inertial axes, or None;
    elevation: the surface of the sea, which a motion with `follow: waves` needs;
    waves: (J, 6) of `Sea.waves`, their ramp [s], and whether the end turns with a vessel, which a motion with `vessel`
    needs.  base: (3,) m, without motion.
    SceneError if the motion file cannot be read.
    """

    def __init__(
        self,
        motion: Motion | None,
        position: ArrayLike | None,
        frame: ArrayLike | None = None,
        elevation: Elevation | None = None,
        waves: tuple[Array, float, bool] | None = None,
    ) -> None:
        self.base = _constant(np.zeros(3) if position is None else position)
        self._frame = None if frame is None else _constant(frame)
        self._still = _constant(np.zeros(3))
        self._motion = motion
        self._ramp = None if motion is None else motion.ramp
        harmonics = {} if motion is None else motion.harmonics()
        self._shifts = _components(harmonics, SHIFTS, 1.0)
        self._turns = _components(harmonics, TURNS, math.pi / 180)
        if motion is not None and motion.vessel is not None and motion.file is None:
            self._sail(motion.vessel, waves)
        self._carried = None
        if motion is not None and ((motion.velocity and any(motion.velocity)) or motion.travel is not None):
            self._carried = motion.carried
        self._follows = motion is not None and motion.follow is not None
        if self._follows and elevation is None:
            raise ValueError("a motion that follows the waves needs their elevation")
        self._elevation = elevation
        self._shift_spline: Any = None
        self._turn_spline: Any = None
        if motion is not None and motion.file is not None:
            self._read_record(motion, waves[2] if waves is not None else frame is not None)
        by_table = bool(self._shifts) or self._carried is not None or self._follows
        self._translates = by_table or self._shift_spline is not None
        self._rotates = bool(self._turns) or self._turn_spline is not None
        self.moving = self._translates or self._rotates

    def _read_record(self, motion: Motion, turns: bool) -> None:
        """Splines of the motion file; turns: whether the end turns with the motion."""
        try:
            record = motion_record(motion, self.base.tolist(), turns)
        except RecordRefused as refused:
            found = refused.finding
            raise SceneError([Complaint("motion.file", found.given or "", found.expected, found.fix)]) from None
        if record.shift is not None:
            self._shift_spline = spline(record.times, record.shift, self.base if self._ramp else None)
        if record.rotation is not None:
            still = np.zeros(3) if self._ramp else None
            self._turn_spline = spline(record.times, np.radians(record.rotation), still)
        self._last = float(record.times[-1])

    def at(self, t: float) -> tuple[Array, Array, Array | None, Array]:
        """Position (3,) m, velocity (3,) m/s, frame (3, 3) or None, angular velocity (3,) rad/s at t [s].

        All inertial.  What does not move is returned read-only and shared.
        """
        position, velocity = self._translation(t) if self._translates else (self.base, self._still)
        frame, spin = self._rotation(t) if self._rotates else (self._frame, self._still)
        return position, velocity, frame, spin

    def turn_from(self, frame: ArrayLike) -> None:
        """Turn another frame (3, 3) from now on."""
        self._frame = None if self._frame is None else _constant(frame)

    def terms(self) -> MotionTerms:
        """What the motion adds up from."""
        motion, still = self._motion, (0.0, 0.0, 0.0)
        velocity = motion.velocity if motion is not None else None
        travel = motion.travel if motion is not None else None
        harmonics = (*self._shifts, *((axis + 3, *h) for axis, *h in self._turns))
        splines = [x for x in (self._shift_spline, self._turn_spline) if x is not None]
        knots = splines[0].x if splines else np.zeros(0)
        cubics = np.zeros((knots.size, 6, 4))
        for first, curve in ((0, self._shift_spline), (3, self._turn_spline)):
            if curve is not None:
                cubics[:-1, first : first + 3] = curve.c.transpose(1, 2, 0)
        ramped = velocity is not None and any(velocity)
        return MotionTerms(
            self._translates, self._rotates, harmonics, self._ramp or 0.0,
            velocity or still, (self._ramp or 0.0) if ramped else 0.0,
            (*travel.by, travel.begin, travel.over) if travel is not None else (*still, 0.0, 0.0),
            self._follows, knots, cubics,
        )  # fmt: skip

    def _translation(self, t: float) -> tuple[Array, Array]:
        if self._shift_spline is not None:
            shift, speed = self._followed(self._shift_spline, t)
            return self.base + shift, speed
        r, dr = self._grow(t)
        position, velocity = self.base.tolist(), [0.0, 0.0, 0.0]
        for axis, amplitude, w, phase in self._shifts:
            sine, cosine = math.sin(w * t + phase), math.cos(w * t + phase)
            position[axis] += r * amplitude * sine
            velocity[axis] += amplitude * (dr * sine + r * w * cosine)
        if self._carried is not None:
            far, fast = self._carried(t)
            for axis in range(3):
                position[axis] += far[axis]
                velocity[axis] += fast[axis]
        if self._follows:
            assert self._elevation is not None
            eta, rate, slope_x, slope_y = self._elevation(position[0], position[1], t)
            position[2] += eta
            velocity[2] += rate + slope_x * velocity[0] + slope_y * velocity[1]
        return np.array(position), np.array(velocity)

    def _rotation(self, t: float) -> tuple[Array | None, Array]:
        if self._turn_spline is not None:
            turn, spin = _turn_by_vector(*self._followed(self._turn_spline, t))
        else:
            r, dr = self._grow(t)
            angle, rate = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
            for axis, amplitude, w, phase in self._turns:
                sine, cosine = math.sin(w * t + phase), math.cos(w * t + phase)
                angle[axis] += r * amplitude * sine
                rate[axis] += amplitude * (dr * sine + r * w * cosine)
            turn, spin = _turn_by_angles(angle, rate)
        return None if self._frame is None else turn @ self._frame, spin

    def _sail(self, vessel: Vessel, waves: tuple[Array, float, bool] | None) -> None:
        """Move with a vessel in waves."""
        if waves is None or not len(waves[0]):
            raise ValueError("a vessel needs waves to move in")
        components, ramp, turns = waves
        assert vessel.rao is not None
        try:
            harmonics = point_harmonics(vessel.rao, components, np.array(vessel.origin), vessel.heading, self.base)
        except RecordRefused as refused:
            found = refused.finding
            raise SceneError([Complaint("motion.vessel.rao", found.given or "", found.expected, found.fix)]) from None
        if vessel.drift is not None:
            harmonics += drift_harmonics(vessel.drift, np.array(vessel.origin), vessel.heading, self.base)
        self._ramp = ramp
        self._shifts = [h for h in harmonics if h[0] < 3]
        self._turns = [(axis - 3, a, w, phase) for axis, a, w, phase in harmonics if axis >= 3 and turns]

    def _followed(self, curve: Any, t: float) -> tuple[Array, Array]:
        """Value (3,) and rate of a spline, as far as it has grown."""
        r, dr = self._grow(t)
        t = min(t, self._last)
        value, rate = curve(t), curve(t, 1)
        return r * value, r * rate + dr * value

    def _grow(self, t: float) -> tuple[float, float]:
        """The ramp and its derivative [1/s]."""
        if self._ramp is None or t >= self._ramp:
            return 1.0, 0.0
        grown, rate = smooth_step(t / self._ramp)
        return grown, rate / self._ramp


def _constant(value: ArrayLike) -> Array:
    array = np.array(value, dtype=float)
    array.flags.writeable = False
    return array


def _components(
    harmonics: dict[str, tuple[Harmonic, ...]], names: tuple[str, ...], scale: float
) -> list[tuple[int, float, float, float]]:
    """(axis, amplitude, angular frequency, phase) of the harmonics that move at all."""
    return [
        (axis, scale * h.amplitude, 2 * math.pi / h.period, math.radians(h.phase))
        for axis, name in enumerate(names)
        for h in harmonics.get(name, ())
        if h.amplitude != 0.0
    ]


def _turn_by_angles(angle: list[float], rate: list[float]) -> tuple[Array, Array]:
    """Rz(yaw) Ry(pitch) Rx(roll) and its angular velocity: every rate about its own axis, turned by what follows."""
    (cx, cy, cz), (sx, sy, sz) = map(math.cos, angle), map(math.sin, angle)
    turn = np.array(
        [
            [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
            [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
            [-sy, cy * sx, cy * cx],
        ]
    )
    roll, pitch, yaw = rate
    return turn, np.array([cz * cy * roll - sz * pitch, sz * cy * roll + cz * pitch, yaw - sy * roll])


def _turn_by_vector(vector: Array, rate: Array) -> tuple[Array, Array]:
    """exp of a rotation vector [rad] and the angular velocity that belongs to its rate (Rodrigues)."""
    x, y, z = vector
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    square = skew @ skew
    angle = math.sqrt(x * x + y * y + z * z)
    if angle < 1e-4:  # below, the next Taylor terms are under round-off, and 1 - cos loses digits
        a, b, c = 1.0 - angle**2 / 6, 0.5 - angle**2 / 24, 1 / 6 - angle**2 / 120
    else:
        a, b = math.sin(angle) / angle, 2.0 * (math.sin(angle / 2) / angle) ** 2
        c = (1.0 - a) / angle**2
    return np.eye(3) + a * skew + b * square, rate + b * (skew @ rate) + c * (square @ rate)


# The recorded motion of an end: its own, or that of a vessel that carries it, in six degrees of freedom.
#
#     symbol   meaning                                                                          unit
#     P, R     origin of the vessel and its axes (to the bow, to port, up), inertial            m, -
#     R0       its axes at rest, turned by `heading` about the vertical                         -
#     f        the end in axes of the vessel, f = R0^T (position - origin)                      m
#
# The end is at P + R f, and what it holds is turned by R R0^T.  Angles: R = Rz(yaw) Ry(pitch) Rx(roll).


def motion_record(motion: Motion, position: Triple | None, turns: bool = True) -> Record:
    """The record of `motion.file` as motion of an end at `position` (m); turns: whether the end holds a direction.

    RecordRefused: the file cannot be read, or a vessel has no positions or no rotations in it.
    """
    record = read_record(motion.file or "")
    vessel = motion.vessel
    if vessel is None:
        return record
    if record.shift is None or record.rotation is None or record.shift_unit is None or record.rotation_unit is None:
        fix = "add the columns that are missing; zeros where it does not move"
        expected = "columns t,x,y,z and roll,pitch,yaw (or rx,ry,rz), because a vessel carries the end"
        raise RecordRefused(expected, fix, f"{record.name} without {'positions' if record.shift is None else 'turns'}")
    c, s = math.cos(math.radians(vessel.heading)), math.sin(math.radians(vessel.heading))
    at_rest = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    arm = at_rest.T @ (np.array(position or vessel.origin) - np.array(vessel.origin))
    axes = rotations(np.radians(record.rotation))
    shift = record.shift + axes @ arm
    reach = float(np.linalg.norm(arm))
    shift_unit = record.shift_unit + reach * np.radians(record.rotation_unit.max(axis=1, keepdims=True))
    if not turns:
        return replace(record, shift=shift, shift_unit=shift_unit, rotation=None, rotation_unit=None)
    turned = np.degrees(continuous(vectors_of(axes @ at_rest.T)))
    return replace(record, shift=shift, shift_unit=shift_unit, rotation=turned)


def rotations(vectors: Array) -> Array:
    """Rotation matrices (n, 3, 3) of rotation vectors (n, 3) rad."""
    angle = np.sqrt((vectors**2).sum(axis=1))
    near = angle < 1e-4
    safe = np.where(near, 1.0, angle)
    a = np.where(near, 1.0 - angle**2 / 6.0, np.sin(safe) / safe)
    b = np.where(near, 0.5 - angle**2 / 24.0, (1.0 - np.cos(safe)) / safe**2)
    K = np.zeros((len(vectors), 3, 3))
    x, y, z = vectors.T
    K[:, 0, 1], K[:, 0, 2], K[:, 1, 2] = -z, y, -x
    K -= K.transpose(0, 2, 1)
    return np.asarray(np.eye(3) + a[:, None, None] * K + b[:, None, None] * (K @ K))
