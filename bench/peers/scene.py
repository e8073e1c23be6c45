"""The scene: a mooring line with touchdown, its fairlead heaving in still water.  SI units."""

from __future__ import annotations

import math

DEPTH = 100.0
LENGTH = 250.0
MASS = 20.0
DIAMETER = 0.05
EA = 2e8
ANCHOR = (0.0, 0.0, -100.0)
FAIRLEAD = (205.0, 0.0, 0.0)

DENSITY = 1025.0
GRAVITY = 9.81
DRAG_NORMAL = 1.2
"""On the diameter."""
DRAG_TANGENTIAL = 0.05
"""On the circumference, pi times the diameter."""
ADDED_NORMAL = 1.0
"""On the displaced mass; there is no tangential added mass."""

SEABED_STIFFNESS = 5e3
"""N/m per metre of line."""
SEABED_DAMPING = 5e2
"""N s/m per metre of line."""

DURATION = 100.0
PERIOD = 8.0
AMPLITUDE = 2.0
RAMP = 16.0


def heave(t: float) -> tuple[float, float, float]:
    """Height above the mean, m, its rate and its acceleration: a sine with a half-cosine ramp over two periods."""
    w, p = 2 * math.pi / PERIOD, math.pi / RAMP
    ramp, rate, bend = 1.0, 0.0, 0.0
    if t < RAMP:
        ramp, rate, bend = 0.5 * (1 - math.cos(p * t)), 0.5 * p * math.sin(p * t), 0.5 * p * p * math.cos(p * t)
    s, c = math.sin(w * t), math.cos(w * t)
    return (
        AMPLITUDE * ramp * s,
        AMPLITUDE * (rate * s + ramp * w * c),
        AMPLITUDE * (bend * s + 2 * rate * w * c - ramp * w * w * s),
    )
