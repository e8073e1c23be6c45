"""Equilibrium by the same march: Newton from whatever shape is given, and a slow road when that fails."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import NamedTuple

import numpy as np

from hybrid.errors import ComputationError, Outcome
from hybrid.kernels.laws.soil import settle_in_soil
from hybrid.kernels.run import entry
from hybrid.kernels.run.entry import Limits
from hybrid.kernels.state.forces import (
    AXIAL_LAW,
    FLOW,
    FRICTION,
    OBSTACLES,
    SEABED,
    TOUCHES,
    WAVES,
)
from hybrid.kernels.state.report import RESIDUAL, RESIDUAL_NODE
from hybrid.kernels.state.state import NO_ADDRESS, Ends, Floats, Line, Sea, State
from hybrid.kernels.step.step import friction_axes
from hybrid.solve.flaws import flaw_of_line, fold_text, lowest_tension
from hybrid.solve.laid import laid_without_tension
from hybrid.solve.settling import Settling, gyration
from hybrid.solve.softened import is_in_current, softened, softest, with_current
from hybrid.solve.stability import Stability, is_judged
from hybrid.solve.stepper import Stepper
from hybrid.solve.workspaces import workspace_of

MOST_ITERATIONS = 40  # of Newton from a poor shape: 6 to 12 are usual, beyond 40 it wanders
REACH = 0.1  # of the length: largest shift of a node in one iteration
# An equilibrium is out of balance by at most this part of its largest tension and of the scale; so many tries.
BALANCED, BALANCING = 1e-6, 4
DRIFTED = 10.0  # lengths that a line has gone from its start where it has drifted
MOST_TURNING = 200  # of Newton with turning chords, which goes half a radian at a time: 8 pi are 40 turns of that size
LOAD_STEPS = (1, 8, 64)  # ladders of end loads tried when Newton does not get there in one go
NEARLY_STIFF = 1e-6  # strain at the tension scale at which hardening ends; the last part of the way is Newton's
HARDENING = 8  # parts of the way from a soft, short line to the real one; a part that fails is halved
LEAST_TENSION = 1e-3  # of the slack floor of a motion, with the opposite sign
# The way to an equilibrium that has a mirror image on the other side, or may have: which it is hangs on round-off.
PUSHED = "pushed off an unstable equilibrium"
# Of the length: unstable equilibria that are nearer than this are one; the most of them that a line is pushed off.
SAME, MOST_PUSHES = 1e-3, 12
# The most of them that it is let fall from, slowly, to both sides, those that grow least first.
MOST_FALLS = 16
# Parts of a current with which equilibria lead to that in still water: at once, else by and by; and with which one with
# friction follows it up again where it is not found at once.
STILLED = ((0.0,), (0.8, 0.6, 0.4, 0.2, 0.1, 0.0))
GROWING = (0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9)
PULLED = "pulled tight against friction"
LIMP = 1e-3  # part of the bending stiffness there


@dataclass(frozen=True)
class Equilibrium:
    """A static solution: how it was found (`path`), iterations, and its proof, the largest force out of balance (N)."""

    state: State
    path: tuple[str, ...]
    iterations: int
    residual: float
    report: Floats
    slack: int  # a catenary cell without tension, or -1
    with_friction: bool  # True when friction took part
    judged: bool  # False when its stability could not be judged (an end moment, or `blurred`)
    blurred: bool = False  # True when round-off of the bending of very short cells hides whether it buckles
    touch: Floats = field(default_factory=lambda: np.zeros(0))  # (N+1,) N/m, where the line touches itself
    not_settled: str = ""  # why friction has not settled where a scene leaves that to the program

    @property
    def pushed(self) -> bool:
        """Whether it, or one on fewer cells that it was found from, is beside an equilibrium that is not stable."""
        return PUSHED in self.path[-1]

    @property
    def pulled(self) -> bool:
        """Whether it was pulled tight from where it lay without tension."""
        return self.path[-1].startswith(PULLED)

    @property
    def summary(self) -> str:
        """How it was found, in one line."""
        failed = len(self.path) - 1
        others = f" (after {failed} other way{'s' * (failed > 1)})" if failed else ""
        return f"{self.path[-1].split(':')[0]}, {self.iterations} iterations{others}"


class _Fall(NamedTuple):
    """An unstable equilibrium and its softest motion, as of `Stability.softest_motion`."""

    square: float
    shape: Floats
    state: State


class _Solver:
    def __init__(self, line: Line, sea: Sea, length: float, scale: float, floor: float) -> None:
        self.line, self.sea, self.length, self.scale, self.floor = line, sea, length, scale, floor
        self.work = workspace_of(line)
        self.stability = Stability(line, sea, length, scale)
        self.anchor = self.stability.anchor
        self.settling = Settling(line, sea, length, scale)
        self.total = 0

    def newton(
        self, line: Line, ends: Ends, start: State, turning: bool = False, sea: Sea | None = None
    ) -> tuple[Outcome, int, State]:
        """Static Newton from `start`; a new state is returned, the old one is left as it was.

        An equilibrium with a catenary cell that is not under tension is no equilibrium of a cable: SLACK.
        One out of which a rod would buckle is none that anybody will see: UNSTABLE.  One with a rod that stands on a
        fold between two cells is none of a rod: FOLDED.
        """
        new = start.copy()
        for still in (new.v, new.a, new.vd, new.w, new.wa, new.wd, new.sheave):
            still[:] = 0.0
        limits = Limits(REACH * self.length, self.scale, MOST_TURNING if turning else MOST_ITERATIONS)
        kept: State | None = None
        for _ in range(BALANCING):
            self.work.u[:], new.soil[:] = 0.0, 0.0
            if line.bits & FRICTION:
                friction_axes(self.sea, new.r, new.e, new.slip, new.grip)
            outcome, iterations, _, where = entry.equilibrium(
                line, sea or self.sea, ends, new, self.anchor, limits, turning, self.work
            )
            self.total += iterations
            new.r[:] += self.work.u
            new.vd[:], new.wd[:] = 0.0, 0.0  # of the anchor's springs
            new.slip[:] = self.sea.slid if line.bits & FRICTION else 0.0
            settle_in_soil(line, sea or self.sea, new.r, new.soil)
            if outcome != Outcome.OK or line is not self.line or sea is not None:
                break
            # Newton stops by turns and tensions; a very stiff seabed makes much force of little way
            out_of_balance = self.prove(ends, new)
            if not self.is_balanced(new, out_of_balance):
                outcome, where = Outcome.NOT_CONVERGED, int(self.work.report[RESIDUAL_NODE])
            elif kept is not None or not line.bits & FRICTION:
                break
            else:  # friction that sticks is stiff: one more round, of which nothing is lost
                kept = new.copy()
        if kept is not None and outcome != Outcome.OK:
            outcome, new = Outcome.OK, kept
        if outcome == Outcome.OK:
            tension, cell = lowest_tension(line, self.sea, new)
            if not tension > self.floor:
                outcome, where = Outcome.SLACK, cell
        if outcome == Outcome.OK and line is self.line and sea is None:
            far = np.abs(new.r - start.r).max(axis=1)
            if far.max() > DRIFTED * self.length:  # what no bond holds is held by the anchor's springs alone
                outcome, where = Outcome.SINGULAR, int(np.argmax(far))
            else:
                outcome, where = flaw_of_line(line, self.sea, new, self.length, self.floor)
        judged = line is self.line and sea is None and is_judged(line, ends, self.length)
        if outcome == Outcome.OK and judged and not self.stability.holds(ends, new):
            outcome, where = Outcome.UNSTABLE, int(np.argmin(new.T))
        return Outcome(outcome), int(where), new

    def relaxed(self, ends: Ends, state: State) -> State:
        """Where a damped motion leads to."""
        rest, iterations = self.settling.rest(ends, state)
        self.total += iterations
        return rest

    def fallen(self, ends: Ends, state: State, square: float, shape: Floats) -> State:
        """Where a line comes to, slowly, from an unstable equilibrium: `Settling.fallen`."""
        rest, iterations = self.settling.fallen(ends, state, square, shape)
        self.total += iterations
        return rest

    def is_balanced(self, state: State, residual: float) -> bool:
        """Whether a largest residual force (N) is round-off of the forces in a state."""
        return residual <= BALANCED * (float(np.abs(state.T).max()) + self.scale)

    def prove(self, ends: Ends, state: State) -> float:
        """Largest force out of balance at a node, N; infinity when it cannot be told."""
        if self.line.bits & FRICTION:
            friction_axes(self.sea, state.r, state.e, state.slip, state.grip)
        self.work.u[:] = 0.0
        bad = entry.assembly(self.line, self.sea, ends, state, 0.0, self.anchor, self.work)
        return float(self.work.report[RESIDUAL]) if bad < 0 else float("inf")


def _loaded(solver: _Solver, ends: Ends, start: State) -> Iterator[tuple[str, Outcome, int, State]]:
    """End loads and moments applied in steps, each solved with turning chords."""
    for steps in LOAD_STEPS:
        state, outcome, where = start, Outcome.OK, -1
        for k in range(1, steps + 1):
            part = ends._replace(force=k / steps * ends.force, moment=k / steps * ends.moment)
            outcome, where, state = solver.newton(solver.line, part, state, turning=True)
            if outcome not in (Outcome.OK, Outcome.SLACK, Outcome.FOLDED):
                break
        yield f"turning chords, end loads in {steps} step{'s' * (steps > 1)}", outcome, where, state


def _hardened(solver: _Solver, ends: Ends, start: State) -> tuple[str, Outcome, int, State]:
    """From a soft and short line, stretched by its start, to the real one: it sags from any start that is not slack.

    The starting shape is under the tension scale at a strain of 1.  First the cells get
    their real length, so that the soft line sags and stays taut; then their compliance
    falls to the real one.  A part of the way that fails is halved.
    """
    line, state = solver.line, start.copy()
    straight = line._replace(bits=line.bits & ~AXIAL_LAW, law_at=NO_ADDRESS)
    state.T[:] = solver.scale
    chords = np.linalg.norm(start.e, axis=1)
    soft, short = np.maximum(line.ck, 1.0 / solver.scale), 0.5 * chords
    hard = np.maximum(line.ck, NEARLY_STIFF / solver.scale)
    outcome, where = Outcome.OK, -1
    done, part, steps = 0.0, 1.0 / HARDENING, 0
    while done < 1.0 and part > 1e-3:
        goal = min(1.0, done + part)
        longer, harder = min(1.0, 2.0 * goal), max(0.0, 2.0 * goal - 1.0)
        between = straight._replace(h=short ** (1 - longer) * line.h**longer, ck=soft ** (1 - harder) * hard**harder)
        outcome, where, found = solver.newton(between if goal < 1.0 else line, ends, state)
        steps += 1
        if outcome == Outcome.OK:
            state, done, part = found, goal, 1.5 * part
        else:
            part *= 0.5
    return f"a soft line hardened in {steps} steps", outcome, where, state


def _eased(solver: _Solver, ends: Ends, start: State) -> tuple[str, Outcome, int, State]:
    """Continuation from an easy sea to the real one: a soft seabed that hardens, a current that grows, little bending.

    A part of the way that fails is halved.
    """
    line, sea, state = solver.line, solver.sea, start
    soft_first = softest(line, sea, solver.length)
    grown = float(sea.now[1])
    outcome, where, done, part, steps = Outcome.OK, -1, -1.0, 1.0, 0
    while done < 1.0 and part > 1e-3:
        goal = min(1.0, done + part)
        x = max(goal, 0.0)
        soft = soft_first ** (1.0 - x)
        now = sea.now.copy()
        now[1] = x * grown
        easy = softened(line, sea, soft)._replace(now=now)
        limp = line._replace(kb=line.kb * LIMP ** (1.0 - x))
        last = goal >= 1.0
        outcome, where, found = solver.newton(line if last else limp, ends, state, sea=None if last else easy)
        steps += 1
        if outcome == Outcome.OK or (outcome == Outcome.SLACK and not last):
            state, done, part = found, goal, min(1.5 * part, 0.25) if done < 0.0 else 1.5 * part
        else:
            part *= 0.5
            if done < 0.0 and part <= 0.5:
                break
    eased = [
        what
        for bit, what in ((SEABED, "a soft seabed"), (OBSTACLES, "soft obstacles"), (FLOW, "no current"))
        if line.bits & bit
    ]
    eased += ["little bending"] if line.element.any() else []
    return f"from {', '.join(eased)} in {steps} steps", outcome, where, state


def _settled(solver: _Solver, ends: Ends, start: State, shape: str) -> tuple[str, Outcome, int, State]:
    """Where friction alone keeps a line: let it settle from its start, with friction, then Newton from there."""
    rest = start.copy()
    Stepper(solver.line, solver.length, solver.scale).static_friction(solver.sea, ends, rest)
    return f"settled with friction from {shape}", *solver.newton(solver.line, ends, solver.relaxed(ends, rest))


def _in_still_water(smooth: _Solver, ends: Ends, state: State) -> State | None:
    """The equilibrium beside one in a current that there is without it; None: the line has none, as one that floats."""
    for ladder in STILLED:
        found = state
        for part in ladder:
            reached, _, found = smooth.newton(smooth.line, ends, found, sea=with_current(smooth.sea, part))
            if reached != Outcome.OK:
                break
        else:
            return found
    return None


def _pulled(smooth: _Solver, rough: _Solver, ends: Ends, state: State) -> Iterator[tuple[str, Outcome, int, State]]:
    """Laid where it touches, without tension, along an equilibrium without friction, then pulled tight against it.

    A line that a current acts on is laid in still water: what lies is held by friction before the current comes, and
    the shape in the current without friction would be that of a line that has been swept along the bed.
    """
    calm = _in_still_water(smooth, ends, state) if is_in_current(smooth.line, smooth.sea) else None
    place = f"where it lay without tension{' in still water' if calm is not None else ''}"
    rest = laid_without_tension(smooth.line, smooth.sea, ends, state if calm is None else calm)
    rough.total += smooth.total
    yield f"{PULLED} from {place}", *rough.newton(rough.line, ends, rest)
    if calm is not None:
        for part in GROWING:
            outcome, where, rest = rough.newton(rough.line, ends, rest, sea=with_current(rough.sea, part))
            if outcome != Outcome.OK:
                break
        else:
            outcome, where, rest = rough.newton(rough.line, ends, rest)
        yield f"{PULLED} from {place}, while the current grows", outcome, where, rest


def _attempts(
    solver: _Solver, ends: Ends, start: State, shape: str, others: Sequence[tuple[str, State]]
) -> Iterator[tuple[str, Outcome, int, State]]:
    """Ways to an equilibrium, the quickest first; each is tried only when those before it failed."""
    flawed: list[State] = []

    def noted(way: tuple[str, Outcome, int, State]) -> tuple[str, Outcome, int, State]:
        _, outcome, _, state = way
        same = SAME * solver.length
        flaw = outcome in (Outcome.UNSTABLE, Outcome.FOLDED)
        if flaw and all(np.abs(state.r - x.r).max() > same for x in flawed):
            flawed.append(state)
        return way

    first = noted((f"Newton from {shape}", *solver.newton(solver.line, ends, start)))
    yield first
    if solver.line.bits & (TOUCHES | FLOW):
        yield noted(_eased(solver, ends, start))
    for name, other in others:
        yield noted((f"Newton from {name}", *solver.newton(solver.line, ends, other)))
    soft = others[0][1] if others and first[1] in (Outcome.NOT_FINITE, Outcome.SINGULAR) else start
    yield noted(_hardened(solver, ends, soft))
    for name, other in others:
        how, outcome, where, state = noted(_hardened(solver, ends, other))
        yield f"{how}, from {name}", outcome, where, state
    yield from map(noted, _loaded(solver, ends, start))
    pushed = 0
    for name, other in (("", start), *((f" from {name}", other) for name, other in others)):
        at_rest = solver.newton(solver.line, ends, solver.relaxed(ends, other))
        yield noted((f"damped motion to rest{name}, then Newton", *at_rest))
        while pushed < min(len(flawed), MOST_PUSHES):
            fallen = solver.relaxed(ends, solver.settling.nudged(flawed[pushed]))
            pushed += 1
            yield noted((PUSHED, *solver.newton(solver.line, ends, fallen)))
    seen, slow = 0, list[_Fall]()
    for _ in range(MOST_FALLS):
        for state in flawed[seen:]:
            motion = solver.stability.softest_motion(ends, state, gyration(solver.line, solver.length))
            slow.append(_Fall(*motion, state))
        seen, slow = len(flawed), sorted((x for x in slow if x.square < 0.0), key=lambda x: x.square)
        if not slow:
            break
        fall = slow.pop()
        for way in (1.0, -1.0):
            if len(flawed) == seen:  # else it has led to one that is not known, from which it goes on
                state = solver.fallen(ends, fall.state, fall.square, way * fall.shape)
                yield noted((f"{PUSHED}, along its softest motion", *solver.newton(solver.line, ends, state)))


class Search(NamedTuple):
    """How an equilibrium is searched, and which one counts.

    settle: on a bed with friction, "start": let it come to rest from the start and try nothing else, "pull": pull it
    tight from where it would lie without tension along the equilibrium without friction, which is the start; quick: try
    nothing but Newton from the start; take_slack: whether a slack solution will do; others: further starts with their
    names; refused: why a state in balance is not the one that is sought, and its cell or node; the next way is tried
    then.
    """

    settle: str = ""
    quick: bool = False
    take_slack: bool = False
    others: Sequence[tuple[str, State]] = ()
    refused: Callable[[State], tuple[Outcome, int]] | None = None


ALL_WAYS = Search()


def solve_statics(
    line: Line,
    sea: Sea,
    ends: Ends,
    start: State,
    length: float,
    scale: float,
    floor: float | None = None,
    shape: str = "the starting shape",
    search: Search = ALL_WAYS,
) -> Equilibrium:
    """Equilibrium of a line from a starting shape, however poor.

    length: m; scale: the tension scale, N; floor: what counts as no tension in motion, N
    (None: 1e-6 of the scale); at rest a catenary needs LEAST_TENSION times that; shape: what the
    start is, for people.

    Tries Newton; then a soft line that is hardened; then Newton with turning chords along
    ladders of end loads; then a damped motion that settles, and Newton again; then a push
    off an unstable equilibrium.  Raises ComputationError when none of them arrives; with
    `search.take_slack` a slack solution is taken when there is no taut one.
    """
    # at rest a catenary needs more than no tension: without any, every shape is an equilibrium
    floor = LEAST_TENSION * abs(1e-6 * scale if floor is None else floor)
    rough = _Solver(line._replace(bits=line.bits & ~WAVES), sea, length, scale, floor)
    smooth = _Solver(rough.line._replace(bits=rough.line.bits & ~FRICTION), sea, length, scale, floor)
    path: list[str] = []
    failed: list[tuple[Outcome, int, State]] = []
    settle, quick, refused = search.settle, search.quick, search.refused
    if line.bits & FRICTION and not ends.held.any():
        settle = "start"

    def roads() -> Iterator[tuple[_Solver, tuple[str, Outcome, int, State]]]:
        rubs = bool(line.bits & FRICTION)
        plain = _attempts(smooth, ends, start, shape, search.others)
        if not (settle and rubs):
            yield from ((smooth, road) for road in (islice(plain, 1) if quick else plain))
        elif settle == "pull":
            yield from ((rough, road) for road in _pulled(smooth, rough, ends, start))
        if rubs and settle != "pull" and (settle or not quick):
            yield rough, _settled(rough, ends, start, shape)

    for solver, (how, reached, where, state) in roads():
        outcome = reached
        if reached == Outcome.OK and refused is not None:
            outcome, where = refused(state)
        path.append(f"{how}: {outcome.cause if outcome else 'found'} ({solver.total} iterations in all)")
        if outcome == Outcome.OK:
            return _found(solver, ends, state, path)
        failed.append((outcome, where, state))
    for worst in (
        Outcome.SLACK,
        Outcome.UNSTABLE,
        Outcome.FOLDED,
        Outcome.BURIED,
        failed[0][0],
    ):  # what says most about the line comes first
        for outcome, _, state in failed:
            # what a continuation has left on its way is not balanced
            slack = outcome == worst == Outcome.SLACK and search.take_slack
            if slack and smooth.is_balanced(state, smooth.prove(ends, state)):
                return _found(smooth, ends, state, path)
        for outcome, where, state in failed:
            if outcome == worst:
                node = min(max(where, 0), line.s.size - 1)
                said = [fold_text(line, state, node), *path] if outcome == Outcome.FOLDED else path
                raise ComputationError(outcome, None, float(line.s[node]), "\n              ".join(said))
    raise AssertionError("one of the roads has failed with the first road's outcome")


def _found(solver: _Solver, ends: Ends, state: State, path: list[str]) -> Equilibrium:
    residual = solver.prove(ends, state)
    tension, cell = lowest_tension(solver.line, solver.sea, state)
    slack = -1 if tension > solver.floor else cell
    with_friction = bool(solver.line.bits & FRICTION)
    blurred = solver.stability.blurred
    judged = (is_judged(solver.line, ends, solver.length) and not blurred) or not solver.line.element.any()
    return Equilibrium(
        state,
        tuple(path),
        solver.total,
        residual,
        solver.work.report.copy(),
        int(slack),
        with_friction,
        judged,
        solver.stability.blurred,
    )
