"""The model of a scene that names none: rods, catenaries or zones that move, whichever costs least.

A pre-run of rods shows where the cable bends and how tension goes; what each kind would cost follows from the cells
that it needs.  docs/zones.md
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hybrid.model.build import rod_cells
from hybrid.model.mesh_grading import Grading
from hybrid.model.model_costs import (
    ModelChoice,
    cheapest,
    costs,
    no_catenary,
    ratios,
    reasons,
    rod_share,
    structural,
    with_model,
)
from hybrid.model.resolution import Resolution
from hybrid.simulation.case import Case
from hybrid.simulation.first_use import compile_beside


def choose_model(case: Case, resolution: Resolution) -> tuple[ModelChoice, Grading | None]:
    """Give the scene of a case the model that costs least; where its cells should be short, None: not known."""
    scene = case.scene
    case.scene = with_model(scene, "rod")
    survey = case.survey(resolution)
    if survey is None:
        return ModelChoice("rod", "the pre-run that would show what others cost failed"), None
    model, demand = survey.model, survey.demand
    moving = with_model(scene, "adaptive")
    bend = rod_cells(moving, model.cable, demand.s)
    gradings = {
        "rod": survey.grading(),
        "catenary": survey.grading_of_catenary(),
        "adaptive": survey.grading_of_moving_zones(bend),
    }
    found = ratios(scene, model, demand, resolution.zones * model.length)
    counts = [grading.count(0.0, model.length, resolution.fineness) for grading in gradings.values()]
    lengths = rod_cells(moving, model.cable, demand.s, gradings["adaptive"])
    parts = resolution.fineness * float(np.trapezoid(1.0 / lengths, demand.s))
    why_not = structural(scene, model.cable) or no_catenary(found, demand.s)
    share = rod_share(model, demand, found)
    rods, catenaries, base = counts
    each = costs(scene, model, (rods, catenaries, base, max(base, round(parts))), share, why_not)
    kind = cheapest(each).kind
    if kind != "rod":
        case.scene = with_model(scene, kind)
        compile_beside(case.scene)
    return ModelChoice(kind, reasons(each)), gradings[kind]


def rods_instead(case: Case, resolution: Resolution, why: str) -> tuple[ModelChoice, Resolution]:
    """Give the scene of a case rods, after what was chosen has failed; how finely it is computed then."""
    case.scene = with_model(case.scene, "rod")
    survey = case.survey(resolution)
    grading = survey.grading() if survey is not None else None
    return ModelChoice("rod", f"catenaries, which cost less, were tried: {why}"), replace(resolution, grading=grading)
