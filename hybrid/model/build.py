"""From the scene to the plan: the only place where a Scene becomes arrays.

`build(scene)` decides what the scene requires, fills the line's arrays with it and
keeps a ledger: what is on and who asked for it, what is off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hybrid.errors import Complaint, SceneError
from hybrid.model.ends import EndConditions, EndLoad, Moves, first_director, transported
from hybrid.model.mesh import Zone, ZonePlan, given_nodes, place_nodes
from hybrid.model.state import Floats, Line, State, blank_state
from hybrid.physics.loads import ADDED_MASS, DRAG, FORCES, MASS_DAMPING, ROTARY, STIFFNESS_DAMPING
from hybrid.scene.motion import EndMotion
from hybrid.scene.schema import Damping, Harmonic, Scene, Section, ZonesModel

# The compliance of an inextensible cable, as a strain at the tension scale: far below any
# accuracy asked for, far above round-off of a cell's length (1e-16).
INEXTENSIBLE = 1e-9
# Poisson's ratio of a solid round section, used where a rod's torsional stiffness is not given.
POISSON = 0.3


@dataclass(frozen=True)
class Entry:
    """A line of the ledger: what, on or off, and who asked (or what would switch it on)."""

    what: str
    on: bool
    why: str


@dataclass(frozen=True)
class Model:
    """A scene made ready to compute."""

    line: Line
    zones: tuple[Zone, ...]
    ends: EndConditions
    start: State
    ledger: tuple[Entry, ...]
    length: float  # m
    tension_scale: float  # N
    slack: Literal["stop", "warn"]
    inextensible: bool

    @property
    def cells(self) -> int:
        return int(self.line.h.size)

    @property
    def time_scale(self) -> float:
        """A time typical of the scene, s: that of a transverse wave along the line at the tension scale."""
        return float(np.sqrt(self.line.mass.sum() * self.length / self.tension_scale))

    @property
    def unknowns(self) -> int:
        """Positions, tensions and spins that Newton solves for."""
        return 3 * (self.cells + 1) + self.cells + int(self.line.spin.sum())


def zone_plans(scene: Scene) -> tuple[ZonePlan, ...]:
    """The zones a scene's model stands for, in order."""
    model = scene.model
    if isinstance(model, ZonesModel):
        return tuple(
            ZonePlan("rod", z.rod, z.cells, z.ratio) if hasattr(z, "rod") else ZonePlan("catenary", z.catenary, z.cells, z.ratio)
            for z in model.zones
        )
    return (ZonePlan(model.kind, scene.length),)


def merged_sections(sections: Sequence[Section]) -> list[Section]:
    """Neighbouring sections that differ in nothing but length are one section."""
    merged: list[Section] = []
    for section in sections:
        if merged and merged[-1].model_copy(update={"length": section.length}) == section:
            merged[-1] = section.model_copy(update={"length": merged[-1].length + section.length})
        else:
            merged.append(section)
    return merged


def torsional_stiffness(section: Section) -> float:
    """GJ in N m^2; of a solid round section with the bending stiffness given where the scene is silent."""
    if section.torsional_stiffness is not None:
        return section.torsional_stiffness
    return float(np.mean(bending_stiffness(section))) / (1.0 + POISSON)


def bending_stiffness(section: Section) -> tuple[float, float]:
    b = section.bending_stiffness
    if b is None:
        return 0.0, 0.0
    return b if isinstance(b, tuple) else (b, b)


def rotary_inertia(section: Section) -> tuple[float, float]:
    """Transverse and polar inertia per length, kg m; of a solid round section where only the diameter is given."""
    given = section.rotary_inertia
    if given is None:
        return (section.mass * section.diameter**2 / 16, section.mass * section.diameter**2 / 8) if section.diameter else (0.0, 0.0)
    return given if isinstance(given, tuple) else (given, 2.0 * given)


def damping(section: Section) -> Damping:
    d = section.damping
    if d is None:
        return Damping()
    return d if isinstance(d, Damping) else Damping(mass=d)


def weight(section: Section, scene: Scene) -> float:
    """Weight in water (air, vacuum) per unstretched length, N/m, positive downwards."""
    fluid = scene.environment.fluid
    displaced = fluid.density * np.pi / 4 * section.diameter**2 if fluid and section.diameter else 0.0
    return float((section.mass - displaced) * scene.environment.gravity)


def _tension_scale(scene: Scene, sections: Sequence[Section]) -> float:
    """A tension typical of the scene (N): the largest of what weight, loads, bending, drag, motion and speed can ask for."""
    length = scene.length
    mass = sum(s.mass * s.length for s in sections)
    candidates = [sum(abs(weight(s, scene)) * s.length for s in sections)]
    candidates += [max(bending_stiffness(s)) / length**2 for s in sections]
    fluid = scene.environment.fluid
    if fluid and fluid.current:
        speed2 = float(np.dot(fluid.current, fluid.current))
        candidates += [0.5 * fluid.density * s.diameter * s.drag.normal * speed2 * s.length for s in sections if s.drag and s.diameter]
    for end in (scene.ends.start, scene.ends.end):
        for name, arm in (("force", 1.0), ("moment", length)):
            load = getattr(end, name, None)
            if load is not None:
                candidates.append(float(np.linalg.norm(getattr(load, "value", load))) / arm)
        motion = getattr(end, "motion", None)
        if motion is not None:
            parts = [getattr(motion, x) for x in ("surge", "sway", "heave")]
            candidates += [mass * abs(p.amplitude) * (2 * np.pi / p.period) ** 2 for p in parts if isinstance(p, Harmonic)]
    start, end = (getattr(e, "position", None) for e in (scene.ends.start, scene.ends.end))
    if start and end and all(s.axial_stiffness for s in sections):
        free = length / sum(s.length / s.axial_stiffness for s in sections if s.axial_stiffness)  # N per unit strain
        candidates.append(free * max(0.0, float(np.linalg.norm(np.subtract(end, start))) / length - 1.0))
    velocity = getattr(scene.initial, "velocity", None)
    if velocity:
        candidates.append(mass / length * float(np.dot(velocity, velocity)))
    scale = max(candidates)
    if scale > 0.0:
        return scale
    return mass / length * (length / scene.time.duration) ** 2 if scene.time else 1.0


def _initial_nodes(scene: Scene, s: Floats) -> Floats:
    """First positions of the nodes (N+1, 3), m."""
    start, end = (getattr(e, "position", None) for e in (scene.ends.start, scene.ends.end))
    initial, length = scene.initial, scene.length
    if initial.kind == "points":
        points = np.array(initial.points, float)
        knots = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        return np.column_stack([np.interp(s * knots[-1] / s[-1], knots, points[:, k]) for k in range(3)])
    if initial.kind == "straight":
        direction = np.array(initial.direction, float) / np.linalg.norm(initial.direction)
        origin = initial.origin or start
        first = np.array(origin, float) if origin else np.array(end, float) - length * direction
        return first + s[:, None] * direction
    guess = initial.guess
    if start and end and guess != "straight":
        return np.array(start) + (s / length)[:, None] * np.subtract(end, start)
    if initial.direction is not None:
        direction = np.array(initial.direction, float)
    else:
        tangent = getattr(scene.ends.start, "tangent", None) or getattr(scene.ends.end, "tangent", None)
        direction = np.array(tangent if tangent else (0.0, 0.0, -1.0 if start else 1.0), float)
    direction /= np.linalg.norm(direction)
    first = np.array(start, float) if start else np.array(end, float) - length * direction
    return first + s[:, None] * direction


def _corners(scene: Scene) -> list[float]:
    """Arc lengths at which the initial polyline turns."""
    if scene.initial.kind != "points":
        return []
    knots = np.cumsum(np.linalg.norm(np.diff(np.array(scene.initial.points), axis=0), axis=1))
    return [float(x) for x in knots[:-1] * scene.length / knots[-1]]


def build(scene: Scene) -> Model:
    """Make the model that a scene requires.

    Raises SceneError where the scene cannot be meshed (a rod zone of one cell, nodes
    that miss a zone boundary).
    """
    sections = merged_sections(scene.cable.sections)
    bounds = np.concatenate([[0.0], np.cumsum([x.length for x in sections])])
    plans = zone_plans(scene)
    cuts = sorted({float(x) for x in bounds[1:-1]} | set(_corners(scene)))
    mesh = scene.mesh
    if mesh is not None and mesh.nodes is not None:
        s, zones = given_nodes(mesh.nodes, plans, cuts)
    else:
        s, zones = place_nodes(plans, cuts, mesh.cells if mesh else None, mesh.ratio if mesh else None)
    h = np.diff(s)
    n = h.size
    middle = 0.5 * (s[:-1] + s[1:])
    of = [sections[int(i)] for i in np.clip(np.searchsorted(bounds, middle) - 1, 0, len(sections) - 1)]
    zone_of = np.clip(np.searchsorted([z.s_b for z in zones], middle), 0, len(zones) - 1)
    rod = np.array([zones[int(i)].kind == "rod" for i in zone_of])
    _refuse_single_rod_cells(zones, zone_of)

    def per_cell(f) -> Floats:  # type: ignore[no-untyped-def]
        return np.array([f(x) for x in of], float)

    def to_nodes(x: Floats) -> Floats:
        y = np.zeros((n + 1, *x.shape[1:]))
        y[:-1] += 0.5 * x
        y[1:] += 0.5 * x
        return y

    scale = _tension_scale(scene, sections)
    fluid = scene.environment.fluid
    bits = 0
    nothing, nothing_node = np.full(n, np.nan), np.full(n + 1, np.nan)

    area = per_cell(lambda x: np.pi / 4 * (x.diameter or 0.0) ** 2)
    drag_n = drag_t = added_n = added_t = tau = rotary = polar = nothing
    damp = nothing_node
    if fluid and any(x.drag for x in sections):
        bits |= DRAG
        drag_n = 0.25 * fluid.density * h * per_cell(lambda x: x.drag.normal * x.diameter if x.drag else 0.0)
        drag_t = 0.25 * np.pi * fluid.density * h * per_cell(lambda x: x.drag.tangential * x.diameter if x.drag else 0.0)
    if fluid and any(x.added_mass for x in sections):
        bits |= ADDED_MASS
        added_n = 0.5 * fluid.density * area * h * per_cell(lambda x: x.added_mass.normal if x.added_mass else 0.0)
        added_t = 0.5 * fluid.density * area * h * per_cell(lambda x: x.added_mass.tangential if x.added_mass else 0.0)
    if any(damping(x).mass for x in sections):
        bits |= MASS_DAMPING
        damp = to_nodes(h * per_cell(lambda x: x.mass * damping(x).mass))
    if any(damping(x).stiffness for x in sections):
        bits |= STIFFNESS_DAMPING
        tau = per_cell(lambda x: damping(x).stiffness)
    if rod.any() and any(rotary_inertia(x)[1] > 0 for x in of):
        bits |= ROTARY
        rotary = h * rod * per_cell(lambda x: rotary_inertia(x)[0])
        polar = h * rod * per_cell(lambda x: rotary_inertia(x)[1])

    compliance = per_cell(lambda x: 1.0 / x.axial_stiffness if x.axial_stiffness else 0.0)
    element, kb, k0, hn = _elements(scene, h, rod, of)
    force = np.zeros((n + 1, 3))
    force[:, 2] = -to_nodes(h * per_cell(lambda x: weight(x, scene)))
    line = Line(
        s=s, h=h, ck=np.maximum(compliance, INEXTENSIBLE / scale), mass=to_nodes(h * per_cell(lambda x: x.mass)),
        force=force, element=element, spin=rod.astype(np.int8), kb=kb, k0=k0, hn=hn, rotary=rotary, polar=polar,
        drag_n=drag_n, drag_t=drag_t, added_n=added_n, added_t=added_t, damp=damp, tau=tau,
        current=np.array(fluid.current if fluid and fluid.current else (0.0, 0.0, 0.0)), bits=bits,
    )  # fmt: skip

    start = blank_state(n)
    start.r[:] = _initial_nodes(scene, s)
    start.e[:] = np.diff(start.r, axis=0)
    if scene.initial.kind == "straight":  # exact chords: no round-off of the positions in the strain
        start.e[:] = h[:, None] * np.array(scene.initial.direction) / np.linalg.norm(scene.initial.direction)
    start.T[:] = scale
    velocity = getattr(scene.initial, "velocity", None)
    if velocity:
        start.v[:] = velocity
    ends, frames = _ends_and_frames(scene, start.e, rod)
    start.a1[:] = frames
    return Model(
        line=line, zones=zones, ends=ends, start=start,
        ledger=_ledger(scene, line, zones), length=float(s[-1]), tension_scale=scale,
        slack=getattr(scene.model, "slack", "stop"),
        inextensible=not compliance.any(),
    )  # fmt: skip


def _refuse_single_rod_cells(zones: Sequence[Zone], zone_of: np.ndarray) -> None:
    for k, zone in enumerate(zones):
        if zone.kind == "rod" and int((zone_of == k).sum()) < 2:
            raise SceneError(
                [
                    Complaint(
                        f"model.zones[{k}]",
                        f"a rod of {zone.s_b - zone.s_a:g} m with one cell",
                        "at least two cells: a rod bends at the nodes between its cells",
                        "give the zone `cells: 2` or more, or make mesh.cells larger",
                    )
                ]
            )


def _elements(
    scene: Scene, h: Floats, rod: np.ndarray, of: Sequence[Section]
) -> tuple[np.ndarray, Floats, Floats, Floats]:
    """Where elements sit, their stiffness B/hn, their strain without stress, and the length each stands for."""
    n = h.size
    B = np.array([[*bending_stiffness(x), torsional_stiffness(x)] for x in of])
    kappa = np.array([x.intrinsic_curvature or (0.0, 0.0, 0.0) for x in of], float)
    element = np.zeros(n + 1, np.int8)
    kb, k0, hn = np.zeros((n + 1, 3)), np.zeros((n + 1, 3)), np.zeros(n + 1)
    hn[:-1] += 0.5 * h
    hn[1:] += 0.5 * h
    element[1:-1] = rod[:-1] & rod[1:]
    for i in np.flatnonzero(element):
        half_a, half_b = 0.5 * h[i - 1], 0.5 * h[i]
        kb[i] = 1.0 / (half_a / B[i - 1] + half_b / B[i])  # two halves in series
        k0[i] = half_a * kappa[i - 1] + half_b * kappa[i]
    for node, cell, end in ((0, 0, scene.ends.start), (n, n - 1, scene.ends.end)):
        if rod[cell] and end.kind in ("clamped", "guided"):
            element[node] = 1
            kb[node] = B[cell] / (0.5 * h[cell])
            k0[node] = 0.5 * h[cell] * kappa[cell]
            free_to_twist = end.swivel if end.kind == "clamped" else end.normal is None
            if free_to_twist:
                kb[node, 2] = 0.0
    return element, kb, k0, hn


def _ends_and_frames(scene: Scene, e: Floats, rod: np.ndarray) -> tuple[EndConditions, Floats]:
    """End conditions, and first directors of all cells: carried without twist from the start, the closing twist spread.

    A clamp without `normal` holds the twist that the initial shape has there.
    """
    d = e / np.linalg.norm(e, axis=1)[:, None]
    start, end = scene.ends.start, scene.ends.end
    first = first_director(getattr(start, "tangent", None) or tuple(d[0]), getattr(start, "normal", None))
    tangents = np.vstack([getattr(start, "tangent", None) or d[0], d, getattr(end, "tangent", None) or d[-1]])
    carried = transported(first, tangents)
    last = carried[-1]
    if getattr(end, "normal", None) is not None:
        wanted = first_director(end.tangent, end.normal)
        t = np.array(end.tangent) / np.linalg.norm(end.tangent)
        twist = float(np.arctan2(np.dot(np.cross(last, wanted), t), np.dot(last, wanted)))
        if rod.all() and getattr(start, "tangent", None) is not None:
            part = (np.cumsum(np.ones(e.shape[0])) - 0.5) / e.shape[0] * twist
        else:
            part = np.full(e.shape[0], twist)  # the start turns freely: the whole line takes the end's orientation
        inner = carried[1:-1]
        carried[1:-1] = inner * np.cos(part)[:, None] + np.cross(d, inner) * np.sin(part)[:, None]
        last = wanted
    return _end_conditions(scene, (first, last), (d[0], d[-1])), carried[1:-1]


def _end_conditions(scene: Scene, directors: tuple[Floats, Floats], chords: tuple[Floats, Floats]) -> EndConditions:
    position, frame = np.zeros((2, 3)), np.zeros((2, 9))
    loads: list[EndLoad] = []
    motions: dict[int, Moves] = {}
    pair = (scene.ends.start, scene.ends.end)
    for k, end in enumerate(pair):
        t = np.array(getattr(end, "tangent", None) or chords[k], float)
        t = t / np.linalg.norm(t)
        base = np.column_stack([directors[k], np.cross(t, directors[k]), t])
        frame[k] = base.ravel()
        position[k] = getattr(end, "position", (0.0, 0.0, 0.0))
        for what in ("force", "moment"):
            load = getattr(end, what, None)
            if load is not None:
                until = getattr(load, "until", None)
                value = np.array(getattr(load, "value", load), float)
                loads.append(EndLoad(what, k, value, np.inf if until is None else until))
        motion = getattr(end, "motion", None)
        if motion is not None:
            motions[k] = EndMotion(motion, getattr(end, "position", None), base)
    return EndConditions([e.kind in ("pinned", "clamped") for e in pair], position, frame, loads, motions)


def _ledger(scene: Scene, line: Line, zones: Sequence[Zone]) -> tuple[Entry, ...]:
    """What is on and who asked for it, what is off and what would switch it on."""
    kinds = {z.kind for z in zones}
    entries = [
        Entry("catenary cells (6th order)", "catenary" in kinds, "model" if "catenary" in kinds else "no catenary zone in model"),
        Entry("rod cells: bending, torsion (12th order)", "rod" in kinds, "model" if "rod" in kinds else "no rod zone in model"),
    ]
    joints = sum(a.kind != b.kind for a, b in zip(zones[:-1], zones[1:], strict=True))
    entries.append(Entry(f"spherical joints: {joints}", joints > 0, "a rod zone meets a catenary zone" if joints else "rod and catenary do not meet"))
    extensible = [x.axial_stiffness is not None for x in scene.cable.sections]
    entries.append(Entry("axial compliance", any(extensible), "sections[].axial_stiffness"))
    if "rod" in kinds:
        assumed = [i for i, x in enumerate(scene.cable.sections) if x.torsional_stiffness is None and x.bending_stiffness]
        if assumed:
            which = ", ".join(f"sections[{i}]" for i in assumed)
            entries.append(Entry("torsional stiffness = bending stiffness / 1.3", True, f"assumed (solid round section): {which} gives none"))
    entries.append(Entry("gravity", scene.environment.gravity != 0, "environment.gravity"))
    entries.append(Entry("buoyancy", scene.environment.fluid is not None, "environment.fluid"))
    entries += [Entry(name, bool(line.bits & bit), needs) for name, (bit, needs) in FORCES.items()]
    for name, end, cell in (("start", scene.ends.start, 0), ("end", scene.ends.end, -1)):
        moving = getattr(end, "motion", None) is not None
        entries.append(Entry(f"ends.{name}: {end.kind}{', moving' if moving else ''}", True, f"ends.{name}"))
        if not line.spin[cell] and (end.kind in ("clamped", "guided") or getattr(end, "moment", None) is not None):
            entries.append(Entry(f"moment and tangent at ends.{name}", False, "the cable ends in a catenary zone, which transmits no moment"))
    return tuple(entries)
