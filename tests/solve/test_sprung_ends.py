"""Ends of one cable that are clamped by an angular spring: how far they turn, zones that move, winches, refusals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.errors import SceneError
from hybrid.kernels.step.line_step import TOLERANCE
from hybrid.model.build import build
from hybrid.model.line import ABOUT_CHORDS, line_on
from hybrid.scene.read import one_line
from tests.scenes import cable_scene

LENGTH, CELLS = 30.0, 20
SECTION = {
    "length": LENGTH, "mass": 2.0, "diameter": 0.05, "axial_stiffness": 1e6, "bending_stiffness": [600.0, 400.0],
    "torsional_stiffness": 300.0, "drag": {"normal": 1.2}, "added_mass": {"normal": 1},
}  # fmt: skip
START = {"tangent": [1, 0, 0], "normal": [0, 0, 1], "bend_stiffness": 300.0}
END = {"tangent": [1, 0.3, 0.2], "normal": [0, 0, 1], "bend_stiffness": 2000.0}
MOTION = {"heave": {"amplitude": 0.4, "period": 2.0}, "pitch": {"amplitude": 10, "period": 2.0}, "ramp": 2.0}
A, B = [0.0, 0.0, 0.0], [26.0, 2.0, 0.0]
COMMON = {
    "environment": {"fluid": {"density": 1025, "current": [0.3, 0.2, 0]}}, "output": {"points": CELLS + 1},
    "time": {"duration": 2.0, "step": 0.1},
}  # fmt: skip


def one(start: dict[str, Any], end: dict[str, Any], **more: Any) -> dict[str, Any]:
    """A cable, clamped as the tables say."""
    ends = {
        "start": {"kind": "clamped", "position": A} | start,
        "end": {"kind": "clamped", "position": B, "motion": MOTION} | end,
    }
    cable = {"sections": [SECTION]}
    return (
        COMMON
        | {"cable": cable, "ends": ends, "initial": "equilibrium", "model": "rod", "mesh": {"cells": CELLS}}
        | more
    )


def test_springs_turn_by_their_moments() -> None:
    """And are not those of a rigid clamp."""
    at_rest, rigid = hybrid.static(one(START, END)), hybrid.static(one(START | {"bend_stiffness": None}, END))
    assert np.abs(at_rest["position"] - rigid["position"]).max() > 1e-3 * LENGTH
    d = at_rest["position"][0, 1] - at_rest["position"][0, 0]
    moment = at_rest["moment_start"][0]
    across = moment - moment[0] * np.array([1.0, 0.0, 0.0])
    # the spring and half a cell in series turn from the clamp to the first chord
    half = 0.5 * LENGTH / CELLS
    turn = np.arccos(d[0] / np.linalg.norm(d))
    soft = [1 / 300.0 + half / EI for EI in SECTION["bending_stiffness"]]
    assert min(soft) < turn / np.linalg.norm(across) < max(soft)


@pytest.mark.parametrize("k", [0, 1])
def test_rods_that_come_and_go_have_the_same_springs(k: int) -> None:
    held = (START, END | {"bend_stiffness": 0.0})
    section = SECTION | {"bending_stiffness": 500.0}
    model = build(one_line(hybrid.validate_scene(one(*held, cable={"sections": [section]}, model="adaptive"))))
    assert model.on_base is not None and model.layout is not None
    line = model.on_base.line(model.layout, model.line.bits)
    other = line_on(model.cable, model.layout.nodes, model.layout.rod_cells, inertia=ABOUT_CHORDS)
    np.testing.assert_allclose(line.kb[-k], other.kb[-k], rtol=1e-14)
    assert line.hn[-k] == pytest.approx(other.hn[-k], rel=1e-14)
    own = 2.0 * 500.0 / line.h[-k]
    soft = [1 / own + 1 / 300.0, 1e12 / own][k]
    np.testing.assert_allclose(1.0 / line.kb[-k, :2], soft, rtol=1e-9)


def test_a_winch_behind_a_spring_that_pays_nothing_out_is_that_spring() -> None:
    section = SECTION | {"bending_stiffness": 500.0}
    found = []
    for more in ({}, {"payout": {"rate": 0.0}}):
        scene = one(START, END | more, cable={"sections": [section]})
        found.append(hybrid.run(scene))
    still, paid = found
    assert np.abs(still["position"] - paid["position"]).max() < 10 * TOLERANCE * LENGTH
    np.testing.assert_allclose(still["curvature"][:, -1], paid["curvature"][:, -1], rtol=1e-6)


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"end": {"swivel": True, "bend_stiffness": 0}}, "ends.end.swivel"),
        ({"end": {"bend_stiffness": -1}}, "ends.end.bend_stiffness"),
    ],
)
def test_what_knows_no_springs_is_refused(change: dict[str, Any], where: str) -> None:
    end = END | change.get("end", {})
    section = SECTION | {"bending_stiffness": 500.0}
    more = {key: x for key, x in change.items() if key != "end"}
    with pytest.raises(SceneError) as refused:
        hybrid.plan(one(START, end, cable={"sections": [section]}, **more))
    assert where in str(refused.value)


@pytest.mark.parametrize("spring", [1.0, 300.0, 1e5, None])
def test_the_tension_at_a_spring_is_that_of_the_line_beside_it(spring: float | None) -> None:
    """A line of 5 m hangs from a clamp that points sideways: its own tangent there is not that of the clamp."""
    section = {"length": 5.0, "mass": 1.0, "bending_stiffness": 20.0}
    start = {"kind": "clamped", "position": A, "tangent": [1, 0, 0], "bend_stiffness": spring}
    scene = cable_scene(section, start, {"kind": "free"}, model="rod", mesh=400, output={"points": 401})
    tension = hybrid.static(scene)["tension"][0]
    near = 3.0 * tension[1] - 3.0 * tension[2] + tension[3]
    assert tension[0] == pytest.approx(near, abs=2e-3 * tension.max())
    moving = scene | {"time": {"duration": 0.1, "step": 0.05}, "mesh": {"cells": 50}, "output": {"points": 51}}
    with hybrid.run(moving) as result:
        assert result["envelope/tension_max"][0] == pytest.approx(result["tension"][:, 0].max(), rel=1e-6)
    coarse = hybrid.static(scene | {"mesh": {"cells": 50}, "output": {"points": 101, "errors": True}})
    assert "error uncertain" not in {e.kind for e in coarse.events}
