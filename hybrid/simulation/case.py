"""One scene, computed as often and as finely as it takes: the loop over time, the equilibrium, and their files."""

from __future__ import annotations

import io
import time as clock
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from hybrid.adapt.manager import UserCriterion
from hybrid.errors import OTHER_PROGRAM, ComputationError, ResultError
from hybrid.kernels.criteria import CRITERIA
from hybrid.kernels.forces import SEABED, SURFACE
from hybrid.kernels.state import Floats
from hybrid.model.build import Model, build, rod_cells
from hybrid.model.mesh_grading import Grading
from hybrid.model.plan import output_times
from hybrid.model.resolution import Resolution, mesh_is_free, wants_errors
from hybrid.model.sections import allowed_radius, weakest_bending
from hybrid.outputs.probes import Observer, output_points
from hybrid.scene.motion_checks import ramp_ends
from hybrid.scene.read import scene_text
from hybrid.scene.schema import Scene
from hybrid.simulation.bending_correction import Correction
from hybrid.simulation.diagnostics import Watch
from hybrid.simulation.equilibrium import equilibrium_of, zones_and_rest
from hybrid.simulation.error_estimate import COMPARED, RunSample
from hybrid.simulation.mesh_survey import POINTS, survey_grading, survey_resolution
from hybrid.simulation.progress import ESTIMATION, PRE_RUN, REFINEMENT, RESULT, ProgressReporter
from hybrid.simulation.restart import Phase, changes_text
from hybrid.simulation.restore import program, refused, resolution_from, resolution_tree, restored_parts
from hybrid.simulation.transient import Motion
from hybrid.simulation.zone_switching import Zoning
from hybrid.solve.statics import Equilibrium
from hybrid.solve.stepper import POWERS
from hybrid.store.checkpoint import Checkpoint, digest_of, read_checkpoint
from hybrid.store.format import Field
from hybrid.store.memory_recorder import Notebook
from hybrid.store.named_arrays import Tree, pack
from hybrid.store.reader import Result, is_result, open_result, opened
from hybrid.store.writer import Recorder

HELD = (
    "zones stay rod: in equilibrium, catenary where the criteria allow it is further from the rod than the tolerance; "
    "more mesh.cells, or a larger model.tolerance, let them move"
)
STEP_FIELDS = (
    Field("t", "s", "time at the end of the step"),
    Field("dt", "s", "length of the step"),
    Field("iterations", "", "Newton iterations, repeats included", dtype="int64"),
    Field(
        "correction", "", "next Newton correction as predicted (turn of a chord in rad, or tension over the largest)"
    ),
    Field("residual", "N", "largest residual force at a node before the last correction"),
    Field("repeats", "", "how often the step was repeated with smaller parts", dtype="int64"),
    Field("error", "m", "local error of position that the step makes, by the change of acceleration in it"),
    Field("end_force_start", "N", "magnitude of the force that holds (or loads) the start, at every step"),
    Field("end_force_end", "N", "the same at the end; of an end body: tension of the last cell"),
    Field("cpu", "s", "processor time since the start of the run"),
)


class Case:
    """One scene, computed as often and as finely as it takes."""

    def __init__(self, scene: Scene, criterion: UserCriterion | None, changes: Sequence[Phase] = ()) -> None:
        """changes: scenes that hold from some time on; what they may differ in, `remainder` has looked at."""
        self.scene, self.criterion, self.changes = scene, criterion, tuple(changes)
        self.progress = ProgressReporter(None, 1.0)
        self.results = 0  # that were begun
        self.interrupted: Callable[[], bool] = lambda: False

    def record(self, resolution: Resolution, target: Path | io.BytesIO, before: Tree | None = None) -> RunSample:
        """Compute the result into a file, or memory; what is to be compared of it.  before: what was found before."""
        begin = self._begin_result(resolution)
        model, equilibrium, zoning = self._model(resolution)
        observer = self._observer(model, zoning, output_points(self.scene.output.points, model.length))
        outputs = output_times(self.scene)
        keeps = before or {} if isinstance(target, Path) else None
        recorder = _recorder(self.scene, model, observer, target, len(outputs), equilibrium, keeps, self._texts)
        recorder.files = self._files
        if zoning and zoning.manager.held:
            recorder.event(0.0, 0.0, model.length, "zones fixed", HELD)
        with recorder:
            correction = _correction(model, zoning)
            motion = Motion(self.scene, model, resolution, observer, recorder, target, zoning, correction)
            motion.begin(equilibrium)
            motion.save()
            motion.keep()
            self._finish(motion, outputs)
        return self._seen(motion, target, clock.process_time() - begin)

    def go_on(self, source: Path, target: Path, before: Tree | None = None) -> RunSample:
        """The same from the checkpoint of a result, which may be the target; ResultError if it has none."""
        with opened(source) as file:
            point = read_checkpoint(file)
            self._check(point, source)
            scenes = (self.scene, *(x.scene for x in self.changes))
            with refused(source):
                resolution = resolution_from(point.resolution, self.scene)
                begin = self._begin_result(resolution)
                model, zoning, correction = restored_parts(scenes, resolution, point.state, self.criterion)
                observer = self._observer(model, zoning, output_points(self.scene.output.points, model.length))
                now = scenes[point.state["changes"]]
                motion = Motion(now, model, resolution, observer, Notebook(), target, zoning, correction)
                motion.restore(point.state)
                if not point.t <= motion.t <= self.scene.require_time().duration:
                    raise ValueError(f"t = {motion.t:g} s after an output at {point.t:g} s")
            recorder = Recorder.again(file, target, observer.fields, STEP_FIELDS, point, self._texts, before or {})
        motion.write_to(recorder)
        recorder.files = self._files
        with recorder:
            if point.program != program():
                wrote, this = (x.split()[0] for x in (point.program, program()))
                text = f"begun by hybrid-cable {wrote}, from here on by {this}" + " in another state" * (wrote == this)
                recorder.event(point.t, 0.0, model.length, OTHER_PROGRAM, f"{text}: the last digits may be others")
            self._finish(motion, output_times(self.scene))
        return self._seen(motion, target, clock.process_time() - begin)

    def _begin_result(self, resolution: Resolution) -> float:
        """The pass of a result begins; s of processor time."""
        self.progress.begin(REFINEMENT if self.results else RESULT, resolution)
        self.results += 1
        return clock.process_time()

    def _report(self, motion: Motion, finished: bool = False) -> None:
        self.progress(motion.t, motion.steps, motion.iterations, motion.model.zones, finished)

    @property
    def _texts(self) -> dict[str, str]:
        """What the file says of the scene, and of what changes."""
        return {"scene": scene_text(self.scene), "changes": changes_text(self.changes)}

    @property
    def _files(self) -> dict[str, str]:
        """Digests of the motion files, by path: a run that goes on needs the same."""
        ends = [end for x in (self.scene, *(x.scene for x in self.changes)) for end in x.ends.both]
        paths = {motion.file for end in ends if (motion := end.prescribed_motion) is not None and motion.file}
        return {path: digest_of(Path(path)) for path in sorted(paths)}

    def goes_on(self, source: Path, resolution: Resolution) -> bool:
        """Whether a file holds a run with this resolution that was cut off."""
        if not is_result(source):
            return False
        with open_result(source) as result:
            if {"scene": result.scene_text, "changes": result.changes_text} != self._texts:
                return False
        try:
            with opened(source) as file:
                point = read_checkpoint(file)
        except ResultError:
            return False
        return pack(point.resolution) == pack(resolution_tree(resolution))

    def _check(self, point: Checkpoint, source: Path) -> None:
        """ResultError: the criterion of a run is missing, or the files that it reads have changed."""
        if point.asks and self.criterion is None:
            advice = "hybrid.resume(path, criterion=...) with the function that it was run with"
            raise ResultError(f"{source} was computed with a criterion of its own\n    try:      {advice}")
        now = self._files
        changed = [path for path, digest in point.files.items() if now.get(path) != digest]
        if changed:
            detail = f"{', '.join(changed)}: other than when the run began"
            raise ResultError(f"{source} cannot go on\n    detail:   {detail}\n    try:      run its scene again")

    def _finish(self, motion: Motion, outputs: Sequence[float]) -> None:
        """From where a motion is to its end, and close its file."""
        self._move(motion, outputs)
        motion.keep(at_once=True)
        motion.watch.finish()
        self._report(motion, finished=True)
        motion.recorder.close("complete", f"{motion.steps} steps")

    def _seen(self, motion: Motion, target: Path | io.BytesIO, cpu: float) -> RunSample:
        """What is to be compared of a complete result."""
        resolution, cells, steps = motion.resolution, cells_of(motion.model), motion.steps
        if not wants_errors(self.scene):
            return RunSample(resolution, {}, cells, steps, 0.0)
        with open_result(target) as result:
            values = {name: np.array(result[name]) for name in COMPARED if name in result}
            model_error = (
                {k: np.array(x) for k, x in result["errors/model"].items()} if "errors/model" in result else {}
            )
            unresolved = any(event.kind == "unresolved bend" for event in result.events)
            notes = _damped(result) if resolution.local is not None else ()
        return RunSample(resolution, values, cells, steps, cpu, 1, unresolved, model_error, 0.0, notes)

    def sample(self, resolution: Resolution, points: Floats | None = None) -> RunSample:
        """Compute for comparison only; points: places, m, instead of those of the result.

        An resolution with longer steps has as many times fewer outputs, so that these do not shorten its steps.
        """
        begin = clock.process_time()
        self.progress.begin(ESTIMATION if points is None else PRE_RUN, resolution)
        model, equilibrium, zoning = self._model(resolution)
        s = output_points(self.scene.output.points, model.length) if points is None else points
        observer = self._observer(model, zoning, s, COMPARED)
        notebook = Notebook()
        times = output_times(self.scene)
        if resolution.every > 1:
            times = [*times[resolution.every - 1 : -1 : resolution.every], times[-1]]
        correction = _correction(model, zoning)
        motion = Motion(self.scene, model, resolution, observer, notebook, None, zoning, correction)
        motion.begin(equilibrium)
        motion.save()
        self._move(motion, times)
        self._report(motion, finished=True)
        values = {name: notebook[name] for name in COMPARED if name in notebook}
        model_error = {name.removeprefix(MODEL): notebook[name] for name in notebook.names if name.startswith(MODEL)}
        spent = clock.process_time() - begin
        bound = resolution.zones * model.length if zoning is not None else 0.0
        notes = tuple({kind: (kind, text) for kind, text in reversed(notebook.events) if kind == BEYOND}.values())
        return RunSample(
            resolution, values, cells_of(model), motion.steps, spent, resolution.every, False, model_error, bound, notes
        )

    def survey(self, resolution: Resolution) -> Grading | None:
        """Where cells should be short; None: a coarse run to see that failed, or the scene says where they go."""
        if not mesh_is_free(self.scene):
            return None
        coarse = survey_resolution(resolution)
        model = build(self.scene, coarse)
        s = np.linspace(0.0, model.length, POINTS)
        try:
            seen = self.sample(coarse, s)
        except ComputationError:
            return None
        bend = rod_cells(self.scene, model.cable, s) if model.layout is not None else None
        return survey_grading(model, s, seen.values, bend)

    def record_equilibrium(self, resolution: Resolution, target: Path | io.BytesIO) -> RunSample:
        """The same of the equilibrium."""
        begin = clock.process_time()
        model, found = self._rest(resolution)
        observer = self._at_rest(model)
        with _recorder(self.scene, model, observer, target, 0, found) as recorder:
            ends = model.ends.at(np.inf)
            watch = Watch(recorder, model)
            watch.begin()
            watch.equilibrium(found)
            watch.strain(0.0, found.state)
            watch.mesh(0.0, found.state)
            stop = watch.still(ends, found.state)
            if stop is not None:
                raise ComputationError(stop[0], None, float(model.line.s[stop[1]]))
            values = _values_at_rest(model, found, observer)
            recorder.save(0.0, values, observer.zone_rows)
            recorder.close("complete", f"equilibrium: {found.summary}; residual force {found.residual:.2g} N")
        return _sample_at_rest(resolution, model, values, clock.process_time() - begin)

    def sample_equilibrium(self, resolution: Resolution) -> RunSample:
        """The equilibrium for comparison only."""
        begin = clock.process_time()
        model, found = self._rest(resolution)
        values = _values_at_rest(model, found, self._at_rest(model, COMPARED))
        return _sample_at_rest(resolution, model, values, clock.process_time() - begin)

    def _at_rest(self, model: Model, only: Sequence[str] | None = None) -> Observer:
        s = output_points(self.scene.output.points, model.length)
        errors = model.follows_error and wants_errors(self.scene)
        return Observer(
            model.line, model.sea.values, model.zones, s, False, model.attached, only=only, errors=errors,
            corrected=model.corrected,
        )  # fmt: skip

    def _rest(self, resolution: Resolution) -> tuple[Model, Equilibrium]:
        model = build(self.scene, resolution)
        if model.layout is None:
            return model, equilibrium_of(self.scene, model, np.inf)
        model, found, _ = zones_and_rest(self.scene, model, resolution, np.inf, None, at_rest=True)
        assert found is not None
        return model, found

    def _model(self, resolution: Resolution) -> tuple[Model, Equilibrium | None, Zoning | None]:
        model = build(self.scene, resolution)
        if model.layout is not None:
            return zones_and_rest(self.scene, model, resolution, 0.0, self.criterion)
        found = equilibrium_of(self.scene, model, 0.0) if self.scene.initial.kind == "equilibrium" else None
        return model, found, None

    def _observer(self, model: Model, zoning: Zoning | None, s: Floats, only: Sequence[str] | None = None) -> Observer:
        kinds = {"rod", "catenary"} if zoning else None
        criteria = [(x.name, x.ratio) for x in CRITERIA] if self.scene.output.criteria and zoning and not only else ()
        errors = model.follows_error and wants_errors(self.scene)
        return Observer(
            model.line, model.sea.values, model.zones, s, not only, model.attached, kinds, criteria, only, errors,
            model.corrected,
        )  # fmt: skip

    def _move(self, motion: Motion, outputs: Sequence[float]) -> None:
        """From where a motion is to the last output, with what changes on the way."""
        for t, scene in [(x.t, x.scene) for x in self.changes[motion.changes :]]:
            self._until(motion, [*(x for x in outputs if x < t), t], set(outputs))
            motion.change(scene)
            motion.keep()
        self._until(motion, outputs, set(outputs))

    def _until(self, motion: Motion, stops_at: Sequence[float], outputs: set[float]) -> None:
        """The loop over time."""
        end, breaks = stops_at[-1], motion.model.ends.breaks
        stops = {*stops_at, *(t for t in breaks if t < end)}
        if motion.control is not None:
            stops |= {t for t in ramp_ends(motion.scene) if t < end}
        for stop in sorted(t for t in stops if t > motion.t):
            for until in motion.ends_of_steps(stop):
                motion.advance(until)
                self._report(motion)
                if self.interrupted():
                    motion.recorder.close("interrupted", f"stopped from outside at t = {motion.t:.6g} s")
                    raise KeyboardInterrupt
            if stop in outputs:
                motion.save()
            if stop in breaks:
                motion.restart()
            if stop in outputs:
                motion.keep()


# Energy lost to the scheme that is worth a word, as a part of the largest kinetic energy, and of tension scale times
# length: below, it is what Newton's tolerance leaves.
NOTHING_LOST = 1e-6
# The same as a part of all work done: what the books miss when steps are long.
IN_BOOKS = 0.01
MODEL, BEYOND = "errors/model/", "model error not estimated"


def _damped(result: Result) -> tuple[tuple[str, str], ...]:
    """What to say where the scheme has taken more energy out of a motion than the cable ever stored by straining."""
    names = [x for x in ("energy/stretch", "energy/bending", "energy/torsion") if x in result]
    strained = sum(np.array(result[x]) for x in names)
    lost = -float(np.min(result["work/scheme"]))
    peak = float(np.ptp(strained)) if np.ndim(strained) else 0.0
    books = IN_BOOKS * sum(float(np.abs(result.work[x]).max()) for x in result.work if x != "scheme")
    least = NOTHING_LOST * float(result.attributes["tension_scale"]) * float(result.attributes["length"])
    if not lost > max(peak, NOTHING_LOST * float(np.max(result.energy["kinetic"])), least, books):
        return ()
    text = (
        f"steps follow the motion in metres: vibrations of less are damped out ({lost:.2g} J, where at most "
        f"{peak:.2g} J are stored by strain), and with them their moments and reactions, which the error figure "
        f"does not see; for those give a time.step that follows them"
    )
    return (("vibrations damped", text),)


def _correction(model: Model, zoning: Zoning | None) -> Correction | None:
    """What follows the error of leaving bending out, where that is wanted."""
    return Correction(model, zoning) if model.follows_error else None


def _values_at_rest(model: Model, found: Equilibrium, observer: Observer) -> dict[str, object]:
    """All fields of an equilibrium."""
    ends, shift = model.ends.at(np.inf), None
    if model.follows_error:
        model.sea.at(np.inf)
        correction = Correction(model)
        correction.begin(ends, found.state, at_rest=True, rubbed=found.rubbed)
        shift = correction.shift(found.state)
    return observer.values(ends, found.state, found.report, np.zeros(len(POWERS)), shift=shift)


def _sample_at_rest(resolution: Resolution, model: Model, values: Mapping[str, object], cpu: float) -> RunSample:
    kept = {name: np.array(values[name])[None] for name in COMPARED if name in values}
    left = {k.removeprefix(MODEL): np.array(x)[None] for k, x in values.items() if k.startswith(MODEL)}
    return RunSample(resolution, kept, cells_of(model), 1, cpu, 1, False, left)


def cells_of(model: Model) -> int:
    """Cells by which meshes of one scene are compared: of zones that move, their base cells."""
    return model.cells if model.layout is None else int(model.layout.rod.size)


def _recorder(
    scene: Scene,
    model: Model,
    observer: Observer,
    target: Path | io.BytesIO,
    outputs: int,
    found: Equilibrium | None = None,
    before: Tree | None = None,
    texts: Mapping[str, str] | None = None,
) -> Recorder:
    """The file of a result; whether it may be replaced was asked before anything was computed."""
    attributes: dict[str, str | float | int] = {
        "title": scene.title, "cells": model.cells, "length": model.length, "tension_scale": model.tension_scale,
    }  # fmt: skip
    if found is not None:
        attributes |= {"static_path": found.summary, "static_residual": found.residual}
    fixed = [*_surroundings(model), *_limits(scene, observer)]
    if scene.output.history:
        points = np.array(scene.output.history)
        fixed.append(
            (Field("history", "m", "arc lengths to follow in histories", (points.size,), ("history",)), points)
        )
    recorder = Recorder(
        target, grid_s=observer.grid.s, fields=observer.fields, step_fields=STEP_FIELDS if outputs else (),
        attributes=attributes, texts=texts or {"scene": scene_text(scene)}, fixed=fixed,
        outputs=outputs + 1, overwrite=True, before=before,
    )  # fmt: skip
    for s, text in _clamps_left_out(scene, model):
        recorder.event(0.0, s, s, "bending at clamp neglected", text)
    left = [s for s in model.attached if model.layout is not None and not _bends(model, s)]
    if left:
        which = ", ".join(f"{s:.5g}" for s in left[:5]) + ", .." * (len(left) > 5)
        text = (
            f"bends at the point loads at s = {which} m shift the cable by less than the tolerance: they have no moment"
        )
        recorder.event(
            0.0, left[0], left[-1], "bending at point load neglected", f"{text}; for it, say force_rod around them"
        )
    return recorder


def _bends(model: Model, s: float) -> bool:
    """Whether an inner node at s has an element; the ends have their own say."""
    node = int(np.argmin(np.abs(model.line.s - s)))
    return bool(model.line.element[node]) or not 0 < node < model.line.h.size


def _clamps_left_out(scene: Scene, model: Model) -> Iterator[tuple[float, str]]:
    """Clamps that lie in a catenary zone because they hardly shift the cable; who wants their moment has to ask."""
    if model.layout is None:
        return
    line = model.line
    for name, end, cell in (("start", scene.ends.start, 0), ("end", scene.ends.end, -1)):
        if end.held_tangent is None or line.spin[cell]:
            continue
        s, far = float(line.s[cell]), float(line.s[-1])
        reach = min(4.0 * float(model.cable.bending_length(1e-9 * model.tension_scale / far)[cell]), far)
        stretch = f"[0, {reach:.3g}]" if cell == 0 else f"[{far - reach:.5g}, {far:.5g}]"
        text = (
            f"the clamp at ends.{name} shifts the cable by less than the tolerance: it is left out, and has no moment, "
            f"as long as a catenary zone ends there; for its moment, and near resonance, say force_rod: [{stretch}]"
        )
        yield s, text


def _limits(scene: Scene, observer: Observer) -> list[tuple[Field, np.ndarray]]:
    """What reports hold bends and torques against: the bend radius allowed, and of rods the bending stiffness."""
    s = observer.grid.s
    out: list[tuple[Field, np.ndarray]] = []
    if any(x.min_bend_radius for x in scene.cable.sections):
        field = Field("min_bend_radius", "m", "smallest bend radius allowed; NaN: none", (s.size,), ("s",), nan_ok=True)
        out.append((field, allowed_radius(scene, s)))
    if any(field.name == "torque" for field in observer.fields):
        text = "bending stiffness, the smaller one where there are two"
        out.append((Field("bending_stiffness", "N m^2", text, (s.size,), ("s",)), weakest_bending(scene, s)))
    return out


def _surroundings(model: Model) -> list[tuple[Field, np.ndarray]]:
    """What pictures show besides the cable: seabed, still water, what is attached."""
    line, sea = model.line, model.sea.values
    out: list[tuple[Field, np.ndarray]] = []
    if line.bits & SEABED:
        text = "plane of the seabed: unit normal n and offset c, n . x = c on it"
        out.append((Field("seabed", "", text, (4,), ("plane",), "inertial"), np.append(sea.normal, sea.offset)))
    if line.bits & SURFACE:
        out.append((Field("surface", "m", "height of still water"), np.array(sea.surface)))
    if model.attached:
        text = "arc lengths of floats, clumps and end bodies"
        out.append((Field("attached", "m", text, (len(model.attached),), ("attached",)), np.array(model.attached)))
    return out
