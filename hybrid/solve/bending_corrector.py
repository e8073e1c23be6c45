"""The model error of a line along its run: what neglecting bending in its catenaries shifts it by.

One way only: nothing of it goes back into the line.  docs/theory.md, 14; the kernels are in kernels.bending_error.
"""

from __future__ import annotations

from copy import copy
from math import sqrt
from typing import NamedTuple

import numpy as np

from hybrid.kernels import entry
from hybrid.kernels.bending_error import ErrorArrays, Step, advance_error, blank_error_job
from hybrid.kernels.binding import Table
from hybrid.kernels.energies import observe
from hybrid.kernels.entry import workspace
from hybrid.kernels.forces import FRICTION, SEABED, WAVES
from hybrid.kernels.neglected_moments import Bending
from hybrid.kernels.report import REPORT_SIZE
from hybrid.kernels.seabed import contact
from hybrid.kernels.state import Ends, Floats, Line, Sea, State, Work, no_sea
from hybrid.kernels.step import friction_axes
from hybrid.solve.stepper import Stepper

# Part of the line's length beyond which an error is none that a linear estimate could know: it is clipped there.
MOST = 0.1
# Part of the error by which a rod's end is moved to see how its forces answer, to first order as all else is here.
SMALL = 1e-4
# dvd'/dr' of an equilibrium, over tension scale / (mass x length): holds what would drift freely, as in solve.statics.
ANCHOR = 1e-12


class Shift(NamedTuple):
    """What the error makes of an output: true value less the one computed, to first order.

    position, velocity: (N+1, 3) m, m/s; tension: (N,) N; moment: (N+1, 3) N m, inertial; stiffness: (N+1,) N m2, by
    which all of a moment makes a curvature; resultants: (2, 3) N, of the forces on the first and the last node, zero
    where they are given; clamped: (2,) 1 where an end prescribes a tangent.
    """

    position: Floats
    velocity: Floats
    tension: Floats
    moment: Floats
    stiffness: Floats
    resultants: Floats
    clamped: np.ndarray


class Corrector:
    """Follows the error of one line, step by step; owns the work arrays and the error, not the state.

    error: (4, N+1, 4) of position (m), velocity, algorithmic and true acceleration, and of the spin of the cell after
    a node in the last column; x: (N+1, 5) the same with the tension (N) of the cell before in front; moment: (N+1, 3)
    N m inertial, of the rod less that of the line; left: (N+1, 3) N m, what of it nodes lack.
    """

    def __init__(self, line: Line, ki: Floats, floor: Floats, tangent: np.ndarray, length: float, scale: float) -> None:
        """ki: (N+1,) N m, bending stiffness of full elements, EI/hn; floor: (N,) N, least tension that counts;

        tangent: (2,) 1 where an end prescribes one; length: m; scale: tension scale, N.
        """
        n = line.h.size
        soft = np.divide(1.0, ki, out=np.zeros(n + 1), where=ki > 0.0)
        self.line, self.ki, self.length, self.scale = line, ki, length, scale
        self.bending = Bending(soft, np.asarray(tangent, np.int8), floor)
        self.error, self._spare = np.zeros((2, 4, n + 1, 4))
        self.slid, self.moment, self.left = np.zeros((3, n + 1, 3))
        self.x, b = np.zeros((2, n + 1, 5))
        chords, turned = np.zeros((2, n, 5))
        self._arrays = ErrorArrays(
            self.slid,
            self.x,
            self.moment,
            self.left,
            chords,
            turned,
            b,
            np.zeros((4, n + 1, 4)),
            np.zeros(REPORT_SIZE),
        )
        self._before = (self.x.copy(), self.moment.copy(), self.left.copy())  # before the last step, as is `_spare`
        self.clipped, self.where, self.finite = 0, -1, True
        self.sea = no_sea(n)  # of the last step
        self._table = Table(blank_error_job())

    @property
    def position(self) -> Floats:
        """Error (N+1, 3) m of the nodes: where the rod is, less where the line is."""
        return self.error[0, :, :3]

    @property
    def tension(self) -> Floats:
        """Error (N,) N of the cells' tension."""
        return self.x[1:, 0]

    @property
    def most(self) -> float:
        """Error, m, beyond which it is clipped."""
        return MOST * self.length

    def taking_over(self, old: Corrector) -> Corrector:
        """The error of another line of the same length, between its nodes; spins that it does not have are gone."""
        s, then, now = self.line.s, old.line.s, self.line
        for mine, its in ((self.error, old.error), (self.slid[None], old.slid[None])):
            for k in range(its.shape[0]):
                for j in range(its.shape[2]):
                    mine[k, :, j] = np.interp(s, then, its[k, :, j])
        self.error[:, :-1, 3] *= now.spin
        self.error[:, -1, 3] = 0.0
        for mine, its in ((self.moment, old.moment), (self.left, old.left)):
            for j in range(3):
                mine[:, j] = np.interp(s, then, its[:, j])
        self.x[:, 1:] = self.error[0]
        self.x[1:, 0] = np.interp(0.5 * (s[1:] + s[:-1]), 0.5 * (then[1:] + then[:-1]), old.x[1:, 0])
        return self

    def at(self, part: float) -> Corrector:
        """The error at a part of the last step: between that before it and that after it."""
        if part >= 1.0:
            return self
        other = copy(self)
        x, moment, left = self._before
        other.error = part * self.error + (1.0 - part) * self._spare
        other.x, other.moment = part * self.x + (1.0 - part) * x, part * self.moment + (1.0 - part) * moment
        other.left = part * self.left + (1.0 - part) * left
        return other

    def shift(self, ends: Ends, state: State) -> Shift:
        """What the error makes of an output of `state`."""
        now = self._end_forces(ends, state, 0.0)
        forces = (self._end_forces(ends, state, SMALL) - now) / SMALL * ends.held[:, None]
        return Shift(
            self.position.copy(), self.error[1, :, :3].copy(), self.tension.copy(), self.moment.copy(),
            self.ki * self.line.hn, forces, self.bending.tangent,
        )  # fmt: skip

    def _end_forces(self, ends: Ends, state: State, part: float) -> Floats:
        """Forces (2, 3) N with which the first and the last cell pull at their nodes, a part of the error added."""
        line, n = self.line, self.line.h.size
        M = part * self.left[[0, 1, n - 1, n]]
        if line.spin[0] or line.spin[-1]:  # directors carried to the chords, and spun
            e = state.e + part * np.diff(self.position, axis=0)
            d = state.e / np.linalg.norm(state.e, axis=1)[:, None]
            to = e / np.linalg.norm(e, axis=1)[:, None]
            a = state.a1 - np.einsum("ij,ij,i->i", state.a1, to, 1.0 / (1.0 + (d * to).sum(axis=1)))[:, None] * (d + to)
            psi = part * self.error[0, :-1, 3, None]
            a = np.cos(psi) * a + np.sin(psi) * np.cross(to, a)
            found, strain = np.zeros((2, n + 1, 3))
            observe(line, ends, e, state.v, a, state.w, found, strain, np.zeros(4))
            M += found[[0, 1, n - 1, n]]
        out = np.zeros((2, 3))
        for k, c, sign in ((0, 0, 1.0), (1, n - 1, -1.0)):
            d = state.e[c] + part * (self.position[c + 1] - self.position[c])
            l = sqrt(d @ d)
            d /= l
            x, y, z = d.tolist()
            p, q, r = (M[2 * k + 1] - M[2 * k]).tolist()
            across = np.array((y * r - z * q, z * p - x * r, x * q - y * p))
            out[k] = sign * ((state.T[c] + part * self.tension[c]) * d + across / l)
            if line.bits & SEABED:
                out[k] += self._bed(k, c, state, part)
        return out

    def _bed(self, k: int, cell: int, state: State, part: float) -> Floats:
        """Force (3,) N of the seabed on the first or last node, which is held, as its neighbour moves."""
        sea, near = self.sea, (cell, cell + 1) if k == 0 else (cell + 1, cell)
        shift, rate = self.error[0, :, :3], self.error[1, :, :3]
        p = [sea.offset + 0.5 * sea.onset - float(sea.normal @ (state.r[i] + part * shift[i])) for i in near]
        if max(p) <= 0.0:
            return np.zeros(3)
        rates = [-float(sea.normal @ (state.v[i] + part * rate[i])) for i in near]
        N = contact(*p, *rates, self.line.h[cell], sea.stiffness, sea.damping, sea.onset)[0]
        return np.asarray(N * sea.normal)

    def rest(self, sea: Sea, ends: Ends, state: State, torque: float = 0.0, with_friction: bool = False) -> None:
        """The error of an equilibrium; with_friction: friction took part in it, so that a shift is felt as friction."""
        line = self.line._replace(bits=self.line.bits & ~(WAVES if with_friction else FRICTION | WAVES))
        if line.bits & FRICTION:
            friction_axes(sea, state.e, state.slip)
        work = workspace(line.h.size, keep=True)
        ca = ANCHOR * self.scale / (float(line.mass.sum()) * self.length)
        still, no_spin = np.zeros_like(state.r), np.zeros_like(state.w)
        entry.assembly(line, sea, ends, state._replace(v=still, vd=still, w=no_spin, wd=no_spin), 0.0, ca, work)
        self.slid[:] = 0.0
        self.follow(line, sea, ends, state, Step(still, 0.0, 0.0, 0.0, torque), work)

    def step(
        self, stepper: Stepper, sea: Sea, ends: Ends, state: State, dt: float, before: float, rho: float,
        torque: float = 0.0,
    ) -> None:  # fmt: skip
        """The error after the step of dt that `stepper` has just taken to `state`; torque: N m, that no rod carries."""
        work = stepper.work
        self.follow(self.line, sea, ends, state, Step(work.u, dt, before, rho, torque), work)

    def follow(self, line: Line, sea: Sea, ends: Ends, state: State, step: Step, work: Work) -> None:
        """The error after `step`, with the factors of the matrix that stand in `work`."""
        self.sea = sea
        for mine, its in zip(self._before, (self.x, self.moment, self.left), strict=True):
            mine[:] = its
        self._table.bind(
            line=line, sea=sea, ends=ends, bending=self.bending, state=state, step=step, X=work.X, W=work.W,
            old=self.error, new=self._spare, most=self.most, arrays=self._arrays,
        )  # fmt: skip
        self.finite, self.clipped, self.where = advance_error(self._table.numbers)
        if self.finite:
            self.error, self._spare = self._spare, self.error
        else:
            self.error[:], self.x[:], self.slid[:] = 0.0, 0.0, 0.0
