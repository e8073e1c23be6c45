"""The suspension of Goyal & Perkins as the peers compute it: a rod released from a straight line until it is at rest.

Scene: examples/03_suspension_rod.yaml.  Truth: the boundary value problem of the rod, tests/data/suspension_full.json.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

ROOT = Path(__file__).parents[2]
SCENE = ROOT / "examples" / "03_suspension_rod.yaml"
TRUTH = ROOT / "tests" / "data" / "suspension_full.json"

LENGTH, DIAMETER, MASS = 2.0, 1.0e-3, 7.853981633974482e-4  # m, m, kg/m
BENDING_STIFFNESS = 2.454369260617026e-4  # N m^2
AREA = math.pi / 4.0 * DIAMETER**2  # m^2
WEIGHT = 7.6892050992936984e-3  # N/m, in the fluid
DAMPING = 2.0  # 1/s, proportional to mass
TANGENT, FORCE = (math.sqrt(0.75), -0.5), (0.005, 0.01 * math.sqrt(0.75))  # of the guided end; N
DURATION = 20.0  # s
CLOSE = 3.0e-4  # m, the distance to the truth that is asked for
EXUDYN = ((40, 0.02), (44, 0.05), (44, 0.02), (50, 0.05), (50, 0.02))  # elements and step, s: fewer are farther off
# PyElastica would take 10 to 50 minutes to come to rest: so many seconds of motion are run, and the time is multiplied.
PART = 0.1


def distance(s: NDArray[np.float64], x: NDArray[np.float64], z: NDArray[np.float64]) -> float:
    """The largest distance (m) of the nodes at s (n,) to the shape of the rod."""
    found = json.loads(TRUTH.read_text())["rod"]
    table = np.array([row[:3] for row in found])
    shape = CubicSpline(table[:, 0], table[:, 1:])(s)
    return float(np.hypot(x - shape[:, 0], z - shape[:, 1]).max())


def elsewhere(peer: str, *given: object) -> tuple[float, float]:
    """CPU time (s) of the peer's time loop and its distance (m) to the truth, of a process of its own.

    peer: module of this package; given: arguments of its `run`.
    """
    code = f"from peers import {peer} as peer; print(*peer.run(*{given!r}))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT / "bench", capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{peer}{given} fails: {done.stderr.strip()[-300:]}")
    cpu, off = map(float, done.stdout.split()[-2:])
    return cpu, off
