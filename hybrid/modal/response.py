"""`hybrid.response`: standard deviations, spectra and extremes in a stationary sea, linear about the equilibrium.

At every frequency of the scene's waves and motions

    (A - w^2 M - i w C) q = f,      C = C_0 + C_d,

with the matrices of the modes, the damping C_0 of the sections and the bed, and drag C_d that is linear in the mean
square, found by iteration (hybrid.modal.drag).  docs/theory.md, 21.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu
from scipy.special import ndtr

from hybrid.errors import Complaint, ComputationError, Outcome, SceneError
from hybrid.kernels.algebra.block_elimination import SIZE, WIDTH
from hybrid.kernels.junctions.bodies import DAMPING, FRAME, PIECES, V
from hybrid.kernels.state.forces import BODIES, DRAG, SEABED, WAVES
from hybrid.kernels.state.state import Floats, Line, Sea
from hybrid.modal.api import Rest, equilibrium_of, of_first_length
from hybrid.modal.check import compared
from hybrid.modal.drag import HARMONIC, across, along, size_deviation
from hybrid.modal.excitation import Excitation, current_at, excitations_of, frequencies_of, half_cells, refuse_motions
from hybrid.modal.matrices import ANCHOR, LinearLine, by_turn, linear_network, rows_at_rest, sparse_rows
from hybrid.model.build import Model
from hybrid.scene.read import SceneLike, as_scene_or_system
from hybrid.scene.system import System
from hybrid.solve.joined import JoinedLine
from hybrid.statistics.fatigue import Curve, curve_of, dirlik_damage

# Rounds of the linear drag, and the relative change of its largest part at which they end.
ROUNDS, SETTLED, RELAXED = 30, 2e-3, 0.8
# Of many frequencies one in so many serves for the iteration, and at least so many do.
FEWER, LEAST_FREQUENCIES = 4, 12
# Parts of the motion beyond which the line is not linear: share of time that it would be slack; turn of a chord, rad;
# mean tension by the stretch of swinging, of the standard deviation of tension; length that lifts off or touches down.
SLACK_SHARE, TURN, STRETCH, LIFTS = 1e-3, 0.2, 0.25, 0.02
HOURS = 3.0
# Of sigma^2: standard deviation of what linear drag leaves of |u| u, sqrt(3 - 8/pi) in still water, sqrt(2) in a
# current that is faster than the motion.
LEFT_STILL, LEFT_IN_FLOW = math.sqrt(3.0 - 8.0 / math.pi), math.sqrt(2.0)
# Part by which that may change a deviation of curvature of at least this part of the largest.
BY_HARMONICS, OF_LARGEST = 0.1, 0.2
# Part by which a run in time may differ before that is told: short runs of a sea differ by as much.
MOST_APART = 0.15
VARIES = ("position", "tension", "curvature", "curvature_across")
STRAIGHT = 1e-9  # 1/m: less is no bend
AWRY = (0.3, 0.9, 0.4)  # along no axis


@dataclass(frozen=True)
class LineSpectrum:
    """Power at single frequencies: f (F,) Hz, power (F, ...) in unit squared, half the squares of amplitudes."""

    f: Floats
    power: Floats

    def moment(self, n: int) -> Floats:
        """Sum of f^n power (...), unit squared times Hz^n."""
        return np.asarray(np.tensordot(self.f**n, self.power, axes=1))


@dataclass(frozen=True)
class LineResponse:
    """Response of one line: mean and complex amplitudes at every frequency.

    s: (N+1,) m; middle: (N,) m, of the cells; f: (F,) Hz.  Amplitudes of exp(-2 pi i f t): position (F, N+1, 3) m,
    tension (F, N) N, curvature (F, N+1) 1/m in the plane in which the line is bent at rest, and curvature_across it.
    Means: (N+1, 3), (N,), (N+1,).
    """

    s: Floats
    middle: Floats
    f: Floats
    position: Floats
    tension: Floats
    curvature: Floats
    curvature_across: Floats
    mean_position: Floats
    mean_tension: Floats
    mean_curvature: Floats

    def spectrum(self, name: str) -> LineSpectrum:
        """Power by frequency of position (F, N+1, 3), tension (F, N), curvature or curvature_across (F, N+1)."""
        if name not in VARIES:
            raise ValueError(f"{name!r}: one of {', '.join(VARIES)}")
        return LineSpectrum(self.f, 0.5 * np.abs(getattr(self, name)) ** 2)

    def deviation(self, name: str) -> Floats:
        """Standard deviation, in the unit of the quantity; of `curvature` that of its size, with what is across."""
        if name != "curvature":
            return np.sqrt(self.spectrum(name).moment(0))
        both = np.stack([self.curvature, self.curvature_across], axis=2)
        covariance = 0.5 * np.einsum("fnk,fnl->nkl", both, both.conj()).real
        return size_deviation(self.mean_curvature, covariance)

    def period(self, name: str) -> Floats:
        """Mean period between up-crossings, s."""
        spectrum = self.spectrum(name)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.sqrt(spectrum.moment(0) / spectrum.moment(2)))

    def most_probable(self, name: str, hours: float = HOURS) -> Floats:
        """Most probable largest deviation from the mean in so many hours of a Gaussian process; never more than all

        amplitudes together.
        """
        period = self.period(name)
        cycles = np.maximum(3600.0 * hours / np.where(period > 0.0, period, np.inf), 1.0)
        together = np.abs(getattr(self, name)).sum(axis=0)
        return np.minimum(self.deviation(name) * np.sqrt(2.0 * np.log(cycles)), together)

    def damage(self, curve: str | Mapping[str, float | str] | Curve, strength: float, hours: float = HOURS) -> Floats:
        """Fatigue damage (N,) of the tension by Dirlik's law, with a T-N curve over a strength (N)."""
        found = curve_of(curve)
        spectrum = self.spectrum("tension")
        scaled: Any = LineSpectrum(spectrum.f, spectrum.power / strength**2)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.nan_to_num(dirlik_damage(scaled, found, 3600.0 * hours))


@dataclass(frozen=True)
class Response:
    """Response of a scene: by the name of a line (`cable` of a scene of one); notes say where it is not valid.

    points: (F, 3) m and bodies: (F, 6) m, rad by name, complex amplitudes.  checks: of a run in time, by quantity where
    it varies most, the standard deviation here and there.
    """

    title: str
    lines: Mapping[str, LineResponse]
    points: Mapping[str, Floats]
    bodies: Mapping[str, Floats]
    rounds: int
    checks: Mapping[str, tuple[float, float]]
    notes: tuple[str, ...]

    @property
    def valid(self) -> bool:
        """Whether nothing speaks against any of it."""
        return not self.notes

    def valid_for(self, name: str) -> bool:
        """Whether nothing speaks against a quantity: what is said of curvature alone is no doubt of others."""
        return not any("curvature at s" not in x or name.startswith("curvature") for x in self.notes)


def response(scene: SceneLike | System, friction: bool = True, check: float | None = None) -> Response:
    """Response to the waves and harmonic motions of a scene, stationary, linear about its equilibrium.

    Drag is linear in the mean square, found by iteration; the mean drag of the waves is left out.  friction: as of
    `hybrid.modes`.  check: s, of a run in time to compare with.

    SceneError: nothing excites it, or what does is no sum of harmonics; ComputationError: no equilibrium.
    """
    asked = as_scene_or_system(scene)
    rest = equilibrium_of(asked)
    refuse_motions(rest.models, rest.names)
    omegas = frequencies_of(rest.models)
    if not omegas.size:
        expected = "waves, or ends that move as harmonics"
        raise SceneError([Complaint("environment.fluid.waves", "nothing that moves", expected, "add `waves`")])
    if any(row[PIECES] > 0 for row in rest.solver.bodies):
        expected = "bodies without members, whose drag and wetting are no part of a linear response yet"
        raise SceneError([Complaint("bodies", "members", expected, "hybrid run computes them in time")])
    run = _Linear(rest, omegas, friction)
    rounds = run.settle()
    lines = {x.name: x.result() for x in run.lines}
    notes = [
        *of_first_length(asked),
        *run.notes(),
        *([] if rounds < ROUNDS else [f"linear drag has not settled in {ROUNDS} rounds"]),
    ]
    checks = {} if check is None else compared(asked, lines, check)
    off = {name: there for name, (here, there) in checks.items() if abs(here - there) > MOST_APART * there}
    notes += [
        f"not valid: {name} has a standard deviation of {x:.4g} in a run of {check:g} s" for name, x in off.items()
    ]
    return Response(asked.title, lines, run.points(), run.bodies(), rounds, checks, tuple(notes))


class _Loaded:
    """One line, its drag, and what excites it."""

    def __init__(self, x: JoinedLine, linear: LinearLine, model: Model, omegas: Floats) -> None:
        self.name, self.linear, self.x = linear.name, linear, x
        self.line, state, self.sea = linear.line, linear.state, model.sea.at(np.inf)
        count, calm = self.line.s.size, _without_drag(self.line)

        def rows_of(sea: Sea) -> Floats:
            rows = np.zeros((count, SIZE * WIDTH))
            wet = calm._replace(bits=calm.bits | WAVES)
            rows_at_rest(wet, x._replace(sea=sea), x.ends, state, (0.0, ANCHOR), rows)
            return rows

        self.excited: list[Excitation] = excitations_of(model, x.line, state, omegas, rows_of)
        still, moving = np.zeros((count, SIZE * WIDTH)), np.zeros((count, SIZE * WIDTH))
        rows_at_rest(calm, x, x.ends, state, (0.0, ANCHOR), still)
        rows_at_rest(calm, x, x.ends, state, (1.0, ANCHOR), moving)
        self.damping = sparse_rows(moving - still)  # of the sections and of the bed
        self.node, self.d, self.cn, self.ct, self.current = half_cells(self.line, self.sea, state)
        e1 = np.cross(self.d, np.eye(3)[np.abs(self.d).argmin(axis=1)])
        e1 /= np.linalg.norm(e1, axis=1)[:, None]
        self.axes = np.stack([e1, np.cross(self.d, e1)], axis=1)  # (H, 2, 3)
        self.point_drag = np.nan_to_num(self.line.point_drag) if self.line.bits & BODIES else np.zeros(count)
        self.q = np.zeros((len(omegas), count, SIZE), complex)
        self.omegas = omegas
        self.blocks = np.zeros((count, 3, 3))

    def drag_blocks(self, which: np.ndarray, start: bool) -> Floats:
        """Linear drag (N+1, 3, 3) N s/m of every node, by the motion found last at some frequencies, which stand for
        all; start: by the water alone."""
        water = np.stack([self.excited[f].water for f in which])
        motion = 0.0 * water if start else -1j * self.omegas[which, None, None] * self.q[which, :, 1:4]
        relative = math.sqrt(len(self.omegas) / which.size) * (water - motion)  # (F, N+1, 3)
        blocks = np.zeros((self.line.s.size, 3, 3))
        self.left = np.zeros(self.line.s.size)  # N, what linear drag leaves of the quadratic one, standard deviation
        factor = HARMONIC if len(self.omegas) == 1 else 1.0
        used = (self.cn > 0.0) | (self.ct > 0.0)
        if used.any():
            node, d, axes = self.node[used], self.d[used], self.axes[used]
            u = relative[:, node]
            un = np.einsum("fhi,hmi->fhm", u, axes)
            covariance = 0.5 * np.einsum("fhm,fhn->hmn", un, un.conj()).real
            mean = np.einsum("hi,hmi->hm", self.current[used], axes)
            square = np.linalg.eigvalsh(covariance)[:, -1]
            part = np.minimum(np.linalg.norm(mean, axis=1) / np.sqrt(np.maximum(square, 1e-300)), 1.0)
            np.add.at(self.left, node, self.cn[used] * square * (LEFT_STILL + part * (LEFT_IN_FLOW - LEFT_STILL)))
            B = np.einsum("hmi,hmn,hnj->hij", axes, across(mean, covariance), axes) * self.cn[used][:, None, None]
            ut = np.einsum("fhi,hi->fh", u, d)
            t = along(np.einsum("hi,hi->h", self.current[used], d), np.sqrt(0.5 * (np.abs(ut) ** 2).sum(axis=0)))
            B += (self.ct[used] * t)[:, None, None] * d[:, :, None] * d[:, None, :]
            np.add.at(blocks, node, factor * B)
        at = np.flatnonzero(self.point_drag)
        if at.size:
            u = relative[:, at]
            covariance = 0.5 * np.einsum("fni,fnj->nij", u, u.conj()).real
            flow = current_at(self.line, self.sea, self.linear.r[at])
            blocks[at] += factor * self.point_drag[at][:, None, None] * across(flow, covariance)
        return blocks

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
        n, excited = self.line.s.size, [self.excited[f] for f in which]
        w = self.omegas[which]
        force, held = np.zeros((n, SIZE, which.size), complex), np.zeros((n, SIZE, which.size), complex)
        for f, x in enumerate(excited):
            force[:, 1:4, f] = x.forces
            for k in (0, 1):
                held[-k, 1:4, f] += x.shifts[k]
        water = np.stack([x.water for x in excited], axis=2)
        force[:, 1:4] += np.einsum("nij,njf->nif", self.blocks, water)
        out = force.reshape(n * SIZE, -1)
        if held.any():
            moved = held.reshape(n * SIZE, -1)
            K, M = self.linear.stiffness, self.linear.mass
            out = out - (K @ moved - (M @ moved) * w**2 - 1j * (C @ moved) * w)
        for k in (0, 1):
            turns = np.stack([x.turns[k] for x in excited], axis=1)
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
        for f in which:
            for k in (0, 1):
                if self.x.joints[k] < 0 and self.x.ends.held[k]:
                    self.q[f, -k, 1:4] = self.excited[f].shifts[k]

    def result(self) -> LineResponse:
        """Amplitudes of what users ask for."""
        state, q = self.linear.state, self.q
        l = np.linalg.norm(state.e, axis=1)
        d = state.e / l[:, None]
        de = np.diff(q[:, :, 1:4], axis=1)
        dd = (de - np.einsum("fni,ni->fn", de, d)[:, :, None] * d) / l[:, None]
        frames = self.x.ends.frame.reshape(2, 3, 3)[:, :, 2]  # tangents that clamps hold
        turns = np.stack([x.turns for x in self.excited])
        held = [np.cross(turns[:, k], frames[k])[:, None] for k in (0, 1)]
        before, after = np.vstack([frames[:1], d]), np.vstack([d, frames[1:]])
        change = np.concatenate([dd, held[1]], axis=1) - np.concatenate([held[0], dd], axis=1)
        length = np.concatenate([[0.5 * l[0]], 0.5 * (l[1:] + l[:-1]), [0.5 * l[-1]]])
        bend, change = (after - before) / length[:, None], change / length[:, None]
        for k in (0, 1):
            if not self.line.element[-k]:
                bend[-k], change[:, -k] = 0.0, 0.0
        size = np.linalg.norm(bend, axis=1)
        t = self.linear.t
        first = np.where(size[:, None] > STRAIGHT, bend / np.maximum(size, 1e-300)[:, None], np.cross(t, AWRY))
        first -= np.einsum("ni,ni->n", first, t)[:, None] * t
        first /= np.maximum(np.linalg.norm(first, axis=1), 1e-300)[:, None]
        axes = np.stack([first, np.cross(t, first)], axis=1)
        kappa = np.einsum("fni,nki->fnk", change, axes)
        return LineResponse(
            self.line.s.copy(), 0.5 * (self.line.s[1:] + self.line.s[:-1]), self.omegas / (2.0 * np.pi), q[:, :, 1:4],
            q[:, 1:, 0], kappa[:, :, 0], kappa[:, :, 1], state.r.copy(), state.T.copy(), size,
        )  # fmt: skip


def _without_drag(line: Line) -> Line:
    return line._replace(bits=line.bits & ~DRAG, point_drag=0.0 * line.point_drag)


def _aligned(matrices: Sequence[sparse.csc_array]) -> tuple[list[Floats], sparse.csc_array]:
    """The numbers of matrices in the places of all of them, and a complex matrix that has these places."""
    size = matrices[0].shape[0]
    keys = []
    for x in matrices:
        columns = np.repeat(np.arange(size), np.diff(x.indptr))
        keys.append(columns.astype(np.int64) * size + x.indices)
    every = np.unique(np.concatenate(keys))
    parts = []
    for key, x in zip(keys, matrices, strict=True):
        part = np.zeros(every.size)
        np.add.at(part, np.searchsorted(every, key), x.data)
        parts.append(part)
    begin = np.searchsorted(every, np.arange(size + 1, dtype=np.int64) * size)
    return parts, sparse.csc_array((np.zeros(every.size, complex), every % size, begin), shape=(size, size))


class _Linear:
    """The network in the sea."""

    def __init__(self, rest: Rest, omegas: Floats, sticks: bool) -> None:
        self.rest, self.omegas = rest, omegas
        self.network = linear_network(rest.solver, rest.states, rest.names, sticks)
        self.lines = [
            _Loaded(x, linear, model, omegas)
            for x, linear, model in zip(rest.solver.lines, self.network.lines, rest.models, strict=True)
        ]
        first = self.network.size - 3 * self.network.points - 6 * self.network.bodies
        entries, size = [np.zeros((0, 3))], self.network.size
        for b, (row, state) in enumerate(zip(rest.solver.bodies, rest.states.bodies, strict=True)):
            R = np.kron(np.eye(2), state[FRAME:V].reshape(3, 3))
            C = R @ row[DAMPING : DAMPING + 36].reshape(6, 6) @ R.T
            at = first + 3 * self.network.points + 6 * b
            i, j = np.nonzero(C)
            entries.append(np.column_stack([at + i, at + j, C[i, j]]))
        every = np.concatenate(entries)
        places = every[:, 0].astype(int), every[:, 1].astype(int)
        self.of_bodies = sparse.csr_array((every[:, 2], places), shape=(size, size))
        self.vectors = np.zeros((len(omegas), size), complex)

    def settle(self) -> int:
        """Iterate the linear drag, first by some of the frequencies; rounds that it took."""
        every = np.arange(len(self.omegas))
        some = every[len(every) % FEWER // 2 :: FEWER] if len(every) >= LEAST_FREQUENCIES * FEWER else every
        for x in self.lines:
            x.blocks = x.drag_blocks(every, start=True)
        for round_ in range(1, ROUNDS + 1):
            self._solve(some)
            worst = 0.0
            for x in self.lines:
                new = x.drag_blocks(some, start=False)
                size = float(np.abs(new).max(initial=0.0))
                if size > 0.0:
                    worst = max(worst, float(np.abs(new - x.blocks).max()) / size)
                x.blocks = x.blocks + RELAXED * (new - x.blocks)
            if worst < SETTLED:
                if some.size == every.size:
                    return round_
                some = every  # once more, by all
        return ROUNDS

    def _solve(self, which: np.ndarray) -> None:
        """The motion at some of the frequencies, with the drag as it is."""
        P = self.network.place
        dampings = [x.full_damping() for x in self.lines]
        C = sparse.csc_array(P.T @ sparse.block_diag(dampings, format="csr") @ P) + self.of_bodies
        parts, pattern = _aligned([self.network.stiffness + self.network.skew, self.network.mass, C])
        right = P.T @ np.concatenate(
            [x.loads(which, damping) for x, damping in zip(self.lines, dampings, strict=True)], axis=0
        )
        for column, f in enumerate(which):
            w = self.omegas[f]
            pattern.data = parts[0] - w * w * parts[1] - 1j * w * parts[2]
            try:
                self.vectors[f] = splu(pattern).solve(right[:, column])
            except RuntimeError:
                detail = f"at {w / (2.0 * np.pi):.4g} Hz, where nothing damps a mode"
                raise ComputationError(Outcome.SINGULAR, None, None, detail) from None
        whole = (P @ self.vectors[which].T).T
        for x, a, b in zip(self.lines, self.network.at[:-1], self.network.at[1:], strict=True):
            x.take(which, whole[:, a:b].reshape(which.size, -1, SIZE))

    def points(self) -> dict[str, Floats]:
        """Complex shifts (F, 3) m of free points."""
        first = self.network.size - 3 * self.network.points - 6 * self.network.bodies
        return {name: self.vectors[:, first + 3 * k : first + 3 * k + 3] for k, name in enumerate(self.rest.points)}

    def bodies(self) -> dict[str, Floats]:
        """Complex shifts and turns (F, 6) m, rad of free bodies."""
        first = self.network.size - 6 * self.network.bodies
        return {name: self.vectors[:, first + 6 * k : first + 6 * k + 6] for k, name in enumerate(self.rest.bodies)}

    def notes(self) -> Iterator[str]:
        """Where the motion is too large to be linear."""
        for x in self.lines:
            name = f"line {x.name}: " if len(self.lines) > 1 else ""
            found = x.result()
            for doubt in (_slack, _swing, _touchdown, _harmonics):
                yield from (f"{name}not valid: {text}" for text in doubt(x, found))


def _slack(x: _Loaded, found: LineResponse) -> Iterator[str]:
    """Where tension would be below zero."""
    tension, deviation = found.mean_tension, found.deviation("tension")
    slack = ndtr(-tension / np.maximum(deviation, 1e-300))
    k = int(slack.argmax())
    if slack[k] > SLACK_SHARE:
        yield (
            f"at s = {found.middle[k]:.4g} m the tension of {tension[k]:.4g} N has a standard deviation of "
            f"{deviation[k]:.4g} N: it would be below zero for {100.0 * slack[k]:.2g} % of the time"
        )


def _swing(x: _Loaded, found: LineResponse) -> Iterator[str]:
    """Where chords turn so far that their squares count: by themselves, and by the length that they take."""
    d = x.linear.state.e / np.linalg.norm(x.linear.state.e, axis=1)[:, None]
    l = np.linalg.norm(x.linear.state.e, axis=1)
    de = np.diff(found.position, axis=1)
    de = de - np.einsum("fni,ni->fn", de, d)[:, :, None] * d
    square = 0.5 * (np.abs(de) ** 2).sum(axis=(0, 2)) / l**2
    k = int(square.argmax())
    if square[k] > TURN**2:
        yield f"at s = {found.middle[k]:.4g} m the line turns by {math.sqrt(square[k]):.2g} rad (standard deviation)"
    compliance = float((x.line.h * x.line.ck).sum())
    deviation = found.deviation("tension")
    if compliance > 0.0:
        pull = 0.5 * float((square * l).sum()) / compliance
        at = int(deviation.argmin())
        if pull > STRETCH * deviation[at]:
            yield (
                f"swinging alone stretches the line, which would take {pull:.3g} N in the mean where the standard "
                f"deviation of the tension is {deviation[at]:.3g} N (s = {found.middle[at]:.4g} m)"
            )


def _touchdown(x: _Loaded, found: LineResponse) -> Iterator[str]:
    """What of the line lifts off the bed or comes down on it."""
    if not x.line.bits & SEABED or not x.sea.stiffness > 0.0:
        return
    gap = found.mean_position @ x.sea.normal - x.sea.offset
    up = np.sqrt(0.5 * (np.abs(found.position @ x.sea.normal) ** 2).sum(axis=0))
    share = np.append(x.line.h, x.line.h[-1])
    # the length over which a motion of two standard deviations crosses the bed
    crosses = float(share[2.0 * up > np.abs(gap)].sum())
    if crosses > LIFTS * float(x.line.s[-1]):
        yield (
            f"about {crosses:.3g} m of line lift off the bed and come down on it, which contact as it is at rest does "
            "not show: tension and curvature there are doubtful"
        )


def _harmonics(x: _Loaded, found: LineResponse) -> Iterator[str]:
    """Where the harmonics of quadratic drag bend the line as much as its motion does; tension hardly hears of them."""
    deviation = found.deviation("curvature")
    length = np.linalg.norm(x.linear.state.e, axis=1)
    share = 0.5 * (np.append(length, 0.0) + np.append(0.0, length))
    pull = np.maximum(np.interp(found.s, found.middle, found.mean_tension), 1e-300)
    bend = x.left / (share * pull)  # of a string whose load varies slowly: the most that it can be
    counts = deviation >= OF_LARGEST * deviation.max()
    more = np.where(counts, np.hypot(1.0, bend / np.maximum(deviation, 1e-300)) - 1.0, 0.0)
    k = int(more.argmax())
    if more[k] > BY_HARMONICS:
        yield (
            f"curvature at s = {found.s[k]:.4g} m: harmonics of the drag, which linear drag leaves out, may add up to "
            f"{100.0 * more[k]:.0f} % to its standard deviation of {deviation[k]:.3g} 1/m"
        )
