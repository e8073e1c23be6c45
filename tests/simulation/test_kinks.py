"""A kink at the joint of a rod and a catenary: said where a border of fixed zones lies in a bend, in statics and runs."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hybrid
from hybrid.simulation.doubtful_outputs import kinks_at

KIND = "kink at joint"


def sagging(border: float, **more: Any) -> dict[str, Any]:
    """A cable of 20 m over 8 m, a stiff rod to the border and a catenary from there on."""
    section = {"length": 20.0, "mass": 1.0, "bending_stiffness": 20.0}
    ends = {
        "start": {"kind": "pinned", "position": [0, 0, 0]},
        "end": {"kind": "pinned", "position": [8, 0, 0]},
    }
    zones = {"kind": "zones", "zones": [{"rod": border}, {"catenary": 20.0 - border}]}
    tables = {"cable": {"sections": [section]}, "ends": ends, "initial": "equilibrium", "model": zones}
    return tables | {"mesh": {"cells": 80}} | more


def kinks(result: hybrid.Result) -> list[Any]:
    return [event for event in result.events if event.kind == KIND]


def test_a_border_in_the_sag_is_said_with_place_angle_and_remedy() -> None:
    (said,) = kinks(hybrid.static(sagging(10.0)))
    assert said.s_a == said.s_b == pytest.approx(10.0)
    assert "s = 10 m" in said.text and "model.zones" in said.text and "model: rod" in said.text
    assert not kinks(hybrid.static(sagging(16.0)))


def test_a_run_says_it_when_it_comes() -> None:
    """A border that lies in a straight stretch at first, and in the sag when the end has come nearer."""
    ends = sagging(10.0)["ends"]
    ends["end"] = {"kind": "pinned", "position": [19, 0, 0], "motion": {"surge": {"amplitude": -12.0, "period": 40.0}}}
    ends["end"]["motion"]["ramp"] = 5.0
    time = {"duration": 20.0, "step": 0.05}
    section = {"length": 20.0, "mass": 1.0, "bending_stiffness": 20.0, "damping": 2.0, "axial_stiffness": 1e5}
    run = hybrid.run(sagging(10.0, ends=ends, time=time, cable={"sections": [section]}))
    said = kinks(run)
    assert said and said[0].t > 0.0 and said[0].s_a == pytest.approx(10.0)


def test_zones_that_move_say_it_too() -> None:
    """Where a scene forces the border into the sag, at any output."""
    model = {"kind": "adaptive", "force_rod": [[0, 10]], "force_catenary": [[10, 20]]}
    time = {"duration": 0.2, "step": 0.05}
    said = kinks(hybrid.run(sagging(10.0, model=model, time=time)))
    assert said and said[0].s_a == pytest.approx(10.0) and "model.force_catenary" in said[0].text


def test_a_point_load_at_the_joint_is_no_kink_of_zones() -> None:
    clump = {"kind": "clump", "at": 10.0, "mass": 30.0}
    loaded = sagging(10.0)
    loaded["cable"]["attachments"] = [clump]
    assert not kinks(hybrid.static(loaded))


def test_what_bends_beside_a_joint_is_taken_off() -> None:
    bends, lengths = np.array([[0.1], [0.1], [2.0 * np.tan(0.25)], [0.2], [0.1]]), np.ones(5)
    assert kinks_at(np.array([2]), bends, lengths)[0, 0] == pytest.approx(0.5 - 0.2)
