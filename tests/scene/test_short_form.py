"""The scene of a cable as a network of one line, and messages about that in the words of the scene."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest

import hybrid
from hybrid.errors import SceneError
from hybrid.scene.analysis import CatenaryModel
from hybrid.scene.base import Finding
from hybrid.scene.ends import Ends, FixedPoint, FreePoint, GuidedPoint
from hybrid.scene.read import as_scene, read_text, scene_text
from hybrid.scene.root import LINE, POINTS, Scene, in_full, line_of
from hybrid.scene.schema import CableScene
from tests.combinations.pairs import CLAMP, END, FEATURES, START, scene_of
from tests.problems import tables_with

FORCE, MOMENT = [40.0, 3.0, 30.0], [0.0, 5.0, 0.0]


def scene(*names: str, **changes: Any) -> Scene:
    return as_scene(tables_with(scene_of(*names), {key.replace("__", "."): x for key, x in changes.items()}))


@pytest.mark.parametrize("name", FEATURES)
def test_a_cable_with_any_feature_is_a_network_that_is_read_back(name: str) -> None:
    cable = scene(name)
    for made in (cable, in_full(cable)):
        again, _ = read_text(scene_text(made))
        assert again == made and again.asked_lines.keys() == made.asked_lines.keys()
    network = in_full(cable)
    assert dict(cable) == dict(network) and scene_text(line_of(cable)) == scene_text(cable)
    asked = network.asked_scene(LINE)
    ends = asked.ends if name == "release" else cable.ends  # where points say when they let go
    assert replace(cable.asked_scene(LINE), title=asked.title, ends=ends) == asked


@pytest.mark.parametrize("network", [False, True])
def test_both_forms_are_a_scene_however_it_is_made(network: bool) -> None:
    made = in_full(scene()) if network else scene()
    tables = made.model_dump(mode="json", exclude_none=True)
    again = [hybrid.Scene(**tables), hybrid.Scene.model_validate(made), hybrid.parse_scene(scene_text(made))]
    again += [hybrid.Scene.model_validate_json(json.dumps(tables)), hybrid.validate_scene(tables)]
    assert isinstance(made, hybrid.Scene) and all(x == made and type(x) is type(made) for x in again)
    schema = hybrid.Scene.model_json_schema()
    form = schema["then" if network else "else"]["$ref"].rpartition("/")[2]
    assert schema["$defs"][form]["properties"].keys() == type(made.written).model_fields.keys()


@pytest.mark.parametrize(("name", "now"), [
    ("System", "Scene"), ("load_system", "load_scene"), ("SystemSimulation", "Simulation"),
])  # fmt: skip
def test_names_of_systems_are_deprecated_names_of_scenes(name: str, now: str) -> None:
    with pytest.warns(DeprecationWarning, match=f"hybrid.{name} is now hybrid.{now}"):
        assert getattr(hybrid, name) is getattr(hybrid, now)


def test_every_key_of_a_cable_has_its_place() -> None:
    """All tables of a scene and all kinds of ends: a new one has to be given a place here."""
    taken = {"cable", "ends", "output", "model", "mesh", "resolution", "contact", "initial"}
    taken |= {"title", "environment", "obstacles", "time", "accuracy", "dimension"}
    assert taken == {*CableScene.model_fields}
    kinds = {get.__name__.lower() for get in (type(x) for x in _one_of_each_end())}
    assert kinds == {*POINTS}


def _one_of_each_end() -> list[Any]:
    tables: list[dict[str, Any]] = [
        {"kind": "pinned", "position": [0, 0, 0]}, CLAMP, {"kind": "guided", "tangent": [1, 0, 0]}, {"kind": "free"},
        {"kind": "body", "mass": 3.0},
    ]  # fmt: skip
    return [Ends.model_validate({"start": x, "end": x}).start for x in tables]


def test_ends_that_nothing_holds_are_points_with_their_loads() -> None:
    free = scene("clamp", **{END.replace(".", "__"): {"kind": "free", "force": FORCE, "moment": MOMENT}})
    point = free.points["end"]
    assert isinstance(point, FreePoint) and point.force == (40.0, 3.0, 30.0) and point.moment == (0.0, 5.0, 0.0)
    assert isinstance(free.points["start"], FixedPoint) and free.clamp(LINE, "start") is not None
    guided = scene(**{END.replace(".", "__"): {"kind": "guided", "tangent": [1, 0, 0], "force": FORCE}})
    held = guided.clamp(LINE, "end")
    assert isinstance(guided.points["end"], GuidedPoint) and held is not None and held.tangent == (1.0, 0.0, 0.0)
    assert guided.scene_of(LINE).ends.end == Ends.model_validate({
        "start": CLAMP, "end": {"kind": "guided", "tangent": [1, 0, 0], "force": FORCE},
    }).end  # fmt: skip


def test_both_ends_may_be_let_go_at_times_of_their_own() -> None:
    let_go = {f"{START}.release_at": {"time": 0.2}, f"{END}.release_at": {"tension": 50.0}}
    made = as_scene(tables_with(scene_of(), let_go))
    start, end = (made.points[x].break_at for x in ("start", "end"))  # type: ignore[union-attr]
    assert start is not None and end is not None and (start.time, end.tension) == (0.2, 50.0)


def test_places_and_messages_of_a_network_are_said_in_words_of_the_scene() -> None:
    form = scene("body").form
    for there, here in {
        ("points", "end", "force", "until"): ("ends", "end", "thrust", "until"),
        ("points", "start", "position"): ("ends", "start", "position"),
        ("points", "start", "break_at", "time"): ("ends", "start", "release_at", "time"),
        ("lines", "cable", "sections", 0, "mass"): ("cable", "sections", 0, "mass"),
        ("lines", "cable", "model", "zones"): ("model", "zones"),
        ("lines", "cable", "connections", "start", "payout", "rate"): ("ends", "start", "payout", "rate"),
        ("output", "points", "cable", 3): ("output", "points", 3),
        ("environment", "seabed"): ("environment", "seabed"),
    }.items():
        assert form.place(there) == here
    said = form.text("line cable breaks from point end; see lines.cable.sections[0] and points.start.break_at")
    assert said == "the cable breaks from ends.end; see cable.sections[0] and ends.start.release_at"
    assert in_full(scene("body")).form.text("point end gives way") == "point end gives way"
    found = form.finding(Finding(("points", "end", "initial_guess"), "a place near lines.cable.initial"))
    assert found.at == ("ends", "end", "initial_guess") and found.expected == "a place near initial"


def tables_in_full(*features: str) -> dict[str, Any]:
    return in_full(scene(*features)).model_dump(mode="json", exclude_none=True)


SECOND = tables_in_full("free end")["lines"]["cable"] | {"start": "end", "end": "far"}


@pytest.mark.parametrize(("features", "wrong", "says"), [
    (["body"], {"points.end.moment": MOMENT}, "nothing there takes a moment"),
    ([], {"points.end": {"kind": "guided"}}, "the direction in which point end holds the line"),
    ([], {"points.end": {"kind": "guided", "motion": {"heave": {"amplitude": 1, "period": 3}}}}, "rotation only"),
    ([], {"points.end": {"kind": "guided"}, "lines.cable.connections.end": {"tangent": [1, 0, 0], "swivel": True}},
     "lets it spin|lets the line spin"),
    (["free end"], {"lines.second": SECOND, "points.far": {"position": [20.0, 0.0, 0.0]}}, "the lines that meet here"),
])  # fmt: skip
def test_what_a_point_cannot_be_is_refused(features: list[str], wrong: dict[str, Any], says: str) -> None:
    with pytest.raises(SceneError, match=says):
        as_scene(tables_with(tables_in_full(*features), wrong))


def test_tables_of_both_forms_change_together() -> None:
    """Of a cable in Python code of 1.0, and what is kept of its network: an unknown line is no change in silence."""
    made = scene()
    changed = made.model_copy(
        update={"model": CatenaryModel(), "output": made.output.model_copy(update={"exact": True})}
    )
    assert changed.model.kind == "catenary" and changed.lines[LINE].model == changed.model and changed.output.exact
    assert changed.asked_lines.keys() == {""} and hybrid.parse_scene(scene_text(changed)) == changed
    with pytest.raises(KeyError):
        made.with_lines({"": {"model": CatenaryModel()}})
