"""Keys that were renamed: the former name is read, points errors at itself, and is told with its place."""

from __future__ import annotations

import warnings
from inspect import signature
from pathlib import Path

import pytest
from scene_texts import OCEAN, SEA, change, complaints

from hybrid.errors import SceneError
from hybrid.scene.analysis import AdaptiveModel
from hybrid.scene.attachments import Modules
from hybrid.scene.base import FORMER_NAMES, Table
from hybrid.scene.checks import CHECKS
from hybrid.scene.ends import Body
from hybrid.scene.read import RenamedKey, load_scene, parse_scene, read_scene, validate_scene
from hybrid.scene.root import Scene
from hybrid.scene.schema import CableScene
from hybrid.scene.sea import PowerLawCurrent
from hybrid.scene.wave_theory import JonswapWaves

MODEL = "{kind: adaptive, hold_time: 2.0, force_rod: [[0, 10]], force_catenary: [[200, 250]]}"
ADAPTIVE = change(OCEAN, "{kind: catenary}", MODEL)

# Former name, name of today, a scene with the latter, its table, what stands there, a value that is refused.
RENAMED = {
    "JONSWAP height": ("height", "significant_height", SEA, "environment.fluid.waves", "3.0", "-3.0"),
    "JONSWAP period": ("period", "peak_period", SEA, "environment.fluid.waves", "9.0", "-9.0"),
    "turn of a current": ("turn", "veer", SEA, "environment.fluid.current", "30.0", "x"),
    "near of a body": ("near", "initial_guess", SEA, "ends.end", "[60.0, 0.0, -80.0]", "3"),
    "over of modules": ("over", "range", SEA, "cable.attachments[2]", "[20.0, 40.0]", "3"),
    "always_rod": ("always_rod", "force_rod", ADAPTIVE, "model", "[[0, 10]]", "3"),
    "always_catenary": ("always_catenary", "force_catenary", ADAPTIVE, "model", "[[200, 250]]", "3"),
    "dwell": ("dwell", "hold_time", ADAPTIVE, "model", "2.0", "-2.0"),
}


# Keys that are no more: a value that asked for something, the one that asked for nothing, what is said.
GONE = {
    "joint": ("curvature", "spherical", "leave it out: a joint between rod and catenary passes no moment"),
    "correct": ("true", "false", "leave it out: `output: {errors: true}` says what bending would change"),
}


def _old(name: str) -> tuple[str, int, int]:
    """The scene with the former name, and its line and column."""
    old, new, text, *_ = RENAMED[name]
    at = text.index(f"{new}:")
    line = text[:at].count("\n") + 1
    return change(text, f"{new}:", f"{old}:"), line, at - (text.rfind("\n", 0, at) + 1) + 1


def test_every_renamed_key_is_tested() -> None:
    assert {(old, new) for old, new, *_ in RENAMED.values()} == {
        (o, n) for n, olds in FORMER_NAMES.items() for o in olds
    }


@pytest.mark.parametrize("name", RENAMED)
def test_a_former_name_is_read_and_told(name: str, tmp_path: Path) -> None:
    old, new, text, table, *_ = RENAMED[name]
    written, line, column = _old(name)
    path = tmp_path / "scene.yaml"
    path.write_text(written)
    scene, (note,) = read_scene(path)
    assert scene == parse_scene(text)
    assert (note.where, note.old, note.new) == (f"{table}.{old}", old, new)
    assert (note.file, note.line, note.column) == (str(path), line, column)
    with pytest.warns(RenamedKey, match=f"scene.yaml:{line}:{column}: .*{old} is now called {new}"):
        assert load_scene(path) == scene


@pytest.mark.parametrize("name", RENAMED)
def test_an_error_points_at_the_former_name(name: str) -> None:
    old, _, _, table, value, wrong = RENAMED[name]
    written, line, column = _old(name)
    text = change(written, f" {old}: {value}", f" {old}: {wrong}")
    found = [c for c in complaints(text) if c.where == f"{table}.{old}"]
    assert [(c.line, c.column) for c in found] == [(line, column + len(old) + 2)]


def test_contradictions_point_at_the_former_name() -> None:
    (steep,) = complaints(change(SEA, "significant_height: 3.0", "height: 30.0"))
    assert steep.where == "environment.fluid.waves.height" and steep.line == 7
    (short,) = complaints(change(ADAPTIVE, "force_catenary: [[200, 250]]", "always_catenary: [[200, 900]]"))
    assert short.where == "model.always_catenary[0]" and short.line is not None


def test_both_names_are_one_too_many() -> None:
    (both,) = complaints(change(SEA, "veer: 30.0", "veer: 30.0, turn: 30.0"))
    assert both.where == "environment.fluid.current.turn" and "former name of veer" in both.fix


def test_each_name_is_told_once() -> None:
    text = change(SEA, "significant_height: 3.0, peak_period: 9.0", "height: 3.0, period: 9.0")
    text = change(text, "  attachments:\n", "  attachments:\n    - {kind: modules, over: [1.0, 2.0], volume: 0.02}\n")
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        parse_scene(change(text, "{kind: modules, range", "{kind: modules, over"), "deck.yaml")
    assert sorted(w.message.old for w in told) == ["height", "over", "period"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        parse_scene(SEA)


@pytest.mark.parametrize("spelling", ["height", "significant_height"])
@pytest.mark.parametrize("override", ["height=2", "significant_height=2"])
@pytest.mark.filterwarnings("ignore::hybrid.scene.read.RenamedKey")
def test_overrides_know_both_names(spelling: str, override: str) -> None:
    text = change(SEA, "significant_height", spelling)
    waves = parse_scene(text, overrides=[f"environment.fluid.waves.{override}"]).environment.fluid.waves
    assert waves == parse_scene(SEA).environment.fluid.waves.model_copy(update={"significant_height": 2.0})


def test_a_name_of_another_kind_is_no_former_name() -> None:
    with pytest.raises(SceneError) as caught:
        parse_scene(SEA, overrides=["environment.fluid.waves={kind: regular, significant_height: 2, period: 8}"])
    assert {c.where for c in caught.value.complaints} == {
        "environment.fluid.waves.height",
        "environment.fluid.waves.significant_height",
    }


def test_python_knows_the_former_names() -> None:
    made: list[tuple[Table, str, str]] = [
        (JonswapWaves(height=2, period=8), "height", "significant_height"),
        (JonswapWaves(height=2, period=8), "period", "peak_period"),
        (PowerLawCurrent(velocity=(1, 0, 0), bottom=-9, turn=3), "turn", "veer"),
        (Body(mass=1, near=(1, 2, 3)), "near", "initial_guess"),
        (Modules(over=(1, 2), volume=1), "over", "range"),
        (AdaptiveModel(always_rod=[[0, 1]]), "always_rod", "force_rod"),
        (AdaptiveModel(always_catenary=[[0, 1]]), "always_catenary", "force_catenary"),
        (AdaptiveModel(dwell=3), "dwell", "hold_time"),
    ]
    for table, old, new in made:
        with pytest.warns(DeprecationWarning, match=f"{old} is now {new}"):
            assert getattr(table, old) == getattr(table, new)
    with pytest.warns(RenamedKey, match="dwell is now called hold_time"):
        validate_scene(parse_scene(OCEAN).model_dump() | {"model": {"dwell": 2.0}} | {"cable": _bending()})
    with pytest.raises(AttributeError):
        _ = parse_scene(OCEAN).nonsense


def _bending() -> dict[str, object]:
    return parse_scene(OCEAN).cable.model_dump()


def test_names_of_a_scene_are_those_of_a_scene() -> None:
    """What pydantic has deprecated does not stand among them."""
    names = {name for name in dir(parse_scene(OCEAN)) if not name.startswith("_")}
    assert set(CableScene.model_fields) | {"length", "require_time", "model_dump"} <= names
    assert not names & {"copy", "dict", "json", "parse_obj", "parse_raw", "construct", "schema", "validate", "from_orm"}


def test_titles_of_the_schema_have_units() -> None:
    seabed = Scene.model_json_schema()["$defs"]["Seabed"]["properties"]
    assert seabed["stiffness"]["title"] == "stiffness (N/m per m)"


def test_a_former_word_is_read_and_told(tmp_path: Path) -> None:
    text = change(OCEAN, "{kind: equilibrium}", "{kind: equilibrium, friction: left_out}")
    path = tmp_path / "scene.yaml"
    path.write_text(text)
    scene, (note,) = read_scene(path)
    assert scene == parse_scene(change(text, "left_out", "neglected")) and scene.initial.friction == "neglected"
    assert (note.where, note.old, note.new) == ("initial.friction", "left_out", "neglected") and note.line is not None
    (wrong,) = complaints(change(text, "left_out", "left"))
    assert wrong.where == "initial.friction" and "neglected" in wrong.expected and "left_out" not in wrong.expected


@pytest.mark.parametrize("key", GONE)
def test_a_key_that_is_no_more(key: str, tmp_path: Path) -> None:
    """Refused with its place, but where it asks for nothing, as in results of before 0.7, which name every key."""
    value, nothing, fix = GONE[key]
    written = change(ADAPTIVE, "hold_time: 2.0", f"hold_time: 2.0, {key}: {value}")
    path = tmp_path / "scene.yaml"
    path.write_text(written)
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    (wrong,) = caught.value.complaints
    assert (wrong.where, wrong.value) == (f"model.{key}", f"{key}: {value}") and wrong.fix.startswith(fix)
    assert wrong.line == written[: written.index(f"{key}:")].count("\n") + 1
    assert f"{path}:{wrong.line}:" in str(caught.value)
    assert wrong.expected == "a key of kind: adaptive"
    assert parse_scene(written.replace(f"{key}: {value}", f"{key}: {nothing}")) == parse_scene(ADAPTIVE)


def test_every_check_asks_for_tables_that_a_scene_has() -> None:
    """A check is skipped where a table of its arguments is missing: one that is misnamed would never run."""
    for check in CHECKS:
        assert set(signature(check).parameters) <= set(CableScene.model_fields), check.__name__


def test_there_is_one_solver() -> None:
    """`solver: elimination`, which results of before 0.7 name, asks for nothing."""
    assert parse_scene(f"{OCEAN}solver: elimination\n") == parse_scene(OCEAN)
    (wrong,) = complaints(f"{OCEAN}solver: shooting\n")
    assert (wrong.where, wrong.fix) == ("solver", "leave it out: every scene is solved by elimination")


@pytest.mark.parametrize(
    ("model", "fix"),
    [
        ("corrected", "write catenary: with `output: {errors: true}` it says what bending would change"),
        ("{zones: [{corrected: 200.0}, {rod: 50.0}]}", "write {rod: length} or {catenary: length}"),
    ],
)
def test_the_corrected_catenary_is_no_more(model: str, fix: str) -> None:
    (wrong,) = complaints(change(OCEAN, "{kind: catenary}", model))
    assert wrong.where.startswith("model") and "corrected" in wrong.value and wrong.line is not None
    assert "corrected" not in wrong.expected and wrong.fix == fix
