"""The least value of an expression within limits: sequential quadratic programming with exact derivatives.

At an optimum the slopes of what is minimised are those of the limits that hold it up, each times its multiplier: the
price of the limit, what a unit of it is worth.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import lsq_linear, minimize
from scipy.stats import qmc

from hybrid.designs.case_results import Point
from hybrid.designs.nearest import STEP, Rows, nearest
from hybrid.designs.problem import Constraint, Objective, Problem, Within
from hybrid.errors import ComputationError, SceneError
from hybrid.kernels.state.state import Floats

ITERATIONS = 60  # steps of one search
SEARCHES = 3
# Part of slopes that no limit holds up, below which a search is not begun once more.
HELD = 1e-4
# How many times what the slopes tell what is minimised counts at most, and the part of it that it counts at least: a
# constant that is added to it, such as a price that is paid in any case, would hide what there is to gain.
OF_SLOPES, OF_VALUE = 10.0, 1e-4
# Places between the bounds from which limits are sought that are not kept from where the search began.
STARTS = 6
# What of the slopes at an optimum may be left without a word.
SETTLED = 1e-2
# Steps as parts of unknowns: the first, the longest is that of `nearest`, the shortest before it is given up.
FIRST_STEP, SHORTEST = 0.2, 1e-6
# Of what was foretold: what a step has to gain, and from which on longer ones are believed.
ACCEPTED, TRUSTED = 0.1, 0.7
# Part of a step by which one by other slopes differs that is tried anew.
ALIKE = 0.05
SHRUNK = 0.4  # factor on a box that is made narrower
CUT = 0.2  # and where there is no equilibrium
NEARER = 0.3  # part that a step may miss of coming as near to limits as can be
# Parts of its size by which an unknown has moved from where it began from which on it may have run off.
FAR = 0.3
CURVATURE = 1e-2  # of the model at first
PENALTY = 2.0  # what a part of a limit counts at first,
MOST_PENALTY = 1e6  # and at most


class Price(NamedTuple):
    """What a limit or a bound is worth: change of what is minimised by a unit more of it."""

    active: bool
    price: float


class Optimum(NamedTuple):
    """Where it is, prices of constraints, and of lower and upper bounds of each unknown (n, 2); NaN: not at it.

    left: what of the slopes of what is minimised no limit holds up, as a part of them, of those where the search began
    or of its size there, whichever is largest: 0 at an optimum.  stopped: why the search could not go on beyond it; "":
    there was nothing to gain.  ran_off: numbers of unknowns of which twice as much, or half, is as good.
    """

    point: Point
    prices: tuple[Price, ...]
    bounds: Floats
    left: float
    stopped: str
    ran_off: tuple[int, ...] = ()


def reach(problem: Problem, start: Floats | None = None) -> Rows:
    """The values nearest to keeping all constraints; residuals are by how many parts each is off."""

    def off(x: Floats) -> Rows:
        point = problem.equilibria.point_of(x)
        values = np.array([c.off(point.values[c.row]) for c in problem.constraints])
        return Rows(point, values, lambda: np.stack([_slopes(c, point) for c in problem.constraints]))

    space = problem.space if start is None else problem.space._replace(start=start)
    return nearest(off, space, refresh=problem.refresh)


def reached(problem: Problem, start: Floats) -> Point:
    """The values nearest to keeping all constraints that a search finds.

    From a start and, where that does not do, from others between the bounds.
    """
    space, best = problem.space, reach(problem, start)
    if kept(problem, best.point) or problem.moves or not np.isfinite(space.high - space.low).all():
        return best.point
    for part in qmc.Halton(start.size, scramble=False).random(STARTS + 1)[1:]:  # the first is the corner of all lows
        try:
            other = reach(problem, space.low + part * (space.high - space.low))
        except (ComputationError, SceneError):
            continue
        best = min(best, other, key=lambda x: x.cost)
        if kept(problem, best.point):
            break
    return best.point


def _slopes(constraint: Constraint, point: Point) -> Floats:
    """(n,) slopes of how far a constraint is off: none where it is kept."""
    if constraint.side == 0:
        return np.asarray(point.slopes[constraint.row] / constraint.scale)
    off = constraint.off(point.values[constraint.row]) > 0.0
    return np.asarray(constraint.side * off * point.slopes[constraint.row] / constraint.scale)


def kept(problem: Problem, point: Point) -> bool:
    return all(abs(c.off(point.values[c.row])) <= problem.within.kept for c in problem.constraints)


def is_active(constraint: Constraint, point: Point, within: Within) -> bool:
    return bool(abs(point.values[constraint.row] - constraint.bound) <= within.active * constraint.scale)


def optimum(problem: Problem, objective: Objective) -> Optimum:
    """Where the expression is least and all constraints are kept, or the nearest to keeping them that is found.

    ComputationError, SceneError: where it begins there is no equilibrium, or no such scene.
    """
    x, best, held = problem.space.start, None, SETTLED if problem.moves else HELD
    for _ in range(SEARCHES):
        search = _Search(problem, objective, x)
        point = search.run()
        elsewhere = not kept(problem, point)
        if elsewhere:
            point = reached(problem, point.x)
            if not kept(problem, point):
                break
        if best is not None:
            value, before = objective.value(point), objective.value(best)
            near = problem.within.exact * abs(before)
            if abs(value - before) <= near:  # of two that are as good that whose slopes are held up by more
                best = min(best, point, key=lambda p: priced(problem, objective, p).left)
            if value >= before - near:
                break
        best, x = point, point.x
        if not elsewhere and (search.stopped or priced(problem, objective, point).left < held):
            break
    found = priced(problem, objective, point if best is None else best)
    if not kept(problem, found.point):
        return found
    stopped = search.stopped if found.left > held else ""
    if search.exhausted:
        stopped = f"{ITERATIONS} steps were not enough"
    return found._replace(stopped=stopped, ran_off=_ran_off(problem, objective, found.point))


def _ran_off(problem: Problem, objective: Objective, point: Point) -> tuple[int, ...]:
    """Unknowns that went far, and of which further on nothing is worse: what is minimised is least nowhere on that way.

    Slopes do not tell: those of 1/x fall with x, too.
    """
    space, equilibria, out = problem.space, problem.equilibria, []
    sizes = space.sizes(space.start)
    enough = objective.value(point) + problem.within.exact * size_of(objective, equilibria.point_of(space.start), sizes)
    for i, (x, start) in enumerate(zip(point.x, space.start, strict=True)):
        ahead = 2.0 * x - start if x * start <= 0.0 else 2.0 * x if abs(x) > abs(start) else 0.5 * x
        if abs(x - start) < FAR * sizes[i] or not space.low[i] <= ahead <= space.high[i]:
            continue
        try:
            there = equilibria.point_of(np.where(np.arange(space.start.size) == i, ahead, point.x))
            if objective.value(there) <= enough and kept(problem, there):
                out.append(i)
        except (ComputationError, SceneError):
            continue
    return tuple(out)


def size_of(objective: Objective, point: Point, sizes: Floats) -> float:
    """What changes of what is minimised are parts of."""
    value, slopes = abs(objective.value(point)), float(np.linalg.norm(objective.slopes(point) * sizes))
    return max(min(value, max(OF_SLOPES * slopes, OF_VALUE * value)), 1e-300)


class _Search:
    """Steps within a box in which linear constraints and a quadratic model are believed (Sl1QP of Fletcher).

    Unknowns count in parts of their sizes where it begins, constraints in parts of their bounds, what is minimised in
    parts of its size there.
    """

    def __init__(self, problem: Problem, objective: Objective, start: Floats) -> None:
        self._problem, self._objective = problem, objective
        self._here = problem.equilibria.point_of(start)
        self._sizes = problem.space.sizes(start)
        self._scale = size_of(objective, self._here, self._sizes)
        self._hessian, self._penalty = CURVATURE * np.eye(start.size), PENALTY
        self._watched = set[str]()  # cases that are run whatever is foretold: they refused a step
        self.stopped = ""  # why the last trial could not be computed
        self.exhausted = False  # whether there was something to gain after the last step that it may take

    def run(self) -> Point:
        """The point where nothing is gained any more."""
        width = FIRST_STEP
        for _ in range(ITERATIONS):
            values, slopes = self._rows(self._here)
            step, foretold = self._step(values, slopes, width)
            if foretold <= self._problem.within.exact:
                if self._here.complete() or self._problem.refresh(self._here):
                    continue
                break
            there, gained = self._tried(step)
            if there is not None and gained < ACCEPTED * foretold:
                # a motion that loses more than it was to gain: the step is too long, by whatever slopes
                worst, far = self._worst(there), self._problem.moves and gained < -foretold
                self._watched |= worst
                if self._here.refresh(worst if far else self._problem.missed(self._here, there, 0.0)):
                    values, slopes = self._rows(self._here)
                    again, foretold = self._step(values, slopes, width)
                    if np.abs(again - step).max() > ALIKE * np.abs(step).max():
                        continue  # by slopes that are no secants
                if not far:  # limits are bent: once more with what they came to
                    step, _ = self._step(self._after(there) - slopes @ step, slopes, width)
                    there, gained = self._tried(step)
            missed = set() if there is None else self._problem.missed(self._here, there)
            if there is not None and gained >= ACCEPTED * foretold:
                there.refresh(missed)
                self._learn(there)
                self._here = there
                width = min(2.0 * width, STEP) if gained >= TRUSTED * foretold else width
            elif there is None or gained < -foretold or not self._here.refresh(missed):
                width = (SHRUNK if there is not None else CUT) * min(width, float(np.abs(step).max()))
                if width < SHORTEST:
                    break
        else:
            self.exhausted = True
        self._here.complete()
        return self._here

    def _tried(self, step: Floats) -> tuple[Point | None, float]:
        """The point after a step, and its gain over the present one.

        None: there is no equilibrium, no such scene, or what is minimised is no number.
        """
        space = self._problem.space
        try:
            x = np.clip(self._here.x + self._sizes * step, space.low, space.high)
            point = self._problem.equilibria.point_of(x, moving=self._problem.moving(self._here, x) | self._watched)
            self._objective.parts(point)
        except (ComputationError, SceneError) as error:
            self.stopped = " ".join(str(error).split())
            return None, -np.inf
        self.stopped = ""
        return point, self._merit(self._here) - self._merit(point)

    def _worst(self, point: Point) -> set[str]:
        """The case with the limit that is least kept; none: there are no limits."""
        rows = [c.case for c in self._problem.constraints for _ in range(2 if c.side == 0 else 1)]
        return {rows[int(self._values(point).argmax())]} if rows else set()

    def _merit(self, point: Point) -> float:
        off = float(self._values(point).max(initial=0.0))
        return self._objective.value(point) / self._scale + self._penalty * off

    def _values(self, point: Point) -> Floats:
        """Constraints as numbers (M,) that may not be above 0; targets count to both sides."""
        return self._numbers([point.values[[c.row]] for c in self._problem.constraints])

    def _numbers(self, values: Sequence[Floats]) -> Floats:
        """The same of several values of the result of each constraint."""
        out = []
        for c, each in zip(self._problem.constraints, values, strict=True):
            numbers = [c.evened(x)[0] for x in each.tolist()]
            out += [*numbers, *(-x for x in numbers)] if c.side == 0 else [c.side * x for x in numbers]
        return np.array(out, float)

    def _rows(self, point: Point) -> tuple[Floats, Floats]:
        """The same (M,) of all peaks of each result, and their slopes (M, n)."""
        slopes, peaks = [np.zeros((0, self._sizes.size))], [peaks_of(c, point) for c in self._problem.constraints]
        for c, (values, each) in zip(self._problem.constraints, peaks, strict=True):
            slope = np.array([c.evened(x)[1] for x in values.tolist()])[:, None] * each * self._sizes
            slopes.append(np.concatenate([slope, -slope]) if c.side == 0 else c.side * slope)
        return self._numbers([values for values, _ in peaks]), np.concatenate(slopes)

    def _after(self, there: Point) -> Floats:
        """Constraints (M,) after a step, in the rows of where it is now."""
        values = []
        for c in self._problem.constraints:
            now = self._here.peaks(c.row)
            values.append(there.values[[c.row]] if now is None else there.at_peaks(c.row, now))
        return self._numbers(values)

    def _step(self, values: Floats, slopes: Floats, width: float) -> tuple[Floats, float]:
        """The best step by the model within a box, and by how much it foretells that to be better."""
        gradient = self._objective.slopes(self._here) * self._sizes / self._scale
        most = max(0.0, float(values.max(initial=0.0)))
        p, left = self._of_model(gradient, self._hessian, values, slopes, width)
        if min(left, most) > self._problem.within.kept:  # limits come first: as near to them as the box lets
            _, least = self._of_model(np.zeros_like(gradient), 0.0 * self._hessian, values, slopes, width)
            while left - least > NEARER * (most - least) and self._penalty < MOST_PENALTY:
                self._penalty *= 4.0
                p, left = self._of_model(gradient, self._hessian, values, slopes, width)
        better = -float(gradient @ p + 0.5 * p @ self._hessian @ p) + self._penalty * (most - left)
        return p, better

    def _of_model(
        self, gradient: Floats, hessian: Floats, values: Floats, slopes: Floats, width: float
    ) -> tuple[Floats, float]:
        """The least of a model with a penalty on the worst of constraints, and how far that is off."""
        space, x, n, penalty = self._problem.space, self._here.x, self._sizes.size, self._penalty
        low = np.maximum((space.low - x) / self._sizes, -width)
        high = np.minimum((space.high - x) / self._sizes, width)
        first = np.append(np.zeros(n), max(0.0, float(values.max(initial=0.0))))
        how: dict[str, Any] = {"method": "SLSQP", "options": {"ftol": 1e-14, "maxiter": 200}}
        how["bounds"] = [*zip(low, high, strict=True), (0.0, None)]
        if values.size:
            room, rates = lambda p: p[n] - values - slopes @ p[:n], np.hstack([-slopes, np.ones((values.size, 1))])
            how["constraints"] = [{"type": "ineq", "fun": room, "jac": lambda p: rates}]
        found = minimize(
            lambda p: float(gradient @ p[:n] + 0.5 * p[:n] @ hessian @ p[:n] + penalty * p[n]),
            first,
            jac=lambda p: np.append(gradient + hessian @ p[:n], penalty),
            **how,
        )
        p = np.clip(found.x[:n], low, high)
        return p, max(0.0, float((values + slopes @ p).max(initial=0.0)))

    def _learn(self, there: Point) -> None:
        """Damped BFGS update of the Hessian of the Lagrangian."""
        prices = np.array([-x.price for x in priced(self._problem, self._objective, there).prices])
        s = (there.x - self._here.x) / self._sizes

        def lagrangian(point: Point) -> Floats:
            out = self._objective.slopes(point)
            for c, price in zip(self._problem.constraints, prices, strict=True):
                if price:
                    out = out + price * self._like(point, c.row, there.slopes[c.row])
            return np.asarray(out * self._sizes / self._scale)

        y, B = lagrangian(there) - lagrangian(self._here), self._hessian
        curved, bent = float(s @ y), float(s @ B @ s)
        if bent <= 0.0:
            return
        if curved < 0.2 * bent:
            part = 0.8 * bent / (bent - curved)
            y = part * y + (1.0 - part) * B @ s
        self._hessian = B + np.outer(y, y) / float(s @ y) - np.outer(B @ s, B @ s) / bent

    def _like(self, point: Point, row: int, slopes: Floats) -> Floats:
        """Of the peaks of a result the slopes (n,) that are most like others.

        Where another peak has become the largest, slopes of the largest differ without any curvature.
        """
        peaks = point.peaks(row)
        each = point.slopes[[row]] if peaks is None else peaks.slopes
        return np.asarray(each[int(np.argmin(np.linalg.norm((each - slopes) * self._sizes, axis=1)))])


def peaks_of(constraint: Constraint, point: Point) -> tuple[Floats, Floats]:
    """Values (m,) of the result of a constraint, of an extreme over time of all its peaks, and their slopes (m, n)."""
    row, peaks = constraint.row, point.peaks(constraint.row)
    if peaks is None or constraint.side == 0:
        return point.values[[row]], point.slopes[[row]]
    return peaks.values, peaks.slopes


def priced(problem: Problem, objective: Objective, point: Point) -> Optimum:
    """Prices of what holds the optimum: the multipliers that leave least of the slopes of what is minimised."""
    space, constraints, start = problem.space, problem.constraints, problem.equilibria.point_of(problem.space.start)
    own, first_sizes = space.sizes(point.x), space.sizes(space.start)
    sizes = np.maximum(own, first_sizes)  # of an unknown that goes to 0, where a part of itself changes nothing more
    gradient = objective.slopes(point) * sizes
    columns, least, owners = [], list[float](), list[int]()
    for k, c in enumerate(constraints):  # a peak whose parabola is higher than that of the extreme holds it up, too
        values, slopes = peaks_of(c, point)
        for slope in slopes[np.abs(values - c.bound) <= problem.within.active * c.scale]:
            columns.append((c.side or 1) * slope * sizes)
            least.append(-np.inf if c.side == 0 else 0.0)
            owners.append(k)
    edges = [(i, k) for i, k in np.argwhere(space.at_bounds(point.x)).tolist()]
    for i, k in edges:
        columns.append(np.eye(sizes.size)[i] * (1.0 if k else -1.0) * sizes[i])
        least.append(0.0)
    first = objective.slopes(start) * first_sizes
    size = max(*(float(np.linalg.norm(x)) for x in (gradient, first)), size_of(objective, start, first_sizes))
    multipliers, left = np.zeros(len(columns)), float(np.linalg.norm(gradient)) / size
    if columns:
        matrix = np.stack(columns, axis=1)
        norms = np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
        found = lsq_linear(matrix / norms, -gradient, (np.array(least), np.inf), "bvls")
        multipliers = found.x / norms
        left = float(np.linalg.norm(matrix @ multipliers + gradient)) / size
    prices = [Price(False, 0.0) for _ in constraints]
    for k, multiplier in zip(owners, multipliers, strict=False):
        prices[k] = Price(True, prices[k].price - float((constraints[k].side or 1) * multiplier))
    bounds = np.full((sizes.size, 2), np.nan)
    for (i, k), multiplier in zip(edges, multipliers[len(owners) :], strict=True):
        bounds[i, k] = -multiplier if k else multiplier
    return Optimum(point, tuple(prices), bounds, left, "")
