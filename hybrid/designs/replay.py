"""Runs in the steps and cells of another run: nodes go along with the places where nodes have to be."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

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
from hybrid.simulation.restore import kept_resolution, resolution_from
from hybrid.simulation.system_run import Recording, run_system
from hybrid.store.array_recorder import MemoryTarget
from hybrid.store.checkpoint import read_checkpoint
from hybrid.store.hdf5_file import opened
from hybrid.store.reader import Result, open_result, written_result


@dataclass(frozen=True)
class Course:
    """How a run is replayed: how finely each line is computed, by name, with places of its nodes.

    scene: as it was computed: the model of one cable is that which the run has chosen.
    """

    scene: Any
    lines: Mapping[str, Resolution]

    def at(self, finer: bool) -> Mapping[str, Resolution]:
        """How finely lines are computed; finer: on cells and in steps half as long."""
        return {k: _halved(x) for k, x in self.lines.items()} if finer else self.lines

    @classmethod
    def first(cls, scene: Any) -> Course:
        """Of a run that has yet to show nothing."""
        raise NotImplementedError

    @classmethod
    def kept(cls, scene: Any, path: Path) -> Course:
        """Of a run of a scene that is in a file."""
        raise NotImplementedError

    def applied(self, scene: Any) -> Any:
        """A scene with other numbers, as it is computed in a replay: its errors are not estimated."""
        raise NotImplementedError

    def places(self) -> Mapping[str, tuple[float, ...]]:
        """Places of the nodes of every line, m."""
        raise NotImplementedError

    def points(self, scene: Any, more: Sequence[float], finer: bool) -> dict[str, Any]:
        """What `output` says for outputs at nodes and more arc lengths, m; empty: they are as the scene asks."""
        return {}

    def record(self, scene: Any, target: MemoryTarget, finer: bool, begun: Callable[..., None] | None) -> None:
        """Compute a scene, as it is in a replay, into memory; begun: called with the run at its start."""
        raise NotImplementedError


class _CourseOfCable(Course):
    """Of a cable, until the loop of several lines computes it too."""

    @classmethod
    def first(cls, scene: Scene) -> Course:
        return cls(scene, {"": first_resolution(scene)})

    @classmethod
    def kept(cls, scene: Scene, path: Path) -> Course:
        with opened(path) as file:
            return cls(scene, {"": resolution_from(read_checkpoint(file).resolution, scene)})

    def applied(self, scene: Scene) -> Scene:
        output = scene.output.model_copy(update={"errors": False})
        return scene.model_copy(update={"output": output, "model": self.scene.model})

    def places(self) -> Mapping[str, tuple[float, ...]]:
        return {"": places_of(build(self.scene, self.lines[""], spare=False), self.scene)}

    def points(self, scene: Scene, more: Sequence[float], finer: bool) -> dict[str, Any]:
        nodes = build(self.applied(scene), self.at(finer)[""], spare=False).line.s
        return {"points": at_nodes(scene, nodes, more)}

    def record(self, scene: Scene, target: MemoryTarget, finer: bool, begun: Callable[..., None] | None) -> None:
        Case(scene, None).record(self.at(finer)[""], target, begun=begun)


class _CourseOfLines(Course):
    """Of lines with names."""

    @classmethod
    def first(cls, scene: System) -> Course:
        return cls(scene, SystemResolution.first(scene).lines)

    @classmethod
    def kept(cls, scene: System, path: Path) -> Course:
        return cls(scene, kept_resolution(scene, path).lines)

    def applied(self, scene: System) -> System:
        changed: dict[str, Any] = {"output": scene.output.model_copy(update={"errors": None})}
        if scene.output.errors:  # lines pass each other as where these are estimated
            changed["contact"] = passing_each_other(self.scene).contact
        return scene.model_copy(update=changed)  # runs of several lines estimate none by themselves

    def places(self) -> Mapping[str, tuple[float, ...]]:
        scene, model = self.scene, build_system(self.scene, SystemResolution(self.lines))
        scenes = {name: scene.scene_of(name, scene.carried(name), scene.guesses) for name in model.names}
        return {name: places_of(x, scenes[name]) for name, x in zip(model.names, model.models, strict=True)}

    def record(self, scene: System, target: MemoryTarget, finer: bool, begun: Callable[..., None] | None) -> None:
        run_system(
            scene, target, scene_text(scene), ProgressReporter(None, scene.require_time().duration), lambda: False,
            resolution=SystemResolution(self.at(finer)), recording=Recording(begun=begun),
        )  # fmt: skip


def course_of(scene: Scene | System) -> Course:
    """Of a run of a scene: it is made where what it does tells how finely, for steps, accuracy and cells of a layer."""
    kind: type[Course] = _CourseOfLines if scene.line_names else _CourseOfCable
    if not _is_open(scene):
        return _with_nodes(kind.first(scene))
    with tempfile.TemporaryDirectory(prefix="hybrid-replay-") as room:
        path = Path(room) / "run.h5"
        run(scene, path).close()
        with open_result(path) as result:
            computed = parse_either(result.scene_text)[0]
            part = next(x for _, x in result.each_line())
            ends = tuple(np.array(part["steps/t"], float).tolist())
        course = kind.kept(computed, path)
    found = course.lines
    if any(x.local is not None for x in found.values()):
        longest = float(np.diff([0.0, *ends]).max())
        found = {k: replace(x, local=None, later=0.0, step=longest, ends=ends) for k, x in found.items()}
    return _with_nodes(replace(course, lines={k: replace(x, follow=False) for k, x in found.items()}))


def replay(
    scene: Scene | System, course: Course, finer: bool = False, more: Sequence[float] | None = None,
    each_step: bool = False, begun: Callable[..., None] | None = None,
) -> Result:  # fmt: skip
    """A run into memory, in the steps and on the nodes of a course; finer: on nodes as the scene has them, cells and

    steps half as long.

    more, each_step: as of `with_outputs`; begun: as of `Course.record`.
    SceneError, ComputationError: as of `hybrid.run`.
    """
    target = MemoryTarget()
    course.record(with_outputs(scene, course, more, each_step, finer), target, finer, begun)
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
    output |= course.points(scene, more, finer) if more is not None else {}
    applied = course.applied(scene)
    out: AnyScene = applied.model_copy(update={"output": applied.output.model_copy(update=output)})
    return out


def at_nodes(scene: Scene, nodes: Floats, more: Sequence[float]) -> tuple[float, ...]:
    """Output points, m: nodes and more, of which those that round-off alone tells apart are one."""
    points = np.unique([*nodes, *more])
    return tuple(points[np.append(True, np.diff(points) > NEAR * scene.length)].tolist())


def _with_nodes(course: Course) -> Course:
    """With the places of the nodes of every line."""
    places = course.places()
    return replace(course, lines={k: replace(x, places=places[k]) for k, x in course.lines.items()})


def _halved(resolution: Resolution) -> Resolution:
    ends = np.array([0.0, *resolution.ends])
    both = np.column_stack([0.5 * (ends[:-1] + ends[1:]), ends[1:]]).ravel()
    return replace(resolution.halved(), step=0.5 * resolution.step, places=(), ends=tuple(both.tolist()))


def _is_open(scene: Scene | System) -> bool:
    """Whether it leaves steps or cells to the program, which a run shows."""
    layers = any(x.resolution is not None for x in scene.lines.values())
    asked = (accuracy_of(scene.scene_of(name)) for name in scene.lines)
    return layers or scene.require_time().controlled or any(x is not None for x in asked)
