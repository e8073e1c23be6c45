"""The loop over time, and the equilibrium of a scene: the only file that knows everyone.

run      integrate a scene over its duration
static   find its equilibrium
"""

from __future__ import annotations

import io
import signal
import threading
import time as clock
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hybrid.adapt.manager import UserCriterion
from hybrid.adapt.table import CRITERIA
from hybrid.correction import Correction
from hybrid.errors import ComputationError, SceneError
from hybrid.model.build import Model, build, given_zones
from hybrid.model.coarse import coarser, refined
from hybrid.model.mesh import Zone
from hybrid.model.plan import output_times, step_ends
from hybrid.model.reasons import reasons_against
from hybrid.motion import Motion
from hybrid.physics.loads import FRICTION, SEABED, SURFACE
from hybrid.results.probes import Observer, output_points
from hybrid.results.read import Result, open_result
from hybrid.results.record import Field, Recorder
from hybrid.scene.motion import check_motions
from hybrid.scene.read import scene_text
from hybrid.scene.schema import AdaptiveModel, Scene, missing_time
from hybrid.solve.statics import Equilibrium, solve_statics
from hybrid.solve.timestep import POWERS
from hybrid.watch import Watch
from hybrid.zoning import Zoning, first_zones, manager_for, zones_of_start

HELD = (
    "zones stay rod: in equilibrium, catenary where the criteria allow it is further from the rod than the tolerance; "
    "more mesh.cells, or a larger model.tolerance, let them move"
)
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
    Field("pull_start", "N", "magnitude of the force that holds (or loads) the start, at every step"),
    Field("pull_end", "N", "the same at the end; of an end body: tension of the last cell"),
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
    criterion: UserCriterion | None = None,
) -> Result:
    """Integrate a scene over its duration.

    output: the HDF5 file to write; None keeps the result in memory.  progress: True for a
    live line, or a function called about ten times a second.  overwrite: replace an
    existing result (never another program's file).  criterion: for zones that move, one more: it gets a
    `hybrid.Look` at every step and gives a number (N+1,) per node, 1 or more where the cable must be a rod.

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
    zoning = None
    if criterion is not None and model.layout is None:
        raise TypeError("a criterion is for zones that move: the scene's model is not adaptive")
    if model.layout is not None:
        model, equilibrium, zoning = _first_zones(scene, model, 0.0, criterion)
    else:
        equilibrium = _equilibrium(scene, model, 0.0) if scene.initial.kind == "equilibrium" else None
    outputs = output_times(scene)
    stops = sorted({*outputs, *(b for b in model.ends.breaks if b < outputs[-1])})
    kinds = {"rod", "catenary"} if zoning else None
    observer = Observer(
        model.line,
        model.sea.values,
        model.zones,
        output_points(scene.output.points, model.length),
        True,
        model.attached,
        kinds,
        [(x.name, x.ratio) for x in CRITERIA] if scene.output.criteria and zoning else (),
        model.follows_error and bool(scene.output.errors),
        model.corrected,
    )
    correction = Correction(model, zoning.torque if zoning else None) if model.follows_error else None
    target = _target(output)
    recorder = _recorder(scene, model, observer, target, overwrite, len(outputs), equilibrium)
    if zoning and zoning.manager.held:
        recorder.event(0.0, 0.0, model.length, "zones held", HELD)
    with recorder, _interrupts() as interrupted, _Told(progress, scene.time.duration, model.zones) as told:
        motion = Motion(scene, model, observer, recorder, target, equilibrium, zoning, correction)
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

    def __call__(self, motion: Motion, finished: bool = False) -> None:
        if self._tell is None:
            return
        now = clock.perf_counter() - self._begin
        if finished or now - self._last > REPORT_EVERY:
            self._last = now
            self._tell(Progress(motion.t, self._duration, motion.steps, motion.iterations, motion.model.zones, now))


def static(scene: Scene, output: str | Path | None = None, *, overwrite: bool = True) -> Result:
    """Find the equilibrium of a scene at t = 0 under its full loads; the result has one output.  Errors as of `run`."""
    check_motions(scene)
    if scene.solver == "shooting":
        from hybrid.arbitrate import static_shooting

        return static_shooting(scene, output, overwrite)
    model = build(scene)
    if model.layout is not None:
        model, equilibrium, _ = _first_zones(scene, model, np.inf, None, at_rest=True)
        assert equilibrium is not None
        found = equilibrium
    else:
        found = _equilibrium(scene, model, np.inf)
    observer = Observer(
        model.line,
        model.sea.values,
        model.zones,
        output_points(scene.output.points, model.length),
        False,
        model.attached,
        errors=model.follows_error and bool(scene.output.errors),
        corrected=model.corrected,
    )
    target = _target(output)
    with _recorder(scene, model, observer, target, overwrite, 0, found) as recorder:
        ends = model.ends.at(np.inf)
        watch = Watch(recorder, model)
        watch.equilibrium(found)
        watch.strain(0.0, found.state)
        watch.mesh(0.0, found.state)
        stop = watch.still(ends, found.state)
        if stop is not None:
            raise ComputationError(stop[0], None, float(model.line.s[stop[1]]))
        shift = None
        if model.follows_error:
            model.sea.at(np.inf)
            correction = Correction(model)
            correction.begin(ends, found.state, at_rest=True, rubbed=found.rubbed)
            shift = correction.shift(found.state)
        values = observer.values(ends, found.state, found.report, np.zeros(len(POWERS)), shift=shift)
        recorder.save(0.0, values, observer.zone_rows)
        recorder.close("complete", f"equilibrium: {found.summary}; out of balance {found.residual:.2g} N")
    return open_result(target)


def _equilibrium(scene: Scene, model: Model, t: float) -> Equilibrium:
    """Equilibrium with the loads of time t; infinity stands for loads that have grown to their full size."""
    try:
        return _by_coarser(scene, model, t) or _statics(scene, model, t)
    except ComputationError as failed:
        reasons = reasons_against(scene, (bool(model.line.spin[0]), bool(model.line.spin[-1])))
        if not reasons:
            raise
        roads = failed.detail.splitlines()
        tried = f"{len(roads)} ways to an equilibrium were tried, the last: {roads[-1].strip()}"
        because = "\n              ".join([*reasons, tried])
        raise ComputationError(failed.outcome, None, failed.s, because) from None


def _statics(scene: Scene, model: Model, t: float, quick: bool = False) -> Equilibrium:
    return solve_statics(
        model.line, model.sea.at(t), model.ends.at(t), model.start, model.length, model.tension_scale,
        model.slack_floor, take_slack=model.slack == "warn" and not quick, shape=model.start_shape,
        others=model.other_starts, settle=getattr(scene.initial, "friction", "") == "settled", quick=quick,
    )  # fmt: skip


def _settles(scene: Scene, model: Model, t: float) -> bool:
    """Whether friction holds the cable where it starts, so that no other start will do."""
    asked = getattr(scene.initial, "friction", "") == "settled"
    return bool(model.line.bits & FRICTION) and (asked or not model.ends.at(t).held.any())


def _by_coarser(scene: Scene, model: Model, t: float) -> Equilibrium | None:
    """The equilibrium of a line of many cells: by Newton at once, or from that of a coarser mesh, easier to find.

    None: neither is, or there are few cells.
    """
    fewer = coarser(model)
    if fewer is None or _settles(scene, model, t):
        return None
    try:
        return _statics(scene, model, t, quick=True)
    except ComputationError:
        pass
    try:
        coarse = _by_coarser(scene, fewer, t) or _statics(scene, fewer, t)
        start = refined(coarse.state, fewer.line, model.line)
        shape = f"the equilibrium with {fewer.cells} cells"
        return _statics(scene, replace(model, start=start, start_shape=shape, other_starts=()), t, quick=True)
    except ComputationError:
        return None


def _first_zones(
    scene: Scene, model: Model, t: float, criterion: UserCriterion | None, at_rest: bool = False
) -> tuple[Model, Equilibrium | None, Zoning]:
    """Zones, equilibrium if one is asked for, and what will move the zones."""
    asked = scene.model
    assert isinstance(asked, AdaptiveModel) and model.layout is not None
    given = given_zones(scene, model.layout)
    manager = manager_for(model, asked.tolerance, asked.dwell, given, scene.time.step if scene.time else 0.0, criterion)
    equilibrium = None
    if at_rest or scene.initial.kind == "equilibrium":
        model, equilibrium = first_zones(model, manager, t, _equilibrium(scene, model, t))
    else:
        model = zones_of_start(model, manager)
    return model, equilibrium, Zoning(model, manager, loaded=asked.joint == "curvature")


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
        attributes |= {"static_path": found.summary, "static_residual": found.residual}
    fixed = _surroundings(model)
    if scene.output.history:
        points = np.array(scene.output.history)
        fixed.append(
            (Field("history", "m", "arc lengths to follow in histories", (points.size,), ("history",)), points)
        )
    recorder = Recorder(
        target, grid_s=observer.grid.s, fields=observer.fields, step_fields=STEP_FIELDS if outputs else (),
        attributes=attributes, scene_text=scene_text(scene), fixed=fixed, outputs=outputs + 1, overwrite=overwrite,
    )  # fmt: skip
    for s, text in _clamps_left_out(scene, model):
        recorder.event(0.0, s, s, "clamp left out", text)
    return recorder


def _clamps_left_out(scene: Scene, model: Model) -> Iterator[tuple[float, str]]:
    """Clamps that lie in a catenary zone because they hardly shift the cable; who wants their moment has to ask."""
    if model.layout is None:
        return
    line = model.line
    for name, end, cell in (("start", scene.ends.start, 0), ("end", scene.ends.end, -1)):
        if end.kind not in ("clamped", "guided") or line.spin[cell]:
            continue
        s, far = float(line.s[cell]), float(line.s[-1])
        bend = float(model.cable.B[cell, :2].mean())
        weight = max(abs(float(model.cable.weight[cell])), 1e-9 * model.tension_scale / far)
        reach = min(4.0 * (bend / weight) ** (1.0 / 3.0), far)
        stretch = f"[0, {reach:.3g}]" if cell == 0 else f"[{far - reach:.5g}, {far:.5g}]"
        text = (
            f"the clamp at ends.{name} shifts the cable by less than the tolerance: it is left out, and has no moment, "
            f"as long as a catenary zone ends there; for its moment, and near resonance, say always_rod: [{stretch}]"
        )
        yield s, text


def _surroundings(model: Model) -> list[tuple[Field, np.ndarray]]:
    """What pictures show besides the cable: seabed, still water, what is attached."""
    line, sea = model.line, model.sea.values
    out: list[tuple[Field, np.ndarray]] = []
    if line.bits & SEABED:
        text = "plane of the seabed: unit normal n and offset c, n . x = c on it"
        out.append((Field("seabed", "", text, (4,), ("plane",), "inertial"), np.append(sea.normal, sea.offset)))
    if line.bits & SURFACE:
        out.append((Field("surface", "m", "height of still water"), np.array(sea.surface)))
    if model.attached:
        text = "arc lengths of floats, clumps and end bodies"
        out.append((Field("attached", "m", text, (len(model.attached),), ("attached",)), np.array(model.attached)))
    return out


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
