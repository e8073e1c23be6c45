"""What is kept of a run to compare with: arrays of its outputs, and no result that anyone opens."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hybrid.errors import ResultError
from hybrid.store.envelope import Recorded


class ComparisonRecorder:
    """Stands in for a `Recorder` where only arrays are wanted: outputs, events, and some columns of the step log."""

    def __init__(self, columns: Sequence[int] = ()) -> None:
        """columns: of the step log, that are kept."""
        self._columns, self._steps = list(columns), list[np.ndarray]()
        self.times: list[float] = []
        self.events: list[tuple[str, str]] = []  # kind, text
        self._kept: dict[str, list[np.ndarray]] = {}  # batches (nb, ...)
        self._catenary: list[float] = []
        self.rods: set[tuple[float, float]] = set()  # m, stretches that were rod at any output

    @property
    def last(self) -> float:
        """Time of the last output, s."""
        return self.times[-1] if self.times else -np.inf

    def save(self, t: float, values: Mapping[str, Any], zones: Sequence[tuple[str, float, float]]) -> None:
        """Append an output at time t, s.  ResultError when it is not finite."""
        self.save_batch(np.array([t]), {name: np.asarray(x)[None] for name, x in values.items()}, zones)

    def save_batch(
        self, times: np.ndarray, values: Mapping[str, np.ndarray], zones: Sequence[tuple[str, float, float]],
        later: Sequence[Sequence[tuple[str, float, float]]] = (),
    ) -> None:  # fmt: skip
        """Append outputs at the times (nb,), s, of the fields (nb, ...).  ResultError when one is not finite.

        later: as of `Recorder.save_batch`; not kept.
        """
        for name, value in values.items():
            finite = np.isfinite(value).reshape(len(times), -1).all(axis=1)
            if not finite.all():
                raise ResultError(f"{name} is not finite at t = {times[np.argmin(finite)]:.9g} s")
        self.times += times.tolist()
        share = sum((b - a for kind, a, b in zones if kind == "catenary"), 0.0) / zones[-1][2] if zones else 0.0
        self._catenary += [share] * len(times)
        self.rods |= {(a, b) for kind, a, b in zones if kind == "rod"}
        self._keep(values)

    def recorded(self) -> Recorded | None:
        """Outputs to compare with are held against no limits."""
        return None

    def _keep(self, values: Mapping[str, np.ndarray]) -> None:
        for name, value in values.items():
            self._kept.setdefault(name, []).append(np.asarray(value, float))

    def log(self, values: Mapping[str, float | int]) -> None:
        """Single steps are not kept."""

    def log_rows(self, rows: np.ndarray) -> None:
        """Append steps: rows of the log."""
        self._steps.append(np.array(rows[:, self._columns], float))

    @property
    def steps(self) -> np.ndarray:
        """The columns that are kept, of all steps."""
        return np.concatenate([np.zeros((0, len(self._columns))), *self._steps])

    @property
    def catenary(self) -> np.ndarray:
        """(nt,) part of the line that was catenary at the outputs."""
        return np.array(self._catenary)

    def event(self, t: float, s_a: float, s_b: float, kind: str, text: str, **more: Any) -> None:
        """Note that something happened at time t (s) from s_a to s_b (m)."""
        self.events.append((kind, f"{text} (at t = {t:.4g} s, s = {0.5 * (s_a + s_b):.4g} m)"))

    def replace(self, values: Mapping[str, np.ndarray]) -> None:
        """What does not grow is not kept."""

    def close(self, status: str, message: str) -> None:
        """There is no file to close."""

    @property
    def names(self) -> list[str]:
        """What is kept."""
        return list(self._kept)

    def __contains__(self, name: str) -> bool:
        return name in self._kept

    def __getitem__(self, name: str) -> np.ndarray:
        """All outputs of a quantity, (nt, ...)."""
        return np.concatenate(self._kept[name])
