"""Equilibrium of lines that touch: a damped motion with contact until it rests, then Newton with contact.

Statics find an equilibrium from any shape, and Newton's path there may pass a line through itself or another one.  A
motion from a start that is apart does not, so its rest has the loops and crossings that the start and the ends imply.
Friction, between strands and on the bed, is left out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from hybrid.errors import Outcome
from hybrid.kernels.junctions.bodies import MASS, V
from hybrid.kernels.state.books import blank_books
from hybrid.kernels.state.report import FRICTION, SELF_FRICTION, TWIST, WAVES
from hybrid.kernels.state.state import Floats
from hybrid.kernels.step.accept import LARGEST_TWIST
from hybrid.solve.contact_stability import ContactStability
from hybrid.solve.flaws import slack_cell, slack_text
from hybrid.solve.joined import JoinedLine, LineFailed, NetworkState, NetworkTaken
from hybrid.solve.lines_at_rest import LinesAtRest
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.search import MOST_FALLS, PUSHED, SAME, damped_bodies
from hybrid.solve.self_contact import SelfContact
from hybrid.solve.shared_contact import SharedContact
from hybrid.solve.stability import CALM, along, damped, nudged, stop
from hybrid.solve.stability import CONTACT_DAMPING as DAMPING

# Steps of the damped motion, at most; the largest, in time scales: what moves by more meets itself at full speed.
STEPS, LARGEST = 20_000, 0.25
# A motion that has come no further than STALLED time scales in so many tries of steps does not come to rest: what has
# neither tension nor bending snaps from fold to fold.
STALLING, STALLED = 2000, 0.05
# Speed, in lengths per time scale, at which all is stopped (a start that a bed throws up, a strong torque), and the
# most that a cell spins in a step, rad: what is faster could twist from cell to cell by half a turn unseen.
FASTEST, MOST_SPIN = 10.0, 1.0
# Newton with contact is tried where the motion has calmed to these parts of CALM, one after the other.
CALMER = (1.0, 1e-1, 1e-2, 1e-3)
ROAD = "damped motion with contact to rest, then Newton"
# That of each line with itself (None: it has none), and of lines with each other, where these may touch.
Contacts = Callable[[], tuple[Sequence[SelfContact | None], SharedContact | None]]


class _Moving:
    """What moves, damped and with contact, until it rests."""

    def __init__(self, solver: NetworkSolver, start: NetworkState) -> None:
        self._solver, self._t, self.tries = solver, 0.0, 0
        self.state, self._other = start, start.copy()

    def step(self, dt: float, before: float) -> tuple[int, int, float]:
        """One step with rho_inf 0: outcome, iterations, largest way of a node, m.  The state is that after it if OK."""
        old, new, self.tries = self.state, self._other, self.tries + 1
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
        """Stop all motion."""
        self.state.bodies[:, V:] = 0.0
        for state in self.state.lines:
            stop(state)

    @property
    def twisted(self) -> bool:
        """Whether the last step has twisted an element too far."""
        return any(work.report[TWIST] > LARGEST_TWIST for work in self._solver.work)

    @property
    def speed(self) -> float:
        """Largest speed along an axis, m/s."""
        return max(float(np.abs(state.v).max()) for state in self.state.lines)


def _calming(job: _Moving, time_scale: float, length: float) -> Iterator[int]:
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


def touching_solver(lines: Sequence[JoinedLine], points: int, bodies: Floats, contacts: Contacts) -> NetworkSolver:
    """A solver of lines with contact, whose steps are not held against their energy: what moves is damped."""
    solver = NetworkSolver(lines, points, bodies, *contacts())
    books = [blank_books(x.line.h.size)._replace(touch=np.zeros((3, x.line.s.size))) for x in lines]
    for each in books:
        each.clock.shortest = np.inf
    solver.keep_books(books)
    return solver


class _Falls:
    """Equilibria with contact that would not stay, and what leads away from them."""

    def __init__(self, solver: NetworkSolver, time_scale: float) -> None:
        """solver: of equilibria; time_scale: s, of the damped motion."""
        self._solver, self._time_scale = solver, time_scale
        self._stability = ContactStability(solver)
        self._known, self._left = list[NetworkState](), list[NetworkState]()

    @property
    def finds_all(self) -> bool:
        """Whether what would not stay is found in all cases: a motion to rest needs no push."""
        return self._stability.judges and self._stability.is_complete

    @property
    def name(self) -> str:
        """Of the motion that led to the last equilibrium."""
        return f"{ROAD}, {PUSHED}" if self._known else ROAD

    @property
    def unjudged(self) -> str:
        """Why it is not known that the last equilibrium would stay; "": it would."""
        if self._stability.in_hollows:
            return "without friction it would slide but for the spacing of the sample points of contact"
        if self._stability.blurred:
            return "round-off of the bending of so short cells hides it"
        return "" if self.finds_all else "a damped motion with contact, without friction, led there"

    def holds(self, states: NetworkState) -> bool:
        """Whether an equilibrium of the solver would stay, or whether it would is not known."""
        self._stability.in_hollows = self._stability.blurred = False
        if not self._solver.in_contact() or not self._stability.judges:  # it has been judged without contact
            return True
        return self._stability.holds(states)

    def is_new(self, states: NetworkState) -> bool:
        """Whether an equilibrium is none of those that have been left."""
        return not any(self._are_same(states, x) for x in self._known)

    def try_later(self, start: NetworkState) -> None:
        """Begin the next motion there, where the first leads nowhere."""
        self._left = [start]

    def next(self, states: NetworkState | None) -> NetworkState | None:
        """Where the next motion begins, or None; states: an equilibrium that would not stay, None: there is none."""
        if states is not None and self.is_new(states) and len(self._known) < MOST_FALLS:
            square, shapes = self._stability.softest_motion(states)
            self._known.append(states)
            self._left = [self._along(states, shapes, way) for way in (-1.0, 1.0)] if square < 0.0 else []
            self._left.append(self.nudged(states))  # the first, being the smallest: to the nearest rest
        return self._left.pop() if self._left else None

    def _are_same(self, one: NetworkState, other: NetworkState) -> bool:
        apart = max(float(np.abs(a.r - b.r).max()) for a, b in zip(one.lines, other.lines, strict=True))
        return apart <= SAME * self._solver.length

    def _along(self, states: NetworkState, shapes: Sequence[Floats], way: float) -> NetworkState:
        out = states.copy()
        for state, shape in zip(out.lines, shapes, strict=True):
            state.v[:] = way * along(shape, self._solver.length, self._time_scale, DAMPING)
        return out

    def nudged(self, states: NetworkState) -> NetworkState:
        """States with a small push; ends stay with what they are joined to."""
        out = []
        for x, state in zip(self._solver.lines, states.lines, strict=True):
            out.append(nudged(x.line, state, x.length, self._time_scale))
            out[-1].v[[0, -1]] = 0.0
        return NetworkState(out, states.bodies.copy())


def _failed(lines: Sequence[JoinedLine], taken: NetworkTaken, states: NetworkState, path: list[str]) -> LineFailed:
    """The error of a search that ended with a motion in these states: what has no tension has no one place to find."""
    if taken.outcome == Outcome.NOT_CONVERGED:
        for k, (x, state) in enumerate(zip(lines, states.lines, strict=True)):
            if (cell := slack_cell(x, state)) >= 0:
                detail = "\n              ".join([slack_text(x.line, state, x.scale), *path])
                return LineFailed(k, Outcome.SLACK, None, float(x.line.s[cell]), detail)
    return LineFailed(taken.line, taken.outcome, None, None, "\n              ".join(path))


def settled_system(
    lines: Sequence[JoinedLine], points: int, bodies: Floats, start: NetworkState, contacts: Contacts,
    keeps_turns: Callable[[NetworkState], tuple[int, str]], near: bool = False,
) -> LinesAtRest:  # fmt: skip
    """Equilibrium of a system with contact of lines with themselves, from a start that is at rest and apart.

    points: how many free points there are; contacts: makes contact, without friction; keeps_turns: a line that has lost
    turns in a state, and how many, empty: none has; near: Newton's method is tried from the start itself first.
    An equilibrium that would not stay is left by a small push.  LineFailed: the system does not come to rest,
    or only where it would not stay, a line has lost turns, or ends with a catenary that is not taut.
    """
    smooth = [x._replace(line=x.line._replace(bits=x.line.bits & ~(WAVES | FRICTION | SELF_FRICTION))) for x in lines]
    found = touching_solver(smooth, points, bodies, contacts)
    mass = sum(float(x.line.mass.sum()) for x in lines) + float(bodies[:, MASS].sum())
    time_scale, path, total = float(np.sqrt(mass * found.length / found.scale)), list[str](), 0
    slow = [x._replace(line=damped(x.line, x.length, time_scale, DAMPING), slackens=True) for x in smooth]
    slow_bodies = damped_bodies(bodies, time_scale)
    falls = _Falls(found, time_scale)
    first, failed = start.copy(), None
    if not near:  # what lies straight without tension may need the push, too
        falls.try_later(falls.nudged(start))
        first = first if falls.finds_all else falls.next(None) or first
    while True:
        moving = _Moving(touching_solver(slow, points, slow_bodies, contacts), first)
        for iterations in chain([0] if near else [], _calming(moving, time_scale, found.length)):
            line, lost = keeps_turns(moving.state)
            if lost:  # and will not come back; of a motion from elsewhere that says less than the first one did
                raise failed or LineFailed(line, Outcome.TURNS_LOST, None, None, lost)
            taken, states = found.newton(moving.state)
            total += taken.iterations
            line, lost = keeps_turns(states) if taken.outcome == Outcome.OK else (taken.line, "")
            if taken.outcome == Outcome.OK and not lost and not falls.holds(states):
                taken = replace(taken, outcome=Outcome.UNSTABLE)
            why = lost or (taken.outcome.cause if taken.outcome != Outcome.OK else "found")
            path.append(f"{falls.name}: {why} ({total + iterations} iterations in all)")
            if taken.outcome == Outcome.OK and not lost:
                return LinesAtRest(
                    states, tuple(path), total + iterations, taken.residual, found, settled=True,
                    unjudged=falls.unjudged, blurred=frozenset(found.blurred),
                )  # fmt: skip
            if taken.outcome == Outcome.UNSTABLE and falls.is_new(states):
                break
        total += iterations
        near, state = False, None
        if taken.outcome == Outcome.UNSTABLE or moving.tries < STALLING:  # else it comes to no rest from elsewhere
            state = falls.next(states if taken.outcome == Outcome.UNSTABLE else None)
        if lost:
            taken = replace(taken, outcome=Outcome.TURNS_LOST, line=line)
        last = _failed(smooth, taken, moving.state, path)
        if state is None:
            raise last
        first, failed = state, failed or last
