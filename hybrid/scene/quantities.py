"""Quantities that a scene asks for by name: forces and angles at the ends, touchdown, layback, clearance."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Annotated, Any, Literal

from pydantic import Field

from hybrid.scene.base import (
    Direction,
    Finding,
    Findings,
    NonNegative,
    NonNegativePair,
    Number,
    Pair,
    Place,
    Table,
    Text,
    Vector,
    nearest,
)

AZIMUTH = "direction of the pull at the {end} in plan, from the x axis towards y, within half a turn of the first"
EXCURSION = "horizontal distance of the touchdown point on the side of the {end} from its reference; NaN: no contact"
OF_CLEARANCE = ("point", "normal", "path", "other", "diameter", "range")
# Kinds: unit, what it is, which keys it needs, which it may have beside `line`, `smallest` and `largest`.
KINDS: dict[str, tuple[str, str, tuple[str, ...], tuple[str, ...]]] = {
    "horizontal_force": ("N", "horizontal part of the pull of the line at its {end}", ("end",), ()),
    "vertical_force": ("N", "upward part of the pull of the line at its {end}", ("end",), ()),
    "force_along": ("N", "part of the pull of the line at its {end} along a direction", ("end", "direction"), ()),
    "declination": ("deg", "angle of the pull at the {end} to straight up (down: 180)", ("end",), ()),
    "azimuth": ("deg", AZIMUTH, ("end",), ()),
    "end_angle": ("deg", "angle of the pull at the {end} to a direction (hang-off angle)", ("end", "direction"), ()),
    "uplift": ("N", "force that lifts what holds the {end} off the seabed, along its normal", ("end",), ()),
    "uplift_angle": ("deg", "angle of the pull at the {end} to the seabed; 0 where it does not lift", ("end",), ()),
    "touchdown": ("m", "arc length of the touchdown point on the side of the {end}; NaN: none", ("end",), ()),
    "touchdown_excursion": ("m", EXCURSION, ("end",), ("reference",)),
    "layback": ("m", "horizontal distance from the {end} to {to}", ("end",), ("to",)),
    "clearance": ("m", "least distance of the surface of the line to {what}", (), OF_CLEARANCE),
}
# Names that results have already, as quantities, groups or coordinates; those of probes, too.
TAKEN: tuple[str, ...] = (
    "t",
    "s",
    "xyz",
    "edge",
    "gauge",
    "case",
    "position",
    "velocity",
    "tension",
    "theta",
    "phi",
    "curvature",
)
TAKEN += ("twist", "bending_moment", "moment", "torque", "shear", "reaction_start", "reaction_end", "moment_start")
TAKEN += ("moment_end", "end_force_start", "end_force_end", "contact", "self_contact", "contact_force")
TAKEN += ("grounded_length", "touchdown", "touchdown_position", "wall_tension", "von_mises", "max_stress")
TAKEN += ("elevation", "elevation_at", "history", "seabed", "seabed_x", "seabed_y", "seabed_height", "seabed_ends")
TAKEN += ("surface", "attached", "min_bend_radius", "max_tension", "min_tension", "bending_stiffness", "diameter")
TAKEN += ("turns", "payout", "energy", "work", "errors", "criteria", "steps", "right", "mesh", "envelope", "limits")
TAKEN += ("zones", "events", "points", "bodies", "lines", "times", "checkpoint", "scene", "template", "word")
TAKEN += ("plane", "bounds", "ends", "self_distance", "extremes", "stress_per_tension", "stress_per_curvature")
TAKEN += ("changes", "contacts", "obstacles", "shape", "max_contact_force")
TAKEN += ("capacity_used", "capacity", "corner", "capacity_row", "code_used", "code", "code_row", "code_number")
HALF_TURN = 180.0  # deg
# The field with the arc length at which a clearance is least: its name after that of the clearance.
WHERE = "_at"
# Of what lies on a seabed.
ON_BED = ("uplift", "uplift_angle", "touchdown", "touchdown_excursion")


class Quantity(Table):
    """A quantity over time, recorded at every output under the name that it has here."""

    kind: Literal[tuple(KINDS)] = Field(description="what is recorded: " + ", ".join(KINDS))  # type: ignore[valid-type]
    line: Text | None = Field(default=None, min_length=1, description="which line, by its name; absent: the only one")
    end: Literal["start", "end"] | None = Field(
        default=None, description="at which end, of all kinds but clearance: s = 0 or s = length"
    )
    direction: Direction | None = Field(
        default=None,
        description="of force_along and end_angle: direction [x, y, z], inertial; any length [-]",
    )
    to: Literal["touchdown", "end"] | None = Field(
        default=None,
        description="of layback: to the touchdown point on the side of `end`, or to the other end; absent: touchdown "
        "with a seabed, the other end without",
    )
    reference: Pair | None = Field(
        default=None,
        description="of touchdown_excursion: place [x, y] from which it counts; absent: the first touchdown point [m]",
    )
    point: Vector | None = Field(default=None, description="of clearance: a point, or with `normal` one of a plane [m]")
    normal: Direction | None = Field(
        default=None, description="of clearance: normal of the plane, to the side where the clearance is positive"
    )
    path: Annotated[tuple[Vector, ...], Field(min_length=2)] | None = Field(
        default=None, description="of clearance: points of another line that does not move, such as a pipeline [m]"
    )
    other: Text | None = Field(default=None, min_length=1, description="of clearance: another line")
    diameter: NonNegative = Field(
        default=0.0, description="of clearance: diameter of what is around the point or along the path [m]"
    )
    range: NonNegativePair | None = Field(
        default=None, description="of clearance: from and to which arc length the line counts; absent: all of it [m]"
    )
    smallest: Number | None = Field(
        default=None,
        description="smallest value allowed, in the unit of the quantity (N, deg, m); changes nothing that is computed",
    )
    largest: Number | None = Field(
        default=None,
        description="largest value allowed, in the unit of the quantity (N, deg, m); changes nothing that is computed",
    )

    @property
    def middle(self) -> float:
        """Of an azimuth, deg: from which its values are within half a turn, by its limits; NaN: the first value."""
        limits = [x for x in (self.smallest, self.largest) if x is not None]
        if len(limits) == 1 and abs(limits[0]) <= HALF_TURN:
            return math.nan
        return sum(limits) / len(limits) if limits else math.nan

    @property
    def unit(self) -> str:
        """Unit of its values."""
        return KINDS[self.kind][0]

    def description(self, seabed: bool) -> str:
        """What it is, in words; seabed: whether the scene has one."""
        what = "a point" if self.normal is None else "a plane"
        what = "a path" if self.path is not None else f"line {self.other}" if self.other is not None else what
        to = "the touchdown point; NaN: none" if self.ends_at(seabed) == "touchdown" else "the other end"
        text = KINDS[self.kind][1].format(end=self.end, what=what, to=to)
        return f"{text}, of line {self.line}" if self.line is not None else text

    def ends_at(self, seabed: bool) -> str:
        """Where a layback ends: touchdown, or end."""
        return self.to or ("touchdown" if seabed else "end")

    def _check_keys_of_the_kind(self) -> Findings:
        _, _, needed, possible = KINDS[self.kind]
        for key in needed:
            if getattr(self, key) is None:
                expected = "start or end" if key == "end" else "a direction [x, y, z]"
                yield [Finding((key,), f"{expected}, because {self.kind} needs it", f"add `{key}: ...`", "nothing")]
        for key in ("end", "direction", "to", "reference", "point", "normal", "path", "other", "range"):
            if getattr(self, key) is not None and key not in (*needed, *possible):
                yield [Finding((key,), f"nothing, because {self.kind} has no {key}", "leave it out")]
        if self.diameter and self.kind != "clearance":
            yield [Finding(("diameter",), f"nothing, because {self.kind} has no diameter", "leave it out")]
        if self.kind == "clearance":
            yield self._of_clearance()
        if self.smallest is not None and self.largest is not None and self.smallest > self.largest:
            yield [Finding(("smallest",), f"at most largest, {self.largest:g}", "are the two exchanged?")]

    def _of_clearance(self) -> Iterator[Finding]:
        given = [key for key in ("point", "path", "other") if getattr(self, key) is not None]
        if len(given) != 1:
            expected = "one of point, path and other, to which the clearance is"
            key = given[1] if given else "point"
            yield Finding((key,), expected, "point: [0, 0, -50]" if not given else "leave it out", ", ".join(given))
            return
        if self.normal is not None and self.point is None:
            yield Finding(
                ("normal",), "nothing without a point of the plane", "add `point: [x, y, z]`, or leave it out"
            )
        if self.diameter and (self.normal is not None or self.other is not None):
            expected = "nothing: a plane has none, and another line has its own"
            yield Finding(("diameter",), expected, "leave it out")
        if self.range is not None and self.range[0] >= self.range[1]:
            yield Finding(("range",), "arc lengths [from, to] with from below to", "are the two exchanged?")


Quantities = dict[Text, Quantity]


def of_one_line(wanted: Mapping[str, Quantity], length: float, free: Iterable[str], seabed: bool) -> Iterator[Finding]:
    """What is wrong with quantities of a scene of one line; length: m; free: those of its ends that nothing holds."""
    for name, each in wanted.items():
        here: Place = ("output", "quantities", name)
        if each.line is not None:
            yield Finding((*here, "line"), "nothing, because the scene has one line", "leave it out")
        if each.other is not None:
            fix = "path: [[x, y, z], ...] for what does not move, or a scene with points and lines"
            yield Finding((*here, "other"), "nothing, because the scene has one line", fix)
        yield from _of_line(name, each, wanted, length, seabed)
        if (
            each.end is not None
            and each.end in free
            and each.kind not in ("touchdown", "touchdown_excursion", "layback")
        ):
            yield Finding((*here, "end"), "an end that something holds", "the other end", f"{each.end}, which is free")


def of_several_lines(wanted: Mapping[str, Quantity], lines: Mapping[str, Any], seabed: bool) -> Iterator[Finding]:
    """The same of a scene of several lines, by name."""
    for name, each in wanted.items():
        here: Place = ("output", "quantities", name)
        for key in ("line", "other"):
            given = getattr(each, key)
            if given not in lines and (given is not None or key == "line"):
                near = nearest(given or "", tuple(lines))
                expected = f"the name of a line: {', '.join(list(lines)[:5])}{', ..' * (len(lines) > 5)}"
                yield Finding((*here, key), expected, near or f"{key}: {next(iter(lines))}", given or "nothing")
        if each.line is not None and each.line in lines:
            yield from _of_line(name, each, wanted, lines[each.line].cable.length, seabed)
        if each.other is not None and each.other == each.line:
            yield Finding((*here, "other"), "a line other than the one it is the clearance of", "another line")
        one, two = lines.get(each.line or ""), lines.get(each.other or "")
        if each.range is None and one is not None and two is not None and one is not two:
            met = {one.start, one.end} & {two.start, two.end}
            if met:
                length = one.cable.length
                expected = f"a part of {each.line} that leaves out point {min(met)}, where it meets {each.other}"
                fix = f"such as `range: [{0.1 * length:.4g}, {0.9 * length:.4g}]`"
                yield Finding((*here, "range"), expected, fix, "nothing: the clearance of two lines that meet is none")


def _of_line(
    name: str, each: Quantity, wanted: Mapping[str, Quantity], length: float, seabed: bool
) -> Iterator[Finding]:
    here: Place = ("output", "quantities", name)
    if not name.isidentifier() or name in TAKEN:
        expected = "a name of letters, digits and underscores that results do not have already"
        yield Finding(here, expected, f"{name}_2" if name in TAKEN else "hang_off", name or "nothing")
    if each.kind == "clearance" and f"{name}{WHERE}" in wanted:
        expected = f"another name: {name}{WHERE} is the arc length at which {name} is least"
        yield Finding(("output", "quantities", f"{name}{WHERE}"), expected, f"{name}_2")
    if each.kind in ON_BED and not seabed:
        fix = "add `seabed: {z: ..., stiffness: ...}` to the environment, or leave it out"
        yield Finding((*here, "kind"), "a quantity without a seabed, because there is none", fix)
    if each.kind == "layback" and each.to == "touchdown" and not seabed:
        yield Finding((*here, "to"), "end, because there is no seabed", "to: end")
    if each.range is not None and not 0.0 <= each.range[0] < each.range[1] <= length * (1.0 + 1e-9):
        expected = f"arc lengths [from, to] between 0 and the length of the line, {length:g} m"
        yield Finding((*here, "range"), expected, f"range: [0, {length:g}]")
