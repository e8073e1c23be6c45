"""A design as a component of OpenMDAO: unknowns are its inputs, results its outputs, with exact derivatives."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from typing import TYPE_CHECKING, Any

from hybrid.designs.component_ports import NOTHING, inputs_of, outputs_of, refuse_ports
from hybrid.designs.design import task_of
from hybrid.designs.edges import refuse_edges
from hybrid.designs.problem import as_asked, problem_of, refused_result
from hybrid.errors import SceneError, optional_package
from hybrid.scene.design import Design
from hybrid.scene.read import SceneLike

if TYPE_CHECKING:
    from hybrid.designs.openmdao_component import DesignComponent


def openmdao_component(
    source: str | PathLike[str] | Mapping[str, Any] | SceneLike | Design,
    *,
    unknowns: Mapping[str, Any] | None = None,
    driven: bool = False,
    **more: Any,
) -> DesignComponent:
    """A design as an `ExplicitComponent` of OpenMDAO.

    source, unknowns, more (cases, results, limits, targets, minimise): as of `hybrid.design`; results need no
    `minimise` here.  Inputs are the unknowns, by name; outputs are results, targets and limits by name, a limit with a
    value for each of its cases and sections, and what is minimised as `minimised`.  Units are those of the scene.
    driven: unknowns are design variables with their bounds, limits and targets constraints, what is minimised the
    objective.  Derivatives are exact at rest, of motions those of `hybrid.design`.

    Where there is no equilibrium it raises OpenMDAO's `AnalysisError`.  SceneError: the design or its scene is refused;
    ComputationError: there is no equilibrium where it begins; ResultError: OpenMDAO is not installed.
    """
    optional_package("openmdao.api", "a component of OpenMDAO", "openmdao")
    from hybrid.designs.openmdao_component import DesignComponent

    if unknowns is not None and more.get("results"):
        more.setdefault("minimise", NOTHING)
    task, scene = task_of(source, unknowns, more)
    refuse_ports(task)
    asked = as_asked(scene, task)
    refuse_edges(asked, [x.quantity for x in task.asked.targets.values()])  # a design takes them as they are
    problem = problem_of(task, asked)
    try:
        problem.equilibria.at(problem.space.start)
    except SceneError as error:
        raise refused_result(task, error) from None
    return DesignComponent(problem, inputs_of(problem, asked), outputs_of(problem, task, asked), driven)
