"""A catenary that nobody asked for does not stop a run where it goes slack: rods take its place, and the result says so."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import hybrid
from hybrid.accuracy.run_forecast import _grown
from hybrid.cli.plan_tables import plan_rows
from hybrid.errors import ComputationError, Outcome
from hybrid.scene.network import Network
from hybrid.scene.read import as_scene

SECTION = {"length": 10.0, "mass": 2.0, "diameter": 0.03, "axial_stiffness": 1e5}
HEAVE = {"position": [9, 0, 0], "motion": {"heave": {"amplitude": 0.5, "period": 0.8}, "ramp": 1.6}}
TABLES = {"time": {"duration": 2.0, "step": 0.005}, "output": {"every": 0.1}}


def cable(**more: Any) -> dict[str, Any]:
    """A line whose end falls faster than its weight lets it follow."""
    start = {"kind": "pinned", "position": [0, 0, 0]}
    ends = {"start": start, "end": HEAVE | {"kind": "pinned"}}
    return (
        {"cable": {"sections": [SECTION]}, "ends": ends, "initial": "equilibrium", "mesh": {"cells": 20}}
        | TABLES
        | more
    )


def system(**more: Any) -> dict[str, Any]:
    line = {"start": "a", "end": "b", "sections": [SECTION], "mesh": {"cells": 20}} | more
    other = line | {"start": "a", "end": "c"}
    points = {"a": {"position": [0, 0, 0]}, "b": HEAVE, "c": {"position": [-9, 0, 0]}}
    return {"points": points, "lines": {"left": other, "right": line}} | TABLES


def chosen(events: Any) -> list[str]:
    return [x.text for x in events if x.kind == "slack line as rods"]


def test_a_cable_that_goes_slack_becomes_a_rod(tmp_path: Path) -> None:
    result = hybrid.run(cable(), tmp_path / "a.h5")
    assert result.status == "complete" and result.times[-1] == 2.0
    (text,) = chosen(result.events)
    assert text.startswith("computed as rods") and "compression at t = " in text
    assert {x.kind for zones in result.zones for x in zones} == {"rod"}
    stiffness = 9.81 * 2.0 * 0.1**3  # under its weight it bends over a hundredth of its length
    assert f"{stiffness:.3g} N m^2" in text and "bending_stiffness: 0.019" in result.scene_text
    assert result.tension.min() < 0.0 and not list(tmp_path.glob("*.npz"))


def test_a_line_of_a_system_that_goes_slack_becomes_a_rod() -> None:
    result = hybrid.run(system())
    assert result.status == "complete" and result.times[-1] == 2.0
    (text,) = chosen(result.events)
    assert text.startswith("line right: computed as rods") and "no other line has changed" in text
    assert not chosen(result.lines["left"].events) and len(chosen(result.lines["right"].events)) == 1
    kinds = {name: {x.kind for zones in line.zones for x in zones} for name, line in result.lines.items()}
    assert kinds == {"left": {"catenary"}, "right": {"rod"}}


@pytest.mark.parametrize("scene", [cable(model="catenary"), system(model="catenary")])
def test_a_catenary_that_is_asked_for_stops(scene: dict[str, Any]) -> None:
    with pytest.raises(ComputationError) as stopped:
        hybrid.run(scene)
    assert stopped.value.outcome == Outcome.SLACK


def test_the_plan_says_what_a_slack_line_may_cost() -> None:
    """And counts steps whose loads still grow as those of grown loads: the motion of the end has a ramp of 1.6 s."""
    open_, named = as_scene(system()), as_scene(system(model="catenary"))
    assert isinstance(open_, Network) and isinstance(named, Network)
    assert open_.slack_becomes_rod and not named.slack_becomes_rod and _grown(open_) == 1.6
    plan = replace(hybrid.plan(open_, measure=False), seconds=8.0, most_seconds=19.0)
    said = " ".join(" ".join(plan_rows(open_, plan)).split())
    assert "about 8 s of CPU for all runs (up to 19 s if a line goes slack and becomes a rod" in said
