"""Torque through catenary zones of lines in a scene of several: as of one cable, through points, on bodies."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.kernels.step.line_step import TOLERANCE
from hybrid.simulation import lines_stiffness
from tests.scenes import line_between, network_scene
from tests.simulation.bits import resumed

LENGTH, CELLS, GJ = 40.0, 40, 150.0
SECTION = {
    "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e6, "bending_stiffness": 60.0, "torsional_stiffness": GJ,
    "drag": {"normal": 1.2}, "added_mass": {"normal": 1},
}  # fmt: skip
A, B = [0.0, 0.0, 0.0], [34.0, 4.0, -6.0]
START = {"tangent": [1, 0, -0.4], "normal": [0, 0, 1]}
END = {"tangent": [1, 0.2, 0.3], "normal": [0, 1.0, 0.3]}
ZONES = [("rod", 6), ("catenary", 10), ("rod", 8), ("catenary", 10), ("rod", 6)]
MOTION = {"sway": {"amplitude": 0.5, "period": 3.0}, "roll": {"amplitude": 30, "period": 3.0}, "ramp": 2.0}
COMMON = {
    "environment": {"fluid": {"density": 1025, "current": [0.3, 0.4, 0]}}, "time": {"duration": 3.0, "step": 0.1},
}  # fmt: skip


def zoned(zones: Any) -> dict[str, Any]:
    return {"kind": "zones", "zones": [{kind: length, "cells": length} for kind, length in zones]}


def one(**more: Any) -> dict[str, Any]:
    ends = {
        "start": {"kind": "clamped", "position": A, **START},
        "end": {"kind": "clamped", "position": B, "motion": MOTION, **END},
    }
    cable = {"sections": [SECTION | {"length": LENGTH}]}
    scene = {
        "cable": cable,
        "ends": ends,
        "initial": "equilibrium",
        "model": zoned(ZONES),
        "output": {"every": 0.1, "points": CELLS + 1},
    }
    return COMMON | scene | more


def line(start: str, end: str, zones: Any, connections: dict[str, Any]) -> dict[str, Any]:
    length = sum(x for _, x in zones)
    model = zoned(zones) if len(zones) > 1 else "rod"
    mesh = {} if len(zones) > 1 else {"mesh": {"cells": length}}
    return line_between(start, end, SECTION | {"length": float(length)}, connections=connections, model=model) | mesh


def several(lines: dict[str, Any], **points: Any) -> dict[str, Any]:
    points = {"a": {"position": A}, "b": {"position": B, "motion": MOTION}} | points
    return COMMON | {"points": points, "lines": lines, "output": {"every": 0.1, "points": CELLS + 1}}


CUT = {"cut": {"initial_guess": [16.0, 2.0, -8.0]}}
BEFORE, AFTER = [*ZONES[:2], ("rod", 4)], [("rod", 4), *ZONES[3:]]
PIECES = {
    "whole, the other way": [(ZONES, True)],
    "zones on both sides of a point": [(BEFORE, False), (AFTER, False)],
    "that both run to": [(BEFORE, False), (AFTER, True)],
}


def turned(held: Any) -> Any:
    if not isinstance(held, dict):
        return held
    turns = {"turns": -held["turns"]} if "turns" in held else {}
    return held | {"tangent": [-x for x in held["tangent"]]} | turns


def in_pieces(name: str) -> dict[str, Any]:
    lines = {}
    for k, (zones, flipped) in enumerate(PIECES[name]):
        first, last = k == 0, k == len(PIECES[name]) - 1
        ends = ["a" if first else "cut", "b" if last else "cut"]
        held: list[Any] = [START if first else "clamped", END if last else "clamped"]
        if flipped:
            ends, held, zones = ends[::-1], [turned(x) for x in held[::-1]], zones[::-1]
        lines[f"line{k}"] = line(ends[0], ends[1], zones, {"start": held[0], "end": held[1]})
    return several(lines, **(CUT if len(lines) > 1 else {}))


@pytest.fixture(scope="module")
def plain() -> hybrid.Result:
    return hybrid.run(one())


C = 5e-3
RODS = {"model": "rod", "mesh": {"cells": CELLS}}


def armoured(scene: dict[str, Any], model: str = "") -> dict[str, Any]:
    """The same of lines in which tension makes a torque; model: of all of them, none: as they are."""
    parts = [scene["cable"]["sections"]] if "cable" in scene else []
    for x in scene.get("lines", {}).values():
        parts.append(x["sections"])
        if model:
            x |= {"model": model, "mesh": {"cells": int(x["sections"][0]["length"])}}
    for sections in parts:
        sections[:] = [section | {"tension_torque": C} for section in sections]
    return scene


@pytest.mark.parametrize(("name", "model"), [(name, None) for name in PIECES] + [
    pytest.param(*x, marks=pytest.mark.long) for x in (
        ("whole, the other way", ""), ("zones on both sides of a point", ""),
        ("whole, the other way", "rod"), ("zones on both sides of a point", "rod"), ("that both run to", "rod"),
    )
])  # fmt: skip
def test_torque_passes_as_in_one_cable(plain: hybrid.Result, name: str, model: str | None, tmp_path: Path) -> None:
    """At rest and in motion, in one line, or in two that are clamped to a free point, either way round.

    Where it is cut two elements of half a cell differ from one by the product of bend and twist of a cell.  With a model,
    or "" for that of each zone, tension makes a torque, too; with exact derivatives at a clamp that turns where all is rod.
    """
    whole = plain if model is None else hybrid.run(armoured(one(**(RODS if model else {}))))
    found = hybrid.run(in_pieces(name)) if model is None else resumed(armoured(in_pieces(name), model), tmp_path, 1.5)
    at_rest, lines = whole["torque"][0], [*found.lines.values()]
    assert np.ptp(whole["torque"][:, 20]) > 0.3
    assert np.abs(at_rest).min() > 1.0 if model is None else at_rest.max() < -3.0  # -5 without
    if len(lines) == 1:
        apart = np.abs(lines[0]["position"][:, ::-1] - whole["position"])
        assert apart[0].max() < 1e-9 * LENGTH and apart.max() < 20 * TOLERANCE * LENGTH
    else:
        assert np.abs(found["points/cut/position"] - whole["position"][:, 20]).max() < 1e-7 * LENGTH
    for moment, key in ((found["points/a/moment"], "moment_start"), (found["points/b/moment"], "moment_end")):
        assert np.abs(moment + whole[key]).max() < 1e-4 * np.abs(whole[key]).max()
    if model:
        assert lines[0]["steps/iterations"].sum() <= whole["steps/iterations"].sum() + 5


def test_turns_the_other_way_and_on_a_body() -> None:
    """Two taut lines to a body that is held: GJ 2 pi n / L in each, whichever end says it."""
    scene = on_a_body([0, 0, 0])
    scene["bodies"]["body"] = {"position": scene["bodies"]["body"]["initial_guess"], "rotation": [20, 0, 0]}
    for name, turns in (("one", 3.25), ("two", -1.0)):
        held = scene["lines"][name]["connections"]
        scene["lines"][name]["connections"] = held | {"end": held["end"] | {"turns": turns}}
    found = hybrid.static(scene)
    for name, turns in (("one", 3.25 + 20 / 360), ("two", -1.0 - 20 / 360)):
        assert found.lines[name]["torque"][-1] == pytest.approx(GJ * 2.0 * np.pi * turns / 20.0, rel=1e-6)


def test_turns_that_cells_cannot_hold_are_said() -> None:
    rods = {"model": "rod", "mesh": {"cells": 8}}
    scene = several({"line": line("a", "b", [("rod", 40)], {"start": START, "end": END | {"turns": 9}}) | rods})
    with pytest.raises(hybrid.ComputationError, match=r"line line; lines\.line\.connections\.end\.turns: 9; 8 cells"):
        hybrid.static(scene)
    scene["lines"]["line"]["connections"]["start"] = START | {"swivel": True}
    with pytest.raises(hybrid.SceneError, match=r"lines\.line\.connections\.start turns freely"):
        hybrid.static(scene)


def test_a_body_between_lines_whose_tension_makes_a_torque() -> None:
    """One line gets M/2 more than c T and the other M/2 less; the first, twisted on, is shorter by c M/2 L/GJ."""
    found = hybrid.static(armoured(on_a_body([9.0, 0, 0])))
    tension = float(found.lines["one"].tension[-1, 50])
    for name, sign in (("one", 1.0), ("two", -1.0)):
        assert found.lines[name]["torque"][-1] == pytest.approx(C * tension + sign * 4.5, rel=1e-5)
    assert found["bodies/body/rotation"][-1, 0] == pytest.approx(np.degrees(4.5 * 20.0 / GJ), rel=1e-5)
    assert found["bodies/body/position"][-1, 0] == pytest.approx(30.03 - C * 4.5 * 20.0 / GJ, abs=1e-6)


def on_a_body(moment: Any) -> dict[str, Any]:
    """A body between two taut lines along x without weight, turned by a moment about them."""
    held = {"start": {"tangent": [1, 0, 0], "normal": [0, 0, 1]}, "end": {"tangent": [1, 0, 0], "normal": [0, 0, 1]}}
    zones = [("rod", 4), ("catenary", 10), ("rod", 6)]
    points = {
        "a": {"position": [0, 0, 0]}, "b": {"position": [60.06, 0, 0]},
        "left": {"body": "body", "place": [-10, 0, 0]}, "right": {"body": "body", "place": [10, 0, 0]},
    }  # fmt: skip
    lines = {"one": line("a", "left", zones, held), "two": line("right", "b", zones[::-1], held)}
    for each in lines.values():
        each["sections"] = [{key: x for key, x in each["sections"][0].items() if key not in ("drag", "added_mass")}]
    given = {"initial_guess": [30.03, 0, 0], "mass": 50, "inertia": [40, 900, 900], "moment": moment}
    return {"environment": {"gravity": 0.0}, "points": points, "lines": lines, "bodies": {"body": given}}


def test_a_body_is_held_by_the_torque_of_its_lines() -> None:
    """It turns by M/(2 GJ/L), with half of the moment in each line."""
    found = hybrid.static(on_a_body([9.0, 0, 0]))
    assert found["bodies/body/rotation"][-1] == pytest.approx(
        [np.degrees(9.0 / (2 * GJ / 20.0)), 0, 0], rel=1e-6, abs=1e-6
    )
    for name, sign in (("one", 1.0), ("two", -1.0)):
        assert found.lines[name]["torque"][-1] == pytest.approx(sign * 4.5, rel=1e-6)


def test_a_body_swings_about_lines_that_hold_it_by_torque() -> None:
    """Torsion pendulum let go: period 2 pi sqrt(J/(2 GJ/L)), and its energy stays."""
    time = {"time": {"duration": 14.0, "step": 0.1, "rho_inf": 1.0}, "output": {"every": 0.1}}
    found = hybrid.run(on_a_body({"value": [9.0, 0, 0], "until": 0.1}) | time)
    angle, t = found["bodies/body/rotation"][1:, 0], found.times[1:] - 0.1
    w = np.sqrt(2 * GJ / 20.0 / 40.0)
    assert angle == pytest.approx(angle[0] * np.cos(w * t), abs=0.02 * angle[0])


def test_a_line_that_breaks_passes_no_torque_any_more(tmp_path: Path) -> None:
    """A twisted line that hangs: its twist goes, and the event has the energy of what lost it; resumed bit for bit."""
    down = {"tangent": [0, 0, -1]}
    hanging = line("top", "low", [("rod", 4), ("catenary", 12), ("rod", 4)], {})
    hanging["connections"] = {"start": down | {"normal": [1, 0, 0]}, "end": down | {"normal": [1, 1, 0]}}
    scene = network_scene(
        {"top": {"position": [0, 0, 0]}, "low": {"position": [0, 0, -20.0026]}},
        {"line": hanging | {"break_at": {"time": 0.02}}}, fluid={"density": 1025}, time=(0.06, 0.001), output=0.005
    )  # fmt: skip
    with resumed(scene, tmp_path, 0.04) as result:
        (told,) = (x for x in result.events if x.kind == "end released")
        hung = result.lines["line"]
        torque, after = hung["torque"], result.times > told.t  # an output at that instant is of the moment before
        assert np.abs(torque[~after]) == pytest.approx(0.25 * np.pi * GJ / 20.0, rel=1e-3)
        assert not torque[after][:, (hung.s > 4.0) & (hung.s < 16.0)].any()
        # the zone from cell to cell, and the half element between the end and its clamp
        assert told.energy == pytest.approx(-0.5 * GJ * (0.25 * np.pi / 20.0) ** 2 * 13.5, rel=1e-3)
        assert abs(hung["work/scheme"][-1]) < 0.05 * hung["energy/torsion"][0]


def test_a_rod_that_breaks_spins_with_the_energy_that_it_has() -> None:
    """Of 45 degrees in 20 m, in steps in which its last cell would spin by five radians against the next one.

    A step after one of half its length gives stiff modes up to a quarter of their energy, and takes it out again.
    """
    down = {"tangent": [0, 0, -1]}
    clamps = {"start": down | {"normal": [1, 0, 0]}, "end": down | {"normal": [1, 1, 0]}}
    hanging = line("top", "low", [("rod", 20)], clamps)
    result = hybrid.run(network_scene(
        {"top": {"position": [0, 0, 0]}, "low": {"position": [0, 0, -20.0026]}},
        {"line": hanging | {"break_at": {"time": 0.02}}}, fluid={"density": 1025}, time=(1.0, 0.02), output=0.02
    ))  # fmt: skip
    hung = result.lines["line"]
    alive = hung["energy/kinetic"] + hung["energy/torsion"]
    assert alive[0] == pytest.approx(0.5 * GJ * (0.25 * np.pi) ** 2 / 20.0, rel=1e-3)
    assert alive.max() <= 1.25 * alive[0] and hung["work/scheme"].max() < 0.3 * alive[0]
    assert alive[10:].max() < 0.8 * alive[0]
    assert hung["work/scheme"][-1] < 0.0


@pytest.mark.parametrize("free", [True, False])
def test_stiffness_with_a_torque_through_catenaries(free: bool) -> None:
    """A turn about two taut lines: 2 GJ/L; across them: tension over length, with the levers of the body and EI."""
    scene = on_a_body([1.0, 0, 0])
    if not free:
        scene["bodies"]["body"] = {"position": scene["bodies"]["body"]["initial_guess"]}
    found = hybrid.stiffness(scene, "body:body")
    K = found.matrix
    assert K[3, 3] == pytest.approx(2 * GJ / 20.0, rel=1e-6)
    assert K[0, 0] == pytest.approx(2 * 1e6 / 20.0, rel=1e-4)
    apart = [-0.01, 0.01]
    across = hybrid.offsets(scene, "body:body", apart, 90.0)
    assert K[1, 1] == pytest.approx(-np.diff(across.force[:, 1])[0] / 0.02, rel=2e-4)
    assert K[2, 2] == pytest.approx(K[1, 1], rel=1e-6) and K[5, 5] == pytest.approx(K[4, 4], rel=1e-6)
    assert np.array_equal(found.lines, K)  # nothing else holds it


def test_stiffness_between_equilibria_is_that_of_the_factors(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a body whose lines bear no torque through catenaries, where both are known."""
    scene = on_a_body([0.0, 0, 0])
    for each in scene["lines"].values():
        each |= {"model": "rod", "mesh": {"cells": 20}}
    scene["environment"] = {"gravity": 9.81}
    scene["bodies"]["body"]["force"] = {"value": [0, 200, 300.0]}
    exact = hybrid.stiffness(scene, "body:body").matrix
    monkeypatch.setattr(lines_stiffness, "_needs_equilibria", lambda solver: True)
    found = hybrid.stiffness(scene, "body:body").matrix
    assert np.abs(found - exact).max(axis=0) == pytest.approx(0.0, abs=1e-5 * np.abs(exact).max())
