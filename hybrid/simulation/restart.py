"""What a result leaves to be done: the rest of a run that was cut off, more of it, or other loads from some time on."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

import numpy as np

from hybrid.errors import Complaint, ResultError, SceneError
from hybrid.model.build import Model, build
from hybrid.model.ends import EndConditions
from hybrid.model.lines_contact import passing_each_other
from hybrid.model.output_points import OutputPoints
from hybrid.model.payout import longest_out, winch_at, winch_side
from hybrid.model.resolution import Resolution
from hybrid.model.self_reach import self_reach
from hybrid.scene.motion_checks import check_motions
from hybrid.scene.read import as_scene_or_system, parse_either, parse_scene, scene_text
from hybrid.scene.schema import Scene
from hybrid.simulation.restore import kept_resolution, refused, resolution_from, restored_points
from hybrid.store.checkpoint import Checkpoint, read_before, read_checkpoint
from hybrid.store.hdf5_file import opened
from hybrid.store.named_arrays import Tree
from hybrid.store.reader import Result, open_result

if TYPE_CHECKING:  # its tables take long to make
    from hybrid.model.system import SystemResolution
    from hybrid.scene.system import System

# What may be other from some time on: it acts from outside, and nothing of the cable's state hangs on it.
MAY_CHANGE = (
    "environment.fluid.current", "environment.fluid.waves", "time.duration",
    *(f"ends.{end}.{key}" for end in ("start", "end") for key in ("motion", "force", "thrust", "moment")),
)  # fmt: skip
MAY_CHANGE_OF_LINES = (
    "environment.fluid.current", "environment.fluid.waves", "time.duration",
    *(f"points.NAME.{key}" for key in ("motion", "force", "moment")),
    *(f"bodies.NAME.{key}" for key in ("motion", "force", "moment")),
)  # fmt: skip
# Of the length, and of the length in the time of a transverse wave: what an end may jump by, and its velocity.
SAME_PLACE, SAME_SPEED = 1e-6, 1e-3
SAME_INTERVAL = 1e-9  # part of the interval of outputs: round-off


S = TypeVar("S")


@dataclass(frozen=True)
class LoadChange(Generic[S]):
    """From time t (s) on, this scene, of one cable or of several lines, holds."""

    t: float
    scene: S


@dataclass(frozen=True)
class RemainingRun:
    """What is to be done: a scene, what changes later, and where to begin.

    before: what was found before the run, of what it is part of; {}: nothing, it begins with `resolution`.  anew: from
    t = 0, not from the checkpoint; reached: s, where it begins; points: of the result, None if it is computed anew.
    """

    scene: Scene
    changes: tuple[LoadChange[Scene], ...]
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


class RemainingLines(NamedTuple):
    """What is to be done with several lines; anew, reached: as of `RemainingRun`."""

    scene: System
    changes: tuple[LoadChange[System], ...]
    anew: bool
    reached: float


def remaining(
    path: Path, until: float | None = None, settings: Sequence[str] = (), start: float | None = None
) -> RemainingRun | RemainingLines:
    """What a result leaves to be done, as of `remaining_run`, of one line or of several."""
    lines = remaining_system(path, until, settings, start)
    return remaining_run(path, until, settings, start) if lines is None else lines


def remaining_system(
    path: Path, until: float | None = None, settings: Sequence[str] = (), start: float | None = None
) -> RemainingLines | None:
    """What a result of several lines leaves to be done, as of `remaining_run`; None: it is of one cable.

    ResultError: nothing is left to do; SceneError: what is asked cannot be.
    """
    with open_result(path) as result:
        if not result.lines:
            return None
        found, _ = parse_either(result.scene_text)
        if isinstance(found, Scene):
            return None
        meets = _knows_lines_that_meet(path)
        found = _as_often(as_begun(found, result, meets), result)
        done, reached = result.done, float(result.times[-1]) if len(result.times) else 0.0
        changes = tuple(LoadChange(t, as_begun(_several(text), result, meets)) for t, text in _told(path, result))
    if start is not None and not settings:
        raise _refused("from", f"{start:g} s", "a change from then on", "name it with --set KEY=VALUE")
    if until is None and not settings:
        if done:
            fix = "--until T goes on beyond its end, --set KEY=VALUE --from T changes a load"
            raise ResultError(f"{path} is complete: there is nothing left to do\n    try:      {fix}")
        return RemainingLines(found, changes, False, reached)
    if until is not None:
        found, changes = _longer_lines(found, changes, until, reached)
    if not settings:
        return RemainingLines(found, changes, False, reached)
    begin = reached if start is None else start
    last = changes[-1] if changes else LoadChange(0.0, found)
    changed = _several(scene_text(last.scene), settings)
    end = changed.require_time().duration
    if until is not None and end != until:
        raise _refused("time.duration", f"{end:g} s", f"{until:g} s, as until says, or nothing", "say it once")
    _check_lines(last, changed, kept_resolution(found, path), begin, end)
    if end != found.require_time().duration:
        found, changes = _longer_lines(found, changes, end, reached)
    anew = begin < reached
    return RemainingLines(found, (*changes, LoadChange(begin, changed)), anew, 0.0 if anew else reached)


def _several(text: str, settings: Sequence[str] = ()) -> System:
    """Several lines, which a text is known to be of."""
    found, _ = parse_either(text, overrides=settings)
    assert not isinstance(found, Scene)
    return found


def _longer_lines(
    system: System, changes: Sequence[LoadChange[System]], until: float, reached: float
) -> tuple[System, tuple[LoadChange[System], ...]]:
    """As `_longer`, of several lines."""
    _refuse_what_is_no_later_time(until, reached, "hybrid.open(path).lines[name].at(t=...)")
    _refuse_before_changes(changes, until)
    every = system.output_interval
    other = tuple(LoadChange(x.t, _several(_text_until(x.scene, until, every))) for x in changes)
    return _several(_text_until(system, until, every)), other


def _text_until(scene: Scene | System, until: float, every: float) -> str:
    """The text of a scene that ends at another time (s), with outputs every so many seconds."""
    data = scene.model_dump(mode="json", exclude_none=True)
    data["time"]["duration"] = until
    data.setdefault("output", {})["every"] = every
    return scene_text(as_scene_or_system(data))


def _check_lines(
    last: LoadChange[System], changed: System, resolution: SystemResolution, begin: float, end: float
) -> None:
    """As `_check`, of several lines: motions of held points and of bodies."""
    from hybrid.model.system import build_system

    _check_what_changes(last.t, begin, end, _differences(_plain(last.scene), _plain(changed)), MAY_CHANGE_OF_LINES)
    before = build_system(last.scene, resolution)
    after = build_system(changed, resolution, before)
    for name, one, other, joints in zip(before.names, before.models, after.models, before.joints, strict=True):
        other.ends.take_frames(one.ends)
        for k, end_name in enumerate(("start", "end")):
            if joints[k] < 0:
                point = getattr(changed.lines[name], end_name)
                body = changed.body_of(point)
                where = f"bodies.{changed.points[point].body}" if body is not None else f"points.{point}"  # type: ignore[union-attr]
                _refuse_jump(one, other, k, begin, f"{where}.motion")


def _knows_lines_that_meet(path: Path) -> bool:
    """Whether the version that wrote a result computed contact between lines without being asked."""
    with opened(path) as file, suppress(ResultError):  # without a checkpoint nothing goes on
        return "let_pass" in read_checkpoint(file).state
    return True


def as_begun(system: System, result: Result, meets: bool) -> System:
    """The same, without contact that nobody asks for, of a result of a version that computed none then.

    meets: whether it computed that between lines.
    """
    system, lines = system if meets else passing_each_other(system), dict(system.lines)
    for name, line in system.lines.items():
        if "self_contact" not in result.lines[name] and self_reach(system.scene_of(name)).may:
            lines[name] = line.model_copy(update={"contact": line.contact.model_copy(update={"self": False})})
    return system.model_copy(update={"lines": lines})


def changes_text(changes: Sequence[LoadChange[Any]]) -> str:
    """Phases as JSON, for the file; empty if there are none."""
    return json.dumps([{"t": x.t, "scene": scene_text(x.scene)} for x in changes]) if changes else ""


def _found(path: Path) -> tuple[Scene, tuple[LoadChange[Scene], ...], str, Tree, Checkpoint, OutputPoints]:
    with opened(path) as file:
        before, point = read_before(file), read_checkpoint(file)
        with open_result(path) as result:
            scene = _as_often(parse_scene(result.scene_text), result)
            status = result.status
            with refused(path):
                points = restored_points(result, longest_out(scene), scene.length if not winch_side(scene) else None)
            changes = tuple(LoadChange(t, parse_scene(text)) for t, text in _told(path, result))
    return scene, changes, status, before, point, points


def _as_often(scene: Any, result: Result) -> Any:
    """The scene of a result with the interval of its outputs, which a scene that does not say so had of its version."""
    if scene.output.every is not None or len(result.times) < 2:
        return scene
    every = float(result.times[1])
    if abs(scene.output_interval - every) <= SAME_INTERVAL * every:
        return scene
    return scene.model_copy(update={"output": scene.output.model_copy(update={"every": every})})


def _told(path: Path, result: Result) -> list[tuple[float, str]]:
    """Times (s) and scenes of the changes of a result; ResultError: they cannot be read."""
    try:
        return [(float(x["t"]), str(x["scene"])) for x in json.loads(result.changes_text or "[]")]
    except (ValueError, TypeError, KeyError) as error:
        advice = f"    detail:   {error}\n    try:      run its scene again"
        raise ResultError(f"{path} has changes that cannot be read\n{advice}") from None


def _refuse_what_is_no_later_time(until: float, reached: float, reading: str) -> None:
    """SceneError if a run that has reached a time (s) cannot go on to another; reading: how what is there is read."""
    if not math.isfinite(until):
        raise _refused("until", f"{until:g} s", "a time in s", f"--until {2.0 * reached or 100.0:g}")
    if until < reached:
        expected = f"a time after {reached:g} s, up to which it is computed"
        raise _refused("until", f"{until:g} s", expected, f"the file holds everything before: {reading}")


def _refuse_before_changes(changes: Sequence[LoadChange[Any]], until: float) -> None:
    """SceneError if a run is to end before a change that was asked for."""
    later = [x.t for x in changes if x.t >= until]
    if later:
        fix = "a later end; a change that was asked for cannot be taken back"
        raise _refused("until", f"{until:g} s", f"a time after the change at {later[0]:g} s", fix)


def _longer(
    scene: Scene, changes: Sequence[LoadChange[Scene]], until: float, reached: float
) -> tuple[Scene, tuple[LoadChange[Scene], ...]]:
    """The same until another time, with outputs as often as before."""
    _refuse_what_is_no_later_time(until, reached, "hybrid.open(path).at(t=...)")
    _refuse_before_changes(changes, until)
    every = scene.output_interval
    out, longest = parse_scene(_text_until(scene, until, every)), longest_out(scene)
    if longest_out(out) > longest * (1.0 + SAME_PLACE):
        expected = f"a time up to which at most {longest:.6g} m are out, for which the result has points"
        fix = f"run the scene again with {winch_at(scene)}.longest"
        raise _refused("until", f"{until:g} s, when {longest_out(out):.6g} m are out", expected, fix)
    return out, tuple(LoadChange(x.t, parse_scene(_text_until(x.scene, until, every))) for x in changes)


def _check(last: LoadChange[Scene], changed: Scene, resolution: Resolution, begin: float, end: float) -> None:
    """Refuse what cannot be other from `begin` on, and prescribed motions that would jump then."""
    _check_what_changes(last.t, begin, end, _differences(_plain(last.scene), _plain(changed)), MAY_CHANGE)
    check_motions(changed)
    before, after = build(last.scene, resolution), build(changed, resolution)
    after.ends.take_frames(before.ends)
    for k, name in enumerate(("start", "end")):
        _refuse_jump(before, after, k, begin, f"ends.{name}.motion")


def _check_what_changes(
    since: float, begin: float, end: float, changed: Sequence[tuple[str, str]], allowed: Sequence[str]
) -> None:
    """SceneError: a change at `begin` is before the last one, `since`, or not before the end (s), or of what stays."""
    if not since <= begin < end:
        fix = "a later end as well, --until T" if begin == end else ""
        raise _refused("from", f"{begin:g} s", f"a time from {since:g} s on and before the end, {end:g} s", fix)
    for where, value in changed:
        key = re.sub(r"^(points|bodies)\.[^.\[]+", r"\1.NAME", where)
        if not any(key == x or key.startswith((f"{x}.", f"{x}[")) for x in allowed):
            fix = "run the changed scene from its start"
            raise _refused(where, value, f"one of {', '.join(allowed)}: a run in progress keeps the rest", fix)


def _refuse_jump(before: Model, after: Model, k: int, t: float, where: str) -> None:
    """SceneError: the motion of end k of a line, which stands at `where`, would jump at t (s)."""
    held, length = bool(before.ends.values.held[k]), after.length
    one, other = (_place(model.ends, k, t) for model in (before, after))
    apart, faster, turned, spun = (float(np.linalg.norm(a - b)) for a, b in zip(one, other, strict=True))
    jumps = held and (apart > SAME_PLACE * length or faster > SAME_SPEED * length / after.time_scale)
    if jumps or turned > SAME_PLACE or spun > SAME_SPEED / after.time_scale:
        sizes = ((apart, "m"), (faster, "m/s"), (turned, "rad"), (spun, "rad/s"))
        by = ", ".join(f"{x:.3g} {unit}" for x, unit in sizes if x > 1e-9)
        fix = "times count from the start of the run: travel {by, over, begin} starts from rest where the end is"
        expected = "a motion that goes on where the one before it is"
        raise _refused(where, f"one that jumps by {by} at t = {t:g} s", expected, fix)


def _place(ends: EndConditions, k: int, t: float) -> tuple[np.ndarray, ...]:
    """Position (3,) m, velocity (3,) m/s, frame (9,) and its spin (3,) rad/s of an end."""
    now = ends.at(t)
    return now.position[k].copy(), ends.velocity[k].copy(), now.frame[k].copy(), now.spin[k].copy()


def _plain(scene: Scene | System) -> dict[str, Any]:
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
