"""What every peer answers, and how an answer is judged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

# What MoorDyn with 800 segments and CableDyn with 400 elements agree on over the last three periods, and at rest; N.
MEAN, PEAK, MINIMUM, STATIC = 31746.0, 41315.0, 22640.0, 31920.0


@dataclass(frozen=True)
class Answer:
    """The tension at the fairlead, and what it cost."""

    times: Vector
    """s, from 0 to the end, at most 0.1 s apart."""
    top_tension: Vector
    """N, at those times."""
    cpu: float
    """CPU seconds of the time loop alone: no import, no input file, no static start."""
    cpu_start: float
    """CPU seconds for set-up and static start."""
    settings: str
    """Time step, scheme, tolerances, in words."""

    def last(self, seconds: float = 24.0) -> Vector:
        """The tensions of the last three periods."""
        return self.top_tension[self.times >= self.times[-1] - seconds - 1e-9]

    def figures(self) -> tuple[float, float, float]:
        """Mean, peak and minimum over the last three periods, N.  The mean is a trapezoidal one, by time."""
        last = self.times >= self.times[-1] - 24.0 - 1e-9
        t, tension = self.times[last], self.top_tension[last]
        mean = float(np.sum(0.5 * (tension[1:] + tension[:-1]) * np.diff(t)) / (t[-1] - t[0]))
        return mean, float(tension.max()), float(tension.min())

    def errors(self) -> tuple[float, float, float]:
        """The three figures against the agreed ones, in per cent."""
        mean, peak, minimum = self.figures()
        return 100 * (mean / MEAN - 1), 100 * (peak / PEAK - 1), 100 * (minimum / MINIMUM - 1)

    def times_real(self) -> float:
        """Simulated seconds per CPU second of the time loop."""
        return float(self.times[-1] / self.cpu)
