"""The file of a result: its fields, extremes of all steps on the finest mesh, and events on bending that is neglected.

The compiled run keeps extremes on the mesh of the moment (watch.extremes).  Every node of any layout is a node of the
layout that is all rod, so when cells change, the extremes of those that go are folded into those on its nodes: inside
a cell the extremes of its two nodes are interpolated, with the time of the nearer one.  Nodes whose cells stay go on
with theirs (kernels.watch.extremes).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

from hybrid.kernels.laws.seabed import planes_under
from hybrid.kernels.state.report import (
    AXIS,
    BEHIND,
    GROOVE,
    HALF_HEIGHT,
    HALF_LENGTH,
    HALF_WIDTH,
    KIND,
    LEAF,
    MESH,
    NORMAL,
    PLACE,
    RADIUS,
    RIM,
    RING,
    ROOT,
    ROUND,
    SEABED,
    SIDE,
    STILL_AXIS,
    STILL_SIDE,
    STRAND,
    SURFACE,
)
from hybrid.kernels.state.state import Floats, Sea
from hybrid.model.build import Model
from hybrid.model.payout import whole_scene
from hybrid.model.sections import SAME_PLACE, SECTION_LIMITS, limits_along, outer_diameter, weakest_bending
from hybrid.outputs.probes import Observer
from hybrid.scene.attachments import Modules
from hybrid.scene.quantities import Quantity
from hybrid.scene.schema import LineScene
from hybrid.store.capacity import CORNERS, ROWS
from hybrid.store.format import Field, Header, Text
from hybrid.store.recorder import Rows

if TYPE_CHECKING:
    from hybrid.solve.lines_at_rest import LinesAtRest


from collections.abc import Callable, Sequence
from typing import Any

from hybrid.errors import LIMIT_EVENTS
from hybrid.kernels.contact.self_distance import OF_0_6, blank_itself
from hybrid.kernels.state import books as b
from hybrid.kernels.state.report import MAY_MEET, MAY_TOUCH, OBSTACLES, PLANAR, SELF_CONTACT
from hybrid.kernels.watch.extremes import fold_extremes
from hybrid.model.build import as_begun
from hybrid.model.contents import no_contact
from hybrid.model.sections import attached, section_changes
from hybrid.outputs.observed_states import Grid
from hybrid.outputs.quantities import Pipes, StepQuantities
from hybrid.simulation.lines_contact import SelfWatch
from hybrid.solve.network_steps import no_extremes
from hybrid.store.envelope import BEGIN, END, GROUP, SCALE, Recorded, limits_of
from hybrid.store.integrity import matched

STEP_FIELDS = (
    Field("t", "s", "time at the end of the step"),
    Field("dt", "s", "length of the step"),
    Field("iterations", "", "Newton iterations, repeats included", dtype="int64"),
    Field(
        "correction", "", "next Newton correction as predicted (turn of a chord in rad, or tension over the largest)"
    ),
    Field("residual", "N", "largest residual force at a node before the last correction"),
    Field("repeats", "", "how often the step was repeated with smaller parts", dtype="int64"),
    Field("error", "m", "local error of position that the step makes, by the change of acceleration in it"),
    Field("end_force_start", "N", "magnitude of the force that holds (or loads) the start, at every step"),
    Field("end_force_end", "N", "the same at the end; of an end body: the force of the line on it"),
    Field("cpu", "s", "processor time since the start of the run"),
)


def result_header(
    scene: LineScene,
    model: Model,
    observer: Observer,
    texts: Mapping[str, Text],
    found: LinesAtRest | None,
    envelope: Envelope,
    outputs: int,
    notes: Mapping[str, str],
) -> Header:
    """What the result of a line states before its first output.

    found: the equilibrium at the start; envelope: of what is computed, its values not yet known; outputs: after the
    first, 0 of an equilibrium; notes: texts that are attributes of the result unless they are empty.
    """
    attributes: dict[str, str | float | int] = {"title": scene.title, "cells": model.cells, "length": model.length}
    attributes["tension_scale"] = model.tension_scale
    if found is not None:
        attributes |= {"static_path": found.summary, "static_residual": found.residual}
    attributes |= {name: text for name, text in notes.items() if text}
    fixed = [*_surroundings(model), *_limits(scene, observer), *envelope.fixed(), *mesh_fields(model)]
    if scene.output.history:
        points = np.array(scene.output.history)
        fixed.append(
            (Field("history", "m", "arc lengths to follow in histories", (points.size,), ("history",)), points)
        )
    fixed += places_of_elevation(observer.gauges)
    fixed += _limits_of_quantities(observer)
    if observer.jumps.size:
        text = "arc lengths of point loads, joints and changes of section; right/* has the values just after them"
        fixed.append((Field("right/s", "m", text, observer.jumps.shape, ("right/s",)), observer.jumps))
    return Header(observer.s, observer.fields, STEP_FIELDS if outputs else (), attributes, texts, fixed)


def places_of_elevation(gauges: Floats) -> list[tuple[Field, Floats]]:
    """The places (n, 2) m of gauges, of which there may be none."""
    text = "x and y, inertial, of the places at which `elevation` is recorded"
    return [(Field("elevation_at", "m", text, gauges.shape, ("gauge", "xy")), gauges)] if len(gauges) else []


def note_neglected_bending(scene: LineScene, model: Model, recorder: Rows) -> None:
    """Clamps and point loads in catenary zones: who wants their moment has to ask for it."""
    for s, text in _neglected_clamps(scene, model):
        recorder.event(0.0, s, s, "bending at clamp neglected", text)
    neglected = [s for s in model.attached if not _bends(model, s)]
    if neglected:
        which = ", ".join(f"{s:.5g}" for s in neglected[:5]) + ", .." * (len(neglected) > 5)
        text = (
            f"bends at the point loads at s = {which} m shift the cable by less than the tolerance: they have no "
            "moment; for it, say force_rod around them"
        )
        recorder.event(0.0, neglected[0], neglected[-1], "bending at point load neglected", text)


def _bends(model: Model, s: float) -> bool:
    """Whether an inner node at s has an element; the ends have their own say."""
    node = int(np.argmin(np.abs(model.line.s - s)))
    return bool(model.line.element[node]) or not 0 < node < model.line.h.size


def _neglected_clamps(scene: LineScene, model: Model) -> Iterator[tuple[float, str]]:
    """Clamps that lie in a catenary zone because they hardly shift the cable; who wants their moment has to ask."""
    line = model.line
    for name, end, cell in (("start", scene.ends.start, 0), ("end", scene.ends.end, -1)):
        if end.held_tangent is None or line.spin[cell]:
            continue
        s, far = float(line.s[cell]), float(line.s[-1])
        reach = min(4.0 * float(model.cable.bending_length(1e-9 * model.tension_scale / far)[cell]), far)
        stretch = f"[0, {reach:.3g}]" if cell == 0 else f"[{far - reach:.5g}, {far:.5g}]"
        text = (
            f"the clamp at ends.{name} shifts the cable by less than the tolerance: its bending is neglected, and it "
            "has no moment, as long as a catenary zone ends there; for its moment, and near resonance, say "
            f"force_rod: [{stretch}]"
        )
        yield s, text


def _limits(scene: LineScene, observer: Observer) -> list[tuple[Field, np.ndarray]]:
    """What reports hold a result against: limits of the sections, and of rods the bending stiffness.

    At jumps that of the section on the left, and in right/* of the one on the right, as of what they are held against.
    """
    beside = 3.0 * SAME_PLACE * scene.length
    jumps = observer.jumps
    left = observer.s - beside * np.isin(observer.s, jumps)
    scene, begin = whole_scene(scene)
    places = [("s", "", left - begin), ("right/s", "right/", jumps + beside - begin)][: 1 + bool(jumps.size)]
    out: list[tuple[Field, np.ndarray]] = []
    for dim, prefix, s in places:
        for name, values in limits_along(scene, s).items():
            unit, text, _ = SECTION_LIMITS[name]
            out.append((Field(f"{prefix}{name}", unit, f"{text}; NaN: none", s.shape, (dim,), nan_ok=True), values))
        if any(field.name == "torque" for field in observer.fields):
            name, text = (
                f"{prefix}bending_stiffness",
                "bending stiffness (without bend), the smaller of two directions",
            )
            out.append((Field(name, "N m^2", text, s.shape, (dim,)), weakest_bending(scene, s)))
            if np.isfinite(width := outer_diameter(scene, s)).any():
                name, text = f"{prefix}diameter", "outer diameter; NaN: none given"
                out.append((Field(name, "m", text, s.shape, (dim,), nan_ok=True), width))
    return out


def asked_limits(wanted: Mapping[str, Quantity]) -> list[tuple[Field, np.ndarray]]:
    """Limits of quantities by name."""
    out = []
    for name, q in wanted.items():
        if q.smallest is not None or q.largest is not None:
            bounds = np.array([np.nan if x is None else x for x in (q.smallest, q.largest)])
            text = f"smallest and largest {name} allowed; NaN: none"
            out.append((Field(f"limits/{name}", q.unit, text, (2,), ("bounds",), nan_ok=True), bounds))
    return out


# Of what the stress of a pipe is known to rise with: units of the rise.
STRESS_PER = {"tension": "1/m^2", "curvature": "Pa m"}


def _limits_of_quantities(observer: Observer) -> list[tuple[Field, np.ndarray]]:
    """Limits of what the scene asks for, and the largest stress of pipes."""
    if observer.quantities is None:
        return []
    out, pipes, text = asked_limits(observer.quantities.wanted), observer.quantities.pipes, "largest von Mises stress"
    if (capacities := observer.quantities.capacities) is not None:
        rows, what = capacities.rows(), "corners of capacity polygons: from and to (m), tension (N), curvature (1/m)"
        out.append((Field(CORNERS, "", what, rows.shape, ("corner", "capacity_row")), rows))
    if (codes := observer.quantities.codes) is not None:
        rows, what = codes.rows(), "sections that are checked by a code, as of hybrid.store.capacity.Row"
        out.append((Field(ROWS, "", what, rows.shape, ("code_row", "code_number")), rows))
    if pipes is None or np.isnan(pipes.limits).all():
        return out
    for name, s in (("", observer.s), ("right/", observer.jumps)):
        if s.size:
            allowed = pipes.largest_allowed(s, bool(name))
            field = Field(f"{name}max_stress", "Pa", f"{text} allowed; NaN: none", s.shape, (f"{name}s",), nan_ok=True)
            out.append((field, allowed))
            for (of, unit), gain in zip(STRESS_PER.items(), pipes.gains(s, bool(name)), strict=True):
                rise = f"rise of the stress of a pipe with {of}, at most; NaN: no pipe"
                out.append((Field(f"{name}stress_per_{of}", unit, rise, s.shape, (f"{name}s",), nan_ok=True), gain))
    return out


def mesh_fields(model: Model) -> list[tuple[Field, np.ndarray]]:
    """All nodes that the mesh may have, and which are there in rods alone: with the zones, the mesh of any time."""
    nodes, always = model.finest_nodes, np.ones(model.finest_nodes.size, np.int64)
    if model.layout is not None:
        always = np.isin(nodes, model.layout.base).astype(np.int64)
    if model.payout is not None:
        stays = model.payout.nodes <= model.payout.shortest
        always = np.isin(nodes, model.payout.along(model.payout.nodes[stays])).astype(np.int64)
    text = "1 where the node is always there, 0 where only while it lies in a rod zone"
    return [
        (Field("mesh/s", "m", "arc lengths of all nodes that there may be", nodes.shape, ("mesh/s",)), nodes),
        (Field("mesh/always", "", text, nodes.shape, ("mesh/s",), dtype="int64"), always),
    ]


def _mean_plane(sea: Sea) -> np.ndarray:
    """Unit normal and offset of the plane through the heights of a grid, by least squares."""
    x, y = (a.ravel() for a in np.meshgrid(sea.bed_x, sea.bed_y, indexing="ij"))
    z, *rise = np.linalg.lstsq(np.column_stack([np.ones_like(x), x, y]), sea.bed_heights[:, 0], rcond=None)[0]
    size = float(np.hypot(1.0, np.hypot(*rise)))
    return np.array([-rise[0], -rise[1], 1.0, z]) / size


def _depths(model: Model) -> list[tuple[Field, np.ndarray]]:
    """A seabed of depths on a grid, and how it lies under the ends of the cable."""
    sea = model.sea.values
    shape = sea.bed_x.size, sea.bed_y.size
    ends = planes_under(sea, model.start.r[[0, -1]])[0]
    what = "unit normals of the seabed under the start and the end, where they are first"
    return [
        (Field("seabed_x", "m", "x of the grid of depths", shape[:1], ("seabed_x",)), sea.bed_x),
        (Field("seabed_y", "m", "y of the grid of depths", shape[1:], ("seabed_y",)), sea.bed_y),
        (
            Field("seabed_height", "m", "height of the seabed", shape, ("seabed_x", "seabed_y"), "inertial"),
            sea.bed_heights[:, 0].reshape(shape),
        ),
        (Field("seabed_ends", "", what, (2, 3), ("ends", "xyz"), "inertial"), ends),
    ]


def _obstacle_shapes(model: Model) -> list[tuple[Field, np.ndarray]]:
    """What obstacles are, and where at t = 0."""
    sea, found = model.sea.values, []
    for k, name in enumerate(model.sea.names):
        row = sea.obstacles[k]
        place, axis, side = row[PLACE : PLACE + 3], row[AXIS : AXIS + 3], row[SIDE : SIDE + 3]
        if sea.carried.size:
            place, axis = sea.courses.position[k], sea.carried[k, STILL_AXIS : STILL_AXIS + 3]
            side = sea.carried[k, STILL_SIDE : STILL_SIDE + 3]
        half = row[HALF_LENGTH] if np.isfinite(row[HALF_LENGTH]) else -1.0
        what = "kind (0 plane, 1 round), place, axis or normal, radius, half its length (0: a ball, -1: endless)"
        shape = np.array([row[KIND], *place, *axis, row[RADIUS] - row[STRAND], half])
        if row[KIND] > ROUND:
            what = (
                "kind (2 box, 3 torus, 4 sheave, 5 mesh), place, axis, radius (edges, section, bottom of the groove), "
                "half lengths of flat faces of a box, second axis, radius of the ring, of the groove and of its rims"
            )
            more = row[HALF_WIDTH], row[HALF_HEIGHT], *side, row[RING]
            shape = np.array([*shape, *more, row[GROOVE] + row[STRAND], max(row[RIM] - row[STRAND], 0.0)])
        text, of = f"obstacle {name} at t = 0: {what}", "shape" if row[KIND] <= ROUND else "solid"
        found.append((Field(f"obstacles/{name}/shape", "", text, shape.shape, (of,), "inertial"), shape))
        if row[KIND] == MESH:
            found += _triangles(name, sea, int(row[ROOT]))
    return found


def _triangles(name: str, sea: Sea, root: int) -> list[tuple[Field, np.ndarray]]:
    """The surface of triangles of an obstacle, in axes of its own, so that it is drawn without its file."""
    leaves = sea.boxes[root : int(sea.boxes[root, BEHIND]), LEAF]
    corners = sea.facets[np.sort(leaves[leaves >= 0.0]).astype(np.int64), :NORMAL].reshape(-1, 3)
    points, of = np.unique(corners, axis=0, return_inverse=True)
    triangles, at = of.reshape(-1, 3).astype(np.int64), f"obstacles/{name}"
    what = f"corners of triangles of obstacle {name}, from its place"
    which = f"numbers of the corners of each triangle of obstacle {name}, counter-clockwise from outside"
    return [
        (Field(f"{at}/points", "m", what, points.shape, (f"{name}_corners", "xyz"), "body"), points),
        (
            Field(f"{at}/triangles", "", which, triangles.shape, (f"{name}_triangles", "three"), dtype="int64"),
            triangles,
        ),
    ]


def _surroundings(model: Model) -> list[tuple[Field, np.ndarray]]:
    """What pictures show besides the cable: seabed, still water, obstacles, what is attached."""
    line, sea = model.line, model.sea.values
    out: list[tuple[Field, np.ndarray]] = []
    if line.bits & SEABED:
        text = "plane of the seabed: unit normal n and offset c, n . x = c on it"
        plane = np.append(sea.normal, sea.offset)
        if sea.bed_x.size:
            text, plane = f"{text}; the mean of its depths", _mean_plane(sea)
            out += _depths(model)
        out.append((Field("seabed", "", text, (4,), ("plane",), "inertial"), plane))
    out += _obstacle_shapes(model)
    if line.bits & SURFACE:
        out.append((Field("surface", "m", "height of still water"), np.array(sea.surface)))
    if model.attached:
        text = "arc lengths of floats, clumps and end bodies"
        out.append((Field("attached", "m", text, (len(model.attached),), ("attached",)), np.array(model.attached)))
    return out


# Rows of the books: name, unit, what it is, and what a line needs to have it.
QUANTITIES = {
    b.TENSION: ("tension", "N", "tension", ""),
    b.CURVATURE: ("curvature", "1/m", "curvature", ""),
    b.MOMENT: ("bending_moment", "N m", "bending moment of the elastic strain", "rod"),
    b.TORQUE: ("torque", "N m", "torque of the elastic strain", "torsion"),
    b.PRESSURE: ("contact", "N/m", "normal force of the seabed per length", "seabed"),
    b.SELF_PRESSURE: ("self_contact", "N/m", "force per length where the line touches itself", "self_contact"),
    b.OBSTACLE_PRESSURE: ("obstacle_contact", "N/m", "force per length of obstacles across the line", "obstacles"),
    b.DISPLACEMENT: ("displacement", "m", "distance from where the node was at the start", "time"),
    b.WALL_TENSION: ("wall_tension", "N", "tension in the wall", "pipe"),
    b.VON_MISES: ("von_mises", "Pa", "largest von Mises stress in the wall of a pipe", "pipe"),
}

_S_TEXT = (
    "arc lengths of nodes; point loads, changes of section and ends of modules come twice, with the value before and "
    "after them"
)
# What is known of a line that was never near itself: infinite distances.
NEVER_NEAR = blank_itself(np.ones(1)).found


def marked_places(scene: LineScene, model: Model) -> tuple[tuple[float, int], ...]:
    """Arc lengths, m, of point loads, ends of modules and changes of section, with their bits of state.books."""
    edges = [x for modules in attached(scene, Modules) for x in modules.range]
    loads = tuple((float(x), b.LOADED) for x in (*model.attached, *edges))
    return loads + tuple((float(x), b.SEAM) for x in section_changes(scene))


def marks_on(s: Floats, places: Sequence[tuple[float, int]]) -> np.ndarray:
    """Bits (N+1,) of kernels.state.books for nodes s (N+1,) m; those of the ends are left out."""
    marks = np.zeros(s.size, np.int8)
    for x, bit in places:
        marks[np.argmin(np.abs(s - x))] |= bit
    marks[[0, -1]] = 0
    return marks


def marks_of(scene: LineScene, model: Model) -> np.ndarray:
    """The same for the nodes of a model."""
    return marks_on(model.line.s, marked_places(scene, model))


def _rods(model: Model) -> np.ndarray:
    """(N,) whether the cells of a model are rod."""
    return model.line.spin != 0 if model.layout is None else model.layout.rod_cells


def _doubled(nodes: Floats, marked: Floats) -> Floats:
    """Nodes (N+1,) m with those that are marked (K,) m twice."""
    if not marked.size:
        return nodes
    return np.insert(nodes, np.searchsorted(nodes, marked), marked)


def _parts_of(scene: LineScene, model: Model, moves: bool, touches: bool) -> set[str]:
    """What a line has, or may have in a run, that its extremes depend on; arguments are those of `Envelope`."""
    out = {"", *({"rod"} if moves and model.layout is not None else {zone.kind for zone in model.zones})}
    out |= ({"seabed"} if model.line.bits & SEABED else set()) | ({"time"} if moves else set())
    out |= {"obstacles"} if model.line.bits & OBSTACLES else set()
    touching = SELF_CONTACT | (MAY_TOUCH | MAY_MEET if moves else 0)
    out |= {"self_contact"} if touches or model.line.bits & touching else set()
    begun = as_begun(model.line, model.held, scene.dimension)
    return out | ({"torsion"} if "rod" in out or (begun.torsion.size and not begun.bits & PLANAR) else set())


class Envelope:
    """Extremes of one run or equilibrium, lowest and highest with their times, at places s (n,) m.

    Places are nodes; those where a quantity may have two values come twice, the left value first.
    """

    def __init__(self, scene: LineScene, model: Model, moves: bool, touches: bool = False) -> None:
        """moves: whether there are steps; of an equilibrium the nodes are those of its line.

        touches: whether it is one in which lines touch each other.
        """
        layout = model.layout if moves else None
        nodes = model.nodes.copy() if layout is None else layout.finest.nodes
        if moves and model.payout is not None:
            nodes = model.payout.finest
        marked = model.nodes[np.flatnonzero(marks_of(scene, model))]
        self.nodes, self._marked = nodes, marked
        self.s = _doubled(nodes, marked)
        self.start: Floats = np.zeros((nodes.size, 3))  # m, from where displacements count
        self.begin = 0.0  # s
        self.bounds = no_extremes(self.s.size)  # of meshes before that of now
        pipes = Pipes(scene) if any(x.pipe for x in scene.cable.sections) else None
        parts = _parts_of(scene, model, moves, touches) | ({"pipe"} if pipes is not None else set())
        self._rows = {row: what for row, what in QUANTITIES.items() if what[3] in parts}
        side = 3.0 * SAME_PLACE * model.length  # beyond which a place is no longer at a change of section
        first, second = (np.flatnonzero(np.diff(self.s) == 0.0) + k for k in (0, 1))
        beside = self.s.copy()
        beside[first] -= side
        beside[second] += side
        whole, begin = whole_scene(scene)
        self._limits = limits_along(whole, beside - begin)
        self._walls = pipes.has_wall(beside) if pipes is not None else np.zeros(0, bool)
        self._stress = np.full(self.s.size, np.nan)
        if pipes is not None:
            self._stress = pipes.largest_allowed(beside, True)
        self._grows = model.payout is not None
        if moves and model.line.bits & (MAY_TOUCH | MAY_MEET) and not model.line.bits & SELF_CONTACT:
            self.bounds[:, b.SELF_PRESSURE] = 0.0  # there is no contact before it is computed
        self.itself = SelfWatch(model, no_contact(scene)) if moves else SelfWatch(model)
        asked = scene.output.quantities if moves else {}
        self.quantities = StepQuantities(scene, asked, pipes)

    # --- what is kept -------------------------------------------------------------------------------

    def count_from(self, model: Model, r: Floats) -> None:
        """Displacements count from the positions r (N+1, 3) m of the nodes of a model."""
        s, at = model.line.s, np.clip(self.nodes, model.line.s[0], model.line.s[-1])
        self.start[:] = Grid(s, model.zones, at, model.attached).nodes @ r
        self.start[np.searchsorted(self.nodes, model.nodes)] = r  # to the last bit: a restored line counts from there

    def start_of(self, nodes: Floats) -> Floats:
        """Positions (N+1, 3) m from which displacements of nodes (N+1,) m count."""
        return self.start[np.searchsorted(self.nodes, nodes)]

    def _with(self, nodes: Floats, extremes: Floats) -> Floats:
        """All extremes (4, EXTREMES, n), with those (4, EXTREMES, N+1+K) of the mesh of now."""
        out, places = self.bounds.copy(), _doubled(nodes, self._marked)
        columns = np.arange(places.size) - np.cumsum(second := np.append(False, places[1:] == places[:-1]))
        columns[second] = nodes.size + np.arange(self._marked.size)
        if places.size < self.s.size and not self._grows:
            fold_extremes(places, self.s, columns, extremes, out)
            return out
        now = extremes[:, :, columns]
        first, last = np.searchsorted(self.s, places[0]), np.searchsorted(self.s, places[-1], "right")
        if last - first > places.size:  # cells that follow the curvature, of a line that is paid out
            there = np.ascontiguousarray(out[:, :, first:last])
            fold_extremes(places, self.s[first:last], columns, extremes, there)
            out[:, :, first:last] = there
            return out
        some = out[:, :, first : first + places.size]  # of a line that is paid out there may be more
        for row in self._rows:
            if np.isfinite(now[:, row]).all():  # else no state was computed yet
                for bound, better in ((0, np.less), (1, np.greater)):
                    found = better(now[bound, row], some[bound, row])
                    some[bound::2, row][:, found] = now[bound::2, row][:, found]  # with its time
        return out

    # --- checkpoints --------------------------------------------------------------------------------

    def checkpoint(self, now: Floats) -> dict[str, Any]:
        """What was kept; now: extremes on the mesh of now."""
        return {
            "begin": self.begin,
            "start": self.start,
            "bounds": self.bounds.copy(),
            "now": now.copy(),
            "itself": self.itself.itself.found.copy(),
        } | ({"quantities": self.quantities.reached.copy()} if self.quantities else {})

    def restore(self, saved: Mapping[str, Any], now: Floats) -> None:
        """Go on as `checkpoint` has written, into `now`.  ValueError: it is that of another line."""
        mine = self.checkpoint(now)
        mine["itself"] = NEVER_NEAR
        older: dict[str, Any] = {"itself": self.itself.itself.found}  # files of before have none
        saved = dict(saved)
        known = saved.get("itself")
        if isinstance(known, np.ndarray) and known.shape == (OF_0_6,):  # nor when contact may end
            saved["itself"] = np.append(known, mine["itself"][OF_0_6:])
        for name in ("bounds", "now"):  # nor wall tension, stress and the force of obstacles
            saved[name] = with_all_rows(saved.get(name))
        self.quantities.restore(saved.get("quantities"))
        older |= {"quantities": self.quantities.reached} if self.quantities else {}
        found = matched(older | saved, mine, "state/envelope")
        self.begin, self.start[:], self.bounds[:] = found["begin"], found["start"], found["bounds"]
        now[:], self.itself.itself.found[:] = found["now"], found["itself"]

    def begin_at(self, t: float, model: Model, r: Floats, note: Callable[..., None]) -> None:
        """Extremes begin at t (s), with nodes at r (N+1, 3) m, and an event says so; note: as Recorder.event.

        Files of 0.6 have none.
        """
        self.begin = t
        self.count_from(model, r)
        text = f"the file has no extremes of the steps before t = {t:.6g} s: the envelope is of those after it"
        note(t, 0.0, model.length, "envelope incomplete", text)

    # --- for the file -------------------------------------------------------------------------------

    def fixed(self) -> list[tuple[Field, np.ndarray]]:
        """Fields of a new file, with values: nodes and limits as they are, extremes not yet known."""
        n, dims, unknown = (self.s.size,), (SCALE,), np.full(self.s.size, np.nan)
        out = [(Field(SCALE, "m", _S_TEXT, n, dims), self.s)]
        for name, values in self._limits.items():
            unit, text, _ = SECTION_LIMITS[name]
            out.append((Field(f"{GROUP}/{name}", unit, f"{text}; NaN: none", n, dims, nan_ok=True), values))
        if np.isfinite(self._stress).any():
            full, of = f"{GROUP}/max_stress", "largest von Mises stress allowed; NaN: none"
            out.append((Field(full, "Pa", of, n, dims, nan_ok=True), self._stress))
        for name, unit, text, _ in self._rows.values():
            for bound, word in (("min", "smallest"), ("max", "largest")):
                full, of = f"{GROUP}/{name}_{bound}", f"{word} {text} at any accepted step"
                out.append((Field(full, unit, of, n, dims, nan_ok=True), unknown))
                when = Field(f"{GROUP}/{name}_t_{bound}", "s", f"time of {name}_{bound}", n, dims, nan_ok=True)
                out.append((when, unknown))
        for name, text in ((BEGIN, "the steps counted begin"), (END, "they end, so far")):
            out.append((Field(name, "s", f"extremes are of all accepted steps: when {text}", nan_ok=True), unknown[0]))
        out += [(field, np.full(field.shape, np.nan)) for field in self.quantities.fields()]
        return out + [(field, unknown[0]) for field in self.itself.fields()]

    def note_broken(
        self, values: Mapping[str, np.ndarray], outputs: Recorded | None, note: Callable[..., None]
    ) -> None:
        """An event for every limit that those values, or the outputs, break; note: as Recorder.event."""
        for x in limits_of(outputs, {field.name: x for field, x in self.fixed()} | dict(values)):
            if x.broken:
                note(x.t, x.s, x.s, LIMIT_EVENTS[x.limit], x.text, value=x.value, threshold=x.allowed)

    def values(self, nodes: Floats, extremes: Floats, t: float) -> dict[str, np.ndarray]:
        """Values of those fields up to time t (s), with the extremes (4, EXTREMES, N+1+K) of the mesh of now."""
        bounds = self._with(nodes, extremes)
        out = {BEGIN: np.array(self.begin), END: np.array(t), **self.itself.values(), **self.quantities.values()}
        for row, (name, *_) in self._rows.items():
            for k, bound in enumerate(("min", "max")):
                x = bounds[k, row]
                if row == b.VON_MISES:
                    x = np.where(self._walls, x, np.inf)
                out[f"{GROUP}/{name}_{bound}"] = np.where(np.isfinite(x), x, np.nan)
                out[f"{GROUP}/{name}_t_{bound}"] = bounds[2 + k, row]
        return out


def with_all_rows(x: Any) -> Any:
    """Extremes of a checkpoint, with unknown ones of pipes and of obstacles where it has none."""
    if not (isinstance(x, np.ndarray) and x.ndim == 3 and x.shape[1] in (b.WALL_TENSION, b.OBSTACLE_PRESSURE)):
        return x
    more = np.full((len(x), b.EXTREMES - x.shape[1], x.shape[2]), np.nan)
    return np.concatenate([x, more], axis=1)
