"""The file of a result, made in one go of what is in memory: of a short run when it has ended, of others as they begin.

HDF5 takes 20 ms to make the 100 datasets of a line with their units and dimensions, and 3 ms to open them.  So a file
of few lines begins as a template: the bytes of one with all datasets and no values, which the process keeps.

A file that readers may open while it grows is flushed before and after every change of its lengths, and what is known
of a result afterwards goes into a copy.  A run that takes less than the time for which outputs are held back anyhow
needs neither: its result waits in memory (`LateFile`), is added to until all is known, and is then written.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Hashable, Iterator, Mapping
from functools import cache
from pathlib import Path
from time import monotonic
from typing import Any, NamedTuple
from weakref import WeakSet

import h5py
import numpy as np
from h5py import h5a, h5d, h5ds, h5o, h5p, h5s, h5t

from hybrid.store.checkpoint import SLOTS, create_slots, write_before, write_slot
from hybrid.store.format import (
    BLOCK,
    SCALAR,
    STATUS_WIDTHS,
    ArrayContents,
    annotate,
    attach_scales,
    chunk_rows,
    fixed_text,
    made,
    write_texts,
)
from hybrid.store.hdf5_file import GROUP, TOGETHER, image_of, in_memory, replacing
from hybrid.store.integrity import Tree, tail_of
from hybrid.store.recorder import NUMBERS

WAITS = 0.2  # s, that it waits at most while errors of the result are estimated, as outputs are held back
# Bytes of all results in memory whose files are written; of those after them the arrays are read when they are needed.
MOST_STAYING = 256_000_000
_staying: WeakSet[ArrayContents] = WeakSet()
# Lines in a file that begins as a template, and templates that are kept, of 80 kB a line.
MOST_LINES, MOST_KEPT = 8, 64
_kept: dict[Hashable, bytes] = {}


class Restart(NamedTuple):
    """What a run that goes on needs.

    checkpoints: packed, by number; before: what was found before the run.
    """

    checkpoints: dict[int, bytes]
    before: Tree


class LateFile:
    """A result in memory, to be added to until it is written to its place."""

    def __init__(self, path: Path, contents: ArrayContents, restart: Restart | None, outputs: int | None) -> None:
        """path: its place; the others: as of `new_file`."""
        self.path, self.contents, self.placed = path, contents, False
        self._restart, self._outputs = restart, outputs
        self._made = monotonic()  # s

    def leave(self, before: Tree) -> None:
        """What a run that goes on needs is this from now on, until all is done."""
        if self._restart is not None:
            self._restart = self._restart._replace(before=before)

    def data_of(self, line: str) -> dict[str, np.ndarray]:
        """Arrays of a line by name; those of the result itself of the line without a name."""
        contents = self.contents.parts[line] if line else self.contents
        return {name: x.values for name, x in contents.data.items()}

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
        with replacing(self.path, by_hdf5=True) as new:
            image = image_of(new_file(self.contents, self._restart, self._outputs))
            with new.open("wb") as file:
                file.write(image)
                file.write(tail_of(len(image), zlib.crc32(image)))
                file.flush()
                os.fsync(file.fileno())

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


# ---- the file ---------------------------------------------------------------------------------------


def groups_of(contents: ArrayContents) -> Iterator[tuple[str, ArrayContents]]:
    """A result and those of its lines, each with what its names begin with in a file."""
    yield "", contents
    for name, part in contents.parts.items():
        yield f"{GROUP}/{name}/", part


def new_file(contents: ArrayContents, restart: Restart | None, outputs: int | None) -> h5py.File:
    """A file in memory of a result, with the rows that it has.

    restart: None: nobody can go on with it; outputs: their number if it is known, which only makes small files smaller.
    """
    few, groups = len(contents.parts) < MOST_LINES, [*groups_of(contents)]
    shape = (*((group, _shape_of(part)) for group, part in groups), outputs, restart is not None) if few else None
    file, bare = in_memory(_kept.get(shape, b"")), Bare(outputs)
    if shape not in _kept:
        if restart is not None:
            create_slots(file)
        if few:
            for group, part in groups:
                bare.create(file, group, part)
            _keep(shape, file)
    for k, (group, part) in enumerate(groups, 1):
        _fill(file, group, part, {} if few else bare.create(file, group, part))
        if k % TOGETHER == 0:
            file.flush()
    bare.close()
    if contents.parts:
        file[GROUP].attrs["order"] = list(contents.parts)
    if restart is not None:
        slots = [file[name] for name in SLOTS] if restart.checkpoints else []
        for number, data in restart.checkpoints.items():
            write_slot(slots, number, data)
        write_before(file, restart.before)
    return file


def _shape_of(part: ArrayContents) -> Hashable:
    """What the datasets of a result depend on."""
    of_rows = ((x.field, x.dims, x.values.shape[x.grows :], x.grows) for x in part.data.values())
    return tuple(of_rows), tuple(part.groups)


def _keep(shape: Hashable, file: h5py.File) -> None:
    """Keep the bytes of a file that has no values yet."""
    if len(_kept) >= MOST_KEPT:
        _kept.clear()
    file.flush()
    _kept[shape] = bytes(file.id.get_file_image())


class Bare:
    """Datasets of results without values: those of lines that are alike are made once, and copied.

    A copy has no dimension scales, which HDF5 would not translate; they are attached where they stand.
    """

    def __init__(self, outputs: int | None) -> None:
        """outputs: as of `new_file`."""
        self._outputs, self._made = outputs, dict[Hashable, h5py.File]()

    def create(self, file: h5py.File, group: str, part: ArrayContents) -> dict[str, h5d.DatasetID]:
        """The datasets of a result in a file, by name; columns that grow are empty."""
        if group:
            shape = _shape_of(part)
            if shape not in self._made:
                self._made[shape] = in_memory()
                self._datasets(self._made[shape], part)
            h5o.copy(self._made[shape].id, b".", file.id, group.rstrip("/").encode(), None, _links())
            root = file[group].id
            found = {name: h5d.open(root, name.encode()) for name in part.data}
        else:
            found = self._datasets(file, part)
        for name, x in part.data.items():
            if x.dims != (name,):
                attach_scales(found[name], x.dims, [found[dim] for dim in x.dims])
        return found

    def close(self) -> None:
        """Keep nothing any more."""
        for file in self._made.values():
            file.id.close()

    def _datasets(self, root: h5py.File, part: ArrayContents) -> dict[str, h5d.DatasetID]:
        """All of them, by HDF5's own interface: h5py takes four times as long."""
        for name in part.groups:
            root.require_group(name)
        found = dict[str, h5d.DatasetID]()
        for name, x in part.data.items():
            shape, dtype, chunk, most = x.values.shape, x.values.dtype, (), None
            if x.grows:
                if dtype.kind == "S":
                    dtype = h5py.string_dtype("utf-8", dtype.itemsize)
                shape = (0, *shape[1:])
                size = int(dtype.itemsize * np.prod(shape[1:], dtype=int))
                few = self._outputs if x.dims[0] in ("t", "zones/t") else None
                chunk = (max(1, min(chunk_rows(size), BLOCK, few or BLOCK)), *shape[1:])
                most = (h5s.UNLIMITED, *shape[1:])
            kind = NUMBERS.get(x.field.dtype) or h5t.py_create(dtype, logical=True)
            space = h5s.create_simple(shape, most) if shape else SCALAR
            found[name] = data = h5d.create(root.id, name.encode(), kind, space, _creation(chunk), _links())
            annotate(data, x.field.unit, x.field.description, x.field.frame)
            if x.dims == (name,):
                h5ds.set_scale(data, (name.rpartition("/")[2] if x.grows else name).encode())
                h5ds.set_label(data, 0, name.encode())
        return found


@cache
def _creation(chunk: tuple[int, ...]) -> h5p.PropDCID:
    """How a dataset is made of such chunks, or of none."""
    creation = h5p.create(h5p.DATASET_CREATE)
    if chunk:
        creation.set_chunk(chunk)
    return creation


@cache
def _links() -> h5p.PropLCID:
    """Names with slashes make groups."""
    links = h5p.create(h5p.LINK_CREATE)
    links.set_create_intermediate_group(True)
    return links


def _fill(file: h5py.File, group: str, part: ArrayContents, known: Mapping[str, h5d.DatasetID]) -> None:
    """Attributes, texts and values of a result; known: datasets that are open."""
    root = file[group] if group else file
    write_attributes(root, part.attributes)
    write_texts(root, {name: made(text) for name, text in part.texts.items()})
    for name, x in part.data.items():
        if not x.values.size:
            continue
        data = known[name] if known else h5d.open(root.id, name.encode())
        if x.grows:
            data.set_extent(x.values.shape)
        data.write(h5s.ALL, h5s.ALL, np.ascontiguousarray(x.values), NUMBERS.get(x.field.dtype) or data.get_type())


def write_attributes(root: h5py.Group, attributes: Mapping[str, Any]) -> None:
    """Attributes of a result, by HDF5's own interface: h5py takes five times as long."""
    text = h5py.string_dtype()
    for name, value in attributes.items():
        if name in STATUS_WIDTHS:
            array = fixed_text(value, h5py.string_dtype("utf-8", STATUS_WIDTHS[name]))
        else:
            array = np.array(value, text if isinstance(value, str) else None)
        h5a.create(root.id, name.encode(), h5t.py_create(array.dtype, logical=True), SCALAR).write(array)
