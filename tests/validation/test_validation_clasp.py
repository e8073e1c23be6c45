"""Two ropes hooked through each other and pulled apart: the equilibrium from the scene, against the balance of each bight."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid

D, RISE, HALF, STRETCH = 0.02, 0.4, 0.02, 0.01  # m, half the distance of the ends of a bight; strain if it were taut
ROPE = {"mass": 0.3, "diameter": D, "axial_stiffness": 1e4, "bending_stiffness": 0.02, "max_strain": 0.1}


def bight(across: int, up: float, gap: float) -> list[list[float]]:
    """A U in a plane through z, its ends at z = up RISE, its bottom gap below that of the other, hooked through it."""
    turn = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 13)
    bow = [(HALF * np.sin(x), -0.5 * gap + HALF * (1.0 - np.cos(x))) for x in turn]
    points = np.zeros((len(bow) + 2, 3))
    points[:, across], points[:, 2] = zip((-HALF, RISE), *bow, (HALF, RISE), strict=True)
    points[:, 2] *= up
    return [[float(x) for x in row] for row in points]


def clasp(turn: float = 0.0, **more: Any) -> dict[str, Any]:
    """Both bights, at right angles; turn: rad, of everything about x."""
    taut = 2.0 * (RISE - 0.5 * D) + np.pi * D  # around the axis of the other rope, at a distance D
    s = np.unique(np.concatenate([np.linspace(0, 0.5, 20), np.linspace(0.36, 0.5, 36), 1.0 - np.linspace(0.36, 0.5, 36),
                                  np.linspace(0.5, 1.0, 20)]).round(9))  # fmt: skip
    length = taut / (1.0 + STRETCH)
    c, d = np.cos(turn), np.sin(turn)
    R = np.array([[1, 0, 0], [0, c, -d], [0, d, c]])
    points: dict[str, Any] = {}
    lines: dict[str, Any] = {}
    for name, across, up in (("upper", 0, 1.0), ("lower", 1, -1.0)):
        shape = (np.array(bight(across, up, 1.2 * D)) @ R.T).tolist()
        points |= {f"{name}_{end}": {"position": at} for end, at in (("a", shape[0]), ("b", shape[-1]))}
        lines[name] = {
            "start": f"{name}_a", "end": f"{name}_b", "sections": [ROPE | {"length": length}], "model": "rod",
            "mesh": {"nodes": (length * s).tolist()}, "initial": {"points": shape}, "contact": {"self": False},
        }  # fmt: skip
    tables = {"environment": {"gravity": 0}, "points": points, "lines": lines, "contact": {}, "output": {"points": 201}}
    return tables | more


@pytest.fixture(scope="module")
def pulled() -> hybrid.Result:
    return hybrid.static(clasp())


@pytest.mark.long
def test_bights_press_on_each_other_by_the_pull_of_both_arms(pulled: hybrid.Result) -> None:
    """What their ends bear, and twice the tension but for what the arms lean: 2 T cos(lean)."""
    upper, lower = pulled.lines["upper"], pulled.lines["lower"]
    force = pulled["contacts/upper/lower/force"][0]
    on_upper = upper.reaction_start[0] + upper.reaction_end[0]
    on_lower = lower.reaction_start[0] + lower.reaction_end[0]
    np.testing.assert_allclose(on_upper, -on_lower, atol=1e-6 * on_upper[2])
    np.testing.assert_allclose(-force, on_upper, atol=2e-3 * on_upper[2])
    arm = np.argmin(np.abs(upper.s - 0.25 * upper.s[-1]))
    pull = 2.0 * float(upper.tension[0, arm])
    assert pull > 50.0
    assert -force[2] == pytest.approx(pull * abs(np.cos(upper.theta[0, arm])), rel=5e-3)
    assert -force[2] == pytest.approx(pull, rel=0.02)


def test_they_stay_hooked_a_diameter_apart(pulled: hybrid.Result) -> None:
    upper, lower = (x.position[0] for x in (pulled.lines["upper"], pulled.lines["lower"]))
    apart = np.linalg.norm(upper[:, None] - lower[None], axis=2).min()
    assert 0.88 * D < apart < 1.05 * D
    assert upper[:, 2].min() < lower[:, 2].max() - 0.85 * D


def test_both_bights_have_the_same_shape(pulled: hybrid.Result) -> None:
    """A quarter turn with a mirror leads from one to the other."""
    upper, lower = (pulled.lines[x].position[0] for x in ("upper", "lower"))
    np.testing.assert_allclose(upper[:, [1, 0, 2]] * [1, 1, -1], lower, atol=1e-5)


def test_a_scene_turned_has_that_result(pulled: hybrid.Result) -> None:
    force = hybrid.static(clasp(turn=0.7))["contacts/upper/lower/force"][0]
    np.testing.assert_allclose(
        np.linalg.norm(force), np.linalg.norm(pulled["contacts/upper/lower/force"][0]), rtol=1e-4
    )
