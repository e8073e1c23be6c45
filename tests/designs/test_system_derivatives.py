"""Derivatives of several lines against differences of equilibria."""

from __future__ import annotations

import numpy as np
import pytest

import hybrid
from hybrid.designs.network_at_rest import at_rest
from hybrid.designs.numbers import with_number
from hybrid.scene.read import as_scene
from tests.designs.differences import agree

CHAIN = {"length": 185.0, "mass": 10.0, "diameter": 0.05, "axial_stiffness": 1e7, "drag": {"normal": 1.2}}
HOSE = {"length": 100.0, "mass": 10.0, "diameter": 0.08, "axial_stiffness": 1e7, "bending_stiffness": 400.0}
SEA = {
    "fluid": {"density": 1025, "surface": 30.0, "current": [0.5, 0.1, 0]},
    "seabed": {"z": -100.0, "stiffness": 1e4},
}
ANCHORS = {"east": [150.0, 0.0, -100.0], "north": [-75.0, 130.0, -100.0], "south": [-75.0, -130.0, -100.0]}
HELD = {"position": [0.0, 0.0, 0.0]}
BUOY = {"kind": "free", "initial_guess": [0.0, 0.0, 5.0], "mass": 1000.0, "volume": 20.0, "drag_area": 4.0}


def moored(top, hose=False):
    points = {name: {"position": place} for name, place in ANCHORS.items()} | {"top": top}
    lines = {x: {"start": x, "end": "top", "sections": [CHAIN], "mesh": {"cells": 20}} for x in ANCHORS}
    if hose:
        points["vessel"] = {"position": [60.0, 0.0, 20.0]}
        lines["hose"] = {"start": "top", "end": "vessel", "sections": [HOSE], "mesh": {"cells": 30}}
    return {"environment": SEA, "points": points, "lines": lines}


@pytest.mark.long
@pytest.mark.parametrize(
    ("hose", "keys"),
    [
        (False, ["lines.east.sections[0].length", "points.east.position[0]", "lines.north.sections[0].axial_stiffness"]),
        (True, ["points.top.volume", "points.vessel.position[2]", "lines.hose.sections[0].bending_stiffness",
                "lines.hose.sections[0].length", "environment.fluid.current[0]"]),
    ],
)  # fmt: skip
def test_lines_that_pull_at_a_buoy(hose, keys):
    """All forces and places answer to a number of any line, or of any point."""
    of = ["east/tension@end", "north/reaction_start.x", "south/position.z@end", "max east/tension"]
    of += ["max hose/curvature", "hose/tension@start"] if hose else []
    agree(moored(BUOY, hose), of, keys, 1e-6, (1e-4, 1e-3, 1e-5), with_number)


def test_results_are_those_of_the_equilibrium():
    made = as_scene(moored(BUOY, True))
    rest = at_rest(made, ["east/tension@end", "hose/position.z@start", "max hose/curvature", "north/reaction_start.z"])
    with hybrid.static(made) as found:
        hose = found.lines["hose"]
        whole = found.lines["east"].tension[-1][-1], hose.position[-1][0, 2], hose.curvature[-1].max()
        pull = found.lines["north"].reaction_start[-1][2]
    np.testing.assert_allclose(rest.values[[0, 1, 3]], [*whole[:2], pull], rtol=1e-9)
    assert rest.values[2] == pytest.approx(whole[2], rel=0.01)  # at nodes, and at output points


@pytest.mark.long
def test_pretension_of_a_mooring():
    """One number for each line; anchors that are not alike get other lengths; few equilibria."""
    tables = moored(HELD)
    tables["points"]["east"]["position"] = [160.0, 0.0, -100.0]
    targets = {f"{x}/tension@end": 25e3 for x in ANCHORS}
    found = hybrid.seek(tables, targets, [f"lines.{x}.sections[0].length" for x in ANCHORS])
    assert found.equilibria <= 8
    with hybrid.static(found.scene) as result:
        for name in ANCHORS:
            assert result.lines[name].tension[-1][-1] == pytest.approx(25e3, rel=1e-6)


def test_what_is_refused():
    key = "lines.east.sections[0].mass"
    for of, words in (("tension@end", "LINE/NAME@S"), ("west/tension@end", "east, north, south"),
                      ("east/tension@999", "between 0 and 185 m"), ("east/tensoin@0", "one of .*tension")):  # fmt: skip
        with pytest.raises(hybrid.SceneError, match=words):
            hybrid.sensitivity(moored(HELD), [of], [key])
    plain = moored({**BUOY, "drag_area": 0.0})
    for key, words in (("points.top.drag_area", "a little more, and less"), ("lines.east.mesh.cells", "is computed")):
        with pytest.raises(hybrid.SceneError, match=words):
            hybrid.sensitivity(plain, ["east/tension@end"], [key])


def test_a_named_quantity_of_a_line_is_a_result():
    """As of one cable; before, a network had results by the names of the program alone."""
    tables = moored(BUOY, True)
    tables["output"] = {"quantities": {"pull": {"kind": "vertical_force", "line": "east", "end": "start"}}}
    keys = ["lines.east.sections[0].mass"]
    of = ["east/pull", "east/reaction_start.z"]
    found = hybrid.sensitivity(tables, of, keys)
    ours, force = found
    assert abs(ours.result) == pytest.approx(abs(force.result), rel=1e-9)
    assert abs(ours.derivative) == pytest.approx(abs(force.derivative), rel=1e-6)
