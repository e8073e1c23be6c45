"""Machine code in memory, ready to be called.  Tried with numba 0.62.0 and 0.68.1.

Linked by LLVM, without numba, whose import takes as long as a short run: of numba, code needs some functions in C,
which are in one of its extension modules.
"""

from __future__ import annotations

import builtins
import ctypes
import math
from collections.abc import Callable, Mapping
from functools import cache, partial
from importlib.machinery import PathFinder
from importlib.util import find_spec, module_from_spec
from typing import Any, NamedTuple

from llvmlite import binding as llvm

from hybrid.kernels.machine.references import linked


class Code(NamedTuple):
    """Machine code of an entry for arguments of certain types."""

    call: Callable[[tuple[Any, ...]], Any]
    address: int  # for kernels.machine.references.caller


# The function that numba makes for Python, of which only the second argument is used: (closure, arguments, named).
_ENTRY = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p)
_FIND = ctypes.CFUNCTYPE(ctypes.c_int64)  # called without Python's lock
_variables: dict[str, ctypes.c_int64] = {}  # addresses of linked kernels, 0: not known yet
_finders: list[Any] = []
_failures: list[BaseException] = []  # of compilations that a kernel asked for
_engines: list[Any] = []  # as long as the process: addresses of the code in them are handed on


def link(code: bytes, names: Mapping[str, str]) -> Code:
    """An object in memory, by the names of the entry in it, of its wrapper for Python and of its environment."""
    provide_symbols()
    triple = llvm.get_process_triple()
    engine = _engine(f'target triple = "{triple}"')  # each object has its own: two may be of the same kernel
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    # The wrapper asks that there be an environment, which is for objects of Python: code that has some is not kept.
    ctypes.c_void_p.from_address(engine.get_global_value_address(names["environment"])).value = id(None)
    entry = _ENTRY(engine.get_function_address(names["wrapper"]))
    return Code(lambda args: _call(entry, args), engine.get_function_address(names["symbol"]))


def _call(entry: Callable[..., Any], args: tuple[Any, ...]) -> Any:
    try:
        return entry(None, args, None)
    except SystemError:
        if _failures:
            raise _failures.pop() from None
        raise


def _engine(assembly: str) -> Any:
    """An engine with a module, as long as the process."""
    machine = llvm.Target.from_triple(llvm.get_process_triple()).create_target_machine(jit=True)
    _engines.append(llvm.create_mcjit_compiler(llvm.parse_assembly(assembly), machine))
    return _engines[-1]


def provide_symbols() -> None:
    """Tell LLVM of all that machine code of kernels names."""
    _provide_numba()
    for name in linked.keys() - _variables.keys():
        variable = _variables[name] = ctypes.c_int64(0)
        find = _FIND(partial(_find, name))
        _finders.append(find)
        llvm.add_symbol(f"{name}.address", ctypes.addressof(variable))
        llvm.add_symbol(f"{name}.find", ctypes.cast(find, ctypes.c_void_p).value)


def _find(name: str) -> int:
    """The address of a linked kernel; of one that fails in its place, where that could not be compiled."""
    try:
        _variables[name].value = linked[name]()
    except BaseException as error:  # an interruption, too: `_call` raises it
        _failures.append(error)
        return _failing()
    return _variables[name].value


@cache
def _failing() -> int:
    """The address of a kernel that fails with a number that numba has for nothing: its caller raises SystemError."""
    return _engine("define i32 @failing() { ret i32 -4 }").get_function_address("failing")


@cache
def _provide_numba() -> None:
    """Tell LLVM of the functions that machine code of numba calls, under the names by which numba does."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    numba = find_spec("numba")
    found = PathFinder.find_spec("numba._helperlib", numba.submodule_search_locations if numba else ())
    if found is None or found.loader is None:
        raise ImportError(
            "numba has no module _helperlib: reinstall it, or install a version that hybrid was tried with"
        )
    helpers = module_from_spec(found)
    found.loader.exec_module(helpers)
    for name, address in helpers.c_helpers.items():
        llvm.add_symbol(f"numba_{name}", address)
        if hasattr(math, name):
            llvm.add_symbol(name, address)
    llvm.add_symbol("_Py_NoneStruct", id(None))
    for error in vars(builtins).values():  # which an entry raises: of these numba takes the address of the class
        if isinstance(error, type) and issubclass(error, BaseException):
            llvm.add_symbol(f"PyExc_{error.__name__}", id(error))
