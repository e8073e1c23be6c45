"""Equilibrium by the same march: Newton from whatever shape is given, and a slow road when that fails."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hybrid.errors import ComputationError, Outcome
from hybrid.model.state import Ends, Floats, Line, State
from hybrid.physics.loads import MASS_DAMPING
from hybrid.solve.elimination import march, workspace
from hybrid.solve.step import newton
from hybrid.solve.timestep import SLACK_FLOOR, Stepper

MOST_ITERATIONS = 40  # of Newton from a poor shape: 6 to 12 are usual, beyond 40 it wanders
REACH = 0.1  # of the length: largest shift of a node in one iteration
LOAD_STEPS = (4, 16, 64)  # ladders of end loads tried when Newton does not get there in one go
RELAXING_STEPS = 2000  # of the pseudo-transient, at most
CALM = 1e-4  # of the length: movement in a step below which Newton is tried again


@dataclass(frozen=True)
class Equilibrium:
    """A static solution, how it was found (`path`), iterations, and what proves it: the largest force out of balance (N)."""

    state: State
    path: tuple[str, ...]
    iterations: int
    residual: float
    report: Floats


class _Solver:
    def __init__(self, line: Line, length: float, scale: float) -> None:
        n = line.h.size
        self.line, self.length, self.scale = line, length, scale
        self.W, self.X, self.x, self.report, self.rows = workspace(n)
        self.total = 0

    def newton(self, ends: Ends, state: State) -> tuple[Outcome, int, State]:
        """Static Newton from `state`; a new state is returned, the old one is left as it was."""
        new = state.copy()
        for still in (new.v, new.a, new.vd, new.w, new.wa, new.wd):
            still[:] = 0.0
        u = np.zeros_like(new.r)
        outcome, iterations, _, where = newton(
            self.line, ends, new.r, u, new.e, new.v, new.vd, new.T, new.a1, new.w, new.wd,
            0.0, 0.0, REACH * self.length, MOST_ITERATIONS, self.W, self.X, self.x, self.report, self.rows,
        )  # fmt: skip
        self.total += iterations
        new.r[:] += u
        return Outcome(outcome), int(where), new

    def prove(self, ends: Ends, state: State) -> float:
        """Largest force out of balance, N, with the mixed tensions: T d in place of the stiff law's Ts d."""
        taut = state.copy()
        # chords stretched exactly as their tension asks: the residual then is that of the mixed form,
        # free of the round-off that the law of a nearly inextensible cell multiplies by 1e9
        l = np.linalg.norm(taut.e, axis=1)
        taut.e[:] *= (self.line.h * (1.0 + self.line.ck * taut.T) / l)[:, None]
        march(
            self.line, ends, taut.e, np.zeros_like(taut.r), taut.r, taut.v, taut.vd, taut.T, taut.a1, taut.w,
            taut.wd, 0.0, 0.0, self.W, self.X, self.report, self.rows,
        )  # fmt: skip
        return float(self.report[15])


def _scaled(ends: Ends, part: float) -> Ends:
    return ends._replace(force=part * ends.force, moment=part * ends.moment)


def _relax(solver: _Solver, ends: Ends, state: State) -> State:
    """Pseudo-transient: rho = 0, doubling steps, mass-proportional damping, until the line hardly moves."""
    line, length = solver.line, solver.length
    time_scale = np.sqrt(float(line.mass.sum()) * length / solver.scale)
    damp = 2.0 * line.mass / time_scale
    damped = line._replace(damp=np.nan_to_num(line.damp) + damp, bits=line.bits | MASS_DAMPING)
    stepper = Stepper(damped, length, solver.scale, stop_when_slack=False)
    old = state.copy()
    # A start that is compressed (straight between close ends) gets its length back first: the
    # chords keep their directions and the held end is drawn back by Newton within the first steps.
    new = old.copy()
    dt = 1e-3 * time_scale
    calm = 0
    for _ in range(RELAXING_STEPS):
        taken = stepper.step(ends, old, new, dt, 0.0)
        solver.total += taken.iterations
        if taken.outcome != Outcome.OK:
            dt *= 0.25
            if dt < 1e-9 * time_scale:
                return old
            old.a[:], old.vd[:], old.v[:] = 0.0, 0.0, 0.0
            old.wa[:], old.wd[:], old.w[:] = 0.0, 0.0, 0.0
            continue
        moved = float(np.abs(new.r - old.r).max())
        old, new = new, old
        if taken.iterations <= 5:
            dt = min(2.0 * dt, time_scale)
        calm = calm + 1 if moved < CALM * length * dt / time_scale else 0
        if calm >= 3:
            break
    return old


def solve_statics(line: Line, ends: Ends, start: State, length: float, scale: float, slack: str = "stop") -> Equilibrium:
    """Equilibrium of a line from a starting shape, however poor.

    Tries Newton; then Newton along ladders of end loads; then a damped motion that
    settles, and Newton again.  Raises ComputationError when none of them arrives, or
    when a catenary zone is not under tension in the solution.
    """
    solver = _Solver(line, length, scale)
    path = []
    outcome, where, state = solver.newton(ends, start)
    path.append(f"Newton from the starting shape: {outcome.cause}, {solver.total} iterations")
    loaded = bool(ends.force.any() or ends.moment.any())
    if outcome != Outcome.OK and loaded:
        for steps in LOAD_STEPS:
            state, before = start, solver.total
            for k in range(1, steps + 1):
                outcome, where, state = solver.newton(_scaled(ends, k / steps), state)
                if outcome != Outcome.OK:
                    break
            path.append(f"end loads in {steps} steps: {outcome.cause}, {solver.total - before} iterations")
            if outcome == Outcome.OK:
                break
    if outcome != Outcome.OK:
        before = solver.total
        relaxed = _relax(solver, ends, start)
        outcome, where, state = solver.newton(ends, relaxed)
        path.append(f"damped motion to rest, then Newton: {outcome.cause}, {solver.total - before} iterations")
    s = float(line.s[min(max(where, 0), line.s.size - 1)])
    if outcome != Outcome.OK:
        raise ComputationError(outcome, None, s, "; ".join(path))
    if slack == "stop":
        catenary = line.spin == 0
        low = np.flatnonzero(catenary & ~(state.T > SLACK_FLOOR * scale))
        if low.size:
            worst = int(low[np.argmin(state.T[low])])
            raise ComputationError(Outcome.SLACK, None, float(line.s[worst]), f"tension {state.T[worst]:.3g} N in the equilibrium found")
    residual = solver.prove(ends, state)
    return Equilibrium(state, tuple(path), solver.total, residual, solver.report.copy())
