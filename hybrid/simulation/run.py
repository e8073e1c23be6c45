"""Several lines that meet at points: their equilibrium and their motion, each line a result of its own in one file."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path
from time import process_time as clock_now
from typing import Any, NamedTuple

import numpy as np

from hybrid.errors import OTHER_PROGRAM, ComputationError, Outcome, ResultError
from hybrid.kernels.state import books as b
from hybrid.kernels.state.report import SELF_CONTACT_ENERGY
from hybrid.kernels.state.state import Floats, Line, Moves, Work
from hybrid.model.build import Model
from hybrid.model.ends import table_of_loads
from hybrid.model.failure import Weakness
from hybrid.model.network import NetworkModel
from hybrid.model.plan import SAME_STOP, apart, equal_steps, falls_on
from hybrid.scene.motion_checks import ramp_ends
from hybrid.scene.network import Network
from hybrid.scene.schema import LineScene
from hybrid.simulation.equilibrium import joined_lines
from hybrid.simulation.failure import write_snapshot
from hybrid.simulation.line_result import WAITING
from hybrid.simulation.parts import EVERY_STEP
from hybrid.simulation.restart import other_program, refused, require_same
from hybrid.simulation.run_checkpoint import (
    content,
    restore,
)
from hybrid.simulation.run_contact import (
    refuse_within_itself,
)
from hybrid.simulation.run_record import RecordedRun
from hybrid.simulation.run_start import begin_as_placed, blended_of_lines, named
from hybrid.solve.lines_at_rest import LinesAtRest
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.network_steps import MOST_SAMPLED, ROWS, NetworkSteps
from hybrid.solve.stepper import LineFailed, NetworkState, NetworkTaken
from hybrid.store.checkpoint import read_checkpoint
from hybrid.store.format import Target
from hybrid.store.hdf5_file import opened
from hybrid.store.writer import Recorder
from hybrid.zones.criteria import UserCriterion
from hybrid.zones.manager import DomainManager

# Steps that Python has a part in, between two reports of the progress.
LOOK = 16


class First(NamedTuple):
    """What a run begins with: the network as it is loaded then, and its first state."""

    network: Network
    model: NetworkModel
    state: NetworkState  # blank, where it is that of a checkpoint
    found: LinesAtRest | None  # the equilibrium from which it starts
    managers: Mapping[int, DomainManager]  # of zones, by the number of the line
    scenes: list[LineScene]  # of the lines
    changed: int  # how many changes of loads have been made
    resumed: bool  # whether the state is that of a checkpoint


class Run(RecordedRun):
    """The motion, or the equilibrium, of one network: its arrays, its steps, and the parts that change them.

    `new_run.new_run` makes it.
    """

    solver: NetworkSolver
    other: NetworkState  # the state after the next step
    notes: Sequence[tuple[str, str]] = ()  # events (kind, text) of the whole of the run
    begun: Callable[[Run], None] | None = None  # called behind the first output
    loaded = 0.0  # s, loads that have stopped by then act no more
    leg = (0.0, 0)  # where equal steps to a stop began (s), and how many are done
    stepped_outside = False  # whether steps are asked for one by one (simulation.stepping)
    _fitted: tuple[object, ...] | None = None  # what steps are attached to that have come to a stop
    _loaded = np.nan  # `loaded`, of the loads that act on bodies in compiled steps

    def __init__(
        self, first: First, loop: NetworkSteps, target: Target | None, criterion: UserCriterion | None, kept: bool
    ) -> None:
        """As yet without lines, parts and a file.

        loop: its steps, with outputs to its end; target: None: it is only to be compared with; criterion: one more for
        zones that move (zones.criteria); kept: whether it writes checkpoints.
        """
        self.network, self.model, self.state, self.found = first.network, first.model, first.state, first.found
        self.scenes, self.resolution = first.scenes, first.model.resolution
        self.loop, self.times, self._begins = loop, loop.outputs[1:].tolist(), not first.resumed
        self.target, self.criterion, self.kept, self.moves = target, criterion, kept, bool(self.times)
        self.end = self.times[-1] if self.times else 0.0
        self._moved: list[Moves] = []  # by which ends move in compiled steps
        self._begin = clock_now()
        self.start_from(first.model.body_places if first.resumed else first.state.bodies)

    # --- checkpoints ----------------------------------------------------------------------------------

    def content(self) -> Mapping[str, Any]:
        """What a checkpoint keeps."""
        return content(self)

    def continue_file(self, source: Path) -> Recorder:
        """Be where the checkpoint of a result is, and write behind its rows; ResultError: that cannot be."""
        with opened(source) as file:
            point = read_checkpoint(file)
            require_same(point, self.files, self.criterion, source)
            self.make_solver()
            with refused(source):
                restore(self, point.state)
                near = SAME_STOP * self.resolution.one.step
                if not point.t - near <= self.t <= self.network.require_time().duration + near:
                    raise ValueError(f"t = {self.t:g} s after an output at {point.t:g} s")
            self.model.load_bodies(self.t, self.solver.bodies, self.loaded)
            self.other, self._between = self.state.copy(), True
            recorder = self.file.resume(file, point)
        if why := other_program(point):
            recorder.event(point.t, *self.file.span, OTHER_PROGRAM, why)
        self._begin, self._checked = clock_now() - self.cpu, self.steps
        return recorder

    # --- what is computed ---------------------------------------------------------------------------

    def record_equilibrium(self) -> None:
        """Record the equilibrium that was found."""
        assert self.found is not None
        try:
            self.solver = solver = self.found.solver
            if not self.found.settled:
                refuse_within_itself(self.model, solver.lines, self.state, moves=False)
            self._make_room(solver)
            solver.keep_books([line.books for line in self.lines])
            solver.evaluate_forces(self.state, solver.anchor)  # what nothing holds has no report without its springs
            for part in self.parts:
                part.at_rest()
            for line, x, state in zip(self.lines, solver.lines, self.state.lines, strict=True):
                line.note_equilibrium(x, state, None, self.found, self.turned)
            self.renew_other()
            self.loop.attach(solver, self.state, self.other)
            self._output()
            text = f"equilibrium: {self.found.summary}; residual force {self.found.residual:.2g} N"
            self._close("complete", text)
        except LineFailed as failed:
            raise self.failed(failed) from None

    def record_motion(self) -> None:
        """Compute the motion and record it; KeyboardInterrupt: a part ends it, with the file complete till then."""
        try:
            if self._begins:
                self.begin_motion()

            for t in sorted({t for part in self.parts for t in part.phases}):
                for stop in self.stops(t):
                    self.go_to(stop)
                for part in self.parts:
                    if t in part.phases:
                        part.begin_phase(t)
                self.keep()
            for stop in self.stops():
                self.go_to(stop)
            self._pause(finished=True)
            self.finish()
        except LineFailed as failed:
            raise self.failed(failed) from None
        except KeyboardInterrupt:
            self.finish("interrupted", f"stopped from outside at t = {self.t:.6g} s")
            raise

    def _pause(self, finished: bool = False) -> None:
        """What is due about ten times a second; finished: at the end."""
        for at_pause in self.parts.at_pause:
            at_pause(finished)

    def start_from(self, bodies: Floats) -> None:
        """Take the added mass of members of bodies that were at rest (B, STATE) when the motion began."""
        self.rest = bodies.copy()
        for body, row in zip(self.model.bodies, bodies, strict=False):
            body.set_added_mass(row)

    def make_solver(self) -> None:
        """A solver for the model as it is."""
        for part in self.parts:
            part.fit_lines()
        remeshes = any(part.remeshes for part in self.parts)
        contacts, shared = next(y for part in self.parts if (y := part.touching(remeshes)) is not None)
        lines, bodies = joined_lines(self.model, 0.0), self.model.body_numbers(0.0)
        for line, x in zip(self.lines, lines, strict=True):
            line.held = np.minimum(x.ends.held, 1)
        self.solver = NetworkSolver(lines, len(self.model.free), bodies, contacts, shared, self.resolution.tolerance)
        self._make_room(self.solver)
        self.solver.keep_books([line.books for line in self.lines])
        for use_solver in self.parts.use_solver:
            use_solver(self.model, self.solver)
        if self.loop.controlled:
            self.solver.allowed[:] = self.resolution.allowed
        self.loop.bind_members(self.model.members_of(self.solver.bodies))
        self._moved, self._loaded = [], np.nan

    def _make_room(self, solver: NetworkSolver) -> None:
        """Room for samples of the lines and bodies as they are."""
        rows = max(1, min(WAITING, MOST_SAMPLED // sum(line.sample_size for line in self.lines)))
        for line in self.lines:
            line.make_room(rows)
        self.loop.make_room(rows, len(solver.body_work))

    @property
    def asks_quantities(self) -> bool:
        """Whether quantities by name are among the outputs, which are found of one mesh at a time."""
        return bool(self.file.quantities.fields)

    def adopt_cells(self, number: int, model: Model, work: Work) -> None:
        """Go on with other cells of a line, which steps have changed to."""
        models, line = [*self.model.models], self.lines[number]
        models[number] = model
        self.model = replace(self.model, models=tuple(models))
        self.solver.adopt_cells(number, model.line, model.sea.values, work, line.books)
        line.adopt_cells(model)
        for part in self.parts:
            part.adopt_cells(number, model.line)

    def renew_other(self) -> None:
        """Room for the state after the next step, of lines as they are now."""
        self.other = self.state.copy()

    def _note(self, kind: str, text: str) -> None:
        """An event of the whole run; of the line that its text names first, if any."""
        for line in self.lines:
            if text.startswith(name := f"line {line.name}: "):
                line.events.event(0.0, 0.0, line.model.length, kind, text.removeprefix(name))
                return
        self.note(kind, text)

    def begin_motion(self) -> None:
        """Make the start ready for steps, and record it."""
        time = self.network.require_time()
        if self.found is None:
            begin_as_placed(self.model, self.scenes, self.state, [line.events for line in self.lines])
        for part in self.parts:
            part.place()
        self.make_solver()
        for part in self.parts:
            part.balance()
        for point, text in blended_of_lines(self.network):
            if text:
                self.noted.event(0.0, *self.file.place(point), "motion blended in", text)
        for kind, text in self.notes:
            self._note(kind, text)
        self.balance()
        for part in self.parts:
            part.begin()
        if self.network.environment.waves is not None:
            text = "waves act on lines and points, not on the body, which has no members"
            for body in (x for x in self.model.bodies if x.members is None):
                self.note("waves on body neglected", f"body {body.name}: {text}")
        for line, x, state in zip(self.lines, self.solver.lines, self.state.lines, strict=True):
            if self.found is not None:
                line.note_equilibrium(x, state, 0.0, self.found, self.turned)
            else:
                line.note_start(x, state, 0.0)
            line.diagnostics.scheme(time.rho_inf)
            line.diagnostics.watch(line.books.clock)
        self.renew_other()
        self._attach()
        self._output()
        if self.begun is not None:
            self.begun(self)
        self.gather_events()
        self._between = True
        self.loop.set_quota(LOOK if self.loop.counts.asks else ROWS)
        for begin in self.parts.at_stop:
            begin()
        self.keep()
        self._logged = self._spent()

    def stops(self, until: float | None = None) -> list[float]:
        """Times (s) at which a step ends: where loads jump, the end, and outputs if that is asked.

        until: s, the last of them; None: the end of the run.
        """
        end = self.end if until is None else until
        given = [*(m.ends.breaks for m in self.model.models), self.model.breaks]
        self._jumps = sorted({x for each in given for x in each if x < end})
        self._breaks = sorted({*self._jumps, *(x for part in self.parts for x in part.breaks if x < end)})
        outputs = [x for x in self.times if x < end] if self.network.output.exact else []
        last = self.times[-1] if until is None else until
        steps = [x for x in self.resolution.one.ends if x < end]
        if self.loop.controlled:
            grown = [*self.parts.begins, *(x for scene in self.scenes for x in ramp_ends(scene))]
            steps += [x for x in grown if x < end]
        return apart([*outputs, *steps, last, *self._breaks], self.t, self.resolution.one.step)

    def go_to(self, stop: float) -> None:
        """Steps to `stop` (s), with what is due there."""
        while (due := self.parts.due) < stop - SAME_STOP * self.resolution.one.step:
            self._go_to(due)
            self.write_log()
            for part in self.parts:
                if part.due == due:
                    part.at_due()
        self._go_to(stop)
        for begin in self.parts.at_stop:
            begin()

    def _go_to(self, stop: float) -> None:
        """The same, with nothing due on the way."""
        loop, step = self.loop, self.resolution.one.step
        for begin in self.parts.begin_leg if loop.controlled else ():
            begin()
        even = self.network.output.exact or bool(self.resolution.one.ends) or not falls_on(stop, self._breaks, step)
        steps = equal_steps(self.leg, self.t, stop, step, even)
        self.leg = steps[:2]
        loop.begin_leg(stop, *steps)
        if self.t < stop:
            self._step_on(stop)

    def step_to(self, stop: float) -> None:
        """As `go_to`, to a stop (s) that is none of `stops`: straight, where nothing has a say in compiled steps.

        What is asked around a step takes as long as a step of a hundred cells, and nearly always finds nothing.
        """
        loop = self.loop
        if self._steps_differ:
            self.go_to(stop)
            return
        steps = equal_steps(self.leg, self.t, stop, self.resolution.one.step, False)
        self.leg = steps[:2]
        loop.begin_leg(stop, *steps)
        if loop.counts.quota < LOOK:  # which a call takes from
            loop.set_quota(ROWS)
        self._between, fitted = False, self._fitting()
        if self._fitted is None or any(x is not y for x, y in zip(fitted, self._fitted, strict=True)):
            self.record_samples()
            self._attach()
        code = self._run_attached()
        if code == b.AT_STOP and not loop.due and not loop.is_half_full:
            self.leg, self._between, self._fitted = (self.leg[0], int(loop.counts.leg_part)), True, fitted
        else:
            self._fitted = None
            self._step_on(stop, code)

    @property
    def _steps_differ(self) -> bool:
        """Whether steps are not all the same, so that each stop has a say in their lengths."""
        one = self.resolution.one
        return bool(self.loop.controlled or self.parts.begins or self.network.output.exact or one.ends)

    def _fitting(self) -> tuple[object, ...]:
        """What compiled steps are attached to: where it is the same, and they have come to a stop, they go on."""
        own = (x for attached_to in self.parts.attached_to for x in attached_to())
        return self.solver, self.model, *(x.ends.moves() for x in self.model.models), *own

    def _go(self) -> int:
        """Compiled steps, until a code of kernels.state.books."""
        self._fitted = None
        self._attach()
        return self._run_attached()

    def _run_attached(self) -> int:
        """The same of steps that are attached to what there is."""
        code = self.loop.go()
        for sync in self.parts.sync:
            sync()
        self.state, self.other = self.loop.states
        return code

    def _step_on(self, stop: float, code: int | None = None) -> None:
        """Steps up to `stop` (s); code: with which compiled ones have come back, None: they are still to begin."""
        loop, step, arrived = self.loop, self.resolution.one.step, False
        while not arrived:
            self._between = False
            code = self._go() if code is None else code
            if code in (b.TRYING, b.TRIED, b.STEPPED, b.FAILED) or loop.is_half_full:
                self.record_samples()  # of lines as they were until now
            if code == b.TRYING:
                self._prepare(float(loop.clock.try_end))
            elif code == b.TRIED:
                self._judge()
            elif code == b.FAILED:
                self._failed_step()
            else:
                if code != b.AT_STOP:
                    self.write_log()
                if code == b.STEPPED:
                    self.ends_of_now()
                    self._after_step()
                if loop.controlled or self.t >= loop.clock.until:
                    self.leg = (self.leg[0], int(loop.counts.leg_part))
                arrived = self.t >= stop and loop.counts.phase != b.SAMPLE
                if arrived:
                    self.record_samples()
                    self._arrive(stop, step)
                self._between = arrived or loop.counts.phase == b.BEGIN_STEP
                if code == b.PAUSED:
                    loop.set_quota(LOOK if loop.counts.asks else ROWS)
                if (code == b.PAUSED or arrived) and not self.stepped_outside:
                    self._pause()
            code = None

    def _attach(self) -> None:
        """Steps lead from the state of now, with ends that move as they do now."""
        loop, solver = self.loop, self.solver
        loop.counts.asks = 0
        if loop.attach(solver, self.state, self.other):
            for line, old, new in zip(self.lines, self.state.lines, self.other.lines, strict=True):
                line.attach(solver, (old, new), loop.clock, loop.counts)
        for attach in self.parts.attach:
            attach(loop)
        moves = [model.ends.moves() for model in self.model.models]
        if len(moves) != len(self._moved) or any(x is not y for x, y in zip(moves, self._moved, strict=True)):
            self._moved = moves
            loop.move(solver, [model.ends.moves_from_here() for model in self.model.models])
        if self._loaded != self.loaded:
            self._loaded = self.loaded
            loop.load(*table_of_loads(self.model.growing_loads(self.loaded)))

    def _prepare(self, t: float) -> None:
        """Ends, loads and zones as they are at the end of a try, t (s)."""
        for prepare in self.parts.prepare:
            prepare(t)
        for line, model in zip(self.lines, self.model.models, strict=True):
            model.ends.at_time(t)
            model.sea.at_time(t)
            line.books.velocity[:] = model.ends.velocity
        self.model.load_bodies(t, self.solver.bodies, self.loaded)
        self.model.update_water(t, self.state.bodies, t - self.t, self.solver.bodies)

    def _judge(self) -> None:
        """After a try: it may have to be made again, with other lines."""
        self._go_back(True)
        if any([part.wants_retry() for part in self.parts]):
            self.loop.try_again()
        self._go_back(False)

    def _failed_step(self) -> None:
        """No shorter step is left to try: contact is given up, or the run ends.  LineFailed."""
        dt = float(self.loop.clock.tried_dt)
        self._go_back(True)
        if not any([part.gives_up(dt) for part in self.parts]):
            if not self.stepped_outside:  # else the step may be taken back
                self._record_last()
            for line in self.lines:
                line.write_down()  # what stopped the run before comes first
            raise self._explained(self.loop.tried, dt)
        self._go_back(False)
        self.loop.try_whole()

    def _explained(self, taken: NetworkTaken, dt: float) -> LineFailed:
        """Why no step of dt (s) leads on; 0: why there are no accelerations."""
        return next(x for part in self.parts if (x := part.explains(taken, dt)) is not None)

    def _go_back(self, still: bool) -> None:
        """Whether forces are found of the state before a try, which the extremes know: it counts once."""
        for line in self.lines:
            line.books.counts.repeats = int(still)

    def _after_step(self) -> None:
        """What parts note of a step, and change after it."""
        notices = int(self.loop.counts.notices) | EVERY_STEP
        for wants, note in self.parts.note_step:
            if wants & notices:
                note()
        for wants, change in self.parts.after_step:
            if wants & notices:
                change()

    def release(self, weakness: Weakness, why: str) -> None:
        """Let ends of lines go now, between two steps; why: for the event.  LineFailed."""
        for part in self.parts:
            part.break_now(weakness, why)

    def restart_steps(self) -> None:
        """Loads, or what holds the lines, are others now: accelerations jump."""
        self.balance()
        self.loop.restart()

    def _arrive(self, stop: float, step: float) -> None:
        """What is due at a stop (s): an output, which is of the moment before, and other loads."""
        self.output_due()
        if falls_on(stop, self._jumps, step):
            self.ends_of_now()
            self.loaded = self.t
            for model in self.model.models:
                model.ends.set_loads(self.t)
            self.restart_steps()
        if self.network.output.exact or self.resolution.one.ends or falls_on(stop, self._breaks, step):
            self.leg = (stop, 0)

    def output_due(self) -> None:
        """Make the output that is due now, if one is: before loads, or what holds lines, become others."""
        if self.loop.due:
            self._attach()
            self._output()

    def failed(self, failed: LineFailed) -> ComputationError:
        """What a failure becomes: a file with all that there is, and an error that names the line."""
        error = self.error_of(failed)
        self.finish_failed(failed, str(error))
        return error

    def error_of(self, failed: LineFailed) -> ComputationError:
        """An error that names the line, with a snapshot of the last good state."""
        return self.file.in_words(named(failed, self.model, left=self._snapshot(failed.outcome)))

    def finish_failed(self, failed: LineFailed, text: str) -> None:
        """Close the file with all that there is; text: of the failure."""
        with suppress(LineFailed):
            self._record_last()
        for line in self.lines:
            if line.number == failed.line or failed.line < 0:
                s = failed.s or 0.0
                line.events.event(failed.t or 0.0, s, s, failed.outcome.name.lower(), text)
        with suppress(ResultError):
            self.finish("failed", text)

    def _record_last(self) -> None:
        """Record the last good state, in place of the output that would have come next."""
        outputs, at, phase = self.loop.outputs, int(self.loop.counts.output), int(self.loop.counts.phase)
        if self._begins and at == 0 and hasattr(self, "solver"):  # the first state, from which no step leads on
            self.renew_other()
            self._attach()
            self._output()
        elif self.moves and 0 < at < outputs.size and outputs[at - 1] < self.t and phase != b.SAMPLE:
            for model in self.model.models:
                model.ends.at_time(self.t)
                model.sea.at_time(self.t)
            outputs[at] = self.t
            self._output()

    def _snapshot(self, outcome: Outcome) -> Path | None:
        """Leave the last good state beside the result; None: it cannot be written, or nothing moves."""
        if self.target is None or not self.moves:
            return None
        content: dict[str, Any] = {"t": self.t, "dt": float(self.loop.clock.tried_dt), "outcome": outcome.name}
        return write_snapshot(self.target, content | self.file.snapshot(self.state))

    def balance(self) -> None:
        """Accelerations and tensions that are consistent with positions, velocities and loads.  LineFailed."""
        step, solver = self.resolution.one.step if self.moves else 1.0, self.solver
        accelerations: list[Floats] = []
        for line, model in zip(self.lines, self.model.models, strict=True):
            accelerations.append(model.ends.acceleration(self.t, 1e-3 * step))
            model.ends.at_time(self.t)
            model.sea.at_time(self.t)
            line.books.velocity[:] = model.ends.velocity
        self.model.load_bodies(self.t, solver.bodies, self.loaded)
        self.model.update_water(self.t, self.state.bodies, 0.0, solver.bodies)
        lengthening: dict[int, Floats] = {}
        with ExitStack() as stack:
            for forces_on in self.parts.forces_on:
                lengthening |= stack.enter_context(forces_on())
            taken = solver.consistent_accelerations(self.state, accelerations, self.t, lengthening)
        if taken.outcome != Outcome.OK:
            raise self._explained(taken, 0.0)

    # --- other lines in mid-motion --------------------------------------------------------------------

    def renew_solver(self, after: str) -> None:
        """Another solver in mid-motion, for lines that have changed; after: what, for the text of a failure."""
        self.gather_events()  # in the order in which they happen
        bodies, work = self.solver.bodies.copy(), self.solver.body_work.copy()
        self.make_solver()
        self.solver.bodies[:], self.solver.body_work[:] = bodies, work
        self.renew_other()
        self.evaluate_forces(after)

    def change_lines(self, changes: Mapping[int, Callable[[Line], Line]]) -> None:
        """These lines, by number, are changed so on the same cells; the solver has still to follow."""
        models = [*self.model.models]
        for k, change in changes.items():
            models[k] = replace(models[k], line=change(models[k].line))
            self.lines[k].use_model(models[k])
            for part in self.parts:
                part.change_line(k, change)
        self.model = replace(self.model, models=tuple(models))

    def go_on_changed(self, numbers: Iterable[int], after: str) -> None:
        """Another solver, for lines of these numbers that have changed, and that share contact with those.

        What that changes of the energy of contact is booked: of all lines, where a part knows that of the last step.
        """
        known = next((x for part in self.parts if (x := part.contact_before()) is not None), None)
        of = range(len(self.lines)) if known is not None else numbers
        before = {k: float(self.solver.work[k].report[SELF_CONTACT_ENERGY] if known is None else known[k]) for k in of}
        self.renew_solver(after)
        for k, energy in before.items():
            more = float(self.solver.work[k].report[SELF_CONTACT_ENERGY]) - energy
            self.lines[k].books.work[0, b.ZONES] += more

    def go_on_as_attached(self, after: str) -> None:
        """Go on with the same solver and states, for lines that have changed; after: as of `renew_solver`."""
        self.gather_events()
        turns = self.loop.turns
        self.evaluate_forces(after)
        self.solver.swap_states(turns)
        self.loop.stand_after_change()

    def evaluate_forces(self, after: str) -> None:
        """The forces of the state of now; after: as of `renew_solver`.  LineFailed: there are none."""
        for line, model in zip(self.lines, self.model.models, strict=True):
            model.ends.at_time(self.t)
            model.sea.at_time(self.t)
            line.books.velocity[:] = model.ends.velocity  # a try has moved them on
        self.model.load_bodies(self.t, self.solver.bodies, self.loaded)
        taken = self.solver.forces_in_motion(self.state, self.t)
        if taken.outcome != Outcome.OK:
            raise LineFailed(taken.line, taken.outcome, self.t, None, after)
        for note in self.parts.note_forces:
            note()
