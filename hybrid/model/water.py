"""What water does to a line, per half cell and per body: drag, added mass, buoyancy, with the attachments in it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from hybrid.model.properties import attachments_at, modules_of
from hybrid.model.state import Floats
from hybrid.physics.loads import ADDED_MASS, BODIES, DRAG, FLOW, SURFACE, WAVES
from hybrid.scene.schema import Scene, Section


@dataclass
class Water:
    """Arrays for `Line`, the bits that they ask for, and what attachments add to mass and weight.

    mass: (N+1,) kg and lift: (N+1,) N upwards, constant: what attachments weigh, and all
    buoyancy that does not depend on the surface.
    """

    mass: Floats
    lift: Floats
    bits: int = 0
    arrays: dict[str, Floats] = field(default_factory=dict)


CELLS = ("drag_n", "drag_t", "added_n", "added_t", "buoy", "displaced", "diameter")
NODES = ("point_drag", "point_added", "point_buoy", "point_displaced", "point_height")


def water(scene: Scene, s: Floats, of: Sequence[Section]) -> Water:
    """The water around the cells of a line with nodes s (N+1,) and sections `of` its cells."""
    h = np.diff(s)
    n = h.size
    out = Water(np.zeros(n + 1), np.zeros(n + 1))
    out.arrays = {x: np.full(n, np.nan) for x in CELLS} | {x: np.full(n + 1, np.nan) for x in NODES}
    fluid, gravity = scene.environment.fluid, scene.environment.gravity
    density = fluid.density if fluid else 0.0

    def per_cell(f: Callable[[Section], float]) -> Floats:
        return np.array([f(x) for x in of], float)

    # per metre: displaced volume, and what modules add
    volume = per_cell(lambda x: np.pi / 4 * (x.diameter or 0.0) ** 2) if fluid else np.zeros(n)
    area = np.zeros(n)  # drag area of modules
    carried, extra = np.zeros(n), np.zeros(n)  # their mass and added mass
    middle = 0.5 * (s[:-1] + s[1:])
    for m in modules_of(scene):
        on = (middle > m.over[0]) & (middle < m.over[1])
        carried[on] += m.mass
        if fluid:
            volume[on] += m.volume_in(density, gravity)
            area[on] += m.drag_area
            extra[on] += m.added_mass
    _to_nodes(out.mass, 0.5 * h * carried)
    out.lift -= gravity * out.mass
    out.arrays["point_mass"] = np.zeros(n + 1)
    if fluid:
        _around_cells(out, scene, h, of, volume, area, extra, per_cell)
    _bodies(out, scene, s, density)
    return out


def _to_nodes(nodes: Floats, half_cells: Floats) -> None:
    nodes[:-1] += half_cells
    nodes[1:] += half_cells


def _around_cells(
    out: Water,
    scene: Scene,
    h: Floats,
    of: Sequence[Section],
    volume: Floats,
    area: Floats,
    extra: Floats,
    per_cell: Callable[[Callable[[Section], float]], Floats],
) -> None:
    fluid = scene.environment.fluid
    assert fluid is not None
    rho = fluid.density
    if any(x.drag for x in of) or area.any():
        out.bits |= DRAG
        normal = per_cell(lambda x: x.drag.normal * (x.diameter or 0.0) if x.drag else 0.0)
        tangential = per_cell(lambda x: np.pi * x.drag.tangential * (x.diameter or 0.0) if x.drag else 0.0)
        out.arrays["drag_n"] = 0.25 * rho * h * (normal + area)
        out.arrays["drag_t"] = 0.25 * rho * h * tangential
    if any(x.added_mass for x in of) or extra.any():
        out.bits |= ADDED_MASS
        disc = per_cell(lambda x: rho * np.pi / 4 * (x.diameter or 0.0) ** 2)
        out.arrays["added_n"] = (
            0.5 * h * (disc * per_cell(lambda x: x.added_mass.normal if x.added_mass else 0.0) + extra)
        )
        out.arrays["added_t"] = 0.5 * h * disc * per_cell(lambda x: x.added_mass.tangential if x.added_mass else 0.0)
    if fluid.current is not None:
        out.bits |= FLOW
    if fluid.waves is not None:
        out.bits |= WAVES
        out.arrays["displaced"] = 0.5 * h * rho * volume
    buoyancy = 0.5 * h * rho * scene.environment.gravity * volume
    if fluid.surface is not None:
        out.bits |= SURFACE
        out.arrays["buoy"] = buoyancy
        out.arrays["diameter"] = np.sqrt(4.0 / np.pi * volume)
    else:
        _to_nodes(out.lift, buoyancy)


def _bodies(out: Water, scene: Scene, s: Floats, density: float) -> None:
    fluid, gravity = scene.environment.fluid, scene.environment.gravity
    point = {x: np.zeros(s.size) for x in NODES}
    for at, body in attachments_at(scene):
        i = int(np.argmin(np.abs(s - at)))
        out.mass[i] += body.mass
        out.arrays["point_mass"][i] += body.mass
        out.lift[i] -= gravity * body.mass
        if fluid is None:
            continue
        displaced = density * body.volume_in(density, gravity)
        point["point_drag"][i] += 0.5 * density * body.drag_area
        point["point_added"][i] += body.added_mass
        point["point_displaced"][i] += displaced
        if fluid.surface is None:
            out.lift[i] += gravity * displaced
        elif displaced > 0.0:
            point["point_buoy"][i] += gravity * displaced
            point["point_height"][i] = max(point["point_height"][i], body.height_in(density, gravity))
    asked = ["point_drag", "point_added", "point_buoy"] + (["point_displaced"] if out.bits & WAVES else [])
    if any(point[x].any() for x in asked):
        out.bits |= BODIES
        out.arrays |= point
