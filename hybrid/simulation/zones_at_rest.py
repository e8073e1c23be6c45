"""Zones and cells at rest: an equilibrium of lines on the cells, and with the rods, that it asks for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from hybrid.errors import ComputationError, Outcome
from hybrid.kernels.junctions.joined_lines import TURNS
from hybrid.kernels.state.report import SELF_CONTACT
from hybrid.model.build import Model
from hybrid.model.nearby import refined
from hybrid.model.network import NetworkModel
from hybrid.scene.analysis import AdaptiveModel
from hybrid.scene.network import Network
from hybrid.scene.schema import LineScene
from hybrid.simulation.equilibrium import equilibrium_of, joined_lines, solve_from
from hybrid.simulation.run_start import nearness_in
from hybrid.solve.lines_at_rest import LinesAtRest
from hybrid.solve.stepper import NetworkState
from hybrid.zones.change import (
    MOST_ROUNDS,
    STRICTER,
    manager_for,
    on_fewer,
    on_layout,
    planned_cells,
    with_fewer_cells,
    zones_without_equilibrium,
)
from hybrid.zones.manager import DomainManager, UserCriterion, of_line

Rest = tuple[NetworkModel, LinesAtRest]


def following(model: NetworkModel, managers: Mapping[int, DomainManager]) -> dict[int, DomainManager]:
    """Those of lines whose cells follow the curvature from the start on; at a winch they begin to with the motion."""
    share = {k: x.zones.clock.share for k, x in managers.items()}
    return {k: x for k, x in managers.items() if share[k] > 0.0 and model.models[k].payout is None}


def equilibrium_on_cells(
    network: Network, model: NetworkModel, managers: Mapping[int, DomainManager], t: float
) -> Rest:
    """Equilibrium of a network, rod wherever it may be; of lines with managers on the cells that it asks for.

    managers: by number of the line, of cells that follow.  Lines that touch themselves, are turned or are catenary
    somewhere begin on their shortest cells; so do all where there is no equilibrium on fewer, or lines touch.
    """
    fewer = {k: x for k, x in managers.items() if _may_have_fewer(model, k, x)}
    if fewer:
        try:
            few = model.with_lines({k: with_fewer_cells(model.models[k]) for k in fewer})
            found = equilibrium_of(network, few, t)
            if not found.settled:
                model, found = _on_planned_cells(few, found, fewer, t)
                return _with_catenaries(model, found, managers, t)
        except ComputationError:
            pass
    for k, manager in managers.items():
        manager.set_layout(model.models[k].zoned)
    return _with_catenaries(model, equilibrium_of(network, model, t), managers, t)


def _may_have_fewer(model: NetworkModel, k: int, manager: DomainManager) -> bool:
    bound = any(model.turns[k]) or model.models[k].line.bits & SELF_CONTACT
    return bool((manager.given >= 0).all()) and not bound


def _on_planned_cells(model: NetworkModel, found: LinesAtRest, managers: Mapping[int, DomainManager], t: float) -> Rest:
    """The equilibrium with cells as its curvature asks for, from one with others.  ComputationError: there is none."""
    before = {k: planned_cells(model.models[k], x, found.state.lines[k], t) for k, x in managers.items()}
    for _ in range(MOST_ROUNDS):
        others, states = dict[int, Model](), [*found.state.lines]
        for k, here in before.items():
            old = model.models[k]
            others[k] = on_layout(old, old.zoned._replace(here=here))
            states[k] = refined(states[k], old.line, others[k].line)
        model = model.with_lines(others)
        start = NetworkState(states, found.state.bodies)
        found = solve_from(found, model, t, found.bodies, start, "the equilibrium of other cells")
        wanted = {k: planned_cells(model.models[k], x, found.state.lines[k], t) for k, x in managers.items()}
        if not any((here & ~before[k]).any() for k, here in wanted.items()):
            return model, found
        before = {k: here | before[k] for k, here in wanted.items()}
    raise ComputationError(Outcome.NOT_CONVERGED, None, 0.0, "cells become shorter and shorter")


def _with_catenaries(model: NetworkModel, found: LinesAtRest, managers: Mapping[int, DomainManager], t: float) -> Rest:
    """The same where scenes say that lines are catenary, in the equilibrium with that."""
    most = _most_rod(model, found, managers, t)
    for k, manager in managers.items():
        if not (manager.given >= 0).all():
            manager.set_layout(most[0].models[k].zoned)
    return most


class Start(NamedTuple):
    """Zones of a network at rest."""

    model: NetworkModel
    found: LinesAtRest | None  # None: a motion begins as the scene says
    managers: Mapping[int, DomainManager]  # by the number of the line


def managers_for(
    scenes: Mapping[str, LineScene], model: NetworkModel, criterion: UserCriterion | None
) -> dict[int, DomainManager]:
    """The domain managers of lines that are rod wherever they may be; at a clamp to what is free they stay rod."""
    managers = {
        k: manager_for(scenes[name], x, model.resolution.lines[name], of_line(criterion, name))
        for k, (name, x) in enumerate(zip(model.names, model.models, strict=True))
        if isinstance(scenes[name].model, AdaptiveModel)
    }
    for k, manager in managers.items():
        manager.given[[0, -1]] = np.where(model.seats[k, :, TURNS] != 0.0, 1, manager.given[[0, -1]])
    return managers


def start_at_rest(
    network: Network, scenes: Mapping[str, LineScene], model: NetworkModel, moves: bool, criterion: UserCriterion | None
) -> Start:
    """Equilibrium with its zones and cells; moves: whether a motion begins there, else it has loads of full size."""
    t, managers = (0.0 if moves else np.inf), managers_for(scenes, model, criterion)
    follow = following(model, managers) if moves else {}
    rest = equilibrium_on_cells(network, model, follow, t)
    return Start(*_zones_at_rest(*rest, {k: x for k, x in managers.items() if k not in follow}, t), managers)


def _zones_at_rest(model: NetworkModel, found: LinesAtRest, managers: Mapping[int, DomainManager], t: float) -> Rest:
    """Zones for the equilibrium of a network whose lines with managers are all rod: rod only where it is needed.

    As of one cable (zones.change): where the two equilibria are further apart than the tolerance of a line
    criteria become stricter, and where that does not help zones stay rod.
    """
    allowed = {k: float(manager.zones.clock.tolerance) for k, manager in managers.items()}
    most, rest = _most_rod(model, found, managers, t)
    try:
        for part in STRICTER:
            for k, manager in managers.items():
                manager.set_layout(model.models[k].zoned)
                manager.zones.clock.tolerance = part * allowed[k]
            answer = _within(model, found, managers, t)
            if answer is None:
                break
            if all(_apart(k, most, rest, *answer) <= allowed[k] for k in managers):
                return answer
        held = answer is not None
    except ComputationError:
        held = True
    for k, manager in managers.items():
        manager.held |= held
        manager.zones.clock.tolerance = allowed[k] if held else manager.zones.clock.tolerance
        manager.set_layout(most.models[k].zoned)
    return most, rest


def _most_rod(model: NetworkModel, found: LinesAtRest, managers: Mapping[int, DomainManager], t: float) -> Rest:
    """The most rod that scenes let lines have, and its equilibrium, from that of lines that are all rod."""
    free = {k: manager.given >= 0 for k, manager in managers.items()}
    some = {k: x for k, x in free.items() if not x.all()}
    return _with_rods(model, found, some, t) if some else (model, found)


def _with_rods(model: NetworkModel, found: LinesAtRest, rods: Mapping[int, np.ndarray], t: float) -> Rest:
    """Lines of which these base cells are rod, by their numbers, at rest, from lines that are all rod."""
    models, states = dict[int, Model](), [*found.state.lines]
    for k, rod in rods.items():
        full = model.models[k]
        models[k] = on_layout(full, full.zoned._replace(rod=rod))
        states[k] = on_fewer(states[k], full.line, models[k].line, full.ends.at_time(t))
    other, start = model.with_lines(models), NetworkState(states, found.state.bodies)
    return other, solve_from(found, other, t, found.bodies, start, "the equilibrium of rods")


def zones_as_placed(
    scenes: Mapping[str, LineScene], model: NetworkModel, criterion: UserCriterion | None
) -> tuple[NetworkModel, dict[int, DomainManager]]:
    """Zones of a start that is no equilibrium, as of one cable: rod, but for what a line wants to be catenary."""
    managers = managers_for(scenes, model, criterion)
    models = {k: zones_without_equilibrium(model.models[k], manager) for k, manager in managers.items()}
    return model.with_lines(models), managers


def _within(
    model: NetworkModel, found: LinesAtRest, managers: Mapping[int, DomainManager], t: float
) -> tuple[NetworkModel, LinesAtRest] | None:
    """Zones that satisfy the criteria in their own equilibrium; None: all rod.  ComputationError: there is none."""
    rods = _asked(managers, model, found, t)
    for _ in range(MOST_ROUNDS):
        if all(rod[managers[k].given >= 0].all() for k, rod in rods.items()):
            return None
        other, answer = _with_rods(model, found, rods, t)
        for k, manager in managers.items():
            manager.set_layout(other.models[k].zoned)
        more = {k: rods[k] | asked for k, asked in _asked(managers, other, answer, t).items()}
        if all((more[k] == rods[k]).all() for k in managers):
            return other, answer
        rods = more
    return None


def _asked(
    managers: Mapping[int, DomainManager], network: NetworkModel, found: LinesAtRest, t: float
) -> dict[int, np.ndarray]:
    """Base cells that the criteria want to be rod in an equilibrium, by number of the line."""
    near, rods = nearness_in(network, joined_lines(network, t), found, t), {}
    for k, manager in managers.items():
        model, state = network.models[k], found.state.lines[k]
        manager.near = near.get(k, np.zeros(0))
        manager.evaluate_criteria(model.line, model.sea.at_time(t), model.ends.at_time(t), state, 0.0)
        rods[k] = manager.initial_rods(state)
    return rods


def _apart(k: int, model: NetworkModel, found: LinesAtRest, other: NetworkModel, answer: LinesAtRest) -> float:
    """Largest distance (m) of base nodes of a line between two equilibria, the first of them all rod."""
    full, few = model.models[k].layout, other.models[k].layout
    assert full is not None and few is not None
    r, there = found.state.lines[k].r[full.first], answer.state.lines[k].r[few.first]
    return float(np.linalg.norm(r - there, axis=1).max())
