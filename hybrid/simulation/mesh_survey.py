"""The mesh pre-run: a coarse run that shows where the cable bends, and hence where cells should be short."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from hybrid.kernels.state import Floats
from hybrid.model.build import Model
from hybrid.model.mesh_grading import Grading, grading
from hybrid.model.resolution import Resolution

# Cells and steps so many times as long as those of the first result; places at which it is looked at.
CELLS, STEPS, POINTS = 2.0, 4.0, 201
# Rod cells in a base cell of zones that move.
MOST_PARTS = 24.0


def survey_resolution(resolution: Resolution) -> Resolution:
    """How finely the pre-run is computed."""
    return resolution.coarser(CELLS, STEPS)


def survey_grading(model: Model, s: Floats, run: Mapping[str, np.ndarray], rod_cell: Floats | None) -> Grading:
    """Where cells should be short, by a run with curvature and tension (nt, K) at s (K,) m.

    rod_cell: (K,) m, of lines whose zones move: what cells of rods are then, of which a base cell has some.
    """
    curvature = run["curvature"].max(axis=0)
    material = model.cable
    of = material.piece(s)
    fade, disturbed = np.zeros(s.size), []
    if rod_cell is None:
        middle = 0.5 * (model.line.s[:-1] + model.line.s[1:])
        rod = np.interp(s, middle, model.line.spin.astype(float)) > 0.5
        low = np.maximum(run["tension"].min(axis=0), 1e-3 * model.tension_scale)
        fade[rod] = np.sqrt(material.weakest_bending[of] / low)[rod]
        disturbed = [z.s_b for z in model.zones[:-1]] + list(model.attached)
        disturbed += [x for x, held in zip((0.0, model.length), material.held_tangent, strict=True) if held]
    found = grading(s, curvature, fade, disturbed, model.length)
    if rod_cell is None:
        return found
    most = MOST_PARTS * np.interp(found.s, s, rod_cell)
    return replace(found, density=np.maximum(found.density, 1.0 / most))
