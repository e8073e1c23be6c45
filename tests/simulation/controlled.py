"""The error control of one line, whose runs are made up."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np

from hybrid.accuracy.error_control import ErrorController
from hybrid.accuracy.error_order import Errors
from hybrid.accuracy.line_errors import LineErrors
from hybrid.accuracy.refinement import Free
from hybrid.model.network import NetworkResolution
from hybrid.model.resolution import RequestedAccuracy, Resolution
from hybrid.scene.root import LINE
from hybrid.simulation.run_sample import RunSample, Samples

Made = Callable[[Resolution], RunSample]


class OneLine:
    """A control of a line in motion, and the case that it computes; sample, result: make its runs up."""

    moves = True
    names: ClassVar[dict[str, str]] = {LINE: ""}
    scene = SimpleNamespace(lines={LINE: SimpleNamespace(sections=())})  # which cannot bend

    def __init__(
        self, asked: RequestedAccuracy | None, free: Free, sample: Made, result: Made,
        settle: Callable[[bool], None] = lambda kept: None, **more: Any,
    ) -> None:  # fmt: skip
        """more: of `LineErrors`."""
        self.made, self.result = sample, result
        self.line = LineErrors(asked, free, True, **more)
        case: Any = self
        self.control = ErrorController({LINE: self.line}, case, self._result, settle)
        self.runs = self.control.runs

    def _result(self, resolution: NetworkResolution) -> Samples:
        return {LINE: self.result(resolution.one)}

    def sample(self, resolution: NetworkResolution) -> Samples:
        """A run to compare with."""
        return {LINE: self.made(resolution.one)}

    def beside(self, samples: Sequence[Any]) -> AbstractContextManager[Sequence[Any]]:
        """One after the other."""
        return nullcontext(samples)

    def start(self, resolution: Resolution) -> tuple[RunSample, Errors | None]:
        """From a first resolution to the result and its errors."""
        self.control.start(NetworkResolution({LINE: resolution}))
        estimate = self.line.estimate
        return self.control.standing[LINE], None if estimate is None else estimate.errors

    @property
    def notes(self) -> tuple[tuple[str, str], ...]:
        """Events of the line, and of its results."""
        return (*self.line.notes, *self.control.notes)


def made_up(
    fineness: float = 1.0, steps: int = 100, off: float = 0.0, step: float | None = None,
    notes: Sequence[tuple[str, str]] = (), model: float = 0.0,
) -> RunSample:  # fmt: skip
    """A run whose position is off by 0.01 m/fineness^2, and by `off` at one point and output; what it says of itself."""
    position = np.full((9, 4, 3), 0.01 / fineness**2)
    position[5, 2] += off
    resolution = Resolution(fineness, step or 10.0 / steps, 1e-6, 1e-3)
    model_error = {"position": np.full((9, 4), model)} if model else {}
    return RunSample(
        resolution, {"position": position}, round(100 * fineness), steps, 0.0, 1, False, model_error, tuple(notes)
    )
