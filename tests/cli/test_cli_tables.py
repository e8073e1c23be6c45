"""Rows of the closing tables: what stands beside the error of the bending moment."""

import numpy as np
import pytest
from rich.table import Table

import hybrid
from hybrid.cli import statistics_commands
from hybrid.cli.console import Console, Grid
from hybrid.cli.tables import _largest_moment
from hybrid.linear.response_results import ADDED, LineResponse, Response

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
