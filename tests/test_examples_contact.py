"""Examples in which lines touch: each runs as it stands, and what its header says is true."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import hybrid

EXAMPLES = Path(__file__).parents[1] / "examples" / "contact"
Floats = NDArray[np.float64]


@cache
def ran(name: str, *changes: str) -> hybrid.Result:
    """The result of an example, complete."""
    file = EXAMPLES / f"{name}.yaml"
    result = hybrid.run(hybrid.load_scene(file, list(changes)) if changes else file)
    assert result.status == "complete"
    return result


def least_distance(a: Floats, b: Floats) -> float:
    """Between the nodes a (n, 3) and b (m, 3), m."""
    return float(np.linalg.norm(a[:, None] - b[None], axis=2).min())


def writhe(x: Floats) -> float:
    """Of a polyline x (n, 3), by the solid angles of its chords (K. Klenin and J. Langowski, 2000)."""
    total = 0.0
    for i in range(len(x) - 3):
        a, b = x[i], x[i + 1]
        c, d = x[i + 2 : -1], x[i + 3 :]
        r = [c - a, d - a, d - b, c - b]
        n = [np.cross(r[k], r[(k + 1) % 4]) for k in range(4)]
        n = [y / np.maximum(np.linalg.norm(y, axis=1), 1e-300)[:, None] for y in n]
        angle = sum(np.arcsin(np.clip(np.sum(n[k] * n[(k + 1) % 4], axis=1), -1.0, 1.0)) for k in range(4))
        sign = np.sign(np.sum(np.cross(d - c, b - a) * r[0], axis=1))
        total += float(np.sum(angle * sign)) / (2.0 * np.pi)
    return total


@pytest.mark.long
def test_a_rope_slips_over_a_sheave_as_the_capstan_equation_says() -> None:
    result = ran("rope_over_sheave")
    late = (result.times > 0.7) & (result.times < 1.5)
    falls = -2.0 * np.polyfit(result.times[late], result.position[late, -1, 2], 2)[0]
    grip, light, heavy = np.exp(0.1 * np.pi), 50.0 + 0.05 * 4.0, 80.0 + 0.05 * 3.0  # its rope goes with each weight
    law = 9.80665 * (heavy - grip * light) / (heavy + grip * light)
    assert law == pytest.approx(0.752, abs=1e-3)
    assert falls == pytest.approx(law, rel=5e-3)
    assert result.tension[-1, 10] == pytest.approx(result.tension[-1, 60], rel=1e-2)  # flat on the light side
    held = ran("rope_over_sheave", "obstacles.sheave.friction=0.2")
    assert np.abs(held.position[late, -1, 2] - held.position[late, -1, 2].mean()).max() < 0.02


@pytest.mark.long
def test_a_rope_is_drawn_over_a_fairlead_of_triangles() -> None:
    result = ran("rope_over_fairlead")
    late = int(np.argmin(np.abs(result.times - 1.5)))
    before, behind = result.tension[late, -1], result.tension[late, 0]
    assert before == pytest.approx(490.0, rel=1e-3)
    assert behind / before == pytest.approx(np.exp(0.15 * np.pi), rel=0.01)
    assert {x.kind for x in result.events} == {"unresolved bend"}
    out = np.hypot(result.position[late, :, 0], result.position[late, :, 2])
    assert out.min() > 0.4 * np.cos(np.pi / 36) + 0.9 * 0.01  # on the faces of the barrel
    assert len(result["obstacles/fairlead/triangles"]) == 432


@pytest.mark.long
def test_tethers_wind_up_without_passing_through_each_other_and_come_apart() -> None:
    result = ran("tethers_tangle")
    assert [e.kind for e in result.events].count("lines touch") == 1
    a, b = (result.lines[x]["position"] for x in "ab")
    distances = [least_distance(x, y) for x, y in zip(a, b, strict=True)]
    assert min(distances) > 0.9 * 0.03
    np.testing.assert_allclose(b[0] - a[0], np.broadcast_to([1.2, 0.0, 0.0], a[0].shape), atol=1e-6)  # side by side
    middle = np.argmin(np.abs(result.times - 29.0))
    assert distances[middle] < 2.0 * 0.03
    assert distances[-1] > 2.0 * 0.03


@pytest.mark.long
def test_an_umbilical_clashes_with_a_mooring_line() -> None:
    result = ran("umbilical_clash")
    kinds = [e.kind for e in result.events]
    assert "lines touch" in kinds and "contact force above limit" in kinds
    assert result["gap"].min() < 0.05 and result["gap"].max() > 1.0


@pytest.mark.long
def test_a_cable_comes_down_on_a_pipeline_and_lies_there() -> None:
    result = ran("cable_over_pipeline")
    x = result.position
    axis = np.hypot(x[:, :, 1], x[:, :, 2] - 0.3)
    assert axis.min() > 0.3 + 0.9 * 0.02
    late = result.times > 11.0
    assert np.linalg.norm(x[late] - x[-1], axis=2).max() < 0.02
    falls = (x[40, 0, 2] - x[60, 0, 2]) / (result.times[60] - result.times[40])
    weight = (3.0 - 1025.0 * np.pi * 0.02**2) * 9.80665
    assert falls == pytest.approx(np.sqrt(2.0 * weight / (1025.0 * 0.04 * 1.2)), rel=0.05)
    assert (x[-1, :, 2] > 0.05).sum() > 20  # free spans on both sides of the pipe


@pytest.mark.slow
def test_a_trefoil_that_is_pulled_tight_stays_a_knot() -> None:
    result = ran("trefoil")
    assert writhe(result.position[0][::2]) == pytest.approx(-3.1, abs=0.3)
    assert writhe(result.position[-1][::2]) < -2.0
    loop = np.argmax(
        np.linalg.norm(result.curvature[-1], axis=-1) if result.curvature.ndim == 3 else result.curvature[-1]
    )
    assert result.tension[-1, loop] < 0.3 * result.tension[-1, 0]
    assert result.tension[-1, 0] == pytest.approx(1.0, rel=0.02)
