"""The loop over time, and the equilibrium of a scene: the only file that knows everyone.

run      integrate a scene over its duration
static   find its equilibrium
plan     say what would be computed, before anything is
"""

from __future__ import annotations

import io
import signal
import tempfile
import threading
import time as clock
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hybrid.errors import ComputationError, Outcome, SceneError
from hybrid.model.build import Model, build
from hybrid.model.mesh import Zone
from hybrid.model.plan import output_times, step_ends
from hybrid.model.state import Floats
from hybrid.results.probes import Observer, output_points
from hybrid.results.read import Result, open_result
from hybrid.results.record import Field, Recorder
from hybrid.scene.motion import check_motions
from hybrid.scene.read import scene_text
from hybrid.scene.schema import Scene, missing_time
from hybrid.solve.statics import Equilibrium, solve_statics
from hybrid.solve.step import sharpest, slackest
from hybrid.solve.timestep import POWERS, SLACK_FLOOR, UNRESOLVED_BEND, Stepper, Taken

HALVINGS = 10  # of a time step that fails: a factor of 1000 separates a hard moment from a hopeless one
REPORT_EVERY = 0.1  # s of wall time between two calls of `progress`

STEP_FIELDS = (
    Field("t", "s", "time at the end of the step"),
    Field("dt", "s", "length of the step"),
    Field("iterations", "", "Newton iterations, repeats included", dtype="int64"),
    Field(
        "correction", "", "next Newton correction as predicted (turn of a chord in rad, or tension over the largest)"
    ),
    Field("residual", "N", "largest force out of balance at a node before the last correction"),
    Field("repeats", "", "how often the step was repeated with smaller parts", dtype="int64"),
    Field("cpu", "s", "processor time since the start of the run"),
)


@dataclass(frozen=True)
class Progress:
    """Where a run is: time and duration (s), step number, Newton iterations of the last step, zones, wall time (s)."""

    t: float
    duration: float
    step: int
    iterations: int
    zones: tuple[Zone, ...]
    wall: float


def run(
    scene: Scene,
    output: str | Path | None = None,
    *,
    progress: bool | Callable[[Progress], None] = False,
    overwrite: bool = True,
) -> Result:
    """Integrate a scene over its duration.

    output: the HDF5 file to write; None keeps the result in memory.  progress: True for a
    live line, or a function called about ten times a second.  overwrite: replace an
    existing result (never another program's file).

    Raises SceneError when the scene is refused and ComputationError when the computation
    stops; what was computed until then is in the file, and the last good state beside it.
    """
    if scene.time is None:
        raise SceneError([missing_time(scene)])
    check_motions(scene)
    if scene.solver == "shooting":
        from hybrid.arbitrate import run_shooting

        return run_shooting(scene, output, overwrite)
    model = build(scene)
    equilibrium = _equilibrium(model, 0.0) if scene.initial.kind == "equilibrium" else None
    outputs = output_times(scene)
    stops = sorted({*outputs, *(b for b in model.ends.breaks if b < outputs[-1])})
    observer = Observer(model.line, model.zones, output_points(scene.output.points, model.length), True)
    target = _target(output)
    recorder = _recorder(scene, model, observer, target, overwrite, len(outputs), equilibrium)
    with recorder, _interrupts() as interrupted, _Told(progress, scene.time.duration, model.zones) as told:
        motion = _Motion(scene, model, observer, recorder, target, equilibrium)
        motion.save()
        for stop in stops:
            for until in step_ends(motion.t, stop, scene.time.step):
                motion.advance(until)
                told(motion)
                if interrupted():
                    recorder.close("interrupted", f"stopped from outside at t = {motion.t:.6g} s")
                    raise KeyboardInterrupt
            if stop in outputs:
                motion.save()
            if stop in model.ends.breaks:
                motion.restart()
        told(motion, finished=True)
        recorder.close("complete", f"{motion.steps} steps")
    return open_result(target)


class _Motion:
    """A cable in motion: its state, the work done on it, and what to do when a step fails."""

    def __init__(
        self,
        scene: Scene,
        model: Model,
        observer: Observer,
        recorder: Recorder,
        target: Path | io.BytesIO,
        equilibrium: Equilibrium | None,
    ) -> None:
        assert scene.time is not None
        self.scene, self.model, self.observer, self.recorder, self.target = scene, model, observer, recorder, target
        self.stepper = Stepper(model.line, model.length, model.tension_scale, model.slack == "stop")
        self.t, self.steps, self.iterations = 0.0, 0, 0
        self.cpu = clock.process_time()
        self.work = np.zeros(len(POWERS))
        self.worst_bend = UNRESOLVED_BEND  # rad; worse ones are noted
        self.slackest = SLACK_FLOOR * model.tension_scale  # N; slacker cells are noted where the scene asks to go on
        if equilibrium is None:
            self.state = model.start.copy()
            self._bring_ends_in()
            self._ignite()
        else:
            self.state = equilibrium.state.copy()
            self.stepper.report[:] = equilibrium.report
        self.spare = self.state.copy()
        self.power = self._powers()
        if scene.time.rho_inf == 1.0 and not model.line.ck.all():
            text = "rho_inf = 1 damps nothing: the tension of an inextensible cable grows a sawtooth; 0.9 keeps it away"
            recorder.event(0.0, 0.0, model.length, "undamped", text)

    def advance(self, until: float) -> None:
        """To the time `until`: in one step if all is well, else in halves of halves."""
        assert self.scene.time is not None
        dt = until - self.t
        smallest = dt * 0.5**HALVINGS
        repeats = wasted = 0
        while self.t < until:
            end = until if until - self.t <= dt * (1 + 1e-9) else self.t + dt
            ends = self.model.ends.at(end)
            taken = self.stepper.step(ends, self.state, self.spare, end - self.t, self.scene.time.rho_inf)
            if taken.outcome == Outcome.OK:
                self._accept(taken, end, repeats, wasted)
                wasted = 0
            elif taken.outcome == Outcome.SLACK or 0.5 * dt < smallest:
                # A slack catenary is no matter of the step: its answer would be grid noise at any dt.
                self._stop(taken, end - self.t)
            else:
                wasted += taken.iterations
                repeats += 1
                dt *= 0.5

    def save(self) -> None:
        """Write an output."""
        ends = self.model.ends.at(self.t)
        values = self.observer.values(ends, self.state, self.stepper.report, self.work)
        self.recorder.save(self.t, values, self.observer.zone_rows)

    def restart(self) -> None:
        """A load has just stopped: accelerations jump, so find consistent ones."""
        self.model.ends.set_loads(self.t)
        self._ignite()
        self.power = self._powers()

    def _accept(self, taken: Taken, end: float, repeats: int, wasted: int) -> None:
        dt = end - self.t
        self.state, self.spare = self.spare, self.state
        self.t, self.steps, self.iterations = end, self.steps + 1, taken.iterations
        power = self._powers()
        self.work += 0.5 * dt * (self.power + power)
        self.power = power
        self._watch_bends()
        if self.model.slack == "warn":
            self._watch_slack()
        self.recorder.log(
            {
                "t": end, "dt": dt, "iterations": taken.iterations + wasted, "correction": taken.correction,
                "residual": taken.residual, "repeats": repeats, "cpu": clock.process_time() - self.cpu,
            }
        )  # fmt: skip

    def _watch_bends(self) -> None:
        """Note a bend that the mesh cannot resolve: when it shows first, and whenever it is half as bad again."""
        angle, node = sharpest(self.model.line, self.state.e)
        if angle > self.worst_bend:
            note_bend(self.recorder, self.model, self.t, angle, node)
            self.worst_bend = 1.5 * angle

    def _watch_slack(self) -> None:
        """Note a catenary cell without tension: when it shows first, and whenever it is ten times as bad."""
        cell = slackest(self.model.line, self.state.T, self.slackest)
        if cell >= 0:
            s, tension = float(self.model.line.s[cell]), float(self.state.T[cell])
            text = f"tension {tension:.3g} N in a catenary zone at s = {s:g} m: what follows is grid noise there"
            self.recorder.event(self.t, s, float(self.model.line.s[cell + 1]), "slack", text)
            self.slackest = min(10.0 * tension, 10.0 * self.slackest)

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
                f"it is turned in, and a force there grows, over the first {duration:.3g} s; "
                f"start from an equilibrium to avoid this"
            )
            self.recorder.event(0.0, s, s, "turned in", text)

    def _powers(self) -> Floats:
        ends = self.model.ends
        return self.stepper.powers(ends.values, ends.velocity, self.state)

    def _ignite(self) -> None:
        assert self.scene.time is not None
        ends = self.model.ends
        acceleration = ends.acceleration(self.t, 1e-3 * self.scene.time.step)
        taken = self.stepper.ignite(ends.at(self.t), acceleration, self.state)
        if taken.outcome != Outcome.OK:
            self._stop(taken, 0.0)

    def _stop(self, taken: Taken, dt: float) -> None:
        """The computation cannot go on: leave the last good state on disk, and say where and why."""
        line = self.model.line
        where = min(max(taken.where, 0), line.s.size - 1)
        s = float(line.s[where])
        if taken.outcome == Outcome.SLACK:
            detail = f"tension {self.spare.T[where]:.3g} N at the end of the step that starts there"
        elif dt == 0.0:
            detail = "no accelerations are consistent with the shape and the loads"
        else:
            detail = f"smallest step tried {dt:.3g} s; {taken.iterations} Newton iterations in the last try"
        error = ComputationError(taken.outcome, self.t, s, detail, self._snapshot(dt, taken))
        if self.t > self.recorder.last:
            self.save()
        self.recorder.event(self.t, s, s, taken.outcome.name.lower(), str(error))
        raise error

    def _snapshot(self, dt: float, taken: Taken) -> Path | None:
        """The last good state with all that a repetition of the failed step needs; None when it cannot be written."""
        if isinstance(self.target, Path):
            path = self.target.with_suffix(".snapshot.npz")
        else:
            path = Path(tempfile.gettempdir()) / f"hybrid-{clock.strftime('%Y%m%d-%H%M%S')}.snapshot.npz"
        content: dict[str, Any] = {"t": self.t, "dt": dt, "outcome": taken.outcome.name, "s": self.model.line.s}
        content |= {"scene": scene_text(self.scene), **self.state._asdict()}
        try:
            np.savez(path, **content)
        except OSError:
            return None
        return path


class _Told:
    """Calls `progress` now and then, and closes a live line however the run ends."""

    def __init__(self, progress: bool | Callable[[Progress], None], duration: float, zones: tuple[Zone, ...]) -> None:
        self._tell: Callable[[Progress], None] | None = None
        if progress is True:
            from hybrid.live import live_line

            self._tell = live_line()
        elif progress:
            self._tell = progress
        self._duration, self._zones = duration, zones
        self._begin = clock.perf_counter()
        self._last = 0.0

    def __enter__(self) -> _Told:
        return self

    def __exit__(self, *_: object) -> None:
        close = getattr(self._tell, "close", None)
        if close is not None:
            close()

    def __call__(self, motion: _Motion, finished: bool = False) -> None:
        if self._tell is None:
            return
        now = clock.perf_counter() - self._begin
        if finished or now - self._last > REPORT_EVERY:
            self._last = now
            self._tell(Progress(motion.t, self._duration, motion.steps, motion.iterations, self._zones, now))


def static(scene: Scene, output: str | Path | None = None, *, overwrite: bool = True) -> Result:
    """Find the equilibrium of a scene at t = 0 under its full loads; the result has one output.  Errors as of `run`."""
    check_motions(scene)
    if scene.solver == "shooting":
        from hybrid.arbitrate import static_shooting

        return static_shooting(scene, output, overwrite)
    model = build(scene)
    found = _equilibrium(model, np.inf)
    observer = Observer(model.line, model.zones, output_points(scene.output.points, model.length), False)
    target = _target(output)
    with _recorder(scene, model, observer, target, overwrite, 0, found) as recorder:
        ends = model.ends.at(np.inf)
        angle, node = sharpest(model.line, found.state.e)
        if angle > UNRESOLVED_BEND:
            note_bend(recorder, model, 0.0, angle, node)
        recorder.save(0.0, observer.values(ends, found.state, found.report, np.zeros(len(POWERS))), observer.zone_rows)
        recorder.close("complete", f"equilibrium: {found.path[-1]}; out of balance {found.residual:.2g} N")
    return open_result(target)


def note_bend(recorder: Recorder, model: Model, t: float, angle: float, node: int) -> None:
    """Write an event about a bend that the mesh does not resolve."""
    s = float(model.line.s[node])
    recorder.event(
        t, s, s, "unresolved bend",
        f"the rod bends by {np.degrees(angle):.0f} deg from one cell to the next at s = {s:g} m: "
        f"curvature and moment are wrong there; cells of {model.line.hn[node] / angle * 0.3:.2g} m would resolve it",
    )  # fmt: skip


# --- parts of the above ---------------------------------------------------------------


def _equilibrium(model: Model, t: float) -> Equilibrium:
    """Equilibrium with the loads of time t; infinity stands for loads that have grown to their full size."""
    return solve_statics(model.line, model.ends.at(t), model.start, model.length, model.tension_scale, model.slack)


def _target(output: str | Path | None) -> Path | io.BytesIO:
    return Path(output) if output is not None else io.BytesIO()


def _recorder(
    scene: Scene,
    model: Model,
    observer: Observer,
    target: Path | io.BytesIO,
    overwrite: bool,
    outputs: int,
    found: Equilibrium | None = None,
) -> Recorder:
    attributes: dict[str, str | float | int] = {
        "title": scene.title, "cells": model.cells, "length": model.length, "tension_scale": model.tension_scale,
    }  # fmt: skip
    if found is not None:
        attributes |= {"static_path": "; ".join(found.path), "static_residual": found.residual}
    fixed = []
    if scene.output.history:
        points = np.array(scene.output.history)
        fixed.append(
            (Field("history", "m", "arc lengths to follow in histories", (points.size,), ("history",)), points)
        )
    return Recorder(
        target, grid_s=observer.grid.s, fields=observer.fields, step_fields=STEP_FIELDS if outputs else (),
        attributes=attributes, scene_text=scene_text(scene), fixed=fixed, outputs=outputs + 1, overwrite=overwrite,
    )  # fmt: skip


@contextmanager
def _interrupts() -> Iterator[Callable[[], bool]]:
    """Catch Ctrl-C and SIGTERM as a flag, so that a run ends between two steps and its file is whole."""
    if threading.current_thread() is not threading.main_thread():
        yield lambda: False
        return
    seen: list[int] = []
    before = {}
    for number in (signal.SIGINT, signal.SIGTERM):
        before[number] = signal.signal(number, lambda got, _frame: seen.append(got))
    try:
        yield lambda: bool(seen)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
