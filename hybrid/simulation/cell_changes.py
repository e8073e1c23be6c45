"""Kinds of cells, and cells that follow the curvature: what changes them between two steps of a run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from hybrid.kernels.machine.binding import Packed, Room, Table
from hybrid.kernels.march.zone_torque import carry_torque
from hybrid.kernels.mesh import remesh as f
from hybrid.kernels.mesh import zone_step as z
from hybrid.kernels.mesh.cell_changes import (
    begin_switch,
    blank_cell_planner,
    blank_renew_job,
    blank_switch_job,
    cells_due,
    clear_state,
    end_switch,
    keep_places,
    plan_cells,
    renew,
)
from hybrid.kernels.mesh.remesh import blank_kinds_job, blank_line_job, fill_kinds, fill_line
from hybrid.kernels.mesh.zone_transfer import Transfer, blank_match
from hybrid.kernels.state import books as b
from hybrid.kernels.state.books import Books
from hybrid.kernels.state.report import PLANAR
from hybrid.kernels.state.state import Batch, Ends, Floats, Line, Sea, State
from hybrid.model.build import Model
from hybrid.model.material import LEAST_TENSION, TENSION_FLOOR
from hybrid.model.mesh import kinds_of
from hybrid.outputs.observation import Output, outputs_in
from hybrid.simulation.remesh import (
    Bound,
    Given,
    OfRun,
    Part,
    Remesh,
    copy_fields,
    steps_alone,
)
from hybrid.simulation.result_file import marks_on
from hybrid.zones.change import ZoneSwitching
from hybrid.zones.manager import OF_BASE, Change, all_zones

LEAST_CELLS = 3  # with which tables are made
MOST_PLACES = 20_000  # nodes of lines whose outputs may wait, in all
LINE, SWITCH, KINDS, RENEWED = range(4)  # tables of a change


class Cells(NamedTuple):
    """A layout, as kernels.mesh.cell_changes.CellPlanner has it."""

    place: np.ndarray
    s: Floats
    of: np.ndarray
    rods: np.ndarray


layouts = Packed(lambda n: Cells(np.zeros(n + 1, int), np.zeros(n + 1), np.zeros(n, int), np.zeros(n, bool)))
matches = Packed(lambda n: blank_match(n, n))


class CellChanges(Remesh):
    """Changes of the cells of a line of a run, and of what is rod, with the solver that it has now."""

    beside, most_waiting, per_node = ("line", "sea", "old", "new", "zones"), 256, 1

    def __init__(self, run: OfRun, number: int, switching: ZoneSwitching, once: bool = False) -> None:
        """Room for all; `adopt` before the first change; once: for `change_once`."""
        model, layout = run.model.models[number], run.model.models[number].zoned
        self._switching, self._marked = switching, marks_on(layout.base, run.lines[number].marked)
        super().__init__(run, number, int((self._marked != 0).sum()), once=once)
        base, most = layout.rod.size, self.most
        self.in_steps = bool(switching.zones.clock.share > 0.0)  # its cells follow the curvature
        self._hinged = model.line_maker.hinged
        self._starts, self._finest = layout.starts, layout.finest.nodes
        self._piece = model.cable.piece(0.5 * (layout.base[1:] + layout.base[:-1]))
        self._first = layout.first if once else np.zeros(base + 1, np.int64), np.zeros(base + 1, np.int64)
        zones = switching.zones
        self._kinds, self._zones = self._sides(kinds_of, zones.kinds), self._sides(all_zones, zones)
        now = Cells(layout.places, model.line.s, layout.base_of_cell, layout.rod_cells)
        self._cells = Given(now) if once else Room(layouts, most), Room(layouts, most)
        self._match = Room(matches, most)
        self._by_nodes: tuple[Floats, Floats] | None = None  # at a winch, by which extremes are kept
        self._clamps, self._held = np.zeros((2, 2, 3)), np.zeros(2, bool)
        self._shifts, self._places = np.array([not self.in_steps]), np.zeros(MOST_PLACES, np.int64)

    def _key(self) -> tuple[Any, ...]:
        """What the tables hold as it is."""
        model = self.model
        return id(model.on_base), model.line.bits, id(model.line.plane), id(model.ends), bool(self.pushes[0].size)

    def fits_zones(self, switching: ZoneSwitching) -> bool:
        """Whether the line is solved by what the arrays were made for, and its zones are these."""
        return self.fits and switching is self._switching

    @staticmethod
    def may_change(run: OfRun, number: int, switching: ZoneSwitching) -> bool:
        """Whether cells of a line can change so in a run whose solver is attached."""
        paid, line = any(x.paying is not None for x in run.lines), run.model.models[number].line
        turns = bool(line.torsion.size) or (switching.zones.counts.holds_twist and not line.bits & PLANAR)
        enough = switching.manager.layout.rod.size >= LEAST_CELLS
        return enough and not (paid or turns) and steps_alone(run, number)

    # --- arrays -------------------------------------------------------------------------------------

    def _shared(self, k: int) -> dict[str, Any]:
        whole = super()._shared(k)
        if not (self._once and k):
            return whole
        cable = self.model.line_maker.cable_with(self.model.line.bits)
        return whole | {"law_table": cable.law_table, "bend_table": cable.bend_table}

    def _zones_on(self, k: int, cells: int) -> z.Zones:
        zones = self._switching.zones
        kinds = self._kinds[k].view(cells, free=zones.kinds.free)
        given = {"kinds": kinds, **{name: getattr(zones, name) for name in OF_BASE}}
        return self._zones[k].view(cells, **given)

    def _layout(self, k: int, cells: int) -> Cells:
        return self._cells[k].view(cells)

    # --- tables -------------------------------------------------------------------------------------

    def _beside_table(self) -> tuple[Table, Callable[[], Any]]:
        return self._switching.table, z.blank_zone_job

    def _in_beside(self, k: int, _: int, m: int) -> dict[str, Any]:
        return self._states_on(k, m) | {"zones": self._zones_on(k, m)}

    def _line_job(self, k: int, _: int, m: int) -> dict[str, Any]:
        at, line = self._layout(1 - k, m), self.line(1 - k, m)
        cells: dict[str, Any] = {"nodes": at.s, "base_of_cell": at.of, "rod": at.rods}
        return cells | {"cable": self.model.line_maker.cable_with(line.bits), "line": line}

    def _kinds_job(self, k: int, _: int, m: int) -> dict[str, Any]:
        to, model = 1 - k, self.model
        return {
            "cable": model.line_maker.cable_with(model.line.bits),
            "base_of_cell": self._layout(to, m).of,
            "kinds": self._zones_on(to, m).kinds,
            "hinged": self._hinged,
            "floor_part": TENSION_FLOOR,
            "least": LEAST_TENSION * self._switching.manager.scale,
        }

    def _switch_job(self, k: int, parity: int, n: int, m: int) -> dict[str, Any]:
        to, switching = 1 - k, self._switching
        at = self._layout(to, m)
        match = self._match.view(m)._replace(single=self._match.view(n).single)
        lines = self.line(k, n), self.line(to, m), self.state(k, parity, n), self.state(to, 0, m)
        before, held = self._layout(k, n).place, (self._clamps, self._held, self._shifts)
        transfer = Transfer(*lines, before, at.place, self._first[k], switching.kinks, *held, match)
        around: dict[str, Any] = {"sea": self._sea_on(k, n), "target_sea": self._sea_on(to, m)}
        zones = {"zones": self._zones_on(k, n), "target_zones": self._zones_on(to, m)}
        rest = {"ends": self.model.ends.values, "numbers": self._numbers, "guided": switching.guided}
        return around | zones | rest | {"transfer": transfer}

    def _renew_job(self, k: int, parity: int, n: int, m: int) -> dict[str, Any]:
        to = 1 - k
        at, of_old = self._layout(to, m), self._layout(k, n)
        s, to_s = self._by_nodes or (of_old.s, at.s)
        found: dict[str, Any] = {"s": s, "rods": of_old.rods, "to_s": to_s, "to_rods": at.rods}
        found |= {"line": self.line(to, m), "place": at.place, "of": at.of, "first": self._first[to]}
        found |= {"marked": self._marked, "nearest": self._itself.cells, "scale": self.model.tension_scale}
        found |= {"state": self.state(to, 0, m), "twin": self.state(to, 1, m), "sea": self._sea_on(to, m)}
        found |= {"work": self._work_on(to, m), "zones": self._zones_on(to, m), "width": self._width(m)}
        found |= {"before": self._books(k, n), "books": self._books(to, m), "push": self._push(k, parity, n)}
        return found | {"new_push": self._push(to, 0, m), "next_push": self._push(to, 1, m)} | self._along

    def _parts(self) -> tuple[list[Bound], list[Part], int]:
        model, envelope = self.model, self._line.envelope
        extra = int((self._marked != 0).sum())
        self._along: dict[str, Any] = {
            "borne": 1.0 + model.cable.max_strain[self._piece],
            "widths": np.ascontiguousarray(model.cable.outer_diameter[self._piece]),
            "start": envelope.start,
            "start_s": envelope.nodes,
            "always": model.always_base,
            "envelope_s": envelope.s,
            "bounds": envelope.bounds,
            "stays": np.zeros(self.most + 1, np.int64),
            "spare": np.zeros(4 * b.EXTREMES * (self.most + 1 + extra)),
        }
        tables = [
            Bound(blank_line_job, self._line_job, by_parity=False),
            Bound(blank_switch_job, self._switch_job),
            Bound(blank_kinds_job, self._kinds_job, by_parity=False),
            Bound(blank_renew_job, self._renew_job),
        ]
        parts = [Part(clear_state, RENEWED), Part(fill_line, LINE), Part(begin_switch, SWITCH)]
        parts += [Part(fill_kinds, KINDS), Part(end_switch, SWITCH)]
        parts.append(Part(renew, RENEWED))
        return tables, parts, 3

    def _planner(self) -> tuple[tuple[Any, Any, Any], list[Table], int]:
        zones, tables = self._switching.zones, []
        for k in (0, 1):
            at, table = self._layout(1 - k, self.most), Table(blank_cell_planner)
            table.bind(plan=zones.plan, rod=zones.next_rod, parts=zones.parts, here=zones.here, numbers=self._numbers)
            table.bind(place=at.place, s=at.s, of=at.of, rods=at.rods, first=self._first[1 - k], finest=self._finest)
            table.bind(at=self._at, clock=self._run.loop.clock, places=self._places)
            table.bind(zone_clock=zones.clock, zone_counts=zones.counts)
            tables.append(table)
        return (cells_due, plan_cells, keep_places), tables, self._places.size

    def _copy_beside(self, n: int) -> None:
        switching, model = self._switching, self.model
        zones, at, layout = self._zones_on(0, n), self._layout(0, n), model.zoned
        copy_fields(switching.zones, zones, (*OF_BASE, "kinds"))
        copy_fields(switching.zones.kinds, zones.kinds, ("free",))
        at.place[:], at.s[:], at.of[:], at.rods[:] = layout.places, model.line.s, layout.base_of_cell, layout.rod_cells
        self._first[0][:] = self._base[:] = layout.first

    def _model_of(self, line: Line, sea: Sea) -> Model:
        model, zones = self.model, self._zones_on(self.side, self.cells)
        layout = model.zoned._replace(rod=zones.rod.copy(), here=zones.here.copy() if self.in_steps else None)
        model = replace(model, line=line, layout=layout, zones=layout.zones, sea=model.sea.with_values(sea))
        self._switching.model = model
        self._switching.manager.use_cells_of(layout, zones)
        return model

    # --- changes ------------------------------------------------------------------------------------

    def change_zones(self, change: Change) -> float:
        """Other zones, with the cells that go with them; the energy, J, that is booked for it."""
        switching, manager, t = self._switching, self._switching.manager, self._run.t
        switching.zones.next_rod[:] = change.rod
        if self.in_steps:
            z.plan_next(switching.table.numbers)
        self._place_clamps()
        booked = self.change(lambda: manager.adopt_rods(change.rod, change, t))
        manager.use_cells_of(manager.layout._replace(rod=change.rod.copy()), self._zones_on(self.side, self.cells))
        clock = switching.zones.clock
        self._run.loop.clock.allowed = clock.ramp_step if manager.ramping else clock.steady_step
        self.sync()
        return booked

    def _place_clamps(self) -> Ends:
        """Ends, and what holds the twist of them, are as they are now."""
        ends = self.model.ends.at_time(self._run.t)
        self._solver.place_frames(self._number, self._run.state.bodies)
        self._clamps[:], self._held[:] = self._switching.clamps(ends)
        return ends

    def change_once(self, change: Change, here: np.ndarray | None = None) -> tuple[Model, State, Books, float]:
        """Other zones in arrays of their own: the line, its state and books, and the energy, J, that it puts in.

        here: (K+1,) bool, places of the finest mesh where nodes should be; None: as is planned.
        """
        switching, run, model = self._switching, self._run, self.model
        manager, zones, ends, state = switching.manager, switching.zones, self._place_clamps(), self.state(0, 0, 0)
        sea = model.sea.at_time(run.t)
        if here is None:
            here = zones.plan.copy() if change.same else switching.plan(change.rod, sea, ends, state)
        layout = model.zoned._replace(rod=change.rod, here=here)
        zones.next_rod[:], zones.plan[:] = change.rod, layout.node_flags
        if model.payout is not None:
            self._by_nodes = model.nodes, model.payout.kept_nodes(layout)
        self._torsion, m = model.line_maker.torsion(layout), layout.base_of_cell.size

        def adopt() -> None:
            line, target, out = model.line, self.line(1, m), self.state(1, 0, m)
            if zones.counts.holds_twist and not target.bits & PLANAR:
                carry_torque(line, target, ends, state, out, np.zeros(line.s.size + 1))
            manager.adopt_rods(change.rod, change, run.t)

        self.carry_out(adopt)
        model = self._model_of(self.line(1, m), self._sea_on(1, m))
        return model, self.state(1, 0, m), self._books(1, m), float(self._numbers[f.AFTER] - self._numbers[f.BEFORE])

    def change(self, adopt: Callable[[], None] | None = None) -> float:
        """To the cells that are planned: nothing moves, and the energy, J, is booked.

        adopt: takes over other zones, where they are other ones.
        """
        table = self._table.numbers
        f.begin_cells(table)
        if adopt is not None:
            adopt()
        f.end_cells(table)
        return float(self._numbers[f.AFTER] - self._numbers[f.BEFORE])

    # --- outputs that wait --------------------------------------------------------------------------

    def _outputs_of(self, batch: Batch, cells: int, begin: int) -> tuple[list[Output], int]:
        """With nodes at places of the finest mesh that are kept, in the arrays that are not in use."""
        model, k, places = self.model, 1 - self.side, self._places[begin : begin + cells + 1]
        at, fill = self._layout(k, cells), self._change[LINE][2 * (1 - k)]
        at.place[:], at.s[:] = places, self._finest[places]
        at.of[:] = np.searchsorted(self._starts, places[:-1], "right") - 1
        at.rods[:] = model.zoned.rod[at.of]
        fill.table.numbers[:] = fill.of(0, cells)
        fill_line(fill.table.numbers)
        return outputs_in(batch, self.line(k, cells), model.zones), begin + cells + 1

    def _outputs_now(self, batch: Batch) -> list[Output]:
        return outputs_in(batch, self.model.line, self.model.zones)
