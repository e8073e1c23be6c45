"""Steps that have become so short that a run may not end: since when, what cuts them, and where."""

from __future__ import annotations

from collections.abc import Mapping

from hybrid.errors import Outcome
from hybrid.kernels.accept import MANY, TINY

# Kind of the event.
COLLAPSE = "steps collapse"
# Steps so short, one after the other, after which a run that is only to be compared with is given up.
GIVE_UP = 10 * MANY
GAIN, TURN, NEWTON, ERROR = "gain", "turn", "newton", "error"
# What cuts steps, and what to do about it.
CAUSES = {
    GAIN: ("energy that contact of the line with itself puts in", "shorter cells there, or contact: {self: false}"),
    TURN: ("cells that turn by more than a step allows", "cells as long as the bend there, or damping"),
    NEWTON: ("Newton's method, which does not converge", "more cells where the cable bends, or damping"),
    ERROR: ("the error that a step makes", "a larger accuracy or time.tolerance, or damping of what is fast there"),
}
CONTACT = "; the line touches itself there, and contact: {self: false} leaves that out"


def cause_of(outcome: Outcome) -> str:
    """What cuts a step whose try has ended so."""
    return GAIN if outcome == Outcome.GAINS_ENERGY else TURN if outcome == Outcome.TURNED_TOO_FAR else NEWTON


def collapse_text(steps: int, dt: float, longest: float, cuts: Mapping[str, int], s: float, touches: bool) -> str:
    """Text of the event of so many steps in a row, the last of dt (s), the longest of the run before.

    cuts: tries that were given up, by cause; s: m, where the last was; touches: whether the line touches itself now.
    """
    text = (
        f"the last {steps} steps were shorter than {TINY:g} of the longest, {longest:.3g} s; the last took {dt:.3g} s"
    )
    most = max(cuts, key=lambda cause: cuts[cause], default="")
    if not most or not cuts[most]:
        return f"{text}; they grow no faster{CONTACT if touches else ''}"
    given = ", ".join(f"{CAUSES[x][0]} ({n})" for x, n in sorted(cuts.items(), key=lambda each: -each[1]) if n)
    return f"{text}; tries were cut by {given}, last at s = {s:.6g} m: {CAUSES[most][1]}{CONTACT if touches else ''}"


class StepLengths:
    """The same of lines whose steps Python makes."""

    def __init__(self) -> None:
        self.longest, self.tiny = 0.0, 0
        self.cuts: dict[str, int] = {}
        self.at = (0, 0.0)  # line and place, m, of the last try that was cut

    def cut(self, cause: str, line: int, s: float) -> None:
        """A try is given up."""
        self.cuts[cause] = self.cuts.get(cause, 0) + 1
        self.at = max(line, 0), s

    def taken(self, dt: float) -> bool:
        """Whether steps have collapsed after one of dt (s), and somebody has to know."""
        self.longest = max(self.longest, dt)
        if dt >= TINY * self.longest:
            self.tiny = 0
            self.cuts.clear()
            return False
        self.tiny += 1
        return self.tiny % MANY == 0
