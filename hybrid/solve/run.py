"""A run in compiled steps: the books of a line, the table of the kernel, and a call that goes on with it.

The loop over time is compiled (kernels.run.run).  Here are its arrays, and what they are called outside.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from hybrid.errors import Outcome
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.march.zone_torque import answers_of
from hybrid.kernels.mesh.zone_step import follow_zones
from hybrid.kernels.run.entry import NO_PUSH, check_turns
from hybrid.kernels.run.run import in_plane, in_space, run
from hybrid.kernels.state import books as b
from hybrid.kernels.state.books import STRAINS, blank_books, sample_size
from hybrid.kernels.state.forces import PLANAR, SELF_CONTACT
from hybrid.kernels.state.obstacle_rows import EACH, SEEN
from hybrid.kernels.state.report import REPORT_SIZE
from hybrid.kernels.state.state import (
    NO_LAYERS_SEEN,
    NO_SOIL,
    NO_SOIL_SEEN,
    NOT_VARYING,
    Batch,
    Ends,
    Floats,
    Line,
    Moves,
    Sea,
    State,
    Work,
    no_torsion,
    sampled_size,
)
from hybrid.kernels.step.job import blank_job
from hybrid.kernels.step.newton import RUN, Task
from hybrid.kernels.watch.named_quantities import note_quantities
from hybrid.solve.bending_corrector import Corrector
from hybrid.solve.self_contact import SelfContact
from hybrid.solve.stepper import Stepper

# Steps and samples that a call may take before Python writes them down.
ROWS = 512
# Cells times steps of a call: about 0.1 s, after which interrupts are heard and progress is reported.
CELL_STEPS = 200_000
# Waves that cost a cell in a step what all else does.
WAVES_OF_A_CELL = 10
# Numbers that the buffer of samples may hold, 16 MB.
MOST_SAMPLED = 2_000_000
# Of steps that have become short: kernels.state.books.Counts.
LENGTHS = "tiny_steps", "cut_by_gain", "cut_by_turn", "cut_by_newton", "cut_by_error", "cut_at"


class Tried(NamedTuple):
    """How a try ended: outcome, Newton iterations, predicted next correction (relative), and the cell or node where it
    was worst."""

    outcome: Outcome
    iterations: int
    correction: float
    where: int


class CompiledRun:
    """Steps of one line, many in a call.  Its state is states[parity]; the other one is that before the last step."""

    def __init__(self, rho: float, outputs: Floats, extremes: bool, varies: bool = False) -> None:
        """rho: spectral radius of the scheme; outputs: s, times of samples; extremes: whether they are kept; varies:

        whether lengths and stiffness change, and samples have them.
        """
        self.table, self._rows = Table(blank_job), ROWS
        self.books = blank_books()._replace(outputs=outputs, log=np.zeros((ROWS, len(b.LOG))))
        self.clock, self.count = self.books.clock, self.books.counts
        self.keeps_extremes, self._room = extremes, np.zeros(0)
        self.clock.rho, self.clock.allowed = rho, np.inf
        self.clock.least_peak = self.clock.release_start = self.clock.release_end = np.inf
        self.count.varies = varies
        self.states: tuple[State, State]
        self.quota, self._waves = 0, 0  # steps of a call; waves of the sea
        self._zones_address = 0  # of what follows zones; 0: not known yet
        self._solver, self._address = in_space, 0
        self.pushes: tuple[Floats, Floats] = (NO_PUSH, NO_PUSH)
        self._torsion = no_torsion()
        self.contact: SelfContact | None = None  # of a line that touches itself
        self.sampled_errors: Floats = np.zeros((0, 0))  # of the model error, at the outputs that `samples` gave last

    # --- what is computed ---------------------------------------------------------------------------

    def attach(
        self, stepper: Stepper, sea: Sea, ends: Ends, moves: Moves, state: State, borne: Floats, first: np.ndarray,
        marks: np.ndarray, corrector: Corrector | None = None,
    ) -> None:  # fmt: skip
        """Go on from `state` with the line of a stepper: at the start, after a change of zones, in space after a plane.

        borne: (N,) length over unstretched length that cells bear; first: nodes of the base mesh; marks: (N+1,) of
        kernels.state.books, what nodes have; corrector: of the model error, if it is followed.  Extremes are kept anew;
        displacements count from `books.start`, which the caller fills.
        """
        line, work = stepper.line, stepper.work
        check_turns(line, state)
        cells = line.h.size
        followed = corrector.sampled if corrector is not None else np.zeros((2, 0))
        touches = bool(line.bits & SELF_CONTACT)
        more = len(line.torsion), touches, line.moved.size, sampled_size(line)
        size = sample_size(cells, bool(self.count.varies), *more)
        size += followed.shape[1]
        if not self._room.size:
            self._room = np.empty(max(1, min(self._rows, MOST_SAMPLED // size)) * size)  # some MB, touched as needed
        rows = max(1, min(self._rows, self._room.size // size))
        nodes, some = cells + 1, self.keeps_extremes
        marked = np.flatnonzero(marks)
        right = np.arange(nodes)
        right[marked] = nodes + np.arange(marked.size)
        books = self.books._replace(
            borne=borne, base=first.astype(np.int64), strains=np.zeros((nodes if some else 0, STRAINS)), marks=marks,
            right=right, start=np.zeros((nodes, 3)), model_error=followed,
            extremes=no_extremes(nodes + marked.size) if some else np.zeros((4, 0, nodes)),
            touch=np.zeros((3, nodes if touches else 0)),
        )  # fmt: skip
        if books.samples.shape != (rows, size):  # in the same room, which a new one of some MB would cost a ms
            if self._room.size < rows * size:
                self._room = np.empty(rows * size)
            books = books._replace(samples=self._room[: rows * size].reshape(rows, size))
        if books.tension.shape[1] != cells:
            books = books._replace(tension=np.zeros((2, cells)))
        self.books = books
        self.states = (state, state.copy())
        self._torsion = work.torsion
        if self.count.parity:
            self.pushes, self.count.parity = self.pushes[::-1], 0
        self.clock.previous = self.clock.now
        solver = in_plane if line.bits & PLANAR else in_space
        self._solver, self._address = solver, self._address if solver is self._solver else 0
        fresh, self._waves = not self.quota, len(sea.waves)
        self.set_quota(cells)
        if fresh:  # zones that change every few steps would otherwise never let it be used up
            self.count.quota = self.quota
        old, new = self.states
        was, now = self.pushes
        self.table.bind(
            task=Task(RUN, limits=stepper.limits), line=line, sea=sea, ends=ends, moves=moves, old=old, new=new,
            was=was, now=now, work=work, books=books, follower=0,
        )  # fmt: skip
        if corrector is not None:
            following = corrector.bind(line, sea, ends, self.states, self.clock, self.count, work)
            self.table.bind(following=following, follower=corrector.address())

    def set_quota(self, cells: int) -> None:
        """Steps of the calls to come, of a line of so many cells."""
        self.quota = max(1, min(ROWS, int(CELL_STEPS / (cells * (1.0 + self._waves / WAVES_OF_A_CELL)))))

    def place(self, placed: Floats) -> None:
        """Where base nodes were at the start (n, 3) m."""
        self.books = self.books._replace(placed=placed)
        self.table.bind(books=self.books)

    def carry(self, pushes: tuple[Floats, Floats]) -> None:
        """Carry a push out of the plane along, (N+1, 4) now, and room for the next; empty: none."""
        self.pushes = pushes[::-1] if self.count.parity else pushes
        self.table.bind(was=self.pushes[0], now=self.pushes[1])
        self.clock.push_start = 0.0

    def follow(self, zones: Table, compiled: bool) -> None:
        """Zones move from now on (kernels.mesh.zone_step); compiled: every step asks them, not Python."""
        if compiled and not self._zones_address:
            self._zones_address = follow_zones.address(zones.numbers)
        self.table.bind(zones=self._zones_address if compiled else 0, zone_table=zones.numbers)

    def watch_itself(self, table: np.ndarray, address: int) -> None:
        """From now on steps look how near the line comes to itself (kernels.contact.self_distance)."""
        self.table.bind(itself=address, itself_table=table)

    def touch_itself(self, contact: SelfContact, line: Line, sea: Sea, ends: Ends, work: Work) -> None:
        """The line touches itself from now on (kernels.contact.self_contact)."""
        table = contact.attach(line, ends, self.states, work, self.books, sea)
        self.table.bind(contact=contact.call, contact_table=table)
        self.contact = contact

    def move(self, moves: Moves) -> None:
        """From now on the ends move otherwise, or other loads act."""
        self.table.bind(moves=moves)

    def note_state(self) -> None:
        """Keep the extremes of the state as it is, of which `books.report` is the report.

        No step is taken: the kernel that solves them, whose compilation takes longest, is not asked for.
        """
        self.clock.stop = self.clock.now
        self.count.phase, self.count.after_start, self.count.new_state = b.START, b.BEGIN_STEP, 1
        run(self.table.numbers)

    def solver_address(self) -> int:
        """Of the kernel that solves its steps, which is compiled now, where it is needed, if it has not been."""
        if not self._address:
            self._address = self._solver.address(self.table.numbers)
            self.table.bind(solver=self._address)
        return self._address

    def go(self, by: Callable[[], int] | None = None) -> int:
        """Go on until a code of kernels.state.books; by: what is called instead of the kernel of steps alone."""
        self.solver_address()
        code: int = run(self.table.numbers) if by is None else by()
        if code in (b.PAUSED, b.AT_STOP):
            self.count.quota = self.quota
        return code

    def keep_ranges(self, books: b.Books) -> None:
        """From now on steps keep the ranges of the quantities that are asked for in these books, of the same arrays."""
        self.books = books
        self.table.bind(books=books, quantities=note_quantities.address(self.table.numbers))

    # --- what it knows ------------------------------------------------------------------------------

    @property
    def t(self) -> float:
        """Time of the state, s."""
        return float(self.clock.now)

    @property
    def state(self) -> State:
        return self.states[self.count.parity]

    @property
    def before(self) -> State:
        """The state before the last step; while a try is judged, the one that it led to."""
        return self.states[1 - self.count.parity]

    @property
    def answers(self) -> dict[str, Floats]:
        """How the line answers to torques through its zones, which serves for several steps (march.zone_torque)."""
        return answers_of(self._torsion)

    @property
    def solver(self) -> Any:
        """The kernel of the line's kind, for a task at the table."""
        return self._solver

    @property
    def push(self) -> Floats:
        """The push out of the plane (N+1, 4) now."""
        return self.pushes[self.count.parity]

    @property
    def report(self) -> Floats:
        """(REPORT_SIZE,) of the state (kernels.state.report)."""
        return np.asarray(self.books.report[0])

    @property
    def tried(self) -> Tried:
        """How the last try ended."""
        outcome, iterations, where = int(self.count.outcome), int(self.count.tries), int(self.count.where)
        return Tried(Outcome(outcome), iterations, float(self.clock.correction), where)

    def log(self) -> Floats:
        """Rows (n, len(LOG)) of steps since the last call of this; they are overwritten by the next steps."""
        rows = int(self.count.rows)
        self.count.rows = 0
        return self.books.log[:rows]

    def samples(self, ends: Ends) -> Batch | None:
        """The outputs since the last call of this, as views that the next steps overwrite; None: there are none.

        What they take of the model error is then in `sampled_errors` (nb, K).
        ends: of the line, of which `held` is taken.
        """
        count, cells = int(self.count.samples), self.state.T.size
        self.count.samples = 0
        if not count:
            return None
        return self.batch_of(self.books.samples[:count], cells, ends)

    def batch_of(self, rows: Floats, cells: int, ends: Ends) -> Batch:
        """Rows (n, size) of samples of a line of so many cells, as views; ends: as of `samples`."""
        touching, varies = self.books.touch.shape[1], bool(self.count.varies)
        batch, self.sampled_errors = batch_of_rows(
            rows, cells, ends.held, varies, len(self.state.turn), touching, self.state.grip.shape[1] // EACH,
            self.state.layers.shape[1], bool(self.state.soil.size),
        )  # fmt: skip
        return batch


def batch_of_rows(
    rows: Floats,
    cells: int,
    held: np.ndarray,
    varies: bool,
    zones: int,
    touching: int,
    obstacles: int = 0,
    layers: int = 0,
    soil: bool = False,
) -> tuple[Batch, Floats]:
    """Samples (n, size) of a line as views (kernels.state.books.sample_size), and the columns behind them.

    held: (2,) as `Ends` has it; varies: whether they have lengths and stiffness; zones: that a torque passes through;
    touching: N+1, or 0 where the line does not touch itself; obstacles: of which one moves; layers: numbers of a node;
    soil: whether nodes remember it.
    """
    at, count = 0, len(rows)

    def take(*shape: int) -> Floats:
        nonlocal at
        begin, at = at, at + math.prod(shape)
        return rows[:, begin:at].reshape(count, *shape)

    t, sea, position, frame = take(), take(4), take(2, 3), take(2, 9)
    spin, force, moment, report, work = take(2, 3), take(2, 3), take(2, 3), take(REPORT_SIZE), take(b.WORKS)
    r, v, vd = take(cells + 1, 3), take(cells + 1, 3), take(cells + 1, 3)
    e, T, a1, w = take(cells, 3), take(cells), take(cells, 3), take(cells)
    h, kb = (take(cells), take(cells + 1, 3)) if varies else (NOT_VARYING, NOT_VARYING)
    turn, touch, seen = take(zones, 3), take(touching), take(obstacles, SEEN)
    slipped = take(cells + 1, layers) if layers else NO_LAYERS_SEEN
    remembered = take(cells + 1, NO_SOIL.shape[1]) if soil else NO_SOIL_SEEN
    ends = np.repeat(held[None], count, axis=0)
    batch = Batch(
        t, r, v, vd, e, T, a1, w, ends, position, frame, spin, force, moment, report, work, sea, h, kb, turn, touch,
        seen, slipped, remembered,
    )  # fmt: skip
    return batch, rows[:, at:]


def no_extremes(columns: int) -> Floats:
    """Extremes (4, EXTREMES, columns) of nothing: lowest infinite, highest minus infinite, times unknown."""
    out = np.full((4, b.EXTREMES, columns), np.nan)
    out[0], out[1] = np.inf, -np.inf
    return out
