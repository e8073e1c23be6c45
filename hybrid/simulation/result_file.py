"""The file of a result: its fields, what is known before the first step, and events on bending that is neglected."""

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
from hybrid.model.sections import NEAR, SECTION_LIMITS, limits_along, outer_diameter, weakest_bending
from hybrid.outputs.probes import Observer
from hybrid.scene.quantities import Quantity
from hybrid.scene.schema import LineScene
from hybrid.simulation.envelope import Envelope
from hybrid.store.capacity import CORNERS, ROWS
from hybrid.store.format import Field, Header, Text
from hybrid.store.recorder import Rows

if TYPE_CHECKING:
    from hybrid.solve.lines_at_rest import LinesAtRest

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
    Field("end_force_end", "N", "the same at the end; of an end body: tension of the last cell"),
    Field("cpu", "s", "processor time since the start of the run"),
)


def result_header(
    scene: LineScene, model: Model, observer: Observer, texts: Mapping[str, Text], found: LinesAtRest | None,
    envelope: Envelope, outputs: int, notes: Mapping[str, str],
) -> Header:  # fmt: skip
    """What the result of a line states before its first output.

    found: the equilibrium at the start; envelope: of what is computed, its values not yet known; outputs: after the
    first, 0 of an equilibrium; notes: texts that are attributes of the result unless they are empty.
    """
    attributes: dict[str, str | float | int] = {
        "title": scene.title, "cells": model.cells, "length": model.length, "tension_scale": model.tension_scale,
    }  # fmt: skip
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
    beside = 3.0 * NEAR * scene.length
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


def limits_of(wanted: Mapping[str, Quantity]) -> list[tuple[Field, np.ndarray]]:
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
    out, pipes, text = limits_of(observer.quantities.wanted), observer.quantities.pipes, "largest von Mises stress"
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
