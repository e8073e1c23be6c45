"""Contact of several lines of a system with each other: their arrays as one line, and the tables of its kernel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.contact.self_contact import blank_contact_job
from hybrid.kernels.contact.self_contact_friction import AT, FOOT
from hybrid.kernels.contact.self_contact_law import DISTANCE, P, Q
from hybrid.kernels.contact.self_contact_pairs import (
    SHARES,
    SLIP_WITHIN,
    WINDOW,
)
from hybrid.kernels.junctions.shared_contact import MEETING, MET, MET_OTHER, MET_S, blank_shared_job, shared_task
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.state.books import Books
from hybrid.kernels.state.report import FORCE_A, NET_A, SELF_CONTACT_ENERGY
from hybrid.kernels.state.state import Ends, Floats, Line, Work, blank_line, blank_state, no_ends, no_work
from hybrid.kernels.step.newton import ADDRESS, ASKED, REST, SHARED
from hybrid.model.lines_contact import Touching
from hybrid.solve.self_contact import ContactBooks, SelfContact, contact_of_strands, forces_on_nodes, strand_of

# Of the widest line: what lies between the arc lengths of two lines that stand one after the other, in windows.
BETWEEN = 10.0


class TouchingLine(NamedTuple):
    """What contact takes of a line."""

    line: Line
    width: Floats  # (N,) m, diameters of cells
    bending: Floats  # (N,) N m2, their bending stiffness; 0: none
    tension_scale: float  # N
    grows: float = 0.0  # m, by which it may become longer before these arrays are made anew


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
        self._line = blank._replace(s=s, h=h, spin=spin.astype(blank.spin.dtype))
        super().__init__(contact, 0.5 * (s[1:] + s[:-1]))
        self._nodes = nodes
        self.beside = np.array([SHARED, 0, 0], np.int64)  # the call of the lines but the last
        self._pushes, self._times = np.zeros((2, s.size, 4)), np.full(2, np.nan)
        self._shares = np.zeros((2, len(nodes), SHARES))
        self.meetings = np.full((len(nodes), len(nodes), MEETING), np.nan)
        self._inner, self._jobs = Table(blank_contact_job), (Table(blank_shared_job), Table(blank_shared_job))
        self._touch = np.zeros((3, s.size))

    @property
    def s(self) -> Floats:
        """(N+1,) m, arc lengths of the nodes of all of them, with gaps between two."""
        return self._line.s

    def put(self, strands: Sequence[TouchingLine]) -> None:
        """Take these lines, which differ in numbers from those here, on sample points that stay as many."""
        of = [strand_of(*x[:4]) for x in strands]
        for name in ("width", "stiff"):
            getattr(self.contact, name)[:] = np.concatenate([getattr(x, name) for x in of])
        width = self.contact.width
        self.contact.numbers.widest, self.contact.numbers.narrowest = width.max(), width.min()
        self._own = [x.line.s.copy() for x in strands]
        self._line.s[:] = self._places(self.starts)
        self._line.h[:] = np.diff(self._line.s)

    def _places(self, starts: Floats) -> Floats:
        """(N+1,) m, arc lengths of the nodes of all lines as parts of the one that begin there."""
        return np.concatenate([s + start for s, start in zip(self._own, starts, strict=True)])

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
        self.call[ASKED] = REST
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
            report = works[k].report
            report[SELF_CONTACT_ENERGY] = float(shares[j, :SLIP_WITHIN].sum())
            for end in np.flatnonzero(ends[k].held):
                for at in (FORCE_A + 3 * end, NET_A + 3 * end):
                    report[at : at + 3] += force[-end]

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
        return super().checkpoint(t) | more

    def restore(self, saved: Mapping[str, Any], t: float = np.nan, remeshed: bool = False) -> None:
        """Go on from `checkpoint` at t, s; remeshed: of lines that had other cells.  ValueError: that cannot be."""
        mine = {"shares": self._shares[0], "meetings": self.meetings}
        mine |= {name: x for name, x in (("starts", self.starts), ("lows", self._lows)) if name in saved}
        mine |= {} if remeshed else {"pushes": self._pushes[0]}  # else found with the state on its cells of now
        for name, x in mine.items():
            if saved[name].shape != x.shape:
                raise ValueError(f"contact/{name}: of other lines")
        if remeshed:
            saved = self._shifted(saved)
        elif "starts" in saved:  # of the lengths that lines had when their arrays were made
            self._line.s[:] = self._places(saved["starts"])
            self._middles = 0.5 * (self._line.s[1:] + self._line.s[:-1])
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
            grips.append(saved["grips"].copy())
            for column in (AT, FOOT):
                of = np.searchsorted(saved["lows"], grips[0][:, column], side="right") - 1
                grips[0][:, column] += shift[of]
            grips[0] = grips[0][np.isfinite(grips[0]).all(axis=1)]
        for k, part in zip(own, parts[before is not None :], strict=True):
            rows = part["grips"].copy()
            rows[:, [AT, FOOT]] += self.starts[places[k]]
            grips.append(rows)
        last = parts[0] | {"speed": max(x["speed"] for x in parts), "stored": sum(x["stored"] for x in parts)}
        here = {"starts": self.starts.copy(), "lows": self._lows.copy(), "shares": shares, "meetings": meetings}
        self.restore({**last, **here, "grips": np.concatenate(grips)}, t, remeshed=True)

    def _shifted(self, saved: Mapping[str, Any]) -> dict[str, Any]:
        """What is saved of lines that had other lengths, with the arc lengths that places have in the one line now."""
        shift, grips, meetings = self.starts - saved["starts"], saved["grips"].copy(), saved["meetings"].copy()
        for column in (AT, FOOT):
            of = np.searchsorted(saved["lows"], grips[:, column], side="right") - 1
            grips[:, column] += shift[of]
        meetings[:, :, MET_S] += shift[:, None]
        meetings[:, :, MET_OTHER] += shift
        now = {"starts": self.starts.copy(), "lows": self._lows.copy()}
        return {**saved, "grips": grips, "meetings": meetings} | now

    def attach(
        self, numbers: NDArray[np.int64], joints: NDArray[np.int64], books: Sequence[Books]
    ) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:
        """Table of the one line, and tables for both parities; numbers: (2, L, ..) jobs of all lines, books: theirs."""
        cells, last = self._line.h.size, books[self.last]
        work = no_work()._replace(u=np.zeros((cells + 1, 3)), x=np.zeros((cells + 1, 5)))
        self._inner.bind(
            line=self._line, ends=no_ends(), old=blank_state(cells), new=blank_state(cells), work=work,
            clock=last.clock, counts=np.zeros_like(last.counts), call=self.call, contact=self.contact,
            touch=self._touch, velocity=np.zeros((2, 3)), power=np.zeros_like(last.power),
            report=np.zeros_like(last.report),
        )  # fmt: skip
        for job, tables in zip(self._jobs, numbers, strict=True):
            job.bind(
                tables=tables, lines=np.array(self.lines, np.int64), begins=self.begins, starts=self.starts,
                joints=joints, inner=self._inner.numbers, pushes=self._pushes, shares=self._shares,
                times=self._times, meetings=self.meetings,
            )  # fmt: skip
        self.call[ADDRESS] = shared_task.address(self._jobs[0].numbers)
        return self._inner.numbers, (self._jobs[0].numbers, self._jobs[1].numbers)
