"""Vibrations along a line that prescribed motions of its ends set off where they begin, and where their ramps end.

A ramp 10 x^3 - 15 x^4 + 6 x^5 (scene/motion.py) has third and higher derivatives that jump at its ends.  Of a bar of
stiffness k and frequency w whose end moves by u(t), jumps J_n of the n-th derivatives leave a free vibration of
k |sum J_n (i/w)^n|: the solution u - u''/w^2 + u''''/w^4 - .. of q''/w^2 + q = u has to be met in value and rate.
A small motion is a large force there: steps that follow the motion in metres damp it, and so do the longer steps of the
runs that errors are estimated by.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import comb, hypot, pi, radians, sin, sqrt, tan
from typing import NamedTuple

from hybrid.scene.cable import Cable
from hybrid.scene.motion_tables import SHIFTS, Motion
from hybrid.scene.schema import LineScene

# Derivatives of the ramp by x where it begins and where it ends, by their order, and the highest that counts.  Of a
# ramp that is shorter than the period the sum may be too large, which makes steps shorter than they need to be.
AT_BEGIN, AT_END, HIGHEST = {3: 60.0, 4: -360.0, 5: 720.0}, {3: 60.0, 4: 360.0, 5: 720.0}, 6


class Vibration(NamedTuple):
    """Of the force along a line, from t (s) on: its amplitude (N) and its period (s)."""

    t: float
    force: float
    period: float


def strain_travel(cable: Cable) -> float | None:
    """Time, s, in which strain runs along a cable; None: some of it does not stretch."""
    if any(x.stiffness is None for x in cable.sections):
        return None
    return sum(x.length * sqrt(x.mass / x.stiffness) for x in cable.sections if x.stiffness)


def longest_period(cable: Cable) -> float | None:
    """The longest period, s, of strain along a cable; None: nothing of it stretches.

    That of a bar which is held at one end, 4 L/c, with what does not stretch as a mass M at the other: frequencies are
    x c/L with x tan x = m/M, m the mass of the bar.
    """
    stretches = [x for x in cable.sections if x.stiffness]
    if not stretches:
        return None
    travel = sum(x.length * sqrt(x.mass / x.stiffness) for x in stretches if x.stiffness)
    bar, rigid = (sum(x.length * x.mass for x in cable.sections if bool(x.stiffness) == y) for y in (True, False))
    low, high = 0.0, 0.5 * pi
    while rigid and high - low > 1e-9:
        x = 0.5 * (low + high)
        low, high = (x, high) if x * tan(x) * rigid < bar else (low, x)
    return 2.0 * pi * travel / high


def start_vibrations(scene: LineScene) -> list[Vibration]:
    """What harmonic motions with a ramp, and moves to another place, set off; none in a line that does not stretch."""
    period = longest_period(scene.cable)
    if period is None:
        return []
    w, k = 2.0 * pi / period, 1.0 / sum(x.length / x.stiffness for x in scene.cable.sections if x.stiffness)
    found = []
    for motion in (end.prescribed_motion for end in scene.ends.both):
        if motion is None:
            continue
        if motion.ramp:
            found += [Vibration(t, k * _left(motion, motion.ramp, t, w), period) for t in (0.0, motion.ramp)]
        if motion.travel is not None:
            over, begin = motion.travel.over, motion.travel.begin
            left = hypot(*motion.travel.by) * abs(_jump(over, AT_BEGIN, w, [1.0]))
            found += [Vibration(t, k * left, period) for t in (begin, begin + over)]
    return found


def _left(motion: Motion, ramp: float, t: float, w: float) -> float:
    """Amplitude, m, that the begin or the end t of a ramp leaves at frequency w."""
    jumps, ends = [], AT_END if t > 0.0 else AT_BEGIN
    for listed in (found for name, found in motion.harmonics().items() if name in SHIFTS):
        left = 0j
        for h in listed:
            o, phase = 2.0 * pi / h.period, 2.0 * pi * t / h.period + radians(h.phase)
            left += _jump(ramp, ends, w, [h.amplitude * o**n * sin(phase + 0.5 * n * pi) for n in range(HIGHEST + 1)])
        jumps.append(abs(left))
    return hypot(*jumps)


def _jump(ramp: float, ends: Mapping[int, float], w: float, derivatives: Sequence[float]) -> complex:
    """Sum of J_n (i/w)^n where a ramp, with derivatives `ends` there, multiplies a function with these."""
    left = 0j
    for n in range(min(ends), HIGHEST + 1):
        each = [(k, n - k) for k in ends if 0 <= n - k < len(derivatives)]
        left += sum(comb(n, k) * ends[k] / ramp**k * derivatives[m] for k, m in each) * (1j / w) ** n
    return left
