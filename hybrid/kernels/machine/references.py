"""NamedTuples of arrays by reference, numbers with names, and their types.

A reference is the address of a table of the addresses of the arrays.  numba hands such a tuple from function to
function as hundreds of numbers, which is most of what it would compile.  A reference is one number; `line.h` reads
address and shape of that array where they are needed.  numba hears of all this (kernels.machine.reference_types) when
the first kernel is compiled.

Numbers in one array have names: `clock.now` in kernels and in Python.

Types of the arguments of an entry are keys of a table, and text.  numba has its own, which the compiler makes of these
(kernels.machine.reference_types); a kernel that is on disk is found and called without it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from operator import itemgetter
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

examples: dict[type, Any] = {}  # of the classes that are kept by reference
# What finds the addresses of kernels that others call when they first do (kernels.machine.compile.Linked), by their names.
linked: dict[str, Callable[[], int]] = {}


def by_reference(example: Any) -> None:
    """Keep NamedTuples of a class by reference; all of them have the types of the example."""
    for value in example:
        if _has_arrays(value):
            by_reference(value)
    examples[type(example)] = example


def _has_arrays(value: Any) -> bool:
    return isinstance(value, tuple) and any(isinstance(x, np.ndarray) or _has_arrays(x) for x in value)


class Intrinsic:
    """A function of kernels of which kernels.machine.reference_types tells numba."""

    def __init__(self, what: str, example: Any) -> None:
        """what: the function there that says what it does with such an example."""
        self._what, self._example = what, example

    def __deepcopy__(self, _: Any) -> Intrinsic:
        return self  # numba copies what refers to it


def reader(example: Any) -> Any:
    """A function for kernels, read(table) -> a reference to a NamedTuple with the types of `example`."""
    by_reference(example)
    return Intrinsic("read_function", example)


def caller(returned: Any) -> Any:
    """A function for kernels, call(address, table) -> what the kernel at that address returns; returned: an example."""
    return Intrinsic("call_function", returned)


def rows(example: Any) -> Any:
    """A function for kernels: rows(value, at, columns) -> an array of float64, (n, columns), of a NamedTuple.

    example: has the types of the NamedTuple; at: where the array begins in its table (kernels.machine.binding.places).
    """
    return Intrinsic("rows_function", example)


class NamedNumbers(np.ndarray[Any, Any]):
    """An array of numbers, (n,), each of which has a name: those that a class annotates, in their order.

    A kernel takes the address of the first (kernels.machine.reference_types), Python all that an array can do.
    """

    _fields: ClassVar[tuple[str, ...]] = ()
    _number: ClassVar[type] = np.float64

    def __init_subclass__(cls, number: type = np.float64) -> None:
        """number: type of all of them."""
        cls._fields, cls._number = tuple(cls.__annotations__), number
        for at, name in enumerate(cls._fields):
            if hasattr(NamedNumbers, name):
                raise TypeError(f"{cls.__name__}.{name} is something else of every array")
            setattr(cls, name, _property(at))

    def __new__(cls, **given: float) -> Self:
        """All 0 but those that are given by name.  TypeError: there is none of that name."""
        made = np.zeros(len(cls._fields), cls._number).view(cls)
        for name, value in given.items():
            if name not in cls._fields:
                raise TypeError(f"{cls.__name__} has no {name}")
            setattr(made, name, value)
        return made

    @classmethod
    def of(cls, numbers: NDArray[Any]) -> Self:
        """The same numbers with names.  ValueError: there are more of them, or fewer."""
        if numbers.shape != (len(cls._fields),) or numbers.dtype != cls._number:
            raise ValueError(
                f"{numbers.dtype} of shape {numbers.shape}, expected {len(cls._fields)} numbers of {cls.__name__}"
            )
        return numbers.view(cls)

    @property
    def plain(self) -> NDArray[Any]:
        """The same numbers as an array like any other."""
        return self.view(np.ndarray)


def _property(at: int) -> property:
    def write(self: NamedNumbers, value: Any) -> None:
        self[at] = value

    return property(itemgetter(at), write)  # a reader in Python would take three times as long


_IN_ROWS, _IN_COLUMNS, _ALIGNED, _WRITEABLE = 0x1, 0x2, 0x100, 0x400  # flags of arrays, as numpy numbers them
_TOLD = _IN_ROWS | _IN_COLUMNS | _ALIGNED | _WRITEABLE
_NUMBERS = bool, int, float, complex, np.bool_, np.number


def key_of(value: Any) -> Any:
    """The type of an argument of a kernel.

    Of an array the type of its numbers, its dimensions and flags; of other tuples than those that are kept by reference
    their class and their parts; else the class.  TypeError: it is nothing that a kernel takes.
    """
    kind: Any = type(value)
    if isinstance(value, NamedNumbers):
        if value.shape != (len(kind._fields),) or not value.flags.c_contiguous:
            raise TypeError(f"{kind.__name__}: shape {value.shape}, expected ({len(kind._fields)},), contiguous")
        return kind
    if isinstance(value, np.ndarray):
        flags = value.flags.num & _TOLD
        return value.dtype, value.ndim, flags & ~_IN_COLUMNS if flags & _IN_ROWS else flags
    if kind in examples:
        for at, name, expected in _parts_of(kind):
            if (found := key_of(value[at])) != expected:
                raise TypeError(f"{kind.__name__}.{name}: {text_of(found)}, expected {text_of(expected)}")
        return kind
    if isinstance(value, tuple):
        return kind, *map(key_of, value)
    if value is None or isinstance(value, _NUMBERS):
        return kind
    raise TypeError(f"a kernel takes numbers, arrays, None and tuples of them, not {kind.__qualname__}")


@cache
def _parts_of(kind: Any) -> list[tuple[int, str, Any]]:
    """Place, name and key of the arrays and of the tuples by reference in one that is kept by reference."""
    parts = enumerate(zip(kind._fields, examples[kind], strict=True))
    return [(at, name, key_of(x)) for at, (name, x) in parts if isinstance(x, np.ndarray) or type(x) in examples]


def is_array(key: Any) -> bool:
    """Whether it is the key of an array; other tuples begin with a class."""
    return isinstance(key, tuple) and isinstance(key[0], np.dtype)


def layout_of(flags: int) -> tuple[str, bool, bool]:
    """How an array with these flags lies in memory (C, F: in rows, columns; A: otherwise); readonly; aligned."""
    layout = "C" if flags & _IN_ROWS else "F" if flags & _IN_COLUMNS else "A"
    return layout, not flags & _WRITEABLE, bool(flags & _ALIGNED)


@cache
def text_of(key: Any) -> str:
    """The same for the same code, of this and of other processes."""
    if is_array(key):
        dtype, dimensions, flags = key
        layout, readonly, aligned = layout_of(flags)
        return f"{dtype} {dimensions}{layout}{' readonly' * readonly}{'' if aligned else ' unaligned'}"
    if isinstance(key, tuple):
        return f"{text_of(key[0])}({', '.join(map(text_of, key[1:]))})"
    if issubclass(key, _NUMBERS):
        return np.dtype(key).name
    if issubclass(key, NamedNumbers):
        return f"{key.__module__}.{key.__qualname__}({', '.join(key._fields)})"
    return f"{key.__module__}.{key.__qualname__}"
