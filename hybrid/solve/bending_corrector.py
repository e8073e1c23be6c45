"""The model error of a line along its run: what neglecting bending in its catenaries shifts it by.

One way only: nothing of it goes back into the line.  docs/theory.md, 14; the kernels are in kernels.bending_error.
"""

from __future__ import annotations

from collections.abc import Sequence
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
from hybrid.kernels.state import Batch, Ends, Floats, Line, Sea, State, Work, ends_in, no_sea
from hybrid.kernels.step import friction_axes
from hybrid.solve.stepper import Stepper

# Part of the line's length beyond which an error is none that a linear estimate could know: it is clipped there.
MOST = 0.1
# Part of the error by which a rod's end is moved to see how its forces answer, to first order as all else is here.
SMALL = 1e-4
# dvd'/dr' of an equilibrium, over tension scale / (mass x length): holds what would drift freely, as in solve.statics.
ANCHOR = 1e-12


class Sample(NamedTuple):
    """The error at an output: (2, N+1, 4) of position (m) and velocity with the spins; tension (N,) N; moment (N+1, 3)
    N m, inertial; left (4, 3) N m, what of it the two nodes at either end lack."""

    error: Floats
    tension: Floats
    moment: Floats
    left: Floats


class Shift(NamedTuple):
    """What the error makes of nb outputs: true values less those computed, to first order.

    position, velocity: (N+1, 3, nb) m, m/s; tension: (N, nb) N; moment: (N+1, 3, nb) N m, inertial; stiffness: (N+1,)
    N m2, by which all of a moment makes a curvature; resultants: (2, 3, nb) N, of the forces on the first and the last
    node, zero where they are given; clamped: (2,) 1 where an end prescribes a tangent.
    """

    position: Floats
    velocity: Floats
    tension: Floats
    moment: Floats
    stiffness: Floats
    resultants: Floats
    clamped: np.ndarray


def _dot(a: Floats, b: Floats) -> Floats:
    """a . b of vectors (..., 3), as (..., 1)."""
    return np.asarray(a[..., :1] * b[..., :1] + a[..., 1:2] * b[..., 1:2] + a[..., 2:] * b[..., 2:])


class Corrector:
    """Follows the error of one line, step by step; owns the work arrays and the error, not the state.

    error: (4, N+1, 4) of position (m), velocity, algorithmic and true acceleration, and of the spin of the cell after
    a node in the last column; x: (N+1, 5) the same with the tension (N) of the cell before in front; moment: (N+1, 3)
    N m inertial, of the rod less that of the line; left: (N+1, 3) N m, what of it nodes lack.
    """

    def __init__(
        self, line: Line, ki: Floats, floor: Floats, tangent: np.ndarray, length: float, scale: float,
        kinks: np.ndarray | None = None,
    ) -> None:  # fmt: skip
        """ki: (N+1,) N m, bending stiffness of full elements, EI/hn; floor: (N,) N, least tension that counts;

        tangent: (2,) 1 where an end prescribes one; length: m; scale: tension scale, N; kinks: (N+1,) 1 where the cable
        may have one, None: nowhere.
        """
        n = line.h.size
        soft = np.divide(1.0, ki, out=np.zeros(n + 1), where=ki > 0.0)
        self.line, self.ki, self.length, self.scale = line, ki, length, scale
        self.bending = Bending(
            soft, np.zeros(n + 1, np.int8) if kinks is None else kinks, np.asarray(tangent, np.int8), floor
        )
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
        self._ends = [0, 1, n - 1, n]  # nodes
        self._step: Step | None = None
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

    def sample(self, part: float = 1.0) -> Sample:
        """The error at a part of the last step: between that before it and that after it."""
        now = self._of(self.error, self.x, self.moment, self.left)
        if part >= 1.0:
            return Sample(*(x.copy() for x in now))
        before = self._of(self._spare, *self._before)
        return Sample(*(part * a + (1.0 - part) * b for a, b in zip(now, before, strict=True)))

    def _of(self, error: Floats, x: Floats, moment: Floats, left: Floats) -> Sample:
        """What a sample takes of these."""
        return Sample(error[:2], x[1:, 0], moment, left[self._ends])

    def shift(self, samples: Sequence[Sample], batch: Batch) -> Shift:
        """What the errors at the outputs of a batch make of them."""
        error, tension, moment, left = (np.stack(x) for x in zip(*samples, strict=True))
        now = self._end_forces(batch, error, tension, left, 0.0)
        more = self._end_forces(batch, error, tension, left, SMALL)
        forces = (more - now) / SMALL * batch.held[:, :, None]
        each = (error[:, 0, :, :3], error[:, 1, :, :3], tension, moment, forces)
        r, v, T, M, F = (np.moveaxis(x, 0, -1) for x in each)
        return Shift(r, v, T, M, self.ki * self.line.hn, F, self.bending.tangent)

    def _end_forces(self, batch: Batch, error: Floats, tension: Floats, left: Floats, part: float) -> Floats:
        """Forces (nb, 2, 3) N with which the first and the last cell pull at their nodes, a part of the error added."""
        line, n = self.line, self.line.h.size
        M, shift = part * left, part * error[:, 0, :, :3]
        if line.spin[0] or line.spin[-1]:  # directors carried to the chords, and spun
            e = batch.e + np.diff(shift, axis=1)
            a = self._carried(batch, e, part * error[:, 0, :-1, 3])
            found, strain = np.zeros((2, n + 1, 3))
            for k in range(len(e)):
                observe(line, ends_in(batch, k), e[k], batch.v[k], a[k], batch.w[k], found, strain, np.zeros(4))
                M[k] += found[self._ends]
        out = np.zeros((len(batch.t), 2, 3))
        for k, c, sign in ((0, 0, 1.0), (1, n - 1, -1.0)):
            e = batch.e[:, c] + (shift[:, c + 1] - shift[:, c])
            l = np.sqrt(_dot(e, e))
            d = e / l
            T = batch.T[:, c, None] + part * tension[:, c, None]
            out[:, k] = sign * (T * d + np.cross(d, M[:, 2 * k + 1] - M[:, 2 * k]) / l)
            if line.bits & SEABED:
                out[:, k] += self._bed(k, c, batch, part * error[:, :2])
        return out

    @staticmethod
    def _carried(batch: Batch, e: Floats, psi: Floats) -> Floats:
        """Directors (nb, N, 3) of a batch carried to the chords e, and turned about them by psi (nb, N)."""
        d, to = batch.e / np.sqrt(_dot(batch.e, batch.e)), e / np.sqrt(_dot(e, e))
        a = batch.a1 - _dot(batch.a1, to) / (1.0 + _dot(d, to)) * (d + to)
        return np.asarray(np.cos(psi)[..., None] * a + np.sin(psi)[..., None] * np.cross(to, a))

    def _bed(self, k: int, cell: int, batch: Batch, error: Floats) -> Floats:
        """Force (nb, 3) N of the seabed on the first or last node, which is held, as its neighbour moves."""
        sea, near = self.sea, [cell, cell + 1] if k == 0 else [cell + 1, cell]
        r, v = batch.r[:, near] + error[:, 0, near, :3], batch.v[:, near] + error[:, 1, near, :3]
        normal = sea.normal
        depth = sea.offset + 0.5 * sea.onset - (r[..., 0] * normal[0] + r[..., 1] * normal[1] + r[..., 2] * normal[2])
        rates = -(v[..., 0] * normal[0] + v[..., 1] * normal[1] + v[..., 2] * normal[2])
        out = np.zeros((len(depth), 3))
        for i in np.flatnonzero(depth.max(axis=1) > 0.0):
            p, q = depth[i].tolist(), rates[i].tolist()
            out[i] = contact(*p, *q, self.line.h[cell], sea.stiffness, sea.damping, sea.onset)[0] * normal
        return out

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
        self.follow(line, sea, ends, state, Step(still, np.array([0.0, 0.0, 0.0, torque])), work)

    def step(
        self, stepper: Stepper, sea: Sea, ends: Ends, state: State, dt: float, before: float, rho: float,
        torque: float = 0.0,
    ) -> None:  # fmt: skip
        """The error after the step of dt that `stepper` has just taken to `state`; torque: N m, that no rod carries."""
        work = stepper.work
        if self._step is None or self._step.u is not work.u:
            self._step = Step(work.u, np.zeros(4))
        self._step.numbers[:] = dt, before, rho, torque
        self.follow(self.line, sea, ends, state, self._step, work)

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
