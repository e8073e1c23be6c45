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
from numpy.typing import NDArray

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
from hybrid.kernels.state.state import NO_TURN, Batch, Ends, Floats, Line
from hybrid.kernels.watch.observed_outputs import (
    ACROSS,
    BORNE,
    DEPTH,
    EDGES,
    GROUNDED,
    NATURAL,
    PLACES,
    SIDE_TORQUE,
    TWIST,
    UNKNOWN,
)
from hybrid.outputs.observed_states import ObservedStates, cross, last, means_beside, means_on_line, size


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
        return self.grid.held @ self.outputs_last(self._observed.held)

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
        return self.grid.sides @ self.sides[:, SIDE_TORQUE]

    @cached_property
    def bending_moment(self) -> Floats:
        """(ns, nb) N m."""
        return size(self.grid.sides @ self.sides[:, ACROSS:])

    @property
    def shear(self) -> Floats:
        """(ns, nb) N."""
        V = cross(self.d, np.diff(self.node_moment, axis=0)) / self.length[:, None]
        V[self.line.spin == 0] = 0.0
        return size(self.grid.cells @ V)

    # ---- curvature and twist ------------------------------------------------------------------

    @cached_property
    def curvature_twist(self) -> Floats:
        """(ns, 2, nb) 1/m.

        Between nodes the vector of curvature is interpolated, across the plane of the bend: its size alone would stay
        large where a line bends to one side before a point and to the other side after it.
        """
        found = self.grid.sides @ self.sides[:, : TWIST + 1]
        if self.grid.hinges[:2, 0].any():  # whose layer is no straight line in cells that are long for it
            found[:, :TWIST] += self._between_nodes()
        return np.stack([size(found[:, :TWIST]), found[:, TWIST]], axis=1)

    def _between_nodes(self) -> Floats:
        """(ns, 3, nb) 1/m, of layers at ends of catenaries."""
        points = np.broadcast_to(self.grid.points.T, (self.columns, len(self.grid.points)))
        return last(self._observed.layers(points))

    @property
    def curvature_on_sides(self) -> Floats:
        """(n sides, nb) 1/m, at the nodes of the grid's stretches."""
        return size(self.sides[:, :TWIST])

    @property
    def bends_without_natural(self) -> tuple[Floats, NDArray[np.bool_]]:
        """Curvature (ns, nb) 1/m less the natural one, and where it is unknown."""
        a, b, unknown = np.moveaxis(self.grid.sides @ self.sides[:, NATURAL : UNKNOWN + 1], 1, 0)
        return np.hypot(a, b), unknown > 0.0

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

    # ---- seabed and energies, of what was computed --------------------------------------------

    @property
    def depth(self) -> Floats:
        """(N+1, nb) m, below where contact begins."""
        return self.bed[:, DEPTH]

    @property
    def touchdown(self) -> Touchdown:
        """What lies on the seabed."""
        x = self._observed.touch.T
        return Touchdown(x[EDGES:PLACES], x[PLACES:GROUNDED].reshape(2, 3, -1), x[GROUNDED])

    @property
    def contact(self) -> Floats:
        """(ns, nb) N/m."""
        if self.line.bits & SOIL:
            return np.asarray(self.grid.chords @ np.ascontiguousarray(self.batch.soil[:, :, PRESSES].T))
        return np.asarray(self.grid.chords @ self.bed[:, BORNE])

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
        kinetic, bending, torsion, stretch, potential = last(self._observed.energy)
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


class Touchdown(NamedTuple):
    """What lies on the seabed, of nb states.  Edges are NaN when nothing does."""

    edges: Floats  # (2, nb) m, arc lengths of the first and the last point in contact
    places: Floats  # (2, 3, nb) m, where they are
    grounded: Floats  # (nb,) m, length in contact
