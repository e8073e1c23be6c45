"""Kinds of cells that change between two steps of a run whose cells stay, in the arrays of the run.

Nothing is bound anew but by the first change: line and state stay where they are, and what they were is kept beside for
as long as a change takes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hybrid.adapt.manager import Change
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.mesh.cell_changes import blank_renew_job, clear_state, renew
from hybrid.kernels.mesh.zone_line import blank_line_job, fill_line
from hybrid.kernels.mesh.zone_switch import (
    AFTER,
    BEFORE,
    NUMBERS,
    RELAXES,
    TIME,
    begin_switch,
    blank_switch_job,
    end_switch,
)
from hybrid.kernels.mesh.zone_transfer import Transfer, blank_match
from hybrid.kernels.run.entry import NO_PUSH
from hybrid.kernels.state import books as b
from hybrid.kernels.state.books import Books
from hybrid.kernels.state.report import PLANAR, REMEMBERS
from hybrid.kernels.state.state import FIELDS, ROD, Batch, Ends, Floats, Line, State, Work
from hybrid.outputs.joined_lines import Output, outputs_in
from hybrid.simulation.cell_changes import LEAST_CELLS, CellChanges
from hybrid.simulation.envelope import Envelope, marks_on
from hybrid.simulation.line_of_run import OfRun, OneOfMany
from hybrid.simulation.zone_switching import ZoneSwitching

if TYPE_CHECKING:
    from hybrid.model.build import Model


# What of a line differs with the kinds of its cells, and lengths that are on their way.
OF_KINDS = ("h", "spin", "element", "kb", "k0", *(name for name, field in FIELDS.items() if field.rule == ROD))


def carries_all(model: Model, switching: ZoneSwitching) -> bool:
    """Whether kinds of a line can change in compiled code: nothing that they would carry is left out there."""
    line = model.line
    laws = line.torsion, line.tension_twist, line.law, line.bend_law, line.wake_law, line.moved
    bare = switching.compiled and model.payout is None and not any(x.size for x in laws)
    return bare and bool(line.bits & PLANAR or not switching.manager.twisted)


class Around(NamedTuple):
    """What a run knows of a line beside its states.

    envelope: extremes of all meshes, None: none are kept; marked: as of `marks_on`; nearest: (2,) the pair of cells
    that was nearest.
    """

    work: Work
    books: Books
    envelope: Envelope | None
    marked: Sequence[tuple[float, int]]
    nearest: np.ndarray


class LineKinds:
    """Changes of kinds of a line in its arrays: from the second of two states, which are alike, to the first."""

    def __init__(
        self, model: Model, switching: ZoneSwitching, states: tuple[State, State], around: Around, ends: Ends
    ) -> None:
        """From now on the model has a line of its own, which changes; ends: conditions in the arrays of the run."""
        assert model.layout is not None and model.on_base is not None
        self._switching, self._numbers, self._ends = switching, np.zeros(NUMBERS), ends
        line, layout, sea, zones = _copied(model.line), model.layout, model.sea.values, switching.zones
        self.model = replace(model, line=line)
        own: dict[str, Any] = {name: getattr(line, name).copy() for name in OF_KINDS}
        self._before = line._replace(**own)
        self._rods, self._rods_before = (layout.rod_cells.copy() for _ in range(2))
        self._clamps, self._held = np.zeros((2, 2, 3)), np.zeros(2, bool)
        self._fill, self._switch, self._renew = Table(blank_line_job), Table(blank_switch_job), Table(blank_renew_job)
        self._fill.bind(
            cable=model.on_base.cable, nodes=line.s, base_of_cell=layout.base_of_cell, rod=self._rods, line=line
        )
        (first, second), base = states, np.zeros(layout.rod.size)
        transfer = Transfer(
            self._before, line, second, first, layout.places, layout.places, layout.base_of_cell, layout.first,
            switching.kinks, base, self._clamps, self._held, np.ones(1, bool), blank_match(model.cells, model.cells),
        )  # fmt: skip
        self._keeps = zones.keeps.copy()  # of the kinds before
        self._switch.bind(
            transfer=transfer, ends=ends, sea=sea, target_sea=sea, zones=zones._replace(keeps=self._keeps),
            target_zones=zones,
            numbers=self._numbers, guided=switching.guided,
        )  # fmt: skip
        work, books, envelope, marked, nearest = around
        nodes, piece = line.s.size, model.cable.piece(0.5 * (line.s[1:] + line.s[:-1]))
        bounds, places, start = np.zeros((4, b.EXTREMES, 1)), np.zeros(1), np.zeros((nodes, 3))
        if envelope is not None:
            bounds, places, start = envelope.bounds, envelope.s, envelope.start
        self._renew.bind(
            s=line.s, rods=self._rods_before, to_s=line.s, to_rods=self._rods, line=line, place=layout.places,
            of=layout.base_of_cell, first=layout.first, start=start, marked=marks_on(line.s, marked),
            borne=1.0 + model.cable.max_strain[piece], state=first, twin=second, sea=sea, work=work, zones=zones,
            before=books, books=books, push=NO_PUSH, new_push=NO_PUSH, next_push=NO_PUSH, envelope_s=places,
            bounds=bounds, stays=np.zeros(nodes, np.int64), spare=np.zeros(books.extremes.size), width=np.zeros(0),
            nearest=nearest, widths=base, scale=model.tension_scale,
        )  # fmt: skip

    def change(self, change: Change, t: float) -> float:
        """Other kinds of cells from t (s) on: nothing moves; the energy, J, that is to be booked."""
        switching, model, numbers = self._switching, self.model, self._numbers
        assert model.layout is not None
        for name in OF_KINDS:
            getattr(self._before, name)[:] = getattr(model.line, name)
        self._keeps[:] = switching.zones.keeps
        layout = model.layout._replace(rod=change.rod.copy())
        self._rods_before[:], self._rods[:] = self._rods, layout.rod[model.layout.base_of_cell]
        for k, clamp in enumerate(switching.clamps(self._ends)):
            self._held[k] = clamp is not None
            if clamp is not None:
                self._clamps[k] = clamp
        numbers[TIME], numbers[RELAXES] = t, switching.zones.counts.relaxing
        fill_line(self._fill.numbers)
        clear_state(self._renew.numbers)
        begin_switch(self._switch.numbers)
        switching.manager.adopt_rods(change.rod, change, t)
        end_switch(self._switch.numbers)
        renew(self._renew.numbers)
        self.model = replace(model, layout=layout, zones=layout.zones)
        switching.take(self.model, switching.zones)
        return float(numbers[AFTER] - numbers[BEFORE])


def _copied(line: Line) -> Line:
    arrays: dict[str, Any] = {name: x.copy() for name, x in line._asdict().items() if isinstance(x, np.ndarray)}
    return line._replace(**arrays)


def copy_into(old: NamedTuple, new: NamedTuple) -> None:
    """Copy the arrays of one to those of the other."""
    for x, y in zip(old, new, strict=True):
        if isinstance(y, np.ndarray) and y.size:
            y[:] = x


# Lines of several whose cells follow the curvature: they change between two steps without Python's help.
#
# Only in a line that is joined to nothing that moves with it, which is marched by itself: what it needs for a change is
# what one cable needs (simulation.cell_changes).  Its outputs wait in rows with room for the most cells, since all
# lines
# have as many of them.

# What outputs have of nodes and of cells.
OF_NODES, OF_CELLS = ("r", "v", "vd", "kb"), ("e", "T", "a1", "w", "h")


def ends_alone(batches: Sequence[Batch]) -> Batch:
    """Outputs of one line on several meshes one behind the other, with their ends as the only nodes."""
    own: dict[str, list[Any]] = {name: [getattr(x, name) for x in batches] for name in Batch._fields}
    own |= {name: [x[:, [0, -1]] if x.size else x for x in own[name]] for name in OF_NODES}
    own |= {name: [x[:, :1] if x.size else x for x in own[name]] for name in OF_CELLS}
    return Batch(**{name: np.concatenate(x) for name, x in own.items()})


def by_itself(run: OfRun, number: int) -> bool:
    """Whether nothing but its own steps knows of the cells of a line, in a run whose solver is attached."""
    line, watched = run.lines[number], run.watch is not None and run.watch.is_needed
    alone = number in run.solver.lone and not run.solver.mixes and not watched
    return alone and line.contact is None and line.correction is None


class LineCells(CellChanges):
    """Changes of the cells of one of several lines, and of what is rod, with the solver that it has now."""

    def __init__(self, run: OfRun, number: int, switching: ZoneSwitching) -> None:
        self._many, self._line, self._solver = run, run.lines[number], run.solver
        owner = OneOfMany(run, number, switching)
        super().__init__(owner)

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
        same = self._solver is self._many.solver and self._line.watch_table is watched
        return bool(same and switching is self._switching and super().still_fits())

    @property
    def job(self) -> np.ndarray:
        """The table of kernels.run.following_run that the compiled steps get."""
        self._at.alone, self._at.may_wait = self.alone, self._owner.outputs_may_wait
        return self._following.numbers

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
