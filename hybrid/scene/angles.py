"""Rotations of a record: roll, pitch and yaw as rotation vectors, turns counted on from row to row."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def matrices_of(angles: Array) -> Array:
    """Rotation matrices (n, 3, 3) Rz(yaw) Ry(pitch) Rx(roll) of angles (n, 3) rad: roll, pitch, yaw."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(angles).T, np.sin(angles).T
    rows = [
        [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
        [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
        [-sy, cy * sx, cy * cx],
    ]
    return np.array(rows).transpose(2, 0, 1)


def vectors_of(matrices: Array) -> Array:
    """Rotation vectors (n, 3) rad, of at most half a turn, of rotation matrices (n, 3, 3); by quaternions."""
    m = matrices
    t = np.stack([m[:, 0, 0], m[:, 1, 1], m[:, 2, 2]], axis=1)
    w2 = 1.0 + t.sum(axis=1)  # 4 w^2, 4 x^2, ..
    squares = np.column_stack([w2, 1.0 + 2.0 * t - t.sum(axis=1, keepdims=True)])
    best = squares.argmax(axis=1)
    d = np.stack([m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]], axis=1)  # 4 w (x, y, z)
    xy, xz, yz = m[:, 0, 1] + m[:, 1, 0], m[:, 0, 2] + m[:, 2, 0], m[:, 1, 2] + m[:, 2, 1]
    rows = np.stack(
        [
            np.column_stack([squares[:, 0], d]),
            np.column_stack([d[:, 0], squares[:, 1], xy, xz]),
            np.column_stack([d[:, 1], xy, squares[:, 2], yz]),
            np.column_stack([d[:, 2], xz, yz, squares[:, 3]]),
        ],
        axis=1,
    )
    q = rows[np.arange(len(m)), best]
    q = q / np.linalg.norm(q, axis=1, keepdims=True)
    q = np.where(q[:, :1] < 0.0, -q, q)
    sine = np.linalg.norm(q[:, 1:], axis=1)
    angle = 2.0 * np.arctan2(sine, q[:, 0])
    return np.asarray(q[:, 1:] * np.where(sine > 1e-12, angle / np.where(sine > 1e-12, sine, 1.0), 2.0)[:, None])


def continuous(vectors: Array) -> Array:
    """Rotation vectors (n, 3) rad of the same rotations, each the nearest to the one before: turns are counted."""
    out = vectors.copy()
    for i in range(1, len(out)):
        size, before = float(np.linalg.norm(out[i])), out[i - 1]
        if size < 1e-9:  # a number of turns about the axis of the row before
            length = float(np.linalg.norm(before))
            whole = 2.0 * np.pi * round(length / (2.0 * np.pi))
            out[i] += before * (whole / length) if whole > 0.0 else 0.0
            continue
        axis = out[i] / size
        out[i] = axis * (size + 2.0 * np.pi * round((float(axis @ before) - size) / (2.0 * np.pi)))
    return out
