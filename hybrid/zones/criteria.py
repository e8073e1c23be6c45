"""Criteria beside those that are compiled: what a scene asks along the line, and a function of the user."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping
from functools import partial, update_wrapper
from typing import Any, NamedTuple

import numpy as np

from hybrid.kernels.mesh.cell_errors import CURVATURE, MOMENT, TENSION
from hybrid.kernels.state.state import Floats
from hybrid.model.resolution import requested_accuracy
from hybrid.scene.analysis import ROUGHEST
from hybrid.scene.schema import LineScene

# Share of what is asked of tension, curvature or moment along the line that leaving bending out may make: as much as
# finer zones are planned to make (accuracy.refinement), so that they are strict enough from the start.
OF_ALONG = 0.25


def shares_asked(scene: LineScene, curvature_error: float | None, bends: float = math.inf) -> dict[int, float]:
    """Parts of the largest tension, curvature and moment along the line that leaving bending out may make.

    bends: of `Resolution`: what limits of bending ask for as well.
    """
    wanted = requested_accuracy(scene)
    parts = (wanted.of_tension, wanted.of_curvature, wanted.of_moment) if wanted is not None else (None,) * 3
    asked = {k: OF_ALONG * part for k, part in zip((TENSION, CURVATURE, MOMENT), parts, strict=True) if part}
    if bends <= ROUGHEST:
        asked[CURVATURE] = min(OF_ALONG * bends, asked.get(CURVATURE, np.inf))
    if curvature_error is not None:
        asked[CURVATURE] = min(curvature_error, asked.get(CURVATURE, np.inf))
    return asked


# A criterion of the user: a Python function that says where the cable must be a rod.

FORCED_RATIO = 2.0  # ratio of cells that the scene, or a mask of the user, forces to be rod


class NodeState(NamedTuple):
    """What a user criterion receives; the arrays are read-only.

    t: s; s: (N+1,) m; position, velocity: (N+1, 3) m, m/s; tension: (N,) N, of cells; curvature: (N+1,) 1/m;
    bending_stiffness: (N+1,) N m2; line: its name, empty in the short form of a scene.
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
    """The criterion for a line, which sees its name."""
    return with_names(criterion, {"": name})


def with_names(criterion: UserCriterion | None, names: Mapping[str, str]) -> UserCriterion | None:
    """The criterion, which sees other names of lines."""
    if criterion is None:
        return None
    asked = criterion

    def of_named(nodes: NodeState) -> Floats:
        return asked(nodes._replace(line=names[nodes.line]))

    return update_wrapper(of_named, asked) if callable(asked) else asked


def cell_ratios(criterion: UserCriterion, nodes: NodeState) -> Floats:
    """Ratios (N,) of cells, the larger of their nodes; ValueError: the criterion gave another shape, or no number."""
    if not callable(criterion):
        raise ValueError(f"criterion: expected a function of a hybrid.NodeState, found {criterion!r:.60}")
    arrays = [x for x in nodes if isinstance(x, np.ndarray)]
    for x in arrays:
        x.flags.writeable = False
    try:
        given = criterion(nodes)
    finally:
        for x in arrays:
            x.flags.writeable = True
    try:
        ratio = np.asarray(given, float)
    except (TypeError, ValueError):
        raise _refused(criterion, nodes, f"{given!r:.60} ({type(given).__name__})") from None
    if ratio.shape != nodes.s.shape:
        kind = f"an array of shape {ratio.shape}" if ratio.shape else f"{given!r:.60} ({type(given).__name__})"
        raise _refused(criterion, nodes, kind)
    if not np.isfinite(ratio).all():
        i = int(np.flatnonzero(~np.isfinite(ratio))[0])
        raise _refused(criterion, nodes, f"{ratio[i]} at s = {nodes.s[i]:.6g} m")
    cells = np.maximum(ratio[:-1], ratio[1:])
    cells[cells == 1.0] = FORCED_RATIO  # a mask
    return cells


def _refused(criterion: UserCriterion, nodes: NodeState, given: str) -> ValueError:
    """What a criterion gave in place of ratios: where it is written, its name, and what is expected."""
    written: Any = inspect.unwrap(criterion)
    while isinstance(written, partial):
        written = written.func
    code = getattr(written, "__code__", None) or getattr(written.__call__, "__code__", None)
    where = f"{code.co_filename}:{code.co_firstlineno}: " if code is not None else ""
    name = getattr(written, "__qualname__", type(written).__qualname__)
    return ValueError(
        f"{where}the criterion {name} returned {given} at t = {nodes.t:.6g} s\n    expected: one number per node, an "
        f"array of shape {nodes.s.shape}: 1 or more where the line must be a rod; or a mask\n"
        "    try:      return such as nodes.position[:, 2] < -20.0"
    )
