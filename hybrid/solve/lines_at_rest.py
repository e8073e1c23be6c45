"""The equilibrium of lines that meet at points, without friction and with it (solve.statics)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain

from hybrid.errors import Outcome
from hybrid.kernels.state.report import FRICTION, WAVES
from hybrid.kernels.state.state import Floats
from hybrid.solve.joined import JoinedLine, NetworkState
from hybrid.solve.network_solver import NO_BODIES, NetworkSolver
from hybrid.solve.search import PUSHED, Attempt, Start, Tally, attempts, first_sound, pulled, stuck, summary_of
from hybrid.solve.statics import Equilibrium


@dataclass(frozen=True)
class LinesAtRest:
    """A static solution: the state, how it was found (`path`), iterations, and its proof, the largest force
    out of balance at a node or a point (N)."""

    state: NetworkState
    path: tuple[str, ...]
    iterations: int
    residual: float
    made: NetworkSolver | Callable[[], NetworkSolver]  # whose reports are those of the solution, or what makes it
    settled: bool = False  # True where a damped motion with contact led there
    unjudged: str = ""  # where settled: why it is not known that it would stay
    with_friction: frozenset[int] = frozenset()  # numbers of the lines of which friction on the bed took part
    alone: tuple[Equilibrium, ...] = ()  # of each line where all are joined to nothing that moves: found one by one
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
    def blurred(self) -> set[int]:
        """Numbers of lines of which round-off hides whether they buckle."""
        return {k for k, x in enumerate(self.alone) if x.blurred} if self.alone else self.solver.blurred

    @property
    def presses_bodies(self) -> bool:
        """Whether lines touch a body that is free."""
        return not self.alone and self.solver.presses_bodies

    @property
    def pushed(self) -> bool:
        """Whether it is beside an equilibrium that is not stable."""
        return PUSHED in self.path[-1]

    @property
    def summary(self) -> str:
        """How it was found, in one line."""
        return summary_of(self.path, self.iterations)


def lines_at_rest(
    lines: Sequence[JoinedLine], points: int, bodies: Floats, starts: Iterable[Start], others: Iterable[Start] = (),
    refused: Callable[[NetworkState], tuple[Outcome, int, int]] | None = None,
) -> LinesAtRest:  # fmt: skip
    """Equilibrium of lines without friction; starts, others: as of `attempts`; refused: as of `first_sound`.

    LineFailed: no way leads to lines under tension.
    """
    solver, tally = NetworkSolver(_with_bits(lines, ()), points, bodies), Tally()
    return _found(*first_sound(attempts(solver, starts, others, tally), tally, refused), solver, tally)


def settled_with_friction(
    lines: Sequence[JoinedLine], points: int, bodies: Floats, ways: Mapping[int, str], found: LinesAtRest,
    first: NetworkState,
) -> LinesAtRest:  # fmt: skip
    """The equilibrium with friction of the lines named in `ways`, by number.

    ways: "pull": laid without tension along the equilibrium without friction (`found`), or where a current acts along
    that in still water, then pulled tight, all such lines together; "start", and where that fails: at rest after a
    damped motion from the first shapes; "usual" for all: pulled tight, and nothing else.  LineFailed.
    """
    solver, tally, tried = NetworkSolver(_with_bits(lines, ways), points, bodies), Tally(), list[Iterable[Attempt]]()
    tally.total = found.iterations
    if "start" not in ways.values():
        smooth = NetworkSolver(_with_bits(lines, ()), points, bodies)
        tried.append(pulled(smooth, solver, [*ways], found.state, tally))
    if set(ways.values()) != {"usual"}:
        tried.append(stuck(solver, ways, first, "the first shapes", tally))
    return _found(*first_sound(chain(*tried), tally, before=found.path), solver, tally, frozenset(ways))


def _with_bits(lines: Sequence[JoinedLine], rough: Iterable[int]) -> list[JoinedLine]:
    """Lines without waves, and all but those of the numbers `rough` without friction.

    With friction a slack solution is not taken.
    """
    rough, found = {*rough}, []
    for k, x in enumerate(lines):
        bits = x.line.bits & ~(WAVES | (0 if k in rough else FRICTION))
        found.append(x._replace(line=x.line._replace(bits=bits), slackens=x.slackens and not rough))
    return found


def _found(
    path: tuple[str, ...], tried: Attempt, solver: NetworkSolver, tally: Tally, rough: frozenset[int] = frozenset()
) -> LinesAtRest:
    residual = solver.evaluate_forces(tried.states, solver.anchor).residual
    return LinesAtRest(tried.states, path, tally.total, residual, solver, with_friction=rough)
