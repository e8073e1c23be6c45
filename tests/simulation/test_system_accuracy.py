"""Accuracy of several lines: what is asked is met or said to be missed, by line and quantity."""

from __future__ import annotations

import copy
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.errors import ComputationError
from hybrid.model.network import NetworkResolution
from hybrid.scene.analysis import RodModel
from hybrid.simulation.case import Case
from hybrid.simulation.run_sample import COMPARED, END_FORCES, RIGHT
from hybrid.store.limits import extreme_errors
from tests.scenes import each_line, line_between, network_scene

LEG = {"length": 70, "mass": 3.0, "diameter": 0.04, "axial_stiffness": 2e6, "drag": {"normal": 1.2}}


def bridle(**tables: Any) -> dict[str, Any]:
    """Two legs to a float that a third line draws aside, up and down."""
    surge = {"surge": {"amplitude": 0.6, "period": 4}, "ramp": 4}
    return {
        "environment": {"fluid": {"density": 1025, "current": [0.4, 0.1, 0]}},
        "points": {
            "west": {"position": [-55, 0, -50]}, "east": {"position": [55, 5, -50]},
            "float": {"initial_guess": [0, 0, -10], "mass": 300, "volume": 1.2, "drag_area": 2},
            "winch": {"position": [35, 0, 1], "motion": surge},
        },
        "lines": {
            "west": {"start": "west", "end": "float", "sections": [LEG]},
            "east": {"start": "float", "end": "east", "sections": [LEG]},
            "tow": {"start": "float", "end": "winch", "sections": [LEG | {"length": 45, "bending_stiffness": 300}]},
        },
        "time": {"duration": 4.0}, "accuracy": {"position": "1%", "tension": "1.5%"},
        # within steps the tension of `east`, wrong by 0.01 %, would change 2.2 times as much by finer runs as by coarser
        "output": {"every": 0.5, "points": 11, "exact": True},
    } | tables  # fmt: skip


def verdicts(line: hybrid.Result) -> dict[str, dict[str, Any]]:
    met = {"met": True, "missed": False, "not verified": None}
    return {x.quantity: x._asdict() | {"met": met[x.verdict]} for x in line.verdicts().accuracy}


@pytest.mark.long  # 1.0 s
def test_what_is_asked_is_judged_by_line_and_quantity() -> None:
    """Of zones that move in the line that bends, whose share is given: no accuracy makes all of it rod."""
    scene = bridle()
    scene["lines"]["tow"]["model"] = {"kind": "adaptive", "tolerance": 1e-3}
    rods = each_line(bridle(time={"duration": 4.0, "step": 0.0125}, accuracy=None), mesh=150)  # all that bends is rod
    result, fine = hybrid.run(scene), hybrid.run(rods)
    tow = result.lines["tow"]
    assert {zone.kind for zones in tow.zones for zone in zones} == {"rod", "catenary"}
    for quantity in ("position", "curvature", "bending_moment"):
        wrong = tow[quantity] - fine.lines["tow"][quantity]
        wrong = float(np.abs(wrong).max() if wrong.ndim == 2 else np.linalg.norm(wrong, axis=2).max())
        figure, left_out = (float(tow[f"errors/{x}/{quantity}"].max()) for x in ("total", "model"))
        assert 0.7 < figure / wrong < 3.0, (quantity, figure, wrong)
        if quantity != "curvature":  # results have what bending takes at pins and joints: cells do most of what is left
            assert 0.5 * wrong < left_out, (quantity, left_out, wrong)
    for name, line in result.lines.items():
        wrong = np.linalg.norm(line.position - fine.lines[name].position, axis=2).max()
        figure = line["errors/total/position"].max()
        assert line.attributes["error_total_position"] == figure and 0.5 < figure / wrong < 6.0, (name, figure / wrong)
        found, length = verdicts(line), float(line.attributes["length"])
        assert list(found) == ["position", "end_force_start", "end_force_end"]
        assert found["position"]["asked"] == pytest.approx(0.01 * length) and found["position"]["met"] is True
        forces = max(np.linalg.norm(line[f"reaction_{end}"], axis=1).max() for end in ("start", "end"))
        for end in ("start", "end"):
            one = found[f"end_force_{end}"]
            assert one["asked"] == pytest.approx(0.015 * forces)
            assert one["error"] == line[f"errors/total/end_force_{end}"].max()
            assert one["met"] is (one["error"] <= one["asked"])
    largest = max(line.attributes["error_total_end_force"] for line in result.lines.values())
    assert result.attributes["error_total_end_force"] == largest
    assert len({int(line.attributes["cells"]) for line in result.lines.values()}) > 1  # each has a mesh of its own
    steps = np.diff(result.lines["tow"]["steps/t"])
    assert steps.max() > 2.0 * steps.min()  # and they follow the motion


def fails(*_: Any, **__: Any) -> None:
    raise ComputationError(hybrid.errors.Outcome.SLACK, 1.0, 0.0)


@cache
def fine_rods() -> hybrid.Result:
    fine = bridle(time={"duration": 4.0, "step": 0.01}, accuracy=None, output={"every": 0.2, "points": 31})
    for line in fine["lines"].values():
        section = line["sections"][0] | {"bending_stiffness": 300}
        line |= {"model": "rod", "mesh": {"cells": 150}, "sections": [section]}
    return hybrid.run(fine)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("bends", "asked"),
    [
        ({"model": {"kind": "adaptive", "tolerance": 1e-3}}, {"accuracy": {"position": "1%", "tension": "1%"}}),
        ({"model": "catenary"}, {"accuracy": {"position": "2%", "tension": "2%"}}),
        ({"model": {"kind": "adaptive", "tolerance": 2e-3}}, {"time": {"duration": 4.0, "step": 0.025}}),
    ],
)
def test_errors_of_leaving_bending_out_against_fine_rods(bends: dict[str, Any], asked: dict[str, Any]) -> None:
    scene = bridle(**asked)
    # at outputs within steps the figure of the tension of `tow` is 3.2 times its error
    scene["output"] = {"every": 0.2, "points": 31, "errors": True, "exact": True}
    if "accuracy" not in asked:
        del scene["accuracy"]
    for line in scene["lines"].values():
        line |= bends | {"sections": [line["sections"][0] | {"bending_stiffness": 300}]}
    found = hybrid.run(scene)
    rods = fine_rods()
    for name, line in found.lines.items():
        assert "model error not estimated" not in {e.kind for e in line.events}
        for quantity in (x for x in COMPARED if x in line and x not in RIGHT):
            called = END_FORCES.get(quantity, quantity)
            wrong = line[quantity] - rods.lines[name][quantity]
            vector = quantity == "position" or quantity.startswith("reaction")
            size = float((np.linalg.norm(wrong, axis=-1) if vector else np.abs(wrong)).max())
            figure = float(line[f"errors/total/{called}"].max())
            assert figure / size > 0.7, (name, quantity, figure, size)
            # beside pins, whose layers results have, the rods to compare with are further off than they
            assert figure / size < 3.0 or quantity == "curvature", (name, quantity, figure, size)


@pytest.mark.long
def test_what_nobody_estimated_is_never_met(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = bridle(accuracy=None, time={"duration": 0.5, "step": 0.05})
    scene["lines"]["tow"] |= {"model": "catenary", "accuracy": "2%"}
    sample = Case.sample

    def without_rods(self: Case, *x: Any, **more: Any) -> Any:
        if isinstance(self.scene.lines["tow"].model, RodModel):
            fails()
        return sample(self, *x, **more)

    with monkeypatch.context() as patched:
        patched.setattr(Case, "sample", without_rods)
        found = hybrid.run(scene)
    tow = verdicts(found.lines["tow"])
    assert tow["position"]["met"] is None and tow["position"]["error"] < tow["position"]["asked"]
    assert [e.kind for e in found.lines["tow"].events].count("model error not estimated") == 1
    assert "accuracy_verdicts" not in found.lines["west"].attributes

    monkeypatch.setattr(Case, "sample", fails)
    found = hybrid.run(scene)
    assert all(x["met"] is None and x["error"] is None for x in verdicts(found.lines["tow"]).values())
    assert {"no error figure"} <= {e.kind for e in found.events}


@pytest.mark.long
@pytest.mark.parametrize(("part", "times"), [(1.0, 2.0), (1.5, 4.0)])
def test_cells_that_find_no_equilibrium_are_halved(
    part: float, times: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those of the first run to compare with, and those of the result, as of one cable."""
    scene, computed = bridle(accuracy="10%"), Case._network_run
    del scene["time"]
    with hybrid.static(scene) as plain:
        fineness = float(plain.lines["tow"].attributes["effort_fineness"])

    def finds_rest(self: Case, resolution: NetworkResolution, *more: Any) -> Any:
        if resolution.one.fineness < part * fineness:
            raise ComputationError(hybrid.errors.Outcome.UNSTABLE, None, 0.0)
        return computed(self, resolution, *more)

    monkeypatch.setattr(Case, "_network_run", finds_rest)
    with hybrid.static(scene, tmp_path / "rest.h5") as found:
        assert all(x["met"] for line in found.lines.values() for x in verdicts(line).values())
        assert found.lines["tow"].attributes["effort_fineness"] == times * fineness
        assert "no error figure" not in {e.kind for e in found.events}
    assert [x.name for x in tmp_path.iterdir()] == ["rest.h5"]


def test_what_a_line_does_not_have_is_refused_with_its_name() -> None:
    scene = bridle(accuracy={"bending_moment": "5%"})
    with pytest.raises(hybrid.SceneError, match="in line west"):
        hybrid.run(scene)
    scene = bridle()
    scene["lines"]["west"]["accuracy"] = {"bending_moment": "5%"}
    with pytest.raises(hybrid.SceneError, match=r"lines\.west\.accuracy"):
        hybrid.run(scene)


# --- Error figures of several lines: held against runs that are four times as fine ---

LEG_ESTIMATED = {"length": 140, "mass": 3.0, "diameter": 0.04, "axial_stiffness": 2e6, "drag": {"normal": 1.2}}
HOSE = {"length": 100, "mass": 6, "diameter": 0.08, "axial_stiffness": 5e6, "bending_stiffness": 3000}


def mooring(cells: int = 20, step: float = 0.1, **output: Any) -> dict[str, Any]:
    """Two legs to a float and a hose from there to a vessel that heaves; the hose has a clump on it."""
    heave = {"heave": {"amplitude": 0.5, "period": 8}, "ramp": 8}
    clump = [{"kind": "clump", "at": 37.0, "mass": 20.0}]
    return network_scene(
        {"west": {"position": [-110, 0, -100]}, "east": {"position": [110, 10, -100]},
         "float": {"kind": "free", "initial_guess": [0, 0, -20], "mass": 900, "volume": 2, "drag_area": 3},
         "vessel": {"position": [70, 0, 2], "motion": heave}},
        {"west": line_between("west", "float", LEG_ESTIMATED, mesh=cells), "east": line_between("float", "east", LEG_ESTIMATED, mesh=cells),
         "hose": line_between("float", "vessel", HOSE, mesh=2 * cells, attachments=clump)},
        fluid={"density": 1025, "current": [0.4, 0.1, 0]}, time=(8.0, step),
        output={"every": 0.4, "points": 11} | output
    )  # fmt: skip


@pytest.mark.parametrize("more", [{}, {"accuracy": {"tension": "10%"}}])
def test_quantities_of_lines_have_errors_of_all_steps(more: dict[str, Any]) -> None:
    """By fixed steps and cells, and by an accuracy: the pull on an anchor is within what it is far below."""
    asked = {"kind": "vertical_force", "line": "west", "end": "start", "largest": 1e6}
    scene = mooring(10, errors=True, quantities={"lift": asked}) | more
    scene["time"] = {"duration": 2.0, "step": 0.1}
    scene["lines"]["hose"] = {"start": "float", "end": "vessel", "sections": [LEG_ESTIMATED], "mesh": {"cells": 20}}
    truth = copy.deepcopy(scene) | {"accuracy": None, "time": {"duration": 2.0, "step": 0.025}}
    result, fine = hybrid.run(scene), hybrid.run(each_line(truth, mesh=60))
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
