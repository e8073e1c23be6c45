"""Lines of a system that touch themselves and whose zones move: each has the zones of the same line alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bits import Stopping, differences, went_on

import hybrid

WIDTH = 0.02
HOSE = {
    "length": 8.0, "mass": 0.4, "diameter": WIDTH, "axial_stiffness": 1e5, "bending_stiffness": 0.02,
    "torsional_stiffness": 0.016, "damping": {"mass": 0.5},
}  # fmt: skip
LINE = {
    "sections": [HOSE], "attachments": [{"kind": "clump", "at": 4.0, "mass": 1.0}], "model": "adaptive",
    "mesh": {"cells": 80}, "contact": {"self": True, "friction": 0.3},
}  # fmt: skip
CLOSER = {"travel": {"by": [-2.0, 0.8 * WIDTH, 0], "over": 3.0}}  # until the legs of the U touch below its ends
TIME, OUTPUT = {"duration": 4.0, "step": 0.01}, {"every": 0.1, "points": 81}


def system(*shifts: float) -> dict[str, Any]:
    """Lines that hang beside each other, y (m) apart, between ends that come together."""
    points, lines = {}, {}
    for k, y in enumerate(shifts):
        points |= {f"a{k}": {"position": [0, y, 0]}, f"b{k}": {"position": [2, y, 0], "motion": CLOSER}}
        lines[f"line {k}"] = LINE | {"start": f"a{k}", "end": f"b{k}"}
    return {"points": points, "lines": lines, "time": TIME, "output": OUTPUT}


def changes(result: hybrid.Result) -> list[tuple[float, float, float, str]]:
    return [(round(e.t, 9), e.s_a, e.s_b, e.kind) for e in result.events if e.kind in hybrid.errors.ZONE_EVENTS]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> hybrid.Result:
    path = tmp_path_factory.mktemp("contact") / "whole.h5"
    hybrid.run(system(0.0, 5.0), path, progress=False).close()
    return hybrid.open(path)


@pytest.mark.long  # 0.9 s
def test_lines_have_the_zones_and_the_contact_of_one_alone(whole: hybrid.Result) -> None:
    cable = hybrid.run(system(0.0), progress=False).lines["line 0"]
    touches = cable["energy/self_contact"] > 0.0
    first = float(cable.times[touches.argmax()])
    assert touches.sum() > 5 and any(t > first for t, *_ in changes(cable))
    for k, line in enumerate(whole.lines.values()):
        assert changes(line) == changes(cable) and [*line.zones] == [*cable.zones]
        assert {"rod", "catenary"} == {z.kind for z in line.zones[-1]}
        assert np.abs(line.position - np.array([0, 5.0 * k, 0]) - cable.position).max() < 1e-9
        assert float(line["self_distance/distance"]) == pytest.approx(float(cable["self_distance/distance"]), rel=1e-6)
        for name in ("energy/self_contact", "self_contact", "work/friction", "work/zones", "work/end", "tension"):
            here, there = line[name], cable[name]
            assert np.abs(here - there).max() <= 1e-6 * np.abs(there).max() > 0.0, name


def test_ends_that_are_led_through_each_other_are_told() -> None:
    """No contact is computed beside ends that are held: what passes through the line there is said at the end."""
    scene = system(0.0) | {"time": {"duration": 2.4, "step": 0.02}, "output": {"every": 0.2, "points": 41}}
    scene["points"]["b0"]["motion"] = {"travel": {"by": [-2.4, 0.3 * WIDTH, 0], "over": 3.0}}
    line = hybrid.run(scene, progress=False).lines["line 0"]
    (told,) = (event for event in line.events if event.kind == "line meets itself")
    assert "ends that are held" in told.text and told.value == float(line["self_distance/distance"]) < 0.85 * WIDTH
    assert told.s_a < 0.3 and told.s_b > 7.7 and told.t == float(line["self_distance/time"])


@pytest.mark.slow
def test_a_stopped_run_goes_on_bit_for_bit(
    whole: hybrid.Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Stopped in contact."""
    assert went_on(system(0.0, 5.0), tmp_path / "run.h5", Stopping(monkeypatch), [290, 70]) == 2
    assert whole.file is not None and differences(whole.file, tmp_path / "run.h5") == []
