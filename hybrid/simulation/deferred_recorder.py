"""A recorder that can take back what it was given last: for steps that are computed several times over."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hybrid.store.envelope import Recorded
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
