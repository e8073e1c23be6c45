"""The file of a result that is complete and in memory, made in one go when the run has ended.

HDF5 takes longer to find room for some hundred arrays, to copy them there and to copy all of that again than a short
run takes to compute them.  So it makes a template: a file with all datasets, whose arrays have their places and no
values, and of which the bytes between these places are kept.  A new file is these bytes, to which HDF5 adds attributes,
texts, rows of tables whose lengths differ from run to run, and checkpoints; the arrays go to the disk from where they
are.

Fields over the outputs have one chunk each, so that a run that goes on can add rows to a copy (store.copying).

A file that readers may open while it grows is flushed before and after every change of its lengths, and what is known
of a result afterwards goes into a copy.  A run that takes less than the time for which outputs are held back anyhow
needs neither: its result waits in memory (`LateFile`), is added to until all is known, and is then written.
"""

from __future__ import annotations

import hashlib
import io
import os
import zlib
from bisect import bisect_right
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from time import monotonic
from typing import Any
from weakref import WeakSet

import h5py
import numpy as np
from h5py import h5a, h5d, h5ds, h5p, h5s, h5t

from hybrid.store.array_contents import ArrayContents, ArrayDataset
from hybrid.store.checkpoint import SLOTS, create_slots, write_before, write_slot
from hybrid.store.format import (
    BLOCK,
    FORMAT_VERSION,
    STATUS_WIDTHS,
    Field,
    annotate,
    attach_scales,
    attributes_of_format,
    create_attributes,
    create_scales,
    create_table,
    fixed_text,
    tables_of,
    versions,
    write_texts,
)
from hybrid.store.hdf5_file import CACHE, LIBVER, beside, in_memory, unwritable
from hybrid.store.hdf5_file import SLOTS as CHUNK_SLOTS
from hybrid.store.integrity import tail_of
from hybrid.store.named_arrays import Tree, pack, unpack
from hybrid.store.recorder import NUMBERS, write_rows

# Tables whose lengths are known when a run has ended: HDF5 writes their rows.
TABLES = ("steps", "zones", "events")
Part = bytearray | memoryview
WAITS = 0.2  # s, that it waits at most while errors of the result are estimated, as outputs are held back
# Bytes of all results in memory whose files are written; of those after them the arrays are read when they are needed.
MOST_STAYING = 256_000_000
_staying: WeakSet[ArrayContents] = WeakSet()


class LateFile:
    """A result in memory, to be added to until it is written to its place."""

    def __init__(
        self, path: Path, contents: ArrayContents, checkpoints: Mapping[int, bytes] | None, before: Tree | None,
        templates: Path | None,
    ) -> None:  # fmt: skip
        """path: its place; checkpoints, before, templates: as of `parts_of_file`."""
        self.path, self.contents, self.placed = path, contents, False
        self._checkpoints, self._templates = checkpoints, templates
        self._made = monotonic()  # s
        self.before = before  # what a run that goes on needs, until all is done

    @property
    def data(self) -> dict[str, np.ndarray]:
        """Its arrays by name."""
        return {name: x.values for name, x in self.contents.data.items()}

    def place_if_due(self) -> None:
        """Put it in its place where it has waited for as long as outputs are held back."""
        if monotonic() - self._made > WAITS:
            self.place()

    def place(self) -> None:
        """Put it in its place, on the disk when this returns; a second call does nothing.

        ResultError: it cannot be written, and is dropped.
        """
        if self.placed:
            return
        self.placed = True
        new = beside(self.path)
        try:
            parts = parts_of_file(self.contents, self._checkpoints, self.before, self._templates)
            size = found = 0
            with new.open("wb") as file:
                for part in parts:
                    file.write(part)
                    size, found = size + len(part), zlib.crc32(part, found)
                file.write(tail_of(size, found))
                file.flush()
                os.fsync(file.fileno())
            os.replace(new, self.path)
        except (OSError, RuntimeError) as error:
            raise unwritable(self.path, error, "free some disk space; close programs that hold the file") from error
        finally:
            new.unlink(missing_ok=True)

    def may_stay(self) -> bool:
        """Whether the contents may stay in memory, where they are read from; a program may keep thousands of results.

        They are then counted until nobody holds them, or they are closed.
        """
        if sum(x.size for x in (*_staying, self.contents)) > MOST_STAYING:
            return False
        _staying.add(self.contents)
        return True

    def drop(self) -> None:
        """Nothing is written of it any more."""
        self.placed = True


def parts_of_file(
    contents: ArrayContents, checkpoints: Mapping[int, bytes] | None, before: Tree | None, templates: Path | None
) -> list[Part]:
    """The bytes of a file, one part after the other; arrays of the contents are among them.

    checkpoints: packed, by the number of the slot; None: nobody can go on with it.  before: as of `Recorder`.
    templates: folder where templates are kept.
    """
    arrays = {name: x for name, x in contents.data.items() if name.split("/")[0] not in TABLES}
    tables = {name: [x.field for x in of_table(contents, name)] for name in TABLES}
    shape = (
        "whole", tuple((x.field, x.dims, x.values.shape, x.grows) for x in arrays.values()),
        tuple((name, *fields) for name, fields in tables.items()), checkpoints is not None,
    )  # fmt: skip
    plan = unpack(kept(shape, lambda: _made(arrays, tables, checkpoints is not None), templates))
    pieces = _Pieces(plan)
    with h5py.File(pieces, "r+", libver=LIBVER, rdcc_nbytes=CACHE, rdcc_nslots=CHUNK_SLOTS) as file:
        write_attributes(file, contents.attributes)
        write_texts(file, {name: contents.text(name) for name in contents.texts})
        for name in TABLES:
            _write_table(file, of_table(contents, name))
        slots = [file[name] for name in SLOTS] if checkpoints else []
        for number, data in (checkpoints or {}).items():
            write_slot(slots, number, data)
        write_before(file, before)
    return list(pieces.with_arrays([arrays[name].values for name in plan["names"]]))


def of_table(contents: ArrayContents, table: str) -> list[ArrayDataset]:
    """Columns of a table, the scale first."""
    found = [x for name, x in contents.data.items() if name.startswith(f"{table}/")]
    return sorted(found, key=lambda x: len(x.dims) > 1 or x.dims != (x.field.name,))


def write_attributes(file: h5py.File, attributes: Mapping[str, Any]) -> None:
    """Root attributes besides those of all files, by HDF5's own interface: h5py takes five times as long."""
    text, scalar, always = h5py.string_dtype(), h5s.create(h5s.SCALAR), attributes_of_format()
    for name, value in attributes.items():
        if name in always:
            continue
        if name in STATUS_WIDTHS:
            array = fixed_text(value, h5py.string_dtype("utf-8", STATUS_WIDTHS[name]))
        else:
            array = np.array(value, text if isinstance(value, str) else None)
        h5a.create(file.id, name.encode(), h5t.py_create(array.dtype, logical=True), scalar).write(array)


def _write_table(file: h5py.File, columns: Sequence[ArrayDataset]) -> None:
    for x in columns if columns and len(columns[0].values) else ():
        data = h5d.open(file.id, x.field.name.encode())
        data.set_extent(x.values.shape)
        write_rows(data, 0, np.ascontiguousarray(x.values), NUMBERS.get(x.field.dtype) or data.get_type())


# ---- the template ---------------------------------------------------------------------------------


def _made(arrays: Mapping[str, ArrayDataset], tables: Mapping[str, Sequence[Field]], resumable: bool) -> bytes:
    """A file without the values of its arrays: names and places of these, and what is between them."""
    memory = io.BytesIO()
    with h5py.File(memory, "w", libver=LIBVER) as file:
        for name, value in attributes_of_format().items():
            file.attrs[name] = value
        made = dict[str, h5d.DatasetID]()  # to find them anew by their names takes a third of the time
        for name, x in sorted(arrays.items(), key=lambda item: item[1].dims != (item[0],)):  # scales first
            made[name] = data = _create(file, x)
            if x.dims == (name,):
                h5ds.set_scale(data, name.encode())
                h5ds.set_label(data, 0, name.encode())
            else:
                attach_scales(data, x.dims, [made[dim] for dim in x.dims])
        for name, fields in tables.items():
            rows = len(arrays["t"].values) if name == "zones" else None  # as of a file that grows
            create_table(file, name, [_within(name, field) for field in fields], rows)
        if resumable:
            create_slots(file)
        places = sorted((_place(made[name]), name) for name, x in arrays.items() if x.values.size)
        made.clear()
    content = memory.getbuffer()
    begins, pieces, at = [0], [], 0
    for place, name in places:
        pieces.append(bytes(content[at:place]))
        at = place + arrays[name].values.nbytes
        begins.append(at)
    pieces.append(bytes(content[at:]))
    plan = {"names": [name for _, name in places], "begins": begins, "sizes": [len(x) for x in pieces]}
    return pack({**plan, "bytes": np.frombuffer(b"".join(pieces), "u1")})


def _within(group: str, field: Field) -> Field:
    return Field(**{**vars(field), "name": field.name.removeprefix(f"{group}/")})


def _create(file: h5py.File, x: ArrayDataset) -> h5d.DatasetID:
    """A dataset whose numbers have their place, where nothing is written."""
    shape, dtype = x.values.shape, x.values.dtype
    if dtype.kind == "S" and x.grows:
        dtype = h5py.string_dtype("utf-8", dtype.itemsize)
    kind = NUMBERS.get(x.field.dtype) or h5t.py_create(dtype, logical=True)
    how, links = h5p.create(h5p.DATASET_CREATE), h5p.create(h5p.LINK_CREATE)
    links.set_create_intermediate_group(True)
    most: tuple[int, ...] | None = None
    if x.grows:
        most = (h5s.UNLIMITED, *shape[1:])
        how.set_chunk(tuple(max(n, 1) for n in shape))
    how.set_alloc_time(h5d.ALLOC_TIME_EARLY)
    how.set_fill_time(h5d.FILL_TIME_NEVER)
    space = h5s.create_simple(shape, most) if shape else h5s.create(h5s.SCALAR)
    data = h5d.create(file.id, x.field.name.encode(), kind, space, how, links)
    annotate(data, x.field.unit, x.field.description, x.field.frame)
    return data


def _place(data: h5d.DatasetID) -> int:
    """Where in the file the numbers of a dataset are."""
    if data.get_create_plist().get_layout() == h5d.CHUNKED:
        return int(data.get_chunk_info(0).byte_offset)
    return int(data.get_offset())


class _Pieces(io.RawIOBase):
    """A file as HDF5 sees it, of which only the pieces between arrays are there; the last one grows."""

    def __init__(self, plan: Tree) -> None:
        content, ends = plan["bytes"].tobytes(), np.cumsum(plan["sizes"]).tolist()
        self._begins = plan["begins"]
        self._pieces = [bytearray(content[a:b]) for a, b in zip([0, *ends], ends, strict=False)]
        self._at = 0

    @property
    def _end(self) -> int:
        return int(self._begins[-1]) + len(self._pieces[-1])

    def _piece(self) -> tuple[bytearray, int, bool]:
        """The piece with the present place, where in it that is, and whether it is the last."""
        k = bisect_right(self._begins, self._at) - 1
        return self._pieces[k], self._at - self._begins[k], k == len(self._pieces) - 1

    def seek(self, at: int, whence: int = io.SEEK_SET) -> int:
        self._at = self._end if whence == io.SEEK_END else at
        return self._at

    def tell(self) -> int:
        return self._at

    def readinto(self, out: Any) -> int:
        piece, first, _ = self._piece()  # what HDF5 reads beyond a piece to save a second look, it does not use
        out[:] = piece[first : first + len(out)].ljust(len(out), b"\0")
        return len(out)

    def write(self, data: Any) -> int:
        piece, first, last = self._piece()
        if first + len(data) > len(piece) and not last:
            raise OSError(f"bytes {self._at} to {self._at + len(data)} of a file belong to an array")
        if first > len(piece):
            piece.extend(bytes(first - len(piece)))
        piece[first : first + len(data)] = data
        return len(data)

    def truncate(self, size: int | None = None) -> int:
        more = (self._at if size is None else size) - self._end
        if more > 0:
            self._pieces[-1].extend(bytes(more))
        elif more < 0:
            del self._pieces[-1][more:]
        return self._end

    def flush(self) -> None:
        """Nothing waits."""

    def with_arrays(self, arrays: Sequence[np.ndarray]) -> Iterator[Part]:
        """The pieces, and the arrays between them."""
        for piece, array in zip(self._pieces, arrays, strict=False):
            yield piece
            yield np.ascontiguousarray(array).reshape(-1).view(np.uint8).data
        yield self._pieces[-1]


# Templates of result files: a file with all its datasets and no values, which a new result begins as.
#
# HDF5 takes 20 ms to make the 60 datasets of a result with their units and dimensions, and 1 ms to open a file that has
# them.  So the bytes of a new file are kept, in this process and in a folder, under a key made of all that shapes them.
# A template that is missing, cut off or spoilt is made anew; one that cannot be kept is made every time.

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
    return kept(shape, lambda: _new_template(*shape), folder)


def kept(shape: tuple[Hashable, ...], make: Callable[[], bytes], folder: Path | None) -> bytes:
    """What is made of all that shapes it, from this process, from the folder, or made anew."""
    if shape not in _known:
        key = hashlib.sha256(f"{shape} {_makers()}".encode()).hexdigest()[:32]
        if len(_known) >= _KEPT:
            _known.clear()
        _known[shape] = _read(folder, key) or _kept(folder, key, make())
    return _known[shape]


def _new_template(
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
    code = hashlib.sha256(b"".join((here / f"{x}.py").read_bytes() for x in ("format", "checkpoint", "whole_file")))
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
