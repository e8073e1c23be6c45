"""NamedTuples of arrays in kernels: by reference, as the address of a table of the addresses of their arrays.

numba hands such a tuple from function to function as hundreds of numbers, which is most of what it would compile.  A
reference is one number; `line.h` reads address and shape of that array where they are needed.  numba hears of all this
(kernels.reference_types) when the first kernel is called.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

from hybrid.kernels.state import blank_line, blank_state, no_ends, no_moves, no_sea, no_work

_waiting: list[Any] = [blank_line(1), no_sea(1), no_ends(), no_moves(), blank_state(1), no_work()]
_register: Callable[[Any], object] = _waiting.append


def by_reference(example: Any) -> None:
    """Keep NamedTuples of a class by reference; all of them have the types of the example."""
    _register(example)


def take_over(register: Callable[[Any], object]) -> None:
    """Let numba know of the classes so far, and of each from now on."""
    global _register
    _register = register
    while _waiting:
        register(_waiting.pop(0))


class Intrinsic:
    """A function of kernels that numba is told of when a kernel that calls it is compiled."""

    def __init__(self, what: str, example: Any) -> None:
        """what: the function of kernels.reference_types that says what it does with such an example."""
        self._what, self._example = what, example

    @cached_property
    def _numba_type_(self) -> Any:
        from hybrid.kernels import reference_types

        return reference_types.function_type(self, getattr(reference_types, self._what)(self._example))

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
