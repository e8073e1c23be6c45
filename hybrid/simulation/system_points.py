"""What is recorded of the points and bodies of a system of lines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hybrid.kernels.junctions.bodies import DONE, FRAME, KINETIC, LINES, PLACE, POTENTIAL, V, W
from hybrid.kernels.state.report import FORCE_A, MOMENT_A
from hybrid.kernels.state.state import Floats
from hybrid.model.bodies import angles_of
from hybrid.model.system import SystemModel
from hybrid.outputs.probes import elevation, elevation_field
from hybrid.scene.bodies import FreeBody
from hybrid.scene.points import Fairlead, FreePoint, Point
from hybrid.scene.system import System
from hybrid.solve.joined import SystemState
from hybrid.solve.system import SystemSolver
from hybrid.store.format import Field

WORKS = ("lines", "damping", "loads")


def fields_of(system: System) -> list[Field]:
    """Place and velocity of all points and bodies, forces on them, energies of free bodies, and the sea at gauges."""

    def vector(name: str, unit: str, what: str) -> Field:
        return Field(name, unit, what, (3,), ("xyz",), "inertial")

    fields = []
    for name, point in system.points.items():
        at = f"points/{name}"
        fields.append(vector(f"{at}/position", "m", f"position of point {name}"))
        fields.append(vector(f"{at}/velocity", "m/s", f"velocity of point {name}"))
        if not isinstance(point, FreePoint):
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


def gauges_of(system: System) -> Floats:
    """Places (n, 2) m at which the elevation of the sea is recorded."""
    return np.array(system.output.elevation or (), float).reshape(-1, 2)


def values_of(
    system: System, model: SystemModel, solver: SystemSolver, state: SystemState, t: float
) -> dict[str, Any]:  # fmt: skip
    """The values of all fields for a state at t (s) and the forces that the solver has found for it."""
    values: dict[str, Any] = {}
    if system.output.elevation:
        sea = model.models[0].sea.values  # of the time t, as of every line
        values["elevation"] = elevation(sea, gauges_of(system), sea.now[None])[0]
    pulls: dict[str, list[tuple[Floats, Floats, Floats]]] = {name: [] for name in system.bodies}
    for name, point in system.points.items():
        at = [(model.names.index(line), -(end == "end")) for line, end in system.lines_at(name)]
        here = [(line, node) for line, node in at if (line, -node) not in model.loose]
        position, velocity = _place(model, state, point, at[0], here)
        values[f"points/{name}/position"], values[f"points/{name}/velocity"] = position, velocity
        if isinstance(point, FreePoint):
            if name in model.rigid:
                row = state.bodies[len(model.bodies) + model.rigid.index(name)]
                values[f"points/{name}/rotation"] = angles_of(row[FRAME:V].reshape(3, 3))
            continue
        reports = [(solver.work[k].report, FORCE_A - 3 * node) for k, node in here]
        values[f"points/{name}/force"] = force = sum((r[f : f + 3] for r, f in reports), np.zeros(3))
        moment = clamp_moment(system, model, solver, name)
        if moment is not None:
            values[f"points/{name}/moment"] = moment
        if system.body_of(name) is not None:
            pulls[point.body].append((position, force, np.zeros(3) if moment is None else moment))  # type: ignore[union-attr]
    for name, known in model.known.items():
        position, velocity, frame, spin = known.at(t)
        assert frame is not None
        force = sum((f for _, f, _ in pulls[name]), np.zeros(3))
        moment = sum((np.cross(place - position, f) + m for place, f, m in pulls[name]), np.zeros(3))
        values |= _of_body(name, position, frame, velocity, spin, force, moment)
    for body, row, work in zip(model.bodies, state.bodies, solver.body_work, strict=False):
        R, at_body = row[FRAME:V].reshape(3, 3), f"bodies/{body.name}"
        force, moment = work[LINES : LINES + 3].copy(), work[LINES + 3 : LINES + 6].copy()
        values |= _of_body(
            body.name, row[PLACE:FRAME].copy(), R, row[V : V + 3].copy(), R @ row[W : W + 3], force, moment
        )
        values[f"{at_body}/energy/kinetic"], values[f"{at_body}/energy/potential"] = work[KINETIC], work[POTENTIAL]
        values |= {f"{at_body}/work/{key}": work[DONE + k] for k, key in enumerate(WORKS)}
    return values


class Rotations:
    """Roll, pitch and yaw of bodies and points that go on from output to output, beyond half a turn."""

    def __init__(self, system: System, model: SystemModel) -> None:
        """They begin within half a turn of what the scene gives for bodies, and of 0 for points."""
        begin = {f"points/{name}/rotation": np.zeros(3) for name in model.rigid}
        for name, body in system.bodies.items():
            given = body.initial_rotation if isinstance(body, FreeBody) else body.rotation
            begin[f"bodies/{name}/rotation"] = np.array(given, float)
        self.names = list(begin)
        self.last = np.array(list(begin.values())).reshape(-1, 3)  # (n, 3) deg

    def go_on(self, values: dict[str, Any]) -> None:
        """Put in place of the rotations in `values` the same ones, deg, that are nearest to those of the last call."""
        for k, name in enumerate(self.names):
            if name in values:
                self.last[k] = nearest_angles(values[name], self.last[k])
                values[name] = self.last[k].copy()


def nearest_angles(angles: Floats, before: Floats) -> Floats:
    """Roll, pitch and yaw (3,) deg of the same rotation as `angles`, nearest to `before`.

    The same: whole turns of each, or half a turn more of roll and yaw with 180 deg - pitch in place of pitch.
    """
    other = np.array([angles[0] + 180.0, 180.0 - angles[1], angles[2] + 180.0])
    both = [x + 360.0 * np.round((before - x) / 360.0) for x in (np.asarray(angles, float), other)]
    return min(both, key=lambda x: float(((x - before) ** 2).sum()))


def clamp_moment(system: System, model: SystemModel, solver: SystemSolver, point: str) -> Floats | None:
    """Moment (3,) N m of the lines that are clamped at a point, about it; None: there are none."""
    here = system.clamped_at(point)
    if not here:
        return None
    moment = np.zeros(3)
    for line, end in here:
        if (model.names.index(line), int(end == "end")) in model.loose:
            continue
        report = solver.work[model.names.index(line)].report
        moment += report[MOMENT_A : MOMENT_A + 3] if end == "start" else -report[MOMENT_A + 3 : MOMENT_A + 6]
    return moment


def _place(
    model: SystemModel, state: SystemState, point: Point, first: tuple[int, int], here: Sequence[tuple[int, int]]
) -> tuple[Floats, Floats]:
    """Position and velocity of a point; first: line and node that began there, here: those that are still there."""
    if here:
        line, node = here[0]
        return state.lines[line].r[node].copy(), state.lines[line].v[node].copy()
    for body, row in zip(model.bodies, state.bodies, strict=False):
        if isinstance(point, Fairlead) and point.body == body.name:
            R = row[FRAME:V].reshape(3, 3)
            arm = R @ np.array(point.place)
            return row[PLACE:FRAME] + arm, row[V : V + 3] + np.cross(R @ row[W : W + 3], arm)
    line, node = first
    ends = model.models[line].ends
    return ends.values.position[-node].copy(), ends.velocity[-node].copy()


def _of_body(
    name: str, position: Floats, frame: Floats, velocity: Floats, spin: Floats, force: Floats, moment: Floats
) -> dict[str, Any]:
    keys = ("position", "rotation", "velocity", "angular_velocity", "force", "moment")
    found = (position, angles_of(frame), velocity, spin, force, moment)
    return {f"bodies/{name}/{key}": np.array(x) for key, x in zip(keys, found, strict=True)}
