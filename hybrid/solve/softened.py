"""A soft seabed and soft obstacles, in which a line begins that finds its way to the real ones."""

from __future__ import annotations

import numpy as np

from hybrid.kernels.laws.obstacles import half_thickness
from hybrid.kernels.state.forces import OBSTACLES, SEABED
from hybrid.kernels.state.obstacle_rows import ONSET_OF, STIFFNESS
from hybrid.kernels.state.state import Line, Sea

# How deep a continuation lets a line lie first in the bed, of its length, and in an obstacle, of half of how thick
# it is; in a plane as in the bed.
SOFT_BED, SOFT = 0.05, 0.5


def softened(sea: Sea, part: float) -> Sea:
    """The sea with this part of the stiffness of its bed and of its obstacles, which are pressed on as much deeper."""
    rows = sea.obstacles.copy()
    rows[:, STIFFNESS] *= part
    rows[:, ONSET_OF] /= part
    return sea._replace(stiffness=sea.stiffness * part, onset=sea.onset / part, obstacles=rows)


def softest(line: Line, sea: Sea, length: float) -> float:
    """The part of the stiffness of bed and obstacles at which a line of this length (m) lies as deep as it may."""
    soft = sea.onset / (SOFT_BED * length) if line.bits & SEABED else 1.0
    if line.bits & OBSTACLES:
        thick = half_thickness(sea.obstacles)
        deep = np.where(np.isfinite(thick), SOFT * thick, SOFT_BED * length)
        soft = min(soft, float((sea.obstacles[:, ONSET_OF] / deep).min(initial=1.0)))
    return min(1.0, soft)
