"""Whether a scene lies in a plane: its ends, loads, motions, sea and start, looked at table by table.

A witness is a vector of the scene with its key.  Some must lie in the plane, some are places in it, and some (end
moments, axes of rotation) must be along its normal.  The plane is that of the vertical, where there is gravity, and of
the first that does not lie in it; what does not fit is a finding.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from hybrid.scene.analysis import Initial, Points, Straight
from hybrid.scene.base import Finding, Place, cross, unit, xyz
from hybrid.scene.cable import Cable, Environment
from hybrid.scene.combinations import PLANE, refused
from hybrid.scene.ends import End, Ends, Triple
from hybrid.scene.motion_file import RecordRefused, read_record
from hybrid.scene.motion_tables import SHIFTS, TURNS, Motion
from hybrid.scene.sea import CurrentPoint, CurrentProfile, PowerLawCurrent, UniformCurrent

# What a scene that insists on a plane may leave it by, as a part of a vector's or the cable's length: the last of the
# digits that people write.  A scene that does not insist is in a plane to round-off or not at all.
TYPED, EXACT = 1e-6, 1e-9
# Of the length: how far a line may be from its plane that is computed in space: beside obstacles, or joined to others.
OUT = 1e-5
# A witness that is this close (a sine) to those before it does not define the plane.
SAYS_NOTHING = 1e-3
UP: Triple = (0.0, 0.0, 1.0)

Kind = Literal["along", "place", "normal"]


@dataclass(frozen=True)
class Witness:
    """A vector of the scene: where it is written, and what it must be to the plane."""

    at: Place
    kind: Kind
    vector: Triple


@dataclass(frozen=True)
class Plane:
    """A plane through a point of the cable: axes p and q, normal p x q; unit vectors, inertial frame."""

    p: Triple
    q: Triple

    @property
    def normal(self) -> Triple:
        return cross(self.p, self.q)

    def text(self) -> str:
        """What it is, for people."""
        if self.q == UP:
            return f"the vertical plane at {math.degrees(math.atan2(self.p[1], self.p[0])) + 0.0:.6g} deg from x"
        n = self.normal
        return f"the plane with normal [{n[0]:.4g}, {n[1]:.4g}, {n[2]:.4g}]"


Witnessed = tuple[Environment, Ends, Initial]  # tables of a line that may say in which plane it is


def plane_of(
    environment: Environment,
    cable: Cable,
    ends: Ends,
    initial: Initial,
    tolerance: float = EXACT,
    beside: Sequence[Witnessed] = (),
) -> tuple[Plane, list[Finding]]:
    """The plane that a scene is in, or would be in but for what the findings say.

    tolerance: by what part of its length a vector may leave the plane; beside: of lines with which it shares a plane.
    """
    witnesses = list(_witnesses(environment, ends, initial))
    all_ = [w for tables in beside for w in _witnesses(*tables)] or witnesses
    places = [w.vector for w in all_ if w.kind == "place"]
    origin = places[0] if places else (0.0, 0.0, 0.0)
    vertical = environment.gravity != 0.0 or (environment.fluid is not None and environment.fluid.surface is not None)
    plane = _choose(all_, origin, vertical)
    return plane, [
        *_leaves(witnesses, plane, origin, cable.length, tolerance),
        *_sections(cable, ends, plane),
        *_twisted(ends, plane),
        *refused({"cable": cable, "ends": ends, "dimension": 2}, beside=PLANE),
    ]


def _choose(witnesses: list[Witness], origin: Triple, vertical: bool) -> Plane:
    """The plane of the first witnesses that say which."""
    normals = [w.vector for w in witnesses if w.kind == "normal"]
    ways = [w.vector if w.kind == "along" else _minus(w.vector, origin) for w in witnesses if w.kind != "normal"]
    ways = [unit(v) for v in ways if math.hypot(*v) > 0.0]
    if vertical:
        ways = [UP, *ways]
    if not ways:
        ways = [(1.0, 0.0, 0.0)]
    first = ways[0]
    sines = [math.hypot(*cross(first, v)) for v in ways]
    telling = [v for v, sine in zip(ways, sines, strict=True) if sine > SAYS_NOTHING]
    if not telling and max(sines) > TYPED:
        telling = [ways[sines.index(max(sines))]]
    if telling:
        second = telling[0]
    elif normals:  # a straight line under an end moment bends about it
        second = cross(normals[0], first)
    else:
        second = (1.0, 0.0, 0.0) if abs(first[0]) < 0.9 else UP
    if not math.hypot(*cross(first, second)) > 0.0:  # a moment along the line: any plane is as wrong as another
        second = (1.0, 0.0, 0.0) if abs(first[0]) < 0.9 else UP
    if vertical:
        level = unit((second[0], second[1], 0.0))
        return Plane(level if max(level, key=abs) > 0.0 else (-level[0], -level[1], 0.0), UP)
    along = sum(a * b for a, b in zip(first, second, strict=True))
    return Plane(first, unit(_minus(second, (along * first[0], along * first[1], along * first[2]))))


def _leaves(
    witnesses: list[Witness], plane: Plane, origin: Triple, length: float, tolerance: float
) -> Iterator[Finding]:
    """Witnesses that do not lie in the plane, or not along its normal."""
    n = plane.normal
    for w in witnesses:
        v = _minus(w.vector, origin) if w.kind == "place" else w.vector
        size = length if w.kind == "place" else math.hypot(*v)
        out = abs(v[0] * n[0] + v[1] * n[1] + v[2] * n[2]) if w.kind != "normal" else math.hypot(*cross(v, n))
        if out > tolerance * size:
            what = "a vector in" if w.kind == "along" else "a place in" if w.kind == "place" else "a vector normal to"
            expected = f"{what} {plane.text()}, which the rest of the scene lies in, because dimension is 2"
            yield Finding(w.at, expected, "write `dimension: 3`, or leave dimension out", xyz(w.vector))


def _sections(cable: Cable, ends: Ends, plane: Plane) -> Iterator[Finding]:
    """Sections whose own axes would take the cable out of the plane."""
    for i, x in enumerate(cable.sections):
        kappa = x.intrinsic_curvature if x.intrinsic_curvature is not None and any(x.intrinsic_curvature) else None
        if not x.anisotropic and kappa is None:
            continue
        key = "bending_stiffness" if kappa is None else "intrinsic_curvature"
        axis = _director(ends.start, plane) or _director(ends.end, plane)
        aligned = axis is not None and min(abs(axis[0]), abs(axis[1])) < TYPED
        if aligned and kappa is not None:
            assert axis is not None
            aligned = kappa[2] == 0.0 and kappa[1 if abs(axis[0]) > 0.5 else 0] == 0.0
        if not aligned:
            expected = (
                "a section that bends within the plane, because dimension is 2: one of its axes along the plane's "
                "normal, by `normal` of an end, and its own curvature about that axis alone"
            )
            yield Finding(("cable", "sections", i, key), expected, "write `dimension: 3`, or leave dimension out")


def _twisted(ends: Ends, plane: Plane) -> Iterator[Finding]:
    """Two ends that hold the cable twisted."""
    start, end = _director(ends.start, plane), _director(ends.end, plane)
    if start is not None and end is not None and math.dist(start, end) > TYPED:
        expected = "the material axis as at ends.start, carried along, because dimension is 2 and there is no torsion"
        yield Finding(("ends", "end", "normal"), expected, "leave it out, or write `dimension: 3`")


def _director(end: End, plane: Plane) -> tuple[float, float] | None:
    """Components of the axis a1 of an end along the normal and along (normal x tangent); None: it gives none."""
    if end.held_tangent is None or end.held_normal is None:
        return None
    t = unit(end.held_tangent)
    along = sum(a * b for a, b in zip(end.held_normal, t, strict=True))
    a = unit(_minus(end.held_normal, (along * t[0], along * t[1], along * t[2])))
    n = plane.normal
    m = cross(n, t)
    return sum(x * y for x, y in zip(a, n, strict=True)), sum(x * y for x, y in zip(a, m, strict=True))


def _witnesses(environment: Environment, ends: Ends, initial: Initial) -> Iterator[Witness]:
    """Everything in a scene that has a direction, the most telling first."""
    for name, end in ends.named().items():
        if end.first_position is not None:
            key = "position" if end.held_position is not None else "initial_guess"
            yield Witness(("ends", name, key), "place", end.first_position)
        if end.held_tangent is not None:
            yield Witness(("ends", name, "tangent"), "along", end.held_tangent)
    if isinstance(initial, Straight):
        if initial.origin is not None:
            yield Witness(("initial", "origin"), "place", initial.origin)
        yield Witness(("initial", "direction"), "along", initial.direction)
        if initial.velocity is not None and any(initial.velocity):
            yield Witness(("initial", "velocity"), "along", initial.velocity)
    elif isinstance(initial, Points) or initial.points is not None:
        for i, point in enumerate(initial.points or ()):
            yield Witness(("initial", "points", i), "place", point)
    elif initial.direction is not None:
        yield Witness(("initial", "direction"), "along", initial.direction)
    for name, end in ends.named().items():
        for load in end.loads:
            for value in load.values:
                if any(value):
                    yield Witness(("ends", name, *load.key), "normal" if load.what == "moment" else "along", value)
        if end.prescribed_motion is not None:
            yield from _moved(end.prescribed_motion, ("ends", name, "motion"))
    yield from _sea(environment)


def _moved(motion: Motion, here: Place) -> Iterator[Witness]:
    """Directions in which an end moves, and axes about which it turns."""
    together: dict[tuple[float, float], list[tuple[str, float]]] = {}  # shifts of one period and phase are one way
    for name, parts in motion.harmonics().items():
        for h in (h for h in parts if h.amplitude != 0.0):
            if name in SHIFTS:
                half, phase = divmod(h.phase, 180.0)
                together.setdefault((h.period, phase), []).append((name, h.amplitude * (1.0 - 2.0 * (half % 2.0))))
            else:
                k = TURNS.index(name)
                yield Witness((*here, name), "normal", (float(k == 0), float(k == 1), float(k == 2)))
    for ways in together.values():
        x, y, z = (sum(amplitude for name, amplitude in ways if name == key) for key in SHIFTS)
        if x or y or z:
            yield Witness((*here, ways[-1][0]), "along", (x, y, z))
    if motion.velocity is not None and any(motion.velocity):
        yield Witness((*here, "velocity"), "along", motion.velocity)
    if motion.travel is not None and any(motion.travel.by):
        yield Witness((*here, "travel", "by"), "along", motion.travel.by)
    if motion.follow is not None:
        yield Witness((*here, "follow"), "along", UP)
    if motion.vessel is not None:  # it may move and turn about any axis
        for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), UP):
            yield Witness((*here, "vessel"), "along", axis)
        return
    if motion.file is not None:
        try:
            record = read_record(motion.file)
        except RecordRefused:
            return  # the check of its source reports it
        for rows, kind in ((record.shift, "along"), (record.rotation, "normal")):
            if rows is not None:
                if motion.ramp is not None:  # it may start anywhere
                    kind = "place" if kind == "along" else kind
                for row in (rows - rows[0] if motion.ramp is None else rows).tolist():
                    if any(row) or kind == "place":
                        yield Witness((*here, "file"), kind, (row[0], row[1], row[2]))  # type: ignore[arg-type]


def _sea(environment: Environment) -> Iterator[Witness]:
    """Directions of current, waves and seabed."""
    fluid, bed = environment.fluid, environment.seabed
    if bed is not None:
        if bed.depths is not None:  # its slopes lie in no plane
            for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)):
                yield Witness(("environment", "seabed", "depths"), "along", axis)
        rise_x, rise_y = bed.slope or (0.0, 0.0)
        yield Witness(("environment", "seabed", "slope"), "along", (-rise_x, -rise_y, 1.0))
    if fluid is None:
        return
    here: Place = ("environment", "fluid", "current")
    current = fluid.current
    if isinstance(current, UniformCurrent | PowerLawCurrent):
        if any(current.flow):
            yield Witness((*here, _flow_key(current)), "along", current.flow)
        if isinstance(current, PowerLawCurrent) and current.veer != 0.0 and any(current.flow[:2]):
            x, y, _ = current.flow
            yield Witness((*here, "veer"), "along", (-y, x, 0.0))
    elif current is not None:
        profile = isinstance(current, CurrentProfile)
        table = current.table if isinstance(current, CurrentProfile) else current
        points = [p for p in table if isinstance(p, CurrentPoint)]
        for i, point in enumerate(points):
            if any(point.flow):
                where: Place = (*here, *(("table",) if profile else ()), i, _flow_key(point))
                yield Witness(where, "along", point.flow)
        if not points and any(table):
            x, y, z = (float(v) for v in table if not isinstance(v, CurrentPoint))
            yield Witness(here, "along", (x, y, z))
    if fluid.waves is not None:
        for key, heading in fluid.waves.headings():
            towards = math.radians(heading)
            level = (round(math.cos(towards), 15), round(math.sin(towards), 15), 0.0)
            yield Witness(("environment", "fluid", "waves", *key), "along", level)


def _flow_key(flow: UniformCurrent | PowerLawCurrent | CurrentPoint) -> str:
    """The key that says where the water flows."""
    return "velocity" if flow.velocity is not None else "direction" if flow.direction is not None else "speed"


def _minus(a: Triple, b: Triple) -> Triple:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])
