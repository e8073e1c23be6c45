"""The dask cluster that a study runs on: one of this machine, or one that runs."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

from hybrid.errors import ResultError, optional_package

# So often a batch is tried whose worker died; then its cases are computed one by one.
TRIES = 3


@contextmanager
def client_of(workers: int | None, scheduler: str | None) -> Iterator[Any]:
    """A client of dask: of a cluster on this machine, or of a scheduler that runs."""
    distributed = optional_package("distributed", "a study", "studies")
    import dask

    settings = {
        "distributed.scheduler.allowed-failures": TRIES - 1, "distributed.comm.timeouts.connect": "20s",
        # A killed worker starts again; on a busy machine that takes longer than the 15 s after which dask gives it up,
        # and the study would wait for ever for workers that are not there.
        "distributed.deploy.lost-worker-timeout": "1h",
        "distributed.worker.profile.enabled": False,  # it stops the worker a hundred times a second to look at it
        # dask has the C library give back all memory that is freed, which a run then asks for anew: 17 % of its time.
        # These are the largest values that the library itself comes to.
        "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": 64 * 1024 * 1024,
        "distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_": 32 * 1024 * 1024,
        # While nothing happens scheduler and worker take 5 % of a core at dask's intervals, of 20 to 500 ms, here 1 %;
        # batches take seconds.
        "distributed.admin.tick.interval": "1s", "distributed.admin.tick.limit": "1 minute",
        "distributed.admin.system-monitor.gil.enabled": False,
        "distributed.admin.system-monitor.interval": "2s", "distributed.worker.memory.monitor-interval": "500ms",
    }  # fmt: skip
    with dask.config.set(settings), ExitStack() as stack:
        if scheduler is not None:
            if not re.search(r":\d+$|^inproc://", scheduler):
                raise ResultError(f"'{scheduler}' is no address of a scheduler\n    expected: such as tcp://host:8786")
            stack.enter_context(_quiet("distributed"))
            try:
                yield stack.enter_context(distributed.Client(scheduler, timeout="20s", set_as_default=False))
            except OSError as error:
                raise ResultError(f"no scheduler answers at {scheduler}\n    detail:   {error}") from None
            return
        stack.enter_context(_main_is_not_imported())
        before = os.environ.get("HYBRID_THREADS")
        os.environ["HYBRID_THREADS"] = "1"
        try:
            cluster = stack.enter_context(
                distributed.LocalCluster(
                    n_workers=workers or os.cpu_count() or 1,
                    threads_per_worker=1,
                    dashboard_address=":0",
                    silence_logs=50,
                )
            )
            yield stack.enter_context(distributed.Client(cluster, set_as_default=False))
        finally:
            os.environ.pop("HYBRID_THREADS") if before is None else os.environ.update(HYBRID_THREADS=before)


@contextmanager
def _quiet(name: str) -> Iterator[None]:
    """Nothing is logged under a name and below it: that a scheduler is gone is said once, in our words."""
    import logging

    known = [x for x in list(logging.Logger.manager.loggerDict) if x == name or x.startswith(f"{name}.")]
    before = {x: logging.getLogger(x).level for x in known}
    for x in before:
        logging.getLogger(x).setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for x, level in before.items():
            logging.getLogger(x).setLevel(level)


@contextmanager
def _main_is_not_imported() -> Iterator[None]:
    """Workers do not import the user's script, which would run again there: they need this package alone."""
    main = sys.modules["__main__"]
    hidden = {name: vars(main)[name] for name in ("__file__", "__spec__") if vars(main).get(name) is not None}
    for name in hidden:
        setattr(main, name, None)
    try:
        yield
    finally:
        for name, value in hidden.items():
            setattr(main, name, value)
