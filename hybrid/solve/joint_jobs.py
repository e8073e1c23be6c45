"""Tables of the lines of a system that one Newton solves: all of them, or those that are joined to what moves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.junctions.body_contact import meet_bodies
from hybrid.kernels.junctions.body_forces import blank_meeting_job
from hybrid.kernels.junctions.joined_sheaves import blank_spinning_job, spin_sheaves
from hybrid.kernels.junctions.lines_contact import blank_touching_job, touch_system
from hybrid.kernels.junctions.network_job import blank_system_job
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.state.state import Floats


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
