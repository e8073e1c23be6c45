"""`hybrid` as a solver of cosseratbench, a board of rope problems that programs join by an entry point.

`cosseratbench run --solver hybrid` finds it (entry points `cosseratbench.solvers` of pyproject.toml).  A scenario
becomes a scene of several lines, one for each of its rods, in the cells that are asked for.
"""

from __future__ import annotations

import csv
import math
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from cosseratbench.scenario import Cylinder, End, EndCondition, Motion, Rod, Scenario
from cosseratbench.solver import Capability, Diverged
from cosseratbench.trajectory import Trajectory

from hybrid.accuracy.passes import run
from hybrid.errors import ComputationError, SceneError

STEPS = 1000  # to the slowest period of a scenario
CORNER = 0.04  # s, over which a motion that jumps to a velocity reaches it
STRAIN = 0.5  # that ropes of rubber bear; beyond it a run stops
FEWEST_ROWS = 24  # of a table of motion


class HybridSolver:
    """Rods and their contact, with friction, in steps of a thousandth of the slowest period."""

    name = "hybrid"
    backend_version = version("hybrid-cable")
    capabilities = frozenset(
        {
            Capability.STRETCH,
            Capability.ROD_CONTACT,
            Capability.ROD_FRICTION,
            Capability.CYLINDER_CONTACT,
            Capability.PLANE_CONTACT,
        }
    )

    def __init__(self, time_step_scale: float = 1.0) -> None:
        self.time_step_scale = time_step_scale

    def settings(self, scenario: Scenario, *, n_elements: int, n_frames: int) -> dict[str, Any]:
        """Numerical choices of a run, as JSON values: step in s, damping in 1/s."""
        return {
            "integrator": "generalized-alpha (implicit), rho_inf 0.5",
            "time_step": self._step(scenario),
            "damping_rate": _damping(scenario),
        }

    def run(self, scenario: Scenario, *, n_elements: int, n_frames: int) -> Trajectory:
        """Compute a scenario with n_elements cells to a rod.

        Returns n_frames outputs: positions in m, inertial frame, and the material direction of each cell.
        Raises NotImplementedError for what a scene does not state (an end that slides), Diverged where a run stops.
        """
        with TemporaryDirectory() as folder:
            scene = _scene(scenario, n_elements, Path(folder))
            scene["time"] = {"duration": scenario.duration, "step": self._step(scenario)}
            scene["output"] = {"every": scenario.duration / (n_frames - 1), "points": n_elements + 1, "exact": True}
            try:
                result = run(scene)
            except SceneError as error:  # asked for what no scene states
                raise NotImplementedError(str(error)) from error
            except ComputationError as error:
                raise Diverged(str(error), error.t) from error
        lines = [result.lines[f"rod{i}"] for i in range(len(scenario.rods))]
        positions = tuple(np.asarray(line["position"]) for line in lines)
        directors = tuple(
            _directors(x, np.asarray(line["twist"]), rod)
            for x, line, rod in zip(positions, lines, scenario.rods, strict=True)
        )
        return Trajectory(np.asarray(result["t"]), positions, directors)

    def _step(self, scenario: Scenario) -> float:
        slow = 2.0 * math.pi / scenario.slowest_frequency() / STEPS
        return self.time_step_scale * min(slow, scenario.duration / FEWEST_ROWS)


def _damping(scenario: Scenario) -> float:
    """Of mass (1/s): the slowest motion comes to rest as fast as it can where rest is asked for, else none."""
    return 2.0 * scenario.slowest_frequency() if scenario.quasi_static else 0.0


def _scene(scenario: Scenario, cells: int, folder: Path) -> dict[str, Any]:
    """The scene of a scenario; folder: where files of motions are written."""
    points: dict[str, Any] = {}
    lines: dict[str, Any] = {}
    friction = max(rod.friction for rod in scenario.rods)
    if any(rod.friction != friction for rod in scenario.rods):
        raise NotImplementedError("rods of different friction")
    for i, rod in enumerate(scenario.rods):
        ends = {end.value: f"rod{i}_{end.value}" for end in (End.START, End.END)}
        nodes = rod.nodes(cells)
        for end, place in ((End.START, nodes[0]), (End.END, nodes[-1])):
            points[ends[end.value]] = _point(rod, end, place, folder / f"rod{i}_{end.value}.csv", scenario.duration)
        even = np.linspace(0.0, rod.length, cells + 1)
        lines[f"rod{i}"] = {
            **ends,
            "model": "rod",
            "mesh": {"cells": cells},
            "sections": [_section(rod, _damping(scenario))],
            "initial": {"kind": "points", "points": nodes.tolist(), "arc_lengths": even.tolist()},
            "connections": _connections(rod, nodes),
            "contact": {"self": scenario.self_contact, "friction": rod.friction},
        }
    scene: dict[str, Any] = {"environment": _environment(scenario), "points": points, "lines": lines}
    if len(lines) > 1:
        scene["contact"] = {"friction": friction}
    if scenario.obstacles:
        scene["obstacles"] = {f"obstacle{k}": _obstacle(x, friction) for k, x in enumerate(scenario.obstacles)}
    return scene


def _environment(scenario: Scenario) -> dict[str, Any]:
    gravity = np.asarray(scenario.gravity, float)
    if gravity[:2].any() or gravity[2] > 0.0:
        raise NotImplementedError("gravity that is not along -z")
    return {"gravity": float(-gravity[2])}


def _section(rod: Rod, damping: float) -> dict[str, Any]:
    material, bending = rod.material, rod.second_moment_of_area
    return {
        "length": rod.length,
        "mass": material.density * rod.area,
        "diameter": 2.0 * rod.radius,
        "axial_stiffness": material.youngs_modulus * rod.area,
        "bending_stiffness": material.youngs_modulus * bending,
        "torsional_stiffness": material.shear_modulus * 2.0 * bending,
        "max_strain": STRAIN,
        "damping": {"mass": damping},
    }


def _point(rod: Rod, end: End, place: np.ndarray, file: Path, duration: float) -> dict[str, Any]:
    """The point at an end of a rod: free, with what pulls there, or held, with how it moves."""
    if rod.condition(end) is EndCondition.FREE:
        force = np.sum([load.force for load in rod.loads if load.at is end] or [(0.0, 0.0, 0.0)], axis=0)
        free = {"kind": "free", "initial_guess": place.tolist()}
        return free | ({"force": force.tolist()} if force.any() else {})
    motion = rod.motion(end)
    if motion is None:
        return {"position": place.tolist()}
    if motion.slides_along is not None:
        raise NotImplementedError("an end that is held across an axis and slides along it")
    _write_motion(motion, place, file, duration)
    return {"position": place.tolist(), "motion": {"file": str(file)}}


def _write_motion(motion: Motion, place: np.ndarray, file: Path, duration: float) -> None:
    """A motion as a table over time, each jump of velocity spread over the time that follows it."""
    times = np.linspace(0.0, duration, max(math.ceil(duration / (0.1 * CORNER)), FEWEST_ROWS) + 1)
    paths, corners = np.column_stack([motion.displacement, motion.rotation]), np.array(motion.times)
    speeds = np.diff(paths, axis=0) / np.diff(corners)[:, None]
    jumps = np.diff(speeds, axis=0, prepend=0.0, append=0.0)
    rows = _rise(times[:, None] - corners) @ jumps
    with file.open("w", newline="") as out:
        table = csv.writer(out)
        table.writerow(["t", "x", "y", "z", "rx", "ry", "rz"])
        table.writerows(np.column_stack([times, place + rows[:, :3], np.degrees(rows[:, 3:])]).tolist())


def _rise(t: np.ndarray) -> np.ndarray:
    """The way, over the velocity, of what begins to move at t = 0 and has this velocity CORNER (s) later."""
    x = np.clip(t / CORNER, 0.0, 1.0)
    return np.asarray(
        CORNER * (0.5 * x**2 + (np.cos(2.0 * np.pi * x) - 1.0) / (4.0 * np.pi**2)) + np.maximum(t - CORNER, 0.0)
    )


def _connections(rod: Rod, nodes: np.ndarray) -> dict[str, Any]:
    tangents = {End.START: nodes[1] - nodes[0], End.END: nodes[-1] - nodes[-2]}
    clamped = [end for end in tangents if rod.condition(end) is EndCondition.CLAMPED]
    return {end.value: {"kind": "clamped", "tangent": tangents[end].tolist()} for end in clamped}


def _obstacle(obstacle: Any, friction: float) -> dict[str, Any]:
    common = {"friction": max(obstacle.friction, friction)}
    if isinstance(obstacle, Cylinder):
        shape = {"kind": "cylinder", "at": obstacle.center, "axis": obstacle.axis, "radius": obstacle.radius}
        return shape | {"length": obstacle.length} | common
    return {"kind": "plane", "at": obstacle.point, "normal": obstacle.normal} | common


def _directors(x: np.ndarray, twist: np.ndarray, rod: Rod) -> np.ndarray:
    """Material direction (nt, n, 3) of each cell, from places x (nt, n+1, 3) m and twist (nt, n+1) rad/m.

    That of the first cell is carried from output to output along its chord: how a line whose ends turn freely spins as
    a whole is in no result.
    """
    chords = np.diff(x, axis=1)
    chords /= np.linalg.norm(chords, axis=2)[..., None]
    h = rod.length / chords.shape[1]
    angles = np.concatenate([np.zeros((len(x), 1)), np.cumsum(h * twist[:, 1:-1], axis=1)], axis=1)
    carried = np.empty_like(chords)
    carried[0, 0] = rod.directors(chords.shape[1])[0]
    for k in range(1, len(x)):
        carried[k, 0] = _carried(carried[k - 1, 0], chords[k - 1, 0], chords[k, 0])
    for i in range(1, chords.shape[1]):
        carried[:, i] = _carried(carried[:, i - 1], chords[:, i - 1], chords[:, i])
    turned = carried * np.cos(angles)[..., None] + np.cross(chords, carried) * np.sin(angles)[..., None]
    return np.asarray(turned)


def _carried(a: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Directions a (..., 3) turned by the smallest rotation from one unit tangent to another, and made normal to it."""
    middle = before + after
    reflected = (
        a - 2.0 * np.sum(a * middle, axis=-1, keepdims=True) / np.sum(middle * middle, axis=-1, keepdims=True) * middle
    )
    # Two reflections make the rotation: in the plane across the sum of both, and along the second tangent.
    turned = reflected - 2.0 * np.sum(reflected * after, axis=-1, keepdims=True) * after
    turned = turned - np.sum(turned * after, axis=-1, keepdims=True) * after
    return np.asarray(turned / np.linalg.norm(turned, axis=-1, keepdims=True))
