"""What a run of lines is recorded in: a result of each line within that of the points, or that of a line alone."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Any, NamedTuple, Protocol

import numpy as np

from hybrid.errors import ComputationError
from hybrid.kernels.machine.cache import cache_folder
from hybrid.scene.network import Network
from hybrid.scene.points import Fairlead
from hybrid.scene.read import scene_text
from hybrid.scene.schema import LineScene
from hybrid.scene.short_form import ShortForm
from hybrid.simulation.events import Sink
from hybrid.simulation.line_result import LineResult
from hybrid.simulation.restart import LoadChange, changes_text
from hybrid.simulation.result_file import mesh_fields, note_neglected_bending, places_of_elevation, result_header
from hybrid.simulation.run_of_lines import RunOfLines
from hybrid.simulation.run_points import Sampled, fields_of, gauges_of, values_of
from hybrid.simulation.run_quantities import Rotations, RunQuantities, fields_of_pairs, values_of_pairs
from hybrid.solve.joined import NetworkState
from hybrid.solve.lines_at_rest import LinesAtRest
from hybrid.store.array_contents import Target
from hybrid.store.checkpoint import Checkpoint
from hybrid.store.format import Field, Header, Text, made
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
        self.rotations.go_on(values)
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
