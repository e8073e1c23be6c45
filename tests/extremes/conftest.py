"""Judging extreme cases, and the page that they become: docs/evidence/extremes.md (--write-extremes)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress

import pytest
from every import CASES, listed, rows, write
from extreme import Case, Verdict, check, compute, judge

import hybrid

JUDGED = pytest.StashKey[dict[str, tuple[Case, Verdict]]]()


@pytest.fixture(scope="session", autouse=True)
def warm() -> None:
    """Compile the kernels on a few cases of every model: that is no part of the time a case may take."""
    telling = ("snap loads", "lines in a current", "pressed while straight", "moves to rest")
    first = {(case.family, case.model): case for case in reversed(CASES) if case.family in telling}
    for case in first.values():
        with suppress(hybrid.HybridError):
            compute(case)


@pytest.fixture
def assert_honest(request: pytest.FixtureRequest) -> Callable[[Case], None]:
    """`assert_honest(case)`: it ends as it must, and as docs/evidence/extremes.md says."""
    writes = request.config.getoption("--write-extremes")

    def look(case: Case) -> None:
        verdict = judge(case)
        request.config.stash.setdefault(JUDGED, {})[case.key] = (case, verdict)
        print(
            f"\n{case.key}: {verdict.outcome}, {verdict.what} {verdict.error:.2g} of {verdict.tolerance:.2g}, {verdict.seconds:.2f} s"
        )
        check(case, verdict)
        if not writes and " or " not in case.must:
            assert listed().get(case.key) == verdict.outcome, (
                "run: pytest tests/extremes -m 'not bench' --write-extremes"
            )

    return look


@pytest.hookimpl(hookwrapper=True)
def pytest_sessionfinish(session: pytest.Session) -> Iterator[None]:
    yield
    judged = session.config.stash.get(JUDGED, {})
    if session.config.getoption("--write-extremes") and len(judged) == len(CASES):
        write(rows([judged[case.key] for case in CASES]))
