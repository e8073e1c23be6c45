"""What is known of a batch of states: quantities on nodes, cells and the output grid, each computed once if needed.

Second order everywhere: positions by cubic Hermite interpolation of the nodes (one-sided
at joints and at point loads, where the tangent may kink), tensions and tangents from the middle of the
cells, moments and curvatures from the nodes, zone by zone.

Arrays have the node, cell or output point first, then the component, and the nb outputs of the batch last: one numpy
operation and one product with a sparse matrix (output_grid) serve the batch.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from functools import cached_property
from types import MappingProxyType

import numpy as np

from hybrid.kernels.link import link_of
from hybrid.kernels.observed_outputs import observed
from hybrid.kernels.report import (
    CONTACT_FORCE,
    FORCE_A,
    LENGTH_OUT,
    PAYOUT_POWER,
    SEABED_ENERGY,
    SELF_CONTACT_ENERGY,
    STRETCH_ENERGY,
)
from hybrid.kernels.state import NO_TURN, Batch, Ends, Floats, Line, Sea
from hybrid.kernels.zone_torque import TORQUE, TURN, torsion_energy
from hybrid.outputs.local_means import means_beside
from hybrid.outputs.output_grid import Grid
from hybrid.outputs.touchdown import Touchdown, carried, contact_pressure, penetration, sinking, touchdown
from hybrid.solve.bending_corrector import Shift

# Times sqrt(EI/T): a rod cell longer than that does not show how bending fades at its end.
UNRESOLVED = 3.0


def cross(a: Floats, b: Floats) -> Floats:
    """a x b of vectors (n, 3, nb)."""
    out = np.empty(np.broadcast(a, b).shape)
    out[:, 0] = a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1]
    out[:, 1] = a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2]
    out[:, 2] = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return out


def dot(a: Floats, b: Floats) -> Floats:
    """a . b of vectors (n, 3, nb)."""
    return np.asarray(a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2])


def size(a: Floats) -> Floats:
    """Length of vectors (n, 3, nb)."""
    return np.asarray(np.sqrt(dot(a, a)))


def last(x: Floats) -> Floats:
    """A copy with the first axis, the outputs, moved to the end."""
    return np.ascontiguousarray(x.transpose(*range(1, x.ndim), 0))


class Observation:
    """A batch of states looked at, as computed and (`corrected`) with what leaving bending out shifts it by."""

    def __init__(
        self, line: Line, sea: Sea, grid: Grid, batch: Batch, varied: Mapping[str, Floats] = MappingProxyType({})
    ) -> None:
        """varied: arrays (nb, ...) of the line by name, where it is another one in every output."""
        self.line, self.sea, self.grid, self.batch, self._varied = line, sea, grid, batch, varied
        self.shift: Shift | None = None
        self._corrects: Observation | None = None  # the observation that this one corrects

    def corrected(self, shift: Shift) -> Observation:
        """The same states with position, tension, curvature and moment corrected; energies and contact stay."""
        other = self.on(self.grid)
        for name in ("r", "v", "e", "T", "length", "d"):
            other.__dict__.pop(name, None)
        other.shift, other._corrects = shift, self
        return other

    def on(self, grid: Grid) -> Observation:
        """The same on other points of the same stretches."""
        other = copy(self)
        other.grid = grid
        for name in ("tension", "tangent", "moment", "torque", "curvature_twist"):
            other.__dict__.pop(name, None)
        return other

    @property
    def _plain(self) -> Observation:
        """As computed.  (An attribute that refers to itself would keep a batch until garbage is searched for.)"""
        return self._corrects or self

    def of_line(self, name: str, at: int | slice) -> Floats:
        """Values of the line at nodes or cells, (..., nb), or (..., 1) where they are the same in all outputs."""
        if name in self._varied:
            return np.moveaxis(self._varied[name][:, at], 0, -1)
        return np.asarray(getattr(self.line, name)[at][..., None])

    # ---- what was computed --------------------------------------------------------------------

    @cached_property
    def r(self) -> Floats:
        """(N+1, 3, nb) m."""
        r = last(self.batch.r)
        return r if self.shift is None else r + self.shift.position

    @cached_property
    def v(self) -> Floats:
        """(N+1, 3, nb) m/s."""
        v = last(self.batch.v)
        return v if self.shift is None else v + self.shift.velocity

    @cached_property
    def e(self) -> Floats:
        """(N, 3, nb) m, chords."""
        e = last(self.batch.e)
        return e if self.shift is None else e + np.diff(self.shift.position, axis=0)

    @cached_property
    def T(self) -> Floats:
        """(N, nb) N."""
        T = last(self.batch.T)
        return T if self.shift is None else T + self.shift.tension

    @cached_property
    def length(self) -> Floats:
        """(N, nb) m, of the chords."""
        return size(self.e)

    @cached_property
    def d(self) -> Floats:
        """(N, 3, nb) directions of the chords."""
        return np.asarray(self.e / self.length[:, None])

    @cached_property
    def _observed(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Moments (N+1, 3, nb) N m, strains (N+1, 3, nb) rad, energies (5, nb) J and bends (N+1, nb) 1/m of what was

        computed.
        """
        if self._corrects is not None:
            return self._corrects._observed
        M, strain, energy, bend = observed(self.line, self.batch, self._varied)
        if len(M) < self.batch.t.size:  # a catenary has neither
            M = strain = np.broadcast_to(np.zeros(1), (self.batch.t.size, *M.shape[1:]))
        return last(M), last(strain), last(energy), bend.T

    @property
    def bends(self) -> Floats:
        """(N+1, nb) 1/m, from cell to cell, of what was computed, as of kernels.observed_outputs."""
        return self._observed[3]

    # ---- along the line -----------------------------------------------------------------------

    @cached_property
    def tension(self) -> Floats:
        """(ns, nb) N: of the cells, and at the ends the pull of what holds them."""
        ends = []
        for k, first, second in ((0, 0, 1), (1, -1, -2)):
            t = 1.5 * self.d[first] - 0.5 * self.d[second] if len(self.d) > 1 else self.d[first]
            if self.line.element[first] or (self.shift is not None and self.shift.clamped[k]):
                t = self.batch.frame[:, k, 2::3].T  # a clamp or guide knows the tangent
            if self.loaded(k):
                ends.append(self._end_tension(k))
            else:
                force = self.reaction(k) if k else -self.reaction(k)
                ends.append((force * t).sum(axis=0) / np.sqrt((t * t).sum(axis=0)))
        found = self.grid.held @ np.concatenate([ends[:1], self.T, ends[1:]])
        return found if self.shift is None else found - self.grid.sides @ self._borne_by_bending(self.shift)

    def _borne_by_bending(self, shift: Shift) -> Floats:
        """Tension (n sides, nb), N, that a catenary has and the rod in its place has not: M^2/(2 EI) of an elastica,

        whose force is that of the catenary but across its tangent in part.  The ends' tension knows it already.
        """
        out = self._square_of_moment(self.node_moment) * 0.5
        for zone, (a, b, o) in zip(self.grid.parts, self.grid.spans, strict=True):
            if zone.kind == "rod":
                out[o : o + b - a + 1] = 0.0
        out[[0, -1]] = 0.0
        EI = shift.stiffness[self.grid.side_nodes][:, None]
        return np.divide(out, EI, out=np.zeros_like(out), where=EI > 0.0)

    @cached_property
    def tangent(self) -> Floats:
        """(ns, 3, nb)."""
        t = self.grid.cells @ self.d
        length = size(t)
        if length.min() < 1e-9:  # in the very middle of a fold the two sides cancel: take the nearest cell's
            middles = 0.5 * (self.line.s[:-1] + self.line.s[1:])
            for g, i in np.argwhere(length < 1e-9):
                t[g, :, i] = self.d[int(np.argmin(np.abs(middles - self.grid.s[g]))), :, i]
                length[g, i] = 1.0
        return np.asarray(t / length[:, None])

    @property
    def theta(self) -> Floats:
        """(ns, nb) rad, from the z axis."""
        return np.arccos(np.clip(self.tangent[:, 2], -1, 1))

    @property
    def phi(self) -> Floats:
        """(ns, nb) rad, from the x axis."""
        return np.arctan2(self.tangent[:, 1], self.tangent[:, 0])

    @property
    def node_moment(self) -> Floats:
        """(N+1, 3, nb) N m, inertial."""
        return self._observed[0] if self.shift is None else self._observed[0] + self.shift.moment

    @cached_property
    def moment(self) -> Floats:
        """(ns, 3, nb) N m, inertial."""
        return self.grid.sides @ self.node_moment[self.grid.side_nodes]

    @cached_property
    def torque(self) -> Floats:
        """(ns, nb) N m, about the tangent."""
        torque = dot(self.moment, self.tangent)
        return torque + self.grid.sides @ self._passed if self.batch.turn.size else torque

    @cached_property
    def _passed(self) -> Floats:
        """Torque (n sides, nb) N m that catenary zones pass on, on their nodes and the joints of rods beside them."""
        out = np.zeros((len(self.grid.side_nodes), self.batch.t.size))
        for z, (first, last) in enumerate(self.line.torsion[:, :2].astype(int)):
            for a, b, o in self.grid.spans:
                low, high = max(a, first), min(b, last)
                if low <= high:
                    out[o + low - a : o + high - a + 1] = self.batch.turn[:, z, TORQUE]
        return out

    def end_moment(self, k: int) -> Floats:
        """(3, nb) N m, inertial, at end k: moment of what is after it on what is before it."""
        moment, torsion = self.node_moment[-k], self.line.torsion
        if self.batch.turn.size and (torsion[-1, 1] == self.line.h.size if k else torsion[0, 0] == 0.0):
            tangent = self.batch.frame[:, k, 2::3]
            moment = moment + (self.batch.turn[:, -k, TORQUE, None] * tangent).T
        return moment

    @property
    def bending_moment(self) -> Floats:
        """(ns, nb) N m."""
        return size(self.moment - self.torque[:, None] * self.tangent)

    @property
    def shear(self) -> Floats:
        """(ns, nb) N."""
        V = cross(self.d, np.diff(self.node_moment, axis=0)) / self.length[:, None]
        if self.shift is None:
            V[self.line.spin == 0] = 0.0
        return size(self.grid.cells @ V)

    # ---- curvature and twist ------------------------------------------------------------------

    @cached_property
    def curvature_twist(self) -> Floats:
        """(ns, 2, nb) 1/m."""
        strains = self._plain._strains
        if self.shift is not None:
            strains = np.stack([self._curvature_of_moment(self.shift), strains[:, 1]], axis=1)
        return self.grid.sides @ strains

    @cached_property
    def _strains(self) -> Floats:
        """Curvature and twist (n sides, 2, nb), 1/m, of what was computed."""
        out = np.zeros((len(self.grid.side_nodes), 2, self.batch.t.size))
        for zone, (a, b, o) in zip(self.grid.parts, self.grid.spans, strict=True):
            side = out[o : o + b - a + 1]
            if zone.kind == "rod":
                self._strains_of_rod(side, a, b)
                continue
            side[:, 0] = self.bends[a : b + 1]
            if b - a < 2:
                continue
            first, last = (a, a + 1, min(a + 2, b)), (b, b - 1, max(b - 2, a))
            for row, one, two, nodes in ((0, 1, 2, first), (-1, -2, -3, last)):
                if b - a >= 4:
                    x, x1, x2 = (self.of_line("s", k) for k in nodes)
                    p = (x - x1) / (x2 - x1)
                    side[row, 0] = np.maximum(0.0, (1 - p) * side[one, 0] + p * side[two, 0])
                else:
                    side[row, 0] = side[one, 0]
        self._bend_on_through_joints(out)
        return out

    def _bend_on_through_joints(self, strains: Floats) -> None:
        """At a joint, curvature of a rod whose cell is too long to show how the bend fades: that of the catenary."""
        kinds, spans = [zone.kind for zone in self.grid.parts], self.grid.spans
        for k in range(1, len(kinds)):
            if kinds[k - 1] == kinds[k]:
                continue
            last, first = spans[k - 1][2] + spans[k - 1][1] - spans[k - 1][0], spans[k][2]
            node, rod = spans[k][0], kinds[k] == "rod"
            cell, inner = (node, node + 1) if rod else (node - 1, node - 1)
            if not self.line.element[inner]:
                continue
            EI = self.batch.stiffness(inner, self.line).T[:2].mean(axis=0) * self.of_line("hn", inner)
            long = self.line.h[cell] ** 2 * self.T[cell] > UNRESOLVED**2 * EI
            mine, its = (first, last) if rod else (last, first)
            strains[mine, 0] = np.where(long, strains[its, 0], strains[mine, 0])

    def _strains_of_rod(self, side: Floats, a: int, b: int) -> None:
        """Curvature and twist (b - a + 1, 2, nb) of a rod from node a to node b."""
        k = self._observed[1][a : b + 1] / self.of_line("hn", slice(a, b + 1))[:, None]
        side[:, 0], side[:, 1] = np.hypot(k[:, 0], k[:, 1]), k[:, 2]
        for node, row, cell in ((a, 0, a), (b, -1, b - 1)):
            if not self.line.element[node]:  # a joint or an end without element: strain of the moment that is given
                side[row] = self._strain_of_moment(node, cell)
            elif node in self._changes and self.line.element[2 * cell + 1 - node]:
                side[row] = self._strain_of_moment(node, cell)  # the moment is one, the stiffness is not
            elif node in (0, self.line.h.size):  # an angular spring at a clamp bends, but does not twist
                side[row, 1] *= self.line.hn[node] / (0.5 * self.line.h[cell])
            if self.line.tension_twist.size and b - a > 1:
                side[row, 1] -= self._twist_to_node(cell, cell + 1 if cell == node else cell - 1)

    @cached_property
    def _changes(self) -> set[int]:
        """Nodes where one section ends and the next begins."""
        return {int(np.argmin(np.abs(self.line.s - x))) for x in self.grid.changes}

    def _twist_to_node(self, cell: int, inner: int) -> Floats:
        """Twist (nb,) 1/m by which tension turns the middle of a cell more than its end at a node."""
        h, T = self.line.h, self.batch.T
        more = (T[:, cell] - T[:, inner]) * h[cell] / (h[cell] + h[inner])
        return np.asarray(2.0 * self.line.tension_twist[cell] / h[cell] * more)

    def _strain_of_moment(self, node: int, cell: int) -> Floats:
        """Curvature and twist (2, nb) at a rod's end that carries the given moment (at a joint that of its zone)."""
        line, torque = self.line, np.zeros(1)
        for z, (first, last) in enumerate(line.torsion[:, :2]):
            if node in (first, last) and self.batch.turn.size:
                torque = self.batch.turn[:, z, TORQUE]
        inner = cell + 1 if cell == node else cell
        if not line.element[inner]:
            return np.zeros((2, self.batch.t.size))
        hn = self.of_line("hn", inner)
        B = self.batch.stiffness(inner, line).T * hn
        k0 = line.k0[inner][:, None] / hn
        a1, d, M = self.batch.a1[:, cell].T[None], self.d[cell : cell + 1], self.node_moment[node : node + 1]
        body = np.concatenate([dot(a1, M), dot(cross(d, a1), M), dot(d, M) + torque])
        if line.tension_twist.size:
            k0 = k0 + np.zeros_like(body)
            k0[2] -= 2.0 * line.tension_twist[cell] / line.h[cell] * self.batch.T[:, cell]
        k = k0 + np.divide(body, B, out=np.zeros_like(body), where=np.broadcast_to(B > 0, body.shape))
        return np.stack([np.hypot(k[0], k[1]), k[2]])

    def _curvature_of_moment(self, shift: Shift) -> Floats:
        """Curvature (n sides, nb) 1/m of all of the moment, with what was left out; without stiffness, as it is."""
        bending = np.sqrt(self._square_of_moment(self.node_moment))
        EI = shift.stiffness[self.grid.side_nodes][:, None]
        return np.divide(bending, EI, out=self._plain._strains[:, 0].copy(), where=EI > 0.0)

    def _square_of_moment(self, moment: Floats) -> Floats:
        """Of moments (N+1, 3, nb) N m the square of what bends (n sides, nb)."""
        d = self._plain.d
        t = np.concatenate([d[:1], d[1:] + d[:-1], d[-1:]])
        t /= np.maximum(size(t), 1e-12)[:, None]
        bending = moment - dot(moment, t)[:, None] * t
        return np.asarray((bending * bending).sum(axis=1)[self.grid.side_nodes])

    @cached_property
    def link(self) -> Floats:
        """(4, nb): turns of twist, writhe and link, crossings; of what was computed."""
        if self._corrects is not None:
            return self._corrects.link
        b, rows = self.batch, []
        ends = map(Ends, b.held, b.position, b.frame, b.spin, b.force, b.moment)
        for k, row in enumerate(
            zip(ends, b.r, b.e, b.a1, b.turn if b.turn.size else [NO_TURN] * b.t.size, strict=True)
        ):
            rows.append(link_of(b.line(k, self.line), *row))
        return np.stack(rows, axis=1)

    # ---- at the ends --------------------------------------------------------------------------

    def reaction(self, k: int) -> Floats:
        """(3, nb) N: force of the support, or of an end body, on the cable at end k; else the force applied there."""
        b, first, out = self.batch, -k, 2.0 * k - 1.0
        held = b.held[:, k] != 0
        force = -b.report[:, FORCE_A + 3 * k : FORCE_A + 3 * k + 3].T
        if self.shift is not None:
            force = force - self.shift.resultants[k]
        if held.all():
            return np.asarray(force)
        given = out * self._end_tension(k) * self.d[first] if self.loaded(k) else b.force[:, k].T
        return np.where(held, force, given)

    def loaded(self, k: int) -> bool:
        """Whether there is a point load at end k."""
        s = self.line.s
        return any(abs(x - s[-k]) < 1e-9 * s[-1] for x in self.grid.loads)

    def _end_tension(self, k: int) -> Floats:
        """Tension (nb,) N of the cable at end k, extrapolated from its last cells."""
        first, second = (0, 1) if k == 0 else (-1, -2)
        T, h = self.T, self.batch.h.T if self.batch.h.size else self.line.h
        return T[first] + (T[first] - T[second]) * h[first] / (h[first] + h[second]) if len(h) > 1 else T[0]

    # ---- seabed and energies, of what was computed --------------------------------------------

    @cached_property
    def _depth(self) -> Floats:
        """(N+1, nb) m, below where contact begins."""
        return penetration(self.sea, self._plain.r)

    @cached_property
    def touchdown(self) -> Touchdown:
        s = self._varied["s"].T if "s" in self._varied else self.line.s[:, None]
        return touchdown(s, self._depth, self._plain.r)

    @property
    def contact(self) -> Floats:
        """(ns, nb) N/m."""
        q = contact_pressure(self.sea, self._depth, sinking(self.sea, self._plain.r, self._plain.v))
        return np.asarray(self.grid.chords @ carried(self.batch.h.T if self.batch.h.size else self.line.h, q))

    @property
    def self_contact(self) -> Floats:
        """(ns, nb) N/m, force across where the line touches itself: means of what lies nearest to an output point."""
        touch = self.batch.touch
        if not touch.size:
            return np.zeros((self.grid.s.size, self.batch.t.size))
        return means_beside(self.grid.s, self.line.s, touch) if self.grid.s.size > 1 else self.grid.chords @ touch.T

    @property
    def payout(self) -> Floats:
        """(3, nb) of a line that is paid out: its length, m, the rate of that, m/s, power of the winch on it, W."""
        return self.batch.report[:, LENGTH_OUT : PAYOUT_POWER + 1].T

    @property
    def contact_force(self) -> Floats:
        """(nb,) N, along the normal."""
        return self.batch.report[:, CONTACT_FORCE]

    @cached_property
    def energies(self) -> dict[str, Floats]:
        """(nb,) J: kinetic, bending, torsion, stretch, potential (of weight and buoyancy), stored by the seabed, by

        contact of the line with itself.
        """
        kinetic, bending, torsion, stretch, potential = self._observed[2]
        if self.batch.turn.size:
            torsion = torsion + torsion_energy(self.line, self.batch.turn[:, :, TURN], self.batch.T)
        if self.line.law.size:
            stretch = self.batch.report[:, STRETCH_ENERGY]
        return {
            "kinetic": kinetic, "bending": bending, "torsion": torsion, "stretch": stretch, "potential": potential,
            "contact": self.batch.report[:, SEABED_ENERGY],
            "self_contact": self.batch.report[:, SELF_CONTACT_ENERGY],
        }  # fmt: skip
