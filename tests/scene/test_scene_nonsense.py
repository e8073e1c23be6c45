"""Give every key nonsense: the complaint stands at the place of the mistake, and nothing else is ever raised."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator
from functools import cache
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ruamel.yaml import YAML
from ruamel.yaml.nodes import MappingNode, SequenceNode
from scene_texts import AT_REST, EVERYTHING, EVERYTHING_ELSE, MEASURED, OCEAN, PIPED, SEAS, SUSPENSION, complaints

from hybrid.errors import SceneError
from hybrid.scene.base import dotted
from hybrid.scene.read import as_scene, parse_scene, validate_scene
from hybrid.scene.schema import CableScene
from tests.scenes import span

ADAPTIVE = (
    OCEAN.replace(
        "model: {kind: catenary}",
        "model: {kind: adaptive, tolerance: 1.0e-3, rod_cell: 1.0, curvature_error: 0.05, hold_time: 2.0, force_rod: [[0.0, 10.0]], "
        "force_catenary: [[200.0, 250.0]], always_move: true}",
    )
    + "output: {criteria: true, errors: true}\naccuracy: {position: 3 cm, tension: 1%, curvature: 5%, instant: 2%, "
    "bending_moment: 5%, line_tension: 2%}\n"
)
IN_ZONES = """\
cable: {sections: [{length: 10.0, mass: 1.0, bending_stiffness: 2.0}]}
ends: {start: {kind: pinned, position: [0.0, 0.0, 0.0]}, end: {kind: free}}
initial: {kind: equilibrium}
model: {kind: zones, zones: [{catenary: 4.0}, {rod: 6.0}]}
resolution: {cells_per_layer: 4.0}
"""
TOUCHING = """\
cable: {sections: [{length: 10.0, mass: 1.0, diameter: 0.03, bending_stiffness: 2.0}]}
contact: {self: true, friction: 0.2}
ends: {start: {kind: pinned, position: [0.0, 0.0, 0.0]}, end: {kind: free}}
initial: {kind: equilibrium}
model: {kind: rod}
"""
TWISTED = """\
cable: {sections: [{length: 10.0, mass: 1.0, bending_stiffness: 2.0, torsional_stiffness: 1.0}]}
ends:
  start: {kind: clamped, position: [0.0, 0.0, 0.0], tangent: [1.0, 0.0, 0.0], turns: -0.5, bend_stiffness: 500.0}
  end: {kind: guided, tangent: [1.0, 0.0, 0.0], normal: [0.0, 0.0, 1.0], turns: 3.0}
initial: {kind: equilibrium}
model: {kind: rod}
"""
ROPES = """\
cable:
  sections:
    - {length: 10.0, mass: 1.0, tension_strain: [[0, 0], [0.01, 1000.0], [0.03, 5000.0]]}
    - length: 10.0
      mass: 1.0
      axial_stiffness: 1.0e+5
      dynamic_stiffness: {constant: 3.0e+5, per_tension: 20.0, relaxation_time: 60.0}
    - length: 5.0
      mass: 1.0
      syrope: {curve: [[0, 0], [0.1, 1000.0]], working: exponential, k1: 0.2, k2: 1.5, highest_tension: 500.0}
      dynamic_stiffness: {constant: 3.0e+5, relaxation_time: 60.0}
ends: {start: {kind: pinned, position: [0.0, 0.0, 0.0]}, end: {kind: free}}
initial: {kind: equilibrium}
model: {kind: catenary}
"""
STIFFENERS = """\
cable:
  sections:
    - {length: 6.0, mass: 1.0, bending_stiffness: 2.0}
    - {length: 4.0, mass: 1.0, moment_curvature: [[0, 0], [0.1, 0.5], [0.5, 1.0]], first_loading: true}
    - {length: 2.0, mass: 1.0, bending_stiffness: 2.0, bending_slip: [{stiffness: 3.0, moment: 0.4, per_tension: 0.01}],
       stiffness_per_tension: 0.02}
  attachments:
    - {kind: bend_stiffener, range: [0.0, 2.0], diameters: [0.4, 0.2], bore: 0.15, modulus: 7.0e+7, density: 1150.0}
    - {kind: bend_stiffener, range: [7.0, 10.0], added_stiffness: [[0.0, 10.0], [3.0, 50.0]]}
    - {kind: bend_restrictor, range: [3.0, 5.0], radius: 2.0, locked_stiffness: 500.0}
ends: {start: {kind: pinned, position: [0.0, 0.0, 0.0]}, end: {kind: free}}
initial: {kind: equilibrium}
model: {kind: rod}
"""
SHEDDING = """\
environment: {fluid: {density: 1025.0}}
cable:
  sections:
    - {length: 10.0, mass: 1.0, diameter: 0.03, bending_stiffness: 2.0,
       vortices: {lift: 0.7, center: 0.18, low: 0.1, high: 0.26, ramp: 5.0}}
ends: {start: {kind: pinned, position: [0.0, 0.0, 0.0]}, end: {kind: free}}
initial: {kind: equilibrium}
model: {kind: rod}
"""
SWIVELS = """\
environment: {fluid: {density: 1025.0}}
cable:
  sections:
    - {length: 10.0, mass: 1.0, axial_stiffness: 1.0e+6, bending_stiffness: 2.0, torsional_stiffness: 1.0,
       tension_torque: -1.0e-3}
  attachments:
    - {kind: swivel, at: 6.0, mass: 5.0, volume: 0.001, drag_area: 0.02, added_mass: 1.0, height: 0.1}
ends: {start: {kind: pinned, position: [0.0, 0.0, 0.0]}, end: {kind: free}}
initial: {kind: equilibrium}
model: {kind: rod}
"""
LOADED = """\
cable: {sections: [{length: 10.0, mass: 1.0}]}
ends:
  start: {kind: pinned, position: [0.0, 0.0, 0.0], release_at: {time: 4.0, tension: 50.0}}
  end: {kind: free, force: {history: [[0.0, 0.0, 0.0, 0.0], [2.0, 1.0, 0.0, -3.0], [5.0, 1.0, 0.0, 0.0]], ramp: 1.0}}
initial: {kind: equilibrium}
model: {kind: catenary}
time: {duration: 10.0, step: 0.05}
"""
WOUND = """\
cable: {sections: [{length: 40.0, mass: 1.0}]}
ends:
  start: {kind: free}
  end: {kind: pinned, position: [0.0, 0.0, 0.0], payout: {PAYOUT}}
initial: {kind: equilibrium}
model: {kind: catenary}
mesh: {cells: 20}
time: {duration: 10.0, step: 0.05}
"""
UNEVEN = """\
environment:
  fluid: {density: 1025.0}
  seabed:
    z: 0.0
    stiffness: 1.0e+4
    depths: {x: [-50.0, 0.0, 50.0], y: [-50.0, 50.0], depth: [[12.0, 10.0], [11.0, 10.0], [9.0, 8.0]]}
cable: {sections: [{length: 20.0, mass: 1.0, diameter: 0.02}]}
ends: {start: {kind: pinned, position: [0.0, 0.0, -10.0]}, end: {kind: pinned, position: [15.0, 0.0, 0.0]}}
initial: {kind: equilibrium}
model: {kind: catenary}
"""
CLAY = """\
environment:
  seabed:
    z: -20.0
    soil: {shear_strength: 2.0e+3, gradient: 1.5e+3, bearing: 6.0, power: 0.25, stiffness: 200.0, suction: 0.5,
           lateral: {unit_weight: 6.0e+3, wedge: 0.5}}
    friction: {axial: 0.4, lateral: 0.8, residual: [0.2, 0.4], breakout: 0.1, travel: 0.01}
cable: {sections: [{length: 20.0, mass: 1.0, diameter: 0.02, axial_stiffness: 1.0e+5,
                    creep: {per_decade: 1.0e-3, loaded: 60.0}}]}
ends: {start: {kind: pinned, position: [0.0, 0.0, -10.0]}, end: {kind: pinned, position: [15.0, 0.0, 0.0]}}
initial: {kind: equilibrium}
model: {kind: catenary}
"""
OBSTRUCTED = """\
cable: {sections: [{length: 10.0, mass: 1.0, diameter: 0.02}]}
ends: {start: {kind: pinned, position: [0.0, 0.0, 0.0]}, end: {kind: free}}
obstacles:
  wall: {at: [0.0, 3.0, 0.0], normal: [0.0, -1.0, 0.0], from_outside: true}
  ball: {kind: sphere, at: [0.0, 0.0, -20.0], radius: 1.0, friction: 0.3}
  roller: {at: [2.0, 0.0, -5.0], axis: [0.0, 1.0, 0.0], radius: 0.5, damping: 10.0,
           spin: {rate: 2.0, ramp: 1.0}, motion: {travel: {by: [0.0, 0.0, 1.0], over: 2.0}}}
  sheave: {at: [5.0, 0.0, -5.0], axis: [0.0, 1.0, 0.0], radius: 0.5, bearing: {inertia: 2.0, damping: 0.5}}
  deck: {kind: box, at: [8.0, 0.0, -5.0], size: [1.0, 2.0, 1.0], rounding: 0.1, rotation: [0.0, 10.0, 0.0]}
  eye: {kind: torus, at: [6.0, 0.0, -15.0], axis: [1.0, 0.0, 0.0], ring: 0.5, radius: 0.1}
  wheel: {kind: sheave, at: [3.0, 0.0, -15.0], axis: [0.0, 1.0, 0.0], radius: 0.5, groove: 0.05, rim: 0.04}
contact: {self: false}
initial: {kind: equilibrium}
model: {kind: catenary}
"""
PAYOUTS = {
    "rate": "rate: 0.5, begin: 1.0, ramp: 2.0, until: 8.0, longest: 60.0, reel: [{length: 30.0, mass: 2.0}]",
    "rates": "rates: [[0.0, 0.0], [5.0, 1.0], [9.0, -0.5]]",
    "lengths": "lengths: [[0.0, 40.0], [5.0, 44.0], [9.0, 41.0]]",
    "winch": "longest: 60.0, winch: {tension: 390.0, inertia: 50.0, damping: 5.0, max_rate: 2.0, begin: 1.0, ramp: 2.0}",
}
TEXTS = (
    {name: WOUND.replace("PAYOUT", payout) for name, payout in PAYOUTS.items()}
    | {
        "loaded": LOADED,
        "obstructed": OBSTRUCTED,
        "uneven": UNEVEN,
        "clay": CLAY,
        "adaptive": ADAPTIVE,
        "everything": EVERYTHING,
        "everything else": EVERYTHING_ELSE,
        "ocean": OCEAN,
        "at rest": AT_REST,
        "in zones": IN_ZONES,
        "touching": TOUCHING,
        "twisted": TWISTED,
        "swivels": SWIVELS,
        "stiffeners": STIFFENERS,
        "shedding": SHEDDING,
        "ropes": ROPES,
        "measured": MEASURED,
        "piped": PIPED,
    }
    | SEAS
)


def _values(node: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[tuple[str | int, ...], Any]]:
    """Every value of a text with its path, as ruamel.yaml itself sees it."""
    if path:
        yield path, node
    if isinstance(node, MappingNode):
        for key, value in node.value:
            yield from _values(value, (*path, key.value))
    elif isinstance(node, SequenceNode):
        for i, value in enumerate(node.value):
            yield from _values(value, (*path, i))


@cache
def _places(text: str) -> list[tuple[tuple[str | int, ...], Any]]:
    return list(_values(YAML(typ="safe", pure=True).compose(text)))


def _put(text: str, node: Any, nonsense: str) -> str:
    end = node.end_mark.index
    # A block table or list ends where the next key begins; keep its line break.
    written = text[node.start_mark.index : end]
    return text[: node.start_mark.index] + nonsense + written[len(written.rstrip()) :] + text[end:]


LEAVES = [
    (name, path)
    for name, text in TEXTS.items()
    for path, node in _places(text)
    # one entry of a vector speaks for the others
    if not isinstance(node, MappingNode | SequenceNode) and (isinstance(path[-1], str) or path[-1] == 1)
]
TABLES = [(name, path) for name, text in TEXTS.items() for path, node in _places(text) if isinstance(node, MappingNode)]
LISTS = [(name, path) for name, text in TEXTS.items() for path, node in _places(text) if isinstance(node, SequenceNode)]

# Tables that may also be lists of tables: of a list, its entry is what is wrong.
LISTABLE = {"surge", "sway", "heave", "roll", "pitch", "yaw"}

REQUIRED = {
    "length", "mass", "kind", "amplitude", "period", "density", "duration", "rod", "catenary", "z",
    "at", "over", "cells_per_layer", "range", "significant_height", "peak_period", "stiffness",
}  # fmt: skip
WORDS = {"title", "kind", "slack", "guess", "follow", "dimension"}


def _of(name: str, cases: list[tuple[str, tuple[str | int, ...]]]) -> list[tuple[str | int, ...]]:
    """The places of one text."""
    return [path for text, path in cases if text == name]


def _say(name: str, path: tuple[str | int, ...], nonsense: str) -> list[Any]:
    """The complaints at the value itself; there must be one, with its key and its text."""
    text = TEXTS[name]
    node = dict(_places(text))[path]
    found = complaints(_put(text, node, nonsense))
    line, column = node.start_mark.line + 1, node.start_mark.column + 1
    here = [c for c in found if (c.line, c.column) == (line, column)]
    assert here, f"{dotted(path)} = {nonsense}: nothing said at {line}:{column}, but {found}"
    return here


def _harmless(path: tuple[str | int, ...], nonsense: Any) -> bool:
    """A title may be any line, true is a word for swivel and criteria, and damping may be an empty table."""
    harmless = {
        "title": ("nonsense",),
        "swivel": (True,),
        "criteria": (True,),
        "always_move": (True,),
        "first_loading": (True,),
        "errors": (True,),
        "self": (True,),
        "from_outside": (True,),
        "damping": ({},),
    }
    return any(nonsense == h and type(nonsense) is type(h) for h in harmless.get(str(path[-1]), ()))


@pytest.mark.parametrize("name", TEXTS)
def test_nonsense_for_a_value_in_a_file(name: str) -> None:
    for path in _of(name, LEAVES):
        for nonsense in ("nonsense", ".nan") if path != ("title",) else (".nan",):
            here = _say(name, path, nonsense)
            # `damping: 2` stands for {mass: 2}, so the complaint may name that key below.
            assert any(c.where.startswith(dotted(path)) for c in here), (path, nonsense)
            assert all(c.expected and c.value == nonsense for c in here), (path, nonsense)


@pytest.mark.long
@pytest.mark.parametrize(
    "nonsense", ["nonsense", float("nan"), -math.inf, True, None, [], {}, 10**400, b"", object], ids=repr
)
def test_nonsense_for_a_value_in_python(nonsense: Any) -> None:
    for name, path in LEAVES:
        if _harmless(path, nonsense):
            continue
        data = _load(name)
        table = data
        for part in path[:-1]:
            table = table[part]
        optional = path[-1] not in REQUIRED or ("attachments" in path and path[-1] == "density")  # of a stiffener
        if nonsense is None and isinstance(path[-1], str) and optional:
            continue  # None is how Python says that a key is absent
        table[path[-1]] = nonsense
        with pytest.raises(SceneError) as caught:
            validate_scene(data)
        assert any(c.where.startswith(dotted(path)) for c in caught.value.complaints), (name, path)


def _load(name: str) -> Any:
    return copy.deepcopy(_loaded(name))


@cache
def _loaded(name: str) -> Any:
    return YAML(typ="safe", pure=True).load(TEXTS[name])


SIGNED = {"amplitude", "phase", "position", "current", "tangent", "normal", "force", "value", "direction", "origin"}
SIGNED |= {
    "velocity",
    "moment",
    "intrinsic_curvature",
    *WORDS,
    "swivel",
    "tension_torque",
    "criteria",
    "always_move",
    "first_loading",
    "errors",
    "self",
    "from_outside",
}
SIGNED |= {
    "z",
    "slope",
    "surface",
    "top",
    "bottom",
    "veer",
    "initial_guess",
    "thrust",
    "by",
    "shape",
    "turns",
    "history",
    "elevation",
    "end",
    "to",
    "smallest",
    "largest",
    "pressure_z",
    "point",
    "normal",
    "path",
    "reference",
    "rate",
    "rates",
}


@pytest.mark.parametrize("name", TEXTS)
def test_a_negative_number(name: str) -> None:
    for path in _of(name, LEAVES):
        _negative(name, path)


def _negative(name: str, path: tuple[str | int, ...]) -> None:
    """What is said of -7.25 at a place."""
    keys = [part for part in path if isinstance(part, str)]
    ballast = path[1:] == ("attachments", 1, "buoyancy")
    if (
        keys[-1] in SIGNED
        or keys[-1] == "working"
        or "depths" in keys
        or {"tension_strain", "moment_curvature", "curve"} & {*keys}
        or keys == ["initial", "friction"]
        or keys[:2] == ["initial", "points"]
        or (keys[0] == "obstacles" and keys[-1] in ("at", "axis", "normal", "rotation"))
        or ballast
    ):
        found = complaints(_put(TEXTS[name], dict(_places(TEXTS[name]))[path], "-7.25"))
        assert all(c.line is not None for c in found), path
    elif keys == ["mesh", "nodes"] or keys[0] == "accuracy":
        assert complaints(_put(TEXTS[name], dict(_places(TEXTS[name]))[path], "-7.25")), path
    else:
        (complaint,) = [c for c in _say(name, path, "-7.25") if c.where.startswith(dotted(path))]
        assert complaint.value == "-7.25" and (">" in complaint.expected or "whole" in complaint.expected), path


@pytest.mark.parametrize("name", TEXTS)
def test_nonsense_for_a_table(name: str) -> None:
    for path in _of(name, TABLES):
        for nonsense in ("nonsense", "[3]" if path[-1] not in LISTABLE else "[]"):
            _say(name, path, nonsense)


@pytest.mark.parametrize("name", TEXTS)
def test_nonsense_for_a_list(name: str) -> None:
    for path in _of(name, LISTS):
        for nonsense in ("nonsense", "{}"):
            _say(name, path, nonsense)


def test_the_texts_of_this_file_have_every_key() -> None:
    schema = CableScene.model_json_schema()
    known = {key for table in (schema, *schema["$defs"].values()) for key in table["properties"]}
    written = {part for text in TEXTS.values() for path, _ in _places(text) for part in path}
    elsewhere = {
        "file",
        "scale",
        "exact",
        "max_tension",
        "min_tension",
        "vessel",
        "rao",
        "heading",
        "fairlead",
        "drift",
    }
    elsewhere |= {"line", "other", "all", "shortest_period", "longest_period", "max_contact_force", "arc_lengths"}
    elsewhere |= {
        "code",
        "environment_factor",
        "fabrication",
        "functional_factor",
        "functional_moment",
        "functional_tension",
        "material_factor",
        "north",
        "ovality",
        "pretension",
        "pretension_factor",
        "record",
        "safety_class",
        "strength",
        "tensile_strength",
        "yield_strength",
    }
    said = "a new key stands in a text of this file, or of tests/scene/scene_texts.py, so that it is given nonsense"
    assert known - written == elsewhere, said  # where these are tested


@pytest.mark.long
def test_an_unknown_key_in_every_table() -> None:
    for name, path in [*TABLES, *((n, ()) for n in TEXTS)]:
        data = _load(name)
        table = data
        for part in path:
            table = table[part]
        table["nonsence"] = 1
        with pytest.raises(SceneError) as caught:
            validate_scene(data)
        assert dotted((*path, "nonsence")) in [c.where for c in caught.value.complaints]


# --- chance ------------------------------------------------------------------------------------

SNIPPETS = [
    "nonsense", ".nan", "-1", "0", "1e400", "true", "null", "[]", "{}", "[1, 2, 3]", "{kind: free}", "'", '"', "*a",
    "&a", "- ", ": ", "\t", "\n", "rod", "catenary", "zones", "1e-320", "1e308", "!!float x", "!!python/object:os",
    "~", "9" * 400, "é", "{file: '.'}", "<<: 3", "? ", "| ", "%", "#",
]  # fmt: skip


@pytest.mark.long
@settings(derandomize=True, max_examples=200, deadline=None)
@given(data=st.data())
def test_mutations_raise_nothing_but_scene_errors(data: st.DataObject) -> None:
    text = data.draw(st.sampled_from([SUSPENSION, *TEXTS.values()]))
    places = _places(text)
    for path, node in sorted(
        data.draw(st.lists(st.sampled_from(places), max_size=3, unique_by=lambda p: p[0])),
        key=lambda p: -p[1].start_mark.index,
    ):
        del path
        if node.end_mark.index <= len(text):
            text = _put(text, node, data.draw(st.sampled_from(SNIPPETS)))
    for _ in range(data.draw(st.sampled_from([0, 0, 1, 2]))):  # most texts stay YAML, so that the schema is reached
        i = data.draw(st.integers(0, len(text)))
        j = data.draw(st.integers(0, 8))
        text = text[:i] + data.draw(st.sampled_from(["", *SNIPPETS])) + text[i + j :]
    try:
        parse_scene(text, "scene.yaml")
    except SceneError as error:
        assert error.complaints
        assert all(c.line is not None and c.column is not None and c.expected for c in error.complaints)


@pytest.mark.parametrize("depth", [100, 300, 500, 1200, 100_000])
@pytest.mark.parametrize("key", ["cable", "environment", "lines", "anything"])
def test_a_scene_nested_deep_is_refused(key: str, depth: int) -> None:
    deep: dict[str, Any] = {}
    for _ in range(depth):
        deep = {key: deep}
    with pytest.raises(SceneError):
        validate_scene(deep)
    with pytest.raises(SceneError):
        as_scene({"lines": deep, "points": {}})
    while deep:  # Python's own deletion of a chain of dicts is safe, and slow
        (deep,) = deep.values()


def test_a_scene_that_holds_itself_is_refused() -> None:
    scene: dict[str, Any] = {"title": "x"}
    scene["cable"] = {"sections": [scene]}
    with pytest.raises(SceneError, match="nested too deeply"):
        validate_scene(scene)


@pytest.mark.parametrize("bends", [{"bending_stiffness": [20.0, 8.0]}, {"intrinsic_curvature": [0.05, 0, 0]}])
def test_a_start_that_is_no_rest_needs_the_direction_of_material_axes(bends: dict[str, Any]) -> None:
    """Which a clamp with a normal gives, a rest finds, and a plane or a straight round line does not need."""
    section = {"length": 12.0, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e5, "bending_stiffness": 20.0}
    section |= {"torsional_stiffness": 15.0}
    scene = {
        "environment": {"gravity": 9.81}, "cable": {"sections": [section | bends]},
        "ends": {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": {"kind": "free"}},
        "initial": {"kind": "straight", "direction": [1, 0, 0]}, "model": "rod", "mesh": {"cells": 12},
        "time": {"duration": 1.0, "step": 0.1},
    }  # fmt: skip
    with pytest.raises(SceneError, match="material axes that nothing turns"):
        validate_scene(scene)
    clamp = {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, 0], "normal": [0, 1, 0]}
    for allowed in (
        scene | {"initial": "equilibrium"},
        scene | {"ends": scene["ends"] | {"start": clamp}},
        scene | {"cable": {"sections": [section]}},
    ):
        validate_scene(allowed)


def test_a_huge_whole_number_is_refused() -> None:
    with pytest.raises(SceneError, match="a list of stretches"):
        as_scene(span(model={"kind": "adaptive", "force_rod": [10**400, 1]}))
