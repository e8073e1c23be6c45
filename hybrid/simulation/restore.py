"""A run made again from its checkpoint: the model from scene and mesh, what moves its zones, how finely it is computed.

A checkpoint holds named arrays and plain values alone.  What follows from the scene is made from the scene, and every
number that is read is checked for its type, its shape and, where a wrong one would do harm, its size.
"""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields
from functools import cache
from importlib.metadata import version
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from hybrid.errors import ResultError
from hybrid.kernels.machine.cache import compiler_hash
from hybrid.model.mesh import MOST_CELLS, Grading
from hybrid.model.network import NetworkResolution
from hybrid.model.resolution import Resolution, first_resolution
from hybrid.model.sections import OutputPoints
from hybrid.scene.network import Network
from hybrid.scene.schema import LineScene
from hybrid.simulation.old_checkpoints import is_of_cable
from hybrid.store.checkpoint import Checkpoint, read_checkpoint
from hybrid.store.hdf5_file import is_result, opened
from hybrid.store.named_arrays import Tree, matched, pack
from hybrid.store.reader import Result, open_result
from hybrid.zones.criteria import UserCriterion

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
    later = {
        "bends": inf,
        "rods": np.zeros(0),
        "parts": 1,
        "places": np.zeros(0),
        "ends": np.zeros(0),
    }  # all cells of before had one part
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
    rods = rods.reshape(-1, 3)
    rows = {
        "rods": tuple((float(a), float(b), float(x)) for a, b, x in rods),
        "places": tuple(saved["places"].tolist()),
        "ends": tuple(saved["ends"].tolist()),
    }
    return Resolution(**saved | {"grading": grading} | rows)


def kept_resolution(system: Network, source: Path) -> NetworkResolution:
    """How finely a result was computed that has a checkpoint.  ResultError: it is none of this system."""
    with opened(source) as file:
        tree = read_checkpoint(file).resolution
    first = NetworkResolution.first(system)
    if not tree:  # of an earlier program
        return first
    with refused(source):
        tree = {next(iter(system.lines)): tree} if is_of_cable(tree) else tree
        if set(tree) != set(system.lines):
            raise ValueError("resolutions of other lines")
        found = {name: resolution_from(tree[name], system.scene_of(name)) for name in system.lines}
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


def restored_points(result: Result, length: float, far: float | None = None) -> OutputPoints:
    """The output points of a result, which whoever continues it keeps; one of 0.6 has no jumps.

    far: m, arc length of the end of a line that is paid out at its start.
    ValueError: none of a cable of that length (m).
    """
    s = np.asarray(result["s"], float)
    jumps = np.asarray(result["right/s"], float) if "right/s" in result else np.zeros(0)
    ordered = s.ndim == 1 and s.size > 0 and bool((np.diff(s) > 0.0).all())
    begin, end = (0.0, length) if far is None else (far - length, far)
    near = 1e-9 * length if far is not None else 0.0
    if not (ordered and s[0] >= begin - near and s[-1] <= end + 1e-9 * length):
        raise ValueError(f"s: output points that increase from {begin:g} to {end:g} m at most were expected")
    if jumps.ndim != 1 or not np.isin(jumps, s).all():
        raise ValueError("right/s: places among the output points s were expected")
    return OutputPoints(s, jumps)


# --- the model ----------------------------------------------------------------------------------
