"""Drag that stands for the quadratic one in a Gaussian motion: the mean of its derivative (docs/theory.md, 21).

For f = c |u| u of a velocity u = U + x with x normal and of covariance S,  E[df/du] = c E[|u| 1 + u u^T/|u|];
it is the linear law that leaves least in the mean square.
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
# Of a single harmonic: 8/(3 pi) of its amplitude in place of sqrt(8/pi) of its standard deviation.
HARMONIC = 8.0 / (3.0 * math.pi) * math.sqrt(2.0) / math.sqrt(8.0 / math.pi)


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
