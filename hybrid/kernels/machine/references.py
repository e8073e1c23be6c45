"""NamedTuples of arrays in kernels: by reference, as the address of a table of the addresses of their arrays.

numba hands such a tuple from function to function as hundreds of numbers, which is most of what it would compile.  A
reference is one number; `line.h` reads address and shape of that array where they are needed.  numba hears of all this
(kernels.machine.reference_types) when the first kernel is compiled.
"""

from __future__ import annotations

from typing import Any

import numpy as np

examples: dict[type, Any] = {}  # of the classes that are kept by reference


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


def caller_of_six(returned: Any) -> Any:
    """The same with six arguments, call(address, a, b, c, d, e, f)."""
    return Intrinsic("call_function_of_six", returned)


def rows(example: Any) -> Any:
    """A function for kernels: rows(value, at, columns) -> an array of float64, (n, columns), of a NamedTuple.

    example: has the types of the NamedTuple; at: where the array begins in its table (kernels.machine.binding.places).
    """
    return Intrinsic("rows_function", example)
