"""What the kinds of model would cost for a scene that leaves the choice, and where catenaries are no choice."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from hybrid.kernels.laws.water import calm_below
from hybrid.kernels.state.report import ADDED_MASS, DRAG, FRICTION, ROTARY, SEABED, STIFFNESS_DAMPING, SURFACE
from hybrid.kernels.state.state import Floats
from hybrid.kernels.step.generalized_alpha import weights
from hybrid.kernels.step.step_law import SAFETY
from hybrid.model.build import Model
from hybrid.model.material import Material, tension_floor
from hybrid.model.mesh import Grading
from hybrid.model.resolution import Resolution, accuracy_of, holds_stress, requested_accuracy, wants_errors
from hybrid.scene.accuracy import of_unnamed_model
from hybrid.scene.root import Scene
from hybrid.scene.schema import AdaptiveModel, CatenaryModel, LineScene, RodModel

MODELS = {"rod": RodModel, "catenary": CatenaryModel, "adaptive": AdaptiveModel}
# Another model must cost less than this part of rods, which need no criterion and leave nothing out.
CLEARLY = {"catenary": 0.9, "adaptive": 0.8}
# Part of the price of what leaving bending out changes (COST_AS_RODS): of zones that move the result is computed
# once more as rods, of catenaries one of the runs that they are compared with, of longer cells and steps.
AS_RODS = {"catenary": 0.25, "adaptive": 0.6}
# Catenaries are a choice where criteria that count errors of position stay below 1, and that of slack below this: a
# pre-run sees outputs alone.  What zones that move would hold as rods is above it in any of them.
CALM = 0.25
# Tensions below this part of the largest are those of a line that may go slack between two outputs of a pre-run.
NEARLY_SLACK = 0.05
# A clamp or a point load makes so many lengths sqrt(EI/T) a rod, and what asks for it so many on either side of it.
DISTURBED, WIDER = 4.0, 2.0
MOST_RANGES = 4  # places of rods that are named
VISIBLY = 1.05  # times the steps of rods that are named
# Part of what a catenary may lack along the line from which on zones that move are rod (zones.at_start).
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


def with_models(scene: Scene, kinds: Mapping[str, str]) -> Scene:
    """The same with models of these kinds for lines by name, as of `with_model`."""
    lines = {name: with_model(scene.asked_scene(name), kind) for name, kind in kinds.items()}
    return scene.with_lines({name: {"model": x.model, "accuracy": x.accuracy} for name, x in lines.items()})


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
    share = of_zones.share * rods
    moving = step_time(scene, model, share, rods - share, moves=True, as_rods=AS_RODS["adaptive"])
    return (
        Cost("rod", rods, step_time(scene, model, rods, 0)),
        Cost("catenary", catenaries, step_time(scene, model, 0, catenaries, as_rods=AS_RODS["catenary"]), why_not),
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


# How much processor time a run takes: what its steps, cells and outputs cost, as bench/test_bench_plan.py measures it.
#
# Costs are those of one core of a server of 2024; on another machine all of them change by one factor.  Those of cells
# and steps are in ratio to a bare rod's cell in space, as bench/test_bench_prices.py measures them.

# s per cell and Newton iteration, in space and in a plane.
COST = {"rod": (0.4e-6, 0.16e-6), "catenary": (0.095e-6, 0.09e-6)}
# What optional forces add to that; those that are not here add nothing measurable.
MORE = {
    DRAG: (0.03e-6, 0.025e-6), ADDED_MASS: (0.03e-6, 0.025e-6), STIFFNESS_DAMPING: (0.05e-6, 0.0),
    SURFACE: (0.035e-6, 0.015e-6), SEABED: (0.024e-6, 0.018e-6), FRICTION: (0.01e-6, 0.005e-6),
}  # fmt: skip
MORE_OF_RODS = {ROTARY: (0.025e-6, 0.005e-6)}
# s per node, step and wave: sines and exponentials; of nodes that are not below all motion of the water.
COST_WAVE = 10e-9
# s of a run, a step, an output.
COST_RUN, COST_STEP, COST_OUTPUT = 0.02, 12e-6, 0.1e-3
# s of a step of zones that move, and of each of their cells: criteria, and the joints of a rod.
COST_MANAGER, COST_CRITERIA = 3e-6, 0.03e-6
COST_AS_RODS = 0.23e-6  # s per cell and step, of rods beside catenaries: by what choices of 1.0 were tried
USUAL_ITERATIONS = 2.1
# Part of a line of moving zones that is rod, on average over scenes, which differ from none to all.
ROD_SHARE = 0.38
# Moments at which the motion of the ends is looked at to foretell its steps, spread as multiples of this part of its
# duration, which no period shares; m/s3, less of which counts as none.
LOOKS, GOLDEN, TINY_RATE = 48, 0.6180339887498949, 1e-12
# Steps that follow the motion, of the least number there may be, and of those that the motion of its ends asks for: a
# line moves more sharply.
MORE_STEPS, SHARPER = 1.5, 2.2
# Times a run that a run with its coarser ones costs; with an accuracy, also the mesh pre-run and, perhaps, a finer run.
COST_ERRORS, COST_ACCURACY = 2.1, 2.6
COST_SURVEY = 0.1  # s, of the mesh pre-run and of judging errors, whatever the scene


def foretold_steps(scene: LineScene, model: Model, resolution: Resolution, least: int) -> int:
    """Steps of a run: `least` where they are of fixed length, else as many as the motion is likely to ask for.

    The error of a step grows with the rate at which the acceleration changes (docs/theory.md, (T3c)), of which that of
    the ends is known beforehand.
    """
    time, longest = scene.require_time(), resolution.step
    if resolution.local is None:
        return least
    more = MORE_STEPS * least
    if not model.ends.motions:
        return round(more)
    apart = 0.25 * longest
    moments = np.maximum((np.arange(LOOKS) * GOLDEN % 1.0) * time.duration, 2.0 * apart)
    found = [model.ends.acceleration(t + apart, apart) - model.ends.acceleration(t - apart, apart) for t in moments]
    model.ends.at(0.0)
    rate = np.linalg.norm(found, axis=2).max(axis=1) / (2.0 * apart)
    *_, part = weights.py_func(time.rho_inf, time.rho_inf, 1.0)
    lengths = SAFETY * (resolution.local / np.maximum(part * rate, TINY_RATE)) ** (1.0 / 3.0)
    return round(max(more, SHARPER * float(np.mean(time.duration / np.minimum(lengths, longest)))))


def step_time(
    scene: LineScene, model: Model, rods: float, catenaries: float, moves: bool = False, as_rods: float = 0.0
) -> float:
    """Processor time, s, of a step of a line of so many cells of either kind.

    model: of the scene, with whatever cells; moves: zones move; as_rods: as of AS_RODS.
    """
    flat, total, bits = model.plane is not None, rods + catenaries, model.line.bits
    each = COST["rod"][flat] * rods + COST["catenary"][flat] * catenaries
    each += total * sum(cost[flat] for bit, cost in MORE.items() if bits & bit)
    each += rods * sum(cost[flat] for bit, cost in MORE_OF_RODS.items() if bits & bit)
    each *= USUAL_ITERATIONS
    waves = scene.environment.waves
    if waves is not None:
        each += COST_WAVE * waves.waves_in_sum * total * _stirred(model)
    each += COST_AS_RODS * total * as_rods
    return each + COST_STEP + (COST_MANAGER + COST_CRITERIA * total) * moves


def _stirred(model: Model) -> float:
    """Part of the nodes of the first shape that waves reach; below them no wave is summed up."""
    return float(np.mean(model.start.r[:, 2] > calm_below.py_func(model.sea.values)))


def processor_time(scene: LineScene, model: Model, cells: Sequence[int], steps: int, outputs: float) -> float:
    """Processor time, s, of a run with so many steps; cells: of each zone of the model, if all is rod."""
    if scene.time is None:
        return 0.0
    counts = {"rod": 0.0, "catenary": 0.0}
    for zone, count in zip(model.zones, cells, strict=True):
        counts[zone.kind] += count
    if model.layout is not None:
        counts = {"rod": ROD_SHARE * model.cells, "catenary": (1.0 - ROD_SHARE) * model.layout.rod.size}
    step = step_time(scene, model, counts["rod"], counts["catenary"], model.layout is not None)
    one = COST_RUN + steps * step + outputs * COST_OUTPUT
    if not wants_errors(scene):
        return one
    return COST_ERRORS * one if requested_accuracy(scene) is None else COST_ACCURACY * one + COST_SURVEY
