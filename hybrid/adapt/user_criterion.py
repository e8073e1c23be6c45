"""A criterion of the user: a Python function that says where the cable must be a rod."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from hybrid.kernels.state.state import Floats

FORCED_RATIO = 2.0  # ratio of cells that the scene, or a mask of the user, forces to be rod


class NodeState(NamedTuple):
    """What a user criterion receives; the arrays are read-only.

    t: s; s: (N+1,) m; position, velocity: (N+1, 3) m, m/s; tension: (N,) N, of cells; curvature: (N+1,) 1/m;
    bending_stiffness: (N+1,) N m2; line: its name among several, empty of one cable.
    """

    t: float
    s: Floats
    position: Floats
    velocity: Floats
    tension: Floats
    curvature: Floats
    bending_stiffness: Floats
    line: str = ""


# (N+1,) above 1: rod around the node; below 0.5: catenary again.
UserCriterion = Callable[[NodeState], Floats]


def of_line(criterion: UserCriterion | None, name: str) -> UserCriterion | None:
    """The criterion for a line of several, which sees its name."""
    return None if criterion is None else lambda nodes: criterion(nodes._replace(line=name))


def cell_ratios(criterion: UserCriterion, nodes: NodeState) -> Floats:
    """Ratios (N,) of cells, the larger of their nodes; ValueError: the criterion gave another shape, or no number."""
    arrays = [x for x in nodes if isinstance(x, np.ndarray)]
    for x in arrays:
        x.flags.writeable = False
    try:
        ratio = np.asarray(criterion(nodes), float)
    finally:
        for x in arrays:
            x.flags.writeable = True
    if ratio.shape != nodes.s.shape:
        raise ValueError(
            f"the criterion gave an array of shape {ratio.shape}, expected one number per node, {nodes.s.shape}"
        )
    if not np.isfinite(ratio).all():
        i = int(np.flatnonzero(~np.isfinite(ratio))[0])
        raise ValueError(
            f"the criterion gave {ratio[i]} at t = {nodes.t:.6g} s, s = {nodes.s[i]:.6g} m, expected a number"
        )
    cells = np.maximum(ratio[:-1], ratio[1:])
    cells[cells == 1.0] = FORCED_RATIO  # a mask
    return cells
