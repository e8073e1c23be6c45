"""How the file of a result comes to be whole: made in one go of what is in memory, and checkpoints to go on from.

HDF5 takes 20 ms to make the 100 datasets of a line with their units and dimensions, 3 ms to open them, and 2 to write.
So a file of few lines begins as a template: the bytes of one with all datasets and no values, which the process keeps.
Where all is complete, HDF5 has said where in it the values belong, and they are put there without it.

A file that readers may open while it grows is flushed before and after every change of its lengths, and what is known
of a result afterwards goes into a copy.  A run that takes less than the time for which outputs are held back anyhow
needs neither: its result waits in memory (`LateFile`), is added to until all is known, and is then written.

Checkpoints are kept so that a kill at any instant leaves one whole.
Two slots are written in turn, each with its own length and digest (store.integrity), so a slot that a kill has cut
off is recognised and the other is as good as it was.

A file that a killed process was writing cannot be opened for writing again; what goes on is a copy of its rows up to
the checkpoint (store.hdf5_file), put in its place when it is whole.
"""

from __future__ import annotations

import hashlib
import io
import os
from collections.abc import Collection, Hashable, Iterator, Mapping, Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path
from time import monotonic
from typing import Any, NamedTuple
from weakref import WeakSet

import h5py
import numpy as np
from h5py import h5a, h5d, h5ds, h5o, h5p, h5s, h5t

from hybrid.errors import ResultError
from hybrid.store.format import (
    BLOCK,
    KIND_OF_TEXT,
    SCALAR,
    STATUS_WIDTHS,
    TEXT,
    ArrayContents,
    ArrayDataset,
    Field,
    annotate,
    attach_scales,
    check_column,
    chunk_rows,
    fixed_text,
    made,
    plain_text,
    write_texts,
)
from hybrid.store.hdf5_file import GROUP, TOGETHER, drafted, image_of, in_memory, of_all, replacing
from hybrid.store.integrity import DIGEST, Tree, matched, pack, sign_new, stored, unpack
from hybrid.store.recorder import NUMBERS, write_rows

# --- checkpoints -------------------------------------------------------------------------------

# What was found before the run (the error controller's runs), beside the two slots.
SLOTS, BEFORE = ("checkpoint/slot_0", "checkpoint/slot_1"), "checkpoint/before"
_CHUNK = 65536  # bytes: one or two chunks for the 50 kB of a line of 100 cells


class Checkpoint(NamedTuple):
    """What a run goes on from.

    number: it counts up; t: s; program: which wrote it; asks: whether it needs a user's criterion; files: digests of
    the files that it reads, by path; rows: of every table of the file that belong to it; happened: events by kind,
    those not written included; zones: (kind, s_a, s_b) of the last output; resolution, state: how finely it is computed
    and where it is, for whoever computes.
    """

    number: int
    t: float
    program: str
    asks: bool
    files: dict[str, str]
    rows: dict[str, int]
    happened: dict[str, int]
    zones: list[tuple[str, float, float]]
    resolution: Tree
    state: Tree


def create_slots(file: h5py.File) -> None:
    """Make room for checkpoints in a new file."""
    for name in SLOTS:
        file.create_dataset(name, (0,), "u1", maxshape=(None,), chunks=(_CHUNK,)).make_scale(name)


def write_before(file: h5py.File, before: Tree | None) -> None:
    """Keep what was found before the run in a new file; nothing if that is nothing."""
    if before:  # a dataset is a scale of itself: programs look for dimensions
        file.create_dataset(BEFORE, data=np.frombuffer(pack(before), "u1")).make_scale(BEFORE)


def read_before(file: h5py.File) -> Tree:
    """What was found before the run; {} when all is done."""
    data = _read(file, BEFORE)
    try:
        return unpack(data) if data else {}
    except ValueError as error:
        raise _unreadable(file, f"{BEFORE}: {error}") from None


def _read(file: h5py.File, name: str) -> bytes:
    """The bytes of a dataset of ours; none if it is not there.  ResultError: it is something else."""
    data = stored(file, name)
    if data is None:
        return b""
    if file.swmr_mode:
        data.refresh()
    if data.dtype != np.dtype("u1") or data.ndim != 1:
        raise _unreadable(file, f"{name}: expected bytes in a row, found {data.dtype} of shape {data.shape}")
    return bytes(data[()].tobytes())


def _unreadable(file: h5py.File, detail: str) -> ResultError:
    advice = "the file as hybrid wrote it, or run its scene again"
    return ResultError(
        f"{file.filename} has a checkpoint that cannot be read\n    detail:   {detail}\n    try:      {advice}"
    )


def write_slot(slots: Sequence[h5py.Dataset], number: int, data: bytes) -> None:
    """Write a packed checkpoint over the older of the two; whoever holds the slots open hears of it when that fails."""
    slot = slots[number % 2].id
    if slot.shape[0] < len(data):
        slot.set_extent((len(data),))
    write_rows(slot, 0, np.frombuffer(data, "u1"))


def read_checkpoint(file: h5py.File) -> Checkpoint:
    """The newest checkpoint that is whole and whose rows are all there.  ResultError if there is none."""
    points = []
    why = (
        "it is an equilibrium, was stepped from outside (hybrid.Simulation), was kept in memory first, or ended "
        "before its first output"
    )
    for name in SLOTS:
        try:
            data = _read(file, name)
            point = _checkpoint(unpack(data)) if data else None
            if point is not None and _has_rows(file, point):
                points.append(point)
        except (ResultError, ValueError) as error:
            why = str(error).split("detail:")[-1].splitlines()[0].strip()
    if not points:
        wrote, advice = plain_text(file.attrs.get("version_hybrid-cable", "")), "run its scene again"
        if wrote != version("hybrid-cable") and "checkpoint" in file:
            advice += f", or resume it with hybrid-cable {wrote}, which wrote it"
        raise ResultError(
            f"{file.filename} has no checkpoint to go on from\n    detail:   {why}\n    try:      {advice}"
        )
    return max(points, key=lambda point: point.number)


def _checkpoint(tree: Tree) -> Checkpoint:
    template = {"number": 0, "t": 0.0, "program": "", "asks": False}
    free = ("files", "rows", "happened", "zones", "resolution", "state")
    point = Checkpoint(**matched(tree, template | dict.fromkeys(free)))
    for name in ("rows", "happened"):
        table = getattr(point, name)
        matched(table, dict.fromkeys(table, 0) if isinstance(table, dict) else {}, name)
    matched(point.files, dict.fromkeys(point.files, "") if isinstance(point.files, dict) else {}, "files")
    zones = matched(point.zones, [["", 0.0, 0.0]] * (len(point.zones) if isinstance(point.zones, list) else 0), "zones")
    if min([point.number, *point.rows.values(), *point.happened.values()]) < 0:
        raise ValueError("a count is negative")
    return point._replace(zones=[tuple(zone) for zone in zones])


def _has_rows(file: h5py.File, point: Checkpoint) -> bool:
    for scale, count in point.rows.items():
        data = stored(file, scale)
        if data is None or not data.ndim:
            return False
        if file.swmr_mode:
            data.refresh()
        if data.shape[0] < count:
            return False
    return True


def check_tables(
    source: h5py.File,
    groups: Mapping[str, h5py.Group],
    all_tables: Mapping[str, Mapping[str, Sequence[Field]]],
    at: Checkpoint,
) -> None:
    """Raise ResultError unless a file has exactly these tables, and a checkpoint their rows.

    groups: of the file, "", and of each line; tables with other columns are refused too.
    """
    expected = {}
    for part, tables in all_tables.items():
        within = groups[part]
        missing = [
            f.name for group, each in tables.items() for f in each if f"{group}/{f.name}".lstrip("/") not in within
        ]
        if missing:
            raise ResultError(f"the result has no {', '.join(missing)}: another program has written it")
        for group, columns in tables.items():
            for field in columns:
                check_column(within, group, field)
        _check_outputs(within, tables["/"], at.rows.get(f"{GROUP}/{part}/t" if part else "t", 0))
        expected[part] = {f"{group}/{columns[0].name}".lstrip("/"): 0 for group, columns in tables.items() if columns}
    if list(at.rows) != list(of_all(expected)) or not at.rows["t"] or source["t"][at.rows["t"] - 1] != at.t:
        advice = "its rows are not those of the file\n    try:      run its scene again"
        raise ResultError(f"{source.filename} has a checkpoint that does not fit\n    detail:   {advice}")


def _check_outputs(within: h5py.Group, fields: Sequence[Field], count: int) -> None:
    """ResultError: outputs that are none of the fields, and would end here without a word, or lack some of the rows.

    Errors come later.
    """
    known, amiss = {field.name for field in fields}, list[str]()

    def check_dataset(name: str, data: Any) -> None:
        if not isinstance(data, h5py.Dataset) or not data.ndim or data.dims[0].label != "t":
            return
        if name in known and data.shape[0] < count:
            amiss.append(f"{name} in {data.shape[0]} of {count} outputs")
        elif name not in known and not name.startswith(("errors/", f"{GROUP}/")):
            amiss.append(f"{name}, which this program does not write")

    within.visititems(check_dataset)
    if amiss:
        detail = f"the result has {'; '.join(amiss)}"
        raise ResultError(
            f"{within.file.filename} cannot be resumed\n    detail:   {detail}\n    try:      run its scene again"
        )


def digest_of(path: Path) -> str:
    """Digest of a file's content; "" if it is not there."""
    try:
        return hashlib.blake2b(path.read_bytes(), digest_size=DIGEST).hexdigest()
    except OSError:
        return ""


# --- files made in one go ----------------------------------------------------------------------

WAITS = 0.2  # s, that it waits at most while errors of the result are estimated, as outputs are held back
# Bytes of all results in memory whose files are written; of those after them the arrays are read when they are needed.
MOST_STAYING = 256_000_000
_staying: WeakSet[ArrayContents] = WeakSet()
# Lines in a file that begins as a template, and templates that are kept, of 80 kB a line.
MOST_LINES, MOST_KEPT = 8, 32
# Bytes of a dataset for whose values a template has room, and of all of these, which stay with it; HDF5 takes as long
# to open a dataset as to write some 100 kB.
LARGEST_PLACED, MOST_PLACED = 32_768, 1_000_000
_kept: dict[Hashable, Template] = {}


class Restart(NamedTuple):
    """What a run that goes on needs.

    checkpoints: packed, by number; before: what was found before the run.
    """

    checkpoints: dict[int, bytes]
    before: Tree


class LateFile:
    """A result in memory, to be added to until it is written to its place."""

    def __init__(self, path: Path, contents: ArrayContents, restart: Restart | None, outputs: int | None) -> None:
        """path: its place; the others: as of `image_of_result`."""
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
            write_result(new, self.contents, self._restart, self._outputs, True)
            sign_new(new)
            with new.open("r+b") as file:
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


def write_result(
    path: Path, contents: ArrayContents, restart: Restart | None, outputs: int | None, complete: bool
) -> None:
    """Write the file of a result, with the rows that it has; that of many lines is never in memory.

    The rest: as of `image_of_result`; OSError: it cannot be written.
    """
    if len(contents.parts) < MOST_LINES:
        image, placed = _image_of_few(contents, restart, outputs, complete)
        with path.open("wb", buffering=0) as file:
            _write_at(file, 0, image)
            for at, data in placed:
                _write_at(file, at, data)
        return
    with drafted(path) as file:
        _write_lines(file, contents, restart, outputs)


def image_of_result(
    contents: ArrayContents, restart: Restart | None, outputs: int | None, complete: bool
) -> bytes | bytearray:
    """The bytes of the file of a result, with the rows that it has.

    restart: None: nobody can go on with it; outputs: their number if it is known, which only makes small files smaller;
    complete: whether no rows will be added before it is copied.
    """
    if len(contents.parts) >= MOST_LINES:
        file = in_memory()
        _write_lines(file, contents, restart, outputs)
        return image_of(file)
    image, placed = _image_of_few(contents, restart, outputs, complete)
    if not placed:
        return image
    whole = bytearray(image)
    for at, data in placed:
        whole[at : at + len(data)] = data
    return whole


def _write_at(file: io.FileIO, at: int, data: bytes) -> None:
    left = memoryview(data)
    file.seek(at)
    while left.nbytes:
        left = left[file.write(left) :]


def _image_of_few(
    contents: ArrayContents, restart: Restart | None, outputs: int | None, complete: bool
) -> tuple[bytes, list[tuple[int, bytes]]]:
    """The file of a result of few lines, and what is still to be put in its place there."""
    groups = dict(groups_of(contents))
    placed = sum(x.values.nbytes for part in groups.values() for x in part.data.values() if _has_place(x, complete))
    complete &= placed <= MOST_PLACED
    of_groups = ((group, _shape_of(part, complete)) for group, part in groups.items())
    shape = (*of_groups, outputs, restart is not None, complete)
    if shape not in _kept:
        if len(_kept) >= MOST_KEPT:
            _kept.clear()
        _kept[shape] = _template(groups, restart is not None, outputs, complete)
    template = _kept[shape]
    file = in_memory(template.content, contents.size - placed)
    for group, part in groups.items():
        _fill(file, group, part, {}, template.places)
    _finish(file, contents, restart)
    rows = ((groups[group].data[name].values, at) for (group, name), at in template.places.items())
    return image_of(file), [(at, np.ascontiguousarray(x[of]).tobytes()) for x, places in rows for at, of in places]


def _write_lines(file: h5py.File, contents: ArrayContents, restart: Restart | None, outputs: int | None) -> None:
    """Write a result of many lines, one after the other, to a new file."""
    bare = Bare(outputs, False)
    for k, (group, part) in enumerate(groups_of(contents), 1):
        _fill(file, group, part, bare.create(file, group, part), {})
        if k % TOGETHER == 0:
            file.flush()
    bare.close()
    if restart is not None:
        create_slots(file)
    _finish(file, contents, restart)


def _finish(file: h5py.File, contents: ArrayContents, restart: Restart | None) -> None:
    """Write what is beside the datasets of a result and its lines."""
    if contents.parts:
        file[GROUP].attrs["order"] = list(contents.parts)
    if restart is not None:
        slots = [file[name] for name in SLOTS] if restart.checkpoints else []
        for number, data in restart.checkpoints.items():
            write_slot(slots, number, data)
        write_before(file, restart.before)


class Template(NamedTuple):
    """A file without values.

    places: where HDF5 has room for those of datasets (group of the line, name): begin, and rows that stand there.
    """

    content: bytes
    places: Mapping[tuple[str, str], Sequence[tuple[int, Any]]]


def _template(groups: Mapping[str, ArrayContents], resumable: bool, outputs: int | None, complete: bool) -> Template:
    file, bare, places = in_memory(), Bare(outputs, complete), dict[tuple[str, str], Sequence[tuple[int, Any]]]()
    for group, part in groups.items():
        made = bare.create(file, group, part)
        places |= {(group, x): _places(made[x], y) for x, y in part.data.items() if _has_place(y, complete)}
    bare.close()
    made.clear()
    if resumable:
        create_slots(file)
    return Template(image_of(file), places)


def _has_place(x: ArrayDataset, complete: bool) -> bool:
    """Whether a template has room for the values of a dataset: rows of tables beside the outputs are of any number."""
    small = 0 < x.values.nbytes <= LARGEST_PLACED
    return complete and small and (not x.grows or x.dims[0] == "t")


def _places(data: h5d.DatasetID, x: ArrayDataset) -> list[tuple[int, Any]]:
    if not x.grows:
        return [(data.get_offset(), ...)]
    chunks = [data.get_chunk_info(k) for k in range(data.get_num_chunks())]
    rows = data.get_create_plist().get_chunk()[0]
    return [(c.byte_offset, slice(c.chunk_offset[0], c.chunk_offset[0] + rows)) for c in chunks]


def _shape_of(part: ArrayContents, complete: bool) -> Hashable:
    """What the datasets of a result depend on."""
    of_rows = ((x.field, x.dims, _shape(x, complete), x.grows) for x in part.data.values())
    return tuple(of_rows), tuple(part.groups)


def _shape(x: ArrayDataset, complete: bool) -> tuple[int, ...]:
    """Of a new dataset; rows that are written one after the other come later."""
    return x.values.shape if not x.grows or _has_place(x, complete) else (0, *x.values.shape[1:])


class Bare:
    """Datasets of results without values: those of lines that are alike are made once, and copied.

    A copy has no dimension scales, which HDF5 would not translate; they are attached where they stand.
    """

    def __init__(self, outputs: int | None, complete: bool) -> None:
        """outputs, complete: as of `image_of_result`."""
        self._outputs, self._complete, self._made = outputs, complete, dict[Hashable, h5py.File]()

    def create(self, file: h5py.File, group: str, part: ArrayContents) -> dict[str, h5d.DatasetID]:
        """The datasets of a result in a file, by name; columns that grow are empty, unless all is complete."""
        if group:
            shape = _shape_of(part, self._complete)
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
            shape, dtype = _shape(x, self._complete), x.values.dtype
            chunk: tuple[int, ...] = ()
            most: tuple[int, ...] | None = None
            if x.grows:
                if dtype.kind == "S":
                    dtype = h5py.string_dtype("utf-8", dtype.itemsize)
                size = int(dtype.itemsize * np.prod(shape[1:], dtype=int))
                few = self._outputs if x.dims[0] in ("t", "zones/t") else None
                chunk = (max(1, min(chunk_rows(size), BLOCK, few or BLOCK)), *shape[1:])
                most = (h5s.UNLIMITED, *shape[1:])
            kind = NUMBERS.get(x.field.dtype) or h5t.py_create(dtype, logical=True)
            space, how = (
                h5s.create_simple(shape, most) if shape else SCALAR,
                _creation(chunk, _has_place(x, self._complete)),
            )
            found[name] = data = h5d.create(root.id, name.encode(), kind, space, how, _links())
            annotate(data, x.field.unit, x.field.description, x.field.frame)
            if x.dims == (name,):
                h5ds.set_scale(data, (name.rpartition("/")[2] if x.grows else name).encode())
                h5ds.set_label(data, 0, name.encode())
        return found


@cache
def _creation(chunk: tuple[int, ...], has_place: bool) -> h5p.PropDCID:
    """How a dataset is made of such chunks, or of none; has_place: with room for its values, which come later."""
    creation = h5p.create(h5p.DATASET_CREATE)
    if chunk:
        creation.set_chunk(chunk)
    if has_place:
        creation.set_alloc_time(h5d.ALLOC_TIME_EARLY)
        creation.set_fill_time(h5d.FILL_TIME_NEVER)
    return creation


@cache
def _links() -> h5p.PropLCID:
    """Names with slashes make groups."""
    links = h5p.create(h5p.LINK_CREATE)
    links.set_create_intermediate_group(True)
    return links


def _fill(
    file: h5py.File,
    group: str,
    part: ArrayContents,
    known: Mapping[str, h5d.DatasetID],
    without: Collection[tuple[str, str]],
) -> None:
    """Attributes, texts and values of a result; known: datasets that are open; without: those that are left out."""
    root = file[group] if group else file
    write_attributes(root, part.attributes)
    write_texts(root, {name: made(text) for name, text in part.texts.items()})
    for name, x in part.data.items():
        if not x.values.size or (group, name) in without:
            continue
        data = known[name] if known else h5d.open(root.id, name.encode())
        if x.grows:
            data.set_extent(x.values.shape)
        data.write(h5s.ALL, h5s.ALL, np.ascontiguousarray(x.values), NUMBERS.get(x.field.dtype) or data.get_type())


def write_attributes(root: h5py.Group, attributes: Mapping[str, Any]) -> None:
    """Attributes of a result, by HDF5's own interface: h5py takes five times as long."""
    for name, value in attributes.items():
        if isinstance(value, str) and name not in STATUS_WIDTHS:
            array, kind = np.array(value, TEXT), KIND_OF_TEXT
        else:
            width = STATUS_WIDTHS.get(name)
            array = np.array(value) if width is None else fixed_text(value, h5py.string_dtype("utf-8", width))
            kind = h5t.py_create(array.dtype, logical=True)
        h5a.create(root.id, name.encode(), kind, SCALAR).write(array)
