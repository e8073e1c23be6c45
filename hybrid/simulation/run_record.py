"""What is recorded of a run of lines: outputs, steps, events and checkpoints, as it goes on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from time import monotonic
from time import process_time as clock_now
from typing import Any

import numpy as np

from hybrid.kernels.state import books as b
from hybrid.kernels.state.report import SELF_CONTACT
from hybrid.kernels.state.state import Floats
from hybrid.model.network import NetworkModel, NetworkResolution
from hybrid.scene.network import Network
from hybrid.simulation.events import Sink
from hybrid.simulation.line_result import LineResult
from hybrid.simulation.parts import Part, Parts
from hybrid.simulation.restart import LoadChange
from hybrid.simulation.run_checkpoint import files_of
from hybrid.simulation.run_file import AnyRecorder, RunFile
from hybrid.simulation.run_points import Sampled
from hybrid.solve.joined import LineFailed
from hybrid.solve.network_steps import NetworkSteps
from hybrid.store.array_contents import Target
from hybrid.store.stored_rows import ComparisonRecorder

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
                model.ends.at(self.t)
                model.sea.at(self.t)

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
