"""Write what a run computes: `Recorder`, an HDF5 writer that knows nothing of the physics.

Every dataset is created before the first output, because the file is then switched to
SWMR (single writer, multiple readers): from that moment other processes can read it, and
a kill at any instant leaves a file that opens with all outputs saved before.  SWMR forbids
new datasets, new attributes and variable-length text; so texts have fixed widths, and
`status` and `message` are overwritten in place.  The layout is described in `read`.

Choices.  float64: an energy balance and a derivative of the output lose half their digits,
single precision would leave none.  No compression: the trailing digits of a computed motion
are noise (gzip with shuffle saves a tenth and takes three times as long), while a compressed chunk that grows must
be written to a new place at every output and SWMR does not reuse the old one.
"""

from __future__ import annotations

import io
import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from time import monotonic
from typing import Any, NamedTuple

import h5py
import numpy as np
from h5py import h5d

from hybrid.store.amend import AFTERWARDS, AMENDED
from hybrid.store.array_contents import HeldValues
from hybrid.store.checkpoint import BEFORE, SLOTS, Checkpoint, check_tables, create_slots, write_before, write_slot
from hybrid.store.copying import GROUP, add_parts, copied, in_turn, names_in, of_all, of_part
from hybrid.store.format import (
    BLOCK,
    Field,
    Header,
    add_fixed,
    check_names,
    made,
    plain_text,
    set_status,
    tables_of,
    write_all,
    write_attributes,
    write_fixed,
    write_texts,
)
from hybrid.store.hdf5_file import (
    check_target,
    created,
    drafted,
    give_up,
    hold_metadata,
    image_of,
    in_memory,
    unwritable,
)
from hybrid.store.integrity import sign
from hybrid.store.named_arrays import Tree, pack
from hybrid.store.recorder import STATUS, BaseRecorder, Table, pause
from hybrid.store.records import PENDING
from hybrid.store.whole_file import LateFile, template

# Outputs are held back at most so many times as long as writing takes: a reader hardly notices, a kill loses no more,
# and a run that saves a thousand times a second spends 2 % of its time here instead of half.
_PART = 50.0
# Bytes of outputs that wait at most, so that the memory of a long run stays flat: it computes 30 MB a second.
_MOST_WAITING = 16_000_000


class WriteMode(NamedTuple):
    """How a file is written while its result is computed.

    before: what was found before the run, for whoever goes on with it; None: nobody can, it has no checkpoints.
    late: whether there is no file before the first flush; without one it is written when the recorder is closed, and if
    that is "complete" and `amended`, it waits in `late_file` for whoever puts it in its place.
    unseen: whether nobody reads it before it is complete: outputs wait until they are many.
    """

    before: Tree | None = None
    late: bool = False
    unseen: bool = False


AT_ONCE = WriteMode()  # the file is there from the start, nobody goes on with it


class Late(NamedTuple):
    """A result that has no file as yet."""

    held: HeldValues
    make: Callable[[], h5py.File]  # a file in memory that has all but its tables
    checkpoints: dict[int, bytes] | None  # that no other took the place of, by slot; None: nobody can go on with it
    before: Tree | None
    templates: Path | None


def _new_file(header: Header, before: Tree | None, outputs: int | None, templates: Path | None) -> h5py.File:
    """A file in memory with all of a header, and without outputs; its arguments are those of `Recorder`."""
    points, shape = np.size(header.grid_s), [field for field, _ in header.fixed]
    with_checkpoints = before is not None
    file = in_memory(template(points, header.fields, header.step_fields, shape, outputs, with_checkpoints, templates))
    write_attributes(file, header.attributes)
    write_texts(file, {name: made(text) for name, text in header.texts.items()})
    write_fixed(file, np.asarray(header.grid_s, dtype=float), header.fixed)
    write_before(file, before)
    return file


class Recorder(BaseRecorder):
    """Writes one result file; a context manager that closes it with the right status.

    target: path, or a BytesIO for a result in memory.
    outputs: the number of outputs if it is known; it only makes small files smaller.
    overwrite: replace an existing result.  Another program's file is never replaced.
    templates: folder where templates of files are kept (store.whole_file); None: in this process alone.
    parts: results of lines, laid by in memory, that are groups of this file from now on and are written with it.
    """

    late_file: LateFile | None = None
    amended = False
    _unseen = False
    _late: Late | None  # what there is instead of a file; None: the file is there

    def __init__(
        self,
        target: str | Path | io.BytesIO,
        header: Header,
        *,
        outputs: int | None = None,
        overwrite: bool = False,
        mode: WriteMode = AT_ONCE,
        templates: Path | None = None,
        parts: Mapping[str, Recorder] | None = None,
    ) -> None:
        fields, step_fields, fixed, before = header.fields, header.step_fields, header.fixed, mode.before
        check_names(fields, step_fields, fixed)
        header = header._replace(texts={name: made(text) for name, text in header.texts.items()})
        self._memory = target if isinstance(target, io.BytesIO) else None
        path = None if isinstance(target, io.BytesIO) else Path(target).expanduser().resolve()
        if path is not None:
            check_target(path, overwrite)

        make = partial(_new_file, header, before, outputs, templates)
        if mode.late and path is not None:
            self._write_to(None, path, tables_of(fields, step_fields))
            self._unseen = mode.unseen
            self._late = Late(HeldValues(header), make, {} if before is not None else None, before, templates)
            self._flushed = monotonic()
            return
        file = make()
        if parts:
            add_parts(file, {name: part._pop_image for name, part in parts.items()})
        if path is not None:
            file = created(path, image_of(file), many=bool(parts))
            if parts:
                hold_metadata(file)
        self._write_to(file, path, tables_of(fields, step_fields))
        self._move_parts(parts or {})

    @classmethod
    def again(
        cls, source: h5py.File, path: Path, fields: Sequence[Field], step_fields: Sequence[Field], at: Checkpoint,
        texts: Mapping[str, str], before: Tree, fixed: Sequence[tuple[Field, np.ndarray]] = (),
        parts: Mapping[str, Recorder] | None = None, pending: str = "",
    ) -> Recorder:  # fmt: skip
        """Go on with a result from one of its checkpoints; what came after is left out.  path: where, perhaps the same.

        fixed: quantities that do not depend on time, with values for those that the file does not have.  parts: results
        of lines, laid by in memory, which go on with the groups of the file that have their names.  pending: what is
        to come when it is complete (store.records).
        ResultError if the file holds other fields, or cannot be written.
        """
        self, tables = cls.__new__(cls), tables_of(fields, step_fields)
        groups = {"": source, **{name: source[f"{GROUP}/{name}"] for name in parts or {}}}
        all_tables = {"": tables, **{name: part._tables for name, part in (parts or {}).items()}}
        check_tables(source, groups, all_tables, at)
        ours = {f.name for f in fields}
        later = {x for x in names_in(source, "errors") if x not in ours} | {
            BEFORE,
            *SLOTS,
        }  # known only when all is done

        def make(new: Path) -> None:
            with drafted(new) as file:
                copied(source, file, at.rows, {*later, GROUP})
                for group in tables:
                    file.require_group(group)
                add_fixed(file, fixed)
                write_texts(file, texts)
                create_slots(file)
                write_before(file, before)
                write_slot([file[name] for name in SLOTS], at.number, pack(at._asdict()))
                if parts:
                    file.require_group(GROUP).attrs["order"] = list(parts)
                for name in parts or {}:
                    copied(groups[name], file.create_group(f"{GROUP}/{name}"), of_part(name, at.rows), {"errors"})
                for each in (file, *(file[f"{GROUP}/{name}"] for name in parts or {})):
                    set_status(each, "running", "")
                    for name in [x for x in each.attrs if x.startswith((*AFTERWARDS, AMENDED, PENDING))]:
                        del each.attrs[name]
                    if pending:
                        each.attrs[PENDING] = pending

        self._memory = None
        file = created(path.expanduser().resolve(), make, many=bool(parts))
        if parts:
            hold_metadata(file)
        self._write_to(file, path, tables)
        self._resume_after(at.rows, at.happened)
        self._zones, self._number = list(at.zones), at.number + 1
        self._move_parts(parts or {})
        for name, part in self._parts.items():
            part._resume_after(of_part(name, at.rows), of_part(name, at.happened))
        return self

    def _write_to(self, file: h5py.File | None, path: Path | None, tables: Mapping[str, Sequence[Field]]) -> None:
        self._file: Any = file  # a group of the file of `_whole`, where this is a part of that
        self._late = None
        self._begin(file, tables)
        self.path = path
        self._whole: Recorder | None = None  # never itself: a reference cycle would keep outputs in memory
        self._parts: dict[str, Recorder] = {}
        self._image = b""  # of a file in memory that is closed
        self._number = 0  # of the next checkpoint
        self._slots = _slots_of(file) if file is not None else []
        self._fixed: dict[str, h5d.DatasetID] = {}  # their datasets
        self._packed = b""  # a checkpoint that waits
        self._flushed, self._pause = -np.inf, pause(0.0)  # when the file was last written; how long that holds, s
        self.closed = self._broken = False

    def _resume_after(self, rows: Mapping[str, int], happened: Mapping[str, int]) -> None:
        """Behind rows that are there; happened: events by kind."""
        for table in self._all:
            table.drop()
            table.count = rows[table.scale] if table.fields else 0
        self._happened = Counter(happened)
        self.last = float(self._file["t"][-1])
        zones = self._file["zones"]
        last = zones["output"][:] == zones["output"][-1] if rows["zones/t"] else np.zeros(0, bool)
        kinds = [plain_text(x) for x in zones["kind"][:][last]]
        self._zones = list(zip(kinds, zones["s_a"][:][last].tolist(), zones["s_b"][:][last].tolist(), strict=True))

    def _move_parts(self, parts: Mapping[str, Recorder]) -> None:
        """Write results that were begun in memory into groups of this file."""
        self._parts = dict(parts)
        for name, part in parts.items():
            part._whole, part._memory, part._file = self, None, self._file[f"{GROUP}/{name}"]
            for table in part._all:
                table.move(part._file)

    def _leave(self) -> None:
        """Hold no datasets any more."""
        for table in self._all:
            table.leave()
        self._fixed.clear()

    def lay_by(self) -> None:
        """Close a result in memory that will be a part of another one, and keep its bytes.

        HDF5 uses 5 MB for an open file.  Events may be noted until the bytes are fetched.
        """
        self._leave()
        self._image = image_of(self._file)

    def _pop_image(self) -> bytes:
        """The bytes of a result that was laid by; they are kept no longer."""
        image, self._image = self._image, b""
        return image

    @property
    def is_late(self) -> bool:
        """Whether there is no file as yet."""
        return self._late is not None

    def _end_lateness(self) -> None:
        """Make a file that is late, in memory, to which all that waits can be written."""
        if self._late is not None:
            late, self._late = self._late, None
            self._continue_in(late.make())
            for number, packed in (late.checkpoints or {}).items():
                write_slot(self._slots, number, packed)

    def _appear(self) -> None:
        """Let readers see a file that was made in memory, with all that it holds now."""
        assert self.path is not None
        self._leave()
        self._slots = []
        image = image_of(self._file)
        self._broken = True  # until there is a file again
        self._continue_in(created(self.path, image))
        self._broken = False

    def _continue_in(self, file: h5py.File) -> None:
        """Write to another file that is the same until now."""
        self._file = file
        for table in self._all:
            table.move(file)
        self._slots = _slots_of(file)

    @property
    def due(self) -> bool:
        """Whether outputs have been held back long enough, or are many."""
        late = not self._unseen and monotonic() - self._flushed > self._pause
        return late or sum(x._outputs.bytes_waiting for x in (self, *self._parts.values())) > _MOST_WAITING

    def _has_fixed(self, name: str) -> bool:
        return name in (self._file if self._late is None else self._late.held.fixed)

    def _fixed_values(self, name: str) -> np.ndarray:
        if self._late is not None:
            return self._late.held.fixed[name].values
        return np.asarray(self._file[name][()])

    def checkpoint(self, content: Callable[[], Mapping[str, Any]]) -> None:
        """Keep a checkpoint at the last output, written with the next flush.

        content: makes its `program`, `asks`, `resolution` and `state`.
        """
        if self._packed and self._late is not None:  # which has had no flush since
            assert self._late.checkpoints is not None
            self._late.checkpoints[self._number % 2] = self._packed
            self._number += 1
        parts = {"": self, **self._parts}
        rows = of_all(
            {name: {x.scale: x.count + x.waiting for x in part._all if x.fields} for name, part in parts.items()}
        )
        happened = of_all({name: part._happened for name, part in parts.items()})
        here = {"number": self._number, "t": self.last, "files": self.files, "rows": rows}
        self._packed = pack({**here, "happened": happened, "zones": self._zones or [], **content()})

    def flush(self, made: float = 0.0) -> None:
        """Write what is held back, for readers to see; made: s that it took to make it, beyond what waited made."""
        begin = monotonic()
        late = self.is_late
        self._end_lateness()
        with self._writing():
            parts = [*self._parts.values(), self]
            self._write([x for part in parts for x in reversed(part._all)], self._packed)
            if late:
                self._appear()
            if self._packed and self.path is not None:
                os.fsync(self._file.id.get_vfd_handle())  # a machine that goes down then loses no more than a kill does
        self._number += bool(self._packed)
        self._packed = b""
        self._flushed = monotonic()
        self._pause = max(pause(made), _PART * (self._flushed - begin))

    def _write_many_steps(self) -> None:
        """Steps alone: outputs are written together with their checkpoint; those of lines of a file all at once."""
        whole = self if self._whole is None else self._whole
        steps = [part._steps for part in whole._parts.values()] or [self._steps]
        if self._late is None and all(x.waiting >= BLOCK for x in steps):
            with whole._writing():
                whole._write(steps)

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """What cannot be written, as a ResultError; the file is then closed as it was when it was last flushed."""
        try:
            yield
        except (OSError, RuntimeError) as error:  # HDF5 raises either
            self._broken = True
            if self.path is not None:
                give_up(self._file)
            raise unwritable(self.path, error, f"free some disk space, then `hybrid resume {self.path}`") from error

    def _write(self, tables: Sequence[Table], packed: bytes = b"") -> None:
        waiting = [table for table in tables if table.waiting]
        for together in in_turn(waiting):
            for table in together:
                table.write()
            if len(together) < len(waiting):
                self._file.flush()
        for part in (self, *self._parts.values()):
            for name, values in part._replaced.items():
                if name not in part._fixed:
                    part._fixed[name] = h5d.open(part._file.id, name.encode())
                write_all(part._fixed[name], values)
            part._replaced.clear()
        if packed:
            write_slot(self._slots, self._number, packed)
        # HDF5 may write in any order between two flushes.  So: the data, then the scales that
        # say it is there, and t last, which says that the zones of the output are there too; that of the parts before.
        self._file.flush()
        outputs = {id(part._outputs) for part in self._parts.values()}
        last = [x for x in waiting if id(x) in outputs], [x for x in waiting if x is self._outputs]
        first = [x for x in waiting if id(x) not in outputs and x is not self._outputs]
        for tables in (first, *last):
            for together in in_turn(tables):
                for table in together:
                    table.commit(at_once=not self._parts)
                self._file.flush()

    def close(self, status: str = "complete", message: str = "") -> None:
        """Write the status and close the file; a second call does nothing."""
        if self.closed or self._broken or (self._whole is not None and self._whole._broken):
            return
        if status not in STATUS:
            raise ValueError(f"status {status!r} is none of {', '.join(STATUS)}")
        self.closed = True
        self._count_left_out()
        if self._whole is not None:
            with self._whole._writing():
                set_status(self._file, status, message)
            self._whole = None  # a cycle no more: it has this among its parts
            return
        if self._late is not None:
            self._write_late(self._late, status, message)
            return
        self.flush()
        with self._writing():
            set_status(self._file, status, message)
            self._file.flush()
            if self._memory is not None:
                self._memory.write(self._file.id.get_file_image())
            for part in (self, *self._parts.values()):
                part._leave()  # HDF5 looks for what is open, in time that grows with its square
            self._file.close()
        if self.path is not None:
            sign(self.path)

    def _write_late(self, late: Late, status: str, message: str) -> None:
        """Write the file in one go, and put it in its place unless it will be amended."""
        assert self.path is not None
        if self._packed and late.checkpoints is not None:
            late.checkpoints[self._number % 2] = self._packed
        contents = late.held.contents(self._tables, self._all, self._replaced, status, message)
        self._late, self.late_file = None, LateFile(self.path, contents, *late[2:])
        if not (self.amended and status == "complete"):
            self.late_file.place()


def _slots_of(file: h5py.Group) -> list[h5py.Dataset]:
    """Where checkpoints are written; none in a file without."""
    return [file[name] for name in SLOTS if name in file]
