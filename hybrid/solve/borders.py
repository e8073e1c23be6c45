"""The borders of Newton's method (kernels.junctions.borders), in the order in which they are asked, and their arrays.

An answer of a border has those of all borders before it, so that the order is that of what an answer needs:
points and bodies first, by which lines answer to anything; then what has few columns, which are found once an
iteration and serve all that follows: bodies that lines touch, which move the ends of lines; winches, which turn no
sheave; sheaves, which winches pull ropes over.  Torques only correct what the others find, between ends that stay.
Contact of lines comes last: it has too many columns to keep, and asks all others again for each product of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.algebra.block_elimination import SIZE
from hybrid.kernels.junctions.bodies import WORK
from hybrid.kernels.junctions.body_contact import EACH_BODY, TOUCHED, blank_meeting_job, meet_bodies
from hybrid.kernels.junctions.borders import blank_border_job, blank_network_job
from hybrid.kernels.junctions.joined_lines import ANSWER, COLUMNS, FUNCTIONAL, TURNS
from hybrid.kernels.junctions.junctions import HANDED, join_lines, twist_lines
from hybrid.kernels.junctions.lines_contact import blank_touching_job, room_for_products, touch_network
from hybrid.kernels.junctions.sheaves_and_winches import EACH_UNKNOWN, blank_unknowns_job, spin_sheaves, wind_lines
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.state.state import Floats
from hybrid.solve.stepper import JoinedLine

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
    borders: dict[str, Callable[[Sequence[int]], Values | None]]  # of borders by name, for lines; None: they have none


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
            own = self._rooms.borders[name](self._lines) if name in self._rooms.borders else None
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


def room_of_joints(lines: Sequence[JoinedLine], carried: Sequence[int], points: int, bodies: Floats) -> Values:
    """Room of points and bodies; carried: blocks of each line that is solved for more right-hand sides."""
    joints = np.array([x.joints for x in lines], np.int64).reshape(-1, 2)
    turns = any(x.seats[:, TURNS].any() for x in lines)
    columns = np.zeros((COLUMNS if turns else 3, max(sum(carried), 1), SIZE))
    own = 3 * points + 6 * len(bodies)
    unknowns = int((joints[:, 1] >= 0).sum()) + own
    return {
        "columns": columns, "functional": np.zeros(FUNCTIONAL), "parts": np.zeros_like(columns),
        "answers": np.zeros((2, ANSWER)), "q": np.zeros(COLUMNS), "net": np.zeros((points, 3)), "bodies": bodies,
        "work": np.zeros((len(bodies), WORK)), "S": np.zeros((HANDED - 1, HANDED)), "G": np.zeros((2, 6, 6)),
        "A": np.zeros((unknowns + 5, unknowns + 1)), "right": np.zeros(own), "moves": np.zeros(3),
    }  # fmt: skip


def room_to_meet(nodes: int, rides: NDArray[np.int64], bodies: int) -> Values:
    """Room of lines of so many nodes that touch the bodies that carry obstacles."""
    carriers = sorted({int(b) for b in rides if b >= 0})
    slots, rows = np.full(bodies, -1, np.int64), EACH_BODY * len(carriers)
    slots[carriers] = np.arange(len(carriers))
    return {
        "carriers": np.array(carriers, np.int64), "slots": slots,
        "found": np.zeros(1 + len(carriers), np.int64), "touched": np.zeros((nodes * len(carriers), TOUCHED)),
        "own": np.zeros((len(carriers), 36)), "wrench": np.zeros((len(carriers), 6)),
        "responses": np.zeros((rows, nodes, SIZE)), "turned": np.zeros((rows, bodies, 6)),
        "coupling": np.zeros((rows + 5, rows + 1)), **room_to_keep(nodes, bodies),
    }  # fmt: skip


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
    return {"hessenberg": room_for_products(), "rests": rests} | room_to_keep(nodes, bodies)
