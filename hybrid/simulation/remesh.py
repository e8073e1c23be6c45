"""Other cells for a line of a run.

Changes need no help of Python's: they go to arrays with room for the most cells that there can be.

Two sets of arrays, the sides, take turns: a change goes from one to the other (kernels.mesh.remesh), and the tables
of the run get the numbers of the other one.  What Python has of the line is made anew when the run comes back
(`sync`). A planner derives from `Remesh`: cells that follow with kinds of cells (simulation.cell_changes), and nodes
at a winch (simulation.payout_nodes).

Where more than steps and watches knows of the cells (lines that touch, torque through zones, winches with zones or
beside obstacles that move) a change is made once, by the same parts (`carry_out`), from what the run has to arrays of
their own, and another solver follows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, cast

import numpy as np

from hybrid.kernels.contact.self_distance import Itself, blank_itself, blank_itself_job, boxes_of
from hybrid.kernels.machine.binding import Packed, Room, Table, address
from hybrid.kernels.mesh import remesh as f
from hybrid.kernels.mesh.cell_changes import after_forces, before_forces
from hybrid.kernels.run.network import begin_line
from hybrid.kernels.run.newton import NO_PUSH
from hybrid.kernels.state import books as b
from hybrid.kernels.state.books import Books
from hybrid.kernels.state.state import (
    NO_TURN,
    Batch,
    Floats,
    Line,
    Sea,
    State,
    Work,
    blank_state,
    memory_of,
    no_sea,
)
from hybrid.kernels.step.line_step import ASSEMBLY, Task, blank_job
from hybrid.model.build import Model
from hybrid.model.line import OF_WHOLE_LINE, lines_like, of_whole_line
from hybrid.model.network import NetworkModel
from hybrid.outputs.observation import Output
from hybrid.simulation.lines_contact import LinesWatch
from hybrid.simulation.result_file import Envelope
from hybrid.solve.contact import SelfContact
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.network_steps import NetworkSteps
from hybrid.solve.stepper import HEAVY, NetworkState

if TYPE_CHECKING:
    from hybrid.simulation.payout import PayingOut

# What outputs have of nodes and of cells.
OF_NODES, OF_CELLS = ("r", "v", "vd", "kb", "soil"), ("e", "T", "a1", "w", "h")


class OfLine(Protocol):
    """What changes of cells have to know of the result of a line (simulation.run_line)."""

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

    def use_cells_of(self, line: Line) -> None: ...


class OfRun(Protocol):
    """And of the run of all lines (simulation.run)."""

    solver: NetworkSolver
    loop: NetworkSteps
    model: NetworkModel

    @property
    def t(self) -> float: ...
    @property
    def state(self) -> NetworkState: ...
    @property
    def lines(self) -> Sequence[OfLine]: ...
    @property
    def asks_quantities(self) -> bool: ...
    def adopt_cells(self, number: int, model: Model, work: Work) -> None: ...


def ends_alone(batches: Sequence[Batch]) -> Batch:
    """Outputs of one line on several meshes one behind the other, with their ends as the only nodes."""
    own: dict[str, list[Any]] = {name: [getattr(x, name) for x in batches] for name in Batch._fields}
    own |= {name: [x[:, [0, -1]] if x.size else x for x in own[name]] for name in OF_NODES}
    own |= {name: [x[:, :1] if x.size else x for x in own[name]] for name in OF_CELLS}
    return Batch(**{name: np.concatenate(x) for name, x in own.items()})


def steps_alone(run: OfRun, number: int) -> bool:
    """Whether nothing but steps and its watches know of the cells of a line, in a run whose solver is attached."""
    solver = run.solver
    return run.lines[number].contact is None and not (solver.mixes or solver.touches(number))


def watch_beside(line: OfLine) -> LinesWatch | None:
    """What looks how near a line comes to others; None: nothing does."""
    return line.watched_by if line.watched_by is not None and line.watched_by.is_needed else None


# Of the tables of a run, what depends on the cells.
IN_RUN = ("line", "sea", "old", "new", "was", "now", "work", "books")
IN_ITSELF = ("line", "old", "new", "itself")
OF_SEA = ("flow", "axis", "slip", "slid", "bed", "grip", "rolling")  # what it has of nodes
REST_OF_SEA = tuple(name for name in Sea._fields if name not in OF_SEA)


# Of `Books`, what does not depend on the cells, or is samples.
OF_BOOKS = ("tension", "borne", "strains", "start", "marks", "right", "extremes")
REST_OF_BOOKS = tuple(name for name in Books._fields if name not in OF_BOOKS)


class Pushes(NamedTuple):
    """A push out of the plane, and room for the next."""

    push: Floats
    next_push: Floats


def blank_kept(n: int, extra: int) -> Books:
    """Books of n cells whose extremes are kept, with those of so many marked nodes."""
    strains, extremes = np.zeros((n + 1, b.STRAINS)), np.zeros((4, b.EXTREMES, n + 1 + extra))
    return b.blank_books(n)._replace(strains=strains, extremes=extremes)


of_pushes = Packed(lambda n: Pushes(np.zeros((n + 1, 4)), np.zeros((n + 1, 4))))


@cache
def seas_with(grip: int, rolling: int) -> Packed:
    """What makes the surroundings of lines of any number of cells; columns of `Sea.grip`, and rows of `Sea.rolling`."""

    def one(n: int) -> Sea:
        sea = no_sea(n)
        return sea._replace(grip=np.zeros((n + 1, grip)), rolling=np.zeros((rolling, n + 1, 5))) if grip else sea

    return Packed(one, given=REST_OF_SEA)


@cache
def states_with(*memory: Any) -> Packed:
    """What makes states of lines of any number of cells; memory: as of `memory_of`."""
    return Packed(lambda n: blank_state(n, 0, *memory), given=("turn",))


@cache
def kept_of(extra: int) -> Packed:
    """What makes books of which so many marked nodes keep extremes."""
    return Packed(partial(blank_kept, extra=extra), given=REST_OF_BOOKS)


class Part(NamedTuple):
    """A part of a change: its kernel, and which of the tables it takes."""

    kernel: Any
    table: int


class Bound(NamedTuple):
    """A table of a change: its blank, and what it is bound to."""

    blank: Callable[[], Any]
    values: Callable[..., dict[str, Any]]  # of the old side, the parity, old and new cells
    by_parity: bool = True  # else the parity of the state is not asked for


class Shaped:
    """A table whose numbers follow from the number of cells of the old and of the new line."""

    def __init__(self, table: Table, values: Callable[[int, int], dict[str, Any]], like: Shaped | None = None) -> None:
        """values: what is bound for so many old and new cells; like: a table of arrays of the same shapes."""
        self.table, self._values = table, values
        self._by_old: np.ndarray
        self._by_new: np.ndarray
        one = self._of(2, 2)
        if like is not None:
            self._by_old, self._by_new = like._by_old, like._by_new
        else:
            self._by_old, self._by_new = self._of(3, 2) - one, self._of(2, 3) - one
        assert max(abs(self._by_old).max(), abs(self._by_new).max()) < 1000  # of shapes; addresses stay
        self._fixed = one - 2 * (self._by_old + self._by_new)

    def _of(self, old: int, new: int) -> np.ndarray:
        self.table.bind(**self._values(old, new))
        return self.table.numbers.copy()

    @property
    def numbers(self) -> np.ndarray:
        """(3, size) fixed, for each old and each new cell."""
        return np.array([self._fixed, self._by_old, self._by_new])

    def of(self, old: int, new: int) -> np.ndarray:
        """(size,) for so many old and new cells."""
        return np.asarray(self._fixed + old * self._by_old + new * self._by_new)

    def places(self, names: Sequence[str]) -> np.ndarray:
        """Where the numbers of some values are."""
        parts = [self.table.part(name) for name in names]
        return np.concatenate([np.arange(at.start, at.stop) for at in parts])


class HasView(Protocol):
    """Makes arrays for a number of cells, as `Room`."""

    def view(self, cells: int, **given: Any) -> Any: ...


class Given:
    """The side before a change that is made once: what the run has."""

    def __init__(self, value: Any) -> None:
        self._value = value

    def view(self, cells: int, **_: Any) -> Any:
        """What it is, of so many cells."""
        return self._value


class Made:
    """The side after it: arrays of their own for each number of cells."""

    def __init__(self, packed: Packed) -> None:
        self._packed, self._made = packed, dict[int, Any]()

    def view(self, cells: int, **given: Any) -> Any:
        """Those for so many cells, the same whenever they are asked for."""
        if cells not in self._made:
            self._made[cells] = self._packed(cells, **given)
        return self._made[cells]


def shaped(blank: Callable[[], Any], values: Callable[..., dict[str, Any]], *of: tuple[int, ...]) -> list[Shaped]:
    """Tables of arrays of the same shapes, that differ by their addresses; of: what `values` gets before the cells."""
    found: list[Shaped] = []
    for which in of:
        found.append(Shaped(Table(blank), partial(values, *which), *found[:1]))
    return found


BOTH, PAIRS = ((0,), (1,)), ((0, 0), (0, 1), (1, 0), (1, 1))  # sides; old sides and parities


def tables_of(bound: Bound) -> list[Shaped]:
    """Tables of a change from each of PAIRS."""
    if bound.by_parity:
        return shaped(bound.blank, bound.values, *PAIRS)
    of_side = shaped(bound.blank, bound.values, *BOTH)
    return [of_side[k] for k, _ in PAIRS]


class Remesh:
    """Changes of the cells of a line of a run, from one side of arrays to the other, with the solver of now."""

    beside: tuple[str, ...] = ()  # of the table of what moves beside the run, what depends on the cells
    most_waiting = 0  # lines whose outputs may wait
    per_node = 0  # numbers of a node that are kept for them, at most
    in_steps = True  # whether steps change cells without Python

    def __init__(self, run: OfRun, number: int, marked: int, twice: bool = False, once: bool = False) -> None:
        """Room for the most cells; `adopt` before the first change.

        marked: nodes beside which extremes are kept on both sides; twice: as of `workspace`; once: for `carry_out`.
        """
        self._run, self._number, self._line, self._solver = run, number, run.lines[number], run.solver
        self._once, self.most = once, run.model.models[number].most_cells
        self._fixed_to, most = self._key(), self.most
        line, sea, state = self.model.line, self.model.sea.values, run.state.lines[number]
        self._torsion: Floats = line.torsion  # of the line after a change that is made once
        self._lines = self._sides(lines_like(line), line)
        of_states = states_with(*memory_of(line))
        pairs = [self._sides(of_states, state) for _ in range(2)]
        self._states = [(even, odd) for even, odd in zip(*pairs, strict=True)]
        self._pushes, self._kept = self._sides(of_pushes, None), self._sides(kept_of(marked), self._line.books)
        self._sea = self._sides(seas_with(sea.grip.shape[1], len(sea.rolling)), sea, one=True)
        self._work = self._sides(Packed(run.solver.room_beside(number, twice), given=("torsion",)), None, one=True)
        self._base = self._line.books.base.copy()
        self._watch_table = None if once else self._line.watch_table  # None: nobody watches how near it comes to itself
        self._watch = None if once else watch_beside(self._line)
        width = np.zeros(most) if self._watch is None else self._watch.width_of(number)
        self._itself: Itself = blank_itself(width)._replace(width=width)
        self._calls, self._at, self._numbers = f.RemeshCalls(), f.RemeshPlaces(), np.zeros(f.NUMBERS)
        self._waiting = np.zeros((self.most_waiting, 3), np.int64)
        self._table = Table(f.blank_remesh_job)
        self._synced, self._bound = -1, False

    def _sides(self, packed: Packed, before: Any, one: bool = False) -> tuple[HasView, HasView]:
        """Arrays before a change and after it; before: what the run has; one: in memory that they share."""
        if self._once:
            return Given(before), Made(packed)
        room = Room(packed, self.most)
        return room, room if one else Room(packed, self.most)

    # --- what a planner says ------------------------------------------------------------------------

    def _key(self) -> tuple[Any, ...]:
        """What the tables hold as it is."""
        raise NotImplementedError

    def _beside_table(self) -> tuple[Table, Callable[[], Any]]:
        """The table of what moves beside the run, and what makes one."""
        raise NotImplementedError

    def _in_beside(self, k: int, _: int, m: int) -> dict[str, Any]:
        """What depends on the cells there, with m of them in the arrays of side k."""
        raise NotImplementedError

    def _parts(self) -> tuple[list[Bound], list[Part], int]:
        """Tables of a change, its parts, and how many come before others hear of it."""
        raise NotImplementedError

    def _planner(self) -> tuple[tuple[Any, Any, Any], list[Table], int]:
        """Kernels that say whether a change is due, plan it and keep outputs; their tables by side, and room."""
        raise NotImplementedError

    def _copy_beside(self, n: int) -> None:
        """What moves beside a line of n cells goes on in the arrays of the first side."""
        raise NotImplementedError

    def _model_of(self, line: Line, sea: Sea) -> Model:
        """The model of the line as it is now, on these arrays; what moves beside knows of it."""
        raise NotImplementedError

    def _outputs_of(self, batch: Batch, cells: int, begin: int) -> tuple[list[Output], int]:
        """Outputs of a line of before, of so many cells, what is kept of which begins there; and where that ends."""
        raise NotImplementedError

    def _outputs_now(self, batch: Batch) -> list[Output]:
        """Outputs of the line as it is."""
        raise NotImplementedError

    # --- state --------------------------------------------------------------------------------------

    @property
    def model(self) -> Model:
        """The line as it is."""
        return self._run.model.models[self._number]

    @property
    def pushes(self) -> tuple[Floats, Floats]:
        """Out of its plane, of states of even and of odd parity; empty: none."""
        return (NO_PUSH, NO_PUSH) if self._line.plane is None or self._once else self._line.plane.pushes

    @property
    def side(self) -> int:
        """Which of the two sets of arrays is in use."""
        return int(self._at.side)

    @property
    def cells(self) -> int:
        """Cells of the line now."""
        return int(self._at.cells)

    @property
    def waits(self) -> bool:
        """Whether there are outputs of lines of before."""
        return bool(self._at.waiting)

    @property
    def fits(self) -> bool:
        """Whether the line is solved by what the arrays were made for."""
        same = self._solver is self._run.solver and self._line.watch_table is self._watch_table
        return bool(same and self._watch is watch_beside(self._line) and self._fixed_to == self._key())

    @property
    def job(self) -> np.ndarray:
        """The table of kernels.mesh.remesh that the compiled steps get."""
        self._at.may_wait = not self._run.asks_quantities and self._line.outputs_join
        return self._table.numbers

    # --- arrays -------------------------------------------------------------------------------------

    def line(self, k: int, cells: int) -> Line:
        """The line of side k."""
        line: Line = self._lines[k].view(cells, **self._shared(k))
        return line

    def state(self, k: int, which: int, cells: int) -> State:
        """The state of side k of even (which = 0) or odd parity (1)."""
        state: State = self._states[k][which].view(cells, turn=self._turns(k))
        return state

    def _shared(self, k: int) -> dict[str, Any]:
        """What the line of side k has as a whole, by name."""
        return of_whole_line(self.model.line) | ({"torsion": self._torsion} if self._once and k else {})

    def _turns(self, _: int) -> Floats:
        """Of its zones that a torque passes through."""
        return np.zeros((len(self._torsion), 3)) if self._once else NO_TURN

    def _push(self, k: int, which: int, cells: int) -> Floats:
        """Of a run that carries one, else none."""
        if not self.pushes[0].size:
            return NO_PUSH
        push: Floats = self._pushes[k].view(cells)[which]
        return push

    def _sea_on(self, k: int, cells: int) -> Sea:
        values = self.model.sea.values
        sea: Sea = self._sea[k].view(cells, **{x: getattr(values, x) for x in REST_OF_SEA})
        return sea

    def _work_on(self, k: int, cells: int) -> Work:
        work: Work = self._work[k].view(cells, torsion=self._solver.work[self._number].torsion)
        return work

    def _books(self, k: int, cells: int) -> Books:
        given = {name: getattr(self._line.books, name) for name in REST_OF_BOOKS} | {"base": self._base}
        books: Books = self._kept[k].view(cells, **given)
        return books

    def _width(self, cells: int) -> Floats:
        """Diameters of cells; none where nobody watches whether the line meets itself or others."""
        watched = self._watch_table is not None or self._watch is not None
        return self._itself.width[: cells if watched else 0]

    # --- tables -------------------------------------------------------------------------------------

    def _states_on(self, k: int, m: int) -> dict[str, Any]:
        states: dict[str, Any] = {"old": self.state(k, 0, m), "new": self.state(k, 1, m)}
        return states | {"line": self.line(k, m), "sea": self._sea_on(k, m)}

    def _in_run(self, k: int, _: int, m: int) -> dict[str, Any]:
        pushes = {"was": self._push(k, 0, m), "now": self._push(k, 1, m)}
        return self._states_on(k, m) | pushes | {"work": self._work_on(k, m), "books": self._books(k, m)}

    def _in_odd(self, k: int, _: int, m: int) -> dict[str, Any]:
        found = self._in_run(k, _, m)
        return found | {"old": found["new"], "new": found["old"]}

    def _in_itself(self, k: int, _: int, m: int) -> dict[str, Any]:
        itself = self._itself._replace(width=self._itself.width[:m])
        return {"line": self.line(k, m), "old": self.state(k, 0, m), "new": self.state(k, 1, m), "itself": itself}

    def _bind_all(self) -> None:
        """Tables of changes from either side to the other, and of runs on either."""
        run, at, books, (beside, blank) = self._run, self._at, self._line.books, self._beside_table()
        self._alone, self._pairs = run.solver.tables_beside(self._number)
        of_run, of_odd = (shaped(blank_job, x, *BOTH) for x in (self._in_run, self._in_odd))
        of_beside = shaped(blank, self._in_beside, *BOTH)
        bound, parts, at.begun = self._parts()
        self._change = change = [tables_of(x) for x in bound]
        (due, plan, keep), planners, at.room = self._planner()
        in_run, in_beside = of_run[0].places(IN_RUN), of_beside[0].places(self.beside)
        numbers = dict[str, Any]() if self._watch is None else self._watch.distances
        if len(self._pairs) > 1:
            numbers |= dict(zip(("even_joined", "odd_joined"), (x.numbers for x in self._pairs[1]), strict=True))
        of_itself: list[Shaped] = []
        if self._watch_table is not None:
            of_itself = shaped(blank_itself_job, self._in_itself, *BOTH)
            places = of_itself[0].places(IN_ITSELF)
            numbers["itself"], numbers["itself_places"] = self._watch_table.numbers, places
            numbers["in_itself"] = np.array([x.numbers[:, places] for x in of_itself])
            tree = address(self._itself.tree)
            at.boxes_at = 1 + int(np.flatnonzero(of_itself[0].numbers[0] == tree)[0])
        ends = np.cumsum([0, *(len(x[0].table.numbers) for x in change)])
        calls = [(p.kernel.address(change[p.table][0].table.numbers), *ends[p.table : p.table + 2]) for p in parts]
        self._tables = of_run, of_odd, of_beside, of_itself, change, planners  # what is bound there stays alive
        for name, of in (("in_run", of_run), ("in_odd", of_odd)):
            numbers[name] = np.array([x.numbers[:, in_run] for x in of])
        numbers["in_beside"] = np.array([x.numbers[:, in_beside] for x in of_beside])
        changed = np.array([np.concatenate([x[pair].numbers for x in change], axis=1) for pair in range(len(PAIRS))])
        self._table.bind(parts=np.array(calls, np.int64), change=np.zeros(ends[-1], np.int64), changed=changed)
        self._table.bind(calls=self._calls, at=at, clock=run.loop.clock, own=books.clock, counts=run.loop.counts)
        self._table.bind(work=books.work, numbers=self._numbers, planners=np.array([x.numbers for x in planners]))
        self._table.bind(even=self._pairs[0][0].numbers, odd=self._pairs[0][1].numbers, waiting=self._waiting)
        self._table.bind(run=self._alone.numbers, run_places=in_run, beside=beside.numbers, beside_places=in_beside)
        self._table.bind(**numbers)
        forces, where = Table(blank_job), self._alone.part("task")
        limits = run.solver.limits_by_itself(self._number)
        forces.bind(task=Task(ASSEMBLY, ca=HEAVY, limits=limits))
        self._table.bind(task=forces.numbers[where].copy())
        at.task, at.per_node, at.number = where.start, self.per_node, self._number
        for name, kernel in (("due", due), ("plan", plan), ("keep", keep)):
            setattr(self._calls, name, kernel.address(planners[0].numbers))
        for name, kernel in (("before_forces", before_forces), ("after_forces", after_forces), ("books", begin_line)):
            setattr(self._calls, name, kernel.address(self._alone.numbers))

    # --- once ---------------------------------------------------------------------------------------

    def carry_out(self, between: Callable[[], None] | None = None) -> None:
        """A change from what the run has to arrays of their own, before another solver makes the steps.

        between: what is to be done when others are to hear of it.
        """
        (_, plan, _), planners, _ = self._planner()
        bound, parts, begun = self._parts()
        at, n = self._at, self.model.cells
        at.cells = n
        at.next_cells = plan(planners[0].numbers)
        tables = [Table(x.blank) for x in bound]
        for table, x in zip(tables, bound, strict=True):
            table.bind(**x.values(*(0, 0)[: 1 + x.by_parity], n, int(at.next_cells)))
        for k, part in enumerate(parts):
            if k == begun and between is not None:
                between()
            part.kernel(tables[part.table].numbers)
        at.side, at.cells = 1, at.next_cells

    # --- steps --------------------------------------------------------------------------------------

    def adopt(self) -> None:
        """Go on with the line of the run as it is now, in these arrays."""
        model, n, work = self.model, self.model.cells, self._solver.work[self._number]
        if not self._bound:
            self._bind_all()
            self._bound = True
        self._at.side, self._at.cells = 0, n
        counts, books, pushes = self._run.loop.counts, self._line.books, self.pushes
        parity = int(counts.parity)
        for which, turn in enumerate(self._run.loop.turns):
            copy_fields(turn.lines[self._number], self.state(0, which, n), ("turn",))
            if pushes[which].size:
                self._push(0, which, n)[:] = pushes[which]
        copy_fields(model.line, self.line(0, n), OF_WHOLE_LINE)
        copy_fields(model.sea.values, self._sea_on(0, n), REST_OF_SEA)
        copy_fields(work, self._work_on(0, n), ("W", "X", "x", "torsion", "gaps", "rows"))
        self._base[:] = books.base
        if self._watch_table is not None:
            itself = self._line.envelope.itself.itself
            copy_fields(itself, self._itself._replace(width=self._width(n)), ("tree", "stack"))
        copy_fields(books, self._books(0, n), REST_OF_BOOKS)
        self._copy_beside(n)
        self._calls.solver = self._solver.marcher_of(self._number)
        f.put_cells(self._table.numbers)
        self._synced = -1
        counts.parity = parity
        self.sync()

    def sync(self) -> None:
        """What Python has of the line is that of now."""
        if self._at.changes == self._synced:
            return
        self._synced = int(self._at.changes)
        k, n = self.side, self.cells
        line, sea, work, books = self.line(k, n), self._sea_on(k, n), self._work_on(k, n), self._books(k, n)
        now = sea.now.copy()
        model = self._model_of(line, sea)
        sea.now[:] = now
        old, new = states = self.state(k, 0, n), self.state(k, 1, n)
        self._line.books = books
        for turn, state in zip(self._run.loop.turns, states, strict=True):
            cast(list[State], turn.lines)[self._number] = state
        was, now_ = pushes = self._push(k, 0, n), self._push(k, 1, n)
        if self._line.plane is not None:
            self._line.plane.pushes = pushes
        of_even = [self._alone, *(even for even, _ in self._pairs)]
        for tables, (before, after) in ((of_even, states), ([odd for _, odd in self._pairs], (new, old))):
            for table in tables:
                table.hold(line=line, sea=sea, old=before, new=after, was=was, now=now_, work=work, books=books)
        self._beside_table()[0].hold(**self._in_beside(k, n, n))
        if self._watch_table is not None:
            itself = self._itself._replace(width=self._width(n), tree=self._itself.tree[: boxes_of(n)])
            self._line.envelope.itself.itself = itself
            self._watch_table.hold(line=line, old=old, new=new, itself=itself)
        self._run.adopt_cells(self._number, model, work)

    # --- outputs that wait --------------------------------------------------------------------------

    def outputs(self, rows: Floats) -> tuple[list[Output], Batch]:
        """All outputs that wait, in rows, copied, each with its line; and what they have at the ends."""
        begin, found, batches = 0, list[Output](), list[Batch]()
        for first, count, cells in self._waiting[: self._at.waiting].tolist():
            batches.append(self._line.batch_of(rows[first : first + count], cells))
            outputs, begin = self._outputs_of(batches[-1], cells, begin)
            found += outputs
        if len(rows) > self._at.used:
            batches.append(self._line.batch_of(rows[self._at.used :], self.model.cells))
            found += self._outputs_now(batches[-1])
        self._at.waiting = self._at.placed = self._at.used = 0
        return found, ends_alone(batches)


def copy_fields(old: Any, new: Any, but: tuple[str, ...] = ()) -> None:
    """Copy the arrays of a named tuple into those of another one, but for these."""
    for name in old._fields:
        if name not in but:
            getattr(new, name)[:] = getattr(old, name)
