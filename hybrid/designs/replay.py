"""Runs in the steps and cells of another run: nodes go along with the places where nodes have to be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hybrid.accuracy.api import run
from hybrid.designs.cable_at_rest import NO_PLACES, Places
from hybrid.model.build import build, places_of
from hybrid.model.output_points import NEAR
from hybrid.model.resolution import Resolution, first_resolution
from hybrid.model.system import SystemResolution, build_system
from hybrid.scene.read import scene_text
from hybrid.scene.schema import Scene
from hybrid.scene.system import System
from hybrid.simulation.case import Case
from hybrid.simulation.progress import ProgressReporter
from hybrid.simulation.system_run import run_system
from hybrid.store.array_recorder import MemoryTarget
from hybrid.store.reader import Result, written_result


def places_in(scene: Scene | System) -> Places:
    """Places of the nodes of every line of a run; none where a pre-run lays cells."""
    if _has_layers(scene):
        return NO_PLACES
    if isinstance(scene, Scene):
        return {"": places_of(build(scene, first_resolution(scene), spare=False), scene)}
    model = build_system(scene, SystemResolution.first(scene))
    scenes = {name: scene.scene_of(name, scene.carried(name), scene.guesses) for name in model.names}
    return {name: places_of(x, scenes[name]) for name, x in zip(model.names, model.models, strict=True)}


def replay(
    scene: Scene | System, places: Places, finer: bool = False, more: Sequence[float] | None = None,
    each_step: bool = False,
) -> Result:  # fmt: skip
    """A run into memory, on nodes at places; finer: on nodes as the scene has them, cells and steps half as long.

    more: of one cable: outputs are at its nodes and these arc lengths, m; None: where the scene asks for them;
    each_step: there are outputs at every step, in place of when the scene asks for them.

    SceneError, ComputationError: as of `hybrid.run`.
    """
    often = {"every": scene.require_time().step} if each_step else {}
    scene = scene.model_copy(update={"output": scene.output.model_copy(update={"errors": None, **often})})
    if _has_layers(scene) and not finer:
        return run(scene)
    target = MemoryTarget()
    if isinstance(scene, Scene):
        first = first_resolution(scene)
        resolution = _halved(first) if finer else replace(first, places=places.get("", ()))
        if more is not None:
            points = np.unique([*build(scene, resolution, spare=False).line.s, *more])
            points = points[np.append(True, np.diff(points) > NEAR * scene.length)]
            scene = scene.model_copy(update={"output": scene.output.model_copy(update={"points": tuple(points)})})
        Case(scene, None).record(resolution, target)
        return written_result(target)
    lines = SystemResolution.first(scene).lines
    asked = {k: _halved(x) if finer else replace(x, places=places.get(k, ())) for k, x in lines.items()}
    reporter = ProgressReporter(None, scene.require_time().duration)
    run_system(scene, target, scene_text(scene), reporter, lambda: False, resolution=SystemResolution(asked))
    return written_result(target)


def _halved(resolution: Resolution) -> Resolution:
    return replace(resolution.halved(), step=0.5 * resolution.step)


def _has_layers(scene: Scene | System) -> bool:
    """Whether a scene says how many cells a layer has, which a pre-run shows."""
    lines = [scene] if isinstance(scene, Scene) else [*scene.lines.values()]
    return any(x.resolution is not None for x in lines)
