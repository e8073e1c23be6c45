"""Derivatives at rest against closed forms, differences of equilibria, and each other."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest
from problems_sea import grounded_catenary
from typer.testing import CliRunner

import hybrid
from hybrid.cli.commands import app
from hybrid.designs.network_at_rest import at_rest
from hybrid.designs.numbers_and_results import allowed, changed_scene, number_of, with_number
from hybrid.errors import SceneError
from hybrid.scene.base import Invalid
from hybrid.scene.read import as_scene
from tests.designs.differences import agree
from tests.scenes import cable_scene
from tests.scenes import pinned_at as pinned

G = 9.81


def scene(section, start, end, model, cells, environment=None, **more):
    around = {"gravity": G} | (environment or {})
    return cable_scene(section, start, end, environment=around, model=model, mesh=cells) | more


def test_a_hanging_line():
    """Tension at the top m g L + F, and the length L + (m g L/2 + F) L/EA: all derivatives in closed form."""
    m, L, EA, F = 5.0, 40.0, 1e6, 300.0
    section = {"length": L, "mass": m, "axial_stiffness": EA}
    tables = scene(section, pinned(0, 0, 0), {"kind": "free", "force": [0, 0, -F]}, "catenary", 20)
    keys = [f"cable.sections[0].{x}" for x in ("mass", "length", "axial_stiffness")]
    found = {
        (x.of, x.by.rsplit(".")[-1]): x for x in hybrid.sensitivity(tables, ["reaction_start.z", "position.z@40"], keys)
    }
    top = {name: found["reaction_start.z", name] for name in ("mass", "length", "axial_stiffness")}
    assert top["mass"].derivative == pytest.approx(G * L, rel=1e-9)
    assert top["length"].derivative == pytest.approx(G * m, rel=1e-9)
    assert abs(top["axial_stiffness"].derivative) < 1e-12
    assert top["mass"].elasticity == pytest.approx(m * G * L / (m * G * L + F), rel=1e-9)
    tip = {name: found["position.z@40", name].derivative for name in ("mass", "axial_stiffness")}
    assert tip["mass"] == pytest.approx(-G * L * L / 2.0 / EA, rel=1e-6)
    assert tip["axial_stiffness"] == pytest.approx((m * G * L / 2.0 + F) * L / EA**2, rel=1e-6)


def test_a_cantilever():
    """Its tip sinks by w L^4/8EI: d(tip)/dEI = w L^4/8EI^2; order two, and the error figure has the size of the error."""
    w, L, EI = 0.02, 2.0, 5.0
    section = {"length": L, "mass": w / G, "bending_stiffness": EI, "torsional_stiffness": EI}
    start = {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, 0]}
    exact, off = w * L**4 / 8.0 / EI**2, []
    for cells in (20, 40):
        tables = scene(section, start, {"kind": "free"}, "rod", cells)
        (found,) = hybrid.sensitivity(tables, ["position.z@2"], ["cable.sections[0].bending_stiffness"])
        off.append(abs(found.derivative / exact - 1.0))
        assert found.elasticity == pytest.approx(-1.0, rel=1e-4)
        assert 0.5 * off[-1] < found.error / exact < 3.0 * off[-1] + 1e-6
    assert 1.8 < math.log2(off[0] / off[1]) < 2.2


SEA = {"fluid": {"density": 1025, "current": [0.3, 0.1, 0]}, "seabed": {"z": -100, "stiffness": 5e3}}
LINE = {
    "length": 250.0, "mass": 20.0, "diameter": 0.05, "axial_stiffness": 2e8, "bending_stiffness": 2e3,
    "torsional_stiffness": 2e3, "drag": {"normal": 1.2},
}  # fmt: skip


@pytest.mark.parametrize("model", ["catenary", "rod"])
def test_differences_of_equilibria_on_the_bed(model):
    """Of a line that touches down in a current."""
    keys = [f"cable.sections[0].{x}" for x in ("mass", "diameter", "axial_stiffness")]
    of = ["tension@250", "position.z@125", "reaction_end.x", *(["max curvature"] if model == "rod" else [])]
    tables = scene(LINE, pinned(0, 0, -100), pinned(205, 0, 0), model, 100, SEA)
    agree(tables, of, [*keys, "environment.seabed.stiffness"], 2e-5, (1e-4,))


def results(scene, of):
    return np.array(at_rest(scene, of).values)


@pytest.mark.parametrize("part", ["sections", "float"])
def test_the_largest_curvature_at_a_jump(part):
    """Where curvature has two values, no parabola goes through both: the largest is that of the equilibrium, and its

    slope that of equilibria on nodes that go along.  Places at nodes see the cells to both sides alike.
    """
    heavy, light = ({"length": x, "mass": m, "axial_stiffness": 1e6} for x, m in ((40.0, 20.0), (60.0, 8.0)))
    tables = scene([heavy, light], pinned(0, 0, 0), pinned(75, 0, 5), "catenary", 40)
    if part == "float":
        tables["cable"] = {"sections": [heavy | {"length": 100.0, "diameter": 0.05}]}
        tables["environment"]["fluid"] = {"density": 1025}
        tables["cable"]["attachments"] = [{"kind": "float", "at": 40.0, "buoyancy": 3000.0, "mass": 20.0}]
    made, key = hybrid.validate_scene(tables), "cable.sections[0].length"
    of = "max curvature", "position.z@45"
    rest, still = at_rest(made, of), hybrid.static(made)
    assert rest.values[0] == pytest.approx(np.nanmax(still.curvature[-1]), rel=1e-6)
    number = rest.number(key)
    more, less = (at_rest(changed_scene(made, key, number + x), of, 1.0, rest.places).values for x in (1e-4, -1e-4))
    np.testing.assert_allclose(rest.by([key])[0], (more - less) / 2e-4, rtol=1e-5)


@pytest.mark.parametrize("key", ["cable.sections[0].length", "cable.sections[0].mass", "ends.end.position[0]"])
@pytest.mark.parametrize("dynamic", [None, {"constant": 2e7, "per_tension": 10.0, "relaxation_time": 60.0}])
def test_a_rope_answers_as_it_stretches_at_rest(key, dynamic):
    """With the slope of its table at its tension, not that of quick motions."""
    rope = {"length": 205.0, "mass": 20.0, "tension_strain": [[0.0, 0.0], [0.01, 2e4], [0.03, 2e5]]}
    rope |= {"dynamic_stiffness": dynamic} if dynamic else {}
    tables = scene(rope, pinned(0, 0, 0), pinned(200, 0, 10), "catenary", 40)
    agree(tables, ["tension@end", "position.z@100"], [key], 1e-6)


def test_a_rod_that_turns_freely_about_its_axis_has_derivatives():
    """Pinned at both ends, with inertia of its sections: nothing but the spring that a rod is lent holds its spin."""
    rope = {"length": 60.0, "mass": 3.0, "diameter": 0.04, "axial_stiffness": 1e6, "bending_stiffness": 200.0}
    rope |= {"torsional_stiffness": 200.0, "drag": {"normal": 1.2, "tangential": 0.03}, "rotary_inertia": [0.01, 0.02]}
    rope |= {"dynamic_stiffness": {"constant": 2e6, "per_tension": 20.0, "relaxation_time": 20.0}}
    tables, of = scene(rope, pinned(0, 0, -30), pinned(36, 3, -2), "rod", 30, SEA), ["tension@end", "reaction_start.x"]
    rest = agree(tables, [*of, "max curvature"], ["cable.sections[0].mass", "ends.end.position[1]"], 2e-6)
    torque = np.where(np.flatnonzero(rest._network.lines[0].free) % 5 == 4, 1.0 / 30.0, 0.0)
    assert 1e3 < np.abs(rest._factors.solve(torque)).max() < 1e8  # rad for 1 N m; without the springs 1e12 and more


def test_the_end_stays_the_end_when_the_length_changes():
    """The lower end of a hanging line sinks by dL and its stretch; a place by its arc length stays where it is."""
    m, L, EA = 5.0, 40.0, 1e6
    section = {"length": L, "mass": m, "axial_stiffness": EA}
    tables = scene(section, pinned(0, 0, 0), {"kind": "free"}, "catenary", 20)
    key = "cable.sections[0].length"
    end, same, inside = (
        hybrid.sensitivity(tables, [name], [key])[0].derivative
        for name in ("position.z@end", "position.z@40", "position.z@20")
    )
    assert end == same == pytest.approx(-1.0 - m * G * L / EA, rel=1e-7)
    assert inside == pytest.approx(-m * G * 20.0 / EA, rel=1e-4)


def test_the_tension_at_a_body_at_the_end_by_the_length():
    """It is the weight of the body, whatever the length; that of the start has all of the line, too."""
    body = {"kind": "body", "mass": 60.0}
    section = {"length": 40.0, "mass": 5.0, "axial_stiffness": 1e6}
    tables = scene(section, pinned(0, 0, 0), body, "catenary", 20)
    found = hybrid.sensitivity(tables, ["tension@end", "tension@start"], ["cable.sections[0].length"])
    assert found[0].result == pytest.approx(60.0 * G, rel=1e-9) and abs(found[0].derivative) < 1e-6
    assert found[1].derivative == pytest.approx(5.0 * G, rel=1e-6)


@pytest.mark.parametrize("key", ["environment.seabed.stiffness", "cable.sections[0].bending_stiffness"])
def test_a_jump_at_an_anchor_on_the_bed_is_in_no_derivative(key):
    """The force at a pinned rod's end jumps where that passes the edge of the bed, by rounding: 8 N of 1154."""
    rod = {"length": 253.0, "mass": 12.8, "diameter": 0.074, "axial_stiffness": 1.6e6, "drag": {"normal": 1.2}}
    rod |= {"bending_stiffness": 1.2e4, "torsional_stiffness": 1.2e4}
    bed = -83.5340954497752
    sea = {"fluid": {"density": 1025, "current": [0.22, 0.03, 0]}, "seabed": {"z": bed, "stiffness": 4038.8}}
    made = hybrid.validate_scene(scene(rod, pinned(0, 0, bed), pinned(222, 15, 0), "rod", 40, sea))
    of = ["tension@0", "reaction_start.z"]
    rest = at_rest(made, of)
    elastic = rest.by([key])[0] * rest.number(key) / rest.values[0]
    assert np.abs(elastic).max() < 0.01


def test_numbers_that_others_match_are_refused():
    parts = {"kind": "zones", "zones": [{"rod": 60.0, "cells": 20}, {"catenary": 190.0, "cells": 20}]}
    tables = scene(LINE, pinned(0, 0, -60), pinned(205, 0, 0), parts, None, SEA) | {"mesh": None}
    with pytest.raises(hybrid.SceneError, match="a number of what is computed"):
        hybrid.sensitivity(tables, ["tension@0"], ["model.zones[0].rod"])
    with pytest.raises(hybrid.SceneError, match="may change by itself"):
        hybrid.sensitivity(tables, ["tension@0"], ["cable.sections[0].length"])


def test_what_is_refused():
    tables = scene(LINE, pinned(0, 0, -100), pinned(205, 0, 0), "catenary", 40, SEA)
    key = "cable.sections[0].mass"
    for of, by, words in (
        ("tension", key, "a place or an extreme"),
        ("tension@999", key, "between 0 and 250 m"),
        ("tensoin@0", key, "one of .*tension"),
        ("tension.x@0", key, "no components"),
        ("max reaction_end.z", key, "one value for the whole line"),
        ("reaction_end.z@20", key, "one value for the whole line"),
        ("reaction_end.z@sections[0]", key, "one value for the whole line"),
        ("tension@0", "cable.sections[3].mass", "a key of the scene"),
        ("tension@0", "model", "a number"),
    ):
        with pytest.raises(hybrid.SceneError, match=words):
            hybrid.sensitivity(tables, [of], [by])


@pytest.mark.long
@pytest.mark.parametrize("cells", [{}, {"curvature_error": 0.02}])
def test_zones_that_move_stay_where_they_were_found(cells):
    """Of a line that bends at its clamp: differences of equilibria whose zones are the same, and near those of rods."""
    clamp = {"kind": "clamped", "position": [0, 0, -60], "tangent": [1, 0, 0]}
    adaptive = {"kind": "adaptive", "force_rod": [[0, 60]]} | cells
    tables = scene(LINE, clamp, pinned(205, 0, 0), adaptive, 100, SEA)
    of, made = ["tension@0", "position.z@100", "max curvature"], hybrid.validate_scene(tables)
    keys = [f"cable.sections[0].{x}" for x in ("mass", "bending_stiffness")]
    found = hybrid.sensitivity(tables, of, keys)
    rods = hybrid.sensitivity(tables | {"model": "rod"}, of, keys)
    for key in keys:
        (number,) = {x.number for x in found if x.by == key}
        both, zones = [], set()
        for part in (1.0 + 1e-4, 1.0 - 1e-4):
            changed = changed_scene(made, key, number * part)
            rest = hybrid.static(changed)
            zones.add(tuple(rest.zones[0]))
            both.append([x.result for x in hybrid.sensitivity(changed, of, keys[:1])])
        assert len(zones) == 1 and {x.kind for x in rest.zones[0]} == {"rod", "catenary"}
        slope = (np.array(both[0]) - both[1]) / (2e-4 * number)
        ours, theirs = (np.array([x.derivative for x in each if x.by == key]) for each in (found, rods))
        np.testing.assert_allclose(ours, slope, rtol=1e-4)
        np.testing.assert_allclose(ours[1:], theirs[1:], rtol=0.05)
        assert not np.allclose(ours, theirs, rtol=1e-8)


def test_a_result_that_is_sought_to_be_nothing_is_reached():
    """The end of a catenary of 21 m over 20 m is its lowest point where it hangs a (cosh(20/a) - 1), a sinh(20/a) = 21."""
    section = {"length": 21.0, "mass": 2.0, "axial_stiffness": 1e8}
    tables = scene(section, pinned(0, 0, 0), pinned(20, 0, -3), "catenary", 80)
    a = 36.8
    for _ in range(50):  # Newton
        a -= (a * math.sinh(20 / a) - 21) / (math.sinh(20 / a) - 20 / a * math.cosh(20 / a))
    found = hybrid.seek(tables, {"reaction_end.z": 0.0}, ["ends.end.position[2]"])
    assert found.numbers["ends.end.position[2]"] == pytest.approx(-a * (math.cosh(20 / a) - 1), rel=2e-3)
    assert abs(found.results["reaction_end.z"]) < 1e-6 * 2.0 * G * 21.0


def test_friction_that_has_settled_has_no_derivative():
    bed = SEA | {"seabed": SEA["seabed"] | {"friction": 0.5}}
    tables = scene(LINE, pinned(0, 0, -100), pinned(205, 0, 0), "catenary", 40, bed)
    tables["initial"] = {"kind": "equilibrium", "friction": "settled"}
    with pytest.raises(hybrid.SceneError, match="friction has settled"):
        hybrid.sensitivity(tables, ["tension@0"], ["cable.sections[0].mass"])
    with pytest.raises(hybrid.SceneError, match="friction has settled"):
        hybrid.seek(tables, {"tension@0": 1e3}, ["cable.sections[0].mass"])


def test_the_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    tables = scene(LINE, pinned(0, 0, -100), pinned(205, 0, 0), "catenary", 40, SEA)
    (tmp_path / "line.yaml").write_text(hybrid.scene_text(hybrid.validate_scene(tables)))
    told = CliRunner().invoke(app, ["sensitivity", "line.yaml", "--of", "tension@250"])
    assert told.exit_code == 0, told.output
    lines = [x for x in told.output.splitlines() if "cable.sections[0]." in x]
    assert "length" in lines[0] and len(lines) == 6  # the strongest first
    told = CliRunner().invoke(
        app, ["sensitivity", "line.yaml", "--of", "tension@250", "--by", "ends.end.position[0]", "--json"]
    )
    (row,) = [x for x in map(json.loads, told.output.splitlines()) if "elasticity" in x]
    assert row["elasticity"] == pytest.approx(5.4, abs=0.3)


def test_length_and_place_for_a_tension_and_a_height():
    """Two numbers for two results; the equilibrium with them has these."""
    tables = scene(LINE, pinned(0, 0, -100), pinned(205, 0, 0), "catenary", 60, SEA)
    targets = {"tension@240": 25e3, "touchdown": 140.0}
    found = hybrid.seek(tables, targets, ["cable.sections[0].length", "ends.end.position[0]"])
    assert found.equilibria < 12
    result = hybrid.static(found.scene)
    edges = np.asarray(result.touchdown[-1])
    assert edges[np.isfinite(edges)][-1] == pytest.approx(140.0, abs=1e-4)
    assert found.results == pytest.approx(targets, rel=1e-7)
    assert found.scene.cable.length == found.numbers["cable.sections[0].length"]


def test_what_cannot_be_reached_is_said():
    section = {"length": 40.0, "mass": 5.0, "axial_stiffness": 1e6}
    tables = scene(section, pinned(0, 0, 0), {"kind": "free", "force": [0, 0, -300.0]}, "catenary", 10)
    with pytest.raises(hybrid.ComputationError, match=r"reaction_start.z comes to 2262, not 5000"):
        hybrid.seek(tables, {"reaction_start.z": 5000.0}, ["cable.sections[0].axial_stiffness"])
    with pytest.raises(hybrid.SceneError, match="as many keys as targets"):
        hybrid.seek(tables, {"reaction_start.z": 5000.0}, [])
    (length,) = hybrid.seek(tables, {"reaction_start.z": 5000.0}, ["cable.sections[0].length"]).numbers.values()
    assert length == pytest.approx(4700.0 / 5.0 / G, rel=1e-7)


def test_the_command_seek(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    tables = scene(LINE, pinned(0, 0, -100), pinned(205, 0, 0), "catenary", 40, SEA)
    (tmp_path / "line.yaml").write_text(hybrid.scene_text(hybrid.validate_scene(tables)))
    asked = ["seek", "line.yaml", "--target", "tension@240=25000", "--by", "cable.sections[0].length", "-o", "new.yaml"]
    told = CliRunner().invoke(app, asked)
    assert told.exit_code == 0, told.output
    assert "25000" in told.output and "cable.sections[0].length" in told.output
    found = hybrid.load_scene(tmp_path / "new.yaml").cable.length
    assert hybrid.static(tmp_path / "new.yaml", None).tension.max() > 25000 and 255 < found < 275
    assert CliRunner().invoke(app, ["seek", "line.yaml", "--target", "tension", "--by", "x"]).exit_code == 2


def chain_leg(cells: int) -> dict:
    """400 m of chain on a bed 100 m down, its upper end 370 m away."""
    section = {"length": 400, "mass": 100, "diameter": 0.12, "axial_stiffness": 5e8, "drag": {"normal": 2.4}}
    sea = {"fluid": {"density": 1025, "surface": 0}, "seabed": {"z": -100, "stiffness": 5e4}}
    return scene(section, pinned(0, 0, -100), pinned(370, 0, -5), "catenary", cells, sea)


def test_the_error_of_a_derivative_on_a_bed_covers_it():
    """It goes up and down with the cells (60, 100 and 120): by the length, -11915 N/m of an elastic catenary."""
    fine = hybrid.sensitivity(chain_leg(1600), ["tension@end"], ["cable.sections[0].length"])[0].derivative
    assert fine == pytest.approx(-11913.0, rel=1e-3)  # -11911 by hand
    for cells in (60, 100, 120):
        (found,) = hybrid.sensitivity(chain_leg(cells), ["tension@end"], ["cable.sections[0].length"])
        assert abs(found.derivative - fine) < 1.5 * found.error < 0.15 * abs(fine)


def lies(length: float, far: float, stretch: float) -> float:
    """Length on a hard level bed of a chain whose upper end is 95 m above it and `far` m from its anchor.

    stretch: w / EA, 1/m; elastic catenary (on the bed the pull is the same all along it).
    """
    return length - grounded_catenary(95.0, length, far, 1.0, 1.0 / stretch)[1]


@pytest.mark.parametrize("cells", [60, 100, 121])
def test_where_contact_begins_answers_as_the_line_does(cells):
    """From node to node it would answer by half of that: of a probe and of quantities of the scene, by a length, a place

    and what does nothing to it.
    """
    tables = chain_leg(cells)
    kinds = {"lie": {"kind": "touchdown", "end": "end"}, "far": {"kind": "layback", "end": "end"}}
    tables["output"] = {"quantities": kinds}
    keys = ["cable.sections[0].length", "ends.end.position[0]", "environment.seabed.stiffness"]
    found = {(x.of, x.by): x for x in hybrid.sensitivity(tables, ["touchdown", "lie", "far", "tension@end"], keys)}
    stretch, d = G * (100 - 1025 * math.pi * 0.03 * 0.12) / 5e8, 1e-3
    exact = (lies(400 + d, 370, stretch) - lies(400 - d, 370, stretch)) / (2 * d)
    by_place = (lies(400, 370 + d, stretch) - lies(400, 370 - d, stretch)) / (2 * d)
    for of, by, value in (("touchdown", keys[0], exact), ("lie", keys[0], exact), ("far", keys[0], -exact),
                          ("lie", keys[1], by_place), ("far", keys[1], 1.0 - by_place)):  # fmt: skip
        one = found[of, by]
        assert abs(one.derivative - value) < one.error + 0.01 * abs(value)
        assert one.error < 0.15 * abs(value) and one.way == "differences of equilibria, from cell to cell"
    still = found["lie", keys[2]]
    assert still.error == abs(still.derivative) and abs(still.elasticity) < 0.01
    assert found["tension@end", keys[0]].way == "factors of the equilibrium"


def test_where_contact_begins_on_graded_cells():
    """Of 39 cells up to 13 m long, 4 m where contact begins: from 200 equal ones it is within its error."""
    section = {"length": 250.0, "mass": 20.0, "diameter": 0.05, "axial_stiffness": 2e8, "bending_stiffness": 2e3}
    tables = scene([section], pinned(0, 0, -100), pinned(205, 0, 0), "rod", 200, SEA | {"fluid": {"density": 1025}})
    (fine,) = hybrid.sensitivity(tables, ["touchdown"], ["cable.sections[0].length"])
    graded = tables | {"mesh": None, "accuracy": "1%", "model": {"kind": "adaptive"}}
    (found,) = hybrid.sensitivity(graded, ["touchdown"], ["cable.sections[0].length"])
    assert abs(found.derivative - fine.derivative) < found.error < 0.1 * fine.derivative


@pytest.mark.parametrize("of", ["last touchdown", "mean far", "max touchdown_position.x"])
def test_where_contact_begins_in_a_motion_has_no_derivative(of):
    tables = chain_leg(60) | {"time": {"duration": 1.0, "step": 0.1}}
    tables["output"] = {"quantities": {"far": {"kind": "layback", "end": "end"}}}
    with pytest.raises(hybrid.SceneError, match="goes by the nodes that come to the bed"):
        hybrid.sensitivity(tables, [of], ["cable.sections[0].length"], motion=True)


def test_friction_that_is_left_out_is_said():
    tables, key = chain_leg(40), "cable.sections[0].mass"
    tables["environment"]["seabed"]["friction"] = 0.5
    (found,) = hybrid.sensitivity(tables, ["tension@end"], [key])
    assert found.way == "factors of the equilibrium, friction left out"
    (plain,) = hybrid.sensitivity(chain_leg(40), ["tension@end"], [key])
    assert plain._replace(way="") == found._replace(way="")


def test_options_may_be_repeated(tmp_path):
    """All of them count: the last one alone would leave out the others without a word."""
    (tmp_path / "leg.yaml").write_text(hybrid.scene_text(hybrid.validate_scene(chain_leg(60))))
    given = ["--of", "tension@0,tension@end", "--by", "cable.sections[0].length", "--by", "cable.sections[0].mass"]
    told = CliRunner().invoke(app, ["sensitivity", str(tmp_path / "leg.yaml"), *given, "--json"])
    rows = [json.loads(line) for line in told.output.splitlines() if '"derivative"' in line]
    assert [(x["of"], x["by"][-6:]) for x in rows] == [
        ("tension@0", "length"), ("tension@end", "length"), ("tension@0", "].mass"), ("tension@end", "].mass"),
    ]  # fmt: skip


@pytest.mark.parametrize("held", ["tangent", "tangent and normal"])
def test_directions_of_a_clamp(held):
    """A clamp turns as its directions turn, and takes the material axes of a strip along."""
    clamp = {"kind": "clamped", "position": [0, 0, -30], "tangent": [1, 0.3, 0.2]}
    section = {"length": 60.0, "mass": 6.0, "diameter": 0.06, "axial_stiffness": 1e6, "bending_stiffness": 300.0}
    keys = [f"ends.start.tangent[{k}]" for k in range(3)]
    if held != "tangent":
        clamp["normal"] = [0.1, 0.2, 1.0]
        section |= {"bending_stiffness": [300.0, 900.0], "torsional_stiffness": 200.0}
        section["intrinsic_curvature"] = [0.02, 0.01, 0.0]
        keys += [f"ends.start.normal[{k}]" for k in range(3)]
    tables = scene(section, clamp, pinned(50, 6, -28), "rod", 30, {"fluid": {"density": 1025}})
    of = ["tension@0", "position.z@31.7", "max curvature", "moment_start.y"]
    differ(hybrid.validate_scene(tables), of, keys)


@pytest.mark.parametrize("where", ["bed", "pipe"])
def test_where_a_line_lies(where):
    """In deep water a part of a depth is more than a line sinks into the bed: what it lies on is moved by less."""
    section = {"length": 60.0, "mass": 6.0, "diameter": 0.06, "axial_stiffness": 1e6, "bending_stiffness": 300.0}
    tables = scene(section, pinned(0, 0, -1000), pinned(50, 0, -998), "rod", 30, {"fluid": {"density": 1025}})
    if where == "bed":
        tables["environment"]["seabed"] = {"z": -1004.0, "slope": [0.05, 0.02], "stiffness": 2000.0}
        keys = ["environment.seabed.z", "environment.seabed.slope[0]"]
    else:
        pipe = {"kind": "cylinder", "at": [25, 0, -1012], "axis": [0, 1, 0], "radius": 4.0, "stiffness": 2e4}
        tables["obstacles"], keys = {"pipe": pipe}, ["obstacles.pipe.at[2]", "obstacles.pipe.radius"]
    differ(hybrid.validate_scene(tables), ["tension@0", "tension@20.3", "position.z@31.7"], keys)


def test_what_remembers_is_loaded_first_in_every_equilibrium():
    """Layers that have slipped, with moments by tension, and soil that has been pressed on: also results of moments."""
    section = {"length": 10.0, "mass": 4.0, "diameter": 0.05, "axial_stiffness": 1e6, "bending_stiffness": 200.0,
               "torsional_stiffness": 100.0, "stiffness_per_tension": 0.3,
               "bending_slip": [{"stiffness": 300.0, "moment": 5.0, "per_tension": 0.02}]}  # fmt: skip
    start = {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, 0]}
    keys = [f"cable.sections[0].{x}" for x in ("mass", "bending_slip[0].moment", "stiffness_per_tension")]
    keys += ["ends.end.position[2]"]
    of = ["tension@end", "position.z@4.1", "bending_moment@0", "bending_moment@0.6", "max curvature"]
    differ(hybrid.validate_scene(scene(section, start, pinned(9, 0, 1), "rod", 40)), of, keys)
    soil = SEA | {
        "seabed": {"z": -100, "soil": {"shear_strength": 500, "gradient": 900, "bearing": 6.0, "power": 0.25}}
    }
    made = hybrid.validate_scene(scene(LINE, pinned(0, 0, -100), pinned(205, 0, 0), "rod", 100, soil))
    keys = ["environment.seabed.z", "environment.seabed.soil.power", "cable.sections[0].mass"]
    differ(made, ["tension@250", "position.z@125", "max curvature", "reaction_end.x"], keys)


def differ(made, of, keys):
    """Derivatives are those of differences of equilibria on the same cells."""
    rest = at_rest(made, of)
    for key, ours in zip(keys, rest.by(keys), strict=True):
        number = rest.number(key)
        d = 1e-5 * min(abs(number), 1.0)
        more, less = (at_rest(changed_scene(made, key, number + x), of, 1.0, rest.places) for x in (d, -d))
        np.testing.assert_allclose(ours, (more.values - less.values) / (2.0 * d), rtol=2e-5, atol=1e-7, err_msg=key)


def test_the_curvature_that_fades_at_ends_goes_by_the_stiffness():
    """Of catenaries: by differences of equilibria, whose shape does not change with the stiffness."""
    hinged = scene(LINE | {"bending_stiffness": 3e4}, pinned(0, 0, 0), pinned(150, 0, 10), "catenary", 240,
                   {"fluid": SEA["fluid"]})  # fmt: skip
    made, key, of = hybrid.validate_scene(hinged), "cable.sections[0].bending_stiffness", ["curvature@3"]
    more, less = (results(changed_scene(made, key, 3e4 * x), of) for x in (1.001, 0.999))
    rest, theirs = at_rest(made, of), (more - less) / (0.002 * 3e4)
    np.testing.assert_allclose(rest.by([key])[0], theirs, rtol=1e-4)
    assert abs(theirs[0] * 3e4 / rest.values[0]) > 0.01


def test_a_number_that_switches_something_on():
    """Of which no derivative is known is refused as the scene with it is."""
    tables = scene(LINE, pinned(0, 0, -100), pinned(205, 0, 0), "rod", 40, SEA)
    with pytest.raises(hybrid.SceneError, match="stiffness_per_tension"):
        hybrid.sensitivity(tables, ["tension@0"], ["cable.sections[0].stiffness_per_tension"])


def test_what_no_equilibrium_is_found_of_is_said_of_the_cable():
    """As of the network that computes it, the line would have a name that the scene does not have."""
    rope = {"length": 40.0, "mass": 5.0, "axial_stiffness": 1e4}
    folded = scene(rope, pinned(0, 0, 0), pinned(0, 0, 30), "catenary", 20)
    with pytest.raises(hybrid.ComputationError, match="detail:   the ends are 0 m apart") as failed:
        hybrid.sensitivity(folded, ["tension@0"], ["cable.sections[0].length"])
    assert "line cable" not in str(failed.value) and not failed.value.line_name


# --- Numbers of scenes: what is put in place of them is what reading the scene with them gives ---

EXAMPLES = Path(__file__).parents[2] / "examples"


def keys(tables: object, path: str = "") -> Iterator[str]:
    if isinstance(tables, Mapping):
        for name, x in tables.items():
            yield from keys(x, f"{path}.{name}".lstrip("."))
    elif isinstance(tables, list | tuple):
        for k, x in enumerate(tables):
            yield from keys(x, f"{path}[{k}]")
    elif isinstance(tables, float):
        yield path


@pytest.mark.parametrize("name", ["touchdown", "laying", "s_tether", "irregular_sea", "rov_descent"])
def test_a_number_put_in_place_is_as_read(name):
    scene, same = as_scene(EXAMPLES / f"{name}.yaml"), 0
    for key in keys(scene.model_dump(mode="python")):
        number = number_of(scene, key) * (1.0 + 1e-5)
        try:
            read = changed_scene(scene, key, number)
        except SceneError:
            with pytest.raises(Invalid):
                allowed(with_number(scene, key, number))
            continue
        changed = with_number(scene, key, number)
        assert allowed(changed) == read and number_of(changed, key) == number, key
        same += 1
    assert same > 10


def test_what_does_not_match_is_not_allowed():
    scene = as_scene(EXAMPLES / "03_suspension_rod.yaml")
    with pytest.raises(Invalid):
        allowed(with_number(scene, "cable.sections[0].mass", -1.0))


@pytest.mark.parametrize("place", ["-1", "00", "1"])
def test_an_item_is_counted_from_the_start(place):
    """An item of a list written in another way would be none of the scene, and nothing would depend on it."""
    scene = as_scene(EXAMPLES / "03_suspension_rod.yaml")
    with pytest.raises(SceneError, match="a key of the scene that has a number"):
        number_of(scene, f"cable.sections[{place}].mass")


def test_a_number_of_things_is_none_to_differentiate_by():
    """Whole numbers, such as the seed of a sea, have no neighbours; numbers that are written without a point have."""
    scene = as_scene(EXAMPLES / "irregular_sea.yaml")
    for key in ("environment.fluid.waves.seed", "environment.fluid.waves.components"):
        with pytest.raises(SceneError, match="may change by a little"):
            number_of(scene, key)
    assert number_of(scene, "ends.start.position[0]") == scene.ends.start.position[0]
