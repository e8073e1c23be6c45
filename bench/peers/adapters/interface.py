"""What adapters of other programs share: the run, the line in their terms, the result."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from hybrid.model.build import build
from hybrid.model.sections import output_points
from hybrid.scene.ends import Pinned
from hybrid.scene.motion import EndMotion
from hybrid.scene.motion_checks import shortest_period
from hybrid.scene.read import one_line, validate_scene
from hybrid.scene.root import Scene

# Depth, m, of the upper end below the surface of the other code, for a scene without one: more than any heave.
SUBMERGENCE = 50.0
# Over this time, s, the acceleration of an end is taken from its velocity: short against any period, long against
# round-off of a velocity (1e-12 over 1e-4).
DIFFERENCE_TIME = 1e-4
Values = dict[str, np.ndarray]


class PeerFailed(Exception):
    """A run of another code failed, and why."""


@dataclass(frozen=True)
class PeerRun:
    """A run; per_period: steps per shortest period, None: by stability; unsupported: why it cannot be made, else ""."""

    code: str
    model: str
    package: str
    elements: int = 0
    per_period: int | None = None
    unsupported: str = ""

    @property
    def settings(self) -> str:
        """Settings, in words."""
        if self.unsupported:
            return ""
        steps = f"{self.per_period} steps per period" if self.per_period else "steps by stability"
        return f"{self.elements} elements, {steps}"

    @property
    def name(self) -> str:
        return f"{self.code} {self.settings}"

    @property
    def tag(self) -> str:
        """Of the name of what is kept."""
        return f"-{self.code}-{self.elements}-{self.per_period or 0}"


@dataclass(frozen=True)
class PeerResult:
    """Position (nt, ns, 3) m and force on the cable at both ends (nt, 3) N at the outputs of the scene; cost.

    A force with one component (nt, 1) is a magnitude: the code gives no more.
    """

    values: Values
    cpu: float  # s, from the input file to the last output, statics included
    steps: int


@dataclass(frozen=True)
class Line:
    """The scene in the terms that all of them know, z = 0 at the surface."""

    length: float
    diameter: float
    mass: float
    ea: float
    ei: float
    drag: tuple[float, float]
    added: float
    gravity: float
    density: float
    bed: tuple[float, float, float] | None  # z, stiffness and damping per metre of line
    ends: tuple[EndMotion, EndMotion]
    period: float
    up: float  # m, from the scene's heights to these
    s: np.ndarray
    scene: Scene

    @property
    def shift(self) -> np.ndarray:
        return np.array([0.0, 0.0, self.up])

    def end(self, k: int, t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Position, velocity, acceleration (3,) of an end."""
        q, v = self.ends[k].at_time(t)[:2]
        before, after = max(t - DIFFERENCE_TIME, 0.0), t + DIFFERENCE_TIME
        a = (self.ends[k].at_time(after)[1] - self.ends[k].at_time(before)[1]) / (after - before)
        return q + self.shift, v, a

    def hanging(self, elements: int) -> np.ndarray:
        """Nodes (n+1, 3) of the elastic catenary that our own statics start from."""
        data = self.scene.model_dump(mode="json", exclude_none=True) | {
            "model": "catenary",
            "mesh": {"cells": elements},
        }
        return np.asarray(build(one_line(validate_scene(data))).start.r) + self.shift

    def places(self, nodes: np.ndarray) -> np.ndarray:
        """Positions (ns, 3) at the output points, by a spline through nodes (n+1, 3) that are equally spaced."""
        from scipy.interpolate import CubicSpline

        spline = CubicSpline(np.linspace(0.0, self.length, len(nodes)), nodes)
        return np.asarray(spline(self.s)) - self.shift


class Peer(Protocol):
    """What an adapter has."""

    @property
    def model(self) -> str: ...
    @property
    def package(self) -> str: ...
    @property
    def settings(self) -> Sequence[tuple[int, int | None]]: ...  # elements, steps to a period

    def run(self, line: Line, peer_run: PeerRun, times: list[float]) -> PeerResult: ...


def line_of(scene: Scene) -> Line:
    section, fluid, bed = scene.cable.sections[0], scene.environment.fluid, scene.environment.seabed
    assert fluid is not None and section.diameter is not None and section.axial_stiffness is not None
    ends = [x for x in (scene.ends.start, scene.ends.end) if isinstance(x, Pinned)]
    top = max(x.position[2] for x in ends)
    up = -fluid.surface if fluid.surface is not None else -top - SUBMERGENCE
    drag = (section.drag.normal, section.drag.tangential) if section.drag else (0.0, 0.0)
    stiff = section.bending_stiffness
    return Line(
        section.length, section.diameter, section.mass, section.axial_stiffness,
        stiff if isinstance(stiff, float) else 0.0, drag, section.added_mass.normal if section.added_mass else 0.0,
        scene.environment.gravity, fluid.density, (bed.z + up, bed.stiffness, bed.damping) if bed else None,
        (EndMotion(ends[0].motion, ends[0].position), EndMotion(ends[1].motion, ends[1].position)),
        min(shortest_period(scene.ends, scene.environment), scene.require_time().duration),
        up, output_points(one_line(scene)).s, scene,
    )  # fmt: skip


def steps_per_output(times: list[float], most: float) -> int:
    """Steps of at most so long to the shortest interval between two outputs."""
    return max(1, math.ceil(float(np.diff(times).min()) / most - 1e-9))


def output_values(line: Line, nodes: np.ndarray, line_forces: list[Any]) -> Values:
    """What is compared at one output; line_forces: of the line on its two points; the reactions are the opposite."""
    start, end = (-np.asarray(force, dtype=float) for force in line_forces)
    return {"position": line.places(np.asarray(nodes)), "reaction_start": start, "reaction_end": end}


def stacked(samples: list[Values]) -> Values:
    return {name: np.stack([each[name] for each in samples]) for name in samples[0]}
