"""Equilibria of ten random networks of lines against MoorPy: quasi-static elastic catenaries on a bed without friction.

HYBRID_MOORPY names a Python that has MoorPy (`pip install moorpy` into an environment of its own):
HYBRID_MOORPY=.../bin/python pytest bench/test_bench_moorpy.py -m bench -s
"""

from __future__ import annotations

import os

import numpy as np
import pytest
from peers.random_moorings import COUNT, DEPTH, by_moorpy, random_system, scene_of, tensions_of

import hybrid

SAME = 1e-3  # of the largest tension of the network

pytestmark = pytest.mark.bench


def test_equilibria_of_random_systems_are_those_of_moorpy() -> None:
    python = os.environ.get("HYBRID_MOORPY")
    if not python:
        pytest.skip("HYBRID_MOORPY names no Python with MoorPy")
    networks = [random_system(seed) for seed in range(COUNT)]
    worst, laid = 0.0, 0.0
    print()
    for seed, (given, theirs) in enumerate(zip(networks, by_moorpy(networks, python), strict=True)):
        result = hybrid.static(scene_of(given))
        ours = tensions_of(result)
        tensions = np.array(theirs["tensions"])
        kind = given["float"]["kind"]
        place = result[f"{'points' if kind == 'point' else 'bodies'}/float/position"][-1]
        shift = float(np.linalg.norm(place - np.array(theirs["place"][:3])))
        differ = float(np.abs(ours - tensions)[:, 1].max() / tensions.max())
        anchors = float(np.abs(ours - tensions)[:, 0].max() / tensions.max())
        low = [np.mean(result.lines[f"line{k}"].position[-1][:, 2] < 1e-3 - DEPTH) for k in range(len(ours))]
        lying = sum(part * line["length"] for part, line in zip(low, given["lines"], strict=True))
        turned = 0.0
        if kind == "body":
            turned = float(np.abs(result["bodies/float/rotation"][-1] - np.degrees(theirs["place"][3:])).max())
        print(f"system {seed}: {len(ours)} lines to a {kind}: fairlead tension {differ:.1e}, anchor tension {anchors:.1e} "
              f"of the largest, {tensions.max():.4g} N; on the seabed {lying:.0f} m; place {1e3 * shift:.2f} mm, rotation {turned:.1e} deg")  # fmt: skip
        assert place[2] < 0.0  # MoorPy knows the surface
        worst = max(worst, differ, anchors)
        laid += lying
    assert worst < SAME and laid > 500.0  # m on the seabed in all
