"""Numbers of a scene for which results of its equilibrium are what is asked: Newton's method with exact derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hybrid.designs.numbers import changed_scene
from hybrid.designs.sensitivity import at_rest
from hybrid.errors import Complaint, ComputationError, Outcome, SceneError
from hybrid.kernels.state.state import Floats
from hybrid.scene.read import SceneLike, as_scene_or_system
from hybrid.scene.schema import Scene
from hybrid.scene.system import System

# Rounds at most, and the part of a target within which it is met; a number changes by this part of itself a round at
# most, and a step that leads away is halved so often.
ROUNDS, MET, STEP, HALVED = 40, 1e-8, 0.3, 6


@dataclass(frozen=True)
class Sought:
    """Numbers that were found, by key; results with them, and their targets, by name; equilibria that it took.

    scene: with these numbers.
    """

    numbers: Mapping[str, float]
    results: Mapping[str, float]
    targets: Mapping[str, float]
    equilibria: int
    scene: Scene | System


def seek(scene: SceneLike | System, targets: Mapping[str, float], by: Sequence[str]) -> Sought:
    """Change as many numbers of a scene as there are targets until the results of its equilibrium are these.

    targets: results as of `hybrid.sensitivity`, such as `{"tension@250": 25e3}`; by: keys of numbers, each of which
    keeps its sign.  SceneError: what has no derivative, more or fewer numbers than targets; ComputationError: they are
    not reached, with how near it came.
    """
    asked = as_scene_or_system(scene)
    if len(by) != len(targets) or not by:
        expected = f"as many keys as targets ({len(targets)})"
        raise SceneError([Complaint("by", f"{len(by)} keys", expected, "one number for each target")])
    wanted = list(targets)
    goal = np.array(list(targets.values()), float)
    scale = np.maximum(np.abs(goal), 1e-12)
    here, equilibria = at_rest(asked, wanted), 1
    numbers = np.array([here.number(key) for key in by])
    if not numbers.all():
        zero = by[int(np.flatnonzero(numbers == 0.0)[0])]
        raise SceneError([Complaint(zero, "0", "a number to begin with, which keeps its sign", "a first guess")])
    off = _off(here.values, goal, scale)
    for _ in range(ROUNDS):
        if off <= MET:
            found = {name: float(x) for name, x in zip(targets, here.values, strict=True)}
            return Sought(dict(zip(by, numbers.tolist(), strict=True)), found, dict(targets), equilibria, here.scene)
        slopes = here.by(by).T
        step = _step(slopes * numbers / scale[:, None], (goal - here.values) / scale)
        for _ in range(HALVED):
            tried = numbers * (1.0 + step)
            try:
                there = at_rest(_with(asked, by, tried), wanted)
            except ComputationError:
                step *= 0.5
                continue
            finally:
                equilibria += 1
            if _off(there.values, goal, scale) < off:
                break
            step *= 0.5
        else:
            break
        here, numbers, off = there, tried, _off(there.values, goal, scale)
    worst = int(np.abs((here.values - goal) / scale).argmax())
    name = list(targets)[worst]
    reached = ", ".join(f"{key} = {x:.6g}" for key, x in zip(by, numbers, strict=True))
    detail = f"{name} comes to {here.values[worst]:.6g}, not {goal[worst]:.6g}, with {reached}"
    first = "other numbers (--by) that it answers to, or a target nearer to what it is"
    raise ComputationError(Outcome.NOT_CONVERGED, None, None, detail, first=first)


def _off(values: Floats, goal: Floats, scale: Floats) -> float:
    return float(np.abs((values - goal) / scale).max())


def _step(slopes: Floats, gap: Floats) -> Floats:
    """Relative changes of the numbers, shortened so that none is larger than STEP; slopes: % by %."""
    step, *_ = np.linalg.lstsq(slopes, gap, rcond=1e-12)
    largest = float(np.abs(step).max(initial=0.0))
    return np.asarray(step * min(1.0, STEP / max(largest, 1e-300)))


def _with(scene: Scene | System, by: Sequence[str], numbers: Floats) -> Scene | System:
    for key, x in zip(by, numbers, strict=True):
        scene = changed_scene(scene, key, float(x))
    return scene
