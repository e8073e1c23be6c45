"""What the kinds of model would cost for a scene that leaves the choice, and where catenaries are no choice."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from hybrid.kernels.state.state import Floats
from hybrid.model.build import Model
from hybrid.model.material import Material, tension_floor
from hybrid.model.resolution import accuracy_of, holds_stress
from hybrid.model.run_time import step_time
from hybrid.scene.accuracy import of_unnamed_model
from hybrid.scene.schema import AdaptiveModel, CatenaryModel, RodModel, Scene

MODELS = {"rod": RodModel, "catenary": CatenaryModel, "adaptive": AdaptiveModel}
# Another model must cost less than this part of rods, which need no criterion and leave nothing out.  Zones that move
# take shorter steps while they change, and more runs where they turn out too lax, which a pre-run does not show: in 31
# random scenes predicted gains over rods were 0.6 to 2.6 times the measured ones, 1.05 in the median.
CLEARLY = {"catenary": 0.9, "adaptive": 0.4}
# Catenaries are a choice where criteria that count errors of position stay below 1, and that of slack below this: a
# pre-run sees outputs alone.  What zones that move would hold as rods is above it in any of them.
CALM = 0.25
# Tensions below this part of the largest are those of a line that may go slack between two outputs of a pre-run.
NEARLY_SLACK = 0.05
# A clamp or a point load makes so many lengths sqrt(EI/T) a rod.
DISTURBED = 4.0


# Kind of the event that says what was chosen, and what it is called there.
CHOSEN = "model chosen"
REST = "an equilibrium of rods costs next to nothing and leaves nothing out"
WORDS = {"rod": "rods everywhere", "catenary": "catenaries everywhere", "adaptive": "zones that move"}


class ModelChoice(NamedTuple):
    """A kind of model, and why; both empty where the scene leaves no choice."""

    kind: str = ""
    why: str = ""

    @property
    def notes(self) -> list[tuple[str, str]]:
        """The event that says so."""
        other = "" if self.kind == "adaptive" else "; model.always_move: true asks for zones that move"
        return [(CHOSEN, f"{WORDS[self.kind]}; {self.why}{other}")] if self.kind else []


NAMED = ModelChoice()  # of a scene that leaves no choice


class Cost(NamedTuple):
    """A kind of model: its cells, s of processor time for a step, and why it is no choice; empty if it is one."""

    kind: str
    cells: int
    seconds: float
    why_not: str = ""


class Demand(NamedTuple):
    """What rods have shown of a line, at places s (K,) m: largest curvature 1/m, least, largest, mean tension N."""

    s: Floats
    curvature: Floats
    bent: Floats  # (K,) 1/N m, largest curvature over tension
    least: Floats
    largest: Floats
    mean: Floats


def with_model(scene: Scene, kind: str) -> Scene:
    """The same scene with one of MODELS; a rod that is chosen, not named, asks for no curvature."""
    changed: dict[str, Any] = {"model": MODELS[kind]()}
    if (accuracy := accuracy_of(scene)) is not None:
        changed["accuracy"] = of_unnamed_model(accuracy, holds_stress(scene.cable.sections))
    return scene.model_copy(update=changed)


def structural(scene: Scene, cable: Material) -> str:
    """Why a cable cannot be catenary everywhere, whatever its tension is; empty: it can."""
    if any(cable.held_tangent) or any(cable.held_twist):
        return "an end is clamped"
    if any(load.what == "moment" for end in scene.ends.both for load in end.loads):
        return "a moment acts on an end"
    if any(x.min_bend_radius for x in scene.cable.sections) or holds_stress(scene.cable.sections):
        return "a limit of its bending is judged"
    if cable.at.size:
        return "point loads bend it"
    if np.ptp(cable.mean_bending) > 0.0 or np.ptp(cable.submerged_weight) > 0.0:
        return "its sections differ"
    return "it is curved without load" if cable.kappa.any() else ""


def ratios(scene: Scene, model: Model, demand: Demand, tolerance: float) -> tuple[Floats, Floats, Floats]:
    """Criteria bend, slack and edge (K,) of docs/zones.md, from extremes; tolerance: m."""
    cable = model.cable
    piece = cable.piece(demand.s)
    EI, w = cable.mean_bending[piece], np.abs(cable.submerged_weight[piece])
    low = np.maximum(demand.least, 1e-9 * model.tension_scale)
    slack = np.maximum(tension_floor(EI, w, model.tension_scale), CALM * NEARLY_SLACK * demand.largest.max()) / low
    edge = EI * w / (low * low * tolerance) if scene.environment.seabed is not None else 0.0 * low
    return EI * demand.bent / tolerance, slack, edge


def rod_share(model: Model, demand: Demand, found: Sequence[Floats]) -> float:
    """Part of the line that zones that move would make rod at some time; found: `ratios`."""
    cable, share = model.cable, float(np.mean(np.max(found, axis=0) > CALM))
    places = [*cable.at, *(x for x, held in zip((0.0, model.length), cable.held_tangent, strict=True) if held)]
    for place in places:
        low = max(float(np.interp(place, demand.s, demand.least)), 1e-3 * model.tension_scale)
        share += DISTURBED * np.sqrt(cable.mean_bending.max() / low) / model.length
    return min(share, 1.0)


def no_catenary(found: Sequence[Floats], s: Floats) -> str:
    """Which criterion rules catenaries out and where; empty: none."""
    bend, slack, edge = found
    for name, ratio, most in (("slack", slack, CALM), ("bend", bend, 1.0), ("edge", edge, 1.0)):
        at = int(np.argmax(ratio))
        if ratio[at] > most:
            return f"criterion {name} comes to {ratio[at]:.2g} at s = {s[at]:.4g} m"
    return ""


def costs(
    scene: Scene, model: Model, cells: tuple[int, int, int, int], share: float, why_not: str
) -> tuple[Cost, Cost, Cost]:
    """Of rods, catenaries and zones that move.

    cells: of rods, of catenaries, base cells, and cells of zones that move if all is rod; share: part of the line that
    would be rod then; why_not: why catenaries are no choice.
    """
    rods, catenaries, base, parts = cells
    moving = share * parts, (1.0 - share) * base
    return (
        Cost("rod", rods, step_time(scene, model, rods, 0)),
        Cost("catenary", catenaries, step_time(scene, model, 0, catenaries, followed=True), why_not),
        Cost("adaptive", round(sum(moving)), step_time(scene, model, *moving, moves=True, followed=True)),
    )


def cheapest(found: Sequence[Cost]) -> Cost:
    """Rods, or what costs clearly less; found: rods first."""
    rods = found[0]
    others = [x for x in found[1:] if not x.why_not and x.seconds < CLEARLY[x.kind] * rods.seconds]
    return min(others, key=lambda x: x.seconds, default=rods)


def reasons(found: Sequence[Cost]) -> str:
    """All of them in words."""
    return "; ".join(f"{x.kind} {_in_words(x)}" for x in found)


def _in_words(cost: Cost) -> str:
    if cost.why_not:
        return f"is no choice: {cost.why_not}"
    return f"{float(f'{1e6 * cost.seconds:.2g}'):g} µs of processor time per step ({cost.cells} cells)"
