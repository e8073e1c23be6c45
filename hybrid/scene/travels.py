"""How far points that are held may be from each other: no farther than the lines and bodies between them reach."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import TYPE_CHECKING, Any

from hybrid.scene.base import Finding
from hybrid.scene.bodies import FixedBody
from hybrid.scene.motion_tables import Motion
from hybrid.scene.points import Fairlead, FixedPoint
from hybrid.scene.start_checks import SAME_LENGTH
from hybrid.scene.ways import farthest, moving_key, shift, smaller

if TYPE_CHECKING:
    from hybrid.scene.system import System


def travel_findings(system: System) -> Iterator[Finding]:
    """Points that are, or move, farther from another than all lines between them are long, at the utmost strain."""
    fails = [*system.lines.values(), *(x for x in system.points.values() if isinstance(x, FixedPoint | Fairlead))]
    breaks = any(x.break_at is not None for x in fails)  # what is broken reaches anywhere
    duration = system.time.duration if system.time is not None and not breaks else 0.0
    placed = {name: system.first_place(name) for name in system.points if system.is_held(name)}
    motions = {name: _motion(system, name) for name in placed}
    beside = _neighbours(system)
    for name, other, reach, between in _held_pairs(placed, motions, beside):
        if not between or _beside(system, name, other):
            continue
        most = reach * (1.0 + SAME_LENGTH)
        distance, t = farthest((placed[name], placed[other]), (motions[name], motions[other]), duration, most)
        if distance <= most:
            continue
        motion, long = motions[name], sum(system.lines[x].cable.length for x in between)
        lines = f"line {between[0]}" if len(between) == 1 else f"lines {', '.join(reversed(between))}"
        expected = f"at most {reach:.8g} m from point {other}, as far as {lines} of {long:.8g} m may reach (max_strain)"
        key = moving_key(motion) if motion is not None and t > 0.0 else ""
        moved = shift(motion, t)
        at = ", ".join(f"{x + by:.6g}" for x, by in zip(placed[name], moved, strict=True))
        far = f"{distance:.8g} m from point {other}"
        if key:
            fix, given = f"longer lines, or {smaller(key)}", f"motion to [{at}] at t = {t:.6g} s, {far}"
            yield Finding(("points", name, "motion", key), expected, fix, given)
        else:
            yield Finding(("points", name), expected, "longer lines, or points that are nearer", f"[{at}], {far}")
        return


def _motion(system: System, name: str) -> Motion | None:
    """The motion of a fixed point, if tables move it."""
    point = system.points[name]
    motion = point.motion if isinstance(point, FixedPoint) else None
    return motion if motion is not None and moving_key(motion) else None


def _beside(system: System, a: str, b: str) -> bool:
    """Whether a point is on a body that moves as is known, whose motion is not followed here."""
    bodies = [system.body_of(x) for x in (a, b)]
    return any(isinstance(x, FixedBody) and x.motion is not None for x in bodies)


# Points beside each point: how far (m) they may be from it at most, and the line between them, if it is one.
Neighbours = Mapping[str, list[tuple[str, float, tuple[str, ...]]]]


def _neighbours(system: System) -> Neighbours:
    """Points beside each point, along a line or on the same free body."""
    beside: dict[str, list[tuple[str, float, tuple[str, ...]]]] = {name: [] for name in system.points}
    for key, line in system.lines.items():
        if line.connections.start.payout is not None or line.connections.end.payout is not None:
            continue
        far = line.cable.length if line.cable.inextensible else line.cable.reach
        beside[line.start].append((line.end, far, (key,)))
        beside[line.end].append((line.start, far, (key,)))
    on: dict[str, list[tuple[str, Fairlead]]] = {}
    for name, x in system.points.items():
        if isinstance(x, Fairlead) and system.is_joined(name):
            on.setdefault(x.body, []).append((name, x))
    for same in on.values():
        for (a, one), (b, two) in combinations(same, 2):
            apart = math.dist(one.place, two.place)
            beside[a].append((b, apart, ()))
            beside[b].append((a, apart, ()))
    return beside


def _held_pairs(
    placed: Mapping[str, Any], motions: Mapping[str, Motion | None], beside: Neighbours
) -> Iterator[tuple[str, str, float, tuple[str, ...]]]:
    """Each two points that are held and that lines or bodies join: the one that moves, if one does, the other, how far

    (m) it may be, and the lines between them.  In the order of the scene.
    """
    order = {name: i for i, name in enumerate(placed)}
    ways = {name: _reaches(beside, name) for name in placed}
    for a, i in order.items():
        for b in sorted((x for x in ways[a] if order.get(x, -1) > i), key=order.__getitem__):
            name, other = (a, b) if motions[a] is not None else (b, a)
            reach, between = ways[name][other]
            yield name, other, reach, between


def _reaches(beside: Neighbours, begin: str) -> Mapping[str, tuple[float, tuple[str, ...]]]:
    """How far (m) each point may at most be from one that is held, along lines and bodies that are free, and which

    lines these are.
    """
    reach: dict[str, tuple[float, tuple[str, ...]]] = {}
    queue: list[tuple[float, str, tuple[str, ...]]] = [(0.0, begin, ())]
    while queue:
        far, name, lines = heapq.heappop(queue)
        if name not in reach:
            reach[name] = far, lines
            for other, more, by in beside[name]:
                heapq.heappush(queue, (far + more, other, lines + by))
    return reach
