"""The loop over time, and the equilibrium of a scene: the only file that knows everyone.

run      integrate a scene over its duration
static   find its equilibrium
"""

from __future__ import annotations

import io
import signal
import threading
import time as clock
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hybrid.accuracy import (
    COMPARED,
    SURVEY_CELLS,
    SURVEY_POINTS,
    SURVEY_STEPS,
    Climb,
    Errors,
    Sketch,
    summary,
    survey_grading,
)
from hybrid.adapt.manager import UserCriterion
from hybrid.adapt.table import CRITERIA
from hybrid.correction import Correction
from hybrid.errors import ComputationError, SceneError
from hybrid.model.build import Model, build, given_zones, rod_cells
from hybrid.model.coarse import coarser, refined
from hybrid.model.effort import Effort, asked, first_effort, mesh_is_free, wants_errors
from hybrid.model.grade import Grading
from hybrid.model.mesh import Zone
from hybrid.model.plan import output_times
from hybrid.model.reasons import reasons_against
from hybrid.model.state import Floats
from hybrid.motion import Motion
from hybrid.physics.loads import FRICTION, SEABED, SURFACE
from hybrid.results.notebook import Notebook
from hybrid.results.probes import Observer, output_points
from hybrid.results.read import Result, open_result
from hybrid.results.record import Field, Recorder, amend
from hybrid.scene.motion import check_motions, ramp_ends
from hybrid.scene.read import scene_text
from hybrid.scene.schema import AdaptiveModel, Scene, missing_time
from hybrid.solve.statics import Equilibrium, solve_statics
from hybrid.solve.timestep import POWERS
from hybrid.watch import Watch
from hybrid.zoning import Zoning, first_zones, manager_for, zones_of_start

HELD = (
    "zones stay rod: in equilibrium, catenary where the criteria allow it is further from the rod than the tolerance; "
    "more mesh.cells, or a larger model.tolerance, let them move"
)
REPORT_EVERY = 0.1  # s of wall time between two calls of `progress`

STEP_FIELDS = (
    Field("t", "s", "time at the end of the step"),
    Field("dt", "s", "length of the step"),
    Field("iterations", "", "Newton iterations, repeats included", dtype="int64"),
    Field(
        "correction", "", "next Newton correction as predicted (turn of a chord in rad, or tension over the largest)"
    ),
    Field("residual", "N", "largest force out of balance at a node before the last correction"),
    Field("repeats", "", "how often the step was repeated with smaller parts", dtype="int64"),
    Field("error", "m", "local error of position that the step makes, by the change of acceleration in it"),
    Field("pull_start", "N", "magnitude of the force that holds (or loads) the start, at every step"),
    Field("pull_end", "N", "the same at the end; of an end body: tension of the last cell"),
    Field("cpu", "s", "processor time since the start of the run"),
)


@dataclass(frozen=True)
class Progress:
    """Where a run is: time and duration (s), step number, Newton iterations of the last step, zones, wall time (s).

    stage: which run, where several tell the error: "looking" how the cable bends, "comparing", "result"; else empty.
    """

    t: float
    duration: float
    step: int
    iterations: int
    zones: tuple[Zone, ...]
    wall: float
    stage: str = ""


def run(
    scene: Scene,
    output: str | Path | None = None,
    *,
    progress: bool | Callable[[Progress], None] = False,
    overwrite: bool = True,
    criterion: UserCriterion | None = None,
) -> Result:
    """Integrate a scene over its duration.

    output: the HDF5 file to write; None keeps the result in memory.  progress: True for a
    live line, or a function called about ten times a second.  overwrite: replace an
    existing result (never another program's file).  criterion: for zones that move, one more: it gets a
    `hybrid.Look` at every step and gives a number (N+1,) per node, 1 or more where the cable must be a rod.

    Raises SceneError when the scene is refused and ComputationError when the computation
    stops; what was computed until then is in the file, and the last good state beside it.
    """
    if scene.time is None:
        raise SceneError([missing_time(scene)])
    check_motions(scene)
    if scene.solver == "shooting":
        from hybrid.arbitrate import run_shooting

        return run_shooting(scene, output, overwrite)
    if criterion is not None and not isinstance(scene.model, AdaptiveModel):
        raise TypeError("a criterion is for zones that move: the scene's model is not adaptive")
    job, begin = Job(scene, criterion), clock.process_time()
    target, effort = _target(output), first_effort(scene)
    with _interrupts() as interrupted, _Told(progress, scene.time.duration) as told:
        job.told, job.interrupted = told, interrupted
        if not wants_errors(scene):
            job.record(effort, target, overwrite)
            return open_result(target)
        climb = Climb(
            asked(scene), mesh_is_free(scene), scene.time.controlled and scene.time.tolerance is None, True,
            job.sketch, lambda effort: job.record(effort, target, overwrite),
        )  # fmt: skip
        final, errors = climb.reach(replace(effort, grading=job.survey(effort)) if asked(scene) else effort)
        _amend(target, scene, final, errors, climb, clock.process_time() - begin)
    return open_result(target)


class Job:
    """One scene, computed as often and as finely as it takes."""

    def __init__(self, scene: Scene, criterion: UserCriterion | None) -> None:
        self.scene, self.criterion = scene, criterion
        self.told: _Told
        self.interrupted: Callable[[], bool] = lambda: False

    def record(self, effort: Effort, target: Path | io.BytesIO, overwrite: bool) -> Sketch:
        """Compute the result into a file, or memory; what is to be compared of it."""
        if isinstance(target, io.BytesIO):
            target.seek(0)
            target.truncate()
        begin, self.told.stage = clock.process_time(), "result" if wants_errors(self.scene) else ""
        model, equilibrium, zoning = self._model(effort)
        observer = self._observer(model, zoning, output_points(self.scene.output.points, model.length))
        outputs = output_times(self.scene)
        recorder = _recorder(self.scene, model, observer, target, overwrite, len(outputs), equilibrium)
        if zoning and zoning.manager.held:
            recorder.event(0.0, 0.0, model.length, "zones held", HELD)
        with recorder:
            correction = _correction(model, zoning)
            motion = Motion(self.scene, model, effort, observer, recorder, target, equilibrium, zoning, correction)
            self._move(motion, outputs)
            recorder.close("complete", f"{motion.steps} steps")
        if not wants_errors(self.scene):
            return Sketch(effort, {}, cells_of(model), motion.steps, 0.0)
        with open_result(target) as result:
            values = {name: np.array(result[name]) for name in COMPARED if name in result}
            model_error = (
                {k: np.array(x) for k, x in result["errors/model"].items()} if "errors/model" in result else {}
            )
            unresolved = any(event.kind == "unresolved bend" for event in result.events)
        spent = clock.process_time() - begin
        return Sketch(effort, values, cells_of(model), motion.steps, spent, 1, unresolved, model_error)

    def sketch(self, effort: Effort, points: Floats | None = None) -> Sketch:
        """Compute for comparison only; points: places, m, instead of those of the result.

        An effort with longer steps has as many times fewer outputs, so that these do not shorten its steps.
        """
        begin, self.told.stage = clock.process_time(), "comparing" if points is None else "looking"
        model, equilibrium, zoning = self._model(effort)
        s = output_points(self.scene.output.points, model.length) if points is None else points
        observer = self._observer(model, zoning, s, COMPARED)
        notebook = Notebook()
        times = output_times(self.scene)
        if effort.every > 1:
            times = [*times[effort.every - 1 : -1 : effort.every], times[-1]]
        correction = _correction(model, zoning)
        motion = Motion(self.scene, model, effort, observer, notebook, None, equilibrium, zoning, correction)
        self._move(motion, times)
        values = {name: notebook[name] for name in COMPARED if name in notebook}
        model_error = {name.removeprefix(MODEL): notebook[name] for name in notebook.names if name.startswith(MODEL)}
        spent = clock.process_time() - begin
        bound = effort.zones * model.length if zoning is not None else 0.0
        notes = tuple({kind: (kind, text) for kind, text in reversed(notebook.events) if kind == BEYOND}.values())
        return Sketch(
            effort, values, cells_of(model), motion.steps, spent, effort.every, False, model_error, bound, notes
        )

    def survey(self, effort: Effort) -> Grading | None:
        """Where cells should be short; None: a coarse run to see that failed, or the scene says where they go."""
        if not mesh_is_free(self.scene):
            return None
        coarse = effort.coarser(SURVEY_CELLS, SURVEY_STEPS)
        model = build(self.scene, coarse)
        s = np.linspace(0.0, model.length, SURVEY_POINTS)
        try:
            seen = self.sketch(coarse, s)
        except ComputationError:
            return None
        bend = rod_cells(self.scene, model.cable, s) if model.layout is not None else None
        return survey_grading(model, s, seen.values, bend)

    def record_rest(self, effort: Effort, target: Path | io.BytesIO, overwrite: bool) -> Sketch:
        """The same of the equilibrium."""
        if isinstance(target, io.BytesIO):
            target.seek(0)
            target.truncate()
        begin = clock.process_time()
        model, found = self._rest(effort)
        observer = self._at_rest(model)
        with _recorder(self.scene, model, observer, target, overwrite, 0, found) as recorder:
            ends = model.ends.at(np.inf)
            watch = Watch(recorder, model)
            watch.equilibrium(found)
            watch.strain(0.0, found.state)
            watch.mesh(0.0, found.state)
            stop = watch.still(ends, found.state)
            if stop is not None:
                raise ComputationError(stop[0], None, float(model.line.s[stop[1]]))
            values = _values_at_rest(model, found, observer)
            recorder.save(0.0, values, observer.zone_rows)
            recorder.close("complete", f"equilibrium: {found.summary}; out of balance {found.residual:.2g} N")
        return _sketch_at_rest(effort, model, values, clock.process_time() - begin)

    def sketch_rest(self, effort: Effort) -> Sketch:
        """The equilibrium for comparison only."""
        begin = clock.process_time()
        model, found = self._rest(effort)
        values = _values_at_rest(model, found, self._at_rest(model, COMPARED))
        return _sketch_at_rest(effort, model, values, clock.process_time() - begin)

    def _at_rest(self, model: Model, only: Sequence[str] | None = None) -> Observer:
        s = output_points(self.scene.output.points, model.length)
        errors = model.follows_error and wants_errors(self.scene)
        return Observer(
            model.line, model.sea.values, model.zones, s, False, model.attached, only=only, errors=errors,
            corrected=model.corrected,
        )  # fmt: skip

    def _rest(self, effort: Effort) -> tuple[Model, Equilibrium]:
        model = build(self.scene, effort)
        if model.layout is None:
            return model, _equilibrium(self.scene, model, np.inf)
        model, found, _ = _first_zones(self.scene, model, effort, np.inf, None, at_rest=True)
        assert found is not None
        return model, found

    def _model(self, effort: Effort) -> tuple[Model, Equilibrium | None, Zoning | None]:
        model = build(self.scene, effort)
        if model.layout is not None:
            return _first_zones(self.scene, model, effort, 0.0, self.criterion)
        found = _equilibrium(self.scene, model, 0.0) if self.scene.initial.kind == "equilibrium" else None
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
        """The loop over time."""
        breaks = motion.model.ends.breaks
        stops = {*outputs, *(t for t in breaks if t < outputs[-1])}
        if motion.control is not None:
            stops |= {t for t in ramp_ends(self.scene) if t < outputs[-1]}
        motion.save()
        for stop in sorted(stops):
            for until in motion.ends_of_steps(stop):
                motion.advance(until)
                self.told(motion)
                if self.interrupted():
                    motion.recorder.close("interrupted", f"stopped from outside at t = {motion.t:.6g} s")
                    raise KeyboardInterrupt
            if stop in outputs:
                motion.save()
            if stop in breaks:
                motion.restart()
        motion.watch.finish()
        self.told(motion, finished=True)


MODEL, BEYOND = "errors/model/", "error beyond estimate"


def _correction(model: Model, zoning: Zoning | None) -> Correction | None:
    """What follows the error of leaving bending out, where that is wanted."""
    return Correction(model, zoning.torque if zoning else None) if model.follows_error else None


def _values_at_rest(model: Model, found: Equilibrium, observer: Observer) -> dict[str, object]:
    """All fields of an equilibrium."""
    ends, shift = model.ends.at(np.inf), None
    if model.follows_error:
        model.sea.at(np.inf)
        correction = Correction(model)
        correction.begin(ends, found.state, at_rest=True, rubbed=found.rubbed)
        shift = correction.shift(found.state)
    return observer.values(ends, found.state, found.report, np.zeros(len(POWERS)), shift=shift)


def _sketch_at_rest(effort: Effort, model: Model, values: Mapping[str, object], cpu: float) -> Sketch:
    kept = {name: np.array(values[name])[None] for name in COMPARED if name in values}
    left = {k.removeprefix(MODEL): np.array(x)[None] for k, x in values.items() if k.startswith(MODEL)}
    return Sketch(effort, kept, cells_of(model), 1, cpu, 1, False, left)


def cells_of(model: Model) -> int:
    """Cells by which meshes of one scene are compared: of zones that move, their base cells."""
    return model.cells if model.layout is None else int(model.layout.rod.size)


def _amend(
    target: Path | io.BytesIO, scene: Scene, final: Sketch, errors: Errors | None, climb: Climb, cpu: float
) -> None:
    """Write how wrong a result may be, how finely it was computed, and what went into that, into its file."""
    effort = final.effort
    attributes: dict[str, str | float | int] = {
        "effort_fineness": effort.fineness, "effort_runs": len(climb.runs),
        "effort_cpu": cpu, "effort_step": effort.step,
    }  # fmt: skip
    if effort.local is not None:
        attributes["effort_step_error"] = effort.local
    if isinstance(scene.model, AdaptiveModel):
        attributes["effort_zones"] = effort.zones
    if climb.asked is not None:
        attributes["accuracy_asked"] = climb.asked.text
    fields: list[tuple[Field, np.ndarray]] = []
    if errors is not None:
        attributes |= summary(errors)
        for kind, quantities in errors.fields.items():
            for name, values in quantities.items():
                unit, dims = UNITS_OF_ERRORS[name], ("s",) if values.ndim == 2 else ()
                text = f"{WORDS_OF_ERRORS[kind]} of {name.replace('_', ' ')}, estimated"
                if kind == "model" and final.model_error:
                    continue  # the run has written it itself
                fields.append((Field(f"errors/{kind}/{name}", unit, text, values.shape[1:], dims), values))
    amend(target, fields, attributes, climb.notes)


UNITS_OF_ERRORS = {
    "position": "m", "tension": "N", "curvature": "1/m", "bending_moment": "N m", "pull_start": "N", "pull_end": "N",
}  # fmt: skip
WORDS_OF_ERRORS = {
    "mesh": "error by the mesh", "time": "error by the time step", "model": "error by bending that is left out",
    "total": "error by all causes",
}  # fmt: skip


class _Told:
    """Calls `progress` now and then, and closes a live line however the run ends."""

    def __init__(self, progress: bool | Callable[[Progress], None], duration: float) -> None:
        self._tell: Callable[[Progress], None] | None = None
        if progress is True:
            from hybrid.live import live_line

            self._tell = live_line()
        elif progress:
            self._tell = progress
        self._duration, self.stage = duration, ""
        self._begin: float | None = None  # s of the clock, at the first call
        self._last = 0.0

    def __enter__(self) -> _Told:
        return self

    def __exit__(self, *_: object) -> None:
        close = getattr(self._tell, "close", None)
        if close is not None:
            close()

    def __call__(self, motion: Motion, finished: bool = False) -> None:
        if self._tell is None:
            return
        if self._begin is None:
            self._begin = clock.perf_counter()
        now = clock.perf_counter() - self._begin
        if finished or now - self._last > REPORT_EVERY:
            self._last = now
            zones = motion.model.zones
            self._tell(Progress(motion.t, self._duration, motion.steps, motion.iterations, zones, now, self.stage))


def static(scene: Scene, output: str | Path | None = None, *, overwrite: bool = True) -> Result:
    """Find the equilibrium of a scene at t = 0 under its full loads; the result has one output.  Errors as of `run`."""
    check_motions(scene)
    if scene.solver == "shooting":
        from hybrid.arbitrate import static_shooting

        return static_shooting(scene, output, overwrite)
    job, target, effort, begin = Job(scene, None), _target(output), first_effort(scene), clock.process_time()
    if not wants_errors(scene):
        job.record_rest(effort, target, overwrite)
        return open_result(target)
    climb = Climb(
        asked(scene), mesh_is_free(scene), False, False, job.sketch_rest,
        lambda effort: job.record_rest(effort, target, overwrite),
    )  # fmt: skip
    final, errors = climb.reach(effort)
    _amend(target, scene, final, errors, climb, clock.process_time() - begin)
    return open_result(target)


def _equilibrium(scene: Scene, model: Model, t: float) -> Equilibrium:
    """Equilibrium with the loads of time t; infinity stands for loads that have grown to their full size."""
    try:
        return _by_coarser(scene, model, t) or _statics(scene, model, t)
    except ComputationError as failed:
        flexible = float(model.line.h[model.line.spin == 0].max(initial=0.0))
        reasons = reasons_against(scene, (bool(model.line.spin[0]), bool(model.line.spin[-1])), flexible)
        if not reasons:
            raise
        roads = failed.detail.splitlines()
        tried = f"{len(roads)} ways to an equilibrium were tried, the last: {roads[-1].strip()}"
        because = "\n              ".join([*reasons, tried])
        raise ComputationError(failed.outcome, None, failed.s, because) from None


def _statics(scene: Scene, model: Model, t: float, quick: bool = False) -> Equilibrium:
    return solve_statics(
        model.line, model.sea.at(t), model.ends.at(t), model.start, model.length, model.tension_scale,
        model.slack_floor, take_slack=model.slack == "warn" and not quick, shape=model.start_shape,
        others=model.other_starts, settle=getattr(scene.initial, "friction", "") == "settled", quick=quick,
    )  # fmt: skip


def _settles(scene: Scene, model: Model, t: float) -> bool:
    """Whether friction holds the cable where it starts, so that no other start will do."""
    asked = getattr(scene.initial, "friction", "") == "settled"
    return bool(model.line.bits & FRICTION) and (asked or not model.ends.at(t).held.any())


def _by_coarser(scene: Scene, model: Model, t: float) -> Equilibrium | None:
    """The equilibrium of a line of many cells: by Newton at once, or from that of a coarser mesh, easier to find.

    None: neither is, or there are few cells.
    """
    fewer = coarser(model)
    if fewer is None or _settles(scene, model, t):
        return None
    try:
        return _statics(scene, model, t, quick=True)
    except ComputationError:
        pass
    try:
        coarse = _by_coarser(scene, fewer, t) or _statics(scene, fewer, t)
        start = refined(coarse.state, fewer.line, model.line)
        shape = f"the equilibrium with {fewer.cells} cells"
        return _statics(scene, replace(model, start=start, start_shape=shape, other_starts=()), t, quick=True)
    except ComputationError:
        return None


def _first_zones(
    scene: Scene, model: Model, effort: Effort, t: float, criterion: UserCriterion | None, at_rest: bool = False
) -> tuple[Model, Equilibrium | None, Zoning]:
    """Zones, equilibrium if one is asked for, and what will move the zones."""
    wanted = scene.model
    assert isinstance(wanted, AdaptiveModel) and model.layout is not None
    given = given_zones(scene, model.layout)
    step = effort.step if effort.local is None else 0.0
    manager = manager_for(model, effort.zones, wanted.dwell, given, step, criterion)
    equilibrium = None
    if at_rest or scene.initial.kind == "equilibrium":
        model, equilibrium = first_zones(model, manager, t, _equilibrium(scene, model, t))
    else:
        model = zones_of_start(model, manager)
    return model, equilibrium, Zoning(model, manager, loaded=wanted.joint == "curvature")


def _target(output: str | Path | None) -> Path | io.BytesIO:
    return Path(output) if output is not None else io.BytesIO()


def _recorder(
    scene: Scene,
    model: Model,
    observer: Observer,
    target: Path | io.BytesIO,
    overwrite: bool,
    outputs: int,
    found: Equilibrium | None = None,
) -> Recorder:
    attributes: dict[str, str | float | int] = {
        "title": scene.title, "cells": model.cells, "length": model.length, "tension_scale": model.tension_scale,
    }  # fmt: skip
    if found is not None:
        attributes |= {"static_path": found.summary, "static_residual": found.residual}
    fixed = _surroundings(model)
    if scene.output.history:
        points = np.array(scene.output.history)
        fixed.append(
            (Field("history", "m", "arc lengths to follow in histories", (points.size,), ("history",)), points)
        )
    recorder = Recorder(
        target, grid_s=observer.grid.s, fields=observer.fields, step_fields=STEP_FIELDS if outputs else (),
        attributes=attributes, scene_text=scene_text(scene), fixed=fixed, outputs=outputs + 1, overwrite=overwrite,
    )  # fmt: skip
    for s, text in _clamps_left_out(scene, model):
        recorder.event(0.0, s, s, "clamp left out", text)
    left = [s for s in model.attached if model.layout is not None and not _bends(model, s)]
    if left:
        which = ", ".join(f"{s:.5g}" for s in left[:5]) + ", .." * (len(left) > 5)
        text = (
            f"bends at the point loads at s = {which} m shift the cable by less than the tolerance: they have no moment"
        )
        recorder.event(0.0, left[0], left[-1], "point left out", f"{text}; for it, say always_rod around them")
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
        if end.kind not in ("clamped", "guided") or line.spin[cell]:
            continue
        s, far = float(line.s[cell]), float(line.s[-1])
        bend = float(model.cable.B[cell, :2].mean())
        weight = max(abs(float(model.cable.weight[cell])), 1e-9 * model.tension_scale / far)
        reach = min(4.0 * (bend / weight) ** (1.0 / 3.0), far)
        stretch = f"[0, {reach:.3g}]" if cell == 0 else f"[{far - reach:.5g}, {far:.5g}]"
        text = (
            f"the clamp at ends.{name} shifts the cable by less than the tolerance: it is left out, and has no moment, "
            f"as long as a catenary zone ends there; for its moment, and near resonance, say always_rod: [{stretch}]"
        )
        yield s, text


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


@contextmanager
def _interrupts() -> Iterator[Callable[[], bool]]:
    """Catch Ctrl-C and SIGTERM as a flag, so that a run ends between two steps and its file is whole."""
    if threading.current_thread() is not threading.main_thread():
        yield lambda: False
        return
    seen: list[int] = []
    before = {}
    for number in (signal.SIGINT, signal.SIGTERM):
        before[number] = signal.signal(number, lambda got, _frame: seen.append(got))
    try:
        yield lambda: bool(seen)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
