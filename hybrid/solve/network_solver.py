"""Lines that meet at points: their equilibrium, their consistent accelerations, and their steps in time.

One Newton for all of them (kernels.run.network).  States go in and come out as of a single line (solve.stepper); a free
point has none of its own, it is the last or first node of every line that is joined to it.  A body has a row of numbers
(kernels.junctions.bodies).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid.errors import Outcome
from hybrid.kernels.algebra.block_elimination import KEPT, ROW, SIZE, WIDTH
from hybrid.kernels.contact.self_contact import blank_contact_job
from hybrid.kernels.contact.self_contact_pairs import Contact
from hybrid.kernels.junctions.bodies import FRAME, LINES, MASS, NUMBERS, OWN, PLACE, VD, WA, WD, WORK, A, U, V, W, X
from hybrid.kernels.junctions.body_contact import CARRY
from hybrid.kernels.junctions.body_forces import EACH_BODY, TOUCHED
from hybrid.kernels.junctions.carried_frames import ANSWER, SEAT, TURNS
from hybrid.kernels.junctions.joined_lines import COLUMNS, FUNCTIONAL
from hybrid.kernels.junctions.junctions import HANDED
from hybrid.kernels.junctions.lines_contact import room_for_products
from hybrid.kernels.junctions.lone_lines import find_near, lead_lone
from hybrid.kernels.junctions.network_job import NetworkTask
from hybrid.kernels.laws.obstacle_motion import carry_obstacles
from hybrid.kernels.laws.soil import lie_in_soil, settle_in_soil
from hybrid.kernels.laws.water import wave_kinematics
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.run.entry import NO_PUSH, in_plane, in_space
from hybrid.kernels.run.network import JUNCTIONS, begin_line, book_system_step, solve_system
from hybrid.kernels.state.books import Books, blank_books
from hybrid.kernels.state.obstacle_rows import FREE, MOVES
from hybrid.kernels.state.report import (
    FRICTION,
    LOCAL_ERROR,
    NET_A,
    PLANAR,
    RESIDUAL,
    SEABED_ENERGY,
    TOUCHES,
    USED_RHO,
    WAVES,
)
from hybrid.kernels.state.state import NO_SHEAVES, Floats, Line, Sea, State, Work, state_for
from hybrid.kernels.step.job import blank_job
from hybrid.kernels.step.newton import ASSEMBLY, CORRECTION, EQUILIBRIUM, RUN, STEP, TOLERANCE, Limits, Task
from hybrid.kernels.step.step import friction_axes
from hybrid.kernels.step.step_law import REFUSED
from hybrid.kernels.watch.named_quantities import note_quantities
from hybrid.solve.flaws import buckling_line, flaw_of_lines
from hybrid.solve.joined import JoinedLine, JointJobs, NetworkState, NetworkTaken, Rooms
from hybrid.solve.line_solver import BALANCED, BALANCING, MOST_ITERATIONS
from hybrid.solve.self_contact import SelfContact, left_over
from hybrid.solve.shared_contact import SharedContact
from hybrid.solve.stability import ANCHOR, CONTACT_DAMPING
from hybrid.solve.stepper import HEAVY, REACH, lie_on_bed, workspace_of
from hybrid.solve.stepper import MOST_ITERATIONS as MOST_OF_STEP

# Springs of points and bodies that nothing holds, in the test of stability, as a part of tension scale over length.
NEUTRAL = 1e-6
# Of the longest line: arm by which moments on bodies are compared with forces, at least.
LEAST_ARM = 0.01
# Where lines touch Newton goes on once unless this many times the residual balances, too: a ball on lines that lie on
# others was 3e-7 m away from where it rests.
CLOSER = 100.0
NO_BODIES: Floats = np.zeros((0, NUMBERS))


def _carries(x: JoinedLine) -> bool:
    """Whether a line is solved for more right-hand sides: its start is joined, or an end turns."""
    return x.joints[0] >= 0 or bool(x.seats[:, TURNS].any())


def _room(x: JoinedLine, touches: bool = False) -> Work:
    """Arrays for a line, with room for all its factors where they serve again, for the last where its end is joined.

    touches: whether it touches itself.
    """
    cells, joints = x.line.h.size, x.joints
    kept = (cells + 1) * KEPT if _carries(x) else KEPT if joints[1] >= 0 else 0
    rows = np.zeros((1 if joints[0] >= 0 else 0, SIZE * WIDTH))
    if touches or x.line.torsion.size:  # these take all factors, which are kept in every march where they serve again
        kept = (cells + 1) * KEPT
    work = workspace_of(x.line, keep=touches or _carries(x) or joints[1] >= 0)
    return work._replace(X=np.zeros((cells + 1) * ROW + kept), rows=rows)


class NetworkSolver:
    """Solves for all lines of a system at once; owns the work arrays, not the states.

    It works in space, but for steps of lines that are joined to nothing and are marked as planar.
    """

    settling = CONTACT_DAMPING

    def __init__(
        self, lines: Sequence[JoinedLine], points: int, bodies: Floats = NO_BODIES,
        contacts: Sequence[SelfContact | None] = (), shared: SharedContact | None = None, tolerance: float = TOLERANCE,
    ) -> None:  # fmt: skip
        """points: how many free points there are; bodies: (B, NUMBERS), what they are, read at every step; contacts: of

        lines that touch themselves, in the order of the lines, None: of one that does not; empty: none does.  shared:
        contact of lines that may touch each other, which have none of their own; tolerance: of Newton's method in
        steps.  Each point and body must be at an end of some line.
        """
        self.lines, self.bodies, self.tolerance = tuple(lines), bodies, tolerance
        self.body_work = np.zeros((len(bodies), WORK))
        self._fairleads = np.array([x.fairleads for x in lines], float).reshape(-1, 2, 3)
        self._arms, self._gaps = np.zeros_like(self._fairleads), np.zeros_like(self._fairleads)
        self._seats = np.array([x.seats for x in lines], float).reshape(-1, 2, SEAT)
        self.joints: NDArray[np.int64] = np.array([x.joints for x in lines], np.int64).reshape(-1, 2)
        self._contacts, self.shared = {k: x for k, x in enumerate(contacts) if x is not None}, shared
        self._rides = lines[0].rides  # obstacles are those of all lines
        self._sheaves = int((lines[0].line.moved == FREE).sum())
        # Lines that are joined to nothing that moves with them are solved one by one: in tables with the task RUN.  Of
        # each whether it always moves with others (-1), or else how near it is to a body or sheave that it may move.
        self._near = np.array([-1 if max(x.joints) >= 0 else 0 for x in lines], np.int64)
        together = [k for k in self._touching_lines if k not in self._contacts or lines[k].keeps_pace]
        self._near[together] = -1
        self._alone = np.zeros(len(lines), np.int64)
        self._mixes = [bool(self._rides.size or self._sheaves) and near == 0 for near in self._near]
        # Winches whose lengths may be unknowns of all lines; iterations of lines with winches that are by themselves.
        each = zip(lines, self._near, self._mixes, strict=True)
        self._winches = sum(x.winds and bool(near < 0 or mixes) for x, near, mixes in each)
        self._wound: dict[int, int] = {}
        self._reels: dict[int, NDArray[np.int64]] = {}  # tables of lines that are paid out
        self.work = [_room(x, self._keeps(k, x)) for k, x in enumerate(lines)]
        self.books = [blank_books(x.line.h.size) for x in lines]  # powers, work, extremes; `keep_books` gives others
        self.allowed = np.full(len(lines), np.inf)  # m, error of each line that a step may make; `ratio` follows
        self.blurred: set[int] = set()  # lines of the last equilibrium of which round-off hides whether they buckle
        self.turns: tuple[NetworkState, NetworkState] | None = None  # states between which steps go back and forth
        self.net = np.zeros((points, 3))
        mass = sum(float(x.line.mass.sum()) for x in lines) + float(bodies[:, MASS].sum())
        self.scale = max(x.scale for x in lines)
        self.length = max(x.length for x in lines)
        self.anchor = ANCHOR * self.scale / (mass * self.length)  # 1/s2
        self._pressing: NDArray[np.int64] = np.zeros(0, np.int64)
        self._pressed: dict[str, Any] = {}
        self._touched: tuple[Any, ...] = ()  # what jobs get where lines touch themselves or each other
        self._phase, self._at_rest, self._asked = np.zeros(1, np.int64), np.zeros(1, np.int64), NetworkTask()
        blank = Table(blank_job)
        # Of each line two tables, as of the system: states that take turns lead from the one to the other and back.
        self._numbers = np.zeros((2, len(lines), blank.numbers.size), np.int64)
        self._tables = [tuple(blank.again(x[k]) for x in self._numbers) for k in range(len(lines))]
        self._rooms = self._make_rooms()
        self._pushes: dict[int, list[Floats]] = {}  # out of planes, of states of even parity and of odd, by line
        self._together = self._all = JointJobs(self._rooms, self._numbers, range(len(lines)))
        self.lone: list[int] = []
        self.joined = list(range(len(lines)))
        self.lone_numbers = self._numbers[0, :0]
        self._lone_tables: dict[int, Table] = {}
        self._joined_tables = dict(enumerate(self._tables))
        for k, (x, work, books) in enumerate(zip(lines, self.work, self.books, strict=True)):
            limits = Limits(REACH * x.length, x.scale, 1)
            self.bind_line(
                k, task=Task(ASSEMBLY, limits=limits), line=x.line, sea=x.sea, ends=x.ends, work=work, books=books,
                was=NO_PUSH, now=NO_PUSH,
            )  # fmt: skip
        self._group()

    def _keeps(self, number: int, x: JoinedLine) -> bool:
        """Whether all factors of a line may serve again: for contact, bodies, sheaves and winches."""
        beside = bool(self._rides.size or self._sheaves or self._winches)
        mixes = beside and (self._mixes[number] or self._near[number] < 0)
        return x.winds or mixes or number in self._touching_lines

    def _make_rooms(self) -> Rooms:
        """What jobs of the lines work in."""
        lines, points, bodies = self.lines, len(self.net), self.bodies
        carried = [x.line.h.size + 1 if _carries(x) else 0 for x in lines]
        columns = np.zeros((COLUMNS if self._seats[:, :, TURNS].any() else 3, max(sum(carried), 1), SIZE))
        unknowns = int((self.joints[:, 1] >= 0).sum()) + 3 * points + 6 * len(bodies)
        self._matrix = np.zeros((unknowns + 5, unknowns + 1))
        shared = {
            "columns": columns, "functional": np.zeros(FUNCTIONAL), "parts": np.zeros_like(columns),
            "answers": np.zeros((2, ANSWER)), "q": np.zeros(COLUMNS), "net": self.net, "bodies": bodies,
            "work": self.body_work, "S": np.zeros((HANDED - 1, HANDED)), "G": np.zeros((2, 6, 6)),
            "A": self._matrix,
        }  # fmt: skip
        of_lines = {
            "joints": self.joints, "seats": self._seats, "arms": self._arms,
            "first": np.concatenate([[0], np.cumsum(carried)[:-1]]).astype(np.int64),
        }  # fmt: skip
        floors = np.array([-np.inf if x.slackens else x.floor for x in lines])
        own = {"fairleads": self._fairleads, "gaps": self._gaps, "floors": floors, "allowed": self.allowed}
        apart = {"near": self._near, "alone": self._alone, "asked": self._asked}
        begins = np.append(0, np.cumsum([x.line.s.size for x in lines])[:-1]).astype(np.int64)
        rooms = Rooms(shared, of_lines, own, apart | {"rides": self._rides, "phase": self._phase}, begins, {}, {})
        if self._rides.size:
            rooms.meeting.update(self._room_to_meet())
        if self._sheaves or self._winches:
            rooms.spinning.update(self._room_to_spin())
        return rooms

    def bind_line(self, number: int, **values: Any) -> None:
        """Put values in their places in the jobs of a line."""
        for table in self._tables[number]:
            table.bind(**values)
        if number in self._lone_tables:
            self._lone_tables[number].bind(**self._by_itself(number, values))
        elif self._together is not self._all:
            for table in self._joined_tables[number]:
                table.bind(**values)

    def wind(self, number: int, alone: int, **values: Any) -> None:
        """Put values in the jobs of a line that is paid out; alone: what its iterations call where it is by itself."""
        self._wound[number], self._reels[number] = alone, values["reel_table"]
        self.bind_line(number, **values)

    def _by_itself(self, number: int, values: dict[str, Any]) -> dict[str, Any]:
        """The same for a line that is solved by itself: what is free moves as told, and no factors serve again."""
        found = {**values}
        if "iterated" in values:
            found["iterated"] = self._wound.get(number, 0)
        if not self._mixes[number]:
            return found
        if (line := values.get("line")) is not None:
            moved = line.moved.copy()
            moved[moved == FREE] = MOVES
            found["line"] = line._replace(moved=moved)
        serve = number in self._contacts or self.lines[number].winds
        if (work := values.get("work")) is not None and not (serve or work.torsion.known.size):
            found["work"] = work._replace(X=work.X[: self.lines[number].line.s.size * ROW])
        for name in {"old", "new"} & {*values}:
            found[name] = values[name]._replace(sheave=NO_SHEAVES)
        return found

    def _group(self) -> None:
        """Which lines are solved by themselves from now on, and tables for these and for the others."""
        some = not any(self._mixes) or bool((self._near != 0).any())  # else what is free moves with the first line
        self._alone[:] = (self._near == 0) & (some | (np.arange(len(self.lines)) > 0))
        self.lone, self.joined = (np.flatnonzero(self._alone == x).tolist() for x in (1, 0))
        self.lone_numbers = np.zeros((len(self.lone), self._numbers.shape[2]), np.int64)
        self._lone_tables = {}
        for k, numbers in zip(self.lone, self.lone_numbers, strict=True):
            table, own = self._tables[k][0].again(numbers), {"line": self.lines[k].line, "work": self.work[k]}
            table.bind(task=self._task_of_run(k), **self._by_itself(k, own | {"iterated": 0}))
            self._lone_tables[k] = table
        self._together, self._joined_tables = self._all, dict(enumerate(self._tables))
        if self.lone and not self.is_apart:
            numbers = np.zeros((2, len(self.joined), self._numbers.shape[2]), np.int64)
            self._joined_tables = {
                k: tuple(mine.again(x[j]) for mine, x in zip(self._tables[k], numbers, strict=True))
                for j, k in enumerate(self.joined)
            }
            self._together = JointJobs(self._rooms, numbers, self.joined)
            if self._touched:
                self._together.touch(*self._touched)

    @property
    def mixes(self) -> bool:
        """Whether a line may come near what is free, with which it is then solved."""
        return any(self._mixes)

    def find_near(self, now: NetworkState, t: float) -> None:
        """Find which lines are near what is free in the state of now, t (s), and solve these with it from now on."""
        self._bind_states(0, now, now)
        for x in self.lines:
            carry_obstacles(t, t, x.sea)
        shifts = self.body_work[:, U : U + 3].copy()
        self.body_work[:, U : U + 3] = 0.0
        self._all.ask_bodies(CARRY)
        self.body_work[:, U : U + 3] = shifts
        find_near(self._all.jobs[0].numbers)

    def regroup(self) -> dict[str, Any]:
        """Solve lines with what they have been found near, and others by themselves: as of `take_turns`."""
        self._group()
        return self._bind_turns()

    def take_line(self, number: int, line: Line) -> None:
        """A line is in other arrays from now on."""
        self.lines = tuple(x._replace(line=line) if k == number else x for k, x in enumerate(self.lines))
        self.bind_line(number, line=line)

    def tables_by_itself(self, number: int) -> tuple[Table, Table, Table]:
        """Jobs of a line that is solved by itself: of that, and of steps of even and of odd parity."""
        even, odd = self._tables[number]
        return self._lone_tables[number], even, odd

    def _task_of_run(self, number: int) -> Task:
        return Task(RUN, limits=self.limits_by_itself(number))

    def limits_by_itself(self, number: int) -> Limits:
        """What Newton's method works with in a line that is solved by itself."""
        return Limits(REACH * self.lines[number].length, self.lines[number].scale, MOST_OF_STEP, self.tolerance)

    def marcher_of(self, number: int) -> int:
        """Address of the kernel that solves steps of a line that is solved by itself."""
        return self._kernel_of(number).address(self._numbers[0, number])

    def _kernel_of(self, number: int) -> Any:
        return in_plane if self.lines[number].line.bits & PLANAR else in_space

    @property
    def is_apart(self) -> bool:
        """Whether every line is solved by itself, whatever comes."""
        return not (self.joined or len(self.net) or len(self.bodies) or any(self._mixes))

    @property
    def _marches_alone(self) -> bool:
        """Whether forces of every line are found by itself, too: where it touches itself they are found with others."""
        return self.is_apart and not self._contacts

    def joint_solver(self) -> int:
        """Address of the kernel that solves steps of lines that are joined; 0: none are, and it is not compiled."""
        if self.is_apart:
            return 0
        self._let_march()
        return solve_system.address(self._all.jobs[0].numbers)

    def _let_march(self) -> None:
        """Jobs of joined lines know the kernel that marches them, in space, which takes long to compile."""
        self._rooms.job["solver"] = marcher = in_space.address(self._numbers[0, 0])
        for table in (*self._all.jobs, *self._together.jobs):
            table.bind(solver=marcher)

    def adopt_cells(self, number: int, line: Line, sea: Sea, work: Work, books: Books) -> None:
        """A line is in other arrays from now on, of which its jobs know."""
        self.lines = tuple(x._replace(line=line, sea=sea) if k == number else x for k, x in enumerate(self.lines))
        self.work[number], self.books[number] = work, books

    def _room_to_meet(self) -> dict[str, Any]:
        """Room of lines that touch the bodies that carry obstacles."""
        bodies = sorted({int(b) for b in self._rides if b >= 0})
        slots = np.full(len(self.bodies), -1, np.int64)
        slots[bodies] = np.arange(len(bodies))
        total, rows = sum(x.line.s.size for x in self.lines), EACH_BODY * len(bodies)
        self._pressing = np.zeros(1 + len(bodies), np.int64)
        self._pressed = {
            "gaps": np.zeros_like(self._gaps), "rides": self._rides, "carriers": np.array(bodies, np.int64),
            "slots": slots, "phase": self._phase,
            "found": self._pressing, "touched": np.zeros((total * len(bodies), TOUCHED)),
            "own": np.zeros((len(bodies), 36)), "wrench": np.zeros((len(bodies), 6)),
            "marks": np.zeros(total, np.int64), "kept": np.zeros((total, SIZE)),
            "moved": np.zeros((len(self.bodies), 6)), "responses": np.zeros((rows, total, SIZE)),
            "turned": np.zeros((rows, len(self.bodies), 6)), "coupling": np.zeros((rows, rows + 1)),
            "order": np.zeros(rows, np.int64),
        }  # fmt: skip
        return self._pressed

    def _room_to_spin(self) -> dict[str, Any]:
        """Room of sheaves that lines turn, and of winches that give of joined lines what keeps their tension."""
        nodes, bodies = sum(x.line.s.size for x in self.lines), len(self.bodies)
        return {
            "gaps": np.zeros_like(self._gaps), "phase": self._phase, "asked": self._asked,
            "marks": np.zeros(nodes, np.int64), "kept": np.zeros((nodes, SIZE)), "moved": np.zeros((bodies, 6)),
            "turned": np.zeros((self._sheaves, bodies, 6)), "lengthened": np.zeros((self._winches, nodes, SIZE)),
            "drawn": np.zeros((self._winches, bodies, 6)),
        }  # fmt: skip

    def _touch(self) -> None:
        """Lines that touch themselves do so from now on, with the books as they are."""
        states = [state_for(x.line) for x in self.lines]
        tables = np.zeros((len(self.lines), Table(blank_contact_job).numbers.size), np.int64)
        shared = np.array([[-1, 0]] * len(self.lines), np.int64)
        for k, contact in self._contacts.items():
            both = states[k], states[k]
            numbers = contact.attach(self.lines[k].line, self.lines[k].ends, both, self.work[k], self.books[k])
            self.bind_line(k, contact=contact.call, contact_table=numbers)
            tables[k], shared[k] = numbers, (k, 0)
        if self.shared is not None:
            self._share(tables, shared)
        nodes = sum(x.line.s.size for x in self.lines)
        room = {
            "gaps": np.zeros_like(self._gaps), "kept": np.zeros((nodes, SIZE)), "asked": self._at_rest,
            "moved": np.zeros((len(self.bodies), 6)), "hessenberg": room_for_products(), "phase": self._phase,
        }  # fmt: skip
        self._touched = room, tables, shared
        self._all.touch(*self._touched)
        if self._together is not self._all:
            self._together.touch(*self._touched)

    @property
    def line_tables(self) -> NDArray[np.int64]:
        """(2, L, ..) jobs of all lines, of steps of even and of odd parity."""
        return self._numbers

    def look_at(self, states: NetworkState) -> None:
        """Let the jobs of even parity lead from states to the same."""
        self.turns = None
        self._bind_states(0, states, states)

    def _share(self, tables: NDArray[np.int64], shared: NDArray[np.int64]) -> None:
        """Lines that may touch each other do so; the last of them is asked, and goes into the tables of all contact."""
        found = self.shared
        assert found is not None
        one, both = found.attach(self._numbers, self.joints, self.books)
        for k, begin in zip(found.lines, found.begins.tolist(), strict=True):
            self.bind_line(k, contact=found.beside)
            shared[k] = found.last, begin
        for own in (self._tables, self._joined_tables):
            for table, numbers in zip(own[found.last], both, strict=True):
                table.bind(contact=found.call, contact_table=numbers)
        tables[found.last] = one

    def keep_books(self, books: Sequence[Books]) -> None:
        """Keep powers, work and extremes of the lines in these books from now on."""
        self.books = list(books)
        for k, each in enumerate(books):
            asks = each.asked.size or each.walls.size
            self.bind_line(
                k, books=each, quantities=note_quantities.address(self._numbers[0, 0]) if asks else 0
            )  # fmt: skip
        if self._contacts or self.shared is not None:
            self._touch()

    def take_turns(self, states: tuple[NetworkState, NetworkState]) -> dict[str, Any]:
        """Steps lead from the first state to the second and back from now on: what run.network_run.StepsJob has."""
        self.turns = states
        return self._bind_turns()

    def jobs_of_joined(self) -> tuple[Table, Table]:
        """Jobs of both parities without lines that are solved by themselves: none is left where all are."""
        if self.joined or self._together is not self._all:
            return self._together.jobs
        even, odd = (x.again(np.empty_like(x.numbers)) for x in self._together.jobs)
        for x in (even, odd):
            x.bind(tables=self.lone_numbers[:0], joints=np.zeros((0, 2), np.int64))
        return even, odd

    def _bind_turns(self) -> dict[str, Any]:
        """Let all jobs lead from one of the states that take turns to the other."""
        assert self.turns is not None
        old, new = self.turns
        for parity, (a, b) in enumerate((self.turns, self.turns[::-1])):
            self._bind_states(parity, a, b)
        for k, contact in self._contacts.items():
            contact.set_states(old.lines[k], new.lines[k])
        for k, table in self._lone_tables.items():
            table.bind(**self._by_itself(k, {"old": old.lines[k], "new": new.lines[k]}))
            self._bind_pushes(k)
        numbers, mixes = self._all.jobs[0].numbers, any(self._mixes)
        return {
            "even": numbers, "odd": self._all.jobs[1].numbers,
            "joined_even": self._together.jobs[0].numbers, "joined_odd": self._together.jobs[1].numbers,
            "joined": np.array(self.joined, np.int64), "lone": self.lone_numbers,
            "lone_lines": np.array(self.lone, np.int64), "marchers": np.array(self._marchers(), np.int64),
            "leader": lead_lone.address(numbers) if mixes else 0, "finder": find_near.address(numbers) if mixes else 0,
        }  # fmt: skip

    def _marchers(self) -> list[int]:
        """Addresses of the kernels that solve steps of the lines that are solved by themselves."""
        return [self.marcher_of(k) for k in self.lone]

    def carry(self, number: int, pushes: list[Floats]) -> None:
        """Carry a push out of its plane along with a line: (N+1, 4) of states of even parity, and of odd."""
        self._pushes[number] = pushes
        self._bind_pushes(number)

    def _bind_pushes(self, number: int) -> None:
        if number in self._pushes and number in self._lone_tables:
            was, now = self._pushes[number]
            self._lone_tables[number].bind(was=was, now=now)

    def exchange_pushes(self) -> None:
        """What belongs to states of odd parity does so to those of even from now on."""
        for number, pushes in self._pushes.items():
            pushes.reverse()
            self._bind_pushes(number)

    def _bind_states(self, parity: int, old: NetworkState, new: NetworkState) -> None:
        for tables, a, b in zip(self._tables, old.lines, new.lines, strict=True):
            tables[parity].bind(old=a, new=b)
        self._all.bind_bodies(parity, old.bodies, new.bodies)
        if self._together is not self._all:
            for k, tables in self._joined_tables.items():
                tables[parity].bind(old=old.lines[k], new=new.lines[k])
            self._together.bind_bodies(parity, old.bodies, new.bodies)

    def _solve(self, task: Task, old: NetworkState, new: NetworkState, t: float = 0.0) -> NetworkTaken:
        self.turns = None
        self._bind_states(0, old, new)
        for k, contact in self._contacts.items():
            contact.set_states(old.lines[k], new.lines[k])
            self.books[k].counts.parity = 0
        limits = task.limits
        self._asked[:] = (
            task.what, task.dt, task.before, task.rho, task.cv, task.ca, limits.reach, limits.scale, limits.most,
            task.rho_before, task.fixed, t, 1.0, task.cut, limits.tolerance,
        )  # fmt: skip
        self._let_march()
        outcome, iterations, left, line, where = solve_system(self._all.jobs[0].numbers)
        return NetworkTaken(Outcome(outcome), iterations, left, line, where, self.residual())

    def _march(self, what: int, ca: float, states: NetworkState, t: float = 0.0) -> NetworkTaken:
        """Forces (ASSEMBLY) or a CORRECTION of states, of lines by themselves by the kernels of their steps."""
        task = Task(what, ca=ca, limits=Limits(1.0, 1.0, 1))
        if not self._marches_alone:
            return self._solve(task, states, states, t)
        self.turns = None
        for k, table in self._lone_tables.items():
            work, state = self.work[k], states.lines[k]
            work.torsion.known[:1] = -1.0  # how it answers to torques is found anew
            table.bind(task=task, old=state, new=state)
            outcome, iterations, left, where = self._kernel_of(k)(table.numbers)
            table.bind(task=self._task_of_run(k))
            # forces of a line alone are known whatever its equations are
            known = what == ASSEMBLY and outcome == Outcome.SINGULAR and work.report[RESIDUAL] < np.inf
            if outcome != Outcome.OK and not known:
                return NetworkTaken(Outcome(outcome), iterations, left, k, where, self.residual())
        if what == ASSEMBLY:
            self._begin_books(states, t)
        return NetworkTaken(Outcome.OK, 1, np.inf, -1, -1, self.residual())

    def _begin_books(self, states: NetworkState, t: float) -> None:
        """Powers and extremes of lines that are solved by themselves, in states whose reports are known, at t (s)."""
        for k, table in self._lone_tables.items():
            x, clock = self.lines[k], self.books[k].clock
            if x.line.bits & TOUCHES:
                lie_on_bed(x.line, x.sea, self.work[k], states.lines[k])
                clock.stored = self.work[k].report[SEABED_ENERGY]
            if k in self._reels:
                from hybrid.kernels.reel.payout import stand_among  # which a scene without payout does without

                stand_among(self._reels[k])
            clock.now = t
            begin_line(table.numbers)

    def residual(self) -> float:
        """Largest residual force (N) of the last march, at a node or a point; without contact."""
        left = self.body_work[:, OWN : OWN + 6] + self.body_work[:, LINES : LINES + 6]
        return self._largest([float(work.report[RESIDUAL]) for work in self.work], self.net, left)

    @property
    def arm(self) -> float:
        """Arm (m) by which moments on bodies are compared with forces."""
        return max(LEAST_ARM * self.length, float(np.abs(self._fairleads).max()))

    def _largest(self, inside: Sequence[float], net: Floats, left: Floats) -> float:
        """The largest of what is left over inside lines, at points (P, 3) N, and at bodies (B, 6) N, N m."""
        turning = float(np.abs(left[:, 3:]).max(initial=0.0)) / self.arm
        return max(*inside, turning, *(float(np.abs(x).max(initial=0.0)) for x in (net, left[:, :3])))

    def in_contact(self) -> list[int]:
        """Lines that touch themselves, or may touch others that do, in the states that were looked at last."""
        shared = self.shared.lines if self.shared is not None and self.shared.touches else ()
        return [*(k for k, contact in self._contacts.items() if contact.touches), *shared]

    @property
    def meets(self) -> bool:
        """Whether lines touch bodies that are free."""
        return bool(self._rides.size)

    @property
    def presses_bodies(self) -> bool:
        """Whether a line touched a free body in the last march."""
        return bool(self._pressing.any())

    def pressed_bodies(self, states: NetworkState, cv: float = 0.0) -> tuple[Floats, Floats, Floats, NDArray[np.int64]]:
        """What lines that touch bodies do to them in states at rest: rows (n, TOUCHED) of nodes, how that changes as
        each body moves (S, 36), what it is (S, 6), and the numbers of these bodies (S,).  cv: 1/s, of the damping.
        """
        self.evaluate_forces(states, 0.0)
        if cv:
            self._solve(Task(ASSEMBLY, cv=cv, limits=Limits(1.0, 1.0, 1)), states, states)
        rows = self._pressed["touched"][: self._pressing[0]]
        own, wrench = (self._pressed[x].copy() for x in ("own", "wrench"))
        return rows.copy(), own, wrench, self._pressed["carriers"]

    @property
    def _touching_lines(self) -> set[int]:
        """Numbers of the lines that touch themselves, or may touch others."""
        return {*self._contacts, *(self.shared.lines if self.shared is not None else ())}

    @property
    def narrowest(self) -> float:
        """The least diameter, m, of lines that touch; infinite: none does."""
        found = [*self._contacts.values(), *([] if self.shared is None else [self.shared])]
        return min((x.narrowest for x in found if x.touches), default=np.inf)

    def proof(self, states: NetworkState) -> float:
        """Largest force (N) that is left over at a node, a point or a body, with that of contact; reports follow."""
        residual = self.evaluate_forces(states, self.anchor).residual
        return self._largest(*self.unbalanced(states, self.anchor)) if self.in_contact() else residual

    def unbalanced(self, states: NetworkState, ca: float) -> tuple[list[float], Floats, Floats]:
        """What does not balance, with contact, in states that have just been evaluated: the largest force (N) at a node

        of each line, forces (P, 3) N on points, forces and moments (B, 6) N, N m on bodies.  ca: as of them.
        """
        points = len(self.net)
        inside, net = [float(work.report[RESIDUAL]) for work in self.work], self.net.copy()
        left = self.body_work[:, OWN : OWN + 6] + self.body_work[:, LINES : LINES + 6]
        pushed = {} if self.shared is None else self._push(states)
        for k in self.in_contact():
            x, work = self.lines[k], workspace_of(self.lines[k].line, keep=True)
            force = pushed[k] if k in pushed else self._contacts[k].force(states.lines[k])
            inside[k], forces = left_over(x.line, x.sea, x.ends, states.lines[k], force, ca, work)
            for joint, force, arm in zip(x.joints, forces, self._arms[k], strict=True):
                if 0 <= joint < points:
                    net[joint] += force
                elif joint >= points:
                    left[joint - points] += np.concatenate([force, np.cross(arm, force)])
        return inside, net, left

    def _push(self, states: NetworkState) -> dict[int, Floats]:
        """Forces (N+1, 3) N on lines that may touch each other, by number, in states at rest."""
        assert self.shared is not None
        self.look_at(states)
        self.shared.rest_energy(self.work)
        return self.shared.forces()

    def contacts_at(self, states: NetworkState, finer: int = 1) -> list[tuple[Contact, Sequence[int]]]:
        """Contact in states at rest, with the numbers of its lines, whose nodes it has in turn.

        finer: by how much more sample points lie on each piece of a line than the law has.
        """
        found: list[tuple[Contact, Sequence[int]]] = [(x.contact, (k,)) for k, x in self._contacts.items()]
        found += [] if self.shared is None else [(self.shared.contact, self.shared.lines)]
        for contact, _ in found:
            contact.samples[:] *= finer
        for k, own in self._contacts.items():
            own.set_states(states.lines[k], states.lines[k])
            own.force(states.lines[k])
        if self.shared is not None:
            self._push(states)
        for contact, _ in found:
            contact.samples[:] //= finer
        return found

    def contact_energy(self, states: NetworkState) -> float:
        """Energy, J, of contact of lines with each other in states at rest; infinite: they are in each other."""
        assert self.shared is not None
        self.look_at(states)
        return self.shared.rest_energy(self.work)

    # --- motion -------------------------------------------------------------------------------------

    def step(
        self, old: NetworkState, new: NetworkState, dt: float, rho: float, before: float, rho_before: float,
        t: float = 0.0, most: int = MOST_OF_STEP, fixed: bool = False,
    ) -> NetworkTaken:  # fmt: skip
        """From `old` to `new` (overwritten) over dt, with the ends and the sea of the new time in the lines' arrays.

        before, rho_before: the length, s, of the step that led to `old`, 0 if it is a start, and its spectral radius,
        `NetworkTaken.rho` of it.  t: s, of `new`, for extremes.  fixed: whether steps have a fixed length, but for
        parts of one.
        """
        limits = Limits(REACH * self.length, 1.0, most, self.tolerance)
        task = Task(STEP, dt, before, rho, limits=limits, rho_before=rho_before, fixed=fixed)
        taken = self._solve(task, old, new, t)
        if taken.outcome != Outcome.OK:
            return taken
        errors = np.array([work.report[LOCAL_ERROR] for work in self.work])  # fairleads move as their bodies
        used, ratio = float(self.work[0].report[USED_RHO]), float((errors / self.allowed).max())
        if not ratio > REFUSED:
            book_system_step(self._all.jobs[0].numbers)
        return replace(taken, error=float(errors.max()), ratio=ratio, rho=used)

    def consistent_accelerations(
        self, states: NetworkState, accelerations: Sequence[Floats], t: float = 0.0,
        lengthening: Mapping[int, Floats] = MappingProxyType({}),
    ) -> NetworkTaken:  # fmt: skip
        """Give `states` the accelerations and tensions that positions, velocities and loads imply (solve.stepper).

        accelerations: (2, 3) m/s2 of the held ends of each line; lengthening: (N,) m/s2, second rates of the lengths of
        cells, by line.
        """
        states.bodies[:, A:W] = 0.0
        states.bodies[:, WA:] = 0.0
        self._turning_gaps(states)
        for k, (x, work, state, given) in enumerate(
            zip(self.lines, self.work, states.lines, accelerations, strict=True)
        ):
            state.a[:], state.vd[:], state.wa[:], state.wd[:] = 0.0, 0.0, 0.0, 0.0
            l = np.linalg.norm(state.e, axis=1)
            d = state.e / l[:, None]
            e1 = np.diff(state.v, axis=0)
            across = e1 - np.einsum("ij,ij->i", d, e1)[:, None] * d
            gaps = -np.einsum("ij,ij->i", across, across) / (l * HEAVY)
            if k in lengthening:
                gaps += lengthening[k] / HEAVY
            work.u[:], work.X[:] = 0.0, 0.0
            for end in (0, 1):
                if x.joints[end] < 0:
                    work.u[-end] = -given[end] / HEAVY  # what a held end has still to go is position - r - u
            if x.joints[0] >= 0:
                work.u[0] = -self._gaps[k, 0]
            if x.line.moved.size:
                carry_obstacles(t, t, x.sea)
            settle_in_soil(x.line, x.sea, state.r, state.soil)
            self._around(x, state, work)
            ends = x.ends._replace(position=state.r[[0, -1]])
            self.bind_line(k, work=work._replace(gaps=gaps), ends=ends)
        self._at_rest[0] = 1
        for k in self._touching_lines:
            self.books[k].clock.now = t
        taken = self._march(CORRECTION, HEAVY, states)
        self._at_rest[0] = 0
        for k, (x, work) in enumerate(zip(self.lines, self.work, strict=True)):
            self.bind_line(k, work=work, ends=x.ends)
        if taken.outcome != Outcome.OK:
            return taken
        for row, own, solved in zip(states.bodies, self.bodies, self.body_work[:, X : X + 6], strict=True):
            row[VD : VD + 3] = row[A : A + 3] = HEAVY * solved[:3]
            if own[MASS + 21 : MASS + 36].any():  # a turn without inertia has no acceleration
                row[WD : WD + 3] = row[WA : WA + 3] = HEAVY * solved[3:] @ row[FRAME:V].reshape(3, 3)
        for x, work, state in zip(self.lines, self.work, states.lines, strict=True):
            state.vd[:] = HEAVY * work.x[:, 1:4]
            if x.line.bits & PLANAR and not self._marches_alone:  # round-off in space, which steps would add up
                state.vd[:] -= np.outer(state.vd @ x.line.plane[2], x.line.plane[2])
            state.a[:] = state.vd
            state.T[:] += work.x[1:, 0]
            # a spin without inertia has no acceleration, and none is in a plane
            turning = (x.line.spin == 1) & (x.line.polar > 0) & (not x.line.bits & PLANAR)
            state.wd[turning] = HEAVY * work.x[:-1, 4][turning]
            state.wa[:] = state.wd
        return self.forces_in_motion(states, t)

    def _turning_gaps(self, states: NetworkState) -> None:
        """What fairleads accelerate beside the acceleration of their bodies, towards the axis of rotation."""
        self._gaps[:] = 0.0
        for l, x in enumerate(self.lines):
            for k in (0, 1):
                if x.joints[k] >= len(self.net):
                    row = states.bodies[x.joints[k] - len(self.net)]
                    R = row[FRAME:V].reshape(3, 3)
                    spin = R @ row[W : W + 3]
                    self._gaps[l, k] = np.cross(spin, np.cross(spin, R @ x.fairleads[k])) / HEAVY

    def evaluate_forces(self, states: NetworkState, ca: float, t: float = 0.0) -> NetworkTaken:
        """The forces, reports, powers and residuals of states at rest as they are, at t (s).

        ca: 1/s2, of springs of that times the mass.
        """
        if self.shared is not None and self.books[self.shared.last].extremes.size:
            self._bind_states(0, states, states)  # extremes are noted of line by line, with what presses on each
            self.books[self.shared.last].clock.now = t
            self.shared.rest_energy(self.work)
        for x, work, state in zip(self.lines, self.work, states.lines, strict=True):
            work.u[:] = 0.0
            if x.line.moved.size:
                carry_obstacles(t, t, x.sea)
            self._around(x, state, work)
            if state.soil.size:
                lie_in_soil(x.line, x.sea, state.r, state.soil)
        taken = self._march(ASSEMBLY, ca, states, t)
        if taken.outcome == Outcome.OK:
            self._count_contact_energy(states)
        return taken

    def forces_in_motion(self, states: NetworkState, t: float) -> NetworkTaken:
        """The same of states between two steps, at t (s): mean tensions of ropes stay what they are."""
        return self.evaluate_forces(states, HEAVY, t)

    def _count_contact_energy(self, states: NetworkState) -> None:
        """Put what contact does to held ends into the reports and powers of states that have just been evaluated."""
        for k, contact in self._contacts.items():
            x, books, report = self.lines[k], self.books[k], self.work[k].report
            before = report[NET_A : NET_A + 6].copy()
            contact.count_energy(states.lines[k], x.ends, report)
            added = (report[NET_A : NET_A + 6] - before).reshape(2, 3)
            books.power[0, :2] -= np.einsum("ij,ij->i", added, books.velocity)
            books.report[0] = report
        if self.shared is not None:
            self._count_shared_energy()

    def _count_shared_energy(self) -> None:
        """The same of lines that may touch each other."""
        assert self.shared is not None
        before = {k: self.work[k].report[NET_A : NET_A + 6].copy() for k in self.shared.lines}
        self.shared.count_energies(self.work, [x.ends for x in self.lines])
        for k, net in before.items():
            books, report = self.books[k], self.work[k].report
            added = (report[NET_A : NET_A + 6] - net).reshape(2, 3)
            books.power[0, :2] -= np.einsum("ij,ij->i", added, books.velocity)
            books.report[0] = report

    def _around(self, x: JoinedLine, state: State, work: Work) -> None:
        if x.line.bits & WAVES:
            wave_kinematics(x.sea, state.r, work.u)
        if x.line.bits & FRICTION:
            friction_axes(x.sea, state.r, state.e, state.slip, state.grip)

    # --- equilibrium --------------------------------------------------------------------------------

    def compliance(self, states: NetworkState, ca: float) -> Floats | None:
        """How points and bodies give way to forces on them: (n, n) m/N, rad/N, .., of the points (3 each), then of the
        bodies (3 of the origin, 3 of the rotation), of an equilibrium, from the factors of its lines.  Friction is
        left out.  ca: 1/s2, of springs of that times the mass.  None: the system is singular.
        """
        for x, work, state in zip(self.lines, self.work, states.lines, strict=True):
            work.u[:] = 0.0
            self._around(x, state, work)
        taken = self._solve(Task(JUNCTIONS, ca=ca, limits=Limits(1.0, 1.0, 1)), states, states)
        m = self._matrix.shape[1] - 1
        if taken.outcome != Outcome.OK:
            return None
        if m == 0:
            return np.zeros((0, 0))
        A = self._matrix[:m, :m]
        columns = 1.0 / np.maximum(np.abs(A).max(axis=0), 1e-300)
        rows = 1.0 / np.maximum(np.abs(A * columns).max(axis=1), 1e-300)
        try:
            inverse = columns[:, None] * np.linalg.inv(rows[:, None] * A * columns) * rows
        except np.linalg.LinAlgError:
            return None
        first = int((self.joints[:, 1] >= 0).sum())
        return np.asarray(-inverse[first:, first:])

    def is_stable(self, states: NetworkState) -> bool:
        """Whether points and bodies come back to an equilibrium when they are moved a little; False also if neither.

        The springs that hold what nothing else does are a part of NEUTRAL of what a force of the tension scale does
        over the length.  Whether lines themselves would buckle is not asked.
        """
        C = self.compliance(states, NEUTRAL / ANCHOR * self.anchor)
        if C is None:
            return False
        if C.size == 0:
            return True
        arm = np.ones(C.shape[0])
        turns = 3 * len(self.net) + 6 * np.arange(len(self.bodies))[:, None] + np.arange(3, 6)
        arm[turns.ravel()] = max(float(np.abs(self._fairleads).max()), 1e-3 * self.length)  # m, so that all are lengths
        C = C * arm * arm[:, None]
        give = np.linalg.eigvalsh(0.5 * (C + C.T))
        return bool(give[0] > -1e-6 * NEUTRAL * give[-1])

    def keep_factors(self) -> None:
        """Keep all factors of all lines in every march from now on, for other right-hand sides."""
        for k, (x, work) in enumerate(zip(self.lines, self.work, strict=True)):
            self.work[k] = work._replace(X=np.zeros((x.line.h.size + 1) * (ROW + KEPT)))
            self.bind_line(k, work=self.work[k])
        if any(self._mixes):  # other right-hand sides have what lines may do to what is free
            self._near[self._mixes], self._mixes = -1, [False] * len(self.lines)
            self._group()

    def factor(self, states: NetworkState, ca: float) -> bool:
        """Leave the factors of states as they are where `keep_factors` keeps them; ca: as of `evaluate_forces`.

        False: the system is singular.
        """
        self._gaps[:] = 0.0
        for x, work, state in zip(self.lines, self.work, states.lines, strict=True):
            work.u[:] = 0.0
            self._around(x, state, work)
        taken = self._solve(Task(CORRECTION, ca=ca, limits=Limits(1.0, 1.0, 1)), states, states)
        return taken.outcome == Outcome.OK

    def newton_round(self, states: NetworkState) -> NetworkTaken:
        """Static Newton from states at rest, which it overwrites; springs of `anchor` times their mass hold nodes and

        bodies where they are, so that what is found balances with these.
        """
        for x, work, state in zip(self.lines, self.work, states.lines, strict=True):
            work.u[:], state.soil[:] = 0.0, 0.0
            self._around(x, state, work)
        for contact in self._contacts.values():
            contact.forget()
        if self.shared is not None:
            self.shared.forget()
        task = Task(EQUILIBRIUM, ca=self.anchor, limits=Limits(REACH * self.length, 1.0, MOST_ITERATIONS))
        taken = self._solve(task, states, states)
        states.bodies[:, PLACE:FRAME] += self.body_work[:, U : U + 3]
        states.bodies[:, V:] = 0.0
        for x, work, state in zip(self.lines, self.work, states.lines, strict=True):
            state.r[:] += work.u
            state.vd[:], state.wd[:] = 0.0, 0.0  # of the springs
            if x.line.bits & FRICTION:
                state.slip[:] = x.sea.slid
            settle_in_soil(x.line, x.sea, state.r, state.soil)
        return taken

    def others(self, lines: Sequence[JoinedLine], bodies: Floats | None = None) -> NetworkSolver:
        """As of `solve.search.Solver`, without contact."""
        return NetworkSolver(lines, len(self.net), self.bodies if bodies is None else bodies)

    def turned(self, start: NetworkState) -> None:
        """As of `solve.search.Solver`: chords are not turned."""

    def newton(self, start: NetworkState) -> tuple[NetworkTaken, NetworkState]:
        """Static Newton from `start`; a new state is returned, the old one is left as it was.

        An outcome other than OK also where what was found is no equilibrium (`flaw`).
        """
        taken, new = self.balance(start)
        if taken.outcome == Outcome.OK:
            outcome, line, where = self.flaw(new)
            taken = replace(taken, outcome=outcome, line=line, where=where)
        return taken, new

    def balance(self, start: NetworkState) -> tuple[NetworkTaken, NetworkState]:
        """As `newton`, whatever the state is in which all forces balance."""
        new = start.copy()
        for state in new.lines:
            for still in (state.v, state.a, state.vd, state.w, state.wa, state.wd, state.sheave):
                still[:] = 0.0
        new.bodies[:, V:] = 0.0
        taken = NetworkTaken(Outcome.NOT_CONVERGED, 0, np.inf, -1, -1, np.inf)
        iterations, kept, rubs = 0, None, any(x.line.bits & FRICTION for x in self.lines)
        for _ in range(BALANCING):
            taken = self.newton_round(new)
            iterations += taken.iterations
            if taken.outcome != Outcome.OK:
                break
            proof = self.proof(new)
            taken = NetworkTaken(taken.outcome, iterations, taken.correction, taken.line, taken.where, proof)
            if not self.is_balanced(new, proof):
                taken = replace(taken, outcome=Outcome.NOT_CONVERGED)
            elif kept is not None or (not rubs and (not self.in_contact() or self.is_balanced(new, CLOSER * proof))):
                break
            else:  # contact, and friction that sticks, are stiff: one more round, of which nothing is lost
                kept = taken, new.copy()
        if kept is not None and taken.outcome != Outcome.OK:
            taken, new = kept
            self.proof(new)
        return taken, new

    def is_balanced(self, states: NetworkState, residual: float) -> bool:
        """Whether a largest residual force (N) is round-off of the forces in states."""
        greatest = max(float(np.abs(state.T).max()) for state in states.lines)
        return residual <= BALANCED * (greatest + self.scale)

    def flaw(self, states: NetworkState) -> tuple[Outcome, int, int]:
        """Why a balanced state is no equilibrium (OK: it is one), the line (-1: a point or body), and its node or cell.

        It is stable where lines would not buckle between joints that are held, and points and bodies come back with
        what lines do to them then: these two parts are the second variation.  Not asked where a line touches itself.
        """
        outcome, line, where = flaw_of_lines(self.lines, states)
        if outcome != Outcome.OK or self.in_contact() or self.presses_bodies:
            return outcome, line, where
        self.blurred.clear()
        line = buckling_line(self.lines, states, self.blurred)
        if line >= 0:
            return Outcome.UNSTABLE, line, int(np.argmin(states.lines[line].T))
        return (Outcome.OK if self.is_stable(states) else Outcome.UNSTABLE), -1, -1
