"""The results of a study on disk: a Zarr group with one chunk for each batch of cases.

Every array lies along `case`.  A chunk is written completely or not at all, and the `status` of a batch after all else:
a batch with a status is there.  One that was cut off is computed again, and its chunks are replaced.

Layout::

    attributes   format, identity (hash of the study), batch (cases in a chunk), title, study (JSON), created, versions,
                 shares (JSON, by result: what `hybrid.shares` has found)
    case (n)     number of the case
    <variable> (n)                   what was varied, and what was derived from it
    status (n)   0: not done, 1: done, 2: failed
    reason (n)   why a case failed; events (n): kinds of events of its run, by weight
    accuracy_verdict (n)  on the accuracy that its scene asks for, with the reason and what to do; empty: none is asked
    accuracy_used (n)     largest error over what is asked
    cpu (n) s    processor time of the run; steps (n)
    <collected> (n, ...)             NaN where a case is not done or has failed
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from shutil import rmtree
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hybrid.errors import ResultError, optional_package
from hybrid.store.envelope import NOT_VERIFIED
from hybrid.store.verdicts import MET, MISSED, asked_accuracy

if TYPE_CHECKING:
    import xarray

    from hybrid.store.reader import Result


FORMAT = "hybrid-cable study 1"
# Status of a case.
OPEN = 0
DONE = 1
FAILED = 2
# Reasons of cases that failed by what is around them, as they begin: the next call computes these again.
KILLED = "its worker died at every try (out of memory?)"
NOT_WRITTEN = "its result: "
# Attribute of a coordinate whose values are written: an array and its values are two files.
COMPLETE = "complete"
# What is known of every case, with unit and description.
OWN: dict[str, tuple[str, str, Any, Any]] = {
    "status": ("", "0: not done, 1: done, 2: failed", "i1", OPEN),
    "reason": ("", "why the case failed", str, ""),
    "events": ("", "kinds of events of its run, the weightiest first", str, ""),
    "accuracy_verdict": ("", "verdict on the accuracy that was asked for", str, ""),
    "accuracy_used": ("", "largest error over what was asked", "f8", np.nan),
    "cpu": ("s", "processor time of the run", "f8", np.nan),
    "steps": ("", "time steps of the run", "i8", -1),
}


def _described(column: Column, dims: list[str]) -> dict[str, Any]:
    """Dimensions, unit and description of an array."""
    return {"dimension_names": dims, "attributes": {"units": column.unit, "long_name": column.description}}


class Column(NamedTuple):
    """An array of a study: unit, description, the names of its dimensions beside `case`, and its values."""

    unit: str
    description: str
    dims: tuple[str, ...]
    values: np.ndarray


@contextmanager
def _begun_passed_over() -> Iterator[None]:
    """Arrays are listed also while another process writes them or after that was killed.

    A file that is written at this moment has the ending `partial` until it is complete, and the folder of an array is
    there before its description: zarr warns of both.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=r"Object at \S+ is not recognized")
        yield


class StudyFile:
    """Results of a study that grow batch by batch."""

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        zarr = optional_package("zarr", "a study", "studies")
        try:
            self._group = zarr.open_group(str(self.path), mode="r+")
            found = str(self._group.attrs.get("format", ""))
        except (OSError, KeyError, ValueError, FileNotFoundError) as error:
            raise ResultError(
                f"{path} is no study\n    detail:   {error}\n    try:      hybrid study STUDY.yaml"
            ) from None
        if found != FORMAT:
            raise ResultError(
                f"{path} is no study of this release\n    given:    format '{found}'\n    expected: '{FORMAT}'"
            )
        self.batch = int(self._group.attrs["batch"])
        self._status = np.asarray(self._group["status"][:])
        self.cases = int(self._group["case"].shape[0])
        # What is open already: to find and open an array in its folder takes longer than to write a chunk.
        with _begun_passed_over():
            self._arrays = dict(self._group.arrays())
        self._coordinates: dict[str, np.ndarray] = {}

    @classmethod
    def create(
        cls, path: str | Path, columns: Mapping[str, Column], cases: int, batch: int, attributes: Mapping[str, Any]
    ) -> StudyFile:
        """Begin a study; columns: what is varied and derived.  ResultError if the folder cannot be made."""
        zarr = optional_package("zarr", "a study", "studies")
        made = {"created": datetime.now(UTC).isoformat(timespec="seconds"), "version_hybrid": version("hybrid-cable")}
        draft = Path(path).with_name(f".{Path(path).name}.new")
        try:
            if draft.exists():
                rmtree(draft)
            group = zarr.open_group(str(draft), mode="w", zarr_format=3)
            numbers = Column("", "number of the case", (), np.arange(cases))
            for name, column in ({"case": numbers} | dict(columns)).items():
                array = cls._array(group, name, column, cases, cases, str if column.values.dtype.kind in "UO" else None)
                array[:] = column.values.astype(object) if column.values.dtype.kind in "UO" else column.values
            for name, (unit, text, kind, empty) in OWN.items():
                what = {"dimension_names": ["case"], "attributes": {"units": unit, "long_name": text}}
                group.create_array(name, shape=(cases,), chunks=(batch,), dtype=kind, fill_value=empty, **what)
            group.attrs.update(made | dict(attributes) | {"batch": batch, "format": FORMAT})
            draft.rename(path)
        except OSError as error:
            raise ResultError(
                f"{path} cannot be made\n    detail:   {error}\n    try:      -o with another name"
            ) from None
        return cls(path)

    @staticmethod
    def _array(group: Any, name: str, column: Column, cases: int, batch: int, kind: Any = None) -> Any:
        inside = () if column.values.ndim == 1 else column.values.shape[1:]
        how = {"shape": (cases, *inside), "chunks": (batch, *inside), "dtype": kind or column.values.dtype}
        how |= {"fill_value": np.nan if column.values.dtype.kind == "f" else None}
        return group.create_array(name, **how, **_described(column, ["case", *column.dims]))

    @property
    def attributes(self) -> dict[str, Any]:
        return dict(self._group.attrs)

    def keep(self, name: str, entries: Mapping[str, Any]) -> None:
        """Write entries of an attribute that is a table in JSON, such as `shares` by result; others of it stay."""
        self._group.attrs[name] = json.dumps({**json.loads(self.attributes.get(name, "{}")), **entries})

    @property
    def status(self) -> np.ndarray:
        """Status (n,) of every case, as it was when the study was opened and with what was added since."""
        return self._status.copy()

    def open_batches(self) -> list[int]:
        """Numbers of the batches that are not done."""
        status = self.status
        return [k for k in range(-(-self.cases // self.batch)) if (status[self.slice_of(k)] == OPEN).any()]

    def slice_of(self, batch: int) -> slice:
        """The cases of a batch."""
        return slice(batch * self.batch, min((batch + 1) * self.batch, self.cases))

    def add(self, batch: int, columns: Mapping[str, Column], coordinates: Mapping[str, Column]) -> None:
        """Write what a batch has found: its collected columns (m, ...), those of OWN, and coordinates of dimensions.

        Columns have the shapes of those of the study, and coordinates are new.  ResultError if the disk takes no more.
        """
        try:
            self._add(self.slice_of(batch), columns, coordinates)
        except OSError as error:
            raise ResultError(
                f"{self.path} cannot be written\n    detail:   {error}\n"
                "    try:      free space on its disk; then the same command goes on"
            ) from None

    def _add(self, where: slice, columns: Mapping[str, Column], coordinates: Mapping[str, Column]) -> None:
        for name, column in coordinates.items():
            shape = {"shape": column.values.shape, "chunks": column.values.shape, "dtype": column.values.dtype}
            how = shape | _described(column, [name])
            array = self._arrays[name] = self._group.create_array(name, overwrite=True, **how)
            array[:] = column.values
            array.attrs[COMPLETE] = 1
        for name, column in columns.items():
            if name == "status":
                continue
            if name not in self._arrays:
                kind = str if column.values.dtype.kind in "UO" else None
                self._arrays[name] = self._array(self._group, name, column, self.cases, self.batch, kind)
            text = column.values.dtype.kind in "UO"
            self._arrays[name][where] = column.values.astype(object) if text else column.values
        self._arrays["status"][where] = self._status[where] = columns["status"].values

    def __contains__(self, name: str) -> bool:
        """Whether there is a column of that name."""
        return name in self._arrays

    def shape_of(self, name: str) -> tuple[int, ...]:
        """Shape of a column in one case."""
        return tuple(self._arrays[name].shape[1:])

    def coordinate(self, name: str) -> np.ndarray | None:
        """Values of a dimension; None: there are none yet, or a kill came while they were written."""
        if name not in self._coordinates:
            if name not in self._arrays or not self._arrays[name].attrs.get(COMPLETE):
                return None
            self._coordinates[name] = np.asarray(self._arrays[name][:])
        return self._coordinates[name]

    @property
    def failed_around(self) -> list[int]:
        """Cases that failed by what is around them: their workers were killed, or their files not written."""
        failed = np.flatnonzero(self._status == FAILED)
        reasons = np.asarray(self._arrays["reason"][:]) if failed.size else np.zeros(0)
        return [int(k) for k in failed if str(reasons[k]).startswith((KILLED, NOT_WRITTEN))]

    def reopen(self, cases: Iterable[int]) -> None:
        """Make cases open again, to be computed anew."""
        self._status[list(cases)] = OPEN
        self._arrays["status"][:] = self._status


def open_study(path: str | Path) -> xarray.Dataset:
    """The results of a study as a Dataset over `case`, with variables, statuses and what was collected.

    ResultError when there is no study.  A study that is being computed is read as it is now.
    """
    xr = optional_package("xarray", "a study", "studies")
    StudyFile(path)
    with _begun_passed_over():
        found = xr.open_zarr(str(path), consolidated=False, chunks=None).load()
    names = json.loads(found.attrs["variables"])
    return found.set_coords([name for name in ("case", *names) if name in found])


def counts_of(status: Sequence[int] | np.ndarray) -> dict[str, int]:
    """How many cases are done, failed and left."""
    values = np.asarray(status)
    return {name: int((values == k).sum()) for name, k in (("done", DONE), ("failed", FAILED), ("left", OPEN))}


def reasons_of(cases: xarray.Dataset) -> list[tuple[str, list[int]]]:
    """Reasons of cases without place and time, those of most cases first, and numbers of these cases."""
    found: dict[str, list[int]] = {}
    for number, reason in zip(cases["case"].values.tolist(), cases["reason"].values.tolist(), strict=True):
        found.setdefault(str(reason).split(" (t = ")[0], []).append(number)
    return sorted(found.items(), key=lambda x: -len(x[1]))


def ranges_of(cases: xarray.Dataset) -> list[dict[str, Any]]:
    """Of each number that was kept: smallest, median and largest value of all cases, and the case of the largest."""
    rows = []
    for name in sorted(map(str, cases.data_vars)):
        values = cases[name].values
        if cases[name].dims != ("case",) or values.dtype.kind != "f" or name in OWN:
            continue
        row: dict[str, Any] = {"name": name, "unit": cases[name].attrs.get("units", "")}
        row |= dict.fromkeys(("smallest", "median", "largest", "case"))
        if np.isfinite(values).any():
            worst = int(np.nanargmax(values))
            row |= {"smallest": float(np.nanmin(values)), "median": float(np.nanmedian(values))}
            row |= {"largest": float(values[worst]), "case": int(cases["case"].values[worst])}
        rows.append(row)
    return rows


# What a study says of the accuracy that its scenes ask for: the verdict on each case, and which do not meet it.


class Unmet(NamedTuple):
    """Cases of a study that missed the accuracy asked, or of which it is not verified.

    cases: their numbers; worst: the one whose error is largest over what is asked, where none is known the first;
    used: that error over what is asked, NaN: not known; text: why, and what to do; done: how many cases are done.
    """

    verdict: str
    cases: list[int]
    worst: int
    used: float
    text: str
    done: int

    def __str__(self) -> str:
        """In words."""
        times = f" (its error is {self.used:.3g} times what is asked)" if np.isfinite(self.used) else ""
        what = "missed the accuracy asked" if self.verdict == MISSED else "have the accuracy asked not verified"
        return f"{len(self.cases)} of {self.done} cases {what}, case {self.worst} most of all{times}: {self.text}"


def accuracy_of_case(result: Result) -> tuple[str, float]:
    """The verdict on the accuracy that was asked for, with the reason and what to do, and the error over what is asked.

    The worst of all lines.  "", NaN: none was asked.
    """
    found = [(name, line, asked) for name, line in result.each_line() for asked in asked_accuracy(line)]
    if not found:
        return "", np.nan
    used = float(np.fmax.reduce([float(line.attributes.get("accuracy_used", np.nan)) for _, line, _ in found]))
    for verdict in (MISSED, NOT_VERIFIED):
        for name, line, asked in found:
            if asked.verdict == verdict:
                events = (event.text for event in line.events if event.kind == "accuracy missed")
                why = next(events, "") if verdict == MISSED else f"{asked.why}; try: {asked.remedy}"
                return f"{verdict}: {f'line {name}: ' * bool(name)}{why}", used
    return MET, used


def unmet_accuracy(found: xarray.Dataset) -> list[Unmet]:
    """Which of the cases that are done missed the accuracy asked, and of which it is not verified; empty: none."""
    if "accuracy_verdict" not in found:  # of an earlier release
        return []
    out, done = [], found["status"].values == DONE
    words, used = [str(x) for x in found["accuracy_verdict"].values], found["accuracy_used"].values
    for verdict in (MISSED, NOT_VERIFIED):
        which = np.flatnonzero([x.startswith(verdict) for x in words] & done)
        if which.size:
            k = int(which[np.argmax(np.nan_to_num(used[which], nan=-1.0))])
            text, cases = words[k].removeprefix(f"{verdict}: "), found["case"].values
            worst, each = int(cases[k]), cases[which].tolist()
            out.append(Unmet(verdict, each, worst, float(used[k]), text, int(done.sum())))
    return out
