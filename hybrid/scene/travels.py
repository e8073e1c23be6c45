"""How far points that are driven may travel apart: no farther than the lines and bodies between them reach."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import TYPE_CHECKING

from hybrid.scene.base import Finding
from hybrid.scene.bodies import FixedBody
from hybrid.scene.ends import Triple
from hybrid.scene.motion_tables import Motion
from hybrid.scene.points import Fairlead, FixedPoint
from hybrid.scene.start_checks import SAME_LENGTH

if TYPE_CHECKING:
    from hybrid.scene.system import System


def travel_findings(system: System) -> Iterator[Finding]:
    """Points that travel farther from one that is held than all lines between them are long, at the utmost strain."""
    fails = [*system.lines.values(), *(x for x in system.points.values() if isinstance(x, FixedPoint | Fairlead))]
    if system.time is None or any(x.break_at is not None for x in fails):  # what is broken reaches anywhere
        return
    placed = {name: system.first_place(name) for name in system.points if not system.is_joined(name)}
    motions = {name: _carrier(system, name) for name in placed}
    moments = {system.time.duration}
    for motion in motions.values():
        if motion is not None and motion.travel is not None:
            moments.add(min(motion.travel.begin + motion.travel.over, system.time.duration))
    ways = {name: _reaches(system, name) for name, motion in motions.items() if motion is not None}
    for a, b in combinations(placed, 2):
        name, other = (a, b) if a in ways else (b, a)
        reach = ways.get(name, {}).get(other)
        if reach is None or _beside(system, a, b):
            continue
        for t in sorted(moments):
            there, here = (_there(placed[x], motions[x], t) for x in (name, other))
            if (distance := math.dist(there, here)) > reach * (1.0 + SAME_LENGTH):
                motion = motions[name]
                assert motion is not None
                key = "travel" if motion.travel is not None else "velocity"
                at = ", ".join(f"{x:.6g}" for x in there)
                given = f"motion to [{at}] at t = {t:.6g} s, {distance:.8g} m from point {other}"
                expected = f"at most {reach:.8g} m from point {other}, as far as the lines between them reach"
                yield Finding(("points", name, "motion", key), expected, "a shorter way, or longer lines", given)
                return


def _carrier(system: System, name: str) -> Motion | None:
    """The motion of a fixed point, if that carries it away."""
    point = system.points[name]
    motion = point.motion if isinstance(point, FixedPoint) else None
    return motion if motion is not None and (motion.travel or motion.velocity) else None


def _there(place: Triple, motion: Motion | None, t: float) -> Triple:
    far = motion.carried(t)[0] if motion is not None else (0.0, 0.0, 0.0)
    return place[0] + far[0], place[1] + far[1], place[2] + far[2]


def _beside(system: System, a: str, b: str) -> bool:
    """Whether a point is on a body that moves as is known, whose motion is not followed here."""
    bodies = [system.body_of(x) for x in (a, b)]
    return any(isinstance(x, FixedBody) and x.motion is not None for x in bodies)


def _reaches(system: System, begin: str) -> Mapping[str, float]:
    """How far (m) each point may at most be from one that is held, along lines and bodies that are free."""
    ways: dict[str, list[tuple[str, float]]] = {name: [] for name in system.points}
    for line in system.lines.values():
        far = line.cable.length if line.cable.inextensible else line.cable.reach
        ways[line.start].append((line.end, far))
        ways[line.end].append((line.start, far))
    on = [(name, x) for name, x in system.points.items() if isinstance(x, Fairlead) and system.is_joined(name)]
    for (a, one), (b, two) in combinations(on, 2):
        if one.body == two.body:
            apart = math.dist(one.place, two.place)
            ways[a].append((b, apart))
            ways[b].append((a, apart))
    reach: dict[str, float] = {}
    queue = [(0.0, begin)]
    while queue:
        far, name = heapq.heappop(queue)
        if name not in reach:
            reach[name] = far
            for other, more in ways[name]:
                heapq.heappush(queue, (far + more, other))
    return reach
