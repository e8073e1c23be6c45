"""Weights of generalized-alpha for steps that change (docs/theory.md, 2)."""

from __future__ import annotations

from typing import NamedTuple

from hybrid.kernels.compile import inner

# Least distance in time, in steps, between the moments that two algorithmic accelerations stand for: below, the weights
# of a step that is much longer than the one before grow without bound where rho_inf is small.
LEAST_SPAN = 1.0 / 3.0
# A step shorter than the one before by more than this is weighted as if by this: steps that change at random by as much
# stay stable up to rho_inf = 0.9 (tests/solve/test_time_control.py), by 2.5 at every other step they do not.
STEEPEST = 2.0


@inner
def weights(rho, ratio):
    """am, af, ga, be of a step that is 1/ratio as long as the one before, and the constant of its local error.

    At equal steps a stands for the acceleration theta dt later, and v is delta dt^2 a' off; a step of another length
    has weights that carry both over to its own (docs/theory.md, 2), so that tension does not feel the change.  ratio 0:
    a and v are exact, as after a start.  The error of a step is then error dt^2 |a' - a|.
    """
    am = (2.0 * rho - 1.0) / (rho + 1.0)
    af = rho / (rho + 1.0)
    theta = am - af
    delta = (1.0 - 3.0 * theta) / 6.0 - 0.25 * (1.0 - theta) ** 2
    ratio = min(ratio, STEEPEST)
    if theta < 0.0:
        ratio = max(ratio, 1.0 + (1.0 - LEAST_SPAN) / theta)
    span = 1.0 + theta * (1.0 - ratio)  # between the moments that a and a' stand for, in dt
    be = (1.0 / 6.0 - delta * ratio * ratio - 0.5 * theta * ratio) / span
    ga = (0.5 + delta * (1.0 - ratio * ratio) - theta * ratio) / span
    return am / span, af, ga, be, abs(delta) / span


class Scheme(NamedTuple):
    """Weights of a step of dt, and dv'/dr', dvd'/dr'."""

    dt: float  # s
    am: float
    af: float
    ga: float
    be: float
    cv: float  # 1/s
    ca: float  # 1/s2


@inner
def scheme(rho, before, dt):
    """Scheme of a step of dt after one of `before`."""
    am, af, ga, be, _ = weights(rho, before / dt)
    return Scheme(dt, am, af, ga, be, ga / (be * dt), (1.0 - am) / ((1.0 - af) * be * dt * dt))
