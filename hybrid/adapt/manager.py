"""The domain manager: evaluates the criteria, proposes zones, and ramps bending stiffness up and down.

The time loop decides whether a proposal is carried out.  Besides the layout the manager holds the part of its stiffness
that each rod has (`grown`), rods whose stiffness is ramped down (`leaving`), since when they are below their
thresholds, and earlier tensions.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from hybrid.adapt.zone_rules import OFF, Rules, planned, reach, spread, tidied, wanted
from hybrid.kernels.binding import Table
from hybrid.kernels.criteria import CLAMP, CRITERIA, GIVEN, SLACK, TORSION
from hybrid.kernels.state import Ends, Floats, Line, Sea, State
from hybrid.kernels.stiffness_ramp import advance, shares
from hybrid.kernels.zone_criteria import (
    LOAD,
    MOST,
    SMOOTH,
    STEP,
    TWISTED,
    NodeKinds,
    blank_criteria_job,
    end_turn,
    evaluate_criteria,
    twist_of_rods,
)
from hybrid.model.layout import Layout, edges
from hybrid.model.material import Material, tension_floor

# Rod on either side of cells above a threshold, in sqrt(EI/T), or (EI/w)^(1/3) where that is shorter: without tension
# it is weight that straightens a cable.
BUFFER = 2.0
# How far a falling tension is extrapolated, in ramp times; the rate is taken over one or two samples.
LOOKAHEAD, LONGEST_LOOKAHEAD = 0.125, 2.0
REVIEWS, SAMPLES = 4, 16  # per ramp time: reviews without a cell above threshold; samples of the tension
REJECT_RATIO = 4.0  # a step that ends with a catenary above this is rejected, and repeated with more rod
FAST_RAMP = 16.0  # factor by which stiffness is ramped up faster where tension is lost
RETURN_WINDOW = 4.0  # hold times: a catenary that lasts less costs more than its two switches save
LOST_TENSION, WEIGHTLESS = (
    0.3,
    1e-3,
)  # remaining part of a lost tension; tension floor over scale, no weight
LONGEST_WAIT = 8.0  # hold times that a rod is kept below threshold, where earlier ones were released too soon
SHORTEST = 2.0  # base cells that make a zone
FORCED_RATIO = 2.0  # ratio of cells that the scene forces to be rod


# What a checkpoint holds of the manager; the rest follows from the scene, the layout and the next step.
CHECKPOINTED = (
    "tolerance", "held", "ratios", "seen", "grown", "leaving", "haste", "calm_since", "calmed", "patience", "released",
    "going", "next_review", "total_twist", "past", "recent", "age", "recent_age",
)  # fmt: skip


class NodeState(NamedTuple):
    """What a user criterion receives; the arrays are read-only.

    t: s; s: (N+1,) m; position, velocity: (N+1, 3) m, m/s; tension: (N,) N, of cells; curvature: (N+1,) 1/m;
    bending_stiffness: (N+1,) N m2.
    """

    t: float
    s: Floats
    position: Floats
    velocity: Floats
    tension: Floats
    curvature: Floats
    bending_stiffness: Floats


# (N+1,) above 1: rod around the node; below 0.5: catenary again.
UserCriterion = Callable[[NodeState], Floats]


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


class DomainManager:
    """Watches one line.  lengths in m, times in s."""

    def __init__(
        self,
        cable: Material,
        layout: Layout,
        tolerance: float,
        dwell: float,
        given: np.ndarray,
        scale: float,
        user: UserCriterion | None = None,
        pace: float | None = None,
        left: float = 1.0,
    ) -> None:
        """tolerance: m; given: (n,) 1 force_rod, -1 force_catenary, 0 adaptive; scale: tension scale, N.

        left: part of the bending error of catenaries that remains in results (1: no correction);
        dwell: hold time, s; pace: ramp time of bending stiffness, s (None: dwell).
        """
        n = layout.rod.size
        self.cable, self.layout, self.tolerance, self.dwell, self.given = cable, layout, tolerance, dwell, given
        self.pace, self.held = pace or dwell, False
        self.left = left
        self.scale, self.user, self.free = scale, user, (given >= 0).astype(np.int8)
        self.ratios, self.seen = np.zeros((2, len(CRITERIA), n))  # since the last review, and since the last output
        self.grown, self.leaving, self.haste = np.ones(n), np.zeros(n, bool), np.ones(n)
        self.calm_since, self.buffer = np.full(n, np.inf), np.zeros(n)
        self.calmed = np.zeros((2, n))  # of rods on their way out: which criterion was the loudest, and its ratio
        self.patience, self.released = np.ones(n), np.full(n, -np.inf)
        self.shortest = SHORTEST * float(np.median(np.diff(layout.base)))
        self.loudest, self.going, self.coming, self.next_review = 0.0, False, False, 0.0
        self.clamped = np.array(cable.held_tangent, float)[:, None]
        self._table, self._tangents = Table(blank_criteria_job()), np.zeros((2, 3))
        # a torque needs rods from end to end: what the ends have been turned by is remembered while there are none
        self.moments, self.loaded = np.zeros((2, 3)), False  # N m, given at the ends
        self.twisted = all(cable.held_twist) and all(cable.held_tangent)
        self.total_twist = self.torque = 0.0  # rad; N m, that a rod from end to end would carry, where there is none
        self.set_layout(layout)

    def set_layout(self, layout: Layout) -> None:
        """Take over a layout: what the criteria need of its nodes."""
        self.layout = layout
        s = layout.nodes
        middle = 0.5 * (s[:-1] + s[1:])
        cable = self.cable
        of = cable.piece(middle)
        pad = np.concatenate([[of[0]], of, [of[-1]]])
        EI, weight = cable.mean_bending, np.abs(cable.submerged_weight)
        self.s, self.EI = s, np.maximum(EI[pad[:-1]], EI[pad[1:]])
        self.w = np.maximum(weight[pad[:-1]], weight[pad[1:]])
        self.node = np.where(EI[pad[:-1]] != EI[pad[1:]], STEP, SMOOTH).astype(np.int8)
        self.node[cable.point_nodes(s)] = LOAD
        self.floor = tension_floor(self.EI, self.w, self.scale)
        self.weightless = bool((self.floor < WEIGHTLESS * self.scale).any())
        self.base_of_cell = layout.base_of_cell
        bent = np.linalg.norm(cable.kappa[of, :2], axis=1)
        self.bent = np.maximum(np.append(bent[0], bent), np.append(bent, bent[-1]))
        self.turn, self.twisting, self.share = np.zeros((3, s.size))
        self._kinds = NodeKinds(
            self.EI, self.w, self.bent, self.node, self.floor, self.base_of_cell.astype(np.int64), self.free, self.turn,
            self.twisting,
        )  # fmt: skip
        self.compliance = float(np.sum(np.diff(s) / np.maximum(cable.B[of, 2], 1e-300)))
        self.free_twist = float(np.diff(s) @ cable.kappa[of, 2])
        self._update_ramping()
        self.past = self.recent = np.zeros(0)
        self.age = self.recent_age = 0.0

    def adopt_layout(self, new: Layout, change: Change, t: float) -> None:
        """Take over the layout of a change, at t: what is new begins to be blended in, faster where it is urgent.

        What comes back soon after it was let go must be calm much longer from then on, and else half as long.
        """
        fresh, gone, urgent = new.rod & ~self.layout.rod, self.layout.rod & ~new.rod, change.urgent
        soon = t - self.released < RETURN_WINDOW * self.dwell * self.patience
        self.patience[fresh] = np.where(soon, LONGEST_WAIT, np.maximum(0.5 * self.patience, 1.0))[fresh]
        self.released[gone] = t
        self.grown[change.stiff], self.leaving[change.stiff] = 1.0, False
        self.grown[fresh], self.leaving[fresh], self.calm_since[fresh] = 0.0, False, np.inf
        self.haste[fresh] = np.where(urgent[fresh], FAST_RAMP, 1.0)
        self.grown[~new.rod], self.leaving[~new.rod] = 1.0, False
        self.set_layout(new)

    def checkpoint(self) -> dict[str, Any]:
        """State besides the layout."""
        return {name: getattr(self, name) for name in CHECKPOINTED}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Restore a checkpoint; ValueError: it is invalid."""
        allowed, cells = self.tolerance, self.base_of_cell.size
        vars(self).update(saved)
        good = 0.0 < self.tolerance <= allowed and self.past.shape == self.recent.shape in ((0,), (cells,))
        loudest = self.calmed[0]
        if not (good and 0.0 <= loudest.min(initial=0.0) <= loudest.max(initial=0.0) < len(CRITERIA)):
            raise ValueError("invalid checkpoint of the domain manager")
        if not (0.0 <= self.grown.min() <= self.grown.max() <= 1.0 and min(self.age, self.recent_age) >= 0.0):
            raise ValueError("invalid checkpoint: a part of stiffness outside 0 to 1, or a negative time")
        self._update_ramping()

    # --- watching ------------------------------------------------------------------------------

    def evaluate_criteria(self, line: Line, sea: Sea, ends: Ends, state: State, dt: float, t: float = 0.0) -> float:
        """Raise the ratios since the last review to those of a state, dt after the last one; the loudest of catenaries.

        dt = 0: there was none, or it was on other nodes.
        """
        if self.past.size != state.T.size or dt == 0.0:
            self.past = self.recent = state.T.copy()
            self.age = self.recent_age = 0.0
        self.age, self.recent_age = self.age + dt, self.recent_age + dt
        ahead = min(LOOKAHEAD * self.pace / self.age, LONGEST_LOOKAHEAD) if self.age > 0.0 else 0.0
        self.torque = self._torque(line, ends, state) if self.twisted else 0.0
        np.multiply(ends.frame[:, 2::3], self.clamped, out=self._tangents)
        self._table.bind(
            line=line, sea=sea, tangents=self._tangents, state=state, past=self.past, ahead=ahead,
            tolerance=self.tolerance / self.left, torque=self.torque, kinds=self._kinds, ratios=self.ratios,
        )  # fmt: skip
        self.loudest = evaluate_criteria(self._table.numbers)
        if self.loaded:
            self._evaluate_moments(state)
        if self.user is not None:
            self._ask_user(line, state, t)
        return self.loudest

    def _evaluate_moments(self, state: State) -> None:
        """A moment M given at an end holds the cable off its catenary by M/T, as a clamp does; of its full size.

        What of it turns about the cable is a torque, whether rods feel it already or not.
        """
        for k, node in ((0, 0), (-1, -1)):
            moment = float(np.linalg.norm(self.moments[k]))
            T = max(float(state.T[k]), float(self.floor[node]), 1e-300)
            ratio = self.ratios[CLAMP]
            ratio[k] = max(ratio[k], min(moment * self.left / (T * self.tolerance), MOST))
            along = float(self.moments[k] @ state.e[k] / np.linalg.norm(state.e[k]))
            loosest = max(float(state.T.min()), float(self.floor.min()), 1e-300)
            twisting = along**2 / (2.0 * float(self.EI.min()) * TWISTED)
            torsion = max(twisting, abs(along) * self.left * float(self.turn.sum()) / self.tolerance) / (2.0 * loosest)
            np.maximum(self.ratios[TORSION], min(torsion, MOST), out=self.ratios[TORSION])
        quiet = self.layout.rod | (self.given < 0)
        asked = self.ratios[[CLAMP, TORSION]].max(axis=0)
        self.loudest = max(self.loudest, float(np.max(asked, where=~quiet, initial=0.0)))

    def store_past(self, state: State) -> None:
        """The evaluated state is accepted: store its tensions for extrapolation."""
        if self.recent_age * SAMPLES >= self.pace:
            self.past, self.age = self.recent, self.recent_age
            self.recent, self.recent_age = state.T.copy(), 0.0

    def _torque(self, line: Line, ends: Ends, state: State) -> float:
        """Torque, N m, of the turn of one end against the other, as if all the line were rod; 0 if it is: rods know."""
        whole = bool(self.layout.rod.all())
        if whole:
            self.total_twist = float(twist_of_rods(line, ends.frame, state.e, state.a1))
            return 0.0
        turn = end_turn(state.e, ends.frame)
        self.total_twist += (turn - self.total_twist + math.pi) % (2.0 * math.pi) - math.pi
        return (self.total_twist - self.free_twist) / self.compliance

    def _ask_user(self, line: Line, state: State, t: float) -> None:
        assert self.user is not None
        look = NodeState(t, self.s, state.r, state.v, state.T, self.turn / line.hn, self.EI)
        for x in look[1:]:
            x.flags.writeable = False
        try:
            ratio = np.asarray(self.user(look), float)
        finally:
            for x in look[1:]:
                x.flags.writeable = True
        if ratio.shape != self.s.shape:
            raise ValueError(
                f"the criterion gave an array of shape {ratio.shape}, expected one number per node, {self.s.shape}"
            )
        if not np.isfinite(ratio).all():
            i = int(np.flatnonzero(~np.isfinite(ratio))[0])
            raise ValueError(
                f"the criterion gave {ratio[i]} at t = {t:.6g} s, s = {self.s[i]:.6g} m, expected a number"
            )
        cells = np.maximum(ratio[:-1], ratio[1:])
        cells[cells == 1.0] = FORCED_RATIO  # a mask of what must be rod does as well
        np.maximum.at(self.ratios[GIVEN], self.base_of_cell, cells)
        quiet = self.layout.rod | (self.given < 0)
        self.loudest = max(self.loudest, float(np.max(self.ratios[GIVEN], where=~quiet, initial=0.0)))

    @property
    def cells_to_reject(self) -> np.ndarray:
        """Cells of catenaries above REJECT_RATIO since the last review."""
        loud = ~(self.ratios <= REJECT_RATIO).all(axis=0) & ~self.layout.rod & (self.given >= 0)
        return np.flatnonzero(loud[self.base_of_cell])

    def cells_near_threshold(self, cell: int) -> np.ndarray:
        """Cells near one where a step failed and a criterion is above its `off`: more rod may help."""
        j = self.base_of_cell[cell]
        near = np.arange(max(j - 1, 0), min(j + 2, self.layout.rod.size))
        asks = ~(self.ratios[:, near] <= OFF[:, None]).all(axis=0) & ~self.layout.rod[near]
        return np.flatnonzero(np.isin(self.base_of_cell, near[asks]))

    # --- proposing -----------------------------------------------------------------------------

    def review_due(self, t: float) -> bool:
        """Whether a review is due: a catenary asks, a rod has been blended out, or some time has passed."""
        return self.loudest > 1.0 or t >= self.next_review

    def review(self, t: float, state: State) -> Change | None:
        """The change that follows from the ratios since the last review; None: no change."""
        rod = self.layout.rod
        self._add_global_ratios()
        rules = self.rules(state)
        next_, self.calm_since = planned(
            self.ratios, rod, self.calm_since, t, self.layout.base, rules, self.leaving, self.patience
        )
        next_ = (next_ | (rod & self.held)) & (self.given >= 0)
        back, before, self.leaving = self.going, self.leaving, rod & ~next_
        self.going = bool(self.leaving.any())
        if back or self.going:
            self._update_ramping()  # perhaps one that was on its way out
            now = self.leaving & ~before
            self.calmed[0, now] = loudest = np.argmax(self.ratios[:, now] / OFF[:, None], axis=0)
            self.calmed[1, now] = np.take_along_axis(self.ratios[:, now], loudest[None], axis=0)[0]
        wait, new = 1.0 / REVIEWS, next_
        if self.going:
            wait = max(min(float(self.grown[self.leaving].min()), wait), 0.0)
            new = next_ | (self.leaving & (self.grown > 0.0))
        self.next_review = t + (wait - 1e-9) * self.pace
        change = None
        if (new != rod).any():
            urgent = spread((self.ratios[SLACK] > 1.0) | self._losing_tension(state), self.layout.base, rules.buffer)
            change = Change(new, tuple(self._reasons(rod, new)), urgent, np.zeros_like(rod))
        self._reset_ratios()
        return change

    def initial_rods(self, state: State) -> np.ndarray:
        """Base cells that ask to be rod, whatever they are, after `evaluate_criteria`; the ratios begin anew."""
        n = self.layout.rod.size
        self._add_global_ratios()
        rules = self.rules(state)
        asks = spread(wanted(self.ratios, np.zeros(n, bool)), self.layout.base, rules.buffer)
        self._reset_ratios()
        return np.asarray(tidied(asks, asks, self.layout.base, rules.shortest) & (self.given >= 0))

    def force_rods(self, cells: np.ndarray, why: str) -> Change:
        """Rods at once, whatever the criteria: after a failed step."""
        new = self.layout.rod.copy()
        for j in np.unique(self.base_of_cell[cells]):
            new[max(j - 1, 0) : j + 2] = True
        new &= self.given >= 0
        reasons = [r._replace(kind="retry") for r in self._reasons(self.layout.rod, new, why)]
        stiff = new & self.layout.rod & (self.grown < 1.0)
        for a, b in pairwise(edges(stiff)):
            if stiff[a]:
                reasons.append(Reason(a, b, "retry", f"{why}, with all of its stiffness"))
        return Change(new, tuple(reasons), new, stiff)

    def _losing_tension(self, state: State) -> np.ndarray:
        """Base cells (n,) without weight, hence without a floor, that lose most of their tension within a pace."""
        if not (self.weightless and self.age > 0.0):
            return np.zeros(self.layout.rod.size, bool)
        T = state.T + self.pace / self.age * (state.T - self.past)
        falls = (T < LOST_TENSION * state.T) & (self.past > state.T) & (self.floor[:-1] < WEIGHTLESS * self.scale)
        return np.asarray(np.logical_or.reduceat(falls, self.layout.first[:-1]))

    def rules(self, state: State) -> Rules:
        """The rules at the tensions of a state."""
        reach(state.T, self.base_of_cell, self.EI, self.w, self.floor, BUFFER, 1e-9 * self.scale, self.buffer)
        return Rules(self.buffer, self.shortest, self.dwell)

    def _add_global_ratios(self) -> None:
        """Ratios that are not local: forced rods, and torque, which needs rods from end to end."""
        self.ratios[GIVEN, self.given > 0] = FORCED_RATIO
        if self.twisted or self.loaded:
            self.ratios[TORSION] = self.ratios[TORSION].max()

    def _reset_ratios(self) -> None:
        np.maximum(self.seen, self.ratios, out=self.seen)
        self.ratios[:] = 0.0

    def reset(self) -> None:
        """Set all ratios to zero."""
        self.ratios[:] = self.seen[:] = 0.0

    def largest_ratios(self, s: Floats) -> Floats:
        """The largest ratios (criteria, places) at places s, m, since the last call."""
        out = np.maximum(self.seen, self.ratios)
        self.seen[:] = 0.0
        cells = np.clip(np.searchsorted(self.layout.base, s) - 1, 0, self.layout.rod.size - 1)
        return np.asarray(out[:, cells])

    def _reasons(self, rod: np.ndarray, new: np.ndarray, why: str = "") -> list[Reason]:
        """Runs of base cells that change, and for each what asks for it, or had held it until now."""
        out = []
        base = self.layout.base
        loud = self.ratios.max(axis=0)
        for a, b in pairwise(edges(np.where(rod == new, 0, np.where(new, 1, -1)))):
            if rod[a] == new[a]:
                continue
            beside = (a > 0 and rod[a - 1] and new[a - 1]) or (b < rod.size and rod[b] and new[b])
            if new[a]:
                kind = "grow" if beside else "split"
                asks = np.flatnonzero(loud > 1.0)
                if why:
                    out.append(Reason(a, b, kind, why))
                elif asks.size:
                    j = asks[np.argmin(np.abs(asks - 0.5 * (a + b - 1)))]
                    c = int(np.argmax(self.ratios[:, j]))
                    value = float(self.ratios[c, j])
                    text = f"{CRITERIA[c].name} {value:.3g} > 1 at s = {base[j]:.4g} to {base[j + 1]:.4g} m"
                    out.append(Reason(a, b, kind, text, CRITERIA[c].name, value, 1.0))
                else:
                    out.append(Reason(a, b, kind, "closes a gap"))
            else:
                which, ratios = self.calmed[0, a:b].astype(int), self.calmed[1, a:b]
                j = a + int(np.argmax(ratios / OFF[which]))
                c, value = int(self.calmed[0, j]), float(self.calmed[1, j])
                name, off = CRITERIA[c].name, float(OFF[c])
                calm = f"calm for {self.dwell * self.patience[j]:.3g} s and blended out"
                text = f"{calm}; {name} {value:.3g}, threshold {off:g}"
                out.append(Reason(a, b, "shrink" if beside else "merge", text, name, value, off))
        return out

    # --- ramps -----------------------------------------------------------------------------------

    @property
    def ramping(self) -> bool:
        return self.going or self.coming

    def stiffness_shares(self, dt: float = 0.0) -> Floats:
        """Part of its bending stiffness that each node has (N+1,), dt from now; overwritten by the next call.

        Over a pace: within sqrt(m EI)/T, which is enough for a wave of bending, axial waves would ring.  Where
        tension goes there is less time, and nothing that could ring.
        """
        shares(self.grown, self.leaving, self.haste, dt / self.pace, self.base_of_cell, self.share)
        return self.share

    def advance_ramp(self, dt: float) -> None:
        """Advance the ramps of stiffness by dt."""
        advance(self.grown, self.leaving, self.haste, dt / self.pace)
        self._update_ramping()

    def _update_ramping(self) -> None:
        self.coming = bool((self.layout.rod & ~self.leaving & (self.grown < 1.0)).any())
