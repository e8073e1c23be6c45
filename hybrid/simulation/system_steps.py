"""Lengths of the steps of several lines that follow their errors, by the law of one cable (kernels.step_law)."""

from __future__ import annotations

from typing import Any

from hybrid.kernels.step_law import FAILED, FIRST, TINY, WARY, growth, refusal, step_end
from hybrid.model.resolution import Resolution


class StepControl:
    """Chooses one step after the other; ratios are of errors to what is allowed, the largest of all lines."""

    def __init__(self, resolution: Resolution) -> None:
        """resolution: of any line; they have the steps in common."""
        self.largest, self.shortest = resolution.step, resolution.shortest  # s
        self.next = max(self.largest / FIRST, self.shortest)  # s, of the next step
        self.ratio, self.wary = 1.0, 0  # of the last step; steps until they grow again after a failure

    def end(self, t: float, stop: float, longest: float) -> float:
        """When the next step from t is to end, s; stop: s, where one must; longest: s, that it may be."""
        return step_end(t, stop, min(self.next, longest))

    def shorter(self, dt: float, ratio: float) -> float:
        """The length (s) with which a step of dt is repeated, 0: it passes, and the next is chosen."""
        ratio = max(ratio, TINY)
        again = refusal(dt, ratio, self.shortest)
        if again > 0.0:
            self.next = again
            return again
        self.wary = max(self.wary - 1, 0)
        self.next = min(max(dt * growth(ratio, self.ratio, self.wary), self.shortest), self.largest)
        self.ratio = ratio
        return 0.0

    def failed(self, dt: float) -> float:
        """The length (s) with which a step of dt that failed is repeated."""
        self.next, self.wary = max(FAILED * dt, self.shortest), WARY
        return self.next

    def restart(self) -> None:
        """Accelerations jump now: of what comes nothing is known."""
        self.next, self.ratio = max(self.next / FIRST, self.shortest), 1.0

    def checkpoint(self) -> list[float]:
        """What the next steps depend on."""
        return [self.next, self.ratio, float(self.wary)]

    def restore(self, saved: Any) -> None:
        """Go on as `checkpoint` has written.  ValueError: that cannot be."""
        numbers = isinstance(saved, list) and len(saved) == 3 and all(isinstance(x, int | float) for x in saved)
        if not numbers or not (self.shortest <= saved[0] <= self.largest and saved[1] > 0.0 and 0 <= saved[2] <= WARY):
            raise ValueError("control: length and error of the steps were expected")
        self.next, self.ratio, self.wary = float(saved[0]), float(saved[1]), int(saved[2])
