"""Equilibria of one scene, computed as finely as asked: for a result, or to compare with one."""

from __future__ import annotations

import time as clock
from functools import partial

import numpy as np

from hybrid.errors import ComputationError
from hybrid.kernels.state.forces import SEABED
from hybrid.kernels.state.state import State
from hybrid.model.bending_reference import NO_DOUBT
from hybrid.model.build import Model
from hybrid.model.network import NetworkResolution, build_system
from hybrid.model.output_points import output_points
from hybrid.model.resolution import Resolution, wants_errors
from hybrid.outputs.edge_errors import edge_errors
from hybrid.outputs.layer_errors import layer_errors
from hybrid.scene.read import scene_text
from hybrid.scene.schema import LineScene
from hybrid.scene.short_form import LINE, network_of, short_form
from hybrid.simulation.mesh_survey import Survey, survey_points
from hybrid.simulation.network_run import ALONE, NetworkRun, Recording, start_of
from hybrid.simulation.run_file import Cable
from hybrid.simulation.run_sample import COMPARED, MODEL_ERRORS, RunSample, catenary_share, compared_cells
from hybrid.simulation.run_zones import Start
from hybrid.store.array_recorder import ArrayRecorder, Target
from hybrid.store.records import ERROR_ESTIMATE
from hybrid.store.writer import Recorder


class StaticCase:
    """The equilibrium of one scene at t = 0, under loads that have grown to their full size."""

    def __init__(self, scene: LineScene) -> None:
        self.scene = scene
        self._first: tuple[Resolution, Start] | None = None

    def record(self, resolution: Resolution, target: Target) -> RunSample:
        """Compute the result into a file, or memory; what is to be compared of it."""
        begin, pending = clock.process_time(), ERROR_ESTIMATE if wants_errors(self.scene) else ""
        return _sample(self._run(resolution, target, Recording(pending=pending)), begin)

    def sample(self, resolution: Resolution) -> RunSample:
        """Compute for comparison only."""
        begin = clock.process_time()
        return _sample(self._run(resolution, None), begin)

    def survey(self, resolution: Resolution, coarse: Resolution) -> Survey | None:
        """A coarse equilibrium that shows where cells should be short; None: there is none.

        resolution: of the result.  ComputationError: there is none, and the scene gives cells to a layer.
        """
        try:
            model, _ = self.first_shape(coarse)
            s = survey_points(model, coarse)
            run = self._run(coarse, None, Recording(points={LINE: output_points(self.scene)._replace(s=s)}))
        except ComputationError:
            if self.scene.resolution is not None:
                raise
            return None
        values = _sample(run, 0.0).values
        shown = {name: np.asarray(values[name]) for name in ("position", "curvature", "tension")}
        return Survey.of(self.scene, resolution, run.lines[0].model, s, shown)

    def first_shape(self, resolution: Resolution) -> tuple[Model, State]:
        """Model and state of an equilibrium, which are kept for a result of this resolution that comes next."""
        with short_form(self.scene).said():
            start = self._start(resolution)
        assert start.found is not None
        self._first = resolution, start
        return start.model.models[0], start.found.state.lines[0]

    def _start(self, resolution: Resolution) -> Start:
        """The equilibrium of the network of one line that computes what the scene does."""
        kept, self._first = self._first, None
        if kept is not None and kept[0] is resolution:
            return kept[1]
        system = network_of(self.scene)
        return start_of(system, build_system(system, NetworkResolution({LINE: resolution})), False, None)

    def _run(self, resolution: Resolution, target: Target | None, recording: Recording = ALONE) -> NetworkRun:
        """The same, recorded."""
        with short_form(self.scene).said():
            recording = recording._replace(error=True, cable=Cable(self.scene), start=self._start(resolution))
            text = partial(scene_text, self.scene)
            run = NetworkRun(network_of(self.scene), target, text, False, recording=recording)
            if not isinstance(run.recorder, Recorder | ArrayRecorder):
                run.record_equilibrium()
                return run
            with run.recorder:
                run.record_equilibrium()
        return run


def _sample(run: NetworkRun, begin: float) -> RunSample:
    """What is compared of an equilibrium that has been recorded; begin: s of processor time, when it was begun."""
    (line,), (state,), solver = run.lines, run.state.lines, run.solver
    model, correction = line.model, line.correction
    batch = line.state_now(0.0, solver.lines[0].ends, state, solver.work[0])
    seen = line.observer.look(batch)
    shift = correction.shift(correction.corrector.sampled[:1], batch) if correction is not None else None
    values = line.observer.values_of(seen, shift=shift)
    missed = edge_errors(seen) if model.line.bits & SEABED else {}
    at_edges = {name: error[:, 0] for name, error in missed.items()}
    for name, error in layer_errors(seen, [int(np.argmin(np.abs(model.line.s - at))) for at in model.attached]).items():
        at_edges[name] = np.maximum(error, at_edges.get(name, 0.0))
    return RunSample(
        run.resolution.one, {name: np.array(values[name]) for name in COMPARED if name in values},
        compared_cells(model), 1, clock.process_time() - begin, 1, False,
        {k.removeprefix(MODEL_ERRORS): np.array(x) for k, x in values.items() if k.startswith(MODEL_ERRORS)},
        catenary=np.array([catenary_share(model.zones)]) if model.layout is not None else np.zeros(0),
        doubt=np.array(NO_DOUBT) if correction is None else correction.doubt,
        at_edges={name: error[None] for name, error in at_edges.items()},
    )  # fmt: skip
