"""Which outputs of lines with other cells in each the diagnostics have to look at one by one: most of them need not.

Each bound is the one by which `Diagnostics` judges an output, so that none that it would note is missed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.forces import SEABED
from hybrid.kernels.state import Floats
from hybrid.outputs.joined_lines import JoinedObservation


class Bounds(NamedTuple):
    """Beyond which there is something to look at."""

    fold: float  # rad, of a catenary from cell to cell
    sag: float  # m, of a catenary below its chords
    sunk: float  # m, depth in the seabed
    layers: bool  # whether clamps and point loads are watched for bends within less than a cell
    pressed: float  # of EI/L, N m: what a rod carries that may buckle; infinite: that is not watched
    length: float  # m
    attached: tuple[float, ...]  # m, where point loads are


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
    if bounds.layers:
        found |= bool(bounds.attached) | seen.has_element(0) | seen.has_element(1)
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
