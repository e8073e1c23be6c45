"""Read what a run has written: `open_result("run.h5")` gives a `Result`.

The file is HDF5 and every dataset says its own unit, frame and dimensions, so the reader is generic: whatever
was recorded is there under its name, as an attribute (``result.tension``) or an item
(``result["energy/kinetic"]``).  Arrays are read when they are asked for, once.

Layout, format 1 (`record` writes it)::

    /t (nt)  /s (ns)  /xyz (3)      dimension scales: s, m, and the inertial axes
    /tension (t, s)  /energy/kinetic (t)  ...    one dataset per field
    /steps/*                        one row per time step; its first column is the scale
    /zones/{t,output,kind,s_a,s_b}  one row per zone, written only when the zones change;
                                    they hold from output number `output` on
    /events/{t,s_a,s_b,kind,text}   one row per event; of a change of zones also
    /events/{criterion,value,threshold,energy}
    /scene                          the scene, as YAML text
    /changes                        scenes that held from some time on, as JSON; only where there are any
    /checkpoint                     from which a run goes on (`checkpoint`); for the program alone

A table grows by whole rows and its dimension scale grows last, so the length of the
scale says how many rows are complete; a reader beside a running writer, or after a
kill, looks at no row beyond it.
"""

from __future__ import annotations

import atexit
import difflib
import html
import io
import time
import weakref
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import h5py
import numpy as np

from hybrid.errors import ResultError
from hybrid.store.integrity import being_written, readable
from hybrid.store.names import ALIASES, OLD_ATTRIBUTES, OLD_EVENTS, OLD_NAMES

if TYPE_CHECKING:
    import xarray

FORMAT = "hybrid-cable"
FORMAT_VERSION = 1
TEXTS = ("scene", "changes")
HIDDEN = ("checkpoint",)  # what is for the program alone

# The writer holds the file alone while it starts, for milliseconds; so long (s) a reader waits for it to let go.
_PATIENCE = 1.0
# A writer brings the first bytes up to date in a single write, so what is still wrong after so long (s) is wrong.
_TORN = 0.1


class Zone(NamedTuple):
    """A stretch s_a <= s <= s_b (m, unstretched) and the kind of model that holds there."""

    kind: str
    s_a: float
    s_b: float

    def __str__(self) -> str:
        return f"{self.kind} {self.s_a:.6g}-{self.s_b:.6g} m"


class Event(NamedTuple):
    """Something that happened at time t (s) on s_a <= s <= s_b (m), and why.

    Of a change of zones also: the criterion, its value and threshold, and the energy (J) that all changes of this
    moment put in, on the first of them.
    """

    t: float
    s_a: float
    s_b: float
    kind: str
    text: str
    criterion: str = ""
    value: float | None = None
    threshold: float | None = None
    energy: float | None = None  # J


class UnknownName(ResultError, AttributeError):
    """The file holds nothing of this name.  (An AttributeError too, so that `hasattr` works.)"""


class Attributes(dict[str, Any]):
    """Attributes of a file by name; names of older versions are understood in `attributes[name]`."""

    def __missing__(self, name: str) -> Any:
        if name in OLD_ATTRIBUTES:
            return self[OLD_ATTRIBUTES[name]]
        raise KeyError(name)


class Columns(Mapping[str, np.ndarray]):
    """The datasets of one group, by name: ``result.energy["kinetic"]`` or ``result.energy.kinetic``."""

    def __init__(self, result: Result, group: str) -> None:
        self._result, self._group = result, group
        self._keys = [n.removeprefix(group + "/") for n in result.names if n.startswith(group + "/")]

    def __getitem__(self, key: str) -> np.ndarray:
        return self._result[f"{self._group}/{key}"]

    def __getattr__(self, key: str) -> np.ndarray:
        if key.startswith("_"):
            raise AttributeError(key)
        return self[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._keys)

    def __len__(self) -> int:
        return len(self._keys)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._keys]

    def __repr__(self) -> str:
        return f"<{self._result.describe(self._group)}>"


class ZoneHistory(Sequence[list[Zone]]):
    """`zones[i]`: the zones at output i, in the order of s."""

    def __init__(self, outputs: np.ndarray, zones: list[Zone], count: int) -> None:
        self._first, starts = np.unique(outputs, return_index=True)
        self._sets = [zones[a:b] for a, b in zip(starts, [*starts, len(zones)][1:], strict=True)]
        self._count = count

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, i: Any) -> Any:
        if isinstance(i, slice):
            return [self[k] for k in range(*i.indices(self._count))]
        if not -self._count <= i < self._count:
            raise IndexError(f"output {i} of {self._count}")
        k = int(np.searchsorted(self._first, i % self._count, side="right")) - 1
        return list(self._sets[k]) if k >= 0 else []

    def __repr__(self) -> str:
        sets = [f"from output {i}: {_joined(list(map(str, z)))}" for i, z in zip(self._first, self._sets, strict=True)]
        return f"<zones at {self._count} outputs; {_joined(sets, '; ')}>"


# HDF5 calls Python to close a file in memory, which crashes the interpreter when that happens while it shuts down.
_ALIVE: weakref.WeakSet[Result] = weakref.WeakSet()


@atexit.register
def _close_all() -> None:
    for result in list(_ALIVE):
        result.close()


class Result:
    """The recorded answer of one run.

    Arrays have the output times first: `position` is (nt, ns, 3).  `units`, `describe` and `dims` say what each
    is.  Use `refresh` to see what a running computation has added since.
    """

    def __init__(self, source: Path | io.BytesIO) -> None:
        self._source = source
        self._open()
        _ALIVE.add(self)

    def _open(self) -> None:
        self._file = _open_file(self._source)
        try:
            with readable(self._source):
                _check_format(self._file, self._source)
                self._scan()
        except BaseException:
            self._file.close()
            raise

    def _scan(self) -> None:
        self._cache: dict[str, np.ndarray] = {}
        self._dims: dict[str, tuple[str, ...]] = {}
        self._stored: dict[str, str] = {}  # names in the file, where another version wrote it
        self.units: dict[str, str] = {}
        groups: set[str] = set()

        def visit(name: str, item: Any) -> None:
            if name.split("/")[0] in HIDDEN:
                return
            if isinstance(item, h5py.Dataset) and name not in TEXTS:
                if name in OLD_NAMES:
                    self._stored[OLD_NAMES[name]] = name
                    name = OLD_NAMES[name]
                self._dims[name] = tuple(d.label for d in item.dims)
                self.units[name] = _text(item.attrs.get("units", ""))
            elif isinstance(item, h5py.Group):
                groups.add(name)

        self._file.visititems(visit)
        self.names = tuple(self._dims)
        self.units |= {alias: self.units[name] for alias, name in ALIASES.items() if name in self.units}
        # Taken once, so that everything read later shows the same moment of a file that grows.
        # t first: the zones of an output are complete before its time is.
        scales = sorted((n for n, dims in self._dims.items() if dims == (n,)), key=lambda n: n != "t")
        self._rows = {n: self._dataset(n).shape[0] for n in scales}
        self._groups = {g: Columns(self, g) for g in sorted(groups)}
        self.attributes: dict[str, Any] = Attributes(
            {OLD_ATTRIBUTES.get(k, k): _plain(v) for k, v in self._file.attrs.items()}
        )
        table = self._groups["zones"]
        rows = zip(*(table[k].tolist() for k in Zone._fields), strict=True)
        self.zones = ZoneHistory(table["output"], [Zone(*row) for row in rows], len(self.times))

    def _dataset(self, name: str) -> Any:
        data = self._file[self._stored.get(name, name)]
        if self._file.swmr_mode:
            data.refresh()  # HDF5 may remember its length from a moment before the row count was taken
        return data

    def close(self) -> None:
        """Let go of the file; what was read already stays."""
        self._file.close()

    def refresh(self) -> Result:
        """Look at the file again, for what was added since it was opened; returns itself."""
        if isinstance(self._source, Path):
            self._file.close()
            self._open()
        return self

    def __enter__(self) -> Result:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    # ---- arrays -------------------------------------------------------------------------------

    def _known(self, name: str) -> str:
        name = _current(name)
        if name in self._dims:
            return name
        if name in self._groups:
            raise UnknownName(f"'{name}' is a group; ask for {' or '.join(f'{name}/{key}' for key in self[name])}")
        known = [*(n for n in self.names if "/" not in n), *self._groups, "scene_text"]
        known += [a for a, n in ALIASES.items() if n in self._dims]
        near = [n for n in self.names if "/" in n and n.split("/")[1] == name.split("/")[-1]]
        near = near or difflib.get_close_matches(name, dict.fromkeys([*known, *self.names]), 3)
        hint = f"did you mean {' or '.join(near)}?" if near else "it has " + ", ".join(known)
        raise UnknownName(f"the result has no '{name}'; {hint}")

    def __getitem__(self, name: str) -> Any:
        if name in self._groups:
            return self._groups[name]
        name = self._known(name)
        if name not in self._cache:
            if not self._file:
                raise ResultError(f"'{name}' was not read before the result was closed; open the file again")
            dims = self._dims[name]
            with readable(self._source):
                data = self._dataset(name)
                array = data[: self._rows[dims[0]]] if dims and dims[0] in self._rows else data[()]
            if array.dtype.kind == "S":
                array = np.char.decode(array, "utf-8", "replace")
            array.setflags(write=False)  # it is shared by everyone who asks again
            self._cache[name] = array
        return self._cache[name]

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return self[name]

    def __contains__(self, name: object) -> bool:
        return name in self._groups or _current(str(name)) in self._dims

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._groups, *ALIASES, *(n for n in self.names if "/" not in n)]

    def dims(self, name: str) -> tuple[str, ...]:
        """Names of the dimensions of an array, such as ("t", "s", "xyz")."""
        return self._dims[self._known(name)]

    def label(self, name: str) -> dict[str, str]:
        """`units`, `description` and `frame` of an array, as the file has them; empty where it has none."""
        if not self._file:
            raise ResultError("the result is closed; open the file again")
        attrs = self._dataset(self._known(name)).attrs
        return {key: _text(attrs.get(key, "")) for key in ("units", "description", "frame")}

    def describe(self, name: str) -> str:
        """What an array is: dimensions, unit, frame, in a sentence; of a group, what is in it."""
        if name in self._groups:
            units: dict[str, list[str]] = {}
            for key in self._groups[name]:
                units.setdefault(self.units[f"{name}/{key}"], []).append(key)
            return f"{name}: " + "; ".join(", ".join(keys) + f" ({u})" * bool(u) for u, keys in units.items())
        name = self._known(name)
        with readable(self._source):
            unit, description, frame = self.label(name).values()
        head = f"{name}({', '.join(self._dims[name])})" + (f" in {unit}" if unit else "")
        return f"{head}: {description}" + (f" ({frame} frame)" if frame else "")

    def at(self, *, t: Any = None, s: Any = None, names: Sequence[str] | None = None) -> dict[str, Any]:
        """Every field at the times t (s) and arc lengths s (m), linear between outputs and grid points.

        t and s are a number, an array, or None for all; a number takes its dimension away.
        `names` limits the answer to some fields.
        """
        answer = {}
        wanted = [n for n in self.names if self._dims[n][:1] == ("t",) and n != "t"] if names is None else names
        for name in wanted:
            array, dims = self[name], self.dims(name)
            for dim, where in (("s", s), ("t", t)):  # s first: it comes later, so the axis of t stays put
                if where is not None and dim in dims:
                    array = _interpolate(array, dims.index(dim), self[dim], where, dim, "m" if dim == "s" else "s")
            answer[name] = array
        return answer

    def to_xarray(
        self,
        *,
        names: Sequence[str] | None = None,
        times: tuple[float | None, float | None] | None = None,
        at: Any = None,
    ) -> xarray.Dataset:
        """Everything as one Dataset of xarray: over t and s, with units; a slash in a name becomes an underscore.

        names: fields or groups, None for all; times: from and to, s; at: arc lengths, m, in place of the output grid.
        """
        from hybrid.store.selection import part_of
        from hybrid.store.xarray_dataset import dataset

        return dataset(part_of(self, names, times, at))

    # ---- what else was written ----------------------------------------------------------------

    @property
    def file(self) -> Path | None:
        """The file it was read from; None for a result in memory."""
        return self._source if isinstance(self._source, Path) else None

    @property
    def events(self) -> list[Event]:
        """What happened and why, in the order of time."""
        with readable(self._source):
            table = self._groups["events"]
            rows = zip(*(table[k].tolist() for k in Event._fields if k in table), strict=True)
            events = [Event._make(None if x != x else x for x in row) for row in rows]  # NaN: there is none
        return [
            e._replace(kind=OLD_EVENTS.get(e.kind, e.kind), criterion=OLD_EVENTS.get(e.criterion, e.criterion))
            for e in events
        ]

    @property
    def scene_text(self) -> str:
        """The scene that was run, as YAML text."""
        with readable(self._source):
            return _text(self._file["scene"][()])

    @property
    def changes_text(self) -> str:
        """Scenes that held from some time on, as JSON [{"t": s, "scene": YAML}, ...]; empty if there were none."""
        return _text(self._file["changes"][()]) if "changes" in self._file else ""

    @property
    def title(self) -> str:
        return str(self.attributes.get("title", ""))

    @property
    def status(self) -> str:
        """running, complete, interrupted or failed; a killed run never came to change "running"."""
        return str(self.attributes["status"])

    @property
    def message(self) -> str:
        return str(self.attributes["message"])

    @property
    def status_text(self) -> str:
        """The status in words, with its message."""
        status = "interrupted or still running" if self.status == "running" else self.status
        return f"{status}: {self.message}" if self.message else status

    @property
    def versions(self) -> dict[str, str]:
        """Versions of the programs that computed and wrote the result."""
        return {k.removeprefix("version_"): v for k, v in self.attributes.items() if k.startswith("version_")}

    def __repr__(self) -> str:
        t, s = self.times, self.s
        name = self._source.name if isinstance(self._source, Path) else "in memory"
        span = f"t = {t[0]:.6g} ... {t[-1]:.6g} s" if len(t) > 1 else (f"t = {t[0]:.6g} s" if len(t) else "none yet")
        text = f"Result of '{self.title}' ({name}): {len(t)} output{'s' * (len(t) != 1)}, {span}; "
        text += f"{len(s)} points on s = {s[0]:.6g} ... {s[-1]:.6g} m; "
        if len(t) and self.zones[-1]:
            text += f"last zones {_joined(list(map(str, self.zones[-1])))}; "
        return f"<{text}{self.status_text}>"

    def _repr_html_(self) -> str:
        """What a notebook shows; of a result that cannot be drawn, what a terminal shows."""
        try:
            return str(import_module("hybrid.view.notebook_card").card(self))  # by name: the store imports no view
        except Exception:  # a cell must never fail because its result is closed, empty or odd
            try:
                return f"<pre>{html.escape(repr(self))}</pre>"
            except Exception:
                return "<pre>a result that can no longer be read</pre>"


def open_result(source: str | Path | bytes | io.BytesIO) -> Result:
    """Open a result file, or one in memory.

    A file that another process is writing, or that was left by a killed one, opens too,
    with the outputs that were complete.  ResultError when it is not a result.
    """
    source = io.BytesIO(source) if isinstance(source, bytes) else source
    return Result(source if isinstance(source, io.BytesIO) else Path(source).expanduser().resolve())


@contextmanager
def opened(source: Path) -> Iterator[h5py.File]:
    """The HDF5 file of a result, for what is not in a `Result`.  ResultError as of `open_result`."""
    with _open_file(source) as file:
        _check_format(file, source)
        yield file


def is_result(path: Path) -> bool:
    """Whether the file is one of ours, of whatever format version and status."""
    with suppress(ResultError), _open_file(path) as file:
        return _text(file.attrs.get("format", "")) == FORMAT
    return False


def _open_file(source: Path | io.BytesIO) -> h5py.File:
    if not isinstance(source, Path):
        try:
            return h5py.File(source, "r")
        except OSError as error:
            raise ResultError(f"the bytes in memory are no HDF5 file: {error}") from None
    if not source.exists():
        raise ResultError(f"there is no file {source}\n    try:      check the name, or run the scene first")
    if source.is_dir():
        raise ResultError(f"{source} is a folder\n    try:      name the result file in it")
    begin = time.monotonic()
    while True:
        try:
            # SWMR (single writer, multiple readers) for files with a writer, alive or killed, and for no other.
            return h5py.File(source, "r", swmr=being_written(source), locking="best-effort")
        except OSError as error:
            problem: Exception = error
        except ResultError as error:  # perhaps a writer has not come to the end of the first 48 bytes
            problem = error
        waited, torn = time.monotonic() - begin, isinstance(problem, ResultError)
        if not (torn or "lock" in str(problem)) or waited > (_TORN if torn else _PATIENCE):
            break
        time.sleep(0.05)
    if isinstance(problem, ResultError):
        raise problem
    raise ResultError(
        f"{source} cannot be read as a result\n    detail:   {problem}\n    expected: an HDF5 file written by hybrid"
    )


def _check_format(file: h5py.File, source: Path | io.BytesIO) -> None:
    name = str(source) if isinstance(source, Path) else "the file in memory"
    kind, version = _text(file.attrs.get("format", "")), file.attrs.get("format_version")
    if kind != FORMAT:
        raise ResultError(f"{name} is an HDF5 file, but not a result of hybrid\n    given:    format '{kind}'")
    if version != FORMAT_VERSION:
        wrote = _text(file.attrs.get("version_hybrid-cable", "?"))
        said = f"{name} has result format {version}; this program reads format {FORMAT_VERSION}"
        raise ResultError(f"{said}\n    try:      read it with hybrid-cable {wrote}, or run its scene again")


def _interpolate(array: np.ndarray, axis: int, grid: np.ndarray, where: Any, dim: str, unit: str) -> Any:
    x = np.asarray(where, dtype=float)
    if len(grid) == 0:
        raise ResultError(f"the result holds no output yet, so nothing at {dim} = {where} {unit}")
    low, high = grid[0], grid[-1]
    slack = 1e-9 * (high - low)  # what adding up steps loses: 0.1 * 3 is still inside 0 ... 0.3
    bad = ~((x >= low - slack) & (x <= high + slack))
    if bad.any():
        raise ResultError(
            f"{dim} = {np.atleast_1d(x)[np.atleast_1d(bad)][0]:.9g} {unit} is outside the result\n"
            f"    expected: {low:.9g} <= {dim} <= {high:.9g} {unit}"
        )
    if array.dtype.kind not in "fiu":
        raise ResultError(f"text cannot be interpolated along {dim}")
    right = np.clip(np.searchsorted(grid, x), min(1, len(grid) - 1), len(grid) - 1)
    left = np.maximum(right - 1, 0)
    width = grid[right] - grid[left]
    weight = np.clip((x - grid[left]) / np.where(width > 0, width, 1.0), 0.0, 1.0)
    weight = weight.reshape(weight.shape + (1,) * (array.ndim - axis - 1))
    return np.take(array, left, axis) * (1.0 - weight) + np.take(array, right, axis) * weight


def _current(name: str) -> str:
    """The name a dataset has now, from an alias or from the name an older version gave it."""
    return ALIASES.get(name) or OLD_NAMES.get(name, name)


def _joined(texts: list[str], by: str = ", ") -> str:
    return by.join(texts if len(texts) <= 6 else [*texts[:6], f"and {len(texts) - 6} more"])


def _text(value: Any) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def _plain(value: Any) -> Any:
    return _text(value) if isinstance(value, bytes) else value.item() if isinstance(value, np.generic) else value
