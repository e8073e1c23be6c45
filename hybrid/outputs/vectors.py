"""Vectors at many places of many outputs: arrays (n, 3, nb)."""

from __future__ import annotations

import numpy as np

from hybrid.kernels.state.forces import PLANAR
from hybrid.kernels.state.state import Floats, Line

# Of a node where the line is straight.
ANY_DIRECTION = np.array([0.0, 1.0, 0.0])[:, None]


def cross(a: Floats, b: Floats) -> Floats:
    """a x b of vectors (n, 3, nb)."""
    out = np.empty(np.broadcast(a, b).shape)
    out[:, 0] = a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1]
    out[:, 1] = a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2]
    out[:, 2] = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return out


def dot(a: Floats, b: Floats) -> Floats:
    """a . b of vectors (n, 3, nb)."""
    return np.asarray(a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2])


def size(a: Floats) -> Floats:
    """Length of vectors (n, 3, nb)."""
    return np.asarray(np.sqrt(dot(a, a)))


def across(moment: Floats, tangent: Floats) -> Floats:
    """Of moments (n, 3, nb) N m what bends: the part across the tangent."""
    return np.asarray(moment - dot(moment, tangent)[:, None] * tangent)


def directions_of(line: Line, x: Floats) -> Floats:
    """Of vectors (n, 3, outputs), or on which side of the plane of the line they are."""
    if line.bits & PLANAR:
        return np.where(np.einsum("j,njk->nk", line.plane[2], x) < 0.0, -1.0, 1.0)[:, None]
    length = size(x)[:, None]
    return np.where(length > 0.0, x / np.where(length > 0.0, length, 1.0), ANY_DIRECTION)
