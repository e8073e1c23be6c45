"""The equilibrium of a scene as one network of lines, points and bodies, whatever the scene is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from hybrid.kernels.junctions.bodies import MASS
from hybrid.kernels.state.state import Floats
from hybrid.linear.touching import TouchingLines
from hybrid.model.bodies import BodyModel
from hybrid.model.build import Model
from hybrid.model.lines_contact import Touching
from hybrid.model.network import NetworkModel, NetworkResolution
from hybrid.scene.network_scene import Network
from hybrid.scene.points import FreePoint
from hybrid.scene.read import scene_text
from hybrid.scene.short_form import network_of, short_form
from hybrid.simulation.network_run import static_system
from hybrid.solve.joined import NetworkState
from hybrid.solve.network_solver import NetworkSolver


@dataclass(frozen=True)
class Rest:
    """The equilibrium of a scene as a network; points and bodies that are free by name, models of lines and bodies.

    touching: lines that touch each other or themselves in it; may_touch: which may touch each other.
    """

    solver: NetworkSolver
    states: NetworkState
    names: tuple[str, ...]
    models: tuple[Model, ...]
    points: tuple[str, ...] = ()
    bodies: tuple[str, ...] = ()
    floats: tuple[BodyModel, ...] = ()
    touching: TouchingLines | None = None
    may_touch: Touching | None = None
    tips: Mapping[tuple[str, int], str] = field(default_factory=dict)  # points that are one end (0, 1) alone


def rest_of(scene: Any, resolution: NetworkResolution) -> Rest:
    """The equilibrium of a scene on such cells; ComputationError: there is none."""
    system, form = network_of(scene), short_form(scene)
    if scene.line_names:
        return _network_at_rest(system, resolution)
    with form.said():
        return replace(_network_at_rest(system, resolution), tips={})


def _network_at_rest(system: Network, resolution: NetworkResolution) -> Rest:
    run = static_system(system, None, lambda: scene_text(system), resolution=resolution)
    assert run.found is not None
    bodies = (*(body.name for body in run.model.bodies), *run.model.rigid)
    found = run.found.solver  # which knows neither waves nor friction
    lines = [x._replace(line=model.line) for x, model in zip(found.lines, run.model.models, strict=True)]
    for body, state, row in zip(run.model.bodies, run.state.bodies, found.bodies, strict=False):
        body.take_added_mass(state)  # as it is wet at rest
        row[MASS : MASS + 36] = body.numbers[MASS : MASS + 36]
    solver, model = NetworkSolver(lines, len(found.net), found.bodies), run.model
    touching = TouchingLines(found, friction_between(model)) if run.found.settled else None
    return Rest(
        solver, run.state, tuple(model.names), model.models, tuple(model.free), bodies, model.bodies, touching,
        model.touching, _tips(system, model),
    )  # fmt: skip


def _tips(system: Network, model: NetworkModel) -> dict[tuple[str, int], str]:
    """Free points that are the end (0, 1) of one line alone, by that."""
    ends = [
        ((name, k), getattr(system.lines[name], key)) for name in model.names for k, key in enumerate(("start", "end"))
    ]
    joints = [joint for pair in model.joints for joint in pair]
    free = {name for name, point in system.points.items() if isinstance(point, FreePoint)}
    return {end: point for (end, point), joint in zip(ends, joints, strict=True) if joint < 0 and point in free}


def friction_between(model: NetworkModel) -> Floats:
    """(L, L) coefficients of friction of lines with each other and with themselves."""
    found = np.diag([model.scenes[name].contact.friction for name in model.names])
    if model.touching is not None:
        found[np.ix_(model.touching.lines, model.touching.lines)] = model.touching.friction
    return found
