"""How numba compiles kernels: what it is told, and what is done in another way than its own.  Imported at the first call
of a kernel (kernels.compile).  Tried with numba 0.62.0 and 0.68.1."""

from __future__ import annotations

import gc
from collections.abc import Callable
from contextlib import nullcontext, suppress
from functools import cached_property
from pathlib import Path
from typing import Any

import numba
import numpy as np
from filelock import FileLock, Timeout
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.registry import CPUDispatcher

from hybrid.kernels import reference_types
from hybrid.kernels.kept_code import KeptCode

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
        kind = reference_types.type_of(value)
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
    """Of an entry, for calls from Python."""

    _cache: KeptCode

    def compile(self, sig: Any) -> Any:
        """Load from disk, or compile; what another process is compiling is waited for."""
        try:
            held = nullcontext() if sig in self.overloads or self._cache.holds(sig) else self._lock.acquire()
        except OSError:  # a file system without locks: at worst both compile it
            return super().compile(sig)
        with held:
            return super().compile(sig)

    def compile_unless_busy(self, *args: Any) -> None:
        """Compile for arguments of the types of these, unless another process is doing it."""
        with suppress(Timeout, OSError), self._lock.acquire(timeout=0):
            self.compile(tuple(reference_types.type_of(x) for x in args))

    @cached_property
    def _lock(self) -> FileLock:
        return FileLock(
            Path(str(self.stats.cache_path)) / f"{self.py_func.__module__}.{self.py_func.__qualname__}.lock"
        )

    @cached_property
    def _addresses(self) -> dict[Any, int]:
        return {}

    def address(self, *args: Any) -> int:
        """Where the machine code for arguments of the types of these is, for kernels.references.caller."""
        sig = tuple(reference_types.type_of(x) for x in args)
        if sig not in self._addresses:
            self.compile(sig)
            made: Any = self.overloads[sig]
            self._addresses[sig] = made.library.get_pointer_to_function(made.fndesc.llvm_func_name)
        return self._addresses[sig]


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


def entry_of(function: Callable[..., Any]) -> Any:
    """Of an entry point."""
    made = _njit(pipeline_class=_EntryCompiler, **_OPTIONS)(function)
    made.__class__ = _Entry
    made._cache = KeptCode(function)
    return made


def inner_of(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    """Of a function that only kernels call."""
    made = _njit(no_cpython_wrapper=True, pipeline_class=_InnerCompiler, **(_OPTIONS | options))(function)
    made.__class__ = _Kernel
    return made
