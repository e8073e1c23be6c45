"""Models made from another one: with other numbers, with fewer nodes, or after a line has come loose.

Numbers differ on the same cells, without what begins a search.  An equilibrium on fewer nodes is a start for one on
many.

Lines break from their points, and points give way.  An end that comes loose alone is a free end of its line; ends that
stay together are joined to a free point of their own without mass.  What was clamped bends there no more, and no torque
passes through the catenary zones of its line.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from hybrid.kernels.junctions.joined_lines import SEAT, WITH_BODY, WITH_POINT
from hybrid.kernels.march.zone_torque import COMPLIANCE, FREE
from hybrid.kernels.state.report import FRICTION, PLANAR, ROTARY, TOUCHES
from hybrid.kernels.state.state import NO_TORSION, Floats, Line, Sea, State, state_for
from hybrid.model.bodies import BodyModel, seat_of, untwisted, with_clamps
from hybrid.model.build import Model, build, place_cells, planar
from hybrid.model.ends import first_director
from hybrid.model.initial_shape import end_conditions, frames
from hybrid.model.line import NO_INERTIA, WITH_SECTIONS, line_on, with_spin_inertia
from hybrid.model.material import Material, material
from hybrid.model.mesh import Layout, LineOnBase, Zone
from hybrid.model.network import NetworkModel, NetworkResolution, build_network, first_lines
from hybrid.model.obstacles import obstacle_bits
from hybrid.model.resolution import Resolution
from hybrid.model.sea import Surroundings, surroundings
from hybrid.model.sections import attached
from hybrid.scene.attachments import BendStiffener
from hybrid.scene.bodies import FixedBody
from hybrid.scene.ends import Failure
from hybrid.scene.network import Network
from hybrid.scene.schema import LineScene

# Part of the length by which nodes may move: further than that, another one has been chosen for a place that needs one.
SHIFT = 2e-4
# What of a sea a computation writes.
WRITTEN = ("flow", "axis", "slip", "slid", "bed", "grip", "rolling", "now", "lanes")


def nearby(
    model: Model, of: LineScene, scene: LineScene, resolution: Resolution, without: int, clamped: bool = False
) -> Model | None:
    """The model of `scene`, in the cells and zones that `model` has of the scene `of`; None: its cells are others.

    without: bits of forces that its line leaves out (kernels.state.report); clamped: frames of ends hang on directions
    of the scene alone, and are those of it.
    Its start, its other starts and its contents are those of `model`.  Tables of `scene` that are the same objects as
    those of `of` count as unchanged.
    """
    reaches_more = bool(obstacle_bits(scene) & ~(model.line.bits | without))
    # both ends hold twist, and the scene leaves its plane: the frame of an end hangs on the first shape
    hangs = all(model.cable.held_twist) and bool(model.line.element.any()) and model.plane is None
    if model.payout is not None or reaches_more or (hangs and not clamped):
        return _built(model, scene, resolution)
    cable = material(scene)
    placed = _cells(model, cable, of, scene, resolution)
    if placed is None:
        return None
    layout, s, zones = placed
    if attached(scene, BendStiffener):
        cable = material(scene, s if layout is None else layout.base)
    on_base = LineOnBase(cable, layout.base) if layout is not None else None
    if layout is not None and on_base is not None:
        line = on_base.line(layout, (model.line.bits | cable.bits) & ~without, model.line.plane, model.line.moved)
    else:
        inertia = WITH_SECTIONS if model.line.bits & ROTARY else NO_INERTIA
        line = line_on(cable, s, model.line.spin == 1, model.line.bits & ~PLANAR, inertia, without)
        line = line._replace(moved=model.line.moved)
        if model.line.bits & PLANAR & ~without:
            line = planar(line, model.line.plane)
    sea = _sea(model, of, scene)
    ends = model.ends
    if scene.ends is not of.ends:
        chords = model.start.e[[0, -1]]
        chords = chords / np.linalg.norm(chords, axis=1)[:, None]
        if clamped:
            directors = frames(scene, model.start.e, line, cable)[0]
            ends = end_conditions(scene, (directors[0], directors[-1]), chords, sea)
        else:
            axes = _held_axes(model, of, scene, line, cable)
            ends = end_conditions(scene, (axes[0], axes[1]), chords, sea)
    cells: dict[str, Any] = {"line": line, "zones": zones, "cable": cable, "layout": layout, "on_base": on_base}
    cells |= {"attached": tuple(cable.at.tolist()), "inextensible": not line.ck.any()}
    return replace(model, ends=ends, sea=sea, **cells)


def _held_axes(model: Model, of: LineScene, scene: LineScene, line: Line, cable: Material) -> Floats:
    """(2, 3) first directors of ends that are held: those of the model, turned as directions of the scenes turn."""
    held = model.ends.values.frame.reshape(2, 3, 3)
    directions = [[(x.held_tangent, x.held_normal, x.held_turns) for x in each.ends.both] for each in (of, scene)]
    if directions[0] == directions[1]:
        return held[:, :, 0]
    e, turned = model.start.e, []
    for on, at, each in ((model.line, model.cable, of), (line, cable, scene)):
        first = frames(each, e, on, at)[0]
        turned.append([_axes(end.held_tangent or e[-k], first[-k]) for k, end in enumerate(each.ends.both)])
    before, now = np.array(turned)
    return np.asarray((now @ np.swapaxes(before, 1, 2) @ held)[:, :, 0])


def _axes(tangent: Sequence[float] | Floats, first: Floats) -> Floats:
    """(3, 3) axes in columns, of a tangent of any length and the first director, which is normal to it."""
    t = np.asarray(tangent, float) / np.linalg.norm(tangent)
    return np.column_stack([first, np.cross(t, first), t])


def _sea(model: Model, of: LineScene, scene: LineScene) -> Surroundings:
    """The sea of a scene; that of the model where it is the same."""
    if scene.environment is of.environment and scene.environment.seabed is None and not scene.obstacles:
        return model.sea
    sea = surroundings(scene, model.line.h.size)
    same = all(_same(getattr(sea.values, x), getattr(model.sea.values, x)) for x in Sea._fields if x not in WRITTEN)
    return model.sea if same else sea


def _same(x: Any, y: Any) -> bool:
    """Whether arrays, or tuples of them, have the same numbers."""
    if isinstance(x, tuple):
        return len(x) == len(y) and all(_same(a, b) for a, b in zip(x, y, strict=True))
    return bool(np.array_equal(x, y, equal_nan=True))


def _built(model: Model, scene: LineScene, resolution: Resolution) -> Model | None:
    """The model as for a search, with the zones of `model`; None: its cells are others."""
    found, here = build(scene, resolution, spare=False), model.layout
    if found.layout is not None and here is not None:
        if not np.array_equal(found.layout.parts, here.parts) or found.on_base is None:
            return None
        layout = found.layout._replace(rod=here.rod, here=here.here)
        line = found.on_base.line(layout, found.line.bits, found.line.plane, found.line.moved)
        found = replace(found, line=line, zones=layout.zones, layout=layout, sea=found.sea.on(line.h.size))
    return found if same_nodes(found.line.s, model.line.s) else None


def _cells(
    model: Model, cable: Material, of: LineScene, scene: LineScene, resolution: Resolution
) -> tuple[Layout | None, Floats, tuple[Zone, ...]] | None:
    """Layout, nodes (N+1,) m and zones; None: they are others than those of the model."""
    as_before = scene.model is of.model and scene.mesh is of.mesh and scene.initial is of.initial
    as_before = as_before and np.array_equal(cable.bounds, model.cable.bounds)
    if as_before and np.array_equal(cable.at, model.cable.at):
        return model.layout, model.line.s, model.zones
    layout, s, zones = place_cells(scene, cable, resolution, None)
    if layout is not None and model.layout is not None:
        if not np.array_equal(layout.parts, model.layout.parts):
            return None
        layout = layout._replace(rod=model.layout.rod, here=model.layout.here)
        s, zones = layout.nodes, layout.zones
    return (layout, s, zones) if same_nodes(s, model.line.s) else None


def same_nodes(s: Floats, old: Floats) -> bool:
    """Whether nodes (N+1,) m are where they were, but for a small part of the length."""
    return s.size == old.size and float(np.abs(s - old).max()) <= SHIFT * float(old[-1])


# The model of a line that is clamped to free bodies or points, of a scene that differs from another in numbers alone.
#
# How an end is seated in axes of what carries it follows from directions that the scene gives, as far as these know of
# no first shape: then the arrays of the line are those of its scene, and no other line is looked at.

ENDS = ("start", "end")


def seats_know_no_shape(network: Network, name: str) -> bool:
    """Whether how a line is seated follows from directions that are given, whatever the first shapes of lines are.

    A material axis that is not given is that of a line without twist between both tangents; at a free point these are
    known from first shapes, and so it is where the other end holds no twist.
    """
    if network.surfaces:  # what is stiff by the pull of all lines, and left out beside its own body
        return False
    line = network.lines[name]
    clamps, points = [network.clamp(name, end) for end in ENDS], (line.start, line.end)
    if any(isinstance(body := network.body_of(p), FixedBody) and body.motion is not None for p in points):
        return False
    if any(x is not None and x.swivel for x in clamps):
        return False
    given = [
        x is not None and (x.normal is not None or p in network.rigid) for x, p in zip(clamps, points, strict=True)
    ]
    if clamps[0] is None or clamps[1] is None:
        return clamps[1] is None or given[1]
    if all(given):
        return True
    one, other = (network.direction(name, end) for end in ENDS)
    return one is not None and other is not None and None not in [x[1] for x in untwisted(one, other)]


def nearby_clamped(
    model: Model,
    of: LineScene,
    network: Network,
    name: str,
    bodies: Sequence[BodyModel],
    resolution: NetworkResolution,
    without: int,
) -> tuple[Model, Floats] | None:
    """The model of a line of `network` and its seats (2, SEAT); None: its cells are others.

    Seats are zeros where an end turns with nothing.  model, of, without: as of `nearby`, of the line with the points
    that it carries; bodies: the free ones.
    """
    first = first_lines(network, bodies, resolution)
    directions, carried = first.directions(name), network.carried(name)
    scene = first.scene(name, (), directions)
    found = nearby(model, of, scene, resolution.lines[name], without, clamped=True)
    if found is None:
        return None
    seats, held = np.zeros((2, SEAT)), [k for k, end in enumerate(ENDS) if network.clamp(name, end) is not None]
    for k in held:
        point = getattr(network.lines[name], ENDS[k])
        axes = first.axes(point)
        if axes is not None:
            kind = WITH_POINT if point in network.rigid else WITH_BODY
            seats[k] = seat_of(found.ends.values.frame[k], axes, kind)
    if not carried:
        return found, seats
    other = nearby(model, of, first.scene(name, carried, directions), resolution.lines[name], without, clamped=True)
    if other is None:
        return None
    other = with_clamps(other, found, held)
    other.ends.values.frame[held] = found.ends.values.frame[held]
    return replace(other, start=model.start), seats


def shaped_anew(
    network: Network, names: Iterable[str], bodies: Sequence[BodyModel], resolution: NetworkResolution
) -> dict[str, tuple[Model, Floats]]:
    """Models of some lines with their seats (2, SEAT), as first shapes have them; bodies: the free ones.

    Points are turned as the lines lie that are clamped there; no other line is built.
    """
    if network.surfaces or network.dimension == 2:  # what a line is beside, or in which plane, hangs on all of them
        built = build_network(network, resolution)
        models, seats = (
            dict(zip(built.names, built.models, strict=True)),
            dict(zip(built.names, built.seats, strict=True)),
        )
        return {name: (models[name], seats[name]) for name in names}
    maker = first_lines(network, bodies, resolution)
    maker.turn_points()
    order = list(network.lines)
    return {name: (maker.model(name), maker.seats[order.index(name)]) for name in names}


FEWER = 4  # cells that become one
MANY = 1000  # cells of a line from which on the equilibrium of a coarser mesh is sought first
FEWEST = 80  # cells below which a line is coarse enough
FOLDED = -1.0 + 1e-6  # cosine of the turn of a chord that is turned right back


def coarser(model: Model) -> Model | None:
    """The model with a quarter of its cells and with its own start; None: there is none.

    It has few cells already, all of its nodes must stay, or it folds in that start.  Zones, sections and point loads
    keep their nodes.
    """
    line, cable = model.line, model.cable
    if model.cells <= FEWEST:
        return None
    kept = np.zeros(line.s.size, bool)
    kinds = np.flatnonzero(line.spin[1:] != line.spin[:-1]) + 1
    places = np.searchsorted(line.s, np.concatenate([cable.bounds, cable.at]) - 1e-9 * line.s[-1])
    fixed = np.unique(np.concatenate([[0], kinds, places, [line.s.size - 1]]))
    for a, b in pairwise(fixed):
        kept[np.linspace(a, b, max(2, round((b - a) / FEWER)) + 1).astype(int) if b - a > 1 else [a, b]] = True
    at = np.flatnonzero(kept)
    rod = line.spin[at[:-1]] == 1
    bits, inertia = line.bits & (TOUCHES | FRICTION), WITH_SECTIONS if line.bits & ROTARY else NO_INERTIA
    if at.size == line.s.size:  # every node stays, as beside so many point loads
        return None
    new = line_on(cable, line.s[at], rod, bits, inertia)
    if line.bits & PLANAR:
        new = planar(new, line.plane)
    start = picked(new, model.start, at, _turns(line, new, model.start))
    if start is None:
        return None
    spare = ((name, picked(new, x, at, _turns(line, new, x))) for name, x in model.other_starts)
    others = tuple((name, x) for name, x in spare if x is not None)
    return replace(model, line=new, sea=model.sea.on(rod.size), start=start, other_starts=others, layout=None)


def refined(state: State, coarse: Line, line: Line) -> State:
    """A state of a coarse line on a finer one: its nodes on parabolas, joined, so that a rod begins without kinks."""
    out = state_for(line)
    out.turn[:, 0] = _turns(coarse, line, state)
    out.r[:] = _smooth(state.r, coarse.s, line.s)
    out.e[:] = np.diff(out.r, axis=0)
    middle = 0.5 * (line.s[:-1] + line.s[1:])
    out.T[:] = np.interp(middle, 0.5 * (coarse.s[:-1] + coarse.s[1:]), state.T)
    of = np.clip(np.searchsorted(coarse.s, middle) - 1, 0, coarse.h.size - 1)
    carry_directors(line, state.e[of], state.a1[of], out)
    return out


def _turns(line: Line, other: Line, state: State) -> Floats:
    """Turns (K,) rad of zones of the other line that make their torques those of a state of the line."""
    torque = (state.turn[:, 0] - line.torsion[:, FREE]) / line.torsion[:, COMPLIANCE]
    return np.asarray(torque * other.torsion[:, COMPLIANCE] + other.torsion[:, FREE])


def picked(line: Line, state: State, at: np.ndarray, turns: Floats | None = None) -> State | None:
    """The state at some of its nodes, those of `line`; None: two of them lie at the same place.

    turns: (K,) rad, of zones of the line that a torque passes through.
    """
    out = state_for(line)
    if turns is not None:
        out.turn[:, 0] = turns
    out.r[:], out.v[:] = state.r[at], state.v[at]
    out.e[:] = np.add.reduceat(state.e, at[:-1], axis=0)
    if not out.e.any(axis=1).all():
        return None
    out.T[:] = np.add.reduceat(state.T, at[:-1]) / np.diff(at)
    carry_directors(line, state.e[at[:-1]], state.a1[at[:-1]], out)
    return out


def carry_directors(line: Line, chords: Floats, a: Floats, state: State) -> None:
    """First directors of a state: those (N, 3) of other chords (N, 3), which turn to its chords without spin.

    In a plane they turn about its normal, however far; in space they are made normal to chords that turn by less than
    60 degrees, and turned with the others by the smallest rotation: made normal, one would come out on the other side.
    """
    d, new = (e / np.linalg.norm(e, axis=1)[:, None] for e in (chords, state.e))
    if line.bits & PLANAR:
        n = line.plane[2]
        x, y = a @ n, np.einsum("ij,ij->i", a, np.cross(n, d))
        state.a1[:] = x[:, None] * n + y[:, None] * np.cross(n, new)
        return
    cosine = np.einsum("ij,ij->i", d, new)
    far = (cosine < 0.5) & (cosine > FOLDED)
    s = np.einsum("ij,ij->i", a[far], new[far]) / (1.0 + cosine[far])
    a = a.copy()
    a[far] -= s[:, None] * (d[far] + new[far])
    a -= np.einsum("ij,ij->i", a, new)[:, None] * new
    for i in np.flatnonzero((np.linalg.norm(a, axis=1) < 1e-3) | (cosine <= FOLDED)):  # any will do
        a[i] = first_director(new[i])
    state.a1[:] = a / np.linalg.norm(a, axis=1)[:, None]


def _smooth(r: Floats, s: Floats, at: Floats) -> Floats:
    """Cubics through the nodes with the slopes of parabolas."""
    from scipy.interpolate import CubicHermiteSpline  # slow to import

    return np.asarray(CubicHermiteSpline(s, r, np.gradient(r, s, axis=0, edge_order=2))(at))


# --- what may break, and the network after it --------------------------------------------------


class Weakness(NamedTuple):
    """Something that may break."""

    name: str  # for people
    ends: tuple[tuple[int, int], ...]  # of lines: number, and 0 or 1 for start or end
    time: float  # s; infinite: never by itself
    tension: float  # N, of all these ends together; infinite: however large
    leaves: bool  # whether the ends leave their point; else the point comes with them


def weaknesses(network: Network) -> tuple[Weakness, ...]:
    """All that may break, lines first."""
    names = list(network.lines)
    found = list[Weakness]()

    def may_break(text: str, ends: Iterable[tuple[int, int]], when: Failure, leaves: bool) -> None:
        found.append(Weakness(text, tuple(ends), when.time or np.inf, when.tension or np.inf, leaves))

    for name, line in network.lines.items():
        if line.break_at is not None:
            k = int(line.break_at.end == "end")
            point = (line.start, line.end)[k]
            may_break(f"line {name} breaks from point {point}", [(names.index(name), k)], line.break_at, True)
    for name, point_ in network.points.items():
        failure = getattr(point_, "break_at", None)
        if failure is not None:
            ends = ((names.index(x), int(end == "end")) for x, end in network.lines_at(name))
            may_break(f"point {name} gives way", ends, failure, False)
    return tuple(found)


def after_failure(model: NetworkModel, weakness: Weakness, t: float) -> NetworkModel:
    """The network with the ends of a weakness loose from t (s) on.

    Those are, as far as they are at their point; the old network is as it was.
    """
    ends = [at for at in weakness.ends if at not in model.loose]
    points, loose = len(model.free), model.loose | (set(ends) if weakness.leaves else set())
    joined = [model.joints[line][k] for line, k in ends]
    if not ends or (0 <= joined[0] < points and sum(pair.count(joined[0]) for pair in model.joints) == len(ends)):
        return replace(model, loose=loose)  # what is there is free already
    if len(ends) == 1:
        return _with_free_end(replace(model, loose=loose), *ends[0], t)
    joints = [[j if j < points else j + 1 for j in pair] for pair in model.joints]  # bodies come behind the points
    for line, k in ends:
        joints[line][k] = points
    models, seats = [*model.models], model.seats.copy()
    for line, k in ends:
        if models[line].line.element[-k] or models[line].line.torsion.size:
            models[line] = unclamped(models[line], k)
        seats[line, k] = 0.0
    shape = model.models[ends[0][0]].start.r[-ends[0][1]]
    places, free = np.vstack([model.places, shape]), (*model.free, weakness.name)
    model = replace(model, joints=tuple((a, b) for a, b in joints), models=tuple(models), seats=seats)
    return replace(model, free=free, places=places, loose=loose)


def _with_free_end(model: NetworkModel, line: int, k: int, t: float) -> NetworkModel:
    """The network with an end (line, 0 or 1) that nothing holds from t (s) on."""
    joints, seats, models = [list(x) for x in model.joints], model.seats.copy(), [*model.models]
    joints[line][k], seats[line, k] = -1, 0.0
    supports = {**model.supports, (line, k): models[line].ends}
    models[line] = without_hold(models[line], k, t)
    return replace(model, joints=tuple((a, b) for a, b in joints), seats=seats, models=tuple(models), supports=supports)


# A line whose end is let go in mid-motion: what held the end is off, and everything else stays as it is.


def without_hold(model: Model, k: int, t: float) -> Model:
    """The same model with end k (0 or 1) free from t (s) on; its motion is over.  The old one is as it was."""
    held = model.line if model.held is None else model.held
    return replace(unclamped(model, k), ends=model.ends.released_at(k, t), held=held)


def unclamped(model: Model, k: int) -> Model:
    """The same model without what holds the direction and the twist of end k (0 or 1)."""
    tangent, twist, hinged = model.cable.held_tangent, model.cable.held_twist, model.cable.hinged
    cable = replace(
        model.cable,
        held_tangent=(tangent[0] and k != 0, tangent[1] and k != 1),
        held_twist=(twist[0] and k != 0, twist[1] and k != 1),
        hinged=(hinged[0] or k == 0, hinged[1] or k == 1),
    )
    line, on_base = without_clamp(model.line, -k), None
    if line.torsion.size:  # a torque passes where both ends hold the twist
        line = line._replace(torsion=NO_TORSION)
    if model.layout is not None:
        line, on_base = with_spin_inertia(line, cable), LineOnBase(cable, model.layout.base)
    return replace(model, line=line, cable=cable, on_base=on_base)


def without_clamp(line: Line, node: int) -> Line:
    """The line without the element between an end and its clamp; without a clamp, the line itself."""
    if not line.element[node]:
        return line
    element, kb, k0, hn = line.element.copy(), line.kb.copy(), line.k0.copy(), line.hn.copy()
    element[node], kb[node], k0[node], hn[node] = 0, 0.0, 0.0, 0.5 * abs(line.s[node] - line.s[-2 if node else 1])
    slip_law = line.slip_law.copy()  # as wide as it was
    if slip_law.size:
        slip_law[node] = 0.0
    return line._replace(element=element, kb=kb, k0=k0, hn=hn, slip_law=slip_law)
