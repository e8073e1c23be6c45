"""The recorded motion of an end: its own, or that of a vessel that carries it, in six degrees of freedom.

    symbol   meaning                                                                          unit
    P, R     origin of the vessel and its axes (to the bow, to port, up), inertial            m, -
    R0       its axes at rest, turned by `heading` about the vertical                         -
    f        the end in axes of the vessel, f = R0^T (position - origin)                      m

The end is at P + R f, and what it holds is turned by R R0^T.  Angles: R = Rz(yaw) Ry(pitch) Rx(roll).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hybrid.scene.angles import continuous, vectors_of
from hybrid.scene.end_loads import Triple
from hybrid.scene.motion_file import Record, RecordRefused, read_record
from hybrid.scene.motion_tables import Motion

Array = NDArray[np.float64]


def motion_record(motion: Motion, position: Triple | None, turns: bool = True) -> Record:
    """The record of `motion.file` as motion of an end at `position` (m); turns: whether the end holds a direction.

    RecordRefused: the file cannot be read, or a vessel has no positions or no rotations in it.
    """
    record = read_record(motion.file or "")
    vessel = motion.vessel
    if vessel is None:
        return record
    if record.shift is None or record.rotation is None or record.shift_unit is None or record.rotation_unit is None:
        fix = "add the columns that are missing; zeros where it does not move"
        expected = "columns t,x,y,z and roll,pitch,yaw (or rx,ry,rz), because a vessel carries the end"
        raise RecordRefused(expected, fix, f"{record.name} without {'positions' if record.shift is None else 'turns'}")
    c, s = math.cos(math.radians(vessel.heading)), math.sin(math.radians(vessel.heading))
    at_rest = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    arm = at_rest.T @ (np.array(position or vessel.origin) - np.array(vessel.origin))
    axes = rotations(np.radians(record.rotation))
    shift = record.shift + axes @ arm
    reach = float(np.linalg.norm(arm))
    shift_unit = record.shift_unit + reach * np.radians(record.rotation_unit.max(axis=1, keepdims=True))
    if not turns:
        return replace(record, shift=shift, shift_unit=shift_unit, rotation=None, rotation_unit=None)
    turned = np.degrees(continuous(vectors_of(axes @ at_rest.T)))
    return replace(record, shift=shift, shift_unit=shift_unit, rotation=turned)


def rotations(vectors: Array) -> Array:
    """Rotation matrices (n, 3, 3) of rotation vectors (n, 3) rad."""
    angle = np.sqrt((vectors**2).sum(axis=1))
    near = angle < 1e-4
    safe = np.where(near, 1.0, angle)
    a = np.where(near, 1.0 - angle**2 / 6.0, np.sin(safe) / safe)
    b = np.where(near, 0.5 - angle**2 / 24.0, (1.0 - np.cos(safe)) / safe**2)
    K = np.zeros((len(vectors), 3, 3))
    x, y, z = vectors.T
    K[:, 0, 1], K[:, 0, 2], K[:, 1, 2] = -z, y, -x
    K -= K.transpose(0, 2, 1)
    return np.asarray(np.eye(3) + a[:, None, None] * K + b[:, None, None] * (K @ K))
