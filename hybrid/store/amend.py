"""What is known of a result only when it is complete: estimated errors, what was spent on them."""

from __future__ import annotations

import io
import os
from collections.abc import Mapping, Sequence
from math import nan
from pathlib import Path

import h5py
import numpy as np

from hybrid.store.checkpoint import BEFORE
from hybrid.store.format import EVENTS, Field, annotate, attach, checked
from hybrid.store.hdf5_file import beside, in_memory, redrafted, unwritable
from hybrid.store.integrity import copy_unsigned, sign
from hybrid.store.table import Table


def amend(
    target: Path | io.BytesIO,
    fields: Sequence[tuple[Field, np.ndarray]],
    attributes: Mapping[str, str | float | int],
    events: Sequence[tuple[str, str]] = (),
    done: bool = True,
) -> None:
    """Add to a complete result what is known only afterwards.

    fields: quantities over the output times, (nt, ...), with their values; events: kind and text, of all the cable;
    done: whether nothing is left to go on with.
    """
    if isinstance(target, io.BytesIO):
        with in_memory(target.getvalue()) as file:
            _add(file, fields, attributes, events)
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
            _add(file, fields, attributes, events)
        sign(new)
        os.replace(new, target)
    except (OSError, RuntimeError) as error:
        raise unwritable(target, error, "free some disk space; close programs that hold the file") from error
    finally:
        new.unlink(missing_ok=True)


def _add(
    file: h5py.File,
    fields: Sequence[tuple[Field, np.ndarray]],
    attributes: Mapping[str, str | float | int],
    events: Sequence[tuple[str, str]],
) -> None:
    for name, value in attributes.items():
        file.attrs[name] = value
    for field, values in fields:
        checked(field, values[0])
        if field.name in file:  # of a result that was amended before, and then resumed
            del file[field.name]
        data = file.create_dataset(field.name, data=values)
        annotate(data, field.unit, field.description, field.frame)
        attach(data, ("t", *field.dims), [file["t"], *(file[d] for d in field.dims)])
    if events:
        table = Table(file, "events", EVENTS)
        table.count = len(file["events/t"])
        for event in events:
            table.add_row((0.0, 0.0, float(file["s"][-1]), *event, "", nan, nan, nan))
        table.write()
        table.commit()
