"""A small push out of the plane carried along with a motion in it (kernels.out_of_plane), and what its growth says."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hybrid.kernels.state import Floats, Line, State

# Growth of the push's speed at which the plane no longer holds: a disturbance of a thousandth of the length, which
# every real cable has, would by then be as large as the cable; swings that come and go stay below a tenth of that.
GROWN = 1e3
# A push that has died to this part is given anew, so that an instability that begins late is seen as early.
DIED = 1e-3
# Sines over the length whose sum is the push: enough that no mode of a line that could grow is left out.
SINES = 6
NOTHING: Floats = np.zeros((0, 4))


class Push:
    """Displacement, rate and accelerations (N+1, 4) of a push across the plane, before and after a step."""

    def __init__(self, line: Line, length: float, time_scale: float) -> None:
        self.s, self._unit = line.s, length / time_scale
        self._pair = (self._seed(line.s), np.zeros((line.s.size, 4)))
        self._led: State | None = None  # the state that the step to `now` has led to
        self._energy = np.nan  # of the push when it was given, J; unknown before its first step

    def checkpoint(self, state: State) -> dict[str, Any]:
        """The push and what is known of its growth; state: that of the motion now."""
        energy = self._energy if self._energy > 0.0 else 0.0
        return {"pair": np.array(self._pair), "unit": self._unit, "energy": energy, "led": self._led is state}

    def restore(self, saved: Mapping[str, Any], state: State) -> None:
        """Go on as `checkpoint` has said; ValueError where that cannot be."""
        self._pair, self._unit, self._energy = tuple(saved["pair"]), saved["unit"], saved["energy"] or np.nan
        self._led = state if saved["led"] else None
        if not self._unit > 0.0:
            raise ValueError("a push of no size")

    def _seed(self, s: Floats) -> Floats:
        """Velocities of the size of the unit, and nothing else."""
        out, x = np.zeros((s.size, 4)), s / s[-1]
        for k in range(1, SINES + 1):
            out[:, 1] += self._unit * np.sin(k * np.pi * x + 0.3 * k) / k
        return out

    def pair(self, old: State, new: State) -> tuple[Floats, Floats]:
        """Arrays before and after a step from `old` to `new`; one that starts where the last one led has taken it."""
        if old is self._led:
            self._pair = self._pair[::-1]
        self._led = new
        return self._pair

    def judge(self, energy: float, wrong: float) -> float:
        """By how much the speed has grown since the push was given, after a step; infinite where it has no bound."""
        if wrong or not np.isfinite(energy):
            return np.inf
        if not self._energy > 0.0:
            self._energy = energy
        grown = float(np.sqrt(energy / self._energy)) if self._energy > 0.0 else 0.0
        if grown < DIED:
            self.renew()
        return grown

    def renew(self) -> None:
        """Give it anew."""
        self._pair[1][:] = self._seed(self.s)
        self._energy = np.nan

    def on(self, s: Floats) -> None:
        """Carry it to a line with other nodes, in proportion to s; what lay before the last step is forgotten."""
        if s is self.s:
            return
        now = _on_cubics(self._pair[1], self.s, s)
        self._pair, self.s, self._led = (now, np.zeros_like(now)), s, None

    def last(self, size: float) -> Floats:
        """The push after the last step (N+1, 4), so that nothing moves by more than `size` m of its displacement."""
        now = self._pair[1]
        largest = float(np.abs(now[:, 0]).max())
        if not 0.0 < largest < np.inf:
            now, largest = self._seed(self.s), self._unit
        return np.asarray(now * (size / largest))


def _on_cubics(x: Floats, s: Floats, at: Floats) -> Floats:
    """x (N+1, k) at other nodes, on cubics with the slopes of parabolas: a rod would feel the kinks of chords."""
    slope = np.gradient(x, s, axis=0)
    j = np.clip(np.searchsorted(s, at, side="right") - 1, 0, s.size - 2)
    h = (s[j + 1] - s[j])[:, None]
    q = (at - s[j])[:, None] / h
    near = (1.0 - q) ** 2 * ((1.0 + 2.0 * q) * x[j] + q * h * slope[j])
    return np.asarray(near + q * q * ((3.0 - 2.0 * q) * x[j + 1] - (1.0 - q) * h * slope[j + 1]))
