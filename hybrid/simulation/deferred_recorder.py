"""A recorder that can take back what it was given last: for steps that are computed several times over."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from hybrid.kernels.state.state import Line
from hybrid.model.build import Model
from hybrid.outputs.joined_lines import Output
from hybrid.outputs.probes import Observer
from hybrid.simulation.diagnostics import Diagnostics, Stop
from hybrid.store.array_contents import ArrayRecorder
from hybrid.store.envelope import Recorded
from hybrid.store.stored_rows import ComparisonRecorder
from hybrid.store.writer import Recorder

# So much is held back at most where nothing was saved to come back to.
MOST_WAITING = 1000


class DeferredRecorder:
    """Hands on to a `Recorder` what nobody will take back any more."""

    def __init__(self, recorder: Recorder) -> None:
        self._recorder = recorder
        self._waiting: list[tuple[str, tuple[Any, ...], dict[str, Any]]] = []
        self._handed_on = 0  # of all that came
        self.last = recorder.last  # time of the last output, s

    # --- what a run gives it ---------------------------------------------------------------

    def save_batch(
        self, times: np.ndarray, values: Mapping[str, np.ndarray], zones: Sequence[tuple[str, float, float]],
        later: Sequence[Sequence[tuple[str, float, float]]] = (),
    ) -> None:  # fmt: skip
        """Outputs, as of `Recorder.save_batch`."""
        self._waiting.append(("save_batch", (times, values, zones, later), {}))
        self.last = float(times[-1])

    def save(self, t: float, values: Mapping[str, Any], zones: Sequence[tuple[str, float, float]]) -> None:
        """An output at t (s), as of `Recorder.save`."""
        self.save_batch(np.array([t]), {name: np.asarray(x)[None] for name, x in values.items()}, zones)

    def log_rows(self, rows: np.ndarray) -> None:
        """Steps, as of `Recorder.log_rows`."""
        self._waiting.append(("log_rows", (rows,), {}))

    def event(self, *event: Any, **more: Any) -> None:
        """An event, as of `Recorder.event`."""
        self._waiting.append(("event", event, more))

    def replace(self, values: Mapping[str, np.ndarray]) -> None:
        """Values as of `Recorder.replace`, of which the last count."""
        self._recorder.replace(values)

    def recorded(self) -> Recorded | None:
        """As of `Recorder.recorded`, after a last step: what waits is handed on."""
        self.commit()
        return self._recorder.recorded()

    @property
    def due(self) -> bool:
        """As of `Recorder.due`."""
        return self._recorder.due

    def flush(self, made: float = 0.0) -> None:
        """Hand on all that waits, and write it; made: as of `Recorder.flush`."""
        self.commit()
        self._recorder.flush(made)

    # --- what a Simulation asks of it -----------------------------------------------------------

    @property
    def full(self) -> bool:
        """Whether too much waits."""
        return len(self._waiting) > MOST_WAITING

    def mark(self) -> int:
        """A place to come back to."""
        return self._handed_on + len(self._waiting)

    def back_to(self, mark: int) -> None:
        """Forget what came after a mark.  ValueError: it is final."""
        if mark < self._handed_on:
            raise ValueError("a later save() has made final what came after this one")
        del self._waiting[mark - self._handed_on :]
        batches = [x for x in self._waiting if x[0] == "save_batch"]
        self.last = float(batches[-1][1][0][-1]) if batches else self._recorder.last

    def commit(self) -> None:
        """Hand on all that waits."""
        for name, given, more in self._waiting:
            getattr(self._recorder, name)(*given, **more)
        self._handed_on += len(self._waiting)
        self._waiting.clear()

    def close(self, status: str, message: str) -> None:
        """Hand on all that waits, and close the file."""
        self.commit()
        self._recorder.close(status, message)


# Outputs of a line whose cells are others in each: they are put aside, and looked at and recorded together.

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
        there, seen = observer.joined_observation(outputs)
        values = there.values_of(seen)
        observer.first_energy = there.first_energy
        zones = [observer.rows_of(x.zones) for x in outputs]
        recorder.save_batch(seen.batch.t.copy(), values, zones[0], zones[1:])
        return None if diagnostics is None else diagnostics.joined_outputs(seen, values, aside)
