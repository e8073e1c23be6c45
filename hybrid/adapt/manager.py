"""The domain manager: watches the criteria, proposes zones, and blends bending in and out.

It proposes; the loop disposes.  What it holds besides the layout is small: how far bending has
been blended in (`grown`), which rods are on their way out (`leaving`), since when they are calm.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from hybrid.adapt.criteria import weigh
from hybrid.adapt.plan import Rules, planned
from hybrid.adapt.table import CRITERIA, GIVEN
from hybrid.model.layout import Layout, edges
from hybrid.model.material import Material
from hybrid.model.state import Ends, Floats, Line, Sea, State

# The tension below which a stretch must be rod, in (EI w^2)^(1/3): there a cable bends under its weight as much as
# its tension straightens it.
FLOOR = 0.2
# Rod on either side of what asks for it, in sqrt(EI/T), or (EI/w)^(1/3) where that is shorter: without tension weight
# is what straightens a cable.
BUFFER = 2.0
# How far ahead a falling tension is seen, in dwell times.
HORIZON = 0.5
REVIEWS = 8  # in a dwell time, when nothing asks: what happens in between is remembered
NO_CLAMPS = np.zeros((2, 3))
# A rod begins with this part of its stiffness: with none its cells could spin freely.
FIRST = 1e-3
SHORTEST = 2.0  # base cells that make a zone


class Change(NamedTuple):
    """A proposal: what the base cells should be, and why."""

    rod: np.ndarray
    reasons: tuple[tuple[int, int, str, str], ...]  # first and last base cell (+1), kind of event, text


class DomainManager:
    """Watches one line.  lengths in m, times in s."""

    def __init__(
        self, cable: Material, layout: Layout, tolerance: float, dwell: float, given: np.ndarray, scale: float
    ) -> None:
        """tolerance: m; given: (n,) 1 always rod, -1 always catenary, 0 as it comes; scale: tension scale, N."""
        n = layout.rod.size
        self.cable, self.layout, self.tolerance, self.dwell, self.given = cable, layout, tolerance, dwell, given
        self.scale = scale
        self.ratios = np.zeros((len(CRITERIA), n))
        self.grown, self.leaving = np.ones(n), np.zeros(n, bool)
        self.calm_since = np.full(n, np.inf)
        self.before = np.zeros(0)
        self.loudest, self.going, self.coming, self.next_review = 0.0, False, False, 0.0
        self.follow(layout)

    def follow(self, layout: Layout) -> None:
        """Take over a layout: what the criteria need of its nodes."""
        self.layout = layout
        s = layout.nodes
        middle = 0.5 * (s[:-1] + s[1:])
        cable = self.cable
        of = np.clip(np.searchsorted(cable.bounds, middle) - 1, 0, cable.mass.size - 1)
        pad = np.concatenate([[of[0]], of, [of[-1]]])
        EI = cable.B[:, :2].mean(axis=1)
        buoy = np.nan_to_num(cable.buoy)
        weight = np.abs(cable.weight - buoy)
        self.EI = np.maximum(EI[pad[:-1]], EI[pad[1:]])
        self.w = np.maximum(weight[pad[:-1]], weight[pad[1:]])
        self.m = cable.mass[of]
        self.kink = (EI[pad[:-1]] != EI[pad[1:]]).astype(np.int8)
        self.kink[np.searchsorted(s, cable.at - 1e-9 * s[-1])] = 1
        self.floor = np.maximum(FLOOR * np.cbrt(self.EI * self.w**2), 1e-6 * self.scale)
        self.base_of_cell = layout.base_of_cell
        self.coming = bool((layout.rod & (self.grown < 1.0)).any())
        self.before = np.zeros(0)

    def weigh(self, line: Line, sea: Sea, ends: Ends, state: State, dt: float) -> None:
        """Raise the ratios since the last review to those of a state; dt: since the last time, 0 if there was none."""
        before = state.T if self.before.size != state.T.size or dt == 0.0 else self.before
        clamps = NO_CLAMPS
        if line.element[0] or line.element[-1]:
            clamps = ends.frame[:, 2::3] * np.array([[line.element[0]], [line.element[-1]]])
        ahead = min(HORIZON * self.dwell / dt, 2.0) if dt > 0.0 else 0.0
        self.loudest = weigh(
            line, sea, state.r, state.e, state.T, state.a1, before, ahead, self.EI, self.w, self.kink, self.floor,
            self.tolerance, clamps, self.base_of_cell, self.ratios,
        )  # fmt: skip
        if self.before.size == state.T.size:
            self.before[:] = state.T
        else:
            self.before = state.T.copy()

    def due(self, t: float) -> bool:
        """Whether a review is due: a catenary asks, a rod is on its way out, or some time has passed."""
        return self.loudest > 1.0 or self.going or t >= self.next_review

    def review(self, t: float, state: State) -> Change | None:
        """What should change now, after the ratios since the last review; None most of the time."""
        rod = self.layout.rod
        self.ratios[GIVEN] = self.given > 0
        stays = rod & ~self.leaving
        next_, self.calm_since = planned(self.ratios, stays, self.calm_since, t, self.layout.base, self.rules(state))
        next_ &= self.given >= 0
        self.leaving = rod & ~next_
        self.going = bool(self.leaving.any())
        self.next_review = t + self.dwell / REVIEWS
        gone = self.leaving & (self.grown <= 0.0)
        new = (rod & ~gone) | next_
        change = None if (new == rod).all() else Change(new, tuple(self._reasons(rod, new)))
        self.ratios[:] = 0.0
        return change

    def rules(self, state: State) -> Rules:
        """The rules at the tensions of a state."""
        first = self.layout.first[:-1]
        T = np.minimum.reduceat(state.T, first)
        EI, floor = self.EI[first], self.floor[first]
        buffer = BUFFER * np.minimum(
            np.sqrt(EI / np.maximum(T, floor)), np.cbrt(EI / np.maximum(self.w[first], 1e-9 * self.scale))
        )
        return Rules(buffer, SHORTEST * float(np.median(np.diff(self.layout.base))), self.dwell)

    def insist(self, cells: np.ndarray) -> Change:
        """Rods wanted at once, whatever the criteria say: for a step that failed."""
        new = self.layout.rod.copy()
        for j in np.unique(self.base_of_cell[cells]):
            new[max(j - 1, 0) : j + 2] = True
        new &= self.given >= 0
        return Change(new, tuple(self._reasons(self.layout.rod, new, "a step that failed")))

    def _reasons(self, rod: np.ndarray, new: np.ndarray, why: str = "") -> list[tuple[int, int, str, str]]:
        """Runs of base cells that change, and for each what asks for it, or had held it until now."""
        out = []
        base, off = self.layout.base, np.array([x.off for x in CRITERIA])
        loud = self.ratios.max(axis=0)
        for a, b in pairwise(edges(np.where(rod == new, 0, np.where(new, 1, -1)))):
            if rod[a] == new[a]:
                continue
            if new[a]:
                asks = np.flatnonzero(loud > 1.0)
                text = why
                if not why and asks.size:
                    j = asks[np.argmin(np.abs(asks - 0.5 * (a + b - 1)))]
                    c = int(np.argmax(self.ratios[:, j]))
                    text = f"{CRITERIA[c].name} {self.ratios[c, j]:.3g} > 1 at s = {base[j]:.4g} to {base[j + 1]:.4g} m"
                out.append((a, b, "rod", text or "closes a gap"))
            else:
                j = a + int(np.argmax((self.ratios[:, a:b] / off[:, None]).max(axis=0)))
                c = int(np.argmax(self.ratios[:, j] / off))
                text = (
                    f"{CRITERIA[c].name} {self.ratios[c, j]:.3g} < {off[c]:g} and all else calm for {self.dwell:.3g} s"
                )
                out.append((a, b, "catenary", text))
        return out

    def blend(self, dt: float) -> Floats:
        """Move on by dt; how much of its stiffness every node has (N+1,)."""
        # over a dwell time: within sqrt(m EI)/T, which is enough for a wave of bending, axial waves would ring
        self.grown = np.clip(self.grown + np.where(self.leaving, -dt, dt) / self.dwell, 0.0, 1.0)
        self.coming = bool((self.layout.rod & ~self.leaving & (self.grown < 1.0)).any())
        return self.parts()

    def parts(self) -> Floats:
        """How much of its stiffness every node has (N+1,)."""
        x = self.grown
        smooth = np.maximum(x * x * (3.0 - 2.0 * x), FIRST)
        cells = smooth[self.base_of_cell]
        out = np.minimum(np.append(cells, cells[-1]), np.append(cells[0], cells))
        return np.asarray(out)
