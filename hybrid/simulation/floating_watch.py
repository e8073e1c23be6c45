"""Bodies and floats at outputs: pulled under water, out of it, in each other, out of the plane of the lines."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from hybrid.errors import ComputationError, Outcome, SceneError
from hybrid.kernels.junctions.bodies import FRAME, V
from hybrid.kernels.junctions.bodies import PLACE as BODY_PLACE
from hybrid.kernels.laws.obstacles import distances, put_obstacles
from hybrid.kernels.laws.seabed import planes_under
from hybrid.kernels.run.network import SAMPLE_AXES, SAMPLE_PLACE
from hybrid.kernels.state.report import (
    AXIS,
    BOX,
    HALF_LENGTH,
    HALF_WIDTH,
    OBSTACLES,
    PLACE,
    RADIUS,
    RIDES,
    SEABED,
    SIDE,
    STRAND,
)
from hybrid.kernels.state.state import Floats, Sea
from hybrid.model.network import NetworkModel, build_network
from hybrid.outputs.probes import elevation
from hybrid.scene.attachments import sphere_diameter
from hybrid.scene.ends import FixedPoint, FreePoint
from hybrid.scene.network import Network
from hybrid.scene.plane import OUT
from hybrid.simulation.equilibrium import equilibrium_of
from hybrid.simulation.parts import Part, Sampled, times
from hybrid.simulation.run_of_lines import RunOfLines
from hybrid.solve.stepper import LineFailed

# Of the height of a point: what it must be below the surface to be under water, beyond round-off.
UNDER = 1e-3
# An event follows another where a point is so many times deeper.
DEEPER = 3.0


class FloatingWatch(Part):
    """Events where a body is out of the water, what floats is pulled under, or bodies are in each other."""

    name, older = "floating", MappingProxyType({"under": {}, "overlaps": []})

    def __init__(self, run: RunOfLines, moves: bool) -> None:
        """moves: whether outputs are of a motion, in waves; else of an equilibrium."""
        self._run, self._moves = run, moves
        self.dry: set[str] = set()  # bodies that have been said to be out of the water
        self.overlaps: set[str] = set()  # and what has been said to be in each other
        self.under: dict[str, float] = {}  # depth (m) of points at the last event of each

    def checkpoint(self) -> dict[str, Any]:
        """What has been said."""
        return {"dry": sorted(self.dry), "under": dict(self.under), "overlaps": sorted(self.overlaps)}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """That has been said.  ValueError: it has names that the run does not have."""
        dry, under, overlaps, network = saved["dry"], saved["under"], saved["overlaps"], self._run.network
        if not (isinstance(dry, list) and set(dry) <= set(network.bodies)):
            raise ValueError("dry: names of bodies were expected")
        if not (isinstance(overlaps, list) and all(isinstance(x, str) for x in overlaps)):
            raise ValueError("overlaps: what is in each other was expected")
        if not (isinstance(under, dict) and set(under) <= set(network.points)):
            raise ValueError("under: names of points were expected")
        self.dry, self.overlaps = set(dry), set(overlaps)
        self.under = {name: float(depth) for name, depth in under.items()}

    def at_output(self, seen: Sampled) -> None:
        """Look at outputs.  LineFailed where a body has left the plane of the lines and is to stay in it."""
        self._note_dry_bodies(seen)
        self._note_overlaps(seen)
        self._note_pulled_under(seen)
        self._keep_in_plane()

    def _event(self, t: float, kind: str, text: str) -> None:
        self._run.recorder.event(float(t), 0.0, 0.0, kind, text)

    def _note_dry_bodies(self, seen: Sampled) -> None:
        """An event where a body that counts as submerged has risen out of the water."""
        network = self._run.network
        fluid = network.environment.fluid
        if fluid is None or fluid.surface is None:
            return
        for k, body in enumerate(self._run.model.bodies):
            given = network.free_bodies[body.name]
            if not given.volume or body.name in self.dry:
                continue
            arm = times(seen.frame(k), np.array(given.centre_of_buoyancy, float))
            centre = seen.bodies[:, k, SAMPLE_PLACE:SAMPLE_AXES] + arm
            above = centre[:, 2] - fluid.surface
            if (above > 0.0).any():
                first = int((above > 0.0).argmax())
                self.dry.add(body.name)
                text = f"body {body.name}: the centre of its volume is {above[first]:.4g} m above the surface, but"
                self._event(seen.t[first], "body out of water", f"{text} all of its buoyancy still lifts it")

    def _note_pulled_under(self, seen: Sampled) -> None:
        """An event where a point that floats by itself is wholly below the surface, and where it is much deeper."""
        network, model = self._run.network, self._run.model
        fluid = network.environment.fluid
        if fluid is None or fluid.surface is None:
            return
        level = fluid.surface
        for name in _floating(network, level):
            point = network.points[name]
            assert isinstance(point, FreePoint)
            r, pull = _held(network, model, seen, name)
            now, sea = seen.lines[0].sea_now, model.models[0].sea.values
            waves = np.diagonal(elevation(sea, r[:, :2], now)) if self._moves else 0.0
            height = _height(point)
            depth = level + waves - r[:, 2] - 0.5 * height
            for k in np.flatnonzero(depth > UNDER * height):
                if name in self.under and depth[k] <= DEEPER * self.under[name]:
                    continue
                text = f"point {name}: its top is {depth[k]:.3g} m below the surface, although it floats by itself"
                text += f": its buoyancy less its weight is {_net(network, point):.4g} N at most"
                if self._moves:
                    text += f", and its lines pull it down by {pull[k]:.4g} N"
                else:
                    text += _at_surface(network, point, name, r[k], level - 0.5 * height)
                self._event(seen.t[k], "pulled under", text)
                self.under[name] = float(depth[k])

    def _note_overlaps(self, seen: Sampled) -> None:
        """An event for each pair of bodies, or body and obstacle or bed, that are in each other."""
        lines = zip(self._run.model.models, seen.lines, strict=True)
        found = next(((x, batch) for x, batch in lines if x.line.bits & OBSTACLES), None)
        if found is None or not found[0].sea.values.carried.size or not found[0].sea.values.carried[:, RIDES].any():
            return
        x, batch = found
        sea, names = x.sea.values, x.sea.names
        for k, t in enumerate(batch.t.tolist()):
            rows = sea.obstacles.copy()
            if batch.obstacles.size:
                put_obstacles(rows, sea.carried, batch.obstacles[k])
            for pair, deep in _overlaps(sea._replace(obstacles=rows), names, bool(x.line.bits & SEABED)):
                if (key := " in ".join(pair)) not in self.overlaps:
                    self.overlaps.add(key)
                    text = f"body {pair[0]} is {deep:.3g} m deep in {pair[1]}: lines touch the shapes of bodies, but"
                    self._event(t, KIND_OF_EVENT, f"{text} bodies touch neither each other nor obstacles nor the bed")

    def _keep_in_plane(self) -> None:
        """LineFailed where a body has left the plane of the lines, by its place or its turn, and is to stay in it."""
        run, model = self._run, self._run.model
        if (normal := model.models[0].kept_in) is None:
            return
        first = model.models[0].start.r[0]
        for k, (row, begun) in enumerate(zip(run.state.bodies, model.body_places, strict=True)):
            out = abs(float((row[BODY_PLACE:FRAME] - first) @ normal)) / model.models[0].length
            R, R0 = (x[FRAME:V].reshape(3, 3) for x in (row, begun))
            if max(out, float(np.abs(R @ R0.T @ normal - normal).max())) > OUT:
                names = [*(body.name for body in model.bodies), *model.rigid]
                raise LineFailed(-1, Outcome.LEFT_PLANE, run.t, None, f"{names[k]} leaves it")


def _floating(network: Network, level: float) -> list[str]:
    """Names of the points that are more buoyant than heavy, and are to float at a level (m).

    They have a height, which nothing but the surface asks for, or are first put at the surface; a buoy that is moored
    in the depth has and is neither.
    """
    found = []
    for name, point in network.points.items():
        if isinstance(point, FreePoint) and point.volume and _net(network, point) > 0.0:
            place = point.initial_guess
            top = -math.inf if place is None else place[2] + 0.5 * _height(point)
            if point.height is not None or top >= level:
                found.append(name)
    return found


def _height(point: FreePoint) -> float:
    """Its vertical extent, m."""
    return point.height or sphere_diameter(point.volume)


def _net(network: Network, point: FreePoint) -> float:
    """Buoyancy of its whole volume less its weight, N."""
    fluid = network.environment.fluid
    assert fluid is not None
    return network.environment.gravity * (fluid.density * point.volume - point.mass)


def _held(network: Network, model: NetworkModel, seen: Sampled, name: str) -> tuple[Floats, Floats]:
    """Places (nb, 3) m of a point, and by how much its lines pull it down (nb,) N."""
    pull, place = np.zeros(len(seen.t)), np.zeros((len(seen.t), 3))
    for line, end in network.lines_at(name):
        k, last = model.names.index(line), end == "end"
        if (k, int(last)) in model.loose:
            continue
        batch, i = seen.lines[k], -int(last)
        place = batch.r[:, i]
        up = batch.T[:, i] * batch.e[:, i, 2] / np.linalg.norm(batch.e[:, i], axis=1)
        pull += up if last else -up
    return place, pull


def _at_surface(network: Network, point: FreePoint, name: str, place: Floats, z: float) -> str:
    """What the lines would pull of a point at rest that just floats, at a height z (m), and what would bear them."""
    fluid = network.environment.fluid
    assert fluid is not None
    held = FixedPoint(position=(float(place[0]), float(place[1]), z))
    fixed = network.model_copy(update={"points": {**network.points, name: held}})

    try:
        model = build_network(fixed)
        found = equilibrium_of(fixed, model, np.inf, friction=False)
    except (ComputationError, SceneError, ValueError):  # ValueError: lines that do not reach so far make no scene
        return ", and its lines pull it down by as much"
    pull = 0.0
    for line, end in fixed.lines_at(name):
        state, last = found.state.lines[model.names.index(line)], end == "end"
        up = float(state.T[-int(last)] * state.e[-int(last), 2] / np.linalg.norm(state.e[-int(last)]))
        pull += up if last else -up
    volume = (pull / network.environment.gravity + point.mass) / fluid.density if network.environment.gravity else 0.0
    text = f", and its lines would pull it down by {pull:.4g} N at the surface"
    return text + (f": a volume of {volume:.3g} m^3 would float them" if volume > point.volume else "")


# Events where a body with a shape is in another one, in an obstacle or in the seabed: lines alone touch shapes.

KIND_OF_EVENT, BED = "bodies overlap", "the seabed"
# Parts of an axis, and along the flat of a box to each of its sides, at which a body is looked at; of the smaller
# radius, how deep one is in another.
PARTS, DEEP = np.linspace(-1.0, 1.0, 9), 0.05


def _overlaps(sea: Sea, names: Sequence[str], bed: bool) -> Iterator[tuple[tuple[str, str], float]]:
    """Pairs of a body with what it is in, and how deep (m); bed: whether there is one."""
    rows, rides = sea.obstacles, sea.carried[:, RIDES] != 0.0
    for a in np.flatnonzero(rides).tolist():
        radius, core = rows[a, RADIUS] - rows[a, STRAND], _core(rows[a])
        gaps = (distances(sea, core) + rows[:, STRAND, None]).min(axis=1) - radius
        for b, gap in enumerate(gaps):
            least = DEEP * min(radius, rows[b, RADIUS] if rides[b] else radius)
            if b != a and gap < -least and not (rides[b] and b < a):
                yield (names[a], f"body {names[b]}" if rides[b] else f"obstacle {names[b]}"), -float(gap)
        if bed and (deep := float(planes_under(sea, core)[1].max()) - 0.5 * sea.onset + radius) > DEEP * radius:
            yield (names[a], BED), deep


def _core(row: Floats) -> Floats:
    """Places (n, 3) m whose balls, of the radius of a row without the strand's, make the surface of a body."""
    along = row[HALF_LENGTH] * PARTS[:, None] * row[AXIS : AXIS + 3]
    if row[0] != BOX:
        return np.asarray(row[PLACE : PLACE + 3] + along)
    across = row[SIDE : SIDE + 3]
    sides = np.stack([across, np.cross(row[AXIS : AXIS + 3], across)])
    half = row[HALF_WIDTH : HALF_WIDTH + 2, None] * sides
    grid = (PARTS[:, None, None] * half[0] + PARTS[None, :, None] * half[1]).reshape(-1, 3)
    return np.asarray(row[PLACE : PLACE + 3] + (along[:, None] + grid).reshape(-1, 3))
