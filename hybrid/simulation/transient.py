"""A cable in motion: its state, the work done on it, and what is watched at every step."""

from __future__ import annotations

import io
import time as clock
from collections.abc import Iterator, Mapping
from dataclasses import replace
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np

from hybrid.adapt.manager import Change
from hybrid.errors import ComputationError, Outcome
from hybrid.kernels.forces import SEABED
from hybrid.kernels.report import BEND, CONTACT_WORK, FORCE_A, FRICTION_WORK, SEABED_ENERGY, TWIST_NODE
from hybrid.kernels.state import Floats, State, blank_state
from hybrid.model.build import Model, build
from hybrid.model.plan import step_ends
from hybrid.model.plane import in_space, planar
from hybrid.model.resolution import Resolution
from hybrid.outputs.probes import Observer
from hybrid.scene.read import scene_text
from hybrid.scene.schema import Scene
from hybrid.simulation.bending_correction import Correction
from hybrid.simulation.diagnostics import Stop, Watch
from hybrid.simulation.plane_monitor import Flat
from hybrid.simulation.restore import mesh_tree, program, resolution_tree
from hybrid.simulation.snapshot import write_snapshot
from hybrid.simulation.zone_switching import Zoning, on_layout
from hybrid.solve.plane_stability import Push
from hybrid.solve.statics import Equilibrium
from hybrid.solve.step_control import Controller
from hybrid.solve.stepper import POWERS, Stepper, Taken
from hybrid.store.memory_recorder import Notebook
from hybrid.store.named_arrays import matched
from hybrid.store.writer import Recorder

LONGEST_IN_PACE = 0.1  # of the time in which bending comes and goes: a step may not be longer meanwhile
MOST_RESCUES = 20  # of one step, by more rod
CONTACT, FRICTION = POWERS.index("contact"), POWERS.index("friction")
REMEMBERED = ("t", "dt", "steps", "iterations", "changes", "_stored", "_beyond")  # plain values of a checkpoint
SAME_PLACE = 1e-9  # of the length: ends that are so near to where they were have not been moved
HALVINGS = 10  # of a time step that fails: a factor of 1000 separates a hard moment from a hopeless one


class Motion:
    """A cable in motion: its state, the work done on it, and what to do when a step fails."""

    def __init__(
        self,
        scene: Scene,
        model: Model,
        resolution: Resolution,
        observer: Observer,
        recorder: Recorder | Notebook,
        target: Path | io.BytesIO | None,
        zoning: Zoning | None = None,
        correction: Correction | None = None,
    ) -> None:
        """target: the file of the result, beside which a failure leaves a snapshot; None: a run to compare with, which
        leaves none and is not watched.  `begin` or `restore` gives it a state."""
        self.scene, self.model, self.observer, self.recorder, self.target = scene, model, observer, recorder, target
        floor = model.slack_floor if model.slack == "stop" else -np.inf
        self.correction, self._beyond = correction, -np.inf
        self.stepper = self._new_stepper(floor)
        self.watch = Watch(recorder, model)
        self.zoning, self.resolution, self._stale = zoning, resolution, False
        self.control = (
            None if resolution.local is None else Controller(resolution.local, resolution.step, resolution.shortest)
        )
        self.t, self.steps, self.iterations = 0.0, 0, 0
        self.changes = 0  # of the scene, so far
        self.dt = 0.0  # s, of the last step; 0 after a start
        self.cpu = clock.process_time()
        self.work = [0.0] * len(POWERS)
        self._loaded = [any(abs(x - s) < 1e-9 * model.length for x in model.attached) for s in (0.0, model.length)]
        self._stored = 0.0  # J, in the seabed
        self.flat = Flat(scene)
        self.state = self.spare = model.start
        self.power = [0.0] * CONTACT

    def begin(self, equilibrium: Equilibrium | None) -> None:
        """From an equilibrium, or from the shape that the scene gives."""
        model, scene = self.model, self.scene
        assert scene.time is not None
        self.watch.begin()
        if equilibrium is None:
            self.state = model.start.copy()
            self._bring_ends_in()
            if not self.state.v.any():
                self.stepper.hold_on(model.sea.at(0.0), model.ends.at(0.0), self.state)
        else:
            self.state = equilibrium.state.copy()
            self.watch.equilibrium(equilibrium)
        begun = self.flat.begin(model, self.state, lambda node, kind, text: self.watch.note(0.0, node, kind, text))
        if begun is not model:
            self._on(begun)
        self._ignite()
        if self.zoning is not None:
            self.zoning.begin(model.ends.values, self.state)
        if self.correction is not None:
            self.correction.begin(
                model.ends.at(0.0), self.state, equilibrium is not None, equilibrium is not None and equilibrium.rubbed
            )
        self.spare = self.state.copy()
        self.power = self._powers()
        self._look(self.watch.still(model.ends.values, self.state))
        if scene.time.rho_inf == 1.0 and not model.line.ck.all():
            text = "rho_inf = 1 damps nothing: the tension of an inextensible cable grows a sawtooth; 0.9 keeps it away"
            self.recorder.event(0.0, 0.0, model.length, "undamped", text)

    def checkpoint(self) -> dict[str, Any]:
        """What the next steps hang on, between two steps: named arrays and plain values (simulation.restore)."""
        model, push = self.model, self.flat.push
        plain = {name: getattr(self, name) for name in REMEMBERED} | {
            "cpu": clock.process_time() - self.cpu, "first_energy": self.observer.first_energy or 0.0,
            "floor": self.stepper.floor, "work": np.array(self.work), "power": np.array(self.power),
        }  # fmt: skip
        parts: dict[str, Any] = {
            "ends": model.ends, "watch": self.watch, "control": self.control, "zoning": self.zoning,
            "correction": self.correction,
        }  # fmt: skip
        return plain | {name: x.checkpoint() if x is not None else None for name, x in parts.items()} | {
            "state": self.state._asdict(), "mesh": mesh_tree(model), "plane": model.plane,
            "push": push.checkpoint(self.state) if push is not None else None,
        }  # fmt: skip

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go on as `checkpoint` has said, on a model that was made for it; ValueError or ResultError where that cannot
        be."""
        model = self.model
        if saved["push"] is not None and model.plane is not None:
            self.flat.push = Push(model.line, model.length, model.time_scale)
        self._on(model)
        self.state = blank_state(model.cells)
        saved = matched(saved, self.checkpoint() | {"mesh": None, "plane": None, "first_energy": 0.0}, "state")
        vars(self).update({name: saved[name] for name in REMEMBERED})
        self.cpu = clock.process_time() - saved["cpu"]
        self.observer.first_energy = saved["first_energy"]
        self.work, self.power = saved["work"].tolist(), saved["power"].tolist()
        self.state, self.stepper.floor = State(**saved["state"]), saved["floor"]
        self.spare = self.state.copy()
        self.watch.restore(saved["watch"])
        model.sea.at(self.t)
        apart = model.ends.restore(saved["ends"], self.t)
        if apart > SAME_PLACE * model.length:
            moved = f"an end is {apart:.3g} m from where it was at t = {self.t:.6g} s: has its motion file changed?"
            raise ValueError(moved)
        if self.control is not None:
            self.control.restore(saved["control"])
        if self.flat.push is not None:
            self.flat.push.restore(saved["push"], self.state)
        if self.zoning is not None:
            self.zoning.restore(saved["zoning"])
        if self.correction is not None:
            self.correction.restore(saved["correction"], model.ends.values)

    def write_to(self, recorder: Recorder) -> None:
        """Write to a recorder from now on."""
        self.recorder = self.watch.recorder = recorder

    def keep(self, at_once: bool = False) -> None:
        """Bring the file up to date, with a checkpoint at the output just written, if it is time to (or `at_once`)."""
        recorder = self.recorder
        if not isinstance(recorder, Recorder) or not (at_once or recorder.due):
            return
        recorder.flush(self._content if isinstance(self.target, Path) else None)

    def _content(self) -> dict[str, Any]:
        asks = self.zoning is not None and self.zoning.manager.user is not None
        return {
            "program": program(),
            "asks": asks,
            "resolution": resolution_tree(self.resolution),
            "state": self.checkpoint(),
        }

    def _on(self, model: Model) -> None:
        """Go on with another line on the same nodes: in a plane, or in space."""
        self.model = model
        if self.zoning is not None:
            self.zoning.model = model
        self.watch.follow(model)
        self.stepper = self._new_stepper(self.stepper.floor)
        self.flat.carry(self.stepper)

    def advance(self, until: float) -> None:
        """To the time `until`: in one step if all is well, else in halves of halves; with a controller, towards it."""
        assert self.scene.time is not None
        begin, control = self.t, self.control
        dt = until - self.t
        smallest = dt * 0.5**HALVINGS if control is None else control.smallest
        repeats = wasted = rescues = 0
        while self.t < until:
            end = until if until - self.t <= dt * (1 + 1e-9) else self.t + dt
            ends = self.model.ends.at(end)
            if self.zoning is not None:
                self.zoning.prepare(end, end - self.t, self.state)
            taken = self.stepper.step(
                self.model.sea.at(end), ends, self.state, self.spare, end - self.t, self.scene.time.rho_inf,
                end - self.t if control is None else self.dt,
            )  # fmt: skip
            if self.zoning is not None and self._rescued(taken, end, rescues):
                rescues += 1
                wasted += taken.iterations
            elif taken.outcome == Outcome.OK and control is not None and not control.accepts(end - self.t, taken.error):
                wasted += taken.iterations
                repeats += 1
                dt = control.next
            elif taken.outcome == Outcome.OK:
                self._accept(taken, end, repeats, wasted)
                wasted = rescues = 0
                if control is not None:
                    break
            elif self.zoning is not None and 0.5 * dt < smallest and self._all_rod(taken):
                dt, wasted = until - self.t, wasted + taken.iterations
            elif taken.outcome == Outcome.SLACK or 0.5 * dt < smallest:
                # A slack catenary is no matter of the step: its answer would be grid noise at any dt.
                self._stop(taken, end - self.t)
            else:
                wasted += taken.iterations
                repeats += 1
                dt = 0.5 * dt if control is None else control.fails(end - self.t)
        if repeats and self.model.line.bits & SEABED:
            self._forget_blow(until - begin)

    def ends_of_steps(self, stop: float) -> Iterator[float]:
        """Where steps should end on the way to `stop`."""
        assert self.scene.time is not None
        if self.control is None:
            yield from step_ends(self.t, stop, self.resolution.step)
            return
        while self.t < stop:
            self.control.most = self._most
            yield self.control.until(self.t, stop)

    @property
    def _most(self) -> float:
        """The longest step, s, while bending is coming or going somewhere."""
        manager = self.zoning.manager if self.zoning is not None else None
        return LONGEST_IN_PACE * manager.pace if manager is not None and manager.blending else np.inf

    def _forget_blow(self, dt: float) -> None:
        """After shortened steps: a blow on the bed leaves accelerations that would undo all velocity in a step."""
        state = self.state
        hit = state.bed.any(axis=1) & (np.abs(state.a).max(axis=1) * dt > np.abs(state.v).max())
        state.a[hit], state.vd[hit] = 0.0, 0.0

    def save(self) -> None:
        """Write an output."""
        if self._stale:
            self.observer = self.observer.on(self.model.line, self.model.sea.values, self.model.zones)
            self._stale = False
        ends = self.model.ends.at(self.t)
        ratios = self.zoning.manager.told if self.zoning is not None else None
        shift = self.correction.shift(self.state) if self.correction is not None else None
        values = self.observer.values(ends, self.state, self.stepper.report, np.array(self.work), ratios, shift)
        self.recorder.save(self.t, values, self.observer.zone_rows)
        if self.target is None:  # a run to compare with is not looked at twice
            return
        self.watch.strain(self.t, self.state)
        self.watch.mesh(self.t, self.state)
        self.watch.rest(self.t, ends, values, self.state)
        if self.zoning is not None:
            manager = self.zoning.manager
            self.watch.torque(self.t, manager.torque * manager.compliance, manager.torque)
        self._look(self.watch.energy(self.t, values, np.array(self.work), self.state))

    def _look(self, found: Stop) -> None:
        """Stop where a watch says that going on has no sense."""
        if found is not None:
            self._stop(Taken(found[0], 0, 0.0, found[1], 0.0), 0.0)

    def restart(self) -> None:
        """A load has just stopped, or others act: accelerations jump, so find consistent ones."""
        self.model.ends.set_loads(self.t)
        self._ignite()
        if self.control is not None:
            self.control.restart()
        self.power = self._powers()

    def change(self, scene: Scene) -> None:
        """Other loads, and other motions of the ends, from now on; the cable stays what it is and where it is."""
        old, flat = self.model, self.flat
        model = build(scene, self.resolution, old.mesh)
        if self.zoning is not None:
            model = on_layout(model, self.zoning.manager.layout)
            self.zoning.settle_joints(self.state)
        model.line.h[:], model.line.kb[:] = old.line.h, old.line.kb  # what is on its way goes on
        model.ends.go_on_from(old.ends, self.t)
        self.scene, self.changes, self._stale = scene, self.changes + 1, True
        leaves = flat.push is not None and not _same_plane(old.plane, model.plane)
        if old.plane is not None and not leaves:
            model = replace(model, line=planar(model.line, old.plane), plane=old.plane)
        elif leaves:
            model = flat.rise(replace(model, plane=old.plane), self.state)
        else:
            model = replace(model, line=in_space(model.line), plane=None)
        if self.correction is not None:
            self.correction.switch(model)
        self._on(model)
        self.spare = self.state.copy()
        if self.zoning is not None:
            self.zoning.manager.moments = model.ends.moments
            self.zoning.manager.loaded = bool(model.ends.moments.any())
        text = (
            f"from t = {self.t:.6g} s on other loads act, or the ends move otherwise, as `hybrid resume` was asked to"
        )
        self.recorder.event(self.t, 0.0, model.length, "loads change", text)
        self.restart()

    def _accept(self, taken: Taken, end: float, repeats: int, wasted: int) -> None:
        dt = end - self.t
        self.state, self.spare = self.spare, self.state
        if self.correction is not None:
            self._correct(end, dt)
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
        self.recorder.log(
            {
                "t": end, "dt": dt, "iterations": taken.iterations + wasted, "correction": taken.correction,
                "residual": taken.residual, "repeats": repeats, "error": taken.error,
                "end_force_start": self._pull(0), "end_force_end": self._pull(1),
                "cpu": clock.process_time() - self.cpu,
            }
        )  # fmt: skip
        assert self.scene.time is not None
        if self.target is not None:
            self.watch.step(end, dt, self.scene.time.rho_inf, self.spare, self.state)
        self._look(self.watch.shape(end, self.stepper.told[BEND : TWIST_NODE + 1], self.state))
        leaves = self.flat.left(taken, self.stepper, lambda node, kind, text: self.watch.note(end, node, kind, text))
        if self.model.slack == "warn":
            self.watch.tension(end, self.state)
        if self.zoning is not None:
            booked, change = self.zoning.settle(end, dt, self.model.ends.values, self.spare, self.state)
            self.work[-1] += booked
            if change is not None:
                self._switch(change)
        if leaves:
            self._on(self.flat.rise(self.model, self.state))
            self.spare = self.state.copy()
            self.stepper.feel(self.model.sea.at(self.t), self.model.ends.at(self.t), self.state)
            self.power = self._powers()

    def _correct(self, end: float, dt: float) -> None:
        """Follow what leaving bending out makes of the step just taken; where it is beyond estimate, say so."""
        assert self.correction is not None and self.scene.time is not None
        before = dt if self.control is None else self.dt
        self.correction.step(self.stepper, self.model.ends.values, self.state, dt, before, self.scene.time.rho_inf)
        beyond = self.correction.beyond
        if beyond and end > self._beyond:  # once in a while that it takes the whole line to move
            s = float(self.model.line.s[max(self.correction.corrector.where, 0)])
            self.recorder.event(end, s, s, "model error not estimated", beyond)
            self._beyond = end + self.model.time_scale

    def _new_stepper(self, floor: float) -> Stepper:
        model = self.model
        return Stepper(model.line, model.length, model.tension_scale, floor, keep=self.correction is not None)

    def _rescued(self, taken: Taken, end: float, rescues: int) -> bool:
        """Whether a step was taken back and more of the line made rod: it failed, or a catenary went too far in it."""
        assert self.zoning is not None
        line = self.model.line
        if taken.outcome == Outcome.OK:
            cells = self.zoning.weigh(end, end - self.t, self.model.ends.values, self.spare)
            why = "a step would have left it a catenary far beyond its criterion; the step is repeated"
        elif taken.outcome == Outcome.SLACK:
            cells = np.flatnonzero((line.spin == 0) & (self.model.slack_floor >= self.spare.T))
            why = "a step would have left it a catenary without tension; the step is repeated"
        else:
            cells = self.zoning.manager.near_asking(min(max(taken.where, 0), self.model.cells - 1))
            why = f"a step failed here ({taken.outcome.cause}); it is repeated"
            rescues *= MOST_RESCUES  # once; after that, a smaller step
        if rescues >= MOST_RESCUES or not cells.size:
            return False
        return self._insist(cells, why)

    def _all_rod(self, taken: Taken) -> bool:
        """The last resort of a step that fails however small: rod wherever the scene lets it be; False if it is."""
        assert self.zoning is not None
        why = f"steps fail here, however small ({taken.outcome.cause}); repeated with rods everywhere"
        return self._insist(np.arange(self.model.cells), why)

    def _insist(self, cells: np.ndarray, why: str) -> bool:
        """Make cells rod, with all of their stiffness; False if they are."""
        assert self.zoning is not None
        change = self.zoning.manager.insist(cells, why)
        if (change.rod == self.zoning.manager.layout.rod).all() and not change.stiff.any():
            return False
        self._switch(change)
        return True

    def _switch(self, change: Change) -> None:
        """Zones change: nothing moves, and what changes energy is booked."""
        assert self.zoning is not None
        ends, sea = self.model.ends.at(self.t), self.model.sea.at(self.t)
        self.model, self.state, booked = self.zoning.switch(change, self.t, ends, self.state, sea)
        self.work[-1] += booked
        base = self.zoning.manager.layout.base
        for k, why in enumerate(change.reasons):
            energy = booked if k == 0 else 0.0  # of all that change now
            self.recorder.event(
                self.t, float(base[why.a]), float(base[why.b]), why.kind, why.text,
                criterion=why.criterion, value=why.value, threshold=why.threshold, energy=energy,
            )  # fmt: skip
        self.spare = self.state.copy()
        floor = self.stepper.floor
        self.stepper = self._new_stepper(floor)
        if self.correction is not None:
            self.correction.switch(self.model)
        self.flat.carry(self.stepper)
        self.watch.follow(self.model)
        self._stale = True
        self.stepper.feel(self.model.sea.at(self.t), self.model.ends.at(self.t), self.state)
        self._stored = self.stepper.told[SEABED_ENERGY]
        self.power = self._powers()

    def _bring_ends_in(self) -> None:
        """Tangents that the initial shape does not have are reached smoothly, and the result says so."""
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
            self.recorder.event(0.0, s, s, "end rotated in", text)

    def _pull(self, k: int) -> float:
        ends = self.model.ends.values
        if self._loaded[k]:
            return abs(float(self.state.T[-k]))
        x, y, z = self.stepper.told[FORCE_A + 3 * k : FORCE_A + 3 * k + 3] if ends.held[k] else ends.force[k].tolist()
        return sqrt(x * x + y * y + z * z)

    def _powers(self) -> list[float]:
        ends = self.model.ends
        return self.stepper.powers(ends.values, ends.velocity, self.state)

    def _ignite(self) -> None:
        assert self.scene.time is not None
        ends = self.model.ends
        acceleration = ends.acceleration(self.t, 1e-3 * self.resolution.step)
        self._stored = 0.0
        taken = self.stepper.ignite(self.model.sea.at(self.t), ends.at(self.t), acceleration, self.state)
        self.dt = 0.0
        if taken.outcome != Outcome.OK:
            self._stop(taken, 0.0)
        self._stored = self.stepper.told[SEABED_ENERGY]

    def _stop(self, taken: Taken, dt: float) -> None:
        """The computation cannot go on: leave the last good state on disk, and say where and why."""
        line = self.model.line
        where = min(max(taken.where, 0), line.s.size - 1)
        s = float(line.s[where])
        if taken.outcome == Outcome.SLACK:
            detail = f"the step that starts at this time ends with a tension of {self.spare.T[where]:.3g} N"
            if self.zoning is not None:
                detail += "; model.force_catenary keeps it from becoming a rod"
        elif taken.outcome == Outcome.GAINS_ENERGY:
            detail = "the fastest point is at this place"
        elif taken.outcome == Outcome.TWISTED_TOO_FAR:
            detail = f"{self.model.cells} cells"
        elif dt == 0.0:
            detail = "no accelerations are consistent with the shape and the loads"
        else:
            detail = f"smallest step tried {dt:.3g} s; {taken.iterations} Newton iterations in the last try"
        ends = self.model.ends.at(self.t + dt)
        apart = float(np.linalg.norm(ends.position[1] - ends.position[0]))
        if ends.held.all() and self.model.inextensible and apart >= self.model.length:
            longest = f"the cable does not stretch beyond {self.model.length:.6g} m"
            detail += f"; the ends are then {apart:.6g} m apart, and {longest}"
        error = ComputationError(taken.outcome, self.t, s, detail, self._snapshot(dt, taken))
        if self.t > self.recorder.last:
            self.save()
        self.recorder.event(self.t, s, s, taken.outcome.name.lower(), str(error))
        raise error

    def _snapshot(self, dt: float, taken: Taken) -> Path | None:
        """The last good state with all that a repetition of the failed step needs; None when it cannot be written."""
        if self.target is None:
            return None
        content: dict[str, Any] = {"t": self.t, "dt": dt, "outcome": taken.outcome.name, "s": self.model.line.s}
        content |= {"scene": scene_text(self.scene), **self.state._asdict()}
        return write_snapshot(self.target, content)


def _same_plane(a: Floats | None, b: Floats | None) -> bool:
    """Whether two planes (3, 3) have the same normal, of either sense."""
    return a is not None and b is not None and bool(abs(abs(float(a[2] @ b[2])) - 1.0) < 1e-12)
