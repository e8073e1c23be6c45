"""Ropes that creep with the logarithm of time: under a weight, between two ends, with a dynamic stiffness; energy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bits import resumed

import hybrid
from hybrid.errors import SceneError

EA, LENGTH, PER, LOADED = 1e6, 10.0, 0.002, 60.0
CREEP = {"axial_stiffness": EA, "creep": {"per_decade": PER, "loaded": LOADED}}


def rope(end: Any, step: float, over: float, **section: Any) -> dict[str, Any]:
    return {
        "environment": {"gravity": 0},
        "cable": {"sections": [{"length": LENGTH, "mass": 1.0, "damping": 20.0} | CREEP | section]},
        "ends": {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": end},
        "initial": "equilibrium", "model": "catenary", "mesh": {"cells": 10},
        "time": {"duration": over, "step": step}, "output": {"every": 10.0, "points": 11},
    }  # fmt: skip


def crept(t: Any) -> Any:
    return PER * np.log10(1.0 + t / LOADED)


@pytest.mark.parametrize("dimension", [2, 3])
def test_under_a_constant_pull_it_grows_with_the_logarithm_of_time(dimension: int) -> None:
    """Strain F/EA + c log10(1 + t/t0), and the pull does its work: all of it is lost."""
    pull = 2e4
    found = hybrid.run(rope({"kind": "free", "force": [pull, 0, 0]}, 0.5, 600.0) | {"dimension": dimension})
    strain = found.position[:, -1, 0] / LENGTH - 1.0
    assert strain[0] == pytest.approx(pull / EA, rel=1e-9)
    np.testing.assert_allclose(strain - strain[0], crept(found.t), atol=2e-6)  # it goes on, against mass and damping
    lost, done = float(found["work/hysteresis"][-1]), pull * LENGTH * (strain[-1] - strain[0])
    print(f"{-lost:.3f} J lost of {done:.3f} J done")
    assert lost == pytest.approx(-pull * LENGTH * crept(600.0), rel=1e-3)
    assert lost == pytest.approx(-done, rel=5e-3)


def test_between_two_ends_it_relaxes() -> None:
    """EA (strain - c log10(1 + t/t0)): tension falls by a straight line over the logarithm of time."""
    held = {"kind": "pinned", "position": [LENGTH * 1.02, 0, 0]}
    found = hybrid.run(rope(held, 1.0, 600.0))
    np.testing.assert_allclose(found.tension[:, 5], EA * (0.02 - crept(found.t)), rtol=1e-5)
    stored = found["energy/stretch"]
    assert float(found["work/hysteresis"][-1]) == pytest.approx(float(stored[-1] - stored[0]), rel=1e-3)
    assert abs(float(found["work/scheme"][-1])) < 1e-3 * abs(float(stored[-1] - stored[0]))


def test_a_table_and_a_dynamic_stiffness_creep_as_well() -> None:
    held = {"kind": "pinned", "position": [LENGTH * 1.02, 0, 0]}
    table = {"axial_stiffness": None, "tension_strain": [[0, 0], [0.015, 1.2e4], [0.05, 6e4]]}
    for law in (table, {"dynamic_stiffness": {"constant": 3e6, "relaxation_time": 5.0}}):
        given = {k: x for k, x in (CREEP | law).items() if x is not None}
        tables = rope(held, 1.0, 600.0)
        tables["cable"]["sections"][0] = {"length": LENGTH, "mass": 1.0, "damping": 20.0} | given
        found = hybrid.run(tables)
        left = 0.02 - crept(600.0)
        rest = np.interp(left, *np.array(table["tension_strain"], float).T) if law is table else EA * left
        assert found.tension[-1, 5] == pytest.approx(rest, rel=1e-3)


def test_a_run_goes_on_bit_for_bit(tmp_path: Path) -> None:
    resumed(rope({"kind": "free", "force": [2e4, 0, 0]}, 0.5, 60.0), tmp_path, 30.0)


def test_what_is_refused() -> None:
    with pytest.raises(SceneError, match="does not stretch does not creep"):
        hybrid.validate_scene({"cable": {"sections": [{"length": 1.0, "mass": 1.0, "creep": CREEP["creep"]}]}})
