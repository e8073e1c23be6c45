"""One line of a linear network in the sea: what excites it, its linear drag, and its motion at every frequency."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from scipy import sparse

from hybrid.kernels.algebra.block_elimination import SIZE, WIDTH
from hybrid.kernels.laws.bending_law import RIGID, parts_without_spring
from hybrid.kernels.laws.hinge_layer import FADED
from hybrid.kernels.state.report import BODIES, DRAG, WAVES
from hybrid.kernels.state.state import Floats, Line, Sea
from hybrid.linear.drag import axes_across, linear_law, of_cylinders, phases_of
from hybrid.linear.excitation import Excitation, current_at, excitations_of, half_cells
from hybrid.linear.matrices import ANCHOR, LinearLine, RestMarch, by_turn, rows_at_rest, sparse_rows
from hybrid.linear.response_results import LineResponse
from hybrid.model.build import Model
from hybrid.solve.joined import JoinedLine

STRAIGHT = 1e-9  # 1/m: less is no bend
AWRY = (0.3, 0.9, 0.4)  # along no axis


class LoadedLine:
    """One line, its drag, and what excites it."""

    def __init__(self, x: JoinedLine, linear: LinearLine, model: Model, omegas: Floats) -> None:
        self.name, self.linear, self.x, self.hinges = linear.name, linear, x, model.cable.hinges
        self.line, state, self.sea = linear.line, linear.state, model.sea.at(np.inf)
        self.obstacles = model.sea.names
        self.carried: dict[int, Floats] = {}  # (F, N+1, 3) m, motions of obstacles that bodies carry, at the nodes
        count, calm = self.line.s.size, _without_drag(self.line)

        rows = np.zeros((count, SIZE * WIDTH))
        march = RestMarch(calm._replace(bits=calm.bits | WAVES), x.ends, state, rows)

        def rows_of(sea: Sea) -> Floats:
            rows[:] = 0.0
            march(sea, (0.0, ANCHOR))
            return rows

        self.excited: list[Excitation] = excitations_of(model, x.line, state, omegas, rows_of)
        still, moving = np.zeros((count, SIZE * WIDTH)), np.zeros((count, SIZE * WIDTH))
        rows_at_rest(calm, x, x.ends, state, (0.0, ANCHOR), still)
        rows_at_rest(calm, x, x.ends, state, (1.0, ANCHOR), moving)
        self.forces, self.water, self.shifts, self.turns = (
            np.array([getattr(e, of) for e in self.excited], complex).reshape(len(omegas), rows, 3)
            for of, rows in (("forces", count), ("water", count), ("shifts", 2), ("turns", 2))
        )
        self.damping = sparse_rows(moving - still)  # of the sections and of the bed
        self.node, self.d, self.cn, self.ct, self.current = half_cells(self.line, self.sea, state)
        self.axes = axes_across(self.d)
        self.point_drag = np.nan_to_num(self.line.point_drag) if self.line.bits & BODIES else np.zeros(count)
        self.q = np.zeros((len(omegas), count, SIZE), complex)
        self.omegas, self.phases = omegas, phases_of(omegas) if omegas.size else None
        self.blocks = np.zeros((count, 3, 3))
        # whether free points or bodies move it that have drag of their own, or what it carries and is heavier than it
        carried = np.nan_to_num(self.line.point_mass) + np.nan_to_num(self.line.point_added)
        own = float((self.line.mass - np.nan_to_num(self.line.point_mass)).sum())
        self.by_drag = bool((carried > own)[self.point_drag > 0.0].any())

    def drag_blocks(self, which: np.ndarray, start: bool) -> Floats:
        """Linear drag (N+1, 3, 3) N s/m of every node, by the motion found last at some frequencies, which stand for
        all; start: by the water alone."""
        relative = math.sqrt(len(self.omegas) / which.size) * self.relative(which, start)
        blocks = np.zeros((self.line.s.size, 3, 3))
        used = (self.cn > 0.0) | (self.ct > 0.0)
        if used.any():
            node, d, axes = self.node[used], self.d[used], self.axes[used]
            drag = self.cn[used], self.ct[used]
            np.add.at(blocks, node, of_cylinders(d, axes, drag, self.current[used], relative[:, node], self.phases))
        at = np.flatnonzero(self.point_drag)
        if at.size:
            flow = current_at(self.line, self.sea, self.linear.r[at])
            blocks[at] += self.point_drag[at][:, None, None] * linear_law(flow, relative[:, at], self.phases)
        return blocks

    def relative(self, which: np.ndarray, start: bool = False) -> Floats:
        """Velocity (F, N+1, 3) m/s of the water relative to the nodes, by the motion found last; start: none."""
        water = self.water[which]
        return water if start else water + 1j * self.omegas[which, None, None] * self.q[which, :, 1:4]

    def full_damping(self) -> sparse.csr_array:
        """Over the unknowns of all blocks."""
        n = self.line.s.size
        i = SIZE * np.arange(n)[:, None, None] + 1 + np.arange(3)[None, :, None]
        j = SIZE * np.arange(n)[:, None, None] + 1 + np.arange(3)[None, None, :]
        shape = self.blocks.shape
        drag = sparse.csr_array(
            (self.blocks.ravel(), (np.broadcast_to(i, shape).ravel(), np.broadcast_to(j, shape).ravel())),
            shape=(SIZE * n, SIZE * n),
        )
        return self.damping + drag

    def loads(self, which: np.ndarray, C: sparse.csr_array) -> Floats:
        """Right-hand sides (5 (N+1), F): forces of the water, and motions of held ends."""
        n, w = self.line.s.size, self.omegas[which]
        force, held = np.zeros((n, SIZE, which.size), complex), np.zeros((n, SIZE, which.size), complex)
        force[:, 1:4] = self.forces[which].transpose(1, 2, 0) + self.blocks @ self.water[which].transpose(1, 2, 0)
        for k in (0, 1):
            held[-k, 1:4] += self.shifts[which, k].T
        out = force.reshape(n * SIZE, -1)
        if held.any():
            moved = held.reshape(n * SIZE, -1)
            K, M = self.linear.stiffness, self.linear.mass
            out = out - (K @ moved - (M @ moved) * w**2 - 1j * (C @ moved) * w)
        for k in (0, 1):
            turns = self.turns[which, k].T
            if turns.any() and self.line.element[-k]:
                out = out - self.turned[k].T @ turns
        return out

    @cached_property
    def turned(self) -> tuple[Floats, ...]:
        """(3, 5 (N+1)) of each end, what its frame does to the line when it turns."""
        ends = [by_turn(self.line, self.x, self.x.ends, self.linear.state, k)[0] for k in (0, 1)]
        return tuple(ends)

    def take(self, which: np.ndarray, q: Floats) -> None:
        """Keep the motion (F, N+1, 5) at some frequencies, with that of the ends that are held in it."""
        self.q[which] = q
        for k in (0, 1):
            if self.x.joints[k] < 0 and self.x.ends.held[k]:
                self.q[which, -k, 1:4] = self.shifts[which, k]

    def result(self) -> LineResponse:
        """Amplitudes of what users ask for, in the motion found last."""
        return self.response_to(self.q, self.turns, self.omegas)

    def response_to(self, q: Floats, turns: Floats, omegas: Floats) -> LineResponse:
        """Amplitudes of what users ask for, in a motion (F, N+1, 5) with turns (F, 2, 3) rad of the frames of its ends,

        at frequencies (F,) 1/s.
        """
        state = self.linear.state
        l = np.linalg.norm(state.e, axis=1)
        d = state.e / l[:, None]
        de = np.diff(q[:, :, 1:4], axis=1)
        dd = (de - np.einsum("fni,ni->fn", de, d)[:, :, None] * d) / l[:, None]
        frames = self.x.ends.frame.reshape(2, 3, 3)[:, :, 2]  # tangents that clamps hold
        held = [np.cross(turns[:, k], frames[k])[:, None] for k in (0, 1)]
        length, size, axes = self.bend
        size = size.copy()
        change = np.concatenate([dd, held[1]], axis=1) - np.concatenate([held[0], dd], axis=1)
        change = change / length[:, None]
        for k in (0, 1):
            if not self.line.element[-k]:
                change[:, -k] = 0.0
        kappa = np.einsum("fni,nki->fnk", change, axes)
        for k in (0, 1):  # what an angular spring turns is no bend of the line
            part, along = parts_without_spring(self.line, k * (len(size) - 1), *self._bend_at_end(k))
            if self.line.element[-k] and part < RIGID:
                size[-k] *= part
                kappa[:, -k] *= (along, part)
        inner = self.kinks
        size[inner] = 0.5 * (size[inner - 1] + size[inner + 1])
        kappa[:, inner] = 0.5 * (kappa[:, inner - 1] + kappa[:, inner + 1])
        for k in (0, 1):
            if not self.line.spin[-k] and self.hinges[k, 0] > 0.0 and len(size) > 2:
                self._fade_at_hinge(k, q[:, 1:, 0], size, kappa)
        return LineResponse(
            self.line.s.copy(), 0.5 * (self.line.s[1:] + self.line.s[:-1]), omegas / (2.0 * np.pi), q[:, :, 1:4],
            q[:, 1:, 0], kappa[:, :, 0], kappa[:, :, 1], state.r.copy(), state.T.copy(), size,
        )  # fmt: skip

    def _bend_at_end(self, k: int) -> tuple[float, float]:
        """The bend, rad, of the element at end k at rest, in the axes of the section before it."""
        length, size, axes = self.bend
        a1, d = self.x.ends.frame.reshape(2, 3, 3)[0, :, [0, 2]]
        if k:
            a1, d = self.linear.state.a1[-1], self.linear.state.e[-1]
        about = np.cross(d / np.linalg.norm(d), axes[-k, 0]) * size[-k] * length[-k]
        return float(about @ a1), float(about @ np.cross(d / np.linalg.norm(d), a1))

    @cached_property
    def bend(self) -> tuple[Floats, Floats, Floats]:
        """Of every node at rest: length (N+1,) m over which it bends, its curvature (N+1,) 1/m, and two axes across it

        (N+1, 2, 3), of which the first is in the plane of the bend, inwards.
        """
        l = np.linalg.norm(self.linear.state.e, axis=1)
        d = self.linear.state.e / l[:, None]
        frames = self.x.ends.frame.reshape(2, 3, 3)[:, :, 2]
        before, after = np.vstack([frames[:1], d]), np.vstack([d, frames[1:]])
        length = np.concatenate([[0.5 * l[0]], 0.5 * (l[1:] + l[:-1]), [0.5 * l[-1]]])
        bend = (after - before) / length[:, None]
        for k in (0, 1):
            if not self.line.element[-k]:
                bend[-k] = 0.0
        size = np.linalg.norm(bend, axis=1)
        t = self.linear.t
        first = np.where(size[:, None] > STRAIGHT, bend / np.maximum(size, 1e-300)[:, None], np.cross(t, AWRY))
        first -= np.einsum("ni,ni->n", first, t)[:, None] * t
        first /= np.maximum(np.linalg.norm(first, axis=1), 1e-300)[:, None]
        return length, size, np.stack([first, np.cross(t, first)], axis=1)

    @property
    def kinks(self) -> np.ndarray:
        """Inner nodes where a body on a catenary makes a kink: curvature there is the mean of both sides."""
        line, of = self.line, (self.line.point_mass, self.line.point_lift)
        loaded = np.any([np.nan_to_num(x) != 0.0 for x in of], axis=0)[1:-1]
        return 1 + np.flatnonzero(loaded & (line.spin[:-1] == 0) & (line.spin[1:] == 0))

    def _fade_at_hinge(self, k: int, dT: Floats, size: Floats, kappa: Floats) -> None:
        """Take from curvature (N+1,) 1/m of a catenary, and its amplitudes (F, N+1, 2), the layer of a hinge at end k.

        As results have it (outputs.strains), up to the first change of section; it changes with tension, whose
        amplitudes are dT (F, N).
        """
        line, n, way, EI = self.line, len(size) - 1, 1 - 2 * k, self.hinges[k, 0]
        nodes = k * n + way * np.arange(1, n)
        cells = np.minimum(nodes, nodes - way)
        beyond = nodes if way > 0 else nodes - 1  # cells
        T, h = self.linear.state.T, line.h[cells]
        first = T[k * (n - 1)]
        other = np.abs(line.s[nodes] - line.s[k * n]) >= (1.0 - 1e-9) * self.hinges[k, 1]
        ends = np.flatnonzero(other | (line.spin[beyond] != 0))
        last = int(ends[0]) + 1 if ends.size else n - 1
        taut = np.logical_and.accumulate(T[cells] > 0.0)
        slope = np.sqrt(np.maximum(T[cells], 0.0) / EI)
        mean = 0.5 * (T[cells] + T[beyond])
        size_there = (np.maximum(mean, 0.0) / max(first, 1e-300)) ** 0.25
        parts = np.where(taut, size_there * np.exp(-np.cumsum(slope * h)), 0.0)
        count = min(last, int(np.logical_and.accumulate(parts > FADED).sum()))
        nodes, cells, beyond, parts = nodes[:count], cells[:count], beyond[:count], parts[:count]
        by_depth = np.cumsum(dT[:, cells] * h[:count] / (2.0 * np.sqrt(T[cells] * EI)), axis=1)
        by_size = 0.25 * (0.5 * (dT[:, cells] + dT[:, beyond]) / mean[:count] - dT[:, [k * (n - 1)]] / first)
        one, two = k * n + way, k * n + 2 * way
        ahead = abs(line.s[one] - line.s[k * n]) / abs(line.s[two] - line.s[one]) if n >= 4 else 0.0
        end = max(size[one] + ahead * (size[one] - size[two]), 0.0)
        change = kappa[:, one] + ahead * (kappa[:, one] - kappa[:, two])
        kappa[:, nodes] -= change[:, None] * parts[:, None]
        kappa[:, nodes, 0] -= end * parts * (by_size - by_depth)
        size[nodes] -= end * parts


def _without_drag(line: Line) -> Line:
    return line._replace(bits=line.bits & ~DRAG, point_drag=0.0 * line.point_drag)
