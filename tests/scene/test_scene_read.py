"""Reading: the examples load, a scene survives its own text, YAML mistakes and overrides are located."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from scene_texts import AT_REST, EVERYTHING, EVERYTHING_ELSE, OCEAN, SEAS, SUSPENSION, complaints, marked

from hybrid.errors import SceneError
from hybrid.scene import yaml_source
from hybrid.scene.analysis import (
    CatenaryModel,
    CatenaryZone,
    Equilibrium,
    RodModel,
    RodZone,
    Straight,
    ZonesModel,
    missing_time,
)
from hybrid.scene.cable import Cable, Damping, Fluid, Section
from hybrid.scene.ends import Ends, Free, Guided, Pinned
from hybrid.scene.network import Network
from hybrid.scene.read import as_scene, load_scene, parse_scene, read_text, scene_text, validate_scene
from hybrid.scene.root import Scene

ALL = [SUSPENSION, OCEAN, EVERYTHING, EVERYTHING_ELSE, AT_REST, *SEAS.values()]


def test_suspension_of_the_sketch() -> None:
    scene = parse_scene(SUSPENSION)
    section = scene.cable.sections[0]
    assert (scene.length, section.mass, section.damping) == (2.0, 7.853981634e-4, Damping(mass=2.0))
    assert isinstance(scene.ends.start, Pinned) and isinstance(scene.ends.end, Guided)
    assert scene.ends.end.force == (0.005, 0.0, 0.00866025)
    assert isinstance(scene.model, ZonesModel)
    assert scene.model.zones == (CatenaryZone(catenary=1.5), RodZone(rod=0.5))
    assert scene.output.every == 0.1 and scene.output.points == 101


def test_ocean_of_the_sketch() -> None:
    scene = parse_scene(OCEAN)
    assert scene.environment.fluid == Fluid(density=1025.0, current=(0.3, 0.0, 0.0))
    assert isinstance(scene.model, CatenaryModel)
    assert isinstance(scene.ends.end, Pinned) and scene.ends.end.motion is not None
    assert list(scene.ends.end.motion.harmonics()) == ["heave"]
    assert scene.require_time().duration == 100.0


@pytest.mark.parametrize("text", ALL)
def test_round_trip(text: str) -> None:
    scene = parse_scene(text)
    again = scene_text(scene)
    assert parse_scene(again) == scene
    assert scene_text(parse_scene(again)) == again
    assert validate_scene(scene.model_dump()) == scene


@pytest.mark.long
@settings(derandomize=True, max_examples=60, deadline=None)
@given(
    title=st.text().map(lambda text: "".join(c for c in text if c.isprintable()).strip()),
    mass=st.floats(1e-30, 1e18),
    position=st.tuples(*[st.floats(-1e6, 1e6)] * 3),
)
def test_round_trip_is_exact(title: str, mass: float, position: tuple[float, float, float]) -> None:
    scene = validate_scene(
        {
            "title": title,
            "cable": {"sections": [{"length": 10, "mass": mass}]},
            "ends": {"start": {"kind": "pinned", "position": position}, "end": "free"},
            "initial": "equilibrium",
            "model": "catenary",
        }
    )
    assert parse_scene(scene_text(scene)) == scene


def test_python_and_yaml_make_the_same_scene() -> None:
    built = Scene(
        cable=Cable(sections=(Section(length=10.0, mass=1.0),)),
        ends=Ends(start=Pinned(position=(0.0, 0.0, 0.0)), end=Free()),
        initial=Equilibrium(guess="straight", direction=(1.0, 0.0, 0.0)),
        model=CatenaryModel(),
    )
    assert parse_scene(AT_REST) == built
    assert validate_scene(built) == built
    assert validate_scene({name: getattr(built, name) for name in type(built).model_fields}) == built


def test_numpy_values_are_welcome() -> None:
    straight = Straight(direction=np.array([1, 0, 0]), origin=np.zeros(3))
    assert straight.direction == (1.0, 0.0, 0.0)
    assert Section(length=np.float32(2.0), mass=np.int64(3), bending_stiffness=np.array([1.0, 1.0])).mass == 3.0


def test_scene_is_frozen() -> None:
    with pytest.raises(ValidationError):
        parse_scene(AT_REST).cable.sections[0].mass = 3.0  # type: ignore[misc]


def test_shorthands() -> None:
    text = SUSPENSION.replace("model: {kind: zones, zones: [{catenary: 1.5}, {rod: 0.5}]}", "model: rod")
    assert parse_scene(text).model == RodModel()
    scene = parse_scene(AT_REST.replace("{kind: free}", "free").replace("{kind: catenary}", "catenary"))
    assert scene.ends.end == Free() and scene.model == CatenaryModel()
    text = SUSPENSION.replace("damping: 2.0 ", "damping: {mass: 2}")
    assert text != SUSPENSION and parse_scene(text) == parse_scene(SUSPENSION)


@pytest.mark.parametrize("number", ["1e-3", "1.0e-3", "1E-3", ".001", "0.001", "+1.0e-03"])
def test_numbers_as_people_write_them(number: str) -> None:
    assert parse_scene(AT_REST.replace("mass: 1.0", f"mass: {number}")).cable.sections[0].mass == 1e-3


@pytest.mark.parametrize("word", ["on", "no", "yes", "off"])
def test_words_of_yaml_1_1_are_words(word: str) -> None:
    assert parse_scene(f"title: {word}\n" + AT_REST).title == word
    (complaint,) = complaints(EVERYTHING.replace("swivel: true", f"swivel: {word}"))
    assert complaint.where == "ends.start.swivel" and complaint.expected == "true or false"


def test_title_is_one_line() -> None:
    assert parse_scene("title: >\n  two\n  lines\n" + AT_REST).title == "two lines"
    (complaint,) = complaints("title: |\n  two\n  lines\n" + AT_REST)
    assert complaint.where == "title" and "line breaks" in complaint.fix


def test_anchors_and_merge() -> None:
    text = AT_REST.replace("[{length: 10.0, mass: 1.0}]", "[&a {length: 5.0, mass: 1.0}, {<<: *a, length: 3.0}, *a]")
    assert [s.length for s in parse_scene(text).cable.sections] == [5.0, 3.0, 5.0]


def test_json_schema_describes_every_field() -> None:
    schema = Scene.model_json_schema()
    tables = [schema, *schema["$defs"].values()]
    lacking = [
        (t.get("title"), k) for t in tables for k, f in t.get("properties", {}).items() if "description" not in f
    ]
    assert len(tables) > 25 and lacking == []


def test_a_kind_that_no_other_key_tells_is_required() -> None:
    """In the schema, by which editors check and docs/scene.md is made, as by the program; and no other is."""
    tables = Scene.model_json_schema()["$defs"]
    given = {
        name: "kind" in table.get("required", ()) for name, table in tables.items() if "kind" in table["properties"]
    }
    assert given["RegularWaves"] and given["JonswapWaves"] and given["Float"] and given["Pinned"]
    assert not given["PowerLawCurrent"] and not given["AdaptiveModel"]
    sea = "environment: {fluid: {density: 1025, surface: 0, waves: {height: 1, period: 8}}}\n"
    with pytest.raises(
        SceneError,
        match="one of: regular, stream_function, jonswap, pierson_moskowitz, ochi_hubble, torsethaugen, sum, components, record",
    ):
        parse_scene(sea + AT_REST)


# --- text that is not a scene ------------------------------------------------------------------

NOT_YAML = {
    "tab": ("cable:\n§\tsections: 1\n", "tabs"),
    "bracket": ("cable: [1, 2§\n", "close it with ]"),
    "colon": ("title: a§: b\n", "quotes"),
    "alias": ("cable: §*nowhere\n", "anchor"),
    "nothing": ("§", "cable"),
    "comment only": ("§# nothing here\n", "cable"),
    "list": ("§- 1\n", "cable"),
    "word": ("§cable\n", "cable"),
    "two texts": ("cable: 1\n§---\ncable: 2\n", ""),
    "control character": ("cable: §\x01\n", "take it out"),
}


@pytest.mark.parametrize("name", NOT_YAML)
def test_not_yaml(name: str) -> None:
    text, fix = NOT_YAML[name]
    text, line, column = marked(text)
    complaint = complaints(text)[0]
    assert (complaint.line, complaint.column) == (line, column)
    assert fix in complaint.fix


def test_keys_twice_and_strange_keys_are_all_reported() -> None:
    text, line, column = marked(AT_REST.replace("model:", "ends: 3\n§model: rod\n? [1]\n: 2\nmodel:"))
    found = complaints(text)
    assert [c.value for c in found if "twice" in c.value] == ["ends twice", "model twice"]
    assert "line 2" in next(c.fix for c in found if c.where == "ends")
    assert any(c.value == "a list or table as key" and c.line == line + 1 for c in found)
    assert column == 1


def test_endless_alias() -> None:
    found = complaints("cable: &a [*a]\n")
    assert any(c.where == "cable[0]" and "alias" in c.value for c in found)


def test_deep_nesting_is_refused() -> None:
    assert complaints("cable: " + "[" * 1000 + "]" * 1000)


def test_files(tmp_path) -> None:
    path = tmp_path / "scene.yaml"
    with pytest.raises(SceneError, match="exists"):
        load_scene(path)
    with pytest.raises(SceneError, match="readable"):
        load_scene(tmp_path)
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(SceneError, match="UTF-8"):
        load_scene(path)
    path.write_text(AT_REST)
    assert load_scene(path).length == 10.0
    assert load_scene(str(path), ["cable.sections[0].length=7"]).length == 7.0
    with pytest.raises(SceneError, match=r"scene.yaml:1:41: cable.sections\[0\].mass"):
        path.write_text(AT_REST.replace("mass: 1.0", "mass: -1.0"))
        load_scene(path)


def test_a_path_a_dict_or_a_scene(tmp_path) -> None:
    scene = parse_scene(AT_REST)
    path = tmp_path / "scene.yaml"
    path.write_text(AT_REST)
    assert as_scene(scene) is scene
    assert as_scene(path) == as_scene(str(path)) == as_scene(scene.model_dump()) == scene
    with pytest.raises(SceneError, match="exists"):
        as_scene("nothing.yaml")
    with pytest.raises(TypeError, match="parse_scene"):
        as_scene(AT_REST)
    for nonsense in (None, 3, [1], b"scene.yaml"):
        with pytest.raises(TypeError, match=f"path of a scene file.*{type(nonsense).__name__}"):
            as_scene(nonsense)


def test_motion_file_is_next_to_the_scene(tmp_path) -> None:
    rows = "".join(f"{t},0,0,0\n" for t in range(10))
    (tmp_path / "still.csv").write_text("t,x,y,z\n" + rows)
    text = AT_REST.replace("[0.0, 0.0, 0.0]}", "[0.0, 0.0, 0.0], motion: {file: still.csv}}")
    (tmp_path / "scene.yaml").write_text(text)
    scene = load_scene(tmp_path / "scene.yaml")
    assert isinstance(scene.ends.start, Pinned) and scene.ends.start.motion is not None
    assert scene.ends.start.motion.file == str(tmp_path / "still.csv")
    assert parse_scene(scene_text(scene)) == scene


@pytest.mark.parametrize("data", [None, 3, "cable", [1], {}, {1: 2}, {"cable": object()}])
def test_python_nonsense(data: object) -> None:
    with pytest.raises(SceneError) as caught:
        validate_scene(data)
    assert all(c.line is None for c in caught.value.complaints)


def test_time_is_asked_for_only_where_needed() -> None:
    scene = parse_scene(AT_REST)
    assert "duration" in missing_time().fix
    with pytest.raises(SceneError, match="duration"):
        scene.require_time()


# --- overrides ---------------------------------------------------------------------------------


def test_overrides() -> None:
    scene = parse_scene(
        SUSPENSION,
        overrides=[
            "time.step=0.005",
            "cable.sections[0].mass=2e-3",
            "ends.start.position=[0, 0, 1]",
            "mesh.cells=40",
            "cable.sections[0].damping.stiffness=1e-3",
            "model=rod",
            "ends.end.force={value: [0, 0, 1], until: 2}",
            "title= a: b ".replace(": ", "-"),
        ],
    )
    assert scene.require_time().step == 0.005
    assert scene.cable.sections[0].mass == 2e-3
    assert scene.cable.sections[0].damping == Damping(mass=2.0, stiffness=1e-3)
    assert scene.mesh is not None and scene.mesh.cells == 40
    assert scene.model == RodModel() and scene.title == "a-b"


def test_override_below_a_word() -> None:
    text = AT_REST.replace("{kind: catenary}", "catenary")
    assert parse_scene(text, overrides=["model.slack=warn"]).model == CatenaryModel(slack="warn")


def test_named_entries_are_added_whole_and_null_takes_out() -> None:
    more = [
        "output.quantities.pull={kind: horizontal_force, end: start}",
        "obstacles.pile={kind: sphere, at: [0, 9, 0], radius: 1}",
    ]
    more += ["cable.sections[0].diameter=2e-3"]
    scene = parse_scene(SUSPENSION, overrides=more)
    assert list(scene.output.quantities) == ["pull"] and list(scene.obstacles) == ["pile"]
    bare = parse_scene(SUSPENSION, overrides=[*more, "obstacles=null", "output.quantities.pull=null"])
    assert not bare.obstacles and not bare.output.quantities
    chain = "cable: {sections: [{length: 9, mass: 1}]}\nends: {start: {kind: pinned, position: [0, 0, 0]}, end: free}\ninitial: equilibrium\nmodel: catenary"
    for gone in ("environment=null", "environment.gravity=~"):
        scene = parse_scene(chain, overrides=["environment={gravity: 1.6}", gone])
        assert scene.environment.gravity == 9.81


def test_a_key_that_has_to_be_there_is_asked_for_where_null_takes_it_out() -> None:
    (complaint,) = complaints(SUSPENSION, ("cable=null",))
    assert complaint.where == "cable" and "add `cable: {sections: ...}`" in complaint.fix


def test_points_and_lines_are_added_whole() -> None:
    section = "sections: [{length: 300, mass: 5, axial_stiffness: 1.0e+7}]"
    text = f"points: {{a: {{position: [0, 0, 0]}}, b: {{position: [9, 0, 0]}}}}\nlines: {{x: {{start: a, end: b, {section}}}}}"
    more = ["points.c={position: [1, 9, 0]}", f"lines.y={{start: b, end: c, {section}}}"]
    network, _ = read_text(text, overrides=more)
    assert isinstance(network, Network) and (list(network.points), list(network.lines)) == (["a", "b", "c"], ["x", "y"])
    network, _ = read_text(text, overrides=[*more, "lines.y=null", "points.c=null"])
    assert isinstance(network, Network) and (list(network.points), list(network.lines)) == (["a", "b"], ["x"])
    for override, told in (
        ("points.bb.position=[1, 9, 0]", "did you mean b?; points.bb={...} adds it, with all of its keys"),
        ("points.bb=null", "did you mean b?"), ("obstacles.o.kind=plane", "obstacles.o={...} adds it"),
    ):  # fmt: skip
        with pytest.raises(SceneError) as refused:
            read_text(text, overrides=[override])
        assert told in refused.value.complaints[0].fix


OVERRIDES = {
    "time.stp=1": ("time.stp", "did you mean step?"),
    "tme.step=1": ("tme.step", "did you mean time?"),
    "cable.sections[3].mass=1": ("cable.sections[3].mass", ""),
    "cable.mass=1": ("cable.mass", "sections"),
    "cable.sections.mass=1": ("cable.sections.mass", "cable.sections[0].mass=value"),
    "cable.sections.0.mass=1": ("cable.sections.0.mass", "cable.sections[0].mass=value"),
    "cable.sections.7=1": ("cable.sections.7", "cable.sections[7]=value"),
    "title.x=1": ("title.x", ""),
    "time.step.x=1": ("time.step.x", ""),
    "time.step": ("override", ""),
    "=3": ("override", ""),
    "": ("override", ""),
    "time..step=3": ("override", ""),
    "time.step=[1": ("time.step", "bracket"),
    "time.step={a: 1, a: 2}": ("time.step", "keep one"),
    "time.step=-1": ("time.step", "sign"),
    "time.duration=": ("time.duration", "value"),
    "model.kind=rood": ("model.kind", "did you mean rod?"),
    "ends.end.force=3": ("ends.end.force", ""),
}


@pytest.mark.parametrize("override", OVERRIDES)
def test_override_refused(override: str) -> None:
    where, fix = OVERRIDES[override]
    (complaint,) = complaints(SUSPENSION, (override,))
    assert complaint.where == where and fix in complaint.fix
    assert complaint.line is None


def test_all_overrides_are_judged() -> None:
    assert len(complaints(SUSPENSION, ("tme.step=1", "time.step=-1", "nothing"))) == 3


def test_a_table_of_a_model_may_imply_its_kind() -> None:
    """Keys that only one kind of model has say which it is."""
    for text, kind in (("{tolerance: 1.0e-4}", "adaptive"), ("{zones: [{catenary: 1.5}, {rod: 0.5}]}", "zones")):
        model = "model: {kind: zones, zones: [{catenary: 1.5}, {rod: 0.5}]}"
        assert parse_scene(SUSPENSION.replace(model, f"model: {text}")).model.kind == kind


# --- odd texts and long scenes ----------------------------------------------------------------

ODD_TEXTS = [
    "a: [1e-3, .5, 0o17, 0x1F, 1_000, +1, -.inf, .nan, ~, null, yes, on, no, true, 12:30, 2001-01-01, '1', \"2\"]",
    "a: &x {b: 1, c: [*, d]}\ne: *x", "a: &x {b: 1}\ne: *x\nf: {<<: *x, g: 2}", "a: &x [*x]", "a: &x 1\nb: &x 2", "a: *x",
    "{mass: 2,5}", "a: |\n  text\n  more\nb: >-\n  folded\n  text\n", "a: !!str 1\nb: !!float x\nc: ! 3", "é: ü # ü\nb: 1",
    "a:\n\t- 1", "a: [1, 2", "a: 1\n--- \nb: 2", "", "# nothing", "? [1]\n: 2", "a: \x01", "a:\r\n  b: 1\r\nc: 2",
    "[" * 120 + "]" * 120, "a: %b", "%YAML 1.2\n---\na: 1", "a: 'x\n\n  y'", "a: {b: , c}", "a:b: 1", "- 1\n- - 2\n  - x: 3",
]  # fmt: skip


def _seen(text: str) -> object:
    """The tree of a text and what is said of it."""
    try:
        return repr(yaml_source.from_text(text))  # nan is not itself
    except yaml_source.Unreadable as error:
        return str(error)


@pytest.mark.parametrize("text", [*ALL, *ODD_TEXTS])
def test_libyaml_and_ruamel_read_the_same(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of what libyaml reads; where it was not built, ruamel.yaml reads all."""
    by_libyaml = _seen(text)
    monkeypatch.delattr(yaml_source.yaml, "CSafeLoader")
    too_deep = text.startswith("[" * 120)  # where only libyaml counts: ruamel.yaml takes seconds of 10 000
    assert by_libyaml == _seen(text) or (too_deep and "nested too deeply" in str(by_libyaml))


def test_a_mistake_in_a_long_scene_has_its_place() -> None:
    rows = [f"    - {{kind: clump, at: {0.001 * i:.3f}, mass: 0.1}}\n" for i in range(1000)]
    rows[700] = "    - {kind: clump, at: 0.7, mas: 0.1}\n"
    text = AT_REST.replace(
        "cable: {sections: [{length: 10.0, mass: 1.0}]}",
        "cable:\n  sections: [{length: 10.0, mass: 1.0}]\n  attachments:\n" + "".join(rows).rstrip(),
    )
    unknown, missing = sorted(complaints(text), key=lambda c: c.where, reverse=True)
    assert (missing.where, unknown.where) == tuple(f"cable.attachments[700].{key}" for key in ("mas", "mass"))
    assert {c.line for c in (unknown, missing)} == {704}


def test_words_are_what_ruamel_takes_them_for() -> None:
    """Its rules are copied, so that a command does without its import."""
    from ruamel.yaml.resolver import implicit_resolvers

    def plain(pattern: str) -> str:
        return re.sub(r"\s+", "", pattern.replace(r"[ \t]", "<blank>"))

    ours = [(f"tag:yaml.org,2002:{tag}", first, plain(pattern)) for tag, first, pattern in yaml_source.RULES]
    tags = [tag for tag, *_ in ours]  # words of other tags are text
    theirs = [(tag, first, plain(x.pattern)) for versions, tag, x, first in implicit_resolvers if (1, 2) in versions]
    assert ours == [x for x in theirs if x[0] in tags]


TWO_LINES = """\
points:
  west: {position: [-150, 0, -100]}
  east: {position: [150, 0, -100]}
  buoy: {kind: free, initial_guess: [0, 0, 5], mass: 1000}
lines:
  west: {start: west, end: buoy, sections: [{length: 185, mass: 10, diameter: 0.05, axial_stiffness: 1.0e+7}]}
  east: {start: buoy, end: east, sections: [{length: 185, mass: 10, diameter: 0.05, axial_stiffness: 1.0e+7}]}
time: {duration: 20, step: 0.05}
"""


def test_a_copy_of_several_lines_keeps_nothing_of_the_lines_it_was_copied_from() -> None:
    """Also with the lowest pydantic, in which nothing can be deleted of a frozen model."""
    network, _ = read_text(TWO_LINES, "lines.yaml")
    assert isinstance(network, Network)
    assert network.lines_at("buoy") == [("west", "end"), ("east", "start")]
    assert network.scene_of("east").length == 185.0
    longer = {"length": 190.0}
    section = network.lines["east"].sections[0].model_copy(update=longer)
    east = network.lines["east"].model_copy(update={"sections": (section,)})
    other = network.model_copy(update={"lines": {"east": east}})
    assert other.lines_at("buoy") == [("east", "start")]
    assert (other.scene_of("east").length, network.scene_of("east").length) == (190.0, 185.0)
    assert network.lines_at("buoy") == [("west", "end"), ("east", "start")]
