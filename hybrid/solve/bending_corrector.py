"""The model error of a line along its run: what neglecting bending in its catenaries shifts it by.

One way only: nothing of it goes back into the line.  docs/theory.md, 14; the kernels are in watch.bending_error.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybrid.kernels.laws.bed import planes_under
from hybrid.kernels.laws.seabed import contact
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.march.energies import Observed, observe
from hybrid.kernels.run import entry
from hybrid.kernels.run.entry import workspace
from hybrid.kernels.state.books import Clock, Counts
from hybrid.kernels.state.report import FRICTION, SEABED, WAVES
from hybrid.kernels.state.state import NO_TURN, Batch, Ends, Floats, Line, Sea, State, Work, ends_in, no_sea
from hybrid.kernels.step.step import friction_axes
from hybrid.kernels.watch.bending_error import (
    CLIPPED,
    CURRENT,
    FINITE,
    FURTHEST,
    advance_error,
    blank_error_job,
    error_arrays,
    sampled_size,
)
from hybrid.kernels.watch.neglected_moments import Bending

# Part of the line's length beyond which an error is none that a linear estimate could know: it is clipped there.
MOST = 0.1
# Part of the error by which a rod's end is moved to see how its forces answer, to first order as all else is here.
SMALL = 1e-4
# dvd'/dr' of an equilibrium, over tension scale / (mass x length): holds what would drift freely, as at rest.
ANCHOR = 1e-12


class Shift(NamedTuple):
    """What the error makes of nb outputs: true values less those computed, to first order.

    position, velocity: (N+1, 3, nb) m, m/s; tension: (N, nb) N; moment: (N+1, 3, nb) N m, inertial; stiffness: (N+1,)
    N m2, by which all of a moment makes a curvature; resultants: (2, 3, nb) N, of the forces on the first and the last
    node, zero where they are given; clamped: (2,) 1 where an end prescribes a tangent.  share: (nb,) part of
    it that a linear estimate may be wrong by, where that is largest; at: (nb,) m, there.
    """

    position: Floats
    velocity: Floats
    tension: Floats
    moment: Floats
    stiffness: Floats
    resultants: Floats
    clamped: np.ndarray
    share: Floats
    at: Floats


def _dot(a: Floats, b: Floats) -> Floats:
    """a . b of vectors (..., 3), as (..., 1)."""
    return np.asarray(a[..., :1] * b[..., :1] + a[..., 1:2] * b[..., 1:2] + a[..., 2:] * b[..., 2:])


class Corrector:
    """The error of one line: its arrays, which the compiled run advances (`bind`), and what it makes of outputs.

    arrays, errors: as watch.bending_error has them; sampled: (2, K) what an output takes of the error after the last
    step and before it; torque: (4,) of the whole line, as named there.
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
        self.arrays, self.errors = error_arrays(n), np.zeros((2, 4, n + 1, 4))
        self.sampled, self.torque = self.arrays.sampled, self.arrays.torque
        self.sea = no_sea(n)  # of the run
        self._table = Table(blank_error_job())

    @property
    def error(self) -> Floats:
        """(4, N+1, 4) of position (m), velocity, algorithmic and true acceleration, and in the last column of the spin

        of the cell after a node.
        """
        return np.asarray(self.errors[self.arrays.found[CURRENT]])

    @property
    def position(self) -> Floats:
        """Error (N+1, 3) m of the nodes: where the rod is, less where the line is."""
        return self.error[0, :, :3]

    @property
    def most(self) -> float:
        """Error, m, beyond which it is clipped."""
        return MOST * self.length

    @property
    def finite(self) -> bool:
        """Whether the error of the last step was."""
        return bool(self.arrays.found[FINITE])

    @property
    def clipped(self) -> int:
        """Nodes at which it was clipped."""
        return int(self.arrays.found[CLIPPED])

    @property
    def furthest(self) -> int:
        """The node with the largest error; -1: unknown."""
        return int(self.arrays.found[FURTHEST])

    def taking_over(self, old: Corrector) -> Corrector:
        """The error of another line of the same length, between its nodes; spins that it does not have are gone."""
        s, then, now = self.line.s, old.line.s, self.line
        for mine, its in ((self.error, old.error), (self.arrays.slid[None], old.arrays.slid[None])):
            for k in range(its.shape[0]):
                for j in range(its.shape[2]):
                    mine[k, :, j] = np.interp(s, then, its[k, :, j])
        self.error[:, :-1, 3] *= now.spin
        self.error[:, -1, 3] = 0.0
        error, tension, moment, left = self._parts(self.sampled[:1])
        _, old_tension, old_moment, old_left = old._parts(old.sampled[:1])
        error[0], left[0] = self.error[:2], old_left[0]
        tension[0] = np.interp(0.5 * (s[1:] + s[:-1]), 0.5 * (then[1:] + then[:-1]), old_tension[0])
        for j in range(3):
            moment[0, :, j] = np.interp(s, then, old_moment[0, :, j])
        self.torque[:], self.sea = old.torque, old.sea
        return self

    def _parts(self, sampled: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Of rows of samples: error of position and velocity (nb, 2, N+1, 4), of tension (nb, N), moment (nb, N+1, 3)

        N m of the rod less that of the line, and what of it the two nodes at either end lack (nb, 4, 3), as views.
        """
        n, nb = self.line.h.size, len(sampled)
        a, b, c = 8 * (n + 1), 9 * n + 8, 12 * n + 11
        assert sampled.shape[1] == c + 12 == sampled_size(n)
        return (
            sampled[:, :a].reshape(nb, 2, n + 1, 4), sampled[:, a:b], sampled[:, b:c].reshape(nb, n + 1, 3),
            sampled[:, c:].reshape(nb, 4, 3),
        )  # fmt: skip

    def shift(self, sampled: Floats, batch: Batch) -> Shift:
        """What the errors at the outputs of a batch, rows of samples, make of them."""
        error, tension, moment, left = self._parts(sampled)
        now = self._end_forces(batch, error, tension, left, 0.0)
        more = self._end_forces(batch, error, tension, left, SMALL)
        forces = (more - now) / SMALL * batch.held[:, :, None]
        each = (error[:, 0, :, :3], error[:, 1, :, :3], tension, moment, forces)
        r, v, T, M, F = (np.moveaxis(x, 0, -1) for x in each)
        return Shift(r, v, T, M, self.ki * self.line.hn, F, self.bending.tangent, *self._shares(batch, tension))

    def _shares(self, batch: Batch, change: Floats) -> tuple[Floats, Floats]:
        """`share` and `at` of `Shift`; change: (nb, N) N, of tension (docs/theory.md, 14)."""
        line, floor = self.line, self.bending.floor
        lower = np.minimum(np.maximum(batch.T, floor), np.maximum(batch.T + change, floor))
        shares, s = np.where(line.spin == 0, np.abs(change) / lower, 0.0), 0.5 * (line.s[:-1] + line.s[1:])
        kinks = [i for i in np.flatnonzero(self.bending.kinks) if self._may_kink(int(i))]
        if kinks:
            shares = np.hstack([shares, np.stack([self._kink_share(batch, int(i)) for i in kinks], axis=1)])
            s = np.append(s, line.s[kinks])
        return shares.max(axis=1), s[shares.argmax(axis=1)]

    def _may_kink(self, i: int) -> bool:
        """Whether node i, where the cable has bending stiffness, lies between catenaries or at a clamped one."""
        n, spin = self.line.h.size, self.line.spin
        inside = 0 < i < n and not (spin[i - 1] or spin[i])
        return bool(self.ki[i] > 0.0 and (inside or (i in (0, n) and not spin[min(i, n - 1)])))

    def _kink_share(self, batch: Batch, i: int) -> Floats:
        """Part (nb,) by which the estimate for a kink, or a clamp, is wrong: half a kink counts as a clamp at an angle.

        A taut elastica at an angle a to its chord is exactly 2 lambda sin(a/2) beside it and 4 lambda (1 - cos(a/2))
        short; the estimate has lambda times half the turn (`neglected_moments.bend`) for the first, nothing for the
        second.
        """
        n = self.line.h.size
        chord = batch.e[:, min(i, n - 1)]
        other = batch.e[:, i - 1] if 0 < i < n else batch.frame[:, int(i == n), [2, 5, 8]]
        cosine = _dot(chord, other)[:, 0] / np.sqrt(_dot(chord, chord) * _dot(other, other))[:, 0]
        turn = np.arccos(np.clip(cosine, -1.0, 1.0))
        a, estimate = (0.5 * turn, np.tan(0.5 * turn)) if 0 < i < n else (turn, 2.0 * np.tan(0.5 * turn))
        beside, short = estimate - 2.0 * np.sin(0.5 * a), 4.0 * (1.0 - np.cos(0.5 * a))
        return np.divide(np.hypot(beside, short), estimate, out=np.zeros(turn.size), where=estimate > 0.0)

    def _end_forces(self, batch: Batch, error: Floats, tension: Floats, left: Floats, part: float) -> Floats:
        """Forces (nb, 2, 3) N with which the first and the last cell pull at their nodes, a part of the error added."""
        line, n = self.line, self.line.h.size
        M, shift = part * left, part * error[:, 0, :, :3]
        if line.spin[0] or line.spin[-1]:  # directors carried to the chords, and spun
            e = batch.e + np.diff(shift, axis=1)
            a = self._carried(batch, e, part * error[:, 0, :-1, 3])
            found, strain = np.zeros((2, n + 1, 3))
            for k in range(len(e)):
                of = ends_in(batch, k), e[k], batch.v[k], a[k], batch.w[k], batch.T[k], NO_TURN
                observe(line, *of, Observed(found, strain, np.zeros(4)))
                M[k] += found[[0, 1, n - 1, n]]
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
        normals, depth = planes_under(sea, r.reshape(-1, 3))
        normals, depth = normals.reshape(r.shape), depth.reshape(r.shape[:2])
        rates = -(v[..., 0] * normals[..., 0] + v[..., 1] * normals[..., 1] + v[..., 2] * normals[..., 2])
        out = np.zeros((len(depth), 3))
        for i in np.flatnonzero(depth.max(axis=1) > 0.0):
            p, q = depth[i].tolist(), rates[i].tolist()
            out[i] = contact(*p, *q, self.line.h[cell], sea.stiffness, sea.damping, sea.onset)[0] * normals[i, 0]
        return out

    def rest(self, sea: Sea, ends: Ends, state: State, with_friction: bool = False) -> None:
        """The error of an equilibrium; with_friction: friction took part in it, so that a shift is felt as friction."""
        line = self.line._replace(bits=self.line.bits & ~(WAVES if with_friction else FRICTION | WAVES))
        if line.bits & FRICTION:
            friction_axes(sea, state.r, state.e, state.slip, state.grip)
        work = workspace(line.h.size, keep=True)
        ca = ANCHOR * self.scale / (float(line.mass.sum()) * self.length)
        still, no_spin = np.zeros_like(state.r), np.zeros_like(state.w)
        entry.assembly(line, sea, ends, state._replace(v=still, vd=still, w=no_spin, wd=no_spin), 0.0, ca, work)
        self.arrays.slid[:] = 0.0
        clock, counts = Clock(), Counts()
        table = Table(blank_error_job())
        self._fill(table, line, sea, ends, (state, state), clock, counts, work._replace(u=still))
        advance_error(table.numbers)

    def bind(
        self, line: Line, sea: Sea, ends: Ends, states: tuple[State, State], clock: Clock, counts: Counts,
        work: Work,
    ) -> np.ndarray:  # fmt: skip
        """The table by which `advance_error` follows the steps of a run.

        states: which take turns; clock, counts: of the run; work: where the factors of its last matrix are kept.
        """
        self.sea = sea
        self._fill(self._table, line, sea, ends, states, clock, counts, work)
        return self._table.numbers

    def address(self) -> int:
        """Where the machine code of `advance_error` is."""
        return int(advance_error.address(self._table.numbers))

    def _fill(
        self, table: Table, line: Line, sea: Sea, ends: Ends, states: tuple[State, State], clock: Clock,
        counts: Counts, work: Work,
    ) -> None:  # fmt: skip
        table.bind(
            line=line, sea=sea, ends=ends, bending=self.bending, even=states[0], odd=states[1], u=work.u, clock=clock,
            counts=counts, X=work.X, W=work.W, errors=self.errors, most=self.most, arrays=self.arrays,
        )  # fmt: skip
