"""Runs are compared at the ends and at some hundred places, however many output points there are; errors are at all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bits import Stopping, differences
from test_late_file import described
from test_result_first import asked, rough, stopped_in  # noqa: F401

import hybrid
from hybrid.model.sections import OutputPoints
from hybrid.scene.root import LINE
from hybrid.simulation import run_sample
from hybrid.simulation.case import Case
from hybrid.simulation.progress import ESTIMATION, REFINEMENT
from hybrid.simulation.run_sample import ALL, MOST_PLACES, at_all_points, compared_places

POINTS = 301


def test_which_places() -> None:
    """All, where there are hardly more; else ends and jumps, those beside them, and the others evenly."""
    s = np.linspace(0.0, 60.0, 601)
    assert compared_places(OutputPoints(s[:101], np.zeros(0))) is ALL
    places = compared_places(OutputPoints(s, s[[250]]))
    assert {0, 1, 2, 248, 249, 250, 251, 252, 598, 599, 600} <= set(places.tolist())
    assert places.size <= MOST_PLACES and np.diff(places).max() <= 7


def test_between_places_the_larger_error_counts() -> None:
    errors = at_all_points(np.array([[1.0, 3.0, 2.0]]), np.array([0, 2, 5]))
    assert errors.tolist() == [[1.0, 3.0, 3.0, 3.0, 3.0, 2.0]]


def test_errors_are_at_all_output_points(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As those of runs that are compared at all of them, but for what lies between places."""
    compared: list[int] = []
    sample = Case.sample

    def counting(self: Case, *arguments: Any, **more: Any) -> Any:
        found = sample(self, *arguments, **more)
        compared.append(np.shape(found[LINE].values["position"])[1])
        return found

    monkeypatch.setattr(Case, "sample", counting)
    scene = described(True) | {"output": {"every": 0.1, "points": POINTS, "errors": True}}
    with hybrid.run(scene, tmp_path / "some.h5") as some:
        places = compared_places(OutputPoints(np.asarray(some["s"]), np.zeros(0)))
        assert set(compared) == {places.size} and places.size <= MOST_PLACES
        monkeypatch.setattr(run_sample, "MOST_PLACES", POINTS)
        with hybrid.run(scene, tmp_path / "all.h5") as all_:
            assert compared[-1] == POINTS
            for name in ("total/position", "mesh/tension", "time/position", "total/end_force_end"):
                mine, its = np.asarray(some.errors[name]), np.asarray(all_.errors[name])
                assert mine.shape == its.shape
                if mine.ndim == 2:
                    np.testing.assert_array_equal(mine[:, places], its[:, places])
                assert mine.max() == pytest.approx(its.max(), rel=0.02)
            assert some.names == all_.names


@pytest.mark.parametrize(
    ("more", "section", "everywhere"),
    [
        ({"accuracy": {"tension": "1%"}}, {}, False),
        ({"accuracy": {"tension": "1%"}}, {"min_bend_radius": 0.1}, True),
        ({"accuracy": {"curvature": "5%"}}, {}, True),
        ({"accuracy": "1%", "model": "rod"}, {}, True),
        ({"output": {"points": POINTS, "errors": True}}, {}, True),
        ({"output": {"points": POINTS, "errors": True}, "model": "catenary"}, {}, False),
    ],
)
def test_where_bends_are_judged_it_is_everywhere(
    more: dict[str, Any], section: dict[str, Any], everywhere: bool
) -> None:
    """A bend of a long line lies between a hundred places."""
    scene = described() | {"model": "adaptive", "output": {"points": POINTS}} | more
    scene["cable"] = {"sections": [scene["cable"]["sections"][0] | {"bending_stiffness": 1e-3} | section]}
    assert (Case(hybrid.validate_scene(scene), None).places[LINE].size == 0) == everywhere


@pytest.mark.long
@pytest.mark.parametrize("name", [ESTIMATION, REFINEMENT])
@pytest.mark.usefixtures("rough")
def test_it_is_resumed_at_the_same_places(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Stopping(monkeypatch)
    scene = asked() | {"output": {"every": 0.1, "points": POINTS}}
    hybrid.run(scene, tmp_path / "whole.h5").close()
    stopped_in(name, scene, tmp_path / "run.h5")
    hybrid.resume(tmp_path / "run.h5").close()
    assert differences(tmp_path / "whole.h5", tmp_path / "run.h5") == []


@pytest.mark.long
@pytest.mark.usefixtures("rough")
def test_a_result_of_before_goes_on_at_all_points(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its checkpoint has errors at all of them."""
    Stopping(monkeypatch)
    scene = asked() | {"output": {"every": 0.1, "points": POINTS}}
    with monkeypatch.context() as before:
        before.setattr(run_sample, "MOST_PLACES", POINTS)
        hybrid.run(scene, tmp_path / "whole.h5").close()
        stopped_in(REFINEMENT, scene, tmp_path / "run.h5")
    hybrid.resume(tmp_path / "run.h5").close()
    assert differences(tmp_path / "whole.h5", tmp_path / "run.h5") == []
