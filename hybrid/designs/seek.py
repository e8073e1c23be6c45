"""Numbers of a scene for which results of its equilibrium are what is asked: a design with as many targets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hybrid.designs.equilibria import Equilibria
from hybrid.designs.nearest import MET, Rows, Space, nearest
from hybrid.designs.numbers import number_of
from hybrid.errors import Complaint, ComputationError, Outcome, SceneError
from hybrid.kernels.state.state import Floats
from hybrid.scene.read import SceneLike, as_scene
from hybrid.scene.root import Scene


@dataclass(frozen=True)
class Sought:
    """Numbers that were found, by key; results with them, and their targets, by name; equilibria that it took.

    scene: with these numbers.
    """

    numbers: Mapping[str, float]
    results: Mapping[str, float]
    targets: Mapping[str, float]
    equilibria: int
    scene: Scene


def seek(scene: SceneLike, targets: Mapping[str, float], by: Sequence[str]) -> Sought:
    """Change as many numbers of a scene as there are targets until the results of its equilibrium are these.

    targets: results as of `hybrid.sensitivity`, such as `{"tension@250": 25e3}`; by: keys of numbers, each of which
    keeps its sign.  SceneError: what has no derivative, more or fewer numbers than targets; ComputationError: they are
    not reached, with how near it came.
    """
    asked = as_scene(scene)
    if len(by) != len(targets) or not by:
        expected = f"as many keys as targets ({len(targets)})"
        raise SceneError([Complaint("by", f"{len(by)} keys", expected, "one number for each target")])
    start = np.array([number_of(asked, key) for key in by])
    if not start.all():
        zero = by[int(np.flatnonzero(start == 0.0)[0])]
        raise SceneError([Complaint(zero, "0", "a number to begin with, which keeps its sign", "a first guess")])
    goal = np.array(list(targets.values()), float)
    equilibria = Equilibria({"": asked}, [(key,) for key in by], [("", name) for name in targets])
    scale = np.abs(goal)
    if not goal.all():  # what is sought to be 0 is as large as it is at first, or as the numbers can make it
        first_point = equilibria.at(start)
        size = np.maximum(np.abs(first_point.values), np.abs(first_point.slopes) @ np.abs(start))
        scale = np.where(goal == 0.0, np.maximum(size, 1e-12), scale)

    def off(x: Floats) -> Rows:
        point = equilibria.at(x)
        return Rows(point, (point.values - goal) / scale, lambda: point.slopes / scale[:, None])

    reached = nearest(off, signed(tuple(by), start))
    numbers, results = reached.point.x, reached.point.values
    if float(np.abs(reached.values).max()) <= MET:
        found = dict(zip(targets, results.tolist(), strict=True))
        new = equilibria.scene("", numbers)
        return Sought(dict(zip(by, numbers.tolist(), strict=True)), found, dict(targets), equilibria.count, new)
    worst = int(np.abs(reached.values).argmax())
    text = ", ".join(f"{key} = {x:.6g}" for key, x in zip(by, numbers, strict=True))
    detail = f"{list(targets)[worst]} comes to {results[worst]:.6g}, not {goal[worst]:.6g}, with {text}"
    first = "other numbers (--by) that it answers to, or a target nearer to what it is"
    raise ComputationError(Outcome.NOT_REACHED, None, None, detail, first=first)


def signed(names: tuple[str, ...], start: Floats) -> Space:
    """Unknowns that keep their signs."""
    return Space(names, start, np.where(start > 0.0, 0.0, -np.inf), np.where(start > 0.0, np.inf, 0.0))
