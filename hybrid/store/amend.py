"""What is known of a result only when it is complete: estimated errors, what was spent on them."""

from __future__ import annotations

import io
import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from math import nan
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
from h5py import h5d, h5p, h5s

from hybrid.store.array_contents import ArrayContents, ArrayDataset
from hybrid.store.checkpoint import BEFORE, write_before
from hybrid.store.format import EVENTS, Field, annotate, attach_scales, checked, plain_text
from hybrid.store.hdf5_file import beside, in_memory, redrafted, unwritable
from hybrid.store.integrity import copy_unsigned, sign_new
from hybrid.store.named_arrays import Tree
from hybrid.store.recorder import NUMBERS, Table, write_rows
from hybrid.store.records import FINER_RESULT, PENDING
from hybrid.store.whole_file import LateFile

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
    new = beside(target)  # and then in its place: somebody may be reading
    try:
        copy_unsigned(target, new)
        with redrafted(new) as file:
            change(file)
        sign_new(new)
        os.replace(new, target)
    except (OSError, RuntimeError) as error:
        raise unwritable(target, error, "free some disk space; close programs that hold the file") from error
    finally:
        new.unlink(missing_ok=True)


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
