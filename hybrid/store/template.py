"""Templates of result files: a file with all its datasets and no values, which a new result begins as.

HDF5 takes 20 ms to make the 60 datasets of a result with their units and dimensions, and 1 ms to open a file that has
them.  So the bytes of a new file are kept, in this process and in a folder, under a key made of all that shapes them.
A template that is missing, cut off or spoilt is made anew; one that cannot be kept is made every time.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Hashable, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path

import h5py
import numpy as np

from hybrid.store.checkpoint import create_slots
from hybrid.store.format import (
    BLOCK,
    FORMAT_VERSION,
    Field,
    create_attributes,
    create_scales,
    create_table,
    tables_of,
    versions,
)
from hybrid.store.hdf5_file import in_memory

_KEPT = 64  # files of 60 kB each; the oldest are deleted
_DIGEST = 32  # bytes before the template, of the template
_SUFFIX = ".template"
_known: dict[tuple[Hashable, ...], bytes] = {}


def template(
    points: int, fields: Sequence[Field], step_fields: Sequence[Field], fixed: Sequence[Field], outputs: int | None,
    resumable: bool, folder: Path | None,
) -> bytes:  # fmt: skip
    """A file in memory with datasets for results at so many points of the output grid.

    outputs: how many, None: not known; resumable: whether it has checkpoints; folder: where templates are kept.
    """
    shape = (points, tuple(fields), tuple(step_fields), tuple(fixed), min(outputs or BLOCK, BLOCK), resumable)
    return kept(shape, lambda: _made(*shape), folder)


def kept(shape: tuple[Hashable, ...], make: Callable[[], bytes], folder: Path | None) -> bytes:
    """What is made of all that shapes it, from this process, from the folder, or made anew."""
    if shape not in _known:
        key = hashlib.sha256(f"{shape} {_makers()}".encode()).hexdigest()[:32]
        if len(_known) >= _KEPT:
            _known.clear()
        _known[shape] = _read(folder, key) or _kept(folder, key, make())
    return _known[shape]


def _made(
    points: int, fields: Sequence[Field], step_fields: Sequence[Field], fixed: Sequence[Field], rows: int,
    resumable: bool,
) -> bytes:  # fmt: skip
    with in_memory() as file:
        create_attributes(file)
        create_scales(file, points, fields, fixed)
        for group, columns in tables_of(fields, step_fields).items():
            create_table(file, group, columns, rows if group in ("/", "zones") else None)
        if resumable:
            create_slots(file)
        file.flush()
        return bytes(file.id.get_file_image())


@cache
def _makers() -> str:
    """All that shapes a template besides what is asked for: versions, and the code that makes it."""
    here = Path(__file__).parent
    code = hashlib.sha256(
        b"".join((here / f"{x}.py").read_bytes() for x in ("template", "format", "checkpoint", "whole_file"))
    )
    return f"{FORMAT_VERSION} {h5py.version.hdf5_version} {versions()} {np.dtype(float).str} {code.hexdigest()}"


def _read(folder: Path | None, key: str) -> bytes:
    """A template that is kept; nothing if it is not there or not as it was written."""
    with suppress(OSError):
        data = (folder / (key + _SUFFIX)).read_bytes() if folder is not None else b""
        if hashlib.sha256(data[_DIGEST:]).digest() == data[:_DIGEST]:
            return data[_DIGEST:]
    return b""


def _kept(folder: Path | None, key: str, made: bytes) -> bytes:
    """The template, kept if it can be; other processes may be doing the same."""
    with suppress(OSError):
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
            old = sorted(folder.glob(f"*{_SUFFIX}"), key=os.path.getmtime)
            for path in old[: max(0, len(old) - _KEPT + 1)]:
                path.unlink(missing_ok=True)
            new = folder / f"{key}.{os.getpid()}.new"
            try:
                new.write_bytes(hashlib.sha256(made).digest() + made)
                os.replace(new, folder / (key + _SUFFIX))
            finally:
                new.unlink(missing_ok=True)
    return made
