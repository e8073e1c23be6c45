"""Held ends that are let go in mid-motion: when, the energy that goes with a clamp, and the event."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hybrid.kernels.march.energies import Observed, observe
from hybrid.kernels.march.zone_torque import TURN, torsion_energy
from hybrid.kernels.state import books as b
from hybrid.kernels.state.state import NO_TURN, State
from hybrid.model.build import Model
from hybrid.model.release import NAMES, without_hold
from hybrid.solve.run import CompiledRun

if TYPE_CHECKING:
    from hybrid.simulation.transient import Transient

SAME_TIME = 1e-6  # of a step: a time so near is now


def watch_forces(run: CompiledRun, model: Model) -> None:
    """Let the compiled run notice the forces at which held ends are let go."""
    held, forces = model.ends.values.held, model.ends.release_forces
    run.clock.release_start, run.clock.release_end = np.where(held, forces, np.inf)


def overloaded(run: CompiledRun) -> dict[int, str]:
    """The ends that are held by more than the force at which they are let go, after a step, and the reason in words."""
    row, found = run.books.log[run.count.rows - 1], {}
    for k, limit in enumerate((float(run.clock.release_start), float(run.clock.release_end))):
        force = float(row[b.LOG.index("end_force_start") + k])
        if force > limit:
            text = f"after the first step in which its force, {force:.6g} N, is above release_at.tension, {limit:g} N,"
            found[k] = text
    return found


def due(model: Model, t: float, step: float) -> list[int]:
    """The held ends whose time to be let go has come at t (s)."""
    ends, latest = model.ends, t + SAME_TIME * step
    if min(ends.release_times) > latest:
        return []
    return [k for k, at in enumerate(ends.release_times) if at <= latest and ends.values.held[k]]


def elastic(model: Model, t: float, state: State) -> float:
    """Energy of bending and torsion, J, at t (s), with that of zones that a torque passes through."""
    cells, energy = model.cells, np.zeros(4)
    observed = Observed(np.zeros((cells + 1, 3)), np.zeros((cells + 1, 3)), energy)
    observe(model.line, model.ends.at(t), state.e, state.v, state.a1, state.w, state.T, state.turn, observed)
    line = model.line
    twist = float(torsion_energy(line, state.turn[:, TURN], state.T)) if line.torsion.size else 0.0
    return float(energy[1] + energy[2]) + twist


def let_go(run: Transient, k: int, why: str) -> tuple[Model, State]:
    """Model and state of a run with end k (0 or 1) free from now on; energy is booked, and an event says why."""
    old, t, before = run.model, run.t, run.state
    model, state = without_hold(old, k, t), run.state.copy()
    if state.turn.size != 3 * len(model.line.torsion):
        state = state._replace(turn=NO_TURN)
    energy = 0.0
    if model.line is not old.line:  # what bends between the end and its clamp goes with the clamp, as does twist
        energy = elastic(model, t, state) - elastic(old, t, before)
        run.run.books.work[0, k] += energy
    if run.switching is not None:
        run.switching.release(k, model)
    s = float(model.line.s[-k])
    text = f"ends.{NAMES[k]} is let go {why} and is free from here on"
    run.events.event(t, s, s, "end released", text, energy=energy)
    return model, state
