"""What a line that is paid out knows beside its arrays: its reel, and the table of the kernels that change its length.

symbol  meaning                                                    unit
L       unstretched length that is out                             m
c       its rate, positive where line is paid out                  m/s
p       place of the last material node                            m

Places, nodes and cells count here from the far end towards the fairlead, whichever end of the line that is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybrid.kernels.machine.references import NamedNumbers, by_reference, reader
from hybrid.kernels.mesh.remesh import COLUMNS
from hybrid.kernels.reel.winch import Winch
from hybrid.kernels.state.books import Clock, Counts
from hybrid.kernels.state.report import REPORT_SIZE
from hybrid.kernels.state.state import Ends, Floats, Line, Rows, Sea, State, blanks

# Parts of a cell: a node enters when that much of the cell after it is out, and leaves when only that much is left.
ENTERS, LEAVES = 0.85, 0.35
# Steps over which new cells get their true lengths, at least; steps that follow the motion are so short that these have
# passed when the next node enters.
FEWEST_STEPS = 8


class ReelNumbers(NamedNumbers):
    """What a line that is paid out knows of its length, c its rate and p the place of the last material node."""

    length: float  # L, c and the rate of c at the end of the try
    rate: float
    acceleration: float
    place: float  # p
    longest: float  # m, the last cell: beyond the first a node enters, below the second one leaves
    shortest: float
    length_before: float  # L before the last step
    due: float  # 1 when a node is to enter or to leave
    flux: float  # W, into the line by what the corrected force of the fairlead does not do
    flux_before: float  # and before the last step
    side: float  # 1 where the fairlead is the end of the line, -1 where it is the start
    far: float  # m, arc length of the far end
    spring: float  # N m/rad, of an angular spring between the fairlead and a clamped line; infinite: rigid
    changed: float  # s, when the last node entered or left; over which forces that balance its neighbours end
    easing: float
    lift: float  # kg/m2, lift per length of what sheds vortices (kernels.laws.vortices): rho/2 D Cv


class ReelStage(NamedNumbers):
    """How far the balance at the winch has come."""

    riding_on: float
    balance_on: float
    unbalanced: float
    flow_known: float
    # Of a winch that holds a tension, of a line with a joined end (kernels.junctions.sheaves_and_winches): what is asked of it;
    # the block row of the cell that grows, and what its length puts there per m; the block row with the tension before the
    # fairlead; N out of balance at the rotor, and how that grows with the length by itself, N/m.
    lengthens: float
    grows_at: float
    puts: float
    pulls_at: float
    out_of_balance: float
    alone: float
    change: float  # m, of the length


# What may be asked: to be corrected with the lines; to take its change.
WAITS, MOVES = 1.0, 2.0
# Columns of `Reel.flow`.
LENGTH_OF = 0
FLOW = 1
STRAIN_OF = 2  # 3
TURN_FLOW = 5  # 3
FLOWS = 8


class Reel(NamedTuple):
    """What a line that is paid out knows beside its arrays; N cells."""

    numbers: ReelNumbers
    law: Floats  # (K, 8) s, from which on a row holds; coefficients of L in the time since then, highest power first
    pieces: Floats  # (P, 1 + COLUMNS) m, where a piece of the material begins; its row (kernels.mesh.remesh)
    rest: Floats  # (1, COLUMNS) of the cell before the last material node
    rest_length: Floats  # (1,) m, its length
    true: Floats  # (N,) m, lengths of cells
    lack: Floats  # (N,) m, that cells lacked when they were made
    rate: Floats  # (N,) m/s, its rate then
    since: Floats  # (N,) s, when that was
    span: Floats  # (N,) s, over which they get it
    # (N+1, 10) before the last step, of cells or nodes: length; mass, weight, stiffness (3), strain without load (3);
    # compliance of cells
    before: Floats
    clamp: Floats  # (3,) rad, turn of the element at a clamp, before the last step
    report: Floats  # (REPORT_SIZE,) this and the next: work arrays
    made: Floats  # (2, COLUMNS)
    layer: Floats  # (m+1,) m, how far before the fairlead the nodes that ride with it are; that is the last, 0
    # (m+1, 3) N, by which the forces on them are more because they do not move as the material does; on the fairlead 0
    # where it is held
    riding: Floats
    # 1 while these, or `balance`, are among the forces on the line; while `balance` is to be found; where the last
    # assembly since the last step had `flow` in it; of a winch of a joined line what is above
    stage: ReelStage
    balance: Floats  # (N+1, 3) N, forces on nodes, in the order of the line, that balanced them at CHANGED
    plain: Floats  # (N+1, 3) N, the forces on the line without them
    winch: Winch  # of a winch that holds a tension (kernels.reel.winch)
    # (N+1, FLOWS) of a line that is damped in proportion to stiffness, else empty: of cells length and flow, m/s, of
    # elements strain without stress and flow, rad/s (kernels.reel.damping)
    flow: Floats
    columns: Floats  # (3, N+1, 5) that such a winch at the start, or at a clamp, works in; else empty
    volumes: (
        Floats  # (N+2, 1 + 4 L) of a line with L layers that slip (kernels.reel.paid_length), else empty: of elements
    )
    bent: Floats  # (2,) rad, bend at a clamp of such a line before the last step, without its spring


def blank_reel(
    cells: int, law: Floats | None = None, pieces: Floats | None = None, winch: Winch | None = None,
    layer: Floats | None = None, columns: bool = False, damped: bool = False, slips: int = 0,
) -> Reel:  # fmt: skip
    """A reel of a line of so many cells.

    columns: whether such a winch needs another right-hand side; damped: see `flow`; slips: layers that do.
    """
    z = np.zeros
    numbers = ReelNumbers(changed=-np.inf)
    return Reel(
        numbers, z((1, 8)) if law is None else law, z((1, 1 + COLUMNS)) if pieces is None else pieces,
        z((1, COLUMNS)), z(1), z(cells), z(cells), z(cells), np.full(cells, -np.inf), np.ones(cells), z((cells + 1, 10)),
        z(3), z(REPORT_SIZE), z((2, COLUMNS)), z(1) if layer is None else layer,
        z((1 if layer is None else layer.size, 3)), ReelStage(), z((cells + 1, 3)), z((cells + 1, 3)), Winch() if winch is None else winch,
        z((cells + 1 if damped else 0, FLOWS)), z((3, cells + 1, 5) if columns else (3, 0, 5)),
        z((cells + 2 if slips else 0, 1 + 4 * slips)), z(2),
    )  # fmt: skip


by_reference(blank_reel(1))


class MovingZones(NamedTuple):
    """Of zones that move (kernels.mesh.zone_step.Zones), what they take the work of lengths and stiffness from."""

    lengths: Floats  # (N,) m, at the end of the last step; none where zones stay
    stiff: Rows  # (N+1, 3) N m


def zones_that_stay() -> MovingZones:
    return MovingZones(np.zeros(0), np.zeros((0, 3)))


class ReelJob(NamedTuple):
    """Arguments of the entries: two states in turn as kernels.run.network_run has them, and its clock, counts, work and report."""

    line: Line
    sea: Sea
    ends: Ends
    old: State
    new: State
    clock: Clock
    counts: Counts
    work: Rows  # (2, WORKS)
    velocity: Rows  # (2, 3) m/s, of the ends
    report: Floats  # (REPORT_SIZE,) of the step
    reel: Reel
    X: Floats  # of the line's kernels.state.state.Work
    W: Floats
    zones: MovingZones


blank_reel_job = blanks(ReelJob)
read = reader(blank_reel_job())
