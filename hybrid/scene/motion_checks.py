"""Whether prescribed motions can be computed.

They start from rest, are smooth, no faster than a cable can follow, and resolved by the time step.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import chain
from typing import Any, NamedTuple, Protocol

import numpy as np

from hybrid.scene.analysis import Time
from hybrid.scene.base import Finding, Place, dotted
from hybrid.scene.cable import Cable, Environment
from hybrid.scene.ends import End, Ends, Triple
from hybrid.scene.motion import EndMotion, motion_record, read_rao
from hybrid.scene.motion_file import (
    MISSED,
    Record,
    RecordRefused,
    fastest_in,
    judge_record,
    missed_between,
    read_history,
    read_record,
    shortest_in,
    unreadable,
)
from hybrid.scene.motion_tables import SHIFTS, Harmonic, Motion, Row, Vessel
from hybrid.scene.obstacles import Obstacles
from hybrid.scene.sea_checks import deepest_place

# A harmonic motion counts as starting from rest below this part of its top speed: round-off.
AT_REST = 1e-6
# Time steps that a period, and a ramp, must last at least: six steps a period are a poor answer, but the same motion.
SAMPLES, RAMP_STEPS = 6, 3
# rad, through which an obstacle may spin in a time step.
LARGEST_TURN = 1.0
# What spins take for so many such turns counts as a period: the longest steps of a coarser run, three to a period, then
# turn an obstacle through one of them.
TURNS_AS_PERIOD = 3.0

# m, between the position of an end and its fairlead.
SAME_FAIRLEAD = 1e-3
# Speed of tension waves, m/s, in what is given as inextensible: that of steel; ropes and chains are slower.
STEEL_WAVES = 5000.0
# Largest speed and acceleration of a smooth move, over way / time and way / time^2: 15/8, and that of the polynomial
# 10 x^3 - 15 x^4 + 6 x^5 at x = (3 - sqrt(3)) / 6.
TOP_SPEED, TOP_ACCELERATION = 1.875, 10.0 / math.sqrt(3.0)


class Moving(Protocol):
    """What moves and loads a line: of its scene, the tables that are asked here."""

    @property
    def ends(self) -> Ends: ...

    @property
    def environment(self) -> Environment: ...


def motion_findings(tables: Mapping[str, Any]) -> list[Finding]:
    """What is wrong with the motions of both ends, by the tables of a scene that can be read (name -> table)."""
    ends, time, cable, environment = (tables.get(name) for name in ("ends", "time", "cable", "environment"))
    if not isinstance(ends, Ends):
        return []
    step = time.step if isinstance(time, Time) else None
    found: list[Finding] = []
    late: list[Finding] = []  # about the time step; left out where the motion itself is wrong
    for here, moved, motion in [*_motions(ends), *_obstacles(tables.get("obstacles"))]:
        record, wrong = None, list(_harmonic_jump(motion))
        if motion.file is not None:
            record, wrong = _judged(moved, motion, time.duration if isinstance(time, Time) else None)
        if record is not None and isinstance(time, Time):  # what comes later moves nothing
            record = record.within(time.duration)
        if motion.vessel is not None:
            wrong += _vessel(moved, motion.vessel)
        if not wrong and isinstance(cable, Cable) and not isinstance(moved, Held):
            wrong = list(_too_fast(cable, motion, record))
            wrong += moved_into_the_ground(moved, motion, record, time, environment, cable.length)
        found += [Finding((*here, *f.at), f.expected, f.fix, f.given) for f in wrong]
        if step is not None and not wrong:
            late += _unresolved(here, motion, record, environment, step)
            late += _fast_period(here, motion, step) if isinstance(moved, Held) else ()
    if step is not None:
        late += _fast_spins(tables.get("obstacles"), step)
    for wrong_load in load_findings(ends, step, time.duration if isinstance(time, Time) else math.inf):
        (late if wrong_load.at[0] == "time" else found).append(wrong_load)
    if step is not None:
        late += _fastest_period(ends, environment, step)
    return found or late


class Held(NamedTuple):
    """What moves by a motion, and where: an end, or an obstacle about its place."""

    motion: Motion
    held_position: tuple[float, float, float] | None
    held_tangent: tuple[float, float, float] | None


def _obstacles(obstacles: Obstacles | None) -> list[tuple[tuple[str, ...], End | Held, Motion]]:
    """Place, what moves and motion of the obstacles that do."""
    return [
        (("obstacles", name, "motion"), Held(x.motion, x.at, (1.0, 0.0, 0.0)), x.motion)
        for name, x in (obstacles or {}).items()
        if x.motion is not None
    ]


def _fast_spins(obstacles: Obstacles | None, step: float) -> Iterator[Finding]:
    """Obstacles that turn so far in a time step that the way of their surface is no longer known."""
    for name, x in (obstacles or {}).items():
        spin = getattr(x, "spin", None)
        if spin is None:
            continue
        if abs(spin.rate) * step > LARGEST_TURN:
            expected = f"at most {_rounded_down(LARGEST_TURN / abs(spin.rate))} s: a radian of obstacles.{name}.spin"
            yield Finding(("time", "step"), expected, "a smaller step", f"{step:g}")
        if spin.ramp < RAMP_STEPS * step * (1 - 1e-9):
            expected = f"a ramp of at least {RAMP_STEPS} time steps of {step:g} s, or it is a jump"
            yield Finding(("obstacles", name, "spin", "ramp"), expected, "a longer ramp", f"{spin.ramp:g}")


def _fast_period(here: Place, motion: Motion, step: float) -> Iterator[Finding]:
    """A harmonic that a time step does not resolve."""
    for where, _, h in _periods(here, motion):
        if h.period < SAMPLES * step * (1 - 1e-9):
            expected = f"at most a sixth of the period of {where}, {_rounded_down(h.period / SAMPLES)} s"
            yield Finding(("time", "step"), expected, f"time.step: {h.period / 20:.3g}, or less", f"{step:g}")


def _motions(ends: Ends) -> list[tuple[tuple[str, ...], End | Held, Motion]]:
    """Place, end and motion of the ends that are moved."""
    return [
        (("ends", name, "motion"), end, end.prescribed_motion)
        for name, end in ends.named().items()
        if end.prescribed_motion is not None
    ]


# --- where it starts, and how fast it moves ----------------------------------------------------


def _harmonic_jump(motion: Motion) -> Iterator[Finding]:
    """A harmonic motion without ramp starts with a velocity (phase 0), a displacement (phase 90), or both."""
    moving = [(name, h) for name, listed in motion.harmonics().items() for h in listed if h.amplitude != 0.0]
    if motion.ramp is not None or not moving:
        return
    name, h = moving[0]
    w, phase = 2 * math.pi / h.period, math.radians(h.phase)
    unit = "m" if name in SHIFTS else "deg"
    speed, offset = h.amplitude * w * math.cos(phase), h.amplitude * math.sin(phase)
    jump = f"velocity jumps to {speed:.4g} {unit}/s"
    if abs(speed) <= AT_REST * abs(h.amplitude) * w:
        jump = f"position jumps by {offset:.4g} {unit}"
    expected = "motion that starts from rest where the end is held, because the cable starts at rest"
    fix = f"give `ramp: {2 * max(h.period for _, h in moving):.6g}` (s), two periods"
    yield Finding((), expected, fix, f"{name} without ramp: {jump} at t = 0")


def _judged(end: End | Held, motion: Motion, duration: float | None) -> tuple[Record | None, list[Finding]]:
    """A motion file, if it can be read, and what is wrong with it."""
    try:
        record = motion_record(motion, end.held_position, end.held_tangent is not None)
    except RecordRefused as refused:
        return None, [refused.finding]
    if end.held_tangent is None and record.rotation is not None:
        given, expected = f"{record.name} with rotations", "columns t,x,y,z, because a pinned end turns freely"
        return record, [Finding(("file",), expected, "kind: clamped can be turned", given)]
    if end.held_position is None and record.shift is not None:
        given, expected = (
            f"{record.name} with positions",
            "columns t,rx,ry,rz, because the position of a guided end is free",
        )
        return record, [Finding(("file",), expected, "kind: clamped can be moved", given)]
    return record, judge_record(record, end.held_position, duration, motion.ramp is not None)


def _vessel(end: End | Held, vessel: Vessel) -> Iterator[Finding]:
    """A vessel whose table cannot be read, or whose fairlead is not where the end is held."""
    try:
        if vessel.rao is not None:
            read_rao(vessel.rao)
    except RecordRefused as refused:
        found = refused.finding
        yield Finding(("vessel", "rao"), found.expected, found.fix, found.given)
    if vessel.fairlead is not None and end.held_position is not None:
        place = vessel.place(vessel.fairlead)
        if math.dist(place, end.held_position) > SAME_FAIRLEAD:
            text = ", ".join(f"{x:.7g}" for x in place)
            expected = "the position of the end, in axes of the vessel"
            yield Finding(("vessel", "fairlead"), expected, f"the position of the end would be [{text}]")


def _too_fast(cable: Cable, motion: Motion, record: Record | None) -> Iterator[Finding]:
    """A travel or a recorded motion at which a cable would break at once: by a typing error, most likely.

    An end that is pulled at v sends a wave of tension along the cable, which stretches it by v/c behind its front,
    c = sqrt(EA/m); with acceleration a, no more than the whole cable of length L does by its inertia, a L/c^2.
    """
    waves = [(math.sqrt(s.stiffness / s.mass) if s.stiffness else STEEL_WAVES, s) for s in cable.sections]
    c, most = max(((c, s.strain_limit) for c, s in waves), key=lambda pair: pair[0] * pair[1])
    limit = f"at most {100 * most:.4g} % of stretch (max_strain)"

    def stretch(speed: float, acceleration: float) -> float:
        return min(speed / c, acceleration * cable.length / c**2)

    def limit_text(speed: float, acceleration: float) -> str:
        strain = 100 * stretch(speed, acceleration)
        return f"{limit}; with tension waves of {c:.4g} m/s, this speed asks for {strain:.3g} %"

    if motion.travel is not None:
        way, over = math.hypot(*motion.travel.by), motion.travel.over
        speed, acceleration = TOP_SPEED * way / over, TOP_ACCELERATION * way / over / over
        if stretch(speed, acceleration) > most:
            enough = min(TOP_SPEED * way / (most * c), math.sqrt(TOP_ACCELERATION * way * cable.length / most) / c)
            given = f"{way:.6g} m in {over:g} s: up to {speed:.3g} m/s and {acceleration:.3g} m/s^2"
            fix = f"over: {_rounded_up(enough)} (s) or more, if way and time are meant so"
            yield Finding(("travel", "over"), limit_text(speed, acceleration), fix, given)
    if record is not None:
        speed, acceleration = fastest_in(record)
        if stretch(speed, acceleration) > most:
            given = f"{record.name}: up to {speed:.3g} m/s and {acceleration:.3g} m/s^2"
            fix = f"check the units of the columns (s, m): {most * c:.3g} m/s would be accepted"
            yield Finding(("file",), limit_text(speed, acceleration), fix, given)


# --- what the time step resolves ---------------------------------------------------------------


def _periods(here: Place, motion: Motion) -> Iterator[tuple[str, str, Harmonic]]:
    """Key, name (`heave`) and table of every harmonic of a motion that moves."""
    for name, harmonics in motion.harmonics().items():
        listed = not isinstance(getattr(motion, name), Harmonic)
        for i, h in enumerate(harmonics):
            if h.amplitude:
                yield dotted((*here, name, i) if listed else (*here, name)), name, h
    drift = motion.vessel.drift if motion.vessel is not None else None
    for name, harmonics in drift.harmonics().items() if drift is not None else ():
        yield from ((dotted((*here, "vessel", "drift", name)), name, h) for h in harmonics if h.amplitude)


def _all_periods(ends: Ends, environment: Environment | None) -> dict[str, float]:
    """Every period, s, that a scene names, by the key that names it."""
    waves = environment.waves if environment is not None else None
    periods = {} if waves is None else {"environment.fluid.waves": waves.main_period}
    return periods | {key: h.period for here, _, motion in _motions(ends) for key, _, h in _periods(here, motion)}


def moved_in(ends: Ends | None, obstacles: Obstacles | None = None) -> list[tuple[End | Held, Motion]]:
    """The ends and obstacles that are moved, with their motions."""
    return [(x, motion) for _, x, motion in [*(_motions(ends) if ends else ()), *_obstacles(obstacles)]]


def lasting_period(moved: Iterable[tuple[End | Held, Motion]], environment: Environment | None) -> float:
    """The shortest period of waves, and of motions with what they move, s; infinity if there is none."""
    waves = environment.waves if environment is not None else None
    times = [] if waves is None else [waves.main_period]
    for end, motion in moved:
        times += [h.period for _, _, h in _periods((), motion)]
        if motion.file is not None:
            times.append(shortest_in(motion_record(motion, end.held_position, end.held_tangent is not None)))
    return min(times, default=math.inf)


def shortest_period(ends: Ends, environment: Environment | None, obstacles: Obstacles | None = None) -> float:
    """The shortest period, ramp or move of a scene, s; infinity if it names none."""
    moved = moved_in(ends, obstacles)
    times = [lasting_period(moved, environment)]
    for _, motion in moved:
        times += [t for t in (motion.ramp, motion.travel.over if motion.travel else None) if t]
    times += [over for begin, over in _winch_ramps(ends)]
    for spin in (getattr(x, "spin", None) for x in (obstacles or {}).values()):
        if spin is not None:
            times += [spin.ramp, TURNS_AS_PERIOD * LARGEST_TURN / max(abs(spin.rate), 1e-300)]
    return min(times, default=math.inf)


def _winch_ramps(ends: Ends) -> Iterator[tuple[float, float]]:
    """Begin and length, s, of the ramps of rates at which line is paid out, and of tensions that winches hold."""
    for payout in (getattr(end, "payout", None) for end in ends.both):
        if payout is not None and payout.ramp is not None:
            yield from ((t, payout.ramp) for t in (payout.begin, payout.until) if t is not None)
        if payout is not None and payout.winch is not None:
            yield payout.winch.begin, payout.winch.ramp


def longest_period(scene: Moving) -> float:
    """The longest period, s, of waves and of motions of the ends; 0 where none is named."""
    return max(_all_periods(scene.ends, scene.environment).values(), default=0.0)


def stationary_from(scene: Moving) -> tuple[float, float] | None:
    """From when on (s) all that moves or loads a line is periodic or a stationary sea, and the longest period (s).

    None: it is not, or cannot be known: of a file, a velocity, line that is paid out, an end that is let go.
    """
    ends, environment = scene.ends, scene.environment
    periods = _all_periods(ends, environment)
    changes = [getattr(end, "payout", None) or end.release for end in ends.both]
    if not periods or any(changes) or ends.named_files() or any(m.velocity for _, _, m in _motions(ends)):
        return None
    return max(ramp_ends(scene), default=0.0), max(periods.values())


def prescribed_twist(ends: Ends) -> float:
    """The most (rad) by which both ends together can twist a rod, turns and motions added; 0 where one turns freely."""
    if not all(end.holds_twist for end in ends.both):
        return 0.0
    twist = 2.0 * math.pi * abs(ends.turns)
    for _, _, motion in _motions(ends):
        harmonics = [h for name, given in motion.harmonics().items() if name not in SHIFTS for h in given]
        twist += math.radians(sum(abs(h.amplitude) for h in harmonics))
        if motion.file is not None:
            rotation = read_record(motion.file).rotation
            if rotation is not None:
                twist += math.radians(float(abs(rotation).max()) * math.sqrt(3.0))
    return twist


def ramp_ends(scene: Moving) -> list[float]:
    """Times, s, at which something stops growing or moving, or a load turns: a step should end there."""
    fluid, ends = scene.environment.fluid, scene.ends
    moves = [m.travel for _, _, m in _motions(ends) if m.travel is not None]
    times = [m.ramp for _, _, m in _motions(ends)] + [t for m in moves for t in (m.begin, m.begin + m.over)]
    times += [getattr(x, "ramp", None) for x in ((fluid.current, fluid.waves) if fluid is not None else ())]
    times += [load.ramp for end in ends.both for load in end.loads]
    times += [t for begin, over in _winch_ramps(ends) for t in (begin, begin + over)]
    times += [row[0] for end in ends.both for load in end.loads for row in load.rows if row[0] > 0.0]
    return [t for t in times if t]


def _unresolved(
    here: Place, motion: Motion, record: Record | None, environment: Environment | None, step: float
) -> Iterator[Finding]:
    """Ramps, moves and records that a fixed time step cannot follow."""
    harmonics = list(_periods(here, motion))
    shortest, steps = RAMP_STEPS * step * (1 - 1e-9), f"{RAMP_STEPS} time steps of {step:g} s"
    if motion.ramp is not None and motion.ramp < shortest:
        slow = max((h.period for _, _, h in harmonics), default=None)
        fix = f"ramp: {2 * slow:.3g}, two periods" if slow else "a longer ramp, or a smaller time.step"
        yield Finding((*here, "ramp"), f"a ramp of at least {steps}, or it is a jump", fix, f"{motion.ramp:g}")
    if motion.travel is not None and motion.travel.over < shortest:
        fix = "a longer time, or a smaller time.step"
        at, over = (*here, "travel", "over"), motion.travel.over
        yield Finding(at, f"a move over at least {steps}, or it is a jump", fix, f"{over:g}")
    waves = environment.waves if environment is not None else None
    if motion.follow is not None and waves is not None and waves.ramp is not None and waves.ramp < shortest:
        expected = f"a ramp of at least {steps}, because {dotted(here)} follows the waves"
        fix = f"ramp: {2 * waves.main_period:.3g}, two periods"
        yield Finding(("environment", "fluid", "waves", "ramp"), expected, fix, f"{waves.ramp:g}")
    if record is not None:
        missed = missed_between(record, step)
        if missed is not None:
            where = dotted((*here, "file"))
            expected = f"steps so short that {where} is nearly straight within each; it turns at t = {missed:g} s"
            yield Finding(("time", "step"), expected, "a smaller step, or a smoother record", f"{step:g}")


def _fastest_period(ends: Ends, environment: Environment | None, step: float) -> Iterator[Finding]:
    periods = _all_periods(ends, environment)
    fastest = min(periods, key=lambda name: periods[name], default="")
    if fastest and periods[fastest] < SAMPLES * step * (1 - 1e-9):
        period = periods[fastest]
        expected = f"at most a sixth of the shortest period, {_rounded_down(period / SAMPLES)} s, of {fastest}"
        yield Finding(("time", "step"), expected, f"time.step: {period / 20:.3g}, or less", f"{step:g}")


def _rounded_down(x: float) -> str:
    """Three digits of a positive number that do not exceed it, for bounds that are to be copied."""
    x = max(x, 1e-300)  # below, the last of three digits underflows
    unit = 10.0 ** (math.floor(math.log10(x)) - 2)
    return f"{math.floor(x / unit * (1 + 1e-9)) * unit:.3g}"


def _rounded_up(x: float) -> str:
    """Two digits of a positive number that are no less than it."""
    unit = 10.0 ** (math.floor(math.log10(x)) - 1)
    return f"{math.ceil(x / unit * (1 - 1e-9)) * unit:.2g}"


# Whether histories of forces and moments at ends can be read, and are resolved by the time step.


def load_findings(ends: Ends, step: float | None, until: float = math.inf) -> Iterator[Finding]:
    """What is wrong with the histories of loads; step: s, if steps are fixed."""
    for name, end in ends.named().items():
        for load in end.loads:
            file = load.load.file
            for found in () if file is None else chain(*unreadable(file, partial(read_history, file))):
                yield Finding(("ends", name, *load.key[:-1], *found.at), found.expected, found.fix, found.given)
            if step is not None and load.rows:
                t = _missed(load.rows, step, until)
                if t is not None:
                    where = dotted(("ends", name, *load.key))
                    expected = f"steps so short that {where} is nearly straight within each; it turns at t = {t:g} s"
                    yield Finding(("time", "step"), expected, "a smaller step, or a smoother history", f"{step:g}")


def _missed(rows: Sequence[Row], step: float, until: float) -> float | None:
    """Time of a row that departs from a line between two steps by a large part of the range of the history."""
    table = np.array(rows)
    times, values = table[:, 0], table[:, 1:]
    reach = float(np.ptp(values, axis=0).max())
    begin = np.floor(times / step) * step

    def interpolated(t: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(t, times, column) for column in values.T], axis=1)

    part = ((times - begin) / step)[:, None]
    bow = np.abs(values - (1.0 - part) * interpolated(begin) - part * interpolated(begin + step)).max(axis=1)
    bow[(times < 0.0) | (times > until)] = 0.0
    return float(times[bow.argmax()]) if bow.max() > MISSED * reach else None


# Numbers that no line, sea or seabed has: refused when the scene is read.
#
# What is possible and more likely in another unit is noted in the result instead (`model/plausibility.py`).

# No solid has a coefficient of friction of 10; a chain in gravel reaches 1.
ROUGHEST = 10.0
# N; what is beyond the 1e8 that the strongest moorings bear is noted (model/plausibility.py), and far above it refused:
# scenes in units of their own are none of its matter.
LARGEST_FORCE = 1e13
# Times at which a motion near the seabed is looked at: to a period, and in all.
TO_A_PERIOD, MOST_TIMES = 24, 4000


def friction(environment: Environment) -> Iterator[Finding]:
    """A coefficient of friction of the seabed that no ground has."""
    given = environment.seabed.friction if environment.seabed is not None else None
    for key in ("axial", "lateral") if given is not None else ():
        value = getattr(given, key)
        if value > ROUGHEST:
            fix = f"a coefficient, not percent: {value / 100.0:g}" if value <= 200.0 else "a coefficient, such as 0.5"
            place = ("environment", "seabed", "friction", key)
            yield Finding(place, f"0 to {ROUGHEST:g}: sand has 0.3 to 0.6, chain in gravel up to 1", fix, f"{value:g}")
            return


def end_forces(ends: Ends) -> Iterator[Finding]:
    """A force at an end that would tear any line."""
    for name, end in ends.named().items():
        for load in end.loads:
            force = max(math.hypot(*value) for value in load.values)
            if load.what == "force" and force > LARGEST_FORCE:
                expected = f"less than {LARGEST_FORCE:g} N, a hundred thousand times what the strongest moorings bear"
                yield Finding(
                    ("ends", name, *load.key), expected, "check the number; forces are in N", f"{force:.4g} N"
                )


# --- ends that are moved into the seabed ---------------------------------------------------------


def moved_into_the_ground(
    end: End, motion: Motion, record: Record | None, time: Time | None, environment: Environment | None, length: float
) -> Iterator[Finding]:
    """A motion that takes an end under the seabed; nothing is said of vessels in waves.

    record: of motion.file; length: of the cable, m.
    """
    bed, place = environment.seabed if environment is not None else None, end.held_position
    sails = motion.vessel is not None and motion.file is None
    if bed is None or environment is None or place is None or time is None or sails or motion.follow is not None:
        return
    sunk = deepest_place(environment, bed, length)
    if place[2] - bed.height(*place[:2]) < -sunk or not _may_reach(place, motion, record, time, bed.is_level, bed.z):
        return  # complained of already, or far above it
    moving = EndMotion(motion, place)
    deepest, when, there = 0.0, 0.0, place
    for t in _times(motion, record, time):
        x, y, z = moving.at_time(t)[0].tolist()
        under = bed.height(x, y) - z
        if under > max(sunk, deepest):
            deepest, when, there = under, t, (x, y, z)
    if deepest > 0.0:
        given = f"a motion that takes the end {deepest:.4g} m under the seabed at t = {when:.4g} s"
        expected = f"an end that stays on the seabed or above, z >= {bed.height(*there[:2]):.6g} m"
        yield Finding(
            (), expected, "is it the motion of the other end? give it to that, or exchange start and end", given
        )


def _may_reach(place: Triple, motion: Motion, record: Record | None, time: Time, level: bool, bed: float) -> bool:
    """Whether a motion may lead down to a bed at all: amplitudes and ways added."""
    if not level or (record is not None and record.shift is not None):
        return True
    down = sum(abs(h.amplitude) for h in motion.harmonics().get("heave", ()))
    down += abs(motion.travel.by[2]) if motion.travel is not None else 0.0
    down += abs(motion.velocity[2]) * time.duration if motion.velocity else 0.0
    return place[2] - down < bed


def _times(motion: Motion, record: Record | None, time: Time) -> list[float]:
    """Times (s) of a run at which a motion is looked at."""
    if record is not None:
        every = max(1, len(record.times) // MOST_TIMES)
        return [t for t in record.times[::every].tolist() if t <= time.duration]
    periods = [h.period for listed in motion.harmonics().values() for h in listed if h.amplitude]
    count = min(MOST_TIMES, 50 + int(TO_A_PERIOD * time.duration / min(periods, default=time.duration)))
    return [time.duration * k / count for k in range(1, count + 1)]
