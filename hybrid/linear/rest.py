"""The equilibrium of a scene as one network of lines, points and bodies, whatever the scene is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hybrid.errors import Complaint, SceneError
from hybrid.kernels.junctions.bodies import MASS
from hybrid.model.bodies import BodyModel
from hybrid.model.build import Model
from hybrid.model.resolution import Resolution
from hybrid.model.system import SystemResolution
from hybrid.scene.read import scene_text
from hybrid.scene.system import System
from hybrid.simulation.static_case import StaticCase
from hybrid.simulation.system_run import static_system
from hybrid.solve.joined import JoinedLine, SystemState
from hybrid.solve.system import SystemSolver

CABLE = "cable"  # name of the line of a scene of one


@dataclass(frozen=True)
class Rest:
    """The equilibrium of a scene as a network; points and bodies that are free by name, models of lines and bodies."""

    solver: SystemSolver
    states: SystemState
    names: tuple[str, ...]
    models: tuple[Model, ...]
    points: tuple[str, ...] = ()
    bodies: tuple[str, ...] = ()
    floats: tuple[BodyModel, ...] = ()


def line_at_rest(case: StaticCase, resolution: Resolution) -> Rest:
    """One line, as a system of one.

    SceneError: it touches itself; ComputationError: there is no equilibrium.
    """
    model, found = case.at_rest(resolution)
    if found.touch.size:
        _refuse_contact("contact.self")
    x = JoinedLine(
        model.line, model.sea.at(np.inf), model.ends.at(np.inf), model.length, model.tension_scale, -np.inf, (-1, -1)
    )  # fmt: skip
    return Rest(SystemSolver([x], 0), SystemState([found.state]), (CABLE,), (model,))


def system_at_rest(system: System, resolution: SystemResolution) -> Rest:
    """Several lines; errors as of `line_at_rest`."""
    run = static_system(system, None, lambda: scene_text(system), resolution=resolution)
    assert run.found is not None
    if run.found.settled:
        _refuse_contact("lines")
    bodies = (*(body.name for body in run.model.bodies), *run.model.rigid)
    found = run.found.solver  # which knows neither waves nor friction
    lines = [x._replace(line=model.line) for x, model in zip(found.lines, run.model.models, strict=True)]
    for body, state, row in zip(run.model.bodies, run.state.bodies, found.bodies, strict=False):
        body.take_added_mass(state)  # as it is wet at rest
        row[MASS : MASS + 36] = body.numbers[MASS : MASS + 36]
    solver, model = SystemSolver(lines, len(found.net), found.bodies), run.model
    return Rest(solver, run.state, tuple(model.names), model.models, tuple(model.free), bodies, model.bodies)


def _refuse_contact(where: str) -> None:
    expected = "an equilibrium in which no line touches itself, about which modes are known"
    raise SceneError([Complaint(where, "contact of a line with itself", expected, "a shape that is apart")])
