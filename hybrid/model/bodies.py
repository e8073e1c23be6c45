"""Rigid bodies as numbers, and ends that are clamped to them.

What a free body is, where it is first, what loads it, and how a known one moves; frames of ends in axes of the points
and bodies that they are clamped to.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from hybrid.kernels.junctions.bodies import (
    ARM,
    DAMPING,
    FORCE,
    FRAME,
    LEVEL,
    LIFT,
    MASS,
    MOMENT,
    NUMBERS,
    PIECES,
    PLACE,
    STATE,
    STIFFNESS,
    V,
    blank_members_job,
    update_members,
)
from hybrid.kernels.junctions.joined_lines import SEAT, TURNS, WITH_BODY
from hybrid.kernels.laws.water import ALONG, CM, CN, CT, MIDDLE, PIECE, WET
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.state.state import Floats, Sea
from hybrid.model.build import Model
from hybrid.model.ends import EndLoad, end_load, first_director, transported
from hybrid.model.mesh import LineOnBase
from hybrid.model.sea import Surroundings
from hybrid.scene.base import turned
from hybrid.scene.bodies import FixedBody, FreeBody
from hybrid.scene.ends import Triple
from hybrid.scene.motion import EndMotion, MotionTerms
from hybrid.scene.motion_tables import GivenLoad
from hybrid.scene.network import Network

# Morison members of a body as pieces: coefficients, added mass, and the water around them.


def pieces_of(body: FreeBody, density: float) -> tuple[Floats, Floats]:
    """Numbers (n, PIECE) of the pieces of all members in a fluid, and their sizes (n, 3).

    density: kg/m3, of the fluid; sizes: added mass across a piece (kg), length (m), diameter (m).
    """
    rows, sizes = [], []
    for x in body.members:
        start, end = np.array(x.start), np.array(x.end)
        h = math.dist(x.start, x.end) / x.pieces
        displaced = density * 0.25 * math.pi * x.diameter**2 * h
        for k in range(x.pieces):
            row = np.zeros(PIECE)
            row[MIDDLE:ALONG] = start + (k + 0.5) / x.pieces * (end - start)
            row[ALONG:CN] = (end - start) / (h * x.pieces)
            row[CN], row[CT] = (0.5 * density * x.diameter * h * c for c in (x.drag, math.pi * x.axial_drag))
            row[CM] = (1.0 + x.added_mass) * displaced
            rows.append(row)
            sizes.append((x.added_mass * displaced, h, x.diameter))
    return np.array(rows).reshape(-1, PIECE), np.array(sizes).reshape(-1, 3)


class Members:
    """The pieces of a body in the sea."""

    def __init__(self, pieces: Floats, sizes: Floats, around: Surroundings) -> None:
        """pieces, sizes: of `pieces_of`."""
        self.pieces, self._sizes = pieces, sizes
        self._sea = around.on(len(pieces) - 1)
        self._sea.values = self._sea.values._replace(now=self._sea.values.now.copy())
        self._job, self._state, self._asked = Table(blank_members_job), np.zeros(STATE), np.zeros((2, 1))
        places, still = np.zeros((2, len(pieces), 3))
        self._job.bind(sea=self._sea.values, pieces=pieces, sizes=sizes, places=places, still=still, state=self._state)
        self._job.bind(dt=self._asked[0], waves=self._asked[1])

    @property
    def sea(self) -> Sea:
        """The sea around the pieces, with room for as many places, as it was last asked for."""
        return self._sea.values

    @property
    def lengths(self) -> Floats:
        """(n,) m of the pieces."""
        return self._sizes[:, 1]

    def heights(self, axes: Floats) -> Floats:
        """(n,) m over which the pieces become wet, of a body with axes (3, 3)."""
        up = np.minimum(np.abs(self.pieces[:, ALONG:CN] @ axes[2]), 1.0)
        return np.asarray(up * self._sizes[:, 1] + np.sqrt(1.0 - up**2) * self._sizes[:, 2])

    def added_mass(self, row: Floats) -> Floats:
        """(6, 6) about the origin in axes of the body, of the pieces as far as they are wet in a row of a state."""
        M, out = np.zeros((6, 6)), self.pieces.copy()
        self.update_water(np.inf, row, 0.0, out)
        for x, mass in zip(out, out[:, WET] * self._sizes[:, 0], strict=True):
            p, d = x[MIDDLE:ALONG], x[ALONG:CN]
            G = np.hstack([np.eye(3), np.cross(np.eye(3), p).T])  # velocity there: v + w x p
            M += G.T @ (mass * (np.eye(3) - np.outer(d, d))) @ G
        return M

    def update_water(self, t: float, row: Floats, dt: float, out: Floats) -> None:
        """Write wetness and water at t (s; infinity: without waves) into `out` (n, PIECE).

        row: of a state, that the body has dt (s) before.
        """
        self._sea.at_time(t)
        self._state[:], self._asked[:, 0] = row, (dt, np.isfinite(t))
        update_members(self.into(out).numbers)

    def into(self, out: Floats) -> Table:
        """Arguments of kernels.junctions.bodies.update_members, which writes into `out` (n, PIECE)."""
        self._job.bind(out=out)
        return self._job


# Rigid bodies as numbers: what a free one is, where it is first, what loads it, and how a known one moves.


def frame_of(rotation: tuple[float, float, float]) -> Floats:
    """Axes (3, 3) of a body turned by roll, pitch and yaw (deg), as columns."""
    axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    return np.array([turned(rotation, x) for x in axes]).T


def angles_of(frame: Floats) -> Floats:
    """Roll, pitch and yaw (..., 3) deg of axes (..., 3, 3)."""
    x, z = frame[..., 0, :], frame[..., 2, :]
    roll, pitch = np.arctan2(z[..., 1], z[..., 2]), np.arcsin(np.clip(-z[..., 0], -1.0, 1.0))
    return np.degrees(np.stack([roll, pitch, np.arctan2(frame[..., 1, 0], x[..., 0])], axis=-1))


def loads_of(given: tuple[GivenLoad, ...]) -> tuple[EndLoad, ...]:
    """Forces and moments that a scene gives."""
    return tuple(end_load(x, 0) for x in given)


@dataclass(frozen=True)
class BodyModel:
    """A free body made ready to compute."""

    name: str
    numbers: Floats  # (NUMBERS,) of kernels.junctions.bodies, without what is given to act on it
    start: Floats  # (STATE,) where it is first looked for
    loads: tuple[EndLoad, ...]  # forces and moments that are given
    members: Members | None = None  # on which the water acts
    own_mass: Floats | None = None  # (36,) of its mass matrix without that of its members

    def load(self, t: float, since: float, out: Floats) -> None:
        """Write the force and the moment given at t (s; infinity: of full size) into `out` (NUMBERS,).

        since: s, loads that have stopped by then are left out.
        """
        out[FORCE : MOMENT + 3] = self.numbers[FORCE : MOMENT + 3]
        for x in self.loads:
            if since < x.until:
                at = FORCE if x.what == "force" else MOMENT
                out[at : at + 3] += x.grown(t)

    def set_added_mass(self, row: Floats) -> None:
        """Have the added mass of its members as they are wet in a row (STATE,) of a state."""
        if self.members is not None:
            assert self.own_mass is not None
            self.numbers[MASS : MASS + 36] = self.own_mass + self.members.added_mass(row).ravel()

    @property
    def breaks(self) -> list[float]:
        """Times (s) at which a load stops."""
        return [x.until for x in self.loads if np.isfinite(x.until)]


def body_model(
    name: str, body: FreeBody, density: float, gravity: float, around: Surroundings | None = None
) -> BodyModel:
    """The numbers of a free body in a fluid of a density (kg/m3); around: the sea, for what has members."""
    numbers, start = np.zeros(NUMBERS), np.zeros(STATE)
    numbers[MASS : MASS + 36] = np.ravel(body.mass_matrix)
    if body.damping is not None:
        numbers[DAMPING : DAMPING + 36] = np.ravel(body.damping)
    if body.hydrostatics is None:
        weight, lift = gravity * body.mass, gravity * density * body.volume
        numbers[LIFT] = lift - weight
        numbers[ARM : ARM + 3] = lift * np.array(body.centre_of_buoyancy) - weight * np.array(body.centre)
    else:
        floats = body.hydrostatics
        numbers[LEVEL], numbers[STIFFNESS : STIFFNESS + 3] = floats.level, (floats.heave, floats.roll, floats.pitch)
    start[PLACE:FRAME] = body.initial_guess
    start[FRAME:V] = frame_of(body.initial_rotation).ravel()
    loads = loads_of(body.end.loads)
    if not body.members or around is None:
        return BodyModel(name, numbers, start, loads)
    members = Members(*pieces_of(body, density), around)
    numbers[PIECES] = len(members.pieces)
    own_mass = numbers[MASS : MASS + 36].copy()
    made = BodyModel(name, np.append(numbers, members.pieces), start, loads, members, own_mass)
    made.set_added_mass(start)
    return made


class KnownMotion(EndMotion):
    """How a body that is held or moved is at a time: `at` gives its origin and its axes (`EndMotion`)."""

    def __init__(self, body: FixedBody, around: Surroundings) -> None:
        waves = around.waves_of_vessels, float(around.values.ramps[1]), True
        self.axes = frame_of(body.rotation)  # without motion
        super().__init__(body.motion, body.position, self.axes, around.elevation, waves)


class FairleadMotion:
    """The motion of a point of a body whose motion is known, and of the frame of a line that is clamped there."""

    def __init__(self, body: KnownMotion, place: tuple[float, float, float], seat: Floats | None = None) -> None:
        """place: (3,) m, in axes of the body; seat: (SEAT,) frame of the line in these; None: it turns freely."""
        self._body, self._place = body, np.array(place)
        self._seat = None if seat is None else seat[:9].reshape(3, 3)
        self.base = body.base

    def at_time(self, t: float) -> tuple[Floats, Floats, Floats | None, Floats]:
        """As of `EndMotion`; where the line turns freely there is no frame."""
        origin, velocity, frame, spin = self._body.at_time(t)
        assert frame is not None
        arm = frame @ self._place
        place, speed = origin + arm, velocity + np.cross(spin, arm)
        if self._seat is None:
            return place, speed, None, np.zeros(3)
        return place, speed, frame @ self._seat, spin

    def turn_from(self, frame: ArrayLike) -> None:
        """Seat the line so that its frame is this one, (3, 3), where the body is at rest."""
        if self._seat is not None:
            self._seat = self._body.axes.T @ np.asarray(frame)

    def terms(self) -> MotionTerms:
        """Those of its body, and where it is there."""
        return self._body.terms()._replace(ride=(self._body.axes, self._place, self._seat))


STRAIGHT = (1.0, 0.0, 0.0)  # direction of a line through a free point in axes of that, where none is given
SECOND = 1e-3  # weight of the material axis of the first line at a free point against directions of lines

OPPOSITE = -0.9  # cosine of the angle of tangents that count as opposite

Ends = tuple[str, str]  # name of a line, and `start` or `end`
Held = tuple[Triple, Triple | None]  # inertial tangent and material axis a1 of an end


def directions_at_rigid(network: Network, point: str) -> dict[Ends, tuple[Floats, Floats]]:
    """Tangent and material axis a1 (3,) of each line that is clamped to a free point, in axes of the point."""
    found: dict[Ends, tuple[Floats, Floats]] = {}
    here = network.clamped_at(point)
    for name, end in here:
        held = network.clamp(name, end)
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
    slip = {name: getattr(clamped.line, name).copy() for name in ("slip_law", "slip_now")}  # as wide as springs ask for
    line = line._replace(torsion=clamped.line.torsion, **slip, **new)
    held = ("held_tangent", "held_twist", "springs", "hinged")
    cable = replace(model.cable, **{name: getattr(clamped.cable, name) for name in held})
    model = replace(model, line=line, cable=cable)
    return model if model.layout is None else replace(model, on_base=LineOnBase(cable, model.layout.base))
