"""Least squares between bounds: the Gauss-Newton method with exact derivatives, in steps of a part of each number."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from hybrid.designs.case_results import Equilibria, Point
from hybrid.designs.numbers_and_results import PLACE, number_of, parse_wanted, scale_of
from hybrid.errors import Complaint, ComputationError, Outcome, SceneError
from hybrid.kernels.state.state import Floats
from hybrid.scene.read import SceneLike, as_scene
from hybrid.scene.root import Scene

ROUNDS = 40  # at most
AT_BOUND = 1e-6  # part of a bound's size within which an unknown is at it
MET = 1e-8  # residuals below which all are met
STEP = 0.3  # part of itself by which a number changes in a round, at most
HALVED = 6  # times that a step is halved which does not lead nearer
# Part of the sum of squares below which nothing is gained any more; singular values, as parts of the largest, below
# which a combination of unknowns stays what it is.
GAIN, SINGULAR = 1e-9, 1e-9


class Space(NamedTuple):
    """The unknowns: names, where they begin, and between what they stay (n,); infinite: no bound.

    most: of what they change by parts, at most: of coordinates, which go by the origin, the length of a line.
    """

    names: tuple[str, ...]
    start: Floats
    low: Floats
    high: Floats
    most: Floats | float = np.inf

    def sizes(self, x: Floats) -> Floats:
        """What unknowns at x change by parts of: themselves, or their range where 0 is in it."""
        through = (self.low < 0.0) & (self.high > 0.0) | (x == 0.0)
        range_ = np.where(np.isfinite(self.high - self.low), self.high - self.low, np.maximum(np.abs(x), 1.0))
        return np.minimum(np.where(through, range_, np.abs(x)), self.most)

    def at_bounds(self, x: Floats) -> NDArray[np.bool_]:
        """Which unknowns at x are at their low and high (n, 2)."""
        return np.abs(x[:, None] - np.stack([self.low, self.high], axis=1)) <= AT_BOUND * self.sizes(x)[:, None]


class Rows(NamedTuple):
    """Residuals (M,) at a point, and what makes their derivatives (M, n).

    stopped: why a search ended, where a step that should have led nearer could not be computed.
    """

    point: Point
    values: Floats
    slopes: Callable[[], Floats]
    stopped: str = ""

    @property
    def cost(self) -> float:
        return 0.5 * float(self.values @ self.values)


def nearest(
    residuals: Callable[[Floats], Rows],
    space: Space,
    least: float = 0.0,
    enough: float = GAIN,
    refresh: Callable[[Point], bool] = lambda point: False,
) -> Rows:
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
    else:
        return here._replace(stopped=f"{ROUNDS} steps were not enough")
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


# Numbers of a scene for which results of its equilibrium are what is asked: a design with as many targets.


@dataclass(frozen=True)
class Sought:
    """Numbers that were found, by key; results with them, and their targets, by name; equilibria that it took.

    scene: with these numbers.
    """

    numbers: Mapping[str, float]
    results: Mapping[str, float]
    targets: Mapping[str, float]
    equilibria: int
    scene: Scene


def seek(scene: SceneLike, targets: Mapping[str, float], by: Sequence[str]) -> Sought:
    """Change as many numbers of a scene as there are targets until the results of its equilibrium are these.

    targets: results as of `hybrid.sensitivity`, such as `{"tension@250": 25e3}`; by: keys of numbers, each of which
    keeps its sign.  SceneError: what has no derivative, more or fewer numbers than targets; ComputationError: they are
    not reached, with how near it came.
    """
    asked = as_scene(scene)
    if len(by) != len(targets) or not by:
        expected = f"as many keys as targets ({len(targets)})"
        raise SceneError([Complaint("by", f"{len(by)} keys", expected, "one number for each target")])
    start = np.array([number_of(asked, key) for key in by])
    if not start.all():
        zero = by[int(np.flatnonzero(start == 0.0)[0])]
        raise SceneError([Complaint(zero, "0", "a number to begin with, which keeps its sign", "a first guess")])
    goal = np.array(list(targets.values()), float)
    equilibria = Equilibria({"": asked}, [(key,) for key in by], [("", name) for name in targets])
    names = [parse_wanted(asked, name, moves=False).name for name in targets]
    scale = np.array([scale_of(asked, *x) for x in zip(names, goal.tolist(), strict=True)])
    if not goal.all():  # what is sought to be 0 is as large as it is at first, or as the numbers can make it
        first_point = equilibria.point_of(start)
        size = np.maximum(np.abs(first_point.values), np.abs(first_point.slopes) @ np.abs(start))
        scale = np.where(goal == 0.0, np.maximum(size, 1e-12), scale)

    def off(x: Floats) -> Rows:
        point = equilibria.point_of(x)
        return Rows(point, (point.values - goal) / scale, lambda: point.slopes / scale[:, None])

    low, high = np.where(start > 0.0, ((0.0,), (np.inf,)), ((-np.inf,), (0.0,)))  # each keeps its sign
    most = np.array([asked.length if PLACE.search(key) else np.inf for key in by])
    reached = nearest(off, Space(tuple(by), start, low, high, most))
    numbers, results = reached.point.x, reached.point.values
    if float(np.abs(reached.values).max()) <= MET:
        found = dict(zip(targets, results.tolist(), strict=True))
        new = equilibria.scene("", numbers)
        return Sought(dict(zip(by, numbers.tolist(), strict=True)), found, dict(targets), equilibria.count, new)
    worst = int(np.abs(reached.values).argmax())
    text = ", ".join(f"{key} = {x:.6g}" for key, x in zip(by, numbers, strict=True))
    detail = f"{list(targets)[worst]} comes to {results[worst]:.6g}, not {goal[worst]:.6g}, with {text}"
    first = "other numbers (--by) that it answers to, or a target nearer to what it is"
    raise ComputationError(Outcome.NOT_REACHED, None, None, detail, first=first)
