"""Machine code of an entry: its digest, and where it comes from.

An edit recompiles the kernels that it reaches, and no others.
From the entry on, every function that kernels call is followed by its global names: bytecode, constants, options of the
compiler, layouts of NamedTuples.  Comments, docstrings, annotations and line numbers are not in it.

Code is of this process, on disk, or compiled and kept.  numba is imported only to compile.  A file holds machine code
and three names (kernels.machine.cache); nothing in it is unpickled, which would execute whatever it says.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext, suppress
from functools import cache, cached_property
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.kernels.machine import cache as kept
from hybrid.kernels.machine.cache import SUFFIX, Unusable, digest, read_code, write_code
from hybrid.kernels.machine.linked_code import Code, link, provide_symbols
from hybrid.kernels.machine.references import Intrinsic, NamedNumbers, examples, is_array, key_of, text_of

if TYPE_CHECKING:
    from filelock import FileLock

    from hybrid.kernels.machine.compiler import Made

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
    """The digest of the type of an argument (kernels.machine.references), with the layout of what it refers to."""
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
    if hasattr(value, "symbol"):  # linked: what it does is no part of its caller
        return digest(value.symbol, *map(key_digest, map(key_of, value.arguments())), _layout(value.returned))
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


class KeptCode:
    """Machine code of one entry, by the types of the arguments."""

    def __init__(self, function: Callable[..., Any], inlined: bool, returned: tuple[Any, ...] = ()) -> None:
        """inlined: whether all @inner functions are inlined into it; returned: an example, where its callers know one."""
        self._function, self._inlined, self._returned = function, inlined, returned
        self._known: dict[tuple[Any, ...], Code] = {}
        self.compilations = 0

    def taking(self, args: tuple[Any, ...]) -> Code:
        """That takes these arguments: found, or compiled; what another process is compiling is waited for."""
        key = tuple([key_of(x) for x in args])
        known = self._known.get(key)
        if known is None:
            known = self._known[key] = self._read(key) or self._made(key)
        return known

    def make_unless_busy(self, args: tuple[Any, ...]) -> None:
        """Compile for arguments of the types of these, unless another process is doing it."""
        from filelock import Timeout

        with suppress(Timeout, OSError), self._lock.acquire(timeout=0):
            self.taking(args)

    @property
    def is_kept(self) -> bool:
        """Whether machine code of these sources is on disk for this processor, whatever arguments it takes."""
        names = [(place.folder, f"{self._name}-{place.mark}-*-{self._source[:16]}{SUFFIX}") for place in _all_places()]
        return any(any(folder.glob(name)) for folder, name in names)

    @property
    def signatures(self) -> list[tuple[Any, ...]]:
        """Keys of the types of arguments, one for each machine code."""
        return list({_text(key): key for key in self._known}.values())

    def _read(self, key: tuple[Any, ...]) -> Code | None:
        """From the package or the user's folder; None where it has to be compiled."""
        for place in _all_places():
            file = self._file(place, key)
            try:
                found = read_code(file, self._header(place, key), trust=not place.ours or kept.shared())
            except Unusable as why:
                self._mend(file, place, why)
                continue
            if found:
                header, code = found
                return link(code, header)
        return None

    def _made(self, key: tuple[Any, ...]) -> Code:
        with self._alone():
            return self._read(key) or self._compiled(key)

    def _compiled(self, key: tuple[Any, ...]) -> Code:
        from hybrid.kernels.machine.compiler import compile_entry

        provide_symbols()
        made = compile_entry(self._function, key, self._inlined, self._returned)
        self.compilations += 1
        if not self._can_be_kept(made):
            return made.code_here()
        code = made.code
        self._write(key, code, made.names)
        return link(code, made.names)

    def _write(self, key: tuple[Any, ...], code: bytes, names: dict[str, str]) -> None:
        place = _own_place()
        try:
            kept.make_folder(place.folder)
            write_code(self._file(place, key), self._header(place, key) | names, code)
            kept.prune_codes(place.folder, self._begin(place, key))
        except OSError as error:
            kept.warn_once(
                f"machine code cannot be kept in {place.folder} ({error.strerror}) and is compiled at every run: "
                "free space there, or name another folder in HYBRID_CACHE_DIR"
            )

    def _mend(self, file: Path, place: kept.Place, why: Unusable) -> None:
        if place.ours:
            with suppress(OSError):
                file.unlink()
        kept.warn_once(f"machine code {file} {why}: it is not used, and compiled again")

    def _can_be_kept(self, made: Made) -> bool:
        """Code that refers to nothing of this process, and is for the processor that its file will say."""
        why = None
        if made.is_bound:
            why = "refers to objects of Python, to large global arrays or to LAPACK, which machine code on disk cannot"
        elif kept.processor_from(*made.processor) != _own_place().processor:
            why = f"is for the processor {made.processor[1]} by settings of numba that were changed in this process"
        if why:
            kept.warn_once(f"{self._function.__qualname__} is compiled at every run: it {why}")
        return why is None

    def _alone(self) -> AbstractContextManager[Any]:
        """While no other process compiles it; on a file system without locks at worst both do."""
        try:
            return self._lock.acquire()
        except OSError:
            return nullcontext()

    @cached_property
    def _lock(self) -> FileLock:
        from filelock import FileLock

        name = f"{self._function.__module__}.{self._function.__qualname__}.lock"
        return FileLock(_own_place().folder / name)

    @cached_property
    def _name(self) -> str:
        """room.file.function, of characters that any file system takes."""
        module = self._function.__module__.removeprefix("hybrid.kernels.")
        return re.sub(r"[^\w.]", "", f"{module}.{self._function.__qualname__}")

    @cached_property
    def _source(self) -> str:
        return digest(source_digest(self._function), str(self._inlined), *map(_layout, self._returned))

    def _header(self, place: kept.Place, key: tuple[Any, ...]) -> dict[str, Any]:
        """What the file for a signature says of what it is."""
        return {
            "kernel": f"{self._function.__module__}.{self._function.__qualname__}",
            "signature": _text(key),
            "triple": place.processor.triple,
            "processor": place.processor.name,
            "features": place.processor.features,
            "compiler": kept.compiler_hash(),
            "arguments": _arguments(key),
            "source": self._source,
        }

    def _begin(self, place: kept.Place, key: tuple[Any, ...]) -> str:
        """Of the name of a file: kernel, processor and compiler, arguments."""
        return f"{self._name}-{place.mark}-{_arguments(key)[:12]}"

    def _file(self, place: kept.Place, key: tuple[Any, ...]) -> Path:
        return place.folder / f"{self._begin(place, key)}-{self._source[:16]}{SUFFIX}"


def _text(key: tuple[Any, ...]) -> str:
    """A signature as text."""
    return ", ".join(map(text_of, key))


def _arguments(key: tuple[Any, ...]) -> str:
    """A signature with the layouts of its NamedTuples."""
    return digest(*map(key_digest, key))


@cache
def _all_places() -> list[kept.Place]:
    """Those of this process; the user's is made, and older ones beside it are deleted."""
    found = kept.places()
    with suppress(OSError):  # said where code is written
        kept.make_folder(found[-1].folder)
        kept.prune(found[-1].folder)
    return found


def _own_place() -> kept.Place:
    return _all_places()[-1]
