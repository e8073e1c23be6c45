"""The functions of the Python package `moordyn`, computed by hybrid: `import hybrid.couple.moordyn as moordyn`.

A script that creates a system from an input file of MoorDyn, steps it, and reads forces, positions and tensions runs
after this one changed import.  What differs: the start is an equilibrium, not the end of a relaxation; a step is
implicit, so that dtM means nothing and a coupling step is divided only above `SetDt` (0.05 s unless it is called);
wrong uses raise ValueError in words.  Functions that have no meaning here are not there (docs/coupling.md lists them).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, nan
from typing import Any

import numpy as np

from hybrid.errors import Complaint, SceneError
from hybrid.interop.moordyn.all_lines import JOINTS, scene_of_lines
from hybrid.interop.moordyn.deck import Deck, read_deck
from hybrid.interop.moordyn.rows import read_source
from hybrid.interop.moordyn.tables import chain_of, rotation_of
from hybrid.kernels.state.state import Floats
from hybrid.model.bodies import frame_of
from hybrid.scene.analysis import CatenaryModel
from hybrid.scene.ends import Fairlead
from hybrid.scene.read import read_text
from hybrid.simulation.stepped import CableState
from hybrid.simulation.stepped_points import PointState
from hybrid.simulation.stepping import Simulation

LONGEST_STEP = 0.05  # s
DURATION = 1e7  # s, for which a system may be stepped
# Types of points by their numbers in MoorDyn's API.
POINT_TYPE_FREE = 0
POINT_TYPE_FIXED = 1
POINT_TYPE_COUPLED = -1
BODY_TYPE_COUPLED = -1
_TYPES = {"free": POINT_TYPE_FREE, "coupled": POINT_TYPE_COUPLED}
# Of a step: how far the clock of the caller may be from ours.
CLOCK = 1e-6


def _unloaded(position: Floats, velocity: Floats) -> PointState:
    """A point that no line pulls at."""
    return PointState(position, velocity, np.zeros(3), np.zeros(3), np.full((3, 3), nan))


class MoorDynBody:
    """A coupled body: moved by the caller, with the points on it."""

    def __init__(self, id: int, place: Sequence[float], points: dict[str, Floats]) -> None:
        """points: places (3,) m in axes of the body, by name in the scene."""
        self.id, self.points = id, points
        self.r, self.v = np.array(place, float), np.zeros(6)  # m, rad and m/s, rad/s, after the last step

    def point_motions(self, r: Floats, v: Floats) -> dict[str, tuple[Floats, Floats]]:
        """Places and velocities of its points where the body is at r (m, rad) and moves with v (m/s, rad/s)."""
        frame, spin = frame_of_angles(r[3:]), spin_of_rates(r[3:], v[3:])
        arms = {name: frame @ place for name, place in self.points.items()}
        return {name: (r[:3] + arm, v[:3] + np.cross(spin, arm)) for name, arm in arms.items()}


class MoorDynPoint:
    """A point of a system."""

    def __init__(self, system: MoorDyn, id: int, name: str) -> None:
        self.system, self.id, self.name = system, id, name


class MoorDynLine:
    """A line of a system: nodes `first` to `last` of a line of the scene, from its end A."""

    def __init__(self, system: MoorDyn, id: int, name: str, first: int, last: int) -> None:
        self.system, self.id, self.name, self.first, self.last = system, id, name, first, last

    def node(self, i: int) -> int:
        """Node of the scene's line for node i from end A."""
        count = abs(self.last - self.first)
        if isinstance(i, bool) or not (isinstance(i, int | np.integer) and 0 <= i <= count):
            raise ValueError(f"i: expected a node from 0 to {count}, found {i!r}")
        return self.first + i if self.last >= self.first else self.first - i


class MoorDyn:
    """A system, made by `Create`, ready after `Init`."""

    def __init__(self, path: str) -> None:
        self.deck: Deck = read_deck(read_source(path), needs_lines=False)
        self.simulation: Simulation | PlacesAlone | None = None
        self.dt, self.origin, self.closed = LONGEST_STEP, inf, False
        self._refuse_loads()
        if not self.deck.lines:
            self._without_lines()
            return
        made = scene_of_lines(self.deck)
        self.text, self.notes = made.text, made.notes
        self.scene: Any = read_text(self.text)[0]
        scene = self.scene
        names = {
            id: f"body{p.on}" if f"body{p.on}" in scene.points else f"point{id}" for id, p in self.deck.points.items()
        }
        self.points = [MoorDynPoint(self, id, names[id]) for id in sorted(names)]
        fairleads = {name: p for name, p in scene.points.items() if isinstance(p, Fairlead)}
        self.bodies = []
        for id, b in sorted(self.deck.bodies.items()):
            if b.kind == "coupled":
                own = {name: np.array(p.place) for name, p in fairleads.items() if p.body == f"body{id}"}
                self.bodies.append(MoorDynBody(id, [*b.place, *np.radians(b.angles)], own))
        self.coupled = [
            x.name for x in self.points if self.deck.points[x.id].kind == "coupled" and x.name in scene.points
        ]
        self.lines = [self._line(id) for id in sorted(self.deck.lines)]

    def _refuse_loads(self) -> None:
        """Forces on what the caller moves are those of the lines: nothing there may have a weight of its own."""
        moved = {id for id, body in self.deck.bodies.items() if body.kind == "coupled"}
        rows = [b.row for id, b in self.deck.bodies.items() if id in moved and b.has_loads]
        rows += [
            p.row
            for p in self.deck.points.values()
            if p.has_loads and (p.kind == "coupled" or (p.kind == "body" and p.on in moved))
        ]
        bending = [line for line in self.deck.lines.values() if self.deck.types[line.type].ei > 0.0]
        clamps = {id for line in bending for kind, id, _ in line.ends if kind == "rod"}
        for id, rod in self.deck.rods.items():
            carried = rod.kind == "body" and rod.on in moved
            if rod.kind.startswith("coupled") or (carried and (rod.segments or id in clamps)):
                rows.append(rod.row)
        expected = (
            "no mass, volume or drag on what the caller moves, and no rod that is coupled, has length or holds a line "
            "that bends; its force is that of the lines"
        )
        fix = "write 0 there, or a point, and count the weight, lift and drag in the program that calls"
        if rows:
            raise SceneError([Complaint("left out", r.shown, expected, fix, r.line) for r in rows], self.deck.file)

    def _without_lines(self) -> None:
        """A deck of points alone, that are held or on bodies that the caller moves."""
        deck, self.scene, self.text, self.notes = self.deck, None, "", ()
        loose = [b.row for b in deck.bodies.values() if b.kind != "coupled"]
        loose += [p.row for p in deck.points.values() if p.kind == "free"]
        if loose or deck.rods:
            row = (loose or [x.row for x in deck.rods.values()])[0]
            fix = "add the lines that hold it"
            raise SceneError(
                [Complaint("left out", " ".join(row.cells), "coupled bodies, held points", fix, row.line)], deck.file
            )
        self.points = [MoorDynPoint(self, id, f"point{id}") for id in sorted(deck.points)]
        self.bodies = []
        for id, b in sorted(deck.bodies.items()):
            own = {f"point{k}": np.array(p.place) for k, p in deck.points.items() if p.on == id}
            self.bodies.append(MoorDynBody(id, [*b.place, *np.radians(b.angles)], own))
        self.coupled = [x.name for x in self.points if deck.points[x.id].kind == "coupled"]
        self.lines = []

    def first_places(self) -> dict[str, tuple[Floats, Floats]]:
        """Where the points of a deck without lines are, at rest."""
        still = np.zeros(6)
        found = {x.name: (np.array(self.deck.points[x.id].place), still[:3]) for x in self.points}
        for body in self.bodies:
            found |= body.point_motions(body.r, still)
        return found

    def _line(self, id: int) -> MoorDynLine:
        chain = chain_of(self.deck, id, JOINTS)
        first = 0
        for line, turned in chain:
            last = first + line.segments
            if line.id == id:
                name = "line" + "+".join(str(x.id) for x, _ in chain)
                return MoorDynLine(self, id, name, *((last, first) if turned else (first, last)))
            first = last
        raise AssertionError(id)

    @property
    def freedoms(self) -> int:
        """Numbers of `x`: six of each coupled body, then three of each coupled point."""
        return 6 * len(self.bodies) + 3 * len(self.coupled)

    @property
    def running(self) -> Simulation | PlacesAlone:
        """The simulation; ValueError before `Init` and after `Close`."""
        if self.simulation is None:
            raise ValueError("the system is not running: call Init first, and nothing after Close")
        return self.simulation

    def numbers(self, x: Sequence[float], name: str) -> Floats:
        """A list of `freedoms` finite numbers."""
        try:
            found = np.array(x, float).ravel()
        except (TypeError, ValueError):
            raise ValueError(f"{name}: expected {self.freedoms} numbers, found {x!r:.60}") from None
        if found.size != self.freedoms or not np.isfinite(found).all():
            raise ValueError(f"{name}: expected {self.freedoms} finite numbers (NCoupledDOF), found {x!r:.60}")
        return found

    def places(self, x: Floats, v: Floats) -> dict[str, tuple[Floats, Floats]]:
        """Places and velocities of all points that the caller moves."""
        out: dict[str, tuple[Floats, Floats]] = {}
        for k, body in enumerate(self.bodies):
            out |= body.point_motions(x[6 * k : 6 * k + 6], v[6 * k : 6 * k + 6])
        first = 6 * len(self.bodies)
        for k, name in enumerate(self.coupled):
            at = slice(first + 3 * k, first + 3 * k + 3)
            out[name] = x[at], v[at]
        return out

    def note(self, x: Floats, v: Floats) -> None:
        """Where coupled bodies are now, and how fast."""
        for k, body in enumerate(self.bodies):
            body.r, body.v = x[6 * k : 6 * k + 6].copy(), v[6 * k : 6 * k + 6].copy()

    def point(self, name: str) -> PointState:
        """A point now; before `Init` where the deck has it, at rest, without force."""
        if self.scene is not None and name not in self.scene.points:
            raise ValueError(f"{name}: expected a point that holds a line; others have no place in the scene")
        if self.simulation is None and self.origin == inf and not self.closed:
            place = self.first_places()[name][0] if self.scene is None else self.scene.first_place(name)
            return _unloaded(np.array(place, float), np.zeros(3))
        return self.running.point(name)

    def forces(self, x: Floats) -> list[float]:
        """Forces (and moments about the origin of bodies) of the lines on what the caller moves."""
        out: list[float] = []
        for k, body in enumerate(self.bodies):
            pulls = [self.running.point(name) for name in body.points]
            force = sum((p.force for p in pulls), np.zeros(3))
            moment = sum((np.cross(p.position - x[6 * k : 6 * k + 3], p.force) for p in pulls), np.zeros(3))
            out += [*force.tolist(), *moment.tolist()]
        for name in self.coupled:
            out += self.running.point(name).force.tolist()
        return out


# --- the functions of the package ------------------------------------------------------------------


class DeckRefused(SceneError, RuntimeError):
    """An input file that cannot be one scene, in its lines; a RuntimeError as scripts for MoorDyn expect it."""


def Create(filepath: str = "") -> MoorDyn:
    """A system from an input file of MoorDyn, Mooring/lines.txt if none is named.

    DeckRefused, a SceneError and a RuntimeError: the file cannot be read, or cannot be one scene.
    """
    try:
        return MoorDyn(filepath or "Mooring/lines.txt")
    except SceneError as error:
        raise DeckRefused(error.complaints, error.file) from None
    except (OSError, TypeError) as error:
        asked = Complaint("filepath", f"{filepath!r:.200}", "an input file of MoorDyn", "check the path")
        raise DeckRefused([asked]) from error


def Init(instance: MoorDyn, x: Sequence[float] = (), v: Sequence[float] = ()) -> int:
    """Find the equilibrium with coupled points and bodies at x (m, rad); v: their velocities (m/s, rad/s)."""
    if instance.simulation is not None:
        raise ValueError("the system is running already: Close it, or Create another")
    first, speed = instance.numbers(x, "x"), instance.numbers(v, "v")
    places = instance.places(first, speed)
    instance.note(first, speed)
    if instance.scene is None:
        instance.simulation = PlacesAlone(instance.first_places() | places)
        return 0
    data = instance.scene.model_dump(exclude_none=True)
    for name, (place, _) in places.items():
        data["points"][name] = {"kind": "fixed", "position": place.tolist()}
    for body in instance.bodies:  # its points are what the caller moves
        data["bodies"].pop(f"body{body.id}", None)
    for name, line in instance.scene.lines.items():
        if isinstance(line.chosen_model, CatenaryModel):  # it may go slack, as in MoorDyn
            data["lines"][name]["model"] = {"kind": "catenary", "slack": "warn"}
    data["time"] = {"duration": DURATION, "step": instance.dt}
    data["output"] = data.get("output", {}) | {"every": DURATION}
    instance.simulation = Simulation(data)
    return 0


def Step(instance: MoorDyn, x: Sequence[float], v: Sequence[float], t: float, dt: float) -> list[float]:
    """From t to t + dt (s) with coupled points and bodies at x, which go on with v; the forces on them then.

    x, v: as of `Init`, at the time t; the first t is where the clock begins.
    """
    running, begin, speed = instance.running, instance.numbers(x, "x"), instance.numbers(v, "v")
    if not (_is_number(t) and _is_number(dt) and dt > 0.0):
        raise ValueError(f"t, dt: expected a time and a step > 0, in s, found {t!r:.60}, {dt!r:.60}")
    if instance.origin == inf:
        instance.origin = t - running.t
    if abs(t - instance.origin - running.t) > CLOCK * dt:
        raise ValueError(f"t: expected {instance.origin + running.t:.9g} s, where the last step ended, found {t:.9g}")
    end = begin + dt * speed
    for name, (place, velocity) in instance.places(end, speed).items():
        running.set_point(name, place, velocity)
    running.advance(t - instance.origin + dt)
    instance.note(end, speed)
    return instance.forces(end)


def Close(instance: MoorDyn) -> int:
    """The system is over."""
    instance.running.close()
    instance.simulation, instance.closed = None, True
    return 0


def NCoupledDOF(instance: MoorDyn) -> int:
    """Numbers of `x` and `v`."""
    return instance.freedoms


def GetDt(instance: MoorDyn) -> float:
    """The longest step, s."""
    return instance.dt


def SetDt(instance: MoorDyn, dt: float) -> None:
    """The longest step, s; before `Init`."""
    if instance.simulation is not None or not (_is_number(dt) and dt > 0.0):
        raise ValueError(f"dt: expected a number > 0, in s, before Init; found {dt!r:.60}")
    instance.dt = float(dt)


def GetNumberLines(instance: MoorDyn) -> int:
    return len(instance.lines)


def GetNumberPoints(instance: MoorDyn) -> int:
    return len(instance.points)


def GetLine(instance: MoorDyn, line: int) -> MoorDynLine:
    """Line number `line`, from 1."""
    return instance.lines[_number(line, len(instance.lines), "line")]


def GetPoint(instance: MoorDyn, point: int) -> MoorDynPoint:
    """Point number `point`, from 1."""
    return instance.points[_number(point, len(instance.points), "point")]


def GetNumberBodies(instance: MoorDyn) -> int:
    """Coupled bodies; others are read from the result of a scene."""
    return len(instance.bodies)


def GetBody(instance: MoorDyn, body: int) -> MoorDynBody:
    """Coupled body number `body`, from 1."""
    return instance.bodies[_number(body, len(instance.bodies), "body")]


def GetBodyID(instance: MoorDynBody) -> int:
    return instance.id


def GetBodyType(instance: MoorDynBody) -> int:
    """BODY_TYPE_COUPLED: there are no others."""
    return BODY_TYPE_COUPLED


def GetBodyState(instance: MoorDynBody) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Place (m, rad) and velocity (m/s, rad/s), six numbers each; before `Init` as the deck has them."""
    return tuple(instance.r.tolist()), tuple(instance.v.tolist())


def GetLineID(instance: MoorDynLine) -> int:
    return instance.id


def GetPointID(instance: MoorDynPoint) -> int:
    return instance.id


def GetPointType(instance: MoorDynPoint) -> int:
    """POINT_TYPE_FREE, _FIXED or _COUPLED; a point on a body is fixed."""
    return _TYPES.get(instance.system.deck.points[instance.id].kind, POINT_TYPE_FIXED)


def GetPointPos(instance: MoorDynPoint) -> tuple[float, ...]:
    """Position, m."""
    return tuple(instance.system.point(instance.name).position.tolist())


def GetPointVel(instance: MoorDynPoint) -> tuple[float, ...]:
    """Velocity, m/s."""
    return tuple(instance.system.point(instance.name).velocity.tolist())


def GetPointForce(instance: MoorDynPoint) -> tuple[float, ...]:
    """Force of its lines on it, N."""
    return tuple(instance.system.point(instance.name).force.tolist())


def GetLineN(instance: MoorDynLine) -> int:
    """Number of segments."""
    return abs(instance.last - instance.first)


def GetLineNumberNodes(instance: MoorDynLine) -> int:
    return GetLineN(instance) + 1


def GetLineUnstretchedLength(instance: MoorDynLine) -> float:
    """Unstretched length, m."""
    s = instance.system.running.line(instance.name).s
    return float(abs(s[instance.last] - s[instance.first]))


def GetLineNodePos(instance: MoorDynLine, i: int) -> tuple[float, ...]:
    """Position of node i from end A, m."""
    return tuple(instance.system.running.line(instance.name).position[instance.node(i)].tolist())


def GetLineNodeVel(instance: MoorDynLine, i: int) -> tuple[float, ...]:
    """Velocity of node i from end A, m/s."""
    return tuple(instance.system.running.line(instance.name).velocity[instance.node(i)].tolist())


def GetLineNodeTen(instance: MoorDynLine, i: int) -> tuple[float, ...]:
    """Tension at node i from end A, as a vector towards end B, N: that of the segments beside it."""
    state, node = instance.system.running.line(instance.name), instance.node(i)
    chord = np.diff(state.position, axis=0)[max(node - 1, 0) : node + 1]
    pull = (state.tension[max(node - 1, 0) : node + 1, None] * chord / np.linalg.norm(chord, axis=1)[:, None]).mean(
        axis=0
    )
    return tuple((pull if instance.last >= instance.first else -pull).tolist())


def GetLineFairTen(instance: MoorDynLine) -> float:
    """Tension at end B, N."""
    return float(np.linalg.norm(GetLineNodeTen(instance, GetLineN(instance))))


def GetLineMaxTen(instance: MoorDynLine) -> float:
    """Largest tension of the nodes of the line, N."""
    return max(float(np.linalg.norm(GetLineNodeTen(instance, i))) for i in range(GetLineN(instance) + 1))


def GetFASTtens(instance: MoorDyn, n_lines: int) -> tuple[list[float], ...]:
    """Of each line the horizontal and the vertical tension at end B, then at end A, N."""
    if isinstance(n_lines, bool) or not isinstance(n_lines, int | np.integer) or n_lines != len(instance.lines):
        raise ValueError(f"n_lines: expected {len(instance.lines)}, found {n_lines!r:.60}")
    out: tuple[list[float], ...] = ([], [], [], [])
    for line in instance.lines:
        for k, node in ((0, GetLineN(line)), (2, 0)):
            x, y, z = GetLineNodeTen(line, node)
            out[k].append(float(np.hypot(x, y)))
            out[k + 1].append(abs(z))
    return out


def _is_number(x: object) -> bool:
    """Whether x is a finite number."""
    return isinstance(x, int | float | np.integer | np.floating) and not isinstance(x, bool) and bool(np.isfinite(x))


def _number(k: int, count: int, name: str) -> int:
    if isinstance(k, bool) or not (isinstance(k, int | np.integer) and 1 <= k <= count):
        among = f"a number from 1 to {count}" if count else f"no call, because the deck has no {name}"
        raise ValueError(f"{name}: expected {among}, found {k!r:.60}")
    return k - 1


# --- names of older versions -----------------------------------------------------------------------

GetConnection, GetNumberConnections = GetPoint, GetNumberPoints
GetConnectID, GetConnectType, GetConnectPos = GetPointID, GetPointType, GetPointPos
GetConnectVel, GetConnectForce = GetPointVel, GetPointForce


# Where what the caller of `hybrid.couple.moordyn` moves is: turned bodies, and decks that have no lines at all.


def frame_of_angles(angles: Floats) -> Floats:
    """Axes (3, 3) of a body at angles (rad) as MoorDyn has them: about x, then the turned y, then the turned z."""
    x, y, z = np.degrees(angles).tolist()
    return frame_of(rotation_of((x, y, z)))


def spin_of_rates(angles: Floats, rates: Floats) -> Floats:
    """Angular velocity (3,) 1/s of a body at angles (rad) that change at rates (rad/s).

    MoorDyn takes the rates for it, which is the same for one angle and for small ones.
    """
    one = np.zeros(3)
    one[0] = angles[0]
    two = one.copy()
    two[1] = angles[1]
    about_y, about_z = frame_of_angles(one)[:, 1], frame_of_angles(two)[:, 2]
    return np.asarray(rates[0] * np.array([1.0, 0.0, 0.0]) + rates[1] * about_y + rates[2] * about_z)


class PlacesAlone:
    """A deck without lines in motion: points are where they are put, and nothing pulls at them."""

    def __init__(self, places: dict[str, tuple[Floats, Floats]]) -> None:
        """places: position and velocity (3,) of all points, by name."""
        self.t, self._places = 0.0, dict(places)

    def set_point(self, name: str, position: Floats, velocity: Floats) -> None:
        self._places[name] = np.array(position), np.array(velocity)

    def advance(self, until: float) -> None:
        self.t = until

    def point(self, name: str) -> PointState:
        position, velocity = self._places[name]
        return _unloaded(position, velocity)

    def line(self, name: str) -> CableState:
        raise ValueError(f"line {name}: the deck has none")

    def close(self) -> None:
        self._places.clear()
