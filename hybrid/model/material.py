"""What a scene's cable is made of, per metre: everything a line needs to know, whatever its mesh and its zones.

Properties are constant on pieces between the ends of sections and of modules; floats, clumps
and end bodies sit at points.  `hybrid.model.line` puts a Material on nodes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from hybrid.kernels.laws.axial_law import BY_STIFFNESS, EXPONENTIAL, LINEAR, QUADRATIC
from hybrid.kernels.mesh.remesh import OF_POINTS, PER_LENGTH
from hybrid.kernels.state.report import (
    ADDED_MASS,
    BODIES,
    DRAG,
    FLOW,
    MASS_DAMPING,
    STIFFNESS_DAMPING,
    SURFACE,
    VORTICES,
    WAVES,
)
from hybrid.kernels.state.state import Floats
from hybrid.model.sections import (
    attached,
    attachments_at,
    bending_stiffness,
    mean_compliance,
    merged_sections,
    pressing,
    rotary_inertia,
    swivels,
    torsional_stiffness,
)
from hybrid.scene.attachments import BendRestrictor, BendStiffener, Modules, Spread
from hybrid.scene.cable import Section, Vortices
from hybrid.scene.schema import LineScene
from hybrid.scene.section_laws import Curve, Layer, slopes, stiffened

# The tension below which bending counts as much as tension, in (EI w^2)^(1/3): there a cable bends under its weight as
# much as its tension straightens it.  A cable without weight or stiffness has a least one, as a part of the scale.
TENSION_FLOOR, LEAST_TENSION = 0.2, 1e-6

# Pieces of a bend stiffener whose mesh nobody knows yet: least cells over its length, at fineness 1.
STIFFENER_CELLS = 20
LOCKED = 100.0  # bending stiffness of a restrictor that is locked, over that of the cable
# Of its height, from which on the added mass of a body without mass counts in full.
LEAST_DRAUGHT = 0.05
# Weight over mass, N/kg, of a cable that floats or has no weight: a thousandth of what it has on land.
LEAST_WEIGHT = 9.81e-3
SMALLEST_BODY = 0.01  # m, over which a body without volume and drag passes through the surface
OF_SECTIONS = ("mass", "ck", "rotary", "polar")  # per length, whatever else a scene asks for
POINT = tuple(name for name in OF_POINTS if name not in ("point_lift", "footing"))


class StretchLaw(NamedTuple):
    """How a piece stretches whose tension is no multiple of strain (kernels.laws.axial_law)."""

    rows: tuple[tuple[float, float], ...]  # strain and tension, N, at rest
    dynamic: tuple[float, float, float]  # dynamic stiffness, N, what it gains by mean tension, relaxation time, s; or 0
    working: tuple[float, float, float, float]  # shape of working curves, k1, k2, highest tension before, N; or 0
    creep: tuple[float, float] = (0.0, 1.0)  # strain in a tenfold time, and the time under load before, s


@dataclass
class Material:
    """A cable per metre.  K pieces, P points; SI units; material axes (a1, a2, tangent) for B and kappa."""

    bounds: Floats  # (K+1,) m, arc lengths between which everything is constant; in stiffeners, of cells
    edges: Floats  # (E,) m, those inside at which a node must lie: where sections, modules and stiffeners begin and end
    mass: Floats  # (K,) kg/m, with modules
    weight: Floats  # (K,) N/m, downwards, less the buoyancy that does not depend on the surface
    ck: Floats  # (K,) 1/N
    max_strain: Floats  # (K,) strain that is borne; infinite where nothing stretches
    B: Floats  # (K, 3) N m2: two bending stiffnesses, torsion
    kappa: Floats  # (K, 3) 1/m, curvatures and twist without stress
    rotary: Floats  # (K,) kg m
    polar: Floats  # (K,) kg m
    damp: Floats  # (K,) kg/s per m
    tau: Floats  # (K,) s
    drag_n: Floats  # (K,) kg/m2: rho/2 D Cn
    drag_t: Floats  # (K,) kg/m2: rho/2 pi D Ct
    added_n: Floats  # (K,) kg/m
    added_t: Floats  # (K,) kg/m
    buoy: Floats  # (K,) N/m, buoyancy that depends on the surface
    displaced: Floats  # (K,) kg/m
    diameter: Floats  # (K,) m, of the displaced volume
    outer_diameter: Floats  # (K,) m, as given for the sections; 0 where none is
    bits: int  # optional forces that are on wherever the line is; rods may ask for more
    swivels: Floats  # arc lengths at which both sides turn freely against each other
    held_tangent: tuple[bool, bool]  # whether an element sits at the ends of a rod
    held_twist: tuple[bool, bool]  # and resists twist
    springs: tuple[float, float]  # N m/rad, angular springs between held tangents and a rod; infinite: rigid
    hinged: tuple[bool, bool]  # whether a rod has no moment at an end, whatever its loads
    at: Floats  # (P,) m, where points are
    lift: Floats  # (P,) N, constant force upwards of each
    footing: Floats  # (P,) m, cable that presses on the seabed as much as each; empty without a seabed
    points: dict[str, Floats] = field(default_factory=dict)  # POINT -> (P,)
    curves: list[StretchLaw | None] | None = (
        None  # (K,) of pieces whose tension is no multiple of strain; None: no such
    )
    # (K, 6) lift per length (kg/m2: rho/2 D Cv), diameter (m), three frequencies (-), ramp (s); empty: no vortices
    vortices: Floats = field(default_factory=lambda: np.zeros((0, 6)))
    # m, over which phases of vortices begin once round; infinite: those of a line that is paid out are in its state
    around: float = np.inf
    bends: list[Curve | None] | None = None  # (K,) tables of moment over curvature; None: there are none
    tension_torque: Floats = field(default_factory=lambda: np.zeros(0))  # (K,) N m per N; empty: none anywhere
    rubs: bool = False  # whether friction with itself or other lines may turn it about its axis
    sections_turn: bool = False  # whether sections are given an inertia, which rods that come and go have too
    # (K,) of pieces, of each layer that slips: stiffness, N m2, slip moment, N m, what this and that gain by tension
    # (kernels.laws.bending_law; of one that is elastic the moment is below 0)
    layers: list[tuple[tuple[float, float, float, float], ...]] = field(default_factory=list)

    @property
    def passes_torque(self) -> bool:
        """Whether both ends hold the twist, and nothing between them lets it go."""
        return all(self.held_twist) and all(self.held_tangent) and not self.swivels.size

    @property
    def mean_bending(self) -> Floats:
        """(K,) N m2, mean EI of both axes, of a table its steepest, of layers while they stick.

        For models that do not know how a section lies, or how far it bends (catenaries, criteria).
        """
        layers = [sum(x[0] for x in row if x[1] >= 0.0) for row in self.layers]
        stuck = np.array(layers) if any(layers) else 0.0
        return self._of_tables(max, self.mean_initial_bending) + stuck

    @property
    def kinks_count(self) -> str:
        """What the line has by which kinks of joints count as bends (kernels.watch.sides); "": nothing."""
        if any(self.bends or ()):
            return "tables of moment"
        if self.layered:
            return "layers that slip"
        if self.kappa.any():
            return "intrinsic curvature"
        return "" if self.B.all() else "sections without bending or torsional stiffness"

    @cached_property
    def hinges(self) -> Floats:
        """(2 + K, 3) of each end where the curvature of a rod fades to nothing: EI, N m2, and how far from the end, m.

        EI 0 where an end bends the line, and where a catenary cannot know what a rod would do: bent without stress, or
        differently in two directions.  Behind them of each stretch of one stiffness EI, where it ends, m, and GJ; zeros
        where `kinks_count`.
        """
        last = np.append(np.diff(self.B, axis=0).any(axis=1), True) if not self.kinks_count else np.zeros(0, bool)
        found, EI = np.zeros((2 + max(int(last.sum()), 1), 3)), self.mean_bending
        if last.size:
            found[2:] = np.column_stack([self.mean_initial_bending, self.bounds[1:], self.B[:, 2]])[last]
        for k, (hinged, order) in enumerate(zip(self.hinged, (1, -1), strict=True)):
            if hinged and not self.kappa[-k, :2].any() and self.B[-k, 0] == self.B[-k, 1]:
                same = np.flatnonzero(EI[::order] != EI[-k])
                lengths = np.diff(self.bounds)[::order]
                found[k, :2] = EI[-k], lengths[: same[0] if same.size else lengths.size].sum()
        return found

    @property
    def mean_initial_bending(self) -> Floats:
        """(K,) N m2, mean EI of both axes without bend."""
        return np.asarray(self.B[:, :2].mean(axis=1))

    @property
    def weakest_bending(self) -> Floats:
        """(K,) N m2, EI about the weaker axis, of a table its flattest.

        With it a line bends over the shortest length, which a mesh has to resolve.
        """
        return self._of_tables(min, np.asarray(self.B[:, :2].min(axis=1)))

    def _of_tables(self, choose: Callable[[list[float]], float], plain: Floats) -> Floats:
        """The chosen one of a table's stiffnesses (K,) N m2; `plain` where there is none."""
        if self.bends is None:
            return plain
        return np.array(
            [x if rows is None else choose(slopes(rows)) for rows, x in zip(self.bends, plain, strict=True)]
        )

    @property
    def submerged_weight(self) -> Floats:
        """(K,) N/m, downwards, with all of its volume under the surface; in air where there is no fluid."""
        return np.asarray(self.weight - np.where(np.isnan(self.buoy), 0.0, self.buoy))

    def bending_length(self, least: Floats | float) -> Floats:
        """(K,) m, (EI/w)^(1/3): over it a cable without tension bends under its weight; w at least `least` N/m."""
        return np.asarray(np.cbrt(self.weakest_bending / np.maximum(np.abs(self.submerged_weight), least)))

    def meet(self, a: int, b: int) -> bool:
        """Whether one of two pieces has a table of moment over curvature, and the other two bending stiffnesses."""
        bends, B = self.bends or [None] * self.mass.size, self.B
        return any(bends[x] is not None and bends[y] is None and B[y, 0] != B[y, 1] for x, y in ((a, b), (b, a)))

    @property
    def layered(self) -> bool:
        """Whether its elements have layers, that slip or are elastic."""
        return any(self.layers) or any(self.meet(k, k + 1) for k in range(self.mass.size - 1))

    def piece(self, s: Floats) -> np.ndarray:
        """Piece that each of the arc lengths s (m) lies in."""
        return np.searchsorted(self.bounds[1:-1], s)

    @property
    def cuts(self) -> list[float]:
        """Arc lengths at which a node must lie."""
        return sorted({*self.edges.tolist(), *self.at[(self.at > 0.0) & (self.at < self.bounds[-1])].tolist()})


def nodes_at(places: Floats, s: Floats) -> np.ndarray:
    """Of nodes at s (N+1,) m, those at places (P,) m where there is one but for round-off."""
    return np.searchsorted(s, places - 1e-9 * s[-1])


def tension_floor(EI: Floats, w: Floats, scale: float) -> Floats:
    """Tension, N, below which a cable of bending stiffness EI (N m2) and submerged weight w (N/m) is no catenary.

    scale: tension scale of the scene, N.
    """
    return np.asarray(np.maximum(TENSION_FLOOR * np.cbrt(EI * w**2), LEAST_TENSION * scale))


def material(scene: LineScene, nodes: Floats | None = None) -> Material:
    """The cable of a scene; nodes: (N+1,) m, of the mesh, whose cells are the pieces of stiffeners."""
    sections = merged_sections(scene.cable.sections)
    ends = np.concatenate([[0.0], np.cumsum([x.length for x in sections])])
    length, near = float(ends[-1]), 1e-9 * float(ends[-1])
    modules, restrictors = attached(scene, Modules), attached(scene, BendRestrictor)
    edges = _apart([*ends.tolist(), *(x for m in attached(scene, Spread) for x in m.range)], length, near)
    pieces = (x for m in attached(scene, BendStiffener) for x in _pieces_of(m, nodes, length))
    bounds = _apart([*edges, *pieces], length, near)
    middle = 0.5 * (np.array(bounds[:-1]) + np.array(bounds[1:]))
    of = [sections[int(i)] for i in np.clip(np.searchsorted(ends, middle) - 1, 0, len(sections) - 1)]
    out = _bare(scene, np.array(bounds), of)
    out.edges, out.around = np.array(edges[1:-1]), length
    for m in modules:
        on = (middle > m.range[0]) & (middle < m.range[1])
        out.mass[on] += m.mass
        out.weight[on] += m.mass * scene.environment.gravity
    _stiffen(out, scene, middle)
    out.layers = [x.slip_layers for x in of]
    for k in (k for k, x in enumerate(of) if x.anisotropic):  # a table is the same about any axis
        out.layers[k] += _locks(restrictors, of[k], float(middle[k]))
    if any(x.elastic_table for x in of) or (restrictors and not all(x.anisotropic for x in of)):
        out.bends = _bending_tables(out, restrictors, of, middle)
    if scene.environment.fluid is not None:
        _wetted(out, scene, of, middle)
    _points(out, scene)
    return out


def _apart(places: list[float], length: float, near: float) -> list[float]:
    """Arc lengths from 0 to the length, rising, of which no two are nearer to each other than `near`, all in m."""
    found = [0.0]
    for x in sorted(min(x, length) for x in places):
        if x - found[-1] > near:
            found.append(x)
    found[-1] = length
    return found


def _pieces_of(stiffener: BendStiffener, nodes: Floats | None, length: float) -> list[float]:
    """Arc lengths, m, between which its stiffness is taken as constant: the nodes of the mesh, or even parts."""
    a, b = (min(x, length) for x in stiffener.range)
    x: Floats = np.linspace(a, b, STIFFENER_CELLS + 1) if nodes is None else nodes
    return [float(s) for s in x[(x > a) & (x < b)]]


def _stiffen(out: Material, scene: LineScene, middle: Floats) -> None:
    """Bending stiffness, mass and rotary inertia of stiffeners on pieces with their middles (K,) m."""
    for x in attached(scene, BendStiffener):
        for k in np.flatnonzero((middle > x.range[0]) & (middle < x.range[1])):
            s, density = float(middle[k]), x.density or 0.0
            out.B[k, :2] += x.stiffness(_stiff_at(x, out.bounds[k], out.bounds[k + 1]))
            out.mass[k] += density * x.area(s)
            out.weight[k] += density * x.area(s) * scene.environment.gravity
            if out.polar[k] > 0.0:  # the section has an inertia of its own
                out.rotary[k] += density * x.second_moment(s)
                out.polar[k] += 2.0 * density * x.second_moment(s)


def _bending_tables(
    out: Material, restrictors: list[BendRestrictor], of: list[Section], middle: Floats
) -> list[Curve | None]:
    """Tables of moment over curvature (K,) with what stiffeners add, and what locks beyond a curvature."""
    found: list[Curve | None] = []
    for section, EI, s in zip(of, out.mean_initial_bending, middle, strict=True):
        own = float(np.mean(section.initial_bending or (0.0, 0.0)))
        rows = section.elastic_table
        if rows is not None and own < EI:
            rows = stiffened(rows, 0.0, float(EI) - own)
        for x in restrictors:
            if x.range[0] < s < x.range[1] and not section.anisotropic:
                rows = rows or ((0.0, 0.0), (1.0 / x.radius, float(EI) / x.radius))
                rows = stiffened(rows, 1.0 / x.radius, _locked(x, section))
        found.append(rows)
    return found


def _locks(restrictors: list[BendRestrictor], section: Section, s: float) -> tuple[Layer, ...]:
    """Elastic layers of the restrictors at arc length s, m."""
    here = (x for x in restrictors if x.range[0] < s < x.range[1])
    return tuple(elastic_layer(1.0 / x.radius, _locked(x, section)) for x in here)


def _locked(x: BendRestrictor, section: Section) -> float:
    """Bending stiffness, N m2, that a restrictor adds when it is locked."""
    return x.locked_stiffness or LOCKED * float(np.mean(section.initial_bending or (0.0, 0.0)))


def elastic_layer(beyond: float, stiffness: float) -> Layer:
    """A bending stiffness, N m2, more from a curvature on, 1/m."""
    return stiffness, -abs(stiffness) * beyond, 0.0, 0.0


def _stiff_at(stiffener: BendStiffener, a: float, b: float) -> float:
    """Arc length, m, whose stiffness a piece [a, b] has: its middle, or the end of the stiffener if that is its own.

    The largest bend is that of a clamp, where half a cell has all of it: with the stiffness in the middle of the cell
    it would be of first order in the cells; what the cell turns by is off by the square of its length.
    """
    low, high = stiffener.range
    near = 1e-6 * (b - a)
    if a <= low + near < b < high - near:
        return low
    return high if low + near < a and b >= high - near else 0.5 * (a + b)


_FORMS = {"linear": LINEAR, "quadratic": QUADRATIC, "exponential": EXPONENTIAL}


def stretch_law(section: Section) -> StretchLaw | None:
    """The law of a section whose tension is no multiple of strain; None: of one whose tension is."""
    given = section.dynamic_stiffness
    dynamic = (given.constant, given.per_tension, given.relaxation_time) if given is not None else (0.0, 0.0, 0.0)
    working = (0.0, 0.0, 0.0, 0.0)
    if section.syrope is not None:
        x = section.syrope
        form = BY_STIFFNESS if x.by_stiffness else _FORMS[x.working]
        working = (form, x.k1, x.k2 or 0.0, x.highest_tension)
    creep = (section.creep.per_decade, section.creep.loaded) if section.creep is not None else (0.0, 1.0)
    return StretchLaw(section.curve, dynamic, working, creep) if section.curve else None


def _bare(scene: LineScene, bounds: Floats, of: list[Section]) -> Material:
    """The cable without its water and its attachments."""
    k, gravity = len(of), scene.environment.gravity
    unasked: dict[str, Any] = {name: np.full(k, np.nan) for name in PER_LENGTH if name not in OF_SECTIONS}
    unasked |= {name: np.zeros(0) for name in ("at", "lift", "footing")} | {"bits": 0}
    start, end = scene.ends.both
    out = Material(
        bounds=bounds,
        edges=bounds[1:-1],
        mass=np.array([x.mass for x in of], float),
        weight=np.array([x.mass * gravity for x in of], float),
        ck=np.array([mean_compliance(x) for x in of]),
        max_strain=np.array([x.strain_limit if x.stiffness else np.inf for x in of]),
        B=np.array([[*bending_stiffness(x), torsional_stiffness(x)] for x in of], float),
        kappa=np.array([x.intrinsic_curvature or (0.0, 0.0, 0.0) for x in of], float),
        rotary=np.array([rotary_inertia(x)[0] for x in of]),
        polar=np.array([rotary_inertia(x)[1] for x in of]),
        **unasked,
        swivels=np.array(swivels(scene), float),
        outer_diameter=np.array([x.diameter or 0.0 for x in of]),
        held_tangent=(start.held_tangent is not None, end.held_tangent is not None),
        held_twist=(start.holds_twist, end.holds_twist),
        springs=(start.spring, end.spring),
        hinged=(not start.acts_by_moment, not end.acts_by_moment),
        points={name: np.zeros(0) for name in POINT},
    )
    out.sections_turn, out.rubs = any(x.turns for x in of), scene.contact.rubs
    if any(x.curve for x in of):
        out.curves = [stretch_law(x) for x in of]
    if any(x.tension_torque for x in of):
        out.tension_torque = np.array([x.tension_torque or 0.0 for x in of])
    if any(x.damped.mass for x in of):
        out.bits |= MASS_DAMPING
        out.damp = np.array([x.mass * x.damped.mass for x in of])
    if any(x.damped.stiffness for x in of):
        out.bits |= STIFFNESS_DAMPING
        out.tau = np.array([x.damped.stiffness for x in of], float)
    return out


def _wetted(out: Material, scene: LineScene, of: list[Section], middle: Floats) -> None:
    """Buoyancy, drag, added mass, pressure of waves, with what modules add."""
    fluid, gravity = scene.environment.fluid, scene.environment.gravity
    assert fluid is not None
    rho = fluid.density
    width = out.outer_diameter.copy()
    volume, area, extra = 0.25 * np.pi * width**2, np.zeros(len(of)), np.zeros(len(of))
    for x in attached(scene, BendStiffener):
        for k in np.flatnonzero((middle > x.range[0]) & (middle < x.range[1])):
            width[k] = max(width[k], x.outer(float(middle[k])))
            volume[k] += x.area(float(middle[k])) if x.density is not None else 0.0
    disc = 0.25 * np.pi * width**2
    for m in attached(scene, Modules):
        on = (middle > m.range[0]) & (middle < m.range[1])
        volume[on] += m.volume_in(rho, gravity)
        area[on] += m.drag_area
        extra[on] += m.added_mass
    if any(x.drag for x in of) or area.any():
        out.bits |= DRAG
        out.drag_n = 0.5 * rho * (width * np.array([x.drag.normal if x.drag else 0.0 for x in of]) + area)
        out.drag_t = 0.5 * rho * np.pi * width * np.array([x.drag.tangential if x.drag else 0.0 for x in of])
    if any(x.added_mass for x in of) or extra.any():
        out.bits |= ADDED_MASS
        out.added_n = rho * disc * np.array([x.added_mass.normal if x.added_mass else 0.0 for x in of]) + extra
        out.added_t = rho * disc * np.array([x.added_mass.tangential if x.added_mass else 0.0 for x in of])
    if any(x.vortices for x in of):
        out.bits |= VORTICES
        out.vortices = np.array([_lift(x.vortices, rho, float(D)) for x, D in zip(of, width, strict=True)])
    if fluid.current is not None:
        out.bits |= FLOW
    if fluid.waves is not None:
        out.bits |= WAVES
        out.displaced = rho * volume
    if fluid.surface is not None:
        out.bits |= SURFACE
        out.buoy = rho * gravity * volume
        out.diameter = np.sqrt(4.0 / np.pi * volume)
    else:
        out.weight = out.weight - rho * gravity * volume


def _lift(given: Vortices | None, density: float, diameter: float) -> tuple[float, ...]:
    """A row of `Material.vortices`."""
    if given is None:
        return (0.0,) * 6
    return 0.5 * density * diameter * given.lift, diameter, given.center, given.low, given.high, given.ramp


def _points(out: Material, scene: LineScene) -> None:
    """Floats, clumps and end bodies; bodies at one place are one."""
    fluid, gravity = scene.environment.fluid, scene.environment.gravity
    rho = fluid.density if fluid else 0.0
    everything, length = list(attachments_at(scene)), scene.length
    at: list[float] = []
    for x in sorted(s for s, _ in everything):
        if not at or x - at[-1] > 1e-9 * length:
            at.append(min(x, length))
    out.at = np.array(at)
    out.lift = np.zeros(len(at))
    out.points = {name: np.zeros(len(at)) for name in POINT}
    if fluid is not None:  # of those at one place the one that displaces most has the height and the shape
        everything.sort(key=lambda x: (x[1].volume_in(rho, gravity), x[1].height_in(rho, gravity), x[1].shape))
    for x, body in everything:
        i = np.searchsorted(out.at, x, "right") - 1
        out.points["point_mass"][i] += body.mass
        out.lift[i] -= gravity * body.mass
        if fluid is None:
            continue
        displaced = rho * body.volume_in(rho, gravity)
        out.points["point_drag"][i] += 0.5 * rho * body.drag_area
        out.points["point_added"][i] += body.added_mass
        out.points["point_displaced"][i] += displaced
        if fluid.surface is None:
            out.lift[i] += gravity * displaced
        else:
            out.points["point_buoy"][i] += gravity * displaced
            height = body.height_in(rho, gravity) or 2.0 * np.sqrt(body.drag_area / np.pi) or SMALLEST_BODY
            out.points["point_height"][i] = height
            out.points["point_upright"][i] = float(body.shape == "cylinder")
    floats = out.points["point_mass"] / np.maximum(out.points["point_displaced"], 1e-30)
    out.points["point_floats"] = np.clip(floats, LEAST_DRAUGHT, 1.0)
    if scene.environment.seabed is not None:
        sinks = -(out.lift + out.points["point_buoy"])
        out.footing = np.maximum(sinks, 0.0) / pressing(scene)
    asked = ["point_drag", "point_added", "point_buoy"] + (["point_displaced"] if out.bits & WAVES else [])
    if any(out.points[name].any() for name in asked):
        out.bits |= BODIES
