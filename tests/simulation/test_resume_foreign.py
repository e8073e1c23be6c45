"""Files whose datasets or attributes another program has replaced are refused before HDF5 tries to append to them."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

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
