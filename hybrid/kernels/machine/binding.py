"""Arguments of a kernel in memory: one table of addresses instead of a hundred and fifty arrays at every call.

numba unpacks every array of every call anew, 0.6 us each, which is more than a step of a short line takes.  Here the
addresses, shapes and numbers of a NamedTuple of arrays stand in one array of integers; the kernel builds its arguments
from it.  What is bound is checked when it is bound, and kept alive until something else takes its place.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping, Sequence
from ctypes import addressof, c_char
from functools import cache
from struct import pack, unpack
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.machine.references import NamedNumbers

Numbers = NDArray[np.int64]


class Table:
    """The arguments of one kernel, by the names of its NamedTuple; `numbers` is what the kernel gets."""

    def __init__(self, example: Any, room: NDArray[np.int64] | None = None) -> None:
        """A table of the addresses of values with the types of an example.

        example: a value, or a function that makes one and is called once in all: whatever kernels write must then be
        bound; room: for the numbers, None: of its own.
        """
        self.numbers: NDArray[np.int64]
        if callable(example):
            other = _table_of(example)
            self._copy_of(other, np.empty_like(other.numbers) if room is None else room)
            return
        self._places: dict[str, tuple[int, int, Any]] = {}  # begin and end among the numbers, and types
        self._sizes: dict[str, list[int]] = {}  # of the parts of a tuple
        self._bound: dict[str, Any] = {}
        at = 0
        for name, value in example._asdict().items():
            pattern = _pattern(value)
            self._places[name] = at, at + _size(pattern), pattern
            self._sizes[name] = [_size(x) for x in pattern] if isinstance(pattern, tuple) else []
            at += _size(pattern)
        self.numbers = np.zeros(at, np.int64) if room is None else room
        self.bind(**example._asdict())

    def again(self, room: NDArray[np.int64]) -> Table:
        """Another one with the same bound in it, its numbers in `room`."""
        other = Table.__new__(Table)
        other._copy_of(self, room)
        return other

    def move(self, room: NDArray[np.int64]) -> None:
        """Have the numbers in `room` from now on."""
        room[:], self.numbers = self.numbers, room

    def _copy_of(self, other: Table, room: NDArray[np.int64]) -> None:
        """The same as in another one, the numbers in `room`."""
        self._places, self._sizes, self._bound = other._places, other._sizes, {**other._bound}
        room[:], self.numbers = other.numbers, room

    def bind(self, **values: Any) -> None:
        """Put values in their places; TypeError: an array that the kernel would not understand."""
        for name, value in values.items():
            if self._bound.get(name, self) is value:
                continue
            at, end, pattern = self._places[name]
            before = self._bound.pop(name, None)  # nothing is bound there if this fails half-way
            if not isinstance(pattern, tuple):
                self.numbers[at:end] = _numbers(value, pattern, name)
            elif (known := _known(value)) is not None:
                self.numbers[at:end] = known
            else:
                self._put_changes(at, pattern, value, before, name)
                _keep(value, self.numbers[at:end].copy())
            self._bound[name] = value

    def hold(self, **values: Any) -> None:
        """Keep values alive whose numbers have been put in their places already."""
        self._bound.update(values)

    def part(self, name: str) -> slice:
        """Where the numbers of a value are."""
        begin, end, _ = self._places[name]
        return slice(begin, end)

    def exchange(self, a: str, b: str) -> None:
        """Put what is bound under each of two names of one type under the other."""
        (i, j, _), (k, l, _) = self._places[a], self._places[b]
        self.numbers[i:j], self.numbers[k:l] = self.numbers[k:l].copy(), self.numbers[i:j].copy()
        self._bound[a], self._bound[b] = self._bound[b], self._bound[a]

    def _put_changes(self, at: int, pattern: Any, value: Any, before: Any, name: str) -> None:
        """A tuple at its place, where `before` is bound (None: nothing): what is the same is left as it is."""
        if before is None or len(value) != len(pattern):
            found = _numbers(value, pattern, name)
            self.numbers[at : at + len(found)] = found
            return
        for each, of, same, size in zip(value, pattern, before, self._sizes[name], strict=True):
            if each is not same:
                self.numbers[at : at + size] = _numbers(each, of, name)
            at += size


@cache
def _table_of(blank: Callable[[], Any]) -> Table:
    """The table of what a function makes."""
    return Table(blank())


class Series:
    """Tables of one NamedTuple for many outputs: the same numbers, but for arrays that go on from row to row."""

    def __init__(self, example: Any) -> None:
        """example: with the types that all values have."""
        self._pattern, self._at = _pattern(example), dict[str, int]()
        at = 0
        for name, value, kind in zip(example._fields, example, self._pattern, strict=True):
            self._at[name], inner = at, at
            if isinstance(kind, tuple):
                for part, each in zip(value._fields, kind, strict=True):
                    self._at[f"{name}.{part}"], inner = inner, inner + _size(each)
            at += _size(kind)

    def __call__(self, first: Any, count: int, along: Mapping[str, NDArray[Any]]) -> NDArray[np.int64]:
        """Tables (count, size); first: values of the first, kept by the caller until the kernel is done.

        along: (count, ...) of which the first has the first row, by name, or `name.part` of a tuple in it.
        """
        tables = np.tile(np.array(_numbers(first, self._pattern, "output"), np.int64), (count, 1))
        for name, values in along.items():
            tables[:, self._at[name]] += np.arange(count) * values.strides[0]
        return tables

    def shift(self, tables: Numbers, arrays: Mapping[str, NDArray[Any]], begin: Numbers, count: Numbers) -> None:
        """Of arrays by name each table has `count` rows from row `begin` on; the first has those of row 0 on."""
        for name, values in arrays.items():
            at = self._at[name]
            tables[:, at] += begin * values.strides[0]
            tables[:, at + 1] = count


# Numbers of the tuples that were bound last: a line is bound in several tables, and two states take turns.
class _OfThread(threading.local):
    def __init__(self) -> None:
        self.known: dict[int, tuple[Any, NDArray[np.int64]]] = {}


_here, MOST_KNOWN = _OfThread(), 64


def _known(value: Any) -> NDArray[np.int64] | None:
    """Numbers of a tuple, if it is one of the last, which are kept."""
    known = _here.known.get(id(value))
    return known[1] if known is not None and known[0] is value else None


def _keep(value: Any, numbers: NDArray[np.int64]) -> None:
    known = _here.known
    if len(known) >= MOST_KNOWN:
        del known[next(iter(known))]
    known[id(value)] = value, numbers


def _numbers(value: Any, pattern: Any, name: str) -> list[int]:
    """Addresses, shapes and numbers of a value; TypeError: it is not of the pattern."""
    if isinstance(pattern, tuple):
        if (known := _known(value)) is not None:
            return known.tolist()
        if len(value) != len(pattern):
            raise TypeError(f"{name}: {len(value)} values, expected {len(pattern)}")
        out: list[int] = []
        for each, of in zip(value, pattern, strict=True):
            out += _numbers(each, of, name)
        return out
    if isinstance(pattern, _ArrayPattern):
        if not (value.dtype == pattern.dtype and value.ndim == pattern.ndim and value.flags.c_contiguous):
            given = f"{value.dtype} of shape {value.shape}"
            raise TypeError(f"{name}: {given}, expected {pattern.dtype} of {pattern.ndim} dimensions, contiguous")
        if not isinstance(value, pattern.kind):
            raise TypeError(f"{name}: {type(value).__name__}, expected {pattern.kind.__name__}")
        return [address(value), *value.shape]
    return [_bits(value) if pattern is float else int(value)]


def address(array: NDArray[Any]) -> int:
    """Where the numbers of an array begin in memory."""
    try:
        return addressof(c_char.from_buffer(array))  # type: ignore[arg-type]
    except (TypeError, ValueError):  # nobody may write to it, or it is empty: numpy's own way takes four times as long
        return array.__array_interface__["data"][0]


class Packed:
    """Makes NamedTuples of arrays for lines of any number of cells, each in one block of memory, filled with zeros.

    Their addresses follow from that of the block, so that binding them costs little.
    """

    def __init__(self, blank: Callable[[int], Any], given: Sequence[str] = ()) -> None:
        """Room for values of a tuple of arrays in one block of numbers.

        blank: makes one for a number of cells, of which its shapes are linear functions; given: fields that are none of
        the block, but given whenever one is made.
        """
        two, three = blank(2), blank(3)
        self._make, self._given = two._make, tuple(given)
        self._fields: list[
            tuple[str, Any, Any, int]
        ] = []  # name, type, what is fixed and what grows of shapes, numbers
        for name, x, y in zip(two._fields, two, three, strict=True):
            if name in given:
                self._fields.append((name, None, _pattern(x), _size(_pattern(x))))
                continue
            slopes = tuple(b - a for a, b in zip(x.shape, y.shape, strict=True))
            fixed = tuple(a - 2 * k for a, k in zip(x.shape, slopes, strict=True))
            self._fields.append((name, x.dtype, tuple(zip(fixed, slopes, strict=True)), 1 + x.ndim))
        self._kinds = {name: type(x) for name, x in two._asdict().items() if isinstance(x, NamedNumbers)}
        self._plans: dict[int, Any] = {}

    def __call__(self, cells: int, **given: Any) -> Any:
        """One for a line of so many cells.  TypeError: a field is given that is one of the block."""
        if more := given.keys() - {*self._given}:
            raise TypeError(f"of the block, and not given: {', '.join(sorted(more))}")
        plan = self._plans.get(cells)
        if plan is None:
            plan = self._plans[cells] = self._plan(cells)
        size, places, numbers, addresses = plan
        block, numbers = np.zeros(size), numbers.copy()
        numbers[addresses] += address(block)
        values = []
        for name, dtype, shape, offset in places:
            if dtype is not None:
                array = np.ndarray(shape, dtype, block, offset)
                values.append(array.view(self._kinds[name]) if name in self._kinds else array)
                continue
            values.append(given[name])
            found = _numbers(given[name], shape, name)
            numbers[offset : offset + len(found)] = found
        value = self._make(values)
        _keep(value, numbers)
        return value

    def _plan(self, cells: int) -> Any:
        """The layout of a block for a number of cells.

        Size; of each field its shape and offset, or pattern and where its numbers begin; numbers in a block at address
        0, and which of them are addresses.
        """
        places: list[Any] = []
        numbers: list[int] = []
        addresses: list[int] = []
        offset = 0
        for name, dtype, dims, size in self._fields:
            if dtype is None:
                places.append((name, None, dims, len(numbers)))
                numbers += [0] * size
                continue
            shape = tuple(a + b * cells for a, b in dims)
            places.append((name, dtype, shape, offset))
            addresses.append(len(numbers))
            numbers += [offset, *shape]
            offset += -(-math.prod(shape) * dtype.itemsize // 8) * 8
        return max(offset, 8) // 8, places, np.array(numbers, np.int64), np.array(addresses)


class Room:
    """Memory for one of the NamedTuples that a `Packed` makes, for a line of at most so many cells."""

    def __init__(self, packed: Packed, most: int) -> None:
        size, places, *_ = packed._plan(most)
        self._make, self._kinds, self._block = packed._make, packed._kinds, np.zeros(size)
        at: int = address(self._block)
        fixed: list[int] = []
        slopes: list[int] = []
        self._given: list[tuple[str, Any, int]] = []  # name, pattern, where its numbers begin
        # views of before, with their numbers and what was given for them
        self._made: dict[int, tuple[Any, NDArray[np.int64], dict[str, Any]]] = {}
        self._fields: list[Any] = []  # name; type, offset, and what is fixed and what grows of shapes
        for (name, dtype, dims, n), (*_, offset) in zip(packed._fields, places, strict=True):
            self._fields.append((name, dtype, offset, dims))
            if dtype is None:
                self._given.append((name, dims, len(fixed)))
                fixed, slopes = fixed + [0] * n, slopes + [0] * n
            else:
                fixed, slopes = [*fixed, at + offset, *(a for a, _ in dims)], [*slopes, 0, *(k for _, k in dims)]
        self._fixed, self._slopes = np.array(fixed, np.int64), np.array(slopes, np.int64)

    def view(self, cells: int, **given: Any) -> Any:
        """One for so many cells, in this memory: whatever was there before is overwritten by what is put there."""
        made = self._made.get(cells)
        if made is None or not all(given[name] is x for name, x in made[2].items()):
            block, values, numbers = self._block, [], self._fixed + cells * self._slopes
            for name, dtype, offset, dims in self._fields:
                if dtype is None:
                    values.append(given[name])
                else:
                    array = np.ndarray([a + k * cells for a, k in dims], dtype, block, offset)
                    values.append(array.view(self._kinds[name]) if name in self._kinds else array)
            for name, pattern, at in self._given:
                found = _numbers(given[name], pattern, name)
                numbers[at : at + len(found)] = found
            if len(self._made) >= MOST_KNOWN:
                self._made.clear()
            made = self._made[cells] = self._make(values), numbers, given
        _keep(made[0], made[1])
        return made[0]


def places(example: Any) -> dict[str, int]:
    """Where the fields of a NamedTuple begin among the numbers of its table."""
    found, at = {}, 0
    for name, value in example._asdict().items():
        found[name] = at
        at += _size(_pattern(value))
    return found


def _bits(value: float) -> int:
    """The bits of a number as an integer."""
    return unpack("q", pack("d", value))[0]


class _ArrayPattern:
    """Type of an array and number of its dimensions; the class whose names its numbers have."""

    def __init__(self, array: NDArray[Any]) -> None:
        self.dtype, self.ndim, self.kind = array.dtype, array.ndim, type(array)


def _pattern(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return _ArrayPattern(value)
    if isinstance(value, tuple):
        return tuple(_pattern(x) for x in value)
    return float if isinstance(value, float) else int


def _size(pattern: Any) -> int:
    if isinstance(pattern, tuple):
        return sum(_size(x) for x in pattern)
    return 1 + pattern.ndim if isinstance(pattern, _ArrayPattern) else 1
