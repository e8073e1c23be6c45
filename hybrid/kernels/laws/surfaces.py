"""Surfaces of obstacles: the distance to each kind.

The nearest place of a surface of triangles, by a tree of boxes over them, and what the surface is like there.

    symbol   meaning                                                              shape  unit   frame
    y        place                                                                3      m      of the obstacle
    c        nearest place of the surface                                         3      m      of the obstacle
    d        distance to it, negative within                                      -      m
    n        (y - c)/d; on a face its normal                                      3      -      of the obstacle
    h, a     curvature 1/d across a, the direction of an edge; 0 of a face        -, 3   1/m

Within is what the normal of the nearest feature says, on edges and corners weighted by the angles of the facets that
meet there (Baerentzen and Aanaes 2005): closed surfaces, turned outwards (scene.obstacles).

All kinds by one function: distance, outward normal and curvature at a point.

    symbol   meaning                                                              shape  unit   frame
    d        distance of a point to the surface moved out by the radius of the
             strand; its slope is 1 everywhere                                    -      m
    n        its gradient, the outward normal                                     3      -      inertial
    K        gradient of n, h (1 - nn^T - aa^T) + g aa^T: curvatures h across
             and g along a unit vector a of the surface                           9      1/m    inertial

    kind      solid                                                        h             g
    plane     half space                                                   0             0
    round     what is within the radius of a stretch of its axis: a        1/rho         0 beside a cylinder, else 1/rho (a = 0)
              cylinder that ends in half spheres, a sphere
    box       what is within the radius of a box: faces, rounded edges     0 on faces, as a cylinder on edges, as a
              and corners                                                  sphere on corners
    torus     what is within the radius of a ring                          1/rho         n_s/s
    sheave    a disc with a groove of circular section, whose rims are     -1/rho in the n_s/s
              tori                                                         groove
    mesh      what is within the radius of a closed surface of triangles   as of a box

rho is the distance to the axis, edge or ring; s that to the axis of a torus or sheave, n_s the part of n away from it.
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.rotations import add, cross, dot, madd, mscale, outer, scale, sub, vector
from hybrid.kernels.machine.compile import called, inner
from hybrid.kernels.state.report import (
    ALONG,
    AXIS,
    BEHIND,
    BOX,
    CORNERS,
    FACE,
    FEATURE,
    FEATURES,
    FIRST_CORNER,
    FLAT,
    GROOVE,
    HALF_HEIGHT,
    HALF_LENGTH,
    HALF_WIDTH,
    HIGHEST,
    KIND,
    LEAF,
    LOWEST,
    MESH,
    NORMAL,
    PLACE,
    RADIUS,
    RIM,
    RING,
    ROOT,
    ROUND,
    SIDE,
    TORUS,
    TURNS,
)


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
    a, b, c = vector(facets[f], CORNERS), vector(facets[f], CORNERS + 3), vector(facets[f], CORNERS + 6)
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
    n = vector(facets[f], NORMAL)
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
    n = vector(facets[best], NORMAL)
    if feature == FACE:
        return dot(n, sub(y, vector(facets[best], CORNERS))) - radius, n, (0.0, (0.0, 0.0, 0.0), 0.0)
    w, at = sub(y, c), FEATURES + FEATURE * feature
    m, rho = vector(facets[best], at), math.sqrt(dot(w, w))
    if not rho > 1e-12 * radius:
        return -radius, m, (0.0, (0.0, 0.0, 0.0), 0.0)
    d = math.copysign(rho, dot(w, m))
    hollow = facets[best, at + TURNS] / d
    along = vector(facets[best], at + ALONG) if hollow != 0.0 else (0.0, 0.0, 0.0)
    return d - radius, scale(1.0 / d, w), (hollow, along, 0.0)


Z3 = (0.0, 0.0, 0.0)
Z9 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
E9 = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


@inner
def surface(sea, k, x):
    """d and n of obstacle k at a point, and its curvature (h, a, g) there."""
    rows = sea.obstacles
    if rows[k, KIND] > ROUND:
        return shaped_surface(sea, k, x)
    a = (rows[k, AXIS], rows[k, AXIS + 1], rows[k, AXIS + 2])
    w = (x[0] - rows[k, PLACE], x[1] - rows[k, PLACE + 1], x[2] - rows[k, PLACE + 2])
    t = dot(w, a)
    if rows[k, KIND] == FLAT:
        return t - rows[k, RADIUS], a, (0.0, a, 0.0)
    half = rows[k, HALF_LENGTH]
    along = min(max(t, -half), half)
    y = sub(w, scale(along, a))
    rho = math.sqrt(dot(y, y))
    if not rho > 1e-12 * rows[k, RADIUS]:  # on the axis any direction leads out
        y = (1.0 - a[0] * a[0], -a[0] * a[1], -a[0] * a[2])
        if not dot(y, y) > 0.1:
            y = (-a[1] * a[0], 1.0 - a[1] * a[1], -a[1] * a[2])
        rho = math.sqrt(dot(y, y))
        return -rows[k, RADIUS], scale(1.0 / rho, y), (0.0, a, 0.0)
    if along != t or half == 0.0:
        a = Z3
    return rho - rows[k, RADIUS], scale(1.0 / rho, y), (1.0 / rho, a, 0.0)


@inner
def is_far(sea, k, x, way):
    """Whether a point is farther than a way, m, from obstacle k by the size of that.

    False: it is not known.  Planes have no end, and of meshes the rows do not hold the size.
    """
    rows = sea.obstacles
    if rows[k, KIND] == FLAT or rows[k, KIND] == MESH:
        return False
    size = way + rows[k, RADIUS] + rows[k, HALF_LENGTH] + rows[k, HALF_WIDTH] + rows[k, HALF_HEIGHT]
    size += rows[k, RING] + rows[k, GROOVE] + 2.0 * rows[k, RIM]
    w = (x[0] - rows[k, PLACE], x[1] - rows[k, PLACE + 1], x[2] - rows[k, PLACE + 2])
    return dot(w, w) > size * size


@called
def shaped_surface(sea, k, x):
    """The same of what has axes of its own: along AXIS, along SIDE, and across both."""
    rows = sea.obstacles
    u = (rows[k, AXIS], rows[k, AXIS + 1], rows[k, AXIS + 2])
    v = (rows[k, SIDE], rows[k, SIDE + 1], rows[k, SIDE + 2])
    w = cross(u, v)
    y = (x[0] - rows[k, PLACE], x[1] - rows[k, PLACE + 1], x[2] - rows[k, PLACE + 2])
    y = (dot(y, u), dot(y, v), dot(y, w))
    if rows[k, KIND] == BOX:
        halves = (rows[k, HALF_LENGTH], rows[k, HALF_WIDTH], rows[k, HALF_HEIGHT])
        d, n, (h, a, g) = box_surface(halves, rows[k, RADIUS], y)
    elif rows[k, KIND] == MESH:
        d, n, (h, a, g) = mesh_surface(sea, int(rows[k, ROOT]), rows[k, RADIUS], y)
    else:
        s = math.sqrt(y[1] * y[1] + y[2] * y[2])
        out = (y[1] / s, y[2] / s) if s > 0.0 else (1.0, 0.0)
        if rows[k, KIND] == TORUS:
            d, na, ns, h = ring_section(rows[k, RADIUS], s - rows[k, RING], y[0])
        else:
            d, na, ns, h = sheave_section(rows[k, RING], rows[k, GROOVE], rows[k, RIM], s, y[0])
        n, a = (na, ns * out[0], ns * out[1]), (0.0, -out[1], out[0])
        g = ns / s if s > 0.0 else 0.0
    n = add(scale(n[0], u), add(scale(n[1], v), scale(n[2], w)))
    a = add(scale(a[0], u), add(scale(a[1], v), scale(a[2], w)))
    return d, n, (h, a, g)


@inner
def beyond(p, half):
    """How far a coordinate is beyond a half length on either side; 0: it is within."""
    return p - min(max(p, -half), half)


@inner
def box_surface(halves, radius, y):
    """d, n and curvature of what is within a radius of a box of half lengths (3,), in its axes."""
    z = (beyond(y[0], halves[0]), beyond(y[1], halves[1]), beyond(y[2], halves[2]))
    rho = math.sqrt(dot(z, z))
    if not rho > 1e-12 * radius:  # within the box: the nearest face leads out
        deep = (halves[0] - abs(y[0]), halves[1] - abs(y[1]), halves[2] - abs(y[2]))
        least = min(deep[0], deep[1], deep[2])
        if deep[0] == least:
            n = (math.copysign(1.0, y[0]), 0.0, 0.0)
        elif deep[1] == least:
            n = (0.0, math.copysign(1.0, y[1]), 0.0)
        else:
            n = (0.0, 0.0, math.copysign(1.0, y[2]))
        return -least - radius, n, (0.0, Z3, 0.0)
    n = scale(1.0 / rho, z)
    free = (1.0 if z[0] == 0.0 else 0.0, 1.0 if z[1] == 0.0 else 0.0, 1.0 if z[2] == 0.0 else 0.0)
    count = free[0] + free[1] + free[2]
    if count == 2.0:
        return rho - radius, n, (0.0, Z3, 0.0)
    return rho - radius, n, (1.0 / rho, free, 0.0)  # of a corner `free` is zero, of an edge its direction


@inner
def ring_section(radius, p, q):
    """d of a circle about the origin at q along the axis and p away from it, parts of n along both (q, p), and h."""
    rho = math.sqrt(p * p + q * q)
    if not rho > 1e-12 * radius:
        return -radius, 0.0, 1.0, 0.0
    return rho - radius, q / rho, p / rho, 1.0 / rho


@inner
def sheave_section(ring, groove, rim, s, q):
    """The same of a sheave: groove of circular section about (ring, 0), rims of circular section on both sides of it.

    Its sides are plane.  groove, rim: radii less and more that of the strand, m.
    """
    side = math.copysign(groove + rim, q)  # where the middle of a rim is
    if s > ring:
        return ring_section(rim, s - ring, q - side)
    rho = math.sqrt((s - ring) * (s - ring) + q * q)
    beside = abs(q) - groove - 2.0 * rim
    if beside > groove - rho:
        return beside, math.copysign(1.0, q), 0.0, 0.0
    if not rho > 1e-12 * groove:
        return groove, 0.0, 1.0, 0.0
    return groove - rho, -q / rho, (ring - s) / rho, -1.0 / rho


@inner
def bent(curved, n, y):
    """K y of a surface."""
    hollow, a, g = curved
    s, t = dot(n, y), dot(a, y)
    return (
        hollow * (y[0] - s * n[0] - t * a[0]) + g * t * a[0],
        hollow * (y[1] - s * n[1] - t * a[1]) + g * t * a[1],
        hollow * (y[2] - s * n[2] - t * a[2]) + g * t * a[2],
    )


@inner
def gradient_of_normal(curved, n):
    """K of a surface."""
    hollow, a, g = curved
    if hollow == 0.0 and g == 0.0:
        return Z9
    across = mscale(hollow, madd(E9, mscale(-1.0, madd(outer(n, n), outer(a, a)))))
    return madd(across, mscale(g, outer(a, a)))
