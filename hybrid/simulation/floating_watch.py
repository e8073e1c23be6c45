"""Events where what floats is pulled under water, and where a body that counts as submerged rises out of it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from hybrid.errors import ComputationError, SceneError
from hybrid.kernels.run.network_sampling import SAMPLE_AXES, SAMPLE_PLACE
from hybrid.kernels.state.state import Floats, Sea
from hybrid.model.network import NetworkModel, build_system
from hybrid.scene.attachments import sphere_diameter
from hybrid.scene.network_scene import Network
from hybrid.scene.points import FixedPoint, FreePoint
from hybrid.simulation.run_points import Sampled, times
from hybrid.simulation.run_start import equilibrium_of_system

Tell = Callable[[float, float, float, str, str], None]
# Of the height of a point: what it must be below the surface to be under water, beyond round-off.
UNDER = 1e-3
# An event follows another where a point is so many times deeper.
DEEPER = 3.0


def note_dry_bodies(system: Network, model: NetworkModel, seen: Sampled, dry: set[str], tell: Tell) -> None:
    """An event where a body that counts as submerged has risen out of the water; dry: names of those told already."""
    fluid = system.environment.fluid
    if fluid is None or fluid.surface is None:
        return
    for k, body in enumerate(model.bodies):
        given = system.free_bodies[body.name]
        if not given.volume or body.name in dry:
            continue
        arm = times(seen.frame(k), np.array(given.centre_of_buoyancy, float))
        centre = seen.bodies[:, k, SAMPLE_PLACE:SAMPLE_AXES] + arm
        above = centre[:, 2] - fluid.surface
        if (above > 0.0).any():
            first = int((above > 0.0).argmax())
            dry.add(body.name)
            text = f"body {body.name}: the centre of its volume is {above[first]:.4g} m above the surface, but"
            text += " all of its buoyancy still lifts it"
            tell(float(seen.t[first]), 0.0, 0.0, "body out of water", text)


def note_pulled_under(
    system: Network, model: NetworkModel, seen: Sampled, depths: dict[str, float], tell: Tell, *, moves: bool
) -> None:
    """An event where a point that floats by itself is wholly below the surface, and where it is much deeper.

    depths: m, by name, that the last event of each has told; they are kept up to date.  moves: whether `seen` is of a
    motion, in waves; else of an equilibrium.
    """
    fluid = system.environment.fluid
    if fluid is None or fluid.surface is None:
        return
    level = fluid.surface
    for name in _floating(system, level):
        point = system.points[name]
        assert isinstance(point, FreePoint)
        r, pull = _held(system, model, seen, name)
        eta = level + (_elevations(model.models[0].sea.values, r, seen.lines[0].sea_now) if moves else 0.0)
        height = _height(point)
        depth = eta - r[:, 2] - 0.5 * height
        for k in np.flatnonzero(depth > UNDER * height):
            if name in depths and depth[k] <= DEEPER * depths[name]:
                continue
            text = f"point {name}: its top is {depth[k]:.3g} m below the surface, although it floats by itself"
            text += f": its buoyancy less its weight is {_net(system, point):.4g} N at most"
            if moves:
                text += f", and its lines pull it down by {pull[k]:.4g} N"
            else:
                text += _at_surface(system, point, name, r[k], level - 0.5 * height)
            tell(float(seen.t[k]), 0.0, 0.0, "pulled under", text)
            depths[name] = float(depth[k])


def _floating(system: Network, level: float) -> list[str]:
    """Names of the points that are more buoyant than heavy, and are to float at a level (m).

    They have a height, which nothing but the surface asks for, or are first put at the surface; a buoy that is moored
    in the depth has and is neither.
    """
    found = []
    for name, point in system.points.items():
        if isinstance(point, FreePoint) and point.volume and _net(system, point) > 0.0:
            place = point.initial_guess
            top = -math.inf if place is None else place[2] + 0.5 * _height(point)
            if point.height is not None or top >= level:
                found.append(name)
    return found


def _height(point: FreePoint) -> float:
    """Its vertical extent, m."""
    return point.height or sphere_diameter(point.volume)


def _net(system: Network, point: FreePoint) -> float:
    """Buoyancy of its whole volume less its weight, N."""
    fluid = system.environment.fluid
    assert fluid is not None
    return system.environment.gravity * (fluid.density * point.volume - point.mass)


def _held(system: Network, model: NetworkModel, seen: Sampled, name: str) -> tuple[Floats, Floats]:
    """Places (nb, 3) m of a point, and by how much its lines pull it down (nb,) N."""
    pull, place = np.zeros(len(seen.t)), np.zeros((len(seen.t), 3))
    for line, end in system.lines_at(name):
        k, last = model.names.index(line), end == "end"
        if (k, int(last)) in model.loose:
            continue
        batch, i = seen.lines[k], -int(last)
        place = batch.r[:, i]
        up = batch.T[:, i] * batch.e[:, i, 2] / np.linalg.norm(batch.e[:, i], axis=1)
        pull += up if last else -up
    return place, pull


def _elevations(sea: Sea, r: Floats, now: Floats) -> Floats:
    """Elevation (nb,) m above still water at places (nb, 3) m; now: (nb, 4) `Sea.now`."""
    A, w, kx, ky, phase, _ = sea.waves.T
    angle = r[:, :1] * kx + r[:, 1:2] * ky + phase - now[:, :1] * w
    return np.asarray(now[:, 2] * (np.cos(angle) @ A))


def _at_surface(system: Network, point: FreePoint, name: str, place: Floats, z: float) -> str:
    """What the lines would pull of a point at rest that just floats, at a height z (m), and what would bear them."""
    fluid = system.environment.fluid
    assert fluid is not None
    held = FixedPoint(position=(float(place[0]), float(place[1]), z))
    fixed = system.model_copy(update={"points": {**system.points, name: held}})

    try:
        model = build_system(fixed)
        found = equilibrium_of_system(fixed, model, np.inf, friction=False)
    except (ComputationError, SceneError, ValueError):  # ValueError: lines that do not reach so far make no scene
        return ", and its lines pull it down by as much"
    pull = 0.0
    for line, end in fixed.lines_at(name):
        state, last = found.state.lines[model.names.index(line)], end == "end"
        up = float(state.T[-int(last)] * state.e[-int(last), 2] / np.linalg.norm(state.e[-int(last)]))
        pull += up if last else -up
    volume = (pull / system.environment.gravity + point.mass) / fluid.density if system.environment.gravity else 0.0
    text = f", and its lines would pull it down by {pull:.4g} N at the surface"
    return text + (f": a volume of {volume:.3g} m^3 would float them" if volume > point.volume else "")
