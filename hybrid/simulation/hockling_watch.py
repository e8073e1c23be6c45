"""Events where the torque of a line is enough, for its tension, to throw a loop, and where it has thrown one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from hybrid.kernels.state.state import Floats
from hybrid.model.build import Model
from hybrid.store.capacity import formation_ratio, formation_tension, pop_out

# Change of writhe, turns, that is a loop: a small one has nearly 1.
LOOP = 0.75
# Change of writhe, turns, below which no loop is left.
OPEN = 0.5 * LOOP
# An event follows another when the margin is this part of what it was.
WORSE = 1.0 / 3.0


def note_hockling(
    model: Model, t: Floats, values: Mapping[str, Floats], s: Floats, ratio: float, event: Callable[..., None]
) -> float:
    """Write events where 1 over the formation margin is beyond `ratio`; that of the next event.

    t: (nb,) s; values: fields (nb, ...) of the outputs, along s (ns,) m; event: as EventLog.event.
    """
    torque = values.get("torque")
    if torque is None or not torque.any():
        return ratio
    piece = model.cable.piece(s)
    stiffness = model.cable.B[piece, :2].min(axis=1)
    found = formation_ratio(torque, values["tension"], stiffness)
    for k in np.flatnonzero(found.max(axis=1) > ratio):
        here = np.where(_long_enough(torque[k], values["tension"][k], stiffness, s), found[k], 0.0)
        i = int(here.argmax())
        if here[i] <= ratio:
            continue
        M, T, EI = float(torque[k, i]), float(values["tension"][k, i]), float(stiffness[i])
        text = _text(float(s[i]), M, T, EI, float(model.cable.outer_diameter[piece[i]]))
        event(float(t[k]), float(s[i]), float(s[i]), "loop can form", text, value=1.0 / float(here[i]), threshold=1.0)
        ratio = float(here[i]) / WORSE
    return ratio


def _long_enough(torque: Floats, tension: Floats, stiffness: Floats, s: Floats) -> np.ndarray:
    """Which points (ns,) lie in a stretch with too little tension that its torque alone could bend.

    Between pins a straight stretch of length l leaves the line from M^2/(4 EI) = T + pi^2 EI/l^2 on (Greenhill), which
    without tension is one that is longer than 2 pi EI/M.  T is not taken off: in a line that has begun to leave the
    straight line it falls in an ever shorter stretch, by about what that stretch bears, until the loop is there.
    """
    needed = formation_tension(torque, stiffness)
    out = needed > tension
    for a, b in np.flatnonzero(np.diff(np.concatenate([[0], out, [0]]))).reshape(-1, 2):
        length = s[min(b, s.size - 1)] - s[max(a - 1, 0)]
        out[a:b] = needed[a:b].mean() * length**2 > np.pi**2 * stiffness[a:b].max()
    return out


class Loops(NamedTuple):
    """What is remembered of loops from output to output.

    writhe: turns, of the first output, NaN before it; change: turns, by how much that of the next event differs;
    bend: 1/m, largest curvature at an output since a loop formed, 0: there is none.
    """

    writhe: float = np.nan
    change: float = LOOP
    bend: float = 0.0

    @property
    def formed(self) -> bool:
        """Whether a loop has formed since the first output, and not opened."""
        return self.change > LOOP


def note_loops(t: Floats, values: Mapping[str, Floats], s: Floats, known: Loops, event: Callable[..., None]) -> Loops:
    """Write events where the writhe is that of a loop more than at the first output, and where it has come back.

    known: what is remembered, which is returned as it is after these outputs; the rest as of `note_hockling`.
    """
    writhe = values.get("turns/writhe")
    if writhe is None:
        return known
    if not np.isfinite(known.writhe):
        known = known._replace(writhe=float(writhe[0]))
    change = np.abs(writhe - known.writhe)
    if not known.formed and not (change > LOOP).any():  # most batches
        return known
    for k in range(len(writhe)):
        known = _track_loop(t, values, s, k, known, event)
    return known


def _track_loop(
    t: Floats, values: Mapping[str, Floats], s: Floats, k: int, known: Loops, event: Callable[..., None]
) -> Loops:
    """What is remembered of loops after output k, with an event where one has formed or opened."""
    change, bends = float(values["turns/writhe"][k]) - known.writhe, values["curvature"][k]
    i, pull = int(bends.argmax()), float(values["tension"][k].max())
    where, bend = float(s[i]), max(known.bend, float(bends[i]))
    gone = abs(known.writhe) > LOOP and change * known.writhe < 0.0 and abs(change) > LOOP  # one of the first output
    if gone or (known.formed and abs(change) < OPEN):
        text = f"a loop has opened: the writhe has changed by {change:.3g} turns since the first output"
        if not gone:
            text = (
                f"the loop has opened: the writhe is within {abs(change):.2g} turns of that of the first output again"
            )
            text += f"; since it formed the line was bent to a radius of {1.0 / bend:.3g} m at the outputs"
        text += f", and the largest tension along the line is {pull:.4g} N now"
        event(float(t[k]), where, where, "loop opened", text, value=pull)
        return Loops(float(values["turns/writhe"][k]) if gone else known.writhe)
    if abs(change) > known.change:
        hand = "right" if change > 0.0 else "left"
        text = (
            f"the writhe has changed by {change:.3g} turns since the first output, about a {hand}-handed loop for "
            f"each: the line is bent most at s = {where:.6g} m; turns that it takes up no longer twist the line"
        )
        event(float(t[k]), where, where, "loop formed", text, value=change, threshold=known.change)
        return known._replace(change=2.0 * max(known.change, abs(change)), bend=bend)
    return known._replace(bend=bend) if known.formed else known


def _text(s: float, torque: float, tension: float, stiffness: float, diameter: float) -> str:
    needed = torque * torque / (4.0 * stiffness)
    text = (
        f"the torque of {torque:.3g} N m at s = {s:.6g} m needs a tension of M^2/(4 EI) = {needed:.3g} N to keep the "
        f"cable straight, there is {tension:.3g} N: it can throw a loop"
    )
    loop = pop_out(torque, stiffness, diameter) if diameter > 0.0 else None
    if loop is not None:
        text += f", which a pull of {loop.tension:.3g} N opens, bent to {loop.radius:.3g} m then"
    return f"{text}; friction, plasticity and weight on the loop are not in it"
