"""Steps that have become so short that a run may not end: since when, what cuts them, and where."""

from __future__ import annotations

from collections.abc import Mapping

from hybrid.kernels.step.accept import MANY, TINY

# Kind of the event.
COLLAPSE = "steps collapse"
# Steps so short, one after the other, after which a run that is only to be compared with is given up.
GIVE_UP = 10 * MANY
GAIN, TURN, NEWTON, ERROR = "gain", "turn", "newton", "error"
# What cuts steps, and what to do about it.
CAUSES = {
    GAIN: ("energy that contact puts in", "shorter cells there"),
    TURN: ("cells that turn by more than a step allows", "cells as long as the bend there, or damping"),
    NEWTON: ("Newton's method, which does not converge", "more cells where the cable bends, or damping"),
    ERROR: ("the error that a step makes", "a larger accuracy or time.tolerance, or damping of what is fast there"),
}
TOUCHES_ITSELF = "; the line touches itself there, and contact: {self: false} leaves that out"
TOUCH_EACH_OTHER = "; lines touch each other there, and contact: {between: []} leaves that out"


def collapse_text(steps: int, dt: float, longest: float, cuts: Mapping[str, int], s: float, contact: str) -> str:
    """Text of the event of so many steps in a row, the last of dt (s), the longest of the run before.

    cuts: tries that were given up, by cause; s: m, where the last was; contact: what touches now, TOUCHES_ITSELF or
    TOUCH_EACH_OTHER; empty: nothing.
    """
    text = (
        f"the last {steps} steps were shorter than {TINY:g} of the longest, {longest:.3g} s; the last took {dt:.3g} s"
    )
    most = max(cuts, key=lambda cause: cuts[cause], default="")
    if not most or not cuts[most]:
        return f"{text}; they grow no faster{contact}"
    given = ", ".join(f"{CAUSES[x][0]} ({n})" for x, n in sorted(cuts.items(), key=lambda each: -each[1]) if n)
    return f"{text}; tries were cut by {given}, last at s = {s:.6g} m: {CAUSES[most][1]}{contact}"
