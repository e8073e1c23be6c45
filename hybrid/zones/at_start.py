"""Zones that move, as they are at the start: those of the equilibrium, or all rod."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from itertools import pairwise

import numpy as np

from hybrid.errors import ComputationError, Outcome
from hybrid.kernels.march.zone_torque import carry_torque
from hybrid.kernels.mesh.cell_lengths import IDLE_STEPS
from hybrid.kernels.mesh.zone_criteria import CRITERIA
from hybrid.kernels.state.report import PLANAR
from hybrid.kernels.state.state import Ends, Line, State
from hybrid.model.build import Model, given_zones
from hybrid.model.mesh import edges
from hybrid.model.nearby import FEWER, MANY, picked
from hybrid.model.payout import PayoutPlan, fastest
from hybrid.model.resolution import Resolution, follows_curvature
from hybrid.scene.analysis import AdaptiveModel
from hybrid.scene.motion_checks import longest_period
from hybrid.scene.schema import LineScene
from hybrid.zones.change import ZoneSwitching, on_layout
from hybrid.zones.criteria import UserCriterion, shares_asked
from hybrid.zones.manager import Allowed, DomainManager, Times

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
    manager = DomainManager.on_layout(
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
