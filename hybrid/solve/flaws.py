"""Why a state in which all forces balance is no equilibrium of a line: without tension, buried, folded."""

from __future__ import annotations

import numpy as np

from hybrid.errors import Outcome
from hybrid.kernels.bed import planes_under
from hybrid.kernels.forces import BODIES, FRICTION, SEABED
from hybrid.kernels.resolution_checks import lowest, lowest_not_held
from hybrid.kernels.state import Floats, Line, Sea, State

# A line that lies this part of its length, and this many onsets of contact, under the bed has gone through it.
BURIED, BURIED_ONSETS = 0.02, 100.0


def lowest_tension(line: Line, sea: Sea, state: State) -> tuple[float, int]:
    """Lowest tension of a catenary cell that no friction on the bed holds, N, and the cell."""
    if line.bits & FRICTION:
        return lowest_not_held(line, sea, state.T)
    return lowest(line, state.T)


def flaw_of_line(line: Line, sea: Sea, state: State, length: float, floor: float) -> tuple[Outcome, int]:
    """SLACK: a catenary is not under a tension of more than `floor` (N); BURIED; OK; and the cell or node."""
    tension, cell = lowest_tension(line, sea, state)
    if not tension > floor:
        return Outcome.SLACK, int(cell)
    if line.bits & SEABED:
        deep = planes_under(sea, state.r)[1] - 0.5 * sea.onset
        if deep.max() > max(BURIED * length, BURIED_ONSETS * sea.onset):
            return Outcome.BURIED, int(np.argmax(deep))
    return Outcome.OK, -1


def folds(line: Line, state: State) -> Floats:
    """Angle (N+1,), rad, by which chords turn from one cell to the next; 0 where no rod without a point load bends."""
    d = state.e / np.linalg.norm(state.e, axis=1)[:, None]
    turn = np.zeros(line.s.size)
    turn[1:-1] = np.arctan2(np.linalg.norm(np.cross(d[:-1], d[1:]), axis=1), np.einsum("ij,ij->i", d[:-1], d[1:]))
    turn[line.element == 0] = 0.0
    if line.bits & BODIES:  # beside a point load a line bends within sqrt(EI/T), however long its cells are
        turn[(line.point_mass > 0.0) | (line.point_buoy != 0.0)] = 0.0
    return turn
