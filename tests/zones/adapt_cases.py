"""Cables, layouts, shapes and states for the tests of zones that move.

Shapes are functions of arc length with unit speed, so that nodes on them are exact; states on
them need not be in balance: remapping and criteria ask for none.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from problems import Scene, free, pinned, scene, straight

from hybrid.kernels.machine.binding import Table
from hybrid.kernels.mesh.zone_plan import OFF, make_plan
from hybrid.kernels.mesh.zone_step import blank_zone_job, plan_nodes
from hybrid.kernels.mesh.zone_transfer import Transfer, blank_match, transfer
from hybrid.kernels.state.state import Ends, Floats, Line, Sea, State, blank_state, memory_of, no_sea
from hybrid.model.line import line_on
from hybrid.model.material import Material, material
from hybrid.model.mesh import Layout
from hybrid.scene.read import one_line
from hybrid.simulation.remesh import states_with
from hybrid.zones.manager import Allowed, DomainManager, Times
from tests.scenes import cable_scene, clamped_at, pinned_at

Shape = Callable[[Floats], Floats]
X, Y, Z = np.eye(3)
GRAVITY = 10.0  # m/s2, of every cable here: the weight per length is ten times the mass
AXIAL = 1e5  # N


def cable(length: float = 10.0, *, start: Any = None, end: Any = None, **more: Any) -> Material:
    """A cable of 1 kg/m, EI = 2, GJ = 1.5, EA = 1e5; `more`: keys of the section, `attachments` or `sections`."""
    section = {
        "length": length, "mass": 1.0, "bending_stiffness": 2.0, "torsional_stiffness": 1.5, "axial_stiffness": AXIAL,
    }  # fmt: skip
    tables: dict[str, Any] = {"initial": straight(1, 0, 0)}
    attachments = more.pop("attachments", None)
    pieces = [section | x for x in more.pop("sections", ({},))]
    what = scene(section, start or pinned(), end or free(), gravity=GRAVITY, **tables).model_dump(exclude_none=True)
    what["cable"] = {"sections": [x | more for x in pieces]} | ({"attachments": attachments} if attachments else {})
    return material(one_line(Scene.model_validate(what)))


def layout(base: Sequence[float] | Floats, parts: int | Sequence[int], rod: Sequence[bool] | str) -> Layout:
    """Base nodes (m), rod cells per base cell, and what they are: "RC" or flags."""
    base = np.asarray(base, float)
    flags = np.array([x == "R" for x in rod] if isinstance(rod, str) else rod, bool)
    return Layout(base, np.full(base.size - 1, parts) if isinstance(parts, int) else np.asarray(parts), flags)


def even(n: int, rod: str, length: float = 10.0, parts: int = 4) -> Layout:
    return layout(np.linspace(0, length, n + 1), parts, rod)


def on(what: Material, zones: Layout, bits: int = 0) -> Line:
    return line_on(what, zones.nodes, zones.rod_cells, bits)


def state_on(line: Line, shape: Shape, tension: Shape | float = 50.0, velocity: Shape | None = None) -> State:
    """Nodes on a shape; velocity, accelerations and spin of the same kind; frames without twist."""
    out = blank_state(line.h.size)
    middle = 0.5 * (line.s[:-1] + line.s[1:])
    out.r[:] = shape(line.s)
    out.e[:] = np.diff(out.r, axis=0)
    out.T[:] = tension(middle) if callable(tension) else tension
    if velocity is not None:
        out.v[:], out.a[:], out.vd[:] = velocity(line.s), velocity(line.s + 1.0), velocity(line.s + 2.0)
        rod = line.spin == 1
        out.w[rod], out.wa[rod], out.wd[rod] = (velocity(middle[rod] + k)[:, 0] for k in range(3))
    out.a1[:] = untwisted(out.e)
    return out


def untwisted(e: Floats, first: Floats | None = None) -> Floats:
    """First directors (N, 3) carried along chords e by the smallest rotations, each as a matrix."""
    d = e / np.linalg.norm(e, axis=1)[:, None]
    a = first if first is not None else np.eye(3)[int(np.argmin(np.abs(d[0])))]
    a = a - (a @ d[0]) * d[0]
    out = [a / np.linalg.norm(a)]
    for t, u in itertools.pairwise(d):
        x, y, z = np.cross(t, u)
        K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        out.append((np.eye(3) + K + K @ K / (1.0 + t @ u)) @ out[-1])
    return np.array(out)


# --- shapes: arc length -> points, with their tangents and curvature ---------------------------------


def hanging(a: float = 4.0, at: float = 3.0) -> tuple[Shape, Shape, Shape]:
    """A catenary with its lowest point at s = at: shape, tangent, curvature a/(a^2 + s^2)."""

    def shape(s: Floats) -> Floats:
        return np.column_stack([a * np.arcsinh((s - at) / a), 0 * s, np.hypot(a, s - at)])

    def tangent(s: Floats) -> Floats:
        return np.column_stack([a / np.hypot(a, s - at), 0 * s, (s - at) / np.hypot(a, s - at)])

    return shape, tangent, lambda s: a / (a * a + (s - at) ** 2)


def helix(R: float = 2.0, b: float = 1.0) -> tuple[Shape, Shape, Shape]:
    """A helix of radius R and pitch 2 pi b: shape, tangent, curvature R/(R^2 + b^2)."""
    c = np.hypot(R, b)

    def shape(s: Floats) -> Floats:
        return np.column_stack([R * np.cos(s / c), R * np.sin(s / c), b * s / c])

    def tangent(s: Floats) -> Floats:
        return np.column_stack([-R * np.sin(s / c), R * np.cos(s / c), b + 0 * s]) / c

    return shape, tangent, lambda s: R / c**2 + 0 * s


def polygon(h: Floats, turns: Floats) -> Shape:
    """A plane polygon of cells h (N,) m that turns by turns (N-1,) rad from each to the next."""
    angle = np.concatenate([[0.0], np.cumsum(turns)])
    e = h[:, None] * np.column_stack([np.cos(angle), 0 * angle, np.sin(angle)])
    r = np.vstack([np.zeros(3), np.cumsum(e, axis=0)])
    return lambda s: r


def along(direction: Sequence[float] = (1, 0, 0)) -> Shape:
    d = np.asarray(direction, float) / np.linalg.norm(direction)
    return lambda s: s[:, None] * d


def drifting(s: Floats) -> Floats:
    """A smooth velocity."""
    return np.column_stack([np.sin(0.7 * s) + 1.0, np.cos(0.5 * s), 0.3 * np.sin(0.3 * s + 1.0)])


# --- remapping -----------------------------------------------------------------------------------------


def transfer_to(
    old: Layout, new: Layout, line: Line, target: Line, state: State, kinks: np.ndarray, shifts: bool = True,
    held: bool = False,
) -> Transfer:  # fmt: skip
    """What carries a state from one layout to another of the same base; shifts: as of `Transfer`; held: both ends."""
    out = states_with(*memory_of(target))(target.h.size, turn=np.zeros((len(target.torsion), 3)))
    ends = np.zeros((2, 2, 3)), np.array([held, held]), np.array([shifts])
    match = blank_match(line.h.size, target.h.size)
    return Transfer(line, target, state, out, old.places, new.places, old.first, kinks, *ends, match)


class Remapped(NamedTuple):
    """A state on new nodes, and the lengths (N,) m that its cells have now; their true ones are in the line."""

    state: State
    lengths: Floats


def carried(
    what: Material, old: Layout, rod: Sequence[bool] | str, state: State, line: Line | None = None, held: bool = False
) -> tuple[Layout, Line, Remapped]:
    """A state on other zones of the same base; held: both ends hold the twist of rods there."""
    new = layout(old.base, old.parts.tolist(), rod)
    target = on(what, new)
    kinks = np.zeros(old.rod.size + 1, bool)
    kinks[np.searchsorted(old.base, what.at - 1e-9 * old.base[-1])] = True
    job = transfer_to(old, new, line or on(what, old), target, state, kinks, held=held)
    transfer(Table(job).numbers)
    return new, target, Remapped(job.out, job.match.lengths)


def moved(line: Line, state: State) -> Floats:
    """Linear momentum (3,)."""
    return line.mass @ state.v


def chords(state: State) -> Floats:
    return state.e / np.linalg.norm(state.e, axis=1)[:, None]


def turns(d: Floats) -> Floats:
    """Angles (N-1,) between neighbouring chords, accurate for small ones."""
    return np.arctan2(np.linalg.norm(np.cross(d[:-1], d[1:]), axis=1), np.einsum("ij,ij->i", d[:-1], d[1:]))


def twists(state: State) -> Floats:
    """Twist (N-1,) rad from each cell to the next, by parallel transport."""
    d, a = chords(state), state.a1
    out = []
    for t, u, p, q in zip(d[:-1], d[1:], a[:-1], a[1:], strict=True):
        carried_ = p - (p @ u) / (1 + t @ u) * (t + u)
        out.append(np.arctan2(np.cross(carried_, q) @ u, carried_ @ q))
    return np.array(out)


# --- criteria ------------------------------------------------------------------------------------------


def still(frame: Floats | None = None) -> Ends:
    """Ends that are held; frame: (2, 3, 3) columns a1, a2, tangent."""
    frame = np.stack([np.column_stack([Y, Z, X])] * 2) if frame is None else frame
    zero = np.zeros((2, 3))
    return Ends(np.ones(2, np.int8), zero, frame.reshape(2, 9), zero, zero, zero)


def weighed(
    what: Material, zones: Layout, state: State, *, tolerance: float = 1e-2, ends: Ends | None = None,
    sea: Sea | None = None, bits: int = 0, before: State | None = None, dt: float = 0.0, dwell: float = 0.5,
    scale: float = 1.0, line: Line | None = None,
) -> Floats:  # fmt: skip
    """The ratios (criteria, base cells) of a state; before: the state a step dt ago."""
    manager = DomainManager(what, zones, np.zeros(zones.rod.size, int), scale, Allowed(tolerance), Times(dwell))
    line = line or on(what, zones, bits)
    sea, ends = sea or no_sea(line.h.size), ends or still()
    if before is not None:
        manager.evaluate_criteria(line, sea, ends, before, 0.0)
        manager.ratios[:] = 0.0
    manager.evaluate_criteria(line, sea, ends, state, dt)
    return manager.ratios.copy()


class Following(NamedTuple):
    """A taut line of rods whose cells follow: its manager, the table of its zones, its layout and its state."""

    manager: DomainManager
    table: Table
    zones: Layout
    state: State

    @property
    def planned(self) -> Layout:
        """With the nodes that it asks for; for five looks two cells must be too short before they become one."""
        for _ in range(5):
            plan_nodes(self.table.numbers)
        return self.zones._replace(here=self.manager.zones.plan.copy())


def followed(
    shape: Shape, share: float, *, n: int = 8, velocity: Shape | None = None, twist: Floats | None = None,
    tolerance: float = 1e-2, fineness: float = 1.0, every: int = 1,
) -> Following:  # fmt: skip
    """A line of 10 m in n base cells of 64/every cells.

    velocity: across it, m/s of s; twist: (N-1,) rad, from each cell to the next.
    """
    what, zones = cable(10.0), layout(np.linspace(0.0, 10.0, n + 1), 64, "R" * n)
    zones = zones._replace(here=np.arange(n * 64 + 1) % every == 0)
    line = on(what, zones)
    state = state_on(line, shape, 1e4)  # taut: the layer is as short as the cells
    if velocity is not None:
        state.v[:, 2] = velocity(line.s)
    if twist is not None:
        angle = np.append(0.0, np.cumsum(twist))[:, None]
        state.a1[:] = np.cos(angle) * state.a1 + np.sin(angle) * np.cross(chords(state), state.a1)
    manager = DomainManager(what, zones, np.ones(n, int), 1.0, Allowed(tolerance, share, fineness=fineness), Times(1.0))
    manager.evaluate_criteria(line, no_sea(line.h.size), still(), state, 0.0)
    manager.zones.next_rod[:] = True
    table = Table(blank_zone_job())
    table.bind(line=line, new=state, zones=manager.zones)
    return Following(manager, table, zones, state)


def bight() -> dict:
    """1000 m of tether to a vehicle 960 m below that keeps its place: the last 40 m hang slack below it."""
    section = {
        "length": 1000, "diameter": 0.025, "mass": 0.65, "axial_stiffness": 2e6, "bending_stiffness": 20,
        "drag": {"normal": 1.2, "tangential": 0.02}, "added_mass": {"normal": 1.0},
    }  # fmt: skip
    current = [{"z": z, "velocity": [u, 0, 0]} for z, u in ((0, 0.4), (-200, 0.1), (-1000, 0.05))]
    heave = {"heave": {"amplitude": 1.0, "period": 8.0}, "ramp": 16}
    return cable_scene(
        section,
        pinned_at(0, 0, 0, motion=heave),
        clamped_at([30, 0, -960], [0.3, 0, 1]),
        fluid={"density": 1025, "surface": 0, "current": current},
        time=(80.0, 0.1),
        output=(1.0, 401),
    )


class Rules(NamedTuple):
    """How zones are made of what is asked: (n,) m of rod on either side of it, least cells of a zone, and s of dwell."""

    buffer: Floats
    shortest: int
    dwell: float


def planned(ratios, rod, below_since, t, base, rules, leaving=False):
    """What base cells (n,) should be, and since when (s) each rod is below its thresholds; leaving: all are blended out."""
    below, flags = below_since.copy(), np.zeros((4, rod.size), bool)
    flags[0], wait = leaving, np.full(rod.size, rules.dwell)
    make_plan(ratios, OFF, rod, below, float(t), base, rules.buffer, rules.shortest, wait, flags)
    return flags[3], below
