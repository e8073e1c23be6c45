"""What the machine code of a kernel is made of, as a digest: an edit recompiles the kernels that it reaches, and no others.

From the entry on, every function that kernels call is followed by its global names: bytecode, constants, options of the
compiler, layouts of NamedTuples.  Comments, docstrings, annotations and line numbers are not in it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

from hybrid.kernels.machine.argument_types import is_array, text_of
from hybrid.kernels.machine.code_file import digest
from hybrid.kernels.machine.named_numbers import NamedNumbers
from hybrid.kernels.machine.references import Intrinsic, examples

_PLAIN = bool, int, float, complex, str, bytes, np.generic, np.dtype, np.ufunc, BuiltinFunctionType
Called = dict[Callable[..., Any], None]  # functions, in order


def source_digest(function: Callable[..., Any]) -> str:
    """The digest of a function and of all that kernels call from it; TypeError: of a global that has none."""
    found: Called = {function: None}
    todo = [function]
    while todo:
        for called in _of_function(todo.pop())[1]:
            if called not in found:
                found[called] = None
                todo.append(called)
    return digest(*sorted(_of_function(x)[0] for x in found))


def key_digest(key: Any) -> str:
    """The digest of the type of an argument (kernels.machine.argument_types), with the layout of what it refers to."""
    return digest(text_of(key), *_layouts(key))


def _layouts(key: Any) -> Iterator[str]:
    if is_array(key):
        return
    if isinstance(key, tuple):
        for part in key[1:]:
            yield from _layouts(part)
    elif key in examples:
        yield _layout_of(key)


@cache
def _of_function(function: Callable[..., Any]) -> tuple[str, Called]:
    """The digest of a function without what it calls, and what it calls of kernels."""
    called: Called = {}
    code: CodeType = function.__code__
    outside = dict(zip(code.co_freevars, (x.cell_contents for x in function.__closure__ or ()), strict=True))
    parts = [function.__module__, function.__qualname__, repr(function.__defaults__), *_code(code, function.__doc__)]
    names = sorted({*_names(code), *outside})
    for name in names:
        for known in (outside, function.__globals__):
            if name in known:
                parts += [name, _described(known[name], names, called)]
    return digest(*parts), called


def _names(code: CodeType) -> set[str]:
    """Names of globals and attributes in a function and in those within it."""
    return {*code.co_names}.union(*(_names(x) for x in code.co_consts if isinstance(x, CodeType)))


def _code(code: CodeType, doc: str | None) -> Iterator[str | bytes]:
    """What a function does, in parts; its text is left out."""
    yield code.co_code
    yield from (repr(x) for x in (code.co_names, code.co_argcount, code.co_nlocals, code.co_freevars, code.co_cellvars))
    yield getattr(code, "co_exceptiontable", b"")
    for value in code.co_consts:
        if isinstance(value, CodeType):
            yield from _code(value, None)
        elif value is None or value != doc:
            yield f"{type(value).__name__} {value!r}"


def _described(value: Any, names: list[str], called: Called) -> str:
    """A value that a function names, as text; `called` takes the kernel functions in it.

    names: of the function, of which a module's attributes are among.
    """
    of = getattr(value, "py_func", None)
    if isinstance(of, FunctionType):  # of kernels.machine.compile, or of numba
        called[of] = None
        options = getattr(value, "apart", ""), getattr(value, "options", "")
        return f"{type(value).__name__} {of.__module__}.{of.__qualname__} {options}"
    if isinstance(value, Intrinsic):
        return f"{value._what} {_layout(value._example)}"
    if isinstance(value, ModuleType):
        ours = [x for x in names if hasattr(value, x)] if value.__name__.startswith("hybrid.") else []
        return digest(value.__name__, *(x + _described(getattr(value, x), names, called) for x in ours))
    if isinstance(value, type):
        return _class(value)
    if isinstance(value, np.ndarray):
        return digest(str(value.dtype), repr(value.shape), value.tobytes())
    if isinstance(value, tuple):
        return digest(type(value).__qualname__, *(_described(x, names, called) for x in value))
    if isinstance(value, FunctionType):  # of numba, or of Python, which kernels can only name
        return f"{value.__module__}.{value.__qualname__}"
    if value is None or isinstance(value, _PLAIN):
        return f"{type(value).__name__} {value!r}"
    raise TypeError(
        f"no digest is known of {value!r}, which a kernel names: make it a number, an array or a NamedTuple"
    )


def _class(of: type) -> str:
    """A class that kernels make values of, with the names of its fields and what they are by default."""
    fields = getattr(of, "_fields", ())
    text = f"{of.__module__}.{of.__qualname__} {fields} {getattr(of, '_field_defaults', '')!r}"
    if issubclass(of, NamedNumbers):
        text += f" {of._number!r}"
    return f"{text} {_layout_of(of)}" if of in examples else text


@cache
def _layout_of(of: type) -> str:
    """Of a class that is kept by reference, all of which have the types of one example."""
    return _fields(examples[of])


def _layout(example: Any) -> str:
    """How a value lies in memory: of a NamedTuple class, names and types of its fields, in order."""
    if isinstance(example, NamedNumbers):
        return _class(type(example))
    if isinstance(example, np.ndarray):
        return f"{example.dtype} {example.ndim}"
    if isinstance(example, tuple):
        return _layout_of(type(example)) if type(example) in examples else _fields(example)
    return type(example).__qualname__


def _fields(example: Any) -> str:
    kind = type(example)
    names = getattr(example, "_fields", range(len(example)))
    parts = [f"{name} {_layout(x)}" for name, x in zip(names, example, strict=True)]
    return digest(f"{kind.__module__}.{kind.__qualname__}", *parts)
