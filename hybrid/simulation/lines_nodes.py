"""Lines of several that are paid out: nodes enter and leave between two steps without Python's help.

Only in a line that is joined to nothing that moves with it and whose zones stay; what it needs for a change is what one
cable needs (simulation.payout_nodes), in steps of all lines (simulation.lines_cells).
"""

from __future__ import annotations

import numpy as np

from hybrid.kernels.run import payout_run as f
from hybrid.kernels.state.state import Batch, Floats
from hybrid.outputs.joined_lines import Output
from hybrid.simulation.line_of_run import OfRun, OneOfMany
from hybrid.simulation.lines_cells import by_itself, ends_alone
from hybrid.simulation.payout_nodes import NodeChanges, is_plain


class LineNodes(NodeChanges):
    """Nodes of one of several lines that enter and leave, with the solver that it has now."""

    def __init__(self, run: OfRun, number: int) -> None:
        self._many, self._of_line, self._solver = run, run.lines[number], run.solver
        owner = OneOfMany(run, number)
        super().__init__(owner)

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
        same = self._solver is self._many.solver and self._of_line.watch_table is watched
        return bool(same and self.still_fits())

    @property
    def job(self) -> np.ndarray:
        """The table of kernels.run.payout_run that the compiled steps get."""
        self._at.may_wait = self._owner.outputs_may_wait
        return self._following.numbers

    def change(self) -> None:
        """A node enters or leaves now."""
        f.change_node(self._following.numbers)
        self.sync()

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
