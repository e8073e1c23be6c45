"""A mesh whose rods come and go: base cells, each either one catenary cell or several rod cells."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from hybrid.kernels.state import Floats
from hybrid.model.mesh import Zone


class Layout(NamedTuple):
    """Base cells and what they are now."""

    base: Floats  # (n+1,) m, nodes that are always there
    parts: np.ndarray  # (n,) rod cells in a base cell
    rod: np.ndarray  # (n,) bool

    @property
    def counts(self) -> np.ndarray:
        """(n,) cells of each base cell now."""
        return np.where(self.rod, self.parts, 1)

    @property
    def first(self) -> np.ndarray:
        """(n+1,) number of the first cell (and node) of each base cell; the last is the number of all."""
        return np.concatenate([[0], np.cumsum(self.counts)])

    @property
    def nodes(self) -> Floats:
        """(N+1,) m."""
        counts, first = self.counts, self.first
        of = np.repeat(np.arange(counts.size), counts)
        inside = (np.arange(of.size) - first[of]) / counts[of]
        s = self.base[of] + inside * (self.base[of + 1] - self.base[of])
        return np.append(s, self.base[-1])

    @property
    def base_of_cell(self) -> np.ndarray:
        """(N,) base cell of every cell."""
        return np.repeat(np.arange(self.rod.size), self.counts)

    @property
    def rod_cells(self) -> np.ndarray:
        """(N,) bool."""
        return np.repeat(self.rod, self.counts)

    @property
    def zones(self) -> tuple[Zone, ...]:
        """Rod and catenary zones in order."""
        return tuple(
            Zone("rod" if self.rod[a] else "catenary", float(self.base[a]), float(self.base[b]))
            for a, b in pairwise(edges(self.rod))
        )


def edges(flags: np.ndarray) -> list[int]:
    """Where runs of equal flags begin, and the end of the last."""
    changes = np.flatnonzero(flags[1:] != flags[:-1]) + 1
    return [0, *changes.tolist(), flags.size]
