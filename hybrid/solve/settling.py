"""Damped motions of a line to rest, and pushes off equilibria that are not stable."""

from __future__ import annotations

import numpy as np

from hybrid.kernels.state.forces import MASS_DAMPING, PLANAR, ROTARY
from hybrid.kernels.state.state import Floats, Line, State

RELAXING_STEPS = 2000  # of the pseudo-transient, at most
GYRATION = 0.02  # of the length: radius of gyration lent to the spin of a line that settles
CALM = 1e-4  # of the length: movement in a step below which Newton is tried again
PUSH, TURN = 1e-2, 0.1  # the push off an unstable equilibrium: of the length per time scale, and rad about the chord
DAMPING = 2.0  # 1/s over the time scale: critical of the slowest motion
# Likewise in contact.  With 2, legs of catenaries that came together at speed folded in half of 12 scenes whose mass
# differs by at most 1 %, and the others took five times as long or more.
CONTACT_DAMPING = 8.0
GROWN = 0.5  # steps of a slow fall, over the time in which it grows e-fold


def gyration(line: Line, length: float) -> Floats:
    """Inertia (N,) kg m^2 that is lent to the spin of the cells of a line that settles.

    A spin without inertia would follow Newton to any equilibrium, stable or not: this gives it some to fall with.
    """
    return np.asarray(line.spin * 0.5 * (line.mass[:-1] + line.mass[1:]) * (GYRATION * length) ** 2)


def damped(line: Line, length: float, time_scale: float, damping: float = DAMPING) -> Line:
    """The line with so much damping by mass, 1/s over the time scale (s), and inertia of spin."""
    return line._replace(
        damp=np.nan_to_num(line.damp) + damping * line.mass / time_scale,
        polar=np.nan_to_num(line.polar) + gyration(line, length),
        rotary=np.nan_to_num(line.rotary),
        bits=line.bits | MASS_DAMPING | ROTARY,
    )


def growth_time(square: float, time_scale: float, damping: float = DAMPING) -> float:
    """Time (s) in which a motion with this square (1/s^2, below 0) grows e-fold; damping: as of `damped`."""
    half = 0.5 * damping / time_scale
    return float(1.0 / (np.sqrt(half**2 - square) - half))


def stop(state: State) -> None:
    """Stop all motion of a state."""
    for still in (state.v, state.a, state.vd, state.w, state.wa, state.wd):
        still[:] = 0.0


def along(shape: Floats, length: float, time_scale: float, damping: float = DAMPING) -> Floats:
    """Speeds (N+1, 3) m/s that carry a line PUSH of its length along a shape (N+1, 3); damping: as of `damped`."""
    return damping * PUSH * length / time_scale * shape


def nudged(line: Line, state: State, length: float, time_scale: float) -> State:
    """A state given a small push in all three directions and a turn about itself, off an unstable equilibrium."""
    pushed = state.copy()
    x = line.s / length
    speed = PUSH * length / time_scale
    for k in range(3):
        pushed.v[:, k] = speed * np.sin((k + 1) * np.pi * x + 0.3 * k)
    if line.bits & PLANAR:
        pushed.v[:] -= np.outer(pushed.v @ line.plane[2], line.plane[2])
        return pushed
    d = pushed.e / np.linalg.norm(pushed.e, axis=1)[:, None]
    turned = np.cos(TURN) * pushed.a1 + np.sin(TURN) * np.cross(d, pushed.a1)
    pushed.a1[:] = np.where(line.spin[:, None] == 1, turned, pushed.a1)
    return pushed
