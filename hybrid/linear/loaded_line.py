"""One line of a linear network in the sea: excitation, linear drag, and motion by frequency.

What excites it about its equilibrium are waves that pass, and motions of its ends.  Everything is  Re(X exp(-i w t)),
so that velocities are -i w X and accelerations -w^2 X.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import chain

import numpy as np
from scipy import sparse

from hybrid.kernels.algebra.block_elimination import SIZE, WIDTH
from hybrid.kernels.junctions.bodies import FRAME, PLACE, V
from hybrid.kernels.junctions.joined_lines import TURNS
from hybrid.kernels.laws.bending_law import RIGID, parts_without_spring
from hybrid.kernels.laws.closed_forms import FADED
from hybrid.kernels.laws.water import ALONG, CM, CN, CT, MIDDLE, PUSH, WATER, WET, wave_kinematics
from hybrid.kernels.state.report import BODIES, DRAG, FLOW, SURFACE, WAVES
from hybrid.kernels.state.state import LANES, RIDES, Floats, Line, Sea, State
from hybrid.linear.matrices import ANCHOR, LinearLine, LinearNetwork, RestMarch, by_turn, rows_at_rest, sparse_rows
from hybrid.linear.response_results import LineResponse, axes_across, linear_law, of_cylinders, phases_of
from hybrid.linear.touching import Blocks, Rest, places_of
from hybrid.model.bodies import Members
from hybrid.model.build import Model
from hybrid.scene.combinations import RESPONSE_TO_MOTION
from hybrid.solve.stepper import JoinedLine

# The block rows of a line at rest in a sea.
RowsOf = Callable[[Sea], Floats]
# Amplitude, m, of the wave by which loads are differentiated, as a part of its length.
SMALL_WAVE = 1e-6
# Frequencies that agree within this part are one.
SAME = 1e-9


@dataclass(frozen=True)
class Excitation:
    """Loads on a line at one frequency, 1/s, complex amplitudes.

    forces: (N+1, 3) N, of the waves but for drag; water: (N+1, 3) m/s, its velocity at the nodes; rise: (N+1,) m, of
    the surface above them; shifts: (2, 3) m and turns: (2, 3) rad of the ends.
    """

    omega: float
    forces: Floats
    water: Floats
    rise: Floats
    shifts: Floats
    turns: Floats


def frequencies_of(models: tuple[Model, ...], waves: Iterable[Floats] = ()) -> Floats:
    """All frequencies (F,) 1/s that excite lines, increasing; waves: (K, 6) that excite bodies."""
    found = [np.zeros(0), *(x[:, 1] for x in waves)]
    for model in models:
        if model.line.bits & WAVES or _follows(model):
            found.append(model.sea.values.waves[:, 1])
        found.append(model.ends.moves().harmonics[:, 3])
    every = np.unique(np.concatenate(found))
    if not every.size:
        return every
    return np.asarray(every[np.concatenate([[True], np.diff(every) > SAME * every[1:]])])


def _follows(model: Model) -> bool:
    return bool(model.ends.moves().follows.any())


def refuse_motions(models: tuple[Model, ...], names: tuple[str, ...]) -> None:
    """SceneError for ends whose motion is no sum of harmonics."""
    for model, name in zip(models, names, strict=True):
        moves = model.ends.moves()
        what = ""
        if (moves.file[:, 1] > moves.file[:, 0]).any():
            what = "a motion from a file"
        elif moves.velocity.any() or moves.travel[:, 4].any():
            what = "an end that travels"
        if what:
            raise RESPONSE_TO_MOTION.error(f"motion of {name}", what)


def excitations_of(model: Model, line: Line, state: State, omegas: Floats, rows_of: RowsOf) -> list[Excitation]:
    """Loads on a line (in space) about its equilibrium, at each of the frequencies.

    rows_of(sea): fills and gives the block rows of the state in that sea.
    """
    moves, sea = model.ends.moves(), model.sea.values
    still: Floats | None = None  # forces and velocities without waves, which are those of any wave of no height
    waves = sea.waves if line.bits & WAVES or _follows(model) else sea.waves[:0]
    count, out = line.s.size, []
    there = SmallSea(sea, count)
    for omega in omegas:
        forces, water = np.zeros((count, 3), complex), np.zeros((count, 3), complex)
        rise = np.zeros(count, complex)
        shifts, turns = np.zeros((2, 3), complex), np.zeros((2, 3), complex)
        for wave in waves[np.abs(waves[:, 1] - omega) <= SAME * omega]:
            size = wave[0] * np.exp(1j * wave[4])
            if line.bits & WAVES:
                if still is None:
                    still = _in_sea(there.still(), state, rows_of)
                in_seas = [still, *(_in_sea(x, state, rows_of) for x in there.waves(wave))]
                both = size * _amplitudes(in_seas, wave)
                forces, water, rise = forces + both[:, :3], water + both[:, 3:6], rise + both[:, 6]
            for k in (0, 1):
                if moves.follows[k]:
                    place = moves.position[k]
                    shifts[k, 2] += size * np.exp(1j * (wave[2] * place[0] + wave[3] * place[1]))
        for k, axis, amplitude, _, phase in moves.harmonics[np.abs(moves.harmonics[:, 3] - omega) <= SAME * omega]:
            size, end = 1j * amplitude * np.exp(-1j * phase), int(k)
            if axis < 3:
                shifts[end, int(axis)] += size
                continue
            turn = size * np.eye(3)[int(axis) - 3]
            turns[end] += turn
            if moves.fairlead[end, RIDES]:
                arm = moves.frame[end].reshape(3, 3) @ moves.fairlead[end, 1:4]
                shifts[end] += np.cross(turn, arm)
        out.append(Excitation(float(omega), forces, water, rise, shifts, turns))
    return out


def _in_sea(there: Sea, state: State, rows_of: RowsOf) -> Floats:
    """Forces (N) but drag on nodes, velocities of the water (m/s) there, and rise of the surface (m), (N+1, 7)."""
    wave_kinematics(there, state.r, np.zeros_like(state.r))
    forces = -rows_of(there).reshape(-1, SIZE, WIDTH)[:, 1:4, -1]
    return np.concatenate([forces, there.flow[:, :3], there.flow[:, 6:]], axis=1)


def water_of_wave(sea: Sea, wave: Floats, places: Floats) -> Floats:
    """Velocity and acceleration of the water, and rise of the surface, (n, 7) by a unit wave.

    Of amplitude 1 m and phase 0, at places (n, 3) m.
    """
    there, found = SmallSea(sea, len(places)), []
    for each in chain([there.still()], there.waves(wave)):  # one at a time: they share their arrays
        wave_kinematics(each, places, np.zeros_like(places))
        found.append(each.flow.copy())
    return _amplitudes(found, wave)


class SmallSea:
    """A sea with one small wave or none, whose arrays are written anew: what is bound once stays bound."""

    def __init__(self, sea: Sea, places: int) -> None:
        """places: at which there is water."""
        still = sea._replace(waves=np.zeros((1, sea.waves.shape[1])), orbits=np.zeros(1))
        now = np.array([0.0, sea.now[1], 1.0, 0.0])
        self.sea = still._replace(now=now, flow=np.zeros((places, 7)), lanes=np.zeros((12, LANES)))

    def still(self) -> Sea:
        """Without waves."""
        self.sea.waves[0], self.sea.orbits[0] = 1.0, 0.0
        self.sea.waves[0, 0] = 0.0
        return self.sea

    def waves(self, wave: Floats) -> Iterator[Sea]:
        """With the cosine, then with the sine of a wave (6,) that is small."""
        for phase in (0.0, -0.5 * np.pi):
            self.sea.waves[0] = wave
            self.sea.waves[0, [0, 4]] = SMALL_WAVE * 2.0 * np.pi / wave[5], phase
            self.sea.orbits[0] = self.sea.waves[0, 0] * self.sea.waves[0, 1]
            yield self.sea


def _amplitudes(found: list[Floats], wave: Floats) -> Floats:
    """Complex amplitudes by a wave of 1 m, of what was found in each of its seas."""
    return np.asarray(((found[1] - found[0]) + 1j * (found[2] - found[0])) / (SMALL_WAVE * 2.0 * np.pi / wave[5]))


def half_cells(line: Line, sea: Sea, state: State) -> tuple[np.ndarray, Floats, Floats, Floats, Floats]:
    """Node (H,), direction (H, 3), drag (H,) twice, and current (H, 3) m/s of every half cell.

    Drag is across and along it, N s^2/m^2, as far as it is wet; bodies at nodes are not among them.
    """
    n = line.h.size
    d = state.e / np.linalg.norm(state.e, axis=1)[:, None]
    node = np.concatenate([np.arange(n), np.arange(1, n + 1)])
    cell = np.concatenate([np.arange(n), np.arange(n)])
    wet = np.ones(2 * n)
    if line.bits & SURFACE:
        z = state.r[node, 2] + 0.25 * np.concatenate([state.e[:, 2], -state.e[:, 2]])
        wet = np.clip((sea.surface - z) / np.maximum(line.diameter[cell], 1e-300) + 0.5, 0.0, 1.0)
    drag = bool(line.bits & DRAG)
    cn, ct = ((wet * x[cell] if drag else np.zeros(2 * n)) for x in (line.drag_n, line.drag_t))
    return node, d[cell], cn, ct, current_at(line, sea, state.r[node])


def current_at(line: Line, sea: Sea, places: Floats) -> Floats:
    """The fully grown current (n, 3) m/s at places (n, 3)."""
    if not line.bits & FLOW:
        return np.zeros((len(places), 3))
    part = float(sea.now[1])
    return part * np.column_stack([np.interp(places[:, 2], sea.z, sea.current[:, k]) for k in range(3)])


STRAIGHT = 1e-9  # 1/m: less is no bend
AWRY = (0.3, 0.9, 0.4)  # along no axis


def loaded_lines(rest: Rest, network: LinearNetwork, omegas: Floats) -> list[LoadedLine]:
    """All lines of a network at rest."""
    found, first = [], network.size - 6 * network.bodies
    for x, linear, model in zip(rest.solver.lines, network.lines, rest.models, strict=True):
        carriers = {k: first + 6 * (x.joints[k] - network.points) + 3 for k in (0, 1) if x.seats[k, TURNS] != 0.0}
        found.append(LoadedLine(x, linear, model, omegas, carriers))
    return found


class LoadedLine:
    """One line, its drag, and what excites it."""

    def __init__(
        self, x: JoinedLine, linear: LinearLine, model: Model, omegas: Floats, carriers: Mapping[int, int]
    ) -> None:
        """carriers: of ends that turn with bodies, where the turns of these begin among the numbers of the network."""
        self.name, self.linear, self.x, self.carriers = linear.name, linear, x, carriers
        self.line, state, self.sea = linear.line, linear.state, model.sea.at_time(np.inf)
        self.hinges, self.obstacles = model.cable.hinges, model.sea.names
        self.carried: dict[int, Floats] = {}  # (F, N+1, 3) m, motions of obstacles that bodies carry, at the nodes
        count = self.line.s.size
        calm = self.line._replace(bits=self.line.bits & ~DRAG, point_drag=0.0 * self.line.point_drag)

        rows = np.zeros((count, SIZE * WIDTH))
        # the row of a held start has no forces
        ends = x.ends._replace(held=np.where(np.asarray(x.joints) >= 0, 0, x.ends.held).astype(x.ends.held.dtype))
        march = RestMarch(calm._replace(bits=calm.bits | WAVES), ends, state, rows)

        def rows_of(sea: Sea) -> Floats:
            rows[:] = 0.0
            march(sea, (0.0, ANCHOR))
            return rows

        self.excited: list[Excitation] = excitations_of(model, x.line, state, omegas, rows_of)
        still, moving = np.zeros((count, SIZE * WIDTH)), np.zeros((count, SIZE * WIDTH))
        rows_at_rest(calm, x, ends, state, (0.0, ANCHOR), still)
        rows_at_rest(calm, x, ends, state, (1.0, ANCHOR), moving)
        self.forces, self.water, self.shifts, self.turns = (
            np.array([getattr(e, of) for e in self.excited], complex).reshape(len(omegas), rows, 3)
            for of, rows in (("forces", count), ("water", count), ("shifts", 2), ("turns", 2))
        )
        self.frames = self.turns.copy()  # turns of frames by the motion found last
        self.rise = np.array([e.rise for e in self.excited], complex).reshape(len(omegas), count)
        self.damping = sparse_rows(moving - still)  # of the sections and of the bed
        self.node, self.d, self.cn, self.ct, self.current = half_cells(self.line, self.sea, state)
        self.axes = axes_across(self.d)
        self.point_drag = np.nan_to_num(self.line.point_drag) if self.line.bits & BODIES else np.zeros(count)
        self.q = np.zeros((len(omegas), count, SIZE), complex)
        self.omegas, self.blocks = omegas, np.zeros((count, 3, 3))
        self.phases = phases_of(omegas) if omegas.size else None

    @cached_property
    def by_drag(self) -> bool:
        """Whether free points or bodies move it that have drag of their own, or what it carries and is heavier."""
        carried = np.nan_to_num(self.line.point_mass) + np.nan_to_num(self.line.point_added)
        own = float((self.line.mass - np.nan_to_num(self.line.point_mass)).sum())
        return bool((carried > own)[self.point_drag > 0.0].any())

    def drag_blocks(self, which: np.ndarray, start: bool) -> Floats:
        """Linear drag (N+1, 3, 3) N s/m of every node, by its latest motion.

        which: frequencies that stand for all; start: by the motion of the water alone.
        """
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

    def kinds(self, blocks: Floats) -> tuple[Floats, ...]:
        """Blocks of nodes of the line, and of those with a point or body, whose drag may be much more."""
        return blocks[self.point_drag == 0.0], blocks[self.point_drag > 0.0]

    def relative(self, which: np.ndarray, start: bool = False) -> Floats:
        """Velocity (F, N+1, 3) m/s of the water relative to the nodes, by the motion found last; start: none."""
        water = self.water[which]
        return water if start else water + 1j * self.omegas[which, None, None] * self.q[which, :, 1:4]

    def full_damping(self) -> sparse.csr_array:
        """Over the unknowns of all blocks."""
        at, size, drag = places_of(np.arange(self.line.s.size)), SIZE * self.line.s.size, Blocks()
        drag.add(at, at, self.blocks)
        return self.damping + drag.matrix(size, size)

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
                out = out - self.turned[k].T @ turns + 1j * w * (self.turned_fast[k].T @ turns)
        return out

    @cached_property
    def turned(self) -> tuple[Floats, ...]:
        """(3, 5 (N+1)) of each end, what its frame does to the line when it turns."""
        ends = [by_turn(self.line, self.x, self.x.ends, self.linear.state, k)[0] for k in (0, 1)]
        return tuple(ends)

    @cached_property
    def turned_fast(self) -> tuple[Floats, ...]:
        """The same of how fast it turns, by damping."""
        ends = [by_turn(self.line, self.x, self.x.ends, self.linear.state, k, rates=True)[0] for k in (0, 1)]
        return tuple(ends)

    def turned_with(self, vectors: Floats, turns: Floats) -> Floats:
        """Turns (F, 2, 3) rad of its frames, of those that are given and of bodies in motions (F, q) of the network."""
        out = turns.copy()
        for k, at in self.carriers.items():
            out[:, k] = vectors[:, at : at + 3]
        return out

    def set_motion(self, which: np.ndarray, q: Floats, vectors: Floats) -> None:
        """Keep the motion (F, N+1, 5) at some frequencies, with that of the ends that are held in it.

        vectors: (F, q), the same of the network.
        """
        self.q[which], self.frames[which] = q, self.turned_with(vectors, self.turns[which])
        for k in (0, 1):
            if self.x.joints[k] < 0 and self.x.ends.held[k]:
                self.q[which, -k, 1:4] = self.shifts[which, k]

    def result(self) -> LineResponse:
        """Amplitudes of what users ask for, in the motion found last."""
        return self.response_to(self.q, self.frames, self.omegas)

    def response_to(self, q: Floats, turns: Floats, omegas: Floats) -> LineResponse:
        """Amplitudes of the quantities of a result, in a motion q (F, N+1, 5).

        turns: (F, 2, 3) rad of the frames of its ends; omegas: (F,) rad/s.
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
        s, at_rest = self.line.s, (state.r.copy(), state.T.copy(), size)
        along = s.copy(), 0.5 * (s[1:] + s[:-1]), omegas / (2.0 * np.pi)
        return LineResponse(*along, q[:, :, 1:4], q[:, 1:, 0], kappa[:, :, 0], kappa[:, :, 1], *at_rest)

    def _bend_at_end(self, k: int) -> tuple[float, float]:
        """The bend, rad, of the element at end k at rest, in the axes of the section before it."""
        length, size, axes = self.bend
        a1, d = self.x.ends.frame.reshape(2, 3, 3)[0, :, [0, 2]]
        if k:
            a1, d = self.linear.state.a1[-1], self.linear.state.e[-1]
        about = np.cross(self.linear.t[-k], axes[-k, 0]) * size[-k] * length[-k]
        return float(about @ a1), float(about @ np.cross(d / np.linalg.norm(d), a1))

    @cached_property
    def bend(self) -> tuple[Floats, Floats, Floats]:
        """Bending length (N+1,) m, curvature (N+1,) 1/m and axes (N+1, 2, 3) of every node at rest.

        Both axes are across the line, the first in the plane of the bend, inwards.
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

        As results have it (kernels.watch.sides), up to the first change of section; it changes with tension, whose
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


# Morison members of a free body about rest in the sea: what waves do to the body, and linear drag of its pieces.
#
# A piece at an arm a from the origin moves by  T q,  T = [1, -[a]x],  of the shifts and turns q of its body.  With the
# linear drag B of a half cell (linear.response_results) for its velocity relative to the water, amplitudes of a
# frequency are
#
#     damping  sum T^T B T,    load  sum T^T (B u + w cm (a_w - d (d.a_w)) + dw/dz eta F_U),
#
# u, a_w and eta of the waves: velocity and acceleration of the water at its middle, elevation above it; w its wetted
# part
# at rest, F_U the drag of the current on it if it were wet.

# Part of the wet length of all members over which the surface goes up and down (up to 0.24 a buoy of slender members
# surges and pitches within 3 % of a run, at 0.47 within 12 %), and turn of a body, rad (standard deviation), beyond
# which the motion is not linear.
WETTED, LARGE_TURN = 0.25, 0.2


class LoadedMembers:
    """The members of one body, their drag, and what excites them."""

    def __init__(self, name: str, members: Members, state: Floats, omegas: Floats) -> None:
        """state: (STATE,) of the body at rest; omegas: (F,) 1/s."""
        self.name, self.omegas, self.phases, R = name, omegas, phases_of(omegas), state[FRAME:V].reshape(3, 3)
        rows = members.pieces.copy()
        members.update_water(np.inf, state, 0.0, rows)
        arms, self.d = rows[:, MIDDLE:ALONG] @ R.T, rows[:, ALONG:CN] @ R.T
        self.axes, self.current, self.wet = axes_across(self.d), rows[:, WATER:PUSH].copy(), rows[:, WET].copy()
        self.cn, self.ct, self.length = self.wet * rows[:, CN], self.wet * rows[:, CT], members.lengths
        self.T = np.zeros((len(rows), 3, 6))
        self.T[:, :, :3] = np.eye(3)
        self.T[:, :, 3:] = np.cross(np.eye(3), arms[:, None]).transpose(0, 2, 1)
        self.place = state[PLACE:FRAME] + arms
        self.high, self.surface = members.heights(R), members.sea.surface
        self.water, self.force, self.rise = self._by_waves(members, rows)
        self.q = np.zeros((len(omegas), 6), complex)
        self.blocks = np.zeros((len(rows), 3, 3))

    def _by_waves(self, members: Members, rows: Floats) -> tuple[Floats, Floats, Floats]:
        """Amplitudes at every frequency of the water at members.

        Velocity (F, n, 3) m/s, force but for drag (F, n, 3) N, rise of the surface (F, n) m.
        """
        count, n, sea = len(self.omegas), len(rows), members.sea
        moved = np.zeros((count, n, 7), complex)
        for f, omega in enumerate(self.omegas):
            for wave in sea.waves[np.abs(sea.waves[:, 1] - omega) <= SAME * omega]:
                moved[f] += wave[0] * np.exp(1j * wave[4]) * water_of_wave(sea, wave, self.place)
        water, push, rise = (moved[:, :, at].copy() for at in (slice(3), slice(3, 6), 6))
        across = np.eye(3) - self.d[:, :, None] * self.d[:, None, :]
        force = np.einsum("n,nij,fnj->fni", self.wet * rows[:, CM], across, push)
        ut = np.einsum("ni,ni->n", self.current, self.d)
        un = self.current - ut[:, None] * self.d
        drag = (
            rows[:, [CN]] * np.linalg.norm(un, axis=1)[:, None] * un + (rows[:, CT] * np.abs(ut) * ut)[:, None] * self.d
        )
        crossing = (self.wet > 0.0) & (self.wet < 1.0)
        force += np.where(crossing, rise / self.high, 0.0)[:, :, None] * drag
        return water, force, rise

    def drag_blocks(self, which: np.ndarray, start: bool) -> Floats:
        """Linear drag (n, 3, 3) N s/m of every piece, as of hybrid.linear.loaded_line."""
        u = math.sqrt(len(self.omegas) / which.size) * self.relative(which, start)
        return of_cylinders(self.d, self.axes, (self.cn, self.ct), self.current, u, self.phases)

    def kinds(self, blocks: Floats) -> tuple[Floats, ...]:
        """As of a line."""
        return (blocks,)

    def relative(self, which: np.ndarray, start: bool = False) -> Floats:
        """Velocity (F, n, 3) m/s of the water relative to the pieces, by the motion found last; start: none."""
        motion = np.einsum("nij,fj->fni", self.T, self.q[which] * (0.0 if start else 1.0))
        return np.asarray(self.water[which] + 1j * self.omegas[which, None, None] * motion)

    def damping(self) -> Floats:
        """(6, 6) N s/m, .. of the drag as it is, against velocities of the body."""
        return np.asarray(np.einsum("nia,nij,njb->ab", self.T, self.blocks, self.T))

    def loads(self, which: np.ndarray) -> Floats:
        """(6, F) N, N m on the body."""
        force = self.force[which] + np.einsum("nij,fnj->fni", self.blocks, self.water[which])
        return np.asarray(np.einsum("nia,fni->af", self.T, force))

    def doubts(self) -> Iterator[str]:
        """What of the members is wet now and then: where two standard deviations bring the surface."""
        if not math.isfinite(self.surface):
            return
        rise = self.rise - np.einsum("nj,fj->fn", self.T[:, 2], self.q)
        deviation = np.sqrt(0.5 * (np.abs(rise) ** 2).sum(axis=0))
        upper = np.minimum(self.place[:, 2] + 0.5 * self.high, self.surface + 2.0 * deviation)
        lower = np.maximum(self.place[:, 2] - 0.5 * self.high, self.surface - 2.0 * deviation)
        swept = float((np.maximum(upper - lower, 0.0) / self.high) @ self.length)
        if swept > WETTED * float(self.wet @ self.length):
            yield (
                f"about {swept:.3g} m of the members of body {self.name} come out of the water and go under, and have "
                "the drag and inertia of how they are wet at rest"
            )


def turning_doubts(name: str, q: Floats) -> Iterator[str]:
    """Whether a body turns by so much that it is not linear; q: (F, 6) m, rad."""
    turn = math.sqrt(0.5 * float((np.abs(q[:, 3:]) ** 2).sum()))
    if turn > LARGE_TURN:
        yield f"body {name} turns by {turn:.2g} rad (standard deviation)"
