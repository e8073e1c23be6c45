"""The loop over time of one run: what `Transient` computes is recorded, watched by `Diagnostics`, perhaps stopped."""

from __future__ import annotations

import time as clock
from bisect import bisect_left
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from hybrid.errors import ComputationError, Outcome
from hybrid.kernels.state.books import AT_STOP, FAILED, JUMPED, LOG, PAUSED, STEPPED, STRETCHED
from hybrid.kernels.state.state import Batch, batch_of_one
from hybrid.model.mesh import Zone
from hybrid.model.plan import SAME_STOP
from hybrid.outputs.joined_lines import Output
from hybrid.outputs.observation import Observation
from hybrid.outputs.probes import Observer
from hybrid.scene.motion_checks import ramp_ends
from hybrid.scene.read import scene_text
from hybrid.simulation.deferred_recorder import DeferredRecorder
from hybrid.simulation.diagnostics import UNWATCHED, Diagnostics, Stop
from hybrid.simulation.failure import Stopped, explanation, first_remedy, touch_text, winch_text, write_snapshot
from hybrid.simulation.load_change import change_loads
from hybrid.simulation.outputs_aside import OutputsAside, may_be_joined
from hybrid.simulation.releases import due
from hybrid.simulation.restart import LoadChange
from hybrid.simulation.restore import program, resolution_tree
from hybrid.simulation.slack_bends import note_laid
from hybrid.simulation.step_events import count_energy_gains, count_iterations
from hybrid.simulation.transient import StepFailed, Transient
from hybrid.simulation.transient_checkpoint import checkpoint, restore
from hybrid.simulation.vibration_steps import VibrationSteps
from hybrid.solve.run import Tried
from hybrid.solve.statics import Equilibrium
from hybrid.store.array_recorder import ArrayRecorder, Target
from hybrid.store.comparison_recorder import ComparisonRecorder
from hybrid.store.named_arrays import matched
from hybrid.store.writer import Recorder

# Rows of the log that wait for an output at most.
LOGGED = 100


# Steps times cells from one checkpoint to the next, about 5 s of computing.
WORK = 10_000_000

# Columns of the step log that runs to compare with keep: time, forces at both ends.
FORCE_COLUMNS = [LOG.index(name) for name in ("t", "end_force_start", "end_force_end")]


def apart(stops: Iterable[float], t: float, step: float) -> list[float]:
    """Stops after t in their order; of those that are the same but for round-off the last."""
    out: list[float] = []
    for stop in sorted([x for x in stops if x > t + SAME_STOP * step]):
        if out and stop - out[-1] <= SAME_STOP * step:
            out.pop()
        out.append(stop)
    return out


def falls_on(stop: float, times: Sequence[float], step: float) -> bool:
    """Whether a stop is one of the times, which are in order, but for round-off: by halves, at each of many stops."""
    k = bisect_left(times, stop - SAME_STOP * step)
    return k < len(times) and times[k] <= stop + SAME_STOP * step


class TimeLoop:
    """One run from output to output."""

    def __init__(
        self,
        run: Transient,
        observer: Observer,
        target: Target | None,
        report: Callable[[Transient, bool], None],
        interrupted: Callable[[], bool],
    ) -> None:
        """target: of the result, beside which a failure leaves a snapshot; None: a run to compare with, which leaves
        none and whose outputs are not watched.  report: called about ten times a second, and when the run has come to
        its end.
        """
        self.run, self.observer, self.target = run, observer, target
        self.recorder: Recorder | ArrayRecorder | ComparisonRecorder | DeferredRecorder = ComparisonRecorder(
            FORCE_COLUMNS
        )
        self.diagnostics = Diagnostics(run.model, run.events)
        self._report, self._interrupted = report, interrupted
        self._observed = run.model  # by the observer
        self.shown: Callable[[Batch], None] | None = None  # what looks at outputs beside the recorder
        self._cpu = clock.process_time()  # at the start of the run
        # whether steps and outputs wait in the buffers of the run until these are full
        self.patient = bool(run.resolution.ends)
        self._aside = OutputsAside()
        self._ratios: list[np.ndarray] = []  # (criteria, points) of outputs that wait, where criteria are written
        run.asks_samples = run.switching is not None and observer.writes_criteria
        self._vibration = VibrationSteps(run.scene, run.resolution)
        self._kept = (-1, 0)  # steps and changes at the last checkpoint
        self._logged = 0.0  # s of processor time since then, at the last row of the log

    @property
    def cpu(self) -> float:
        """s of processor time, with what was spent before it was restored."""
        return clock.process_time() - self._cpu

    def begin(self, equilibrium: Equilibrium | None) -> None:
        """The first state, and the first output."""
        run = self.run
        self.diagnostics.begin()
        if equilibrium is not None:
            self.diagnostics.equilibrium(equilibrium)
            note_laid(run.scene, run.model, equilibrium.state, run.events)
        try:
            run.begin(equilibrium)
        except StepFailed as failed:
            self.fail(failed.tried, failed.dt)
        self.diagnostics.follow(run.model)
        self._stop_if(self.diagnostics.stretch(run.state) or self.diagnostics.left_plane(run.state.r))
        self._stop_if(self.diagnostics.still(run.model.ends.values, run.state))
        self._vibration.begin(run.run.clock)
        self.diagnostics.scheme(run.rho)
        self.diagnostics.watch(run.run.clock)
        self._settle()
        self._checkpoint()

    def to_the_end(self, duration: float, exact: bool, changes: Sequence[LoadChange] = ()) -> None:
        """To the end at `duration` (s), with the changes of loads on the way that are still to come.

        exact: whether steps end at outputs.
        """
        run = self.run
        run.outputs_may_wait = self._may_be_joined and not self.patient
        try:
            for change in changes[run.changes :]:
                self.until(change.t, exact)
                change_loads(run, change.scene)
                self._settle()
                self._checkpoint()
            self.until(duration, exact)
        except StepFailed as failed:
            self.fail(failed.tried, failed.dt)
        finally:
            run.events.write_to(self.recorder)
        self._report(run, True)

    def close(self) -> None:
        """The run is complete: a last checkpoint, what is to be said of all of it, and the file is closed."""
        if self.patient:
            self.write_down(everything=True)
        self._checkpoint(last=True)
        self.finish()
        self.recorder.close("complete", f"{self.run.steps} steps")

    def finish(self) -> None:
        """After the last step: the envelope, what is to be said of all of the run, and limits that are broken."""
        run = self.run
        self.write_envelope()
        self.diagnostics.finish(run.run.books)
        if run.envelope is not None:
            run.envelope.note_broken(run.envelope_values(), self.recorder.recorded(), run.events.event)
        count_iterations(run.run.clock, run.run.count, run.model.length, run.events)
        count_energy_gains(run)
        if run.itself is not None and self.target is not None:
            run.itself.tell_unkept(run.model, run.events.event)
        run.events.write_to(self.recorder)

    def write_envelope(self) -> None:
        """Extremes up to now, for the file; where none are kept, nothing."""
        self.recorder.replace(self.run.envelope_values())

    def until(self, end: float, exact: bool) -> None:
        """Steps end where ends are let go, and, if their length is controlled, where loads have grown."""
        run = self.run
        self._release_due()
        breaks = run.model.ends.breaks
        stops = [t for t in (*breaks, *run.model.ends.release_times) if t < end]
        if run.controlled:
            stops += [t for t in (*ramp_ends(run.scene), *self._vibration.begins) if t < end]
        stops += [t for t in run.resolution.ends if t < end]
        if exact:
            stops += [float(t) for t in run.run.books.outputs if t < end]
        for stop in apart([*stops, end], run.t, run.resolution.step):
            while self._vibration.look < stop - SAME_STOP * run.resolution.step:
                self.go_to(self._vibration.look)
                self.write_down(everything=True)
                self._vibration.judge(run.run.clock)
            self.go_to(stop)
            self._vibration.begin(run.run.clock)
            if exact or run.resolution.ends:
                run.begin_leg()
            if breaks and any(abs(t - stop) <= SAME_STOP * run.resolution.step for t in breaks):
                run.restart()
                self._settle()
            self._release_due()

    def _release_due(self) -> None:
        """Let ends go whose time has come; a run that is resumed may stand just before that."""
        for k in due(self.run.model, self.run.t, self.run.resolution.step):
            self.release(k, f"at t = {self.run.t:.6g} s (release_at.time)")

    def release(self, k: int, why: str) -> None:
        """Let end k (0 or 1) go now; why: for the event."""
        self.write_down(everything=True)
        self.run.release(k, why)
        self.run.events.write_to(self.recorder)
        self._settle()

    def go_to(self, stop: float, begun: int | None = None) -> None:
        """Steps up to `stop` (s), where one ends; StepFailed or ComputationError: they stop before.

        begun: as of `Transient.advance`.
        """
        run = self.run
        for code in run.advance(stop, begun):
            self._keep_ratios(int(run.run.count.samples))
            if code in (PAUSED, FAILED) or (code == AT_STOP and (self._aside or not self.patient)):
                self.write_down()
            elif not self._may_wait:
                self.write_down(aside=(run.cells_follow or run.pays_out) and self._may_be_joined)
            if code == STEPPED:
                self.diagnostics.follow(run.model)
                self._look(int(run.run.count.notices))
            elif code in (PAUSED, AT_STOP):
                self._pause()

    @property
    def _may_wait(self) -> bool:
        """Whether outputs may wait in the buffer of the run: nothing that they are made of changes."""
        return self.run.unchanging and not (self.patient and self.observer.writes_criteria)

    def _settle(self) -> None:
        """After a start: powers of the new state, and its output where one is due.

        That of a run to compare with waits for those after it, if nothing changes until then.
        """
        for _ in self.run.advance(self.run.t):
            if self.target is not None or not self._may_wait:
                self.write_down()

    def _pause(self) -> None:
        """Between two calls of the compiled run: report, and hear of interrupts."""
        run = self.run
        self._report(run, False)
        if run.between_steps:
            self._checkpoint()
        if self._interrupted():
            if run.between_steps:
                self._checkpoint(last=True)
            self._log()
            self.write_envelope()
            run.events.write_to(self.recorder)
            self.recorder.close("interrupted", f"stopped from outside at t = {run.t:.6g} s")
            raise KeyboardInterrupt

    def _look(self, flags: int) -> None:
        """Look at what a step has flagged; the stretch of a run to compare with is not its matter."""
        if self.target is None:
            flags &= ~(STRETCHED | JUMPED)
        self._stop_if(self.diagnostics.look(self.run.run, flags))
        self.run.events.write_to(self.recorder)

    # --- what is written down -------------------------------------------------------------------

    def write_down(self, everything: bool = False, aside: bool = False) -> None:
        """Record the outputs since the last call, and log the steps; everything: even if they are few; aside: outputs

        are put aside, to be recorded with others.
        """
        run = self.run
        for outputs in run.waiting():
            self._put_aside(outputs)
        batch = run.run.samples(run.model.ends.values)
        run.empty()
        if aside:
            if batch is not None:
                self._put_aside(run.outputs_of_now(batch))
            return
        if everything or batch is not None or self._aside or run.run.count.rows > LOGGED:
            self._log()
        self._record_aside()
        if batch is not None:
            self._record(batch, run.run.sampled_errors)

    @property
    def _may_be_joined(self) -> bool:
        """Whether outputs of other cells can be looked at together."""
        return self.run.correction is None and may_be_joined(self.observer, self.run.model.line)

    def _put_aside(self, outputs: list[Output]) -> None:
        """Outputs of a line of the zones of now, to be recorded with others."""
        self._aside.put(self.run.model, outputs)
        self._note_torque()
        if self._aside.full:
            self._log()
            self._record_aside()

    def _record_aside(self) -> None:
        """Record what was put aside, and look at it."""
        if self._aside:
            stop = self._aside.record(
                self.observer, self.recorder, self.diagnostics if self.target is not None else None
            )
            self.run.events.write_to(self.recorder)
            self._stop_if(stop)

    def _log(self) -> None:
        """Log the steps, their processor time spread evenly over them."""
        rows = self.run.run.log()
        now = clock.process_time() - self._cpu
        cpu = np.linspace(self._logged, now, len(rows) + 1)[1:]
        self._logged = now
        if len(rows):
            self._vibration.log(rows[:, FORCE_COLUMNS])
            self.recorder.log_rows(np.column_stack([rows, cpu]))

    def _record(self, batch: Batch, errors: np.ndarray) -> None:
        """Record outputs, and look at them; errors: of the model, as sampled with them."""
        run, model = self.run, self.run.model
        if self.shown is not None:
            self.shown(batch)
        if model is not self._observed:
            self.observer = self.observer.on(model.line, model.sea.values, model.zones, model.hinges)
            self._observed = model
        observer, ratios, count = self.observer, None, batch.t.size
        if observer.writes_criteria:
            self._keep_ratios(count)
            ratios, self._ratios = np.array(self._ratios[:count]), self._ratios[count:]
        if run.payout is not None:
            shift = run.correction.shift(errors, batch) if run.correction is not None else None
            there, seen, zones = run.payout.look(observer, model, batch)
            self._save(there, seen, there.values_of(seen, ratios, shift), zones)
            observer.first_energy = there.first_energy
            return
        shift = run.correction.shift(errors, batch) if run.correction is not None else None
        seen = observer.look(batch)
        self._save(observer, seen, observer.values_of(seen, ratios, shift))

    def _save(
        self, observer: Observer, seen: Observation, values: dict[str, np.ndarray], later: Sequence[Sequence[Zone]] = ()
    ) -> None:
        """Record the values of outputs, and look at them; later: zones of all but the first, where they differ."""
        more = [observer.rows_of(zones) for zones in later]
        self.recorder.save_batch(seen.batch.t.copy(), values, observer.zone_rows, more)
        if self.target is None:
            return
        run, diagnostics = self.run, self.diagnostics
        diagnostics.follow(run.model)
        stop = diagnostics.outputs(seen, values)
        self._note_torque()
        run.events.write_to(self.recorder)
        self._stop_if(stop)

    def _note_torque(self) -> None:
        """A torque that no catenary passes on."""
        run, switching = self.run, self.run.switching
        if self.target is not None and switching is not None and not run.model.line.torsion.size:
            manager = switching.manager
            self.diagnostics.torque(run.t, manager.torque * manager.compliance, manager.torque)

    def _keep_ratios(self, count: int) -> None:
        """Of the outputs that wait, `count` by now: the largest ratios of criteria since the output before."""
        switching, new = self.run.switching, count - len(self._ratios)
        if new > 0 and switching is not None and self.observer.writes_criteria:
            self._ratios += [switching.manager.largest_ratios(self.observer.grid.s)] * new

    def _record_now(self) -> None:
        """Record the state as it is, whatever outputs are due."""
        run, model = self.run, self.run.model
        books = run.run.books
        ends = model.ends.at(run.t)
        batch = batch_of_one(run.t, ends, run.state, books.report[0], books.work[0], model.sea.at(run.t))
        self._record(batch, books.model_error[:1])

    def _stop_if(self, stop: Stop) -> None:
        """Stop where going on would make no sense."""
        if stop is not None:
            self.fail(Tried(stop[0], 0, 0.0, stop[1]), 0.0)

    def fail(self, tried: Tried, dt: float) -> NoReturn:
        """The run cannot go on: leave its last good state and an output, and say where and why."""
        run = self.run
        stopped = self._stopped(tried, dt)
        s, left = float(run.model.line.s[stopped.node]), None
        if self.target is not None:
            content = {"t": run.t, "dt": dt, "outcome": tried.outcome.name, "s": run.model.line.s}
            left = write_snapshot(self.target, content | {"scene": scene_text(run.scene), **run.state._asdict()})
        error = ComputationError(tried.outcome, run.t, s, explanation(stopped), left, first_remedy(stopped))
        self.write_down(everything=True)  # outputs that wait
        if run.t > self.recorder.last:
            self._record_now()
        self.write_envelope()
        self.diagnostics.created_energy()
        run.events.event(run.t, s, s, tried.outcome.name.lower(), str(error))
        run.events.write_to(self.recorder)
        raise error from None

    def _stopped(self, tried: Tried, dt: float) -> Stopped:
        """What the line is like where no step leads on."""
        run, ended = self.run, ""
        clock, touches = run.run.clock, touch_text(run.run.contact, run.model)
        if tried.outcome == Outcome.WINCH_AT_END and run.payout is not None:
            ended = winch_text(run.payout)
        elif tried.outcome == Outcome.COLLAPSED:
            ended, touches = run.collapse, ""
        held = bool(run.model.ends.values.held.all())
        return Stopped(
            run.model,
            run.state,
            run.before,
            clock,
            run.run.count,
            tried,
            dt,
            float(clock.wave_step),
            run.switching is not None,
            held,
            touches,
            ended,
        )

    # --- checkpoints ----------------------------------------------------------------------------

    def _checkpoint(self, last: bool = False) -> None:
        """Keep a checkpoint at the output just written where one is due, and bring the file up to date.

        They are due by the work done, so that the same run has the same ones; how often readers see more goes by the
        clock.  last: the run ends here; all of it is written when the file is closed.
        """
        recorder = self.recorder
        self.run.events.write_to(recorder)
        if not isinstance(recorder, Recorder | ArrayRecorder):
            return
        (steps, changes), here = self._kept, (self.run.steps, self.run.changes)
        much = steps < 0 or (here[0] - steps) * self.run.model.cells >= WORK
        new = isinstance(self.target, Path) and here != self._kept and (last or much or here[1] != changes)
        if new or last or recorder.due:
            self._log()
        if new:
            recorder.checkpoint(self._content)
            self._kept = here
        late = isinstance(recorder, Recorder) and recorder.is_late
        if not last and (recorder.due or (new and not (late and steps < 0))):
            self.write_envelope()
            recorder.flush()

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
        return checkpoint(self.run) | {
            "watch": self.diagnostics.checkpoint(self.run.run.books), "cpu": clock.process_time() - self._cpu,
            "first_energy": self.observer.first_energy or 0.0, "vibration": self._vibration.checkpoint(),
        } | self._first_places()  # fmt: skip

    def _first_places(self) -> dict[str, np.ndarray]:
        """Places from which excursions count (n, 2), m, and azimuths (n,), deg, if there are any; NaN: none yet."""
        found = self.observer.quantities
        if found is None:
            return {}
        places = {"first_places": found.first.copy()} if found.first.size else {}
        return places | ({"first_turns": found.turns.copy()} if found.turns.size else {})

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Continue as `checkpoint` has said; ValueError or ResultError where that cannot be."""
        mine = {"watch": self.diagnostics.checkpoint(self.run.run.books), "cpu": 0.0, "first_energy": 0.0}
        mine |= {name: np.full_like(x, np.nan) for name, x in self._first_places().items()}
        restore(self.run, {name: x for name, x in saved.items() if name not in (*mine, "vibration")})
        self._vibration.restore(saved.get("vibration"), self.run.run.clock)
        if "first_turns" in mine:
            saved = {"first_turns": mine["first_turns"], **saved}  # files of before have none
        older = {name: saved[name] for name in mine}
        if isinstance(older["watch"], dict):
            older["watch"] = UNWATCHED | older["watch"]
        found = matched(older, mine, "state")
        self._cpu, self._logged = clock.process_time() - found["cpu"], found["cpu"]
        self.observer.first_energy = found["first_energy"]
        if self.observer.quantities is not None and "first_places" in found:
            self.observer.quantities.first[:] = found["first_places"]
        if self.observer.quantities is not None and "first_turns" in found:
            self.observer.quantities.turns[:] = found["first_turns"]
        run = self.run.run
        run.place(self.diagnostics.restore(found["watch"], run.books, run.state.r))
