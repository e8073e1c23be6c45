"""Outputs of a line whose cells are others in each, looked at together: their lines one behind the other.

Between two lines lies a cell without length that belongs to none.  Arrays along all of them have one column; what there
is one of in each output (ends, energies) has the outputs last, as in any `Observation`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.state.state import ALONG_LINE, NODES_OF_LINE, Batch, Floats, Line, Sea
from hybrid.kernels.watch.observed_outputs import Found, observed_joined
from hybrid.model.mesh import Zone
from hybrid.outputs.observation import Observation, links
from hybrid.outputs.observed_states import Grid, Rows, linear

# What a batch has of the nodes and of the cells; the rest is of each output as it is.
NODES_OF_BATCH, CELLS_OF_BATCH = ("r", "v", "vd"), ("e", "T", "a1", "w")
OF_LINE = ("h", "kb")


class Output(NamedTuple):
    """One output with the line that it is of, in arrays of their own."""

    line: Line
    zones: tuple[Zone, ...]
    batch: Batch  # of this output alone


def outputs_in(batch: Batch, line: Line, zones: tuple[Zone, ...]) -> list[Output]:
    """The outputs of a batch of one line, copied."""
    found = []
    arrays: dict[str, Any] = {name: getattr(line, name).copy() for name in ALONG_LINE if name not in OF_LINE}
    for k in range(batch.t.size):
        own: dict[str, Any] = {name: getattr(batch, name)[k].copy() for name in OF_LINE}
        rows: Any = [x[k : k + 1].copy() for x in batch]
        found.append(Output(line._replace(**arrays, **own), zones, Batch(*rows)))
    return found


def _joined(parts: Sequence[Floats], gaps: bool) -> Floats:
    """One behind the other; gaps: with the last row again after each but the last, for a cell that belongs to none."""
    if gaps:
        parts = [x for part in parts for x in (part, part[-1:])][:-1]
    return np.concatenate(parts)


class JoinedGrid(Grid):
    """Grids of several lines, one behind the other."""

    def __init__(self, grids: Sequence[Grid]) -> None:
        first, self.of = grids[0], grids
        self.loads, self.changes, self.after, self._kept = first.loads, first.changes, first.after, first._kept
        self.hinges = grids[0].hinges
        self.begin = np.cumsum([0, *(grid._x.size for grid in grids)])  # nodes before each line
        self.rows = sides = np.cumsum([0, *(len(grid.side_nodes) for grid in grids)])  # likewise sides
        self.parts = tuple(part for grid in grids for part in grid.parts)
        self.spans = []
        for grid, n, o in zip(grids, self.begin.tolist(), sides.tolist(), strict=False):
            self.spans += [(a + n, b + n, c + o) for a, b, c in grid.spans]
        before = np.repeat(self.begin[:-1], np.diff(sides))
        self.side_nodes = np.concatenate([grid.side_nodes for grid in grids]) + before
        self.s, self._x = (np.concatenate([getattr(grid, name) for grid in grids]) for name in ("s", "_x"))
        points = [grid.s.size for grid in grids]
        self._before = np.repeat(self.begin[:-1], points)  # (ns,) of each point: nodes before its line
        self._sides_before, self._lines_before = np.repeat(sides[:-1], points), np.repeat(np.arange(len(grids)), points)
        self._stretch = np.concatenate([grid._stretch for grid in grids])
        self._first = np.concatenate([grid._first for grid in grids]) + self._before
        self._last = np.concatenate([grid._last for grid in grids]) + self._before

    def of_line_of(self, node: int) -> NDArray[np.bool_]:
        return np.asarray(self._before == self.begin[np.searchsorted(self.begin, node, "right") - 1])

    @property
    def in_catenary(self) -> NDArray[np.bool_]:
        return np.concatenate([grid.in_catenary for grid in self.of])

    @cached_property
    def chords(self) -> Rows:
        return linear(self._x, self.s, self._before, np.repeat(self.begin[1:] - 1, [grid.s.size for grid in self.of]))

    @cached_property
    def held(self) -> Rows:
        before = self._before + self._lines_before  # each line before has one column more than nodes
        if any(b - a == 1 for a, b, _ in self.spans):  # where values beside a stretch may count
            at = np.concatenate([grid._held_at for grid in self.of])
            start, end = (np.concatenate(x) for x in zip(*(grid._held_between for grid in self.of), strict=True))
            return linear(at, self.s, start + before, end + before)
        x, first, last, lines = self._x, self.begin[:-1], self.begin[1:] - 1, np.arange(len(self.of))
        at = np.empty(x.size + lines.size)
        middle = 0.5 * (x[:-1] + x[1:])  # those between two lines are overwritten
        at[np.arange(x.size - 1) + np.repeat(lines, np.diff(self.begin))[:-1] + 1] = middle
        at[first + lines], at[last + lines + 1] = x[first], x[last]
        of = self._lines_before
        start = np.where(self.s < middle[first][of], first[of], self._first + 1) + of
        end = np.where(self.s > middle[last - 1][of], last[of] + 1, self._last) + of
        return linear(at, self.s, start, end)

    @cached_property
    def sides(self) -> Rows:
        shift = self._stretch + self._sides_before - self._before
        return linear(self._x, self.s, self._first, self._last, shift)


class JoinedObservation(Observation):
    """Outputs of several lines."""

    def __init__(self, outputs: Sequence[Output], sea: Sea, grid: JoinedGrid) -> None:
        lines, batches = [x.line for x in outputs], [x.batch for x in outputs]
        along: dict[str, Any] = {
            name: _joined([getattr(x, name) for x in lines], name not in NODES_OF_LINE) for name in ALONG_LINE
        }
        along["h"][grid.begin[1:-1] - 1] = 0.0
        nodes = (*NODES_OF_BATCH, "soil") if batches[0].soil.size else NODES_OF_BATCH
        of: dict[str, Any] = {name: _joined([getattr(x, name)[0] for x in batches], False)[None] for name in nodes}
        of |= {name: _joined([getattr(x, name)[0] for x in batches], True)[None] for name in CELLS_OF_BATCH}
        rest = [name for name in Batch._fields if name not in (*of, *OF_LINE, "turn", "touch")]
        heads: dict[str, Any] = {name: np.concatenate([getattr(x, name) for x in batches]) for name in rest}
        super().__init__(lines[0]._replace(**along), sea, grid, Batch(**heads, **of))
        self.outputs, self.begin, self._joined_grid = outputs, grid.begin, grid

    @property
    def columns(self) -> int:
        return 1

    @cached_property
    def changes(self) -> list[int]:
        pairs = zip(self.outputs, self.begin.tolist(), strict=False)
        return [n + int(np.argmin(np.abs(one.line.s - x))) for one, n in pairs for x in self.grid.changes]

    @cached_property
    def link(self) -> Floats:
        return np.concatenate([links(x.batch, x.line) for x in self.outputs], axis=1)

    @cached_property
    def end_nodes(self) -> NDArray[np.int64]:
        return np.concatenate([self.begin[:-1], self.begin[1:] - 1])

    def at_end(self, x: Floats, k: int) -> Floats:
        return np.moveaxis(x[self.begin[1:] - 1 if k else self.begin[:-1], ..., 0], 0, -1)

    def outputs_last(self, x: Floats) -> Floats:
        return x[..., None]

    def by_output(self, x: Floats, dims: Sequence[str]) -> Floats:
        if dims[:1] != ("s",):
            return super().by_output(x, dims)
        return np.ascontiguousarray(x[..., 0]).reshape(self.batch.t.size, -1, *x.shape[1:-1])

    def has_element(self, k: int) -> NDArray[np.bool_]:
        return self.line.element[self.begin[1:] - 1 if k else self.begin[:-1]] == 1

    def _cell_at(self, point: int) -> int:
        k, at = divmod(point, self.grid.s.size // self.batch.t.size)
        s = self.outputs[k].line.s
        return int(self.begin[k] + np.argmin(np.abs(0.5 * (s[:-1] + s[1:]) - self.grid.s[at])))

    @cached_property
    def _observed(self) -> Found:
        return observed_joined(self.line, self.sea, self.batch, self._along, self.begin, self._joined_grid.rows)

    def _between_nodes(self) -> Floats:
        found = self._observed.layers(self.grid.s.reshape(self.batch.t.size, -1))
        return found.reshape(-1, 3, 1)

    @property
    def points(self) -> Floats:
        """(ns,) m, output points of each."""
        return self._joined_grid.of[0].s

    def one(self, k: int) -> Observation:
        """Output k as if it had been looked at alone."""
        found = self.outputs[k]
        return Observation(found.line, self.sea, self._joined_grid.of[k], found.batch)
