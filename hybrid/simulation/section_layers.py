"""Changes of bending stiffness along a line, beside which the softer side bends within less than a cell can show.

    symbol   meaning                                                             unit
    EI       bending stiffness of the section on either side                     N m2
    lambda   sqrt(EI/T), over which bending fades on a side                      m
    kappa0   curvature of the line away from the change                          1/m

The moment is the same on both sides.  Where a taut line would bend evenly by kappa0 it is
kappa0 (EI_1 lambda_2 + EI_2 lambda_1)/(lambda_1 + lambda_2): of a beam under tension, M'' = T (M/EI - kappa0) on either
side, with M and M' continuous.  So the softer side bends by up to sqrt(EI_2/EI_1) times as much as the line beside it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybrid.kernels.state.state import Floats
from hybrid.model.build import Model
from hybrid.outputs.observation import Observation

# Cells of a rod that are longer than this many lambda do not show the bend.
LONG = 1.5
# The event is written where the curvature is more than this times the one that is shown.
MORE = 1.5
# rad: bends by less than this are what Newton's tolerance leaves.
ASKEW = 1e-5
# Part of the largest curvature along the line below which the bend decides nothing.
SMALL = 0.2


class SectionLayer(NamedTuple):
    """A bend at a change of section that is not shown."""

    output: int  # of the batch
    node: int
    stiffness: tuple[float, float]  # N m2, before and after it
    shown: float  # 1/m, at the softer side
    true: float  # 1/m, there, of a rod
    length: float  # m, over which it fades there


def hidden_layer(model: Model, seen: Observation) -> SectionLayer | None:
    """The first output, and change of section, whose bend is not shown; None: there is none."""
    line, cable = seen.line, model.cable
    for node in seen.changes:
        if not 1 < node < line.h.size - 1:
            continue
        s, near = line.s[node], 1e-6 * model.length
        EI = cable.B[cable.piece(np.array([s - near, s + near])), :2].min(axis=1)
        if not (EI.min() > 0.0 and EI.max() > MORE * EI.min()):
            continue
        found = _hidden_at(model, seen, node, EI)
        if found is not None:
            return found
    return None


def _hidden_at(model: Model, seen: Observation, node: int, EI: Floats) -> SectionLayer | None:
    """The same of one change of section, between the stiffnesses EI (2,) N m2."""
    line, after = seen.line, int(EI[1] < EI[0])  # whether the softer side is behind it
    d, length = seen.d, model.length
    T = np.maximum(np.minimum(seen.T[node - 1], seen.T[node]), 1e-300)
    fades = np.sqrt(EI[:, None] / T)
    true_moment = (EI[0] * fades[1] + EI[1] * fades[0]) / (fades[0] + fades[1])  # for kappa0 = 1/m
    beside = node + (2 if after else -2)
    beside = beside if 0 < beside < line.h.size else node + (1 if after else -1)
    kappa = np.linalg.norm(d[1:] - d[:-1], axis=1) / line.hn[1:-1, None]  # of the nodes inside
    true = kappa[beside - 1] * true_moment / EI.min()
    side = int(np.flatnonzero(seen.grid.side_nodes == node)[-1 if after else 0])
    shown = seen.curvature_on_sides[side]
    cell = node if after else node - 1
    may_show = line.spin[cell] == 1
    hidden = (true > MORE * shown) & (true * fades.min(axis=0) > ASKEW) & (true > SMALL * kappa.max(axis=0))
    hidden &= (seen.T[node] > 0.0) & (fades.min(axis=0) < 0.1 * length)
    if may_show:
        hidden &= line.h[cell] > LONG * fades.min(axis=0)
    at = np.flatnonzero(hidden)
    if not at.size:
        return None
    k = int(at[0])
    return SectionLayer(
        k, node, (float(EI[0]), float(EI[1])), float(shown[k]), float(true[k]), float(fades[:, k].min())
    )


def layer_text(layer: SectionLayer, s: float, rod: bool) -> str:
    """Text of the event; s: m, of the change; rod: whether the softer side is a rod."""
    before, after = layer.stiffness
    shown = f"{layer.shown:.3g} 1/m is shown" if layer.shown > 1e-3 * layer.true else "none is shown"
    why = "in less than a cell" if rod else "and a catenary has no bending"
    return (
        f"bending stiffness changes from {before:.3g} to {after:.3g} N m2 at s = {s:g} m: a rod bends by about "
        f"{layer.true:.3g} 1/m at the softer side, over {layer.length:.2g} m, {why}: {shown}, and error figures of "
        "curvature and moment do not hold there; accuracy: {curvature: 5%} makes cells short enough, with model: rod"
    )
