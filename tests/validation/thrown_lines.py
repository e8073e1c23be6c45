"""Lines that nothing holds, thrown at each other: their steps, energy, momentum, and how near they come."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from problems import momenta

import hybrid
from hybrid.errors import Outcome
from hybrid.kernels.contact.self_contact_law import DISTANCE
from hybrid.kernels.junctions.bodies import FRAME, NUMBERS, PLACE, STATE, V, W
from hybrid.kernels.laws.obstacles import depths_in_obstacles, stored_energy
from hybrid.kernels.march.energies import Observed, observe
from hybrid.kernels.state.books import blank_books
from hybrid.kernels.state.report import INERTIA, OBSTACLES, SPIN
from hybrid.model.bodies import body_model
from hybrid.model.build import build
from hybrid.model.contents import Touching
from hybrid.scene.bodies import FreeBody
from hybrid.scene.read import one_line
from hybrid.simulation.lines_contact import diameters, least_bending
from hybrid.solve.contact import SharedContact, TouchingLine
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.stepper import JoinedLine, NetworkState
from tests.scenes import cable_scene

Floats = NDArray[np.float64]
WIDTH, STIFF = 0.02, 0.1


def section(length: float, width: float = WIDTH) -> dict[str, Any]:
    return {
        "length": length, "mass": 0.4, "diameter": width, "bending_stiffness": STIFF, "axial_stiffness": 2e5,
        "torsional_stiffness": 0.8 * STIFF,
    }  # fmt: skip


class Throw(NamedTuple):
    """What a throw leaves behind."""

    least: float  # m, distance of centrelines, of polygons along straight ways within steps
    apart: float  # m, that of the curves that touch (kernels.contact.self_contact_law), after steps
    energies: list[float]  # J, after every step
    momentum: Floats  # (2, 3) before and after
    turning: Floats  # (2, 3) angular momentum likewise
    size: float  # kg m2/s, of that
    tries: int  # given up
    states: NetworkState
    shared: SharedContact | None
    model: list[Any]
    deepest: float  # in obstacles, nodes and chords, over what they may (kernels.laws.obstacles.depths_in_obstacles)


def straight(length: float, at: Floats, along: Floats, cells: int) -> Floats:
    """Nodes (N+1, 3) m of a straight line about a middle."""
    s = np.linspace(-0.5 * length, 0.5 * length, cells + 1)[:, None]
    return np.asarray(at + s * along / np.linalg.norm(along))


def throw(
    shapes: list[Floats], speeds: list[Floats], step: float, duration: float, friction: float = 0.0,
    kind: str = "rod", body: FreeBody | None = None, obstacles: dict[str, Any] | None = None,
) -> Throw:  # fmt: skip
    """Lines with nodes (N+1, 3) m and velocities (N+1, 3) m/s fly; steps (s) that fail are halved.

    Several touch themselves and each other, one touches what is around.
    body: a free one with a shape, which spins; obstacles: at rest, or that turn freely.
    """
    models, lines, states, several = [], [], [], len(shapes) > 1
    around = {"obstacles": obstacles if body is None else body.surface("ball")} if body or obstacles else {}
    rides = np.zeros(0 if body is None else 1, np.int64)
    own = () if body is None else (body_model("ball", body, 0.0, 0.0),)
    numbers = np.array([x.numbers for x in own]).reshape(len(own), NUMBERS)
    rows = np.array([x.start for x in own]).reshape(len(own), STATE)
    rows[:, W : W + 3] = (0.5, -1.0, 2.0)
    for r, v in zip(shapes, speeds, strict=True):
        s = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(r, axis=0), axis=1)))
        model = build(one_line(hybrid.validate_scene(
            cable_scene(section(float(s[-1])), "free", "free", gravity=1e-15, contact={"self": several}, model=kind,
                        mesh={"nodes": s.tolist()}, initial={"kind": "points", "points": r.tolist()}, dimension=3,
                        time=(1.0, 0.1)) | around
        )))  # fmt: skip
        state = model.start.copy()
        state.v[:] = v
        x = JoinedLine(
            model.line, model.sea.at_time(0.0), model.ends.at_time(0.0), model.length, model.tension_scale, -np.inf, (-1, -1),
            rides=rides,
        )  # fmt: skip
        models.append(model)
        lines.append(x)
        states.append(state)
    count = len(models)
    touching = Touching(
        tuple(range(count)), np.ones((count, count), np.int64), np.full((count, count), friction),
        np.full((count, 2), -1, np.int64), np.arange(2 * count).reshape(count, 2),
    )  # fmt: skip
    shared = None
    if several:
        lines = [x._replace(line=touching.bits(x.line)) for x in lines]
        strands = [TouchingLine(x.line, diameters(x), least_bending(x), x.tension_scale) for x in models]
        shared = SharedContact(touching, strands)
    solver = NetworkSolver(lines, 0, numbers, shared=shared)
    books = [blank_books(x.line.h.size)._replace(touch=np.zeros((3, x.line.s.size))) for x in lines]
    for each in books:
        each.clock.shortest = 1e-9
    solver.keep_books(books)
    old = NetworkState(states, rows)
    solver.consistent_accelerations(old, [np.zeros((2, 3))] * count)
    new, t, before, rho, part, tries, deepest = old.copy(), 0.0, 0.0, 0.9, step, 0, -np.inf
    masses = [x.line.mass[:, None] for x in models]
    first, energies, least = of(models, old, numbers), [energy(models, old, shared, lines, numbers)], np.inf
    apart = np.inf
    while t < duration * (1.0 - 1e-9):
        end = t + part
        for x in lines:
            x.sea.now[0] = end
        taken = solver.step(old, new, end - t, 0.9, before, rho, end)
        if taken.outcome != Outcome.OK:
            part, tries = 0.5 * part, tries + 1
            assert part > 1e-6 * step, taken
            continue
        least, apart = min(least, nearest(old, new)), min(apart, nearest_curves(shared))
        for x, state in zip(lines if obstacles else [], new.lines, strict=False):
            deepest = max(deepest, float(depths_in_obstacles(x.sea, state.r, x.line.s).max()))
        old, new, before, rho, t = new, old, end - t, taken.rho, end
        energies.append(energy(models, old, shared, lines, numbers))
        part = min(2.0 * part, step)
    last = of(models, old, numbers)
    size = sum(
        float((np.linalg.norm(x.r, axis=1)[:, None] * m * np.abs(x.v)).sum())
        for x, m in zip(old.lines, masses, strict=True)
    )
    momentum, turning = np.stack([first[0], last[0]]), np.stack([first[1], last[1]])
    return Throw(least, apart, energies, momentum, turning, size, tries, old, shared, models, deepest)


def energy(
    models: list[Any], states: NetworkState, shared: SharedContact | None, lines: list[JoinedLine], bodies: Floats
) -> float:
    """Kinetic, elastic and contact energy, J, of lines and bodies."""
    total = float(shared.contact.numbers.energy) if shared else 0.0
    for model, x, joined in zip(models, states.lines, lines, strict=True):
        parts, room = np.zeros(5), np.zeros((x.T.size + 1, 3))
        observe(model.line, model.ends.values, x.e, x.v, x.a1, x.w, x.T, x.turn, Observed(room, room.copy(), parts))
        total += float(parts[:4].sum())
        if model.line.bits & OBSTACLES:
            total += float(stored_energy(model.line, joined.sea, x.r))
    if states.lines[0].sheave.size:
        total += 0.5 * float(lines[0].sea.carried[:, INERTIA] @ states.lines[0].sheave[:, SPIN] ** 2)
    for numbers, row in zip(bodies, states.bodies, strict=True):
        total += 0.5 * float(_rates(row) @ numbers[:36].reshape(6, 6) @ _rates(row))
    return total


def _rates(row: Floats) -> Floats:
    """Velocity and angular velocity (6,) of a body in its axes."""
    return np.concatenate([row[FRAME:V].reshape(3, 3).T @ row[V : V + 3], row[W : W + 3]])


def of(models: list[Any], states: NetworkState, bodies: Floats) -> tuple[Floats, Floats]:
    """Momentum and angular momentum about the origin, with that of the sections and of bodies."""
    momentum, turning = np.zeros(3), np.zeros(3)
    for model, x in zip(models, states.lines, strict=True):
        linear, angular = momenta(model, x)
        momentum, turning = momentum + linear, turning + angular
    for numbers, row in zip(bodies, states.bodies, strict=True):
        R, both = row[FRAME:V].reshape(3, 3), numbers[:36].reshape(6, 6) @ _rates(row)
        momentum += R @ both[:3]
        turning += np.cross(row[PLACE:FRAME], R @ both[:3]) + R @ both[3:]
    return momentum, turning


def nearest(before: NetworkState, after: NetworkState) -> float:
    """The least distance, m, of the polygons of lines along straight ways of their nodes in a step."""
    least = np.inf
    for k, a in enumerate(before.lines):
        for m in range(k + 1, len(before.lines)):
            for part in (0.25, 0.5, 0.75, 1.0):
                p = (1.0 - part) * a.r + part * after.lines[k].r
                q = (1.0 - part) * before.lines[m].r + part * after.lines[m].r
                least = min(least, polygons_apart(p, q))
    return float(least)


def nearest_curves(shared: SharedContact | None) -> float:
    """The least distance, m, of the points of contact of the state that was looked at last; infinite: nothing touches."""
    if shared is None:
        return float(np.inf)
    contact = shared.contact
    return float(contact.points[: contact.counts.points, DISTANCE].min(initial=np.inf))


def polygons_apart(p: Floats, q: Floats) -> float:
    """Least distance, m, of two polygons (n, 3) and (m, 3) m, sampled along their sides."""
    x = np.linspace(0.0, 1.0, 5)[:-1, None, None]
    a = ((1.0 - x) * p[:-1] + x * p[1:]).reshape(-1, 3)
    b = ((1.0 - x) * q[:-1] + x * q[1:]).reshape(-1, 3)
    return float(np.sqrt(((a[:, None] - b[None]) ** 2).sum(axis=2).min()))
