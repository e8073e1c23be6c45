"""Ends of lines that are clamped to points and bodies: frames in axes of these, axes of free points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from hybrid.kernels.junctions.carried_frames import SEAT, TURNS, WITH_BODY
from hybrid.kernels.state.state import Floats
from hybrid.model.build import Model
from hybrid.model.ends import first_director, transported
from hybrid.model.layout import LineOnBase
from hybrid.scene.ends import Triple
from hybrid.scene.network import Network

STRAIGHT = (1.0, 0.0, 0.0)  # direction of a line through a free point in axes of that, where none is given
SECOND = 1e-3  # weight of the material axis of the first line at a free point against directions of lines

OPPOSITE = -0.9  # cosine of the angle of tangents that count as opposite

Ends = tuple[str, str]  # name of a line, and `start` or `end`
Held = tuple[Triple, Triple | None]  # inertial tangent and material axis a1 of an end


def directions_at_rigid(system: Network, point: str) -> dict[Ends, tuple[Floats, Floats]]:
    """Tangent and material axis a1 (3,) of each line that is clamped to a free point, in axes of the point."""
    found: dict[Ends, tuple[Floats, Floats]] = {}
    here = system.clamped_at(point)
    for name, end in here:
        held = system.clamp(name, end)
        assert held is not None
        tangent = np.array(held.tangent or STRAIGHT)
        if held.tangent is None and (name, end) != here[0] and end == here[0][1]:
            tangent = -tangent  # both lines run to the point, or from it
        tangent = tangent / np.linalg.norm(tangent)
        found[name, end] = tangent, first_director(tangent, held.normal)
    return found


def axes_of_point(
    directions: Mapping[Ends, tuple[Floats, Floats]], models: Mapping[str, Model], far: Held | None
) -> Floats:
    """Axes (3, 3) of a free point that fit best to how the lines that are clamped to it lie.

    far: tangent and material axis at the other end of the first line, so that this is not twisted; None: it may be.
    """
    H = np.zeros((3, 3))
    for k, ((name, end), (tangent, director)) in enumerate(directions.items()):
        cell = 0 if end == "start" else -1
        d = models[name].start.e[cell] / np.linalg.norm(models[name].start.e[cell])
        H += np.outer(d, tangent)
        if k == 0:
            a1 = models[name].start.a1[cell] if far is None else brought(far, tuple(d.tolist()))
            H += SECOND * np.outer(a1, director)
    U, _, V = np.linalg.svd(H)
    return np.asarray(U @ np.diag([1.0, 1.0, np.linalg.det(U @ V)]) @ V)


def brought(held: Held, tangent: Triple) -> Floats:
    """The material axis (3,) of one end at the other, whose tangent is given, of a line bent the short way between."""
    first = first_director(held[0], held[1])
    return np.asarray(transported(first, np.array([held[0], tangent], float))[-1])


def untwisted(start: Held, end: Held) -> tuple[Held, Held]:
    """Both ends with material axes, of a line without twist where they are not given.

    It is bent the short way from tangent to tangent: first shapes of lines are far from where they come to rest, and
    may be folded.  Tangents that are nearly opposite have no such way: they stay as they are.
    """
    a, b = (np.array(x[0], float) / np.linalg.norm(x[0]) for x in (start, end))
    if a @ b < OPPOSITE or (start[1] is not None and end[1] is not None):
        return start, end
    if start[1] is None and end[1] is not None:
        return (start[0], _triple(brought(end, start[0]))), end
    first = start[0], _triple(first_director(start[0], start[1]))
    return first, (end[0], _triple(brought(first, end[0])))


def _triple(x: Floats) -> Triple:
    return float(x[0]), float(x[1]), float(x[2])


def seat_of(frame: Floats, axes: Floats, kind: float = WITH_BODY) -> Floats:
    """(SEAT,) of an end whose frame (9,) turns with axes (3, 3); kind: of a body or of a point."""
    seat = np.zeros(SEAT)
    seat[:TURNS] = (axes.T @ frame.reshape(3, 3)).ravel()
    seat[TURNS] = kind
    return seat


def seated(seat: Floats, axes: Floats) -> tuple[Triple, Triple]:
    """Inertial tangent and material axis a1 of an end with a seat, in axes (3, 3)."""
    frame = (axes @ seat[:TURNS].reshape(3, 3)).tolist()
    tangent, director = ((frame[0][i], frame[1][i], frame[2][i]) for i in (2, 0))
    return tangent, director


def with_clamps(model: Model, clamped: Model, ends: Sequence[int]) -> Model:
    """The model with the elements that another one of the same line has at these ends, and what they hold."""
    line = model.line
    names = ("element", "kb", "k0", "hn", *(("bend_law",) if line.bend_law.size else ()))
    new = {name: getattr(line, name).copy() for name in names}
    for k in ends:
        for name, values in new.items():
            values[-k] = getattr(clamped.line, name)[-k]
    line = line._replace(torsion=clamped.line.torsion, **new)
    if model.layout is None:
        return replace(model, line=line)
    held = ("held_tangent", "held_twist", "springs", "hinged")
    cable = replace(model.cable, **{name: getattr(clamped.cable, name) for name in held})
    return replace(model, line=line, cable=cable, on_base=LineOnBase(cable, model.layout.base))
