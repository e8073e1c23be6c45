"""`hybrid` as a solver of cosseratbench: what its metrics say of ours, in its own resolution."""

from __future__ import annotations

from importlib.metadata import entry_points

import extras
import numpy as np
import pytest

pytestmark = extras.of_file("cosseratbench")

from cosseratbench import registry
from cosseratbench.experiment import COMPLETED, UNSUPPORTED, Result, run

from hybrid.couple.cosserat_bench import HybridSolver


def solved(name: str, **values: float) -> Result:
    result = run(registry.load_experiment(name), HybridSolver(), values=values)
    assert result.outcome == COMPLETED, result.failure
    return result


def test_it_is_found_by_its_entry_point() -> None:
    (found,) = entry_points(group=registry.SOLVERS, name="hybrid")
    assert found.load() is HybridSolver


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "bounds"),
    [
        ("cantilever", {"tip_deflection_error": 1e-3}),
        ("catenary", {"shape_error": 6e-4, "settling_residual": 1e-6}),  # 4.8e-4 is the bending of the cord
        ("pendulum", {"period_error": 2e-4, "amplitude_change": 2e-5}),
        ("crossing", {"shape_error": 2e-3, "lift_error": 3e-3, "max_rod_overlap": 0.0}),
    ],
)
def test_errors_against_its_references(name: str, bounds: dict[str, float]) -> None:
    result = solved(name)
    for key, bound in bounds.items():
        assert abs((result.metrics | result.observations)[key]) <= bound, key


@pytest.mark.long
def test_a_rope_holds_below_its_overhang_and_slides_beyond_it() -> None:
    """Friction sticks: it does not creep; and it gives way where the capstan equation with weight says so."""
    assert solved("capstan", overhang=0.95).metrics["slide"] < 1e-3
    assert solved("capstan", overhang=1.1).metrics["slide"] > 0.02


@pytest.mark.long
def test_directors_stay_across_the_chords_and_follow_the_twist() -> None:
    trajectory = solved("crossing").trajectory
    assert trajectory is not None
    for x, directors in zip(trajectory.positions, trajectory.directors, strict=True):
        chords = np.diff(x, axis=1)
        chords /= np.linalg.norm(chords, axis=2)[..., None]
        assert np.abs(np.linalg.norm(directors, axis=2) - 1.0).max() < 1e-12
        assert np.abs(np.sum(directors * chords, axis=2)).max() < 1e-12


def test_an_end_that_slides_is_said_to_be_missing() -> None:
    result = run(registry.load_experiment("twist"), HybridSolver())
    assert result.outcome == UNSUPPORTED
    assert any("slides along" in x for x in result.missing)
