"""Several lines that are stepped from outside: points are set, their forces read, step by step."""

from __future__ import annotations

import io
import math
import threading
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hybrid.adapt.user_criterion import UserCriterion
from hybrid.errors import ComputationError, Outcome, SceneError
from hybrid.kernels.state.report import FORCE_A
from hybrid.kernels.state.state import Floats, State
from hybrid.model.driven_end import FRAME, STILL, TURN, DrivenEnd, contradictions
from hybrid.model.sea import Surroundings
from hybrid.model.system import SystemResolution
from hybrid.scene.points import FixedPoint
from hybrid.scene.read import SceneLike, as_scene_or_system, scene_text
from hybrid.scene.schema import missing_time
from hybrid.scene.system import System
from hybrid.simulation.layer_mesh import layered_lines
from hybrid.simulation.mesh_survey import POINTS, Survey, survey_resolution, with_survey
from hybrid.simulation.set_obstacles import ONE_STEP, SettableObstacles
from hybrid.simulation.stepped import (
    SLIVER,
    CableState,
    Triple,
    end_of_step,
    iterations_allowed,
    no_such_method,
    one_thread,
    triple,
)
from hybrid.simulation.system_run import SystemRun, static_system
from hybrid.simulation.system_saving import SavedSystem, bring_back, commit, defer, kept, recorders
from hybrid.simulation.system_start import named
from hybrid.solve.system_statics import LineFailed
from hybrid.store.array_recorder import MemoryTarget
from hybrid.store.hdf5_file import check_target
from hybrid.store.lock import locked
from hybrid.store.reader import Result, open_result, written_result

# What only Simulation of one cable has, and what does it here.
OF_ONE_CABLE = {
    "state": "line(name)",
    "set_end": "set_point(name, position, velocity) of a fixed point",
    "set_force": "a force over time of the point or body in the scene",
    "release": "break_at of the line or the point in the scene",
    "length": "the result, or set_length(name, length)",
}


def layers_at_rest(system: System) -> SystemResolution:
    """Cells by the equilibrium of the start; where a line says how many cells a layer has, by that of full loads."""
    asked = [name for name, line in system.lines.items() if line.resolution is not None]
    first = layered_lines(system, SystemResolution.first(system), True)
    if not asked:
        return first
    memory = MemoryTarget()
    coarse = SystemResolution({name: replace(survey_resolution(x), every=1) for name, x in first.lines.items()})
    output = system.output.model_copy(update={"points": POINTS, "quantities": {}})
    shown = system.model_copy(update={"output": output})
    run = static_system(shown, memory, partial(scene_text, shown), coarse)
    found, lines = written_result(memory), dict(first.lines)
    for name in asked:
        line, scene, model = found.lines[name], system.scene_of(name), run.model.models[run.model.names.index(name)]
        outputs = {key: line[key] for key in ("position", "curvature", "tension")}
        lines[name] = with_survey(lines[name], scene, Survey.of(scene, lines[name], model, line.s, outputs))
    return SystemResolution(lines)


class PointState(NamedTuple):
    """Where a point is (3,) m, how fast (3,) m/s, and the force (3,) N of its lines on it; inertial."""

    position: Floats
    velocity: Floats
    force: Floats


class SystemSimulation(SettableObstacles):
    """Several lines in motion that are stepped from outside; a context manager.

    scene: several lines, as of `hybrid.run`; its time table gives the longest step and the duration, beyond which
    nothing is computed.  output: the HDF5 file to write; None keeps the result in memory.  Constructing it finds the
    equilibrium that the motion starts from.  criterion: as of `hybrid.run`; most_iterations: as of `Simulation`.  One
    thread at a time.  Raises SceneError, ResultError and ComputationError as `hybrid.run` does.
    """

    def __init__(
        self, scene: SceneLike | System, output: str | Path | None = None, *, overwrite: bool = True,
        criterion: UserCriterion | None = None, most_iterations: int | None = None,
    ) -> None:  # fmt: skip
        found = as_scene_or_system(scene)
        if not isinstance(found, System):
            raise TypeError("scene: expected several lines; hybrid.Simulation steps one cable")
        most = iterations_allowed(most_iterations)
        if found.time is None:
            raise SceneError([missing_time(found)])
        lines = {
            name: line.model_copy(update={"contact": line.contact.of_ends_that_are_set()})
            for name, line in found.lines.items()
        }
        found = found.model_copy(update={"lines": lines})
        self.scene, self.lock, self._stack = found, threading.RLock(), ExitStack()
        self._target: Path | io.BytesIO = io.BytesIO()
        if output is not None:
            self._target = Path(output).expanduser().resolve()
            check_target(self._target, overwrite)
            self._stack.enter_context(locked(self._target))
        self._closed = False
        try:
            cells = layers_at_rest(found)
            self._run = SystemRun(found, self._target, scene_text(found), True, cells, criterion=criterion)
            self._run.loop.counts.most_iterations = most
            self._run.begin_motion()
        except LineFailed as failed:
            raise self._fail(failed) from None
        except BaseException:
            self._stack.close()
            raise
        self._stops = self._run.stops()
        self._driven: dict[str, list[DrivenEnd]] = {}
        self._next: dict[str, tuple[Triple, Triple | None]] = {}
        self._wound: dict[int, tuple[float | None, float]] = {}  # length and rate that are asked of lines
        self._courses, self._moved = {}, {}
        self._owner, self._final = object(), 0  # how often what had been recorded was made final
        self._here: SavedSystem | None = None  # what was saved of the state as it is now

    if not TYPE_CHECKING:  # mypy would take any name as known

        def __getattr__(self, name: str) -> Any:
            raise no_such_method(self, name, OF_ONE_CABLE)

    @property
    def t(self) -> float:
        """Time of the state, s."""
        return self._run.t

    @property
    def cut_short(self) -> int:
        """As of `Simulation.cut_short`."""
        return int(self._run.loop.counts.cut_short)

    def _states(self) -> list[tuple[Surroundings, State]]:
        return [(x.sea, state) for x, state in zip(self._run.model.models, self._run.state.lines, strict=True)]

    @one_thread
    def set_point(
        self, name: str, position: Sequence[float] | Floats, velocity: Sequence[float] | Floats | None = None
    ) -> None:
        """Where a fixed point is to be at the end of the next `advance`, which it reaches smoothly.

        position: (3,) m, inertial; velocity: (3,) m/s there, None: as of `Simulation.set_end`.  A point that is not set
        again stays where it is.  ValueError: no such point, or it is free, on a body, or has a motion in the scene.
        """
        self._check_open()
        if not isinstance(name, str) or name not in self._driven:
            self._check_point(name)
            if not isinstance(self.scene.points[name], FixedPoint):
                raise ValueError(f"points.{name} is free or on a body: only fixed points are set")
            if not self.settable(name):
                raise ValueError(f"points.{name} has a motion in the scene: leave it out to set the point from outside")
            model = self._run.model
            self._driven[name] = [
                model.models[model.names.index(line)].ends.drive(int(end == "end"))
                for line, end in self.scene.lines_at(name)
            ]
        self._next[name] = triple(position, "position"), None if velocity is None else triple(velocity, "velocity")

    @one_thread
    def set_length(self, name: str, length: float, rate: float = 0.0) -> None:
        """How long a line is to be at the end of the next `advance`, m, and its rate there, m/s.

        It reaches that smoothly, and keeps the rate until it is set again.  ValueError: the line has no `payout`, or
        that gives the length itself; a length that cannot be.
        """
        self._wind(name, math.nan if length is None else length, rate)

    @one_thread
    def set_payout(self, name: str, rate: float) -> None:
        """At which rate, m/s, a line is to be paid out at the end of the next `advance`; negative: taken in.

        The rate changes evenly until then, and stays until it is set again.  ValueError: as of `set_length`.
        """
        self._wind(name, None, rate)

    def _wind(self, name: str, length: float | None, rate: float) -> None:
        self._check_open()
        k, run = self._line(name), self._run
        if run.payout is None or k not in run.payout.lines:
            raise ValueError(f"lines.{name}.connections has no payout: the length of the line stays")
        from hybrid.simulation.payout import length_asked

        where = f"lines.{name}.connections.{('start', 'end')[run.payout.lines[k].plan.side]}.payout"
        self._wound[k] = length_asked(run.scenes[k], run.payout.lines[k], length, rate, where)

    def settable(self, name: str) -> bool:
        """Whether `set_point` moves a point: it is fixed, and has no motion in the scene."""
        self._check_point(name)
        point = self.scene.points[name]
        return isinstance(point, FixedPoint) and point.motion is None

    def step(self) -> float:
        """One step of the scene's length, and the time after it (s), as of `Simulation.step`."""
        self._check_open()
        time = self.scene.require_time()
        return self.advance(end_of_step(self.t, None if time.controlled else time.step, time.duration))

    @one_thread
    def advance(self, until: float) -> float:
        """Steps to a time `until` (s), where one ends; returns it.

        ValueError: a time that has passed, or beyond the duration.  ComputationError: a step failed.  Once `save` has
        been called, the simulation is then back at the time from which it was to advance, with all points at rest that
        are not set again, and can go on in a shorter step; else it is over, and its result is written.
        """
        self._check_open()
        time, now = self.scene.require_time(), self.t
        sliver = SLIVER * (time.step or time.duration)
        number = isinstance(until, int | float | np.integer | np.floating) and not isinstance(until, bool)
        if not number or not now + sliver < until <= time.duration + sliver:
            raise ValueError(
                f"until = {until!r:.60}: expected a time (s) after {now:.9g}, up to time.duration, {time.duration:g}"
            )
        until = min(float(until), time.duration)
        before = self._before() if self._final else None
        for k, paying in self._run.payout.lines.items() if self._run.payout is not None else ():
            paying.go_on(now, until, self._wound.pop(k, None))
        one = self._run.resolution.one
        one_step = until - now <= ONE_STEP * (one.step if one.local is None else self._run.last_step)
        for name, ends in self._driven.items():
            course = self._next.pop(name, None)
            for end in ends:
                if course is None:
                    end.stay(now, until, one_step)
                else:
                    end.set(now, until, *course, STILL, one_step)
        self._move_obstacles(now, until, one_step)
        try:
            while self._stops and self._stops[0] < until - sliver:
                self._run.go_to(self._stops.pop(0))
            if self._stops and self._stops[0] <= until + sliver:
                self._stops.pop(0)
            self._run.go_to(until)
            if before is None:  # after a `save` nothing is final
                self._run.keep()
        except LineFailed as failed:
            raise (self._fail(failed) if before is None else self._undo(failed, before)) from None
        if text := contradictions(self._set_from_outside()):
            self._run.noted.event(0.0, *self._run.file.span, "implausible", text)
        return self.t

    def _set_from_outside(self) -> dict[str, DrivenEnd]:
        found = {f"points.{name}": ends[0] for name, ends in self._driven.items() if ends}
        return found | {f"obstacles.{name}": self._obstacle_paths(name)[0] for name in self._moved}

    # --- back and forth ---------------------------------------------------------------------------

    @one_thread
    def save(self) -> Any:
        """The state as it is, in memory, to come back to: for the iterations of an implicit coupling.

        What has been computed until now is final; what follows is when the next `save` is made.  ComputationError:
        what has been computed until now is not sound; the simulation is over, and its result is written.
        """
        self._check_open()
        defer(self._run)
        self._commit()
        self._here = self._kept()
        return self._here

    @one_thread
    def restore(self, saved: Any) -> None:
        """Back to what `save` returned, as often as wanted; what was computed since leaves no output and no event.

        ValueError: another SystemSimulation has returned it, or what came after it is final: a later `save` was made,
        or more than 1000 outputs or events came since.
        """
        self._check_open()
        if not isinstance(saved, SavedSystem) or saved.owner is not self._owner:
            raise ValueError("restore: expected what save() of this SystemSimulation has returned")
        if saved.number < self._final:
            raise ValueError("a later save() has made final what came after this one, or too much came after it")
        self._bring_back(saved)

    def _commit(self) -> None:
        try:
            commit(self._run)
        except LineFailed as failed:
            raise self._fail(failed) from None
        self._final, self._here = self._final + 1, None

    def _kept(self) -> SavedSystem:
        paths = {name: [end.keep() for end in ends] for name, ends in self._driven.items()}
        return SavedSystem(
            self._owner,
            self._final,
            stops=tuple(self._stops),
            paths=paths,
            next=dict(self._next),
            wound=dict(self._wound),
            obstacles=self._kept_courses(),
            **kept(self._run),
        )

    def _before(self) -> SavedSystem:
        """What a step that fails goes back to."""
        if any(recorder.full for recorder in recorders(self._run)):
            self._commit()
        before, self._here = self._here or self._kept(), None
        return before

    def _bring_back(self, saved: SavedSystem) -> None:
        for name, ends in self._driven.items():
            if name not in saved.paths:  # it has been set since, for the first time
                for driven, (line, end) in zip(ends, self.scene.lines_at(name), strict=True):
                    driven.stand(saved.place(line, end), driven.path[FRAME:TURN])
        self._driven = {name: self._driven[name] for name in saved.paths}
        self._follow(saved.paths)
        self._bring_back_courses(saved.obstacles)
        bring_back(self._run, saved)
        self._bring_back_courses(saved.obstacles)  # of the model of then
        self._follow(saved.paths)  # with the frames of then
        for model in self._run.model.models:
            model.ends.at(self.t)
        self._stops, self._next, self._here = [*saved.stops], dict(saved.next), saved
        self._wound = dict(saved.wound)

    def _follow(self, paths: Mapping[str, list[Floats]]) -> None:
        """Let points that are set from outside be on these paths."""
        for name, rows in paths.items():
            for end, path in zip(self._driven[name], rows, strict=True):
                end.bring_back(path)

    def _undo(self, failed: LineFailed, before: SavedSystem) -> ComputationError:
        """Be back where the step began that has failed."""
        error = named(failed, self._run.model)
        self._bring_back(before)
        self._next.clear()
        self._wound.clear()
        self._courses.clear()
        return ComputationError(
            error.outcome, error.t, error.s, f"{error.detail}; the simulation is back at t = {self.t:.6g} s",
            first="set the points again and advance in a shorter step",
        )  # fmt: skip

    # --- what it is now ---------------------------------------------------------------------------

    def _fail(self, failed: LineFailed) -> ComputationError:
        self._closed = True
        if failed.outcome == Outcome.GAINS_ENERGY and (text := contradictions(self._set_from_outside(), soon=True)):
            failed = LineFailed(failed.line, failed.outcome, failed.t, failed.s, text)
        with self._stack:
            return self._run.failed(failed)

    @one_thread
    def point(self, name: str) -> PointState:
        """Where a point is, and the force of its lines on it; of a free point without the loads on itself."""
        self._check_point(name)
        force = np.zeros(3)
        for line, end in self.scene.lines_at(name):
            at_end = end == "end"
            force += self.forces(line)[at_end]
        state = self._run.state.lines[self._line(line)]
        return PointState(state.r[-int(at_end)].copy(), state.v[-int(at_end)].copy(), force)

    @one_thread
    def line(self, name: str) -> CableState:
        """Where a line is now; arrays of one's own."""
        k = self._line(name)
        model, x = self._run.model.models[k], self._run.state.lines[k]
        return CableState(self.t, model.line.s.copy(), x.r.copy(), x.v.copy(), x.T.copy(), model.zones)

    @one_thread
    def tension(self, name: str) -> Floats:
        """Tension (ns,) N of a line now at the points of the result, recovered between cells and at the ends as

        written there; `line(name).tension` is that of the cells, and costs less.
        """
        k, run = self._line(name), self._run
        run.ends_of_now()
        line, state = run.lines[k], run.state.lines[k]
        _, seen, _ = line.look(line.state_now(run.t, run.solver.lines[k].ends, state, run.solver.work[k]))
        return np.array(seen.tension[:, 0])

    @property
    def closed(self) -> bool:
        """Whether the simulation is over, and its result written."""
        return self._closed

    @one_thread
    def forces(self, name: str) -> tuple[Floats, Floats]:
        """Forces (3,) N of a line on the points at its start and at its end, inertial."""
        k = self._line(name)
        forces = self._run.solver.work[k].report[FORCE_A : FORCE_A + 6].copy()
        return forces[:3], forces[3:]

    def _check_point(self, name: object) -> None:
        if not isinstance(name, str) or name not in self.scene.points:
            points = ", ".join(self.scene.points)
            raise ValueError(f"name: expected a point of the scene ({points}), found {name!r:.60}")

    def _line(self, name: str) -> int:
        if not isinstance(name, str) or name not in self._run.model.names:
            lines = ", ".join(self._run.model.names)
            raise ValueError(f"name: expected a line of the scene ({lines}), found {name!r:.60}")
        return self._run.model.names.index(name)

    def result(self) -> Result:
        """What has been recorded until now; the simulation is over."""
        self.close()
        return open_result(self._target)

    @one_thread
    def close(self) -> None:
        """Write what is left and close the file; a second call does nothing."""
        if not self._closed:
            self._closed = True
            with self._stack:
                self._run.finish("complete", f"{self._run.steps} steps, stepped from outside to t = {self.t:.6g} s")

    def _check_open(self) -> None:
        if self._closed:
            raise ValueError("the simulation is over: its result has been written")

    def __enter__(self) -> SystemSimulation:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        if kind is None:
            self.close()
        elif not self._closed:
            self._closed = True
            with self._stack:
                self._run.finish("failed" if issubclass(kind, Exception) else "interrupted", str(error))
