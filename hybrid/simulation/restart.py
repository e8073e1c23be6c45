"""A run made again from its checkpoint, and what a result leaves to be done.

Trees of hybrid-cable 1.0 and before have no names of lines: the state of the line, its books and the clock of the
steps stand beside each other.

A checkpoint holds named arrays and plain values alone.  What follows from the scene is made from the scene, and every
number that is read is checked for its type, its shape and, where a wrong one would do harm, its size.

Left to be done are the rest of a run that was cut off, more of it, or other loads from some time on.
"""

from __future__ import annotations

import hashlib
import json
import math
import platform
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from functools import cache
from importlib.metadata import version
from math import inf
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np

from hybrid.errors import Complaint, ResultError, SceneError
from hybrid.kernels.machine.cache import compiler_hash
from hybrid.kernels.mesh.cell_errors import CURVATURE, QUANTITIES
from hybrid.kernels.mesh.zone_criteria import CRITERIA
from hybrid.kernels.state.state import Floats
from hybrid.model.build import Model
from hybrid.model.contents import passing_each_other, self_reach
from hybrid.model.ends import EndConditions
from hybrid.model.mesh import MOST_CELLS, Grading, Layout
from hybrid.model.nearby import Weakness
from hybrid.model.network import NetworkResolution, build_network
from hybrid.model.payout import longest_out, winch_side
from hybrid.model.resolution import Resolution, first_resolution
from hybrid.model.sections import SAME_PLACE, OutputPoints
from hybrid.scene.base import dotted
from hybrid.scene.network import Network
from hybrid.scene.read import as_scene, read_text, scene_text
from hybrid.scene.root import Scene
from hybrid.scene.schema import LineScene
from hybrid.store.hdf5_file import is_result, opened
from hybrid.store.integrity import Tree, matched, pack
from hybrid.store.reader import Result, open_result
from hybrid.store.whole_file import Checkpoint, read_before, read_checkpoint
from hybrid.zones.manager import UserCriterion

FIRST_WORKS = 11  # works that were booked once
FIRST_REPORT = 34  # numbers that a report had once; later ones have more behind these
# What the tree of a line calls names of the old one, and what that of the run does.
OF_LINE = {x: x for x in ("state", "rho", "work", "power", "envelope", "ends", "first_energy", "torsion")}
OF_LINE |= {"_stored": "stored", "watch": "noted", "first_places": "first_places", "first_turns": "first_turns"}
OF_RUN = {x: x for x in ("t", "steps", "changes", "cpu", "rho", "leg")} | {"dt": "last", "last": "interval"}
# What becomes something else, and what follows from the scene, or is of the last step alone.
TURNED_INTO_OTHERS = {"report", "tension", "twist", "control", "vibration", "lengths", "_turned", "_slackened", "mesh"}
TURNED_INTO_OTHERS |= {"self_contact", "zoning", "payout", "plane", "push", "home"}
LEFT_OUT = {"iterations", "floor", "_beyond", "correction"}


def is_of_cable(saved: Any) -> bool:
    """Whether a state, or a resolution, of a checkpoint is that of a cable, without a name of its line."""
    return isinstance(saved, Mapping) and ("mesh" in saved or "fineness" in saved)


def as_of_line(saved: Mapping[str, Any], name: str, model: Model, weaknesses: Sequence[Weakness]) -> dict[str, Any]:
    """The tree of a run of one line of this name; what a cable has none of is left out of it.

    model: of the line as the run begins; weaknesses: what may break. ValueError: it is of another line.
    """
    known = {*OF_LINE, *OF_RUN, *TURNED_INTO_OTHERS, *LEFT_OUT}
    if odd := [x for x in saved if x not in known]:
        raise ValueError(f"{', '.join(odd)}: not in the checkpoint of any cable")
    _check_mesh(saved["mesh"], model)
    line = {new: saved[old] for old, new in OF_LINE.items() if old in saved}
    line.setdefault("envelope", None)  # files of 0.6 have none, and no end had been let go in them
    line["ends"] = {"released": np.zeros(2, int)} | line["ends"]
    if not line.get("torsion"):
        line.pop("torsion", None)
    contact = saved.get("self_contact")
    if contact is not None:
        line["self_contact"] = contact
    if "report" in saved:  # not in a file of 0.6
        line["report"] = saved["report"][0]
        line["before"] = {"report": saved["report"][1], "tension": saved["tension"], "twist": saved["twist"]}
        line["before"]["touch"] = np.zeros((1, 0)) if contact is None else contact["touch"][None]
    found = _of_run(saved) | {"lines": {name: line}, "quantities": {}, "dry": [], "overlaps": [], "under": {}}
    found["broken"] = _broken(line["ends"]["released"], weaknesses)
    found["vibrations"] = {name: saved["vibration"]} if "vibration" in saved else {}
    # zones of a line that is paid out are of the cells that its winch has made
    cells, push = saved["mesh"] if saved.get("payout") is None else saved["payout"], saved["push"]
    found["zones"] = {}
    if saved["zoning"] is not None:
        found["zones"][name] = {"rod": cells["rod"], "here": cells.get("here"), "switching": saved["zoning"]}
    if isinstance(push, dict):  # a file of 0.6 does not say whether it was real, and none was
        push = {"real": False} | push
    found["planes"] = {name: {"plane": saved["plane"], "home": saved.get("home"), "push": push}}
    return found if saved.get("payout") is None else found | {"payout": {name: saved["payout"]}}


def _of_run(saved: Mapping[str, Any]) -> dict[str, Any]:
    """The clock of the steps, and what has been told of them."""
    found = {new: saved[old] for old, new in OF_RUN.items() if old in saved}
    if "report" not in saved:  # nor where steps to a stop began, nor anything of the step before
        found |= {"leg": [saved["t"], 0], "interval": 0.0}
    control = saved["control"]
    longest, *counted = saved.get("lengths", [0.0] * 7)
    told = [float(saved.get(key, False)) for key in ("_turned", "_slackened")]
    cuts = [*told, longest, 0.0, *(float(x) for x in counted)]
    steps = [] if control is None else [control["next"], control["before"], float(control["wary"])]
    return found | {"loaded": saved["t"], "control": steps, "cuts": cuts}


def _broken(saved: Any, weaknesses: Sequence[Weakness]) -> list[int]:
    """Numbers of what may break, of the ends (2,) that had been let go."""
    released = matched(saved, np.zeros(2, int), "ends/released")
    if not np.isin(released, (0, 1)).all():
        raise ValueError(f"ends that are let go: {released}")
    found = {x.ends[0][1]: k for k, x in enumerate(weaknesses)}
    return [found[k] for k in np.flatnonzero(released).tolist()]


def _check_mesh(saved: Any, model: Model) -> None:
    """ValueError: the nodes, or the zones, of a checkpoint are not those of the model."""
    if model.layout is not None:
        mine: Tree = (model.layout if model.payout is None else model.payout.first_layout)._asdict()
    else:
        assert not isinstance(model.mesh, Layout)
        mine = {"s": model.mesh[0], "zones": [[x.kind, x.s_a, x.s_b] for x in model.mesh[1]]}
    mesh = matched({"here": None} | dict(saved), dict.fromkeys({"here": None} | mine), "mesh")

    def same(a: Any, b: Floats) -> bool:
        fits = isinstance(a, np.ndarray) and a.shape == b.shape
        return fits and bool((abs(a - b) <= SAME_PLACE * model.length).all())

    if "s" in mine:
        fits = same(mesh["s"], mine["s"]) and mesh["zones"] == mine["zones"]
    else:
        fits = same(mesh["base"], mine["base"]) and np.array_equal(mesh["parts"], mine["parts"])
    if not fits:
        raise ValueError("nodes that are not those of the line")


def of_line(saved: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    """What a checkpoint has of a line, whatever it is worth."""
    lines = saved.get("lines")
    line = lines.get(name) if isinstance(lines, Mapping) else None
    return line if isinstance(line, Mapping) else {}


# What older versions called what a checkpoint has of zones.
OLDER_NAMES = {
    "calm": "idle_steps",
    "calm_since": "below_since",
    "calmed": "release_cause",
    "haste": "ramp_factor",
    "patience": "wait_factor",
}


def _renamed(saved: dict[str, Any]) -> dict[str, Any]:
    return {OLDER_NAMES.get(name, name): x for name, x in saved.items()}


def zoning_of_today(saved: Any) -> Any:
    """The zones of a checkpoint, also of an older version.

    Those had no cells that follow, one largest curvature, no velocities, nothing of kinks, other names, or fewer
    criteria: those that came later begin with nothing.
    """
    if not isinstance(saved, dict):
        return saved
    saved = {"following": None} | saved
    following, manager, largest = saved["following"], saved.get("manager"), np.zeros(QUANTITIES)
    if isinstance(following, dict) and isinstance(following.get("peak"), float):
        largest[CURVATURE] = following["peak"]
        saved["following"] = {name: x for name, x in following.items() if name != "peak"}
    following = saved["following"]
    if isinstance(following, dict):
        following = saved["following"] = _renamed(following)
        if isinstance(idle := following.get("idle_steps"), np.ndarray):
            saved["following"] = {"waves": np.zeros(idle.shape)} | following
    if isinstance(manager, dict):
        manager = saved["manager"] = {"largest": largest, "fastest": 0.0, "kinked": False} | _renamed(manager)
        for name in ("ratios", "seen"):
            if isinstance(found := manager.get(name), np.ndarray) and found.ndim == 2 and len(found) < len(CRITERIA):
                manager[name] = np.pad(found, ((0, len(CRITERIA) - len(found)), (0, 0)))
    return saved


# Rooms that have a part in the numbers of a file.
COMPUTES = ("accuracy", "errors", "kernels", "model", "outputs", "scene", "simulation", "solve", "store", "zones")
# Times as fine or as coarse as the scene asks for that a run may be: far beyond what error control chooses.
FARTHEST = 1e4


@cache
def program() -> str:
    """Which program this is: version, and a hash of all that computes.  The same one gives the same bits."""
    digest, package = hashlib.sha256(compiler_hash().encode()), Path(__file__).parents[1]
    digest.update(" ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "h5py")).encode())
    digest.update(platform.python_version().encode())
    for file in sorted(package.rglob("*.py")):
        if file.relative_to(package).with_suffix("").parts[0] in COMPUTES:
            digest.update(file.read_bytes())
    return f"{version('hybrid-cable')} {digest.hexdigest()[:16]}"


def other_program(point: Checkpoint) -> str:
    """Text of the event of a run that another program has begun; empty if this one has."""
    if point.program == program():
        return ""
    wrote, this = (x.split()[0] for x in (point.program, program()))
    text = f"begun by hybrid-cable {wrote}, from here on by {this}" + " in another state" * (wrote == this)
    return f"{text}: the last digits may be others"


def require_same(point: Checkpoint, files: Mapping[str, str], criterion: UserCriterion | None, source: Path) -> None:
    """ResultError: the criterion of a run is missing, or the files that it reads have changed.

    files: digests by path, as they are now; source: the result whose checkpoint this is.
    """
    if point.asks and criterion is None:
        advice = "hybrid.resume(path, criterion=...) with the function that it was run with"
        raise ResultError(f"{source} was computed with a criterion of its own\n    try:      {advice}")
    changed = [path for path, digest in point.files.items() if files.get(path) != digest]
    if changed:
        detail = f"{', '.join(changed)}: other than when the run began"
        raise ResultError(f"{source} cannot go on\n    detail:   {detail}\n    try:      run its scene again")


@contextmanager
def refused(source: Path) -> Iterator[None]:
    """What a checkpoint raises that does not fit its scene, as a ResultError."""
    try:
        yield
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, ArithmeticError) as error:
        kind = "" if type(error) is ValueError else f"{type(error).__name__}: "
        detail = f"{kind}{error}".splitlines()[0]
        raise ResultError(
            f"{source} has a checkpoint that does not fit its scene\n    detail:   {detail}\n"
            "    try:      run its scene again"
        ) from error


# --- how finely ---------------------------------------------------------------------------------


def resolution_tree(resolution: Resolution) -> Tree:
    """A resolution for a checkpoint."""
    tree = {x.name: getattr(resolution, x.name) for x in fields(resolution)}
    rows = {x: np.array(getattr(resolution, x), float).ravel() for x in ("rods", "places", "ends")}
    return tree | {"grading": resolution.grading and vars(resolution.grading)} | rows


def resolution_from(tree: Any, scene: LineScene) -> Resolution:
    """The resolution again.  ValueError: it is none for this scene."""
    first = first_resolution(scene)
    if not is_of_cable(tree) and len(tree) == 1:
        (tree,) = tree.values()  # by the name of the only line
    if "later" not in tree:  # of a checkpoint of before, whose steps were short from one end to the other
        tree = tree | {"later": first.later * tree["step"] / first.step if first.step else 0.0, "still": first.still}
    # all cells of before had one part
    later = {"bends": inf, "parts": 1, "rods": np.zeros(0), "places": np.zeros(0), "ends": np.zeros(0)}
    tree = {name: x for name, x in tree.items() if name != "follow"}  # of checkpoints of 1.0
    saved = matched(later | tree, resolution_tree(first) | {"grading": None}, "resolution")
    for name in ("fineness", "step", "local", "zones", "later", "still"):
        asked, is_ = getattr(first, name), saved[name]
        if (asked is None) != (is_ is None):
            raise ValueError("steps that follow the motion in one place, fixed ones in the other")
        if asked is not None and not asked / FARTHEST <= is_ <= asked * FARTHEST:
            raise ValueError(f"{name} = {is_:g}, where the scene asks for {asked:g}")
    grading = saved["grading"]
    if grading is not None:
        grading = Grading(**matched(grading, {"s": np.zeros(0), "density": np.zeros(0)}, "grading"))
        s, density = grading.s, grading.density
        ordered = s.ndim == density.ndim == 1 and 1 < s.size == density.size and bool((np.diff(s) > 0.0).all())
        within = ordered and 0.0 <= s[0] < s[-1] <= scene.length * (1 + 1e-9) and density.min() > 0.0
        if not within or saved["fineness"] * density.max() * scene.length > MOST_CELLS:
            raise ValueError("cells that no mesh has")
    if not (saved["fineness"] * 100 <= MOST_CELLS and 1 <= saved["every"] <= FARTHEST and saved["bends"] > 0.0):
        raise ValueError("cells that no mesh has")
    if not (1 <= saved["parts"] <= FARTHEST and (np.diff(saved["places"]) > 0.0).all()):
        raise ValueError("places of nodes that no mesh has")
    rods = saved["rods"]
    if rods.size % 3 or not np.isfinite(rods).all() or not (rods[::3] <= rods[1::3]).all():
        raise ValueError("stretches that no line has")
    rows = {x: tuple(saved[x].tolist()) for x in ("places", "ends")}
    rows["rods"] = tuple(map(tuple, rods.reshape(-1, 3).tolist()))
    return Resolution(**saved | {"grading": grading} | rows)


def kept_resolution(network: Network, source: Path) -> NetworkResolution:
    """How finely a result was computed that has a checkpoint.  ResultError: it is none of this network."""
    with opened(source) as file:
        tree = read_checkpoint(file).resolution
    first = NetworkResolution.first(network)
    with refused(source):
        if not isinstance(tree, Mapping):
            raise ValueError("resolutions of no line")
        if not tree:  # of an earlier program
            return first
        tree = {next(iter(network.lines)): tree} if is_of_cable(tree) else tree
        if set(tree) != set(network.lines):
            raise ValueError("resolutions of other lines")
        found = {name: resolution_from(tree[name], network.scene_of(name)) for name in network.lines}
        if len({(x.step, x.every, x.local is None) for x in found.values()}) > 1:
            raise ValueError("lines with other steps")
        return NetworkResolution(found)


def is_cut_off(source: Path, texts: tuple[str, str], resolution: NetworkResolution) -> bool:
    """Whether a file holds a run of a scene and its changes (texts), with this resolution, that goes on."""
    if not is_result(source):
        return False
    try:
        with open_result(source) as result:
            if (result.scene_text, result.changes_text) != texts:
                return False
        with opened(source) as file:
            tree = read_checkpoint(file).resolution
    except ResultError:
        return False
    asked = {name: resolution_tree(x) for name, x in resolution.lines.items()}
    return pack(dict.fromkeys(asked, tree) if is_of_cable(tree) else tree) == pack(asked)


# --- the model ----------------------------------------------------------------------------------


# What may be other from some time on: it acts from outside, and nothing of the cable's state hangs on it.
MAY_CHANGE = (
    "environment.fluid.current",
    "environment.fluid.waves",
    "time.duration",
    *(f"ends.{end}.{key}" for end in ("start", "end") for key in ("motion", "force", "thrust", "moment")),
    *(f"{what}.NAME.{key}" for what in ("points", "bodies") for key in ("motion", "force", "moment")),
)
# Of the length, and of the length in the time of a transverse wave: what an end may jump by, and its velocity.
MOST_JUMP, MOST_KICK = 1e-6, 1e-3
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
    left, done = _what_is_left(path)
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


def _what_is_left(path: Path) -> tuple[Remaining[Any], bool]:
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
            told = [(t, as_begun(read_text(text)[0], lines, meets)) for t, text in _changes_of(path, result)]
            with refused(path):
                points = {name: _points_of(part, scene.asked_scene(name)) for name, part in lines.items()}
            done = result.done and not before
    changes, resolution = tuple(LoadChange(*x) for x in told), kept_resolution(scene, path)
    unasked = _touching_unasked(scene_of_file, lines)
    return Remaining(scene, changes, resolution, before, False, reached, points, unasked, parts), done


def _points_of(result: Result, scene: LineScene) -> OutputPoints:
    """Where outputs of the line of a result are, which whoever continues it keeps; one of 0.6 has no jumps.

    ValueError: they are not on the line.
    """
    s = np.asarray(result["s"], float)
    jumps = np.asarray(result["right/s"], float) if "right/s" in result else np.zeros(0)
    ordered = s.ndim == 1 and s.size > 0 and bool((np.diff(s) > 0.0).all())
    length, at_start = longest_out(scene), not winch_side(scene)  # paid out at its start, where arc lengths begin below
    begin, end = (scene.length - length, scene.length) if at_start else (0.0, length)
    near = 1e-9 * length
    if not (ordered and s[0] >= begin - near * at_start and s[-1] <= end + near):
        raise ValueError(f"s: output points that increase from {begin:g} to {end:g} m at most were expected")
    if jumps.ndim != 1 or not np.isin(jumps, s).all():
        raise ValueError("right/s: places among the output points s were expected")
    return OutputPoints(s, jumps)


def _longer(left: Remaining[Any], until: float) -> Remaining[Any]:
    """The same until another time (s), with outputs as often as before."""
    reached, later = left.reached, [x.t for x in left.changes if x.t >= until]
    if not math.isfinite(until):
        raise _refused("until", f"{until:g} s", "a time in s", f"--until {2.0 * reached or 100.0:g}")
    if until < reached:
        of_line = "".join(f".lines[{name!r}]" for name in [*left.scene.asked_lines][:1] if name)
        fix = f"the file holds everything before: hybrid.open(path){of_line}.at(t=...)"
        raise _refused("until", f"{until:g} s", f"a time after {reached:g} s, up to which it is computed", fix)
    if later:
        fix = "a later end; a change that was asked for cannot be taken back"
        raise _refused("until", f"{until:g} s", f"a time after the change at {later[0]:g} s", fix)
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
        if out > longest_out(scene) * (1.0 + MOST_JUMP):
            end = ("start", "end")[winch_side(scene)]
            where = dotted(before.form.place(("lines", name, "connections", end, "payout", "longest")))
            expected = f"a time up to which at most {longest_out(scene):.6g} m are out, for which the result has points"
            fix = f"run the scene again with {where}"
            raise _refused("until", f"{until:g} s, when {out:.6g} m are out", expected, fix)


def _check(last: LoadChange[Any], changed: Any, resolution: NetworkResolution, begin: float, end: float) -> None:
    """Refuse what cannot be other from `begin` on, and prescribed motions that would jump then."""
    _check_what_changes(last, changed, begin, end)
    meet = sorted({*changed.meeting_pairs} - {*last.scene.meeting_pairs})
    if meet:
        expected = "lines between which the run computes contact from its start, or that stay out of each other's reach"
        fix = "run the changed scene from its start"
        raise _refused("contact", f"{' and '.join(meet[0])}, which reach each other then", expected, fix)
    old = build_network(last.scene, resolution)
    new = build_network(changed, resolution, old)
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


def _changes_of(path: Path, result: Result) -> list[tuple[float, str]]:
    """Times (s) and scenes of the changes of a result; ResultError: they cannot be read."""
    try:
        return [(float(x["t"]), str(x["scene"])) for x in json.loads(result.changes_text or "[]")]
    except (ValueError, TypeError, KeyError) as error:
        advice = f"    detail:   {error}\n    try:      run its scene again"
        raise ResultError(f"{path} has changes that cannot be read\n{advice}") from None


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
    jumps = held and (apart > MOST_JUMP * length or faster > MOST_KICK * length / after.time_scale)
    if jumps or turned > MOST_JUMP or spun > MOST_KICK / after.time_scale:
        sizes = ((apart, "m"), (faster, "m/s"), (turned, "rad"), (spun, "rad/s"))
        by = ", ".join(f"{x:.3g} {unit}" for x, unit in sizes if x > 1e-9)
        fix = "times count from the start of the run: travel {by, over, begin} starts from rest where the end is"
        expected = "a motion that goes on where the one before it is"
        raise _refused(where, f"one that jumps by {by} at t = {t:g} s", expected, fix)


def _place(ends: EndConditions, k: int, t: float) -> tuple[np.ndarray, ...]:
    """Position (3,) m, velocity (3,) m/s, frame (9,) and its spin (3,) rad/s of an end."""
    now = ends.at_time(t)
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
