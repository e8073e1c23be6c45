"""What the shift of a line by the bending that it leaves out makes of its curvature: beside joints on a bed, above all.

A joint takes the moment of the rod, so that beside it the line goes on about EI/T times the curvature away from where
the rod lies.  A bed of stiffness k, or what else depends on the place, answers with another load across, and curvature
is load over tension.  The moment that is left out knows nothing of that; the chords of the shifted line do, as they
turn from cell to cell.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from hybrid.kernels.state.state import Floats
from hybrid.outputs.observation import Observation
from hybrid.outputs.vectors import cross, dot, size


def by_load(plain: Observation, corrected: Observation) -> Floats:
    """Change of curvature (ns, nb) 1/m from a line as computed to the turns of its chords where bending shifts it to.

    None at ends, at point loads, where a kink is no curvature, and in layers of pins, which lie within a cell.
    """
    d, nodes = corrected.d, plain.grid.side_nodes
    bends = np.zeros((len(d) + 1, plain.columns))
    turns = 2.0 * size(cross(d[:-1], d[1:])) / (1.0 + dot(d[:-1], d[1:]))
    bends[1:-1] = turns / plain.of_line("hn", np.arange(1, len(d)))
    change = np.abs(bends[nodes] - plain.curvature_on_sides)
    change[np.isin(nodes, plain.end_nodes)] = 0.0
    parts, spans = plain.grid.parts, plain.grid.spans
    for (one, (first, last, row)), (two, (_, _, after)) in pairwise(zip(parts, spans, strict=True)):
        if one.kind == two.kind:
            change[[row + last - first, after]] = 0.0
    for layer, _ in plain._taken_at_ends:
        change[layer.rows] = 0.0
    return np.asarray(plain.grid.sides @ change)
