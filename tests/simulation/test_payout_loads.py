"""Loads that change in mid-run on a line that is paid out or taken in."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_payout import G, clamped, hanging, sagging
from test_payout_zones import touching

import hybrid

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


@pytest.mark.long
def test_a_changed_run_is_resumed_bit_for_bit(tmp_path: Path) -> None:
    scene = in_water(sagging("rod", 2e6, 2e4))
    scene["ends"]["end"]["payout"]["longest"] = 110.0
    hybrid.run(scene | {"time": {"duration": 4.0, "step": 0.05}}, output=tmp_path / "a.h5")
    other = ["environment.fluid.current=[0.8, 0, 0]"]
    whole = hybrid.resume(tmp_path / "a.h5", tmp_path / "b.h5", until=9.0, settings=other)
    hybrid.resume(tmp_path / "a.h5", tmp_path / "c.h5", until=6.0, settings=other)
    resumed = hybrid.resume(tmp_path / "c.h5", until=9.0)
    for x in ("position", "tension", "reaction_end", "work/end", "work/zones", "work/drag"):
        assert np.array_equal(whole[x], resumed[x]), x
    assert np.abs(whole["position"][-1] - whole["position"][8]).max() > 0.5
