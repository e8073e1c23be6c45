"""Derivatives from the nodes by which results stand, against those from all nodes of the line."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.designs import line_at_rest
from hybrid.designs.sensitivity import at_rest
from hybrid.scene.read import as_scene
from tests.designs.test_derivatives import LINE, SEA, pinned, scene
from tests.designs.test_gradients import CLAMP, OF, SECTION
from tests.designs.test_system_derivatives import BUOY, moored

WATER = {"fluid": SEA["fluid"]}
FLOATED = scene(LINE, CLAMP, pinned(200, 5, 10), "rod", 240, WATER)
FLOATED["cable"] |= {"attachments": [{"kind": "float", "at": 90, "buoyancy": 2000, "mass": 20}]}
HINGED = scene(LINE | {"bending_stiffness": 3e4}, pinned(0, 0, 0), pinned(150, 0, 10), "catenary", 240, WATER)
CASES: dict[str, tuple[Any, list[str], list[str]]] = {
    "a bed": (scene(LINE, pinned(0, 0, -100), pinned(205, 0, 0), "rod", 240, SEA), OF,
              [*SECTION, "ends.end.position[0]"]),
    "a float": (FLOATED, [*OF, "max tension"], [*SECTION, "cable.attachments[0].buoyancy", "environment.gravity"]),
    "layers at ends of a catenary": (HINGED, ["curvature@3", "max curvature", "tension@end", "position.z@60"], SECTION),
    "a buoy": (moored(BUOY, True), ["east/tension@end", "max hose/curvature", "north/reaction_start.x"],
               ["lines.east.sections[0].length", "points.top.volume", "points.vessel.position[2]"]),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_far_nodes_do_not_count(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    tables, of, keys = CASES[case]
    if case == "a buoy":
        tables = tables | {"lines": {name: x | {"mesh": {"cells": 200}} for name, x in tables["lines"].items()}}
    rest = at_rest(as_scene(tables), of)
    found, lines = rest.by(keys), rest.lines
    assert all(x._near is not None for x in lines if x.wanted)
    monkeypatch.setattr(line_at_rest, "MANY", 10**9)
    least = 1e-3 * np.abs(rest.values) / np.array([[abs(rest.number(key)) or 1.0] for key in keys])
    assert (np.abs(found - rest.by(keys)) <= 1e-7 * np.maximum(np.abs(found), least)).all()


def test_what_is_of_the_whole_line_is_taken_from_it() -> None:
    rest = at_rest(hybrid.validate_scene(CASES["a bed"][0]), ["contact_force", "tension@0"])
    rest.by(SECTION)
    assert rest.lines[0]._near is None


def test_the_curvature_that_fades_at_ends_goes_by_the_stiffness() -> None:
    """Of catenaries: by differences of equilibria, whose shape does not change with the stiffness."""
    made, key = hybrid.validate_scene(HINGED), "cable.sections[0].bending_stiffness"
    value, more, less = (at_rest(made if x == 1.0 else _stiffer(x), ["curvature@3"]) for x in (1.0, 1.001, 0.999))
    theirs = (more.values - less.values) / (0.002 * 3e4)
    np.testing.assert_allclose(value.by([key])[0], theirs, rtol=1e-4)
    assert abs(theirs[0] * 3e4 / value.values[0]) > 0.01


def _stiffer(part: float) -> hybrid.Scene:
    section = LINE | {"bending_stiffness": 3e4 * part}
    return hybrid.validate_scene(scene(section, pinned(0, 0, 0), pinned(150, 0, 10), "catenary", 240, WATER))
