"""How functions become kernels: entries for Python, kept on disk, and functions that are inlined into them.

numba is imported where a kernel has to be compiled, not here and not where it is found on disk (kernels.machine.kept_code).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from importlib import import_module
from types import FunctionType
from typing import Any

from hybrid.kernels.machine.references import linked


class _Function:
    """A function whose dispatcher numba makes when it is needed.

    Making hundreds of dispatchers takes as long as all kernels take to load.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self.py_func = function
        self.__module__, self.__doc__ = function.__module__, function.__doc__
        self.__name__, self.__qualname__ = function.__name__, function.__qualname__


class Inner(_Function):
    """A function that only kernels call."""

    def __init__(self, function: Callable[..., Any], apart: bool = False, **options: Any) -> None:
        """apart: whether it stays a function of its own in the code of a kernel."""
        super().__init__(function)
        self.apart, self.options = apart, options

    @cached_property
    def made(self) -> Any:
        """numba's own of it."""
        from hybrid.kernels.machine.compiler import inner_of

        return inner_of(self.py_func, self.apart, self.options)

    @property
    def _numba_type_(self) -> Any:
        """What numba takes it for."""
        return self.made._numba_type_

    def __call__(self, *args: Any, **named: Any) -> Any:
        """There is no entry for Python: numba would jump to address 0."""
        raise TypeError(
            f"{self.py_func.__qualname__} is compiled for kernels only; a @kernel can be called from Python"
        )


class Entry(_Function):
    """A kernel that Python calls.  Called by another kernel it is compiled as a part of that one."""

    def __init__(self, function: Callable[..., Any], inlined: bool = True) -> None:
        """inlined: whether all @inner functions are inlined into it; else the compiler decides."""
        super().__init__(function)
        self._inlined = inlined

    @cached_property
    def _code(self) -> Any:
        """Its machine code, for each signature."""
        from hybrid.kernels.machine.kept_code import KeptCode

        return KeptCode(self.py_func, self._inlined)

    @cached_property
    def part(self) -> Any:
        """numba's own of it where another kernel calls it."""
        return Inner(self.py_func).made

    @property
    def _numba_type_(self) -> Any:
        """What numba takes it for in another kernel."""
        return self.part._numba_type_

    def __call__(self, *args: Any) -> Any:
        return self._code.taking(args).call(args)

    def address(self, *args: Any) -> int:
        """Where the machine code for arguments of the types of these is, for kernels.machine.references.caller."""
        return self._code.taking(args).address

    def compile_unless_busy(self, *args: Any) -> None:
        """Compile for arguments of the types of these, unless another process is doing it."""
        self._code.make_unless_busy(args)

    @property
    def is_kept(self) -> bool:
        """Whether its machine code is on disk, for some arguments."""
        return self._code.is_kept

    @property
    def signatures(self) -> list[Any]:
        """Of the machine code in this process: keys of the types of the arguments (kernels.machine.references)."""
        return self._code.signatures

    @property
    def compilations(self) -> int:
        """How often this process has compiled it."""
        return self._code.compilations


class Linked(Entry):
    """A kernel that others call by its address: compiled by itself, when one of them first calls it."""

    def __init__(self, function: Callable[..., Any], arguments: Callable[[], tuple[Any, ...]], returned: Any) -> None:
        """arguments, returned: examples of what it takes, made where they are needed, and of what it returns."""
        super().__init__(function)
        self.arguments, self.returned = arguments, returned
        self.symbol = f"{function.__module__}.{function.__qualname__}"
        linked[self.symbol] = self.find

    @cached_property
    def _code(self) -> Any:
        from hybrid.kernels.machine.kept_code import KeptCode

        return KeptCode(self.py_func, self._inlined, (self.returned,))

    @property
    def _numba_type_(self) -> Any:
        from hybrid.kernels.machine.reference_types import type_of_linked

        return type_of_linked(self)

    def compile_unless_busy(self, *args: Any) -> None:
        """Compile for what its callers give, unless another process is doing it."""
        super().compile_unless_busy(*self.arguments())

    def find(self) -> int:
        """The address of its machine code."""
        return self.address(*self.arguments())


def entry(name: str) -> Entry:
    """The kernel of a name, as room.file.function."""
    file, _, function = name.rpartition(".")
    return getattr(import_module(f"hybrid.kernels.{file}"), function)


def is_warm(kernels: Sequence[str]) -> bool:
    """Whether these kernels, as room.file.function, are on disk compiled for this processor."""
    return all(entry(name).is_kept for name in kernels)


def named(function: Any, name: str) -> FunctionType:
    """A copy of a function under another name: a kernel of its own, with its own file on disk."""
    copy = FunctionType(function.__code__, function.__globals__, name, function.__defaults__, function.__closure__)
    copy.__qualname__, copy.__module__, copy.__doc__ = name, function.__module__, function.__doc__
    return copy


def kernel(function: Callable[..., Any] | None = None, inlined: bool = True) -> Any:
    """Compile an entry point: called from Python, kept on disk under `cache_folder`.

    inlined: False compiles in about half of the time, for kernels that do much beside what takes time.
    """
    return Entry(function, inlined) if function else lambda decorated: Entry(decorated, inlined)


def linked_kernel(arguments: Callable[[], tuple[Any, ...]], returned: Any = None) -> Any:
    """Compile an entry point that is no part of kernels that call it: a law that few scenes have.

    It costs some nanoseconds a call, and a look whether its address is known.  arguments, returned: as of `Linked`.
    """
    return lambda function: Linked(function, arguments, returned)


def inner(function: Callable[..., Any]) -> Any:
    """Compile a function that only kernels call; it is inlined into them.

    Without an entry for Python it takes two thirds of the time.
    """
    return Inner(function, forceinline=True)


def called(function: Callable[..., Any]) -> Any:
    """Compile a function that only kernels call, once for all places of a kernel that do: one that is much code.

    It is not inlined, which costs some nanoseconds a call.
    """
    return Inner(function, apart=True, forceinline=False)  # else it takes that of its caller
