"""Newton's method (GP's quasi-linearisation) around the march, and the homotopy that helps a poor start."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from .conditions import Before, end_rows, meeting, node, spinning
from .fields import CatenaryFields, Clock, Fields, RodFields, cells, moved
from .line import Line
from .march import Linear, march
from .rotations import Array

TOLERANCE = 1.0e-9  # of the correction, scaled: Newton is quadratic, so the error left is its square
RESIDUAL = 1.0e-9  # of the balance, scaled: proof that what the march delivered does solve the equations
ITERATIONS = 40  # poor starts of the gallery need at most 15
TURN_LIMIT = 0.6  # rad per iteration: beyond it the linearised rotation is not valid
KEEP = 0.1  # of a catenary's tension survives an iteration: its sign is the tangent's
DIGITS = 5.0e13  # condition of the far-end fit beyond which fewer than two digits of a correction are left
DROWNED = 1.0e13  # growth beyond which a failure is put down to the march: a bad start is not worth telling apart
FIRST, SMALLEST = 0.25, 1.0e-3  # steps of the homotopy


@dataclass(frozen=True)
class Problem:
    """One balance to solve: statics (clocks, before and drift None) or one time step.

    drift: per piece (n-1, m), added to the residual of the cells.
    """

    line: Line
    t: float = 0.0
    clocks: list[Clock] | None = None
    before: tuple[Before, Before] | None = None
    drift: list[Array] | None = None

    def clock(self, i: int) -> Clock | None:
        return None if self.clocks is None else self.clocks[i]

    def linear(self, fields: list[Fields], scales: list[Array]) -> Linear:
        """Residuals and derivatives about these fields."""
        line, last = self.line, len(fields) - 1
        blocks = [cells(p, y, self.clock(i)) for i, (p, y) in enumerate(zip(line.pieces, fields, strict=True))]
        if self.drift is not None:
            blocks = [(block[0] + d, *block[1:]) for block, d in zip(blocks, self.drift, strict=True)]
        left = [node(p, y, self.clock(i), 0) for i, (p, y) in enumerate(zip(line.pieces, fields, strict=True))]
        right = [node(p, y, self.clock(i), -1) for i, (p, y) in enumerate(zip(line.pieces, fields, strict=True))]
        spin = spinning(line, self.clocks is not None)
        early, late = self.before or (None, None)
        return Linear(
            cells=blocks,
            meetings=[meeting(right[i], left[i + 1]) for i in range(last)],
            start=end_rows(line.start, left[0], -1.0, self.t, early, spin[0], line.length),
            end=end_rows(line.end, right[-1], 1.0, self.t, late, False, line.length),
            spin=spin,
            scales=scales,
        )

    def scales(self, fields: list[Fields]) -> list[Array]:
        """Sizes (m,) of the unknowns per piece: the length of the line, one radian, and the largest force about."""
        length, line = self.line.length, self.line
        rate = 1.0 if self.clocks is None else self.clocks[0].c0
        force = max(np.abs(line.start.force(self.t)).max(), np.abs(line.end.force(self.t)).max())
        for piece, y in zip(line.pieces, fields, strict=True):
            there = y.T if isinstance(y, CatenaryFields) else y.f
            force = max(
                force, np.abs(there).max(), np.abs(piece.weight).max() * length, piece.stiffness.max() / length**2
            )
        rod = np.repeat([length * rate, force, 1.0 / length, rate], 3)
        catenary = np.array([*[length * rate] * 3, force, 1.0, 1.0])
        return [rod if p.rod else catenary for p in line.pieces]


class Outcome(Enum):
    """How a solve ended."""

    OK = "done"
    NOT_CONVERGED = "Newton's method did not converge"
    NOT_FINITE = "a number stopped being finite"
    SLACK = "a catenary lost its tension"
    ILL_CONDITIONED = "the line is too long for literal shooting: the system is ill-conditioned"


class ArbiterError(Exception):
    """Where literal shooting dies: how, at which time (s; None in statics) and arc length (m; None if nowhere)."""

    def __init__(self, outcome: Outcome, t: float | None, s: float | None, detail: str) -> None:
        super().__init__(f"{outcome.value} (t = {t} s, s = {s} m): {detail}")
        self.outcome, self.t, self.s = outcome, t, s


@dataclass(frozen=True)
class Solved:
    """Fields, and how the iteration ended: outcome, iterations, last scaled correction and residual, growth."""

    fields: list[Fields]
    outcome: Outcome
    iterations: int
    step: float
    residual: float
    growth: float
    condition: float
    s: float | None = None

    @property
    def drowned(self) -> bool:
        """The march lost its digits to the growth of its homogeneous solutions."""
        return self.outcome not in (Outcome.OK, Outcome.SLACK) and not self.growth < DROWNED

    def demand(self, t: float | None) -> Solved:
        """Itself if all is well; ArbiterError otherwise."""
        if self.outcome is Outcome.OK:
            return self
        detail = (
            f"literal shooting, iteration {self.iterations}: scaled correction {self.step:.1e}, residual "
            f"{self.residual:.1e}; its homogeneous solutions grew by {self.growth:.1e} along s and the fit of the far "
            f"end has condition {self.condition:.1e}"
        )
        if self.drowned:
            detail += "; a double has 16 digits: the line is too long for literal shooting"
        raise ArbiterError(self.outcome, t, self.s, detail)


def _residuals(linear: Linear) -> list[Array]:
    return [
        linear.start[0],
        *[block[0] for block in linear.cells],
        *[block[0] for block in linear.meetings],
        linear.end[0],
    ]


def _less(linear: Linear, offset: list[Array], part: float) -> Linear:
    """The linear problem with part of an earlier residual taken off: the homotopy's right-hand side."""
    n = len(linear.cells)
    rest = [now - part * then for now, then in zip(_residuals(linear), offset, strict=True)]
    return replace(
        linear,
        start=(rest[0], linear.start[1]),
        cells=[(r, *block[1:]) for r, block in zip(rest[1 : n + 1], linear.cells, strict=True)],
        meetings=[(r, *block[1:]) for r, block in zip(rest[n + 1 : -1], linear.meetings, strict=True)],
        end=(rest[-1], linear.end[1]),
    )


def _largest(linear: Linear, problem: Problem) -> float:
    """Largest residual, scaled: place by length, force by force, moment by both, turns by one radian."""
    length, move, force = problem.line.length, linear.scales[0][0], linear.scales[0][3]
    rate = 1.0 if problem.clocks is None else problem.clocks[0].c0
    rows = np.repeat([move, force, force * length, rate], 3)
    size = 0.0
    for residual, *_ in [*linear.cells, *linear.meetings]:
        size = max(size, float(np.abs(residual / rows[: residual.shape[-1]]).max()))
    for (residual, _), hold in ((linear.start, problem.line.start), (linear.end, problem.line.end)):
        top, low = rows[0] if hold.place else rows[3], rows[9] if hold.tangent else rows[6]
        # the row of torsion, last, is a moment or a turn: whichever is more forgiving
        here = np.array([top, top, top, low, low, max(low, rows[6])])
        size = max(size, float(np.abs(residual / here[: len(residual)]).max()))
    return size


def _shorten(fields: list[Fields], change: list[Array], scales: list[Array]) -> float:
    """Factor (0..1] on the correction that keeps turns below TURN_LIMIT and catenaries pulling."""
    factor = 1.0
    for y, d, scale in zip(fields, change, scales, strict=True):
        if isinstance(y, RodFields):
            turn = np.linalg.norm(d[:, 9:], axis=1).max() / scale[9]
        else:
            turn = np.abs(d[:, 4:]).max()
            falling = d[:, 3] < -(1.0 - KEEP) * y.T
            if falling.any():
                factor = min(factor, float(((1.0 - KEEP) * y.T[falling] / -d[falling, 3]).min()))
        if turn > TURN_LIMIT:
            factor = min(factor, TURN_LIMIT / turn)
    return factor


def _slack(fields: list[Fields], force: float) -> bool:
    """Has a catenary lost its tension?  Its end nodes may: a free end has none."""
    return any(isinstance(y, CatenaryFields) and y.T[1:-1].size and y.T[1:-1].min() < 1.0e-6 * force for y in fields)


def newton(
    problem: Problem,
    fields: list[Fields],
    offset: list[Array] | None = None,
    part: float = 0.0,
    limit: int = ITERATIONS,
    marches: int | None = None,
) -> Solved:
    """Solve residual(fields) = part * offset from these fields on.

    `marches`: exactly so many, with no check of what they delivered (for the figure of growth).
    """
    step, growth, condition, residual = np.inf, 1.0, 1.0, np.inf
    outcome, where, i = Outcome.NOT_CONVERGED, None, 0
    with np.errstate(all="ignore"):
        for i in range(limit + 1):
            scales = problem.scales(fields)
            linear = problem.linear(fields, scales)
            if offset is not None:
                linear = _less(linear, offset, part)
            residual = _largest(linear, problem)
            if marches is None and step < TOLERANCE and residual < RESIDUAL:
                outcome = Outcome.OK if condition < DIGITS else Outcome.ILL_CONDITIONED
                break
            if i == (limit if marches is None else marches):
                outcome = Outcome.NOT_CONVERGED if marches is None else Outcome.OK
                break
            try:
                fit = march(linear)
            except np.linalg.LinAlgError:
                outcome, condition = Outcome.ILL_CONDITIONED, np.inf
                break
            growth, condition = fit.growth, fit.condition
            if not all(np.isfinite(d).all() for d in fit.change):
                outcome = Outcome.ILL_CONDITIONED if condition > DIGITS or not growth < DROWNED else Outcome.NOT_FINITE
                break
            sizes = [np.abs(d / scale).max(1) for d, scale in zip(fit.change, scales, strict=True)]
            worst = max(range(len(sizes)), key=lambda p: float(sizes[p].max()))
            where, step = float(problem.line.pieces[worst].s[np.argmax(sizes[worst])]), float(sizes[worst].max())
            factor = _shorten(fields, fit.change, scales)
            fields = [
                moved(y, factor * d, problem.clock(p)) for p, (y, d) in enumerate(zip(fields, fit.change, strict=True))
            ]
    if outcome in (Outcome.NOT_CONVERGED, Outcome.ILL_CONDITIONED) and _slack(fields, scales[0][3]):
        outcome = Outcome.SLACK
    elif outcome is Outcome.NOT_CONVERGED and (condition > DIGITS or not growth < DROWNED):
        outcome = Outcome.ILL_CONDITIONED
    if outcome is Outcome.OK:
        where = None
    return Solved(fields, outcome, i, step, residual, growth, condition, where)


def homotopy(problem: Problem, fields: list[Fields]) -> Solved:
    """Newton along a path: the residual of the start is taken away little by little.

    From an unstressed straight rod this is load stepping, ends moving into place included; from a
    taut straight catenary it is the exchange of a fictitious load for the true one.
    """
    offset = _residuals(problem.linear(fields, problem.scales(fields)))
    done, size, count = 0.0, FIRST, 0
    solved = Solved(fields, Outcome.NOT_CONVERGED, 0, np.inf, np.inf, 1.0, 1.0)
    while done < 1.0:
        goal = min(1.0, done + size)
        solved = newton(problem, fields, offset, 1.0 - goal, limit=12 if goal < 1.0 else ITERATIONS)
        count += solved.iterations
        if solved.outcome is Outcome.OK:
            fields, done, size = solved.fields, goal, 1.6 * size
        else:
            size *= 0.4
            if size < SMALLEST:
                break
    return replace(solved, iterations=count)
