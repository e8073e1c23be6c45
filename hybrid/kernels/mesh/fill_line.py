"""The fields of a line, of what its cells are made of per length; how they are copied and moved.

What a cell is made of is a row: weight, stiffness and curvature of rods, then by FIELDS whatever cells and nodes have
in proportion to length.  A cell that grows at a winch has the means of all that it consists of.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.machine.binding import places
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.machine.references import rows
from hybrid.kernels.state.state import FIELDS, HALF, MEAN, POINT, ROD, SHARED, Field, blank_line

# Columns of a row.
WEIGHT = 0
B_1 = 1  # first of three
KAPPA_1 = 4  # first of three
FIRST = 7
# Fields that follow from one number per length of the same name, column FIRST on; and those of bodies.
PER_LENGTH = tuple(name for name, field in FIELDS.items() if field.rule in (MEAN, HALF, ROD, SHARED))
OF_POINTS = tuple(name for name, field in FIELDS.items() if field.rule == POINT)
COLUMNS = FIRST + len(PER_LENGTH)
COMPLIANCE = FIRST + PER_LENGTH.index("ck")

_at = places(blank_line(1))


def _table(names: Iterable[str]) -> NDArray[np.int64]:
    """Of fields: where in the table of a line; column of a row; rule."""
    found = [(_at[x], FIRST + PER_LENGTH.index(x) if x in PER_LENGTH else -1, FIELDS[x].rule) for x in names]
    return np.array(found, np.int64)


def _numbers(of_node: bool) -> NDArray[np.int64]:
    """Of fields of float64 of nodes, or of cells: where in the table of a line, and columns."""

    def wanted(field: Field) -> bool:
        return field.of_node == of_node and field.kind is np.float64

    return np.array([(_at[x], max(y.columns, 1)) for x, y in FIELDS.items() if wanted(y)], np.int64)


CELLS = _table(x for x in PER_LENGTH if not FIELDS[x].of_node)
NODES = _table(x for x in PER_LENGTH if FIELDS[x].of_node)
POINTS = _table(OF_POINTS)
OF_NODES, OF_CELLS = _numbers(True), _numbers(False)
array = rows(blank_line(1))


@inner
def fill_cell(line, c, made, j, h):
    """What cell c has, of length h, that is made of row j."""
    for k in range(CELLS.shape[0]):
        x, rule = made[j, CELLS[k, 1]], CELLS[k, 2]
        if rule == HALF:
            x = 0.5 * h * x
        elif rule == ROD:
            x = h * line.spin[c] * x
        array(line, CELLS[k, 0], 1)[c, 0] = x


@inner
def fill_node(line, i, made, a, ha, b, hb):
    """What node i has between a cell of length ha, of row a, and one of hb, of row b; 0: there is no cell."""
    for k in range(NODES.shape[0]):
        x = NODES[k, 1]
        array(line, NODES[k, 0], 1)[i, 0] = 0.5 * (ha * made[a, x]) + 0.5 * (hb * made[b, x])
    line.mass[i] += line.point_mass[i]
    line.force[i, 0], line.force[i, 1] = 0.0, 0.0
    line.force[i, 2] = -0.5 * (ha * made[a, WEIGHT]) - 0.5 * (hb * made[b, WEIGHT]) + line.point_lift[i]
    line.hn[i] = 0.5 * ha + 0.5 * hb


@inner
def fill_point(line, i, points, j, blank):
    """The body at node i, of column j of `points`; -1: there is none."""
    for k in range(POINTS.shape[0]):
        array(line, POINTS[k, 0], 1)[i, 0] = points[k, j] if j >= 0 else blank[k]


@inner
def round_and_straight(line, i):
    """The element at node i of a swivel, whose sides have no direction in common: it bends as on average of its axes."""
    line.k0[i, 0], line.k0[i, 1] = 0.0, 0.0
    if line.kb[i, 0] != line.kb[i, 1]:
        bends = 2.0 / (1.0 / line.kb[i, 0] + 1.0 / line.kb[i, 1])
        line.kb[i, 0], line.kb[i, 1] = bends, bends


@inner
def fill_element(line, i, made, a, ha, b, hb, turns):
    """The element at node i, two halves in series; lengths: as of `fill_node`; turns: whether it lets go the twist."""
    one, two = 0.5 * ha, 0.5 * hb
    for k in range(3):
        B, kappa = B_1 + k, KAPPA_1 + k
        if hb == 0.0:
            line.kb[i, k], line.k0[i, k] = made[a, B] / one, one * made[a, kappa]
        elif ha == 0.0:
            line.kb[i, k], line.k0[i, k] = made[b, B] / two, two * made[b, kappa]
        else:
            line.kb[i, k] = 1.0 / (one / made[a, B] + two / made[b, B])
            line.k0[i, k] = one * made[a, kappa] + two * made[b, kappa]
    if turns:
        line.kb[i, 2] = 0.0
        if ha > 0.0 and hb > 0.0:
            round_and_straight(line, i)


@inner
def no_element(line, i):
    """A line without an element at node i."""
    for k in range(3):
        line.kb[i, k], line.k0[i, k] = 0.0, 0.0


@inner
def copy_items(line, i, out, j, fields):
    """Node or cell i of a line as j of another one; fields: OF_NODES or OF_CELLS."""
    for k in range(fields.shape[0]):
        x, y = array(line, fields[k, 0], fields[k, 1]), array(out, fields[k, 0], fields[k, 1])
        if y.shape[0] > 0:  # else it has none of it
            for column in range(y.shape[1]):
                y[j, column] = x[i, column]


@inner
def copy_node(line, i, out, j):
    """Node i of a line as node j of another one."""
    copy_items(line, i, out, j, OF_NODES)
    out.element[j] = line.element[i]


@inner
def copy_cell(line, i, out, j):
    """Cell i of a line as cell j of another one."""
    copy_items(line, i, out, j, OF_CELLS)
    out.spin[j] = line.spin[i]


@inner
def came_from(k, n, m, forward, cut, step):
    """Item k of m, counted from the far end, and the one of n that it comes from: numbers in their lines."""
    j = k if k < cut else max(k - step, 0)
    return (k, j) if forward else (m - 1 - k, n - 1 - j)


@kernel
def move_line(line, out, forward, cut, step):
    """Cells and nodes that stay; those that are new have the values of their neighbours (kernels.reel.payout_nodes.move_row)."""
    n, m = line.h.shape[0], out.h.shape[0]
    for k in range(m + 1):
        to, of = came_from(k, n + 1, m + 1, forward, cut, step)
        copy_node(line, of, out, to)
    for k in range(m):
        to, of = came_from(k, n, m, forward, cut, step)
        copy_cell(line, of, out, to)
