"""Every refusal at the exact line, column and key, with a fix that helps; every pair of features that is refused."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from ruamel.yaml import YAML
from scene_texts import AT_REST, EVERYTHING, EVERYTHING_ELSE, OCEAN, SUSPENSION, change, complaints, refused

import hybrid
from hybrid.errors import SceneError
from hybrid.scene import combinations as c
from hybrid.scene.combinations import REFUSALS, Use, refuse_use
from hybrid.scene.network import Network
from hybrid.scene.read import read_text, validate_scene
from hybrid.scene.root import Scene
from tests.problems import tables_with
from tests.scenes import cable_scene, clamped_at, line_between, network_scene

PINNED = "{kind: pinned, position: [0, 0, 0]}"
GUIDED = "{kind: guided, tangent: [0.8660254, 0, -0.5], force: [0.005, 0, 0.00866025]}"
ZONES = "[{catenary: 1.5}, {rod: 0.5}]"
MODEL = "{kind: zones, zones: [{catenary: 1.5}, {rod: 0.5}]}"
STRAIGHT = "{kind: straight, direction: [1, 0, 0]}"
POINTS = "[[0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [5.0, 0.0, -5.0]]"
HEAVE = "{heave: {amplitude: 2.0, period: 8.0}, ramp: 16.0}"
MASS = "mass: 7.853981634e-4"
BENDING = "bending_stiffness: 2.454369e-4"

CASES = {
    # --- keys
    "no inertia about the axis": (EVERYTHING, "[1.0e-4, 2.0e-4]", "[1.0e-4, §0.0]", "cable.sections[0].rotary_inertia[1]", "a round section: 0.0002"),
    "unknown key": (SUSPENSION, "gravity", "§gravty", "environment.gravty", "did you mean gravity?"),
    "unknown key of a scene": (SUSPENSION, "title:", "§tilte:", "tilte", "did you mean title?"),
    "unknown key, nothing near": (SUSPENSION, "{every", "{§xyzzy: 3, every", "output.xyzzy", "every, points, history"),
    "missing key": (SUSPENSION, f"- length: 2.0                    # m, unstretched\n      diameter: 1.0e-3               # m\n      {MASS}", "- §length: 2.0\n      diameter: 1.0e-3", "cable.sections[0].mass", "add `mass: ...` (kg/m)"),
    "missing table": (SUSPENSION, f"§initial: {STRAIGHT}".replace("§", ""), "", "initial", "add `initial: equilibrium`"),
    "empty value": (SUSPENSION, "gravity: 9.8", "§gravity:", "environment.gravity", "leave the key out"),
    # --- stretch
    "table and stiffness": (SUSPENSION, MASS, f"{MASS}\n      axial_stiffness: §1.0e+5\n      tension_strain: [[0, 0], [0.01, 1000]]", "cable.sections[0].axial_stiffness", "leave one of the two out"),
    "table of one row": (SUSPENSION, MASS, f"{MASS}\n      tension_strain: §[[0, 0]]", "cable.sections[0].tension_strain", "axial_stiffness"),
    "table without zero": (SUSPENSION, MASS, f"{MASS}\n      tension_strain: [§[0.01, 100], [0.02, 300]]", "cable.sections[0].tension_strain[0]", "begin with [0, 0]"),
    "table that falls": (SUSPENSION, MASS, f"{MASS}\n      tension_strain: [[0, 0], [0.01, 300], [0.02, §200]]", "cable.sections[0].tension_strain[2][1]", "slackens"),
    "table the wrong way": (SUSPENSION, MASS, f"{MASS}\n      tension_strain: [[0, 0], [0.01, 300], [§0.005, 400]]", "cable.sections[0].tension_strain[2][0]", "strain comes first"),
    "table of tension first": (SUSPENSION, MASS, f"{MASS}\n      tension_strain: [[0, 0], [§1.0e+5, 0.001], [4.0e+5, 0.003]]", "cable.sections[0].tension_strain[1][0]", "strain comes first, then tension"),
    "table file": (SUSPENSION, MASS, f"{MASS}\n      tension_strain: {{file: §none.csv}}", "cable.sections[0].tension_strain.file", "folder"),
    "dynamic alone": (SUSPENSION, MASS, f"{MASS}\n      dynamic_stiffness: §{{constant: 3.0e+5, relaxation_time: 60}}", "cable.sections[0].dynamic_stiffness", "axial_stiffness"),
    "dynamic below static": (SUSPENSION, MASS, f"{MASS}\n      axial_stiffness: 4.0e+5\n      dynamic_stiffness: {{constant: §3.0e+5, relaxation_time: 60}}", "cable.sections[0].dynamic_stiffness.constant", "exchanged"),
    # --- values
    "negative": (SUSPENSION, MASS, "mass: §-1", "cable.sections[0].mass", "check the sign"),
    "with unit": (SUSPENSION, MASS, "mass: §2 kg/m", "cable.sections[0].mass", "write the number alone, 2; the unit is kg/m"),
    "quoted nan": (SUSPENSION, MASS, 'mass: §"nan"', "cable.sections[0].mass", "give a finite number"),
    "quoted": (SUSPENSION, MASS, 'mass: §"2"', "cable.sections[0].mass", "write 2 without quotes"),
    "comma": (SUSPENSION, "gravity: 9.8", "gravity: §9,8", "environment.gravity", "9.8"),
    "nan": (SUSPENSION, MASS, "mass: §.nan", "cable.sections[0].mass", "finite"),
    "infinity": (SUSPENSION, "duration: 20.0", "duration: §.inf", "time.duration", "finite"),
    "overflow": (SUSPENSION, "duration: 20.0", "duration: §1e400", "time.duration", "finite"),
    "pair of three": (SUSPENSION, BENDING, "bending_stiffness: §[1, 2, 3]", "cable.sections[0].bending_stiffness", "there are 3"),
    "one pair for a list of pairs": (SUSPENSION, "{every: 0.1}", "{every: 0.1, elevation: [§0]}", "output.elevation[0]", "`[[x, y]]` where there is one"),
    "two coordinates": (SUSPENSION, PINNED, "{kind: pinned, position: §[0, 0]}", "ends.start.position", "there are 2"),
    "inside a vector": (SUSPENSION, PINNED, "{kind: pinned, position: [0, §x, 0]}", "ends.start.position[1]", ""),
    "vector without brackets": (SUSPENSION, PINNED, "{kind: pinned, position: §0 0 0}", "ends.start.position", "brackets"),
    "number for table": (SUSPENSION, "{density: 1.0}", "§1025", "environment.fluid", "density"),
    "table for list": (SUSPENSION, ZONES, "§{rod: 2.0}", "model.zones", "dash"),
    "number for title": ("title: §2024\n" + AT_REST, None, None, "title", "quotes"),
    "word not in the list": (EVERYTHING, "slack: warn", "slack: §wran", "model.slack", "did you mean warn?"),
    "a solver": (EVERYTHING, "dimension: 3", "dimension: 3\n§solver: shooting", "solver", "every scene is solved by elimination"),
    "fraction of a cell": (EVERYTHING, "cells: 20", "cells: §20.5", "model.zones[0].cells", "round"),
    "no cell": (EVERYTHING, "cells: 20", "cells: §0", "model.zones[0].cells", ">= 1"),
    "one cell": (EVERYTHING, "cells: 50", "cells: §1", "mesh.cells", ">= 2"),
    "one output point": (EVERYTHING, "points: 51", "points: §1", "output.points", ">= 2"),
    "rho_inf": (EVERYTHING, "rho_inf: 0.5", "rho_inf: §1.5", "time.rho_inf", "<= 1"),
    "empty list": (SUSPENSION, ZONES, "§[]", "model.zones", ""),
    # --- kinds
    "no kind": (SUSPENSION, PINNED, "§{position: [0, 0, 0]}", "ends.start.kind", "pinned"),
    "kind misspelt": (SUSPENSION, PINNED, "{kind: §pined, position: [0, 0, 0]}", "ends.start.kind", "did you mean pinned?"),
    "kind is a list": (SUSPENSION, PINNED, "{kind: §[pinned], position: [0, 0, 0]}", "ends.start.kind", "pinned"),
    "a tolerance of everything": (SUSPENSION, MODEL, "{kind: adaptive, tolerance: §1}", "model.tolerance", "<= 0.1"),
    "rod and catenary at once": (SUSPENSION, MODEL, "{kind: adaptive, force_rod: [[0, 1]], force_catenary: [§[0.5, 2]]}", "model.force_catenary[0]", "force_rod"),
    "one stretch for a list": (SUSPENSION, MODEL, "{kind: adaptive, force_rod: §[0, 1]}", "model.force_rod", "write [[0, 1]]"),
    "a stretch off the cable": (SUSPENSION, MODEL, "{kind: adaptive, force_rod: [§[0, 7]]}", "model.force_rod[0]", "2 m"),
    "end is a number": (SUSPENSION, PINNED, "§3", "ends.start", "kind: pinned"),
    "zone of no kind": (SUSPENSION, ZONES, "[{catenary: 1.5}, §{rood: 0.5}]", "model.zones[1]", "{rod: length}"),
    "zone of both kinds": (SUSPENSION, ZONES, "[§{catenary: 1.5, rod: 0.5}]", "model.zones[0]", "{rod: length}"),
    "zone is a number": (SUSPENSION, ZONES, "[§1.5, {rod: 0.5}]", "model.zones[0]", "{rod: length}"),
    # --- conditions that another kind of end takes
    "pinned force": (SUSPENSION, PINNED, "{kind: pinned, position: [0, 0, 0], §force: [1, 0, 0]}", "ends.start.force", "use kind: guided or free"),
    "pinned tangent": (SUSPENSION, PINNED, "{kind: pinned, position: [0, 0, 0], §tangent: [1, 0, 0]}", "ends.start.tangent", "kind: clamped or guided"),
    "guided without tangent": (SUSPENSION, GUIDED, "§{kind: guided}", "ends.end.tangent", "direction of increasing s"),
    "guided position": (SUSPENSION, GUIDED, "{kind: guided, tangent: [1, 0, 0], §position: [1, 0, 0]}", "ends.end.position", "kind: pinned or clamped"),
    "free position": (SUSPENSION, GUIDED, "{kind: free, §position: [1, 0, 0]}", "ends.end.position", "kind: pinned"),
    "free motion": (SUSPENSION, GUIDED, "{kind: free, §motion: {ramp: 3}}", "ends.end.motion", "pinned or clamped"),
    "zones of a rod": (SUSPENSION, "kind: zones, zones", "kind: rod, §zones", "model.zones", "use kind: zones"),
    # --- directions
    "zero tangent": (SUSPENSION, GUIDED, "{kind: guided, tangent: §[0, 0, 0]}", "ends.end.tangent", "not all zero"),
    "zero direction": (SUSPENSION, STRAIGHT, "{kind: straight, direction: §[0, 0, 0]}", "initial.direction", "not all zero"),
    "parallel normal": (SUSPENSION, GUIDED, "{kind: guided, tangent: [1, 0, 2], normal: §[-2, 0, -4]}", "ends.end.normal", "not along the tangent"),
    "parallel normal of a clamp": (EVERYTHING, "normal: [0.0, 1.0, 0.0]", "normal: §[2.0, 0.0, 0.0]", "ends.start.normal", "not along the tangent"),
    # --- motion
    "guided surge": (EVERYTHING, "motion: {pitch: {amplitude: 3.0", "motion: {surge: §{amplitude: 3.0", "ends.end.motion.surge", "clamped"),
    "pinned roll": (OCEAN, "heave", "roll", "ends.end.motion.roll", "clamped"),
    "motion twice": (OCEAN, "ramp: 16.0", "file: x.csv", "ends.end.motion.heave", "leave file out"),
    "no motion": (OCEAN, HEAVE, "§{}", "ends.end.motion", "leave motion out"),
    "no ramp": (OCEAN, HEAVE, "§{heave: {amplitude: 2.0, period: 8.0}}", "ends.end.motion", "give `ramp: 16`"),
    "no ramp, phase 90": (OCEAN, HEAVE, "§{heave: {amplitude: 2.0, period: 8.0, phase: 90}}", "ends.end.motion", "give `ramp: 16`"),
    "no such file": (OCEAN, HEAVE, "{file: §nowhere.csv}", "ends.end.motion.file", "folder of the scene file"),
    # --- cable
    "drag without fluid": (SUSPENSION, "  fluid: {density: 1.0}", "  #", "cable.sections[0].drag", "give environment.fluid"),
    "added mass without fluid": (OCEAN, "  fluid: {density: 1025, current: [0.3, 0, 0]}\n", "", "cable.sections[0].added_mass", "give environment.fluid"),
    "fluid without diameter": (SUSPENSION, "- length: 2.0                    # m, unstretched\n      diameter: 1.0e-3", "- §length: 2.0", "cable.sections[0].diameter", "add `diameter: ...` (m)"),
    "anisotropic without torsion": (EVERYTHING_ELSE, "[{length: 10.0, mass: 1.0, bending_stiffness: 2.0", "[§{length: 10.0, mass: 1.0, bending_stiffness: [2.0, 1.0]", "cable.sections[0].torsional_stiffness", "torsional_stiffness"),
    "curved without torsion": (EVERYTHING_ELSE, "[{length: 10.0,", "[§{length: 10.0, intrinsic_curvature: [0, 1, 0],", "cable.sections[0].torsional_stiffness", "torsional_stiffness"),
    "rod that cannot bend": (AT_REST.replace("catenary", "rod"), "[{length", "[§{length", "cable.sections[0].bending_stiffness", "catenary"),
    "rod zone that cannot bend": (SUSPENSION, BENDING, "bending_stiffness: §0", "cable.sections[0].bending_stiffness", "add `bending_stiffness: ...` (N m^2)"),
    "rod zone that bends one way": (SUSPENSION, BENDING, "bending_stiffness: §[0, 1]", "cable.sections[0].bending_stiffness", "catenary"),
    "rod zone that twists freely": (SUSPENSION, "torsional_stiffness: 1.963495e-4", "torsional_stiffness: §0", "cable.sections[0].torsional_stiffness", "leave it out"),
    # --- lengths
    "zones too short": (SUSPENSION, ZONES, "§[{catenary: 1.4}, {rod: 0.5}]", "model.zones", "last zone"),
    "cable too short": (change(OCEAN, "axial_stiffness: 2.0e8, ", ""), "[205, 0, 0]", "§[205, 0, 100]", "ends.end.position", "closer ends, or give axial_stiffness"),
    "mass in g/m": (SUSPENSION, MASS, "mass: §0.7853981634", "cable.sections[0].mass", "mass: 0.000785398"),
    "mass in kg/km": (OCEAN, "mass: 20,", "mass: §20000,", "cable.sections[0].mass", "then mass: 20"),
    "mass in t/m": (OCEAN, "mass: 20,", "mass: §0.02,", "cable.sections[0].mass", "in t/m? then mass: 20"),
    "diameter in mm": (OCEAN, "diameter: 0.05, mass: 20,", "diameter: 50, mass: §20,", "cable.sections[0].mass", "in mm? then diameter: 0.05"),
    "mass times 100 000": (OCEAN, "mass: 20,", "mass: §2000000,", "cable.sections[0].mass", "diameter (m)"),
    "water in g/cm^3": (OCEAN, "density: 1025", "density: §1.025", "environment.fluid.density", "write 1025"),
    "water in g/m^3": (OCEAN, "density: 1025", "density: §1025000", "environment.fluid.density", "write 1025"),
    "water in t/m^3 with a surface": (OCEAN, "density: 1025", "surface: 0, density: §1.0", "environment.fluid.density", "write 1000"),
    "a tenth of water with a surface": (OCEAN, "density: 1025", "surface: 0, density: §102.5", "environment.fluid.density", "1025 is sea water"),
    "ten times water over a bed": (OCEAN, "density: 1025, current: [0.3, 0, 0]}", "density: §10250}\n  seabed: {z: -100, stiffness: 1.0e+4}", "environment.fluid.density", "1025 is sea water"),
    "stretched too far": (OCEAN, "[205, 0, 0]", "§[245, 0, 0]", "ends.end.position", "longer cable"),
    "nodes from elsewhere": (EVERYTHING_ELSE, "nodes: [0.0,", "nodes: [§0.5,", "mesh.nodes[0]", ""),
    "nodes to elsewhere": (EVERYTHING_ELSE, "nodes: [0.0, 4.0, 10.0]", "nodes: [0.0, 4.0, §9.0]", "mesh.nodes[2]", ""),
    "nodes not increasing": (EVERYTHING_ELSE, "nodes: [0.0, 4.0", "nodes: §[0.0, 0.0", "mesh.nodes", ""),
    "nodes and cells": (EVERYTHING_ELSE, "mesh: {", "mesh: {cells: §3, ", "mesh.cells", "nodes"),
    "output off the cable": (EVERYTHING_ELSE, "points: [0.0, 5.0, 10.0]", "points: [0.0, 5.0, §11.0]", "output.points[2]", "10 m"),
    "output not increasing": (EVERYTHING_ELSE, "points: [0.0, 5.0, 10.0]", "points: §[0.0, 5.0, 5.0]", "output.points", "sort"),
    "history off the cable": (EVERYTHING, "history: [0.0, 10.0]", "history: [0.0, §10.1]", "output.history[1]", "10 m"),
    "step too long": (SUSPENSION, "step: 0.01", "step: §30", "time.step", "smaller step"),
    # --- start
    "equilibrium of a loose cable": (AT_REST, "{kind: pinned, position: [0.0, 0.0, 0.0]}", "{kind: free}", "initial.kind", "pinned or clamped"),
    "straight from nowhere": (SUSPENSION, PINNED, "{kind: free}", "initial.origin", "add `origin: [x, y, z]` (m)"),
    "straight from elsewhere": (SUSPENSION, STRAIGHT, "{kind: straight, direction: [1, 0, 0], origin: §[1, 0, 0]}", "initial.origin", "leave origin out"),
    "straight to elsewhere": (OCEAN, "initial: {kind: equilibrium}", "initial: {kind: straight, direction: §[1, 0, 0]}", "initial.direction", "kind: equilibrium"),
    "straight with a jump": (SUSPENSION, STRAIGHT, "{kind: straight, direction: [1, 0, 0], velocity: §[1, 0, 0]}", "initial.velocity", "leave velocity out"),
    "polyline too long": (EVERYTHING_ELSE, POINTS, "§[[0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [5.0, 0.0, -6.0]]", "initial.points", "11 m"),
    "polyline elsewhere": (EVERYTHING_ELSE, POINTS, "[§[1.0, 0.0, 0.0], [5.0, 0.0, 0.0], [5.0, 0.0, -6.0]]", "initial.points[0]", "held ends"),
    "polyline that stops": (EVERYTHING_ELSE, POINTS, "[[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], §[10.0, 0.0, 0.0]]", "initial.points[2]", "leave it out"),
    "too few arc lengths": (EVERYTHING_ELSE, POINTS, f"{POINTS}, arc_lengths: §[0, 5]", "initial.arc_lengths", "3 arc lengths"),
    "arc lengths from 1 on": (EVERYTHING_ELSE, POINTS, f"{POINTS}, arc_lengths: [§1, 5, 10]", "initial.arc_lengths[0]", "write 0"),
    "arc lengths that fall": (EVERYTHING_ELSE, POINTS, f"{POINTS}, arc_lengths: [0, 5, §5]", "initial.arc_lengths[2]", "sort"),
    "arc lengths beyond it": (EVERYTHING_ELSE, POINTS, f"{POINTS}, arc_lengths: [0, 5, §11]", "initial.arc_lengths[2]", "length of the cable"),
    "a piece stretched far": (EVERYTHING_ELSE, POINTS, f"{POINTS}, arc_lengths: [0, §3, 10]", "initial.arc_lengths[1]", "5 m over 3 m"),
    "polyline of a point": (EVERYTHING_ELSE, POINTS, "§[[0.0, 0.0, 0.0]]", "initial.points", "at least 2"),
    # --- what engineers write
    "EI": (SUSPENSION, BENDING, f"{BENDING}\n      §EI: 1", "cable.sections[0].EI", "did you mean bending_stiffness (N"),
    "a table of the top, lower down": (SUSPENSION, MASS, f"{MASS}\n      §mesh: {{cells: 9}}", "cable.sections[0].mesh", "did you mean mesh at the top of the file?"),
    "velocity": (SUSPENSION, "{density: 1.0}", "{density: 1.0, §velocity: [1, 0, 0]}", "environment.fluid.velocity", "did you mean current: {velocity: [x, y, z]}?"),
    "wind, one table up": (SUSPENSION, "{density: 1.0}", "{density: 1.0}\n  §wind: [1, 0, 0]", "environment.wind", "fluid: {density: ...}"),
    "fixed": (SUSPENSION, PINNED, "{kind: §fixed, position: [0, 0, 0]}", "ends.start.kind", "did you mean pinned or clamped?"),
    "hinged": (SUSPENSION, PINNED, "{kind: §hinged, position: [0, 0, 0]}", "ends.start.kind", "did you mean pinned?"),
    "ball": (SUSPENSION, PINNED, "{kind: §ball, position: [0, 0, 0]}", "ends.start.kind", "did you mean pinned?"),
    "type": (SUSPENSION, PINNED, "§{type: pinned, position: [0, 0, 0]}", "ends.start.kind", "write kind, not type"),
    "number for drag": (SUSPENSION, "{normal: 1.5, tangential: 0.05}", "§1.0", "cable.sections[0].drag", "`drag: {normal: 1.0}`"),
    "number for force": (SUSPENSION, "[0.005, 0, 0.00866025]", "§-300", "ends.end.force", "`force: [0, 0, -300]`"),
    "number for current": (OCEAN, "[0.3, 0, 0]", "§0.3", "environment.fluid.current", "`current: [0.3, 0, 0]`"),
    "number for time": (SUSPENSION, "{duration: 20.0, step: 0.01}", "§20", "time", "`time: {duration: 20}`"),
    "decimal comma": (SUSPENSION, MASS, "mass: §2,5e7", "cable.sections[0].mass", "a decimal comma? write 2.5e7"),
    "decimal comma in quotes": (SUSPENSION, MASS, 'mass: §"2,5e7"', "cable.sections[0].mass", "a decimal comma? write 2.5e7"),
    "decimal comma in braces": (OCEAN, "axial_stiffness: 2.0e8", "axial_stiffness: §2,5e7", "cable.sections[0].axial_stiffness", "a decimal comma? write 2.5e7"),
    "negative decimal comma": (SUSPENSION, "step: 0.01", "step: 0.01, rho_inf: §-0,5", "time.rho_inf", "write -0.5"),
    "decimal comma in a vector": (SUSPENSION, PINNED, "{kind: pinned, position: §[0,5, 0, 0]}", "ends.start.position", "not a comma"),
    "straight, a word": (SUSPENSION, STRAIGHT, "§straight", "initial.direction", "`{kind: straight, direction: [1, 0, 0]}`"),
    "zones, a word": (SUSPENSION, MODEL, "§zones", "model.zones", "`{kind: zones, zones: [{rod: ...}, {catenary: ...}]}`"),
    "missing end": (SUSPENSION, f"start: {PINNED}", "", "ends.start", "add `start: {kind: pinned, position: [x, y, z]}`"),
    "too fast for the step": (OCEAN, "step: 0.02", "step: §2", "time.step", "a sixth of the shortest period, 1.33 s, of ends.end.motion.heave"),
    "no time at all": (EVERYTHING, "until: 3.0", "until: §0", "ends.end.force.until", "> 0"),
}  # fmt: skip


SEVERAL = {
    "negative decimal comma",
    "drag without fluid",
    "added mass without fluid",
    "motion twice",
    "zone of no kind",
    "polyline elsewhere",
}


@pytest.mark.parametrize("name", CASES)
def test_refusal(name: str) -> None:
    refused(CASES[name], alone=name not in SEVERAL)


def test_a_complaint_reads_well() -> None:
    text = change(SUSPENSION, MASS, "mass: 2 kg/m")
    (complaint,) = complaints(text)
    assert complaint.text("a.yaml") == (
        "a.yaml:9:13: cable.sections[0].mass\n"
        "    given:    2 kg/m\n"
        "    expected: a number > 0, in kg/m\n"
        "    try:      write the number alone, 2; the unit is kg/m"
    )


def test_an_unknown_key_names_its_table_where_the_kind_is_no_table_of_its_own() -> None:
    section = {"length": 2.0, "mass": 1.0, "axial_stiffness": 1e5}
    ends = {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": "free"}
    pull = {"kind": "vertical_force", "at": "end"}
    with pytest.raises(SceneError) as caught:
        validate_scene({"cable": {"sections": [section]}, "ends": ends, "output": {"quantities": {"pull": pull}}})
    (wrong,) = [x for x in caught.value.complaints if x.where == "output.quantities.pull.at"]
    assert wrong.expected == "a key of output.quantities.pull" and wrong.fix == "did you mean end?"


def test_nothing_is_said_twice() -> None:
    (kind,) = complaints(change(SUSPENSION, PINNED, "{kind: xyzzy, position: [0, 0, 0]}"))
    assert kind.expected == "one of: pinned, clamped, guided, free, body" and kind.fix == "write one of these"
    (bare,) = complaints(change(SUSPENSION, STRAIGHT, "straight"))
    assert bare.value == "nothing"


# Words of engineers, and the key of the same table, or the kind, that descriptions say they are.
SAID = {
    "sections": {
        "ei": "bending_stiffness", "gj": "torsional_stiffness", "ea": "axial_stiffness", "weight": "mass", "od": "diameter",
        "modulus": "axial_stiffness (N) or bending_stiffness", "cd": "drag: {normal: ...}", "ca": "added_mass",
        "bending_stifness": "bending_stiffness", "lenght": "length",
    },
    "fluid": {"rho": "density", "wind": "current", "msl": "surface", "sea_level": "surface", "wave": "waves"},
    "environment": {"g": "gravity", "ground": "seabed", "water": "fluid", "current": "fluid: {density: ...}", "veer": "environment.fluid.current.veer"},
    "start": {"built_in": "clamped", "hinge": "pinned", "anchor": "pinned", "vessel": "body", "rov": "body"},
    "time": {"dt": "step", "time_step": "step", "durations": "duration"},
    "model": {"beam": "rod", "string": "catenary", "hybrid": "zones"},
}  # fmt: skip
PLACES = {
    "sections": "cable.sections[0].{}", "fluid": "environment.fluid.{}", "environment": "environment.{}",
    "start": "ends.start.kind", "time": "time.{}", "model": "model.kind",
}  # fmt: skip


@pytest.mark.parametrize(("table", "word"), [(table, word) for table, words in SAID.items() for word in words])
def test_words_of_engineers_are_understood(table: str, word: str) -> None:
    where, meant = PLACES[table], SAID[table][word]
    key, value = (where.format(word), "1") if "{}" in where else (where, word)
    path = re.findall(r"\w+", key)
    data = YAML(typ="safe", pure=True).load(SUSPENSION)
    here = data
    for part in path[:-1]:
        here = here[int(part) if part.isdigit() else part]
    here[path[-1]] = value
    with pytest.raises(SceneError) as caught:
        validate_scene(data)
    (complaint,) = [c for c in caught.value.complaints if c.where == key]
    assert f"did you mean {meant}" in complaint.fix, complaint


def test_numbers_are_given() -> None:
    (zones,) = complaints(change(SUSPENSION, ZONES, "[{catenary: 1.4}, {rod: 0.5}]"))
    assert "1.9 m" in zones.value and "2 m" in zones.expected and "0.1 m too short" in zones.expected
    (span,) = complaints(change(change(OCEAN, "axial_stiffness: 2.0e8, ", ""), "[205, 0, 0]", "[300, 0, -100]"))
    assert "300 m from the start" in span.value and "250 m" in span.expected
    (rod,) = complaints(change(SUSPENSION, BENDING, "bending_stiffness: 0"))
    assert "model.zones[1]" in rod.expected and "cable.sections[0]" in rod.expected


def test_everything_wrong_is_said_at_once_and_in_order() -> None:
    text = SUSPENSION
    text = change(text, MASS, "mass: -1")
    text = change(text, PINNED, "{kind: pinned, position: [0, 0], force: [1, 0, 0]}")
    text = change(text, "gravity: 9.8", "gravty: 9.8")
    text = change(text, "step: 0.01", "step: 30")
    text = change(text, "{every: 0.1}", "{every: 0.1, history: [-1]}")
    found = complaints(text)
    assert [c.where for c in found] == [
        "environment.gravty",
        "cable.sections[0].mass",
        "ends.start.position",
        "ends.start.force",
        "time.step",
        "output.history[0]",
    ]


def test_contradictions_show_although_another_table_cannot_be_read() -> None:
    text = change(change(SUSPENSION, ZONES, "[{catenary: 1.4}, {rod: 0.5}]"), "step: 0.01", "step: x")
    text = change(text, PINNED, "{kind: pinned, position: [0, 0, 0], motion: {heave: {amplitude: 1, period: 3}}}")
    assert [c.where for c in complaints(text)] == ["ends.start.motion", "model.zones", "time.step"]


ACCEPTED = {
    "straight, end held": (SUSPENSION, f"start: {PINNED}\n  end:   {GUIDED}", f"start: free\n  end: {PINNED}"),
    "straight, origin repeated": (SUSPENSION, STRAIGHT, "{kind: straight, direction: [3, 0, 0], origin: [0, 0, 1.0e-9]}"),
    "straight, nothing held": (SUSPENSION, f"{PINNED}\n  end:   {GUIDED}\ninitial: {STRAIGHT}", "free\n  end: free\ninitial: {kind: straight, direction: [1, 0, 0], origin: [1, 2, 3], velocity: [1, 0, 0]}"),
    "straight, both held, fits": (OCEAN, "[205, 0, 0], motion: {heave: {amplitude: 2.0, period: 8.0}, ramp: 16.0}}\ninitial: {kind: equilibrium}", "[250, 0, -100]}\ninitial: {kind: straight, direction: [1, 0, 0]}"),
    "extensible, stretched": (OCEAN, "[205, 0, 0]", "[233, 0, 0]"),
    "a rope that stretches": (OCEAN, "axial_stiffness: 2.0e8, bending_stiffness: 2.0e3,", "axial_stiffness: 2.0e8, max_strain: 0.5,"),
    "mercury": (OCEAN, "density: 1025", "density: 13534"),
    "a studless chain by the diameter of its bar": (OCEAN, "mass: 20,", "mass: 55,"),
    "foam": (OCEAN, "mass: 20,", "mass: 0.04,"),
    "any mass without a diameter": (EVERYTHING_ELSE, "mass: 1.0,", "mass: 1.0e6,"),
    "equal stiffnesses need no torsion": (EVERYTHING_ELSE, "bending_stiffness: 2.0", "bending_stiffness: [2.0, 2.0]"),
    "torsion absent in a rod": (SUSPENSION, "      torsional_stiffness: 1.963495e-4\n", ""),
    "polyline, extensible": (EVERYTHING_ELSE, "mass: 1.0,", "mass: 1.0, axial_stiffness: 1.0e9,"),
    "catenary cannot twist": (EVERYTHING_ELSE, "mass: 1.0,", "mass: 1.0, torsional_stiffness: 0,"),
    "no gravity": (SUSPENSION, "gravity: 9.8", "gravity: 0"),
    "zones within round-off": (SUSPENSION, ZONES, "[{catenary: 1.5000000001}, {rod: 0.5}]"),
}  # fmt: skip


@pytest.mark.parametrize("name", ACCEPTED)
def test_accepted(name: str) -> None:
    assert complaints(change(*ACCEPTED[name])) == []


# --- every pair of features that is refused, with the reason of the table, where the scene asks for it ---

CABLE: dict[str, Any] = cable_scene(
    {"length": 10, "mass": 2, "diameter": 0.03, "axial_stiffness": 1e6, "bending_stiffness": 10,
     "torsional_stiffness": 10},
    clamped_at([0, 0, 0], [1, 0, 0]), clamped_at([8, 0, 0], [1, 0, 0]), gravity=9.81, model="rod", time=(3.0, 0.1)
)  # fmt: skip
LINES: dict[str, Any] = network_scene(
    {"a": {"position": [0, 0, 0]}, "b": {"position": [8, 0, 0]}},
    {"one": line_between("a", "b", CABLE["cable"]["sections"])}, time=(3.0, 0.1)
)  # fmt: skip

SECTION, END, ONE = "cable.sections.0.", "ends.end.", "lines.one."
TORQUE = {SECTION + "tension_torque": 1e-3}
PAID: dict[str, Any] = {END + "payout": {"rate": 0.1, "ramp": 1.0}}
MOVING = {"model": {"kind": "adaptive"}}
TWO = {SECTION + "bending_stiffness": [10, 20], END + "normal": [0, 1, 0]}
_HALF = {key: x for key, x in CABLE["cable"]["sections"][0].items() if key != "bending_stiffness"} | {"length": 5}
TABLE_BESIDE_TWO = {
    "cable.sections": [_HALF | {"bending_stiffness": [10, 20]}, _HALF | {"moment_curvature": [[0, 0], [1, 10]]}],
    END + "normal": [0, 1, 0],
}
LOCKS: dict[str, Any] = TWO | {"cable.attachments": [{"kind": "bend_restrictor", "range": [0, 2], "radius": 2}]}
SLIPS: dict[str, Any] = {SECTION + "bending_slip": [{"stiffness": 20, "moment": 1}]}
ROPE = {SECTION + "dynamic_stiffness": {"constant": 2e6, "relaxation_time": 100}}
SHEDS: dict[str, Any] = {SECTION + "vortices": {}, "environment.fluid": {"density": 1025, "current": [0.3, 0, 0]}}
HIGH_WAVES: dict[str, Any] = {"environment.fluid": {
    "density": 1025, "surface": 5, "waves": {"kind": "stream_function", "height": 1, "period": 5, "ramp": 9}}}  # fmt: skip
OTHER_LINE = {"start": "a", "end": "b", "sections": [{"length": 9.5, "mass": 1, "diameter": 0.02}]}
TWO_LINES = {"lines.two": OTHER_LINE, "contact": {}}

# By the pair: what makes a scene of CABLE, or of LINES, that has both, and what is done with it.
EXAMPLES: dict[tuple[c.Feature, c.Feature], tuple[dict[str, Any], Use]] = {
    (c.TWO_STIFFNESSES, c.MOVING_ZONES): (TWO | MOVING, ""),
    (c.SLIP, c.MOVING_ZONES): (SLIPS | MOVING, ""),
    (c.TORSION, c.PLANE): (TORQUE | {"dimension": 2}, ""),
    (c.ESTIMATED, c.LINES_TOUCH): (TWO_LINES | {"accuracy": "3%"}, ""),
    (c.SETTLED_FRICTION, c.GOES_ITS_WAY): (TWO_LINES | {ONE + "initial": {"friction": "settled"}}, ""),
    (c.OTHER_MOTIONS, c.RESPONSE): (
        {"ends.end": {"kind": "free", "force": {"value": [1, 0, 0], "until": 2}}}, "response"
    ),
    (c.DERIVATIVES, c.SETTLED_FRICTION): ({"initial": {"kind": "equilibrium", "friction": "settled"}}, "derivatives"),
    (c.PAYOUT_AT_START, c.PAYOUT_AT_END): (PAID | {"ends.start.payout": {"rate": 0.1, "ramp": 1.0}}, ""),
    (c.DAMPED_OTHERWISE, c.PAYOUT): (PAID | ROPE | {SECTION + "damping": {"stiffness": 0.01}}, ""),
    (c.VORTICES, c.PLANE): (SHEDS | {"dimension": 2}, ""),
    (c.VORTICES, c.RESPONSE): (SHEDS, "response"),
    (c.FINITE_WAVES, c.RESPONSE): (HIGH_WAVES, "response"),
    (c.PRESCRIBED_OBSTACLES, c.RESPONSE): (
        {"obstacles": {"roller": {"kind": "sphere", "at": [0, 0, -50], "radius": 1,
                                  "motion": {"heave": {"amplitude": 0.1, "period": 6}, "ramp": 9}}}}, "response"
    ),
}  # fmt: skip
# Other examples of pairs whose one reason is that of several features.
OTHERS: tuple[tuple[tuple[c.Feature, c.Feature], dict[str, Any], Use], ...] = (
    ((c.TORSION, c.PLANE), {END + "turns": 2, "dimension": 2}, ""),
    ((c.SLIP, c.MOVING_ZONES), TABLE_BESIDE_TWO | MOVING, ""),
    ((c.SLIP, c.MOVING_ZONES), LOCKS | MOVING, ""),
    ((c.SLIP, c.MOVING_ZONES), {SECTION + "stiffness_per_tension": 0.01} | MOVING, ""),
    ((c.ESTIMATED, c.LINES_TOUCH), TWO_LINES | {"time": {"duration": 3.0}}, ""),
    ((c.ESTIMATED, c.LINES_TOUCH), TWO_LINES | {"output.errors": True}, ""),
)


def _scene(changes: dict[str, Any], several: bool) -> Scene | Network:
    return read_text(yaml.safe_dump(tables_with(LINES if several else CABLE, changes), sort_keys=False))[0]


def _of_several(changes: dict[str, Any]) -> bool:
    return any(key.startswith("lines.") for key in changes)


def _id(x: object) -> str:
    return f"{x[0].name} x {x[1].name}" if isinstance(x, tuple) else ""


def test_every_refusal_has_an_example() -> None:
    pairs = [(x.feature, x.beside) for x in REFUSALS]
    assert len(set(pairs)) == len(pairs)
    assert set(pairs) == set(EXAMPLES)


@pytest.mark.parametrize(("pair", "changes", "use"), [*((k, *x) for k, x in EXAMPLES.items()), *OTHERS], ids=_id)
def test_it_is_refused_with_its_reason_and_remedy(
    pair: tuple[c.Feature, c.Feature], changes: dict[str, Any], use: Use
) -> None:
    """With the reason, what to do and, where the scene alone asks for both, the line of the file."""
    refusal = next(x for x in REFUSALS if (x.feature, x.beside) == pair)
    with pytest.raises(SceneError) as told:
        refuse_use(_scene(changes, _of_several(changes)), use, "asked")
    pattern = re.escape(f"{refusal.expected}, because {refusal.why}").replace(r"\{key\}", r"[\w.\[\]]+")
    mine = [x for x in told.value.complaints if re.fullmatch(pattern, x.expected)]
    assert mine, told.value
    for x in mine:
        assert x.fix and (x.line or use) and (x.value or not use), told.value


def test_nothing_else_refuses_a_combination() -> None:
    """Reasons of the table stand in no other file of the package."""
    root = Path(hybrid.__file__).parent
    reasons = [x.why.partition("{key}")[0].strip(" (,") for x in REFUSALS]
    words = {x for x in reasons if len(x) > 20}
    for path in root.rglob("*.py"):
        if path.name not in ("combinations.py", "plane.py"):  # this one: what does not lie in a plane
            text = path.read_text(encoding="utf-8")
            assert not [x for x in words if f"because {x}" in text], path
