"""Lines beside those of a run: what tangents along its steps are made of (hybrid.designs.network_tangents).

Beside each step the line of a scene with a little more of a number is kept at the tangent of the step's end, with the
factors of the step itself (kernels.watch.tangents).  What a kernel does not follow is refused here (`Unfollowed`), and
is left to differences of runs.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.designs.line_at_rest import displaced
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.run.entry import workspace
from hybrid.kernels.state.books import Books, Clock, Counts, blank_books, sample_size
from hybrid.kernels.state.report import FRICTION, PLANAR, SELF_CONTACT, SOIL, VORTICES, WAVES
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
)
from hybrid.kernels.watch.tangent_job import (
    LARGEST_R,
    LARGEST_T,
    LEFT_R,
    LEFT_T,
    blank_other,
    blank_tangent_job,
)
from hybrid.kernels.watch.wave_slopes import PHASES, SLOPES
from hybrid.model.build import Model
from hybrid.model.plane import in_space, planar
from hybrid.scene.schema import LineScene

# Parts of a number by which the scene of the other line differs: rounding by PART is as much as what both sides differ
# by, 1e-6 of forces at anchors (bench/test_bench_tangents.py).
PART = 2.5e-6
OF_PLACES = 1e-7  # of coordinates: what moves a line far moves nodes into contact and out of it
OF_LENGTHS = 1e-8  # of lengths, for the same reason
PLACE, LENGTH = re.compile(r"(position\[\d\]|\.z|\.surface)$"), re.compile(r"(\blength|\.at(\[\d\])?)$")
# Phases of waves round the motion more than other numbers do, and waves move a line less than these.
OF_WAVES, WAVE = 4e-6, re.compile(r"\bwaves\b")
# Of the axes of two planes that are one, by rounding.
SAME_PLANE = 1e-12
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
    """Tangents of a line by a number, whose other line has more of it by a step.

    Of its state, of the spin of its cells; sizes (kernels.watch.tangent_job), and that step.
    """

    rate: State
    spin: Floats
    sizes: Floats
    h: float


class Seen(NamedTuple):
    """Results of a scene with another number: `values` (nt, ...) by name, at arc lengths s, m, and times t, s."""

    scene: LineScene
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
        if base.plane is None or not lie_in(base.plane, model):
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


def lie_in(plane: Floats, model: Model) -> bool:
    """Whether a line lies in a plane (3, 3): its number has not moved that."""
    return model.plane is not None and bool(np.abs(model.plane - plane).max() <= SAME_PLANE)


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


def beside(here: State, rate: State, spin: Floats, h: float) -> State:
    """The state of another line, at h times tangents from this one."""
    q = np.zeros((1, here.T.size + 1, 5))
    q[0, :, 1:4], q[0, 1:, 0], q[0, :-1, 4] = rate.r, rate.T, spin
    moved = {name: x[0] for name, x in displaced(here, q, np.array([h])).items()}
    rates = {name: getattr(here, name) + h * getattr(rate, name) for name in ("v", "a", "vd", "w", "wa", "wd")}
    return here.copy()._replace(**moved, **rates)


def at_rest(line: Line) -> Line:
    """A line in space, without what does not act in an equilibrium."""
    return in_space(line._replace(bits=line.bits & ~(FRICTION | WAVES)))
