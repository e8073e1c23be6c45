"""The line of a material on cells, and what criteria know of it, for any cells on the same base cells.

Sections, modules and points begin and end at base nodes, so a base cell has one of everything per length.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.laws.element import put_spring
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.machine.references import reader
from hybrid.kernels.mesh.fill_line import (
    B_1,
    COLUMNS,
    KAPPA_1,
    OF_POINTS,
    fill_cell,
    fill_element,
    fill_node,
    fill_point,
    no_element,
)
from hybrid.kernels.mesh.zone_criteria import LOAD, SMOOTH, STEP, NodeKinds, blank_kinds
from hybrid.kernels.state.state import Floats, Line, blank_line


class Cable(NamedTuple):
    """A material on n base cells, and points at the n+1 base nodes."""

    made: Floats  # (n, COLUMNS) as of kernels.mesh.fill_line
    EI: Floats  # N m2, mean of both axes
    w: Floats  # N/m, weight in water
    points: Floats  # (P, n+1) of bodies, as OF_POINTS has them
    blank: Floats  # (P,) of nodes without a body
    load: NDArray[np.int8]  # (n+1,) 1 where there is one
    turns: NDArray[np.int8]  # (n+1,) 1 where there is a swivel
    held: NDArray[np.int8]  # (2, 2) whether an element sits at the ends of a rod, and resists twist
    springs: Floats  # (2,) N m/rad, angular springs between held tangents and a rod; infinite: rigid


def blank_cable(n: int) -> Cable:
    """A cable of nothing on n base cells."""
    z, points = np.zeros, len(OF_POINTS)
    return Cable(
        z((n, COLUMNS)), z(n), z(n), z((points, n + 1)), z(points), z(n + 1, np.int8), z(n + 1, np.int8),
        z((2, 2), np.int8), np.full(2, np.inf),
    )  # fmt: skip


class LineJob(NamedTuple):
    """A cable, its cells, and the line of these (written)."""

    cable: Cable
    nodes: Floats  # (N+1,) m
    base_of_cell: NDArray[np.int64]  # (N,)
    rod: NDArray[np.bool_]  # (N,)
    line: Line


class KindsJob(NamedTuple):
    """A cable, its cells, and what criteria know of them (written)."""

    cable: Cable
    base_of_cell: NDArray[np.int64]  # (N,)
    kinds: NodeKinds
    floor_part: float  # of (EI w^2)^(1/3) that a tension must have
    least: float  # N, that it must have whatever the cable


def blank_line_job() -> LineJob:
    return LineJob(blank_cable(1), np.zeros(2), np.zeros(1, np.int64), np.zeros(1, bool), blank_line(1))


def blank_kinds_job() -> KindsJob:
    return KindsJob(blank_cable(1), np.zeros(1, np.int64), blank_kinds(1, 1), 0.0, 0.0)


read_line, read_kinds = reader(blank_line_job()), reader(blank_kinds_job())


@inner
def base_node(of, i):
    """The base node that node i is; -1: it lies between two."""
    n = of.shape[0]
    if i == n:
        return of[n - 1] + 1
    return of[i] if i == 0 or of[i] != of[i - 1] else -1


@kernel
def fill_line(table):
    """The line of a LineJob."""
    job = read_line(table)
    cable, of, line, s, rod = job.cable, job.base_of_cell, job.line, job.nodes, job.rod
    made, n = cable.made, job.line.h.shape[0]
    for c in range(n):
        line.h[c], line.spin[c] = s[c + 1] - s[c], rod[c]
        fill_cell(line, c, made, of[c], line.h[c])
    for i in range(n + 1):
        b, e, j = max(i - 1, 0), min(i, n - 1), base_node(of, i)
        hb = line.h[b] if i > 0 else 0.0
        he = line.h[e] if i < n else 0.0
        line.s[i] = s[i]
        fill_point(line, i, cable.points, j, cable.blank)
        fill_node(line, i, made, of[b], hb, of[e], he)
        no_element(line, i)
        inside = 0 < i < n
        end = 1 if i == n else 0
        line.element[i] = line.spin[b] and line.spin[e] and (inside or cable.held[end, 0])
        if line.element[i]:
            turns = (j >= 0 and cable.turns[j]) if inside else not cable.held[end, 1]
            fill_element(line, i, made, of[b], hb, of[e], he, turns)
            if not inside and cable.springs[end] < np.inf:
                put_spring(cable.springs[end], line, i)


@kernel
def fill_kinds(table):
    """What the criteria know of the nodes of a KindsJob."""
    job = read_kinds(table)
    cable, of, kinds, made = job.cable, job.base_of_cell, job.kinds, job.cable.made
    n, X, Y = of.shape[0], KAPPA_1, KAPPA_1 + 1
    for i in range(n + 1):
        a, b = of[max(i - 1, 0)], of[min(i, n - 1)]
        kinds.EI[i], kinds.w[i] = max(cable.EI[a], cable.EI[b]), max(cable.w[a], cable.w[b])
        kinds.GJ[i] = min(made[a, B_1 + 2], made[b, B_1 + 2])
        bent = max(made[a, X] ** 2 + made[a, Y] ** 2, made[b, X] ** 2 + made[b, Y] ** 2)
        kinds.bent[i] = bent**0.5
        kinds.node[i] = STEP if cable.EI[a] != cable.EI[b] else SMOOTH
        at_base = i == 0 or i == n or a != b
        if at_base and cable.load[b if i < n else b + 1]:
            kinds.node[i] = LOAD
        kinds.floor[i] = max(job.floor_part * (kinds.EI[i] * kinds.w[i] ** 2) ** (1.0 / 3.0), job.least)
        if i < n:
            kinds.base_of_cell[i] = of[i]
