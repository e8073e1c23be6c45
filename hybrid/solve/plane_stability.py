"""A small push out of the plane that is carried along with a motion in it (kernels.laws.out_of_plane)."""

from __future__ import annotations

import numpy as np

from hybrid.kernels.mesh.zone_transfer import carry_push
from hybrid.kernels.state.state import Floats

# Sines over the length whose sum is the push: enough that no mode of a line that could grow is left out.
SINES = 6


def seed(s: Floats, speed: float) -> Floats:
    """A push (N+1, 4): displacement, rate and accelerations; rates of about `speed` (m/s), and nothing else."""
    out, x = np.zeros((s.size, 4)), s / s[-1]
    for k in range(1, SINES + 1):
        out[:, 1] += speed * np.sin(k * np.pi * x + 0.3 * k) / k
    return out


def scaled(push: Floats, size: float, s: Floats) -> Floats:
    """The push, so that nothing is displaced by more than `size` (m); begun anew where it is not finite, or nothing."""
    largest = float(np.abs(push[:, 0]).max())
    if not 0.0 < largest < np.inf:
        push, largest = seed(s, 1.0), 1.0
    return np.asarray(push * (size / largest))


def on_nodes(push: Floats, s: Floats, at: Floats) -> Floats:
    """The push at other nodes."""
    out = np.zeros((at.size, 4))
    carry_push(push, s, at, out)
    return out
