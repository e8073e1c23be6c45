"""Designs over motions against closed forms: what is found, prices, runs that it takes, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

import hybrid
from hybrid.designs.case_results import PART, TANGENT, Motions, Peaks
from hybrid.designs.numbers_and_results import over_time, peaks, scene_with, smoothed
from tests.designs.test_in_motion import G, W, heaved, on_the_bed
from tests.scenes import cable_scene

MASS, AMPLITUDE = "cable.sections[0].mass", "ends.start.motion.heave.amplitude"
TOP = {"quantity": "tension", "at": "start", "over": "max"}


def by_hand(mass, amplitude=1.0):
    """Largest pull of a mass per length, kg/m, below an end that is heaved."""
    return (40.0 * mass + 60.0) * (G + amplitude * W**2)


def test_a_mass_for_a_largest_pull():
    """One target: (m L + M)(g + A w^2) = 3500 N; linear, so that the second point has it."""
    found = hybrid.design(
        heaved(), unknowns={"m": {"key": MASS, "low": 1, "high": 20}}, targets={"top": TOP | {"value": 3500.0}}
    )
    m = brentq(lambda m: by_hand(m) - 3500.0, 1.0, 20.0)
    assert found.numbers["m"] == pytest.approx(m, rel=3e-3)
    (top,) = found.kept
    assert top.result == "max tension@start in motion" and top.value == pytest.approx(3500.0, rel=1e-5)
    assert top.finer == pytest.approx(by_hand(found.numbers["m"]), rel=1e-3)
    assert found.moving == 1 and found.runs <= 10  # four of them are the free run
    assert found.minimised is None and not found.notes
    assert found.equilibria == 0 and found.before[""][""][0] == pytest.approx([0, 0, 0], abs=1e-9)


@pytest.mark.needs("simpleeval")
def test_a_limit_over_two_seas_and_its_price():
    """As heavy as can be where the largest pull is limited: the higher sea holds, with 1 / dT/dm as its price."""
    found = hybrid.design(
        heaved(), unknowns={"m": {"key": MASS, "low": 1, "high": 20}}, minimise="-m",
        cases={"low": {AMPLITUDE: 0.5}, "high": {AMPLITUDE: 1.0}}, limits={"top": TOP | {"largest": 3500.0}},
    )  # fmt: skip
    m = brentq(lambda m: by_hand(m) - 3500.0, 1.0, 20.0)
    assert found.numbers["m"] == pytest.approx(m, rel=3e-3) and found.settled
    kept = {x.case: x for x in found.kept}
    assert kept["high"].active and not kept["low"].active
    assert kept["high"].price == pytest.approx(-1.0 / (40.0 * (G + W**2)), rel=1e-2)
    assert found.moving == 2 and found.runs / 2 <= 20


@pytest.mark.needs("simpleeval")
def test_a_sea_that_is_far_from_its_limits_is_run_where_the_search_begins_and_ends(monkeypatch):
    """As a low swell beside a high one: what it comes to is of a run all the same."""
    ran, run = [], Motions.run

    def noted(self, point, cases, finer=False):
        before = set(point.runs)
        found = run(self, point, cases, finer)
        ran.extend((x, tuple(point.x)) for x in {*point.runs} - before if not finer)
        return found

    monkeypatch.setattr(Motions, "run", noted)
    found = hybrid.design(
        heaved(), unknowns={"m": {"key": MASS, "low": 1, "high": 20}}, minimise="-m",
        cases={"low": {AMPLITUDE: 0.1}, "high": {AMPLITUDE: 4.0}}, limits={"top": TOP | {"largest": 3400.0}},
    )  # fmt: skip
    each = {case: [x for name, x in ran if name == case] for case in ("low", "high")}
    assert each["low"] == [(5.0,), (found.numbers["m"],)] and len(each["high"]) > 2
    kept = {x.case: x.value for x in found.kept}
    at = hybrid.run(found.scenes["low"])
    assert kept["low"] == pytest.approx(at["tension"][:, 0].max(), rel=1e-3)
    assert kept["high"] == pytest.approx(3400.0, rel=2e-3)


def test_peaks_of_a_history_are_seen_before_they_are_the_largest():
    """Of (time, place) the largest of each place and of each hill within a tenth, and what they are foretold to be."""
    history = np.array([[0, 1, 0, 0.5], [2.0, 9.5, 9.3, 1], [0, 3, 2, 0], [1, 9.2, 1, 0.0], [0, 0.5, 1, 10.0]])
    assert peaks(history, "max", (4, 3)) == [(4, 3), (1, 1), (1, 2), (3, 1)]
    assert peaks(-history, "min", (4, 3)) == peaks(history, "max", (4, 3))
    assert peaks(history, "mean", None) == [None]
    found = Peaks(((4, 3), (1, 1)), np.array([10.0, 9.5]), np.array([[0.0], [1.0]]), least=False)
    assert found.moved(np.array([1.0])).where == ((1, 1), (4, 3)) and found.moved(np.array([1.0])).values[0] == 10.5
    assert found.nearest_to((1, 2)) == 1


def test_the_value_of_a_limit_is_the_largest_of_its_peaks():
    """Of two hills that of the higher parabola, not of the higher output; by hand b + (c - a)^2 / 8(2b - a - c)."""
    history = np.array([[9.2, 9.79, 10.0, 9.79, 9.2, 9.0, 9.95, 9.94, 9.0]]).T
    table = smoothed(history, "max", np.zeros(1, bool))
    by_parabola = 9.95 + 0.94**2 / 8 / (2 * 9.95 - 9.94 - 9.0)
    value, where = over_time(table, "max", None)
    assert where == (6, 0) and value == pytest.approx(by_parabola, rel=1e-12) and table[2, 0] == 10.0
    assert value == max(table[x] for x in peaks(table, "max", where))
    np.testing.assert_array_equal(smoothed(-history, "min", np.zeros(1, bool)), -table)
    np.testing.assert_array_equal(smoothed(history.T, "max", np.ones(9, bool)), history.T)  # jumps between places


@pytest.mark.parametrize("side", ["max", "min"])
def test_an_extreme_changes_evenly_as_it_goes_from_one_output_to_the_next(side):
    """Of a steep crest that moves by two outputs: no leap, which a search would take for a limit that it missed."""
    sign, t, values = 1.0 if side == "max" else -1.0, np.arange(9.0), list[float]()
    for crest in np.linspace(3.5, 5.5, 2001):
        u = (t - crest)[:, None]
        table = smoothed(sign * np.exp(np.where(u < 0.0, -0.2, -0.6) * u**2), side, np.zeros(1, bool))
        values.append(sign * over_time(table, side, None)[0])
    assert np.abs(np.diff(values)).max() < 3e-4 and values == pytest.approx(np.ones(2001), abs=0.05)


@pytest.mark.long
def test_one_unknown_at_its_bound_and_one_at_the_limit_of_the_higher_sea():
    """As heavy as can be where only m L + M counts for the pull: by hand M is least, and m is what the limit leaves."""
    found = hybrid.design(
        heaved(), unknowns={"m": {"key": MASS, "low": 1, "high": 20}, "M": {"key": "ends.end.mass", "low": 10, "high": 200}},
        cases={"low": {AMPLITUDE: 0.5}, "high": {AMPLITUDE: 1.0}}, minimise="-m - 0.01*M",
        limits={"top": TOP | {"largest": 3500.0}},
    )  # fmt: skip
    assert found.settled and found.numbers["M"] == pytest.approx(10.0, rel=1e-6)
    assert (40.0 * found.numbers["m"] + 10.0) * (G + W**2) == pytest.approx(3500.0, rel=3e-3)


def test_what_has_no_equilibrium_is_designed_in_motion():
    """A rod that nothing holds falls by g t^2/2."""
    section = {
        "length": 4.0,
        "mass": 1.0,
        "axial_stiffness": 1e5,
        "bending_stiffness": 10.0,
        "torsional_stiffness": 10.0,
    }
    scene = cable_scene(
        section, "free", "free", gravity=9.0, initial={"kind": "straight", "origin": [0, 0, 0], "direction": [1, 0, 0]},
        model="rod", mesh=8, time=(1.0, 0.05)
    )  # fmt: skip
    low = {"quantity": "position.z", "at": "start", "over": "last", "value": -5.0}
    found = hybrid.design(scene, unknowns={"environment.gravity": {"low": 1, "high": 20}}, targets={"low": low})
    assert found.numbers["environment.gravity"] == pytest.approx(10.0, rel=1e-6) and found.equilibria == 0
    assert found.before[""][""][-1] == pytest.approx([4, 0, 0])


def test_results_of_rest_and_motion_together():
    """Static pull 2500 N from the mass, and a standard deviation of the pull from the amplitude."""
    rest = {"quantity": "tension", "at": "start", "value": 2500.0}
    found = hybrid.design(
        heaved(), unknowns={"m": {"key": MASS, "low": 1, "high": 20}, "a": {"key": AMPLITUDE, "low": 0.1, "high": 3}},
        targets={"rest": rest, "swing": TOP | {"value": 2900.0}},
    )  # fmt: skip
    m = (2500.0 / G - 60.0) / 40.0
    a = (2900.0 / (40.0 * m + 60.0) - G) / W**2
    assert found.numbers == pytest.approx({"m": m, "a": a}, rel=2e-2)
    assert found.numbers["m"] == pytest.approx(m, rel=1e-4)


def test_slopes_of_a_motion_are_those_of_central_differences():
    """Of a touchdown that moves, with a length that cells go along with.

    By the length they go up and down by 3 % within 0.1 m, as nodes come to the bed: less than by which kinks differ.
    """
    scene = hybrid.validate_scene(on_the_bed())
    keys = [("cable.sections[0].drag.normal",), ("cable.sections[0].length",)]
    of = ["max tension@end", "std position.z@150", "last tension@end"]
    motions = Motions(
        {"": scene}, keys, [("", f"{x} in motion") for x in of], lambda case, x: scene_with(scene, keys, x)
    )
    x = np.array([1.2, 250.0])
    here = motions.runs_of(x)
    assert not motions.refresh(here, {""})  # the first run has them
    slopes = np.array([peaks.slopes[0] for peaks in motions.peaks(here, np.abs(x))[""]])
    for i in (0, 1):
        d = 0.4 * PART * x[i] * (np.arange(2) == i)
        more, less = motions.runs_of(x + d).runs[""].values, motions.runs_of(x - d).runs[""].values
        np.testing.assert_allclose(slopes[:, i], (more - less) / (2.0 * d[i]), rtol=(1e-3, 5e-2)[i])
    assert motions.count == 1 + 2 * TANGENT + 4


REFUSED = [
    ({"top": TOP | {"largest": 3e3, "over": "std", "at": None}}, r"limits\.top\.at[^$]*the place whose std"),
    ({"top": TOP | {"largest": 3e3, "at": None, "section": 0, "over": "mean"}}, r"limits\.top\.over[^$]*max or min"),
    ({"top": TOP | {"largest": 3e3, "quantity": "tensoin"}}, r"limits\.top\.quantity"),
]


@pytest.mark.parametrize(("limits", "words"), REFUSED)
def test_what_is_refused(limits, words):
    with pytest.raises(hybrid.SceneError, match=words):
        hybrid.design(heaved(), unknowns={"m": {"key": MASS, "low": 1, "high": 20}}, minimise="-m", limits=limits)


@pytest.mark.parametrize("more", [{"tolerance": 1e-3}, {}])
def test_steps_that_follow_the_motion_are_those_of_the_first_run(more):
    """Also where an accuracy chooses them; the free run has steps half as long."""
    accuracy = {} if more else {"accuracy": "1%"}
    found = hybrid.design(
        heaved(time={"duration": 36.0} | more) | accuracy, unknowns={"m": {"key": MASS, "low": 1, "high": 20}},
        targets={"top": TOP | {"value": 3500.0}},
    )  # fmt: skip
    assert found.numbers["m"] == pytest.approx(brentq(lambda m: by_hand(m) - 3500.0, 1.0, 20.0), rel=3e-3)
    assert found.kept[0].finer == pytest.approx(by_hand(found.numbers["m"]), rel=2e-3)
    assert found.runs <= 10


def test_scenes_without_time_are_refused():
    limits = {"top": TOP | {"largest": 3500.0}}
    asked = {"unknowns": {"m": {"key": MASS, "low": 1, "high": 20}}, "minimise": "-m", "limits": limits}
    still = heaved()
    del still["time"], still["ends"]["start"]["motion"]
    with pytest.raises(hybrid.SceneError, match=r"limits\.top\.over[^$]*a scene with time"):
        hybrid.design(still, **asked)
