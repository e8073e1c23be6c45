"""The batches of a study: sent to workers a few ahead, and written as they come back; a kill of anything is expected.

Batches come back in any order.  Units, places and times of what is kept are those of the first case in order that has
it, so that results do not depend on the number of workers: a batch that would be the first to have something waits
until all batches before it are written.
"""

from __future__ import annotations

import os
import re
import sys
import time as clock
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybrid.errors import ResultError, optional_package
from hybrid.scene.study import Kept
from hybrid.simulation.own_parts import RunPart
from hybrid.store.study_file import FAILED, KILLED, OPEN, StudyFile, counts_of
from hybrid.studies.cases import Cases
from hybrid.studies.workers import Job, Outcome, compute_batch, has_something_new, write_outcomes

# Batches that a worker has, or waits for.
AHEAD = 3


@dataclass(frozen=True)
class StudyRunning:
    """Progress of a study: cases in all, done, failed; s since it began; dask's dashboard, "" if there is none."""

    total: int
    done: int
    failed: int
    elapsed: float
    dashboard: str

    @property
    def left(self) -> int:
        return self.total - self.done - self.failed


def compute_open_batches(
    file: StudyFile, cases: Cases, wanted: Mapping[str, Kept], workers: int | None, scheduler: str | None,
    progress: Callable[[StudyRunning], None] | None, files: str = "", parts: Sequence[RunPart] = (),
) -> None:  # fmt: skip
    """Compute the batches of a study that are not done; files: folder for whole results, "": they are not kept.

    parts: of all runs, of the user's own.  ResultError when the scheduler is gone.
    """
    begin = clock.perf_counter()

    def report(dashboard: str) -> None:
        if progress is not None:
            now = counts_of(file.status)
            progress(StudyRunning(file.cases, now["done"], now["failed"], clock.perf_counter() - begin, dashboard))

    def job_of(k: int) -> Job:
        where = file.slice_of(k)
        return Job(cases.base, cases.keys, cases.rows[where], wanted, cases.static, where.start, files, parts)

    with client_of(workers, scheduler) as client:
        dashboard = str(getattr(client, "dashboard_link", "") or "")
        report(dashboard)
        batches = _Batches(client, file, job_of, lambda: report(dashboard))
        try:
            batches.compute(file.open_batches())
        except (OSError, TimeoutError, CancelledError) as error:  # distributed's errors of a lost connection are these
            raise ResultError(_gone(file, str(error) or type(error).__name__)) from None
        finally:
            with suppress(Exception):
                client.cancel(list(batches.running))


class _Batches:
    """Batches by what has become of them: running, aside because workers died of them, or computed and not written."""

    def __init__(self, client: Any, file: StudyFile, job_of: Callable[[int], Job], written: Callable[[], None]) -> None:
        self._client, self._file, self._job_of, self._written = client, file, job_of, written
        self._distributed = optional_package("distributed", "a study", "studies")
        self._waiting = self._distributed.as_completed(loop=client.loop)
        self.running: dict[Any, int] = {}
        self._aside: list[int] = []
        self._computed: dict[int, list[Outcome]] = {}

    def compute(self, batches: list[int]) -> None:
        """Compute batches, and write them."""
        left = iter(batches)
        most = AHEAD * max(sum(self._client.nthreads().values()), 1)
        while True:
            stuck = self._aside and self._computed  # what is computed waits for a batch that is aside: that one first
            while len(self.running) < most and not stuck and (k := next(left, None)) is not None:
                self._send(k)
            if self.running:
                self._receive(next(self._waiting))
            elif self._aside:
                k = self._aside.pop(0)
                self._keep(k, self._one_by_one(self._job_of(k)))
            else:
                return

    def _send(self, k: int) -> None:
        future = self._client.submit(compute_batch, self._job_of(k), pure=False)
        self.running[future] = k
        self._waiting.add(future)

    def _receive(self, future: Any) -> None:
        """Take what a batch has come to."""
        if future.status in ("lost", "pending"):  # its worker died with the result: it is computed again elsewhere
            self._waiting.add(future)
            return
        k = self.running.pop(future)
        try:
            if future.status == "cancelled":
                raise ResultError(_gone(self._file, "its tasks are cancelled"))
            self._keep(k, future.result())
        except self._distributed.KilledWorker:
            self._aside.append(k)
        future.release()

    def _one_by_one(self, job: Job) -> list[Outcome]:
        """The cases of a batch whose worker died, each alone, so that the one that kills a worker is known.

        Nothing else may run: of whatever a worker was about to compute, dask counts its death.
        """
        outcomes = []
        for k, row in enumerate(job.rows):
            future = self._client.submit(compute_batch, job._replace(rows=[row], first=job.first + k), pure=False)
            try:
                outcomes += future.result()
            except self._distributed.KilledWorker:
                outcomes.append(Outcome(FAILED, KILLED, "", np.nan, -1, {}))
            future.release()
        return outcomes

    def _keep(self, k: int, outcomes: list[Outcome]) -> None:
        """Write a batch, and those that have waited for it; or let it wait."""
        if k == 0:
            _refuse_what_is_never_kept(outcomes[0])
        self._computed[k] = outcomes
        for each in sorted(self._computed):
            first_open = np.flatnonzero(self._file.status == OPEN)[0]
            if first_open < self._file.slice_of(each).start and has_something_new(self._file, self._computed[each]):
                continue
            write_outcomes(self._file, each, self._computed.pop(each))
            self._written()


def _refuse_what_is_never_kept(first: Outcome) -> None:
    """ResultError if the first case has nothing of what is to be kept of every one, whatever the size of batches is."""
    if first.absent:
        raise ResultError(
            f"of case 0 something cannot be kept, and so of all like it: {first.absent}\n"
            "    try:      another collect; where other cases have it, one of these first"
        )


def _gone(file: StudyFile, detail: str) -> str:
    now = counts_of(file.status)
    done = now["done"] + now["failed"]
    return (
        f"the scheduler of the study is gone; {done} of {file.cases} cases are in {file.path}\n"
        f"    detail:   {detail}\n    try:      the same command goes on"
    )


# The dask cluster that a study runs on: one of this machine, or one that runs.

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
