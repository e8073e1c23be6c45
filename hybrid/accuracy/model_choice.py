"""The model of a scene that leaves the choice: rods, catenaries or zones that move, whichever costs least.

A pre-run of rods shows where the cable bends and how tension goes; what each kind would cost follows from the cells
that it needs.  docs/zone_rules.md
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from math import ceil, isinf

from hybrid.model.build import Model
from hybrid.model.mesh import Grading
from hybrid.model.model_costs import (
    REST,
    ModelChoice,
    cheapest,
    costs,
    foretold_steps,
    no_catenary,
    ratios,
    reasons,
    rods_of_zones,
    structural,
)
from hybrid.model.network import NetworkResolution
from hybrid.model.resolution import Resolution, model_is_free, wants_survey
from hybrid.scene.schema import AdaptiveModel, LineScene
from hybrid.simulation.case import Case
from hybrid.simulation.initial_zones import HOLD
from hybrid.simulation.layer_mesh import layered, shown
from hybrid.simulation.mesh_survey import CELLS, STEPS, Survey, lack_along, with_survey
from hybrid.simulation.zone_switching import LONGEST_IN_PACE, READY

# Why a line may be no catenary that has come near itself in a pre-run.
NEAR = "it comes near itself, and contact of catenaries alone is not asked for"


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


def chosen_and_surveyed(
    case: Case, resolution: NetworkResolution, chosen: Collection[str] = ()
) -> tuple[dict[str, ModelChoice], NetworkResolution]:
    """Models for lines whose scene names none, and cells by a pre-run for those that want one.

    chosen: lines whose model has been chosen already.
    """
    resolution = layered(case.lines, resolution, case.first_shapes)
    scenes = {name: x for name, x in case.lines.items() if wants_survey(x)}
    open_yet = [x for x, scene in scenes.items() if x not in chosen and model_is_free(scene, case.moves)]
    choices = dict[str, ModelChoice]()
    if not scenes:
        return choices, resolution
    if not case.moves:
        choices = dict.fromkeys(open_yet, ModelChoice("rod", REST))
        case.scene, open_yet = case.with_models(dict.fromkeys(open_yet, "rod")), []
        scenes = {name: case.lines[name] for name in scenes}
    if case.criterion is not None:
        open_yet = []
    # of rods, which alone show what zones would leave out of a bend
    moving = [name for name, x in scenes.items() if name in open_yet or isinstance(x.model, AdaptiveModel)]
    rods = case.with_models(dict.fromkeys(moving, "rod"))
    with case.instead(rods):
        of_rods, coarse = case.lines, resolution.coarser(CELLS, STEPS if case.moves else 1.0)
        if not (case.moves and case.scene.starts_as_placed):  # a shape that is given has the bends that it has
            coarse = shown(of_rods, coarse, case.first_compared)
        surveys = case.survey(resolution, coarse)
    if surveys is None:
        failed = ModelChoice("rod", "the pre-run that would show what others cost failed")
        case.scene = case.with_models(dict.fromkeys(open_yet, "rod"))
        return choices | dict.fromkeys(open_yet, failed), _placed_as(resolution, coarse, {*open_yet, *chosen})
    finely = dict(resolution.lines)
    for name, scene in scenes.items():
        if name in open_yet:
            near = NEAR if name in case.near_themselves else ""
            choices[name], finely[name] = choice_of(scene, of_rods[name], surveys[name], finely[name], near)
        else:
            finely[name] = with_survey(finely[name], scene, surveys[name])
    case.scene = case.with_models({name: choices[name].kind for name in open_yet})
    return choices, NetworkResolution(finely)


def _placed_as(resolution: NetworkResolution, coarse: NetworkResolution, names: Collection[str]) -> NetworkResolution:
    """With the cells of a pre-run that failed, as the equilibrium has placed them, of lines with these names."""
    found = {k: replace(x, grading=coarse.lines[k].grading) if k in names else x for k, x in resolution.lines.items()}
    return NetworkResolution(found)
