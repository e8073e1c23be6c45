"""What cells miss of the bending of a rod beside its ends, where it fades within less than a few of them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import solve_banded

import hybrid
from hybrid.outputs.edge_errors import layer_missed, shown_at_clamp
from tests.scenes import cable_scene, pinned_at


@pytest.mark.parametrize("fade", [0.01, 0.3, 3.0, 100.0])
@pytest.mark.parametrize("turns", [0.0, 0.5, 3.0])
def test_a_moment_that_fades_is_found_exactly(fade: float, turns: float) -> None:
    s, at = np.array([0.0, 1.0, 2.3]), np.linspace(0.0, 2.3, 47)
    line, part = np.array([[0.2, -0.1, 0.0], [0.03, 0.0, 0.1]]), np.array([2.0, -1.0, 0.5])

    def moment(x: np.ndarray, size: float = 1.0) -> np.ndarray:
        return line[0] + line[1] * x[:, None] + size * part * np.exp(-x[:, None] / fade)

    straight = np.stack([np.interp(at, s, x) for x in moment(s).T], axis=1)
    exact = moment(at, 1.0 / shown_at_clamp(1.0 / fade, turns) if turns else 1.0)
    off = np.linalg.norm(exact - straight, axis=1)
    np.testing.assert_allclose(layer_missed(s, moment(s), fade, at, turns), off, atol=1e-7 * off.max())


@pytest.mark.parametrize("x", [0.001, 0.03, 0.3, 1.0, 4.0, 30.0])
@pytest.mark.parametrize("turns", [0.5, 4.0])
def test_what_cells_show_of_the_moment_at_a_clamp(x: float, turns: float) -> None:
    """Beside the balance of moments of many cells, of length x fades; all of it on short ones."""
    count = max(8, int(30.0 / x)) if x > 0.01 else 4000
    diagonal = np.full(count, -2.0 - x * x)
    diagonal[0] += 1.0 - 1.0 / turns
    right = np.zeros(count)
    right[0] = -1.0 / turns
    banded = np.array([np.ones(count), diagonal, np.ones(count)])
    if x <= 0.01:  # the last of these cells goes on as exp(-s/fade)
        banded[1, -1] += 1.0 + 0.5 * x * x - x * np.sqrt(1.0 + 0.25 * x * x)
    phi = solve_banded((1, 1), banded, right)
    shown = (1.0 - phi[0]) / (turns * x) * (1.0 + (turns - 0.5) * x)
    assert shown_at_clamp(x, turns) == pytest.approx(shown, rel=1e-6)
    assert shown_at_clamp(x, turns) == pytest.approx(1.0, abs=0.25 * x)


def line(start: dict, EI: float, points: int = 201) -> dict:
    return cable_scene(
        {"length": 64.0, "mass": 1.0, "bending_stiffness": EI}, {"position": [0, 0, 0], **start},
        pinned_at(57.0, 0, 5.0), output={"points": points}
    )  # fmt: skip


def effectivity(result: hybrid.Result, truth: hybrid.Result, name: str) -> float:
    return float(np.max(result.errors[f"total/{name}"]) / np.abs(result[name] - truth[name]).max())


CLAMPED = {"kind": "clamped", "tangent": [0.5, 0, 0.8]}
SOFT = CLAMPED | {"bend_stiffness": 30.0}


@pytest.mark.parametrize(
    "start, EI", [({"kind": "pinned"}, 50.0), (CLAMPED, 1.0), (CLAMPED, 50.0), (CLAMPED, 1e3), (SOFT, 50.0)]
)
def test_curvature_of_an_equilibrium_beside_its_ends(start: dict, EI: float) -> None:
    """80 equal cells, of a tenth to six times sqrt(EI/T): figures were 0.01 to 0.5 of the error."""
    scene = line(start, EI)
    truth = hybrid.static(scene | {"model": "rod", "accuracy": {"curvature": "0.05%"}})
    fixed = {"model": "rod", "mesh": {"cells": 80}, "output": scene["output"] | {"errors": True}}
    result = hybrid.static(scene | fixed)
    for name in ("curvature", "bending_moment"):
        assert 0.7 <= effectivity(result, truth, name) <= 3.0
        assert name not in result.attributes.get("errors_not_converged", "")


def test_curvature_beside_a_load() -> None:
    scene = line({"kind": "pinned"}, 5.0)
    scene["cable"] |= {"attachments": [{"kind": "clump", "at": 20.0, "mass": 20.0, "volume": 0.0}]}
    truth = hybrid.static(scene | {"model": "rod", "accuracy": {"curvature": "0.05%"}})
    fixed = {"model": "rod", "mesh": {"cells": 80}, "output": scene["output"] | {"errors": True}}
    assert 0.7 <= effectivity(hybrid.static(scene | fixed), truth, "curvature") <= 3.0
