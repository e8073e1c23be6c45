"""Several lines as arrays: a model of each, points and bodies that they share, and places of these to begin with."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.junctions.bodies import FORCE, FRAME, LEVEL, LIFT, MASS, MOMENT, NUMBERS, PLACE, STATE, STIFFNESS, V
from hybrid.kernels.junctions.joined_lines import SEAT, TURNS, WITH_BODY, WITH_POINT
from hybrid.kernels.laws.water import PIECE
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.state.report import (
    MAY_MEET,
    MEETS_FROM,
    MEETS_TO,
    OBSTACLES,
    ONSET_OF,
    SELF_CONTACT,
    STRAND,
    TURNED,
)
from hybrid.kernels.state.state import Floats, State
from hybrid.kernels.step.line_step import TOLERANCE
from hybrid.model.bodies import (
    BodyModel,
    FairleadMotion,
    KnownMotion,
    axes_of_point,
    body_model,
    directions_at_rigid,
    frame_of,
    loads_of,
    seat_of,
    seated,
    untwisted,
    with_clamps,
)
from hybrid.model.build import WHAT, Model, build
from hybrid.model.catenary_guess import pulls
from hybrid.model.contents import IDLE, MEETS, Entry, Touching, obstacle_entries, that_may_meet, touching_among
from hybrid.model.ends import EndConditions, EndLoad
from hybrid.model.initial_shape import dead_loads, first_state, hung
from hybrid.model.obstacles import obstacle_rows, pull_on_obstacles
from hybrid.model.payout import naming_connection
from hybrid.model.resolution import Resolution, first_resolution
from hybrid.model.sea import surroundings
from hybrid.scene.bodies import FixedBody, way_out
from hybrid.scene.ends import Fairlead
from hybrid.scene.network import Network
from hybrid.scene.plane import TYPED, plane_of
from hybrid.scene.schema import LineScene, reachable_obstacles

MOST_ROUNDS = 100  # of Newton's method for the first places of the points
SAME_FORCE = 1e-5  # of the largest force at a point: what may be left there of what does not balance
LEAST_WAY = 1e-9  # of its length: on which a line does not touch the body that it is fixed to
FARTHEST = 0.25  # of the shortest line: how far a point goes in a round


@dataclass(frozen=True)
class NetworkResolution:
    """How finely several lines are computed: each its cells and the error allowed per step, all the same steps."""

    lines: Mapping[str, Resolution]  # by name
    tolerance: float = TOLERANCE  # of Newton's method in steps

    @classmethod
    def first(cls, network: Network) -> NetworkResolution:
        """The resolution for the accuracy of each line, before anything is known of its errors."""
        return cls.of({name: network.scene_of(name) for name in network.lines})

    @classmethod
    def of(cls, scenes: Mapping[str, LineScene]) -> NetworkResolution:
        """The same of lines by name; scenes: of them."""
        found = {name: first_resolution(scene) for name, scene in scenes.items()}
        step, later = min(x.step for x in found.values()), min(x.later or x.step for x in found.values())
        return cls({name: replace(x, step=step, later=later if x.later else 0.0) for name, x in found.items()})

    def coarser(self, cells: float = 1.0, steps: float = 1.0) -> NetworkResolution:
        """With cells and steps longer by these factors."""
        return NetworkResolution({name: x.coarser(cells, steps) for name, x in self.lines.items()})

    @property
    def one(self) -> Resolution:
        """That of the first line, with what all have in common: step, every, shortest, and whether steps are fixed."""
        return next(iter(self.lines.values()))

    @property
    def allowed(self) -> Floats:
        """(L,) m, error of each line allowed per step; infinite: steps are fixed."""
        return np.array([np.inf if x.local is None else x.local for x in self.lines.values()])


@dataclass(frozen=True)
class NetworkModel:
    """A network of lines made ready to compute."""

    names: tuple[str, ...]  # of the lines
    models: tuple[Model, ...]  # of the lines; a free point is a body at the end of the line that carries it
    free: tuple[str, ...]  # names of the free points at which lines turn freely
    rigid: tuple[str, ...]  # names of those to which lines are clamped: bodies without mass, behind the bodies
    joints: tuple[tuple[int, int], ...]  # of each line: number of what moves its start and end, -1: held there
    places: Floats  # (P, 3) m, where the free points are first
    bodies: tuple[BodyModel, ...]  # that are free; they are numbered behind the free points
    body_places: Floats  # (B, STATE) where they, and the points behind them, are first
    fairleads: Floats  # (L, 2, 3) m, of ends at free bodies, in axes of the body
    seats: Floats  # (L, 2, SEAT) frames of ends that turn with a free body or point (kernels.junctions.joined_lines)
    known: Mapping[str, KnownMotion]  # of bodies that are held or moved
    scenes: Mapping[str, LineScene]  # of the lines by name, with their points where the network has them
    resolution: NetworkResolution
    moments: tuple[tuple[EndLoad, ...], ...]  # that are given to each of the points in `rigid`
    turns: tuple[tuple[float, float], ...]  # by which the start and the end of each line are twisted
    touching: Touching | None = None  # which lines touch each other
    may_meet: tuple[int, ...] = ()  # numbers of those that do from where they come near each other
    loose: frozenset[tuple[int, int]] = frozenset()  # ends (line, 0 or 1) that have left their points
    supports: Mapping[tuple[int, int], EndConditions] = field(default_factory=dict)  # what held free ones
    # (M,) number of the body that carries an obstacle, -1: none does; empty: no body has a shape
    rides: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))

    @property
    def cells(self) -> int:
        """Cells of all lines."""
        return sum(model.cells for model in self.models)

    def with_lines(self, models: Mapping[int, Model]) -> NetworkModel:
        """The same with other models of some lines, by number."""
        return replace(self, models=tuple(models.get(k, x) for k, x in enumerate(self.models)))

    @cached_property
    def asks_contact(self) -> bool:
        """Whether contact is computed of lines with each other, with themselves or with bodies."""
        touches = any(x.line.bits & SELF_CONTACT for x in self.models)
        return touches or self.touching is not None or bool(self.rides.size)

    def load_bodies(self, t: float, out: Floats, since: float = 0.0) -> None:
        """Write what acts on the bodies at t (s; infinity: of full size) into `out` (B, NUMBERS).

        since: s, loads that have stopped by then are left out.
        """
        for body, row in zip(self.bodies, out, strict=False):
            body.load(t, since, row)
        for moments, row in zip(self._taken_moments, out[len(self.bodies) :], strict=True):
            row[MOMENT : MOMENT + 3] = sum((x.grown(t) for x in moments if since < x.until), np.zeros(3))

    @property
    def unheld(self) -> tuple[int, ...]:
        """Numbers in `rigid` of points to which no line is clamped any longer: nothing asks how they are turned."""
        if not self.rigid:
            return ()
        first = len(self.free) + len(self.bodies)
        held = {self.joints[line][k] for line, k in np.argwhere(self.seats[:, :, TURNS] != 0.0)}
        return tuple(k for k in range(len(self.rigid)) if first + k not in held)

    @property
    def _taken_moments(self) -> list[tuple[EndLoad, ...]]:
        """The moments that are given to each of the points in `rigid`, none where nothing takes them."""
        unheld = self.unheld
        return [() if k in unheld else x for k, x in enumerate(self.moments)]

    def growing_loads(self, since: float) -> list[EndLoad]:
        """All loads of the bodies, and points behind them, on which one grows or follows a table: `end` is their row.

        since: as of `load_bodies`.
        """
        given = [*(body.loads for body in self.bodies), *self._taken_moments]
        return [
            x._replace(end=row)
            for row, loads in enumerate(given)
            if any(x.ramp or len(x.history) for x in loads)
            for x in loads
            if since < x.until
        ]

    @property
    def breaks(self) -> list[float]:
        """Times (s) at which a load on a body, or a moment on a point, stops."""
        stops = [x.until for moments in self.moments for x in moments if np.isfinite(x.until)]
        return [*stops, *(x for body in self.bodies for x in body.breaks)]

    def body_numbers(self, t: float) -> Floats:
        """Numbers (B, NUMBERS or, with pieces of members, more) of the free bodies at t (s).

        Where they are first; behind them those of points, zeros; a turn that nothing holds has an inertia, which
        nothing feels.
        """
        out = np.zeros((len(self.body_places), max((x.numbers.size for x in self.bodies), default=NUMBERS)))
        for row, body in zip(out, self.bodies, strict=False):
            row[: body.numbers.size] = body.numbers
        for k in self.unheld:
            out[len(self.bodies) + k, MASS + 21 : MASS + 36 : 7] = 1.0
        self.load_bodies(t, out)
        self.update_water(t, self.body_places, 0.0, out)
        return out

    def update_water(self, t: float, bodies: Floats, dt: float, out: Floats) -> None:
        """Write the water around members of bodies (B, STATE) at t (s), dt (s) later, into their numbers `out`."""
        for body, state, row in zip(self.bodies, bodies, out, strict=False):
            if body.members is not None:
                body.members.update_water(t, state, dt, row[NUMBERS : body.numbers.size].reshape(-1, PIECE))

    def members_of(self, out: Floats) -> dict[int, Table]:
        """Of bodies that have members, by their numbers: what tells the water around these into their numbers `out`."""
        found = {}
        for k, (body, row) in enumerate(zip(self.bodies, out, strict=False)):
            if body.members is not None:
                found[k] = body.members.into(row[NUMBERS : body.numbers.size].reshape(-1, PIECE))
        return found


def build_network(
    network: Network, resolution: NetworkResolution | None = None, like: NetworkModel | None = None
) -> NetworkModel:
    """Make the model that a network requires, with its points and bodies where the scene has them first.

    resolution: how finely, None: as the scene asks for; like: a model of the same lines, whose meshes are taken.
    Raises SceneError where a line cannot be meshed.
    """
    made = bodies_of(network)
    free, places, bodies = first_places(network, made)
    resolution = resolution or NetworkResolution.first(network)
    joined = _joined(network, places, bodies)
    joint, fairleads = joined.joint, joined.fairleads
    maker = FirstLines(network, joined, bodies, resolution, None)
    if like is not None:
        maker.meshes = {name: model.mesh for name, model in zip(like.names, like.models, strict=True)}
    maker.turn_points()
    models = [maker.model(name) for name in network.lines]
    if network.surfaces:
        models = _on_obstacles(network, models, made)
    rides = _leave_own_bodies(network, models)
    scenes = {name: network.scene_of(name) for name in network.lines}
    names = list(network.lines)
    pairs = ((names.index(a), names.index(b)) for a, b in network.meeting_pairs)
    touching = touching_among(network, scenes, pairs)
    if touching is not None:
        models = _with_contact(network, models, touching)
    may_meet = that_may_meet(network, scenes)
    for k in may_meet:
        x = models[k]
        line = x.line._replace(bits=x.line.bits | MAY_MEET)
        models[k] = replace(x, line=line, contents=(*x.contents, MEETS))
    if _has_drag(network, models):
        models = [replace(x, contents=tuple(e for e in x.contents if e.what != IDLE)) for x in models]
    ends = [(x.start, x.end) for x in network.lines.values()]
    joints = tuple((joint.get(a, -1), joint.get(b, -1)) for a, b in ends)
    models = [_in_space(network, name, x, held) for name, x, held in zip(network.lines, models, joints, strict=True)]
    if network.dimension == 2:
        models = _kept_in_plane(network, models, joints)
    known = maker.known
    for name, body in network.bodies.items():
        if isinstance(body, FixedBody) and name not in known:
            known[name] = KnownMotion(body, models[0].sea)
    connections = [x.connections for x in network.lines.values()]
    turns = ((getattr(x.start, "turns", 0.0), getattr(x.end, "turns", 0.0)) for x in connections)
    on_bodies = np.array([[fairleads.get(p, (0.0, 0.0, 0.0)) for p in pair] for pair in ends])
    loads = tuple(loads_of(network.moments_on(x)) for x in network.rigid)
    lines = tuple(network.lines), tuple(models), free, network.rigid, joints, places, made, maker.bodies, on_bodies
    more = maker.seats, known, scenes, resolution, loads, tuple(turns), touching, may_meet
    return NetworkModel(*lines, *more, rides=rides)


def with_surfaces(network: Network, models: Sequence[Model], bodies: Sequence[BodyModel]) -> list[Model]:
    """Models of the lines of a network with what they may touch as `build_network` has it, in arrays of their own.

    Bodies that carry some are where they are first.
    """
    scenes = [network.scene_of(name, network.carried(name)) for name in network.lines]
    around = [surroundings(scene, x.line.h.size) for scene, x in zip(scenes, models, strict=True)]
    models = _on_obstacles(network, [replace(x, sea=sea) for x, sea in zip(models, around, strict=True)], bodies)
    _leave_own_bodies(network, models)
    return models


def _in_space(network: Network, name: str, model: Model, joints: tuple[int, int]) -> Model:
    """The model of a line, without its plane where it is not computed in that; joints: of `NetworkModel`."""
    line = network.lines[name]
    carriers = [x for x in map(network.body_of, (line.start, line.end)) if isinstance(x, FixedBody)]
    if max(joints) >= 0:
        why = "it is joined to what moves with it"
    elif any(x.motion != x.shift for x in carriers):
        why = "a body that turns moves its end"
    elif network.dimension == 3:
        why = "dimension: 3"
    else:
        return model
    entries = (replace(e, on=False, why=why) if e.what == WHAT and e.on else e for e in model.contents)
    return replace(model, plane=None, contents=tuple(entries))


def _kept_in_plane(network: Network, models: Sequence[Model], joints: Sequence[tuple[int, int]]) -> list[Model]:
    """The models, whose lines must not leave the plane in which all of them are."""
    scenes = [network.scene_of(name, network.carried(name)) for name in network.lines]
    tables = [(x.environment, x.ends, x.initial) for x in scenes]
    plane, _ = plane_of(scenes[0].environment, scenes[0].cable, scenes[0].ends, scenes[0].initial, TYPED, tables)
    axes = np.array([plane.p, plane.q, plane.normal])
    flat = Entry(WHAT, True, f"dimension: 2; {plane.text()}")
    found = []
    for x, scene, held in zip(models, scenes, joints, strict=True):
        if max(held) >= 0 or x.line.bits & OBSTACLES or scene.contact.self:
            found.append(replace(x, kept_in=axes[2]))
        else:
            contents = tuple(flat if e.what == WHAT else e for e in x.contents)
            found.append(replace(x, kept_in=axes[2], plane=axes, contents=contents))
    return found


def first_places(network: Network, made: Sequence[BodyModel]) -> tuple[tuple[str, ...], Floats, Floats]:
    """Names and places (P, 3) m of free points at which lines turn freely, and states (B, STATE).

    States are of bodies and, behind them, of points, not turned yet, where the scene has them first.  made: the free
    bodies.
    """
    rigid = network.rigid
    points = np.zeros((len(rigid), STATE))
    points[:, PLACE:FRAME] = np.array([network.first_place(x) for x in rigid]).reshape(-1, 3)
    points[:, FRAME:V] = np.eye(3).ravel()
    bodies = np.vstack([np.array([body.start for body in made]).reshape(-1, STATE), points])
    free = tuple(x for x in network.free if x not in rigid)
    return free, np.array([network.first_place(x) for x in free], float).reshape(-1, 3), bodies


def first_lines(network: Network, made: Sequence[BodyModel], resolution: NetworkResolution) -> FirstLines:
    """What makes lines between first places of points and bodies, with free points that are not turned yet."""
    _, places, bodies = first_places(network, made)
    return FirstLines(network, _joined(network, places, bodies), bodies, resolution, None)


def bodies_of(network: Network) -> tuple[BodyModel, ...]:
    """The free bodies of a network as numbers."""
    environment, around = network.environment, None
    density = environment.fluid.density if environment.fluid is not None else 0.0
    if any(body.members for body in network.free_bodies.values()):
        around = surroundings(network.scene_of(next(iter(network.lines))), 1)
    return tuple(
        body_model(name, body, density, environment.gravity, around) for name, body in network.free_bodies.items()
    )


def _leave_own_bodies(network: Network, models: Sequence[Model]) -> NDArray[np.int64]:
    """Which free bodies carry obstacles (M,), none: empty.

    A line meets the shape of a body that it is fixed to only beyond its way out of that, straight towards its other
    end.
    """
    surfaces, numbers = list(network.surfaces), list(network.free_bodies)
    for model, line in zip(models, network.lines.values(), strict=True):
        carried, length = model.sea.values.carried, model.length
        places = [
            model.start.r[-k] if network.is_free_end(x) else network.first_place(x)
            for k, x in enumerate((line.start, line.end))
        ]
        for end, name in enumerate((line.start, line.end)):
            point = network.points[name]
            shape = getattr(network.bodies[point.body], "shape", None) if isinstance(point, Fairlead) else None
            if not isinstance(point, Fairlead) or shape is None:
                continue
            k = surfaces.index(point.body)
            axes = carried[k, TURNED : TURNED + 9].reshape(3, 3)
            towards = tuple((axes.T @ np.subtract(places[1 - end], places[end])).tolist())
            row = model.sea.values.obstacles[k]
            out = max(way_out(shape, point.place, towards, float(row[STRAND] + row[ONSET_OF])), LEAST_WAY * length)
            carried[k, MEETS_TO if end else MEETS_FROM] = out
    if not network.shaped:
        return np.zeros(0, np.int64)
    return np.array([numbers.index(x) if x in network.shaped else -1 for x in surfaces], np.int64)


def _on_obstacles(network: Network, models: Sequence[Model], bodies: Sequence[BodyModel]) -> list[Model]:
    """The models with obstacles as stiff as the pull of all lines, points and bodies asks for.

    A line that is cut lies on them as it does in one piece.
    """
    pulls = [pull_on_obstacles(network.scene_of(name, network.carried(name))) for name in network.lines]
    for body in bodies:
        row = np.zeros(NUMBERS)
        body.load(np.inf, 0.0, row)
        pulls.append(float(np.linalg.norm(row[FORCE : FORCE + 3]) + abs(body.numbers[LIFT])))
    found = []
    for name, x in zip(network.lines, models, strict=True):
        scene, rows = network.scene_of(name), x.sea.values.obstacles
        before = {e.what for e in obstacle_entries(scene, rows)}
        rows[:] = obstacle_rows(scene, sum(pulls))
        kept = tuple(e for e in x.contents if e.what not in before)
        found.append(replace(x, contents=(*kept, *obstacle_entries(scene, rows))))
    return found


def _with_contact(network: Network, models: Sequence[Model], touching: Touching) -> list[Model]:
    """The models of lines that touch each other from the start."""
    names, found = list(network.lines), list(models)
    assert network.contact is not None
    for k in touching.lines:
        others = ", ".join(names[j] for j in touching.partners(k))
        entry = Entry(f"contact with {others}, friction {network.contact.friction:g}", True, "contact")
        x = found[k]
        found[k] = replace(x, line=touching.bits(x.line), contents=(*x.contents, entry))
    return found


def _has_drag(network: Network, models: Sequence[Model]) -> bool:
    """Whether anything of a network has drag."""
    members = [member for body in network.free_bodies.values() for member in body.members]
    return (
        not all(any(e.what == IDLE for e in x.contents) for x in models)
        or any(getattr(point, "drag_area", 0.0) for point in network.points.values())
        or any(x.drag or x.axial_drag for x in members)
    )


class _Joined(NamedTuple):
    """The points that something free carries, by name."""

    at: dict[str, Any]  # m, where they are
    joint: dict[str, int]  # number of the free point, or behind these of the body, that they are or are on
    fairleads: dict[str, Any]  # m, of those on bodies, in axes of these
    rows: dict[str, int]  # of those the body


def _joined(network: Network, places: Floats, bodies: Floats) -> _Joined:
    """places: (P, 3) m of the free points; bodies: (B, STATE) of the free bodies and the points behind them."""
    rigid = network.rigid
    free, free_bodies = tuple(x for x in network.free if x not in rigid), list(network.free_bodies)
    carriers = [*free_bodies, *rigid]
    at: dict[str, Any] = dict(zip(free, map(tuple, places.tolist()), strict=True))
    joint = {name: k for k, name in enumerate(free)}
    fairleads: dict[str, Any] = {}
    for name, point in network.points.items():
        carrier = point.body if isinstance(point, Fairlead) else name
        if carrier in (free_bodies if isinstance(point, Fairlead) else rigid):
            row = bodies[carriers.index(carrier)]
            place = point.place if isinstance(point, Fairlead) else (0.0, 0.0, 0.0)
            at[name] = tuple((row[PLACE:FRAME] + row[FRAME:V].reshape(3, 3) @ np.array(place)).tolist())
            joint[name], fairleads[name] = len(free) + carriers.index(carrier), place
    return _Joined(at, joint, fairleads, {x: joint[x] - len(free) for x in fairleads})


def starts_between(network: Network, places: Floats, bodies: Floats, model: NetworkModel) -> tuple[list[State], Floats]:
    """Shapes of the lines of a model to begin with, hung between other places of its points and bodies.

    places: (P, 3) m of the free points; bodies: (B, STATE), which are returned too, with the axes of points that lines
    are clamped to.
    """
    maker = FirstLines(network, _joined(network, places, bodies), bodies, model.resolution, model.seats)
    maker.turn_points()
    return [maker.start(name, each) for name, each in zip(model.names, model.models, strict=True)], maker.bodies


class FirstLines:
    """Makes the models of lines, with their clamps."""

    def __init__(
        self, network: Network, joined: _Joined, bodies: Floats, resolution: NetworkResolution, seats: Floats | None
    ) -> None:
        """seats: of a model that was made before; None: as the first shapes lie."""
        self._network, self._at, self.bodies, self._rows = network, joined.at, bodies.copy(), joined.rows
        self._given, self._names, self._resolution = seats, list(network.lines), resolution.lines
        self.seats = np.zeros((len(self._names), 2, SEAT)) if seats is None else seats
        self._at_rigid = {end: x for p in network.rigid for end, x in directions_at_rigid(network, p).items()}
        self.meshes: dict[str, Any] = {}  # of lines that have one already, as of `Model.mesh`
        self.known: dict[str, KnownMotion] = {}  # motions of bodies, which are added when first asked for

    def turn_points(self) -> None:
        """Turn the free points to which lines are clamped as the lines lie, hung between their places.

        Of points that are left the next is one that a line leads to from where its material axis a1 is known: so the
        twist that both ends of a line that is cut ask for is less than half a turn, as of the line in one piece.
        """
        left, network = list(self._network.rigid), self._network
        while left:
            known = {p: [at for at in network.clamped_at(p) if self._leads_from_known(at, left)] for p in left}
            point = next((p for p in left if known[p]), left[0])
            here = [*known[point], *(at for at in network.clamped_at(point) if at not in known[point])]
            models = {name: self._shape(name, self.directions(name, left)) for name, _ in here}
            far = None
            if known[point]:
                name, end = known[point][0]
                far = self.directions(name, left)["start" if end == "end" else "end"]
            axes = axes_of_point({end: self._at_rigid[end] for end in here}, models, far)
            self.bodies[self._rows[point], FRAME:V] = axes.ravel()
            left.remove(point)

    def _leads_from_known(self, at: tuple[str, str], left: Sequence[str]) -> bool:
        """Whether the other end of a line is clamped where axes are known, and holds its twist; left: not known yet."""
        name, end = at
        other = "start" if end == "end" else "end"
        held, point = self._network.clamp(name, other), getattr(self._network.lines[name], other)
        if held is None or held.swivel or point in left:
            return False
        return held.normal is not None or point in self._network.rigid

    def axes(self, point: str) -> Floats | None:
        """Axes (3, 3) of what carries a point; None: nothing that is free does."""
        row = self._rows.get(point)
        return None if row is None else self.bodies[row, FRAME:V].reshape(3, 3)

    def _shape(self, name: str, directions: Mapping[str, Any] | None) -> Model:
        scene, mesh, line = self.scene(name, (), directions), self.meshes.get(name), self._network.lines[name]
        alone = not any(self._network.is_joined(point) for point in (line.start, line.end))
        with naming_connection(name):
            return build(scene, self._resolution[name], mesh, spare=alone or bool(reachable_obstacles(scene)))

    def scene(self, name: str, carried: Sequence[str], directions: Mapping[str, Any] | None) -> LineScene:
        """The scene of a line between the places of its points; of one that is carried, with the point."""
        return self._network.scene_of(name, carried, self._at, directions)

    def directions(self, name: str, left: Sequence[str] = ()) -> dict[str, Any]:
        """Inertial directions in which the line is clamped, by end; left: points whose axes are not known yet."""
        found: dict[str, Any] = {}
        line = self._network.lines[name]
        for k, (end, point) in enumerate((("start", line.start), ("end", line.end))):
            axes = self.axes(point)
            if point in left:
                found[end] = None
            elif axes is not None and self._given is not None and self._given[self._names.index(name), k, TURNS]:
                found[end] = seated(self._given[self._names.index(name), k], axes)
            elif axes is not None and (name, end) in self._at_rigid:
                found[end] = tuple(tuple((axes @ x).tolist()) for x in self._at_rigid[name, end])
            else:
                found[end] = self._network.direction(name, end)
        clamps = [self._network.clamp(name, end) for end in ("start", "end")]
        guessed = self._network.is_joined(line.start) or self._network.is_joined(
            line.end
        )  # else the first shape counts
        if guessed and all(x is not None and not x.swivel for x in clamps) and found["start"] and found["end"]:
            found["start"], found["end"] = untwisted(found["start"], found["end"])
        return found

    def start(self, name: str, model: Model) -> State:
        """The first shape of a line, whose model has been made, between the places of now."""
        scene, line, sea = self.scene(name, (), self.directions(name)), model.line, model.sea
        shape = hung(scene, line, sea.values)
        return first_state(scene, line, model.cable, sea, model.tension_scale, shape)[0]

    def model(self, name: str) -> Model:
        """The model of a line: its loads with the points that it carries, its first shape between held places."""
        network, l = self._network, self._names.index(name)
        directions = self.directions(name)
        clamps = [network.clamp(name, end) for end in ("start", "end")]
        model = self._shape(name, directions)
        carried = network.carried(name)
        if carried:
            other = build(self.scene(name, carried, directions), self._resolution[name], model.mesh, like=model)
            held = [k for k, end in enumerate(("start", "end")) if clamps[k] is not None]
            other = with_clamps(other, model, held)
            other.ends.values.frame[held] = model.ends.values.frame[held]
            model = replace(other, start=model.start, start_shape=model.start_shape)
        for k, point in enumerate((network.lines[name].start, network.lines[name].end)):
            found, body, axes = network.points[point], network.body_of(point), self.axes(point)
            if clamps[k] is not None and axes is not None and self._given is None:
                kind = WITH_POINT if point in network.rigid else WITH_BODY
                self.seats[l, k] = seat_of(model.ends.values.frame[k], axes, kind)
            if isinstance(found, Fairlead) and isinstance(body, FixedBody) and body.motion is not None:
                motion = self.known.setdefault(found.body, KnownMotion(body, model.sea))
                seat = seat_of(model.ends.values.frame[k], frame_of(body.rotation)) if clamps[k] is not None else None
                model.ends.motions[k] = FairleadMotion(motion, found.place, seat)
        return model


def balanced_places(network: Network, model: NetworkModel) -> tuple[Floats, Floats] | None:
    """Places (P, 3) m of free points and (B, STATE) of bodies at which elastic catenaries balance.

    None: they are not found.
    All loads but contact, bending and what the current does; bodies do not turn.  The energy of the lines is convex in
    the places, so that Newton's method with shortened steps finds them from anywhere.
    """
    points, count = len(model.free), len(model.body_places)
    held = {name: np.array(network.first_place(name)) for name in network.points if network.is_held(name)}
    if not points + count or not held:
        return model.places, model.body_places
    lines, loads = list(network.lines.values()), [_loads(each) for each in model.models]
    reach = FARTHEST * min(each.length for each in model.models)
    frames = model.body_places[:, FRAME:V].reshape(-1, 3, 3)
    numbers = model.body_numbers(np.inf)
    # a joint moves as its point, or as the origin of its body, with its end beside that
    beside = np.zeros_like(model.fairleads)
    for l, k in np.argwhere(np.array(model.joints).reshape(-1, 2) >= points):
        beside[l, k] = frames[model.joints[l][k] - points] @ model.fairleads[l, k]

    def forces(places: Floats) -> tuple[Floats, Floats] | None:
        out, K = np.zeros_like(places), np.zeros((places.size, places.size))
        for b in range(count):
            row, o = numbers[b], 3 * (points + b) + 2
            out[points + b] += row[FORCE : FORCE + 3]
            out[points + b, 2] += row[LIFT] - row[STIFFNESS] * (places[points + b, 2] - row[LEVEL])
            K[o, o] -= row[STIFFNESS]
        for l, (line, each, load, joints) in enumerate(zip(lines, model.models, loads, model.joints, strict=True)):
            loose = [network.is_free_end(p) for p in (line.start, line.end)]
            if any(loose):  # it hangs from its other end with all that acts on it
                for k in (0, 1):
                    if joints[k] >= 0:
                        out[joints[k]] += load.sum(axis=0)
                continue
            ends = [
                held[p] if j < 0 else places[j] + beside[l, k]
                for k, (p, j) in enumerate(zip((line.start, line.end), joints, strict=True))
            ]
            found = pulls(load, each.line.h, each.line.ck, ends[1] - ends[0])
            if found is None:
                return None
            for k, sign in ((0, 1.0), (1, -1.0)):
                if joints[k] >= 0:
                    out[joints[k]] += sign * found.t[-k] + load[-k]
                    for m, other in ((0, -1.0), (1, 1.0)):
                        if joints[m] >= 0:
                            a, b = 3 * joints[k], 3 * joints[m]
                            K[a : a + 3, b : b + 3] += sign * other * found.stiffness
        return out, K

    largest = max(float(np.abs(load).sum()) for load in loads)
    places = _least_energy(forces, np.vstack([model.places, model.body_places[:, PLACE:FRAME]]), largest, reach)
    if places is None:
        return None
    bodies = model.body_places.copy()
    bodies[:, PLACE:FRAME] = places[points:]
    return places[:points], bodies


def _least_energy(
    forces: Callable[[Floats], tuple[Floats, Floats] | None], places: Floats, largest: float, reach: float
) -> Floats | None:
    """Places (P, 3) m at which forces (N, with their stiffness) vanish against the largest, in steps up to `reach`."""
    found = forces(places)
    for _ in range(MOST_ROUNDS):
        if found is None:
            return None
        out, K = found
        if np.abs(out).max() <= SAME_FORCE * largest:
            return places
        try:
            step = np.linalg.solve(K, -out.ravel()).reshape(-1, 3)
        except np.linalg.LinAlgError:
            return None
        step *= min(1.0, reach / max(float(np.abs(step).max()), 1e-300))
        slope, part = float((out * step).sum()), 1.0
        while part > 1e-6:
            tried = forces(places + part * step)
            if tried is None:
                return None
            if float((tried[0] * step).sum()) >= -0.5 * slope:  # not much beyond the lowest energy on the way
                break
            part *= 0.5
        places, found = places + part * step, tried
    return None


def _loads(model: Model) -> Floats:
    """Dead loads (N+1, 3) N on the nodes of a line: weight, full buoyancy, forces at its ends."""
    loads = dead_loads(model.line)
    force = model.ends.at_time(np.inf).force
    loads[0] += force[0]
    loads[-1] += force[1]
    return loads
