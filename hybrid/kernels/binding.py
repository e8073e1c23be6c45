"""Arguments of a kernel in memory: one table of addresses instead of a hundred and fifty arrays at every call.

numba unpacks every array of every call anew, 0.6 us each, which is more than a step of a short line takes.  Here the
addresses, shapes and numbers of a NamedTuple of arrays stand in one array of integers; the kernel builds its arguments
from it.  What is bound is checked when it is bound, and kept alive until something else takes its place.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


class Table:
    """The arguments of one kernel, by the names of its NamedTuple; `numbers` is what the kernel gets."""

    def __init__(self, example: Any) -> None:
        """example: with the types that all values have."""
        self._places: dict[str, tuple[int, int, Any]] = {}  # begin and end among the numbers, and types
        self._bound: dict[str, Any] = {}
        self._before: dict[str, tuple[Any, NDArray[np.int64]]] = {}  # what was bound before, and its numbers
        at = 0
        for name, value in example._asdict().items():
            pattern = _pattern(value)
            self._places[name] = at, at + _size(pattern), pattern
            at += _size(pattern)
        self.numbers: NDArray[np.int64] = np.zeros(at, np.int64)
        self._floats = self.numbers.view(np.float64)
        self.bind(**example._asdict())

    def bind(self, **values: Any) -> None:
        """Put values in their places; TypeError: an array that the kernel would not understand."""
        for name, value in values.items():
            if self._bound.get(name, self) is value:
                continue
            at, end, pattern = self._places[name]
            bound = self._bound.pop(name, None)  # nothing is bound there if this fails half-way
            if not isinstance(pattern, tuple):
                self._put(at, pattern, value, name)
            else:  # two states take turns: what was bound before this one may well come back
                before = self._before.get(name)
                if bound is not None:
                    self._before[name] = bound, self.numbers[at:end].copy()
                if before is not None and before[0] is value:
                    self.numbers[at:end] = before[1]
                else:
                    self._put(at, pattern, value, name)
            self._bound[name] = value

    def _put(self, at: int, pattern: Any, value: Any, name: str) -> int:
        if isinstance(pattern, tuple):
            if len(value) != len(pattern):
                raise TypeError(f"{name}: {len(value)} values, expected {len(pattern)}")
            for k, each in enumerate(value):
                at = self._put(at, pattern[k], each, name)
            return at
        if isinstance(pattern, _ArrayPattern):
            if not (value.dtype == pattern.dtype and value.ndim == pattern.ndim and value.flags.c_contiguous):
                given = f"{value.dtype} of shape {value.shape}"
                raise TypeError(f"{name}: {given}, expected {pattern.dtype} of {pattern.ndim} dimensions, contiguous")
            end = at + 1 + pattern.ndim
            self.numbers[at] = value.__array_interface__["data"][0]
            self.numbers[at + 1 : end] = value.shape
            return end
        if pattern is float:
            self._floats[at] = value
        else:
            self.numbers[at] = value
        return at + 1


class _ArrayPattern:
    """Type of an array and number of its dimensions."""

    def __init__(self, array: NDArray[Any]) -> None:
        self.dtype, self.ndim = array.dtype, array.ndim


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
