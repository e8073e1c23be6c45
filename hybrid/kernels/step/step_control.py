"""Lengths of steps, by their error or in equal parts, and the weights of generalized-alpha for them.

Weights are those of docs/theory.md, 2.  Lengths are equal parts up to a stop, or go by the error of the steps before.
A step's error is of third order in its length.  The controller is proportional and integral (Gustafsson 1991;
Soederlind 2003): the integral part aims at the tolerance, the proportional one damps the reaction to an error that
jumps about, as it does over contact.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from hybrid.kernels.laws.end_motion import turn_between
from hybrid.kernels.machine.compile import inner

# --- the law by which steps follow their error -------------------------------------------------

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


@inner
def step_end(t: float, stop: float, length: float) -> float:
    """Where a step of at most `length` from t should end, so that the last two before `stop` are equal; s."""
    parts = (stop - t) / length * (1.0 - 1e-9) - 1e-9
    if parts <= 1.0:
        return stop
    return t + (length if parts > 2.0 else 0.5 * (stop - t))


@inner
def refusal(dt: float, ratio: float, shortest: float) -> float:
    """The length to repeat a step of dt with whose error is `ratio` times the tolerance, s; 0: it passes."""
    if ratio > REFUSED and dt > shortest * (1.0 + 1e-9):
        return max(dt * max(SAFETY * ratio ** (-1.0 / 3.0), LEAST), shortest)
    return 0.0


@inner
def growth(ratio: float, before: float, wary: int) -> float:
    """Length of the next step over that of the last, by its error and that of the one before, over the tolerance."""
    factor = SAFETY * ratio**-INTEGRAL * (before / ratio) ** PROPORTIONAL
    return min(max(factor, LEAST), 1.0 if wary > 0 else MOST)


# --- weights, and steps of a run ---------------------------------------------------------------

# Least distance in time, in steps, between the moments that the algorithmic accelerations of a step and of the one
# before stand for: the weights grow as its inverse.
LEAST_SPAN = 0.5
# A step shorter than the one before by more than this is weighted as if by this: where a load turns in it, what the
# longer one would hand over has nothing to do with the shorter.
STEEPEST = 2.0
# By how much of rho_inf the radius grows again from step to step after one that changed its length.
RECOVERY = 0.25
# The radius of a step whose length differs a little from that of the one before is this at most.
LARGEST_RADIUS = 0.8
# Part of a step by which lengths of steps may differ that are the same but for round-off of the time.
SAME = 1e-6
# A fixed step after a shorter part of it than this begins as after a start.
LEAST_PART = 0.5


@inner
def lead(rho):
    """theta: by how many steps the moment that the algorithmic acceleration stands for is later than the step's end."""
    return (2.0 * rho - 1.0) / (rho + 1.0) - rho / (rho + 1.0)


@inner
def radius_of_step(rho, before, rho_before, dt):
    """Spectral radius at infinity of a step of dt after one of `before` with the radius rho_before; rho: on equal steps.

    The more the length changes, the smaller it may be at most: what steps that change in turn would otherwise excite is
    damped.  A step twice or half as long has 0, where the moments of both accelerations are far enough apart.
    """
    least = LEAST_SPAN - 1.0
    if before > 0.0:
        ratio = before / dt
        least += lead(rho_before) * min(ratio, STEEPEST)
        change = abs(math.log2(ratio))
        rho = min(rho, rho_before + RECOVERY * rho)
        if change > SAME:
            rho = min(rho, LARGEST_RADIUS * max(0.0, 1.0 - change))
    least = min(least, 0.0)
    return rho if lead(rho) >= least else (1.0 + least) / (1.0 - least)


@inner
def before_fixed(dt, last, last_rho, rho):
    """Length, s, and spectral radius of the step before one of dt, as the weights of fixed steps take them.

    last, last_rho: those of the step before; 0 s: there is none.  rho: the radius of equal steps.  A start has the
    weights of equal steps, and so has a step that follows parts of less than half its length: with what they hand over
    it would feed vibrations that it does not resolve.  So has one of radius 0, as near contact, where forces turn
    within a step and the step before says nothing of them.
    """
    if rho == 0.0 or last < LEAST_PART * dt * (1.0 - SAME):
        return dt, rho
    return (dt if abs(last - dt) <= SAME * dt else last), last_rho


@inner
def weights(rho, rho_before, ratio):
    """am, af, ga, be of a step that is 1/ratio as long as the one before, and the constant of its local error.

    At equal steps a stands for the acceleration theta dt later, and v is delta dt^2 a' off, both by the radius of the
    step; the weights carry over those of the step before to those of this one (docs/theory.md, 2), so that tension does
    not feel the change.  ratio 0: a and v are exact, as after a start.  The error of a step is then error dt^2 |a' - a|.
    """
    am = (2.0 * rho - 1.0) / (rho + 1.0)
    af = rho / (rho + 1.0)
    theta = am - af
    theta_before = (2.0 * rho_before - 1.0) / (rho_before + 1.0) - rho_before / (rho_before + 1.0)
    delta = (1.0 - 3.0 * theta) / 6.0 - 0.25 * (1.0 - theta) ** 2
    ratio = min(ratio, STEEPEST)
    early = theta_before * ratio
    off = ((1.0 - 3.0 * theta_before) / 6.0 - 0.25 * (1.0 - theta_before) ** 2) * ratio * ratio
    span = 1.0 + (theta - early)  # between the moments that a and a' stand for, in dt
    be = (1.0 / 6.0 - off - 0.5 * early) / span
    ga = (0.5 + (delta - off) - early) / span
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
def scheme(rho, before, rho_before, dt):
    """Scheme of a step of dt with the radius rho (`radius_of_step`), after one of `before` with the radius rho_before."""
    am, af, ga, be, _ = weights(rho, rho_before, before / dt)
    return Scheme(dt, am, af, ga, be, ga / (be * dt), (1.0 - am) / ((1.0 - af) * be * dt * dt))


# A fixed step that fails is halved so often: a factor of 1000 separates a hard moment from a hopeless one.
HALVINGS = 10


NANOSECONDS = 1e9  # 1/s: a time of few decimals is a whole number of them
ROUND_OFF = 5e-16  # of a time: what a sum of equal steps, each rounded, is off


@inner
def decimal_time(t: float) -> float:
    """A time (s) that equal steps lead to, in as few decimals as it has: 0.7 for 7 times 0.1, 0.7000000000000001."""
    near = math.floor(t * NANOSECONDS + 0.5) / NANOSECONDS
    return near if abs(near - t) <= ROUND_OFF * abs(t) else t


@inner
def begin_step(clock, count):
    """Choose where the next step should end."""
    clock.begin = clock.now
    if count.controlled:
        clock.until = step_end(clock.now, clock.stop, min(clock.next_dt, clock.allowed))
    else:
        count.leg_part += 1
        clock.until = clock.stop
        if count.leg_part < count.leg_parts:
            clock.until = decimal_time(clock.leg_begin + count.leg_part * clock.leg_step)
    clock.tried_dt = clock.until - clock.now
    if not count.controlled:
        clock.shortest = clock.tried_dt * 0.5**HALVINGS
    count.repeats = count.taken = 0


@inner
def end_of_try(clock, moves):
    """Time at which the present try ends; earlier where an end of the cable would turn too far in it."""
    end = clock.now + clock.tried_dt
    if clock.until - end <= SAME * clock.tried_dt:  # what rounding of late times leaves is no step of its own
        end = clock.until
    angle = turn_between(clock.now, end, moves)
    while angle > clock.most_turn:
        clock.cut_angle, clock.cut_step = angle, end - clock.now
        end = clock.now + (end - clock.now) / math.ceil(angle / clock.most_turn)
        angle = turn_between(clock.now, end, moves)
    return end


@inner
def note_past(clock, count):
    """Tell the scheme of the step before a try: its length, s, and its radius."""
    length, radius = clock.last_dt, clock.last_rho
    if not count.controlled:
        length, radius = before_fixed(clock.try_end - clock.now, length, radius, clock.rho)
    clock.step_before, clock.rho_before = length, radius


@inner
def passes(clock, count, dt, error):
    """Whether a step of dt that is wrong by `error` (m) is accepted; chooses the next, or its repetition."""
    ratio = max(error / clock.tolerance, TINY)
    shorter = refusal(dt, ratio, clock.shortest)
    if shorter > 0.0:
        clock.next_dt = clock.tried_dt = shorter
        return False
    count.wary = max(count.wary - 1, 0)
    factor = growth(ratio, clock.error_ratio, count.wary)
    clock.error_ratio = ratio
    clock.next_dt = min(max(dt * factor, clock.shortest), clock.largest)
    return True


@inner
def halve(clock, count, dt):
    """Repeat a step of dt that failed with half its length."""
    if count.controlled:
        clock.next_dt = clock.tried_dt = max(FAILED * dt, clock.shortest)
        count.wary = WARY
    else:
        clock.tried_dt *= 0.5
