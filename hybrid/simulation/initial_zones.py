"""Zones that move, as they are at the start: those of the equilibrium, or all rod."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from itertools import pairwise

import numpy as np

from hybrid.adapt.manager import Allowed, DomainManager, Times
from hybrid.adapt.user_criterion import UserCriterion
from hybrid.errors import ComputationError, Outcome
from hybrid.kernels.march.torque_transfer import carry_torque
from hybrid.kernels.mesh.cell_errors import CURVATURE, MOMENT, TENSION
from hybrid.kernels.mesh.cell_lengths import CALM_STEPS
from hybrid.kernels.mesh.criteria import CRITERIA
from hybrid.kernels.state.forces import PLANAR, SELF_CONTACT
from hybrid.kernels.state.state import Ends, Line, State
from hybrid.model.build import Model, given_zones
from hybrid.model.coarsen import FEWER, picked, refined
from hybrid.model.layout import Layout, edges
from hybrid.model.payout_law import fastest
from hybrid.model.resolution import Resolution, follows_curvature, requested_accuracy
from hybrid.scene.accuracy import ROUGHEST
from hybrid.scene.motion_checks import longest_period
from hybrid.scene.schema import AdaptiveModel, LineScene
from hybrid.simulation.contact_equilibrium import nearness
from hybrid.simulation.equilibrium import MANY, equilibrium_of, solve_like
from hybrid.simulation.zone_switching import ZoneSwitching, on_layout
from hybrid.solve.statics import Equilibrium

# Hold time of a scene that does not say: a part of the time of a transverse wave along the line, and some time steps;
# and of a line that moves to and fro so many periods, lest what is let go comes back, up to so many ramp times.
HOLD, LEAST_STEPS_HELD = 0.25, 20
PERIODS_HELD, MOST_HELD = 2.0, 10.0
# Part of a period over which the way of a contact edge is foreseen: from the middle of its way to where it turns round.
STRAIGHT = 0.25
# Bending comes and goes no slower than in so many times that, and no faster than in so many steps, whatever is asked.
SLOWEST, FASTEST = 2.0, 10
# Parts of the tolerance at which zones for an equilibrium are sought, before all becomes rod.
STRICTER = (1.0, 0.5, 0.25)
# Rounds of zones and equilibrium at the start: each only adds rod, so they end.
MOST_ROUNDS = 10
# Share of what is asked of tension, curvature or moment along the line that leaving bending out may make: as much as
# finer zones are planned to make (accuracy.refinement), so that they are strict enough from the start.
OF_ALONG = 0.25


def zones_at_start(
    scene: LineScene,
    model: Model,
    resolution: Resolution,
    t: float,
    criterion: UserCriterion | None,
    at_rest: bool = False,
) -> tuple[Model, Equilibrium | None, ZoneSwitching]:
    """Zones, equilibrium if one is asked for, and what will move the zones."""
    assert isinstance(scene.model, AdaptiveModel)
    manager, equilibrium = manager_for(scene, model, resolution, criterion), None
    follows = follows_curvature(scene) and not at_rest and model.payout is None
    if follows and scene.initial.kind == "equilibrium":
        model, equilibrium = _with_followed_cells(scene, model, manager, t)
    elif at_rest or scene.initial.kind == "equilibrium":
        model, equilibrium = equilibrium_zones(model, manager, t, equilibrium_of(scene, model, t))
    else:
        model = zones_without_equilibrium(model, manager)
    return model, equilibrium, ZoneSwitching(model, manager)


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


def _with_followed_cells(scene: LineScene, model: Model, manager: DomainManager, t: float) -> tuple[Model, Equilibrium]:
    """Equilibrium of a line whose cells follow the curvature, on the cells that it asks for; rod wherever it may be.

    A line that touches itself, is turned, or has no equilibrium on these cells, begins on the shortest ones.
    """
    assert model.layout is not None
    free = manager.given >= 0
    if free.all() and not scene.ends.turns and not model.line.bits & SELF_CONTACT:
        try:
            fewer = with_fewer_cells(model)
            found = equilibrium_of(scene, fewer, t)
            if not found.touch.size:
                return _on_planned_cells(fewer, found, manager, t)
        except ComputationError:
            manager.set_layout(model.layout)
    found = equilibrium_of(scene, model, t)
    if not free.all():
        fewer = on_layout(model, model.layout._replace(rod=free))
        found = solve_like(fewer, t, on_fewer(found.state, model.line, fewer.line, model.ends.at(t)), found)
        assert fewer.layout is not None
        manager.set_layout(fewer.layout)
        return fewer, found
    return model, found


def with_fewer_cells(model: Model) -> Model:
    """All rod, with every fourth node of the finest mesh where that has many cells: its equilibrium is found sooner."""
    assert model.layout is not None
    here, ends = np.zeros(model.layout.starts[-1] + 1, bool), model.ends.values
    here[:: FEWER if model.cells > MANY else 1] = True
    new = on_layout(model, model.layout._replace(here=here))
    others = tuple((name, on_fewer(x, model.line, new.line, ends)) for name, x in model.other_starts)
    return replace(new, start=on_fewer(model.start, model.line, new.line, ends), other_starts=others)


def _on_planned_cells(model: Model, found: Equilibrium, manager: DomainManager, t: float) -> tuple[Model, Equilibrium]:
    """The equilibrium with cells as its curvature asks for, from one with others; ComputationError: there is none."""
    before = None
    for _ in range(MOST_ROUNDS):
        assert model.layout is not None
        here = planned_cells(model, manager, found.state, t)
        if before is not None and not (here & ~before).any():
            return model, found
        before = here if before is None else here | before
        new = on_layout(model, model.layout._replace(here=before))
        answer = solve_like(new, t, refined(found.state, model.line, new.line), found)
        model, found = new, answer
    raise ComputationError(Outcome.NOT_CONVERGED, None, 0.0, "cells become shorter and shorter")


def planned_cells(model: Model, manager: DomainManager, state: State, t: float) -> np.ndarray:
    """Places of the finest mesh where a state at rest under the loads of t wants nodes, of rods as they are."""
    assert model.layout is not None
    sea, ends = model.sea.at(t), model.ends.at(t)
    manager.set_layout(model.layout)
    manager.evaluate_criteria(model.line, sea, ends, state, 0.0)
    switching = ZoneSwitching(model, manager)
    for _ in range(CALM_STEPS):  # for which cells must have been too short
        here = switching.plan(model.layout.rod, sea, ends, state)
    manager.reset()
    manager.zones.calm[:] = 0
    assert here is not None
    return here


def manager_for(
    scene: LineScene, model: Model, resolution: Resolution, criterion: UserCriterion | None
) -> DomainManager:
    """The domain manager of a model that is rod wherever it may be."""
    wanted = scene.model
    assert isinstance(wanted, AdaptiveModel) and model.layout is not None
    step = resolution.step if resolution.local is None else 0.0
    pace = max(HOLD * model.time_scale, LEAST_STEPS_HELD * step)
    period = longest_period(scene)
    hold, ramp = max(pace, min(PERIODS_HELD * period, MOST_HELD * pace)), pace
    if wanted.hold_time is not None:
        hold, ramp = wanted.hold_time, min(max(wanted.hold_time, FASTEST * step), SLOWEST * pace)
    curvature_error = wanted.curvature_error if follows_curvature(scene) else None
    foreseen = min(ramp, STRAIGHT * period) if period and curvature_error is None else ramp
    if curvature_error is not None and wanted.hold_time is None and model.payout is None:
        hold = math.inf  # a rod that bends little has cells as long as a catenary: a change of zones costs more
    asked = shares_asked(scene, curvature_error, resolution.bends)
    allowed = Allowed(resolution.zones * model.length, curvature_error, asked, resolution.fineness)
    times = Times(hold, ramp, foreseen, period if curvature_error is None else 0.0)
    given = _given(scene, model, ramp)
    manager = DomainManager(
        model.cable, model.layout, given, model.tension_scale, allowed, times, criterion, model.on_base
    )
    manager.load(model.ends.moments)
    base = model.layout.base
    for a, b, lack in resolution.rods:
        there = (base[:-1] < b) & (base[1:] > a)
        manager.foreseen[there] = np.maximum(manager.foreseen[there], lack)
    return manager


def _given(scene: LineScene, model: Model, pace: float) -> np.ndarray:
    """(n,) of base cells: 1 rod, -1 catenary, 0 adaptive; pace: s, ramp time of bending stiffness."""
    assert model.layout is not None
    if model.payout is None:
        return given_zones(scene, model.layout)
    from hybrid.simulation.payout_zones import rods_at_winch

    paid = model.payout
    return rods_at_winch(scene, paid, model, paid.count(paid.first), pace, fastest(paid.law))


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


def equilibrium_zones(model: Model, manager: DomainManager, t: float, found: Equilibrium) -> tuple[Model, Equilibrium]:
    """Zones for an equilibrium, and the equilibrium: rod only where the criteria ask for it.

    found: the equilibrium of the model, which is all rod.  The two are compared: where they are further apart than
    the tolerance (criteria are estimates, and slack has many equilibria) criteria become stricter, for all of the run;
    where that does not help, zones stay rod.
    """
    assert model.layout is not None
    most, equilibrium = model, found
    free = manager.given >= 0
    if not free.all():  # the most rod that the scene lets it have
        most = on_layout(model, model.layout._replace(rod=free))
        equilibrium = solve_like(most, t, on_fewer(found.state, model.line, most.line, model.ends.at(t)), found)
    assert most.layout is not None
    allowed = manager.tolerance
    try:
        for part in STRICTER:
            manager.set_layout(model.layout)
            manager.tolerance = part * allowed
            answer = _zones_within(model, found, manager, t)
            if answer is None:
                break
            if _difference(equilibrium.state, most.layout, answer, t) <= allowed:
                return answer
        else:
            manager.held = True
    except ComputationError:
        manager.held = True
    if manager.held:
        manager.tolerance = allowed
    manager.set_layout(most.layout)
    return most, equilibrium


def zones_without_equilibrium(model: Model, manager: DomainManager) -> Model:
    """A start that is no equilibrium is rod, but for what the scene wants to be catenary."""
    assert model.layout is not None
    free = manager.given >= 0
    if free.all():
        return model
    new = on_layout(model, model.layout._replace(rod=free))
    manager.set_layout(model.layout._replace(rod=free))
    return replace(new, start=on_fewer(model.start, model.line, new.line, model.ends.values))


def _zones_within(
    model: Model, found: Equilibrium, manager: DomainManager, t: float
) -> tuple[Model, Equilibrium] | None:
    """Zones that satisfy the criteria in their own equilibrium; None: all rod.  ComputationError: there is none."""
    assert model.layout is not None
    full = found.state
    rod = _rods(model, manager, full, t)
    for _ in range(MOST_ROUNDS):
        if rod[manager.given >= 0].all():
            return None
        layout = model.layout._replace(rod=rod)
        new = on_layout(model, layout)
        answer = solve_like(new, t, on_fewer(full, model.line, new.line, model.ends.at(t)), found)
        manager.set_layout(layout)
        more = rod | _rods(new, manager, answer.state, t)
        if (more == rod).all():
            return new, answer
        rod = more
    return None


def _rods(model: Model, manager: DomainManager, state: State, t: float) -> np.ndarray:
    """Base cells (n,) that ask to be rod in a state at rest; what is near itself does where contact is asked for."""
    manager.near = nearness(model, t, state) if model.line.bits & SELF_CONTACT else np.zeros(0)
    manager.evaluate_criteria(model.line, model.sea.at(t), model.ends.at(t), state, 0.0)
    return manager.initial_rods(state)


def _difference(full: State, layout: Layout, answer: tuple[Model, Equilibrium], t: float) -> float:
    """Largest distance, m, of base nodes between the equilibrium of a rod and another."""
    model, found = answer
    assert model.layout is not None
    return float(np.linalg.norm(full.r[layout.first] - found.state.r[model.layout.first], axis=1).max())


def on_fewer(state: State, full: Line, line: Line, ends: Ends) -> State:
    """The state of a line at the nodes of one that has fewer.  ComputationError: it folds onto itself there."""
    found = picked(line, state, np.searchsorted(full.s, line.s - 1e-9 * full.s[-1]))
    if found is None:
        raise ComputationError(Outcome.NOT_CONVERGED, None, 0.0, "base nodes lie at the same place in the start")
    if line.torsion.size and not line.bits & PLANAR:
        carry_torque(full, line, ends, state, found, np.zeros(full.s.size + 1))
    return found
