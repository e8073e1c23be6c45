"""What the kinds of model would cost for a scene that leaves the choice, and where catenaries are no choice."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from hybrid.kernels.state.state import Floats
from hybrid.model.build import Model
from hybrid.model.material import Material, tension_floor
from hybrid.model.mesh_grading import Grading
from hybrid.model.resolution import accuracy_of, holds_stress
from hybrid.model.run_time import step_time
from hybrid.scene.accuracy import of_unnamed_model
from hybrid.scene.network_scene import Network
from hybrid.scene.schema import AdaptiveModel, CatenaryModel, LineScene, RodModel

MODELS = {"rod": RodModel, "catenary": CatenaryModel, "adaptive": AdaptiveModel}
# Another model must cost less than this part of rods, which need no criterion and leave nothing out.
CLEARLY = {"catenary": 0.9, "adaptive": 0.8}
# Part of the steps of all runs of an accuracy at which the error of leaving bending out is followed: in the results of
# zones that move, and in one of the runs that catenaries are compared with, of longer cells and steps.
FOLLOWED = {"catenary": 0.25, "adaptive": 0.6}
# Catenaries are a choice where criteria that count errors of position stay below 1, and that of slack below this: a
# pre-run sees outputs alone.  What zones that move would hold as rods is above it in any of them.
CALM = 0.25
# Tensions below this part of the largest are those of a line that may go slack between two outputs of a pre-run.
NEARLY_SLACK = 0.05
# A clamp or a point load makes so many lengths sqrt(EI/T) a rod, and what asks for it so many on either side of it.
DISTURBED, WIDER = 4.0, 2.0
MOST_RANGES = 4  # places of rods that are named
VISIBLY = 1.05  # times the steps of rods that are named
# Part of what a catenary may lack along the line from which on zones that move are rod (simulation.initial_zones).
ZONES_ALONG = 0.5


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


class Rods(NamedTuple):
    """What zones that move would make rod at some time: part of the cells, and from where to where, m."""

    share: float
    ranges: tuple[tuple[float, float], ...] = ()

    def __str__(self) -> str:
        places = ", ".join(f"{a:.4g} to {b:.4g}" for a, b in self.ranges[:MOST_RANGES])
        more = f" and {len(self.ranges) - MOST_RANGES} more" if len(self.ranges) > MOST_RANGES else ""
        return f"{self.share:.0%} of them rod" + (f": s = {places}{more} m" if places else "")


class Cost(NamedTuple):
    """A kind of model: its cells, s of processor time for a step, and why it is no choice; empty if it is one."""

    kind: str
    cells: int
    seconds: float
    why_not: str = ""
    rods: Rods | None = None  # of zones that move
    steps: float = 1.0  # for one of rods everywhere


class Demand(NamedTuple):
    """What rods have shown of a line, at places s (K,) m: largest curvature 1/m, least, largest, mean tension N."""

    s: Floats
    curvature: Floats
    bent: Floats  # (K,) 1/N m, largest curvature over tension
    least: Floats
    largest: Floats
    mean: Floats


def with_model(scene: LineScene, kind: str) -> LineScene:
    """The same scene with one of MODELS; a rod that is chosen, not named, asks for no curvature."""
    changed: dict[str, Any] = {"model": MODELS[kind]()}
    if (accuracy := accuracy_of(scene)) is not None:
        changed["accuracy"] = of_unnamed_model(accuracy, holds_stress(scene.cable.sections))
    return scene.model_copy(update=changed)


def with_models(system: Network, kinds: Mapping[str, str]) -> Network:
    """The same with models of these kinds for lines by name, as of `with_model`."""
    scenes = {name: with_model(system.scene_of(name), kind) for name, kind in kinds.items()}
    changes = {name: {"model": x.model, "accuracy": x.accuracy} for name, x in scenes.items()}
    lines = {name: x.model_copy(update=changes.get(name, {})) for name, x in system.lines.items()}
    return system.model_copy(update={"lines": lines}) if kinds else system


def structural(scene: LineScene, cable: Material) -> str:
    """Why a cable cannot be catenary everywhere, whatever its tension is; empty: it can."""
    if any(cable.held_tangent) or any(cable.held_twist):
        return "an end is clamped"
    if any(load.what == "moment" for end in scene.ends.both for load in end.loads):
        return "a moment acts on an end"
    if any(x.min_bend_radius for x in scene.cable.sections) or holds_stress(scene.cable.sections):
        return "min_bend_radius or a stress is to be checked"
    if cable.at.size:
        return "point loads bend it"
    if np.ptp(cable.mean_bending) > 0.0 or np.ptp(cable.submerged_weight) > 0.0:
        return "its sections differ"
    return "it is curved without load" if cable.kappa.any() else ""


def ratios(scene: LineScene, model: Model, demand: Demand, tolerance: float, along: Floats) -> tuple[Floats, ...]:
    """Criteria bend, slack and edge (K,) of docs/zone_rules.md, from extremes, and what is asked along the line.

    tolerance: m; along: (K,) what catenaries lack of that.
    """
    cable = model.cable
    piece = cable.piece(demand.s)
    EI, w = cable.mean_bending[piece], np.abs(cable.submerged_weight[piece])
    low = np.maximum(demand.least, 1e-9 * model.tension_scale)
    slack = np.maximum(tension_floor(EI, w, model.tension_scale), CALM * NEARLY_SLACK * demand.largest.max()) / low
    edge = EI * w / (low * low * tolerance) if scene.environment.seabed is not None else 0.0 * low
    return EI * demand.bent / tolerance, slack, edge, along


def rods_of_zones(model: Model, demand: Demand, found: Sequence[Floats], grading: Grading) -> Rods:
    """What zones that move would make rod at some time; found: `ratios`; grading: of the cells.

    A rod is wider on either side than what asks for it, by the buffer of the manager and two cells.
    """
    cable, s, h = model.cable, demand.s, grading.cell(demand.s)
    low = np.maximum(demand.least, 1e-3 * model.tension_scale)
    wider = WIDER * np.sqrt(cable.mean_bending[cable.piece(s)] / low) + 2.0 * h
    *of_position, along = found
    asks = np.flatnonzero((np.max(of_position, axis=0) > CALM) | (along > ZONES_ALONG))
    a, b = s[asks] - wider[asks], s[asks] + wider[asks]
    held = [x for x, tangent in zip((0.0, model.length), cable.held_tangent, strict=True) if tangent]
    places = np.array([*cable.at, *held])
    width = DISTURBED * np.sqrt(cable.mean_bending.max() / np.maximum(np.interp(places, s, low), 1e-300))
    a, b = np.append(a, places - 0.5 * width), np.append(b, places + 0.5 * width)
    counted = np.concatenate([[0.0], np.cumsum(np.diff(s) / grading.cell(0.5 * (s[:-1] + s[1:])))])  # cells up to s
    ranges = united(np.clip(a, 0.0, model.length), np.clip(b, 0.0, model.length))
    inside = sum(float(np.diff(np.interp(ends, s, counted))[0]) for ends in ranges)
    return Rods(inside / float(counted[-1]), tuple(ranges))


def united(a: Floats, b: Floats) -> list[tuple[float, float]]:
    """Ranges that cover the same as those from a to b (n,), none of which meets another."""
    found: list[tuple[float, float]] = []
    for k in np.argsort(a):
        if found and a[k] <= found[-1][1]:
            found[-1] = found[-1][0], max(found[-1][1], float(b[k]))
        else:
            found.append((float(a[k]), float(b[k])))
    return found


def no_catenary(found: Sequence[Floats], s: Floats) -> str:
    """Which criterion rules catenaries out and where; empty: none."""
    bend, slack, edge, along = found
    if slack.max() > CALM:
        return f"the line goes slack, or nearly so, at s = {s[slack.argmax()]:.4g} m"
    for ratio, what in (
        (bend, "neglected bending moves the line by"),
        (edge, "neglected bending at the touchdown moves the line by"),
        (along, "the error along the line is"),
    ):
        if ratio.max(initial=0.0) > 1.0:
            at = int(np.argmax(ratio))
            return f"{what} {ratio[at]:.2g} times what is asked, at s = {s[at]:.4g} m"
    return ""


def costs(
    scene: LineScene, model: Model, rods: int, catenaries: int, of_zones: Rods, why_not: str, more_steps: float = 1.0
) -> tuple[Cost, Cost, Cost]:
    """Of rods, catenaries and zones that move, which have the cells of rods.

    rods, catenaries: cells; of_zones: what zones would make rod; why_not: why catenaries are no choice; more_steps: of
    zones, for one of rods.
    """
    share, part = of_zones.share * rods, FOLLOWED["adaptive"]
    moving = step_time(scene, model, share, rods - share, moves=True, followed=part)
    return (
        Cost("rod", rods, step_time(scene, model, rods, 0)),
        Cost("catenary", catenaries, step_time(scene, model, 0, catenaries, followed=FOLLOWED["catenary"]), why_not),
        Cost("adaptive", rods, moving, rods=of_zones, steps=more_steps),
    )


def cheapest(found: Sequence[Cost]) -> Cost:
    """Rods, or what costs clearly less; found: rods first."""
    rods = found[0]
    others = [x for x in found[1:] if not x.why_not and x.steps * x.seconds < CLEARLY[x.kind] * rods.seconds]
    return min(others, key=lambda x: x.steps * x.seconds, default=rods)


def reasons(found: Sequence[Cost]) -> str:
    """All of them in words."""
    return "; ".join(f"{x.kind} {_in_words(x)}" for x in found)


def _in_words(cost: Cost) -> str:
    if cost.why_not:
        return f"excluded: {cost.why_not}"
    cells = f"{cost.cells} cells, {cost.rods}" if cost.rods is not None else f"{cost.cells} cells"
    more = f"; {cost.steps:.2g} times as many steps" if cost.steps > VISIBLY else ""
    return f"{float(f'{1e6 * cost.seconds:.2g}'):g} µs of processor time per step ({cells}{more})"
