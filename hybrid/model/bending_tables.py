"""Tables of moment over curvature: of sections, of what stiffens them, and of the elements of a line on its cells."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.laws.bending_law import (
    ENERGY,
    FIRST_A,
    FIRST_B,
    GIVE,
    HALF_A,
    HALF_B,
    LAST_A,
    LAST_B,
)
from hybrid.kernels.laws.element import NO_SPRING
from hybrid.kernels.state.state import NO_BEND_LAW, NO_TABLE, Floats, Line
from hybrid.model.material import Material
from hybrid.scene.stretch import Curve


def bend_law(material: Material, line: Line, of: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """`bend_law` and `bend_table` of a line whose cells are of pieces `of` (N,) of a material."""
    if material.bends is None:
        return NO_BEND_LAW, NO_TABLE
    known: dict[Curve, int] = {}
    number = np.array([known.setdefault(x, len(known)) for x in _each_piece(material)])[of]
    begins = np.cumsum([0, *map(len, known)])
    n, half = line.h.size, 0.5 * line.h
    law = np.zeros((n + 1, NO_BEND_LAW.shape[1]))
    for cells, first, last, length, nodes in (
        (number, FIRST_A, LAST_A, HALF_A, slice(1, n + 1)), (number, FIRST_B, LAST_B, HALF_B, slice(0, n)),
    ):  # fmt: skip
        law[nodes, first], law[nodes, last], law[nodes, length] = begins[cells], begins[cells + 1], half
    same = np.concatenate([[False], number[1:] == number[:-1], [False]])
    law[same, HALF_A] += law[same, HALF_B]
    law[same, FIRST_B : HALF_B + 1] = 0.0
    plain = np.array([x is None for x in material.bends])[of]
    without = np.concatenate([[True], plain]) & np.concatenate([plain, [True]])
    mixed = np.array([False, *(material.meet(a, b) for a, b in pairwise(of)), False])
    law[without | mixed | (line.element == 0)] = 0.0
    for k, spring in enumerate(material.springs):
        if law[-k, LAST_A] + law[-k, LAST_B] > 0.0 and spring < np.inf:
            stiffness = float(material.B[of[-k], :2].mean()) / half[-k]
            law[-k, GIVE] = 1.0 / max(spring, NO_SPRING * stiffness)
    return law, np.concatenate([_with_energy(x) for x in known])


def _each_piece(material: Material) -> list[Curve]:
    """Tables of all pieces, of one without a table a straight line."""
    assert material.bends is not None
    stiff = material.mean_initial_bending
    return [x or ((0.0, 0.0), (1.0, float(B))) for x, B in zip(material.bends, stiff, strict=True)]


def _with_energy(rows: Curve) -> Floats:
    """Rows of `Line.bend_table`: curvature, moment, energy per length."""
    x, M = np.array(rows, float).T
    out = np.column_stack([x, M, np.zeros(x.size)])
    out[1:, ENERGY] = np.cumsum(0.5 * np.diff(x) * (M[1:] + M[:-1]))
    return out
