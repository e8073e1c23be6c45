"""Which lines of a system may touch each other, as numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.state.report import MAY_MEET, MAY_TOUCH, SELF_CONTACT, SELF_FRICTION
from hybrid.kernels.state.state import Floats, Line
from hybrid.model.contents import Entry
from hybrid.model.self_reach import payouts, self_reach
from hybrid.scene.bodies import FreeBody
from hybrid.scene.network import Network, SomeScene
from hybrid.scene.points import Fairlead, FreePoint, GuidedPoint, LinesContact
from hybrid.scene.schema import LineScene


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

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """Numbers of lines that may touch each other, two each, in order."""
        return [(self.lines[j], self.lines[k]) for j, k in np.argwhere(np.triu(self.meets, 1)).tolist()]

    def bits(self, line: Line) -> Line:
        """The line with the bits of one that is in contact from the start."""
        more = SELF_CONTACT | (SELF_FRICTION if self.friction.any() else 0)
        return line._replace(bits=(line.bits & ~(MAY_TOUCH | SELF_FRICTION)) | more)


def touching_of(system: Network, scenes: Mapping[str, LineScene]) -> Touching | None:
    """Which lines of a system touch each other, as it asks; None: it does not.

    scenes: of the lines by name.  What is held, or moved, is one thing: ends there are beside each other.
    """
    names = list(system.lines)
    return touching_among(system, scenes, [(names.index(a), names.index(b)) for a, b in system.touching_pairs])


def touching_among(
    system: Network, scenes: Mapping[str, LineScene], pairs: Iterable[tuple[int, int]]
) -> Touching | None:
    """Lines of which these pairs, by number, touch each other; scenes: of the lines by name; None: there is no pair."""
    names, pairs = list(system.lines), [*pairs]
    lines = sorted({k for pair in pairs for k in pair})
    if not lines:
        return None
    place = {k: j for j, k in enumerate(lines)}
    meets, friction = np.zeros((len(lines), len(lines)), np.int64), np.zeros((len(lines), len(lines)))
    for a, b in pairs:
        for j, k in ((place[a], place[b]), (place[b], place[a])):
            meets[j, k], friction[j, k] = 1, system.contact.friction if system.contact is not None else 0.0
    for j, k in enumerate(lines):
        line, scene = system.lines[names[k]], scenes[names[k]]
        reach = self_reach(scene)
        if reach.asked or reach.may:
            meets[j, j], friction[j, j] = 1, line.contact.friction
    return Touching(tuple(lines), meets, friction, joined_ends_of(system)[lines])


# Of the contents of a line that may come to touch others.
OTHERS = "contact with other lines"
MEETS = Entry(OTHERS, True, "from where they come near each other; contact: {between: []} switches it off")


def beside_others(line: Line) -> Line:
    """The line with the bit of one that may come to touch others."""
    return line._replace(bits=line.bits | MAY_MEET)


def that_may_meet(system: Network, scenes: Mapping[str, LineScene]) -> tuple[int, ...]:
    """Numbers of the lines that touch each other from where they come near, because a scene says nothing of contact.

    scenes: of the lines by name.  They have diameters, steps are given, and no error is estimated (scene.combinations).
    """
    time = system.time
    if system.contact is not None or system.dimension == 2 or time is None or not (time.step or time.tolerance):
        return ()
    found = tuple(k for k, x in enumerate(scenes.values()) if _may_meet(x))
    return found if len(found) > 1 else ()


def passing_each_other(scene: SomeScene) -> SomeScene:
    """The same, of which no line touches another one unless the scene asks for it."""
    if len(scene.lines) == 1 or scene.contact is not None:
        return scene
    return scene.model_copy(update={"contact": LinesContact(between=())})


def _may_meet(scene: LineScene) -> bool:
    sections = [*scene.cable.sections, *(x for paid in payouts(scene) for x in paid.reel or ())]
    return scene.accuracy is None and not scene.output.errors and all(x.diameter is not None for x in sections)


def joined_ends_of(system: Network) -> NDArray[np.int64]:
    """(L, 2) what the ends of lines are joined to, a free point or body by number; 0: what is held or moved."""
    free = {name: 1 + k for k, name in enumerate((*system.points, *system.bodies))}
    joined = np.zeros((len(system.lines), 2), np.int64)
    for k, line in enumerate(system.lines.values()):
        for end, point in enumerate((line.start, line.end)):
            found = system.points[point]
            if isinstance(found, FreePoint | GuidedPoint):
                joined[k, end] = free[point]
            elif isinstance(found, Fairlead) and isinstance(system.bodies[found.body], FreeBody):
                joined[k, end] = free[found.body]
    return joined
