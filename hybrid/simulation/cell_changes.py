"""Cells, and kinds of cells, that change between two steps of a run without Python's help: on arrays with room for all.

Two sets of arrays take turns: a change goes from one to the other (mesh.cell_changes), and the tables of the run get
the numbers of the other one.  What Python has of the line is made anew when the run comes back to it (`sync`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from hybrid.kernels.contact.self_distance import Itself, blank_itself, blank_itself_job, boxes_of
from hybrid.kernels.machine.binding import Packed, Room, Table
from hybrid.kernels.mesh import zone_step as z
from hybrid.kernels.mesh.cell_changes import (
    after_forces,
    before_forces,
    blank_layout_job,
    blank_renew_job,
    clear_state,
    lay_out,
    renew,
)
from hybrid.kernels.mesh.zone_line import blank_kinds_job, blank_line_job, fill_kinds, fill_line
from hybrid.kernels.mesh.zone_step import Zones, blank_zone_job
from hybrid.kernels.mesh.zone_switch import AFTER, BEFORE, NUMBERS, begin_switch, blank_switch_job, end_switch
from hybrid.kernels.mesh.zone_transfer import Match, Transfer
from hybrid.kernels.run import following_run as f
from hybrid.kernels.run.entry import NO_PUSH, workspace
from hybrid.kernels.run.following_run import FollowingPlaces
from hybrid.kernels.run.network import begin_line
from hybrid.kernels.state import books as b
from hybrid.kernels.state.books import Books
from hybrid.kernels.state.report import PLANAR, REMEMBERS
from hybrid.kernels.state.state import (
    NO_GRIP,
    NO_PEAK,
    NO_SHEAVES,
    NO_SLOW,
    NO_SOIL,
    NO_TENSION_TORQUE,
    NO_TORSION,
    NO_WAKE,
    TENSION_TORQUE,
    Batch,
    Floats,
    Line,
    Sea,
    State,
    Work,
    no_sea,
)
from hybrid.kernels.step.job import blank_job
from hybrid.kernels.step.newton import RUN, Task
from hybrid.model.build import Model
from hybrid.model.layout import kinds_of
from hybrid.model.line import lines
from hybrid.model.material import LEAST_TENSION, TENSION_FLOOR
from hybrid.outputs.joined_lines import Output, outputs_in
from hybrid.simulation.envelope import marks_on
from hybrid.simulation.line_of_run import OfRun, OneOfMany, by_itself, ends_alone
from hybrid.solve.stepper import HEAVY
from hybrid.zones.change import ZoneSwitching, states
from hybrid.zones.manager import OF_BASE, all_zones
from hybrid.zones.plan import Change

LEAST_CELLS = 3  # with which tables are made
# Of the tables of a run, what depends on the cells.
IN_RUN = ("line", "sea", "old", "new", "was", "now", "work", "books")
IN_ZONES = ("line", "sea", "old", "new", "zones")
IN_ITSELF = ("line", "old", "new", "itself")
# Lines whose outputs may wait, and their nodes in all.
MOST_WAITING, MOST_PLACES = 256, 20_000


def carries_all(model: Model, switching: ZoneSwitching) -> bool:
    """Whether kinds of a line can change in compiled code: nothing that they would carry is left out there."""
    line = model.line
    laws = line.torsion, line.tension_twist, line.law, line.bend_law, line.wake_law, line.moved
    bare = switching.compiled and model.payout is None and not any(x.size for x in laws)
    return bare and bool(line.bits & PLANAR or not switching.manager.twisted)


class CellChanges:
    """Changes of the cells of a line of a run, and of what is rod, with the solver that it has now."""

    alone = True  # whether cells change without a return to Python

    def __init__(self, run: OfRun, number: int, switching: ZoneSwitching) -> None:
        """Room for all; `adopt` before the first change."""
        self._of_run, self._line, self._solver = run, run.lines[number], run.solver
        owner = OneOfMany(run, number, switching)
        assert owner.model.layout is not None
        self._owner, self._switching = owner, switching
        self._fixed_to = self._key(owner)
        model, manager, layout = owner.model, switching.manager, owner.model.layout
        self.most, self.base = int(layout.starts[-1]), int(layout.rod.size)
        self._starts = layout.starts
        self._finest, self._piece = layout.finest.nodes, model.cable.piece(0.5 * (layout.base[1:] + layout.base[:-1]))
        self._marked = marks_on(layout.base, owner.marked)
        extra = int((self._marked != 0).sum())
        self._calls, self._at = f.FollowingCalls(), f.FollowingPlaces()
        self._on = CellViews(owner, self.most, extra, self._at)
        self._numbers = np.zeros(NUMBERS)
        self._watch = owner.itself if owner.itself is not None and owner.itself.on else None
        self._twist, self._clamps, self._held = np.zeros(self.base), np.zeros((2, 2, 3)), np.zeros(2, bool)
        self._stays = np.zeros(self.most + 1, np.int64)
        self._spare = np.zeros(4 * b.EXTREMES * (self.most + 1 + extra))
        self._match = Room(Packed(blank_joined), self.most), Room(Packed(blank_single), self.most)
        self._following = Table(f.blank_following_job)
        self._waiting, self._places = np.zeros((MOST_WAITING, 3), np.int64), np.zeros(MOST_PLACES, np.int64)
        self.adopted, self._synced = False, -1  # number of changes that Python knows of
        self._shifts = np.zeros(1, bool)
        self._bound = False
        self._tension_floor = TENSION_FLOOR, LEAST_TENSION * manager.scale

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
        """Whether there are outputs of cells of before."""
        return bool(self._at.waiting)

    @property
    def _stale(self) -> bool:
        return bool(self._at.changes != self._synced)

    @staticmethod
    def _key(owner: OneOfMany) -> tuple[Any, ...]:
        """What the tables hold as it is."""
        model = owner.model
        return id(model.on_base), model.line.bits, id(model.line.plane), id(model.ends), bool(owner.push.size)

    @staticmethod
    def may_change(run: OfRun, number: int, switching: ZoneSwitching) -> bool:
        """Whether cells of a line can change so in a run whose solver is attached."""
        if not switching.zones.clock.share > 0.0 or run.payout is not None or not by_itself(run, number):
            return False
        model = run.model.models[number]
        plain = carries_all(model, switching) and not model.line.bits & REMEMBERS
        return plain and switching.manager.layout.rod.size >= LEAST_CELLS

    def fits(self, switching: ZoneSwitching) -> bool:
        """Whether the line is solved by what the arrays were made for, and its zones are these."""
        watched = self._owner.itself.table if self._owner.itself is not None else None
        same = self._solver is self._of_run.solver and self._line.watch_table is watched
        return bool(same and switching is self._switching and self._fixed_to == self._key(self._owner))

    @property
    def job(self) -> np.ndarray:
        """The table of kernels.run.following_run that the compiled steps get."""
        self._at.alone, self._at.may_wait = self.alone, self._owner.outputs_may_wait
        return self._following.numbers

    # --- tables -------------------------------------------------------------------------------------

    def _bind_all(self) -> None:
        """Tables of changes from either side to the other, and of runs on either."""
        owner, on, model = self._owner, self._on, self._owner.model
        assert model.on_base is not None and model.layout is not None
        cable, zones, ends = model.on_base.cable, self._switching.zones, model.ends.values
        floor_part, least = self._tension_floor
        envelope, bounds = owner.envelope, np.zeros((4, b.EXTREMES, 1))
        places, borne = np.zeros(1), 1.0 + model.cable.max_strain[self._piece]
        widths = np.ascontiguousarray(model.cable.outer_diameter[self._piece])
        start = np.zeros((self._finest.size, 3))
        if envelope is not None:
            bounds, places, start = envelope.bounds, envelope.s, envelope.start

        def line_job(k: int, m: int) -> dict[str, Any]:
            at = on.layout(k, m)
            return {"cable": cable, "nodes": at.s, "base_of_cell": at.of, "rod": at.rods, "line": on.line(k, m)}

        def kinds_job(k: int, m: int) -> dict[str, Any]:
            of, kinds = on.layout(k, m).of, on.zones(k, m).kinds
            return {"cable": cable, "base_of_cell": of, "kinds": kinds, "floor_part": floor_part, "least": least}

        def switch_job(k: int, parity: int, n: int, m: int) -> dict[str, Any]:
            to, at = 1 - k, on.layout(1 - k, m)
            match = Match(**self._match[0].view(m)._asdict(), **self._match[1].view(n)._asdict())
            transfer = Transfer(
                on.line(k, n), on.line(to, m), on.state(k, parity, n), on.state(to, 0, m),
                on.layout(k, n).place, at.place, at.of, on.sides[k].first, self._switching.kinks, self._twist,
                self._clamps, self._held, self._shifts, match,
            )  # fmt: skip
            return {
                "transfer": transfer, "ends": ends, "sea": on.sea_on(n), "target_sea": on.sea_on(m),
                "zones": on.zones(k, n), "target_zones": on.zones(to, m), "numbers": self._numbers,
                "guided": self._switching.guided,
            }  # fmt: skip

        def renew_job(k: int, parity: int, n: int, m: int) -> dict[str, Any]:
            to, at, of_old = 1 - k, on.layout(1 - k, m), on.layout(k, n)
            return {
                "s": of_old.s, "rods": of_old.rods, "to_s": at.s, "to_rods": at.rods, "line": on.line(to, m),
                "place": at.place, "of": at.of, "first": on.sides[to].first, "start": start, "marked": self._marked,
                "borne": borne, "state": on.state(to, 0, m),
                "twin": on.state(to, 1, m), "sea": on.sea_on(m), "work": on.work_on(m),
                "zones": on.zones(to, m), "before": on.books(n), "books": on.books(m),
                "push": on.push(k, parity, n), "new_push": on.push(to, 0, m), "next_push": on.push(to, 1, m),
                "envelope_s": places, "bounds": bounds, "stays": self._stays, "spare": self._spare,
                "width": on.width(m), "nearest": on.itself.cells,
                "widths": widths, "scale": model.tension_scale,
            }  # fmt: skip

        def in_run(k: int, m: int) -> dict[str, Any]:
            return {
                "line": on.line(k, m), "sea": on.sea_on(m), "old": on.state(k, 0, m),
                "new": on.state(k, 1, m), "was": on.push(k, 0, m), "now": on.push(k, 1, m),
                "work": on.work_on(m), "books": on.books(m),
            }  # fmt: skip

        def in_zones(k: int, m: int) -> dict[str, Any]:
            found = in_run(k, m)
            return {name: found[name] for name in IN_ZONES if name in found} | {"zones": on.zones(k, m)}

        def in_itself(k: int, m: int) -> dict[str, Any]:
            states = on.state(k, 0, m), on.state(k, 1, m)
            itself = on.itself._replace(width=on.itself.width[:m])
            return {"line": on.line(k, m), "old": states[0], "new": states[1], "itself": itself}

        both, pairs = (0, 1), ((0, 0), (0, 1), (1, 0), (1, 1))
        layouts = []
        for k in both:
            at, table = on.layout(k, self.most), Table(blank_layout_job)
            table.bind(
                plan=zones.plan, rod=zones.next_rod, parts=zones.parts, finest=self._finest, place=at.place, s=at.s,
                of=at.of, rods=at.rods, first=on.sides[k].first,
            )  # fmt: skip
            layouts.append(table)

        def on_new(values: Any, k: int, n: int, m: int) -> dict[str, Any]:
            found: dict[str, Any] = values(k, m)
            return found

        def for_sides(blank: Any, values: Any) -> list[Shaped]:
            return [Shaped(Table(blank), partial(on_new, values, k)) for k in both]

        def in_odd(k: int, m: int) -> dict[str, Any]:
            found = in_run(k, m)
            return found | {"old": found["new"], "new": found["old"]}

        lines, kinds = for_sides(blank_line_job, line_job), for_sides(blank_kinds_job, kinds_job)
        of_run, of_zones = for_sides(blank_job, in_run), for_sides(blank_zone_job, in_zones)
        of_odd = for_sides(blank_job, in_odd)
        switches = [Shaped(Table(blank_switch_job), partial(switch_job, *pair)) for pair in pairs]
        renews = [Shaped(Table(blank_renew_job), partial(renew_job, *pair)) for pair in pairs]
        of_itself = for_sides(blank_itself_job, in_itself) if self._watch is not None else []
        self._lines = lines
        # what is bound there stays alive
        self._tables = layouts, kinds, of_run, of_odd, of_zones, of_itself, switches, renews
        self._bind_following(layouts, lines, kinds, of_run, of_zones, of_itself, switches, renews)
        self._bind_calls(
            of_odd,
            {
                "lay_out": (lay_out, layouts[0]),
                "clear": (clear_state, renews[0].table),
                "line": (fill_line, lines[0].table),
                "begin": (begin_switch, switches[0].table),
                "kinds": (fill_kinds, kinds[0].table),
                "end": (end_switch, switches[0].table),
                "renew": (renew, renews[0].table),
                "before_forces": (before_forces, self._owner.table),
                "after_forces": (after_forces, self._owner.table),
                "books": (begin_line, self._owner.table),
            },
        )

    def _bind_following(
        self, layouts: list[Table], lines: list[Shaped], kinds: list[Shaped], of_run: list[Shaped],
        of_zones: list[Shaped], of_itself: list[Shaped], switches: list[Shaped], renews: list[Shaped],
    ) -> None:  # fmt: skip
        """The table of runs whose cells change in compiled code."""
        owner, zones = self._owner, self._switching.zones

        def stacked(shaped: list[Shaped], places: Any = slice(None)) -> np.ndarray:
            return np.array([x.numbers[:, places] for x in shaped])

        in_run, in_zones = of_run[0].places(IN_RUN), of_zones[0].places(IN_ZONES)
        itself, itself_places = np.zeros(0, np.int64), np.zeros(0, np.int64)
        in_itself = np.zeros((2, 3, 0), np.int64)
        if self._watch is not None:
            itself, itself_places = self._watch.table.numbers, of_itself[0].places(IN_ITSELF)
            in_itself = stacked(of_itself, itself_places)
            tree = self._on.itself.tree.__array_interface__["data"][0]
            self._at.boxes_at = 1 + int(np.flatnonzero(of_itself[0].numbers[0] == tree)[0])
        numbers: dict[str, Any] = {
            "calls": self._calls, "at": self._at, "clock": owner.clock, "own": owner.books.clock, "counts": owner.count,
            "work": owner.books.work, "zone_clock": zones.clock, "zone_counts": zones.counts, "numbers": self._numbers,
            "run": owner.table.numbers, "run_places": in_run, "in_run": stacked(of_run, in_run),
            "zones": self._switching.table.numbers, "zone_places": in_zones, "in_zones": stacked(of_zones, in_zones),
            "itself": itself, "itself_places": itself_places, "in_itself": in_itself,
            "layouts": np.array([x.numbers for x in layouts]), "line": lines[0].table.numbers, "lines": stacked(lines),
            "kind": kinds[0].table.numbers, "kinds": stacked(kinds), "switch": switches[0].table.numbers,
            "switches": stacked(switches), "renewed": renews[0].table.numbers, "renews": stacked(renews),
            "here": zones.here, "waiting": self._waiting, "places": self._places,
        }  # fmt: skip
        self._following.bind(**numbers)
        self._at.task = owner.table.part("task").start

    def _bind_calls(self, of_odd: list[Shaped], calls: dict[str, tuple[Any, Any]]) -> None:
        """Addresses of what a change calls; of_odd: what the table of odd steps gets."""
        even, odd = self._owner.table.even, self._owner.table.odd
        places = of_odd[0].places(IN_RUN)
        in_odd = np.array([x.numbers[:, places] for x in of_odd])
        self._following.bind(even=even.numbers, odd=odd.numbers, in_odd=in_odd)
        for name, (kernel, table) in calls.items():
            setattr(self._calls, name, kernel.address(table.numbers))

    # --- changes ------------------------------------------------------------------------------------

    def adopt(self) -> None:
        """Go on with the line of the run as it is now, in these arrays."""
        owner, switching, model = self._owner, self._switching, self._owner.model
        layout, n, k = model.layout, model.cells, 0
        assert layout is not None
        if not self._bound:
            with self._on.bound():
                self._bind_all()
            self._bound = True
        self._at.side, self._at.cells = k, n
        parity, at = int(owner.count.parity), self._on.layout(k, n)
        for which in (0, 1):
            copy_fields(owner.states[which], self._on.state(k, which, n))
            if owner.push.size:
                self._on.push(k, which, n)[:] = owner.pushes[which]
        zones = self._on.zones(k, n)
        copy_fields(switching.zones, zones, (*OF_BASE, "kinds"))
        copy_fields(switching.zones.kinds, zones.kinds, ("free",))
        copy_fields(model.line, self._on.line(k, n), ("bits", "plane", "torsion"))
        copy_fields(model.sea.values, self._on.sea_on(n), REST_OF_SEA)
        copy_fields(owner.stepper.work, self._on.work_on(n), ("W", "X", "x", "torsion", "gaps", "rows"))
        if self._watch is not None:
            copy_fields(self._watch.itself, self._on.itself._replace(width=self._on.width(n)), ("tree", "stack"))
        copy_fields(owner.books, self._on.books(n), tuple(x for x in Books._fields if x not in Kept._fields))
        at.place[:], at.s[:], at.of[:], at.rods[:] = layout.places, model.line.s, layout.base_of_cell, layout.rod_cells
        self._on.sides[k].first[:] = self._on.base[:] = layout.first
        owner.table.bind(task=Task(RUN, ca=HEAVY, limits=owner.stepper.limits))
        self._calls.solver = owner.solver_address()
        f.put_cells(self._following.numbers)
        self.adopted, self._synced = True, -1
        owner.count.parity = parity
        self.sync()

    def change_zones(self, change: Change) -> float:
        """Other zones, with the cells that go with them; the energy, J, that is booked for it."""
        booked = self._to_zones(change)
        self.sync()
        return booked

    def _to_zones(self, change: Change) -> float:
        """Other zones, of which Python's model knows nothing yet, and the energy, J, that is booked for it."""
        switching, manager, t = self._switching, self._switching.manager, self._owner.t
        switching.zones.next_rod[:] = change.rod
        z.plan_next(switching.table.numbers)
        for k, clamp in enumerate(switching.clamps(self._owner.model.ends.at(t))):
            self._held[k] = clamp is not None
            if clamp is not None:
                self._clamps[k] = clamp
        booked = self.change(lambda: manager.adopt_rods(change.rod, change, t))
        manager.take(manager.layout._replace(rod=change.rod.copy()), self._on.zones(self.side, self.cells))
        switching.limit_steps(self._owner.clock)
        return booked

    def change(self, adopt: Callable[[], None] | None = None) -> float:
        """To the cells that are planned: nothing moves, and the energy, J, is booked.

        adopt: takes over other zones, where they are other ones.
        """
        table = self._following.numbers
        f.begin_cells(table)
        if adopt is not None:
            adopt()
        f.end_cells(table)
        return float(self._numbers[AFTER] - self._numbers[BEFORE])

    # --- outputs that wait --------------------------------------------------------------------------

    def _line_of(self, places: np.ndarray, rod: np.ndarray) -> Line:
        """The line with nodes at these places of the finest mesh, in the arrays that are not in use; rod: (n,)."""
        k, m, starts = 1 - self.side, places.size - 1, self._starts
        at, table = self._on.layout(k, m), self._lines[k].table.numbers
        at.place[:], at.s[:] = places, self._finest[places]
        at.of[:] = np.searchsorted(starts, places[:-1], "right") - 1
        at.rods[:] = rod[at.of]
        table[:] = self._lines[k].of(0, m)
        fill_line(table)
        return self._on.line(k, m)

    def outputs(self, rows: Floats) -> tuple[list[Output], Batch]:
        """All outputs that wait, in rows, copied, each with its line; and what they have at the ends."""
        model, begin, found, batches = self._owner.model, 0, list[Output](), list[Batch]()
        assert model.layout is not None
        for first, count, cells in self._waiting[: self._at.waiting].tolist():
            line = self._line_of(self._places[begin : begin + cells + 1], model.layout.rod)
            batches.append(self._line.batch_of(rows[first : first + count], cells))
            found += outputs_in(batches[-1], line, model.zones)
            begin += cells + 1
        if len(rows) > self._at.used:
            batches.append(self._line.batch_of(rows[self._at.used :], model.cells))
            found += outputs_in(batches[-1], model.line, model.zones)
        self._at.waiting = self._at.placed = self._at.used = 0
        return found, ends_alone(batches)

    def sync(self) -> None:
        """What Python has of the line is that of now."""
        if not self._stale:
            return
        self._synced = int(self._at.changes)
        owner, k, n = self._owner, self.side, self.cells
        model, switching, line = owner.model, self._switching, self._on.line(k, n)
        assert model.layout is not None
        zones, sea, work, books = self._on.zones(k, n), self._on.sea_on(n), self._on.work_on(n), self._on.books(n)
        now = sea.now.copy()
        layout = model.layout._replace(rod=zones.rod.copy(), here=zones.here.copy())
        model = replace(model, line=line, layout=layout, zones=layout.zones, sea=model.sea.with_values(sea))
        sea.now[:] = now
        old, new = self._on.state(k, 0, n), self._on.state(k, 1, n)
        owner.books, owner.states = books, (old, new)
        if owner.push.size:
            at = self._on.layout(k, n)
            owner.pushes = at.push, at.next_push
        owner.table.hold(
            line=line, sea=sea, old=old, new=new, was=owner.pushes[0], now=owner.pushes[1], work=work, books=books,
        )  # fmt: skip
        switching.set_model(model, zones)
        switching.table.hold(line=line, sea=sea, old=old, new=new, zones=zones)
        if self._watch is not None:
            itself = self._on.itself._replace(width=self._on.width(n), tree=self._on.itself.tree[: boxes_of(n)])
            self._watch.itself = itself
            self._watch.table.hold(line=line, old=old, new=new, itself=itself)
        owner.take(model, work)


class CellViews:
    """Two sets of arrays (sides k = 0, 1) with room for the most cells, and views of them for a number of cells."""

    def __init__(self, owner: OneOfMany, most: int, marked: int, at: FollowingPlaces) -> None:
        """Views of a line whose cells follow the curvature.

        most: cells at most; marked: nodes of them beside which extremes are kept on both sides; at: numbers of the run
        (kernels.run.following_run).
        """
        assert owner.switching is not None and owner.model.layout is not None
        self._owner, self._switching, self._at = owner, owner.switching, at
        base, some = int(owner.model.layout.rod.size), owner.envelope is not None
        self.base = np.zeros(base + 1, np.int64)
        self.sides = Side(most, base), Side(most, base)
        self._kept = Room(Packed(lambda n: blank_kept(n, marked, some)), most)
        self._sea, self._work = Room(seas, most), Room(works, most)
        self.watched = owner.itself is not None and owner.itself.on
        self.itself: Itself = blank_itself(np.zeros(most))
        self._turn = np.zeros((0, 3))
        self._views: dict[Any, Any] = {}  # while tables are bound
        self._binding = False

    @contextmanager
    def bound(self) -> Iterator[None]:
        """While tables are bound a view is the same for the same number of cells."""
        self._binding = True
        try:
            yield
        finally:
            self._binding = False
            self._views.clear()

    def _view(self, room: Room, cells: int, given: Callable[[], dict[str, Any]] = dict) -> Any:
        """Of a room, for so many cells; while tables are bound, the same for the same."""
        if not self._binding:
            return room.view(cells, **given())
        if (room, cells) not in self._views:
            self._views[room, cells] = room.view(cells, **given())
        return self._views[room, cells]

    def line(self, k: int, cells: int) -> Line:
        line = self._owner.model.line
        given = {"bits": line.bits, "plane": line.plane, "torsion": NO_TORSION}
        given |= dict.fromkeys(TENSION_TORQUE, NO_TENSION_TORQUE)
        found: Line = self._view(self.sides[k].line, cells, lambda: given)
        return found

    def zones(self, k: int, cells: int) -> Zones:
        zones = self._switching.zones

        def given() -> dict[str, Any]:
            kinds = self._view(self.sides[k].kinds, cells, lambda: {"free": zones.kinds.free})
            return {"kinds": kinds, **{name: getattr(zones, name) for name in OF_BASE}}

        found: Zones = self._view(self.sides[k].zones, cells, given)
        return found

    def state(self, k: int, which: int, cells: int) -> State:
        found: State = self._view(
            self.sides[k].states[which],
            cells,
            lambda: {
                "turn": self._turn,
                "slow": NO_SLOW,
                "wake": NO_WAKE,
                "peak": NO_PEAK,
                "grip": NO_GRIP,
                "sheave": NO_SHEAVES,
                "soil": NO_SOIL,
            },
        )
        return found

    def layout(self, k: int, cells: int) -> Cells:
        found: Cells = self._view(self.sides[k].cells, cells)
        return found

    def width(self, cells: int) -> Floats:
        """Diameters of cells; none where nobody watches whether the line meets itself."""
        return self.itself.width[: cells if self.watched else 0]

    def push(self, k: int, which: int, cells: int) -> Floats:
        """Of a run that carries one, else none."""
        if not self._owner.push.size:
            return NO_PUSH
        layout = self.layout(k, cells)
        return layout.next_push if which else layout.push

    def sea_on(self, cells: int) -> Sea:
        values = self._owner.model.sea.values
        found: Sea = self._view(self._sea, cells, lambda: {x: getattr(values, x) for x in REST_OF_SEA})
        return found

    def work_on(self, cells: int) -> Work:
        found: Work = self._view(self._work, cells, lambda: {"torsion": self._owner.stepper.work.torsion})
        return found

    def books(self, cells: int) -> Books:
        own = self._view(self._kept, cells)._asdict() | {"base": self.base}
        if not self._binding:
            return self._owner.books._replace(**own)
        if (Books, cells) not in self._views:
            self._views[Books, cells] = self._owner.books._replace(**own)
        return self._views[Books, cells]


# Arrays with room for the most cells that a line may have in a run, and tables that follow their number.

OF_SEA = ("flow", "axis", "slip", "slid", "bed")  # what it has of nodes


REST_OF_SEA = tuple(name for name in Sea._fields if name not in OF_SEA)


seas = Packed(no_sea, given=REST_OF_SEA)


works = Packed(workspace, given=("torsion",))


class Kept(NamedTuple):
    """What of `Books` depends on the cells, but for the samples."""

    tension: Floats
    borne: Floats
    strains: Floats
    start: Floats
    marks: np.ndarray
    right: np.ndarray
    extremes: Floats


class Cells(NamedTuple):
    """A layout, as kernels.mesh.cell_changes.LayoutJob has it; a push out of the plane, and room for the next."""

    place: np.ndarray
    s: Floats
    of: np.ndarray
    rods: np.ndarray
    push: Floats
    next_push: Floats


def blank_cells(n: int) -> Cells:
    z = np.zeros
    return Cells(z(n + 1, int), z(n + 1), z(n, int), z(n, bool), z((n + 1, 4)), z((n + 1, 4)))


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

    def places(self, names: tuple[str, ...]) -> np.ndarray:
        """Where the numbers of some values are."""
        parts = [self.table.part(name) for name in names]
        return np.concatenate([np.arange(at.start, at.stop) for at in parts])


class Side:
    """One of the two sets of arrays."""

    def __init__(self, most: int, base: int) -> None:
        self.line, self.kinds, self.zones = Room(lines, most), Room(kinds_of, most), Room(all_zones, most)
        self.states, self.cells = (Room(states, most), Room(states, most)), Room(Packed(blank_cells), most)
        self.first = np.zeros(base + 1, np.int64)


def blank_kept(n: int, extra: int, some: bool) -> Kept:
    """extra: marked nodes; some: whether extremes are kept."""
    nodes, z = n + 1, np.zeros
    return Kept(
        z((2, n)), z(n), z((nodes if some else 0, b.STRAINS)), z((nodes, 3)), z(nodes, np.int8), z(nodes, np.int64),
        z((4, b.EXTREMES, nodes + extra)) if some else z((4, 0, nodes)),
    )  # fmt: skip


class Joined(NamedTuple):
    """Of kernels.mesh.zone_transfer.Match what new cells have."""

    same: np.ndarray
    left: np.ndarray
    kept: np.ndarray
    lengths: Floats


class Single(NamedTuple):
    """And what old nodes have."""

    single: np.ndarray


def blank_joined(n: int) -> Joined:
    z = np.zeros
    return Joined(z(n + 1, np.int64), z(n + 1, np.int64), z(n, np.int64), z(n))


def blank_single(n: int) -> Single:
    return Single(np.zeros(n + 1, np.int8))


def copy_fields(old: Any, new: Any, but: tuple[str, ...] = ()) -> None:
    """Copy the arrays of a named tuple into those of another one, but for these."""
    for name in old._fields:
        if name not in but:
            getattr(new, name)[:] = getattr(old, name)
