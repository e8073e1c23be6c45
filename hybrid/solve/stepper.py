"""Steps of generalized-alpha, and lines that meet as their solver takes them.

Generalized-alpha in time: sets up a step, takes it, and gives the accelerations a consistent start.

Chung & Hulbert 1993; Arnold & Bruels 2007; docs/theory.md section 2.

Lines that meet at points go to solve.network_solver and come back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.errors import ComputationError, Outcome
from hybrid.kernels.algebra.block_elimination import KEPT, ROW, SIZE, WIDTH
from hybrid.kernels.junctions.bodies import STATE
from hybrid.kernels.junctions.joined_lines import SEAT, TURNS
from hybrid.kernels.laws.obstacle_grip import grip_obstacles
from hybrid.kernels.laws.obstacles import stored_energy
from hybrid.kernels.laws.seabed import normal_forces, planes_under, soil_at_rest
from hybrid.kernels.laws.tension_torque import COUPLES
from hybrid.kernels.march.assembly import JOINED
from hybrid.kernels.run import newton
from hybrid.kernels.run.newton import block_rows, out_of_balance, workspace_of
from hybrid.kernels.state.report import FRICTION, SEABED_ENERGY, SOIL, WAVES
from hybrid.kernels.state.state import NO_SOIL, Ends, Floats, Line, Sea, State, Work
from hybrid.kernels.step.step import friction_axes

MOST_ITERATIONS = 20  # a healthy step takes 2 to 4; more than this and half a step is cheaper
# Share of the line's length that a node may move in one Newton iteration of a step.
REACH = 0.1
# dvd'/dr' of the solve for consistent accelerations, 1/s2: so large that no stiffness of a real cable
# (EI/(m h^4) is 1e20 at the very worst) shows beside inertia, and far from overflow.
HEAVY = 1e36
# report of the march -> powers: start, end (reactions and given moments), applied forces and
# moments, drag, mass-proportional damping, stiffness-proportional damping, added mass, waves with
# buoyancy at the surface, contact with the seabed, friction on it, zones that change, obstacles that move, what
# materials lose that remember their past
POWERS: tuple[str, ...] = ("start", "end", "applied", "drag", "mass_damping", "stiffness_damping", "added_mass")
POWERS += ("waves", "contact", "friction", "zones", "obstacles", "hysteresis")


def static_friction_travel(line: Line, sea: Sea, r: Floats, force: Floats) -> Floats:
    """Elastic travel (N+1, 3) m whose friction takes up the forces (N+1, 3) N along the seabed, or all it can of them.

    sea.axis must be that of the line.  Friction is -mu N travel/slip_length, along and across the line.
    """
    N = np.zeros(r.shape[0])
    if line.bits & SOIL:
        most = np.zeros((r.shape[0], 2))
        soil_at_rest(line, sea, r, np.zeros((r.shape[0], NO_SOIL.shape[1])), N, most)
    else:
        normal_forces(line, sea, r, N)
        most = N[:, None] * sea.friction
    side = np.cross(planes_under(sea, r)[0], sea.axis)
    parts = []
    for direction, held in ((sea.axis, most[:, 0]), (side, most[:, 1])):
        along = np.einsum("ij,ij->i", force, direction)
        parts.append(np.divide(along, held, out=np.zeros_like(along), where=held > 0.0))
    size = np.maximum(np.hypot(*parts), 1.0)
    return np.asarray(sea.slip_length * ((parts[0] / size)[:, None] * sea.axis + (parts[1] / size)[:, None] * side))


def lie_on_bed(line: Line, sea: Sea, work: Work, state: State) -> None:
    """What the seabed and obstacles store, and where they are, of a state whose forces have been evaluated."""
    work.report[SEABED_ENERGY] = stored_energy(line, sea, state.r)
    state.bed[:] = sea.bed
    if line.moved.size:
        grip_obstacles(line, sea, work.u, state, state.grip, state.grip)


def hold_by_friction(line: Line, sea: Sea, ends: Ends, state: State) -> None:
    """Give a line that lies still on the seabed the friction that keeps it there, as far as friction can."""
    if not line.bits & FRICTION:
        return
    state.slip[:] = 0.0
    still = np.zeros_like(state.r)
    stretch = np.linalg.norm(state.e, axis=1) / line.h - 1.0
    tension = np.divide(stretch, line.ck, out=np.zeros_like(stretch), where=line.ck > 0.0)
    smooth = line._replace(bits=line.bits & ~(FRICTION | WAVES))
    rows = block_rows(smooth)
    at_rest = state._replace(vd=still, T=state.T if line.law.size else tension)
    newton.assembly(smooth, sea, ends, at_rest, 0.0, HEAVY, workspace_of(line)._replace(rows=rows))
    force = out_of_balance(smooth, rows)
    force[np.flatnonzero(ends.held) * (line.s.size - 1)] = 0.0
    friction_axes(sea, state.r, state.e, state.slip, state.grip)
    state.slip[:] = static_friction_travel(line, sea, state.r, force)


class JoinedLine(NamedTuple):
    """One line of a network."""

    line: Line
    sea: Sea
    ends: Ends
    length: float  # m
    scale: float  # N, tension scale
    floor: float  # N, tension at or below which a catenary cell is slack in motion; -infinity: none is
    joints: tuple[int, int]  # numbers of the points, or behind them bodies, that start and end are joined to; -1: held
    fairleads: Floats = np.zeros((2, 3))  # m, of ends that are joined to bodies, in axes of the body
    seats: Floats = np.zeros(
        (2, SEAT)
    )  # frames of ends that turn with these (kernels.junctions.joined_lines); zeros: none does
    slackens: bool = False  # whether a motion goes on with slack catenaries, and rest is taken with them if need be
    rides: NDArray[np.int64] = np.zeros(0, np.int64)  # (M,) bodies that carry obstacles, -1: none does; empty: no body
    borne: Floats = np.zeros(0)  # (N,) strain that cells bear, of a line that may lie on obstacles; empty: of no other
    keeps_pace: bool = False  # whether its zones or its length follow the steps with the spectral radius of all lines
    winds: bool = False  # whether its winch holds a tension, which takes factors of its equations that serve again
    most_cells: int = 0  # that it may have; at least those that it has


class NetworkState(NamedTuple):
    """All that a network knows of itself at a time: the states of its lines, and (B, STATE) of its free bodies."""

    lines: Sequence[State]
    bodies: Floats = np.zeros((0, STATE))

    def copy(self) -> NetworkState:
        """The same in arrays of its own."""
        return NetworkState([x.copy() for x in self.lines], self.bodies.copy())


@dataclass(frozen=True)
class NetworkTaken:
    """How a solution of several lines went."""

    outcome: Outcome
    iterations: int  # of Newton's method
    correction: float  # the next one, as it is predicted
    line: int  # where it was worst; -1: a point or body
    where: int  # its cell or node
    residual: float  # N, largest residual force at a node or point
    error: float = 0.0  # m, local error of a step
    ratio: float = 0.0  # largest over what is allowed of a line; above REFUSED (step.step_control) it is in no books
    rho: float = 0.0  # spectral radius at infinity of the step


Solution = tuple[NetworkTaken, NetworkState]


class LineFailed(ComputationError):
    """A computation of lines stopped: number of the line where it did, -1 for a point."""

    def __init__(self, line: int, *error: object, first: str = "") -> None:
        """error: as of `ComputationError`; first: likewise."""
        super().__init__(*error, first=first)  # type: ignore[arg-type, misc]
        self.line, self.first = line, first


def joined_ends(ends: Ends, joints: tuple[int, int]) -> Ends:
    """The conditions of a line's ends with those that are joined to points; arrays are shared but for `held`."""
    held = ends.held.copy()
    held[[k for k in (0, 1) if joints[k] >= 0]] = JOINED
    return ends._replace(held=held)


def is_answered_again(x: JoinedLine) -> bool:
    """Whether a line is solved for more right-hand sides: its start is joined, or an end turns."""
    return x.joints[0] >= 0 or bool(x.seats[:, TURNS].any())


def room_of_line(x: JoinedLine, touches: bool = False) -> Work:
    """Arrays for a line, with room for all its factors where they serve again, for the last where its end is joined.

    touches: whether it touches itself.
    """
    work = workspace_of(x.line, keep=touches or is_answered_again(x) or x.joints[1] >= 0)
    return work._replace(**room_of_factors(x, x.line.h.size, touches))


def room_of_factors(x: JoinedLine, cells: int, touches: bool) -> dict[str, Any]:
    """Room for the factors, the first block row and the torques of tension of a line in so many cells."""
    kept = (cells + 1) * KEPT if is_answered_again(x) else KEPT if x.joints[1] >= 0 else 0
    if touches or x.line.torsion.size:  # these take all factors, which are kept in every march where they serve again
        kept = (cells + 1) * KEPT
    rows = np.zeros((1 if x.joints[0] >= 0 else 0, SIZE * WIDTH))
    couple = np.zeros((cells + 1 if x.line.tension_twist.size else 0, COUPLES))
    return {"X": np.zeros((cells + 1) * ROW + kept), "rows": rows, "couple": couple}
