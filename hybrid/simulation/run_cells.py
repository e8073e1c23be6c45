"""Lines of several whose cells follow the curvature: an equilibrium on the cells that it asks for, as of one cable."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from hybrid.adapt.manager import DomainManager
from hybrid.errors import ComputationError, Outcome
from hybrid.kernels.state.report import SELF_CONTACT
from hybrid.kernels.state.state import State
from hybrid.model.build import Model
from hybrid.model.coarsen import refined
from hybrid.model.network import NetworkModel
from hybrid.scene.network_scene import Network
from hybrid.simulation.equilibrium import equilibrium_of, solve_from
from hybrid.simulation.initial_zones import MOST_ROUNDS, on_fewer, planned_cells, with_fewer_cells
from hybrid.simulation.zone_switching import on_layout
from hybrid.solve.joined import NetworkState
from hybrid.solve.lines_at_rest import LinesAtRest

Rest = tuple[NetworkModel, LinesAtRest]


def following(model: NetworkModel, managers: Mapping[int, DomainManager]) -> dict[int, DomainManager]:
    """Those of lines whose cells follow the curvature from the start on; at a winch they begin to with the motion."""
    share = {k: x.zones.clock.share for k, x in managers.items()}
    return {k: x for k, x in managers.items() if share[k] > 0.0 and model.models[k].payout is None}


def equilibrium_on_cells(system: Network, model: NetworkModel, managers: Mapping[int, DomainManager], t: float) -> Rest:
    """Equilibrium of a system, rod wherever it may be; of lines with managers on the cells that it asks for.

    managers: by number of the line, of cells that follow.  Lines that touch themselves, are turned or are catenary
    somewhere begin on their shortest cells; so do all where there is no equilibrium on fewer, or lines touch.
    """
    fewer = {k: x for k, x in managers.items() if _may_have_fewer(model, k, x)}
    if fewer:
        try:
            few = _with(model, {k: with_fewer_cells(model.models[k]) for k in fewer})
            found = equilibrium_of(system, few, t)
            if not found.settled:
                model, found = _on_planned_cells(few, found, fewer, t)
                return _with_catenaries(model, found, managers, t)
        except ComputationError:
            pass
    for k, manager in managers.items():
        layout = model.models[k].layout
        assert layout is not None
        manager.set_layout(layout)
    return _with_catenaries(model, equilibrium_of(system, model, t), managers, t)


def _may_have_fewer(model: NetworkModel, k: int, manager: DomainManager) -> bool:
    bound = any(model.turns[k]) or model.models[k].line.bits & SELF_CONTACT
    return bool((manager.given >= 0).all()) and not bound


def _with(model: NetworkModel, others: Mapping[int, Model]) -> NetworkModel:
    """The same system with other models of some lines, by number."""
    return replace(model, models=tuple(others.get(k, x) for k, x in enumerate(model.models)))


def _on_planned_cells(model: NetworkModel, found: LinesAtRest, managers: Mapping[int, DomainManager], t: float) -> Rest:
    """The equilibrium with cells as its curvature asks for, from one with others.  ComputationError: there is none."""
    before = {k: planned_cells(model.models[k], x, found.state.lines[k], t) for k, x in managers.items()}
    for _ in range(MOST_ROUNDS):
        others, states = dict[int, Model](), [*found.state.lines]
        for k, here in before.items():
            old = model.models[k]
            assert old.layout is not None
            others[k] = on_layout(old, old.layout._replace(here=here))
            states[k] = refined(states[k], old.line, others[k].line)
        model = _with(model, others)
        found = _solved(model, found, t, states)
        wanted = {k: planned_cells(model.models[k], x, found.state.lines[k], t) for k, x in managers.items()}
        if not any((here & ~before[k]).any() for k, here in wanted.items()):
            return model, found
        before = {k: here | before[k] for k, here in wanted.items()}
    raise ComputationError(Outcome.NOT_CONVERGED, None, 0.0, "cells become shorter and shorter")


def _with_catenaries(model: NetworkModel, found: LinesAtRest, managers: Mapping[int, DomainManager], t: float) -> Rest:
    """The same where scenes say that lines are catenary, in the equilibrium with that."""
    others, states = dict[int, Model](), [*found.state.lines]
    for k, manager in managers.items():
        free, full = manager.given >= 0, model.models[k]
        if free.all():
            continue
        assert full.layout is not None
        layout = full.layout._replace(rod=free)
        others[k] = on_layout(full, layout)
        states[k] = on_fewer(states[k], full.line, others[k].line, full.ends.at(t))
        manager.set_layout(layout)
    if not others:
        return model, found
    model = _with(model, others)
    return model, _solved(model, found, t, states)


def _solved(model: NetworkModel, found: LinesAtRest, t: float, states: list[State]) -> LinesAtRest:
    bodies = found.bodies
    return solve_from(
        found, model, t, bodies, NetworkState(states, found.state.bodies), "the equilibrium of other cells"
    )
