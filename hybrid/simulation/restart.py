"""What a result leaves to be done: the rest of a run that was cut off, more of it, or other loads from some time on."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np

from hybrid.errors import Complaint, ResultError, SceneError
from hybrid.model.build import Model
from hybrid.model.ends import EndConditions
from hybrid.model.lines_contact import passing_each_other
from hybrid.model.network import NetworkResolution, build_system
from hybrid.model.payout import longest_out, winch_side
from hybrid.model.sections import OutputPoints
from hybrid.model.self_reach import self_reach
from hybrid.scene.base import dotted
from hybrid.scene.read import as_scene, read_text, scene_text
from hybrid.scene.root import Scene
from hybrid.scene.schema import LineScene
from hybrid.simulation.restore import kept_resolution, refused, restored_points
from hybrid.store.checkpoint import read_before, read_checkpoint
from hybrid.store.hdf5_file import opened
from hybrid.store.named_arrays import Tree
from hybrid.store.reader import Result, open_result

# What may be other from some time on: it acts from outside, and nothing of the cable's state hangs on it.
MAY_CHANGE = (
    "environment.fluid.current", "environment.fluid.waves", "time.duration",
    *(f"ends.{end}.{key}" for end in ("start", "end") for key in ("motion", "force", "thrust", "moment")),
    *(f"{what}.NAME.{key}" for what in ("points", "bodies") for key in ("motion", "force", "moment")),
)  # fmt: skip
# Of the length, and of the length in the time of a transverse wave: what an end may jump by, and its velocity.
SAME_PLACE, SAME_SPEED = 1e-6, 1e-3
SAME_INTERVAL = 1e-9  # part of the interval of outputs: round-off


S = TypeVar("S")


@dataclass(frozen=True)
class LoadChange(Generic[S]):
    """From time t (s) on, this scene holds."""

    t: float
    scene: S


@dataclass(frozen=True)
class Remaining(Generic[S]):
    """What is to be done with a result: a scene, what changes later, and where to begin.

    before: what was found before the run, of what it is part of; {}: nothing, it begins with `resolution`.  anew: from
    t = 0, not from the checkpoint; reached: s, where it begins; points: of the lines of the result by their names in
    the scene, None if it is computed anew; unasked: lines of the scene that nobody asked to go on without contact with
    themselves, as they do; parts: names of the user's own parts that the result was computed with.
    """

    scene: S
    changes: tuple[LoadChange[S], ...]
    resolution: NetworkResolution
    before: Tree
    anew: bool
    reached: float
    points: Mapping[str, OutputPoints] | None
    unasked: Sequence[str] = ()
    parts: Sequence[str] = ()


def remaining(
    path: Path, until: float | None = None, settings: Sequence[str] = (), start: float | None = None
) -> Remaining[Any]:
    """What a result leaves to be done, if it is to go on until then, with these settings from `start` (s) on.

    ResultError: nothing, or it cannot be told; SceneError: what is asked cannot be.
    """
    left, done = _found(path)
    if start is not None and not settings:
        raise _refused("from", f"{start:g} s", "a change from then on", "name it with --set KEY=VALUE")
    if until is None and not settings:
        if done:
            fix = "--until T goes on beyond its end, --set KEY=VALUE --from T changes a load"
            raise ResultError(f"{path} is complete: there is nothing left to do\n    try:      {fix}")
        return left
    left = replace(left, before={})
    if until is not None:
        left = _longer(left, until)
    if not settings:
        return left
    begin = left.reached if start is None else start
    last = left.changes[-1] if left.changes else LoadChange(0.0, left.scene)
    changed, _ = read_text(scene_text(last.scene), overrides=settings)
    end = changed.require_time().duration
    if until is not None and end != until:
        raise _refused("time.duration", f"{end:g} s", f"{until:g} s, as until says, or nothing", "say it once")
    _check(last, changed, left.resolution, begin, end)
    if end != left.scene.require_time().duration:
        left = _longer(left, end)
    left = replace(left, changes=(*left.changes, LoadChange(begin, changed)))
    return replace(left, anew=True, reached=0.0, points=None) if begin < left.reached else left


def _found(path: Path) -> tuple[Remaining[Any], bool]:
    """What is left of a result as it is, and whether that is nothing."""
    with opened(path) as file:
        before, point = read_before(file), read_checkpoint(file)
        with refused(path):
            state = point.state
            meets, reached = "let_pass" in state, max(point.t, float(state["t"]))
            parts = [*state.get("parts", {})]
        with open_result(path) as result:
            lines = dict(result.each_line())
            scene_of_file = read_text(result.scene_text)[0]
            scene = _as_often(as_begun(scene_of_file, lines, meets), result)
            told = [(t, as_begun(read_text(text)[0], lines, meets)) for t, text in _told(path, result)]
            with refused(path):
                points = {name: _points_of(part, scene.asked_scene(name)) for name, part in lines.items()}
            done = result.done and not before
    changes, resolution = tuple(LoadChange(*x) for x in told), kept_resolution(scene, path)
    unasked = _touching_unasked(scene_of_file, lines)
    return Remaining(scene, changes, resolution, before, False, reached, points, unasked, parts), done


def _points_of(result: Result, scene: LineScene) -> OutputPoints:
    """Where outputs of the line of a result are; ValueError: they are not on it."""
    return restored_points(result, longest_out(scene), None if winch_side(scene) else scene.length)


def _longer(left: Remaining[Any], until: float) -> Remaining[Any]:
    """The same until another time (s), with outputs as often as before."""
    of_line = "".join(f".lines[{name!r}]" for name in [*left.scene.asked_lines][:1] if name)
    _refuse_what_is_no_later_time(until, left.reached, f"hybrid.open(path){of_line}.at(t=...)")
    _refuse_before_changes(left.changes, until)
    every = left.scene.output_interval
    scene = _scene_until(left.scene, until, every)
    _refuse_more_out(left.scene, scene, until)
    changes = tuple(LoadChange(x.t, _scene_until(x.scene, until, every)) for x in left.changes)
    return replace(left, scene=scene, changes=changes)


def _scene_until(scene: Any, until: float, every: float) -> Any:
    """A scene that ends at another time (s), with outputs every so many seconds."""
    data = scene.model_dump(mode="json", exclude_none=True)
    data["time"]["duration"] = until
    data.setdefault("output", {})["every"] = every
    return read_text(scene_text(as_scene(data)))[0]


def _refuse_more_out(before: Any, after: Any, until: float) -> None:
    """SceneError: by `until` (s) more of a line is out than its result has points for."""
    for name in before.lines:
        scene, longer = before.scene_of(name), after.scene_of(name)
        out = longest_out(longer)
        if out > longest_out(scene) * (1.0 + SAME_PLACE):
            end = ("start", "end")[winch_side(scene)]
            where = dotted(before.form.place(("lines", name, "connections", end, "payout", "longest")))
            expected = f"a time up to which at most {longest_out(scene):.6g} m are out, for which the result has points"
            fix = f"run the scene again with {where}"
            raise _refused("until", f"{until:g} s, when {out:.6g} m are out", expected, fix)


def _check(last: LoadChange[Any], changed: Any, resolution: NetworkResolution, begin: float, end: float) -> None:
    """Refuse what cannot be other from `begin` on, and prescribed motions that would jump then."""
    _check_what_changes(last, changed, begin, end)
    old = build_system(last.scene, resolution)
    new = build_system(changed, resolution, old)
    for name, one, other, joints in zip(old.names, old.models, new.models, old.joints, strict=True):
        other.ends.copy_frames(one.ends)
        for k, end_name in enumerate(("start", "end")):
            if joints[k] < 0:
                point = getattr(changed.lines[name], end_name)
                body = changed.body_of(point)
                place = ("points", point) if body is None else ("bodies", getattr(changed.points[point], "body", ""))
                _refuse_jump(one, other, k, begin, dotted(last.scene.form.place((*place, "motion"))))


def as_begun(scene: Scene, lines: Mapping[str, Result], meets: bool) -> Scene:
    """The same, without contact that nobody asks for, of a result of a version that computed none then.

    lines: of the result; meets: whether it computed that between lines.
    """
    contact = with_own_contact(scene, _touching_unasked(scene, lines), False)
    return contact if meets else passing_each_other(contact)


def _touching_unasked(scene: Scene, lines: Mapping[str, Result]) -> list[str]:
    """Lines whose contact with themselves would be computed unasked, and has not been."""
    names = scene.form.names.items()
    return [x for x, name in names if "self_contact" not in lines[name] and self_reach(scene.asked_scene(x)).may]


def with_own_contact(scene: Scene, names: Sequence[str], asked: bool | None) -> Scene:
    """The same with contact of these lines with themselves, without (False), or where nobody asks (None)."""
    contact = {name: {"contact": scene.lines[name].contact.model_copy(update={"self": asked})} for name in names}
    return scene.with_lines(contact) if names else scene


def changes_text(changes: Sequence[LoadChange[Any]]) -> str:
    """Phases as JSON, for the file; empty if there are none."""
    return json.dumps([{"t": x.t, "scene": scene_text(x.scene)} for x in changes]) if changes else ""


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


def _check_what_changes(last: LoadChange[Any], changed: Any, begin: float, end: float) -> None:
    """SceneError: a change at `begin` (s) is before the last one, or not before the end (s), or of what stays."""
    if not last.t <= begin < end:
        fix = "a later end as well, --until T" if begin == end else ""
        raise _refused("from", f"{begin:g} s", f"a time from {last.t:g} s on and before the end, {end:g} s", fix)
    before, after = _plain(last.scene), _plain(changed)
    allowed = [x for x in MAY_CHANGE if x.split(".")[0] in before]
    for where, value in _differences(before, after):
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


def _plain(scene: Any) -> dict[str, Any]:
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
