"""Whether an equilibrium would stay: its stiffness is positive definite, or round-off hides whether it is.

In a plane the stiffness falls apart in two, within the plane and across it.
"""

from __future__ import annotations

import numpy as np

from hybrid.kernels.algebra.block_elimination import SIZE, WIDTH
from hybrid.kernels.algebra.plane import WIDE
from hybrid.kernels.algebra.sparse_rows import is_definite
from hybrid.kernels.laws.out_of_plane import BAND, REACH, wrong_pivots_at_rest
from hybrid.kernels.mesh.zone_transfer import carry_push
from hybrid.kernels.run import newton
from hybrid.kernels.run.newton import block_rows, workspace
from hybrid.kernels.state.report import AXIAL_LAW, DRAG, MASS_DAMPING, PLANAR, ROTARY
from hybrid.kernels.state.state import Ends, Floats, Line, Sea, State

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
