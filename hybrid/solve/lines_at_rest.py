"""Equilibria of lines, of one or of several that meet, are sought without friction and with it.

A line that is joined to nothing that moves is a group of one: it is solved by itself, and sought in
its plane first where it lies in one.  Ways and their order are those of solve.search.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain, islice
from typing import NamedTuple

from hybrid.errors import Outcome
from hybrid.kernels.state.report import FREE, FRICTION, PLANAR, SELF_CONTACT, WAVES
from hybrid.kernels.state.state import Floats
from hybrid.model.build import leaves_plane, planar, untwist
from hybrid.solve.network_solver import NO_BODIES, NetworkSolver
from hybrid.solve.search import PULLED, PUSHED, Attempt, Start, Tally, attempts, first_sound, pulled, stuck, summary_of
from hybrid.solve.stability import is_stable
from hybrid.solve.stepper import JoinedLine, LineFailed, NetworkState

# Why an equilibrium is not the one that is sought: as of `first_sound`.
Refused = Callable[[NetworkState], tuple[Outcome, int, int]]


@dataclass(frozen=True)
class LinesAtRest:
    """A static solution: the state, the search that found it, and its proof.

    path: how it was found; then iterations, and the largest residual force at a node or a point (N).
    """

    state: NetworkState
    path: tuple[str, ...]
    iterations: int
    residual: float
    made: NetworkSolver | Callable[[], NetworkSolver]  # whose reports are those of the solution, or what makes it
    settled: bool = False  # True where a damped motion with contact led there
    unjudged: str = ""  # where settled: why it is not known that it would stay
    with_friction: frozenset[int] = frozenset()  # numbers of the lines of which friction took part
    blurred: frozenset[int] = frozenset()  # and of those of which round-off hides whether they buckle
    # Of lines that were sought apart from others, by their numbers; empty: all were sought together.
    parts: Mapping[tuple[int, ...], LinesAtRest] = field(default_factory=dict)
    # By number of those that leave friction to the program, why it did not.
    not_settled: Mapping[int, str] = field(default_factory=dict)

    @property
    def bodies(self) -> Floats:
        """(B, NUMBERS) what bodies are; where there are none, no solver is made for that."""
        return self.solver.bodies.copy() if len(self.state.bodies) else NO_BODIES

    @cached_property
    def solver(self) -> NetworkSolver:
        """A solver whose reports are those of the solution.

        Of lines that were found one by one it is made when it is asked for: that takes 1 ms.
        """
        return self.made if isinstance(self.made, NetworkSolver) else self.made()

    @property
    def presses_bodies(self) -> bool:
        """Whether lines touch a body that is free."""
        return not self.parts and self.solver.presses_bodies

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
        return summary_of(self.path, self.iterations)


class Group(NamedTuple):
    """Lines that are sought together; points: how many free points there are; bodies: (B, NUMBERS), what they are."""

    lines: Sequence[JoinedLine]
    points: int = 0
    bodies: Floats = NO_BODIES
    plane: Floats | None = None  # (3, 3) in which a line by itself lies at first; None: it lies in none
    guides: tuple[bool, bool] = (False, False)  # ends of that which hold a tangent

    @property
    def is_alone(self) -> bool:
        """Whether it is one line that is joined to nothing that moves, and touches nothing that does."""
        x, more = self.lines[0], len(self.lines) > 1 or self.points or len(self.bodies)
        return not more and max(x.joints) < 0 and not x.line.bits & SELF_CONTACT

    def solver(self, rough: Iterable[int] = (), slackens: bool = True) -> NetworkSolver:
        """Of the lines without waves, and all but those of the numbers `rough` without friction.

        slackens: whether a slack solution will do where a line asks for that; with friction it is not taken.
        """
        rough, lines = {*rough}, []
        for k, x in enumerate(self.lines):
            bits = x.line.bits & ~(WAVES | (0 if k in rough else FRICTION))
            slack = x.slackens and slackens and not rough
            lines.append(x._replace(line=x.line._replace(bits=bits), slackens=slack))
        return NetworkSolver(lines, self.points, self.bodies.copy(), apart=self.is_alone)

    def begun(self, start: NetworkState) -> NetworkState:
        """Untwist the start of a planar line: in its plane nothing would turn back a twist."""
        if not (self.is_alone and self.lines[0].line.bits & PLANAR):
            return start
        out = start.copy()
        untwist(self.lines[0].line, self.lines[0].ends, self.guides, out.lines[0])
        return out


def lines_at_rest(
    group: Group, starts: Iterable[Start], others: Sequence[Start] = (), refused: Refused | None = None,
    quick: bool = False, rubs: bool = True,
) -> LinesAtRest:  # fmt: skip
    """Equilibrium of lines without friction; where none is found, with that which keeps them where they start.

    starts, others: as of `attempts`; refused: as of `first_sound`; quick: nothing but Newton from the first start, and
    no slack solution; rubs: whether friction is tried.  LineFailed: no way leads to lines under tension.
    """
    starts = iter(starts)
    name, first = next(starts)
    rough = [k for k, x in enumerate(group.lines) if x.line.bits & FRICTION]

    def search(group: Group, quick: bool) -> LinesAtRest:
        smooth, tally = group.solver(slackens=not quick), Tally()
        begun, more = ([(name, group.begun(state)) for name, state in x] for x in ([(name, first)], others))
        roads = [attempts(smooth, begun if quick else chain(begun, _begun(group, starts)), more, tally)]
        if quick:
            roads = [islice(roads[0], 1)]
        elif rough and rubs:
            roads.append(_lazily(lambda: stuck(group.solver(rough), rough, begun[0][1], name, tally)))
        return _solution(*first_sound(chain(*roads), tally, refused), tally)

    return _in_plane_first(group, first, search, quick)


def settled_with_friction(
    group: Group, ways: Mapping[int, str], first: Start, found: LinesAtRest | None = None
) -> LinesAtRest:
    """The equilibrium with friction of the lines named in `ways`, by number.

    ways: "pull": laid without tension along the equilibrium without friction (`found`), or where a current acts along
    that in still water, then pulled tight, all such lines together; "start", and where that fails: at rest after a
    damped motion from the first shapes; "usual" for all: pulled tight, and nothing else.  LineFailed.
    """
    lays = found is not None and "start" not in ways.values()

    def search(group: Group, quick: bool) -> LinesAtRest:
        solver, tally, tried = group.solver(ways), Tally(), list[Iterable[Attempt]]()
        if found is not None:
            tally.total = found.iterations
        if lays:
            assert found is not None
            tried.append(pulled(group.solver(), solver, [*ways], group.begun(found.state), tally))
        if not lays or (set(ways.values()) != {"usual"} and not quick):
            tried.append(stuck(solver, ways, group.begun(first[1]), first[0], tally))
        before = found.path[:-1] if found is not None else ()
        laid = _solution(*first_sound(chain(*tried), tally, before=before), tally)
        if found is None or not found.pushed or not laid.pulled:
            return laid
        return replace(laid, path=(*laid.path[:-1], f"{laid.path[-1]}, {PUSHED}"))

    return _in_plane_first(group, found.state if lays and found is not None else first[1], search)


def _begun(group: Group, starts: Iterable[Start]) -> Iterator[Start]:
    return ((name, group.begun(state)) for name, state in starts)


def _lazily(road: Callable[[], Iterator[Attempt]]) -> Iterator[Attempt]:
    """A road that is made when it is taken."""
    yield from road()


def _in_plane_first(
    group: Group, start: NetworkState, search: Callable[[Group, bool], LinesAtRest], quick: bool = False
) -> LinesAtRest:
    """What a search finds at once in the plane of a line, if that holds in space, too; else in space.

    search: of a group; and whether it tries only its first way.
    """
    x = group.lines[0]
    plane = group.plane if group.is_alone and not x.line.bits & PLANAR else None
    if plane is None or leaves_plane(plane, start.lines[0], x.length):
        return search(group, quick)
    line = planar(x.line, plane)
    try:
        found = search(group._replace(lines=(x._replace(line=line),)), True)
        judged = line if found.with_friction else line._replace(bits=line.bits & ~FRICTION)
        if is_stable(judged, x.sea, x.ends, found.state.lines[0], x.length, x.scale):
            return found
    except LineFailed:  # there are more ways in space
        pass
    return search(group, quick)


def _solution(path: tuple[str, ...], tried: Attempt, tally: Tally) -> LinesAtRest:
    solver, states = tried.solver, tried.states
    rough = frozenset(k for k, x in enumerate(solver.lines) if x.line.bits & FRICTION)
    residual, blurred = solver.proof(states), frozenset(solver.blurred)
    if solver.apart and (solver.lines[0].line.moved == FREE).any():  # sheaves that turn, which it did not know of
        solver = NetworkSolver(solver.lines, 0)
        solver.evaluate_forces(states, solver.anchor)
    return LinesAtRest(states, path, tally.total, residual, solver, with_friction=rough, blurred=blurred)
