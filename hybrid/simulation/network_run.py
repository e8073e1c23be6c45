"""Several lines that meet at points: their equilibrium and their motion, each line a result of its own in one file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import monotonic
from time import process_time as clock_now
from typing import TYPE_CHECKING, Any, NamedTuple
from weakref import proxy

import numpy as np

from hybrid.adapt.manager import DomainManager
from hybrid.adapt.zone_rules import UserCriterion
from hybrid.errors import OTHER_PROGRAM, ComputationError, Outcome, ResultError
from hybrid.kernels.state import books as b
from hybrid.kernels.state.report import SELF_CONTACT
from hybrid.kernels.state.state import Floats, Moves, Work, state_for
from hybrid.model.build import Model
from hybrid.model.ends import table_of_loads
from hybrid.model.failure import Weakness
from hybrid.model.network import NetworkModel, NetworkResolution, build_system
from hybrid.model.plan import SAME_STOP, apart, equal_steps, falls_on, output_times
from hybrid.model.sections import OutputPoints
from hybrid.scene.motion_checks import ramp_ends
from hybrid.scene.network_scene import Network
from hybrid.scene.schema import LineScene
from hybrid.simulation.equilibrium import joined_lines
from hybrid.simulation.events import (
    Sink,
)
from hybrid.simulation.failure import write_snapshot
from hybrid.simulation.floating_watch import FloatingWatch
from hybrid.simulation.line_result import FORCE_COLUMNS, WAITING, LineResult, Wanted
from hybrid.simulation.lone_planes import LonePlanes
from hybrid.simulation.parts import EVERY_STEP, Parts
from hybrid.simulation.progress import RESULT, ProgressReporter, at_once
from hybrid.simulation.restart import LoadChange
from hybrid.simulation.restore import kept_resolution, other_program, refused, require_same
from hybrid.simulation.run_checkpoint import (
    content,
    files_of,
    kept_changes,
    restore,
)
from hybrid.simulation.run_contact import (
    RunContact,
    refuse_within_itself,
)
from hybrid.simulation.run_cuts import Cuts
from hybrid.simulation.run_failures import Failures
from hybrid.simulation.run_file import Asked, file_of
from hybrid.simulation.run_of_lines import WatchedLines, change_loads_of_lines, loaded_as, with_loads_of
from hybrid.simulation.run_points import Sampled
from hybrid.simulation.run_quantities import Rotations, RunQuantities
from hybrid.simulation.run_start import begin_as_placed, blended_of_lines, named
from hybrid.simulation.run_zones import RunZones, Start, managers_for, start_at_rest, zones_as_placed
from hybrid.simulation.vibration_steps import VibrationsOfLines, VibrationSteps
from hybrid.solve.joined import LineFailed, NetworkState
from hybrid.solve.lines_at_rest import LinesAtRest
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.network_steps import NetworkSteps
from hybrid.solve.run import MOST_SAMPLED, ROWS
from hybrid.store.array_contents import Target
from hybrid.store.checkpoint import read_checkpoint
from hybrid.store.format import Text
from hybrid.store.hdf5_file import opened
from hybrid.store.stored_rows import ComparisonRecorder
from hybrid.store.writer import AT_ONCE, Recorder, WriteMode

if TYPE_CHECKING:
    from hybrid.simulation.run_payout import RunPayout

_NO_ZONES: Mapping[int, DomainManager] = {}
# Steps times cells from one checkpoint to the next, about 5 s of computing.
WORK = 10_000_000
# Steps that Python has a part in, between two reports of the progress.
LOOK = 16
READ_EVERY = 0.01  # s of the wall, after which the time of the processor is read again


class Recording(NamedTuple):
    """What there is beside a run: around it, before it and after it.

    mode: how a file is written; source: the result to go on with, from its checkpoint, in place of a start; pending:
    what is to come when it is complete (store.records); notes: events (kind, text) of the whole of the run; begun:
    called behind the first output; planes: whether lines that are joined to nothing are computed in the planes in
    which they lie; start: the first state, if it is known; points: of outputs of lines by name, None: those of
    their scenes; until: s, its end, if it comes before that of the scene; touches: whether contact begins by itself
    where lines come near themselves, else that is only noticed; error: whether that of leaving bending out is followed,
    of lines whose resolution says so; asked: what the network was made of, by whose names it gets its file.
    """

    mode: WriteMode = AT_ONCE
    source: Path | None = None
    pending: str = ""
    notes: Sequence[tuple[str, str]] = ()
    begun: Callable[[NetworkRun], None] | None = None
    planes: bool = False
    start: Start | None = None
    points: Mapping[str, OutputPoints] | None = None
    until: float | None = None
    touches: bool = True
    error: bool = False
    asked: Asked | None = None


ALONE = Recording()


class NetworkRun:
    """One system, computed into a file or into memory."""

    def __init__(
        self, system: Network, target: Target | None, text: Text, moves: bool,
        resolution: NetworkResolution | None = None, recording: Recording = ALONE,
        criterion: UserCriterion | None = None, changes: Sequence[LoadChange[Network]] = (),
    ) -> None:  # fmt: skip
        """target: None: the run is only to be compared with; text: the scene as YAML, or what makes it; moves: whether

        its motion is wanted, else its equilibrium under full loads; resolution: how finely, None: as the scene asks
        for, or the checkpoint says; criterion: one more for zones that move (adapt.zone_rules); changes: loads and
        motions of these systems hold from some time on.
        """
        source, planes = recording.source, recording.planes
        self._notes, self._begun = recording.notes, recording.begun
        self.end = (recording.until or system.require_time().duration) if moves else 0.0
        self.changes: Sequence[LoadChange[Network]] = [
            replace(x, scene=with_loads_of(system, x.scene)) for x in changes if x.t < self.end
        ]
        self.criterion, me = (
            criterion,
            proxy(self),
        )  # for parts: in a circle a run would wait for the search for garbage
        self.system, self.target, self.moves = system, target, moves
        self.kept = recording.mode.before is not None and isinstance(target, Path)
        self.changed = 0  # how many of the changes have been made
        if source is not None:
            resolution, self.changed = kept_resolution(system, source), kept_changes(source, len(self.changes))
        first = self.model = recording.start.model if recording.start else build_system(system, resolution=resolution)
        if self.changed:
            self.system = self.changes[self.changed - 1].scene
            self.model = loaded_as(first, self.system, 0.0)
        self.resolution = self.model.resolution
        one = self.resolution.one
        follow = (one.step, one.shortest) if moves and one.local is not None else (0.0, 0.0)
        names, scenes = first.names, line_scenes(system, first)
        self.scenes = [scenes[name] for name in names]
        self.times: Sequence[float] = output_times(self.scenes[0]) if moves else []
        if moves and one.every > 1:  # a run to compare with has as many times fewer
            self.times = [*self.times[one.every - 1 : -1 : one.every], self.times[-1]]
        if moves and self.end < self.times[-1]:
            self.times = [*(t for t in self.times if t < self.end), self.end]
        rho = system.require_time().rho_inf if moves else 0.0
        turn = min(x.turn for x in self.resolution.lines.values())
        self.loop = NetworkSteps(rho, [0.0, *self.times], *follow, turn)
        self.found: LinesAtRest | None = None
        managers, self._begins = _NO_ZONES, source is None  # whether there is a start, and no checkpoint
        if source is not None:
            blank = [state_for(x.line) for x in self.model.models]
            self.state = NetworkState(blank, np.zeros_like(self.model.body_places))
            managers = managers_for(scenes, first, criterion)  # as at the start, whatever loads came later
            for k, x in managers.items():
                x.load(self.model.models[k].ends.moments)
        else:
            self.model, self.found, managers = recording.start or start_of(system, self.model, moves, criterion)
            placed = NetworkState([x.start for x in self.model.models], self.model.body_places)
            self.state = (placed if self.found is None else self.found.state).copy()
        self.start_from(self.state.bodies if self._begins else self.model.body_places)
        self.payout: RunPayout | None = None  # of lines that are paid out
        if moves and any(x.payout is not None for x in self.model.models):
            from hybrid.simulation.run_payout import RunPayout

            self.payout = RunPayout(me)
        reels = self.payout.lines if self.payout is not None else {}
        self.rotations = Rotations(system, self.model)
        self.file, points = file_of(me, text, recording), recording.points or {}
        self.lines = list[LineResult]()
        for k, (name, scene, model, state) in enumerate(
            zip(names, self.scenes, self.model.models, self.state.lines, strict=True)
        ):
            manager, error = managers.get(k), recording.error and model.follows_error
            record = partial(self.file.line_recorder, manager=manager) if target is not None else None
            wanted = Wanted(record, points.get(name), error, _torque_of(manager))
            shown, outputs = self.file.scene_of(scene), len(self.times)
            self.lines.append(LineResult(k, name, shown, model, self.found, state, outputs, wanted, reels.get(k)))
            self.lines[k].manager = manager
        if self._begins:
            for line in self.lines:
                line.diagnostics.begin()
        self.contact = RunContact(me, recording.touches, target is not None)
        self.planes = LonePlanes(me, self.loop.counts, system.dimension == 2) if planes and moves else None
        shaken = zip(scenes.items(), self.resolution.lines.values(), strict=True)
        steps = {name: VibrationSteps(scene, x) for (name, scene), x in shaken}
        self.vibrations = VibrationsOfLines(steps, self.loop.clock)
        self.quantities = RunQuantities(system, self.file.of_quantities(scenes))
        if moves:
            self.quantities.keep_ranges(self.lines)
        self.cpu = 0.0  # s, of the processor, in earlier parts of the run
        self._logged = 0.0  # s, likewise, when steps were logged last
        self.leg = (0.0, 0)  # where equal steps to a stop began (s), and how many are done
        self._fitted: tuple[object, ...] | None = None  # what steps are attached to that have come to a stop
        self._moved: list[Moves] = []  # by which ends move in compiled steps
        self._loaded = np.nan  # and `loaded`, of the loads that act there on bodies
        self.failures, self.cuts, self.floating = Failures(me), Cuts(me, target is None), FloatingWatch(me, moves)
        self.zones = RunZones(me, managers, self.payout) if managers and moves else None
        self.parts = Parts(
            x for x in (self.planes, WatchedLines(me), self.contact, self.cuts, self.zones, self.payout, self.failures,
                        self.vibrations, self.quantities, self.rotations, self.floating) if x is not None
        )  # fmt: skip
        self.loaded = 0.0  # s, loads that have stopped by then act no more
        self._checked = -1  # steps at the last checkpoint
        self._between = False  # whether the state is that between two steps
        self.stepped_outside = False  # whether steps are asked for one by one (simulation.stepping)
        self._begin = clock_now()
        self.read_every = READ_EVERY
        self._read = -np.inf, 0.0  # s of the wall, when the time of the processor was read last, and that
        self.recorder = self._go_on(source) if source is not None else self.file.begin()

    # --- where it is --------------------------------------------------------------------------------

    @property
    def t(self) -> float:
        """Time of the state, s."""
        return float(self.loop.clock.now)

    @property
    def steps(self) -> int:
        """Steps so far."""
        return int(self.loop.counts.steps)

    @property
    def last_step(self) -> float:
        """Length, s, of the step that led to the state; 0: it is a start."""
        return float(self.loop.clock.last_dt)

    @property
    def last_rho(self) -> float:
        """Its spectral radius."""
        return float(self.loop.clock.last_rho)

    @property
    def interval(self) -> float:
        """What the step took (s) that led to the state, of which outputs within the next are made, too; 0: unknown."""
        return float(self.loop.clock.now - self.loop.clock.previous)

    def stand_at(self, t: float, steps: int, last_step: float, last_rho: float, interval: float) -> None:
        """Be between two steps, at t (s)."""
        clock = self.loop.clock
        clock.now, clock.last_dt, clock.last_rho, self.loop.counts.steps = t, last_step, last_rho, steps
        for line in self.lines:
            line.books.counts.repeats = 0  # of a step that was tried when it was taken back
        self.loop.stand_between(interval, self.resolution.one.step)
        self._logged = self._spent()

    # --- the file -----------------------------------------------------------------------------------

    @property
    def turned(self) -> bool:
        """Whether moments are given at points."""
        return any(getattr(point, "moment", None) is not None for point in self.system.points.values())

    @property
    def files(self) -> dict[str, str]:
        """Digests of the files of motions and loads, by path, of all that holds at some time."""
        found = files_of(self.system)
        for x in self.changes:
            found |= files_of(x.scene)
        return found

    @property
    def span(self) -> tuple[float, float]:
        """Arc lengths (m) of its events."""
        return self.file.span

    @property
    def noted(self) -> Sink:
        """What notes events of the whole run."""
        return self.file.noted

    def note(self, kind: str, text: str, **more: float) -> None:
        """Note an event of the whole run, now."""
        self.noted.event(self.t, *self.span, kind, text, **more)

    def _go_on(self, source: Path) -> Recorder:
        """Be where the checkpoint of a result is, and write behind its rows; ResultError: that cannot be."""
        with opened(source) as file:
            point = read_checkpoint(file)
            require_same(point, self.files, self.criterion, source)
            self.make_solver()
            with refused(source):
                restore(self, point.state)
                near = SAME_STOP * self.resolution.one.step
                if not point.t - near <= self.t <= self.system.require_time().duration + near:
                    raise ValueError(f"t = {self.t:g} s after an output at {point.t:g} s")
            self.model.load_bodies(self.t, self.solver.bodies, self.loaded)
            self.other, self._between = self.state.copy(), True
            recorder = self.file.again(file, point)
        recorder.files = self.files
        if why := other_program(point):
            recorder.event(point.t, *self.file.span, OTHER_PROGRAM, why)
        self._begin, self._checked = clock_now() - self.cpu, self.steps
        return recorder

    @property
    def is_due(self) -> bool:
        """Whether the file is to be brought up to date, by the clock."""
        return not isinstance(self.recorder, ComparisonRecorder) and self.recorder.due

    def keep(self, last: bool = False) -> None:
        """Keep a checkpoint where one is due, by the work done, and bring the file up to date; last: it is the end."""
        if isinstance(self.recorder, ComparisonRecorder):
            return
        new = self.kept and self._between and self.steps != self._checked
        new = new and (self._checked < 0 or last or (self.steps - self._checked) * self.model.cells >= WORK)
        if not (new or self.recorder.due):
            return
        begin = monotonic()
        self.record_samples()
        self.write_log()
        self.ends_of_now()
        for line in self.lines:
            line.write_down()
            line.write_envelope(self.t)
        self.recorder.replace(self.quantities.range_values())
        self.gather_events()
        made = monotonic() - begin
        if new and isinstance(self.recorder, Recorder):
            begins_late = self._checked < 0 and self.recorder.is_late
            self.cpu, self._checked = clock_now() - self._begin, self.steps
            self.recorder.checkpoint(lambda: content(self))
            if begins_late and not self.recorder.due:
                return
        if not last:
            self.recorder.flush(made)

    def gather_events(self) -> None:
        """Record the events of the lines, in the result of the system with their names, as they happened."""
        self.contact.note_meetings()
        self.file.gather()

    def _output(self) -> None:
        """Record points, bodies and lines as they are, where an output is due."""
        while not self.loop.sample():
            self.record_samples()
        self.record_samples()

    def record_samples(self) -> None:
        """Record what has been sampled of points, bodies and lines."""
        count = int(self.loop.counts.samples)
        if not count:
            return
        self.loop.counts.samples = 0
        states = [line.sampled(count) for line in self.lines]
        seen = Sampled(states, self.loop.body_samples[:count])
        self.file.save(seen)
        for look in self.parts.at_output:
            look(seen)
        for line, x in zip(self.lines, states, strict=True):
            line.output(x)

    def _close(self, status: str, message: str) -> None:
        """Close all, with the events of the lines in the result of the points too."""
        for line in self.lines:
            line.finish(self.t, status)
        self.gather_events()
        for part in self.parts:
            part.finish(status)
        self.file.close(status, message)

    # --- what is computed ---------------------------------------------------------------------------

    def record_equilibrium(self) -> None:
        """Record the equilibrium that was found."""
        assert self.found is not None
        self.contact.note_partners()
        try:
            self.solver = solver = self.found.solver
            if not self.found.settled:
                refuse_within_itself(self.model, solver.lines, self.state, moves=False)
            self._make_room(solver)
            solver.keep_books([line.books for line in self.lines])
            solver.evaluate_forces(self.state, solver.anchor)  # what nothing holds has no report without its springs
            self.contact.watch_lines()
            self.contact.look_for_overlaps()
            for line, x, state in zip(self.lines, solver.lines, self.state.lines, strict=True):
                line.note_equilibrium(x, state, None, self.found, self.turned)
                if line.correction is not None:
                    rubs = line.number in self.found.with_friction
                    line.correction.begin(x.ends, state, at_rest=True, with_friction=rubs)
            self.renew_other()
            self.loop.attach(solver, self.state, self.other)
            self._output()
            text = f"equilibrium: {self.found.summary}; residual force {self.found.residual:.2g} N"
            self._close("complete", text)
        except LineFailed as failed:
            raise self.failed(failed) from None

    @property
    def touches(self) -> bool:
        """Whether contact of a line with itself is computed."""
        return any(model.line.bits & SELF_CONTACT for model in self.model.models)

    def record_motion(self, reporter: ProgressReporter, interrupted: Callable[[], bool]) -> None:
        """Compute the motion and record it; KeyboardInterrupt after `interrupted`, with the file complete till then."""
        try:
            if self._begins:
                self.begin_motion()

            def report(finished: bool = False) -> None:
                zones, iterations = self.model.models[0].zones, int(self.loop.counts.iterations)
                reporter(self.t, self.steps, iterations, zones, finished, self.touches)

            def look() -> None:
                report()
                self.keep()
                if interrupted():
                    raise KeyboardInterrupt

            for change in self.changes[self.changed :]:
                for stop in self.stops(change.t):
                    self.go_to(stop, look)
                change_loads_of_lines(self, change.scene)
                self.changed += 1
                self.keep()
            for stop in self.stops():
                self.go_to(stop, look)
            report(finished=True)
            self.finish()
        except LineFailed as failed:
            raise self.failed(failed) from None
        except KeyboardInterrupt:
            self.finish("interrupted", f"stopped from outside at t = {self.t:.6g} s")
            raise

    def start_from(self, bodies: Floats) -> None:
        """Take the added mass of members of bodies that were at rest (B, STATE) when the motion began."""
        self.rest = bodies.copy()
        for body, row in zip(self.model.bodies, bodies, strict=False):
            body.take_added_mass(row)

    def make_solver(self) -> None:
        """A solver for the model as it is."""
        self.contact.note_partners()
        for part in self.parts:
            part.fit_lines()
        contacts, shared = self.contact.of_lines(any(part.remeshes for part in self.parts))
        lines, bodies = joined_lines(self.model, 0.0), self.model.body_numbers(0.0)
        for line, x in zip(self.lines, lines, strict=True):
            line.held = np.minimum(x.ends.held, 1)
        follows = [line.correction is not None for line in self.lines]
        lines = [x._replace(serves=x.serves or y) for x, y in zip(lines, follows, strict=True)]
        self.solver = NetworkSolver(lines, len(self.model.free), bodies, contacts, shared, self.resolution.tolerance)
        self._make_room(self.solver)
        self.solver.keep_books([line.books for line in self.lines])
        for use_solver in self.parts.use_solver:
            use_solver(self.model, self.solver)
        if self.loop.controlled:
            self.solver.allowed[:] = self.resolution.allowed
        self.loop.stir(self.model.members_of(self.solver.bodies))
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
        return bool(self.quantities.fields)

    def adopt_cells(self, number: int, model: Model, work: Work) -> None:
        """Go on with other cells of a line, which steps have changed to."""
        models, line = [*self.model.models], self.lines[number]
        models[number] = model
        self.model = replace(self.model, models=tuple(models))
        self.solver.adopt_cells(number, model.line, model.sea.values, work, line.books)
        line.adopt_cells(model)
        if self.planes is not None:
            self.planes.take_cells(number, model.line)

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
        time = self.system.require_time()
        if self.found is None:
            begin_as_placed(self.model, self.scenes, self.state, [line.events for line in self.lines])
        for part in self.parts:
            part.place()
        self.make_solver()
        for part in self.parts:
            part.balance()
        for point, text in blended_of_lines(self.system):
            if text:
                self.noted.event(0.0, *self.file.place(point), "motion blended in", text)
        for kind, text in self._notes:
            self._note(kind, text)
        self.balance()
        for part in self.parts:
            part.begin()
        if self.system.environment.waves is not None:
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
            if line.correction is not None:
                rubs = self.found is not None and line.number in self.found.with_friction
                line.correction.begin(line.model.ends.at(0.0), state, self.found is not None, rubs)
        self.renew_other()
        self._attach()
        self._output()
        if self._begun is not None:
            self._begun(self)
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
        outputs = [x for x in self.times if x < end] if self.system.output.exact else []
        last = self.times[-1] if until is None else until
        steps = [x for x in self.resolution.one.ends if x < end]
        if self.loop.controlled:
            grown = [*self.parts.begins, *(x for scene in self.scenes for x in ramp_ends(scene))]
            steps += [x for x in grown if x < end]
        return apart([*outputs, *steps, last, *self._breaks], self.t, self.resolution.one.step)

    def go_to(self, stop: float, look: Callable[[], None] = lambda: None) -> None:
        """Steps to `stop` (s), with what is due there; look: called there, and about ten times a second."""
        while (due := self.parts.due) < stop - SAME_STOP * self.resolution.one.step:
            self._go_to(due, look)
            self.write_log()
            for part in self.parts:
                if part.due == due:
                    part.at_due()
        self._go_to(stop, look)
        for begin in self.parts.at_stop:
            begin()

    def _go_to(self, stop: float, look: Callable[[], None]) -> None:
        """The same, with nothing due on the way."""
        loop, step = self.loop, self.resolution.one.step
        for begin in self.parts.begin_leg if loop.controlled else ():
            begin()
        even = self.system.output.exact or bool(self.resolution.one.ends) or not falls_on(stop, self._breaks, step)
        steps = equal_steps(self.leg, self.t, stop, step, even)
        self.leg = steps[:2]
        loop.begin_leg(stop, *steps)
        if self.t < stop:
            self._step_on(stop, look)

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
            self._step_on(stop, lambda: None, code)

    @property
    def _steps_differ(self) -> bool:
        """Whether steps are not all the same, so that each stop has a say in their lengths."""
        one = self.resolution.one
        return bool(self.loop.controlled or self.parts.begins or self.system.output.exact or one.ends)

    def _fitting(self) -> tuple[object, ...]:
        """What compiled steps are attached to: where it is the same, and they have come to a stop, they go on."""
        models, reels = self.model.models, self.payout.lines.values() if self.payout is not None else ()
        return self.solver, self.model, *(x.ends.moves() for x in models), *(x.reel for x in reels)

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

    def _step_on(self, stop: float, look: Callable[[], None], code: int | None = None) -> None:
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
                if code == b.PAUSED or arrived:
                    look()
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
        for line in self.lines:
            line.lets_touch = self.contact.lets_touch
            if line.correction is not None:
                line.correction.set_torque()
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
            model.ends.at(t)
            model.sea.at(t)
            line.books.velocity[:] = model.ends.velocity
        self.model.load_bodies(t, self.solver.bodies, self.loaded)
        self.model.stir(t, self.state.bodies, t - self.t, self.solver.bodies)

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
            raise self.cuts.stopped(self.solver, self.loop.tried, dt)
        self._go_back(False)
        self.loop.try_whole()

    def _go_back(self, still: bool) -> None:
        """Whether forces are found of the state before a try, which the extremes know: it counts once."""
        for line in self.lines:
            line.books.counts.repeats = int(still)

    def ends_of_now(self) -> None:
        """Let ends and sea be as they are now: compiled steps have moved them without Python."""
        if not self.loop.counts.asks & b.ASK_BEFORE:
            for model in self.model.models:
                model.ends.at(self.t)
                model.sea.at(self.t)

    def _spent(self) -> float:
        """Processor time of the run, s, to within `read_every`: to read it may take as long as ten steps."""
        wall = monotonic()
        if wall - self._read[0] > self.read_every:
            self._read = wall, clock_now() - self._begin
        return max(self._read[1], self._logged)

    def write_log(self) -> None:
        """Log the steps that have been made since this was called last."""
        rows = self.loop.rows()
        if not len(rows):
            return
        now = self._spent()
        cpu = np.linspace(self._logged, now, len(rows) + 1)[1:]
        self._logged = now
        for log in self.parts.log:
            log(rows[:, :, FORCE_COLUMNS])
        for k, line in enumerate(self.lines):
            line.log(np.column_stack([rows[:, k], cpu]))

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
        self.failures.release(weakness, why)

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
        if self.system.output.exact or self.resolution.one.ends or falls_on(stop, self._breaks, step):
            self.leg = (stop, 0)

    def output_due(self) -> None:
        """Make the output that is due now, if one is: before loads, or what holds lines, become others."""
        if self.loop.due:
            self._attach()
            self._output()

    def finish(self, status: str = "complete", message: str = "") -> None:
        """Write what waits, and close the file."""
        self.write_log()
        for write in (self.record_samples, *(line.write_down for line in self.lines)):
            if status == "complete":
                write()
            else:
                with suppress(LineFailed):
                    write()
        if status != "failed":
            self.keep(last=True)
        self._close(status, message or f"{self.steps} steps")

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
                model.ends.at(self.t)
                model.sea.at(self.t)
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
            model.ends.at(self.t)
            model.sea.at(self.t)
            line.books.velocity[:] = model.ends.velocity
        self.model.load_bodies(self.t, solver.bodies, self.loaded)
        self.model.stir(self.t, self.state.bodies, 0.0, solver.bodies)
        lengthening: dict[int, Floats] = {}
        with ExitStack() as stack:
            for forces_on in self.parts.forces_on:
                lengthening |= stack.enter_context(forces_on())
            taken = solver.consistent_accelerations(self.state, accelerations, self.t, lengthening)
        if taken.outcome != Outcome.OK:
            raise self.cuts.stopped(solver, taken, 0.0)

    # --- other lines in mid-motion --------------------------------------------------------------------

    def renew_solver(self, after: str) -> None:
        """Another solver in mid-motion, for lines that have changed; after: what, for the text of a failure."""
        self.gather_events()  # in the order in which they happen
        bodies, work = self.solver.bodies.copy(), self.solver.body_work.copy()
        self.make_solver()
        self.solver.bodies[:], self.solver.body_work[:] = bodies, work
        self.renew_other()
        self.evaluate_forces(after)

    def go_on_as_attached(self, after: str) -> None:
        """Go on with the same solver and states, for lines that have changed; after: as of `renew_solver`."""
        self.gather_events()
        turns = self.loop.turns
        self.evaluate_forces(after)
        self.solver.take_turns(turns)
        self.loop.stand_after_change()

    def evaluate_forces(self, after: str) -> None:
        """The forces of the state of now; after: as of `renew_solver`.  LineFailed: there are none."""
        for line, model in zip(self.lines, self.model.models, strict=True):
            model.ends.at(self.t)
            model.sea.at(self.t)
            line.books.velocity[:] = model.ends.velocity  # a try has moved them on
        self.model.load_bodies(self.t, self.solver.bodies, self.loaded)
        taken = self.solver.forces_in_motion(self.state, self.t)
        if taken.outcome != Outcome.OK:
            raise LineFailed(taken.line, taken.outcome, self.t, None, after)


def line_scenes(system: Network, model: NetworkModel) -> dict[str, LineScene]:
    """Scenes of the lines of a system by name, between points as they are first looked for."""
    guesses, known = system.guesses, model.scenes
    return {name: system.scene_of(name, system.carried(name), guesses, scene=known[name]) for name in model.names}


def start_of(system: Network, model: NetworkModel, moves: bool, criterion: UserCriterion | None) -> Start:
    """The first state of a system, with its zones; moves: whether a motion begins there, else it is at rest."""
    scenes = line_scenes(system, model)
    if moves and system.starts_as_placed:
        model, managers = zones_as_placed(scenes, model, criterion)
        return Start(model, None, managers)
    with at_once():
        return start_at_rest(system, scenes, model, moves, criterion)


def _torque_of(manager: DomainManager | None) -> Callable[[], float] | None:
    """What gives the torque of a line as far as its rods do not carry it, N m; None: its zones stay."""
    return None if manager is None else lambda: float(manager.torque)


def run_system(
    system: Network, target: Target | None, text: str, reporter: ProgressReporter,
    interrupted: Callable[[], bool], name: str = RESULT, resolution: NetworkResolution | None = None,
    recording: Recording = ALONE, criterion: UserCriterion | None = None,
    changes: Sequence[LoadChange[Network]] = (),
) -> NetworkRun:  # fmt: skip
    """Compute the motion of a system into a file with checkpoints, into memory, or (target None) to be compared with.

    name: of the pass; resolution, recording, criterion, changes: as of `NetworkRun`.
    """
    mode = recording.mode._replace(before=recording.mode.before or {})  # it can be resumed
    recording = recording._replace(mode=mode, planes=True)
    run = NetworkRun(system, target, text, True, resolution, recording, criterion, changes)
    reporter.begin(name, run.resolution.one)
    run.record_motion(reporter, interrupted)
    return run


def static_system(
    system: Network, target: Target | None, text: Text, resolution: NetworkResolution | None = None, pending: str = ""
) -> NetworkRun:
    """Compute the equilibrium of a system under full loads; target, resolution, pending: as of `run_system`."""
    run = NetworkRun(system, target, text, False, resolution, Recording(pending=pending))
    run.record_equilibrium()
    return run
