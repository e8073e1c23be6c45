"""Several lines that meet at points: their equilibrium and their motion, each line a result of its own in one file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import process_time as clock_now
from typing import TYPE_CHECKING, Any, NamedTuple
from weakref import proxy

import numpy as np

from hybrid.errors import OTHER_PROGRAM, ComputationError, Outcome, ResultError
from hybrid.kernels.state import books as b
from hybrid.kernels.state.state import state_for
from hybrid.model.nearby import Weakness
from hybrid.model.network import NetworkModel, NetworkResolution, build_network
from hybrid.model.plan import SAME_STOP, apart, equal_steps, falls_on, output_times
from hybrid.scene.motion_checks import ramp_ends
from hybrid.scene.network import Network
from hybrid.scene.schema import LineScene
from hybrid.simulation.events import write_snapshot
from hybrid.simulation.floating_watch import FloatingWatch
from hybrid.simulation.lone_planes import LonePlanes
from hybrid.simulation.own_parts import OwnParts
from hybrid.simulation.parts import EVERY_STEP, Part, Parts
from hybrid.simulation.progress import at_once
from hybrid.simulation.restart import LoadChange, kept_resolution, other_program, refused, require_same
from hybrid.simulation.run_contact import AT_START, RunContact, refuse_within_itself
from hybrid.simulation.run_line import RunLine, Wanted
from hybrid.simulation.run_of_lines import (
    FirstStates,
    LoadChanges,
    ProgressOfRun,
    WatchedLines,
    loaded_as,
    with_loads_of,
)
from hybrid.simulation.run_record import ALONE, RecordedRun, Recording, RunFile, RunRecorder, kept_changes, restore
from hybrid.simulation.run_start import begin_as_placed, blended_of_lines, named
from hybrid.simulation.run_steps import Cuts, Failures, VibrationsOfLines, VibrationSteps
from hybrid.simulation.run_zones import RunZones
from hybrid.simulation.zones_at_rest import Start, managers_for, start_at_rest, zones_as_placed
from hybrid.solve.lines_at_rest import LinesAtRest
from hybrid.solve.network_steps import ROWS, NetworkSteps
from hybrid.solve.stepper import LineFailed, NetworkState
from hybrid.store.format import Target, Text
from hybrid.store.hdf5_file import opened
from hybrid.store.whole_file import read_checkpoint
from hybrid.store.writer import Recorder
from hybrid.zones.manager import DomainManager, UserCriterion

if TYPE_CHECKING:  # what a run without winches does not load
    from hybrid.simulation.payout import PayingOut
    from hybrid.simulation.run_payout import RunPayout


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

    `new_run` makes it.
    """

    notes: Sequence[tuple[str, str]] = ()  # events (kind, text) of the whole of the run
    begun: Callable[[Run], None] | None = None  # called behind the first output
    let_go: Callable[[Weakness, str], None]  # lets ends of lines go between two steps; why, for the event.  LineFailed
    stepped_outside = False  # whether steps are asked for one by one (simulation.stepping)
    _fitted: tuple[object, ...] | None = None  # what steps are attached to that have come to a stop

    def __init__(
        self, first: First, loop: NetworkSteps, target: Target | None, criterion: UserCriterion | None, kept: bool
    ) -> None:
        """As yet without lines, parts and a file.

        loop: its steps, with outputs to its end; target: None: it is only to be compared with; criterion: one more for
        zones that move (zones.manager); kept: whether it writes checkpoints.
        """
        self.network, self.model, self.state, self.found = first.network, first.model, first.state, first.found
        self.scenes, self.resolution = first.scenes, first.model.resolution
        self.loop, self.times, self._begins = loop, loop.outputs[1:].tolist(), not first.resumed
        self.target, self.criterion, self.kept, self.moves = target, criterion, kept, bool(self.times)
        self.end = self.times[-1] if self.times else 0.0
        self._begin = clock_now()
        self.start_from(first.model.body_places if first.resumed else first.state.bodies)

    # --- checkpoints ----------------------------------------------------------------------------------

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
            self._refuse_overlaps()
            self._make_room(solver)
            solver.keep_books([line.books for line in self.lines])
            solver.evaluate_forces(self.state, solver.anchor)  # what nothing holds has no report without its springs
            for part in self.parts:
                part.begin()
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
            else:
                self.stops()
                self._let_jump(self.t, self.resolution.one.step)  # loads that a run up to here has left as they were
            while not self._reach_end():
                self.keep()
            self._pause(finished=True)
            self.finish()
        except LineFailed as failed:
            raise self.failed(failed) from None
        except KeyboardInterrupt:
            self.finish("interrupted", f"stopped from outside at t = {self.t:.6g} s")
            raise

    def _reach_end(self) -> bool:
        """Go to the end; False: only to where other loads begin to hold, and other stops with them."""
        network = self.network
        for stop in self.stops():
            self.go_to(stop)
            if self.network is not network:
                return False
        return True

    def _refuse_overlaps(self) -> None:
        """SceneError: lines for which contact is asked are within themselves, or each other, at the start."""
        if self.found is None:
            refuse_within_itself(self.model, self.solver.lines, self.state, self.moves, AT_START)
        elif not self.found.settled:
            refuse_within_itself(self.model, self.solver.lines, self.state, self.moves)

    def _pause(self, finished: bool = False) -> None:
        """What is due about ten times a second; finished: at the end."""
        for at_pause in self.parts.at_pause:
            at_pause(finished)

    def _note(self, kind: str, text: str) -> None:
        """An event of the whole run; of the line that its text names first, if any."""
        for line in self.lines:
            if text.startswith(name := f"line {line.name}: "):
                line.events.event(0.0, 0.0, line.model.length, kind, text.removeprefix(name))
                return
        self.note(kind, text)

    def begin_motion(self) -> None:
        """Make the start ready for steps, and record it."""
        if self.found is None:
            begin_as_placed(self.model, self.scenes, self.state, [line.events for line in self.lines])
        self.make_solver()
        self._refuse_overlaps()
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
        self.renew_other()
        self._attach()
        self._output()
        if self.begun is not None:
            self.begun(self)
        self.gather_events()
        self._between = True
        self.loop.set_quota(LOOK if self.loop.counts.asks else ROWS)
        self.keep()
        self._logged = self._spent()

    def stops(self) -> list[float]:
        """Times (s) at which a step ends: where loads jump, the end, and outputs if that is asked."""
        end = self.end
        given = [*(m.ends.breaks for m in self.model.models), self.model.breaks]
        self._jumps = sorted({x for each in given for x in each if x < end})
        self._breaks = sorted({*self._jumps, *(x for part in self.parts for x in part.stops if x < end)})
        outputs = [x for x in self.times if x < end] if self.network.output.exact else []
        steps = [x for x in self.resolution.one.ends if x < end]
        if self.loop.controlled:
            steps += [x for scene in self.scenes for x in ramp_ends(scene) if x < end]
        return apart([*outputs, *steps, self.times[-1], *self._breaks], self.t, self.resolution.one.step)

    def go_to(self, stop: float) -> None:
        """Steps to `stop` (s), with what is due on the way; other loads begin to hold where that ends before."""
        network, near, arrives = self.network, SAME_STOP * self.resolution.one.step, False
        while not arrives:
            if self.parts.due <= self.t:
                self.write_log()
            for begin in self.parts.begin_leg:
                begin()
            if self.network is not network:
                return
            due = self.parts.due
            arrives = not due < stop - near
            self._go_to(stop if arrives else due)

    def _go_to(self, stop: float) -> None:
        """The same, with nothing due on the way."""
        loop, step = self.loop, self.resolution.one.step
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
        loop, one = self.loop, self.resolution.one
        if loop.controlled or self.network.output.exact or one.ends:
            self.go_to(stop)  # each stop has a say in the lengths of steps
            return
        steps = equal_steps(self.leg, self.t, stop, one.step, False)
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

    def _fitting(self) -> tuple[object, ...]:
        """What compiled steps are attached to: where it is the same, and they have come to a stop, they go on."""
        reels = (x.paying.reel for x in self.lines if x.paying is not None)
        return self.solver, self.model, *(x.ends.moves() for x in self.model.models), *reels

    def _run_attached(self) -> int:
        """Compiled steps, which are attached to what there is, until a code of kernels.state.books."""
        code = self.loop.go()
        for line in self.lines:
            if line.cells is not None:
                line.cells.sync()  # Python knows of the cells of now
        self.state, self.other = self.loop.states
        return code

    def _step_on(self, stop: float, code: int | None = None) -> None:
        """Steps up to `stop` (s); code: with which compiled ones have come back, None: they are still to begin."""
        loop, step, arrived = self.loop, self.resolution.one.step, False
        while not arrived:
            self._between = False
            if code is None:
                self._fitted = None
                self._attach()
                code = self._run_attached()
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

    def _prepare(self, t: float) -> None:
        """Ends, loads and zones as they are at the end of a try, t (s)."""
        for judge in self.parts.judge_try:
            judge(b.TRYING)
        self.place_ends(t)
        self.model.update_water(t, self.state.bodies, t - self.t, self.solver.bodies)

    def _judge(self) -> None:
        """After a try: it may have to be made again, with other lines."""
        self._go_back(True)
        if any([judge(b.TRIED) for judge in self.parts.judge_try]):
            self.loop.try_again()
        self._go_back(False)

    def _failed_step(self) -> None:
        """No shorter step is left to try: contact is given up, or the run ends.  LineFailed."""
        self._go_back(True)
        try:
            any(judge(b.FAILED) for judge in self.parts.judge_try)  # `Cuts` raises where nothing is given up before
        except LineFailed:
            if not self.stepped_outside:  # else the step may be taken back
                self._record_last()
            for line in self.lines:
                line.write_down()  # what stopped the run before comes first
            raise
        self._go_back(False)
        self.loop.try_whole()

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

    def _arrive(self, stop: float, step: float) -> None:
        """What is due at a stop (s): an output, which is of the moment before, and other loads."""
        self.output_due()
        self._let_jump(stop, step)
        if self.network.output.exact or self.resolution.one.ends or falls_on(stop, self._breaks, step):
            self.leg = (stop, 0)

    def _let_jump(self, stop: float, step: float) -> None:
        """Other loads from a stop (s) on, where they jump and have not."""
        if falls_on(stop, self._jumps, step) and self.loaded < self.t:
            self.ends_of_now()
            self.loaded = self.t
            for model in self.model.models:
                model.ends.set_loads(self.t)
            self.restart_steps()

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


def new_run(
    network: Network,
    target: Target | None,
    text: Text,
    moves: bool,
    resolution: NetworkResolution | None = None,
    recording: Recording = ALONE,
    criterion: UserCriterion | None = None,
    changes: Sequence[LoadChange[Network]] = (),
) -> Run:
    """A run that stands at its start, or at a checkpoint.

    target: None: the run is only to be compared with; text: the scene as YAML, or what makes it; moves: whether its
    motion is wanted, else its equilibrium under full loads; resolution: how finely, None: as the scene asks for, or the
    checkpoint says; criterion: one more for zones that move (zones.manager); changes: loads and motions of these
    networks hold from some time on.
    """
    end = (recording.until or network.require_time().duration) if moves else 0.0
    changes = [replace(x, scene=with_loads_of(network, x.scene)) for x in changes if x.t < end]
    if recording.source is None:
        start = recording.start
        if start is None:
            start = start_of(network, build_network(network, resolution=resolution), moves, criterion)
        first = _at_start(network, start)
    else:
        first = _at_checkpoint(network, recording.source, changes, criterion)
    kept = recording.mode.before is not None and isinstance(target, Path)
    run = Run(first, _steps(first, moves, end), target, criterion, kept)
    run.changes, run.notes, run.begun = changes, recording.notes, recording.begun
    _equip(run, first, network, text, recording)
    run.recorder = run.file.begin() if recording.source is None else run.continue_file(recording.source)
    return run


def _at_start(network: Network, start: Start) -> First:
    """The equilibrium of a network, or its lines as they are placed."""
    state = NetworkState([x.start for x in start.model.models], start.model.body_places)
    state = (state if start.found is None else start.found.state).copy()
    scenes = network.scenes_of_lines
    return First(network, start.model, state, start.found, start.managers, [*scenes.values()], 0, False)


def _at_checkpoint(
    network: Network, source: Path, changes: Sequence[LoadChange[Network]], criterion: UserCriterion | None
) -> First:
    """Blank states of the lines of a network, which is loaded as where the checkpoint of a result is."""
    model = build_network(network, resolution=kept_resolution(network, source))
    changed = kept_changes(source, len(changes))
    scenes = network.scenes_of_lines
    managers = managers_for(scenes, model, criterion)  # as at the start, whatever loads came later
    if changed:
        network = changes[changed - 1].scene
        model = loaded_as(model, network, 0.0)
    for k, x in managers.items():
        x.load(model.models[k].ends.moments)
    state = NetworkState([state_for(x.line) for x in model.models], np.zeros_like(model.body_places))
    return First(network, model, state, None, managers, [*scenes.values()], changed, True)


def _steps(first: First, moves: bool, end: float) -> NetworkSteps:
    """The steps of a run to its end (s), 0 where nothing moves, with outputs on the way."""
    resolution = first.model.resolution
    one, times = resolution.one, list[float]()
    turn = min(x.turn for x in resolution.lines.values())
    if not moves:
        return NetworkSteps(0.0, [0.0], most_turn=turn)
    times = output_times(first.scenes[0])
    if one.every > 1:  # a run to compare with has as many times fewer
        times = [*times[one.every - 1 : -1 : one.every], times[-1]]
    if end < times[-1]:
        times = [*(t for t in times if t < end), end]
    follow = (one.step, one.shortest) if one.local is not None else (0.0, 0.0)
    return NetworkSteps(first.network.require_time().rho_inf, [0.0, *times], *follow, turn)


def _equip(run: Run, first: First, network: Network, text: Text, recording: Recording) -> None:
    """Give a run its file, its lines and its parts; network: with the loads of its start."""
    me = proxy(run)  # for parts: in a circle a run would wait for the search for garbage
    moves, named = run.moves, dict(zip(first.model.names, first.scenes, strict=True))
    parts: list[Part] = []
    payout: RunPayout | None = None
    if moves and any(x.payout is not None for x in run.model.models):
        from hybrid.simulation.run_payout import RunPayout

        payout = RunPayout(me)
        parts.append(payout)
    run.file = RunFile(me, network, named, text, recording)
    _add_lines(run, first, recording, payout.lines if payout is not None else {})
    contact, failures = RunContact(me, recording.touches, run.target is not None), Failures(me)
    run.let_go = failures.break_now
    if recording.planes and moves:
        parts.append(LonePlanes(me, run.loop.counts, network.dimension == 2, not first.resumed))
    shaken = zip(named.items(), run.resolution.lines.values(), strict=True)
    vibrations = {name: VibrationSteps(scene, x) for (name, scene), x in shaken}
    if moves:
        run.file.quantities.keep_ranges(run.lines)
    if first.managers and moves:
        parts.append(RunZones(me, first.managers, payout))
    if recording.parts and moves:
        called = {} if recording.asked is None else recording.asked.scene.form.names
        parts.append(OwnParts(me, recording.parts, [called.get(name, name) for name in named], payout))
    if recording.heard is not None and moves:
        parts.append(ProgressOfRun(me, recording.heard))
    parts += [
        LoadChanges(me, run.changes, first.changed),
        WatchedLines(me),
        FirstStates(me),
        contact,
        Cuts(me, contact, run.target is None),
        failures,
    ]
    parts += [VibrationsOfLines(vibrations, run.loop.clock), run.file.quantities, run.file.rotations]
    run.parts = Parts([*parts, RunRecorder(me), FloatingWatch(me, moves)])


def _add_lines(run: Run, first: First, recording: Recording, paid: Mapping[int, PayingOut]) -> None:
    """Give a run its lines, each with what records it; paid: those that are paid out, by number."""
    points = recording.points or {}
    run.lines = []
    every = zip(run.model.names, first.scenes, run.model.models, run.state.lines, strict=True)
    for k, (name, scene, model, state) in enumerate(every):
        manager = first.managers.get(k)
        record = partial(run.file.line_rows, manager=manager) if run.target is not None else None
        wanted = Wanted(record, points.get(name))
        shown, outputs = run.file.scene_of(scene), len(run.times)
        line = RunLine(k, name, shown, model, run.found, state, outputs, wanted, paid.get(k))
        run.lines.append(line)
        line.manager = manager
        if not first.resumed:
            line.diagnostics.begin()


def start_of(network: Network, model: NetworkModel, moves: bool, criterion: UserCriterion | None) -> Start:
    """The first state of a network, with its zones; moves: whether a motion begins there, else it is at rest."""
    scenes = network.scenes_of_lines
    if moves and network.starts_as_placed:
        model, managers = zones_as_placed(scenes, model, criterion)
        return Start(model, None, managers)
    with at_once():
        return start_at_rest(network, scenes, model, moves, criterion)


def static_network(
    network: Network, target: Target | None, text: Text, resolution: NetworkResolution | None = None
) -> Run:
    """Compute the equilibrium of a network under full loads; the rest: as of `new_run`."""
    run = new_run(network, target, text, False, resolution)
    run.record_equilibrium()
    return run
