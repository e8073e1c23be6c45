"""What is known of a batch of states: quantities on nodes, cells and the output grid, each computed once if needed.

Second order everywhere: positions by cubic Hermite interpolation of the nodes (one-sided
at joints and at point loads, where the tangent may kink), tensions and tangents from the middle of the
cells, moments and curvatures from the nodes, zone by zone.

Arrays have the node, cell or output point first, then the component, and the nb outputs of the batch last: one numpy
operation and one product with a sparse matrix (output_grid) serve the batch.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from hybrid.kernels.laws.bending_law import RIGID
from hybrid.kernels.laws.seabed import planes_under
from hybrid.kernels.laws.soil import PRESSES
from hybrid.kernels.march.link import link_of
from hybrid.kernels.march.zone_torque import TORQUE, TURN, torsion_energy
from hybrid.kernels.state.report import (
    CONTACT_FORCE,
    FORCE_A,
    LENGTH_OUT,
    PAYOUT_POWER,
    SEABED_ENERGY,
    SELF_CONTACT_ENERGY,
    SOIL,
    STRETCH_ENERGY,
)
from hybrid.kernels.state.state import NO_TURN, Batch, Ends, Floats, Line, Sea
from hybrid.outputs.observed_states import ObservedStates, across, cross, means_beside, means_on_line, size
from hybrid.outputs.strains import EndLayer, between_nodes, part_without_spring, strains


def links(batch: Batch, line: Line) -> Floats:
    """(4, nb): turns of twist, writhe and link, crossings, of the outputs of a line."""
    ends = map(Ends, batch.held, batch.position, batch.frame, batch.spin, batch.force, batch.moment)
    turns = batch.turn if batch.turn.size else [NO_TURN] * batch.t.size
    each = zip(ends, batch.r, batch.e, batch.a1, turns, strict=True)
    return np.stack([link_of(batch.line(k, line), *row) for k, row in enumerate(each)], axis=1)


class Observation(ObservedStates):
    """A batch of states looked at: quantities along the line on the points of its output grid."""

    # ---- along the line -----------------------------------------------------------------------

    @cached_property
    def tension(self) -> Floats:
        """(ns, nb) N: of the cells, and at the ends the pull of what holds them."""
        ends = []
        for k in (0, 1):
            t = self.at_end(self.d, k)
            if len(self.d) > 1:
                t = np.where(self._kink_beside(k), t, 1.5 * t - 0.5 * self.at_end(self.d, k, 1))
            knows = self.has_element(k)
            if np.any(knows):  # a clamp or guide knows the tangent
                t = np.where(knows, self._held_tangent(k), t)
            if self.loaded(k):
                ends.append(self._end_tension(k))
            else:
                force = self.reaction(k) if k else -self.reaction(k)
                ends.append((force * t).sum(axis=0) / np.sqrt((t * t).sum(axis=0)))
        return self.grid.held @ self.with_ends(self.T, ends)

    def _held_tangent(self, k: int) -> Floats:
        """Tangent (3, nb) of the line at the clamp at end k, not normalized; as `watch.extremes.beyond_spring`."""
        t, d = self.batch.frame[:, k, 2::3].T, self.at_end(self.d, k)
        part = 0.5 * self.at_end(self.cell_lengths, k) / self.at_end(self.of_line("hn", slice(None)), k)
        if part.min() > RIGID:
            return t
        angle = np.arccos(np.clip((t * d).sum(axis=0), -1.0, 1.0))
        n = len(self.d)
        if self.line.slip_law.size:
            bend = self.element_strains[k * n, :2] - self.of_line("k0", k * n)[:2]
            part = part_without_spring(self, k * n, k * (n - 1), bend)
        elif self.line.bend_law.size:
            part = part_without_spring(self, k * n, k * (n - 1), np.stack([angle, 0.0 * angle]))
        between = np.sin(part * angle) * t + np.sin((1.0 - part) * angle) * d
        return np.where((part > RIGID) | (angle < 1e-6), t, between)

    @cached_property
    def tangent(self) -> Floats:
        """(ns, 3, nb)."""
        t = self.grid.cells @ self.d
        length = size(t)
        if length.min() < 1e-9:  # in the very middle of a fold the two sides cancel: take the nearest cell's
            for g, i in np.argwhere(length < 1e-9):
                t[g, :, i] = self.d[self._cell_at(int(g)), :, i]
                length[g, i] = 1.0
        return np.asarray(t / length[:, None])

    def _cell_at(self, point: int) -> int:
        """The cell whose middle is nearest to an output point."""
        middles = 0.5 * (self.line.s[:-1] + self.line.s[1:])
        return int(np.argmin(np.abs(middles - self.grid.s[point])))

    @property
    def theta(self) -> Floats:
        """(ns, nb) rad, from the z axis."""
        return np.arccos(np.clip(self.tangent[:, 2], -1, 1))

    @property
    def phi(self) -> Floats:
        """(ns, nb) rad, from the x axis."""
        return np.arctan2(self.tangent[:, 1], self.tangent[:, 0])

    @cached_property
    def moment(self) -> Floats:
        """(ns, 3, nb) N m, inertial."""
        return self.grid.sides @ self.node_moment[self.grid.side_nodes]

    @cached_property
    def torque(self) -> Floats:
        """(ns, nb) N m, about the tangent.

        Found at the nodes, and interpolated: the tangent between nodes, off by the square of the cell length, would
        make a torque of the bending moment.
        """
        torque = _node_torques(self)[self.grid.side_nodes]
        return self.grid.sides @ (torque + _passed_torques(self) if self.batch.turn.size else torque)

    @cached_property
    def bending_moment(self) -> Floats:
        """(ns, nb) N m."""
        return size(self.grid.sides @ across(self.node_moment, self.node_tangent)[self.grid.side_nodes])

    @property
    def shear(self) -> Floats:
        """(ns, nb) N."""
        V = cross(self.d, np.diff(self.node_moment, axis=0)) / self.length[:, None]
        V[self.line.spin == 0] = 0.0
        return size(self.grid.cells @ V)

    # ---- curvature and twist ------------------------------------------------------------------

    @cached_property
    def curvature_twist(self) -> Floats:
        """(ns, 2, nb) 1/m."""
        strains = self._strains
        bend = self.bend_directions * strains[:, :1]
        found = self.grid.sides @ np.concatenate([bend, strains[:, 1:]], axis=1)
        for layer, end in self._taken_at_ends:  # which is no straight line in cells that are long for it
            direction = self.bend_directions[layer.rows[0]]
            for points, less in between_nodes(self, layer):
                found[points, :-1] += (less * end)[:, None] * direction
        return np.stack([np.sqrt((found[:, :-1] ** 2).sum(axis=1)), found[:, -1]], axis=1)

    @property
    def curvature_on_sides(self) -> Floats:
        """(n sides, nb) 1/m, at the nodes of the grid's stretches."""
        return np.abs(self._strains[:, 0])

    @cached_property
    def _strains_and_taken(self) -> tuple[Floats, list[tuple[EndLayer, Floats]]]:
        return strains(self)

    @property
    def _strains(self) -> Floats:
        """Curvature and twist (n sides, 2, nb), 1/m."""
        return self._strains_and_taken[0]

    @property
    def _taken_at_ends(self) -> list[tuple[EndLayer, Floats]]:
        """Layers that catenaries have not at their ends, and the curvature (nb,) 1/m of each without that."""
        return self._strains_and_taken[1]

    @cached_property
    def link(self) -> Floats:
        """(4, nb): turns of twist, writhe and link, crossings."""
        return links(self.batch, self.line)

    # ---- at the ends --------------------------------------------------------------------------

    def end_moment(self, k: int) -> Floats:
        """(3, nb) N m, inertial, at end k: moment of what is after it on what is before it."""
        moment, torsion = self.at_end(self.node_moment, k), self.line.torsion
        if self.batch.turn.size and (torsion[-1, 1] == self.line.h.size if k else torsion[0, 0] == 0.0):
            tangent = self.batch.frame[:, k, 2::3]
            moment = moment + (self.batch.turn[:, -k, TORQUE, None] * tangent).T
        return moment

    def reaction(self, k: int) -> Floats:
        """(3, nb) N: force of the support, or of an end body, on the cable at end k; else the force applied there."""
        b = self.batch
        held = b.held[:, k] != 0
        force = -b.report[:, FORCE_A + 3 * k : FORCE_A + 3 * k + 3].T
        if held.all() or self.loaded(k):
            return np.asarray(force)
        return np.where(held, force, b.force[:, k].T)

    def loaded(self, k: int) -> bool:
        """Whether there is a point load at end k."""
        s = self.line.s
        return any(abs(x - s[-k]) < 1e-9 * s[-1] for x in self.grid.loads)

    def _end_tension(self, k: int) -> Floats:
        """Tension (nb,) N of the cable at end k, extrapolated from its last cells."""
        T, h = self.T, self.cell_lengths
        if len(h) == 1:
            return np.asarray(T[0])
        T0, T1, h0, h1 = (self.at_end(x, k, inward) for x in (T, h) for inward in (0, 1))
        return np.where(self._kink_beside(k), T0, T0 + (T0 - T1) * h0 / (h0 + h1))

    def _kink_beside(self, k: int) -> Floats:
        """Whether a point load or change of section is one cell away from end k, of all outputs (1,) or of each (nb,).

        Nothing is extrapolated across it.
        """
        s = self.line.s[:, None]
        beside, near = self.at_end(s, k, 1), 1e-9 * self.line.s[-1]
        return np.any([np.abs(beside - x) < near for x in self.grid.loads] or [np.zeros(1, bool)], axis=0)

    # ---- seabed and energies, of what was computed --------------------------------------------

    @cached_property
    def depth(self) -> Floats:
        """(N+1, nb) m, below where contact begins."""
        return penetration(self.sea, self.r)

    @cached_property
    def touchdown(self) -> Touchdown:
        s = self._varied["s"].T if "s" in self._varied else self.line.s[:, None]
        return touchdown(s, self.depth, self.r)

    @property
    def contact(self) -> Floats:
        """(ns, nb) N/m."""
        if self.line.bits & SOIL:
            return np.asarray(self.grid.chords @ np.ascontiguousarray(self.batch.soil[:, :, PRESSES].T))
        q = contact_pressure(self.sea, self.depth, sinking(self.sea, self.r, self.v))
        return np.asarray(self.grid.chords @ carried(self.cell_lengths, q))

    @property
    def self_contact(self) -> Floats:
        """(ns, nb) N/m, force across where the line touches itself: means of what lies nearest to an output point."""
        touch = self.batch.touch
        if not touch.size:
            return np.zeros((self.grid.s.size, self.columns))
        if "s" in self._varied:
            each = zip(self.grid.points.T, self._varied["s"], touch, strict=True)
            return np.stack([means_on_line(s, nodes, x) for s, nodes, x in each], axis=1)
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
        """Energies (nb,) J, by name: kinetic, bending, torsion, stretch, potential, of contact.

        potential: of weight and buoyancy; of contact: stored by the seabed, and by contact of the line with itself.
        """
        kinetic, bending, torsion, stretch, potential = self._observed.energy
        if self.batch.turn.size:
            # One by one: the last digit of a product over a batch depends on its size, and so would a resumed run's.
            each = zip(self.batch.turn[:, :, TURN], self.batch.T, strict=True)
            torsion = torsion + np.array([torsion_energy(self.line, turn, T) for turn, T in each])
        if self.line.law.size:
            stretch = self.batch.report[:, STRETCH_ENERGY]
        return {
            "kinetic": kinetic, "bending": bending, "torsion": torsion, "stretch": stretch, "potential": potential,
            "contact": self.batch.report[:, SEABED_ENERGY],
            "self_contact": self.batch.report[:, SELF_CONTACT_ENERGY],
        }  # fmt: skip


def _node_torques(view: ObservedStates) -> Floats:
    """(N+1, nb) N m: of the twist of elements; at ends of the moment there."""
    line, nodes = view.line, slice(None)
    strain = view.element_strains[:, 2] - view.of_line("k0", nodes)[:, 2]
    if line.tension_twist.size:
        by_tension = view.of_line("tension_twist", nodes) * view.T
        strain = strain + np.pad(by_tension, ((0, 1), (0, 0))) + np.pad(by_tension, ((1, 0), (0, 0)))
    torque = np.where(line.element[:, None], view.stiffness(nodes)[:, 2] * strain, 0.0)
    for k in (0, 1):
        moment, tangent = view.at_end(view.node_moment, k), view.at_end(view.node_tangent, k)
        view.put_at_end(torque, k, (moment * tangent).sum(axis=0))
    return torque


def _passed_torques(view: ObservedStates) -> Floats:
    """Torque (n sides, nb) N m that catenary zones pass on, on their nodes and the joints of rods beside them."""
    out = np.zeros((len(view.grid.side_nodes), view.batch.t.size))
    for z, (first, last) in enumerate(view.line.torsion[:, :2].astype(int)):
        for a, b, o in view.grid.spans:
            low, high = max(a, first), min(b, last)
            if low <= high:
                out[o + low - a : o + high - a + 1] = view.batch.turn[:, z, TORQUE]
    return out


@dataclass(frozen=True)
class Probe:
    """A quantity that can be recorded: unit, description, dimensions, how to get it, and what it `needs`, one of.

    value: of an observation, with the dimensions and then the outputs of the batch.
    """

    unit: str
    description: str
    dims: tuple[str, ...]
    value: Callable[[Observation], Floats]
    needs: str = ""
    frame: str = ""


# Where a cable touches the seabed, seen from a batch of states: gaps, lift-off points, contact force.


class Touchdown(NamedTuple):
    """What lies on the seabed, of nb states.  Edges are NaN when nothing does."""

    edges: Floats  # (2, nb) m, arc lengths of the first and the last point in contact
    places: Floats  # (2, 3, nb) m, where they are
    grounded: Floats  # (nb,) m, length in contact


def penetration(sea: Sea, r: Floats) -> Floats:
    """How deep points (n, 3, nb) lie below where contact begins, m: half an onset above the seabed; negative above."""
    if not sea.bed_x.size:
        return np.asarray(sea.offset + 0.5 * sea.onset - _along(sea.normal, r))
    n, _, nb = r.shape
    return planes_under(sea, np.moveaxis(r, 1, 2).reshape(-1, 3))[1].reshape(n, nb)


def sinking(sea: Sea, r: Floats, v: Floats) -> Floats:
    """Rates of `penetration` (n, nb), m/s, of points (n, 3, nb) that move by v."""
    if not sea.bed_x.size:
        return -_along(sea.normal, v)
    n, _, nb = r.shape
    normals = planes_under(sea, np.moveaxis(r, 1, 2).reshape(-1, 3))[0].reshape(n, nb, 3)
    return -_along(np.moveaxis(normals, 2, 0), v)


def _along(normal: Floats, x: Floats) -> Floats:
    """Component of vectors (n, 3, nb) along a normal; by no library, whose sums depend on the number of outputs."""
    return np.asarray(normal[0] * x[:, 0] + normal[1] * x[:, 1] + normal[2] * x[:, 2])


def sum_down(x: Floats) -> Floats:
    """Sums along the first axis in its order, the same bits for any number of outputs."""
    return np.asarray(np.add.accumulate(x, axis=0)[-1])


def touchdown(s: Floats, p: Floats, r: Floats) -> Touchdown:
    """First and last contact, exact for the chords that the contact force is integrated over.

    s: (N+1, 1) m, or (N+1, nb) where it differs; p: (N+1, nb) m, as of `penetration`; NaN: no such node in an output;
    r: (N+1, 3, nb) m, of the nodes.
    """
    below = np.flatnonzero((p > 0.0).any(axis=1))  # nodes that touch in any output
    if not below.size:
        nb = p.shape[1]
        return Touchdown(np.full((2, nb), np.nan), np.full((2, 3, nb), np.nan), np.zeros(nb))
    low, high = max(int(below[0]) - 1, 0), min(int(below[-1]) + 1, len(s) - 1)
    a, b, r = p[low:high], p[low + 1 : high + 1], r[low : high + 1]
    s = np.broadcast_to(s[low : high + 1], (len(r), p.shape[1]))
    touching = np.maximum(a, b) > 0.0
    # the part x0 .. x1 of every touching cell that is in contact
    change = np.where(b == a, 1.0, b - a)
    zero = np.clip(np.where(b == a, 0.0, -a / change), 0.0, 1.0)
    x0 = np.where(a <= 0.0, zero, 0.0)
    x1 = np.where(b <= 0.0, zero, 1.0)
    outputs = np.arange(p.shape[1])
    cells = np.stack([touching.argmax(axis=0), len(a) - 1 - touching[::-1].argmax(axis=0)])
    x = np.stack([x0[cells[0], outputs], x1[cells[1], outputs]])
    h = np.diff(s, axis=0)
    edges = s[cells, outputs] + x * h[cells, outputs]
    # (2, nb, 3), because numpy puts what is indexed by arrays first
    near, far = r[cells, :, outputs], r[cells + 1, :, outputs]
    places = np.moveaxis(near + x[:, :, None] * (far - near), -1, 1)
    grounded = sum_down(h * np.where(touching, x1 - x0, 0.0))
    lies = touching.any(axis=0)
    return Touchdown(np.where(lies, edges, np.nan), np.where(lies, places, np.nan), grounded)


def carried(h: Floats, q: Floats) -> Floats:
    """Force per length N/m that the nodes bear of a pressure q (N+1, nb) N/m: of each node over its half cells.

    It is what stands in the balance of the nodes, so that it has the weight of what lies still; q itself swings about
    that by up to a quarter beside an anchor and at the touchdown, where cells are longer than sqrt(T/k), over which the
    bed takes up the line.  h: (N,) or (N, nb) m, lengths of the cells.
    """
    h = h.reshape(len(h), -1)
    force, length = np.zeros_like(q), np.zeros((len(q), h.shape[1]))
    force[:-1] += h * (2.0 * q[:-1] + q[1:]) / 6.0
    force[1:] += h * (q[:-1] + 2.0 * q[1:]) / 6.0
    length[:-1] += 0.5 * h
    length[1:] += 0.5 * h
    return np.asarray(force / length)


def contact_pressure(sea: Sea, p: Floats, v: Floats) -> Floats:
    """Force per length N/m of the seabed along its normal, at points of penetration p (m) with the rate v (m/s)."""
    o = sea.onset
    linear = sea.stiffness * (p - 0.5 * o) + sea.damping * v
    onset = 0.5 * sea.stiffness * p * p / o + sea.damping * v * p / o
    return np.where(p <= 0.0, 0.0, np.maximum(np.where(p < o, onset, linear), 0.0))
