"""Contact of lines of a system with each other: made of a model, and whether a way between two shapes crosses lines."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from hybrid.kernels.state.state import Floats
from hybrid.model.build import Model
from hybrid.model.lines_contact import Touching
from hybrid.model.system import SystemModel
from hybrid.simulation.contact_equilibrium import JUMP, jumps
from hybrid.simulation.self_watch import diameters, least_bending
from hybrid.solve.joined import SystemState
from hybrid.solve.shared_contact import SharedContact, TouchingLine
from hybrid.store.partners import meeting_text

if TYPE_CHECKING:
    from hybrid.simulation.system_run import SystemRun


def shared_of(model: SystemModel, rubs: bool = False) -> SharedContact | None:
    """Contact of the lines of a model with each other, with friction or without; None: they have none."""
    if model.touching is None:
        return None
    return SharedContact(model.touching, [strand_in(model.models[k]) for k in model.touching.lines], rubs)


def strand_in(x: Model) -> TouchingLine:
    """What contact takes of the line of a model."""
    grows = 0.0 if x.payout is None else float(np.diff(x.payout.nodes).max())
    return TouchingLine(x.line, diameters(x), least_bending(x), x.tension_scale, grows)


def crossed(touching: Touching, first: SystemState, last: SystemState) -> Iterator[tuple[int, int]]:
    """Numbers of lines, two each, of which one passes through the other on the straight way between two shapes."""
    for j, a in enumerate(touching.lines):
        for k, b in enumerate(touching.lines[j + 1 :], j + 1):
            if not touching.meets[j, k]:
                continue
            ways = [np.stack(_of_as_many_nodes(first.lines[m].r, last.lines[m].r)) for m in (a, b)]
            lows, highs = ([f(w, axis=(0, 1)) for w in ways] for f in (np.min, np.max))
            if (np.maximum(*lows) > np.minimum(*highs)).any():
                continue
            if jumps(*ways) > JUMP:
                yield a, b


def _of_as_many_nodes(a: Floats, b: Floats) -> list[Floats]:
    """Two shapes of a line, (n, 3) m; where its cells have changed between them at equal parts of their lengths."""
    if a.shape == b.shape:
        return [a, b]
    parts, shapes = np.linspace(0.0, 1.0, max(len(a), len(b))), []
    for r in (a, b):
        s = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(r, axis=0), axis=1)))
        shapes.append(np.column_stack([np.interp(parts * s[-1], s, x) for x in r.T]))
    return shapes


def pair_text(shared: SharedContact, model: SystemModel) -> str:
    """Which two lines, or a line and itself, are nearest of what was looked at last, and where."""
    a, i, b, j, distance = shared.deepest_pair
    s, other = (float(model.models[k].line.s[n]) for k, n in ((a, i), (b, j)))
    return f"lines {model.names[a]} and {model.names[b]} are {distance:.3g} m apart at s = {s:.4g} and {other:.4g} m"


def tell_meetings(run: SystemRun) -> None:
    """An event for every two lines that have met, when they do first."""
    told = run.met
    shared: SharedContact | None = run.solver.shared
    for a, b, t, s, other in sorted(shared.met() if shared is not None else (), key=lambda x: x[2]):
        if (a, b) in told:
            continue
        told.add((a, b))
        text = meeting_text(run.model.names[a], run.model.names[b], s, other)
        run.recorder.event(t, 0.0, 0.0, "lines touch", text)
