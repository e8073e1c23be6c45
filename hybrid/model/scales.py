"""Sizes of a whole scene: its weight in its surroundings, what it presses on its bed with, a tension typical of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hybrid.kernels.state.state import Line
from hybrid.model.sections import attached_weights, attachments_at, bending_stiffness, weight
from hybrid.scene.motion_tables import SHIFTS
from hybrid.scene.schema import LineScene, Section, Straight


def pressing(scene: LineScene) -> float:
    """The least weight per length (N/m) that a cable of the scene puts on its bed; its dry weight if it would float."""
    heavy = [w for w in (weight(x, scene) for x in scene.cable.sections) if w > 0.0]
    dry = [x.mass * (scene.environment.gravity or 1.0) for x in scene.cable.sections]
    return min(heavy or dry)


def net_weight(scene: LineScene) -> float:
    """Weight of the whole line with its attachments in its surroundings, N, positive downwards."""
    return sum(weight(x, scene) * x.length for x in scene.cable.sections) + sum(attached_weights(scene))


def tension_scale(scene: LineScene, sections: Sequence[Section], bending: bool, fastest: float = 0.0) -> float:
    """A tension typical of the scene, N: the largest that weight, loads, bending, drag, motion or speed can ask for.

    bending: whether bending counts, as it does where there is a rod; fastest: the current's highest speed, m/s.
    """
    length = scene.length
    mass = sum(s.mass * s.length for s in sections)
    candidates = [
        sum(abs(weight(s, scene)) * s.length for s in sections) + sum(abs(x) for x in attached_weights(scene))
    ]
    if bending:
        candidates += [max(bending_stiffness(s)) / length**2 for s in sections]
    fluid = scene.environment.fluid
    if fluid and fastest:
        candidates += [
            0.5 * fluid.density * s.diameter * s.drag.normal * fastest**2 * s.length
            for s in sections
            if s.drag and s.diameter
        ]
        candidates += [0.5 * fluid.density * x.drag_area * fastest**2 for _, x in attachments_at(scene)]
    for end in scene.ends.both:
        for load in end.loads:
            candidates.append(float(np.abs(load.values).max()) / (length if load.what == "moment" else 1.0))
        motion = end.prescribed_motion
        if motion is not None:
            candidates += [
                mass * abs(x.amplitude) * (2 * np.pi / x.period) ** 2
                for name, parts in motion.harmonics().items()
                if name in SHIFTS
                for x in parts
            ]
    first, last = (end.held_position for end in scene.ends.both)
    if first and last and all(s.stiffness for s in sections):
        free = length / sum(s.length / s.stiffness for s in sections if s.stiffness)  # N per unit strain
        candidates.append(free * max(0.0, float(np.linalg.norm(np.subtract(last, first))) / length - 1.0))
    velocity = scene.initial.velocity if isinstance(scene.initial, Straight) else None
    if velocity:
        candidates.append(mass / length * float(np.dot(velocity, velocity)))
    scale = max(candidates)
    if scale > 0.0:
        return scale
    return mass / length * (length / scene.time.duration) ** 2 if scene.time else 1.0


def wave_step(line: Line, scale: float) -> float:
    """The shortest time, s, in which a wave passes a catenary cell, 0 without catenaries: of tension, or, where a cell

    does not stretch, across the line under the tension `scale`, N.
    """
    cells = line.spin == 0
    mass = 0.5 * (line.mass[:-1] + line.mass[1:] - line.point_mass[:-1] - line.point_mass[1:])
    soft = np.where(line.ck > 0.0, line.ck, 1.0 / scale)
    return float(np.sqrt((soft * mass * line.h)[cells].min())) if cells.any() else 0.0
