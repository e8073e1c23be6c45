"""The line and what criteria know of it for other cells on the same base cells: as hybrid.model.line has it.

Sections, modules and points begin and end at base nodes, so a base cell has one of everything per length.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.compile import inner, kernel
from hybrid.kernels.element import put_spring
from hybrid.kernels.references import reader
from hybrid.kernels.state import Floats, Line, blank_line
from hybrid.kernels.zone_criteria import LOAD, SMOOTH, STEP, NodeKinds, blank_kinds

# Rows of `points`: what a body has; then its lift (N) and the cable that presses on the seabed as much (m).
(
    POINT_MASS, POINT_DRAG, POINT_ADDED, POINT_BUOY, POINT_DISPLACED, POINT_HEIGHT, POINT_UPRIGHT, POINT_FLOATS, LIFT,
    FOOTING,
) = range(10)  # fmt: skip


class Cable(NamedTuple):
    """A material on n base cells: per length as hybrid.model.material has it; points at the n+1 base nodes."""

    mass: Floats
    weight: Floats
    ck: Floats
    damp: Floats
    tau: Floats
    drag_n: Floats
    drag_t: Floats
    added_n: Floats
    added_t: Floats
    buoy: Floats
    displaced: Floats
    diameter: Floats
    polar: Floats  # kg m; not a number: rods have none
    B: Floats  # (n, 3)
    kappa: Floats  # (n, 3)
    EI: Floats  # N m2, mean of both axes
    w: Floats  # N/m, weight in water
    points: Floats  # (10, n+1)
    blank: Floats  # (10,) of nodes without a point
    load: NDArray[np.int8]  # (n+1,) 1 where there is one
    turns: NDArray[np.int8]  # (n+1,) 1 where there is a swivel
    held: NDArray[np.int8]  # (2, 2) whether an element sits at the ends of a rod, and resists twist
    springs: Floats  # (2,) N m/rad, angular springs between held tangents and a rod; infinite: rigid


def blank_cable(n: int) -> Cable:
    """A cable of nothing on n base cells."""
    z = np.zeros
    other: dict[str, Any] = {
        "B": z((n, 3)), "kappa": z((n, 3)), "points": z((10, n + 1)), "blank": z(10), "load": z(n + 1, np.int8),
        "turns": z(n + 1, np.int8), "held": z((2, 2), np.int8), "springs": np.full(2, np.inf),
    }  # fmt: skip
    return Cable(**{name: z(n) for name in Cable._fields} | other)


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
def fill_cells(cable, s, of, rod, line):
    """What cells have, and half of it to each of their nodes."""
    for i in range(line.s.shape[0]):
        line.s[i] = s[i]
        line.mass[i], line.damp[i], line.hn[i] = 0.0, 0.0, 0.0
        line.force[i, 0], line.force[i, 1], line.force[i, 2] = 0.0, 0.0, 0.0
    for c in range(line.h.shape[0]):
        j, h = of[c], s[c + 1] - s[c]
        half = 0.5 * h
        line.h[c], line.ck[c], line.tau[c], line.diameter[c] = h, cable.ck[j], cable.tau[j], cable.diameter[j]
        line.spin[c], line.rotary[c], line.polar[c] = rod[c], 0.0 * cable.polar[j], h * rod[c] * cable.polar[j]
        line.drag_n[c], line.drag_t[c] = half * cable.drag_n[j], half * cable.drag_t[j]
        line.added_n[c], line.added_t[c] = half * cable.added_n[j], half * cable.added_t[j]
        line.buoy[c], line.displaced[c] = half * cable.buoy[j], half * cable.displaced[j]
        for i in (c, c + 1):
            line.mass[i] += 0.5 * (h * cable.mass[j])
            line.damp[i] += 0.5 * (h * cable.damp[j])
            line.force[i, 2] -= 0.5 * (h * cable.weight[j])
            line.hn[i] += half


@inner
def point(cable, row, j):
    """What is at base node j; -1: between base nodes."""
    return cable.points[row, j] if j >= 0 else cable.blank[row]


@inner
def fill_points(cable, of, line):
    """What bodies at base nodes add."""
    n = line.h.shape[0]
    for i in range(n + 1):
        j = of[min(i, n - 1)] if i == 0 or i == n or of[i] != of[i - 1] else -1
        if i == n:
            j += 1
        line.point_mass[i] = point(cable, POINT_MASS, j)
        line.mass[i] += line.point_mass[i]
        line.point_lift[i], line.point_floats[i] = point(cable, LIFT, j), point(cable, POINT_FLOATS, j)
        line.force[i, 2] += line.point_lift[i]
        line.point_drag[i], line.point_added[i] = point(cable, POINT_DRAG, j), point(cable, POINT_ADDED, j)
        line.point_buoy[i], line.point_displaced[i] = point(cable, POINT_BUOY, j), point(cable, POINT_DISPLACED, j)
        line.point_height[i], line.point_upright[i] = point(cable, POINT_HEIGHT, j), point(cable, POINT_UPRIGHT, j)
        line.footing[i] = point(cable, FOOTING, j)


@inner
def fill_elements(cable, of, line):
    """Elements between rod cells, two halves in series, and at ends that hold a rod."""
    n = line.h.shape[0]
    for i in range(n + 1):
        inside = 0 < i < n and line.spin[max(i - 1, 0)] and line.spin[min(i, n - 1)]
        line.element[i] = 1 if inside else 0
        for k in range(3):
            line.kb[i, k], line.k0[i, k] = 0.0, 0.0
            if inside:
                a, b = 0.5 * line.h[i - 1], 0.5 * line.h[i]
                ja, jb = of[i - 1], of[i]
                line.kb[i, k] = 1.0 / (a / cable.B[ja, k] + b / cable.B[jb, k])
                line.k0[i, k] = a * cable.kappa[ja, k] + b * cable.kappa[jb, k]
        if inside and of[i] != of[i - 1] and cable.turns[of[i]]:
            line.kb[i, 2] = 0.0
    for end in range(2):
        node, cell = (n, n - 1) if end else (0, 0)
        if line.spin[cell] and cable.held[end, 0]:
            half, j = 0.5 * line.h[cell], of[cell]
            line.element[node] = 1
            for k in range(3):
                line.kb[node, k], line.k0[node, k] = cable.B[j, k] / half, half * cable.kappa[j, k]
            if cable.springs[end] < np.inf:
                put_spring(cable.springs[end], line, node)
            if not cable.held[end, 1]:
                line.kb[node, 2] = 0.0


@kernel
def fill_line(table):
    """The line of a LineJob."""
    job = read_line(table)
    fill_cells(job.cable, job.nodes, job.base_of_cell, job.rod, job.line)
    fill_points(job.cable, job.base_of_cell, job.line)
    fill_elements(job.cable, job.base_of_cell, job.line)


@kernel
def fill_kinds(table):
    """What the criteria know of the nodes of a KindsJob."""
    job = read_kinds(table)
    cable, of, kinds = job.cable, job.base_of_cell, job.kinds
    n = of.shape[0]
    for i in range(n + 1):
        a, b = of[max(i - 1, 0)], of[min(i, n - 1)]
        kinds.EI[i], kinds.w[i] = max(cable.EI[a], cable.EI[b]), max(cable.w[a], cable.w[b])
        kinds.GJ[i] = min(cable.B[a, 2], cable.B[b, 2])
        bent = max(cable.kappa[a, 0] ** 2 + cable.kappa[a, 1] ** 2, cable.kappa[b, 0] ** 2 + cable.kappa[b, 1] ** 2)
        kinds.bent[i] = bent**0.5
        kinds.node[i] = STEP if cable.EI[a] != cable.EI[b] else SMOOTH
        at_base = i == 0 or i == n or a != b
        if at_base and cable.load[b if i < n else b + 1]:
            kinds.node[i] = LOAD
        kinds.floor[i] = max(job.floor_part * (kinds.EI[i] * kinds.w[i] ** 2) ** (1.0 / 3.0), job.least)
        if i < n:
            kinds.base_of_cell[i] = of[i]
