"""Equilibrium of one line by the same march: Newton's method, within the search that all lines have (solve.search)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, islice
from typing import NamedTuple

import numpy as np

from hybrid.errors import ComputationError, Outcome
from hybrid.kernels.junctions.bodies import NUMBERS
from hybrid.kernels.laws.soil import settle_in_soil
from hybrid.kernels.run import entry
from hybrid.kernels.run.entry import Limits
from hybrid.kernels.state.report import FRICTION, RESIDUAL, RESIDUAL_NODE, WAVES
from hybrid.kernels.state.state import Ends, Floats, Line, Sea, State
from hybrid.kernels.step.step import friction_axes
from hybrid.solve.flaws import (
    buckling_line,
    flaw_of_lines,
)
from hybrid.solve.joined import JoinedLine, LineFailed, NetworkState, NetworkTaken
from hybrid.solve.search import (
    PULLED,
    PUSHED,
    Attempt,
    Solution,
    Tally,
    attempts,
    first_sound,
    pulled,
    stuck,
    summary_of,
)
from hybrid.solve.stability import DAMPING as SETTLING
from hybrid.solve.stability import (
    Stability,
    stop,
)
from hybrid.solve.stepper import Stepper, Taken, workspace_of

MOST_ITERATIONS = 40  # of Newton from a poor shape: 6 to 12 are usual, beyond 40 it wanders
REACH = 0.1  # of the length: largest shift of a node in one iteration
# An equilibrium is out of balance by at most this part of its largest tension and of the scale; so many tries.
BALANCED, BALANCING = 1e-6, 4
DRIFTED = 10.0  # lengths that a line has gone from its start where it has drifted
MOST_TURNING = 200  # of Newton with turning chords, which goes half a radian at a time: 8 pi are 40 turns of that size


@dataclass(frozen=True)
class Equilibrium:
    """A static solution: how it was found (`path`), iterations, and its proof, the largest force out of balance (N)."""

    state: State
    path: tuple[str, ...]
    iterations: int
    residual: float
    with_friction: bool  # True when friction took part
    blurred: bool = False  # True when round-off of the bending of very short cells hides whether it buckles
    touches: bool = False  # whether a damped motion with contact with itself led there
    unjudged: str = ""  # where that is so: why it is not known that it would stay
    not_settled: str = ""  # why friction has not settled where a scene leaves that to the program

    @property
    def pushed(self) -> bool:
        """Whether it, or one on fewer cells that it was found from, is beside an equilibrium that is not stable."""
        return PUSHED in self.path[-1]

    @property
    def pulled(self) -> bool:
        """Whether it was pulled tight from where it lay without tension."""
        return self.path[-1].startswith(PULLED)

    @property
    def summary(self) -> str:
        """How it was found, in one line."""
        return summary_of(self.path, self.iterations)


class LineSolver:
    """Solves for one line that is joined to nothing that moves with it, in space or in its plane."""

    settling = SETTLING
    bodies: Floats = np.zeros((0, NUMBERS))

    def __init__(self, x: JoinedLine) -> None:
        self.lines: tuple[JoinedLine, ...] = (x,)
        self.length, self.scale = x.length, x.scale
        self.work, self.anchor = workspace_of(x.line), Stability(x.line, x.sea, x.length, x.scale).anchor
        self.blurred: set[int] = set()
        self._stepper: Stepper | None = None

    def others(self, lines: Sequence[JoinedLine], bodies: Floats | None = None) -> LineSolver:
        """As of `Solver`."""
        return LineSolver(lines[0])

    def newton(self, start: NetworkState) -> Solution:
        """As of `Solver`: an equilibrium out of which a rod would buckle is none that anybody will see."""
        return self._judged(start, *self._balance(start, False, True))

    def turned(self, start: NetworkState) -> Solution:
        """As of `Solver`."""
        return self._judged(start, *self._balance(start, True, True))

    def balance(self, start: NetworkState) -> Solution:
        """As of `Solver`, as far as Newton's method says so."""
        return self._balance(start, False, False)

    def _judged(self, start: NetworkState, taken: NetworkTaken, new: NetworkState) -> Solution:
        """What was found, with what makes it no equilibrium."""
        if taken.outcome != Outcome.OK:
            return taken, new
        outcome, _, where = flaw_of_lines(self.lines, new)
        far = np.abs(new.lines[0].r - start.lines[0].r).max(axis=1)
        if outcome != Outcome.SLACK and far.max() > DRIFTED * self.length:  # what the anchor's springs alone hold
            outcome, where = Outcome.SINGULAR, int(np.argmax(far))
        if outcome == Outcome.OK:
            self.blurred.clear()
            if buckling_line(self.lines, new, self.blurred) >= 0:
                outcome, where = Outcome.UNSTABLE, int(np.argmin(new.lines[0].T))
        return replace(taken, outcome=outcome, where=int(where)), new

    def _balance(self, start: NetworkState, turning: bool, proves: bool) -> Solution:
        (line, sea, ends, *_), total = self.lines[0], 0
        new = start.lines[0].copy()
        stop(new)
        new.sheave[:] = 0.0
        limits = Limits(REACH * self.length, self.scale, MOST_TURNING if turning else MOST_ITERATIONS)
        kept: State | None = None
        for _ in range(BALANCING):
            self.work.u[:], new.soil[:] = 0.0, 0.0
            if line.bits & FRICTION:
                friction_axes(sea, new.r, new.e, new.slip, new.grip)
            outcome, iterations, _, where = entry.equilibrium(
                line, sea, ends, new, self.anchor, limits, turning, self.work
            )
            total += iterations
            new.r[:] += self.work.u
            new.vd[:], new.wd[:] = 0.0, 0.0  # of the anchor's springs
            new.slip[:] = sea.slid if line.bits & FRICTION else 0.0
            settle_in_soil(line, sea, new.r, new.soil)
            if outcome != Outcome.OK or not proves:
                break
            # Newton stops by turns and tensions; a very stiff seabed makes much force of little way
            states = NetworkState([new])
            if not self.is_balanced(states, self.proof(states)):
                outcome, where = Outcome.NOT_CONVERGED, int(self.work.report[RESIDUAL_NODE])
            elif kept is not None or not line.bits & FRICTION:
                break
            else:  # friction that sticks is stiff: one more round, of which nothing is lost
                kept = new.copy()
        if kept is not None and outcome != Outcome.OK:
            outcome, new = Outcome.OK, kept
        return NetworkTaken(Outcome(outcome), total, np.inf, 0, int(where), np.inf), NetworkState([new])

    def step(
        self, old: NetworkState, new: NetworkState, dt: float, rho: float, before: float, rho_before: float
    ) -> Taken:
        """As of `Solver`."""
        x = self.lines[0]
        if self._stepper is None:
            self._stepper = Stepper(x.line, x.length, x.scale)
        return self._stepper.step(x.sea, x.ends, old.lines[0], new.lines[0], dt, rho, before, rho_before)

    def proof(self, states: NetworkState) -> float:
        """As of `Solver`; infinity when it cannot be told."""
        (line, sea, ends, *_), state = self.lines[0], states.lines[0]
        if line.bits & FRICTION:
            friction_axes(sea, state.r, state.e, state.slip, state.grip)
        self.work.u[:] = 0.0
        bad = entry.assembly(line, sea, ends, state, 0.0, self.anchor, self.work)
        return float(self.work.report[RESIDUAL]) if bad < 0 else float("inf")

    def is_balanced(self, states: NetworkState, residual: float) -> bool:
        """As of `Solver`."""
        return residual <= BALANCED * (float(np.abs(states.lines[0].T).max()) + self.scale)


class Search(NamedTuple):
    """How an equilibrium is searched, and which one counts.

    settle: on a bed with friction, "start": let it come to rest from the start and try nothing else, "pull": pull it
    tight from where it would lie without tension along the equilibrium without friction, which is the start; quick: try
    nothing but Newton from the start; take_slack: whether a slack solution will do; others: further starts with their
    names; refused: why a state in balance is not the one that is sought, and its cell or node; the next way is tried
    then.  borne: (N,) strain that cells bear, of a line that may lie on obstacles.
    """

    settle: str = ""
    quick: bool = False
    take_slack: bool = False
    others: Sequence[tuple[str, State]] = ()
    refused: Callable[[State], tuple[Outcome, int]] | None = None
    borne: Floats = np.zeros(0)


ALL_WAYS = Search()


def solve_statics(
    line: Line,
    sea: Sea,
    ends: Ends,
    start: State,
    length: float,
    scale: float,
    floor: float | None = None,
    shape: str = "the starting shape",
    search: Search = ALL_WAYS,
) -> Equilibrium:
    """Equilibrium of a line from a starting shape, however poor.

    length: m; scale: the tension scale, N; floor: what counts as no tension in motion, N (None: 1e-6 of the scale);
    shape: what the start is, for people.  ComputationError: no way leads to one; with `search.take_slack` a slack
    solution is taken when there is no taut one.
    """
    floor, rubs = 1e-6 * scale if floor is None else floor, bool(line.bits & FRICTION)
    bits = line.bits & ~WAVES
    x = JoinedLine(line._replace(bits=bits), sea, ends, length, scale, floor, (-1, -1), borne=search.borne)
    without = x._replace(line=line._replace(bits=bits & ~FRICTION), slackens=search.take_slack)
    rough, smooth = LineSolver(x), LineSolver(without)  # with friction a slack solution is not taken
    first, tally = NetworkState([start]), Tally()
    others = [(name, NetworkState([other])) for name, other in search.others]
    settle = "start" if rubs and not ends.held.any() else search.settle if rubs else ""
    refused = search.refused

    def not_sought(states: NetworkState) -> tuple[Outcome, int, int]:
        outcome, where = refused(states.lines[0]) if refused is not None else (Outcome.OK, -1)
        return outcome, 0, where

    roads: list[Iterator[Attempt]] = []
    if not settle:
        plain = attempts(smooth, [(shape, first)], others, tally)
        roads.append(islice(plain, 1) if search.quick else plain)
    elif settle == "pull":
        roads.append(pulled(smooth, rough, [0], first, tally))
    if rubs and settle != "pull" and (settle or not search.quick):
        roads.append(stuck(rough, [0], first, shape, tally))
    try:
        path, tried = first_sound(chain(*roads), tally, not_sought)
    except LineFailed as failed:
        raise ComputationError(failed.outcome, None, failed.s, failed.detail) from None
    solver = smooth if tried.solver is smooth else rough
    state, residual = tried.states.lines[0], solver.proof(tried.states)
    rubbed = bool(solver.lines[0].line.bits & FRICTION)
    return Equilibrium(state, path, tally.total, residual, rubbed, bool(solver.blurred))
