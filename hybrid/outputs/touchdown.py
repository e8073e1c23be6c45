"""Where a cable touches the seabed, seen from one state: gaps, lift-off points, contact force."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybrid.kernels.state import Floats, Line, Sea, State


class Touchdown(NamedTuple):
    """What lies on the seabed.  Edges are NaN when nothing does."""

    edges: Floats  # (2,) m, arc lengths of the first and the last point in contact
    places: Floats  # (2, 3) m, where they are
    grounded: float  # m, length in contact


def penetration(sea: Sea, r: Floats) -> Floats:
    """How deep points (n, 3) lie below where contact begins, m: half an onset above the seabed; negative above that."""
    return np.asarray(sea.offset + 0.5 * sea.onset - r @ sea.normal)


def touchdown(line: Line, sea: Sea, state: State) -> Touchdown:
    """First and last contact, exact for the chords that the contact force is integrated over."""
    p = penetration(sea, state.r)
    a, b = p[:-1], p[1:]
    touching = np.maximum(a, b) > 0.0
    if not touching.any():
        return Touchdown(np.full(2, np.nan), np.full((2, 3), np.nan), 0.0)
    # the part x0 .. x1 of every touching cell that is in contact
    change = np.where(b == a, 1.0, b - a)
    zero = np.clip(np.where(b == a, 0.0, -a / change), 0.0, 1.0)
    x0 = np.where((a <= 0.0) & touching, zero, 0.0)
    x1 = np.where((b <= 0.0) & touching, zero, 1.0)
    first, last = int(touching.argmax()), int(touching.size - 1 - touching[::-1].argmax())
    edges = np.array([line.s[first] + x0[first] * line.h[first], line.s[last] + x1[last] * line.h[last]])
    places = np.array(
        [state.r[c] + x * (state.r[c + 1] - state.r[c]) for c, x in ((first, x0[first]), (last, x1[last]))]
    )
    return Touchdown(edges, places, float(np.sum((x1 - x0) * line.h, where=touching)))


def contact_pressure(line: Line, sea: Sea, state: State, s: Floats) -> Floats:
    """Force per length (ns,) N/m of the seabed along its normal, at the points s of the chords."""
    p = np.interp(s, line.s, penetration(sea, state.r))
    v = np.interp(s, line.s, -state.v @ sea.normal)
    o = sea.onset
    linear = sea.stiffness * (p - 0.5 * o) + sea.damping * v
    onset = 0.5 * sea.stiffness * p * p / o + sea.damping * v * p / o
    return np.where(p <= 0.0, 0.0, np.maximum(np.where(p < o, onset, linear), 0.0))
