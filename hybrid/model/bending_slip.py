"""Layers that slip on each other as a line bends: of the elements of a line on its cells."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.laws.bending_slip import EACH, follow_slip
from hybrid.kernels.laws.element import NO_SPRING
from hybrid.kernels.state.state import Line, blank_line, no_ends, no_work, state_for
from hybrid.model.material import Material, elastic_layer
from hybrid.scene.stretch import Layer, slopes


def with_slip(line: Line, material: Material, of: NDArray[np.int64]) -> Line:
    """The line, whose cells are of pieces `of` (N,) of a material with layers, with these.

    An element between layers of two kinds has one curvature, and of each as much as its half of the length.  So it is
    between a table of moment over curvature and two bending stiffnesses.
    """
    layers = material.layers
    number = [layers.index(x) for x in layers]
    kind = np.array(number)[of]
    rows = []
    for i, has_element in enumerate(line.element):
        sides = [c for c in (i - 1, i) if 0 <= c < line.h.size] if has_element else []
        length = sum(0.5 * line.h[c] for c in sides)
        parts = {kind[c]: sum(0.5 * line.h[k] for k in sides if kind[k] == kind[c]) / length for c in sides}
        rows.append([x * part for k, part in parts.items() for layer in layers[k] for x in layer])
        if len(sides) == 2 and material.meet(*of[sides]):
            part = [0.5 * line.h[c] / line.hn[i] for c in sides]
            line.kb[i, :2] = sum(x * material.B[of[c], :2] for x, c in zip(part, sides, strict=True)) / line.hn[i]
            for x, c in zip(part, sides, strict=True):
                rows[-1] += [x * number for layer in _of_table(material, int(of[c])) for number in layer]
    widths = [EACH, *map(len, rows)]
    for k, spring in enumerate(material.springs):
        if spring < np.inf:  # as many columns when the clamp is let go
            widths.append(sum(map(len, layers[of[-k]])) + EACH)
        if rows[-k] and spring < np.inf:
            rows[-k] += [0.0, give_of(spring, float(material.B[of[-k], :2].max()) / (0.5 * line.h[-k])), 0.0, 0.0]
    law = np.zeros((line.s.size, max(widths)))
    for i, row in enumerate(rows):
        law[i, : len(row)] = row
    found = line._replace(slip_law=law, slip_now=np.zeros_like(law))
    blank = blank_line(1)._replace(slip_law=law[:2].copy(), slip_now=law[:2].copy())
    state = state_for(blank)
    address = follow_slip.address(blank, no_ends(), state, state, no_work(), 0)
    return found._replace(slip_at=np.array([address], np.int64))


def give_of(spring: float, half: float) -> float:
    """How an angular spring (N m/rad) at a clamp turns, rad per N m; half: N m/rad, of half a cell there."""
    return 1.0 / max(spring, NO_SPRING * half)


def _of_table(material: Material, piece: int) -> list[Layer]:
    """Elastic layers that a table of moment over curvature is beside its first piece; none without one."""
    table = (material.bends or {piece: None})[piece]
    if table is None:
        return []
    more = np.diff(slopes(table))
    return [elastic_layer(x, float(K)) for (x, _), K in zip(table[1:-1], more, strict=True) if K != 0.0]
