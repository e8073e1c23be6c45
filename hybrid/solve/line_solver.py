"""Equilibrium of one line that nothing moves: Newton's method, within the search that all lines have (solve.search)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hybrid.errors import Outcome
from hybrid.kernels.junctions.bodies import NUMBERS
from hybrid.kernels.laws.soil import rest_in_soil
from hybrid.kernels.run import entry
from hybrid.kernels.run.entry import NO_PUSH, Limits, workspace_of
from hybrid.kernels.state.report import FRICTION, OBSTACLES, RESIDUAL, RESIDUAL_NODE, USED_RHO
from hybrid.kernels.state.state import Floats, State
from hybrid.kernels.step.step import States, friction_axes
from hybrid.solve.flaws import buckling_line, flaw_of_lines
from hybrid.solve.stability import DAMPING, Stability, stop
from hybrid.solve.stepper import MOST_ITERATIONS as MOST_OF_STEP
from hybrid.solve.stepper import REACH, JoinedLine, NetworkState, NetworkTaken, Solution

MOST_ITERATIONS = 40  # of Newton from a poor shape: 6 to 12 are usual, beyond 40 it wanders
# An equilibrium is out of balance by at most this part of its largest tension and of the scale; so many tries.
BALANCED, BALANCING = 1e-6, 4
# Where lines touch Newton goes on once unless this many times the residual balances, too: a ball on lines that lie on
# others was 3e-7 m away from where it rests, and lines on one that is held bore 1e-5 more than its weight.
CLOSER = 100.0
DRIFTED = 10.0  # lengths that a line has gone from its start where it has drifted
MOST_TURNING = 200  # of Newton with turning chords, which goes half a radian at a time: 8 pi are 40 turns of that size


class LineSolver:
    """Solves for one line that is joined to nothing that moves with it, in space or in its plane."""

    settling = DAMPING  # of a motion to rest, as of solve.stability.damped
    bodies: Floats = np.zeros((0, NUMBERS))

    def __init__(self, x: JoinedLine) -> None:
        self.lines: tuple[JoinedLine, ...] = (x,)
        self.length, self.scale = x.length, x.scale
        self.work, self.anchor = workspace_of(x.line), Stability(x.line, x.sea, x.length, x.scale).anchor
        self.blurred: set[int] = set()  # as of `NetworkSolver`

    def others(self, lines: Sequence[JoinedLine], bodies: Floats | None = None) -> LineSolver:
        """The same of another line."""
        return LineSolver(lines[0])

    def newton(self, start: NetworkState) -> Solution:
        """Static Newton from `start`, which stays; not OK too where what was found would not stay."""
        return self._judged(start, *self._balance(start, False, True))

    def turned(self, start: NetworkState) -> Solution:
        """As `newton`, with chords that are turned."""
        return self._judged(start, *self._balance(start, True, True))

    def balance(self, start: NetworkState) -> Solution:
        """As `newton`, whatever the state is in which forces balance, as far as Newton's method says so."""
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
            rest_in_soil(line, sea, new.r, new.soil)
            if outcome != Outcome.OK or not proves:
                break
            # Newton stops by turns and tensions; a very stiff seabed makes much force of little way
            states = NetworkState([new])
            proof = self.proof(states)
            rubs, lies = line.bits & FRICTION, line.bits & OBSTACLES
            if not self.is_balanced(states, proof):
                outcome, where = Outcome.NOT_CONVERGED, int(self.work.report[RESIDUAL_NODE])
            elif kept is not None or (not rubs and (not lies or self.is_balanced(states, CLOSER * proof))):
                break
            else:  # contact, and friction that sticks, are stiff: one more round, of which nothing is lost
                kept = new.copy()
        if kept is not None and outcome != Outcome.OK:
            outcome, new = Outcome.OK, kept
        return NetworkTaken(Outcome(outcome), total, np.inf, 0, int(where), np.inf), NetworkState([new])

    def step(
        self, old: NetworkState, new: NetworkState, dt: float, rho: float, before: float, rho_before: float
    ) -> NetworkTaken:
        """A step of dt (s) to `new`, which is overwritten."""
        x, report = self.lines[0], self.work.report
        task = entry.step_task(dt, before, rho, Limits(REACH * x.length, x.scale, MOST_OF_STEP), rho_before)
        states = States(old.lines[0], new.lines[0], NO_PUSH, NO_PUSH)
        outcome, iterations, left, where = entry.step(task, x.line, x.sea, x.ends, states, self.work)
        taken = NetworkTaken(Outcome(outcome), iterations, left, 0, where, float(report[RESIDUAL]))
        return replace(taken, rho=float(report[USED_RHO]))

    def proof(self, states: NetworkState) -> float:
        """Largest force (N) that is left over in states at rest; infinity when it cannot be told."""
        (line, sea, ends, *_), state = self.lines[0], states.lines[0]
        if line.bits & FRICTION:
            friction_axes(sea, state.r, state.e, state.slip, state.grip)
        self.work.u[:] = 0.0
        bad = entry.assembly(line, sea, ends, state, 0.0, self.anchor, self.work)
        return float(self.work.report[RESIDUAL]) if bad < 0 else float("inf")

    def is_balanced(self, states: NetworkState, residual: float) -> bool:
        """Whether a largest residual force (N) is round-off of the forces in states."""
        return residual <= BALANCED * (float(np.abs(states.lines[0].T).max()) + self.scale)
