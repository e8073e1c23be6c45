"""Means over the lengths that output points stand for, so that nothing between the points is missed."""

from __future__ import annotations

import numpy as np

from hybrid.kernels.state.state import Floats

ROUND_OFF = 1e-9  # of a length: points that are nearer are the same


def means_beside(s: Floats, nodes: Floats, values: Floats) -> Floats:
    """Means (ns, nb) of values (nb, N+1) at nodes (N+1,) m, from halfway to the point before to halfway to the next.

    s: (ns,) m, increasing, two at least.  The means times those lengths add up to the integral.
    """
    middles = 0.5 * (s[1:] + s[:-1])
    first, last = 2.0 * s[0] - middles[0], 2.0 * s[-1] - middles[-1]
    edges = np.concatenate([[max(first, nodes[0])], middles, [min(last, nodes[-1])]])
    h = np.diff(nodes)
    total = np.zeros_like(values)
    np.cumsum(0.5 * h * (values[:, 1:] + values[:, :-1]), axis=1, out=total[:, 1:])
    cell = np.clip(np.searchsorted(nodes, edges, side="right") - 1, 0, h.size - 1)
    x = edges - nodes[cell]
    slope = (values[:, cell + 1] - values[:, cell]) / h[cell]
    upto = total[:, cell] + values[:, cell] * x + 0.5 * slope * x * x
    return np.asarray((np.diff(upto, axis=1) / np.diff(edges)).T)


def means_on_line(s: Floats, nodes: Floats, values: Floats) -> Floats:
    """The same (ns,) of one output (N+1,), whose points s (ns,) m may be the same where line is still on a reel."""
    points, which = np.unique(s, return_inverse=True)
    apart = np.append(True, np.diff(points) > ROUND_OFF * (nodes[-1] - nodes[0]))
    points, which = points[apart], (np.cumsum(apart) - 1)[which]
    if points.size == 1:
        return np.full(s.size, np.interp(points[0], nodes, values))
    return np.asarray(means_beside(points, nodes, values[None])[which, 0])
