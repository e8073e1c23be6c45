"""Drag that stands for the quadratic one in a Gaussian motion: the mean of its derivative (docs/theory.md, 21).

For f = c |u| u of a velocity u = U + x with x normal and of covariance S,  E[df/du] = c E[|u| 1 + u u^T/|u|];
it is the linear law that leaves least in the mean square.  That of a single harmonic, which is not normal, is the one
with the same first harmonic:  E[f x^T] E[x x^T]^-1  over its phases.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from hybrid.kernels.state.state import Floats

# Directions and radii of rules for the normal distribution: in a plane, and on axes in space.
ANGLES, RADII, POINTS = 40, 4, 10
# Standard deviations beyond which a normal velocity is its mean.
FAR = 30.0
# Values and weights of a normal law that show the kink of drag; standard deviations from which on the size of a bend is
# its part in the plane of the bend at rest.
LAW = np.linspace(-6.0, 6.0, 121)
LAW_PARTS = np.exp(-0.5 * LAW**2) / np.exp(-0.5 * LAW**2).sum()
BENT = 8.0
# Phases of a single harmonic, and the part of its largest square below which a direction counts as one without motion.
PHASES, STILL = 128, 1e-8


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


def of_harmonic(mean: Floats, amplitude: Floats) -> Floats:
    """The law (n, m, m) of a harmonic about mean velocities (n, m), of complex amplitudes (n, m); m = 1, 2 or 3.

    In directions without motion, E[df/du].
    """
    angle = 2.0 * np.pi * (np.arange(PHASES) + 0.5) / PHASES
    x = (amplitude[:, None, :] * np.exp(-1j * angle)[None, :, None]).real
    u = mean[:, None, :] + x
    speed = np.linalg.norm(u, axis=2)
    covariance = np.einsum("npi,npj->nij", x, x) / PHASES
    inverse = np.linalg.pinv(covariance, rcond=STILL, hermitian=True)
    B = np.einsum("np,npi,npj->nij", speed, u, x) / PHASES @ inverse
    scaled = u / np.sqrt(np.maximum(speed, 1e-300))[:, :, None]
    mean_slope = np.einsum("npi,npj->nij", scaled, scaled) / PHASES
    mean_slope += speed.mean(axis=1)[:, None, None] * np.eye(mean.shape[1])
    return np.asarray(B + mean_slope @ (np.eye(mean.shape[1]) - covariance @ inverse))


def linear_law(mean: Floats, u: Floats) -> Floats:
    """The law (n, m, m) by mean velocities (n, m) and amplitudes (F, n, m); m = 2 or 3."""
    if len(u) == 1:
        return of_harmonic(mean, u[0])
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


def of_cylinders(d: Floats, axes: Floats, drag: tuple[Floats, Floats], current: Floats, u: Floats) -> Floats:
    """Linear drag (H, 3, 3) N s/m of cylinders along d (H, 3) with axes (H, 2, 3) across, by a relative velocity of the

    water with a mean (H, 3) m/s and amplitudes u (F, H, 3).  drag: across and along, (H,) N s^2/m^2.
    """
    un, ut = (u.transpose(1, 0, 2) @ axes.transpose(0, 2, 1)).transpose(1, 0, 2), (u * d).sum(axis=2)
    mean, forth = np.einsum("hi,hmi->hm", current, axes), np.einsum("hi,hi->h", current, d)
    B = axes.transpose(0, 2, 1) @ linear_law(mean, un) @ axes * drag[0][:, None, None]
    if len(u) == 1:
        t = of_harmonic(forth[:, None], ut[0, :, None])[:, 0, 0]
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
