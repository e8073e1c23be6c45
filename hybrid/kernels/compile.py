"""How the numerical kernels are compiled: entries for Python, kept on disk, and functions that are inlined into them."""

from __future__ import annotations

import gc
from collections.abc import Callable
from pathlib import Path
from types import FunctionType
from typing import Any

import numba
from numba import config
from numba.core.registry import CPUDispatcher

from hybrid.kernels.cache import cache_folder, prune

# numba's "contract" lets a*b+c become one fused instruction; no other relaxation is
# allowed: NaN must stay visible and the order of sums must stay as written.
# Kernels release the GIL: runs in threads of one process share no array that they write.
_OPTIONS: dict[str, Any] = {
    "error_model": "numpy", "fastmath": {"contract"}, "_nrt": False, "no_cfunc_wrapper": True, "nogil": True,
}  # fmt: skip
_njit: Any = numba.njit  # its type knows of fewer options than it takes
_folder: Path | None = None


class _Kernel(CPUDispatcher):
    def get_call_template(self, args: Any, kws: Any) -> Any:
        """A constant counts as any other value of its type: f(x, 0) and f(x, 1) are compiled once."""
        return super().get_call_template([numba.types.unliteral(x) for x in args], kws)

    def compile(self, sig: Any) -> Any:
        """Compile, or load from disk, without searches for garbage: a fifth of the time."""
        if not gc.isenabled():
            return super().compile(sig)
        gc.disable()
        try:
            return super().compile(sig)
        finally:
            gc.enable()


class _Inner(_Kernel):
    def __call__(self, *args: Any, **named: Any) -> Any:
        """There is no entry for Python: numba would jump to address 0."""
        raise TypeError(
            f"{self.py_func.__qualname__} is compiled for kernels only; a @kernel can be called from Python"
        )


def named(function: Any, name: str) -> FunctionType:
    """A copy of a function under another name: a kernel of its own, with its own file on disk."""
    copy = FunctionType(function.__code__, function.__globals__, name, function.__defaults__, function.__closure__)
    copy.__qualname__, copy.__module__, copy.__doc__ = name, function.__module__, function.__doc__
    return copy


def kernel(function: Callable[..., Any]) -> Any:
    """Compile an entry point: called from Python, kept on disk under `cache_folder`."""
    global _folder
    if _folder is None:
        _folder = cache_folder()
        _folder.mkdir(parents=True, exist_ok=True)
        prune(_folder)
    before = config.CACHE_DIR  # type: ignore[attr-defined]
    config.CACHE_DIR = str(_folder)  # type: ignore[attr-defined]
    try:
        made = _njit(cache=True, **_OPTIONS)(function)
    finally:
        config.CACHE_DIR = before  # type: ignore[attr-defined]  # the user's own numba functions keep their own cache
    made.__class__ = _Kernel
    return made


def inner(function: Callable[..., Any]) -> Any:
    """Compile a function that only kernels call; it is inlined into them.

    Without an entry for Python it takes two thirds of the time.
    """
    made = _njit(forceinline=True, no_cpython_wrapper=True, **_OPTIONS)(function)
    made.__class__ = _Inner
    return made
