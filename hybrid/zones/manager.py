"""The domain manager: evaluates the criteria, proposes zones, and ramps bending stiffness up and down.

Criteria are those that are compiled, what a scene asks along the line, and a function of the user.
The time loop decides whether a proposal is carried out.  Besides the layout the manager holds the part of its stiffness
that each rod has (`grown`), rods whose stiffness is ramped down (`leaving`), since when they are below their
thresholds, and earlier tensions.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping
from functools import partial, update_wrapper
from itertools import pairwise
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.machine.binding import Packed, Table
from hybrid.kernels.mesh import zone_step as z
from hybrid.kernels.mesh.cell_errors import CURVATURE, MOMENT, TENSION
from hybrid.kernels.mesh.cell_lengths import FADE
from hybrid.kernels.mesh.zone_criteria import BEND, CRITERIA, GIVEN, SLACK, TORSION, shares
from hybrid.kernels.mesh.zone_plan import (
    OFF,
    blank_review_job,
    mark_spread,
    mark_wanted,
    reach,
    review_zones,
    tidy,
    widen,
)
from hybrid.kernels.mesh.zone_step import REJECT_RATIO, Zones, blank_zone_job, blank_zones, evaluate_criteria
from hybrid.kernels.state.state import Ends, Floats, Line, Sea, State
from hybrid.model.material import Material, tension_floor
from hybrid.model.mesh import Layout, LineOnBase, edges, on_other_parts
from hybrid.model.resolution import requested_accuracy
from hybrid.scene.analysis import ROUGHEST
from hybrid.scene.schema import LineScene

# --- criteria beside those that are compiled ---------------------------------------------------

# Share of what is asked of tension, curvature or moment along the line that leaving bending out may make: as much as
# finer zones are planned to make (accuracy.refinement), so that they are strict enough from the start.
OF_ALONG = 0.25


def shares_asked(scene: LineScene, curvature_error: float | None, bends: float = math.inf) -> dict[int, float]:
    """Parts of the largest tension, curvature and moment along the line that leaving bending out may make.

    bends: of `Resolution`: what limits of bending ask for as well.
    """
    wanted = requested_accuracy(scene)
    parts = (wanted.of_tension, wanted.of_curvature, wanted.of_moment) if wanted is not None else (None,) * 3
    asked = {k: OF_ALONG * part for k, part in zip((TENSION, CURVATURE, MOMENT), parts, strict=True) if part}
    if bends <= ROUGHEST:
        asked[CURVATURE] = min(OF_ALONG * bends, asked.get(CURVATURE, np.inf))
    if curvature_error is not None:
        asked[CURVATURE] = min(curvature_error, asked.get(CURVATURE, np.inf))
    return asked


# A criterion of the user: a Python function that says where the cable must be a rod.

FORCED_RATIO = 2.0  # ratio of cells that the scene, or a mask of the user, forces to be rod


class NodeState(NamedTuple):
    """What a user criterion receives; the arrays are read-only.

    t: s; s: (N+1,) m; position, velocity: (N+1, 3) m, m/s; tension: (N,) N, of cells; curvature: (N+1,) 1/m;
    bending_stiffness: (N+1,) N m2; line: its name, empty in the short form of a scene.
    """

    t: float
    s: Floats
    position: Floats
    velocity: Floats
    tension: Floats
    curvature: Floats
    bending_stiffness: Floats
    line: str = ""


# (N+1,) above 1: rod around the node; below 0.5: catenary again.
UserCriterion = Callable[[NodeState], Floats]


def of_line(criterion: UserCriterion | None, name: str) -> UserCriterion | None:
    """The criterion for a line, which sees its name."""
    return with_names(criterion, {"": name})


def with_names(criterion: UserCriterion | None, names: Mapping[str, str]) -> UserCriterion | None:
    """The criterion, which sees other names of lines."""
    if criterion is None:
        return None
    asked = criterion

    def of_named(nodes: NodeState) -> Floats:
        return asked(nodes._replace(line=names[nodes.line]))

    return update_wrapper(of_named, asked) if callable(asked) else asked


def cell_ratios(criterion: UserCriterion, nodes: NodeState) -> Floats:
    """Ratios (N,) of cells, the larger of their nodes; ValueError: the criterion gave another shape, or no number."""
    if not callable(criterion):
        raise ValueError(f"criterion: expected a function of a hybrid.NodeState, found {criterion!r:.60}")
    arrays = [x for x in nodes if isinstance(x, np.ndarray)]
    for x in arrays:
        x.flags.writeable = False
    try:
        given = criterion(nodes)
    finally:
        for x in arrays:
            x.flags.writeable = True
    try:
        ratio = np.asarray(given, float)
    except (TypeError, ValueError):
        raise _refused(criterion, nodes, f"{given!r:.60} ({type(given).__name__})") from None
    if ratio.shape != nodes.s.shape:
        kind = f"an array of shape {ratio.shape}" if ratio.shape else f"{given!r:.60} ({type(given).__name__})"
        raise _refused(criterion, nodes, kind)
    if not np.isfinite(ratio).all():
        i = int(np.flatnonzero(~np.isfinite(ratio))[0])
        raise _refused(criterion, nodes, f"{ratio[i]} at s = {nodes.s[i]:.6g} m")
    cells = np.maximum(ratio[:-1], ratio[1:])
    cells[cells == 1.0] = FORCED_RATIO  # a mask
    return cells


def _refused(criterion: UserCriterion, nodes: NodeState, given: str) -> ValueError:
    """What a criterion gave in place of ratios: where it is written, its name, and what is expected."""
    written: Any = inspect.unwrap(criterion)
    while isinstance(written, partial):
        written = written.func
    code = getattr(written, "__code__", None) or getattr(written.__call__, "__code__", None)
    where = f"{code.co_filename}:{code.co_firstlineno}: " if code is not None else ""
    name = getattr(written, "__qualname__", type(written).__qualname__)
    return ValueError(
        f"{where}the criterion {name} returned {given} at t = {nodes.t:.6g} s\n    expected: one number per node, an "
        f"array of shape {nodes.s.shape}: 1 or more where the line must be a rod; or a mask\n"
        "    try:      return such as nodes.position[:, 2] < -20.0"
    )


# --- the manager -------------------------------------------------------------------------------

# Rod on either side of cells above a threshold, in sqrt(EI/T), or (EI/w)^(1/3) where that is shorter: without tension
# it is weight that straightens a cable.
BUFFER = 2.0
REVIEWS = 4  # without a cell above threshold, per ramp time
FAST_RAMP = 16.0  # factor by which stiffness is ramped up faster where tension is lost
RETURN_WINDOW = 4.0  # hold times: a catenary that lasts less costs more than its two switches save
LOST_TENSION = 0.3  # remaining part of a tension, from which on it is being lost
WEIGHTLESS = 1e-3  # tension floor over tension scale, below which a cable counts as one without weight
LONGEST_WAIT = 8.0  # hold times that a rod is kept below threshold, where earlier ones were released too soon
SHORTEST = 2  # cells that make a zone


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


# What a checkpoint holds of the manager; the rest follows from the scene, the layout and the next step.
CHECKPOINTED = ("held", "seen", "below_since", "release_cause", "wait_factor", "released", "kinked")
OF_CLOCK = ("tolerance", "next_review", "total_twist", "age", "recent_age", "fastest")
OF_ZONES = ("ratios", "grown", "leaving", "ramp_factor", "largest")


# Arrays of `Zones` that are the same for every layout: those without base cells first, those of planned nodes last.
OF_LINE = ("clock", "counts", "clamped", "tangents", "moments", "asked", "largest", "shares", "limits")
OF_PLAN = ("next_rod", "here", "plan", "idle_steps", "waves")
OF_BASE = (*OF_LINE, "ratios", "rod", "leaving", "grown", "ramp_factor", "parts", "H", *OF_PLAN)


all_zones = Packed(lambda n: blank_zones(n, 1), given=(*OF_BASE, "kinds"))


def first_zones(cable: Material, layout: Layout, allowed: Allowed, times: Times) -> Zones:
    """What the compiled run knows of zones before the first step; cells are still to be set."""
    places = layout.starts[-1] + 1
    zones = blank_zones(1, layout.rod.size)._replace(
        here=np.zeros(places, bool),
        plan=np.zeros(places, bool),
        idle_steps=np.zeros(places, np.int64),
        waves=np.zeros(places),
    )
    clock = zones.clock
    clock.share, clock.fineness, clock.tolerance = allowed.curvature_error or 0.0, allowed.fineness, allowed.tolerance
    clock.ramp_time = times.ramp or times.hold
    clock.edge_time = clock.ramp_time if times.edge is None else times.edge
    clock.memory = FADE * max(clock.ramp_time, times.period)
    for quantity, part in allowed.asked.items():
        zones.asked[quantity] = part
    zones.clamped[:] = cable.held_tangent
    # a torque needs rods from end to end: what the ends have been turned by is remembered while there are none
    zones.counts.holds_twist = cable.passes_torque
    return zones


class DomainManager:
    """Watches one line.  lengths in m, times in s."""

    def __init__(
        self,
        cable: Material,
        layout: Layout,
        given: np.ndarray,
        scale: float,
        allowed: Allowed,
        times: Times,
        user: UserCriterion | None = None,
        on_base: LineOnBase | None = None,
    ) -> None:
        """given: (n,) 1 force_rod, -1 force_catenary, 0 adaptive; scale: tension scale, N; on_base: of the model."""
        n, floor = layout.rod.size, tension_floor(cable.mean_bending, np.abs(cable.submerged_weight), scale)
        self.zones = first_zones(cable, layout, allowed, times)  # what the compiled run knows of them
        self.cable, self.layout, self.given, self.scale = cable, layout, given, scale
        self.user, self.on_base = user, on_base or LineOnBase(cable, layout.base)
        self.dwell, self.ramp_time = times.hold, times.ramp or times.hold
        self.held, self.weightless = False, bool((floor < WEIGHTLESS * scale).any())
        self.kinked = False  # whether it has been said that kinks of joints count as bends
        self.free = (given >= 0).astype(np.int8)
        self.seen = np.zeros((len(CRITERIA), n))  # ratios since the last output
        self.foreseen = np.zeros(n)  # what catenaries will lack, by a pre-run, over what is allowed
        self.first = np.zeros((len(CRITERIA), n))  # largest ratios by which the first rods were chosen
        self.near: Floats = np.zeros(0)  # (N+1,) of a line that touches itself: how near it is to itself
        self.below_since, self.buffer = np.full(n, np.inf), np.zeros(n)
        self.release_cause = np.zeros((2, n))  # of rods on their way out: criterion, and its ratio
        self.wait_factor, self.released = np.ones(n), np.full(n, -np.inf)
        self._review_room = np.zeros(0), np.zeros(0), np.zeros((4, 0), bool)  # what reviews write
        self._table, self._review = Table(blank_zone_job), Table(blank_review_job)
        self.measure(layout)
        self.set_layout(layout)

    # --- what the compiled run knows ----------------------------------------------------------------

    @property
    def ratios(self) -> Floats:
        """(criteria, n), largest since the last review."""
        return self.zones.ratios

    @property
    def grown(self) -> Floats:
        """(n,) part of its stiffness that each rod has."""
        return self.zones.grown

    @property
    def leaving(self) -> np.ndarray:
        """(n,) bool: rods whose stiffness is ramped down."""
        return self.zones.leaving

    @property
    def past(self) -> Floats:
        """(N,) N, tensions some time ago; none: not known."""
        return self.zones.past if self.zones.counts.known else np.zeros(0)

    def load(self, moments: Floats) -> None:
        """Moments (2, 3) N m are given at the ends."""
        self.zones.moments[:] = moments
        self.zones.counts.loaded = bool(moments.any())

    def set_layout(self, layout: Layout) -> None:
        """Take over a layout: what the criteria need of its nodes."""
        kinds = self.on_base.kinds(layout, self.free, self.scale)
        kept = {name: getattr(self.zones, name) for name in OF_BASE}
        self.use_cells_of(layout, all_zones(layout.base_of_cell.size, kinds=kinds, **kept))
        self.zones.rod[:], self.zones.since[:] = layout.rod, -np.inf
        self.zones.place[:] = layout.places
        self.zones.here[:] = False
        self.zones.here[layout.places] = True
        self.zones.waves[~self.zones.here] = 0.0
        clock, flags = self.zones.clock, self.zones.counts
        clock.age = clock.recent_age = 0.0
        flags.known = flags.relaxing = flags.strained = 0
        flags.all_rod = bool(layout.rod.all())

    def use_base(
        self, layout: Layout, on_base: LineOnBase, source: np.ndarray, given: np.ndarray, anew: bool = False
    ) -> None:
        """Go on with base cells of which some have come or gone, where they are one cell each.

        source: (n,) which old base cell a new one is, or has come from; given: as of the constructor; anew: nothing is
        known of earlier steps.
        """
        old, n, places = self.zones, layout.rod.size, layout.starts[-1] + 1
        blank = blank_zones(1, n)._replace(here=np.zeros(places, bool), plan=np.zeros(places, bool))
        kept = {name: getattr(old, name) for name in OF_LINE} | {"ratios": old.ratios[:, source].copy()}
        kept |= {name: getattr(old, name)[source] for name in ("leaving", "grown", "ramp_factor")}
        for name in ("idle_steps", "waves"):
            x = getattr(old, name)
            kept[name] = np.zeros(places, x.dtype) if anew else on_other_parts(self.layout, x, source, layout.parts)
        clock, flags = old.clock, old.counts
        known = flags.known, flags.relaxing, clock.age, clock.recent_age
        self.zones = blank._replace(**kept)
        for name in ("below_since", "wait_factor", "released", "buffer"):
            setattr(self, name, getattr(self, name)[source])
        self.release_cause, self.seen = self.release_cause[:, source].copy(), self.seen[:, source].copy()
        self.given, self.free, self.on_base = given, (given >= 0).astype(np.int8), on_base
        self.measure(layout)
        self.set_layout(layout)
        if not anew:
            flags.known, flags.relaxing, clock.age, clock.recent_age = known

    def use_cells_of(self, layout: Layout, zones: Zones) -> None:
        """Go on with other cells of the same base, of which `zones` knows all."""
        kinds = zones.kinds
        self.layout, self.zones = layout, zones
        self.EI, self.w, self.floor, self.base_of_cell = kinds.EI, kinds.w, kinds.floor, kinds.base_of_cell
        self._update_ramping()

    def measure(self, layout: Layout) -> None:
        """What follows from the lengths of base cells."""
        H, zones, cable = np.diff(layout.base), self.zones, self.cable
        of = cable.piece(0.5 * (layout.base[:-1] + layout.base[1:]))
        zones.parts[:], zones.H[:] = layout.parts, H
        zones.clock.compliance = np.sum(H / np.maximum(cable.B[of, 2], 1e-300))
        zones.clock.free_twist = H @ cable.kappa[of, 2]

    def adopt_rods(self, rod: np.ndarray, change: Change, t: float) -> None:
        """Base cells (n,) that are rod from t on: what is new begins to be blended in, faster where it is urgent.

        What comes back soon after it was let go must be below its thresholds longer from then on, else half as long.
        """
        fresh, gone, urgent = rod & ~self.layout.rod, self.layout.rod & ~rod, change.urgent
        soon = t - self.released < RETURN_WINDOW * self.dwell * self.wait_factor
        self.wait_factor[fresh] = np.where(soon, LONGEST_WAIT, np.maximum(0.5 * self.wait_factor, 1.0))[fresh]
        self.released[gone] = t
        self.grown[change.stiff], self.leaving[change.stiff] = 1.0, False
        self.grown[fresh], self.leaving[fresh], self.below_since[fresh] = 0.0, False, np.inf
        self.zones.ramp_factor[fresh] = np.where(urgent[fresh], FAST_RAMP, 1.0)
        self.grown[~rod], self.leaving[~rod] = 1.0, False
        self.zones.rod[:], self.zones.counts.all_rod = rod, bool(rod.all())

    def checkpoint(self) -> dict[str, Any]:
        """State besides the layout."""
        zones = self.zones
        found = {name: getattr(zones, name) if self.past.size else np.zeros(0) for name in ("past", "recent")}
        found |= {name: float(getattr(zones.clock, name)) for name in OF_CLOCK} | {"going": bool(zones.counts.going)}
        found |= {name: getattr(zones, name) for name in OF_ZONES}
        return found | {name: getattr(self, name) for name in CHECKPOINTED}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Restore a checkpoint; ValueError: it is invalid."""
        cells, zones = self.base_of_cell.size, self.zones
        allowed = float(zones.clock.tolerance)
        good = 0.0 < saved["tolerance"] <= allowed and saved["past"].shape == saved["recent"].shape in ((0,), (cells,))
        criterion, grown = saved["release_cause"][0], saved["grown"]
        if not (good and 0.0 <= criterion.min(initial=0.0) <= criterion.max(initial=0.0) < len(CRITERIA)):
            raise ValueError("invalid checkpoint of the domain manager")
        least = min(saved["age"], saved["recent_age"], saved["fastest"], *saved["largest"])
        if not (0.0 <= grown.min() <= grown.max() <= 1.0 and least >= 0.0):
            raise ValueError("invalid checkpoint: a part of stiffness outside 0 to 1, or a negative time or size")
        for name in ("past", "recent"):
            getattr(zones, name)[: saved[name].size] = saved[name]
        for name in OF_ZONES:
            getattr(zones, name)[:] = saved[name]
        for name in OF_CLOCK:
            setattr(zones.clock, name, saved[name])
        zones.counts.going = saved["going"]
        for name in CHECKPOINTED:
            if isinstance(there := getattr(self, name), np.ndarray):
                there[:] = saved[name]  # in place: compiled reviews know where it is
            else:
                setattr(self, name, saved[name])
        zones.counts.known = saved["past"].size > 0
        self._update_ramping()

    # --- watching ------------------------------------------------------------------------------

    def evaluate_criteria(self, line: Line, sea: Sea, ends: Ends, state: State, dt: float, t: float = 0.0) -> float:
        """Raise the ratios since the last review to those of a state, dt after the last one; the highest of catenaries.

        dt = 0: there was none, or it was on other nodes.
        """
        self.zones.clock.dt = dt
        near = self.near if self.near.size == line.s.size else np.zeros(0)
        self._table.bind(line=line, sea=sea, ends=ends, new=state, zones=self.zones, near=near)
        evaluate_criteria(self._table.numbers)
        if self.user is not None:
            self.ask_user(line, state, t)
        return float(self.zones.clock.highest_ratio)

    def release(self, k: int, cable: Material) -> None:
        """End k holds its tangent and its twist no longer; cable: as that leaves it."""
        self.cable = cable
        self.zones.clamped[k], self.zones.tangents[k] = 0, 0.0
        self.zones.counts.holds_twist = 0

    def ask_user(self, line: Line, state: State, t: float) -> None:
        """Raise the ratios to those of the user's criterion."""
        assert self.user is not None
        nodes = NodeState(t, self.layout.nodes, state.r, state.v, state.T, self.zones.kinds.turn / line.hn, self.EI)
        cells = cell_ratios(self.user, nodes)
        np.maximum.at(self.ratios[GIVEN], self.base_of_cell, cells)
        quiet = self.layout.rod | (self.given < 0)
        clock = self.zones.clock
        clock.highest_ratio = max(clock.highest_ratio, np.max(self.ratios[GIVEN], where=~quiet, initial=0.0))

    @property
    def cells_to_reject(self) -> np.ndarray:
        """Cells of catenaries above REJECT_RATIO since the last review."""
        above = ~(self.ratios <= REJECT_RATIO).all(axis=0) & ~self.layout.rod & (self.given >= 0)
        return np.flatnonzero(above[self.base_of_cell])

    def cells_near_threshold(self, cell: int) -> np.ndarray:
        """Cells near one where a step failed and a criterion is above its `off`: more rod may help."""
        j = self.base_of_cell[cell]
        near = np.arange(max(j - 1, 0), min(j + 2, self.layout.rod.size))
        asks = ~(self.ratios[:, near] <= OFF[:, None]).all(axis=0) & ~self.layout.rod[near]
        return np.flatnonzero(np.isin(self.base_of_cell, near[asks]))

    # --- proposing -----------------------------------------------------------------------------

    def review_due(self, t: float) -> bool:
        """Whether a review is due: a catenary asks, a rod has been blended out, or some time has passed."""
        return bool(self.zones.clock.highest_ratio > 1.0 or t >= self.zones.clock.next_review)

    def same_zones(self) -> Change:
        """A change of cells alone."""
        none = np.zeros_like(self.layout.rod)
        return Change(self.layout.rod, (), none, none, same=True)

    def review(self, t: float, state: State) -> Change | None:
        """The change that follows from the ratios since the last review; None: no change."""
        rod = self.layout.rod
        self._table.bind(old=state, zones=self.zones)
        self.bind_review(self._review, self._table.numbers)
        review_zones(self._review.numbers, float(t))
        new, change = self._review_room[2][3] | (self.leaving & (self.grown > 0.0)), None
        if (new != rod).any():
            urgent = spread((self.ratios[SLACK] > 1.0) | self._losing_tension(state), self.layout.base, self.buffer)
            change = Change(new, tuple(self._reasons(rod, new)), urgent, np.zeros_like(rod))
        self._reset_ratios()
        return change

    def bind_review(self, table: Table, zone_table: NDArray[np.int64]) -> None:
        """Bind what reviews of zones (kernels.mesh.zone_plan) know; zone_table: of their ZoneJob."""
        n = self.given.size
        if self._review_room[0].size != n:
            self._review_room = np.zeros(n), np.zeros(n), np.zeros((4, n), bool)
        next_below, wait, flags = self._review_room
        table.bind(zone_table=zone_table, base=self.layout.base, given=self.given.astype(np.int64), buffer=self.buffer)
        table.bind(below_since=self.below_since, release_cause=self.release_cause, wait_factor=self.wait_factor)
        table.bind(seen=self.seen, next_below=next_below, wait=wait, flags=flags, off=OFF, shortest=SHORTEST)
        table.bind(dwell=float(self.dwell), ramp_time=float(self.ramp_time), pause=1.0 / REVIEWS, held=int(self.held))
        table.bind(parts=BUFFER, light=1e-9 * self.scale, forced=FORCED_RATIO)

    def initial_rods(self, state: State) -> np.ndarray:
        """Base cells that ask to be rod, whatever they are, after `evaluate_criteria`; the ratios begin anew."""
        self.ratios[GIVEN, self.given > 0] = FORCED_RATIO
        if self.zones.counts.holds_twist or self.zones.counts.loaded:  # torque needs rods from end to end
            self.ratios[TORSION] = self.ratios[TORSION].max()
        np.maximum(self.ratios[BEND], self.foreseen, out=self.ratios[BEND])
        np.maximum(self.first, self.ratios, out=self.first)
        asks = wanted(self.ratios, np.zeros_like(self.layout.rod))
        asks = spread(asks, self.layout.base, self.buffers(state))
        self._reset_ratios()
        return np.asarray(tidied(asks, asks, SHORTEST) & (self.given >= 0))

    def joint_passed(self, change: Change) -> float | None:
        """Place, m, of the first joint that a rod grows past by a change; None: no rod does."""
        base, rod = self.layout.base, change.rod
        for why in change.reasons:
            if why.kind == "grow" or (why.kind == "retry" and not change.stiff[why.a : why.b].any()):
                if why.a > 0 and rod[why.a - 1]:
                    return float(base[why.a])
                if why.b < rod.size and rod[why.b]:
                    return float(base[why.b])
        return None

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
        """Base cells (n,) without weight, hence without a floor, that lose most of their tension within a ramp time."""
        if not (self.weightless and self.zones.clock.age > 0.0 and self.past.size):
            return np.zeros(self.layout.rod.size, bool)
        T = state.T + self.ramp_time / self.zones.clock.age * (state.T - self.past)
        falls = (T < LOST_TENSION * state.T) & (self.past > state.T) & (self.floor[:-1] < WEIGHTLESS * self.scale)
        # not by `layout`, which cells that follow leave behind between two reviews
        return np.asarray(np.bincount(self.zones.kinds.base_of_cell, falls, self.layout.rod.size) > 0.0)

    def buffers(self, state: State) -> Floats:
        """Rod (n,) m on either side of what asks for it, at the tensions of a state."""
        of, least = self.zones.kinds.base_of_cell, 1e-9 * self.scale
        reach(state.T, of, self.EI, self.w, self.floor, BUFFER, least, self.buffer)
        if z.asks_layers(self.zones):
            widen(self.buffer, self.zones.H)
        return self.buffer

    def _reset_ratios(self) -> None:
        np.maximum(self.seen, self.ratios, out=self.seen)
        self.ratios[:] = 0.0

    def reset(self) -> None:
        """Nothing is known of earlier steps: all ratios are zero, and nothing has been below or let go."""
        self.ratios[:] = self.seen[:] = 0.0
        self.below_since[:], self.released[:] = np.inf, -np.inf

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
        highest = self.ratios.max(axis=0)
        for a, b in pairwise(edges(np.where(rod == new, 0, np.where(new, 1, -1)))):
            if rod[a] == new[a]:
                continue
            beside = (a > 0 and rod[a - 1] and new[a - 1]) or (b < rod.size and rod[b] and new[b])
            if new[a]:
                kind = "grow" if beside else "split"
                asks = np.flatnonzero(highest > 1.0)
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
                which, ratios = self.release_cause[0, a:b].astype(int), self.release_cause[1, a:b]
                j = a + int(np.argmax(ratios / OFF[which]))
                c, value = int(self.release_cause[0, j]), float(self.release_cause[1, j])
                name, off = CRITERIA[c].name, float(OFF[c])
                time = f"calm for {self.dwell * self.wait_factor[j]:.3g} s and blended out"
                text = f"{time}; {name} {value:.3g}, threshold {off:g}"
                out.append(Reason(a, b, "shrink" if beside else "merge", text, name, value, off))
        return out

    # --- ramps -----------------------------------------------------------------------------------

    @property
    def ramping(self) -> bool:
        return bool(self.zones.counts.going or self.zones.counts.coming)

    def stiffness_shares(self) -> Floats:
        """Part of its bending stiffness that each node has now (N+1,); overwritten by the next call.

        Over a ramp time: within sqrt(m EI)/T, which is enough for a wave of bending, axial waves would ring.  Where
        tension goes there is less time, and nothing that could ring.
        """
        zones = self.zones
        shares(self.grown, self.leaving, zones.ramp_factor, 0.0, zones.kinds.base_of_cell, zones.share)
        return zones.share

    def _update_ramping(self) -> None:
        self.zones.counts.coming = bool((self.layout.rod & ~self.leaving & (self.grown < 1.0)).any())
