"""Equilibria of several lines that a search has wound up are said to be one of several."""

from pathlib import Path

import pytest
import yaml

import hybrid

PAGE = (Path(__file__).parents[2] / "docs" / "points.md").read_text(encoding="utf-8")
SCENE = next(x.partition("```")[0] for x in PAGE.split("```yaml\n")[1:] if x.startswith("# cantilever.yaml"))


@pytest.mark.parametrize(("guess", "wound"), [((7.9, -2.2, -21), ["lower", "upper"]), ((0, 0, -30), [])])
def test_a_line_that_rests_wound_up_is_noted(guess: tuple[float, ...], wound: list[str]) -> None:
    """The system is symmetric about y = 0; from the first guess it is found wound up about its lines."""
    given = "tee: {initial_guess: [0, 0, -30]}"
    assert given in SCENE
    system = yaml.safe_load(SCENE.replace(given, f"tee: {{initial_guess: {list(guess)}}}"))
    result = hybrid.static(system)
    assert [n for n, x in result.lines.items() if any(e.kind == "several equilibria" for e in x.events)] == wound
    twisted = abs(result.lines["lower"].torque[-1]).max() > 1e-3 * abs(result.lines["lower"].bending_moment[-1]).max()
    assert twisted == bool(wound)


def test_a_twist_that_a_moment_makes_is_no_news() -> None:
    line = {"mass": 1, "diameter": 0.02, "axial_stiffness": 1e6, "bending_stiffness": 100, "torsional_stiffness": 50}
    ends = {"start": {"tangent": [1, 0, 0]}, "end": {"tangent": [1, 0, 0]}}
    common = {"connections": ends, "sections": [{"length": 5, **line}], "mesh": {"cells": 10}}
    system = {
        "environment": {"gravity": 0},
        "points": {
            "low": {"position": [0, 0, 0]}, "high": {"position": [10.01, 0, 0]},
            "middle": {"kind": "free", "initial_guess": [5, 0, 0], "moment": [60, 0, 0]},
        },
        "lines": {"a": {"start": "low", "end": "middle", **common}, "b": {"start": "middle", "end": "high", **common}},
    }  # fmt: skip
    result = hybrid.static(system)
    for name, torque in (("a", 30.0), ("b", -30.0)):  # 3 rad between its ends
        assert result.lines[name].torque[-1] == pytest.approx(torque, rel=1e-6)
        assert all(e.kind != "several equilibria" for e in result.lines[name].events)
