"""Derivatives beside free bodies, and points that lines are clamped to, against differences of equilibria."""

from __future__ import annotations

import numpy as np
import pytest

import hybrid
from hybrid.designs import network_at_rest
from hybrid.designs.network_at_rest import at_rest
from hybrid.designs.numbers_and_results import with_number
from hybrid.model.nearby import seats_know_no_shape, shaped_anew
from hybrid.model.network import NetworkResolution, bodies_of, build_network
from hybrid.scene.read import as_scene
from tests.designs.differences import agree

# --- Derivatives of several lines against differences of equilibria ---

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


# --- beside free bodies, and points that lines are clamped to ---

HULL = {
    "mass": 5e3, "inertia": [1e4, 1e4, 1e4], "volume": 30.0, "centre": [0.1, 0, -1.0],
    "centre_of_buoyancy": [0, 0.05, 0.5], "moment": [1e4, 2e4, 0], "initial_guess": [0, 0, 0],
}  # fmt: skip
FLOAT = {
    "mass": 2e4, "inertia": [1e5, 1e5, 1e5], "initial_guess": [0, 0, 27],
    "hydrostatics": {"level": 28.0, "heave": 3e4, "roll": 2e5, "pitch": 3e5},
}  # fmt: skip
SPAR = {
    "mass": 3e3, "inertia": [1e4, 1e4, 1e4], "volume": 1.0, "centre": [0.1, 0, -1.0], "force": [0, 0, 1.5e5],
    "initial_guess": [0, 0, 24],
    "members": [{"start": [0, 0, -9], "end": [0, 0, 9], "diameter": 2.0, "drag": 1.0, "axial_drag": 0.1}],
}  # fmt: skip
SHEARED = [
    {"z": -100, "velocity": [0.1, 0, 0]},
    {"z": 0, "velocity": [0.4, 0.1, 0]},
    {"z": 30, "velocity": [1.2, 0.3, 0]},
]
ROD = HOSE | {"torsional_stiffness": 300.0}
CLAMPED = {"kind": "clamped", "tangent": [1, 0, 1]}


def held_by_three(body, length=185.0, **hose):
    """A body on three lines, each at its own place, and a hose from it that is clamped there."""
    places = {"east": [3, 0, -2], "north": [-1.5, 2.6, -2], "south": [-1.5, -2.6, -2]}
    points = {x: {"position": place} for x, place in ANCHORS.items()}
    points |= {f"at_{x}": {"body": "hull", "place": place} for x, place in places.items()}
    section = CHAIN | {"length": length}
    lines = {x: {"start": x, "end": f"at_{x}", "sections": [section], "mesh": {"cells": 20}} for x in ANCHORS}
    if hose:
        points |= {"out": {"body": "hull", "place": [1, 0.5, 1]}, "vessel": {"position": [60, 0, 20]}}
        rod = {"start": "out", "end": "vessel", "sections": [ROD], "model": "rod", "mesh": {"cells": 30}}
        lines["hose"] = rod | {"connections": {"start": CLAMPED}} | hose
    return {"environment": SEA, "points": points, "lines": lines, "bodies": {"hull": body}}


def one_fairlead():
    """Nothing holds the body against turning about the vertical."""
    tables = held_by_three(HULL | {"moment": [0, 0, 0]})
    for name in ANCHORS:
        tables["points"][f"at_{name}"]["place"] = [0, 0, -2]
    return tables


def two_bodies():
    """A hose whose tension makes a torque, clamped to two bodies."""
    hose = {"sections": [ROD | {"tension_torque": 0.01}]}
    hose["connections"] = {"start": CLAMPED | {"normal": [0, 1, 0]}, "end": {"kind": "clamped", "tangent": [1, 0, 0.6]}}
    tables = held_by_three(HULL, **hose)
    tables["bodies"]["ship"] = FLOAT | {"initial_guess": [70, 0, 27]}
    tables["points"] |= {
        "vessel": {"body": "ship", "place": [-1, 0, -2]},
        "fair": {"body": "ship", "place": [1, 0, -2]},
    }
    tables["points"]["far"] = {"position": [150, 20, -100]}
    chain = {"start": "far", "end": "fair", "sections": [CHAIN | {"length": 165.0}], "mesh": {"cells": 20}}
    tables["lines"]["hold"] = chain
    return tables


def without_normals():
    """The same hose, of which neither end says where its material axis is, to a ship that lies askew first."""
    tables = two_bodies()
    tables["lines"]["hose"]["connections"] = {"start": CLAMPED, "end": {"kind": "clamped", "tangent": [1, 0, 0.6]}}
    tables["bodies"]["ship"]["initial_rotation"] = [5, 3, 10]
    return tables


def clamped_to_a_point(**end):
    """Two lines that a free point with mass and volume turns with; end: a clamp of the first at its other end."""
    tables = moored(BUOY, True)
    clamp, rod = {"connections": {"start": {"kind": "clamped"}}}, {"model": "rod", "mesh": {"cells": 20}}
    tables["points"]["weight"] = {"kind": "free", "initial_guess": [0, 0, -20], "mass": 100.0}
    tables["lines"]["hose"] |= clamp | rod | {"sections": [ROD]}
    tail = {"start": "top", "end": "weight", "sections": [ROD | {"length": 20.0}]}
    tables["lines"]["tail"] = clamp | rod | tail
    if end:
        tables["lines"]["hose"]["connections"] = clamp["connections"] | {"end": {"kind": "clamped"} | end}
    return tables


def spar():
    """Members in a current that changes with height, through the surface."""
    tables = held_by_three(SPAR, 200.0)
    tables["environment"] = SEA | {"fluid": SEA["fluid"] | {"current": {"kind": "profile", "table": SHEARED}}}
    return tables


OF = ["east/tension@end", "north/reaction_start.x", "south/position.z@end", "south/reaction_end.x"]
OF_HOSE = [*OF, "max hose/curvature", "hose/tension@start", "hose/position.z@47"]
SCENES = {
    "a body": (held_by_three(HULL), OF, [
        "bodies.hull.mass", "bodies.hull.centre[0]", "points.at_east.place[2]", "lines.east.sections[0].length",
        "environment.fluid.current[1]",
    ]),
    "what floats": (held_by_three(FLOAT), OF, [
        "bodies.hull.hydrostatics.pitch", "bodies.hull.hydrostatics.level", "points.east.position[0]",
    ]),
    "a clamp": (held_by_three(HULL, mesh={"cells": 30}), OF_HOSE, [
        "lines.hose.connections.start.tangent[0]", "points.out.place[0]", "lines.hose.sections[0].bending_stiffness",
        "bodies.hull.moment[1]",
    ]),
    "one fairlead": (one_fairlead(), OF, ["lines.east.sections[0].length", "bodies.hull.centre[0]"]),
    "two bodies": (two_bodies(), OF_HOSE, ["lines.hose.sections[0].length", "bodies.ship.hydrostatics.roll"]),
    "a point": (clamped_to_a_point(), [*OF_HOSE, "tail/tension@start"], [
        "points.top.volume", "points.weight.mass", "lines.hose.sections[0].length", "points.vessel.position[2]",
    ]),
    "without normals": (without_normals(), OF_HOSE, [
        "lines.hose.connections.end.tangent[2]", "lines.hose.sections[0].torsional_stiffness",
    ]),
    "twist that hangs on first shapes": (clamped_to_a_point(tangent=[1, 0, 1]), OF_HOSE, [
        "points.weight.mass", "lines.hose.sections[0].length",
    ]),
    "twist that is given": (clamped_to_a_point(tangent=[1, 0, 1], normal=[0, 1, 0.2], turns=0.1), OF_HOSE, [
        "points.weight.mass", "lines.hose.sections[0].length", "lines.hose.connections.end.turns",
    ]),
    "members": (spar(), OF, [
        "bodies.hull.members[0].diameter", "bodies.hull.force[2]", "points.at_east.place[2]", "environment.fluid.surface",
    ]),
}  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("what", SCENES)
def test_differences_of_equilibria(what):
    """Bodies shift and turn with what holds them."""
    agree(*SCENES[what], 3e-6, (3e-5,), with_number)


@pytest.mark.parametrize("what", ["a clamp", "two bodies", "a point", "without normals", "twist that is given"])
def test_arrays_of_clamped_lines_are_those_of_lines_that_are_built_anew(what, monkeypatch):
    """No line is built for a number where directions say how it is seated; all are where first shapes do."""
    tables, of, keys = SCENES[what]
    made, built = as_scene(tables), []
    rest = at_rest(made, of)
    monkeypatch.setattr(network_at_rest, "shaped_anew", lambda *x: built.append(1) or shaped_anew(*x))
    ours = rest.by(keys)
    assert not built
    monkeypatch.setattr(network_at_rest, "seats_know_no_shape", lambda *_: False)
    anew = rest.by(keys)
    assert built
    np.testing.assert_allclose(ours, anew, rtol=1e-7, atol=1e-9 * np.abs(anew).max())


@pytest.mark.parametrize("what", ["two bodies", "without normals", "twist that hangs on first shapes"])
def test_lines_that_are_built_alone_are_those_of_the_whole(what):
    tables, _, _ = SCENES[what]
    network = as_scene(tables)
    resolution = NetworkResolution.first(network)
    whole = build_network(network, resolution)
    model, seats = shaped_anew(network, ["hose"], bodies_of(network), resolution)["hose"]
    theirs, l = whole.models[whole.names.index("hose")], whole.names.index("hose")
    np.testing.assert_array_equal(seats, whole.seats[l])
    assert np.abs(seats).max() > 0.0
    np.testing.assert_array_equal(model.ends.values.frame, theirs.ends.values.frame)
    for name, ours, x in zip(model.line._fields, model.line, theirs.line, strict=True):
        np.testing.assert_array_equal(ours, x, err_msg=name)


@pytest.mark.parametrize("clamped", [False, True])
def test_numbers_that_others_have_to_match_are_refused(clamped):
    """Lengths of a section and of zones, of a line that turns freely at a point, or is clamped to a body."""
    tables = held_by_three(HULL, mesh={"cells": 30}) if clamped else moored(BUOY, True)
    hose = tables["lines"]["hose"]
    del hose["mesh"]
    hose["model"] = {"kind": "zones", "zones": [{"rod": 40.0, "cells": 15}, {"catenary": 60.0, "cells": 15}]}
    rest = at_rest(as_scene(tables), ["hose/tension@start"])
    for key in ("lines.hose.sections[0].length", "lines.hose.model.zones[0].rod"):
        with pytest.raises(hybrid.SceneError, match="a number that may change by itself"):
            rest.by([key])
    assert rest.by(["lines.hose.sections[0].mass"])[0, 0] != 0.0


def test_what_hangs_on_first_shapes():
    def known(tables, name="hose"):
        return seats_know_no_shape(as_scene(tables), name)

    assert known(two_bodies()) and known(without_normals()) and known(clamped_to_a_point())
    assert not known(clamped_to_a_point(tangent=[1, 0, 1])) and known(
        clamped_to_a_point(tangent=[1, 0, 1], normal=[0, 1, 0])
    )
    assert not known(clamped_to_a_point(tangent=[1, 0, 1], normal=[0, 1, 0], swivel=True, bend_stiffness=10.0))
    back = without_normals()  # opposite tangents know no short way from one to the other
    back["bodies"]["ship"]["initial_rotation"] = [0, 0, 0]
    back["lines"]["hose"]["connections"]["end"] = {"kind": "clamped", "tangent": [-1, 0, -1]}
    assert not known(back)
    end_alone = held_by_three(HULL, mesh={"cells": 30})
    hose = end_alone["lines"]["hose"]
    hose |= {"start": "vessel", "end": "out", "connections": {"end": {"kind": "clamped", "tangent": [-1, 0, -1]}}}
    assert not known(end_alone)
    hose["connections"] = {"end": {"kind": "clamped", "tangent": [-1, 0, -1], "normal": [0, 1, 0]}}
    assert known(end_alone)


TORQUES = {
    "stiffness": {},
    "table": {"tension_strain": [[0, 0], [0.01, 2e4], [0.03, 2e5]], "axial_stiffness": None},
    "rope": {"dynamic_stiffness": {"constant": 2e7, "per_tension": 20.0, "relaxation_time": 10.0}},
}  # fmt: skip


def with_torque(law):
    """A cable in a current, clamped at both ends, whose tension makes a torque."""
    section = {key: x for key, x in (ROD | {"tension_torque": 0.05} | law).items() if x is not None}
    start = {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, 1], "normal": [0, 1, 0]}
    end = {"kind": "clamped", "position": [60, 0, 20], "tangent": [1, 0, 0.6]}
    return hybrid.validate_scene({
        "environment": {"fluid": SEA["fluid"]}, "cable": {"sections": [section]}, "ends": {"start": start, "end": end},
        "initial": "equilibrium", "model": "rod", "mesh": {"cells": 16},
    })  # fmt: skip


@pytest.mark.parametrize("law", TORQUES)
def test_torque_of_tension(law):
    """Without the tension of the cell after next, height by mass was off by a fifth, and twist by an eighth."""
    keys = ["cable.sections[0].mass", "ends.end.position[0]", "cable.sections[0].tension_torque"]
    agree(with_torque(TORQUES[law]), ["tension@0", "max curvature", "position.z@50", "twist@50"], keys, 1e-5)
