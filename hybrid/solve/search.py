"""Ways to equilibria of lines, of one or of several that meet: Newton from the shapes given, then slow roads.

One search for all lines (solve.network_solver).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.errors import Outcome
from hybrid.kernels.junctions.bodies import DAMPING, FRAME, MASS, V
from hybrid.kernels.laws.obstacles import half_thickness
from hybrid.kernels.laws.seabed import PART, depth_under, planes_under
from hybrid.kernels.state.report import (
    AXIAL_LAW,
    FLOW,
    FREE,
    MOVES,
    OBSTACLES,
    ONSET_OF,
    SEABED,
    SOIL,
    STIFFNESS,
    TOUCHES,
)
from hybrid.kernels.state.state import NO_SHEAVES, Floats, Line, Sea, State
from hybrid.model.sea import ONSET
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.stability import (
    CALM,
    GROWN,
    RELAXING_STEPS,
    Stability,
    along,
    at_rest,
    damped,
    fold_text,
    growth_time,
    gyration,
    lowest_tension,
    nudged,
    on_obstacles,
    slack_text,
    stop,
)
from hybrid.solve.stepper import JoinedLine, LineFailed, NetworkState, NetworkTaken, Solution, hold_by_friction

LOAD_STEPS = (1, 8, 64)  # ladders of end loads tried when Newton does not get there in one go
NEARLY_STIFF = 1e-6  # strain at the tension scale at which hardening ends; the last part of the way is Newton's
HARDENING = 8  # parts of the way from a soft, short line to the real one; a part that fails is halved
LEAST_PART = 1e-3  # of a way that is gone in parts: a smaller one is not tried
# The way to an equilibrium that has a mirror image on the other side, or may have: which it is hangs on round-off.
PUSHED = "pushed off an unstable equilibrium"
# Of the length: unstable equilibria that are nearer than this are one; the most of them that a line is pushed off.
SAME, MOST_PUSHES = 1e-3, 12
# The most of them that it is let fall from, slowly, to both sides, those that grow least first.
MOST_FALLS = 16
# Parts of a current with which equilibria lead to that in still water: at once, else by and by; and with which one with
# friction follows it up again where it is not found at once.
STILLED = ((0.0,), (0.8, 0.6, 0.4, 0.2, 0.1, 0.0))
GROWING = (0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9)  # of the current, up again
PULLED = "pulled tight against friction"
LIMP = 1e-3  # part of the bending stiffness with which a continuation begins
# What a balanced state may be and yet no equilibrium; the first is what a search that found none tells.
FLAWS = (Outcome.SLACK, Outcome.UNSTABLE, Outcome.FOLDED, Outcome.BURIED)

Start = tuple[str, NetworkState]


def summary_of(path: Sequence[str], iterations: int) -> str:
    """How an equilibrium was found, in one line."""
    failed = len(path) - 1
    others = f" (after {failed} other way{'s' * (failed > 1)})" if failed else ""
    return f"{path[-1].split(':')[0]}, {iterations} iterations{others}"


class Tally:
    """Newton's iterations so far."""

    total = 0

    def counted(self, solution: Solution) -> Solution:
        """The same solution, counted."""
        self.total += solution[0].iterations
        return solution


class Attempt(NamedTuple):
    """What a way led to; real: with the loads, bed and lines of the scene, not with easier ones on the way to them."""

    how: str
    taken: NetworkTaken
    states: NetworkState
    solver: NetworkSolver
    real: bool = True


def first_sound(
    ways: Iterable[Attempt],
    tally: Tally,
    refused: Callable[[NetworkState], tuple[Outcome, int, int]] | None = None,
    before: Sequence[str] = (),
) -> tuple[tuple[str, ...], Attempt]:
    """The first attempt that leads to an equilibrium, or to a slack one that is taken, and how those before it went.

    refused: why an equilibrium is not the one that is sought (OK: it may be), the line, and its node or cell; before:
    how it went until then.  LineFailed: none does, with what says most about the lines.
    """
    path, failed = [*before], list[Attempt]()
    for tried in ways:
        taken = tried.taken
        if taken.outcome == Outcome.OK and tried.real and refused is not None:
            outcome, line, where = refused(tried.states)
            taken = replace(taken, outcome=outcome, line=line, where=where)
            tried = tried._replace(taken=taken)
        cause = "stopped on the way" if not tried.real else taken.outcome.cause if taken.outcome else "found"
        path.append(f"{tried.how}: {cause} ({tally.total} iterations in all)")
        if taken.outcome == Outcome.OK and tried.real:
            return tuple(path), tried
        if tried.real:
            failed.append(tried)
    for worst in (*FLAWS, failed[0].taken.outcome):
        these = [x for x in failed if x.taken.outcome == worst]
        for x in sorted(these, key=_compression) if worst == Outcome.SLACK else ():
            slackens = x.solver.lines[x.taken.line].slackens
            if slackens and x.solver.is_balanced(x.states, x.solver.proof(x.states)):
                return tuple(path), x
        if these:
            raise _failed(these[0], path)
    raise AssertionError("one of the ways has failed with the first way's outcome")


def _compression(found: Attempt) -> float:
    """The largest compression (N) of a catenary: a slack shape with more is a strut rather, which no cable is."""
    each = zip(found.solver.lines, found.states.lines, strict=True)
    return max(-float(lowest_tension(x.line, x.sea, state)[0]) for x, state in each)


def _failed(worst: Attempt, path: Sequence[str]) -> LineFailed:
    """The error of a search of which nothing came, with the place where the worst result has its flaw."""
    taken = worst.taken
    if taken.line < 0:
        return LineFailed(-1, taken.outcome, None, 0.0, "\n              ".join(path))
    x, state = worst.solver.lines[taken.line], worst.states.lines[taken.line]
    node = min(max(taken.where, 0), x.line.s.size - 1)
    if taken.outcome == Outcome.FOLDED:
        path = [fold_text(x.line, state, node), *path]
    if taken.outcome == Outcome.SLACK:
        path = [slack_text(x.line, state, x.scale), *path]
    return LineFailed(taken.line, taken.outcome, None, float(x.line.s[node]), "\n              ".join(path))


# --- with friction --------------------------------------------------------------------------------------


def stuck(
    rough: NetworkSolver, lines: Iterable[int], first: NetworkState, shape: str, tally: Tally
) -> Iterator[Attempt]:
    """Where friction alone keeps these lines: they settle from their start, with friction, then Newton from there."""
    out = first.copy()
    for k in lines:
        x = rough.lines[k]
        hold_by_friction(x.line, x.sea, x.ends, out.lines[k])
    rest, _ = relaxed(rough, out, tally)
    yield Attempt(f"settled with friction from {shape}", *tally.counted(rough.newton(rest)), rough)


def pulled(
    smooth: NetworkSolver, rough: NetworkSolver, lines: Sequence[int], states: NetworkState, tally: Tally
) -> Iterator[Attempt]:
    """These lines laid where they touch, without tension, along an equilibrium without friction, then pulled tight.

    Lines that a current acts on are laid in still water: what lies is held by friction before the current comes, and
    the shape in the current without friction would be that of lines that have been swept along the bed.
    """
    calm = _in_still_water(smooth, states, tally)
    how = f"{PULLED} from where it lay without tension{' in still water' if calm is not None else ''}"
    rest = _laid(rough, lines, states if calm is None else calm)
    yield Attempt(how, *tally.counted(rough.newton(rest)), rough)
    if calm is not None:
        for part in GROWING:
            slower = _in_current(rough, part)
            taken, found = _taut(slower, *tally.counted(slower.balance(rest)))
            if taken.outcome != Outcome.OK:
                break
            rest = found
        yield Attempt(f"{how}, while the current grows", *tally.counted(rough.newton(rest)), rough)


def _in_still_water(smooth: NetworkSolver, states: NetworkState, tally: Tally) -> NetworkState | None:
    """The equilibrium beside one in a current that there is without it.

    None: no current acts on lines, or there is none, as of one that floats.
    """
    if any(is_in_current(x.line, x.sea) for x in smooth.lines):
        for ladder in STILLED:
            if (found := in_slower_currents(smooth, states, ladder, tally)) is not None:
                return found[-1]
    return None


def in_slower_currents(
    smooth: NetworkSolver, states: NetworkState, parts: Sequence[float], tally: Tally
) -> list[NetworkState] | None:
    """Equilibria that lead from one in a current to those in these parts of it, one from the other.

    None: a line has none, as one that floats.
    """
    found = [states]
    for part in parts:
        slower = _in_current(smooth, part)
        taken, state = tally.counted(slower.newton(found[-1]))
        if taken.outcome != Outcome.OK:
            return None
        found.append(state)
    return found[1:]


def _in_current(solver: NetworkSolver, part: float) -> NetworkSolver:
    """The same with this part of the current."""
    return solver.others([x._replace(sea=with_current(x.sea, part)) for x in solver.lines], solver.bodies.copy())


# --- without friction -----------------------------------------------------------------------------------


def attempts(
    solver: NetworkSolver, starts: Iterable[Start], others: Iterable[Start], tally: Tally
) -> Iterator[Attempt]:
    """Ways to an equilibrium, the quickest first; each is tried only when those before it failed.

    starts: shapes to begin with, with their names; others: those that come into question where these lead nowhere.
    """
    ways = _Ways(solver, tally)
    given, further = list[Start](), list[Start]()
    for name, start in starts:
        given.append((name, start))
        yield ways.newton(f"Newton from {name}", start)
    several = len(given) > 1
    if any(x.line.bits & (TOUCHES | FLOW) or x.line.element[[0, -1]].any() for x in solver.lines):
        for name, start in given:
            yield ways.eased(start, f", from {name}" if several else "")
    for name, start in others:
        further.append((name, start))
        yield ways.newton(f"Newton from {name}", start)
    for k, (name, start) in enumerate(given):
        lost = further and ways.first in (Outcome.NOT_FINITE, Outcome.SINGULAR)
        yield ways.hardened(further[0][1] if lost and k == 0 else start, f", from {name}" if several else "")
    for name, start in further:
        yield ways.hardened(start, f", from {name}")
    for _, start in given:
        yield from ways.loaded(start)
    for name, start in [*given, *further]:
        yield ways.settled(start, name)
        yield from ways.pushes()
    yield from ways.falls()


def are_same(one: NetworkState, other: NetworkState, length: float) -> bool:
    """Whether unstable equilibria count as one; length: m, of the longest line."""
    return max(float(np.abs(a.r - b.r).max()) for a, b in zip(one.lines, other.lines, strict=True)) <= SAME * length


class _Fall(NamedTuple):
    """A line that buckles, and its softest motion there, as of `Stability.softest_motion`."""

    square: float
    shape: Floats
    line: int
    states: NetworkState


class _Ways:
    """Ways to an equilibrium of one search, which knows the unstable and folded ones that it has met."""

    def __init__(self, solver: NetworkSolver, tally: Tally) -> None:
        self.solver, self.tally = solver, tally
        self.first: Outcome | None = None  # of the first attempt
        self._flawed: list[tuple[int, NetworkState]] = []  # the line that is, -1: a point, and the states
        self._pushed = self._seen = 0

    def _noted(self, how: str, solution: Solution, real: bool = True) -> Attempt:
        taken, states = solution
        self.first = taken.outcome if self.first is None else self.first
        flaw = taken.outcome in (Outcome.UNSTABLE, Outcome.FOLDED)
        if flaw and not any(are_same(states, x, self.solver.length) for _, x in self._flawed):
            self._flawed.append((taken.line, states))
        return Attempt(how, taken, states, self.solver, real)

    def newton(self, how: str, start: NetworkState) -> Attempt:
        """Newton's method from a start."""
        return self._noted(how, self.tally.counted(self.solver.newton(start)))

    def eased(self, states: NetworkState, place: str) -> Attempt:
        """Continuation from an easy sea to the real one: soft bed and obstacles, little current, little bending.

        A part of the way that fails is halved.
        """
        solver, done, part, steps = self.solver, -1.0, 1.0, 0
        while True:
            goal = min(1.0, done + part)
            last, here = goal >= 1.0, solver
            if not last:
                here = solver.others([_easier(x, max(goal, 0.0)) for x in solver.lines])
            taken, found = self.tally.counted(here.newton(states) if last else here.balance(states))
            steps += 1
            if taken.outcome == Outcome.OK:
                states, part = found, min(1.5 * part, 0.25) if done < 0.0 else 1.5 * part
                done = goal
            else:
                part *= 0.5
            if done >= 1.0 or part <= LEAST_PART or (done < 0.0 and part <= 0.5):
                break
        kinds = ((SEABED, "a soft seabed"), (OBSTACLES, "soft obstacles"), (FLOW, "no current"))
        easy = [name for bit, name in kinds if any(x.line.bits & bit for x in solver.lines)]
        easy += ["little bending"] if any(x.line.element.any() for x in solver.lines) else []
        return self._noted(f"from {', '.join(easy)} in {steps} steps{place}", (taken, found), last)

    def hardened(self, start: NetworkState, place: str) -> Attempt:
        """From soft and short lines, stretched by their start, to the real ones: they sag from any start.

        The starting shapes are under the tension scale at a strain of 1.  First cells get their real length, so that
        soft lines sag and stay taut; then their compliance falls to the real one.  A part that fails is halved.
        """
        solver, states = self.solver, start.copy()
        short = [0.5 * np.linalg.norm(state.e, axis=1) for state in start.lines]
        for x, state in zip(solver.lines, states.lines, strict=True):
            state.T[:] = x.scale
        done, part, steps = 0.0, 1.0 / HARDENING, 0
        while True:
            goal = min(1.0, done + part)
            if goal == 1.0:
                taken, found = self.tally.counted(solver.newton(states))
            else:
                here = solver.others([_harder(x, goal, h) for x, h in zip(solver.lines, short, strict=True)])
                taken, found = _taut(here, *self.tally.counted(here.balance(states)))
            steps += 1
            if taken.outcome == Outcome.OK:
                states, done, part = found, goal, 1.5 * part
            else:
                part *= 0.5
            if done >= 1.0 or part <= LEAST_PART:
                break
        what = "soft lines" if len(solver.lines) > 1 else "a soft line"
        return self._noted(f"{what} hardened in {steps} steps{place}", (taken, found), goal == 1.0)

    def loaded(self, start: NetworkState) -> Iterator[Attempt]:
        """End loads and moments applied in steps, each solved with turning chords, where the solver has these."""
        for steps in LOAD_STEPS:
            states = start
            for k in range(1, steps + 1):
                lines = [
                    x._replace(ends=x.ends._replace(force=k / steps * x.ends.force, moment=k / steps * x.ends.moment))
                    for x in self.solver.lines
                ]
                found = self.solver.others(lines).turned(states)
                if found is None:
                    return
                taken, states = self.tally.counted(found)
                if taken.outcome not in (Outcome.OK, Outcome.SLACK, Outcome.FOLDED):
                    break
            how = f"turning chords, end loads in {steps} step{'s' * (steps > 1)}"
            yield self._noted(how, (taken, states), k == steps)

    def settled(self, start: NetworkState, name: str) -> Attempt:
        """A damped motion to rest, then Newton's method."""
        rest, calm = relaxed(self.solver, start, self.tally)
        taken, states = self.tally.counted(self.solver.newton(rest))
        if calm and taken.outcome not in (Outcome.OK, *FLAWS):
            slack, _ = _taut(self.solver, replace(taken, outcome=Outcome.OK), rest)
            if slack.outcome == Outcome.SLACK:  # what has no tension has no one place that Newton could find
                taken, states = slack, rest
        return self._noted(f"damped motion to rest from {name}, then Newton", (taken, states))

    def pushes(self) -> Iterator[Attempt]:
        """Small pushes off what was met that is not stable; ends stay with what they are joined to."""
        while self._pushed < min(len(self._flawed), MOST_PUSHES):
            _, states = self._flawed[self._pushed]
            self._pushed, out = self._pushed + 1, states.copy()
            for k, x in enumerate(self.solver.lines):
                own = float(np.sqrt(float(x.line.mass.sum()) * x.length / x.scale))
                out.lines[k] = nudged(x.line, states.lines[k], x.length, own)  # type: ignore[index]
                out.lines[k].v[[-j for j in (0, 1) if x.joints[j] >= 0]] = 0.0
            rest, _ = relaxed(self.solver, out, self.tally)
            yield self.newton(PUSHED, rest)

    def falls(self) -> Iterator[Attempt]:
        """Slow falls from states in which a line buckles, to both sides, from that which grows least first."""
        solver, slow = self.solver, list[_Fall]()
        time_scale = time_scale_of(solver)
        for _ in range(MOST_FALLS):
            slow += [self._fall(*x) for x in self._flawed[self._seen :] if x[0] >= 0]
            self._seen, slow = len(self._flawed), sorted((x for x in slow if x.square < 0.0), key=lambda x: x.square)
            if not slow:
                return
            fall = slow.pop()
            longest = GROWN * growth_time(fall.square, time_scale, solver.settling)
            for way in (1.0, -1.0):
                if len(self._flawed) == self._seen:  # else it has led to one that is not known, from which it goes on
                    out, x = fall.states.copy(), solver.lines[fall.line]
                    out.lines[fall.line].v[:] = along(way * fall.shape, x.length, time_scale, solver.settling)
                    rest, _ = relaxed(solver, out, self.tally, longest)
                    yield self.newton(f"{PUSHED}, along its softest motion", rest)

    def _fall(self, line: int, states: NetworkState) -> _Fall:
        """The softest motion of a line between its ends."""
        x = self.solver.lines[line]
        ends = x.ends._replace(held=np.minimum(x.ends.held, 1))
        stability = Stability(x.line, x.sea, x.length, x.scale)
        return _Fall(*stability.softest_motion(ends, states.lines[line], gyration(x.line, x.length)), line, states)


def _easier(x: JoinedLine, part: float) -> JoinedLine:
    """A line over a softer bed and softer obstacles, in less current, with less bending; part: 0 the easiest to 1."""
    sea = with_current(softened(x.line, x.sea, softest(x.line, x.sea, x.length) ** (1.0 - part)), part)
    if x.rides.size:  # a body would sink through lines that are soft
        sea = sea._replace(obstacles=x.sea.obstacles)
    return x._replace(sea=sea, line=x.line._replace(kb=x.line.kb * LIMP ** (1.0 - part)))


def _harder(x: JoinedLine, goal: float, short: Floats) -> JoinedLine:
    """A line between soft and short, and real; goal: 0 to 1, of the way; short: (N,) m, its first cells."""
    line, longer, harder = x.line, min(1.0, 2.0 * goal), max(0.0, 2.0 * goal - 1.0)
    soft, hard = np.maximum(line.ck, 1.0 / x.scale), np.maximum(line.ck, NEARLY_STIFF / x.scale)
    h, ck = short ** (1 - longer) * line.h**longer, soft ** (1 - harder) * hard**harder
    return x._replace(line=line._replace(h=h, ck=ck, bits=line.bits & ~AXIAL_LAW))


def _taut(solver: NetworkSolver, taken: NetworkTaken, states: NetworkState) -> Solution:
    """What balances, with the outcome SLACK where a catenary is not under tension."""
    for k, (x, state) in enumerate(zip(solver.lines, states.lines, strict=True)):
        tension, cell = lowest_tension(x.line, x.sea, state)
        if taken.outcome == Outcome.OK and not tension > max(at_rest(x), 0.0):
            return replace(taken, outcome=Outcome.SLACK, line=k, where=int(cell)), states
    return taken, states


def time_scale_of(solver: NetworkSolver) -> float:
    """s, in which the lines and bodies settle."""
    mass = sum(float(x.line.mass.sum()) for x in solver.lines) + float(solver.bodies[:, MASS].sum())
    return float(np.sqrt(mass * solver.length / solver.scale))


def relaxed(
    solver: NetworkSolver, start: NetworkState, tally: Tally, longest: float = 0.0
) -> tuple[NetworkState, bool]:
    """Pseudo-transient: rho = 0, doubling steps, mass-proportional damping, until lines hardly move; whether they did.

    longest: s, of the steps; at least the time scale.  Sheaves are held: without friction nothing turns them.
    """
    time_scale = time_scale_of(solver)
    longest = max(longest, time_scale)
    lines, old = [], start.copy()
    for k, x in enumerate(solver.lines):
        held = np.where(x.line.moved == FREE, MOVES, x.line.moved).astype(np.int8)
        slow = damped(x.line, x.length, time_scale, solver.settling)._replace(moved=held)
        lines.append(x._replace(line=slow, slackens=True))
        old.lines[k] = old.lines[k]._replace(sheave=NO_SHEAVES)  # type: ignore[index]
    here, new = solver.others(lines, damped_bodies(solver.bodies, time_scale)), old.copy()
    meets = any(x.rides.size for x in solver.lines)
    dt, calm = 1e-3 * time_scale, 0
    for _ in range(RELAXING_STEPS):
        taken = here.step(old, new, dt, 0.0, dt, 0.0)
        tally.total += taken.iterations
        if taken.outcome != Outcome.OK:
            dt *= 0.25
            if dt < 1e-9 * time_scale:
                break
            old.bodies[:, V:] = 0.0
            for state in old.lines:
                stop(state)
            continue
        moved = max(float(np.abs(a.r - b.r).max()) for a, b in zip(new.lines, old.lines, strict=True))
        if meets:  # what nothing but contact holds may still fall where lines are at rest
            moved = max(moved, float(np.abs(new.bodies[:, :FRAME] - old.bodies[:, :FRAME]).max()))
        old, new = new, old
        if taken.iterations <= 5:
            dt = min(2.0 * dt, longest)
        calm = calm + 1 if moved < CALM * solver.length * dt / longest else 0
        if calm >= 3:
            break
    for k, state in enumerate(start.lines):
        old.lines[k] = old.lines[k]._replace(sheave=state.sheave.copy())  # type: ignore[index]
    return old, calm >= 3


def damped_bodies(bodies: Floats, time_scale: float) -> Floats:
    """Bodies with damping by mass that lets them settle in a time scale, s."""
    slow = bodies.copy()
    slow[:, DAMPING : DAMPING + 36] += 2.0 / time_scale * bodies[:, MASS : MASS + 36]
    return slow


# A line that lies somewhere without tension, before it is pulled to its equilibrium with friction.


def _laid(rough: NetworkSolver, lines: Sequence[int], states: NetworkState) -> NetworkState:
    """A copy of an equilibrium whose lines of these numbers are laid without tension, from what holds them on.

    A free point goes with the lines that lie there, on the mean of their ways where they do not agree.
    """
    out, left, moved, points = states.copy(), [*lines], dict[int, Floats](), len(rough.net)

    def known(k: int) -> NDArray[np.bool_]:
        x = rough.lines[k]
        return np.array([h == 1 or j >= points or j in moved for h, j in zip(x.ends.held, x.joints, strict=True)])

    def lies(k: int) -> bool:
        x, held = rough.lines[k], known(k)
        return bool((held & _lying(x.line, x.sea, held, states.lines[k])[[0, -1]]).any())

    while left:
        now, ways = [k for k in left if lies(k)] or left, dict[int, list[Floats]]()
        for k in now:
            x, held = rough.lines[k], known(k)
            by = np.array([moved.get(j, np.zeros(3)) for j in x.joints])
            out.lines[k] = laid_without_tension(x.line, x.sea, held, by, states.lines[k])  # type: ignore[index]
            for end, joint in enumerate(x.joints):
                way = out.lines[k].r[-end] - states.lines[k].r[-end]
                if joint >= 0 and not held[end] and way.any():  # else the line does not lie there
                    ways.setdefault(joint, []).append(way)
        moved |= {point: np.mean(x, axis=0) for point, x in ways.items()}
        left = [k for k in left if k not in now]
    for k, x in enumerate(rough.lines):
        for end, joint in enumerate(x.joints):
            if joint in moved:
                out.lines[k].r[-end] = states.lines[k].r[-end] + moved[joint]
                _chords_anew(out.lines[k])
    return out


def laid_without_tension(line: Line, sea: Sea, held: NDArray[np.bool_], moved: Floats, state: State) -> State:
    """A copy of an equilibrium whose stretches on the bed and on obstacles have their unstretched length.

    It has no friction yet.  A stretch keeps its path, and its place at a held end that lies there, too; one without
    such an end, or with two, keeps the place of its middle.  The displacement of a node from here is the travel that
    friction opposes (docs/theory.md, T17b).  held: (2,) whether ends are; moved: (2, 3) m, how far they have gone.
    """
    laid, cells = state.copy(), line.h.size
    laid.slip[:] = 0.0
    touches = _lying(line, sea, held, state)
    shortening = (line.h / np.linalg.norm(state.e, axis=1) - 1.0)[:, None] * state.e
    for first, last in _stretches(touches):
        shift = np.vstack([np.zeros(3), np.cumsum(shortening[first:last], axis=0)])
        count, fixed = last - first, (first == 0 and held[0], last == cells and held[1])
        kept = 0.5 * (shift[count // 2] + shift[(count + 1) // 2])  # of the middle, between two nodes if need be
        if all(fixed):
            kept = kept - moved.mean(axis=0)
        elif any(fixed):
            kept = shift[0] - moved[0] if fixed[0] else shift[count] - moved[1]
        laid.r[first : last + 1] += shift - kept
    for k in np.flatnonzero(held):
        laid.r[-k] = state.r[-k] + moved[k]
    _chords_anew(laid)
    return laid


def _lying(line: Line, sea: Sea, held: NDArray[np.bool_], state: State) -> NDArray[np.bool_]:
    """Nodes (N+1,) that lie on the bed or on an obstacle, with ends that are held beside one."""
    touches = np.asarray(on_obstacles(line, sea, state).any(axis=0))
    if line.bits & SEABED:
        touches |= planes_under(sea, state.r)[1] > 0.5 * sea.onset
    touches[0] |= bool(held[0]) and bool(touches[1])
    touches[-1] |= bool(held[1]) and bool(touches[-2])
    return touches


def _chords_anew(laid: State) -> None:
    """Let chords and directors follow the nodes."""
    laid.e[:] = np.diff(laid.r, axis=0)
    d = laid.e / np.linalg.norm(laid.e, axis=1)[:, None]
    across = laid.a1 - np.einsum("ij,ij->i", laid.a1, d)[:, None] * d
    laid.a1[:] = across / np.linalg.norm(across, axis=1)[:, None]


def _stretches(touches: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """First and last node of every run of nodes that touch, of at least two nodes."""
    turns = np.flatnonzero(np.diff(np.concatenate([[False], touches, [False]]).astype(np.int8)))
    for first, after in turns.reshape(-1, 2):
        if after - first > 1:
            yield int(first), int(after) - 1


# Easier seas, in which a line begins that finds its way to the real one: softer, with less current or none.

# How deep a continuation lets a line lie first in the bed, of its length, and in an obstacle, of half of how thick
# it is; in a plane as in the bed.
SOFT_BED, SOFT = 0.05, 0.5


def softened(line: Line, sea: Sea, part: float) -> Sea:
    """The sea with this part of the stiffness of its bed and of its obstacles, which are pressed on as much deeper.

    Soil that remembers becomes linear, as stiff as it is on average under what a line presses with, and comes back with
    the part: where its pressure hardly grows with depth Newton's method does not find how deep a node lies.
    """
    rows = sea.obstacles.copy()
    rows[:, STIFFNESS] *= part
    rows[:, ONSET_OF] /= part
    stiffness, onset, soil = sea.stiffness, sea.onset, sea.soil
    if line.bits & SOIL:
        depth, soil = _depth(line, sea), soil.copy()
        stiffness, onset, soil[PART] = stiffness * onset / (ONSET * depth), ONSET * depth, part
    return sea._replace(stiffness=stiffness * part, onset=onset / part, obstacles=rows, soil=soil)


def _depth(line: Line, sea: Sea) -> float:
    """m, in which soil bears what a line presses on the bed with."""
    return float(depth_under(sea.soil, float(line.bed_width.max()), sea.onset * sea.stiffness / ONSET))


def softest(line: Line, sea: Sea, length: float) -> float:
    """The part of the stiffness of bed and obstacles at which a line of this length (m) lies as deep as it may."""
    soft = 1.0
    if line.bits & SEABED:
        onset = ONSET * _depth(line, sea) if line.bits & SOIL else sea.onset
        soft = onset / (SOFT_BED * length)
    if line.bits & OBSTACLES:
        thick = half_thickness(sea.obstacles)
        deep = np.where(np.isfinite(thick), SOFT * thick, SOFT_BED * length)
        soft = min(soft, float((sea.obstacles[:, ONSET_OF] / deep).min(initial=1.0)))
    return min(1.0, soft)


def with_current(sea: Sea, part: float) -> Sea:
    """The sea with this part of its current."""
    now = sea.now.copy()
    now[1] *= part
    return sea._replace(now=now)


def is_in_current(line: Line, sea: Sea) -> bool:
    """Whether a current acts on a line."""
    return bool(line.bits & FLOW) and sea.now[1] != 0.0 and bool(np.any(sea.current))
