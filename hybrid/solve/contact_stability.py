"""Whether an equilibrium with contact would stay: one stiffness of all lines, points and contact is positive definite.

Line by line that cannot be judged: what one line rests on is another one, which gives way.  Points move; bodies and
what is clamped to them are held where they are, so that a motion of these alone is not found.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.contact.self_contact_law import ACROSS, ALONG, FOLLOWS, FORCE, NORMAL, RATES, SLOPE, WX, WY, P, Q
from hybrid.kernels.contact.self_contact_pairs import Contact
from hybrid.kernels.state.state import Floats
from hybrid.solve.joined import NetworkState
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.stability import (
    ANCHOR,
    LOST,
    NEUTRAL,
    SHIFTED,
    Stability,
    gyration,
    is_without_moment,
    stiffest_bending,
)

EACH = 4  # unknowns of a node, (r, psi)
# Sample points of contact lie a quarter of a diameter apart, and a line rests between them as in hollows: whether it
# would slide without these is asked of that many times more.
FINER = 4


def contact_stiffness(contact: Contact) -> tuple[NDArray[np.int64], Floats]:
    """Nodes (n, 6) of the latest points of contact, and their stiffness (n, 18, 18), N/m.

    Three nodes of each piece; second derivatives of energies by the places of these nodes
    (kernels.contact.self_contact_law).
    """
    rows = contact.points[: contact.counts.points]
    n, slope = rows[:, NORMAL : NORMAL + 3], rows[:, SLOPE : SLOPE + 3]
    weights = np.concatenate([rows[:, WX : WX + 3], -rows[:, WY : WY + 3]], axis=1)
    rates = np.concatenate([np.zeros((len(rows), 3)), rows[:, RATES : RATES + 3]], axis=1)
    across, along = rows[:, ACROSS, None, None], rows[:, ALONG, None, None]
    law = across * np.eye(3) + (along - across) * n[:, :, None] * n[:, None, :]
    H = np.einsum("ki,kj,kab->kiajb", weights, weights, law).reshape(-1, 18, 18)
    b = -weights[:, :, None] * slope[:, None, :] - rates[:, :, None] * n[:, None, :]
    b = rows[:, FORCE, None] * b.reshape(-1, 18)
    H -= rows[:, FOLLOWS, None, None] * b[:, :, None] * b[:, None, :]
    pieces = rows[:, [P, Q]].astype(np.int64)
    return (pieces[:, :, None] + np.arange(-1, 2)).reshape(-1, 6), H


def _factor(matrix: Any) -> Any:
    """A factor of a symmetric matrix, taken without exchanges; None: the matrix is not positive definite."""
    from scipy.sparse.linalg import splu

    try:
        factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError:  # singular
        return None
    definite = np.array_equal(factor.perm_r, factor.perm_c) and factor.U.diagonal().min() > 0.0
    return factor if definite else None


class ContactStability:
    """Judges equilibria of a solver whose lines touch each other or themselves."""

    def __init__(self, solver: NetworkSolver) -> None:
        self._solver, lines, points = solver, solver.lines, len(solver.net)
        # Of the last equilibrium: whether it would not stay with more sample points; whether round-off hides it.
        self.in_hollows = self.blurred = False
        begins = np.concatenate([[0], np.cumsum([x.line.s.size for x in lines])])
        self._nodes = [np.arange(a, b) for a, b in pairwise(begins.tolist())]
        self._parts = [Stability(x.line, x.sea, x.length, x.scale) for x in lines]
        self._ends, self._same = [], np.arange(EACH * begins[-1])  # of each unknown, the one that it is
        first: dict[int, int] = {}
        for x, nodes in zip(lines, self._nodes, strict=True):
            held = np.minimum(x.ends.held, 1)
            for end in (0, 1):
                if 0 <= x.joints[end] < points:  # one node of all lines that are joined to the point
                    held[end] = 0
                    node = int(nodes[-end])
                    of = first.setdefault(x.joints[end], node)
                    self._same[EACH * node : EACH * node + 3] = EACH * of + np.arange(3)
            self._ends.append(x.ends._replace(held=held))

    @property
    def judges(self) -> bool:
        """Whether no end has a moment, which keeps its direction and has no energy."""
        return all(is_without_moment(x.line, x.ends, x.length) for x in self._solver.lines)

    @property
    def is_complete(self) -> bool:
        """Whether nothing that moves is held here."""
        return not len(self._solver.bodies)

    def holds(self, states: NetworkState) -> bool:
        """Whether an equilibrium would stay; True too where round-off hides it, as of one line (`Stability.holds`)."""
        finer = self._contact(states, FINER)
        self.in_hollows = finer is not None and not self._is_definite(states, finer)
        self.blurred = False
        return self._is_definite(states, self._contact(states, 1))

    def _is_definite(self, states: NetworkState, contact: Any) -> bool:
        """As of one line (`Stability.holds`), with this stiffness of contact."""
        soft = NEUTRAL / ANCHOR * self._solver.anchor
        if _factor(self._matrix(states, soft, contact)[0]) is not None:
            return True
        lost = LOST * max(float(stiffest_bending(x.line).max()) for x in self._solver.lines)
        self.blurred = lost > soft and _factor(self._matrix(states, lost, contact)[0]) is not None
        return self.blurred

    def softest_motion(self, states: NetworkState) -> tuple[float, list[Floats]]:
        """Square (1/s^2, below 0: it grows) and shapes (N+1, 3) of the lines of the softest motion of an equilibrium.

        The largest component is 1.
        """
        # not before they are needed: a short command does without scipy
        from scipy.sparse import diags_array, eye_array
        from scipy.sparse.linalg import LinearOperator, eigsh

        K, fixed = self._matrix(states, 0.0, self._contact(states, 1))
        masses = np.bincount(self._same, self._masses(), self._same.size)
        scales = np.where(fixed, 1.0, 1.0 / np.sqrt(np.where(masses > 0.0, masses, 1.0)))
        K = (diags_array(scales) @ K @ diags_array(scales)).tocsc()
        shift, one = self._solver.anchor, eye_array(scales.size, format="csc")
        while (factor := _factor((K + shift * one).tocsc())) is None:
            shift *= SHIFTED
        # numbers without a pattern, which no motion is orthogonal to; the same ones every time
        first = np.random.default_rng(0).standard_normal(scales.size)
        inverse = LinearOperator(K.shape, matvec=factor.solve, dtype=float)
        values, vectors = eigsh(inverse, k=1, which="LA", v0=first)
        moved = np.where(fixed, 0.0, scales * vectors[:, 0])[self._same].reshape(-1, EACH)[:, :3]
        moved = moved / moved.ravel()[np.abs(moved).argmax()]
        return float(1.0 / values[0] - shift), [moved[nodes] for nodes in self._nodes]

    def _masses(self) -> Floats:
        """Of the unknowns of the lines, kg, kg m^2; 0: it has none."""
        found = []
        for x in self._solver.lines:
            masses = np.repeat(x.line.mass[:, None], EACH, axis=1)
            masses[:, 3] = np.append(gyration(x.line, x.length), 0.0)
            found.append(masses.ravel())
        return np.concatenate(found)

    def _contact(self, states: NetworkState, finer: int) -> Any:
        """Stiffness of contact in states at rest, by the unknowns of the lines; None: there is no room for its points.

        finer: by how much more sample points lie on each piece than the law has.
        """
        from scipy.sparse import csc_array

        rows, columns, values = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)], [np.zeros(0)]
        for contact, lines in self._solver.contacts_at(states, finer):
            if contact.counts.overflow:
                return None
            nodes, H = contact_stiffness(contact)
            nodes = np.concatenate([self._nodes[k] for k in lines])[nodes]
            unknowns = (EACH * nodes[:, :, None] + np.arange(3)).reshape(-1, 18)
            rows.append(np.repeat(unknowns, 18, axis=1).ravel())
            columns.append(np.tile(unknowns, (1, 18)).ravel())
            values.append(H.ravel())
        entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
        return csc_array(entries, shape=(self._same.size, self._same.size))

    def _matrix(self, states: NetworkState, soft: float, contact: Any) -> tuple[Any, NDArray[np.bool_]]:
        """Stiffness of all, and which unknowns are none: held, or those of an end that is a point of another line.

        soft: 1/s^2, of springs of that times the mass; contact: `_contact` of the states.
        """
        from scipy.sparse import block_diag, csc_array, dia_array, diags_array

        blocks, held = [], []
        for part, ends, state in zip(self._parts, self._ends, states.lines, strict=True):
            band, fixed = part.band(ends, state, soft)
            size, reach = fixed.size, np.arange(band.shape[0])
            lower = dia_array((band, -reach), shape=(size, size))
            blocks.append(lower + lower.T - diags_array(band[0]))
            held.append(fixed)
        size = self._same.size
        fixed = np.concatenate(held) | (self._same != np.arange(size))
        free = diags_array((~np.concatenate(held)).astype(float))
        join = free @ csc_array((np.ones(size), (np.arange(size), self._same)), shape=(size, size))
        K = join.T @ (block_diag(blocks, format="csc") + contact) @ join
        return (K + diags_array(fixed.astype(float))).tocsc(), fixed
