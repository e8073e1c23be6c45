"""How tests run: in two processes (pytest-xdist), while two others compile the kernels that most tests call.

Tests that call few kernels come first.  The others wait until tests/compile_kernels.py has compiled its list, one half
in each process; what is not in it the tests compile.  Where files are named nothing is compiled beforehand.  What times
something (-m bench), shows figures (-s) or writes a page of the manual runs in one process.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Generator
from pathlib import Path
from threading import Thread

import pytest

TESTS = Path(__file__).parent / "tests"
FEW_KERNELS = ("scene", "store", "view", "statistics", "interop", "cli", "exports", "live")
# Of the environment: a folder with a file for each process that compiles.
COMPILING = "HYBRID_TEST_COMPILING"
STARTED = pytest.StashKey[list[subprocess.Popen[bytes]]]()

# Python keeps what it compiles of the package and of tests, also where the user asks it not to: some hundred processes
# are started, and reading the sources takes each of them a second.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
# Each process has a core of its own at best: threads of linear algebra would wait for each other, at full load.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config: pytest.Config) -> None:
    option = config.option
    alone = option.capture == "no" or "bench" in option.markexpr.replace("not bench", "")
    writes = getattr(option, "write_validation", False) or getattr(option, "write_extremes", False)
    if alone or writes or option.collectonly:
        option.numprocesses, option.dist, option.tx = 0, "no", []


@pytest.hookimpl(tryfirst=True)  # before xdist starts its processes, which are told the folder
def pytest_sessionstart(session: pytest.Session) -> None:
    config = session.config
    whole = config.args_source is pytest.Config.ArgsSource.TESTPATHS
    if whole and getattr(config.option, "numprocesses", 0) and not hasattr(config, "workerinput"):
        folder = Path(tempfile.mkdtemp(prefix="hybrid-compiling-"))
        os.environ[COMPILING] = str(folder)
        config.stash[STARTED] = [_compile(half, folder / half) for half in ("solvers", "rest")]


def _compile(half: str, marker: Path) -> subprocess.Popen[bytes]:
    """Start to compile half of the kernels; the marker is there until that is over, whatever becomes of it."""
    script = TESTS / "compile_kernels.py"
    process = subprocess.Popen([sys.executable, str(script), half, "tests"], stdout=subprocess.DEVNULL)
    marker.touch()

    def wait() -> None:
        process.wait()  # what fails here fails again, with words, in a test
        marker.unlink(missing_ok=True)

    Thread(target=wait, daemon=True).start()
    return process


def pytest_sessionfinish(session: pytest.Session) -> None:
    started = session.config.stash.get(STARTED, [])
    for process in started:
        process.terminate()  # a session that is stopped does not wait for them
    if started:
        shutil.rmtree(os.environ.pop(COMPILING), ignore_errors=True)


@pytest.hookimpl(wrapper=True, tryfirst=True)  # around the time within which a test has to end
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    folder = os.environ.get(COMPILING)
    while folder and not _has_few_kernels(item) and any(Path(folder).iterdir()):
        time.sleep(0.2)
    return (yield)


def _has_few_kernels(item: pytest.Item) -> bool:
    return any(item.path.is_relative_to(TESTS / room) for room in FEW_KERNELS)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """What needs a package of an extra that is not installed skips before its fixtures are made."""
    from extras import skip_without

    for mark in item.iter_markers("needs"):
        skip_without(*mark.args)


@pytest.hookimpl(trylast=True)  # of what is left by then
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Files with few kernels first, then those beside the folders: they run pages and examples, which take long.

    xdist gives each process a stretch of the list to begin with: each has its share of both.
    """
    first = [item for item in items if _has_few_kernels(item)]
    rest = sorted((item for item in items if not _has_few_kernels(item)), key=lambda item: item.path.parent != TESTS)
    shares = getattr(config, "workerinput", {}).get("workercount", 1)
    items[:] = [
        item
        for k in range(shares)
        for part in (first, rest)
        for item in part[k * len(part) // shares : (k + 1) * len(part) // shares]
    ]
