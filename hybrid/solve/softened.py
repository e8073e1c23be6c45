"""A soft seabed and soft obstacles, in which a line begins that finds its way to the real ones."""

from __future__ import annotations

from hybrid.kernels.state.forces import OBSTACLES, SEABED
from hybrid.kernels.state.obstacle_rows import KIND, ONSET_OF, RADIUS, ROUND, STIFFNESS
from hybrid.kernels.state.state import Line, Sea

# How deep a continuation lets a line lie first in the bed, of its length, and in a round obstacle, of its radius.
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
    for row in sea.obstacles if line.bits & OBSTACLES else ():
        deep = SOFT * row[RADIUS] if row[KIND] == ROUND else SOFT_BED * length
        soft = min(soft, float(row[ONSET_OF]) / deep)
    return min(1.0, soft)
