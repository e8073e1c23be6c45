"""Lines that meet at points, as their solver takes them and gives them back (solve.network_solver)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.errors import ComputationError, Outcome
from hybrid.kernels.algebra.block_elimination import KEPT, ROW, SIZE, WIDTH
from hybrid.kernels.junctions.bodies import STATE
from hybrid.kernels.junctions.carried_frames import SEAT, TURNS
from hybrid.kernels.march.assembly import JOINED
from hybrid.kernels.state.state import Ends, Floats, Line, Sea, State, Work
from hybrid.solve.stepper import workspace_of


class JoinedLine(NamedTuple):
    """One line of a system."""

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
    )  # frames of ends that turn with these (kernels.junctions.carried_frames); zeros: none does
    slackens: bool = False  # whether a motion goes on with slack catenaries, and rest is taken with them if need be
    rides: NDArray[np.int64] = np.zeros(0, np.int64)  # (M,) bodies that carry obstacles, -1: none does; empty: no body
    borne: Floats = np.zeros(0)  # (N,) strain that cells bear, of a line that may lie on obstacles; empty: of no other
    keeps_pace: bool = False  # whether its zones or its length follow the steps with the spectral radius of all lines
    winds: bool = False  # whether its winch holds a tension, which takes factors of its equations that serve again


class NetworkState(NamedTuple):
    """All that a system knows of itself at a time: the states of its lines, and (B, STATE) of its free bodies."""

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
    ratio: float = 0.0  # largest over what is allowed of a line; above REFUSED (step.step_law) it is in no books
    rho: float = 0.0  # spectral radius at infinity of the step


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
    cells, joints = x.line.h.size, x.joints
    kept = (cells + 1) * KEPT if is_answered_again(x) else KEPT if joints[1] >= 0 else 0
    rows = np.zeros((1 if joints[0] >= 0 else 0, SIZE * WIDTH))
    if touches or x.line.torsion.size:  # these take all factors, which are kept in every march where they serve again
        kept = (cells + 1) * KEPT
    work = workspace_of(x.line, keep=touches or is_answered_again(x) or joints[1] >= 0)
    return work._replace(X=np.zeros((cells + 1) * ROW + kept), rows=rows)
