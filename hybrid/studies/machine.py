"""Where something was measured: machine, date, versions, commit; as lines for the heading of a page."""

from __future__ import annotations

import os
import platform
import subprocess
from contextlib import suppress
from datetime import datetime
from importlib.metadata import version
from pathlib import Path


def facts_of_machine() -> list[tuple[str, str]]:
    """What a reader has to know before comparing a time with another machine's."""
    load = f", load {os.getloadavg()[0]:.1f} at the beginning" if hasattr(os, "getloadavg") else ""
    used = ", ".join(f"{name} {version(name)}" for name in ("hybrid-cable", "numpy", "numba"))
    facts = [("machine", f"{_processor()}, {os.cpu_count()} cores{load}")]
    facts += [("date", datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z"))]
    facts += [("versions", f"{used}, Python {platform.python_version()}")]
    commit = _commit()
    return [*facts, ("commit", commit)] if commit else facts


def _processor() -> str:
    """The model of the processor, as well as the system knows it."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _commit() -> str:
    """Of the checkout that the package is in; "" if it is in none."""
    root = Path(__file__).parents[2]
    if not (root / ".git").exists():
        return ""
    with suppress(OSError, subprocess.CalledProcessError):
        ask = {"cwd": root, "capture_output": True, "text": True, "check": True}
        commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], **ask).stdout.strip()  # type: ignore[call-overload]
        changed = subprocess.run(["git", "status", "--porcelain", "hybrid"], **ask).stdout.strip()  # type: ignore[call-overload]
        return f"{commit}, with changes" if changed else str(commit)
    return ""
