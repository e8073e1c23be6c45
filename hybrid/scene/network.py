"""Several lines that meet at points and bodies: a scene with `points` and `lines` in place of `cable` and `ends`.

What contradicts in it is found by `scene.network_checks`, which checks each line by itself too, between the places
where its two points are, or are first looked for.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import accumulate, combinations, pairwise
from typing import Annotated, Any, ClassVar, Literal, Self, TypeVar

from pydantic import Discriminator, Field, Tag, model_validator

from hybrid.scene.analysis import (
    USUAL,
    Accuracy,
    AdaptiveModel,
    AskedAccuracy,
    CatenaryModel,
    Equilibrium,
    Initial,
    LineInitial,
    Mesh,
    Model,
    Output,
    OutputPoints,
    Resolution,
    RodModel,
    Straight,
    Time,
    of_unnamed_model,
    without_friction,
)
from hybrid.scene.attachments import Attachment
from hybrid.scene.base import Finding, NonNegative, Table, Whole, refuse, turned, value_or_table
from hybrid.scene.bodies import FixedBody, FreeBody, RigidBody, without_turns
from hybrid.scene.cable import Cable, Contact, Section
from hybrid.scene.ends import (
    WINCH,
    AtPoint,
    Clamped,
    ClampedConnection,
    Connections,
    End,
    Ends,
    Failure,
    Fairlead,
    FixedPoint,
    FreePoint,
    Guided,
    GuidedPoint,
    LinesContact,
    Name,
    Pinned,
    Point,
    Triple,
)
from hybrid.scene.motion_checks import Held, lasting_period, moved_in
from hybrid.scene.motion_tables import GivenLoad, Motion
from hybrid.scene.obstacles import Obstacles
from hybrid.scene.schema import Asked, LineScene, SceneTables, pairs_in_reach

# Of the length of a line: how far a free point may be looked for from the other one.
REACHED = 0.95


class LineFailure(Failure):
    """When and where a line breaks from a point; its end is free from then on."""

    end: Literal["start", "end"] = Field(default="end", description="the end that breaks: at s = 0, or at s = length")


class JoinedLine(Table):
    """A line from one point to another, with s = 0 at `start`."""

    instead: ClassVar[Mapping[str, str]] = WINCH

    start: Name = Field(description="name of the point at s = 0")
    end: Name = Field(description="name of the point at s = length")
    connections: Connections = Field(
        default=Connections(), description="how its ends are connected to the points; absent: they turn freely"
    )
    sections: tuple[Section, ...] = Field(min_length=1, description="sections in order from s = 0 on")
    attachments: tuple[Attachment, ...] = Field(
        default=(), description="floats, clumps and modules on the line, in any order"
    )
    model: Model | None = Field(
        default=None,
        description="rod, catenary, zones of both that stay, or adaptive; absent: rod where it bends, else catenary",
    )
    mesh: Mesh | None = Field(default=None, description="how the line is cut into cells; absent: chosen")
    resolution: Resolution | None = Field(
        default=None, description="how fine the cells are that the program places; absent: as the accuracy asks"
    )
    contact: Contact = Field(
        default=Contact(), description="whether the line touches itself in a run, and its friction"
    )
    accuracy: AskedAccuracy | None = Field(
        default=None, description="how wrong the result of this line may be; absent: as `accuracy` of the scene"
    )
    initial: LineInitial = Field(
        default=Equilibrium(),
        description="straight or along a polyline, where all lines start so, or the shape that the "
        "search of the equilibrium starts from: guess, or points, a polyline that is shifted to the first places of "
        "its ends; absent: hung between these",
    )
    break_at: LineFailure | None = Field(
        default=None,
        description="when the line breaks from the point at one of its ends, at a time or after the first step with so "
        "large a tension there; absent: never",
    )

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
    def _ends_apart(self) -> JoinedLine:
        if self.start == self.end:
            refuse([Finding(("end",), f"a point other than {self.start}, where the line starts", "name another point")])
        return self


def _placed(initial: Initial, start: Triple | None) -> Initial:
    """A first shape that begins where its first point is, whether an end is held or not."""
    begins = isinstance(initial, Straight) and initial.origin is None
    return initial.model_copy(update={"origin": start}) if begins else initial


def _between(initial: Initial, ends: Mapping[str, End]) -> Initial:
    """A first shape whose ends are where the points are first, the rest in between shifted along."""
    if isinstance(initial, Straight) or initial.points is None:
        return initial
    points = initial.points
    way = [0.0, *accumulate(math.dist(a, b) for a, b in pairwise(points))]
    gaps = [(0.0, 0.0, 0.0), (0.0, 0.0, 0.0)]
    for k, key in enumerate(("start", "end")):
        place = ends[key].first_position
        if place is not None:
            x, y, z = points[-k]
            gaps[k] = place[0] - x, place[1] - y, place[2] - z
    moved = []
    for point, s in zip(points, way, strict=True):
        part = s / way[-1]
        x, y, z = (p + (1.0 - part) * a + part * b for p, a, b in zip(point, *gaps, strict=True))
        moved.append((x, y, z))
    return initial.model_copy(update={"points": tuple(moved)})


DEFAULT_POINTS = 101  # output points of a line that says nothing of them
LinePoints = Annotated[
    Annotated[Whole, Field(ge=2), Tag("<value>")] | Annotated[dict[Name, OutputPoints], Tag("<table>")],
    Discriminator(value_or_table),
]


class NetworkOutput(Output):
    """What is kept."""

    points: LinePoints = Field(  # type: ignore[assignment]  # by name of the line
        default=DEFAULT_POINTS,
        description="points along each line, evenly over its length, its ends included, or by name of the line its "
        "number or a list of arc lengths, of others 101; those of `history`, point loads, changes of section and "
        "joints are added [m]",
    )
    history: dict[Name, Annotated[tuple[NonNegative, ...], Field(min_length=1)]] = Field(  # type: ignore[assignment]
        default={}, description="by name of the line: arc lengths that plots follow over time [m]"
    )

    def points_of(self, line: str) -> int | tuple[float, ...]:
        """How many points are kept of a line, or their arc lengths [m]."""
        return self.points.get(line, DEFAULT_POINTS) if isinstance(self.points, dict) else self.points


class Network(SceneTables, Asked):
    """Lines, the points where they end and meet, what acts on them, and what is asked."""

    instead: ClassVar[Mapping[str, str]] = {
        "ends": "a scene with lines has points, at which they end",
        "model": "each line has its own: lines.NAME.model",
        "mesh": "each line has its own: lines.NAME.mesh",
        "initial": "each line has its own: lines.NAME.initial",
        "resolution": "each line has its own: lines.NAME.resolution",
        "solver": "leave it out: every scene is solved by elimination",
    }

    points: dict[Name, Point] = Field(min_length=1, description="points by name: where lines end, are held, and meet")
    bodies: dict[Name, RigidBody] = Field(
        default={}, description="rigid bodies by name, with fairleads among the points"
    )
    lines: dict[Name, JoinedLine] = Field(min_length=1, description="lines by name, each between two points")
    contact: LinesContact | None = Field(
        default=None,
        description="which lines touch each other, with what friction; absent: in runs with a step and without "
        "accuracy all that have diameters, from where they come near each other",
    )
    obstacles: Obstacles = Field(
        default={},
        description="obstacles by name, fixed or moving, that every line touches: planes, spheres, cylinders, boxes, "
        "tori, sheaves, meshes of triangles",
    )
    time: Time | None = Field(default=None, description="how long to compute; absent: statics only")
    accuracy: AskedAccuracy | None = Field(
        default=None,
        description="how wrong the result of each line may be: its cells and the time steps follow from it, unless "
        "they are given; parts are of how far each line moves, and of its own tensions",
    )
    output: NetworkOutput = Field(default=NetworkOutput(), description="what is kept")
    dimension: Literal[2, 3] | None = Field(
        default=None,
        description="2: all lines lie in one plane, refused if they do not, and stopped where something leaves it; "
        "lines that are joined to nothing are computed in it, others in space; absent: each such line in the plane in "
        "which it lies, if any [-]",
    )

    @property
    def motions(self) -> list[Motion]:
        """How points and bodies are moved."""
        held = (getattr(x, "motion", None) for x in (*self.points.values(), *self.bodies.values()))
        return [x for x in held if x is not None]

    @property
    def length(self) -> float:
        """Unstretched length of the longest line [m]."""
        return max(x.cable.length for x in self.lines.values())

    def key_of(self, name: str) -> str:
        """The key of the table that says what a line is made of."""
        return f"lines.{name}" if name else "cable"

    @property
    def adaptive(self) -> tuple[str, ...]:
        """Names of the lines whose zones move."""
        return tuple(name for name, line in self.lines.items() if isinstance(line.model, AdaptiveModel))

    @property
    def slack_becomes_rod(self) -> bool:
        """Whether a line is a catenary that stands for no model: should it go slack, the run begins anew with rods."""
        return any(x.model is None and x.chosen_model.kind == "catenary" for x in self.lines.values())

    @property
    def starts_as_placed(self) -> bool:
        """Whether the motion starts where the scene has lines, points and bodies, at rest, and not in equilibrium."""
        return any(not isinstance(line.initial, Equilibrium) for line in self.lines.values())

    def without_friction(self) -> Self:
        """The same whose equilibrium neglects friction, unless the scene says how it settles."""
        return self.with_lines({name: {"initial": without_friction(x.initial)} for name, x in self.lines.items()})

    def with_lines(self, changes: Mapping[str, Mapping[str, Any]]) -> Self:
        """The same with other tables, or other `sections`, of lines by name; KeyError: there is no such line."""
        lines = self.lines | {name: self.lines[name].model_copy(update=dict(x)) for name, x in changes.items()}
        return self.model_copy(update={"lines": lines}) if changes else self

    def searched(self) -> Self:
        """The same, whose shapes at the start are those from which the equilibrium is searched for."""
        if not self.starts_as_placed:
            return self
        shapes = {name: getattr(line.initial, "points", None) for name, line in self.lines.items()}
        return self.with_lines({name: {"initial": Equilibrium(points=points)} for name, points in shapes.items()})

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the points that are free and at which lines meet, in order."""
        return tuple(x for x in self.points if isinstance(self.points[x], FreePoint) and not self.is_free_end(x))

    @property
    def free_bodies(self) -> dict[str, FreeBody]:
        """The bodies that are free, by name, in order."""
        return {name: body for name, body in self.bodies.items() if isinstance(body, FreeBody)}

    @property
    def surfaces(self) -> Obstacles:
        """The obstacles, and behind them the shapes of bodies, by name."""
        shapes = {key: x for name, body in self.bodies.items() for key, x in body.surface(name).items()}
        return {**self.obstacles, **shapes} if shapes else self.obstacles

    @property
    def shaped(self) -> tuple[str, ...]:
        """Names of the bodies that lines touch."""
        return tuple(name for name, body in self.free_bodies.items() if body.shape is not None)

    @property
    def touching_pairs(self) -> list[tuple[str, str]]:
        """Names of lines that touch each other, two each."""
        if self.contact is None:
            return []
        return list(combinations(self.lines, 2)) if self.contact.between is None else list(self.contact.between)

    @property
    def meeting_pairs(self) -> list[tuple[str, str]]:
        """Those of `touching_pairs` between which contact is computed: of all lines those that reach each other."""
        if self.contact is None or self.contact.between is not None:
            return self.touching_pairs
        scenes = {name: self.scene_of(name) for name in self.lines}
        return [*pairs_in_reach(scenes, self.touching_pairs)]

    def first_place(self, point: str) -> Triple:
        """Where a point is held at rest, or first looked for [m]; not of a free end that says nothing of it."""
        place = self._known_place(point)
        assert place is not None
        return place

    def _known_place(self, point: str) -> Triple | None:
        """The same; None: the first shape of the line has it."""
        found = self.points[point]
        if isinstance(found, Fairlead):
            return self.bodies[found.body].place(found.place)
        return found.position if isinstance(found, FixedPoint) else getattr(found, "initial_guess", None)

    @property
    def guesses(self) -> dict[str, Triple]:
        """Where the points that are joined are first looked for, by name [m]."""
        return {name: self.first_place(name) for name in self.points if self.is_joined(name)}

    def body_of(self, point: str) -> FixedBody | FreeBody | None:
        """The body that a point is on; None: it is on none."""
        found = self.points[point]
        return self.bodies[found.body] if isinstance(found, Fairlead) else None

    def is_free_end(self, point: str) -> bool:
        """Whether a point is that end of one line which its place does not hold: free with no other line, or guided."""
        found = self.points[point]
        return isinstance(found, GuidedPoint) or (isinstance(found, FreePoint) and len(self.lines_at(point)) == 1)

    def is_held(self, point: str) -> bool:
        """Whether the place of a point is known: it is fixed, or on a body that is."""
        return isinstance(self.points[point], FixedPoint) or isinstance(self.body_of(point), FixedBody)

    def is_joined(self, point: str) -> bool:
        """Whether a point moves by what pulls there, and is more than the end of a line: a knot, or on a free body."""
        return not self.is_held(point) and not self.is_free_end(point)

    def may_leave(self, name: str, end: Literal["start", "end"]) -> bool:
        """Whether an end of a line moves by what pulls there, or may once something has broken."""
        point = getattr(self.lines[name], end)
        weak = getattr(self.points[point], "break_at", None) is not None
        return weak or self.breaks(name, end) or self.is_joined(point)

    def lines_at(self, point: str) -> list[tuple[str, Literal["start", "end"]]]:
        """Names of the lines that meet at a point, each with the end that does; those that break there come last."""
        lines, meeting = self._meetings
        if lines is not self.lines:  # those that this was copied from
            self.__dict__.pop("_meetings")
            _, meeting = self._meetings
        return [*meeting.get(point, ())]

    @cached_property
    def _meetings(self) -> tuple[dict[str, JoinedLine], dict[str, list[tuple[str, Literal["start", "end"]]]]]:
        """The lines, and `lines_at` of every point where one ends."""
        found: dict[str, list[tuple[str, Literal["start", "end"]]]] = {}
        for name, line in self.lines.items():
            found.setdefault(line.start, []).append((name, "start"))
            found.setdefault(line.end, []).append((name, "end"))
        return self.lines, {point: sorted(ends, key=lambda at: self.breaks(*at)) for point, ends in found.items()}

    def breaks(self, name: str, end: str) -> bool:
        """Whether a line may break from the point at an end."""
        failure = self.lines[name].break_at
        return failure is not None and failure.end == end

    @property
    def may_break(self) -> bool:
        """Whether anything may break or be let go."""
        return any(getattr(x, "break_at", None) is not None for x in (*self.lines.values(), *self.points.values()))

    def clamp(self, name: str, end: str) -> ClampedConnection | None:
        """How a line is clamped at an end; None: it turns freely."""
        found = getattr(self.lines[name].connections, end)
        return found if isinstance(found, ClampedConnection) else None

    def clamped_at(self, point: str) -> list[tuple[str, Literal["start", "end"]]]:
        """Names of the lines that are clamped at a point, each with the end that is."""
        return [at for at in self.lines_at(point) if self.clamp(*at) is not None]

    def moments_on(self, point: str) -> tuple[GivenLoad, ...]:
        """Moments that are given to a free point."""
        found = self.points[point]
        return found.moments if isinstance(found, FreePoint) else ()

    @property
    def rigid(self) -> tuple[str, ...]:
        """Names of the free points to which lines are clamped."""
        return tuple(name for name in self.free if self.clamped_at(name))

    def direction(self, name: str, end: str) -> tuple[Triple, Triple | None] | None:
        """Inertial directions in which a line is clamped at rest, or first: its tangent and its material axis a1.

        None: it turns freely, or is clamped to a free point, whose axes are not known here, or is guided.
        """
        held = self.clamp(name, end)
        point = getattr(self.lines[name], end)
        if held is None or held.tangent is None or isinstance(self.points[point], FreePoint | GuidedPoint):
            return None
        body = self.body_of(point)
        if body is None:
            return held.tangent, held.normal
        turn = body.rotation if isinstance(body, FixedBody) else body.initial_rotation
        return turned(turn, held.tangent), None if held.normal is None else turned(turn, held.normal)

    def carried(self, name: str) -> tuple[str, ...]:
        """Ends (`start`, `end`) at which a line carries the free point, its mass and loads: the first line does."""
        line = self.lines[name]
        return tuple(
            key
            for key in ("start", "end")
            if isinstance(self.points[point := getattr(line, key)], FreePoint)
            and not self.is_free_end(point)
            and self.lines_at(point)[0] == (name, key)
        )

    def scene_of(
        self,
        name: str,
        carrying: Sequence[str] = (),
        places: Mapping[str, Triple] | None = None,
        directions: Mapping[str, tuple[Triple, Triple | None]] | None = None,
    ) -> LineScene:
        """A line between the places where its points are, or are first looked for.

        carrying: ends at which the free point is a body of the line, not a place that is held.  places: of the points
        that are joined [m], wherever they are; None: where the scene has them.  directions: as of `direction` by end,
        in place of those.
        """
        known, key = self._known_scenes, (name, tuple(carrying))
        if places or directions is not None:  # without places all points are where the scene has them
            return replace(self.scene_of(name), **self._between_points(name, carrying, places, directions))
        if key not in known:
            known[key] = self._scene_of(name, carrying)
        return known[key]

    @property
    def scenes_of_lines(self) -> dict[str, LineScene]:
        """Each line with the points that it carries, by name, between points as they are first looked for."""
        guesses = self.guesses
        return {name: self.scene_of(name, self.carried(name), guesses) for name in self.lines}

    @property
    def _known_scenes(self) -> dict[Any, Any]:
        """Scenes of lines that have been made, by line and ends that carry."""
        tables, known = self._made_scenes
        if any(getattr(self, name) is not table for name, table in tables.items()):  # of what this was copied from
            self.__dict__.pop("_made_scenes")  # older pydantic lets nothing be deleted of what is frozen
            _, known = self._made_scenes
        return known

    @cached_property
    def _made_scenes(self) -> tuple[dict[str, Any], dict[Any, Any]]:
        """The tables of this network, and `_known_scenes`."""
        return {name: getattr(self, name) for name in type(self).model_fields}, {}

    def _scene_of(self, name: str, carrying: Sequence[str]) -> LineScene:
        """As `scene_of`, made anew, with points where the scene has them."""
        line, output = self.lines[name], self.output
        kept = Output.model_construct(
            points=output.points_of(name),
            history=output.history.get(name),
            every=self.output_interval if self.time is not None else output.every,
            criteria=output.criteria and (name in self.adaptive or not self.adaptive),  # none: each says so
            errors=output.errors,
        )
        return LineScene(
            title=f"{self.title}, line {name}" if self.title else f"line {name}",
            environment=self.environment,
            cable=line.cable,
            contact=self._contact_of(name),
            obstacles=self.surfaces,
            model=line.chosen_model,
            mesh=line.mesh,
            resolution=line.resolution,
            time=self.time,
            output=kept,
            accuracy=self._accuracy_of(line),
            **self._between_points(name, carrying),
        )

    def _between_points(
        self,
        name: str,
        carrying: Sequence[str],
        places: Mapping[str, Triple] | None = None,
        directions: Mapping[str, tuple[Triple, Triple | None]] | None = None,
    ) -> dict[str, Any]:
        """The ends of a line and its first shape between them; arguments as of `scene_of`."""
        line = self.lines[name]
        first = self._places(line)
        ends: dict[str, End] = {}
        for key in ("start", "end"):
            point, body = self.points[getattr(line, key)], self.body_of(getattr(line, key))
            held = self.direction(name, key) if directions is None else directions.get(key)
            place, motion = first[key], None
            if self.is_free_end(getattr(line, key)):
                ends[key] = self._free_end(name, key, place)
                continue
            if isinstance(point, FixedPoint):
                place, motion = point.position, point.motion
                if held is None and motion is not None and self.clamped_at(getattr(line, key)):
                    motion = motion if motion.file is not None else without_turns(motion)
            elif isinstance(body, FixedBody):  # that it turns as well is for the model
                motion = body.shift
            elif places:
                place = places[getattr(line, key)]
            assert place is not None
            if key in carrying and isinstance(point, FreePoint):
                ends[key] = point.end.model_copy(update={"initial_guess": first[key]} if point.is_body else {})
                continue
            clamp, moves = self.clamp(name, key), self.may_leave(name, key)
            given: dict[str, Any] = {"position": place, "motion": motion}
            given["payout"] = getattr(line.connections, key).payout
            swung = isinstance(body, FixedBody) and body.motion != body.shift
            if held is None or clamp is None:
                twisted = moves and clamp is not None and not clamp.swivel
                at = AtPoint(moves, clamp is not None and not moves, twisted, swung=swung)
                ends[key] = Pinned(**given).at_point(at)
                continue
            given |= {"tangent": held[0], "normal": held[1], "swivel": clamp.swivel}
            given["turns"] = 0.0 if carrying else clamp.turns  # a first shape is that of the line with no point
            made = Clamped(**given, bend_stiffness=clamp.bend_stiffness)
            ends[key] = made.at_point(AtPoint(moves, swung=swung))
        initial = _placed(line.initial, first["start"]) if self.starts_as_placed else _between(line.initial, ends)
        return {"ends": Ends(**ends), "initial": initial}

    def _free_end(self, name: str, key: Literal["start", "end"], near: Triple | None) -> End:
        """The end of a line at a point that is no more than that; near: as of `FreePoint.only_end`."""
        point, initial = self.points[getattr(self.lines[name], key)], self.lines[name].initial
        if isinstance(point, GuidedPoint):
            held = self.clamp(name, key)
            assert held is not None
            assert held.tangent is not None
            return Guided(
                tangent=held.tangent, normal=held.normal, turns=held.turns, force=point.force, motion=point.motion
            )
        assert isinstance(point, FreePoint)
        if isinstance(initial, Equilibrium) and (initial.direction is not None or initial.guess == "straight"):
            near = None  # the search starts from a line straight in a direction
        return point.only_end(near)

    def _contact_of(self, name: str) -> Contact:
        """Contact of a line with itself, which knows whether it rubs on others."""
        own = self.lines[name].contact
        own = own.within(in_plane=True) if self.dimension == 2 else own
        touches = self.contact is not None and any(name in pair for pair in self.touching_pairs)
        return own.within(rubs_on_others=self.contact.friction > 0.0) if self.contact is not None and touches else own

    def _accuracy_of(self, line: JoinedLine) -> Accuracy | None:
        """What is asked of a line: of one that names no model no curvature, because nobody has asked for a rod."""
        asked = line.accuracy or self.accuracy
        if asked is None and self.time is not None and self.time.controlled and self.time.tolerance is None:
            asked = Accuracy(all=USUAL)
        if asked is None or line.model is not None:
            return asked
        return of_unnamed_model(asked, any(x.pipe is not None and x.pipe.max_stress for x in line.sections))

    def _places(self, line: JoinedLine) -> dict[str, Triple | None]:
        """Where the points of a line are first [m]; None: where its first shape has them.

        A free one is no farther from the other than the line is long.
        """
        names = {"start": line.start, "end": line.end}
        places = {key: self._known_place(name) for key, name in names.items()}
        start, end = places["start"], places["end"]
        if start is None or end is None:
            return places
        distance = math.dist(start, end)
        part = REACHED * line.cable.length / distance if distance > 0.0 else 1.0
        for key, (x, y, z), (a, b, c) in (("end", end, start), ("start", start, end)):
            if part < 1.0 and not self.is_held(names[key]) and not self.starts_as_placed:
                places[key] = (a + part * (x - a), b + part * (y - b), c + part * (z - c))
                break
        return places

    @property
    def points_kept(self) -> int:
        """How many places along all lines are kept at every output, but for those that are added."""
        kept = (self.output.points_of(name) for name in self.lines)
        return sum(x if isinstance(x, int) else len(x) for x in kept)

    @property
    def lasting_period(self) -> float:
        """The shortest period of waves and motions [s]; infinity: there is none."""
        given = (*self.points.values(), *self.bodies.values())
        motions = [(getattr(x, "motion", None), getattr(x, "position", None)) for x in given]
        moved = [Held(motion, place, (1.0, 0.0, 0.0)) for motion, place in motions if motion is not None]
        return lasting_period([*moved_in(None, self.obstacles), *((x, x.motion) for x in moved)], self.environment)


SomeScene = TypeVar("SomeScene", bound=Network)
