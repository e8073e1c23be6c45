"""Lines that are stepped from outside, by a controller, a vessel, another program: points are set, forces read."""

from __future__ import annotations

import io
import threading
from collections.abc import Sequence
from contextlib import ExitStack
from copy import copy
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from hybrid.errors import SceneError
from hybrid.model.ends import DrivenEnd, contradictions
from hybrid.model.network import NetworkResolution
from hybrid.scene.analysis import missing_time
from hybrid.scene.network import Network
from hybrid.scene.read import SceneLike, as_scene, scene_text
from hybrid.simulation.first_use import compile_beside
from hybrid.simulation.mesh_survey import CELLS, POINTS, Survey, layered, rods_at_rest, with_survey
from hybrid.simulation.own_parts import RunPart, checked_parts
from hybrid.simulation.run import Run, new_run, static_network
from hybrid.simulation.run_record import Asked, Recording
from hybrid.simulation.stepped import (
    ONE_STEP,
    SLIVER,
    Saved,
    bring_back,
    commit,
    end_of_step,
    in_space,
    is_full,
    iterations_allowed,
    kept,
    marks_of,
    one_thread,
    set_out,
)
from hybrid.simulation.stepped_points import SteppedPoints
from hybrid.solve.network_steps import ROWS_OUTSIDE
from hybrid.solve.stepper import LineFailed
from hybrid.store.format import MemoryTarget
from hybrid.store.hdf5_file import check_target, locked
from hybrid.store.reader import Result, open_result, written_result
from hybrid.store.recorder import Mark
from hybrid.zones.manager import UserCriterion

# s of the wall, after which the time of the processor is read again: to read it may take as long as ten steps.
READ_OUTSIDE = 1.0
# What a Simulation has been asked for, and is given back where it is taken back.
ASKED = ("_stops", "_driven", "_next", "_wound", "_moved", "_courses")
NUMBER = (int, float, np.integer, np.floating)


def layers_at_rest(network: Network) -> NetworkResolution:
    """Cells by the equilibrium of the start; where a line says how many cells a layer has, by that of full loads."""
    asked = [name for name, line in network.lines.items() if line.resolution is not None]
    scenes = {name: network.scene_of(name) for name in network.lines}
    first = layered(scenes, NetworkResolution.of(scenes), lambda x: rods_at_rest(network, x, True))
    if not asked:
        return first
    memory = MemoryTarget()
    coarse = first.coarser(CELLS)
    output = network.output.model_copy(update={"points": POINTS, "quantities": {}})
    shown = network.model_copy(update={"output": output})
    run = static_network(shown, memory, partial(scene_text, shown), coarse)
    found, lines = written_result(memory), dict(first.lines)
    for name in asked:
        line, scene, model = found.lines[name], network.scene_of(name), run.model.models[run.model.names.index(name)]
        outputs = {key: line[key] for key in ("position", "curvature", "tension")}
        lines[name] = with_survey(lines[name], scene, Survey.of(scene, lines[name], model, line.s, outputs))
    return NetworkResolution(lines)


class Simulation(SteppedPoints):
    """A scene in motion that is stepped from outside; a context manager.

    scene: as of `hybrid.run`; its time table gives the longest step and the duration, beyond which nothing is computed.
    output: the HDF5 file to write; None keeps the result in memory.  criterion, parts: as of `hybrid.run`.
    Constructing it finds the start that the scene asks for, an equilibrium perhaps, and nothing else: no run to
    estimate an error is made.  A cable that says no `dimension` is computed in space, since an end may be set
    anywhere.  most_iterations: Newton iterations that a step may take, for real time: one that has not converged by
    then is taken as it is, with an event `iterations cut` and counted in `cut_short`; None: until it has.  One
    thread at a time: a method called while another thread is in one raises ValueError.  Raises SceneError,
    ResultError and ComputationError as `hybrid.run` does.
    """

    def __init__(
        self,
        scene: SceneLike,
        output: str | Path | None = None,
        *,
        overwrite: bool = True,
        criterion: UserCriterion | None = None,
        most_iterations: int | None = None,
        parts: Sequence[RunPart] = (),
    ) -> None:
        most, parts = iterations_allowed(most_iterations), checked_parts(parts)
        self._read_scene(as_scene(scene))
        self.lock, self._stack, self._owner = threading.RLock(), ExitStack(), object()
        self._target: Path | io.BytesIO = io.BytesIO()
        if output is not None:
            self._target = Path(output).expanduser().resolve()
            check_target(self._target, overwrite)
            self._stack.enter_context(locked(self._target))
        try:
            self._run = self._begun(most, criterion, parts)
        except BaseException:
            self._stack.close()
            raise
        names = self._run.model.names
        self._paid = [(k, x.paying) for k, x in enumerate(self._run.lines) if x.paying is not None]
        self._places = {
            point: [(names.index(line), int(end == "end")) for line, end in self._network.lines_at(point)]
            for point in self._network.points
        }
        time, self._stops = self._network.require_time(), self._run.stops()
        self._fixed_step, self._duration = None if time.controlled else time.step, time.duration
        self._sliver = SLIVER * self._run.resolution.one.step
        self._driven, self._next, self._wound = {}, {}, {}
        self._courses, self._moved = {}, {}
        self._seen = int(self._run.loop.counts.output)  # outputs that readers of the file have been shown
        self._final = 0  # how often what had been recorded was made final
        self._marks: tuple[Mark, ...] = ()  # where recorders stood then

    def _read_scene(self, scene: Any) -> None:
        """The network to compute, whose ends are set, of a scene in either form."""
        if scene.time is None:
            raise SceneError([missing_time()])
        contact = {name: {"contact": x.contact.within(ends_are_set=True)} for name, x in scene.lines.items()}
        self.scene = in_space(scene.with_lines(contact))
        self._network, self._form = self.scene, self.scene.form

    def _begun(self, most: int, criterion: UserCriterion | None, parts: Sequence[RunPart]) -> Run:
        """The run at its start; most: iterations that a step may take.  ComputationError."""
        compile_beside(self.scene)
        # in space points may be set anywhere
        recording = Recording(planes=self._network.dimension == 2, asked=Asked(self.scene), parts=parts)
        with self._form.in_words():
            cells, text = layers_at_rest(self._network), scene_text(self.scene)
            run = new_run(self._network, self._target, text, True, cells, recording, criterion)
        run.loop.counts.most_iterations, run.loop.most_rows, run.read_every = most, ROWS_OUTSIDE, READ_OUTSIDE
        run.stepped_outside = True
        try:
            run.begin_motion()
        except LineFailed as failed:
            raise run.failed(failed) from None
        return run

    @property
    def cut_short(self) -> int:
        """Steps so far that were taken after `most_iterations` though these had not converged."""
        return int(self._run.loop.counts.cut_short)

    # --- stepping -----------------------------------------------------------------------------------

    def step(self) -> float:
        """One step of the scene's length, and the time after it (s).

        ValueError: steps follow the motion (`advance` says where to), or the duration is over.
        """
        self._check_open()
        return self.advance(end_of_step(self.t, self._fixed_step, self._duration))

    @one_thread
    def advance(self, until: float) -> float:
        """Steps to a time `until` (s), where one ends; returns it.  Points that are set reach their place there.

        ValueError: a time that has passed, or beyond the duration; a step has failed and nothing was restored.
        ComputationError: a step failed; the simulation goes on after `restore`.
        """
        self._check_open()
        self._check_sound()
        until = self._checked_time(until)
        if self._final and is_full(self._run, self._marks):
            self._commit()
        self._start_courses(self.t, until)
        try:
            self._go_to(until)
            made = int(self._run.loop.counts.output)
            if not self._final and made != self._seen and self._run.is_due:  # after a `save` nothing is final
                self._run.keep()
                self._seen = made
        except LineFailed as failed:
            raise self._fail(failed) from None
        if any(not x.is_reported and x.contradiction() for x in self._ends_set()):
            text = contradictions(self._set_from_outside())
            self._run.noted.event(0.0, *self._run.file.span, "implausible", text)
        self._forget_released()
        return self.t

    def _checked_time(self, until: Any) -> float:
        """Where to advance to (s); ValueError: that cannot be."""
        if isinstance(until, bool) or not isinstance(until, NUMBER):
            raise ValueError(f"until: expected a number, in s, found {until!r:.60}")
        now, duration, sliver = self.t, self._duration, self._sliver
        if not now + sliver < until <= duration + sliver:
            raise ValueError(
                f"until = {until:.9g} s, expected a time after {now:.9g} s, up to time.duration, {duration:g} s"
            )
        return min(float(until), duration)

    def _start_courses(self, now: float, until: float) -> None:
        """What has been set is on its way from `now` to `until` (s).

        ValueError: something of it is refused, and nothing is on its way.
        """
        laws = {}
        for k, paying in self._paid:
            try:
                laws[k] = paying.law_from_outside(now, until, self._wound.get(k))
            except ValueError:
                self._wound.pop(k, None)
                raise
        self._wound.clear()
        for k, paying in self._paid:
            if (law := laws[k]) is not None:
                paying.use_law(law)
        one_step = until - now <= ONE_STEP * (self._fixed_step or self._run.last_step)
        for name, ends in self._driven.items():
            set_out(ends, self._next.pop(name, None), now, until, one_step)
        for name in self._moved:
            set_out(self._obstacle_paths(name), self._courses.pop(name, None), now, until, one_step)

    def _go_to(self, until: float) -> None:
        stops, sliver = self._stops, self._sliver
        while stops and stops[0] < until - sliver:
            self._run.go_to(stops.pop(0))
        if stops and stops[0] <= until + sliver:
            stops.pop(0)
            self._run.go_to(until)
        else:
            self._run.step_to(until)

    # --- back and forth ---------------------------------------------------------------------------

    @one_thread
    def save(self) -> Any:
        """The state as it is, in memory, to come back to: for the iterations of an implicit coupling.

        What has been computed until now is final; what follows is when the next `save` is made.  ValueError: a step has
        failed; what was saved before it stays good.  ComputationError: what has been computed until now is not sound.
        """
        self._check_open()
        self._check_sound()
        self._commit()
        return self._kept()

    @one_thread
    def restore(self, saved: Any) -> None:
        """Back to what `save` returned, as often as wanted; what was computed since leaves no output and no event.

        ValueError: another Simulation has returned it, or what came after it is final: a later `save` was made,
        or more than 1000 outputs or events came since.
        """
        self._check_open()
        if not isinstance(saved, Saved) or saved.owner is not self._owner:
            raise ValueError("restore: expected what save() of this Simulation has returned")
        if saved.number < self._final:
            raise ValueError("a later save() has made final what came after this one, or too much came after it")
        self._bring_back(saved)

    def _commit(self) -> None:
        try:
            commit(self._run)
        except LineFailed as failed:
            raise self._fail(failed) from None
        self._final += 1
        self._marks = marks_of(self._run)

    def _kept(self) -> Saved:
        paths = {name: [end.keep() for end in ends] for name, ends in self._driven.items()}
        of_outside = [name for name, x in self.scene.obstacles.items() if x.from_outside]
        obstacles = {name: self._obstacle_paths(name)[0].keep() for name in of_outside}
        asked = {name: copy(getattr(self, name)) for name in ASKED}
        return Saved(self._owner, self._final, asked=asked, paths=paths, obstacles=obstacles, **kept(self._run))

    def _bring_back(self, saved: Saved) -> None:
        for name in self._places.keys() - saved.paths.keys():  # what has been set since, for the first time
            for line, k in self._places[name]:
                end = saved.model.models[line].ends.motions.get(k)
                if isinstance(end, DrivenEnd):
                    position, frame = saved.stood[line]
                    end.stand(position[k], frame[k])
        vars(self).update({name: copy(x) for name, x in saved.asked.items()})
        self._driven_of = self._failed = None
        self._set_paths(saved)
        bring_back(self._run, saved)
        self._set_paths(saved)  # of the model, and with the frames, of then
        for model in self._run.model.models:
            model.ends.at_time(self.t)

    def _set_paths(self, saved: Saved) -> None:
        """Let points and obstacles that are set from outside be on their paths of then."""
        for name, rows in saved.paths.items():
            for end, path in zip(self._driven[name], rows, strict=True):
                end.bring_back(path)
        for name, path in saved.obstacles.items():
            for end in self._obstacle_paths(name):
                end.bring_back(path)

    # --- the end ----------------------------------------------------------------------------------

    @property
    def closed(self) -> bool:
        """Whether the simulation is over, and its result written."""
        return self._closed

    def result(self) -> Result:
        """What has been recorded until now; the simulation is over."""
        self.close()
        return open_result(self._target)

    @one_thread
    def close(self) -> None:
        """Write what is left and close the file; a second call does nothing."""
        self._close("complete", f"{self._run.steps} steps, stepped from outside to t = {self.t:.6g} s")

    def _close(self, status: str, message: str) -> None:
        if self._closed:
            return
        self._closed = True
        with self._stack:
            if self._failed is not None:
                failed, error = self._failed
                self._run.finish_failed(failed, str(error))
                return
            try:
                self._run.finish(status, message)
            except LineFailed as late:  # an output says that going on makes no sense
                error = self._error_of(late)
                self._run.finish_failed(late, str(error))
                raise error from None

    def __enter__(self) -> Simulation:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        if kind is None:
            self.close()
        else:
            self._close("failed" if issubclass(kind, Exception) else "interrupted", str(error))
