"""Checkpoints in a result file: bytes from which a run goes on, kept so that a kill at any instant leaves one whole.

Two slots are written in turn, each with its own length and digest, so a slot that a kill has cut off is recognised
and the other is as good as it was.  A head, readable without knowing what the bytes mean, says which program wrote
them and how many rows of the file belong to them.

A file that a killed process was writing cannot be opened for writing again; what goes on is a copy of its rows up to
the checkpoint (`copied`), put in its place when it is whole.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from glob import escape
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
from filelock import FileLock, Timeout

from hybrid.errors import ResultError, ResultHeld

SLOTS, CLIMB = ("checkpoint/slot_0", "checkpoint/slot_1"), "checkpoint/climb"
_MAGIC = b"hybrid checkpoint 1\n"
_DIGEST = 16  # bytes; it guards against a torn write, not against people
_CHUNK = 65536  # bytes: few chunks for the 200 kB of a line of 100 cells
_BLOCK = 1 << 22  # bytes that are copied at a time


class Checkpoint(NamedTuple):
    """What a run goes on from.

    number: it counts up; t: s; program: which wrote it; asks: whether it needs a user's criterion; files: digests of
    the files that it reads, by path; rows: of every table of the file that belong to it; happened: events by kind,
    those not written included; zones: (kind, s_a, s_b) of the last output; effort, state: bytes, how finely it is
    computed and where it is.
    """

    number: int
    t: float
    program: str
    asks: bool
    files: dict[str, str]
    rows: dict[str, int]
    happened: dict[str, int]
    zones: list[tuple[str, float, float]]
    effort: bytes
    state: bytes


def create_slots(file: h5py.File, climb: bytes) -> None:
    """Make room for checkpoints in a new file; climb: what was found before the run, b"" if nothing."""
    for name in SLOTS:
        file.create_dataset(name, (0,), "u1", maxshape=(None,), chunks=(_CHUNK,)).make_scale(name)
    write_climb(file, climb)


def write_climb(file: h5py.File, climb: bytes) -> None:
    """Write what was found before the run.  A dataset is a scale of itself: programs look for dimensions."""
    if climb:
        file.create_dataset(CLIMB, data=np.frombuffer(climb, "u1")).make_scale(CLIMB)


def write_checkpoint(file: h5py.File, point: Checkpoint) -> None:
    """Write a checkpoint over the older of the two."""
    head = json.dumps({name: x for name, x in point._asdict().items() if not isinstance(x, bytes)}).encode()
    parts = (head, point.effort, point.state)
    body = b"".join([*(len(x).to_bytes(8, "little") for x in parts), *parts])
    data = _MAGIC + hashlib.blake2b(body, digest_size=_DIGEST).digest() + body
    slot = file[SLOTS[int(point.number) % 2]]
    if slot.shape[0] < len(data):
        slot.resize(len(data), axis=0)
    slot[: len(data)] = np.frombuffer(data, "u1")


def read_checkpoint(file: h5py.File) -> Checkpoint | None:
    """The newest checkpoint that is whole and whose rows are all there; None if there is none."""
    points = []
    for name in SLOTS:
        if name in file:
            if file.swmr_mode:
                file[name].refresh()
            point = _parsed(file[name][()].tobytes())
            if point is not None and _has_rows(file, point):
                points.append(point)
    return max(points, key=lambda point: point.number, default=None)


def climb_of(file: h5py.File) -> bytes:
    """What was found before the run; b"" when all is done."""
    return file[CLIMB][()].tobytes() if CLIMB in file else b""


def _parsed(data: bytes) -> Checkpoint | None:
    if not data.startswith(_MAGIC):
        return None
    begin = len(_MAGIC) + _DIGEST
    sizes = [int.from_bytes(data[begin + k : begin + k + 8], "little") for k in (0, 8, 16)]
    body = data[begin : begin + 24 + sum(sizes)]
    if hashlib.blake2b(body, digest_size=_DIGEST).digest() != data[len(_MAGIC) : begin]:
        return None
    cuts = [24, *(24 + sum(sizes[: k + 1]) for k in range(3))]
    head, effort, state = (body[i:j] for i, j in pairwise(cuts))
    try:
        found = json.loads(head)
        point = Checkpoint(**found | {"zones": [tuple(z) for z in found["zones"]], "effort": effort, "state": state})
    except (ValueError, TypeError, KeyError, AttributeError):
        return None
    good = isinstance(point.number, int) and isinstance(point.t, float) and isinstance(point.program, str)
    good = good and all(isinstance(x, dict) for x in (point.files, point.rows, point.happened))
    counts = [*point.rows.values(), *point.happened.values()] if good else []
    return point if good and all(isinstance(x, int) and x >= 0 for x in counts) else None


def _has_rows(file: h5py.File, point: Checkpoint) -> bool:
    for scale, count in point.rows.items():
        data = file.get(scale)
        if not isinstance(data, h5py.Dataset):
            return False
        if file.swmr_mode:
            data.refresh()
        if data.shape[0] < count:
            return False
    return True


def copied(
    old: h5py.File, path: Path, libver: tuple[str, str], rows: Mapping[str, int] | None, without: Iterable[str] = ()
) -> None:
    """Copy a result to a new file; rows: of every table that are taken, by its scale (None: all that are complete)."""
    left = set(without)
    whole = [(name, data) for name, data in _datasets(old) if name not in left]
    scales = [name for name, data in whole if data.attrs.get("CLASS") == b"DIMENSION_SCALE"]
    kept = {name: int(old[name].shape[0]) for name in scales} | dict(rows or {})
    with h5py.File(path, "w", libver=libver, locking="best-effort") as new:
        _annotations(old, new)
        for name, data in whole:
            _copied_dataset(data, new, name, kept)
        for name in scales:
            new[name].make_scale(_word(old[name].attrs.get("NAME", name)))
        for name, data in whole:
            for k, dim in enumerate(data.dims):
                new[name].dims[k].label = dim.label
                if dim.label in kept and dim.label != name:
                    new[name].dims[k].attach_scale(new[dim.label])


def names_in(file: h5py.File, group: str) -> list[str]:
    """Names of all datasets in a group."""
    return [name for name, _ in _datasets(file) if name.startswith(f"{group}/")]


def _datasets(file: h5py.File) -> Iterator[tuple[str, h5py.Dataset]]:
    found: list[tuple[str, h5py.Dataset]] = []
    file.visititems(lambda name, item: found.append((name, item)) if isinstance(item, h5py.Dataset) else None)
    if file.swmr_mode:
        for _, data in found:
            data.refresh()
    return iter(found)


def _copied_dataset(data: h5py.Dataset, new: h5py.File, name: str, kept: Mapping[str, int]) -> None:
    first = data.dims[0].label if data.ndim else ""
    count = min(kept.get(first, data.shape[0]), data.shape[0]) if data.ndim else 0
    shape = (count, *data.shape[1:]) if data.ndim else ()
    grows = data.chunks is not None
    copy = new.create_dataset(
        name, shape, data.dtype, maxshape=data.maxshape if grows else None, chunks=data.chunks if grows else None
    )
    if not data.ndim:
        copy[()] = data[()]
    else:
        block = max(1, _BLOCK // max(1, data.dtype.itemsize * int(np.prod(data.shape[1:], dtype=int))))
        for a in range(0, count, block):
            copy[a : min(a + block, count)] = data[a : min(a + block, count)]
    _annotations(data, copy)


def _annotations(old: Any, new: Any) -> None:
    """Attributes but those that HDF5 keeps for dimension scales."""
    for key, value in old.attrs.items():
        if key not in ("CLASS", "NAME", "REFERENCE_LIST", "DIMENSION_LIST", "DIMENSION_LABELS"):
            new.attrs.create(key, value, dtype=old.attrs.get_id(key).dtype)


def _word(value: Any) -> str:
    return value.decode() if isinstance(value, bytes) else str(value)


def digest_of(path: Path) -> str:
    """Digest of a file's content; "" if it is not there."""
    try:
        return hashlib.blake2b(path.read_bytes(), digest_size=_DIGEST).hexdigest()
    except OSError:
        return ""


@contextmanager
def claimed(path: Path | None) -> Iterator[None]:
    """Hold a result for writing, against other processes, until the end; ResultError if one holds it."""
    if path is None:
        yield
        return
    beside = path.with_name(f".{path.name}.lock")
    lock = FileLock(beside, timeout=0)
    try:
        lock.acquire()
    except Timeout:
        advice = "another name with -o, or wait until it has ended"
        raise ResultHeld(f"{path} is being written by another process\n    try:      {advice}") from None
    except OSError as error:
        advice = "a folder you may write to, with free space"
        raise ResultError(f"{path} cannot be written\n    detail:   {error}\n    try:      {advice}") from error
    try:
        for left in path.parent.glob(f".{escape(path.name)}.[0-9]*.new"):  # of a process that was killed
            left.unlink(missing_ok=True)
        yield
    finally:
        beside.unlink(missing_ok=True)
        lock.release()
