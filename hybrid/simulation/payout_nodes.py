"""Nodes that enter and leave at a winch: what changes them between two steps of a run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from hybrid.kernels.machine.binding import Packed, Table
from hybrid.kernels.mesh import remesh as f
from hybrid.kernels.mesh.zone_step import Zones
from hybrid.kernels.reel.payout import stand_still
from hybrid.kernels.reel.payout_nodes import (
    OF_REEL,
    CarryJob,
    NodeJob,
    blank_line_job,
    blank_node_job,
    blank_node_planner,
    blank_zones_job,
    book_change,
    carry_node,
    carry_zones,
    change_line,
    fit_changed,
    keep_reel,
    make_line,
    node_due,
    plan_node,
    renew_run,
)
from hybrid.kernels.reel.reel import Reel, blank_reel, blank_reel_job
from hybrid.kernels.state.books import Books
from hybrid.kernels.state.state import Batch, Line, Sea, State, slip_size
from hybrid.model.build import Model
from hybrid.model.line import lines_like, of_whole_line
from hybrid.model.mesh import LineOnBase
from hybrid.outputs.observation import Output
from hybrid.simulation.remesh import Bound, OfRun, Part, Remesh, copy_fields, steps_alone
from hybrid.simulation.result_file import marks_on

SHARED = ("law", "pieces", "winch", "layer")  # what all reels of a line have in common


class PaidBase(Protocol):
    """Zones of a line that is paid out (simulation.run_payout.PaidZones)."""

    @property
    def zones(self) -> Zones: ...
    def use_base(self, model: Model, source: np.ndarray) -> None: ...


class NodeChanges(Remesh):
    """Nodes of a line of a run that enter and leave at its winch."""

    beside, most_waiting, per_node = ("line", "sea", "old", "new", "report", "reel", "X", "W"), 512, OF_REEL

    def __init__(self, run: OfRun, number: int, once: bool = False) -> None:
        """Room for all; `adopt` before the first change; once: for `change_once`."""
        paying, model = run.lines[number].paying, run.model.models[number]
        assert paying is not None
        self._paying = paying
        reel, twice, damped = self._paying.reel, self._paying.solves_twice, self._paying.damped
        extra = int((marks_on(model.line.s, run.lines[number].marked) != 0).sum())
        super().__init__(run, number, extra, twice, once)
        slips = slip_size(model.line) // 2
        reels = Packed(
            lambda n: blank_reel(n, reel.law, reel.pieces, reel.winch, reel.layer, twice, damped, slips), given=SHARED
        )
        self._reels = self._sides(reels, reel)
        self._zones: tuple[Zones, Zones] | None = None  # that move, of a change that is made once, before and after it
        self._layout, self._on_base = model.layout, model.on_base
        # for what cells lack whose outputs wait; some MB, of which a run with few outputs touches little
        self._lacks = np.empty(0 if once else self.most_waiting * OF_REEL * (self.most + 1))
        self._line_table = Table(blank_line_job())

    def _key(self) -> tuple[Any, ...]:
        """What the tables hold as it is."""
        model = self.model
        same = id(model.line.plane), id(model.ends), id(self._paying.reel.law), id(self._line.envelope)
        return model.line.bits, bool(self.pushes[0].size), *same

    @staticmethod
    def may_change(run: OfRun, number: int) -> bool:
        """Whether nodes of a line can enter and leave so in a run whose solver is attached."""
        model, line = run.model.models[number], run.lines[number]
        stays = model.layout is None and line.paying is not None and not line.paying.ended
        return stays and steps_alone(run, number) and not (model.line.torsion.size or model.line.moved.size)

    def change(self) -> None:
        """A node enters or leaves now."""
        f.change_cells(self._table.numbers)
        self.sync()

    def change_once(self, zones: PaidBase | None) -> tuple[Model, State, Books, float]:
        """A node enters or leaves in arrays of their own: the line, its state and books, and the energy, J, of that.

        zones: that move, which go on.
        """
        run, paying, model = self._run, self._paying, self.model
        if zones is None:
            self._torsion = paying.plan.torsion(paying.count + (1 if paying.enters else -1), paying.length)
        else:
            self._layout, source = paying.other_base(model.zoned)
            self._on_base = LineOnBase(paying.plan.held_as(model.cable), self._layout.base)
            self._torsion, before = self._on_base.torsion(self._layout), zones.zones
            zones.use_base(replace(model, layout=self._layout, on_base=self._on_base), source)
            self._zones = before, zones.zones
        model.ends.at_time(run.t)
        model.sea.at_time(run.t)
        self.carry_out()
        n, booked = self.cells, float(self._numbers[f.AFTER] - self._numbers[f.BEFORE])
        model = self._model_of(self.line(1, n), self._sea_on(1, n))
        return model, self.state(1, 0, n), self._books(1, n), booked

    # --- tables -------------------------------------------------------------------------------------

    def _reel(self, k: int, cells: int) -> Reel:
        now = self._paying.reel
        return self._reels[k].view(cells, **{name: getattr(now, name) for name in SHARED})

    def _beside_table(self) -> tuple[Table, Callable[[], Any]]:
        return self._paying.table, blank_reel_job

    def _in_beside(self, k: int, _: int, m: int) -> dict[str, Any]:
        work = self._work_on(k, m)
        reel = self._reel(k, m)
        return self._states_on(k, m) | {"report": work.report, "reel": reel, "X": work.X, "W": work.W}

    def _node_job(self, k: int, parity: int, n: int, m: int) -> dict[str, Any]:
        """What a change from n cells, in the arrays of side k, to m is bound to."""
        model, to, before = self.model, 1 - k, self._books(k, n)
        lines = self.line(k, n), self.line(to, m), self.state(k, parity, n), self.state(to, 0, m)
        reels = self._reel(k, n), self._reel(to, m), self._run.loop.clock
        carry = CarryJob(*lines, *reels, before.tension, self._paying.nodes)
        around = model.ends.values, self._sea_on(to, m), self._work_on(to, m), self.state(to, 1, m)
        pushes = self._push(k, parity, n), self._push(to, 0, m), self._push(to, 1, m)
        rest = self._width(m), self._itself.cells, *self._along, *self._moments, self._numbers, model.tension_scale
        job = NodeJob(carry, *(*around, before, self._books(to, m), *pushes, *rest))
        return job._asdict()

    def _zones_job(self, k: int, _: int, n: int, m: int) -> dict[str, Any]:
        assert self._zones is not None
        before, after = self._zones
        lines = {"line": self.line(k, n), "target": self.line(1 - k, m)}
        return lines | {"reel": self._reel(1 - k, m), "zones": before, "out": after}

    def _parts(self) -> tuple[list[Bound], list[Part], int]:
        envelope, plan, most = self._line.envelope, self._paying.plan, self.most + 2
        way = slice(None, None, 1 if plan.side else -1)
        borne = np.ascontiguousarray(1.0 + plan.cable.max_strain[way])
        widths = np.ascontiguousarray(plan.cable.outer_diameter[way])
        kept, gone = np.zeros(envelope.nodes.size), np.full(envelope.nodes.size, -1)
        self._along = borne, widths, envelope.start, envelope.nodes, kept, envelope.s, envelope.bounds, gone
        self._moments = np.zeros((most, 3)), np.zeros((most, 3)), np.zeros(5)
        # the table of `carry_node` begins that of the others
        parts = [Part(x, 0) for x in (change_line, carry_node, fit_changed, book_change, renew_run)]
        bound = [Bound(blank_node_job, self._node_job)]
        if self._zones is not None:
            parts.insert(3, Part(carry_zones, 1))
            bound.append(Bound(blank_zones_job, self._zones_job))
        self._calls.stand = stand_still.address(self._paying.table.numbers)
        return bound, parts, 2

    def _planner(self) -> tuple[tuple[Any, Any, Any], list[Table], int]:
        tables = []
        for k in (0, 1):
            tables.append(Table(blank_node_planner))
            reel = self._reel(k, self.most)
            tables[-1].bind(at=self._at, reel=reel, winch=reel.winch, room=self._lacks)
        return (node_due, plan_node, keep_reel), tables, self._lacks.size

    def _copy_beside(self, n: int) -> None:
        copy_fields(self._paying.reel, self._reel(0, n), SHARED)

    def _model_of(self, line: Line, sea: Sea) -> Model:
        paying, layout, sea_now = self._paying, self._layout, self.model.sea.with_values(sea)
        paying.use_reel(self._reel(self.side, self.cells), layout)
        model = replace(self.model, line=line, sea=sea_now, layout=layout, on_base=self._on_base)
        return replace(model, zones=paying.plan.zones_of(model.length) if layout is None else layout.zones)

    # --- outputs that wait --------------------------------------------------------------------------

    def _outputs_of(self, batch: Batch, cells: int, begin: int) -> tuple[list[Output], int]:
        """With what its cells lacked, which is kept."""
        k, paying, model, end = self.side, self._paying, self.model, begin + OF_REEL * cells
        line = lines_like(model.line)(cells, **of_whole_line(model.line))
        reel = self._reel(1 - k, cells)
        reel.numbers[:] = paying.reel.numbers
        self._line_table.bind(line=model.line, out=line, reel=reel, nodes=paying.plan.nodes, since=paying.reel.since)
        make_line(self._line_table.numbers)
        reel.lack[:], reel.rate[:], reel.since[:], reel.span[:] = self._lacks[begin:end].reshape(OF_REEL, cells)
        return paying.outputs_in(line, reel, batch), end

    def _outputs_now(self, batch: Batch) -> list[Output]:
        return self._paying.outputs_of_now(self.model.line, batch)
