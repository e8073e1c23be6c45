"""Generalized-alpha in time: sets up a step, takes it, and gives the accelerations a consistent start.

Chung & Hulbert 1993; Arnold & Bruels 2007; docs/theory.md section 2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_banded

from hybrid.errors import Outcome
from hybrid.model.state import INEXTENSIBLE, Ends, Floats, Line, State
from hybrid.solve.elimination import workspace
from hybrid.solve.step import advance, slackest

MOST_ITERATIONS = 20  # a healthy step takes 2 to 4; more than this and half a step is cheaper
# Share of the line's length that a node may move in one Newton iteration of a step.
REACH = 0.1
# Length of the probing step that finds consistent accelerations, as a part of the step
# (error of the same order, round-off 1e-16/IGNITION^2).
IGNITION = 1e-4
# A rod that bends by more than this (rad) from one cell to the next is not resolved by its mesh.
UNRESOLVED_BEND = 1.0
# A catenary cell counts as slack when its tension is not above this part of the tension
# scale: the error of an inextensible cell's tension (its compliance 1e-9, round-off 1e-16).
SLACK_FLOOR = -1e-6

# report of the march -> powers: start, end (reactions and given moments), applied forces and
# moments, drag, mass-proportional damping, stiffness-proportional damping, added mass
POWERS = ("start", "end", "applied", "drag", "mass_damping", "stiffness_damping", "added_mass")


@dataclass(frozen=True)
class Taken:
    """How one step went: outcome, Newton iterations, predicted next correction (relative), the cell or node where
    it was worst, and the largest force out of balance before the last correction (N)."""

    outcome: Outcome
    iterations: int
    correction: float
    where: int
    residual: float


class Stepper:
    """Takes steps of one line; owns the work arrays, not the state."""

    def __init__(self, line: Line, length: float, tension_scale: float, stop_when_slack: bool) -> None:
        self.line = line
        self.reach, self.scale = REACH * length, tension_scale
        self.floor = SLACK_FLOOR * tension_scale if stop_when_slack else -np.inf
        n = line.h.size
        self.W, self.X, self.x, self.report, self.rows = workspace(n)
        self.u = np.zeros((n + 1, 3))

    def step(self, ends: Ends, old: State, new: State, dt: float, rho: float) -> Taken:
        """From `old` to `new` (overwritten) over dt with the end conditions of the new time."""
        outcome, iterations, left, where = advance(
            self.line, ends, old, new, self.u, dt, rho, self.reach, self.scale, MOST_ITERATIONS,
            self.W, self.X, self.x, self.report, self.rows,
        )  # fmt: skip
        if outcome == Outcome.OK:
            slack = slackest(self.line, new.T, self.floor)
            if slack >= 0:
                outcome, where = Outcome.SLACK, slack
        return Taken(Outcome(outcome), iterations, left, where, float(self.report[15]))

    def ignite(self, ends_at: Callable[[float], Ends], state: State, t: float, dt: float) -> Taken:
        """Give `state` accelerations and tensions consistent with its positions, velocities and loads at t.

        A probing step of length IGNITION dt with rho = 0 finds them; its displacement is thrown away.
        """
        probe = IGNITION * dt
        state.a[:], state.vd[:], state.wa[:], state.wd[:] = 0.0, 0.0, 0.0, 0.0
        new = state.copy()
        old = state._replace(v=self._without_stretching(state, ends_at(t)))
        taken = self.step(ends_at(t + probe), old, new, probe, 0.0)
        ends_at(t)
        if taken.outcome in (Outcome.OK, Outcome.SLACK):
            state.a[:], state.vd[:], state.T[:] = new.vd, new.vd, new.T
            state.wa[:], state.wd[:] = new.wd, new.wd
        return taken

    def _without_stretching(self, state: State, ends: Ends) -> Floats:
        """Velocities (N+1, 3) nearest to those of `state` that stretch no inextensible cell.

        A run keeps lengths, and so rates of length only to the order of the scheme; a probing
        step would take that small rate for a collision.  Impulses along the chords remove it:
        (1/m_c + 1/m_{c+1}) p_c - d_c.d_{c-1} p_{c-1}/m_c - d_c.d_{c+1} p_{c+1}/m_{c+1} = -d_c.(v_{c+1} - v_c).
        """
        line, v = self.line, state.v
        d = state.e / np.linalg.norm(state.e, axis=1)[:, None]
        rate = np.einsum("ij,ij->i", d, np.diff(v, axis=0))
        stiff = line.ck * self.scale <= 2.0 * INEXTENSIBLE
        if not (stiff & (rate != 0.0)).any():
            return v
        lightness = 1.0 / line.mass
        lightness[[0, -1]] *= 1 - ends.held
        both = stiff[:-1] & stiff[1:]
        side = -np.einsum("ij,ij->i", d[:-1], d[1:]) * lightness[1:-1] * both
        middle = np.where(stiff, lightness[:-1] + lightness[1:], 1.0)
        bands = np.vstack([np.concatenate([[0.0], side]), middle, np.concatenate([side, [0.0]])])
        p = solve_banded((1, 1), bands, np.where(stiff, -rate, 0.0))
        push = p[:, None] * d
        out = v.copy()
        out[1:] += push * lightness[1:, None]
        out[:-1] -= push * lightness[:-1, None]
        return out

    def powers(self, ends: Ends, velocity: Floats, state: State) -> Floats:
        """Power (W) into the cable by each of POWERS, at the last configuration the march saw."""
        f, n = self.report, self.line.h.size
        out = np.empty(7)
        applied = 0.0
        for k, node, cell, force, moment in ((0, 0, 0, f[0:3], -f[6:9]), (1, n, n - 1, f[3:6], f[9:12])):
            out[k] = 0.0
            if ends.held[k]:
                out[k] = -float(force @ velocity[k])
            else:
                applied += float(ends.force[k] @ state.v[node])
            if self.line.element[node]:
                out[k] += float(moment @ ends.spin[k])
            elif self.line.spin[cell] and ends.moment[k].any():
                e = state.e[cell]
                e1 = state.v[cell + 1] - state.v[cell]
                omega = np.cross(e, e1) / (e @ e) + state.w[cell] * e / np.sqrt(e @ e)
                applied += float(ends.moment[k] @ omega)
        out[2] = applied
        out[3], out[4], out[5], out[6] = -f[12], -f[13], -f[14], -f[17]
        return out
