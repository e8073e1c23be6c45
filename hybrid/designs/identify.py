"""Numbers of a scene from what was measured of its equilibrium or motion, how well they are known, and what is not."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.stats import chi2, norm, t

from hybrid.designs.equilibria import FINER, Equilibria, Point
from hybrid.designs.measured import History, Measurements
from hybrid.designs.nearest import Rows, Space, nearest
from hybrid.errors import ComputationError
from hybrid.kernels.state.state import Floats

# Standard deviation of the logarithm of a combination of unknowns from which on it counts as not known.
UNKNOWN = 1.0
# What parts of a combination count, and are alike.
PART, ALIKE = 0.05, 0.03
SINGULAR = 1e-6  # singular values, as parts of the largest, that are 0
LEAST = 1e-4  # where no deviation is stated, part of the largest number below which unknowns stay
GAIN = 1e-7  # part of the sum of squares that is worth a step
CONFIDENCE, DOUBT = 0.95, 0.005
# Readings one after another from which on it is judged whether they are independent.
FEWEST = 8


class Estimate(NamedTuple):
    """A number that was found, its standard deviation, and between what it is with 95 %; infinite: not known by itself.

    by_cells: by how much it changes on cells half as long; NaN: there is no equilibrium on these.
    """

    name: str
    value: float
    deviation: float
    low: float
    high: float
    by_cells: float


class Apart(NamedTuple):
    """Unknowns that cannot be told apart: the parts by which they may change together, unseen, and in words."""

    parts: Mapping[str, float]
    text: str


@dataclass(frozen=True)
class Fit:
    """What was found: point; estimates; correlations (n, n), NaN where not known; what cannot be told apart.

    count: numbers that were measured; scatter: root mean square of what is left, in stated deviations or, where there
    are none, in the unit of what was measured.
    """

    point: Point
    estimates: tuple[Estimate, ...]
    correlations: Floats
    apart: tuple[Apart, ...]
    count: int
    scatter: float
    notes: tuple[str, ...]


def fit(measured: Measurements, equilibria: Equilibria, space: Space) -> Fit:
    """The values of unknowns nearest to what was measured.

    ComputationError, SceneError: where it begins there is no equilibrium, or no such scene.
    """
    rows, values = measured.rows, measured.values
    known = measured.deviations is not None
    scale = measured.deviations if measured.deviations is not None else np.full(values.size, _typical(values))

    def off(x: Floats) -> Rows:
        point = equilibria.point_of(x)
        return Rows(point, (point.values[rows] - values) / scale, lambda: point.slopes[rows] / scale[:, None])

    def refresh(point: Point) -> bool:
        return point.refresh({*equilibria.motions.rows})

    best = nearest(off, space, 1.0 / UNKNOWN if known else LEAST, GAIN, refresh)
    refresh(best.point)
    sizes = space.sizes(best.point.x)
    u, s, v = np.linalg.svd(best.slopes() * sizes, full_matrices=False)
    freedom = values.size - int(np.sum(s > SINGULAR * s.max(initial=0.0)))
    unit = 1.0 if known else math.sqrt(2.0 * best.cost / freedom) if freedom > 0 else math.inf
    s, v = np.append(s, np.zeros(sizes.size - s.size)), _completed(v)
    seen = s > unit / UNKNOWN
    estimates, correlations = _estimates(space.names, best, sizes, s, v, seen, unit, freedom if not known else None)
    finer, notes = _by_cells(equilibria, best, rows, scale, u, s, v, seen, sizes)
    estimates = tuple(x._replace(by_cells=float(y)) for x, y in zip(estimates, finer, strict=True))
    apart = tuple(_apart(space.names, best.point.x, v[k], v, s, seen, unit) for k in np.flatnonzero(~seen))
    scatter = math.sqrt(2.0 * best.cost / values.size) * (1.0 if known else float(scale[0]))
    notes += [f"the search stopped before it was done: {best.stopped}"] if best.stopped else []
    notes += _doubts(best, freedom, known) + _after_each_other(best.values, measured.histories)
    return Fit(best.point, estimates, correlations, apart, values.size, scatter, tuple(notes))


def _typical(values: Floats) -> float:
    return float(np.abs(values).max(initial=0.0)) or 1.0


def _completed(v: Floats) -> Floats:
    """Rows (m, n), m <= n, with others that are at right angles to them."""
    return v if v.shape[0] == v.shape[1] else np.linalg.svd(v, full_matrices=True)[2]


def _estimates(
    names: Sequence[str], best: Rows, sizes: Floats, s: Floats, v: Floats, seen: np.ndarray, unit: float,
    freedom: int | None,
) -> tuple[tuple[Estimate, ...], Floats]:  # fmt: skip
    """Estimates and correlations; freedom: of a deviation that is estimated, too; None: it is stated."""
    covariance = (v[seen].T / s[seen] ** 2) @ v[seen] * unit**2
    spread = sizes * np.sqrt(np.diag(covariance))
    hidden = (np.abs(v[~seen]) > PART).any(axis=0) if (~seen).any() else np.zeros(sizes.size, bool)
    spread[hidden] = np.inf
    level = 0.5 * (1.0 + CONFIDENCE)
    times = float(t.ppf(level, freedom if freedom is not None else np.inf)) if freedom != 0 else np.inf
    x = best.point.x
    out = tuple(
        Estimate(name, float(a), float(d), float(a - times * d), float(a + times * d), math.nan)
        for name, a, d in zip(names, x, spread, strict=True)
    )
    size = np.sqrt(np.diag(covariance))
    correlations = covariance / np.maximum(np.outer(size, size), 1e-300)
    correlations[hidden] = correlations[:, hidden] = np.nan
    return out, correlations


def _by_cells(
    equilibria: Equilibria, best: Rows, rows: np.ndarray, scale: Floats, u: Floats, s: Floats, v: Floats,
    seen: np.ndarray, sizes: Floats,
) -> tuple[Floats, list[str]]:  # fmt: skip
    """By how much unknowns change on cells half as long: one more step from there."""
    try:
        finer = equilibria.point_of(best.point.x, FINER)
    except ComputationError as error:
        return np.full(sizes.size, np.nan), [f"not checked on twice the cells: {str(error).splitlines()[0]}"]
    change = (finer.values - best.point.values)[rows] / scale
    k = np.flatnonzero(seen[: u.shape[1]])
    return sizes * (v[k].T @ (-(u[:, k].T @ change) / s[k])), []


def _doubts(best: Rows, freedom: int, known: bool) -> list[str]:
    if freedom <= 0:
        return ["as many numbers are sought as are seen in what was measured: nothing is left to check them by"]
    if known and chi2.sf(2.0 * best.cost, freedom) < DOUBT:
        times = math.sqrt(2.0 * best.cost / freedom)
        return [
            f"what is left is {times:.3g} times the stated deviation: the scene is another line than was measured, or "
            "the deviation is larger; intervals are too narrow"
        ]
    return []


def _likeness(left: Floats, histories: Sequence[History]) -> tuple[float, int]:
    """Correlation of what is left in histories with that at the time before, and of how many pairs it is."""
    pairs, square, count = 0.0, 0.0, 0
    for each in histories:
        x = left[each.rows]
        pairs, square, count = pairs + float(x[1:] @ x[:-1]), square + float(x @ x), count + x.size - 1
    return (pairs / square if square > 0.0 else 0.0), count


def _after_each_other(left: Floats, histories: Sequence[History]) -> list[str]:
    """Doubts about readings that are no readings by themselves: intervals count each as one.

    Of independent ones the correlation is normal, with a deviation of 1 / sqrt(count).
    """
    likeness, count = _likeness(left, histories)
    if count < FEWEST or likeness * math.sqrt(count) <= norm.isf(DOUBT):
        return []
    times = math.sqrt((1.0 + likeness) / max(1.0 - likeness, 1e-3))
    return [
        f"what is left at a time is like that at the time before (correlation {likeness:.2g}): the scene moves "
        f"otherwise than was measured, or readings are closer than their noise changes; intervals are about "
        f"{times:.2g} times too narrow"
    ]


def _apart(
    names: Sequence[str], x: Floats, direction: Floats, v: Floats, s: Floats, seen: np.ndarray, unit: float
) -> Apart:
    """A combination of unknowns that what was measured does not show, and of two what it shows instead."""
    direction = direction / direction[np.abs(direction).argmax()]
    involved = [k for k in np.argsort(-np.abs(direction)) if abs(direction[k]) > PART]
    parts = {names[k]: float(direction[k]) for k in sorted(involved)}
    if len(involved) == 1:
        return Apart(parts, f"{names[involved[0]]}: what was measured does not depend on it")
    if len(involved) == 2 and x[involved].all():
        a, b = sorted(involved)
        power = float(-direction[a] / direction[b])  # a * b**power stays what it is
        if abs(abs(power) - 1.0) < ALIKE:
            power = math.copysign(1.0, power)
        word = f"{names[a]} {'*' if power > 0.0 else '/'} {names[b]}"
        word += "" if abs(power) == 1.0 else f"**{abs(power):.2g}"
        what = {1.0: "their product", -1.0: "their ratio"}.get(power, "their combination")
        weights = np.zeros(x.size)
        weights[a], weights[b] = 1.0, power
        log = unit * math.sqrt(float((((v[seen] @ weights) / s[seen]) ** 2).sum()))
        value = abs(float(x[a])) * abs(float(x[b])) ** power
        return Apart(
            parts, f"{names[a]} and {names[b]}: only {what} is known, {word} = {value:.5g} ± {value * log:.2g}"
        )
    change = ", ".join(f"{name} by {100 * part:+.0f} %" for name, part in parts.items())
    return Apart(parts, f"{' and '.join(parts)}: a change of {change} together is not seen (nor one in proportion)")
