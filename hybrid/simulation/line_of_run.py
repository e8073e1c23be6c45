"""A line of a run, as changes of its cells and nodes see it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, cast

import numpy as np

from hybrid.kernels.contact.self_distance import Itself
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.run.entry import NO_PUSH
from hybrid.kernels.state.books import Books, Clock, Counts
from hybrid.kernels.state.state import Batch, Floats, State, Work
from hybrid.kernels.step.newton import Limits
from hybrid.model.build import Model
from hybrid.model.network import NetworkModel
from hybrid.simulation.envelope import Envelope
from hybrid.simulation.lines_contact import LinesWatch
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.network_steps import NetworkSteps
from hybrid.solve.self_contact import SelfContact
from hybrid.zones.change import ZoneSwitching

if TYPE_CHECKING:  # a line that is not paid out does without
    from hybrid.simulation.payout import PayingOut


# What outputs have of nodes and of cells.
OF_NODES, OF_CELLS = ("r", "v", "vd", "kb"), ("e", "T", "a1", "w", "h")


class OfLine(Protocol):
    """What changes of cells have to know of the result of a line (simulation.line_result)."""

    books: Books

    @property
    def envelope(self) -> Envelope: ...
    @property
    def marked(self) -> Sequence[tuple[float, int]]: ...
    @property
    def contact(self) -> SelfContact | None: ...
    @property
    def paying(self) -> PayingOut | None: ...
    @property
    def plane(self) -> HasPlane | None: ...
    @property
    def watched_by(self) -> LinesWatch | None: ...
    @property
    def outputs_join(self) -> bool: ...
    @property
    def watch_table(self) -> Table | None: ...
    def batch_of(self, rows: Floats, cells: int) -> Batch: ...


class HasPlane(Protocol):
    """The plane of a line, and the push out of it."""

    pushes: tuple[Floats, Floats]


class OfRun(Protocol):
    """And of the run of all lines (simulation.network_run)."""

    solver: NetworkSolver
    loop: NetworkSteps
    model: NetworkModel

    @property
    def t(self) -> float: ...
    @property
    def lines(self) -> Sequence[OfLine]: ...
    @property
    def asks_quantities(self) -> bool: ...
    def adopt_cells(self, number: int, model: Model, work: Work) -> None: ...


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


class Around(NamedTuple):
    """What a run knows of a line beside its states.

    envelope: extremes of all meshes, None: none are kept; marked: as of `marks_on`; nearest: (2,) the pair of cells
    that was nearest.
    """

    work: Work
    books: Books
    envelope: Envelope | None
    marked: Sequence[tuple[float, int]]
    nearest: np.ndarray


class OneOfMany:
    """A line of several, as changes of its cells see it: the line, its books and the clock of all."""

    def __init__(self, run: OfRun, number: int, switching: ZoneSwitching | None = None) -> None:
        self._system, self._number, self.switching = run, number, switching
        line = run.lines[number]
        self.envelope, self.marked = line.envelope, line.marked
        self._plane = line.plane
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

    def take(self, model: Model, work: Work) -> None:
        """Go on with the line in other cells, which the run has changed to."""
        self._system.adopt_cells(self._number, model, work)


def ends_alone(batches: Sequence[Batch]) -> Batch:
    """Outputs of one line on several meshes one behind the other, with their ends as the only nodes."""
    own: dict[str, list[Any]] = {name: [getattr(x, name) for x in batches] for name in Batch._fields}
    own |= {name: [x[:, [0, -1]] if x.size else x for x in own[name]] for name in OF_NODES}
    own |= {name: [x[:, :1] if x.size else x for x in own[name]] for name in OF_CELLS}
    return Batch(**{name: np.concatenate(x) for name, x in own.items()})


def by_itself(run: OfRun, number: int) -> bool:
    """Whether nothing but its own steps knows of the cells of a line, in a run whose solver is attached."""
    line = run.lines[number]
    watch = line.watched_by
    watched = watch is not None and watch.is_needed
    alone = number in run.solver.lone and not run.solver.mixes and not watched
    return alone and line.contact is None
