"""Errors of what limits are held against: extremes over all steps and nodes, which outputs do not show.

Runs to compare with keep their extremes as the result does.  Of three, each r times as fine as the one before, the two
changes give the order p, the last one the error:

    symbol   meaning                                                   unit
    x        extremes of a run (hybrid.store.limits.extremes_about)    that of the limit
    c, b     change by the last refinement, and by that before         that of x
    r, q     how many times as fine these have made the run            -
    p        order: c/b = q^-p (1 - r^-p)/(1 - q^-p), largest c and b  -
    e        error of the last run: max(c, b q^-p ..)/(r^p - 1)        that of x

An extreme may agree in two runs by chance, or because it stands at another place: so each place has its own change, and
what the change before foretells of the next counts as well.  p may be far below 1: where cells do not show a bend,
finer ones find a sharper one every time.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hybrid.accuracy.error_order import CLEARLY_FINER, COARSER, blended, refinement
from hybrid.simulation.run_sample import RunSample
from hybrid.store.limits import EXTREMES, OF_SECTIONS, RANGES
from hybrid.store.named_arrays import Tree, matched

# Orders that extremes may show: 0.25 makes an error of five times the last change.
LEAST_ORDER, MOST_ORDER = 0.25, 2.0
# The order where two changes do not show it: that of contact and impact.
ORDER = 1.0
# Below this order cells and steps a third as long leave 0.6 of an error, and further results are not worth their time.
STALLED_ORDER = 0.5
# Runs that are less than so many times as fine as the one before show nothing by what they change.
HARDLY_FINER = 1.1


@dataclass(frozen=True)
class ExtremeErrors:
    """Errors of the extremes of a result, by the names of `extremes_about`."""

    run: RunSample
    errors: Mapping[str, np.ndarray]  # e
    changes: Mapping[str, np.ndarray]  # c
    before: Mapping[str, float]  # the largest b
    refined: float  # r
    of_steps: Mapping[str, float]  # part of the last change that shorter steps have made
    orders: Mapping[str, float]  # p
    results: int = 1  # that there were, each finer than the one before

    @classmethod
    def of(
        cls, result: RunSample, coarse: RunSample, rough: RunSample | None, coarsest: RunSample | None
    ) -> ExtremeErrors:
        """From runs to compare with, as of `Estimate`."""
        changes = _changes(result.extremes, coarse.extremes)
        first = _changes(coarse.extremes, coarsest.extremes) if coarsest is not None else {}
        by_steps = _changes(coarse.extremes, rough.extremes) if rough is not None else {}
        errors, shares, orders = dict[str, np.ndarray](), dict[str, float](), dict[str, float]()
        for name, c in changes.items():
            b, most = first.get(name), float(c.max(initial=0.0))
            p = order_of(most, float(b.max(initial=0.0)), COARSER, COARSER) if b is not None else ORDER
            errors[name], orders[name] = _errors(c, b, p, COARSER, COARSER), p
            shown = float(by_steps[name].max(initial=0.0)) / COARSER**p if name in by_steps else 0.5 * most
            shares[name] = min(1.0, shown / most) if most > 0.0 else 0.0
        before = {name: float(b.max(initial=0.0)) for name, b in first.items() if name in changes}
        return cls(result, errors, changes, before, COARSER, shares, orders)

    def after(self, result: RunSample) -> ExtremeErrors:
        """The same of a finer result than that before."""
        cells, steps = refinement(result.resolution, self.run.resolution)
        found, errors = _changes(result.extremes, self.run.extremes), dict[str, np.ndarray]()
        orders = dict(self.orders)
        share = float(np.mean([*self.of_steps.values()] or [0.0]))
        finer = cells ** (1.0 - share) * steps**share
        found = {name: c for name, c in found.items() if name in self.errors}
        for name, c in found.items():
            b = self.changes[name]
            if finer < CLEARLY_FINER:  # what it changes shows no order, and part of the error
                p = self.orders[name]
                shown, left = c / (max(finer, HARDLY_FINER) ** p - 1.0), self.errors[name] / finer**p
                errors[name] = np.maximum(blended(shown, left, finer, p), c)
                continue
            orders[name] = p = order_of(float(c.max(initial=0.0)), float(b.max(initial=0.0)), finer, self.refined)
            errors[name] = _errors(c, b, p, finer, self.refined)
        before = {name: float(self.changes[name].max(initial=0.0)) for name in found}
        refined = max(finer, HARDLY_FINER)
        count = self.results + 1
        return replace(
            self, run=result, errors=errors, changes=found, before=before, refined=refined, orders=orders, results=count
        )

    def stalls(self, name: str) -> bool:
        """Whether a finer result has shown that finer ones still would tell little of an extreme."""
        return self.results > 1 and self.orders.get(name, MOST_ORDER) < STALLED_ORDER

    def set_apart(self, finer: ExtremeErrors) -> ExtremeErrors:
        """The same where a finer result is no better: no error is less than what they differ by."""
        apart = _changes(finer.run.extremes, self.run.extremes)
        return replace(self, errors={name: np.maximum(e, apart.get(name, e)) for name, e in self.errors.items()})

    def largest(self, name: str) -> float:
        """As of `largest_error`; 0: not estimated."""
        return largest_error(name, self.run.extremes[name], self.errors[name]) if name in self.errors else 0.0

    def changes_no_less(self, name: str) -> bool:
        """Whether the last refinement has changed what is held against a limit by no less than the one before."""
        return float(self.changes[name].max(initial=0.0)) >= self.before.get(name, np.nan)

    def checkpoint(self) -> Tree:
        """All but the run, as named arrays and plain values."""
        return {
            "errors": dict(self.errors),
            "changes": dict(self.changes),
            "before": dict(self.before),
            "refined": self.refined,
            "of_steps": dict(self.of_steps),
            "orders": dict(self.orders),
            "results": self.results,
        }

    @classmethod
    def restored(cls, tree: Any, run: RunSample) -> ExtremeErrors:
        """From a checkpoint; run: the result that it is of.  ValueError: it is none of its."""
        arrays = {name: run.extremes[name] for name in tree["errors"] if name in run.extremes}
        each = {name: 0.0 for name in arrays}
        template: dict[str, Any] = {"errors": arrays, "changes": arrays}
        template |= {"before": dict.fromkeys(tree["before"], 0.0), "results": 1}
        saved = matched(tree, template | {"refined": 1.0, "of_steps": each, "orders": each}, "errors of extremes")
        return cls(run, **saved)


def largest_error(name: str, x: np.ndarray, e: np.ndarray) -> float:
    """By how much more than the largest x of a limit of sections may be used; of `RANGES` the largest error."""
    return float((x + e).max() - x.max()) if name in OF_SECTIONS else float(e.max(initial=0.0))


def figures(extremes: Mapping[str, np.ndarray], errors: Mapping[str, np.ndarray]) -> str:
    """Errors of extremes by name, as the attribute of a result; of a named quantity NAME smallest and NAME largest."""
    found = dict[str, float]()
    for name, e in errors.items():
        if name in OF_SECTIONS or name in RANGES:
            found[name] = largest_error(name, extremes[name], e)
            continue
        of = name.removeprefix(f"{EXTREMES}/")
        found |= {f"{of} {bound}": float(x) for bound, x in zip(("smallest", "largest"), e, strict=True)}
    return json.dumps(found)


def order_of(last: float, before: float, finer: float, finer_before: float) -> float:
    """Order p by the largest changes of two refinements, each by so many times."""
    if not before > 0.0:
        return LEAST_ORDER if last > 0.0 else MOST_ORDER
    orders = np.linspace(MOST_ORDER, LEAST_ORDER, 1001)
    part = _foretold(orders, finer, finer_before)
    return float(orders[min(int(np.searchsorted(part, last / before)), orders.size - 1)])


def _foretold(p: Any, finer: float, before: float) -> Any:
    """Of a change by a refinement what the next one changes, of order p."""
    return before**-p * (1.0 - finer**-p) / (1.0 - before**-p)


def _errors(c: np.ndarray, b: np.ndarray | None, p: float, finer: float, before: float) -> np.ndarray:
    most = c if b is None else np.maximum(c, b * _foretold(p, finer, before))
    return np.asarray(most / (finer**p - 1.0))


def _changes(fine: Mapping[str, np.ndarray], coarse: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Sizes of what extremes of two runs differ by, of those that both have."""
    both = [name for name, x in fine.items() if name in coarse and x.shape == coarse[name].shape]
    return {name: np.abs(fine[name] - coarse[name]) for name in both}
