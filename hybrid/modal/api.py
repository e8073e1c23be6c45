"""Natural modes and responses of a scene about its equilibrium.

`hybrid.modes` has natural periods and shapes under full loads; `hybrid.response` standard deviations, spectra and
extremes in a stationary sea.  At every frequency of the scene's waves and motions

    (A - w^2 M - i w C) q = f,      C = C_0 + C_d,

with the matrices of the modes, the damping C_0 of the sections and the bed, and drag C_d that is linear in the mean
square, found by iteration (hybrid.linear.response_results).  docs/theory.md, 21.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse

from hybrid.accuracy.passes import first_at_rest, run
from hybrid.errors import Complaint, ComputationError, Outcome, SceneError
from hybrid.kernels.algebra.block_elimination import SIZE
from hybrid.kernels.junctions.bodies import DAMPING, FRAME, MASS, PLACE, V
from hybrid.kernels.state.state import Floats
from hybrid.linear.eigen import Eigen, lowest_modes, round_off
from hybrid.linear.loaded_line import (
    LoadedLine,
    LoadedMembers,
    frequencies_of,
    loaded_lines,
    refuse_motions,
    turning_doubts,
)
from hybrid.linear.matrices import (
    ComplexSolver,
    LinearLine,
    LinearNetwork,
    damping_by_turns,
    in_inertial_axes,
    in_last,
    linear_network,
    stiffness_by_water,
)
from hybrid.linear.response_results import LineResponse, Response
from hybrid.linear.touching import Rest, rest_of
from hybrid.modal.validity import closing_doubts, doubts_of, left_out, name_of, obstacle_of, touching_doubts
from hybrid.model.payout import payout_of
from hybrid.scene.base import Table
from hybrid.scene.combinations import refuse_use
from hybrid.scene.ends import Failure
from hybrid.scene.motion_tables import Harmonic
from hybrid.scene.read import SceneLike, as_scene
from hybrid.scene.root import Scene

MOST = 200  # modes that may be asked for
# Shapes on two meshes are of the same mode where their common part is at least this, of frequencies this near.
SAME_SHAPE, NEAR = 0.8, 0.3
PLACES = 101  # of each line, at which shapes are compared
# Error of a frequency by that on cells twice as long: a third for an error of second order, and a fifth more of that,
# because edges of contact and layers at clamps converge more slowly.
OF_DIFFERENCE = 0.4
# A period of the scene is near one of a mode within this part.
MEETS = 0.1
# Part of a mode's stiffness that no potential has, beyond which it is told.
UNSYMMETRIC = 0.01
MOTIONS = ("surge", "sway", "heave", "roll", "pitch", "yaw")
VERTICAL = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Mode:
    """One natural vibration about the equilibrium.

    period: s; error: of the period, s, by a mesh of half the cells, None: not known.  what: in words, by where most of
    the kinetic energy is, of which `energy` has the parts.  mass: (3,) kg, effective masses along x, y, z.
    The shape, in the scale that its largest shift is 1 m: shifts (N+1, 3) m and twists (N,) rad by the name of a line,
    points (3,) m, bodies (6,) m and rad, sheaves that lines turn rad by name.
    """

    period: float
    error: float | None
    what: str
    energy: Mapping[str, float]
    mass: Floats
    shifts: Mapping[str, Floats]
    twists: Mapping[str, Floats]
    points: Mapping[str, Floats] = field(default_factory=dict)
    bodies: Mapping[str, Floats] = field(default_factory=dict)
    sheaves: Mapping[str, float] = field(default_factory=dict)

    @property
    def frequency(self) -> float:
        """Hz."""
        return 1.0 / self.period


@dataclass(frozen=True)
class Modes:
    """Modes of a scene, the longest periods first.

    s (N+1,) m and position (N+1, 3) m of the equilibrium by the name of a line (`cable` of a scene of one);
    mass: kg, all that can move, added mass along x, y and z included; cells: of all lines; notes: what is to be known.
    """

    title: str
    modes: tuple[Mode, ...]
    s: Mapping[str, Floats]
    position: Mapping[str, Floats]
    mass: Floats
    cells: int
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _ModesOnMesh:
    """A network on one mesh, and its modes."""

    rest: Rest
    network: LinearNetwork
    eigen: Eigen


def modes(scene: SceneLike, count: int = 10, near: float | None = None, friction: bool = True) -> Modes:
    """Natural modes about the equilibrium under full loads: the longest periods, or those nearest to `near` (s).

    Drag and damping are left out; contact with the bed, obstacles, bodies and lines is as it is in the equilibrium.
    friction: whether that of these holds what lies there, elastically, as before a line slides; else it has none, and
    lines turn no sheaves.  Errors are those of
    the mesh, by one of half the cells.  SceneError: the scene is refused; ComputationError: it has no equilibrium, or
    nothing can move.
    """
    asked = as_scene(scene)
    _check(count, near)
    count = int(count)
    fine, coarse = (_modes_on_mesh(asked, cells, count, near, friction) for cells in (1.0, 2.0))
    squares, nothing = fine.eigen.squares, round_off(fine.network, fine.eigen)
    costly, unstable = squares > nothing, squares < -nothing
    chosen = np.flatnonzero(costly)
    if near is not None:
        w = 2.0 * math.pi / near
        chosen = np.sort(chosen[np.argsort(np.abs(np.sqrt(squares[chosen]) - w))[:count]])
    chosen = chosen[:count]
    shapes = [_Shape(fine, int(k)) for k in chosen]
    found = [x.mode(_error(fine, coarse, int(k))) for k, x in zip(chosen, shapes, strict=True)]
    free = [_Shape(fine, int(k)).what for k in np.flatnonzero(~costly & ~unstable)]
    notes = [*of_first_length(asked), *_doubts(fine, int(unstable.sum()), free, chosen), *_meetings(asked, found)]
    lines = fine.network.lines
    shift = fine.network.unit_shifts()
    whole = np.einsum("ij,ij->j", shift, fine.network.mass @ shift)
    along, places = {x.name: x.line.s.copy() for x in lines}, {x.name: x.r.copy() for x in lines}
    cells = sum(x.line.h.size for x in lines)
    return Modes(asked.title, tuple(found), along, places, whole, cells, tuple(notes))


def _check(count: int, near: float | None) -> None:
    if not 1 <= count <= MOST or count != int(count):
        raise SceneError([Complaint("modes", str(count), f"a number of modes from 1 to {MOST}", "--count 10")])
    if near is not None and not 0.0 < near < math.inf:
        raise SceneError([Complaint("modes", f"{near:g}", "a period > 0, in s", "--near 8")])


def _modes_on_mesh(asked: Scene, cells: float, count: int, near: float | None, sticks: bool) -> _ModesOnMesh:
    """Modes on the usual mesh (cells 1), or on one whose cells are so many times as long.

    They are more than `count`: what nothing holds is told apart from them, such as lines that turn about their axis.
    """
    rest = equilibrium_of(asked, cells, sticks)
    network = linear_network(rest.solver, rest.states, rest.names, sticks, touching=rest.touching)
    count += 2 + len(rest.names) + 3 * network.bodies
    return _ModesOnMesh(rest, network, lowest_modes(network, count, None if near is None else 2.0 * math.pi / near))


def equilibrium_of(asked: Scene, cells: float = 1.0, friction: bool = True) -> Rest:
    """The equilibrium on the usual mesh, or on one whose cells are so many times as long.

    friction: whether that settles where the scene says nothing of it.  SceneError: the scene is refused;
    ComputationError: there is no equilibrium.
    """
    scene, resolution = first_at_rest(asked if friction else asked.without_friction())
    return rest_of(scene, resolution.coarser(cells) if cells > 1.0 else resolution)


class _Shape:
    """One eigenvector, spread over lines, points and bodies."""

    def __init__(self, found: _ModesOnMesh, k: int) -> None:
        network, vector = found.network, found.eigen.vectors[:, k]
        self.found, self.square = found, float(found.eigen.squares[k])
        whole = np.asarray(network.place @ vector)
        self.parts = {
            x.name: whole[a:b].reshape(-1, SIZE)
            for x, a, b in zip(network.lines, network.at[:-1], network.at[1:], strict=True)
        }
        first = network.size - 3 * network.points - 6 * network.bodies
        points, bodies = vector[first : first + 3 * network.points], vector[first + 3 * network.points :]
        sheaves = [found.rest.models[0].sea.names[k] for k in network.touching.sheaves]
        self.sheaves = dict(zip(sheaves, vector[first - len(sheaves) : first].tolist(), strict=True))
        self.points = dict(zip(found.rest.points, points.reshape(-1, 3), strict=True))
        self.bodies = dict(zip(found.rest.bodies, bodies.reshape(-1, 6), strict=True))
        self.vector = vector

    def mode(self, error: float | None) -> Mode:
        """The mode; error: of w, as a part of it."""
        period = 2.0 * math.pi / math.sqrt(self.square)
        shifts = {name: x[:, 1:4] for name, x in self.parts.items()}
        moves = [*shifts.values(), *(x.reshape(2, 3) for x in self.bodies.values())]
        largest = max(float(np.linalg.norm(x, axis=1).max(initial=0.0)) for x in moves)
        twists = {x.name: self.parts[x.name][:-1, 4] for x in self.found.network.lines if x.line.spin.any()}
        if not largest > 1e-9 * max([float(np.abs(x).max(initial=0.0)) for x in twists.values()], default=0.0):
            largest = max(float(np.abs(x).max()) for x in twists.values())  # twist alone: its largest turn is 1 rad
        largest = self._sign(shifts) * largest
        energy = self.energy
        network = self.found.network
        factor = network.unit_shifts().T @ (network.mass @ self.vector)
        off = None if error is None else error * period
        parts = ({k: x / largest for k, x in each.items()} for each in (shifts, twists, self.points, self.bodies))
        shifts, twists, points, bodies = parts
        sheaves = {k: x / largest for k, x in self.sheaves.items()}
        return Mode(period, off, self.what, energy, factor**2, shifts, twists, points, bodies, sheaves)

    def _sign(self, shifts: Mapping[str, Floats]) -> float:
        """So that the largest component of the largest shift is positive, and mirrored scenes have mirrored shapes."""
        every = np.concatenate([x.ravel() for x in shifts.values()] or [np.zeros(1)])
        return -1.0 if every[int(np.abs(every).argmax())] < 0.0 else 1.0

    @cached_property
    def energy(self) -> dict[str, float]:
        """Parts of the kinetic energy by what moves, those beyond 1 %; what stands at a joined end is of its point."""
        out: dict[str, float] = {}
        several = len(self.parts) > 1
        network = self.found.network
        for x in network.lines:
            part, name, mass = self.parts[x.name], f"{x.name} " if several else "", x.mass - x.standing
            for k, carried in enumerate(x.carried):
                if point := self.found.rest.tips.get((x.name, k)):
                    mass = mass - carried
                    out[point] = float(part.ravel() @ (carried @ part.ravel()))
            for word, moved in _directions(x, part).items():
                out[name + word] = float(moved.ravel() @ (mass @ moved.ravel()))
        first = network.size - 3 * network.points - 6 * network.bodies
        for kind, begin, size, names in (
            ("sheave", first - len(self.sheaves), 1, self.sheaves),
            ("point", first, 3, self.points),
            ("body", first + 3 * network.points, 6, self.bodies),
        ):
            for k, name in enumerate(names):
                alone = np.zeros(network.size)
                alone[begin + size * k : begin + size * (k + 1)] = self.vector[begin + size * k :][:size]
                out[f"{kind} {name}{self._motion(name)}"] = float(alone @ (network.apart @ alone))
        total = sum(abs(x) for x in out.values()) or 1.0
        shares = {k: abs(x) / total for k, x in out.items()}
        return dict(sorted(((k, x) for k, x in shares.items() if x > 0.01), key=lambda item: -item[1]))

    def _motion(self, body: str) -> str:
        """The motion of a body in which most of its energy is, along and about its own axes; "": of a point."""
        if body not in self.bodies:
            return ""
        k, rest = [*self.bodies].index(body), self.found.rest
        frame, mass = rest.states.bodies[k, FRAME:V].reshape(3, 3), rest.solver.bodies[k, MASS : MASS + 36]
        own = np.concatenate([frame.T @ self.bodies[body][:3], frame.T @ self.bodies[body][3:]])
        return f", {MOTIONS[int((mass.reshape(6, 6).diagonal() * own**2).argmax())]}"

    @property
    def what(self) -> str:
        """What moves most, in words."""
        return next(iter(self.energy), "")


def _directions(x: LinearLine, part: Floats) -> dict[str, Floats]:
    """The movement (N+1, 5) of a line in parts: along it, in its vertical plane, sideways, and its twist."""
    t = x.t
    across = np.cross(t, VERTICAL)
    steep = np.linalg.norm(across, axis=1)
    shift, out = part[:, 1:4], {}

    def only(moved: Floats) -> Floats:
        whole = np.zeros_like(part)
        whole[:, 1:4] = moved
        return whole

    along = np.einsum("ij,ij->i", shift, t)[:, None] * t
    out["along"] = only(along)
    if float(np.median(steep)) < 1e-3:  # a line that hangs plumb has no vertical plane of its own
        out["across"] = only(shift - along)
    else:
        mean = across.sum(axis=0)
        side = np.where(steep[:, None] > 1e-3, across / np.maximum(steep, 1e-300)[:, None], mean)
        side = side - np.einsum("ij,ij->i", side, t)[:, None] * t
        side /= np.maximum(np.linalg.norm(side, axis=1), 1e-300)[:, None]
        aside = np.einsum("ij,ij->i", shift, side)[:, None] * side
        out["sideways"], out["in its vertical plane"] = only(aside), only(shift - along - aside)
    if x.line.spin.any():
        out["twist"] = np.zeros_like(part)
        out["twist"][:, 4] = part[:, 4]
    return out


# --- how wrong it may be ------------------------------------------------------------------------


def _places(found: _ModesOnMesh, k: int) -> Floats:
    """A mode at places that are the same on any mesh, scaled by the root of the moving mass.

    Of every line, point and body; its product with another mode is about that over the masses.
    """
    shape, rows = _Shape(found, k), []
    for x in found.network.lines:
        part, s = shape.parts[x.name], x.line.s
        at = np.linspace(0.0, float(s[-1]), PLACES)
        moving = float(np.einsum("ij,ij->", part, ((x.mass - x.standing) @ part.ravel()).reshape(part.shape)))
        here = np.column_stack([np.interp(at, s, part[:, 1 + c]) for c in range(3)])
        middle = 0.5 * (s[1:] + s[:-1])
        turning = math.sqrt(float(np.nansum(x.line.polar)) / max(float(x.line.mass.sum()), 1e-300))
        here = np.column_stack([here, turning * np.interp(at, middle, part[:-1, 4])])
        rows.append(math.sqrt(abs(moving)) * here.ravel() / max(float(np.linalg.norm(here)), 1e-300))
    first = found.network.size - 3 * found.network.points - 6 * found.network.bodies
    rows.append(np.sqrt(np.maximum(found.network.apart.diagonal()[first:], 0.0)) * shape.vector[first:])
    return np.concatenate(rows)


def _error(fine: _ModesOnMesh, coarse: _ModesOnMesh, k: int) -> float | None:
    """Error of w as a part of it, by the same mode on half the cells; None: there is none alike."""
    w = math.sqrt(fine.eigen.squares[k])
    shape = _places(fine, k)
    parts, values = [], []
    for j, square in enumerate(coarse.eigen.squares):
        if square <= 0.0 or abs(math.sqrt(square) - w) > NEAR * w:
            continue
        other = _places(coarse, j)
        parts.append(float(shape @ other) ** 2 / max(float(shape @ shape) * float(other @ other), 1e-300))
        values.append(math.sqrt(square))
    if sum(parts) < SAME_SHAPE:
        return None
    return OF_DIFFERENCE * abs(float(np.average(values, weights=parts)) - w) / w


# --- what is to be known ------------------------------------------------------------------------


def of_first_length(asked: Scene) -> list[str]:
    """What is to be known of a line that is paid out."""
    paid = [name for name in asked.asked_lines if payout_of(asked.asked_scene(name))]
    whose = [f"line {name} is" if name else "the line is" for name in paid]
    found = [f"{who} paid out: all of this is of its first length, to which it does not return" for who in whose]
    for name, end, failure in _failures(asked):
        if failure.time is not None:
            of = f" of line {name}" if len(asked.lines) > 1 else ""
            found.append(f"the {end}{of} is let go at {failure.time:g} s: all of this is of before")
    return found


def _failures(asked: Scene) -> Iterator[tuple[str, str, Failure]]:
    """Ends of lines that are let go, by themselves or with the point that holds them: the line, its end, and when."""
    for name, line in asked.lines.items():
        for end in ("start", "end"):
            point = getattr(asked.points[getattr(line, end)], "break_at", None)
            for given in (line.break_at if asked.breaks(name, end) else None, point):
                if given is not None:
                    yield name, end, given


def _breaks(asked: Scene, lines: Mapping[str, LineResponse]) -> Iterator[str]:
    """Ends that are let go by a force which their tension reaches in the time of `most_probable`."""
    for name, end, failure in _failures(asked):
        line, k = lines[name], 0 if end == "start" else -1
        most = line.mean_tension[k] + line.most_probable("tension")[k]
        if failure.tension is not None and most > failure.tension:
            of = f" of line {name}" if len(asked.lines) > 1 else ""
            yield f"not valid: the {end}{of} is let go at {failure.tension:.4g} N, and {most:.4g} N are expected"


def _doubts(found: _ModesOnMesh, unstable: int, free: list[str], chosen: np.ndarray) -> Iterator[str]:
    """What limits the modes."""
    if found.eigen.missed is None:
        yield "modes were not counted: whether one is missing between those found is not verified"
    elif found.eigen.missed > 0:
        yield f"{found.eigen.missed} modes with periods between those found are missing: ask for more (count)"
    if unstable:
        yield f"the equilibrium is not stable: {unstable} motion{'s' * (unstable > 1)} would grow by itself"
    if free:
        yield f"what nothing holds has no period and is left out: {', '.join(sorted(set(free)))}"
    network, vectors = found.network, found.eigen.vectors[:, chosen]
    squares = found.eigen.squares[chosen]
    if squares.size:
        coupled = np.linalg.eigvals(np.diag(squares) + vectors.T @ (network.skew @ vectors))
        part = np.abs(np.sqrt(coupled[np.argsort(coupled.real)]) / np.sqrt(squares) - 1.0).max()
        if part > UNSYMMETRIC:
            yield (
                "the current, a moment that keeps its direction, or a stiffness that grows with tension has a part in "
                "the stiffness that no energy has; it is left out (among these modes it would change a period by up to "
                f"{100.0 * part:.2g} %)"
            )
    if any(x.line.torsion.size for x in network.lines):
        yield "twist passes through catenary zones as through a torsion spring; what their shape adds is left out"
    touches = network.touching.touches
    for name in dict.fromkeys(obstacle_of(x, found.rest) for x in touches if x.obstacle):
        yield f"contact with {name} stays as it is at rest: swings that lift the line off have other periods"
    for name in dict.fromkeys(name_of(x, found.rest) for x in touches if not x.obstacle):
        yield f"contact of {name} stays as it is at rest: swings that part what touches have other periods"


def _meetings(asked: Scene, found: list[Mode]) -> Iterator[str]:
    """Periods of the scene that meet those of modes."""
    excited, fluid = [(where, x.period) for where, x in _harmonics(asked.written, "")], asked.environment.fluid
    if fluid is not None and fluid.waves is not None:
        excited.append(("environment.fluid.waves", fluid.waves.main_period))
    for where, period in excited:
        near = [k for k, mode in enumerate(found, start=1) if abs(mode.period / period - 1.0) < MEETS]
        if near:
            names = ", ".join(f"{k} ({found[k - 1].period:.4g} s)" for k in near)
            yield f"{where} has a period of {period:.4g} s, near that of mode{'s' * (len(near) > 1)} {names}"


def _harmonics(value: object, where: str) -> Iterator[tuple[str, Harmonic]]:
    """All harmonics in the tables of a scene, with their keys."""
    if isinstance(value, Harmonic):
        yield where, value
    elif isinstance(value, Table):
        for name in type(value).model_fields:
            yield from _harmonics(getattr(value, name), f"{where}.{name}".lstrip("."))
    elif isinstance(value, Mapping):
        for name, each in value.items():
            yield from _harmonics(each, f"{where}.{name}")
    elif isinstance(value, tuple):
        for k, each in enumerate(value):
            if isinstance(each, Table):
                yield from _harmonics(each, f"{where}[{k}]")


ROUNDS = 30  # of the linear drag, at most
SETTLED = 2e-3  # relative change of its largest part at which they end
RELAXED = 0.8  # part of the change that a round makes
FEWER = 4  # of many frequencies one in so many serves for the rounds,
LEAST_FREQUENCIES = (
    12  # and at least so many: more than FEW of hybrid.linear.response_results, whose sum is no normal process
)
# Part by which a run in time may differ before that is told: short runs of a sea differ by as much.
MOST_APART = 0.15


def response(scene: SceneLike, friction: bool = True, check: float | None = None) -> Response:
    """Response to the waves and harmonic motions of a scene, stationary, linear about its equilibrium.

    Drag is linear in the mean square, found by iteration; the mean drag of the waves is left out.  friction: as of
    `hybrid.modes`.  check: s, of a run in time to compare with.

    SceneError: nothing excites it, or what does is no sum of harmonics; a load changes in time.  ComputationError: no
    equilibrium.
    """
    asked = as_scene(scene)
    refuse_use(asked.written, "response")
    rest = equilibrium_of(asked, friction=friction)
    refuse_motions(rest.models, rest.names)
    omegas = frequencies_of(rest.models, [x.members.sea.waves for x in rest.floats if x.members is not None])
    if not omegas.size:
        expected = "waves, or ends that move as harmonics"
        raise SceneError([Complaint("environment.fluid.waves", "nothing that moves", expected, "add `waves`")])
    run = _Linear(rest, omegas, friction)
    rounds = run.linearize_drag()
    lines = run.results()
    notes = [
        *of_first_length(asked),
        *run.notes(lines),
        *_breaks(asked, lines),
        *([] if rounds < ROUNDS else [f"linear drag has not settled in {ROUNDS} rounds"]),
    ]
    checks = {} if check is None else compared(asked, lines, check)
    off = {name: there for name, (here, there) in checks.items() if abs(here - there) > MOST_APART * there}
    notes += [
        f"not valid: {name} has a standard deviation of {x:.4g} in a run of {check:g} s" for name, x in off.items()
    ]
    return Response(asked.title, lines, run.points(), run.bodies(), rounds, checks, tuple(notes))


class _Linear:
    """The network in the sea."""

    def __init__(self, rest: Rest, omegas: Floats, sticks: bool) -> None:
        self.rest, self.omegas = rest, omegas
        self.network = linear_network(rest.solver, rest.states, rest.names, sticks, touching=rest.touching)
        self.lines = loaded_lines(rest, self.network, omegas)
        self.first = self.network.size - 6 * self.network.bodies  # of the unknowns of bodies
        members = [rest.floats[b].members if b < len(rest.floats) else None for b in range(self.network.bodies)]
        self.members = {
            b: LoadedMembers(rest.bodies[b], x, rest.states.bodies[b], omegas)
            for b, x in enumerate(members)
            if x is not None
        }
        self.damping = in_inertial_axes(rest.solver, rest.states, DAMPING)
        by_water = [stiffness_by_water(rest.solver, rest.states, b, x) for b, x in enumerate(members)]
        self.by_water = in_last(self.network.size, by_water)
        self.by_touch = self.network.whole.T @ self.network.touching.damping @ self.network.whole
        self.by_touch = self.by_touch + damping_by_turns(rest.solver, self.network)
        dragged = bool(self.members) or any(
            x.x.joints[k] >= 0 and x.point_drag[-k] > 0.0 for x in self.lines for k in (0, 1)
        )
        for x in self.lines:
            x.by_drag |= dragged and max(x.x.joints) >= 0
        self.loaded: list[LoadedLine | LoadedMembers] = [*self.lines, *self.members.values()]
        self.solver: ComplexSolver | None = None
        self.vectors = np.zeros((len(omegas), self.network.size), complex)

    def linearize_drag(self) -> int:
        """Iterate the linear drag, first by some of the frequencies; rounds that it took."""
        every = np.arange(len(self.omegas))
        some = every[len(every) % FEWER // 2 :: FEWER] if len(every) >= LEAST_FREQUENCIES * FEWER else every
        for x in self.loaded:
            x.blocks = x.drag_blocks(every, start=True)
        for round_ in range(1, ROUNDS + 1):
            self._solve(some)
            worst = 0.0
            for x in self.loaded:
                new = x.drag_blocks(some, start=False)
                for change, each in zip(x.kinds(new - x.blocks), x.kinds(new), strict=True):
                    size = float(np.abs(each).max(initial=0.0))
                    if size > 0.0:
                        worst = max(worst, float(np.abs(change).max()) / size)
                x.blocks = x.blocks + RELAXED * (new - x.blocks)
            if worst < SETTLED:
                if some.size == every.size:
                    return round_
                some = every  # once more, by all
        return ROUNDS

    def _solve(self, which: np.ndarray) -> None:
        """The motion at some of the frequencies, with the drag as it is."""
        P = self.network.place
        dampings = [x.full_damping() for x in self.lines]
        of_bodies = [x + self.members[b].damping() if b in self.members else x for b, x in enumerate(self.damping)]
        C = P.T @ sparse.block_diag(dampings, format="csr") @ P + self.by_touch
        C = sparse.csc_array(C + in_last(self.network.size, of_bodies))
        if self.solver is None or not self.solver.replace(2, C):
            stiffness = sparse.csc_array(self.network.stiffness + self.network.skew + self.by_water)
            self.solver = ComplexSolver([stiffness, self.network.mass, C])
        right = P.T @ np.concatenate(
            [x.loads(which, damping) for x, damping in zip(self.lines, dampings, strict=True)], axis=0
        )
        for b, members in self.members.items():
            right[self.first + 6 * b : self.first + 6 * b + 6] += members.loads(which)
        touching, held = self.network.touching, self._held(which)
        by_rates = touching.damping @ held * (-1j * self.omegas[which])
        right = right - self.network.whole.T @ (touching.stiffness @ held + by_rates)
        for column, f in enumerate(which):
            self.vectors[f] = self.answer(self.omegas[f], right[:, column])
        whole = (P @ self.vectors[which].T).T
        for x, a, b in zip(self.lines, self.network.at[:-1], self.network.at[1:], strict=True):
            x.set_motion(which, whole[:, a:b].reshape(which.size, -1, SIZE), self.vectors[which])
        for b, members in self.members.items():
            members.q[which] = self.vectors[which, self.first + 6 * b : self.first + 6 * b + 6]

    def _held(self, which: np.ndarray) -> Any:
        """(unknowns of what touches, F) m, of ends that are held and move."""
        moved = np.zeros((self.network.whole.shape[0], which.size), complex)
        for x, a, b in zip(self.lines, self.network.at[:-1], self.network.at[1:], strict=True):
            for k, at in ((0, a), (1, b - SIZE)):
                if x.x.joints[k] < 0:
                    moved[at + 1 : at + 4] = x.shifts[which, k].T
        return moved

    def answer(self, w: float, right: Any) -> Any:
        """Amplitudes (q,) of exp(-i w t) by loads (q,), with the drag as it was found last; w: 1/s."""
        assert self.solver is not None  # of the last round
        try:
            return self.solver.solve((1.0, -w * w, -1j * w), right)
        except RuntimeError:
            detail = f"at {w / (2.0 * np.pi):.4g} Hz, where nothing damps a mode"
            raise ComputationError(Outcome.SINGULAR, None, None, detail) from None

    def results(self) -> dict[str, LineResponse]:
        """Of each line, by its name."""
        found = left_out(self.network, self.lines, self.members, self.answer)
        return {x.name: each for x, each in zip(self.lines, found, strict=True)}

    def points(self) -> dict[str, Floats]:
        """Complex shifts (F, 3) m of free points."""
        first = self.network.size - 3 * self.network.points - 6 * self.network.bodies
        return {name: self.vectors[:, first + 3 * k : first + 3 * k + 3] for k, name in enumerate(self.rest.points)}

    def bodies(self) -> dict[str, Floats]:
        """Complex shifts and turns (F, 6) m, rad of free bodies."""
        first = self.first
        return {name: self.vectors[:, first + 6 * k : first + 6 * k + 6] for k, name in enumerate(self.rest.bodies)}

    def _carry_obstacles(self) -> None:
        """Let lines know how obstacles move that bodies carry."""
        moves = [self.vectors[:, self.first + 6 * b : self.first + 6 * b + 6] for b in range(self.network.bodies)]
        for x in self.lines:
            for k, b in enumerate(x.x.rides):
                if b >= 0:
                    arms = x.linear.r - self.rest.states.bodies[b, PLACE:FRAME]
                    x.carried[k] = moves[b][:, None, :3] + np.cross(moves[b][:, None, 3:], arms)

    def notes(self, found: Mapping[str, LineResponse]) -> Iterator[str]:
        """Where the motion is too large to be linear."""
        every = np.arange(len(self.omegas))
        moved = self.network.whole @ self.vectors.T + self._held(every)
        for touch in self.network.touching.touches:
            yield from (f"not valid: {text}" for text in touching_doubts(touch, name_of(touch, self.rest), moved))
        yield from (f"not valid: {text}" for text in closing_doubts(self.rest, found))
        self._carry_obstacles()
        for x in self.lines:
            name = f"line {x.name}: " if len(self.lines) > 1 else ""
            yield from (f"{name}not valid: {text}" for text in doubts_of(x, found[x.name]))
        for name, q in self.bodies().items():
            yield from (f"not valid: {text}" for text in turning_doubts(name, q))
        for members in self.members.values():
            yield from (f"not valid: {text}" for text in members.doubts())


# A response by frequency held against a run in time of the same scene.

# Part of the run that is left out, in which the motion begins, or its ramps; outputs to the shortest period of all.
BEGINS, PER_PERIOD = 0.25, 12
# Steps of a scene that names none, of that period.
STEPS = 60
CHECKED = ("tension", "curvature")


def _ramps(tables: Any) -> Iterator[float]:
    """Times, s, over which something in the tables of a scene grows."""
    for key, x in tables.items() if isinstance(tables, dict) else enumerate(tables) if isinstance(tables, list) else ():
        if key == "ramp" and x:
            yield float(x)
        yield from _ramps(x)


def compared(asked: Scene, lines: Mapping[str, LineResponse], duration: float) -> dict[str, tuple[float, float]]:
    """Standard deviations where each quantity varies most, by frequency and in a run of `duration` (s)."""
    if not 0.0 < duration < np.inf:
        raise SceneError([Complaint("check", f"{duration:g}", "a time > 0, in s", "--check 600")])
    periods = [period[period > 0.0] for x in lines.values() for period in (x.period("tension"), x.period("position"))]
    period = min(float(np.median(x)) for x in periods if x.size)
    data: dict[str, Any] = asked.model_dump(mode="json", exclude_none=True)
    time = asked.time
    step = time.step if time is not None and time.step is not None else period / STEPS
    begins = max(BEGINS * duration / (1.0 - BEGINS), *_ramps(data))
    data["time"] = {"duration": duration + begins, "step": step}
    data["output"] = {"every": period / PER_PERIOD}
    data.pop("accuracy", None)
    result: Any = run(as_scene(data))
    found = {}
    for name, line in lines.items():
        one = result.lines[name] if result.lines else result
        late = one.times > begins
        for what in CHECKED:
            deviation = line.deviation(what)
            places = line.middle if what == "tension" else line.s
            at = int(deviation.argmax())
            column = int(np.abs(one.s - places[at]).argmin())
            there = float(np.asarray(getattr(one, what))[late][:, column].std())
            here = float(np.interp(one.s[column], places, deviation))
            found[f"{name} {what}" if len(lines) > 1 else what] = (here, there)
    return found
