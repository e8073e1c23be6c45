"""Files whose datasets or attributes another program has replaced are refused before HDF5 tries to append to them."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import hybrid
from hybrid.errors import ResultError

SCENE = {
    "cable": {"sections": [{"length": 10.0, "mass": 1.0}]},
    "ends": {"start": {"kind": "pinned", "position": [0, 0, 0]}, "end": {"kind": "pinned", "position": [8, 0, 0]}},
    "initial": "equilibrium", "model": "catenary", "mesh": {"cells": 10}, "time": {"duration": 1.0, "step": 0.1},
}  # fmt: skip


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
    monkeypatch.setattr("hybrid.scene.analysis.PER_PERIOD", 1)
    hybrid.run(scene, tmp_path / "old.h5").close()
    monkeypatch.undo()
    with hybrid.resume(tmp_path / "old.h5", until=5.0) as longer:
        assert np.allclose(np.diff(longer.times), 0.04)
    with hybrid.run(scene, tmp_path / "new.h5") as new:
        assert np.allclose(np.diff(new.times), 0.1 / 6.0)
