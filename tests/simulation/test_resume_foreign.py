"""Files whose datasets or attributes another program has replaced are refused before HDF5 tries to append to them."""

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
from typing import Any

import h5py
import numpy as np
import pytest
from bits import Stopping
from forge import CONTAINERS

import hybrid
from hybrid.errors import ResultError
from tests.scenes import cable_scene, pinned_at

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


@pytest.mark.parametrize("several", [False, True])
def test_a_file_keeps_the_interval_that_its_version_gave_it(
    several: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A scene that does not say how often: a hundredth of the duration in 1.0.0, in each period six since then."""
    section = {"length": 1.1, "mass": 1.0, "axial_stiffness": 1e4}
    moved = {"position": (1, 0, 0), "motion": {"heave": {"amplitude": 1e-4, "period": 0.1}, "ramp": 0.2}}
    scene: dict[str, Any] = {"time": {"duration": 4.0, "step": 0.01}, "output": {"points": 3}}
    if several:
        line = {"start": "a", "end": "b", "model": "catenary", "mesh": {"cells": 4}, "sections": [section]}
        scene |= {"points": {"a": {"position": (0, 0, 0)}, "b": moved}, "lines": {"one": line}}
    else:
        ends = {"start": {"kind": "pinned", "position": (0, 0, 0)}, "end": {"kind": "pinned"} | moved}
        scene |= {"cable": {"sections": [section]}, "ends": ends, "model": "catenary", "mesh": {"cells": 4}}
        scene["initial"] = "equilibrium"
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
    stopping = Stopping(monkeypatch)
    stopping.left = 25
    with pytest.raises(KeyboardInterrupt):
        hybrid.run(
            hybrid.load_scene(EXAMPLES / f"{name}.yaml", more), tmp_path / "stopped_half_way.h5", progress=stopping
        )
    count = forgeries(tmp_path / "stopped_half_way.h5", 5000, 5000 + many)
    assert count["refused"] > 2 * many // 3
