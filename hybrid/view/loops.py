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
