"""Curvature beside an edge of contact that moves: what is off, over what is stated there.

    pytest bench/test_bench_edges.py -m bench -n 0 -s

Rods of the touchdown line, 40 s from rest, against rods on cells a quarter as long in half the steps; at every output
the largest error within NEAR of the last point in contact, and within ANCHOR of the anchor, which is pinned on the bed.
"""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest
from test_bench_joints import nodes_of
from test_bench_zones import MESHES, run, touchdown

pytestmark = pytest.mark.bench
NEAR, ANCHOR, LARGE, TOLD = 4.0, 6.0, 0.003, 2.0  # m, m; of the largest curvature, what counts; times the stated error
BEDS = {"stiffness 5e2": (5e2, 1e2), "stiffness 5e3": (5e3, 5e2), "stiffness 1e5": (1e5, 2e3)}  # N/m2, N s/m2


@pytest.mark.parametrize("bed", BEDS)
@pytest.mark.parametrize("space", [True, False], ids=["space", "plane"])
@pytest.mark.parametrize("mesh", ["graded, 120 cells", "100 equal cells"])
def test_edges_that_move(mesh: str, space: bool, bed: str) -> None:
    """What is off is at most TOLD times what is stated, and in the median 0.9 to 1.1 of what is stated of the edge."""
    text, nodes = touchdown(space), nodes_of(mesh)
    text["time"]["duration"], text["dimension"] = 40.0, 3 if space else 2
    text["environment"]["seabed"] |= dict(zip(("stiffness", "damping"), BEDS[bed], strict=True))
    text["output"]["points"] = [*np.arange(0.0, 3.0, 0.25).tolist(), *text["output"]["points"]]
    known: dict[str, Any] = text | {"output": text["output"] | {"errors": True}}
    found = run(known, MESHES[mesh], {"kind": "rod"})
    quarters = np.append((nodes[:-1, None] + np.diff(nodes)[:, None] * np.arange(4) / 4).ravel(), nodes[-1])
    quarters = np.append(np.linspace(0.0, 20.0, 401), quarters[quarters > 20.05])  # sqrt(EI/T) is 0.37 m at the anchor
    finer = copy.deepcopy(text)
    finer["time"]["step"] /= 2
    fine = run(finer, {"nodes": quarters.tolist()}, {"kind": "rod"})
    off = np.abs(found.curvature - fine.curvature) / fine.curvature.max()
    stated, edge = (found[f"errors/{x}/curvature"][:] / fine.curvature.max() for x in ("total", "edges"))
    near = np.abs(found.s - found["touchdown"][:, 1:]) < NEAR
    most = np.array([[x[j, near[j]].max() for x in (off, stated, edge)] for j in range(1, len(off))])
    most = most[most[:, 0] > LARGE]
    figure, part = most[:, 0] / most[:, 1], most[:, 0] / most[:, 2]
    held = np.array([x[1:, found.s < ANCHOR].max(axis=1) for x in (off, stated, edge)])
    held = held[:, held[0] > LARGE]
    anchor, of_end = held[0] / held[1], held[0] / held[2]
    print(
        f"\n{'space' if space else 'plane'}, {mesh}, bed of {bed}: {len(most)} of {len(off) - 1} outputs off by up to "
        f"{most[:, 0].max():.2%}; over the figure: median {np.median(figure):.2f}, {figure.min():.2f} to "
        f"{figure.max():.2f}; over what is stated of the edge: {np.median(part):.2f}, {part.min():.2f} to {part.max():.2f}"
        f"; at the anchor {len(anchor)} by up to {held[0].max():.2%}, over the figure: {anchor.min():.2f} to "
        f"{anchor.max():.2f}; over what is stated of the end: {of_end.min():.2f} to {of_end.max():.2f}"
    )
    assert figure.max() < TOLD and 0.9 < np.median(part) < 1.1
    assert anchor.max() < TOLD and of_end.min() > 0.9 and of_end.max() < 1.1
