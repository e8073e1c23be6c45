"""Draw the zones of a run: `plot_zones` makes one page of arc length against time, and the share of rod below.

Each output point of each output has one cell, which reaches half way to the neighbours in time and, within its zone,
in s; its colour is the recorded value.  Nothing is drawn between the two: a zone that holds no output point is grey.
"""

from __future__ import annotations

import math
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hybrid.results.look import BED, GREY, INK, NORMAL, SMALL, legend_row, new_page, prefix, save, style
from hybrid.results.read import Event, Result, Zone
from hybrid.results.views import whole_zones

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

# Lightness falls evenly along both (in OKLab, from 0.93 to 0.32), hues stay opposite: to full, protan, deutan and tritan
# eyes no colour of the one comes nearer than 0.07 to any of the other, three times what is just told apart.
COLOURS = {
    "rod": ("#FCE5BB", "#F2C78E", "#E9A862", "#E08735", "#D1680E", "#B84F04", "#9B3A0D", "#7B2C17", "#5B1F17"),
    "catenary": ("#CFEEF7", "#A6D8EA", "#7FC0DF", "#5AA7D6", "#398CCC", "#2C72B6", "#2158A0", "#204181", "#1D2C5D"),
}
SHOWN = {"rod": "curvature", "catenary": "tension"}  # what tells why a stretch is of this kind
_UNSEEN = "#DADADA"
_DECADES = 3  # of curvature, at most; what is straighter is straight
_MARKS = {"split": ("^", "white"), "merge": ("v", INK), "retry": ("X", "#C00000")}
_MOST_MARKS = 250  # more would hide the zones
_SAME = 1e-9  # of the length: places closer than that are one, since boundaries are sums


class Cells(NamedTuple):
    """The cells of a picture: edges in time (nt+1,) s and along the cable (n+1,) m; in each the zone kind, -1: none,
    and the number of the output point that stands for it, -1: none (n, nt)."""

    t: np.ndarray
    s: np.ndarray
    kinds: tuple[str, ...]
    kind: np.ndarray
    point: np.ndarray

    def values(self, kind: str, array: np.ndarray) -> np.ma.MaskedArray:
        """A field (nt, ns) in the cells of one kind (n, nt), masked elsewhere."""
        here = (self.point >= 0) & (self.kind == (self.kinds.index(kind) if kind in self.kinds else -2))
        picked = array[np.arange(self.point.shape[1]), np.maximum(self.point, 0)]
        return np.ma.masked_array(picked, ~here)


def cells_of(result: Result) -> Cells:
    """Where each zone is, and which output point stands for each place in it: the nearest that it does not share."""
    times, s = result.times, result.s
    runs = [(zones, len(list(same))) for zones, same in groupby(map(whole_zones, result.zones))]
    bounds = [x for zones, _ in runs for zone in zones for x in zone[1:]]
    middles = 0.5 * (s[1:] + s[:-1])
    edges = np.sort([*bounds, *middles, s[0], s[-1]])
    edges = edges[np.append(True, np.diff(edges) > _SAME * max(np.ptp(edges), 1e-300))]
    if len(edges) < 2:
        edges = edges[0] + np.array([-0.5, 0.5])
    centres = 0.5 * (edges[1:] + edges[:-1])
    kinds = tuple(dict.fromkeys(zone.kind for zones, _ in runs for zone in zones))
    columns = [np.repeat(_column(zones, kinds, centres, s)[:, :, None], n, axis=2) for zones, n in runs]
    kind, point = np.concatenate(columns, axis=2)
    half = 0.5 * np.diff(times)
    t = np.concatenate([times[:1], times[:-1] + half, times[-1:]]) if len(times) > 1 else times + [-0.5, 0.5]
    return Cells(t, edges, kinds, kind, point)


def _column(zones: list[Zone], kinds: tuple[str, ...], centres: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Kind and output point of every cell of one output (2, n)."""
    out = np.full((2, len(centres)), -1)
    slack = _SAME * (s[-1] - s[0])
    shared = [zone.s_a for zone in zones[1:]]  # the value at a joint is of both sides
    own = np.array([all(abs(x - joint) > slack for joint in shared) for x in s])
    for zone in zones:
        here = (centres > zone.s_a) & (centres < zone.s_b)
        out[0, here] = kinds.index(zone.kind)
        inside = (s >= zone.s_a - slack) & (s <= zone.s_b + slack)
        points = np.flatnonzero(inside & own) if (inside & own).any() else np.flatnonzero(inside)
        if len(points):
            limits = 0.5 * (s[points[1:]] + s[points[:-1]])
            out[1, here] = points[np.searchsorted(limits, centres[here])]
    return out
