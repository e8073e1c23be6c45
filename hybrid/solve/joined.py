"""Lines that meet at points, as their solver takes them and gives them back (solve.network_solver)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.errors import ComputationError, Outcome
from hybrid.kernels.junctions.bodies import STATE
from hybrid.kernels.junctions.body_contact import meet_bodies
from hybrid.kernels.junctions.body_forces import blank_meeting_job
from hybrid.kernels.junctions.carried_frames import SEAT
from hybrid.kernels.junctions.joined_sheaves import blank_spinning_job, spin_sheaves
from hybrid.kernels.junctions.lines_contact import blank_touching_job, touch_system
from hybrid.kernels.junctions.network_job import blank_system_job
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.march.assembly import JOINED
from hybrid.kernels.state.state import Ends, Floats, Line, Sea, State


class JoinedLine(NamedTuple):
    """One line of a system."""

    line: Line
    sea: Sea
    ends: Ends
    length: float  # m
    scale: float  # N, tension scale
    floor: float  # N, tension at or below which a catenary cell is slack in motion; -infinity: none is
    joints: tuple[int, int]  # numbers of the points, or behind them bodies, that start and end are joined to; -1: held
    fairleads: Floats = np.zeros((2, 3))  # m, of ends that are joined to bodies, in axes of the body
    seats: Floats = np.zeros(
        (2, SEAT)
    )  # frames of ends that turn with these (kernels.junctions.carried_frames); zeros: none does
    slackens: bool = False  # whether a motion goes on with slack catenaries, and rest is taken with them if need be
    rides: NDArray[np.int64] = np.zeros(0, np.int64)  # (M,) bodies that carry obstacles, -1: none does; empty: no body
    borne: Floats = np.zeros(0)  # (N,) strain that cells bear, of a line that may lie on obstacles; empty: of no other
    keeps_pace: bool = False  # whether its zones or its length follow the steps with the spectral radius of all lines
    winds: bool = False  # whether its winch holds a tension, which takes factors of its equations that serve again


class NetworkState(NamedTuple):
    """All that a system knows of itself at a time: the states of its lines, and (B, STATE) of its free bodies."""

    lines: Sequence[State]
    bodies: Floats = np.zeros((0, STATE))

    def copy(self) -> NetworkState:
        """The same in arrays of its own."""
        return NetworkState([x.copy() for x in self.lines], self.bodies.copy())


@dataclass(frozen=True)
class NetworkTaken:
    """How a solution went: outcome, Newton iterations, predicted next correction, line and cell or node where it was
    worst, the largest residual force at a node or point (N), the local error of a step (m), the largest of a line over
    what is allowed of it: a step of more than REFUSED (step.step_law) is in no books, and is to be repeated; and its
    spectral radius at infinity."""

    outcome: Outcome
    iterations: int
    correction: float
    line: int
    where: int
    residual: float
    error: float = 0.0
    ratio: float = 0.0
    rho: float = 0.0


class LineFailed(ComputationError):
    """A computation of lines stopped: number of the line where it did, -1 for a point."""

    def __init__(self, line: int, *error: object, first: str = "") -> None:
        """error: as of `ComputationError`; first: likewise."""
        super().__init__(*error, first=first)  # type: ignore[arg-type, misc]
        self.line, self.first = line, first


def joined_ends(ends: Ends, joints: tuple[int, int]) -> Ends:
    """The conditions of a line's ends with those that are joined to points; arrays are shared but for `held`."""
    held = ends.held.copy()
    held[[k for k in (0, 1) if joints[k] >= 0]] = JOINED
    return ends._replace(held=held)


# Tables of the lines of a system that one Newton solves: all of them, or those that are joined to what moves.


class Rooms(NamedTuple):
    """What jobs of lines work in, whichever they are of; only one of them works at a time."""

    shared: dict[str, Any]  # of all kernels of joined lines
    of_lines: dict[str, Any]  # likewise, with a row for each line of the system
    rows: dict[str, Any]  # of NetworkJob alone, likewise
    job: dict[str, Any]  # of NetworkJob alone
    begins: NDArray[np.int64]  # (L,) where nodes of lines begin
    meeting: dict[str, Any]  # of lines that touch free bodies; empty: no body has a shape
    spinning: dict[str, Any]  # of sheaves that turn freely and winches of joined lines; empty: there are none


class JointJobs:
    """Jobs of both parities for some lines of a system, with all of its points and bodies."""

    def __init__(self, rooms: Rooms, numbers: NDArray[np.int64], lines: Sequence[int]) -> None:
        """numbers: (2, n, ..) jobs of these lines for both parities; lines: their numbers."""
        self._rooms, self._numbers, self._lines = rooms, numbers, list(lines)
        first, common = Table(blank_system_job), self._common(numbers[0])
        first.bind(**common, **rooms.job, **self._of_these(rooms.rows))
        self.jobs = first, first.again(np.empty_like(first.numbers))
        self._meeting = [Table(blank_meeting_job) for _ in numbers] if rooms.meeting else []
        self._spinning = [Table(blank_spinning_job) for _ in numbers] if rooms.spinning else []
        self._touching: list[Table] = []
        begins = rooms.begins[self._lines]
        for parity, (job, tables) in enumerate(zip(self.jobs, numbers, strict=True)):
            common["tables"] = tables
            job.bind(numbers=tables.view(np.float64), tables=tables)
            if self._meeting:
                meeting = self._meeting[parity]
                meeting.bind(begins=begins, **common, **rooms.meeting)
                job.bind(meet=meet_bodies.address(meeting.numbers), meet_table=meeting.numbers)
            if self._spinning:
                spinning = self._spinning[parity]
                spinning.bind(begins=begins, **common, **rooms.spinning)
                self._beside_bodies(parity, spinning)
                job.bind(spin=spin_sheaves.address(spinning.numbers), spin_table=spinning.numbers)

    def _of_these(self, rows: dict[str, Any]) -> dict[str, Any]:
        """Arrays of all lines of the system, of these lines."""
        if len(self._lines) == len(self._rooms.begins):
            return rows
        return {name: np.ascontiguousarray(x[self._lines]) for name, x in rows.items()}

    def _common(self, tables: NDArray[np.int64]) -> dict[str, Any]:
        """What all kernels of joined lines work with; tables: (n, ..) jobs of the lines."""
        return {"tables": tables} | self._rooms.shared | self._of_these(self._rooms.of_lines)

    def _beside_bodies(self, parity: int, table: Table) -> None:
        """Corrections that this one adds are coupled to bodies that lines touch."""
        if self._meeting:
            numbers = self._meeting[parity].numbers
            table.bind(meet=meet_bodies.address(numbers), meet_table=numbers)

    def touch(self, room: dict[str, Any], contacts: NDArray[np.int64], shared: NDArray[np.int64]) -> None:
        """Lines touch themselves or each other from now on, as far as they are of these.

        room: of all lines; contacts: (L, ..) tables of their contact; shared: (L, 2) the line that has that of each,
        -1: none has, and where its nodes begin there.
        """
        place = np.full(len(self._rooms.begins) + 1, -1, np.int64)  # the last: of no line
        place[self._lines] = np.arange(len(self._lines))
        mine = shared[self._lines]
        if not (mine[:, 0] >= 0).any():
            return
        beside = np.column_stack([place[mine[:, 0]], mine[:, 1]])
        self._touching = [Table(blank_touching_job) for _ in self._numbers]
        for parity, (job, touching, tables) in enumerate(zip(self.jobs, self._touching, self._numbers, strict=True)):
            own = {"contacts": np.ascontiguousarray(contacts[self._lines]), "shared": np.ascontiguousarray(beside)}
            touching.bind(**self._common(tables), **room, **own)
            self._beside_bodies(parity, touching)
            if self._spinning:
                numbers = self._spinning[parity].numbers
                touching.bind(spin=spin_sheaves.address(numbers), spin_table=numbers)
            job.bind(touch=touch_system.address(touching.numbers), touch_table=touching.numbers)

    def bind_bodies(self, parity: int, old: Floats, new: Floats) -> None:
        """Steps of a parity lead bodies (B, STATE) from the first to the second."""
        for tables in (self.jobs, self._touching, self._meeting, self._spinning):
            if tables:
                tables[parity].bind(old=old, new=new)

    def ask_bodies(self, phase: int) -> None:
        """Ask of bodies that lines touch what kernels.junctions.body_contact does in a phase, at even parity."""
        if self._meeting:
            self._rooms.job["phase"][0] = phase
            meet_bodies(self._meeting[0].numbers)
