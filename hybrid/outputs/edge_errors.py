"""What cells miss of the curvature of a rod where its contact with the seabed begins or ends.

On a hard bed the reaction beside the edge is a force at a point: the curvature has a kink there.  Along a cell with the
kink in it results go straight from node to node, and meshes whose nodes lie alike beside it differ by little of that.

    symbol   meaning                                                unit
    k        curvature, or bending moment, at nodes                 1/m, N m
    m        its slopes along cells                                 1/m^2, N
"""

from __future__ import annotations

import numpy as np

from hybrid.kernels.state.state import Floats
from hybrid.outputs.observation import Observation
from hybrid.outputs.vectors import size


def edge_errors(view: Observation) -> dict[str, Floats]:
    """Errors (ns,) of curvature, 1/m, and bending moment, N m, of one output; none where no rod touches down."""
    depth, s, out = view.depth[:, 0], view.line.s, dict[str, Floats]()
    edges = np.flatnonzero((depth[1:] > 0.0) != (depth[:-1] > 0.0))
    # the reaction of the bed may sit at the last node in contact, and the curvature begin in the cell before it
    edges = np.unique(np.concatenate([edges, edges + np.where(depth[edges] > 0.0, -1, 1)]))
    rods = [span for zone, span in zip(view.grid.parts, view.grid.spans, strict=True) if zone.kind == "rod"]
    strains = view._strains[:, 0, 0]
    moment = size(view.node_moment)[:, 0] if view.node_moment.size else np.zeros(s.size)
    points = view.grid.points[:, 0]
    for first, last, row in rods:
        curvature = strains[row : row + last - first + 1]
        for c in edges[(edges >= first + 2) & (edges < last - 2)]:
            at = slice(c - 2, c + 4)
            inside = (points > s[c]) & (points < s[c + 1])
            for name, k in (("curvature", curvature[c - first - 2 : c - first + 4]), ("bending_moment", moment[at])):
                out.setdefault(name, np.zeros(points.size))[inside] = kink_missed(s[at], k, points[inside])
    return out


def kink_missed(s: Floats, k: Floats, at: Floats) -> Floats:
    """Distance of straight interpolation in the middle one of five cells from a curve with a kink there.

    The lines through the two nodes on either side meet at the kink.  What slopes change by within either side is no
    part of it.  s: (6,) m, nodes; k: (6,) values; at: (n,) m, places in the cell.
    """
    m = np.diff(k) / np.diff(s)
    turn, h = m[3] - m[1], s[3] - s[2]
    if not (turn * (k[2] + m[1] * h - k[3]) < 0.0 and turn * (k[3] - m[3] * h - k[2]) < 0.0):
        return np.zeros(at.size)  # they do not meet in the cell
    part = max(0.0, abs(turn) - abs(m[1] - m[0]) - abs(m[4] - m[3])) / abs(turn)
    left, right = k[2] + m[1] * (at - s[2]), k[3] + m[3] * (at - s[3])
    curve = np.maximum(left, right) if turn > 0.0 else np.minimum(left, right)
    return part * np.abs(k[2] + m[2] * (at - s[2]) - curve)
