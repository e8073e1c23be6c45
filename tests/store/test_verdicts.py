"""Verdicts: terminal, `stats`, report, study and Python say the same, and never of what nobody knows."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reported import reported

import hybrid
from hybrid.cli.commands import main
from hybrid.cli.tables import errors_facts, extremes_facts, extremes_rows
from hybrid.errors import EVENTS_BY_WEIGHT
from hybrid.scene.study import Kept
from hybrid.store.reader import Result
from hybrid.store.records import error_words
from hybrid.store.verdicts import DOUBTS, OF_ACCURACY, Asked, accuracy_text, doubt_of, worst_accuracy
from hybrid.studies.workers import collected
from hybrid.view.report_parts import verdict_html
from hybrid.view.summary import facts_of
from tests.scenes import cable_scene, pinned_at

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


def of_stats(path: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, str]:
    """By the lines of `hybrid stats`."""
    capsys.readouterr()
    with pytest.raises(SystemExit) as ended:
        main(["stats", str(path), "--names", "tension"])
    assert not ended.value.code
    said, found = " ".join(capsys.readouterr().out.split()), {}
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
def test_thirty_results_say_the_same_everywhere(
    results: dict[tuple[str, str], Path], capsys: pytest.CaptureFixture[str]
) -> None:
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
            assert of_stats(path, capsys) == words, key
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
