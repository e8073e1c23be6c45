"""Where compiling a kernel takes its time: processor time by step of numba, each without what it calls.

    python bench/kernel_passes.py                                  run.newton.in_space, reel.payout.stand_still
    python bench/kernel_passes.py run.newton.in_plane run.newton.in_space    in this order, in one process

All are compiled from nothing; what two kernels share is read with the first.  `llvm_lock` is time in LLVM: parsing,
optimising and machine code; the others are numba's own steps, in Python.
"""

from __future__ import annotations

import os
import sys
import time
from collections import Counter
from importlib import import_module
from tempfile import TemporaryDirectory

import numpy as np
from numba.core import event

USUAL = ("run.newton.in_space", "reel.payout.stand_still")
SHOWN = 8


class Passes(event.Listener):
    """Adds up processor time (s) by step."""

    def __init__(self) -> None:
        self.spent: Counter[str] = Counter()
        self._open: list[tuple[str, float, float]] = []  # name, when it began, time in those within it

    def on_start(self, event: event.Event) -> None:
        name = str((event.data or {}).get("name") or event.kind).removeprefix("numba:").split(" [")[0]
        self._open.append((name, time.process_time(), 0.0))

    def on_end(self, event: event.Event) -> None:
        name, began, within = self._open.pop()
        whole = time.process_time() - began
        self.spent[name] += whole - within
        if self._open:
            outer = self._open.pop()
            self._open.append((outer[0], outer[1], outer[2] + whole))


def main(kernels: list[str]) -> None:
    passes = Passes()
    for kind in ("numba:run_pass", "numba:llvm_lock", "numba:compile"):
        event.register(kind, passes)
    for kernel in kernels:
        file, name = kernel.rsplit(".", 1)
        entry = getattr(import_module(f"hybrid.kernels.{file}"), name)
        passes.spent.clear()
        began = time.process_time()
        entry.compile_unless_busy(np.zeros(0, np.int64))
        print(f"{kernel}: {time.process_time() - began:.1f} s")
        for step, spent in passes.spent.most_common(SHOWN):
            print(f"    {step:28}{spent:6.1f}")


if __name__ == "__main__":
    with TemporaryDirectory() as folder:
        os.environ["HYBRID_CACHE_DIR"] = folder
        main(sys.argv[1:] or [*USUAL])
