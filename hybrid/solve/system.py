"""Lines that meet at points: their equilibrium, their consistent accelerations, and their steps in time.

One Newton for all of them (kernels.system).  States go in and come out as of a single line (solve.stepper); a free
point has none of its own, it is the last or first node of every line that is joined to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from operator import is_
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.errors import Outcome
from hybrid.kernels.assembly import JOINED
from hybrid.kernels.binding import Table
from hybrid.kernels.block_elimination import KEPT, ROW, SIZE, WIDTH
from hybrid.kernels.books import Books
from hybrid.kernels.entry import NO_PUSH, workspace
from hybrid.kernels.forces import FRICTION, WAVES
from hybrid.kernels.joined_lines import FUNCTIONAL
from hybrid.kernels.newton import ASSEMBLY, CORRECTION, EQUILIBRIUM, STEP, Limits, Task
from hybrid.kernels.report import LOCAL_ERROR, RESIDUAL
from hybrid.kernels.resolution_checks import lowest
from hybrid.kernels.run import blank_books, blank_job, in_space
from hybrid.kernels.state import Ends, Floats, Line, Sea, State, Work
from hybrid.kernels.step import friction_axes
from hybrid.kernels.system import solve_system
from hybrid.kernels.water import wave_kinematics
from hybrid.solve.stability import ANCHOR
from hybrid.solve.statics import (
    BALANCED,
    BALANCING,
    LEAST_TENSION,
    MOST_ITERATIONS,
)
from hybrid.solve.stepper import HEAVY, REACH
from hybrid.solve.stepper import MOST_ITERATIONS as MOST_OF_STEP


class JoinedLine(NamedTuple):
    """One line of a system."""

    line: Line
    sea: Sea
    ends: Ends
    length: float  # m
    scale: float  # N, tension scale
    floor: float  # N, tension at or below which a catenary cell is slack in motion; -infinity: it may be
    joints: tuple[int, int]  # numbers of the points that start and end are joined to; -1: held


@dataclass(frozen=True)
class SystemTaken:
    """How a solution went: outcome, Newton iterations, predicted next correction, line and cell or node where it was
    worst, the largest residual force at a node or point (N), and the local error of a step (m)."""

    outcome: Outcome
    iterations: int
    correction: float
    line: int
    where: int
    residual: float
    error: float = 0.0


def joined_ends(ends: Ends, joints: tuple[int, int]) -> Ends:
    """The conditions of a line's ends with those that are joined to points; arrays are shared but for `held`."""
    held = ends.held.copy()
    held[[k for k in (0, 1) if joints[k] >= 0]] = JOINED
    return ends._replace(held=held)


def _room(cells: int, joints: tuple[int, int]) -> Work:
    """Arrays for a line, with room for all its factors where its start is joined, for the last where its end is."""
    kept = (cells + 1) * KEPT if joints[0] >= 0 else KEPT if joints[1] >= 0 else 0
    rows = np.zeros((1 if joints[0] >= 0 else 0, SIZE * WIDTH))
    return workspace(cells)._replace(X=np.zeros((cells + 1) * ROW + kept), rows=rows)


class SystemSolver:
    """Solves for all lines of a system at once; owns the work arrays, not the states.

    It works in space: a line whose plane is known must not be marked as planar.
    """

    def __init__(self, lines: Sequence[JoinedLine], points: int) -> None:
        """points: how many free points there are; each must be at an end of some line."""
        self.lines = tuple(lines)
        self.joints: NDArray[np.int64] = np.array([x.joints for x in lines], np.int64).reshape(-1, 2)
        self.work = [_room(x.line.h.size, x.joints) for x in lines]
        self.books = [blank_books(x.line.h.size) for x in lines]  # powers, work, extremes; `keep_books` gives others
        self._floors = np.array([x.floor for x in lines])
        carried = [x.line.h.size + 1 if x.joints[0] >= 0 else 0 for x in lines]
        self._first = np.concatenate([[0], np.cumsum(carried)[:-1]]).astype(np.int64)
        self._columns = np.zeros((3, max(sum(carried), 1), SIZE))
        self._functional, self.net = np.zeros((3, FUNCTIONAL)), np.zeros((points, 3))
        unknowns = int((self.joints[:, 1] >= 0).sum()) + 3 * points
        self._matrix = np.zeros((unknowns + 1, unknowns + 1))
        size = Table(blank_job()).numbers.size
        self._numbers = np.zeros((len(lines), size), np.int64)
        self._tables = [Table(blank_job(), room) for room in self._numbers]
        self._states: tuple[list[State], list[State]] = ([], [])  # that are bound
        self._solver = in_space.address(self._numbers[0])
        mass = sum(float(x.line.mass.sum()) for x in lines)
        self.scale = max(x.scale for x in lines)
        self.length = max(x.length for x in lines)
        self.anchor = ANCHOR * self.scale / (mass * self.length)  # 1/s2
        for x, table, work, books in zip(lines, self._tables, self.work, self.books, strict=True):
            limits = Limits(REACH * x.length, x.scale, 1)
            table.bind(
                task=Task(ASSEMBLY, limits=limits), line=x.line, sea=x.sea, ends=x.ends, work=work, books=books,
                was=NO_PUSH, now=NO_PUSH,
            )  # fmt: skip

    def keep_books(self, books: Sequence[Books]) -> None:
        """Keep powers, work and extremes of the lines in these books from now on."""
        self.books = list(books)
        for table, each in zip(self._tables, books, strict=True):
            table.bind(books=each)

    def _solve(self, task: Task, old: Sequence[State], new: Sequence[State], t: float = 0.0) -> SystemTaken:
        turned = len(self._states[0]) == len(old) and all(map(is_, self._states[0] + self._states[1], [*new, *old]))
        for table, a, b in zip(self._tables, old, new, strict=True):
            if turned and a is not b:  # after a step the states take turns
                table.exchange("old", "new")
            else:
                table.bind(old=a, new=b)
        self._states = [*old], [*new]
        outcome, iterations, left, line, where = solve_system(
            task, t, self._solver, self._numbers, self._numbers.view(np.float64), self.joints, self._floors,
            self._first, self._columns, self._functional, self.net, self._matrix,
        )  # fmt: skip
        return SystemTaken(Outcome(outcome), iterations, left, line, where, self.residual())

    def residual(self) -> float:
        """Largest residual force (N) of the last march, at a node or a point."""
        inside = max(float(work.report[RESIDUAL]) for work in self.work)
        return max(inside, float(np.abs(self.net).max(initial=0.0)))

    # --- motion -------------------------------------------------------------------------------------

    def step(
        self, old: Sequence[State], new: Sequence[State], dt: float, rho: float, before: float, t: float = 0.0,
        most: int = MOST_OF_STEP,
    ) -> SystemTaken:  # fmt: skip
        """From `old` to `new` (overwritten) over dt, with the ends and the sea of the new time in the lines' arrays.

        before: s, the length of the step that led to `old`; 0 if it is a start.  t: s, of `new`, for extremes.
        """
        taken = self._solve(Task(STEP, dt, before, rho, limits=Limits(1.0, 1.0, most)), old, new, t)
        if taken.outcome != Outcome.OK:
            return taken
        error = max(float(work.report[LOCAL_ERROR]) for work in self.work)
        return SystemTaken(
            taken.outcome, taken.iterations, taken.correction, taken.line, taken.where, taken.residual, error
        )

    def consistent_accelerations(
        self, states: Sequence[State], accelerations: Sequence[Floats], t: float = 0.0
    ) -> SystemTaken:
        """Give `states` the accelerations and tensions that positions, velocities and loads imply (solve.stepper).

        accelerations: (2, 3) m/s2 of the held ends of each line.
        """
        for x, table, work, state, given in zip(
            self.lines, self._tables, self.work, states, accelerations, strict=True
        ):
            state.a[:], state.vd[:], state.wa[:], state.wd[:] = 0.0, 0.0, 0.0, 0.0
            l = np.linalg.norm(state.e, axis=1)
            d = state.e / l[:, None]
            e1 = np.diff(state.v, axis=0)
            across = e1 - np.einsum("ij,ij->i", d, e1)[:, None] * d
            gaps = -np.einsum("ij,ij->i", across, across) / (l * HEAVY)
            work.u[:], work.X[:] = 0.0, 0.0
            for k in (0, 1):
                if x.joints[k] < 0:
                    work.u[-k] = -given[k] / HEAVY  # what a held end has still to go is position - r - u
            self._around(x, state, work)
            ends = x.ends._replace(position=state.r[[0, -1]])
            table.bind(work=work._replace(gaps=gaps), ends=ends)
        taken = self._solve(Task(CORRECTION, ca=HEAVY, limits=Limits(1.0, 1.0, 1)), states, states)
        for x, table, work in zip(self.lines, self._tables, self.work, strict=True):
            table.bind(work=work, ends=x.ends)
        if taken.outcome != Outcome.OK:
            return taken
        for x, work, state in zip(self.lines, self.work, states, strict=True):
            state.vd[:] = HEAVY * work.x[:, 1:4]
            state.a[:] = state.vd
            state.T[:] += work.x[1:, 0]
            turning = (x.line.spin == 1) & (x.line.polar > 0)  # a spin without inertia has no acceleration
            state.wd[turning] = HEAVY * work.x[:-1, 4][turning]
            state.wa[:] = state.wd
        return self.evaluate_forces(states, 0.0, t)

    def evaluate_forces(self, states: Sequence[State], ca: float, t: float = 0.0) -> SystemTaken:
        """The forces, reports, powers and residuals of states as they are at t (s).

        ca: 1/s2, of springs of that times the mass.
        """
        for x, work, state in zip(self.lines, self.work, states, strict=True):
            work.u[:] = 0.0
            self._around(x, state, work)
        return self._solve(Task(ASSEMBLY, ca=ca, limits=Limits(1.0, 1.0, 1)), states, states, t)

    def _around(self, x: JoinedLine, state: State, work: Work) -> None:
        if x.line.bits & WAVES:
            wave_kinematics(x.sea, state.r, work.u)
        if x.line.bits & FRICTION:
            friction_axes(x.sea, state.e, state.slip)

    # --- equilibrium --------------------------------------------------------------------------------

    def newton(self, start: Sequence[State]) -> tuple[SystemTaken, list[State]]:
        """Static Newton from `start`; new states are returned, the old ones are left as they were.

        SLACK: a catenary cell of what was found is not under tension.
        """
        new = [state.copy() for state in start]
        for state in new:
            for still in (state.v, state.a, state.vd, state.w, state.wa, state.wd):
                still[:] = 0.0
        taken = SystemTaken(Outcome.NOT_CONVERGED, 0, np.inf, -1, -1, np.inf)
        iterations = 0
        for _ in range(BALANCING):
            for x, work, state in zip(self.lines, self.work, new, strict=True):
                work.u[:] = 0.0
                self._around(x, state, work)
            task = Task(EQUILIBRIUM, ca=self.anchor, limits=Limits(1.0, 1.0, MOST_ITERATIONS))
            taken = self._solve(task, new, new)
            iterations += taken.iterations
            for work, state in zip(self.work, new, strict=True):
                state.r[:] += work.u
                state.vd[:], state.wd[:] = 0.0, 0.0  # of the anchor's springs
            if taken.outcome != Outcome.OK:
                break
            proof = self.evaluate_forces(new, self.anchor)
            greatest = max(float(np.abs(state.T).max()) for state in new)
            taken = SystemTaken(taken.outcome, iterations, taken.correction, taken.line, taken.where, proof.residual)
            if proof.residual <= BALANCED * (greatest + self.scale):
                break
            taken = SystemTaken(
                Outcome.NOT_CONVERGED, iterations, taken.correction, taken.line, taken.where, proof.residual
            )
        if taken.outcome == Outcome.OK:
            for k, (x, state) in enumerate(zip(self.lines, new, strict=True)):
                tension, cell = lowest(x.line, state.T)
                if np.isfinite(x.floor) and not tension > LEAST_TENSION * abs(x.floor):
                    taken = SystemTaken(Outcome.SLACK, iterations, taken.correction, k, cell, taken.residual)
        return taken, new
