"""What is recorded of the points and bodies of a system of lines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hybrid.kernels.run.network import (
    SAMPLE_AXES,
    SAMPLE_DONE,
    SAMPLE_ENERGIES,
    SAMPLE_LINES,
    SAMPLE_PLACE,
    SAMPLE_V,
    SAMPLE_W,
)
from hybrid.kernels.state.report import FORCE_A, MOMENT_A
from hybrid.kernels.state.state import Batch, Floats
from hybrid.model.bodies import angles_of
from hybrid.model.network import NetworkModel
from hybrid.outputs.probes import elevation, elevation_field
from hybrid.scene.bodies import FreeBody
from hybrid.scene.network import Network
from hybrid.scene.points import Fairlead, FreePoint, GuidedPoint, Point
from hybrid.store.format import Field

WORKS = ("lines", "damping", "loads")


def fields_of(system: Network) -> list[Field]:
    """Place and velocity of all points and bodies, forces on them, energies of free bodies, and the sea at gauges."""

    def vector(name: str, unit: str, what: str) -> Field:
        return Field(name, unit, what, (3,), ("xyz",), "inertial")

    fields = []
    for name, point in system.points.items():
        at = f"points/{name}"
        fields.append(vector(f"{at}/position", "m", f"position of point {name}"))
        fields.append(vector(f"{at}/velocity", "m/s", f"velocity of point {name}"))
        if isinstance(point, GuidedPoint):
            what = f"moment of the line that is clamped at point {name}, about it, which its support bears"
            fields.append(vector(f"{at}/moment", "N m", what))
        elif not isinstance(point, FreePoint):
            bears = "its body" if system.body_of(name) is not None else "its support"
            fields.append(vector(f"{at}/force", "N", f"force of the lines on point {name}, which {bears} bears"))
            if system.clamped_at(name):
                what = f"moment of the lines that are clamped at point {name}, about it, which {bears} bears"
                fields.append(vector(f"{at}/moment", "N m", what))
        elif system.clamped_at(name):
            turns = f"rotation of point {name}: roll, pitch and yaw of its axes, about x, then y, then z"
            fields.append(Field(f"{at}/rotation", "deg", turns, (3,), ("xyz",), "inertial"))
    for name, body in system.bodies.items():
        at = f"bodies/{name}"
        fields.append(vector(f"{at}/position", "m", f"position of the origin of body {name}"))
        turns = f"rotation of body {name}: roll, pitch and yaw, about x, then y, then z; beyond half a turn, too"
        fields.append(Field(f"{at}/rotation", "deg", turns, (3,), ("xyz",), "inertial"))
        fields.append(vector(f"{at}/velocity", "m/s", f"velocity of the origin of body {name}"))
        fields.append(vector(f"{at}/angular_velocity", "rad/s", f"angular velocity of body {name}"))
        fields.append(vector(f"{at}/force", "N", f"force of the lines on body {name}"))
        fields.append(vector(f"{at}/moment", "N m", f"moment of the lines on body {name} about its origin"))
        if isinstance(body, FreeBody):
            fields.append(Field(f"{at}/energy/kinetic", "J", f"kinetic energy of body {name}, with its added mass"))
            what = f"potential energy of body {name}: weight, buoyancy and hydrostatics"
            fields.append(Field(f"{at}/energy/potential", "J", what))
            for work in WORKS:
                what = {"lines": "its lines", "damping": "its damping", "loads": "given loads"}[work]
                fields.append(Field(f"{at}/work/{work}", "J", f"work done on body {name} by {what} since t = 0"))
    if system.output.elevation:
        fields.append(elevation_field(gauges_of(system)))
    return fields


def gauges_of(system: Network) -> Floats:
    """Places (n, 2) m at which the elevation of the sea is recorded."""
    return np.array(system.output.elevation or (), float).reshape(-1, 2)


class Sampled(NamedTuple):
    """Outputs of a system: nb states of its lines and bodies."""

    lines: Sequence[Batch]
    bodies: Floats  # (nb, B, BODY_SAMPLE) of kernels.run.network

    @property
    def t(self) -> Floats:
        """Times (nb,), s; an array of one's own."""
        return self.lines[0].t.copy()

    def frame(self, body: int) -> Floats:
        """Axes (nb, 3, 3) of a body, as columns."""
        return self.bodies[:, body, SAMPLE_AXES:SAMPLE_V].reshape(-1, 3, 3)

    def spin(self, body: int) -> Floats:
        """Its angular velocity (nb, 3) 1/s, inertial."""
        return times(self.frame(body), self.bodies[:, body, SAMPLE_W:SAMPLE_LINES])


def times(frames: Floats, x: Floats) -> Floats:
    """Frames (nb, 3, 3) times vectors (nb, 3), or one (3,): the same bits for each, however many there are."""
    return np.asarray(frames[..., 0] * x[..., :1] + frames[..., 1] * x[..., 1:2] + frames[..., 2] * x[..., 2:])


def values_of(system: Network, model: NetworkModel, seen: Sampled) -> dict[str, Floats]:
    """The values (nb, ...) of all fields for outputs."""
    values: dict[str, Floats] = {}
    t, count = seen.t, len(seen.bodies)
    if system.output.elevation:  # the sea is that of every line
        values["elevation"] = elevation(model.models[0].sea.values, gauges_of(system), seen.lines[0].sea_now)
    pulls: dict[str, list[tuple[Floats, Floats, Floats]]] = {name: [] for name in system.bodies}
    none = np.zeros((count, 3))
    for name, point in system.points.items():
        at = [(model.names.index(line), -(end == "end")) for line, end in system.lines_at(name)]
        here = [(line, node) for line, node in at if (line, -node) not in model.loose]
        position, velocity = _place(model, seen, point, at[0], here)
        values[f"points/{name}/position"], values[f"points/{name}/velocity"] = position, velocity
        if isinstance(point, FreePoint):
            if name in model.rigid:
                frames = seen.frame(len(model.bodies) + model.rigid.index(name))
                values[f"points/{name}/rotation"] = angles_of(frames)
            continue
        moment = _clamp_moment(system, model, seen, name)
        if moment is not None:
            values[f"points/{name}/moment"] = moment
        if isinstance(point, GuidedPoint):
            continue
        reports = [(seen.lines[k].report, FORCE_A - 3 * node) for k, node in here]
        values[f"points/{name}/force"] = force = sum((r[:, f : f + 3] for r, f in reports), none)
        if system.body_of(name) is not None:
            pulls[point.body].append((position, force, none if moment is None else moment))  # type: ignore[union-attr]
    for name, known in model.known.items():
        found = [known.at_time(x) for x in t]
        position, velocity, frame, spin = (np.array(x) for x in zip(*found, strict=True))
        force = sum((f for _, f, _ in pulls[name]), none)
        moment = sum((np.cross(place - position, f) + m for place, f, m in pulls[name]), none)
        values |= _of_body(name, position, frame, velocity, spin, force, moment)
    for k, body in enumerate(model.bodies):
        x, at_body = seen.bodies[:, k], f"bodies/{body.name}"
        force, moment = x[:, SAMPLE_LINES : SAMPLE_LINES + 3], x[:, SAMPLE_LINES + 3 : SAMPLE_ENERGIES]
        place, velocity = x[:, SAMPLE_PLACE:SAMPLE_AXES], x[:, SAMPLE_V:SAMPLE_W]
        values |= _of_body(body.name, place, seen.frame(k), velocity, seen.spin(k), force, moment)
        for o, energy in enumerate(("kinetic", "potential"), SAMPLE_ENERGIES):
            values[f"{at_body}/energy/{energy}"] = x[:, o].copy()
        values |= {f"{at_body}/work/{work}": x[:, o].copy() for o, work in enumerate(WORKS, SAMPLE_DONE)}
    return values


def _clamp_moment(system: Network, model: NetworkModel, seen: Sampled, point: str) -> Floats | None:
    """Moment (nb, 3) N m of the lines that are clamped at a point, about it; None: there are none."""
    here = system.clamped_at(point)
    if not here:
        return None
    moment = np.zeros((len(seen.bodies), 3))
    for line, end in here:
        k = model.names.index(line)
        if (k, int(end == "end")) in model.loose:
            continue
        report = seen.lines[k].report
        moment += report[:, MOMENT_A : MOMENT_A + 3] if end == "start" else -report[:, MOMENT_A + 3 : MOMENT_A + 6]
    return moment


def _place(
    model: NetworkModel, seen: Sampled, point: Point, first: tuple[int, int], here: Sequence[tuple[int, int]]
) -> tuple[Floats, Floats]:
    """Positions and velocities (nb, 3) of a point; first: line and node that began there, here: those still there."""
    if here:
        line, node = here[0]
        return seen.lines[line].r[:, node].copy(), seen.lines[line].v[:, node].copy()
    for k, body in enumerate(model.bodies):
        if isinstance(point, Fairlead) and point.body == body.name:
            x = seen.bodies[:, k]
            arm = times(seen.frame(k), np.array(point.place))
            velocity = x[:, SAMPLE_V:SAMPLE_W] + np.cross(seen.spin(k), arm)
            return x[:, SAMPLE_PLACE:SAMPLE_AXES] + arm, velocity
    line, node = first
    ends, found = model.supports.get((line, -node), model.models[line].ends), []
    for t in seen.t:
        ends.at_time(t)
        found.append((ends.values.position[-node].copy(), ends.velocity[-node].copy()))
    position, velocity = (np.array(x) for x in zip(*found, strict=True))
    return position, velocity


def _of_body(
    name: str, position: Floats, frame: Floats, velocity: Floats, spin: Floats, force: Floats, moment: Floats
) -> dict[str, Floats]:
    keys = ("position", "rotation", "velocity", "angular_velocity", "force", "moment")
    found = (position, angles_of(frame), velocity, spin, force, moment)
    return {f"bodies/{name}/{key}": np.array(x) for key, x in zip(keys, found, strict=True)}
