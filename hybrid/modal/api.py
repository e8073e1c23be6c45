"""`hybrid.modes`: natural periods and shapes of a scene about its equilibrium under full loads."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from hybrid.accuracy.api import first_at_rest
from hybrid.errors import Complaint, SceneError
from hybrid.kernels.algebra.block_elimination import SIZE
from hybrid.kernels.junctions.bodies import FRAME, MASS, V
from hybrid.kernels.state.state import Floats
from hybrid.linear.eigen import Eigen, lowest_modes
from hybrid.linear.matrices import LinearLine, LinearNetwork, linear_network
from hybrid.linear.touching import Rest, rest_of
from hybrid.modal.validity import name_of, obstacle_of
from hybrid.model.payout import payout_of
from hybrid.scene.base import Table
from hybrid.scene.motion_tables import Harmonic
from hybrid.scene.read import SceneLike, as_scene
from hybrid.scene.root import Scene

MOST = 200  # modes that may be asked for
# A motion whose w^2 is below this part of that of the first other mode costs nothing.
COSTS_NOTHING = 1e-8
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

    network: LinearNetwork
    eigen: Eigen
    points: tuple[str, ...]
    bodies: tuple[str, ...]
    axes: tuple[tuple[Floats, Floats], ...]  # of each body: axes (3, 3), and its mass matrix (6, 6) in these
    touched: tuple[str, ...]  # obstacles and bodies that lines lie on
    together: tuple[str, ...]  # lines that touch each other, or themselves
    sheaves: tuple[str, ...]  # which lines turn
    tips: Mapping[tuple[str, int], str]  # as of `Rest`


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
    squares = fine.eigen.squares
    costly = squares > COSTS_NOTHING * max(float(np.abs(squares).max()), 1e-300)
    unstable = squares < -COSTS_NOTHING * float(np.abs(squares).max())
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
    return Modes(
        asked.title, tuple(found), {x.name: x.line.s.copy() for x in lines}, {x.name: x.r.copy() for x in lines},
        whole, sum(x.line.h.size for x in lines), tuple(notes),
    )  # fmt: skip


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
    eigen = lowest_modes(network, count, None if near is None else 2.0 * math.pi / near)
    axes = tuple(
        (row[FRAME:V].reshape(3, 3), numbers[MASS : MASS + 36].reshape(6, 6))
        for row, numbers in zip(rest.states.bodies, rest.solver.bodies, strict=True)
    )
    touches, names = network.touching.touches, rest.models[0].sea.names
    touched = tuple(dict.fromkeys(obstacle_of(x, rest) for x in touches if x.obstacle))
    together = tuple(dict.fromkeys(name_of(x, rest) for x in touches if not x.obstacle))
    sheaves = tuple(names[k] for k in network.touching.sheaves)
    return _ModesOnMesh(network, eigen, rest.points, rest.bodies, axes, touched, together, sheaves, rest.tips)


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
        turns = vector[first - len(found.sheaves) : first].tolist()
        self.sheaves = dict(zip(found.sheaves, turns, strict=True))
        self.points = dict(zip(found.points, points.reshape(-1, 3), strict=True))
        self.bodies = dict(zip(found.bodies, bodies.reshape(-1, 6), strict=True))
        self.vector = vector

    def mode(self, error: float | None) -> Mode:
        """The mode; error: of w, as a part of it."""
        period = 2.0 * math.pi / math.sqrt(self.square)
        shifts = {name: x[:, 1:4] for name, x in self.parts.items()}
        largest = max(float(np.abs(x).max(initial=0.0)) for x in [*shifts.values(), *self.bodies.values()])
        twists = {x.name: self.parts[x.name][:-1, 4] for x in self.found.network.lines if x.line.spin.any()}
        if not largest > 1e-9 * max([float(np.abs(x).max(initial=0.0)) for x in twists.values()], default=0.0):
            largest = max(float(np.abs(x).max()) for x in twists.values())  # twist alone: its largest turn is 1 rad
        largest = self._sign(shifts) * largest
        energy = self.energy
        network = self.found.network
        factor = network.unit_shifts().T @ (network.mass @ self.vector)
        return Mode(
            period, None if error is None else error * period, self.what, energy, factor**2,
            {k: x / largest for k, x in shifts.items()}, {k: x / largest for k, x in twists.items()},
            {k: x / largest for k, x in self.points.items()}, {k: x / largest for k, x in self.bodies.items()},
            {k: x / largest for k, x in self.sheaves.items()},
        )  # fmt: skip

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
                if point := self.found.tips.get((x.name, k)):
                    mass = mass - carried
                    out[point] = float(part.ravel() @ (carried @ part.ravel()))
            for word, moved in _directions(x, part).items():
                out[name + word] = float(moved.ravel() @ (mass @ moved.ravel()))
        first = network.size - 3 * network.points - 6 * network.bodies
        for kind, begin, size, names in (
            ("sheave", first - len(self.sheaves), 1, self.found.sheaves),
            ("point", first, 3, self.found.points),
            ("body", first + 3 * network.points, 6, self.found.bodies),
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
        frame, mass = self.found.axes[self.found.bodies.index(body)]
        own = np.concatenate([frame.T @ self.bodies[body][:3], frame.T @ self.bodies[body][3:]])
        return f", {MOTIONS[int((mass.diagonal() * own**2).argmax())]}"

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
    return [f"{who} paid out: all of this is of its first length, to which it does not return" for who in whose]


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
    for name in found.touched:
        yield f"contact with {name} stays as it is at rest: swings that lift the line off have other periods"
    for name in found.together:
        yield f"contact of {name} stays as it is at rest: swings that part what touches have other periods"


def _meetings(asked: Scene, found: list[Mode]) -> Iterator[str]:
    """Periods of the scene that meet those of modes."""
    for where, period in excitations(asked):
        near = [k for k, mode in enumerate(found, start=1) if abs(mode.period / period - 1.0) < MEETS]
        if near:
            names = ", ".join(f"{k} ({found[k - 1].period:.4g} s)" for k in near)
            yield f"{where} has a period of {period:.4g} s, near that of mode{'s' * (len(near) > 1)} {names}"


def excitations(asked: Scene) -> list[tuple[str, float]]:
    """What moves in a scene with a period: key and period, s."""
    out = [(where, x.period) for where, x in _harmonics(asked.written, "")]
    fluid = asked.environment.fluid
    if fluid is not None and fluid.waves is not None:
        out.append(("environment.fluid.waves", fluid.waves.main_period))
    return out


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
