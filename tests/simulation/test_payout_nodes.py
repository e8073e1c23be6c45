"""Nodes that enter and leave in compiled code: what Python does one by one, to the last bit, and without Python."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.simulation.payout import PayingOut
from hybrid.simulation.payout_nodes import NodeChanges


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
    monkeypatch.setattr(NodeChanges, "applies", lambda owner: False)
    other = hybrid.run(given)
    assert len(one_by_one) >= 3
    for name in (x for x in found.names if x != "steps/cpu" and found[x].dtype.kind == "f"):
        assert np.array_equal(found[name], other[name], equal_nan=True), name
