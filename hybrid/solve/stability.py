"""Whether a state in which all forces balance is an equilibrium, and one that would stay.

It would stay where its stiffness is positive definite, or round-off hides whether it is; in a plane the stiffness falls
apart in two, within the plane and across it.  It is no equilibrium of a line without tension, buried or folded.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from hybrid.errors import Outcome
from hybrid.kernels.algebra.block_elimination import SIZE, WIDTH
from hybrid.kernels.algebra.plane import WIDE
from hybrid.kernels.algebra.sparse_rows import is_definite
from hybrid.kernels.laws.obstacles import cells_met, depths_in_obstacles, distances, half_thickness
from hybrid.kernels.laws.out_of_plane import BAND, REACH, wrong_pivots_at_rest
from hybrid.kernels.laws.seabed import LATERAL, planes_under
from hybrid.kernels.march.resolution_checks import lowest, lowest_not_held
from hybrid.kernels.mesh.zone_transfer import carry_push
from hybrid.kernels.run import newton
from hybrid.kernels.run.newton import block_rows, workspace
from hybrid.kernels.state.report import (
    AXIAL_LAW,
    AXIS,
    BODIES,
    DRAG,
    FLAT,
    FRICTION,
    HALF_LENGTH,
    KIND,
    MASS_DAMPING,
    MESH,
    MU,
    OBSTACLES,
    PLACE,
    PLANAR,
    RADIUS,
    RIDES,
    RING,
    ROTARY,
    ROUND,
    SEABED,
    SHEAVE,
    STRAND,
    TORUS,
)
from hybrid.kernels.state.state import Ends, Floats, Line, Sea, State
from hybrid.solve.stepper import JoinedLine, NetworkState

# What drifts freely (a line between two buoys) is held where it starts by springs of this part of tension scale over
# length in all: an error far below Newton's tolerance.  The check of stability lets modes as soft as NEUTRAL pass.
ANCHOR, NEUTRAL = 1e-12, 1e-9
CHECKED_COMPLIANCE = (
    1e-5  # strain at the tension scale, for the check of stability: 100 times the round-off at 10^4 cells
)
# What the factor of the stiffness loses of a node's bending stiffness (some fifty rounded operations a row), and the
# part of the softest bending of the whole line, 3 EI/L^3, beyond which that hides whether it buckles.
LOST, HIDDEN = 1e-14, 0.1
SHIFTED = 4.0  # growth of the shift that makes a stiffness definite
NO_MOMENT = 1e-3  # of EI/L: an end moment below this does not disturb the judgement of stability


def _stiffness(rows: Floats, axial: Floats, plane: Floats | None) -> Floats:
    """Stiffness (N+1, 5, m, m) of the block rows of the march: K[i, j] couples block i with block i - 2 + j.

    m = 4, (r, psi), in space; 2 in a plane.  Tensions are eliminated through the stiffness `axial` (N, 3, 3),
    d d^T/(h ck), of each cell.
    """
    n = rows.shape[0]
    if plane is None:
        J = -rows.reshape(n, SIZE, WIDTH)
        K, size = np.zeros((n, 5, 4, 4)), 3
        for j, first in enumerate((1, 6, 11, 16)):
            K[:, j] = J[:, 1:5, first : first + 4]
        K[:, 4, :, :3] = J[:, 1:5, 20:23]
    else:
        J = -rows.reshape(n, 3, WIDE)
        K, size = np.zeros((n, 5, 2, 2)), 2
        for j, first in enumerate((0, 2, 5, 8, 10)):
            K[:, j] = J[:, 1:, first : first + 2]
        axial = plane[:2] @ axial @ plane[:2].T
    for a, b in ((0, 0), (1, 1)):
        K[a : n - 1 + b, 2, :size, :size] += axial
    K[:-1, 3, :size, :size] -= axial
    K[1:, 1, :size, :size] -= axial
    return K


def _band(rows: Floats, axial: Floats, ends: Ends, spin: np.ndarray, plane: Floats | None) -> tuple[Floats, np.ndarray]:
    """Lower band of the stiffness in the block rows of the march, made symmetric, and which of its unknowns are held.

    axial: (N, 3, 3) N/m, of each cell; held nodes and cells without spin are left out, with 1 on the diagonal.
    plane: (3, 3) rows p, q, normal, where the rows are those of a line in that plane.
    """
    K = _stiffness(rows, axial, plane)
    n, _, m, _ = K.shape
    free = np.ones((n, m), bool)
    free[0], free[-1] = not ends.held[0], not ends.held[1]
    if plane is None:
        free[:-1, 3], free[-1, 3] = spin != 0, False
    held = ~free.ravel()
    reach = 3 * m - 1
    band = np.zeros((reach + 1, m * n))
    for offset in range(3):  # blocks on and right of the diagonal, averaged with their mirrors
        upper = K[: n - offset, 2 + offset]
        mirror = K[offset:, 2 - offset].transpose(0, 2, 1)
        mean = 0.5 * (upper + mirror)
        for k in range(m):
            for c in range(m):
                j = m * offset + c - k
                if 0 <= j <= reach:
                    band[j, k : m * (n - offset) : m] = mean[:, k, c]
    for j in range(reach + 1):
        band[j, : m * n - j] *= ~(held[: m * n - j] | held[j:])
    band[0, held] = 1.0
    return band, held


def _lowest(band: Floats, least: float) -> tuple[float, Floats]:
    """The lowest eigenvalue of a symmetric matrix by its lower band, and its vector (n,); least: a shift to begin with.

    By Lanczos' method on the inverse of the matrix shifted until it is definite: work and memory grow with n alone.
    """
    # not before they are needed: a short command does without scipy
    from scipy.linalg import cho_solve_banded, cholesky_banded
    from scipy.sparse.linalg import LinearOperator, eigsh

    shift, factor, n = least, None, band.shape[1]
    while factor is None:
        shifted = band.copy()
        shifted[0] += shift
        try:
            factor = cholesky_banded(shifted, overwrite_ab=True, lower=True)
        except np.linalg.LinAlgError:
            shift *= SHIFTED
    # numbers without a pattern, which no motion is orthogonal to; the same ones every time
    first = np.random.default_rng(0).standard_normal(n)
    inverse = LinearOperator((n, n), matvec=lambda x: cho_solve_banded((factor, True), x), dtype=float)
    values, vectors = eigsh(inverse, k=1, which="LA", v0=first)
    return float(1.0 / values[0] - shift), vectors[:, 0]


def is_judged(line: Line, ends: Ends, length: float) -> bool:
    """Whether the test of stability can speak: there is a rod, and no end moment to speak of.

    A moment that keeps its direction in space is not conservative; positive definiteness says nothing then.
    """
    return bool(line.element.any()) and is_without_moment(line, ends, length)


def is_without_moment(line: Line, ends: Ends, length: float) -> bool:
    """Whether no end has a moment to speak of."""
    bending = float((line.kb * line.hn[:, None]).max(initial=0.0)) / length
    return float(np.abs(ends.moment).max()) <= NO_MOMENT * bending


def stiffest_bending(line: Line) -> Floats:
    """Bending stiffness (N,) of the elements over mass and square of length, 1/s^2, of which round-off is a part."""
    h = np.append(line.h, line.h[-1])
    return np.asarray(line.kb[:, :2].max(axis=1) * line.element / (h * h * line.mass))


class Stability:
    """Judges equilibria of one line."""

    def __init__(self, line: Line, sea: Sea, length: float, scale: float) -> None:
        """length: m; scale: the tension scale, N."""
        # drag counts as a load that keeps its direction: how it turns with the cable is not conservative; a law of
        # stretch is not followed, which would write into the line, and `ck` is what it made of it last
        self.line, self.sea = line._replace(bits=line.bits & ~(DRAG | AXIAL_LAW)), sea
        self.length, self.scale = length, scale
        self.anchor = ANCHOR * scale / (float(line.mass.sum()) * length)  # 1/s2
        self.blurred = False  # whether round-off had the last word on stability

    def holds(self, ends: Ends, state: State, across: bool = False) -> bool:
        """True when the stiffness of the line is positive definite, or when round-off hides whether it is.

        Short cells are so stiff in bending that the last digits of that may outweigh a slight tension: what fails
        by no more than they are worth is no buckling.  across: of a line in a plane, judge what leaves the plane
        instead of what stays in it.
        """
        definite = self._definite_across if across else self._definite
        soft = NEUTRAL / ANCHOR * self.anchor
        self.blurred = False
        if definite(ends, state, soft):
            return True
        bending = self.line.kb[:, :2].max(axis=1) * self.line.element
        lost = LOST * float(stiffest_bending(self.line).max())
        if lost <= soft or not definite(ends, state, lost):
            return False
        EI = (bending * self.line.hn)[self.line.element == 1].min()
        self.blurred = bool(lost * float(self.line.mass.sum()) > HIDDEN * 3.0 * EI / self.length**3)
        return True

    def softest_motion(self, ends: Ends, state: State, polar: Floats) -> tuple[float, Floats]:
        """Square (1/s^2, below 0: it grows) and shape (N+1, 3) of the softest motion about an equilibrium.

        Components of the shape are at most 1.  polar: (N,) kg m^2, the inertia of the spin of each cell.
        """
        line = self.line
        band, held = self.band(ends, state, 0.0)
        weights = np.repeat(line.mass[:, None], band.shape[0] // 3, axis=1)  # 4 unknowns a node, 2 in a plane
        if not line.bits & PLANAR:
            weights[:-1, 3], weights[-1, 3] = np.where(line.spin != 0, polar, 1.0), 1.0
        inverse = 1.0 / np.sqrt(weights.ravel())
        inverse[held] = 1.0
        for j in range(band.shape[0]):
            band[j, : inverse.size - j] *= inverse[: inverse.size - j] * inverse[j:]
        square, vector = _lowest(band, self.anchor)
        shape = (inverse * vector).reshape(weights.shape)
        shape[held.reshape(shape.shape)] = 0.0
        moved = shape @ line.plane[:2] if line.bits & PLANAR else shape[:, :3]
        return square, moved / max(float(np.abs(moved).max()), 1e-300)

    def _definite(self, ends: Ends, state: State, soft: float) -> bool:
        """Whether a Cholesky factor of the stiffness exists, with springs of `soft` (1/s^2) times the mass."""
        return bool(is_definite(self.band(ends, state, soft)[0]))

    def band(self, ends: Ends, state: State, soft: float) -> tuple[Floats, np.ndarray]:
        """Lower band of the stiffness, and what of it is held, with springs of `soft` (1/s^2) times the mass.

        Axial stiffness is lowered to CHECKED_COMPLIANCE for this: it has no part in buckling,
        and at its real size its round-off would hide the softest modes of a long line.
        """
        line = self.line
        rows = block_rows(line)
        newton.assembly(line, self.sea, ends, state, 0.0, soft, workspace(line.h.size)._replace(rows=rows))
        d = state.e / np.linalg.norm(state.e, axis=1)[:, None]
        stiff = 1.0 / (line.h * np.maximum(line.ck, CHECKED_COMPLIANCE / self.scale))
        plane = line.plane if line.bits & PLANAR else None
        return _band(rows, stiff[:, None, None] * d[:, :, None] * d[:, None, :], ends, line.spin, plane)

    def _definite_across(self, ends: Ends, state: State, soft: float) -> bool:
        """Whether all pivots of the stiffness across the plane are positive, with springs as of `_definite`."""
        room = np.zeros((2 * (self.line.h.size + 1) + REACH) * BAND)
        return wrong_pivots_at_rest(self.line, self.sea, ends, state, soft, room) == 0


def is_stable(line: Line, sea: Sea, ends: Ends, state: State, length: float, scale: float) -> bool:
    """True when an equilibrium would stay in space, whether or not the line is computed in a plane.

    True too where that cannot be judged.
    """
    if not is_judged(line, ends, length):
        return True
    stability = Stability(line, sea, length, scale)
    return stability.holds(ends, state) and (not line.bits & PLANAR or stability.holds(ends, state, across=True))


# Damped motions of a line to rest, and pushes off equilibria that are not stable.

RELAXING_STEPS = 2000  # of the pseudo-transient, at most
GYRATION = 0.02  # of the length: radius of gyration lent to the spin of a line that settles
CALM = 1e-4  # of the length: movement in a step below which Newton is tried again
PUSH, TURN = 1e-2, 0.1  # the push off an unstable equilibrium: of the length per time scale, and rad about the chord
DAMPING = 2.0  # 1/s over the time scale: critical of the slowest motion
# Likewise in contact.  With 2, legs of catenaries that came together at speed folded in half of 12 scenes whose mass
# differs by at most 1 %, and the others took five times as long or more.
CONTACT_DAMPING = 8.0
GROWN = 0.5  # steps of a slow fall, over the time in which it grows e-fold


def gyration(line: Line, length: float) -> Floats:
    """Inertia (N,) kg m^2 that is lent to the spin of the cells of a line that settles.

    A spin without inertia would follow Newton to any equilibrium, stable or not: this gives it some to fall with.
    """
    return np.asarray(line.spin * 0.5 * (line.mass[:-1] + line.mass[1:]) * (GYRATION * length) ** 2)


def damped(line: Line, length: float, time_scale: float, damping: float = DAMPING) -> Line:
    """The line with so much damping by mass, 1/s over the time scale (s), and inertia of spin."""
    return line._replace(
        damp=np.nan_to_num(line.damp) + damping * line.mass / time_scale,
        polar=np.nan_to_num(line.polar) + gyration(line, length),
        rotary=np.nan_to_num(line.rotary),
        bits=line.bits | MASS_DAMPING | ROTARY,
    )


def growth_time(square: float, time_scale: float, damping: float = DAMPING) -> float:
    """Time (s) in which a motion with this square (1/s^2, below 0) grows e-fold; damping: as of `damped`."""
    half = 0.5 * damping / time_scale
    return float(1.0 / (np.sqrt(half**2 - square) - half))


def stop(state: State) -> None:
    """Stop all motion of a state."""
    for still in (state.v, state.a, state.vd, state.w, state.wa, state.wd):
        still[:] = 0.0


def along(shape: Floats, length: float, time_scale: float, damping: float = DAMPING) -> Floats:
    """Speeds (N+1, 3) m/s that carry a line PUSH of its length along a shape (N+1, 3); damping: as of `damped`."""
    return damping * PUSH * length / time_scale * shape


def nudged(line: Line, state: State, length: float, time_scale: float) -> State:
    """A state given a small push in all three directions and a turn about itself, off an unstable equilibrium."""
    pushed = state.copy()
    x = line.s / length
    speed = PUSH * length / time_scale
    for k in range(3):
        pushed.v[:, k] = speed * np.sin((k + 1) * np.pi * x + 0.3 * k)
    if line.bits & PLANAR:
        pushed.v[:] -= np.outer(pushed.v @ line.plane[2], line.plane[2])
        return pushed
    d = pushed.e / np.linalg.norm(pushed.e, axis=1)[:, None]
    turned = np.cos(TURN) * pushed.a1 + np.sin(TURN) * np.cross(d, pushed.a1)
    pushed.a1[:] = np.where(line.spin[:, None] == 1, turned, pushed.a1)
    return pushed


# A small push out of the plane that is carried along with a motion in it (kernels.laws.out_of_plane).

# Sines over the length whose sum is the push: enough that no mode of a line that could grow is left out.
SINES = 6


def seed(s: Floats, speed: float) -> Floats:
    """A push (N+1, 4): displacement, rate and accelerations; rates of about `speed` (m/s), and nothing else."""
    out, x = np.zeros((s.size, 4)), s / s[-1]
    for k in range(1, SINES + 1):
        out[:, 1] += speed * np.sin(k * np.pi * x + 0.3 * k) / k
    return out


def scaled(push: Floats, size: float, s: Floats) -> Floats:
    """The push, so that nothing is displaced by more than `size` (m); begun anew where it is not finite, or nothing."""
    largest = float(np.abs(push[:, 0]).max())
    if not 0.0 < largest < np.inf:
        push, largest = seed(s, 1.0), 1.0
    return np.asarray(push * (size / largest))


def on_nodes(push: Floats, s: Floats, at: Floats) -> Floats:
    """The push at other nodes."""
    out = np.zeros((at.size, 4))
    carry_push(push, s, at, out)
    return out


# --- why a state is no equilibrium: without tension, buried, folded ----------------------------

LEAST_TENSION = 1e-3  # of the slack floor of a motion, with the opposite sign: what a catenary needs more of at rest
# A line that lies this part of its length, and this many onsets of contact, under the bed has gone through it.
BURIED, BURIED_ONSETS = 0.02, 100.0
# Chords that turn by more than this from one cell to the next, rad, are a fold, whose bend is within the cells.  Where
# both cells pull, the line hangs in the fold as in a tight sag: each pulls by less than the load of one cell, and the
# shape is right to a cell, as the diagnostics say.  A rod that presses on the fold by more than that load, and than the
# EI/h^2 that its bend there bears, stands on it, which no bend of its true size lets it.
FOLDED = 0.5 * np.pi
LIES_SLACK = 1e-9  # of the largest tension: what round-off leaves in a line that lies slack
HARDLY = 1e-3  # of the tension scale: a catenary that is compressed by less is slack
RESOLVED = 0.3  # rad from one cell to the next, of a bend that cells show
# From how near an obstacle on a line counts as on it, as a part of how deep it may lie.
TOUCHING = 0.01
# Of its radius squared: how far a line is on the other side of an obstacle than the straight span of its ends.
BEHIND = 0.05
# Product of mean normals from which on two places of an obstacle are on opposite sides; of its radius, for differences.
OPPOSITE, NORMAL_STEP = 0.25, 1e-5
PASSED = 0.8  # of half the thickness of an obstacle: depth that the straight way of a place has which passed through it
SECTIONS = 24  # golden sections of that way
PLACES = 4  # that are looked at in a cell


def lowest_tension(line: Line, sea: Sea, state: State) -> tuple[float, int]:
    """Lowest tension of a catenary cell that does not lie slack, or held by friction, on the bed, N, and the cell."""
    if line.bits & FRICTION:
        return lowest_not_held(line, sea, state.T)
    lies = lies_slack(line, sea, state)
    return lowest(line, np.where(lies, np.inf, state.T) if lies.any() else state.T)


def lies_slack(line: Line, sea: Sea, state: State) -> np.ndarray:
    """Cells (N,) of a catenary that lie, or come down, on the bed without tension: they carry nothing, in any shape."""
    if not line.bits & SEABED:
        return np.zeros(line.h.size, bool)
    nothing = LIES_SLACK * float(np.abs(state.T).max())
    rests = planes_under(sea, state.r)[1] > 0.0
    rests[[0, -1]] |= rests[[1, -2]]  # an end at the height of the bed
    return np.asarray((line.spin == 0) & (np.abs(state.T) <= nothing) & (rests[:-1] | rests[1:]))


def flaw_of_line(line: Line, sea: Sea, state: State, length: float, floor: float) -> tuple[Outcome, int]:
    """What makes a state no equilibrium of a line, or OK, and the cell or node.

    SLACK: a catenary is not under a tension of more than `floor` (N).  BURIED: deep in the bed or an obstacle.
    FOLDED: a rod stands on a fold.
    """
    tension, cell = lowest_tension(line, sea, state)
    if not tension > floor:
        return Outcome.SLACK, int(cell)
    if line.bits & SEABED:
        deep = planes_under(sea, state.r)[1] - 0.5 * sea.onset
        if deep.max() > max(BURIED * length, BURIED_ONSETS * sea.onset):
            return Outcome.BURIED, int(np.argmax(deep))
    if line.bits & OBSTACLES:
        met = cells_met(sea.carried, line.s) if sea.carried.size else None
        within = depths_in_obstacles(sea, state.r, line.s, met).max(axis=0)
        if within.max() > 1.0:
            return Outcome.BURIED, int(np.argmax(within))
    turns = np.where(_pressed(line, state), folds(line, state), 0.0)
    if turns.max() > FOLDED:
        return Outcome.FOLDED, int(np.argmax(turns))
    return Outcome.OK, -1


def _pressed(line: Line, state: State) -> np.ndarray:
    """Nodes (N+1,) of rods that a cell presses on by more than their load and their stiffness, EI/h^2, bear."""
    low = np.minimum(np.append(state.T, np.inf), np.append(np.inf, state.T))
    return np.asarray(-low > np.linalg.norm(line.force, axis=1) + line.kb[:, :2].max(axis=1) / line.hn)


def folds(line: Line, state: State) -> Floats:
    """Angle (N+1,), rad, by which chords turn from one cell to the next; 0 where no rod without a point load bends."""
    d = state.e / np.linalg.norm(state.e, axis=1)[:, None]
    turn = np.zeros(line.s.size)
    turn[1:-1] = np.arctan2(np.linalg.norm(np.cross(d[:-1], d[1:]), axis=1), np.einsum("ij,ij->i", d[:-1], d[1:]))
    turn[line.element == 0] = 0.0
    # beside a point load a line bends within sqrt(EI/T), however long its cells are
    turn[(line.point_mass > 0.0) | (line.point_lift != 0.0)] = 0.0
    if line.bits & BODIES:
        turn[line.point_buoy != 0.0] = 0.0
    return turn


def overstretched_cell(line: Line, state: State, borne: Floats) -> int:
    """The cell that is stretched or compressed most, of those that are beyond the strain that they bear; -1: none is.

    borne: (N,).  A line can be in balance on the wrong side of an obstacle, stretched round it.
    """
    part = np.abs(np.linalg.norm(state.e, axis=1) / line.h - 1.0) / borne
    return int(np.argmax(part)) if part.max() > 1.0 else -1


def on_obstacles(line: Line, sea: Sea, state: State) -> np.ndarray:
    """Which nodes (M, N+1) of a line, or the cells after them, lie on each obstacle."""
    met = cells_met(sea.carried, line.s) if sea.carried.size else None
    return depths_in_obstacles(sea, state.r, line.s, met) > -TOUCHING


ON_BED = "on the seabed"


def rubs_on(line: Line, sea: Sea, held: np.ndarray, state: State) -> list[str]:
    """On what with friction a line lies, in words.

    At other nodes than ends (2,) that are held, which no friction moves.
    """
    free, found = np.ones(line.s.size, bool), []
    free[[0, -1]] = held != 1
    bed = line.bits & SEABED and (sea.friction.any() or (sea.soil.size and sea.soil[LATERAL] > 0.0))
    if bed and (planes_under(sea, state.r)[1][free] > 0.0).any():
        found.append(ON_BED)
    if line.bits & OBSTACLES and on_obstacles(line, sea, state)[sea.obstacles[:, MU] > 0.0][:, free].any():
        found.append("on obstacles")
    return found


def behind_obstacles(line: Line, sea: Sea, state: State) -> Iterator[tuple[int, int]]:
    """Obstacles that a line touches on the side that is away from the straight span of its ends, and a node there.

    A line that hangs through an obstacle is begun on the side of the span.
    """
    rows, way, touched = sea.obstacles, state.r[-1] - state.r[0], on_obstacles(line, sea, state)
    for which, (row, nodes) in enumerate(zip(rows, touched, strict=True)):
        axis, place, r = row[AXIS : AXIS + 3], row[PLACE : PLACE + 3], state.r[nodes]
        if row[KIND] == TORUS:  # in the hole of a ring a line lies on any side
            r = r[np.linalg.norm(np.cross(r - place, axis), axis=1) > row[RING]]
        if row[KIND] in (FLAT, MESH) or not r.size:
            continue
        half = row[HALF_LENGTH] if row[KIND] == ROUND else 0.0
        along = np.clip((r - place) @ axis, -half, half)
        middle = place + along.mean() * axis
        part = np.clip((middle - state.r[0]) @ way / (way @ way), 0.0, 1.0) if way.any() else 0.0
        span, side = state.r[0] + part * way - middle, (r - middle).mean(axis=0)
        if half > 0.0 or row[KIND] == SHEAVE:  # of a cylinder or sheave what counts is across its axis
            span, side = span - (span @ axis) * axis, side - (side @ axis) * axis
        if span @ side < -BEHIND * row[RADIUS] ** 2:
            yield which, int(np.flatnonzero(nodes)[0])


def obstacles_left(line: Line, sea: Sea, start: State, state: State) -> Iterator[tuple[int, int, bool]]:
    """Obstacles that a line touches at its start, and in a state not, or on the other side.

    With the node that is nearest at the start, and whether it touches the other side.
    """
    rows, touched = sea.obstacles, on_obstacles(line, sea, state)
    gaps = distances(sea, start.r)
    for which, gap in enumerate(gaps):
        near = gap < BEHIND * rows[which, RADIUS]
        if rows[which, KIND] == FLAT or not near.any():
            continue
        node = int(np.argmin(gap))
        if not touched[which].any():
            yield which, node, False
            continue
        before, now = (_mean_normal(sea, which, r) for r in (start.r[near], state.r[touched[which]]))
        if before @ now < -OPPOSITE:
            yield which, node, True


def passed_obstacles(sea: Sea, start: Floats, end: Floats) -> Iterator[tuple[int, int]]:
    """Obstacles that a line has passed through on the straight way between two shapes outside of them; the node there.

    start, end: (N+1, 3) m.  A line that has slid off the end of an obstacle, or over its brim, may count as well.
    What a free body carries is left out: it has moved, too.
    """
    x = np.linspace(0.0, 1.0, PLACES, endpoint=False)[:, None, None]
    a, b = (((1.0 - x) * r[:-1] + x * r[1:]).transpose(1, 0, 2).reshape(-1, 3) for r in (start, end))
    thick, golden = half_thickness(sea.obstacles), 0.5 * (np.sqrt(5.0) - 1.0)
    rides = sea.carried[:, RIDES] if sea.carried.size else np.zeros(len(thick))
    for which, (row, *gaps) in enumerate(zip(sea.obstacles, distances(sea, a), distances(sea, b), strict=True)):
        if row[KIND] in (FLAT, TORUS) or rides[which] or min(x.min() for x in gaps) < -row[STRAND]:
            continue
        low, high = np.zeros((len(a), 1)), np.ones((len(a), 1))
        for _ in range(SECTIONS):  # the distance to what is convex is so along a straight way
            p, q = high - golden * (high - low), low + golden * (high - low)
            left = (distances(sea, a + p * (b - a)) < distances(sea, a + q * (b - a)))[which, :, None]
            low, high = np.where(left, low, p), np.where(left, q, high)
        least = distances(sea, a + 0.5 * (low + high) * (b - a))[which]
        if least.min() < -PASSED * thick[which]:
            yield which, int(least.argmin()) // PLACES


def _mean_normal(sea: Sea, which: int, r: Floats) -> Floats:
    """Mean (3,) of the outward normals of an obstacle at places r (n, 3) m, by differences of its distance."""
    step = NORMAL_STEP * max(float(sea.obstacles[which, RADIUS]), NORMAL_STEP)
    slopes = [distances(sea, r + step * axis)[which] - distances(sea, r - step * axis)[which] for axis in np.eye(3)]
    return np.asarray(np.mean(slopes, axis=1) / (2.0 * step))


def fold_text(line: Line, state: State, node: int) -> str:
    """How sharp the fold at a node is, and the cells that show a bend in its place."""
    turn = float(folds(line, state)[node])
    cell = RESOLVED * line.hn[node] / turn
    return f"{np.degrees(turn):.0f} deg from one cell to the next; cells of {cell:.2g} m would show the bend"


def slack_text(line: Line, state: State, scale: float) -> str:
    """How much of a catenary that is not all under tension is compressed, or slack; scale: its tension scale, N."""
    T, h, hardly = state.T[line.spin == 0], line.h[line.spin == 0], HARDLY * scale
    if T.min() < -hardly:
        return f"{h[T < 0.0].sum():.3g} m are compressed, by {-T.min():.3g} N at most"
    return f"{h[hardly > T].sum():.3g} m are slack, under less than {hardly:.2g} N: a catenary has no shape there"


def at_rest(x: JoinedLine) -> float:
    """Tension, N, that a catenary of a line has more of at rest."""
    return LEAST_TENSION * abs(x.floor) if np.isfinite(x.floor) else x.floor


def slack_cell(x: JoinedLine, state: State) -> int:
    """The cell of a catenary with the lowest tension where a line at rest is slack; -1: it is not."""
    tension, cell = lowest_tension(x.line, x.sea, state)
    return -1 if tension > at_rest(x) else int(cell)


def flaw_of_lines(lines: Sequence[JoinedLine], states: NetworkState) -> tuple[Outcome, int, int]:
    """The outcome (OK: there is none), the line, and its node or cell, as `flaw_of_line` finds them."""
    for k, (x, state) in enumerate(zip(lines, states.lines, strict=True)):
        outcome, where = flaw_of_line(x.line, x.sea, state, x.length, at_rest(x))
        if outcome == Outcome.OK and x.borne.size and (cell := overstretched_cell(x.line, state, x.borne)) >= 0:
            outcome, where = Outcome.OVERSTRETCHED, cell
        if outcome != Outcome.OK:
            return outcome, k, where
    return Outcome.OK, -1, -1


def buckling_line(lines: Sequence[JoinedLine], states: NetworkState, blurred: set[int]) -> int:
    """The first line that would buckle between what its ends are joined to, held where it is; -1: none.

    blurred: gets the numbers of lines of which round-off hides it.
    """
    for k, (x, state) in enumerate(zip(lines, states.lines, strict=True)):
        ends = x.ends._replace(held=np.minimum(x.ends.held, 1))
        if is_judged(x.line, ends, x.length):
            stability = Stability(x.line, x.sea, x.length, x.scale)
            if not stability.holds(ends, state):
                return k
            if stability.blurred:
                blurred.add(k)
    return -1
