"""Machine code in memory, ready to be called.  Tried with numba 0.62.0 and 0.68.1.

Linked by LLVM, without numba, whose import takes as long as a short run: of numba, code needs some functions in C,
which are in one of its extension modules.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Mapping
from functools import cache
from importlib.machinery import PathFinder
from importlib.util import find_spec, module_from_spec
from typing import Any, NamedTuple

from llvmlite import binding as llvm


class Code(NamedTuple):
    """Machine code of an entry for arguments of certain types."""

    call: Callable[[tuple[Any, ...]], Any]
    address: int  # for kernels.machine.references.caller


# The function that numba makes for Python, of which only the second argument is used: (closure, arguments, named).
_ENTRY = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p, ctypes.py_object, ctypes.c_void_p)
_engines: list[Any] = []  # as long as the process: addresses of the code in them are handed on


def link(code: bytes, names: Mapping[str, str]) -> Code:
    """An object in memory, by the names of the entry in it, of its wrapper for Python and of its environment."""
    _provide_symbols()
    triple = llvm.get_process_triple()
    machine = llvm.Target.from_triple(triple).create_target_machine(jit=True)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(f'target triple = "{triple}"'), machine)
    _engines.append(engine)  # each object has its own: two may be of the same kernel
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    # The wrapper asks that there be an environment, which is for objects of Python: code that has some is not kept.
    ctypes.c_void_p.from_address(engine.get_global_value_address(names["environment"])).value = id(None)
    entry = _ENTRY(engine.get_function_address(names["wrapper"]))
    return Code(lambda args: entry(None, args, None), engine.get_function_address(names["symbol"]))


@cache
def _provide_symbols() -> None:
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
