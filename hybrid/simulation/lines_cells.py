"""Lines of several whose cells follow the curvature: they change between two steps without Python's help.

Only in a line that is joined to nothing that moves with it, which is marched by itself: what it needs for a change is
what one cable needs (simulation.cell_changes).  Its outputs wait in rows with room for the most cells, since all lines
have as many of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, cast

import numpy as np

from hybrid.kernels.contact.self_distance import Itself
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.run.entry import NO_PUSH
from hybrid.kernels.state.books import Books, Clock, Counts
from hybrid.kernels.state.forces import REMEMBERS
from hybrid.kernels.state.state import Batch, Floats, State, Work
from hybrid.kernels.step.newton import Limits
from hybrid.model.build import Model
from hybrid.model.system import SystemModel
from hybrid.outputs.joined_lines import Output, outputs_in
from hybrid.simulation.bending_correction import Correction
from hybrid.simulation.cell_changes import LEAST_CELLS, CellChanges
from hybrid.simulation.envelope import Envelope
from hybrid.simulation.kind_changes import carries_all
from hybrid.simulation.lines_contact import LinesWatch
from hybrid.simulation.zone_switching import ZoneSwitching
from hybrid.solve.self_contact import SelfContact
from hybrid.solve.system import SystemSolver
from hybrid.solve.system_steps import SystemSteps

if TYPE_CHECKING:  # a line that is not paid out does without
    from hybrid.simulation.payout import PayingOut


class OfLine(Protocol):
    """What changes of cells have to know of the result of a line (simulation.system_lines)."""

    books: Books

    @property
    def envelope(self) -> Envelope: ...
    @property
    def marked(self) -> Sequence[tuple[float, int]]: ...
    @property
    def contact(self) -> SelfContact | None: ...
    @property
    def correction(self) -> Correction | None: ...
    @property
    def paying(self) -> PayingOut | None: ...
    @property
    def outputs_join(self) -> bool: ...
    @property
    def watch_table(self) -> Table | None: ...
    def batch_of(self, rows: Floats, cells: int) -> Batch: ...


class HasPlane(Protocol):
    """The plane of a line, and the push out of it."""

    pushes: tuple[Floats, Floats]


class HasPlanes(Protocol):
    """Those of all lines."""

    def of(self, k: int) -> HasPlane | None: ...


class OfRun(Protocol):
    """And of the run of all lines (simulation.system_run)."""

    solver: SystemSolver
    loop: SystemSteps
    model: SystemModel
    watch: LinesWatch | None

    @property
    def t(self) -> float: ...
    @property
    def lines(self) -> Sequence[OfLine]: ...
    @property
    def payout(self) -> object: ...
    @property
    def planes(self) -> HasPlanes | None: ...
    @property
    def asks_quantities(self) -> bool: ...
    def adopt_cells(self, number: int, model: Model, work: Work) -> None: ...


# What outputs have of nodes and of cells.
OF_NODES, OF_CELLS = ("r", "v", "vd", "kb"), ("e", "T", "a1", "w", "h")


def ends_alone(batches: Sequence[Batch]) -> Batch:
    """Outputs of one line on several meshes one behind the other, with their ends as the only nodes."""
    own: dict[str, list[Any]] = {name: [getattr(x, name) for x in batches] for name in Batch._fields}
    own |= {name: [x[:, [0, -1]] if x.size else x for x in own[name]] for name in OF_NODES}
    own |= {name: [x[:, :1] if x.size else x for x in own[name]] for name in OF_CELLS}
    return Batch(**{name: np.concatenate(x) for name, x in own.items()})


class LineTables:
    """Tables of a line that change together: of its steps by itself, and of those of all lines by their parity."""

    def __init__(self, alone: Table, even: Table, odd: Table) -> None:
        self.alone, self.even, self.odd = alone, even, odd
        self.numbers = alone.numbers

    def part(self, name: str) -> slice:
        """As of `Table`."""
        return self.alone.part(name)

    def bind(self, **values: Any) -> None:
        """As of `Table`, of what steps of the line by itself alone have."""
        self.alone.bind(**values)

    def hold(self, *, old: State, new: State, **values: Any) -> None:
        """As of `Table`."""
        for table in (self.alone, self.even):
            table.hold(old=old, new=new, **values)
        self.odd.hold(old=new, new=old, **values)


class WatchedLine:
    """How near a line comes to itself, as changes of cells see it."""

    on = True

    def __init__(self, line: OfLine, table: Table) -> None:
        self._watch, self.table = line.envelope.itself, table

    @property
    def itself(self) -> Itself:
        """What is known of it."""
        return self._watch.itself

    @itself.setter
    def itself(self, known: Itself) -> None:
        self._watch.itself = known


class Marching(NamedTuple):
    """What marches a line: room, and what Newton's method works with."""

    work: Work
    limits: Limits


class OneOfMany:
    """A line of several, as changes of its cells see it: what `Transient` and its compiled run are to a cable."""

    of_many = True

    pays_out = True  # where a node is to enter or leave at a winch
    correction = None

    def __init__(self, run: OfRun, number: int, switching: ZoneSwitching | None = None) -> None:
        self._system, self._number, self.switching = run, number, switching
        line = run.lines[number]
        self.run, self.envelope, self.marked = self, line.envelope, line.marked
        self._plane = None if run.planes is None else run.planes.of(number)
        self.table = LineTables(*run.solver.tables_by_itself(number))
        table = line.watch_table
        self.itself = WatchedLine(line, table) if table is not None else None
        self.stepper = Marching(run.solver.work[number], run.solver.limits_by_itself(number))

    @property
    def push(self) -> Floats:
        """Out of its plane, now; empty: none."""
        return self.pushes[self.count.parity]

    @property
    def pushes(self) -> tuple[Floats, Floats]:
        """Of states of even and of odd parity."""
        return (NO_PUSH, NO_PUSH) if self._plane is None else self._plane.pushes

    @pushes.setter
    def pushes(self, pushes: tuple[Floats, Floats]) -> None:
        if self._plane is not None:
            self._plane.pushes = pushes

    @property
    def payout(self) -> PayingOut | None:
        """Its length, if it is paid out."""
        return self._system.lines[self._number].paying

    @property
    def model(self) -> Model:
        """The line as it is."""
        return self._system.model.models[self._number]

    @property
    def books(self) -> Books:
        """Its books."""
        return self._system.lines[self._number].books

    @books.setter
    def books(self, books: Books) -> None:
        self._system.lines[self._number].books = books

    @property
    def states(self) -> tuple[State, State]:
        """Its states of even and of odd parity."""
        even, odd = self._system.loop.turns
        return even.lines[self._number], odd.lines[self._number]

    @states.setter
    def states(self, states: tuple[State, State]) -> None:
        for each, state in zip(self._system.loop.turns, states, strict=True):
            cast(list[State], each.lines)[self._number] = state

    @property
    def clock(self) -> Clock:
        """Of all lines."""
        return self._system.loop.clock

    @property
    def count(self) -> Counts:
        """Of all lines."""
        return self._system.loop.counts

    @property
    def t(self) -> float:
        """Time, s."""
        return self._system.t

    @property
    def outputs_may_wait(self) -> bool:
        """Whether outputs may wait although the cells that they are of have changed."""
        return not self._system.asks_quantities and self._system.lines[self._number].outputs_join

    def solver_address(self) -> int:
        """Of the kernel that marches it."""
        return self._system.solver.marcher_of(self._number)

    def set_quota(self, cells: int) -> None:
        """Calls go on for as long as before: that is of all lines."""

    def take(self, model: Model, work: Work) -> None:
        """Go on with the line in other cells, which the run has changed to."""
        self._system.adopt_cells(self._number, model, work)


def by_itself(run: OfRun, number: int) -> bool:
    """Whether nothing but its own steps knows of the cells of a line, in a run whose solver is attached."""
    line, watched = run.lines[number], run.watch is not None and run.watch.is_needed
    alone = number in run.solver.lone and not run.solver.mixes and not watched
    return alone and line.contact is None and line.correction is None


class LineCells(CellChanges):
    """Changes of the cells of one of several lines, and of what is rod, with the solver that it has now."""

    def __init__(self, run: OfRun, number: int, switching: ZoneSwitching) -> None:
        self._many, self._line, self._solver = run, run.lines[number], run.solver
        owner = OneOfMany(run, number, switching)
        self.by_parity = owner.table.even, owner.table.odd
        super().__init__(owner)  # type: ignore[arg-type]

    @staticmethod
    def may_change(run: OfRun, number: int, switching: ZoneSwitching) -> bool:
        """Whether cells of a line can change so in a run whose solver is attached."""
        if not switching.zones.clock.share > 0.0 or run.payout is not None or not by_itself(run, number):
            return False
        model = run.model.models[number]
        plain = carries_all(model, switching) and not model.line.bits & REMEMBERS
        return plain and switching.manager.layout.rod.size >= LEAST_CELLS

    def fits(self, switching: ZoneSwitching) -> bool:
        """Whether the line is solved by what the arrays were made for, and its zones are these."""
        watched = self._owner.itself.table if self._owner.itself is not None else None
        same = self._solver is self._many.solver and self._line.watch_table is watched
        return bool(same and switching is self._switching and super().still_fits())

    @property
    def job(self) -> np.ndarray:
        """The table of kernels.run.following_run that the compiled steps get."""
        self._at.alone, self._at.may_wait = self.alone, self._owner.outputs_may_wait
        return self._following.numbers

    def outputs(self, rows: Floats) -> tuple[list[Output], Batch]:
        """All outputs that wait, in rows, copied, each with its line; and what they have at the ends."""
        model, begin, found, batches = self._owner.model, 0, list[Output](), list[Batch]()
        assert model.layout is not None
        for first, count, cells in self._waiting[: self._at.waiting].tolist():
            line = self._line_of(self._places[begin : begin + cells + 1], model.layout.rod)
            batches.append(self._line.batch_of(rows[first : first + count], cells))
            found += outputs_in(batches[-1], line, model.zones)
            begin += cells + 1
        if len(rows) > self._at.used:
            batches.append(self._line.batch_of(rows[self._at.used :], model.cells))
            found += outputs_in(batches[-1], model.line, model.zones)
        self._at.waiting = self._at.placed = self._at.used = 0
        return found, ends_alone(batches)
