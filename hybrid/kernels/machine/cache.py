"""Where the machine code of the kernels is kept, and its files.

A file has the machine code of one kernel: a magic word, the number of the format, a header in JSON, the object.  What
is read is executed, so nothing else in it is: no pickle, and no byte before the digest of header and object is right.
The digest finds damage; who may write such a file is a matter of its folder and owner.

numba's own cache looks only at the file a kernel stands in, so it keeps a stale
kernel when a function *imported from another file* is edited.  Here a folder
carries a hash of what compiles, and each file in it a digest of all that its
kernel calls (kernels.machine.kept_code).

Code is looked for in the package first, where a release may bring it for a level
of processors, then in the folder of the user, then it is compiled.
"""

from __future__ import annotations

import atexit
import hashlib
import json
import os
import platform
import shutil
import stat
import struct
import sys
import sysconfig
import tempfile
import uuid
import warnings
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

MAGIC, FORMAT = b"hybrid machine code\n", 2
SUFFIX = ".kernel"
_SIZES = struct.Struct("<II")  # number of the format, bytes of the header
_LONGEST_HEADER = 1 << 20


class Unusable(Exception):
    """Why a file of machine code is not used."""


def digest(*parts: str | bytes) -> str:
    """SHA-256 of parts, none of which runs into the next."""
    made = hashlib.sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        made.update(b"%d:" % len(data))
        made.update(data)
    return made.hexdigest()


def write_code(path: Path, header: dict[str, Any], code: bytes) -> None:
    """Write a file, or leave none: it is moved to its name when it is complete.  header: values of JSON."""
    header = header | {"bytes": len(code)}
    text = json.dumps(header | {"sha256": _sum_of(header, code)}).encode()
    new = path.with_name(f"{path.name}.{uuid.uuid4().hex[:16]}")
    try:
        with open(new, "xb", opener=lambda name, flags: os.open(name, flags, 0o644)) as file:  # whatever the umask
            file.write(MAGIC + _SIZES.pack(FORMAT, len(text)) + text + code)
        new.replace(path)
    except OSError:
        with suppress(OSError):
            new.unlink()
        raise


def read_code(path: Path, expected: dict[str, Any], trust: bool) -> tuple[dict[str, Any], bytes] | None:
    """Header and object of a file, or None where there is none; Unusable says what is wrong with it.

    expected: what the header must say.  trust: whoever owns the file and may write to it.
    """
    try:
        with path.open("rb") as file:
            why = None if trust else others_may_write(os.fstat(file.fileno()))
            if why:
                raise Unusable(why)
            data = file.read()
    except FileNotFoundError:
        return None
    except OSError as error:
        raise Unusable(error.strerror or str(error)) from None
    header, code = _parts(data)
    wrong = [name for name, value in expected.items() if header.get(name) != value]
    if wrong:
        raise Unusable(f"is of another {', '.join(wrong)}")
    return header, code


def others_may_write(found: os.stat_result) -> str | None:
    """Why a file or folder is not this user's alone to write; None if it is, or is root's."""
    if not hasattr(os, "getuid"):  # caches of Windows lie in folders of one user
        return None
    if found.st_uid not in (os.getuid(), 0):
        return f"belongs to another user ({found.st_uid})"
    if stat.S_IMODE(found.st_mode) & 0o022:
        return f"can be written by other users (mode {stat.S_IMODE(found.st_mode):o})"
    return None


def _parts(data: bytes) -> tuple[dict[str, Any], bytes]:
    """Header and object of the content of a file, whose digest is right."""
    begin = len(MAGIC) + _SIZES.size
    if len(data) < begin or not data.startswith(MAGIC):
        raise Unusable("is no machine code of hybrid" if data else "is empty")
    form, size = _SIZES.unpack_from(data, len(MAGIC))
    if form != FORMAT:
        raise Unusable(f"has the format {form}, not {FORMAT}")
    if size > _LONGEST_HEADER or begin + size > len(data):
        raise Unusable("is truncated")
    try:
        header = json.loads(data[begin : begin + size])
        found = header.pop("sha256")
    except (ValueError, RecursionError, KeyError, AttributeError, TypeError):
        raise Unusable("is damaged") from None
    code = data[begin + size :]
    if header.get("bytes") != len(code):
        raise Unusable("is truncated")
    if found != _sum_of(header, code):
        raise Unusable("is damaged")
    return header, code


def _sum_of(header: dict[str, Any], code: bytes) -> str:
    return digest(json.dumps(header, sort_keys=True), code)


# They keep machine code and call it, and make none.
KEEPERS = ("argument_types.py", "cache.py", "code_file.py", "kept_code.py", "linked_code.py")
KEPT = 4  # older folders, and codes of a kernel, are deleted; four let a few versions or branches live side by side
PYTHON = f"{sys.version_info[0]}.{sys.version_info[1]}{getattr(sys, 'abiflags', '')}"
SHIPPED = Path(__file__).parents[1] / "compiled"
NEEDS = "needs.txt"  # in it: the numba and llvmlite whose code it is, as requirements


class CacheWarning(UserWarning):
    """Kept machine code is not used, and why."""


class Level(NamedTuple):
    """Processors for which a release brings machine code: LLVM's name of them, and what it may use of them."""

    name: str
    features: tuple[str, ...]


class Processor(NamedTuple):
    """What machine code is made for."""

    triple: str
    name: str
    features: str  # as LLVM takes them: +avx2,-sse4a


V2 = ("cx16", "popcnt", "sahf", "sse3", "sse4.1", "sse4.2", "ssse3")
LEVELS = (
    Level("x86-64-v3", (*V2, "avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "xsave")),
    Level("generic", ("neon",)),  # of 64-bit ARM
)


# What numba reads of the processor, and processors on which it uses no AVX.
_SETTINGS = "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "NUMBA_ENABLE_AVX"
_WITHOUT_AVX = "corei7-avx", "core-avx-i", "sandybridge", "ivybridge", "nocona"


@cache
def compiler_hash(machine: Path = Path(__file__).parent) -> str:
    """Hash of the sources that compile kernels, of the compiler's version and of the Python that calls them.

    numpy and the third number of Python's version are not in it: kernels call numba's functions and Python's C
    interface, which know them.
    """
    made = hashlib.sha256()
    for file in sorted(x for x in machine.glob("*.py") if x.name not in KEEPERS):
        made.update(file.name.encode())
        made.update(file.read_bytes())
    for name in ("numba", "llvmlite"):
        made.update(f"{name} {version(name)}".encode())
    made.update(f"{sys.implementation.name} {PYTHON} {platform.machine()} {sysconfig.get_platform()}".encode())
    return made.hexdigest()[:16]


@cache
def processor() -> Processor:
    """The processor that kernels are compiled for, as numba has it; it is asked only where its own rules count."""
    from llvmlite import binding as llvm

    name, features = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    if is_set() or name in _WITHOUT_AVX or "+avx," not in features:
        from numba.core.registry import cpu_target

        return processor_from(*cpu_target.target_context.codegen().magic_tuple())
    return processor_from(llvm.get_process_triple(), name, features)


def processor_from(triple: str, name: str, features: str) -> Processor:
    """As LLVM and numba name it; without the version of macOS, which ends the triple there."""
    return Processor(triple.rstrip("0123456789."), name, features)


def is_set() -> bool:
    """Whether the user tells numba of a processor, by its variables or in its file of settings."""
    return any(os.environ.get(x) for x in _SETTINGS) or Path(".numba_config.yaml").exists()


@cache
def shipped_for() -> Processor | None:
    """The level whose code in the package this processor can execute, None where there is none.

    Nor is there where the user's settings of numba name a processor.
    """
    if is_set():
        return None
    has = set(processor().features.split(","))
    for level in LEVELS:
        if all(f"+{x}" in has for x in level.features) and folder_of(level.name).is_dir():
            return processor_of(level)
    return None


def processor_of(level: Level) -> Processor:
    """The processors of a level, of this system."""
    return Processor(processor().triple, level.name, features_of(level))


def code_in_use() -> str:
    """In words: the machine code in the package and for which processors, or why there is none to use."""
    place = shipped_place()
    if place and (count := len(list(place.folder.glob(f"*-{place.mark}-*{SUFFIX}")))):
        return f"of the package, for {place.processor.name} ({count} kernels); others are compiled once"
    return f"compiled once for this processor{unused_code()}; kept in {cache_folder()}"


def unused_code() -> str:
    """Why the code in the package is not used; empty where there is none."""
    if not (SHIPPED / NEEDS).exists():
        return ""
    needed = (SHIPPED / NEEDS).read_text(encoding="utf-8").split()
    there = [f"{x}=={version(x)}" for x in ("numba", "llvmlite")]
    if there != needed:
        return f" (code in the package is for {' '.join(needed)}, installed are {' '.join(there)})"
    if is_set():
        return f" (code in the package is not used: {', '.join(_SETTINGS)} or .numba_config.yaml name a processor)"
    if shipped_place() is None:
        return " (code in the package is for another processor, system or Python)"
    return " (code in the package is of other sources)"


def features_of(level: Level) -> str:
    """As LLVM and NUMBA_CPU_FEATURES take them."""
    return ",".join(f"+{x}" for x in level.features)


def folder_of(level: str) -> Path:
    """The folder in the package with the code for a level of this system, Python and numba."""
    return SHIPPED / f"{sysconfig.get_platform()}-{level}-py{PYTHON}-numba{version('numba')}"


class Place(NamedTuple):
    """A folder with machine code for a processor; ours: it is written to and mended, and must be the user's alone."""

    folder: Path
    processor: Processor
    ours: bool

    @property
    def mark(self) -> str:
        """In the name of each file: of the processor and of what compiles."""
        return digest(*self.processor, compiler_hash())[:12]


@cache
def shipped_place() -> Place | None:
    """The folder in the package, which is as much trusted as the package is."""
    level = shipped_for()
    return level and Place(folder_of(level.name), level, ours=False)


def places() -> list[Place]:
    """Where machine code may be, in the order in which it is looked for."""
    shipped = shipped_place()
    return [*([shipped] if shipped else []), Place(cache_folder(), processor(), ours=True)]


def shared() -> bool:
    """Whether the user says that all who may write to the cache are trusted."""
    return os.environ.get("HYBRID_CACHE_SHARED", "") not in ("", "0")


def cache_folder() -> Path:
    """Folder of this compiler's machine code: HYBRID_CACHE_DIR, else the user's cache folder, else a temporary one.

    What is loaded from it is executed: it is used only where nobody but the user and root may write to it.
    """
    root = os.environ.get("HYBRID_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    base = Path(root) / "hybrid-cable"
    try:
        make_folder(base)
        usable = os.access(base, os.W_OK) and _is_safe(base) and _is_safe(base / compiler_hash())
    except OSError:
        usable = False
    return (base if usable else temporary_folder()) / compiler_hash()


def make_folder(folder: Path) -> None:
    """Make a folder of the cache, to which only the user may write unless it is shared."""
    folder.mkdir(mode=0o777 if shared() else 0o700, parents=True, exist_ok=True)


def _is_safe(folder: Path) -> bool:
    """Whether nobody else may write to a folder, or it is not there yet; else it is said."""
    if shared() or not os.path.lexists(folder):
        return True
    why = others_may_write(folder.stat())
    if why:
        remedy = "chmod go-w it, name another folder in HYBRID_CACHE_DIR, or set HYBRID_CACHE_SHARED=1"
        warn_once(
            f"the cache folder {folder} {why}, who could run code as you: machine code is kept in a temporary folder; "
            f"{remedy} if you trust all of them"
        )
    return why is None


@cache
def warn_once(text: str) -> None:
    """In one line: `hybrid` shows it as a note."""
    warnings.warn(text, CacheWarning, stacklevel=2)


@cache
def temporary_folder() -> Path:
    """A folder among the temporary ones that nobody else may write to: what is loaded from a cache is executed.

    The same one for all processes of a user; where its name is taken by somebody else, one for this process alone.
    """
    base = Path(tempfile.gettempdir()) / f"hybrid-cable-{os.getuid() if hasattr(os, 'getuid') else 'user'}"
    try:
        base.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = base.lstat()
        private = stat.S_ISDIR(found.st_mode)
        if hasattr(os, "getuid"):  # where it is missing, temporary folders belong to one user
            private = private and found.st_uid == os.getuid() and not found.st_mode & 0o077
    except OSError:
        private = False
    if private:
        return base
    own = Path(tempfile.mkdtemp(prefix="hybrid-cable-"))
    atexit.register(shutil.rmtree, own, ignore_errors=True)
    return own


def prune(folder: Path) -> None:
    """Delete the oldest caches of other compilers; another process may be doing the same, so nothing here may fail."""
    with suppress(OSError):
        for old in _older([p for p in folder.parent.iterdir() if p.is_dir() and p != folder], KEPT - 1):
            shutil.rmtree(old, ignore_errors=True)


def prune_codes(folder: Path, name: str) -> None:
    """Delete the oldest codes whose names begin with that of a kernel and of its arguments."""
    with suppress(OSError):
        for old in _older(list(folder.glob(f"{name}-*{SUFFIX}")), KEPT):
            old.unlink()


def _older(paths: list[Path], kept: int) -> list[Path]:
    """All but the newest."""
    return sorted(paths, key=os.path.getmtime)[: max(0, len(paths) - kept)]
