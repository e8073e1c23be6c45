"""The scene: what is there.  Frozen pydantic models, SI units, inertial frame with z up.

Every class is one table of the YAML file; the same classes are the Python API.
A missing table is None, and None costs nothing downstream.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from hybrid.errors import SceneError
from hybrid.scene.analysis import (
    OUTPUTS,
    PER_PERIOD,
    UNASKED_BYTES,
    VALUES,
    Accuracy,
    AskedAccuracy,
    Equilibrium,
    Initial,
    Mesh,
    Model,
    Output,
    Resolution,
    Time,
    missing_time,
    usual_model,
)
from hybrid.scene.base import Table, Text, refuse
from hybrid.scene.bodies import Carried
from hybrid.scene.cable import Cable, Contact, Environment
from hybrid.scene.checks import contradictions
from hybrid.scene.ends import End, Ends, Triple
from hybrid.scene.motion_checks import lasting_period, moved_in
from hybrid.scene.motion_tables import TURNS, Motion, most_shift
from hybrid.scene.obstacles import Obstacle, Obstacles

# pydantic leaves a bound under its own name where a validator of ours stands before the number
_STANDARD = {"gt": "exclusiveMinimum", "ge": "minimum", "lt": "exclusiveMaximum", "le": "maximum"}


class Asked:
    """What is asked of a scene or of one line of it: for how long it is computed, and what is kept."""

    if TYPE_CHECKING:  # what each has in its own way

        @property
        def time(self) -> Time | None: ...
        @property
        def output(self) -> Any: ...
        @property
        def accuracy(self) -> Accuracy | None: ...
        @property
        def points_kept(self) -> int: ...
        @property
        def lasting_period(self) -> float: ...

    def require_time(self) -> Time:
        """The `time` table; SceneError if there is none."""
        if self.time is None:
            raise SceneError([missing_time()])
        return self.time

    @property
    def size_of_output(self) -> int:
        """Bytes of an output in the file, roughly."""
        asked = self.output.errors
        wanted = self.accuracy is not None or (self.time is not None and self.time.controlled)
        return int(8 * VALUES * self.points_kept * (1 + (wanted if asked is None else asked)))

    @property
    def output_interval(self) -> float:
        """Time between two outputs [s]."""
        if self.output.every is not None:
            return float(self.output.every)
        time = self.require_time()
        wanted = max(OUTPUTS, math.ceil(min(PER_PERIOD * time.duration / self.lasting_period, 1e9)))
        most = max(OUTPUTS, int(UNASKED_BYTES / self.size_of_output))
        return max(time.duration / min(wanted, most), time.step or 0.0)


class SceneTables(Table):
    """What both forms of a scene have in common: a title and the environment."""

    title: Text = Field(default="", description="a line for people; it heads plots and reports")
    environment: Environment = Field(default=Environment(), description="what acts from outside")

    @classmethod
    def model_json_schema(cls, *args: Any, **kwargs: Any) -> dict[str, Any]:
        """JSON Schema; bounds in the words that editors know."""
        return dict(standard_schema(super().model_json_schema(*args, **kwargs)))


def standard_schema(schema: Any) -> Any:
    """A JSON schema whose bounds have their standard names."""
    if isinstance(schema, dict):
        return {_STANDARD.get(k, k) if not isinstance(v, dict) else k: standard_schema(v) for k, v in schema.items()}
    return [standard_schema(x) for x in schema] if isinstance(schema, list) else schema


# The tables of the short form of a scene.
class CableScene(SceneTables):
    """One line without a name, its ends, the world around it, and what is asked."""

    instead: ClassVar[Mapping[str, str]] = {"solver": "leave it out: every scene is solved by elimination"}
    asked_nothing: ClassVar[Mapping[str, Any]] = {"solver": "elimination"}

    cable: Cable = Field(description="what the cable is made of")
    contact: Contact = Field(default=Contact(), description="what the cable touches beside the seabed")
    obstacles: Obstacles = Field(
        default={},
        description="obstacles by name, fixed or moving, that the cable touches: planes, spheres, cylinders, boxes, "
        "tori, sheaves, meshes of triangles",
    )
    ends: Ends = Field(description="how the ends are held, moved and loaded")
    initial: Initial = Field(description="where the cable is at t = 0")
    model: Model = Field(
        default_factory=lambda data: usual_model(data.get("cable"), data.get("obstacles")),
        description="where the cable is a rod and where a catenary; absent, or adaptive alone: of a cable with bending "
        "stiffness that of rod, catenary and adaptive which costs least by a pre-run, where an accuracy is asked and "
        "no mesh given, else adaptive (absent: rod, if it bends differently in two directions or has a rotary_inertia, "
        "tension_strain or dynamic_stiffness, or there are obstacles); of others catenary",
    )
    mesh: Mesh | None = Field(default=None, description="how the cable is cut into cells; absent: chosen")
    resolution: Resolution | None = Field(
        default=None, description="how fine the mesh is that is chosen; absent: what accuracy asks for"
    )
    time: Time | None = Field(default=None, description="how long to compute; absent: statics only")
    output: Output = Field(default=Output(), description="what is kept")
    accuracy: AskedAccuracy | None = Field(
        default=None,
        description="how wrong the result may be, such as 1%, 3 cm or 50 N; absent: 1% where steps are to follow the "
        "motion, else not asked",
    )
    dimension: Literal[2, 3] | None = Field(
        default=None,
        description="2: in a plane, refused if the scene does not lie in one; 3: in space; absent: a motion is "
        "computed in a plane where the whole scene lies in one, for as long as nothing could push it out of it [-]",
    )

    @model_validator(mode="before")
    @classmethod
    def _without_former(cls, value: Any) -> Any:
        return cls.without_former(value)

    @model_validator(mode="after")
    def _no_contradiction(self) -> CableScene:
        refuse(contradictions({name: getattr(self, name) for name in type(self).model_fields}))
        return self


@dataclass(frozen=True, kw_only=True)
class LineScene(Asked):
    """One line between the places of its ends, with what surrounds it and what is asked of it.

    What the model of a line is built from: tables of a scene that has been checked, which nothing reads or checks here.
    """

    title: str
    environment: Environment
    cable: Cable
    contact: Contact  # of the line with itself
    obstacles: Obstacles  # of all lines
    ends: Ends  # where its points are, or are first looked for, and how they hold it
    initial: Initial
    model: Model
    mesh: Mesh | None
    resolution: Resolution | None
    time: Time | None
    output: Output  # of this line
    accuracy: Accuracy | None
    dimension: Literal[2, 3] | None = None

    @property
    def starts_as_placed(self) -> bool:
        """Whether the motion starts where the scene has the line, at rest, and not in equilibrium."""
        return not isinstance(self.initial, Equilibrium)

    @property
    def motions(self) -> list[Motion]:
        """How ends are moved."""
        return [end.prescribed_motion for end in self.ends.both if end.prescribed_motion is not None]

    @property
    def length(self) -> float:
        """Unstretched length of the longest line [m]."""
        return self.cable.length

    @property
    def points_kept(self) -> int:
        """How many places along the line are kept at every output, but for those that are added."""
        return self.output.points if isinstance(self.output.points, int) else len(self.output.points)

    @property
    def lasting_period(self) -> float:
        """The shortest period of waves and motions [s]; infinity: there is none."""
        return lasting_period(moved_in(self.ends, self.obstacles), self.environment)


# Which obstacles of a scene a line can reach, by its length, its ends and the strain that its sections bear.
#
# A point of a line at the arc length s is within s of the start, and within the rest of the length of the end, both
# measured along the stretched line.  A run stops where a section is stretched beyond what it bears (max_strain): the
# stretched length has a bound.  An end that moves may be anywhere within the bound of its motion.  The points of a
# short part of a line lie in two balls, one about each end, and what these have in common lies in one ball.  An
# obstacle that is farther than the radius from the middle of every such ball is never touched.
#
# Where no bound is known, the line counts as one that reaches every obstacle:
#
#     both ends are free, or are moved by other lines, or may be let go;
#     an end may be set from outside, or its motion goes on for ever, or a vessel or a file has it;
#     line is paid out;
#     the obstacle is on a body or set from outside, or moves so that it turns.

# Parts of the length of which each has a ball: how much larger than necessary these are is a part of the length.
PARTS = 64
# Diameters between the middle of the line and a surface that it does not touch: half of one, and the onset of contact.
APART = 1.0
# Of the length: how far from where a scene has them Newton's method and round-off may leave the line.
ROUND_OFF = 1e-6


class Ball(NamedTuple):
    """Where points of a line may be."""

    middle: Triple  # m, inertial
    radius: float  # m


class Anchor(NamedTuple):
    """An end that is held."""

    place: Triple  # m, inertial
    shift: float  # m, how far it moves at most


def reachable_obstacles(scene: LineScene) -> Obstacles:
    """The obstacles of a scene that its line may touch, by name, in order."""
    return {name: x for name, x in scene.obstacles.items() if may_reach(scene, x)}


def may_reach(scene: LineScene, obstacle: Obstacle) -> bool:
    """Whether a line may touch an obstacle; where no bound is known it may."""
    shift = _shift_of_obstacle(obstacle)
    if math.isinf(shift):
        return True
    apart = shift + _spare(scene)
    return all(any(obstacle.distance(x.middle) <= x.radius + apart for x in balls) for balls in _covers(scene))


def pairs_in_reach(scenes: Mapping[str, LineScene], pairs: Iterable[tuple[str, str]]) -> Iterator[tuple[str, str]]:
    """Those of these pairs of lines that may touch each other; where no bound is known they may.

    scenes: of the lines by name.
    """
    covers, spare = {}, {name: _spare(x) for name, x in scenes.items()}
    for name, scene in scenes.items():
        each = [[*balls] for balls in _covers(scene)]
        covers[name] = [(np.array([x.middle for x in balls]), np.array([x.radius for x in balls])) for balls in each]
    for a, b in pairs:
        apart = spare[a] + spare[b]
        for (x, r), (y, q) in zip(covers[a], covers[b], strict=False):
            if not (np.linalg.norm(x[:, None] - y, axis=2) <= r[:, None] + q + apart).any():
                break
        else:
            yield a, b


def _spare(scene: LineScene) -> float:
    """How far (m) a line may be from the middle of what it touches, beside the half thickness of that."""
    return APART * max(x.diameter or 0.0 for x in scene.cable.sections) + ROUND_OFF * scene.length


def longest_stretched(scene: LineScene) -> float:
    """Length, m, beyond which a line is not stretched; what does not stretch keeps the length that it has."""
    return sum(x.length * (1.0 + (x.strain_limit if x.stiffness else 0.0)) for x in scene.cable.sections)


def _covers(scene: LineScene) -> Iterator[Iterator[Ball]]:
    """Sets of balls, the coarsest first, each of which holds all of the line; none: no bound is known."""
    ends = scene.ends.both
    if scene.contact.around.ends_are_set or any(getattr(end, "payout", None) is not None for end in ends):
        return
    first, last = (_anchor(end) for end in ends)
    far = longest_stretched(scene)
    if first is not None and last is not None:
        yield iter([_around(first, last, far)])
        parts = sorted(range(PARTS), key=lambda k: abs(2 * k + 1 - PARTS))  # those in the middle reach farthest
        yield (_between(first, last, far * (k + 1) / PARTS, far * (1.0 - k / PARTS)) for k in parts)
    elif (held := first or last) is not None:
        yield iter([Ball(held.place, far + held.shift)])


def _around(first: Anchor, last: Anchor, far: float) -> Ball:
    """The ball whose diameter is the longest axis of the ellipsoid in which a line of a length (m) lies."""
    (x, y, z), (u, v, w) = first.place, last.place
    return Ball((0.5 * (x + u), 0.5 * (y + v), 0.5 * (z + w)), 0.5 * (far + first.shift + last.shift))


def _between(first: Anchor, last: Anchor, begun: float, left: float) -> Ball:
    """A ball that holds what is within `begun` (m) of the one anchor and within `left` of the other."""
    a, b = begun + first.shift, left + last.shift
    apart = math.dist(first.place, last.place)
    along = 0.5 * (apart + (a * a - b * b) / apart) if apart > 0.0 else math.copysign(math.inf, a - b)
    if along <= 0.0:  # the ball about the first is smaller, and its middle is on this side of the plane of both rims
        return Ball(first.place, a)
    if along >= apart:
        return Ball(last.place, b)
    (x, y, z), (u, v, w), part = first.place, last.place, along / apart
    middle = (x + part * (u - x), y + part * (v - y), z + part * (w - z))
    return Ball(middle, math.sqrt(max(a * a - along * along, 0.0)))


def _anchor(end: End) -> Anchor | None:
    """Where an end is held; None: no bound of its place is known."""
    place = end.held_position
    if place is None or end.release is not None or end.is_swung or not end.is_placed:
        return None
    shift = _largest_shift(end.prescribed_motion)
    return Anchor(place, shift) if math.isfinite(shift) else None


def _largest_shift(motion: Motion | None) -> float:
    """How far (m) a motion moves at most, whenever; infinite: no bound is known."""
    if motion is None:
        return 0.0
    if any(getattr(motion, x) is not None for x in ("velocity", "follow", "vessel", "file")):
        return math.inf
    return most_shift(motion, 0.0)


def _shift_of_obstacle(obstacle: Obstacle) -> float:
    """How far (m) points of an obstacle move out of its shape at rest; infinite: no bound is known."""
    motion = obstacle.motion
    turns = motion is not None and any(getattr(motion, x) is not None for x in TURNS)
    if isinstance(obstacle, Carried) or obstacle.from_outside or turns:
        return math.inf
    return _largest_shift(motion)
