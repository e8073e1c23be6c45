"""What is recorded of a run of lines, and the file that it goes to.

Outputs, steps, events and checkpoints go, as the run goes on, to a result of each line within that of the points, or to
that of a line alone.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from time import monotonic
from time import process_time as clock_now
from types import MappingProxyType
from typing import Any, NamedTuple, Protocol

import numpy as np

from hybrid.errors import ComputationError
from hybrid.kernels.machine.cache import cache_folder
from hybrid.kernels.state import books as b
from hybrid.kernels.state.report import SELF_CONTACT
from hybrid.kernels.state.state import Floats
from hybrid.model.network import NetworkModel, NetworkResolution
from hybrid.scene.network import Network
from hybrid.scene.points import Fairlead
from hybrid.scene.read import scene_text
from hybrid.scene.root import ShortForm
from hybrid.scene.schema import LineScene
from hybrid.simulation.events import Sink
from hybrid.simulation.line_result import LineResult
from hybrid.simulation.parts import Part, Parts
from hybrid.simulation.restart import LoadChange, changes_text
from hybrid.simulation.result_file import mesh_fields, note_neglected_bending, places_of_elevation, result_header
from hybrid.simulation.run_checkpoint import files_of
from hybrid.simulation.run_of_lines import RunOfLines
from hybrid.simulation.run_points import Sampled, fields_of, gauges_of, values_of
from hybrid.simulation.run_quantities import Rotations, RunQuantities, fields_of_pairs, values_of_pairs
from hybrid.solve.lines_at_rest import LinesAtRest
from hybrid.solve.network_steps import NetworkSteps
from hybrid.solve.stepper import LineFailed, NetworkState
from hybrid.store.checkpoint import Checkpoint
from hybrid.store.format import Field, Header, Target, Text, made
from hybrid.store.recorder import Rows
from hybrid.store.records import PENDING, RODS_AT_START
from hybrid.store.stored_rows import ComparisonRecorder
from hybrid.store.writer import Recorder, WriteMode
from hybrid.zones.at_start import reasons_at_start
from hybrid.zones.manager import DomainManager

AnyRecorder = Recorder | ComparisonRecorder


class Asked(NamedTuple):
    """The scene that a network was made of, and what changes in it later."""

    scene: Any
    changes: Sequence[LoadChange[Any]] = ()


class Filing(Protocol):
    """What of its arguments a run keeps its file by."""

    @property
    def mode(self) -> WriteMode: ...
    @property
    def pending(self) -> str: ...
    @property
    def asked(self) -> Asked | None: ...
    @property
    def source(self) -> Any: ...


class FiledRun(RunOfLines, Protocol):
    """A run, as its file sees it."""

    target: Target | None
    times: Sequence[float]
    changes: Sequence[LoadChange[Any]]
    recorder: AnyRecorder

    @property
    def files(self) -> Mapping[str, str]: ...


class RunFile:
    """The result of a run: of its points, bodies and pairs, with a group for each line.

    That of a line without a name is the result of the line alone, in the words of its scene.
    """

    def __init__(
        self, run: FiledRun, system: Network, scenes: Mapping[str, LineScene], text: Text, asks: Filing
    ) -> None:
        """system: with the loads of its start; scenes: of its lines by name; text: the scene, as the file has it."""
        scene = asks.asked.scene if asks.asked is not None else None
        self._run, self._text, self._asks = run, text, asks
        self._form = ShortForm((), {}) if scene is None else scene.form
        # The scene of the only line, if it has no name.
        self._alone: LineScene | None = scene.asked_lines.get("") if scene is not None else None
        # What is recorded beside the lines, by name.
        self.quantities = RunQuantities(system, scenes if self._alone is None else {})
        self.rotations = Rotations(system, run.model)

    @property
    def _length(self) -> float:
        """Of the only line, m; 0: lines have no arc lengths in common."""
        return self._run.lines[0].model.length if self._alone is not None else 0.0

    @property
    def span(self) -> tuple[float, float]:
        """Arc lengths (m) of events of the whole run."""
        return 0.0, self._length

    def place(self, point: str) -> tuple[float, float]:
        """The same of an event at a point."""
        s = self._length if point == "end" else 0.0
        return s, s

    # --- how lines are recorded -----------------------------------------------------------------

    def scene_of(self, scene: LineScene) -> LineScene:
        """The scene by which a line is recorded."""
        return scene if self._alone is None else self._alone

    def line_rows(
        self, line: LineResult, found: LinesAtRest | None, outputs: int, manager: DomainManager | None
    ) -> Rows:
        """The result of a line: a part of that of the run, or that itself; manager: of zones that move."""
        texts = {"scene": partial(scene_text, line.scene)} if self._alone is None else self._texts
        notes = {PENDING: self._asks.pending, RODS_AT_START: reasons_at_start(manager)}
        parts = line.scene, line.model, line.observer
        header = result_header(*parts, texts, found, line.envelope, outputs, notes)
        rows = Rows(header) if self._alone is None else self._recorder(header)
        if line.model.layout is not None:
            note_neglected_bending(line.scene, line.model, rows)
        return rows

    # --- the file -------------------------------------------------------------------------------

    @property
    def _texts(self) -> dict[str, Text]:
        changes = self._run.changes if self._asks.asked is None else self._asks.asked.changes
        return {"scene": self._text, "changes": changes_text(changes)}

    def _recorder(self, header: Header, parts: Mapping[str, Rows] = MappingProxyType({})) -> Recorder:
        """What writes the result of the run; nobody goes on with one in memory."""
        run, mode = self._run, self._asks.mode
        assert run.target is not None
        if self._asks.source is not None:
            mode = mode._replace(late=True)  # until its rows are copied
        recorder = Recorder(
            run.target, header, outputs=len(run.times) + 1, overwrite=True, mode=mode,
            templates=cache_folder().parent, parts=parts,
        )  # fmt: skip
        recorder.files = run.files
        return recorder

    def begin(self) -> AnyRecorder:
        """A new result of the points and bodies, with those of the lines in it."""
        run, pending = self._run, self._asks.pending
        rows = {line.name: line.recorder for line in run.lines}
        if self._alone is not None:
            (recorder,) = rows.values()
            assert isinstance(recorder, AnyRecorder)
            return recorder
        if run.target is None:
            return ComparisonRecorder()
        system, models = run.network, run.model.models
        attributes: dict[str, str | float | int] = {
            "title": system.title, "cells": run.model.cells, "lines": len(models),
            "length": sum(x.length for x in models),
        }  # fmt: skip
        if run.found is not None:
            attributes |= {"static_path": run.found.summary, "static_residual": run.found.residual}
        on_bodies = {x: point.body for x, point in system.points.items() if isinstance(point, Fairlead)}
        if pending:
            attributes[PENDING] = pending
        if on_bodies:
            attributes["fairleads"] = json.dumps(on_bodies)
        fields = [*fields_of(run.network), *fields_of_pairs(run.model), *self.quantities.fields]
        fixed = [*self.quantities.limits, *self.quantities.ranges, *places_of_elevation(gauges_of(system))]
        header = Header(np.zeros(1), fields, (), attributes, self._texts, fixed)
        return self._recorder(header, {name: x for name, x in rows.items() if isinstance(x, Rows)})

    def resume(self, source: Any, point: Checkpoint) -> Recorder:
        """The result from a checkpoint of an open file on."""
        recorder, fixed = self.begin(), list[tuple[Field, np.ndarray]]()
        assert isinstance(recorder, Recorder)
        if self._alone is not None:  # whose file may be of a program that did not write them
            (line,) = self._run.lines
            fixed = [*line.envelope.fixed(), *mesh_fields(line.model)]
        recorder.resume(source, point, fixed, self._asks.pending)
        return recorder

    def save(self, seen: Sampled) -> None:
        """Record outputs of points, bodies and pairs, and quantities by name; a line records its own."""
        run = self._run
        if run.target is None or self._alone is not None:
            return
        values = values_of(run.network, run.model, seen)
        self.rotations.unwind(values)
        values |= values_of_pairs(run.model, run.solver.shared, seen.lines)
        by_name = {line.name: x for line, x in zip(run.lines, seen.lines, strict=True)}
        values |= self.quantities.values(by_name, {line.name: line for line in run.lines})
        run.recorder.save_batch(seen.t, values, [("lines", 0.0, 0.0)])

    # --- events and errors ----------------------------------------------------------------------

    @property
    def noted(self) -> Sink:
        """What notes events of the whole run."""
        return self._run.recorder if self._alone is None else self._run.lines[0].events

    def gather(self) -> None:
        """Record the events of the lines, in the result of the run with their names too, as they happened."""
        recorder, lines = self._run.recorder, self._run.lines
        named = lines if self._alone is None else []
        found = [(x, f"line {line.name}: {x[-1]}") for line in named for x in line.events.waiting()]
        for line in lines:
            line.events.write_to(line.recorder, self._form.text)
        for (t, s_a, s_b, kind, _), text in sorted(found, key=lambda event: event[0][0]):
            recorder.event(t, s_a, s_b, kind, text)

    def in_words(self, error: ComputationError) -> ComputationError:
        """An error in the words of the scene."""
        return self._form.error(error)

    def snapshot(self, state: NetworkState) -> dict[str, Any]:
        """What a snapshot has of a state, and the scene."""
        lines = zip(self._run.lines, state.lines, strict=True)
        arrays = {line.name: {"s": line.model.line.s, **x._asdict()} for line, x in lines}
        if self._alone is not None:
            return {"scene": made(self._text), **next(iter(arrays.values()))}
        found: dict[str, Any] = {"scene": scene_text(self._run.network), "bodies": state.bodies}
        return found | {f"{line}/{name}": x for line, of_line in arrays.items() for name, x in of_line.items()}

    def close(self, status: str, message: str) -> None:
        """Close all; status, message: of the run."""
        run = self._run
        self.gather()
        run.recorder.replace(self.quantities.range_values())
        run.recorder.close(status, message)


# Steps times cells from one checkpoint to the next, about 5 s of computing.
WORK = 10_000_000
READ_EVERY = 0.01  # s of the wall, after which the time of the processor is read again


class RecordedRun:
    """A run as its file grows: where it is, its lines, and what is written of them."""

    network: Network
    model: NetworkModel
    resolution: NetworkResolution
    loop: NetworkSteps
    target: Target | None  # None: it is only to be compared with
    kept: bool  # whether it writes checkpoints
    file: RunFile
    lines: list[LineResult]
    recorder: AnyRecorder
    parts: Parts
    changes: Sequence[LoadChange[Network]] = ()  # of loads
    cpu = 0.0  # s, of the processor, in earlier parts of the run
    read_every = READ_EVERY
    _begin: float  # s, of the processor, when the run began, were it all made now
    _logged = 0.0  # s, likewise, when steps were logged last
    _read = -np.inf, 0.0  # s of the wall, when the time of the processor was read last, and that
    _checked = -1  # steps at the last checkpoint
    _between = False  # whether the state is that between two steps

    def content(self) -> Mapping[str, Any]:
        """What a checkpoint keeps."""
        raise NotImplementedError

    @property
    def t(self) -> float:
        """Time of the state, s."""
        return float(self.loop.clock.now)

    @property
    def steps(self) -> int:
        """Steps so far."""
        return int(self.loop.counts.steps)

    @property
    def last_step(self) -> float:
        """Length, s, of the step that led to the state; 0: it is a start."""
        return float(self.loop.clock.last_dt)

    @property
    def last_rho(self) -> float:
        """Its spectral radius."""
        return float(self.loop.clock.last_rho)

    @property
    def interval(self) -> float:
        """What the step took (s) that led to the state, of which outputs within the next are made, too; 0: unknown."""
        return float(self.loop.clock.now - self.loop.clock.previous)

    def stand_at(self, t: float, steps: int, last_step: float, last_rho: float, interval: float) -> None:
        """Be between two steps, at t (s)."""
        clock = self.loop.clock
        clock.now, clock.last_dt, clock.last_rho, self.loop.counts.steps = t, last_step, last_rho, steps
        for line in self.lines:
            line.books.counts.repeats = 0  # of a step that was tried when it was taken back
        self.loop.stand_between(interval, self.resolution.one.step)
        self._logged = self._spent()

    @property
    def turned(self) -> bool:
        """Whether moments are given at points."""
        return any(getattr(point, "moment", None) is not None for point in self.network.points.values())

    @property
    def files(self) -> dict[str, str]:
        """Digests of the files of motions and loads, by path, of all that holds at some time."""
        found = files_of(self.network)
        for x in self.changes:
            found |= files_of(x.scene)
        return found

    @property
    def span(self) -> tuple[float, float]:
        """Arc lengths (m) of its events."""
        return self.file.span

    @property
    def noted(self) -> Sink:
        """What notes events of the whole run."""
        return self.file.noted

    def note(self, kind: str, text: str, **more: float) -> None:
        """Note an event of the whole run, now."""
        self.noted.event(self.t, *self.span, kind, text, **more)

    @property
    def is_due(self) -> bool:
        """Whether the file is to be brought up to date, by the clock."""
        return not isinstance(self.recorder, ComparisonRecorder) and self.recorder.due

    def keep(self, last: bool = False) -> None:
        """Keep a checkpoint where one is due, by the work done, and bring the file up to date; last: it is the end."""
        if isinstance(self.recorder, ComparisonRecorder):
            return
        new = self.kept and self._between and self.steps != self._checked
        new = new and (self._checked < 0 or last or (self.steps - self._checked) * self.model.cells >= WORK)
        if not (new or self.recorder.due):
            return
        begin = monotonic()
        self.record_samples()
        self.write_log()
        self.ends_of_now()
        for line in self.lines:
            line.write_down()
            line.write_envelope(self.t)
        self.recorder.replace(self.file.quantities.range_values())
        self.gather_events()
        made = monotonic() - begin
        if new:
            begins_late = self._checked < 0 and self.recorder.is_late
            self.cpu, self._checked = clock_now() - self._begin, self.steps
            self.recorder.checkpoint(self.content)
            if begins_late and not self.recorder.due:
                return
        if not last:
            self.recorder.flush(made)

    def gather_events(self) -> None:
        """Record the events of the lines, in the result of the system with their names, as they happened."""
        for gather in self.parts.gather:
            gather()
        self.file.gather()

    def _output(self) -> None:
        """Record points, bodies and lines as they are, where an output is due."""
        while not self.loop.sample():
            self.record_samples()
        self.record_samples()

    def record_samples(self) -> None:
        """Record what has been sampled of points, bodies and lines."""
        count = int(self.loop.counts.samples)
        if not count:
            return
        self.loop.counts.samples = 0
        states = [line.sampled(count) for line in self.lines]
        seen = Sampled(states, self.loop.body_samples[:count])
        for at_output in self.parts.at_output:
            at_output(seen)

    def _close(self, status: str, message: str) -> None:
        """Close all, with the events of the lines in the result of the points too."""
        for line in self.lines:
            line.finish(self.t, status)
        self.gather_events()
        for part in self.parts:
            part.finish(status)
        self.file.close(status, message)

    def ends_of_now(self) -> None:
        """Let ends and sea be as they are now: compiled steps have moved them without Python."""
        if not self.loop.counts.asks & b.ASK_BEFORE:
            for model in self.model.models:
                model.ends.at_time(self.t)
                model.sea.at_time(self.t)

    def _spent(self) -> float:
        """Processor time of the run, s, to within `read_every`: to read it may take as long as ten steps."""
        wall = monotonic()
        if wall - self._read[0] > self.read_every:
            self._read = wall, clock_now() - self._begin
        return max(self._read[1], self._logged)

    def write_log(self) -> None:
        """Log the steps that have been made since this was called last."""
        rows = self.loop.rows()
        if not len(rows):
            return
        now = self._spent()
        cpu = np.linspace(self._logged, now, len(rows) + 1)[1:]
        self._logged = now
        for log in self.parts.log:
            log(rows, cpu)

    def finish(self, status: str = "complete", message: str = "") -> None:
        """Write what waits, and close the file."""
        self.write_log()
        for write in (self.record_samples, *(line.write_down for line in self.lines)):
            if status == "complete":
                write()
            else:
                with suppress(LineFailed):
                    write()
        if status != "failed":
            self.keep(last=True)
        self._close(status, message or f"{self.steps} steps")

    @property
    def touches(self) -> bool:
        """Whether contact of a line with itself is computed."""
        return any(model.line.bits & SELF_CONTACT for model in self.model.models)


class RunRecorder(Part):
    """What records the outputs and the steps of a run."""

    name = "recorder"

    def __init__(self, run: RecordedRun) -> None:
        self._run = run

    def at_output(self, seen: Sampled) -> None:
        """Those of points, bodies and pairs, and of lines."""
        self._run.file.save(seen)
        for line, x in zip(self._run.lines, seen.lines, strict=True):
            line.output(x)

    def log(self, rows: Floats, cpu: Floats) -> None:
        """Steps of each line."""
        for k, line in enumerate(self._run.lines):
            line.log(np.column_stack([rows[:, k], cpu]))

    def at_pause(self, finished: bool) -> None:
        """Keep a checkpoint where one is due; the last is kept where the file is closed."""
        if not finished:
            self._run.keep()
