"""Stiffness and mass of a network about its equilibrium, as sparse matrices.

Layers that slip as a line bends, and soil, remember.  Both have two stiffnesses there, of what loads them first and of
small motions to and fro.  By the first, derivatives of equilibria are known: each equilibrium is one of first loading.
The second is the limit of periodic motions that become small: a layer that is at its slip moment slips in the first of
them, and never again where they bend by less than that moment over its stiffness; soil unloads and loads again along
branches of the same first slope, K Pu/D.

The block rows of a state are linear in c_v and c_a (docs/theory.md, 2): with c_v = 0 they are K + c_a M.  Unknowns of
a line are those of its blocks, (dT of the cell before a node, dr of the node, dpsi of the cell after it); tension stays
an unknown, so that a line may be inextensible:

    A = | K   B^T |        M = | M_r  0 |
        | B   -C  |            | 0    0 |

Ends that are joined move with their point or body by  x = P q, with q all that is free;  A and M of the network are
P^T A P and P^T M P, with what belongs to the bodies themselves added.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.linalg.lapack import zgbsv
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.sparse.linalg import splu

from hybrid.kernels.algebra.block_elimination import SIZE, WIDTH
from hybrid.kernels.junctions.bodies import FRAME, MASS, NUMBERS, OWN, PIECES, PLACE, V
from hybrid.kernels.junctions.joined_lines import TURNS
from hybrid.kernels.laws.axial_law import DYNAMIC, PER_TENSION
from hybrid.kernels.laws.bending_law import (
    BEHIND_REST,
    EACH,
    FROM,
    KEPT,
    LOADED_FIRST,
    MOMENT,
    MOST,
    STIFF,
    STIFFENING,
    STIFFNESS,
    update_slip,
)
from hybrid.kernels.laws.bending_law import PER_TENSION as SLIP_PER_TENSION
from hybrid.kernels.laws.seabed import BRANCH, DEPTH, PRESSES, TURN_P, UP, rest_in_soil
from hybrid.kernels.laws.seabed import TURN as TURN_DEPTH
from hybrid.kernels.laws.water import PIECE
from hybrid.kernels.march.assembly import LEAST_SPIN_STIFFNESS
from hybrid.kernels.run import newton
from hybrid.kernels.state.report import (
    AXIAL_LAW,
    FRICTION,
    HELD_SLIP,
    MOMENT_A,
    PLANAR,
    ROTARY,
    SOIL,
    STIFFNESS_DAMPING,
    WAVES,
)
from hybrid.kernels.state.state import Ends, Floats, Line, Sea, State, Work, no_torsion
from hybrid.kernels.step.step import friction_axes
from hybrid.linear.touching import Blocks, TouchingLines, TouchingParts, hats, touching_parts
from hybrid.model.bodies import Members
from hybrid.model.ends import rotation
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.stability import ANCHOR as STATIC_ANCHOR
from hybrid.solve.stepper import JoinedLine, NetworkState

# Step, of the largest tension, by which moments of layers are differentiated.
PULLED = 1e-5
# Part of the pressure by which a branch begins below that of first penetration, which else would be taken.
BELOW = 1e-9


def pulls(T: Floats) -> Floats:
    """(N+1,) tension at the nodes, N, not below 0, as layers feel it; T: (N,) of cells."""
    return np.asarray(np.maximum(0.5 * (np.append(T[0], T) + np.append(T, T[-1])), 0.0))


def with_layers(line: Line, state: State, sticks: bool) -> Line:
    """The line with what its layers bear in a state: sticking to where they have slipped to, or as loaded first."""
    law = line.slip_law
    if not law.size:
        return line
    now, T = np.zeros_like(law), pulls(state.T)[:, None]
    now[:, STIFF::EACH] = law[:, STIFFNESS::EACH] + law[:, STIFFENING::EACH] * T
    most, elastic = law[:, MOMENT::EACH] + law[:, SLIP_PER_TENSION::EACH] * T, law[:, MOMENT::EACH] < 0.0
    now[:, MOST::EACH] = np.where(elastic, most, np.inf) if sticks else most
    for k in range(KEPT if sticks else 0):
        now[:, FROM + k :: EACH] = state.layers[:, k::KEPT]
    return line._replace(slip_now=now, bits=line.bits | HELD_SLIP)


def load_layers(line: Line, ends: Ends, state: State, work: Work) -> None:
    """How far layers slip in a first loading to a state, into its `layers`."""
    if line.slip_law.size:
        for part in (LOADED_FIRST, BEHIND_REST):
            update_slip(line, ends, state, state, work, part)


def by_layers(line: Line, state: State, sticks: bool, left: Callable[[Line], Floats]) -> sparse.csr_array:
    """What tension changes of the moments of layers, which block rows do not know: (5 (N+1), 5 (N+1)).

    left: (N+1, 5) what is left over of the equations of this state on a line.
    """
    n = state.T.size
    step = PULLED * max(float(np.abs(state.T).max()), 1e-300)
    out = Blocks()
    for first in range(min(4, n)):  # a cell's tension is in the moments of its nodes, and these in four rows
        cells = np.arange(first, n, 4)
        both = []
        for sign in (1.0, -1.0):
            T = state.T.copy()
            T[cells] += sign * step
            both.append(left(with_layers(line, state._replace(T=T), sticks)))
        change = (both[0] - both[1]) / (2.0 * step)
        for c in cells.tolist():
            begin = max(c - 1, 0)
            near = change[begin : c + 3].reshape(-1, 1)
            out.add(SIZE * begin + np.arange(near.size), [SIZE * (c + 1)], near)
    return out.matrix(SIZE * (n + 1), SIZE * (n + 1))


def with_soil(line: Line, sea: Sea, state: State, turns: bool) -> State:
    """The state with what soil remembers of it: that it has been pressed on as far and turns there; or nothing."""
    if not line.bits & SOIL:
        return state
    soil = np.zeros_like(state.soil)
    if turns:
        rest_in_soil(line, sea, state.r, soil)
        inside = soil[:, DEPTH] > 0.0
        soil[inside, BRANCH] = UP
        soil[inside, TURN_DEPTH], soil[inside, TURN_P] = soil[inside, DEPTH], (1.0 - BELOW) * soil[inside, PRESSES]
    return state._replace(soil=soil)


# Springs of this many 1/s^2 times the mass hold what is free while block rows are made; they are taken out again.
ANCHOR = 1e-9
# Shifts (of the longest line) and turns (rad) of a body by which forces of the water and its weight are differentiated.
SHIFT, TURN = 1e-5, 1e-4
# Where modes are counted, lines that do not stretch are lent this strain under their largest tension, or under the size
# of tension that they are solved with; those that stretch are lent this part of their own compliance.
NO_STRAIN = 1e-10
# Turn, rad, of an end's frame by which the element there is differentiated.
FRAME_TURN = 1e-5


@dataclass(frozen=True)
class LinearLine:
    """A line about its equilibrium, its matrices over the unknowns of all its blocks (5 a node).

    free: (5 (N+1),) which of them are free; r: (N+1, 3) m; t: (N+1, 3) unit tangents at the nodes; rods: (N,) cells
    with a spin.
    """

    name: str
    line: Line
    state: State
    stiffness: sparse.csr_array
    mass: sparse.csr_array
    standing: sparse.csr_array  # the part of it at ends that are joined: of the free point, of clumps and floats there
    carried: tuple[sparse.csr_array, ...]  # the same at a start and an end that are free, and joined to nothing
    free: np.ndarray
    net: Floats  # (2, 3) N, that each end passes to what it is joined to
    turned: Floats  # (2, 3, 5 (N+1)) N, N m, .. what turns of an end's frame do, from the left; zeros: it carries none
    held_moment: Floats  # (2, 3, 3) N m/rad, moment that the frame of an end resists a turn with
    by_layers: sparse.csr_array  # what tension changes of the moments of layers, beside `stiffness`: no energy has it

    @property
    def r(self) -> Floats:
        """Positions (N+1, 3) m of the nodes."""
        return self.state.r

    @property
    def t(self) -> Floats:
        """Unit tangents (N+1, 3) at the nodes: the mean of the chords beside each."""
        d = self.state.e / np.linalg.norm(self.state.e, axis=1)[:, None]
        mean = np.vstack([d[:1], d[1:] + d[:-1], d[-1:]])
        return np.asarray(mean / np.maximum(np.linalg.norm(mean, axis=1), 1e-300)[:, None])


@dataclass(frozen=True)
class LinearNetwork:
    """A network about its equilibrium: A q = lambda M q for what is free.

    lines: of the network; at: (L + 1,) where the unknowns of each line begin among those of all lines; place: sparse
    (all lines, q) how they follow q; points, bodies: how many are free, the last of q, behind the angles of sheaves.
    """

    lines: tuple[LinearLine, ...]
    at: np.ndarray
    place: sparse.csr_array
    stiffness: sparse.csc_array  # A, made symmetric, without what tension changes of the moments of layers
    skew: sparse.csc_array  # the rest of A, which no energy has
    mass: sparse.csc_array
    apart: sparse.csr_array  # the part of `mass` of points and bodies, without lines that end there
    points: int
    bodies: int
    slow: float  # 1/s^2, a size of w^2 of what swings slowly: the largest tension over mass and length
    tensions: Floats  # (q,) m/N, a compliance that changes no mode, of unknowns that are tensions; else 0
    touching: TouchingParts  # what touches, over other unknowns, which follow q by
    whole: sparse.csr_array  # (all lines, 6 of each body, angles of sheaves; q)

    @property
    def size(self) -> int:
        """Number of unknowns q."""
        return int(self.mass.shape[0])

    def unit_shifts(self) -> Floats:
        """(q, 3): all that is free shifted by 1 m along x, y, z."""
        whole = np.zeros((int(self.at[-1]), 3))
        for k in range(3):
            for a, b in zip(self.at[:-1], self.at[1:], strict=True):
                whole[a + 1 + k : b : SIZE, k] = 1.0
        out = np.asarray(self.place.T @ whole)
        # each unknown that is itself a node's keeps its 1; points and bodies gather those of several ends
        first = self.size - 3 * self.points - 6 * self.bodies
        out[first:] = 0.0
        for p in range(self.points):
            out[first + 3 * p : first + 3 * p + 3] = np.eye(3)
        for b in range(self.bodies):
            at = first + 3 * self.points + 6 * b
            out[at : at + 3] = np.eye(3)
        return out


def linear_line(x: JoinedLine, name: str, state: State, sticks: bool, quick: bool = True) -> LinearLine:
    """A line about an equilibrium, with ends that are joined as if they were free: the network holds them.

    sticks: whether friction holds it elastically where it lies on the bed, as before it slides; else there is none.
    quick: whether ropes, layers that slip and soil are as stiff as they are to small motions, else as to what is slow
    and loads them first.
    """
    line, count = in_space(x.line, state, sticks, quick), x.line.s.size
    state = with_soil(line, x.sea, state, turns=quick)
    if line.bits & FRICTION:
        friction_axes(x.sea, state.r, state.e, np.zeros_like(state.slip), state.grip)
    held, joined = x.ends.held.copy(), [x.joints[k] >= 0 for k in (0, 1)]
    held[joined] = 0
    ends = x.ends._replace(held=held)
    base = np.zeros((count, SIZE * WIDTH))
    rows_at_rest(line, x, ends, state, (0.0, ANCHOR), base)
    forces = -base.reshape(count, SIZE, WIDTH)[[0, -1], 1:4, -1]
    # the largest stiffness over mass: neither drowns in the other's round-off
    diagonal = np.abs(np.stack([base[:, (1 + k) * WIDTH + 11 + k] for k in range(3)], axis=1)).max(axis=1)
    high = float((diagonal / np.maximum(line.mass, 1e-300)).max()) or 1.0
    more = np.zeros_like(base)
    rows_at_rest(line, x, ends, state, (0.0, high), more)
    mass = (more - base) / (high - ANCHOR)
    base -= ANCHOR * mass
    standing = _at_ends([k for k in (0, 1) if joined[k]], line, x, ends, state, high, more)
    tips = [not held[k] and not joined[k] for k in (0, 1)]
    carried = [_at_ends([k] if tips[k] else [], line, x, ends, state, high, more) for k in (0, 1)]
    K, M = sparse_rows(base), sparse_rows(mass)
    if quick:  # what turns freely about its axis is a motion that costs nothing; at rest springs keep it where it is
        K = K - sparse.diags_array(_spin_springs(line))
    if line.torsion.size:
        K = K + _through_zones(line)
    if line.tension_twist.size:
        K = _by_length(K)
    layers = sparse.csr_array(K.shape)
    if line.slip_law.size:
        layers = by_layers(line, state, quick, lambda other: _left(other, x, ends, state))
    free = np.ones((count, SIZE), bool)
    free[0, 0], free[-1, 4] = False, False
    free[:-1, 4] = line.spin != 0
    for k in (0, 1):
        if held[k]:
            free[-k, 1:4] = False
    turned, moments = np.zeros((2, 3, SIZE * count)), np.zeros((2, 3, 3))
    for k in (0, 1):
        if x.seats[k, TURNS] != 0.0:
            turned[k], moments[k] = by_turn(line, x, ends, state, k)
    springs = sparse_rows(standing), tuple(map(sparse_rows, carried))
    return LinearLine(name, line, state, K, M, *springs, free.ravel(), forces, turned, moments, layers)


def _at_ends(
    which: Sequence[int], line: Line, x: JoinedLine, ends: Ends, state: State, ca: float, rows: Floats
) -> Floats:
    """Block rows of the mass that stands at these ends (0, 1), by the rows of the line with c_a (1/s^2)."""
    if not which:
        return np.zeros_like(rows)
    mass, point, added = line.mass.copy(), line.point_mass.copy(), line.point_added.copy()
    for at in (-k for k in which):
        mass[at] -= point[at]
        point[at] = added[at] = 0.0
    bare = np.zeros_like(rows)
    alone = line._replace(mass=mass, point_mass=point, point_added=added)
    rows_at_rest(alone, x, ends, state, (0.0, ca), bare)
    return (rows - bare) / ca


def in_space(line: Line, state: State, sticks: bool, quick: bool = True) -> Line:
    """The line in space, without what makes no stiffness; sticks, quick: as of `linear_line`."""
    ck = line.ck
    if line.law.size and quick:
        dynamic = line.law[:, DYNAMIC] + line.law[:, PER_TENSION] * np.maximum(state.T, 0.0)
        ck = np.where(line.law[:, DYNAMIC] > 0.0, 1.0 / np.maximum(dynamic, 1e-300), ck)
    off = PLANAR | WAVES | (0 if sticks else FRICTION)
    line = with_layers(line, state, sticks=quick)
    if quick:
        return line._replace(bits=line.bits & ~(off | AXIAL_LAW), ck=ck)
    return line._replace(bits=line.bits & ~off, ck=ck.copy(), law=line.law.copy())  # the law writes both


def rows_at_rest(line: Line, x: JoinedLine, ends: Ends, state: State, c: tuple[float, float], rows: Floats) -> Floats:
    """Fill the block rows of a state at rest with c_v (1/s) and c_a (1/s^2), in the sea of x; its report."""
    return RestMarch(line, ends, state, rows)(x.sea, c)


def _left(line: Line, x: JoinedLine, ends: Ends, state: State) -> Floats:
    """(N+1, 5) what is left over of the equations of a state at rest, in the signs of `sparse_rows`."""
    rows = np.zeros((line.s.size, SIZE * WIDTH))
    rows_at_rest(line, x, ends, state, (0.0, ANCHOR), rows)
    return rows.reshape(-1, SIZE, WIDTH)[:, :, -1].copy()


class RestMarch:
    """Marches along one line at rest: as `rows_at_rest`, in many seas."""

    def __init__(self, line: Line, ends: Ends, state: State, rows: Floats) -> None:
        self.work = newton.workspace_of(line)._replace(rows=rows, torsion=no_torsion())
        still = state.copy()
        for rate in (still.v, still.a, still.vd, still.w, still.wa, still.wd, still.slip):
            rate[:] = 0.0
        self.state, self.line = still._replace(turn=still.turn[:0]), line._replace(torsion=line.torsion[:0])
        self.ends = ends

    def __call__(self, sea: Sea, c: tuple[float, float]) -> Floats:
        """Fill the rows in a sea; its report."""
        newton.assembly(self.line, sea, self.ends, self.state, *c, self.work)
        return self.work.report


def sparse_rows(rows: Floats) -> sparse.csr_array:
    """A (5 (N+1), 5 (N+1)) of block rows: balances and spins with the opposite sign, so that it is symmetric."""
    n = rows.shape[0]
    blocks = rows.reshape(n, SIZE, WIDTH)[:, :, :-1].copy()
    blocks[:, 1:] *= -1.0
    first = SIZE * (np.arange(n) - 2)
    columns = np.concatenate([np.arange(4 * SIZE), 4 * SIZE + 1 + np.arange(3)])
    i = np.broadcast_to((SIZE * np.arange(n)[:, None] + np.arange(SIZE))[:, :, None], blocks.shape)
    j = np.broadcast_to((first[:, None] + columns)[:, None, :], blocks.shape)
    here = (blocks != 0.0) & (j >= 0) & (j < SIZE * n)
    return sparse.csr_array((blocks[here], (i[here], j[here])), shape=(SIZE * n, SIZE * n))


def _spin_springs(line: Line) -> Floats:
    """(5 (N+1),) N m/rad: the springs against spin that kernels.march.assembly.fill_spin lends to rods.

    Rods whose twist has no inertia keep them: what has neither stiffness nor inertia has no modes.
    """
    if not line.bits & ROTARY:
        return np.zeros(SIZE * line.s.size)
    bending, torsion = line.kb[:, 0], line.kb[:, 2] * line.element
    soft = torsion[:-1] + torsion[1:]
    soft = LEAST_SPIN_STIFFNESS * np.where(soft == 0.0, bending[:-1] + bending[1:], soft)
    out = np.zeros((line.s.size, SIZE))
    out[:-1, 4] = np.where(line.spin != 0, soft, 0.0)
    return out.ravel()


def _by_length(K: sparse.csr_array) -> sparse.csr_array:
    """K with forces and torques by tension from the law of length, of which K is symmetric.

    For a line whose tension makes a torque: block rows do not reach the tension of the cell after next
    (kernels.laws.tension_torque).
    """
    entries = K.tocoo()
    tension = np.arange(K.shape[0]) % SIZE == 0
    kept = tension[entries.row] | ~tension[entries.col]
    lengths = sparse.csr_array(sparse.diags_array(tension.astype(float)) @ K @ sparse.diags_array(1.0 - tension))
    values, places = entries.data[kept], (entries.row[kept], entries.col[kept])
    return sparse.csr_array(sparse.csr_array((values, places), shape=K.shape) + lengths.T)


def _through_zones(line: Line) -> sparse.csr_array:
    """How catenary zones that a torque passes through join the twist of the rods beside them."""
    size, out = SIZE * line.s.size, Blocks()
    for first, after, compliance, _, _ in line.torsion:
        rods = [int(c) for c in (first - 1, after) if 0 <= c < line.h.size and line.spin[int(c)]]
        twists = SIZE * np.array(rods, int) + 4
        out.add(twists, twists, (2.0 * np.eye(len(rods)) - 1.0) / compliance)
    return out.matrix(size, size)


def by_turn(line: Line, x: JoinedLine, ends: Ends, state: State, k: int, rates: bool = False) -> tuple[Floats, Floats]:
    """What turns of the frame of end k do: (3, 5 (N+1)) to lengths, balances and spins, (3, 3) to its own moment.

    rates: what angular velocities of it do, by damping.  By differences, so that every law of the element counts.
    """
    count = line.s.size
    forces, moments = np.zeros((3, SIZE * count)), np.zeros((3, 3))
    frame = ends.frame[k].reshape(3, 3).copy()
    for axis in range(3):
        for sign in (1.0, -1.0):
            frames, spin, turn = ends.frame.copy(), np.zeros((2, 3)), sign * FRAME_TURN * np.eye(3)[axis]
            if rates:
                spin[k] = turn
            else:
                frames[k] = (rotation(turn) @ frame).ravel()
            rows = np.zeros((count, SIZE * WIDTH))
            report = rows_at_rest(line, x, ends._replace(frame=frames, spin=spin), state, (0.0, ANCHOR), rows)
            right = rows.reshape(count, SIZE, WIDTH)[:, :, -1].copy()  # minus the balance, minus the spin's
            right[:, 0] *= -1.0  # where tension makes a torque, the length of a cell hangs on the turn
            forces[axis] += sign * right.ravel() / (2.0 * FRAME_TURN)
            moment = report[MOMENT_A + 3 * k : MOMENT_A + 3 * k + 3] * (1.0 if k == 0 else -1.0)
            moments[:, axis] -= sign * moment / (2.0 * FRAME_TURN)
    return forces, moments


def linear_network(
    solver: NetworkSolver,
    states: NetworkState,
    names: Sequence[str],
    sticks: bool,
    quick: bool = True,
    touching: TouchingLines | None = None,
) -> LinearNetwork:
    """The lines, points and bodies of a solver, linear about an equilibrium.

    sticks, quick: as of `linear_line`; touching: lines that touch each other, or themselves, in it.
    """
    lines = tuple(
        linear_line(x, name, state, sticks, quick)
        for x, name, state in zip(solver.lines, names, states.lines, strict=True)
    )
    at = np.concatenate([[0], np.cumsum([x.free.size for x in lines])])
    points, bodies = len(solver.net), len(solver.bodies)
    parts = touching_parts(solver, states, sticks, touching)
    of_lines = int(sum(x.free.sum() for x in lines))
    of_lines -= 3 * sum(j >= 0 for joined in solver.lines for j in joined.joints)
    own = of_lines + len(parts.sheaves)
    size = own + 3 * points + 6 * bodies
    place, extra, coupling = _joined(lines, solver, states, parts.forces, at, (of_lines, own, size))
    ones = sparse.eye_array(size, format="csr")
    whole = sparse.csr_array(sparse.vstack([place, ones[own + 3 * points :], ones[of_lines:own]], format="csr"))
    A = sparse.block_diag([x.stiffness for x in lines], format="csr")
    M = sparse.block_diag([x.mass for x in lines], format="csr")
    standing = sparse.block_diag([x.standing for x in lines], format="csr")
    bodies_alone = in_last(size, in_inertial_axes(solver, states, MASS)) + whole.T @ parts.mass @ whole
    M, apart = (sparse.csr_array(place.T @ each @ place) + bodies_alone for each in (M, standing))
    A = sparse.csr_array(place.T @ A @ place) + _couplings(coupling, at, place, own + 3 * points)
    A = A + whole.T @ parts.stiffness @ whole
    A = A + in_last(size, [_own_stiffness(solver, states, b, extra) for b in range(bodies)])
    pull = max(float(np.abs(x.state.T).max()) for x in lines)
    layers = sparse.csr_array(place.T @ sparse.block_diag([x.by_layers for x in lines], format="csr") @ place)
    slow = solver.anchor / STATIC_ANCHOR * max(pull / solver.scale, 1.0)
    K, turns, M = (sparse.csc_array(each) for each in (0.5 * (A + A.T), 0.5 * (A - A.T) + layers, 0.5 * (M + M.T)))
    lent = np.asarray(place.T @ _lent(lines, solver))
    return LinearNetwork(lines, at, place, K, turns, M, apart, points, bodies, slow, lent, parts, whole)


def _joined(
    lines: Sequence[LinearLine],
    solver: NetworkSolver,
    states: NetworkState,
    forces: Floats,
    at: np.ndarray,
    sizes: tuple[int, int, int],
) -> tuple[sparse.csr_array, list[tuple[int, Floats]], list[tuple[int, int, Floats]]]:
    """Unknowns of all lines (rows) by those of the network (columns), whose points and bodies ends share.

    forces: of contact at nodes of all lines, N; at: rows where lines begin; sizes: unknowns of lines, these and those
    of sheaves, all.  Also of ends on bodies: body, its stiffness by their forces and frames; line, body, (3, unknowns
    of the line) by turns of the frame.
    """
    of_lines, own, size = sizes
    points, out, column = len(solver.net), Blocks(), 0
    extra: list[tuple[int, Floats]] = []
    coupling: list[tuple[int, int, Floats]] = []
    for l, (x, joined) in enumerate(zip(lines, solver.lines, strict=True)):
        count = x.free.size // SIZE
        free = x.free.reshape(count, SIZE).copy()
        for k, joint in enumerate(joined.joints):
            if joint < 0:
                continue
            free[-k, 1:4] = False
            rows = at[l] + SIZE * (k * (count - 1)) + 1 + np.arange(3)
            if joint < points:
                out.add(rows, own + 3 * joint + np.arange(3), np.eye(3))
                continue
            b = joint - points
            arm = states.bodies[b, FRAME:V].reshape(3, 3) @ joined.fairleads[k]
            out.add(rows, own + 3 * points + 6 * b + np.arange(6), np.hstack([np.eye(3), -hats(arm)]))
            f = x.net[k] + forces[(at[l] if k == 0 else at[l + 1] - SIZE) // SIZE]
            extra.append((b, x.held_moment[k] - hats(f) @ hats(arm)))
            if x.turned[k].any():
                coupling.append((l, b, x.turned[k]))
        own_rows = at[l] + np.flatnonzero(free.ravel())
        out.add(own_rows[:, None], np.arange(column, column + own_rows.size)[:, None], np.ones((own_rows.size, 1, 1)))
        column += own_rows.size
    assert column == of_lines, (column, of_lines)
    return out.matrix(int(at[-1]), size), extra, coupling


def _lent(lines: Sequence[LinearLine], solver: NetworkSolver) -> Floats:
    """(all lines,) m/N: compliance that is lent to cells where modes are counted, at their tensions."""
    out = []
    for x, joined in zip(lines, solver.lines, strict=True):
        own, pull = -x.stiffness.diagonal()[SIZE::SIZE], max(float(np.abs(x.state.T).max()), joined.scale)
        lent = np.zeros(x.free.size)
        lent[SIZE::SIZE] = NO_STRAIN * np.where(own > 0.0, own, x.line.h / pull)
        out.append(lent)
    return np.concatenate(out)


def _couplings(
    given: Sequence[tuple[int, int, Floats]], at: np.ndarray, place: sparse.csr_array, first: int
) -> sparse.csr_array:
    """How turns of bodies turn the frames of ends, and these push nodes and twist cells: both ways."""
    size = place.shape[1]
    out = Blocks()
    for l, b, forces in given:
        forces_on = place[at[l] : at[l + 1]].T @ forces.T  # (q, 3): forces on q that hold it while the frame turns
        rows, columns = np.flatnonzero(forces_on.any(axis=1)), first + 6 * b + 3 + np.arange(3)
        out.add(rows, columns, forces_on[rows])
        out.add(columns, rows, forces_on[rows].T)
    return out.matrix(size, size)


def damping_by_turns(solver: NetworkSolver, network: LinearNetwork) -> sparse.csr_array:
    """(q, q) damping of ends that turn with bodies, by the turns of these."""
    blocks, coupling = np.zeros((network.bodies, 6, 6)), list[tuple[int, int, Floats]]()
    for l, (x, linear) in enumerate(zip(solver.lines, network.lines, strict=True)):
        held = np.where(np.array(x.joints) >= 0, 0, x.ends.held).astype(x.ends.held.dtype)
        for k in (0, 1):
            if linear.line.bits & STIFFNESS_DAMPING and x.seats[k, TURNS] != 0.0:
                ends, b = x.ends._replace(held=held), x.joints[k] - network.points
                forces, moments = by_turn(linear.line, x, ends, linear.state, k, rates=True)
                coupling.append((l, b, forces))
                blocks[b, 3:, 3:] += moments
    first = network.size - 6 * network.bodies
    both = _couplings(coupling, network.at, network.place, first)
    return sparse.csr_array(both + in_last(network.size, list(blocks)))


def in_inertial_axes(solver: NetworkSolver, states: NetworkState, of: int) -> list[Floats]:
    """Matrices (6, 6) of bodies, those that begin at a column of their numbers."""
    axes = [np.kron(np.eye(2), state[FRAME:V].reshape(3, 3)) for state in states.bodies]
    return [R @ row[of : of + 36].reshape(6, 6) @ R.T for R, row in zip(axes, solver.bodies, strict=True)]


def in_last(size: int, blocks: Sequence[Floats]) -> sparse.csr_array:
    """(q, q) of matrices (6, 6) of all bodies, which are the last of q."""
    out, at = Blocks(), size + 6 * (np.arange(len(blocks))[:, None] - len(blocks)) + np.arange(6)
    out.add(at, at, np.reshape(blocks, (-1, 6, 6)))
    return out.matrix(size, size)


def _own_stiffness(solver: NetworkSolver, states: NetworkState, b: int, extra: Sequence[tuple[int, Floats]]) -> Floats:
    """(6, 6) of the weight of a body, of the water on it, and of forces of lines that turn with their arms."""
    K = np.zeros((6, 6))
    if solver.bodies[b, 36:NUMBERS].any() or solver.bodies[b, PIECES] != 0:  # else lines are clamped to a point
        K = _by_moving(solver, states, b, lambda _: solver.body_work[b, OWN : OWN + 6].copy())
    for stiffness in (x for other, x in extra if other == b):
        K[3:, 3:] += stiffness
    return K


def stiffness_by_water(solver: NetworkSolver, states: NetworkState, b: int, members: Members | None) -> Floats:
    """(6, 6) stiffness of the water around the members of body b, which is another where it shifts and turns."""
    if members is None:
        return np.zeros((6, 6))
    numbers, pieces = solver.bodies.copy(), slice(NUMBERS, NUMBERS + PIECE * len(members.pieces))

    def change(moved: NetworkState) -> Floats:
        before = solver.body_work[b, OWN : OWN + 6].copy()
        members.update_water(np.inf, moved.bodies[b], 0.0, solver.bodies[b, pieces].reshape(-1, PIECE))
        solver.evaluate_forces(moved, 0.0)
        solver.bodies[:] = numbers
        return np.asarray(solver.body_work[b, OWN : OWN + 6] - before)

    return _by_moving(solver, states, b, change)


def _by_moving(solver: NetworkSolver, states: NetworkState, b: int, force: Callable[[NetworkState], Floats]) -> Floats:
    """(6, 6) by which a force (6,) of a body falls with its shifts and turns (inertial), by differences.

    force: of states whose forces have been evaluated.
    """
    K, step = np.zeros((6, 6)), np.repeat([SHIFT * solver.length, TURN], 3)
    for k in range(6):
        for sign in (1.0, -1.0):
            moved = states.copy()
            if k < 3:
                moved.bodies[b, PLACE + k] += sign * step[k]
            else:
                frame = moved.bodies[b, FRAME:V].reshape(3, 3)
                moved.bodies[b, FRAME:V] = (rotation(sign * step[k] * np.eye(3)[k - 3]) @ frame).ravel()
            solver.evaluate_forces(moved, 0.0)
            K[:, k] -= sign * force(moved) / (2.0 * step[k])
    solver.evaluate_forces(states, 0.0)
    return K


# Solutions of sums of sparse matrices with complex factors, at many frequencies: the places of numbers stay.

# Bands of more diagonals cost more than sparse factors: the last line on a body has a band of 10, each more adds 5.
WIDEST = 60


class ComplexSolver:
    """Solves  sum_k z_k A_k x = b  for real sparse matrices A_k of one shape.

    Unknowns are put in the order of least bandwidth, in which a line has that of its cells.
    """

    def __init__(self, matrices: Sequence[sparse.csc_array]) -> None:
        size = matrices[0].shape[0]
        keys = [_places(x) for x in matrices]
        self._every = every = np.unique(np.concatenate(keys))
        self._parts = [self._part(x, key) for key, x in zip(keys, matrices, strict=True)]
        begin = np.searchsorted(every, np.arange(size + 1, dtype=np.int64) * size)
        self._pattern = sparse.csc_array((np.zeros(every.size, complex), every % size, begin), shape=(size, size))
        either = sparse.csr_array((np.ones(every.size), (every % size, every // size)), shape=(size, size))
        self._order = reverse_cuthill_mckee(sparse.csr_array(either + either.T), symmetric_mode=True)
        place = np.empty(size, int)
        place[self._order] = np.arange(size)
        row, column = place[every % size], place[every // size]
        self._below, self._above = int((row - column).max()), int((column - row).max())
        self._wide = 2 * self._below + self._above + 1
        self._at = self._below + self._above + row - column + self._wide * column  # in a band by columns

    def replace(self, k: int, matrix: sparse.csc_array) -> bool:
        """Put another matrix in place of A_k; False: it has numbers where no matrix had any, and is not taken."""
        key = _places(matrix)
        if not np.isin(key, self._every).all():
            return False
        self._parts[k] = self._part(matrix, key)
        return True

    def _part(self, x: sparse.csc_array, key: np.ndarray) -> Floats:
        return np.bincount(np.searchsorted(self._every, key), x.data, self._every.size).astype(float)

    def solve(self, factors: Sequence[complex], right: Floats) -> Floats:
        """x (n, ...) for right-hand sides (n, ...); RuntimeError: the matrix is singular."""
        data = np.zeros(self._at.size, complex)
        for z, part in zip(factors, self._parts, strict=True):
            if z.real:
                data.real += z.real * part
            if z.imag:
                data.imag += z.imag * part
        if self._wide > WIDEST:
            self._pattern.data = data
            return np.asarray(splu(self._pattern).solve(right))
        band = np.zeros(self._wide * len(right), complex)
        band[self._at] = data
        band = band.reshape((self._wide, -1), order="F")
        _, _, found, singular = zgbsv(self._below, self._above, band, right[self._order], overwrite_ab=True)
        if singular:
            raise RuntimeError("the matrix is singular")
        out = np.empty_like(found)
        out[self._order] = found
        return out


def _places(x: sparse.csc_array) -> np.ndarray:
    """Of every number of a matrix, increasing by columns."""
    size = x.shape[0]
    return np.repeat(np.arange(size, dtype=np.int64), np.diff(x.indptr)) * size + x.indices
