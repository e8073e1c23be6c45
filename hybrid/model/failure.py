"""Lines that break from their points, and points that give way: what may break, and the network after it.

An end that comes loose alone is a free end of its line; ends that stay together are joined to a free point of their
own without mass.  What was clamped bends there no more, and no torque passes through the catenary zones of its line.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hybrid.kernels.state.state import NO_TORSION, Line
from hybrid.model.build import Model
from hybrid.model.line import with_spin_inertia
from hybrid.model.mesh import LineOnBase
from hybrid.model.network import NetworkModel
from hybrid.scene.ends import Failure
from hybrid.scene.network import Network


class Weakness(NamedTuple):
    """Something that may break."""

    name: str  # for people
    ends: tuple[tuple[int, int], ...]  # of lines: number, and 0 or 1 for start or end
    time: float  # s; infinite: never by itself
    tension: float  # N, of all these ends together; infinite: however large
    leaves: bool  # whether the ends leave their point; else the point comes with them


def weaknesses(network: Network) -> tuple[Weakness, ...]:
    """All that may break, lines first."""
    names = list(network.lines)
    found = list[Weakness]()

    def may_break(text: str, ends: Iterable[tuple[int, int]], when: Failure, leaves: bool) -> None:
        found.append(Weakness(text, tuple(ends), when.time or np.inf, when.tension or np.inf, leaves))

    for name, line in network.lines.items():
        if line.break_at is not None:
            k = int(line.break_at.end == "end")
            point = (line.start, line.end)[k]
            may_break(f"line {name} breaks from point {point}", [(names.index(name), k)], line.break_at, True)
    for name, point_ in network.points.items():
        failure = getattr(point_, "break_at", None)
        if failure is not None:
            ends = ((names.index(x), int(end == "end")) for x, end in network.lines_at(name))
            may_break(f"point {name} gives way", ends, failure, False)
    return tuple(found)


def after_failure(model: NetworkModel, weakness: Weakness, t: float) -> NetworkModel:
    """The network with the ends of a weakness loose from t (s) on.

    Those are, as far as they are at their point; the old network is as it was.
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
    """The network with an end (line, 0 or 1) that nothing holds from t (s) on."""
    joints, seats, models = [list(x) for x in model.joints], model.seats.copy(), [*model.models]
    joints[line][k], seats[line, k] = -1, 0.0
    supports = {**model.supports, (line, k): models[line].ends}
    models[line] = without_hold(models[line], k, t)
    return replace(model, joints=tuple((a, b) for a, b in joints), seats=seats, models=tuple(models), supports=supports)


# A line whose end is let go in mid-motion: what held the end is off, and everything else stays as it is.


def without_hold(model: Model, k: int, t: float) -> Model:
    """The same model with end k (0 or 1) free from t (s) on; its motion is over.  The old one is as it was."""
    held = model.line if model.held is None else model.held
    return replace(unclamped(model, k), ends=model.ends.released_at(k, t), held=held)


def unclamped(model: Model, k: int) -> Model:
    """The same model without what holds the direction and the twist of end k (0 or 1)."""
    tangent, twist, hinged = model.cable.held_tangent, model.cable.held_twist, model.cable.hinged
    cable = replace(
        model.cable,
        held_tangent=(tangent[0] and k != 0, tangent[1] and k != 1),
        held_twist=(twist[0] and k != 0, twist[1] and k != 1),
        hinged=(hinged[0] or k == 0, hinged[1] or k == 1),
    )
    line, on_base = without_clamp(model.line, -k), None
    if line.torsion.size:  # a torque passes where both ends hold the twist
        line = line._replace(torsion=NO_TORSION)
    if model.layout is not None:
        line, on_base = with_spin_inertia(line, cable), LineOnBase(cable, model.layout.base)
    return replace(model, line=line, cable=cable, on_base=on_base)


def without_clamp(line: Line, node: int) -> Line:
    """The line without the element between an end and its clamp; without a clamp, the line itself."""
    if not line.element[node]:
        return line
    element, kb, k0, hn = line.element.copy(), line.kb.copy(), line.k0.copy(), line.hn.copy()
    element[node], kb[node], k0[node], hn[node] = 0, 0.0, 0.0, 0.5 * abs(line.s[node] - line.s[-2 if node else 1])
    return line._replace(element=element, kb=kb, k0=k0, hn=hn)
