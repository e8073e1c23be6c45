"""What a report says first: every number is that of the data, and what is missing is said to be."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reported import reported

import hybrid
from hybrid.cli.tables import extremes_facts, extremes_rows
from hybrid.errors import EVENTS_BY_WEIGHT
from hybrid.store.reader import Result
from hybrid.view import matplotlib_backend, panels
from hybrid.view.curves import along, kept
from hybrid.view.figure import NEWS, Band, Line, Panel, prefix
from hybrid.view.panels import error_of, profiles
from hybrid.view.summary import Fact, amount, attention, facts_of
from tests.scenes import cable_scene, clamped_at, pinned_at


def fact(result: Result, key: str) -> Fact:
    (found,) = [f for f in facts_of(result) if f.key == key]
    return found


def test_the_largest_tension_is_that_of_all_outputs_and_points() -> None:
    found = fact(reported(), "tension")
    assert found.values["tension"] == pytest.approx(21e3) and (found.t, found.s) == (2.5, 100.0)
    assert found.text.startswith("21 kN at the end (s = 100 m), t = 2.5 s.")
    assert "Between outputs the force at the end reaches 22.05 kN, at t = 2.5 s." in found.text
    assert "Between" not in fact(reported(steps=False), "tension").text
    assert "(± 100 N)" in fact(reported(errors=True), "tension").text


def test_a_figure_of_an_error_that_does_not_converge_stands_beside_no_number() -> None:
    known, unknown = reported(errors=True), reported(errors=True, not_converged="curvature,position")
    assert fact(known, "bend").values["headline"] == "50 m (± 5 %)"
    assert fact(unknown, "bend").values["headline"] == "50 m (error not known: not converged)"
    assert "± 100 N" in fact(unknown, "tension").values["headline"]
    assert "Position 0.042 m" in fact(known, "errors").text
    found = fact(unknown, "errors")
    assert "Position not known" in found.text and found.values["total_position"] is None
    assert error_of(known, "curvature") is not None and error_of(unknown, "curvature") is None
    forces = fact(reported(errors=True, not_converged="tension"), "errors")
    assert "end forces not known" in forces.text and forces.values["mesh_end_force"] is None


def test_a_warning_of_the_whole_run_has_neither_time_nor_place() -> None:
    found = fact(reported(events=[(0.0, 0.0, 100.0, "not converged", "finer cells change as much")]), "warning")
    assert found.text == "finer cells change as much"
    found = fact(reported(events=[(0.0, 0.0, 100.0, "slack", "no tension")]), "warning")
    assert found.text.startswith("At t = 0 s, s = 0 to 100 m: ")


def test_the_smallest_bend_radius_is_held_against_the_one_allowed_there() -> None:
    free = fact(reported(), "bend")
    assert free.values["radius"] == pytest.approx(50.0) and (free.t, free.s) == (2.5, 50.0)
    assert free.text.endswith("No allowed radius given.") and free.weight == "plain"
    good = fact(reported(allowed=40.0, errors=True), "bend")
    assert good.weight == "plain" and good.values["ratio"] == pytest.approx(0.8)
    assert "MBR utilisation of 80 %" in good.text
    unknown = fact(reported(allowed=40.0), "bend")
    assert unknown.weight == "note" and "not verified: the error of curvature is not estimated" in unknown.text
    assert unknown.values["ratio"] is None
    bad = fact(reported(allowed=60.0), "bend")
    assert bad.weight == "alarm" and "below the 60 m allowed" in bad.text
    # 0.02 (0.75 + 0.25 sin) > 1/60 where the sine is above 1/3: 8 of the 21 outputs
    times = np.linspace(0.0, 10.0, 21)
    count = int((0.02 * (0.75 + 0.25 * np.sin(0.2 * np.pi * times)) > 1 / 60).sum())
    assert f"at {count} of 21 outputs" in bad.text


def test_slack_says_where_when_how_often_and_how_long() -> None:
    taut = fact(reported(), "slack")
    assert taut.weight == "plain" and "taut everywhere and always" in taut.text
    assert taut.values["tension"] == pytest.approx(9e3) and (taut.t, taut.s) == (7.5, 0.0)
    slack = fact(reported(dip=15.5e3), "slack")
    assert slack.values["tension"] == pytest.approx(-500.0) and (slack.t, slack.s) == (5.0, 50.0)
    assert slack.weight == "note" and "at 1 of 21 outputs, at most 2.5 m of it" in slack.text


def test_points_on_a_part_of_the_line_are_not_taken_for_all_of_it() -> None:
    part = reported(span=(10.0, 90.0))
    assert "at s = 90 m" in fact(part, "tension").text and "at s = 10 m" in fact(part, "slack").text
    assert "at all points that were saved" in fact(part, "slack").text


def test_torque_is_held_against_greenhills_criterion() -> None:
    """T > M^2 / (4 EI): of 2000 N m, 500 N are needed in the rods, where at least 12.9 kN are there."""
    assert "the margin is not verified" in fact(reported(torque=2000.0), "hockling").text
    found = fact(reported(torque=2000.0, errors=True), "hockling")
    least = 1e4 * (1.4 - 0.1)
    assert found.values["needed"] == pytest.approx(2000.0**2 / (4 * 2000.0)) and found.weight == "plain"
    assert found.values["ratio"] == pytest.approx(500.0 / least) and (found.t, found.s) == (7.5, 40.0)
    assert "Greenhill" in found.text and f"{least / 500.0:.3g} times as much" in found.text
    broken = fact(reported(torque=12e3), "hockling")
    assert broken.weight == "alarm" and broken.values["ratio"] > 1.0
    assert "carries no torque" in fact(reported(), "hockling").text
    assert "far too small" in fact(reported(torque=0.1), "hockling").text
    none = fact(reported(rod=False), "hockling")
    assert none.weight == "absent" and "No torque is computed" in none.text


def test_torque_in_slack_rods_breaks_the_criterion() -> None:
    found = fact(reported(torque=2000.0, dip=20e3, outputs=41, errors=True), "hockling")
    assert "No torque" not in found.text and found.weight == "plain"  # the dip is before the rod comes
    slack = reported(torque=2000.0)
    tension = slack.tension.copy()
    tension[-1, 20] = -100.0
    slack._cache["tension"] = tension
    found = fact(slack, "hockling")
    assert found.weight == "alarm" and (found.t, found.s) == (10.0, 50.0)


@pytest.mark.parametrize("torque", [0.1, 2000.0], ids=["a small torque", "a large one"])
def test_compression_is_beyond_the_criterion_of_a_line_in_tension(torque: float) -> None:
    """-200 N over 5 m at 3 of 21 outputs: a torque that is small against tension is not said to be too small there."""
    result = reported(torque=torque, errors=True)
    tension = result.tension.copy()
    at = np.searchsorted(result.s, [50.0, 55.0])
    tension[-3:, at[0] : at[1]] = -200.0
    result._cache["tension"] = tension
    found, length = fact(result, "hockling"), np.gradient(result.s)[at[0] : at[1]].sum()
    assert f"compressed at 3 of 21 outputs, at most {length:.3g} m of it" in found.text
    assert "of a line in tension and does not hold there" in found.text and found.weight != "plain"
    for wrong in ("far too small", "would throw a loop"):
        assert wrong not in found.text


def test_a_straight_line_is_not_judged_where_it_has_a_loop() -> None:
    """The margin is least at 7.5 s; with a loop from 7 to 9 s it is that of other outputs, and the text says when."""
    loop = [(7.0, 50.0, 50.0, "loop formed", "it"), (8.0, 50.0, 50.0, "loop formed", "twice")]
    free = fact(reported(torque=2000.0, errors=True), "hockling")
    found = fact(reported(torque=2000.0, errors=True, events=loop), "hockling")
    assert free.t == 7.5 and found.t < 7.0 and found.values["margin"] > free.values["margin"]
    assert found.text.count("A loop formed at t = 7 s.") == 1 and "not judged by it" in found.text
    opened = fact(
        reported(torque=2000.0, errors=True, events=[*loop, (9.0, 0.0, 0.0, "loop opened", "it")]), "hockling"
    )
    assert opened.t is not None and (opened.t < 7.0 or opened.t >= 9.0) and "A loop opened at t = 9 s." in opened.text
    from_the_start = [(0.0, 50.0, 50.0, "loop formed", "it")]
    none = fact(reported(torque=2000.0, errors=True, events=from_the_start), "hockling")
    assert "judged at no output without a loop" in none.text and "Nearest" not in none.text


def test_the_loop_of_the_largest_torque_is_held_against_the_bend_radius() -> None:
    """q = M D/EI = 0.05: T = 1.105 (M/D)(1 + 0.053 q); the radius at the crown is D/(2 delta), delta = 0.236."""
    found = fact(reported(torque=2000.0, allowed=0.1, errors=True), "hockling")
    assert found.values["pop_out_tension"] == pytest.approx(1.105 * 2000.0 / 0.05 * 1.00265, rel=5e-3)
    assert found.values["pop_out_radius"] == pytest.approx(0.05 / (2 * 0.236), rel=1e-2)
    assert found.values["kink_margin"] == pytest.approx(found.values["pop_out_radius"] / 0.1)
    assert "kinks first" not in found.text and "of the radius allowed" in found.text
    assert "kinks first" in fact(reported(torque=2000.0, allowed=0.2), "hockling").text


def test_a_loop_in_contact_is_held_against_what_would_pull_it_open() -> None:
    """At t = 2.5 s the tension is largest, 10 kN (1.1 + s/100) at the end of the outputs in contact."""
    result = reported(torque=2000.0, through=True)
    touches = np.zeros(len(result.times))
    touches[3:7] = 1.0  # t = 1.5 to 3 s
    result._dims = {**result._dims, "energy/self_contact": ("t",)}
    result._cache["energy/self_contact"] = touches
    found = fact(result, "hockling")
    assert found.values["pop_out_time"] == 2.5
    assert found.values["pop_out_margin"] == pytest.approx(found.values["pop_out_tension"] / 21e3, rel=1e-3)
    assert "be pulled open" in found.text and "not in it" in found.text
    assert "pop_out_margin" not in fact(reported(torque=2000.0, through=True), "hockling").values


def test_torque_of_catenaries_counts() -> None:
    """The smallest tension is in a catenary, where the same torque asks for the same."""
    found = fact(reported(torque=2000.0, through=True), "hockling")
    assert found.values["tension"] == pytest.approx(9e3) and found.values["margin"] == pytest.approx(18.0)


def test_touchdown_is_told_with_its_range() -> None:
    found = fact(reported(), "seabed")
    assert found.values["grounded"] == pytest.approx([19.0, 21.0])
    assert found.values["touchdown"]["last"] == pytest.approx([19.0, 21.0])
    assert "contact ends at s = 19 to 21 m" in found.text and "3.15 kN, t = 2.5 s" in found.text
    assert fact(reported(seabed=False), "seabed").text == "The scene has no seabed."


def test_errors_are_told_by_cause_or_said_not_to_be_estimated() -> None:
    found = fact(reported(errors=True), "errors")
    assert found.values["mesh_position"] == 0.03 and found.values["total_end_force"] == 42.0
    assert "Position 0.042 m, end forces 42 N" in found.text
    assert fact(reported(), "errors").text.startswith("Not estimated")


def test_warnings_come_by_weight_and_news_are_none() -> None:
    events = [
        (1.0, 0.0, 100.0, "end rotated in", "news"),
        (3.0, 5.0, 5.0, "snap", "a blow"),
        (2.0, 0, 9, "slack", "loose"),
    ]
    events += [(4.0, 0.0, 9.0, "slack", "loose again"), (5.0, 1.0, 2.0, "grow", "bend 1.05 > 1")]
    found = [f for f in facts_of(reported(events=events)) if f.key == "warning"]
    assert [(f.values["kind"], f.weight) for f in found] == [
        ("slack", "alarm"),
        ("snap", "alarm"),
        ("end rotated in", "note"),
    ]
    assert "(2 times; this is the first)" in found[0].text and found[0].t == 2.0
    assert EVENTS_BY_WEIGHT.index("slack") < EVENTS_BY_WEIGHT.index("snap") and "end rotated in" in NEWS


def test_what_needs_attention_begins_with_how_it_ended() -> None:
    events = [(3.0, 5.0, 5.0, "snap", "a blow")]
    result = reported(events=events, allowed=60.0, status="failed", message="it diverged")
    assert [f.key for f in attention(facts_of(result))] == ["status", "bend", "warning"]
    assert attention(facts_of(reported())) == []
    told = reported(status="failed", message="slack at t = 1 s", events=[(1.0, 0, 1, "slack", "slack at t = 1 s")])
    assert [f.key for f in attention(facts_of(told))] == ["status"]  # not told twice


@pytest.mark.parametrize("outputs", [0, 1, 2])
def test_facts_of_few_outputs(outputs: int) -> None:
    facts = facts_of(reported(outputs=outputs, seabed=False, energy=False))
    assert facts[-1].key == "status" and all(f.text for f in facts)
    if outputs == 1:
        assert not any(", t = " in f.text for f in facts[:-1])


def test_amounts_are_as_engineers_write_them() -> None:
    assert [amount(41346.9, "N"), amount(0.0, "N"), amount(-0.25, "N", 2)] == ["41.35 kN", "0 N", "-250 mN"]
    assert amount(math.pi, "m", 3) == "3.14 m"


# Quantities that jump, in pictures and facts: curves have a gap, and both values count.


CLUMP = 4.1  # m, where it hangs


@pytest.fixture(scope="module")
def swing() -> hybrid.Result:
    """A chain of 10 m with a clump that swings from its end at s = 10 m."""
    scene: dict[str, Any] = cable_scene(
        {"length": 10.0, "mass": 2.0, "axial_stiffness": 1e6}, "free", pinned_at(0, 0, 0),
        attachments=[{"kind": "clump", "at": CLUMP, "mass": 50.0}],
        initial={"kind": "straight", "direction": [-0.3, 0, 1.0]}, model="catenary", mesh=20, time=(1.0, 0.02),
        output={"points": 11, "every": 0.1, "errors": True}
    )  # fmt: skip
    return hybrid.run(hybrid.validate_scene(scene))


def cantilever(**allowed: float) -> hybrid.Result:
    """Two sections clamped at s = 0 under their weight: the softer one, from s = 0.6 m on, bends most just there."""
    section = {"mass": 0.05, "axial_stiffness": 1e7}
    parts = [
        section | {"length": 0.6, "bending_stiffness": 400.0},
        section | {"length": 0.4, "bending_stiffness": 50.0},
    ]
    for part, radius in zip(parts, allowed.values(), strict=bool(allowed)):
        part["min_bend_radius"] = radius
    scene: dict[str, Any] = cable_scene(parts, clamped_at([0, 0, 0], [1, 0, 0]), "free", model="rod", mesh=100)
    return hybrid.static(hybrid.validate_scene(scene))


def lines(panel: Panel) -> list[Line]:
    return [item for item in panel.items if isinstance(item, Line)]


def test_curves_along_the_cable_have_a_gap_at_a_jump(swing: hybrid.Result) -> None:
    (curve,) = lines(panels.profiles(swing, "tension"))
    (k,) = np.flatnonzero(np.isnan(curve.y))
    assert curve.x[k - 1 : k + 2].tolist() == [CLUMP] * 3
    ratio = curve.y[k + 1] / curve.y[k - 1]
    assert ratio == pytest.approx(swing["right/tension"][-1, 0] / swing.tension[-1, swing.s == CLUMP][0])
    assert ratio > 3.0  # 41 + 50 kg hang there, and 8.2 kg below
    (height,) = lines(panels.profiles(swing, "z"))
    assert np.isfinite(height.y).all() and np.array_equal(height.x, swing.s)


def test_ranges_have_the_gap_at_all_times(swing: hybrid.Result) -> None:
    (panel,) = (p for p in panels.ranges(swing, kept(swing)) if p.key == "range-tension")
    assert len(lines(panel)) == 4
    for line in lines(panel):
        assert np.isnan(line.y).sum() == 1 and line.x[np.isnan(line.y)] == CLUMP
    moving = lines(panel)[-1]
    assert moving.frames is not None and moving.frames.shape == (11, moving.x.size)
    assert np.isnan(moving.frames[:, moving.x == CLUMP]).sum() == 11


def test_histories_at_a_jump_are_two(swing: hybrid.Result) -> None:
    curves = lines(panels.history(swing, "tension", [2.0, CLUMP]))
    assert [x.label for x in curves] == ["s = 2 m", "s = 4.1 m, before the point", "s = 4.1 m, after it"]
    ratio = curves[2].y[1:] / curves[1].y[1:]
    assert ratio == pytest.approx(swing["right/tension"][1:, 0] / swing.tension[1:, swing.s == CLUMP][:, 0])
    assert len(lines(panels.history(swing, "position", [CLUMP], component=0))) == 1


@pytest.mark.long
def test_pages_and_films_of_jumps_are_made(swing: hybrid.Result, tmp_path: Path) -> None:
    assert hybrid.report(swing, tmp_path / "swing.html").stat().st_size > 1e5
    hybrid.plot(swing, path=tmp_path / "swing.png")
    assert matplotlib_backend.animate(swing, tmp_path / "swing.gif").frames == 11


def test_the_largest_value_may_be_the_one_on_the_right() -> None:
    bent = cantilever()
    right = float(bent["right/curvature"][0, 0])
    assert right > 1.04 * bent.curvature.max()
    told = fact(bent, "bend")
    assert told.values["radius"] == pytest.approx(1.0 / right) and told.s == 0.6


def test_each_side_is_held_against_its_own_limit() -> None:
    """Curvature 6.1e-4 1/m at the clamp, 9.8e-5 and 7.8e-4 1/m on the two sides of the seam."""
    good = cantilever(stiff=1400.0, soft=1000.0)
    assert good["right/min_bend_radius"].tolist() == [1000.0]
    assert good["min_bend_radius"][good.s == 0.6].tolist() == [1400.0]
    told = fact(good, "bend")
    assert told.weight == "note" and told.values["ratio"] is None  # its error is not estimated
    bad = fact(cantilever(stiff=1000.0, soft=1400.0), "bend")
    assert bad.weight == "alarm" and bad.values["ratio"] > 1.05 and bad.values["allowed"] == 1400.0
    assert cantilever()["right/bending_stiffness"].tolist() == [50.0]


def test_torque_is_held_against_the_stiffness_of_its_side(swing: hybrid.Result) -> None:
    found = along(bent := cantilever(), "torque")
    stiffness = found.of(bent, "bending_stiffness")
    assert stiffness is not None and stiffness[found.s == 0.6].tolist() == [400.0, 50.0]
    tension = along(swing, "tension")
    error = tension.of(swing, "errors/total/tension")  # the file has one value at a point
    assert error is not None and error.shape == tension.values.shape
    assert tension.of(swing, "bending_stiffness") is None


# Summary, report and closing lines judge by every accepted step and every node.


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


def test_no_more_of_a_line_is_compressed_than_there_is() -> None:
    section = {"length": 10, "mass": 50, "bending_stiffness": 1e6, "axial_stiffness": 1e8, "torsional_stiffness": 1e6}
    pressed = {"kind": "free", "force": [0, 0, -2000]}
    result = hybrid.static(cable_scene(section, clamped_at([0, 0, 0], [0, 0, 1]), pressed, output={"points": 5}))
    assert fact(result, "slack").values["length"] == pytest.approx(10.0)
