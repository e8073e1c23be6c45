"""Files begin as templates; one that is missing or spoilt changes nothing in the result."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from hybrid.store import whole_file as store
from hybrid.store.format import Field, Header
from hybrid.store.reader import open_result
from hybrid.store.writer import Recorder

FIELDS = (Field("tension", "N", "tension", (5,), ("s",)), Field("energy/kinetic", "J", "kinetic energy"))
HEIGHTS = Field("z", "m", "heights of the current", (2,), ("z",))


def write(folder: Path, path: Path, fields: tuple[Field, ...] = FIELDS, length: float = 2.0) -> None:
    """A result of one output; its template kept in the folder, or found there by what would be a new process."""
    store._known.clear()
    s = np.linspace(0.0, length, 5)
    fixed = [(HEIGHTS, np.array([0.0, -length]))]
    with Recorder(
        path, Header(s, fields, (), {"title": "made up"}, {"scene": "a: 1"}, fixed), overwrite=True, templates=folder
    ) as recorder:
        recorder.save(0.0, {f.name: np.ones(f.shape) for f in fields}, [("rod", 0.0, length)])


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


@pytest.fixture
def kept(tmp_path: Path) -> Path:
    """The one template of a folder, after a result was written that had none."""
    write(tmp_path / "templates", tmp_path / "first.h5")
    (found,) = (tmp_path / "templates").iterdir()
    return found


def test_a_template_that_was_kept_is_used_and_gives_the_same_file(
    kept: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object) -> bytes:
        raise AssertionError("made anew")

    monkeypatch.setattr(store, "_template", refused)
    write(kept.parent, tmp_path / "second.h5")
    assert content(tmp_path / "second.h5") == content(tmp_path / "first.h5")
    write(kept.parent, tmp_path / "longer.h5", length=3.0)  # values are no part of it
    assert open_result(tmp_path / "longer.h5").s[-1] == 3.0 and open_result(tmp_path / "longer.h5")["z"][1] == -3.0
    with pytest.raises(AssertionError, match="made anew"):
        write(kept.parent, tmp_path / "other.h5", FIELDS[:1])


@pytest.mark.parametrize("harm", ["empty", "cut off", "a changed byte", "a folder"])
def test_a_spoilt_template_is_made_anew(harm: str, kept: Path, tmp_path: Path) -> None:
    data = kept.read_bytes()
    kept.unlink()
    if harm == "a folder":
        kept.mkdir()
    else:
        middle = len(data) // 2
        changed = data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :]
        kept.write_bytes({"empty": b"", "cut off": data[:middle], "a changed byte": changed}[harm])
    write(kept.parent, tmp_path / "second.h5")
    assert content(tmp_path / "second.h5") == content(tmp_path / "first.h5")
    assert harm == "a folder" or kept.read_bytes() == data


def test_a_folder_that_cannot_be_written_is_done_without(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    write(tmp_path / "file", tmp_path / "first.h5")
    assert len(open_result(tmp_path / "first.h5").times) == 1


@pytest.mark.parametrize("what", ["h5py", "hybrid-cable"])
def test_other_versions_have_other_templates(what: str, kept: Path, tmp_path: Path) -> None:
    versions = store.versions()
    before = versions[what]
    try:
        versions[what] = "0.0"
        store._makers.cache_clear()
        write(kept.parent, tmp_path / "second.h5")
    finally:
        versions[what] = before
        store._makers.cache_clear()
        store._known.clear()
    assert len(list(kept.parent.iterdir())) == 2
    assert open_result(tmp_path / "second.h5").versions[what] == "0.0"


def test_old_templates_are_deleted(kept: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "_KEPT", 2)
    for n in (6, 7, 8):
        write(kept.parent, tmp_path / "next.h5", (*FIELDS, Field("more", "", "numbers", (n,), ("k",))))
    assert len(list(kept.parent.iterdir())) == 2 and not kept.exists()
