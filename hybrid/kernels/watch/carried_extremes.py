"""Extremes where cells change: those of nodes whose cells stay go on, all others are taken into those of the finest mesh.

Nodes are those of arc length s, (N+1,) m, before a change and to_s, (M+1,) m, after it; rods, (N,) and to_rods, (M,)
tell which cells are rod.  Extremes are as in kernels.state.books, (4, rows, N+1+K), of K marked nodes behind all; unknown
ones are infinite, and change nothing.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.state.state import Floats
from hybrid.kernels.watch.extremes import fold_cell


@inner
def match_nodes(s, rods, to_s, to_rods, stays):
    """Into `stays` (N+1,), the number of the new node that each old one becomes whose cells stay as they are; else -1."""
    n, i, before = rods.shape[0], 0, True
    for c in range(n):
        while to_s[i] < s[c]:
            i += 1
        same = to_s[i] == s[c] and to_s[i + 1] == s[c + 1] and to_rods[i] == rods[c]
        stays[c] = i if same and before else -1
        before = same
    stays[n] = to_rods.shape[0] if before else -1


@inner
def first_from(s, x, i):
    """Number of the first of s, which do not decrease, that is x at least, from number i on."""
    last = s.shape[0] - 1
    while i < last:
        middle = (i + last) // 2
        if s[middle] < x:
            i = middle + 1
        else:
            last = middle
    return i


@inner
def fold_node(now, column, i, out):
    """Take a column of extremes `now` into those of place i."""
    for row in range(now.shape[1]):
        if now[0, row, column] < out[0, row, i]:
            out[0, row, i], out[2, row, i] = now[0, row, column], now[2, row, column]
        if now[1, row, column] > out[1, row, i]:
            out[1, row, i], out[3, row, i] = now[1, row, column], now[3, row, column]


@inner
def fold_gone(s, now, right, stays, places, bounds):
    """Take extremes `now` of nodes that do not stay, and of the cells beside them, into `bounds` (4, rows, E) at `places`.

    Cells that stay are interpolated once: when they go, or at the end.
    """
    n, at = s.shape[0] - 1, 0
    for i in range(n + 1):
        gone = stays[i] < 0
        if not gone and (i == n or stays[i + 1] >= 0):
            continue
        at = first_from(places, s[i], at)
        begin = at + (2 if right[i] != i else 1)
        if gone:
            fold_node(now, i, at, bounds)
            if right[i] != i:
                fold_node(now, right[i], at + 1, bounds)
        if i < n:
            end = first_from(places, s[i + 1], begin)
            a, per = right[i], 1.0 / (s[i + 1] - s[i])
            for row in range(now.shape[1]):
                if math.isfinite(now[0, row, a]) and math.isfinite(now[0, row, i + 1]):
                    fold_cell(now, row, (a, i + 1), s[i], per, places, begin, end, bounds)


@inner
def carry_column(old, columns, column, to, out):
    """Extremes of a node that stays, from `old`, all numbers of extremes of so many columns."""
    for bound in range(out.shape[0]):
        for row in range(out.shape[1]):
            out[bound, row, to] = old[(bound * out.shape[1] + row) * columns + column]


@inner
def carry_extremes(stays, cells, old, columns, right, to_cells, out):
    """Extremes of all nodes that stay into `out`; right: columns after the new nodes; cells, to_cells: how many."""
    for i in range(cells + 1):
        k = stays[i]
        if k >= 0:
            carry_column(old, columns, i, k, out)
            if right[k] != k:  # marked ones have a second column behind those of all nodes, in their order
                carry_column(old, columns, cells + right[k] - to_cells, right[k], out)


class Watched(NamedTuple):
    """Nodes with their extremes: s, rods and extremes as above; right: columns of what is after the nodes."""

    s: Floats
    rods: NDArray[np.bool_]
    right: NDArray[np.int64]
    extremes: Floats


@kernel
def pass_on(old, new, stays, places, bounds):
    """All of it, of `Watched` nodes whose arrays do not share memory; stays: (N+1,) room."""
    s, rods, right, now = old
    to_s, to_rods, to_right, out = new
    match_nodes(s, rods, to_s, to_rods, stays)
    fold_gone(s, now, right, stays, places, bounds)
    carry_extremes(stays, rods.shape[0], now.reshape(now.size), now.shape[2], to_right, to_rods.shape[0], out)
