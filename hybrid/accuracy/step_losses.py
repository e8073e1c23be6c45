"""What steps lose of free vibrations, when that is worth a word, and what a motion leaves of them.

A ramp or a move of an end leaves vibrations in a line, which steps make late or lose (accuracy.free_vibrations has the
modes).  docs/errors.md
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from itertools import pairwise
from math import pi
from typing import Any, NamedTuple

import numpy as np

from hybrid.kernels.state.state import Floats
from hybrid.scene.motion_tables import Motion
from hybrid.simulation.run_sample import END_FORCES, RunSample

RAW = {shown: raw for raw, shown in END_FORCES.items()}
UNITS = {
    "position": "m", "tension": "N", "curvature": "1/m", "bending_moment": "N m", **dict.fromkeys(RAW, "N"),
}  # fmt: skip

# A motion is integrated by Gauss's rule, in at least as many pieces as it has periods of a vibration.
GAUSS = 8  # points of the rule
FEWEST_PIECES = 8  # at least
MOST_PERIODS = 200  # modes with more are left out: a ramp that is so long leaves nothing
# Frequencies of a motion and of a vibration count as different by at least so many rad in the duration.
CLOSE = 1.0
# An error by steps that this makes is worth a word where it exceeds what is asked, and the error figure so many times;
# where nothing is asked, this part of the largest value.
TIMES_THE_FIGURE, PART = 1.5, 0.01
ROWS = 20_000  # times at most; of longer runs some of theirs,
BLOCK = 2000  # so many at a time


class Lost(NamedTuple):
    """What steps make of free vibrations in a quantity: its largest error, and the vibration that makes most of it."""

    error: float  # m, N, N m or 1/m
    amplitude: float  # of all of them together, in the same unit
    period: float  # s
    step: float  # s, that leaves an error of a tenth of this


LostBy = Mapping[str, Lost]  # by quantity


def uncertain_by_vibrations(
    found: LostBy, result: RunSample, errors: Mapping[str, float], allowed: Mapping[str, float] | None
) -> list[tuple[str, str]]:
    """The event that says so where steps lose more of free vibrations than error figures show.

    found: what they lose; errors: figures, by quantity; allowed: errors that are asked, None: nothing is.
    """
    least = _worth_a_word(result, errors, allowed)
    over = {name: found[name].error / x for name, x in least.items() if name in found}
    of = max(over, key=lambda name: over[name], default="")
    if not (of and over[of] > 1.0):
        return []
    lost, unit = found[of], UNITS[of]
    steps = np.diff(result.forces[:, 0])
    text = (
        f"{of.replace('end_force_', 'force at the ').replace('_', ' ')}: a free vibration with a period of "
        f"{lost.period:.2g} s is left by the ramp or move of an end, up to {lost.amplitude:.2g} {unit}, which hardly "
        f"anything damps; steps of {float(np.median(steps)):.2g} s make it late or lose it, an error of up to "
        f"{lost.error:.2g} {unit}, which the error figure ({errors[of]:.2g} {unit}) does not see; time.step: "
        f"{lost.step:.2g} shows it, damping ends it, and a longer ramp or move leaves less of it"
    )
    return [("error uncertain", text)]


def _worth_a_word(
    result: RunSample, errors: Mapping[str, float], allowed: Mapping[str, float] | None
) -> dict[str, float]:
    """Errors by quantity beyond which they are said; arguments as of `uncertain_by_vibrations`."""
    found = {}
    for name in errors:
        values = result.values.get(RAW.get(name, name))
        if name not in UNITS or values is None or (allowed is not None and name not in allowed):
            continue
        if allowed is None:
            sizes = np.asarray(values)
            sizes = np.linalg.norm(sizes, axis=-1) if name == "position" or name in RAW else sizes
            least = PART * float(np.abs(sizes).max())
        else:
            least = allowed[name]
        found[name] = max(least, TIMES_THE_FIGURE * errors[name])
    return {name: x for name, x in found.items() if x > 0.0}


def quiet_from(motion: Motion) -> float | None:
    """When a motion is one of harmonics alone, s; None: never."""
    if motion.file is not None or motion.follow is not None or motion.vessel is not None:
        return None
    return max(breaks_of(motion))


def breaks_of(motion: Motion) -> tuple[float, ...]:
    """Times, s, at which something in a motion begins or ends."""
    travel = motion.travel
    return (0.0, motion.ramp or 0.0, *(() if travel is None else (travel.begin, travel.begin + travel.over)))


def harmonic_until(quiet: float, o: float, w: Floats, unit: Any, duration: float) -> Floats:
    """Integral until `quiet` (s) of  u'' exp(-i w t)  for  u = Re(unit exp(-i o t))  that has grown slowly, (m,)."""
    near = np.where(o < w, -1.0, 1.0) * np.maximum(np.abs(o - w), CLOSE / duration)
    up = unit.conj() * np.exp(1j * near * quiet) / (1j * near)
    down = unit * np.exp(-1j * (o + w) * quiet) / (-1j * (o + w))
    return np.asarray(-o * o / 2.0 * (up + down))


def gauss(breaks: list[float], quiet: float, w: float) -> tuple[Floats, Floats]:
    """Times until `quiet`, s, and their weights in an integral over motions and vibrations of up to w; and `quiet`."""
    x, each = np.polynomial.legendre.leggauss(GAUSS)
    times, weights = [np.zeros(0)], [np.zeros(0)]
    for a, b in pairwise([x for x in breaks if x < quiet] + [quiet]):
        ends = np.linspace(a, b, max(FEWEST_PIECES, int(w * (b - a) / pi)) + 1)
        half = 0.5 * (ends[1] - ends[0])
        times.append((ends[:-1, None] + half * (1.0 + x)).ravel())
        weights.append(np.tile(half * each, ends.size - 1))
    return np.concatenate([*times, [quiet]]), np.concatenate(weights)


@cache
def _factors(radius: float) -> tuple[Floats, Floats]:
    """Angles of a step, rad, and the logs of factors at them, of a spectral radius."""
    at = np.geomspace(1e-3, 1e3, 600)  # rad to a step
    am, af = (2.0 * radius - 1.0) / (radius + 1.0), radius / (radius + 1.0)
    ga = 0.5 - am + af
    be = 0.25 * (1.0 - am + af) ** 2
    w2 = at**2
    below = (1.0 - am) + w2 * (1.0 - af) * be
    new = np.stack([-w2, -w2 * (1.0 - af), -am - w2 * (1.0 - af) * (0.5 - be)], axis=-1) / below[:, None]
    one = np.ones_like(w2)
    rows = [np.stack(x, axis=-1) for x in ((one, one, (0.5 - be) * one), (0 * one, one, (1.0 - ga) * one))]
    matrix = np.stack([rows[0] + be * new, rows[1] + ga * new, new], axis=1)
    roots = np.linalg.eigvals(matrix)
    root = roots[np.arange(w2.size), roots.imag.argmax(axis=1)]
    return at, np.log(np.abs(root)) + 1j * (np.abs(np.angle(root)) - at)


class Factors:
    """By what generalized-alpha multiplies a free vibration in a step, over what the vibration itself does: its log."""

    def __init__(self, radius: float) -> None:
        self._at, self._log = _factors(radius)

    def of(self, angle: Floats) -> Floats:
        """Of steps of so many radians; of short ones as their cube."""
        inside, cube = np.maximum(angle, self._at[0]), np.minimum(angle / self._at[0], 1.0) ** 3
        return np.asarray(np.interp(inside, self._at, self._log) * cube)

    def drift(self, w: Floats, t: Floats) -> tuple[Floats, Floats]:
        """(times, m) since the start, and these times, s: of all steps, or of so many as fit into memory."""
        every = -(-len(t) // ROWS)
        parts, now = [np.zeros((1, w.size), complex)], np.zeros(w.size, complex)
        for a in range(0, len(t) - 1, every * BLOCK):
            steps = self.of(np.outer(np.diff(t[a : a + every * BLOCK + 1]), w))
            sums = now + np.cumsum(np.add.reduceat(steps, np.arange(0, len(steps), every)), axis=0)
            parts, now = [*parts, sums], sums[-1]
        return np.vstack(parts), np.append(t[:-1:every], t[-1])

    def step(self, w: float, duration: float) -> float:
        """The step, s, that leaves a tenth of the vibration wrong at the end."""
        angle = np.geomspace(1e-3, 1.0, 200)
        fits = np.abs(1.0 - np.exp(self.of(angle) * (w * duration / angle))) <= 0.1
        return float(angle[fits].max(initial=angle[0]) / w)
