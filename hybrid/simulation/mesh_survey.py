"""The mesh pre-run: a coarse run that shows where the cable bends, and hence where cells should be short."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from hybrid.kernels.state import Floats
from hybrid.model.build import Model
from hybrid.model.mesh_grading import Grading, grading
from hybrid.model.model_costs import Demand
from hybrid.model.resolution import Resolution

# Cells and steps so many times as long as those of the first result; places at which it is looked at.
CELLS, STEPS, POINTS = 2.0, 4.0, 201
# Rod cells in a base cell of zones that move.
MOST_PARTS = 24.0


def survey_resolution(resolution: Resolution) -> Resolution:
    """How finely the pre-run is computed."""
    return resolution.coarser(CELLS, STEPS)


@dataclass(frozen=True)
class Survey:
    """What a pre-run has shown: its model, and what of it cells and kinds follow from."""

    model: Model
    demand: Demand

    @classmethod
    def of(cls, model: Model, s: Floats, run: Mapping[str, np.ndarray]) -> Survey:
        """From curvature and tension (nt, K) of a run at s (K,) m."""
        curvature, tension = run["curvature"], run["tension"]
        low = np.maximum(tension, 1e-9 * model.tension_scale)
        found = curvature.max(axis=0), (curvature / low).max(axis=0), tension.min(axis=0), tension.max(axis=0)
        return cls(model, Demand(s, *found))

    def grading(self) -> Grading:
        """Cells of a line whose zones stay what they are, those of the pre-run."""
        model, demand = self.model, self.demand
        middle = 0.5 * (model.line.s[:-1] + model.line.s[1:])
        rod = np.interp(demand.s, middle, model.line.spin.astype(float)) > 0.5
        low = np.maximum(demand.least, 1e-3 * model.tension_scale)
        material = model.cable
        fade = np.where(rod, np.sqrt(material.weakest_bending[material.piece(demand.s)] / low), 0.0)
        disturbed = [z.s_b for z in model.zones[:-1]] + list(model.attached)
        disturbed += [x for x, held in zip((0.0, model.length), material.held_tangent, strict=True) if held]
        return grading(demand.s, demand.curvature, fade, disturbed, model.length)

    def grading_of_catenary(self) -> Grading:
        """Cells of a line that is catenary everywhere."""
        demand = self.demand
        return grading(demand.s, demand.curvature, np.zeros(demand.s.size), [], self.model.length)

    def grading_of_moving_zones(self, rod_cell: Floats) -> Grading:
        """Base cells of a line whose zones move; rod_cell: (K,) m, length of the cells of its rods."""
        found = self.grading_of_catenary()
        most = MOST_PARTS * np.interp(found.s, self.demand.s, rod_cell)
        return replace(found, density=np.maximum(found.density, 1.0 / most))
