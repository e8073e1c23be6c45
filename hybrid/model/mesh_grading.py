"""Where cells should be short: a density of cells along the cable, from how it bent in an earlier run.

Cells follow the angle they turn through (a chord that turns by theta misses its arc by theta/8 of its length), rods
also the length over which bending fades; neighbours differ by little, so that waves pass without an echo.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from hybrid.kernels.state.state import Floats

TURN = 0.1  # rad that a cell turns through, at fineness 1
FEWEST = 12.0  # cells of a straight cable, at fineness 1
# Cells to a length sqrt(EI/T) beside what disturbs a rod, and over how many such lengths: bending fades as exp(-x).
LAYER, LAYER_WIDTH = 3.0, 2.0
GROWTH = 0.25  # of the length of cells per length of cable: neighbours differ by about a quarter
# Cells at a place to those in the fade length next to it, by that exponential.
AT_PLACE = 1.0 / (LAYER_WIDTH * (1.0 - np.exp(-1.0 / LAYER_WIDTH)))
SAMPLES = 2000  # places at which the density is known
LEAST_PIECE = 2  # cells of a stretch between two places where a node must lie


@dataclass(frozen=True)
class Grading:
    """Cells per length (K,) 1/m at places s (K,) m, at fineness 1."""

    s: Floats
    density: Floats

    def count(self, a: float, b: float, fineness: float) -> int:
        """Cells of the stretch [a, b]."""
        return max(LEAST_PIECE, round(fineness * float(np.diff(self._number(np.array([a, b])))[0])))

    def cell(self, s: Floats) -> Floats:
        """Length of cells, m, at s (K,) m, at fineness 1."""
        return np.asarray(1.0 / np.interp(s, self.s, self.density))

    def nodes(self, cuts: Sequence[float], fineness: float) -> Floats:
        """Nodes (N+1,) m; one at every cut, the ends of the cable among them."""
        out = [np.array(cuts[:1])]
        for a, b in pairwise(cuts):
            n = self.count(a, b, fineness)
            x = np.linspace(a, b, max(SAMPLES // 4, 8 * n))
            if self.s.size > SAMPLES:  # it has places of its own, where density changes within less
                x = np.union1d(x, self.s[(self.s > a) & (self.s < b)])
            number = self._number(x)
            at = np.interp(np.linspace(number[0], number[-1], n + 1)[1:-1], number, x)
            out += [at, np.array([b])]
        return np.concatenate(out)

    def _number(self, x: Floats) -> Floats:
        """Cells between the start and x."""
        whole = np.concatenate([[0.0], np.cumsum(0.5 * (self.density[1:] + self.density[:-1]) * np.diff(self.s))])
        return np.asarray(np.interp(x, self.s, whole))


def layers(x: Floats, s: Floats, fade: Floats, disturbed: Sequence[float], cells: float = LAYER) -> Floats:
    """Cells per length (M,) 1/m at x (M,) m beside what disturbs a rod, so many at the place itself to a fade length.

    fade: (K,) m at s (K,) m, sqrt(EI/T) where the cable is a rod, zero where it is not; disturbed: m, clamps, joints
    and point loads, beside which a rod bends within that length.
    """
    out = np.zeros(x.size)
    for place in disturbed:
        width = float(np.interp(place, s, fade))
        if width > 0.0:
            out += cells / width * np.exp(-np.abs(x - place) / (LAYER_WIDTH * width))
    return out


def grading(s: Floats, curvature: Floats, beside: Floats, length: float) -> Grading:
    """The density for a curvature (K,) 1/m found at s (K,) m.

    beside: (SAMPLES,) 1/m, further cells at places that are evenly spread over the length.
    """
    x = np.linspace(0.0, length, SAMPLES)
    density = np.interp(x, s, curvature) / TURN + FEWEST / length + beside
    # at most as long as any other cell, and by how much cells may grow on the way from there
    grown = GROWTH * x
    cell = np.minimum.accumulate(1.0 / density - grown) + grown
    cell = np.minimum.accumulate((cell + grown)[::-1])[::-1] - grown
    return Grading(x, 1.0 / cell)
