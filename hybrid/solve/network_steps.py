"""Steps of several lines, many in a call: what kernels.run.network_run works with.

Outside is known how long calls are, how a try ended, and samples of a line as views.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid.errors import Outcome
from hybrid.kernels.junctions.bodies import WORK, update_members
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.mesh.remesh import ask_cells, change_cells
from hybrid.kernels.mesh.zone_step import advance_zones
from hybrid.kernels.run.network import BODY_SAMPLE, book_network_step
from hybrid.kernels.run.network_run import (
    LINE,
    REGROUP,
    blank_steps_job,
    renew_ended,
    renew_pulls,
    run_lines,
    run_network,
    sample_network,
)
from hybrid.kernels.state import books as b
from hybrid.kernels.state.report import REPORT_SIZE, SEEN
from hybrid.kernels.state.state import NO_LAYERS_SEEN, NO_SOIL, NO_SOIL_SEEN, NOT_VARYING, Batch, Floats, Moves
from hybrid.kernels.step.accept import SAME_TIME
from hybrid.kernels.step.step_control import FIRST, WARY
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.stepper import MOST_ITERATIONS, REACH, NetworkState, NetworkTaken

# Steps and samples that a call may take before Python writes them down.
ROWS = 512
# Cells times steps of a call: about 0.1 s, after which interrupts are heard and progress is reported.
CELL_STEPS = 200_000
# Waves that cost a cell in a step what all else does.
WAVES_OF_A_CELL = 10
# Numbers that the buffer of samples may hold, 8 MB.
MOST_SAMPLED = 1_000_000
# Of steps that have become short: kernels.state.books.Counts.
LENGTHS = "tiny_steps", "cut_by_gain", "cut_by_turn", "cut_by_newton", "cut_by_error", "cut_at"


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
) -> Batch:
    """Samples (n, size) of a line as views (kernels.state.books.sample_size).

    held: (2,) as `Ends` has it; varies: whether they have lengths and stiffness; zones: that a torque passes through;
    touching: N+1, or 0 where the line does not touch itself; obstacles: of which one moves; layers: numbers of a node;
    soil: whether nodes remember it.
    """
    at, count = 0, len(rows)

    def part(*shape: int) -> Floats:
        nonlocal at
        begin, at = at, at + math.prod(shape)
        return rows[:, begin:at].reshape(count, *shape)

    t, sea, position, frame = part(), part(4), part(2, 3), part(2, 9)
    spin, force, moment = part(2, 3), part(2, 3), part(2, 3)
    report, work = part(REPORT_SIZE), part(b.WORKS)
    r, v, vd = part(cells + 1, 3), part(cells + 1, 3), part(cells + 1, 3)
    e, T, a1, w = part(cells, 3), part(cells), part(cells, 3), part(cells)
    h, kb = (part(cells), part(cells + 1, 3)) if varies else (NOT_VARYING, NOT_VARYING)
    turn, touch, seen = part(zones, 3), part(touching), part(obstacles, SEEN)
    slipped = part(cells + 1, layers) if layers else NO_LAYERS_SEEN
    remembered = part(cells + 1, NO_SOIL.shape[1]) if soil else NO_SOIL_SEEN
    ends = np.repeat(held[None], count, axis=0)
    along, at_ends = (t, r, v, vd, e, T, a1, w), (ends, position, frame, spin, force, moment)
    return Batch(*along, *at_ends, report, work, sea, h, kb, turn, touch, seen, slipped, remembered)


def no_extremes(columns: int) -> Floats:
    """Extremes (4, EXTREMES, columns) of nothing: lowest infinite, highest minus infinite, times unknown."""
    out = np.full((4, b.EXTREMES, columns), np.nan)
    out[0], out[1] = np.inf, -np.inf
    return out


NO_PAIRS = np.zeros(0, np.int64)
# Numbers of the log of all lines, at most.
MOST_LOGGED = 2_000_000
# Steps that wait to be logged of what is stepped from outside in real time, where writing must be rare.
ROWS_OUTSIDE = 4096


class NetworkSteps:
    """Steps of all lines of a network. Lengths follow errors where a largest one is given, else they are equal."""

    def __init__(
        self,
        rho: float,
        outputs: Sequence[float] = (),
        largest: float = 0.0,
        shortest: float = 0.0,
        most_turn: float = np.inf,
    ) -> None:
        """Steps of a network up to its outputs.

        rho: spectral radius of the scheme; outputs: s, their times, which increase; largest, shortest: s, of steps that
        follow their errors; 0: none do; most_turn: rad, by which an end that is moved may turn in a step.
        """
        self.outputs = np.array(outputs, float)
        self.most_rows = ROWS  # steps that wait to be logged
        self.body_samples, self.worked = np.zeros((0, 0, BODY_SAMPLE)), np.zeros((3, 0, WORK))
        self.clock, self.counts = b.Clock(), b.Counts()
        self.lines = np.zeros(4, np.int64)  # numbers by kernels.run.network_run, -1: a body, of what was cut or tried
        self._job, self._states, self._cells = Table(blank_steps_job), (NetworkState([]), NetworkState([])), 0
        self._log, self.seen = np.zeros((0, 0, len(b.LOG))), np.zeros(0, np.int64)
        self._solver: NetworkSolver | None = None
        self._first: np.ndarray | None = None  # a job of the solver, until the kernels of its steps are known
        self._waves = 0
        self._is_new = True  # whether nobody knows which lines are near what is free in the state of now
        self._followed = np.zeros((0, 0), np.int64)  # jobs of zones
        # lines whose cells, or nodes at a winch, change after the outputs within the step, which may fill buffers
        self._due, self._nodes_due = np.zeros(0, np.int64), np.zeros(0, np.int64)
        self._changes = self._winds = False  # whether cells of some line, or nodes at a winch, change in compiled steps
        clock = self.clock
        clock.rho, clock.allowed, clock.tolerance, clock.error_ratio = rho, np.inf, 1.0, 1.0
        self.controlled = largest > 0.0
        self.counts.controlled, self.counts.phase = self.controlled, b.BEGIN_STEP
        clock.largest, clock.shortest, clock.most_turn = largest, shortest, most_turn
        clock.next_dt = max(largest / FIRST, shortest)

    # --- what steps lead from and to ----------------------------------------------------------------

    def attach(self, solver: NetworkSolver, state: NetworkState, other: NetworkState) -> bool:
        """Steps of a solver go on from `state`, with room in `other` for the next; False: they do so already."""
        counts = self.counts
        now, then = self.states
        if self._solver is solver and solver.turns is self._states and now is state and then is other:
            return False
        if counts.parity:
            solver.exchange_pushes()
        counts.parity, self._states, self._solver = 0, (state, other), solver
        lines = len(solver.lines)
        if len(self.seen) != lines:
            rows = max(16, min(self.most_rows, MOST_LOGGED // (lines * len(b.LOG))))
            self._log, self.seen = np.zeros((rows, lines, len(b.LOG))), np.zeros(lines, np.int64)
            counts.rows = 0
        jobs, self._is_new = solver.swap_states(self._states), True
        self._cells = sum(x.line.h.size for x in solver.lines)
        self._waves = max((len(x.sea.waves) for x in solver.lines), default=0)
        self.worked[0] = solver.body_work
        limits = np.array([REACH * solver.length, MOST_ITERATIONS, solver.arm, solver.tolerance])
        self._job.bind(outputs=self.outputs, bodies=self.body_samples, worked=self.worked, clock=self.clock)
        self._job.bind(counts=counts, lines=self.lines, seen=self.seen, log=self._log, limits=limits)
        self._job.bind(sampler=sample_network.address(self._job.numbers), **jobs)
        self._first = jobs["even"]
        return True

    def make_room(self, rows: int, bodies: int) -> None:
        """Room for so many samples of bodies, for lines that have changed: of the step before nothing is known."""
        if self.body_samples.shape[:2] != (rows, bodies):
            self.body_samples = np.zeros((rows, bodies, BODY_SAMPLE))
            self.worked = np.zeros((3, bodies, WORK))
            self._job.bind(bodies=self.body_samples, worked=self.worked)
        self.clock.previous = self.clock.now

    def move(self, solver: NetworkSolver, moves: Sequence[Moves]) -> None:
        """The ends of the lines move so from now on, by their kernels."""
        for k, each in enumerate(moves):
            solver.bind_line(k, moves=each)

    def load(self, loads: Floats, history: Floats) -> None:
        """Bodies are loaded so from now on: as Moves.loads and history, of rows of bodies."""
        self._job.bind(loads=loads, history=history)

    def bind_members(self, members: Mapping[int, Table]) -> None:
        """Bodies of these numbers have members, whose water is told by these tables."""
        if not members:
            self._job.bind(stirrer=0)
            return
        tables = np.array([x.numbers for x in members.values()])
        self._job.bind(
            members=tables, with_members=np.array([*members], np.int64), stirrer=update_members.address(tables[0])
        )

    def watch(self, even: np.ndarray = NO_PAIRS, odd: np.ndarray = NO_PAIRS, watcher: int = 0) -> None:
        """After steps of even and odd parity this kernel looks whether lines have met; 0: none does."""
        self._job.bind(watched_even=even, watched_odd=odd, watcher=watcher)

    def hold_zones(self, zones: Sequence[Table]) -> None:
        """Let tables of kernels.mesh.zone_step stand where steps have them, in place of those before."""
        rows = self._followed
        if len(rows) == len(zones) and all(x.numbers.base is rows for x in zones):
            return
        self._followed = np.zeros((len(zones), len(zones[0].numbers)), np.int64)
        for row, table in zip(self._followed, zones, strict=True):
            table.move(row)

    def bind_zones(self, zones: Sequence[Table]) -> None:
        """These tables of kernels.mesh.zone_step follow zones of lines from now on; none: Python does."""
        self.change_cells([])
        if not zones:
            self._job.bind(followed=np.zeros((0, 0), np.int64), follower=0)
            return
        self.hold_zones(zones)
        self._due = self._due if len(self._due) == len(zones) else np.zeros(len(zones), np.int64)
        self._job.bind(followed=self._followed, follower=advance_zones.address(self._followed[0]), due=self._due)

    def change_cells(self, lines: Sequence[NDArray[np.int64] | None]) -> None:
        """These tables of kernels.mesh.remesh change cells of lines that `follow` has, where there is one."""
        tables, may, asker, changer = self._remeshed(lines)
        self._changes = changer != 0
        self._job.bind(changed=tables, changes=may, asker=asker, changer=changer)

    def pay(self, lines: np.ndarray, payer: int) -> None:
        """These tables (W, ..) of kernels.reel.reel change the lengths of lines from now on, by pay_out at `payer`."""
        self._nodes_due = self._nodes_due if len(self._nodes_due) == len(lines) else np.zeros(len(lines), np.int64)
        self._job.bind(paid=lines, payer=payer, nodes_due=self._nodes_due)

    def change_nodes(self, lines: Sequence[NDArray[np.int64] | None]) -> None:
        """These tables of kernels.mesh.remesh let nodes of lines that `pay` has enter and leave, where there is one."""
        tables, may, asker, changer = self._remeshed(lines)
        self._winds = changer != 0
        self._job.bind(reeled=tables, reels=may, node_asker=asker, reeler=changer)

    def _remeshed(
        self, lines: Sequence[NDArray[np.int64] | None]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], int, int]:
        """Tables of lines, which of them have one, and the addresses of ask_cells and change_cells; 0: none has."""
        known = [x for x in lines if x is not None]
        may = np.array([x is not None for x in lines], np.int64)
        if not known:
            return np.zeros((len(lines), 1), np.int64), may, 0, 0
        tables = np.array([np.zeros_like(known[0]) if x is None else x for x in lines])
        self._job.bind(runner=run_network.address(self._job.numbers))
        return tables, may, ask_cells.address(known[0]), change_cells.address(known[0])

    def bind_tangents(self, job: np.ndarray, follower: int) -> None:
        """After every step this kernel takes tangents along it, with a table of kernels.run.network_tangents."""
        self._job.bind(beside=job, tangents=follower)

    @property
    def turns(self) -> tuple[NetworkState, NetworkState]:
        """The states that are those of now at even parity and at odd."""
        return self._states

    @property
    def states(self) -> tuple[NetworkState, NetworkState]:
        """The state now, and the other one, before the last step."""
        parity = self.counts.parity
        return self._states[parity], self._states[1 - parity]

    # --- steps ---------------------------------------------------------------------------------------

    def begin_leg(self, stop: float, first: float, done: int, parts: int, length: float) -> None:
        """Steps are to end at `stop` (s): in so many parts of a length (s) since `first` (s), some of them done."""
        clock, counts = self.clock, self.counts
        clock.stop, clock.leg_begin, clock.leg_step = stop, first, length
        counts.leg_part, counts.leg_parts = done, parts

    def set_quota(self, most: int) -> None:
        """As many steps as interrupts and progress can wait for; most: as far as Python knows what they cost."""
        cost = max(self._cells, 1) * (1.0 + self._waves / WAVES_OF_A_CELL)
        self.counts.quota = max(1, min(ROWS, most, int(CELL_STEPS / cost)))

    def renew_pulls(self) -> None:
        """Bodies feel lines whose cells Python has changed in place."""
        renew_pulls(self._job.numbers)

    def go(self) -> int:
        """Go on until a code of kernels.state.books."""
        assert self._solver is not None
        if self._first is not None:
            self._job.bind(solver=self._solver.joint_solver(), book=book_network_step.address(self._first))
            self._first = None
        if self._is_new and self._solver.mixes:
            self._solver.find_near(self.states[0], float(self.clock.now))
            self._job.bind(**self._solver.regroup())
        self._is_new, go = False, run_lines if self._changes or self._winds else run_network
        while (code := int(go(self._job.numbers))) == REGROUP:
            self._job.bind(**self._solver.regroup())
        return code

    @property
    def due(self) -> bool:
        """Whether an output is due at the state as it is."""
        at, near = self.counts.output, SAME_TIME * self.clock.leg_step
        return bool(at < self.outputs.size and self.outputs[at] <= self.clock.now + near)

    @property
    def is_open(self) -> bool:
        """Whether something is left to do of a shortened step that has led to a stop."""
        return self.counts.phase == b.END_STEP and self.counts.repeats > 0

    def end_step(self) -> None:
        """Do that now: nothing of it is kept."""
        renew_ended(self._job.numbers)

    @property
    def is_half_full(self) -> bool:
        """Whether half of the samples that there is room for wait, or more."""
        return bool(2 * self.counts.samples >= len(self.body_samples) - 1)

    def sample(self) -> bool:
        """Sample the outputs that are due at the state as it is; False: there is no room for all of them."""
        return bool(sample_network(self._job.numbers))

    def try_again(self) -> None:
        """The try is made once more, in the same length: what it was made with has changed."""
        self.counts.wasted += self.counts.tries
        self.counts.phase = b.TRY

    def try_whole(self) -> None:
        """The same with the whole of the step."""
        self.clock.tried_dt = self.clock.until - self.clock.now
        self.try_again()

    def restart(self) -> None:
        """Accelerations jump now: of what comes nothing is known."""
        self.clock.last_dt = 0.0
        if self.controlled:
            self.clock.next_dt = max(self.clock.next_dt / FIRST, self.clock.shortest)
            self.clock.error_ratio = 1.0

    def stand_between(self, interval: float, step: float) -> None:
        """No step is under way, and none is to be written down, no output is due.

        interval: s, that the last step took, 0: of that nothing is known; step: s, the usual one.
        """
        clock, counts, self._is_new = self.clock, self.counts, True
        clock.previous = clock.now - interval
        counts.phase, counts.rows, counts.samples = b.BEGIN_STEP, 0, 0
        counts.output = int(np.searchsorted(self.outputs, clock.now + SAME_TIME * step, side="right"))

    def rows(self) -> Floats:
        """Rows (n, L, len(LOG)) of steps since the last call; the next steps overwrite them."""
        count = int(self.counts.rows)
        self.counts.rows = 0
        return self._log[:count]

    # --- what is known --------------------------------------------------------------------------------

    @property
    def tried(self) -> NetworkTaken:
        """How the last try ended."""
        outcome, it, where = int(self.counts.outcome), int(self.counts.tries), int(self.counts.where)
        correction = float(self.clock.correction)
        return NetworkTaken(Outcome(outcome), it, correction, int(self.lines[LINE]), where, np.nan)

    # --- checkpoints ----------------------------------------------------------------------------------

    def cuts(self) -> list[float]:
        """What has been told of steps that were cut, and what is known of those that became short."""
        clock, counts = self.clock, self.counts
        known = clock.mute_cuts, clock.mute_slack, clock.longest, counts.cut_short
        return [float(x) for x in (*known, *(getattr(counts, name) for name in LENGTHS))]

    def restore_cuts(self, saved: Sequence[float]) -> None:
        """Go on as `cuts` has told."""
        clock, counts = self.clock, self.counts
        (clock.mute_cuts, clock.mute_slack, clock.longest), counts.cut_short = saved[:3], int(saved[3])
        clock.cut_angle = clock.slack_step = 0.0  # of steps that are undone
        for name, number in zip(LENGTHS, saved[4:], strict=True):
            setattr(counts, name, int(number))

    def control(self) -> list[float]:
        """What the lengths of the next steps depend on."""
        if not self.controlled:
            return []
        return [float(self.clock.next_dt), float(self.clock.error_ratio), float(self.counts.wary)]

    def restore_control(self, saved: Any, largest: float) -> None:
        """Go on as `control` has told; largest: s, that a step may ever be.  ValueError: that cannot be."""
        if not self.controlled:
            return
        shortest = float(self.clock.shortest)
        numbers = isinstance(saved, list) and len(saved) == 3 and all(isinstance(x, int | float) for x in saved)
        if not numbers or not (shortest <= saved[0] <= largest and saved[1] > 0.0 and 0 <= saved[2] <= WARY):
            raise ValueError("control: length and error of the steps were expected")
        self.clock.next_dt, self.clock.error_ratio = float(saved[0]), float(saved[1])
        self.counts.wary = int(saved[2])
