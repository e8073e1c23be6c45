"""Error control of the time step: how long the next step may be, by what the last ones were wrong by.

A step's error is of third order in its length.  The controller is proportional and integral (Gustafsson 1991;
Soederlind 2003): the integral part aims at the tolerance, the proportional one damps the reaction to an error that
jumps about, as it does over contact.  docs/theory.md, 2.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil
from typing import Any

# Share of the tolerance aimed at: steps that come out a little worse than predicted still pass.
SAFETY = 0.8
# Exponents on tolerance/error and on the error before over the error now, for an error of order 3 (Gustafsson).
INTEGRAL, PROPORTIONAL = 0.7 / 3.0, 0.4 / 3.0
# Bounds on the change from step to step, within which the weights of the scheme keep tension clean and the motion
# stable (kernels.generalized_alpha.weights).
LEAST, MOST = 0.5, 2.0
# Times the tolerance at which a step is taken back: below, repeating it costs more than it mends.
REFUSED = 2.0
# A step that fails is repeated with this part of its length.
FAILED = 0.5
# Steps after a failure before steps grow again: what made it fail has hardly passed.
WARY = 3
# An error this much below the tolerance (or zero) tells only that steps may grow by MOST.
TINY = 1e-3
# The first step is so many times shorter than the one that would be taken: nothing is known of its error yet.
FIRST = 16.0


class Controller:
    """Chooses steps for one motion; tolerance: m, of the position, in one step; largest, smallest: s."""

    def __init__(self, tolerance: float, largest: float, smallest: float) -> None:
        self.tolerance, self.largest, self.smallest = tolerance, largest, smallest
        self.next = max(largest / FIRST, smallest)
        self.most = float("inf")  # s, for the time being
        self._before = 1.0  # error over tolerance of the last accepted step
        self._wary = 0

    def checkpoint(self) -> dict[str, Any]:
        """What the next steps hang on."""
        return {"next": self.next, "before": self._before, "wary": self._wary}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on as `checkpoint` has said; ValueError where that cannot be."""
        self.next, self._before, self._wary = saved["next"], saved["before"], saved["wary"]
        if not (self.smallest <= self.next <= self.largest and self._before > 0.0 and 0 <= self._wary <= WARY):
            raise ValueError("steps that no controller chooses")

    def until(self, t: float, stop: float) -> float:
        """Where the next step from t should end, so that equal steps would end at `stop`."""
        parts = ceil((stop - t) / min(self.next, self.most) * (1.0 - 1e-9) - 1e-9)
        return stop if parts <= 1 else t + (stop - t) / parts

    def accepts(self, dt: float, error: float) -> bool:
        """Judge a step of dt that is wrong by `error`, m, and choose the next; False: it must be taken back."""
        ratio = max(error / self.tolerance, TINY)
        if ratio > REFUSED and dt > self.smallest * (1.0 + 1e-9):
            self.next = max(dt * max(SAFETY * ratio ** (-1.0 / 3.0), LEAST), self.smallest)
            return False
        factor = SAFETY * ratio**-INTEGRAL * (self._before / ratio) ** PROPORTIONAL
        self._wary = max(self._wary - 1, 0)
        factor = min(max(factor, LEAST), 1.0 if self._wary else MOST)
        self._before = ratio
        self.next = min(max(dt * factor, self.smallest), self.largest)
        return True

    def fails(self, dt: float) -> float:
        """The length to repeat a failed step of dt with, s."""
        self.next, self._wary = max(FAILED * dt, self.smallest), WARY
        return self.next

    def restart(self) -> None:
        """Accelerations jump now: what was known of the error is worth nothing."""
        self.next = max(self.next / FIRST, self.smallest)
        self._before = 1.0
