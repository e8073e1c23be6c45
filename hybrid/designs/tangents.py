"""Tangents along the steps of a run: what its results answer to all numbers, in one run.

Beside each step the line of a scene with a little more of a number is kept at the tangent of the step's end, with the
factors of the step itself (kernels.watch.tangents).  What a kernel does not follow is refused here (`Unfollowed`), and
is left to differences of runs.

They are of all lines together, with the points and bodies that these are joined to (kernels.run.network_tangents).  A
cable is the network of one line.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.designs.line_at_rest import displaced
from hybrid.designs.replay import Places, at_nodes
from hybrid.kernels.junctions.bodies import FRAME, MASS, PIECES, V, W, X
from hybrid.kernels.junctions.joined_lines import TURNS
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.run.network_tangents import (
    A_OF,
    TANGENTS,
    TURN_OF,
    VD_OF,
    WA_OF,
    WD_OF,
    advance_in_plane,
    advance_joined,
    blank_bodies,
    blank_network_tangents,
    correct_beside,
)
from hybrid.kernels.run.newton import workspace
from hybrid.kernels.state import books as b
from hybrid.kernels.state.books import Books, Clock, Counts, blank_books, sample_size
from hybrid.kernels.state.report import ASSEMBLED, FRICTION, PLANAR, SELF_CONTACT, SOIL, VORTICES, WAVES
from hybrid.kernels.state.state import (
    LANES,
    Batch,
    Ends,
    Floats,
    Line,
    Moves,
    Sea,
    State,
    Work,
    batch_of_one,
    state_for,
)
from hybrid.kernels.watch.tangents import (
    LARGEST_R,
    LARGEST_T,
    LEFT_R,
    LEFT_T,
    PHASES,
    SLOPES,
    TANGENT_SIZES,
    blank_other,
    blank_tangent_job,
)
from hybrid.model.build import Model, in_space, planar
from hybrid.model.ends import table_of_loads
from hybrid.model.nearby import weaknesses
from hybrid.model.network import NetworkModel, NetworkResolution, build_network
from hybrid.model.resolution import Resolution
from hybrid.scene.network import Network
from hybrid.scene.schema import LineScene
from hybrid.simulation.equilibrium import joined_lines
from hybrid.simulation.run import Run
from hybrid.simulation.run_line import observer_of
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.network_steps import batch_of_rows
from hybrid.solve.stepper import HEAVY, POWERS, JoinedLine, NetworkState

# Parts of a number by which the scene of the other line differs: rounding by PART is as much as what both sides differ
# by, 1e-6 of forces at anchors (bench/test_bench_tangents.py).
PART = 2.5e-6
OF_PLACES = 1e-7  # of coordinates: what moves a line far moves nodes into contact and out of it
OF_LENGTHS = 1e-8  # of lengths, for the same reason
PLACE, LENGTH = re.compile(r"(position\[\d\]|\.z|\.surface)$"), re.compile(r"(\blength|\.at(\[\d\])?)$")
# Phases of waves round the motion more than other numbers do, and waves move a line less than these.
OF_WAVES, WAVE = 4e-6, re.compile(r"\bwaves\b")
# Of the axes of two planes that are one, by rounding.
SAME_PLANE = 1e-12
# Part of the length, and of the tension scale, that a number moves by no more than by rounding: of a line in a plane
# what leaves it changes no tension.
ROUNDED = 1e-12
AT_START = 2  # corrections of an equilibrium, and of first accelerations, with factors of their own
# Numbers that outputs of the other lines may take in memory, 1 GB.
MOST_SAMPLED = 128_000_000


class Unfollowed(Exception):
    """Why tangents cannot follow a run; number: by which alone, counted as they are given, None: by any."""

    number: int | None = None


def step_of(key: str, size: float) -> float:
    """By how much the scene of the other line differs in a number; size: that of the number."""
    kinds = (LENGTH, OF_LENGTHS), (PLACE, OF_PLACES), (WAVE, OF_WAVES)
    return size * next((part for pattern, part in kinds if pattern.search(key)), PART)


def has_two_sides(keys: Iterable[str], number: float) -> bool:
    """Whether results by a number are seen from both sides: nodes go along with lengths past the places of outputs.

    So is a number that is 0, which has to be allowed to be less.
    """
    return number == 0.0 or any(LENGTH.search(key) for key in keys)


class Tangent(NamedTuple):
    """Tangents of a line by a number, whose other line has more of it by a step.

    Of its state, of the spin of its cells; sizes (kernels.watch.tangents), and that step.
    """

    rate: State
    spin: Floats
    sizes: Floats
    h: float


class Seen(NamedTuple):
    """Results of a scene with another number: `values` (nt, ...) by name, at arc lengths s, m, and times t, s."""

    scene: LineScene
    values: Mapping[str, Floats]
    s: Floats
    t: Floats


def joined(batches: Sequence[Batch]) -> Batch:
    """One after the other; what does not vary from output to output is that of the last one."""
    counts = [x.t.size for x in batches]
    parts: list[Any] = []
    for x in zip(*batches, strict=True):
        arrays: list[Any] = list(x)
        every = [len(y) for y in arrays] == counts and len({y.ndim for y in arrays}) == 1
        parts.append(np.concatenate(arrays) if every else arrays[-1])
    return Batch(*parts)


def line_like(model: Model, base: Model) -> Line:
    """The line of a scene with more of a number, of the kind of that of the run.  Unfollowed: it is another."""
    line = model.line
    if base.line.bits & PLANAR and not line.bits & PLANAR:
        if base.plane is None or not lie_in(base.plane, model):
            raise Unfollowed("the number moves the plane of the line")
        line = planar(line, base.plane)
    elif line.bits & PLANAR and not base.line.bits & PLANAR:
        raise Unfollowed("the line has left its plane")
    pairs: Any = zip(line, base.line, strict=True)
    for name, (x, y) in zip(line._fields, pairs, strict=True):
        alike = x.shape == y.shape if isinstance(x, np.ndarray) else x == y
        if not alike or (name in ("element", "spin") and not np.array_equal(x, y)):
            raise Unfollowed(f"the number changes what the line has ({name})")
    if not np.array_equal(model.ends.values.held, base.ends.values.held):
        raise Unfollowed("the number changes what ends hold")
    return line


def lie_in(plane: Floats, model: Model) -> bool:
    """Whether a line lies in a plane (3, 3): its number has not moved that."""
    return model.plane is not None and bool(np.abs(model.plane - plane).max() <= SAME_PLANE)


def unknown_of(model: Model) -> dict[str, bool]:
    """What kernels of tangents do not know of a line, and whether it has that."""
    line = model.line
    found = {"the line may touch itself": bool(line.bits & SELF_CONTACT), "soil remembers": bool(line.bits & SOIL)}
    found |= {"vortices follow the motion": bool(line.bits & VORTICES)}
    found |= {"friction of the bed": bool(line.bits & FRICTION), "obstacles move": line.moved.size > 0}
    found |= {"tension is no multiple of strain": line.law.size > 0, "layers slip": line.slip_law.size > 0}
    found |= {
        "tension makes a torque": line.tension_torque.size > 0,
        "loads change in the run": bool(model.ends.breaks),
    }
    return found | {"a torque passes through catenary zones": line.torsion.size > 0}


def bind_other(
    room: NDArray[np.int64],
    line: Line,
    ends: Ends,
    sea: Sea,
    moves: Moves,
    there: State,
    tangent: Tangent,
    books: Books,
    same: bool,
) -> tuple[Table, Floats]:
    """Fill `room` with an OtherLine (kernels.watch.tangents) at `there`: its table, and its report.

    same: whether its waves are those of the run.
    """
    cells, table = line.h.size, Table(blank_other, room)
    work = workspace(cells)
    table.bind(line=line, sea=sea, ends=ends, moves=moves, even=there, odd=there.copy(), work=work, books=books)
    table.bind(rates=tangent.rate, spin=tangent.spin, sizes=tangent.sizes, h=float(tangent.h))
    table.bind(before=tangent.rate.copy(), spin_before=tangent.spin.copy())
    table.bind(left=np.zeros((cells + 1, 5)), same_waves=int(same))
    return table, work.report


def bind_line(
    line: Line,
    ends: Ends,
    sea: Sea,
    states: tuple[State, State],
    work: Work,
    clock: Clock,
    counts: Counts,
    tables: NDArray[np.int64],
    found: NDArray[np.int64],
    same: bool,
) -> tuple[Table, Floats]:
    """A TangentJob of a line of a run, whose states take turns, and the report that it works with.

    same: whether waves of other lines are its own.
    """
    cells, table = line.h.size, Table(blank_tangent_job)
    own = workspace(cells)._replace(u=work.u)
    around = sea._replace(slid=np.zeros((cells + 1, 3)), bed=np.zeros((cells + 1, 3)))
    table.bind(line=line, sea=around, ends=ends, even=states[0], odd=states[1], work=work, own=own)
    table.bind(clock=clock, counts=counts, found=found, tables=tables, last=states[0].a.copy())
    table.bind(left=np.zeros((cells + 1, 5)), ahead=np.zeros((cells + 1, 3)))
    table.bind(slopes=np.zeros(((cells + 1) * same, SLOPES)), lanes=np.zeros((PHASES + 2 * len(sea.waves), LANES)))
    return table, own.report


def books_beside(clock: Clock, outputs: Floats, done: int, cells: int, ends: Ends, report: Floats) -> Books:
    """Books of another line, whose outputs are those of the run, of which so many are done."""
    books = blank_books(cells)
    books.counts.output, books.report[0] = done, report
    for k in (0, 1):
        parts = (ends.position[k], ends.frame[k], ends.spin[k], ends.force[k], ends.moment[k])
        books.imposed[0, k] = np.concatenate(parts)
    samples = np.zeros((outputs.size - done, sample_size(cells)))
    return books._replace(clock=clock, outputs=outputs, samples=samples)


def opposite(here: Batch, more: Batch) -> Batch:
    """Outputs as far from those of the run to the other side; what has no value, or is no number, stays."""
    parts: list[Any] = []
    both: Any = zip(here, more, strict=True)
    for x, y in both:
        with np.errstate(invalid="ignore"):
            away = x - y if y.dtype.kind == "f" and y.size else None
        parts.append(y if away is None else np.asarray(x + np.where(np.isfinite(away), away, 0.0)))
    return Batch(*parts)


def same_waves(one: Sea, other: Sea) -> bool:
    """Whether waves are the same everywhere and at all times."""
    names = "waves", "orbits", "stretched", "depth", "surface", "ramps"
    return all(np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True) for name in names)


def beside(here: State, rate: State, spin: Floats, h: float) -> State:
    """The state of another line, at h times tangents from this one."""
    q = np.zeros((1, here.T.size + 1, 5))
    q[0, :, 1:4], q[0, 1:, 0], q[0, :-1, 4] = rate.r, rate.T, spin
    moved = {name: x[0] for name, x in displaced(here, q, np.array([h])).items()}
    rates = {name: getattr(here, name) + h * getattr(rate, name) for name in ("v", "a", "vd", "w", "wa", "wd")}
    return here.copy()._replace(**moved, **rates)


def at_rest(line: Line) -> Line:
    """A line in space, without what does not act in an equilibrium."""
    return in_space(line._replace(bits=line.bits & ~(FRICTION | WAVES)))


class _Other(NamedTuple):
    """The scene with more of a number: its model, its lines, tangents of these and of bodies (B, TANGENTS)."""

    model: NetworkModel
    lines: list[Line]
    joined: list[JoinedLine]
    tangents: list[Tangent]
    bodies: Floats
    h: float


class _Tables(NamedTuple):
    """What kernels work with: a job, and all that it has the addresses of."""

    job: Table
    asked: NDArray[np.int64]
    by: Floats
    reports: list[list[Floats]]  # of the other lines, by number and line
    own: list[Floats]  # of the lines of the run
    kept: list[Any]


class NetworkOthers:
    """The networks of scenes with more of each number beside that of a run, and with less on its other side."""

    def __init__(
        self,
        network: Network,
        scenes: Sequence[tuple[Network, Network | None]],
        steps: Sequence[float],
        lines: Mapping[str, Resolution],
        more: Places | None = None,
    ) -> None:
        """Tangents of a run, by scenes whose numbers differ by a step.

        network: of the run; scenes: with more of each number by a step, and with less (None: it is not computed);
        lines: how finely, by name; more: arc lengths of outputs beside nodes; None: as the scene asks.
        """
        self._network, self._more = network, more
        self._scenes, self._steps, self._resolution = list(scenes), list(steps), NetworkResolution(lines)
        self._models = [build_network(more, self._resolution) for more, _ in scenes]
        self.sizes = np.zeros((len(scenes), len(lines), TANGENT_SIZES))
        self._first: list[list[Batch]] = []  # by number and line
        self._base: list[list[Batch]] = [[] for _ in lines]  # outputs of the run
        self._books: list[list[Books]] = []
        self._found = np.zeros((len(lines), 2), np.int64)

    @property
    def are_flat(self) -> bool:
        """Whether all lines lie in one plane, whatever the number, and none is joined to what moves with it."""
        every = [build_network(self._network, self._resolution), *self._models]
        plane, joined = every[0].models[0].plane, any(k >= 0 for model in every for ends in model.joints for k in ends)
        return plane is not None and not joined and all(lie_in(plane, x) for model in every for x in model.models)

    def begin(self, run: Run) -> None:
        """Stand beside the state that a run begins with, and follow its steps from there on.  Unfollowed."""
        self._run, self._model = run, run.model
        refuse_network(run)
        self._others = []
        for k, (model, h) in enumerate(zip(self._models, self._steps, strict=True)):
            try:
                self._others.append(self._other(model, k, h))
            except Unfollowed as why:
                why.number = k
                raise
        cells = sum(sample_size(x.line.h.size) for x in self._model.models)
        if run.loop.outputs.size * len(self._others) * cells > MOST_SAMPLED:
            raise Unfollowed("outputs of so many numbers do not fit into memory")
        if run.found is None:
            self._place()
        else:
            self._rest()
        reports = self._accelerate()
        self._call_each_step(reports)
        for l, line in enumerate(run.lines):
            state, ends, sea = run.state.lines[l], self._ends(run.solver.lines[l], run.state.lines[l]), line.model.sea
            self._base[l].append(
                deepcopy(batch_of_one(0.0, ends, state, line.books.report[0], np.zeros(len(POWERS)), sea.at_time(0.0)))
            )
            line.shown = lambda batch, l=l: self._base[l].append(deepcopy(batch))

    def _other(self, model: NetworkModel, k: int, h: float) -> _Other:
        base = self._model
        if model.joints != base.joints or model.seats[:, :, TURNS].any() or model.rides.size:
            raise Unfollowed("the number changes what lines are joined to")
        lines = [line_like(x, y) for x, y in zip(model.models, base.models, strict=True)]
        tangents = [
            Tangent(state_for(line), np.zeros(line.h.size), self.sizes[k, l], h) for l, line in enumerate(lines)
        ]
        return _Other(model, lines, joined_lines(model, 0.0), tangents, np.zeros((len(base.body_places), TANGENTS)), h)

    # --- the start --------------------------------------------------------------------------------------

    def _place(self) -> None:
        """Tangents of lines that start as they are placed, between ends that are held or free."""
        for other in self._others:
            for tangent, base, more in zip(other.tangents, self._model.models, other.model.models, strict=True):
                if base.start.v.any() and not base.line.ck.all():
                    raise Unfollowed("an inextensible line moves at first")
                for name in ("r", "v", "T", "w"):
                    getattr(tangent.rate, name)[:] = (getattr(more.start, name) - getattr(base.start, name)) / other.h

    def _rest(self) -> None:
        """Tangents of the equilibrium that the run begins with."""
        found = self._run.found
        assert found is not None
        state = self._run.state.copy()
        for now, rests in zip(state.lines, found.state.lines, strict=True):
            now.T[:] = rests.T
            for x in (now.v, now.a, now.vd, now.w, now.wa, now.wd):
                x[:] = 0.0
        state.bodies[:, V:] = 0.0
        for other in self._others:
            for l, (tangent, joints) in enumerate(zip(other.tangents, self._model.joints, strict=True)):
                for k in (0, 1):
                    here, there = (x.models[l].ends.at_time(0.0) for x in (self._model, other.model))
                    if joints[k] < 0 and here.held[k]:
                        tangent.rate.r[-k] = (there.position[k] - here.position[k]) / other.h
                    elif (body := joints[k] - len(self._model.places)) >= 0:
                        frame = state.bodies[body, FRAME:V].reshape(3, 3)
                        tangent.rate.r[-k] = (
                            frame @ (other.model.fairleads[l, k] - self._model.fairleads[l, k]) / other.h
                        )
        solver = self._solver(rests=True)
        for other in self._corrections(solver, state, solver.anchor, rests=True):
            for tangent, work in zip(other.tangents, solver.work, strict=True):
                tangent.rate.r[:] += work.x[:, 1:4]
                tangent.rate.T[:] += work.x[1:, 0]
                tangent.spin[:] += work.x[:-1, 4]
            other.bodies[:, : TURN_OF + 3] += solver.body_work[:, X : X + 6]

    def _accelerate(self) -> list[list[Floats]]:
        """Tangents of accelerations and tensions that are consistent with loads, and reports of the other lines."""
        run, dt = self._run, 1e-3 * self._run.resolution.one.step
        for other in self._others:
            for l, (tangent, joints) in enumerate(zip(other.tangents, self._model.joints, strict=True)):
                base, more = (x.models[l].ends.acceleration(0.0, dt).copy() for x in (self._model, other.model))
                for k in (0, 1):
                    if joints[k] < 0 and self._model.models[l].ends.values.held[k]:
                        tangent.rate.vd[-k] = (more[k] - base[k]) / other.h
        solver, state = self._solver(rests=False), run.state.copy()
        for other in self._corrections(solver, state, HEAVY, rests=False):
            for tangent, work, line in zip(other.tangents, solver.work, other.lines, strict=True):
                turning = (line.spin == 1) & (line.polar > 0)
                rate, x = tangent.rate, work.x
                rate.vd[:] += HEAVY * x[:, 1:4]
                rate.T[:] += x[1:, 0]
                rate.wd[turning] += HEAVY * x[:-1, 4][turning]
                rate.a[:], rate.wa[:] = rate.vd, rate.wd
                tangent.spin[:] += x[:-1, 4]
            for row, here, own, x in zip(other.bodies, state.bodies, solver.bodies, solver.body_work, strict=True):
                row[VD_OF : VD_OF + 3] += HEAVY * x[X : X + 3]
                if own[MASS + 21 : MASS + 36].any():  # a turn without inertia has no acceleration
                    row[WD_OF : WD_OF + 3] += HEAVY * x[X + 3 : X + 6] @ here[FRAME:V].reshape(3, 3)
                row[A_OF : A_OF + 3], row[WA_OF : WA_OF + 3] = row[VD_OF : VD_OF + 3], row[WD_OF : WD_OF + 3]
        reports = []
        for p in range(len(self._others)):
            each = [line.books.report[0].copy() for line in run.lines]
            for report, there, own in zip(each, self._tables.reports[p], self._tables.own, strict=True):
                report[:ASSEMBLED] += (there - own)[:ASSEMBLED]
            reports.append(each)
        return reports

    def _solver(self, rests: bool) -> NetworkSolver:
        """For the state that the run begins with; rests: without what does not act at rest."""
        lines = joined_lines(self._model, 0.0)
        lines = [x._replace(line=at_rest(x.line) if rests else in_space(x.line)) for x in lines]
        solver = NetworkSolver(lines, len(self._model.free), self._run.solver.bodies.copy())
        solver.keep_factors()
        return solver

    def _corrections(self, solver: NetworkSolver, state: NetworkState, ca: float, rests: bool) -> Iterator[_Other]:
        """Others in turn, for which the solver has corrections of tangents, which the caller adds."""
        self._tables = tables = self._bind(solver, (state, state.copy()), rests)
        if not solver.factor(state, ca):
            raise Unfollowed("the equations of the start have no factors")
        tables.by[:] = 0.0, ca
        for p, other in [(-1, None), *enumerate(self._others)]:
            tables.asked[0] = p
            for last in [*((AT_START if other is not None else 0) * [False]), True]:
                correct_beside(tables.job.numbers)
                if other is not None and not last:
                    yield other

    # --- what kernels work with -------------------------------------------------------------------------

    def _bind(
        self,
        solver: NetworkSolver,
        states: tuple[NetworkState, NetworkState],
        rests: bool = False,
        clock: Clock | None = None,
        counts: Counts | None = None,
        books: Callable[[int, int], Books] | None = None,
    ) -> _Tables:
        """Tables for lines of a solver between states that take turns."""
        number, clock = len(self._others), b.Clock() if clock is None else clock
        counts = b.Counts() if counts is None else counts
        jobs, kept, own = [], [], []
        reports: list[list[Floats]] = [[] for _ in self._others]
        size = Table(blank_other).numbers.size
        for l, (x, here) in enumerate(zip(solver.lines, states[0].lines, strict=True)):
            tables, same = np.zeros((number, size), np.int64), []
            for p, other in enumerate(self._others):
                there, tangent, line = other.joined[l], other.tangents[l], other.lines[l]
                same.append(bool(line.bits & WAVES) and same_waves(x.sea, there.sea))
                state = beside(here, tangent.rate, tangent.spin, other.h)
                some = books(p, l) if books is not None else b.blank_books(line.h.size)
                own_line, moves = at_rest(line) if rests else line, other.model.models[l].ends.moves()
                how = own_line, there.ends, there.sea, moves, state, tangent, some
                table, report = bind_other(tables[p], *how, same[-1])
                reports[p].append(report)
                kept.append(table)
            what, both = (x.line, x.ends, x.sea), (here, states[1].lines[l])
            job, report = bind_line(*what, both, solver.work[l], clock, counts, tables, self._found[l], any(same))
            own.append(report)
            jobs.append(job)
        turns, bodies = solver.swap_states(states), [self._bind_bodies(x, solver, states[0]) for x in self._others]
        asked, by, table = np.zeros(1, np.int64), np.zeros(2), Table(blank_network_tangents)
        even, odd = solver.jobs_of_joined()
        table.bind(even=even.numbers, odd=odd.numbers, joined=turns["joined"], lone=turns["lone_lines"])
        table.bind(lines=np.array([x.numbers for x in jobs]), bodies=np.array([x.numbers for x in bodies]))
        table.bind(clock=clock, counts=counts, asked=asked, by=by)
        return _Tables(table, asked, by, reports, own, [*kept, *jobs, *bodies, even, odd])

    def _bind_bodies(self, other: _Other, solver: NetworkSolver, state: NetworkState) -> Table:
        table, count = Table(blank_bodies), len(state.bodies)
        loads, history = table_of_loads(other.model.growing_loads(0.0))
        table.bind(numbers=other.model.body_numbers(0.0), fairleads=other.model.fairleads[solver.joined].copy())
        table.bind(loads=loads, history=history, rates=other.bodies, before=np.zeros((count, TANGENTS)), h=other.h)
        table.bind(old=state.bodies.copy(), new=state.bodies.copy(), work=solver.body_work.copy())
        table.bind(right=np.zeros((count, 6)))
        return table

    def _call_each_step(self, reports: Sequence[Sequence[Floats]]) -> None:
        """Have the run call the kernel behind every step."""
        run = self._run
        loop, solver = run.loop, run.solver
        solver.keep_factors()
        done = int(loop.counts.output)

        def books(p: int, l: int) -> Books:
            x, report = self._others[p].joined[l], reports[p][l]
            return books_beside(loop.clock, loop.outputs, done, x.line.h.size, x.ends, report)

        self._books = [[books(p, l) for l in range(len(run.lines))] for p in range(len(self._others))]
        for p, other in enumerate(self._others):
            first = []
            for l, (x, tangent) in enumerate(zip(other.joined, other.tangents, strict=True)):
                there = beside(run.state.lines[l], tangent.rate, tangent.spin, other.h)
                ends = self._ends(x, there)
                first.append(batch_of_one(0.0, ends, there, reports[p][l], np.zeros(len(POWERS)), x.sea))
            self._first.append(first)
        self._found[:] = 0
        self._tables = self._bind(
            solver, loop.turns, clock=loop.clock, counts=loop.counts, books=lambda p, l: self._books[p][l]
        )
        numbers = self._tables.job.numbers
        flat = bool(self._model.models[0].line.bits & PLANAR)
        loop.bind_tangents(numbers, (advance_in_plane if flat else advance_joined).address(numbers))

    def _ends(self, x: JoinedLine, state: State) -> Any:
        """What ends of a line impose, as outputs have it: they are where its nodes are."""
        return x.ends._replace(held=np.minimum(x.ends.held, 1), position=state.r[[0, -1]])

    @property
    def errors(self) -> Floats:
        """(P,) parts of tangents by which they may be off: what the last corrections leave of them."""
        models = self._model.models
        rounded = ROUNDED / np.abs(self._steps)[:, None]
        r = np.maximum(self.sizes[..., LARGEST_R], rounded * [x.length for x in models])
        T = np.maximum(self.sizes[..., LARGEST_T], rounded * [x.tension_scale for x in models])
        return np.asarray(np.maximum(self.sizes[..., LEFT_R] / r, self.sizes[..., LEFT_T] / T).max(axis=1))

    # --- what is found ----------------------------------------------------------------------------------

    def results(self, names: Mapping[str, Sequence[str]]) -> list[tuple[Mapping[str, Seen], ...]]:
        """Results by name at all outputs of lines.

        Of the scene itself, then of every number of the scenes with more of it, and with less.  Raises Unfollowed.
        """
        run = self._run
        if run.model is not self._model or (self._found != [run.steps, 0]).any():
            raise Unfollowed("a line, or what acts on it, becomes another one in the run")
        base = {l: joined(self._base[l]) for l, name in enumerate(self._model.names) if name in names}
        here = self._looked_at(self._network, self._model, base, names)
        return [(here,), *(self._seen(p, base, names) for p in range(len(self._others)))]

    def _seen(
        self, p: int, base: Mapping[int, Batch], names: Mapping[str, Sequence[str]]
    ) -> tuple[Mapping[str, Seen], ...]:
        more = {}
        for l in base:
            books, cells, held = self._books[p][l], self._model.models[l].line.h.size, self._run.lines[l].held
            rest = batch_of_rows(books.samples[: int(books.counts.samples)], cells, held, False, 0, 0)
            more[l] = joined([self._first[p][l], rest])
        scene, other = self._scenes[p]
        seen = self._looked_at(scene, self._others[p].model, more, names)
        if other is None:
            return (seen,)
        less = {l: opposite(base[l], x) for l, x in more.items()}
        return seen, self._looked_at(other, build_network(other, self._resolution), less, names)

    def _looked_at(
        self, network: Network, model: NetworkModel, batches: Mapping[int, Batch], names: Mapping[str, Sequence[str]]
    ) -> dict[str, Seen]:
        out = {}
        for l, batch in batches.items():
            name, x = model.names[l], model.models[l]
            scene = network.scene_of(name, network.carried(name), network.guesses)
            if self._more is not None:
                output = scene.output.model_copy(update={"points": at_nodes(x.line.s, self._more.get(name, ()))})
                scene = replace(scene, output=output)
            observer = observer_of(scene, x, True)
            observer = observer.on(line_like(x, self._model.models[l]), x.sea.values, x.zones, x.hinges)
            observer = observer.of(names[name])
            out[name] = Seen(
                scene, observer.values_of(observer.observation(batch)), np.asarray(observer.s), batch.t.copy()
            )
        return out


def refuse_network(run: Run) -> None:
    """Unfollowed where a run has what the kernel does not know, with what that is."""
    model, what = run.model, dict[str, bool]()
    for x in model.models:
        what |= {text: there or what.get(text, False) for text, there in unknown_of(x).items()}
    what["loads change in the run"] |= bool(model.breaks)
    rest = run.found
    what |= {
        "lines start as they are placed": rest is None and len(model.body_places) > 0,
        "lines touch each other": (rest is not None and rest.settled) or run.solver.shared is not None,
        "zones move": any(x.manager is not None for x in run.lines),
        "line is paid out": any(x.paying is not None for x in run.lines),
        "connections may break": bool(weaknesses(run.network)),
        "a line is clamped to what turns with it": bool(model.seats[:, :, TURNS].any()),
        "a body has a shape": bool(model.rides.size),
        "a body has members": bool((run.solver.bodies[:, PIECES] > 0.0).any()),
        "some lines lie in planes": len({x.line.bits & PLANAR for x in model.models}) > 1,
        "bodies turn at first": bool(run.state.bodies[:, W : W + 3].any()),
        "steps follow errors": run.loop.controlled,
    }
    if unknown := [text for text, found in what.items() if found]:
        raise Unfollowed(", ".join(unknown))
