"""The error figure of curvature beside joints, against rods on the same cells and on half as long ones.

    pytest bench/test_bench_joints.py -m bench -n 0 -s

Of the touchdown line in space with zones that are fixed or move, 40 s from rest: at every output and joint the largest
error within 3 m (8 sqrt(EI/T)), over what is stated there.  Beside rods on the same cells that is what leaving bending
out does, with what results put back (`errors/model`); beside rods on cells of half the length also what cells do, of
which the same is printed for rods at the same places.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from test_bench_zones import MESHES, SHARE, run, touchdown

import hybrid

pytestmark = pytest.mark.bench
NEAR, TOLD = 3.0, 1.5  # m; times the stated error
LARGE = 0.003  # of the largest curvature, of what counts: below, errors are of second order
EDGES: dict[str, tuple[float, float]] = {
    "75 to 110 m": (75.0, 110.0),
    "85 to 110 m": (85.0, 110.0),
    "90 to 103 m": (90.0, 103.0),
}
MOVING: dict[str, tuple[dict[str, Any], float | None]] = {
    "zones that move, 5 mm": ({"kind": "adaptive", "tolerance": 2e-5}, None),
    "zones that move, 3 % of curvature": ({"kind": "adaptive"}, SHARE),
}  # fmt: skip


def nodes_of(mesh: str) -> np.ndarray:
    return np.array(MESHES[mesh].get("nodes") or np.linspace(0.0, 250.0, MESHES[mesh].get("cells", 0) + 1))


def fixed(nodes: np.ndarray, low: float, high: float) -> dict[str, Any]:
    """A rod between the nodes nearest to these, catenaries beside it."""
    a, b = (float(nodes[np.abs(nodes - x).argmin()]) for x in (low, high))
    return {"kind": "zones", "zones": [{"catenary": a}, {"rod": b - a}, {"catenary": 250.0 - b}]}


def joints(result: hybrid.Result, output: int) -> np.ndarray:
    mesh = result.mesh[output]
    return np.asarray(mesh.s)[1:-1][mesh.kinds[1:] != mesh.kinds[:-1]]


def at_places(result: hybrid.Result, values: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Of all points of a result those at s, which are among them."""
    return values[:, [int(np.abs(result.s - x).argmin()) for x in s]]


def beside(result: hybrid.Result, true: np.ndarray, stated: np.ndarray) -> np.ndarray:
    """(n, 2) largest true and stated errors within NEAR of a joint, at all outputs but the first."""
    found = []
    for output in range(1, len(result.times)):
        for joint in joints(result, output):
            near = np.abs(result.s - joint) < NEAR
            found.append((true[output, near].max(), stated[output, near].max()))
    return np.array(found)


def said(found: np.ndarray) -> str:
    large = found[:, 0] > LARGE
    if not large.any():
        return f"none of {len(found)} above {LARGE:.1%}"
    ratio = found[large, 0] / found[large, 1]
    return f"{large.sum():3d} of {len(found)} up to {found[:, 0].max():.2%}: median {np.median(ratio):.2f}, at most {ratio.max():.2f}"


@pytest.mark.parametrize("mesh", ["graded, 120 cells", "100 equal cells"])
def test_error_figure_beside_joints(mesh: str) -> None:
    """What joints do, and of rods what cells do, is at most TOLD times the error that is stated there, if it counts."""
    text, nodes = touchdown(True), nodes_of(mesh)
    text["time"]["duration"] = 40.0
    known = text | {"output": text["output"] | {"errors": True}}
    rods = run(known, MESHES[mesh], {"kind": "rod"})
    halves = np.sort(np.concatenate([nodes, 0.5 * (nodes[1:] + nodes[:-1])]))
    half = run(text, {"nodes": halves.tolist()}, {"kind": "rod"})
    largest = float(half.curvature.max())
    models = {name: (fixed(nodes, *x), None) for name, x in EDGES.items()} | MOVING
    print(f"\ntouchdown in space, {mesh}: errors of curvature beside joints over what is stated, at all outputs")
    for name, (model, share) in models.items():
        found = run(known, MESHES[mesh], model, share)
        part, total = (found[f"errors/{x}/curvature"][:] / largest for x in ("model", "total"))
        on_same, on_half = (at_places(x, x.curvature, found.s) for x in (rods, half))
        missed = np.abs(found.curvature - on_same) / largest
        stated = at_places(rods, rods["errors/total/curvature"][:], found.s) / largest
        of_joints = beside(found, missed, total)
        print(f"  {name}")
        print(f"    of joints, over their part of the figure: {said(beside(found, missed, part))}")
        print(f"    of joints, over the figure:               {said(of_joints)}")
        print(
            f"    of all, rods on half the cells:           {said(beside(found, np.abs(found.curvature - on_half) / largest, total))}"
        )
        of_rods = beside(found, np.abs(on_same - on_half) / largest, stated)
        print(f"    the same of rods everywhere:              {said(of_rods)}")
        for each in (of_joints, of_rods):
            large = each[:, 0] > LARGE
            assert (each[large, 0] < TOLD * each[large, 1]).all(), name
