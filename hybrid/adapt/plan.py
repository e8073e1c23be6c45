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
ROUND = 1e-12  # of a length
BACK = 0.5  # ratio above which a rod that is on its way out comes back


def wanted(ratios: Floats, rod: np.ndarray) -> np.ndarray:
    """Base cells (n,) that ask to be, or to stay, a rod: hysteresis between 1 and the criterion's `off`."""
    # a ratio that is not a number asks, too
    return np.asarray(np.where(rod, ~(ratios <= OFF[:, None]).all(axis=0), ~(ratios <= 1.0).all(axis=0)))


def spread(asks: np.ndarray, base: Floats, buffer: Floats) -> np.ndarray:
    """Base cells within the buffer of those that ask."""
    j = np.flatnonzero(asks)
    inside = np.zeros(asks.size + 1, int)
    np.add.at(inside, np.searchsorted(base[1:], base[j] - buffer[j], side="right"), 1)
    np.subtract.at(inside, np.searchsorted(base[:-1], base[j + 1] + buffer[j], side="left"), 1)
    return np.asarray(np.cumsum(inside[:-1]) > 0)


def planned(
    ratios: Floats,
    rod: np.ndarray,
    calm_since: Floats,
    t: float,
    base: Floats,
    rules: Rules,
    leaving: np.ndarray | None = None,
) -> tuple[np.ndarray, Floats]:
    """What the base cells should be, and since when (s) each rod has been calm (infinity: it is not).

    rod: (n,) what they are; calm_since: (n,) from the last review; leaving: (n,) rods that are being blended out,
    whose curvature rises for that reason alone: they are kept only above BACK.
    """
    holds = wanted(ratios, rod)
    if leaving is not None:
        holds = np.where(leaving, ~(ratios <= BACK).all(axis=0), holds)
    keeps = spread(holds, base, rules.buffer)
    grows = spread(wanted(ratios, np.zeros_like(rod)), base, rules.buffer)
    calm = np.where(rod & ~keeps, np.minimum(calm_since, t), np.inf)
    goes = rod & (t - calm >= rules.dwell)
    return tidied((rod & ~goes) | grows, rod, base, rules.shortest), calm


def tidied(flags: np.ndarray, rod: np.ndarray, base: Floats, shortest: float) -> np.ndarray:
    """No rod and no gap between rods shorter than `shortest`: rods widen, into what was rod first, and gaps close."""
    flags, length, least = flags.copy(), np.diff(base), shortest * (1.0 - ROUND)
    while True:
        before = flags.copy()
        for a, b in pairwise(edges(before)):
            if before[a]:
                _widen(flags, a, b, rod, length, least)
        cuts = edges(flags)
        for a, b in pairwise(cuts):
            if not flags[a] and a > 0 and b < flags.size and length[a:b].sum() < least:
                flags[a:b] = True
        if (flags == before).all():
            return flags


def _widen(flags: np.ndarray, a: int, b: int, rod: np.ndarray, length: Floats, least: float) -> None:
    """Let a run of rods grow on both sides, cell by cell; on one side only while only that one was rod."""
    while length[a:b].sum() < least and (a > 0 or b < flags.size):
        left, right = a > 0, b < flags.size
        if left and right and rod[a - 1] != rod[b]:
            left, right = bool(rod[a - 1]), bool(rod[b])
        a -= left
        b += right and length[a:b].sum() < least
    flags[a:b] = True
