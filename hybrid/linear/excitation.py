"""What excites a line about its equilibrium, by frequency: waves that pass, and motions of its ends.

Everything is  Re(X exp(-i w t)),  so that velocities are -i w X and accelerations -w^2 X.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import chain

import numpy as np

from hybrid.kernels.algebra.block_elimination import SIZE, WIDTH
from hybrid.kernels.laws.water import wave_kinematics
from hybrid.kernels.state.report import DRAG, FLOW, SURFACE, WAVES
from hybrid.kernels.state.state import LANES, RIDES, Floats, Line, Sea, State
from hybrid.model.build import Model
from hybrid.scene.combinations import RESPONSE_TO_MOTION

# The block rows of a line at rest in a sea.
RowsOf = Callable[[Sea], Floats]
# Amplitude, m, of the wave by which loads are differentiated, as a part of its length.
SMALL_WAVE = 1e-6
# Frequencies that agree within this part are one.
SAME = 1e-9


@dataclass(frozen=True)
class Excitation:
    """Loads on a line at one frequency, 1/s, complex amplitudes.

    forces: (N+1, 3) N, of the waves but for drag; water: (N+1, 3) m/s, its velocity at the nodes; shifts: (2, 3) m and
    turns: (2, 3) rad of the ends.
    """

    omega: float
    forces: Floats
    water: Floats
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
        shifts, turns = np.zeros((2, 3), complex), np.zeros((2, 3), complex)
        for wave in waves[np.abs(waves[:, 1] - omega) <= SAME * omega]:
            size = wave[0] * np.exp(1j * wave[4])
            if line.bits & WAVES:
                if still is None:
                    still = _in_sea(there.still(), state, rows_of)
                by_wave, speed = _of_wave(there, state, wave, rows_of, still)
                forces, water = forces + size * by_wave, water + size * speed
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
        out.append(Excitation(float(omega), forces, water, shifts, turns))
    return out


def _of_wave(there: SmallSea, state: State, wave: Floats, rows_of: RowsOf, still: Floats) -> tuple[Floats, Floats]:
    """Forces (N+1, 3) N but drag, and velocities (N+1, 3) m/s of the water, by a unit wave.

    Of amplitude 1 m and phase 0; still: both (N+1, 6) without waves.
    """
    both = _amplitudes([still, *(_in_sea(sea, state, rows_of) for sea in there.waves(wave))], wave)
    return both[:, :3], both[:, 3:]


def _in_sea(there: Sea, state: State, rows_of: RowsOf) -> Floats:
    """Forces (N) but drag on nodes, and velocities of the water (m/s) there, (N+1, 6)."""
    wave_kinematics(there, state.r, np.zeros_like(state.r))
    forces = -rows_of(there).reshape(-1, SIZE, WIDTH)[:, 1:4, -1]
    return np.concatenate([forces, there.flow[:, :3]], axis=1)


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
        self.sea = sea._replace(
            waves=np.zeros((1, sea.waves.shape[1])), orbits=np.zeros(1), now=np.array([0.0, sea.now[1], 1.0, 0.0]),
            flow=np.zeros((places, 7)), lanes=np.zeros((12, LANES)),
        )  # fmt: skip

    def still(self) -> Sea:
        """Without waves."""
        self.sea.waves[0], self.sea.orbits[0] = 1.0, 0.0
        self.sea.waves[0, 0] = 0.0
        return self.sea

    def waves(self, wave: Floats) -> Iterator[Sea]:
        """With the cosine, then with the sine of a wave (6,) that is small."""
        for phase in (0.0, -0.5 * np.pi):
            self.sea.waves[0] = wave
            self.sea.waves[0, [0, 4]] = _small(wave), phase
            self.sea.orbits[0] = self.sea.waves[0, 0] * self.sea.waves[0, 1]
            yield self.sea


def _small(wave: Floats) -> float:
    return float(SMALL_WAVE * 2.0 * np.pi / wave[5])


def _amplitudes(found: list[Floats], wave: Floats) -> Floats:
    """Complex amplitudes by a wave of 1 m, of what was found in each of its seas."""
    return np.asarray(((found[1] - found[0]) + 1j * (found[2] - found[0])) / _small(wave))


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
