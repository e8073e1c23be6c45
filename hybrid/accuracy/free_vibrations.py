"""Free vibrations that ramps and moves of ends leave in lines that hardly anything damps, and what steps make of them.

A forced motion forgets, a free vibration does not: its phase is late by a part of a radian in every radian, and steps
take a part of its energy.  Runs with longer steps have lost what the result has lost, and their differences do not show
it.  Here lines are linear about their equilibrium (hybrid.linear): its modes, and what ends excite of them.
docs/errors.md
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cache
from itertools import pairwise
from math import pi
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from hybrid.errors import ComputationError, SceneError
from hybrid.kernels.algebra.block_elimination import SIZE, WIDTH
from hybrid.kernels.junctions.bodies import DAMPING
from hybrid.kernels.state.report import BENDING_SLIP, BODIES, DRAG, SOIL
from hybrid.kernels.state.state import Floats
from hybrid.linear.eigen import BELOW, lowest_modes, round_off
from hybrid.linear.loaded_line import LoadedLine, frequencies_of, loaded_lines
from hybrid.linear.matrices import (
    ANCHOR,
    LinearNetwork,
    damping_by_turns,
    in_inertial_axes,
    in_last,
    linear_network,
    rows_at_rest,
    sparse_rows,
)
from hybrid.linear.touching import Rest, rest_of
from hybrid.model.network import NetworkResolution
from hybrid.scene.motion_tables import Motion
from hybrid.scene.root import Scene
from hybrid.simulation.run_sample import END_FORCES, RunSample, Samples

RAW = {shown: raw for raw, shown in END_FORCES.items()}
UNITS = {"position": "m", "tension": "N", "curvature": "1/m", "bending_moment": "N m", **dict.fromkeys(RAW, "N")}

# Lowest modes that are looked at, to a line; of several lines at most so many in all.
MODES, MOST_MODES = 12, 48
# A motion is integrated by Gauss's rule, in at least as many pieces as it has periods of a vibration.
GAUSS = 8  # points of the rule
FEWEST_PIECES = 8  # at least
MOST_PERIODS = 200  # modes with more are left out: a ramp that is so long leaves nothing
# Times at which amplitudes are followed as they die; rate of that, of the velocity of a harmonic and its drag.
DYING, HARMONIC = 60, 4.0 / (3.0 * pi)
# An error by steps that this makes is worth a word where it exceeds what is asked, and the error figure so many times;
# where nothing is asked, this part of the largest value.
TIMES_THE_FIGURE, PART = 1.5, 0.01
ROWS = 20_000  # times at most; of longer runs some of theirs,
BLOCK = 2000  # so many at a time
PLACES = 40  # beside those at which a mode is largest


class Lost(NamedTuple):
    """What steps make of free vibrations in a quantity: its largest error, and the vibration that makes most of it."""

    error: float  # m, N, N m or 1/m
    amplitude: float  # of all of them together, in the same unit
    period: float  # s
    step: float  # s, that leaves an error of a tenth of this


LostBy = Mapping[str, Lost]  # by quantity


def uncertain_by_vibrations(
    found: LostBy, result: RunSample, errors: Mapping[str, float], allowed: Mapping[str, float] | None, length: float
) -> list[tuple[str, str]]:
    """The event that says so where steps lose more of free vibrations than error figures show.

    found: what they lose; errors: figures, by quantity; allowed: errors that are asked, None: nothing is.
    length: m, of the line, which positions are parts of.
    """
    worst, of = 1.0, ""
    for name, lost in found.items():
        values = result.values.get(RAW.get(name, name))
        if name not in errors or values is None or (allowed is not None and name not in allowed):
            continue
        if allowed is None:
            sizes = np.asarray(values)
            sizes = np.linalg.norm(sizes, axis=-1) if name in RAW else sizes
            least = PART * (length if name == "position" else float(np.abs(sizes).max()))
        else:
            least = allowed[name]
        least = max(least, TIMES_THE_FIGURE * errors[name])
        if least > 0.0 and lost.error > worst * least:
            worst, of = lost.error / least, name
    if not of:
        return []
    lost, unit = found[of], UNITS[of]
    steps = np.diff(result.forces[:, 0])
    text = (
        f"{of.replace('end_force_', 'force at the ').replace('_', ' ')}: a free vibration with a period of "
        f"{lost.period:.2g} s is left by the ramp or move of an end, up to {lost.amplitude:.2g} {unit}, which hardly "
        f"anything damps; steps of {float(np.median(steps)):.2g} s make it late or lose it, an error of up to "
        f"{lost.error:.2g} {unit}, which the error figure ({errors[of]:.2g} {unit}) does not see; time.step: "
        f"{lost.step:.2g} shows it, damping ends it, and a longer ramp or move leaves less of it"
    )
    return [("error uncertain", text)]


def lost_by_lines(asked: Any, result: Samples) -> Mapping[str, LostBy]:
    """By line and quantity, the loss of free vibrations by the steps of a result.

    Empty where none is left, or it is not known.
    """
    if any(x.touches for x in result.values()):
        return {}
    finely = NetworkResolution({name: x.resolution for name, x in result.items()})

    return lost_vibrations(asked, lambda: rest_of(asked, finely), next(iter(result.values())).forces[:, 0])


def lost_vibrations(asked: Scene, rest: Callable[[], Rest], times: Floats) -> Mapping[str, LostBy]:
    """By line and quantity, what steps that end at `times` (n,) s make of free vibrations about an equilibrium."""
    motions = asked.motions
    begins = [_quiet_from(x) for x in motions]
    quiet = max((x for x in begins if x is not None), default=0.0)
    fluid = asked.environment.fluid
    still = fluid is None or fluid.waves is None
    rests = still and not (asked.starts_as_placed or asked.may_break)
    if not begins or None in begins or not rests or len(times) < 2:
        return {}
    try:
        found = rest()
    except (ComputationError, SceneError):
        return {}
    if not _is_steady(found):
        return {}
    breaks = sorted({0.0, *(x for motion in motions for x in _breaks(motion) if x < quiet)})
    radius = asked.time.rho_inf if asked.time is not None else 0.5
    return Vibrations(found).lost(breaks, min(quiet, float(times[-1])), np.asarray(times), radius)


def _quiet_from(motion: Motion) -> float | None:
    """When a motion is one of harmonics alone, s; None: never."""
    if motion.file is not None or motion.follow is not None or motion.vessel is not None:
        return None
    return max(_breaks(motion))


def _breaks(motion: Motion) -> tuple[float, ...]:
    """Times, s, at which something in a motion begins or ends."""
    travel = motion.travel
    return (0.0, motion.ramp or 0.0, *(() if travel is None else (travel.begin, travel.begin + travel.over)))


def _is_steady(rest: Rest) -> bool:
    """Whether nothing but motions of ends excites a network, and all that damps it is known."""
    for model in rest.models:
        moves = model.ends.moves()
        towed = moves.velocity.any() and bool(model.line.bits & (DRAG | BODIES))  # the drag of the tow is not known
        loses = model.line.bits & (BENDING_SLIP | SOIL)  # as much as the size of the motion decides
        if model.payout is not None or len(moves.loads) or towed or loses:
            return False
    return not any(x.loads or x.members is not None for x in rest.floats)


class Vibrations:
    """Modes of a network about its equilibrium, of mass 1, and what damps and drives each.

    w: (m,) 1/s; fall: (m,) 1/s, by damping that is linear; drags: quadratic ones; drive: (lines, 2, 6, m) 1, by shifts
    and turns of ends, q'' + w^2 q = -drive u''.
    """

    def __init__(self, rest: Rest) -> None:
        self.rest = rest
        network = linear_network(rest.solver, rest.states, rest.names, sticks=True, touching=rest.touching)
        self.omegas = frequencies_of(rest.models)
        self.lines = loaded_lines(rest, network, self.omegas)
        free = 2 + len(self.lines) + 3 * network.bodies  # that may have no period
        eigen = lowest_modes(network, min(MODES * len(self.lines), MOST_MODES) + free)
        nothing = round_off(network, eigen)
        self.stable = bool((eigen.squares > -nothing).all())
        kept = eigen.squares > nothing
        self.w, self.vectors = np.sqrt(eigen.squares[kept]), eigen.vectors[:, kept]
        whole = np.asarray(network.place @ self.vectors)
        self.parts = [whole[a:b] for a, b in pairwise(network.at)]  # (5 (N+1), m) of each line
        self.fall = 0.5 * np.einsum("qm,qm->m", self.vectors, self._damping(network) @ self.vectors)
        forced = list(self._forced(network))
        self.drags = [drag for each in zip(self.lines, self.parts, forced, strict=True) for drag in _drags(*each)]
        ends = [model.ends.moves().prescribed for model in rest.models]
        self.drive = np.array([self._driven(*each) for each in zip(self.lines, ends, self.parts, strict=True)])

    def _damping(self, network: LinearNetwork) -> sparse.csr_array:
        """(q, q) of sections, the bed, a current, and bodies."""
        blocks = []
        for x in self.lines:
            still, moving = np.zeros((2, x.line.s.size, SIZE * WIDTH))
            rows_at_rest(x.line, x.x, x.x.ends, x.linear.state, (0.0, ANCHOR), still)
            rows_at_rest(x.line, x.x, x.x.ends, x.linear.state, (1.0, ANCHOR), moving)
            blocks.append(sparse_rows(moving - still))
        found = network.place.T @ sparse.block_diag(blocks, format="csr") @ network.place
        found = found + network.whole.T @ network.touching.damping @ network.whole
        found = found + damping_by_turns(self.rest.solver, network)
        own = in_inertial_axes(self.rest.solver, self.rest.states, DAMPING)
        return sparse.csr_array(found + in_last(network.size, own))

    def _forced(self, network: LinearNetwork) -> Iterator[Floats]:
        """Velocities (F, N+1, 3) m/s of each line, as it follows the harmonics of ends at rest, complex amplitudes."""
        every = np.arange(self.omegas.size)
        loads = [x.loads(every, 0.0 * x.linear.mass) for x in self.lines] if every.size else []
        whole = np.zeros((int(network.at[-1]), every.size), complex)
        if loads:
            right = network.place.T @ np.concatenate(loads)
            shift = BELOW * network.slow  # what nothing holds stays
            factors = splu(sparse.csc_array(network.stiffness + shift * network.mass))
            whole = network.place @ (factors.solve(right.real) + 1j * factors.solve(right.imag))
        for x, a, b in zip(self.lines, network.at[:-1], network.at[1:], strict=True):
            moved = np.moveaxis(whole[a:b].reshape((b - a) // SIZE, SIZE, every.size)[:, 1:4], 2, 0)
            for excited, each in zip(x.excited, moved, strict=True):
                each[[0, -1]] += excited.shifts
            yield self.omegas[:, None, None] * moved

    def _driven(self, x: LoadedLine, moved: np.ndarray, part: Floats) -> Floats:
        """(2, 6, m) by unit shifts (inertial) and turns of the ends of a line; moved: (2, 2) which are given."""
        out = np.zeros((2, 6, self.w.size))
        for k in (0, 1):
            if moved[k, 0]:
                out[k, :3] = -self._pull(x, k, part) / self.w**2
            if moved[k, 1] and x.line.element[-k]:
                out[k, 3:] = -(x.turned[k] @ part) / self.w**2
        return out

    def lost(self, breaks: list[float], quiet: float, times: Floats, radius: float) -> Mapping[str, LostBy]:
        """By line and quantity, the loss of free vibrations in steps that end at `times`, s.

        breaks: s, at which something in a motion begins or ends before it is quiet; radius: of the time scheme.
        """
        duration = float(times[-1])
        fits = self.w * quiet <= 2.0 * pi * MOST_PERIODS
        if not (self.stable and fits.any()):
            return {}
        size = np.where(fits, self._amplitudes(breaks, quiet, duration, fits), 0.0)
        t = np.concatenate([[0.0], times])
        t = t[np.concatenate([[True], np.diff(t) > 0.0])]
        factors = Factors(radius)
        drift, t = factors.drift(self.w, t)
        made = int(np.searchsorted(t, 0.5 * quiet))  # on average
        wrong = np.abs(1.0 - np.exp(drift - drift[made])) * self._dying(size, np.maximum(t - t[made], 0.0))
        wrong = wrong[t >= min(quiet, 0.5 * duration)]
        found: dict[str, dict[str, Lost]] = {}
        for x, part in zip(self.lines, self.parts, strict=True):
            of_line = found.setdefault(x.name, {})
            for name, shapes in self._outputs(x, part):
                each = np.abs(shapes) if shapes.ndim == 2 else np.linalg.norm(shapes, axis=1)  # (places, m)
                each = each[_places(each)]
                errors = np.sqrt((wrong**2) @ (each**2).T)  # (times, places)
                error, whole = float(errors.max()), float(np.sqrt(((size * each) ** 2).sum(axis=1)).max())
                row, place = np.unravel_index(int(errors.argmax()), errors.shape)
                k = int((wrong[row] * each[place]).argmax())
                of_line[name] = Lost(error, whole, 2.0 * pi / self.w[k], factors.step(self.w[k], duration))
        return found

    def _dying(self, size: Floats, t: Floats) -> Floats:
        """Amplitudes (t, m) of vibrations of a size (m,) at t = 0, at times (s) that increase."""
        last = max(float(t[-1]), 1e-300)
        at = np.concatenate([[0.0], np.geomspace(1e-4 * last, last, DYING)])
        now, found = size, [size]
        for dt in np.diff(at):
            rate = np.zeros(self.w.size)
            for drag, square, forced in self.drags:
                rate += (drag * np.sqrt(square @ (self.w * now) ** 2 + forced)) @ square
            now = now * np.exp(-self.fall * dt) / (1.0 + HARMONIC * rate * dt)  # of one vibration alone: exact
            found.append(now)
        return np.stack([np.interp(t, at, x) for x in np.transpose(found)], axis=1)

    def _outputs(self, x: LoadedLine, part: Floats) -> Iterator[tuple[str, Floats]]:
        """What a unit of each mode is in outputs of a line, (places, m) or (places, 3, m)."""
        count, line = self.w.size, x.line
        moved = np.moveaxis(part.reshape(-1, SIZE, count), 2, 0)
        found = x.response_to(moved, x.turned_with(self.vectors.T, np.zeros((count, 2, 3))), self.w)
        yield "position", np.moveaxis(found.position, 0, 2)
        yield "tension", found.tension.T
        if line.element.any():
            bent = np.stack([found.curvature, found.curvature_across], axis=1) * (line.element != 0)
            yield "curvature", np.moveaxis(bent, 0, 2).transpose(1, 0, 2)
            rigidity = np.where(line.element != 0, line.kb[:, :2].max(axis=1) * line.hn, 0.0)
            yield "bending_moment", np.moveaxis(bent * rigidity, 0, 2).transpose(1, 0, 2)
        for k, name in enumerate(("end_force_start", "end_force_end")):
            yield name, self._pull(x, k, part)[None]

    def _pull(self, x: LoadedLine, k: int, part: Floats) -> Floats:
        """(3, m) N, of each mode on end k of a line: where an end is held, columns alone have it."""
        first = k * SIZE * (x.line.s.size - 1) + 1
        K, M = x.linear.stiffness[:, first : first + 3], x.linear.mass[:, first : first + 3]
        return np.asarray(K.T @ part - (M.T @ part) * self.w**2)

    def _amplitudes(self, breaks: list[float], quiet: float, duration: float, fits: np.ndarray) -> Floats:
        """Of the free vibrations that are there once ends move as harmonics alone, (m,), by modes of mass 1.

        q'' + w^2 q = -drive u'': integral of u'' exp(-i w t) until then, less what harmonics go on to add.
        """
        w = self.w
        t, weights = _gauss(breaks, quiet, float(w[fits].max()))
        waves = np.exp(-1j * np.outer(t, w))
        total = np.zeros(w.size, complex)
        for x, model, drive in zip(self.lines, self.rest.models, self.drive, strict=True):
            if not drive.any():
                continue
            rates = np.zeros((t.size, 2, 6))
            for each, now in zip(rates, t.tolist(), strict=True):
                each[:, 3:], each[:, :3] = model.ends.at_time(now).spin, model.ends.velocity
            model.ends.at_time(np.inf)
            inside = np.einsum("tkc,kcm->tm", rates, drive) * waves
            total += inside[-1] + 1j * w * (weights @ inside[:-1])
            if quiet >= duration:
                continue
            for o, excited in zip(self.omegas, x.excited, strict=True):
                unit = np.einsum("kc,kcm->m", np.hstack([excited.shifts, excited.turns]), drive)
                total -= _harmonic_until(quiet, o, w, unit, duration)
        return np.asarray(np.abs(total) / w)


def _harmonic_until(quiet: float, o: float, w: Floats, unit: Floats, duration: float) -> Floats:
    """Integral until `quiet` (s) of  u'' exp(-i w t)  for  u = Re(unit exp(-i o t))  that has grown slowly, (m,).

    duration: s, of the motion, in which frequencies count as at least 1 rad apart: resonance grows no longer.
    """
    near = np.where(o < w, -1.0, 1.0) * np.maximum(np.abs(o - w), 1.0 / duration)
    up = unit.conj() * np.exp(1j * near * quiet) / (1j * near)
    down = unit * np.exp(-1j * (o + w) * quiet) / (-1j * (o + w))
    return np.asarray(-o * o / 2.0 * (up + down))


def _drags(x: LoadedLine, part: Floats, forced: Floats) -> Iterator[tuple[Floats, Floats, Floats]]:
    """Drag across and along half cells, and of bodies, with squares of modes and velocities.

    N s^2/m^2 (n,); of modes (n, m), m^2, and of forced velocities (n,), m^2/s^2; forced: (F, N+1, 3) m/s.
    """
    shift, d = part.reshape(-1, SIZE, part.shape[1])[:, 1:4], x.d[:, None]
    modes, moves = np.moveaxis(shift, 2, 1)[x.node], np.moveaxis(forced, 0, 1)[x.node]  # (half cells, .., 3)
    squares = [(np.abs(u) ** 2).sum(axis=2) for u in (modes, moves)]
    along = [np.abs((u * d).sum(axis=2)) ** 2 for u in (modes, moves)]
    for drag, (square, velocity) in (
        (x.cn, [every - one for every, one in zip(squares, along, strict=True)]),
        (x.ct, along),
        (x.point_drag, [(np.abs(u) ** 2).sum(axis=2) for u in (np.moveaxis(shift, 2, 1), np.moveaxis(forced, 0, 1))]),
    ):
        if drag.any():
            yield drag, np.maximum(square, 0.0), np.maximum(velocity.sum(axis=1), 0.0)


def _places(each: Floats) -> Floats:
    """Rows of shapes (places, m) that are looked at."""
    even = np.linspace(0, len(each) - 1, min(PLACES, len(each))).round().astype(int)
    return np.unique(np.concatenate([even, each.argmax(axis=0)]))


def _gauss(breaks: list[float], quiet: float, w: float) -> tuple[Floats, Floats]:
    """Times until `quiet`, s, and their weights in an integral over motions and vibrations of up to w; and `quiet`."""
    x, each = np.polynomial.legendre.leggauss(GAUSS)
    times, weights = [np.zeros(0)], [np.zeros(0)]
    for a, b in pairwise([x for x in breaks if x < quiet] + [quiet]):
        ends = np.linspace(a, b, max(FEWEST_PIECES, int(w * (b - a) / pi)) + 1)
        half = 0.5 * (ends[1] - ends[0])
        times.append((ends[:-1, None] + half * (1.0 + x)).ravel())
        weights.append(np.tile(half * each, ends.size - 1))
    return np.concatenate([*times, [quiet]]), np.concatenate(weights)


@cache
def _factors(radius: float) -> tuple[Floats, Floats]:
    """Angles of a step, rad, and the logs of factors at them, of a spectral radius."""
    at = np.geomspace(1e-3, 1e3, 600)  # rad to a step
    am, af = (2.0 * radius - 1.0) / (radius + 1.0), radius / (radius + 1.0)
    ga = 0.5 - am + af
    be = 0.25 * (1.0 - am + af) ** 2
    w2 = at**2
    below = (1.0 - am) + w2 * (1.0 - af) * be
    new = np.stack([-w2, -w2 * (1.0 - af), -am - w2 * (1.0 - af) * (0.5 - be)], axis=-1) / below[:, None]
    one = np.ones_like(w2)
    rows = [np.stack(x, axis=-1) for x in ((one, one, (0.5 - be) * one), (0 * one, one, (1.0 - ga) * one))]
    matrix = np.stack([rows[0] + be * new, rows[1] + ga * new, new], axis=1)
    roots = np.linalg.eigvals(matrix)
    root = roots[np.arange(w2.size), roots.imag.argmax(axis=1)]
    return at, np.log(np.abs(root)) + 1j * (np.abs(np.angle(root)) - at)


class Factors:
    """By what generalized-alpha multiplies a free vibration in a step, over what the vibration itself does: its log."""

    def __init__(self, radius: float) -> None:
        self._at, self._log = _factors(radius)

    def of(self, angle: Floats) -> Floats:
        """Of steps of so many radians; of short ones as their cube."""
        inside, cube = np.maximum(angle, self._at[0]), np.minimum(angle / self._at[0], 1.0) ** 3
        return np.asarray(np.interp(inside, self._at, self._log) * cube)

    def drift(self, w: Floats, t: Floats) -> tuple[Floats, Floats]:
        """(times, m) since the start, and these times, s: of all steps, or of so many as fit into memory."""
        every = -(-len(t) // ROWS)
        parts, now = [np.zeros((1, w.size), complex)], np.zeros(w.size, complex)
        for a in range(0, len(t) - 1, every * BLOCK):
            steps = self.of(np.outer(np.diff(t[a : a + every * BLOCK + 1]), w))
            sums = now + np.cumsum(np.add.reduceat(steps, np.arange(0, len(steps), every)), axis=0)
            parts, now = [*parts, sums], sums[-1]
        return np.vstack(parts), np.append(t[:-1:every], t[-1])

    def step(self, w: float, duration: float) -> float:
        """The step, s, that leaves a tenth of the vibration wrong at the end."""
        angle = np.geomspace(1e-3, 1.0, 200)
        fits = np.abs(1.0 - np.exp(self.of(angle) * (w * duration / angle))) <= 0.1
        return float(angle[fits].max(initial=angle[0]) / w)
