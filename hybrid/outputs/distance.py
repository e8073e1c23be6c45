"""Least distances between polylines, exact for their chords."""

from __future__ import annotations

import numpy as np

from hybrid.kernels.state.state import Floats

# Pairs of chords that are looked at one and all; of more only those that can be nearest.
FEW = 4096


def nearest(a: Floats, b: Floats, ra: Floats, rb: Floats) -> tuple[float, int, float]:
    """Least clearance (m) of two polylines of nodes a (n+1, 3) and b (m+1, 3), m, with radii of their chords ra (n,)

    and rb (m,), m: distance less both radii.  Also which chord of a, and which part of it, is nearest.  A single node b
    is a point.
    """
    if len(b) == 1:
        b = np.concatenate([b, b])
    a0, a1, b0, b1 = a[:-1], a[1:], b[:-1], b[1:]
    if len(a0) * len(b0) <= FEW:
        i, j = (x.ravel() for x in np.indices((len(a0), len(b0))))
    else:
        i, j = _candidates(a0, a1, b0, b1, ra, rb)
    distance, part = between(a0[i], a1[i], b0[j], b1[j])
    clear = distance - ra[i] - rb[j]
    k = int(clear.argmin())
    return float(clear[k]), int(i[k]), float(part[k])


def between(a0: Floats, a1: Floats, b0: Floats, b1: Floats) -> tuple[Floats, Floats]:
    """Distances (n,) m of chords a0 a1 and b0 b1, each (n, 3) m, and the part of a where it is nearest."""
    da, db, r = a1 - a0, b1 - b0, a0 - b0
    aa, bb, ab = (np.einsum("ni,ni->n", x, y) for x, y in ((da, da), (db, db), (da, db)))
    ar, br = np.einsum("ni,ni->n", da, r), np.einsum("ni,ni->n", db, r)
    tiny = 1e-300
    area = aa * bb - ab * ab
    s = np.where(area > 1e-12 * aa * bb, np.clip((ab * br - ar * bb) / np.where(area > tiny, area, 1.0), 0.0, 1.0), 0.0)
    t = np.where(bb > tiny, (ab * s + br) / np.where(bb > tiny, bb, 1.0), 0.0)
    held = np.clip(t, 0.0, 1.0)
    along = np.where(aa > tiny, np.clip((ab * held - ar) / np.where(aa > tiny, aa, 1.0), 0.0, 1.0), 0.0)
    s = np.where((t != held) | (bb <= tiny), along, s)
    apart = r + s[:, None] * da - held[:, None] * db
    return np.sqrt(np.einsum("ni,ni->n", apart, apart)), s


def _candidates(
    a0: Floats, a1: Floats, b0: Floats, b1: Floats, ra: Floats, rb: Floats
) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of chords that may be the nearest: the spheres around them are no farther apart than two nodes are."""
    from scipy.spatial import cKDTree

    middle_a, middle_b = 0.5 * (a0 + a1), 0.5 * (b0 + b1)
    half_a, half_b = (0.5 * np.linalg.norm(x - y, axis=1) for x, y in ((a1, a0), (b1, b0)))
    tree = cKDTree(middle_b)
    distance, k = tree.query(middle_a)
    most = float((distance - ra - rb[k]).min())
    found = tree.query_ball_point(middle_a, np.maximum(most + half_a + ra, 0.0) + float((half_b + rb).max()) + 1e-9)
    i = np.repeat(np.arange(len(a0)), [len(x) for x in found])
    j = np.concatenate([np.asarray(x, int) for x in found])
    return i, j
