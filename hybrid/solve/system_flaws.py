"""Why a state in which all forces of a system balance is no equilibrium of its lines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hybrid.errors import Outcome
from hybrid.kernels.state.state import State
from hybrid.solve.flaws import flaw_of_line, lowest_tension, overstretched_cell
from hybrid.solve.joined import JoinedLine, SystemState
from hybrid.solve.stability import Stability, is_judged
from hybrid.solve.statics import LEAST_TENSION


def at_rest(x: JoinedLine) -> float:
    """Tension, N, that a catenary of a line has more of at rest."""
    return LEAST_TENSION * abs(x.floor) if np.isfinite(x.floor) else x.floor


def slack_cell(x: JoinedLine, state: State) -> int:
    """The cell of a catenary with the lowest tension where a line at rest is slack; -1: it is not."""
    tension, cell = lowest_tension(x.line, x.sea, state)
    return -1 if tension > at_rest(x) else int(cell)


def flaw_of_lines(lines: Sequence[JoinedLine], states: SystemState) -> tuple[Outcome, int, int]:
    """The outcome (OK: there is none), the line, and its node or cell, as `flaw_of_line` finds them."""
    for k, (x, state) in enumerate(zip(lines, states.lines, strict=True)):
        outcome, where = flaw_of_line(x.line, x.sea, state, x.length, at_rest(x))
        if outcome == Outcome.OK and x.borne.size and (cell := overstretched_cell(x.line, state, x.borne)) >= 0:
            outcome, where = Outcome.OVERSTRETCHED, cell
        if outcome != Outcome.OK:
            return outcome, k, where
    return Outcome.OK, -1, -1


def buckling_line(lines: Sequence[JoinedLine], states: SystemState, blurred: set[int]) -> int:
    """The first line that would buckle between what its ends are joined to, held where it is; -1: none.

    blurred: gets the numbers of lines of which round-off hides it.
    """
    for k, (x, state) in enumerate(zip(lines, states.lines, strict=True)):
        ends = x.ends._replace(held=np.minimum(x.ends.held, 1))
        if is_judged(x.line, ends, x.length):
            stability = Stability(x.line, x.sea, x.length, x.scale)
            if not stability.holds(ends, state):
                return k
            if stability.blurred:
                blurred.add(k)
    return -1
