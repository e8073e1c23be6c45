"""The HDF5 file of a result, and copies of it.

Files have the v110 format: the oldest with SWMR (single writer, multiple readers), so the most other programs can read
it.  A file is made under another name and moved into place when readers can open it.

Copies have all rows or some.  A run is resumed in a copy, because HDF5 refuses to open a file for writing that a killed
process was writing ("file is already open for write"; the mark can be taken away by h5clear alone), and because the
file stays as it is until the copy is whole.
"""

from __future__ import annotations

import ctypes
import io
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

import h5py
import numpy as np
from filelock import FileLock, Timeout
from h5py import h5f, h5p

from hybrid.errors import ResultError, ResultHeld
from hybrid.store.format import CACHE, FORMAT, FORMAT_VERSION, chunk_rows, plain_text
from hybrid.store.integrity import being_written, check_stored, is_signed, unmarked
from hybrid.store.recorder import Table

LIBVER = ("v110", "v110")
# Places for chunks in the cache of a dataset, which is written at its end: HDF5 2.0 takes 8191, 64 kB a dataset.
SLOTS = 31
# Bytes by which a file in memory grows at least: by 64 kB, as HDF5 would, one of 12 MB takes 15 ms more.
# At once it takes what is to come, or so many times as much: the last growth may be empty.
GROWTH, MOST_GROWTH = 1 << 20, 32
METADATA = 128 * 1024 * 1024  # bytes: the most that HDF5 takes
MORE_SPACE = "free some disk space; close programs that hold the file"  # advice
_MOST_IN_MEMORY = 500_000_000  # bytes of a killed file that is read as a whole, in some tenths of a second
# Bytes of a page of a new file, and pages that wait in memory.
_PAGE = 1 << 18
_MOST_PAGES = 16
_DRAFTED = 1 << 20  # bytes of metadata: lines are written one after the other, of those before nothing is needed


# ---- reading --------------------------------------------------------------------------------------


def open_file(source: Path | io.BytesIO, summed: bool = True) -> h5py.File:
    """Open a file, or bytes in memory, for reading.  ResultError when it is no HDF5 file or not there.

    summed: whether the bytes of a closed file are held against its sum; not of one that was written just now.
    """
    if not isinstance(source, Path):
        try:
            return _Image(h5py.File.in_memory(source.getvalue()).id)
        except OSError as error:
            raise ResultError(f"the bytes in memory are no HDF5 file: {error}") from None
    if not source.exists():
        raise ResultError(f"there is no file {source}\n    try:      check the name, or run the scene first")
    if source.is_dir():
        raise ResultError(f"{source} is a folder\n    try:      name the result file in it")
    try:
        if not being_written(source, summed):
            return h5py.File(source, "r", locking="best-effort")
        if is_held(source) or source.stat().st_size > _MOST_IN_MEMORY:
            return h5py.File(source, "r", swmr=True, locking="best-effort")
        file = _Image(h5py.File.in_memory(unmarked(source)).id)
        file.filename = str(source)
        return file
    except OSError as error:
        advice = "expected: an HDF5 file written by hybrid\n    try:      copy it anew, or run its scene again"
        raise ResultError(f"{source} cannot be read as a result\n    detail:   {error}\n    {advice}") from error


@contextmanager
def opened(source: Path) -> Iterator[h5py.File]:
    """The HDF5 file of a result, for what is not in a `Result`.  ResultError as of `open_result`."""
    with open_file(source) as file:
        check_format(file, source)
        yield file


def is_result(path: Path) -> bool:
    """Whether the file is one of ours, of whatever format version and status."""
    with suppress(OSError):
        if is_signed(path):  # quicker than what HDF5 says of it
            return True
    with suppress(ResultError), open_file(path) as file:
        return plain_text(file.attrs.get("format", "")) == FORMAT
    return False


def check_format(file: h5py.File, source: Path | io.BytesIO) -> None:
    """ResultError if a file is no result, or has another format version."""
    name = str(source) if isinstance(source, Path) else "the file in memory"
    kind, version = plain_text(file.attrs.get("format", "")), file.attrs.get("format_version")
    if kind != FORMAT:
        exported = kind.startswith(FORMAT)
        given = f"an export, which other programs read (format '{kind}')" if exported else f"format '{kind or 'none'}'"
        advice = "name the result that it was made of" if exported else "name a file that `hybrid run` has written"
        raise ResultError(
            f"{name} is an HDF5 file, but not a result of hybrid\n    given:    {given}\n    try:      {advice}"
        )
    if version != FORMAT_VERSION:
        wrote = plain_text(file.attrs.get("version_hybrid-cable", "?"))
        said = f"{name} has result format {version}; this program reads format {FORMAT_VERSION}"
        raise ResultError(f"{said}\n    try:      read it with hybrid-cable {wrote}, or run its scene again")


class _Image(h5py.File):
    """A file in memory under the name of the one that it was read from."""

    filename = "the file in memory"


# ---- writing --------------------------------------------------------------------------------------


def check_target(path: Path, overwrite: bool) -> None:
    """ResultError if a result cannot be written there."""
    check_place(path, "run.h5")
    if path.exists():
        if not overwrite:
            advice = "another name, or leave --no-overwrite out (overwrite=True in Python)"
            raise ResultError(f"{path} exists\n    try:      {advice}")
        if not os.access(path, os.W_OK) or (path.stat().st_size and not is_result(path)):
            why = "is not a result of hybrid" if os.access(path, os.W_OK) else "is write-protected"
            advice = "another name, or delete the file yourself: only results are replaced, there is no --overwrite"
            raise ResultError(f"{path} exists and {why}\n    try:      {advice}")


def check_place(path: Path, example: str) -> None:
    """ResultError if no file can be there: it is a folder, or in none; example: of a name."""
    if path.is_dir():
        raise ResultError(f"{path} is a folder\n    try:      name a file in it, such as {path / example}")
    if not path.parent.is_dir():
        raise ResultError(f"there is no folder {path.parent}\n    try:      mkdir -p {path.parent}")


class _Draft(io.RawIOBase):
    """A file that HDF5 writes through Python: it never hears of an error, which is raised when it has closed the file.

    What HDF5 cannot write when it closes a file ends the process: SIGSEGV in 12 of 12 (tests/store/test_disk_full.py).
    It writes 300 bytes at a time, most of them near those before: pages that were used last wait in memory.
    """

    error: OSError | None = None

    def __init__(self, path: Path, mode: str) -> None:
        self._file = io.FileIO(path, mode)
        self._pages: dict[int, memoryview] = {}  # by number, in the order of their last use
        self._at, self._size, self._last = 0, self._file.seek(0, os.SEEK_END), -1

    def seek(self, to: int, whence: int = os.SEEK_SET) -> int:
        self._at = to + (0, self._at, self._size)[whence]
        return self._at

    def _ahead(self, size: int) -> memoryview:
        """So many bytes from here on, or those to the end of a page, which are left behind."""
        number, begin = divmod(self._at, _PAGE)
        if number != self._last:
            page = self._pages.pop(number, None)
            if page is None:
                self._file.seek(number * _PAGE)
                page = memoryview(bytearray(self._file.read(_PAGE).ljust(_PAGE, b"\0")))
                if len(self._pages) == _MOST_PAGES:
                    self._put(next(iter(self._pages)))
            self._pages[number], self._last = page, number
        part = self._pages[number][begin : begin + size]
        self._at += part.nbytes
        return part

    def _put(self, number: int) -> None:
        """Write a page, which waits no more."""
        left = self._pages.pop(number)[: max(self._size - number * _PAGE, 0)]
        try:
            self._file.seek(number * _PAGE)
            while self.error is None and left.nbytes:
                left = left[self._file.write(left) :]
        except OSError as error:
            self.error = error

    def write(self, data: Any) -> int:
        left = memoryview(data)
        size = left.nbytes
        self._size = max(self._size, self._at + size)
        while left.nbytes:
            part = self._ahead(left.nbytes)
            part[:], left = left[: part.nbytes], left[part.nbytes :]
        return size

    def readinto(self, into: Any) -> int:
        left = memoryview(into)
        left = left[: max(self._size - self._at, 0)]
        size = left.nbytes
        while left.nbytes:
            part = self._ahead(left.nbytes)
            left[: part.nbytes], left = part, left[part.nbytes :]
        return size

    def truncate(self, size: int | None = None) -> int:
        self._size = self._at if size is None else size
        self.put_all()
        try:
            return self._file.truncate(self._size)
        except OSError as error:
            self.error = self.error or error
            return self._size

    def put_all(self) -> None:
        """Write what waits."""
        for number in [*self._pages]:
            self._put(number)
        self._last = -1

    def close(self) -> None:
        self._file.close()
        super().close()


@contextmanager
def drafted(path: Path, mode: str = "w") -> Iterator[h5py.File]:
    """A new file that is made in one go, or with "r+" one that nobody has opened; OSError: it could not be written."""
    with _Draft(path, f"{mode.rstrip('+')}+") as draft:
        with h5py.File(draft, mode, libver=LIBVER, rdcc_nbytes=CACHE, rdcc_nslots=SLOTS) as file:
            bound_metadata(file, _DRAFTED)
            yield file
        draft.put_all()
        if draft.error is not None:
            raise draft.error


def created(path: Path, make: Callable[[Path], None], many: bool = False) -> h5py.File:
    """Make a file beside its place, open it to readers, and move it into place.

    many: it has so many datasets that nothing of them is to wait in memory until a chunk is full.

    So an older result survives a failed start, and a reader who has it open keeps what he sees.
    """
    with replacing(path) as new:
        make(new)
        if many:
            file = _opened_for_many(new)
        else:
            file = h5py.File(new, "r+", libver=LIBVER, locking="best-effort", rdcc_nbytes=CACHE, rdcc_nslots=SLOTS)
        file.swmr_mode = True
    return file


def _opened_for_many(path: Path) -> h5py.File:
    """A new file of many datasets, without a cache of chunks or of metadata of closed datasets.

    Chunks go to the disk at once, so that a full disk is noticed at the write.  With such a cache, closing the file
    takes time that grows faster than the square of its datasets: 37 s of 27 000.  h5py has no name for that property
    of HDF5; where it cannot be reached, closing takes its time.
    """
    access = h5p.create(h5p.FILE_ACCESS)
    access.set_libver_bounds(h5f.LIBVER_V110, h5f.LIBVER_V110)
    access.set_fclose_degree(h5f.CLOSE_STRONG)
    access.set_file_locking(True, True)
    access.set_cache(0, SLOTS, 0, 0.75)
    with suppress(OSError, AttributeError):
        evict = ctypes.CDLL(h5p.__file__).H5Pset_evict_on_close
        evict.argtypes = [ctypes.c_int64, ctypes.c_bool]
        evict(access.id, True)
    return h5py.File(h5f.open(os.fsencode(path), h5f.ACC_RDWR, access))


def bound_metadata(file: h5py.File, size: int = METADATA) -> None:
    """Let a file of many datasets keep what it knows of them in memory, up to so many bytes.

    They may be few where nobody reads it before it is closed.  Written by one and read by many, HDF5 2.0 fails where it
    has to drop some of it ("doesn't have a flush dependency parent array"): results of 200 lines could not be written,
    and closing them ended the process.
    """
    config = file.id.get_mdc_config()
    config.set_initial_size, config.initial_size, config.max_size = True, size, size
    config.incr_mode = config.flash_incr_mode = config.decr_mode = 0
    file.id.set_mdc_config(config)


def in_memory(content: bytes = b"", more: int = 0) -> h5py.File:
    """A file in memory, to be written; content: of an existing one; more: bytes of values that come to it."""
    growth = GROWTH * min(1 + int(1.125 * (len(content) + more)) // GROWTH, MOST_GROWTH)  # with what is beside them
    return h5py.File.in_memory(content, block_size=growth, libver=LIBVER, rdcc_nbytes=CACHE, rdcc_nslots=SLOTS)


def image_of(file: h5py.File) -> bytes:
    """The bytes of a file in memory, which is closed."""
    file.flush()
    image = bytes(file.id.get_file_image())
    file.id.close()  # h5py's own way looks at all that is open, in time that grows with the lines of a network squared
    return image


def give_up(file: h5py.File) -> None:
    """Close a file in SWMR mode that could not be written; on the disk it stays as it was when last flushed.

    HDF5 would try again when the file is closed or Python ends, and that ends the process: SIGSEGV in 12 of 12 on a
    full disk (tests/store/test_disk_full.py).  So what it writes from here on leads nowhere.
    """
    with open(os.devnull, "r+b") as nowhere:
        os.dup2(nowhere.fileno(), file.id.get_vfd_handle())
    with suppress(RuntimeError):  # /dev/null has no length to be set
        file.close()


def beside(path: Path) -> Path:
    """Where a file is made before it takes its place; what a killed process has left there, `locked` removes."""
    return path.with_name(f".{path.name}.{os.getpid()}.new")


@contextmanager
def replacing(path: Path, new: Path | None = None, by_hdf5: bool = False) -> Iterator[Path]:
    """A name beside a file, `new` or that of `beside`, which takes its place at the end; errors as of `unwritable`."""
    new = new or beside(path)
    try:
        yield new
        os.replace(new, path)
    except (OSError, RuntimeError) as error:
        if isinstance(error, RuntimeError) and not by_hdf5:  # which raises either
            raise
        raise unwritable(path, error, MORE_SPACE if by_hdf5 else "") from error
    finally:
        with suppress(OSError):
            new.unlink(missing_ok=True)


def unwritable(path: Path | None, error: Exception, advice: str = "") -> ResultError:
    """What to say when a file cannot be written."""
    advice = advice or "a folder you may write to, with free space; close programs that hold the file"
    return ResultError(f"{path or 'the result'} cannot be written\n    detail:   {error}\n    try:      {advice}")


# The lock on a result file: one process at a time writes it.

# s: whoever asks `is_held` holds a lock for some microseconds.
_PATIENCE = 0.2
_OURS: set[Path] = set()  # results that this process holds


def is_held(path: Path) -> bool:
    """Whether another process holds a result for writing; a lock that a killed one has left is removed."""
    if path in _OURS or not _beside(path).exists():
        return False
    try:
        with FileLock(_beside(path), timeout=0):
            with suppress(OSError):  # Windows keeps what is open
                _beside(path).unlink(missing_ok=True)  # it is made anew where the other process has just ended
            return False
    except (Timeout, OSError):
        return True


@contextmanager
def locked(path: Path | None) -> Iterator[None]:
    """Hold a result for writing, against other processes, until the end; ResultError if one holds it."""
    if path is None:
        yield
        return
    beside = _beside(path)
    lock = FileLock(beside, timeout=_PATIENCE)
    try:
        lock.acquire()
    except Timeout:
        if not beside.exists():  # nobody holds it: it cannot be made there
            raise ResultError(f"{path} cannot be written\n    try:      a folder you may write to") from None
        advice = "another name with -o, or wait until it has ended"
        raise ResultHeld(f"{path} is being written by another process\n    try:      {advice}") from None
    except OSError as error:
        advice = "a folder you may write to, with free space"
        raise ResultError(f"{path} cannot be written\n    detail:   {error}\n    try:      {advice}") from error
    try:
        _remove_left(path)
        _OURS.add(path)
        yield
    finally:
        _OURS.discard(path)
        beside.unlink(missing_ok=True)
        lock.release()


def _remove_left(path: Path) -> None:
    """Remove what killed processes have left: beside a result (hdf5_file.beside), and locks of others in its folder."""
    begin, names = f".{path.name}.", set(os.listdir(path.parent))
    for name in names:
        if name.startswith(begin) and name.endswith(".new") and name[len(begin) : -4].isdigit():
            path.with_name(name).unlink(missing_ok=True)
        of = name[1:-5]
        ours = name.startswith(".") and name.endswith(".lock") and of != path.name
        if ours and (of in names or of.endswith(".h5")) and _is_empty(path.with_name(name)):
            is_held(path.with_name(of))  # which removes it, unless it is held


def _is_empty(path: Path) -> bool:
    try:
        return path.stat().st_size == 0
    except OSError:
        return False


def _beside(path: Path) -> Path:
    return path.with_name(f".{path.name}.lock")


_BLOCK = 1 << 22  # bytes that are copied at a time


def copied(old: h5py.Group, new: h5py.Group, rows: Mapping[str, int] | None, without: Iterable[str] = ()) -> None:
    """Copy a result to a new file; rows: of every table that are taken, by its scale (None: all that are complete).

    old, new: files, or groups of them; without: datasets, or groups at the top.
    """
    left = set(without)
    whole = [(name, data) for name, data in _datasets(old) if not left & {name, name.split("/")[0]}]
    scales = [name for name, data in whole if data.attrs.get("CLASS") == b"DIMENSION_SCALE"]
    kept = {name: int(old[name].shape[0]) for name in scales} | dict(rows or {})
    _annotations(old, new)
    for name, data in whole:
        _copied_dataset(data, new, name, kept)
    for name in scales:
        new[name].make_scale(plain_text(old[name].attrs.get("NAME", name)))
    for name, data in whole:
        for k, dim in enumerate(data.dims):
            new[name].dims[k].label = dim.label
            if dim.label in kept and dim.label != name:
                new[name].dims[k].attach_scale(new[dim.label])


def names_in(file: h5py.Group, group: str) -> list[str]:
    """Names of all datasets in a group."""
    return [name for name, _ in _datasets(file) if name.startswith(f"{group}/")]


def _datasets(file: h5py.Group) -> Iterator[tuple[str, h5py.Dataset]]:
    found: list[tuple[str, h5py.Dataset]] = []
    file.visititems(lambda name, item: found.append((name, item)) if isinstance(item, h5py.Dataset) else None)
    if file.file.swmr_mode:
        for _, data in found:
            data.refresh()
    return iter(found)


def _copied_dataset(data: h5py.Dataset, new: h5py.Group, name: str, kept: Mapping[str, int]) -> None:
    first = data.dims[0].label if data.ndim else ""
    count = min(kept.get(first, data.shape[0]), data.shape[0]) if data.ndim else 0
    shape = (count, *data.shape[1:]) if data.ndim else ()
    check_stored(data, int(np.prod(shape, dtype=object)))
    grows = data.chunks is not None
    if grows:  # a result that was written in one go has all its rows in one chunk
        rows = min(data.chunks[0], chunk_rows(data.dtype.itemsize * int(np.prod(data.chunks[1:], dtype=int))))
    how = {"maxshape": data.maxshape, "chunks": (rows, *data.chunks[1:])} if grows else {}
    copy = new.create_dataset(name, shape, data.dtype, **how)
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
            try:
                new.attrs.create(key, value, dtype=old.attrs.get_id(key).dtype)
            except UnicodeError:
                where = f"attribute '{key}' of {old.name.lstrip('/') or 'the file'}"
                raise ResultError(
                    f"{old.file.filename} cannot be resumed\n    given:    {where}: {value!r:.60}\n"
                    "    expected: text in UTF-8\n    try:      the file as hybrid wrote it, or run its scene again"
                ) from None


# The results of several lines in one file: each in a group `lines/<name>` with the layout of a result of its own.

GROUP = "lines"
# Lines, or tables of lines, that are written between two flushes of a file: the time of a flush grows with more than
# the square of what is new (32 s for 36 000 datasets at once).
TOGETHER = 20
R = TypeVar("R")  # what a line is opened as


def in_turn(tables: Sequence[Table]) -> Iterator[Sequence[Table]]:
    """Tables in groups between which a file is to be flushed."""
    for k in range(0, len(tables), TOGETHER):
        yield tables[k : k + TOGETHER]


def group_of(line: str) -> str:
    """What names of datasets of a line begin with; nothing for the line without a name, whose result is the file."""
    return f"{GROUP}/{line}/" if line else ""


def root_of(file: h5py.File, line: str) -> h5py.Group:
    """The group of a line; the file itself of the line without a name."""
    return file[f"{GROUP}/{line}"] if line else file


def of_part(name: str, counts: Mapping[str, int]) -> dict[str, int]:
    """What a line is told of counts by name, where those of lines begin with where their results are."""
    begin = group_of(name)
    return {key.removeprefix(begin): count for key, count in counts.items() if key.startswith(begin)}


def of_all(counts: Mapping[str, Mapping[str, int]]) -> dict[str, int]:
    """Counts by name of a network (under the name "") and of its lines as one table."""
    return {group_of(name) + key: count for name, each in counts.items() for key, count in each.items()}


class Lines(Mapping[str, R]):
    """The lines of a result by name, each a result of its own; opened when first asked for."""

    def __init__(self, line: Callable[[str], R], names: tuple[str, ...]) -> None:
        """line: opens the result of a line of that name."""
        self._line, self._names = line, names
        self._opened: dict[str, R] = {}

    def __getitem__(self, name: str) -> R:
        if name not in self._names:
            raise KeyError(f"there is no line '{name}'; there are {', '.join(self._names)}")
        if name not in self._opened:
            self._opened[name] = self._line(name)
        return self._opened[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __repr__(self) -> str:
        return f"<lines {', '.join(self._names)}>"
