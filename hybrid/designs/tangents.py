"""Tangents along the steps of a run: what its results answer to numbers of the scene, in one run for all numbers.

Beside each step the line of a scene with a little more of a number is kept at the tangent of the step's end, with the
factors of the step itself (kernels.watch.tangents).  What a kernel does not follow is refused here (`Unfollowed`), and
is left to differences of runs.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.designs.line_at_rest import displaced
from hybrid.designs.replay import at_nodes
from hybrid.kernels.algebra.block_elimination import SIZE, WIDTH
from hybrid.kernels.algebra.block_elimination_plane import solve_again_planar
from hybrid.kernels.algebra.kept_factors import solve_again
from hybrid.kernels.laws.water import wave_kinematics
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.run import entry
from hybrid.kernels.run.entry import block_rows, out_of_balance, workspace, workspace_of
from hybrid.kernels.state.books import Books, Clock, Counts, blank_books, sample_size
from hybrid.kernels.state.forces import FRICTION, PLANAR, SELF_CONTACT, SOIL, STIFFNESS_DAMPING, VORTICES, WAVES
from hybrid.kernels.state.report import ASSEMBLED
from hybrid.kernels.state.state import (
    LANES,
    Batch,
    Ends,
    Floats,
    Line,
    Moves,
    Sea,
    State,
    Work,
    batch_of_one,
    state_for,
)
from hybrid.kernels.watch.tangent_job import (
    BROKEN,
    FOLLOWED,
    LARGEST_R,
    LARGEST_T,
    LEFT_R,
    LEFT_T,
    TANGENT_SIZES,
    blank_other,
    blank_tangent_job,
)
from hybrid.kernels.watch.tangents import follow_in_plane, follow_in_space
from hybrid.kernels.watch.wave_slopes import PHASES, SLOPES
from hybrid.linear.matrices import ANCHOR
from hybrid.model.build import Model, build
from hybrid.model.plane import planar
from hybrid.model.resolution import Resolution
from hybrid.scene.schema import Scene
from hybrid.simulation.case import Case
from hybrid.simulation.time_loop import TimeLoop
from hybrid.simulation.transient import Transient
from hybrid.solve.run import batch_of_rows
from hybrid.solve.statics import Equilibrium
from hybrid.solve.stepper import HEAVY, POWERS

# Part of a number by which the scene of the other line differs; of coordinates, of lengths: what moves a line far moves
# nodes into contact and out of it.
PART, OF_PLACES, OF_LENGTHS = 2.5e-7, 1e-7, 1e-8
PLACE, LENGTH = re.compile(r"(position\[\d\]|\.z|\.surface)$"), re.compile(r"(\blength|\.at(\[\d\])?)$")
# Phases of waves round the motion more than other numbers do, and waves move a line less than these.
OF_WAVES, WAVE = 4e-6, re.compile(r"\bwaves\b")
AT_START = 2  # corrections of an equilibrium, and of first accelerations, with factors of their own
# Numbers that outputs of the other lines may take in memory, 1 GB.
MOST_SAMPLED = 128_000_000


class Unfollowed(Exception):
    """Why tangents cannot follow a run; number: by which alone, counted as they are given, None: by any."""

    number: int | None = None


def step_of(key: str, size: float) -> float:
    """By how much the scene of the other line differs in a number; size: that of the number."""
    kinds = (LENGTH, OF_LENGTHS), (PLACE, OF_PLACES), (WAVE, OF_WAVES)
    return size * next((part for pattern, part in kinds if pattern.search(key)), PART)


def has_two_sides(keys: Iterable[str], number: float) -> bool:
    """Whether results by a number are seen from both sides: nodes go along with lengths past the places of outputs.

    So is a number that is 0, which has to be allowed to be less.
    """
    return number == 0.0 or any(LENGTH.search(key) for key in keys)


class Tangent(NamedTuple):
    """Of a line by a number: tangents of its state, of the spin of its cells, sizes (kernels.watch.tangent_job), and by

    how much the number of the other line is more.
    """

    rate: State
    spin: Floats
    sizes: Floats
    h: float


class Others:
    """The lines of scenes with more of each number beside the line of a run, and with less on its other side."""

    def __init__(
        self, scene: Scene, scenes: Sequence[tuple[Scene, Scene | None]], steps: Sequence[float],
        lines: Mapping[str, Resolution], more: Sequence[float] | None = None,
    ) -> None:  # fmt: skip
        """scene: of the run; scenes: with more of each number by a step, and with less (None: it is not looked at);

        lines: how finely, by name; more: as of `replay.with_outputs`.
        """
        self._more_points, self._scene = more, scene
        self._scenes, self._steps, self._resolution = list(scenes), np.array(steps, float), lines[""]
        self.models = [build(more, lines[""], spare=False) for more, _ in scenes]
        self._first: list[Batch] = []
        self._base: list[Batch] = []  # outputs of the run
        self.sizes = np.zeros((len(scenes), TANGENT_SIZES))
        self._run: Any = None

    def begin(self, loop: TimeLoop, equilibrium: Equilibrium | None) -> None:
        """Stand beside the state that a run begins with, and follow its steps from there on.  Unfollowed."""
        run = self._run = loop.run
        self._model = model = run.model
        refuse(run)
        self._lines = []
        for k, x in enumerate(self.models):
            try:
                self._lines.append(line_like(x, model))
            except Unfollowed as why:
                why.number = k
                raise
        cells, number = model.line.h.size, len(self.models)
        outputs = run.run.books.outputs.size
        if outputs * number * sample_size(cells) > MOST_SAMPLED:
            raise Unfollowed("outputs of so many numbers do not fit into memory")
        here = run.state.copy()
        for rate in (here.a, here.vd, here.wa, here.wd):
            rate[:] = 0.0
        here.T[:] = (model.start if equilibrium is None else equilibrium.state).T
        rates, spins = self._at_start(here, equilibrium is not None)
        reports = self._accelerate(run.state.copy(), rates, spins)
        self._attach(run, reports, rates, spins)
        ends, sea, report = model.ends.at(0.0), model.sea.at(0.0), run.run.books.report[0]
        self._base.append(copied(batch_of_one(0.0, ends, run.state, report, np.zeros(len(POWERS)), sea)))
        loop.shown = lambda batch: self._base.append(copied(batch))

    # --- the start --------------------------------------------------------------------------------------

    def _at_start(self, here: State, rests: bool) -> tuple[list[State], list[Floats]]:
        """Tangents of the first state, which accelerations complete; here: that state without accelerations."""
        base = self._model.start
        rates = [state_for(self._model.line) for _ in self.models]
        spins = [np.zeros_like(here.w) for _ in self.models]
        for model, rate, h in zip(self.models, rates, self._steps, strict=True):
            if rests:
                self._hold(model.ends.at(0.0), rate, h)
                continue
            for name in ("r", "v", "T", "w"):
                getattr(rate, name)[:] = (getattr(model.start, name) - getattr(base, name)) / h
        if rests:
            line, lines = at_rest(self._model.line), [at_rest(x) for x in self._lines]
            ca = ANCHOR * self._model.tension_scale / (float(line.mass.sum()) * self._model.length)
            for x in (here.v, here.w):
                x[:] = 0.0
            for rate, x in self._corrections(line, lines, here, rates, spins, ca):
                rate.r[:] += x[:, 1:4]
                rate.T[:] += x[1:, 0]
        return rates, spins

    def _hold(self, other: Ends, rate: State, h: float) -> None:
        """Held ends are where those of the other line are held."""
        ends = self._model.ends.at(0.0)
        for k in (0, 1):
            if ends.held[k]:
                rate.r[-k] = (other.position[k] - ends.position[k]) / h

    def _accelerate(self, here: State, rates: list[State], spins: list[Floats]) -> list[Floats]:
        """Tangents of accelerations and tensions that are consistent with loads, and reports of the other lines."""
        model, dt = self._model, 1e-3 * self._run.resolution.step
        line, held = model.line, model.ends.values.held
        if here.v.any() and not line.ck.all():
            raise Unfollowed("an inextensible line moves at first")
        base = model.ends.acceleration(0.0, dt).copy()
        for other, rate, h in zip(self.models, rates, self._steps, strict=True):
            more = (other.ends.acceleration(0.0, dt) - base) / h
            for k in np.flatnonzero(held):
                rate.vd[-k] = more[k]
        turning = (line.spin == 1) & (line.polar > 0) & (not self._is_planar)
        for rate, x in self._corrections(line, self._lines, here, rates, spins, HEAVY):
            rate.vd[:] += HEAVY * x[:, 1:4]
            rate.T[:] += x[1:, 0]
            rate.wd[turning] += HEAVY * x[:-1, 4][turning]
            rate.a[:], rate.wa[:] = rate.vd, rate.wd
        return self._reports

    def _corrections(
        self, line: Line, lines: Sequence[Line], here: State, rates: list[State], spins: list[Floats], ca: float
    ) -> Iterator[tuple[State, Floats]]:
        """Corrections (N+1, 5) of each tangent in turn, which the caller adds to it, with the factors of a state; that

        of the spin is added here.  lines: the other ones; ca: as of `entry.assembly`.
        """
        work, ends, sea = workspace_of(line, keep=True), self._model.ends.at(0.0), self._model.sea.at(0.0)
        own, other = workspace_of(line), workspace_of(line)
        if entry.correction(line, sea, ends, here, 0.0, ca, work) >= 0:
            raise Unfollowed("the equations of the start have no factors")
        base, x = left_over(line, sea, ends, here, ca, own), np.zeros((line.s.size, 5))
        self._reports = []
        for of, model, rate, spin, h in zip(lines, self.models, rates, spins, self._steps.tolist(), strict=True):
            held, around = model.ends.at(0.0), model.sea.at(0.0)
            for last in [*(AT_START * [False]), True]:
                there = beside(here, rate, spin, h)
                if of.bits & WAVES:
                    wave_kinematics(around, there.r, other.u)
                left = left_over(of, around, held, there, ca, other)
                if last:
                    break
                right = (left - base) / h
                right[1:, 0] = lengths_left(line, of, here, there, rate, h)
                if self._is_planar:
                    solve_again_planar(line.plane, work.X, right, x)
                else:
                    solve_again(work.X, work.W, right, x)
                x[np.flatnonzero(held.held) * (line.s.size - 1), 1:4] = 0.0
                spin += x[:-1, 4]
                yield rate, x
            report = self._run.run.books.report[0].copy()
            report[:ASSEMBLED] += (other.report - own.report)[:ASSEMBLED]
            self._reports.append(report)

    @property
    def _is_planar(self) -> bool:
        return bool(self._model.line.bits & PLANAR)

    # --- along the steps --------------------------------------------------------------------------------

    def _attach(self, run: Transient, reports: list[Floats], rates: list[State], spins: list[Floats]) -> None:
        """Have the run call the kernel behind every step."""
        model, compiled = self._model, run.run
        cells = model.line.h.size
        work = run.stepper.work._replace(X=workspace(cells, keep=True).X)
        run.take(model, work)
        compiled.table.bind(work=work)
        tables, self._kept = np.zeros((len(self.models), Table(blank_other).numbers.size), np.int64), []
        self._books: list[Books] = []
        around, outputs = model.sea.values, compiled.books.outputs
        same = [bool(model.line.bits & WAVES) and same_waves(around, x.sea.values) for x in self.models]
        for k, (x, report) in enumerate(zip(self.models, reports, strict=True)):
            ends, sea, there = x.ends.at(0.0), x.sea.at(0.0), beside(run.state, rates[k], spins[k], self._steps[k])
            books = books_beside(compiled.clock, outputs, int(compiled.count.output), cells, ends, report)
            self._books.append(books)
            self._first.append(batch_of_one(0.0, ends, there, report, np.zeros(len(POWERS)), sea))
            of = Tangent(rates[k], spins[k], self.sizes[k], float(self._steps[k]))
            moves = x.ends.moves()
            self._kept.append(bind_other(tables[k], self._lines[k], ends, sea, moves, there, of, books, same[k])[0])
        self._found, ends = np.zeros(2, np.int64), model.ends.values
        at = compiled.clock, compiled.count, tables, self._found, any(same)
        table, _ = bind_line(model.line, ends, around, compiled.states, work, *at)
        self._kept.append(table)
        follow = follow_in_plane if self._is_planar else follow_in_space
        compiled.table.bind(following=table.numbers, follower=follow.address(table.numbers))

    @property
    def errors(self) -> Floats:
        """(P,) parts of tangents by which they may be off: what the last corrections leave of them."""
        return parts_of_sizes(self.sizes)

    # --- what is found ----------------------------------------------------------------------------------

    def results(self, names: Mapping[str, Sequence[str]]) -> list[tuple[Mapping[str, Seen], ...]]:
        """Results by name at all outputs of the line "", of the scene itself, then of every number of the scenes with

        more of it, and with less.  Unfollowed.
        """
        run = self._run
        if run.model is not self._model or self._found[FOLLOWED] != run.steps or self._found[BROKEN]:
            raise Unfollowed("the line, or what acts on it, becomes another one in the run")
        base, line = joined(self._base), self._model.line
        here = self._looked_at(self._scene, self._model, line, base, names[""])
        return [({"": here},), *(self._seen(p, base, names[""]) for p in range(len(self.models)))]

    def _seen(self, p: int, base: Batch, names: Sequence[str]) -> tuple[Mapping[str, Seen], ...]:
        books, held, cells = self._books[p], self._model.ends.values.held, self._model.line.h.size
        rest, _ = batch_of_rows(books.samples[: int(books.counts.samples)], cells, held, False, 0, 0)
        more, (scene, other) = joined([self._first[p], rest]), self._scenes[p]
        seen = {"": self._looked_at(scene, self.models[p], self._lines[p], more, names)}
        if other is None:
            return (seen,)
        model = build(other, self._resolution, spare=False)
        less = self._looked_at(other, model, line_like(model, self._model), opposite(base, more), names)
        return seen, {"": less}

    def _looked_at(self, scene: Scene, model: Model, line: Line, batch: Batch, names: Sequence[str]) -> Seen:
        if self._more_points is not None:
            output = scene.output.model_copy(update={"points": at_nodes(scene, model.line.s, self._more_points)})
            scene = scene.model_copy(update={"output": output})
        case = Case(scene, None)
        observer = case.observer(model, False, case.points.s, None)
        observer = observer.on(line, model.sea.values, model.zones, model.hinges).of(names)
        return Seen(scene, observer.values_of(observer.look(batch)), np.asarray(observer.s), batch.t.copy())


class Seen(NamedTuple):
    """Results of a scene with another number: `values` (nt, ...) by name, at arc lengths s, m, and times t, s."""

    scene: Scene
    values: Mapping[str, Floats]
    s: Floats
    t: Floats


def copied(batch: Batch) -> Batch:
    parts: Any = [np.array(x) for x in batch]
    return Batch(*parts)


def _opposite(here: Any, more: Any) -> Any:
    """What is as far from what is here to the other side; what has no value, or is no number, stays."""
    if more.dtype.kind != "f" or not more.size:
        return more
    with np.errstate(invalid="ignore"):
        away = here - more
    return np.asarray(here + np.where(np.isfinite(away), away, 0.0))


def joined(batches: Sequence[Batch]) -> Batch:
    """One after the other; what does not vary from output to output is that of the last one."""
    counts = [x.t.size for x in batches]
    parts: list[Any] = []
    for x in zip(*batches, strict=True):
        arrays: list[Any] = list(x)
        every = [len(y) for y in arrays] == counts and len({y.ndim for y in arrays}) == 1
        parts.append(np.concatenate(arrays) if every else arrays[-1])
    return Batch(*parts)


def line_like(model: Model, base: Model) -> Line:
    """The line of a scene with more of a number, of the kind of that of the run.  Unfollowed: it is another."""
    line = model.line
    if base.line.bits & PLANAR and not line.bits & PLANAR:
        if model.plane is None or base.plane is None or np.abs(model.plane - base.plane).max() > 1e-12:
            raise Unfollowed("the number moves the plane of the line")
        line = planar(line, base.plane)
    elif line.bits & PLANAR and not base.line.bits & PLANAR:
        raise Unfollowed("the line has left its plane")
    pairs: Any = zip(line, base.line, strict=True)
    for name, (x, y) in zip(line._fields, pairs, strict=True):
        alike = x.shape == y.shape if isinstance(x, np.ndarray) else x == y
        if not alike or (name in ("element", "spin") and not np.array_equal(x, y)):
            raise Unfollowed(f"the number changes what the line has ({name})")
    if not np.array_equal(model.ends.values.held, base.ends.values.held):
        raise Unfollowed("the number changes what ends hold")
    return line


def refuse(run: Transient) -> None:
    """Unfollowed where a run has what the kernel does not know, with what that is."""
    refuse_what(
        unknown_of(run.model)
        | {
            "zones move": run.switching is not None, "line is paid out": run.payout is not None,
            "the line may touch itself": run.run.contact is not None,
            "errors of the model are followed": run.correction is not None,
        }
    )  # fmt: skip


def refuse_what(what: Mapping[str, bool]) -> None:
    """Unfollowed where something of this is there."""
    if found := [text for text, there in what.items() if there]:
        raise Unfollowed(", ".join(found))


def unknown_of(model: Model) -> dict[str, bool]:
    """What kernels of tangents do not know of a line, and whether it has that."""
    line, ends = model.line, model.ends
    return {
        "the line may touch itself": bool(line.bits & SELF_CONTACT),
        "vortices follow the motion": bool(line.bits & VORTICES),
        "tension is no multiple of strain": line.law.size > 0,
        "layers slip": line.slip_law.size > 0, "tension makes a torque": line.tension_torque.size > 0,
        "a torque passes through catenary zones": line.torsion.size > 0, "obstacles move": line.moved.size > 0,
        "loads change in the run": bool(ends.breaks) or min(ends.release_times) < math.inf,
        "friction of the bed": bool(line.bits & FRICTION), "soil remembers": bool(line.bits & SOIL),
    }  # fmt: skip


def bind_other(
    room: NDArray[np.int64], line: Line, ends: Ends, sea: Sea, moves: Moves, there: State, tangent: Tangent,
    books: Books, same: bool,
) -> tuple[Table, Floats]:  # fmt: skip
    """Fill `room` with an OtherLine (kernels.watch.tangent_job) at `there`: its table, and its report.

    same: whether its waves are those of the run.
    """
    cells, table = line.h.size, Table(blank_other, room)
    work = workspace(cells)
    table.bind(
        line=line, sea=sea, ends=ends, moves=moves, even=there, odd=there.copy(), rates=tangent.rate,
        spin=tangent.spin, before=tangent.rate.copy(), spin_before=tangent.spin.copy(), work=work,
        books=books, left=np.zeros((cells + 1, 5)), sizes=tangent.sizes, same_waves=int(same), h=float(tangent.h),
    )  # fmt: skip
    return table, work.report


def bind_line(
    line: Line, ends: Ends, sea: Sea, states: tuple[State, State], work: Work, clock: Clock,
    counts: Counts, tables: NDArray[np.int64], found: NDArray[np.int64], same: bool,
) -> tuple[Table, Floats]:  # fmt: skip
    """A TangentJob of a line of a run, whose states take turns, and the report that it works with.

    same: whether waves of other lines are its own.
    """
    cells, table = line.h.size, Table(blank_tangent_job)
    own = workspace(cells)._replace(u=work.u)
    table.bind(
        line=line, sea=sea._replace(slid=np.zeros((cells + 1, 3)), bed=np.zeros((cells + 1, 3))), ends=ends,
        even=states[0], odd=states[1], work=work, own=own, clock=clock, counts=counts,
        left=np.zeros((cells + 1, 5)), last=states[0].a.copy(), ahead=np.zeros((cells + 1, 3)),
        slopes=np.zeros(((cells + 1) * same, SLOPES)), lanes=np.zeros((PHASES + 2 * len(sea.waves), LANES)),
        found=found, tables=tables,
    )  # fmt: skip
    return table, own.report


def books_beside(clock: Clock, outputs: Floats, done: int, cells: int, ends: Ends, report: Floats) -> Books:
    """Books of another line, whose outputs are those of the run, of which so many are done."""
    books = blank_books(cells)
    books.counts.output, books.report[0] = done, report
    for k in (0, 1):
        parts = (ends.position[k], ends.frame[k], ends.spin[k], ends.force[k], ends.moment[k])
        books.imposed[0, k] = np.concatenate(parts)
    samples = np.zeros((outputs.size - done, sample_size(cells)))
    return books._replace(clock=clock, outputs=outputs, samples=samples)


def parts_of_sizes(sizes: Floats) -> Floats:
    """Parts of tangents by which they may be off, of sizes (.., TANGENT_SIZES): what the last corrections leave."""
    sizes = np.maximum(sizes, 1e-300)
    return np.maximum(sizes[..., LEFT_R] / sizes[..., LARGEST_R], sizes[..., LEFT_T] / sizes[..., LARGEST_T])


def opposite(here: Batch, more: Batch) -> Batch:
    """Outputs as far from those of the run to the other side."""
    both: Any = zip(here, more, strict=True)
    return Batch(*(_opposite(x, y) for x, y in both))


def same_waves(one: Sea, other: Sea) -> bool:
    """Whether waves are the same everywhere and at all times."""
    names = "waves", "orbits", "stretched", "depth", "surface", "ramps"
    return all(np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True) for name in names)


def left_over(line: Line, sea: Sea, ends: Ends, state: State, ca: float, work: Work) -> Floats:
    """(N+1, 5) what the equations of a state leave over, as of `kernels.algebra.kept_factors.solve_again`."""
    rows, out = block_rows(line), np.zeros((line.s.size, 5))
    work.u[:] = 0.0
    entry.assembly(line, sea, ends, state, 0.0, ca, work._replace(rows=rows))
    if line.bits & PLANAR:
        out[:, 1:4] = -out_of_balance(line, rows)
    else:
        out[:, 1:] = rows.reshape(-1, SIZE, WIDTH)[:, 1:, -1]
    out[np.flatnonzero(ends.held) * (line.s.size - 1), 1:4] = 0.0
    return out


def beside(here: State, rate: State, spin: Floats, h: float) -> State:
    """The state of another line, at h times tangents from this one."""
    q = np.zeros((1, here.T.size + 1, 5))
    q[0, :, 1:4], q[0, 1:, 0], q[0, :-1, 4] = rate.r, rate.T, spin
    moved = {name: x[0] for name, x in displaced(here, q, np.array([h])).items()}
    rates = {name: getattr(here, name) + h * getattr(rate, name) for name in ("v", "a", "vd", "w", "wa", "wd")}
    return here.copy()._replace(**moved, **rates)


def lengths_left(line: Line, other: Line, here: State, there: State, rate: State, h: float) -> Floats:
    """(N,) of laws of length, by h: without what rounding of lengths would make of tensions."""
    more = np.diff(rate.r, axis=0)
    f = here.e + h * more
    longer = ((here.e + f) * more).sum(axis=1) / (np.linalg.norm(here.e, axis=1) + np.linalg.norm(f, axis=1))
    l, l_there = np.linalg.norm(here.e, axis=1), np.linalg.norm(f, axis=1)
    more_v, faster, to = np.diff(rate.v, axis=0), np.diff(here.v, axis=0), np.diff(there.v, axis=0)
    late = (here.e * more_v + more * to).sum(axis=1) - (here.e * faster).sum(axis=1) / l * longer
    late = (line.tau * late + (other.tau - line.tau) / h * (f * to).sum(axis=1)) / l_there
    late[~((line.ck > 0.0) & bool(line.bits & STIFFNESS_DAMPING))] = 0.0
    stretched = other.h * other.ck * there.T - line.h * line.ck * here.T
    return np.asarray((stretched + (other.h - line.h)) / h - late - longer)


def at_rest(line: Line) -> Line:
    """A line without what does not act in an equilibrium."""
    return line._replace(bits=line.bits & ~(FRICTION | WAVES))
