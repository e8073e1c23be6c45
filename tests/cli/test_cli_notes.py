"""What is said at the end of a run: little, the worst first, and nothing that hides it."""

from __future__ import annotations

import ast
import json
import random
import re
from pathlib import Path

import numpy as np
import pytest
from rich.table import Table

import hybrid
from hybrid.cli import statistics_commands
from hybrid.cli.console import KINDS_SHOWN, Console, Grid
from hybrid.cli.tables import _largest_moment, equilibrium_facts, errors_facts, errors_table
from hybrid.errors import EVENTS_BY_WEIGHT, EXPECTED, OF_THE_RUN, ZONE_EVENTS, Outcome
from hybrid.linear.response_results import ADDED, LineResponse, Response
from hybrid.store.records import Event
from hybrid.view.summary import facts_of
from tests.scenes import cable_scene, pinned_at

PACKAGE = Path(hybrid.__file__).parent
# Calls that write an event take its kind as a text among their arguments.
WRITERS = ("event", "note", "append")
EXAMPLES = sorted((PACKAGE.parent / "examples").glob("*.yaml"))


def lines_of(events: list[Event], capsys: pytest.CaptureFixture[str]) -> list[str]:
    capsys.readouterr()
    Console(False, False).events(events)
    return capsys.readouterr().err.splitlines()


def test_json_has_no_numbers_that_are_not_finite(capsys: pytest.CaptureFixture[str]) -> None:
    Console(True, False).json("done", radius=float("inf"), rows=[{"x": float("nan"), "y": 1.0}])
    assert json.loads(capsys.readouterr().out) == {"event": "done", "radius": None, "rows": [{"x": None, "y": 1.0}]}


def test_few_lines_and_the_worst_first(capsys: pytest.CaptureFixture[str]) -> None:
    kinds = [*EVENTS_BY_WEIGHT, *ZONE_EVENTS, "news"]
    events = [Event(float(t), 0.0, 1.0, kind, f"text of {kind}") for t, kind in enumerate(kinds)] * 3
    random.Random(1).shuffle(events)
    said = lines_of(events, capsys)
    assert len(said) == KINDS_SHOWN + 1
    for line, kind in zip(said[:-1], EVENTS_BY_WEIGHT, strict=False):
        assert line == f"note: t = {kinds.index(kind):g} s: text of {kind} (2 more like this)"
    left = len(EVENTS_BY_WEIGHT) + 1 - KINDS_SHOWN
    assert said[-1].startswith(f"note: and {left} more: {EVENTS_BY_WEIGHT[KINDS_SHOWN]}, ")
    assert said[-1].endswith("news; see the events of the result")


def test_changes_of_zones_take_no_line_from_others(capsys: pytest.CaptureFixture[str]) -> None:
    zones = [Event(0.0, 0.0, 1.0, kind, kind) for kind in ZONE_EVENTS]
    said = lines_of([*zones, Event(5.0, 0.0, 1.0, "news", "something new")], capsys)
    assert said == ["note: t = 5 s: something new"]
    assert lines_of(zones, capsys) == []


def test_an_event_that_repeats_is_said_once(capsys: pytest.CaptureFixture[str]) -> None:
    said = lines_of([Event(0.1 * k, 0.0, 1.0, "slack", "no tension") for k in range(10_000)], capsys)
    assert said == ["note: t = 0 s: no tension (9999 more like this)"]


def test_what_holds_for_the_whole_run_has_no_time(capsys: pytest.CaptureFixture[str]) -> None:
    """ "t = 0 s" reads as "at the start": only what happens there has it."""
    assert lines_of([Event(0.0, 0.0, 1.0, "not converged", "curvature")], capsys) == ["note: curvature"]
    assert lines_of([Event(0.0, 0.0, 1.0, "slack", "no tension")], capsys) == ["note: t = 0 s: no tension"]
    assert lines_of([Event(3.0, 0.0, 1.0, "torque neglected", "a")], capsys) == ["note: t = 3 s: a"]


def test_of_the_run_are_kinds_that_there_are() -> None:
    assert set(EVENTS_BY_WEIGHT) >= OF_THE_RUN - {"model chosen"}


def test_a_slip_of_units_comes_before_what_follows_from_it() -> None:
    order = list(EVENTS_BY_WEIGHT)
    for consequence in ("slack", "unstable", "unresolved bend", "deep in the seabed", "coarse step"):
        assert order.index("implausible") < order.index(consequence)
    assert order[0] == "gains energy"  # then nothing else counts


def test_every_kind_of_event_that_doubts_an_answer_has_a_weight() -> None:
    known = {*EVENTS_BY_WEIGHT, *EXPECTED, *(outcome.name.lower() for outcome in Outcome)}
    found = set()
    for file in (f for f in PACKAGE.rglob("*.py") if f.relative_to(PACKAGE).parts[0] != "cli"):  # whose notes are lines
        text = file.read_text(encoding="utf-8")
        for call in ast.walk(ast.parse(text)) if re.search(r"\.event\(|\.note\(|_notes", text) else ():
            if not (isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute) and call.func.attr in WRITERS):
                continue
            notes = isinstance(call.func.value, ast.Attribute) and call.func.value.attr == "_notes"
            if call.func.attr == "append" and not notes:
                continue
            inside = call.args[0].elts[:1] if notes and isinstance(call.args[0], ast.Tuple) else call.args
            found |= {a.value for a in inside if isinstance(a, ast.Constant) and isinstance(a.value, str)}
    assert len(found) > 15, "the calls that write events are called otherwise now"
    assert found <= known, found - known


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_says_at_most_two_things(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What its beginning says; the whole runs are in tests/test_examples.py, with their events."""
    scene = hybrid.load_scene(path)
    step = scene.require_time().step
    short = [f"time.duration={40 * step}", f"output.every={10 * step}"]
    said = lines_of(hybrid.run(hybrid.load_scene(path, short)).events, capsys)
    assert len(said) <= 2
    assert all(len(line) < 250 for line in said)


# Rows of the closing tables: what stands beside the error of the bending moment.


CABLE = {"sections": [{"length": 2.2, "mass": 1.0, "axial_stiffness": 1e5, "bending_stiffness": 0.5}]}
ENDS = {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": {"kind": "pinned", "position": [2, 0, 0]}}


def test_a_rod_is_not_told_to_be_a_rod() -> None:
    scene = {"cable": CABLE, "ends": ENDS, "initial": "equilibrium", "mesh": {"cells": 10}}
    rod, catenary = (hybrid.static({**scene, "model": model}) for model in ("rod", "catenary"))
    largest = float(rod.bending_moment.max())
    assert _largest_moment(rod) == f"of {largest:.2g} N m"
    assert "`model: rod`" in _largest_moment(catenary)


class Lacking:
    """A result of rods without the moment among its outputs."""

    def __init__(self, result: hybrid.Result) -> None:
        self.zones = result.zones

    def __contains__(self, name: str) -> bool:
        return False


def test_a_rod_without_that_output_says_so() -> None:
    result = hybrid.static(
        {"cable": CABLE, "ends": ENDS, "initial": "equilibrium", "model": "rod", "mesh": {"cells": 10}}
    )
    said = _largest_moment(Lacking(result))  # type: ignore[arg-type]
    assert said == "the moment is not among the outputs"


def test_lines_of_tables_end_without_blanks(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those that rich wraps too, whose cells it fills up, and tables of its own."""
    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("name")
    table.add_column("value")
    table.add_row("a", "1")
    table.add_row("b", "")
    monkeypatch.setenv("COLUMNS", "40")
    for content in (Grid([("short", "a text that has to be wrapped here", "x"), ("name", "y", "")], "below"), table):
        Console(False, False).show(lambda content=content: content)
        lines = capsys.readouterr().out.splitlines()
        assert len(lines) >= 3 and lines == [x.rstrip() for x in lines]


def test_rows_of_a_response_that_is_not_valid_are_marked() -> None:
    """A curvature that is not known, or that a note speaks against, stood unmarked beside valid tensions."""
    s, f = np.linspace(0.0, 10.0, 5), np.array([0.1])
    amplitudes = np.outer(f, np.ones(5))
    line = LineResponse(
        s, s[:-1], f, amplitudes[:, :, None] * np.ones(3), 10.0 * amplitudes[:, :-1], amplitudes, 0.0 * amplitudes,
        np.zeros((5, 3)), np.ones(4), np.ones(5), {"curvature": np.full(5, 2.0 * ADDED["curvature"])}, np.ones(5),
    )  # fmt: skip
    for notes, valid in (((), {"tension", "x", "y", "z"}), (("tension at s = 5 m: not valid",), {"x", "y", "z"})):
        rows = statistics_commands._rows(Response("", {"cable": line}, {}, {}, 1, {}, notes), 3.0)
        assert {row["quantity"] for row in rows if row["valid"]} == valid
        shown = statistics_commands._response_table(Response("", {"cable": line}, {}, {}, 1, {}, notes), rows, 3.0)
        assert "curvature, not valid" in [*shown.columns[0].cells] and ("x" in [*shown.columns[0].cells])


def test_output_points_without_the_ends():
    """The last of them was taken for the fairlead, and its arc length for that of the line."""
    section = {"length": 250, "mass": 20, "diameter": 0.05, "axial_stiffness": 2e8}
    bed, ends = {"z": -100, "stiffness": 5e3}, (pinned_at(0, 0, -100), pinned_at(205, 0, 0))
    part, whole = (
        hybrid.static(cable_scene(section, *ends, fluid={"density": 1025}, seabed=bed, model="catenary", mesh=10,
                                  output={"points": [10, 50, 80, *more], "errors": True}))
        for more in ([], [250])
    )  # fmt: skip
    assert "end" not in equilibrium_facts(part).get("uplift", {}) and "±" in tension_of(whole)
    assert "±" not in tension_of(part)
    share = float(errors_facts(part)["total_position"]) / 2.5
    assert f"{share:.2g} % of the length" in str(errors_table(errors_facts(part), part).rows)


def tension_of(result):
    return next(x.text for x in facts_of(result) if x.key == "tension")
