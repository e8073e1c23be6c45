"""Equilibrium of lines of a system that touch themselves: a damped motion with contact, then Newton with contact.

As of one line (solve.contact_statics), of all lines, points and bodies together.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import chain

import numpy as np

from hybrid.errors import Outcome
from hybrid.kernels.junctions.bodies import MASS, V
from hybrid.kernels.state.books import SHORTEST, blank_books
from hybrid.kernels.state.forces import FRICTION, SELF_FRICTION, WAVES
from hybrid.kernels.state.report import TWIST
from hybrid.kernels.state.state import Floats, State
from hybrid.kernels.step.accept import LARGEST_TWIST
from hybrid.solve.contact_statics import DAMPING, MOST_SPIN, ROAD, calming, stop
from hybrid.solve.joined import JoinedLine, SystemState
from hybrid.solve.self_contact import SelfContact
from hybrid.solve.settling import damped, nudged
from hybrid.solve.shared_contact import SharedContact
from hybrid.solve.system import SystemSolver
from hybrid.solve.system_statics import LineFailed, SystemEquilibrium, damped_bodies

# That of each line with itself (None: it has none), and of lines with each other, where these may touch.
Contacts = Callable[[], tuple[Sequence[SelfContact | None], SharedContact | None]]


class _Moving:
    """The damped motion of a system: `solve.contact_statics.Moving`."""

    def __init__(self, solver: SystemSolver, start: SystemState) -> None:
        self._solver, self._t = solver, 0.0
        self.state, self._other = start, start.copy()

    def step(self, dt: float, before: float) -> tuple[int, int, float]:
        old, new = self.state, self._other
        taken = self._solver.step(old, new, dt, 0.0, before, 0.0, self._t + dt)
        outcome, moved = taken.outcome, 0.0
        if outcome != Outcome.OK:
            return outcome, taken.iterations, 0.0
        for a, b in zip(old.lines, new.lines, strict=True):
            moved = max(moved, float(np.abs(b.r - a.r).max()))
            if dt * float(np.abs(b.w).max()) > MOST_SPIN:
                outcome = Outcome.TWISTED_TOO_FAR
        if self.twisted or outcome != Outcome.OK:
            return Outcome.TWISTED_TOO_FAR, taken.iterations, 0.0
        self.state, self._other, self._t = new, old, self._t + dt
        return outcome, taken.iterations, moved

    def rest(self) -> None:
        self.state.bodies[:, V:] = 0.0
        for state in self.state.lines:
            stop(state)

    @property
    def twisted(self) -> bool:
        return any(work.report[TWIST] > LARGEST_TWIST for work in self._solver.work)

    @property
    def speed(self) -> float:
        return max(float(np.abs(state.v).max()) for state in self.state.lines)


def touching_solver(lines: Sequence[JoinedLine], points: int, bodies: Floats, contacts: Contacts) -> SystemSolver:
    """A solver of lines with contact, whose steps are not held against their energy: what moves is damped."""
    solver = SystemSolver(lines, points, bodies, *contacts())
    books = [blank_books(x.line.h.size)._replace(touch=np.zeros((3, x.line.s.size))) for x in lines]
    for each in books:
        each.clock[SHORTEST] = np.inf
    solver.keep_books(books)
    return solver


def _pushed(x: JoinedLine, state: State, length: float, time_scale: float) -> State:
    """A small push off an unstable equilibrium; ends stay with what they are joined to."""
    pushed = nudged(x.line, state, length, time_scale)
    pushed.v[[0, -1]] = 0.0
    return pushed


def settled_system(
    lines: Sequence[JoinedLine], points: int, bodies: Floats, start: SystemState, contacts: Contacts,
    keeps_turns: Callable[[SystemState], tuple[int, str]], near: bool = False,
) -> SystemEquilibrium:  # fmt: skip
    """Equilibrium of a system with contact of lines with themselves, from a start that is at rest and apart.

    points: how many free points there are; contacts: makes contact, without friction; keeps_turns: a line that has lost
    turns in a state, and how many, empty: none has; near: Newton's method is tried from the start itself first.
    LineFailed: the system does not come to rest, a line has lost turns, or ends with a catenary that is not taut.
    """
    smooth = [x._replace(line=x.line._replace(bits=x.line.bits & ~(WAVES | FRICTION | SELF_FRICTION))) for x in lines]
    found = touching_solver(smooth, points, bodies, contacts)
    mass = sum(float(x.line.mass.sum()) for x in lines) + float(bodies[:, MASS].sum())
    time_scale, path, total = float(np.sqrt(mass * found.length / found.scale)), list[str](), 0
    slow = [x._replace(line=damped(x.line, x.length, time_scale, DAMPING), slackens=True) for x in smooth]
    first = start.copy()
    if not near:
        pushed = [_pushed(x, state, x.length, time_scale) for x, state in zip(smooth, start.lines, strict=True)]
        first = SystemState(pushed, first.bodies)
    moving = _Moving(touching_solver(slow, points, damped_bodies(bodies, time_scale), contacts), first)
    for iterations in chain([0] if near else [], calming(moving, time_scale, found.length)):
        line, lost = keeps_turns(moving.state)
        if lost:  # and will not come back
            raise LineFailed(line, Outcome.TURNS_LOST, None, None, lost)
        taken, states = found.newton(moving.state)
        total += taken.iterations
        line, lost = keeps_turns(states) if taken.outcome == Outcome.OK else (taken.line, "")
        why = lost or (taken.outcome.cause if taken.outcome != Outcome.OK else "found")
        path.append(f"{ROAD}: {why} ({total + iterations} iterations in all)")
        if taken.outcome == Outcome.OK and not lost:
            return SystemEquilibrium(states, tuple(path), total + iterations, taken.residual, found, settled=True)
    outcome = Outcome.TURNS_LOST if lost else taken.outcome
    raise LineFailed(line, outcome, None, None, "\n              ".join(path))
