"""What is known of a result only when it is complete: estimated errors, what was spent on them."""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from math import nan
from pathlib import Path

import h5py
import numpy as np

from hybrid.store.checkpoint import BEFORE
from hybrid.store.format import EVENTS, Field, annotate, attach, checked
from hybrid.store.hdf5_file import beside, in_memory, redrafted, unwritable
from hybrid.store.integrity import copy_unsigned, sign
from hybrid.store.table import Table

# Name of a quantity, number of its first output, and values; attributes, and events (kind, text).
Block = tuple[str, int, np.ndarray]
Others = tuple[Mapping[str, str | float | int], Sequence[tuple[str, str]]]


def amend(
    target: Path | io.BytesIO,
    fields: Sequence[Field],
    blocks: Iterable[Block],
    others: Callable[[], Others],
    done: bool = True,
) -> None:
    """Add to a complete result what is known only afterwards.

    fields: quantities over the output times, (nt, ...); blocks: all their values: name, number of the first output, and
    values (n, ...) of n outputs; others: gives attributes, and events of all the cable (kind, text), after the last
    block; done: whether nothing is left to go on with.
    """
    if isinstance(target, io.BytesIO):
        with in_memory(target.getvalue()) as file:
            _add(file, fields, blocks, others)
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
            if done and BEFORE in file:
                del file[BEFORE]
            _add(file, fields, blocks, others)
        sign(new)
        os.replace(new, target)
    except (OSError, RuntimeError) as error:
        raise unwritable(target, error, "free some disk space; close programs that hold the file") from error
    finally:
        new.unlink(missing_ok=True)


def _add(file: h5py.File, fields: Sequence[Field], blocks: Iterable[Block], others: Callable[[], Others]) -> None:
    named = {field.name: field for field in fields}
    for field in fields:
        if field.name in file:  # of a result that was amended before, and then resumed
            del file[field.name]
        data = file.create_dataset(field.name, (len(file["t"]), *field.shape), field.dtype)
        annotate(data, field.unit, field.description, field.frame)
        attach(data, ("t", *field.dims), [file["t"], *(file[d] for d in field.dims)])
    for name, begin, values in blocks:
        checked(named[name], values[0])
        file[name][begin : begin + len(values)] = values
    attributes, events = others()
    for name, value in attributes.items():
        file.attrs[name] = value
    if events:
        table = Table(file, "events", EVENTS)
        table.count = len(file["events/t"])
        for event in events:
            table.add_row((0.0, 0.0, float(file["s"][-1]), *event, "", nan, nan, nan))
        table.write()
        table.commit()
