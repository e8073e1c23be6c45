"""Free vibrations that ramps and moves of ends leave: what steps make of them at most, and where it is worth a word.

Of a line under water that is at most so much, whatever its modes are:

    symbol   meaning                                                                       unit
    u        motion of the ends                                                            m
    U        |integral of u'' exp(-i w t)|/w, what it leaves of a vibration of frequency w m
    b        drag over mass, rho Cn D/(2 (m + m_a)), the least along the line              1/m
    v        mean speed of the line as it is forced                                        m/s
    a        amplitude, at first U; da/dt = -4/(3 pi) b (v/2 + 0.85 w a) a                 m

Half of the drag that the forced motion makes counts, and of that of its own motion that of a half wave: 0.85 is the
integral of its cube over that of its square.  The vibration shifts the line by a and pulls at an end by m L w^2 a/3, as
a string does of which one end is shifted; its waves are no shorter than those of a beam, (w (m/EI)^1/2)^-1/2, and those
of a string under the least tension, (m w^2/T)^-1/2.  What vibrates along the line has no such drag, and is no slower
than a bar that is held at one end.  docs/errors.md
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from itertools import pairwise
from math import pi
from typing import Any, NamedTuple

import numpy as np

from hybrid.kernels.state.state import Floats
from hybrid.model.plan import output_times
from hybrid.model.resolution import strain_travel
from hybrid.scene.attachments import Float, Weight
from hybrid.scene.motion_tables import SHIFTS, TURNS, Motion
from hybrid.scene.points import FixedPoint
from hybrid.scene.root import Scene
from hybrid.scene.schema import LineScene
from hybrid.simulation.run_sample import END_FORCES, RunSample

RAW = {shown: raw for raw, shown in END_FORCES.items()}
UNITS = {
    "position": "m", "tension": "N", "curvature": "1/m", "bending_moment": "N m", **dict.fromkeys(RAW, "N"),
}  # fmt: skip

# A motion is integrated by Gauss's rule, in at least as many pieces as it has periods of a vibration.
GAUSS = 8  # points of the rule
FEWEST_PIECES = 8  # at least
MOST_PERIODS = 200  # modes with more are left out: a ramp that is so long leaves nothing
# Frequencies of a motion and of a vibration count as different by at least so many rad in the duration.
CLOSE = 1.0
# An error by steps that this makes is worth a word where it exceeds what is asked, and the error figure so many times;
# where nothing is asked, this part of the largest value.
TIMES_THE_FIGURE, PART = 1.5, 0.01
ROWS = 20_000  # times at most; of longer runs some of theirs,
BLOCK = 2000  # so many at a time
# Frequencies at which a bound is looked at, beside those of the motion.
# They go up to so many periods in its ramps: beyond, less and less is left.
FREQUENCIES, PERIODS = 24, 25
# Part of a line that has to be under water throughout.
WET = 0.9
# Velocity of a harmonic and its drag, also in linear.response_results.
HARMONIC = 4.0 / (3.0 * pi)
OF_HALF_WAVE, OF_FORCED = 0.85, 0.5
# Of the mass of a string the part that the shift of one end moves.
OF_MASS = 1.0 / 3.0


class Lost(NamedTuple):
    """What steps make of free vibrations in a quantity: its largest error, and the vibration that makes most of it."""

    error: float  # m, N, N m or 1/m
    amplitude: float  # of all of them together, in the same unit
    period: float  # s
    step: float  # s, that leaves an error of a tenth of this


LostBy = Mapping[str, Lost]  # by quantity


def uncertain_by_vibrations(
    most: Mapping[str, float] | None, find: Callable[[], LostBy], result: RunSample, errors: Mapping[str, float],
    allowed: Mapping[str, float] | None,
) -> list[tuple[str, str]]:  # fmt: skip
    """The event that says so where steps lose more of free vibrations than error figures show.

    most: what they lose at most, None: not known; find: gives what they lose; errors: figures, by quantity; allowed:
    errors that are asked, None: nothing is.
    """
    least = _worth_a_word(result, errors, allowed)
    if most is not None and all(most.get(name, 0.0) <= x for name, x in least.items()):
        return []
    found = find()
    over = {name: found[name].error / x for name, x in least.items() if name in found}
    of = max(over, key=lambda name: over[name], default="")
    if not (of and over[of] > 1.0):
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


def _worth_a_word(
    result: RunSample, errors: Mapping[str, float], allowed: Mapping[str, float] | None
) -> dict[str, float]:
    """Errors by quantity beyond which they are said; arguments as of `uncertain_by_vibrations`."""
    found = {}
    for name in errors:
        values = result.values.get(RAW.get(name, name))
        if name not in UNITS or values is None or (allowed is not None and name not in allowed):
            continue
        if allowed is None:
            sizes = np.asarray(values)
            sizes = np.linalg.norm(sizes, axis=-1) if name == "position" or name in RAW else sizes
            least = PART * float(np.abs(sizes).max())
        else:
            least = allowed[name]
        found[name] = max(least, TIMES_THE_FIGURE * errors[name])
    return {name: x for name, x in found.items() if x > 0.0}


def most_lost(asked: Scene, line: LineScene, result: RunSample) -> dict[str, float] | None:
    """Errors by quantity that steps make of free vibrations of a line at most; None: its modes have to tell.

    So they have of lines above the water or without drag, of stretches that carry modules, of lines that are joined to
    what is free, and of those whose ends turn or are towed.
    """
    fluid, sections, carried = asked.environment.fluid, line.cable.sections, line.cable.attachments
    held = not asked.bodies and all(isinstance(x, FixedPoint) for x in asked.points.values())
    turned = any(quiet_from(x) is None or x.velocity or {*x.harmonics()} & {*TURNS} for x in asked.motions)
    if fluid is None or fluid.waves or not held or turned or len(result.forces) < 2:
        return None
    highest = np.asarray(result.values["position"])[..., 2].max(axis=0)
    wet = float(np.mean(highest < (np.inf if fluid.surface is None else fluid.surface)))
    if wet < WET or not all(isinstance(x, Float | Weight) for x in carried):
        return None
    wide = [fluid.density * (x.diameter or 0.0) for x in sections]
    added = [0.25 * pi * (x.diameter or 0.0) * (x.added_mass.normal if x.added_mass else 0.0) for x in sections]
    masses = [x.mass + a * d for x, a, d in zip(sections, added, wide, strict=True)]
    drags = [0.5 * (x.drag.normal if x.drag else 0.0) * d / m for x, d, m in zip(sections, wide, masses, strict=True)]
    hung = [
        (0.5 * fluid.density * x.drag_area, x.mass + x.added_mass) for x in carried if isinstance(x, Float | Weight)
    ]
    b = wet * min([*drags, *(drag / mass for drag, mass in hung if mass > 0.0)])
    if not b > 0.0:
        return None
    heavy = sum(m * x.length for m, x in zip(masses, sections, strict=True)) + sum(mass for _, mass in hung)
    w, across, along = _wrong_at_most(asked, result, b, line)
    every = np.maximum(across, along)
    found = {"position": float(every.max())}
    found |= dict.fromkeys(("tension", *RAW), OF_MASS * heavy * float((every * w * w).max()))
    rigid, T = [x.weakest_bending for x in sections if x.weakest_bending], np.asarray(result.values["tension"]).min()
    if rigid:
        waves = w * np.sqrt(max(masses) / min(rigid))
        waves = np.minimum(waves, max(masses) * w * w / T) if T > 0.0 else waves
        found["curvature"] = float((across * waves).max())
        found["bending_moment"] = max(rigid) * found["curvature"]
    return found


def _wrong_at_most(asked: Scene, result: RunSample, b: float, line: LineScene) -> tuple[Floats, Floats, Floats]:
    """Frequencies (F,) 1/s, and what steps make wrong of vibrations across and along a line (F,) m; b: 1/m."""
    motions, times = asked.motions, result.forces[:, 0]
    duration, travel = float(times[-1]), strain_travel(line.cable)
    quiet = min(max((quiet_from(x) or 0.0 for x in motions), default=0.0), duration)
    own = [2.0 * pi / h.period for x in motions for listed in x.harmonics().values() for h in listed]
    w = np.unique([*np.geomspace(pi / duration, 2.0 * pi * PERIODS / max(quiet, times[0]), FREQUENCIES), *own])
    left = sum((_left_by(x, quiet, duration, w) for x in motions), np.zeros(w.size))
    size = sum(sum(h.amplitude for listed in x.harmonics().values() for h in listed) for x in motions)
    size += sum(float(np.linalg.norm(x.travel.by)) for x in motions if x.travel is not None)
    left = left * max(1.0, result.reach.moved / max(size, 1e-300))
    t = np.concatenate([[0.0], times])
    t = t[np.concatenate([[True], np.diff(t) > 0.0])]
    drift, t = Factors(asked.time.rho_inf if asked.time is not None else 0.5).drift(w, t)
    made = int(np.searchsorted(t, 0.5 * quiet))
    after = t >= min(quiet, 0.5 * duration)
    late = np.abs(1.0 - np.exp(drift - drift[made]))[after]
    late[:, -1] = np.maximum(late[:, -1], 1.0)  # as of those beyond
    rate = HARMONIC * b * max(OF_FORCED * _mean_speed(line, result), 1e-300)  # 1/s
    since = np.maximum(t[after] - t[made], 0.0)[:, None]
    own = -np.expm1(-rate * since) / rate * HARMONIC * b * OF_HALF_WAVE * w * left
    bar = np.inf if travel is None else 0.5 * pi / travel
    across = late * left * np.exp(-rate * since) / (1.0 + own)
    return w, across.max(axis=0), late.max(axis=0) * left * (w >= bar)


def _mean_speed(line: LineScene, result: RunSample) -> float:
    """The mean speed of a line between its outputs, m/s, which is no more than that between steps."""
    position, t = np.asarray(result.values["position"]), np.array([0.0, *output_times(line)])
    return float((np.linalg.norm(np.diff(position, axis=0), axis=-1) / np.diff(t)[:, None]).mean())


def _left_by(motion: Motion, quiet: float, duration: float, w: Floats) -> Floats:
    """U (F,) m of a motion by shifts, once it is one of harmonics alone; w: (F,) 1/s."""
    t, weights = gauss([x for x in breaks_of(motion) if x < quiet], quiet, float(w.max()))
    velocity, ended = np.zeros((t.size, 3)), np.zeros((3, w.size), complex)
    grown, growing = _smooth_step(t, 0.0, motion.ramp or 0.0)
    for name, listed in motion.harmonics().items():
        for h in listed:
            k, o, phase = SHIFTS.index(name), 2.0 * pi / h.period, np.radians(h.phase)
            velocity[:, k] += h.amplitude * (growing * np.sin(o * t + phase) + grown * o * np.cos(o * t + phase))
            if quiet < duration:
                ended[k] += harmonic_until(quiet, o, w, 1j * h.amplitude * np.exp(-1j * phase), duration)
    if motion.travel is not None:
        velocity += np.outer(_smooth_step(t, motion.travel.begin, motion.travel.over)[1], motion.travel.by)
    inside = np.exp(-1j * np.outer(w, t)) @ (velocity * np.append(weights, 0.0)[:, None])
    last = np.outer(np.exp(-1j * w * quiet), velocity[-1])
    return np.asarray(np.linalg.norm(last + 1j * w[:, None] * inside - ended.T, axis=1) / w)


def _smooth_step(t: Floats, begin: float, over: float) -> tuple[Floats, Floats]:
    """`scene.motion_tables.smooth_step` at times (n,) s of what lasts so long, and its rate (n,) 1/s."""
    if not over:
        return np.ones(t.size), np.zeros(t.size)
    x = np.clip((t - begin) / over, 0.0, 1.0)
    return x**3 * (10.0 + x * (6.0 * x - 15.0)), 30.0 * x**2 * (1.0 - x) ** 2 / over


def quiet_from(motion: Motion) -> float | None:
    """When a motion is one of harmonics alone, s; None: never."""
    if motion.file is not None or motion.follow is not None or motion.vessel is not None:
        return None
    return max(breaks_of(motion))


def breaks_of(motion: Motion) -> tuple[float, ...]:
    """Times, s, at which something in a motion begins or ends."""
    travel = motion.travel
    return (0.0, motion.ramp or 0.0, *(() if travel is None else (travel.begin, travel.begin + travel.over)))


def harmonic_until(quiet: float, o: float, w: Floats, unit: Any, duration: float) -> Floats:
    """Integral until `quiet` (s) of  u'' exp(-i w t)  for  u = Re(unit exp(-i o t))  that has grown slowly, (m,)."""
    near = np.where(o < w, -1.0, 1.0) * np.maximum(np.abs(o - w), CLOSE / duration)
    up = unit.conj() * np.exp(1j * near * quiet) / (1j * near)
    down = unit * np.exp(-1j * (o + w) * quiet) / (-1j * (o + w))
    return np.asarray(-o * o / 2.0 * (up + down))


def gauss(breaks: list[float], quiet: float, w: float) -> tuple[Floats, Floats]:
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
