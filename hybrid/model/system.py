"""Several lines as arrays: a model of each, the points that they share, and places of the free points to begin with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hybrid.kernels.state import Floats
from hybrid.model.build import Model, build
from hybrid.model.catenary_guess import pulls
from hybrid.model.initial_shape import dead_loads
from hybrid.scene.system import FixedPoint, System

MOST_ROUNDS = 100  # of Newton's method for the first places of the points
SAME_FORCE = 1e-5  # of the largest force at a point: what may be left there of what does not balance
FARTHEST = 0.25  # of the shortest line: how far a point goes in a round


@dataclass(frozen=True)
class SystemModel:
    """A system of lines made ready to compute."""

    names: tuple[str, ...]  # of the lines
    models: tuple[Model, ...]  # of the lines; a free point is a body at the end of the line that carries it
    free: tuple[str, ...]  # names of the free points
    joints: tuple[tuple[int, int], ...]  # of each line: number of the free point at its start and end, -1: held there
    places: Floats  # (P, 3) m, where the free points are first

    @property
    def cells(self) -> int:
        """Cells of all lines."""
        return sum(model.cells for model in self.models)


def build_system(system: System, places: Floats | None = None) -> SystemModel:
    """Make the model that a system requires; places: (P, 3) m of the free points, None: where the scene has them.

    Raises SceneError where a line cannot be meshed.
    """
    free = system.free
    if places is None:
        places = np.array(list(system.guesses.values()), float).reshape(-1, 3)
    models, joints, at = [], [], dict(zip(free, map(tuple, places.tolist()), strict=True))
    for name, line in system.lines.items():
        joints.append(tuple(free.index(x) if x in free else -1 for x in (line.start, line.end)))
        models.append(_model_of(system, name, at))
    return SystemModel(tuple(system.lines), tuple(models), free, tuple(joints), places)  # type: ignore[arg-type]


def _model_of(system: System, name: str, places: Mapping[str, Any]) -> Model:
    """The model of a line: its loads with the points that it carries, its first shape between places that are held."""
    held = build(system.scene_of(name, places=places))
    carried = system.carried(name)
    if not carried:
        return held
    other = build(system.scene_of(name, carried, places))
    return replace(other, start=held.start, start_shape=held.start_shape, other_starts=held.other_starts)


def balanced_places(system: System, model: SystemModel) -> Floats | None:
    """Places (P, 3) m of the free points at which elastic catenaries balance there; None: they are not found.

    All loads but contact, bending and what the current does.  The energy of the lines is convex in the places, so that
    Newton's method with shortened steps finds them from anywhere.
    """
    fixed = [point.position for point in system.points.values() if isinstance(point, FixedPoint)]
    anchors = {name: np.array(p.position) for name, p in system.points.items() if isinstance(p, FixedPoint)}
    if not model.free or not fixed:
        return model.places
    places, lines = model.places.copy(), list(system.lines.values())
    loads = [_loads(each) for each in model.models]
    reach = FARTHEST * min(each.length for each in model.models)

    def forces(places: Floats) -> tuple[Floats, Floats] | None:
        at = anchors | dict(zip(model.free, places, strict=True))
        out, K = np.zeros_like(places), np.zeros((places.size, places.size))
        for line, each, load, joints in zip(lines, model.models, loads, model.joints, strict=True):
            found = pulls(load, each.line.h, each.line.ck, at[line.end] - at[line.start])
            if found is None:
                return None
            for k, sign in ((0, 1.0), (1, -1.0)):
                if joints[k] >= 0:
                    out[joints[k]] += sign * found.t[-k] + load[-k]
                    for m, other in ((0, -1.0), (1, 1.0)):
                        if joints[m] >= 0:
                            a, b = 3 * joints[k], 3 * joints[m]
                            K[a : a + 3, b : b + 3] += sign * other * found.stiffness
        return out, K

    found = forces(places)
    for _ in range(MOST_ROUNDS):
        if found is None:
            return None
        out, K = found
        largest = max(float(np.abs(load).sum()) for load in loads)
        if np.abs(out).max() <= SAME_FORCE * largest:
            return places
        try:
            step = np.linalg.solve(K, -out.ravel()).reshape(-1, 3)
        except np.linalg.LinAlgError:
            return None
        step *= min(1.0, reach / max(float(np.abs(step).max()), 1e-300))
        slope, part = float((out * step).sum()), 1.0
        while part > 1e-6:
            tried = forces(places + part * step)
            if tried is None:
                return None
            if float((tried[0] * step).sum()) >= -0.5 * slope:  # not much beyond the lowest energy on the way
                break
            part *= 0.5
        places, found = places + part * step, tried
    return None


def _loads(model: Model) -> Floats:
    """Dead loads (N+1, 3) N on the nodes of a line: weight, full buoyancy, forces at its ends."""
    loads = dead_loads(model.line)
    force = model.ends.at(np.inf).force
    loads[0] += force[0]
    loads[-1] += force[1]
    return loads
