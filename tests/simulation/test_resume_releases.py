"""Result files of releases: what each of them can still be used for.

tests/data holds a file of 0.4.0 and of 0.5.0, and of 0.6.0 one that was stopped after 0.5 s of 1 s by Ctrl-C.  Of 1.0.0
it has two that were stopped, whose older checkpoint is blank: one with zones that move, in steps of 0.02 s, and one in
a plane, in steps that follow the motion.  Whoever
changes the format of checkpoints adds one of the release before, and says here what becomes of it.
"""

from __future__ import annotations

import gzip
import json
import os
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from bits import Stopping
from forge import CONTAINERS

import hybrid
from hybrid.errors import OTHER_PROGRAM, ResultError
from hybrid.scene.read import one_line
from hybrid.simulation import restart
from hybrid.simulation.restart import as_of_line
from hybrid.store.hdf5_file import opened
from hybrid.store.reader import open_result
from hybrid.store.whole_file import read_checkpoint
from tests.scenes import cable_scene, pinned_at

DATA = Path(__file__).parents[1] / "data"
# Another compiler, or other sources, may change the last bits of a step, and then Newton's method may stop one iteration
# earlier or later, below 1e-9 of the force scale; a swing of a second does not amplify that by more than ten.
SAME = 1e-8


def kept(name: str, folder: Path) -> Path:
    """A file of tests/data, in a folder where it may be changed."""
    path = folder / name.removesuffix(".gz")
    path.write_bytes(gzip.decompress((DATA / name).read_bytes()))
    return path


def test_a_file_of_0_4_opens_and_cannot_be_resumed(tmp_path: Path) -> None:
    """It has no checkpoint."""
    older = kept("result_0.4.h5.gz", tmp_path)
    with hybrid.open(older) as result:
        assert result.tension[-1].tolist() == [10.109223689133069, 5.164341571429652, 0.0]
        assert result.title == "a chain of hybrid-cable 0.4.0" and result.zones[0][0].kind == "catenary"
    with pytest.raises(hybrid.ResultError, match=r"(?s)no checkpoint.*run its scene again$"):
        hybrid.resume(older)


def test_a_file_of_0_5_is_read_by_old_and_new_names(tmp_path: Path) -> None:
    with hybrid.open(kept("result_0.5.h5.gz", tmp_path)) as result:
        assert result.versions["hybrid-cable"] == "0.5.0" and result.status == "interrupted"
        assert np.allclose(result.times, np.arange(6) / 10, rtol=0, atol=1e-12)
        assert result.position[-1, -1].tolist() == [0.06818282171614135, 0.0, -0.9779678410959755]
        assert "steps/end_force_end" in result.names and "steps/pull_end" not in result.names
        for old, new in (("pull_end", "end_force_end"), ("pull_start", "end_force_start")):
            assert result.steps[old].tolist() == result.steps[new].tolist()
        assert set(result.steps["pull_end"][:10]) == {0.3}  # N, until 0.4 s
        assert "title: a chain of hybrid-cable 0.5.0" in result.scene_text


def test_a_file_of_0_5_cannot_be_resumed_and_says_what_can_be_done(tmp_path: Path) -> None:
    """Its checkpoints were pickles (format 1), which nothing reads any more; its scene runs."""
    path = kept("result_0.5.h5.gz", tmp_path)
    before = path.read_bytes()
    expected = (
        r"(?s)result_0\.5\.h5 has no checkpoint.*format 1.*reads format 2.*run its scene again.*hybrid-cable 0\.5\.0"
    )
    with pytest.raises(hybrid.ResultError, match=expected):
        hybrid.resume(path)
    assert path.read_bytes() == before
    with hybrid.open(path) as old, hybrid.run(hybrid.parse_scene(old.scene_text)) as new:
        assert np.allclose(old.position, new.position[: len(old.times)], rtol=0, atol=SAME)


def same_times(result: hybrid.Result, fresh: hybrid.Result, stopped: float) -> bool:
    """Outputs at the same times: those behind the stop to the bit, and those before as sums of steps had them then."""
    new = result.times > stopped + 1e-9
    same = np.allclose(result.times, fresh.times, rtol=2.3e-16, atol=0) and np.array_equal(
        new, fresh.times > stopped + 1e-9
    )
    return bool(same and new.any() and np.array_equal(result.times[new], fresh.times[new]))


@pytest.mark.parametrize("other", [False, True])
def test_a_file_of_0_6_is_resumed(other: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Catenary and rod in space, in a current; on its own grid, the same as the run that was never stopped.

    Since then the joint is an output point, with the values on its right in right/*, the diameter is in the file,
    lines of fixed zones may touch themselves, and curvature between nodes is that of its vector: outputs that were
    written before the stop stay as they are.
    """
    path = kept("result_0.6.h5.gz", tmp_path)
    if other:  # as a release will that is not the one that wrote it
        monkeypatch.setattr(restart, "program", lambda: "9.9.9 0123456789abcdef")
    with opened(path) as file:
        point = read_checkpoint(file)
    assert point.t == pytest.approx(0.5) and point.program.startswith("0.6.0 ")
    with hybrid.resume(path) as result, hybrid.run(hybrid.parse_scene(result.scene_text)) as fresh:
        assert result.status == "complete" and set(result.names) == {
            x for x in fresh.names if x != "diameter" and not x.startswith("right/") and "self_contact" not in x
        }
        assert result.s.size == 5 and np.isin(result.s, fresh.s).all() and fresh["right/s"].size == 1
        assert same_times(result, fresh, point.t) and len(result.times) == 11
        assert len(result["steps/t"]) == len(fresh["steps/t"]) and result.zones[-1] == fresh.zones[-1]
        for name in ("position", "velocity", "tension", "bending_moment", "curvature", "work/drag", "energy/kinetic"):
            expected = fresh[name][:, np.isin(fresh.s, result.s)] if "s" in fresh.dims(name) else fresh[name]
            new = result.times > point.t + 1e-9 if name == "curvature" else np.ones(len(result.times), bool)
            assert new.sum() >= 5
            assert np.allclose(result[name][new], expected[new], rtol=0, atol=SAME * np.abs(expected).max()), name
        assert np.ptp(fresh.position[6:, -1], axis=0).min() > 1e-3, "nothing moves in space after the checkpoint"
        if other:
            (event,) = (e for e in result.events if e.kind == OTHER_PROGRAM)
            assert "0.6.0" in event.text and "9.9.9" in event.text and event.t == point.t


@pytest.mark.long
@pytest.mark.parametrize(("name", "stopped"), [("zones", 1.04), ("plane", 0.7)])
def test_a_file_of_1_0_is_resumed(name: str, stopped: float, tmp_path: Path) -> None:
    """Zones that move, friction on a bed, quantities and an end that was let go; a plane and steps that follow."""
    path = kept(f"result_1.0_{name}.h5.gz", tmp_path)
    with opened(path) as file:
        point = read_checkpoint(file)
    assert point.program.startswith("1.0.0 ") and abs(point.state["t"] - stopped) < 0.05
    with hybrid.resume(path) as result, hybrid.run(hybrid.parse_scene(result.scene_text)) as fresh:
        assert result.status == "complete" and set(result.names) == set(fresh.names)
        assert same_times(result, fresh, point.state["t"]) and result.zones[-1] == fresh.zones[-1]
        assert len(result["steps/t"]) == len(fresh["steps/t"])
        names = "position velocity tension curvature bending_moment energy/kinetic work/scheme envelope/tension_max"
        for key in (*names.split(), *(x for x in fresh.names if x.startswith("quantities/"))):
            scale = np.nanmax(np.abs(fresh[key]))
            assert np.allclose(result[key], fresh[key], rtol=0, atol=SAME * scale, equal_nan=True), key
        late = result.times > point.t
        assert np.ptp(fresh.position[late], axis=0).max() > 0.05, "nothing moves after the checkpoint"
        assert [e.t for e in result.events if e.kind == OTHER_PROGRAM] == [point.t]


def test_what_is_of_another_line_or_of_no_cable_is_refused(tmp_path: Path) -> None:
    path = kept("result_1.0_plane.h5.gz", tmp_path)
    with opened(path) as file, open_result(path) as result:
        saved, scene = read_checkpoint(file).state, hybrid.parse_scene(result.scene_text)
    model = hybrid.model.build.build(one_line(scene))
    assert set(as_of_line(saved, "cable", model, ())["lines"]) == {"cable"}
    with pytest.raises(ValueError, match="surplus: not in the checkpoint of any cable"):
        as_of_line(saved | {"surplus": 1.0}, "cable", model, ())
    longer = hybrid.model.build.build(
        one_line(scene.model_copy(update={"mesh": scene.mesh.model_copy(update={"cells": 7})}))
    )
    with pytest.raises(ValueError, match="nodes that are not those of the line"):
        as_of_line(saved, "cable", longer, ())


# --- Files whose datasets or attributes another program has replaced are refused before HDF5 tries to append to them
# ---

SCENE = cable_scene(
    {"length": 10.0, "mass": 1.0}, pinned_at(0, 0, 0), pinned_at(8, 0, 0), model="catenary", mesh=10, time=(1.0, 0.1)
)


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("foreign") / "run.h5"
    hybrid.run(SCENE, path).close()
    return path


def replace(name: str, **made: object) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        del file[name]
        file.create_dataset(name, **made)

    return change


def output(name: str, rows: int) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        if name in file:
            del file[name]
        data = file.create_dataset(name, data=np.zeros(rows), chunks=(4,), maxshape=(None,))
        data.dims[0].label = "t"

    return change


def set_status(file: h5py.File) -> None:
    file.attrs["status"] = b"\xff\xfe"


CHANGES: dict[str, tuple[Callable[[h5py.File], None], str]] = {
    "fixed length": (replace("work/drag", data=np.zeros(11)), "work/drag.*cannot grow"),
    "other type": (replace("work/drag", data=np.zeros(11, int), chunks=(4,), maxshape=(None,)), "work/drag: int64"),
    "other shape": (
        replace("tension", data=np.zeros((11, 3)), chunks=(4, 3), maxshape=(None, None)),
        r"tension: float64 of shape \(11, 3\)",
    ),
    "output of another program": (output("other", 11), "has other, which"),
    "output that has ended": (output("work/drag", 7), "has work/drag in 7 of 11 outputs"),
    "no text": (set_status, "attribute 'status'.*\n.*UTF-8"),
}


@pytest.mark.parametrize("what", CHANGES)
def test_it_is_refused_in_words(what: str, good: Path, tmp_path: Path) -> None:
    path, (change, words) = tmp_path / "run.h5", CHANGES[what]
    shutil.copyfile(good, path)
    with h5py.File(path, "r+") as file:
        change(file)
    with pytest.raises(ResultError, match=words) as refused:
        hybrid.resume(path, tmp_path / "longer.h5", until=1.1)
    assert "try:" in str(refused.value) and not (tmp_path / "longer.h5").exists()


def test_a_file_keeps_the_interval_that_its_version_gave_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A scene that does not say how often: a hundredth of the duration in 1.0.0, in each period six since then."""
    heave = {"heave": {"amplitude": 1e-4, "period": 0.1}, "ramp": 0.2}
    scene = cable_scene(
        {"length": 1.1, "mass": 1.0, "axial_stiffness": 1e4}, pinned_at(0, 0, 0), pinned_at(1, 0, 0, motion=heave),
        model="catenary", mesh=4, time=(4.0, 0.01), output={"points": 3}
    )  # fmt: skip
    monkeypatch.setattr("hybrid.scene.schema.PER_PERIOD", 1)
    hybrid.run(scene, tmp_path / "old.h5").close()
    monkeypatch.undo()
    with hybrid.resume(tmp_path / "old.h5", until=5.0) as longer:
        assert np.allclose(np.diff(longer.times), 0.04)
    with hybrid.run(scene, tmp_path / "new.h5") as new:
        assert np.allclose(np.diff(new.times), 0.1 / 6.0)


# --- forged checkpoints ---

FORGE = Path(__file__).with_name("forge.py")
KEPT = Path(__file__).parents[1] / "data" / "result_0.6.h5.gz"
EXAMPLES = Path(__file__).parents[2] / "examples"


def forgeries(stopped_half_way: Path, first: int, last: int) -> Counter[str]:
    """What came of forgeries of a file; the test fails at the first that ends the process, or in other words."""
    asked = [sys.executable, str(FORGE), str(stopped_half_way), str(stopped_half_way.parent), str(first), str(last)]
    env = {"PYTHONPATH": f"{Path(hybrid.__file__).parents[1]}:{FORGE.parent}"}
    done = subprocess.run(asked, capture_output=True, text=True, env=os.environ | env)
    told = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 0, f"number {first + len(told)} ends the process: {done.stderr[-2000:]}"
    assert [x["number"] for x in told] == list(range(first, last))
    faults = [f"{x['number']}: {x['text']}" for x in told if x["kind"] == "fault"]
    assert not faults, "\n".join(faults[:20])
    count = Counter(x["kind"] for x in told)
    print(f"\n{last - first} forgeries: " + ", ".join(f"{n} {kind}" for kind, n in count.most_common()))
    return count


@pytest.fixture
def stopped_half_way(tmp_path: Path) -> Path:
    """A file of 0.6.0 that was stopped half-way: fixed zones, in space."""
    (tmp_path / "stopped_half_way.h5").write_bytes(gzip.decompress(KEPT.read_bytes()))
    return tmp_path / "stopped_half_way.h5"


@pytest.mark.long
def test_a_checkpoint_in_another_container_is_refused(stopped_half_way: Path) -> None:
    """Other types and shapes, lengths that nothing holds, links, other files, bombs; see CONTAINERS in forge.py."""
    assert forgeries(stopped_half_way, 0, len(CONTAINERS)) == {"refused": len(CONTAINERS)}


@pytest.mark.long
def test_a_checkpoint_of_other_content_is_refused_or_resumed(stopped_half_way: Path) -> None:
    """Types, shapes, sizes, numbers that are not finite, missing and surplus names, versions, bits: 60 drawn."""
    count = forgeries(stopped_half_way, 1000, 1060)
    assert count["refused"] > 40 and count["resumed"] > 2


@pytest.mark.bench  # 6 minutes
def test_many_checkpoints_of_other_content(stopped_half_way: Path) -> None:
    """3000 that are drawn as the 60 above."""
    count = forgeries(stopped_half_way, 2000, 5000)
    assert count["refused"] > 2000 and count["resumed"] > 100


@pytest.mark.parametrize(
    "many",
    [pytest.param(60, marks=pytest.mark.slow), pytest.param(600, marks=pytest.mark.bench)],  # 3 minutes each
)
@pytest.mark.parametrize("name", ["laying", "touchdown"])
def test_checkpoints_of_adaptive_runs(name: str, many: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Moving zones, friction, the energy balance of a plane: more that can be forged."""
    more = ["mesh.cells=20", "output={every: 1, points: 7, errors: false}", "time={duration: 4, step: 0.1}"]
    path = tmp_path / "stopped_half_way.h5"
    Stopping(monkeypatch).stop(25, hybrid.run, hybrid.load_scene(EXAMPLES / f"{name}.yaml", more), path)
    count = forgeries(path, 5000, 5000 + many)
    assert count["refused"] > 2 * many // 3
