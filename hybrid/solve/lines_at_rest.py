"""Equilibria of lines, of one or of several that meet: without friction and with it, and of lines that touch.

A line that is joined to nothing that moves is a group of one: it is solved by itself, and sought in
its plane first where it lies in one.  Ways and their order are those of solve.search.

With contact an equilibrium would stay where one stiffness of all lines, points and contact is positive definite.  Line
by line that cannot be judged: what one line rests on is another one, which gives way.  Points move; bodies and what is
clamped to them are held where they are, so that a motion of these alone is not found.

It is found by a damped motion with contact until it rests, then by Newton with contact.  Statics find an equilibrium
from any shape, and Newton's path there may pass a line through itself or another one.  A motion from a start that is
apart does not, so its rest has the loops and crossings that the start and the ends imply.  Friction, between strands
and on the bed, is left out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain, islice, pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.errors import Outcome
from hybrid.kernels.contact.self_contact_law import ACROSS, ALONG, FOLLOWS, FORCE, NORMAL, RATES, SLOPE, WX, WY, P, Q
from hybrid.kernels.contact.self_contact_pairs import Contact
from hybrid.kernels.junctions.bodies import V
from hybrid.kernels.state.books import blank_books
from hybrid.kernels.state.report import FREE, FRICTION, PLANAR, SELF_CONTACT, SELF_FRICTION, TWIST, WAVES
from hybrid.kernels.state.state import Floats
from hybrid.kernels.step.accept import LARGEST_TWIST
from hybrid.model.build import leaves_plane, planar, untwist
from hybrid.solve.contact import SelfContact, SharedContact
from hybrid.solve.network_solver import NO_BODIES, NetworkSolver
from hybrid.solve.search import (
    MOST_FALLS,
    PULLED,
    PUSHED,
    Attempt,
    Start,
    Tally,
    are_same,
    attempts,
    damped_bodies,
    first_sound,
    pulled,
    stuck,
    summary_of,
    time_scale_of,
)
from hybrid.solve.stability import (
    ANCHOR,
    CALM,
    LOST,
    NEUTRAL,
    SHIFTED,
    Stability,
    along,
    damped,
    gyration,
    is_stable,
    is_without_moment,
    nudged,
    slack_cell,
    slack_text,
    stiffest_bending,
    stop,
)
from hybrid.solve.stability import CONTACT_DAMPING as DAMPING
from hybrid.solve.stepper import JoinedLine, LineFailed, NetworkState, NetworkTaken

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
    group: Group,
    starts: Iterable[Start],
    others: Sequence[Start] = (),
    refused: Refused | None = None,
    quick: bool = False,
    rubs: bool = True,
) -> LinesAtRest:
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
        later = ((name, group.begun(state)) for name, state in starts)
        roads: list[Iterable[Attempt]] = [attempts(smooth, begun if quick else chain(begun, later), more, tally)]
        if quick:
            roads = [islice(roads[0], 1)]
        elif rough and rubs:
            solvers = map(group.solver, [rough])  # made when that road is taken
            roads.append(x for solver in solvers for x in stuck(solver, rough, begun[0][1], name, tally))
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


# --- lines that touch --------------------------------------------------------------------------

EACH = 4  # unknowns of a node, (r, psi)
# Sample points of contact lie a quarter of a diameter apart, and a line rests between them as in hollows: whether it
# would slide without these is asked of that many times more.
FINER = 4


def contact_stiffness(contact: Contact) -> tuple[NDArray[np.int64], Floats]:
    """Nodes (n, 6) of the latest points of contact, and their stiffness (n, 18, 18), N/m.

    Three nodes of each piece; second derivatives of energies by the places of these nodes
    (kernels.contact.self_contact_law).
    """
    rows = contact.points[: contact.counts.points]
    n, slope = rows[:, NORMAL : NORMAL + 3], rows[:, SLOPE : SLOPE + 3]
    weights = np.concatenate([rows[:, WX : WX + 3], -rows[:, WY : WY + 3]], axis=1)
    rates = np.concatenate([np.zeros((len(rows), 3)), rows[:, RATES : RATES + 3]], axis=1)
    across, along = rows[:, ACROSS, None, None], rows[:, ALONG, None, None]
    law = across * np.eye(3) + (along - across) * n[:, :, None] * n[:, None, :]
    H = np.einsum("ki,kj,kab->kiajb", weights, weights, law).reshape(-1, 18, 18)
    b = -weights[:, :, None] * slope[:, None, :] - rates[:, :, None] * n[:, None, :]
    b = rows[:, FORCE, None] * b.reshape(-1, 18)
    H -= rows[:, FOLLOWS, None, None] * b[:, :, None] * b[:, None, :]
    pieces = rows[:, [P, Q]].astype(np.int64)
    return (pieces[:, :, None] + np.arange(-1, 2)).reshape(-1, 6), H


def _factor(matrix: Any) -> Any:
    """A factor of a symmetric matrix, taken without exchanges; None: the matrix is not positive definite."""
    from scipy.sparse.linalg import splu

    try:
        factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError:  # singular
        return None
    definite = np.array_equal(factor.perm_r, factor.perm_c) and factor.U.diagonal().min() > 0.0
    return factor if definite else None


class ContactStability:
    """Judges equilibria of a solver whose lines touch each other or themselves."""

    def __init__(self, solver: NetworkSolver) -> None:
        self._solver, lines, points = solver, solver.lines, len(solver.net)
        # Of the last equilibrium: whether it would not stay with more sample points; whether round-off hides it.
        self.in_hollows = self.blurred = False
        begins = np.concatenate([[0], np.cumsum([x.line.s.size for x in lines])])
        self._nodes = [np.arange(a, b) for a, b in pairwise(begins.tolist())]
        self._parts = [Stability(x.line, x.sea, x.length, x.scale) for x in lines]
        self._ends, self._same = [], np.arange(EACH * begins[-1])  # of each unknown, the one that it is
        first: dict[int, int] = {}
        for x, nodes in zip(lines, self._nodes, strict=True):
            held = np.minimum(x.ends.held, 1)
            for end in (0, 1):
                if 0 <= x.joints[end] < points:  # one node of all lines that are joined to the point
                    held[end] = 0
                    node = int(nodes[-end])
                    of = first.setdefault(x.joints[end], node)
                    self._same[EACH * node : EACH * node + 3] = EACH * of + np.arange(3)
            self._ends.append(x.ends._replace(held=held))

    @property
    def judges(self) -> bool:
        """Whether no end has a moment, which keeps its direction and has no energy."""
        return all(is_without_moment(x.line, x.ends, x.length) for x in self._solver.lines)

    def holds(self, states: NetworkState) -> bool:
        """Whether an equilibrium would stay; True too where round-off hides it, as of one line (`Stability.holds`)."""
        finer = self._contact(states, FINER)
        self.in_hollows = finer is not None and not self._is_definite(states, finer)
        self.blurred = False
        return self._is_definite(states, self._contact(states, 1))

    def _is_definite(self, states: NetworkState, contact: Any) -> bool:
        """As of one line (`Stability.holds`), with this stiffness of contact."""
        soft = NEUTRAL / ANCHOR * self._solver.anchor
        if _factor(self._matrix(states, soft, contact)[0]) is not None:
            return True
        lost = LOST * max(float(stiffest_bending(x.line).max()) for x in self._solver.lines)
        self.blurred = lost > soft and _factor(self._matrix(states, lost, contact)[0]) is not None
        return self.blurred

    def softest_motion(self, states: NetworkState) -> tuple[float, list[Floats]]:
        """Square (1/s^2, below 0: it grows) and shapes (N+1, 3) of the lines of the softest motion of an equilibrium.

        The largest component is 1.
        """
        # not before they are needed: a short command does without scipy
        from scipy.sparse import diags_array, eye_array
        from scipy.sparse.linalg import LinearOperator, eigsh

        K, fixed = self._matrix(states, 0.0, self._contact(states, 1))
        masses = np.bincount(self._same, self._masses(), self._same.size)
        scales = np.where(fixed, 1.0, 1.0 / np.sqrt(np.where(masses > 0.0, masses, 1.0)))
        K = (diags_array(scales) @ K @ diags_array(scales)).tocsc()
        shift, one = self._solver.anchor, eye_array(scales.size, format="csc")
        while (factor := _factor((K + shift * one).tocsc())) is None:
            shift *= SHIFTED
        # numbers without a pattern, which no motion is orthogonal to; the same ones every time
        first = np.random.default_rng(0).standard_normal(scales.size)
        inverse = LinearOperator(K.shape, matvec=factor.solve, dtype=float)
        values, vectors = eigsh(inverse, k=1, which="LA", v0=first)
        moved = np.where(fixed, 0.0, scales * vectors[:, 0])[self._same].reshape(-1, EACH)[:, :3]
        moved = moved / moved.ravel()[np.abs(moved).argmax()]
        return float(1.0 / values[0] - shift), [moved[nodes] for nodes in self._nodes]

    def _masses(self) -> Floats:
        """Of the unknowns of the lines, kg, kg m^2; 0: it has none."""
        found = []
        for x in self._solver.lines:
            masses = np.repeat(x.line.mass[:, None], EACH, axis=1)
            masses[:, 3] = np.append(gyration(x.line, x.length), 0.0)
            found.append(masses.ravel())
        return np.concatenate(found)

    def _contact(self, states: NetworkState, finer: int) -> Any:
        """Stiffness of contact in states at rest, by the unknowns of the lines; None: there is no room for its points.

        finer: by how much more sample points lie on each piece than the law has.
        """
        from scipy.sparse import csc_array

        rows, columns, values = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)], [np.zeros(0)]
        for contact, lines in self._solver.contacts_at(states, finer):
            if contact.counts.overflow:
                return None
            nodes, H = contact_stiffness(contact)
            nodes = np.concatenate([self._nodes[k] for k in lines])[nodes]
            unknowns = (EACH * nodes[:, :, None] + np.arange(3)).reshape(-1, 18)
            rows.append(np.repeat(unknowns, 18, axis=1).ravel())
            columns.append(np.tile(unknowns, (1, 18)).ravel())
            values.append(H.ravel())
        entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
        return csc_array(entries, shape=(self._same.size, self._same.size))

    def _matrix(self, states: NetworkState, soft: float, contact: Any) -> tuple[Any, NDArray[np.bool_]]:
        """Stiffness of all, and which unknowns are none: held, or those of an end that is a point of another line.

        soft: 1/s^2, of springs of that times the mass; contact: `_contact` of the states.
        """
        from scipy.sparse import block_diag, csc_array, dia_array, diags_array

        blocks, held = [], []
        for part, ends, state in zip(self._parts, self._ends, states.lines, strict=True):
            band, fixed = part.band(ends, state, soft)
            size, reach = fixed.size, np.arange(band.shape[0])
            lower = dia_array((band, -reach), shape=(size, size))
            blocks.append(lower + lower.T - diags_array(band[0]))
            held.append(fixed)
        size = self._same.size
        fixed = np.concatenate(held) | (self._same != np.arange(size))
        free = diags_array((~np.concatenate(held)).astype(float))
        join = free @ csc_array((np.ones(size), (np.arange(size), self._same)), shape=(size, size))
        K = join.T @ (block_diag(blocks, format="csc") + contact) @ join
        return (K + diags_array(fixed.astype(float))).tocsc(), fixed


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
        return self._stability.judges and not len(self._solver.bodies)  # bodies are held there

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
        return not any(are_same(states, x, self._solver.length) for x in self._known)

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


def settled_network(
    lines: Sequence[JoinedLine],
    points: int,
    bodies: Floats,
    start: NetworkState,
    contacts: Contacts,
    keeps_turns: Callable[[NetworkState], tuple[int, str]],
    near: bool = False,
) -> LinesAtRest:
    """Equilibrium of a network with contact of lines with themselves, from a start that is at rest and apart.

    points: how many free points there are; contacts: makes contact, without friction; keeps_turns: a line that has lost
    turns in a state, and how many, empty: none has; near: Newton's method is tried from the start itself first.
    An equilibrium that would not stay is left by a small push.  LineFailed: the network does not come to rest,
    or only where it would not stay, a line has lost turns, or ends with a catenary that is not taut.
    """
    smooth = [x._replace(line=x.line._replace(bits=x.line.bits & ~(WAVES | FRICTION | SELF_FRICTION))) for x in lines]
    found = touching_solver(smooth, points, bodies, contacts)
    time_scale, path, total = time_scale_of(found), list[str](), 0
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
                rest = LinesAtRest(states, tuple(path), total + iterations, taken.residual, found, settled=True)
                return replace(rest, unjudged=falls.unjudged, blurred=frozenset(found.blurred))
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
