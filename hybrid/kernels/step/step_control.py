"""Lengths of steps in a compiled run: equal parts up to a stop, or by the error of the steps before (step_law)."""

from __future__ import annotations

import math

from hybrid.kernels.laws.end_motion import turn_between
from hybrid.kernels.machine.compile import inner
from hybrid.kernels.state.books import (
    ALLOWED,
    BEGIN,
    CONTROLLED,
    CUT_ANGLE,
    CUT_STEP,
    ERROR_RATIO,
    LARGEST,
    LAST_DT,
    LAST_RHO,
    LEG_BEGIN,
    LEG_PART,
    LEG_PARTS,
    LEG_STEP,
    MOST_TURN,
    NEXT_DT,
    NOW,
    REPEATS,
    RHO,
    RHO_BEFORE,
    SHORTEST,
    STEP_BEFORE,
    STOP,
    TAKEN,
    TOLERANCE,
    TRIED_DT,
    TRY_END,
    UNTIL,
    WARY,
)
from hybrid.kernels.step import step_law
from hybrid.kernels.step.generalized_alpha import SAME, before_fixed

# A fixed step that fails is halved so often: a factor of 1000 separates a hard moment from a hopeless one.
HALVINGS = 10
step_end, refusal, growth = inner(step_law.step_end), inner(step_law.refusal), inner(step_law.growth)


@inner
def begin_step(clock, count):
    """Choose where the next step should end."""
    clock[BEGIN] = clock[NOW]
    if count[CONTROLLED]:
        clock[UNTIL] = step_end(clock[NOW], clock[STOP], min(clock[NEXT_DT], clock[ALLOWED]))
    else:
        count[LEG_PART] += 1
        clock[UNTIL] = clock[STOP]
        if count[LEG_PART] < count[LEG_PARTS]:
            clock[UNTIL] = clock[LEG_BEGIN] + count[LEG_PART] * clock[LEG_STEP]
    clock[TRIED_DT] = clock[UNTIL] - clock[NOW]
    if not count[CONTROLLED]:
        clock[SHORTEST] = clock[TRIED_DT] * 0.5**HALVINGS
    count[REPEATS] = count[TAKEN] = 0


@inner
def end_of_try(clock, moves):
    """Time at which the present try ends; earlier where an end of the cable would turn too far in it."""
    end = clock[NOW] + clock[TRIED_DT]
    if clock[UNTIL] - end <= SAME * clock[TRIED_DT]:  # what rounding of late times leaves is no step of its own
        end = clock[UNTIL]
    angle = turn_between(clock[NOW], end, moves)
    while angle > clock[MOST_TURN]:
        clock[CUT_ANGLE], clock[CUT_STEP] = angle, end - clock[NOW]
        end = clock[NOW] + (end - clock[NOW]) / math.ceil(angle / clock[MOST_TURN])
        angle = turn_between(clock[NOW], end, moves)
    return end


@inner
def take_past(clock, count):
    """Tell the scheme of the step before a try: its length, s, and its radius."""
    length, radius = clock[LAST_DT], clock[LAST_RHO]
    if not count[CONTROLLED]:
        length, radius = before_fixed(clock[TRY_END] - clock[NOW], length, radius, clock[RHO])
    clock[STEP_BEFORE], clock[RHO_BEFORE] = length, radius


@inner
def passes(clock, count, dt, error):
    """Whether a step of dt that is wrong by `error` (m) is accepted; chooses the next, or its repetition."""
    ratio = max(error / clock[TOLERANCE], step_law.TINY)
    shorter = refusal(dt, ratio, clock[SHORTEST])
    if shorter > 0.0:
        clock[NEXT_DT] = clock[TRIED_DT] = shorter
        return False
    count[WARY] = max(count[WARY] - 1, 0)
    factor = growth(ratio, clock[ERROR_RATIO], count[WARY])
    clock[ERROR_RATIO] = ratio
    clock[NEXT_DT] = min(max(dt * factor, clock[SHORTEST]), clock[LARGEST])
    return True


@inner
def halve(clock, count, dt):
    """Repeat a step of dt that failed with half its length."""
    if count[CONTROLLED]:
        clock[NEXT_DT] = clock[TRIED_DT] = max(step_law.FAILED * dt, clock[SHORTEST])
        count[WARY] = step_law.WARY
    else:
        clock[TRIED_DT] *= 0.5
