"""A cable in motion: its state, the steps that advance it, and the work done on it.

`begin` gives the first state; `advance` lets the compiled run go on (solve.run) and yields where there is something to
write down or to look at.  Between two steps zones change, and planes are left and come back to.  Nothing is written
here, and nothing decides that a healthy step was the last: simulation.time_loop.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from typing import TYPE_CHECKING

import numpy as np

from hybrid.adapt.manager import Change
from hybrid.errors import Outcome
from hybrid.kernels.state import books as b
from hybrid.kernels.state.forces import MAY_TOUCH, SELF_CONTACT
from hybrid.kernels.state.report import SEABED_ENERGY, SELF_CONTACT_ENERGY
from hybrid.kernels.state.state import Batch, State, Work, state_for
from hybrid.kernels.step.step_law import FIRST
from hybrid.model.build import Model
from hybrid.model.plan import SAME_STOP, equal_steps
from hybrid.model.resolution import Resolution
from hybrid.model.scales import wave_step
from hybrid.outputs.joined_lines import Output, outputs_in
from hybrid.scene.schema import Scene
from hybrid.simulation.bending_correction import Correction
from hybrid.simulation.blended import note_blended, note_drawn, rotate_ends_in
from hybrid.simulation.cell_changes import CellChanges
from hybrid.simulation.contact_start import (
    begin_contact,
    comes_near,
    end_contact,
    gives_up_contact,
    refuse_start_in_obstacles,
)
from hybrid.simulation.diagnostics import borne_strain
from hybrid.simulation.envelope import Envelope, marked_places, marks_on
from hybrid.simulation.events import EventLog
from hybrid.simulation.kind_changes import KindChanges
from hybrid.simulation.plane_monitor import PlaneMonitor
from hybrid.simulation.releases import let_go, overloaded, watch_forces
from hybrid.simulation.self_watch import SelfWatch, let_touch_itself, refuse_start_in_itself
from hybrid.simulation.step_events import (
    look_at_itself,
    note_collapse,
    note_cut,
    note_iterations,
    note_slack,
    note_unknown_error,
)
from hybrid.simulation.zone_switching import ZoneSwitching, note_change
from hybrid.solve.run import CompiledRun, Tried
from hybrid.solve.statics import Equilibrium
from hybrid.solve.stepper import Stepper

if TYPE_CHECKING:  # a line that is not paid out does without, and starts sooner
    from hybrid.simulation.payout import PayingOut
    from hybrid.simulation.payout_nodes import NodeChanges
    from hybrid.simulation.payout_zones import PaidZones

SAME_PLACE = 1e-9  # of the length: ends that are so near to where they were have not been moved


class StepFailed(Exception):
    """No step leads on: how the last try ended, and its length, s (0: there is no consistent start)."""

    def __init__(self, tried: Tried, dt: float) -> None:
        super().__init__(tried.outcome.cause)
        self.tried, self.dt = tried, dt


class Transient:
    """A cable in motion."""

    of_many = False  # whether its line is one of several

    def __init__(
        self,
        scene: Scene,
        model: Model,
        resolution: Resolution,
        switching: ZoneSwitching | None,
        correction: Correction | None,
        events: EventLog,
        outputs: Sequence[float] = (),
        extremes: bool = False,
        touches: bool = True,
        ranges: bool = False,
    ) -> None:
        """It has no state before `begin` or `restore`.  outputs: s, increasing, times of samples; extremes: whether

        lowest and highest values of all accepted steps are kept, as of a result; touches: whether contact with itself
        begins by itself where the line comes near itself, else that is only noticed; ranges: whether those values are
        kept of a run that is only compared.
        """
        assert scene.time is not None
        self.scene, self.model, self.resolution, self.events = scene, model, resolution, events
        self.switching, self.correction, self.beyond = switching, correction, -np.inf
        kept = extremes or ranges
        self.run = CompiledRun(scene.time.rho_inf, np.array(outputs, float), kept, switching is not None)
        self.envelope = Envelope(scene, model, moves=True) if kept else None
        if self.envelope is not None and self.envelope.quantities:
            self.run.keep_ranges(self.envelope.quantities.given_to(self.run.books))
        self.itself: SelfWatch | None = None
        if self.envelope is not None and extremes:
            self.itself = self.envelope.itself
        elif model.line.bits & MAY_TOUCH:
            self.itself = SelfWatch(model, "")
        self.nears_itself = False  # whether contact with itself has to begin after this step
        self.collapse = ""  # what cuts steps that have become so short that it may not end
        self.parts_itself = False  # whether it has to end after this step
        self.touches, self.came_near_itself = touches, False
        self.marked = marked_places(scene, model)
        self.payout: PayingOut | None = None
        self.paid_zones: PaidZones | None = None
        if model.payout is not None:
            from hybrid.simulation.payout import PayingOut
            from hybrid.simulation.payout_zones import PaidZones

            self.payout = PayingOut(model)
            model = self.payout.on(model, model.length)
            self.paid_zones = PaidZones(scene, self.payout, switching) if switching is not None else None
        self._set_control(resolution)
        self.plane_monitor = PlaneMonitor(scene.dimension == 2)
        self.may_come_back = switching is None and correction is None and self.payout is None
        self.plane_monitor.comes_back = self.may_come_back
        self.changes = 0  # of the scene, so far
        self.asks_samples = False  # whether Python looks at every output as it is sampled
        self.outputs_may_wait = False  # whether outputs may wait although the cells that they are of have changed
        self.turned = self.slackened = False  # whether an event has told of steps cut by the turn of an end, by slack
        self._pending: Change | None = None
        self._reviewed: Change | None = None  # what a review asks for that is done already
        self._cells: CellChanges | None = None  # of cells that change without Python
        self._kinds: KindChanges | None = None  # of kinds of cells that stay, likewise
        self._nodes: NodeChanges | None = None  # of nodes that enter and leave so
        self._overloaded: dict[int, str] = {}  # ends that are let go after the outputs of this step, and why
        self._leaves = self._returns = False  # whether it leaves its plane, or is back in it, after this step
        self._rescues = 0, 0  # the step before, and repetitions with more rod since
        self.run.books.loaded[:] = model.loaded_ends
        self.run.books = self.run.books._replace(hinges=model.hinges)
        self.run.clock.floor = model.slack_floor if model.slack == "stop" else -np.inf
        self.run.count.stiff = model.inextensible
        if not self._begins_at_once:
            self.set_model(model, state_for(model.line))  # until `begin` or `restore`

    @property
    def _begins_at_once(self) -> bool:
        """Whether no line is attached before `begin` or `restore`, because nothing needs one there."""
        return self.switching is None and self.payout is None and self.correction is None

    def _set_control(self, resolution: Resolution) -> None:
        """How long steps may be."""
        clock, count = self.run.clock, self.run.count
        count.controlled, clock.most_turn = resolution.local is not None, resolution.turn
        if resolution.local is not None:
            clock.tolerance, clock.largest = resolution.local, resolution.step
            clock.shortest = resolution.shortest
            clock.next_dt = max(resolution.step / FIRST, resolution.shortest)
            clock.error_ratio = 1.0

    # --- what it knows --------------------------------------------------------------------------

    @property
    def rho(self) -> float:
        """Spectral radius of the time scheme."""
        return float(self.run.clock.rho)

    @property
    def t(self) -> float:
        """Time of the state, s."""
        return float(self.run.clock.now)

    @property
    def state(self) -> State:
        return self.run.state

    @property
    def before(self) -> State:
        """The state before the last step; after a failure, the one that the last try led to."""
        return self.run.before

    @property
    def steps(self) -> int:
        """Accepted steps so far."""
        return int(self.run.count.steps)

    @property
    def iterations(self) -> int:
        """Newton iterations of the last step."""
        return int(self.run.count.iterations)

    @property
    def controlled(self) -> bool:
        """Whether the length of steps follows their error."""
        return bool(self.run.count.controlled)

    @property
    def between_steps(self) -> bool:
        """Whether the last step is done with, and the next not begun."""
        return bool(self.run.count.phase == b.BEGIN_STEP)

    @property
    def unchanging(self) -> bool:
        """Whether the line that samples are of stays as it is in the next step, so that they may wait in the buffer."""
        paid = self.payout is not None and self.payout.due
        leaves = self._leaves or self._returns or self.nears_itself or self.parts_itself
        return not (self._pending is not None or leaves or self._overloaded or paid)

    def waiting(self) -> Iterator[list[Output]]:
        """Outputs before those in the buffer of the run, of cells that have changed since; `empty` when done."""
        if self._cells is not None:
            yield from (outputs_in(batch, line, zones) for line, batch, zones in self._cells.waiting())
        if self._nodes is not None:
            yield from self._nodes.waiting()

    def outputs_of_now(self, batch: Batch) -> list[Output]:
        """The outputs of a batch of the line of now, copied."""
        if self.payout is not None:
            from hybrid.simulation.payout_nodes import outputs_of_now

            return outputs_of_now(self, batch)
        return outputs_in(batch, self.model.line, self.model.zones)

    def empty(self) -> None:
        """What `waiting` gave, and the samples of the run, have been taken."""
        for changes in (self._cells, self._nodes):
            if changes is not None:
                changes.empty()

    @property
    def cells_follow(self) -> bool:
        """Whether cells change without Python, so that outputs which wait are each of another line."""
        return self._kinds is not None or (self._cells is not None and self._cells.adopted)

    @property
    def pays_out(self) -> bool:
        """Whether line is paid out, and zones stay, so that outputs which wait are each of another line.

        Those of a line that touches itself do not wait: joined, they would lack the force of that.
        """
        return self.payout is not None and self.switching is None and self.run.contact is None

    # --- the start ------------------------------------------------------------------------------

    def begin(self, equilibrium: Equilibrium | None) -> None:
        """From an equilibrium, or from the shape that the scene gives.  StepFailed: no accelerations are consistent."""
        model = self.model
        if self.payout is not None:
            model = self.payout.on(model, model.length)
        if self.envelope is not None:
            note_blended(self.scene, self.events)
        if equilibrium is None:
            if self._begins_at_once:
                self.set_model(model, state_for(model.line))
            state = model.start.copy()
            refuse_start_in_obstacles(model, state)
            note_drawn(self.scene, self.events)
            rotate_ends_in(self.scene, model, state, self.events)
            if not state.v.any():
                self.stepper.static_friction(model.sea.at(0.0), model.ends.at(0.0), state)
        else:
            state = equilibrium.state.copy()
        if self.payout is not None:
            self.payout.begin_phases(model.line, state)
        begun = self.plane_monitor.begin(model, state, self._note)
        if self.envelope is not None:
            self.envelope.count_from(begun, state.r)
        self.set_model(begun, state)
        if self.run.contact is not None:
            self.stepper.work.u[:] = 0.0
            refuse_start_in_itself(self.run.contact, self.scene, begun)
        elif self.itself is not None and self.itself.is_near(self.run, self.resolution.step) and comes_near(self):
            begin_contact(self)
            begun, state = self.model, self.state
        self._find_accelerations()
        if self.switching is not None:
            self.switching.begin(begun.ends.values, state)
        if self.correction is not None:
            with_friction = equilibrium is not None and equilibrium.with_friction
            self.correction.begin(begun.ends.at(0.0), state, equilibrium is not None, with_friction)
        self.run.place(state.r[model.always].copy())
        if self.envelope is not None and self.itself is self.envelope.itself:
            self.itself.look_at_start(self.run, self.events.event)

    def _find_accelerations(self, new_leg: bool = True) -> None:
        """Accelerations and tensions that are consistent with positions, velocities and loads."""
        ends, run = self.model.ends, self.run
        acceleration = ends.acceleration(self.t, 1e-3 * self.resolution.step)
        force, pressed = None, 0.0
        if run.contact is not None:
            force, pressed = run.contact.force(self.state), run.contact.energy()
        lengthening: np.ndarray | float = 0.0
        if self.payout is not None:
            self.payout.stand_still()
            lengthening = self.payout.lengthening
        with self.payout.forces_on() if self.payout is not None else nullcontext():
            taken = self.stepper.consistent_accelerations(
                self.model.sea.at(self.t), ends.at(self.t), acceleration, self.state, force, lengthening
            )
        if taken.outcome != Outcome.OK:
            raise StepFailed(Tried(taken.outcome, taken.iterations, taken.correction, taken.where), 0.0)
        run.move(ends.moves())
        run.clock.last_dt = 0.0
        self.stepper.work.report[SELF_CONTACT_ENERGY] = pressed
        self._restart_books()
        if new_leg:
            self.begin_leg()

    def _restart_books(self) -> None:
        """The report of the state has been made anew: powers follow from it, and what the seabed stores."""
        run = self.run
        run.books.velocity[:] = self.model.ends.velocity
        if self.payout is not None:
            self.payout.stand_still()
        run.books.report[0] = self.stepper.work.report
        run.clock.stored = self.stepper.told[SEABED_ENERGY]
        run.clock.previous = run.clock.now
        run.count.phase, run.count.after_start, run.count.new_state = b.START, b.SAMPLE, 1

    def release(self, k: int, why: str, new_leg: bool = True) -> None:
        """End k (0 or 1) is let go now; new_leg: whether equal steps are counted from here."""
        if self.payout is not None and k == self.payout.plan.side:
            from hybrid.simulation.payout import Before

            before = Before(self.state, self.t, self.run.clock, self.run.books.tension)
            self.run.books.work[0, b.ZONES] += self.payout.end(before, self.model.line, self.model.ends.at(self.t))
        self.set_model(*let_go(self, k, why))
        self.restart(new_leg)

    def restart(self, new_leg: bool = True) -> None:
        """A load has just stopped, or others act: accelerations jump."""
        self.model.ends.set_loads(self.t)
        self._find_accelerations(new_leg)
        clock = self.run.clock
        if self.controlled:
            clock.next_dt = max(clock.next_dt / FIRST, clock.shortest)
            clock.error_ratio = 1.0

    # --- steps ----------------------------------------------------------------------------------

    def set_stop(self, stop: float) -> None:
        """The next steps end at `stop` (s)."""
        clock, count = self.run.clock, self.run.count
        clock.stop = stop
        if count.controlled and self.payout is not None:
            self.payout.limit_step()
        if not count.controlled and stop > clock.now:
            leg = float(clock.leg_begin), int(count.leg_part)
            step, ends = self.resolution.step, self.model.ends
            known = any(abs(t - stop) <= SAME_STOP * step for t in (*ends.breaks, *ends.release_times))
            even = self.scene.output.exact or bool(self.resolution.ends) or not known
            steps = equal_steps(leg, self.t, stop, step, even)
            clock.leg_begin, count.leg_part, count.leg_parts, clock.leg_step = steps

    def advance(self, stop: float, begun: int | None = None) -> Iterator[int]:
        """To `stop` (s), where a step ends; yields codes of state.books: STEPPED where there is something to look at.

        Between two yields steps are logged and outputs sampled in the books of `run`, which whoever asks empties.
        begun: code with which the compiled run has come back on its way there; None: it has not been called yet.
        StepFailed: steps fail however small.
        """
        run = self.run
        clock, count = run.clock, run.count
        if begun is None:
            self.set_stop(stop)
        while True:
            if begun is None:
                self._choose_asks()
            code, begun = self._go() if begun is None else begun, None
            if code == b.TRYING:
                assert self.switching is not None
                self.switching.prepare_step()
            elif code == b.TRIED:
                self._pending = self._review_try()
                if self._pending is not None:
                    yield code  # for outputs that wait, of the line as it was
                    self._switch(self._pending)
                    self._pending = None
            elif code == b.STEPPED:
                self._after_step()
                if count.notices:
                    yield code
            elif code == b.SAMPLED:
                yield code
                self._adapt()
            elif code == b.FAILED:
                yield code
                if not gives_up_contact(self):
                    raise StepFailed(run.tried, float(clock.try_end - clock.now))
                self.evaluate_forces()
                clock.tried_dt = clock.until - clock.now
                count.after_start, count.new_state = b.TRY, 0
            else:
                yield code
                if code == b.AT_STOP:
                    return

    def _go(self) -> int:
        """Let the compiled run go on, through changes of cells that need nothing else; a code of state.books."""
        nodes = self._changes_of_nodes()
        if nodes is not None:
            return nodes.go()
        cells, switching = self._changes_of_cells(), self.switching
        if cells is None or switching is None:
            return self.run.go()
        code = cells.go()
        while code == b.STEPPED and cells.unwatched():
            change = cells.review() if cells.review_due() else None
            booked = cells.change_zones_between(change) if change is not None else None
            if change is None:
                code = cells.go(reviewed=True)
            elif booked is not None:
                note_change(self.events, switching.manager, self.t, change, booked)
                code = cells.go()
            else:
                self._reviewed = change
                break
        cells.sync()
        return code

    def _changes_of_cells(self) -> CellChanges | None:
        """What changes cells, with the line of now; None: cells do not follow the curvature, or Python is asked."""
        if not CellChanges.applies(self):
            return None
        if self._cells is None or not self._cells.still_fits():
            waits = self._cells is not None and self._cells.waits
            if self.run.count.samples or waits:  # in the arrays of before: Python changes cells until they go
                return None
            self._cells = CellChanges(self)
        if not self._cells.adopted:
            self._cells.adopt()
        return self._cells

    def _changes_of_kinds(self) -> KindChanges | None:
        """What changes kinds of cells that stay, with the line of now; None: cells follow, or Python does it."""
        if not KindChanges.applies(self):
            return None
        if self._kinds is None or not self._kinds.fits:
            self._kinds = KindChanges(self)
        return self._kinds

    def _changes_of_nodes(self) -> NodeChanges | None:
        """What lets nodes enter and leave, with the line of now; None: no line is paid out, or Python is asked."""
        if self.payout is None:
            return None
        from hybrid.simulation.payout_nodes import NodeChanges

        if not NodeChanges.applies(self):
            return None
        if self._nodes is None or not self._nodes.still_fits() or not self._nodes.adopted:
            if self.run.count.samples or (self._nodes is not None and self._nodes.waits):
                return None  # in the arrays of before: Python changes nodes until they go
            if self._nodes is None or not self._nodes.still_fits():
                self._nodes = NodeChanges(self)
            self._nodes.adopt()
        return self._nodes

    def begin_leg(self) -> None:
        """Count fixed steps from here."""
        self.run.clock.leg_begin, self.run.count.leg_part = self.t, 0

    def _choose_asks(self) -> None:
        """When the compiled run has to ask: for zones, for a plane that is left."""
        count, switching, asks = self.run.count, self.switching, 0
        if self._leaves:
            asks |= b.ASK_STEPS
        changes = self._leaves or self._returns or self.nears_itself or self.parts_itself
        changes = changes or bool(self._overloaded) or self._pending is not None
        if changes or self.asks_samples or (self.payout is not None and self.payout.due):
            asks |= b.ASK_SAMPLES
        if switching is not None and not switching.compiled:
            asks |= b.ASK_BEFORE | b.ASK_TRIES | b.ASK_STEPS
        if self.correction is not None:
            self.correction.set_torque()
            if switching is not None and switching.manager.twisted:
                asks |= b.ASK_STEPS  # the torque is another one after every step
        count.asks = asks

    def _review_try(self) -> Change | None:
        """A try has ended: more rod, and the step again, where zones ask for it or the step failed; None: as it is."""
        run, switching = self.run, self.switching
        assert switching is not None
        clock, count, tried = run.clock, run.count, run.tried
        end, dt = float(clock.try_end), float(clock.try_end - clock.now)
        rescues = self._rescues[1] if self._rescues[0] == self.steps else 0
        change = switching.rescue(tried, end, dt, run.before, rescues)
        if change is not None:
            self._rescues = self.steps, rescues + 1
        elif tried.outcome != Outcome.OK and 0.5 * clock.tried_dt < clock.shortest:
            change = switching.all_rod(tried)
            clock.tried_dt = clock.until - clock.now if change is not None else clock.tried_dt
        if change is not None:
            count.wasted += tried.iterations
        return change

    def _after_step(self) -> None:
        """A step is accepted: what zones put in is booked, and what is to change decided."""
        run = self.run
        flags, end, dt = int(run.count.notices), self.t, float(run.clock.last_dt)
        if self.payout is not None and self.payout.at_its_end:
            raise StepFailed(Tried(Outcome.WINCH_AT_END, 0, 0.0, self.model.cells), dt)
        if flags & b.COLLAPSES and note_collapse(self):
            raise StepFailed(Tried(Outcome.COLLAPSED, 0, 0.0, int(run.count.cut_at)), dt)
        if flags & b.UNKNOWN_ERROR:
            note_unknown_error(self)
        if flags & b.STEPS_CUT:
            note_cut(run.clock, self.resolution.turn, self.model.length, self.events, self.turned or self.controlled)
            self.turned = True
        if flags & b.STEPS_SLACK:
            s = float(self.model.line.s[int(run.count.slack_cell)])
            note_slack(run.clock, float(run.clock.wave_step), s, self.events)
            self.slackened = True
        if flags & b.ITERATIONS_CUT:
            note_iterations(run.clock, run.count, self.model.length, self.events)
        if flags & (b.IS_BENT | b.MEETS_ITSELF | b.NEARS_ITSELF | b.PARTS_ITSELF | b.HIDES_ITSELF):
            look_at_itself(self, flags)
        if flags & b.PUSH_DIED:
            self.plane_monitor.renew(run)
        if flags & b.LEAVES_PLANE:
            self._leaves = self.plane_monitor.must_leave(run, self._note)
        self._returns = bool(flags & b.NEARS_PLANE)
        if flags & b.LETS_GO:
            self._overloaded = overloaded(run)
        if self._reviewed is not None:
            self._pending, self._reviewed = self._reviewed, None
        elif self.switching is not None:
            self._pending = self.switching.book_step(end, run.state)
        changes = self._pending is not None or self._leaves or self._returns or self.nears_itself
        changes |= bool(self._overloaded) or self.parts_itself
        changes |= self.payout is not None and self.payout.due
        run.count.inside = changes
        changes |= bool(run.count.samples) and not self.unchanging
        outputs, at = run.books.outputs, int(run.count.output)
        if not changes and (at == outputs.size or outputs[at] > end + dt):
            run.count.phase = b.END_STEP  # nothing to sample, nothing to change

    def _adapt(self) -> None:
        """After the outputs of a step: zones change where criteria ask for it, and the plane is left where it must."""
        change, self._pending = self._pending, None
        self.run.count.inside = 0
        if change is not None:
            self._switch(change)
        if self.payout is not None and self.payout.due:
            self._change_length()
        if self._leaves:
            self._leaves = False
            state = self.state.copy()
            self.set_model(self.plane_monitor.leave(self.model, self.run, state), state)
            self.evaluate_forces()
        if self.nears_itself:
            self.nears_itself = self._leaves = self._returns = False
            begin_contact(self)
            self.evaluate_forces()
        if self.parts_itself:
            self.parts_itself = False
            end_contact(self)
            self.evaluate_forces()
        if self._returns:
            self._returns = False
            self._come_back()
        released, self._overloaded = self._overloaded, {}
        for k, why in released.items():
            self.release(k, why, new_leg=False)

    def _change_length(self) -> None:
        """A node enters at the winch, or leaves."""
        assert self.payout is not None
        nodes = self._changes_of_nodes()
        if nodes is not None:
            nodes.change()
            return
        zones = self.paid_zones
        before = zones.before_change() if zones is not None else None
        if before is not None:
            self._switch(*before)
        if zones is not None:
            zones.hand_over(self.t, self.state)
        carry = (zones.carry,) if zones is not None else ()
        from hybrid.simulation.payout import Before

        run = self.run
        found = Before(run.state, run.t, run.clock, run.books.tension)
        model, state, booked = self.payout.change(found, self.model, *carry)
        if self.run.contact is not None:  # whose forces kernels.reel.payout_balance does not know
            self.payout.leave_unbalanced()
        self.run.books.work[0, b.ZONES] += booked
        self.set_model(model, state)
        self.evaluate_forces()

    def _come_back(self) -> None:
        """Go on in the plane that was left."""
        monitor, state = self.plane_monitor, self.state.copy()
        model = monitor.come_back(self.model, self.run, state)
        if model is not None:
            self.set_model(model, state)
            monitor.push_on(self.run, model)
            self.evaluate_forces()

    def evaluate_forces(self) -> None:
        """The forces and the powers of a state that has changed between two steps."""
        model = self.model
        self.stepper.evaluate_forces(model.sea.at(self.t), model.ends.at(self.t), self.state)
        run = self.run
        before, now = float(run.report[SELF_CONTACT_ENERGY]), 0.0
        if run.contact is not None:
            now = run.contact.settle(self.state, model.ends.values, self.stepper.work.report)
        run.books.work[0, b.ZONES] += now - before
        self._restart_books()

    # --- another model --------------------------------------------------------------------------

    def _switch(self, change: Change, here: np.ndarray | None = None) -> None:
        """Zones change: nothing moves, and what changes energy is booked; here: as of `ZoneSwitching.switch`."""
        assert self.switching is not None
        run, trying, cells = self.run, self.run.count.phase == b.JUDGE, self._changes_of_cells()
        if cells is not None and change.same:
            cells.change()
            if self._leaves or self._overloaded:
                cells.sync()
            return
        kinds = self._changes_of_kinds() if here is None else None
        if cells is not None:
            booked = cells.change_zones(change)
        elif kinds is not None:
            booked = kinds.change(change)
        else:
            if self.paid_zones is not None:
                self.model = self.paid_zones.as_now(self.model, self.t, self.state)
            ends, sea = self.model.ends.at(self.t), self.model.sea.at(self.t)
            model, state, booked = self.switching.switch(change, self.t, ends, self.state, sea, here)
            if self.payout is not None:
                self.payout.fit(model, self.t)
            run.books.work[0, b.ZONES] += booked
        note_change(self.events, self.switching.manager, self.t, change, booked)
        if cells is None and kinds is None:
            self.set_model(model, state)
            self.evaluate_forces()
        if trying:  # the step before is done with: its state was looked at as it was then
            run.count.after_start, run.count.new_state = b.TRY, 0

    def set_model(self, model: Model, state: State) -> None:
        """Go on with another line: other zones, or out of the plane."""
        before, books = self.model, self.run.books
        self.model = model
        self._kinds = None
        if self._cells is not None:
            self._cells.adopted = False
        if self._nodes is not None:
            self._nodes.adopted = False
        if self.switching is not None:
            self.switching.model = model
        if self.correction is not None and self.correction.model is not model:
            self.correction.switch(model)
        touches = bool(model.line.bits & SELF_CONTACT)
        keep = touches or self.correction is not None or (self.payout is not None and self.payout.solves_twice)
        self.stepper = Stepper(model.line, model.length, model.tension_scale, keep=keep)
        books.hinges[:] = model.hinges
        self.run.clock.wave_step = wave_step(model.line, model.tension_scale)
        self.run.attach(
            self.stepper, model.sea.values, model.ends.values, model.ends.moves(), state, 1.0 + borne_strain(model),
            model.always, marks_on(model.line.s, self.marked),
            self.correction.corrector if self.correction is not None else None,
        )  # fmt: skip
        if touches:
            let_touch_itself(self.run, self.scene, model, self.stepper.work)
        else:
            self.run.touch_no_more()
        if self.envelope is not None:
            self.envelope.pass_on(before, books, model, self.run.books)
            self.run.books.start[:] = self.envelope.start_of(model.nodes)
        if self.itself is not None:
            self.itself.attach(model, self.run)
        if self.payout is not None:
            from hybrid.simulation.payout_zones import moving_zones

            self.payout.attach(self.run, model, self.stepper, moving_zones(self.paid_zones))
        self.plane_monitor.attach(self.run, model.line)
        watch_forces(self.run, model)
        if self.switching is not None:
            self.switching.attach(self.run, self.resolution.every)

    def take(self, model: Model, work: Work) -> None:
        """Go on with the same line in other cells, which the run has changed to."""
        self.model, self.stepper.line, self.stepper.work = model, model.line, work
        self.plane_monitor.take(model.line)

    def _note(self, node: int, kind: str, text: str) -> None:
        s = float(self.model.line.s[node])
        self.events.event(self.t, s, s, kind, text)

    def envelope_values(self) -> dict[str, np.ndarray]:
        """Values of the envelope in the file, up to now; none where no extremes are kept."""
        if self.envelope is None:
            return {}
        return self.envelope.values(self.model.nodes, self.run.books.extremes, self.t)
