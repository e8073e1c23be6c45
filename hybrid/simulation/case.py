"""The passes of one scene in motion: results, in files that can be resumed, and runs to compare with."""

from __future__ import annotations

import math
import threading
import time as clock
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hybrid.adapt.user_criterion import UserCriterion
from hybrid.errors import OTHER_PROGRAM, ComputationError
from hybrid.kernels.mesh.criteria import CRITERIA
from hybrid.kernels.state.forces import SEABED, SELF_CONTACT
from hybrid.kernels.state.state import Floats, State
from hybrid.model.bending_reference import NO_DOUBT
from hybrid.model.build import Model, build
from hybrid.model.output_points import OutputPoints, output_points
from hybrid.model.payout import longest_out, winch_side
from hybrid.model.plan import SAME_STOP, output_times
from hybrid.model.plane import as_begun
from hybrid.model.resolution import (
    Reach,
    Resolution,
    first_resolution,
    follows_curvature,
    has_limits,
    judges_bends,
    requested_accuracy,
    wants_errors,
)
from hybrid.model.sections import section_changes
from hybrid.model.self_reach import self_reach, without_contact
from hybrid.model.system import SystemResolution, build_system
from hybrid.outputs.edge_errors import EDGE_ERRORS, MISSED
from hybrid.outputs.probes import Features, Observer, Recorded
from hybrid.outputs.quantities import quantities_of
from hybrid.scene.obstacles import files_of
from hybrid.scene.read import scene_text
from hybrid.scene.schema import Scene
from hybrid.scene.short_form import LINE, network_of, short_form
from hybrid.simulation.bending_correction import Correction
from hybrid.simulation.beside import beside, thread_count
from hybrid.simulation.equilibrium import equilibrium_of
from hybrid.simulation.events import EventLog
from hybrid.simulation.initial_zones import reasons_at_start, zones_at_start
from hybrid.simulation.interrupts import at_once
from hybrid.simulation.mesh_survey import Survey, survey_duration, survey_points
from hybrid.simulation.progress import ESTIMATION, PRE_RUN, REFINEMENT, RESULT, ProgressReporter
from hybrid.simulation.restart import LoadChange, changes_text
from hybrid.simulation.restore import (
    is_cut_off,
    other_program,
    refused,
    require_same,
    resolution_from,
    restored_parts,
)
from hybrid.simulation.result_checks import damped_vibrations
from hybrid.simulation.result_file import STEP_FIELDS, mesh_fields, result_recorder
from hybrid.simulation.run_file import AnyRecorder, Cable
from hybrid.simulation.run_sample import (
    ALL,
    COMPARED,
    MODEL_ERRORS,
    NOT_ESTIMATED,
    Notes,
    RunSample,
    catenary_share,
    compared_cells,
    compared_places,
    is_along,
    most_at_places,
    rows_key,
    split_outputs,
    usual_cells,
)
from hybrid.simulation.switch import as_network
from hybrid.simulation.system_lines import LineResult
from hybrid.simulation.system_run import Recording, SystemRun, start_of
from hybrid.simulation.system_zones import Start
from hybrid.simulation.time_loop import FORCE_COLUMNS, TimeLoop
from hybrid.simulation.transient import Transient
from hybrid.simulation.zone_switching import ZoneSwitching
from hybrid.solve.statics import Equilibrium
from hybrid.store.array_recorder import ArrayRecorder, MemoryTarget, Target
from hybrid.store.checkpoint import digest_of, read_checkpoint
from hybrid.store.comparison_recorder import ComparisonRecorder
from hybrid.store.envelope import GROUP as ENVELOPE
from hybrid.store.hdf5_file import open_file, opened
from hybrid.store.limits import EXTREMES, extremes_about
from hybrid.store.named_arrays import Tree
from hybrid.store.reader import Result, open_result, written_result
from hybrid.store.records import ERROR_ESTIMATE, PENDING, RODS_AT_START, THERE
from hybrid.store.stored_array import StoredArray
from hybrid.store.stored_rows import RowsRecorder, rows_path
from hybrid.store.whole_file import LateFile
from hybrid.store.writer import AT_ONCE, Recorder, WriteMode

# Of every step, what extremes of the end forces follow from.
FORCES = ("t", "end_force_start", "end_force_end")
ZONES_FIXED = (
    "zones stay rod: in equilibrium, catenary where the criteria allow it is further from the rod than the tolerance; "
    "more mesh.cells, or a larger model.tolerance, let them move"
)

# Steps of a result from which on runs to compare with are computed in threads: before, all takes about 0.1 s.
WORTH_THREADS = 500
# Numbers that the outputs of a run to compare with may take in memory and in checkpoints, 8 MB; more go into a file.
MOST_IN_MEMORY = 1_000_000

# What may follow a run from its first state on.
Begun = Callable[[TimeLoop, Equilibrium | None], None]


class Computed(NamedTuple):
    """What is asked of the run of a complete result."""

    resolution: Resolution
    model: Model  # at its end
    steps: int
    zones_move: bool
    doubt: Floats  # of `RunSample`


class Case:
    """One scene in motion, computed as often and as finely as it takes."""

    def __init__(
        self,
        scene: Scene,
        criterion: UserCriterion | None,
        changes: Sequence[LoadChange] = (),
        points: OutputPoints | None = None,
    ) -> None:
        """changes: scenes that hold from some time on; what they may differ in, `remaining_run` has checked.

        points: of the result that is continued; None: those of the scene.
        """
        self.scene, self.criterion, self.changes = scene, criterion, tuple(changes)
        self.points = points if points is not None else output_points(scene, longest_out(scene), not winch_side(scene))
        # Of these, where runs are compared: a bend may be sharp between a hundred places.
        self.places = ALL if judges_bends(scene) else compared_places(self.points)
        self.progress = ProgressReporter(None, 1.0)
        self.interrupted: Callable[[], bool] = lambda: False
        self.beside_result: Path | None = None  # beside which outputs of long runs to compare with are kept
        self.late_file: LateFile | None = None  # of a result that is complete, and may not be in its place yet
        self.late_finer: LateFile | None = None  # of a finer one, which may take its place
        self._results = 0  # that were begun
        self._told: tuple[Scene, str] | None = None  # a scene, and what it is as a text
        self._owner = threading.get_ident()  # the thread that puts files in their places
        self._begun: tuple[Resolution, tuple[Model, Equilibrium | None, ZoneSwitching | None]] | None = None
        self._start_of_lines: tuple[Resolution, Start] | None = None
        self.reach: Reach | None = None  # how far the line moves, by a pre-run
        self.came_near_itself = False  # whether the line did in a run to compare with
        # Whether contact with itself is computed in runs to compare with: where it is asked for, or the line has
        # touched itself in a result.  Before, coarse cells would meet where those of the result do not.
        self.touches_itself = bool(scene.contact.self)
        self.notes: list[tuple[str, str]] = []  # events (kind, text) of the whole of every result
        self._unwanted = threading.Event()  # what runs to compare with still compute

    # --- results --------------------------------------------------------------------------------

    def record(
        self, resolution: Resolution, target: Target, before: Tree | None = None, begun: Begun | None = None
    ) -> RunSample:
        """Compute the result into a file, or memory; what is to be compared of it.  before: what was found before;

        begun: called behind the first output.

        A file that errors will be added to, and that is complete before it had to be there, waits in `late_file`.
        """
        first = self._takes_its_place(target)
        begin = self._begin_result(resolution, first)
        kept = before or {} if isinstance(target, Path) else None
        mode = WriteMode(kept, late=not (first and self.progress.heard), unseen=not first)
        if as_network():
            recording = Recording(mode, pending=ERROR_ESTIMATE if before else "", notes=self.notes)
            return self._move(self._network_run(resolution, target, recording), begin, first)
        loop, recorder, equilibrium = self.prepare(resolution, target, mode)
        loop.recorder = recorder
        if isinstance(recorder, Recorder):
            recorder.amended = self.beside_result is not None
        with recorder:
            loop.begin(equilibrium)
            if begun is not None:
                begun(loop, equilibrium)
            loop.to_the_end(self._duration, self._exact, self.changes)
            loop.close()
        waits = self._take_late_file(recorder, first)
        return self._compared(_of_cable(loop.run), target, clock.process_time() - begin, waits)

    def _take_late_file(self, recorder: AnyRecorder, first: bool) -> LateFile | None:
        """The file of a complete result that has still to be put in its place; first: as of `_begin_result`."""
        waits = recorder.late_file if isinstance(recorder, Recorder) else None
        if first:
            self.late_file = waits
        else:
            self.late_finer = waits
        return waits

    def _takes_its_place(self, target: Target) -> bool:
        """Whether a result is where it belongs, and not beside one that it may replace."""
        return self.beside_result is None or target == self.beside_result

    def settle(self, kept: bool) -> bool:
        """Let a finer result take the place of the one before it, or drop it; False: it is a file that is there."""
        late, self.late_finer = self.late_finer, None
        waits = late is not None and not late.placed
        if kept and self.late_file is not None:
            self.late_file.drop()
            self.late_file = None
        if late is not None and waits and kept:
            assert self.beside_result is not None
            late.path, self.late_file = self.beside_result, late
        elif late is not None and waits:
            late.drop()
        return waits

    def prepare(
        self, resolution: Resolution, target: Target, mode: WriteMode = AT_ONCE
    ) -> tuple[TimeLoop, Recorder | ArrayRecorder, Equilibrium | None]:
        """The loop of a run, its result, and the equilibrium that it starts from; mode: of a file."""
        model, equilibrium, switching = self._start(resolution)
        loop = self._loop(self.scene, model, resolution, switching, target)
        assert loop.run.envelope is not None
        manager = switching.manager if switching is not None else None
        notes = {PENDING: ERROR_ESTIMATE if mode.before else "", RODS_AT_START: reasons_at_start(manager)}
        recorder = result_recorder(
            self.scene, model, loop.observer, target, self._texts, equilibrium, loop.run.envelope,
            len(output_times(self.scene)), mode, notes,
        )  # fmt: skip
        recorder.files = self._files
        for kind, text in self.notes:
            recorder.event(0.0, 0.0, model.length, kind, text)
        if switching is not None and switching.manager.held:
            recorder.event(0.0, 0.0, model.length, "zones fixed", ZONES_FIXED)
        return loop, recorder, equilibrium

    def resume(self, source: Path, target: Path, before: Tree | None = None) -> RunSample:
        """The same from the checkpoint of a result, which may be the target; ResultError if it has none."""
        if as_network():
            return self._resume_network(source, target, before)
        with opened(source) as file:
            point = read_checkpoint(file)
            require_same(point, self._files, self.criterion, source)
            texts = self._texts
            if (
                "self_contact" not in file and self_reach(self.scene).may
            ):  # of a version that did not compute contact without being asked
                self.scene = without_contact(self.scene)
                self.changes = tuple(replace(x, scene=without_contact(x.scene)) for x in self.changes)
            scenes = (self.scene, *(x.scene for x in self.changes))
            with refused(source):
                resolution = resolution_from(point.resolution, self.scene)
                self._begin_result(resolution, self._takes_its_place(target))
                model, switching, correction = restored_parts(scenes, resolution, point.state, self.criterion)
                loop = self._loop(scenes[point.state["changes"]], model, resolution, switching, target, correction)
                loop.restore(point.state)
                near = SAME_STOP * resolution.step  # an output may be due where a load turns, but for round-off
                if not point.t - near <= loop.run.t <= self.scene.require_time().duration:
                    raise ValueError(f"t = {loop.run.t:g} s after an output at {point.t:g} s")
                due, at = loop.run.run.books.outputs, int(loop.run.run.count.output)
                if at < due.size and not due[at] > point.t:
                    raise ValueError(f"an output at {due[at]:g} s is due, after one at {point.t:g} s")
            assert loop.run.envelope is not None
            loop.recorder = recorder = Recorder.again(
                file, target, loop.observer.fields, STEP_FIELDS, point, texts, before or {},
                [*loop.run.envelope.fixed(), *mesh_fields(model)], pending=ERROR_ESTIMATE if before else "",
            )  # fmt: skip
        recorder.files = self._files
        with recorder:
            if why := other_program(point):
                recorder.event(point.t, 0.0, model.length, OTHER_PROGRAM, why)
            loop.to_the_end(self._duration, self._exact, self.changes)
            loop.close()
        return self._compared(_of_cable(loop.run), target, loop.cpu, None)

    def is_unfinished(self, source: Path, resolution: Resolution) -> bool:
        """Whether a file holds a run of this case, with this resolution, that was cut off."""
        texts = self._texts["scene"], self._texts["changes"]
        if not is_cut_off(source, texts, SystemResolution({LINE: resolution})):
            return False
        with open_result(source) as result:
            return np.array_equal(result["s"], self.points.s)

    def _begin_result(self, resolution: Resolution, first: bool) -> float:
        """The pass of a result begins; s of processor time.  first: it takes the place of one that may be there."""
        if first and self.late_file is not None:
            self.late_file.place()
            self.late_file = None
        self.progress.begin(REFINEMENT if self._results else RESULT, resolution)
        self._results += 1
        return clock.process_time()

    @property
    def _duration(self) -> float:
        """When the run ends, s."""
        return self.scene.require_time().duration

    @property
    def _judges(self) -> bool:
        """Whether limits are held against extremes, whose errors are estimated."""
        return wants_errors(self.scene) and has_limits(self.scene)

    @property
    def _exact(self) -> bool:
        """Whether steps end at outputs."""
        return self.scene.output.exact

    @property
    def _texts(self) -> dict[str, str]:
        """What the file says of the scene, and of what changes."""
        if self._told is None or self._told[0] is not self.scene:
            self._told = self.scene, scene_text(self.scene)
        return {"scene": self._told[1], "changes": changes_text(self.changes)}

    @property
    def _files(self) -> dict[str, str]:
        """Digests of the files that the scene reads, by path: a run that is resumed needs the same."""
        paths = {
            path
            for x in (self.scene, *(x.scene for x in self.changes))
            for path in (*x.ends.files(), *x.environment.files(), *x.cable.files(), *files_of(x.obstacles))
        }
        return {path: digest_of(Path(path)) for path in sorted(paths)}

    def _compared(self, run: Computed, target: Target, cpu: float, late: LateFile | None) -> RunSample:
        """What is to be compared of a complete result; late: it has no file yet."""
        resolution, cells = run.resolution, compared_cells(run.model)
        if not wants_errors(self.scene):
            return RunSample(resolution, {}, cells, run.steps, 0.0)
        assert not isinstance(target, MemoryTarget), "errors are written into a file"
        with ExitStack() as stack:
            data = late.data if late is not None else stack.enter_context(open_file(target, summed=False))
            errors = [*(MODEL_ERRORS + x for x in data.get(MODEL_ERRORS, ())), *(x for x in data if MODEL_ERRORS in x)]
            stored = {name: data[name] for name in (*COMPARED, *errors) if name in data}
            # they stay in the file, if they are many, that is one, and no finer result may replace it
            many = late is None and sum(x.size for x in stored.values()) > MOST_IN_MEMORY
            stay = target if many and isinstance(target, Path) and requested_accuracy(self.scene) is None else None
            found = {
                name: StoredArray(stay, name, self._places_of(name)) if stay is not None else self._at_places(name, x)
                for name, x in stored.items()
            }
            edges = [x for x in MISSED if EDGE_ERRORS + x in data]
            missed = {x: most_at_places(data[EDGE_ERRORS + x], self.places) for x in edges}
            kinds = data["events/kind"][()]
            unresolved, touches = b"unresolved bend" in kinds, b"line touches itself" in kinds
            if follows_curvature(self.scene):
                cells = compared_cells(run.model, resolution.fineness, usual_cells(data[THERE][()]))
            forces = np.column_stack([data[f"steps/{name}"][()] for name in FORCES])
            held = {x: data[x][()] for x in _datasets(data, ENVELOPE, EXTREMES)} if self._judges else {}
        self.touches_itself |= touches
        values, model_error = split_outputs(found)
        notes: Notes = ()
        catenary, bound = np.zeros(0), 0.0
        if run.zones_move:
            bound = resolution.zones * run.model.length
        if resolution.local is not None or run.zones_move:
            whole = Result(late.path, contents=late.contents) if late is not None else None
            with written_result(target) if whole is None else nullcontext(whole) as result:
                if resolution.local is not None:
                    notes = damped_vibrations(result)
                if run.zones_move:
                    catenary = np.array([catenary_share(x) for x in result.zones])
        return RunSample(
            resolution, values, cells, run.steps, cpu, 1, unresolved, model_error, bound, notes, forces=forces,
            catenary=catenary, doubt=run.doubt, touches=touches, places=self.places, at_edges=missed,
            extremes=extremes_about(held, self.points.s),
        )  # fmt: skip

    def _places_of(self, name: str) -> np.ndarray | None:
        """Of an output, or an error of one, the numbers of the points where runs are compared; None: all."""
        return self.places if self.places.size and is_along(name.removeprefix(MODEL_ERRORS)) else None

    def _at_places(self, name: str, values: Any) -> np.ndarray:
        """The values (nt, ...) of a dataset where runs are compared."""
        places, found = self._places_of(name), np.asarray(values[()])
        return found if places is None else found[:, places]

    # --- runs to compare with -------------------------------------------------------------------

    def beside(
        self, samples: Sequence[Callable[[], RunSample]]
    ) -> AbstractContextManager[Sequence[Callable[[], RunSample]]]:
        """Runs to compare with, in threads where that is worth it (simulation.beside).

        A criterion of the user may not expect to be called by several threads.
        """
        steps = self._duration / first_resolution(self.scene).step
        threads = thread_count() if self.criterion is None and steps >= WORTH_THREADS else 1
        self._unwanted.clear()
        return beside(samples, threads, self.progress.look, self._unwanted.set)

    def sample(self, resolution: Resolution, points: Floats | None = None, until: float | None = None) -> RunSample:
        """Compute for comparison only; points: places, m, instead of those of the result; until: s, None: to the end.

        A resolution with longer steps has as many times fewer outputs, to save time, and so that outputs do not
        shorten its steps where these end at outputs.
        """
        begin = clock.thread_time()
        self.progress.begin(ESTIMATION if points is None else PRE_RUN, resolution)
        if as_network():
            return self._sample_of_network(resolution, points, until, begin)
        model, equilibrium, switching = self._start(resolution)
        s = points if points is not None else self.points.s[self.places] if self.places.size else self.points.s
        ranges = points is None and self._judges
        loop = self._loop(self.scene, model, resolution, switching, None, points=s, until=until, ranges=ranges)
        numbers = len(loop.run.run.books.outputs) * sum(math.prod(field.shape) for field in loop.observer.fields)
        if self.beside_result is not None and points is None and numbers > MOST_IN_MEMORY:
            loop.recorder = RowsRecorder(rows_path(self.beside_result, rows_key(resolution)), FORCE_COLUMNS)
        found = loop.recorder
        assert isinstance(found, ComparisonRecorder)
        try:
            loop.begin(equilibrium)
            loop.to_the_end(until or self._duration, self._exact, self.changes)
        finally:
            found.close("", "")
        self.came_near_itself |= loop.run.came_near_itself or loop.run.run.contact is not None
        values, errors = split_outputs({name: found[name] for name in found.names})
        cpu = clock.thread_time() - begin
        bound = resolution.zones * model.length if switching is not None else 0.0
        unknown = [f"in a run to compare with, {text}" for kind, text in found.events if kind == NOT_ESTIMATED]
        notes = tuple((NOT_ESTIMATED, text) for text in unknown[:1])
        fineness = resolution.fineness if follows_curvature(self.scene) else 0.0
        rows = found.reference() if isinstance(found, RowsRecorder) else {}
        envelope = loop.run.envelope
        held = {x.name: y for x, y in envelope.fixed()} | loop.run.envelope_values() if envelope is not None else {}
        catenary = found.catenary if switching is not None else np.zeros(0)
        return RunSample(
            resolution, values, compared_cells(model, fineness), loop.run.steps, cpu, resolution.every, False, errors,
            bound, notes, rows, found.steps, catenary, doubt_of(loop.run), loop.run.touches, self.places,
            extremes=extremes_about(held, self.points.s),
        )  # fmt: skip

    def survey(self, resolution: Resolution, coarse: Resolution) -> Survey | None:
        """A coarse run that shows where cells should be short; None: it failed.

        resolution: of the result.  ComputationError: it failed in steps as short as those of the result too, and the
        scene gives cells to a layer.
        """
        until = None if self.changes else survey_duration(self.scene)
        try:
            model, _ = self.first_shape(coarse)
            s = survey_points(model, coarse)
            found = self.sample(coarse, s, until).values
        except ComputationError:
            if self.scene.resolution is None:
                return None
            coarse = coarse.coarser(steps=resolution.step / coarse.step)  # as short as those of the result
            model, _ = self.first_shape(coarse)
            s = survey_points(model, coarse)
            found = self.sample(coarse, s, until).values
        survey = Survey.of(self.scene, resolution, model, s, found)
        self.reach = survey.reach
        return survey

    # --- as a network of one line -----------------------------------------------------------------

    def _network_run(self, resolution: Resolution, target: Target | None, recording: Recording) -> SystemRun:
        """The run of the network, as yet without a first output; recording: beside what the case says."""
        system, changes = network_of(self.scene), [replace(x, scene=network_of(x.scene)) for x in self.changes]
        recording = recording._replace(planes=True, error=True, cable=Cable(self.scene, self.changes))
        if recording.points is None:
            recording = recording._replace(points=self.points)
        with short_form(self.scene).said():
            if recording.source is None:
                recording = recording._replace(start=self._network_start(resolution))
            finely = SystemResolution({LINE: resolution})
            return SystemRun(system, target, self._texts["scene"], True, finely, recording, self.criterion, changes)

    def _move(self, run: SystemRun, begin: float, first: bool) -> RunSample:
        """A result to its end; begin: s of processor time, when it was begun; first: as of `_begin_result`."""
        recorder, target = run.recorder, run.target
        assert target is not None and isinstance(recorder, Recorder | ArrayRecorder)
        if isinstance(recorder, Recorder):
            recorder.amended = self.beside_result is not None
        with recorder, short_form(self.scene).said():
            run.record_motion(self.progress, self._result_interrupted)
        (line,) = run.lines
        done = Computed(run.resolution.one, line.model, run.steps, line.manager is not None, doubt_of_line(line))
        return self._compared(done, target, clock.process_time() - begin, self._take_late_file(recorder, first))

    def _resume_network(self, source: Path, target: Path, before: Tree | None) -> RunSample:
        """As `resume`."""
        with opened(source) as file:
            if "self_contact" not in file and self_reach(self.scene).may:
                told, self.scene = self._texts["scene"], without_contact(self.scene)
                self.changes = tuple(replace(x, scene=without_contact(x.scene)) for x in self.changes)
                self._told = self.scene, told  # the file keeps what was asked for
            with refused(source):
                resolution = resolution_from(read_checkpoint(file).resolution, self.scene)
        first = self._takes_its_place(target)
        begin = self._begin_result(resolution, first)
        recording = Recording(WriteMode(before or {}), source, ERROR_ESTIMATE if before else "")
        run = self._network_run(resolution, target, recording)
        return self._move(run, begin - run.cpu, first)

    def _network_start(self, resolution: Resolution) -> Start:
        """The first state of the network, which may have been kept for a run of this resolution."""
        kept, self._start_of_lines = self._start_of_lines, None
        if kept is not None and kept[0] is resolution:
            return kept[1]
        system = network_of(self.scene)
        with at_once(self.interrupted):
            model = build_system(system, SystemResolution({LINE: resolution}))
            return start_of(system, model, True, self.criterion)

    def _sample_of_network(
        self, resolution: Resolution, points: Floats | None, until: float | None, begin: float
    ) -> RunSample:
        """As `sample`; begin: s, of the processor."""
        s = points if points is not None else self.points.s[self.places] if self.places.size else self.points.s
        recording = Recording(points=self.points._replace(s=s), until=until, touches=self.touches_itself)
        run = self._network_run(resolution, None, recording)
        line = run.lines[0]
        numbers = (len(run.times) + 1) * sum(math.prod(field.shape) for field in line.observer.fields)
        if self.beside_result is not None and points is None and numbers > MOST_IN_MEMORY:
            line.recorder = RowsRecorder(rows_path(self.beside_result, rows_key(resolution)), FORCE_COLUMNS)
        found = line.recorder
        assert isinstance(found, ComparisonRecorder)
        try:
            with short_form(self.scene).said():
                run.record_motion(self.progress, self._comparison_interrupted)
        finally:
            found.close("", "")
        self.came_near_itself |= run.came_near_itself or line.contact is not None
        values, errors = split_outputs({name: found[name] for name in found.names})
        cpu = clock.thread_time() - begin
        moves, follows = line.manager is not None, follows_curvature(self.scene)
        unknown = [f"in a run to compare with, {text}" for kind, text in found.events if kind == NOT_ESTIMATED]
        notes = tuple((NOT_ESTIMATED, text) for text in unknown[:1])
        rows = found.reference() if isinstance(found, RowsRecorder) else {}
        held: dict[str, Any] = {}
        if points is None and self._judges:
            held = {x.name: y for x, y in line.envelope.fixed()}
            held |= line.envelope.values(line.model.nodes, line.books.extremes, run.t)
        return RunSample(
            resolution, values, compared_cells(line.model, resolution.fineness if follows else 0.0), run.steps, cpu,
            resolution.every, False, errors, resolution.zones * line.model.length if moves else 0.0, notes, rows,
            found.steps, found.catenary if moves else np.zeros(0), doubt_of_line(line), run.lets_touch, self.places,
            extremes=extremes_about(held, self.points.s),
        )  # fmt: skip

    # --- parts of a run -------------------------------------------------------------------------

    def first_shape(self, resolution: Resolution) -> tuple[Model, State]:
        """Model and state of a run as it begins, which are kept for a run of this resolution that comes next."""
        if as_network():
            with short_form(self.scene).said():
                start = self._network_start(resolution)
            self._start_of_lines = resolution, start
            line = start.model.models[0]
            return line, line.start if start.found is None else start.found.state.lines[0]
        model, found, _ = begun = self._start(resolution)
        self._begun = resolution, begun
        return model, model.start if found is None else found.state

    def _start(self, resolution: Resolution) -> tuple[Model, Equilibrium | None, ZoneSwitching | None]:
        """The model, its equilibrium if it starts from one, and what moves its zones if they move."""
        kept, self._begun = self._begun, None
        if kept is not None and kept[0] is resolution:
            return kept[1]
        with at_once(self.interrupted):
            model = build(self.scene, resolution)
            if model.layout is not None:
                return zones_at_start(self.scene, model, resolution, 0.0, self.criterion)
            found = equilibrium_of(self.scene, model, 0.0) if self.scene.initial.kind == "equilibrium" else None
            return model, found, None

    def _loop(
        self,
        scene: Scene,
        model: Model,
        resolution: Resolution,
        switching: ZoneSwitching | None,
        target: Target | None,
        correction: Correction | None = None,
        points: Floats | None = None,
        until: float | None = None,
        ranges: bool = False,
    ) -> TimeLoop:
        """The loop of a run, as yet without a state; scene: the one that holds now; ranges: as of `Transient`."""
        if correction is None and model.follows_error:
            correction = Correction(model, switching.torque if switching is not None else None)
        times = output_times(self.scene)
        if target is None and resolution.every > 1:
            times = [*times[resolution.every - 1 : -1 : resolution.every], times[-1]]
        if until is not None and until < times[-1]:
            times = [t for t in times if t < until] + [until]
        of_result = target is not None
        run = Transient(
            scene, model, resolution, switching, correction, EventLog(), [0.0, *times], of_result,
            of_result or self.touches_itself, ranges,
        )  # fmt: skip
        if points is None:
            points = self.points.s
        observer = self.observer(model, switching is not None, points, None if target is not None else COMPARED)
        interrupted = self._result_interrupted if target is not None else self._comparison_interrupted
        return TimeLoop(run, observer, target, self._report, interrupted)

    def _result_interrupted(self) -> bool:
        """Whether a result is to stop; one before it that has waited long enough is put in its place."""
        for late in (self.late_file, self.late_finer):
            if late is not None and threading.get_ident() == self._owner:
                late.place_if_due()
        return self.interrupted()

    def _comparison_interrupted(self) -> bool:
        """The same of a run to compare with."""
        return self._unwanted.is_set() or self._result_interrupted()

    def observer(self, model: Model, zones_move: bool, s: Floats, only: Sequence[str] | None) -> Observer:
        """What records outputs at points s (m); only: names of quantities, None: all."""
        kinds = {"rod", "catenary"} if zones_move else None
        criteria = (
            [(x.name, x.ratio) for x in CRITERIA] if self.scene.output.criteria and zones_move and not only else ()
        )
        errors = model.follows_error and wants_errors(self.scene)
        finest = model.finest_nodes if follows_curvature(self.scene) and model.layout and not only else None
        features = Features(
            model.attached, section_changes(self.scene), model.hinges, kinds, finest, model.payout is not None,
            () if only else model.sea.names,
        )  # fmt: skip
        recorded = Recorded(
            not only, only, criteria, errors,
            edges=not only and wants_errors(self.scene) and bool(model.line.bits & SEABED),
            gauges=() if only else self.scene.output.elevation or (),
            quantities=None if only else quantities_of(self.scene),
        )  # fmt: skip
        line = as_begun(model.line, model.held, self.scene.dimension)
        points = self.points._replace(s=s)
        observer = Observer(line, model.sea.values, model.zones, points, features, recorded)
        observer.line = model.line
        return observer

    def _report(self, run: Transient, finished: bool) -> None:
        if self.progress.heard:
            touches = bool(run.model.line.bits & SELF_CONTACT)
            self.progress(run.t, run.steps, run.iterations, run.model.zones, finished, touches)


def _datasets(data: Mapping[str, Any], *groups: str) -> list[str]:
    """Names of what stands in groups of a file, or of a result in memory, itself."""
    names = [f"{x}/{name}" for x in groups for name in data.get(x, ())] or [x for x in data if x.startswith(groups)]
    return [x for x in names if x.count("/") == 1 and hasattr(data[x], "shape")]


def doubt_of_line(line: LineResult) -> Floats:
    """As `doubt_of`, of the line of a network."""
    return line.correction.doubt if line.correction is not None and line.manager is None else np.array(NO_DOUBT)


def _of_cable(run: Transient) -> Computed:
    return Computed(run.resolution, run.model, run.steps, run.switching is not None, doubt_of(run))


def doubt_of(run: Transient) -> Floats:
    """`RunSample.doubt` of a complete run; of zones that move criteria of zones bound what bending does."""
    return run.correction.doubt if run.correction is not None and run.switching is None else np.array(NO_DOUBT)
