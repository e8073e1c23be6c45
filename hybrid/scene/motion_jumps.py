"""Jumps of velocity in a recorded motion, and whether it fits the end that it moves.

The kink test.  At sample i let c_i be the change of slope, c_i = s_i - s_{i-1}.  Where the
motion is smooth, c_i is its acceleration times the local sample spacing, so c_i / spacing
varies slowly from sample to sample; a jump J of velocity adds J to one c_i (or, when it
falls between two samples, shares it between two neighbours).  So one sample, or a pair, is
left out, its c is interpolated from the two samples on each side, and the excess J is a kink if
  - it exceeds ISOLATED times every change of slope among the four samples on either side,
  - it exceeds NEGLIGIBLE of the top speed, and
  - the digits of the file cannot explain it.
A sine of 12 samples a period leaves an excess of 0.01 (single) and 0.1 (pair) of its
neighbours, a sine that starts without ramp 2 and more, the corner of a triangle any number.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hybrid.scene.base import Finding
from hybrid.scene.ends import Triple
from hybrid.scene.motion_file import Record

Array = NDArray[np.float64]

# A velocity jump of 2 % of the top speed is what two-digit data cannot avoid and a cable hardly feels.
NEGLIGIBLE = 0.02

# Half way (in ratio) between the worst smooth signal of 12 samples a period and an unramped sine.
ISOLATED = 1.25

# How many samples on either side count as neighbours: a third of a period at 12 samples a period,
# so the next corner of a triangle is never among them.
NEIGHBOURS = 4

# The file and the scene may round a position differently, but not by more than this part of the excursion.
SAME_START = 1e-3


def judge_record(
    record: Record, position: Triple | None, duration: float | None, blended: bool = False
) -> list[Finding]:
    """What is wrong with a record as motion of an end that starts from rest at `position` ((3,) m, or None).

    blended: a ramp brings it in, so that it may start anywhere with any velocity.
    """
    found: list[Finding] = []
    times = record.times
    if times[0] > 0:
        given = f"{record.name}, which starts at t = {times[0]:.6g} s"
        found.append(Finding(("file",), "a record that starts at t <= 0", "add a row at t = 0", given))
    if duration is not None and times[-1] < duration * (1 - 1e-9):
        given = f"{record.name}, which ends at t = {times[-1]:.6g} s"
        expected = f"a record that covers time.duration, {duration:.6g} s"
        found.append(Finding(("file",), expected, "a longer record or a shorter duration", given))
    if found:
        return found
    if record.shift is not None and position is not None and not blended:
        fix = "make the first row and the position of the end equal, or give `ramp: ...` (s), which blends it in"
        found += _starts_at(record, record.shift, np.array(position), "position", "m", fix)
    if record.rotation is not None and not blended:
        fix = "rotation counts from the tangent of the end: subtract the first row, or give `ramp: ...` (s)"
        found += _starts_at(record, record.rotation, np.zeros(3), "rotation", "deg", fix)
    for values, unit, name, measure in (
        (record.shift, record.shift_unit, "velocity", "m/s"),
        (record.rotation, record.rotation_unit, "angular velocity", "deg/s"),
    ):
        if values is not None and unit is not None:
            jump = first_jump(times, values, unit, math.inf if duration is None else duration, not blended)
            if jump is not None:
                found.append(_jump_finding(record.name, jump, name, measure))
    return found


def _starts_at(record: Record, values: Array, base: Array, what: str, unit: str, fix: str) -> list[Finding]:
    # A record may begin before t = 0; what counts is where it is when the computation begins.
    first = np.array([np.interp(0.0, record.times, column) for column in values.T])
    excursion = float(np.linalg.norm(values - first, axis=1).max())
    if np.linalg.norm(first - base) <= SAME_START * excursion + 1e-9 * float(np.linalg.norm(base)):
        return []
    row = "in its first row" if record.times[0] == 0 else "at t = 0"
    given = f"{record.name}, {_triple(first)} {unit} {row}"
    return [Finding(("file",), f"{_triple(base)} {unit}, the {what} of this end at the start", fix, given)]


def _triple(x: Array) -> str:
    return f"[{x[0]:.8g}, {x[1]:.8g}, {x[2]:.8g}]"


def _jump_finding(name: str, jump: tuple[float, float], what: str, unit: str) -> Finding:
    t, size = jump
    if t == 0.0:
        given = f"{name}, which starts with {size:.4g} {unit}"
        fix = "give `ramp: ...` (s), about two periods, which blends it in, or let the record begin at rest"
        return Finding(("file",), f"no {what} at t = 0, because the cable starts at rest", fix, given)
    given = f"{name}, whose {what} jumps by {size:.4g} {unit} at t = {t:.6g} s"
    return Finding(("file",), f"a smooth {what}", "smooth the record there, or sample it more finely", given)


def first_jump(
    times: Array, values: Array, unit: Array, until: float = math.inf, from_rest: bool = True
) -> tuple[float, float] | None:
    """Time and size of the first jump of velocity in [0, until], None if there is none.

    times: (n,) s; values, unit: (n, 3) samples and what their last digits are worth; from_rest: whether a velocity at
    t = 0 is a jump.
    """
    slopes = np.diff(values, axis=0) / np.diff(times)[:, None]
    top = float(np.linalg.norm(slopes, axis=1).max())
    if top == 0.0:
        return None
    start = [_start_speed(times, values[:, j], unit[:, j]) for j in range(values.shape[1])]
    speed, doubt = float(np.linalg.norm([v for v, _ in start])), float(np.linalg.norm([d for _, d in start]))
    if from_rest and speed > NEGLIGIBLE * top + doubt:
        return 0.0, speed
    least = NEGLIGIBLE * top
    jumps = [j for k in range(values.shape[1]) for j in _kinks(times, values[:, k], unit[:, k], least, from_rest)]
    if not jumps:
        jumps = [j for column in values.T for j in _leap_at_the_end(times, column, NEGLIGIBLE * top)]
    jumps = [(max(t, 0.0), size) for t, size in jumps if 0.0 <= t <= until]
    return min(jumps) if jumps else None


def _start_speed(times: Array, x: Array, unit: Array) -> tuple[float, float]:
    """Speed at t = 0 and how far it may be wrong.

    The quintic through the six samples next to 0, held against the quartic and the cubic through
    five and four of them: their differences bound what sparse sampling leaves open (a few per cent
    at 12 samples a period, nothing that shows at 24).
    """
    i = int(np.searchsorted(times, 0.0, side="right")) - 1
    low = max(0, min(i - (2 if times[0] < 0 else 0), len(times) - 6))
    estimates = []
    for n in (4, 5, 6):
        w = _slope_weights(times[low : low + n])
        estimates.append((float(w @ x[low : low + n]), float(np.abs(w) @ unit[low : low + n]) / 2))
    (cubic, _), (quartic, _), (quintic, noise) = estimates
    return abs(quintic), 2 * max(abs(cubic - quartic), abs(quartic - quintic)) + noise


def _slope_weights(t: Array) -> Array:
    """Weights w with w @ x = p'(0), p the polynomial through the samples (t, x)."""
    scale = t[-1] - t[0]
    u = t / scale
    rhs = np.zeros(len(t))
    rhs[1] = 1.0 / scale
    weights: Array = np.asarray(np.linalg.solve(np.vander(u, increasing=True).T, rhs), dtype=np.float64)
    return weights


def _kinks(times: Array, x: Array, unit: Array, negligible: float, from_rest: bool) -> list[tuple[float, float]]:
    """(time, velocity jump) of every kink of one column."""
    if times[0] == 0.0 and from_rest:
        # The cable is at rest before the record begins, which gives the first samples neighbours.
        n = NEIGHBOURS + 1
        rest = -np.arange(n, 0, -1) * (times[1] - times[0])
        times, x = np.concatenate([rest, times]), np.concatenate([np.full(n, x[0]), x])
        unit = np.concatenate([np.zeros(n), unit])
    h = np.diff(times)
    spacing = (h[:-1] + h[1:]) / 2
    accel = np.diff(np.diff(x) / h) / spacing
    centre = (times[:-2] + times[1:-1] + times[2:]) / 3
    # Every sample may be wrong by half its last digit.
    doubt = ((unit[:-2] + unit[1:-1]) / h[:-1] + (unit[1:-1] + unit[2:]) / h[1:]) / 2 / spacing

    found: list[tuple[int, float]] = []
    for width in (1, 2):
        # Two neighbours on either side; the last two samples of a record have too few to be judged.
        first = np.arange(2, len(accel) - width - 1)
        inside = first[:, None] + np.arange(width)
        near = first[:, None] + np.array([-2, -1, width, width + 1])
        reach = np.r_[-NEIGHBOURS:0, width : width + NEIGHBOURS]
        around = np.clip(first[:, None] + reach, 0, len(accel) - 1)
        w = _weights(centre[near], centre[inside])
        each = np.abs(accel[inside] - np.einsum("nij,nj->ni", w, accel[near])) * spacing[inside]
        excess = each.sum(axis=1)
        unsure = ((doubt[inside] + np.einsum("nij,nj->ni", np.abs(w), doubt[near])) * spacing[inside]).sum(axis=1)
        typical = np.abs(accel[around]).max(axis=1) * spacing[inside].max(axis=1)
        kink = (excess > ISOLATED * typical) & (excess > negligible) & (excess > unsure)
        worst = first + each.argmax(axis=1)
        jump = (np.abs(accel[inside]) * spacing[inside]).max(axis=1)
        sizes = np.abs(accel) * spacing
        for i, size in zip(worst[kink].tolist(), jump[kink].tolist(), strict=True):
            if size <= negligible:  # smooth itself, beside kinks so near each other that they hide each other
                begin = max(i - 2, 0)
                i = begin + int(np.argmax(sizes[begin : i + 3]))
                size = float(sizes[i])
            found.append((i, size))
    # A kink casts its shadow on the samples that are interpolated from it: of neighbours, the largest is meant.
    largest = [k for k in found if all(k[1] >= other[1] for other in found if abs(k[0] - other[0]) <= NEIGHBOURS)]
    return [(float(times[i + 1]), size) for i, size in largest]


def _leap_at_the_end(times: Array, x: Array, negligible: float) -> list[tuple[float, float]]:
    """A leap between the last samples, which have too few neighbours for the kink test: (time, velocity jump).

    A motion of 12 samples a period moves by at most a quarter of its range from one sample to the next, so more
    than half of it, at more than twice the speed just before, is a leap.
    """
    slopes, leaps = np.abs(np.diff(x) / np.diff(times)), np.abs(np.diff(x))
    for i in (len(x) - 3, len(x) - 2):
        jump = float(slopes[i] - slopes[max(i - NEIGHBOURS, 0) : i].max())
        if leaps[i] > 0.5 * np.ptp(x) and jump > 0.5 * slopes[i] and jump > negligible:
            return [(float(times[i]), jump)]
    return []


def _weights(t: Array, at: Array) -> Array:
    """Weights (n, m, 4) that evaluate at `at` (n, m) the cubics through samples at `t` (n, 4) (Lagrange)."""
    w = np.ones((*at.shape, t.shape[1]))
    for j in range(t.shape[1]):
        for k in range(t.shape[1]):
            if k != j:
                w[:, :, j] *= (at - t[:, None, k]) / (t[:, None, j] - t[:, None, k])
    return w
