"""What all tests share: the table of validation figures.

A validation test hands each figure it measures to the fixture `report`; `pytest -s` shows
them as they come.  With

    pytest tests/validation -m "not bench" --write-validation

the figures of that session become docs/evidence/validation.md.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.called import call  # noqa: F401

PAGE = Path(__file__).parents[1] / "docs" / "evidence" / "validation.md"
HEAD = """\
# Validation

Use this page to see how well results agree with exact and published solutions.
Every figure below was measured by the test named beside it, in one session of
`pytest tests/validation -m "not bench" --write-validation`, which wrote this page.  A tolerance is one of three kinds: *round-off*; *discretisation*, an order
and a bound, where an order that is too high fails as well; *published*, the digits printed in the
source.  The problems, their exact solutions and the reasons for the tolerances are in
tests/problems.py.  SI units.

| case | source | figure | acceptance | test |
|---|---|---|---|---|
"""


@dataclass(frozen=True)
class Row:
    """One figure of the table, and the test that measured it."""

    case: str
    source: str
    figure: str
    acceptance: str
    node: str


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """A browser without a screen; tests that ask for it skip where there is none."""
    from browsed import opened_browser

    with opened_browser() as opened:
        yield opened


ROWS = pytest.StashKey[list[Row]]()
MISSED = pytest.StashKey[set[str]]()
Report = Callable[[str, str, str, str], None]

# What pyproject.toml leaves out everywhere.
USUAL = "not slow and not bench"


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--write-validation", action="store_true", help="write the figures to docs/evidence/validation.md")
    parser.addoption("--write-extremes", action="store_true", help="write the cases to docs/evidence/extremes.md")


def pytest_configure(config: pytest.Config) -> None:
    """The whole suite is run without tests of about a second or more; where files or marks are named they are run."""
    config.stash[ROWS], config.stash[MISSED] = [], set()
    if config.args_source is pytest.Config.ArgsSource.TESTPATHS and config.option.markexpr == USUAL:
        config.option.markexpr = f"{USUAL} and not long"  # which worker processes are told


@pytest.fixture
def report(request: pytest.FixtureRequest) -> Report:
    """`report(case, source, figure, acceptance)`: show a figure, and keep it for docs/evidence/validation.md."""

    def keep(case: str, source: str, figure: str, acceptance: str) -> None:
        request.config.stash[ROWS].append(Row(case, source, figure, acceptance, request.node.nodeid))
        print(f"\n{case}: {figure}  [{acceptance}; {source}]")

    return keep


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    outcome = yield
    if not outcome.get_result().passed:  # type: ignore[attr-defined]
        item.config.stash[MISSED].add(item.nodeid)


def pytest_sessionfinish(session: pytest.Session) -> None:
    rows, missed = session.config.stash[ROWS], session.config.stash[MISSED]
    if not (session.config.getoption("--write-validation") and rows):
        return
    text = HEAD
    for row in sorted(rows, key=lambda row: row.node.split("::")[0]):
        figure = row.figure + (" -- **not reached**" if row.node in missed else "")
        test = row.node.removeprefix("tests/validation/")
        text += "| " + " | ".join(x.replace("|", "\\|") for x in (row.case, row.source, figure, row.acceptance))
        text += f" | `{test}` |\n"
    PAGE.write_text(text)
