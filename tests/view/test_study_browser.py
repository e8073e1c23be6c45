"""The page of a study in a browser: sorts, filters, draws, and asks for nothing from the network."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import extras
import numpy as np
import pytest

pytestmark = extras.of_file("playwright", "dask", "zarr", "xarray")

from test_report_browser import Visit

from hybrid.store.study_file import DONE, FAILED, Column, StudyFile
from hybrid.view.several_runs import write_study_report

CASES = 2000


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of a study of CASES cases, one of which failed with a reason that is no HTML."""
    folder = tmp_path_factory.mktemp("page")
    rng = np.random.default_rng(0)
    height, period = np.repeat([1.0, 2.0, 3.0, 4.0], CASES // 4), np.tile([6.0, 8.0, 10.0, 12.0], CASES // 4)
    columns = {"Hs": Column("m", "key", (), height), "Tp": Column("s", "key", (), period)}
    attributes = {
        "identity": "x",
        "title": "a <b>storm</b>",
        "variables": json.dumps(list(columns)),
        "scene_file": "a.yaml",
    }
    file = StudyFile.create(folder / "s.zarr", columns, CASES, CASES, attributes)
    pull = 1e3 * height + rng.standard_normal(CASES)
    pull[7] = np.nan
    status, reason = np.full(CASES, DONE, "i1"), np.full(CASES, "", object)
    status[7], reason[7] = FAILED, "slack <i>there</i> (t = 3 s)"
    more = {"steps": np.zeros(CASES, "i8"), "cpu": np.ones(CASES), "events": np.full(CASES, "", object)}
    own = {"status": status, "reason": reason} | more
    found = {name: Column("", "", (), values) for name, values in own.items()}
    file.add(0, found | {"pull": Column("N", "largest pull", (), pull)}, {})
    return write_study_report(folder / "s.zarr", folder / "s.html")


def cells(visit: Any, column: int) -> list[str]:
    return visit.page.eval_on_selector_all(
        f"#table tbody tr td:nth-child({column})", "all => all.map(x => x.textContent)"
    )


@pytest.mark.long
def test_a_page_of_2000_cases(browser: Any, page: Path) -> None:
    visit = Visit(browser, page)
    assert visit.complaints == [] and {url.split(":")[0] for url in visit.asked} <= {"file", "data", "blob"}
    assert visit.page.text_content("h1") == "a <b>storm</b>" and visit.page.query_selector("h1 b") is None
    assert "slack <i>there</i>" in visit.page.text_content(".attention")
    # sorting: largest pull first on the second click, numbers by size and not by letters
    visit.page.click("#table th:nth-child(5) button")
    visit.page.click("#table th:nth-child(5) button")
    shown = [float(x) for x in cells(visit, 5)]
    assert len(shown) == 100 and shown == sorted(shown, reverse=True) and shown[0] > 3990.0
    visit.page.fill("#filter", "Hs < 2 and Tp >= 10")
    assert visit.page.text_content("#count") == f"{CASES // 8} of {CASES} cases"
    assert set(cells(visit, 2)) == {"1"} and set(cells(visit, 3)) == {"10", "12"}
    visit.page.fill("#filter", "slack")
    assert cells(visit, 1) == ["7"]
    visit.page.click("#table tbody tr")
    assert visit.page.text_content("#again") == "hybrid study s.zarr --case 7 -o case7.h5"
    visit.page.fill("#filter", "")
    visit.page.click("#more")
    assert len(cells(visit, 1)) == 1100
    for name in ("scatter", "exceedance", "parallel"):
        assert visit.page.query_selector(f"#{name} .main-svg") is not None
    visit.page.select_option("#x", "Tp")
    assert visit.page.evaluate("document.getElementById('scatter').layout.xaxis.title.text") == "Tp (s)"
    visit.context.close()


@pytest.mark.long
def test_a_phone_needs_no_scrolling_aside(browser: Any, page: Path) -> None:
    visit = Visit(browser, page, viewport={"width": 390, "height": 800})
    assert visit.page.evaluate("document.documentElement.scrollWidth") <= 390
    visit.context.close()
