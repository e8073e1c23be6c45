"""From the scene to the plan of a line, in space or in a plane.

This is the only place where a Scene becomes arrays: `build(scene)` decides what the scene requires, fills the line's
arrays with it and lists its contents: what is on and by which key, what is off.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hybrid.errors import refuse_value
from hybrid.kernels.mesh.cell_lengths import COMPRESSED_SHARE, FLANK, SHARP
from hybrid.kernels.state.report import OBSTACLES, PLANAR
from hybrid.kernels.state.state import Ends, Floats, Line, State
from hybrid.model.catenary_guess import Hanging
from hybrid.model.contents import Entry, contact_bits, contents_of
from hybrid.model.ends import EndConditions
from hybrid.model.initial_shape import corners, first_state, from_joint, hung, other_state, spare_shapes
from hybrid.model.line import WITH_SECTIONS, inertia_of_zones, line_on
from hybrid.model.material import LEAST_WEIGHT, STIFFENER_CELLS, Material
from hybrid.model.mesh import (
    DEFAULT_CELLS,
    Layout,
    LineOnBase,
    Zone,
    ZonePlan,
    divided,
    given_nodes,
    of_rods,
    place_nodes,
    refuse_too_many,
    thinned,
)
from hybrid.model.obstacles import kind_of, least_cells, obstacle_bits
from hybrid.model.payout import PayoutPlan, cable_of, payout_of, payout_plan, shorter_behind_clamp
from hybrid.model.resolution import Resolution, first_resolution, follows_curvature, mesh_is_free
from hybrid.model.sea import Surroundings, bed_bits, surroundings
from hybrid.model.sections import attached, merged_sections, tension_scale
from hybrid.scene.analysis import AdaptiveModel, RodModel, RodZone, ZonesModel
from hybrid.scene.attachments import BendStiffener
from hybrid.scene.motion_checks import prescribed_twist
from hybrid.scene.plane import EXACT, TYPED, plane_of
from hybrid.scene.schema import LineScene, reachable_obstacles

# Of the length: how far an equilibrium may be out of the plane and count as in it (Newton's tolerance).
IN_PLANE = 1e-8
WHAT = "computed in a plane (3 unknowns a node)"


def in_plane(
    scene: LineScene, start: State, others: list[tuple[str, State]], ends: Ends
) -> tuple[Floats | None, Entry]:
    """The plane (3, 3) of a scene, rows p, q and normal, or None; and its entry in the contents of the model.

    What a scene does not write down is looked at as well: the shape that it starts from.  Starts in `others` that
    leave the plane are dropped where the scene insists on it, for they lead nowhere.  SceneError: it insists, and its
    own start leaves the plane.
    """
    if scene.dimension == 3:
        return None, Entry(WHAT, False, "dimension: 3")
    asked = scene.dimension == 2
    touching = "contact.self" if scene.contact.self else "obstacles" if reachable_obstacles(scene) else ""
    if touching and not asked:
        what = "of the line with itself" if scene.contact.self else "with obstacles"
        return None, Entry(WHAT, False, f"{touching}: contact {what} is computed in space")
    tolerance = TYPED if asked else EXACT
    found, findings = plane_of(scene.environment, scene.cable, scene.ends, scene.initial, tolerance)
    if findings:
        where = ".".join(str(x) for x in findings[0].at)
        return None, Entry(WHAT, False, f"{where} leaves {found.text()}")
    plane = np.array([found.p, found.q, found.normal])
    if not _lies_in(plane, start, ends, tolerance):
        if asked:
            fix = "give `initial` a shape or a direction in the plane, or write `dimension: 3`"
            expected = f"a first shape in {found.text()}, which the rest of the scene lies in"
            refuse_value("initial", "one that leaves the plane", expected, fix)
        return None, Entry(WHAT, False, f"the first shape leaves {found.text()}")
    if asked:
        others[:] = [(name, x) for name, x in others if _lies_in(plane, x, ends, tolerance)]
        if touching:
            why = f"{touching}: contact is computed in space, where nothing may leave {found.text()}"
            return plane, Entry(WHAT, False, why)
        return plane, Entry(WHAT, True, f"dimension: 2; {found.text()}")
    why = f"all of the scene lies in {found.text()}; dimension: 3 switches it off"
    return plane, Entry(WHAT, True, why)


def _lies_in(plane: Floats, state: State, ends: Ends, tolerance: float) -> bool:
    """Whether nodes, velocities and frames of the ends are in the plane, to a part of what they are."""
    n = plane[2]
    tangents = ends.frame.reshape(2, 3, 3)[:, :, 2]
    groups: Iterable[Floats] = (state.r - state.r[0], state.v, tangents)
    return all(float(np.abs(x @ n).max()) <= tolerance * float(np.abs(x).max()) for x in groups)


def leaves_plane(plane: Floats, state: State, length: float) -> bool:
    """Whether nodes of a state are further from the plane (3, 3) than IN_PLANE of the length, m."""
    return bool(np.abs((state.r - state.r[0]) @ plane[2]).max() > IN_PLANE * length)


def planar(line: Line, plane: Floats) -> Line:
    """The line, to be computed in the plane (3, 3)."""
    return line._replace(bits=line.bits | PLANAR, plane=plane)


def as_kept(line: Line, plane: Floats | None, kept_in: Floats | None) -> Line:
    """The line in the plane where its scene asks for that, as it is found at rest; plane, kept_in: of its model."""
    return line if plane is None or kept_in is None else planar(line, plane)


def in_space(line: Line) -> Line:
    """The line, to be computed in space."""
    return line._replace(bits=line.bits & ~PLANAR)


def as_begun(line: Line, held: Line | None, dimension: int | None) -> Line:
    """The line as its run began: in space, but of a scene of two dimensions; what is written goes by that.

    held: as it was before an end was let go, if one was.
    """
    found = line if held is None else held
    return found if dimension == 2 else in_space(found)


def untwist(line: Line, ends: Ends, guides: tuple[bool, bool], state: State) -> None:
    """Give the rods of a planar line frames without twist against each other and against its clamps.

    guides: whether an end holds a tangent, and with it a frame.  In space a rod that begins twisted turns back within
    a step; in a plane nothing turns it.
    """
    rods = np.flatnonzero(line.spin)
    if not rods.size:
        return
    n = line.plane[2]
    across = np.cross(n, state.e / np.linalg.norm(state.e, axis=1)[:, None])
    frames = ends.frame.reshape(2, 3, 3)
    if guides[0] or guides[1]:
        held = frames[0 if guides[0] else 1]
        director, m = held[:, 0], np.cross(n, held[:, 2])
    else:
        director, m = state.a1[rods[0]], across[rods[0]]
    x, y = float(director @ n), float(director @ m)
    size = np.hypot(x, y)
    state.a1[rods] = (x * n + y * across[rods]) / size


# A catenary cell counts as slack when its tension is not above this part of the tension
# scale: a line that starts in free fall has no tension at all, but for what Newton leaves.
SLACK_FLOOR = -1e-6


@dataclass(frozen=True)
class Model:
    """A scene made ready to compute."""

    line: Line
    zones: tuple[Zone, ...]
    ends: EndConditions
    sea: Surroundings
    start: State
    start_shape: str  # what it is, for people
    other_starts: tuple[tuple[str, State], ...]  # for a search of equilibrium that fails from the first
    contents: tuple[Entry, ...]
    tension_scale: float  # N
    slack_floor: float  # N, tension at or below which a catenary cell is slack
    slack: Literal["stop", "warn"]
    inextensible: bool
    attached: tuple[float, ...]  # m, arc lengths of floats, clumps and end bodies
    cable: Material
    layout: Layout | None = None  # of a line whose zones move
    on_base: LineOnBase | None = None  # and what makes its lines
    plane: Floats | None = None  # (3, 3) rows p, q, normal: what the scene lies in, if it does
    kept_in: Floats | None = None  # (3,) normal of the plane that it must not leave, though it is computed in space
    payout: PayoutPlan | None = None  # of a line that is paid out or taken in
    held: Line | None = None  # the line as its ends held it before the first of them was let go

    @property
    def length(self) -> float:
        """Length, m, without stretch, of what is out now."""
        return float(self.line.s[-1] - self.line.s[0])

    @property
    def zoned(self) -> Layout:
        """`layout` of a line whose zones move."""
        assert self.layout is not None
        return self.layout

    @property
    def line_maker(self) -> LineOnBase:
        """`on_base` of a line whose zones move."""
        assert self.on_base is not None
        return self.on_base

    @property
    def mesh(self) -> Layout | tuple[Floats, tuple[Zone, ...]]:
        """What `build` makes a model of the same mesh from."""
        if self.layout is None:
            return (self.line.s, self.zones) if self.payout is None else (self.payout.begun, self.payout.zones)
        return self.layout.finest if self.payout is None else self.payout.first_layout

    @property
    def most_cells(self) -> int:
        """Cells that there may be, whatever zones, the curvature or a winch make of the line."""
        if self.layout is not None:
            return int(self.layout.starts[-1])
        return self.cells if self.payout is None else max(self.cells, self.payout.most_cells)

    @property
    def cells(self) -> int:
        return int(self.line.h.size)

    @property
    def hinges(self) -> Floats:
        """`Material.hinges`, without pieces where zones stay: steps look for no stiffness that is under way there."""
        found = self.cable.hinges
        return found.copy() if self.layout is not None else np.vstack([found[:2], np.zeros((1, 3))])

    @property
    def nodes(self) -> Floats:
        """(N+1,) m, nodes by which extremes are kept: the fairlead of a line that is paid out is the next one."""
        if self.payout is not None and self.layout is not None:
            return self.payout.kept_nodes(self.layout)
        return self.line.s if self.payout is None else self.payout.along(self.payout.nodes[: self.cells + 1])

    @property
    def finest_nodes(self) -> Floats:
        """(K,) m, all nodes that there may be."""
        if self.payout is not None:
            s = self.payout.finest
            return s[(s if self.payout.side else self.payout.far - s) < self.payout.longest]
        return self.line.s if self.layout is None else self.layout.finest.nodes

    @property
    def always(self) -> np.ndarray:
        """Numbers of nodes that there always are: those of base cells, or that cannot be taken in."""
        return self.always_base if self.layout is None else self.layout.first[self.always_base]

    @property
    def always_base(self) -> np.ndarray:
        """The same of base nodes; of a line whose zones stay all nodes are."""
        nodes = self.line.s.size if self.layout is None else self.layout.base.size
        if self.payout is None:
            return np.arange(nodes)
        stays = np.flatnonzero(self.payout.nodes <= self.payout.shortest - self.payout.layer[0])
        return stays if self.payout.side else nodes - 1 - stays[::-1]

    @property
    def loaded_ends(self) -> tuple[bool, bool]:
        """Whether there is a point load at the start, and at the end."""
        near = 1e-9 * self.length
        start, end = (any(abs(x - s) < near for x in self.attached) for s in self.line.s[[0, -1]].tolist())
        return start, end

    @property
    def time_scale(self) -> float:
        """A time typical of the scene, s: that of a transverse wave along the line at the tension scale."""
        return float(np.sqrt(self.line.mass.sum() * self.length / self.tension_scale))

    @property
    def unknowns(self) -> int:
        """Positions, tensions and spins that Newton solves for."""
        if self.plane is not None:
            return 2 * (self.cells + 1) + self.cells
        return 3 * (self.cells + 1) + self.cells + int(self.line.spin.sum())


def zone_plans(scene: LineScene) -> tuple[ZonePlan, ...]:
    """The zones a scene's model stands for, in order."""
    model = scene.model
    if isinstance(model, ZonesModel):
        return tuple(
            ZonePlan("rod", z.rod, z.cells, z.ratio)
            if isinstance(z, RodZone)
            else ZonePlan("catenary", z.catenary, z.cells, z.ratio)
            for z in model.zones
        )
    return (ZonePlan("rod" if isinstance(model, AdaptiveModel | RodModel) else "catenary", scene.length),)


Plans = tuple[ZonePlan, ...]
Placed = tuple[Floats, tuple[Zone, ...]]  # nodes (N+1,) m, and zones


def build(
    scene: LineScene,
    resolution: Resolution | None = None,
    mesh: Layout | Placed | None = None,
    like: Model | None = None,
    spare: bool = True,
) -> Model:
    """Make the model that a scene requires; resolution: how finely, None: as it asks for.

    mesh: nodes (N+1,) m and zones, or the layout of a line whose zones move, all rod; None: as resolution places them.
    like: begin with the shape of this model of the same cable; spare: whether other shapes to begin with are made.

    SceneError: the scene cannot be meshed (a rod zone of one cell, nodes that miss a zone boundary).
    """
    cable = cable_of(scene)
    resolution = resolution or first_resolution(scene)
    layout, s, zones = place_cells(scene, cable, resolution, mesh)
    if attached(scene, BendStiffener):
        cable = cable_of(scene, s if layout is None else layout.base)
    paid = None
    to_compare = payout_of(scene) is not None and resolution.fineness < first_resolution(scene).fineness
    if layout is not None and payout_of(scene) is not None and follows_curvature(scene):
        whole = line_on(cable, layout.base, layout.finest.rod)
        paid = payout_plan(scene, whole, zones, partial(_following_parts, scene, resolution=resolution), to_compare)
        assert paid is not None
        layout = paid.first_layout
        s = layout.nodes
    rod = _rods_in(zones, s)
    refuse_too_many(rod.size)

    sea = surroundings(scene, rod.size)
    fastest = float(np.linalg.norm(sea.values.current, axis=1).max())
    sections = merged_sections(scene.cable.sections)
    scale = tension_scale(scene, sections, bool(rod.any()), fastest)
    # a stiff rod beside a light catenary must not hide that the catenary is slack
    slack_scale = tension_scale(scene, sections, False, fastest)
    bed = scene.environment.seabed
    touch = bed_bits(bed) | contact_bits(scene) | obstacle_bits(scene)
    moves = layout is not None
    line = line_on(cable, s, rod, touch, inertia_of_zones(cable) if moves else WITH_SECTIONS)
    if sea.values.carried.size:
        line = line._replace(moved=np.array([kind_of(x) for x in scene.obstacles.values()], np.int8))

    shape = hung(scene, line, sea.values) if like is None else Hanging(like.start.r, like.start.T)
    start, shape_name, ends = first_state(scene, line, cable, sea, scale, shape)
    others = list[tuple[str, State]]()
    if spare and like is None:
        shapes = spare_shapes(scene, s) if shape is not None else from_joint(scene, s)
        others = [(name, other_state(scene, r, line, cable, scale)) for name, r in shapes]
    plane, flat = in_plane(scene, start, others, ends.values)
    kept: Floats | None = None
    if plane is not None and (line.bits & OBSTACLES or scene.contact.self):  # which are computed in space
        kept, plane = plane[2], None
    elif plane is not None and scene.dimension == 2:
        line = planar(line, plane)
    return Model(
        line=line,
        zones=zones,
        ends=ends,
        sea=sea,
        start=start,
        start_shape=shape_name,
        other_starts=tuple(others),
        contents=contents_of(scene, line, zones, flat),
        tension_scale=scale,
        slack_floor=SLACK_FLOOR * slack_scale,
        slack=getattr(scene.model, "slack", "stop"),
        inextensible=not line.ck.any(),
        attached=tuple(cable.at.tolist()),
        cable=cable,
        layout=layout,
        on_base=LineOnBase(cable, layout.base) if layout is not None else None,
        plane=plane,
        kept_in=kept,
        payout=paid or payout_plan(scene, line, zones, to_compare=to_compare),
    )


def place_cells(
    scene: LineScene, cable: Material, resolution: Resolution, mesh: Layout | tuple[Floats, tuple[Zone, ...]] | None
) -> tuple[Layout | None, Floats, tuple[Zone, ...]]:
    """Layout of a line whose zones move (else None), nodes (N+1,) m and zones; mesh: as of `build`."""
    if isinstance(mesh, Layout):
        return mesh, mesh.nodes, mesh.zones
    if mesh is not None:
        return None, *mesh
    cuts = _cuts(scene, cable)
    if isinstance(scene.model, AdaptiveModel):
        layout = _layout(scene, cable, cuts, resolution)
        return layout, layout.nodes, layout.zones
    return None, *_placed(scene, cable, zone_plans(scene), cuts, resolution, DEFAULT_CELLS)


def _cuts(scene: LineScene, cable: Material) -> list[float]:
    """Arc lengths, m, at which a node must lie: of sections, loads, obstacles, and zones that the scene asks for."""
    cuts = {*cable.cuts, *corners(scene)}
    if isinstance(scene.model, AdaptiveModel):
        wanted = (*(scene.model.force_rod or ()), *(scene.model.force_catenary or ()))
        cuts |= {min(x, scene.length) for stretch in wanted for x in stretch} - {0.0, scene.length}
    return sorted(cuts)


def _knots(scene: LineScene, plans: Sequence[ZonePlan], cuts: Sequence[float]) -> list[float]:
    """The same with both ends, and those of zones."""
    bounds = np.cumsum([plan.length for plan in plans])[:-1]
    return sorted({0.0, *cuts, *bounds.tolist(), scene.length})


def places_of(model: Model, scene: LineScene) -> tuple[float, ...]:
    """`Resolution.places` of the cells of a model; empty where what else makes them goes by no places."""
    if attached(scene, BendStiffener) or payout_of(scene) is not None or follows_curvature(scene):
        return ()
    nodes = model.line.s if model.layout is None else model.layout.base
    plans = zone_plans(scene) if model.layout is None else (ZonePlan("rod", scene.length),)
    knots = _knots(scene, plans, _cuts(scene, model.cable))
    return tuple(np.interp(nodes, knots, np.arange(len(knots))).tolist())


def _at_places(
    scene: LineScene, plans: Sequence[ZonePlan], cuts: Sequence[float], resolution: Resolution
) -> tuple[Floats, tuple[Zone, ...]] | None:
    """Nodes and zones by `Resolution.places`; None: there are others."""
    knots = _knots(scene, plans, cuts)
    if not resolution.places or resolution.places[-1] != len(knots) - 1:
        return None
    edges = [0.0, *np.cumsum([plan.length for plan in plans])[:-1].tolist(), scene.length]
    zones = tuple(Zone(plan.kind, a, b) for plan, (a, b) in zip(plans, pairwise(edges), strict=True))
    return divided(np.interp(resolution.places, np.arange(len(knots)), knots), resolution.parts), zones


# Twist, rad, that a cell takes of what the ends prescribe, at fineness 1: runs to compare with have cells four times as
# long, and must stay below the twist at which a run stops (simulation.diagnostics).  Beyond so many cells it is left
# to that: it is more likely that a stiffness is in another unit.
TWIST, MOST_FOR_TWIST = 0.25, 5000
FEWEST_CELLS = 4  # of a zone, however little is asked
# Of rods whose cells follow the curvature.
FOLLOWING_BASE = 24  # base cells without a mesh,
FOLLOWING_CELLS = 60  # and with one that does not say how many
FOLLOWING_CELL = 0.125  # shortest cell over (EI/w)^(1/3)
MOST_FOLLOWING = 4096  # cells in a base cell


def given_zones(scene: LineScene, layout: Layout) -> np.ndarray:
    """(n,) of base cells: 1 where the scene wants rod whatever comes, -1 where catenary, else 0."""
    assert isinstance(scene.model, AdaptiveModel)
    middle = 0.5 * (layout.base[:-1] + layout.base[1:])
    given = np.zeros(middle.size, int)
    for stretches, sign in ((scene.model.force_catenary, -1), (scene.model.force_rod, 1)):
        for a, b in stretches or ():
            given[(middle > a) & (middle < b)] = sign
    return given


def twist_rate(scene: LineScene, cable: Material, s: Floats) -> Floats:
    """The most (K,) rad/m by which turns, motions and moments of the ends can twist a cable that is all rod, at s."""
    twisted, resists = prescribed_twist(scene.ends), _resists_spin(scene, cable)
    given = [[load.value for load in end.loads if load.what == "moment"] for end in scene.ends.both]
    takes = [end.holds_twist or bool(loads) or resists for end, loads in zip(scene.ends.both, given, strict=True)]
    moments = given[0] * takes[1] + given[1] * takes[0]
    by_tension = _twist_of_tension(scene, cable)
    if scene.dimension == 2 or cable.swivels.size or not (twisted or moments):
        return np.asarray(by_tension[cable.piece(s)])
    give = 1.0 / cable.B[:, 2]
    torque = twisted / float(give @ np.diff(cable.bounds)) + sum(float(np.linalg.norm(x)) for x in moments)
    return np.asarray(np.minimum(torque * give + by_tension, MOST_FOR_TWIST * TWIST / scene.length)[cable.piece(s)])


def _twist_of_tension(scene: LineScene, cable: Material) -> Floats:
    """The most (K,) rad/m by which a tension of the weight and of the end forces twists the pieces of a cable."""
    if not cable.tension_torque.size:
        return np.zeros(cable.mass.size)
    pulls = [float(np.linalg.norm(load.value)) for end in scene.ends.both for load in end.loads if load.what == "force"]
    T = float(np.abs(cable.submerged_weight) @ np.diff(cable.bounds) + np.abs(cable.lift).sum()) + sum(pulls)
    rate = np.abs(cable.tension_torque) * T / np.maximum(cable.B[:, 2], 1e-300)
    return np.asarray(np.minimum(rate, MOST_FOR_TWIST * TWIST / scene.length))


def _resists_spin(scene: LineScene, cable: Material) -> bool:
    """Whether a rod takes the torque of one end although the other turns freely: by inertia or by its sections.

    Along round, straight sections without inertia the torque is the same everywhere: an end that turns freely makes it
    0, whatever moment the other one bears, and that moment only bends.
    """
    inert = bool(cable.polar.any()) and (cable.sections_turn or not isinstance(scene.model, AdaptiveModel))
    return inert or bool(cable.kappa[:, :2].any() or (cable.B[:, 0] != cable.B[:, 1]).any())


def _placed(
    scene: LineScene, cable: Material, plans: Plans, cuts: Sequence[float], resolution: Resolution, usual: int
) -> Placed:
    """Nodes and zones; usual: cells of a line whose scene does not say."""
    if (placed := _at_places(scene, plans, cuts, resolution)) is not None:
        return placed
    s, zones = _placed_by_mesh(scene, cable, plans, cuts, resolution, usual)
    if scene.mesh is not None and scene.mesh.nodes is not None:
        return s, zones
    return _dense_in_stiffeners(scene, s, resolution.fineness), zones


def _dense_in_stiffeners(scene: LineScene, s: Floats, fineness: float) -> Floats:
    """Nodes (N+1,) m with evenly split cells where stiffeners have fewer than they need."""
    stiffeners = attached(scene, BendStiffener)
    if not stiffeners:
        return s
    middle, h = 0.5 * (s[:-1] + s[1:]), np.diff(s)
    longest = np.full(h.size, np.inf)
    for x in stiffeners:
        inside = (middle > x.range[0]) & (middle < x.range[1])
        longest[inside] = np.minimum(longest[inside], (x.range[1] - x.range[0]) / (STIFFENER_CELLS * fineness))
    parts = np.maximum(np.ceil(h / longest - 1e-9), 1).astype(int)
    new = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(s[:-1], s[1:], parts, strict=True)]
    return np.concatenate([*new, s[-1:]])


def _placed_by_mesh(
    scene: LineScene, cable: Material, plans: Plans, cuts: Sequence[float], resolution: Resolution, usual: int
) -> Placed:
    """The same, where stiffeners are no more than changes of section."""
    mesh, free = scene.mesh, mesh_is_free(scene)
    carries = all(plan.kind == "rod" for plan in plans)
    if free and resolution.grading is not None:
        bounds = np.concatenate([[0.0], np.cumsum([plan.length for plan in plans])])
        bounds[-1] = scene.length
        zones = tuple(Zone(plan.kind, float(a), float(b)) for plan, (a, b) in zip(plans, pairwise(bounds), strict=True))
        seen = resolution.grading
        dense = seen
        if carries:
            dense = replace(seen, density=np.maximum(seen.density, twist_rate(scene, cable, seen.s) / TWIST))
        return dense.nodes(sorted({*bounds.tolist(), *cuts}), resolution.fineness), zones
    if free:
        twisted = twist_rate(scene, cable, 0.5 * (cable.bounds[1:] + cable.bounds[:-1])).max() if carries else 0.0
        number = max(usual, twisted * scene.length / TWIST, least_cells(scene))
        cells = max(round(number * resolution.fineness), FEWEST_CELLS * len(plans))
        return place_nodes(plans, cuts, None, None, cells)
    if mesh is not None and mesh.nodes is not None:
        s, zones = given_nodes(mesh.nodes, plans, cuts)
    else:
        ratio, given = (mesh.ratio, mesh.cells) if mesh is not None else (None, None)
        s, zones = place_nodes(plans, cuts, given, ratio, usual)
    if resolution.fineness < 1.0:
        s = thinned(s, [z.s_b for z in zones[:-1]] + list(cuts), round(1.0 / resolution.fineness))
    return divided(s, resolution.parts), zones


def _layout(scene: LineScene, cable: Material, cuts: Sequence[float], resolution: Resolution) -> Layout:
    """The cells that rods everywhere would have; where cells follow the curvature, base cells, all rod."""
    model, whole = scene.model, (ZonePlan("rod", scene.length),)
    assert isinstance(model, AdaptiveModel)
    if not follows_curvature(scene):
        return of_rods(_placed(scene, cable, whole, cuts, resolution, DEFAULT_CELLS)[0])
    finer, seen = resolution.fineness, resolution.grading
    # base cells stay, whatever the fineness: what is asked of rods decides
    resolution = replace(resolution, grading=None, fineness=max(finer, 1.0))
    if mesh_is_free(scene) and scene.resolution is not None and seen is not None:
        base, _ = _placed(scene, cable, whole, cuts, replace(resolution, grading=seen), FOLLOWING_BASE)
    elif mesh_is_free(scene):
        base, _ = place_nodes(whole, cuts, None, None, FOLLOWING_BASE)
        assert model.curvature_error is not None
        base = _dense_in_stiffeners(scene, base, max(finer, 1.0))
        base = shorter_behind_clamp(scene, cable, base, model.curvature_error, finer)
    else:
        base, _ = _placed(scene, cable, whole, cuts, resolution, FOLLOWING_CELLS)
    return Layout(base, _following_parts(scene, cable, base, resolution), np.ones(base.size - 1, bool))


def _following_parts(scene: LineScene, cable: Material, base: Floats, resolution: Resolution) -> np.ndarray:
    """Finest cells (n,) of base cells between nodes (n+1,) m, where they follow the curvature."""
    assert isinstance(scene.model, AdaptiveModel)
    middle = 0.5 * (base[:-1] + base[1:])
    bend = cable.bending_length(LEAST_WEIGHT * cable.mass)[cable.piece(middle)]
    twisted = TWIST / np.maximum(twist_rate(scene, cable, middle), TWIST / scene.length)
    share = scene.model.curvature_error
    assert share is not None
    # of a kink of a compressed line, whose curvature is about 1/bend
    part = min(FOLLOWING_CELL, FLANK * SHARP * float(np.sqrt(8.0 * COMPRESSED_SHARE * share)))
    cell = np.minimum(scene.model.rod_cell or part * bend, twisted) / resolution.fineness
    halvings = np.ceil(np.log2(np.maximum(np.diff(base) / cell, 1.0)) - 1e-9)
    return np.asarray(np.minimum(2 ** halvings.astype(int), MOST_FOLLOWING))


def _rods_in(zones: Sequence[Zone], s: Floats) -> NDArray[np.bool_]:
    """Which cells (N,) between nodes s (N+1,) are rods; SceneError: a rod zone of one cell."""
    middle = 0.5 * (s[:-1] + s[1:])
    zone_of = np.clip(np.searchsorted([z.s_b for z in zones], middle), 0, len(zones) - 1)
    for k, zone in enumerate(zones):
        if zone.kind == "rod" and int((zone_of == k).sum()) < 2:
            given = f"a rod of {zone.s_b - zone.s_a:g} m with one cell"
            expected = "at least two cells: a rod bends at the nodes between its cells"
            fix = "give the zone `cells: 2` or more, or make mesh.cells larger"
            refuse_value(f"model.zones[{k}]", given, expected, fix)
    return np.array([z.kind == "rod" for z in zones])[zone_of]
