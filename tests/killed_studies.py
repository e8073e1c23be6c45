"""Studies of which something is killed at a random moment, for tests and benches."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time as clock
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np

from hybrid.store.study_file import OPEN, StudyFile

PROGRAM = [sys.executable, "-c", "from hybrid.cli.commands import main; main()"]


def workers_of(pid: int) -> list[int]:
    """Processes below one, its workers among them."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            fields = (entry / "stat").read_text().rsplit(")", 1)[1].split()
        except OSError:
            continue
        if int(fields[1]) == pid:
            found += [int(entry.name), *workers_of(int(entry.name))]
    return found


@contextmanager
def dask_cluster(folder: Path) -> Iterator[tuple[str, subprocess.Popen[bytes], subprocess.Popen[bytes]]]:
    """A scheduler and a worker in processes of their own: address, scheduler, worker."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    quiet = {"cwd": folder, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    dask = [sys.executable, "-m"]
    port = address.rpartition(":")[2]
    scheduler = subprocess.Popen([*dask, "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard"], **quiet)  # type: ignore[call-overload]  # fmt: skip
    worker = subprocess.Popen([*dask, "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-dashboard", "--death-timeout", "60"], **quiet)  # type: ignore[call-overload]  # fmt: skip
    try:
        yield address, scheduler, worker
    finally:
        for process in (worker, scheduler):
            for pid in workers_of(process.pid):
                os.kill(pid, signal.SIGKILL)
            process.kill()
            process.wait()


def killed_study(study: Path, target: Path, what: str, seed: int, patience: float = 200.0) -> tuple[int, str]:
    """Start a study, kill it, a worker or its scheduler at a random moment after its first batch, and see it end.

    what: study, worker, or scheduler (of a cluster of its own).  Returns its exit code and what it wrote last.
    """
    rng = np.random.default_rng(seed)
    with ExitStack() as stack:
        more = ["--workers", "2"]
        if what == "scheduler":
            address, scheduler, _ = stack.enter_context(dask_cluster(target.parent))
            more = ["--scheduler", address]
        command = [*PROGRAM, "study", str(study), "-o", str(target), *more, "--batch", "1", "-q"]
        process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        begin = clock.monotonic()
        while process.poll() is None and clock.monotonic() - begin < patience:
            if target.exists() and (StudyFile(target).status != OPEN).any():
                break
            clock.sleep(0.02)
        clock.sleep(float(rng.uniform(0.0, 0.5)))
        if process.poll() is None:
            if what == "study":
                process.send_signal(signal.SIGKILL)
            elif what == "scheduler":
                scheduler.send_signal(signal.SIGKILL)
            elif below := workers_of(process.pid):
                os.kill(int(rng.choice(below)), signal.SIGKILL)
        _, text = process.communicate(timeout=300)
        return process.returncode, text
