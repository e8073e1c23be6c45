"""Runs in the steps and cells of another run: nodes go along with the places where nodes have to be."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from hybrid.accuracy.passes import run
from hybrid.errors import PUSHED, ComputationError, Outcome
from hybrid.kernels.state.state import Floats
from hybrid.model.build import places_of
from hybrid.model.contents import passing_each_other
from hybrid.model.network import NetworkResolution, build_network
from hybrid.model.resolution import Resolution, accuracy_of
from hybrid.model.sections import SAME_PLACE
from hybrid.scene.network import Network
from hybrid.scene.read import read_text, scene_text
from hybrid.scene.root import Scene
from hybrid.simulation.restart import kept_resolution
from hybrid.simulation.run import new_run
from hybrid.simulation.run_record import Recording
from hybrid.store.format import MemoryTarget
from hybrid.store.reader import Result, open_result, written_result

# Tolerance of Newton's method in steps: until its corrections no longer shrink.  At a kink of contact steps that are
# solved to 1e-9 may end on its wrong side: forces at anchors were up to 0.1 off (bench/test_bench_tangents.py).
SOLVED_TO = 0.0


Places = Mapping[str, Sequence[float]]  # m, arc lengths, of lines of the network by name


class Course(NamedTuple):
    """How a run is replayed: how finely each line is computed, by name in the network, with places of its nodes.

    scene: as it was computed: models of lines are those which the run has chosen; dimension: of its network, 3: no
    plane of a line is known, which other numbers may move; tolerance: of Newton's method in steps; places: that are
    added to the lists of output points that the scene has, infinite: the end.
    """

    scene: Any
    lines: Mapping[str, Resolution]
    dimension: int | None = 3
    tolerance: float = SOLVED_TO
    places: Places = MappingProxyType({})

    def resolutions(self, finer: bool) -> Mapping[str, Resolution]:
        """How finely lines are computed; finer: on cells and in steps half as long."""
        return {k: _halved(x) for k, x in self.lines.items()} if finer else self.lines

    def as_asked(self) -> Course:
        """With lines in planes where the scene has them."""
        return self._replace(dimension=self.scene.dimension)

    def network(self, scene: Any) -> Network:
        """The network that computes a scene with other numbers in a replay; its errors are not estimated."""
        made = scene.model_copy(update={"output": scene.output.model_copy(update={"errors": None})})
        network = made.with_lines({name: {"model": x.model} for name, x in self.scene.lines.items()})
        if scene.output.errors:  # lines pass each other as where these are estimated
            network = passing_each_other(network)
        points = {name: network.output.points_of(name) for name in network.lines}
        for name, more in self.places.items():
            if not isinstance(points[name], int):
                most = network.lines[name].cable.length
                points[name] = tuple(np.unique([*points[name], *(min(x, most) for x in more)]).tolist())
        output = network.output.model_copy(update={"points": points})
        return network.model_copy(update={"dimension": self.dimension, "output": output})


def course_of(scene: Any) -> Course:
    """How to replay the run of a scene, which is made if need be.

    It is where steps, an accuracy or cells of a layer leave open how finely, and where lines lie in a plane that they
    may leave.  ComputationError: one is pushed out of it.
    """
    if not _is_open(scene):
        first = NetworkResolution.first(scene)
        course = Course(scene, first.lines)
        flat = build_network(course.as_asked().network(scene), first).models
        if scene.dimension is None and any(x.plane is not None for x in flat):
            refuse_push(run(scene.model_copy(update={"output": scene.output.model_copy(update={"errors": None})})))
        return _with_nodes(course)
    with tempfile.TemporaryDirectory(prefix="hybrid-replay-") as room:
        path = Path(room) / "run.h5"
        run(scene, path).close()
        with open_result(path) as result:
            refuse_push(result)
            computed: Any = read_text(result.scene_text)[0]
            part = next(x for _, x in result.each_line())
            ends = tuple(np.array(part["steps/t"], float).tolist())
        found = dict(kept_resolution(computed, path).lines)
    if any(x.local is not None for x in found.values()):
        longest = float(np.diff([0.0, *ends]).max())
        found = {k: replace(x, local=None, later=0.0, step=longest, ends=ends) for k, x in found.items()}
    return _with_nodes(Course(computed, found))


def refuse_push(result: Result) -> None:
    """ComputationError where a line was pushed out of its plane, in which replays stay."""
    for event in result.events:
        if event.kind == "out of plane" and PUSHED in event.text:
            detail = "it is pushed out of the plane, and how it moves from there on goes by that push"
            first = "a shorter time.duration"
            raise ComputationError(Outcome.LEFT_PLANE, event.t, event.s_a, detail, first=first)


def replay(
    scene: Scene,
    course: Course,
    finer: bool = False,
    more: Places | None = None,
    each_step: bool = False,
    begun: Callable[..., None] | None = None,
) -> Result:
    """A run into memory, in the steps and on the nodes of a course.

    finer: on nodes as the scene has them, cells and steps half as long.
    more, each_step: as of `with_outputs`; begun: as of `Course.record`.
    SceneError, ComputationError: as of `hybrid.run`.
    """
    network, target = with_outputs(scene, course, more, each_step, finer), MemoryTarget()
    with course.scene.form.in_words():
        cells = NetworkResolution(course.resolutions(finer), course.tolerance)
        recording = Recording(planes=True, begun=begun)
        new_run(network, target, scene_text(network), True, cells, recording).record_motion()
    return written_result(target)


def with_outputs(
    scene: Scene,
    course: Course,
    more: Places | None = None,
    each_step: bool = False,
    finer: bool = False,
) -> Network:
    """The network that computes a scene in a replay.

    more: outputs of lines are at their nodes and these arc lengths, m; None: where the scene asks for them;
    each_step: there are outputs at every step, or about as often where steps are not equal, in place of when the scene
    asks for them.
    """
    first, output, network = next(iter(course.lines.values())), dict[str, Any](), course.network(scene)
    if each_step:
        output["every"] = float(np.median(np.diff([0.0, *first.ends]))) if first.ends else first.step
    if more is not None:
        built = build_network(network, NetworkResolution(course.resolutions(finer)))
        each = zip(built.names, built.models, strict=True)
        output["points"] = {name: at_nodes(model.line.s, more.get(name, ())) for name, model in each}
    return network.model_copy(update={"output": network.output.model_copy(update=output)})


def at_nodes(nodes: Floats, more: Sequence[float]) -> tuple[float, ...]:
    """Output points, m: nodes and more, of which those that round-off alone tells apart are one."""
    points = np.unique([*nodes, *more])
    return tuple(points[np.append(True, np.diff(points) > SAME_PLACE * nodes[-1])].tolist())


def _with_nodes(course: Course) -> Course:
    """With the places of the nodes of every line."""
    network = course.network(course.scene)
    model = build_network(network, NetworkResolution(course.lines))
    scenes = network.scenes_of_lines
    places = {name: places_of(x, scenes[name]) for name, x in zip(model.names, model.models, strict=True)}
    return course._replace(lines={k: replace(x, places=places[k]) for k, x in course.lines.items()})


def _halved(resolution: Resolution) -> Resolution:
    ends = np.array([0.0, *resolution.ends])
    both = np.column_stack([0.5 * (ends[:-1] + ends[1:]), ends[1:]]).ravel()
    return replace(resolution.halved(), step=0.5 * resolution.step, places=(), ends=tuple(both.tolist()))


def _is_open(scene: Scene) -> bool:
    """Whether it leaves steps or cells to the program, which a run shows."""
    layers = any(x.resolution is not None for x in scene.lines.values())
    asked = (accuracy_of(scene.asked_scene(name)) for name in scene.asked_lines)
    return layers or scene.require_time().controlled or any(x is not None for x in asked)
