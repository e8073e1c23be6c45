"""Several lines that meet at points: their equilibrium and their motion, each line a result of its own in one file."""

from __future__ import annotations

import io
import time as clock
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np

from hybrid.errors import ComputationError, Outcome, ResultError
from hybrid.kernels.bodies import FRAME, PLACE, V
from hybrid.kernels.cache import cache_folder
from hybrid.kernels.report import BEND, TWIST_NODE
from hybrid.kernels.state import Floats
from hybrid.model.plan import output_times, parts
from hybrid.model.resolution import first_resolution
from hybrid.model.system import SystemModel, balanced_places, build_system
from hybrid.scene.system import System
from hybrid.simulation.progress import RESULT, ProgressReporter
from hybrid.simulation.system_lines import LineResult
from hybrid.simulation.system_points import fields_of, values_of
from hybrid.simulation.time_loop import SAME_STOP, apart
from hybrid.solve.system import JoinedLine, SystemSolver, SystemState, SystemTaken, joined_ends
from hybrid.solve.system_statics import LineFailed, Start, SystemEquilibrium, solve_system_statics
from hybrid.store.lines import write_lines
from hybrid.store.writer import Recorder

# A step that fails is repeated in halves, down to this part of it.
SHORTEST = 2.0**-12
# Steps between two reports of the progress, and between two looks at what the mesh resolves.
LOOK = 16


def equilibrium_of_system(system: System, model: SystemModel, t: float) -> SystemEquilibrium:
    """Equilibrium with the loads of time t (s; infinity: of full size).  ComputationError: none is found."""
    try:
        numbers = model.body_numbers(t)
        return solve_system_statics(joined_lines(model, t), len(model.free), numbers, _starts(system, model))
    except LineFailed as failed:
        raise named(failed, model) from None


def _starts(system: System, model: SystemModel) -> Iterator[Start]:
    """Shapes from which the equilibrium is looked for."""
    yield "lines hung between the first places", SystemState([x.start for x in model.models], model.body_places)
    places = balanced_places(system, model)
    if places is not None and (model.free or model.bodies):
        models = build_system(system, *places).models
        yield "lines hung between places that balance", SystemState([x.start for x in models], places[1])


def joined_lines(model: SystemModel, t: float) -> list[JoinedLine]:
    """The lines with their ends and their sea at t (s), whose arrays `ends.at` and `sea.at` overwrite."""
    lines = []
    for x, joints, fairleads in zip(model.models, model.joints, model.fairleads, strict=True):
        floor = x.slack_floor if x.slack == "stop" else -np.inf
        ends = joined_ends(x.ends.at(t), joints)
        lines.append(JoinedLine(x.line, x.sea.at(t), ends, x.length, x.tension_scale, floor, joints, fairleads))
    return lines


def named(failed: LineFailed, model: SystemModel) -> ComputationError:
    """The same with the name of the line in its detail."""
    where = f"line {model.names[failed.line]}" if failed.line >= 0 else "the points"
    detail = f"{where}; {failed.detail}" if failed.detail else where
    return ComputationError(failed.outcome, failed.t, failed.s, detail)


class SystemRun:
    """One system, computed into a file or into memory."""

    def __init__(self, system: System, target: Path | io.BytesIO, text: str, moves: bool) -> None:
        """text: the scene as YAML; moves: whether its motion is wanted, else its equilibrium under full loads."""
        self.system, self.target, self.moves = system, target, moves
        self.model = build_system(system)
        names = self.model.names
        self.scenes = [system.scene_of(name, system.carried(name), system.guesses) for name in names]
        self.times = output_times(self.scenes[0]) if moves else []
        self.found = equilibrium_of_system(system, self.model, 0.0 if moves else np.inf)
        self.lines = [
            LineResult(k, name, scene, model, self.found, len(self.times))
            for k, (name, scene, model) in enumerate(zip(names, self.scenes, self.model.models, strict=True))
        ]
        self.t, self.steps = 0.0, 0
        self._dry: set[str] = set()  # bodies that have been said to be out of the water
        self.loaded = 0.0  # s, loads that have stopped by then act no more
        self.state: SystemState = self.found.state.copy()
        self.recorder = self._points_recorder(text)

    # --- the file -----------------------------------------------------------------------------------

    def _points_recorder(self, text: str) -> Recorder:
        """The result of the points and bodies."""
        attributes: dict[str, str | float | int] = {
            "title": self.system.title, "cells": self.model.cells, "lines": len(self.model.names),
            "length": sum(x.length for x in self.model.models), "static_path": self.found.summary,
            "static_residual": self.found.residual,
        }  # fmt: skip
        target = io.BytesIO() if isinstance(self.target, io.BytesIO) else self.target
        self._root = target
        return Recorder(
            target, grid_s=np.zeros(1), fields=fields_of(self.system), step_fields=(), attributes=attributes,
            texts={"scene": text}, outputs=len(self.times) + 1, overwrite=True, templates=cache_folder().parent,
        )  # fmt: skip

    def _output(self, solver: SystemSolver) -> None:
        """Record points, bodies and lines as they are."""
        values = values_of(self.system, self.model, solver, self.state, self.t)
        self.recorder.save(self.t, values, [("lines", 0.0, 0.0)])
        self._look_for_dry_bodies()
        for line_, x, state, work in zip(self.lines, solver.lines, self.state.lines, solver.work, strict=True):
            line_.output(self.t, x.ends, state, work)

    def _look_for_dry_bodies(self) -> None:
        """An event where a body that counts as submerged has risen out of the water."""
        fluid = self.system.environment.fluid
        if fluid is None or fluid.surface is None:
            return
        for body, row in zip(self.model.bodies, self.state.bodies, strict=True):
            given = self.system.free_bodies[body.name]
            centre = row[PLACE:FRAME] + row[FRAME:V].reshape(3, 3) @ np.array(given.centre_of_buoyancy)
            above = float(centre[2]) - fluid.surface
            if given.volume and above > 0.0 and body.name not in self._dry:
                self._dry.add(body.name)
                text = f"body {body.name}: the centre of its volume is {above:.4g} m above the surface, but all of its"
                self.recorder.event(self.t, 0.0, 0.0, "body out of water", f"{text} buoyancy still lifts it")

    def _close(self, status: str, message: str) -> None:
        """Close all, with the events of the lines in the result of the points too, and put the lines into its file."""
        images = {}
        for line in self.lines:
            for t, s_a, s_b, kind, text in line.close(self.t, status, message):
                self.recorder.event(t, s_a, s_b, kind, f"line {line.name}: {text}")
            images[line.name] = line.target.getvalue()
        self.recorder.close(status, message)
        write_lines(self._root, images)
        if isinstance(self.target, io.BytesIO) and isinstance(self._root, io.BytesIO):
            self.target.write(self._root.getvalue())

    # --- what is computed ---------------------------------------------------------------------------

    def record_equilibrium(self) -> None:
        """Record the equilibrium that was found."""
        try:
            solver = self.found.solver
            solver.keep_books([line.books for line in self.lines])
            solver.evaluate_forces(self.state, 0.0)
            for line, x, state in zip(self.lines, solver.lines, self.state.lines, strict=True):
                line.note_equilibrium(x, state, None)
            self._output(solver)
            text = f"equilibrium: {self.found.summary}; residual force {self.found.residual:.2g} N"
            self._close("complete", text)
        except LineFailed as failed:
            raise self.failed(failed) from None

    def record_motion(self, reporter: ProgressReporter, interrupted: Callable[[], bool]) -> None:
        """Compute the motion and record it; KeyboardInterrupt after `interrupted`, with the file complete till then."""
        try:
            self.begin_motion()

            def look() -> None:
                reporter(self.t, self.steps, 0, self.model.models[0].zones)
                if interrupted():
                    raise KeyboardInterrupt

            for stop in self.stops():
                self.go_to(stop, look)
            reporter(self.t, self.steps, 0, self.model.models[0].zones, True)
            self.finish()
        except LineFailed as failed:
            raise self.failed(failed) from None
        except KeyboardInterrupt:
            self.finish("interrupted", f"stopped from outside at t = {self.t:.6g} s")
            raise

    def begin_motion(self) -> None:
        """Make the start ready for steps, and record it."""
        time = self.system.require_time()
        self._begin, self._last_step = clock.process_time(), 0.0
        self.solver = SystemSolver(joined_lines(self.model, 0.0), len(self.model.free), self.model.body_numbers(0.0))
        self.solver.keep_books([line.books for line in self.lines])
        self._settle(self.solver)
        if self.system.environment.waves is not None:
            text = "waves act on lines and points, not on the body"
            for body in self.model.bodies:
                self.recorder.event(0.0, 0.0, 0.0, "waves on body neglected", f"body {body.name}: {text}")
        for line, x, state in zip(self.lines, self.solver.lines, self.state.lines, strict=True):
            line.note_equilibrium(x, state, 0.0)
            line.diagnostics.scheme(time.rho_inf)
        self._output(self.solver)
        self._other = self.state.copy()

    def stops(self) -> list[float]:
        """Times (s) at which a step ends: outputs, and where loads jump."""
        time = self.system.require_time()
        given = [*(m.ends.breaks for m in self.model.models), *(b.breaks for b in self.model.bodies)]
        self._breaks = sorted({x for each in given for x in each if x < time.duration})
        return apart([*self.times, *self._breaks], 0.0, time.step or time.duration)

    def go_to(self, stop: float, look: Callable[[], None] = lambda: None) -> None:
        """Steps to `stop` (s), equal ones, with what is due there; look: called every LOOK steps."""
        time = self.system.require_time()
        step = time.step or time.duration
        span, first = stop - self.t, self.t
        count = parts(span, step)
        for k in range(count):
            self._step(stop if k == count - 1 else first + (k + 1) * span / count, time.rho_inf)
            if self.steps % LOOK == 0:
                self._look(self.solver)
                look()
        if any(abs(x - stop) <= SAME_STOP * step for x in self._breaks):
            self.loaded = self.t
            for model in self.model.models:
                model.ends.set_loads(self.t)
            self._settle(self.solver)
            self._last_step = 0.0
        if any(abs(x - stop) <= SAME_STOP * step for x in self.times):
            self._look(self.solver)
            self._output(self.solver)

    def finish(self, status: str = "complete", message: str = "") -> None:
        """Write what waits, and close the file."""
        for line in self.lines:
            if status == "complete":
                line.write_down()
            else:
                with suppress(LineFailed):
                    line.write_down()
        self._close(status, message or f"{self.steps} steps")

    def failed(self, failed: LineFailed) -> ComputationError:
        """What a failure becomes: a file with all that there is, and an error that names the line."""
        error = named(failed, self.model)
        for line in self.lines:
            if line.number == failed.line or failed.line < 0:
                s = failed.s or 0.0
                line.events.event(failed.t or 0.0, s, s, failed.outcome.name.lower(), str(error))
        with suppress(ResultError):
            self.finish("failed", str(error))
        return error

    def _settle(self, solver: SystemSolver) -> None:
        """Accelerations and tensions that are consistent with positions, velocities and loads."""
        step = self.system.require_time().step or 1.0
        accelerations: list[Floats] = []
        for line, model in zip(self.lines, self.model.models, strict=True):
            accelerations.append(model.ends.acceleration(self.t, 1e-3 * step))
            model.ends.at(self.t)
            model.sea.at(self.t)
            line.books.velocity[:] = model.ends.velocity
        self.model.load_bodies(self.t, solver.bodies, self.loaded)
        taken = solver.consistent_accelerations(self.state, accelerations, self.t)
        if taken.outcome != Outcome.OK:
            raise self._stopped(solver, taken, 0.0)

    def _step(self, end: float, rho: float) -> None:
        """To `end` (s), in one step or in halves."""
        solver, shortest = self.solver, SHORTEST * (end - self.t)
        dt, repeats = end - self.t, 0
        while self.t < end:
            dt = min(dt, end - self.t)
            t = end if end - self.t - dt < 0.5 * shortest else self.t + dt
            for line, model in zip(self.lines, self.model.models, strict=True):
                model.ends.at(t)
                model.sea.at(t)
                line.books.velocity[:] = model.ends.velocity
            self.model.load_bodies(t, solver.bodies, self.loaded)
            taken = solver.step(self.state, self._other, t - self.t, rho, self._last_step, t)
            if taken.outcome != Outcome.OK:
                dt, repeats = 0.5 * dt, repeats + 1
                if dt < shortest:
                    raise self._stopped(solver, taken, 2.0 * dt)
                continue
            self._last_step = t - self.t
            self.t, self.state, self._other = t, self._other, self.state
            self.steps += 1
            cpu = clock.process_time() - self._begin
            for line, work in zip(self.lines, solver.work, strict=True):
                line.log(t, self._last_step, taken, repeats, work, cpu)
            repeats = 0

    def _stopped(self, solver: SystemSolver, taken: SystemTaken, dt: float) -> LineFailed:
        """Why no step leads on."""
        detail = f"smallest step tried {dt:.3g} s; {taken.iterations} Newton iterations in the last try"
        if dt == 0.0:
            detail = "no accelerations are consistent with the shape and the loads"
        s = None
        if taken.line >= 0:
            nodes = solver.lines[taken.line].line.s
            s = float(nodes[min(max(taken.where, 0), nodes.size - 1)])
        return LineFailed(taken.line, taken.outcome, self.t, s, detail)

    def _look(self, solver: SystemSolver) -> None:
        """Whether meshes resolve the lines, and sections bear them."""
        for line, state, work in zip(self.lines, self.state.lines, solver.work, strict=True):
            line.judge(self.t, work.report[BEND : TWIST_NODE + 1].tolist(), state)


def run_system(
    system: System, target: Path | io.BytesIO, text: str, reporter: ProgressReporter, interrupted: Callable[[], bool]
) -> None:
    """Compute the motion of a system into a file or into memory."""
    run = SystemRun(system, target, text, moves=True)
    reporter.begin(RESULT, first_resolution(run.scenes[0]))
    run.record_motion(reporter, interrupted)


def static_system(system: System, target: Path | io.BytesIO, text: str) -> None:
    """Compute the equilibrium of a system under full loads into a file or into memory."""
    SystemRun(system, target, text, moves=False).record_equilibrium()
