"""Runs in threads beside each other: kernels release the GIL, and runs share nothing that they write.

The first run is computed in the thread that asks, where listeners are called and signals are heard.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from functools import partial
from typing import TypeVar

from hybrid.errors import ResultError

THREADS = "HYBRID_THREADS"  # environment variable
# s between two looks at what goes on while other threads are waited for.
LOOK_EVERY = 0.1

Found = TypeVar("Found")


def thread_count() -> int:
    """Threads that a run may use: what HYBRID_THREADS says, else one for each core that this process may use.

    ResultError: the variable is no number from 1 on.
    """
    asked = os.environ.get(THREADS, "").strip()
    if not asked:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if not (asked.isdecimal() and int(asked) > 0):
        advice = f"{THREADS}=1 for one thread; without it there are as many as cores"
        raise ResultError(
            f"the environment variable {THREADS} is no number of threads\n    given:    '{asked}'\n"
            f"    expected: a whole number from 1 on\n    try:      {advice}"
        )
    return int(asked)


@contextmanager
def beside(
    tasks: Sequence[Callable[[], Found]], threads: int, look: Callable[[], None], stop: Callable[[], None]
) -> Iterator[list[Callable[[], Found]]]:
    """Functions that give what the tasks give, or raise what they raise; each is called once, in their order.

    threads: this one included; with one, a task begins when its function is called.  look: called every `LOOK_EVERY` s
    while another thread is waited for; stop: makes tasks end soon whose answers are no longer wanted.
    """
    if threads < 2 or len(tasks) < 2:
        yield list(tasks)
        return
    pool = ThreadPoolExecutor(min(threads, len(tasks)) - 1, "hybrid-run")
    try:
        futures = [pool.submit(task) for task in tasks[1:]]
        yield [tasks[0], *(partial(_found, *each, look) for each in zip(tasks[1:], futures, strict=True))]
    finally:
        if any(not future.done() for future in futures):
            stop()
        pool.shutdown(wait=True, cancel_futures=True)  # so that none writes a file after it was removed


def _found(task: Callable[[], Found], future: Future[Found], look: Callable[[], None]) -> Found:
    if future.cancel():  # no thread has begun with it
        return task()
    while wait([future], LOOK_EVERY).not_done:
        look()
    return future.result()
