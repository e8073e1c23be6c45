"""What the kernels of several lines get: the lines, points and bodies of a system, and the task that is asked."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.machine.compile import inner
from hybrid.kernels.machine.named_numbers import NamedNumbers
from hybrid.kernels.machine.references import reader
from hybrid.kernels.state.state import Floats
from hybrid.kernels.step.newton import Limits, Task


class NetworkJob(NamedTuple):
    """Arguments of the entries: the lines, points and bodies of a system, and room.

    P points, B bodies, L lines; m tensions of last cells and coordinates of points and bodies.
    """

    asked: NetworkTask
    tables: NDArray[np.int64]  # (L, ..) jobs of the lines (kernels.run.network_run), their task ASSEMBLY
    numbers: Floats  # the same memory
    joints: NDArray[np.int64]  # (L, 2) points, then bodies, that start and end are joined to, -1 where they are held
    fairleads: Floats  # (L, 2, 3) m of ends at bodies, in their axes
    seats: Floats  # (L, 2, SEAT) frames of ends that turn with bodies (kernels.junctions.carried_frames)
    arms: Floats  # (L, 2, 3) m, worked in
    gaps: Floats  # (L, 2, 3) m that ends at bodies have still to go; given for a CORRECTION, else worked in
    floors: Floats  # (L,) N, tension at or below which a catenary cell is slack
    allowed: Floats  # (L,) m, error that a step may make
    first: NDArray[np.int64]  # (L,) where columns of a line begin that carries some
    columns: Floats  # (3, .., 5), or (COLUMNS, .., 5) where an end turns
    functional: Floats  # (FUNCTIONAL,) worked in, as what follows
    parts: Floats  # as columns: what right-hand sides count in forces and moments on the start, moments on the end
    answers: Floats  # (2, ANSWER)
    q: Floats  # (COLUMNS,)
    net: Floats  # (P, 3) on return what does not balance at the points, N
    bodies: Floats  # (B, NUMBERS ..) what bodies are (kernels.junctions.bodies)
    old: Floats  # (B, STATE) of bodies
    new: Floats  # (B, STATE)
    work: Floats  # (B, WORK)
    S: Floats  # (HANDED - 1, HANDED)
    G: Floats  # (2, 6, 6)
    A: Floats  # (m+5, m+1)
    right: Floats  # (3 P + 6 B,) right-hand side of points and bodies themselves, of other corrections of an iteration
    still: Floats  # (L, 2, 3) zeros: gaps of those
    moves: Floats  # (3,) of corrections, as kernels.junctions.borders has it
    begins: NDArray[np.int64]  # (L,) where nodes of lines begin among those of all
    marks: NDArray[np.int64]  # (T,) nodes with another right-hand side; empty: nothing needs one
    rides: NDArray[np.int64]  # (M,) the body that carries an obstacle, -1: none does; empty: no body has a shape
    phase: NDArray[np.int64]  # (1,) what is asked of borders (kernels.junctions.borders)
    near: NDArray[np.int64]  # (L,) of all lines, how near they are to what is free (kernels.junctions.lone_lines)
    alone: NDArray[np.int64]  # (L,) and whether they are solved by themselves
    borders: NDArray[np.int64]  # (K,) addresses of their kernels, in their order
    border_tables: NDArray[np.int64]  # (K, ..) and their tables
    solver: int = 0  # address of the kernel that marches a line


class NetworkTask(NamedNumbers):
    """The task (kernels.step.newton.Task), the time of the new states, s, and the part of a correction that is made."""

    what: float
    dt: float
    before: float
    rho_of_step: float
    cv: float
    ca: float
    reach: float
    scale: float
    most: float
    rho_of_last: float
    fixed: float
    time: float
    part: float
    cut: float  # whether a step is taken as the last iteration has left it, converged or not
    tolerance: float
    scheme_cv: float  # of the scheme of the step that is solved, or as cv, ca
    scheme_ca: float


def blank_system_job() -> NetworkJob:
    """A job with the types that every one has."""
    z, one, two = np.zeros, np.zeros(1, np.int64), np.zeros((1, 2), np.int64)
    return NetworkJob(
        NetworkTask(), two, z((1, 1)), two, z((1, 2, 3)), z((1, 2, 1)), z((1, 2, 3)), z((1, 2, 3)), z(1), z(1), one,
        z((1, 1, 1)), z(1), z((1, 1, 1)), z((2, 1)), z(1), z((1, 3)), z((1, 1)), z((1, 1)), z((1, 1)), z((1, 1)), z((1, 1)),
        z((2, 6, 6)), z((1, 1)), z(1), z((1, 2, 3)), z(3), one, one, one, one, one, one, one, two,
    )  # fmt: skip


read_system = reader(blank_system_job())


@inner
def task_of(asked):
    """The task that is asked."""
    limits = Limits(asked.reach, asked.scale, int(asked.most), asked.tolerance)
    return Task(
        int(asked.what), asked.dt, asked.before, asked.rho_of_step, asked.cv, asked.ca, False, limits, asked.cut != 0.0,
        asked.rho_of_last, asked.fixed != 0.0,
    )  # fmt: skip
