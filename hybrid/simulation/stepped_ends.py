"""What a program outside sets of the ends of one cable, and what it reads there: the part of `hybrid.Simulation`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from hybrid.kernels.state.report import FORCE_A, FORCE_B, MOMENT_A, MOMENT_B
from hybrid.kernels.state.state import Floats, State
from hybrid.model.build import Model
from hybrid.model.driven_end import STILL, DrivenEnd, rotation_vector
from hybrid.model.sea import Surroundings
from hybrid.scene.schema import Scene
from hybrid.simulation.deferred_recorder import DeferredRecorder
from hybrid.simulation.interface_stiffness import interface_stiffness, step_taken
from hybrid.simulation.payout import length_asked
from hybrid.simulation.set_obstacles import SettableObstacles
from hybrid.simulation.stepped import EndForces, Triple, numbers, one_thread, triple, vector
from hybrid.simulation.time_loop import TimeLoop
from hybrid.simulation.transient import StepFailed

ENDS = ("start", "end")
# Of the largest component: what is out of a plane by no more is in it.
IN_PLANE = 1e-9
# Rows of three numbers that the report of a step begins with: the forces and the moments at both ends.
OF_ENDS = 4
assert (FORCE_A, FORCE_B, MOMENT_A, MOMENT_B) == (0, 3, 6, 9)


class SteppedEnds(SettableObstacles):
    """The ends of a cable that is stepped from outside."""

    scene: Scene
    lock: Any
    _loop: TimeLoop
    _recorder: DeferredRecorder
    _closed: bool
    _driven: dict[int, DrivenEnd]
    _next: dict[int, tuple[Triple, Triple | None, Triple]]  # what ends are set to, for the next step
    _failed: str  # why the last step failed; empty: it did not, or what `save` returned was restored
    _wound: tuple[float | None, float] | None  # length and rate that are set for the next step
    _driven_of: Model | None = None  # whose ends those that are set were last looked for among
    _signed: Model | None = None  # of which the next are
    _signs: Floats  # (4, 3) what of the report of a step is a force or a moment on what holds an end, with its sign
    _report: Floats | None = None  # of the last step, of which the next are
    _reported: Floats  # (4, 3) forces and moments at both ends in it

    @property
    def t(self) -> float:
        """Time of the state, s."""
        return self._loop.run.t

    def _states(self) -> list[tuple[Surroundings, State]]:
        return [(self._loop.run.model.sea, self._loop.run.state)]

    def _check_open(self) -> None:
        if self._closed:
            raise ValueError("the simulation is over: its result has been written")

    def _check_sound(self) -> None:
        """Of what belongs to the last step: after one that failed there is none until `restore`."""
        if self._failed:
            reason = self._failed.splitlines()[0]
            raise ValueError(f"a step has failed ({reason}): restore() what save() returned, or close()")

    @one_thread
    def set_end(
        self, end: str, position: Sequence[float] | Floats | None, velocity: Sequence[float] | Floats | None = None,
        frame: Floats | None = None,
    ) -> None:  # fmt: skip
        """Where a held end is to be at the end of the next `step` or `advance`, which it reaches smoothly.

        end: "start" or "end"; position: (3,) m, inertial, None: where it is (of a guided end, which only turns);
        velocity: (3,) m/s there, None: in a step of the run that which the places imply, in what takes several at rest;
        one that contradicts the places is told as an event *implausible*.  frame: (3, 3), columns a1, a2 and the
        tangent along increasing s, of an end that holds a direction.  An end that is not set again stays where it is.
        ValueError: the end is free, has a motion in the scene, holds no direction, or would leave the plane of
        `dimension: 2`.
        """
        self._check_open()
        k = self._end(end)
        conditions = self._loop.run.model.ends
        if not conditions.values.held[k] and (position is not None or not self._turns(k)):
            raise ValueError(f"ends.{end} is not held: set_force acts on it")
        if frame is not None and not self._turns(k):
            raise ValueError(f"ends.{end} holds no direction: it has no frame")
        if k not in self._driven:
            if k in conditions.motions:
                raise ValueError(f"ends.{end} has a motion in the scene: leave it out to set the end from outside")
            self._driven[k] = conditions.drive(k)
            self._loop.run.run.move(conditions.moves())
        there = triple(self._driven[k].at(self.t)[0] if position is None else position, "position")
        speed, turn = None if velocity is None else triple(velocity, "velocity"), STILL
        if self.scene.dimension == 2:
            self._check_plane(end, "position", np.array(there) - self._driven[k].at(self.t)[0])
        if frame is not None:
            now = self._driven[k].at(self.t)[2]
            wanted = numbers(frame, "frame")
            proper = wanted.shape == (3, 3) and np.allclose(wanted.T @ wanted, np.eye(3), atol=1e-6)
            if not (proper and np.linalg.det(wanted) > 0.0):
                raise ValueError("frame: expected a rotation matrix (3, 3), right-handed")
            turn = triple(rotation_vector(now.T @ wanted), "frame")
        self._next[k] = there, speed, turn

    @property
    def length(self) -> float:
        """Unstretched length that is out now, m."""
        return float(np.ptp(self._loop.run.model.line.s))

    @one_thread
    def set_length(self, length: float, rate: float = 0.0) -> None:
        """How long the line is to be at the end of the next `step` or `advance`, m, and its rate there, m/s.

        It reaches that smoothly, and keeps the rate until it is set again.  ValueError: the scene has no
        ``payout``, or that gives the length itself; a length that cannot be.
        """
        self._check_open()
        self._wound = length_asked(self.scene, self._loop.run.payout, math.nan if length is None else length, rate)

    @one_thread
    def set_payout(self, rate: float) -> None:
        """At which rate, m/s, line is to be paid out at the end of the next `step` or `advance`; negative: taken in.

        The rate changes evenly until then, and stays until it is set again.  ValueError: as of `set_length`.
        """
        self._check_open()
        self._wound = length_asked(self.scene, self._loop.run.payout, None, rate)

    @one_thread
    def set_force(
        self, end: str, force: Sequence[float] | Floats, moment: Sequence[float] | Floats | None = None
    ) -> None:
        """From the next step on this force (3,) N, and moment (3,) N m, act on an end that is free to move."""
        k, conditions = self._end(end), self._loop.run.model.ends
        self._check_open()
        if conditions.values.held[k]:
            raise ValueError(f"ends.{end} is held: set_end moves it")
        if moment is not None and not self._loop.run.model.line.spin[-k]:
            raise ValueError(f"moment: the cable is a catenary at ends.{end}, which takes no moment")
        wanted, turning = vector(force, "force"), vector(STILL if moment is None else moment, "moment")
        self._check_plane(end, "force", wanted)
        conditions.load("force", k, wanted, self.t)
        if moment is not None:
            conditions.load("moment", k, turning, self.t)
        self._loop.run.run.move(conditions.moves())

    @one_thread
    def release(self, end: str) -> None:
        """Let a held end go now: it is free from here on, and `set_force` acts on it.

        end: "start" or "end".  ValueError: it is not held.
        """
        self._check_open()
        k, model = self._end(end), self._loop.run.model
        if not model.ends.values.held[k]:
            raise ValueError(f"ends.{end} is not held: there is nothing to release")
        self._recorder.commit_old()
        try:
            self._loop.release(k, "by Simulation.release")
        except StepFailed as failed:
            self._loop.fail(failed.tried, failed.dt)
        self._forget_released()

    def _forget_released(self) -> None:
        """Ends that are free now are no longer set."""
        model = self._loop.run.model
        if model is self._driven_of:
            return
        self._driven_of, held = model, model.ends.values.held
        for k in [k for k, end in self._driven.items() if end.held and not held[k]]:
            self._driven.pop(k)
            self._next.pop(k, None)

    def settable(self, end: str) -> frozenset[str]:
        """What may be set of an end: "position" and "frame" by `set_end`, "force" and "moment" by `set_force`.

        An end that moves by a motion of the scene has neither.
        """
        k, conditions = self._end(end), self._loop.run.model.ends
        if k in conditions.motions and k not in self._driven:
            return frozenset()
        names = {"position" if conditions.values.held[k] else "force"}
        if self._turns(k):
            names.add("frame")
        elif "force" in names and self._loop.run.model.line.spin[-k]:
            names.add("moment")
        return frozenset(names)

    def frames(self) -> Floats:
        """Frames (2, 3, 3) of the ends, inertial: columns a1, a2 and the tangent along increasing s; NaN where an end
        holds no direction."""
        frames = self._loop.run.model.ends.values.frame.reshape(2, 3, 3).copy()
        frames[[k for k in (0, 1) if not self._turns(k)]] = np.nan
        return frames

    @one_thread
    def forces(self) -> EndForces:
        """Forces and moments of the cable on what holds its ends, now.  ValueError: a step has failed."""
        if self._failed:
            self._check_sound()
        moving = self._loop.run
        if moving.model is not self._signed:
            self._signed, held = moving.model, moving.model.ends.values.held
            parts = held[0], held[1], self._turns(0), -1.0 * self._turns(1)
            self._signs = np.repeat(np.array(parts, float), 3).reshape(OF_ENDS, 3)
        report = moving.run.books.report
        if report is not self._report:
            self._report, self._reported = report, report[0, : 3 * OF_ENDS].reshape(OF_ENDS, 3)
        return EndForces(*(self._reported * self._signs))

    @one_thread
    def stiffness(self, end: str) -> Floats:
        """Interface stiffness (3, 3) N/m, inertial: the force it takes to shift a held end at the end of the last step.

        By minus that, times a shift of the place that was set, `forces` changes where the step is taken again: Newton's
        method of an implicit coupling.  It has the inertia and the damping of the step in it (of its last part, where
        it was cut), and is not the static stiffness; directions that the end holds stay.  Before the first step: as of
        a step of time.step.  ValueError: the end is not held, a step has failed, or a sheave turns freely.
        """
        self._check_open()
        self._check_sound()
        k, run = self._end(end), self._loop.run
        if run.state.sheave.size:
            raise ValueError("the stiffness of a line over a sheave that turns freely is not worked out")
        if not run.model.ends.values.held[k]:
            raise ValueError(f"ends.{end} is not held: it has no stiffness that is felt from outside")
        taken = step_taken(run.run.clock, float(run.run.clock.last_dt), run.resolution.step, run.controlled)
        return interface_stiffness(run.model, k, (run.before, run.state), taken, run.t)

    def _turns(self, k: int) -> bool:
        """Whether end k holds the direction of a rod."""
        return bool(self._loop.run.model.line.element[-k])

    def _check_plane(self, end: str, what: str, vector: Floats) -> None:
        plane = self._loop.run.model.plane
        if self.scene.dimension == 2 and plane is not None:
            across = float(vector @ plane[2])
            if abs(across) > IN_PLANE * float(np.abs(vector).max(initial=1.0)):
                out = "out of the plane that dimension: 2 keeps the cable in"
                raise ValueError(f"{what} of ends.{end}: {across:.3g} {out}; leave dimension out of the scene")

    def _end(self, end: str) -> int:
        if end not in ENDS:
            raise ValueError(f"end: expected 'start' or 'end', found {end!r}")
        return ENDS.index(end)
