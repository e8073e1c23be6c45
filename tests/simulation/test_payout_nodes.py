"""Nodes that enter and leave in compiled code: what Python does one by one, and without Python."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.simulation.lines_nodes import LineNodes
from hybrid.simulation.payout import PayingOut

# What is made of forces on the ends: those of the state between a change and the next step are summed up in another
# order, and outputs within that step lie between them; all else, and so every step, is the same to the last bit.
OF_ENDS = ("reaction_", "tension", "envelope/tension_")


def scene(winch: str, model: str, rate: float, **end: Any) -> dict[str, Any]:
    """20 m sagging over 16 m, dense enough to bend; nodes enter or leave at `winch`, which is clamped where asked."""
    far = "start" if winch == "end" else "end"
    section = {"length": 20.0, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e6}
    if model == "rod":
        section |= {"bending_stiffness": 200.0}
    at: dict[str, Any] = {"start": [0, 0, 0], "end": [16, 0, 0]}
    held = {"kind": "pinned", "position": at[winch], "payout": {"rate": rate, "ramp": 0.5}} | end
    return {
        "cable": {"sections": [section]}, "initial": "equilibrium", "model": model, "mesh": {"cells": 20},
        "ends": {winch: held, far: {"kind": "pinned", "position": at[far]}}, "time": {"duration": 3.0, "step": 0.05},
        "output": {"every": 0.35},
    }  # fmt: skip


@pytest.mark.parametrize(
    ("winch", "model", "rate", "end"),
    [
        ("end", "catenary", 1.5, {}),
        ("start", "catenary", -1.5, {}),
        ("start", "rod", 1.5, {"kind": "clamped", "tangent": [1, 0, -0.8]}),
    ],
)
def test_nodes_enter_and_leave_as_by_python(
    winch: str, model: str, rate: float, end: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    given = scene(winch, model, rate, **end)
    one_by_one: list[float] = []
    change = PayingOut.change
    monkeypatch.setattr(
        PayingOut, "change", lambda paying, run, *more: (one_by_one.append(run.t), change(paying, run, *more))[1]
    )
    found = hybrid.run(given)
    assert not one_by_one
    monkeypatch.setattr(LineNodes, "may_change", lambda *_: False)
    other = hybrid.run(given)
    assert len(one_by_one) >= 3
    for name in (x for x in found.names if x != "steps/cpu" and found[x].dtype.kind == "f"):
        most = 0.0
        if name.startswith(OF_ENDS):
            most = 4.0 * np.spacing(np.nanmax(np.abs(other[name])))
        np.testing.assert_allclose(found[name], other[name], rtol=0.0, atol=most, err_msg=name)


@pytest.mark.parametrize(
    ("winch", "rate", "more"),
    [("end", 0.8, {}), ("start", 0.8, {}), ("start", -0.8, {}), ("end", 0.4, {"contact": {"self": True}})],
)
def test_torque_stays_even_where_nodes_enter_and_leave(winch: str, rate: float, more: dict[str, Any]) -> None:
    """A straight line whose ends hold one turn: torque is 2 pi GJ/L at every node and step, in envelope and outputs.

    2 %: what the growing cell adds beside the winch, and the twist waves of the ramp.
    """
    far, out = "start" if winch == "end" else "end", 4.0
    up = {"tangent": [0, 0, 1 if winch == "end" else -1], "normal": [1, 0, 0]}
    section = {"length": out, "mass": 0.4, "diameter": 0.02, "axial_stiffness": 1e5, "bending_stiffness": 0.2}
    pulled = {"kind": "guided", **up, "force": [0, 0, -40.0]}
    held = {"kind": "clamped", "position": [0, 0, 0], **up, "payout": {"rate": rate, "ramp": 0.2}}
    turned = {winch: held, far: pulled}
    turned["end"] |= {"turns": 1}
    result = hybrid.run({
        "cable": {"sections": [section | {"torsional_stiffness": 0.16}]}, "model": "rod", "mesh": {"cells": 40},
        "ends": turned, "initial": "equilibrium", "time": {"duration": 1.5, "step": 0.01}, "output": {"every": 0.02},
        "dimension": 3, **more,
    })  # fmt: skip
    length = result["payout/length"]
    assert abs(length[-1] - length[0]) > 5 * out / 40  # nodes have entered, or left
    expected = 2.0 * np.pi * 0.16 / length
    low, high = 0.98 * expected.min(), 1.02 * expected.max()
    torque = np.abs(result["torque"])
    assert low < torque.min() and torque.max() < high
    for bound in ("min", "max"):
        kept = np.abs(result[f"envelope/torque_{bound}"])
        kept = kept[np.isfinite(kept)]
        assert low < kept.min() and kept.max() < high
