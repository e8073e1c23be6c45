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
from hybrid.kernels.state.report import PLANAR
from hybrid.kernels.state.state import FIELDS, ROD, Ends, Line, State, Work
from hybrid.simulation.envelope import Envelope, marks_on
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
        switching.set_model(self.model, switching.zones)
        return float(numbers[AFTER] - numbers[BEFORE])


def _copied(line: Line) -> Line:
    arrays: dict[str, Any] = {name: x.copy() for name, x in line._asdict().items() if isinstance(x, np.ndarray)}
    return line._replace(**arrays)


def copy_into(old: NamedTuple, new: NamedTuple) -> None:
    """Copy the arrays of one to those of the other."""
    for x, y in zip(old, new, strict=True):
        if isinstance(y, np.ndarray) and y.size:
            y[:] = x
