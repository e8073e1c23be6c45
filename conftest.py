"""How tests run: in two processes (pytest-xdist), with kernels that are compiled once.

Before the two processes start, the kernels are compiled if they are not yet, one half in each of two others
(tests/compile_kernels.py).  What times something (-m bench), shows figures (-s) or writes a page of the manual runs in
one process.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

# Python keeps what it compiles of the package and of tests, also where the user asks it not to: some hundred processes
# are started, and reading the sources takes each of them a second.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config: pytest.Config) -> None:
    option = config.option
    alone = option.capture == "no" or "bench" in option.markexpr.replace("not bench", "")
    writes = getattr(option, "write_validation", False) or getattr(option, "write_extremes", False)
    if alone or writes or option.collectonly:
        option.numprocesses, option.dist, option.tx = 0, "no", []


def pytest_sessionstart(session: pytest.Session) -> None:
    if getattr(session.config.option, "numprocesses", 0) and not hasattr(session.config, "workerinput"):
        script = Path(__file__).parent / "tests" / "compile_kernels.py"
        commands = [[sys.executable, str(script), half, "tests"] for half in ("plane", "space")]
        for process in [subprocess.Popen(command, stdout=subprocess.DEVNULL) for command in commands]:
            process.wait()  # what fails here fails again, with words, in a test


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """What needs a package of an extra that is not installed skips before its fixtures are made."""
    from extras import skip_without

    for mark in item.iter_markers("needs"):
        skip_without(*mark.args)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files beside the folders first: they run pages and examples, and what takes a minute is not left to the end."""
    tests = Path(__file__).parent / "tests"
    items.sort(key=lambda item: item.path.parent != tests)
