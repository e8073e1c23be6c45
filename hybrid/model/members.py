"""Morison members of a body as pieces: coefficients, added mass, and the water around them."""

from __future__ import annotations

import math

import numpy as np

from hybrid.kernels.junctions.bodies import STATE
from hybrid.kernels.junctions.members_water import blank_members_job, stir_members
from hybrid.kernels.laws.members import ALONG, CM, CN, CT, MIDDLE, PIECE, WET
from hybrid.kernels.machine.binding import Table
from hybrid.kernels.state.state import Floats, Sea
from hybrid.model.sea import Surroundings
from hybrid.scene.bodies import FreeBody


def pieces_of(body: FreeBody, density: float) -> tuple[Floats, Floats]:
    """Numbers (n, PIECE) of the pieces of all members in a fluid of a density (kg/m3), and the sizes (n, 3) of each:

    added mass across it (kg), length (m), diameter (m).
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
        self._job.bind(
            sea=self._sea.values, pieces=pieces, sizes=sizes, places=places, still=still, state=self._state,
            dt=self._asked[0], waves=self._asked[1],
        )  # fmt: skip

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
        self.stir(np.inf, row, 0.0, out)
        for x, mass in zip(out, out[:, WET] * self._sizes[:, 0], strict=True):
            p, d = x[MIDDLE:ALONG], x[ALONG:CN]
            G = np.hstack([np.eye(3), -np.cross(np.eye(3), p).T])
            M += G.T @ (mass * (np.eye(3) - np.outer(d, d))) @ G
        return M

    def stir(self, t: float, row: Floats, dt: float, out: Floats) -> None:
        """Write wetness and water at t (s; infinity: without waves) into `out` (n, PIECE), of a body that a row of a

        state has dt (s) before.
        """
        self._sea.at(t)
        self._state[:], self._asked[:, 0] = row, (dt, np.isfinite(t))
        stir_members(self.into(out).numbers)

    def into(self, out: Floats) -> Table:
        """Arguments of kernels.junctions.members_water.stir_members, which writes into `out` (n, PIECE)."""
        self._job.bind(out=out)
        return self._job
