"""What a bare `accuracy: 2%` asks: positions by what moves, tensions along the line, curvature where it matters."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.accuracy.error_order import Errors
from hybrid.accuracy.refinement import asked_text, bounds_of, judge, not_asked_text
from hybrid.cli.plan_tables import plan_rows
from hybrid.model.plan import with_model
from hybrid.model.resolution import Reach, Resolution, first_resolution, for_motion, requested_accuracy
from hybrid.scene.read import as_scene, one_line, parse_scene, scene_text
from hybrid.scene.schema import LineScene
from hybrid.simulation.run_sample import RunSample
from tests.scenes import cable_scene, network_scene, pinned_at

LENGTH, DIAMETER = 100.0, 0.04


def scene(accuracy: Any = "2%", model: str | None = None, **section: Any) -> hybrid.Scene:
    table: dict[str, Any] = cable_scene(
        {"length": LENGTH, "mass": 3.0, "diameter": DIAMETER, "bending_stiffness": 50.0, "drag": {"normal": 1.2},
         **section},
        pinned_at(0, 0, 0), pinned_at(80, 0, 0, motion={"heave": {"amplitude": 0.5, "period": 4}, "ramp": 4}),
        fluid={"density": 1025, "surface": 20}, time={"duration": 8.0}, output=(0.5, 11)
    )  # fmt: skip
    table |= {"accuracy": accuracy} if accuracy else {}
    table |= {"model": model} if model else {}
    return hybrid.validate_scene(table)


def run(moved: float, curvature: float = 0.1, tension: float = 200.0, outputs: int = 3) -> RunSample:
    """Eleven points on a circle's arc, of which one moves so far; at the middle the largest curvature and tension."""
    s = np.linspace(0.0, LENGTH, 11)
    position = np.stack([s, 0.0 * s, -4.0 * 5.0 * s * (LENGTH - s) / LENGTH**2], axis=-1)
    position = np.repeat(position[None], outputs, axis=0)
    position[-1, 3, 2] += moved
    shape = np.where(np.arange(11) == 5, 1.0, 0.5)
    values = {
        "position": position, "tension": np.tile(tension * shape, (outputs, 1)),
        "curvature": np.tile(curvature * shape, (outputs, 1)), "bending_moment": np.tile(5.0 * shape, (outputs, 1)),
        "reaction_start": np.full((outputs, 3), 100.0), "reaction_end": np.full((outputs, 3), 50.0),
    }  # fmt: skip
    return RunSample(Resolution(1.0, 0.1, 1e-3, 1e-3), values, 100, 100, 0.1)


def sizes(asking: hybrid.Scene | LineScene, found: RunSample) -> dict[str, float]:
    asked = requested_accuracy(asking if isinstance(asking, LineScene) else one_line(asking))
    assert asked is not None
    return {x.name if x.limit is None else x.limit.limit: x.size for x in bounds_of(asked, found)}


@pytest.mark.parametrize(
    ("moved", "position"),
    [(5.0, 0.1), (0.5, 0.5 * DIAMETER), (500.0, 0.02 * LENGTH), (0.4 * DIAMETER, 0.02 * 5.0)],
    ids=["a part of what moves", "half the diameter", "the part of the length", "the sag of what hardly moves"],
)
def test_position_is_a_part_of_what_moves(moved: float, position: float) -> None:
    found = sizes(scene(), run(moved))
    assert found["position"] == pytest.approx(position)
    assert found["end_force_start"] == found["end_force_end"] == pytest.approx(0.02 * 100.0 * np.sqrt(3.0))
    assert found["tension"] == pytest.approx(0.02 * 200.0)
    assert "curvature" not in found and "bending_moment" not in found


def test_position_of_an_equilibrium_is_a_part_of_its_sag() -> None:
    """A sag of 5 m below the straight line between the ends, which is level here, and upright in the second."""
    found = run(0.0, outputs=1)
    assert sizes(scene(), found)["position"] == pytest.approx(0.02 * 5.0)
    upright = RunSample(
        found.resolution, {**found.values, "position": np.asarray(found.values["position"])[..., [2, 1, 0]]}, 1, 1, 0.0
    )
    assert sizes(scene(), upright)["position"] == pytest.approx(0.02 * 5.0)


def test_the_first_result_begins_as_fine_as_the_pre_run_shows() -> None:
    """Where the line moves by a hundredth of its length; not where it lies straight, nor where a length is asked."""
    bare, first = scene(), first_resolution(one_line(scene()))
    finer = for_motion(first, one_line(bare), Reach(1.1, 5.0))
    assert first.local is not None and finer.local is not None
    assert finer.fineness > first.fineness and finer.local <= 0.05 * 0.022
    assert for_motion(first, one_line(bare), Reach(0.0, 0.4 * DIAMETER)) == first
    assert for_motion(first, one_line(scene({"position": "1 m"})), Reach(5.0, 5.0)) == first


def test_what_is_named_takes_precedence() -> None:
    found = sizes(scene({"all": "2%", "position": "3 cm", "curvature": "5%", "tension": "50 N"}), run(5.0))
    assert found == pytest.approx(
        {"position": 0.03, "end_force_start": 50.0, "end_force_end": 50.0, "curvature": 0.005}
    )
    assert sizes(scene({"position": "1%"}), run(5.0)) == pytest.approx({"position": 1.0})  # of the length, as it was
    assert sizes(scene("50 N"), run(5.0)) == pytest.approx({"end_force_start": 50.0, "end_force_end": 50.0})


@pytest.mark.parametrize("accuracy", [{"all": "3 cm"}, {"curvature": "none"}, {"bending_moment": "none"}])
def test_what_is_refused(accuracy: dict[str, str]) -> None:
    with pytest.raises(hybrid.SceneError, match="accuracy"):
        scene(accuracy)


def test_curvature_is_asked_where_something_rests_on_it() -> None:
    pipe = {"wall": 0.004, "max_stress": 2e8}
    assert sizes(scene(model="rod"), run(5.0))["curvature"] == pytest.approx(0.002)
    assert sizes(scene(pipe=pipe), run(5.0))["curvature"] == pytest.approx(0.002)
    for without in (
        scene(), scene(model="catenary", pipe=pipe), scene({"all": "2%", "curvature": "none"}, model="rod"),
        scene({"position": "1%", "tension": "1%"}, model="rod"),
    ):  # fmt: skip
        assert "curvature" not in sizes(without, run(5.0))


@pytest.mark.parametrize("pipe", [None, {"wall": 0.004, "max_stress": 2e8}])
def test_a_rod_that_the_program_chooses_is_none_that_was_named(pipe: dict[str, float] | None) -> None:
    """Also when it is read back from the file of a result, where its model is named."""
    for asking in (scene(pipe=pipe), scene(None, pipe=pipe)):
        chosen = with_model(one_line(asking), "rod")
        for found in (asking, chosen, parse_scene(scene_text(chosen))):
            assert sizes(found, run(5.0)) == pytest.approx(sizes(asking, run(5.0)))
        assert ("curvature" in sizes(chosen, run(5.0))) == (pipe is not None)


@pytest.mark.parametrize("accuracy", ["2%", {"all": "2%"}, {"position": "3 cm", "line_tension": "2%"}])
@pytest.mark.parametrize(("used", "part"), [(0.2, 10.0), (0.95, 5.0), (0.999, 2.0), (1.05, 5.0), (1.5, 50.0)])
def test_limits_ask_for_what_their_verdict_needs(accuracy: Any, used: float, part: float) -> None:
    """|1 - used| of the limit, between the finest part that is asked and a tenth; of the bend and of the tension."""
    asking = scene(accuracy, min_bend_radius=used / 0.1, max_tension=200.0 / used)
    found = sizes(asking, run(5.0))
    assert found["min_bend_radius"] == pytest.approx(part)
    assert found["max_tension"] == pytest.approx(part)


def test_a_limit_is_held_where_it_is() -> None:
    """The error of a sharp bend in another section does not count; that in its own does, as a part of the limit."""
    sections = [
        {"length": 50.0, "mass": 3.0, "diameter": 0.04, "bending_stiffness": 50.0, "min_bend_radius": 5.0},
        {"length": 50.0, "mass": 3.0, "diameter": 0.04, "bending_stiffness": 40.0},
    ]
    data = scene({"position": "1 m"}).model_dump(mode="json", exclude_none=True)
    asked = requested_accuracy(one_line(hybrid.validate_scene(data | {"cable": {"sections": sections}})))
    assert asked is not None
    found = run(5.0, curvature=0.18)
    found = RunSample(
        found.resolution, {**found.values, "right/curvature": np.full((3, 1), 0.18)}, found.cells, found.steps, 0.1
    )
    for place, ratio in ((9, 0.0), (2, 0.09 * 5.0 / 0.1)):
        errors = np.zeros((3, 11))
        errors[:, place] = 0.09  # 1/m
        named = {"position": np.zeros((3, 11)), "curvature": errors, "right_curvature": np.zeros((3, 1))}
        verdict = judge(asked, Errors.of(dict.fromkeys(("mesh", "time", "model", "total"), named)), found)
        assert verdict.ratio == pytest.approx(ratio)
    assert "min_bend_radius" in verdict.text and "%" in verdict.text


def test_no_limit_of_bending_is_asked_of_a_catenary() -> None:
    assert "min_bend_radius" not in sizes(scene(model="catenary", min_bend_radius=5.0), run(5.0))
    assert "min_bend_radius" not in sizes(scene(bending_stiffness=None, min_bend_radius=5.0), run(5.0))


def test_what_is_not_asked_is_said_beside_what_is_met() -> None:
    asked, found = requested_accuracy(one_line(scene())), run(5.0)
    assert asked is not None
    moment = {"bending_moment": np.full((3, 11), 4.5), "curvature": np.full((3, 11), 0.05)}
    assert "bending moment is not asked, its error is 90 %" in not_asked_text(
        asked, Errors.of({"total": moment}), found
    )
    small = {"bending_moment": np.full((3, 11), 0.09), "curvature": np.full((3, 11), 0.001)}
    assert not_asked_text(asked, Errors.of({"total": small}), found) == ""
    assert asked_text(asked, found).startswith("0.1 m of position (2 % of 5 m moved), 2 % of the tension along")


def test_plan_says_in_metres_what_is_asked() -> None:
    lines = " ".join(x.strip() for x in plan_rows(scene(), hybrid.plan(scene(), measure=False)))
    assert "2 % of how far the line moves (0.02 to 2 m of position), 2 % of the tension along the line" in lines
    limited = scene(min_bend_radius=5.0)
    lines = " ".join(x.strip() for x in plan_rows(limited, hybrid.plan(limited, measure=False)))
    assert "2 to 10 % of min_bend_radius, as its verdict needs" in lines


@pytest.mark.long
def test_a_limit_that_is_nearly_reached_is_settled_at_a_loose_accuracy() -> None:
    """The line bends to 33.75 m: at 1 m of position that was known to 10 %, whatever the limit.

    One of which 97 % is used asks for 3 %; of one of which 40 % is used the tenth costs no more cells.
    """
    errors, cells = {}, {}
    for used in (0.97, 0.4, None):
        limit = {} if used is None else {"min_bend_radius": used * 33.75}
        result = hybrid.run(scene({"position": "1 m"}, model="rod", **limit))
        errors[used] = result["errors/total/curvature"].max() * (used or 1.0) * 33.75
        cells[used] = result.attributes["cells"]
    assert errors[None] > 0.05
    assert errors[0.97] <= 0.03 + 0.002
    assert cells[0.97] > 2 * cells[0.4]
    assert cells[0.4] == cells[None]


@pytest.mark.parametrize("accuracy", ["1%", None])
def test_lines_of_a_system_ask_the_same(accuracy: str | None) -> None:
    """Each of what it moves by itself; a line that names no model, a rod as well, asks for no curvature."""
    line = {"sections": [{"length": LENGTH, "mass": 3.0, "bending_stiffness": 50.0, "diameter": DIAMETER}]}
    system = as_scene(
        network_scene({"a": {"position": [0, 0, 0]}, "b": {"position": [80, 0, 0]}, "c": {"position": [0, 80, 0]}},
                      {"plain": {"start": "a", "end": "b", **line},
                       "named": {"start": "a", "end": "c", "model": "rod", **line}},
                      time={"duration": 4.0}) | ({"accuracy": accuracy} if accuracy else {})
    )  # fmt: skip
    for name in ("plain", "named"):
        asking = system.scene_of(name)
        assert asking.model.kind == "rod"
        found = sizes(asking, run(5.0))
        assert found["position"] == pytest.approx(0.05)
        assert found["tension"] == pytest.approx(0.01 * 200.0)
        assert ("curvature" in found) == (name == "named")
