"""Contact of lines: their arrays, and the tables of its kernels.

Several lines that touch each other have their arrays as one line.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.contact.self_contact import blank_contact_job, contact_task
from hybrid.kernels.contact.self_contact_law import (
    AT,
    DISTANCE,
    FIRST,
    FOOT,
    FORCE,
    GRIP,
    HELD,
    LAST,
    NORMAL,
    PIECE,
    WX,
    WY,
    P,
    Q,
)
from hybrid.kernels.contact.self_contact_pairs import SHARES, SLIP_WITHIN, WINDOW, Contact, blank_contact
from hybrid.kernels.junctions.lines_contact import MEETING, MET, MET_OTHER, MET_S, blank_shared_job, shared_task
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.run import newton
from hybrid.kernels.run.newton import block_rows, out_of_balance, workspace_of
from hybrid.kernels.state.books import Books, blank_books
from hybrid.kernels.state.report import FORCE_A, NET_A, ROTARY, SELF_CONTACT_ENERGY
from hybrid.kernels.state.state import Ends, Floats, Line, Sea, State, Work, blank_line, blank_state, no_ends, no_work
from hybrid.kernels.step.line_step import ADDRESS, ASKED, NEAR, SHARED, STAND
from hybrid.model.contents import Touching

# Sample points of a piece lie at most this part of a diameter apart, but for round-off, which must not decide how many
# there are: pieces of the same length, in whatever unit, have as many.
SPACING = 0.25 * (1.0 + 1e-9)
# Room for points of contact: LEAST_POINTS, or two for each sample point; at most MOST_POINTS.
LEAST_POINTS, MOST_POINTS = 1000, 100_000
# Least size of the law of contact, N: of EI/D^2; without EI of the tension scale.
STIFFNESS, TENSION = 0.16, 0.02


def left_over(
    line: Line, sea: Sea, ends: Ends, state: State, force: Floats, anchor: float, work: Work
) -> tuple[float, Floats]:
    """Largest residual force, N, at a node which nothing holds, and contact forces (2, 3) N on end nodes.

    Contact included.  force: (N+1, 3) N, of contact; work: of the line, with u = 0, whose report becomes that of the
    state without contact.
    """
    rows = block_rows(line)
    if newton.assembly(line, sea, ends, state, 0.0, anchor, work._replace(rows=rows)) >= 0:
        return float("inf"), np.zeros((2, 3))
    left = out_of_balance(line, rows) + force
    left[[-k for k in (0, 1) if ends.held[k]]] = 0.0
    return float(np.abs(left).max()), force[[0, -1]]


def mean_beside(cells: Floats) -> Floats:
    """At nodes (N+1,), the mean of the cells (N,) beside them."""
    both = np.pad(cells, 1, mode="edge")
    return np.asarray(0.5 * (both[1:] + both[:-1]))


class Strand(NamedTuple):
    """A line as contact takes it, at its nodes (N+1,)."""

    width: Floats  # m
    samples: Floats  # points of its pieces
    stiff: Floats  # N, least size of the law
    mass: Floats  # kg/m
    rolls: float  # 1 where friction turns it about itself; 0: nothing holds its spin


def strand_of(line: Line, width: Floats, bending: Floats, tension_scale: float) -> Strand:
    """width: (N,) m, diameters of cells; bending: (N,) N m2, their stiffness, 0: none; tension_scale: N."""
    widths, pieces, bends = (mean_beside(x) for x in (width, np.diff(line.s), bending))
    lengths = pieces.copy()
    lengths[[1, -2]] = np.maximum(lengths[[1, -2]], 2.0 * np.diff(line.s)[[0, -1]])  # begin and end at the nodes
    holds_twist = (
        line.spin.all()
        and bool((line.element * line.kb[:, 2])[[0, -1]].any())
        and bool(line.kb[line.element == 1, 2].all())
    )
    samples = np.maximum(np.ceil(lengths / (SPACING * widths)), 1)
    stiff = np.maximum(STIFFNESS * bends / widths**2, TENSION * tension_scale * (bends == 0.0))
    return Strand(widths, samples, stiff, line.mass / pieces, float(bool(line.bits & ROTARY) or holds_twist))


def contact_of_strands(strands: Sequence[Strand], friction: float) -> Contact:
    """What contact of lines works with, which stand one after the other; friction: the largest coefficient."""
    samples = np.concatenate([x.samples for x in strands])
    room = int(np.clip(2 * samples.sum(), LEAST_POINTS, MOST_POINTS))
    contact = blank_contact(samples.size - 1, room, friction > 0.0, len(strands))
    contact.samples[:] = samples
    for name in ("width", "stiff", "mass"):
        getattr(contact, name)[:] = np.concatenate([getattr(x, name) for x in strands])
    of = np.repeat(np.arange(len(strands)), [x.width.size for x in strands])
    contact.of[:], contact.rolls[:] = of, np.array([x.rolls for x in strands])[of]
    beside = np.flatnonzero(np.diff(of))
    contact.kind[beside], contact.kind[beside + 1] = LAST, FIRST
    contact.tips[:, 0], contact.tips[:, 1] = np.append(0, beside + 1), np.append(beside, of.size - 1)
    numbers = contact.numbers
    numbers.widest, numbers.narrowest, numbers.friction = contact.width.max(), contact.width.min(), friction
    numbers.rolls = contact.rolls.max()
    numbers.since = numbers.faded = numbers.begun = numbers.led = np.nan
    numbers.quiet = np.inf
    return contact


def forces_on_nodes(contact: Contact) -> Floats:
    """Forces (N+1, 3) N of contact, as it was looked at last, on the nodes."""
    out, rubs = np.zeros_like(contact.at), bool(contact.holds.size)
    for k, row in enumerate(contact.points[: contact.counts.points]):
        f = -row[FORCE] * row[NORMAL : NORMAL + 3]
        f = f + contact.holds[k, HELD : HELD + 3] if rubs else f
        p, q = int(row[P]), int(row[Q])
        out[p - 1 : p + 2] += row[WX : WX + 3, None] * f
        out[q - 1 : q + 2] -= row[WY : WY + 3, None] * f
    return out


def count_in(report: Floats, energy: float, force: Floats, ends: Ends) -> None:
    """Put energy, J, and what forces (N+1, 3) N of contact do to held ends into the report of a line."""
    report[SELF_CONTACT_ENERGY] = energy
    for k in np.flatnonzero(ends.held):  # 0 or 1: the first or the last node
        for at in (FORCE_A + 3 * k, NET_A + 3 * k):
            report[at : at + 3] += force[-k]


class ContactBooks:
    """What goes on from step to step of contact, of one line with itself or of several."""

    def __init__(self, contact: Contact, middles: Floats) -> None:
        """middles: (N,) m, arc lengths of the middles of cells."""
        self.contact, self._middles = contact, middles
        self.call, self._touch = np.zeros(3, np.int64), np.zeros((3, 0))

    def forget(self) -> None:
        """What is computed next is no step: no speed with which strands meet, and no pairs kept of a step."""
        self.contact.numbers.speed, self.contact.numbers.keeps, self.call[NEAR] = 0.0, -1.0, 0

    @property
    def touches(self) -> bool:
        """Whether anything touches in the state that was looked at last."""
        return bool(self.contact.counts.points)

    @property
    def narrowest(self) -> float:
        """The least diameter, m."""
        return float(self.contact.numbers.narrowest)

    @property
    def least_distance(self) -> float:
        """The least distance, m, of the points of contact looked at last."""
        points = self.contact.points[: self.contact.counts.points]
        return float(points[:, DISTANCE].min())

    def checkpoint(self, t: float) -> dict[str, Any]:
        """What the steps after the time t, s, depend on."""
        contact, numbers, counts = self.contact, self.contact.numbers, self.contact.counts
        latest = numbers.since == t
        grips = contact.fresh[: counts.fresh] if latest else contact.grips[: counts.grips]
        stored = float(numbers.tried if latest else numbers.stored)
        found: dict[str, Any] = {name: float(getattr(numbers, name)) for name in ("speed", "faded", "quiet")}
        found |= {"stored": stored, "grips": grips.copy(), "remeshed": bool(counts.remeshed) and not latest}
        found |= {"touch": self._touch[0].copy(), "samples": contact.samples.copy(), "mass": contact.mass.copy()}
        return found | {"energy": self._energy_at(t)}

    def _energy_at(self, t: float) -> list[float]:
        """Of the energy at the time t, s: that of the line (nan: unknown), balance, the largest; and tries given up."""
        numbers = self.contact.numbers
        led, begun = numbers.led == t, numbers.begun == t
        has = numbers.has if led else numbers.had if begun else np.nan
        balance = numbers.tried_balance if led else numbers.balance
        return [float(has), float(balance), float(numbers.largest), float(numbers.gained)]

    def _restore_energy(self, saved: list[float], t: float) -> None:
        """Go on from `_energy_at`; t: s, nan: the energy of the line is another one on other cells."""
        numbers = self.contact.numbers
        numbers.has, numbers.balance, numbers.largest, numbers.gained = saved
        numbers.tried_balance, numbers.begun = numbers.balance, np.nan
        numbers.led = t if np.isfinite(saved[0]) else np.nan

    @property
    def given_up(self) -> int:
        """Tries of steps that were given up because contact put energy in."""
        return int(self.contact.numbers.gained)

    def restore(self, saved: Mapping[str, Any], t: float = np.nan, remeshed: bool = False) -> None:
        """Go on from `checkpoint` at t, s; remeshed: of a line that had other cells.  ValueError: no grips."""
        grips, numbers, counts = saved["grips"], self.contact.numbers, self.contact.counts
        if grips.ndim != 2 or grips.shape[1] != GRIP or not np.isfinite(grips).all():
            raise ValueError(f"self_contact/grips: expected rows of {GRIP} finite numbers")
        numbers.speed, numbers.stored, numbers.since = saved["speed"], saved["stored"], np.nan
        numbers.faded, numbers.quiet = saved.get("faded", np.nan), saved.get("quiet", np.inf)
        self._restore_energy(saved.get("energy", [np.nan, 0.0, 0.0, 0.0]), np.nan if remeshed else t)
        counts.grips, counts.remeshed = 0, remeshed or saved.get("remeshed", False)
        touch = saved.get("touch", np.zeros(0))
        if not remeshed and touch.shape == self._touch[0].shape:
            self._touch[0] = touch
            self.contact.samples[:], self.contact.mass[:] = saved["samples"], saved["mass"]  # as cells were long then
        if self.contact.grips.size:
            grips = grips[: len(self.contact.grips)].copy()
            grips[:, PIECE] = np.clip(np.searchsorted(self._middles, grips[:, AT]), 1, self._middles.size - 1)
            self.contact.grips[: len(grips)], counts.grips = grips, len(grips)


class SelfContact(ContactBooks):
    """Contact of one line with itself; `table` and `call` are for the job of a run."""

    def __init__(self, line: Line, width: Floats, bending: Floats, tension_scale: float, friction: float = 0.0) -> None:
        """Contact of one line with itself.

        width: (N,) m, diameters of cells; bending: (N,) N m2, their stiffness, 0: none; tension_scale: N; friction: its
        coefficient.
        """
        strand = strand_of(line, width, bending, tension_scale)
        contact = contact_of_strands([strand], friction)
        contact.rubs[:] = friction
        super().__init__(contact, 0.5 * (line.s[1:] + line.s[:-1]))
        self._job = Table(blank_contact_job())

    def energy(self) -> float:
        """Energy, J, of contact where work.u has led the state of a run; infinite where strands are in each other."""
        self.call[ASKED] = STAND
        return contact_task(self._table)

    def energy_of(self, line: Line, ends: Ends, state: State) -> float:
        """Energy, J, of contact of a state at rest; 0: nothing touches; infinite: parts are in each other."""
        books = blank_books(line.h.size)._replace(touch=np.zeros((3, line.s.size)))
        self.attach(line, ends, (state, state.copy()), workspace_of(line, keep=True), books)
        return self.energy()

    def count_energy(self, state: State, ends: Ends, report: Floats) -> None:
        """Energy, J, of contact of the state of a run, on other cells now: what travels store counts from here.

        It goes into the report of the state, and what contact does to ends that are held into their forces.
        """
        self._work.u[:] = 0.0
        force, energy = self.force(state), self.energy()
        self.contact.numbers.stored = self.contact.numbers.tried
        count_in(report, energy, force, ends)

    @property
    def deepest(self) -> tuple[int, int]:
        """The nodes beside the nearest point of contact of those looked at last."""
        points = self.contact.points[: self.contact.counts.points]
        row = points[np.argmin(points[:, DISTANCE])]
        return int(row[P]), int(row[Q])

    def force(self, state: State) -> Floats:
        """Forces (N+1, 3) N of contact on the nodes of the state of a run.

        Of friction that on the centre lines; the moments that belong to it come with the next step.
        """
        self._work.u[:] = 0.0
        self.energy()
        return forces_on_nodes(self.contact)

    def watch_nearness(self, horizon: float) -> Floats:
        """From now on steps find how near nodes are to other parts of the line, or will be within `horizon`, s.

        Returns where (N+1,): above 1, nearer than two diameters.
        """
        self.contact.numbers.horizon = horizon
        return self.contact.near

    def set_states(self, old: State, new: State) -> None:
        """The states from which and to which the next step leads, where they do not take turns."""
        self._job.bind(old=old, new=new)

    def attach(self, line: Line, ends: Ends, states: tuple[State, State], work: Work, books: Books) -> np.ndarray:
        """The table of the kernel for a run; `call` has its address then."""
        old, new = states
        self._job.bind(line=line, ends=ends, old=old, new=new, work=work, call=self.call, contact=self.contact)
        self._job.bind(clock=books.clock, counts=books.counts, touch=books.touch)
        self._job.bind(velocity=books.velocity, power=books.power, report=books.report)
        self._table, self._work, self._touch = self._job.numbers, work, books.touch
        self.call[ADDRESS] = contact_task.address(self._table)
        return self._table


# Of the widest line: what lies between the arc lengths of two lines that stand one after the other, in windows.
BETWEEN = 10.0


class TouchingLine(NamedTuple):
    """What contact takes of a line."""

    line: Line
    width: Floats  # (N,) m, diameters of cells
    bending: Floats  # (N,) N m2, their bending stiffness; 0: none
    tension_scale: float  # N
    grows: float = 0.0  # m, by which it may become longer before these arrays are made anew


def _shifted_grips(saved: Mapping[str, Any], shift: Floats) -> Floats:
    """Grips that are saved, of lines whose places in the one line are others by a shift (K,) m."""
    grips: Floats = saved["grips"].copy()
    for column in (AT, FOOT):
        grips[:, column] += shift[np.searchsorted(saved["lows"], grips[:, column], side="right") - 1]
    return grips


class SharedContact(ContactBooks):
    """Contact of lines with each other and, where they may, with themselves."""

    def __init__(self, touching: Touching, strands: Sequence[TouchingLine], rubs: bool = True) -> None:
        """strands: of the lines that may touch, in order; rubs: whether with friction."""
        self.touching, self.lines = touching, touching.lines
        friction = touching.friction if rubs else np.zeros_like(touching.friction)
        contact = contact_of_strands([strand_of(*x[:4]) for x in strands], float(friction.max()))
        contact.meets[:], contact.rubs[:], contact.joined[:] = touching.meets, friction, touching.joined
        nodes = [x.line.s.size for x in strands]
        self.begins = np.concatenate([[0], np.cumsum(nodes)[:-1]]).astype(np.int64)
        gap = BETWEEN * WINDOW * max(float(x.width.max()) for x in strands) + 2.0 * max(x.grows for x in strands)
        lengths = [float(x.line.s[-1] - x.line.s[0]) + gap for x in strands]
        self.starts = np.concatenate([[0.0], np.cumsum(lengths)[:-1]]) - [float(x.line.s[0]) for x in strands]
        self._own = [x.line.s.copy() for x in strands]
        s = self._places(self.starts)
        self._lows = s[self.begins] - 0.5 * gap  # m, between the lines as parts of the one
        h, spin, grows = np.diff(s), np.zeros(s.size - 1, np.int64), any(x.grows for x in strands)
        for begin, x in zip(self.begins, strands, strict=True):
            if grows:  # with the length that is out other places round them
                h[begin : begin + x.line.h.size] = x.line.h
            spin[begin : begin + x.line.spin.size] = x.line.spin
        blank = blank_line(s.size - 1)
        # arc lengths of the nodes of all of them, with gaps between two
        self.line = blank._replace(s=s, h=h, spin=spin.astype(blank.spin.dtype))
        super().__init__(contact, 0.5 * (s[1:] + s[:-1]))
        self._nodes = nodes
        self.beside = np.array([SHARED, 0, 0], np.int64)  # the call of the lines but the last
        self._pushes, self._times = np.zeros((2, s.size, 4)), np.full(2, np.nan)
        self._shares = np.zeros((2, len(nodes), SHARES))
        self.meetings = np.full((len(nodes), len(nodes), MEETING), np.nan)
        self._inner, self._jobs = Table(blank_contact_job), (Table(blank_shared_job), Table(blank_shared_job))
        self._touch = np.zeros((3, s.size))

    def put(self, strands: Sequence[TouchingLine]) -> None:
        """Take these lines, which differ in numbers from those here, on sample points that stay as many."""
        of = [strand_of(*x[:4]) for x in strands]
        for name in ("width", "stiff"):
            getattr(self.contact, name)[:] = np.concatenate([getattr(x, name) for x in of])
        width = self.contact.width
        self.contact.numbers.widest, self.contact.numbers.narrowest = width.max(), width.min()
        self._own = [x.line.s.copy() for x in strands]
        self.line.s[:] = self._places(self.starts)
        self.line.h[:] = np.diff(self.line.s)

    def _places(self, starts: Floats) -> Floats:
        """(N+1,) m, arc lengths of the nodes of all lines as parts of the one that begin there."""
        return np.concatenate([s + start for s, start in zip(self._own, starts, strict=True)])

    def with_lengths(self, lengths: Mapping[int, tuple[Floats, Floats]]) -> Line:
        """The one line, with other arc lengths and lengths of cells, m, of lines by number."""
        line, of = self.line._replace(s=self.line.s.copy(), h=self.line.h.copy()), self.slices()
        for k, (s, h) in lengths.items():
            begin = of[k].start
            line.s[of[k]], line.h[begin : begin + h.size] = s + self.starts[self.lines.index(k)], h
        return line

    @property
    def last(self) -> int:
        """The number of the line at which it is asked."""
        return self.lines[-1]

    def place(self, node: int) -> tuple[int, int]:
        """The number of the line, and its node, of a node of all of them."""
        k = int(self.contact.of[node])
        return self.lines[k], node - int(self.begins[k])

    def slices(self) -> dict[int, slice]:
        """By number of a line: where its nodes are."""
        each = zip(self.lines, self.begins.tolist(), self._nodes, strict=True)
        return {k: slice(begin, begin + count) for k, begin, count in each}

    def watch_nearness(self, horizon: float) -> dict[int, Floats]:
        """From now on steps find how near nodes are to what they may touch, or will be within `horizon`, s.

        Returns where (N+1,), by number of a line: above 1, nearer than two diameters.
        """
        self.contact.numbers.horizon = horizon
        return {k: self.contact.near[nodes] for k, nodes in self.slices().items()}

    # --- of states at rest ---------------------------------------------------------------------------

    def rest_energy(self, works: Sequence[Work]) -> float:
        """Energy, J, of contact of the states that the jobs lead from, at rest.

        works: of all lines.  Infinite: lines are in each other.
        """
        for k in self.lines:
            works[k].u[:] = 0.0
        self.call[ASKED] = STAND
        shared_task(self._jobs[0].numbers)
        numbers = self.contact.numbers
        return float(numbers.energy + (numbers.tried if self.contact.holds.size else 0.0))

    def forces(self) -> dict[int, Floats]:
        """By number of a line: forces (N+1, 3) N of contact, as it was looked at last, on its nodes."""
        found = forces_on_nodes(self.contact)
        return {k: found[nodes] for k, nodes in self.slices().items()}

    def count_energies(self, works: Sequence[Work], ends: Sequence[Ends]) -> None:
        """As SelfContact.count_energy, of all lines that may touch, into the reports of the lines."""
        self.rest_energy(works)
        numbers, shares = self.contact.numbers, self.contact.shares
        numbers.stored = numbers.tried
        for j, (k, force) in enumerate(self.forces().items()):
            count_in(works[k].report, float(shares[j, :SLIP_WITHIN].sum()), force, ends[k])

    @property
    def deepest_pair(self) -> tuple[int, int, int, int, float]:
        """Numbers of the lines and nodes beside the nearest point of contact of those looked at last, distance (m)."""
        points = self.contact.points[: self.contact.counts.points]
        row = points[np.argmin(points[:, DISTANCE])]
        return *self.place(int(row[P])), *self.place(int(row[Q])), float(row[DISTANCE])

    def points_between(self) -> list[tuple[tuple[int, int], tuple[int, int]]]:
        """Of the points of contact looked at last: number of the line and node beside it, on both sides."""
        points = self.contact.points[: self.contact.counts.points]
        return [(self.place(int(row[P])), self.place(int(row[Q]))) for row in points]

    def met(self) -> list[tuple[int, int, float, float, float]]:
        """Two lines each that have met: their numbers, when first (s), and at which arc lengths (m)."""
        found = []
        for a, b in np.argwhere(np.isfinite(self.meetings[:, :, MET])):
            row = self.meetings[a, b]
            s, other = row[MET_S] - self.starts[a], row[MET_OTHER] - self.starts[b]
            found.append((self.lines[a], self.lines[b], float(row[MET]), float(s), float(other)))
        return found

    # --- what goes on from step to step ----------------------------------------------------------------

    def checkpoint(self, t: float) -> dict[str, Any]:
        """What the steps after the time t, s, depend on."""
        latest = int(self._times[1] == t)
        more = {name: x[latest].copy() for name, x in (("pushes", self._pushes), ("shares", self._shares))}
        more |= {"meetings": self.meetings.copy(), "starts": self.starts.copy(), "lows": self._lows.copy()}
        more |= {"h": self.line.h.copy()}
        return super().checkpoint(t) | more

    def restore(self, saved: Mapping[str, Any], t: float = np.nan, remeshed: bool = False) -> None:
        """Go on from `checkpoint` at t, s; remeshed: of lines that had other cells.  ValueError: that cannot be."""
        mine = {"shares": self._shares[0], "meetings": self.meetings}
        mine |= {name: x for name, x in (("starts", self.starts), ("lows", self._lows)) if name in saved}
        if not remeshed:  # else found with the state on its cells of now
            mine |= {"pushes": self._pushes[0]} | ({"h": self.line.h} if "h" in saved else {})
        for name, x in mine.items():
            if saved[name].shape != x.shape:
                raise ValueError(f"contact/{name}: of other lines")
        if remeshed:
            saved = self._shifted(saved)
        elif "starts" in saved:  # of the lengths that lines had when their arrays were made
            self.line.s[:] = self._places(saved["starts"])
            self._middles = 0.5 * (self.line.s[1:] + self.line.s[:-1])
        for name, x in mine.items():
            x[:] = saved[name]
        super().restore(saved, t, remeshed)
        self._times[:] = np.nan if remeshed else t, np.nan

    def copy_from(self, before: SharedContact | None, own: Mapping[int, SelfContact], t: float) -> None:
        """Go on at t, s, from contact of other lines with each other, and of lines with themselves, by number.

        What is known of lines that are here no longer is forgotten.
        """
        places = {k: j for j, k in enumerate(self.lines)}
        shares, meetings, grips = np.zeros_like(self._shares[0]), np.full_like(self.meetings, np.nan), []
        parts = [x.checkpoint(t) for x in (*([before] if before is not None else []), *own.values())]
        if before is not None:
            saved = parts[0]
            then = [j for j, k in enumerate(before.lines) if k in places]
            now = [places[before.lines[j]] for j in then]
            shift = np.full(len(before.lines), np.nan)  # of lines that are gone
            shift[then] = self.starts[now] - saved["starts"][then]
            shares[now], met = saved["shares"][then], saved["meetings"][np.ix_(then, then)]
            met[:, :, MET_S] += shift[then, None]
            met[:, :, MET_OTHER] += shift[then]
            meetings[np.ix_(now, now)] = met
            moved = _shifted_grips(saved, shift)
            grips.append(moved[np.isfinite(moved).all(axis=1)])
        for k, part in zip(own, parts[before is not None :], strict=True):
            rows = part["grips"].copy()
            rows[:, [AT, FOOT]] += self.starts[places[k]]
            grips.append(rows)
        last = parts[0] | {"speed": max(x["speed"] for x in parts), "stored": sum(x["stored"] for x in parts)}
        here = {"starts": self.starts.copy(), "lows": self._lows.copy(), "shares": shares, "meetings": meetings}
        self.restore({**last, **here, "grips": np.concatenate(grips)}, t, remeshed=True)

    def _shifted(self, saved: Mapping[str, Any]) -> dict[str, Any]:
        """What is saved of lines that had other lengths, with the arc lengths that places have in the one line now."""
        shift, meetings = self.starts - saved["starts"], saved["meetings"].copy()
        meetings[:, :, MET_S] += shift[:, None]
        meetings[:, :, MET_OTHER] += shift
        now = {"starts": self.starts.copy(), "lows": self._lows.copy()}
        return {**saved, "grips": _shifted_grips(saved, shift), "meetings": meetings} | now

    def attach(
        self, numbers: NDArray[np.int64], books: Sequence[Books]
    ) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:
        """Table of the one line, and tables for both parities; numbers: (2, L, ..) jobs of all lines, books: theirs."""
        cells, last = self.line.h.size, books[self.last]
        work = no_work()._replace(u=np.zeros((cells + 1, 3)), x=np.zeros((cells + 1, 5)))
        self._inner.bind(line=self.line, ends=no_ends(), old=blank_state(cells), new=blank_state(cells), work=work)
        self._inner.bind(clock=last.clock, counts=np.zeros_like(last.counts), call=self.call, contact=self.contact)
        self._inner.bind(touch=self._touch, velocity=np.zeros((2, 3)))
        self._inner.bind(power=np.zeros_like(last.power), report=np.zeros_like(last.report))
        for job, tables in zip(self._jobs, numbers, strict=True):
            job.bind(tables=tables, lines=np.array(self.lines, np.int64), begins=self.begins, starts=self.starts)
            job.bind(inner=self._inner.numbers, pushes=self._pushes, shares=self._shares)
            job.bind(times=self._times, meetings=self.meetings)
        self.call[ADDRESS] = shared_task.address(self._jobs[0].numbers)
        return self._inner.numbers, (self._jobs[0].numbers, self._jobs[1].numbers)
