"""Compiled entries to the march of one line: a step, a static solve, block rows of a configuration.

One kernel for each kind of line, so that neither is compiled for a scene that does not have it.  Networks call it by its
address: what stands around the solver is compiled once for both kinds, and beside them (simulation.first_use).  Both get
a table of addresses (kernels.machine.binding).
"""

from __future__ import annotations

import threading

import numpy as np

from hybrid.kernels.algebra.block_elimination import KEPT, ROW, SIZE, WIDTH
from hybrid.kernels.algebra.plane import WIDE
from hybrid.kernels.laws.tension_torque import COUPLES
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.march.march import LANES, ROWS
from hybrid.kernels.march.resolution_checks import sharpest_in_plane, sharpest_in_space
from hybrid.kernels.march.zone_torque import torsion_of
from hybrid.kernels.run.newton import solve
from hybrid.kernels.state.report import FREE, PLANAR, REMEMBERS, REPORT_SIZE
from hybrid.kernels.state.state import (
    Ends,
    Floats,
    Line,
    Sea,
    State,
    Work,
    no_torsion,
    remembers,
    slip_size,
)
from hybrid.kernels.step.line_step import (
    ASSEMBLY,
    CORRECTION,
    EQUILIBRIUM,
    OK,
    RUN,
    STEP,
    Limits,
    Task,
    blank_job,
    read,
)
from hybrid.kernels.step.step import States

NO_PUSH: Floats = np.zeros((0, 4))
NO_STRAINS: Floats = np.zeros((0, 3))
ONE_MARCH = Limits(1.0, 1.0, 1)


@inner
def solve_job(plane, space, job):
    """Do the task of a job for one kind of line (kernels.march.march); of a run, the step that it tries.

    Returns as kernels.run.newton.solve.
    """
    task, clock, old, new, was, now = job.task, job.books.clock, job.old, job.new, job.was, job.now
    if task.what == RUN:
        if job.books.counts.parity:
            old, new, was, now = job.new, job.old, job.now, job.was
        dt = clock.try_end - clock.now
        limits, cut = task.limits, job.books.counts.most_iterations > 0
        if cut:
            left = job.books.counts.most_iterations - job.books.counts.taken
            limits = Limits(limits.reach, limits.scale, min(left, limits.most), limits.tolerance)
        fixed = job.books.counts.controlled == 0
        task = Task(STEP, dt, clock.step_before, clock.rho, 0.0, 0.0, False, limits, cut, clock.rho_before, fixed)
    return solve(plane, space, task, job, States(old, new, was, now))


@kernel
def in_plane(table):
    job = read(table)
    return solve_job(job.line.plane, None, job)


@kernel
def in_space(table):
    return solve_job(None, 1, read(table))


class _OfThread(threading.local):
    """The table of the thread that asks; it keeps what was bound last."""

    def __init__(self) -> None:
        self.table = Table(blank_job)


_here = _OfThread()


def _solve(task: Task, line: Line, sea: Sea, ends: Ends, states: States, work: Work) -> tuple[int, int, float, int]:
    """As kernels.run.newton.solve, by the kernel for the line's kind."""
    check_turns(line, states.new)
    table, (old, new, was, now) = _here.table, states
    table.bind(task=task, line=line, sea=sea, ends=ends, old=old, new=new, was=was, now=now, work=work)
    found: tuple[int, int, float, int] = (in_plane if line.bits & PLANAR else in_space)(table.numbers)
    return found


def check_turns(line: Line, state: State) -> None:
    """ValueError: a state does not know the turns of the zones of its line that a torque passes through."""
    if state.turn.shape[0] != line.torsion.shape[0]:
        raise ValueError(f"a state with {state.turn.shape[0]} turns on a line that has {line.torsion.shape[0]}")
    if state.slow.shape[0] != line.law.shape[0]:
        raise ValueError(f"a state with {state.slow.shape[0]} mean tensions on a line that has {line.law.shape[0]}")
    if state.peak.shape[0] != (line.law.shape[0] if remembers(line) else 0):
        raise ValueError(f"a state with {state.peak.shape[0]} highest mean tensions on a line that has other ones")
    if state.grip.shape[1] != 6 * line.moved.size:
        raise ValueError(
            f"a state with grips of {state.grip.shape[1] // 6} obstacles, of which {line.moved.size} are known"
        )
    if (state.sheave.shape[0] > 0) != bool((line.moved == FREE).any()):
        raise ValueError("a state with angles of sheaves that its line does not have, or without those that it has")
    if state.layers.size != slip_size(line) * line.s.size:
        raise ValueError("a state with layers that slip, which its line does not have, or without those that it has")
    if (state.soil.shape[0] > 0) != bool(line.bits & REMEMBERS):
        raise ValueError("a state that remembers soil, which its line does not lie on, or one that does not")
    if state.wake.shape[0] != line.wake_law.shape[0]:
        raise ValueError(
            f"a state with {state.wake.shape[0]} phases of lift on a line that has {line.wake_law.shape[0]}"
        )


def sharpest(line: Line, ends: Ends, state: State) -> tuple[float, int, float, int]:
    """Largest bend and twist of an element, rad, and their nodes (kernels.march.resolution_checks)."""
    if line.bits & PLANAR:
        return sharpest_in_plane(line, ends, state.e, state.T, state.a1, NO_STRAINS)
    return sharpest_in_space(line, ends, state.e, state.T, state.a1, NO_STRAINS)


def workspace_of(line: Line, keep: bool = False) -> Work:
    """Arrays for a line, with what a torque through its catenary zones takes; keep: as of `workspace`."""
    work = workspace(line.h.size, keep or bool(line.torsion.size))
    if line.tension_twist.size:
        work = work._replace(couple=np.zeros((line.s.size, COUPLES)))
    if line.torsion.size and not line.bits & PLANAR:
        work = work._replace(torsion=torsion_of(line, keep))
    return work


def workspace(n_cells: int, keep: bool = False) -> Work:
    """Arrays for a line of `n_cells` cells; keep: with room for the factors that another right-hand side needs."""
    return Work(
        u=np.zeros((n_cells + 1, 3)),
        x=np.zeros((n_cells + 1, SIZE)),
        W=np.zeros(SIZE * WIDTH),
        X=np.zeros((n_cells + 1) * (ROW + KEPT if keep else ROW)),
        report=np.zeros(REPORT_SIZE),
        gaps=np.zeros(0),
        rows=np.zeros((0, SIZE * WIDTH)),
        torsion=no_torsion(),
        couple=np.zeros((0, COUPLES)),
        lanes=np.zeros(ROWS * LANES),
    )


def block_rows(line: Line) -> Floats:
    """Room for the block rows of a line, for `work.rows`."""
    n = line.s.size
    return np.zeros((n, 3 * WIDE if line.bits & PLANAR else SIZE * WIDTH))


def out_of_balance(line: Line, rows: Floats) -> Floats:
    """Force (N+1, 3) N left over at every node of which the block rows are known."""
    if line.bits & PLANAR:
        return np.asarray(-rows.reshape(-1, 3, WIDE)[:, 1:, -1] @ line.plane[:2])
    return np.asarray(-rows.reshape(-1, SIZE, WIDTH)[:, 1:4, -1])


def step_task(dt: float, before: float, rho: float, limits: Limits, rho_before: float) -> Task:
    """The task of one step: s, its length and that of the one before; rho, rho_before: their spectral radii."""
    return Task(STEP, dt, before, rho, limits=limits, rho_before=rho_before)


def step(task: Task, line: Line, sea: Sea, ends: Ends, states: States, work: Work) -> tuple[int, int, float, int]:
    """One step in time from states.old to states.new (overwritten)."""
    return _solve(task, line, sea, ends, states, work)


def equilibrium(
    line: Line, sea: Sea, ends: Ends, state: State, ca: float, limits: Limits, turning: bool, work: Work
) -> tuple[int, int, float, int]:
    """One static solve from state.r + work.u; ca: 1/s2, of springs of that times the mass."""
    task = Task(EQUILIBRIUM, ca=ca, turning=turning, limits=limits)
    return _solve(task, line, sea, ends, States(state, state, NO_PUSH, NO_PUSH), work)


def assembly(line: Line, sea: Sea, ends: Ends, state: State, cv: float, ca: float, work: Work) -> int:
    """The block rows and the report of a state (kernels.march.assembly.march); -1, or a node whose block was singular."""
    return _one_march(ASSEMBLY, line, sea, ends, state, cv, ca, work)


def correction(line: Line, sea: Sea, ends: Ends, state: State, cv: float, ca: float, work: Work) -> int:
    """As `assembly`, and the solution into work.x; -1, or a node whose block was singular."""
    return _one_march(CORRECTION, line, sea, ends, state, cv, ca, work)


def assembly_of_step(line: Line, sea: Sea, ends: Ends, old: State, new: State, cv: float, ca: float, work: Work) -> int:
    """As `assembly`, of a step from `old` by work.u to `new`, whose friction and rates count from there."""
    task = Task(ASSEMBLY, cv=cv, ca=ca, limits=ONE_MARCH)
    outcome, _, _, where = _solve(task, line, sea, ends, States(old, new, NO_PUSH, NO_PUSH), work)
    return -1 if outcome == OK else max(where, 0)


def _one_march(what: int, line: Line, sea: Sea, ends: Ends, state: State, cv: float, ca: float, work: Work) -> int:
    task = Task(what, cv=cv, ca=ca, limits=ONE_MARCH)
    outcome, _, _, where = _solve(task, line, sea, ends, States(state, state, NO_PUSH, NO_PUSH), work)
    return -1 if outcome == OK else max(where, 0)
