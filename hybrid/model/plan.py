"""What would be computed for a scene, and what it would cost, without computing it.

For a scene that leaves the choice of the model: what each kind would cost, and where a catenary cannot hold the line.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil, isnan
from typing import Any, NamedTuple

import numpy as np

from hybrid.errors import refuse_value, renamed
from hybrid.kernels.laws.water import still_below
from hybrid.kernels.state.report import ADDED_MASS, DRAG, FRICTION, ROTARY, SEABED, STIFFNESS_DAMPING, SURFACE
from hybrid.kernels.state.state import Floats
from hybrid.kernels.step.step_control import SAFETY, decimal_time, weights
from hybrid.model.build import Model, build
from hybrid.model.contents import MEETS, Entry, that_may_meet, with_accuracy
from hybrid.model.initial_shape import HUNG, hung
from hybrid.model.material import Material, material, tension_floor
from hybrid.model.mesh import Grading, Zone
from hybrid.model.payout import PayoutForecast, naming_connection
from hybrid.model.resolution import (
    Resolution,
    accuracy_of,
    first_resolution,
    holds_stress,
    model_is_free,
    predicted_runs,
    requested_accuracy,
    wants_errors,
)
from hybrid.model.sections import limits_along, outer_diameter
from hybrid.scene.analysis import AdaptiveModel, CatenaryModel, RodModel, of_unnamed_model
from hybrid.scene.read import SceneLike, as_scene
from hybrid.scene.root import Scene
from hybrid.scene.schema import Asked, LineScene

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
# Part of what a catenary may lack along the line from which on zones that move are rod (zones.change).
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
    return replace(scene, **changed)


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
MORE = {DRAG: (0.03e-6, 0.025e-6), ADDED_MASS: (0.03e-6, 0.025e-6), STIFFNESS_DAMPING: (0.05e-6, 0.0)}
MORE |= {SURFACE: (0.035e-6, 0.015e-6), SEABED: (0.024e-6, 0.018e-6), FRICTION: (0.01e-6, 0.005e-6)}
MORE_OF_RODS = {ROTARY: (0.025e-6, 0.005e-6)}
# s per node, step and wave: sines and exponentials; of nodes that are not below all motion of the water.
COST_WAVE = 10e-9
# s, whatever the cells.
COST_RUN = 0.02
COST_STEP = 12e-6  # of a step
COST_OUTPUT = 0.1e-3  # of an output
# s of a step of zones that move, and of each of their cells: criteria, and the joints of a rod.
COST_MANAGER, COST_CRITERIA = 3e-6, 0.03e-6
COST_AS_RODS = 0.23e-6  # s per cell and step, of rods beside catenaries: by what choices of 1.0 were tried
USUAL_ITERATIONS = 2.1  # of Newton's method in a step
# Part of a line of moving zones that is rod, on average over scenes, which differ from none to all.
ROD_SHARE = 0.38
# Moments at which the motion of the ends is evaluated to foretell its steps.
MOMENTS = 48
GOLDEN = 0.6180339887498949  # of the duration: they are multiples of this part, which no period shares
TINY_RATE = 1e-12  # m/s3, less of which counts as none
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
    moments = np.maximum((np.arange(MOMENTS) * GOLDEN % 1.0) * time.duration, 2.0 * apart)
    found = [model.ends.acceleration(t + apart, apart) - model.ends.acceleration(t - apart, apart) for t in moments]
    model.ends.at_time(0.0)
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
        stirred = float(np.mean(model.start.r[:, 2] > still_below.py_func(model.sea.values)))  # below no wave is summed
        each += COST_WAVE * waves.waves_in_sum * total * stirred
    each += COST_AS_RODS * total * as_rods
    return each + COST_STEP + (COST_MANAGER + COST_CRITERIA * total) * moves


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


class CriticalTorque(NamedTuple):
    """The smallest torque with which the line, as it hangs, could throw a loop (hockling): 2 sqrt(EI T), and where."""

    torque: float  # N m
    s: float  # m
    tension: float  # N, there
    stiffness: float  # N m2
    diameter: float  # m; NaN: not given
    min_bend_radius: float  # m; NaN: not given
    of_tension: float = 0.0  # N m, the torque that the line already has by its tension (tension_torque), not turned
    rough: bool = False  # whether of an elastic catenary, without bed, bending and obstacles; else of the equilibrium


@dataclass(frozen=True)
class Plan:
    """What a scene requires: the contents (what is on and off), the mesh, the unknowns, and a cost estimate."""

    contents: tuple[Entry, ...]
    zones: tuple[Zone, ...]
    cells: tuple[int, ...]  # per zone
    base_cells: int | None  # where zones move: cells if all were catenary; more of rods only where cells follow
    unknowns: int
    steps: int
    step: float  # s, of most steps
    seconds: float  # of processor time, of all runs that are expected
    # Until there is a first result with its errors: the mesh pre-run and three to compare with among them.
    runs: int = 1
    most_runs: int = 1  # if that misses the accuracy that is asked
    # The same of every model that a pre-run chooses from; none: the scene names its model.  The rest is as for rods.
    choice: tuple[tuple[str, float], ...] = ()
    no_choice: str = ""  # why catenaries are none of them
    # None: an end turns freely, nothing resists bending, or the shape under all loads is not known without a search
    critical_torque: CriticalTorque | None = None
    payout: PayoutForecast | None = None  # of a line that is paid out; `cells` are those at t = 0
    most_seconds: float | None = None  # of processor time, if finer runs turn out to be needed; None: not known
    measured: bool = False  # whether cells, steps and seconds follow from the first steps of the run on this machine
    chosen: str = ""  # kind of model, where the pre-run has chosen it
    why: str = ""  # and why: what a step of each kind costs, on how many cells, and where zones would be rod

    def each_line(self) -> Iterable[tuple[str, Plan]]:
        """Names and plans of the lines: this is that of a line without a name."""
        return [("", self)]

    ledger = renamed("ledger", "contents")


MOST_OUTPUTS = 1_000_000  # of a run
MOST_STEPS = 1e12  # of a run: some months of computing
MOST_BYTES = 1e11  # of the largest file that still fits a disk
SAME_STOP = 1e-6  # of a step: stops that are so near to each other are one, or a step between them would be round-off


def parts(length: float, step: float) -> int:
    """How many equal parts, none longer than `step` but for round-off, make up `length`."""
    return max(1, ceil(min(length / step, 1e18) * (1.0 - 1e-12) - 1e-9))


def equal_steps(
    leg: tuple[float, int], now: float, stop: float, step: float, even: bool
) -> tuple[float, int, int, float]:
    """Fixed steps to a stop (s): where they are counted from (s), those done, all of them, and their length (s).

    leg: where they were counted from so far, and how many are done.  even: whether they are cut evenly; else the last
    one is shorter, and those before it are as of a run that ends before the stop.
    """
    first, done, count, length = now, 0, 1, step
    for first, done in (leg, (now, 0)):
        count = parts(stop - first, step)
        whole = abs(count * step - (stop - first)) <= SAME_STOP * step
        length = (stop - first) / count if even and not whole else step
        if abs(first + done * length - now) <= SAME_STOP * step:
            break
    return first, done, count, length


def size_of_result(scene: Asked) -> float:
    """Bytes of the file of a run, roughly."""
    return (scene.require_time().duration / scene.output_interval + 1.0) * scene.size_of_output


def refuse_too_much(scene: LineScene) -> None:
    """SceneError for more outputs, points or steps than a disk and a life have room for, before any is made."""
    time, every = scene.require_time(), scene.output_interval
    count = time.duration / every
    if count > MOST_OUTPUTS:
        fix = f"output.every: {time.duration / 1000:.3g} makes a thousand"
        expected = f"at most {MOST_OUTPUTS} outputs"
        refuse_value("output.every", f"{every:g} s, {count:.3g} outputs", expected, fix)
    points, size = scene.points_kept, size_of_result(scene)
    if size > MOST_BYTES:
        given = f"{points} points at {count + 1.0:.6g} times, some {size / 1e9:.3g} GB"
        fix = f"output.points: 101, or output.every: {time.duration / 100:.3g}"
        refuse_value("output.points", given, f"a result of at most {MOST_BYTES / 1e9:g} GB", fix)
    steps = time.duration / (time.step or time.duration)
    if steps > MOST_STEPS:
        expected = f"at most {MOST_STEPS:g} steps, some months of computing"
        refuse_value("time.step", f"{time.step:g} s, {steps:.3g} steps", expected, "make it larger")


def output_times(scene: LineScene) -> list[float]:
    """Times (s) of the outputs after the first."""
    refuse_too_much(scene)
    time, every = scene.require_time(), scene.output_interval
    return [decimal_time.py_func(k * every) for k in range(1, parts(time.duration, every))] + [time.duration]


@dataclass(frozen=True)
class NetworkPlan:
    """What lines require: the plan of each line by name, and what they come to together."""

    lines: dict[str, Plan]
    free: tuple[str, ...]  # names of the points that are free
    cells: int
    unknowns: int
    steps: int
    step: float  # s
    seconds: float  # of processor time, of all runs that are expected
    most_seconds: float | None = None  # as of `Plan`
    measured: bool = False

    def each_line(self) -> Iterable[tuple[str, Plan]]:
        """Names and plans of the lines."""
        return self.lines.items()

    @property
    def of_scene(self) -> Plan | NetworkPlan:
        """What a user asks for: of a line without a name that of the line, with what all lines come to."""
        if "" not in self.lines:
            return self
        of_all = ("steps", "step", "seconds", "most_seconds", "measured")
        return replace(self.lines[""], **{name: getattr(self, name) for name in of_all})


def plan(scene: SceneLike) -> Any:
    """What would be computed for a scene (a Scene, the path of a scene file, or a dict); nothing is computed.

    Of lines with names it is a NetworkPlan.
    """
    return plan_of_lines(as_scene(scene)).of_scene


def plan_of_lines(scene: Any) -> NetworkPlan:
    """The same of every line of a scene, and of all together."""
    scenes, plans = scene.asked_scenes, dict[str, Plan]()
    for name, line in scenes.items():
        if scene.time:
            refuse_too_much(line)
        with naming_connection(name):
            plans[name] = _plan_of_line(line)
    for name in (tuple(scenes)[k] for k in that_may_meet(scene, scenes)):
        plans[name] = replace(plans[name], contents=(*plans[name].contents, MEETS))
    return together(plans, scene.free)


def together(plans: dict[str, Plan], free: tuple[str, ...]) -> NetworkPlan:
    """Plans of lines by name, and what they come to; free: names of the points that are free."""
    every = list(plans.values())
    shortest = min(every, key=lambda x: x.step)  # all have the steps in common
    cells, unknowns = sum(sum(x.cells) for x in every), sum(x.unknowns for x in every)
    seconds = sum(x.seconds for x in every)
    return NetworkPlan(plans, free, cells, unknowns, shortest.steps, shortest.step, seconds)


def _plan_of_line(scene: LineScene) -> Plan:
    """What would be computed for a line; where its model is open, for a rod, with what others would cost."""
    if not model_is_free(scene):
        return _plan(scene)
    rods = _plan(with_model(scene, "rod"))
    why_not = structural(scene, material(scene))
    kinds = ["adaptive"] if why_not else ["catenary", "adaptive"]
    others = tuple((kind, _plan(with_model(scene, kind)).seconds) for kind in kinds)
    contents = with_accuracy(rods.contents, scene)
    return replace(rods, contents=contents, choice=(("rod", rods.seconds), *others), no_choice=why_not)


def _plan(scene: LineScene) -> Plan:
    """The same of a scene that names its model."""
    model = build(scene)
    mesh = mesh_of(model)
    cells: tuple[int, ...] = mesh["cells"]
    steps, step = 0, 0.0
    if scene.time:
        resolution = first_resolution(scene)
        steps = foretold_steps(scene, model, resolution, parts(scene.time.duration, resolution.step))
        step = min(resolution.step, scene.time.duration / steps)
    outputs = scene.time.duration / scene.output_interval if scene.time else 0.0
    paid = model.payout.forecast(scene.time.duration) if model.payout is not None and scene.time else None
    if paid is not None and not isnan(paid.mean_cells):
        mean = (*cells[:-1], max(cells[-1] + round(paid.mean_cells) - sum(cells), 1))
    else:
        mean = cells
    seconds = processor_time(scene, model, mean, steps, outputs)
    runs, most_runs = predicted_runs(scene) if scene.time else (1, 1)
    mesh |= {"runs": runs, "most_runs": most_runs, "critical_torque": _of_hanging(scene, model)}
    return Plan(model.contents, **mesh, steps=steps, step=step, seconds=seconds, payout=paid)


def mesh_of(model: Model) -> dict[str, Any]:
    """What a plan says of the mesh of a model: zones, cells, base_cells, unknowns."""
    middle = 0.5 * (model.line.s[:-1] + model.line.s[1:])
    cells = tuple(int(((middle > z.s_a) & (middle < z.s_b)).sum()) for z in model.zones)
    base = model.layout.rod.size if model.layout else None
    return {"zones": model.zones, "cells": cells, "base_cells": base, "unknowns": model.unknowns}


def _of_hanging(scene: LineScene, model: Model) -> CriticalTorque | None:
    """Of the elastic catenary that a search of equilibrium starts from, or would without a clamp at one end."""
    if not model.cable.passes_torque:
        return None
    hangs = model.start if model.start_shape == HUNG else hung(scene, model.line, model.sea.values, clamp_leads=False)
    if hangs is None or not hangs.T.min() > 0.0:
        return None
    found = critical_torque(scene, model, hangs.T)
    return None if found is None else found._replace(rough=True)


def critical_torque(scene: LineScene, model: Model, T: Floats) -> CriticalTorque | None:
    """The smallest torque with which a line under the tensions T (N,) N could throw a loop; 0 where it is slack.

    None: no torque passes through it, or nothing resists bending.
    """
    cable, line = model.cable, model.line
    if not cable.passes_torque:
        return None
    middle = 0.5 * (line.s[:-1] + line.s[1:])
    EI = cable.weakest_bending[cable.piece(middle)]
    if not EI.min() > 0.0:
        return None
    torque = 2.0 * np.sqrt(EI * np.maximum(T, 0.0))
    k = int(np.argmin(torque))
    of_tension = 0.0
    if line.tension_twist.size:
        of_tension = float(2.0 * line.tension_twist @ T / np.sum(line.h / cable.B[cable.piece(middle), 2]))
    at = middle[k : k + 1]
    radius = float(limits_along(scene, at).get("min_bend_radius", np.full(1, np.nan))[0])
    there = float(torque[k]), float(at[0]), float(T[k]), float(EI[k]), float(outer_diameter(scene, at)[0]), radius
    return CriticalTorque(*there, of_tension)


def apart(stops: Iterable[float], t: float, step: float) -> list[float]:
    """Stops after t in their order; of those that are the same but for round-off the last."""
    out: list[float] = []
    for stop in sorted([x for x in stops if x > t + SAME_STOP * step]):
        if out and stop - out[-1] <= SAME_STOP * step:
            out.pop()
        out.append(stop)
    return out


def falls_on(stop: float, times: Sequence[float], step: float) -> bool:
    """Whether a stop is one of the times, which are in order, but for round-off: by halves, at each of many stops."""
    k = bisect_left(times, stop - SAME_STOP * step)
    return k < len(times) and times[k] <= stop + SAME_STOP * step
