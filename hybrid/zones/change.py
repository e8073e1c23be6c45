"""Zones that move: as they are at the start, and changes of a model, its state and its books.

At the start they are those of the equilibrium, or all rod; later the domain manager proposes them.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from hybrid.errors import ComputationError, Outcome
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.march.zone_torque import carry_torque
from hybrid.kernels.mesh.cell_lengths import IDLE_STEPS
from hybrid.kernels.mesh.zone_criteria import CRITERIA
from hybrid.kernels.mesh.zone_plan import blank_review_job, quiet_review
from hybrid.kernels.mesh.zone_step import REJECT_RATIO, Zones, blank_zone_job, plan_nodes, read_arcs
from hybrid.kernels.state.report import PLANAR
from hybrid.kernels.state.state import Ends, Floats, Line, Sea, State
from hybrid.model.build import Model, given_zones
from hybrid.model.material import nodes_at
from hybrid.model.mesh import Layout, edges
from hybrid.model.nearby import FEWER, MANY, picked
from hybrid.model.payout import PayoutPlan, fastest
from hybrid.model.resolution import Resolution, follows_curvature
from hybrid.scene.analysis import AdaptiveModel
from hybrid.scene.motion_checks import longest_period
from hybrid.scene.schema import LineScene
from hybrid.solve.stepper import NetworkTaken
from hybrid.store.integrity import matched
from hybrid.zones.manager import Allowed, Change, DomainManager, Times, UserCriterion, shares_asked

# A stretch that has become chords, or arcs, is let go to its true length over this many ramp times.
LETTING_GO = 1.0
NONE, NO_STRAIN = np.zeros(0, int), np.zeros((0, 3))
LONGEST_IN_RAMP = 0.1  # of the time in which bending comes and goes: a step may not be longer meanwhile
READY = 2.0  # times as long may it be before: a step that is much shorter than the one before is damped much
# What a checkpoint holds of cells on their way to true lengths.
RELAXING = ("lack", "rate", "since", "keeps")
# Repetitions of one step with more rod.
MOST_RESCUES = 20


def on_layout(model: Model, layout: Layout) -> Model:
    """The same model with other zones; its start is not touched."""
    line = model.line_maker.line(layout, model.line.bits, model.line.plane, model.line.moved)
    return replace(model, line=line, zones=layout.zones, layout=layout, sea=model.sea.on(line.h.size))


class ZoneSwitching:
    """The zones of one motion."""

    def __init__(self, model: Model, manager: DomainManager) -> None:
        self.model, self.manager = model, manager
        self.table = Table(blank_zone_job)  # of the compiled run
        self._plan_table = Table(blank_zone_job)
        self._review = Table(blank_review_job)
        self.guided = np.array(model.cable.held_tangent, float)
        self.use_base(model)
        self.set_cells(model.line)

    def use_base(self, model: Model) -> None:
        """Go on with a model whose base cells may be others; zones know of its cells, or will."""
        self.model = model
        self.kinks = np.zeros(model.zoned.base.size, bool)
        self.kinks[nodes_at(model.cable.at, model.zoned.base)] = True

    def set_cells(self, line: Line) -> None:
        """The line has all of its stiffness, and cells whose true lengths are as long as they are apart."""
        zones = self.zones
        zones.stiff[:], zones.true[:], zones.lengths[:] = line.kb, np.diff(line.s), line.h

    @property
    def zones(self) -> Zones:
        """What the compiled run knows of the zones."""
        return self.manager.zones

    @property
    def compiled(self) -> bool:
        """Whether the compiled run does all that zones ask of a step; else it asks Python at every step."""
        return self.manager.user is None

    def let_review(self) -> None:
        """Steps review zones themselves where that changes nothing; of a line that is paid out Python does."""
        review = 0
        if self.compiled and self.model.payout is None:
            self.manager.bind_review(self._review, self.table.numbers)
            review = quiet_review.address(self._review.numbers)
        self.table.bind(review_table=self._review.numbers, review=review)

    def checkpoint(self) -> dict[str, Any]:
        """What is under way: bending, lengths, and what the manager remembers."""
        line, zones = self.model.line, self.zones
        relaxing = {name: getattr(zones, name) for name in RELAXING} if zones.counts.relaxing else None
        following = None
        if zones.clock.share > 0.0:
            following = {"true": zones.true, "idle_steps": zones.idle_steps, "waves": zones.waves}
        found: dict[str, Any] = {"following": following, "manager": self.manager.checkpoint()}
        found |= {"h": line.h, "kb": line.kb, "force": line.force, "relaxing": relaxing}
        return found | {"strain": zones.strain[1] if zones.counts.strained else NO_STRAIN}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on as `checkpoint` has said; ValueError or ResultError where that cannot be."""
        line, relaxing, strain = self.model.line, saved["relaxing"], saved["strain"]
        self.manager.restore(saved["manager"])
        if not (
            saved["h"].min() > 0.0 and saved["kb"].min() >= 0.0 and strain.shape in (NO_STRAIN.shape, line.kb.shape)
        ):
            raise ValueError("lengths, stiffness or strains that no line has")
        zones, cells = self.zones, np.zeros(line.h.size)
        at_rest = {"lack": cells, "rate": cells, "since": cells - np.inf, "keeps": cells > 0.0}
        now = at_rest if relaxing is None else matched(relaxing, at_rest, "relaxing")
        for name, x in now.items():  # of a run that has gone on since, too
            getattr(zones, name)[:] = x
        zones.counts.relaxing = relaxing is not None
        if (following := saved["following"]) is not None:
            needs = {"true": zones.true, "idle_steps": zones.idle_steps, "waves": zones.waves}
            found = matched(following, needs, "following")
            if not (found["true"].min() > 0.0 and found["waves"].min() >= 0.0):
                raise ValueError("lengths that no line has")
            zones.true[:], zones.idle_steps[:], zones.waves[:] = found["true"], found["idle_steps"], found["waves"]
        self.let_review()  # whether rods may go is another matter now
        line.h[:], line.kb[:], line.force[:] = saved["h"], saved["kb"], saved["force"]
        zones.lengths[:] = line.h
        zones.strain[1], zones.counts.strained = strain if strain.size else 0.0, bool(strain.size)

    def begin(self, ends: Ends, state: State) -> None:
        """Weigh the criteria of the first state."""
        self.manager.reset()
        self.manager.evaluate_criteria(self.model.line, self.model.sea.values, ends, state, 0.0)
        zones = self.zones
        if zones.clock.share > 0.0:  # chords become as long as arcs within a ramp time
            self._plan_table.bind(line=self.model.line, ends=ends, new=state, zones=zones)
            read_arcs(self._plan_table.numbers)
            zones.lack[:], zones.since[:] = zones.true - self.model.line.h, 0.0
            zones.counts.relaxing = 1

    def rescue(self, how: NetworkTaken, end: float, tried: State, rescues: int) -> Change | None:
        """More rod for a step to `end` (s) that failed or took a catenary too far; None: as it is.

        tried: the state that the step led to; rescues: of this step, so far.
        """
        line, manager, most = self.model.line, self.manager, MOST_RESCUES
        if how.outcome == Outcome.OK:
            if manager.user is not None:
                manager.ask_user(line, tried, end)
            cells = manager.cells_to_reject if self.zones.clock.highest_ratio > REJECT_RATIO else NONE
            why = "a step would have left it a catenary far beyond its criterion; the step is repeated"
        elif how.outcome == Outcome.SLACK:
            cells = np.flatnonzero((line.spin == 0) & (self.model.slack_floor >= tried.T))
            why = "a step would have left it a catenary without tension; the step is repeated"
        else:
            cells = manager.cells_near_threshold(min(max(how.where, 0), self.model.cells - 1))
            why = f"a step failed here ({how.outcome.cause}); it is repeated"
            most = 1  # after that, a smaller step
        return self._force_rod(cells, why) if rescues < most and cells.size else None

    def all_rod(self, how: NetworkTaken) -> Change | None:
        """The last resort of a step that fails however small: rod wherever the scene lets it be; None: it is."""
        why = f"steps fail here, however small ({how.outcome.cause}); repeated with rods everywhere"
        return self._force_rod(np.arange(self.model.cells), why)

    def _force_rod(self, cells: np.ndarray, why: str) -> Change | None:
        """Cells to be rod, with all of their stiffness; None: they are."""
        change = self.manager.force_rods(cells, why)
        return None if (change.rod == self.manager.layout.rod).all() and not change.stiff.any() else change

    def book_step(self, t: float, state: State) -> Change | None:
        """After an accepted step: what should change."""
        manager = self.manager
        change = manager.review(t, state) if manager.review_due(t) else None
        if change is None and self.zones.counts.cells_due:
            change = manager.same_zones()
        return change

    def arcs_less_chords(self, state: State) -> Floats:
        """(N,) m, by how much the chords of cells are shorter than their arcs."""
        true = self.zones.true.copy()
        self._plan_table.bind(line=self.model.line, new=state, zones=self.zones)
        read_arcs(self._plan_table.numbers)
        less: Floats = np.diff(self.model.line.s) - self.zones.true
        self.zones.true[:] = true
        return less

    def release(self, k: int, model: Model) -> None:
        """End k (0 or 1) has been let go."""
        self.manager.release(k, model.cable)
        self.zones.stiff[-k] = model.line.kb[-k]
        self.model, self.guided[k] = model, 0.0

    def plan(self, rod: np.ndarray, sea: Sea, ends: Ends, state: State) -> np.ndarray | None:
        """Places of the finest mesh where nodes should be; None: cells do not follow the curvature."""
        zones = self.zones
        if not zones.clock.share > 0.0:
            return None
        zones.next_rod[:] = rod
        self._plan_table.bind(line=self.model.line, sea=sea, ends=ends, new=state, zones=zones)
        plan_nodes(self._plan_table.numbers)
        return zones.plan.copy()

    def clamps(self, ends: Ends) -> tuple[Floats, np.ndarray]:
        """First directors and tangents (2, 2, 3) of what holds the twist of ends; (2,) whether anything does."""
        cable = self.model.cable
        held = np.array([cable.held_twist[k] and cable.held_tangent[k] for k in (0, 1)], bool)
        return ends.frame.reshape(2, 3, 3)[:, :, ::2].transpose(0, 2, 1).copy(), held


# --- at the start ------------------------------------------------------------------------------

# Hold time of a scene that does not say: a part of the time of a transverse wave along the line, and some time steps;
# and of a line that moves to and fro so many periods, lest what is let go comes back, up to so many ramp times.
HOLD = 0.25
LEAST_STEPS_HELD = 20
PERIODS_HELD = 2.0
MOST_HELD = 10.0
# Part of a period over which the way of a contact edge is foreseen: from the middle of its way to where it turns round.
STRAIGHT = 0.25
# Bending comes and goes no slower than in so many times that, and no faster than in so many steps, whatever is asked.
SLOWEST = 2.0
FASTEST = 10
# Ramp times of bending stiffness within which a cell that is taken in must have become rod.
AHEAD = 2.0
# Parts of the tolerance at which zones for an equilibrium are sought, before all becomes rod.
STRICTER = (1.0, 0.5, 0.25)
# Rounds of zones and equilibrium at the start: each only adds rod, so they end.
MOST_ROUNDS = 10


def reasons_at_start(manager: DomainManager | None) -> str:
    """Why each first rod is one, as JSON: [from, to (m), {criterion: its ratio, the largest first}]; "": no zones.

    Without a criterion: rods that lie between others, or that were no equilibrium's, or that stay (`zones fixed`).
    """
    if manager is None:
        return ""
    found = []
    base, rod = manager.layout.base, manager.layout.rod
    for a, b in pairwise(edges(rod.astype(int))):
        if rod[a]:
            ratios = manager.first[:, a:b].max(axis=1)
            asks = {CRITERIA[c].name: float(f"{ratios[c]:.3g}") for c in np.argsort(-ratios) if ratios[c] > 1.0}
            found.append([float(base[a]), float(base[b]), asks])
    return json.dumps(found)


def with_fewer_cells(model: Model) -> Model:
    """All rod, with every fourth node of the finest mesh where that has many cells: its equilibrium is found sooner."""
    here, ends = np.zeros(model.zoned.starts[-1] + 1, bool), model.ends.values
    here[:: FEWER if model.cells > MANY else 1] = True
    new = on_layout(model, model.zoned._replace(here=here))
    others = tuple((name, on_fewer(x, model.line, new.line, ends)) for name, x in model.other_starts)
    return replace(new, start=on_fewer(model.start, model.line, new.line, ends), other_starts=others)


def planned_cells(model: Model, manager: DomainManager, state: State, t: float) -> np.ndarray:
    """Places of the finest mesh where a state at rest under the loads of t wants nodes, of rods as they are."""
    sea, ends = model.sea.at_time(t), model.ends.at_time(t)
    manager.set_layout(model.zoned)
    manager.evaluate_criteria(model.line, sea, ends, state, 0.0)
    switching = ZoneSwitching(model, manager)
    for _ in range(IDLE_STEPS):  # for which cells must have been too short
        here = switching.plan(model.zoned.rod, sea, ends, state)
    manager.reset()
    manager.zones.idle_steps[:] = 0
    assert here is not None
    return here


def manager_for(
    scene: LineScene, model: Model, resolution: Resolution, criterion: UserCriterion | None
) -> DomainManager:
    """The domain manager of a model that is rod wherever it may be."""
    wanted = scene.model
    assert isinstance(wanted, AdaptiveModel)
    step = resolution.step if resolution.local is None else 0.0
    shortest = max(HOLD * model.time_scale, LEAST_STEPS_HELD * step)
    period = longest_period(scene)
    hold, ramp = max(shortest, min(PERIODS_HELD * period, MOST_HELD * shortest)), shortest
    if wanted.hold_time is not None:
        hold, ramp = wanted.hold_time, min(max(wanted.hold_time, FASTEST * step), SLOWEST * shortest)
    curvature_error = wanted.curvature_error if follows_curvature(scene) else None
    foreseen = min(ramp, STRAIGHT * period) if period and curvature_error is None else ramp
    if curvature_error is not None and wanted.hold_time is None and model.payout is None:
        hold = math.inf  # a rod that bends little has cells as long as a catenary: a change of zones costs more
    asked = shares_asked(scene, curvature_error, resolution.bends)
    allowed = Allowed(resolution.zones * model.length, curvature_error, asked, resolution.fineness)
    times = Times(hold, ramp, foreseen, period if curvature_error is None else 0.0)
    given = _given(scene, model, ramp)
    manager = DomainManager(
        model.cable, model.zoned, given, model.tension_scale, allowed, times, criterion, model.on_base
    )
    manager.load(model.ends.moments)
    base = model.zoned.base
    for a, b, lack in resolution.rods:
        there = (base[:-1] < b) & (base[1:] > a)
        manager.foreseen[there] = np.maximum(manager.foreseen[there], lack)
    return manager


def rods_at_winch(scene: LineScene, plan: PayoutPlan, model: Model, count: int, ramp: float, rate: float) -> np.ndarray:
    """(N,) of base cells: 1 rod, -1 catenary, 0 adaptive, where the winch may reach them soon.

    count: material nodes that are out; ramp: s, ramp time of bending stiffness; rate: m/s.
    """
    given = given_zones(scene, model.zoned)
    near = plan.at_winch(count, AHEAD * ramp * abs(rate))
    given[near & (given == 0)] = 1
    return given


def _given(scene: LineScene, model: Model, ramp: float) -> np.ndarray:
    """(n,) of base cells: 1 rod, -1 catenary, 0 adaptive; ramp: s, ramp time of bending stiffness."""
    if model.payout is None:
        return given_zones(scene, model.zoned)
    paid = model.payout
    return rods_at_winch(scene, paid, model, paid.count(paid.first), ramp, fastest(paid.law))


def zones_without_equilibrium(model: Model, manager: DomainManager) -> Model:
    """A start that is no equilibrium is rod, but for what the scene wants to be catenary."""
    free = manager.given >= 0
    if free.all():
        return model
    new = on_layout(model, model.zoned._replace(rod=free))
    manager.set_layout(model.zoned._replace(rod=free))
    return replace(new, start=on_fewer(model.start, model.line, new.line, model.ends.values))


def on_fewer(state: State, full: Line, line: Line, ends: Ends) -> State:
    """The state of a line at the nodes of one that has fewer.  ComputationError: it folds onto itself there."""
    found = picked(line, state, np.searchsorted(full.s, line.s - 1e-9 * full.s[-1]))
    if found is None:
        raise ComputationError(Outcome.NOT_CONVERGED, None, 0.0, "base nodes lie at the same place in the start")
    if line.torsion.size and not line.bits & PLANAR:
        carry_torque(full, line, ends, state, found, np.zeros(full.s.size + 1))
    return found
