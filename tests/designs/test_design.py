"""Designs against closed forms: what is found, prices of limits, refusals that say what is in the way."""

from __future__ import annotations

import json
import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq
from typer.testing import CliRunner

import hybrid
from hybrid.cli.commands import app
from hybrid.designs.design import Found, Identified
from hybrid.scene.read import one_line
from tests.combinations.pairs import as_network
from tests.scenes import cable_scene, pinned_at

pytestmark = pytest.mark.needs("simpleeval")

G = 9.81
HANGING = cable_scene(
    {"length": 40.0, "mass": 5.0, "axial_stiffness": 1e12}, pinned_at(0, 0, 0), "free", gravity=G, model="catenary",
    mesh=10
)  # fmt: skip
LENGTH, MASS = "cable.sections[0].length", "cable.sections[0].mass"
TOP = {"quantity": "tension", "at": "start"}


def test_length_of_an_inextensible_catenary_for_a_tension():
    """Ends level and 100 m apart: T = w a cosh(50 / a), length 2 a sinh(50 / a); on 400 cells to 1e-5."""
    ends = {k: {"kind": "pinned", "position": [x, 0, 0]} for k, x in (("start", 0.0), ("end", 100.0))}
    section = {"length": 110.0, "mass": 4.0}
    scene = HANGING | {"cable": {"sections": [section]}, "ends": ends, "mesh": {"cells": 400}}
    found = hybrid.design(
        scene, unknowns={"length": {"key": LENGTH, "low": 102, "high": 140}},
        targets={"top": {"quantity": "tension", "at": "end", "value": 4000.0}},
    )  # fmt: skip
    a = brentq(lambda a: 4.0 * G * a * math.cosh(50.0 / a) - 4000.0, 60.0, 500.0)
    assert found.numbers["length"] == pytest.approx(2.0 * a * math.sinh(50.0 / a), rel=2e-5)
    assert found.kept[0].active and found.minimised is None and found.equilibria < 12
    sought = hybrid.seek(scene, {"tension@end": 4000.0}, [LENGTH])
    assert sought.numbers[LENGTH] == pytest.approx(found.numbers["length"], rel=1e-8)


def test_stiffness_of_a_cantilever_for_a_deflection():
    """w L^4 / 8 EI, of a deflection of 1 % of the length, whose square it leaves out."""
    section = {
        "length": 2.0,
        "mass": 0.5,
        "axial_stiffness": 1e8,
        "bending_stiffness": 300.0,
        "torsional_stiffness": 1e3,
    }
    clamp = {"kind": "clamped", "position": [0, 0, 0], "tangent": [1, 0, 0]}
    scene = HANGING | cable_scene(section, clamp, "free", model="rod", mesh=80, initial=None)
    found = hybrid.design(
        scene, unknowns={"cable.sections[0].bending_stiffness": {"low": 50, "high": 5000}},
        targets={"tip": {"quantity": "position.z", "at": "end", "value": -0.02}},
    )  # fmt: skip
    (EI,) = found.numbers.values()
    assert pytest.approx(0.5 * G * 2.0**4 / (8 * 0.02), rel=1e-3) == EI


def test_an_optimum_with_its_multiplier():
    """The least of (mass - 6)^2 + ((length - 50) / 10)^2 where mass x length x g is at most 1962 N: by hand."""
    found = hybrid.design(
        HANGING, unknowns={"mass": {"key": MASS, "low": 1, "high": 20}, "length": {"key": LENGTH, "low": 10, "high": 90}},
        limits={"top": TOP | {"largest": 1962.0}}, minimise="(mass - 6)**2 + ((length - 50) / 10)**2",
    )  # fmt: skip

    def along(mass: float) -> float:  # slope of what is minimised along mass x length = 200
        length = 200.0 / mass
        return 2 * (mass - 6) - 2 * (length - 50) / 100 * 200.0 / mass**2

    mass = brentq(along, 4.0, 6.0)
    length = 200.0 / mass
    assert found.numbers == pytest.approx({"mass": mass, "length": length}, rel=1e-5)
    (top,) = found.kept
    assert top.active and top.finer == pytest.approx(1962.0, rel=1e-9)
    assert top.price == pytest.approx(2 * (mass - 6) / (G * length), rel=1e-4)  # less where more is allowed
    more = hybrid.design(
        HANGING, unknowns={"mass": {"key": MASS, "low": 1, "high": 20}, "length": {"key": LENGTH, "low": 10, "high": 90}},
        limits={"top": TOP | {"largest": 1972.0}}, minimise="(mass - 6)**2 + ((length - 50) / 10)**2",
    )  # fmt: skip
    assert more.minimised - found.minimised == pytest.approx(10 * top.price, rel=0.02)


def test_a_bound_and_its_price():
    found = hybrid.design(HANGING, unknowns={"length": {"key": LENGTH, "low": 10, "high": 90}}, minimise="-3*length")
    assert found.numbers["length"] == 90.0 and not found.kept
    (bound,) = found.bounds
    assert (bound.name, bound.which) == ("length", "high") and bound.price == pytest.approx(-3.0, rel=1e-6)


@pytest.mark.parametrize(("bounds", "top", "within"), [({"low": 10, "high": 90}, 1.5, 1e-4), ({}, 12.0, 1e-3)])
def test_the_least_needs_no_limit(bounds, top, within):
    """Within bounds; and six times as long as where the search began, without one."""
    found = hybrid.design(
        HANGING, unknowns={"length": {"key": LENGTH, **bounds}}, results={"top": TOP},
        minimise=f"(top / 1000 - {top})**2",
    )  # fmt: skip
    assert found.numbers["length"] == pytest.approx(1e3 * top / 5.0 / G, rel=within) and not found.notes
    assert found.settled


def test_limits_hold_in_all_cases():
    """The longest line of which a heavier end, in one case, may pull at 3 kN."""
    found = hybrid.design(
        HANGING, unknowns={"length": {"key": LENGTH, "low": 10, "high": 90}}, minimise="-length",
        cases={"light": {}, "heavy": {"ends.end": {"kind": "free", "force": [0, 0, -1000.0]}}},
        limits={"top": TOP | {"largest": 3000.0}},
    )  # fmt: skip
    assert found.numbers["length"] == pytest.approx(2000.0 / 5.0 / G, rel=1e-6)
    assert {x.case: x.active for x in found.kept} == {"light": False, "heavy": True}
    assert found.kept[1].price == pytest.approx(-1.0 / 5.0 / G, rel=1e-5)
    assert found.scene.ends.end.force is None and found.scenes["heavy"].ends.end.force is not None


def test_what_cannot_be_reached_says_which_limits_fight():
    """5 to 7 kg/m of 40 m pull with 1962 N at least; as far beyond one as beyond the other, in squares of parts."""
    unknowns = {"mass": {"key": MASS, "low": 5, "high": 7}}
    limits = {"top": TOP | {"largest": 1000.0}, "weight": {"quantity": "reaction_start.z", "smallest": 2500.0}}
    with pytest.raises(hybrid.ComputationError) as raised:
        hybrid.design(HANGING, unknowns=unknowns, limits=limits)
    text = str(raised.value)
    assert raised.value.outcome == hybrid.Outcome.NOT_REACHED
    assert "these cannot all be kept" in text and "top: tension@start may be at most 1000" in text
    assert "weight: reaction_start.z has to be at least 2500" in text and "mass = 5 (its bound)" in text
    with pytest.raises(hybrid.ComputationError, match=r"this cannot be kept.*top: .* and is 1962"):
        hybrid.design(HANGING, unknowns=unknowns, limits={"top": limits["top"]}, minimise="mass")
    with pytest.raises(
        hybrid.ComputationError, match=r"top: tension@start is to be 3000, and is 2746.8, with mass = 7"
    ):
        hybrid.design(HANGING, unknowns=unknowns, targets={"top": TOP | {"value": 3000.0}})


def test_an_end_of_what_can_be_is_said():
    """The shortest line between two places: beyond it the line would stretch by more than its 5 %, 97.93 m at the ends

    of its sag, as `hybrid static` says; a straight one without weight 95.24 m.
    """
    ends = {k: {"kind": "pinned", "position": [x, 0, 0]} for k, x in (("start", 0.0), ("end", 100.0))}
    section = {"length": 105.0, "mass": 4.0, "axial_stiffness": 1e5}
    scene = HANGING | {"cable": {"sections": [section]}, "ends": ends}
    found = hybrid.design(scene, unknowns={"length": {"key": LENGTH, "low": 50, "high": 140}}, minimise="length")
    (note,) = (x for x in found.notes if x.startswith("the search ended where it could not go on"))
    assert "max_strain" in note or "stretch" in note
    assert found.numbers["length"] == pytest.approx(97.93, rel=1e-3) and found.equilibria < 40
    assert not found.settled and "no optimum" in note


@pytest.mark.parametrize("low", [{}, {"low": 0, "high": 90}])
def test_what_runs_off_to_nothing_is_no_optimum(low):
    """The lightest line within no limit."""
    found = hybrid.design(HANGING, unknowns={"mass": {"key": MASS} | low}, minimise="mass")
    (note,) = found.notes
    assert "no optimum" in note and not found.settled


@pytest.mark.long
@pytest.mark.parametrize(
    ("key", "bounds", "minimise", "side"),
    [
        (LENGTH, {}, "-length", "high"), (LENGTH, {}, "1/length", "high"), (LENGTH, {}, "exp(-length/10)", "high"),
        (LENGTH, {"low": 1, "high": 1e9}, "5 + 1/length", "high"), (LENGTH, {"high": 90}, "length**3", "low"),
        (MASS, {}, "length**2", "low"), (MASS, {"low": 0, "high": 9}, "length + 1000", "low"),
    ],
)  # fmt: skip
def test_what_runs_off_where_its_slope_falls_too_is_no_optimum(key, bounds, minimise, side):
    """The slope of what is minimised goes to 0 on the way, as at an optimum; further on it is no worse."""
    found = hybrid.design(HANGING, unknowns={"length": {"key": key} | bounds}, minimise=minimise)
    assert not found.settled and not found.bounds
    assert any(f"no optimum; give a {side} that can be built" in note for note in found.notes)


def test_a_step_to_where_what_is_minimised_is_no_number_is_made_shorter():
    """A logarithm that ends at 38 m; and a root that is least at its end, where it has no slope."""
    found = hybrid.design(
        HANGING, unknowns={"length": {"key": LENGTH, "low": 10, "high": 90, "start": 60}},
        minimise="(length - 39)**2 / 100 - log(length - 38) / 50",
    )  # fmt: skip
    # 2 (x - 1) / 100 = 1 / (50 x) with x = length - 38: x^2 - x = 1
    assert found.numbers["length"] == pytest.approx(38.0 + 0.5 * (1.0 + math.sqrt(5.0)), rel=1e-3) and found.settled
    wrong = hybrid.design(HANGING, unknowns={"length": {"key": LENGTH, "low": 10, "high": 90}},
                          minimise="sqrt(length - 38)")  # fmt: skip
    assert not wrong.settled and wrong.numbers["length"] == pytest.approx(38.0, abs=1e-2)
    assert "math domain error" in wrong.notes[0]


@pytest.mark.parametrize("added", [1e6, 1e9])
def test_a_constant_that_is_added_hides_no_optimum(added):
    """A price that is paid in any case: with it the least is where it is without."""
    found = hybrid.design(
        HANGING, unknowns={"length": {"key": LENGTH, "low": 10, "high": 90}}, limits={"top": TOP | {"smallest": 1500.0}},
        minimise=f"{added:.1f} + length",
    )  # fmt: skip
    assert found.numbers["length"] == pytest.approx(1500.0 / 5.0 / G, rel=1e-5) and found.settled
    assert found.kept[0].active and found.kept[0].price == pytest.approx(1.0 / 5.0 / G, rel=1e-2)


def test_a_result_that_is_not_there_is_said():
    """Where a line touches the bed, of a line that hangs above it."""
    section = {"length": 84.0, "mass": 20.0, "diameter": 0.1, "axial_stiffness": 1e7}
    ends = pinned_at(0.0, 0, -5.0), pinned_at(80.0, 0, 0.0)
    scene = cable_scene(section, *ends, environment=WATER, model="catenary", mesh=40)
    unknowns = {"length": {"key": LENGTH, "low": 81, "high": 200}}
    targets = {"top": {"quantity": "tension", "at": "end", "value": 9000.0},
               "lies": {"quantity": "touchdown", "value": 20.0}}  # fmt: skip
    with pytest.raises(hybrid.ComputationError, match=r"touchdown has no value in the equilibrium with .*length = 84"):
        hybrid.design(scene, unknowns=unknowns, targets=targets)
    with pytest.raises(hybrid.ComputationError, match=r"touchdown has no value in the equilibrium with .*length = 84"):
        hybrid.seek(scene, {"touchdown": 20.0}, [LENGTH])


SCENE = """\
# A line that hangs.
environment: {gravity: 9.81}
cable:
  sections:
    - {length: 40, mass: 5, axial_stiffness: 1.0e+12}   # of steel
ends:
  start: {kind: pinned, position: [0, 0, 0]}
  end: free
initial: equilibrium
model: catenary
mesh: {cells: 10}
"""
DESIGN = """\
title: As long as can be
scene: line.yaml
unknowns:
  length: {key: "cable.sections[0].length", low: 10, high: 90}
minimise: -length
limits:
  top: {quantity: tension, at: start, largest: 3000}
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("line.yaml").write_text(SCENE)
    Path("design.yaml").write_text(DESIGN)
    return tmp_path


def test_the_command(folder):
    told = CliRunner().invoke(app, ["design", "design.yaml", "-o", "found.yaml", "--plot", "found.svg"])
    assert told.exit_code == 0, told.output
    assert "As long as can be" in told.output and "<= 3000" in told.output and "-0.0204" in told.output
    text = Path("found.yaml").read_text()
    assert "# A line that hangs." in text and "# of steel" in text and "length: 40" not in text
    assert hybrid.load_scene("found.yaml").cable.length == pytest.approx(3000 / 5 / G, rel=1e-6)
    assert "<svg" in Path("found.svg").read_text()
    assert "no optimum" not in told.output
    assert CliRunner().invoke(app, ["design", "design.yaml", "-o", "found.yaml"]).exit_code == 1  # it is there
    told = CliRunner().invoke(app, ["design", "design.yaml", "--json"])
    (row,) = [x for x in map(json.loads, told.output.splitlines()) if "numbers" in x]
    assert row["settled"] and row["kept"][0]["active"] and row["minimised"] == pytest.approx(-3000 / 5 / G, rel=1e-6)


def test_the_command_says_where_there_is_no_optimum(folder):
    asked = DESIGN.replace(LENGTH, MASS).replace("low: 10, high: 90", "low: 0, high: 90").replace("-length", "length")
    Path("design.yaml").write_text(asked)
    told = CliRunner().invoke(app, ["design", "design.yaml"])
    assert told.exit_code == 0 and "no optimum: see the note" in told.output, told.output


def test_the_scene_found_stands_by_itself_where_its_text_cannot_be_changed(folder):
    """A number of an alias is that of other places, too."""
    first = "    - {length: 40, mass: 5, axial_stiffness: 1.0e+12}   # of steel\n"
    second = "    - {length: *l, mass: 5, axial_stiffness: 1.0e+12}\n"
    Path("line.yaml").write_text(SCENE.replace(first, first.replace("length: 40", "length: &l 40") + second))
    text = hybrid.design("design.yaml").scene_text(folder)
    lengths = [x.length for x in hybrid.parse_scene(text).cable.sections]
    assert lengths == pytest.approx([3000 / 5 / G - 40.0, 40.0], rel=1e-5)


REFUSED = {
    "a key that is none": ("sections[0].length", "sections[0].lenght", "design.yaml:4:17: unknowns.length.key", "number"),
    "a key of how it is computed": ("cable.sections[0].length", "mesh.cells", "design.yaml:4:17: unknowns.length.key",
                                    "as mesh is"),
    "bounds": ("high: 90", "high: 5", "design.yaml:4:60: unknowns.length.high", "above low, 10"),
    "a start out of bounds": ("low: 10", "low: 60", "design.yaml:4:11: unknowns.length", "the number of the scene, 40"),
    "a quantity": ("quantity: tension", "quantity: tensoin", "design.yaml:7:19: limits.top.quantity", "one of"),
    "a component": ("quantity: tension", "quantity: tension.x", "design.yaml:7:19: limits.top.quantity", "no components"),
    "a place of one value": ("quantity: tension", "quantity: reaction_end.z", "design.yaml:7:19: limits.top.quantity",
                             "one value for the whole line"),
    "an extreme of one value": (DESIGN[DESIGN.index("limits") :], "results:\n  top: {quantity: reaction_end.z, take: max}",
                                "design.yaml:7:41: results.top.take", "one value for the whole line"),
    "no limit": (", largest: 3000", "", "design.yaml:7:8: limits.top", "largest, smallest, or both"),
    "an expression": ("-length", "-lenght", "design.yaml:5:11: minimise", "arithmetic"),
    "no number where it begins": ("-length", "log(20 - length)", "design.yaml:5:11: minimise",
                                  "math domain error (with length = 40)"),
    "no number": ("-length", "length > 3", "design.yaml:5:11: minimise", "gives a number"),
    "in motion": ("at: start,", "at: start, in: motion,", "design.yaml:7:39: limits.top.in", "over: max"),
    "no time": ("at: start,", "at: start, over: max,", "design.yaml:7:45: limits.top.over", "a scene with time"),
    "a line": ("at: start,", "at: start, line: east,", "design.yaml:7:45: limits.top.line", "one line"),
    "a section": ("at: start,", "section: 1,", "design.yaml:7:37: limits.top.section", "has 1"),
    "a place": ("at: start,", "at: 50,", "design.yaml:7:19: limits.top.quantity", "between 0 and 40"),
    "an edge of contact": ("quantity: tension", "quantity: touchdown", "design.yaml:7:19: limits.top.quantity", "evenly"),
    "a case": ("at: start,", "at: start, cases: [far],", "design.yaml:7:46: limits.top.cases", "there are no cases"),
    "nothing asked": (DESIGN[DESIGN.index("minimise") :], "", "design.yaml:1:1: scene", "what is asked"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_bad_files_are_refused_with_their_line(folder, name):
    old, new, place, expected = REFUSED[name]
    assert old in DESIGN
    Path("design.yaml").write_text(DESIGN.replace(old, new))
    with pytest.raises(hybrid.SceneError) as raised:
        hybrid.design("design.yaml")
    assert place in str(raised.value) and expected in str(raised.value), raised.value


def test_a_number_that_two_unknowns_set_is_refused(folder):
    """In whichever way its key is written, and among the keys of one unknown."""
    other = "cable.sections.0.length"
    Path("design.yaml").write_text(DESIGN.replace("minimise", f"  b: {{key: {other}, low: 10, high: 90}}\nminimise"))
    with pytest.raises(hybrid.SceneError, match=r"design\.yaml:5:12: unknowns\.b\.key[^$]*that nothing else sets"):
        hybrid.design("design.yaml")
    Path("design.yaml").write_text(DESIGN.replace(f'key: "{LENGTH}"', f'keys: ["{LENGTH}", {other}]'))
    with pytest.raises(hybrid.SceneError, match=r"unknowns\.length\.keys[^$]*that nothing else sets"):
        hybrid.design("design.yaml")


def test_bad_cases_are_refused_with_their_line(folder):
    cases = 'cases:\n  far: {"cable.sections[0].lenght": 3}\n'
    Path("design.yaml").write_text(DESIGN + cases)
    with pytest.raises(hybrid.SceneError, match=r"unknown[^$]*expected: a key of a design[^$]*did you mean unknowns"):
        hybrid.design({"scene": "scene.yaml", "unknown": {}, "unknowns": {"length": {"key": LENGTH}}})
    with pytest.raises(
        hybrid.SceneError, match=r"design\.yaml:9:37: cases\.far\.cable\.sections\[0\]\.lenght[^$]*did you mean length"
    ):
        hybrid.design("design.yaml")
    Path("design.yaml").write_text(DESIGN + 'cases:\n  far: {"cable.sections[0].length": 30}\n')
    with pytest.raises(hybrid.SceneError, match=r"design\.yaml:4:17: unknowns\.length\.key[^$]*no case sets, as far"):
        hybrid.design("design.yaml")
    place = "ends.start.position"  # holds the number of the unknown: it would stand in place of what the case sets
    asked = DESIGN.replace("cable.sections[0].length", f"{place}[0]").replace("low: 10", "low: -5, start: 1")
    Path("design.yaml").write_text(asked + f"cases:\n  far: {{{place}: [3, 0, 0]}}\n")
    with pytest.raises(hybrid.SceneError, match=rf"unknowns\.length\.key[^$]*as far does with {place}"):
        hybrid.design("design.yaml")
    Path("design.yaml").write_text(DESIGN + "cases: {a: {}, b: {}}\nresults: {end: {quantity: tension, at: end}}\n")
    with pytest.raises(hybrid.SceneError, match=r"results\.end\.case[^$]*the case in which it is meant, one of: a, b"):
        hybrid.design("design.yaml")


def test_extremes_of_sections():
    """Sections whose largest curvatures differ; the whole has the largest of them."""
    rope = {"mass": 5.0, "axial_stiffness": 1e8, "bending_stiffness": 50.0}
    ends = {k: {"kind": "pinned", "position": [x, 0, 0]} for k, x in (("start", 0.0), ("end", 25.0))}
    scene = hybrid.validate_scene(HANGING | {
        "cable": {"sections": [rope | {"length": 20.0}, rope | {"length": 20.0, "mass": 9.0}]}, "ends": ends,
        "model": "rod", "mesh": {"cells": 80},
    })  # fmt: skip
    of = ["max curvature", "max curvature@sections[0]", "max curvature@sections[1]", "min position.z@sections[0]"]
    found = [x.result for x in hybrid.sensitivity(scene, of, [LENGTH])]
    rest = hybrid.static(scene)
    first = rest.s <= 20.0 + 1e-9
    curvature, z = rest.curvature[-1], rest.position[-1][:, 2]
    theirs = [curvature.max(), curvature[first].max(), curvature[~first].max(), z[first].min()]
    np.testing.assert_allclose(found, theirs, rtol=5e-3)
    assert found[0] == max(found[1:3])
    with pytest.raises(hybrid.SceneError, match=r"which has 2, counted from 0"):
        hybrid.sensitivity(scene, ["max curvature@sections[2]"], [LENGTH])


def test_cells_go_along_with_their_sections():
    """Where a length would give a section another number of its cells, they stay, and there is a derivative."""
    rope = {"mass": 5.0, "axial_stiffness": 1e7}
    ends = {k: {"kind": "pinned", "position": [x, 0, 0]} for k, x in (("start", 0.0), ("end", 25.0))}
    scene = hybrid.validate_scene(HANGING | {
        "cable": {"sections": [rope | {"length": 10.0}, rope | {"length": 20.0}]}, "ends": ends, "mesh": {"cells": 40},
    })  # fmt: skip
    rounds = [x for x in np.linspace(10.0, 10.3, 31) if _cells(scene, x * (1 - 1e-4)) != _cells(scene, x * (1 + 1e-4))]
    exact = [hybrid.sensitivity(scene, ["tension@end"], ["cable.sections[0].length"])[0]]
    for x in rounds[:1] or [10.128205]:
        changed = hybrid.validate_scene(_with(scene, x))
        exact.append(hybrid.sensitivity(changed, ["tension@end"], ["cable.sections[0].length"])[0])
    assert exact[1].derivative == pytest.approx(exact[0].derivative, rel=0.2)


def _with(scene, length):
    tables = scene.model_dump(mode="json", exclude_none=True)
    tables["cable"]["sections"][0]["length"] = float(length)
    return tables


def _cells(scene, length):
    from hybrid.model.build import build

    return int(np.searchsorted(build(one_line(hybrid.validate_scene(_with(scene, length)))).line.s, length - 1e-6))


SAG = {"length": 130.0, "mass": 20.0, "diameter": 0.1, "axial_stiffness": 1e7, "bending_stiffness": 500.0}
WATER = {"fluid": {"density": 1025}, "seabed": {"z": -40.0, "stiffness": 1e4}}


def _sagging(turn, several):
    """A short and heavy line that pulls with 12 kN at most, and stays 10 m off the bed; turned in plan."""
    far = pinned_at(100.0 * math.cos(turn), 100.0 * math.sin(turn), 0.0)
    scene = cable_scene(SAG, pinned_at(0, 0, -10), far, environment=WATER, model="rod", mesh=40)
    scene = as_network(scene) if several else scene
    table = "lines.cable" if several else "cable"
    of_line = {"line": "cable"} if several else {}
    return hybrid.design(
        scene, unknowns={"L": {"key": f"{table}.sections[0].length", "low": 105, "high": 150},
                         "m": {"key": f"{table}.sections[0].mass", "low": 12, "high": 40}},
        limits={"top": of_line | {"quantity": "tension", "at": "end", "largest": 12e3},
                "low": of_line | {"quantity": "position.z", "smallest": -30.0}},
        minimise="L - 3*m",
    )  # fmt: skip


@pytest.mark.long
def test_turned_in_plan_and_written_as_a_system_it_is_the_same():
    one, other = _sagging(0.0, False), _sagging(0.7, True)
    assert any(x.active for x in one.kept)
    assert other.numbers == pytest.approx(one.numbers, rel=1e-5)
    assert [x.price for x in other.kept] == pytest.approx([x.price for x in one.kept], rel=1e-3, abs=1e-9)
    assert [x.value for x in other.kept] == pytest.approx([x.value for x in one.kept], rel=1e-5)


# --- The designs of examples/ are what they say ---

DESIGNS = Path(__file__).parents[2] / "examples" / "designs"
NAMES = ("lazy_wave", "pretension", "stiffness", "towing")
IN_SEAS = "lazy_wave_in_seas"  # takes minutes: bench/test_bench_design.py


@cache
def designed(name: str) -> Found:
    return hybrid.design(DESIGNS / f"{name}.yaml")


def test_there_is_no_other_example() -> None:
    found = {file.stem for file in DESIGNS.glob("*.yaml") if "\nscene:" in file.read_text(encoding="utf-8")}
    assert found == {*NAMES, IN_SEAS}


def test_pretension_of_three_lines_takes_six_equilibria() -> None:
    found = designed("pretension")
    assert found.equilibria <= 6
    with hybrid.static(found.scene) as result:
        east = result.lines["east"]
        assert east.tension[-1][-1] == pytest.approx(60e3, rel=1e-7)
        assert east.position[-1][-1][:2] == pytest.approx([0.0, 0.0], abs=1e-6)
    assert abs(found.kept[0].finer - 60e3) < 0.001 * 60e3  # on twice the cells, with other numbers than these


@pytest.mark.long
def test_the_lazy_wave_is_held_by_as_many_limits_as_there_are_unknowns() -> None:
    found = designed("lazy_wave")
    assert found.equilibria <= 60 and found.minimised == pytest.approx(2.394, rel=2e-3)
    active = {(x.name, x.case) for x in found.kept if x.active}
    assert active == {("bend", "near"), ("top", "far"), ("sag", "near")} and not found.bounds
    assert sum(x.active for x in found.kept) == 4  # the bend in two sections
    for x in found.kept:
        allowed = 1e-5 * abs(x.bound)
        assert x.value <= x.bound + allowed if x.side > 0 else x.value >= x.bound - allowed
    with hybrid.static(found.scenes["far"]) as result:  # more than the limit of any other case
        assert result.tension[-1][-1] == pytest.approx(30e3, rel=1e-5)


@pytest.mark.needs("simpleeval")
def test_a_price_is_what_a_wider_limit_is_worth() -> None:
    found = designed("lazy_wave")
    (top,) = (x for x in found.kept if x.name == "top" and x.active)
    assert top.price == pytest.approx(-1.4e-4, rel=0.05)  # m3 per N


def test_a_sagging_umbilical_shows_the_ratio_of_stiffness_and_mass() -> None:
    """The shape was made with 8 N m2 and 0.8 kg/m, and noise of 2 mm."""
    found = designed("stiffness")
    assert isinstance(found, Identified)
    (apart,) = found.apart
    assert apart.text.startswith("stiffness and mass: only their ratio is known, stiffness / mass = ")
    assert found.numbers["stiffness"] / found.numbers["mass"] == pytest.approx(10.0, abs=0.045)  # three deviations


@pytest.mark.long
def test_a_towing_record_shows_stiffness_and_drag() -> None:
    """The record was made with 6 N m2 and 1.3, and noise of 2 % of the largest force and change of angle."""
    found = designed("towing")
    assert isinstance(found, Identified) and not found.apart and not found.notes
    for estimate, truth in zip(found.estimates, (6.0, 1.3), strict=True):
        assert estimate.low <= truth <= estimate.high and estimate.deviation < 0.03 * truth
