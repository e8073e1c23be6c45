"""The loop that the torque of a result would trap."""

from __future__ import annotations

import numpy as np

from hybrid.store.hockling import pop_out
from hybrid.store.reader import Result
from hybrid.view.along import Along

# Of the largest torque: places with so much of it are judged, for a torque is nearly the same along a cable.
NEARLY = 0.99


def trapped_loop(result: Result, found: Along, torque: np.ndarray) -> dict[str, float] | None:
    """The loop that the largest torque (nt, n) N m would trap, as it pops out: tension (N), bend radius (m), and that

    over the one allowed, where it is smallest.  None: no diameter is known, or no loop is trapped.
    """
    diameter, stiffness = found.of(result, "diameter"), found.of(result, "bending_stiffness")
    if diameter is None or stiffness is None:
        return None
    limit = found.of(result, "min_bend_radius")
    allowed = np.full(diameter.shape, np.nan) if limit is None else limit
    most = np.abs(torque).max(axis=0)
    best: dict[str, float] | None = None
    for k in np.flatnonzero((most >= NEARLY * most.max()) & (diameter > 0.0)):
        loop = pop_out(float(most[k]), float(stiffness[k]), float(diameter[k]))
        if loop is None:
            continue
        margin = loop.radius / float(allowed[k])
        if best is None or margin < best.get("kink_margin", np.inf):
            best = {"pop_out_tension": loop.tension, "pop_out_radius": loop.radius}
            if np.isfinite(margin):
                best["kink_margin"] = margin
    return best


def held_loop(result: Result, found: Along, torque: np.ndarray, tension: np.ndarray) -> dict[str, float] | None:
    """Of the outputs (nt,) at which the line touches itself, that at which a loop is nearest to being pulled open.

    torque, tension: (nt, n) N m, N.  Returns its time (s), and over the largest tension there, the tension at which a
    loop of the torque of that output pops out; None: no contact is computed or found, or no loop is trapped.
    """
    diameter, stiffness = found.of(result, "diameter"), found.of(result, "bending_stiffness")
    if diameter is None or stiffness is None or "energy/self_contact" not in result:
        return None
    best: dict[str, float] | None = None
    for k in np.flatnonzero(np.asarray(result["energy/self_contact"]) > 0.0):
        i = int(np.abs(torque[k]).argmax())
        loop = pop_out(float(torque[k, i]), float(stiffness[i]), float(diameter[i])) if diameter[i] > 0.0 else None
        most = float(tension[k].max())
        if loop is None or not most > 0.0:
            continue
        margin = loop.tension / most
        if best is None or margin < best["pop_out_margin"]:
            best = {"pop_out_margin": margin, "pop_out_time": float(result.times[k])}
    return best
