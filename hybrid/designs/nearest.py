"""Least squares between bounds: the Gauss-Newton method with exact derivatives, in steps of a part of each number."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.optimize import lsq_linear

from hybrid.designs.equilibria import Point
from hybrid.errors import ComputationError, SceneError
from hybrid.kernels.state.state import Floats

# Rounds at most, and residuals below which all are met; a number changes by this part of itself a round at most, and a
# step that does not lead nearer is halved so often.
ROUNDS, MET, STEP, HALVED = 40, 1e-8, 0.3, 6
# Part of the sum of squares below which nothing is gained any more; singular values, as parts of the largest, below
# which a combination of unknowns stays what it is.
GAIN, SINGULAR = 1e-9, 1e-9


class Space(NamedTuple):
    """The unknowns: names, where they begin, and between what they stay (n,); infinite: no bound."""

    names: tuple[str, ...]
    start: Floats
    low: Floats
    high: Floats

    def sizes(self, x: Floats) -> Floats:
        """What unknowns at x change by parts of: themselves, or their range where 0 is in it."""
        through = (self.low < 0.0) & (self.high > 0.0) | (x == 0.0)
        range_ = np.where(np.isfinite(self.high - self.low), self.high - self.low, np.maximum(np.abs(x), 1.0))
        return np.asarray(np.where(through, range_, np.abs(x)))


class Rows(NamedTuple):
    """Residuals (M,) at a point, and what makes their derivatives (M, n); stopped: why a search went no further, where

    a step that should have led nearer could not be computed.
    """

    point: Point
    values: Floats
    slopes: Callable[[], Floats]
    stopped: str = ""

    @property
    def cost(self) -> float:
        return 0.5 * float(self.values @ self.values)


def nearest(
    residuals: Callable[[Floats], Rows], space: Space, least: float = 0.0, enough: float = GAIN,
    refresh: Callable[[Point], bool] = lambda point: False,
) -> Rows:  # fmt: skip
    """Where the sum of squares of residuals is least, between the bounds.

    least: singular value below which a combination of unknowns stays what it is; enough: in place of GAIN;
    refresh: makes slopes at a point better, False: they are as good as can be.
    ComputationError, SceneError: where it begins there is no equilibrium, or no such scene.
    """
    here = residuals(space.start)
    for _ in range(ROUNDS):
        if float(np.abs(here.values).max(initial=0.0)) <= MET:
            break
        sizes = space.sizes(here.point.x)
        slopes = here.slopes() * sizes
        step = _step(slopes, here, space, sizes, least)
        gain = here.cost - 0.5 * float(np.sum((here.values + slopes @ step) ** 2))
        if gain <= enough * here.cost:
            if refresh(here.point):
                continue
            break
        why = ""
        for _ in range(HALVED):
            x = np.clip(here.point.x + sizes * step, space.low, space.high)
            try:
                there = residuals(x)
            except (ComputationError, SceneError) as error:
                there, why = None, " ".join(str(error).split())
            if there is not None and there.cost < here.cost:
                break
            step *= 0.5
        else:
            if refresh(here.point):
                continue
            return here._replace(stopped=why)
        assert there is not None
        here = there
    return here


def _step(slopes: Floats, here: Rows, space: Space, sizes: Floats, least: float) -> Floats:
    """Parts by which unknowns change; slopes: by these parts."""
    u, s, v = np.linalg.svd(slopes, full_matrices=False)
    kept = s > max(SINGULAR * s.max(initial=0.0), least)
    step = v[kept].T @ ((u[:, kept].T @ -here.values) / s[kept])
    low = np.maximum((space.low - here.point.x) / sizes, -STEP)
    high = np.minimum((space.high - here.point.x) / sizes, STEP)
    if np.all((step >= low) & (step <= high)):
        return np.asarray(step)
    room = high > low
    out = np.zeros(sizes.size)
    if room.any():
        found = lsq_linear((u[:, kept] * s[kept]) @ v[kept][:, room], -here.values, (low[room], high[room]), "bvls")
        out[room] = found.x
    return out
