"""A cable that is stepped from outside: by a controller, a vessel, another program.

`Simulation` is the time loop of `hybrid.run`, advanced by the caller: the same steps, the same outputs, the same file.
"""

from __future__ import annotations

import io
import math
import threading
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from hybrid.adapt.user_criterion import UserCriterion
from hybrid.errors import Complaint, ComputationError, SceneError
from hybrid.kernels.report import FORCE_A, FORCE_B, MOMENT_A, MOMENT_B
from hybrid.kernels.state import Floats
from hybrid.model.build import Model
from hybrid.model.driven_end import DrivenEnd, rotation_vector
from hybrid.model.resolution import first_resolution
from hybrid.scene.motion_checks import check_motions
from hybrid.scene.read import SceneLike, as_scene
from hybrid.scene.schema import missing_time
from hybrid.simulation.case import Case
from hybrid.simulation.deferred_recorder import DeferredRecorder
from hybrid.simulation.first_use import compile_beside
from hybrid.simulation.payout import length_asked
from hybrid.simulation.stepped import CableState, EndForces, Saved, in_space, numbers, one_thread, vector
from hybrid.simulation.transient import StepFailed
from hybrid.store.hdf5_file import check_target
from hybrid.store.lock import locked
from hybrid.store.named_arrays import pack, unpack
from hybrid.store.reader import Result, open_result

ENDS = ("start", "end")
# Of a step: a step so short is round-off of the times of others.
SLIVER = 1e-6
# Of the largest component: what is out of a plane by no more is in it.
IN_PLANE = 1e-9
STILL: Floats = np.zeros(3)
NUMBER = (int, float, np.integer, np.floating)


class Simulation:
    """A cable in motion that is stepped from outside; a context manager.

    scene: as of `hybrid.run`; its time table gives the step (without one, steps follow the motion) and the duration,
    beyond which nothing is computed.  output: the HDF5 file to write; None keeps the result in memory.  criterion: as
    of `hybrid.run`.  Constructing it finds the start that the scene asks for, a static equilibrium perhaps, and nothing
    else: no run to estimate an error is made.  A scene that says no `dimension` is computed in space, since an end may
    be set anywhere.  One thread at a time: a method called while another thread is in one raises ValueError.

    Raises SceneError, ResultError and ComputationError as `hybrid.run` does.
    """

    def __init__(
        self, scene: SceneLike, output: str | Path | None = None, *, overwrite: bool = True,
        criterion: UserCriterion | None = None,
    ) -> None:  # fmt: skip
        self.scene = in_space(as_scene(scene))
        if self.scene.time is None:
            raise SceneError([missing_time(self.scene)])
        check_motions(self.scene)
        if self.scene.resolution is not None:
            expected = "nothing, because a cable that is stepped from outside has no coarse run that shows its layers"
            given = f"{self.scene.resolution.cells_per_layer:g}"
            raise SceneError([Complaint("resolution.cells_per_layer", given, expected, "place cells by `mesh`")])
        self._target: Path | io.BytesIO = io.BytesIO()
        if output is not None:
            self._target = Path(output).expanduser().resolve()
            check_target(self._target, overwrite)
        self.lock = threading.RLock()
        self._closed, self._failed, self._stack, self._owner = False, "", ExitStack(), object()
        self._saves = 0  # how often `save` was called
        if isinstance(self._target, Path):
            self._stack.enter_context(locked(self._target))
        compile_beside(self.scene)
        self._case = Case(self.scene, criterion)
        try:
            self._loop, recorder, equilibrium = self._case.prepare(first_resolution(self.scene), self._target)
        except BaseException:
            self._stack.close()
            raise
        self._loop.recorder = self._recorder = DeferredRecorder(recorder)
        self._driven: dict[int, DrivenEnd] = {}
        self._wound: tuple[float | None, float] | None = None  # length and rate that are set for the next step
        self._next: dict[int, tuple[Floats, Floats, Floats | None]] = {}  # what ends are set to, for the next step
        self._loop.patient = self._plain
        try:
            self._loop.begin(equilibrium)
        except BaseException as error:
            self.__exit__(type(error), error, None)
            raise

    # --- stepping -------------------------------------------------------------------------------

    @property
    def t(self) -> float:
        """Time of the state, s."""
        return self._loop.run.t

    def step(self) -> float:
        """One step of the scene's length, and the time after it (s).

        ValueError: steps follow the motion (`advance` says where to), or the duration is over.
        """
        time = self.scene.require_time()
        if time.controlled or time.step is None:
            raise ValueError("steps follow the motion: use advance(until), or give time.step")
        now, step, duration = self.t, time.step, time.duration
        taken, until = round(now / step), now + step
        if abs(taken * step - now) < SLIVER * step:
            until = (taken + 1) * step  # a multiple of the step, without round-off that adds up
        return self.advance(until if duration - until > SLIVER * step else duration)

    @one_thread
    def advance(self, until: float) -> float:
        """Steps to a time `until` (s), where one ends; returns it.  Ends that are set reach their place there.

        ValueError: a time that has passed, or beyond the scene's duration; a step has failed and nothing was restored.
        """
        self._check_open()
        if self._failed:
            reason = self._failed.splitlines()[0]
            raise ValueError(f"a step has failed ({reason}): restore() what save() returned, or close()")
        if isinstance(until, bool) or not isinstance(until, NUMBER):
            raise ValueError(f"until: expected a number, in s, found {until!r:.60}")
        now, duration = self.t, self.scene.require_time().duration
        sliver = SLIVER * self._loop.run.resolution.step
        if not now + sliver < until <= duration + sliver:
            raise ValueError(
                f"until = {until:.9g} s, expected a time after {now:.9g} s, up to time.duration, {duration:g} s"
            )
        if self._loop.run.payout is not None:
            self._loop.run.payout.go_on(now, until, self._wound)
            self._wound = None
        for k, end in self._driven.items():
            wanted = self._next.pop(k, None)
            position, velocity, turn = wanted or (end.at(now)[0], STILL, None)
            end.set(now, until, position, velocity, STILL if turn is None else turn)
        self._recorder.commit_old()
        try:
            self._step_to(min(until, duration))
        except ComputationError as error:
            self._failed = str(error)
            raise
        self._forget_released()
        return self.t

    def _step_to(self, until: float) -> None:
        try:
            self._loop.until(until, exact=False)
        except StepFailed as failed:
            self._loop.fail(failed.tried, failed.dt)

    def _check_open(self) -> None:
        if self._closed:
            raise ValueError("the simulation is over: its result has been written")

    # --- what is set and felt --------------------------------------------------------------------

    @one_thread
    def set_end(
        self, end: str, position: Sequence[float] | Floats | None, velocity: Sequence[float] | Floats | None = None,
        frame: Floats | None = None,
    ) -> None:  # fmt: skip
        """Where a held end is to be at the end of the next `step` or `advance`, which it reaches smoothly.

        end: "start" or "end"; position: (3,) m, inertial, None: where it is (of a guided end, which only turns);
        velocity: (3,) m/s there, None: at rest; frame: (3, 3), columns a1, a2 and the tangent along increasing s, of an
        end that holds a direction.  An end that is not set again stays where it is.  ValueError: the end is free, has a
        motion in the scene, holds no direction, or would leave the plane of `dimension: 2`.
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
        there = self._driven[k].at(self.t)[0] if position is None else vector(position, "position")
        speed, turn = vector(STILL if velocity is None else velocity, "velocity"), None
        if self.scene.dimension == 2:
            self._check_plane(end, "position", there - self._driven[k].at(self.t)[0])
        if frame is not None:
            now = self._driven[k].at(self.t)[2]
            wanted = numbers(frame, "frame")
            proper = wanted.shape == (3, 3) and np.allclose(wanted.T @ wanted, np.eye(3), atol=1e-6)
            if not (proper and np.linalg.det(wanted) > 0.0):
                raise ValueError("frame: expected a rotation matrix (3, 3), right-handed")
            turn = rotation_vector(now.T @ wanted)
        self._next[k] = there, speed, turn

    @property
    def length(self) -> float:
        """Unstretched length that is out now, m."""
        return float(self._loop.run.model.line.s[-1])

    @one_thread
    def set_length(self, length: float, rate: float = 0.0) -> None:
        """How long the line is to be at the end of the next `step` or `advance`, m, and its rate there, m/s.

        It reaches that smoothly, and keeps the rate until it is set again.  ValueError: the scene has no
        ``ends.end.payout``, or that gives the length itself; a length that cannot be.
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

        end: "start" or "end".  ValueError: it is not held, or a torque passes through it into catenary zones.
        """
        self._check_open()
        k, model = self._end(end), self._loop.run.model
        if not model.ends.values.held[k]:
            raise ValueError(f"ends.{end} is not held: there is nothing to release")
        if len(model.line.torsion):
            raise ValueError(f"ends.{end} is the end of a twisted catenary: give it swivel: true in the scene")
        self._recorder.commit_old()
        try:
            self._loop.release(k, "by Simulation.release")
        except StepFailed as failed:
            self._loop.fail(failed.tried, failed.dt)
        self._forget_released()

    def _forget_released(self) -> None:
        """Ends that are free now are no longer set."""
        held = self._loop.run.model.ends.values.held
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
        """Forces and moments of the cable on what holds its ends, now."""
        report, held = self._loop.run.run.report, self._loop.run.model.ends.values.held
        start, end = (report[k : k + 3] * held[j] for j, k in enumerate((FORCE_A, FORCE_B)))
        first, last = report[MOMENT_A : MOMENT_A + 3], report[MOMENT_B : MOMENT_B + 3]
        return EndForces(start, end, first * self._turns(0), -last * self._turns(1))

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

    @property
    @one_thread
    def state(self) -> CableState:
        """Where the cable is now."""
        run = self._loop.run
        x = run.state
        return CableState(run.t, run.model.line.s.copy(), x.r.copy(), x.v.copy(), x.T.copy(), run.model.zones)

    # --- back and forth ---------------------------------------------------------------------------

    @one_thread
    def save(self) -> Any:
        """The state as it is, in memory, to come back to: for the iterations of an implicit coupling.

        What has been computed until now is final; what follows is recorded when the next `save` is made.
        """
        self._check_open()
        if not self._plain:
            self._loop.write_down(everything=True)
        self._recorder.commit()
        run, watch = self._loop.run, self._loop.remembered()
        state = run.run.keep() if self._plain else pack(self._loop.checkpoint())
        paths = {k: end.path.copy() for k, end in self._driven.items()}
        loads = run.model.ends.keep_loads()
        self._saves += 1
        return Saved(self._recorder.mark(), self.t, state, watch, paths, loads, run.model, self._owner, self._saves)

    @one_thread
    def restore(self, saved: Any) -> None:
        """Back to what `save` returned.

        ValueError: a later `save` has made final what came after it, or another Simulation has returned it.
        """
        self._check_open()
        if not isinstance(saved, Saved) or saved.owner is not self._owner:
            raise ValueError("restore: expected what save() of this Simulation has returned")
        if saved.number < self._saves:
            raise ValueError("a later save() has made final what came after this one")
        self._recorder.back_to(saved.mark)
        if isinstance(saved.state, bytes):
            self._loop = self._case.again(
                unpack(saved.state), self._loop, self._target, lambda model: self._drive_again(model, saved)
            )
            self._loop.recorder = self._recorder
        else:
            run = self._loop.run
            if run.model is not saved.model:  # an end has been released since
                run.set_model(saved.model, run.state.copy())
            run.run.bring_back(saved.state)
            ends = saved.model.ends.motions
            self._driven = {k: end for k, end in ends.items() if isinstance(end, DrivenEnd)}
            for k, path in saved.paths.items():
                self._driven[k].path[:] = path
            run.model.ends.bring_back_loads(saved.loads, saved.t)
            run.run.move(run.model.ends.moves())
        self._loop.remember(saved.watch)
        self._next.clear()
        self._wound = None
        self._failed = ""

    def _drive_again(self, model: Model, saved: Saved) -> None:
        self._driven = {k: model.ends.drive(k) for k in saved.paths}
        for k, path in saved.paths.items():
            self._driven[k].path[:] = path
        model.ends.bring_back_loads(saved.loads, saved.t)

    @property
    def _plain(self) -> bool:
        """Whether nothing but the compiled run changes in a step."""
        run = self._loop.run
        return run.switching is None and run.correction is None and run.payout is None

    # --- the end ----------------------------------------------------------------------------------

    def result(self) -> Result:
        """What has been recorded until now; the simulation is over."""
        self.close()
        return open_result(self._target)

    @one_thread
    def close(self) -> None:
        """Write what is left and close the file; a second call does nothing."""
        if self._closed:
            return
        self._closed = True
        with self._stack:
            self._loop.write_down(everything=True)
            self._loop.finish()
            self._recorder.commit()
            until = f"{self._loop.run.steps} steps, stepped from outside to t = {self.t:.6g} s"
            self._recorder.close("failed" if self._failed else "complete", self._failed or until)

    def __enter__(self) -> Simulation:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        if kind is None:
            self.close()
        elif not self._closed:
            self._closed = True
            with self._stack:
                self._loop.write_down(everything=True)
                self._recorder.commit()
                self._loop.write_envelope()
                self._recorder.close("failed" if issubclass(kind, Exception) else "interrupted", str(error))

    def _end(self, end: str) -> int:
        if end not in ENDS:
            raise ValueError(f"end: expected 'start' or 'end', found {end!r}")
        return ENDS.index(end)
