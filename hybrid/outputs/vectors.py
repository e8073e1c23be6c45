"""Vectors at many places of many outputs: arrays (n, 3, nb)."""

from __future__ import annotations

import numpy as np

from hybrid.kernels.state.state import Floats


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
