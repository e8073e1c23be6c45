"""Lengths of steps in a compiled run: equal parts up to a stop, or by the error of the steps before (step_law)."""

from __future__ import annotations

import math

from hybrid.kernels.laws.end_motion import turn_between
from hybrid.kernels.machine.compile import inner
from hybrid.kernels.step import step_law
from hybrid.kernels.step.generalized_alpha import SAME, before_fixed

# A fixed step that fails is halved so often: a factor of 1000 separates a hard moment from a hopeless one.
HALVINGS = 10
step_end, refusal, growth = inner(step_law.step_end), inner(step_law.refusal), inner(step_law.growth)


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
            clock.until = clock.leg_begin + count.leg_part * clock.leg_step
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
def take_past(clock, count):
    """Tell the scheme of the step before a try: its length, s, and its radius."""
    length, radius = clock.last_dt, clock.last_rho
    if not count.controlled:
        length, radius = before_fixed(clock.try_end - clock.now, length, radius, clock.rho)
    clock.step_before, clock.rho_before = length, radius


@inner
def passes(clock, count, dt, error):
    """Whether a step of dt that is wrong by `error` (m) is accepted; chooses the next, or its repetition."""
    ratio = max(error / clock.tolerance, step_law.TINY)
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
        clock.next_dt = clock.tried_dt = max(step_law.FAILED * dt, clock.shortest)
        count.wary = step_law.WARY
    else:
        clock.tried_dt *= 0.5
