"""What cells miss of the bending of a rod beside its ends, point loads and joints, where a layer is short for them.

Moments go over to those of a hanging line within the layer fade = sqrt(EI/F), as exp(-s/fade).  On cells that are not
much shorter results go straight from node to node, and at a clamp or a load the moment itself is too small; coarser
cells show little of that, because their errors do not fall by any order yet.

    symbol   meaning                                                        unit
    F        force in the cell beside the end                               N
    fade     sqrt(EI/F), the length over which bending fades                m
    x        h/fade, length of the cell beside the end                      1
    M        moments at the three nodes nearest to the end                  N m
    B        part of M that fades, M = c + d s + B exp(-s/fade)             N m
    root     by which a fading part falls from node to node on cells h      1
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

import numpy as np

from hybrid.kernels.state.state import Floats
from hybrid.outputs.observation import Observation

# Lengths of two cells over which bending fades at most: longer, it is a parabola over them but for round-off.
LONGEST = 1e3


def layer_errors(view: Observation, loads: Iterable[int]) -> dict[str, Floats]:
    """Errors (ns,) of curvature, 1/m, and bending moment, N m, of one output; loads: nodes of point loads.

    Only of the two cells beside an end, a joint or a load.
    """
    out, line = dict[str, Floats](), view.line
    if not view.node_moment.size:
        return out
    points, bends = view.grid.points[:, 0], line.element != 0
    moment, T, d = view.node_moment[..., 0], view.T[:, 0], view.d[..., 0]
    for zone, (first, last, _) in zip(view.grid.parts, view.grid.spans, strict=True):
        if zone.kind != "rod":
            continue
        edges = [first, *(i for i in loads if first < i < last), last]
        for a, b in pairwise(edges):
            if b - a < 6:
                continue
            for node, step in ((a, 1), (b, -1)):
                nodes = node + step * np.arange(3)
                cell, EI = min(node, nodes[1]), line.kb[nodes[1], :2].max() * line.hn[nodes[1]]
                shear = np.cross(d[cell], moment[cell + 1] - moment[cell]) / view.length[cell, 0]
                F = float(np.hypot(T[cell], np.linalg.norm(shear)))
                if EI <= 0.0:
                    continue
                s = abs(line.s[nodes] - line.s[node])
                fade = np.sqrt(EI / max(F, EI / (LONGEST * s[2]) ** 2))
                at = step * (points - line.s[node])
                inside = np.flatnonzero((at >= 0.0) & (at < s[2]))
                turns = line.hn[node] / line.h[cell] if node in (0, line.h.size) else 0.5
                missed = layer_missed(s, moment[nodes], fade, at[inside], turns if bends[node] else 0.0)
                for name, scale in (("curvature", EI), ("bending_moment", 1.0)):
                    found = out.setdefault(name, np.zeros(points.size))
                    found[inside] = np.maximum(found[inside], missed / scale)
    return out


def layer_missed(s: Floats, M: Floats, fade: float, at: Floats, turns: float) -> Floats:
    """Distance (n,) N m of straight interpolation from a moment that fades with the distance from an end.

    s: (3,) m, nodes from the end on, 0 the first; M: (3, 3) N m; at: (n,) m; turns: cells that bend as much as what
    holds the direction at the end, as of `shown_at_clamp`, 0: the moment is given there.
    """
    e = np.exp(-s / fade)
    part = s[1] / s[2]
    bend = M[0] * (1.0 - part) + M[2] * part - M[1]  # above node 1 of the line through nodes 0 and 2
    B = bend / ((1.0 - part) + e[2] * part - e[1])
    straight = np.stack([np.interp(at, s, x) for x in M.T], axis=1)
    rest = M - B * e[:, None]  # c + d s
    true = rest[0] + (rest[2] - rest[0]) * (at / s[2])[:, None]
    true = true + B / (shown_at_clamp(s[1] / fade, turns) if turns else 1.0) * np.exp(-at / fade)[:, None]
    return np.linalg.norm(true - straight, axis=1)


def shown_at_clamp(x: float, turns: float = 0.5) -> float:
    """Part of the moment at a clamp under tension that cells of x fades show; 1 on short ones.

    turns: cells that bend as much as the half cell at the clamp and an angular spring there.
    Of the balance of moments of cells of equal length: F h phi_j = M_j+1 - M_j, M_j = EI (phi_j - phi_j-1)/h, at the
    clamp M_0 = EI (phi_1 - alpha)/(turns h); exactly it is -EI alpha/(fade + (turns - 1/2) h).
    """
    root = 1.0 + 0.5 * x * x - x * np.sqrt(1.0 + 0.25 * x * x)
    left = 1.0 / (1.0 + turns * (x * x + 1.0 - root))  # phi_1/alpha
    return float((1.0 - left) / (turns * x) * (1.0 + (turns - 0.5) * x))
