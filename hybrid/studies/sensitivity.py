"""Which variables matter for a result of a study: indices of Sobol, elementary effects of Morris, rank correlations.

SALib makes the designs and evaluates them; what was sampled otherwise has rank correlations (Spearman), which any table
has.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hybrid.errors import ResultError, optional_package
from hybrid.store.study_file import DONE, open_study

# Designs for sensitivity, and the levels of a Morris design.
DESIGNS = ("saltelli", "morris")
LEVELS = 4
# Resamples of the intervals.
RESAMPLES = 200
# Cases of which correlations are computed.
LEAST = 3


class Influence(NamedTuple):
    """What one variable does to a result.

    method "sobol": `first` is the part of the variance that it makes alone, `total` that with all it interacts with;
    "morris": `first` is the mean of the sizes of its elementary effects, `total` their deviation, in the unit of the
    result over the range of the variable; "rank": `first` is the rank correlation, `total` NaN.  interval: half width
    of the 95 % interval of `first` ("sobol", "morris"), of "rank" the probability of such a correlation by chance.
    """

    variable: str
    method: str
    first: float
    total: float
    interval: float


class StudyResult(NamedTuple):
    """A result of a study: all of its data, values (n,), which cases have one, how they were sampled (None: not)."""

    data: Any
    values: np.ndarray
    done: np.ndarray
    sample: dict[str, Any] | None

    @property
    def method(self) -> str:
        """Of its sample; "": it has none."""
        return str(self.sample["method"]) if self.sample else ""


def design(method: str, names: list[str], count: int, seed: int) -> np.ndarray:
    """Points (n, m) between 0 and 1 of a design for m variables; count: its base size."""
    optional_package("SALib", "a design for sensitivity", "studies")
    from SALib.sample import morris, sobol

    problem = _problem(names, [(0.0, 1.0)] * len(names))
    if method == "saltelli":
        return np.asarray(sobol.sample(problem, count, calc_second_order=False, seed=seed))
    return np.asarray(morris.sample(problem, count, num_levels=LEVELS, seed=seed))


def sensitivity(study: str | Path, result: str) -> list[Influence]:
    """What each variable of a study does to one of its results, the strongest first.

    study: the folder of its results; result: a number that was kept of each run.  A study sampled by `saltelli` has
    indices of Sobol, by `morris` elementary effects, any other rank correlations.  ResultError for a result that is not
    there or known of too few cases, or a design of which cases have failed.
    """
    asked = result_of(study, result)
    found, values, done, sample = asked
    method = asked.method
    if sample is not None and method in DESIGNS:
        if not done.all():
            raise ResultError(
                f"{int((~done).sum())} of {done.size} cases have no '{result}', and a design of {method} needs all\n"
                "    try:      bounds in which every case can be computed, or a sample latin_hypercube"
            )
        bounds = json.loads(found.attrs["bounds"])
        if done.size != _size(method, len(bounds), sample["count"]):
            raise ResultError(f"{study} crosses a design of {method} with lists of values: analyse one value at a time")
        return _of_design(method, bounds, found, values)
    return _ranked(found, values, done)


def result_of(study: str | Path, result: str) -> StudyResult:
    """A number that was kept of each run; ResultError: it is not there, or known of too few cases."""
    found = open_study(study)
    if result not in found or found[result].dims != ("case",) or found[result].dtype.kind != "f":
        numbers = [str(n) for n in found.data_vars if found[n].dims == ("case",) and found[n].dtype.kind == "f"]
        raise ResultError(f"{study} has no result '{result}'\n    expected: one of {', '.join(numbers)}")
    values = found[result].values
    done = (found["status"].values == DONE) & np.isfinite(values)
    if done.sum() < LEAST:
        raise ResultError(f"{int(done.sum())} of {done.size} cases have a '{result}'\n    expected: {LEAST} at least")
    return StudyResult(found, values, done, json.loads(found.attrs.get("sample", "null")))


def _size(method: str, variables: int, count: int) -> int:
    return count * (variables + 2 if method == "saltelli" else variables + 1)


def _of_design(method: str, bounds: dict[str, Any], found: Any, values: np.ndarray) -> list[Influence]:
    optional_package("SALib", "sensitivity", "studies")
    names = list(bounds)
    problem = _problem(names, [(0.0, 1.0)] * len(names))
    if method == "saltelli":
        from SALib.analyze import sobol

        made = sobol.analyze(problem, values, calc_second_order=False, num_resamples=RESAMPLES, seed=0)
        rows = zip(names, made["S1"], made["ST"], made["S1_conf"], strict=True)
        return _in_order([Influence(n, "sobol", float(a), float(b), float(c)) for n, a, b, c in rows], "total")
    from SALib.analyze import morris

    low, high = (np.array([bounds[name][k] for name in names]) for k in (0, 1))
    points = (np.stack([found[name].values for name in names], axis=1) - low) / (high - low)
    made = morris.analyze(problem, points, values, num_levels=LEVELS, num_resamples=RESAMPLES, seed=0)
    rows = zip(names, made["mu_star"], made["sigma"], made["mu_star_conf"], strict=True)
    return _in_order([Influence(n, "morris", float(a), float(b), float(c)) for n, a, b, c in rows], "first")


def _ranked(found: Any, values: np.ndarray, done: np.ndarray) -> list[Influence]:
    from scipy.stats import spearmanr

    rows = []
    for name in json.loads(found.attrs["variables"]):
        column = found[name].values
        if column.dtype.kind == "f" and np.ptp(column[done]) > 0.0 and np.ptp(values[done]) > 0.0:
            rank = spearmanr(column[done], values[done])
            rows.append(Influence(name, "rank", float(rank.statistic), np.nan, float(rank.pvalue)))
    return _in_order(rows, "first")


def _in_order(rows: list[Influence], by: str) -> list[Influence]:
    return sorted(rows, key=lambda row: -abs(getattr(row, by)))


def _problem(names: list[str], bounds: list[tuple[float, float]]) -> dict[str, Any]:
    """What SALib calls a problem."""
    return {"num_vars": len(names), "names": names, "bounds": [list(b) for b in bounds]}
