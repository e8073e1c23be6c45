"""Rules of verdicts against numbers and lists that stand here, not against the tables that are tested."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest
from reported import reported

from hybrid.store.capacity import Row
from hybrid.store.limits import Held
from hybrid.store.records import Event
from hybrid.store.verdicts import DOUBTS, OF_ACCURACY, asked_accuracy, quantity_limits, section_limits, worst_accuracy

WITHIN, BROKEN, OPEN = "within", "broken", "not verified"
# What makes everything doubtful, what bends alone, pulls alone, both, and torque: physics, not the table.
OF_ALL = {
    "gains energy", "implausible", "error uncertain", "several equilibria", "line meets itself", "bodies overlap",
    "lines pass through each other", "contact given up", "unstable", "out of plane", "deep in the seabed",
    "deep in an obstacle", "unresolved contact", "numerical dissipation", "vibrations damped", "coarse step",
    "iterations cut", "model error not estimated", "envelope incomplete", "windows uncertain",
}  # fmt: skip
OF_BENDS = {
    "unresolved bend", "unresolved slack bend", "kink at joint", "unresolved change of section", "ignored",
    "bending at clamp neglected", "bending at point load neglected", "slack line as rods",
}  # fmt: skip
OF_PULLS = {"largest force uncertain", "end force between outputs", "snap", "undamped", "static friction neglected"}
OF_BOTH, OF_TORQUE = {"slack"}, {"unresolved twist", "torque neglected"}


def with_accuracy(asked: float | None, error: float | None, unit: str = "m", **more: Any) -> Any:
    """The verdict on an accuracy of so much, with so much of error."""
    result = reported(errors=True, rod=True, asked="position", **more)
    each = [{"quantity": "position", "of": "position", "unit": unit, "asked": asked, "error": error}]
    result.attributes["accuracy_verdicts"] = json.dumps(each)
    (found,) = asked_accuracy(result)
    return found


@pytest.mark.parametrize("asked", [1e-6, 1.0, 250.0])
@pytest.mark.parametrize("part", [0.0, 0.5, 1.0])
def test_met_means_that_the_error_is_no_more_than_what_is_asked(asked: float, part: float) -> None:
    assert with_accuracy(asked, part * asked).verdict == "met"


@pytest.mark.parametrize("part", [1.0 + 1e-9, 1.1, 1.9, 2.0, 1e6])
def test_more_than_what_is_asked_is_missed(part: float) -> None:
    found = with_accuracy(4.0, 4.0 * part)
    assert found.verdict == "missed" and found.error > found.asked and not found.why
    chance = {"quantity": "position", "of": "position", "unit": "m", "asked": 4.0, "error": 4.0 * part, "by_chance": 1}
    result = reported(errors=True, asked="position")
    result.attributes["accuracy_verdicts"] = json.dumps([chance])
    assert asked_accuracy(result)[0].verdict == "met"  # a largest force by chance misses nothing


def test_the_worst_verdict_of_an_accuracy_counts() -> None:
    met, missed, unknown = with_accuracy(1.0, 0.5), with_accuracy(1.0, 2.0), with_accuracy(1.0, None)
    assert unknown.verdict == OPEN and unknown.why and unknown.remedy
    assert worst_accuracy([met, unknown]) is unknown and worst_accuracy([met, unknown, missed]) is missed


@pytest.mark.parametrize("kind", sorted(OF_ALL | OF_BENDS | OF_PULLS | OF_BOTH | OF_TORQUE))
def test_what_an_event_makes_doubtful(kind: str) -> None:
    text = "moment and tangent at ends.end: no" if kind == "ignored" else "it is so"
    for name, of in (("position", set()), ("tension", OF_PULLS | OF_BOTH), ("curvature", OF_BENDS | OF_BOTH)):
        result = reported(errors=True, rod=True, asked=name, events=[(8.0, 50.0, 50.0, kind, text)])
        (found,) = asked_accuracy(result)
        assert found.verdict == (OPEN if kind in OF_ALL | of else "met"), (name, found)


@pytest.mark.parametrize(("text", "verdicts"), [
    ("finer cells and steps change as much as coarser ones did: tension (1.1 times); it may be larger", ("met", OPEN)),
    ("a vibration of 0.2 s", (OPEN, OPEN)),
])  # fmt: skip
def test_a_quantity_that_does_not_converge_leaves_others_as_they_are(text: str, verdicts: tuple[str, str]) -> None:
    """Position and end forces, of which tension does not: forces at the ends are that tension."""
    for name, verdict in zip(("position", "end_force_start"), verdicts, strict=True):
        result = reported(errors=True, rod=True, asked=name, events=[(0.0, 0.0, 100.0, "error uncertain", text)])
        result.attributes["errors_not_converged"] = "tension"
        assert asked_accuracy(result)[0].verdict == verdict, name


def test_no_kind_is_in_the_table_that_is_not_listed_here() -> None:
    assert {*DOUBTS, *OF_ACCURACY} == OF_ALL | OF_BENDS | OF_PULLS | OF_BOTH | OF_TORQUE


def test_a_bend_that_a_catenary_does_not_show_is_missing_in_its_tension() -> None:
    """Cells are catenaries at 2 s, rods at 8 s (40 to 60 m)."""
    for t, verdict in ((2.0, OPEN), (8.0, "met")):
        events = [(t, 50.0, 50.0, "unresolved bend", "it is so")]
        (found,) = asked_accuracy(reported(errors=True, rod=True, asked="tension", events=events))
        assert found.verdict == verdict


# --- limits -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("t", "verdict"), [(2.5, OPEN), (2.4, OPEN), (2.6, BROKEN)])
def test_a_kink_counts_from_its_own_time_on(t: float, verdict: str) -> None:
    """60 m are allowed and 50 reached, at 2.5 s."""
    events = [(t, 0.0, 100.0, "kink at joint", "it counts as a bend")]
    (found,) = section_limits(reported(allowed=60.0, errors=True, events=events))
    assert found.t == pytest.approx(2.5) and found.verdict == verdict


@pytest.mark.parametrize(("error", "verdict"), [(0.19, WITHIN), (0.2 + 1e-6, OPEN), (0.21, OPEN), (5.0, OPEN)])
def test_what_all_steps_use_and_its_error_stay_below_a_limit(error: float, verdict: str) -> None:
    """80 % is used; outputs alone are known to 4 %."""
    (found,) = section_limits(reported(allowed=40.0, errors=True, extremes={"min_bend_radius": error}))
    assert found.verdict == verdict
    if verdict == OPEN:
        assert "with its error curvature may pass the limit" in found.why and found.used is None


@pytest.mark.parametrize("extremes", [{}, {"max_tension": 0.0}])
def test_no_limit_is_kept_by_extremes_that_nobody_estimated(extremes: dict[str, float]) -> None:
    (found,) = section_limits(reported(allowed=4.0, errors=True, extremes=extremes))
    assert found.verdict == OPEN and found.why == "the error of curvature over all steps is not estimated"
    assert "errors: true" in found.remedy


class Made(dict[str, Any]):
    """A result with one named quantity or a pipe, as verdicts read it."""

    def __init__(
        self, values: dict[str, Any], lines: Iterable[str] = (), moves: bool = False, **attributes: Any
    ) -> None:
        super().__init__(values)
        self.attributes, self.lines, self.line_name = attributes, {x: Made({}) for x in lines}, ""
        self.times, self.s = np.arange(3.0 if moves else 1.0), np.array([0.0, 10.0])
        self.events: list[Event] = []
        self.status, self.pending, self.zones = "complete", "", []
        self.position = np.zeros((1, 2, 3))

    def both_sides(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        return self.s, np.asarray(self[name])


def judged(monkeypatch: pytest.MonkeyPatch, held: Held, made: Made) -> Held:
    monkeypatch.setattr("hybrid.store.verdicts.held_of", lambda result: [held])
    (found,) = quantity_limits(made)  # type: ignore[arg-type]
    return found


def gap(value: float) -> Held:
    return Held("gap", "smallest", "m", value, 1.0, value < 1.0, 0.0, None, False)


@pytest.mark.parametrize(("lines", "left", "verdict"), [
    ((), 0.06, WITHIN), ((), 0.04, OPEN), (("a", "b"), 0.11, WITHIN), (("a", "b"), 0.09, OPEN),
])  # fmt: skip
def test_a_clearance_has_the_errors_of_both_lines(
    monkeypatch: pytest.MonkeyPatch, lines: Any, left: float, verdict: str
) -> None:
    """Positions are known to 0.05 m: that is the error of a clearance to a point, twice of that between two lines."""
    made = Made({"gap_at": 1}, lines, error_total_position=0.05)
    assert judged(monkeypatch, gap(1.0 + left), made).verdict == verdict


@pytest.mark.parametrize(("figures", "verdict"), [
    ({"gap smallest": 0.2}, WITHIN), ({"gap smallest": 0.31}, OPEN), ({"gap largest": 0.0}, OPEN), ({}, OPEN),
])  # fmt: skip
def test_a_quantity_has_the_error_of_its_own_extreme(
    monkeypatch: pytest.MonkeyPatch, figures: dict[str, float], verdict: str
) -> None:
    """0.3 m are left; the error of positions at outputs, 0.05 m, is not that of steps between."""
    made = Made({"gap_at": 1}, moves=True, error_total_position=0.05, accuracy_extremes=json.dumps(figures))
    assert judged(monkeypatch, gap(1.3), made).verdict == verdict


def test_the_remedy_of_an_error_that_is_lacking_is_none_that_the_scene_has(monkeypatch: pytest.MonkeyPatch) -> None:
    """Errors of all lines count; where some extremes have theirs, an accuracy was asked, and another run shows more."""
    made = Made({"gap_at": 1}, ["a"], moves=True, error_total_position=0.05)
    assert "accuracy: 5%" in judged(monkeypatch, gap(1.3), made).remedy
    made.lines["a"].attributes["accuracy_extremes"] = json.dumps({"drift largest": 0.1})
    found = judged(monkeypatch, gap(1.3), made)
    assert found.verdict == OPEN and "half the time.step" in found.remedy
    made.lines["a"].attributes["accuracy_extremes"] = json.dumps({"gap smallest": 0.1})
    assert judged(monkeypatch, gap(1.3), made).verdict == WITHIN


@pytest.mark.parametrize(("tension", "curvature", "verdict"), [
    (0.0, 0.0, WITHIN), (9.0, 0.0, WITHIN), (11.0, 0.0, OPEN), (0.0, 2.2, OPEN), (6.0, 1.0, OPEN), (4.0, 1.0, WITHIN),
])  # fmt: skip
def test_the_stress_of_a_pipe_has_the_errors_of_tension_and_curvature(
    monkeypatch: pytest.MonkeyPatch, tension: float, curvature: float, verdict: str
) -> None:
    """90 of 100 Pa, with 1 Pa per N and 5 Pa per 1/m."""
    values = {"von_mises": [[90.0, 50.0]], "max_stress": np.array([100.0, 100.0])}
    values |= {"stress_per_tension": np.array([1.0, 1.0]), "stress_per_curvature": np.array([5.0, 5.0])}
    values |= {"errors/total/tension": np.array([[tension] * 2]), "errors/total/curvature": np.array([[curvature] * 2])}
    held = Held("von_mises", "max_stress", "Pa", 90.0, 100.0, False, 0.0, 0.0, False)
    assert judged(monkeypatch, held, Made(values)).verdict == verdict
    moving = Made(values, moves=True, accuracy_extremes=json.dumps({"max_stress": 0.2}))
    assert judged(monkeypatch, held, moving).verdict == OPEN  # over all steps 110 % may be used


def test_an_angle_of_a_force_goes_by_what_its_error_turns_it() -> None:
    """1 N of 100 N turns it by 0.573 deg; an error as large as the least force leaves it open."""
    from hybrid.store.verdicts import _error_of_held

    x = Held("dip", "largest", "deg", 10.0, 11.0, False, 0.0, None, False)
    made = Made({"reaction_start": np.array([[0.0, 0.0, 100.0], [300.0, 0.0, 0.0]])}, error_total_end_force=1.0)
    assert _error_of_held(made, x, False) == pytest.approx(0.57297, rel=1e-4)  # type: ignore[arg-type]
    made.attributes["error_total_end_force"] = 100.0
    assert _error_of_held(made, x, False) is None  # type: ignore[arg-type]


@pytest.mark.parametrize(("limit", "value", "allowed", "broken"), [
    ("min_tension", 24.9, 25.0, True), ("min_tension", 25.1, 25.0, False),
    ("max_tension", 100.1, 100.0, True), ("max_tension", 99.9, 100.0, False),
    ("min_bend_radius", 0.201, 5.0, True), ("min_bend_radius", 0.199, 5.0, False),
    ("max_contact_force", 50.1, 50.0, True), ("max_contact_force", 49.9, 50.0, False),
])  # fmt: skip
def test_which_side_of_a_limit_is_broken(limit: str, value: float, allowed: float, broken: bool) -> None:
    """Values of the envelope: tension, N; curvature, 1/m; contact, N/m."""
    from hybrid.store.envelope import judged as of_envelope

    name = {"min_tension": "tension_min", "max_tension": "tension_max", "min_bend_radius": "curvature_max"}
    full = name.get(limit, "contact_max")
    time = full[:-3] + "t_" + full[-3:]
    made = {"s": np.array([0.0, 1.0]), limit: np.full(2, allowed), full: np.array([np.nan, value]), time: np.zeros(2)}
    (found,) = of_envelope({f"envelope/{x}": y for x, y in made.items()})
    assert found.broken is broken and found.s == 1.0
    assert (found.margin < 0.0) is broken


def test_a_code_by_tension_alone_needs_no_bend() -> None:
    """E301 goes by tension, F201 and capacities by bends as well."""
    from hybrid.store.verdicts import _names_of_held

    use = Held("use", "code", "%", 90.0, 100.0, False, 0.0, 0.0, False)
    assert _names_of_held(Made({}), use) == {"tension"}  # type: ignore[arg-type]
    assert _names_of_held(Made({}), use._replace(limit="capacity")) == {"tension", "curvature"}  # type: ignore[arg-type]


def ranges() -> dict[str, Any]:
    """Outputs of 50 N and 0.1 1/m, known to 1 N and 0.01 1/m; over all steps 40 to 60 N and 0.2 1/m."""
    values: dict[str, Any] = {"tension": np.full((1, 2), 50.0), "curvature": np.full((1, 2), 0.1)}
    values |= {"errors/total/tension": np.full((1, 2), 1.0), "errors/total/curvature": np.full((1, 2), 0.01)}
    made = {"s": [0.0, 10.0], "tension_min": [40.0] * 2, "tension_max": [60.0] * 2, "curvature_max": [0.2] * 2}
    made |= {"tension_t_max": [1.0] * 2}
    return values | {f"envelope/{x}": np.array(y) for x, y in made.items()} | {"envelope/end": np.array(3.0)}


@pytest.mark.parametrize(("figures", "verdict"), [
    ({"tension": 15.0, "curvature": 0.0}, WITHIN), ({"tension": 25.0, "curvature": 0.0}, OPEN),
    ({"tension": 0.0, "curvature": 0.15}, WITHIN), ({"tension": 0.0, "curvature": 0.25}, OPEN),
    ({"tension": 0.0}, OPEN), ({}, OPEN),
])  # fmt: skip
def test_a_capacity_has_the_errors_of_its_ranges_over_all_steps(
    monkeypatch: pytest.MonkeyPatch, figures: dict[str, float], verdict: str
) -> None:
    """Of 100 N and 1 1/m in a triangle 60/100 + 0.2/1 = 0.8 are used: 20 N or 0.2 1/m are left."""
    held = Held("capacity_used", "capacity", "%", 80.0, 100.0, False, 0.0, 0.0, False)
    corners = np.array([[0.0, 10.0, 100.0, 0.0], [0.0, 10.0, 0.0, 1.0]])
    made = Made(ranges() | {"capacity": corners}, moves=True, accuracy_extremes=json.dumps(figures))
    assert judged(monkeypatch, held, made).verdict == verdict


@pytest.mark.parametrize(("figures", "verdict"), [({"tension": 35.0}, WITHIN), ({"tension": 45.0}, OPEN), ({}, OPEN)])
def test_a_mooring_line_has_the_error_of_its_largest_tension(
    monkeypatch: pytest.MonkeyPatch, figures: dict[str, float], verdict: str
) -> None:
    """60 N of a strength of 100 N, by E301 without factors."""
    row = Row(
        **dict.fromkeys(Row._fields, 0.0) | {"last": 10.0, "functional": 1.0, "environment": 1.0, "strength": 1e2}
    )
    held = Held("code_used", "code", "%", 60.0, 100.0, False, 0.0, 0.0, False)
    made = Made(ranges() | {"code": np.array([row])}, moves=True, accuracy_extremes=json.dumps(figures))
    assert judged(monkeypatch, held, made).verdict == verdict
