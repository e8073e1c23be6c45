"""How the numerical kernels are compiled: entries for Python, kept on disk, and functions that are inlined into them."""

from __future__ import annotations

import gc
import hashlib
from collections.abc import Callable
from contextlib import suppress
from functools import cache, cached_property
from pathlib import Path
from types import FunctionType
from typing import Any

import numba
import numpy as np
from filelock import FileLock, Timeout
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.registry import CPUDispatcher

from hybrid.kernels import references
from hybrid.kernels.cache import cache_folder, prune

# numba's "contract" lets a*b+c become one fused instruction; no other relaxation is
# allowed: NaN must stay visible and the order of sums must stay as written.
# Kernels release the GIL: runs in threads of one process share no array that they write.
_OPTIONS: dict[str, Any] = {
    "error_model": "numpy", "fastmath": {"contract"}, "_nrt": False, "no_cfunc_wrapper": True, "nogil": True,
}  # fmt: skip
_njit: Any = numba.njit  # its type knows of fewer options than it takes


class _Kernel(CPUDispatcher):
    def get_call_template(self, args: Any, kws: Any) -> Any:
        """A constant counts as any other value of its type: f(x, 0) and f(x, 1) are compiled once."""
        return super().get_call_template([numba.types.unliteral(x) for x in args], kws)

    def typeof_pyval(self, value: Any) -> Any:
        if type(value) is not np.ndarray:
            return super().typeof_pyval(value)
        kind = references.type_of(value)
        self._types_active_call.add(kind)  # type: ignore[attr-defined]  # numba keeps it alive
        return kind

    def compile(self, sig: Any) -> Any:
        """Compile, or load from disk, without searches for garbage: a fifth of the time."""
        if not gc.isenabled():
            return super().compile(sig)
        gc.disable()
        try:
            return super().compile(sig)
        finally:
            gc.enable()


class _Entry(_Kernel):
    """Called by another kernel it is compiled as a part of that one; as an entry only when Python calls it."""

    def compile(self, sig: Any) -> Any:
        """Compile, or load from disk; what another process is compiling is waited for."""
        try:
            held = self._lock.acquire()
        except OSError:  # a file system without locks: at worst both compile it
            return super().compile(sig)
        with held:
            return super().compile(sig)

    def compile_unless_busy(self, *args: Any) -> None:
        """Compile for arguments of the types of these, unless another process is doing it."""
        with suppress(Timeout, OSError), self._lock.acquire(timeout=0):
            self.compile(tuple(references.type_of(x) for x in args))

    @cached_property
    def _lock(self) -> FileLock:
        return FileLock(
            Path(str(self.stats.cache_path)) / f"{self.py_func.__module__}.{self.py_func.__qualname__}.lock"
        )

    @cached_property
    def _addresses(self) -> dict[Any, int]:
        return {}

    @cached_property
    def part(self) -> Any:
        return Inner(self.py_func).made

    def address(self, *args: Any) -> int:
        """Where the machine code for arguments of the types of these is, for kernels.references.caller."""
        sig = tuple(references.type_of(x) for x in args)
        if sig not in self._addresses:
            self.compile(sig)
            made: Any = self.overloads[sig]
            self._addresses[sig] = made.library.get_pointer_to_function(made.fndesc.llvm_func_name)
        return self._addresses[sig]

    def get_call_template(self, args: Any, kws: Any) -> Any:
        return self.part.get_call_template(args, kws)

    def get_overload(self, sig: Any) -> Any:
        return self.part.get_overload(sig)


class _Place:
    """Where numba keeps an entry, and what must not have changed: nothing of where the package lies, so that copies of a
    version, in other environments or on other machines of a network, are compiled once.

    The folder stands for the sources of all kernels (`kernel_hash`); the stamp is for kernels of tests and of users.
    """

    def __init__(self, function: Callable[..., Any], source: str) -> None:
        self._line, self._py_file = function.__code__.co_firstlineno, source  # numba names the latter in a warning
        self._folder = _made_folder() / (function.__module__.rpartition(".")[0] or "scripts")

    @classmethod
    def from_function(cls, function: Callable[..., Any], source: str) -> _Place:
        return cls(function, source)

    def ensure_cache_path(self) -> None:
        self._folder.mkdir(parents=True, exist_ok=True)

    def get_cache_path(self) -> str:
        return str(self._folder)

    def get_source_stamp(self) -> bytes:
        return _content(self._py_file)

    def get_disambiguator(self) -> str:
        return str(self._line)


@cache
def _made_folder() -> Path:
    folder = cache_folder()
    folder.mkdir(parents=True, exist_ok=True)
    prune(folder)
    return folder


@cache
def _content(source: str) -> bytes:
    return hashlib.sha256(Path(source).read_bytes()).digest()


class _Saved(CompileResultCacheImpl):
    pass


_Saved._locator_classes = [_Place]


class _Cache(FunctionCache):
    _impl_class = _Saved

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Load from disk without the registries of numba, which bring scipy.linalg and a compilation of their own.

        A compilation brings them itself.
        """
        with self._guard_against_spurious_io_errors():
            loaded = self._load_overload(sig, _Loading(target_context))
            return loaded and loaded._replace(target_context=target_context)


class _Loading:
    """A target whose code generator makes libraries of machine code alone."""

    def __init__(self, target: Any) -> None:
        self._target, self.magic_tuple = target, target.codegen().magic_tuple

    def __getattr__(self, name: str) -> Any:
        return getattr(self._target, name)

    def codegen(self) -> Any:
        return self

    def unserialize_library(self, saved: Any) -> Any:
        name, _, (code, _) = saved
        return _LoadedCode(self._target.codegen(), name, code)


class Inner:
    """A function that only kernels call.  numba hears of it when a kernel that calls it is compiled: making hundreds of
    its dispatchers takes as long as all kernels take to load."""

    def __init__(self, function: Callable[..., Any], **options: Any) -> None:
        self.py_func, self._options = function, options
        self.__module__, self.__name__, self.__doc__ = function.__module__, function.__name__, function.__doc__

    @cached_property
    def made(self) -> Any:
        """numba's own of it."""
        options = _OPTIONS | self._options
        made = _njit(no_cpython_wrapper=True, pipeline_class=_InnerCompiler, **options)(self.py_func)
        made.__class__ = _Kernel
        return made

    def __call__(self, *args: Any, **named: Any) -> Any:
        """There is no entry for Python: numba would jump to address 0."""
        raise TypeError(
            f"{self.py_func.__qualname__} is compiled for kernels only; a @kernel can be called from Python"
        )


@numba.extending.typeof_impl.register(Inner)
def _type_of_inner(value: Inner, _: Any) -> Any:
    return numba.types.Dispatcher(value.made)


class _NoEnvironment:
    def set_env(self, name: str, environment: Any) -> None:
        """The environment is for objects of Python, of which kernels use none."""


class _InlinedCode(JITCodeLibrary):
    """LLVM code of one function that kernels call, without what it calls itself.

    numba would optimise it together with all of that, and make machine code of it, at every level of calls anew; only
    the machine code of entries is ever executed.
    """

    codegen = _NoEnvironment()

    def finalize(self) -> None:
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        return 0

    def _get_module_for_linking(self) -> Any:
        """With all that it calls: for a function of numba that is none of ours."""
        whole = super()._get_module_for_linking().clone()
        _link(self, whole)
        return whole


class _EntryCode(JITCodeLibrary):
    """Code of an entry with all that it calls: optimised together, once."""

    def finalize(self) -> None:
        _link(self, self._final_module)
        self._linking_libraries = []
        super().finalize()

    def serialize_using_object_code(self) -> Any:
        """Machine code alone: nothing is ever linked with an entry."""
        self._ensure_finalized()
        return self.name, "object", (self._get_compiled_object(), b"")


class _LoadedCode(JITCodeLibrary):
    """Machine code of an entry, from disk: numba would read its LLVM code as well, for the names in it."""

    def __init__(self, codegen: Any, name: str, code: bytes) -> None:
        super().__init__(codegen, name)
        self.enable_object_caching()
        self._set_compiled_object(code)
        self._finalize_final_module()

    def get_pointer_to_function(self, name: str) -> int:
        """The address of the entry, or of its wrapper for Python; numba asks for no others."""
        found: int = self._codegen._engine.get_function_address(name)
        return found


def _link(code: Any, module: Any) -> None:
    """Link into a module all that the code calls, each once."""
    found: dict[Any, None] = {}  # in order

    def collect(calling: Any) -> None:
        for called in calling._linking_libraries:
            if called not in found:
                found[called] = None
                if isinstance(called, _InlinedCode):
                    collect(called)

    collect(code)
    for called in found:
        if hasattr(code, "_reload_init"):  # numba 0.62 has none
            code._reload_init.update(called._reload_init)
        module.link_in(JITCodeLibrary._get_module_for_linking(called), preserve=True)


class _EntryCompiler(Compiler):
    made: type = _EntryCode

    def __init__(self, typing: Any, target: Any, library: Any, *rest: Any) -> None:
        library = self.made(target.codegen(), "hybrid")
        library.enable_object_caching()
        super().__init__(typing, target, library, *rest)


class _InnerCompiler(_EntryCompiler):
    made = _InlinedCode


def named(function: Any, name: str) -> FunctionType:
    """A copy of a function under another name: a kernel of its own, with its own file on disk."""
    copy = FunctionType(function.__code__, function.__globals__, name, function.__defaults__, function.__closure__)
    copy.__qualname__, copy.__module__, copy.__doc__ = name, function.__module__, function.__doc__
    return copy


def kernel(function: Callable[..., Any]) -> Any:
    """Compile an entry point: called from Python, kept on disk under `cache_folder`."""
    made = _njit(pipeline_class=_EntryCompiler, **_OPTIONS)(function)
    made.__class__ = _Entry
    made._cache = _Cache(function)
    return made


def inner(function: Callable[..., Any]) -> Any:
    """Compile a function that only kernels call; it is inlined into them.

    Without an entry for Python it takes two thirds of the time.
    """
    return Inner(function, forceinline=True)
