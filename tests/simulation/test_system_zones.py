"""Zones that move in lines of a network: those of the cable, each line by itself, through stops and breaks."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from bits import Stopping, differences, went_on
from test_system_payout import crane

import hybrid
from hybrid.errors import SceneError
from hybrid.simulation.cell_changes import CellChanges
from hybrid.simulation.payout_nodes import NodeChanges
from hybrid.simulation.run_of_lines import RunOfLines
from hybrid.solve.network_steps import NetworkSteps
from tests.combinations.pairs import as_network
from tests.inside import calls_of
from tests.said import ONE, both_ways, line_of, said
from tests.scenes import cable_scene, each_line, line_between, network_scene, pinned_at
from tests.validation.test_validation_lines_contact import force_between, lowered

ROPE = {
    "length": 60, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e6, "bending_stiffness": 100,
    "drag": {"normal": 1.2}, "added_mass": {"normal": 1.0},
}  # fmt: skip
SEA = {"fluid": {"density": 1025, "current": [0.3, 0.2, 0]}}
MODEL = {"kind": "adaptive", "hold_time": 0.5, "tolerance": 1e-3}
LINE = {"sections": [ROPE], "mesh": {"cells": 30}, "model": MODEL}


def slackening(duration: float, section: dict[str, Any] = ROPE, **more: Any) -> dict[str, Any]:
    """A rope whose end moves towards its start."""
    end = {"kind": "pinned", "position": [50, 0, 10], "motion": {"travel": {"by": [-14, 0, 0], "over": 3.0}}}
    return cable_scene(
        section, pinned_at(0, 0, 0), end, environment=SEA, time=(duration, 0.02), mesh=30, model=MODEL,
        contact={"self": False}, dimension=3, output={"every": 0.1, "points": 31, "criteria": True, "exact": True}
    ) | more  # fmt: skip


def mooring(**more: Any) -> dict[str, Any]:
    """Three ropes to a weight that a load draws to one side and then to the other: they go slack in turn."""
    feet = {"east": [40, 0, -40], "north": [-20, 35, -40], "south": [-20, -35, -40]}
    rows = [[0, 0, 0, 0], [0.5, 2000, 0, 0], [1.5, 2000, 0, 0], [2.0, -4000, 0, 0], [6.0, -4000, 0, 0]]
    free = {"initial_guess": [0, 0, -50], "mass": 300, "volume": 0.36, "drag_area": 1, "force": {"history": rows}}
    angle = {"kind": "end_angle", "end": "end", "direction": [0, 0, -1]}
    asked = {"angle": angle | {"line": "north"}, "carrying": angle | {"line": "east"}}
    return network_scene(
        {name: {"position": x} for name, x in feet.items()} | {"float": free},
        {name: {"start": name, "end": "float"} | LINE for name in feet}, environment=SEA, time=(5.0, 0.02),
        output={"every": 0.1, "points": 31, "quantities": asked, "criteria": True}
    ) | more  # fmt: skip


@pytest.fixture(scope="module")
def three() -> hybrid.Result:
    return hybrid.run(mooring())


def changes(result: hybrid.Result) -> list[tuple[float, float, float, str]]:
    return [(round(e.t, 9), e.s_a, e.s_b, e.kind) for e in result.events if e.kind in hybrid.errors.ZONE_EVENTS]


# A static stiffness by a table, and more than that for what is fast.
FIBRES = ROPE | {
    "tension_strain": [[0, 0], [0.05, 5e4], [0.1, 2e5]],
    "dynamic_stiffness": {"constant": 5e6, "per_tension": 20, "relaxation_time": 2},
}  # fmt: skip
FIBRES.pop("axial_stiffness")


def test_fibre_ropes_keep_their_mean_tensions_when_another_line_breaks() -> None:
    """All lines begin anew then, which the order of steps feels; lost mean tensions would be 74 % of the tension."""
    scene = as_network(slackening(1.6, FIBRES, model="rod"))
    cable = hybrid.run(scene).lines["cable"]
    other = {"start": "start", "end": "c", "sections": [ROPE], "mesh": {"cells": 8}, "model": "rod"}
    scene["lines"]["other"] = other | {"break_at": {"time": 0.6}}
    scene["points"]["c"] = {"position": [0, 50, 10]}
    found = hybrid.run(scene)
    assert any(e.kind == "end released" for e in found.events)
    rope = found.lines["cable"]
    assert np.abs(rope.position - cable.position).max() < 1e-4
    assert np.abs(rope.tension - cable.tension).max() < 1e-3 * cable.tension.max()


def on_a_body(bed: Tables | None = None) -> dict[str, Any]:
    """The same ropes at a body, over a bed with friction, one of them with its foot moving: they come to rods and go."""
    scene = mooring()
    scene["points"].pop("float")
    scene["points"]["east"]["motion"] = {"surge": {"amplitude": 4.0, "period": 1.6}, "ramp": 0.4}
    for k, name in enumerate(scene["lines"]):
        turn = 2.0 * np.pi * k / 3.0
        scene["points"][f"f{k}"] = {"body": "float", "place": [float(np.cos(turn)), float(np.sin(turn)), -0.5]}
        scene["lines"][name] |= {"end": f"f{k}", "model": MODEL | {"tolerance": 1e-4, "hold_time": 0.2}}
    scene["bodies"] = {
        "float": {
            "initial_guess": [0, 0, 0], "mass": 3000, "inertia": [2e3] * 3,
            "hydrostatics": {"heave": 5e4, "roll": 1e5, "pitch": 1e5},
        },
    }  # fmt: skip
    scene["environment"] = SEA | {"seabed": {"z": -40} | (bed or {"stiffness": 1e4, "friction": 0.5})}
    scene["time"] = {"duration": 3.0, "step": 0.02}
    scene["output"] = {"every": 0.1, "points": 31}
    return scene


def test_lines_go_slack_in_turn(three: hybrid.Result) -> None:
    rods = {
        name: np.array([sum(z.s_b - z.s_a for z in zones if z.kind == "rod") for zones in line.zones])
        for name, line in three.lines.items()
    }
    first, last = (int(np.argmin(np.abs(three.times - t))) for t in (1.5, 5.0))
    assert rods["east"][first] > 25.0 and rods["north"][first] == rods["south"][first] == 0.0, rods
    assert rods["east"][last] < 25.0 < min(rods["north"][last], rods["south"][last]), rods
    for name, line in three.lines.items():
        assert three.attributes["lines"] == 3 and line.status == "complete"
        told = [e for e in three.events if e.text.startswith(f"line {name}: ") and e.kind in hybrid.errors.ZONE_EVENTS]
        assert len(told) == len(changes(line)) > 0


def test_ranges_of_named_quantities_go_on_through_changes(three: hybrid.Result) -> None:
    for name in ("angle", "carrying"):  # the second at an end that carries the float
        (low, high), angle = three[f"extremes/{name}"], three[name]
        apart = 1e-14 * high  # outputs and steps are computed by two kernels
        assert low <= angle.min() + apart and angle.max() <= high + apart, (name, low, high, angle)
        assert high < 1.2 * angle.max() and low > 0.5 * angle.min(), name  # steps see what outputs miss


def test_against_rods(three: hybrid.Result) -> None:
    rods = hybrid.run(each_line(mooring(), model="rod"))
    for name, line in three.lines.items():
        assert np.abs(line.position - rods.lines[name].position).max() < 0.005 * 60.0, name
    there, here = (x["points/float/position"] for x in (rods, three))
    assert np.abs(there - here).max() < 0.002 * 60.0


def test_what_is_not_computed_is_refused() -> None:
    given = mooring()
    given["lines"]["east"] = given["lines"]["east"] | {"connections": {"end": {"tangent": [0, 0, 1]}}}
    with pytest.raises(SceneError) as refused:
        hybrid.run(given)
    assert "connections" in refused.value.complaints[0].where


def asks_for_the_middle(look: hybrid.NodeState) -> np.ndarray:
    """A criterion that asks for rods where and when nothing else would."""
    return np.where((look.s > 20) & (look.s < 30) & (look.t > 0.2), 1.5, 0.0)


@both_ways
def test_a_criterion_of_ones_own_asks_for_rods(network: bool) -> None:
    """It sees the name of the line, which a cable has none of."""
    scene, seen = said(slackening(0.6), network), set()

    def criterion(look: hybrid.NodeState) -> np.ndarray:
        seen.add(look.line)
        return asks_for_the_middle(look)

    quiet, line = line_of(hybrid.run(scene)), line_of(hybrid.run(scene, criterion=criterion))
    assert seen == {ONE if network else ""}
    assert [*line.zones] != [*quiet.zones]
    assert any(x.kind == "rod" and x.s_a < 25 < x.s_b for x in line.zones[-1])


def test_a_criterion_sees_the_line_that_it_is_asked_for() -> None:
    """And asks for rods in that alone; where no zones move there is nothing to ask for."""
    short = mooring(time={"duration": 0.3, "step": 0.02})
    result = hybrid.run(short, criterion=lambda look: np.full(look.s.size, 1.5 * (look.line == "north")))
    kinds = {name: {x.kind for x in line.zones[-1]} for name, line in result.lines.items()}
    assert kinds["north"] == {"rod"} and "catenary" in kinds["east"] & kinds["south"]
    with pytest.raises(TypeError, match="not adaptive"):
        hybrid.run(each_line(short, model="rod"), criterion=lambda look: look.s)


@pytest.mark.long
def test_a_resumed_run_asks_the_same_criterion(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is the run that was not stopped, bit for bit; without the criterion it is refused."""
    scene: Any = said(slackening(0.6), network=True)
    whole, path, stopping = tmp_path / "whole.h5", tmp_path / "run.h5", Stopping(monkeypatch)
    hybrid.run(scene, whole, criterion=asks_for_the_middle, progress=stopping).close()
    assert went_on(scene, path, stopping, [stopping.heard // 2], criterion=asks_for_the_middle) == 1
    assert differences(whole, path) == []
    stopping.stop(stopping.heard // 4, hybrid.run, scene, path, criterion=asks_for_the_middle)
    with pytest.raises(hybrid.ResultError, match="criterion"):
        hybrid.resume(path)


# --- Cells that follow the curvature in lines of several: in compiled steps, beside others, at a winch, resumed,
# stepped ---

Tables = dict[str, Any]
SHARE = 0.05
TOUCHDOWN = Path(__file__).parents[2] / "examples" / "touchdown.yaml"
FOLLOWS = {"kind": "adaptive", "curvature_error": SHARE}


def followed(**more: Any) -> Tables:
    """Three ropes to a weight, whose cells follow the curvature."""
    return each_line(mooring(**more), model=FOLLOWS)


ROPE_BETWEEN = {"length": 60.0, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e6, "bending_stiffness": 100.0}
ROPE_BETWEEN |= {"drag": {"normal": 1.2}}
HEAVED = {"a": {"position": [0, 0, 0], "motion": {"heave": {"amplitude": 2.0, "period": 2.0}, "ramp": 1.0}}}
HEAVED |= {"b": {"position": [40, 0, 0]}}
AT_ONCE = {"kind": "adaptive", "tolerance": 1e-3, "hold_time": 0.1}


def heaved(more: Tables = AT_ONCE, **tables: Any) -> Tables:
    """A rope whose end heaves, and whatever else there is."""
    line = line_between("a", "b", ROPE_BETWEEN, mesh=20, model=AT_ONCE | more, contact={"self": False})
    lines, points = tables.pop("lines", {}), tables.pop("points", {})
    return network_scene(HEAVED | points, {"rope": line} | lines, fluid={"density": 1025}, **tables)


@pytest.mark.long
@pytest.mark.parametrize("model", [{}, {"curvature_error": 0.05}], ids=["zones", "cells"])
def test_steps_that_follow_the_motion_go_by_zones_and_not_by_pauses(model: Tables, monkeypatch: Any) -> None:
    """A review that lets rods go bounds the next step at once, and not when Python has looked."""
    scene = heaved(model, time={"duration": 4.0, "step": 0.04, "tolerance": 1e-3}, output={"every": 0.1})
    found = []
    for _ in range(2):
        with hybrid.run(scene) as result:
            found.append(result.lines["rope"].steps.t)
        monkeypatch.setattr("hybrid.solve.network_steps.CELL_STEPS", 1)  # a step a call
    assert np.array_equal(*found)


@pytest.mark.long
def test_the_least_clearance_is_that_of_the_cells_of_now() -> None:
    """That of part of a line begins at its nearest node, which is another one when cells have changed."""
    gap = {"kind": "clearance", "line": "rope", "other": "far", "range": [3.1, 17.7]}
    far = {"far": line_between("c", "d", ROPE_BETWEEN | {"length": 51.0}, mesh=20, model="catenary")}
    scene = heaved(
        {"curvature_error": 0.05}, lines=far, points={"c": {"position": [60, 25, -5]}, "d": {"position": [60, -25, -5]}},
        time=(2.5, 0.02), contact={"between": []}, output={"every": 0.02, "quantities": {"gap": gap}},
    )  # fmt: skip
    with hybrid.run(scene) as result:
        assert len({*cells(result.lines["rope"])}) > 1
        least, most = result["extremes/gap"].ravel()
        assert least <= result["gap"].min() + 1e-9 and result["gap"].max() <= most + 1e-9


def cells(line: hybrid.Result) -> list[int]:
    return [mesh.s.size - 1 for mesh in line.mesh]


@pytest.mark.long
@pytest.mark.parametrize(
    "model", [FOLLOWS | {"force_rod": [[0, 250]]}, FOLLOWS | {"hold_time": 2.0}], ids=["rod", "zones"]
)
def test_cells_change_without_python_as_with_it(model: Tables, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a line that is joined to nothing that moves: steps go on through changes, and outputs of all cells wait."""
    tables = yaml.safe_load(TOUCHDOWN.read_text()) | {
        "model": model, "mesh": {"cells": 24}, "time": {"duration": 10.0, "step": 0.1}, "output": {"every": 0.1},
    }  # fmt: skip
    calls = calls_of(monkeypatch, NetworkSteps, "go")
    whole = hybrid.run(said(tables, network=True))
    line, compiled = line_of(whole), len(calls)
    monkeypatch.setattr(CellChanges, "may_change", lambda run, number, switching: False)
    cable = line_of(hybrid.run(said(tables, network=True)))
    assert compiled <= 0.7 * (len(calls) - compiled)
    assert cells(line) == cells(cable) and len({*cells(cable)}) > 3
    assert [(e.t, e.kind) for e in line.events] == [(e.t, e.kind) for e in cable.events]
    for name in ("position", "tension", "curvature", "work/zones", "energy/bending", "envelope/tension_max"):
        assert np.abs(line[name] - cable[name]).max() <= 1e-9 * np.abs(cable[name]).max(), name
    assert np.array_equal(whole["points/end/position"], line.position[:, -1])


def with_ends_exchanged() -> Tables:
    """Three ropes that start at the weight, beside another one that is joined to nothing."""
    scene = followed()
    for line in scene["lines"].values():
        line["start"], line["end"] = line["end"], line["start"]
    heave = {"heave": {"amplitude": 2.0, "period": 6.0}, "ramp": 3.0}
    scene["points"] |= {"p": {"position": [200, 0, 0]}, "q": {"position": [230, 0, 20], "motion": heave}}
    scene["lines"]["lone"] = scene["lines"]["east"] | {"start": "p", "end": "q"}
    return scene


def on_a_body_cells(held: str = "end", model: Tables | None = None, count: int = 0) -> Tables:
    """A rope from the bed to a body that floats and is pushed to and fro, clamped to it at its start or its end."""
    other = "start" if held == "end" else "end"
    line = {
        held: "seat", other: "foot", "sections": [ROPE | {"torsional_stiffness": 80}], "model": model or FOLLOWS,
        "connections": {held: {"kind": "clamped", "tangent": [0, 0, 1 if held == "end" else -1]}},
    }  # fmt: skip
    if count:
        line["mesh"] = {"cells": count}
    push = [[0, 0, 0, 0], [3, 150, 80, 0], [6, 0, 0, 0]]
    body = {"mass": 300, "inertia": [80, 80, 80], "volume": 0.36, "initial_guess": [0, 0, -40],
            "force": {"history": push}}  # fmt: skip
    return network_scene(
        {"foot": {"position": [30, 0, -80]}, "seat": {"body": "buoy", "place": [0, 0, -0.5]}}, {"leg": line},
        environment=SEA, bodies={"buoy": body}, time=(6.0, 0.05), output=(0.2, 61)
    )  # fmt: skip


RUBS = {"axial": 0.4, "lateral": 0.6, "residual": [0.2, 0.3], "breakout": 0.05, "travel": 0.5}


def on_a_bed_that_breaks_out() -> Tables:
    return on_a_body({"stiffness": 1e4, "friction": RUBS})


def on_soil() -> Tables:
    return on_a_body({"soil": {"shear_strength": 1500.0, "gradient": 2000.0, "lateral": {}}, "friction": RUBS})


@pytest.mark.long
@pytest.mark.parametrize(
    ("make", "means"),
    [
        (followed, 1e-5), (with_ends_exchanged, 1e-5), (crane, 1e-5), (mooring, 1e-5), (on_a_body_cells, 1e-5),
        (on_a_body, 2e-5), (on_a_bed_that_breaks_out, 2e-5), (on_soil, 2e-5),
    ],
)  # fmt: skip
def test_cells_of_joined_lines_change_in_arrays_of_their_own_as_with_a_new_solver(
    make: Callable[[], Tables], means: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Cells that follow, nodes at winches and kinds of cells, at a point and a body: the same motion to the bit.

    Tensions at a change are means with the step before, of which a new solver knows nothing in any line.
    """
    scene = make()
    scene = scene | {"time": {"duration": 6.0, "step": 0.02}, "output": {"every": 0.1}}
    solvers = calls_of(monkeypatch, RunOfLines, "go_on_changed")
    found = hybrid.run(scene)
    assert not solvers
    for changes in (CellChanges, NodeChanges):
        monkeypatch.setattr(changes, "may_change", lambda *_: False)
    other = hybrid.run(scene)
    assert solvers
    for name, line in found.lines.items():
        like = other.lines[name]
        events = [sorted((e.t, e.s_a, e.kind, e.text) for e in x.events) for x in (line, like)]
        assert cells(line) == cells(like) and events[0] == events[1]
        assert np.array_equal(line.position, like.position) and np.array_equal(line.velocity, like.velocity)
        assert np.abs(line.tension - like.tension).max() < means * like.tension.max()


@pytest.mark.long
def test_lines_that_touch_with_friction() -> None:
    """Cells become short where ropes cross as they come down onto each other; these rub and roll as fine rods do."""
    follow = each_line(lowered(), mesh=20, model={"kind": "adaptive", "curvature_error": 0.02})
    rods, found = hybrid.run(each_line(lowered(), mesh=160)), hybrid.run(follow)
    for name, line in found.lines.items():
        like = rods.lines[name]
        assert np.abs(line.position - like.position).max() < 1e-3 and len({*cells(line)}) > 2
        assert line["work/friction"][-1] == pytest.approx(like["work/friction"][-1], rel=0.03)
    first, late = (force_between(x, len(x.times) - 1)[0] for x in (rods, found))
    assert late == pytest.approx(first, rel=0.03)


@pytest.mark.parametrize("held", ["end", "start"])
def test_clamped_to_what_turns(held: str) -> None:
    """Cells beside a clamp to a body that floats follow the bend there; its layer changes faster than they do."""
    scene = on_a_body_cells(held)
    found, fine = hybrid.run(scene).lines["leg"], hybrid.run(on_a_body_cells(held, {"kind": "rod"}, 320)).lines["leg"]
    assert len({*cells(found)}) > 1 and max(cells(found)) < 160
    off = np.abs(found.curvature - fine.curvature) / fine.curvature.max()
    assert np.quantile(off, 0.99) < SHARE and off.max() < 2.0 * SHARE
    assert np.abs(found.position - fine.position).max() < 1e-3 * 60.0


@pytest.mark.long
def test_with_an_accuracy_the_error_that_is_said_holds() -> None:
    scene = followed(accuracy={"position": "5 cm", "tension": "2%"}, time={"duration": 2.0})
    for line in scene["lines"].values():
        line.pop("mesh")
    found = hybrid.run(scene)
    rods = hybrid.run(each_line(mooring(time={"duration": 2.0, "step": 0.005}), model="rod", mesh=240))
    for name, line in found.lines.items():
        off = np.linalg.norm(line.position - rods.lines[name].position, axis=2).max()
        said = line["errors/total/position"].max()
        assert off < 1.5 * said and said < 0.05, (name, off, said)


def test_mean_tensions_of_joined_ropes_stay_through_changes_of_zones(monkeypatch: pytest.MonkeyPatch) -> None:
    """As with a new solver, but for what Newton's method leaves: a change takes no time."""
    scene = mooring(time={"duration": 0.5, "step": 0.02}, output={"every": 0.02, "points": 31})
    rope = ROPE | {"dynamic_stiffness": {"constant": 5e6, "per_tension": 20, "relaxation_time": 2}}
    for line in scene["lines"].values():
        line["sections"] = [deepcopy(rope)]
    found = []
    for may_change in (CellChanges.may_change, lambda *_: False):
        monkeypatch.setattr(CellChanges, "may_change", may_change)
        found.append(hybrid.run(scene).lines["east"])
    one, other = (x["energy/stretch"] for x in found)
    assert any(e.kind == "grow" for e in found[0].events)
    assert np.abs(one - other).max() < 1e-7 * other.max()


def test_bodies_feel_lines_whose_cells_follow() -> None:
    """An output right after a change has the forces of its lines on a body; work goes from the one to the others."""
    scene = on_a_body()
    for line in scene["lines"].values():
        line["model"] = {"kind": "adaptive", "curvature_error": 0.1}
    found = hybrid.run(scene | {"time": {"duration": 0.7, "step": 0.02}, "output": {"every": 0.02, "points": 31}})
    force = found["bodies/float/force"]
    assert np.abs(force - sum(found[f"points/f{k}/force"] for k in range(3))).max() < 1e-9 * np.abs(force).max()
    work = found["bodies/float/work/lines"]
    left = work + sum(line["work/end"] for line in found.lines.values())
    assert np.abs(left).max() < 5e-4 * np.abs(work).max()
