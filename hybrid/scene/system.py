"""Several lines that meet at points: the tables of a scene with `points` and `lines` in place of `cable` and `ends`.

Each line is checked as a scene of its own, between the places where its two points are, or are first looked for.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Discriminator, Field, Tag, ValidationError, model_validator

from hybrid.errors import SceneError
from hybrid.scene.analysis import CatenaryModel, Equilibrium, Mesh, Model, RodModel, Time, ZonesModel
from hybrid.scene.attachments import ADDED_MASS, DRAG_AREA, HEIGHT, SHAPE, Attachment, Shape
from hybrid.scene.base import (
    Finding,
    Kinds,
    NonNegative,
    Place,
    Positive,
    Table,
    Text,
    Vector,
    Whole,
    by_kind,
    refuse,
)
from hybrid.scene.cable import Cable, Environment, Section
from hybrid.scene.ends import TURNS, Body, End, Ends, Free, Loading, Motion, Pinned, Triple
from hybrid.scene.motion_checks import motion_findings
from hybrid.scene.schema import Scene, missing_time
from hybrid.scene.suggestions import nearest

# Names are keys of the result file and of its groups.
FORBIDDEN = "/."
# Of the length of a line: how far a free point may be looked for from the other one.
REACHED = 0.95


class FixedPoint(Table):
    """A point that is held or moved: an anchor, a fairlead of a vessel whose motion is known."""

    kind: Literal["fixed"] = Field(default="fixed", description="held where it is, or moved as `motion` says")
    position: Vector = Field(description="position, inertial frame [m]")
    motion: Motion | None = Field(default=None, description="how the point moves; absent: not at all")

    @model_validator(mode="after")
    def _does_not_turn(self) -> FixedPoint:
        if self.motion is not None:
            turns = [name for name in self.motion.harmonics() if name in TURNS]
            expected = "no rotation, because lines turn freely at a point"
            refuse(Finding(("motion", name), expected, "leave it out") for name in turns)
        return self


class FreePoint(Table):
    """A point that lines alone hold: a knot, a buoy, a clump.  It turns freely and has no moment of inertia."""

    kind: Literal["free"] = Field(default="free", description="moves with the lines that meet there")
    initial_guess: Vector = Field(
        description="where the search of the equilibrium puts the point first, inertial frame [m]"
    )
    mass: NonNegative = Field(default=0.0, description="mass in air, its weight over gravity [kg]")
    volume: NonNegative = Field(default=0.0, description="displaced volume, for its buoyancy [m^3]")
    height: Positive | None = Field(default=None, description=HEIGHT)
    shape: Shape = Field(default="sphere", description=SHAPE)
    drag_area: NonNegative = Field(default=0.0, description=DRAG_AREA)
    added_mass: NonNegative = Field(default=0.0, description=ADDED_MASS)
    force: Loading | None = Field(default=None, description="force on the point, inertial frame [N]")

    @model_validator(mode="after")
    def _added_mass_has_a_body(self) -> FreePoint:
        if self.added_mass and not self.is_body:
            refuse(
                [Finding(("added_mass",), "0, because the point has no mass, volume or drag area", "add `volume: ...`")]
            )
        return self

    @property
    def is_body(self) -> bool:
        """Whether the point is more than a knot."""
        return bool(self.mass or self.volume or self.drag_area)

    @property
    def end(self) -> Body | Free:
        """The end of a line that carries the point."""
        if not self.is_body:
            return Free(force=self.force)
        given = {k: getattr(self, k) for k in ("mass", "volume", "height", "shape", "drag_area", "added_mass")}
        return Body(**given, thrust=self.force, initial_guess=self.initial_guess)


Point = Annotated[
    Annotated[FixedPoint, Tag("<fixed>")] | Annotated[FreePoint, Tag("<free>")],
    Discriminator(by_kind),
    Kinds(("fixed", "free"), usual=("fixed",), implied=(("position", "fixed"), ("initial_guess", "free"))),
]


def _a_name(name: str) -> str:
    if not name or any(x in name for x in FORBIDDEN):
        raise ValueError("a name")
    return name


Name = Annotated[Text, AfterValidator(_a_name)]


class JoinedLine(Table):
    """A line from one point to another, with s = 0 at `start`; its ends turn freely."""

    start: Name = Field(description="name of the point at s = 0")
    end: Name = Field(description="name of the point at s = length")
    sections: tuple[Section, ...] = Field(min_length=1, description="sections in order from s = 0 on")
    attachments: tuple[Attachment, ...] = Field(
        default=(), description="floats, clumps and modules on the line, in any order"
    )
    model: Model | None = Field(
        default=None,
        description="rod, catenary, or zones of both that stay; absent: rod with bending stiffness, else catenary",
    )
    mesh: Mesh | None = Field(default=None, description="how the line is cut into cells; absent: chosen")

    @property
    def cable(self) -> Cable:
        """What the line is made of."""
        return Cable(sections=self.sections, attachments=self.attachments)

    @property
    def chosen_model(self) -> Model:
        """The model that is given, or the one that stands for none."""
        if self.model is not None:
            return self.model
        return RodModel() if all(x.weakest_bending for x in self.sections) else CatenaryModel()

    @model_validator(mode="after")
    def _zones_stay(self) -> JoinedLine:
        if self.model is not None and not isinstance(self.model, RodModel | CatenaryModel | ZonesModel):
            expected = "rod, catenary, or zones that stay, because several lines are computed together"
            refuse([Finding(("model",), expected, "write `model: rod`", f"kind: {self.model.kind}")])
        if self.start == self.end:
            refuse([Finding(("end",), f"a point other than {self.start}, where the line starts", "name another point")])
        return self


class SystemOutput(Table):
    """What is kept."""

    every: Positive | None = Field(
        default=None, description="time between two outputs; absent: a hundredth of the duration, or one a step [s]"
    )
    points: Annotated[Whole, Field(ge=2)] = Field(
        default=101, description="points along each line, evenly over its length, its ends included [-]"
    )


class System(Table):
    """Several lines, the points where they meet, what acts on them, and what is asked."""

    title: Text = Field(default="", description="a line for people; it heads plots and reports")
    environment: Environment = Field(default=Environment(), description="what acts on the lines from outside")
    points: dict[Name, Point] = Field(min_length=1, description="points by name: where lines end, are held, and meet")
    lines: dict[Name, JoinedLine] = Field(min_length=1, description="lines by name, each between two points")
    time: Time | None = Field(default=None, description="how long to compute; absent: statics only")
    output: SystemOutput = Field(default=SystemOutput(), description="what is kept")

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the points that are free, in order."""
        return tuple(name for name, point in self.points.items() if isinstance(point, FreePoint))

    @property
    def guesses(self) -> dict[str, Triple]:
        """Where the free points are first looked for, by name [m]."""
        return {name: point.initial_guess for name, point in self.points.items() if isinstance(point, FreePoint)}

    def lines_at(self, point: str) -> list[tuple[str, Literal["start", "end"]]]:
        """Names of the lines that meet at a point, each with the end that does."""
        found: list[tuple[str, Literal["start", "end"]]] = []
        for name, line in self.lines.items():
            found += [(name, "start")] if line.start == point else []
            found += [(name, "end")] if line.end == point else []
        return found

    def carried(self, name: str) -> tuple[str, ...]:
        """Ends (`start`, `end`) at which a line carries the free point, its mass and loads: the first line does."""
        line = self.lines[name]
        return tuple(
            key
            for key in ("start", "end")
            if getattr(line, key) in self.free and self.lines_at(getattr(line, key))[0] == (name, key)
        )

    def scene_of(self, name: str, carrying: Sequence[str] = (), places: Mapping[str, Triple] | None = None) -> Scene:
        """A line between the places where its points are, or are first looked for, as a scene of its own.

        carrying: ends at which the free point is a body of the line, not a place that is held.  places: of the free
        points [m], wherever they are; None: where the scene has them, and what is wrong with the line is a
        ValidationError of pydantic.
        """
        line = self.lines[name]
        first = self._places(line)
        ends: dict[str, End] = {}
        for key in ("start", "end"):
            point = self.points[getattr(line, key)]
            if isinstance(point, FixedPoint):
                ends[key] = Pinned(position=point.position, motion=point.motion)
            elif key in carrying:
                ends[key] = point.end.model_copy(update={"initial_guess": first[key]} if point.is_body else {})
            else:
                ends[key] = Pinned(position=first[key] if places is None else places[getattr(line, key)])
        if places is not None:
            return self.scene_of(name).model_copy(update={"ends": Ends(**ends)})
        tables: dict[str, Any] = {
            "title": f"{self.title}, line {name}" if self.title else f"line {name}", "environment": self.environment,
            "cable": line.cable, "ends": Ends(**ends), "initial": Equilibrium(), "model": line.chosen_model,
            "mesh": line.mesh,
        }  # fmt: skip
        if self.time is not None:
            tables["time"] = self.time
        tables["output"] = {"points": self.output.points} | ({"every": self.output.every} if self.output.every else {})
        return Scene.model_validate(tables)

    def _places(self, line: JoinedLine) -> dict[str, Triple]:
        """Where the points of a line are first [m], a free one no farther from the other than the line is long."""
        found = {key: self.points[getattr(line, key)] for key in ("start", "end")}
        places = {key: x.position if isinstance(x, FixedPoint) else x.initial_guess for key, x in found.items()}
        distance = math.dist(places["start"], places["end"])
        part = REACHED * line.cable.length / distance if distance > 0.0 else 1.0
        for key, other in (("end", "start"), ("start", "end")):
            if part < 1.0 and isinstance(found[key], FreePoint):
                (x, y, z), (a, b, c) = places[key], places[other]
                places[key] = (a + part * (x - a), b + part * (y - b), c + part * (z - c))
                break
        return places

    def require_time(self) -> Time:
        """The `time` table; SceneError if there is none."""
        if self.time is None:
            raise SceneError([missing_time(self)])
        return self.time

    @model_validator(mode="after")
    def _steps_are_fixed(self) -> System:
        if self.time is not None and self.time.controlled:
            expected = "a fixed step, in s, because several lines are computed together"
            key = "step" if self.time.step is None else "tolerance"
            fix = "add `step: ...` (s)" if key == "step" else "leave tolerance out"
            refuse([Finding(("time", key), expected if key == "step" else f"nothing, but {expected}", fix)])
        return self

    @model_validator(mode="after")
    def _lines_join_points(self) -> System:
        unknown = list(self._unknown_points())
        refuse(unknown)
        refuse(chain(self._lonely_points(), self._floating_groups()))
        refuse(chain.from_iterable(self._line_findings(name) for name in self.lines))
        return self

    def _unknown_points(self) -> Iterator[Finding]:
        for name, line in self.lines.items():
            for key in ("start", "end"):
                point = getattr(line, key)
                if point not in self.points:
                    expected = f"the name of a point: {', '.join(self.points)}"
                    fix = nearest(point, dict.fromkeys(self.points, "")) or f"add `{point}: ...` to points"
                    yield Finding(("lines", name, key), expected, fix)

    def _lonely_points(self) -> Iterator[Finding]:
        for name, point in self.points.items():
            if not self.lines_at(name):
                kind = "a free point" if isinstance(point, FreePoint) else "a point"
                expected = f"{kind} at which a line starts or ends"
                yield Finding(
                    ("points", name), expected, f"leave it out, or let a line end there: `end: {name}`", "no line"
                )

    def _floating_groups(self) -> Iterator[Finding]:
        """Free points from which no way along lines leads to a fixed one."""
        held = {name for name, point in self.points.items() if isinstance(point, FixedPoint)}
        while True:
            more = {p for x in self.lines.values() for p in (x.start, x.end) if {x.start, x.end} & held} - held
            if not more:
                break
            held |= more
        for name in self.points:
            if name not in held and self.lines_at(name):
                expected = "a free point that lines join to a fixed one, at least by way of others"
                yield Finding(("points", name), expected, "make one of these points `kind: fixed`", "nothing holds it")

    def _line_findings(self, name: str) -> Iterator[Finding]:
        """What is wrong with a line and its points, each under its own key of the system."""
        line = self.lines[name]
        wrong: dict[Finding, None] = {}  # each once
        for carrying in ((), *((key,) for key in self.carried(name))):
            try:
                scene = self.scene_of(name, carrying)
                wrong |= dict.fromkeys(motion_findings({key: getattr(scene, key) for key in Scene.model_fields}))
            except ValidationError as error:
                for each in error.errors(include_url=False):
                    at = tuple(x for x in each["loc"] if not str(x).startswith("<"))
                    for found in (each.get("ctx") or {}).get("findings", ()):
                        wrong[Finding((*at, *found.at), found.expected, found.fix, found.given)] = None
            if wrong:
                break
        yield from (self._of_system(name, line, found) for found in wrong)

    def _of_system(self, name: str, line: JoinedLine, found: Finding) -> Finding:
        at: Place = found.at
        if at[:1] == ("cable",):
            at = ("lines", name, *at[1:])
        elif at[:1] in (("model",), ("mesh",)):
            at = ("lines", name, *at)
        elif at[:1] == ("ends",) and len(at) > 1:
            point = getattr(line, str(at[1]))
            rest = at[2:]
            if isinstance(self.points[point], FreePoint) and rest:
                rest = ({"position": "initial_guess", "thrust": "force"}.get(str(rest[0]), rest[0]), *rest[1:])
            at = ("points", point, *rest)
        given = f"of line {name}: {found.given}" if found.given else None
        return Finding(at, found.expected.replace("ends.", "line's "), found.fix, given)
