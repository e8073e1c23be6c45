"""A cable that is stepped from outside: by a controller, a vessel, another program.

`Simulation` is the time loop of `hybrid.run`, advanced by the caller: the same steps, the same outputs, the same file.
"""

from __future__ import annotations

import io
import threading
from contextlib import ExitStack
from pathlib import Path
from time import monotonic
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.adapt.user_criterion import UserCriterion
from hybrid.errors import ComputationError, SceneError
from hybrid.kernels.state.state import Floats
from hybrid.model.build import Model
from hybrid.model.driven_end import DrivenEnd, contradictions
from hybrid.model.resolution import first_resolution
from hybrid.scene.motion_checks import check_motions
from hybrid.scene.read import SceneLike, as_scene_or_system
from hybrid.scene.schema import Scene, missing_time
from hybrid.scene.system import System
from hybrid.simulation.case import Case
from hybrid.simulation.deferred_recorder import DeferredRecorder
from hybrid.simulation.direct_steps import DirectSteps
from hybrid.simulation.failure import driven_of
from hybrid.simulation.first_use import compile_beside
from hybrid.simulation.layer_mesh import layered, survey_of
from hybrid.simulation.mesh_survey import with_survey
from hybrid.simulation.set_obstacles import ONE_STEP
from hybrid.simulation.static_case import StaticCase
from hybrid.simulation.stepped import (
    SLIVER,
    CableState,
    Saved,
    Triple,
    end_of_step,
    in_space,
    iterations_allowed,
    no_such_method,
    one_thread,
    tension_now,
)
from hybrid.simulation.stepped_ends import SteppedEnds
from hybrid.simulation.switch import as_network
from hybrid.simulation.system_stepping import SystemSimulation
from hybrid.simulation.transient import StepFailed
from hybrid.store.hdf5_file import check_target
from hybrid.store.lock import locked
from hybrid.store.named_arrays import pack, unpack
from hybrid.store.reader import Result, open_result
from hybrid.store.writer import Recorder

# s, of the wall: what waits is written down after so long, though there is room for more.
WRITE_EVERY = 60.0
NUMBER = (int, float, np.integer, np.floating)
# What only SystemSimulation has, and what does it here.
OF_SEVERAL = {"set_point": "set_end", "point": "state and forces", "line": "state"}


class Simulation(SteppedEnds):
    """A cable in motion that is stepped from outside; a context manager.

    Of several lines it is a `hybrid.SystemSimulation`, whose points are set in place of ends.
    scene: as of `hybrid.run`; its time table gives the step (without one, steps follow the motion) and the duration,
    beyond which nothing is computed.  output: the HDF5 file to write; None keeps the result in memory.  criterion: as
    of `hybrid.run`.  Constructing it finds the start that the scene asks for, a static equilibrium perhaps, and nothing
    else: no run to estimate an error is made.  A scene that says no `dimension` is computed in space, since an end may
    be set anywhere.  most_iterations: Newton iterations that a step may take, for real time: one that has not converged
    by then is taken as it is, with an event `iterations cut` and counted in `cut_short`; None: until it has.  One
    thread at a time: a method called while another thread is in one raises ValueError.

    Raises SceneError, ResultError and ComputationError as `hybrid.run` does.
    """

    def __new__(cls, scene: SceneLike | System, *args: Any, **more: Any) -> Any:
        read = as_scene_or_system(scene)
        if not isinstance(read, Scene) or as_network():
            return SystemSimulation(read, *args, **more)
        made = super().__new__(cls)
        made.scene = read
        return made

    def __init__(
        self, scene: SceneLike | System, output: str | Path | None = None, *, overwrite: bool = True,
        criterion: UserCriterion | None = None, most_iterations: int | None = None,
    ) -> None:  # fmt: skip
        self._most = iterations_allowed(most_iterations)
        found = in_space(self.scene)  # which was read to tell what is to be stepped
        self.scene = found.model_copy(update={"contact": found.contact.of_ends_that_are_set()})
        if self.scene.time is None:
            raise SceneError([missing_time(self.scene)])
        check_motions(self.scene)
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
            first = first_resolution(self.scene)
            if self.scene.resolution is None:
                resolution = layered(self._case, first)
            else:  # nobody knows the motion: layers are those of the equilibrium under full loads
                resolution = with_survey(first, self.scene, survey_of(StaticCase(self.scene), first)[0])
            self._loop, recorder, equilibrium = self._case.prepare(resolution, self._target)
        except BaseException:
            self._stack.close()
            raise
        assert isinstance(recorder, Recorder)
        time = self.scene.time
        self._fixed_step = None if time.controlled else time.step
        self._duration, self._sliver = time.duration, SLIVER * self._loop.run.resolution.step
        self._direct: DirectSteps | None = None
        self._loop.recorder = self._recorder = DeferredRecorder(recorder)
        self._driven: dict[int, DrivenEnd] = {}
        self._wound: tuple[float | None, float] | None = None  # length and rate that are set for the next step
        self._next: dict[int, tuple[Triple, Triple | None, Triple]] = {}  # what ends are set to, for the next step
        self._courses, self._moved = {}, {}
        self._loop.patient = self._plain
        self._loop.run.run.count.most_iterations = self._most
        self._loop.run.run.wait_longer()
        self._written = monotonic()
        try:
            self._loop.begin(equilibrium)
        except BaseException as error:
            self.__exit__(type(error), error, None)
            raise

    if not TYPE_CHECKING:  # mypy would take any name as known

        def __getattr__(self, name: str) -> Any:
            raise no_such_method(self, name, OF_SEVERAL)

    # --- stepping -------------------------------------------------------------------------------

    @property
    def cut_short(self) -> int:
        """Steps so far that were taken after `most_iterations` though these had not converged."""
        return int(self._loop.run.run.count.cut_short)

    def step(self) -> float:
        """One step of the scene's length, and the time after it (s).

        ValueError: steps follow the motion (`advance` says where to), or the duration is over.
        """
        return self.advance(end_of_step(self._loop.run.t, self._fixed_step, self._duration))

    @one_thread
    def advance(self, until: float) -> float:
        """Steps to a time `until` (s), where one ends; returns it.  Ends that are set reach their place there.

        ValueError: a time that has passed, or beyond the scene's duration; a step has failed and nothing was restored.
        """
        self._check_open()
        self._check_sound()
        if isinstance(until, bool) or not isinstance(until, NUMBER):
            raise ValueError(f"until: expected a number, in s, found {until!r:.60}")
        moving, duration, sliver = self._loop.run, self._duration, self._sliver
        now = moving.t
        if not now + sliver < until <= duration + sliver:
            raise ValueError(
                f"until = {until:.9g} s, expected a time after {now:.9g} s, up to time.duration, {duration:g} s"
            )
        if moving.payout is not None:
            moving.payout.go_on(now, until, self._wound)
            self._wound = None
        one_step = until - now <= ONE_STEP * (self._fixed_step or float(moving.run.clock.last_dt))
        for k, end in self._driven.items():
            if (course := self._next.pop(k, None)) is None:
                end.stay(now, until, one_step)
            else:
                end.set(now, until, *course, one_step)
        if self._moved:
            self._move_obstacles(now, until, one_step)
        self._recorder.commit_old()
        try:
            self._step_to(min(until, duration))
        except ComputationError as error:
            self._failed = str(error)
            raise
        if text := contradictions(driven_of(moving.model)):
            self._recorder.event(0.0, 0.0, float(moving.model.line.s[-1]), "implausible", text)
        self._forget_released()
        if monotonic() - self._written > WRITE_EVERY:
            self._loop.write_down(everything=True)
            self._written = monotonic()
        return moving.t

    def _step_to(self, until: float) -> None:
        try:
            if self._direct is None or not self._direct.still_of(self._loop):
                self._direct = DirectSteps(self._loop)
            self._direct.take(until)
        except StepFailed as failed:
            self._loop.fail(failed.tried, failed.dt)

    @property
    @one_thread
    def state(self) -> CableState:
        """Where the cable is now."""
        run = self._loop.run
        x = run.state
        return CableState(run.t, run.model.line.s.copy(), x.r.copy(), x.v.copy(), x.T.copy(), run.model.zones)

    @one_thread
    def tension(self) -> Floats:
        """Tension (ns,) N now at the points of the result, recovered between cells and at the ends as written there.

        `state.tension` is that of the cells, and costs less.  ValueError: a step has failed.
        """
        self._check_open()
        self._check_sound()
        return tension_now(self._loop)

    # --- back and forth ---------------------------------------------------------------------------

    @one_thread
    def save(self) -> Any:
        """The state as it is, in memory, to come back to: for the iterations of an implicit coupling.

        What has been computed until now is final; what follows is recorded when the next `save` is made.
        ValueError: a step has failed; what was saved before it stays good.
        """
        self._check_open()
        self._check_sound()
        if not self._plain or self._loop.run.run.waits_much:
            self._loop.write_down(everything=True)
        self._recorder.commit()
        run, watch = self._loop.run, self._loop.remembered()
        state = run.run.keep() if self._plain else pack(self._loop.checkpoint())
        paths = {k: end.keep() for k, end in self._driven.items()}
        loads, ends = run.model.ends.keep_loads(), run.model.ends.values
        self._saves += 1
        return Saved(
            self._recorder.mark(), self.t, state, watch, paths, (ends.position.copy(), ends.frame.copy()), loads,
            run.model, self._owner, self._saves, self.cut_short, self._kept_courses(),
        )  # fmt: skip

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
            self._loop.run.run.count.most_iterations = self._most
        else:
            run = self._loop.run
            if run.model is not saved.model:  # an end has been released since
                run.set_model(saved.model, run.state.copy())
            run.run.bring_back(saved.state)
            ends = saved.model.ends.motions
            self._driven = {k: end for k, end in ends.items() if isinstance(end, DrivenEnd)}
            for k, end in self._driven.items():
                if k in saved.paths:
                    end.bring_back(saved.paths[k])
                else:  # it has been set since, for the first time
                    end.stand(saved.places[0][k], saved.places[1][k])
            run.model.ends.bring_back_loads(saved.loads, saved.t)
            run.run.move(run.model.ends.moves())
        self._bring_back_courses(saved.obstacles)
        self._loop.remember(saved.watch)
        self._loop.run.run.count.cut_short = saved.cut_short
        self._next.clear()
        self._wound = None
        self._failed = ""

    def _drive_again(self, model: Model, saved: Saved) -> None:
        self._driven = {k: model.ends.drive(k) for k in saved.paths}
        for k, path in saved.paths.items():
            self._driven[k].bring_back(path)
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
