"""Kinds of cells that change in several lines in the arrays of the run: no solver is made and nothing is bound anew."""

from __future__ import annotations

from collections.abc import Sequence

from hybrid.adapt.manager import Change
from hybrid.model.build import Model
from hybrid.simulation.kind_changes import LineKinds, carries_all, copy_into
from hybrid.simulation.run_of_lines import RunOfLines
from hybrid.simulation.zone_switching import ZoneSwitching


class RunKinds:
    """Changes of kinds in the lines of a run, with the solver, the states and the books that it has now."""

    def __init__(self, run: RunOfLines) -> None:
        self._run, self._solver, self._turns = run, run.solver, run.loop.turns
        self._lines: dict[int, LineKinds] = {}

    @staticmethod
    def apply(run: RunOfLines, switched: Sequence[ZoneSwitching]) -> bool:
        """Whether zones of these lines can change so between two steps of a run whose solver is attached."""
        attached = run.solver.turns is not None and run.solver.turns is run.loop.turns
        alone = run.payout is None and run.shared is None and not run.solver.meets
        alone &= all(line.contact is None and line.correction is None for line in run.lines)
        if not (attached and alone):
            return False
        return all(carries_all(x.model, x) and not x.zones.clock.share > 0.0 for x in switched)

    @property
    def fits(self) -> bool:
        """Whether the run is still attached as it was."""
        run = self._run
        models = all(run.model.models[k].line is x.model.line for k, x in self._lines.items())
        return models and run.solver is self._solver and run.loop.turns is self._turns

    def begin(self) -> None:
        """Before changes: the state of now is the first of the two that take turns, and the second is its copy."""
        run, (first, second) = self._run, self._turns
        before, after = (second, first) if run.state is second else (first, second)
        for old, new in zip(before.lines, after.lines, strict=True):
            copy_into(old, new)
        after.bodies[:] = before.bodies
        run.state, run.other = first, second

    def change(self, number: int, switching: ZoneSwitching, change: Change) -> tuple[Model, float]:
        """Other kinds of cells of a line: its model, and the energy (J) that is to be booked."""
        if number not in self._lines:
            self._lines[number] = self._line(number, switching)
        kinds = self._lines[number]
        kinds.model = switching.model
        self._solver.work[number].X[:] = 0.0  # kept factors of an unknown that is no more are read as zeros
        booked = kinds.change(change, self._run.t)
        return kinds.model, booked

    def _line(self, number: int, switching: ZoneSwitching) -> LineKinds:
        """A line of the solver that changes from now on."""
        run, (first, second) = self._run, self._turns
        line, model, ends = run.lines[number], run.model.models[number], self._solver.lines[number].ends
        both, around = (first.lines[number], second.lines[number]), line.around(self._solver.work[number])
        kinds = LineKinds(model, switching, both, around, ends)
        self._solver.take_line(number, kinds.model.line)
        switching.model = kinds.model
        return kinds
