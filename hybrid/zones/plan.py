"""The plan: what base cells should be, by the ratios of criteria and what they were (kernels.mesh.zone_plan)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from hybrid.kernels.mesh.zone_plan import OFF, mark_spread, mark_wanted, tidy
from hybrid.kernels.state.state import Floats


class Allowed(NamedTuple):
    """What leaving bending out, and lengths of cells, may make wrong.

    tolerance: m, of position.  curvature_error: part of the largest curvature that the length of cells, which follow
    it, may make it wrong by; None: they stay as they are.  asked: parts of the largest tension, curvature and moment
    (numbers of mesh.cell_errors) that leaving bending out may make, where one is asked.  fineness: cells that follow
    the curvature are so many times as short as that asks for.
    """

    tolerance: float
    curvature_error: float | None = None
    asked: Mapping[int, float] = MappingProxyType({})
    fineness: float = 1.0


class Times(NamedTuple):
    """Times of zones, s.

    hold: how long a rod must have been below its thresholds; ramp: of bending stiffness, None: hold.  edge: for which
    the way of a contact edge is foreseen, None: ramp.  period: the longest of the motion, over some of which its
    largest values count.
    """

    hold: float
    ramp: float | None = None
    edge: float | None = None
    period: float = 0.0


class Reason(NamedTuple):
    """Why base cells a to b (exclusive) change: kind of event, criterion with its value and threshold, and words."""

    a: int
    b: int
    kind: str
    text: str
    criterion: str = ""
    value: float = math.nan
    threshold: float = math.nan


class Change(NamedTuple):
    """A proposal, (n,) of base cells: what they should be, why, and which must be ramped up fast."""

    rod: np.ndarray
    reasons: tuple[Reason, ...]
    urgent: np.ndarray
    stiff: np.ndarray  # rods that get their full stiffness at once
    same: bool = False  # whether cells change and nothing else


def wanted(ratios: Floats, rod: np.ndarray) -> np.ndarray:
    """Base cells (n,) that ask to be, or to stay, a rod: hysteresis between 1 and the criterion's `off`."""
    out = np.empty(rod.size, bool)
    mark_wanted(ratios, OFF, rod, out)
    return out


def spread(asks: np.ndarray, base: Floats, buffer: Floats) -> np.ndarray:
    """Base cells within the buffer of those that ask."""
    out = np.empty(asks.size, bool)
    mark_spread(asks, base, buffer, out)
    return out


def tidied(flags: np.ndarray, rod: np.ndarray, shortest: int) -> np.ndarray:
    """No rod and no gap between rods of less than `shortest` cells: rods widen, into what was rod first; gaps close."""
    out = flags.copy()
    tidy(out, rod, shortest, np.empty_like(out))
    return out
