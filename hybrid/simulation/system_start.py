"""What a run of several lines begins with: their equilibrium, and the lines as the solver takes them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hybrid.errors import ComputationError, Outcome
from hybrid.model.system import SystemModel, balanced_places, build_system
from hybrid.scene.system import System
from hybrid.solve.system import JoinedLine, SystemState, joined_ends
from hybrid.solve.system_statics import LineFailed, Start, SystemEquilibrium, solve_system_statics

# Equilibria until the water around members no longer changes, and what of the largest number of a body counts as that.
MOST_ROUNDS, SAME_WATER = 30, 1e-9


def equilibrium_of_system(system: System, model: SystemModel, t: float) -> SystemEquilibrium:
    """Equilibrium with the loads of time t (s; infinity: of full size).  ComputationError: none is found."""
    try:
        numbers = model.body_numbers(t)
        found = solve_system_statics(joined_lines(model, t), len(model.free), numbers, _starts(system, model))
        if not any(body.members for body in model.bodies):
            return found
        for _ in range(MOST_ROUNDS):  # members feel the water where they come to rest
            before = numbers.copy()
            still = np.inf if np.isinf(t) else t
            model.stir(still, found.state.bodies, 0.0, numbers)
            if np.abs(numbers - before).max() <= SAME_WATER * np.abs(numbers).max():
                return found
            start = [("members where they came to rest", found.state)]
            found = solve_system_statics(joined_lines(model, t), len(model.free), numbers, iter(start))
        raise LineFailed(-1, Outcome.NOT_CONVERGED, None, None, "members of a body do not come to rest in this water")
    except LineFailed as failed:
        raise named(failed, model) from None


def _starts(system: System, model: SystemModel) -> Iterator[Start]:
    """Shapes from which the equilibrium is looked for."""
    yield "lines hung between the first places", SystemState([x.start for x in model.models], model.body_places)
    places = balanced_places(system, model)
    if places is not None and (model.free or model.bodies):
        models = build_system(system, *places).models
        yield "lines hung between places that balance", SystemState([x.start for x in models], places[1])


def joined_lines(model: SystemModel, t: float) -> list[JoinedLine]:
    """The lines with their ends and their sea at t (s), whose arrays `ends.at` and `sea.at` overwrite."""
    lines = []
    for x, joints, fairleads in zip(model.models, model.joints, model.fairleads, strict=True):
        floor = x.slack_floor if x.slack == "stop" else -np.inf
        ends = joined_ends(x.ends.at(t), joints)
        lines.append(JoinedLine(x.line, x.sea.at(t), ends, x.length, x.tension_scale, floor, joints, fairleads))
    return lines


def named(failed: LineFailed, model: SystemModel) -> ComputationError:
    """The same with the name of the line in its detail."""
    where = f"line {model.names[failed.line]}" if failed.line >= 0 else "the points"
    detail = f"{where}; {failed.detail}" if failed.detail else where
    return ComputationError(failed.outcome, failed.t, failed.s, detail)
