"""A soft seabed and soft obstacles, in which a line begins that finds its way to the real ones."""

from __future__ import annotations

from hybrid.kernels.laws.obstacles import KIND, ONSET_OF, RADIUS, ROUND, STIFFNESS
from hybrid.kernels.state.state import Floats, Sea

# Of its radius: how deep a line may lie in a round obstacle where a continuation begins.
SOFT = 0.5


def softened(sea: Sea, part: float) -> Sea:
    """The sea with this part of the stiffness of its bed and of its obstacles, which are pressed on as much deeper."""
    rows = sea.obstacles.copy()
    rows[:, STIFFNESS] *= part
    rows[:, ONSET_OF] /= part
    return sea._replace(stiffness=sea.stiffness * part, onset=sea.onset / part, obstacles=rows)


def softest_obstacles(rows: Floats, deep: float) -> float:
    """The part of the stiffness of obstacles (M, OBSTACLE) at which lines lie deep in them; deep: in planes, m."""
    if not len(rows):
        return 1.0
    depth = [SOFT * row[RADIUS] if row[KIND] == ROUND else deep for row in rows]
    return min(1.0, *(float(row[ONSET_OF]) / x for row, x in zip(rows, depth, strict=True)))
