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

from hybrid.adapt.user_criterion import UserCriterion, of_line
from hybrid.errors import ComputationError
from hybrid.kernels.state.state import Floats, State
from hybrid.model.bending_reference import NO_DOUBT
from hybrid.model.build import Model
from hybrid.model.network import NetworkResolution, build_system
from hybrid.model.output_points import OutputPoints, output_points
from hybrid.model.payout import longest_out, winch_side
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
from hybrid.model.self_reach import self_reach, without_contact
from hybrid.outputs.edge_errors import EDGE_ERRORS, MISSED
from hybrid.scene.read import scene_text
from hybrid.scene.schema import LineScene
from hybrid.scene.short_form import LINE, network_of, short_form
from hybrid.simulation.beside import beside, thread_count
from hybrid.simulation.interrupts import at_once
from hybrid.simulation.line_result import FORCE_COLUMNS, LineResult
from hybrid.simulation.mesh_survey import Survey, survey_duration, survey_points
from hybrid.simulation.network_run import NetworkRun, Recording, start_of
from hybrid.simulation.progress import ESTIMATION, PRE_RUN, REFINEMENT, RESULT, ProgressReporter
from hybrid.simulation.restart import LoadChange, changes_text
from hybrid.simulation.restore import (
    is_cut_off,
    refused,
    resolution_from,
)
from hybrid.simulation.result_checks import damped_vibrations
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
from hybrid.simulation.run_zones import Start
from hybrid.store.array_recorder import ArrayRecorder, MemoryTarget, Target
from hybrid.store.checkpoint import read_checkpoint
from hybrid.store.comparison_recorder import ComparisonRecorder
from hybrid.store.envelope import GROUP as ENVELOPE
from hybrid.store.hdf5_file import open_file, opened
from hybrid.store.limits import EXTREMES, extremes_about
from hybrid.store.named_arrays import Tree
from hybrid.store.reader import Result, open_result, written_result
from hybrid.store.records import ERROR_ESTIMATE, THERE
from hybrid.store.stored_array import StoredArray
from hybrid.store.stored_rows import RowsRecorder, rows_path
from hybrid.store.whole_file import LateFile
from hybrid.store.writer import Recorder, WriteMode

# Of every step, what extremes of the end forces follow from.
FORCES = ("t", "end_force_start", "end_force_end")

# Steps of a result from which on runs to compare with are computed in threads: before, all takes about 0.1 s.
WORTH_THREADS = 500
# Numbers that the outputs of a run to compare with may take in memory and in checkpoints, 8 MB; more go into a file.
MOST_IN_MEMORY = 1_000_000


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
        scene: LineScene,
        criterion: UserCriterion | None,
        changes: Sequence[LoadChange] = (),
        points: OutputPoints | None = None,
    ) -> None:
        """changes: scenes that hold from some time on; what they may differ in, `remaining_run` has checked.

        points: of the result that is continued; None: those of the scene.
        """
        self.scene, self.criterion, self.changes = scene, of_line(criterion, ""), tuple(changes)
        self.points = points if points is not None else output_points(scene, longest_out(scene), not winch_side(scene))
        # Of these, where runs are compared: a bend may be sharp between a hundred places.
        self.places = ALL if judges_bends(scene) else compared_places(self.points)
        self.progress = ProgressReporter(None, 1.0)
        self.interrupted: Callable[[], bool] = lambda: False
        self.beside_result: Path | None = None  # beside which outputs of long runs to compare with are kept
        self.late_file: LateFile | None = None  # of a result that is complete, and may not be in its place yet
        self.late_finer: LateFile | None = None  # of a finer one, which may take its place
        self._results = 0  # that were begun
        self._told: tuple[LineScene, str] | None = None  # a scene, and what it is as a text
        self._owner = threading.get_ident()  # the thread that puts files in their places
        self._start_of_lines: tuple[Resolution, Start] | None = None
        self.reach: Reach | None = None  # how far the line moves, by a pre-run
        self.came_near_itself = False  # whether the line did in a run to compare with
        # Whether contact with itself is computed in runs to compare with: where it is asked for, or the line has
        # touched itself in a result.  Before, coarse cells would meet where those of the result do not.
        self.touches_itself = bool(scene.contact.self)
        self.notes: list[tuple[str, str]] = []  # events (kind, text) of the whole of every result
        self._unwanted = threading.Event()  # what runs to compare with still compute

    # --- results --------------------------------------------------------------------------------

    def record(self, resolution: Resolution, target: Target, before: Tree | None = None) -> RunSample:
        """Compute the result into a file, or memory; what is to be compared of it.  before: what was found before.

        A file that errors will be added to, and that is complete before it had to be there, waits in `late_file`.
        """
        first = self._takes_its_place(target)
        begin = self._begin_result(resolution, first)
        kept = before or {} if isinstance(target, Path) else None
        mode = WriteMode(kept, late=not (first and self.progress.heard), unseen=not first)
        recording = Recording(mode, pending=ERROR_ESTIMATE if before else "", notes=self.notes)
        return self._move(self._network_run(resolution, target, recording), begin, first)

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

    def resume(self, source: Path, target: Path, before: Tree | None = None) -> RunSample:
        """The same from the checkpoint of a result, which may be the target; ResultError if it has none."""
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

    def is_unfinished(self, source: Path, resolution: Resolution) -> bool:
        """Whether a file holds a run of this case, with this resolution, that was cut off."""
        texts = self._texts["scene"], self._texts["changes"]
        if not is_cut_off(source, texts, NetworkResolution({LINE: resolution})):
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
    def _texts(self) -> dict[str, str]:
        """What the file says of the scene, and of what changes."""
        if self._told is None or self._told[0] is not self.scene:
            self._told = self.scene, scene_text(self.scene)
        return {"scene": self._told[1], "changes": changes_text(self.changes)}

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

    def _network_run(self, resolution: Resolution, target: Target | None, recording: Recording) -> NetworkRun:
        """The run of the network, as yet without a first output; recording: beside what the case says."""
        system, changes = network_of(self.scene), [replace(x, scene=network_of(x.scene)) for x in self.changes]
        recording = recording._replace(planes=True, error=True, cable=Cable(self.scene, self.changes))
        if recording.points is None:
            recording = recording._replace(points=self.points)
        with short_form(self.scene).said():
            if recording.source is None:
                recording = recording._replace(start=self._network_start(resolution))
            finely = NetworkResolution({LINE: resolution})
            return NetworkRun(system, target, self._texts["scene"], True, finely, recording, self.criterion, changes)

    def _move(self, run: NetworkRun, begin: float, first: bool) -> RunSample:
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

    def _network_start(self, resolution: Resolution) -> Start:
        """The first state of the network, which may have been kept for a run of this resolution."""
        kept, self._start_of_lines = self._start_of_lines, None
        if kept is not None and kept[0] is resolution:
            return kept[1]
        system = network_of(self.scene)
        with at_once(self.interrupted):
            model = build_system(system, NetworkResolution({LINE: resolution}))
            return start_of(system, model, True, self.criterion)

    # --- parts of a run -------------------------------------------------------------------------

    def first_shape(self, resolution: Resolution) -> tuple[Model, State]:
        """Model and state of a run as it begins, which are kept for a run of this resolution that comes next."""
        with short_form(self.scene).said():
            start = self._network_start(resolution)
        self._start_of_lines = resolution, start
        line = start.model.models[0]
        return line, line.start if start.found is None else start.found.state.lines[0]

    def _result_interrupted(self) -> bool:
        """Whether a result is to stop; one before it that has waited long enough is put in its place."""
        for late in (self.late_file, self.late_finer):
            if late is not None and threading.get_ident() == self._owner:
                late.place_if_due()
        return self.interrupted()

    def _comparison_interrupted(self) -> bool:
        """The same of a run to compare with."""
        return self._unwanted.is_set() or self._result_interrupted()


def _datasets(data: Mapping[str, Any], *groups: str) -> list[str]:
    """Names of what stands in groups of a file, or of a result in memory, itself."""
    names = [f"{x}/{name}" for x in groups for name in data.get(x, ())] or [x for x in data if x.startswith(groups)]
    return [x for x in names if x.count("/") == 1 and hasattr(data[x], "shape")]


def doubt_of_line(line: LineResult) -> Floats:
    """`RunSample.doubt` of a complete run; of zones that move criteria of zones bound what bending does."""
    return line.correction.doubt if line.correction is not None and line.manager is None else np.array(NO_DOUBT)
