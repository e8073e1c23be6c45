"""What a result leaves to be done: the rest of a run that was cut off, more of it, or other loads from some time on."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.errors import Complaint, ResultError, SceneError
from hybrid.model.build import build
from hybrid.model.ends import EndConditions
from hybrid.model.output_points import OutputPoints
from hybrid.model.payout import longest_out, winch_at, winch_side
from hybrid.model.plan import output_interval
from hybrid.model.resolution import Resolution
from hybrid.model.self_reach import self_reach
from hybrid.scene.combinations import refuse_use
from hybrid.scene.motion_checks import check_motions
from hybrid.scene.read import parse_either, parse_scene, scene_text
from hybrid.scene.schema import Scene
from hybrid.simulation.restore import refused, resolution_from, restored_points
from hybrid.store.checkpoint import Checkpoint, read_before, read_checkpoint
from hybrid.store.hdf5_file import opened
from hybrid.store.named_arrays import Tree
from hybrid.store.reader import Result, open_result

if TYPE_CHECKING:  # its tables take long to make
    from hybrid.scene.system import System

# What may be other from some time on: it acts from outside, and nothing of the cable's state hangs on it.
MAY_CHANGE = (
    "environment.fluid.current", "environment.fluid.waves", "time.duration",
    *(f"ends.{end}.{key}" for end in ("start", "end") for key in ("motion", "force", "thrust", "moment")),
)  # fmt: skip
# Of the length, and of the length in the time of a transverse wave: what an end may jump by, and its velocity.
SAME_PLACE, SAME_SPEED = 1e-6, 1e-3


@dataclass(frozen=True)
class LoadChange:
    """From time t (s) on, this scene holds."""

    t: float
    scene: Scene


@dataclass(frozen=True)
class RemainingRun:
    """What is to be done: a scene, what changes later, and where to begin.

    before: what was found before the run, of what it is part of; {}: nothing, it begins with `resolution`.  anew: from
    t = 0, not from the checkpoint; reached: s, where it begins; points: of the result, None if it is computed anew.
    """

    scene: Scene
    changes: tuple[LoadChange, ...]
    resolution: Resolution
    before: Tree
    anew: bool
    reached: float
    points: OutputPoints | None


def remaining_run(
    path: Path, until: float | None = None, settings: Sequence[str] = (), start: float | None = None
) -> RemainingRun:
    """What a result leaves to be done, if it is to go on until then, with these settings from `start` (s) on.

    ResultError: nothing, or it cannot be told; SceneError: what is asked cannot be.
    """
    scene, changes, status, before, point, points = _found(path)
    with refused(path):
        resolution = resolution_from(point.resolution, scene)
    if start is not None and not settings:
        raise _refused("from", f"{start:g} s", "a change from then on", "name it with --set KEY=VALUE")
    if until is None and not settings:
        if status == "complete" and not before:
            fix = "--until T goes on beyond its end, --set KEY=VALUE --from T changes a load"
            raise ResultError(f"{path} is complete: there is nothing left to do\n    try:      {fix}")
        return RemainingRun(scene, changes, resolution, before, False, point.t, points)
    if until is not None:
        scene, changes = _longer(scene, changes, until, point.t)
    anew = False
    if settings:
        begin = point.t if start is None else start
        last = changes[-1] if changes else LoadChange(0.0, scene)
        changed = parse_scene(scene_text(last.scene), overrides=settings)
        end = changed.require_time().duration
        if until is not None and end != until:
            raise _refused("time.duration", f"{end:g} s", f"{until:g} s, as until says, or nothing", "say it once")
        _check(last, changed, resolution, begin, end)
        if end != scene.require_time().duration:
            scene, changes = _longer(scene, changes, end, point.t)
        changes, anew = (*changes, LoadChange(begin, changed)), begin < point.t
    reached, kept = (0.0, None) if anew else (point.t, points)
    return RemainingRun(scene, changes, resolution, {}, anew, reached, kept)


def remaining_system(
    path: Path, until: float | None = None, settings: Sequence[str] = (), start: float | None = None
) -> System | None:
    """The scene of a result of several lines, if it is to go on until then; None: it is of one cable.

    ResultError: nothing is left to do; SceneError: what is asked cannot be.
    """
    with open_result(path) as result:
        if not result.lines:
            return None
        found, _ = parse_either(result.scene_text)
        if isinstance(found, Scene):
            return None
        found = as_begun(found, result)
        done, reached = result.done, float(result.times[-1]) if len(result.times) else 0.0
    if settings or start is not None:
        refuse_use(found, "changed loads", given=", ".join(settings) or f"from {start:g} s")
    if until is None:
        if done:
            fix = "--until T goes on beyond its end"
            raise ResultError(f"{path} is complete: there is nothing left to do\n    try:      {fix}")
        return found
    _refuse_what_is_no_later_time(until, reached, "hybrid.open(path).lines[name].at(t=...)")
    data = found.model_dump(mode="json", exclude_none=True)
    data["time"]["duration"] = until
    data.setdefault("output", {})["every"] = output_interval(found)
    longer, _ = parse_either(scene_text(type(found).model_validate(data)))
    return None if isinstance(longer, Scene) else longer


def as_begun(system: System, result: Result) -> System:
    """The same, without contact that no line asks for, in lines of a result of a version that computed none then."""
    lines = dict(system.lines)
    for name, line in system.lines.items():
        if "self_contact" not in result.lines[name] and self_reach(system.scene_of(name)).may:
            lines[name] = line.model_copy(update={"contact": line.contact.model_copy(update={"self": False})})
    return system.model_copy(update={"lines": lines})


def changes_text(changes: Sequence[LoadChange]) -> str:
    """Phases as JSON, for the file; empty if there are none."""
    return json.dumps([{"t": x.t, "scene": scene_text(x.scene)} for x in changes]) if changes else ""


def _found(path: Path) -> tuple[Scene, tuple[LoadChange, ...], str, Tree, Checkpoint, OutputPoints]:
    with opened(path) as file:
        before, point = read_before(file), read_checkpoint(file)
        with open_result(path) as result:
            scene = parse_scene(result.scene_text)
            status = result.status
            with refused(path):
                points = restored_points(result, longest_out(scene), scene.length if not winch_side(scene) else None)
            try:
                told = json.loads(result.changes_text or "[]")
                changes = tuple(LoadChange(float(x["t"]), parse_scene(x["scene"])) for x in told)
            except (ValueError, TypeError, KeyError) as error:
                advice = f"    detail:   {error}\n    try:      run its scene again"
                raise ResultError(f"{path} has changes that cannot be read\n{advice}") from None
    return scene, changes, status, before, point, points


def _refuse_what_is_no_later_time(until: float, reached: float, reading: str) -> None:
    """SceneError if a run that has reached a time (s) cannot go on to another; reading: how what is there is read."""
    if not math.isfinite(until):
        raise _refused("until", f"{until:g} s", "a time in s", f"--until {2.0 * reached or 100.0:g}")
    if until < reached:
        expected = f"a time after {reached:g} s, up to which it is computed"
        raise _refused("until", f"{until:g} s", expected, f"the file holds everything before: {reading}")


def _longer(
    scene: Scene, changes: Sequence[LoadChange], until: float, reached: float
) -> tuple[Scene, tuple[LoadChange, ...]]:
    """The same until another time, with outputs as often as before."""
    _refuse_what_is_no_later_time(until, reached, "hybrid.open(path).at(t=...)")
    later = [x.t for x in changes if x.t >= until]
    if later:
        fix = "a later end; a change that was asked for cannot be taken back"
        raise _refused("until", f"{until:g} s", f"a time after the change at {later[0]:g} s", fix)
    every = output_interval(scene)

    def other(scene: Scene) -> Scene:
        data = scene.model_dump(mode="json", exclude_none=True)
        data["time"]["duration"] = until
        data.setdefault("output", {})["every"] = every
        return parse_scene(scene_text(Scene.model_validate(data)))

    out, longest = other(scene), longest_out(scene)
    if longest_out(out) > longest * (1.0 + SAME_PLACE):
        expected = f"a time up to which at most {longest:.6g} m are out, for which the result has points"
        fix = f"run the scene again with {winch_at(scene)}.longest"
        raise _refused("until", f"{until:g} s, when {longest_out(out):.6g} m are out", expected, fix)
    return out, tuple(LoadChange(x.t, other(x.scene)) for x in changes)


def _check(last: LoadChange, changed: Scene, resolution: Resolution, begin: float, end: float) -> None:
    """Refuse what cannot be other from `begin` on, and prescribed motions that would jump then."""
    if not last.t <= begin < end:
        fix = "a later end as well, --until T" if begin == end else ""
        raise _refused("from", f"{begin:g} s", f"a time from {last.t:g} s on and before the end, {end:g} s", fix)
    for where, value in _differences(_plain(last.scene), _plain(changed)):
        if not any(where == x or where.startswith((f"{x}.", f"{x}[")) for x in MAY_CHANGE):
            fix = "run the changed scene from its start"
            raise _refused(where, value, f"one of {', '.join(MAY_CHANGE)}: a run in progress keeps the rest", fix)
    refuse_use(changed, "changed loads", given="a change in mid-run")
    check_motions(changed)
    model = build(changed, resolution)
    before, after = build(last.scene, resolution).ends, model.ends
    after.take_frames(before)
    for k, name in enumerate(("start", "end")):
        held = bool(before.values.held[k])
        one, other = (_place(ends, k, begin) for ends in (before, after))
        apart, faster, turned, spun = (float(np.linalg.norm(a - b)) for a, b in zip(one, other, strict=True))
        jumps = held and (apart > SAME_PLACE * model.length or faster > SAME_SPEED * model.length / model.time_scale)
        if jumps or turned > SAME_PLACE or spun > SAME_SPEED / model.time_scale:
            sizes = ((apart, "m"), (faster, "m/s"), (turned, "rad"), (spun, "rad/s"))
            by = ", ".join(f"{x:.3g} {unit}" for x, unit in sizes if x > 1e-9)
            given = f"one that jumps by {by} at t = {begin:g} s"
            fix = "times count from the start of the run: travel {by, over, begin} starts from rest where the end is"
            expected = "a motion that goes on where the one before it is"
            raise _refused(f"ends.{name}.motion", given, expected, fix)


def _place(ends: EndConditions, k: int, t: float) -> tuple[np.ndarray, ...]:
    """Position (3,) m, velocity (3,) m/s, frame (9,) and its spin (3,) rad/s of an end."""
    now = ends.at(t)
    return now.position[k].copy(), ends.velocity[k].copy(), now.frame[k].copy(), now.spin[k].copy()


def _plain(scene: Scene) -> dict[str, Any]:
    return dict(scene.model_dump(mode="json", exclude_none=True))


def _differences(old: Any, new: Any, where: str = "") -> list[tuple[str, str]]:
    """Keys that differ, and what they are now."""
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        keys = [*old, *(k for k in new if k not in old)]
        found = [_differences(old.get(k), new.get(k), f"{where}.{k}" if where else k) for k in keys]
        return [x for each in found for x in each]
    return [] if old == new else [(where, str(new))]


def _refused(where: str, given: str, expected: str, fix: str) -> SceneError:
    return SceneError([Complaint(where, given, expected, fix)])
