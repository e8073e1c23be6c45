"""Zones that move on a line that is paid out or taken in: against rods, against the mirror image, resumed."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_payout import G, clamped, hanging, sagging
from test_payout_laws import ROPE, TABLE

import hybrid
from tests.combinations.pairs import scene_of, seen_by
from tests.inside import OnlyLine
from tests.scenes import cable_scene, clamped_at, pinned_at

ADAPTIVE = {"kind": "adaptive", "tolerance": 1e-3, "hold_time": 1.0}
CHANGES = ("grow", "split", "shrink", "merge")
DAMPED = {"axial_stiffness": 2e6, "damping": {"stiffness": 0.05}}


def touching(rate: float = 0.8, model: Any = ADAPTIVE, side: str = "end", **more: Any) -> dict[str, Any]:
    """100 m over 80 m that touch the seabed, paid out at a clamp that heaves by 1 m in 4 s."""
    section = {
        "length": 100.0, "mass": 5.0, "diameter": 0.05, "axial_stiffness": 2e6, "bending_stiffness": 500.0,
        "torsional_stiffness": 400.0,
    }  # fmt: skip
    sign = 1.0 if side == "end" else -1.0
    winch = clamped_at(
        [80, 0, 0], [sign, 0, 0.5 * sign], payout={"rate": rate, "ramp": 4.0, "longest": 110.0},
        motion={"heave": {"amplitude": 1.0, "period": 4.0}, "ramp": 4.0}
    )  # fmt: skip
    far = {"kind": "pinned", "position": [0, 0, 0]}
    return {
        "environment": {"seabed": {"z": -18, "stiffness": 5e3, "damping": 5e2}},
        "cable": {"sections": [section]}, "ends": {side: winch, "start" if side == "end" else "end": far},
        "initial": "equilibrium", "model": model, "mesh": {"cells": 40}, "time": {"duration": 8.0, "step": 0.05},
        "output": {"every": 0.5}, **more,
    }  # fmt: skip


def stretching(law: dict[str, Any], rate: float, model: Any = ADAPTIVE) -> dict[str, Any]:
    scene = touching(rate, model)
    section = scene["cable"]["sections"][0]
    del section["axial_stiffness"]
    return scene | {"cable": {"sections": [section | law]}}


LAWS = {"plain": {"axial_stiffness": 2e6}, "table": TABLE, "rope": ROPE, "damped": DAMPED}


def test_how_far_base_nodes_have_moved_goes_on_as_nodes_enter() -> None:
    """As the event `coarse step` weighs it: in a step, not from the first node."""
    moved = []
    for model in ("rod", {"kind": "adaptive", "force_rod": [[0, 100]]}):
        with hybrid.Simulation(sagging("rod", 2e6, 2e4, duration=8.0) | {"model": model}) as sim:
            sim.advance(7.9)
            moved.append(float(OnlyLine(sim).books.clock.moved))
    assert moved[1] == pytest.approx(moved[0], rel=1e-3)


@pytest.mark.parametrize("rate", [0.8, -0.8])
@pytest.mark.parametrize("law", LAWS)
def test_zones_move_while_line_is_paid_out(law: str, rate: float) -> None:
    """As rods within what the tolerance allows, and the energy is balanced as well; cells come in as rods."""
    found, rods = (hybrid.run(stretching(LAWS[law], rate, model)) for model in (ADAPTIVE, "rod"))
    assert sum(x.kind in CHANGES for x in found.events) >= 2
    assert any(zone.kind == "catenary" for zone in found.zones[-1])
    assert (found["payout/length"][-1] > 104.0) == (rate > 0.0)
    for length, zones in zip(found["payout/length"], found.zones, strict=True):
        assert (zones[-1].kind, zones[-1].s_b) == ("rod", pytest.approx(length, abs=1e-9))
    assert np.abs(found["position"] - rods["position"]).max() < 1e-3 * 100.0
    pulls = [np.linalg.norm(x["reaction_end"], axis=1) for x in (found, rods)]
    assert np.abs(pulls[0] - pulls[1]).max() < 0.01 * pulls[1].mean()
    left = [np.abs(x["work/scheme"]).max() for x in (found, rods)]
    assert left[0] < (1.02 if law == "plain" else 1.05) * left[1]


def test_zones_that_move_in_a_current_across_are_those_of_the_turned_scene() -> None:
    """In space, where the cell that grows has no inertia about its chord that others do not have."""
    c, s = np.cos(0.3), np.sin(0.3)
    M = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    scene = scene_of("payout", "water", "zones that move")
    found, turned = hybrid.run(scene), hybrid.run(seen_by(M, scene))
    assert np.abs(turned.position - found.position @ M.T).max() < 1e-6
    assert np.abs(found.position[-1, :, 1]).max() > 0.1


# --- turns of the ends of a catenary ---


BY_HAND = {"kind": "zones", "zones": [{"catenary": 4.0}, {"rod": 6.0}]}


def twisted(model: Any = "catenary", **more: Any) -> dict[str, Any]:
    section = {"length": 10.0, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e6, "bending_stiffness": 30.0,
               "torsional_stiffness": 40.0, "drag": {"normal": 1.2}}  # fmt: skip
    paid = {"rate": 0.5, "begin": 0.2, "ramp": 0.5, "longest": 11.0}
    start = {"kind": "clamped", "position": [6, 0, -7.5], "tangent": [-1, 0, 0.2], "turns": 0.3}
    return cable_scene(
        section, start, clamped_at([0, 0, 0], [0, 0, 1], payout=paid), fluid={"density": 1025}, contact={"self": False},
        model=model, mesh=24, dimension=3, time=(1.2, 0.03), output=0.3
    ) | more  # fmt: skip


def test_outputs_that_wait_have_the_torque() -> None:
    """GJ theta / L, of the length when the last node entered, in every output; an event says how far off that may be."""
    result = hybrid.run(twisted())
    torque, length = np.abs(result.torque), np.asarray(result["payout/length"])
    exact = 40.0 * 2.0 * np.pi * 0.3 / length
    assert np.ptp(torque, axis=1) == pytest.approx(0.0, abs=1e-9)
    (event,) = (x for x in result.events if x.kind == "torque neglected")
    assert "up to 4.2 % wrong" in event.text
    assert np.abs(torque[:, 0] / exact - 1.0).max() < 0.042


# --- zones after a step that was taken back ---

SCENE: dict[str, Any] = cable_scene(
    {"length": 85, "mass": 8, "diameter": 0.04, "axial_stiffness": 5e6, "bending_stiffness": 300,
     "drag": {"normal": 1.2}, "added_mass": {"normal": 1.0}},
    pinned_at(0, 0, -40), pinned_at(60, 0, 0, payout={"longest": 110}),
    fluid={"density": 1025, "surface": 0, "current": [0.3, 0, 0]},
    seabed={"z": -40, "stiffness": 1e4, "damping": 100, "friction": 0.4}, model="adaptive", mesh=43, time=(10, 0.05),
    output=0.05
)  # fmt: skip


def driven(again: int) -> hybrid.Result:
    """32 steps of a length that grows faster and faster; the step `again` is computed, taken back and computed."""
    with hybrid.Simulation(SCENE) as sim:
        for n in range(32):
            turned = 2.0 * math.pi * (sim.t + 0.05) / 10.0
            length, rate = 89.0 - 4.0 * math.cos(turned), 0.8 * math.pi * math.sin(turned)
            if n == again:
                saved = sim.save()
                sim.set_length(length, rate)
                sim.step()
                sim.restore(saved)
            sim.set_length(length, rate)
            sim.step()
        return sim.result()


@pytest.mark.long
def test_rods_at_a_winch_are_those_of_the_last_node_after_a_step_is_taken_back() -> None:
    assert np.array_equal(driven(-1).tension, driven(22).tension)


# --- loads that change in mid-run ---

CURRENT = "environment.fluid.current=[0.3, 0, 0]"


def in_water(scene: dict[str, Any]) -> dict[str, Any]:
    """In a current, dragged."""
    scene["cable"]["sections"][0]["drag"] = {"normal": 1.2}
    fluid = {"density": 1025, "surface": 100.0, "current": [0.3, 0, 0]}
    return scene | {"environment": scene.get("environment", {}) | {"fluid": fluid}}


@pytest.mark.long
@pytest.mark.parametrize("rate", [1.0, -1.0])
def test_a_weight_at_the_end_shows_at_the_winch(tmp_path: Path, rate: float) -> None:
    """Vertical line: the pull is w L less its inertia, and what pulls at its end, to round-off after the change."""
    scene = hanging({"rate": rate, "ramp": 2.0, "longest": 60.0}, 6.0)
    scene["ends"]["start"] = {"kind": "free", "force": [0, 0, -100]}
    hybrid.run(scene, output=tmp_path / "a.h5")
    more = ["ends.start.force=[0, 0, -300]"]
    late = hybrid.resume(tmp_path / "a.h5", tmp_path / "b.h5", until=10.0, settings=more)
    hung = 2.0 * G * late["payout/length"] + np.where(late.t > 6.0, 300.0, 100.0)
    assert np.abs(late["reaction_end"][7:, 2] / hung[7:] - 1.0).max() < 1e-8
    assert late["payout/length"][-1] == pytest.approx(40.0 + 9.0 * rate, abs=1e-9)
    # from before the checkpoint on, computed anew
    early = hybrid.resume(tmp_path / "a.h5", tmp_path / "c.h5", until=10.0, settings=more, start=4.0)
    hung = 2.0 * G * early["payout/length"] + np.where(early.t > 4.0, 300.0, 100.0)
    assert np.abs(early["reaction_end"][7:, 2] / hung[7:] - 1.0).max() < 1e-8


LINES: dict[str, dict[str, Any]] = {
    "catenary": sagging(),
    "rod behind a clamp, taken in": clamped(sagging("rod", 2e6, 2e4, -0.8)),
    "winch at the start": sagging("rod", 2e6, 2e4),
    "zones that move": touching(),
    "steps that follow": sagging(),
}


@pytest.mark.long
@pytest.mark.parametrize("name", LINES)
def test_loads_that_stay_change_nothing(tmp_path: Path, name: str) -> None:
    """The same current again: accelerations are found anew, and the line goes on as it would have.

    Without the forces that act because the length changes they would be others: 2 mm, and 3 % of the pull.
    """
    scene = in_water(LINES[name])
    if name == "winch at the start":
        scene = scene | {"ends": {"start": scene["ends"]["end"], "end": scene["ends"]["start"]}}
    step = {"tolerance": 1e-4} if name == "steps that follow" else {"step": 0.05}
    winch = "start" if name == "winch at the start" else "end"
    scene["ends"][winch]["payout"]["longest"] = 110.0
    hybrid.run(scene | {"time": {"duration": 5.0} | step}, output=tmp_path / "a.h5")
    whole = hybrid.run(scene | {"time": {"duration": 8.0} | step})
    again = hybrid.resume(tmp_path / "a.h5", tmp_path / "b.h5", until=8.0, settings=[CURRENT])
    assert "loads change" in {x.kind for x in again.events}
    most = 2e-3 if name == "steps that follow" else 3e-4  # others begin anew, with short ones; steps alone: 1e-2
    assert np.abs(again["position"] - whole["position"]).max() < most
    pull = np.linalg.norm(whole[f"reaction_{winch}"], axis=1).mean()
    assert np.abs(again[f"reaction_{winch}"] - whole[f"reaction_{winch}"]).max() < 5e-3 * pull
