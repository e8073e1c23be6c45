"""Where a cable starts: first positions, frames without twist, and what its ends impose."""

from __future__ import annotations

import numpy as np

from hybrid.model.ends import EndConditions, EndLoad, Moves, first_director, transported
from hybrid.model.state import Floats
from hybrid.scene.motion import EndMotion
from hybrid.scene.schema import Clamped, Equilibrium, Guided, Points, Scene, Straight


def initial_nodes(scene: Scene, s: Floats) -> Floats:
    """First positions of the nodes (N+1, 3), m."""
    start, end = (getattr(e, "position", None) for e in (scene.ends.start, scene.ends.end))
    initial, length = scene.initial, scene.length
    if isinstance(initial, Points):
        points = np.array(initial.points, float)
        knots = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        return np.column_stack([np.interp(s * knots[-1] / s[-1], knots, points[:, k]) for k in range(3)])
    if isinstance(initial, Straight):
        direction = np.array(initial.direction, float) / np.linalg.norm(initial.direction)
        origin = initial.origin or start
        first = np.array(origin, float) if origin else np.array(end, float) - length * direction
        return first + s[:, None] * direction
    assert isinstance(initial, Equilibrium)
    guess = initial.guess
    if start and end and guess != "straight":
        return np.array(start) + (s / length)[:, None] * np.subtract(end, start)
    if initial.direction is not None:
        direction = np.array(initial.direction, float)
    else:
        tangent = getattr(scene.ends.start, "tangent", None) or getattr(scene.ends.end, "tangent", None)
        direction = np.array(tangent if tangent else (0.0, 0.0, -1.0 if start else 1.0), float)
    direction /= np.linalg.norm(direction)
    first = np.array(start, float) if start else np.array(end, float) - length * direction
    return first + s[:, None] * direction


def corners(scene: Scene) -> list[float]:
    """Arc lengths at which the initial polyline turns."""
    if not isinstance(scene.initial, Points):
        return []
    knots = np.cumsum(np.linalg.norm(np.diff(np.array(scene.initial.points), axis=0), axis=1))
    return [float(x) for x in knots[:-1] * scene.length / knots[-1]]


def ends_and_frames(scene: Scene, e: Floats, rod: np.ndarray) -> tuple[EndConditions, Floats]:
    """End conditions, and first directors of all cells: carried without twist from the start, the closing twist spread.

    A clamp without `normal` holds the twist that the initial shape has there.
    """
    d = e / np.linalg.norm(e, axis=1)[:, None]
    start, end = scene.ends.start, scene.ends.end
    first = first_director(getattr(start, "tangent", None) or tuple(d[0]), getattr(start, "normal", None))
    tangents = np.vstack([getattr(start, "tangent", None) or d[0], d, getattr(end, "tangent", None) or d[-1]])
    carried = transported(first, tangents)
    last = carried[-1]
    if isinstance(end, Clamped | Guided) and end.normal is not None:
        wanted = first_director(end.tangent, end.normal)
        t = np.array(end.tangent) / np.linalg.norm(end.tangent)
        twist = float(np.arctan2(np.dot(np.cross(last, wanted), t), np.dot(last, wanted)))
        if rod.all() and getattr(start, "tangent", None) is not None:
            part = (np.cumsum(np.ones(e.shape[0])) - 0.5) / e.shape[0] * twist
        else:
            part = np.full(e.shape[0], twist)  # the start turns freely: the whole line takes the end's orientation
        inner = carried[1:-1]
        carried[1:-1] = inner * np.cos(part)[:, None] + np.cross(d, inner) * np.sin(part)[:, None]
        last = wanted
    return _end_conditions(scene, (first, last), (d[0], d[-1])), carried[1:-1]


def _end_conditions(scene: Scene, directors: tuple[Floats, Floats], chords: tuple[Floats, Floats]) -> EndConditions:
    position, frame = np.zeros((2, 3)), np.zeros((2, 9))
    loads: list[EndLoad] = []
    motions: dict[int, Moves] = {}
    pair = (scene.ends.start, scene.ends.end)
    for k, end in enumerate(pair):
        t = np.array(getattr(end, "tangent", None) or chords[k], float)
        t = t / np.linalg.norm(t)
        base = np.column_stack([directors[k], np.cross(t, directors[k]), t])
        frame[k] = base.ravel()
        position[k] = getattr(end, "position", (0.0, 0.0, 0.0))
        for what in ("force", "moment"):
            load = getattr(end, what, None)
            if load is not None:
                until = getattr(load, "until", None)
                value = np.array(getattr(load, "value", load), float)
                ramp = getattr(load, "ramp", None)
                loads.append(EndLoad(what, k, value, np.inf if until is None else until, ramp))
        motion = getattr(end, "motion", None)
        if motion is not None:
            motions[k] = EndMotion(motion, getattr(end, "position", None), base)
    return EndConditions([e.kind in ("pinned", "clamped") for e in pair], position, frame, loads, motions)
