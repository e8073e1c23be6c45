"""The runs of one scene, in motion or at rest: results, in files that can be resumed, and runs to compare with."""

from __future__ import annotations

import math
import os
import threading
import time as clock
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from hybrid.errors import ComputationError, ResultError
from hybrid.kernels.state.report import SEABED
from hybrid.kernels.state.state import Floats, State
from hybrid.model.build import Model
from hybrid.model.network import NetworkResolution, build_network
from hybrid.model.payout import longest_out, winch_side
from hybrid.model.plan import with_models
from hybrid.model.resolution import (
    Reach,
    Resolution,
    follows_curvature,
    has_limits,
    judges_bends,
    requested_accuracy,
    wants_errors,
    wants_survey,
)
from hybrid.model.sections import OutputPoints, output_points
from hybrid.outputs.probes import EDGE_ERRORS, MISSED, edge_errors, layer_errors
from hybrid.scene.network import Network
from hybrid.scene.read import scene_text
from hybrid.scene.root import Scene
from hybrid.scene.schema import LineScene
from hybrid.simulation.mesh_survey import Survey, rods_at_rest, survey_duration, survey_points
from hybrid.simulation.own_parts import RunPart
from hybrid.simulation.progress import ESTIMATION, PRE_RUN, REFINEMENT, RESULT, ProgressReporter, at_once
from hybrid.simulation.restart import LoadChange, changes_text, is_cut_off, kept_resolution, with_own_contact
from hybrid.simulation.run import Run, new_run, start_of
from hybrid.simulation.run_line import FORCE_COLUMNS, RunLine
from hybrid.simulation.run_of_lines import AnyRecorder, Heard
from hybrid.simulation.run_record import Asked, Recording
from hybrid.simulation.run_sample import (
    ALL,
    COMPARED,
    Notes,
    RunSample,
    Samples,
    catenary_share,
    compared_cells,
    compared_places,
    damped_vibrations,
    is_along,
    most_at_places,
    rods_of,
    rows_key,
    usual_cells,
)
from hybrid.simulation.zones_at_rest import Start
from hybrid.store.envelope import GROUP as ENVELOPE
from hybrid.store.format import MemoryTarget, Target
from hybrid.store.hdf5_file import group_of, open_file, root_of
from hybrid.store.integrity import Tree
from hybrid.store.limits import EXTREMES, extremes_about
from hybrid.store.reader import Result, open_result, written_result
from hybrid.store.records import ERROR_ESTIMATE, THERE
from hybrid.store.stored_rows import ComparisonRecorder, RowsRecorder, StoredArray, rows_path
from hybrid.store.whole_file import LateFile
from hybrid.store.writer import Recorder, WriteMode
from hybrid.zones.manager import UserCriterion, with_names

# Of every step, what extremes of the end forces follow from.
FORCES = ("t", "end_force_start", "end_force_end")

# Steps of a result from which on runs to compare with are computed in threads: before, all takes about 0.1 s.
WORTH_THREADS = 500
# Numbers that the outputs of a run to compare with may take in memory and in checkpoints, 8 MB; more go into a file.
MOST_IN_MEMORY = 1_000_000


class Case:
    """One scene in motion, of any number of lines, computed as often and as finely as it takes.

    What it gives of a run is by the names that lines have in its network.
    """

    moves = True
    beside_result: Path | None = None  # the file of the result, beside which finer ones and outputs to compare with are
    late_file: LateFile | None = None  # of a result that is complete, and may not be in its place yet
    late_finer: LateFile | None = None  # of a finer one, which may take its place
    _results = 0  # that were begun
    parts: Sequence[RunPart] = ()  # of the user's own, which all runs have
    unasked: Sequence[str] = ()  # lines that nobody asked to go on without contact with themselves: the file says none
    _told: tuple[object, str] | None = None  # a scene, and what it is as a text
    _start: tuple[Network, NetworkResolution, Start] | None = None  # that was looked at last
    # Whether contact of lines with themselves that nobody asks for is computed in runs to compare with: where one has
    # touched itself in a result.  Before, coarse cells would meet where those of the result do not.
    touches_itself = False

    def __init__(
        self,
        scene: Scene,
        criterion: UserCriterion | None,
        changes: Sequence[LoadChange[Any]] = (),
        points: Mapping[str, OutputPoints] | None = None,
    ) -> None:
        """changes: scenes that hold from some time on; what they may differ in, `remaining_run` has checked.

        points: of the result that is continued, by the names that lines have in the scene; None: those of the scene.
        """
        self.scene: Any = scene  # what is computed, as the user wrote it
        self.criterion = with_names(criterion, self.names)
        self.changes: tuple[LoadChange[Any], ...] = tuple(changes)
        lines, kept = self.lines, points or {}
        self.points = {name: kept.get(self.names[name]) or self._points_of(x) for name, x in lines.items()}
        # Of these, where runs are compared: a bend may be sharp between a hundred places.
        self.places = {
            name: ALL if judges_bends(x) else compared_places(self.points[name]) for name, x in lines.items()
        }
        self.progress = ProgressReporter(None, 1.0)
        self.interrupted: Callable[[], bool] = lambda: False
        self._owner = threading.get_ident()  # the thread that puts files in their places
        self.near_themselves = set[str]()  # lines that came near themselves in a run to compare with
        self.reach = dict[str, Reach]()  # how far lines move, by a pre-run
        self.notes: list[tuple[str, str]] = []  # events (kind, text) of the whole of every result
        self._unwanted = threading.Event()  # what runs to compare with still compute

    # --- the scene ------------------------------------------------------------------------------

    @property
    def names(self) -> Mapping[str, str]:
        """Names of the lines of the network, each with that of the line in the scene."""
        return self.scene.form.names

    def _points_of(self, scene: LineScene) -> OutputPoints:
        """Where outputs of a line are."""
        if not self.moves:
            return output_points(scene)
        return output_points(scene, longest_out(scene), not winch_side(scene))

    @property
    def lines(self) -> dict[str, LineScene]:
        """The lines by name, as scenes of their own."""
        return {name: self.scene.asked_scene(name) for name in self.scene.lines}

    def with_models(self, kinds: Mapping[str, str]) -> Any:
        """The scene with models of these kinds for lines by name."""
        return with_models(self.scene, kinds)

    @contextmanager
    def instead(self, scene: Any) -> Iterator[None]:
        """Runs within are of another scene, with the same lines."""
        asked, self.scene = self.scene, scene
        try:
            yield
        finally:
            self.scene = asked

    @property
    def wants_errors(self) -> bool:
        """Whether errors of a line are estimated."""
        return any(wants_errors(x) for x in self.lines.values())

    @property
    def from_rest(self) -> bool:
        """Whether it begins from an equilibrium, or is one."""
        return not (self.moves and (self.scene.starts_as_placed or self.scene.may_break))

    @property
    def _duration(self) -> float:
        """When the run ends, s."""
        return float(self.scene.require_time().duration)

    @property
    def _texts(self) -> tuple[str, str]:
        """What the file says of the scene, and of what changes."""
        if self._told is None or self._told[0] is not self.scene:
            self._told = self.scene, scene_text(with_own_contact(self.scene, self.unasked, None))
        return self._told[1], changes_text(self.changes)

    # --- results --------------------------------------------------------------------------------

    def record(self, resolution: NetworkResolution, target: Target, before: Tree | None = None) -> Samples:
        """Compute the result into a file, or memory; what is to be compared of it.  before: what was found before.

        A file that errors will be added to, and that is complete before it had to be there, waits in `late_file`.
        """
        first = self._is_in_place(target)
        begin = self._begin_result(resolution.one, first)
        kept = before or {} if isinstance(target, Path) else None
        mode = WriteMode(kept, late=not (first and self.progress.heard), unseen=not first)
        recording = Recording(mode, pending=ERROR_ESTIMATE if before else "", notes=self.notes)
        return self._move(self._network_run(resolution, target, recording), begin, first)

    def _place_late_file(self, recorder: AnyRecorder, first: bool) -> LateFile | None:
        """The file of a complete result that has still to be put in its place; first: as of `_begin_result`."""
        waits = recorder.late_file if isinstance(recorder, Recorder) else None
        if first:
            self.late_file = waits
        else:
            self.late_finer = waits
        return waits

    def _is_in_place(self, target: Target) -> bool:
        """Whether a result is where it belongs, and not beside one that it may replace."""
        return self.beside_result is None or target == self.beside_result

    def decide(self, kept: bool) -> bool:
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

    def resume(self, source: Path, target: Path, before: Tree | None = None) -> Samples:
        """The same from the checkpoint of a result, which may be the target; ResultError if it has none."""
        resolution = kept_resolution(self.scene, source)
        first = self._is_in_place(target)
        begin = self._begin_result(resolution.one, first)
        recording = Recording(WriteMode(before or {}), source, ERROR_ESTIMATE if before else "")
        run = self._network_run(resolution, target, recording)
        return self._move(run, begin - run.cpu, first)

    def is_unfinished(self, source: Path, resolution: NetworkResolution) -> bool:
        """Whether a file holds a run of this case, with this resolution, that was cut off."""
        if not is_cut_off(source, self._texts, resolution):
            return False
        with open_result(source) as result:
            lines = self._by_line(result)
            return all(np.array_equal(lines[name]["s"], x.s) for name, x in self.points.items())

    def _by_line(self, result: Result) -> dict[str, Result]:
        """Results of the lines by name."""
        found = dict(result.each_line())
        return {name: found[called] for name, called in self.names.items()}

    def _begin_result(self, resolution: Resolution, first: bool) -> float:
        """The pass of a result begins; s of processor time.  first: it takes the place of one that may be there."""
        if first and self.late_file is not None:
            self.late_file.place()
            self.late_file = None
        self.progress.begin(REFINEMENT if self._results else RESULT, resolution)
        self._results += 1
        return clock.process_time()

    def _move(self, run: Run, begin: float, first: bool) -> Samples:
        """A result to its end; begin: s of processor time, when it was begun; first: as of `_begin_result`."""
        recorder, target = run.recorder, run.target
        assert target is not None and isinstance(recorder, Recorder)
        recorder.amended = self.wants_errors
        with recorder, self._in_words():
            self._compute(run)
        return self._compared(run, target, clock.process_time() - begin, self._place_late_file(recorder, first))

    def _compute(self, run: Run) -> None:
        """Compute a run to its end."""
        run.record_motion()

    def _compared(self, run: Run, target: Target, cpu: float, late: LateFile | None) -> Samples:
        """What is to be compared of a complete result; late: it has no file yet."""
        if not self.wants_errors:
            found = {x.name: (run.resolution.lines[x.name], compared_cells(x.model)) for x in run.lines}
            return {name: RunSample(finely, {}, cells, run.steps, 0.0) for name, (finely, cells) in found.items()}
        assert not isinstance(target, MemoryTarget), "errors are written into a file"
        whole = Result(late.path, contents=late.contents) if late is not None else None
        stay, samples = target if late is None and isinstance(target, Path) else None, Samples()
        with ExitStack() as stack:
            file = stack.enter_context(open_file(target, summed=False)) if late is None else None
            result = stack.enter_context(written_result(target) if whole is None else nullcontext(whole))
            lines = self._by_line(result)
            for line in run.lines:
                data_of = partial(root_of, file) if late is None else late.data_of
                samples[line.name] = self._sample_of(line, run, data_of, lines[line.name], cpu, stay)
        asked = {name for name, x in self.scene.lines.items() if x.contact.self}
        self.touches_itself |= any(x.touches for name, x in samples.items() if name not in asked)
        return samples

    def _sample_of(
        self, line: RunLine, run: Run, data_of: Callable[[str], Any], result: Result, cpu: float, stay: Path | None
    ) -> RunSample:
        """What is compared of a line in a complete result.

        data_of: arrays of a line by its name in the scene, and of the whole by none; result: that of the line; stay: a
        file in which many outputs may stay, None: there is none.
        """
        name, model, scene, called = line.name, line.model, self.lines[line.name], self.names[line.name]
        data, own, resolution = data_of(""), data_of(called), run.resolution.lines[name]
        stored = {x: own[x] for x in COMPARED if x in own}
        # they stay in the file, if they are many, and no finer result may replace it
        finer = any(requested_accuracy(x) is not None for x in self.lines.values())
        stays = stay if not finer and sum(x.size for x in stored.values()) > MOST_IN_MEMORY else None
        found = {
            x: StoredArray(stays, group_of(called) + x, self._places_of(x, name))
            if stays is not None
            else self._at_places(x, y, name)
            for x, y in stored.items()
        }
        places, kinds = self.places[name], own["events/kind"][()]
        missed = {x: most_at_places(own[EDGE_ERRORS + x], places) for x in MISSED if EDGE_ERRORS + x in own}
        cells = compared_cells(model)
        if follows_curvature(scene):
            cells = compared_cells(model, resolution.fineness, usual_cells(own[THERE][()]))
        held: dict[str, Any] = {}
        if self._judges(name):
            held = {x: own[x][()] for x in _datasets(own, ENVELOPE, EXTREMES)}
            asked = (x for x, q in self.scene.written.output.quantities.items() if q.line == name)
            held |= {full: data[full][()] for x in asked if (full := f"{EXTREMES}/{x}") in data}
        moves, notes, forces = line.manager is not None, Notes(), np.zeros((0, 3))
        if self.moves:
            forces = np.column_stack([own[f"steps/{x}"][()] for x in FORCES])
        if resolution.local is not None:
            notes = damped_vibrations(result)
        sharp, touches = b"unresolved bend" in kinds, b"line touches itself" in kinds
        more: dict[str, Any] = {"notes": notes, "forces": forces, "touches": touches, "places": places}
        more |= {"catenary": np.array([catenary_share(x) for x in result.zones]) if moves else np.zeros(0)}
        more |= {"at_edges": missed, "extremes": extremes_about(held, self.points[name].s)}
        steps, rods = max(run.steps, 1), rods_of(result.zones)
        return RunSample(resolution, found, cells, steps, cpu, 1, sharp, rods=rods, **more)

    def _judges(self, name: str) -> bool:
        """Whether limits are held against extremes of a line, or ranges of it are asked for by name."""
        asked = any(x.line == name for x in self.scene.written.output.quantities.values())
        return self.moves and self.wants_errors and (asked or has_limits(self.lines[name]))

    def _places_of(self, name: str, line: str) -> np.ndarray | None:
        """Of an output the numbers of the points where runs are compared; None: all."""
        places = self.places[line]
        return places if places.size and is_along(name) else None

    def _at_places(self, name: str, values: Any, line: str) -> np.ndarray:
        """The values (nt, ...) of a dataset where runs are compared."""
        places, found = self._places_of(name, line), np.asarray(values[()])
        return found if places is None else found[:, places]

    # --- runs to compare with -------------------------------------------------------------------

    def beside(
        self, samples: Sequence[Callable[[], Samples]]
    ) -> AbstractContextManager[Sequence[Callable[[], Samples]]]:
        """Runs to compare with, in threads where that is worth it (`beside`).

        A criterion or a part of the user may not expect to be called by several threads.
        """
        steps = self._duration / NetworkResolution.of(self.lines).one.step
        own = self.criterion is not None or bool(self.parts)
        threads = thread_count() if not own and steps >= WORTH_THREADS else 1
        self._unwanted.clear()
        return beside(samples, threads, self.progress.end_pass, self._unwanted.set)

    def sample(
        self, resolution: NetworkResolution, points: Mapping[str, Floats] | None = None, until: float | None = None
    ) -> Samples:
        """Compute for comparison only; points: places, m, instead of those of the result; until: s, None: to the end.

        A resolution with longer steps has as many times fewer outputs, to save time, and so that outputs do not shorten
        its steps where these end at outputs.
        """
        begin = clock.thread_time()
        if self.moves:
            self.progress.begin(ESTIMATION if points is None else PRE_RUN, resolution.one)
        s = points or {
            name: x.s[self.places[name]] if self.places[name].size else x.s for name, x in self.points.items()
        }
        looked = {name: x._replace(s=s[name]) if name in s else x for name, x in self.points.items()}
        recording = Recording(points=looked, until=until, touches=self.touches_itself)
        run = self._network_run(resolution, None, recording)
        if points is None and self.moves and self.beside_result is not None:
            for line in run.lines:
                numbers = (len(run.times) + 1) * sum(math.prod(field.shape) for field in line.observer.fields)
                if numbers > MOST_IN_MEMORY:
                    key = rows_key(resolution.lines[line.name], self.names[line.name])
                    line.recorder = RowsRecorder(rows_path(self.beside_result, key), FORCE_COLUMNS)
        try:
            with self._in_words():
                self._compute(run)
        finally:
            for line in run.lines:
                line.recorder.close("", "")
        for line in run.lines:
            if line.contact is not None or line.has_neared_itself:
                self.near_themselves.add(line.name)
        cpu = clock.thread_time() - begin
        return {x.name: self._compared_line(x, run, cpu, judged=points is None) for x in run.lines}

    def _compared_line(self, line: RunLine, run: Run, cpu: float, judged: bool) -> RunSample:
        """What is compared of a line in a run for comparison; judged: extremes, too."""
        name, resolution, found = line.name, run.resolution.lines[line.name], line.recorder
        assert isinstance(found, ComparisonRecorder)
        values = {x: found[x] for x in found.names}
        moves, follows = line.manager is not None, follows_curvature(self.lines[name])
        rows = found.reference() if isinstance(found, RowsRecorder) else {}
        held: dict[str, Any] = {}
        if judged and self._judges(name):
            held = {x.name: y for x, y in line.envelope.fixed()}
            held |= line.envelope.values(line.model.nodes, line.books.extremes, run.t)
            held |= run.file.quantities.ranges_of(name)
        cells = compared_cells(line.model, resolution.fineness if follows else 0.0)
        more: dict[str, Any] = {"rows": rows, "forces": found.steps, "rods": tuple(sorted(found.rods))}
        more |= {"touches": line.lets_touch or bool(self.scene.lines[name].contact.self), "places": self.places[name]}
        more |= {"catenary": found.catenary if moves else np.zeros(0)}
        extremes = extremes_about(held, self.points[name].s)
        return RunSample(resolution, values, cells, run.steps, cpu, resolution.every, extremes=extremes, **more)

    # --- how finely -----------------------------------------------------------------------------

    def survey(self, resolution: NetworkResolution, coarse: NetworkResolution) -> dict[str, Survey] | None:
        """A coarse run that shows where cells of lines should be short that leave them open; None: it failed.

        resolution: of the result.  ComputationError: it failed in steps as short as those of the result too, and a
        line gives cells to a layer.
        """
        free = {name: scene for name, scene in self.lines.items() if wants_survey(scene)}
        until = max(survey_duration(x) for x in free.values()) if self.moves and not self.changes else None
        try:
            models, points, found = self._surveyed(coarse, until)
        except ComputationError:
            if all(x.resolution is None for x in free.values()):
                return None
            if not self.moves:
                raise
            coarse = coarse.coarser(steps=resolution.one.step / coarse.one.step)  # as short as those of the result
            models, points, found = self._surveyed(coarse, until)
        surveys = {
            name: Survey.of(scene, resolution.lines[name], models[name], points[name], found[name].values)
            for name, scene in free.items()
        }
        self.reach = {name: x.reach for name, x in surveys.items()}
        return surveys

    def _surveyed(
        self, coarse: NetworkResolution, until: float | None
    ) -> tuple[dict[str, Model], dict[str, Floats], Samples]:
        """Models of a pre-run, where they are looked at, m, and what is seen there."""
        models = {name: model for name, (model, _) in self.first_shapes(coarse).items()}
        points = {name: survey_points(x, coarse.lines[name]) for name, x in models.items()}
        return models, points, self.sample(coarse, points, until)

    # --- runs of the network ----------------------------------------------------------------------

    def _in_words(self) -> AbstractContextManager[None]:
        """What fails within, in the words of the scene."""
        return self.scene.form.in_words()

    def _network_run(self, resolution: NetworkResolution, target: Target | None, recording: Recording) -> Run:
        """The run of the network, as yet without a first output; recording: beside what the case says."""
        recording = recording._replace(planes=True, asked=Asked(self.scene, self.changes), parts=self.parts)
        interrupted = self._comparison_interrupted if target is None else self._result_interrupted
        recording = recording._replace(heard=Heard(self.progress, interrupted))
        if recording.points is None:
            recording = recording._replace(points=self.points)
        with self._in_words():
            if recording.source is None:
                recording = recording._replace(start=self._first_state(resolution))
            texts, end = self._texts, (self.criterion, self.changes)
            return new_run(self.scene, target, texts[0], self.moves, resolution, recording, *end)

    def _first_state(self, resolution: NetworkResolution) -> Start:
        """The first state, which may have been kept for a run of this resolution."""
        (kept, self._start), network = (self._start, None), self.scene
        if kept is not None and kept[0] is network:
            lines = kept[1].lines
            if lines.keys() == resolution.lines.keys() and all(lines[x] is y for x, y in resolution.lines.items()):
                return kept[2]
        with at_once(self.interrupted):
            return start_of(network, build_network(network, resolution), self.moves, self.criterion)

    def first_shapes(self, resolution: NetworkResolution) -> dict[str, tuple[Model, State]]:
        """Models and first states of a run, by line; they are kept for that of this resolution, if it comes next."""
        network = self.scene
        if network.adaptive:  # as rods, before zones are found
            return rods_at_rest(network, resolution, self.moves)
        with self._in_words():
            start = self._first_state(resolution)
        self._start = network, resolution, start
        states = [x.start for x in start.model.models] if start.found is None else start.found.state.lines
        return dict(zip(start.model.names, zip(start.model.models, states, strict=True), strict=True))

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


class CaseAtRest(Case):
    """The equilibrium of one scene at t = 0, under loads that have grown to their full size."""

    moves = False

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene, None)
        self.places = dict.fromkeys(self.lines, ALL)  # there is one output

    def record(self, resolution: NetworkResolution, target: Target, before: Tree | None = None) -> Samples:
        """Compute the result into a file, or memory; what is to be compared of it.  before: nobody goes on with it."""
        begin, pending = clock.process_time(), ERROR_ESTIMATE if self.wants_errors else ""
        recording = Recording(WriteMode(late=True), pending=pending)
        return self._move(self._network_run(resolution, target, recording), begin, self._is_in_place(target))

    def beside(
        self, samples: Sequence[Callable[[], Samples]]
    ) -> AbstractContextManager[Sequence[Callable[[], Samples]]]:
        """Equilibria are found one after the other."""
        return nullcontext(samples)

    def _compute(self, run: Run) -> None:
        run.record_equilibrium()

    def _compared(self, run: Run, target: Target, cpu: float, late: LateFile | None) -> Samples:
        if not self.wants_errors:
            return super()._compared(run, target, cpu, late)
        return {line.name: _sample(line, run, cpu) for line in run.lines}

    def _compared_line(self, line: RunLine, run: Run, cpu: float, judged: bool) -> RunSample:
        return _sample(line, run, cpu)


def _sample(line: RunLine, run: Run, cpu: float) -> RunSample:
    """What is compared of a line in an equilibrium that has been recorded; cpu: s, that it took."""
    k, model = line.number, line.model
    batch = line.state_now(0.0, run.solver.lines[k].ends, run.state.lines[k], run.solver.work[k])
    seen = line.observer.observation(batch)
    values = line.observer.values_of(seen)
    missed = edge_errors(seen) if model.line.bits & SEABED else {}
    at_edges = {name: error[:, 0] for name, error in missed.items()}
    for name, error in layer_errors(seen, [int(np.argmin(np.abs(model.line.s - at))) for at in model.attached]).items():
        at_edges[name] = np.maximum(error, at_edges.get(name, 0.0))
    found = {name: np.array(values[name]) for name in COMPARED if name in values}
    catenary = np.array([catenary_share(model.zones)]) if model.layout is not None else np.zeros(0)
    more: dict[str, Any] = {"catenary": catenary, "rods": rods_of([model.zones])}
    more |= {"at_edges": {name: error[None] for name, error in at_edges.items()}}
    return RunSample(run.resolution.lines[line.name], found, compared_cells(model), 1, cpu, **more)


# Runs in threads beside each other: kernels release the GIL, and runs share nothing that they write.
#
# The first run is computed in the thread that asks, where listeners are called and signals are heard.

THREADS = "HYBRID_THREADS"  # environment variable
# s between two looks at what goes on while other threads are waited for.
LOOK_EVERY = 0.1

Found = TypeVar("Found")


def thread_count() -> int:
    """Threads that a run may use: what HYBRID_THREADS says, else one for each core that this process may use.

    ResultError: the variable is no number from 1 on.
    """
    asked = os.environ.get(THREADS, "").strip()
    if not asked:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if not (asked.isdecimal() and int(asked) > 0):
        advice = f"{THREADS}=1 for one thread; without it there are as many as cores"
        raise ResultError(
            f"the environment variable {THREADS} is no number of threads\n    given:    '{asked}'\n"
            f"    expected: a whole number from 1 on\n    try:      {advice}"
        )
    return int(asked)


@contextmanager
def beside(
    tasks: Sequence[Callable[[], Found]], threads: int, look: Callable[[], None], stop: Callable[[], None]
) -> Iterator[list[Callable[[], Found]]]:
    """Functions that give what the tasks give, or raise what they raise; each is called once, in their order.

    threads: this one included; with one, a task begins when its function is called.  look: called every `LOOK_EVERY` s
    while another thread is waited for; stop: makes tasks end soon whose answers are no longer wanted.
    """
    if threads < 2 or len(tasks) < 2:
        yield list(tasks)
        return
    pool = ThreadPoolExecutor(min(threads, len(tasks)) - 1, "hybrid-run")
    try:
        futures = [pool.submit(task) for task in tasks[1:]]
        yield [tasks[0], *(partial(_by_path, *each, look) for each in zip(tasks[1:], futures, strict=True))]
    finally:
        if any(not future.done() for future in futures):
            stop()
        pool.shutdown(wait=True, cancel_futures=True)  # so that none writes a file after it was removed


def _by_path(task: Callable[[], Found], future: Future[Found], look: Callable[[], None]) -> Found:
    if future.cancel():  # no thread has begun with it
        return task()
    while wait([future], LOOK_EVERY).not_done:
        look()
    look()  # at its end
    return future.result()
