"""Checkpoints in a result file: from which a run goes on, kept so that a kill at any instant leaves one whole.

Two slots are written in turn, each with its own length and digest (store.integrity), so a slot that a kill has cut
off is recognised and the other is as good as it was.

A file that a killed process was writing cannot be opened for writing again; what goes on is a copy of its rows up to
the checkpoint (store.hdf5_file), put in its place when it is whole.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np

from hybrid.errors import ResultError
from hybrid.store.format import Field, check_column, plain_text
from hybrid.store.hdf5_file import GROUP, of_all
from hybrid.store.integrity import DIGEST, Tree, matched, pack, stored, unpack
from hybrid.store.recorder import write_rows

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
