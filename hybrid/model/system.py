"""Several lines as arrays: a model of each, points and bodies that they share, and places of these to begin with."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hybrid.kernels.bodies import FORCE, FRAME, LEVEL, LIFT, NUMBERS, PLACE, STATE, STIFFNESS, V
from hybrid.kernels.members import PIECE
from hybrid.kernels.state import Floats
from hybrid.model.bodies import BodyModel, FairleadMotion, KnownMotion, body_model
from hybrid.model.build import Model, build
from hybrid.model.catenary_guess import pulls
from hybrid.model.initial_shape import dead_loads
from hybrid.model.sea import surroundings
from hybrid.scene.bodies import FixedBody
from hybrid.scene.points import Fairlead
from hybrid.scene.system import System

MOST_ROUNDS = 100  # of Newton's method for the first places of the points
SAME_FORCE = 1e-5  # of the largest force at a point: what may be left there of what does not balance
FARTHEST = 0.25  # of the shortest line: how far a point goes in a round


@dataclass(frozen=True)
class SystemModel:
    """A system of lines made ready to compute."""

    names: tuple[str, ...]  # of the lines
    models: tuple[Model, ...]  # of the lines; a free point is a body at the end of the line that carries it
    free: tuple[str, ...]  # names of the free points
    joints: tuple[tuple[int, int], ...]  # of each line: number of what moves its start and end, -1: held there
    places: Floats  # (P, 3) m, where the free points are first
    bodies: tuple[BodyModel, ...]  # that are free; they are numbered behind the free points
    body_places: Floats  # (B, STATE) where they are first
    fairleads: Floats  # (L, 2, 3) m, of ends at free bodies, in axes of the body
    known: Mapping[str, KnownMotion]  # of bodies that are held or moved
    loose: frozenset[tuple[int, int]] = frozenset()  # ends (line, 0 or 1) that have left their points

    @property
    def cells(self) -> int:
        """Cells of all lines."""
        return sum(model.cells for model in self.models)

    def load_bodies(self, t: float, out: Floats, since: float = 0.0) -> None:
        """Write what acts on the bodies at t (s; infinity: of full size) into `out` (B, NUMBERS).

        since: s, loads that have stopped by then are left out.
        """
        for body, row in zip(self.bodies, out, strict=True):
            body.load(t, since, row)

    def body_numbers(self, t: float) -> Floats:
        """(B, NUMBERS or, with pieces of members, more) of the free bodies at t (s), where they are first."""
        out = np.zeros((len(self.bodies), max((x.numbers.size for x in self.bodies), default=NUMBERS)))
        for row, body in zip(out, self.bodies, strict=True):
            row[: body.numbers.size] = body.numbers
        self.load_bodies(t, out)
        self.stir(t, self.body_places, 0.0, out)
        return out

    def stir(self, t: float, bodies: Floats, dt: float, out: Floats) -> None:
        """Write the water around members of bodies (B, STATE) at t (s), dt (s) later, into their numbers `out`."""
        for body, state, row in zip(self.bodies, bodies, out, strict=True):
            if body.members is not None:
                body.members.stir(t, state, dt, row[NUMBERS : body.numbers.size].reshape(-1, PIECE))


def build_system(system: System, places: Floats | None = None, bodies: Floats | None = None) -> SystemModel:
    """Make the model that a system requires.

    places: (P, 3) m of the free points, bodies: (B, STATE) of the free bodies, None: where the scene has them.
    Raises SceneError where a line cannot be meshed.
    """
    free, free_bodies = system.free, list(system.free_bodies)
    environment = system.environment
    density = environment.fluid.density if environment.fluid is not None else 0.0
    around = None
    if any(body.members for body in system.free_bodies.values()):
        around = surroundings(system.scene_of(next(iter(system.lines))), 1)
    made = tuple(
        body_model(name, body, density, environment.gravity, around) for name, body in system.free_bodies.items()
    )
    if places is None:
        places = np.array([system.first_place(x) for x in free], float).reshape(-1, 3)
    if bodies is None:
        bodies = np.array([body.start for body in made]).reshape(-1, STATE)
    at: dict[str, Any] = dict(zip(free, map(tuple, places.tolist()), strict=True))
    joint = {name: k for k, name in enumerate(free)}
    fairleads = {}
    for name, point in system.points.items():
        if isinstance(point, Fairlead) and point.body in free_bodies:
            row = bodies[free_bodies.index(point.body)]
            at[name] = tuple((row[PLACE:FRAME] + row[FRAME:V].reshape(3, 3) @ np.array(point.place)).tolist())
            joint[name], fairleads[name] = len(free) + free_bodies.index(point.body), point.place
    known: dict[str, KnownMotion] = {}
    models = [_model_of(system, name, at, known) for name in system.lines]
    for name, body in system.bodies.items():
        if isinstance(body, FixedBody) and name not in known:
            known[name] = KnownMotion(body, models[0].sea)
    ends = [(x.start, x.end) for x in system.lines.values()]
    return SystemModel(
        tuple(system.lines), tuple(models), free, tuple((joint.get(a, -1), joint.get(b, -1)) for a, b in ends), places,
        made, bodies, np.array([[fairleads.get(p, (0.0, 0.0, 0.0)) for p in pair] for pair in ends]), known,
    )  # fmt: skip


def _model_of(system: System, name: str, at: Mapping[str, Any], known: dict[str, KnownMotion]) -> Model:
    """The model of a line: its loads with the points that it carries, its first shape between places that are held.

    known: motions of bodies, which are added when first asked for.
    """
    model = build(system.scene_of(name, places=at))
    carried = system.carried(name)
    if carried:
        other = build(system.scene_of(name, carried, at))
        model = replace(other, start=model.start, start_shape=model.start_shape, other_starts=model.other_starts)
    for k, point in enumerate((system.lines[name].start, system.lines[name].end)):
        found, body = system.points[point], system.body_of(point)
        if isinstance(found, Fairlead) and isinstance(body, FixedBody) and body.motion is not None:
            motion = known.setdefault(found.body, KnownMotion(body, model.sea))
            model.ends.motions[k] = FairleadMotion(motion, found.place)
    return model


def balanced_places(system: System, model: SystemModel) -> tuple[Floats, Floats] | None:
    """Places (P, 3) m of the free points and (B, STATE) of the bodies at which elastic catenaries balance there; None:
    they are not found.

    All loads but contact, bending and what the current does; bodies do not turn.  The energy of the lines is convex in
    the places, so that Newton's method with shortened steps finds them from anywhere.
    """
    points, count = len(model.free), len(model.bodies)
    held = {name: np.array(system.first_place(name)) for name in system.points if not system.is_joined(name)}
    if not points + count or not held:
        return model.places, model.body_places
    lines, loads = list(system.lines.values()), [_loads(each) for each in model.models]
    reach = FARTHEST * min(each.length for each in model.models)
    frames = model.body_places[:, FRAME:V].reshape(-1, 3, 3)
    numbers = model.body_numbers(np.inf)
    # a joint moves as its point, or as the origin of its body, with its end beside that
    beside = np.zeros_like(model.fairleads)
    for l, k in np.argwhere(np.array(model.joints).reshape(-1, 2) >= points):
        beside[l, k] = frames[model.joints[l][k] - points] @ model.fairleads[l, k]

    def forces(places: Floats) -> tuple[Floats, Floats] | None:
        out, K = np.zeros_like(places), np.zeros((places.size, places.size))
        for b in range(count):
            row, o = numbers[b], 3 * (points + b) + 2
            out[points + b] += row[FORCE : FORCE + 3]
            out[points + b, 2] += row[LIFT] - row[STIFFNESS] * (places[points + b, 2] - row[LEVEL])
            K[o, o] -= row[STIFFNESS]
        for l, (line, each, load, joints) in enumerate(zip(lines, model.models, loads, model.joints, strict=True)):
            ends = [
                held[p] if j < 0 else places[j] + beside[l, k]
                for k, (p, j) in enumerate(zip((line.start, line.end), joints, strict=True))
            ]
            found = pulls(load, each.line.h, each.line.ck, ends[1] - ends[0])
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

    largest = max(float(np.abs(load).sum()) for load in loads)
    places = _least_energy(forces, np.vstack([model.places, model.body_places[:, PLACE:FRAME]]), largest, reach)
    if places is None:
        return None
    bodies = model.body_places.copy()
    bodies[:, PLACE:FRAME] = places[points:]
    return places[:points], bodies


def _least_energy(
    forces: Callable[[Floats], tuple[Floats, Floats] | None], places: Floats, largest: float, reach: float
) -> Floats | None:
    """Places (P, 3) m at which forces (N, with their stiffness) vanish against the largest, in steps up to `reach`."""
    found = forces(places)
    for _ in range(MOST_ROUNDS):
        if found is None:
            return None
        out, K = found
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
