"""Error figures of several lines: held against runs that are four times as fine."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.store.limits import extreme_errors
from tests.scenes import line_between, network_scene

LEG = {"length": 140, "mass": 3.0, "diameter": 0.04, "axial_stiffness": 2e6, "drag": {"normal": 1.2}}
HOSE = {"length": 100, "mass": 6, "diameter": 0.08, "axial_stiffness": 5e6, "bending_stiffness": 3000}


def mooring(cells: int = 20, step: float = 0.1, **output: Any) -> dict[str, Any]:
    """Two legs to a float and a hose from there to a vessel that heaves; the hose has a clump on it."""
    heave = {"heave": {"amplitude": 0.5, "period": 8}, "ramp": 8}
    clump = [{"kind": "clump", "at": 37.0, "mass": 20.0}]
    return network_scene(
        {"west": {"position": [-110, 0, -100]}, "east": {"position": [110, 10, -100]},
         "float": {"kind": "free", "initial_guess": [0, 0, -20], "mass": 900, "volume": 2, "drag_area": 3},
         "vessel": {"position": [70, 0, 2], "motion": heave}},
        {"west": line_between("west", "float", LEG, mesh=cells), "east": line_between("float", "east", LEG, mesh=cells),
         "hose": line_between("float", "vessel", HOSE, mesh=2 * cells, attachments=clump)},
        fluid={"density": 1025, "current": [0.4, 0.1, 0]}, time=(8.0, step),
        output={"every": 0.4, "points": 11} | output
    )  # fmt: skip


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> hybrid.Result:
    path = tmp_path_factory.mktemp("errors") / "run.h5"
    hybrid.run(mooring(errors=True), path).close()
    return hybrid.open(path)


def test_figures_are_near_the_truth(result: hybrid.Result) -> None:
    truth = hybrid.run(mooring(80, 0.025))
    for name, line in result.lines.items():
        fine = truth.lines[name]
        assert np.allclose(line.times, fine.times)
        wrong = np.linalg.norm(line.position - fine.position, axis=2).max()
        assert 0.5 < line["errors/total/position"].max() / wrong < 6.0, name
        for end in ("start", "end"):
            off = np.linalg.norm(line[f"reaction_{end}"] - fine[f"reaction_{end}"], axis=1).max()
            assert 0.5 < line[f"errors/total/end_force_{end}"].max() / off < 6.0, (name, end)
        assert line.attributes["error_total_position"] == line["errors/total/position"].max()
    largest = max(x.attributes["error_total_end_force"] for x in result.lines.values())
    assert result.attributes["error_total_end_force"] == largest
    assert result.lines["hose"].dims("errors/mesh/bending_moment") == ("t", "s")


@pytest.mark.parametrize("more", [{}, {"accuracy": {"tension": "10%"}}])
def test_quantities_of_lines_have_errors_of_all_steps(more: dict[str, Any]) -> None:
    """By fixed steps and cells, and by an accuracy: the pull on an anchor is within what it is far below."""
    asked = {"kind": "vertical_force", "line": "west", "end": "start", "largest": 1e6}
    scene = mooring(10, errors=True, quantities={"lift": asked}) | more
    scene["time"] = {"duration": 2.0, "step": 0.1}
    scene["lines"]["hose"] = {"start": "float", "end": "vessel", "sections": [LEG], "mesh": {"cells": 20}}
    truth = copy.deepcopy(scene) | {"accuracy": None, "time": {"duration": 2.0, "step": 0.025}}
    for line in truth["lines"].values():
        line["mesh"] = {"cells": 60}
    result, fine = hybrid.run(scene), hybrid.run(truth)
    (lift,) = result.verdicts().quantities
    assert (lift.verdict, lift.why) == ("within", "")
    off = abs(result["extremes/lift"][1] - fine["extremes/lift"][1])
    assert off < extreme_errors(result)["lift largest"] < 0.1 * lift.value


@pytest.mark.parametrize(
    ("cells", "time", "kind", "said"),
    [
        (2, {"duration": 0.4, "step": 0.1}, "no error figure", "2 cells are so few that there is nothing coarser"),
        (8, {"duration": 0.1, "step": 0.1}, "error uncertain", "the share of the time step is not known"),
    ],
)
def test_nothing_coarser_to_compare_with(cells: int, time: dict[str, float], kind: str, said: str) -> None:
    """The result stays, and an event says why it has no figure, or one that leaves something out, and what to do."""
    scene = mooring(cells, errors=True, every=0.1)
    result = hybrid.run(scene | {"time": time})
    event = next(x for x in result.lines["west"].events if x.kind == kind)
    assert said in event.text and ("mesh:" in event.text or "time.step" in event.text)
    assert ("error_total_position" in result.lines["west"].attributes) is (kind == "error uncertain")
    assert result.status == "complete"
