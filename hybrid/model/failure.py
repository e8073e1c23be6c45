"""Lines that break from their points, and points that give way: what may break, and the system after it.

An end that comes loose alone is a free end of its line; ends that stay together are joined to a free point of their
own without mass.  What was clamped bends there no more, and no torque passes through the catenary zones of its line.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hybrid.model.network import NetworkModel
from hybrid.model.release import unclamped, without_hold
from hybrid.scene.network_scene import Network
from hybrid.scene.points import Failure


class Weakness(NamedTuple):
    """Something that may break."""

    name: str  # for people
    ends: tuple[tuple[int, int], ...]  # of lines: number, and 0 or 1 for start or end
    time: float  # s; infinite: never by itself
    tension: float  # N, of all these ends together; infinite: however large
    leaves: bool  # whether the ends leave their point; else the point comes with them


def weaknesses(system: Network) -> tuple[Weakness, ...]:
    """All that may break, lines first."""
    names = list(system.lines)
    found: list[tuple[str, tuple[tuple[int, int], ...], Failure, bool]] = []
    for name, line in system.lines.items():
        if line.break_at is not None:
            k = int(line.break_at.end == "end")
            point = (line.start, line.end)[k]
            text = f"line {name} breaks from point {point}"
            found.append((text, ((names.index(name), k),), line.break_at, True))
    for name, point_ in system.points.items():
        failure = getattr(point_, "break_at", None)
        if failure is not None:
            ends = tuple((names.index(x), int(end == "end")) for x, end in system.lines_at(name))
            found.append((f"point {name} gives way", ends, failure, False))
    return tuple(
        Weakness(text, ends, failure.time or np.inf, failure.tension or np.inf, leaves)
        for text, ends, failure, leaves in found
    )


def after_failure(model: NetworkModel, weakness: Weakness, t: float) -> NetworkModel:
    """The system with the ends of a weakness loose from t (s) on.

    Those are, as far as they are at their point; the old system is as it was.
    """
    ends = [at for at in weakness.ends if at not in model.loose]
    points, loose = len(model.free), model.loose | (set(ends) if weakness.leaves else set())
    joined = [model.joints[line][k] for line, k in ends]
    if not ends or (0 <= joined[0] < points and sum(pair.count(joined[0]) for pair in model.joints) == len(ends)):
        return replace(model, loose=loose)  # what is there is free already
    if len(ends) == 1:
        return _with_free_end(replace(model, loose=loose), *ends[0], t)
    joints = [[j if j < points else j + 1 for j in pair] for pair in model.joints]  # bodies come behind the points
    for line, k in ends:
        joints[line][k] = points
    models, seats = [*model.models], model.seats.copy()
    for line, k in ends:
        if models[line].line.element[-k] or models[line].line.torsion.size:
            models[line] = unclamped(models[line], k)
        seats[line, k] = 0.0
    shape = model.models[ends[0][0]].start.r[-ends[0][1]]
    return replace(
        model, free=(*model.free, weakness.name), joints=tuple((a, b) for a, b in joints),
        places=np.vstack([model.places, shape]), loose=loose, models=tuple(models), seats=seats,
    )  # fmt: skip


def _with_free_end(model: NetworkModel, line: int, k: int, t: float) -> NetworkModel:
    """The system with an end (line, 0 or 1) that nothing holds from t (s) on."""
    joints, seats, models = [list(x) for x in model.joints], model.seats.copy(), [*model.models]
    joints[line][k], seats[line, k] = -1, 0.0
    supports = {**model.supports, (line, k): models[line].ends}
    models[line] = without_hold(models[line], k, t)
    return replace(model, joints=tuple((a, b) for a, b in joints), seats=seats, models=tuple(models), supports=supports)
