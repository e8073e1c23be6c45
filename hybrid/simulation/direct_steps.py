"""Steps of a cable that is stepped from outside, straight to the compiled run where nothing else has a say in them.

What the time loop asks around a step takes as long as a step of a hundred cells, and nearly always finds nothing.
"""

from __future__ import annotations

import math

from hybrid.kernels.state import books as b
from hybrid.simulation.time_loop import TimeLoop


class DirectSteps:
    """Steps of one line that keeps its zones, its length and its ends; made anew when its model changes."""

    def __init__(self, loop: TimeLoop) -> None:
        moving = loop.run
        self._loop, self._model, self._moving, self._run = loop, moving.model, moving, moving.run
        ends = moving.model.ends
        others = moving.switching, moving.correction, moving.payout
        self._asks_others = any(x is not None for x in others) or moving.controlled or not loop.patient
        self._asks_others |= bool(ends.breaks) or min(ends.release_times) < math.inf
        self._count = moving.run.count

    def still_of(self, loop: TimeLoop) -> bool:
        """Whether these are steps of the loop as it is now."""
        return loop is self._loop and self._moving.model is self._model

    def take(self, until: float) -> None:
        """To `until` (s), where a step ends; StepFailed and ComputationError as of `TimeLoop.until`."""
        if self._asks_others or self._count.asks:
            self._loop.until(until, exact=False)
            return
        self._moving.set_stop(until)
        code = self._run.go()
        if code != b.AT_STOP:
            self._loop.go_to(until, code)
