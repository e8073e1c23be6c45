"""A disk that is full: what was written until then stays, the process ends in order, and the file can be resumed.

As full as a limit of the file's size makes it (RLIMIT_FSIZE), each in a process of its own: HDF5 2.0 ends a process that
could not write a file, with SIGSEGV, when it is closed or let go of.
"""

from __future__ import annotations

import io
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import hybrid
from hybrid.simulation import run as run_module
from hybrid.simulation.run_line import RunLine
from hybrid.store import hdf5_file, writer
from hybrid.store import whole_file as store
from hybrid.store.format import Field, Header, MemoryTarget
from hybrid.store.hdf5_file import opened
from hybrid.store.reader import open_result
from hybrid.store.recorder import Rows
from hybrid.store.whole_file import read_checkpoint
from hybrid.store.writer import Recorder, WriteMode
from tests.inside import calls_of
from tests.scenes import line_between, network_scene

WRITER = """
import resource
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


def said_by(code: str) -> str:
    """What a process of its own prints that runs code, and ends in order."""
    path = os.pathsep.join(map(str, (Path(__file__).parent, Path(hybrid.__file__).parents[1])))
    env = os.environ | {"PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=env)
    assert (done.returncode, done.stderr) == (0, ""), done.stderr[-2000:]
    return done.stdout


# bytes: before the file is made, while it is made, at its first outputs, later ones
@pytest.mark.parametrize("limit", [0, 20_000, 60_000, 240_000, 300_000, 412_345, 777_777])
@pytest.mark.long  # 3 s of 7 cases
def test_what_was_written_stays(limit: int, tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    said = said_by(WRITER.format(limit=limit, path=str(path)))
    assert str(path) in said and "cannot be written" in said and "free" in said
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
import os, resource
from hybrid.errors import ResultError
from hybrid.store.recorder import Rows
from hybrid.store.writer import WriteMode
from test_result_file import GIVEN, ONE, recorder, values
def write():
    parts = {{str(k): Rows(GIVEN) for k in range({lines})}}
    with recorder({path!r}, mode=WriteMode({{}}, late=True), overwrite=True, parts=parts) as r:
        for i in range(1000):
            for x in (*parts.values(), r):
                x.save(float(i), values(float(i)), ONE)
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


@pytest.mark.parametrize("lines", [0, 10])  # which are made in memory, and in the file
def test_a_late_file_that_cannot_be_written_does_not_appear(lines: int, tmp_path: Path) -> None:
    """And what was there before stays."""
    path = tmp_path / "run.h5"
    said = said_by(LATE.format(path=str(path), lines=lines))
    assert said.count(f"{path} cannot be written") == 4 and "free" in said
    assert open_result(path).status == "complete"


LINES = """
import resource
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
    """Lines have all outputs that their network has, with their numbers."""
    path = tmp_path / "run.h5"
    said = said_by(LINES.format(limit=limit, path=str(path)))
    assert str(path) in said and "cannot be written" in said and "free" in said
    result = open_result(path)
    for line in result.lines.values():
        t = line.times
        assert len(t) >= len(result.times) and (t == range(len(t))).all() and (line.tension[:, 0] == 10.0 * t).all()
    assert bool(len(result.times)) == (limit > 1_000_000)


def test_a_file_that_waits_by_pages_is_what_was_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hdf5_file, "_PAGE", 64)
    monkeypatch.setattr(hdf5_file, "_MOST_PAGES", 3)
    random, plain, path = np.random.default_rng(0), io.BytesIO(), tmp_path / "draft"
    with hdf5_file._Draft(path, "w+") as draft:
        for k in range(500):
            at, size = random.integers(0, 2000), int(random.integers(0, 300))
            assert draft.seek(at) == plain.seek(at) and draft.read(size) == plain.read(size)
            assert draft.tell() == plain.tell()
            if at <= len(plain.getvalue()):
                plain.seek(draft.seek(at))
                assert draft.write(data := random.bytes(size)) == plain.write(data)
            if k % 50 == 49:
                assert draft.truncate(int(at)) == plain.truncate(at) or at > plain.seek(0, os.SEEK_END)
                plain.seek(0, os.SEEK_END)
                plain.write(bytes(max(int(at) - plain.tell(), 0)))
            assert draft.seek(0, os.SEEK_END) == plain.seek(0, os.SEEK_END)
        draft.put_all()
        assert path.read_bytes() == plain.getvalue()


# A file begins as one of the same datasets did before, if the process has made one.


FIELDS = (Field("tension", "N", "tension", (5,), ("s",)), Field("energy/kinetic", "J", "kinetic energy"))
HEIGHTS = Field("z", "m", "heights of the current", (2,), ("z",))


def write(path: Path, fields: tuple[Field, ...] = FIELDS, length: float = 2.0) -> None:
    """A result of three outputs, complete when its file is made."""
    s = np.linspace(0.0, length, 5)
    fixed = [(HEIGHTS, np.array([0.0, -length]))]
    header = Header(s, fields, (), {"title": "made up"}, {"scene": "a: 1"}, fixed)
    with Recorder(path, header, mode=WriteMode(late=True)) as recorder:
        for t in (0.0, 1.0, 2.0):
            recorder.save(t, {f.name: t + np.ones(f.shape) for f in fields}, [("rod", 0.0, length)])


def content(path: Path) -> dict[str, tuple[str, list[object], list[tuple[str, str]]]]:
    """Datasets with their labels, values and attributes, but for references, which are places in the file."""
    out = {}
    with h5py.File(path) as file:

        def visit(name: str, item: h5py.Group | h5py.Dataset) -> None:
            attrs = {k: v for k, v in item.attrs.items() if k not in ("created", "REFERENCE_LIST", "DIMENSION_LIST")}
            texts = sorted((k, str(v)) for k, v in attrs.items())
            values = np.asarray(item[()]).tolist() if isinstance(item, h5py.Dataset) else []
            scales = [d[0].name for d in item.dims if len(d)] if isinstance(item, h5py.Dataset) else []
            out[name] = (str(scales), values, texts)

        visit("/", file)
        file.visititems(visit)
    return out


def test_the_second_file_of_the_same_datasets_is_as_the_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And as one whose values HDF5 has written."""
    monkeypatch.setattr(store, "_kept", {})
    made = calls_of(monkeypatch, store.Bare, "create")
    write(tmp_path / "first.h5")
    write(tmp_path / "second.h5")
    assert content(tmp_path / "second.h5") == content(tmp_path / "first.h5") and len(made) == 1
    write(tmp_path / "longer.h5", length=3.0)  # values are no part of it
    assert open_result(tmp_path / "longer.h5").s[-1] == 3.0 and open_result(tmp_path / "longer.h5")["z"][1] == -3.0
    assert len(made) == 1
    write(tmp_path / "other.h5", FIELDS[:1])
    assert len(made) == 2 and "energy/kinetic" not in content(tmp_path / "other.h5")
    monkeypatch.setattr(store, "MOST_PLACED", 0)
    write(tmp_path / "written.h5")
    assert content(tmp_path / "written.h5") == content(tmp_path / "first.h5") and len(made) == 3


# How often a run hands over what it has: by what making and writing it take.


GIVEN = Header(np.zeros(1), (), (), {})


@pytest.fixture(params=["memory", "file"])
def recorder(request: pytest.FixtureRequest, tmp_path: Path, now: list[float]) -> Iterator[Any]:
    target = MemoryTarget() if request.param == "memory" else tmp_path / "x.h5"
    with writer.Recorder(target, GIVEN) as recorder:
        yield recorder


@pytest.fixture
def now(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """A clock that stands still, s."""
    time = [100.0]
    monkeypatch.setattr(writer, "monotonic", lambda: time[0])
    return time


def test_what_is_dear_to_make_waits_ten_times_as_long(recorder: Any, now: list[float]) -> None:
    for made, pause in ((0.0, 0.2), (0.01, 0.2), (1.0, 10.0)):
        recorder.flush(made)
        now[0] += 0.99 * pause
        assert not recorder.due
        now[0] += 0.02 * pause
        assert recorder.due


def test_a_first_file_of_many_lines_waits_ten_times_as_long_as_it_takes(tmp_path: Path, now: list[float]) -> None:
    lines = {str(k): Rows(GIVEN) for k in range(100)}  # of 16 datasets each, 0.2 ms a dataset
    with writer.Recorder(tmp_path / "x.h5", GIVEN, mode=WriteMode(late=True), parts=lines) as recorder:
        now[0] += 3.1
        assert not recorder.due
        now[0] += 0.3
        assert recorder.due


def test_outputs_of_lines_are_made_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whether the clock says so or not: the results are the same.

    The clock is asked between compiled steps: here after five outputs, or all of the run would wait in their buffer.
    """
    monkeypatch.setattr(run_module, "ROWS", 5)
    rope = {"length": 101.0, "mass": 5.0, "diameter": 0.03, "axial_stiffness": 1e6}
    points = {"a": {"position": [0, 0, 0]}, "b": {"position": [100, 0, 0]}}
    points["b"]["motion"] = {"heave": {"amplitude": 0.5, "period": 5.0}, "ramp": 10.0}
    scene = network_scene(points, {"l": line_between("a", "b", rope, mesh=10)}, time=(1.0, 0.05), output=(0.05, 5))
    calls = calls_of(monkeypatch, RunLine, "write_down", lambda line: sum(len(batch.t) for batch in line._waiting))
    found = []
    for pause in (0.0, 100.0):
        monkeypatch.setattr(writer, "pause", lambda _, pause=pause: pause)
        calls.clear()
        with hybrid.run(scene) as result:
            found.append(
                {name: np.array(result.lines["l"][name]) for name in ("position", "tension", "energy/kinetic")}
            )
        assert (max(calls) > 15) == (pause > 0.0)
    for name, x in found[0].items():
        np.testing.assert_array_equal(x, found[1][name])
