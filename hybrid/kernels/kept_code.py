"""Machine code of entries on disk, as numba asks for it: looked up, loaded, kept.  Tried with numba 0.62.0 and 0.68.1.

numba's own cache unpickles what it finds, and with it executes whatever that says.  Here a file holds machine code and
three names (kernels.code_file); all else that numba wants to know of a kernel follows from the function and the types
of its arguments.
"""

from __future__ import annotations

import hashlib
import inspect
import re
from collections.abc import Callable
from contextlib import suppress
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from numba import types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import compile_result
from numba.core.funcdesc import PythonFunctionDescriptor
from numba.core.lowering import Environment
from numba.core.serialize import dumps
from numba.core.sigutils import normalize_signature
from numba.core.typing import signature

from hybrid.kernels import cache as kept
from hybrid.kernels.code_file import SUFFIX, Unusable, digest, read_code, write_code


class KeptCode:
    """In the place of numba's cache of a function."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        self._enabled = True

    @property
    def cache_path(self) -> str:
        return str(_own_place().folder)

    def enable(self) -> None:
        self._enabled = True

    def disable(self) -> None:
        self._enabled = False

    def flush(self) -> None:
        """Delete the code of this function in the user's folder."""
        for file in _own_place().folder.glob(f"{self._name}-*{SUFFIX}"):
            file.unlink(missing_ok=True)

    def holds(self, sig: Any) -> bool:
        """Whether there is a file with the code for a signature."""
        return any(self._file(place, sig).is_file() for place in _all_places())

    def load_overload(self, sig: Any, target: Any) -> Any:
        """What numba calls the result of a compilation, from disk; None where it has to be compiled.

        The registries of numba are not asked for, which bring scipy.linalg: a compilation brings them itself.
        """
        if not self._enabled:
            return None
        for place in _all_places():
            file = self._file(place, sig)
            try:
                found = read_code(file, self._header(place, sig), trust=not place.ours or kept.shared())
            except Unusable as why:
                self._mend(file, place, why)
                continue
            if found:
                return self._loaded(*found, normalize_signature(sig)[0], target)
        return None

    def save_overload(self, sig: Any, result: Any) -> None:
        if not self._enabled or not self._can_be_kept(result):
            return
        result.library._ensure_finalized()
        place, described = _own_place(), result.fndesc
        names = {"library": result.library.name, "symbol": described.mangled_name, "environment": described.env_name}
        try:
            kept.make_folder(place.folder)
            write_code(self._file(place, sig), self._header(place, sig) | names, result.library._get_compiled_object())
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

    def _can_be_kept(self, result: Any) -> bool:
        """Code that refers to nothing of this process; in Python's objects or numba's libraries it would."""
        refers = result.lifted or result.reload_init or result.environment.consts or result.library.has_dynamic_globals
        if refers:
            kept.warn_once(
                f"{self._function.__qualname__} is compiled at every run: it refers to objects of Python, to large "
                "global arrays or to LAPACK, which machine code on disk cannot"
            )
        return not refers

    @cached_property
    def _name(self) -> str:
        """file.function, of characters that any file system takes."""
        module = self._function.__module__.rpartition(".")[2]
        return re.sub(r"[^\w.]", "", f"{module}.{self._function.__qualname__}")

    @cached_property
    def _source(self) -> str:
        """Of what the hash of all kernels does not know: kernels of tests and users, and what a closure holds."""
        cells = tuple(x.cell_contents for x in self._function.__closure__ or ())
        code = self._function.__code__
        return digest(code.co_code, str(code.co_firstlineno), dumps(cells), _content(inspect.getfile(self._function)))

    def _header(self, place: kept.Place, sig: Any) -> dict[str, Any]:
        """What the file for a signature says of what it is."""
        return {
            "kernel": f"{self._function.__module__}.{self._function.__qualname__}",
            "signature": str(normalize_signature(sig)[0]),
            "triple": place.processor.triple,
            "processor": place.processor.name,
            "features": place.processor.features,
            "kernels": kept.kernel_hash(),
            "source": self._source,
        }

    def _file(self, place: kept.Place, sig: Any) -> Path:
        which = digest(*self._header(place, sig).values())[:16]
        return place.folder / f"{self._name}-{place.mark}-{which}{SUFFIX}"

    def _loaded(self, header: dict[str, Any], code: bytes, args: Any, target: Any) -> Any:
        function = self._function
        described = PythonFunctionDescriptor(
            native=True, modname=function.__module__, qualname=function.__qualname__,
            unique_name=function.__qualname__, doc=function.__doc__ or "", typemap=None, calltypes=None,
            restype=types.undefined,  # Python is given objects; kernels call `part`, or an address
            args=tuple(inspect.signature(function).parameters), kws=(), argtypes=args,
            mangler=lambda *_, **__: header["symbol"], env_name=header["environment"],
        )  # fmt: skip
        library = _LoadedCode(target.codegen(), header["library"], code)
        environment = Environment.from_fndesc(described)
        return compile_result(
            target_context=target, typing_context=None, library=library, environment=environment,
            entry_point=target.get_executable(library, described, environment), fndesc=described,
            signature=signature(described.restype, *args), objectmode=False, lifted=(), reload_init=[],
            referenced_envs=(), type_annotation="",
        )  # fmt: skip


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


@cache
def _content(source: str) -> bytes:
    return hashlib.sha256(Path(source).read_bytes()).digest()
