"""Which outputs of lines with other cells in each the diagnostics have to look at one by one: most of them need not.

Each bound is the one by which `Diagnostics` judges an output, so that none that it would note is missed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.state.forces import SEABED
from hybrid.kernels.state.state import Floats
from hybrid.model.material import Material
from hybrid.outputs.joined_lines import JoinedObservation
from hybrid.simulation.slack_bends import TURNS, too_long_for_weight, turns_by_weight


class Bounds(NamedTuple):
    """Beyond which there is something to look at."""

    fold: float  # rad, of a catenary from cell to cell
    sag: float  # m, of a catenary below its chords
    kink: float  # rad, of a joint of a rod and a catenary beyond the bend beside it
    negative: float  # part of the largest tension by which one between cells may come out below 0
    sunk: float  # m, depth in the seabed
    layers: bool  # whether clamps and point loads are watched for bends within less than a cell
    pressed: float  # of EI/L, N m: what a rod carries that may buckle; infinite: that is not watched
    length: float  # m
    attached: tuple[float, ...]  # m, where point loads are
    cable: Material | None  # of which bends by weight within less than a cell are watched; None: they are not


def kinks_at(joints: NDArray[np.int64], bends: Floats, lengths: Floats) -> Floats:
    """Angles (J, nb), rad, of joints beyond the larger bend on their sides; bends: (N+1, nb) 1/m at nodes, 2 tan(x/2)
    over lengths (N+1,) m for an angle x.
    """
    turn = 2.0 * np.arctan(0.5 * bends[joints] * lengths[joints, None])
    return np.asarray(turn - np.maximum(bends[joints - 1], bends[joints + 1]) * lengths[joints, None])


def doubtful(seen: JoinedObservation, values: Mapping[str, Floats], bounds: Bounds) -> NDArray[np.bool_]:
    """Outputs (nb,) with something beyond a bound."""
    line, begin = seen.line, seen.begin[:-1]
    found = np.zeros(begin.size, bool)
    inside = np.zeros(line.s.size, bool)
    inside[1:-1] = (line.spin[:-1] == 0) & (line.spin[1:] == 0)
    inside[seen.end_nodes] = False
    inside &= ~np.isin(line.s, bounds.attached)
    if inside.any():
        half = np.where(inside, 0.5 * seen.bends[:, 0] * line.hn, 0.0)
        found |= np.maximum.reduceat(half, begin) > np.tan(0.5 * min(bounds.fold, np.pi))
        found |= np.maximum.reduceat(half * line.hn, begin) > 4.0 * bounds.sag
        found |= values["tension"].min(axis=1) < -bounds.negative * np.abs(values["tension"]).max(axis=1)
    joints = np.flatnonzero(line.spin[1:] != line.spin[:-1]) + 1
    joints = joints[~np.isin(joints, seen.end_nodes)]
    joints = joints[~np.isin(line.s[joints], bounds.attached)]
    if joints.size:
        kinked = kinks_at(joints, seen.bends, line.hn)[:, 0] > bounds.kink
        found[np.searchsorted(seen.begin, joints[kinked], side="right") - 1] = True
    if bounds.layers:
        found |= bool(bounds.attached) | seen.has_element(0) | seen.has_element(1)
    if bounds.cable is not None:
        nodes, _, limits = too_long_for_weight(bounds.cable, line)
        if nodes.size:
            bent = turns_by_weight(line, seen, nodes, limits)[:, 0] > TURNS
            found[np.searchsorted(seen.begin, nodes[bent], side="right") - 1] = True
    if line.bits & SEABED:
        found |= np.maximum.reduceat(seen.depth[:, 0], begin) - 0.5 * seen.sea.onset > bounds.sunk
    if np.isfinite(bounds.pressed) and line.spin.any():
        stiff = np.where(line.element == 1, line.kb[:, :2].min(axis=1) * line.hn, np.inf)
        least = bounds.pressed * np.minimum.reduceat(stiff, begin) / bounds.length
        least[np.isinf(least)] = 0.0
        tension = np.where(line.spin == 1, seen.T[:, 0], np.inf)
        tension[seen.begin[1:-1] - 1] = np.inf  # of no line
        found |= np.minimum.reduceat(tension, begin) * bounds.length < -least
        found |= values["energy/torsion"] > least
    return found
