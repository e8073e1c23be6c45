"""The event of a torque that can throw a loop: where the margin of the report is below 1, and nowhere else."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import hybrid

EI, GJ, DIAMETER = 0.5, 0.4, 0.02


CATENARY = {"kind": "zones", "zones": [{"catenary": 4.0, "cells": 80}]}


def twisted(turns: float, over: float = 0.0, model: Any = "rod", away: float = 0.1) -> hybrid.Scene:
    """A taut cable whose clamps are twisted against each other; in a time `over`, s, its end gives way by `away`, m."""
    section = {
        "length": 4.0, "mass": 0.4, "diameter": DIAMETER, "axial_stiffness": 1e5, "bending_stiffness": EI,
        "damping": {"mass": 2.0}, "torsional_stiffness": GJ,
    }  # fmt: skip
    clamp = {"kind": "clamped", "tangent": [1, 0, 0], "normal": [0, 0, 1]}
    end = clamp | {"position": [3.995, 0, 0], "turns": turns}
    time = {}
    if over:
        end["motion"] = {"travel": {"by": [-away, 0, 0], "over": over}}
        time = {"time": {"duration": over + 2.0, "step": 0.02}, "output": {"every": 0.2, "points": 41}}
    mesh = {} if isinstance(model, dict) else {"mesh": {"cells": 80}}
    return hybrid.validate_scene(
        {
            "environment": {"gravity": 2.0}, "cable": {"sections": [section]}, "model": model,
            "initial": {"kind": "equilibrium"}, "ends": {"start": clamp | {"position": [0, 0, 0]}, "end": end},
        } | mesh | time
    )  # fmt: skip


def told(result: hybrid.Result) -> list[Any]:
    return [event for event in result.events if event.kind == "loop can form"]


def margins(result: hybrid.Result) -> np.ndarray:
    """(nt, ns) formation margins."""
    return np.asarray(4.0 * EI * np.maximum(result["tension"], 1e-9) / result["torque"] ** 2)


def test_an_equilibrium_with_too_much_torque() -> None:
    few, many = hybrid.static(twisted(3.0, model=CATENARY)), hybrid.static(twisted(12.0, model=CATENARY))
    assert margins(few).min() > 1.0 and not told(few)
    (event,) = told(many)
    assert event.value == pytest.approx(margins(many).min(), rel=1e-9) and event.value < 1.0
    assert event.s_a == pytest.approx(many.s[margins(many)[0].argmin()])
    assert event.threshold == 1.0
    for part in ("N m", "M^2/(4 EI)", "opens", "friction"):
        assert part in event.text


@pytest.mark.parametrize(("model", "over"), [("rod", 0.5), (CATENARY, 6.0)], ids=["rod", "catenary"])
def test_a_run_that_slackens(model: Any, over: float) -> None:
    """The first event is soon after the first output with a margin below 1, others follow at a third of it."""
    result = hybrid.run(twisted(5.0, over, model))
    least = margins(result).min(axis=1)
    assert least[0] > 1.0 > least.min()
    events = told(result)
    first = int(np.argmax(least < 1.0))
    at = int(np.argmin(np.abs(result.times - events[0].t)))
    assert 0 <= at - first <= 2  # the stretch must be long enough
    assert events[0].value == pytest.approx(least[at], rel=1e-6)
    assert all(b.value <= a.value / 3.0 for a, b in pairwise(events))
    assert len(events) < 12
    assert not told(hybrid.run(twisted(0.5, over, model)))


def test_a_loop_that_forms() -> None:
    """Slowly, a rod follows its loop with a margin above 1: the writhe says that there is one, and where."""
    result = hybrid.run(twisted(6.0, 6.0, away=0.8))
    found = [event for event in result.events if event.kind == "loop formed"]
    writhe = np.abs(result["turns/writhe"] - result["turns/writhe"][0])
    first = int(np.argmax(writhe > 0.75))
    assert writhe.max() > 0.75 and found[0].t == pytest.approx(result.times[first])
    assert found[0].s_a == pytest.approx(result.s[result["curvature"][first].argmax()])
    assert len(found) < 5
    lost = 6.0 - result["turns/link"][:]  # two turns wherever it passes through itself, to round-off
    np.testing.assert_allclose(lost, 2.0 * np.round(0.5 * lost), atol=1e-9)
    assert bool(np.round(lost).any()) == any(event.kind == "line meets itself" for event in result.events)
    assert not [event for event in hybrid.run(twisted(0.5, 6.0)).events if event.kind == "loop formed"]
