"""The tables by which kernels know the lines of a network, and the borders of Newton's method in their order.

There are tables of all lines, of those solved together, and of each alone.

Borders (kernels.junctions.borders) are asked in the order of `BORDERS`.  An answer of one has those of all borders
before it, so that the order is that of what an answer needs: points and bodies first, by which lines answer to
anything; then what has few columns, which are found once an iteration and serve all that follows: bodies that lines
touch, which move the ends of lines; winches, which turn no sheave; sheaves, which winches pull ropes over.  Torques
only correct what the others find, between ends that stay.  Contact of lines comes last: it has too many columns to
keep, and asks all others again for each product of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.block_elimination import KEPT, ROW, SIZE
from hybrid.kernels.contact.self_contact import blank_contact_job
from hybrid.kernels.contact.self_contact_pairs import MOST_PRODUCTS
from hybrid.kernels.junctions.bodies import FRAME, WORK, U, V, W
from hybrid.kernels.junctions.body_contact import CARRY, EACH_BODY, TOUCHED, blank_meeting_job, meet_bodies
from hybrid.kernels.junctions.borders import (
    APART,
    APART_ALWAYS,
    HELD,
    JOINED,
    NONE,
    NetworkTask,
    blank_border_job,
    blank_network_job,
    find_near,
    lead_lone,
)
from hybrid.kernels.junctions.joined_lines import ANSWER, COLUMNS, FUNCTIONAL, SEAT, TURNS
from hybrid.kernels.junctions.junctions import HANDED, join_lines, twist_lines
from hybrid.kernels.junctions.lines_contact import blank_touching_job, touch_network
from hybrid.kernels.junctions.sheaves_and_winches import EACH_UNKNOWN, blank_unknowns_job, spin_sheaves, wind_lines
from hybrid.kernels.laws.obstacles import carry_obstacles
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.run.newton import NO_PUSH, in_plane, in_space, solve_network, workspace
from hybrid.kernels.state.books import Books, blank_books
from hybrid.kernels.state.report import FREE, MOVES, OBSTACLES, PLANAR
from hybrid.kernels.state.state import NO_SHEAVES, Floats, Line, Sea, Work, state_for
from hybrid.kernels.step.line_step import ASSEMBLY, RUN, TOLERANCE, Limits, Task, blank_job
from hybrid.kernels.watch.named_quantities import note_quantities
from hybrid.solve.contact import SelfContact, SharedContact
from hybrid.solve.stepper import MOST_ITERATIONS as MOST_OF_STEP
from hybrid.solve.stepper import REACH, JoinedLine, NetworkState, is_answered_again, room_of_factors, room_of_line

# --- borders -----------------------------------------------------------------------------------

Values = dict[str, Any]


class Border(NamedTuple):
    """A kernel that answers the questions of kernels.junctions.borders, and a job of it with blank values."""

    kernel: Any
    blank: Callable[[], Any]


BORDERS = {
    "joints": Border(join_lines, blank_border_job),
    "shapes": Border(meet_bodies, blank_meeting_job),
    "winches": Border(wind_lines, blank_unknowns_job),
    "sheaves": Border(spin_sheaves, blank_unknowns_job),
    "torques": Border(twist_lines, blank_border_job),
    "contact": Border(touch_network, blank_touching_job),
}


class Rooms(NamedTuple):
    """What jobs of lines work in, whichever they are of; only one of them works at a time."""

    whole: Values  # of a kernels.junctions.borders.NetworkJob
    rows: Values  # likewise, with a row for each line of the network
    # Of borders by name, the same for all lines, or what gives that of some; None: they have none.
    borders: dict[str, Values | Callable[[Sequence[int]], Values | None]]


class JointJobs:
    """Jobs of both parities for some lines of a network, with all of its points and bodies."""

    def __init__(self, rooms: Rooms, numbers: NDArray[np.int64], lines: Sequence[int]) -> None:
        """numbers: (2, n, ..) jobs of these lines for both parities; lines: their numbers."""
        self._rooms, self._lines, self._is_listed = rooms, list(lines), False
        self._borders: list[tuple[Border, tuple[Table, Table]]] = []
        first = Table(blank_network_job)
        first.bind(borders=np.zeros(0, np.int64), border_tables=np.zeros((0, 0), np.int64))
        first.bind(**rooms.whole, **self._of_these(rooms.rows))
        self.jobs = first, first.again(np.empty_like(first.numbers))
        for job, tables in zip(self.jobs, numbers, strict=True):
            job.bind(numbers=tables.view(np.float64), tables=tables)
        self.set_borders()

    def _of_these(self, rows: Values) -> Values:
        """Arrays of all lines of the network, of these lines."""
        if len(self._lines) == len(rows["begins"]):
            return rows
        return {name: np.ascontiguousarray(x[self._lines]) for name, x in rows.items()}

    def set_borders(self) -> None:
        """Take the borders that there are in the rooms now."""
        self._borders.clear()
        for name, border in BORDERS.items():
            room = self._rooms.borders.get(name)
            own = room(self._lines) if callable(room) else room
            if own is not None:
                tables = Table(border.blank), Table(border.blank)
                for job, table in zip(self.jobs, tables, strict=True):
                    table.bind(network=job.numbers, rank=len(self._borders), **own)
                self._borders.append((border, tables))
        if self._is_listed:
            self._list()

    def march_by(self, marcher: int) -> None:
        """Know the kernel that marches lines, and those of all borders, which are compiled if need be."""
        for job in self.jobs:
            job.bind(solver=marcher)
        if not self._is_listed:
            self._list()

    def _list(self) -> None:
        """Let jobs know their borders."""
        self._is_listed = True
        for parity, job in enumerate(self.jobs):
            tables = [x[parity] for _, x in self._borders]
            listed = np.zeros((len(tables), max(x.numbers.size for x in tables)), np.int64)
            for row, table in zip(listed, tables, strict=True):
                table.move(row[: table.numbers.size])
            addresses = [border.kernel.address(x.numbers) for (border, _), x in zip(self._borders, tables, strict=True)]
            job.bind(borders=np.array(addresses, np.int64), border_tables=listed)

    def bind_bodies(self, parity: int, old: Floats, new: Floats) -> None:
        """Steps of a parity lead bodies (B, STATE) from the first to the second."""
        self.jobs[parity].bind(old=old, new=new)

    def ask(self, question: int) -> None:
        """Ask all borders but points and bodies a question of kernels.junctions.borders, at even parity."""
        for border, tables in self._borders[1:]:
            self._rooms.whole["phase"][0] = question
            border.kernel(tables[0].numbers)


# --- arrays of borders ------------------------------------------------------------------------------


def joints_of(lines: Sequence[JoinedLine]) -> NDArray[np.int64]:
    """(L, 2) what starts and ends are joined to, as of a kernels.junctions.borders.NetworkJob."""
    joints = np.array([x.joints for x in lines], np.int64).reshape(-1, 2)
    held = [x.joints[0] >= 0 > x.joints[1] and x.ends.held[1] != 0 for x in lines]
    joints[np.flatnonzero(held), 1] = HELD
    return joints


def room_of_joints(lines: Sequence[JoinedLine], carried: Sequence[int], points: int, bodies: Floats) -> Values:
    """Room of points and bodies; carried: blocks of each line that is solved for more right-hand sides."""
    joints = joints_of(lines)
    turns = any(x.seats[:, TURNS].any() for x in lines)
    columns = np.zeros((COLUMNS if turns else 3, max(sum(carried), 1), SIZE))
    own = 3 * points + 6 * len(bodies)
    unknowns = int((joints[:, 1] != NONE).sum()) + own
    shapes: dict[str, Any] = {"functional": FUNCTIONAL, "answers": (2, ANSWER), "q": COLUMNS, "right": own, "moves": 3}
    shapes |= {"net": (points, 3), "work": (len(bodies), WORK), "S": (HANDED - 1, HANDED), "G": (2, 6, 6)}
    shapes |= {"A": (unknowns + 5, unknowns + 1)}
    room: dict[str, Any] = {name: np.zeros(shape) for name, shape in shapes.items()}
    return room | {"columns": columns, "parts": np.zeros_like(columns), "bodies": bodies}


def room_to_meet(nodes: int, rides: NDArray[np.int64], bodies: int) -> Values:
    """Room of lines of so many nodes that touch the bodies that carry obstacles."""
    carriers = sorted({int(b) for b in rides if b >= 0})
    slots, count = np.full(bodies, -1, np.int64), len(carriers)
    slots[carriers], rows = np.arange(count), EACH_BODY * count
    shapes = {"touched": (nodes * count, TOUCHED), "own": (count, 36), "wrench": (count, 6)}
    spaces = {"responses": (rows, nodes, SIZE), "turned": (rows, bodies, 6), "coupling": (rows + 5, rows + 1)}
    whole = {"carriers": np.array(carriers, np.int64), "slots": slots, "found": np.zeros(1 + count, np.int64)}
    room: dict[str, Any] = {name: np.zeros(shape) for name, shape in (shapes | spaces).items()}
    return room | whole | room_to_keep(nodes, bodies)


def room_of_unknowns(size: int, nodes: int, bodies: int) -> Values:
    """Room of so many sheaves that lines turn, or winches that give of joined lines what keeps their tension."""
    answers = {"answers": np.zeros((size, nodes, SIZE)), "carried": np.zeros((size, bodies, 6))}
    rows = {"listed": np.zeros(1, np.int64), "unknowns": np.zeros((size, EACH_UNKNOWN))}
    return rows | answers | room_to_keep(nodes, bodies)


def room_to_keep(nodes: int, bodies: int) -> Values:
    """Room for corrections that are found without a border."""
    return {"kept": np.zeros((nodes, SIZE)), "moved": np.zeros((bodies, 6))}


def contact_of(
    lines: Sequence[int], room: Mapping[str, Any], contacts: NDArray[np.int64], shared: NDArray[np.int64]
) -> Values | None:
    """Contact of lines with themselves and each other, as far as they are of these.

    room: of all lines of the network; contacts: (L, ..) tables of their contact; shared: (L, 2) the line that has that
    of each, -1: none has, and where its nodes begin there.
    """
    chosen = list(lines)
    place = np.full(len(shared) + 1, -1, np.int64)  # the last: of no line
    place[chosen] = np.arange(len(chosen))
    mine = shared[chosen]
    if not (mine[:, 0] >= 0).any():
        return None
    beside = np.column_stack([place[mine[:, 0]], mine[:, 1]])
    return {"contacts": np.ascontiguousarray(contacts[chosen]), "shared": np.ascontiguousarray(beside), **room}


def room_to_touch(nodes: int, bodies: int, rests: NDArray[np.int64]) -> Values:
    """Room of contact; rests: (1,) 1: of a state in which no step is tried."""
    columns = np.zeros((MOST_PRODUCTS + 1, MOST_PRODUCTS + 4))
    return {"hessenberg": columns, "rests": rests} | room_to_keep(nodes, bodies)


# --- tables of lines ---------------------------------------------------------------------------


Lines = Sequence[JoinedLine]
SelfContacts = Sequence[SelfContact | None]


class LineJobs:
    """Jobs of the lines of a network: of all, of those that are solved together, and of each by itself."""

    # What is set by whoever solves for them (solve.network_solver).
    tolerance: float  # of Newton's method in steps
    body_work: Floats  # (B, WORK)
    net: Floats  # (P, 3) N
    _part: JointJobs | None = None  # jobs of the lines that are solved together, where these are not all

    def __init__(
        self, lines: Lines, bodies: Floats, contacts: SelfContacts, shared: SharedContact | None, apart: bool
    ) -> None:
        """As of `NetworkSolver`."""
        self.lines, self.bodies, self.apart = tuple(lines), bodies, apart
        self._most_nodes = [1 + max(x.line.h.size, x.most_cells) for x in lines]  # cells may come and go in steps
        self._fairleads = np.array([x.fairleads for x in lines], float).reshape(-1, 2, 3)
        self._arms, self._gaps = np.zeros_like(self._fairleads), np.zeros_like(self._fairleads)
        self._seats = np.array([x.seats for x in lines], float).reshape(-1, 2, SEAT)
        self.joints = joints_of(lines)
        self._contacts, self.shared = {k: x for k, x in enumerate(contacts) if x is not None}, shared
        self._rides = lines[0].rides[: 0 if apart else None]  # obstacles are those of all lines
        reaches = [bool(x.line.bits & OBSTACLES) for x in lines]
        turning = int((lines[0].line.moved == FREE).sum())
        self._sheaves = turning if any(reaches) and not apart else 0
        free = bool(self._rides.size or turning)
        # Lines that are joined to nothing that moves with them are solved one by one: in tables with the task RUN.  Of
        # each whether it always moves with others, or never, or else how near it is to what is free, which it may move.
        lone = [APART if (reach and not apart) or not free else APART_ALWAYS for reach in reaches]
        joined = [max(x.joints) >= 0 for x in lines]
        self._near = np.where(joined, JOINED, lone)
        together = [k for k in self._touching_lines if k not in self._contacts or lines[k].keeps_pace]
        self._near[together] = JOINED
        self._alone = np.zeros(len(lines), np.int64)
        self._mixes = [free and near == APART for near in self._near]
        # Winches whose lengths may be unknowns of all lines; iterations of lines with winches that are by themselves.
        each = zip(lines, self._near, self._mixes, strict=True)
        self._winches = sum(x.winds and bool(near == JOINED or mixes) for x, near, mixes in each)
        self._wound: dict[int, int] = {}
        self._reels: dict[int, NDArray[np.int64]] = {}  # tables of lines that are paid out
        self.work = [room_of_line(x, self._keeps(k, x)) for k, x in enumerate(lines)]
        self.books = [blank_books(x.line.h.size) for x in lines]  # powers, work, extremes; `keep_books` gives others
        self.allowed = np.full(len(lines), np.inf)  # m, error of each line that a step may make; `ratio` follows
        self.turns: tuple[NetworkState, NetworkState] | None = None  # states between which steps go back and forth
        self._twists = [bool(x.line.torsion.size) for x in lines]  # whether torques pass through zones of each line
        self._pressed = room_to_meet(sum(self._most_nodes), self._rides, len(bodies)) if self._rides.size else {}
        self._pushes: dict[int, list[Floats]] = {}  # out of planes, of states of even parity and of odd, by line
        self._marcher = 0  # address of the kernel that marches joined lines; 0: nobody has asked for it
        self._phase, self._at_rest, self._asked = np.zeros(1, np.int64), np.zeros(1, np.int64), NetworkTask()

    def _make_tables(self) -> None:
        """Tables of all lines, and which are solved by themselves at first."""
        blank, lines = Table(blank_job), self.lines
        # Of each line two tables, as of the network: states that take turns lead from the one to the other and back.
        self._numbers = np.zeros((2, len(lines), blank.numbers.size), np.int64)
        self._tables = [tuple(blank.again(x[k]) for x in self._numbers) for k in range(len(lines))]
        self.lone: list[int] = []
        self.joined = list(range(len(lines)))
        self.lone_numbers = self._numbers[0, :0]
        self._lone_tables: dict[int, Table] = {}
        self._beside: dict[int, tuple[Table]] = {}  # jobs that no step uses, of lines that are joined
        self._joined_tables = dict(enumerate(self._tables))
        for k, (x, work, books) in enumerate(zip(lines, self.work, self.books, strict=True)):
            limits = Limits(REACH * x.length, x.scale, 1)
            self.bind_line(k, task=Task(ASSEMBLY, limits=limits), line=x.line, sea=x.sea, ends=x.ends)
            self.bind_line(k, work=work, books=books, was=NO_PUSH, now=NO_PUSH)
        self._group()

    def _keeps(self, number: int, x: JoinedLine) -> bool:
        """Whether all factors of a line may serve again: for contact, bodies, sheaves, winches, and tangents.

        These are of steps that are solved to round-off, and are held against others: all must round alike.
        """
        beside = bool(self._rides.size or self._sheaves or self._winches)
        mixes = beside and (self._mixes[number] or self._near[number] == JOINED)
        return x.winds or mixes or number in self._touching_lines or self.tolerance < TOLERANCE

    @property
    def _touching_lines(self) -> set[int]:
        """Numbers of the lines that touch themselves, or may touch others."""
        return {*self._contacts, *(self.shared.lines if self.shared is not None else ())}

    @cached_property
    def _rooms(self) -> Rooms:
        """What jobs of several lines work in, or of one in a run."""
        lines, points, bodies, nodes = self.lines, len(self.net), self.bodies, sum(self._most_nodes)
        carried = [most if is_answered_again(x) else 0 for x, most in zip(lines, self._most_nodes, strict=True)]
        joints = room_of_joints(lines, carried, points, bodies)
        joints |= {"net": self.net, "work": self.body_work}
        twists = self._twists  # which change in place
        borders: dict[str, Any] = {"joints": {}}
        if self._rides.size:
            borders["shapes"] = self._pressed
        if self._winches:
            borders["winches"] = room_of_unknowns(self._winches, nodes, len(bodies))
        if self._sheaves:
            borders["sheaves"] = room_of_unknowns(self._sheaves, nodes, len(bodies))
        floors = np.array([-np.inf if x.slackens else x.floor for x in lines])
        first = np.concatenate([[0], np.cumsum(carried)[:-1]]).astype(np.int64)
        begins = np.append(0, np.cumsum(self._most_nodes)[:-1]).astype(np.int64)
        rows: dict[str, Any] = {"joints": self.joints, "floors": floors, "first": first, "begins": begins}
        rows |= {"seats": self._seats, "arms": self._arms, "fairleads": self._fairleads, "allowed": self.allowed}
        rows |= {"gaps": self._gaps, "still": np.zeros_like(self._gaps)}
        whole = joints | {"near": self._near, "alone": self._alone, "asked": self._asked, "rides": self._rides}
        whole |= {"phase": self._phase, "marks": np.zeros(nodes, np.int64)}
        borders["torques"] = lambda lines: {} if any(twists[k] for k in lines) else None
        return Rooms(whole, rows, borders)

    def bind_line(self, number: int, **values: Any) -> None:
        """Put values in their places in the jobs of a line."""
        for table in (*self._tables[number], *self._beside.get(number, ())):
            table.bind(**values)
        if number in self._lone_tables:
            self._lone_tables[number].bind(**self._by_itself(number, values))
        elif self._part is not None:
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
        if not (self._mixes[number] or self._near[number] == APART_ALWAYS):
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
        self._alone[:] = (self._near == APART) | (self._near == APART_ALWAYS)
        if any(self._mixes) and self._alone.all():  # what is free moves with the first line that can reach it
            self._alone[self._mixes.index(True)] = 0
        self.lone, self.joined = (np.flatnonzero(self._alone == x).tolist() for x in (1, 0))
        self.lone_numbers = np.zeros((len(self.lone), self._numbers.shape[2]), np.int64)
        self._lone_tables = {}
        for k, numbers in zip(self.lone, self.lone_numbers, strict=True):
            table, own = self._tables[k][0].again(numbers), {"line": self.lines[k].line, "work": self.work[k]}
            table.bind(**self._by_itself(k, own | {"iterated": 0}))
            self._lone_tables[k] = table
        self._part, self._joined_tables, self._beside = None, dict(enumerate(self._tables)), {}
        if self.lone and not self.is_apart:
            numbers = np.zeros((2, len(self.joined), self._numbers.shape[2]), np.int64)
            self._joined_tables = {
                k: tuple(mine.again(x[j]) for mine, x in zip(self._tables[k], numbers, strict=True))
                for j, k in enumerate(self.joined)
            }
            self._part = JointJobs(self._rooms, numbers, self.joined)
            if self._marcher:
                self._part.march_by(self._marcher)

    @cached_property
    def _all(self) -> JointJobs:
        """Jobs of all lines, made when they are solved together, or a run leads them from state to state."""
        return JointJobs(self._rooms, self._numbers, range(len(self.lines)))

    @property
    def _together(self) -> JointJobs:
        """Jobs of the lines that are solved together."""
        return self._all if self._part is None else self._part

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
        self._all.ask(CARRY)
        self.body_work[:, U : U + 3] = shifts
        find_near(self._all.jobs[0].numbers)

    def regroup(self) -> dict[str, Any]:
        """Solve lines with what they have been found near, and others by themselves: as of `swap_states`."""
        self._group()
        return self._bind_turns()

    def _find_torques(self) -> None:
        """Torques pass through catenary zones of lines, or do no more, from now on."""
        twists = [bool(x.line.torsion.size) for x in self.lines]
        if twists != self._twists:
            self._twists[:] = twists  # which the border reads
            for jobs in self._groups:
                jobs.set_borders()

    def adopt_cells(self, number: int, line: Line, sea: Sea, work: Work, books: Books) -> None:
        """A line is in other arrays from now on, of which its jobs know."""
        self.lines = tuple(x._replace(line=line, sea=sea) if k == number else x for k, x in enumerate(self.lines))
        self.work[number], self.books[number] = work, books
        self._find_torques()

    def keep_factors(self) -> None:
        """Keep all factors of all lines in every march from now on, for other right-hand sides."""
        for k, (x, work) in enumerate(zip(self.lines, self.work, strict=True)):
            self.work[k] = work._replace(X=np.zeros((x.line.h.size + 1) * (ROW + KEPT)))
            self.bind_line(k, work=self.work[k])
        if any(self._mixes):  # other right-hand sides have what lines may do to what is free
            self._near[self._mixes], self._mixes = JOINED, [False] * len(self.lines)
            self._group()

    def tables_beside(self, number: int) -> tuple[Table, list[tuple[Table, ...]]]:
        """A job of a line alone, which its steps use if it is solved by itself; all jobs of steps by their parity."""
        pairs = [self._tables[number]]
        if number in self._lone_tables:
            return self._lone_tables[number], pairs
        if self._part is not None:
            pairs.append(self._joined_tables[number])
        even = self._tables[number][0]
        self._beside[number] = (even.again(np.empty_like(even.numbers)),)
        return self._beside[number][0], pairs

    def room_beside(self, number: int, twice: bool) -> Callable[[int], Work]:
        """What makes room for cells of a line, as its steps have it; twice: factors of a lone one serve again."""
        x = self.lines[number]
        keeps = twice if number in self._lone_tables else self._keeps(number, x)
        return lambda cells: workspace(cells)._replace(**room_of_factors(x, cells, keeps))

    def touches(self, number: int) -> bool:
        """Whether a line touches itself, or may touch others."""
        return number in self._touching_lines

    def place_frames(self, number: int, bodies: Floats) -> None:
        """Frames of ends of a line that turn with bodies are as these (B, STATE) are, wherever a try has led to."""
        ends, joints, seats = self.lines[number].ends, self.lines[number].joints, self.lines[number].seats
        for k in np.flatnonzero(seats[:, TURNS]):
            row = bodies[joints[k] - len(self.net)]
            axes = row[FRAME:V].reshape(3, 3)
            ends.frame[k] = (axes @ seats[k, :TURNS].reshape(3, 3)).ravel()
            ends.spin[k] = axes @ row[W : W + 3]

    def limits_by_itself(self, number: int) -> Limits:
        """What Newton's method works with in a line that is solved by itself."""
        return Limits(REACH * self.lines[number].length, self.lines[number].scale, MOST_OF_STEP, self.tolerance)

    def marcher_of(self, number: int) -> int:
        """Address of the kernel that marches a line: those that are joined are marched in space."""
        return self._kernel_of(number).address(self._numbers[0, number])

    def _kernel_of(self, number: int) -> Any:
        return in_plane if number in self._lone_tables and self.lines[number].line.bits & PLANAR else in_space

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
        return solve_network.address(self._all.jobs[0].numbers)

    def _let_march(self) -> None:
        """Jobs of joined lines know the kernels that march them and couple them, which take long to compile."""
        self._marcher = in_space.address(self._numbers[0, 0])
        for jobs in self._groups:
            jobs.march_by(self._marcher)

    @property
    def _groups(self) -> list[JointJobs]:
        """Jobs of all lines, and of those that are solved together where these are others."""
        return [self._all] if self._part is None else [self._all, self._part]

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
        room = room_to_touch(sum(self._most_nodes), len(self.bodies), self._at_rest)
        self._rooms.borders["contact"] = lambda of: contact_of(of, room, tables, shared)
        for jobs in self._groups:
            jobs.set_borders()

    def _share(self, tables: NDArray[np.int64], shared: NDArray[np.int64]) -> None:
        """Lines that may touch each other do so; the last of them is asked, and goes into the tables of all contact."""
        found = self.shared
        assert found is not None
        one, both = found.attach(self._numbers, self.books)
        for k, begin in zip(found.lines, found.begins.tolist(), strict=True):
            self.bind_line(k, contact=found.beside)
            shared[k] = found.last, begin
        for own in (self._tables, self._joined_tables):
            for table, numbers in zip(own[found.last], both, strict=True):
                table.bind(contact=found.call, contact_table=numbers)
        tables[found.last] = one

    @property
    def line_tables(self) -> NDArray[np.int64]:
        """(2, L, ..) jobs of all lines, of steps of even and of odd parity."""
        return self._numbers

    def join_states(self, states: NetworkState) -> None:
        """Let the jobs of even parity lead from states to the same."""
        self.turns = None
        self._bind_states(0, states, states)

    def keep_books(self, books: Sequence[Books]) -> None:
        """Keep powers, work and extremes of the lines in these books from now on."""
        self.books = list(books)
        for k, each in enumerate(books):
            asks = each.asked.size or each.walls.size
            self.bind_line(k, books=each, quantities=note_quantities.address(self._numbers[0, 0]) if asks else 0)
        if self._contacts or self.shared is not None:
            self._touch()

    def swap_states(self, states: tuple[NetworkState, NetworkState]) -> dict[str, Any]:
        """Steps lead from the first state to the second and back from now on: what run.network_run.StepsJob has."""
        self.turns = states
        return self._bind_turns()

    def jobs_of_joined(self) -> tuple[Table, Table]:
        """Jobs of both parities without lines that are solved by themselves: none is left where all are."""
        if self.joined or self._part is not None:
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
            states = self._by_itself(k, {"old": old.lines[k], "new": new.lines[k]})
            table.bind(task=Task(RUN, limits=self.limits_by_itself(k)), **states)
            self._bind_pushes(k)
        numbers, mixes = self._all.jobs[0].numbers, any(self._mixes)
        together, marchers = self._together.jobs, np.array([self.marcher_of(k) for k in self.lone], np.int64)
        found: dict[str, Any] = {"even": numbers, "odd": self._all.jobs[1].numbers, "marchers": marchers}
        found |= {"joined_even": together[0].numbers, "joined_odd": together[1].numbers, "lone": self.lone_numbers}
        found |= {"joined": np.array(self.joined, np.int64), "lone_lines": np.array(self.lone, np.int64)}
        finder, leader = (x.address(numbers) if mixes else 0 for x in (find_near, lead_lone))
        return found | {"finder": finder, "leader": leader}

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
        if self._part is not None:
            for k, tables in self._joined_tables.items():
                tables[parity].bind(old=old.lines[k], new=new.lines[k])
            self._part.bind_bodies(parity, old.bodies, new.bodies)
