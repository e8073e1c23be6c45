"""What `hybrid.Simulation` gives out and takes in: states, forces, vectors that are checked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import wraps
from math import isfinite
from typing import Any, Concatenate, NamedTuple, ParamSpec, Protocol, TypeVar

import numpy as np

from hybrid.kernels.state.state import Floats
from hybrid.model.mesh import Zone
from hybrid.scene.root import SomeScene


class CableState(NamedTuple):
    """Where the cable is; arrays of one's own."""

    t: float  # s
    s: Floats  # (N+1,) m, unstretched arc length of the nodes
    position: Floats  # (N+1, 3) m, inertial
    velocity: Floats  # (N+1, 3) m/s
    tension: Floats  # (N,) N, of the cells between
    zones: tuple[Zone, ...]


class EndForces(NamedTuple):
    """Forces (3,) N and moments (3,) N m of the cable on what holds its ends, inertial; zero where nothing holds it."""

    start: Floats
    end: Floats
    moment_start: Floats
    moment_end: Floats


class Locked(Protocol):
    """What has a lock of its own."""

    lock: Any


Triple = tuple[float, float, float]
P = ParamSpec("P")
R = TypeVar("R")
L = TypeVar("L", bound=Locked)


def one_thread(method: Callable[Concatenate[L, P], R]) -> Callable[Concatenate[L, P], R]:
    """A method that refuses with ValueError while another thread is in one of its object's methods."""

    @wraps(method)
    def alone(self: L, *args: P.args, **options: P.kwargs) -> R:
        if not self.lock.acquire(False):
            raise ValueError("another thread is using this Simulation: one at a time, or a Simulation for each")
        try:
            return method(self, *args, **options)
        finally:
            self.lock.release()

    return alone


# Of a step: a step so short is round-off of the times of others.
SLIVER = 1e-6


def end_of_step(now: float, step: float | None, duration: float) -> float:
    """Time (s) at which the next step of the scene's length ends; ValueError: steps follow the motion."""
    if step is None:
        raise ValueError("steps follow the motion: use advance(until), or give time.step")
    taken, until = round(now / step), now + step
    if abs(taken * step - now) < SLIVER * step:
        until = (taken + 1) * step  # a multiple of the step, without round-off that adds up
    return until if duration - until > SLIVER * step else duration


def vector(x: Sequence[float] | Floats, name: str) -> Floats:
    value = numbers(x, name)
    if value.shape != (3,) or not all(map(isfinite, value.tolist())):
        raise ValueError(f"{name}: expected three finite numbers, found {x!r:.60}")
    return value


def triple(x: Sequence[float] | Floats, name: str) -> Triple:
    """As `vector`, for what is set at every step: a tuple or list of floats is not made an array first."""
    if type(x) in (tuple, list) and len(x) == 3:
        a, b, c = x
        if type(a) is type(b) is type(c) is float and isfinite(a) and isfinite(b) and isfinite(c):
            return a, b, c
    a, b, c = vector(x, name).tolist()
    return a, b, c


def numbers(x: Any, name: str) -> Floats:
    try:
        return np.array(x, float)
    except (TypeError, ValueError):
        raise ValueError(f"{name}: expected numbers, found {x!r:.60}") from None


def in_space(scene: SomeScene) -> SomeScene:
    return scene if scene.dimension is not None else scene.model_copy(update={"dimension": 3})


def iterations_allowed(most: Any) -> int:
    """Newton iterations that a step may take; 0: no bound."""
    if most is None:
        return 0
    if isinstance(most, bool) or not isinstance(most, int | np.integer) or most < 1:
        raise ValueError(f"most_iterations: expected a whole number of at least 1, found {most!r:.60}")
    return int(most)
