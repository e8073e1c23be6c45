"""The model of a line that is clamped to free bodies or points, of a scene that differs from another in numbers alone.

How an end is seated in axes of what carries it follows from directions that the scene gives, as far as these know of
no first shape: then the arrays of the line are those of its scene, and no other line is looked at.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from hybrid.kernels.junctions.carried_frames import SEAT, WITH_BODY, WITH_POINT
from hybrid.kernels.state.state import Floats
from hybrid.model.bodies import BodyModel
from hybrid.model.build import Model
from hybrid.model.clamps import seat_of, untwisted, with_clamps
from hybrid.model.nearby import nearby
from hybrid.model.network import NetworkResolution, build_system, first_lines
from hybrid.scene.bodies import FixedBody
from hybrid.scene.network_scene import Network
from hybrid.scene.schema import LineScene

ENDS = ("start", "end")


def seats_know_no_shape(system: Network, name: str) -> bool:
    """Whether how a line is seated follows from directions that are given, whatever the first shapes of lines are.

    A material axis that is not given is that of a line without twist between both tangents; at a free point these are
    known from first shapes, and so it is where the other end holds no twist.
    """
    if system.surfaces:  # what is stiff by the pull of all lines, and left out beside its own body
        return False
    line = system.lines[name]
    clamps, points = [system.clamp(name, end) for end in ENDS], (line.start, line.end)
    if any(isinstance(body := system.body_of(p), FixedBody) and body.motion is not None for p in points):
        return False
    if any(x is not None and x.swivel for x in clamps):
        return False
    given = [x is not None and (x.normal is not None or p in system.rigid) for x, p in zip(clamps, points, strict=True)]
    if clamps[0] is None or clamps[1] is None:
        return clamps[1] is None or given[1]
    if all(given):
        return True
    one, other = (system.direction(name, end) for end in ENDS)
    return one is not None and other is not None and None not in [x[1] for x in untwisted(one, other)]


def nearby_clamped(
    model: Model,
    of: LineScene,
    system: Network,
    name: str,
    bodies: Sequence[BodyModel],
    resolution: NetworkResolution,
    without: int,
) -> tuple[Model, Floats] | None:
    """The model of a line of `system`, and its seats (2, SEAT), zeros where an end turns with nothing; None: its cells

    are others.  model, of, without: as of `nearby`, of the line with the points that it carries; bodies: the free ones.
    """
    first = first_lines(system, bodies, resolution)
    directions, carried = first.directions(name), system.carried(name)
    scene = first.scene(name, (), directions)
    found = nearby(model, of, scene, resolution.lines[name], without, clamped=True)
    if found is None:
        return None
    seats, held = np.zeros((2, SEAT)), [k for k, end in enumerate(ENDS) if system.clamp(name, end) is not None]
    for k in held:
        point = getattr(system.lines[name], ENDS[k])
        axes = first.axes(point)
        if axes is not None:
            kind = WITH_POINT if point in system.rigid else WITH_BODY
            seats[k] = seat_of(found.ends.values.frame[k], axes, kind)
    if not carried:
        return found, seats
    other = nearby(model, of, first.scene(name, carried, directions), resolution.lines[name], without, clamped=True)
    if other is None:
        return None
    other = with_clamps(other, found, held)
    other.ends.values.frame[held] = found.ends.values.frame[held]
    return replace(other, start=model.start), seats


def shaped_anew(
    system: Network, names: Iterable[str], bodies: Sequence[BodyModel], resolution: NetworkResolution
) -> dict[str, tuple[Model, Floats]]:
    """Models of some lines with their seats (2, SEAT), as first shapes have them; bodies: the free ones.

    Points are turned as the lines lie that are clamped there; no other line is built.
    """
    if system.surfaces or system.dimension == 2:  # what a line is beside, or in which plane, hangs on all of them
        built = build_system(system, resolution)
        models, seats = (
            dict(zip(built.names, built.models, strict=True)),
            dict(zip(built.names, built.seats, strict=True)),
        )
        return {name: (models[name], seats[name]) for name in names}
    maker = first_lines(system, bodies, resolution)
    maker.turn_points()
    order = list(system.lines)
    return {name: (maker.model(name), maker.seats[order.index(name)]) for name in names}
