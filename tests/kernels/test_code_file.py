"""Machine code on disk is executed: what is damaged, poisoned or somebody else's is not, is said, and mends itself."""

from __future__ import annotations

import json
import os
import pickle
import struct
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from numba.core.registry import cpu_target

from hybrid.kernels.machine import cache, kept_code
from hybrid.kernels.machine.cache import (
    FORMAT,
    MAGIC,
    CacheWarning,
    Place,
    Unusable,
    cache_folder,
    processor,
    read_code,
    temporary_folder,
    write_code,
)
from hybrid.kernels.machine.compile import kernel

HEAD = len(MAGIC) + 8


def twice(x: float) -> float:
    return 2.0 * x


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An empty cache for kernels that are made in this test."""

    caches = kept_code._all_places, cache.warn_once

    def forget() -> None:
        for each in caches:
            each.cache_clear()

    monkeypatch.setenv("HYBRID_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.delenv("HYBRID_CACHE_SHARED", raising=False)
    forget()
    yield tmp_path
    forget()


def compiled(warned: str | None = None) -> int:
    """Call a new kernel, which has to be right; how often it was compiled.  warned: by that warning, in one line."""
    made = kernel(twice)
    cache.warn_once.cache_clear()
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        assert made(1.5) == 3.0
    texts = [str(x.message) for x in said if x.category is CacheWarning]
    assert len(texts) == (warned is not None) and all(warned in x and "\n" not in x for x in texts), texts
    return int(made.compilations)


def only_file(folder: Path) -> Path:
    (file,) = folder.rglob("*.kernel")
    return file


class Poison:
    """Makes a folder when it is unpickled."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, (str(self.folder),)


def flipped(where: Callable[[int], int]) -> Callable[[bytes, Path], bytes]:
    def flip(data: bytes, _: Path) -> bytes:
        k = where(len(data))
        return data[:k] + bytes([data[k] ^ 1]) + data[k + 1 :]

    return flip


def with_header(text: bytes) -> Callable[[bytes, Path], bytes]:
    return lambda data, _: MAGIC + struct.pack("<II", FORMAT, len(text)) + text + data[-1000:]


DAMAGES: dict[str, Callable[[bytes, Path], bytes]] = {
    "emptied": lambda data, _: b"",
    "one byte": lambda data, _: data[:1],
    "magic word alone": lambda data, _: data[: len(MAGIC)],
    "truncated in the header": lambda data, _: data[: HEAD + 50],
    "truncated in the code": lambda data, _: data[: len(data) // 2],
    "last byte gone": lambda data, _: data[:-1],
    "one byte more": lambda data, _: data + b"\0",
    "zeros": lambda data, _: bytes(len(data)),
    "bit of the magic word": flipped(lambda n: 3),
    "bit of the format": flipped(lambda n: len(MAGIC)),
    "bit of the header's length": flipped(lambda n: len(MAGIC) + 4),
    "bit of the header": flipped(lambda n: HEAD + 30),
    "bit of the code": flipped(lambda n: n - 500),
    "last bit": flipped(lambda n: n - 1),
    "symbol of another function": lambda data, _: data.replace(b"twice", b"thric", 20),
    "pickle": lambda data, folder: pickle.dumps(Poison(folder)),
    "pickle behind the magic word": lambda data, folder: data[:HEAD] + pickle.dumps(Poison(folder)),
    "pickle in the place of the code": lambda data, folder: data[:-1000] + pickle.dumps(Poison(folder)),
    "header that is no table": with_header(b"[1, 2]"),
    "header nested deep": with_header(b"[" * 100_000),
    "header without a digest": with_header(json.dumps({"bytes": 1000}).encode()),
}


@pytest.mark.long
def test_damaged_and_poisoned_files_run_nothing_and_are_made_again(home: Path) -> None:
    assert compiled() == 1 and compiled() == 0
    file = only_file(home)
    sound = file.read_bytes()
    (file.parent / "twice.nbi").write_bytes(pickle.dumps(Poison(home / "run")))  # as 0.6.0 would have read it
    for name, damage in DAMAGES.items():
        file.write_bytes(damage(sound, home / "run"))
        assert compiled(warned="compiled again") == 1, name
        assert not (home / "run").exists(), name
        assert compiled() == 0 and only_file(home) == file, name
    assert len(DAMAGES) > 20


def test_a_file_of_another_kernel_is_not_loaded(tmp_path: Path) -> None:
    """Its digest is right: it was copied, or renamed."""
    write_code(tmp_path / "a", {"kernel": "a", "triple": "x"}, b"code")
    found = read_code(tmp_path / "a", {"kernel": "a"}, trust=True)
    assert found and found[1] == b"code" and read_code(tmp_path / "b", {}, trust=True) is None
    with pytest.raises(Unusable, match="is of another kernel"):
        read_code(tmp_path / "a", {"kernel": "b", "triple": "x"}, trust=True)
    with pytest.raises(Unusable, match="directory"):
        read_code(tmp_path, {}, trust=True)


def make_foreign(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if os.getuid() == 0:
        os.chown(path, 4321, -1)
    else:
        other = os.getuid() + 1
        monkeypatch.setattr(os, "getuid", lambda: other)


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="files have no such owner")
@pytest.mark.parametrize("mode", [0o664, 0o606, None], ids=["group", "others", "foreign"])
def test_a_file_that_others_could_have_written_is_not_loaded(
    mode: int | None, home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert compiled() == 1
    file = only_file(home)
    if mode is None and os.getuid():
        pytest.skip("only root can give a file away")
    make_foreign(file, monkeypatch) if mode is None else file.chmod(mode)
    assert compiled(warned="another user" if mode is None else "written by other users") == 1
    assert compiled() == 0 and not file.stat().st_mode & 0o022
    file.chmod(0o666)
    monkeypatch.setenv("HYBRID_CACHE_SHARED", "1")
    assert compiled() == 0, "who shares the cache trusts all who write to it"


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="folders have no such owner")
@pytest.mark.parametrize("which", ["hybrid-cable", "version"])
@pytest.mark.parametrize("mode", [0o770, 0o777, None], ids=["group", "others", "foreign"])
@pytest.mark.parametrize("setting", ["HYBRID_CACHE_DIR", "XDG_CACHE_HOME", "HOME"])
def test_a_folder_that_others_can_write_to_is_not_used(
    setting: str, mode: int | None, which: str, home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("HYBRID_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv(setting, str(home / "root"))
    folder = cache_folder()
    assert folder.is_relative_to(home / "root")
    cache.make_folder(folder)
    assert folder.stat().st_mode & 0o777 == 0o700 and folder.parent.stat().st_mode & 0o777 == 0o700
    bad = folder if which == "version" else folder.parent
    make_foreign(bad, monkeypatch) if mode is None else bad.chmod(mode)
    with pytest.warns(CacheWarning, match="chmod go-w it"):
        assert cache_folder().parent == temporary_folder()
    monkeypatch.setenv("HYBRID_CACHE_SHARED", "1")
    assert cache_folder() == folder


def test_code_is_kept_for_one_processor(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A home that many machines share: what another one has compiled is not there for this one."""
    assert processor() == cpu_target.target_context.codegen().magic_tuple(), "as numba has it"
    assert not kernel(twice).is_kept
    assert compiled() == 1
    assert kernel(twice).is_kept and not kernel(lambda x: x).is_kept
    without = processor()._replace(features=processor().features.replace("+sse3", "-sse3"))
    monkeypatch.setattr(cache, "processor", lambda: without)
    kept_code._all_places.cache_clear()
    assert compiled(warned="settings of numba that were changed") == 1 and not kernel(twice).is_kept
    monkeypatch.setattr(cpu_target.target_context.codegen(), "magic_tuple", lambda: without)
    assert compiled() == 1 and kernel(twice).is_kept
    assert len(list(home.rglob("*.kernel"))) == 2


def test_code_in_the_package_is_used_first_and_never_written_to(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert compiled() == 1
    file = only_file(home)
    (home / "package").mkdir()
    shipped = file.rename(home / "package" / file.name)
    there = [Place(home / "package", processor(), ours=False), Place(file.parent, processor(), ours=True)]
    monkeypatch.setattr(kept_code, "_all_places", lambda: there)
    assert compiled() == 0 and only_file(home) == shipped
    shipped.chmod(0o666)
    assert compiled() == 0, "it is trusted as the package is"
    shipped.write_bytes(shipped.read_bytes()[:-1])
    assert compiled(warned=f"{shipped} is truncated") == 1
    assert shipped.exists() and file.exists()
    file.unlink()


def test_code_of_a_level_needs_its_features_and_numba_as_it_comes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ask = cache.shipped_for.__wrapped__
    level = cache.LEVELS[0]
    monkeypatch.setattr(cache, "SHIPPED", tmp_path)
    able = processor()._replace(features=cache.features_of(level) + ",-avx512f")
    monkeypatch.setattr(cache, "processor", lambda: able)
    assert ask() is None, "there is none"
    cache.folder_of(level.name).mkdir()
    assert ask() == (able.triple, "x86-64-v3", cache.features_of(level))
    for feature in level.features:
        less = able._replace(features=able.features.replace(f"+{feature},", f"-{feature},"))
        monkeypatch.setattr(cache, "processor", lambda less=less: less)
        assert ask() is None, feature
    monkeypatch.setattr(cache, "processor", lambda: able)
    monkeypatch.setenv("NUMBA_CPU_NAME", "x86-64-v2")
    assert ask() is None


def test_a_full_disk_is_said_and_the_kernel_runs(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(kept_code, "write_code", fail)
    assert compiled(warned="No space left on device") == 1
