"""Equilibrium of a line that touches itself: a damped motion with contact until it rests, then Newton with contact.

Statics find an equilibrium from any shape, and Newton's path there may pass the line through itself.  A motion from a
start that is apart does not, so its rest has the loops and crossings that the start and the ends imply.  Friction,
between strands and on the bed, is left out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import chain
from typing import Protocol

import numpy as np

from hybrid.errors import ComputationError, Outcome
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.march.resolution_checks import lowest
from hybrid.kernels.run import entry
from hybrid.kernels.run.entry import NO_PUSH, Limits, block_rows, in_space, out_of_balance
from hybrid.kernels.state.books import blank_books
from hybrid.kernels.state.forces import FRICTION, SELF_FRICTION, WAVES
from hybrid.kernels.state.report import FORCE_A, NET_A, SELF_CONTACT_ENERGY, TWIST
from hybrid.kernels.state.state import Ends, Floats, Line, Sea, State, Work
from hybrid.kernels.step.accept import LARGEST_TWIST
from hybrid.kernels.step.job import blank_job
from hybrid.kernels.step.newton import EQUILIBRIUM, STEP, Task
from hybrid.solve.self_contact import SelfContact
from hybrid.solve.settling import CALM, damped, nudged, stop
from hybrid.solve.stability import Stability
from hybrid.solve.statics import BALANCED, BALANCING, MOST_ITERATIONS, REACH, Equilibrium
from hybrid.solve.stepper import MOST_ITERATIONS as MOST_OF_STEP
from hybrid.solve.workspaces import workspace_of

# Steps of the damped motion, at most; the largest, in time scales: what moves by more meets itself at full speed.
STEPS, LARGEST = 20_000, 0.25
# A motion that has come no further than STALLED time scales in so many tries of steps does not come to rest: what has
# neither tension nor bending snaps from fold to fold.
STALLING, STALLED = 2000, 0.05
# Speed, in lengths per time scale, at which all is stopped (a start that a bed throws up, a strong torque), and the
# most that a cell spins in a step, rad: what is faster could twist from cell to cell by half a turn unseen.
FASTEST, MOST_SPIN = 10.0, 1.0
# Of the motion by mass, over mass and time scale.  With 2, legs of catenaries that came together at speed folded in
# half of 12 scenes whose mass differs by at most 1 %, and the others took five times as long or more.
DAMPING = 8.0
# Newton with contact is tried where the motion has calmed to these parts of CALM, one after the other.
CALMER = (1.0, 1e-1, 1e-2, 1e-3)
ROAD = "damped motion with contact to rest, then Newton"


@dataclass
class _Job:
    """Steps and equilibria of a line with contact, from states[0] and states[1] in turn."""

    line: Line
    sea: Sea
    ends: Ends
    contact: SelfContact
    states: tuple[State, State]
    limits: Limits  # of a step

    def __post_init__(self) -> None:
        self.work = workspace_of(self.line, keep=True)
        self.books = blank_books(self.line.h.size)._replace(touch=np.zeros((3, self.line.s.size)))
        self.clock, self.count = self.books.clock, self.books.counts
        self.count.controlled = 1  # contact takes the step before as it is told
        self.table = Table(blank_job())
        self.attach()

    def attach(self) -> None:
        """Contact is that of this job from now on."""
        contact_table = self.contact.attach(self.line, self.ends, self.states, self.work, self.books)
        self.table.bind(
            line=self.line, sea=self.sea, ends=self.ends, was=NO_PUSH, now=NO_PUSH, work=self.work,
            contact=self.contact.call, contact_table=contact_table,
        )  # fmt: skip

    @property
    def state(self) -> State:
        """The state now."""
        return self.states[self.count.parity]

    def step(self, dt: float, before: float) -> tuple[int, int, float]:
        """As of `Moving`."""
        clock, count = self.clock, self.count
        old, new = self.states[count.parity], self.states[1 - count.parity]
        clock.try_end, clock.step_before = clock.now + dt, before
        self.table.bind(task=Task(STEP, dt, before, 0.0, limits=self.limits), old=old, new=new)
        outcome, iterations, _, _ = in_space(self.table.numbers)
        if outcome == Outcome.OK and (self.twisted or dt * float(np.abs(new.w).max()) > MOST_SPIN):
            outcome = Outcome.TWISTED_TOO_FAR
        if outcome != Outcome.OK:
            return outcome, iterations, 0.0
        clock.now, count.parity = clock.try_end, 1 - count.parity
        return outcome, iterations, float(np.abs(new.r - old.r).max())

    def rest(self) -> None:
        """As of `Moving`."""
        stop(self.state)

    @property
    def twisted(self) -> bool:
        """As of `Moving`."""
        return bool(self.work.report[TWIST] > LARGEST_TWIST)

    @property
    def speed(self) -> float:
        """As of `Moving`."""
        return float(np.abs(self.state.v).max())

    def equilibrium(self, anchor: float, limits: Limits) -> tuple[Outcome, int]:
        """Newton from the state, which becomes what was found; anchor: 1/s2, of springs of that times the mass."""
        self.contact.forget()
        self.work.u[:] = 0.0
        self.table.bind(task=Task(EQUILIBRIUM, ca=anchor, limits=limits), old=self.state, new=self.state)
        outcome, iterations, _, _ = in_space(self.table.numbers)
        self.state.r[:] += self.work.u
        self.state.vd[:], self.state.wd[:] = 0.0, 0.0
        return Outcome(outcome), iterations

    def lowest(self) -> float:
        """Lowest tension of a catenary cell, N."""
        return float(lowest(self.line, self.state.T)[0])

    def residual(self, anchor: float) -> float:
        """Largest force, N, that is left over at a node of the state, contact included; work.report is its report."""
        work = self.work
        work.u[:] = 0.0
        pushed = self.contact.force(self.state)
        residual, force = left_over(self.line, self.sea, self.ends, self.state, pushed, anchor, work)
        for k in np.flatnonzero(self.ends.held):
            for at in (FORCE_A + 3 * k, NET_A + 3 * k):
                work.report[at : at + 3] += force[k]
        work.report[SELF_CONTACT_ENERGY] = self.contact.energy()
        return residual


class Moving(Protocol):
    """What moves, damped and with contact, until it rests."""

    def step(self, dt: float, before: float) -> tuple[int, int, float]:
        """One step with rho_inf 0: outcome, iterations, largest way of a node, m.  The state is that after it if OK."""

    def rest(self) -> None:
        """Stop all motion."""

    @property
    def twisted(self) -> bool:
        """Whether the last step has twisted an element too far."""

    @property
    def speed(self) -> float:
        """Largest speed along an axis, m/s."""


def left_over(
    line: Line, sea: Sea, ends: Ends, state: State, force: Floats, anchor: float, work: Work
) -> tuple[float, Floats]:
    """Largest force, N, that is left over at a node which nothing holds, contact included; forces (2, 3) N of contact

    on the end nodes.  force: (N+1, 3) N, of contact; work: of the line, with u = 0, whose report becomes that of the
    state without contact.
    """
    rows = block_rows(line)
    if entry.assembly(line, sea, ends, state, 0.0, anchor, work._replace(rows=rows)) >= 0:
        return float("inf"), np.zeros((2, 3))
    left = out_of_balance(line, rows) + force
    left[[-k for k in (0, 1) if ends.held[k]]] = 0.0
    return float(np.abs(left).max()), force[[0, -1]]


def calming(job: Moving, time_scale: float, length: float) -> Iterator[int]:
    """The damped motion: iterations so far, each time that it has calmed by another order, and at its end."""
    dt, before, calm, total, orders = 1e-3 * time_scale, 0.0, 0, 0, list(CALMER)
    gone = 0.0
    for tries in range(STEPS):
        if tries % STALLING == 0 and tries:
            if gone < STALLED * time_scale:
                break
            gone = 0.0
        outcome, iterations, moved = job.step(dt, before)
        total += iterations
        if outcome != Outcome.OK:
            dt *= 0.5
            if outcome == Outcome.TWISTED_TOO_FAR and job.twisted:
                job.rest()
            if dt < 1e-9 * time_scale:
                break
            continue
        before, gone = dt, gone + dt
        if job.speed > FASTEST * length / time_scale:
            job.rest()
            calm = 0
        if iterations <= 5:
            dt = min(1.5 * dt, LARGEST * time_scale)
        calm = calm + 1 if moved < orders[0] * CALM * length * before / time_scale else 0
        if calm >= 3:
            yield total
            orders.pop(0)
            calm = 0
            if not orders:
                return
    yield total


def settled(
    line: Line, sea: Sea, ends: Ends, start: State, scales: tuple[float, float, float], contact: SelfContact,
    keeps_turns: Callable[[State], str], near: bool = False,
) -> Equilibrium:  # fmt: skip
    """Equilibrium of a line with contact, from a start that is at rest and apart.

    scales: length, m, tension scale, N, and tension at or below which a catenary is slack, N; contact: of this line,
    without friction; keeps_turns: what turns a state has lost, empty: none; near: Newton's method is tried from the
    start itself first.  ComputationError: it does not come to rest, has lost turns, or has a slack catenary.
    """
    length, scale, floor = scales
    smooth = line._replace(bits=line.bits & ~(WAVES | FRICTION | SELF_FRICTION))
    time_scale = float(np.sqrt(line.mass.sum() * length / scale))
    first = start.copy() if near else nudged(smooth, start, length, time_scale)
    limits, total, path = Limits(REACH * length, scale, MOST_OF_STEP), 0, []
    moving = _Job(damped(smooth, length, time_scale, DAMPING), sea, ends, contact, (first, first.copy()), limits)
    anchor = Stability(smooth, sea, length, scale).anchor
    for iterations in chain([0] if near else [], calming(moving, time_scale, length)):
        rest = moving.state.copy()
        found, kept = _Job(smooth, sea, ends, contact, (rest, rest.copy()), limits), contact.contact.numbers.copy()
        found.rest()
        outcome, residual, lost = Outcome.NOT_CONVERGED, np.inf, keeps_turns(rest)
        if lost:  # and will not come back
            raise ComputationError(Outcome.TURNS_LOST, None, _place(moving), lost)
        for _ in range(BALANCING):
            outcome, more = found.equilibrium(anchor, Limits(REACH * length, scale, MOST_ITERATIONS))
            total += more
            if outcome != Outcome.OK:
                break
            residual = found.residual(anchor)
            if residual <= BALANCED * (float(np.abs(rest.T).max()) + scale):
                lost = keeps_turns(rest)
                slack = not found.lowest() > floor
                if lost or slack:
                    outcome = Outcome.TURNS_LOST if lost else Outcome.SLACK
                    break
                path.append(f"{ROAD}: found ({total + iterations} iterations in all)")
                touch = found.books.touch[0].copy()
                return Equilibrium(
                    rest, tuple(path), total + iterations, residual, found.work.report.copy(), -1, False, False,
                    touch=touch,
                )  # fmt: skip
            outcome = Outcome.NOT_CONVERGED
        path.append(f"{ROAD}: {lost or outcome.cause} ({total + iterations} iterations in all)")
        contact.contact.numbers[:] = kept
        moving.attach()
    raise ComputationError(outcome, None, _place(moving), "\n              ".join(path))


def _place(job: _Job) -> float:
    """Arc length, m, where contact is strongest; where nothing touches, of the fastest node."""
    touch = np.abs(job.books.touch[0])
    node = touch.argmax() if touch.any() else np.linalg.norm(job.state.v, axis=1).argmax()
    return float(job.line.s[node])


def contact_energy(line: Line, sea: Sea, ends: Ends, state: State, contact: SelfContact) -> float:
    """Energy, J, of contact of a state at rest; 0: nothing touches; infinite: parts are in each other."""
    return _Job(line, sea, ends, contact, (state, state.copy()), Limits(1.0, 1.0, 1)).contact.energy()
