"""The model of a scene that leaves the choice: rods, catenaries or zones that move, whichever costs least.

A pre-run of rods shows where the cable bends and how tension goes; what each kind would cost follows from the cells
that it needs.  docs/zone_rules.md
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import replace
from math import ceil, isinf
from typing import Any, NamedTuple

from hybrid.errors import ComputationError, Outcome
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
from hybrid.model.payout import payout_of
from hybrid.model.resolution import Resolution, model_is_free, wants_survey
from hybrid.scene.analysis import RodModel
from hybrid.scene.cable import Section
from hybrid.scene.root import Scene
from hybrid.scene.schema import AdaptiveModel, Environment, LineScene
from hybrid.simulation.case import Case
from hybrid.simulation.layer_mesh import layered, shown
from hybrid.simulation.mesh_survey import CELLS, STEPS, Survey, lack_along, with_survey
from hybrid.zones.at_start import HOLD
from hybrid.zones.change import LONGEST_IN_PACE, READY

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
            coarse = shown(of_rods, coarse, case.first_shapes)
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


# Rods in place of a catenary that nobody asked for, where it goes into compression in a motion.
#
# A line without bending stiffness is a catenary where its scene names no model, and no catenary carries compression.
# So
# that the choice of a model is never what a run stops for, such a run begins anew with rods, whose sections without
# bending stiffness get EI = w l^3, with the submerged weight w per length and a hundredth of the line l, as long as the
# cells of a mesh that is not given: under its weight the line then bends over one cell, which is as sharp as catenaries
# show a bend.

CHOSEN = "slack line as rods"  # of the event that says so
RODS = 100  # of a mesh that is not given
# Of the weight in vacuum at the earth's surface: what a line that floats, or has no weight, counts as having.
LEAST_WEIGHT = 1e-2
GRAVITY = 9.81  # m/s2


class Instead(NamedTuple):
    """What is computed in place of a scene, and the text of the event."""

    scene: Any
    text: str


def rods_instead_of_slack(scene: Scene, error: ComputationError) -> Instead | None:
    """A scene with rods in place of catenaries that stood for no model; None: they did not, or did not go slack."""
    if error.outcome != Outcome.SLACK or error.t is None:
        return None
    called = scene.form.names
    name = next((x for x in scene.lines if called[x] == error.line_name), None)
    if name is None or scene.lines[name].model is not None or payout_of(scene.scene_of(name)) is not None:
        return None
    sections, given = _stiffened(scene.lines[name].sections, scene.environment)
    text = f"{f'line {name}: ' * bool(called[name])}{_text(error, given)}"
    text += "; no other line has changed" * (len(called) > 1)
    return Instead(scene.with_lines({name: {"sections": sections, "model": RodModel()}}), text)


def _stiffened(sections: tuple[Section, ...], around: Environment) -> tuple[tuple[Section, ...], list[float]]:
    """Sections that bend, and the bending stiffness of those that had none, N m2."""
    length = sum(x.length for x in sections) / RODS
    density = around.fluid.density if around.fluid is not None else 0.0
    found, given = [], []
    for x in sections:
        if not x.weakest_bending:
            in_water = around.gravity * (x.mass - density * 0.25 * math.pi * (x.diameter or 0.0) ** 2)
            given.append(max(abs(in_water), LEAST_WEIGHT * GRAVITY * x.mass) * length**3)
            x = x.model_copy(update={"bending_stiffness": given[-1]})
        found.append(x)
    return tuple(found), given


def _text(error: ComputationError, given: list[float]) -> str:
    """What the event says."""
    stiffness = " and ".join(f"{x:.3g}" for x in dict.fromkeys(given))
    return (
        f"computed as rods, because as a catenary it went into compression at t = {error.t:.4g} s, "
        f"s = {error.s or 0.0:.4g} m, and the run began anew; bending_stiffness is not given and taken as {stiffness} "
        "N m^2, by which the line bends over a hundredth of its length: give its own"
    )
