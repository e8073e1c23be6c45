"""How the force on an end of one cable changes with the place it is set to: the factors of the last step.

With the balance of the end in place of its condition, the equations of the step are A x = b, where a force f on the
end is b = -f in its rows; the end then gives way by the inverse of what it takes to shift it.  Inertia and damping of
the step (dv'/dr' = cv, dvd'/dr' = ca, step.generalized_alpha) are in A, so that it is what an iteration over the
same step needs, not the static stiffness.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybrid.errors import ComputationError, Outcome
from hybrid.kernels.algebra.block_elimination import SIZE
from hybrid.kernels.algebra.kept_factors import solve_again
from hybrid.kernels.run import entry
from hybrid.kernels.state.books import Clock
from hybrid.kernels.state.forces import PLANAR
from hybrid.kernels.state.state import Floats, State
from hybrid.kernels.step.generalized_alpha import before_fixed, weights
from hybrid.model.build import Model
from hybrid.solve.workspaces import workspace_of


class StepTaken(NamedTuple):
    """The last step of a line, as the weights of the scheme took it."""

    dt: float  # s; 0: none has been taken
    length: float  # s, the same, or that of the step to come where none has been taken
    before: float  # s, that of the step before
    rho: float  # spectral radii at infinity of both
    rho_before: float


def step_taken(clock: Clock, dt: float, step: float, controlled: bool) -> StepTaken:
    """The step of `dt` (s) that has led to the state of now; step: s, that of one to come where none has."""
    if not dt > 0.0:
        return StepTaken(0.0, step, 0.0 if controlled else step, float(clock.rho), float(clock.rho))
    before, rho_before = float(clock.step_before), float(clock.rho_before)
    if not controlled:
        before, rho_before = before_fixed.py_func(dt, before, rho_before, float(clock.rho))
    return StepTaken(dt, dt, before, float(clock.last_rho), rho_before)


def interface_stiffness(model: Model, k: int, states: tuple[State, State], taken: StepTaken, t: float) -> Floats:
    """(3, 3) N/m, inertial: the force it takes to shift end k (0 or 1) at the end of the last step.

    states: before the last step and now, at t (s).  Directions that are held stay; contact of the line with itself is
    left out.  ComputationError: the end moves without resistance.
    """
    am, af, ga, be, _ = weights.py_func(taken.rho, taken.rho_before, taken.before / taken.length)
    cv, ca = ga / (be * taken.length), (1.0 - am) / ((1.0 - af) * be * taken.length**2)
    line = model.line._replace(bits=model.line.bits & ~PLANAR)
    ends = model.ends.values
    held = ends.held.copy()
    held[k] = 0
    work = workspace_of(line, keep=True)
    old, new = states
    work.u[:] = new.r - old.r if taken.dt > 0.0 else 0.0
    bad = entry.assembly_of_step(line, model.sea.values, ends._replace(held=held), old, new, cv, ca, work)
    give, n = np.zeros((3, 3)), line.h.size
    x, load = np.zeros((n + 1, SIZE)), np.zeros((n + 1, SIZE))
    for axis in range(3):
        load[:] = 0.0
        load[-k, 1 + axis] = 1.0
        if bad >= 0 or not solve_again(work.X, work.W, load, x):
            raise ComputationError(Outcome.SINGULAR, t, float(line.s[-k]), "this end moves without resistance")
        give[:, axis] = x[-k, 1:4]
    return np.asarray(-np.linalg.inv(give))
