"""Overhand knots of n turns that are pulled, against the law of their braids: force over size, with friction.

M. K. Jawed, P. Dieleman, B. Audoly and P. M. Reis, Phys. Rev. Lett. 115 (2015) 118302, as dismech-newton's example has
it: with elliptic integrals K(m), E(m) and x = 8 (K - E)/m - 4 K,

    n^2 h/e = x^2/((x + 4 K) 8 sqrt(3) pi^2),    n^2 F h^2/B = mu x^3/(96 sqrt(3) pi^2)

e the shortening (length less distance of the ends), h the radius of the cord, B its bending stiffness, mu its friction.
It neglects what bends the braid without friction, 1/2 (h/R)^2 of a trefoil, and so is of n = 2 and more.  It is of thin
cords, (2 pi h/e)^(1/2) << 1: at 0.090 of that the pull here is 0.83 of it, at 0.064 0.855, which leads to 0.92 at 0.

    pytest bench/test_bench_braids.py -m bench -n 0 -s
"""

from __future__ import annotations

import os
import time
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

import hybrid

pytestmark = pytest.mark.bench
EI, MASS, DAMPING = 1e-3, 0.02, 1.0  # N m^2, kg/m, 1/s
BY, SPEED = 0.3, 0.04  # m, m/s, by which the end is pulled
TAIL, CELL = 0.15, float(os.environ.get("HYBRID_CELL", "2.4"))  # m; radii of the cord


def of_loop(m: float) -> tuple[float, float]:
    """n^2 h/e, and n^2 F h^2/(B mu)."""
    K, E = float(ellipk(m)), float(ellipe(m))
    x = 8.0 * (K - E) / m - 4.0 * K
    return x**2 / ((x + 4.0 * K) * 8.0 * np.sqrt(3.0) * np.pi**2), x**3 / (96.0 * np.sqrt(3.0) * np.pi**2)


def law(turns: int, friction: float, radius: float, shortening: float) -> float:
    """The pull, N, at a shortening, m; radius: m, of the cord."""
    m = brentq(lambda m: of_loop(m)[0] - turns**2 * radius / shortening, 0.6, 1.0 - 1e-9)
    return float(friction * of_loop(m)[1] * EI / (turns * radius) ** 2)


def knot(turns: int, radius: float, braid: float, loop: float) -> np.ndarray:
    """Corners (n, 3) m of a loose knot along x: two strands in a braid of 2 turns + 1 half turns, a loop, straight tails.

    radius: of the cord; braid: its length; loop: radius of its round parts, m.
    """
    x, half, apart = np.linspace(0.0, braid, 24 * turns), np.pi * (2 * turns + 1), 1.2 * radius
    angle = -0.5 * np.pi + half * x / braid
    strand = np.column_stack([x, apart * np.cos(angle), apart * np.sin(angle)])
    other = strand * [1.0, -1.0, -1.0]  # ends below, where the first one begins
    bend = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 24)[1:-1]
    right = np.column_stack([braid + loop * np.cos(bend), 0.0 * bend, apart + loop * (1.0 + np.sin(bend))])
    left = (right * [-1.0, 1.0, 1.0] + [braid, 0.0, 0.0])[::-1]
    tails = [[-TAIL, 0.0, -apart]], [[braid + TAIL, 0.0, -apart]]
    return np.vstack([tails[0], strand, right, left, other, tails[1]])


def pulled(turns: int, friction: float, radius: float, by: float, speed: float) -> dict[str, Any]:
    """A knot whose one end is pulled along x by so many m at a speed, m/s."""
    points = knot(turns, radius, 0.15 * turns, 0.11 * turns)
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    cord = {"length": length, "mass": MASS, "diameter": 2 * radius, "axial_stiffness": 2e3, "bending_stiffness": EI}
    travel = {"velocity": [speed, 0.0, 0.0], "ramp": 0.5}
    duration = by / speed
    return {
        "environment": {"gravity": 0.0}, "model": "rod", "mesh": {"cells": int(length / (CELL * radius))},
        "cable": {"sections": [cord | {"damping": {"mass": DAMPING}}]}, "contact": {"self": True, "friction": friction},
        "ends": {"start": {"kind": "pinned", "position": points[0].tolist()},
                 "end": {"kind": "pinned", "position": points[-1].tolist(), "motion": travel}},
        "initial": {"kind": "points", "points": points.tolist()},
        "time": {"duration": duration, "step": 0.005}, "output": {"every": 0.02 * duration, "points": 401},
    }  # fmt: skip


@pytest.mark.parametrize(("turns", "friction", "radius"), [(2, 0.1, 2.25e-3), (2, 0.1, 1.125e-3)])
def test_a_braid_is_pulled_tighter_by_the_force_of_the_law(turns: int, friction: float, radius: float) -> None:
    """The pull is the mean of both ends, between which damping is."""
    begin = time.process_time()
    result = hybrid.run(pulled(turns, friction, radius, BY, SPEED))
    cpu, length = time.process_time() - begin, float(result.s[-1])
    apart = np.linalg.norm(result.position[:, -1] - result.position[:, 0], axis=1)
    print(f"\n{turns} turns, friction {friction:g}, {length / radius:.0f} radii long: {cpu:.0f} s of processor time")
    print("      t, s    e, m   n^2 h/e     F, N  end less start   law, N    F/law")
    ratios = []
    for k in range(1, len(apart)):
        e = length - float(apart[k])
        ends = float(result.reaction_end[k, 0]), -float(result.reaction_start[k, 0])
        force, pull = 0.5 * sum(ends), law(turns, friction, radius, e)
        ratios.append(force / pull)
        if k % 5 == 0:
            print(f"{result.times[k]:10.2f}{e:8.3f}{turns**2 * radius / e:10.5f}{force:9.4f}{ends[0] - ends[1]:16.4f}"
                  f"{pull:9.4f}{force / pull:9.3f}")  # fmt: skip
    last = float(np.mean(ratios[-10:]))
    print(f"F/law over the last fifth of the way: {last:.3f}")
    assert 0.8 < last < 1.1
