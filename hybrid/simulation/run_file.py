"""What a run of lines is recorded in: a result of each line within that of the points, or the file of a cable.

`LinesFile` has points, bodies, pairs and what is asked for by name at its root, and each line in a group of its own.
`CableFile` is that of a line without a name: the result of the line alone, in the words of its scene.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

from hybrid.errors import ComputationError
from hybrid.kernels.machine.cache import cache_folder
from hybrid.scene.points import Fairlead
from hybrid.scene.read import scene_text
from hybrid.scene.schema import LineScene
from hybrid.scene.short_form import short_form
from hybrid.simulation.deferred_recorder import DeferredRecorder
from hybrid.simulation.events import Sink
from hybrid.simulation.line_result import LineResult
from hybrid.simulation.restart import LoadChange, changes_text
from hybrid.simulation.result_file import STEP_FIELDS, mesh_fields, places_of_elevation, result_recorder
from hybrid.simulation.run_of_lines import RunOfLines
from hybrid.simulation.run_points import Sampled, fields_of, gauges_of, values_of
from hybrid.simulation.run_quantities import Rotations, RunQuantities, fields_of_pairs, values_of_pairs
from hybrid.solve.joined import NetworkState
from hybrid.solve.lines_at_rest import LinesAtRest
from hybrid.store.array_contents import ArrayRecorder, MemoryTarget, Target
from hybrid.store.checkpoint import Checkpoint
from hybrid.store.format import Field, Header, Text, made
from hybrid.store.records import PENDING, RODS_AT_START
from hybrid.store.stored_rows import ComparisonRecorder
from hybrid.store.writer import AT_ONCE, Recorder, WriteMode
from hybrid.zones.at_start import reasons_at_start
from hybrid.zones.manager import DomainManager

AnyRecorder = Recorder | ArrayRecorder | DeferredRecorder | ComparisonRecorder


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
    rotations: Rotations
    quantities: RunQuantities
    recorder: AnyRecorder

    @property
    def files(self) -> Mapping[str, str]: ...


def _notes(pending: str, manager: DomainManager | None) -> dict[str, str]:
    """Texts that are attributes of the result of a line."""
    return {PENDING: pending, RODS_AT_START: reasons_at_start(manager)}


class LinesFile:
    """Points, bodies and pairs, with the result of each line in a group of its own."""

    def __init__(self, run: FiledRun, text: Text, asks: Filing) -> None:
        self._run, self._text, self._asks = run, text, asks
        self._memory: dict[str, MemoryTarget] = {}  # of the lines, where the result is kept in arrays

    @property
    def span(self) -> tuple[float, float]:
        """Arc lengths (m) of events of the whole run: lines have none in common."""
        return 0.0, 0.0

    def place(self, point: str) -> tuple[float, float]:
        """The same of an event at a point."""
        return self.span

    # --- how lines are recorded -----------------------------------------------------------------

    def scene_of(self, scene: LineScene) -> LineScene:
        """The scene by which a line is recorded."""
        return scene

    def of_quantities(self, scenes: Mapping[str, LineScene]) -> Mapping[str, LineScene]:
        """Of these scenes of lines, those whose quantities by name are recorded beside the lines."""
        return scenes

    def line_recorder(
        self, line: LineResult, found: LinesAtRest | None, outputs: int, manager: DomainManager | None
    ) -> Recorder | ArrayRecorder | ComparisonRecorder:
        """The result of a line, laid by until there is that of the run; manager: of zones that move."""
        target: Target = io.BytesIO()
        if isinstance(self._run.target, MemoryTarget):
            target = self._memory[line.name] = MemoryTarget()
        texts, notes = {"scene": partial(scene_text, line.scene)}, _notes(self._asks.pending, manager)
        parts = line.scene, line.model, line.observer
        recorder = result_recorder(*parts, target, texts, found, line.envelope, outputs, notes=notes)
        if isinstance(recorder, Recorder):
            recorder.lay_by()
        return recorder

    # --- the file -------------------------------------------------------------------------------

    @property
    def _mode(self) -> WriteMode:
        """How it is written; nobody goes on with a result in memory."""
        return self._asks.mode if isinstance(self._run.target, Path) else AT_ONCE

    @property
    def _parts(self) -> dict[str, Recorder]:
        return {line.name: line.recorder for line in self._run.lines if isinstance(line.recorder, Recorder)}

    @property
    def _fields(self) -> list[Field]:
        run = self._run
        return [*fields_of(run.system), *fields_of_pairs(run.model), *run.quantities.fields]

    @property
    def _texts(self) -> dict[str, Text]:
        changes = self._run.changes if self._asks.asked is None else self._asks.asked.changes
        return {"scene": self._text} | ({"changes": changes_text(changes)} if changes else {})

    def begin(self) -> AnyRecorder:
        """A new result of the points and bodies, with those of the lines in it."""
        run, pending = self._run, self._asks.pending
        if run.target is None:
            return ComparisonRecorder()
        system, models = run.system, run.model.models
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
        fixed = [*run.quantities.limits, *run.quantities.ranges, *places_of_elevation(gauges_of(system))]
        header = Header(np.zeros(1), self._fields, (), attributes, self._texts, fixed)
        if isinstance(run.target, MemoryTarget):
            return ArrayRecorder(run.target, header, self._memory)
        recorder = Recorder(
            run.target, header, outputs=len(run.times) + 1, overwrite=True, mode=WriteMode(self._mode.before),
            templates=cache_folder().parent, parts=self._parts,
        )  # fmt: skip
        recorder.files = run.files
        return recorder

    def again(self, source: Any, point: Checkpoint) -> Recorder:
        """The result from a checkpoint of an open file on."""
        target, asks, texts = self._run.target, self._asks, {name: made(x) for name, x in self._texts.items()}
        assert isinstance(target, Path)
        return Recorder.again(
            source, target, self._fields, (), point, texts, asks.mode.before or {}, (), self._parts, asks.pending
        )

    def save(self, seen: Sampled) -> None:
        """Record outputs of points, bodies and pairs, and quantities by name."""
        run = self._run
        if run.target is None:
            return
        values = values_of(run.system, run.model, seen)
        run.rotations.go_on(values)
        values |= values_of_pairs(run.model, run.solver.shared, seen.lines)
        by_name = {line.name: x for line, x in zip(run.lines, seen.lines, strict=True)}
        values |= run.quantities.values(by_name, {line.name: line for line in run.lines})
        run.recorder.save_batch(seen.t, values, [("lines", 0.0, 0.0)])

    # --- events and errors ----------------------------------------------------------------------

    @property
    def noted(self) -> Sink:
        """What notes events of the whole run."""
        return self._run.recorder

    def gather(self) -> None:
        """Record the events of the lines, in the result of the run with their names, as they happened."""
        found = [(x, f"line {line.name}: {x[-1]}") for line in self._run.lines for x in line.take_events()]
        for (t, s_a, s_b, kind, _), text in sorted(found, key=lambda event: event[0][0]):
            self._run.recorder.event(t, s_a, s_b, kind, text)

    def in_words(self, error: ComputationError) -> ComputationError:
        """An error in the words of the scene."""
        return error

    def snapshot(self, state: NetworkState) -> dict[str, Any]:
        """What a snapshot has of a state, and the scene."""
        found: dict[str, Any] = {"scene": scene_text(self._run.system), "bodies": state.bodies}
        for line, x in zip(self._run.lines, state.lines, strict=True):
            found |= {f"{line.name}/{name}": values for name, values in _named(line, x).items()}
        return found

    def close(self, status: str, message: str) -> None:
        """Close all; status, message: of the run."""
        run = self._run
        for line in run.lines:
            line.recorder.close(status, message)
        run.recorder.replace(run.quantities.range_values())
        run.recorder.close(status, message)


class CableFile(LinesFile):
    """The result of the only line, which the scene of a cable was made into, as that of the cable."""

    def __init__(self, run: FiledRun, text: Text, asks: Filing) -> None:
        super().__init__(run, text, asks)
        assert asks.asked is not None
        self._asked, self._form = asks.asked, short_form(asks.asked.scene)

    @property
    def _line(self) -> LineResult:
        (line,) = self._run.lines
        return line

    @property
    def span(self) -> tuple[float, float]:
        return 0.0, self._line.model.length

    def place(self, point: str) -> tuple[float, float]:
        s = self._line.model.length if point == "end" else 0.0
        return s, s

    def scene_of(self, scene: LineScene) -> LineScene:
        return self._asked.scene

    def of_quantities(self, scenes: Mapping[str, LineScene]) -> Mapping[str, LineScene]:
        return {}

    @property
    def _texts(self) -> dict[str, Text]:
        return {"scene": self._text, "changes": changes_text(self._asked.changes)}

    def line_recorder(
        self, line: LineResult, found: LinesAtRest | None, outputs: int, manager: DomainManager | None
    ) -> Recorder | ArrayRecorder | ComparisonRecorder:
        """The result, if it is a new one."""
        run, asks = self._run, self._asks
        if asks.source is not None:
            return ComparisonRecorder()
        assert run.target is not None
        parts, notes = (line.scene, line.model, line.observer), _notes(asks.pending, manager)
        recorder = result_recorder(*parts, run.target, self._texts, found, line.envelope, outputs, self._mode, notes)
        recorder.files = run.files
        return recorder

    def begin(self) -> AnyRecorder:
        """The result of the line is that of the run."""
        return self._line.recorder

    def again(self, source: Any, point: Checkpoint) -> Recorder:
        line, target, asks = self._line, self._run.target, self._asks
        assert isinstance(target, Path)
        texts = {name: made(x) for name, x in self._texts.items()}
        tables, before = (line.observer.fields, STEP_FIELDS), asks.mode.before or {}
        fixed = [*line.envelope.fixed(), *mesh_fields(line.model)]
        recorder = Recorder.again(source, target, *tables, point, texts, before, fixed, pending=asks.pending)
        line.recorder = recorder
        return recorder

    def save(self, seen: Sampled) -> None:
        """The line records them itself."""

    @property
    def noted(self) -> Sink:
        return self._line.events

    def event(self, t: float, s_a: float, s_b: float, kind: str, text: str, **more: Any) -> None:
        """Record an event of the network in the words of the scene."""
        self._line.recorder.event(t, s_a, s_b, kind, self._form.text(text), **more)

    def gather(self) -> None:
        self._line.events.write_to(self)

    def in_words(self, error: ComputationError) -> ComputationError:
        return self._form.error(error)

    def snapshot(self, state: NetworkState) -> dict[str, Any]:
        return {"scene": made(self._text)} | _named(self._line, state.lines[0])

    def close(self, status: str, message: str) -> None:
        self.gather()
        self._line.recorder.close(status, message)


def file_of(run: FiledRun, text: Text, asks: Filing) -> LinesFile:
    """What a run is recorded in, by the names that its lines have in the scene; text: the scene."""
    form = CableFile if asks.asked is not None and "" in asks.asked.scene.lines else LinesFile
    return form(run, text, asks)


def _named(line: LineResult, state: Any) -> dict[str, Any]:
    """Arrays of the state of a line, with the arc lengths of its nodes."""
    return {"s": line.model.line.s, **state._asdict()}
