"""Runs in the steps and cells of another run: nodes go along with the places where nodes have to be."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hybrid.accuracy.api import run
from hybrid.designs.numbers import AnyScene
from hybrid.kernels.state.state import Floats
from hybrid.model.build import build, places_of
from hybrid.model.lines_contact import passing_each_other
from hybrid.model.output_points import NEAR
from hybrid.model.resolution import Resolution, accuracy_of, first_resolution
from hybrid.model.system import SystemResolution, build_system
from hybrid.scene.read import parse_either, scene_text
from hybrid.scene.schema import Scene
from hybrid.scene.system import System
from hybrid.simulation.case import Case
from hybrid.simulation.progress import ProgressReporter
from hybrid.simulation.restore import resolution_from
from hybrid.simulation.system_checkpoint import kept_resolution
from hybrid.simulation.system_run import Recording, run_system
from hybrid.store.array_recorder import MemoryTarget
from hybrid.store.checkpoint import read_checkpoint
from hybrid.store.hdf5_file import opened
from hybrid.store.reader import Result, open_result, written_result


class Course(NamedTuple):
    """How a run is replayed: how finely each line is computed, by name, "" of one cable, with places of its nodes.

    scene: as it was computed: the model of one cable is that which the run has chosen.
    """

    scene: Scene | System
    lines: Mapping[str, Resolution]

    def at(self, finer: bool) -> Mapping[str, Resolution]:
        """How finely lines are computed; finer: on cells and in steps half as long."""
        return {k: _halved(x) for k, x in self.lines.items()} if finer else self.lines

    def applied(self, scene: AnyScene) -> AnyScene:
        """A scene with other numbers, as it is computed in a replay: its errors are not estimated."""
        changed: dict[str, Any] = {"output": scene.output.model_copy(update={"errors": None})}
        if isinstance(self.scene, Scene):
            changed = {"output": scene.output.model_copy(update={"errors": False}), "model": self.scene.model}
        elif scene.output.errors:  # lines pass each other as where these are estimated
            changed["contact"] = passing_each_other(self.scene).contact
        out: Any = scene.model_copy(update=changed)  # of several lines runs estimate none by themselves
        return out


def course_of(scene: Scene | System) -> Course:
    """Of a run of a scene: it is made where what it does tells how finely, for steps, accuracy and cells of a layer."""
    if not _is_open(scene):
        if isinstance(scene, Scene):
            return _with_nodes(scene, {"": first_resolution(scene)})
        return _with_nodes(scene, SystemResolution.first(scene).lines)
    with tempfile.TemporaryDirectory(prefix="hybrid-replay-") as room:
        path = Path(room) / "run.h5"
        run(scene, path).close()
        with open_result(path) as result:
            computed = parse_either(result.scene_text)[0]
            part = next(iter(result.lines.values())) if result.lines else result
            ends = tuple(np.array(part["steps/t"], float).tolist())
        if isinstance(computed, Scene):
            with opened(path) as file:
                found = {"": resolution_from(read_checkpoint(file).resolution, computed)}
        else:
            found = dict(kept_resolution(computed, path).lines)
    if any(x.local is not None for x in found.values()):
        longest = float(np.diff([0.0, *ends]).max())
        found = {k: replace(x, local=None, later=0.0, step=longest, ends=ends) for k, x in found.items()}
    return _with_nodes(computed, {k: replace(x, follow=False) for k, x in found.items()})


def replay(
    scene: Scene | System, course: Course, finer: bool = False, more: Sequence[float] | None = None,
    each_step: bool = False, begun: Callable[..., None] | None = None,
) -> Result:  # fmt: skip
    """A run into memory, in the steps and on the nodes of a course; finer: on nodes as the scene has them, cells and

    steps half as long.

    more, each_step: as of `with_outputs`; begun: as of `Case.record` or, of several lines, of `Recording`.
    SceneError, ComputationError: as of `hybrid.run`.
    """
    scene = with_outputs(scene, course, more, each_step, finer)
    lines, target = course.at(finer), MemoryTarget()
    if isinstance(scene, Scene):
        Case(scene, None).record(lines[""], target, begun=begun)
        return written_result(target)
    reporter = ProgressReporter(None, scene.require_time().duration)
    recording, resolution = Recording(begun=begun), SystemResolution(lines)
    run_system(scene, target, scene_text(scene), reporter, lambda: False, resolution=resolution, recording=recording)
    return written_result(target)


def with_outputs(
    scene: AnyScene, course: Course, more: Sequence[float] | None = None, each_step: bool = False, finer: bool = False
) -> AnyScene:
    """A scene as it is computed in a replay.

    more: of one cable: outputs are at its nodes and these arc lengths, m; None: where the scene asks for them;
    each_step: there are outputs at every step, or about as often where steps are not equal, in place of when the scene
    asks for them.
    """
    first, output = next(iter(course.lines.values())), dict[str, Any]()
    if each_step:
        output["every"] = float(np.median(np.diff([0.0, *first.ends]))) if first.ends else first.step
    if isinstance(scene, Scene) and more is not None:
        nodes = build(course.applied(scene), course.at(finer)[""], spare=False).line.s
        output["points"] = at_nodes(scene, nodes, more)
    applied = course.applied(scene)
    out: Any = applied.model_copy(update={"output": applied.output.model_copy(update=output)})
    return out


def at_nodes(scene: Scene, nodes: Floats, more: Sequence[float]) -> tuple[float, ...]:
    """Output points, m: nodes and more, of which those that round-off alone tells apart are one."""
    points = np.unique([*nodes, *more])
    return tuple(points[np.append(True, np.diff(points) > NEAR * scene.length)].tolist())


def _with_nodes(scene: Scene | System, lines: Mapping[str, Resolution]) -> Course:
    """With the places of the nodes of every line."""
    if isinstance(scene, Scene):
        places = {"": places_of(build(scene, lines[""], spare=False), scene)}
    else:
        model = build_system(scene, SystemResolution(lines))
        scenes = {name: scene.scene_of(name, scene.carried(name), scene.guesses) for name in model.names}
        places = {name: places_of(x, scenes[name]) for name, x in zip(model.names, model.models, strict=True)}
    return Course(scene, {k: replace(x, places=places[k]) for k, x in lines.items()})


def _halved(resolution: Resolution) -> Resolution:
    ends = np.array([0.0, *resolution.ends])
    both = np.column_stack([0.5 * (ends[:-1] + ends[1:]), ends[1:]]).ravel()
    return replace(resolution.halved(), step=0.5 * resolution.step, places=(), ends=tuple(both.tolist()))


def _is_open(scene: Scene | System) -> bool:
    """Whether it leaves steps or cells to the program, which a run shows."""
    lines = [scene] if isinstance(scene, Scene) else [*scene.lines.values()]
    alone = [scene] if isinstance(scene, Scene) else [scene.scene_of(name) for name in scene.lines]
    layers = any(x.resolution is not None for x in lines)
    return layers or scene.require_time().controlled or any(accuracy_of(x) is not None for x in alone)
