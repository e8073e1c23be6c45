"""Outputs of a line whose cells are others in each: they are put aside, and looked at and recorded together."""

from __future__ import annotations

from collections.abc import Iterable

from hybrid.kernels.state.state import Line
from hybrid.model.build import Model
from hybrid.outputs.joined_lines import Output
from hybrid.outputs.probes import Observer
from hybrid.simulation.deferred_recorder import DeferredRecorder
from hybrid.simulation.diagnostics import Diagnostics, Stop
from hybrid.store.array_contents import ArrayRecorder
from hybrid.store.stored_rows import ComparisonRecorder
from hybrid.store.writer import Recorder

# Nodes of the outputs that are put aside, at most; cells of a line whose outputs are looked at together, at least.
MOST_ASIDE = 20_000
FEWEST_JOINED = 4


AnyRecorder = Recorder | ArrayRecorder | DeferredRecorder | ComparisonRecorder


def may_be_joined(observer: Observer, line: Line) -> bool:
    """Whether outputs of other cells can be looked at together: all that is written follows from their states."""
    of_states = not observer.writes_criteria and observer.quantities is None
    plain = not (
        line.law.size or line.bend_law.size or line.slip_law.size or line.torsion.size or line.tension_twist.size
    )
    return of_states and plain and line.h.size >= FEWEST_JOINED


class OutputsAside:
    """Outputs that wait, each of a line of its own."""

    def __init__(self, waiting: Iterable[tuple[Model, Output]] = ()) -> None:
        self.waiting = [*waiting]

    def __bool__(self) -> bool:
        return bool(self.waiting)

    @property
    def full(self) -> bool:
        """Whether they have so many nodes that no more should wait."""
        return sum(x.line.s.size for _, x in self.waiting) > MOST_ASIDE

    def put(self, model: Model, outputs: Iterable[Output]) -> None:
        """Let outputs wait; model: of the cable, on whatever cells."""
        self.waiting += [(model, x) for x in outputs]

    def record(self, observer: Observer, recorder: AnyRecorder, diagnostics: Diagnostics | None) -> Stop:
        """Record all, and look at them (None: nobody does): why going on would make no sense, if so."""
        aside, self.waiting = self.waiting, []
        outputs = [x for _, x in aside]
        there, seen = observer.look_at(outputs)
        values = there.values_of(seen)
        observer.first_energy = there.first_energy
        zones = [observer.rows_of(x.zones) for x in outputs]
        recorder.save_batch(seen.batch.t.copy(), values, zones[0], zones[1:])
        return None if diagnostics is None else diagnostics.joined_outputs(seen, values, aside)
