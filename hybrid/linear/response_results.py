"""What a response by frequency has found, and the drag that it rests on.

Drag that stands for the quadratic one in a Gaussian motion: the mean of its derivative (docs/theory.md, 21).

For f = c |u| u of a velocity u = U + x with x normal and of covariance S,  E[df/du] = c E[|u| 1 + u u^T/|u|];
it is the linear law that leaves least in the mean square.  A sum of few harmonics is not normal: its law, the best in
the same sense, is  E[f x^T] E[x x^T]^-1  over their phases; of a single one it has the same first harmonic.

Of each line there are amplitudes, deviations, spectra, extremes and fatigue.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.state.state import Floats
from hybrid.statistics.fatigue import Curve, curve_of, damage, dirlik_damage

# Rules of integration for the normal distribution.
ANGLES = 40  # directions in a plane
RADII = 4  # a quarter of the radii in a plane
POINTS = 10  # on each axis in space
# Standard deviations beyond which a normal velocity is its mean.
FAR = 30.0
# Values and weights of a normal law that show the kink of drag; standard deviations from which on the size of a bend is
# its part in the plane of the bend at rest.
LAW = np.linspace(-6.0, 6.0, 121)
LAW_PARTS = np.exp(-0.5 * LAW**2) / np.exp(-0.5 * LAW**2).sum()  # weights, of sum 1
BENT = 8.0  # standard deviations
FEW = 10  # frequencies up to which a sum is no normal process
MULTIPLES = 40  # highest harmonic of one frequency up to which a sum is sampled over its period
MULTIPLE = 1e-6  # part within which a frequency is such a harmonic
PHASES = 128  # samples of a period, at least,
OF_HIGHEST = 8  # and of a period of its highest harmonic
DRIFTING = 512  # samples of the phases of frequencies that drift apart
STILL = 1e-8  # part of the largest mean square below which a direction counts as one without motion


@cache
def _rule(m: int) -> tuple[Floats, Floats]:
    """Points (G, m) and weights (G,) of the normal distribution: polar in a plane, since |u| has a kink at 0."""
    if m == 2:
        x, w = np.polynomial.legendre.leggauss(4 * RADII)
        radius, part = 3.5 * (1.0 + x), w * 3.5  # 0 to 7 standard deviations
        part = part * radius * np.exp(-0.5 * radius**2)
        angle = 2.0 * np.pi * (np.arange(ANGLES) + 0.5) / ANGLES
        grid = radius[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        weights = np.repeat(part / part.sum() / ANGLES, ANGLES)
        return grid.reshape(-1, 2), weights
    x, w = np.polynomial.hermite_e.hermegauss(POINTS)
    grid = np.stack(np.meshgrid(*[x] * m, indexing="ij"), axis=-1).reshape(-1, m)
    weights = np.ones(1)
    for _ in range(m):
        weights = np.outer(weights, w / w.sum()).ravel()
    return grid, weights


def across(mean: Floats, covariance: Floats) -> Floats:
    """E[|u| 1 + u u^T/|u|] (n, m, m) for mean velocities (n, m) and covariances (n, m, m); m = 2 or 3."""
    m = mean.shape[1]
    sizes, axes = np.linalg.eigh(covariance)
    root = axes * np.sqrt(np.maximum(sizes, 0.0))[:, None, :]
    grid, weights = _rule(m)
    if m == 2 and not mean.any():  # each direction counts by the mean radius
        grid = math.sqrt(0.5 * np.pi) * grid[:ANGLES] / np.linalg.norm(grid[0])
        weights = np.full(ANGLES, 1.0 / ANGLES)
    u = mean[:, None, :] + np.matmul(grid, root.transpose(0, 2, 1))
    speed = np.linalg.norm(u, axis=2)
    scaled = u * np.sqrt(weights / np.maximum(speed, 1e-300))[:, :, None]
    B = np.matmul(scaled.transpose(0, 2, 1), scaled)
    B[:, range(m), range(m)] += (speed @ weights)[:, None]
    return np.asarray(B)


def along(mean: Floats, deviation: Floats) -> Floats:
    """2 E|u| (n,) for one component."""
    from scipy.special import erf

    s = np.maximum(deviation, 1e-30)
    ratio = np.clip(mean / s, -FAR, FAR)
    gauss = s * math.sqrt(2.0 / math.pi) * np.exp(-0.5 * ratio**2)
    return np.asarray(2.0 * (gauss + mean * erf(ratio / math.sqrt(2.0))))


Phases = NDArray[np.complex128]


def phases_of(omegas: Floats) -> Phases | None:
    """exp(-i phase) (P, F) at which a sum of frequencies (F,), increasing, is seen; None: many, a normal process.

    Multiples of the lowest keep to each other: over its period.  Of others, few, all phases are as likely.
    """
    multiples = np.rint(omegas / omegas[0])
    if multiples[-1] <= MULTIPLES and np.abs(omegas / omegas[0] - multiples).max() < MULTIPLE:
        count = max(PHASES, OF_HIGHEST * int(multiples[-1]))
        return np.asarray(np.exp(-2j * np.pi * np.outer((np.arange(count) + 0.5) / count, multiples)))
    if omegas.size > FEW:
        return None
    ratio = 2.0  # powers of the root of x^(F+1) = x + 1 fill a cube evenly
    for _ in range(50):
        ratio = (1.0 + ratio) ** (1.0 / (omegas.size + 1))
    part = np.outer(np.arange(DRIFTING) + 0.5, ratio ** -np.arange(1.0, omegas.size + 1))
    found = np.exp(-2j * np.pi * part)
    return np.concatenate([found, -found])  # as far to one side as to the other


def of_few(mean: Floats, amplitudes: Floats, phases: Phases) -> Floats:
    """The law (n, m, m) of few harmonics about mean velocities (n, m), of complex amplitudes (F, n, m); m = 1, 2 or 3.

    phases: (P, F).  In directions without motion, E[df/du].
    """
    count, (n, m) = len(phases), mean.shape
    x = (phases @ amplitudes.reshape(-1, n * m)).real.reshape(count, n, m).transpose(1, 0, 2)
    u = mean[:, None, :] + x
    speed = np.linalg.norm(u, axis=2)
    covariance = np.einsum("npi,npj->nij", x, x) / count
    inverse = np.linalg.pinv(covariance, rcond=STILL, hermitian=True)
    B = np.einsum("np,npi,npj->nij", speed, u, x) / count @ inverse
    scaled = u / np.sqrt(np.maximum(speed, 1e-300))[:, :, None]
    mean_slope = np.einsum("npi,npj->nij", scaled, scaled) / count
    mean_slope += speed.mean(axis=1)[:, None, None] * np.eye(m)
    return np.asarray(B + mean_slope @ (np.eye(m) - covariance @ inverse))


def linear_law(mean: Floats, u: Floats, phases: Phases | None) -> Floats:
    """The law (n, m, m) by mean velocities (n, m) and amplitudes (F, n, m); m = 2 or 3; phases: of few frequencies."""
    if phases is not None:
        return of_few(mean, u, phases)
    return across(mean, covariance_of(u))


def covariance_of(u: Floats) -> Floats:
    """(n, m, m) of amplitudes (F, n, m)."""
    parts = np.concatenate([u.real, u.imag]).transpose(1, 2, 0)
    return np.asarray(0.5 * parts @ parts.transpose(0, 2, 1))


def axes_across(d: Floats) -> Floats:
    """Two axes (H, 2, 3) across each direction (H, 3)."""
    first = np.cross(d, np.eye(3)[np.abs(d).argmin(axis=1)])
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(d, first)], axis=1)


def of_cylinders(
    d: Floats, axes: Floats, drag: tuple[Floats, Floats], current: Floats, u: Floats, phases: Phases | None
) -> Floats:
    """Linear drag (H, 3, 3) N s/m of cylinders along d (H, 3) in moving water.

    axes: (H, 2, 3) across; current: mean relative velocity (H, 3) m/s, u: its amplitudes (F, H, 3); drag: across and
    along, (H,) N s^2/m^2; phases: (P, F) of few frequencies.
    """
    un, ut = (u.transpose(1, 0, 2) @ axes.transpose(0, 2, 1)).transpose(1, 0, 2), (u * d).sum(axis=2)
    mean, forth = np.einsum("hi,hmi->hm", current, axes), np.einsum("hi,hi->h", current, d)
    B = axes.transpose(0, 2, 1) @ linear_law(mean, un, phases) @ axes * drag[0][:, None, None]
    if phases is not None:
        t = of_few(forth[:, None], ut[:, :, None], phases)[:, 0, 0]
    else:
        t = along(forth, np.sqrt(0.5 * (np.abs(ut) ** 2).sum(axis=0)))
    return B + (drag[1] * t)[:, None, None] * d[:, :, None] * d[:, None, :]


def size_deviation(mean: Floats, covariance: Floats) -> Floats:
    """Standard deviation (n,) of the size of a normal vector in a plane, of mean (n,) along the first axis."""
    sizes, axes = np.linalg.eigh(covariance)
    root = axes * np.sqrt(np.maximum(sizes, 0.0))[:, None, :]
    grid, weights = _rule(2)
    u = np.matmul(grid, root.transpose(0, 2, 1))
    u[:, :, 0] += mean[:, None]
    size = np.linalg.norm(u, axis=2)
    first = size @ weights
    return np.sqrt(np.maximum(((size - first[:, None]) ** 2) @ weights, 0.0))


def shape_of_drag(mean: Floats, deviation: Floats, left_out: Floats, flow: Floats) -> Floats:
    """Parts (n,) by which the law of drag changes the standard deviation of the size of a vector in a plane, (n,).

    mean: along the first axis; deviation: (2, n) along both; flow: mean velocity of the water along the first axis, in
    its standard deviations.  The first component has the shape of z + a (f - E f - E[df/dz] z) of a normal z, with the
    drag f = |flow + z| (flow + z) and an a by which the rest of f adds a part left_out to the deviation.
    """
    out = np.zeros(len(mean))
    (used,) = np.nonzero((mean < BENT * deviation[0]) & (left_out > 0.0))
    if not used.size:
        return out
    speed = np.clip(flow[used], -FAR, FAR)[:, None] + LAW
    force, slope = speed * np.abs(speed), 2.0 * (np.abs(speed) @ LAW_PARTS)
    rest = force - (force @ LAW_PARTS)[:, None] - slope[:, None] * LAW
    size = np.sqrt(rest**2 @ LAW_PARTS)
    part = np.minimum(np.sqrt((1.0 + left_out[used]) ** 2 - 1.0), size / slope)
    x = LAW + rest * (part / np.maximum(size, 1e-300))[:, None]
    x /= np.sqrt(x**2 @ LAW_PARTS)[:, None]
    y, weights = np.polynomial.hermite_e.hermegauss(7)
    y, weights = (deviation[1, used, None, None] * y) ** 2, weights / weights.sum()

    def spread(x: Floats) -> Floats:
        square = (mean[used, None] + deviation[0, used, None] * x)[:, :, None] ** 2 + y
        first = np.sqrt(square) @ weights @ LAW_PARTS
        return np.sqrt(np.maximum(square @ weights @ LAW_PARTS - first**2, 0.0))

    out[used] = spread(x) / spread(np.broadcast_to(LAW, x.shape)) - 1.0
    return out


HOURS = 3.0  # h: the usual sea state, for which extremes and damage are given unless asked otherwise
# Part of the largest deviation along a line from which one is known: below it what goes with the square of the motion,
# which is left out, may be several times as much.
OF_LARGEST = 0.2
# Parts that what is left out may add to a deviation: half to three quarters of that come true, which is 3 % here
# (bench/test_bench_response.py).
ADDED = {"tension": 0.045, "curvature": 0.055}
COUNTED = 50  # longest periods in which cycles of few frequencies are counted
PER_PERIOD = 32  # samples of the shortest period that counts
SMALL = 1e-5  # part of the power below which a frequency does not count
VARIES = ("position", "tension", "curvature", "curvature_across")
ALONE = ("tension", "curvature")  # of which notes begin with the quantity and its place


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
    Means: (N+1, 3), (N,), (N+1,).  left_out: what the rest of quadratic drag and the stretch by swinging, which no
    amplitude has, would add to deviations of tension (N,) and curvature (N+1,), as parts, to the first order.
    shape: part (N+1,) by which the law of drag, which is not normal, changes the deviation of the size of curvature.
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
    left_out: Mapping[str, Floats] = field(default_factory=dict)
    shape: Floats | float = 0.0

    def spectrum(self, name: str) -> LineSpectrum:
        """Power by frequency of position (F, N+1, 3), tension (F, N), curvature or curvature_across (F, N+1)."""
        if name not in VARIES:
            raise ValueError(f"{name!r}: one of {', '.join(VARIES)}")
        return LineSpectrum(self.f, 0.5 * np.abs(getattr(self, name)) ** 2)

    def deviation(self, name: str) -> Floats:
        """Standard deviation, in the unit of the quantity; of `curvature` that of its size, with what is across."""
        if name != "curvature":
            return np.sqrt(self.spectrum(name).moment(0))
        phases = phases_of(self.f)
        if phases is not None:
            in_plane, aside = (phases @ self.curvature).real, (phases @ self.curvature_across).real
            return np.asarray(np.hypot(self.mean_curvature + in_plane, aside).std(axis=0))
        return np.asarray(size_deviation(self.mean_curvature, self.covariance) * (1.0 + self.shape))

    @property
    def covariance(self) -> Floats:
        """(N+1, 2, 2) 1/m^2, of curvature in the plane of the bend and across it."""
        return covariance_of(np.stack([self.curvature, self.curvature_across], axis=2))

    def resolved(self, name: str) -> NDArray[np.bool_]:
        """Where the linear response is resolved: what it neglects is small beside it.

        The standard deviation is at least `OF_LARGEST` of the largest of the line, and neglected terms add at most
        `ADDED` to it; elsewhere terms of second order may be several times as large.
        """
        deviation = self.deviation(name)
        return np.asarray(
            (deviation >= OF_LARGEST * deviation.max()) & (self.left_out.get(name, 0.0) <= ADDED.get(name, np.inf))
        )

    def _curvature_power(self) -> LineSpectrum:
        """Power (F, N+1) of curvature by where the bend points: of any axes across the line the same."""
        x, points = np.stack([self.curvature, self.curvature_across], axis=2), self.covariance
        points[:, 0, 0] += self.mean_curvature**2
        return LineSpectrum(self.f, 0.5 * np.einsum("fni,nij,fnj->fn", x.conj(), points, x).real)

    def period(self, name: str) -> Floats:
        """Mean period between up-crossings, s."""
        spectrum = self._curvature_power() if name == "curvature" else self.spectrum(name)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.sqrt(spectrum.moment(0) / spectrum.moment(2)))

    def most_probable(self, name: str, hours: float = HOURS) -> Floats:
        """Most probable largest deviation from the mean of a Gaussian process in `hours`.

        At most the sum of all amplitudes.  ValueError: hours are no time.
        """
        _above_zero("hours", hours)
        period = self.period(name)
        cycles = np.maximum(3600.0 * hours / np.where(period > 0.0, period, np.inf), 1.0)
        size = np.abs(getattr(self, name))
        if name == "curvature":
            size = np.hypot(size, np.abs(self.curvature_across))
        together = size.sum(axis=0)
        return np.minimum(self.deviation(name) * np.sqrt(2.0 * np.log(cycles)), together)

    def damage(self, curve: str | Mapping[str, float | str] | Curve, strength: float, hours: float = HOURS) -> Floats:
        """Fatigue damage (N,) of the tension in `hours`, by a T-N curve over a strength (N).

        By Dirlik's law; of few frequencies, whose sum is no normal process, by counted cycles.  ValueError: strength or
        hours are not above 0, or the curve is one of stress; ResultError: the package rainflow, which counts, is
        missing.
        """
        found = curve_of(curve)
        _above_zero("strength", strength)
        _above_zero("hours", hours)
        if found.kind != "T-N":
            raise ValueError(f"a curve of kind {found.kind}: expected T-N, over the strength; stress is not known here")
        if len(self.f) == 1:
            return np.asarray(3600.0 * hours * self.f[0] / found.cycles(2.0 * np.abs(self.tension[0]) / strength))
        if phases_of(self.f) is not None:
            return self._counted(found, strength) * 3600.0 * hours * self.f[0] / COUNTED
        spectrum = self.spectrum("tension")
        scaled: Any = LineSpectrum(spectrum.f, spectrum.power / strength**2)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.nan_to_num(dirlik_damage(scaled, found, 3600.0 * hours))

    def _counted(self, curve: Curve, strength: float) -> Floats:
        """Damage (N,) in `COUNTED` of the longest periods."""
        power = self.spectrum("tension").power
        counts = self.f[(power > SMALL * power.sum(axis=0)).any(axis=1)]
        if not counts.size:
            return np.zeros(self.middle.size)
        t = np.linspace(0.0, COUNTED / self.f[0], 1 + round(PER_PERIOD * COUNTED * counts[-1] / self.f[0]))
        turned = np.exp(-2j * np.pi * np.outer(t, self.f))
        return np.array([damage((turned @ x).real, curve, 1.0 / strength) for x in self.tension.T])


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
        """Whether nothing speaks against a quantity: what is said of another one alone is no doubt of it.

        ValueError: it is none of `VARIES`."""
        if name not in VARIES:
            raise ValueError(f"{name!r}: one of {', '.join(VARIES)}")
        alone = {of: [x for x in self.notes if f"{of} at s" in x] for of in ALONE}
        others = [x for of, notes in alone.items() if not name.startswith(of) for x in notes]
        return all(x in others for x in self.notes)


def _above_zero(name: str, value: float) -> None:
    if not 0.0 < value < np.inf:
        raise ValueError(f"{name} = {value:g}: expected a number above 0")
