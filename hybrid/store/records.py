"""What a result consists of and is read from.

Zones and their history, events, attributes; other names that are understood.  It is read from an HDF5 file or a group
of one; of a result in memory see store.format.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from h5py import h5a, h5ds, h5g, h5o, h5s

from hybrid.errors import ResultError
from hybrid.store.format import ArrayContents, plain_text
from hybrid.store.hdf5_file import GROUP, check_format, open_file
from hybrid.store.integrity import readable

PENDING = "pending"  # attribute of a complete result to which more will be added; its values are:
ERROR_ESTIMATE = "error estimate"
FINER_RESULT = "finer result"
# Attribute of a result with zones that move: which rods there are at first and why, as JSON.
RODS_AT_START = "rods_at_start"

UNKNOWN = "error not known: not converged"  # in place of the figure of an error that says nothing
# Attribute: names, with commas, of quantities of which finer runs change as much as coarser ones did.
NOT_CONVERGED = "errors_not_converged"
# Other names of what a file holds: short ones, and those of older versions.
ALIASES = {"times": "t", "moment": "bending_moment"}
OLD_NAMES = {
    f"{table}/pull_{end}": f"{table}/end_force_{end}"
    for table in ("steps", *(f"errors/{cause}" for cause in ("mesh", "time", "model", "total")))
    for end in ("start", "end")
}
OLD_ATTRIBUTES = {f"error_{cause}_pull": f"error_{cause}_end_force" for cause in ("mesh", "time", "model", "total")}
OLD_EVENTS = {
    "pull between outputs": "end force between outputs",
    "clamp left out": "bending at clamp neglected",
    "point left out": "bending at point load neglected",
    "torque left out": "torque neglected",
    "friction left out": "static friction neglected",
    "zones held": "zones fixed",
    "turned in": "end rotated in",
    "events left out": "events omitted",
    "error beyond estimate": "model error not estimated",
    "not judged": "stability not judged",
    "loses energy": "numerical dissipation",
}


def right_of(name: str) -> str:
    """Name of the array with the values on the right of jumps: right/tension, errors/total/right_tension."""
    group, _, last = name.rpartition("/")
    return f"{group}/right_{last}" if group else f"right/{name}"


class Zone(NamedTuple):
    """A stretch s_a <= s <= s_b (m, unstretched) and the kind of model that holds there."""

    kind: str
    s_a: float
    s_b: float

    def __str__(self) -> str:
        return f"{self.kind} {self.s_a:.6g}-{self.s_b:.6g} m"


class Mesh(NamedTuple):
    """Cells of the cable: nodes s (N+1,) m, unstretched, and kinds (N,) of the cells between them, as of zones."""

    s: np.ndarray
    kinds: np.ndarray

    def __repr__(self) -> str:
        count = ", ".join(f"{n} {kind}" for kind, n in zip(*np.unique(self.kinds, return_counts=True), strict=True))
        h = np.diff(self.s)
        return f"<mesh of {h.size} cells of {h.min():.4g} to {h.max():.4g} m: {count}>"


# Fields of a line whose cells follow the curvature, or which is paid out, and of one that is.
THERE, RIDES = "mesh/there", "mesh/rides"


def node_bits(s: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Bits in words of 64 for places s (K,) m, rising: those that are nodes (N+1,) m.

    All nodes are among them, but for those that move with the winch of a line that is paid out.
    """
    bits = np.zeros(-(-s.size // 64) * 64, np.uint8)
    at = np.minimum(np.searchsorted(s, nodes), s.size - 1)
    bits[at[s[at] == nodes]] = 1
    return np.packbits(bits, bitorder="little").view("<i8").astype(np.int64)


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
    """The file holds nothing of this name; an AttributeError too, so that `hasattr` works."""


class Attributes(dict[str, Any]):
    """Attributes of a file by name; names of older versions are understood in `attributes[name]`."""

    def __missing__(self, name: str) -> Any:
        if name in OLD_ATTRIBUTES:
            return self[OLD_ATTRIBUTES[name]]
        raise KeyError(name)


class OnRequest(Mapping[str, Any]):
    """What is known of names, looked up when it is asked for, once."""

    def __init__(
        self, names: Collection[str], read: Callable[[str], Any], aliases: Mapping[str, str] | None = None
    ) -> None:
        """aliases: other names of some of them."""
        self._names, self._read, self._known = names, read, dict[str, Any]()
        self._aliases = {alias: name for alias, name in (aliases or {}).items() if name in names}

    def __getitem__(self, name: str) -> Any:
        name = self._aliases.get(name, name)
        if name not in self._known:
            if name not in self._names:
                raise KeyError(name)
            self._known[name] = self._read(name)
        return self._known[name]

    def __contains__(self, name: object) -> bool:
        return name in self._names or name in self._aliases

    def __iter__(self) -> Iterator[str]:
        yield from (*self._names, *self._aliases)

    def __len__(self) -> int:
        return len(self._names) + len(self._aliases)


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
        sets = [f"from output {i}: {joined(list(map(str, z)))}" for i, z in zip(self._first, self._sets, strict=True)]
        return f"<zones at {self._count} outputs; {joined(sets, '; ')}>"


class MeshHistory(Sequence[Mesh]):
    """`mesh[i]`: the cells at output i, in the order of s."""

    def __init__(
        self,
        s: np.ndarray,
        always: np.ndarray,
        zones: ZoneHistory,
        words: np.ndarray | None = None,
        rides: np.ndarray | None = None,
    ) -> None:
        """Which of the nodes s (K,) m there are at every output.

        always: (K,) those outside of rods as well; words: the nodes of every output, of `node_bits`; None: all in rods;
        rides: (nt, M) m, nodes beside them, on a winch.
        """
        self._s, self._always, self._zones, self._words, self._rides = s, always.astype(bool), zones, words, rides

    def __len__(self) -> int:
        return len(self._zones)

    def __getitem__(self, i: Any) -> Any:
        if isinstance(i, slice):
            return [self[k] for k in range(*i.indices(len(self)))]
        zones, s = self._zones[i], self._s
        bounds = np.array([zone.s_b for zone in zones[:-1]])
        names = np.array([zone.kind for zone in zones])
        if self._words is not None:  # of rods and catenaries
            there = np.unpackbits(self._words[i].astype("<i8").view(np.uint8), bitorder="little")[: s.size] == 1
        else:
            there = self._always | (names[np.searchsorted(bounds, s)] == "rod")  # of a bound, the zone before it
        nodes = s[there] if self._rides is None else np.sort(np.concatenate([s[there], self._rides[i]]))
        return Mesh(nodes, names[np.searchsorted(bounds, 0.5 * (nodes[1:] + nodes[:-1]))])


def joined(texts: list[str], by: str = ", ") -> str:
    """The first six texts, and how many more there are."""
    return by.join(texts if len(texts) <= 6 else [*texts[:6], f"and {len(texts) - 6} more"])


def not_converged_in(attributes: Mapping[str, Any]) -> frozenset[str]:
    """Names of quantities whose figure of the error says nothing, from the attributes of a result or of a line."""
    names = frozenset(filter(None, str(attributes.get(NOT_CONVERGED, "")).split(",")))
    return names | ({"end_force"} if names & {"tension", "end_force_start", "end_force_end"} else set())


def not_converged_attribute(each: Iterable[Iterable[str]]) -> dict[str, str]:
    """The attribute of a result, or of several lines, of which quantities by name do not converge; {}: all do."""
    names = dict.fromkeys(name for names in each for name in names)
    return {NOT_CONVERGED: ",".join(names)} if names else {}


def error_words(attributes: Mapping[str, Any]) -> str:
    """The largest errors of position and of the end forces in words, from the attributes of a result that has them."""
    unknown = not_converged_in(attributes)
    figures = (("position", "position", "m", ""), ("end_force", "end forces", "N", " at the ends"))
    texts = []
    for name, called, unit, where in figures:
        two = f"{float(attributes[f'error_total_{name}']):.2g}" if name not in unknown else ""  # digits
        texts.append(f"{float(two):.9g} {unit}{where}" if two else f"of {called} not known (not converged)")
    return ", ".join(texts)


TEXTS = ("scene", "changes")
HIDDEN = ("checkpoint", GROUP)  # what is for the program alone, and results of lines


class FileContents:
    """The contents of a file, a running one too, or of the bytes of one in memory."""

    def __init__(self, source: Path | io.BytesIO, summed: bool = True, line: str = "") -> None:
        """summed: as of `open_file`; line: of which alone it is, of a result of several lines.  ResultError."""
        self._file = open_file(source, summed)
        try:
            with readable(source):
                check_format(self._file, source)
                self._root: Any = self._file[f"{GROUP}/{line}"] if line else self._file
                self._scan()
                lines = not line and GROUP in self._file
                self.order = tuple(map(plain_text, self._file[GROUP].attrs["order"])) if lines else ()
        except BaseException:
            self._file.close()
            raise

    def _scan(self) -> None:
        names: list[str] = []
        self._root.id.links.visit(lambda path: names.append(path.decode()))
        shown = [n for n in names if n.split("/")[0] not in HIDDEN and n not in TEXTS]
        groups = {n.rpartition("/")[0] for n in shown} - {""}
        # groups are not empty, but for tables of the result itself without columns
        empty = [n for n in shown if "/" not in n and n not in groups]
        groups.update(n for n in empty if isinstance(h5o.open(self._root.id, n.encode()), h5g.GroupID))
        self.groups = sorted(groups)
        self._stored = {OLD_NAMES.get(n, n): n for n in shown if n not in groups}
        self.data: Mapping[str, Any] = OnRequest(self._stored, self._dataset)

    def _dataset(self, name: str) -> Any:
        """A dataset of HDF5's own interface, which takes a quarter of the time of h5py's; None: the file is closed."""
        return h5o.open(self._root.id, self._stored[name].encode()) if self._root else None

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes of the result."""
        return {k: _plain(v) for k, v in self._root.attrs.items()}

    @property
    def is_open(self) -> bool:
        """Whether it was not closed."""
        return bool(self._file)

    def scales(self) -> list[str]:
        """Names of dimension scales, whose lengths say how many rows are complete; none where all rows are."""
        if plain_text(self._root.attrs["status"]) != "running":
            return []
        return [name for name, data in self.data.items() if h5ds.is_scale(data) and self.dims_of(data) == (name,)]

    def dims_of(self, data: Any) -> tuple[str, ...]:
        """Names of the dimensions of a dataset."""
        return tuple(plain_text(h5ds.get_label(data, k)) for k in range(data.rank))

    def units_of(self, data: Any) -> str:
        """The unit of a dataset; empty if it has none."""
        if not h5a.exists(data, b"units"):
            return ""
        attribute = h5a.open(data, b"units")
        value = np.empty(attribute.shape, attribute.dtype)
        attribute.read(value)
        return plain_text(value[()])

    def label(self, name: str) -> dict[str, str]:
        """`units`, `description` and `frame` of a dataset, empty where it has none."""
        self._refreshed(name)
        attrs = self._root[self._stored[name]].attrs
        return {key: plain_text(attrs.get(key, "")) for key in ("units", "description", "frame")}

    def _refreshed(self, name: str) -> Any:
        """A dataset of HDF5's own interface, whose length is that of now."""
        data = self.data[name]
        if self._file.swmr_mode:
            data.refresh()  # HDF5 may remember it from a moment before
        return data

    def length(self, name: str) -> int:
        """Rows of a dataset now."""
        return int(self._refreshed(name).shape[0])

    def values(self, name: str, rows: int | None) -> np.ndarray:
        """The first rows of a dataset; None: all of it."""
        data = self._refreshed(name)
        shape = data.shape if rows is None else (rows, *data.shape[1:])
        out = np.empty(shape, data.dtype)
        if out.size:
            there = data.get_space()
            if rows is not None:
                there.select_hyperslab((0,) * len(shape), shape)
            data.read(h5s.create_simple(shape) if shape else h5s.create(h5s.SCALAR), there, out)
        return out

    def text(self, name: str) -> str:
        """One of TEXTS; empty if there is none."""
        return plain_text(self._root[name][()]) if name in self._root else ""

    def close(self) -> None:
        """Let go of it."""
        self._file.close()


Contents = ArrayContents | FileContents


def _plain(value: Any) -> Any:
    return plain_text(value) if isinstance(value, bytes) else value.item() if isinstance(value, np.generic) else value
