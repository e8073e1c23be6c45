"""Easier seas, in which a line begins that finds its way to the real one: softer, with less current or none."""

from __future__ import annotations

import numpy as np

from hybrid.kernels.laws.obstacles import half_thickness
from hybrid.kernels.laws.soil import PART, depth_under
from hybrid.kernels.state.forces import FLOW, OBSTACLES, SEABED, SOIL
from hybrid.kernels.state.obstacle_rows import ONSET_OF, STIFFNESS
from hybrid.kernels.state.state import Line, Sea
from hybrid.model.sea import ONSET

# How deep a continuation lets a line lie first in the bed, of its length, and in an obstacle, of half of how thick
# it is; in a plane as in the bed.
SOFT_BED, SOFT = 0.05, 0.5


def softened(line: Line, sea: Sea, part: float) -> Sea:
    """The sea with this part of the stiffness of its bed and of its obstacles, which are pressed on as much deeper.

    Soil that remembers becomes linear, as stiff as it is on average under what a line presses with, and comes back with
    the part: where its pressure hardly grows with depth Newton's method does not find how deep a node lies.
    """
    rows = sea.obstacles.copy()
    rows[:, STIFFNESS] *= part
    rows[:, ONSET_OF] /= part
    stiffness, onset, soil = sea.stiffness, sea.onset, sea.soil
    if line.bits & SOIL:
        depth, soil = _depth(line, sea), soil.copy()
        stiffness, onset, soil[PART] = stiffness * onset / (ONSET * depth), ONSET * depth, part
    return sea._replace(stiffness=stiffness * part, onset=onset / part, obstacles=rows, soil=soil)


def _depth(line: Line, sea: Sea) -> float:
    """m, in which soil bears what a line presses on the bed with."""
    return float(depth_under(sea.soil, float(line.bed_width.max()), sea.onset * sea.stiffness / ONSET))


def softest(line: Line, sea: Sea, length: float) -> float:
    """The part of the stiffness of bed and obstacles at which a line of this length (m) lies as deep as it may."""
    soft = 1.0
    if line.bits & SEABED:
        onset = ONSET * _depth(line, sea) if line.bits & SOIL else sea.onset
        soft = onset / (SOFT_BED * length)
    if line.bits & OBSTACLES:
        thick = half_thickness(sea.obstacles)
        deep = np.where(np.isfinite(thick), SOFT * thick, SOFT_BED * length)
        soft = min(soft, float((sea.obstacles[:, ONSET_OF] / deep).min(initial=1.0)))
    return min(1.0, soft)


def with_current(sea: Sea, part: float) -> Sea:
    """The sea with this part of its current."""
    now = sea.now.copy()
    now[1] *= part
    return sea._replace(now=now)


def is_in_current(line: Line, sea: Sea) -> bool:
    """Whether a current acts on a line."""
    return bool(line.bits & FLOW) and sea.now[1] != 0.0 and bool(np.any(sea.current))
