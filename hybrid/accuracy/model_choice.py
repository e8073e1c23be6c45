"""The model of a scene that leaves the choice: rods, catenaries or zones that move, whichever costs least.

A pre-run of rods shows where the cable bends and how tension goes; what each kind would cost follows from the cells
that it needs.  docs/zone_rules.md
"""

from __future__ import annotations

from dataclasses import replace
from math import ceil, isinf

from hybrid.model.build import Model
from hybrid.model.mesh_grading import Grading
from hybrid.model.model_costs import (
    NAMED,
    ModelChoice,
    cheapest,
    costs,
    no_catenary,
    ratios,
    reasons,
    rods_of_zones,
    structural,
    with_model,
)
from hybrid.model.resolution import Resolution, for_motion, model_is_free, wants_survey
from hybrid.model.run_time import foretold_steps
from hybrid.scene.schema import AdaptiveModel, LineScene
from hybrid.simulation.case import Case
from hybrid.simulation.initial_zones import HOLD
from hybrid.simulation.layer_mesh import layered, survey_of
from hybrid.simulation.mesh_survey import Survey, lack_along, with_survey
from hybrid.simulation.static_case import StaticCase
from hybrid.simulation.zone_switching import LONGEST_IN_PACE, READY

# Why a line may be no catenary that has come near itself in a pre-run.
NEAR = "it comes near itself, and contact of catenaries alone is not asked for"


def choose_model(case: Case, resolution: Resolution) -> tuple[ModelChoice, Resolution]:
    """Give the scene of a case the model that costs least; with cells, and zones, as a pre-run of rods asks for."""
    scene = case.scene
    case.scene = with_model(scene, "rod")
    survey, coarse = survey_of(case, resolution)
    if survey is None:
        failed = ModelChoice("rod", "the pre-run that would show what others cost failed")
        return failed, replace(resolution, grading=coarse.grading)
    near = NEAR if case.came_near_itself else ""
    choice, resolution = choice_of(scene, case.scene, survey, resolution, near)
    if choice.kind != "rod":
        case.scene = with_model(scene, choice.kind)
    return choice, resolution


def choice_of(
    scene: LineScene, rods: LineScene, survey: Survey, resolution: Resolution, near: str
) -> tuple[ModelChoice, Resolution]:
    """The model that costs least, and how finely it is computed first, by a pre-run of rods.

    scene: as it was asked; rods: of the pre-run; near: why the line may be no catenary, beside what its scene says.
    """
    resolution = with_survey(resolution, scene, survey)
    model, demand = survey.model, survey.demand
    gradings: dict[str, Grading] = {"rod": survey.grading(), "catenary": survey.grading_of_catenary}
    gradings["adaptive"] = gradings["rod"]
    found = ratios(scene, model, demand, resolution.zones * model.length, lack_along(scene, survey))
    cells, catenaries = (gradings[kind].count(0.0, model.length, resolution.fineness) for kind in ("rod", "catenary"))
    why_not = structural(scene, model.cable) or near or no_catenary(found, demand.s)
    of_zones = rods_of_zones(model, demand, found, gradings["rod"])
    each = costs(scene, model, cells, catenaries, of_zones, why_not, _steps_of_zones(rods, model, resolution))
    kind = cheapest(each).kind
    return ModelChoice(kind, reasons(each)), replace(resolution, grading=gradings[kind])


def _steps_of_zones(scene: LineScene, model: Model, resolution: Resolution) -> float:
    """Steps of zones that move for one of rods: those that follow the motion are no longer than zones let them be."""
    time, longest = scene.require_time(), LONGEST_IN_PACE * READY * HOLD * model.time_scale
    if resolution.local is None or isinf(longest):
        return 1.0
    rods = foretold_steps(scene, model, resolution, ceil(time.duration / resolution.step))
    return max(1.0, time.duration / longest / rods)


def chosen_and_surveyed(case: Case, resolution: Resolution) -> tuple[ModelChoice, Resolution]:
    """The model, if the scene names none, and cells by a pre-run, if it wants one."""
    if not wants_survey(case.scene):
        return NAMED, layered(case, resolution)
    if case.criterion is None and model_is_free(case.scene):
        return choose_model(case, resolution)
    return NAMED, surveyed(case, resolution)


def surveyed(case: Case | StaticCase, resolution: Resolution) -> Resolution:
    """With cells, and zones, as a pre-run asks for: of rods, which alone show what zones would leave out of a bend."""
    scene = case.scene
    if isinstance(scene.model, AdaptiveModel):
        case.scene = with_model(scene, "rod")
    try:
        survey, _ = survey_of(case, resolution)
    finally:
        case.scene = scene
    return with_survey(resolution, scene, survey)


def rods_instead(case: Case, resolution: Resolution, why: str) -> tuple[ModelChoice, Resolution]:
    """Give the scene of a case rods, after what was chosen has failed; how finely it is computed then."""
    case.scene = with_model(case.scene, "rod")
    choice = ModelChoice("rod", f"catenaries, which cost less, were tried: {why}")
    survey, coarse = survey_of(case, resolution)
    if survey is None:
        return choice, replace(resolution, grading=coarse.grading)
    return choice, replace(for_motion(resolution, case.scene, survey.reach), grading=survey.grading())
