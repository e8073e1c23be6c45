"""Newton's method: one loop, for a line by itself and for lines that are joined, and entries to it.

Each iteration is one march along s and one substitution back (kernels.march.march), then an update of positions,
tensions, frames and rates.  Of joined lines each is marched by the kernel of a line, which is called by its address.

What it works on, and what is beside the band of a line: kernels.step.line_step.  What couples lines is a border, points and
bodies as well; the loop knows them by their list alone (kernels.junctions.borders).
`plane` and `space`: for which kind of line (kernels.march.march); numba drops what stands behind `is not None` of what is
None, so that neither solution is compiled with the other.

Entries are a step, a static solve and block rows of a configuration of one line: one kernel for each kind of line, so
that neither is compiled for a scene that does not have it.  Networks call it by its address: what stands around the
solver is compiled once for both kinds, and beside them (simulation.first_use).  Both get a table of addresses
(kernels.machine.binding).
"""

from __future__ import annotations

import math
import threading

import numpy as np

from hybrid.kernels.algebra.block_elimination import KEPT, ROW, SIZE, WIDTH, substitute
from hybrid.kernels.algebra.plane import WIDE, substitute_planar
from hybrid.kernels.junctions.bodies import book_bodies, start_here
from hybrid.kernels.junctions.borders import FAR, STRENGTH, TURNED, ask, read_network, task_of
from hybrid.kernels.laws.tension_torque import COUPLES
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.machine.compile import inner, kernel
from hybrid.kernels.march.assembly_plane import march_planar
from hybrid.kernels.march.march import LANES, ROWS, first_bad, march, measure, update
from hybrid.kernels.march.resolution_checks import sharpest_in_plane, sharpest_in_space
from hybrid.kernels.march.zone_torque import torsion_of
from hybrid.kernels.run.network import (
    JUNCTIONS,
    begin_books,
    carry_lines,
    end_network_step,
    first_not_finite,
    give_scheme,
    march_lines,
    predict_step,
    size_up,
)
from hybrid.kernels.state.report import FREE, PLANAR, REMEMBERS, REPORT_SIZE, RESIDUAL, RESIDUAL_NODE
from hybrid.kernels.state.state import Ends, Floats, Line, Sea, State, Work, no_torsion, remembers, slip_size
from hybrid.kernels.step.line_step import (
    ASSEMBLY,
    BALANCE,
    BEFORE_MARCH,
    BLOCK,
    CARRY,
    CORRECTION,
    COUPLE,
    CUT_SHORT,
    EQUILIBRIUM,
    FORCE,
    FORGET,
    HOLD,
    ITERATION,
    LARGEST_TURN,
    MEASURE,
    NO_NUMBERS,
    NOT_CONVERGED,
    NOT_FINITE,
    OK,
    OPEN,
    PREDICT,
    RADIUS,
    RELAX,
    RUN,
    SAFE_PART,
    SINGULAR,
    STEP,
    TURNED_TOO_FAR,
    UPDATE,
    WHOLE,
    Limits,
    Task,
    ask_line,
    begin_line_step,
    blank_job,
    end_line_step,
    has_converged,
    is_march,
    read,
    round_off_tension,
    rubs,
    size_of,
    with_radius,
)
from hybrid.kernels.step.step import States, find_rates
from hybrid.kernels.step.step_control import Scheme, scheme


@inner
def damped_part(part, turn, rub, s, it):
    """The part of corrections that is made in iteration `it`, of a safe part of them that turn a chord by `turn` (rad)."""
    if turn * part > LARGEST_TURN:
        part = LARGEST_TURN / turn
    if rub and s.cv > 0.0 and it in (7, 10, 13):
        part *= 0.5  # it goes round between sticking and sliding, or feet of contact between two pieces
    return part


@inner
def iterate(plane, space, line, lines, task, s):
    """Newton's iterations of a line by itself, or else of lines that are joined; what is not solved is None.

    Returns outcome, iterations, predicted next correction, line and cell, and whether the last iteration is cut short.
    """
    before, left, size = math.inf, math.inf, math.inf
    outcome, it, worst, where, easier = NOT_CONVERGED, 0, -1, -1, False
    while it < task.limits.most and outcome == NOT_CONVERGED:
        it += 1
        if line is not None:
            found, worst, where = correct_line(plane, space, line, task, s, where)
        if lines is not None:
            found, worst, where = correct_lines(lines, task, s, it)
        if found != OPEN:
            outcome, before = found, math.inf
            break
        if line is not None:
            part, size, worst, where = part_of_line(space, line, task, s, it)
            move_line(plane, space, line, task, s, part)
        if lines is not None:
            part, size, worst, where = part_of_lines(lines, task, s, it)
            easier = move_lines(lines, task, s, part)
        outcome, left = has_converged(size, before, it, part, task.limits.tolerance)
        before = size if part == 1.0 else math.inf
        if easier:
            outcome = NOT_CONVERGED
    cut_short = task.cut and outcome == NOT_CONVERGED and it == task.limits.most and before < math.inf
    if cut_short:
        outcome = OK
        if it == 1:  # from one correction the next cannot be predicted: it is this one at most
            left = size
    return outcome, it, left, worst, where, cut_short


# --- a line by itself ----------------------------------------------------------------------------------------


@inner
def correct_line(plane, space, of, task, s, where):
    """One march and the solution of its equations with all borders, into work.x.

    where: the cell or node that was worst.  Returns OPEN, or the outcome with which the solution ends here, the line, and
    the cell or node where it fails; else `where`.
    """
    job, states, _ = of
    line, work, new, bad, good = job.line, job.work, states.new, -1, True
    what = task.what
    ask_line(space, job, states, s, what, BEFORE_MARCH)
    if space is not None:
        bad = march(line, job.sea, job.ends, states.old.r, new, s.cv, s.ca, work)
    if plane is not None:
        bad = march_planar(line, job.sea, job.ends, states.old.r, new, s.cv, s.ca, work)
    if bad < 0 or (what == ITERATION and bad == line.h.shape[0]):  # whose last block is solved with other lines
        ask_line(space, job, states, s, what, BALANCE)
    if bad >= 0:
        if not work.report[RESIDUAL] < math.inf:  # a NaN makes every pivot fail: say so instead of "singular"
            return NOT_FINITE, 0, int(work.report[RESIDUAL_NODE])
        return SINGULAR, 0, bad
    if is_march(what):
        return OK, 0, where
    if space is not None:
        good = substitute(work.X, work.x, False, None)
    if plane is not None:
        good = substitute_planar(plane, work.X, work.x)
    if not good:
        return NOT_FINITE, 0, first_bad(work.x, new.e)
    coupled = ask_line(space, job, states, s, what, COUPLE)
    if what == CORRECTION:
        return OK, 0, where
    return (OPEN if coupled > 0.0 else NOT_CONVERGED), 0, where


@inner
def part_of_line(space, of, task, s, it):
    """The part of the correction that is made, its size, and its cell."""
    job, states, noise = of
    limits = task.limits
    shift, turn, where, pull, big = measure(states.new.e, states.new.T, job.work.x)
    part = 1.0
    if shift > limits.reach and not task.turning:
        part = limits.reach / shift
    safe = ask_line(space, job, states, s, task.what, SAFE_PART)
    part = min(damped_part(part, turn, rubs(job), s, it), safe)
    return part, size_of(turn, shift, pull, big, limits, noise), 0, where


@inner
def move_line(plane, space, of, task, s, part):
    """Move the line by a part of its correction."""
    job, states, _ = of
    update(plane, space, job.line, states.new, s.cv, s.ca, part, task.turning, job.work)


@inner
def solve(plane, space, task, job, states):
    """Do a task at the configuration `new` of `States`, of a step that starts at old.r.

    STEP            predict `new` from `old`, solve, find the rates; books.strains: of elements, empty: not wanted
    EQUILIBRIUM     solve from the prediction in work.u and `new`
    ASSEMBLY        one march, for its report and its block rows; likewise ITERATION
    CORRECTION      one march and the solution of its equations, into work.x

    Returns outcome, iterations, last predicted correction, and the cell or node where it was worst.  A step whose
    prediction or answer turns a chord by more than LARGEST_STEP_TURN is refused: it has missed the motion, and Newton
    may end on a branch that has nothing to do with it.  With task.cut a step whose last iteration made a full correction
    is taken though it has not converged (CUT_SHORT); its report is of the iterate before that correction.
    """
    line, work, new, s = job.line, job.work, states.new, Scheme(task.dt, 0.0, 0.0, 0.0, 0.0, task.cv, task.ca)
    if task.what == STEP:
        safe = ask_line(space, job, states, s, STEP, PREDICT)
        task = with_radius(task, min(task.rho, ask_line(space, job, states, s, STEP, RADIUS)))
        s = scheme(task.rho, task.before, task.rho_before, task.dt)
        far, turn, where = begin_line_step(plane, space, job, states, s, safe)
        if far:
            return TURNED_TOO_FAR, 0, turn, where
    of = (job, states, round_off_tension(line, s.ca, task.limits.scale))
    outcome, it, left, _, where, cut_short = iterate(plane, space, of, None, task, s)
    if task.what == STEP:
        find_rates(space, line, job.sea, states.old, new, work.u, s)
    if not is_march(task.what) or work.couple.shape[0] > 0:  # rates of twist are known now
        ask_line(space, job, states, s, task.what, CARRY)
    ask_line(space, job, states, s, task.what, FORCE)
    if task.what == STEP and outcome == OK:
        far, turn, cell = end_line_step(plane, space, task, job, states, s)
        if far:
            outcome, where = TURNED_TOO_FAR, cell
        elif cut_short:
            outcome = CUT_SHORT
    return outcome, it, left, where


# --- lines that are joined -----------------------------------------------------------------------------------


@inner
def correct_lines(of, task, s, it):
    """Corrections of iteration `it` of all lines and borders, in space; as of `correct_line`."""
    network, _ = of
    tables = network.tables
    line, where = march_lines(network)
    if line >= 0:
        report = read(tables[line]).work.report
        if not report[RESIDUAL] < math.inf:
            return NOT_FINITE, line, int(report[RESIDUAL_NODE])
        return SINGULAR, line, where
    ask(network, BALANCE)
    if task.what == ASSEMBLY:
        carry_lines(tables, s, task.what)  # rates of twist are known now
        return OK, -1, -1
    ask(network, BLOCK)
    if task.what == JUNCTIONS:
        return OK, -1, -1
    if task.what == EQUILIBRIUM and it == 1:
        ask(network, HOLD)
    answer = ask(network, COUPLE)
    if answer == NO_NUMBERS:
        line, where = first_not_finite(tables)
        return NOT_FINITE, line, where
    if not answer > 0.0:
        return (SINGULAR if answer == 0.0 else NOT_CONVERGED), -1, -1
    return (OK if task.what == CORRECTION else OPEN), -1, -1


@inner
def part_of_lines(of, task, s, it):
    """The part of the corrections that is made, and their size, its line and cell."""
    network, rub = of
    shift, turn, size, line, where = size_up(network.tables, s.ca)
    moves = network.moves
    moves[FAR], moves[TURNED] = 0.0, 0.0
    ask(network, MEASURE)
    far, turned = moves[FAR] / task.limits.reach, moves[TURNED]
    shift, turn, size = max(shift, far), max(turn, turned), max(size, max(turned, WHOLE * far))
    part = damped_part(min(1.0, 1.0 / shift) if shift > 0.0 else 1.0, turn, rub, s, it)
    return min(part, ask(network, SAFE_PART)), size, line, where


@inner
def move_lines(of, task, s, part):
    """Lines and borders move by a part of their corrections; whether equations of an equilibrium were easier ones."""
    network, _ = of
    network.asked.part = part
    for l in range(network.tables.shape[0]):
        job = read(network.tables[l])
        update(None, 1, job.line, job.new, s.cv, s.ca, part, False, job.work)
    ask(network, UPDATE)
    if task.what != EQUILIBRIUM:
        return False
    easier = network.moves[STRENGTH] > 1.0
    ask(network, RELAX)
    return easier


@kernel(inlined=False)
def solve_network(table):
    """Do a task (kernels.step.line_step: STEP, EQUILIBRIUM, ASSEMBLY, CORRECTION) with all lines of a network (NetworkJob).

    JUNCTIONS: leave in A the equations of the tensions, points and bodies, with all else eliminated.
    Returns outcome, iterations, predicted next correction, line (-1: a body) and cell or node.
    """
    network = read_network(table)
    tables, task = network.tables, task_of(network.asked)
    s = Scheme(0.0, 0.0, 0.0, 0.0, 0.0, task.cv, task.ca)
    if task.what == STEP:
        task, s, fails, turn, line, cell = predict_step(network, task, network.asked.time)
        if fails:
            return TURNED_TOO_FAR, 0, turn, line, cell
    else:
        start_here(network.old, network.work)
    of = (network, give_scheme(network, task, s))
    ask(network, FORGET)
    outcome, it, left, line, where, cut_short = iterate(None, 1, None, of, task, s)
    if task.what == STEP or task.what == EQUILIBRIUM:
        ask(network, CARRY)
        carry_lines(tables, s, task.what)
    if task.what == STEP:
        bad, line_of_bad, cell = end_network_step(network, task, s, outcome == OK)
        if bad != OK:
            outcome, line, where = bad, line_of_bad, cell
        elif cut_short:
            outcome = CUT_SHORT
    if task.what == ASSEMBLY and outcome == OK:
        begin_books(tables, network.asked.time)
        book_bodies(network.work, 0.0)
    return outcome, it, left, line, where


# --- compiled entries --------------------------------------------------------------------------

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


def solve_task(task: Task, line: Line, sea: Sea, ends: Ends, states: States, work: Work) -> tuple[int, int, float, int]:
    """As kernels.run.newton.solve, by the kernel for the line's kind."""
    check_turns(line, states.new)
    table, (old, new, was, now) = _here.table, states
    table.bind(task=task, line=line, sea=sea, ends=ends, old=old, new=new, was=was, now=now, work=work)
    return (in_plane if line.bits & PLANAR else in_space)(table.numbers)


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


def assembly(line: Line, sea: Sea, ends: Ends, state: State, cv: float, ca: float, work: Work) -> int:
    """The block rows and the report of a state (kernels.march.assembly.march); -1, or a node whose block was singular."""
    return assembly_of_step(line, sea, ends, state, state, cv, ca, work)


def correction(line: Line, sea: Sea, ends: Ends, state: State, cv: float, ca: float, work: Work) -> int:
    """As `assembly`, and the solution into work.x; -1, or a node whose block was singular."""
    return assembly_of_step(line, sea, ends, state, state, cv, ca, work, CORRECTION)


def assembly_of_step(
    line: Line, sea: Sea, ends: Ends, old: State, new: State, cv: float, ca: float, work: Work, what: int = ASSEMBLY
) -> int:
    """As `assembly`, of a step from `old` by work.u to `new`, whose friction and rates count from there."""
    task = Task(what, cv=cv, ca=ca, limits=ONE_MARCH)
    outcome, _, _, where = solve_task(task, line, sea, ends, States(old, new, NO_PUSH, NO_PUSH), work)
    return -1 if outcome == OK else max(where, 0)
