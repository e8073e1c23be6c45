"""Damped motions of a line to rest, and pushes off equilibria that are not stable."""

from __future__ import annotations

import numpy as np

from hybrid.errors import Outcome
from hybrid.kernels.state.forces import MASS_DAMPING, PLANAR, ROTARY
from hybrid.kernels.state.obstacle_rows import FREE, MOVES
from hybrid.kernels.state.state import NO_SHEAVES, Ends, Floats, Line, Sea, State
from hybrid.solve.stepper import Stepper

RELAXING_STEPS = 2000  # of the pseudo-transient, at most
GYRATION = 0.02  # of the length: radius of gyration lent to the spin of a line that settles
CALM = 1e-4  # of the length: movement in a step below which Newton is tried again
PUSH, TURN = 1e-2, 0.1  # the push off an unstable equilibrium: of the length per time scale, and rad about the chord
DAMPING = 2.0  # 1/s over the time scale: critical of the slowest motion
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


class Settling:
    """Damped motions of one line, whose damping of mass makes them creep within its time scale (s)."""

    def __init__(self, line: Line, sea: Sea, length: float, scale: float) -> None:
        """length: m; scale: the tension scale, N."""
        self.line, self.sea, self.length, self.scale = line, sea, length, scale
        self.time_scale = float(np.sqrt(float(line.mass.sum()) * length / scale))

    def rest(self, ends: Ends, state: State, longest: float = 0.0) -> tuple[State, int]:
        """Pseudo-transient until the line hardly moves: rho = 0, doubling steps, damping by mass; and its iterations.

        longest: s, of the steps; at least the time scale.  Sheaves are held: without friction nothing turns them, and
        their correction takes factors that are not kept here.
        """
        line, length, time_scale = self.line, self.length, self.time_scale
        longest = max(longest, time_scale)
        held = np.where(line.moved == FREE, MOVES, line.moved).astype(np.int8)
        stepper = Stepper(damped(line, length, time_scale)._replace(moved=held), length, self.scale)
        old = state._replace(sheave=NO_SHEAVES).copy()
        new = old.copy()
        dt, calm, iterations = 1e-3 * time_scale, 0, 0
        for _ in range(RELAXING_STEPS):
            taken = stepper.step(self.sea, ends, old, new, dt, 0.0, dt)
            iterations += taken.iterations
            if taken.outcome != Outcome.OK:
                dt *= 0.25
                if dt < 1e-9 * time_scale:
                    break
                old.a[:], old.vd[:], old.v[:] = 0.0, 0.0, 0.0
                old.wa[:], old.wd[:], old.w[:] = 0.0, 0.0, 0.0
                continue
            moved = float(np.abs(new.r - old.r).max())
            old, new = new, old
            if taken.iterations <= 5:
                dt = min(2.0 * dt, longest)
            calm = calm + 1 if moved < CALM * length * dt / longest else 0
            if calm >= 3:
                break
        return old._replace(sheave=state.sheave.copy()), iterations

    def nudged(self, state: State) -> State:
        """A state given a small push off an unstable equilibrium: `nudged`."""
        return nudged(self.line, state, self.length, self.time_scale)

    def fallen(self, ends: Ends, state: State, square: float, shape: Floats) -> tuple[State, int]:
        """Where a line comes to from an unstable equilibrium, pushed along its softest motion; and the iterations.

        square (1/s^2, below 0), shape (N+1, 3): as of `Stability.softest_motion`.  A slack line on a bed falls in
        hours where its time scale is seconds: steps are a part of the time in which the motion grows e-fold.  With
        longer ones it would not grow.
        """
        pushed = state.copy()
        pushed.v[:] = along(shape, self.length, self.time_scale)
        return self.rest(ends, pushed, GROWN * growth_time(square, self.time_scale))


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
