"""The output grid of a line whose nodes are elsewhere in every output, as those at a winch are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from hybrid.kernels.state.state import Floats
from hybrid.model.mesh import Zone
from hybrid.outputs.output_grid import NO_HINGES, Grid, Rows


class VaryingGrid(Grid):
    """A `Grid` for each of nb outputs, on the same stretches: its matrices multiply the values of each by its own."""

    def __init__(
        self, nodes_s: Floats, zones: Sequence[Zone], s: Floats, loads: Sequence[float] = (),
        changes: Sequence[float] = (), after: bool = False, kept: Sequence[float] = (),
        hinges: Floats = NO_HINGES,
    ) -> None:  # fmt: skip
        """nodes_s: (nb, N+1) m, nodes of every output; s: (nb, ns) m, its points; zones: of the first; the rest as of

        `Grid`.
        """
        super().__init__(nodes_s[0], zones, s[0], loads, changes, after, kept, hinges)
        self._grids = [self.moved(x, at) for x, at in zip(nodes_s, s, strict=True)]

    def _stacked(self, size: int, of: Callable[[Grid], Rows]) -> Rows:
        """One matrix below the other; size: columns of each."""
        parts = [of(grid) for grid in self._grids]
        ends = np.cumsum([0, *(x.columns.size for x in parts)])
        begin = np.concatenate([*(x.begin[:-1] + end for x, end in zip(parts, ends[:-1], strict=True)), ends[-1:]])
        columns = np.concatenate([x.columns + k * size for k, x in enumerate(parts)])
        return Rows(begin, columns, np.concatenate([x.weights for x in parts]), len(parts), size)

    @property
    def points(self) -> Floats:
        return np.stack([grid.s for grid in self._grids], axis=1)

    @cached_property
    def nodes(self) -> Rows:
        return self._stacked(self._x.size, lambda grid: grid.nodes)

    @cached_property
    def cells(self) -> Rows:
        return self._stacked(self._x.size - 1, lambda grid: grid.cells)

    @cached_property
    def chords(self) -> Rows:
        return self._stacked(self._x.size, lambda grid: grid.chords)

    @cached_property
    def held(self) -> Rows:
        return self._stacked(self._x.size + 1, lambda grid: grid.held)

    @cached_property
    def sides(self) -> Rows:
        return self._stacked(len(self.side_nodes), lambda grid: grid.sides)
