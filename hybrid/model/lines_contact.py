"""Which lines of a system may touch each other, as numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.state.forces import MAY_TOUCH, SELF_CONTACT, SELF_FRICTION
from hybrid.kernels.state.state import Floats, Line
from hybrid.model.self_reach import self_reach
from hybrid.scene.bodies import FreeBody
from hybrid.scene.points import Fairlead, FreePoint
from hybrid.scene.schema import Scene

if TYPE_CHECKING:  # its tables take long to make
    from hybrid.scene.system import System


@dataclass(frozen=True)
class Touching:
    """Which lines of a system may touch, K of them."""

    lines: tuple[int, ...]  # their numbers, in order
    meets: NDArray[np.int64]  # (K, K) whether two of them may touch, or one itself
    friction: Floats  # (K, K) coefficients
    joined: NDArray[np.int64]  # (K, 2) what ends are joined to: those of one number are beside each other

    def partners(self, number: int) -> tuple[int, ...]:
        """Numbers of the other lines that a line may touch; none where it is not among these."""
        if number not in self.lines:
            return ()
        mine = self.lines.index(number)
        return tuple(k for j, k in enumerate(self.lines) if j != mine and self.meets[mine, j])

    def bits(self, line: Line) -> Line:
        """The line with the bits of one that is in contact from the start."""
        more = SELF_CONTACT | (SELF_FRICTION if self.friction.any() else 0)
        return line._replace(bits=(line.bits & ~(MAY_TOUCH | SELF_FRICTION)) | more)


def touching_of(system: System, scenes: Mapping[str, Scene]) -> Touching | None:
    """Which lines of a system touch each other, as it asks; None: it does not.

    scenes: of the lines by name.  What is held, or moved, is one thing: ends there are beside each other.
    """
    if system.contact is None:
        return None
    names, pairs = list(system.lines), system.touching_pairs
    lines = [k for k, name in enumerate(names) if any(name in pair for pair in pairs)]
    place = {names[k]: j for j, k in enumerate(lines)}
    meets, friction = np.zeros((len(lines), len(lines)), np.int64), np.zeros((len(lines), len(lines)))
    for a, b in pairs:
        for j, k in ((place[a], place[b]), (place[b], place[a])):
            meets[j, k], friction[j, k] = 1, system.contact.friction
    for j, k in enumerate(lines):
        line, scene = system.lines[names[k]], scenes[names[k]]
        reach = self_reach(scene)
        if reach.asked or reach.may:
            meets[j, j], friction[j, j] = 1, line.contact.friction
    return Touching(tuple(lines), meets, friction, joined_ends_of(system)[lines])


def joined_ends_of(system: System) -> NDArray[np.int64]:
    """(L, 2) what the ends of lines are joined to, a free point or body by number; 0: what is held or moved."""
    free = {name: 1 + k for k, name in enumerate((*system.points, *system.bodies))}
    joined = np.zeros((len(system.lines), 2), np.int64)
    for k, line in enumerate(system.lines.values()):
        for end, point in enumerate((line.start, line.end)):
            found = system.points[point]
            if isinstance(found, FreePoint):
                joined[k, end] = free[point]
            elif isinstance(found, Fairlead) and isinstance(system.bodies[found.body], FreeBody):
                joined[k, end] = free[found.body]
    return joined
