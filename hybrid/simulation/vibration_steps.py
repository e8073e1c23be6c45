"""Steps that show a vibration along the line while it lasts, and longer ones once it has died out (docs/errors.md).

Drag and slack may set it off again in every period of the motion: it has died out where a whole period shows little.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from hybrid.kernels.state.books import Clock
from hybrid.kernels.state.state import Floats
from hybrid.model.resolution import Resolution, start_vibrations
from hybrid.scene.motion_checks import stationary_from
from hybrid.scene.schema import LineScene
from hybrid.simulation.line_result import FORCE_COLUMNS
from hybrid.simulation.parts import Part
from hybrid.store.integrity import matched

SEEN = 2.0  # periods of the vibration over which its amplitude is found, and from one look at it to the next
DEGREE = 3  # of the polynomial that stands for what else a force does in this time
FEWEST = 12  # steps; of fewer nothing is known
# It counts as gone below this part of what would be shown at its begin: the errors of what is damped do not show.
GONE = 0.5


class VibrationSteps:
    """Of one run whose steps follow the motion: when a vibration begins steps are short, until it has died out."""

    def __init__(self, scene: LineScene, resolution: Resolution) -> None:
        regular = stationary_from(scene) if resolution.later > resolution.step else None
        shown = [x for x in start_vibrations(scene) if x.force > resolution.still] if regular is not None else []
        self.begins = sorted({x.t for x in shown})  # s
        self.look = np.inf  # s, when to look whether it lasts; infinity: none is there
        self._recurs = (0.0, 0.0) if regular is None else regular  # s: from when on, and after how long, all does
        self._period = shown[0].period if shown else np.inf  # s
        self._still, self._short, self._long = resolution.still, resolution.step, resolution.later
        self._rows = np.zeros((0, 3))  # of steps since the last look: s; N, at start and end
        self._counts_from = 0.0  # s, from when on little has been seen

    def begin(self, now: float) -> None:
        """Steps are short from now (s) on if a vibration begins here."""
        if any(abs(now - t) <= 1e-9 * self._period for t in self.begins):
            self.look, self._rows = now + SEEN * self._period, self._rows[:0]
            self._counts_from = max(now, self._recurs[0])

    def log(self, rows: Floats) -> None:
        """Remember the forces (n, 3) at the ends in steps: s; N, at start and end."""
        if self.look < np.inf:
            self._rows = np.vstack([self._rows, rows])

    def judge(self) -> None:
        """At `look`: longer steps, if a whole period of the motion has shown little of the vibration."""
        if not self.amplitude() <= GONE * self._still:
            self._counts_from = max(self.look, self._recurs[0])
        gone = self.look - self._counts_from >= max(self._recurs[1], SEEN * self._period)
        self.look, self._rows = np.inf if gone else self.look + SEEN * self._period, self._rows[:0]

    def amplitude(self) -> float:
        """Of the larger vibration of the forces at both ends, N, since the last look; infinity: not known."""
        if len(self._rows) < FEWEST:
            return np.inf
        t = (self._rows[:, 0] - self.look) / self._period
        phase = 2.0 * np.pi * t
        smooth = np.polynomial.legendre.legvander(1.0 + 2.0 * t / SEEN, DEGREE)
        fit = np.column_stack([smooth, np.cos(phase), np.sin(phase)])
        found = np.linalg.lstsq(fit, self._rows[:, 1:], rcond=None)[0]
        return float(np.hypot(found[-2], found[-1]).max())

    @property
    def largest(self) -> float:
        """Longest step (s) from here on; infinity: no vibration is shown."""
        if not self.begins:
            return np.inf
        return self._short if self.look < np.inf else self._long

    def checkpoint(self) -> dict[str, Any]:
        """What later steps depend on; look: -1 for none."""
        look = self.look if self.look < np.inf else -1.0
        return {"look": float(look), "from": float(self._counts_from), "rows": self._rows}

    def restore(self, saved: Mapping[str, Any] | None, now: float) -> None:
        """Continue as `checkpoint` has said; None: of a file from before, a vibration may last from now (s) on.

        ValueError: that cannot be.
        """
        if not self.begins:
            return
        span = SEEN * self._period
        if saved is None:
            self._counts_from = max(now, self._recurs[0])
            self.look = now + span if now > self.begins[0] else np.inf
        else:
            found = matched(dict(saved), {"look": 0.0, "from": 0.0, "rows": np.zeros((0, 3))}, "vibration")
            self.look = found["look"] if found["look"] >= 0.0 else np.inf
            self._rows, self._counts_from = found["rows"], found["from"]
            due = self.look == np.inf or now - 1e-9 * span <= self.look <= now + (1.0 + 1e-9) * span
            if not due or self._rows.ndim != 2 or self._rows.shape[1] != 3:
                raise ValueError("a vibration that no run shows")


class VibrationsOfLines(Part):
    """The same of several lines, by name, whose steps are those of the line that asks for the shortest."""

    name, older = "vibrations", MappingProxyType({"vibrations": {}})

    def __init__(self, lines: Mapping[str, VibrationSteps], clock: Clock) -> None:
        """clock: of the run."""
        self._lines, self._clock = lines, clock

    @property
    def begins(self) -> list[float]:
        """When vibrations begin, s."""
        return sorted({t for x in self._lines.values() for t in x.begins})

    @property
    def due(self) -> float:
        """When to look next (s) whether one lasts; infinity: none is there."""
        return min((x.look for x in self._lines.values()), default=np.inf)

    def at_stop(self) -> None:
        """Steps are short from here on if a vibration begins here."""
        for x in self._lines.values():
            x.begin(float(self._clock.now))
        self._bound()

    def log(self, rows: Floats, cpu: Floats) -> None:
        """Remember the forces at the ends of lines in steps, as of `VibrationSteps`."""
        for k, x in enumerate(self._lines.values()):
            x.log(rows[:, k, FORCE_COLUMNS])

    def at_due(self) -> None:
        """Longer steps, of lines that are looked at now, where little of the vibration shows."""
        now = self.due
        for x in self._lines.values():
            if x.look == now:
                x.judge()
        self._bound()

    def _bound(self) -> None:
        if self.begins:
            self._clock.largest = min(x.largest for x in self._lines.values())
            self._clock.next_dt = min(self._clock.next_dt, self._clock.largest)

    def checkpoint(self) -> dict[str, Any]:
        """What later steps depend on, by line."""
        return {"vibrations": {name: x.checkpoint() for name, x in self._lines.items() if x.begins}}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Continue as `checkpoint` has said, as of `VibrationSteps`."""
        for name, x in self._lines.items():
            x.restore(saved["vibrations"].get(name), float(self._clock.now))
        self._bound()
