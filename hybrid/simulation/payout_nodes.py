"""Nodes that enter and leave at a winch without Python's help: on arrays with room for the longest line.

Two sets of arrays take turns: a change goes from one to the other (run.payout_run), and the tables of the run get
the numbers of the other one.  What Python has of the line is made anew when the run comes back to it (`sync`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from hybrid.kernels.contact.self_distance import blank_itself, blank_itself_job, boxes_of
from hybrid.kernels.machine.binding import Packed, Room, Table
from hybrid.kernels.mesh.cell_changes import after_forces, before_forces
from hybrid.kernels.reel.payout import stand_still
from hybrid.kernels.reel.payout_nodes import CarryJob, blank_carry_job, carry_node
from hybrid.kernels.reel.reel import Reel, blank_reel, blank_reel_job
from hybrid.kernels.run import payout_run as f
from hybrid.kernels.run.entry import NO_PUSH, workspace
from hybrid.kernels.run.network import begin_line
from hybrid.kernels.run.payout_run import NodeJob, blank_line_job, blank_node_job, blank_paid_run_job, make_line
from hybrid.kernels.state import books as b
from hybrid.kernels.state.books import Books
from hybrid.kernels.state.report import REMEMBERS
from hybrid.kernels.state.state import (
    NO_GRIP,
    NO_PEAK,
    NO_SHEAVES,
    NO_SLOW,
    NO_SOIL,
    NO_TENSION_TORQUE,
    NO_TORSION,
    NO_TURN,
    NO_WAKE,
    TENSION_TORQUE,
    Batch,
    Floats,
    Line,
    Sea,
    State,
    Work,
)
from hybrid.kernels.step.job import blank_job
from hybrid.kernels.step.newton import RUN, Task
from hybrid.model.line import lines
from hybrid.outputs.joined_lines import Output
from hybrid.simulation.cell_changes import REST_OF_SEA, Kept, Shaped, blank_kept, copy_fields, seas
from hybrid.simulation.envelope import marks_on
from hybrid.simulation.line_of_run import OfRun, OneOfMany, by_itself, ends_alone
from hybrid.solve.stepper import HEAVY
from hybrid.zones.change import states

# Of the tables of a run, what depends on the cells.
IN_RUN = ("line", "sea", "old", "new", "was", "now", "work", "books")
IN_PAID = ("line", "sea", "old", "new", "report", "reel", "X", "W")
IN_ITSELF = ("line", "old", "new", "itself")
OF_REEL = ("law", "pieces", "winch", "layer")  # what all reels of a line share
ABSENT: dict[str, Floats] = {"torsion": NO_TORSION} | dict.fromkeys(TENSION_TORQUE, NO_TENSION_TORQUE)
MOST_WAITING = 512  # lines whose outputs may wait


class Pushes(NamedTuple):
    """A push out of the plane, and room for the next."""

    push: Floats
    next_push: Floats


class Side:
    """One of the two sets of arrays."""

    def __init__(self, most: int, reels: Packed, kept: Packed) -> None:
        self.line, self.reel, self.kept = Room(lines, most), Room(reels, most), Room(kept, most)
        self.states = Room(states, most), Room(states, most)
        self.pushes = Room(Packed(lambda n: Pushes(np.zeros((n + 1, 4)), np.zeros((n + 1, 4)))), most)


class NodeChanges:
    """Nodes of a line of a run that enter and leave, where zones stay, with the solver that it has now."""

    def __init__(self, run: OfRun, number: int) -> None:
        """Room for all; `adopt` before the first change."""
        self._of_run, self._of_line, self._solver = run, run.lines[number], run.solver
        self._owner = owner = OneOfMany(run, number)
        assert owner.payout is not None
        self._paying = owner.payout
        self._fixed_to = self._key(owner)
        plan, model, reel, damped = owner.payout.plan, owner.model, owner.payout.reel, owner.payout.damped
        self.most = owner.payout.most_cells
        some, twice = owner.envelope is not None, owner.payout.solves_twice
        extra = int((marks_on(model.line.s, owner.marked) != 0).sum())
        shared = reel.law, reel.pieces, reel.winch, reel.layer, twice, damped
        reels = Packed(lambda n: blank_reel(n, *shared), given=OF_REEL)
        kept = Packed(lambda n: blank_kept(n, extra, some))
        self._sides = Side(self.most, reels, kept), Side(self.most, reels, kept)
        self._sea = Room(seas, self.most)
        self._work = Room(Packed(partial(workspace, keep=twice), given=("torsion",)), self.most)
        # for what cells lack whose outputs wait; some MB, of which a run with few outputs touches little
        self._lacks = np.empty(MOST_WAITING * f.OF_REEL * self.most)
        self._watch = owner.itself if owner.itself is not None and owner.itself.on else None
        self._itself = blank_itself(np.zeros(self.most))
        self._base = np.zeros(owner.books.base.size, np.int64)
        self._calls, self._at = f.PaidCalls(), f.PaidPlaces()
        self._waiting = np.zeros((MOST_WAITING, 3), np.int64)
        self._following, self._line_table = Table(blank_paid_run_job()), Table(blank_line_job())
        self._whole = plan.whole_line(model.line, plan.held_as(model.cable))
        self.adopted, self._synced, self._bound = False, -1, False

    @staticmethod
    def _key(owner: OneOfMany) -> tuple[Any, ...]:
        """What the tables hold as it is."""
        model, paying = owner.model, owner.payout
        assert paying is not None
        same = id(model.line.plane), id(model.ends), id(paying.reel.law), id(owner.envelope)
        return model.line.bits, bool(owner.push.size), *same

    @staticmethod
    def may_change(run: OfRun, number: int) -> bool:
        """Whether nodes of a line can enter and leave so in a run whose solver is attached."""
        model, line = run.model.models[number], run.lines[number]
        stays = model.layout is None and line.paying is not None and not line.paying.ended
        return stays and by_itself(run, number) and is_plain(model.line)

    @property
    def fits(self) -> bool:
        """Whether the line is solved by what the arrays were made for."""
        watched = self._owner.itself.table if self._owner.itself is not None else None
        same = self._solver is self._of_run.solver and self._of_line.watch_table is watched
        return bool(same and self._fixed_to == self._key(self._owner))

    @property
    def job(self) -> np.ndarray:
        """The table of kernels.run.payout_run that the compiled steps get."""
        self._at.may_wait = self._owner.outputs_may_wait
        return self._following.numbers

    def change(self) -> None:
        """A node enters or leaves now."""
        f.change_node(self._following.numbers)
        self.sync()

    @property
    def cells(self) -> int:
        """Cells of the line now."""
        return int(self._at.cells)

    @property
    def waits(self) -> bool:
        """Whether there are outputs of lines of before."""
        return bool(self._at.waiting)

    # --- arrays -------------------------------------------------------------------------------------

    def _line(self, k: int, cells: int) -> Line:
        line = self._owner.model.line
        found: Line = self._sides[k].line.view(cells, bits=line.bits, plane=line.plane, **ABSENT)
        return found

    def _state(self, k: int, which: int, cells: int) -> State:
        absent = {"turn": NO_TURN, "slow": NO_SLOW, "wake": NO_WAKE, "peak": NO_PEAK}
        absent |= {"grip": NO_GRIP, "sheave": NO_SHEAVES, "soil": NO_SOIL}
        found: State = self._sides[k].states[which].view(cells, **absent)
        return found

    def _reel(self, k: int, cells: int) -> Reel:
        now = self._paying.reel
        found: Reel = self._sides[k].reel.view(cells, **{name: getattr(now, name) for name in OF_REEL})
        return found

    def _push(self, k: int, which: int, cells: int) -> Floats:
        """Of a run that carries one, else none."""
        if not self._owner.push.size:
            return NO_PUSH
        found: Floats = self._sides[k].pushes.view(cells)[which]
        return found

    def _sea_on(self, cells: int) -> Sea:
        values = self._owner.model.sea.values
        found: Sea = self._sea.view(cells, **{x: getattr(values, x) for x in REST_OF_SEA})
        return found

    def _work_on(self, cells: int) -> Work:
        found: Work = self._work.view(cells, torsion=self._owner.stepper.work.torsion)
        return found

    def _books(self, k: int, cells: int) -> Books:
        kept = self._sides[k].kept.view(cells)._asdict()
        return self._owner.books._replace(base=self._base, **kept)

    # --- tables -------------------------------------------------------------------------------------

    def _node_job(self, k: int, parity: int, n: int, m: int) -> dict[str, Any]:
        """What a change from n cells, in the arrays of side k, to m is bound to."""
        owner, to = self._owner, 1 - k
        before = self._books(k, n)
        carry = CarryJob(
            self._line(k, n), self._line(to, m), self._state(k, parity, n), self._state(to, 0, m), self._reel(k, n),
            self._reel(to, m), self._owner.clock, before.tension, self._paying.plan.nodes,
        )  # fmt: skip
        job = NodeJob(
            carry, self._whole, owner.model.ends.values, self._sea_on(m), self._work_on(m), self._state(to, 1, m),
            before, self._books(to, m), self._push(k, parity, n), self._push(to, 0, m), self._push(to, 1, m),
            self._width(m), self._itself.cells, *self._along, *self._moments, owner.model.tension_scale,
        )  # fmt: skip
        return job._asdict()

    def _in_run(self, k: int, _: int, m: int) -> dict[str, Any]:
        return {
            "line": self._line(k, m), "sea": self._sea_on(m), "old": self._state(k, 0, m), "new": self._state(k, 1, m),
            "was": self._push(k, 0, m), "now": self._push(k, 1, m), "work": self._work_on(m),
            "books": self._books(k, m),
        }  # fmt: skip

    def _in_odd(self, k: int, _: int, m: int) -> dict[str, Any]:
        found = self._in_run(k, _, m)
        return found | {"old": found["new"], "new": found["old"]}

    def _in_paid(self, k: int, _: int, m: int) -> dict[str, Any]:
        work = self._work_on(m)
        return {
            "line": self._line(k, m), "sea": self._sea_on(m), "old": self._state(k, 0, m), "new": self._state(k, 1, m),
            "report": work.report, "reel": self._reel(k, m), "X": work.X, "W": work.W,
        }  # fmt: skip

    def _width(self, cells: int) -> Floats:
        """Diameters of cells; none where nobody watches whether the line meets itself."""
        return self._itself.width[: cells if self._watch is not None else 0]

    def _in_itself(self, k: int, _: int, m: int) -> dict[str, Any]:
        states = self._state(k, 0, m), self._state(k, 1, m)
        itself = self._itself._replace(width=self._itself.width[:m])
        return {"line": self._line(k, m), "old": states[0], "new": states[1], "itself": itself}

    def _bind_all(self) -> None:
        """Tables of changes from either side to the other, and of runs on either."""
        owner, paying = self._owner, self._paying
        envelope, plan, most = self._owner.envelope, paying.plan, self.most + 2
        borne = np.ascontiguousarray(1.0 + plan.cable.max_strain[:: 1 if plan.side else -1])
        start, bounds = np.zeros((plan.nodes.size, 3)), np.zeros((4, b.EXTREMES, 1))
        if envelope is not None:
            start, bounds = envelope.start, envelope.bounds
        widths = np.ascontiguousarray(plan.cable.outer_diameter[:: 1 if plan.side else -1])
        self._along = borne, widths, start, bounds
        self._moments = np.zeros((most, 3)), np.zeros((most, 3)), np.zeros(5)

        def shaped(
            blank: Callable[[], Any], values: Callable[..., dict[str, Any]], *of: tuple[int, ...]
        ) -> list[Shaped]:
            """Tables of arrays of the same shapes, that differ by their addresses."""
            found: list[Shaped] = []
            for which in of:
                found.append(Shaped(Table(blank), partial(values, *which), *found[:1]))
            return found

        of_run = shaped(blank_job, self._in_run, (0,), (1,))
        of_paid = shaped(blank_reel_job, self._in_paid, (0,), (1,))
        nodes = shaped(blank_node_job, self._node_job, (0, 0), (0, 1), (1, 0), (1, 1))
        of_itself: list[Shaped] = []
        in_itself, itself, tables = np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((2, 3, 0), np.int64)
        if self._watch is not None:
            of_itself = shaped(blank_itself_job, self._in_itself, (0,), (1,))
            in_itself, itself = of_itself[0].places(IN_ITSELF), self._watch.table.numbers
            tables = np.array([x.numbers[:, in_itself] for x in of_itself])
        of_odd = shaped(blank_job, self._in_odd, (0,), (1,))
        self._tables = of_run, of_paid, of_itself, nodes, of_odd  # what is bound there stays alive
        in_run, in_paid = of_run[0].places(IN_RUN), of_paid[0].places(IN_PAID)
        numbers: dict[str, Any] = {
            "calls": self._calls, "at": self._at, "clock": owner.clock, "own": owner.books.clock, "counts": owner.count,
            "winch": paying.reel.winch, "first": self._reel(0, self.most), "second": self._reel(1, self.most),
            "run": owner.table.numbers, "run_places": in_run,
            "in_run": np.array([x.numbers[:, in_run] for x in of_run]),
            "paid": paying.table.numbers, "paid_places": in_paid,
            "in_paid": np.array([x.numbers[:, in_paid] for x in of_paid]), "node": nodes[0].table.numbers,
            "itself": itself, "itself_places": in_itself,
            "in_itself": tables,
            "nodes": np.array([x.numbers for x in nodes]), "waiting": self._waiting, "room": self._lacks,
        }  # fmt: skip
        self._following.bind(**numbers)
        at = self._at
        at.task = owner.table.part("task").start
        if self._watch is not None:
            tree = self._itself.tree.__array_interface__["data"][0]
            at.boxes_at = 1 + int(np.flatnonzero(of_itself[0].numbers[0] == tree)[0])
        self._bind_calls(of_run, of_odd, nodes[0].table)

    def _bind_calls(self, of_run: list[Shaped], of_odd: list[Shaped], node: Table) -> None:
        """Addresses of what a change calls; of_odd: what the table of odd steps gets."""
        owner, paying = self._owner, self._paying
        calls: dict[str, tuple[Any, Any]] = {
            "change": (f.change_line, node), "carry": (carry_node, Table(blank_carry_job)),
            "fit": (f.fit_changed, node), "book": (f.book_change, node), "renew": (f.renew_run, node),
            "before_forces": (before_forces, owner.table), "stand_still": (stand_still, paying.table),
            "after_forces": (after_forces, owner.table), "books": (begin_line, owner.table),
        }  # fmt: skip
        in_run = of_run[0].places(IN_RUN)
        in_odd = np.array([x.numbers[:, in_run] for x in of_odd])
        self._following.bind(even=owner.table.even.numbers, odd=owner.table.odd.numbers, in_odd=in_odd)
        for name, (kernel, table) in calls.items():
            setattr(self._calls, name, kernel.address(table.numbers))

    # --- steps --------------------------------------------------------------------------------------

    def adopt(self) -> None:
        """Go on with the line of the run as it is now, in these arrays."""
        owner, model, n = self._owner, self._owner.model, self._owner.model.cells
        if not self._bound:
            self._bind_all()
            self._bound = True
        self._at.on, self._at.cells = 0, n
        parity = int(owner.count.parity)
        for which in (0, 1):
            copy_fields(owner.states[which], self._state(0, which, n), ("turn",))
            if owner.push.size:
                self._push(0, which, n)[:] = owner.pushes[which]
        copy_fields(model.line, self._line(0, n), ("bits", "plane", "torsion", *TENSION_TORQUE))
        copy_fields(model.sea.values, self._sea_on(n), REST_OF_SEA)
        copy_fields(owner.stepper.work, self._work_on(n), ("W", "X", "x", "torsion", "gaps", "rows"))
        copy_fields(self._paying.reel, self._reel(0, n), OF_REEL)
        self._base[:] = owner.books.base
        if self._watch is not None:
            copy_fields(self._watch.itself, self._itself._replace(width=self._width(n)), ("tree", "stack"))
        copy_fields(owner.books, self._books(0, n), tuple(x for x in Books._fields if x not in Kept._fields))
        owner.table.bind(task=Task(RUN, ca=HEAVY, limits=owner.stepper.limits))
        self._calls.solver = owner.solver_address()
        f.put_paid(self._following.numbers)
        self.adopted, self._synced = True, -1
        owner.count.parity = parity
        self.sync()

    def sync(self) -> None:
        """What Python has of the line is that of now."""
        if self._at.changes == self._synced:
            return
        self._synced = int(self._at.changes)
        owner, paying, k, n = self._owner, self._paying, int(self._at.on), self.cells
        line, sea, work, books, reel = (
            self._line(k, n), self._sea_on(n), self._work_on(n), self._books(k, n), self._reel(k, n),
        )  # fmt: skip
        now, length = sea.now.copy(), float(line.s[-1] - line.s[0])
        around = owner.model.sea.with_values(sea)
        model = replace(owner.model, line=line, zones=paying.plan.zones_of(length), sea=around, length=length)
        sea.now[:] = now
        paying.count, paying.reel = n - paying.rides, reel
        old, new = self._state(k, 0, n), self._state(k, 1, n)
        owner.books, owner.states = books, (old, new)
        owner.pushes = self._push(k, 0, n), self._push(k, 1, n)
        owner.table.hold(
            line=line, sea=sea, old=old, new=new, was=owner.pushes[0], now=owner.pushes[1], work=work, books=books,
        )  # fmt: skip
        paying.table.hold(line=line, sea=sea, old=old, new=new, report=work.report, reel=reel, X=work.X, W=work.W)
        owner.take(model, work)
        if self._watch is not None:
            tree = self._itself.tree[: boxes_of(n)]
            itself = self._watch.itself = self._itself._replace(width=self._width(n), tree=tree)
            self._watch.table.hold(line=line, old=old, new=new, itself=itself)

    # --- outputs that wait --------------------------------------------------------------------------

    def _outputs_of(self, batch: Batch, cells: int, at: int) -> list[Output]:
        """Outputs of a line of before, of so many cells; at: where what they lacked is kept."""
        k, paying, model = int(self._at.on), self._paying, self._owner.model
        lacks = self._lacks[at : at + f.OF_REEL * cells].reshape(f.OF_REEL, cells)
        line, reel = lines(cells, bits=model.line.bits, plane=model.line.plane, **ABSENT), self._reel(1 - k, cells)
        reel.numbers[:] = paying.reel.numbers
        self._line_table.bind(line=model.line, whole=self._whole, out=line, reel=reel, nodes=paying.plan.nodes)
        make_line(self._line_table.numbers)
        reel.lack[:], reel.rate[:], reel.since[:], reel.span[:] = lacks
        return paying.outputs_in(line, reel, batch)

    def outputs(self, rows: Floats) -> tuple[list[Output], Batch]:
        """All outputs that wait, in rows, copied, each with its line; and what they have at the ends."""
        model, begin, found, batches = self._owner.model, 0, list[Output](), list[Batch]()
        for first, count, cells in self._waiting[: self._at.waiting].tolist():
            batches.append(self._of_line.batch_of(rows[first : first + count], cells))
            found += self._outputs_of(batches[-1], cells, begin)
            begin += f.OF_REEL * cells
        if len(rows) > self._at.used:
            batches.append(self._of_line.batch_of(rows[self._at.used :], model.cells))
            found += self._paying.outputs_of_now(model.line, batches[-1])
        self._at.waiting = self._at.placed = self._at.used = 0
        return found, ends_alone(batches)


def is_plain(line: Line) -> bool:
    """Whether a line has nothing that a node which enters or leaves would have to carry in Python."""
    laws = "torsion", "tension_twist", "law", "bend_law", "slip_law", "wake_law", "moved"
    return not any(getattr(line, name).size for name in laws) and not line.bits & REMEMBERS
