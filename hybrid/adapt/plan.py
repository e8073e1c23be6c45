"""From what the criteria say to zones: a pure function, so that the same past gives the same plan."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from hybrid.adapt.table import CRITERIA
from hybrid.model.layout import edges
from hybrid.model.state import Floats


class Rules(NamedTuple):
    """How zones are made of what is asked.

    buffer: (n,) m, rod on either side of what asks for it; shortest: m, least length of a zone; dwell: s, how
    long a rod must have been calm before it goes.
    """

    buffer: Floats
    shortest: float
    dwell: float


OFF = np.array([x.off for x in CRITERIA])


def wanted(ratios: Floats, rod: np.ndarray) -> np.ndarray:
    """Base cells (n,) that ask to be, or to stay, a rod: hysteresis between 1 and the criterion's `off`."""
    return np.where(rod, (ratios > OFF[:, None]).any(axis=0), (ratios > 1.0).any(axis=0))


def spread(asks: np.ndarray, base: Floats, buffer: Floats) -> np.ndarray:
    """Base cells within the buffer of those that ask."""
    out = asks.copy()
    for j in np.flatnonzero(asks):
        near = (base[:-1] < base[j + 1] + buffer[j]) & (base[1:] > base[j] - buffer[j])
        out |= near
    return out


def planned(
    ratios: Floats, rod: np.ndarray, calm_since: Floats, t: float, base: Floats, rules: Rules
) -> tuple[np.ndarray, Floats]:
    """What the base cells should be, and since when (s) each rod has been calm (infinity: it is not).

    rod: (n,) what they are; calm_since: (n,) from the last review.
    """
    keeps = spread(wanted(ratios, rod), base, rules.buffer)
    grows = spread(wanted(ratios, np.zeros_like(rod)), base, rules.buffer)
    calm = np.where(rod & ~keeps, np.minimum(calm_since, t), np.inf)
    goes = rod & (t - calm >= rules.dwell)
    next_ = (rod & ~goes) | grows
    # short gaps between rods are rod; short rods grow until they are long enough, or until they meet another
    length = np.diff(base)
    for want, least in ((False, rules.shortest), (True, rules.shortest)):
        cuts = edges(next_)
        for a, b in pairwise(cuts):
            if next_[a] != want or length[a:b].sum() >= least:
                continue
            if not want:
                if a > 0 and b < next_.size:
                    next_[a:b] = True
            else:
                _widen(next_, a, b, length, least)
    return next_, calm


def _widen(flags: np.ndarray, a: int, b: int, length: Floats, least: float) -> None:
    """Let a run of rods grow on both sides, cell by cell."""
    while length[a:b].sum() < least and (a > 0 or b < flags.size):
        if a > 0:
            a -= 1
        if b < flags.size and length[a:b].sum() < least:
            b += 1
    flags[a:b] = True
