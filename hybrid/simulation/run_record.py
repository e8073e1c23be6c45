"""What is recorded of a run of lines, and the file that it goes to.

Outputs, steps, events and checkpoints go, as the run goes on, to a result of each line within that of the points, or to
that of a line alone.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from time import monotonic
from time import process_time as clock_now
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from hybrid.errors import ComputationError
from hybrid.kernels.junctions.bodies import SPRING
from hybrid.kernels.state.books import WORKS
from hybrid.kernels.state.report import REPORT_SIZE
from hybrid.kernels.state.state import OPTIONAL_STATE, Floats
from hybrid.model.nearby import weaknesses
from hybrid.model.sections import OutputPoints
from hybrid.scene.ends import Fairlead
from hybrid.scene.network import Network
from hybrid.scene.read import scene_text
from hybrid.scene.root import ShortForm
from hybrid.scene.schema import LineScene
from hybrid.simulation.events import Sink
from hybrid.simulation.own_parts import RunPart
from hybrid.simulation.parts import Part, Sampled
from hybrid.simulation.restart import (
    FIRST_REPORT,
    FIRST_WORKS,
    LoadChange,
    as_of_line,
    changes_text,
    is_of_cable,
    of_line,
    program,
    refused,
    resolution_tree,
)
from hybrid.simulation.result_file import mesh_fields, note_neglected_bending, places_of_elevation, result_header
from hybrid.simulation.run_line import RunLine
from hybrid.simulation.run_of_lines import AnyRecorder, Heard, RunOfLines
from hybrid.simulation.run_quantities import (
    Rotations,
    RunQuantities,
    fields_of,
    fields_of_pairs,
    gauges_of,
    values_of,
    values_of_pairs,
)
from hybrid.simulation.zones_at_rest import Start
from hybrid.solve.lines_at_rest import LinesAtRest
from hybrid.solve.network_steps import no_extremes
from hybrid.solve.stepper import LineFailed, NetworkState
from hybrid.store.format import Field, Header, Text, made
from hybrid.store.hdf5_file import opened, root_of
from hybrid.store.integrity import matched
from hybrid.store.recorder import Rows
from hybrid.store.records import PENDING, RIDES, RODS_AT_START, THERE
from hybrid.store.stored_rows import ComparisonRecorder
from hybrid.store.whole_file import Checkpoint, read_checkpoint
from hybrid.store.writer import AT_ONCE, Recorder, WriteMode
from hybrid.zones.change import reasons_at_start
from hybrid.zones.manager import DomainManager


class Asked(NamedTuple):
    """The scene that a network was made of, and what changes in it later."""

    scene: Any
    changes: Sequence[LoadChange[Any]] = ()


class Recording(NamedTuple):
    """What there is beside a run: around it, before it and after it.

    mode: how a file is written; source: the result to go on with, from its checkpoint, in place of a start; pending:
    what is to come when it is complete (store.records); notes: events (kind, text) of the whole of the run; begun:
    called behind the first output; planes: whether lines that are joined to nothing are computed in the planes in
    which they lie; start: the first state, if it is known; points: of outputs of lines by name, None: those of
    their scenes; until: s, its end, if it comes before that of the scene; touches: whether contact begins by itself
    where lines come near themselves, else that is only noticed; asked: what the network was made of, by whose names it
    gets its file; parts: of the user's own, of which the run has copies; heard: who hears of a motion, and may end it.
    """

    mode: WriteMode = AT_ONCE
    source: Path | None = None
    pending: str = ""
    notes: Sequence[tuple[str, str]] = ()
    begun: Callable[[Any], None] | None = None
    planes: bool = False
    start: Start | None = None
    points: Mapping[str, OutputPoints] | None = None
    until: float | None = None
    touches: bool = True
    asked: Asked | None = None
    parts: Sequence[RunPart] = ()
    heard: Heard | None = None


ALONE = Recording()


class RunFile:
    """The result of a run: of its points, bodies and pairs, with a group for each line.

    That of a line without a name is the result of the line alone, in the words of its scene.
    """

    def __init__(
        self, run: RunOfLines, network: Network, scenes: Mapping[str, LineScene], text: Text, asks: Recording
    ) -> None:
        """network: with the loads of its start; scenes: of its lines by name; text: the scene, as the file has it."""
        scene = asks.asked.scene if asks.asked is not None else None
        self._run, self._text, self._asks = run, text, asks
        self._form = ShortForm((), {}) if scene is None else scene.form
        # The scene of the only line, if it has no name.
        self._alone: LineScene | None = scene.asked_lines.get("") if scene is not None else None
        # What is recorded beside the lines, by name.
        self.quantities = RunQuantities(network, scenes if self._alone is None else {})
        self.rotations = Rotations(network, run.model)

    @property
    def _length(self) -> float:
        """Of the only line, m; 0: lines have no arc lengths in common."""
        line = self._run.lines[0]
        return (line.paying or line.model).length if self._alone is not None else 0.0

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

    def line_rows(self, line: RunLine, found: LinesAtRest | None, outputs: int, manager: DomainManager | None) -> Rows:
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
        recorder = Recorder(run.target, header, outputs=len(run.times) + 1, overwrite=True, mode=mode, parts=parts)
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
        network, models = run.network, run.model.models
        attributes: dict[str, str | float | int] = {
            "title": network.title,
            "cells": run.model.cells,
            "lines": len(models),
            "length": sum(x.length for x in models),
        }
        if run.found is not None:
            attributes |= {"static_path": run.found.summary, "static_residual": run.found.residual}
        on_bodies = {x: point.body for x, point in network.points.items() if isinstance(point, Fairlead)}
        if pending:
            attributes[PENDING] = pending
        if on_bodies:
            attributes["fairleads"] = json.dumps(on_bodies)
        fields = [*fields_of(run.network), *fields_of_pairs(run.model), *self.quantities.fields]
        fixed = [*self.quantities.limits, *self.quantities.ranges, *places_of_elevation(gauges_of(network))]
        header = Header(np.zeros(1), fields, (), attributes, self._texts, fixed)
        return self._recorder(header, {name: x for name, x in rows.items() if isinstance(x, Rows)})

    def resume(self, source: Any, point: Checkpoint) -> Recorder:
        """The result from a checkpoint of an open file on."""
        recorder, fixed = self.begin(), list[tuple[Field, np.ndarray]]()
        assert isinstance(recorder, Recorder)
        for line in self._run.lines:  # whose file may be of a program that did not write them
            within, rows = root_of(source, "" if self._alone is not None else line.name), line.recorder
            if lacks := {THERE, RIDES} & {f.name for f in line.observer.fields if f.name not in within}:
                assert isinstance(rows, Rows)
                line.observer.leave_out(lacks)
                rows.use_fields(line.observer.fields)
        if self._alone is not None:  # likewise
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
        values |= values_of_pairs(run.model, run.solver.shared, seen.lines, run.lines)
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


class RecordedRun(RunOfLines):
    """A run as its file grows: what is written of its lines."""

    kept: bool  # whether it writes checkpoints
    file: RunFile
    read_every = READ_EVERY
    _begin: float  # s, of the processor, when the run began, were it all made now
    _logged = 0.0  # s, likewise, when steps were logged last
    _read = -np.inf, 0.0  # s of the wall, when the time of the processor was read last, and that
    _checked = -1  # steps at the last checkpoint
    _between = False  # whether the state is that between two steps

    def stand_at(self, t: float, steps: int, last_step: float, last_rho: float, interval: float) -> None:
        """Be between two steps, at t (s)."""
        clock = self.loop.clock
        clock.now, clock.last_dt, clock.last_rho, self.loop.counts.steps = t, last_step, last_rho, steps
        for line in self.lines:
            line.books.counts.repeats = 0  # of a step that was tried when it was taken back
        self.loop.stand_between(interval, self.resolution.one.step)
        self._logged = self._spent()

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
            self.end_step()
            begins_late = self._checked < 0 and self.recorder.is_late
            self.cpu, self._checked = clock_now() - self._begin, self.steps
            self.recorder.checkpoint(partial(content, self))
            if begins_late and not self.recorder.due:
                return
        if not last:
            self.recorder.flush(made)

    def _close(self, status: str, message: str) -> None:
        """Close all, with the events of the lines in the result of the points too."""
        for line in self.lines:
            line.finish(self.t, status)
        self.gather_events()
        for part in self.parts:
            part.finish(status)
        self.file.close(status, message)

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
        let_go = () if status == "complete" else (LineFailed,)
        for write in (self.record_samples, *(line.write_down for line in self.lines)):
            with suppress(*let_go):
                write()
        if status != "failed":
            self.keep(last=True)
        self._close(status, message or f"{self.steps} steps")


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


REFERENCES = "first_places", "first_turns"  # of outputs of a line


# Kept of parts that a run does not have.
WITHOUT: Mapping[str, Any] = {"zones": {}, "planes": {}}


def checkpoint(run: RecordedRun) -> dict[str, Any]:
    """What the next steps depend on, between two steps, with no output waiting: named arrays and plain values."""
    lines = {
        line.name: line.checkpoint(work, run.t) | {"state": state._asdict(), "rho": float(line.books.clock.last_rho)}
        for line, work, state in zip(run.lines, run.solver.work, run.state.lines, strict=True)
    }
    found: dict[str, Any] = {"t": run.t, "steps": run.steps, "last": run.last_step, "rho": run.last_rho}
    found |= {"loaded": run.loaded, "interval": run.interval, "leg": [*run.leg], "cpu": run.cpu, "rest": run.rest}
    found |= {"worked": run.loop.worked[1, :, :SPRING], "body_work": run.solver.body_work[:, :SPRING]}
    found |= {"bodies": run.state.bodies, "lines": lines, **WITHOUT}
    found |= {"control": run.loop.control(), "cuts": run.loop.cuts()}
    for part in run.parts:
        found |= part.checkpoint()
    return found


def restore(run: RecordedRun, saved: Mapping[str, Any]) -> None:
    """Go on as `checkpoint` has written, with a run that was made for it.  ValueError: that cannot be."""
    if is_of_cable(saved):
        saved = as_of_line(saved, run.lines[0].name, run.model.models[0], weaknesses(run.network))
    given, saved = saved, _of_today(run, saved)
    if any([part.restore_lines(saved) for part in reversed(run.parts)]):
        run.make_solver()
    template = checkpoint(run) | {"control": None, "planes": None}
    for part in run.parts:
        template |= dict.fromkeys(part.checkpoint())
    saved["lines"] = lines_of_today(saved.get("lines"), template["lines"], saved["rho"])
    for line in template["lines"].values():
        line["envelope"] = None  # of other meshes as well, and of files of 0.6
        line |= {x: np.full_like(line[x], np.nan) for x in REFERENCES if x in line}
        line["report"] = np.full_like(line["report"], np.inf)  # it may have numbers that are not finite
        line["before"]["report"] = line["report"]
        if "self_contact" in line:
            line["self_contact"] = None  # as many places of friction as there are
    found = matched(saved, template)
    if not (0.0 <= found["leg"][0] <= found["t"] and found["leg"][1] >= 0 and found["steps"] >= 0):
        raise ValueError(f"leg: a time up to {found['t']:g} s was expected")
    run.start_from(found["rest"])
    run.make_solver()
    set_state(run, found)
    if any("report" not in of_line(given, line.name) for line in run.lines):  # nor in one of 0.6, of a cable
        run.evaluate_forces("where the checkpoint is")
        for line in run.lines:  # whose envelope is of the steps to come
            line.books.extremes[:] = no_extremes(line.books.extremes.shape[2])
    for line in run.lines:
        if "imposed" not in of_line(given, line.name).get("before", ()):  # not in files of an earlier program
            line.impose_now()


def _of_today(run: RecordedRun, saved: Mapping[str, Any]) -> dict[str, Any]:
    """A checkpoint with what files of an earlier program, or of a cable, do not have.

    It took the added mass of members as at the first guess.
    """
    older: dict[str, Any] = {"rest": run.rest, "control": [], "cuts": run.loop.cuts(), "interval": 0.0}
    older |= {"rho": run.network.require_time().rho_inf, "worked": run.loop.worked[1, :, :SPRING]}
    older |= {"bodies": run.state.bodies, "body_work": run.solver.body_work[:, :SPRING], **WITHOUT}
    for part in run.parts:
        older |= part.older
    return older | dict(saved)


def lines_of_today(lines: Any, template: Mapping[str, Any], rho: float) -> Any:
    """Lines of a checkpoint with what earlier programs did not have.

    Mean tensions, the end of a report, answers to torques, what diagnostics remember, and a spectral radius of their
    own; rho: that of all lines.
    """
    if not (isinstance(lines, dict) and all(isinstance(x, dict) for x in lines.values())):
        return lines
    found = {}
    for name, saved in lines.items():
        line = {key: x for key, x in saved.items() if key != "correction"}  # of what leaving bending out did, in 1.0
        mine, state, report = template.get(name), line.get("state"), line.get("report")
        if mine is not None and isinstance(state, dict):
            empty = {x: mine["state"][x] for x in OPTIONAL_STATE if x in mine["state"] and not mine["state"][x].size}
            line = line | {"state": {**empty, **state}}
        work = line.get("work")
        if isinstance(work, np.ndarray) and work.ndim == 1 and FIRST_WORKS <= work.size < WORKS:
            line = line | {"work": np.pad(work, (0, WORKS - work.size))}
        if isinstance(report, np.ndarray) and report.ndim == 1 and FIRST_REPORT <= report.size < REPORT_SIZE:
            line = line | {"report": np.pad(report, (0, REPORT_SIZE - report.size))}
        if mine is not None and "torsion" in mine:
            line = {"torsion": mine["torsion"]} | line
        if mine is not None:
            before = line.get("before", {})
            older = {"rho": rho, "report": mine["report"]} | {x: mine[x] for x in REFERENCES if x in mine}
            line = older | line | {"before": mine["before"] | before if isinstance(before, dict) else before}
        if mine is not None and isinstance(line.get("noted"), dict):
            line = line | {"noted": mine["noted"] | {k: x for k, x in line["noted"].items() if k != "_left_out"}}
        found[name] = line
    return found


def set_state(run: RecordedRun, found: Mapping[str, Any]) -> None:
    """Be as when `checkpoint` was called, of a run with the same things broken, without a look at its form."""
    run.stand_at(found["t"], found["steps"], found["last"], found["rho"], found["interval"])
    run.loaded, run.leg, run.cpu = found["loaded"], (found["leg"][0], found["leg"][1]), found["cpu"]
    longest = max(max(x.step, x.later) for x in run.resolution.lines.values())
    run.loop.restore_control(found["control"], longest)
    run.loop.restore_cuts(found["cuts"])
    run.state.bodies[:], run.solver.body_work[:, :SPRING] = found["bodies"], found["body_work"]
    run.loop.worked[0], run.loop.worked[1, :, :SPRING] = run.solver.body_work, found["worked"]
    for line, x, work, state in zip(run.lines, run.solver.lines, run.solver.work, run.state.lines, strict=True):
        mine = found["lines"][line.name]
        for name, values in mine["state"].items():
            getattr(state, name)[:] = values
        line.books.clock.last_rho = mine["rho"]
        line.restore(mine, work, run.t, x.joints)
    for part in run.parts:
        part.restore(found)


def content(run: RecordedRun) -> dict[str, Any]:
    """What the writer keeps of a checkpoint."""
    resolution = {name: resolution_tree(x) for name, x in run.resolution.lines.items()}
    asks = run.criterion is not None
    return {"program": program(), "asks": asks, "resolution": resolution, "state": checkpoint(run)}


def kept_changes(source: Path, most: int) -> int:
    """How many changes of loads were made up to the checkpoint of a result; ResultError: more than `most`."""
    with opened(source) as file, refused(source):
        state = read_checkpoint(file).state
        made = int(state.get("changes", 0)) if isinstance(state, Mapping) else 0  # not in files of an earlier program
        if not 0 <= made <= most:
            raise ValueError(f"changes: up to {most} were expected")
        return made
