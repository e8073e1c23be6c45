"""Whether a result file is as it was written, and bytes of named arrays.

A file is checked before HDF5 touches it.  HDF5 checks its own tables, but not the numbers: a byte that has changed on a
disk or on the way would be another result.  And over tables that are spoilt it may crash or never come back
(tests/harden/test_harden_files.py counts).  So a closed file has a few bytes behind its end (HDF5 ignores them) with
the CRC-32 of all the others, which is compared before it is opened; a very long file is asked for its length only.

A file that is marked as being written can be opened by readers alone who read it as such (SWMR): HDF5 then reads
a table again and again until its checksum is right, waiting twice as long each time, so a file that a killed process
left and that is cut off or spoilt never opens (61 of 200 variants).  So only a file whose writer is alive is read like
that; of one that was left the mark is taken away, in a copy in memory, and HDF5 reads every table once.
The mark stands in the first 48 bytes (superblock, version 3 of the HDF5 file format specification).

Bytes of named arrays and plain values are read without any trust in them.  A tree is a dict of names to arrays,
numbers, texts, None, lists and dicts of these.  As bytes it is a magic word with the number of the format, a digest of
what follows, the length of what follows, the length of the head (8 bytes each, little endian), the head (the tree as
JSON, in which an array is {"@array": [dtype, shape, offset]}) and the arrays, one after the other.  Nothing in them
names a class or a function, and no array is longer than the bytes that are there.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import os
import shutil
import struct
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import h5py
import numpy as np

from hybrid.errors import ResultError

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_SIZE = 48  # bytes of the superblock, its checksum the last four
_BEING_WRITTEN = 1  # bit of its flags
_TAIL = struct.Struct("<12sQI")  # a name, the bytes before it, and their sum
_NAME = b"hybrid-crc32"
# Bytes that are summed before a file is opened, in half a second or less; to read a longer one twice would be felt.
_SUMMED = 500_000_000
# Bytes that the file of a writer who ran out of room lacks at most: what one flush writes; the rest is good.
_LACKING = 1 << 24
_PIECE = 1 << 17  # bytes read at a time, of which the processor's cache has room


def being_written(path: Path, summed: bool = True) -> bool:
    """Whether a file has a writer, alive or killed; ResultError when it is no HDF5 file, spoilt or cut off.

    summed: whether its bytes are held against its sum.
    """
    with path.open("rb") as file:
        head = file.read(_SIZE)
        size = file.seek(0, 2)
    wrong = f"{path} cannot be read as a result\n    detail:   "
    other = "\n    expected: an HDF5 file written by hybrid\n    try:      copy it anew, or run its scene again"
    if path.suffix.lower() in (".yaml", ".yml") and not head.startswith(_SIGNATURE):
        written = path.with_suffix(".h5").name
        advice = f"run it first: `hybrid run {path.name}` writes {written}, which can be read here"
        raise ResultError(
            f"{path} is a scene, not a result\n    expected: an HDF5 file written by hybrid\n    try:      {advice}"
        )
    if not head.startswith(_SIGNATURE):
        raise ResultError(f"{wrong}it does not begin as HDF5 files do{other}")
    if len(head) == _SIZE and head[8] != 3:
        return False  # another program's: what HDF5 says of it will do
    if len(head) < _SIZE or _lookup3(head[:44]) != struct.unpack("<I", head[44:])[0]:
        raise ResultError(f"{wrong}its beginning is spoilt{other}")
    end, writing = struct.unpack("<Q", head[28:36])[0], bool(head[11] & _BEING_WRITTEN)
    if end > size + (_LACKING if writing else 0):
        raise ResultError(f"{wrong}it is cut off: {size} of {end} bytes are there{other}")
    if writing:
        return True
    if summed and _has_changed(path, end, size):
        raise ResultError(f"{wrong}it has changed since it was written, on the disk or on the way{other}")
    return False


def unmarked(path: Path) -> bytes:
    """The bytes of a file that a killed process left, as if it had been closed there."""
    content = bytearray(path.read_bytes())
    content[11] = 0
    content[28:36] = struct.pack("<Q", len(content))  # what was added last may lie behind the end that it states
    content[44:48] = struct.pack("<I", _lookup3(bytes(content[:44])))
    return bytes(content)


def sign_new(path: Path) -> None:
    """Put the sum of a closed file, which is not in its place yet, behind its end; OSError: it cannot be written."""
    with path.open("r+b") as file:
        size = file.seek(0, 2)
        file.write(_TAIL.pack(_NAME, size, _sum_of(file, size)))


def sign(path: Path) -> None:
    """The same of a file in its place; ResultError."""
    try:
        sign_new(path)
    except OSError as error:
        advice = "free some disk space; the result is complete but for this sum"
        raise ResultError(f"{path} cannot be written\n    detail:   {error}\n    try:      {advice}") from error


def is_signed(path: Path) -> bool:
    """Whether the sum of a closed file is behind its end, right or wrong: only results have one."""
    with path.open("rb") as file:
        head, size = file.read(_SIZE), file.seek(0, 2)
        if not head.startswith(_SIGNATURE) or size < _SIZE + _TAIL.size:
            return False
        file.seek(size - _TAIL.size)
        name, length, _ = _TAIL.unpack(file.read(_TAIL.size))
    return bool(name == _NAME and length == size - _TAIL.size)


def copy_unsigned(path: Path, new: Path) -> None:
    """Copy a file that was written just now without the sum behind its end.  ResultError: it is no such file."""
    being_written(path, summed=False)
    shutil.copyfile(path, new)
    with path.open("rb") as file:
        end = struct.unpack("<Q", file.read(_SIZE)[28:36])[0]
    os.truncate(new, end)


def _has_changed(path: Path, end: int, size: int) -> bool:
    """Whether a file has something behind its end that is not its sum; without anything there, nothing is known."""
    if size == end:
        return False
    with path.open("rb") as file:
        file.seek(end)
        tail = file.read(_TAIL.size + 1)
        if len(tail) != _TAIL.size:
            return True
        name, length, wanted = _TAIL.unpack(tail)
        return bool(name != _NAME or length != end or (end <= _SUMMED and wanted != _sum_of(file, end)))


def _sum_of(file: BinaryIO, length: int) -> int:
    """CRC-32 of the first bytes of a file; what is written next goes behind them."""
    file.seek(0)
    found, left, room = 0, length, memoryview(bytearray(min(length, _PIECE)))
    while left:
        count = file.readinto(room[: min(left, _PIECE)])  # type: ignore[attr-defined]
        if not count:  # it has become shorter meanwhile
            break
        found, left = zlib.crc32(room[:count], found), left - count
    return found


def stored(file: h5py.File, name: str) -> h5py.Dataset | None:
    """A dataset that is in the file itself; None if nothing has this name.  ResultError as of `check_stored`."""
    item: Any = file
    for part in name.split("/"):
        link = item.get(part, getlink=True) if isinstance(item, h5py.Group) else None
        if link is None:
            return None
        if not isinstance(link, h5py.HardLink):
            raise _foreign(file, name, "is a link")
        item = item[part]
    if not isinstance(item, h5py.Dataset):
        raise _foreign(file, name, "is no dataset")
    check_stored(item, item.size or 0)
    return item


def check_stored(data: h5py.Dataset, count: int) -> None:
    """ResultError unless the file holds the bytes of the first `count` numbers of a dataset, as they are.

    Numbers in another file could be anybody's, and a few bytes can state a length, or unpack to one, that fills memory.
    """
    if data.shape is None:
        raise _foreign(data.file, data.name, "has no values")
    if data.is_virtual or data.external:
        raise _foreign(data.file, data.name, "lies in another file")
    if data.id.get_create_plist().get_nfilters():
        raise _foreign(data.file, data.name, "is compressed")
    there = min(data.id.get_storage_size(), data.file.id.get_filesize())
    if count * data.dtype.itemsize > there:
        raise _foreign(data.file, data.name, f"states {count} numbers, of which at most {there} bytes are there")


def _foreign(file: h5py.File, name: str, why: str) -> ResultError:
    return ResultError(
        f"{file.filename} cannot be resumed\n    detail:   {name.lstrip('/')} {why}\n"
        "    try:      the file as hybrid wrote it, or run its scene again"
    )


@contextmanager
def readable(source: object) -> Iterator[None]:
    """What HDF5, or what makes sense of its tables, raises over a spoilt file, as a ResultError."""
    try:
        yield
    except ResultError:
        raise
    except Exception as error:  # a table that is spoilt may say anything, and fail anywhere
        said = str(error).splitlines()
        name = source if isinstance(source, Path) else "the file in memory"
        raise ResultError(
            f"{name} is spoilt and cannot be read\n    detail:   {said[0] if said else type(error).__name__}\n"
            "    try:      copy it anew, or run its scene again"
        ) from error


def _lookup3(data: bytes) -> int:
    """The checksum of HDF5's tables: Bob Jenkins' lookup3 of 2006 (public domain), for whole words of 4 bytes."""
    mask = 0xFFFFFFFF

    def turn(x: int, k: int) -> int:
        return ((x << k) | (x >> (32 - k))) & mask

    words = list(struct.unpack(f"<{len(data) // 4}I", data))
    a = b = c = (0xDEADBEEF + len(data)) & mask
    while len(words) > 3:
        a, b, c = (a + words[0]) & mask, (b + words[1]) & mask, (c + words[2]) & mask
        for k in (4, 6, 8, 16, 19, 4):
            a = ((a - c) & mask) ^ turn(c, k)
            c = (c + b) & mask
            a, b, c = b, c, a
        words = words[3:]
    a, b, c = ((x + y) & mask for x, y in zip((a, b, c), [*words, 0, 0], strict=False))
    for k in (14, 11, 25, 16, 4, 14, 24):
        c = ((c ^ b) - turn(b, k)) & mask
        a, b, c = b, c, a
    return b


MAGIC = b"hybrid checkpoint 2\n"
DIGEST = 16  # bytes; it guards against a torn write, not against people
DTYPES = {name: np.dtype(name) for name in ("<f8", "<i8", "<i4", "|i1", "|u1", "|b1")}
MOST_DIMENSIONS = 4
ARRAY = "@array"

Tree = dict[str, Any]


def pack(tree: Mapping[str, Any]) -> bytes:
    """A tree as bytes."""
    arrays = io.BytesIO()
    head = json.dumps(_plain(tree, arrays)).encode()
    body: list[bytes | memoryview] = [len(head).to_bytes(8, "little"), head, arrays.getbuffer()]
    body.insert(0, (len(body[0]) + len(head) + arrays.tell()).to_bytes(8, "little"))
    digest = hashlib.blake2b(digest_size=DIGEST)
    for part in body:
        digest.update(part)
    return b"".join([MAGIC, digest.digest(), *body])


def _plain(x: Any, arrays: io.BytesIO) -> Any:
    """What JSON can write; the bytes of arrays are added to `arrays`."""
    if isinstance(x, np.ndarray):
        name = x.dtype.newbyteorder("<").str
        if name not in DTYPES:
            raise TypeError(f"an array of type {x.dtype} cannot be in a checkpoint")
        at = arrays.tell()
        arrays.write(np.ascontiguousarray(x, name).reshape(-1).view("u1").data)
        return {ARRAY: [name, list(x.shape), at]}
    if isinstance(x, np.generic):
        return x.item()
    if isinstance(x, list | tuple):
        return [_plain(value, arrays) for value in x]
    if x is None or isinstance(x, str | int | float):  # much sooner answered than whether it is a mapping
        return x
    return {name: _plain(value, arrays) for name, value in x.items()} if isinstance(x, Mapping) else x


def unpack(data: bytes) -> Tree:
    """The tree again; what follows it in `data` is not read.  ValueError if the bytes are none, or spoilt."""
    begin = len(MAGIC) + DIGEST
    kind, _, number = data[: len(MAGIC)].rpartition(b" ")
    if kind == MAGIC.rpartition(b" ")[0] and data[: len(MAGIC)] != MAGIC:
        theirs, ours = number.decode("ascii", "replace").strip(), MAGIC.split()[-1].decode()
        raise ValueError(f"it has checkpoint format {theirs}; this program reads format {ours}")
    if not data.startswith(MAGIC):
        raise ValueError("it does not begin as a checkpoint does")
    body = data[begin : begin + 8 + int.from_bytes(data[begin : begin + 8], "little")]
    if hashlib.blake2b(body, digest_size=DIGEST).digest() != data[len(MAGIC) : begin]:
        raise ValueError("its digest is another: it was cut off, or has changed")
    split = 16 + int.from_bytes(body[8:16], "little")
    try:
        found = _with_arrays(json.loads(body[16:split]), memoryview(body)[split:])
    except RecursionError as error:
        raise ValueError(str(error)) from None
    if not isinstance(found, dict):
        raise ValueError("it is no table of names")
    return found


def _with_arrays(x: Any, arrays: memoryview) -> Any:
    """What JSON has read, with its arrays."""
    if isinstance(x, list):
        return [_with_arrays(value, arrays) for value in x]
    if isinstance(x, dict):
        if x.keys() == {ARRAY}:
            return _array(x[ARRAY], arrays)
        return {name: _with_arrays(value, arrays) for name, value in x.items()}
    if isinstance(x, int) and x.bit_length() > 63:
        raise ValueError("a number has more than 64 bits")
    return x


def _array(said: Any, data: memoryview) -> np.ndarray:
    """An array; what is `said` of it: type, shape, where its bytes begin."""
    if not (isinstance(said, list) and len(said) == 3 and isinstance(said[0], str) and isinstance(said[1], list)):
        raise ValueError("an array has no type, shape and place")
    name, shape, at = said
    counts = [*shape, at]
    if name not in DTYPES or len(shape) > MOST_DIMENSIONS or not all(type(x) is int and x >= 0 for x in counts):
        raise ValueError(f"an array of type {name!r:.20} and shape {shape!s:.60} is none")
    end = at + math.prod(shape) * DTYPES[name].itemsize
    if end > len(data) or max(shape, default=0) > len(data):
        raise ValueError(f"an array of shape {shape!s:.60} has more numbers than are there")
    array = np.frombuffer(data[at:end], DTYPES[name]).reshape(shape).copy()
    if name == "|b1":
        array = array.view(np.uint8) != 0  # any other byte than 0 and 1 would be neither true nor false
    return array


def matched(saved: Any, template: Any, where: str = "") -> Any:
    """`saved`, if it has the form of `template`: the same names, types and shapes; ValueError where it has not.

    Numbers must be finite where those of the template are.  None in the template stands for what its owner checks, and
    so does an array of no size.
    """
    if template is None:
        return saved
    if isinstance(template, Mapping):
        if not isinstance(saved, dict) or saved.keys() != template.keys():
            raise _odd(where, "a table of " + ", ".join(template), saved)
        return {name: matched(saved[name], x, f"{where}/{name}" if where else name) for name, x in template.items()}
    if isinstance(template, list | tuple):
        if not isinstance(saved, list) or len(saved) != len(template):
            raise _odd(where, f"a list of {len(template)}", saved)
        return [matched(x, y, f"{where}/{k}") for k, (x, y) in enumerate(zip(saved, template, strict=True))]
    if isinstance(template, np.ndarray):
        good = isinstance(saved, np.ndarray) and saved.dtype == template.dtype
        if not good or (template.size and saved.shape != template.shape):
            raise _odd(where, f"{template.dtype} of shape {template.shape}", saved)
    elif type(saved) is not type(template.item() if isinstance(template, np.generic) else template):
        raise _odd(where, type(template).__name__, saved)
    if isinstance(saved, float | np.ndarray) and not _finite(saved, template):
        raise _odd(where, "finite numbers", saved)
    return saved


def _finite(x: Any, template: Any) -> bool:
    if np.isfinite(x).all():
        return True
    return bool((np.isnan(template).any() or not np.isnan(x).any()) and not np.isfinite(template).all())


def _odd(where: str, expected: str, given: Any) -> ValueError:
    what = f"{given.dtype} of shape {given.shape}" if isinstance(given, np.ndarray) else f"{given!r:.40}"
    return ValueError(f"{where or 'it'}: expected {expected}, found {what}")
