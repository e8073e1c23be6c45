"""What would be computed for a scene, without computing it."""

from __future__ import annotations

import warnings
from bisect import bisect_left
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from math import ceil, isnan
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hybrid.errors import Complaint, SceneError
from hybrid.kernels.state.state import Floats
from hybrid.model.build import Model, build
from hybrid.model.contents import Entry, with_accuracy
from hybrid.model.initial_shape import HUNG, hung
from hybrid.model.lines_contact import MEETS, that_may_meet
from hybrid.model.material import material
from hybrid.model.mesh import Zone
from hybrid.model.model_costs import foretold_steps, processor_time, structural, with_model
from hybrid.model.payout import PayoutForecast, naming_connection
from hybrid.model.resolution import first_resolution, model_is_free, predicted_runs
from hybrid.model.sections import limits_along, outer_diameter
from hybrid.scene.read import SceneLike, as_scene
from hybrid.scene.schema import LineScene, SceneTables

if TYPE_CHECKING:
    pass


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
    runs: int = (
        1  # until there is a first result with its errors: the mesh pre-run and three to compare with among them
    )
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

    @property
    def ledger(self) -> tuple[Entry, ...]:
        """Former name of `contents`."""
        warnings.warn("ledger is now contents", DeprecationWarning, stacklevel=2)
        return self.contents


MOST_OUTPUTS, MOST_STEPS = 1_000_000, 1e12
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


def size_of_result(scene: SceneTables) -> float:
    """Bytes of the file of a run, roughly."""
    return (scene.require_time().duration / scene.output_interval + 1.0) * scene.size_of_output


def refuse_too_much(scene: LineScene) -> None:
    """SceneError for more outputs, points or steps than a disk and a life have room for, before any is made."""
    time, every = scene.require_time(), scene.output_interval
    count = time.duration / every
    if count > MOST_OUTPUTS:
        fix = f"output.every: {time.duration / 1000:.3g} makes a thousand"
        expected = f"at most {MOST_OUTPUTS} outputs"
        raise SceneError([Complaint("output.every", f"{every:g} s, {count:.3g} outputs", expected, fix)])
    points, size = scene.points_kept, size_of_result(scene)
    if size > MOST_BYTES:
        given = f"{points} points at {count + 1.0:.6g} times, some {size / 1e9:.3g} GB"
        fix = f"output.points: 101, or output.every: {time.duration / 100:.3g}"
        raise SceneError([Complaint("output.points", given, f"a result of at most {MOST_BYTES / 1e9:g} GB", fix)])
    steps = time.duration / (time.step or time.duration)
    if steps > MOST_STEPS:
        expected = f"at most {MOST_STEPS:g} steps, some months of computing"
        raise SceneError([Complaint("time.step", f"{time.step:g} s, {steps:.3g} steps", expected, "make it larger")])


def output_times(scene: LineScene) -> list[float]:
    """Times (s) of the outputs after the first."""
    refuse_too_much(scene)
    time, every = scene.require_time(), scene.output_interval
    return [k * every for k in range(1, parts(time.duration, every))] + [time.duration]


def count_steps(scene: LineScene) -> int:
    """Steps of a run (a load that stops, or `output.exact`, may add some); where they follow the motion: the least."""
    return parts(scene.require_time().duration, first_resolution(scene).step)


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
        return replace(
            self.lines[""], steps=self.steps, step=self.step, seconds=self.seconds, most_seconds=self.most_seconds,
            measured=self.measured,
        )  # fmt: skip


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
    return NetworkPlan(
        plans, free, sum(sum(x.cells) for x in every), sum(x.unknowns for x in every), shortest.steps, shortest.step,
        sum(x.seconds for x in every),
    )  # fmt: skip


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
        steps = foretold_steps(scene, model, resolution, count_steps(scene))
        step = min(resolution.step, scene.time.duration / steps)
    outputs = scene.time.duration / scene.output_interval if scene.time else 0.0
    paid = model.payout.forecast(scene.time.duration) if model.payout is not None and scene.time else None
    if paid is not None and not isnan(paid.mean_cells):
        mean = (*cells[:-1], max(cells[-1] + round(paid.mean_cells) - sum(cells), 1))
    else:
        mean = cells
    seconds = processor_time(scene, model, mean, steps, outputs)
    runs, most_runs = predicted_runs(scene) if scene.time else (1, 1)
    return Plan(
        model.contents, **mesh, steps=steps, step=step, seconds=seconds, runs=runs, most_runs=most_runs,
        critical_torque=_of_hanging(scene, model), payout=paid,
    )  # fmt: skip


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
    radius = limits_along(scene, at).get("min_bend_radius", np.full(1, np.nan))
    return CriticalTorque(
        float(torque[k]),
        float(at[0]),
        float(T[k]),
        float(EI[k]),
        float(outer_diameter(scene, at)[0]),
        float(radius[0]),
        of_tension,
    )


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
