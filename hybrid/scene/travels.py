"""How far points that are held may be from each other: no farther than the lines and bodies between them reach."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import TYPE_CHECKING

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
    placed = {name: system.first_place(name) for name in system.points if not system.is_joined(name)}
    motions = {name: _motion(system, name) for name in placed}
    ways = {name: _reaches(system, name) for name in placed}
    for a, b in combinations(placed, 2):
        name, other = (a, b) if motions[a] is not None else (b, a)
        reach, between = ways[name].get(other, (math.inf, ()))
        if not between or _beside(system, a, b):
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


def _reaches(system: System, begin: str) -> Mapping[str, tuple[float, tuple[str, ...]]]:
    """How far (m) each point may at most be from one that is held, along lines and bodies that are free, and which

    lines these are.
    """
    ways: dict[str, list[tuple[str, float, tuple[str, ...]]]] = {name: [] for name in system.points}
    for key, line in system.lines.items():
        if line.connections.start.payout is not None or line.connections.end.payout is not None:
            continue
        far = line.cable.length if line.cable.inextensible else line.cable.reach
        ways[line.start].append((line.end, far, (key,)))
        ways[line.end].append((line.start, far, (key,)))
    on = [(name, x) for name, x in system.points.items() if isinstance(x, Fairlead) and system.is_joined(name)]
    for (a, one), (b, two) in combinations(on, 2):
        if one.body == two.body:
            apart = math.dist(one.place, two.place)
            ways[a].append((b, apart, ()))
            ways[b].append((a, apart, ()))
    reach: dict[str, tuple[float, tuple[str, ...]]] = {}
    queue: list[tuple[float, str, tuple[str, ...]]] = [(0.0, begin, ())]
    while queue:
        far, name, lines = heapq.heappop(queue)
        if name not in reach:
            reach[name] = far, lines
            for other, more, by in ways[name]:
                heapq.heappush(queue, (far + more, other, lines + by))
    return reach
