"""Write what a run computes, and what is known only when it is complete.

`Recorder` is an HDF5 writer that knows nothing of the physics.  Known only when a result is complete are estimated
errors, and what was spent on them.

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
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import nan
from pathlib import Path
from time import monotonic
from typing import Any, NamedTuple

import h5py
import numpy as np
from h5py import h5d, h5p, h5s

from hybrid.store.format import (
    EVENTS,
    ArrayContents,
    ArrayDataset,
    Field,
    Header,
    MemoryTarget,
    Target,
    add_fixed,
    annotate,
    attach_scales,
    checked,
    made,
    plain_text,
    set_status,
    write_all,
    write_texts,
)
from hybrid.store.hdf5_file import (
    GROUP,
    bound_metadata,
    check_target,
    copied,
    created,
    drafted,
    give_up,
    group_of,
    in_memory,
    in_turn,
    names_in,
    of_all,
    of_part,
    replacing,
    root_of,
    unwritable,
)
from hybrid.store.integrity import Tree, copy_unsigned, pack, sign, sign_new
from hybrid.store.recorder import NUMBERS, Rows, Table, pause, write_rows
from hybrid.store.records import FINER_RESULT, PENDING
from hybrid.store.whole_file import (
    BEFORE,
    SLOTS,
    Checkpoint,
    LateFile,
    Restart,
    check_tables,
    create_slots,
    image_of_result,
    write_before,
    write_result,
    write_slot,
)

AFTERWARDS = ("error_", "effort_", "accuracy_")  # what attributes begin with that are brought here
NOTHING_MORE: Tree = {}  # what a run that is done leaves to go on with
AMENDED = "amended"  # attribute of a result that will be amended again: what is to be taken back then

# Name of a quantity, number of its first output, and values; attributes, and events (kind, text).
Block = tuple[str, int, np.ndarray]
Happened = Sequence[tuple[float, str]]  # events of the result: t, s, and kind
Others = tuple[Mapping[str, str | float | int], Sequence[tuple[str, str]]]


class Part(NamedTuple):
    """What is added to a result, or to that of a line in it.

    group: of the line in the file; empty: the result itself.  fields: quantities over the output times, (nt, ...);
    blocks: all their values: name, number of the first output, and values (n, ...) of n outputs; others: gives
    attributes, and events of all of the line (kind, text), after the last block, from the events that there are.
    """

    group: str
    fields: Sequence[Field]
    blocks: Iterable[Block]
    others: Callable[[Happened], Others]


def amend(target: Path | io.BytesIO | LateFile, parts: Sequence[Part], before: Tree | None = NOTHING_MORE) -> None:
    """Add to a complete result what is known only afterwards.

    parts: one after the other; before: what a run needs that goes on from here, None: what is there; a finer result is
    to come then, and what is added here is taken back when more is added.  Else all is done.
    """
    done = before is not None and not before

    def add(file: h5py.File) -> None:
        if before is not None and BEFORE in file:
            del file[BEFORE]
        write_before(file, before)
        for part in parts:
            _add(file[part.group] if part.group else file, part, done)

    if isinstance(target, LateFile):
        if before is not None:
            target.leave(before)
        for part in parts:
            line = part.group.rpartition("/")[2]
            _add_to_arrays(target.contents.parts[line] if line else target.contents, part, done)
        target.placed = False  # it may be there without them, because they took long
        target.place()
    else:
        change_complete(target, add)


def may_be_amended(late: LateFile) -> bool:
    """Whether a result that is in memory can be added to there; what was added before is taken back in its file."""
    return AMENDED not in late.contents.attributes


def change_complete(target: Path | io.BytesIO, change: Callable[[h5py.File], None]) -> None:
    """Change a complete result, in a copy that takes its place; ResultError where it cannot be written."""
    if isinstance(target, io.BytesIO):
        with in_memory(target.getvalue()) as file:
            change(file)
            file.flush()
            image = file.id.get_file_image()
        target.seek(0)
        target.truncate()
        target.write(image)
        return
    target = target.expanduser().resolve()
    with replacing(target, by_hdf5=True) as new:  # and then in its place: somebody may be reading
        copy_unsigned(target, new)
        with drafted(new, "r+") as file:
            change(file)
        sign_new(new)


def _add_to_arrays(contents: ArrayContents, part: Part, done: bool) -> None:
    """The same of a result that is in memory."""
    _, fields, blocks, others = part
    times, named, found = contents.values("t", None), {x.name: x for x in fields}, dict[str, np.ndarray]()
    for name, begin, values in blocks:
        field = named[name]
        checked(field, values[0])
        if begin == 0 and len(values) == len(times):
            found[name] = np.ascontiguousarray(values, field.dtype)
        else:
            found.setdefault(name, np.zeros((len(times), *field.shape)))[begin : begin + len(values)] = values
    contents.add({name: ArrayDataset(named[name], ("t", *named[name].dims), values) for name, values in found.items()})
    kinds = [plain_text(x) for x in contents.values("events/kind", None)]
    attributes, events = others(list(zip(contents.values("events/t", None).tolist(), kinds, strict=True)))
    contents.attributes |= {key: x.item() if isinstance(x, np.generic) else x for key, x in attributes.items()}
    _say_what_is_to_come(contents.attributes, done, fields, len(kinds))
    if events:
        table, end = Table("events", EVENTS), float(contents.values("s", None)[-1])
        table.add([contents.values(f"events/{x.name}", None) for x in EVENTS])
        for event in events:
            table.add_row((0.0, 0.0, end, *event, "", nan, nan, nan))
        for name, values in table.columns().items():
            contents.data[name].values = values


def _add(file: h5py.Group, part: Part, done: bool) -> None:
    _, fields, blocks, others = part
    _remove_amendments(file)
    count, named, scales = len(file["t"]), {field.name: field for field in fields}, dict[str, h5d.DatasetID]()
    with_groups = h5p.create(h5p.LINK_CREATE)
    with_groups.set_create_intermediate_group(True)
    made = {}
    for field in fields:
        if field.name in file:  # of a result that was amended before, and then resumed
            del file[field.name]
        space = h5s.create_simple((count, *field.shape))
        made[field.name] = data = h5d.create(
            file.id, field.name.encode(), NUMBERS[field.dtype], space, lcpl=with_groups
        )
        annotate(data, field.unit, field.description, field.frame)
        dims = ("t", *field.dims)
        attach_scales(data, dims, [scales.setdefault(dim, file[dim].id) for dim in dims])
        made[field.name] = data
    for name, begin, values in blocks:
        checked(named[name], values[0])
        write_rows(made[name], begin, np.ascontiguousarray(values, named[name].dtype))
    kinds = [plain_text(x) for x in file["events/kind"][:]]
    attributes, events = others(list(zip(file["events/t"][:].tolist(), kinds, strict=True)))
    for name, value in attributes.items():
        file.attrs[name] = value
    _say_what_is_to_come(file.attrs, done, fields, len(kinds))
    if events:
        table = Table("events", EVENTS)
        table.move(file)
        table.count = len(file["events/t"])
        for event in events:
            table.add_row((0.0, 0.0, float(file["s"][-1]), *event, "", nan, nan, nan))
        table.write()
        table.commit()


def _say_what_is_to_come(attributes: Any, done: bool, fields: Sequence[Field], events: int) -> None:
    """Set the attributes of a result that say whether more is to come; events: that it had before."""
    attributes.pop(PENDING, None)
    if not done:
        attributes[PENDING] = FINER_RESULT
        attributes[AMENDED] = json.dumps({"fields": [x.name for x in fields], "events": events})


def _remove_amendments(file: h5py.Group) -> None:
    """Remove what was added while more was to come."""
    added = json.loads(file.attrs.get(AMENDED, "{}"))
    if not added:
        return
    for name in [x for x in file.attrs if x.startswith((*AFTERWARDS, AMENDED))]:
        del file.attrs[name]
    for name in added["fields"]:
        del file[name]
    for column in EVENTS:
        file[f"events/{column.name}"].resize(added["events"], axis=0)


# Outputs are held back at most so many times as long as writing takes: a reader hardly notices, a kill loses no more,
# and a run that saves a thousand times a second spends 2 % of its time here instead of half.
_PART = 50.0
# s that it takes to make a dataset of a new file, of which several lines have thousands.
_MAKING = 2e-4
# Bytes of rows that wait at most, so that the memory of a long run stays flat: it computes 30 MB a second.
_MOST_WAITING = 16_000_000


class WriteMode(NamedTuple):
    """How a file is written while its result is computed.

    before: what was found before the run, for whoever goes on with it; None: nobody can, it has no checkpoints.
    late: whether there is no file before the first flush; without one it is written when the recorder is closed, and if
    that is "complete" and `amended`, it waits in `late_file` for whoever puts it in its place.
    unseen: whether nobody reads it before it is complete: rows wait until they are many.
    """

    before: Tree | None = None
    late: bool = False
    unseen: bool = False


AT_ONCE = WriteMode()  # the file is there from the start, nobody goes on with it


class Recorder(Rows):
    """Writes one result, of one line or of several; a context manager that closes it with the right status.

    All of it is in memory until a file appears, and rows are then until they are written.
    target: path, or a BytesIO or arrays for a result in memory, which has no checkpoints.
    outputs: the number of outputs if it is known; it only makes small files smaller.
    overwrite: replace an existing result.  Another program's file is never replaced.
    parts: results of lines by name, which are groups of this one, written and closed with it.
    """

    late_file: LateFile | None = None
    amended = False

    def __init__(
        self,
        target: str | Target,
        header: Header,
        *,
        outputs: int | None = None,
        overwrite: bool = False,
        mode: WriteMode = AT_ONCE,
        parts: Mapping[str, Rows] | None = None,
    ) -> None:
        super().__init__(header)
        self._memory = None if isinstance(target, str | Path) else target
        self.path = Path(target).expanduser().resolve() if isinstance(target, str | Path) else None
        if self.path is not None:
            check_target(self.path, overwrite)
        self._parts, self._outputs_known, self._unseen = dict(parts or {}), outputs, mode.unseen
        self._before = None if self.path is None else mode.before
        self.files: Mapping[str, str] = {}  # digests of files that the run reads, for checkpoints
        self._file: Any = None  # once there is one
        self._datasets: dict[str, h5d.DatasetID] = {}  # of what does not grow
        self._slots: list[h5py.Dataset] = []
        self._number = 0  # of the next checkpoint
        self._checkpoints: dict[int, bytes] = {}  # that wait, by number
        datasets = sum(len(x._fixed) + sum(len(y.fields) for y in x._all) for x in self._every().values())
        # when the file was last written; how long that holds, s
        self._flushed, self._pause = monotonic(), pause(_MAKING * datasets if self.path is not None else 0.0)
        self._broken = False
        if not mode.late:
            self._flushed = -np.inf
            if self.path is not None:
                self._appear()

    def resume(
        self, source: h5py.File, at: Checkpoint, fixed: Sequence[tuple[Field, np.ndarray]] = (), pending: str = ""
    ) -> None:
        """Go on with a result from one of its checkpoints; what came after is left out.

        source: open, perhaps of the same place.  fixed: quantities that do not depend on time, with values if the file
        does not have them; pending: what is to come when it is complete (store.records).
        ResultError if the file holds other fields, or cannot be written.
        """
        every = self._every()
        groups = {name: root_of(source, name) for name in every}
        check_tables(source, groups, {name: each._tables for name, each in every.items()}, at)

        def make(new: Path) -> None:
            with drafted(new) as file:
                self._copy(groups, file, at)
                add_fixed(file, fixed)
                for name in every:
                    root = root_of(file, name)
                    set_status(root, "running", "")
                    for key in [x for x in root.attrs if x.startswith((*AFTERWARDS, AMENDED, PENDING))]:
                        del root.attrs[key]
                    if pending:
                        root.attrs[PENDING] = pending

        self._continue_in(make)
        self._number = at.number + 1
        for name, each in every.items():
            each.resume_after(root_of(self._file, name), of_part(name, at.rows), of_part(name, at.happened))
        self._zones = list(at.zones)

    def _copy(self, groups: Mapping[str, h5py.Group], file: h5py.File, at: Checkpoint) -> None:
        """Copy a result up to a checkpoint, without what is known only when all is done."""
        later = {}  # errors but for those that are fields of the run
        for name, each in self._every().items():
            fields = {field.name for field in each._tables["/"]}
            later[name] = {x for x in names_in(groups[name], "errors") if x not in fields}
        copied(groups[""], file, at.rows, {*later[""], GROUP, BEFORE, *SLOTS})
        for group in self._tables:
            file.require_group(group)
        write_texts(file, {name: made(text) for name, text in self._texts.items()})
        create_slots(file)
        write_before(file, self._before)
        write_slot([file[name] for name in SLOTS], at.number, pack(at._asdict()))
        if self._parts:
            file.require_group(GROUP).attrs["order"] = list(self._parts)
        for name in self._parts:
            copied(groups[name], file.create_group(f"{GROUP}/{name}"), of_part(name, at.rows), later[name])

    def _every(self) -> dict[str, Rows]:
        """This result, under no name, and those of the lines."""
        return {"": self, **self._parts}

    # --- the file -------------------------------------------------------------------------------------

    @property
    def is_late(self) -> bool:
        """Whether there is no file as yet."""
        return self.path is not None and self._file is None

    def contents(self, parts: Mapping[str, ArrayContents] | None = None) -> ArrayContents:
        return super().contents({name: part.contents() for name, part in self._parts.items()})

    def _restart(self) -> Restart | None:
        """What a run that goes on needs; None: nobody can."""
        return None if self._before is None else Restart(dict(self._checkpoints), self._before)

    def _appear(self) -> None:
        """Let readers see a file, with all that there is now."""
        asked = self.contents(), self._restart(), self._outputs_known, False
        self._continue_in(lambda new: write_result(new, *asked))

    def _continue_in(self, make: Callable[[Path], None]) -> None:
        """Write to a new file from now on; make: as of `created`."""
        assert self.path is not None
        self._broken = True  # until there is a file
        self._file = created(self.path, make, many=bool(self._parts))
        self._broken = False
        if self._parts:
            bound_metadata(self._file)
        for name, each in self._every().items():
            for table in each._all:
                table.move(root_of(self._file, name))
        self._slots = [self._file[name] for name in SLOTS if name in self._file]

    @property
    def due(self) -> bool:
        """Whether outputs have been held back long enough, or are many."""
        late = not self._unseen and monotonic() - self._flushed > self._pause
        waiting = sum(table.bytes_waiting for each in self._every().values() for table in each._all)
        return late or (self.path is not None and waiting > _MOST_WAITING)

    def checkpoint(self, content: Callable[[], Mapping[str, Any]]) -> None:
        """Keep a checkpoint at the last output, written with the next flush.

        content: makes its `program`, `asks`, `resolution` and `state`.
        """
        if self._file is None:  # whatever is written, is written at once
            self._number += bool(self._checkpoints)
            self._checkpoints.clear()
        every = self._every()
        rows = {name: {x.scale: x.count + x.waiting for x in each._all if x.fields} for name, each in every.items()}
        for each in every.values():
            each.kept_events = each._events.count + each._events.waiting
        happened = of_all({name: each._happened for name, each in every.items()})
        here = {"number": self._number, "t": self.last, "files": self.files, "rows": of_all(rows)}
        tree = {**here, "happened": happened, "zones": self._zones or [], **content()}
        self._checkpoints[self._number] = pack(tree)

    def flush(self, made: float = 0.0) -> None:
        """Write what is held back, for readers to see; made: s that it took to make it, beyond what waited made."""
        begin = monotonic()
        if self.path is not None:
            if self._file is None:
                self._appear()
            else:
                with self._writing():
                    self._write()
            if self._checkpoints:
                with self._writing():
                    os.fsync(self._file.id.get_vfd_handle())  # a machine that goes down loses no more than a kill does
                self._number += 1
                self._checkpoints.clear()
        self._flushed = monotonic()
        self._pause = max(pause(made), _PART * (self._flushed - begin))

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

    def _write(self) -> None:
        every = {name: each for name, each in (*self._parts.items(), ("", self))}
        for each in every.values():
            each.sort_events()
        waiting = [table for each in every.values() for table in reversed(each._all) if table.waiting]
        for together in in_turn(waiting):
            for table in together:
                table.write()
            if len(together) < len(waiting):
                self._file.flush()
        for group, each in every.items():
            for name, values in each._replaced.items():
                path = group_of(group) + name
                if path not in self._datasets:
                    self._datasets[path] = h5d.open(self._file.id, path.encode())
                write_all(self._datasets[path], values)
            each._replaced.clear()
        for number, packed in self._checkpoints.items():
            write_slot(self._slots, number, packed)
        # HDF5 may write in any order between two flushes.  So: the data, then the scales that
        # say it is there, and t last, which says that the zones of the output are there too; that of the parts before.
        self._file.flush()
        outputs = {id(each._outputs) for each in self._parts.values()}
        last = [x for x in waiting if id(x) in outputs], [x for x in waiting if x is self._outputs]
        first = [x for x in waiting if id(x) not in outputs and x is not self._outputs]
        for tables in (first, *last):
            for together in in_turn(tables):
                for table in together:
                    table.commit(at_once=not self._parts)
                self._file.flush()

    def close(self, status: str = "complete", message: str = "") -> None:
        """Write the status and close the file; a second call does nothing."""
        if self.closed or self._broken:
            return
        for part in self._parts.values():
            part.close(status, message)
        super().close(status, message)
        if self._file is None:
            self._deliver(status)
            return
        self.flush()
        with self._writing():
            for name in self._every():
                set_status(root_of(self._file, name), status, message)
            self._file.flush()
            self._leave()
            self._file.close()
        assert self.path is not None
        sign(self.path)

    def _leave(self) -> None:
        """Hold no datasets any more: HDF5 looks for what is open, in time that grows with its square."""
        for each in self._every().values():
            for table in each._all:
                table.move(None)
        self._datasets.clear()
        self._slots = []

    def _deliver(self, status: str) -> None:
        """Give the result to its target in memory, or write the file in one go.

        It is put in its place unless it will be amended.
        """
        contents = self.contents()
        if isinstance(self._memory, MemoryTarget):
            self._memory.contents = contents
        elif self._memory is not None:
            self._memory.write(image_of_result(contents, None, self._outputs_known, True))
        else:
            assert self.path is not None
            self.late_file = LateFile(self.path, contents, self._restart(), self._outputs_known)
            if not (self.amended and status == "complete"):
                self.late_file.place()
