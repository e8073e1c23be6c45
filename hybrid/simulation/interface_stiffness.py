"""How the force on an end of one cable changes with the place it is set to: the factors of the last step.

With the balance of the end in place of its condition, the equations of the step are A x = b, where a force f on the
end is b = -f in its rows; the end then gives way by the inverse of what it takes to shift it.  Inertia and damping of
the step (dv'/dr' = cv, dvd'/dr' = ca, step.generalized_alpha) are in A, so that it is what an iteration over the
same step needs, not the static stiffness.
"""

from __future__ import annotations

import numpy as np

from hybrid.errors import ComputationError, Outcome
from hybrid.kernels.algebra.block_elimination import SIZE
from hybrid.kernels.algebra.kept_factors import solve_again
from hybrid.kernels.run import entry
from hybrid.kernels.state.forces import PLANAR
from hybrid.kernels.state.state import Floats
from hybrid.kernels.step.generalized_alpha import weights
from hybrid.simulation.transient import Transient
from hybrid.solve.workspaces import workspace_of


def interface_stiffness(run: Transient, k: int, step: float) -> Floats:
    """(3, 3) N/m, inertial: the force it takes to shift end k (0 or 1) at the end of the last step.

    step: s, of a step that is to come, where none has been taken.  Directions that are held stay; contact of the line
    with itself is left out.  ComputationError: the end moves without resistance.
    """
    model, clock = run.model, run.run.clock
    dt, before = float(clock.last_dt), float(clock.step_before)
    rho, rho_before = float(clock.last_rho), float(clock.rho_before)
    if not dt > 0.0:
        dt, before, rho, rho_before = step, 0.0 if run.controlled else step, run.rho, run.rho
    am, af, ga, be, _ = weights.py_func(rho, rho_before, before / dt)
    cv, ca = ga / (be * dt), (1.0 - am) / ((1.0 - af) * be * dt * dt)
    line = model.line._replace(bits=model.line.bits & ~PLANAR)
    ends = model.ends.values
    held = ends.held.copy()
    held[k] = 0
    work = workspace_of(line, keep=True)
    old, new = run.before, run.state
    work.u[:] = new.r - old.r if clock.last_dt > 0.0 else 0.0
    bad = entry.assembly_of_step(line, model.sea.values, ends._replace(held=held), old, new, cv, ca, work)
    give, n = np.zeros((3, 3)), line.h.size
    x, load = np.zeros((n + 1, SIZE)), np.zeros((n + 1, SIZE))
    for axis in range(3):
        load[:] = 0.0
        load[-k, 1 + axis] = 1.0
        if bad >= 0 or not solve_again(work.X, work.W, load, x):
            raise ComputationError(Outcome.SINGULAR, run.t, float(line.s[-k]), "this end moves without resistance")
        give[:, axis] = x[-k, 1:4]
    return np.asarray(-np.linalg.inv(give))
