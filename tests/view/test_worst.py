"""Summary, report and closing lines judge by every accepted step and every node."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hybrid
from hybrid.cli.tables import extremes_facts, extremes_rows
from hybrid.store.reader import Result
from hybrid.view.figure import Band, prefix
from hybrid.view.panels import profiles
from hybrid.view.summary import Fact, attention, facts_of

TETHER = """
title: A tether with a float, in a current
environment: {fluid: {density: 1025, current: [0.5, 0, 0]}}
cable:
  sections:
    - {length: 60, mass: 0.55, diameter: 0.025, axial_stiffness: 1.0e+6, bending_stiffness: 3.0, min_bend_radius: 0.8,
       max_tension: 500, min_tension: 0, drag: {normal: 1.2}}
  attachments: [{kind: float, at: 47, buoyancy: 60, mass: 4}]
ends:
  start: {kind: pinned, position: [0, 0, -200], motion: {heave: {amplitude: 1.0, period: 4}, ramp: 4}}
  end: {kind: pinned, position: [30, 10, -215]}
initial: equilibrium
time: {duration: 6, step: 0.02}
model: rod
"""


def tether(*settings: str) -> hybrid.Scene:
    return hybrid.parse_scene(TETHER, overrides=settings)


def fact(result: Result, key: str) -> Fact:
    (found,) = [f for f in facts_of(result) if f.key == key]
    return found


def test_a_bend_between_output_points_is_found() -> None:
    """Near the float the cable bends to 0.58 m over a metre; points 6 m apart show 2 m and more."""
    few, many = (hybrid.static(tether("mesh={cells: 2000}", f"output={{points: {n}}}")) for n in (11, 1201))
    a, b = (fact(x, "bend") for x in (few, many))
    assert a == b and a.weight == "alarm" and a.values["ratio"] > 1.0
    assert a.values["radius"] == pytest.approx(1.0 / many.both_sides("curvature")[1].max(), rel=1e-9)
    assert a in attention(facts_of(few))


def test_outputs_far_apart_give_the_same_facts() -> None:
    few, many = (hybrid.run(tether("mesh={cells: 120}", f"output.every={x}")) for x in (3.0, 0.02))
    for key in ("tension", "slack", "bend", "limits"):
        a, b = fact(few, key), fact(many, key)
        same = {"tension", "radius", "allowed", "ratio", "limits"} & set(a.values)
        assert {k: a.values[k] for k in same} == {k: b.values[k] for k in same} and (a.t, a.s) == (b.t, b.s), key
    assert extremes_facts(few) == extremes_facts(many)
    assert few.tension.max() < 0.999 * fact(few, "tension").values["tension"]
    panel = profiles(few, "tension")
    (band,) = [item for item in panel.items if isinstance(item, Band)]
    drawn, factor = np.nanmax(band.high), prefix("N", float(few.tension.max()))[0]
    assert drawn == pytest.approx(factor * fact(few, "tension").values["tension"], rel=1e-9)


def test_limits_are_in_the_closing_lines_and_the_report(tmp_path: Path) -> None:
    result = hybrid.run(tether("mesh={cells: 120}", "cable.sections[0].max_tension=50", "time.duration=3"))
    facts = extremes_facts(result)
    rows = dict(extremes_rows(facts, moves=True))
    assert "max_tension of 50 N BROKEN" in rows["largest tension"]
    assert {x["limit"]: x["broken"] for x in facts["limits"]}["max_tension"]
    pulled = fact(result, "tension")
    assert pulled.weight == "alarm" and "above the 50 N allowed" in pulled.text
    assert not any(f.key == "warning" and "limit" in f.title for f in facts_of(result)), "told once"
    page = hybrid.report(result, tmp_path / "r.html").read_text()
    assert "Limits of the sections" in page and "<td>max_tension</td><td>broken</td>" in page
    free = hybrid.run(tether("mesh={cells: 120}", "cable.sections[0].max_tension=5000", "time.duration=1"))
    said = "not verified: the error of tension is not estimated"
    assert said in dict(extremes_rows(extremes_facts(free), moves=True))["largest tension"]
    assert f"Allowed are 5 kN, {said}" in fact(free, "tension").text
