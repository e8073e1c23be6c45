"""What leaving bending out changes in a line: its figure, from a run with rods, against the truth."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bits import Stopping, differences, went_on
from controlled import OneLine

import hybrid
from hybrid.accuracy import model_choice
from hybrid.accuracy.model_choice import leaves_bending_out
from hybrid.accuracy.refinement import Free
from hybrid.accuracy.run_forecast import _grown
from hybrid.cli.plan_tables import plan_rows
from hybrid.errors import ComputationError, Outcome
from hybrid.model.build import build
from hybrid.model.network import NetworkResolution
from hybrid.model.plan import CHOSEN, REST, Cost, cheapest
from hybrid.model.resolution import first_resolution, model_is_free
from hybrid.scene.read import as_scene, one_line
from hybrid.scene.root import LINE, in_full
from hybrid.simulation.case import Case
from hybrid.simulation.run_sample import RunSample, restored_sample
from hybrid.store.integrity import pack, unpack
from hybrid.store.stored_rows import ComparisonRecorder, MissingRows
from tests.said import line_of, said, texts_of
from tests.scenes import cable_scene, pinned_at, system_of


def span(EI: float, model: Any, **more: Any) -> hybrid.Scene:
    """A span of 20 m that sags by 1.5 m, its end driven; errors on."""
    return hybrid.validate_scene(
        cable_scene(
            {"length": 20.3, "mass": 1.0, "axial_stiffness": 1e6, "bending_stiffness": EI, "damping": 0.3},
            pinned_at(0, 0, 0),
            pinned_at(20, 0, 0, motion={"heave": {"amplitude": 0.3, "period": 2.5}, "ramp": 3}),
            model=model,
            mesh=80,
            time=(5.0, 0.02),
            output={"every": 0.1, "errors": True},
        )
        | more
    )


@pytest.mark.long
def test_estimate_is_the_distance_to_the_rod():
    """In proportion to EI; of curvature, whose layers at the pins results have, little is left, and no less is said."""
    found = []
    for EI in (2.0, 4.0):
        rod, catenary = hybrid.run(span(EI, "rod")), hybrid.run(span(EI, "catenary"))
        true = np.linalg.norm(rod["position"] - catenary["position"], axis=2).max(axis=1)
        estimate = catenary["errors/model/position"].max(axis=1)
        effectivity = estimate / true
        assert np.median(effectivity) == pytest.approx(1.0, abs=0.02)  # 0.999 when written
        assert effectivity.min() > 0.9 and effectivity.max() < 1.15
        found.append(np.median(true))
        for name in ("tension", "bending_moment"):
            was = np.abs(rod[name] - (0.0 if name == "bending_moment" else catenary[name])).max(axis=1)
            assert np.median(catenary[f"errors/model/{name}"].max(axis=1) / was) == pytest.approx(1.0, abs=0.05), name
    assert 1.8 < found[1] / found[0] < 2.1
    fine, plain = (hybrid.run(span(4.0, model, mesh={"cells": 2560})) for model in ("rod", "catenary"))
    left = np.median(np.abs(fine["curvature"] - plain["curvature"]).max(axis=1))
    assert left < 2e-3 * fine["curvature"].max()
    assert 0.7 < np.median(plain["errors/model/curvature"].max(axis=1)) / left < 3.0


@pytest.mark.long
def test_pull_of_the_ends_is_estimated():
    """The force that holds an end, as its magnitude; within a tenth in the median (0.99 when written)."""
    a, b = hybrid.run(span(4.0, "catenary")), hybrid.run(span(4.0, "rod"))
    for end in ("start", "end"):
        true = np.abs(np.diff([np.linalg.norm(x[f"reaction_{end}"], axis=1) for x in (a, b)], axis=0)[0])
        clear = true > 0.1 * true.max()
        ratio = a[f"errors/model/end_force_{end}"][clear] / true[clear]
        assert np.median(ratio) == pytest.approx(1.0, abs=0.1)


def suspension(model: Any) -> hybrid.Scene:
    """examples/02 at rest and for half a second."""
    what = hybrid.load_scene("examples/02_suspension.yaml").model_dump(exclude_none=True)
    what |= {"model": model, "initial": {"kind": "equilibrium"}, "time": {"duration": 0.1, "step": 0.01}}
    what["output"] = {"every": 0.1, "errors": True}
    return hybrid.validate_scene(what)


@pytest.mark.long
@pytest.mark.parametrize("joint", [0.2, 0.4, 1.0, 1.5, 1.7])
def test_joints_in_the_middle_of_a_sag_know_what_they_cost(joint):
    """The suspension, lambda a tenth of its length (shared/validation: 1.9 to 8 cm): 0.95 to 1.15 of the truth."""
    cells = round(50 * joint)
    zones = [{"catenary": joint, "cells": cells}, {"rod": 2.0 - joint, "cells": 100 - cells}]
    whole = hybrid.run(suspension({"kind": "zones", "zones": [{"rod": 2.0, "cells": 100}]}))
    a = hybrid.run(suspension({"kind": "zones", "zones": zones}))
    true = np.linalg.norm(whole["position"] - a["position"], axis=2)[0].max()
    assert 0.95 < a["errors/model/position"][0].max() / true < 1.15
    moment = np.abs(whole["bending_moment"] - a["bending_moment"])[0].max()
    assert a["errors/model/bending_moment"][0].max() / moment == pytest.approx(1.0, abs=0.05)


def test_one_way_only():
    """Bit for bit the same run with errors and without."""
    with_, without = span(4.0, "catenary"), span(4.0, "catenary", output={"every": 0.1})
    a, b = hybrid.run(with_), hybrid.run(without)
    for name in ("position", "velocity", "tension", "reaction_end"):
        np.testing.assert_array_equal(a[name], b[name])
    assert not [name for name in b.names if name.startswith("errors/model")]


# --- how runs are compared --------------------------------------------------------------------------


def made_up(resolution: Any = None, **more: Any) -> RunSample:
    x = first_resolution(one_line(span(2.0, "catenary"))) if resolution is None else resolution
    position = np.full((9, 4, 3), 0.01 / x.fineness)
    return RunSample(x, {"position": position}, round(100 * x.fineness), round(10 / x.step), 0.0, **more)


def test_a_line_that_was_rod_everywhere_at_some_time_leaves_bending_out_at_others() -> None:
    """Rods that come and go along the whole of it: it had no error of the model, and no word of that."""
    line = in_full(as_scene(span(2.0, {"kind": "adaptive"}, mesh=None))).lines[LINE]
    everywhere = ((0.0, 12.0), (10.0, 20.3))
    assert leaves_bending_out(line, made_up(rods=everywhere, catenary=np.array([0.0, 0.5, 0.4])))
    assert not leaves_bending_out(line, made_up(rods=everywhere, catenary=np.zeros(3)))
    assert not leaves_bending_out(line, made_up(rods=everywhere))  # of zones that stay
    assert leaves_bending_out(line, made_up(rods=everywhere[:1]))


def test_rods_are_computed_when_no_run_beside_reads_the_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    """They stand in its place for a time: a run that began meanwhile in another thread would be of rods."""
    order: list[str] = []

    def made(resolution: Any) -> RunSample:
        order.append("run")
        return made_up(resolution)

    def as_rods(case: Any, runs: Any, costs: list[float]) -> Any:
        order.append("rods")
        return runs

    monkeypatch.setattr("hybrid.accuracy.error_control.with_model_errors", as_rods)
    control = OneLine(None, Free(False, False, False), made, made)
    control.start(made_up().resolution)
    assert order[:5] == ["run", "run", "run", "run", "rods"]  # the result, and those to compare with


def test_what_bending_changes_in_a_run_whose_outputs_are_in_a_file_is_computed_again(tmp_path: Any) -> None:
    """The error is in no file: without a word it was none after a resume."""
    run = made_up(model_error={"position": np.ones((9, 4))})
    scene, shape = span(2.0, "catenary"), (9, 4, 0)
    tree = unpack(pack(run.checkpoint()))
    assert restored_sample(tree, one_line(scene), shape).model_error["position"].shape == (9, 4)
    tree = unpack(pack(replace(run, rows={"kept": 1}, forces=np.ones((2, 3))).checkpoint()))
    with pytest.raises(MissingRows):
        restored_sample(tree, one_line(scene), shape, tmp_path / "run.h5")


def test_a_run_of_a_checkpoint_of_1_0_is_read() -> None:
    """It has what the estimate was bounded by and doubted for, and whether it was followed along the run."""
    tree = unpack(pack(made_up().checkpoint()))
    tree |= {"bound": 0.1, "doubt": np.zeros(4), "resolution": tree["resolution"] | {"follow": True}}
    assert restored_sample(tree, one_line(span(2.0, "catenary")), (9, 4, 0)).cells == made_up().cells


# --- where there is none -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("model", "bending", "why"),
    [
        ("rod", 2.0, "rod everywhere"),
        ({"kind": "zones", "zones": [{"rod": 10.0}, {"rod": 10.3}]}, 2.0, "rod everywhere"),
        ("catenary", None, "no bending stiffness"),
    ],
)
def test_nothing_left_out_is_absent_and_says_why(model, bending, why):
    what = span(2.0, "catenary").model_dump(exclude_none=True)
    section = what["cable"]["sections"][0] | {"bending_stiffness": bending}
    what["cable"]["sections"] = [{k: x for k, x in section.items() if x is not None}]
    what["model"], what["time"] = model, {"duration": 0.1, "step": 0.02}
    scene = hybrid.validate_scene(what)
    entry = next(x for x in hybrid.plan(scene).contents if x.what.startswith("model error"))
    assert not entry.on and why in entry.why
    assert not [name for name in hybrid.run(scene).names if name.startswith("errors/model")]


# --- beside a joint on a bed -------------------------------------------------------------------

LENGTH, H = 250.0, 0.5  # m, cells where the line touches down
NODES = [*np.arange(0.0, 80.0, 4.0), *np.arange(80.0, 106.0, H), *np.arange(106.0, LENGTH + 1.0, 4.0)]


def beginning(model: Any, errors: bool, across: float) -> hybrid.Result:
    """Two steps of a line that touches down at s = 90 m, on a bed over 1.7 m of which it comes to rest.

    across: m/s, of a current that leads it out of its plane.
    """
    return hybrid.run(cable_scene(
        {"length": LENGTH, "diameter": 0.05, "mass": 20, "axial_stiffness": 2e8, "bending_stiffness": 2e3,
         "drag": {"normal": 1.2, "tangential": 0.05}},
        pinned_at(0, 0, -100), pinned_at(205, 0, 0), fluid={"density": 1025, "current": [0.0, across, 0.0]},
        seabed={"z": -100, "stiffness": 5e3, "damping": 5e2}, contact={"self": False}, model=model,
        mesh={"nodes": [float(x) for x in NODES]}, time=(0.02, 0.01),
        output={"every": 0.02, "points": NODES, "errors": errors}
    ))  # fmt: skip


@pytest.mark.parametrize("across", [0.0, 0.5], ids=["plane", "space"])
@pytest.mark.parametrize("joint", [87.0, 89.0, 90.0])
def test_what_a_joint_does_on_a_bed_is_stated(joint: float, across: float) -> None:
    """0.9 to 1.25 of it where it is largest; nowhere beside the joint less than two thirds of what counts."""
    rods = beginning({"kind": "rod"}, False, across)
    zones = {"kind": "zones", "zones": [{"catenary": joint}, {"rod": 105.0 - joint}, {"catenary": LENGTH - 105.0}]}
    found = beginning(zones, True, across)
    same = [int(np.abs(rods.s - x).argmin()) for x in found.s]
    true, near = np.abs(found.curvature - rods.curvature[:, same])[-1], np.abs(found.s - joint) < 3.0
    stated = found["errors/model/curvature"][-1]
    assert 0.9 < stated[near].max() / true[near].max() < 1.25
    assert (stated[near] > true[near] / 1.5 - 0.002 * rods.curvature.max()).all()


@pytest.mark.long
def test_rods_take_the_very_steps_of_a_run() -> None:
    """Of others the difference is of steps: 68 N were said of a catenary that is off by less than 1 N for its bending."""
    found = hybrid.run(
        hybrid.load_scene("examples/touchdown.yaml", ["accuracy={tension: 0.3%}", "mesh=null", "time={duration: 7}"])
    )
    assert {x.kind for zones in found.zones for x in zones} == {"catenary"}
    assert 0.5 < found["errors/model/end_force_end"].max() < 1.5


# --- A scene that names no model, or `adaptive` alone: what is taken, what is said, and what stays as the scene asks
# ---

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


def test_catenaries_where_they_cost_less_and_nothing_asks_for_rods(monkeypatch):
    monkeypatch.setattr(model_choice, "cheapest", lambda found: next(x for x in found if x.kind == "catenary"))
    result = hybrid.run(said(TAUT, network=True))
    assert "no choice" not in chosen(result) and "µs of processor time per step" in chosen(result)
    assert kind_of(result) == "catenary"
    assert "accuracy missed" not in {e.kind for e in result.events}


def test_rods_where_catenaries_are_no_choice():
    result = hybrid.run(said(CLAMPED, network=True) | {"dimension": None})
    assert kind_of(result) == "rod"
    assert "rods everywhere" in chosen(result) and "an end is clamped" in chosen(result)


def test_rods_at_rest():
    result = hybrid.static(said(TAUT | {"accuracy": "1%"}, network=True))
    assert kind_of(result) == "rod" and REST in chosen(result)


@pytest.mark.parametrize("free", [{}, {"model": "adaptive"}], ids=["no model", "adaptive"])
def test_rods_are_the_same_as_asked_for(tmp_path, free):
    """The pre-run is that of rods: the result has the same bits; a rod that is named asks for curvature as well."""
    hybrid.run(CLAMPED | free, tmp_path / "free.h5").close()
    asked = {"accuracy": {"all": "1%", "curvature": "none"}}
    hybrid.run(CLAMPED | {"model": "rod"} | asked, tmp_path / "rod.h5").close()
    found = differences(tmp_path / "free.h5", tmp_path / "rod.h5")
    assert found and all("event" in x or "scene" in x for x in found), found


@pytest.mark.long
@pytest.mark.parametrize("in_file", [False, True])
def test_rods_after_catenaries_that_fail(tmp_path, monkeypatch, in_file):
    """A line that is slackened, of which the criteria are not asked: rods, and why."""
    monkeypatch.setattr(model_choice, "no_catenary", lambda found, s: "")
    monkeypatch.setattr(
        model_choice, "cheapest", lambda found: next((x for x in found if x.kind == "catenary"), found[0])
    )
    slackened = {"travel": {"by": [-30, 0, 0], "over": 4}}
    end = TAUT["ends"]["end"] | {"motion": slackened}
    scene = said(TAUT | {"ends": TAUT["ends"] | {"end": end}}, network=True)
    result = hybrid.run(scene, tmp_path / "run.h5" if in_file else None)
    assert kind_of(result) == "rod"
    assert "were tried" in chosen(result)
    assert result.status == "complete"
    assert [x.name for x in tmp_path.iterdir() if x.suffix != ".lock"] == ["run.h5"] * in_file


def test_rods_after_catenaries_that_leave_out_too_much(monkeypatch):
    monkeypatch.setattr(model_choice, "no_catenary", lambda found, s: "")
    monkeypatch.setattr(model_choice, "structural", lambda scene, cable: "")
    monkeypatch.setattr(
        model_choice, "cheapest", lambda found: next((x for x in found if x.kind == "catenary"), found[0])
    )
    stiff = {"sections": [TAUT["cable"]["sections"][0] | {"bending_stiffness": 2000}]}
    result = hybrid.run(said(CLAMPED | {"cable": stiff}, network=True))
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


# --- A catenary that nobody asked for does not stop a run where it goes slack: rods take its place, and the result
# says so ---

SECTION = {"length": 10.0, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e5}
HEAVE = {"position": [9, 0, 0], "motion": {"heave": {"amplitude": 0.5, "period": 0.8}, "ramp": 1.6}}
TABLES = {"time": {"duration": 2.0, "step": 0.005}, "output": {"every": 0.1}}


CHOSEN_SLACK = "slack line as rods"


def cable(**more: Any) -> dict[str, Any]:
    """A line whose end falls faster than its weight lets it follow."""
    return cable_scene(SECTION, pinned_at(0, 0, 0), HEAVE | {"kind": "pinned"}, mesh=20) | TABLES | more


def network(**more: Any) -> dict[str, Any]:
    line = {"start": "a", "end": "b", "sections": [SECTION], "mesh": {"cells": 20}} | more
    other = line | {"start": "a", "end": "c"}
    points = {"a": {"position": [0, 0, 0]}, "b": HEAVE, "c": {"position": [-9, 0, 0]}}
    return {"points": points, "lines": {"left": other, "right": line}} | TABLES


def test_a_cable_that_goes_slack_becomes_a_rod(tmp_path: Path) -> None:
    result = hybrid.run(cable(), tmp_path / "a.h5")
    assert result.status == "complete" and result.times[-1] == 2.0
    (text,) = texts_of(result, CHOSEN_SLACK)
    assert text.startswith("computed as rods") and "compression at t = " in text
    assert {x.kind for zones in result.zones for x in zones} == {"rod"}
    stiffness = 9.81 * 2.0 * 0.1**3  # under its weight it bends over a hundredth of its length
    assert f"{stiffness:.3g} N m^2" in text and "bending_stiffness: 0.019" in result.scene_text
    assert result.tension.min() < 0.0 and not list(tmp_path.glob("*.npz"))


def test_a_line_of_a_system_that_goes_slack_becomes_a_rod() -> None:
    result = hybrid.run(network())
    assert result.status == "complete" and result.times[-1] == 2.0
    (text,) = texts_of(result, CHOSEN_SLACK)
    assert text.startswith("line right: computed as rods") and "no other line has changed" in text
    assert not texts_of(result.lines["left"], CHOSEN_SLACK) and len(texts_of(result.lines["right"], CHOSEN_SLACK)) == 1
    kinds = {name: {x.kind for zones in line.zones for x in zones} for name, line in result.lines.items()}
    assert kinds == {"left": {"catenary"}, "right": {"rod"}}


@pytest.mark.parametrize("scene", [cable(model="catenary"), network(model="catenary")])
def test_a_catenary_that_is_asked_for_stops(scene: dict[str, Any]) -> None:
    with pytest.raises(ComputationError) as stopped:
        hybrid.run(scene)
    assert stopped.value.outcome == Outcome.SLACK


def test_the_plan_says_what_a_slack_line_may_cost() -> None:
    """And counts steps whose loads still grow as those of grown loads: the motion of the end has a ramp of 1.6 s."""
    open_, named = system_of(network()), system_of(network(model="catenary"))
    assert open_.slack_becomes_rod and not named.slack_becomes_rod and _grown(open_) == 1.6
    plan = replace(hybrid.plan(open_, measure=False), seconds=8.0, most_seconds=19.0)
    said = " ".join(" ".join(plan_rows(open_, plan)).split())
    assert "about 8 s of CPU for all runs (up to 19 s if a line goes slack and becomes a rod" in said


def test_each_output_that_is_kept_has_its_own_zones() -> None:
    """Of outputs that are recorded together, too: whether bending is left out at any goes by them."""
    kept = ComparisonRecorder()
    kept.save_batch(np.arange(2.0), {}, [("rod", 0.0, 10.0)], [[("rod", 0.0, 4.0), ("catenary", 4.0, 10.0)]])
    kept.save_batch(np.arange(2.0, 4.0), {}, [("catenary", 0.0, 10.0)])
    assert kept.catenary.tolist() == [0.0, 0.6, 1.0, 1.0] and kept.rods == {(0.0, 10.0), (0.0, 4.0)}
