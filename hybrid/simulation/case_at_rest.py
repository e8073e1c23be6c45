"""The equilibria of one scene, of any number of lines: for a result, and to compare with one."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext

import numpy as np

from hybrid.kernels.state.report import SEABED
from hybrid.model.material import NO_DOUBT
from hybrid.model.network import NetworkResolution
from hybrid.outputs.edge_errors import edge_errors, layer_errors
from hybrid.scene.root import Scene
from hybrid.scene.short_form import LINE
from hybrid.simulation.case import Case
from hybrid.simulation.line_result import LineResult
from hybrid.simulation.network_run import NetworkRun, Recording
from hybrid.simulation.run_sample import (
    ALL,
    COMPARED,
    MODEL_ERRORS,
    RunSample,
    Samples,
    catenary_share,
    compared_cells,
)
from hybrid.store.array_contents import Target
from hybrid.store.named_arrays import Tree
from hybrid.store.records import ERROR_ESTIMATE
from hybrid.store.whole_file import LateFile


class CaseAtRest(Case):
    """The equilibrium of one scene at t = 0, under loads that have grown to their full size."""

    moves = False

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene, None)
        self.places = dict.fromkeys(self.lines, ALL)  # there is one output

    def record(self, resolution: NetworkResolution, target: Target, before: Tree | None = None) -> Samples:
        """Compute the result into a file, or memory; what is to be compared of it.  before: nobody goes on with it."""
        begin, recording = clock.process_time(), Recording(pending=ERROR_ESTIMATE if self.wants_errors else "")
        return self._move(self._network_run(resolution, target, recording), begin, first=True)

    def beside(
        self, samples: Sequence[Callable[[], Samples]]
    ) -> AbstractContextManager[Sequence[Callable[[], Samples]]]:
        """Equilibria are found one after the other."""
        return nullcontext(samples)

    def _compute(self, run: NetworkRun, interrupted: Callable[[], bool]) -> None:
        run.record_equilibrium()

    def _compared(self, run: NetworkRun, target: Target, cpu: float, late: LateFile | None) -> Samples:
        return {LINE: _sample(run, cpu)} if self.flat else super()._compared(run, target, cpu, late)

    def _compared_line(self, line: LineResult, run: NetworkRun, cpu: float, judged: bool) -> RunSample:
        return _sample(run, cpu) if self.flat else super()._compared_line(line, run, cpu, judged)


def _sample(run: NetworkRun, cpu: float) -> RunSample:
    """What is compared of the equilibrium of a cable that has been recorded; cpu: s, that it took."""
    (line,), (state,), solver = run.lines, run.state.lines, run.solver
    model, correction = line.model, line.correction
    batch = line.state_now(0.0, solver.lines[0].ends, state, solver.work[0])
    seen = line.observer.observation(batch)
    shift = correction.shift(correction.corrector.sampled[:1], batch) if correction is not None else None
    values = line.observer.values_of(seen, shift=shift)
    missed = edge_errors(seen) if model.line.bits & SEABED else {}
    at_edges = {name: error[:, 0] for name, error in missed.items()}
    for name, error in layer_errors(seen, [int(np.argmin(np.abs(model.line.s - at))) for at in model.attached]).items():
        at_edges[name] = np.maximum(error, at_edges.get(name, 0.0))
    return RunSample(
        run.resolution.one, {name: np.array(values[name]) for name in COMPARED if name in values},
        compared_cells(model), 1, cpu, 1, False,
        {k.removeprefix(MODEL_ERRORS): np.array(x) for k, x in values.items() if k.startswith(MODEL_ERRORS)},
        catenary=np.array([catenary_share(model.zones)]) if model.layout is not None else np.zeros(0),
        doubt=np.array(NO_DOUBT) if correction is None else correction.doubt,
        at_edges={name: error[None] for name, error in at_edges.items()},
    )  # fmt: skip
