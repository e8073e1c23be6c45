"""Room on a disk, asked for before HDF5 writes: a file that it cannot write ends the process when it is closed."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from hybrid.errors import ResultError

# Bytes that are left alone: closing a file, and its status, take some tens of kB.
RESERVE = 1 << 20


def ask_for_room(path: Path, need: int, then: str) -> None:
    """ResultError if fewer than `need` bytes (and a reserve) can be added to a file; then: what to do when they can."""
    free = room(path)
    if free < need + RESERVE:
        mega = (free / 1e6, (need + RESERVE) / 1e6)
        detail = "{:.3g} MB are free there, {:.3g} MB are needed".format(*mega)
        raise ResultError(f"{path} cannot be written\n    detail:   {detail}\n    try:      free some space{then}")


def room(path: Path) -> int:
    """Bytes that a file (which need not be there yet) can still grow by; quotas do not show."""
    where = path if path.exists() else path.parent
    free = 1 << 62
    if hasattr(os, "statvfs"):
        found = os.statvfs(where)
        free = found.f_bavail * found.f_frsize
    with suppress(ImportError):  # Windows has no such limits
        import resource

        most = resource.getrlimit(resource.RLIMIT_FSIZE)[0]
        if most != resource.RLIM_INFINITY:
            free = min(free, most - (path.stat().st_size if path.exists() else 0))
    return free
