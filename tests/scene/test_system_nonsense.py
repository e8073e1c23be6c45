"""Give every key of a scene of several lines nonsense: it is refused in words or read, and nothing else is raised."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from typing import Any

import pytest

from hybrid.errors import SceneError
from hybrid.scene.base import dotted
from hybrid.scene.read import as_scene
from tests.scenes import line_between, network_scene

SECTION = {"length": 185.0, "mass": 10.0, "diameter": 0.05, "axial_stiffness": 1e7, "bending_stiffness": 40.0}
MOTION = {"heave": {"amplitude": 1.0, "period": 9.0}, "roll": {"amplitude": 2.0, "period": 9.0}, "ramp": 9.0}
SCENE: dict[str, Any] = network_scene(
    {"west": {"position": [-150.0, 0.0, -100.0], "break_at": {"time": 5.0}},
     "east": {"kind": "fixed", "position": [150.0, 0.0, -100.0],
              "motion": {"travel": {"by": [1.0, 0.0, 0.0], "over": 9.0}}},
     "buoy": {"kind": "free", "initial_guess": [0.0, 0.0, 5.0], "mass": 900.0, "volume": 9.0, "height": 2.0,
              "shape": "cylinder", "drag_area": 1.0, "added_mass": 5.0, "force": [1.0, 0.0, 0.0]},
     "low": {"position": [10.0, 0.0, -100.0]}, "lead": {"body": "float", "place": [1.0, 0.0, -1.0]},
     "hangoff": {"kind": "fairlead", "body": "ship", "place": [0.0, 5.0, -1.0], "break_at": {"tension": 5e5}}},
    {"one": line_between("west", "buoy", SECTION, model="rod", mesh=20),
     "six": line_between("low", "lead", SECTION, model="rod", mesh=20,
                         connections={"start": {"tangent": [0.0, 0.0, 1.0], "normal": [1.0, 0.0, 0.0], "swivel": False},
                                      "end": {"kind": "clamped", "tangent": [0.0, 1.0, 1.0], "bend_stiffness": 5e3}}),
     "two": line_between("buoy", "east", SECTION,
                         attachments=[{"kind": "clump", "at": 5.0, "mass": 3.0, "volume": 0.001}]),
     "three": line_between("buoy", "lead", SECTION | {"length": 80.0}),
     "four": line_between("lead", "hangoff", SECTION | {"length": 150.0}),
     "five": line_between("buoy", "mast", SECTION | {"length": 110.0},
                          break_at={"time": 4.0, "tension": 4e5, "end": "start"})},
    title="all keys",
    fluid={"density": 1025.0, "surface": 30.0, "waves": {"kind": "regular", "height": 1.0, "period": 7.0}},
    seabed={"z": -101.0, "stiffness": 1e4},
    bodies={"float": {"initial_guess": [60.0, 0.0, 20.0], "initial_rotation": [1.0, 2.0, 3.0], "mass": 4e3,
                      "centre": [0.1, 0.0, -0.2], "inertia": [2e4, 3e4, 2e4],
                      "added_mass": [1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
                      "damping": [[2.0 * (i == j) for j in range(6)] for i in range(6)], "volume": 5.0,
                      "centre_of_buoyancy": [0.0, 0.0, 0.3], "force": {"value": [1.0, 0.0, 0.0], "until": 4.0},
                      "moment": [0.0, 0.0, 2.0],
                      "members": [{"start": [0.0, 0.0, -2.0], "end": [0.0, 1.0, 2.0], "diameter": 0.4, "drag": 1.0,
                                   "axial_drag": 0.01, "added_mass": 1.0, "pieces": 3}]},
            "ship": {"position": [-60.0, 0.0, 32.0], "rotation": [0.0, 0.0, 30.0], "motion": MOTION},
            "spar": {"initial_guess": [0.0, 80.0, 30.0], "mass": 4e3, "inertia": [2e4, 3e4, 2e4],
                     "hydrostatics": {"level": 30.0, "heave": 1e4, "roll": 2e4, "pitch": 2e4}}},
    time=(10.0, 0.05),
    output={"every": 1.0, "points": 11, "errors": True, "exact": True, "elevation": [[1.0, 2.0], [3.0, 4.0]],
            "history": {"one": [20.0, 30.0]}}
)  # fmt: skip
SCENE["points"]["mast"] = {"body": "spar", "place": [0.0, 0.0, -2.0]}
NONSENSE = (
    "nonsense",
    "",
    -1.0,
    0.0,
    1e30,
    1e-40,
    float("nan"),
    float("inf"),
    True,
    None,
    [],
    {},
    [1.0],
    {"kind": "x"},
    [[]],
)


def places(node: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    if path:
        yield path
    for key, value in node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ():
        if isinstance(key, str) or key == 1:  # one entry of a vector speaks for the others
            yield from places(value, (*path, key))


def changed(path: tuple[str | int, ...], value: Any) -> dict[str, Any]:
    scene = copy.deepcopy(SCENE)
    node: Any = scene
    for key in path[:-1]:
        node = node[key]
    node[path[-1]] = value
    return scene


def test_the_scene_itself_is_read() -> None:
    assert as_scene(SCENE)


@pytest.mark.parametrize("path", list(places(SCENE)), ids=dotted)
def test_nonsense_is_refused_in_words_or_read(path: tuple[str | int, ...]) -> None:
    refused = 0
    for nonsense in NONSENSE:
        try:
            as_scene(changed(path, nonsense))
        except SceneError as error:
            refused += 1
            assert all(x.expected and x.where for x in error.complaints), str(error)
    assert refused >= len(NONSENSE) // 3


@pytest.mark.parametrize("path", [p for p in places(SCENE) if isinstance(p[-1], str)], ids=dotted)
def test_a_key_that_is_left_out_is_refused_or_not_needed(path: tuple[str | int, ...]) -> None:
    scene = copy.deepcopy(SCENE)
    node: Any = scene
    for key in path[:-1]:
        node = node[key]
    del node[path[-1]]
    try:
        as_scene(scene)
    except SceneError as error:
        assert all(x.expected and x.where for x in error.complaints), str(error)


def test_names_with_blanks_around_them_are_refused() -> None:
    """`m` and `m ` became one, and a line was dropped."""
    line = line_between("a", "b", {"length": 100, "mass": 2}, model="catenary")
    points = {"a": {"position": [0, 0, 0]}, "b": {"position": [80, 0, 0]}}
    with pytest.raises(SceneError, match="a name"):
        as_scene(network_scene(points, {"m": line, "m ": line}))
