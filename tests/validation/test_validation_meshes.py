"""Second order on any mesh: no weights, no smoothness asked for.

The suspension of Goyal & Perkins, static, on meshes that are refined by halving every
cell; the error is the largest distance to the converged table.  Discretisation: order 2.
"""

from itertools import pairwise

import numpy as np
import pytest
from problems import SUSPENSION, suspension

import hybrid

LENGTH, JOINT = 2.0, 1.5


def uniform(n):
    return np.linspace(0.0, LENGTH, n + 1)


def from_lengths(lengths):
    """Nodes of cells in these proportions, the joint among them."""
    s = np.concatenate([[0.0], np.cumsum(lengths)])
    s *= LENGTH / s[-1]
    s[np.argmin(np.abs(s - JOINT))] = JOINT
    return s


MESHES = {
    "uniform": uniform(40),
    "alternating 1:4": from_lengths(np.tile([1.0, 4.0], 20)),
    "abrupt 1:4": from_lengths(np.repeat([1.0, 4.0, 1.0], [15, 10, 20])),
    "random": from_lengths(np.random.default_rng(7).uniform(0.3, 1.7, 44)),
    "graded 10:1": from_lengths(0.1 ** (np.arange(40) / 39)),
    "fine rod beside coarse catenary": np.concatenate([np.linspace(0, JOINT, 9)[:-1], np.linspace(JOINT, LENGTH, 33)]),
}


def halved(s):
    return np.sort(np.concatenate([s, 0.5 * (s[:-1] + s[1:])]))


@pytest.mark.parametrize("kind", ["rod", "hybrid"])
@pytest.mark.parametrize("mesh", MESHES)
def test_order_on_any_mesh(mesh, kind, report):
    table = np.array(SUSPENSION["rod" if kind == "rod" else "hybrid_joint_at_1.5"])
    scene = suspension(None if kind == "rod" else JOINT, 40)
    model = (
        {"kind": "rod"} if kind == "rod" else {"kind": "zones", "zones": [{"catenary": JOINT}, {"rod": LENGTH - JOINT}]}
    )
    data = scene.model_dump(exclude_none=True) | {"model": model, "output": {"points": table[:, 0].tolist()}}
    s, errors = MESHES[mesh], []
    for _ in range(3):
        found = hybrid.static(hybrid.validate_scene(data | {"mesh": {"nodes": s.tolist()}}))
        errors.append(np.hypot(found.position[0, :, 0] - table[:, 1], found.position[0, :, 2] - table[:, 2]).max())
        s = halved(s)
    orders = [float(np.log2(a / b)) for a, b in pairwise(errors)]
    report(
        f"Suspension, {kind}, {mesh} cells, halved twice", "reference/suspension.json",
        f"{errors[0]:.1e} {errors[1]:.1e} {errors[2]:.1e} m, order {orders[0]:.2f}, {orders[1]:.2f}", "order 2.0 +- 0.1 at last",
    )  # fmt: skip
    assert 1.5 < orders[0] < 2.5  # the coarsest mesh of some is not yet where the order shows
    assert abs(orders[1] - 2.0) <= 0.1
