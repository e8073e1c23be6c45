"""How a scene says that ends, points and bodies move and are loaded.

Forces and moments are constant, or a history that is linear between its rows.  Motions are harmonics, travel, of a
vessel, or of a file.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag

from hybrid.scene.base import (
    Before,
    Finding,
    Findings,
    NonNegative,
    Number,
    Positive,
    Table,
    Text,
    Vector,
    Words,
    numbers,
    table_or_list,
    value_or_table,
)
from hybrid.scene.motion_file import RecordRefused, read_history

Triple = tuple[float, float, float]
Row = tuple[float, float, float, float]  # s, N or N m (3)

LoadRow = Annotated[tuple[Number, Number, Number, Number], Before(numbers(4)), Words("four numbers [t, x, y, z]")]


class Load(Table):
    """A force or moment at an end, inertial frame: one value, or a history; until a time or for good."""

    value: Vector | None = Field(default=None, description="the force or the moment, inertial frame [N or N m]")
    history: tuple[LoadRow, ...] | None = Field(
        default=None,
        min_length=2,
        description="rows [t, x, y, z], linear between them; the first value holds before, the last one after "
        "[s, N or N m]",
    )
    file: Text | None = Field(
        default=None,
        min_length=1,
        description="CSV file with columns t,x,y,z as of `history` (s, N or N m); relative to the scene file",
    )
    until: Positive | None = Field(default=None, description="time at which it is let go; absent: never [s]")
    ramp: NonNegative | None = Field(
        default=None,
        description="time over which it grows from nothing; absent: at once, or with a tangent that is turned in [s]",
    )

    def _check_one_source(self) -> Findings:
        given = [name for name in ("value", "history", "file") if getattr(self, name) is not None]
        if not given:
            fix = "value: [x, y, z] for a constant load, history: [[t, x, y, z], ...] or file for one that changes"
            yield [Finding((), "value, history or file", fix)]
        fix = f"keep {given[0]}, or leave it out"
        yield (Finding((name,), f"nothing, because {given[0]} already gives the load", fix) for name in given[1:])
        for k, (one, other) in enumerate(pairwise(self.history or ()), start=1):
            if not other[0] > one[0]:
                expected = f"a time after that of the row before, {one[0]:g} s"
                fix = "sort the rows; for a sudden change give two rows a time step apart"
                yield [Finding(("history", k, 0), expected, fix)]


Loading = Annotated[
    Annotated[Vector, Tag("<value>")] | Annotated[Load, Tag("<table>")],
    Discriminator(value_or_table),
]


@dataclass(frozen=True)
class GivenLoad:
    """A force [N] or moment [N m] that a scene gives at an end, inertial frame.

    key: its place below the end; load: as the scene has it.
    """

    what: Literal["force", "moment"]
    key: tuple[str, ...]
    load: Load

    @property
    def until(self) -> float | None:
        """Time at which it stops [s]; None: never."""
        return self.load.until

    @property
    def ramp(self) -> float | None:
        """Time over which it grows [s]; None: at once, or with a tangent that is turned in."""
        return self.load.ramp

    @property
    def rows(self) -> tuple[Row, ...]:
        """The rows (t, x, y, z) of a history; none of a constant load, or of a file that cannot be read."""
        if self.load.file is None:
            return self.load.history or ()
        try:
            return read_history(self.load.file)
        except RecordRefused:
            return ()  # motion_checks reports it

    @property
    def values(self) -> tuple[Triple, ...]:
        """All values that are given."""
        return tuple(row[1:] for row in self.rows) or (self.load.value or (0.0, 0.0, 0.0),)

    @property
    def value(self) -> Triple:
        """The load at t = 0, when it has grown."""
        return self.at_time(0.0)

    def at_time(self, t: float) -> Triple:
        """The load at t [s], when it has grown and before it is let go."""
        rows = self.rows
        if not rows:
            return self.load.value or (0.0, 0.0, 0.0)
        k = bisect_right(rows, t, key=lambda row: row[0])
        if k in (0, len(rows)):
            return rows[min(k, len(rows) - 1)][1:]
        (t0, *a), (t1, *b) = rows[k - 1], rows[k]
        x, y, z = (p + (q - p) * (t - t0) / (t1 - t0) for p, q in zip(a, b, strict=True))
        return x, y, z


SHIFTS = ("surge", "sway", "heave")
TURNS = ("roll", "pitch", "yaw")


def smooth_step(x: float) -> tuple[float, float]:
    """10 x^3 - 15 x^4 + 6 x^5 from 0 to 1 and its derivative, C2 at both ends; constant before and after."""
    x = min(max(x, 0.0), 1.0)
    return x * x * x * (10.0 + x * (6.0 * x - 15.0)), 30.0 * x * x * (1.0 - x) ** 2


def way_of_smooth_step(x: float) -> float:
    """The integral of `smooth_step` from 0 to x: 5/2 x^4 - 3 x^5 + x^6, beyond 1 growing like x - 1/2."""
    inside = min(max(x, 0.0), 1.0)
    return inside**4 * (2.5 + inside * (inside - 3.0)) + max(x - 1.0, 0.0)


def _sum(parts: list[tuple[Triple, float]]) -> Triple:
    """The sum of vectors times factors."""
    return (sum(f * v[0] for v, f in parts), sum(f * v[1] for v, f in parts), sum(f * v[2] for v, f in parts))


class Harmonic(Table):
    """amplitude x sin(2 pi t / period + phase)."""

    amplitude: Number = Field(description="amplitude; degrees for roll, pitch and yaw [m or deg]")
    period: Positive = Field(description="period, one over the frequency, 2 pi over omega [s]")
    phase: Number = Field(default=0.0, description="phase [deg]")


Harmonics = Annotated[
    Annotated[Harmonic, Tag("<table>")] | Annotated[tuple[Harmonic, ...], Field(min_length=1), Tag("<list>")],
    Discriminator(table_or_list),
]


class Travel(Table):
    """A smooth move to another place: by x (10 x^3 - 15 x^4 + 6 x^5), x = (t - begin) / over."""

    by: Vector = Field(description="the way from the old place to the new one, inertial frame [m]")
    over: Positive = Field(description="time that it takes [s]")
    begin: NonNegative = Field(default=0.0, description="time at which it begins [s]")


class _Harmonics(Table):
    """What has harmonics by the names of degrees of freedom."""

    def harmonics(self) -> dict[str, tuple[Harmonic, ...]]:
        """Those that are given, by name; one that is no list is a tuple of one."""
        named = {name: getattr(self, name) for name in (*SHIFTS, *TURNS)}
        return {n: (x,) if isinstance(x, Harmonic) else x for n, x in named.items() if x is not None}


class Drift(_Harmonics):
    """Slow motion of a vessel about where it stands, in its axes, each a harmonic or a list whose sum is meant.

    To first order, as the RAO; it grows with the ramp of the waves.
    """

    surge: Harmonics | None = Field(default=None, description="along the bow")
    sway: Harmonics | None = Field(default=None, description="to port")
    heave: Harmonics | None = Field(default=None, description="up")
    roll: Harmonics | None = Field(default=None, description="about the axis to the bow, which carries port up")
    pitch: Harmonics | None = Field(default=None, description="about the axis to port, which carries the bow down")
    yaw: Harmonics | None = Field(default=None, description="about the axis up, which carries the bow to port")


class Vessel(Table):
    """A vessel that carries the end: it moves with the waves of the scene, to first order; it grows with their ramp."""

    rao: Text | None = Field(
        default=None,
        min_length=1,
        description="CSV file, relative to the scene file: columns frequency [rad/s] and heading [deg], the "
        "direction of the waves against that of the vessel (0: from astern, 180: from ahead), surge, sway, heave "
        "(m/m), roll, pitch, yaw (deg/m), and surge_phase .. (deg behind the crest at the origin); or a dataset "
        "of Capytaine in netCDF (.nc) with its RAO, or with what it follows from; a wave of finite height moves it by "
        "its first harmonic; absent: "
        "the motion of the vessel is in `file` beside this table",
    )
    origin: Vector = Field(
        description="point of the vessel that the RAO is for, where it stands at its mean offset, inertial frame [m]"
    )
    heading: Number = Field(
        default=0.0,
        description="direction of its bow at its mean offset, counter-clockwise from the inertial x axis [deg]",
    )
    drift: Drift | None = Field(default=None, description="its slow motion beside that of the RAO; absent: none")
    fairlead: Vector | None = Field(
        default=None,
        description="the end in axes of the vessel from its origin (to the bow, to port, up); absent: it follows from "
        "the position of the end, with which it must agree [m]",
    )

    def place(self, fairlead: Triple) -> Triple:
        """Where a point given in axes of the vessel is, at rest, inertial frame [m]."""
        c, s = math.cos(math.radians(self.heading)), math.sin(math.radians(self.heading))
        x, y, z = fairlead
        return self.origin[0] + c * x - s * y, self.origin[1] + s * x + c * y, self.origin[2] + z


class Motion(_Harmonics):
    """Prescribed motion of an end, relative to where it is held; it must start from rest, or have a `ramp`.

    What is given adds up; only a file stands alone.
    """

    surge: Harmonics | None = Field(default=None, description="harmonic motion along x, or a list whose sum is meant")
    sway: Harmonics | None = Field(default=None, description="harmonic motion along y, or a list")
    heave: Harmonics | None = Field(default=None, description="harmonic motion along z, or a list")
    roll: Harmonics | None = Field(default=None, description="harmonic rotation about the inertial x axis, or a list")
    pitch: Harmonics | None = Field(default=None, description="harmonic rotation about the inertial y axis, or a list")
    yaw: Harmonics | None = Field(default=None, description="harmonic rotation about the inertial z axis, or a list")
    velocity: Vector | None = Field(
        default=None,
        description="steady travel (tow) at this velocity or speed, reached over `ramp`; inertial frame [m/s]",
    )
    travel: Travel | None = Field(default=None, description="a smooth move to another place")
    follow: Literal["waves"] | None = Field(
        default=None, description="waves: rises and falls with the surface where the end is; needs waves with a ramp"
    )
    vessel: Vessel | None = Field(default=None, description="a vessel that carries the end in the waves of the scene")
    ramp: Positive | None = Field(
        default=None, description="time over which harmonic motion, velocity and a file grow from zero, smoothly [s]"
    )
    file: Text | None = Field(
        default=None,
        min_length=1,
        description="CSV file with columns t,x,y,z and/or t,rx,ry,rz (rotation vector) or t,roll,pitch,yaw (s, m, "
        "degrees) in any order; relative to the scene file; it starts at rest where the end is, or `ramp` blends it "
        "in; with `vessel` it is of the vessel: place of its origin and its attitude, inertial",
    )

    def shifts(self) -> list[str]:
        """The keys given that move the end; those of TURNS turn it, and a file may do both."""
        named = (*SHIFTS, "velocity", "travel", "follow", "vessel")
        return [name for name in named if getattr(self, name) is not None]

    def grown(self, t: float) -> float:
        """The part of its harmonic motion that has grown at t [s]."""
        return smooth_step(t / self.ramp)[0] if self.ramp else 1.0

    def carried(self, t: float) -> tuple[Triple, Triple]:
        """How far velocity and travel have carried the end at t [s], and how fast they do: m and m/s, inertial."""
        ways: list[tuple[Triple, float, float]] = []  # along which vector, how much of it, how fast
        if self.velocity is not None and self.ramp is not None:
            x = t / self.ramp
            ways.append((self.velocity, self.ramp * way_of_smooth_step(x), smooth_step(x)[0]))
        if self.travel is not None:
            grown, rate = smooth_step((t - self.travel.begin) / self.travel.over)
            ways.append((self.travel.by, grown, rate / self.travel.over))
        return _sum([(v, far) for v, far, _ in ways]), _sum([(v, fast) for v, _, fast in ways])

    def _check_one_source(self) -> Findings:
        given = [*self.shifts(), *(name for name in TURNS if getattr(self, name) is not None)]
        ramped = [name for name in given if name not in ("travel", "follow", "vessel")]
        if self.vessel is not None and self.file is not None:
            extra: list[tuple[str, ...]] = [
                ("vessel", name) for name in ("rao", "drift") if getattr(self.vessel, name) is not None
            ]
            extra += [(name,) for name in given if name != "vessel"]
            fix = "put the whole motion of the vessel into the file, or leave file out"
            yield (Finding(x, "nothing, because file gives the motion of the vessel", fix) for x in extra)
            return
        if self.vessel is not None and self.vessel.rao is None:
            fix = "give rao, or `file` beside vessel with t,x,y,z,roll,pitch,yaw"
            yield [Finding(("vessel", "rao"), "a CSV file or a dataset of Capytaine", fix)]
        if self.vessel is not None:
            fix = "leave it out, or write all of the motion into a file; travel may move the vessel"
            beside = [name for name in given if name not in ("vessel", "travel")]
            yield (Finding((name,), "nothing, because vessel already gives the motion", fix) for name in beside)
        if self.file is not None:
            fix = "put the whole motion into the file, or leave file out"
            yield (Finding((name,), "nothing, because file already gives the motion", fix) for name in given)
        elif not given:
            expected = f"at least one of {', '.join((*SHIFTS, *TURNS))}, velocity, travel, follow, vessel, or file"
            yield [Finding((), expected, "say how the end moves, or leave motion out")]
        elif self.ramp is not None and not ramped:
            expected = "nothing, because a ramp is for velocity and for harmonic motion"
            fix = "leave it out: travel has `over`, and what follows the waves grows with waves.ramp"
            yield [Finding(("ramp",), expected, fix)]
        if self.velocity is not None and any(self.velocity) and self.ramp is None:
            expected = "a number > 0, in s, because the cable starts at rest and velocity has to grow from zero"
            yield [Finding(("ramp",), expected, "add `ramp: ...` (s), such as 10")]


# Where what is driven is, as far as tables say it (travel, velocity and harmonic motion), and when it is farthest.

# Times at which a distance is looked at, spread by the golden section.  What they miss of the largest distance is some
# 0.5 % of an amplitude: what is found there is true all the same.
PER_PERIOD = 48  # of a period
MOST_TIMES = 4000  # of a run
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)  # golden section: its multiples modulo 1 are spread evenly, whatever their count


def shift(motion: Motion | None, t: float) -> Triple:
    """How far an end has moved at t [s], inertial [m]; what files, vessels and waves do is not known here."""
    if motion is None:
        return 0.0, 0.0, 0.0
    (x, y, z), grown = motion.carried(t)[0], motion.grown(t)
    given = motion.harmonics()
    far = [
        grown * sum(h.amplitude * math.sin(2.0 * math.pi * t / h.period + math.radians(h.phase)) for h in given[name])
        if name in given
        else 0.0
        for name in SHIFTS
    ]
    return x + far[0], y + far[1], z + far[2]


def times_of(motions: Sequence[Motion | None], duration: float) -> list[float]:
    """Times [s] of a run at which what moves so may be farthest from each other, in order."""
    found, shortest = {0.0, duration}, math.inf
    for motion in motions:
        if motion is not None and motion.travel is not None:
            found.add(min(motion.travel.begin + motion.travel.over, duration))
        given = motion.harmonics() if motion is not None else {}
        shortest = min([shortest, *(h.period for name in SHIFTS for h in given.get(name, ()) if h.amplitude)])
    count = min(math.ceil(PER_PERIOD * duration / shortest), MOST_TIMES)
    return sorted(found | {duration * (k * GOLDEN % 1.0) for k in range(1, count)})


def farthest(
    places: tuple[Triple, Triple], motions: tuple[Motion | None, Motion | None], duration: float, within: float = 0.0
) -> tuple[float, float]:
    """The largest distance [m] of two ends that are held at places and driven so, and when [s].

    within: m, a distance of which only what is beyond is of interest: nearer ones are not looked for in time.
    """
    apart = math.dist(*places)
    if apart + sum(most_shift(x, duration) for x in motions) <= within:
        return apart, 0.0
    return max(((_apart(places, motions, t), t) for t in times_of(motions, duration)), key=lambda x: x[0])


def moving_key(motion: Motion) -> str:
    """The key of a motion that moves its end most, of those that are followed here; "" where none does."""
    given = motion.harmonics()
    sizes = {name: sum(abs(h.amplitude) for h in given.get(name, ())) for name in SHIFTS}
    largest = max(sizes, key=lambda name: sizes[name])
    if motion.travel is not None or motion.velocity is not None:
        return "travel" if motion.travel is not None else "velocity"
    return largest if sizes[largest] else ""


def smaller(key: str) -> str:
    """What of a motion, by the key that moves an end most, would keep it nearer."""
    return "a shorter way" if key in ("travel", "velocity") else f"a smaller amplitude of {key}"


def _apart(places: tuple[Triple, Triple], motions: tuple[Motion | None, Motion | None], t: float) -> float:
    (a, b), (u, v) = places, (shift(motion, t) for motion in motions)
    return math.dist((a[0] + u[0], a[1] + u[1], a[2] + u[2]), (b[0] + v[0], b[1] + v[1], b[2] + v[2]))


def most_shift(motion: Motion | None, duration: float) -> float:
    """What a motion moves an end by at most, m."""
    if motion is None:
        return 0.0
    far = sum(abs(h.amplitude) for name, given in motion.harmonics().items() if name in SHIFTS for h in given)
    far += math.hypot(*motion.velocity) * duration if motion.velocity is not None else 0.0
    return far + (math.hypot(*motion.travel.by) if motion.travel is not None else 0.0)
