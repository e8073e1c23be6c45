"""The equilibrium of lines that meet at points, from whatever shapes are given, by the ways of a single line."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from hybrid.errors import ComputationError, Outcome
from hybrid.kernels.junctions.bodies import DAMPING, FRAME, MASS, V
from hybrid.kernels.state.forces import AXIAL_LAW, FLOW, FRICTION, TOUCHES, WAVES
from hybrid.kernels.state.state import NO_ADDRESS, Floats
from hybrid.solve.contact_statics import DAMPING as SLOWED
from hybrid.solve.contact_statics import stop
from hybrid.solve.flaws import fold_text, lowest_tension, slack_text
from hybrid.solve.joined import JoinedLine, SystemState, SystemTaken
from hybrid.solve.laid import laid_without_tension
from hybrid.solve.settling import CALM, GROWN, RELAXING_STEPS, along, damped, growth_time, gyration, nudged
from hybrid.solve.softened import is_in_current, softened, softest, with_current
from hybrid.solve.stability import Stability
from hybrid.solve.statics import (
    GROWING,
    HARDENING,
    LIMP,
    MOST_FALLS,
    NEARLY_STIFF,
    PUSHED,
    SAME,
    STILLED,
    Equilibrium,
)
from hybrid.solve.stepper import Stepper
from hybrid.solve.system import SystemSolver


@dataclass(frozen=True)
class SystemEquilibrium:
    """A static solution: the state, how it was found (`path`), iterations, and its proof, the largest force
    out of balance at a node or a point (N)."""

    state: SystemState
    path: tuple[str, ...]
    iterations: int
    residual: float
    solver: SystemSolver  # whose reports are those of the solution
    settled: bool = False  # True where a damped motion with contact led there
    unjudged: str = ""  # where settled: why it is not known that it would stay
    with_friction: frozenset[int] = frozenset()  # numbers of the lines of which friction on the bed took part
    alone: tuple[Equilibrium, ...] = ()  # of each line where all are joined to nothing that moves: found one by one
    # By number of those that leave friction to the program, why it did not.
    not_settled: Mapping[int, str] = field(default_factory=dict)

    @property
    def pushed(self) -> bool:
        """Whether it is beside an equilibrium that is not stable."""
        return PUSHED in self.path[-1]

    @property
    def summary(self) -> str:
        """How it was found, in one line."""
        failed = len(self.path) - 1
        others = f" (after {failed} other way{'s' * (failed > 1)})" if failed else ""
        return f"{self.path[-1].split(':')[0]}, {self.iterations} iterations{others}"


class LineFailed(ComputationError):
    """A computation of a system stopped: number of the line where it did, -1 for a point."""

    def __init__(self, line: int, *error: object, first: str = "") -> None:
        """error: as of `ComputationError`; first: likewise."""
        super().__init__(*error, first=first)  # type: ignore[arg-type, misc]
        self.line, self.first = line, first


Start = tuple[str, SystemState]
# What a balanced state may be and yet no equilibrium of its lines; the first is what a search that found none tells.
FLAWS = (Outcome.SLACK, Outcome.UNSTABLE, Outcome.FOLDED, Outcome.BURIED)


def solve_system_statics(
    lines: Sequence[JoinedLine], points: int, bodies: Floats, starts: Iterable[Start],
    refused: Callable[[SystemState], tuple[Outcome, int, int]] | None = None,
) -> SystemEquilibrium:  # fmt: skip
    """Equilibrium of a system without friction; starts: shapes to begin with, with their names, made when asked for.

    refused: why an equilibrium is not the one that is sought (OK: it may be), the line, and its node or cell.

    Tries Newton from each start; then, over a seabed, on obstacles or in a current, from soft ones and no current on;
    then a damped motion to rest.  Raises LineFailed when none arrives at lines under tension.
    """
    bits = FRICTION | WAVES
    solver = SystemSolver([x._replace(line=x.line._replace(bits=x.line.bits & ~bits)) for x in lines], points, bodies)
    path: list[str] = []
    total, failed = 0, list[_Attempt]()
    for tried in _attempts(solver, points, starts):
        taken = tried.taken
        total += taken.iterations
        if taken.outcome == Outcome.OK and tried.real and refused is not None:
            outcome, line, where = refused(tried.states)
            taken = replace(taken, outcome=outcome, line=line, where=where)
            tried = tried._replace(taken=taken)
        cause = taken.outcome.cause if taken.outcome else "found"
        cause = cause if tried.real else "stopped on the way"
        path.append(f"{tried.how}: {cause} ({total} iterations in all)")
        if taken.outcome == Outcome.OK:
            residual = solver.evaluate_forces(tried.states, solver.anchor).residual
            return SystemEquilibrium(tried.states, tuple(path), total, residual, solver)
        if tried.real:
            failed.append(tried)
    for worst in (*FLAWS, failed[0].taken.outcome):
        these = [x for x in failed if x.taken.outcome == worst]
        for x in these:
            if worst == Outcome.SLACK and lines[x.taken.line].slackens:
                residual = solver.evaluate_forces(x.states, solver.anchor).residual
                if solver.is_balanced(x.states, residual):
                    return SystemEquilibrium(x.states, tuple(path), total, residual, solver)
        if these:  # the last way, a damped motion, is that of a real line
            raise _failed(lines, these[-1].taken, these[-1].states, path)
    raise AssertionError("one of the ways has failed with the first way's outcome")


def settled_with_friction(
    lines: Sequence[JoinedLine], points: int, bodies: Floats, ways: Mapping[int, str], found: SystemEquilibrium,
    first: SystemState,
) -> SystemEquilibrium:  # fmt: skip
    """The equilibrium with friction of the lines named in `ways`, by number, as of one cable.

    ways: "pull": laid without tension along the equilibrium without friction (`found`), or where a current acts along
    that in still water, then pulled tight, all such lines together; "start", and where that fails: at rest after a
    damped motion from the first shapes; "usual" for all: pulled tight, and nothing else.  LineFailed.
    """
    kept = [x.line.bits & ~WAVES & ~(0 if k in ways else FRICTION) for k, x in enumerate(lines)]
    rough = [x._replace(line=x.line._replace(bits=bits)) for x, bits in zip(lines, kept, strict=True)]
    solver, path, total = SystemSolver(rough, points, bodies), list(found.path), found.iterations
    attempts: list[tuple[str, Callable[[], SystemState]]] = []
    if "start" not in ways.values():
        calm = _in_still_water(rough, points, bodies, found.state)
        how = f"pulled tight against friction from where lines lay without tension{' in still water' if calm else ''}"
        attempts.append((how, lambda: _laid(solver, ways, calm or found.state)))
        if calm is not None:
            grown = f"{how}, while the current grows"
            attempts.append((grown, lambda: _grown(rough, points, bodies, _laid(solver, ways, calm))))
    if set(ways.values()) != {"usual"}:
        attempts.append(("settled with friction from the first shapes", lambda: _stuck(solver, points, ways, first)))
    failed = list[tuple[SystemTaken, SystemState]]()
    for how, start in attempts:
        taken, states = solver.newton(start())
        total += taken.iterations
        path.append(f"{how}: {taken.outcome.cause if taken.outcome else 'found'} ({total} iterations in all)")
        if taken.outcome == Outcome.OK:
            residual = solver.evaluate_forces(states, solver.anchor).residual
            return SystemEquilibrium(states, tuple(path), total, residual, solver, with_friction=frozenset(ways))
        failed.append((taken, states))
    raise _failed(rough, *failed[0], path)


def in_slower_currents(
    lines: Sequence[JoinedLine], points: int, bodies: Floats, states: SystemState, parts: Sequence[float]
) -> list[SystemState] | None:
    """Equilibria without friction that lead from one in a current to those in these parts of it, one from the other.

    None: a line has none, as one that floats.
    """
    smooth = [x._replace(line=x.line._replace(bits=x.line.bits & ~FRICTION)) for x in lines]
    found = [states]
    for part in parts:
        slower = [x._replace(sea=with_current(x.sea, part)) for x in smooth]
        taken, state = SystemSolver(slower, points, bodies.copy()).newton(found[-1])
        if taken.outcome != Outcome.OK:
            return None
        found.append(state)
    return found[1:]


def _in_still_water(
    lines: Sequence[JoinedLine], points: int, bodies: Floats, states: SystemState
) -> SystemState | None:
    """As of one cable (solve.statics), of all lines; None: there is none, or no current acts on any of these."""
    if any(is_in_current(x.line, x.sea) for x in lines):
        for ladder in STILLED:
            if (found := in_slower_currents(lines, points, bodies, states, ladder)) is not None:
                return found[-1]
    return None


def _grown(lines: Sequence[JoinedLine], points: int, bodies: Floats, states: SystemState) -> SystemState:
    """Where friction lets lines come while the current grows to nearly all of it, as far as there are equilibria."""
    for part in GROWING:
        slower = [x._replace(sea=with_current(x.sea, part)) for x in lines]
        taken, found = SystemSolver(slower, points, bodies.copy()).newton(states)
        if taken.outcome != Outcome.OK:
            break
        states = found
    return states


def _laid(solver: SystemSolver, ways: Iterable[int], states: SystemState) -> SystemState:
    """The states with these lines laid where they touch without tension, their ends where they are."""
    out = states.copy()
    for k in ways:
        x = solver.lines[k]
        out.lines[k] = laid_without_tension(x.line, x.sea, x.ends, out.lines[k])  # type: ignore[index]
    return out


def _stuck(solver: SystemSolver, points: int, ways: Iterable[int], first: SystemState) -> SystemState:
    """Where a damped motion comes to rest from the first shapes, in which friction holds what it can of these lines."""
    out = first.copy()
    for k in ways:
        x = solver.lines[k]
        Stepper(x.line, x.length, x.scale).static_friction(x.sea, x.ends, out.lines[k])
    return _relax(solver, points, out)[0]


class _Attempt(NamedTuple):
    """What a way led to; real: with the loads, bed and lines of the scene, not with easier ones on the way to them."""

    how: str
    taken: SystemTaken
    states: SystemState
    real: bool = True


def _failed(
    lines: Sequence[JoinedLine], worst: SystemTaken, states: SystemState, path: Sequence[str]
) -> LineFailed:  # fmt: skip
    """The error of a search of which nothing came, with the place where the worst result has its flaw."""
    if worst.line < 0:
        return LineFailed(-1, worst.outcome, None, 0.0, "\n              ".join(path))
    line, state = lines[worst.line].line, states.lines[worst.line]
    node = min(max(worst.where, 0), line.s.size - 1)
    if worst.outcome == Outcome.FOLDED:
        path = [fold_text(line, state, node), *path]
    if worst.outcome == Outcome.SLACK:
        path = [slack_text(line, state, lines[worst.line].scale), *path]
    return LineFailed(worst.line, worst.outcome, None, float(line.s[node]), "\n              ".join(path))


def _attempts(solver: SystemSolver, points: int, starts: Iterable[Start]) -> Iterator[_Attempt]:
    """Ways to an equilibrium, the quickest first; each is tried only when those before it failed."""
    given: list[Start] = []
    flawed: list[tuple[SystemTaken, SystemState]] = []
    for name, start in starts:
        given.append((name, start))
        yield _Attempt(f"Newton from {name}", *solver.newton(start))
    if any(x.line.bits & (TOUCHES | FLOW) or x.line.element[[0, -1]].any() for x in solver.lines):
        for name, start in given:
            tried = _eased(solver, points, start)
            yield tried._replace(how=f"{tried.how}, from {name}")
    for name, start in given:
        tried = _hardened(solver, points, start)
        yield tried._replace(how=f"{tried.how}, from {name}")
    for name, start in given:
        rest, calm = _relax(solver, points, start)
        taken, states = solver.newton(rest)
        if calm and taken.outcome not in (Outcome.OK, *FLAWS):
            slack, _ = _taut(solver, replace(taken, outcome=Outcome.OK), rest)
            if slack.outcome == Outcome.SLACK:  # what has no tension has no one place that Newton could find
                taken, states = slack, rest
        yield _Attempt(f"damped motion to rest from {name}, then Newton", taken, states)
        flawed.append((taken, states))
    for taken, states in flawed.copy():
        if taken.outcome in (Outcome.UNSTABLE, Outcome.FOLDED):
            rest, _ = _relax(solver, points, pushed(solver, states))
            taken, states = solver.newton(rest)
            yield _Attempt(PUSHED, taken, states)
            flawed.append((taken, states))
    yield from _falls(solver, points, flawed)


class _Fall(NamedTuple):
    """A line that buckles, and its softest motion there, as of `Stability.softest_motion`."""

    square: float
    shape: Floats
    line: int
    states: SystemState

    @classmethod
    def of(cls, solver: SystemSolver, taken: SystemTaken, states: SystemState) -> _Fall | None:
        """None where no line of these states buckles between its ends."""
        if taken.outcome != Outcome.UNSTABLE or taken.line < 0:
            return None
        x, k = solver.lines[taken.line], taken.line
        ends = x.ends._replace(held=np.minimum(x.ends.held, 1))
        stability = Stability(x.line, x.sea, x.length, x.scale)
        return cls(*stability.softest_motion(ends, states.lines[k], gyration(x.line, x.length)), k, states)

    def pushed(self, solver: SystemSolver, way: float, time_scale: float) -> SystemState:
        """The states with a push of the line along that motion (way 1) or against it (-1)."""
        out = self.states.copy()
        out.lines[self.line].v[:] = way * along(self.shape, solver.lines[self.line].length, time_scale, SLOWED)
        return out


def _falls(solver: SystemSolver, points: int, flawed: Sequence[tuple[SystemTaken, SystemState]]) -> Iterator[_Attempt]:
    """Slow falls from states in which a line buckles, as of one cable, from that which grows least first."""
    time_scale = _time_scale(solver)
    met, known = list(flawed), list[_Fall]()
    for _ in range(MOST_FALLS):
        for fall in (_Fall.of(solver, *x) for x in met):
            if fall is not None and fall.square < 0.0 and not any(_same(solver, fall, x) for x in known):
                known.append(fall)
        met.clear()
        left = [x for x in known if np.isfinite(x.square)]
        if not left:
            return
        fall = max(left, key=lambda x: x.square)
        known[known.index(fall)] = fall._replace(square=-np.inf)
        for way in (1.0, -1.0):
            longest = GROWN * growth_time(fall.square, time_scale, SLOWED)
            rest, _ = _relax(solver, points, fall.pushed(solver, way, time_scale), longest)
            met.append(solver.newton(rest))
            yield _Attempt(f"{PUSHED}, along its softest motion", *met[-1])


def _same(solver: SystemSolver, one: _Fall, other: _Fall) -> bool:
    """Whether the line of a fall lies as it does in another."""
    apart = np.abs(one.states.lines[one.line].r - other.states.lines[one.line].r).max()
    return one.line == other.line and float(apart) <= SAME * solver.lines[one.line].length


def _easier(x: JoinedLine, part: float) -> JoinedLine:
    """A line over a softer bed and softer obstacles, in less current, with less bending; part: 0 the easiest to 1."""
    now = x.sea.now.copy()
    now[1] *= part
    sea = softened(x.line, x.sea, softest(x.line, x.sea, x.length) ** (1.0 - part))._replace(now=now)
    if x.rides.size:  # a body would sink through lines that are soft
        sea = sea._replace(obstacles=x.sea.obstacles)
    return x._replace(sea=sea, line=x.line._replace(kb=x.line.kb * LIMP ** (1.0 - part)))


def _eased(solver: SystemSolver, points: int, start: SystemState) -> _Attempt:
    """Continuation from an easy sea to the real one.  A part of the way that fails is halved."""
    states, done, part, steps = start, -1.0, 1.0, 0
    while True:
        goal = min(1.0, done + part)
        last = goal >= 1.0
        here = solver
        if not last:
            here = SystemSolver([_easier(x, max(goal, 0.0)) for x in solver.lines], points, solver.bodies)
        taken, found = here.newton(states) if last else here.balance(states)
        steps += 1
        if taken.outcome == Outcome.OK:
            states, done = found, goal
            part = min(1.5 * part, 0.25) if done <= 0.0 else 1.5 * part
        else:
            part *= 0.5
        if done >= 1.0 or part < 1e-3 or (done < 0.0 and part <= 0.5):
            how = f"from a soft seabed, soft obstacles, no current and little bending in {steps} steps"
            return _Attempt(how, taken, states, last)


def _hardened(solver: SystemSolver, points: int, start: SystemState) -> _Attempt:
    """From soft and short lines, stretched by their start, to the real ones, as of one cable.  A part of the way that
    fails is halved."""
    states, soft, short, hard = start.copy(), [], [], []
    for x, state in zip(solver.lines, states.lines, strict=True):
        state.T[:] = x.scale
        soft.append(np.maximum(x.line.ck, 1.0 / x.scale))
        short.append(0.5 * np.linalg.norm(state.e, axis=1))
        hard.append(np.maximum(x.line.ck, NEARLY_STIFF / x.scale))
    done, part, steps = 0.0, 1.0 / HARDENING, 0
    while True:
        goal = min(1.0, done + part)
        longer, harder = min(1.0, 2.0 * goal), max(0.0, 2.0 * goal - 1.0)
        here = solver
        if goal < 1.0:
            lines = [
                x._replace(
                    line=x.line._replace(
                        h=a ** (1 - longer) * x.line.h**longer, ck=b ** (1 - harder) * c**harder,
                        bits=x.line.bits & ~AXIAL_LAW, law_at=NO_ADDRESS,
                    )
                )
                for x, a, b, c in zip(solver.lines, short, soft, hard, strict=True)
            ]  # fmt: skip
            here = SystemSolver(lines, points, solver.bodies)
        taken, found = here.newton(states) if goal == 1.0 else _taut(here, *here.balance(states))
        steps += 1
        if taken.outcome == Outcome.OK:
            states, done, part = found, goal, 1.5 * part
        else:
            part *= 0.5
        if done >= 1.0 or part < 1e-3:
            return _Attempt(f"soft lines hardened in {steps} steps", taken, found, goal == 1.0)


def _taut(solver: SystemSolver, taken: SystemTaken, states: SystemState) -> tuple[SystemTaken, SystemState]:
    """What balances, with the outcome SLACK where a catenary is not under tension."""
    for k, (x, state) in enumerate(zip(solver.lines, states.lines, strict=True)):
        tension, cell = lowest_tension(x.line, x.sea, state)
        if taken.outcome == Outcome.OK and not tension > 0.0:
            return replace(taken, outcome=Outcome.SLACK, line=k, where=int(cell)), states
    return taken, states


def pushed(solver: SystemSolver, states: SystemState) -> SystemState:
    """States with a small push off an equilibrium that is not stable; ends stay with what they are joined to."""
    out = []
    for x, state in zip(solver.lines, states.lines, strict=True):
        time_scale = float(np.sqrt(float(x.line.mass.sum()) * x.length / x.scale))
        moved = nudged(x.line, state, x.length, time_scale)
        moved.v[[0, -1]] = 0.0
        out.append(moved)
    return SystemState(out, states.bodies.copy())


def _time_scale(solver: SystemSolver) -> float:
    """s, in which the lines and bodies settle."""
    mass = sum(float(x.line.mass.sum()) for x in solver.lines) + float(solver.bodies[:, MASS].sum())
    return float(np.sqrt(mass * solver.length / solver.scale))


def _relax(solver: SystemSolver, points: int, start: SystemState, longest: float = 0.0) -> tuple[SystemState, bool]:
    """Pseudo-transient: rho = 0, doubling steps, mass-proportional damping, until the lines hardly move; and whether
    they came to that.  longest: s, of the steps; at least the time scale."""
    time_scale = _time_scale(solver)
    longest = max(longest, time_scale)
    lines = [x._replace(line=damped(x.line, x.length, time_scale, SLOWED), slackens=True) for x in solver.lines]
    here = SystemSolver(lines, points, damped_bodies(solver.bodies, time_scale))
    old, new = start.copy(), start.copy()
    dt, calm = 1e-3 * time_scale, 0
    for _ in range(RELAXING_STEPS):
        taken = here.step(old, new, dt, 0.0, dt, 0.0)
        if taken.outcome != Outcome.OK:
            dt *= 0.25
            if dt < 1e-9 * time_scale:
                break
            old.bodies[:, V:] = 0.0
            for state in old.lines:
                stop(state)
            continue
        moved = max(float(np.abs(a.r - b.r).max()) for a, b in zip(new.lines, old.lines, strict=True))
        if here.meets:  # what nothing but contact holds may still fall where lines are at rest
            moved = max(moved, float(np.abs(new.bodies[:, :FRAME] - old.bodies[:, :FRAME]).max()))
        old, new = new, old
        calm = calm + 1 if moved < CALM * solver.length * dt / longest else 0
        if taken.iterations <= 5:
            dt = min(2.0 * dt, longest)
        if calm >= 3:
            return old, True
    return old, False


def damped_bodies(bodies: Floats, time_scale: float) -> Floats:
    """Bodies with damping by mass that lets them settle in a time scale, s."""
    slow = bodies.copy()
    slow[:, DAMPING : DAMPING + 36] += 2.0 / time_scale * bodies[:, MASS : MASS + 36]
    return slow
