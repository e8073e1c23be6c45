"""What is written is what is read: layout, units, zones, interruption, refusal."""

from __future__ import annotations

import io
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

import hybrid
from hybrid.accuracy import passes
from hybrid.errors import ResultError
from hybrid.exports.api import export
from hybrid.simulation.case import Case
from hybrid.simulation.cell_changes import CellChanges
from hybrid.simulation.run_line import RunLine
from hybrid.store.envelope import stored_window
from hybrid.store.format import Field, Header
from hybrid.store.hdf5_file import SLOTS, bound_metadata, created, in_memory
from hybrid.store.reader import MARK, Result, open_result
from hybrid.store.recorder import Rows
from hybrid.store.records import OLD_ATTRIBUTES, OLD_EVENTS, OLD_NAMES, Event, Zone
from hybrid.store.writer import Recorder
from tests.scenes import cable_scene, clamped_at, pinned_at

S = np.linspace(0.0, 2.0, 5)
FIELDS = (
    Field("position", "m", "position of the centreline", (5, 3), ("s", "xyz"), "inertial"),
    Field("tension", "N", "axial force", (5,), ("s",)),
    Field("bending_moment", "N m", "magnitude of the bending moment", (5,), ("s",)),
    Field("reaction_start", "N", "force of the support on the start", (3,), ("xyz",), "inertial"),
    Field("energy/kinetic", "J", "kinetic energy"),
    Field("strain", "", "may be unknown", (5,), ("s",), nan_ok=True),
)
STEPS = (
    Field("t", "s", "end of the step"),
    Field("residual", "N", "largest residual", nan_ok=True),
    Field("dt", "s", "length of the step"),
    Field("iterations", "", "Newton iterations", dtype="int64"),
)
ONE = [("catenary", 0.0, 1.5), ("rod", 1.5, 2.0)]
TWO = [("catenary", 0.0, 1.0), ("rod", 1.0, 2.0)]


GIVEN = Header(S, FIELDS, STEPS, {"title": "Tëst", "seed": 7}, {"scene": "title: Tëst\n"})


def recorder(target: object, **more: object) -> Recorder:
    stated = {name: more.pop(name) for name in Header._fields if name in more}
    return Recorder(target, GIVEN._replace(**stated), **more)  # type: ignore[arg-type]


def values(t: float) -> dict[str, np.ndarray]:
    """Linear in t and s, so that linear interpolation is exact up to round-off."""
    return {
        "position": np.stack([S + t, 0 * S, 2.0 * t - 3.0 * S], axis=1),
        "tension": 10.0 * t + S,
        "bending_moment": 0.0 * S + t,
        "reaction_start": np.array([t, 0.0, -t]),
        "energy/kinetic": np.array(4.0 * t),
        "strain": np.full(5, np.nan),
    }


def written(target: object, nt: int = 4, **more: object) -> None:
    with recorder(target, **more) as r:
        for i in range(nt):
            t = 0.5 * i
            r.log({"t": t, "residual": np.inf if i == 1 else 1e-9, "dt": 0.5, "iterations": i})
            if i == 2:
                r.event(t, 1.0, 1.5, "switch", "slack at s = 1.2 m: 5 µN < 10 µN")
            r.save(t, values(t), ONE if i < 2 else TWO)


@pytest.fixture
def result(tmp_path: Path) -> Result:
    written(tmp_path / "run.h5")
    return open_result(tmp_path / "run.h5")


def test_round_trip(result: Result) -> None:
    t = 0.5 * np.arange(4)
    assert np.array_equal(result.times, t) and np.array_equal(result.t, t) and np.array_equal(result.s, S)
    for name in ("position", "tension", "reaction_start", "energy/kinetic", "strain"):
        assert np.array_equal(result[name], np.stack([values(x)[name] for x in t]), equal_nan=True), name
    assert result.moment is result.bending_moment and result.tension.dtype == np.float64
    assert list(result.energy) == ["kinetic"] and np.array_equal(result.energy.kinetic, 4.0 * t)
    assert set(result.steps) == {"t", "residual", "dt", "iterations"}
    assert result.steps["iterations"].tolist() == [0, 1, 2, 3] and result.steps["iterations"].dtype == np.int64
    assert result.events == [Event(1.0, 1.0, 1.5, "switch", "slack at s = 1.2 m: 5 µN < 10 µN")]
    assert result.scene_text == "title: Tëst\n" and result.title == "Tëst" and result.attributes["seed"] == 7
    assert result.status == "complete" and not result.message and result.versions["numpy"] == np.__version__
    assert set(result.versions) == {"hybrid-cable", "numpy", "h5py", "numba", "python"}
    text = repr(result)
    for part in ("Tëst", "run.h5", "4 outputs", "1.5 s", "5 points", "rod 1-2 m", "complete"):
        assert part in text
    assert "position" in dir(result) and "energy" in result and "moment" in result and "lift" not in result


def test_of_a_run_that_was_killed_all_is_of_the_window_of_its_outputs(tmp_path: Path) -> None:
    """Steps are written as they are made: those behind the last output that is there are left out, and it says so."""
    written(tmp_path / "run.h5")
    shutil.copy(tmp_path / "run.h5", tmp_path / "killed.h5")
    with h5py.File(tmp_path / "killed.h5", "a") as file:
        file.attrs["status"] = "running"
        file["t"].resize((3,))
        file.create_group("envelope")["end"] = 1.25
        file["envelope/end"].attrs["units"] = "s"
    killed, whole = open_result(tmp_path / "killed.h5"), open_result(tmp_path / "run.h5")
    assert killed.times[-1] == 1.0 and killed["steps/t"].tolist() == [0.0, 0.5, 1.0] and len(whole["steps/t"]) == 4
    assert killed.steps["iterations"].tolist() == [0, 1, 2]
    assert stored_window(killed) == "t = 0 to 1 s, extremes of all nodes and steps to 1.25 s"
    made = export(killed, tmp_path / "steps.csv", names=["steps"])
    assert "stored of it: t = 0 to 1 s, extremes" in made.notes[1]
    assert (tmp_path / "steps.csv").read_text(encoding="utf-8").splitlines()[-1].startswith("1.0,")


def test_in_memory_is_the_same_as_a_file(result: Result) -> None:
    memory = io.BytesIO()
    written(memory)
    for source in (memory, memory.getvalue()):
        other = open_result(source)
        assert other.names == result.names and np.array_equal(other.position, result.position)
        assert other.refresh() is other and "in memory" in repr(other)


def test_every_dataset_has_unit_description_and_scales(tmp_path: Path) -> None:
    speed = Field("speeds", "m/s", "of the current", (2,), ("z",))
    depth = Field("z", "m", "heights of the current", (2,), ("z",), "inertial")
    fixed = [(depth, np.array([0.0, -9.0])), (speed, np.array([1.0, 0.2]))]
    written(tmp_path / "run.h5", fixed=fixed)
    seen = []
    with h5py.File(tmp_path / "run.h5") as file:

        def visit(name: str, item: object) -> None:
            if not isinstance(item, h5py.Dataset) or name == "scene":
                return
            seen.append(name)
            assert isinstance(item.attrs["units"], str) and item.attrs["description"], name
            for dim, size in zip(item.dims, item.shape, strict=True):
                assert dim.label, name
                assert item.is_scale or (dim[0].name == "/" + dim.label and dim[0].shape == (size,)), name

        file.visititems(visit)
        assert file["position"].attrs["frame"] == "inertial"
        assert file["t"].is_scale and file["s"].is_scale and file["xyz"].is_scale and file["z"].is_scale
        assert [d.label for d in file["position"].dims] == ["t", "s", "xyz"]
    assert {"t", "s", "tension", "steps/dt", "zones/kind", "events/text", "energy/kinetic", "speeds"} <= set(seen)
    result = open_result(tmp_path / "run.h5")
    assert result.units["tension"] == "N" and result.units["moment"] == "N m" and result.units["energy/kinetic"] == "J"
    assert result.describe("position") == "position(t, s, xyz) in m: position of the centreline (inertial frame)"
    assert result.describe("energy") == "energy: kinetic (J)" and result.describe("zones").endswith("; t (s)")
    assert result.speeds.tolist() == [1.0, 0.2] and result.dims("speeds") == ("z",)


def test_zones_are_looked_up_by_output_and_written_only_when_they_change(result: Result) -> None:
    assert len(result.zones) == 4
    assert result.zones[0] == [Zone("catenary", 0.0, 1.5), Zone("rod", 1.5, 2.0)] == result.zones[1]
    assert result.zones[2] == [Zone("catenary", 0.0, 1.0), Zone("rod", 1.0, 2.0)] == result.zones[-1]
    assert result.zones[1:3] == [result.zones[1], result.zones[2]]
    assert result["zones/t"].tolist() == [0.0, 0.0, 1.0, 1.0]
    assert repr(result.zones).endswith("; from output 2: catenary 0-1 m, rod 1-2 m>")
    with pytest.raises(IndexError):
        result.zones[4]


def test_interpolation_is_exact_on_linear_data(result: Result) -> None:
    at = result.at(t=1.23, s=0.77)
    assert at["tension"] == pytest.approx(13.07, rel=1e-14)  # round-off
    assert at["position"] == pytest.approx([2.0, 0.0, 0.15], abs=1e-14)
    assert at["energy/kinetic"] == pytest.approx(4.92, rel=1e-14)
    at = result.at(t=[0.1, 1.5], s=[0.0, 0.3, 2.0], names=["tension", "position"])
    assert set(at) == {"tension", "position"} and at["position"].shape == (2, 3, 3)
    assert at["tension"] == pytest.approx(np.add.outer([1.0, 15.0], [0.0, 0.3, 2.0]), rel=1e-14)
    assert result.at(s=0.5)["tension"].shape == (4,) and result.at(t=1.5)["tension"].tolist() == (15.0 + S).tolist()
    assert result.at()["tension"] is result.tension
    # The last time, reached by adding steps, may be a round-off beyond the end.
    assert result.at(t=1.5 * (1 + 1e-15))["energy/kinetic"] == 6.0


@pytest.mark.parametrize("where", [{"t": -0.1}, {"t": 1.6}, {"s": 2.1}, {"s": [0.0, np.nan]}])
def test_outside_the_range_says_the_range(result: Result, where: dict[str, float]) -> None:
    expected = r"0 <= t <= 1.5 s" if "t" in where else r"0 <= s <= 2 m"
    with pytest.raises(ResultError, match=expected):
        result.at(**where)


def test_unknown_names_are_answered_with_near_ones(result: Result) -> None:
    for wrong in ("tensoin", "tenson"):
        with pytest.raises(ResultError, match=rf"no '{wrong}'; did you mean tension\?$"):
            result[wrong]
    with pytest.raises(ResultError, match="'energy' is a group; ask for energy/kinetic"):
        result.dims("energy")
    with pytest.raises(AttributeError, match="energy/kinetic"):
        _ = result.kinetic
    with pytest.raises(ResultError, match=r"it has .*tension"):
        result.describe("lift")
    assert not hasattr(result, "lift")
    with pytest.raises(ValueError, match="read-only"):
        result.tension[0] = 1.0


def test_closed_results_keep_what_was_read(result: Result) -> None:
    tension = result.tension
    result.close()
    assert result.tension is tension
    with pytest.raises(ResultError, match="open the file again"):
        result["strain"]


# ---- interruption and concurrent reading ----------------------------------------------------------

WRITER = """
import os, sys
from pathlib import Path
sys.path[:0] = [{root!r}, {here!r}]
from hybrid.store.hdf5_file import locked
from test_result_file import recorder, values, ONE, TWO
with locked(Path({path!r})):
    r = recorder({path!r})
    for i in range({count}):
        r.log({{"t": float(i), "residual": 0.0, "dt": 1.0, "iterations": 1}})
        r.save(float(i), values(float(i)), ONE if i % 4 < 2 else TWO)
        r.flush()  # at once, where a run would hold outputs back for a moment: more chances to go wrong
        if i == 20:
            print("ready", flush=True)
    os.kill(os.getpid(), 9)
"""


def writer_of(path: Path, count: int) -> subprocess.Popen[str]:
    """A process that writes so many outputs and is killed."""
    root, here = Path(hybrid.__file__).parents[1], Path(__file__).parent
    code = WRITER.format(root=str(root), here=str(here), path=str(path), count=count)
    return subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)


def test_a_running_file_can_be_read_and_survives_a_kill(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    writer = writer_of(path, 100_000)
    try:
        assert writer.stdout is not None and writer.stdout.readline() == "ready\n"
        result = open_result(path)
        before = len(result.times)
        assert result._contents._file.swmr_mode
        for _ in range(20):
            check_consistent(result)
            result.refresh()
        time.sleep(0.05)
        assert len(result.refresh().times) > before >= 21
        assert result.status == "running"
    finally:
        writer.send_signal(signal.SIGKILL)
        writer.wait()
        assert writer.stdout is not None
        writer.stdout.close()
    for opened in (result.refresh(), open_result(path)):
        check_consistent(opened)
        assert not opened._contents._file.swmr_mode
        assert opened.status == "running" and "interrupted or still running" in repr(opened)
    with recorder(path, overwrite=True):  # and a killed file can be replaced
        pass


def check_consistent(result: Result) -> None:
    """No row is half written: all fields have the values of their time."""
    t = result.times
    assert np.array_equal(t, np.arange(len(t)))
    assert np.array_equal(result.tension, 10.0 * t[:, None] + S)
    assert np.array_equal(result.energy.kinetic, 4.0 * t)
    assert result.zones[len(t) - 1][0].s_b == (1.5 if (len(t) - 1) % 4 < 2 else 1.0)
    assert len(result.steps["t"]) == len(result.steps["dt"]) >= len(t)


def test_an_exception_sets_the_status(tmp_path: Path) -> None:
    cases = (
        (KeyboardInterrupt(), "interrupted", "stopped"),
        (RuntimeError("the µ slipped"), "failed", "the µ slipped"),
    )
    for error, status, message in cases:
        path = tmp_path / f"{status}.h5"
        with pytest.raises(type(error)), recorder(path) as r:
            r.save(0.0, values(0.0), ONE)
            raise error
        result = open_result(path)
        assert result.status == status and message in result.message and message in repr(result)
        assert len(result.times) == 1


def test_a_reader_keeps_what_it_sees_while_the_run_is_repeated(result: Result, tmp_path: Path) -> None:
    written(tmp_path / "run.h5", nt=2, overwrite=True)
    assert result.tension.shape == (4, 5)
    assert result.refresh().tension.shape == (2, 5)
    assert [p.name for p in tmp_path.iterdir()] == ["run.h5"]


def test_no_output_at_all(tmp_path: Path) -> None:
    recorder(tmp_path / "run.h5").close("failed", "x" * 5000)
    result = open_result(tmp_path / "run.h5")
    assert "0 outputs" in repr(result) and result.position.shape == (0, 5, 3) and len(result.message) == 2048
    with pytest.raises(ResultError, match="no output yet"):
        result.at(t=0.0)


def test_every_logged_step_is_kept(tmp_path: Path) -> None:
    with recorder(tmp_path / "run.h5") as r:
        for _ in range(5000):
            r.log({"t": 0.0, "residual": 0.0, "dt": 1.0, "iterations": 1})
    assert len(open_result(tmp_path / "run.h5").steps["t"]) == 5000


def test_what_came_after_a_mark_is_taken_back_until_it_is_written(tmp_path: Path) -> None:
    with recorder(tmp_path / "run.h5") as r:
        r.save(0.0, values(0.0), ONE)
        mark = r.mark()
        for way in ("first", "second"):
            r.log({"t": 0.5, "residual": 0.0, "dt": 0.5, "iterations": 1})
            r.event(0.5, 0.0, 1.0, "note", way)
            r.save(0.5, values(0.5), TWO)
            if way == "first":
                r.back_to(mark)
        r.flush()
        with pytest.raises(ValueError, match="rows are written"):
            r.back_to(mark)
    result = open_result(tmp_path / "run.h5")
    assert result.times.tolist() == [0.0, 0.5] and result["steps/t"].tolist() == [0.5]
    assert [e.text for e in result.events] == ["second"] and result.zones[1] == [Zone(*x) for x in TWO]


# ---- nonsense -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "change, message",
    [
        ({"tension": np.array([0.0, 1.0, np.nan, 0.0, 0.0])}, r"'tension' is not finite at t = 1.5 s .*\(2,\)"),
        ({"energy/kinetic": np.array(np.inf)}, "'energy/kinetic' is not finite"),
        ({"tension": np.zeros(4)}, r"'tension' has shape \(4,\), expected \(5,\)"),
        ({"lift": np.zeros(5)}, "missing or unknown: lift"),
    ],
)
def test_wrong_values_are_refused_by_name(change: dict[str, np.ndarray], message: str) -> None:
    with recorder(io.BytesIO()) as r, pytest.raises(ResultError, match=message):
        r.save(1.5, values(1.5) | change, ONE)


def test_wrong_times_zones_and_logs_are_refused() -> None:
    with recorder(io.BytesIO()) as r:
        r.save(1.0, values(1.0), ONE)
        for t in (1.0, 0.5, np.nan):
            with pytest.raises(ResultError, match="cannot follow"):
                r.save(t, values(1.0), ONE)
        with pytest.raises(ResultError, match="zone is not finite"):
            r.save(2.0, values(2.0), [("rod", 0.0, np.nan)])
        with pytest.raises(ResultError, match="'dt' of the step log"):
            r.log({"t": 0.0, "residual": 0.0, "dt": np.nan, "iterations": 0})
        with pytest.raises(ResultError, match="event 'switch'"):
            r.event(np.nan, 0.0, 1.0, "switch", "")
        with pytest.raises(ValueError, match="none of running"):
            r.close("perfect")


@pytest.mark.parametrize(
    "more, message",
    [
        ({"fields": (Field("t", "s", "mine"),)}, "'t' is taken"),
        ({"fields": (Field("zones/a", "s", "mine"),)}, "'zones/a' is taken"),
        ({"fields": (FIELDS[1], FIELDS[1])}, "twice: tension"),
        ({"fields": (Field("a", "", "d", (5,), ()),)}, r"shape \(5,\) but dims"),
        ({"fields": (Field("a", "", "d", (4,), ("s",)),)}, "4 along s, others have 5"),
        ({"step_fields": (Field("a", "", "d", (4,), ("s",)),)}, "must be a number"),
        ({"grid_s": np.array([0.0, 1.0, 1.0, 2.0, 3.0])}, "increasing"),
        ({"attributes": {"status": "fine"}}, "'status' is written by the recorder"),
    ],
)
def test_wrong_promises_are_refused_and_leave_nothing(tmp_path: Path, more: dict[str, object], message: str) -> None:
    with pytest.raises(ResultError, match=message):
        recorder(tmp_path / "run.h5", **more)
    assert list(tmp_path.iterdir()) == []


def test_files_of_others_are_never_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    written(path)
    with pytest.raises(ResultError, match="exists\n    try: "):
        recorder(path)
    notes, foreign, empty = tmp_path / "notes.txt", tmp_path / "foreign.h5", tmp_path / "empty.h5"
    notes.write_text("my thesis")
    h5py.File(foreign, "w").close()
    for other in (notes, foreign):
        before = other.read_bytes()
        with pytest.raises(ResultError, match="is not a result of hybrid"):
            recorder(other, overwrite=True)
        assert other.read_bytes() == before
    empty.touch()
    written(empty, overwrite=True)  # nothing to lose, as `mktemp` makes it
    assert open_result(empty).status == "complete"


def test_places_where_nothing_can_be_written(tmp_path: Path) -> None:
    with pytest.raises(ResultError, match="mkdir -p"):
        recorder(tmp_path / "no" / "run.h5")
    with pytest.raises(ResultError, match="is a folder"):
        recorder(tmp_path)
    with pytest.raises(ResultError, match="cannot be written"):
        recorder("/proc/run.h5")
    if os.geteuid() != 0:  # the superuser may write anywhere
        tmp_path.chmod(0o500)
        with pytest.raises(ResultError, match="cannot be written"):
            recorder(tmp_path / "run.h5")
        tmp_path.chmod(0o700)


def test_files_that_are_no_results(tmp_path: Path) -> None:
    (tmp_path / "text.h5").write_text("hello")
    h5py.File(tmp_path / "foreign.h5", "w").close()
    with h5py.File(tmp_path / "export.nc", "w") as file:
        file.attrs["format"] = MARK
    written(tmp_path / "future.h5")
    with h5py.File(tmp_path / "future.h5", "r+") as file:
        file.attrs["format_version"] = 2
    cases = (
        (tmp_path / "none.h5", "there is no file"),
        (tmp_path, "is a folder"),
        (tmp_path / "text.h5", "cannot be read as a result"),
        (tmp_path / "foreign.h5", "not a result of hybrid\n.*format 'none'\n.*name a file that `hybrid run`"),
        (tmp_path / "export.nc", "not a result of hybrid\n.*an export.*\n.*name the result that it was made of"),
        (tmp_path / "future.h5", "result format 2; this program reads format 1"),
        (b"hello", "no HDF5 file"),
    )
    for source, message in cases:
        with pytest.raises(ResultError, match=message):
            open_result(source)


def test_the_recorder_and_the_reader_import_no_solver_and_no_plot() -> None:
    code = "import sys, hybrid.store.writer; print(*(m for m in sys.modules if m.startswith(('hybrid', 'matplotlib'))))"
    env = os.environ | {"PYTHONPATH": str(Path(hybrid.__file__).parents[1])}
    modules = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=env).stdout
    others = [name for name in modules.split() if not name.startswith(("hybrid.errors", "hybrid.store"))]
    assert others == ["hybrid"]


def test_a_result_in_memory_may_be_open_when_the_interpreter_ends() -> None:
    """Held by a cycle of a module, so that nobody lets go of it; HDF5 must not call Python then."""
    code = """
import io, sys
sys.path[:0] = [{here!r}]
from test_result_file import recorder, written
from hybrid.store.reader import open_result
memory = io.BytesIO()
written(memory)
result, unfinished = open_result(memory), recorder(io.BytesIO())
result.me = result
assert result._contents.is_open and result.tension.shape == (4, 5)
"""
    code = code.format(here=str(Path(__file__).parent))
    env = os.environ | {"PYTHONPATH": str(Path(hybrid.__file__).parents[1])}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=env)
    assert (done.returncode, done.stderr) == (0, "")


def test_results_of_lines_are_parts_of_one_file(tmp_path: Path) -> None:
    """HDF5 takes 5 MB for a file, and 64 kB more for each dataset if it may choose: 6 GB for 1000 lines."""
    opened = len(h5py.h5f.get_obj_ids(types=h5py.h5f.OBJ_FILE))
    parts = {name: Rows(GIVEN._replace(attributes={"title": name})) for name in ("a", "b")}
    for name, part in parts.items():
        part.event(0.0, 0.0, 1.0, "note", f"of {name}")
    assert len(h5py.h5f.get_obj_ids(types=h5py.h5f.OBJ_FILE)) == opened
    path = tmp_path / "many.h5"
    with recorder(path, parts=parts) as whole:
        assert h5py.h5f.get_obj_ids(types=h5py.h5f.OBJ_FILE)[-1].get_access_plist().get_cache()[1:3] == (SLOTS, 0)
        for each in (*parts.values(), whole):
            each.save(0.0, values(0.0), [])
            each.close()
    with open_result(path) as result:
        for name, line in result.lines.items():
            assert line.title == name and [e.text for e in line.events] == [f"of {name}"]
            assert np.array_equal(line.tension[0], values(0.0)["tension"])


@pytest.mark.skipif(sys.platform == "win32", reason="HDF5's function is not reached through h5py there")
def test_what_is_known_of_a_dataset_of_many_goes_when_it_is_closed(tmp_path: Path) -> None:
    """Else closing the file takes time that grows with more than the square of its datasets."""
    with in_memory() as made:
        for k in range(20):
            made.create_dataset(f"x{k}", (0,), maxshape=(None,), chunks=(64,), dtype=float)
        made.flush()
        image = made.id.get_file_image()
    with created(tmp_path / "many.h5", lambda path: path.write_bytes(image), many=True) as file:
        bound_metadata(file)
        for k in range(20):
            data = file[f"x{k}"]
            data.resize((5,))
            data[:] = 1.0
        del data
        file.flush()
        assert file.id.get_mdc_size()[3] < 40  # entries of 20 datasets that were closed
    with h5py.File(tmp_path / "many.h5") as file:
        assert all(file[f"x{k}"].shape == (5,) for k in range(20))


# Files of older versions are read under the names of today, and answer to the old ones too.


def named(path: Path, old: bool) -> Path:
    """A small result with end forces at every step, its error, and an event; `old`: as version 0.5 named them."""
    word = "pull" if old else "end_force"
    log = [Field("t", "s", "end of the step"), Field(f"{word}_end", "N", "force at the end")]
    fields = [Field(f"errors/model/{word}_end", "N", "error of it")]
    recorder = Recorder(
        path, Header(np.array([0.0, 1.0]), fields, log, {"title": "", f"error_total_{word}": 3.0}, {"scene": ""})
    )
    kinds = {"turned in": "end rotated in", "snap": "snap"}
    with recorder:
        for k in range(3):
            recorder.log({"t": 1.0 + k, f"{word}_end": 10.0 + k})
            recorder.save(float(k), {f"errors/model/{word}_end": 0.1 * k}, [("rod", 0.0, 1.0)])
        for before, now in kinds.items():
            recorder.event(0.0, 0.0, 1.0, before if old else now, "text")
        omitted = ("events left out", "turned in") if old else ("events omitted", "end rotated in")
        recorder.event(0.0, 0.0, 1.0, omitted[0], "text", criterion=omitted[1])
    return path


def test_a_file_of_an_older_version_has_the_names_of_today(tmp_path: Path) -> None:
    old, new = (hybrid.open(named(tmp_path / f"{x}.h5", x)) for x in (True, False))
    assert old.names == new.names and old.attributes.keys() == new.attributes.keys()
    assert [e.kind for e in old.events] == [e.kind for e in new.events] == ["end rotated in", "snap", "events omitted"]
    assert old.events[-1].criterion == "end rotated in"
    for name in ("steps/end_force_end", "errors/model/end_force_end"):
        np.testing.assert_array_equal(old[name], new[name])
        assert old.dims(name) == new.dims(name) and old.label(name) == new.label(name)
        assert old.describe(name) == new.describe(name)


def test_old_names_are_understood_in_old_and_new_files(tmp_path: Path) -> None:
    for old in (True, False):
        result = hybrid.open(named(tmp_path / f"{old}.h5", old))
        assert result.steps["pull_end"].tolist() == result.steps.end_force_end.tolist() == [10.0, 11.0, 12.0]
        assert "steps/pull_end" in result and "pull_end" in result.steps and "pull_end" not in list(result.steps)
        assert result.attributes["error_total_pull"] == result.attributes["error_total_end_force"] == 3.0
        assert result.at(t=0.5, names=["errors/model/pull_end"])["errors/model/pull_end"] == 0.05


def test_no_name_is_both_old_and_new() -> None:
    for table in (OLD_NAMES, OLD_ATTRIBUTES, OLD_EVENTS):
        assert not set(table) & set(table.values())


def test_the_file_itself_was_written_with_the_old_names(tmp_path: Path) -> None:
    """What the other tests stand on."""
    with h5py.File(named(tmp_path / "old.h5", True), "r") as file:
        assert "steps/pull_end" in file and "error_total_pull" in file.attrs


# `result.mesh[i]`: the cells at every output, whatever the output grid is.


def swinging(model, **more):
    """A line whose end swings so fast at first that zones change."""
    section = {"length": 20.0, "mass": 1.0, "bending_stiffness": 5.0, "axial_stiffness": 1e5}
    motion = {"surge": {"amplitude": 3.0, "period": 4.0}, "ramp": 2.0}
    data = cable_scene(
        section,
        clamped_at([0, 0, 0], [0, 0, -1]),
        pinned_at(8, 0, 0, motion=motion),
        model=model,
        time=(6.0, 0.02),
        output=(0.1, 7),
    )
    return hybrid.validate_scene(data | more)


@pytest.mark.parametrize(
    "model", ["rod", "catenary", {"zones": [{"rod": 5, "cells": 20}, {"catenary": 15, "cells": 9}]}]
)
def test_a_mesh_that_stays(model):
    result = hybrid.static(swinging(model))
    assert len(result.mesh) == 1
    nodes, kinds = result.mesh[-1]
    assert nodes[0] == 0.0 and nodes[-1] == 20.0 and (np.diff(nodes) > 0.0).all()
    assert nodes.size == kinds.size + 1 == result.attributes["cells"] + 1
    if isinstance(model, str):
        assert set(kinds) == {model}
    else:
        assert kinds.tolist() == ["rod"] * 20 + ["catenary"] * 9
        np.testing.assert_allclose(np.diff(nodes[20:]), 15 / 9)
        assert repr(result.mesh[0]) == "<mesh of 29 cells of 0.25 to 1.667 m: 9 catenary, 20 rod>"


def test_the_mesh_of_zones_that_move(monkeypatch, tmp_path):
    """At every output the nodes are those that the step was computed on."""
    seen = {}

    class Spy(Case):
        def _loop(self, *args):
            loop = super()._loop(*args)
            record = loop._record

            def recorded(batch, errors):
                line = loop.run.model.line
                for t in batch.t.tolist():
                    seen[t] = line.s.copy(), line.spin.astype(bool).copy()
                return record(batch, errors)

            loop._record = recorded
            return loop

    def shown(self, batch):
        for t in batch.t.tolist():
            seen[t] = self.model.line.s.copy(), self.model.line.spin.astype(bool).copy()
        return output(self, batch)

    output = RunLine.output
    monkeypatch.setattr(RunLine, "output", shown)
    monkeypatch.setattr(passes, "Case", Spy)
    monkeypatch.setattr(CellChanges, "may_change", lambda *_: False)  # outputs of other zones are recorded one by one
    result = hybrid.run(swinging("adaptive"), tmp_path / "run.h5")
    kinds = {tuple(mesh.kinds) for mesh in result.mesh}
    assert len(kinds) > 3 and len(result.mesh) == len(result.times) == len(seen)
    for t, mesh in zip(result.times, result.mesh, strict=True):
        nodes, rod = seen[float(t)]
        np.testing.assert_array_equal(mesh.s, nodes)
        np.testing.assert_array_equal(mesh.kinds == "rod", rod)
    assert [m.s.size for m in result.mesh[3:5]] == [result.mesh[k].s.size for k in (3, 4)]
    with pytest.raises(IndexError):
        result.mesh[len(result.mesh)]


def test_a_result_without_a_mesh_has_none(tmp_path):
    """As results of before 0.6."""
    path = tmp_path / "still.h5"
    hybrid.static(swinging("catenary"), path).close()
    with h5py.File(path, "r+") as file:
        del file["mesh"]
    result = hybrid.open(path)
    assert not hasattr(result, "mesh")
    with pytest.raises(ResultError, match="no 'mesh'"):
        result.mesh  # noqa: B018
