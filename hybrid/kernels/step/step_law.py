"""The law by which steps follow their error: plain functions, compiled for the run by kernels.step.step_control.

A step's error is of third order in its length.  The controller is proportional and integral (Gustafsson 1991;
Soederlind 2003): the integral part aims at the tolerance, the proportional one damps the reaction to an error that
jumps about, as it does over contact.  docs/theory.md, 2.
"""

from __future__ import annotations

# Share of the tolerance aimed at: steps that come out a little worse than predicted still pass.
SAFETY = 0.8
# Exponents on tolerance/error and on the error before over the error now, for an error of order 3 (Gustafsson).
INTEGRAL, PROPORTIONAL = 0.7 / 3.0, 0.4 / 3.0
# Bounds on the change from step to step: beyond them a step is damped as much as it can be
# (kernels.step.step_control.radius_of_step).
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


def step_end(t: float, stop: float, length: float) -> float:
    """Where a step of at most `length` from t should end, so that the last two before `stop` are equal; s."""
    parts = (stop - t) / length * (1.0 - 1e-9) - 1e-9
    if parts <= 1.0:
        return stop
    return t + (length if parts > 2.0 else 0.5 * (stop - t))


def refusal(dt: float, ratio: float, shortest: float) -> float:
    """The length to repeat a step of dt with whose error is `ratio` times the tolerance, s; 0: it passes."""
    if ratio > REFUSED and dt > shortest * (1.0 + 1e-9):
        return max(dt * max(SAFETY * ratio ** (-1.0 / 3.0), LEAST), shortest)
    return 0.0


def growth(ratio: float, before: float, wary: int) -> float:
    """Length of the next step over that of the last, by its error and that of the one before, over the tolerance."""
    factor = SAFETY * ratio**-INTEGRAL * (before / ratio) ** PROPORTIONAL
    return min(max(factor, LEAST), 1.0 if wary > 0 else MOST)
