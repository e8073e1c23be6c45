"""Ctrl-C and SIGTERM as a flag that is looked at where work can stop."""

from __future__ import annotations

import signal
import threading
import time as clock
from collections.abc import Callable, Iterator
from contextlib import contextmanager

# s between two signals of which the second ends a run at once: process managers may send the same one twice.
IMPATIENT = 1.0

_AT_ONCE = [0]  # how many sections are entered in which a signal is raised when it comes


@contextmanager
def interrupts() -> Iterator[Callable[[], bool]]:
    """Catch Ctrl-C and SIGTERM as a flag, so that a run ends between two steps and its file is complete, and a study
    ends between two runs with its table written.  Gives the flag; may be nested: the inner one hears a signal first.

    A second one, `IMPATIENT` s later, is raised at once, as in a long compilation or search of an equilibrium.  A
    signal for which nothing was raised, because the run ended or failed first, goes to the handler from before.
    """
    if threading.current_thread() is not threading.main_thread():
        yield lambda: False
        return
    caught: list[int] = []
    first = 0.0  # s of the clock

    def catch(number: int, _frame: object) -> None:
        nonlocal first
        if _AT_ONCE[0] or (caught and clock.monotonic() - first > IMPATIENT):
            raise KeyboardInterrupt
        first = first if caught else clock.monotonic()
        caught.append(number)

    before = {}
    for number in (signal.SIGINT, signal.SIGTERM):
        before[number] = signal.signal(number, catch)
    try:
        yield lambda: bool(caught)
    except KeyboardInterrupt:
        caught.clear()
        raise
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if caught:
            signal.raise_signal(caught[0])


@contextmanager
def at_once(heard: Callable[[], bool] = lambda: False) -> Iterator[None]:
    """A section that nothing is written in, such as the search of an equilibrium: a signal is raised when it comes.

    heard: the flag of `interrupts`: one that came before is raised here.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    if heard():
        raise KeyboardInterrupt
    _AT_ONCE[0] += 1
    try:
        yield
    finally:
        _AT_ONCE[0] -= 1
