"""Where the machine code of the kernels is kept, and whether it is there.

numba's own cache looks only at the file a kernel stands in, so it keeps a stale
kernel when a function *imported from another file* is edited.  Here the cache
folder carries a hash of every source file that can hold a kernel; an edit
anywhere means a new folder and a fresh compilation.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import platform
import shutil
import stat
import tempfile
from collections.abc import Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path

KERNELS = ("kernels/*.py", "adapt/zone_rules.py")
KEPT_CACHES = 4  # older compilations are deleted; four let a few versions or branches live side by side


@cache
def kernel_hash(package: Path = Path(__file__).parents[1]) -> str:
    """Hash of all kernel sources and of the compiler's version."""
    digest = hashlib.sha256()
    for where in KERNELS:
        for file in sorted(package.glob(where)):
            digest.update(file.relative_to(package).as_posix().encode())
            digest.update(file.read_bytes())
    for name in ("numba", "llvmlite", "numpy"):
        digest.update(f"{name} {version(name)}".encode())
    digest.update(f"{platform.python_version()} {platform.machine()}".encode())
    return digest.hexdigest()[:16]


def cache_folder() -> Path:
    """Folder of this version's machine code: HYBRID_CACHE_DIR, else the user's cache folder, else a temporary one."""
    root = os.environ.get("HYBRID_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    base = Path(root) / "hybrid-cable"
    try:
        base.mkdir(parents=True, exist_ok=True)
        writable = os.access(base, os.W_OK)
    except OSError:
        writable = False
    return (base if writable else temporary_folder()) / kernel_hash()


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


def is_warm(kernels: Sequence[str]) -> bool:
    """True when these kernels of this version, as file.function, were compiled on this machine before."""
    folder = cache_folder()
    return folder.is_dir() and all(any(folder.rglob(f"{name}-*.nbc")) for name in kernels)


def prune(folder: Path) -> None:
    """Delete the oldest sibling caches; another process may be doing the same, so nothing here may fail."""
    try:
        siblings = sorted((p for p in folder.parent.iterdir() if p.is_dir() and p != folder), key=os.path.getmtime)
        for old in siblings[: max(0, len(siblings) - (KEPT_CACHES - 1))]:
            shutil.rmtree(old, ignore_errors=True)
    except OSError:
        pass
