"""The quantities of one output, point by point and state by state: what outputs.observation is compared with."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from hybrid.kernels.laws.closed_forms import FADED
from hybrid.kernels.laws.seabed import stored
from hybrid.kernels.march.energies import Observed, observe
from hybrid.kernels.state.report import CONTACT_FORCE, FORCE_A, SELF_CONTACT_ENERGY
from hybrid.kernels.state.state import Batch, Ends, Floats, Line, Sea, State, blank_state
from hybrid.model.mesh import Zone
from hybrid.outputs.observation import Touchdown
from hybrid.outputs.observed_states import Grid
from hybrid.outputs.probes import Observer

cross = np.cross


def penetration(sea: Sea, r: Floats) -> Floats:
    """How deep points (n, 3) lie below where contact begins, m: half an onset above the seabed; negative above that."""
    return np.asarray(sea.offset + 0.5 * sea.onset - r @ sea.normal)


def touchdown(line: Line, sea: Sea, state: State) -> Touchdown:
    """First and last contact, exact for the chords that the contact force is integrated over."""
    p = penetration(sea, state.r)
    a, b = p[:-1], p[1:]
    touching = np.maximum(a, b) > 0.0
    if not touching.any():
        return Touchdown(np.full(2, np.nan), np.full((2, 3), np.nan), 0.0)
    # the part x0 .. x1 of every touching cell that is in contact
    change = np.where(b == a, 1.0, b - a)
    zero = np.clip(np.where(b == a, 0.0, -a / change), 0.0, 1.0)
    x0 = np.where((a <= 0.0) & touching, zero, 0.0)
    x1 = np.where((b <= 0.0) & touching, zero, 1.0)
    first, last = int(touching.argmax()), int(touching.size - 1 - touching[::-1].argmax())
    edges = np.array([line.s[first] + x0[first] * line.h[first], line.s[last] + x1[last] * line.h[last]])
    places = np.array(
        [state.r[c] + x * (state.r[c + 1] - state.r[c]) for c, x in ((first, x0[first]), (last, x1[last]))]
    )
    return Touchdown(edges, places, float(np.sum((x1 - x0) * line.h, where=touching)))


def contact_pressure(line: Line, sea: Sea, state: State, s: Floats) -> Floats:
    """Force per length (ns,) N/m of the seabed along its normal: that of the nodes over their half cells, at s."""
    p, v = penetration(sea, state.r), -state.v @ sea.normal
    o = sea.onset
    linear = sea.stiffness * (p - 0.5 * o) + sea.damping * v
    onset = 0.5 * sea.stiffness * p * p / o + sea.damping * v * p / o
    q = np.where(p <= 0.0, 0.0, np.maximum(np.where(p < o, onset, linear), 0.0))
    mass, h = np.zeros((len(q), len(q))), line.h
    for j in range(len(h)):
        mass[j : j + 2, j : j + 2] += h[j] / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
    return np.interp(s, line.s, mass @ q / mass.sum(axis=1))


class Plain:
    """One state looked at."""

    def __init__(
        self, line: Line, sea: Sea, zones: Sequence[Zone], ends: Ends, state: State, grid: Grid, report: Floats
    ) -> None:
        self.line, self.sea, self.zones, self.ends = line, sea, zones, ends
        self.computed, self.grid, self.report = state, grid, report
        self.state = state
        self.between: list[
            tuple[Any, ...]
        ] = []  # layers of pins in cells: ends, parts there, depth, curvature at the pin

    @cached_property
    def touchdown(self) -> Touchdown:
        return touchdown(self.line, self.sea, self.computed)

    @property
    def stored(self) -> float:
        return float(stored(self.line, self.sea, self.computed.r))

    @property
    def contact(self) -> Floats:
        return contact_pressure(self.line, self.sea, self.computed, self.grid.s)

    @cached_property
    def d(self) -> Floats:
        return np.asarray(self.state.e / np.linalg.norm(self.state.e, axis=1)[:, None])

    @cached_property
    def tension(self) -> Floats:
        """Tension on the grid: of the cells, and at the ends the pull of what holds them."""
        d = self.d
        ends = []
        for k, first, second in ((0, 0, 1), (1, -1, -2)):
            t = 1.5 * d[first] - 0.5 * d[second] if len(d) > 1 else d[first]
            if self.line.element[first]:  # a clamp or guide knows the tangent
                t = self.ends.frame[k].reshape(3, 3)[:, 2]
            force = self.reaction(k) if k else -self.reaction(k)
            at_end = self.line.s[first]
            if any(abs(x - at_end) < 1e-9 * self.line.s[-1] for x in self.grid.loads):
                ends.append(self._end_tension(k))
            else:
                ends.append(float(force @ t) / float(np.linalg.norm(t)))
        return np.asarray(self.grid.held @ np.concatenate([ends[:1], self.state.T, ends[1:]]))

    def _across(self, moment: Floats) -> Floats:
        t = self._node_tangent()
        return np.asarray(moment - np.einsum("ij,ij->i", moment, t)[:, None] * t)

    def _node_tangent(self) -> Floats:
        """(N+1, 3): halfway between the cells, at an end with an element what holds it, else its cell."""
        d = self.computed.e / np.linalg.norm(self.computed.e, axis=1)[:, None]
        t = np.vstack([d[:1], d[1:] + d[:-1], d[-1:]])
        for k, end in enumerate((0, -1)):
            if self.line.element[end]:
                t[end] = self.ends.frame[k].reshape(3, 3)[:, 2]
        return np.asarray(t / np.maximum(np.linalg.norm(t, axis=1), 1e-12)[:, None])

    @cached_property
    def tangent(self) -> Floats:
        t = self.grid.cells @ self.d
        size = np.linalg.norm(t, axis=1)
        # in the very middle of a fold the two sides cancel: take the nearest cell's
        middles = 0.5 * (self.line.s[:-1] + self.line.s[1:])
        for g in np.flatnonzero(size < 1e-9):
            t[g] = self.d[int(np.argmin(np.abs(middles - self.grid.s[g])))]
            size[g] = 1.0
        return np.asarray(t / size[:, None])

    @cached_property
    def _observed(self) -> tuple[Floats, Floats, Floats]:
        n, st = self.line.h.size, self.computed
        M, strain, energy = np.zeros((n + 1, 3)), np.zeros((n + 1, 3)), np.zeros(4)
        observe(self.line, self.ends, st.e, st.v, st.a1, st.w, st.T, st.turn, Observed(M, strain, energy))
        return M, strain, energy

    @property
    def node_moment(self) -> Floats:
        """(N+1, 3) N m, inertial."""
        return self._observed[0]

    @property
    def energy(self) -> Floats:
        """(4,) J: kinetic, bending, torsion, stretch."""
        return self._observed[2]

    @cached_property
    def moment(self) -> Floats:
        return np.asarray(self.grid.sides @ self.node_moment[self.grid.side_nodes])

    @cached_property
    def torque(self) -> Floats:
        line = self.line
        of_nodes = np.where(line.element, line.kb[:, 2] * (self._observed[1][:, 2] - line.k0[:, 2]), 0.0)
        of_ends = np.einsum("ij,ij->i", self._observed[0], self._node_tangent())
        of_nodes[[0, -1]] = of_ends[[0, -1]]
        return np.asarray(self.grid.sides @ of_nodes[self.grid.side_nodes])

    @cached_property
    def _strains(self) -> Floats:
        """Curvature and twist (n sides, 2), 1/m."""
        line, out = self.line, np.zeros((len(self.grid.side_nodes), 2))
        d = self.computed.e / np.linalg.norm(self.computed.e, axis=1)[:, None]
        cosine = np.einsum("ij,ij->i", d[:-1], d[1:])
        sine = np.linalg.norm(cross(d[:-1], d[1:]), axis=1)
        sharp = np.zeros(line.s.size)
        sharp[1:-1] = 2.0 * sine / (np.maximum(1.0 + cosine, 1e-12) * line.hn[1:-1])
        strain = self._observed[1]
        for zone, (a, b, o) in zip(self.grid.parts, self.grid.spans, strict=True):
            side = out[o : o + b - a + 1]
            if zone.kind == "rod":
                k = strain[a : b + 1] / line.hn[a : b + 1, None]
                side[:, 0], side[:, 1] = np.hypot(k[:, 0], k[:, 1]), k[:, 2]
                for node, row, cell, beside in ((a, 0, a, a + 1), (b, -1, b - 1, b - 1)):
                    change = any(abs(line.s[node] - x) < 1e-9 for x in self.grid.changes)
                    if not line.element[node] or (change and line.element[beside]):
                        side[row] = self._strain_of_moment(node, cell)
            else:
                side[:, 0] = sharp[a : b + 1]
                for row, one, two, x, x1, x2 in (
                    (0, 1, 2, line.s[a], line.s[a + 1], line.s[min(a + 2, b)]),
                    (-1, -2, -3, line.s[b], line.s[b - 1], line.s[max(b - 2, a)]),
                ):
                    if b - a >= 4:
                        p = (x - x1) / (x2 - x1)
                        side[row, 0] = max(0.0, (1 - p) * side[one, 0] + p * side[two, 0])
                    elif b - a >= 2:
                        side[row, 0] = side[one, 0]
        for k in range(1, len(self.grid.parts)):  # what a joint takes of a rod's curvature is put back
            if self.grid.parts[k - 1].kind != self.grid.parts[k].kind:
                self._put_back(out, k)
        for k, (EI, reach) in enumerate(self.grid.hinges[:2, :2]):  # what a pin takes of a catenary's is taken away
            if EI > 0.0 and self.grid.parts[-k].kind == "catenary":
                self._take_away(out, k, EI, reach)
        return out

    def _take_away(self, out: Floats, k: int, EI: float, reach: float) -> None:
        """The layer of a hinge at end k, node by node; `between` has what it is in the cells."""
        first, last, o = self.grid.spans[-k]
        node, row, way = (last, o + last - first, -1) if k else (first, o, 1)
        if last - first < 2:
            return
        line, T, end, direction = self.line, self.state.T, out[row, 0], self._directions[row]
        out[row, 0], depth, before = 0.0, 0.0, 1.0
        for i in range(node + way, (0 if k else line.h.size), way):
            c, beyond = min(i, i - way), min(i, i + way)
            deep = line.h[c] * np.sqrt(T[c] / EI)
            depth += deep
            part = (0.5 * (T[c] + T[beyond]) / T[-k]) ** 0.25 * np.exp(-depth)
            part = part if part > FADED else 0.0
            self.between.append((line.s[i - way], line.s[i], before, part, deep, end * direction))
            if part == 0.0:
                return
            before = part
            for row in np.flatnonzero(self.grid.side_nodes == i):
                mine = self._directions[row]
                whole = out[row, 0] * mine - end * part * direction
                out[row, 0] = np.copysign(np.linalg.norm(whole), whole @ mine)
            if line.spin[beyond] or abs(line.s[i] - line.s[node]) > reach * (1 - 1e-9):
                return

    def _put_back(self, out: Floats, k: int) -> None:
        """The layer of a hinge beside the joint before stretch k, node by node."""
        line, (node, last, right) = self.line, self.grid.spans[k]
        first, left, way = self.grid.spans[k - 1][0], right - 1, 1
        row, its, cells, beyond = right, left, last - node, node - first
        if self.grid.parts[k].kind != "rod":
            row, its, way, cells, beyond = left, right, -1, node - first, last - node
        if cells < 2 or beyond < 2:
            return

        def fade(j: int) -> float:
            i, c = node + j * way, min(node + j * way, node + (j - 1) * way)
            T, EI = self.state.T[c], line.kb[i, 0] * line.hn[i]
            b = 2.0 + line.h[c] ** 2 * T / EI if EI > 0.0 and T > 0.0 else np.inf
            return 0.5 * (b - np.sqrt(b * b - 4.0)) if b < 1e6 else 1.0 / b

        direction, turn = self._directions[its], cross(self.d[node - 1], self.d[node])
        turn *= 2.0 / (1.0 + self.d[node - 1] @ self.d[node]) / line.hn[node]  # of the circle
        T, EI = self.state.T[min(node, node + way)], line.kb[node + way, 0] * line.hn[node + way]
        h = line.h[[node - 1, node]][::way]
        before, after = EI / (T * line.hn[node] * h) if T > 0.0 else np.zeros(2)  # B of the hinge's layer
        both = (turn + before * out[its - way, 0] * direction) / (1.0 + before + after * (1.0 - fade(1)))
        at_joint = float(np.copysign(np.linalg.norm(both), both @ direction))
        out[its, 0] = missing = at_joint
        for j in range(cells):
            missing *= fade(j) if j > 0 else 1.0
            if abs(missing) <= FADED * abs(at_joint):
                return
            mine = self._directions[row + j * way]
            whole = out[row + j * way, 0] * mine + missing * direction
            out[row + j * way, 0] = np.copysign(np.linalg.norm(whole), whole @ mine)

    def _strain_of_moment(self, node: int, cell: int) -> tuple[float, float]:
        """Curvature and twist at a rod's end that carries the given moment (zero at a joint)."""
        line = self.line
        inner = cell + 1 if cell == node else cell
        if not line.element[inner]:
            return 0.0, 0.0
        B = line.kb[inner] * line.hn[inner]
        k0 = line.k0[inner] / line.hn[inner]
        a1, d = self.state.a1[cell], self.d[cell]
        body = np.array(
            [a1 @ self.node_moment[node], cross(d, a1) @ self.node_moment[node], d @ self.node_moment[node]]
        )
        k = k0 + np.divide(body, B, out=np.zeros(3), where=B > 0)
        return float(np.hypot(k[0], k[1])), float(k[2])

    @cached_property
    def curvature_twist(self) -> Floats:
        strains = self._strains
        bend = self.grid.sides @ (self._directions * strains[:, :1])
        for a, b, one, two, deep, vector in self.between:
            for i in np.flatnonzero((self.grid.s - a) * (self.grid.s - b) < 0.0) if deep > 0.1 else ():
                u = (self.grid.s[i] - a) / (b - a)
                here = one * (two / one) ** u if two > 0.0 else one * (np.exp(-u * deep) - u * np.exp(-deep))
                bend[i] += ((1.0 - u) * one + u * two - here) * vector
        return np.column_stack([np.linalg.norm(bend, axis=1), self.grid.sides @ strains[:, 1]])

    @cached_property
    def _directions(self) -> Floats:
        """Of the curvature vector (n sides, 3), across the chords beside a node, at ends of the line of the moment."""
        line, d, moment = self.line, self.d, self._across(self.node_moment)
        last = line.h.size

        def unit(x: Floats) -> Floats:
            return np.asarray(x / np.linalg.norm(x) if x.any() else [0.0, 1.0, 0.0])

        def between(i: int) -> Floats:
            j = min(max(i, 1), max(last - 1, 1))
            return unit(cross(d[j - 1], d[min(j, last - 1)]))

        out = []
        for zone, (a, b, _) in zip(self.grid.parts, self.grid.spans, strict=True):
            for i in range(a, b + 1):
                inward, outer, rod = int(i == a) - int(i == b), i in (0, last), zone.kind == "rod"
                held = outer and rod and not line.k0[i].any() and moment[i].any()
                out.append(unit(moment[i]) if held else between(i))
                if inward and not held and (outer or not rod or not line.element[i]):
                    out[-1] = between(i + inward)
        return np.array(out)

    @cached_property
    def shear(self) -> Floats:
        Q = np.diff(self.node_moment, axis=0)
        V = cross(self.d, Q) / np.linalg.norm(self.state.e, axis=1)[:, None]
        V[self.line.spin == 0] = 0.0
        return np.asarray(np.linalg.norm(self.grid.cells @ V, axis=1))

    def bending_moment(self) -> Floats:
        across = self._across(self.node_moment)[self.grid.side_nodes]
        return np.asarray(np.linalg.norm(self.grid.sides @ across, axis=1))

    def reaction(self, k: int) -> Floats:
        """Force of the support, or of an end body, on the cable at end k; else the force applied there."""
        force = -self.report[FORCE_A + 3 * k : FORCE_A + 3 * k + 3]
        if self.ends.held[k]:
            return np.asarray(force)
        first = 0 if k == 0 else -1
        if not any(abs(x - self.line.s[first]) < 1e-9 * self.line.s[-1] for x in self.grid.loads):
            return self.ends.force[k].copy()
        return np.asarray(force)

    def _end_tension(self, k: int) -> float:
        """Tension of the cable at end k, extrapolated from its last cells."""
        first, second = (0, 1) if k == 0 else (-1, -2)
        T, h = self.state.T, self.line.h
        return float(T[first] + (T[first] - T[second]) * h[first] / (h[first] + h[second]) if len(h) > 1 else T[0])


def plain_values(observer: Observer, batch: Batch, i: int, grid: Grid) -> dict[str, object]:
    """What `observer.values_of` should have at output i, but for work and criteria."""
    x = batch
    state = blank_state(x.T.shape[1])._replace(r=x.r[i], v=x.v[i], e=x.e[i], T=x.T[i], a1=x.a1[i], w=x.w[i])
    ends = Ends(x.held[i], x.position[i], x.frame[i], x.spin[i], x.force[i], x.moment[i])
    computed = Plain(x.line(i, observer.line), observer.sea, observer.zones, ends, state, grid, x.report[i])
    v = computed
    t = v.tangent
    out = {
        "position": v.grid.nodes @ v.state.r, "velocity": v.grid.nodes @ v.state.v, "tension": v.tension,
        "theta": np.arccos(np.clip(t[:, 2], -1, 1)), "phi": np.arctan2(t[:, 1], t[:, 0]),
        "curvature": v.curvature_twist[:, 0], "twist": v.curvature_twist[:, 1], "bending_moment": v.bending_moment(),
        "torque": v.torque, "shear": v.shear, "reaction_start": v.reaction(0), "reaction_end": v.reaction(1),
        "moment_start": -v.node_moment[0], "moment_end": v.node_moment[-1], "contact_force": v.report[CONTACT_FORCE],
        "energy/kinetic": v.energy[0], "energy/bending": v.energy[1], "energy/torsion": v.energy[2],
        "energy/stretch": v.energy[3], "energy/potential": -np.sum(v.line.force * computed.state.r),
    }  # fmt: skip
    if not batch.touch.size:  # contact with itself has not begun
        out |= {"self_contact": np.zeros(grid.s.size), "energy/self_contact": x.report[i, SELF_CONTACT_ENERGY]}
    if np.isfinite(observer.sea.stiffness):
        down = v.touchdown
        out |= {"contact": v.contact, "energy/contact": v.stored, "grounded_length": down.grounded}
        out |= {"touchdown": down.edges, "touchdown_position": down.places}
    return out
