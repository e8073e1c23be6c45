"""Cells that follow the curvature in lines of several: in compiled steps, beside others, at a winch, resumed, stepped."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from test_system_zones import ROPE, SEA, mooring

import hybrid
from hybrid.simulation.cell_changes import CellChanges
from hybrid.solve.network_steps import NetworkSteps
from tests.said import line_of, said
from tests.scenes import network_scene
from tests.validation.test_validation_lines_contact import force_between, lowered

Tables = dict[str, Any]
SHARE = 0.05
TOUCHDOWN = Path(__file__).parents[2] / "examples" / "touchdown.yaml"
FOLLOWS = {"kind": "adaptive", "curvature_error": SHARE}


def followed(**more: Any) -> Tables:
    """Three ropes to a weight, whose cells follow the curvature."""
    scene = mooring(**more)
    for line in scene["lines"].values():
        line["model"] = FOLLOWS
    return scene


def cells(line: hybrid.Result) -> list[int]:
    return [mesh.s.size - 1 for mesh in line.mesh]


@pytest.fixture(scope="module")
def three(tmp_path_factory: pytest.TempPathFactory) -> hybrid.Result:
    path = tmp_path_factory.mktemp("cells") / "three.h5"
    hybrid.run(followed(), path).close()
    return hybrid.open(path)


@pytest.mark.long
@pytest.mark.parametrize(
    "model", [FOLLOWS | {"force_rod": [[0, 250]]}, FOLLOWS | {"hold_time": 2.0}], ids=["rod", "zones"]
)
def test_cells_change_without_python_as_with_it(model: Tables, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a line that is joined to nothing that moves: steps go on through changes, and outputs of all cells wait."""
    tables = yaml.safe_load(TOUCHDOWN.read_text()) | {
        "model": model, "mesh": {"cells": 24}, "time": {"duration": 8.0, "step": 0.1}, "output": {"every": 0.1},
    }  # fmt: skip
    calls, go = [], NetworkSteps.go
    monkeypatch.setattr(NetworkSteps, "go", lambda steps: (calls.append(1), go(steps))[1])
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


@pytest.mark.long  # 1.5 s
def test_against_rods(three: hybrid.Result) -> None:
    """The curvature within the share of its largest that is asked for, with a quarter of the cells."""
    scene = mooring()
    for line in scene["lines"].values():
        line |= {"model": "rod", "mesh": {"cells": 240}}
    rods = hybrid.run(scene)
    for name, line in three.lines.items():
        fine = rods.lines[name]
        assert len({*cells(line)}) > 2 and np.mean(cells(line)) < 0.3 * 240, name
        assert np.abs(line.curvature - fine.curvature).max() < SHARE * fine.curvature.max(), name
        assert np.abs(line.position - fine.position).max() < 1e-3 * 60.0, name
        assert np.abs(line.tension - fine.tension).max() < 0.01 * fine.tension.max(), name


@pytest.mark.long
def test_lines_that_touch_with_friction() -> None:
    """Cells become short where ropes cross as they come down onto each other; these rub and roll as fine rods do."""
    fine, follow = lowered(), lowered()
    for line in fine["lines"].values():
        line["mesh"] = {"cells": 160}
    for line in follow["lines"].values():
        line |= {"mesh": {"cells": 20}, "model": {"kind": "adaptive", "curvature_error": 0.02}}
    rods, found = hybrid.run(fine), hybrid.run(follow)
    for name, line in found.lines.items():
        like = rods.lines[name]
        assert np.abs(line.position - like.position).max() < 1e-3 and len({*cells(line)}) > 2
        assert line["work/friction"][-1] == pytest.approx(like["work/friction"][-1], rel=0.03)
    first, late = (force_between(x, len(x.times) - 1)[0] for x in (rods, found))
    assert late == pytest.approx(first, rel=0.03)


@pytest.mark.parametrize("held", ["end", "start"])
def test_clamped_to_what_turns(held: str) -> None:
    """Cells beside a clamp to a body that floats follow the bend there; its layer changes faster than they do."""
    scene = on_a_body(held)
    found, fine = hybrid.run(scene).lines["leg"], hybrid.run(on_a_body(held, {"kind": "rod"}, 320)).lines["leg"]
    assert len({*cells(found)}) > 1 and max(cells(found)) < 160
    off = np.abs(found.curvature - fine.curvature) / fine.curvature.max()
    assert np.quantile(off, 0.99) < SHARE and off.max() < 2.0 * SHARE
    assert np.abs(found.position - fine.position).max() < 1e-3 * 60.0


def on_a_body(held: str, model: Tables | None = None, count: int = 0) -> Tables:
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


@pytest.mark.long
def test_with_an_accuracy_the_error_that_is_said_holds() -> None:
    scene = mooring(accuracy={"position": "5 cm", "tension": "2%"}, time={"duration": 2.0})
    for line in scene["lines"].values():
        line |= {"model": FOLLOWS}
        line.pop("mesh")
    found = hybrid.run(scene)
    fine = mooring(time={"duration": 2.0, "step": 0.005})
    for line in fine["lines"].values():
        line |= {"model": "rod", "mesh": {"cells": 240}}
    rods = hybrid.run(fine)
    for name, line in found.lines.items():
        off = np.linalg.norm(line.position - rods.lines[name].position, axis=2).max()
        said = line["errors/total/position"].max()
        assert off < 1.5 * said and said < 0.05, (name, off, said)
