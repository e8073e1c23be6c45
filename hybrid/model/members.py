"""Morison members of a body as pieces: coefficients, added mass, and the water around them."""

from __future__ import annotations

import math

import numpy as np

from hybrid.kernels.junctions.bodies import FRAME, PLACE, A, V, W
from hybrid.kernels.laws.members import ALONG, CM, CN, CT, MIDDLE, PIECE, PUSH, WATER, WET
from hybrid.kernels.laws.water import wave_kinematics
from hybrid.kernels.state.state import Floats
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
        self._still = np.zeros((len(pieces), 3))

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
        R = row[FRAME:V].reshape(3, 3)
        arms = self.pieces[:, MIDDLE:ALONG] @ R.T
        middle = row[PLACE:FRAME] + dt * row[V : V + 3] + 0.5 * dt * dt * row[A : A + 3]
        r = middle + arms + dt * np.cross(R @ row[W : W + 3], arms)
        sea = self._sea.at(t)
        level = np.full(len(r), sea.surface if np.isfinite(sea.surface) else np.inf)
        out[:, WATER:PIECE] = 0.0
        for k in range(3):
            out[:, WATER + k] = sea.now[1] * np.interp(r[:, 2], sea.z, sea.current[:, k])
        if len(sea.waves) and np.isfinite(t):
            wave_kinematics(sea, np.ascontiguousarray(r), self._still)
            out[:, WATER:PUSH] += sea.flow[:, :3]
            out[:, PUSH:PIECE] = sea.flow[:, 3:6]
            level += sea.flow[:, 6]
        up = np.abs((self.pieces[:, ALONG:CN] @ R.T)[:, 2])
        high = up * self._sizes[:, 1] + np.sqrt(np.maximum(1.0 - up * up, 0.0)) * self._sizes[:, 2]
        out[:, WET] = np.clip((level - r[:, 2]) / high + 0.5, 0.0, 1.0)
