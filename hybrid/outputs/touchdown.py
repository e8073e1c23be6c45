"""Where a cable touches the seabed, seen from a batch of states: gaps, lift-off points, contact force."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybrid.kernels.laws.bed import planes_under
from hybrid.kernels.state.state import Floats, Sea


class Touchdown(NamedTuple):
    """What lies on the seabed, of nb states.  Edges are NaN when nothing does."""

    edges: Floats  # (2, nb) m, arc lengths of the first and the last point in contact
    places: Floats  # (2, 3, nb) m, where they are
    grounded: Floats  # (nb,) m, length in contact


def penetration(sea: Sea, r: Floats) -> Floats:
    """How deep points (n, 3, nb) lie below where contact begins, m: half an onset above the seabed; negative above."""
    if not sea.bed_x.size:
        return np.asarray(sea.offset + 0.5 * sea.onset - _along(sea.normal, r))
    n, _, nb = r.shape
    return planes_under(sea, np.moveaxis(r, 1, 2).reshape(-1, 3))[1].reshape(n, nb)


def sinking(sea: Sea, r: Floats, v: Floats) -> Floats:
    """Rates of `penetration` (n, nb), m/s, of points (n, 3, nb) that move by v."""
    if not sea.bed_x.size:
        return -_along(sea.normal, v)
    n, _, nb = r.shape
    normals = planes_under(sea, np.moveaxis(r, 1, 2).reshape(-1, 3))[0].reshape(n, nb, 3)
    return -_along(np.moveaxis(normals, 2, 0), v)


def _along(normal: Floats, x: Floats) -> Floats:
    """Component of vectors (n, 3, nb) along a normal; by no library, whose sums depend on the number of outputs."""
    return np.asarray(normal[0] * x[:, 0] + normal[1] * x[:, 1] + normal[2] * x[:, 2])


def sum_down(x: Floats) -> Floats:
    """Sums along the first axis in its order, the same bits for any number of outputs."""
    return np.asarray(np.add.accumulate(x, axis=0)[-1])


def touchdown(s: Floats, p: Floats, r: Floats) -> Touchdown:
    """First and last contact, exact for the chords that the contact force is integrated over.

    s: (N+1, 1) m, or (N+1, nb) where it differs; p: (N+1, nb) m, as of `penetration`; NaN: no such node in an output;
    r: (N+1, 3, nb) m, of the nodes.
    """
    below = np.flatnonzero((p > 0.0).any(axis=1))  # nodes that touch in any output
    if not below.size:
        nb = p.shape[1]
        return Touchdown(np.full((2, nb), np.nan), np.full((2, 3, nb), np.nan), np.zeros(nb))
    low, high = max(int(below[0]) - 1, 0), min(int(below[-1]) + 1, len(s) - 1)
    a, b, r = p[low:high], p[low + 1 : high + 1], r[low : high + 1]
    s = np.broadcast_to(s[low : high + 1], (len(r), p.shape[1]))
    touching = np.maximum(a, b) > 0.0
    # the part x0 .. x1 of every touching cell that is in contact
    change = np.where(b == a, 1.0, b - a)
    zero = np.clip(np.where(b == a, 0.0, -a / change), 0.0, 1.0)
    x0 = np.where(a <= 0.0, zero, 0.0)
    x1 = np.where(b <= 0.0, zero, 1.0)
    outputs = np.arange(p.shape[1])
    cells = np.stack([touching.argmax(axis=0), len(a) - 1 - touching[::-1].argmax(axis=0)])
    x = np.stack([x0[cells[0], outputs], x1[cells[1], outputs]])
    h = np.diff(s, axis=0)
    edges = s[cells, outputs] + x * h[cells, outputs]
    # (2, nb, 3), because numpy puts what is indexed by arrays first
    near, far = r[cells, :, outputs], r[cells + 1, :, outputs]
    places = np.moveaxis(near + x[:, :, None] * (far - near), -1, 1)
    grounded = sum_down(h * np.where(touching, x1 - x0, 0.0))
    lies = touching.any(axis=0)
    return Touchdown(np.where(lies, edges, np.nan), np.where(lies, places, np.nan), grounded)


def carried(h: Floats, q: Floats) -> Floats:
    """Force per length N/m that the nodes bear of a pressure q (N+1, nb) N/m: of each node over its half cells.

    It is what stands in the balance of the nodes, so that it has the weight of what lies still; q itself swings about
    that by up to a quarter beside an anchor and at the touchdown, where cells are longer than sqrt(T/k), over which the
    bed takes up the line.  h: (N,) or (N, nb) m, lengths of the cells.
    """
    h = h.reshape(len(h), -1)
    force, length = np.zeros_like(q), np.zeros((len(q), h.shape[1]))
    force[:-1] += h * (2.0 * q[:-1] + q[1:]) / 6.0
    force[1:] += h * (q[:-1] + 2.0 * q[1:]) / 6.0
    length[:-1] += 0.5 * h
    length[1:] += 0.5 * h
    return np.asarray(force / length)


def contact_pressure(sea: Sea, p: Floats, v: Floats) -> Floats:
    """Force per length N/m of the seabed along its normal, at points of penetration p (m) with the rate v (m/s)."""
    o = sea.onset
    linear = sea.stiffness * (p - 0.5 * o) + sea.damping * v
    onset = 0.5 * sea.stiffness * p * p / o + sea.damping * v * p / o
    return np.where(p <= 0.0, 0.0, np.maximum(np.where(p < o, onset, linear), 0.0))
