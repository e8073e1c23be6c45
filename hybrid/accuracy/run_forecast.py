"""What a run will take, from its own beginning: the mesh pre-run and the first steps, in a budget of processor time.

Cells, steps and what a step costs are then those of the scene, on this machine, as busy as it is.  What neither shows,
whether a finer run is needed and contact to come, is the difference between the expected time and the largest.
"""

from __future__ import annotations

import time as clock
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from hybrid.accuracy.model_choice import chosen_and_surveyed
from hybrid.accuracy.refinement import times_the_cost
from hybrid.errors import ComputationError
from hybrid.kernels.machine.compile import is_warm
from hybrid.kernels.state.state import State
from hybrid.model import plan as tables
from hybrid.model.build import Model, build
from hybrid.model.contents import with_accuracy
from hybrid.model.network import NetworkResolution
from hybrid.model.plan import COST_STEP, NAMED, ModelChoice, NetworkPlan, Plan
from hybrid.model.resolution import Resolution, requested_accuracy, wants_errors
from hybrid.scene.network import Network
from hybrid.scene.read import SceneLike, as_scene
from hybrid.scene.root import Scene
from hybrid.scene.schema import LineScene
from hybrid.simulation.case import Case
from hybrid.simulation.first_use import kernels_of
from hybrid.simulation.run import Run
from hybrid.simulation.run_record import Recording
from hybrid.simulation.run_sample import RunSample
from hybrid.solve.stepper import LineFailed
from hybrid.store.stored_rows import ComparisonRecorder

# s of processor time that parts of a forecast may take.
PRE_RUN = 0.2
FIRST_STEPS = 0.1  # of the result
CHOICE = 1.0  # a pre-run that chooses the model
# Of a run whose number of steps is known: so many show what one costs.
ENOUGH_STEPS = 400
# Cells of a line whose equilibrium, which comes before its first steps, takes no longer than these.
MOST_CELLS = 4000
# s of the file of a result, and of judging and writing errors (bench/test_bench_plan.py).
FILE, JUDGING = 0.02, 0.1
# s beyond their budget that steps take only where something is done once; after so many they have grown to the motion.
ONCE, SETTLED = 1.0, 40
# How much dearer steps are, over a whole run, of a line that is to touch itself: expected, and at most.
TOUCHING, MOST_TOUCHING = 2.5, 6.0
# Iterations of Newton's method in a step of several lines once loads have grown: of a fish farm of 33 lines 3.1, and
# fewer while its waves grow, which is all that a plan sees.
LATER = 3.0
# Results that an accuracy takes at most over the first, where its budget allows them: finer ones may follow it.
MOST_FINER = 9.0


def plan(scene: SceneLike, *, measure: bool = True) -> Any:
    """What would be computed for a scene (a Scene, the path of a scene file, or a dict), and how long it would take.

    measure: the mesh pre-run and the first steps are computed (at most about 0.3 s of processor time, 1.1 s where they
    choose the model), so that cells, steps and processor time are those of this scene on this machine, and the model is
    that of a run; False: nothing is computed, and they are estimated from tables, as where kernels are not compiled
    yet.  Of several lines it is a NetworkPlan.
    """
    asked = as_scene(scene)
    made = tables.plan_of_lines(asked)
    return (_measured(asked, made) if measure and asked.time is not None else made).of_scene


class Seen(NamedTuple):
    """How far a run was: s of processor time, steps, time of the motion, s."""

    cpu: float
    steps: int
    t: float


def _cost_of_a_step(seen: Sequence[Seen]) -> float:
    """s of processor time in the median of steps, so that what is done once does not count."""
    parts = [((y.cpu - x.cpu) / (y.steps - x.steps), y.steps - x.steps) for x, y in pairwise(seen) if y.steps > x.steps]
    half = 0.5 * sum(n for _, n in parts)
    for cost, n in sorted(parts):
        half -= n
        if half <= 0.0:
            return cost
    return seen[-1].cpu - seen[0].cpu


def _steps_a_second(seen: Sequence[Seen]) -> float:
    """Steps in a second of motion, of the second half of the steps: the first ones are short, to begin with."""
    end = seen[-1]
    before = [x for x in seen if 2 * x.steps <= end.steps]
    since = before[-1] if before else seen[0]
    return (end.steps - since.steps) / max(end.t - since.t, 1e-9)


class _Probe(Case):
    """A case whose passes end (KeyboardInterrupt) when their budget is used up."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene, None)
        self.run: Run | None = None  # the last
        self.at_rest: dict[str, tuple[Model, State]] = {}  # where lines begin, if that is an equilibrium
        self._end = np.inf
        self._most_steps = np.inf
        self.seen: list[Seen] = []  # of the last run
        self.iterations: list[int] = []  # of Newton's method, in its steps that were looked at
        self.interrupted = self._is_used_up

    def _is_used_up(self) -> bool:
        now, steps = clock.process_time(), 0
        if self.run is not None:
            steps = self.run.steps
            self.seen.append(Seen(now, steps, self.run.t))
            self.iterations.append(self.run.loop.counts.iterations)
        if steps < self._most_steps and self._end + ONCE < now < np.inf and len(self.seen) == 2:
            self._end = now + FIRST_STEPS  # what is done once, as compiling, is no cost of a step
        return steps >= self._most_steps or now > self._end

    def allow(self, seconds: float, steps: float = np.inf) -> None:
        """Processor time, s, and steps for what follows."""
        self._end, self._most_steps = clock.process_time() + seconds, steps

    def _network_run(self, *args: Any, **kwargs: Any) -> Run:
        self.run = super()._network_run(*args, **kwargs)
        self.seen, self.iterations = [Seen(clock.process_time(), 0, 0.0)], []
        return self.run

    def first_steps(self, resolution: NetworkResolution) -> tuple[Run, float, float]:
        """A result after its first steps, and what they took.

        s of processor time before them, and of so many steps without what is done once.
        """
        begin = begun = clock.process_time()
        self.allow(np.inf)
        run = self._network_run(resolution, None, Recording(touches=self.touches_itself))
        names, models, lines = run.model.names, run.model.models, [x.copy() for x in run.state.lines]
        if run.found is not None:
            self.at_rest = dict(zip(names, zip(models, lines, strict=True), strict=True))
        known = resolution.one.local is None and all(x.payout is None for x in models)
        self.allow(FIRST_STEPS, ENOUGH_STEPS if known else np.inf)
        try:
            run.begin_motion()
            begun = clock.process_time()  # the first state is made once, however many steps there are
            self.seen = [Seen(begun, run.steps, run.t)]
            for stop in run.stops():
                run.go_to(stop)
        except KeyboardInterrupt:
            pass
        except LineFailed as failed:
            raise run.failed(failed) from None
        self.seen.append(Seen(clock.process_time(), run.steps, run.t))
        return run, begun - begin, run.steps * _cost_of_a_step(self.seen)


def _measured(scene: Scene, found: NetworkPlan) -> NetworkPlan:
    """The same, with what the pre-run and the first steps show.

    As it is where kernels are to be compiled first, or the equilibrium would take longer to find than a plan may.
    """
    if found.cells > MOST_CELLS or not is_warm(kernels_of(scene)):
        return found
    case, cut, begin = _Probe(scene), False, clock.process_time()
    scenes, finely, choices = case.lines, NetworkResolution.of(case.lines), dict[str, ModelChoice]()
    plans = dict(zip(scenes, found.lines.values(), strict=True))
    open_yet = [name for name, x in plans.items() if x.choice]
    case.allow(CHOICE if open_yet else PRE_RUN)
    try:
        try:
            choices, finely = chosen_and_surveyed(case, finely)
        except KeyboardInterrupt:
            cut = True
            case.scene = case.with_models(dict.fromkeys(open_yet, "rod"))  # as the pre-run is
        survey, coarse = clock.process_time() - begin, case.run
        if cut and coarse is not None:
            survey += _still_to_come(case.seen, scene.require_time().duration)
        if not is_warm(kernels_of(case.scene)):
            return found
        run, setup, spent = case.first_steps(finely)
    except ComputationError:
        return found  # the run will say why
    steps = _steps(found, finely.one, run, coarse, case.seen)
    motion = steps * _dearer(plans.values()) * _later(case, run) * spent / max(run.steps, 1)
    seconds, most = _of_passes(scenes, setup, motion, plans)
    if any(x.contact.self for x in scenes.values()):  # by name: the first steps show nothing of it
        seconds, most = seconds + (TOUCHING - 1.0) * motion, most + (MOST_TOUCHING - 1.0) * motion
    if case.scene.slack_becomes_rod:
        most += (TOUCHING - 1.0) * motion
    made, lines = zip(finely.lines.values(), case.scene.asked_scenes.values(), strict=True), dict[str, Plan]()
    for name, called, (resolution, line) in zip(found.lines, scenes, made, strict=True):
        model, choice = build(line, resolution), choices.get(called, NAMED)
        lines[name] = _of_line(case, called, scenes[called], plans[called], model, choice)
    together = tables.together(lines, found.free)
    step = min(finely.one.step, scene.require_time().duration / steps)
    together = replace(together, steps=round(steps), step=step, measured=True)
    return replace(together, seconds=survey + seconds, most_seconds=survey + most)


def _of_line(case: _Probe, name: str, scene: LineScene, found: Plan, model: Model, choice: ModelChoice) -> Plan:
    """A line as it will be computed: its cells, how it is paid out, its accuracy in metres; scene: as it was asked."""
    payout = model.payout.forecast(scene.require_time().duration) if model.payout is not None else None
    torque = found.critical_torque
    if name in case.at_rest:
        here, state = case.at_rest[name]
        torque = tables.critical_torque(scene, here, state.T)
    contents = with_accuracy(found.contents, scene, case.reach.get(name))
    mesh = tables.mesh_of(model) | {"payout": payout, "critical_torque": torque}
    return replace(found, **mesh, contents=contents, chosen=choice.kind, why=choice.why)


def _still_to_come(seen: Sequence[Seen], duration: float) -> float:
    """s of processor time that a pre-run would still take to the end of the motion, s, which was cut."""
    return _cost_of_a_step(seen) * _steps_a_second(seen) * max(duration - seen[-1].t, 0.0)


def _dearer(plans: Iterable[Plan]) -> float:
    """How much dearer a step is on average than the first ones, where lines are paid out."""
    first = mean = 0.0
    for x in plans:
        first += sum(x.cells)
        mean += sum(x.cells) if x.payout is None or np.isnan(x.payout.mean_cells) else x.payout.mean_cells
    return (COST_STEP + CELL * mean) / (COST_STEP + CELL * first)


def _later(case: _Probe, run: Run) -> float:
    """How much dearer a step is than the first ones, once loads and motions that grow from nothing have grown."""
    if len(run.lines) == 1 or run.t >= min(_grown(case.scene), case.scene.require_time().duration):
        return 1.0
    return max(1.0, LATER / max(float(np.mean(case.iterations)), 1.0))


def _steps(found: NetworkPlan, resolution: Resolution, run: Run, coarse: Run | None, seen: Sequence[Seen]) -> float:
    """Steps of the result, which has come as far as its run.

    coarse: of the mesh pre-run, whose steps, longer by one factor, show how many each part of the motion asks for.
    seen: of its run.
    """
    duration = run.times[-1]
    if run.t >= duration:
        return float(run.steps)
    if resolution.local is None:
        return float(found.steps)
    rate = _steps_a_second(seen)
    if run.steps < SETTLED:  # they still grow: not shorter than the next is to be
        rate = min(rate, 1.0 / float(run.loop.clock.next_dt))
    linear = run.steps + rate * (duration - run.t)
    if coarse is None or coarse is run or not coarse.steps:
        return linear
    recorder = coarse.lines[0].recorder
    assert isinstance(recorder, ComparisonRecorder)
    times = recorder.steps[:, 0]
    passed = int((times <= run.t).sum())
    if not passed:
        return linear
    return run.steps * times.size / passed * duration / max(coarse.t, 1e-9 * duration)


def _of_passes(
    scenes: Mapping[str, LineScene], setup: float, motion: float, plans: Mapping[str, Plan]
) -> tuple[float, float]:
    """Processor time, s, of all runs after the pre-run: expected, and at most.

    setup, motion: s, of a result before its first step, and of its steps; scenes, plans: of the lines by name.
    """
    one, files = setup + motion, FILE * len(scenes)
    for scene in scenes.values():
        points = scene.output.points if isinstance(scene.output.points, int) else len(scene.output.points)
        files += scene.require_time().duration / scene.output_interval * (OUTPUT + POINT * points)
    estimated = sum(map(wants_errors, scenes.values()))
    if not estimated:
        return one + files, one + files
    first = one + files + 3.0 * setup + COMPARISONS * motion + JUDGING * estimated
    if all(requested_accuracy(scenes[name]) is None or x.most_runs == x.runs for name, x in plans.items()):
        return first, first
    expected = first + FINER * one
    return expected, min(first + MOST_FINER * one, max(MOST_TIMES * expected, LEAST))


def _grown(network: Network) -> float:
    """When all loads and motions of a network that grow from nothing have grown, s."""
    moved = [getattr(x, "motion", None) for x in (*network.points.values(), *network.bodies.values())]
    return max((getattr(x, "ramp", None) or 0.0 for x in (network.environment.waves, *moved)), default=0.0)


# How much all results for an accuracy may take: some times what the first result foretells of them.
#
# It goes by steps, cells and outputs, not by a clock, so that a run that is resumed is refined as often as one that was
# not stopped.

# s of processor time (bench/test_bench_plan.py).
CELL = 1e-6  # in a step
OUTPUT = 0.06e-3  # of an output, whatever its points
POINT = 0.6e-6  # of an output
# Of the steps of the first result, what the runs to compare with take, and, on average, the finer results.
COMPARISONS, FINER = 0.9, 0.5
# All may take so many times what was foretold; less than so much, in s, is not worth a result that misses.
MOST_TIMES, LEAST = 4.0, 10.0


@dataclass
class Budget:
    """What results have taken and may take, s of processor time as foretold; outputs: of one, number and points."""

    outputs: int
    points: int
    first: float = 0.0  # of the steps of the first result
    spent: float = 0.0  # of all until now
    beyond: float = 0.0  # times what was foretold that all would take with the next; 0: within

    @property
    def _of_outputs(self) -> float:
        return self.outputs * (OUTPUT + POINT * self.points)

    @property
    def foretold(self) -> float:
        """What all of them take, by the first."""
        return self._of_outputs + self.first * (1.0 + COMPARISONS + FINER)

    def spend(self, runs: Sequence[RunSample]) -> None:
        """A result is there; runs: of its lines."""
        steps = _of_steps(runs)
        if not self.first:
            self.first, self.spent = steps, COMPARISONS * steps
        self.spent += steps + self._of_outputs

    def allows(self, runs: Sequence[RunSample], finer: Sequence[Resolution]) -> bool:
        """Whether a finer result than the last, of these runs, may follow."""
        more = max(times_the_cost(run.resolution, x) for run, x in zip(runs, finer, strict=True))
        total = self.spent + more * _of_steps(runs) + self._of_outputs
        self.beyond = total / self.foretold if total > max(MOST_TIMES * self.foretold, LEAST) else 0.0
        return not self.beyond

    def text(self, runs: Sequence[RunSample], finer: Sequence[Resolution]) -> str:
        """Why it does not, and what it would take; arguments as of `allows`."""
        finer_by = [x.fineness / run.resolution.fineness for run, x in zip(runs, finer, strict=True)]
        more = [times_the_cost(run.resolution, x) for run, x in zip(runs, finer, strict=True)]
        cells = sum(run.cells * by for run, by in zip(runs, finer_by, strict=True))
        steps = runs[0].steps * max(one / by for one, by in zip(more, finer_by, strict=True))
        return (
            f"refined no further: with the next run, of about {cells:.2g} cells and {steps:.2g} steps, all would take "
            f"{self.beyond:.2g} times the processor time that the first result foretold, and {MOST_TIMES:g} are allowed"
        )

    def checkpoint(self) -> list[float]:
        """As plain values."""
        return [self.first, self.spent]

    def restore(self, saved: Sequence[float]) -> None:
        """Go on as `checkpoint` has said."""
        self.first, self.spent = saved


def _of_steps(runs: Sequence[RunSample]) -> float:
    return sum(run.steps * (COST_STEP + CELL * run.cells) for run in runs)
