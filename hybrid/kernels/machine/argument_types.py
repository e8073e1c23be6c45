"""Types of the arguments of an entry, as keys of a table and as text.

numba has its own, which the compiler makes of these (kernels.machine.reference_types); a kernel that is on disk is found and
called without it.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from hybrid.kernels.machine.named_numbers import NamedNumbers
from hybrid.kernels.machine.references import examples

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
