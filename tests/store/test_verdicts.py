"""Verdicts: terminal, `stats`, report, study and Python say the same, and never of what nobody knows."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reported import reported

import hybrid
from hybrid.cli.tables import errors_facts, extremes_facts, extremes_rows
from hybrid.errors import EVENTS_BY_WEIGHT
from hybrid.scene.study import Kept
from hybrid.store.capacity import Row
from hybrid.store.limits import Held
from hybrid.store.reader import Result
from hybrid.store.records import Event, error_words
from hybrid.store.verdicts import (
    DOUBTS,
    OF_ACCURACY,
    Asked,
    accuracy_text,
    asked_accuracy,
    doubt_of,
    quantity_limits,
    section_limits,
    worst_accuracy,
)
from hybrid.studies.workers import collected
from hybrid.view.report_parts import verdict_html
from hybrid.view.summary import facts_of
from tests.called import Call
from tests.scenes import cable_scene, line_between, network_scene, pinned_at

LIMITS = ("min_bend_radius", "max_tension", "min_tension")
CLAMPED = {"kind": "clamped", "position": [0, 0, 0], "tangent": [0, 0, -1]}
GAP = {"gap": {"kind": "clearance", "point": [10, 0, 0], "smallest": 0.5}}
STEEL = {"wall": 0.005, "modulus": 2.1e11, "outer_diameter": 0.05, "max_stress": 4e8}


def scene(**more: Any) -> dict[str, Any]:
    """A slack line whose end heaves; more: parts of the scene, and of its section."""
    section = {"length": 30.0, "mass": 2.0, "diameter": 0.05, "axial_stiffness": 1e6, "bending_stiffness": 50.0}
    section |= {x: more.pop(x) for x in (*LIMITS, "pipe") if x in more}
    heave = {"heave": {"amplitude": 1, "period": 4}, "ramp": 4}
    start = more.pop("start", {"kind": "pinned", "position": [0, 0, 0]})
    return cable_scene(
        section, start, pinned_at(25, 0, 0, motion=heave), model="rod", mesh=30, time=(2, 0.05), output=0.1
    ) | more  # fmt: skip


def limits(tension: float, radius: float, least: float = -1.0) -> dict[str, float]:
    return {"max_tension": tension, "min_bend_radius": radius, "min_tension": least}


ERRORS = {"output": {"every": 0.1, "errors": True}}
FREE = {"mesh": None, "accuracy": "5%"}
# Runs: what differs in the scene, and whether it is an equilibrium.
RUNS: dict[str, tuple[dict[str, Any], bool]] = {
    "fixed": ({}, False),
    "errors": (ERRORS, False),
    "few cells": (ERRORS | {"mesh": {"cells": 4}}, False),
    "accuracy": (FREE, False),
    "curvature": (FREE | {"accuracy": {"curvature": "5%", "tension": "2%"}}, False),
    "missed": ({"accuracy": "0.001%"}, False),
    "clamped": (ERRORS | {"start": CLAMPED, "mesh": {"cells": 12}}, False),
    "catenary": (ERRORS | {"start": CLAMPED, "model": "catenary"}, False),
    "zones": ({"start": CLAMPED, "model": "adaptive", "mesh": {"cells": 30}}, False),
    "quantity": (ERRORS | {"output": ERRORS["output"] | {"quantities": GAP}}, False),
    "quantity, fixed": ({"output": {"every": 0.1, "quantities": GAP}}, False),
    "stress": (ERRORS | {"pipe": STEEL}, False),
    "at rest": ({}, True),
    "at rest, errors": (ERRORS, True),
    "at rest, clamped": ({"start": CLAMPED}, True),
}
GIVEN = {"far": limits(6000.0, 0.2), "broken": limits(300.0, 20.0, 290.0)}


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, str], Path]:
    """Thirty results."""
    folder, found = tmp_path_factory.mktemp("verdicts"), {}
    for k, (name, (more, at_rest)) in enumerate(RUNS.items()):
        for given, bounds in GIVEN.items():
            path = folder / f"{k}-{given}.h5"
            asked = {x: y for x, y in scene(**more, **bounds).items() if y is not None}
            (hybrid.static if at_rest else hybrid.run)(asked, path).close()
            found[name, given] = path
    assert len(found) == 30
    return found


# ---- what each of them says ------------------------------------------------------------------------


def of_terminal(result: Result) -> dict[str, str]:
    """By the closing lines of a command."""
    facts, found = extremes_facts(result), {}
    rows = dict(extremes_rows(facts, moves=True))
    titles = "smallest bend radius", "largest tension", "smallest tension"
    for title, limit in zip(titles, LIMITS, strict=True):
        found[limit] = word_in(rows[title])
    for x in facts["quantities"]:
        found[f"{x['name']} {x['limit']}"] = word_in(rows[x["name"]])
    return found


def word_in(text: str) -> str:
    for word, verdict in (("not verified", "not verified"), ("BROKEN", "broken"), ("within", "within")):
        if word in text:
            return verdict
    return "within" if "not below" in text else text


def of_stats(path: Path, call: Call) -> dict[str, str]:
    """By the lines of `hybrid stats`."""
    told = call("stats", str(path), "--names", "tension")
    assert not told.code
    said, found = " ".join(told.out.split()), {}
    what = r"(?:bend radius|tension|von_mises|gap) of \S+ (?:m|N|Pa)"
    for text in re.findall(rf"{what}, .*?(?={what}|$)", said):
        name = next(x for x in (*LIMITS, "von_mises max_stress", "gap smallest") if x.split()[0] in text)
        broken = "above the" in text or re.search(r"(?<!not )below the", text)
        found[name] = word_in(text + " BROKEN" * bool(broken))
    assert ("% of max_tension used" in said) == (found["max_tension"] != "not verified")
    assert ("MBR utilisation of" in said) == (found["min_bend_radius"] != "not verified")
    return found


def of_report(result: Result) -> dict[str, str]:
    """By the table of limits in the report, and by what it says of quantities."""
    page = verdict_html(facts_of(result), several=True)
    found = dict(re.findall(r"<tr class=\"[\w-]+\"><td>(\w+)</td><td>([\w ]+)</td>", page))
    if "max_stress" in found:
        found["von_mises max_stress"] = found.pop("max_stress")
    for fact in facts_of(result):
        if fact.key == "quantity" and fact.values["limit"] != "max_stress":
            found[f"{fact.title.lower()} {fact.values['limit']}"] = word_in(fact.text)
    head = re.search(r"<h2>(No warnings; .*?)\.</h2>", page)
    if head is not None and "not verified" in found.values():
        assert "not verified" in head[1]
    return found


def of_study(result: Result) -> dict[str, str]:
    """By the utilisation that a study keeps, of tension and curvature."""
    found = {}
    for quantity, limit in (("tension", "max_tension"), ("curvature", "min_bend_radius")):
        kept = collected(result, {"x": Kept(quantity=quantity, take=("utilisation",))})
        if kept.kept:
            found[limit] = "broken" if float(kept.kept["x"][1]) > 1.0 else "within"
        else:
            found[limit] = word_in(kept.reasons["x"])
    return found


@pytest.mark.long
def test_thirty_results_say_the_same_everywhere(results: dict[tuple[str, str], Path], call: Call) -> None:
    seen: dict[str, int] = {}
    for key, path in results.items():
        with hybrid.open(path) as result:
            verdicts = result.verdicts()
            words = {x: y for x, y in verdicts.words.items() if not x.startswith("accuracy")}
            assert set(LIMITS) <= set(words), key
            assert of_terminal(result) == words, key
            assert of_report(result) == words, key
            assert of_study(result) == {x: words[x] for x in LIMITS[:2]}, key
            assert {x: y.verdict for x, y in result.utilisation().items()} == {x: words[x] for x in LIMITS}, key
            for each in verdicts.accuracy:
                assert each.unit and each.asked is not None and each.asked > 0.0, key
            if verdicts.accuracy:
                met = {"met": True, "missed": False}.get(worst_accuracy(verdicts.accuracy).verdict)
                assert errors_facts(result)["met"] is met, key
                (fact,) = [x for x in facts_of(result) if x.key == "errors"]
                assert fact.text.endswith(f": {accuracy_text(verdicts.accuracy)}."), key
            for x in (*verdicts.limits, *verdicts.quantities):
                assert bool(x.why) == bool(x.remedy) == (x.verdict == "not verified"), key
                assert x.broken == (x.verdict == "broken"), key
            for word in words.values():
                seen[word] = seen.get(word, 0) + 1
        if not RUNS[key[0]][1]:  # of one output there are no statistics
            assert of_stats(path, call) == words, key
    assert min(seen[x] for x in ("within", "broken", "not verified")) > 10, seen


@pytest.mark.long  # 13.0 s
def test_verdicts_of_thirty_results(results: dict[tuple[str, str], Path]) -> None:
    """What each of them may be."""

    def words(name: str, given: str = "far") -> list[str]:
        with hybrid.open(results[name, given]) as result:
            return [result.verdicts().words[x] for x in LIMITS]

    for name in RUNS:
        assert words(name, "broken") == ["broken"] * 3, name
    for name in ("errors", "accuracy", "curvature", "quantity", "at rest, errors"):
        assert words(name) == ["within"] * 3, name
    for name in ("fixed", "zones", "quantity, fixed", "at rest", "at rest, clamped"):
        assert words(name) == ["not verified"] * 3, name
    for name in ("clamped", "catenary"):  # an unresolved layer; a catenary has none
        assert words(name)[0] == "not verified", name
    with hybrid.open(results["quantity", "far"]) as result:
        assert result.verdicts().words["gap smallest"] == "within"
    with hybrid.open(results["missed", "far"]) as result:
        assert "missed" in [x.verdict for x in result.verdicts().accuracy]
        assert all(x.error > x.asked for x in result.verdicts().accuracy if x.verdict == "missed")


# ---- what casts doubts -----------------------------------------------------------------------------


def test_an_accuracy_in_words_says_each_verdict_once() -> None:
    met, missed = (
        Asked("position", "m", 1.0, 0.5, "met"),
        Asked("curvature", "1/m", 1.0, 2.0, "missed", beside="x is so"),
    )
    doubts = [
        Asked(name, "N", 9.0, 3.0, "not verified", "friction neglected", "settle it")
        for name in ("end_force_start", "end_force_end", "tension")
    ]
    found = accuracy_text([met, *doubts, missed])
    several = "force at the start, force at the end and tension not verified: friction neglected; try: settle it"
    assert found == f"position met; {several}; curvature missed; x is so"
    assert accuracy_text([met, met]) == "met"


def test_errors_in_words_have_no_exponent() -> None:
    assert (
        error_words({"error_total_position": 0.01612, "error_total_end_force": 301.2}) == "0.016 m, 300 N at the ends"
    )


def test_doubts_are_kinds_of_events() -> None:
    assert {*DOUBTS, *OF_ACCURACY} <= set(EVENTS_BY_WEIGHT)


def judged(**more: Any) -> Iterator[Any]:
    return iter(reported(allowed=40.0, errors=True, **more).verdicts().limits)


@pytest.mark.parametrize("kind", sorted(DOUBTS))
def test_an_event_that_casts_doubts_leaves_a_limit_open(kind: str) -> None:
    """80 % of the bend is used, by figures with errors; with the event nobody knows."""
    (free,) = judged()
    assert free.verdict == "within" and free.used == pytest.approx(0.8) and free.margin == pytest.approx(0.2)
    text = "moment and tangent at ends.end: no" if kind == "ignored" else "it is so"
    (found,) = judged(events=[(2.0, 50.0, 50.0, kind, text)])
    which = DOUBTS[kind][0]
    if which and "curvature" not in which:
        assert found == free
        return
    assert found.verdict == "not verified" and kind in found.why and found.remedy and found.used is None
    assert np.isnan(found.margin)


@pytest.mark.parametrize("kind", sorted({**DOUBTS, **OF_ACCURACY}))
def test_no_accuracy_is_met_of_what_an_event_makes_doubtful(kind: str) -> None:
    """Of each quantity asked that the event is of, and of no other; said alike in Python, terminal and report."""
    text = "moment and tangent at ends.end: no" if kind == "ignored" else "it is so"
    for name in ("position", "tension", "end_force_end", "curvature"):
        result = reported(errors=True, rod=True, asked=name, events=[(8.0, 50.0, 50.0, kind, text)])
        (found,) = result.verdicts().accuracy
        which = {**DOUBTS, **OF_ACCURACY}[kind][0]
        doubted = not which or name.removesuffix("_end") in which
        assert found.verdict == ("not verified" if doubted else "met"), (name, found)
        assert errors_facts(result)["met"] is (None if doubted else True)
        assert (kind in found.why) == bool(found.remedy) == doubted
        (fact,) = [x for x in facts_of(result) if x.key == "errors"]
        assert fact.text.endswith(f": {found.text}.")


def test_no_accuracy_is_met_of_what_nobody_estimated() -> None:
    """The bending moment has no error here, curvature one that does not converge; a file that does not say of what."""
    (found,) = reported(errors=True, asked="position,bending_moment").verdicts().accuracy
    assert found.verdict == "not verified" and found.why == "the error of bending moment is not estimated"
    (found,) = reported(errors=True, asked="curvature", not_converged="curvature").verdicts().accuracy
    assert found.verdict == "not verified" and "does not converge" in found.why
    (found,) = reported(errors=True, asked="position", not_converged="curvature").verdicts().accuracy
    assert found.verdict == "met"
    jumps = [(2.0, 50.0, 50.0, "snap", "it is so")]
    (found,) = reported(errors=True, asked=",", events=jumps).verdicts().accuracy
    assert found.verdict == "not verified" and "snap" in found.why


def test_what_bends_where_no_radius_is_allowed_casts_no_doubt() -> None:
    """The limit holds from 45 m on."""
    kind = "bending at clamp neglected"
    (there,) = judged(events=[(0.0, 100.0, 100.0, kind, "it is so")])
    (elsewhere,) = judged(events=[(0.0, 0.0, 0.0, kind, "it is so")])
    assert (there.verdict, elsewhere.verdict) == ("not verified", "within")
    assert there.why == f"{kind} at s = 100 m" and "force_rod" in there.remedy


def test_a_kink_that_counts_as_a_bend_may_be_what_breaks_a_limit() -> None:
    """Of 60 m that are allowed 50 are reached: too sharp by the kink of a joint, or of what else is doubtful broken."""
    counts, plain = ((2.0, 0.0, 100.0, "kink at joint", text) for text in ("it counts as a bend", "it is so"))
    (found,) = reported(allowed=60.0, errors=True, events=[counts]).verdicts().limits
    assert found.verdict == "not verified" and found.why == "kink at joint" and "model: rod" in found.remedy
    assert not found.broken and found.text == "bend radius of 50 m, 60 m allowed at least (min_bend_radius)"
    later = (3.0, *counts[1:])  # than what is reached, at 2.5 s
    for events in ([later], [plain], [(2.0, 0.0, 100.0, "unresolved bend", "it counts as a bend")], []):
        (found,) = reported(allowed=60.0, errors=True, events=events).verdicts().limits
        assert found.verdict == "broken" and found.broken


def test_a_motion_that_goes_on_in_space_is_no_doubt() -> None:
    (found,) = judged(events=[(2.0, 50.0, 50.0, "out of plane", "a push has grown; it goes on in space")])
    assert found.verdict == "within"


def test_a_run_that_is_not_complete_has_no_verdict() -> None:
    (found,) = judged(status="interrupted", message="by hand")
    assert (
        found.verdict == "not verified" and "has not come to its end" in found.why and found.remedy == "hybrid resume"
    )


def test_an_error_that_does_not_converge_is_no_error() -> None:
    (found,) = judged(not_converged="curvature")
    assert found.verdict == "not verified" and "does not converge" in found.why


def test_a_value_that_its_error_may_take_beyond_its_limit() -> None:
    """A bend of 1/50 m with an error of some 1e-4 1/m, where 49.9 m are allowed."""
    (found,) = reported(allowed=49.9, errors=True).verdicts().limits
    assert found.verdict == "not verified" and "with its error curvature may pass the limit" in found.why
    (broken,) = reported(allowed=50.1, errors=True).verdicts().limits
    assert broken.verdict == "broken" and broken.used == pytest.approx(50.1 / 50.0)


def test_doubts_of_several_quantities() -> None:
    result = reported(errors=True, events=[(1.0, 50.0, 50.0, "snap", "tension jumps")])
    assert doubt_of(result, "curvature") is None
    doubt = doubt_of(result, "curvature", "tension")
    assert doubt is not None and doubt.text == "not verified: snap at s = 50 m; try: give axial_stiffness"


# Rules of verdicts against numbers and lists that stand here, not against the tables that are tested.


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
        super().__init__({"envelope/s": np.array([0.0, 10.0]), "envelope/curvature_max": np.zeros(2)} | values)
        self.attributes, self.lines, self.line_name = attributes, {x: Made({}, **attributes) for x in lines}, ""
        self.times, self.s = np.arange(3.0 if moves else 1.0), np.array([0.0, 10.0])
        self.events: list[Event] = []
        self.status, self.pending, self.zones = "complete", "", []
        self.position = np.zeros((1, 2, 3))

    def both_sides(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        return self.s, np.asarray(self[name])


def judged_so(monkeypatch: pytest.MonkeyPatch, held: Held, made: Made) -> Held:
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
    assert judged_so(monkeypatch, gap(1.0 + left), made).verdict == verdict


@pytest.mark.parametrize(("figures", "verdict"), [
    ({"gap smallest": 0.2}, WITHIN), ({"gap smallest": 0.31}, OPEN), ({"gap largest": 0.0}, OPEN), ({}, OPEN),
])  # fmt: skip
def test_a_quantity_has_the_error_of_its_own_extreme(
    monkeypatch: pytest.MonkeyPatch, figures: dict[str, float], verdict: str
) -> None:
    """0.3 m are left; the error of positions at outputs, 0.05 m, is not that of steps between."""
    made = Made({"gap_at": 1}, moves=True, error_total_position=0.05, accuracy_extremes=json.dumps(figures))
    assert judged_so(monkeypatch, gap(1.3), made).verdict == verdict


def test_the_remedy_of_an_error_that_is_lacking_is_none_that_the_scene_has(monkeypatch: pytest.MonkeyPatch) -> None:
    """Errors of all lines count; where some extremes have theirs, an accuracy was asked, and another run shows more."""
    made = Made({"gap_at": 1}, ["a"], moves=True, error_total_position=0.05)
    assert "accuracy: 5%" in judged_so(monkeypatch, gap(1.3), made).remedy
    made.lines["a"].attributes["accuracy_extremes"] = json.dumps({"drift largest": 0.1})
    found = judged_so(monkeypatch, gap(1.3), made)
    assert found.verdict == OPEN and "half the time.step" in found.remedy
    made.lines["a"].attributes["accuracy_extremes"] = json.dumps({"gap smallest": 0.1})
    assert judged_so(monkeypatch, gap(1.3), made).verdict == WITHIN


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
    assert judged_so(monkeypatch, held, Made(values)).verdict == verdict
    moving = Made(values, moves=True, accuracy_extremes=json.dumps({"max_stress": 0.2}))
    assert judged_so(monkeypatch, held, moving).verdict == OPEN  # over all steps 110 % may be used


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
    assert judged_so(monkeypatch, held, made).verdict == verdict


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
    assert judged_so(monkeypatch, held, made).verdict == verdict


# --- at rest: what output points do not show -------------------------------------------------------


def at_rest(points, length, span, cells, quantities=None, model="rod", **section):
    given = {"length": length, "mass": 10, "diameter": 0.05, "axial_stiffness": 1e7, "bending_stiffness": 200} | section
    output = {"errors": True, "points": points, "quantities": quantities or {}}
    ends = pinned_at(0, 0, 0), pinned_at(span, 0, 0)
    return hybrid.static(cable_scene(given, *ends, model=model, mesh=cells, output=output))


@pytest.mark.parametrize("points", [101, 2, [0, 10, 30]])
def test_stress_at_rest_is_judged_at_nodes(points):
    area, inertia = np.pi / 4 * (0.05**2 - 0.04**2), np.pi / 64 * (0.05**4 - 0.04**4)
    pipe = {"wall": 0.005, "modulus": 2e11, "max_stress": 1.7265e8}  # 1.744e8 Pa at the middle
    given = {"pipe": pipe, "axial_stiffness": 2e11 * area, "bending_stiffness": 2e11 * inertia}
    (found,) = at_rest(points, 30, 29, 10, **given).verdicts().quantities
    assert found.verdict == "broken" and found.value == pytest.approx(1.7428e8, rel=1e-3) and found.s == 15.0


@pytest.mark.parametrize("points", [101, 2, [0, 33, 100]])
def test_errors_of_places_that_outputs_do_not_show(points):
    bend = at_rest(points, 100, 70, 10, min_bend_radius=23.21)  # 23.097 m on 400 cells, 23.41 on 10
    assert bend.verdicts().words["min_bend_radius"] == "not verified"
    both = at_rest(points, 100, 70, 10, capacity=[[1e5, 0], [0, 0.0455]])
    assert both.verdicts().words["capacity_used capacity"] == "not verified"


@pytest.mark.parametrize(("cells", "points"), [(9, 2), (9, 3), (15, 101), (25, 101)])
def test_clearances_at_rest_are_those_of_chords(cells, points):
    below = {"below": {"kind": "clearance", "point": [35, 0, -50], "smallest": 18.0}}  # 17.980 m on 400 cells
    (found,) = at_rest(points, 100, 70, cells, below, "catenary").verdicts().quantities
    assert found.value > 18.0 and found.verdict == "not verified"


def test_errors_of_another_line_say_nothing():
    section = {"mass": 10, "diameter": 0.05, "axial_stiffness": 1e6}
    points = {
        "a": {"position": [0, 0, 0]}, "b": {"position": [60, 0, 0]}, "k": {"initial_guess": [20, 0, -10], "mass": 100},
    }  # fmt: skip
    lines = {
        "short": line_between("a", "k", section | {"length": 30}, model="catenary", mesh=2),
        "long": line_between("k", "b", section | {"length": 50}, model="catenary", mesh=40),
    }
    pull = {"kind": "vertical_force", "line": "short", "end": "start", "smallest": -4650}  # -4653.2 N on 80 cells
    output = {"errors": True, "points": 11, "quantities": {"pull": pull}}
    result = hybrid.static(network_scene(points, lines, output=output))
    assert "no error figure" in {event.kind for event in result.events}
    (found,) = result.verdicts().quantities
    assert found.verdict == "not verified"
