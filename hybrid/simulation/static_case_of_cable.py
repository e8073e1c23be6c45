"""Equilibria of a cable by its own road, until there is one: this file goes with the switch."""

from __future__ import annotations

import time as clock
from collections.abc import Mapping, Sequence

import numpy as np

from hybrid.errors import Complaint, ComputationError, SceneError
from hybrid.kernels.laws.obstacles import stored_energy
from hybrid.kernels.state.forces import SEABED, SELF_CONTACT, TOUCHES
from hybrid.kernels.state.report import REPORT_SIZE, SEABED_ENERGY
from hybrid.kernels.state.state import Floats, State, batch_of_one
from hybrid.model.bending_reference import NO_DOUBT
from hybrid.model.build import Model, build
from hybrid.model.output_points import output_points
from hybrid.model.resolution import Resolution, wants_errors
from hybrid.model.sections import section_changes
from hybrid.outputs.edge_errors import edge_errors
from hybrid.outputs.layer_errors import layer_errors
from hybrid.outputs.probes import Features, Observer, Recorded
from hybrid.outputs.quantities import quantities_of
from hybrid.scene.read import scene_text
from hybrid.scene.schema import LineScene
from hybrid.simulation.bending_correction import Correction
from hybrid.simulation.contact_equilibrium import why_not, within_itself
from hybrid.simulation.diagnostics import Diagnostics, stretch_text
from hybrid.simulation.envelope import Envelope, of_equilibrium
from hybrid.simulation.equilibrium import equilibrium_of
from hybrid.simulation.events import EventLog
from hybrid.simulation.initial_zones import reasons_at_start, zones_at_start
from hybrid.simulation.mesh_survey import Survey, survey_points
from hybrid.simulation.result_file import result_recorder
from hybrid.simulation.run_sample import COMPARED, MODEL_ERRORS, RunSample, catenary_share, compared_cells
from hybrid.simulation.slack_bends import note_laid
from hybrid.simulation.zone_switching import ZoneSwitching
from hybrid.solve.statics import Equilibrium
from hybrid.solve.stepper import POWERS
from hybrid.store.array_recorder import Target
from hybrid.store.records import ERROR_ESTIMATE, PENDING, RODS_AT_START


class StaticCaseOfCable:
    """The equilibrium of one scene at t = 0, under loads that have grown to their full size."""

    def __init__(self, scene: LineScene) -> None:
        self.scene = scene
        self._begun: tuple[Resolution, tuple[Model, Equilibrium, ZoneSwitching | None]] | None = None

    def record(self, resolution: Resolution, target: Target) -> RunSample:
        """Compute the result into a file, or memory; what is to be compared of it."""
        begin = clock.process_time()
        model, found, switching = self._equilibrium(resolution)
        observer = self.observer(model)
        texts = {"scene": scene_text(self.scene)}
        if model.line.bits & SELF_CONTACT and (where := within_itself(model, np.inf, found.state)):
            refuse_contact(model, where)
        envelope = Envelope(self.scene, model, moves=False)
        pending = ERROR_ESTIMATE if wants_errors(self.scene) else ""
        manager = switching.manager if switching is not None else None
        notes = {PENDING: pending, RODS_AT_START: reasons_at_start(manager)}
        with result_recorder(self.scene, model, observer, target, texts, found, envelope, notes=notes) as recorder:
            ends, events = model.ends.at(np.inf), EventLog()
            diagnostics = Diagnostics(model, events)
            diagnostics.begin()
            diagnostics.equilibrium(found)
            note_laid(self.scene, model, found.state, events)
            report, work = np.zeros(REPORT_SIZE), np.zeros(len(POWERS))
            diagnostics.mesh(observer.look(batch_of_one(0.0, ends, found.state, report, work, model.sea.values)))
            if manager is not None and not model.line.torsion.size:
                diagnostics.torque(0.0, manager.torque * manager.compliance, manager.torque)
            stretched = diagnostics.stretch(found.state)
            stop = stretched or diagnostics.left_plane(found.state.r) or diagnostics.still(ends, found.state)
            values, at_edges, doubt = _values(model, found, observer) if stop is None else ({}, {}, np.array(NO_DOUBT))
            if stop is None:
                diagnostics.loops(
                    np.zeros(1), {name: np.asarray(x)[None] for name, x in values.items()}, observer.grid.s
                )
            events.write_to(recorder)
            if stop is not None:
                detail = stretch_text(model, found.state) if stretched else ""
                raise ComputationError(stop[0], None, float(model.line.s[stop[1]]), detail)
            recorder.save(0.0, values, observer.zone_rows)
            reached = of_equilibrium(envelope, self.scene, model, found, recorder.event)
            recorder.replace(reached)
            envelope.note_broken(reached, recorder.recorded(), recorder.event)
            recorder.close("complete", f"equilibrium: {found.summary}; residual force {found.residual:.2g} N")
        return _sample(resolution, model, values, at_edges, doubt, clock.process_time() - begin)

    def sample(self, resolution: Resolution) -> RunSample:
        """Compute for comparison only."""
        begin = clock.process_time()
        model, found, _ = self._equilibrium(resolution)
        values, at_edges, doubt = _values(model, found, self.observer(model, COMPARED))
        return _sample(resolution, model, values, at_edges, doubt, clock.process_time() - begin)

    def survey(self, resolution: Resolution, coarse: Resolution) -> Survey | None:
        """A coarse equilibrium that shows where cells should be short; None: there is none.

        resolution: of the result.  ComputationError: there is none, and the scene gives cells to a layer.
        """
        try:
            model, found, _ = self._equilibrium(coarse)
        except ComputationError:
            if self.scene.resolution is not None:
                raise
            return None
        s = survey_points(model, coarse)
        values, _, _ = _values(model, found, self.observer(model, COMPARED, s))
        run = {name: np.asarray(values[name])[None] for name in ("position", "curvature", "tension")}
        return Survey.of(self.scene, resolution, model, s, run)

    def first_shape(self, resolution: Resolution) -> tuple[Model, State]:
        """Model and state of an equilibrium, which are kept for a result of this resolution that comes next."""
        model, found, _ = begun = self._equilibrium(resolution)
        self._begun = resolution, begun
        return model, found.state

    def _equilibrium(self, resolution: Resolution) -> tuple[Model, Equilibrium, ZoneSwitching | None]:
        kept, self._begun = self._begun, None
        if kept is not None and kept[0] is resolution:
            return kept[1]
        model = build(self.scene, resolution)
        if model.layout is None:
            return model, equilibrium_of(self.scene, model, np.inf), None
        model, found, switching = zones_at_start(self.scene, model, resolution, np.inf, None, at_rest=True)
        assert found is not None
        return model, found, switching

    def observer(self, model: Model, only: Sequence[str] | None = None, at: Floats | None = None) -> Observer:
        """at: places, m, instead of the output points."""
        points = output_points(self.scene)
        points = points if at is None else points._replace(s=at)
        features = Features(
            model.attached, section_changes(self.scene), model.hinges, obstacles=() if only else model.sea.names
        )
        recorded = Recorded(
            False, only, errors=model.follows_error and wants_errors(self.scene),
            gauges=() if only else self.scene.output.elevation or (),
            quantities=None if only else quantities_of(self.scene),
        )  # fmt: skip
        return Observer(model.line, model.sea.values, model.zones, points, features, recorded)


def refuse_contact(model: Model, where: str) -> None:
    """SceneError: the equilibrium, and the shape to start from, have parts of the line in each other; where: of it."""
    expected, fix = why_not(model, np.inf)
    given = f"true, where in the equilibrium without contact {where}"
    raise SceneError([Complaint("contact.self", given, expected, f"{fix}; or leave it out")])


def _values(
    model: Model, found: Equilibrium, observer: Observer
) -> tuple[dict[str, object], dict[str, Floats], Floats]:
    """All fields of an equilibrium; what its cells miss beside edges of contact; `RunSample.doubt`."""
    ends, correction, sea = model.ends.at(np.inf), None, model.sea.values
    if model.follows_error:
        model.sea.at(np.inf)
        correction = Correction(model)
        correction.begin(ends, found.state, at_rest=True, with_friction=found.with_friction)
    report = found.report.copy()
    if model.line.bits & TOUCHES:
        report[SEABED_ENERGY] = stored_energy(model.line, sea, found.state.r)
    batch = batch_of_one(0.0, ends, found.state, report, np.zeros(len(POWERS)), sea)
    if found.touch.size:
        batch = batch._replace(touch=found.touch[None])
    shift = correction.shift(correction.corrector.sampled[:1], batch) if correction is not None else None
    seen = observer.look(batch)
    values = {name: x[0] for name, x in observer.values_of(seen, shift=shift).items()}
    doubt = correction.doubt if correction is not None else np.array(NO_DOUBT)
    missed = edge_errors(seen) if model.line.bits & SEABED else {}
    found_errors = {name: error[:, 0] for name, error in missed.items()}
    loads = [int(np.argmin(np.abs(model.line.s - at))) for at in model.attached]
    for name, error in layer_errors(seen, loads).items():
        found_errors[name] = np.maximum(error, found_errors.get(name, 0.0))
    return values, found_errors, doubt


def _sample(
    resolution: Resolution, model: Model, values: Mapping[str, object], at_edges: Mapping[str, Floats], doubt: Floats,
    cpu: float,
) -> RunSample:  # fmt: skip
    kept = {name: np.array(values[name])[None] for name in COMPARED if name in values}
    left = {k.removeprefix(MODEL_ERRORS): np.array(x)[None] for k, x in values.items() if k.startswith(MODEL_ERRORS)}
    catenary = np.array([catenary_share(model.zones)]) if model.layout is not None else np.zeros(0)
    return RunSample(
        resolution, kept, compared_cells(model), 1, cpu, 1, False, left, catenary=catenary, doubt=doubt,
        at_edges={name: error[None] for name, error in at_edges.items()},
    )  # fmt: skip
