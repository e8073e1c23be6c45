"""What is known of a batch of states: quantities on nodes, cells and the output grid, each computed once if needed.

Second order everywhere: positions by cubic Hermite interpolation of the nodes (one-sided
at joints and at point loads, where the tangent may kink), tensions and tangents from the middle of the
cells, moments and curvatures from the nodes, zone by zone.

Arrays have the node, cell or output point first, then the component, and the nb outputs of the batch last: one numpy
operation and one product with a sparse matrix (output_grid) serve the batch.

A line whose cells are others in each output is observed as lines one behind the other.  Between two of these lies a
cell without length that belongs to none.  Arrays along all of them have one column; what there is one of in each output
(ends, energies) has the outputs last, as in any `Observation`.

Forces on obstacles, energy stored in them, and where those are that move, are by the law of kernels.laws.obstacles at
the positions and velocities of outputs: without friction, and of obstacles that move without damping, whose velocities
outputs do not have.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.contact.self_contact_law import ALONG, FIRST, FORCE, LAST, NORMAL, POINT, WX, P, Q
from hybrid.kernels.contact.self_contact_pairs import Contact, PointsJob, observe_points
from hybrid.kernels.laws.obstacles import put_obstacles
from hybrid.kernels.laws.seabed import PRESSES
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.march.link import link_of
from hybrid.kernels.march.zone_torque import TORQUE, TURN, torsion_energy
from hybrid.kernels.state.report import (
    CONTACT_FORCE,
    DAMPING,
    FIXED,
    LENGTH_OUT,
    PAYOUT_POWER,
    SEABED_ENERGY,
    SEEN_FORCE,
    SEEN_MOMENT,
    SEEN_TURN,
    SELF_CONTACT_ENERGY,
    SOIL,
    STRETCH_ENERGY,
)
from hybrid.kernels.state.state import ALONG_LINE, NO_TURN, NODES_OF_LINE, Batch, Ends, Floats, Line, Sea, no_ends
from hybrid.kernels.watch.observed_outputs import (
    ACROSS,
    BORNE,
    DEPTH,
    EDGES,
    GROUNDED,
    NATURAL,
    ON_OBSTACLE,
    PLACES,
    SIDE_TORQUE,
    TWIST,
    UNKNOWN,
    Found,
    observed_joined,
)
from hybrid.model.bodies import angles_of
from hybrid.model.mesh import Zone
from hybrid.outputs.observed_states import (
    Grid,
    ObservedStates,
    Rows,
    cross,
    last,
    linear,
    means_beside,
    means_on_line,
    size,
)
from hybrid.store.format import Field


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

    @cached_property
    def shear_of_cells(self) -> Floats:
        """(N, 3, nb) N, across the cells; of catenaries zero."""
        V = cross(self.d, np.diff(self.node_moment, axis=0)) / self.length[:, None]
        V[self.line.spin == 0] = 0.0
        return V

    @property
    def shear(self) -> Floats:
        """(ns, nb) N."""
        return size(self.grid.cells @ self.shear_of_cells)

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
    def bends_without_natural(self) -> Floats:
        """(3, ns, nb): two bends, 1/m, from the natural ones, and above 0 where they are unknown."""
        return np.moveaxis(self.grid.sides @ self.sides[:, NATURAL : UNKNOWN + 1], 1, 0)

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
        return self._observed.reaction[:, k].T

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
        found = {"kinetic": kinetic, "bending": bending, "torsion": torsion, "stretch": stretch, "potential": potential}
        report = self.batch.report
        return found | {"contact": report[:, SEABED_ENERGY], "self_contact": report[:, SELF_CONTACT_ENERGY]}


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


# --- lines whose cells are others in each output -----------------------------------------------

# What a batch has of the nodes and of the cells; the rest is of each output as it is.
NODES_OF_BATCH, CELLS_OF_BATCH = ("r", "v", "vd"), ("e", "T", "a1", "w")
OF_LINE = ("h", "kb")


class Output(NamedTuple):
    """One output with the line that it is of, in arrays of their own."""

    line: Line
    zones: tuple[Zone, ...]
    batch: Batch  # of this output alone


def outputs_in(batch: Batch, line: Line, zones: tuple[Zone, ...]) -> list[Output]:
    """The outputs of a batch of one line, copied."""
    found = []
    arrays: dict[str, Any] = {name: getattr(line, name).copy() for name in ALONG_LINE if name not in OF_LINE}
    for k in range(batch.t.size):
        own: dict[str, Any] = {name: getattr(batch, name)[k].copy() for name in OF_LINE}
        rows: Any = [x[k : k + 1].copy() for x in batch]
        found.append(Output(line._replace(**arrays, **own), zones, Batch(*rows)))
    return found


def _joined(parts: Sequence[Floats], gaps: bool) -> Floats:
    """One behind the other; gaps: with the last row again after each but the last, for a cell that belongs to none."""
    if gaps:
        parts = [x for part in parts for x in (part, part[-1:])][:-1]
    return np.concatenate(parts)


class JoinedGrid(Grid):
    """Grids of several lines, one behind the other."""

    def __init__(self, grids: Sequence[Grid]) -> None:
        first, self.of = grids[0], grids
        self.loads, self.changes, self.after, self._kept = first.loads, first.changes, first.after, first._kept
        self.hinges = grids[0].hinges
        self.begin = np.cumsum([0, *(grid._x.size for grid in grids)])  # nodes before each line
        self.rows = sides = np.cumsum([0, *(len(grid.side_nodes) for grid in grids)])  # likewise sides
        self.parts = tuple(part for grid in grids for part in grid.parts)
        self.spans = []
        for grid, n, o in zip(grids, self.begin.tolist(), sides.tolist(), strict=False):
            self.spans += [(a + n, b + n, c + o) for a, b, c in grid.spans]
        before = np.repeat(self.begin[:-1], np.diff(sides))
        self.side_nodes = np.concatenate([grid.side_nodes for grid in grids]) + before
        self.s, self._x = (np.concatenate([getattr(grid, name) for grid in grids]) for name in ("s", "_x"))
        points = [grid.s.size for grid in grids]
        self._before = np.repeat(self.begin[:-1], points)  # (ns,) of each point: nodes before its line
        self._sides_before, self._lines_before = np.repeat(sides[:-1], points), np.repeat(np.arange(len(grids)), points)
        self._stretch = np.concatenate([grid._stretch for grid in grids])
        self._first = np.concatenate([grid._first for grid in grids]) + self._before
        self._last = np.concatenate([grid._last for grid in grids]) + self._before

    def of_line_of(self, node: int) -> NDArray[np.bool_]:
        return np.asarray(self._before == self.begin[np.searchsorted(self.begin, node, "right") - 1])

    @property
    def in_catenary(self) -> NDArray[np.bool_]:
        return np.concatenate([grid.in_catenary for grid in self.of])

    @cached_property
    def chords(self) -> Rows:
        return linear(self._x, self.s, self._before, np.repeat(self.begin[1:] - 1, [grid.s.size for grid in self.of]))

    @cached_property
    def held(self) -> Rows:
        before = self._before + self._lines_before  # each line before has one column more than nodes
        if any(b - a == 1 for a, b, _ in self.spans):  # where values beside a stretch may count
            at = np.concatenate([grid._held_at for grid in self.of])
            start, end = (np.concatenate(x) for x in zip(*(grid._held_between for grid in self.of), strict=True))
            return linear(at, self.s, start + before, end + before)
        x, first, last, lines = self._x, self.begin[:-1], self.begin[1:] - 1, np.arange(len(self.of))
        at = np.empty(x.size + lines.size)
        middle = 0.5 * (x[:-1] + x[1:])  # those between two lines are overwritten
        at[np.arange(x.size - 1) + np.repeat(lines, np.diff(self.begin))[:-1] + 1] = middle
        at[first + lines], at[last + lines + 1] = x[first], x[last]
        of = self._lines_before
        start = np.where(self.s < middle[first][of], first[of], self._first + 1) + of
        end = np.where(self.s > middle[last - 1][of], last[of] + 1, self._last) + of
        return linear(at, self.s, start, end)

    @cached_property
    def sides(self) -> Rows:
        shift = self._stretch + self._sides_before - self._before
        return linear(self._x, self.s, self._first, self._last, shift)


class JoinedObservation(Observation):
    """Outputs of several lines."""

    def __init__(self, outputs: Sequence[Output], sea: Sea, grid: JoinedGrid, paid: int = 0) -> None:
        lines, batches = [x.line for x in outputs], [x.batch for x in outputs]
        along: dict[str, Any] = {
            name: _joined([getattr(x, name) for x in lines], name not in NODES_OF_LINE) for name in ALONG_LINE
        }
        along["h"][grid.begin[1:-1] - 1] = 0.0
        nodes = (*NODES_OF_BATCH, "soil") if batches[0].soil.size else NODES_OF_BATCH
        of: dict[str, Any] = {name: _joined([getattr(x, name)[0] for x in batches], False)[None] for name in nodes}
        of |= {name: _joined([getattr(x, name)[0] for x in batches], True)[None] for name in CELLS_OF_BATCH}
        rest = [name for name in Batch._fields if name not in (*of, *OF_LINE, "turn", "touch")]
        heads: dict[str, Any] = {name: np.concatenate([getattr(x, name) for x in batches]) for name in rest}
        super().__init__(lines[0]._replace(**along), sea, grid, Batch(**heads, **of), paid=paid)
        self.outputs, self.begin, self._joined_grid = outputs, grid.begin, grid

    @property
    def columns(self) -> int:
        return 1

    @cached_property
    def changes(self) -> list[int]:
        pairs = zip(self.outputs, self.begin.tolist(), strict=False)
        return [n + int(np.argmin(np.abs(one.line.s - x))) for one, n in pairs for x in self.grid.changes]

    @cached_property
    def link(self) -> Floats:
        return np.concatenate([links(x.batch, x.line) for x in self.outputs], axis=1)

    @cached_property
    def end_nodes(self) -> NDArray[np.int64]:
        return np.concatenate([self.begin[:-1], self.begin[1:] - 1])

    def at_end(self, x: Floats, k: int) -> Floats:
        return np.moveaxis(x[self.begin[1:] - 1 if k else self.begin[:-1], ..., 0], 0, -1)

    def outputs_last(self, x: Floats) -> Floats:
        return x[..., None]

    def by_output(self, x: Floats, dims: Sequence[str]) -> Floats:
        if dims[:1] != ("s",):
            return super().by_output(x, dims)
        return np.ascontiguousarray(x[..., 0]).reshape(self.batch.t.size, -1, *x.shape[1:-1])

    def has_element(self, k: int) -> NDArray[np.bool_]:
        return self.line.element[self.begin[1:] - 1 if k else self.begin[:-1]] == 1

    def _cell_at(self, point: int) -> int:
        k, at = divmod(point, self.grid.s.size // self.batch.t.size)
        s = self.outputs[k].line.s
        return int(self.begin[k] + np.argmin(np.abs(0.5 * (s[:-1] + s[1:]) - self.grid.s[at])))

    @cached_property
    def _observed(self) -> Found:
        return observed_joined(self.line, self.sea, self.batch, self._along, self.begin, self._joined_grid.rows)

    def _between_nodes(self) -> Floats:
        found = self._observed.layers(self.grid.s.reshape(self.batch.t.size, -1))
        return found.reshape(-1, 3, 1)

    @property
    def points(self) -> Floats:
        """(ns,) m, output points of each."""
        return self._joined_grid.of[0].s

    def one(self, k: int) -> Observation:
        """Output k as if it had been looked at alone."""
        found = self.outputs[k]
        return Observation(found.line, self.sea, self._joined_grid.of[k], found.batch, paid=self.paid)


# --- obstacles ---------------------------------------------------------------------------------


def obstacle_force_fields(names: Sequence[str]) -> list[Field]:
    """What is recorded of each obstacle."""
    found = []
    for name in names:
        at, of = f"obstacles/{name}", f"obstacle {name}, without friction"
        text = f"resultant of the normal forces of the line on {of}"
        found.append(Field(f"{at}/normal_force", "N", text, (3,), ("xyz",), "inertial"))
        found.append(Field(f"{at}/contact_force", "N", f"sum of the normal forces of the line on {of}"))
        found.append(Field(f"{at}/contact", "N/m", f"largest normal force per length of the line on {of}"))
        found.append(Field(f"{at}/energy", "J", f"energy stored in the contact with obstacle {name}"))
    return found


def obstacle_force_values(names: Sequence[str], seen: Observation) -> dict[str, Floats]:
    """Their values (nb, ...)."""
    found: dict[str, Floats] = {}
    if not names:
        return found
    sea, moved, places = seen.sea, seen.line.moved, seen.batch.obstacles
    rows = sea.obstacles.copy()
    if moved.size:
        rows[moved != FIXED, DAMPING] = 0.0
    out = np.empty((seen.batch.t.size, len(names), ON_OBSTACLE))
    if not places.size:
        seen.press_obstacles(sea._replace(obstacles=rows), slice(None), out)
    for k in range(len(places) if places.size else 0):
        put_obstacles(rows, sea.carried, places[k])
        seen.press_obstacles(sea._replace(obstacles=rows), slice(k, k + 1), out)
    for k, name in enumerate(names):
        found[f"obstacles/{name}/normal_force"] = out[:, k, :3].copy()
        for at, key in enumerate(("contact_force", "contact", "energy")):
            found[f"obstacles/{name}/{key}"] = out[:, k, 3 + at].copy()
    return found


def obstacle_fields(names: Sequence[str]) -> list[Field]:
    """Place and rotation of all obstacles, force and moment on them."""
    texts = {
        "position": ("m", "place of obstacle {}"),
        "rotation": ("deg", "rotation of obstacle {} since t = 0: roll, pitch, yaw, about x, then y, then z"),
        "force": ("N", "force of the line on obstacle {}"),
        "moment": ("N m", "moment of the line on obstacle {} about its place"),
    }
    return [
        Field(f"obstacles/{name}/{key}", unit, text.format(name), (3,), ("xyz",), "inertial")
        for name in names
        for key, (unit, text) in texts.items()
    ]


def obstacle_values(names: Sequence[str], seen: Floats) -> dict[str, Floats]:
    """Their values (nb, 3); seen: (nb, M, SEEN) of kernels.state.report."""
    found = {}
    for k, name in enumerate(names):
        x = seen[:, k]
        turned = x[:, SEEN_TURN:SEEN_FORCE].reshape(-1, 3, 3)
        found[f"obstacles/{name}/position"] = x[:, :SEEN_TURN].copy()
        found[f"obstacles/{name}/rotation"] = angles_of(turned)
        found[f"obstacles/{name}/force"] = x[:, SEEN_FORCE:SEEN_MOMENT].copy()
        found[f"obstacles/{name}/moment"] = x[:, SEEN_MOMENT:].copy()
    return found


# What two lines that touch press on each other with, and a line on itself: of one output of all of them.
#
# Forces of points of contact of kernels.contact.self_contact_pairs are scaled so that those of all partners add up to
# what nodes bear.

KEYS = ("force", "contact_force", "contact")


class Lines(NamedTuple):
    """Lines that may touch, their nodes one behind the other."""

    contact: Contact
    line: Line  # as kernels.contact has them

    @property
    def lengths(self) -> Floats:
        """(N+1,) m that the force of a node lies on."""
        kind, s = self.contact.kind, self.line.s
        nodes = np.arange(s.size)
        return 0.5 * (s[nodes + (kind != LAST)] - s[nodes - (kind != FIRST)])

    def points(self, r: Floats, touch: Floats) -> Floats:
        """Rows (n, POINT) of `observe_points`, of nodes at r (N+1, 3) m that bear `touch` (N+1,) N/m."""
        points = np.empty_like(self.contact.points)
        job = Table(PointsJob(self.line, no_ends(), self.contact, r, touch, points))
        while (count := observe_points(job.numbers)) > len(points):
            points = np.empty((count, POINT))
            job.bind(points=points)
        return points[:count]


def pair_fields(pairs: list[tuple[str, str]]) -> list[Field]:
    """What is recorded of pairs of lines, and of lines with themselves, by their names."""
    found = []
    for a, b in pairs:
        at, of = f"contacts/{a}/{b}", f"line {b} on line {a}" if a != b else f"line {a} on itself"
        if a != b:
            text = f"resultant of the forces of {of}, without friction"
            found.append(Field(f"{at}/force", "N", text, (3,), ("xyz",), "inertial"))
        found.append(Field(f"{at}/contact_force", "N", f"sum of the forces of {of} at all places, without friction"))
        found.append(Field(f"{at}/contact", "N/m", f"largest force per length of {of}, without friction"))
    return found


def pair_forces(lines: Lines, r: Floats, touch: Floats) -> dict[tuple[int, int], tuple[Floats, float, float]]:
    """By numbers of two lines, a <= b: resultant (3,) N on a, sum N, largest force per length N/m; of those that touch.

    r: (N+1, 3) m; touch: (N+1,) N/m, of all contact, at the nodes.
    """
    of, lengths, points = lines.contact.of, lines.lengths, lines.points(r, touch)
    pieces, weights = points[:, [P, Q]].astype(np.int64), points[:, WX:NORMAL]
    at = (pieces[:, :, None] + (-1, 0, 1)).reshape(-1, 6)  # nodes
    whole = np.bincount(at.ravel(), (-weights * points[:, FORCE, None]).ravel(), of.size)
    share = np.divide(touch * lengths, whole, out=np.zeros(of.size), where=whole > 0.0)
    force = -points[:, FORCE] * 0.5 * (weights * share[at]).sum(axis=1)
    a, b = np.sort(of[pieces], axis=1).T
    sign, found = np.where(of[pieces[:, 0]] == a, 1.0, -1.0), {}
    for pair in sorted(set(zip(a.tolist(), b.tolist(), strict=True))):
        mine = (a == pair[0]) & (b == pair[1])
        nodes = np.bincount(at[mine].ravel(), (weights[mine] * force[mine, None]).ravel(), of.size)
        resultant = ((sign * force)[mine, None] * points[mine, NORMAL:ALONG]).sum(axis=0) * (pair[0] != pair[1])
        found[pair] = resultant, float(force[mine].sum()), float((nodes / lengths).max())
    return found
