"""The loop over time of one run: what `Transient` computes is recorded, watched by `Diagnostics`, perhaps stopped."""

from __future__ import annotations

import io
import time as clock
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from hybrid.errors import ComputationError
from hybrid.kernels.report import BEND, TWIST_NODE
from hybrid.kernels.state import batch_of_one
from hybrid.outputs.probes import Observer
from hybrid.scene.motion_checks import ramp_ends
from hybrid.simulation.diagnostics import Diagnostics, Stop
from hybrid.simulation.failure import explanation, failed_node, snapshot
from hybrid.simulation.restart import LoadChange
from hybrid.simulation.restore import program, resolution_tree
from hybrid.simulation.transient import StepFailed, Transient
from hybrid.solve.statics import Equilibrium
from hybrid.solve.stepper import Taken
from hybrid.store.memory_recorder import MemoryRecorder
from hybrid.store.named_arrays import matched
from hybrid.store.writer import Recorder


class TimeLoop:
    """One run from output to output."""

    def __init__(
        self,
        run: Transient,
        observer: Observer,
        target: Path | io.BytesIO | None,
        report: Callable[[Transient, bool], None],
        interrupted: Callable[[], bool],
    ) -> None:
        """target: of the result, beside which a failure leaves a snapshot; None: a run to compare with, which leaves
        none and whose outputs are not watched.  report: called after every step, and when the run has come to its end.
        """
        self.run, self.observer, self.target = run, observer, target
        self.recorder: Recorder | MemoryRecorder = MemoryRecorder()
        self.diagnostics = Diagnostics(run.model, run.events)
        self._report, self._interrupted = report, interrupted
        self._observed = run.model  # by the observer
        self._cpu = clock.process_time()  # at the start of the run

    def begin(self, equilibrium: Equilibrium | None) -> None:
        """The first state, and the first output."""
        run = self.run
        self.diagnostics.begin()
        if equilibrium is not None:
            self.diagnostics.equilibrium(equilibrium)
        try:
            run.begin(equilibrium)
        except StepFailed as failed:
            self._fail(failed.taken, failed.dt)
        self.diagnostics.follow(run.model)
        self._stop_if(self.diagnostics.stretch(run.state))
        self._stop_if(self.diagnostics.still(run.model.ends.values, run.state))
        self.diagnostics.scheme(run.rho)
        self._output()
        self._checkpoint()

    def to_the_end(self, outputs: Sequence[float], changes: Sequence[LoadChange] = ()) -> None:
        """To the last output, with the changes of loads on the way that are still to come."""
        run, due = self.run, set(outputs)
        try:
            for change in changes[run.changes :]:
                self._until([*(x for x in outputs if x < change.t), change.t], due)
                run.change_loads(change.scene)
                self._checkpoint()
            self._until(outputs, due)
        except StepFailed as failed:
            self._fail(failed.taken, failed.dt)
        finally:
            run.events.write_to(self.recorder)
        self._report(run, True)

    def close(self) -> None:
        """The run is complete: a last checkpoint, what is to be said of all of it, and the file is closed."""
        self._checkpoint(at_once=True)
        self.diagnostics.finish()
        self.run.events.write_to(self.recorder)
        self.recorder.close("complete", f"{self.run.steps} steps")

    def _until(self, stops_at: Sequence[float], outputs: set[float]) -> None:
        """Steps end at the stops, where ends are let go, and, if their length is controlled, where loads have grown."""
        run, end = self.run, stops_at[-1]
        breaks = run.model.ends.breaks
        stops = {*stops_at, *(t for t in breaks if t < end)}
        if run.control is not None:
            stops |= {t for t in ramp_ends(run.scene) if t < end}
        for stop in sorted(t for t in stops if t > run.t):
            for until in run.step_ends(stop):
                self._advance(until)
                self._report(run, False)
                if self._interrupted():
                    run.events.write_to(self.recorder)
                    self.recorder.close("interrupted", f"stopped from outside at t = {run.t:.6g} s")
                    raise KeyboardInterrupt
            if stop in outputs:
                self._output()
            if stop in breaks:
                run.restart()
            if stop in outputs:
                self._checkpoint()

    def _advance(self, until: float) -> None:
        """Take the steps to `until`; each is logged and looked at."""
        run, diagnostics = self.run, self.diagnostics
        for step in run.advance(until):
            self.recorder.log(step._asdict() | {"cpu": clock.process_time() - self._cpu})
            diagnostics.follow(run.model)
            if self.target is not None:
                diagnostics.step(step.t, step.dt, run.rho, run.before, run.state)
                self._stop_if(diagnostics.stretch(run.state))
            self._stop_if(diagnostics.shape(step.t, run.stepper.told[BEND : TWIST_NODE + 1], run.state))
            if run.model.slack == "warn":
                diagnostics.tension(step.t, run.state)
            run.events.write_to(self.recorder)

    def _output(self) -> None:
        """Record an output, and look at it."""
        run, diagnostics = self.run, self.diagnostics
        model, switching = run.model, run.switching
        if model is not self._observed:
            self.observer, self._observed = self.observer.on(model.line, model.sea.values, model.zones), model
        observer, ends, work = self.observer, model.ends.at(run.t), np.array(run.work)
        batch = batch_of_one(run.t, ends, run.state, run.stepper.work.report, work, model.sea.values)
        ratios = None
        if switching is not None and observer.writes_criteria:
            ratios = switching.manager.largest_ratios(observer.grid.s)[None]
        shifts = [run.correction.shift(run.state)] if run.correction is not None else None
        fields = observer.values_of(batch, ratios, shifts)
        self.recorder.save_batch(batch.t, fields, observer.zone_rows)
        if self.target is None:
            return
        values = {name: x[0] for name, x in fields.items()}
        diagnostics.follow(model)
        diagnostics.mesh(run.t, run.state)
        diagnostics.rest(run.t, ends, values, run.state)
        if switching is not None:
            manager = switching.manager
            diagnostics.torque(run.t, manager.torque * manager.compliance, manager.torque)
        stop = diagnostics.energy(run.t, values, work, run.state)
        run.events.write_to(self.recorder)
        self._stop_if(stop)

    def _stop_if(self, stop: Stop) -> None:
        """Stop where going on would make no sense."""
        if stop is not None:
            self._fail(Taken(stop[0], 0, 0.0, stop[1], 0.0), 0.0)

    def _fail(self, taken: Taken, dt: float) -> NoReturn:
        """The run cannot go on: leave its last good state and an output, and say where and why."""
        run = self.run
        s = float(run.model.line.s[failed_node(run, taken)])
        detail = explanation(run, taken, dt)
        left = snapshot(run, self.target, taken, dt) if self.target is not None else None
        error = ComputationError(taken.outcome, run.t, s, detail, left)
        if run.t > self.recorder.last:
            self._output()
        run.events.event(run.t, s, s, taken.outcome.name.lower(), str(error))
        run.events.write_to(self.recorder)
        raise error from None

    # --- checkpoints ----------------------------------------------------------------------------

    def _checkpoint(self, at_once: bool = False) -> None:
        """Bring the file up to date, with a checkpoint at the output just written, if it is time to (or `at_once`)."""
        recorder = self.recorder
        self.run.events.write_to(recorder)
        if isinstance(recorder, Recorder) and (at_once or recorder.due):
            recorder.flush(self._content if isinstance(self.target, Path) else None)

    def _content(self) -> dict[str, Any]:
        switching = self.run.switching
        asks = switching is not None and switching.manager.user is not None
        return {
            "program": program(),
            "asks": asks,
            "resolution": resolution_tree(self.run.resolution),
            "state": self.checkpoint(),
        }

    def checkpoint(self) -> dict[str, Any]:
        """What the rest of the run depends on, between two steps."""
        return self.run.checkpoint() | {
            "watch": self.diagnostics.checkpoint(), "cpu": clock.process_time() - self._cpu,
            "first_energy": self.observer.first_energy or 0.0,
        }  # fmt: skip

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Continue as `checkpoint` has said; ValueError or ResultError where that cannot be."""
        mine = {"watch": self.diagnostics.checkpoint(), "cpu": 0.0, "first_energy": 0.0}
        self.run.restore({name: x for name, x in saved.items() if name not in mine})
        found = matched({name: saved[name] for name in mine}, mine, "state")
        self._cpu = clock.process_time() - found["cpu"]
        self.observer.first_energy = found["first_energy"]
        self.diagnostics.restore(found["watch"])
