"""A scene that names no model, or `adaptive` alone: what is taken, what is said, and what stays as the scene asks."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from bits import Stopping, differences, went_on

import hybrid
from hybrid.accuracy import model_choice
from hybrid.cli.plan_tables import plan_rows
from hybrid.model.build import build
from hybrid.model.network import NetworkResolution
from hybrid.model.plan import CHOSEN, REST, Cost, cheapest
from hybrid.model.resolution import model_is_free
from hybrid.scene.read import one_line
from hybrid.scene.root import LINE
from hybrid.simulation.case import Case
from tests.said import both_ways, line_of, said
from tests.scenes import cable_scene, pinned_at

TAUT = cable_scene(
    {"length": 52, "mass": 3, "diameter": 0.03, "bending_stiffness": 1, "drag": {"normal": 1.2}}, pinned_at(0, 0, 0),
    pinned_at(48, 0, 0, motion={"heave": {"amplitude": 0.5, "period": 5}, "ramp": 5}), fluid={"density": 1025},
    time={"duration": 10.0}, output=0.5
)  # fmt: skip
MOVING = {"kind": "adaptive", "always_move": True}
CLAMPED = TAUT | {"ends": TAUT["ends"] | {"start": {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, -1]}}}


def chosen(result: hybrid.Result) -> str:
    (text,) = (e.text for e in line_of(result).events if e.kind == CHOSEN)
    return text


def kind_of(result: hybrid.Result) -> str:
    return str(hybrid.parse_scene(line_of(result).scene_text).model.kind)


@both_ways
def test_catenaries_where_they_cost_less_and_nothing_asks_for_rods(monkeypatch, network):
    monkeypatch.setattr(model_choice, "cheapest", lambda found: next(x for x in found if x.kind == "catenary"))
    result = hybrid.run(said(TAUT, network))
    assert "no choice" not in chosen(result) and "µs of processor time per step" in chosen(result)
    assert kind_of(result) == "catenary"
    assert "accuracy missed" not in {e.kind for e in result.events}


@both_ways
def test_rods_where_catenaries_are_no_choice(network):
    result = hybrid.run(said(CLAMPED, network) | {"dimension": None})
    assert kind_of(result) == "rod"
    assert "rods everywhere" in chosen(result) and "an end is clamped" in chosen(result)


@both_ways
def test_rods_at_rest(network):
    result = hybrid.static(said(TAUT | {"accuracy": "1%"}, network))
    assert kind_of(result) == "rod" and REST in chosen(result)


@pytest.mark.parametrize("free", [{}, {"model": "adaptive"}], ids=["no model", "adaptive"])
def test_rods_are_the_same_as_asked_for(tmp_path, free):
    """The pre-run is that of rods: the result has the same bits; a rod that is named asks for curvature as well."""
    hybrid.run(CLAMPED | free, tmp_path / "free.h5").close()
    asked = {"accuracy": {"all": "1%", "curvature": "none"}}
    hybrid.run(CLAMPED | {"model": "rod"} | asked, tmp_path / "rod.h5").close()
    found = differences(tmp_path / "free.h5", tmp_path / "rod.h5")
    assert found and all("event" in x or "scene" in x for x in found), found


@both_ways
@pytest.mark.long
@pytest.mark.parametrize("in_file", [False, True])
def test_rods_after_catenaries_that_fail(tmp_path, monkeypatch, in_file, network):
    """A line that is slackened, of which the criteria are not asked: rods, and why."""
    monkeypatch.setattr(model_choice, "no_catenary", lambda found, s: "")
    monkeypatch.setattr(
        model_choice, "cheapest", lambda found: next((x for x in found if x.kind == "catenary"), found[0])
    )
    slackened = {"travel": {"by": [-30, 0, 0], "over": 4}}
    end = TAUT["ends"]["end"] | {"motion": slackened}
    scene = said(TAUT | {"ends": TAUT["ends"] | {"end": end}}, network)
    result = hybrid.run(scene, tmp_path / "run.h5" if in_file else None)
    assert kind_of(result) == "rod"
    assert "were tried" in chosen(result)
    assert result.status == "complete"
    assert [x.name for x in tmp_path.iterdir() if x.suffix != ".lock"] == ["run.h5"] * in_file


@both_ways
def test_rods_after_catenaries_that_leave_out_too_much(monkeypatch, network):
    monkeypatch.setattr(model_choice, "no_catenary", lambda found, s: "")
    monkeypatch.setattr(model_choice, "structural", lambda scene, cable: "")
    monkeypatch.setattr(
        model_choice, "cheapest", lambda found: next((x for x in found if x.kind == "catenary"), found[0])
    )
    stiff = {"sections": [TAUT["cable"]["sections"][0] | {"bending_stiffness": 2000}]}
    result = hybrid.run(said(CLAMPED | {"cable": stiff}, network))
    assert kind_of(result) == "rod"
    assert "leaving bending out makes" in chosen(result)


@pytest.mark.parametrize(
    "more",
    [
        {"model": MOVING},
        {"model": {"tolerance": 1e-3}},
        {"model": {"force_rod": [[0, 1]]}},
        {"mesh": {"cells": 20}},
        {"time": {"duration": 1.0, "step": 0.1}},
        {"output": {"criteria": True}},
    ],
)
def test_zones_move_where_the_scene_asks_for_it(more):
    scene = hybrid.validate_scene(TAUT | more)
    assert scene.model.kind == "adaptive"
    assert not model_is_free(one_line(scene))


def test_a_criterion_asks_for_zones_that_move():
    short = hybrid.validate_scene(TAUT | {"time": {"duration": 1.0}})
    assert model_is_free(one_line(short))
    result = hybrid.run(short, criterion=lambda look: 0.0 * look.s)
    assert kind_of(result) == "adaptive"


@pytest.mark.long
def test_the_choice_survives_a_stop(tmp_path: Path, monkeypatch):
    scene = hybrid.validate_scene(TAUT | {"time": {"duration": 4.0}})
    stopping = Stopping(monkeypatch)
    hybrid.run(scene, tmp_path / "whole.h5", progress=stopping).close()
    for stop in (stopping.heard // 2, stopping.heard - 20):
        assert went_on(scene, tmp_path / "parts.h5", stopping, [stop]) <= 1
        assert differences(tmp_path / "whole.h5", tmp_path / "parts.h5") == []


def surveyed(case: Case) -> NetworkResolution:
    """How finely a case is computed whose model is not chosen."""
    return model_choice.chosen_and_surveyed(case, NetworkResolution.of(case.lines), [LINE])[1]


@pytest.mark.parametrize("curvature", ["none", "5%"])
def test_zones_that_move_have_the_mesh_of_rods(curvature: str) -> None:
    """To the last bit, whatever is asked: kinds of cells change, and cells do not."""

    def layout(model, accuracy):
        scene = hybrid.validate_scene(CLAMPED | {"model": model, "accuracy": accuracy})
        case = Case(scene, None)
        return build(one_line(scene), surveyed(case).one)

    asked = {"position": "1%", "tension": "1%", "curvature": curvature}
    rods, moving = (layout(model, asked) for model in ("rod", MOVING))
    assert (moving.layout.parts == 1).all() and (moving.line.s == rods.line.s).all()


def test_rods_unless_others_cost_clearly_less():
    rod = Cost("rod", 100, 1.0)
    assert cheapest([rod, Cost("catenary", 100, 0.95)]).kind == "rod"
    assert cheapest([rod, Cost("catenary", 100, 0.5), Cost("adaptive", 100, 0.35)]).kind == "adaptive"
    assert cheapest([rod, Cost("catenary", 100, 0.95), Cost("adaptive", 100, 0.85)]).kind == "rod"
    assert cheapest([rod, Cost("catenary", 100, 0.5, "an end is clamped")]).kind == "rod"
    assert cheapest([rod, Cost("adaptive", 100, 0.5, steps=1.5)]).kind == "adaptive"
    assert cheapest([rod, Cost("adaptive", 100, 0.5, steps=2.0)]).kind == "rod"


def test_the_plan_predicts_each():
    plan = hybrid.plan(TAUT, measure=False)
    assert [kind for kind, _ in plan.choice] == ["rod", "catenary", "adaptive"]
    assert [kind for kind, _ in hybrid.plan(CLAMPED).choice] == ["rod", "adaptive"]
    assert {zone.kind for zone in plan.zones} == {"rod"}
    measured = hybrid.plan(TAUT)
    assert measured.chosen == "catenary" and {zone.kind for zone in measured.zones} == {"catenary"}
    assert measured.choice == plan.choice
    assert hybrid.plan(TAUT | {"model": "rod"}).choice == ()
    assert hybrid.plan(TAUT | {"model": "adaptive"}).choice == plan.choice
    assert hybrid.plan(TAUT | {"model": MOVING}).choice == ()
    assert plan.no_choice == "" and hybrid.plan(CLAMPED).no_choice == "an end is clamped"


def test_the_plan_says_which_why_and_where_rods_are():
    """The text is that of the run's event; a clamp makes a rod beside it, which the text names."""
    said, plan = chosen(hybrid.run(CLAMPED)), hybrid.plan(CLAMPED)
    assert plan.chosen == "rod" and said.startswith(f"rods everywhere; {plan.why}")
    (line,) = (x for x in plan_rows(hybrid.validate_scene(CLAMPED), plan) if x.startswith("model"))
    assert line.startswith("model") and "rod, chosen by a pre-run: rod" in line
    found = re.search(r"(\d+)% of them rod: s = (.*) m\)", plan.why)
    assert found is not None
    share, places = found.groups()
    assert 0 < int(share) < 100
    length = CLAMPED["cable"]["sections"][0]["length"]
    assert any(float(x) in (0.0, length) for part in places.split(", ") for x in part.split(" to "))


@pytest.mark.long
def test_the_plan_predicts_the_number_of_runs():
    """A pre-run, three to compare with and the result, and three finer ones; what is fixed cannot be made finer."""
    plan = hybrid.plan(TAUT)
    assert (plan.runs, plan.most_runs) == (5, 8)
    fixed = TAUT | {"model": "rod", "mesh": {"cells": 20}, "time": {"duration": 2.0, "step": 0.05}, "accuracy": "1%"}
    assert (hybrid.plan(fixed).runs, hybrid.plan(fixed).most_runs) == (4, 4)
    result = hybrid.run(TAUT)
    assert plan.runs - 1 <= result.attributes["effort_runs"] <= plan.most_runs


def test_curvature_that_is_asked_rules_catenaries_out_beforehand() -> None:
    """Not after a run of them: within sqrt(EI/T) of where contact ends they lack more than is asked."""
    asked = ["model=adaptive", "mesh=null", "accuracy={position: 1%, tension: 1%, curvature: 3%}", "time.duration=8"]
    result = hybrid.run(hybrid.load_scene(Path(__file__).parents[2] / "examples" / "touchdown.yaml", asked))
    (why,) = (x.text for x in result.events if x.kind == "model chosen")
    assert (
        kind_of(result) == "rod"
        and "catenary excluded: the error along the line is" in why
        and "times what is asked" in why
    )


@pytest.mark.long
def test_zones_begin_with_rods_where_a_pre_run_shows_that_they_will_be_needed() -> None:
    """Over all the way of the edge: the curvature was off by 18 % of its largest where they came after it."""
    asked = [
        "model={kind: adaptive, always_move: true}",
        "mesh=null",
        "time.step=null",
        "time.duration=12",
        "ends.end.motion.ramp=4",
    ]
    text = ["accuracy={position: 1%, tension: 1%, curvature: 5%}", "output.points=251", "output.every=0.5"]
    scene = hybrid.load_scene(Path(__file__).parents[2] / "examples" / "touchdown.yaml", asked + text)
    case = Case(scene, None)
    resolution = surveyed(case).one
    assert resolution.rods and all(0.0 <= a < b <= 250.0 and x > 1.0 for a, b, x in resolution.rods)
    result = hybrid.run(scene)
    edge = np.asarray(result.touchdown)[:, -1]
    assert any(z.kind == "rod" and z.s_a < edge.min() and edge.max() < z.s_b for z in result.zones[0])
