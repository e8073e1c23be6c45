"""Ropes that cross (tests/validation/test_validation_lines_contact.py) in sine series: no cells, no sample points.

Each rope is its chord and a series of sines; both touch at the one point where they are nearest, found by Newton's
method, by a stiff spring.  The equilibrium with the symmetry of the scene, its softest motion, and where it leads.

    python -m pytest bench/test_bench_crossing.py -m bench -n 0 -q -s
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest

import hybrid
from hybrid.kernels.state.state import Floats
from tests.validation.test_validation_lines_contact import (
    AREA,
    DENSITY,
    FORCES,
    MODULUS,
    RADIUS,
    crossing,
    force_between,
)

TERMS, SPRING = 24, 3000.0  # of a series; N/m
STRETCH, BEND, WEIGHT = MODULUS * AREA, MODULUS * np.pi * RADIUS**4 / 4, DENSITY * AREA * 9.81
WAVES = np.pi * np.arange(1, TERMS + 1)


@dataclass
class Rope:
    """Ends (2, 3) m; the rope is 1 m long."""

    ends: Floats
    points: Floats = field(init=False)
    weights: Floats = field(init=False)

    def __post_init__(self) -> None:
        x, w = np.polynomial.legendre.leggauss(160)
        self.points, self.weights = 0.5 * (x + 1.0), 0.5 * w

    def at(self, a: Floats, u: float) -> tuple[Floats, Floats, Floats]:
        """Place at u of the rope with the series a (TERMS, 3), and its two derivatives."""
        chord = self.ends[1] - self.ends[0]
        sines, cosines = np.sin(WAVES * u), WAVES * np.cos(WAVES * u)
        return self.ends[0] + u * chord + sines @ a, chord + cosines @ a, -(WAVES**2 * sines) @ a

    def energy(self, a: Floats) -> tuple[float, Floats]:
        """Energy, J, and its derivative by the series."""
        s, w = self.points, self.weights
        S, C = np.sin(np.outer(s, WAVES)), np.cos(np.outer(s, WAVES)) * WAVES
        chord = self.ends[1] - self.ends[0]
        r1, r2 = chord + C @ a, -(S * WAVES**2) @ a
        l = np.linalg.norm(r1, axis=1)[:, None]
        t = r1 / l

        def across(x: Floats) -> Floats:
            return np.asarray(x - (x * t).sum(1)[:, None] * t)

        bend = across(r2) / l  # of the tangent by s
        height = (self.ends[0] + np.outer(s, chord) + S @ a)[:, 2]
        density = 0.5 * STRETCH * (l[:, 0] - 1.0) ** 2 + 0.5 * BEND * (bend**2).sum(1) + WEIGHT * height
        q = BEND * bend
        by_tangent = -((q * t).sum(1)[:, None] * r2 + (r2 * t).sum(1)[:, None] * q) / l
        by_r1 = STRETCH * (l - 1.0) * t + across(by_tangent) / l - (q * bend).sum(1)[:, None] / l * t
        slope = C.T @ (w[:, None] * by_r1) - (S * WAVES**2).T @ (w[:, None] * across(q) / l)
        slope[:, 2] += S.T @ (w * WEIGHT)
        return float(w @ density), slope


class Pair:
    """Both ropes; the upper one's pins are `drop` (m) lower."""

    def __init__(self, drop: float) -> None:
        self.upper = Rope(np.array([[-0.4, 0, -drop], [0.4, 0, -drop]]))
        self.lower = Rope(np.array([[0, -0.4, 0.0], [0, 0.4, 0.0]]))
        self.places = np.array([0.5, 0.5])  # where they are nearest

    def apart(self, q: Floats) -> Floats:
        """From the lower to the upper one (3,), where they are nearest."""
        a, b = q.reshape(2, TERMS, 3)
        for _ in range(50):
            (x, x1, x2), (y, y1, y2) = self.upper.at(a, self.places[0]), self.lower.at(b, self.places[1])
            d = x - y
            J = np.array([[x1 @ x1 + d @ x2, -y1 @ x1], [-x1 @ y1, y1 @ y1 - d @ y2]])
            move = -np.linalg.solve(J, [d @ x1, -d @ y1])
            self.places += move * min(1.0, 0.05 / np.abs(move).max())
            if np.abs(move).max() < 1e-14:
                break
        return np.asarray(d)

    def energy(self, q: Floats) -> tuple[float, Floats, float]:
        """Energy, its derivative, and the vertical force of the upper rope on the lower one, N."""
        (upper, by_upper), (lower, by_lower) = (
            x.energy(a) for x, a in zip((self.upper, self.lower), q.reshape(2, TERMS, 3), strict=True)
        )
        d = self.apart(q)
        n = d * np.copysign(1.0 / np.linalg.norm(d), d[2])
        gap = 2.0 * RADIUS - n @ d
        by_upper = by_upper - SPRING * gap * np.outer(np.sin(WAVES * self.places[0]), n)
        by_lower = by_lower + SPRING * gap * np.outer(np.sin(WAVES * self.places[1]), n)
        slope = np.concatenate([by_upper.ravel(), by_lower.ravel()])
        return upper + lower + 0.5 * SPRING * gap**2, slope, float(SPRING * gap * n[2])

    def stiffness(self, q: Floats) -> Floats:
        small = 1e-7 * np.eye(q.size)
        K = np.array([self.energy(q + x)[1] - self.energy(q - x)[1] for x in small]) / 2e-7
        return 0.5 * (K + K.T)

    def rest(self, q: Floats, free: np.ndarray) -> Floats:
        """Down to where the free numbers of both series are at rest."""
        self.places[:] = 0.5
        for _ in range(100):
            energy, slope, _ = self.energy(q)
            if np.abs(slope[free]).max() < 1e-10:
                break
            values, vectors = np.linalg.eigh(self.stiffness(q)[np.ix_(free, free)])
            step = np.zeros_like(q)
            step[free] = -vectors @ ((vectors.T @ slope[free]) / np.maximum(np.abs(values), 1e-9))
            step *= min(1.0, 0.02 / np.abs(step).max())
            for _ in range(30):
                places = self.places.copy()
                if self.energy(q + step)[0] <= energy + 1e-13:
                    break
                step, self.places = 0.5 * step, places
            q = q + step
        return q


def in_the_middle(drop: float) -> tuple[Pair, Floats]:
    """The equilibrium with the symmetry of the scene."""
    pair, q, free = Pair(drop), np.zeros((2, TERMS, 3)), np.zeros((2, TERMS, 3), bool)
    q[0, 0, 2], q[1, 0, 2] = 0.05, -0.25
    free[:, ::2, 2] = free[0, 1::2, 0] = free[1, 1::2, 1] = True
    return pair, pair.rest(q.ravel(), free.ravel())


@pytest.mark.bench
@pytest.mark.parametrize("drop", FORCES)
def test_crossing_ropes_in_sine_series(drop: float) -> None:
    """Force in the middle, square of the softest motion there, and force of the rest to which that leads."""
    pair, q = in_the_middle(drop)
    force, (squares, vectors) = pair.energy(q)[2], np.linalg.eigh(pair.stiffness(q))
    square = squares[0] / (0.5 * DENSITY * AREA)
    beside = q + 0.01 * vectors[:, 0] / np.abs(vectors[:, 0]).max() * (square < 0.0)
    beside = pair.rest(beside, np.ones(q.size, bool))
    found = force_between(hybrid.static(crossing(drop)), 0)[1]
    print(f"\ndrop {drop} m: {force:.6f} N in the middle (reference {FORCES[drop]}, hybrid {found:.6f}), softest motion "
          f"{square:+.1f} /s2, {pair.energy(beside)[2]:.6f} N where it stays")  # fmt: skip
    assert force == pytest.approx(FORCES[drop], rel=0.005)
    assert found == pytest.approx(force, rel=0.005)
    assert (square > 0.0) == (drop == 0.05)
