"""Prescribed motion of an end: position, velocity, frame and angular velocity at any time.

A cable feels a jump of velocity as a blow, so motion has to start from rest and stay
smooth: `check_motions` refuses what does not.

Symbols: A amplitude, w = 2 pi / period, p phase; ramp r(t) = 10 x^3 - 15 x^4 + 6 x^5 with
x = t / ramp (C2 at both ends); harmonic r(t) A sin(w t + p); steady travel V times the integral
of r; rotation R = Rz Ry Rx applied to the base frame; eta(x, y, t) height of the surface above
still water, followed where the end is.  Everything adds up, in inertial axes, angles in radians
inside, degrees in the scene.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid.errors import Complaint, SceneError
from hybrid.scene.base import Finding, dotted
from hybrid.scene.cable import Environment
from hybrid.scene.ends import SHIFTS, TURNS, End, Ends, Harmonic, Motion, smooth_step
from hybrid.scene.motion_file import Record, RecordRefused, judge_record, read_record

if TYPE_CHECKING:
    from hybrid.scene.schema import Scene

Array = NDArray[np.float64]

# A harmonic motion counts as starting from rest below this part of its top speed: round-off.
AT_REST = 1e-6
# Time steps that a period, and a ramp, must last at least; and the part of its range that a recorded motion
# may bow within a step.  Six steps a period bow by 13 %, which is a poor answer but the same motion.
SAMPLES, RAMP_STEPS, MISSED = 6, 3, 0.15
# The most that an end may be turned in a step (rad): beyond half a turn nobody knows which way it went.
MOST_TURN = 1.0

# Height of the surface above still water [m] and its rate [m/s] at x, y [m], t [s].
Elevation = Callable[[float, float, float], tuple[float, float]]

# Distance over which the slope of the surface is taken by central differences of fourth order: for waves
# of 3 m and longer the error (k h)^4 / 30 is below 1e-11 of the slope, and round-off is no larger.
SLOPE_OVER = 2e-3


class EndMotion:
    """The motion of one end as a function of time.

    motion: the scene's table, or None for an end at rest; position: (3,) m, inertial, where the end
    is held (None for a guided end); frame: (3, 3), columns a1, a2, tangent in inertial axes, or None;
    elevation: the surface of the sea, which a motion with `follow: waves` needs.
    SceneError if the motion file cannot be read.
    """

    def __init__(
        self,
        motion: Motion | None,
        position: ArrayLike | None,
        frame: ArrayLike | None = None,
        elevation: Elevation | None = None,
    ) -> None:
        self._base = _constant(np.zeros(3) if position is None else position)
        self._frame = None if frame is None else _constant(frame)
        self._still = _constant(np.zeros(3))
        self._ramp = None if motion is None else motion.ramp
        harmonics = {} if motion is None else motion.harmonics()
        self._shifts = _components(harmonics, SHIFTS, 1.0)
        self._turns = _components(harmonics, TURNS, math.pi / 180)
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
            try:
                record = read_record(motion.file)
            except RecordRefused as refused:
                raise SceneError([_complaint(("motion",), refused.finding)]) from None
            self._shift_spline = _spline(record, record.shift)
            self._turn_spline = _spline(record, None if record.turn is None else np.radians(record.turn))
            self._last = float(record.times[-1])
        by_table = bool(self._shifts) or self._carried is not None or self._follows
        self._translates = by_table or self._shift_spline is not None
        self._rotates = bool(self._turns) or self._turn_spline is not None
        self.moving = self._translates or self._rotates

    def at(self, t: float) -> tuple[Array, Array, Array | None, Array]:
        """Position (3,) m, velocity (3,) m/s, frame (3, 3) or None, angular velocity (3,) rad/s at t [s].

        All inertial.  What does not move is returned read-only and shared.
        """
        position, velocity = self._translation(t) if self._translates else (self._base, self._still)
        frame, spin = self._rotation(t) if self._rotates else (self._frame, self._still)
        return position, velocity, frame, spin

    def turn_from(self, frame: ArrayLike) -> None:
        """Turn another frame (3, 3) from now on."""
        self._frame = None if self._frame is None else _constant(frame)

    def _translation(self, t: float) -> tuple[Array, Array]:
        if self._shift_spline is not None:
            t = min(t, self._last)
            return self._base + self._shift_spline(t), self._shift_spline(t, 1)
        r, dr = self._grow(t)
        position, velocity = self._base.tolist(), [0.0, 0.0, 0.0]
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
            eta, rate = self._surface(position[0], position[1], velocity[0], velocity[1], t)
            position[2] += eta
            velocity[2] += rate
        return np.array(position), np.array(velocity)

    def _surface(self, x: float, y: float, vx: float, vy: float, t: float) -> tuple[float, float]:
        """Elevation and its rate for someone who travels over the surface: d eta/dt + v . grad eta."""
        assert self._elevation is not None
        eta, rate = self._elevation(x, y, t)
        speed = math.hypot(vx, vy)
        if speed > 0.0:
            hx, hy = SLOPE_OVER * vx / speed, SLOPE_OVER * vy / speed
            near, far = (
                self._elevation(x + n * hx, y + n * hy, t)[0] - self._elevation(x - n * hx, y - n * hy, t)[0]
                for n in (1, 2)
            )
            rate += speed * (8.0 * near - far) / (12.0 * SLOPE_OVER)
        return eta, rate

    def _rotation(self, t: float) -> tuple[Array | None, Array]:
        if self._turn_spline is not None:
            t = min(t, self._last)
            turn, spin = _turn_by_vector(self._turn_spline(t), self._turn_spline(t, 1))
        else:
            r, dr = self._grow(t)
            angle, rate = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
            for axis, amplitude, w, phase in self._turns:
                sine, cosine = math.sin(w * t + phase), math.cos(w * t + phase)
                angle[axis] += r * amplitude * sine
                rate[axis] += amplitude * (dr * sine + r * w * cosine)
            turn, spin = _turn_by_angles(angle, rate)
        return None if self._frame is None else turn @ self._frame, spin

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


def _spline(record: Record, values: Array | None) -> Any:
    """C2 spline through `values`, counted from their value at t = 0 so that no rounding shows as a jump."""
    if values is None:
        return None
    from scipy.interpolate import CubicSpline  # slow to import, and most scenes have no motion file

    # A record that begins with the computation begins from rest (judge_record sees to it).
    start = (1, np.zeros(3)) if record.times[0] == 0.0 else "not-a-knot"
    zero = CubicSpline(record.times, values, bc_type=(start, "not-a-knot"))(0.0)
    return CubicSpline(record.times, values - zero, bc_type=(start, "not-a-knot"))


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


# --- refusing ----------------------------------------------------------------------------------


def check_motions(scene: Scene) -> None:
    """SceneError if an end's motion cannot be read, does not start from rest, jumps, or ends too early."""
    found = motion_findings(scene.ends, scene.time.duration if scene.time is not None else None)
    if scene.time is not None and not found:
        found = resolution_findings(scene.ends, scene.environment, scene.time.step)
    if found:
        raise SceneError([_complaint((), finding) for finding in found])


def _motions(ends: Ends) -> list[tuple[tuple[str, ...], End, Motion]]:
    """Place, end and motion of the ends that are moved."""
    return [
        (("ends", name, "motion"), end, end.prescribed_motion)
        for name, end in ends.named().items()
        if end.prescribed_motion is not None
    ]


def motion_findings(ends: Ends, duration: float | None) -> list[Finding]:
    """What is wrong with the motions of both ends; paths count from the scene."""
    found: list[Finding] = []
    for here, end, motion in _motions(ends):
        wrong = _file_findings(end, motion, duration) if motion.file is not None else _harmonic_jump(motion)
        found += [Finding((*here, *f.at), f.expected, f.fix, f.given) for f in wrong]
    return found


def _periods(ends: Ends, environment: Environment | None) -> dict[str, float]:
    """Every period, s, that a scene names, by the key that names it."""
    periods: dict[str, float] = {}
    waves = environment.fluid.waves if environment is not None and environment.fluid is not None else None
    if waves is not None:
        periods["environment.fluid.waves"] = waves.main_period
    for here, _, motion in _motions(ends):
        for what, harmonics in motion.harmonics().items():
            listed = not isinstance(getattr(motion, what), Harmonic)
            for i, h in enumerate(harmonics):
                if h.amplitude:
                    periods[dotted((*here, what, i) if listed else (*here, what))] = h.period
    return periods


def shortest_period(ends: Ends, environment: Environment | None) -> float:
    """The shortest period, ramp or move of a scene, s; infinity if it names none."""
    ramps = [t for _, _, m in _motions(ends) for t in (m.ramp, m.travel.over if m.travel else None) if t]
    records = [_shortest_in(read_record(m.file)) for _, _, m in _motions(ends) if m.file is not None]
    return min([*_periods(ends, environment).values(), *ramps, *records], default=math.inf)


def _shortest_in(record: Record) -> float:
    """What is to a record as a period is to a harmonic, s.

    Over a step of h a path with acceleration a leaves its chord by a h^2/8; MISSED of its range is too much, and of a
    harmonic a quarter of its period is that long.
    """
    shortest = math.inf
    for values in (record.shift, record.turn):
        spline = _spline(record, values)
        if spline is None:
            continue
        t = np.linspace(record.times[0], record.times[-1], min(200_000, 4 * record.times.size))
        reach = float(np.ptp(spline(t), axis=0).max())
        bend = float(np.abs(spline(t, 2)).max())
        if reach > 0.0 and bend > 0.0:
            shortest = min(shortest, 4.0 * math.sqrt(8.0 * MISSED * reach / bend))
    return shortest


def ramp_ends(scene: Scene) -> list[float]:
    """Times, s, at which something stops growing or moving: a step should end there."""
    fluid, ends = scene.environment.fluid, scene.ends
    moves = [m.travel for _, _, m in _motions(ends) if m.travel is not None]
    times = [m.ramp for _, _, m in _motions(ends)] + [t for m in moves for t in (m.begin, m.begin + m.over)]
    times += [getattr(x, "ramp", None) for x in ((fluid.current, fluid.waves) if fluid is not None else ())]
    times += [load.ramp for end in ends.both for load in end.loads]
    return [t for t in times if t]


def resolution_findings(ends: Ends, environment: Environment | None, step: float | None) -> list[Finding]:
    """What a fixed time step cannot follow: fewer than SAMPLES steps a period or RAMP_STEPS in a ramp or a move."""
    found: list[Finding] = []
    if step is None:
        return found
    waves = environment.fluid.waves if environment is not None and environment.fluid is not None else None
    periods = _periods(ends, environment)
    shortest = RAMP_STEPS * step * (1 - 1e-9)
    for here, _, motion in _motions(ends):
        for what, harmonics in motion.harmonics().items():
            listed = not isinstance(getattr(motion, what), Harmonic)
            for i, h in enumerate(harmonics):
                rate = 2 * math.pi * math.radians(abs(h.amplitude)) / h.period if what not in SHIFTS else 0.0
                if rate * step > MOST_TURN:
                    name = dotted((*here, what, i) if listed else (*here, what))
                    most = _rounded_down(MOST_TURN / rate)
                    expected = f"at most {most} s: the end turns by a radian in that, by {name}"
                    fix = f"time.step: {0.3 * MOST_TURN / rate:.3g}, or less"
                    found.append(Finding(("time", "step"), expected, fix, f"{step:g}"))
        slow = [h.period for harmonics in motion.harmonics().values() for h in harmonics]
        steps = f"{RAMP_STEPS} time steps of {step:g} s"
        if motion.ramp is not None and motion.ramp < shortest:
            fix = f"ramp: {2 * max(slow):.3g}, two periods" if slow else "a longer ramp, or a smaller time.step"
            expected = f"a ramp of at least {steps}, or it is a jump"
            found.append(Finding((*here, "ramp"), expected, fix, f"{motion.ramp:g}"))
        if motion.travel is not None and motion.travel.over < shortest:
            expected = f"a move over at least {steps}, or it is a jump"
            fix = "a longer time, or a smaller time.step"
            found.append(Finding((*here, "travel", "over"), expected, fix, f"{motion.travel.over:g}"))
        if motion.follow is not None and waves is not None and waves.ramp is not None and waves.ramp < shortest:
            expected = f"a ramp of at least {steps}, because {dotted(here)} follows the waves"
            fix = f"ramp: {2 * waves.main_period:.3g}, two periods"
            found.append(Finding(("environment", "fluid", "waves", "ramp"), expected, fix, f"{waves.ramp:g}"))
        if motion.file is not None:
            missed = _missed_between(read_record(motion.file), step)
            if missed is not None:
                where = dotted((*here, "file"))
                expected = f"steps so short that {where} is nearly straight within each; it turns at t = {missed:g} s"
                found.append(Finding(("time", "step"), expected, "a smaller step, or a smoother record", f"{step:g}"))
    if periods:
        fastest = min(periods, key=lambda name: periods[name])
        period = periods[fastest]
        if period < SAMPLES * step * (1 - 1e-9):
            expected = f"at most a sixth of the shortest period, {_rounded_down(period / SAMPLES)} s, of {fastest}"
            found.append(Finding(("time", "step"), expected, f"time.step: {period / 20:.3g}, or less", f"{step:g}"))
    return found


def _rounded_down(x: float) -> str:
    """Three digits of a positive number that do not exceed it, for bounds that are to be copied."""
    x = max(x, 1e-300)  # below, the last of three digits underflows
    unit = 10.0 ** (math.floor(math.log10(x)) - 2)
    return f"{math.floor(x / unit * (1 + 1e-9)) * unit:.3g}"


def _missed_between(record: Record, step: float) -> float | None:
    """Time at which a record departs most from its chord over a step, when that is a large part of its range."""
    last = float(record.times[-1])
    t = np.linspace(0.0, max(last - step, 0.0), min(20_000, max(2, int(4 * last / step))))
    for values in (record.shift, record.turn):
        spline = _spline(record, values)
        if spline is None:
            continue
        bow = np.abs(spline(t + 0.5 * step) - 0.5 * (spline(t) + spline(np.minimum(t + step, last)))).max(axis=1)
        reach = float(np.ptp(spline(t), axis=0).max())
        if reach > 0.0 and bow.max() > MISSED * reach:
            return float(t[int(bow.argmax())])
    return None


def _harmonic_jump(motion: Motion) -> list[Finding]:
    """A harmonic motion without ramp starts with a velocity (phase 0), a displacement (phase 90), or both."""
    moving = [(name, h) for name, listed in motion.harmonics().items() for h in listed if h.amplitude != 0.0]
    if motion.ramp is not None or not moving:
        return []
    name, h = moving[0]
    w, phase = 2 * math.pi / h.period, math.radians(h.phase)
    unit = "m" if name in SHIFTS else "deg"
    speed, offset = h.amplitude * w * math.cos(phase), h.amplitude * math.sin(phase)
    jump = f"velocity jumps to {speed:.4g} {unit}/s"
    if abs(speed) <= AT_REST * abs(h.amplitude) * w:
        jump = f"position jumps by {offset:.4g} {unit}"
    expected = "motion that starts from rest where the end is held, because the cable starts at rest"
    fix = f"give `ramp: {2 * max(h.period for _, h in moving):.6g}` (s), two periods"
    return [Finding((), expected, fix, f"{name} without ramp: {jump} at t = 0")]


def _file_findings(end: End, motion: Motion, duration: float | None) -> list[Finding]:
    try:
        record = read_record(motion.file or "")
    except RecordRefused as refused:
        return [refused.finding]
    if end.held_tangent is None and record.turn is not None:
        given = f"{record.name} with rotations"
        return [
            Finding(
                ("file",), "columns t,x,y,z, because a pinned end turns freely", "kind: clamped can be turned", given
            )
        ]
    if end.held_position is None and record.shift is not None:
        given = f"{record.name} with positions"
        expected = "columns t,rx,ry,rz, because the position of a guided end is free"
        return [Finding(("file",), expected, "kind: clamped can be moved", given)]
    position = None if end.held_position is None else np.array(end.held_position)
    return judge_record(record, position, duration)


def _complaint(prefix: tuple[str, ...], finding: Finding) -> Complaint:
    return Complaint(dotted((*prefix, *finding.at)), finding.given or "motion", finding.expected, finding.fix)
