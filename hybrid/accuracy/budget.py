"""How much all results for an accuracy may take: some times what the first result foretells of them.

It goes by steps, cells and outputs, not by a clock, so that a run that is resumed is refined as often as one that was
not stopped.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hybrid.accuracy.refinement import times_the_cost
from hybrid.model.model_costs import COST_STEP
from hybrid.model.resolution import Resolution
from hybrid.simulation.run_sample import RunSample

# s of processor time of a cell in a step, and of an output and one of its points (bench/test_bench_plan.py).
CELL, OUTPUT, POINT = 1e-6, 0.06e-3, 0.6e-6
# Of the steps of the first result, what the runs to compare with take, and, on average, the finer results.
COMPARISONS, FINER = 0.9, 0.5
# All may take so many times what was foretold; less than so much, in s, is not worth a result that misses.
MOST_TIMES, LEAST = 4.0, 10.0


@dataclass
class Budget:
    """What results have taken and may take, s of processor time as foretold; outputs: of one, number and points."""

    outputs: int
    points: int
    first: float = 0.0  # of the steps of the first result
    spent: float = 0.0  # of all until now
    beyond: float = 0.0  # times what was foretold that all would take with the next; 0: within

    @property
    def _of_outputs(self) -> float:
        return self.outputs * (OUTPUT + POINT * self.points)

    @property
    def foretold(self) -> float:
        """What all of them take, by the first."""
        return self._of_outputs + self.first * (1.0 + COMPARISONS + FINER)

    def spend(self, runs: Sequence[RunSample]) -> None:
        """A result is there; runs: of its lines."""
        steps = _of_steps(runs)
        if not self.first:
            self.first, self.spent = steps, COMPARISONS * steps
        self.spent += steps + self._of_outputs

    def allows(self, runs: Sequence[RunSample], finer: Sequence[Resolution]) -> bool:
        """Whether a finer result than the last, of these runs, may follow."""
        more = max(times_the_cost(run.resolution, x) for run, x in zip(runs, finer, strict=True))
        total = self.spent + more * _of_steps(runs) + self._of_outputs
        self.beyond = total / self.foretold if total > max(MOST_TIMES * self.foretold, LEAST) else 0.0
        return not self.beyond

    def text(self, runs: Sequence[RunSample], finer: Sequence[Resolution]) -> str:
        """Why it does not, and what it would take; arguments as of `allows`."""
        finer_by = [x.fineness / run.resolution.fineness for run, x in zip(runs, finer, strict=True)]
        more = [times_the_cost(run.resolution, x) for run, x in zip(runs, finer, strict=True)]
        cells = sum(run.cells * by for run, by in zip(runs, finer_by, strict=True))
        steps = runs[0].steps * max(one / by for one, by in zip(more, finer_by, strict=True))
        return (
            f"refined no further: with the next run, of about {cells:.2g} cells and {steps:.2g} steps, all would take "
            f"{self.beyond:.2g} times the processor time that the first result foretold, and {MOST_TIMES:g} are allowed"
        )

    def checkpoint(self) -> list[float]:
        """As plain values."""
        return [self.first, self.spent]

    def restore(self, saved: Sequence[float]) -> None:
        """Go on as `checkpoint` has said."""
        self.first, self.spent = saved


def _of_steps(runs: Sequence[RunSample]) -> float:
    return sum(run.steps * (COST_STEP + CELL * run.cells) for run in runs)
