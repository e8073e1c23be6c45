"""What the errors of a result will be, from the runs to compare with alone: so that the first result is fine enough.

docs/accuracy.md
"""

from __future__ import annotations

from dataclasses import replace
from math import sqrt

import numpy as np

from hybrid.model.resolution import RequestedAccuracy, Resolution
from hybrid.simulation.error_estimate import LEAST_RATIO, Estimate
from hybrid.simulation.error_order import COARSER, around, at_all_outputs, refinement
from hybrid.simulation.error_statistics import snaps
from hybrid.simulation.refinement import Free, judge, refined
from hybrid.simulation.run_sample import RunSample, every_of

# Order with which errors are taken to fall from the runs to compare with to the result, which would show it.
LIKELY = 1.75
# The first result is at most this much finer than without a forecast, which the coarsest of all runs is part of.
FORECAST_FINER = 1.6
# A forecast of more times what is asked is of runs that are too coarse to say anything: the result has to show it.
FORECAST_MOST = 4.0


class Forecast(Estimate):
    """Errors of the first of the runs to compare with, in place of a result."""

    def __init__(self, coarse: RunSample, rough: RunSample | None, coarsest: RunSample) -> None:
        """As of `Estimate`: coarse has the cells of rough and shorter steps, coarsest has those of rough."""
        every = coarse.every
        first, last = replace(coarse, every=1), replace(coarsest, every=coarsest.every // every)
        super().__init__(first, last, None, None)
        self.order = dict.fromkeys(self.order, LIKELY)
        if rough is not None and coarse.steps > LEAST_RATIO * rough.steps:
            self._slower = replace(rough, every=rough.every // every)

    _slower: RunSample | None = None

    def _by_step(self, name: str, a: int, b: int) -> np.ndarray | None:
        """Error by the time step of the outputs from number a to b, with its sign; None: not known."""
        rough = self._slower
        if rough is None or name not in rough.values:
            return None
        known, own = around(every_of(len(self.run.values[name]), rough.every), a, b)
        change = self.run.some(name, known) - rough.values[name][own]
        late = change / ((self.run.steps / rough.steps) ** self.order[name] - 1.0)
        return at_all_outputs(late, known, a, b)


def forecast(
    asked: RequestedAccuracy, resolution: Resolution, free: Free, runs: tuple[RunSample, RunSample | None, RunSample]
) -> Resolution:
    """How finely the first result is computed: as `resolution`, or finer where that would miss what is asked.

    runs: to compare with, as of `Forecast`; they were computed for `resolution`.  Where a line snaps, values at an
    instant may not converge, and nothing is forecast.
    """
    coarse, rough, coarsest = runs
    if snaps(coarse) or coarse.cells < LEAST_RATIO * coarsest.cells:
        return resolution
    found = Forecast(coarse, rough, coarsest)
    verdict = judge(asked, found.errors, found.run)
    falls = COARSER**-LIKELY
    mesh, time = falls * verdict.mesh, falls * verdict.time
    ratio = mesh + time + verdict.model
    if not 1.0 < ratio <= FORECAST_MOST:
        return resolution
    at_result = replace(verdict, ratio=ratio, mesh=mesh, time=time)
    finer = refined(resolution, at_result, free._replace(zones=False), FORECAST_FINER)
    if finer is None:
        return resolution
    cells, steps = refinement(finer, resolution)
    least = sqrt(max(cells, steps))  # which of the two errs is less certain than what both do
    cells, steps = max(cells, least) if free.mesh else 1.0, max(steps, least) if free.steps else 1.0
    return resolution.coarser(1.0 / cells, 1.0 / steps)
