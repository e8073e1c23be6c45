"""Contact of a line with itself: its arrays for a line, and the table of its kernel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from hybrid.kernels.contact.self_contact import blank_contact_job, contact_task
from hybrid.kernels.contact.self_contact_energy import observe_coupled
from hybrid.kernels.contact.self_contact_friction import AT, GRIP, HELD, PIECE
from hybrid.kernels.contact.self_contact_law import DISTANCE, FIRST, FORCE, LAST, NORMAL, WX, WY, P, Q
from hybrid.kernels.contact.self_contact_pairs import (
    Contact,
    blank_contact,
)
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.run import entry
from hybrid.kernels.run.entry import block_rows, out_of_balance
from hybrid.kernels.state.books import Books, blank_books
from hybrid.kernels.state.report import FORCE_A, NET_A, ROTARY, SELF_CONTACT_ENERGY
from hybrid.kernels.state.state import (
    Ends,
    Floats,
    Line,
    Sea,
    State,
    Work,
    blank_line,
    blank_state,
    no_ends,
)
from hybrid.kernels.step.newton import ADDRESS, ASKED, NEAR, REST
from hybrid.solve.stepper import workspace_of

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
    if entry.assembly(line, sea, ends, state, 0.0, anchor, work._replace(rows=rows)) >= 0:
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
    couples: bool  # whether tension makes a torque in it


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
    return Strand(
        widths, np.maximum(np.ceil(lengths / (SPACING * widths)), 1),
        np.maximum(STIFFNESS * bends / widths**2, TENSION * tension_scale * (bends == 0.0)),
        line.mass / pieces, float(bool(line.bits & ROTARY) or holds_twist), line.tension_twist.size > 0,
    )  # fmt: skip


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
    if any(x.couples for x in strands):
        one = blank_line(1), no_ends(), blank_state(1), blank_contact(1)
        contact.observer[0] = observe_coupled.address(*one, 0, 0)
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
        return {
            "speed": float(numbers.speed), "faded": float(numbers.faded), "quiet": float(numbers.quiet),
            "stored": stored, "grips": grips.copy(), "remeshed": bool(counts.remeshed) and not latest,
            "touch": self._touch[0].copy(), "samples": contact.samples.copy(), "mass": contact.mass.copy(),
            "energy": self._energy_at(t),
        }  # fmt: skip

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
        self.call[ASKED] = REST
        energy: float = contact_task(self._table)
        return energy

    def energy_of(self, line: Line, ends: Ends, state: State) -> float:
        """Energy, J, of contact of a state at rest; 0: nothing touches; infinite: parts are in each other."""
        books = blank_books(line.h.size)._replace(touch=np.zeros((3, line.s.size)))
        self.attach(line, ends, (state, state.copy()), workspace_of(line, keep=True), books)
        return self.energy()

    def count_energy(self, state: State, ends: Ends, report: Floats) -> float:
        """Energy, J, of contact of the state of a run, on other cells now: what travels store counts from here.

        It goes into the report of the state, and what contact does to ends that are held into their forces.
        """
        self._work.u[:] = 0.0
        force, energy = self.force(state), self.energy()
        self.contact.numbers.stored = self.contact.numbers.tried
        report[SELF_CONTACT_ENERGY] = energy
        for k in np.flatnonzero(ends.held):  # 0 or 1: the first or the last node
            for at in (FORCE_A + 3 * k, NET_A + 3 * k):
                report[at : at + 3] += force[-k]
        return energy

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

    def attach(
        self, line: Line, ends: Ends, states: tuple[State, State], work: Work, books: Books, sea: Sea | None = None
    ) -> np.ndarray:
        """The table of the kernel for a run; `call` has its address then.  sea: where sheaves turn with the line."""
        old, new = states
        if sea is not None and sea.rolling.size:
            self._job.bind(carried=sea.carried, rolling=sea.rolling)
        self._job.bind(
            line=line, ends=ends, old=old, new=new, work=work, clock=books.clock, counts=books.counts, call=self.call,
            contact=self.contact, touch=books.touch, velocity=books.velocity, power=books.power, report=books.report,
        )  # fmt: skip
        self._table, self._work, self._touch = self._job.numbers, work, books.touch
        self.call[ADDRESS] = contact_task.address(self._table)
        return self._table
