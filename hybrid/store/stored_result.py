"""What is stored of one run: the layout of its file, and its arrays by name.

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
    /envelope/{s,<field>_min,<field>_max,<field>_t_min,<field>_t_max,begin,end}
                                    extremes of all accepted steps from begin to end, over nodes (`envelope`)
    /extremes/{<name>,t/<name>}     of named quantities: smallest and largest of all accepted steps, and when
    /mesh/{s,always}                nodes that there may be, and whether they are there outside of rod zones as well
    /mesh/{there,rides}             which of them there are at each output, and nodes that ride with a winch
    /scene                          the scene, as YAML text
    /changes                        scenes that held from some time on, as JSON; only where there are any
    /lines/<name>/*                 of several lines, each with this layout (`lines`)
    /checkpoint                     from which a run goes on (`checkpoint`); for the program alone

A table grows by whole rows and its dimension scale grows last, so the length of the
scale says how many rows are complete; a reader beside a running writer, or after a
kill, looks at no row beyond it.
"""

from __future__ import annotations

import difflib
import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

import numpy as np

from hybrid.errors import ResultError
from hybrid.store.format import ArrayContents, MemoryTarget
from hybrid.store.hdf5_file import Lines
from hybrid.store.integrity import readable
from hybrid.store.records import (
    ALIASES,
    FINER_RESULT,
    OLD_ATTRIBUTES,
    OLD_EVENTS,
    OLD_NAMES,
    PENDING,
    RIDES,
    THERE,
    Attributes,
    Contents,
    Event,
    FileContents,
    MeshHistory,
    OnRequest,
    UnknownName,
    Zone,
    ZoneHistory,
    joined,
    right_of,
)

# Of a time: a step so near to an output ends there.
SAME_TIME = 1e-9


Source = str | Path | io.BytesIO | MemoryTarget


class Columns(Mapping[str, np.ndarray]):
    """The datasets of one group, by name: ``result.energy["kinetic"]`` or ``result.energy.kinetic``."""

    def __init__(self, result: StoredResult, group: str) -> None:
        self._result, self._group = result, group
        self._keys = [n.removeprefix(group + "/") for n in result.names if n.startswith(group + "/")]

    def __getitem__(self, key: str) -> np.ndarray:
        return self._result[f"{self._group}/{key}"]

    def __getattr__(self, key: str) -> np.ndarray:
        if key.startswith("_"):
            raise AttributeError(key)
        return self[key]

    def __contains__(self, key: object) -> bool:
        return f"{self._group}/{key}" in self._result

    def __iter__(self) -> Iterator[str]:
        return iter(self._keys)

    def __len__(self) -> int:
        return len(self._keys)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._keys]

    def __repr__(self) -> str:
        return f"<{self._result.describe(self._group)}>"


# Angles that are cut at half a turn.
TURNS = ("phi", "right/phi")


class StoredResult:
    """What is stored of one run, and nothing that follows from it: arrays, zones, events, lines, status."""

    def __init__(self, source: Source, summed: bool = True, line: str = "", contents: Contents | None = None) -> None:
        """summed: as of `open_file`; line: name of a line of a result of several lines, of which alone it is then.

        contents: of the file, where they are in memory already.
        """
        self._source, self._line = Path(source) if isinstance(source, str) else source, line
        self._open(summed, contents)

    def _open(self, summed: bool = True, contents: Contents | None = None) -> None:
        source = self._source
        if contents is not None:
            self._contents: Contents = contents
        elif isinstance(source, MemoryTarget):
            assert source.contents is not None, "nothing was recorded"
            self._contents = source.contents.part(self._line) if self._line else source.contents
        else:
            self._contents = FileContents(source, summed, self._line)
        try:
            with readable(source):
                self._read_contents()
        except BaseException:
            self._contents.close()
            raise

    def _read_contents(self) -> None:
        contents = self._contents
        self._cache: dict[str, np.ndarray] = {}
        data = contents.data
        self.names, self._groups = tuple(data), contents.groups
        self._dims = OnRequest(data, lambda name: contents.dims_of(_dataset(contents, name)))
        self.units = OnRequest(data, lambda name: contents.units_of(_dataset(contents, name)), ALIASES)
        # Taken once, so that everything read later shows the same moment of a file that grows.
        # t first: the zones of an output are complete before its time is.
        self._rows = {n: contents.length(n) for n in sorted(contents.scales(), key=lambda n: n != "t")}
        self.attributes: dict[str, Any] = Attributes(
            {OLD_ATTRIBUTES.get(k, k): v for k, v in contents.attributes.items()}
        )
        if self.status != "complete" and self._rows.get("t", 0) > 1 and self._rows.get("steps/t"):
            # steps are written as they are made, outputs when the file is brought up to date
            steps, last = contents.values("steps/t", self._rows["steps/t"]), float(self.times[-1])
            self._rows["steps/t"] = int(np.searchsorted(steps, last * (1.0 + SAME_TIME), side="right"))
        table = self["zones"]
        rows = zip(*(table[k].tolist() for k in Zone._fields), strict=True)
        self.zones = ZoneHistory(table["output"], [Zone(*row) for row in rows], len(self.times))

    def close(self) -> None:
        """Let go of the file; what was read already stays."""
        self._contents.close()

    def refresh(self) -> Self:
        """Look at the file again, for what was added since it was opened; returns itself."""
        if isinstance(self._source, Path):
            self._contents.close()
            self._open()
        return self

    def __enter__(self) -> Self:
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
        if self.lines and name.split("/")[0] not in (*self._groups, "bodies", "contacts"):
            ask = f"ask one of them, as in result.lines['{next(iter(self.lines))}']"
            raise UnknownName(f"the result is of several lines, and has no '{name}' itself; {ask}")
        known = [*(n for n in self.names if "/" not in n), *self._groups, "scene_text"]
        known += [a for a, n in ALIASES.items() if n in self._dims]
        near = [n for n in self.names if "/" in n and n.split("/")[1] == name.split("/")[-1]]
        near = near or difflib.get_close_matches(name, dict.fromkeys([*known, *self.names]), 3)
        hint = f"did you mean {' or '.join(near)}?" if near else "it has " + ", ".join(known)
        raise UnknownName(f"the result has no '{name}'; {hint}")

    def __getitem__(self, name: str) -> Any:
        if name in self._groups:
            return Columns(self, name)  # made anew: a cycle would keep all arrays until garbage is searched for
        name = self._known(name)
        if name not in self._cache:
            if not self._contents.is_open:
                raise ResultError(f"'{name}' was not read before the result was closed; open the file again")
            dims, _ = self._dims[name], self.units[name]  # which stay with it when the file is closed
            with readable(self._source):
                rows = self._rows.get(dims[0]) if dims else None
                array = self._contents.values(name, rows)
                if name.startswith("events/"):  # in the order of time: those of outputs are written some steps later
                    array = array[np.argsort(self._contents.values("events/t", rows), kind="stable")]
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
        if not self._contents.is_open:
            raise ResultError("the result is closed; open the file again")
        return self._contents.label(self._known(name))

    def describe(self, name: str) -> str:
        """What an array is: dimensions, unit, frame, in a sentence; of a group, what is in it."""
        if name in self._groups:
            units: dict[str, list[str]] = {}
            for key in self[name]:
                units.setdefault(self.units[f"{name}/{key}"], []).append(key)
            return f"{name}: " + "; ".join(", ".join(keys) + f" ({u})" * bool(u) for u, keys in units.items())
        name = self._known(name)
        with readable(self._source):
            unit, description, frame = self.label(name).values()
        head = f"{name}({', '.join(self._dims[name])})" + (f" in {unit}" if unit else "")
        return f"{head}: {description}" + (f" ({frame} frame)" if frame else "")

    def values_at(
        self, *, t: Any = None, s: Any = None, names: Sequence[str] | None = None, side: str | None = None
    ) -> dict[str, Any]:
        """Every field at the times t (s) and arc lengths s (m), linear between outputs and grid points.

        t and s are a number, an array, or None for all; a number takes its dimension away.
        `names` limits the answer to some fields.  Nothing is interpolated across places where a quantity jumps.
        Exactly there its value is the one just before, and `right/<name>` in the answer is the one just after; side:
        "left" or "right" to have that one alone, under the name itself.
        """
        if side not in (None, "left", "right"):
            raise ResultError(f"side = {side!r} is no side\n    expected: 'left' or 'right'")
        answer = {}
        listed = (n for n in self.names if self._dims[n][:1] == ("t",) and n != "t")
        wanted = [n for n in listed if s is None or "right/s" not in self._dims[n]] if names is None else names
        for name in wanted:
            found = {name: self[name]}
            dims = self.dims(name)
            if s is not None and "s" in dims:  # s first: it comes later, so the axis of t stays put
                found = self._at_places(name, dims.index("s"), s, side)
            for key, array in found.items():
                along = t is not None and "t" in dims
                turns = key in TURNS
                answer[key] = _interpolate(array, dims.index("t"), self["t"], t, "t", "s", turns) if along else array
        return answer

    at = values_at

    def _at_places(self, name: str, axis: int, s: Any, side: str | None) -> dict[str, np.ndarray]:
        """A field at arc lengths s, m, from values on the same side of every jump; of two values both, as of `at`."""
        right, grid = right_of(self._known(name)), self["s"]
        if right not in self._dims or name == "s":
            return {name: _interpolate(self[name], axis, grid, s, "s", "m", name in TURNS)}
        x, jumps = np.asarray(s, dtype=float), self["right/s"]
        which = np.abs(x[..., None] - jumps).argmin(axis=-1)
        exact = np.abs(x - jumps[which]) <= 1e-9 * (grid[-1] - grid[0])
        behind = np.nextafter(jumps, np.inf)
        doubled, values = self.both_sides(name)
        doubled[np.searchsorted(doubled, jumps, side="right") - 1] = behind
        found = {
            key: _interpolate(values, axis, doubled, np.where(exact, at[which], x), "s", "m", name in TURNS)
            for key, at in (("left", jumps), ("right", behind))
        }
        if side is None and exact.any():
            return {name: found["left"], right: found["right"]}
        return {name: found[side or "left"]}

    def uplift(self, end: str) -> tuple[np.ndarray, np.ndarray]:
        """Uplift (nt,) N at the line's `start` or `end`, and its angle (nt,) deg to the seabed.

        The end force along the normal of the bed, off it; both are 0 where the line lies on the bed there.
        """
        pull, normal = -self[f"reaction_{end}"], self["seabed"][:3]
        if "seabed_ends" in self:
            normal = self["seabed_ends"][0 if end == "start" else 1]
        up = np.maximum(pull @ normal, 0.0)
        along = np.linalg.norm(pull - (pull @ normal)[:, None] * normal, axis=1)
        return up, np.degrees(np.arctan2(up, along))

    def both_sides(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Arc lengths (n,), m, and a field (nt, n, ...) there; a place where it jumps comes twice, left value first."""
        s, values, right = self["s"].copy(), self[name], right_of(self._known(name))
        if right not in self._dims:
            return s, values
        jumps = self["right/s"]
        places = np.searchsorted(s, jumps) + 1
        return np.insert(s, places, jumps), np.insert(values, places, self[right], self.dims(name).index("s"))

    def rows_of(self, *names: str) -> Iterator[tuple[np.ndarray, ...]]:
        """Arrays over the outputs, as those of a result that is being written come: all rows at once."""
        yield tuple(self[name] for name in names)

    # ---- what else was written ----------------------------------------------------------------

    @property
    def file(self) -> Path | None:
        """The file it was read from; None for a result in memory."""
        return self._source if isinstance(self._source, Path) else None

    @property
    def lines(self) -> Lines[Self]:
        """The lines of a result of several lines by name, each a result of its own; of one line there are none."""
        return Lines(self.line, self._contents.order if self._contents.is_open else ())

    def each_line(self) -> Iterable[tuple[str, Self]]:
        """Names and results of the lines; a result of one line that has no name is that of the line ""."""
        return self.lines.items() or [("", self)]

    def line(self, name: str) -> Self:
        """A line of a result of several lines, as a result of its own; `lines` has their names."""
        contents = self._contents.part(name) if isinstance(self._contents, ArrayContents) else None
        return type(self)(self._source, line=name, contents=contents)

    @property
    def line_name(self) -> str:
        """Of a line of several its name there; of all of them, and of one cable, empty."""
        return self._line

    @property
    def part_of(self) -> tuple[Self, str] | None:
        """The result of all lines, opened anew, and this one's name there; None: it is not a line of several."""
        return (type(self)(self._source), self._line) if self._line else None

    @property
    def events(self) -> list[Event]:
        """What happened and why, in the order of time."""
        with readable(self._source):
            table = self["events"]
            rows = zip(*(table[k].tolist() for k in Event._fields if k in table), strict=True)
            events = [Event._make(None if x != x else x for x in row) for row in rows]  # NaN: there is none
        return [
            e._replace(kind=OLD_EVENTS.get(e.kind, e.kind), criterion=OLD_EVENTS.get(e.criterion, e.criterion))
            for e in events
        ]

    @property
    def mesh(self) -> MeshHistory:
        """`mesh[i]`: the cells at output i, their nodes s (N+1,) m and kinds (N,); fields are on the output grid.

        KeyError: of a line that is paid out, a file of an earlier program does not say them.
        """
        if "payout/length" in self.names and RIDES not in self.names:
            raise KeyError("an earlier program has not written which cells there were of a line that is paid out")
        words, rides = (self[x] if x in self.names else None for x in (THERE, RIDES))
        return MeshHistory(self["mesh/s"], self["mesh/always"], self.zones, words, rides)

    @property
    def scene_text(self) -> str:
        """The scene that was run, as YAML text."""
        with readable(self._source):
            if not (text := self._contents.text("scene")):
                raise KeyError("it has no scene")
            return text

    @property
    def changes_text(self) -> str:
        """Scenes that held from some time on, as JSON [{"t": s, "scene": YAML}, ...]; empty if there were none."""
        return self._contents.text("changes")

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
    def pending(self) -> str:
        """What is still to come of a result, and the one thing to do, in words; empty: nothing is.

        The result comes first, and its errors and finer results after it, unless the run is stopped in between, or
        before.
        """
        pending = str(self.attributes.get(PENDING, ""))
        if not pending:
            return ""
        what = "its errors are not estimated yet"
        if pending == FINER_RESULT:
            what = "the finer result that its accuracy asks for is not computed yet"
        if self.status == "failed":  # what to do stands in the message
            return what
        name = self._source.name if isinstance(self._source, Path) else "the file"
        fix = f"`hybrid resume {name}` {'makes' if self.status == 'complete' else 'goes on, and makes'} up for it"
        if self.status == "complete" and len(self.times) < 2:
            fix = "`hybrid static` of its scene, which is computed anew, makes up for it"
        return f"{what}; {fix}"

    @property
    def done(self) -> bool:
        """Whether the run has come to its end, and nothing is to come."""
        return self.status == "complete" and not self.pending

    @property
    def status_text(self) -> str:
        """The status in words, with its message, and with what is still to come."""
        status = "interrupted or still running" if self.status == "running" else self.status
        return "; ".join(filter(None, (f"{status}: {self.message}" if self.message else status, self.pending)))

    @property
    def versions(self) -> dict[str, str]:
        """Versions of the programs that computed and wrote the result."""
        return {k.removeprefix("version_"): v for k, v in self.attributes.items() if k.startswith("version_")}

    def __repr__(self) -> str:
        t, s = self.times, self.s
        name = self._source.name if isinstance(self._source, Path) else "in memory"
        span = f"t = {t[0]:.6g} ... {t[-1]:.6g} s" if len(t) > 1 else (f"t = {t[0]:.6g} s" if len(t) else "none yet")
        text = f"Result of '{self.title}' ({name}): {len(t)} output{'s' * (len(t) != 1)}, {span}; "
        if self._contents.order:
            named = {"lines": self._contents.order, **{x: self._within(x) for x in ("points", "bodies")}}
            text += "".join(f"{kind} {joined(list(names))}; " for kind, names in named.items() if names)
            return f"<{text}{self.status_text}>"
        text += f"{len(s)} points on s = {s[0]:.6g} ... {s[-1]:.6g} m; "
        if len(t) and self.zones[-1]:
            text += f"last zones {joined(list(map(str, self.zones[-1])))}; "
        return f"<{text}{self.status_text}>"

    def _within(self, group: str) -> dict[str, None]:
        """Names of what has a group of its own in one of the result, such as the points in `points`."""
        return dict.fromkeys(n.split("/")[1] for n in self.names if n.startswith(f"{group}/"))


def _dataset(contents: Contents, name: str) -> Any:
    data = contents.data[name]
    if data is None or not data.valid:
        raise ResultError(f"'{name}' was not read before the result was closed; open the file again")
    return data


def _interpolate(
    array: np.ndarray, axis: int, grid: np.ndarray, where: Any, dim: str, unit: str, turns: bool = False
) -> Any:
    """Values between those of a grid, on straight lines; turns: angles from -pi to pi, the short way round."""
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
    a, b = np.take(array, left, axis), np.take(array, right, axis)
    if turns:
        b = b - 2.0 * np.pi * np.rint((b - a) / (2.0 * np.pi))
    between = np.where(weight == 0.0, a, np.where(weight == 1.0, b, a * (1.0 - weight) + b * weight))
    return between - 2.0 * np.pi * np.rint(between / (2.0 * np.pi)) if turns else between


def _current(name: str) -> str:
    """The name a dataset has now, from an alias or from the name an older version gave it."""
    return ALIASES.get(name) or OLD_NAMES.get(name, name)
