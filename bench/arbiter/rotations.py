"""Rotations, in batches (..., 3) and (..., 3, 3): only what the arbiter needs, shared with nobody.

A frame R has the body axes a_1, a_2, a_3 as columns (inertial components); a_3 is the
tangent of the rod.  A small turn is written on the right, R exp(hat(d)), with d (rad) in
body axes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SMALL = 1.0e-4  # rad; below it the series are used: their first neglected term is SMALL^4/1000 < eps


def hat(a: Array) -> Array:
    """Skew matrix (..., 3, 3) with hat(a) b = a x b."""
    m = np.zeros((*a.shape, 3))
    m[..., 0, 1], m[..., 0, 2], m[..., 1, 2] = -a[..., 2], a[..., 1], -a[..., 0]
    m[..., 1, 0], m[..., 2, 0], m[..., 2, 1] = a[..., 2], -a[..., 1], a[..., 0]
    return m


def _angle(a: Array) -> tuple[Array, Array, Array]:
    """Angle (..., 1, 1), the angle with zero replaced by one, and where the series are needed."""
    x = np.linalg.norm(a, axis=-1)[..., None, None]
    small = x < SMALL
    return x, np.where(small, 1.0, x), small


def exp(a: Array) -> Array:
    """Rotation matrix of the rotation vector a (Rodrigues)."""
    x, y, small = _angle(a)
    h = hat(a)
    s = np.where(small, 1.0 - x**2 / 6.0, np.sin(y) / y)
    c = np.where(small, 0.5 - x**2 / 24.0, (1.0 - np.cos(y)) / y**2)
    return np.eye(3) + s * h + c * h @ h


def log(R: Array) -> Array:
    """Rotation vector (rad, below pi) of the rotation matrix R."""
    w = 0.5 * np.stack([R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], -1)
    sin = np.linalg.norm(w, axis=-1)
    cos = 0.5 * (np.trace(R, axis1=-2, axis2=-1) - 1.0)
    angle = np.arctan2(sin, cos)
    small = (sin < SMALL) & (cos > 0.0)
    factor = np.where(small, 1.0 + sin**2 / 6.0, angle / np.where(small, 1.0, sin))
    return factor[..., None] * w


def right(a: Array) -> Array:
    """J with exp(a + d) = exp(a) exp(J d), to first order in d."""
    x, y, small = _angle(a)
    h = hat(a)
    c = np.where(small, 0.5 - x**2 / 24.0, (1.0 - np.cos(y)) / y**2)
    s = np.where(small, 1.0 / 6.0 - x**2 / 120.0, (y - np.sin(y)) / y**3)
    return np.eye(3) - c * h + s * h @ h


def right_inverse(a: Array) -> Array:
    """J with log(exp(a) exp(d)) = a + J d, to first order in d."""
    x, y, small = _angle(a)
    h = hat(a)
    c = np.where(small, 1.0 / 12.0 + x**2 / 720.0, 1.0 / y**2 - 0.5 / (y * np.tan(0.5 * y)))
    return np.eye(3) + 0.5 * h + c * h @ h


def turn(a: Array, b: Array) -> Array:
    """The smallest rotation (3, 3) that takes the unit vector a to the unit vector b."""
    axis, cos = np.cross(a, b), float(a @ b)
    if cos < -1.0 + 1.0e-12:  # half a turn: any axis normal to a will do
        axis = np.cross(a, np.eye(3)[int(np.argmin(np.abs(a)))])
        axis /= np.linalg.norm(axis)
        return 2.0 * np.outer(axis, axis) - np.eye(3)
    h = hat(axis)
    return np.eye(3) + h + h @ h / (1.0 + cos)


def frame(tangent: Array, normal: Array | None = None) -> Array:
    """Frame (3, 3) with a_3 along the tangent and a_1 along the part of `normal` square to it.

    Without a normal a_1 is as near as can be to the inertial axis least aligned with the tangent.
    """
    t = np.asarray(tangent, float) / np.linalg.norm(tangent)
    guide = np.eye(3)[int(np.argmin(np.abs(t)))] if normal is None else np.asarray(normal, float)
    a1 = guide - (guide @ t) * t
    a1 = a1 / np.linalg.norm(a1)
    return np.column_stack([a1, np.cross(t, a1), t])


def transported(tangents: Array, first: Array) -> Array:
    """Frames (n, 3, 3) along the unit tangents (n, 3), turned without twist from the frame `first` on."""
    frames = np.empty((len(tangents), 3, 3))
    frames[0] = turn(first[:, 2], tangents[0]) @ first
    for i in range(1, len(tangents)):
        frames[i] = turn(tangents[i - 1], tangents[i]) @ frames[i - 1]
    return frames
