"""A disk that is full: what was written until then stays, the process ends in order, and the file can be resumed.

As full as a limit of the file's size makes it (RLIMIT_FSIZE), each in a process of its own: HDF5 2.0 ends a process that
could not write a file, with SIGSEGV, when it is closed or let go of.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import hybrid
from hybrid.store.checkpoint import read_checkpoint
from hybrid.store.hdf5_file import opened
from hybrid.store.reader import open_result

WRITER = """
import resource, sys
sys.path[:0] = [{here!r}]
resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))
from hybrid.errors import ResultError
from hybrid.store.writer import WriteMode
from test_result_file import ONE, TWO, recorder, values
kept = []  # nothing is let go of before the end
try:
    with recorder({path!r}, mode=WriteMode({{}})) as r:
        kept.append(r)
        for i in range(4000):
            r.log({{"t": float(i), "residual": 0.0, "dt": 1.0, "iterations": 1}})
            r.save(float(i), values(float(i)), ONE if i % 4 < 2 else TWO)
            if i % 20 == 19:
                r.checkpoint(lambda: {{"program": "", "asks": False, "resolution": {{}}, "state": {{}}}})
                r.flush()
except ResultError as error:
    print(error)
"""


# bytes: before the file is made, while it is made, at its first outputs, later ones
@pytest.mark.parametrize("limit", [0, 20_000, 60_000, 240_000, 300_000, 412_345, 777_777])
@pytest.mark.long  # 3 s of 7 cases
def test_what_was_written_stays(limit: int, tmp_path: Path) -> None:
    path, here = tmp_path / "run.h5", Path(__file__).parent
    code = WRITER.format(here=str(here), limit=limit, path=str(path))
    env = os.environ | {"PYTHONPATH": str(Path(hybrid.__file__).parents[1]), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=env)
    assert (done.returncode, done.stderr) == (0, ""), done.stderr[-2000:]
    assert str(path) in done.stdout and "cannot be written" in done.stdout and "free" in done.stdout
    assert {x.name for x in tmp_path.iterdir()} <= {"run.h5"}, "something is left behind"
    assert path.exists() == (limit > 50_000), "a file that could not be made must not appear"
    if not path.exists():
        return
    assert path.stat().st_size <= limit
    result = open_result(path)
    t = result.times
    assert (t == range(len(t))).all() and (result.tension[:, 0] == 10.0 * t).all()
    assert len(result["steps/t"]) >= len(t) and result.status == "running"
    if len(t):  # and then it has a checkpoint of these very rows
        with opened(path) as file:
            assert read_checkpoint(file).rows["t"] == len(t)


LATE = """
import os, resource, sys
sys.path[:0] = [{here!r}]
from hybrid.errors import ResultError
from hybrid.store.writer import WriteMode
from test_result_file import ONE, recorder, values
def write():
    with recorder({path!r}, mode=WriteMode({{}}, late=True), overwrite=True) as r:
        for i in range(1000):
            r.save(float(i), values(float(i)), ONE)
write()
size = os.path.getsize({path!r})
before = open({path!r}, "rb").read()
for limit in (0, 20_000, size // 2, size - 10):  # while it is made, in its outputs, in the sum behind its end
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, -1))
    try:
        write()
    except ResultError as error:
        print(error)
    assert open({path!r}, "rb").read() == before, limit
    assert os.listdir(os.path.dirname({path!r})) == ["run.h5"], limit
"""


def test_a_late_file_that_cannot_be_written_does_not_appear(tmp_path: Path) -> None:
    """And what was there before stays."""
    path, here = tmp_path / "run.h5", Path(__file__).parent
    env = os.environ | {"PYTHONPATH": str(Path(hybrid.__file__).parents[1]), "PYTHONDONTWRITEBYTECODE": "1"}
    code = LATE.format(here=str(here), path=str(path))
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=env)
    assert (done.returncode, done.stderr) == (0, ""), done.stderr[-2000:]
    assert done.stdout.count(f"{path} cannot be written") == 4 and "free" in done.stdout
    assert open_result(path).status == "complete"


LINES = """
import resource, sys
sys.path[:0] = [{here!r}]
from hybrid.errors import ResultError
from test_result_file import GIVEN, ONE, recorder, values
from hybrid.store.recorder import Rows
parts = {{name: Rows(GIVEN) for name in ("a", "b", "c")}}
resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))
kept = []  # nothing is let go of before the end
try:
    with recorder({path!r}, parts=parts) as r:
        kept.append(r)
        for i in range(4000):
            for x in (*parts.values(), r):
                x.save(float(i), values(float(i)), ONE)
            if i % 20 == 19:
                r.flush()
except ResultError as error:
    print(error)
"""


@pytest.mark.parametrize("limit", [531_782, 1_289_002])
def test_what_was_written_of_several_lines_stays(limit: int, tmp_path: Path) -> None:
    """Lines have all outputs that their system has, with their numbers."""
    path, here = tmp_path / "run.h5", Path(__file__).parent
    code = LINES.format(here=str(here), limit=limit, path=str(path))
    env = os.environ | {"PYTHONPATH": str(Path(hybrid.__file__).parents[1]), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=env)
    assert (done.returncode, done.stderr) == (0, ""), done.stderr[-2000:]
    assert str(path) in done.stdout and "cannot be written" in done.stdout and "free" in done.stdout
    result = open_result(path)
    for line in result.lines.values():
        t = line.times
        assert len(t) >= len(result.times) and (t == range(len(t))).all() and (line.tension[:, 0] == 10.0 * t).all()
    assert bool(len(result.times)) == (limit > 1_000_000)
