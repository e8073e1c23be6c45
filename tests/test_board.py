"""The board of bench: its table of references, its page, and that the page's numbers are those that were computed."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from board.__main__ import PROBLEMS
from board.answers import Answer, Problem, references
from board.page import falls_short, page, within
from board.picture import draw
from board.problems import first_harmonic, helix
from numpy import arange, cos, pi

DOCS = Path(__file__).parents[1] / "docs"


def test_every_problem_has_a_statement_and_every_value_a_source() -> None:
    table = references()
    assert set(PROBLEMS) == set(table["problems"])
    for name, problem in table["problems"].items():
        assert problem["title"] and problem["statement"], name
        for quantity, values in problem["quantities"].items():
            known = {*values, *([problem["computed"]] if "computed" in problem else [])}
            assert known and known <= set(table["sources"]), quantity


@pytest.fixture(scope="module")
def solved() -> Problem:
    """A coarse helix."""
    table = references()["problems"]["helix"]
    return Problem("helix", table["title"], table["statement"], table["quantities"], helix("helix", 25))


def test_a_coarse_helix_is_near_the_closed_form(solved: Problem) -> None:
    """Second order: 25 cells are 64 times as far as the 200 of the board."""
    (answer,) = solved.answers
    assert 1e-3 < abs(solved.error(answer, "force, N")) < 0.05
    assert 1e-5 < abs(solved.error(answer, "moment, N m")) < 1e-2
    assert solved.largest_error(answer) == max(abs(solved.error(answer, x)) for x in answer.values)


def test_the_page_has_the_numbers_that_were_computed(solved: Problem, tmp_path: Path) -> None:
    (answer,) = solved.answers
    text = page([solved], "python -m board", "hybrid", "none")
    for name, value in answer.values.items():
        assert f"{value:.5g} ({100 * solved.error(answer, name):+.2f} %)" in text
    other = replace(answer, values={name: 1.1 * value for name, value in answer.values.items()})
    assert f"{other.values['force, N']:.5g}" in page([replace(solved, answers=[other])], "", "", "")
    draw([solved], tmp_path / "board.png")
    assert (tmp_path / "board.png").stat().st_size > 10_000


def test_where_references_disagree_the_page_says_which_is_within_the_error() -> None:
    quantities = {"a": {"one": 1.0, "two": 2.0}, "b": {"one": 1.0, "two": 2.0}}
    found = Problem("", "", "", quantities, [Answer("hybrid", {"a": 1.9, "b": 1.2}, {"a": 0.2, "b": 0.1})])
    assert found.disputed and within(found).endswith("a: two (nearest two); b: none (nearest one).")


def test_the_page_says_where_ours_falls_short() -> None:
    def problem(title: str, *values: float) -> Problem:
        return Problem("", title, "", {"a": {"one": 1.0}}, [Answer("hybrid", {"a": x}) for x in values])

    found = falls_short([problem("Near", 1.1, 1.001), problem("Far", 0.98, 1.03)])
    assert found.endswith("from the first reference: far (2 %).")


def test_a_harmonic_is_that_of_its_signal() -> None:
    t = arange(0.0, 80.01, 0.1)
    force = 3.0 + 2.0 * cos(2 * pi * t / 10.0 + 0.3) + 0.7 * cos(4 * pi * t / 10.0)
    assert first_harmonic(t, force, 10.0, 20.0) == pytest.approx(2.0, rel=1e-9)


def test_the_page_of_the_manual_is_of_this_table() -> None:
    text = (DOCS / "board.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 160 and "`python -m board`" in text
    for problem in references()["problems"].values():
        assert f"## {problem['title']}\n{problem['statement']}\n" in text, "in bench: python -m board"


def test_the_table_of_the_readme_is_on_the_page() -> None:
    """Its errors and CPU times are those of the board."""
    page_text = (DOCS / "board.md").read_text(encoding="utf-8")
    rows = re.findall(
        r"^\| (`hybrid`|\w+), .*\| \d+ \| (.+) \| (.+) \|$",
        (DOCS.parent / "README.md").read_text(encoding="utf-8"),
        re.M,
    )
    assert len(rows) >= 4
    part = page_text.split("## Mooring line in heave", 1)[1].split("\n## ", 1)[0].splitlines()
    for program, errors, cpu in rows:
        said = [f"({float(x):+.2f} %)" for x in errors.split(", ")]
        mine = [x for x in part if x.startswith(f"| {program.strip('`')}") and x.endswith(f" {cpu} |")]
        assert any(all(x in line for x in said) for line in mine), (program, errors, cpu)
