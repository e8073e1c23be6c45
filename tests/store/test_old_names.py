"""Files of older versions are read under the names of today, and answer to the old ones too."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

import hybrid
from hybrid.store.format import Field, Header
from hybrid.store.records import OLD_ATTRIBUTES, OLD_EVENTS, OLD_NAMES
from hybrid.store.writer import Recorder


def written(path: Path, old: bool) -> Path:
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
    old, new = (hybrid.open(written(tmp_path / f"{x}.h5", x)) for x in (True, False))
    assert old.names == new.names and old.attributes.keys() == new.attributes.keys()
    assert [e.kind for e in old.events] == [e.kind for e in new.events] == ["end rotated in", "snap", "events omitted"]
    assert old.events[-1].criterion == "end rotated in"
    for name in ("steps/end_force_end", "errors/model/end_force_end"):
        np.testing.assert_array_equal(old[name], new[name])
        assert old.dims(name) == new.dims(name) and old.label(name) == new.label(name)
        assert old.describe(name) == new.describe(name)


def test_old_names_are_understood_in_old_and_new_files(tmp_path: Path) -> None:
    for old in (True, False):
        result = hybrid.open(written(tmp_path / f"{old}.h5", old))
        assert result.steps["pull_end"].tolist() == result.steps.end_force_end.tolist() == [10.0, 11.0, 12.0]
        assert "steps/pull_end" in result and "pull_end" in result.steps and "pull_end" not in list(result.steps)
        assert result.attributes["error_total_pull"] == result.attributes["error_total_end_force"] == 3.0
        assert result.at(t=0.5, names=["errors/model/pull_end"])["errors/model/pull_end"] == 0.05


def test_no_name_is_both_old_and_new() -> None:
    for table in (OLD_NAMES, OLD_ATTRIBUTES, OLD_EVENTS):
        assert not set(table) & set(table.values())


def test_the_file_itself_was_written_with_the_old_names(tmp_path: Path) -> None:
    """What the other tests stand on."""
    with h5py.File(written(tmp_path / "old.h5", True), "r") as file:
        assert "steps/pull_end" in file and "error_total_pull" in file.attrs
