"""The nearest place of a surface of triangles, by a tree of boxes over them, and what the surface is like there.

    symbol   meaning                                                              shape  unit   frame
    y        place                                                                3      m      of the obstacle
    c        nearest place of the surface                                         3      m      of the obstacle
    d        distance to it, negative within                                      -      m
    n        (y - c)/d; on a face its normal                                      3      -      of the obstacle
    h, a     curvature 1/d across a, the direction of an edge; 0 of a face        -, 3   1/m

Within is what the normal of the nearest feature says, on edges and corners weighted by the angles of the facets that meet
there (Baerentzen and Aanaes 2005): closed surfaces, turned outwards (scene.mesh_file).
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.rotations import add, dot, scale, sub
from hybrid.kernels.machine.compile import called, inner
from hybrid.kernels.state.obstacle_rows import (
    ALONG,
    BEHIND,
    CORNERS,
    FACE,
    FEATURE,
    FEATURES,
    FIRST_CORNER,
    HIGHEST,
    LEAF,
    LOWEST,
    NORMAL,
    TURNS,
)


@inner
def three(rows, k, at):
    """A vector in a row."""
    return rows[k, at], rows[k, at + 1], rows[k, at + 2]


@inner
def away_from_box(boxes, j, y):
    """Square of the distance of a place to a box, m2; 0 within."""
    total = 0.0
    for i in range(3):
        out = max(boxes[j, LOWEST + i] - y[i], y[i] - boxes[j, HIGHEST + i], 0.0)
        total += out * out
    return total


@called
def nearest_on_facet(facets, f, y):
    """The nearest place on a facet, and which feature it is (Ericson, Real-Time Collision Detection, 5.1.5)."""
    a, b, c = three(facets, f, CORNERS), three(facets, f, CORNERS + 3), three(facets, f, CORNERS + 6)
    ab, ac, p = sub(b, a), sub(c, a), sub(y, a)
    d1, d2 = dot(ab, p), dot(ac, p)
    if d1 <= 0.0 and d2 <= 0.0:
        return a, FIRST_CORNER
    p = sub(y, b)
    d3, d4 = dot(ab, p), dot(ac, p)
    if d3 >= 0.0 and d4 <= d3:
        return b, FIRST_CORNER + 1
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        return add(a, scale(d1 / (d1 - d3), ab)), 0
    p = sub(y, c)
    d5, d6 = dot(ab, p), dot(ac, p)
    if d6 >= 0.0 and d5 <= d6:
        return c, FIRST_CORNER + 2
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        return add(a, scale(d2 / (d2 - d6), ac)), 2
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 >= d3 and d5 >= d6:
        return add(b, scale((d4 - d3) / ((d4 - d3) + (d5 - d6)), sub(c, b))), 1
    n = three(facets, f, NORMAL)
    return sub(y, scale(dot(n, sub(y, a)), n)), FACE


@inner
def nearest_facet(boxes, facets, root, y):
    """The facet that is nearest to a place, the nearest place on it, and its feature."""
    j = root
    while boxes[j, LEAF] < 0.0:  # a near one first, so that most boxes are known to be further
        right = int(boxes[j + 1, BEHIND])
        j = j + 1 if away_from_box(boxes, j + 1, y) <= away_from_box(boxes, right, y) else right
    best = int(boxes[j, LEAF])
    c, feature = nearest_on_facet(facets, best, y)
    w = sub(y, c)
    least, j, end = dot(w, w), root, int(boxes[root, BEHIND])
    while j < end:
        if away_from_box(boxes, j, y) >= least:
            j = int(boxes[j, BEHIND])
            continue
        if boxes[j, LEAF] >= 0.0:
            f = int(boxes[j, LEAF])
            there, which = nearest_on_facet(facets, f, y)
            w = sub(y, there)
            if dot(w, w) < least:
                best, c, feature, least = f, there, which, dot(w, w)
        j += 1
    return best, c, feature


@called
def mesh_surface(sea, root, radius, y):
    """d, n and curvature of a surface of triangles moved out by a radius, m; root: the first of its boxes."""
    facets = sea.facets
    best, c, feature = nearest_facet(sea.boxes, facets, root, y)
    n = three(facets, best, NORMAL)
    if feature == FACE:
        return dot(n, sub(y, three(facets, best, CORNERS))) - radius, n, (0.0, (0.0, 0.0, 0.0), 0.0)
    w, at = sub(y, c), FEATURES + FEATURE * feature
    m, rho = three(facets, best, at), math.sqrt(dot(w, w))
    if not rho > 1e-12 * radius:
        return -radius, m, (0.0, (0.0, 0.0, 0.0), 0.0)
    d = math.copysign(rho, dot(w, m))
    hollow = facets[best, at + TURNS] / d
    along = three(facets, best, at + ALONG) if hollow != 0.0 else (0.0, 0.0, 0.0)
    return d - radius, scale(1.0 / d, w), (hollow, along, 0.0)
