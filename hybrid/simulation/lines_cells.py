"""Lines of several whose cells follow the curvature: they change between two steps without Python's help.

Only in a line that is joined to nothing that moves with it, which is marched by itself: what it needs for a change is
what one cable needs (simulation.cell_changes).  Its outputs wait in rows with room for the most cells, since all lines
have as many of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.kernels.state.forces import REMEMBERS
from hybrid.kernels.state.state import Batch, Floats
from hybrid.outputs.joined_lines import Output, outputs_in
from hybrid.simulation.cell_changes import LEAST_CELLS, CellChanges
from hybrid.simulation.kind_changes import carries_all
from hybrid.simulation.line_of_run import OfRun, OneOfMany
from hybrid.simulation.zone_switching import ZoneSwitching

if TYPE_CHECKING:  # a line that is not paid out does without
    pass


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
