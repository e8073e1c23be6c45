"""docs/evidence/extremes.csv lists every case, and the cases cover what they say they cover."""

from __future__ import annotations

from every import CASES, FAMILIES, PAGE, listed, page, read
from extreme import MODELS


def test_the_page_lists_every_case(pytestconfig):
    if pytestconfig.getoption("--write-extremes"):
        return
    assert set(listed()) == {case.key for case in CASES}, "run: pytest tests/extremes -m 'not bench' --write-extremes"
    text = PAGE.read_text(encoding="utf-8")
    assert f"{len(CASES)} cases" in text and text == page(read()), "the page is that of its table"
    assert "wrong" not in listed().values()


def test_cases_are_many_and_different():
    assert len(CASES) >= 300
    assert len({case.key for case in CASES}) == len(CASES)
    for model in MODELS:
        assert sum(case.model == model for case in CASES) >= 50, model
    assert len(FAMILIES) >= 15
