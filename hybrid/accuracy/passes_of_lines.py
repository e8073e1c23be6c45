"""Several lines, computed as often and as finely as it takes for the accuracy that is asked of each.

As of one cable (accuracy.error_control): a coarse run shows where cells should be short, the result follows, coarser
runs show what its errors are, and where it misses what is asked, a finer one follows.  Each line has an error control
of its own, which sees the line in all of the runs; what one of them asks for, all get: steps are the same, and the
error of a line may come from the cells of the next.
"""

from __future__ import annotations

import io
import time as clock
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.accuracy.budget import Budget
from hybrid.accuracy.error_control import ErrorController, comparison_resolutions
from hybrid.accuracy.error_estimate import Estimate
from hybrid.accuracy.error_report import accuracy_figures, effort, error_fields, known
from hybrid.accuracy.error_statistics import statistics_of
from hybrid.accuracy.finer_result import NOT_KEPT, Replacement, is_no_better, not_kept_text
from hybrid.accuracy.model_choice import NEAR, choice_of
from hybrid.accuracy.model_errors_of_lines import Stretches, as_rods, rods_of, with_model_errors
from hybrid.accuracy.passes import emptied, free_in
from hybrid.accuracy.refinement import (
    COSTLY_ACCURACY,
    WORTH_WRITING,
    costly,
    times_the_cost,
)
from hybrid.accuracy.samples_of_lines import compared, extremes_of, sample_of, touch_unasked
from hybrid.adapt.user_criterion import UserCriterion
from hybrid.errors import ComputationError, SceneError
from hybrid.model.model_costs import NAMED, REST, ModelChoice, with_models
from hybrid.model.network import NetworkResolution, build_system
from hybrid.model.output_points import output_points
from hybrid.model.plan import output_times
from hybrid.model.resolution import (
    Resolution,
    is_irregular,
    may_be_held,
    mesh_is_free,
    model_is_free,
    requested_accuracy,
    rubs_on_obstacles,
    wants_errors,
    wants_survey,
)
from hybrid.model.self_reach import system_without_contact
from hybrid.scene.network_scene import Network
from hybrid.scene.read import scene_text
from hybrid.scene.schema import AdaptiveModel, LineScene
from hybrid.simulation.layer_mesh import layered_lines, shown_lines
from hybrid.simulation.load_change import with_loads_of
from hybrid.simulation.mesh_survey import Survey, survey_duration, survey_points, survey_resolution, with_survey
from hybrid.simulation.network_run import Recording, run_system, static_system
from hybrid.simulation.progress import ESTIMATION, PRE_RUN, REFINEMENT, RESULT, ProgressReporter
from hybrid.simulation.restart import LoadChange, changes_text
from hybrid.simulation.restore import is_cut_off, kept_resolution, refused, resolution_from, resolution_tree
from hybrid.simulation.run_sample import RunSample
from hybrid.store.amend import amend_lines
from hybrid.store.checkpoint import read_before
from hybrid.store.comparison_recorder import ComparisonRecorder
from hybrid.store.format import Field
from hybrid.store.hdf5_file import opened
from hybrid.store.named_arrays import Tree
from hybrid.store.reader import Result, open_result
from hybrid.store.records import ERROR_ESTIMATE, not_converged_attribute
from hybrid.store.writer import WriteMode

if TYPE_CHECKING:
    from hybrid.accuracy.free_vibrations import LostBy

Samples = dict[str, RunSample]  # of the lines, by name


def is_refined(system: Network) -> bool:
    """Whether errors of a line are estimated, for which it is computed several times."""
    return any(wants_errors(system.scene_of(name)) for name in system.lines)


class LineController(ErrorController):
    """The error control of one line; runs to compare with are of all lines, and others compute them."""

    def _compute_comparisons(self, resolution: Resolution) -> None:
        pass

    def _renew_model_errors(self, estimate: Estimate, resolution: Resolution) -> None:
        pass

    def _in_shorter_steps(self, coarse: RunSample) -> None:
        pass

    def takes_model_errors(self, run: RunSample) -> None:
        """Take what leaving bending out changes from a run, in place of what is known."""
        assert self.estimate is not None
        self.estimate.set_model_errors(run)
        if self.statistics:
            found = statistics_of(run, self._every)
            for name, of_statistic in self.statistics.items():
                of_statistic.set_model_errors(found[name])


class PassesOfLines:
    """All runs that the result of a system takes."""

    def __init__(
        self, system: Network, target: Path | io.BytesIO, moves: bool, reporter: ProgressReporter,
        interrupted: Callable[[], bool], notes: Sequence[tuple[str, str]] = (),
        criterion: UserCriterion | None = None, changes: Sequence[LoadChange[Network]] = (),
    ) -> None:  # fmt: skip
        """moves: whether its motion is computed, else its equilibrium; others as of `run_system`."""
        self._of_results, self._criterion = notes, criterion
        self._changes = [replace(x, scene=with_loads_of(system, x.scene)) for x in changes]
        self.system, self.target, self.moves = system, target, moves
        self._replacement = Replacement(target, goes_on=moves)
        self.reporter, self.interrupted = reporter, interrupted
        time = system.time
        self._steps_free = moves and time is not None and time.controlled and time.tolerance is None
        self.scenes, self.controls = dict[str, LineScene](), dict[str, LineController]()
        self._use_models({})
        # Of lines, stretches (m) that were rod at any output: of the last run to compare with, and of the result.
        self._compared_rods, self._result_rods = dict[str, Stretches](), dict[str, Stretches]()
        # Whether a line has touched itself in a result: then lines may in runs to compare with; and whether they could.
        self._touches = self._compared_touching = False
        self._touching = set[str]()  # lines that have touched themselves in the last run to compare with
        points = sum(output_points(scene).s.size for scene in self.scenes.values())
        self._budget = Budget(len(self._times), points) if moves else None
        self._costs: list[float] = []  # s of processor time, of all runs
        self._notes: list[tuple[str, str]] = []  # events of the system
        self._begin = clock.process_time()

    @property
    def _times(self) -> list[float]:
        """Of outputs, s."""
        return output_times(next(iter(self.scenes.values()))) if self.moves else []

    def _use_models(self, choices: Mapping[str, ModelChoice]) -> None:
        """Go on with other models of lines, by name, and controls of their errors."""
        system = self.system = with_models(self.system, {name: x.kind for name, x in choices.items()})
        self.scenes = {name: system.scene_of(name) for name in system.lines}
        self.controls = {
            name: LineController(
                requested_accuracy(scene), free_in(scene)._replace(steps=self._steps_free), self.moves, _elsewhere,
                _elsewhere, irregular=self.moves and is_irregular(scene), choice=choices.get(name, NAMED),
                from_rest=not (self.moves and system.starts_as_placed), rubs=rubs_on_obstacles(scene),
                times=np.array([0.0, *self._times]), held=may_be_held(scene),
            )
            for name, scene in self.scenes.items()
        }  # fmt: skip

    # --- runs -----------------------------------------------------------------------------------

    def compute(self, source: Path | None = None) -> None:
        """The result, as fine as it takes, with its errors; source: a result to go on with."""
        first, result = self._goes_on(source) if source is not None else (None, None)
        if first is None:
            first = self.surveyed(NetworkResolution.first(self.system))
            self._expect(first)
            try:
                resolution, result = self._first_result(first)
            except ComputationError as error:
                if not self._rods_instead({error.line_name: str(error).splitlines()[0]}):
                    raise
                emptied(self.target, error)
                resolution, result = self._first_result(self.surveyed(NetworkResolution.first(self.system)))
        else:
            assert source is not None and result is not None
            resolution = kept_resolution(self.system, source)
            self._spend(result)
            self._compare(first)
        self._refine(resolution, result)
        if self._rods_instead({name: x.model_misses for name, x in self.controls.items() if x.model_misses}):
            emptied(self.target)
            self._replacement = Replacement(self.target, goes_on=self.moves)
            self._refine(*self._first_result(self.surveyed(NetworkResolution.first(self.system))))

    def _rods_instead(self, failed: Mapping[str, str]) -> bool:
        """Rods for lines that were chosen to be catenaries, and why that failed; whether there is one."""
        names = [name for name, x in self.controls.items() if name in failed and x.choice.kind == "catenary"]
        tried = "catenaries, which cost less, were tried: "
        if names:
            choices = {name: x.choice for name, x in self.controls.items() if x.choice.kind}
            self._use_models(choices | {name: ModelChoice("rod", tried + failed[name]) for name in names})
        return bool(names)

    def _first_result(self, first: NetworkResolution) -> tuple[NetworkResolution, Samples]:
        """The first result, of cells half as long where on these, or those to compare with, no equilibrium is found."""
        while True:
            try:
                result = self._record(first, self.target, RESULT, found=_tree(first))
                break
            except ComputationError as error:
                if not any([x.finds_no_rest(error) for x in self.controls.values()]):
                    raise
            first = self._halved(first)
        self._spend(result)
        self._compare(first)
        while any(x.comparisons is None and x.is_too_coarse(result[name]) for name, x in self.controls.items()):
            for control in self.controls.values():
                control.halve()
            finer = self._halved(first)
            try:
                result = self._replacement.finer(partial(self._record_finer, finer))
            except ComputationError as error:
                for control in self.controls.values():
                    control.lacks_errors(error, "finer run")
                break
            self._replacement.settle(True)
            first = finer
            self._spend(result)
            self._compare(first)
        return first, result

    def _halved(self, now: NetworkResolution) -> NetworkResolution:
        """Cells half as long, of lines that leave their mesh open."""
        free = {name: mesh_is_free(scene) for name, scene in self.scenes.items()}
        return NetworkResolution({name: x.coarser(0.5) if free[name] else x for name, x in now.lines.items()})

    def _spend(self, result: Samples) -> None:
        if self._budget is not None:
            self._budget.spend(list(result.values()))

    def _goes_on(self, source: Path) -> tuple[NetworkResolution, Samples]:
        """What the runs to compare with were computed for, and the result, which is computed to its end."""
        assert isinstance(self.target, Path)
        with opened(source) as file:
            tree = read_before(file)
        with refused(source):
            self._costs += [0.0] * any(wants_survey(scene) for scene in self.scenes.values())
            first = kept_resolution(self.system, source)  # as it is where nothing else was kept
            if tree:
                first = NetworkResolution({name: resolution_from(tree[name], x) for name, x in self.scenes.items()})
        with open_result(source) as found:
            done = found.status == "complete" and self._is_at_end(found)
        if not done or source != self.target:
            return first, self._record(None, self.target, RESULT, source, tree)
        self._costs.append(0.0)
        return first, self._samples(self.target, kept_resolution(self.system, source), 0.0)

    def _is_at_end(self, found: Result) -> bool:
        end = self.system.require_time().duration
        return len(found.times) > 0 and float(found.times[-1]) >= end * (1.0 - 1e-9)

    def _record(
        self, resolution: NetworkResolution | None, target: Path | io.BytesIO | None, name: str,
        source: Path | None = None, found: Tree | None = None, system: Network | None = None,
    ) -> Samples:  # fmt: skip
        """Compute the system, or another; what is compared of its lines.  target: None: it is for that alone."""
        begin, asked = clock.process_time(), system or self.system
        if target is None and self.moves and not self._touches:
            asked = system_without_contact(asked)
        if self.moves:
            recording = Recording(WriteMode(found or {}), source, ERROR_ESTIMATE, self._of_results)
            run = run_system(
                asked, target, scene_text(asked), self.reporter, self.interrupted, name, resolution, recording,
                self._criterion, self._changes,
            )  # fmt: skip
        else:
            run = static_system(asked, target, scene_text(asked), resolution, ERROR_ESTIMATE)
        self._costs.append(clock.process_time() - begin)
        if target is not None:
            return self._samples(target, run.resolution, self._costs[-1])
        self._touching = {x.name for x in run.lines if x.touches}
        recorders = {x.name: x.recorder for x in run.lines}
        self._compared_rods = {n: x.rods for n, x in recorders.items() if isinstance(x, ComparisonRecorder)}
        return {x.name: compared(x, run, self._costs[-1]) for x in run.lines}

    def _record_finer(self, resolution: NetworkResolution, to: Path | io.BytesIO) -> Samples:
        """A finer result beside the one that is there, or the rest of it."""
        texts, source = (scene_text(self.system), changes_text(self._changes)), None
        if isinstance(to, Path) and is_cut_off(to, texts, resolution):
            source = to
        return self._record(resolution, to, REFINEMENT, source, _tree(resolution))

    def _samples(self, target: Path | io.BytesIO, resolution: NetworkResolution, cpu: float) -> Samples:
        """What is compared of a complete result."""
        system = build_system(self.system, resolution=resolution)
        models = dict(zip(system.names, system.models, strict=True))
        with open_result(target) as result:
            self._result_rods = {name: rods_of(line) for name, line in result.lines.items()}
            self._touches |= touch_unasked(self.system, result)
            return {
                n: sample_of(line, resolution.lines[n], models[n], cpu, extremes_of(self.system, result, n))
                for n, line in result.lines.items()
            }

    def surveyed(self, first: NetworkResolution) -> NetworkResolution:
        """With cells where a coarse run shows that they should be; where nothing is asked, the equilibrium."""
        first = layered_lines(self.system, first, self.moves)
        free = [name for name, scene in self.scenes.items() if wants_survey(scene)]
        if not free:
            return first
        if not self.moves and (chosen := [x for x in free if model_is_free(self.scenes[x], moves=False)]):
            self._use_models(dict.fromkeys(chosen, ModelChoice("rod", REST)))
        coarse = NetworkResolution({name: survey_resolution(x) for name, x in first.lines.items()})
        if not self.moves:
            coarse = NetworkResolution({name: replace(x, every=1) for name, x in coarse.lines.items()})
        coarse = shown_lines(self.system, coarse, self.moves)
        self._expect(first, coarse)
        moving = [name for name in free if isinstance(self.scenes[name].model, AdaptiveModel)]
        rods = with_models(self.system, dict.fromkeys(moving, "rod"))  # which alone show what zones leave out of a bend
        model = build_system(rods, resolution=coarse)
        places = {name: survey_points(x, coarse.lines[name]) for name, x in zip(model.names, model.models, strict=True)}
        points = {name: tuple(s.tolist()) for name, s in places.items()}
        output = self.system.output.model_copy(update={"points": points, "quantities": {}})
        changed: dict[str, Any] = {"output": output}
        if self.moves:
            until = max(survey_duration(self.scenes[name]) for name in free)
            every = self.system.output_interval
            changed["output"] = output.model_copy(update={"every": every})
            changed["time"] = self.system.require_time().model_copy(update={"duration": until})
        try:
            asked = rods.model_copy(update=changed)
            runs = self._record(coarse, None, PRE_RUN, system=asked)
        except ComputationError:
            failed = ModelChoice("rod", "the pre-run that would show what others cost failed")
            self._use_models({name: failed for name in free if self._leaves_model(name)})
            return first
        out, choices = dict(first.lines), dict[str, ModelChoice]()
        for name in free:
            scene, of_line = self.scenes[name], model.models[model.names.index(name)]
            s = output_points(asked.scene_of(name)).s  # point loads are among them, too
            here = np.abs(s[:, None] - places[name]).argmin(axis=0)
            found = runs[name].values
            values = {x: np.asarray(found[x])[:, here] for x in ("curvature", "tension", "position")}
            survey = Survey.of(scene, first.lines[name], of_line, places[name], values)
            if self._leaves_model(name):
                near = NEAR if name in self._touching else ""
                choices[name], out[name] = choice_of(scene, rods.scene_of(name), survey, first.lines[name], near)
            else:
                out[name] = with_survey(first.lines[name], scene, survey)
        if choices:
            self._use_models(choices)
        return NetworkResolution(out)

    def _leaves_model(self, name: str) -> bool:
        """Whether the model of a line is still to be chosen."""
        open_yet = self.moves and self._criterion is None and not self.controls[name].choice.kind
        return open_yet and model_is_free(self.scenes[name])

    def _expect(self, first: NetworkResolution, coarse: NetworkResolution | None = None) -> None:
        """Tell the progress which passes are to come; coarse: of a pre-run that is still to be computed."""
        if not self.moves:
            return
        passes = [(PRE_RUN, coarse.one)] if coarse is not None else []
        passes += [(RESULT, first.one)]
        if is_refined(self.system):
            passes += [(ESTIMATION, x) for x in comparison_resolutions(first.one, self.moves)]
        self.reporter.expect(passes, first.one)

    def _compare(self, first: NetworkResolution) -> None:
        """The runs to compare with, as of `ErrorController`."""
        self._compared_touching = self._touches
        every = {name: comparison_resolutions(x, self.moves) for name, x in first.lines.items()}
        found: list[Samples | None] = [None, None, None]
        failed: ComputationError | None = None
        for k in (0, 1, 2) if self.moves else (0, 2):  # without steps the second is the first
            resolution = NetworkResolution({name: x[k] for name, x in every.items()})
            try:
                found[k] = self._record(resolution, None, ESTIMATION)
            except ComputationError as error:
                if not k:
                    failed = error
                    break
            if not k and (first_found := found[0]) is not None:
                found[0] = self._with_model_errors(first_found, resolution, self._compared_rods)
        for name, control in self.controls.items():
            control.runs[:] = self._costs
            control.compare_with([x[name] if x is not None else None for x in found], failed)

    def _with_model_errors(
        self, runs: Samples, resolution: NetworkResolution, rods_then: Mapping[str, Stretches]
    ) -> Samples:
        """A run with what leaving bending out changes in it; resolution: of that run; rods_then: m, its rods."""
        rods, finely, names = as_rods(self.system, resolution, rods_then)
        found, failed = None, ""
        try:
            found = self._record(finely, None, ESTIMATION, system=rods) if names else None
        except (ComputationError, SceneError) as error:
            failed = str(error).splitlines()[0]
        return with_model_errors(runs, found, names, failed)

    def _finer(self, now: NetworkResolution, wanted: Mapping[str, Resolution]) -> NetworkResolution:
        """As fine as the finest that is wanted; what the scene gives stays."""
        cells = max(x.fineness / now.lines[name].fineness for name, x in wanted.items())
        steps = min(x.step / now.one.step if now.one.step else 1.0 for x in wanted.values())
        free = {name: cells if mesh_is_free(scene) else 1.0 for name, scene in self.scenes.items()}
        steps = steps if self._steps_free else 1.0
        zones = {name: min(x.zones, wanted[name].zones if name in wanted else x.zones) for name, x in now.lines.items()}
        return NetworkResolution(
            {name: replace(x.coarser(1.0 / free[name], steps), zones=zones[name]) for name, x in now.lines.items()}
        )

    # --- judgement ------------------------------------------------------------------------------

    def _refine(self, resolution: NetworkResolution, result: Samples) -> None:
        """Finer results until what is asked is met, or more would not help; then errors are written."""
        stopped: BaseException | None = None
        why, wanted = "", self._judged(resolution, result)
        while wanted:
            finer = self._finer(resolution, wanted)
            runs, asks = list(result.values()), [finer.lines[name] for name in result]
            if self._budget is not None and not self._budget.allows(runs, asks):
                for control in self.controls.values():
                    control.stopped = self._budget.text(runs, asks)
                break
            self._warn_of_costs(result, finer)
            if runs[0].cpu * times_the_cost(runs[0].resolution, asks[0]) > WORTH_WRITING:
                self._write(resolution, result, done=False)  # what follows takes long
            try:
                found = self._replacement.finer(partial(self._record_finer, finer))
            except ComputationError as error:
                why = f"a finer run failed: {str(error).splitlines()[0]}"
                self._notes.append((NOT_KEPT, f"{why}; the result is the one before"))
                break
            except KeyboardInterrupt as error:
                why, stopped = "a finer run was stopped from outside", error
                break
            self._spend(found)
            wanted, kept = self._judged_finer(finer, found)
            if kept:
                result, resolution = found, finer
        self._note_missed(why)
        self._write(resolution, result, done=stopped is None)
        if stopped is not None:
            raise stopped

    def _judged_finer(self, resolution: NetworkResolution, result: Samples) -> tuple[dict[str, Resolution], bool]:
        """As `_judged` of a finer result, and whether it takes the place of that before it.

        The last stays beside where the lines together are no better: they are one result.
        """
        before = {n: x.judged(True).copied() for n, x in self.controls.items() if x.estimate is not None}
        kept, stays = True, False
        try:
            wanted = self._judged(resolution, result)
            if wanted:
                return wanted, True
            finer = {n: x.judged(x.irregular) for n, x in self.controls.items() if x.estimate is not None}
            asked = {n: x.asked for n, x in self.controls.items() if x.asked is not None}
            found = is_no_better(asked, before, finer)
            if found is not None:
                kept = False
                for name, control in self.controls.items():
                    if name in before and name in finer:
                        control.keep(before[name], finer[name])
                self._notes.append((NOT_KEPT, not_kept_text(next(iter(result.values())), found)))
            return {}, kept
        except KeyboardInterrupt:  # in a run to compare with: the finer result stays beside, until it is resumed
            kept, stays = False, self._replacement.goes_on
            raise
        finally:
            if not stays:
                self._replacement.settle(kept)

    def _judged(self, resolution: NetworkResolution, result: Samples) -> dict[str, Resolution]:
        """Take over a result; how finely lines that miss what is asked of them want the next one."""
        known = {name: x.estimate for name, x in self.controls.items()}
        stricter = {
            name
            for name, x in known.items()
            if x is not None and resolution.lines[name].zones < x.run.resolution.zones
        }  # fmt: skip
        anew = any(known[name].differs_in_zones(result[name]) for name in stricter)  # type: ignore[union-attr]
        anew |= self.moves and self._touches and not self._compared_touching
        if anew:  # runs to compare with have other zones, or no contact
            self._compare(resolution)
        judged = []
        for name, control in self.controls.items():
            control.runs[:] = self._costs
            before = known[name]
            if (before is None or anew) and control.first_estimate(result[name]):
                judged.append(name)
            elif before is not None:
                control.next_estimate(before, resolution.lines[name], result[name])
                judged.append(name)
        self._renew_model_errors(resolution, result, bool(stricter) and not anew)
        wanted = {name: self.controls[name].next_resolution() for name in judged}
        return {name: x for name, x in wanted.items() if x is not None}

    def _renew_model_errors(self, resolution: NetworkResolution, result: Samples, stricter: bool) -> None:
        """Where zones of the result are others than those whose model error is known: compare it with rods itself."""
        estimates = [x.estimate for x in self.controls.values() if x.estimate is not None]
        if not (estimates and (stricter or any(x.lacks_model_errors() for x in estimates))):
            return
        for name, run in self._with_model_errors(result, resolution, self._result_rods).items():
            control = self.controls[name]
            control.runs[:] = self._costs
            if control.estimate is not None:
                control.takes_model_errors(run)

    def _warn_of_costs(self, result: Samples, finer: NetworkResolution) -> None:
        if not any(kind == COSTLY_ACCURACY for kind, _ in self._notes):
            self._notes += costly(self._costs, next(iter(result.values())), finer.one)

    def _note_missed(self, why: str) -> None:
        """Say of each line that misses what is asked; why: more was tried in vain."""
        for control in self.controls.values():
            if control.asked is None or control.estimate is None:
                continue
            if why:
                control.without_refinement(why)
                continue
            verdict = control.verdict(control.asked)
            if verdict.ratio > 1.0:
                control.note_missed(verdict)

    # --- the file -------------------------------------------------------------------------------

    def _write(self, resolution: NetworkResolution, result: Samples, done: bool = True) -> None:
        """Add errors, what was asked and whether it is met to the result of each line; done: as of `amend`."""
        cpu = clock.process_time() - self._begin
        fields, values = dict[str, list[Field]](), dict[str, dict[str, np.ndarray]]()
        attributes, notes = dict[str, dict[str, str | float | int]](), dict[str, list[tuple[str, str]]]()
        with open_result(self.target) as found:
            happened = {name: [(e.t, e.kind) for e in line.events] for name, line in found.lines.items()}
        steps = next(iter(result.values())).forces[:, 0]
        from hybrid.accuracy.free_vibrations import of_system

        lost = cache(partial(of_system, self.system, resolution, steps))

        def vibrations(name: str) -> LostBy:
            return {} if self._touches else lost().get(name, {})

        for name, control in self.controls.items():
            scene, run = self.scenes[name], result[name]
            errors = control.estimate.errors if control.estimate is not None else None
            fields[name] = error_fields(run, errors) if errors is not None else []
            values[name] = {x.name: np.zeros((len(run.values["position"]), *x.shape)) for x in fields[name]}
            for cause, quantity, begin, rows in errors.blocks() if errors is not None else ():
                if (kept := values[name].get(f"errors/{cause}/{quantity}")) is not None:
                    kept[begin : begin + len(rows)] = rows
            largest, notes[name] = known(scene, control, run, errors, happened[name], partial(vibrations, name))
            attributes[name] = {**effort(scene, control, run, cpu), **largest}
            if control.asked is not None:
                attributes[name]["accuracy_verdicts"] = accuracy_figures(control, run, errors)
        keys = {x for each in attributes.values() for x in each if x.startswith("error_")}
        of_all: dict[str, float | str] = {
            x: max(float(each[x]) for each in attributes.values() if x in each) for x in keys
        }
        of_all |= {"effort_runs": len(self._costs), "effort_cpu": cpu}
        of_all |= not_converged_attribute(x.diverging for x in self.controls.values())
        events = [(kind, f"line {name}: {text}") for name, each in notes.items() for kind, text in each]
        amend_lines(self.target, fields, values, attributes, of_all, [*self._notes, *events], notes, done)


def _elsewhere(resolution: Resolution) -> RunSample:
    raise AssertionError("all lines are computed together")


def _tree(resolution: NetworkResolution) -> Tree:
    return {name: resolution_tree(x) for name, x in resolution.lines.items()}


def system_with_layers(
    system: Network, moves: bool, reporter: ProgressReporter, interrupted: Callable[[], bool],
    criterion: UserCriterion | None = None,
) -> NetworkResolution:  # fmt: skip
    """How finely a system is computed whose lines ask for no errors.

    As of one cable: its equilibrium shows bends and layers, or a coarse run, of lines that say how many cells these
    have.
    """
    if all(x.resolution is None for x in system.lines.values()):
        return layered_lines(system, NetworkResolution.first(system), moves)
    passes = PassesOfLines(system, io.BytesIO(), moves, reporter, interrupted, criterion=criterion)
    return passes.surveyed(NetworkResolution.first(system))
