"""A cable in motion: its state, the steps that advance it, and the work done on it.

`begin` gives the first state, `advance` takes steps and yields each that is accepted.  Zones change and planes are left
between two steps.  Nothing is written here, and nothing decides that a healthy step was the last: simulation.time_loop.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from hybrid.adapt.manager import Change
from hybrid.errors import Outcome
from hybrid.kernels.forces import SEABED
from hybrid.kernels.report import CONTACT_WORK, FORCE_A, FRICTION_WORK, SEABED_ENERGY
from hybrid.kernels.state import State, blank_state
from hybrid.model.build import Model, build
from hybrid.model.plan import step_ends
from hybrid.model.plane import in_space, planar
from hybrid.model.resolution import Resolution
from hybrid.scene.schema import Scene
from hybrid.simulation.bending_correction import Correction
from hybrid.simulation.events import EventLog, steps_cut_text
from hybrid.simulation.plane_monitor import PlaneMonitor, same_plane
from hybrid.simulation.restore import mesh_tree
from hybrid.simulation.zone_switching import ZoneSwitching, on_layout
from hybrid.solve.plane_stability import Push
from hybrid.solve.statics import Equilibrium
from hybrid.solve.step_control import Controller
from hybrid.solve.stepper import POWERS, Stepper, Taken
from hybrid.store.named_arrays import matched

LONGEST_IN_PACE = 0.1  # of the time in which bending comes and goes: a step may not be longer meanwhile
HALVINGS = 10  # of a time step that fails: a factor of 1000 separates a hard moment from a hopeless one
SAME_PLACE = 1e-9  # of the length: ends that are so near to where they were have not been moved
CONTACT, FRICTION = POWERS.index("contact"), POWERS.index("friction")
PLAIN = ("t", "dt", "steps", "iterations", "changes", "_stored", "_beyond", "_turned")  # plain values of a checkpoint


class Step(NamedTuple):
    """An accepted step, as the step log of a result has it."""

    t: float  # s, at its end
    dt: float
    iterations: int  # repeats included
    correction: float
    residual: float
    repeats: int
    error: float
    end_force_start: float
    end_force_end: float


class StepFailed(Exception):
    """No step leads on: how the last try ended, and its length, s (0: there is no consistent start)."""

    def __init__(self, taken: Taken, dt: float) -> None:
        super().__init__(taken.outcome.cause)
        self.taken, self.dt = taken, dt


class Transient:
    """A cable in motion."""

    def __init__(
        self,
        scene: Scene,
        model: Model,
        resolution: Resolution,
        switching: ZoneSwitching | None,
        correction: Correction | None,
        events: EventLog,
    ) -> None:
        """It has no state before `begin` or `restore`."""
        self.scene, self.model, self.resolution, self.events = scene, model, resolution, events
        self.switching, self.correction, self._beyond = switching, correction, -np.inf
        self._turned = False  # whether an event has told of steps cut by the turn of an end
        self.stepper = self._new_stepper(model.slack_floor if model.slack == "stop" else -np.inf)
        self.control = (
            None if resolution.local is None else Controller(resolution.local, resolution.step, resolution.shortest)
        )
        self.plane_monitor = PlaneMonitor(scene)
        self.t, self.steps, self.iterations = 0.0, 0, 0
        self.changes = 0  # of the scene, so far
        self.dt = 0.0  # s, of the last step; 0 after a start
        self.state = self.before = model.start  # now, and before the last step
        self.power = [0.0] * CONTACT  # W, now
        self.work = [0.0] * len(POWERS)  # J, since the start
        self._stored = 0.0  # J, in the seabed
        self._loaded = [any(abs(x - s) < 1e-9 * model.length for x in model.attached) for s in (0.0, model.length)]

    @property
    def rho(self) -> float:
        """Spectral radius of the time scheme."""
        assert self.scene.time is not None
        return self.scene.time.rho_inf

    # --- the start ------------------------------------------------------------------------------

    def begin(self, equilibrium: Equilibrium | None) -> None:
        """From an equilibrium, or from the shape that the scene gives.  StepFailed: no accelerations are consistent."""
        model = self.model
        if equilibrium is None:
            self.state = model.start.copy()
            self._rotate_ends_in()
            if not self.state.v.any():
                self.stepper.static_friction(model.sea.at(0.0), model.ends.at(0.0), self.state)
        else:
            self.state = equilibrium.state.copy()
        begun = self.plane_monitor.begin(model, self.state, self._note)
        if begun is not model:
            self._set_model(begun)
        self._find_accelerations()
        if self.switching is not None:
            self.switching.begin(model.ends.values, self.state)
        if self.correction is not None:
            with_friction = equilibrium is not None and equilibrium.with_friction
            self.correction.begin(model.ends.at(0.0), self.state, equilibrium is not None, with_friction)
        self.before = self.state.copy()
        self.power = self._powers()

    def _rotate_ends_in(self) -> None:
        """Tangents that the initial shape does not have are reached smoothly, and an event says so."""
        assert self.scene.time is not None
        model, e = self.model, self.state.e
        d = (e[0] / np.linalg.norm(e[0]), e[-1] / np.linalg.norm(e[-1]))
        which = [bool(model.line.element[0]), bool(model.line.element[-1])]
        duration = min(model.time_scale, 0.5 * self.scene.time.duration)
        for k, angle in model.ends.bring_in(d, which, duration):
            s = float(model.line.s[-k])
            text = (
                f"the initial shape misses the tangent prescribed at s = {s:g} m by {np.degrees(angle):.3g} deg: "
                f"it is rotated to it, and a force there grows, over the first {duration:.3g} s; "
                f"start from an equilibrium to avoid this"
            )
            self.events.event(0.0, s, s, "end rotated in", text)

    def _find_accelerations(self) -> None:
        """Accelerations and tensions that are consistent with positions, velocities and loads."""
        ends = self.model.ends
        acceleration = ends.acceleration(self.t, 1e-3 * self.resolution.step)
        self._stored = 0.0
        taken = self.stepper.consistent_accelerations(
            self.model.sea.at(self.t), ends.at(self.t), acceleration, self.state
        )
        self.dt = 0.0
        if taken.outcome != Outcome.OK:
            raise StepFailed(taken, 0.0)
        self._stored = self.stepper.told[SEABED_ENERGY]

    def restart(self) -> None:
        """A load has just stopped, or others act: accelerations jump."""
        self.model.ends.set_loads(self.t)
        self._find_accelerations()
        if self.control is not None:
            self.control.restart()
        self.power = self._powers()

    # --- steps ----------------------------------------------------------------------------------

    def step_ends(self, stop: float) -> Iterator[float]:
        """Where steps should end on the way to `stop`, s."""
        if self.control is None:
            yield from step_ends(self.t, stop, self.resolution.step)
            return
        while self.t < stop:
            manager = self.switching.manager if self.switching is not None else None
            blending = manager is not None and manager.ramping
            self.control.most = LONGEST_IN_PACE * manager.pace if manager is not None and blending else np.inf
            until = self.control.until(self.t, stop)
            yield self.model.ends.until_turned(self.t, until, self.resolution.turn)

    def advance(self, until: float) -> Iterator[Step]:
        """To `until` (s): in one step if all is well, else in halves of halves; with a controller, one step towards it.

        Yields every accepted step, and changes zones, or leaves the plane, when it is asked for the next.  StepFailed:
        steps fail however small.
        """
        begin, control = self.t, self.control
        dt = until - self.t
        smallest = dt * 0.5**HALVINGS if control is None else control.smallest
        repeats = wasted = rescues = 0
        while self.t < until:
            end = until if until - self.t <= dt * (1 + 1e-9) else self.t + dt
            if control is None:
                end = self._cut(end)
            taken, switching = self._try(end), self.switching
            rescue = switching.rescue(taken, end, end - self.t, self.before, rescues) if switching is not None else None
            if rescue is not None:
                self._switch(rescue)
                rescues += 1
                wasted += taken.iterations
            elif taken.outcome == Outcome.OK and control is not None and not control.accepts(end - self.t, taken.error):
                wasted += taken.iterations
                repeats += 1
                dt = control.next
            elif taken.outcome == Outcome.OK:
                step = self._accept(taken, end, repeats, wasted)
                yield step
                self._adapt(step.dt)
                wasted = rescues = 0
                if control is not None:
                    break
            elif 0.5 * dt < smallest and switching is not None and (change := switching.all_rod(taken)) is not None:
                self._switch(change)
                dt, wasted = until - self.t, wasted + taken.iterations
            elif taken.outcome == Outcome.SLACK or 0.5 * dt < smallest:
                # A slack catenary is no matter of the step: its answer would be grid noise at any dt.
                raise StepFailed(taken, end - self.t)
            else:
                wasted += taken.iterations
                repeats += 1
                dt = 0.5 * dt if control is None else control.fails(end - self.t)
        if repeats and self.model.line.bits & SEABED:
            self._reset_after_impact(until - begin)

    def _cut(self, end: float) -> float:
        """The end (s) of a fixed step, earlier if an end of the cable turned too far in it: an event for the first."""
        most, ends = self.resolution.turn, self.model.ends
        earlier = ends.until_turned(self.t, end, most)
        if earlier < end and not self._turned:
            text = steps_cut_text(ends.turn_between(self.t, end), end - self.t, most)
            self.events.event(self.t, 0.0, self.model.length, "steps cut", text)
            self._turned = True
        return earlier

    def _try(self, end: float) -> Taken:
        """A step to `end`, from `state` to `before`, which is not yet swapped with it."""
        ends, dt = self.model.ends.at(end), end - self.t
        if self.switching is not None:
            self.switching.prepare_step(end, dt, self.state)
        last = dt if self.control is None else self.dt
        return self.stepper.step(self.model.sea.at(end), ends, self.state, self.before, dt, self.rho, last)

    def _accept(self, taken: Taken, end: float, repeats: int, wasted: int) -> Step:
        """The step that was tried is the new state; its work is booked."""
        dt = end - self.t
        self.state, self.before = self.before, self.state
        if self.correction is not None:
            self._correct(self.correction, end, dt)
        self.t, self.dt, self.steps, self.iterations = end, dt, self.steps + 1, taken.iterations
        power = self._powers()
        half = 0.5 * dt
        for k, (a, b) in enumerate(zip(self.power, power, strict=True)):
            self.work[k] += half * (a + b)
        if self.model.line.bits & SEABED:  # the seabed's comes by way, not by power; what it stores is energy, not work
            told = self.stepper.told
            self.work[CONTACT] += told[CONTACT_WORK] + told[SEABED_ENERGY] - self._stored
            self.work[FRICTION] += told[FRICTION_WORK]
            self._stored = told[SEABED_ENERGY]
        self.power = power
        return Step(
            end, dt, taken.iterations + wasted, taken.correction, taken.residual, repeats, taken.error,
            self._end_force(0), self._end_force(1),
        )  # fmt: skip

    def _correct(self, correction: Correction, end: float, dt: float) -> None:
        """Follow the error of neglecting bending through the step just taken; an event where it cannot be estimated."""
        before = dt if self.control is None else self.dt
        correction.step(self.stepper, self.model.ends.values, self.state, dt, before, self.rho)
        beyond = correction.beyond
        if beyond and end > self._beyond:  # once in a while that it takes the whole line to move
            s = float(self.model.line.s[max(correction.corrector.where, 0)])
            self.events.event(end, s, s, "model error not estimated", beyond)
            self._beyond = end + self.model.time_scale

    def _adapt(self, dt: float) -> None:
        """After an accepted step of dt: zones change where criteria ask for it, and the plane is left where it must."""
        leaves = self.plane_monitor.must_leave(self.stepper, self._note)
        if self.switching is not None:
            booked, change = self.switching.book_step(self.t, dt, self.model.ends.values, self.before, self.state)
            self.work[-1] += booked
            if change is not None:
                self._switch(change)
        if leaves:
            self._set_model(self.plane_monitor.leave(self.model, self.state))
            self.before = self.state.copy()
            self.stepper.evaluate_forces(self.model.sea.at(self.t), self.model.ends.at(self.t), self.state)
            self.power = self._powers()

    def _reset_after_impact(self, dt: float) -> None:
        """After shortened steps: an impact on the seabed leaves accelerations that would undo all velocity at once."""
        state = self.state
        hit = state.bed.any(axis=1) & (np.abs(state.a).max(axis=1) * dt > np.abs(state.v).max())
        state.a[hit], state.vd[hit] = 0.0, 0.0

    def _powers(self) -> list[float]:
        ends = self.model.ends
        return self.stepper.powers(ends.values, ends.velocity, self.state)

    def _end_force(self, k: int) -> float:
        """Magnitude, N, of the force that holds or loads an end; of an end body the tension beside it."""
        ends = self.model.ends.values
        if self._loaded[k]:
            return abs(float(self.state.T[-k]))
        x, y, z = self.stepper.told[FORCE_A + 3 * k : FORCE_A + 3 * k + 3] if ends.held[k] else ends.force[k].tolist()
        return sqrt(x * x + y * y + z * z)

    # --- another model --------------------------------------------------------------------------

    def _switch(self, change: Change) -> None:
        """Zones change: nothing moves, and what changes energy is booked."""
        assert self.switching is not None
        ends, sea = self.model.ends.at(self.t), self.model.sea.at(self.t)
        model, self.state, booked = self.switching.switch(change, self.t, ends, self.state, sea)
        self.work[-1] += booked
        base = self.switching.manager.layout.base
        for k, why in enumerate(change.reasons):
            energy = booked if k == 0 else 0.0  # of all that change now
            self.events.event(
                self.t, float(base[why.a]), float(base[why.b]), why.kind, why.text,
                criterion=why.criterion, value=why.value, threshold=why.threshold, energy=energy,
            )  # fmt: skip
        self.before = self.state.copy()
        self._set_model(model)
        if self.correction is not None:
            self.correction.switch(model)
        self.stepper.evaluate_forces(model.sea.at(self.t), model.ends.at(self.t), self.state)
        self._stored = self.stepper.told[SEABED_ENERGY]
        self.power = self._powers()

    def change_loads(self, scene: Scene) -> None:
        """Other loads, and other motions of the ends, from now on; the cable stays what it is and where it is."""
        old, monitor = self.model, self.plane_monitor
        model = build(scene, self.resolution, old.mesh)
        if self.switching is not None:
            model = on_layout(model, self.switching.manager.layout)
            self.switching.release_joints(self.state)
        model.line.h[:], model.line.kb[:] = old.line.h, old.line.kb  # what is on its way goes on
        model.ends.go_on_from(old.ends, self.t)
        self.scene, self.changes = scene, self.changes + 1
        leaves = monitor.push is not None and not same_plane(old.plane, model.plane)
        if old.plane is not None and not leaves:
            model = replace(model, line=planar(model.line, old.plane), plane=old.plane)
        elif leaves:
            model = monitor.leave(replace(model, plane=old.plane), self.state)
        else:
            model = replace(model, line=in_space(model.line), plane=None)
        if self.correction is not None:
            self.correction.switch(model)
        self._set_model(model)
        self.before = self.state.copy()
        if self.switching is not None:
            self.switching.manager.moments = model.ends.moments
            self.switching.manager.loaded = bool(model.ends.moments.any())
        text = (
            f"from t = {self.t:.6g} s on other loads act, or the ends move otherwise, as `hybrid resume` was asked to"
        )
        self.events.event(self.t, 0.0, model.length, "loads change", text)
        self.restart()

    def _set_model(self, model: Model) -> None:
        """Go on with another line: other zones, or out of the plane."""
        self.model = model
        if self.switching is not None:
            self.switching.model = model
        self.stepper = self._new_stepper(self.stepper.floor)
        self.plane_monitor.attach(self.stepper)

    def _new_stepper(self, floor: float) -> Stepper:
        model = self.model
        return Stepper(model.line, model.length, model.tension_scale, floor, keep=self.correction is not None)

    def _note(self, node: int, kind: str, text: str) -> None:
        s = float(self.model.line.s[node])
        self.events.event(self.t, s, s, kind, text)

    # --- checkpoints ----------------------------------------------------------------------------

    def checkpoint(self) -> dict[str, Any]:
        """What the next steps depend on, between two steps: named arrays and plain values (simulation.restore)."""
        model, push = self.model, self.plane_monitor.push
        plain = {name: getattr(self, name) for name in PLAIN} | {
            "floor": self.stepper.floor, "work": np.array(self.work), "power": np.array(self.power),
        }  # fmt: skip
        parts: dict[str, Any] = {
            "ends": model.ends, "control": self.control, "zoning": self.switching, "correction": self.correction,
        }  # fmt: skip
        return plain | {name: x.checkpoint() if x is not None else None for name, x in parts.items()} | {
            "state": self.state._asdict(), "mesh": mesh_tree(model), "plane": model.plane,
            "push": push.checkpoint(self.state) if push is not None else None,
        }  # fmt: skip

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Continue as `checkpoint` has said, on a model that was made for it.

        ValueError or ResultError: that cannot be.
        """
        model, monitor = self.model, self.plane_monitor
        if saved["push"] is not None and model.plane is not None:
            monitor.push = Push(model.line, model.length, model.time_scale)
        self._set_model(model)
        self.state = blank_state(model.cells)
        saved = {"_turned": False} | dict(saved)  # files of 0.6.0 do not have it
        saved = matched(saved, self.checkpoint() | {"mesh": None, "plane": None}, "state")
        vars(self).update({name: saved[name] for name in PLAIN})
        self.work, self.power = saved["work"].tolist(), saved["power"].tolist()
        self.state, self.stepper.floor = State(**saved["state"]), saved["floor"]
        self.before = self.state.copy()
        model.sea.at(self.t)
        apart = model.ends.restore(saved["ends"], self.t)
        if apart > SAME_PLACE * model.length:
            moved = f"an end is {apart:.3g} m from where it was at t = {self.t:.6g} s: has its motion file changed?"
            raise ValueError(moved)
        if self.control is not None:
            self.control.restore(saved["control"])
        if monitor.push is not None:
            monitor.push.restore(saved["push"], self.state)
        if self.switching is not None:
            self.switching.restore(saved["zoning"])
        if self.correction is not None:
            self.correction.restore(saved["correction"], model.ends.values)
