"""Progress of a run over all of its passes: the mesh pre-run, the runs that estimate errors, the result.

One bar spans all passes.  Their costs are weighed beforehand by steps and cells; a refinement that turns out to be
needed is added to the total when it begins, so that the fraction done falls back then.

Listeners are called by the thread that made the reporter; what runs in other threads have done counts in its reports.
"""

from __future__ import annotations

import signal
import sys
import threading
import time as clock
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TextIO

from hybrid.errors import command_for
from hybrid.kernels.machine.compile import is_warm
from hybrid.model.mesh import Zone
from hybrid.model.resolution import Resolution

# Passes of a computation.
PRE_RUN = "mesh pre-run"
ESTIMATION = "error estimation"
RESULT = "result"
REFINEMENT = "refinement"

CONTACT = "contact"
COMPILING = "compiling the kernels for this machine (first use only, up to two minutes) ..."
REPORT_EVERY = 0.1  # s of wall time between two calls of a listener
# The speed of the last so many reports (about 5 s) gives the time left: the compilation of the first step, or a slow
# stretch long past, says nothing about it.
REMEMBERED = 50


@dataclass(frozen=True)
class Progress:
    """Where a run is.

    t, duration: s, of the present pass; step: its number; iterations: of Newton's method in the last step; zones;
    wall: s since the first report.  run, runs: number of the present pass, from 1, and of all that are expected; name:
    what it is for, one of PRE_RUN, ESTIMATION, RESULT, REFINEMENT.  fraction: part that is done of all passes, 0 to 1;
    seconds_left: s of wall time that all of them still take, None while that is not known.  touches: whether contact of
    a line with itself is computed, which makes steps dear.
    """

    t: float
    duration: float
    step: int
    iterations: int
    zones: tuple[Zone, ...]
    wall: float
    run: int = 1
    runs: int = 1
    name: str = RESULT
    fraction: float = 0.0
    seconds_left: float | None = None
    touches: bool = False

    @property
    def text(self) -> str:
        """One line for people."""
        which = f"run {self.run} of {self.runs}: {self.name}, " if self.runs > 1 else ""
        left = f", {self.seconds_left:.2g} s left" if self.seconds_left is not None else ""
        contact = f", {CONTACT}" if self.touches else ""
        return f"{which}t = {self.t:.4g} of {self.duration:g} s, {100 * self.fraction:.0f} % done{contact}{left}"


Listener = Callable[[Progress], None]


def listener_of(progress: bool | Listener) -> Listener | None:
    """The listener that a caller asks for; True: a bar in a notebook, elsewhere one line on the error stream."""
    if progress is not True:
        return progress or None
    return (notebook_bar() if in_notebook() else None) or StatusLine()


def announce_compiling(listener: Listener | None, kernels: Sequence[str]) -> None:
    """Say that kernels, as file.function, must be compiled first, if so: nothing else is heard for as long as it takes.

    A listener of the caller's own is called with steps alone.
    """
    if isinstance(listener, StatusLine | NotebookBar) and not is_warm(kernels):
        listener.say(COMPILING)


def cost_of(resolution: Resolution, result: Resolution) -> float:
    """Cost of a pass over that of the result: by steps, and half by cells, the other half being the same for all."""
    return result.step / resolution.step * 0.5 * (1.0 + resolution.fineness / result.fineness)


class ProgressReporter:
    """Tells a listener of the steps of all passes, about ten times a second; a context manager that closes it."""

    def __init__(self, listener: Listener | None, duration: float) -> None:
        self._listener, self._duration = listener, duration
        self.heard = listener is not None
        self._expected: list[tuple[str, float]] = []  # name and cost of passes to come
        self._result: Resolution | None = None  # whose cost is 1
        self._name, self._run, self._begun = RESULT, 0, 0  # the present pass, its number, and passes that have begun
        self._owner, self._lock = threading.get_ident(), threading.Lock()
        self._beside: dict[int, tuple[float, float]] = {}  # last passes of other threads: cost, and how much is done
        self._where: tuple[float, int, int, tuple[Zone, ...], bool] = (0.0, 0, 0, (), False)  # in the present pass
        self._done, self._cost = 0.0, 0.0  # of passes that have ended, of the present one
        self._begin: float | None = None  # s of the clock, at the first report
        self._last = -REPORT_EVERY  # s of wall time, of the last report
        self._past: deque[tuple[float, float]] = deque(maxlen=REMEMBERED)  # wall time and fraction of reports

    def __enter__(self) -> ProgressReporter:
        return self

    def __exit__(self, *_: object) -> None:
        close = getattr(self._listener, "close", None)
        if close is not None:
            close()

    def expect(self, passes: Sequence[tuple[str, Resolution]], result: Resolution) -> None:
        """The passes to come, in their order, by name and resolution; the cost of the result is the unit."""
        self._result = result
        self._expected = [(name, cost_of(resolution, result)) for name, resolution in passes]

    def begin_anew(self) -> None:
        """What was computed so far is of no use, and all passes begin again."""
        with self._lock:
            self._expected, self._beside, self._run, self._begun = [], {}, 0, 0
            self._done = self._cost = 0.0
        self._past.clear()

    def begin(self, name: str, resolution: Resolution) -> None:
        """A pass begins; those expected before it that did not take place are dropped."""
        cost, here = cost_of(resolution, self._result or resolution), threading.get_ident()
        with self._lock:
            names = [expected for expected, _ in self._expected]
            if name in names:
                del self._expected[: names.index(name) + 1]
            self._begun += 1
            if here != self._owner:
                self._done += self._beside.get(here, (0.0, 0.0))[0]
                self._beside[here] = cost, 0.0
                return
            if name != ESTIMATION:  # those in other threads have ended
                self._done += sum(whole for whole, _ in self._beside.values())
                self._beside.clear()
            self._done, self._cost = self._done + self._cost, cost
            self._name, self._run, self._where = name, self._begun, (0.0, 0, 0, (), False)

    def __call__(
        self,
        t: float,
        step: int,
        iterations: int,
        zones: tuple[Zone, ...],
        finished: bool = False,
        touches: bool = False,
    ) -> None:
        """A step has ended at t (s); finished: the last of its pass; touches: as of `Progress`."""
        if self._listener is None:
            return
        here = threading.get_ident()
        if here == self._owner:
            self._where = t, step, iterations, zones, touches
            self._report(finished)
        else:
            with self._lock:
                cost = self._beside[here][0]
                self._beside[here] = cost, cost if finished else cost * t / self._duration

    def end_pass(self) -> None:
        """The present pass has ended, and others, in other threads, go on."""
        if self._listener is not None:
            self._report(False)

    def _report(self, finished: bool) -> None:
        """Tell the listener where the present pass is, if it is time to."""
        assert self._listener is not None
        now = clock.perf_counter()
        self._begin = now if self._begin is None else self._begin
        wall = now - self._begin
        if not finished and wall - self._last < REPORT_EVERY:
            return
        self._last = wall
        t, step, iterations, zones, touches = self._where
        with self._lock:
            costs, parts = (sum(x) for x in zip((0.0, 0.0), *self._beside.values(), strict=True))
            total = self._done + self._cost + costs + sum(cost for _, cost in self._expected)
            fraction = min((self._done + parts + self._cost * t / self._duration) / total, 1.0)
            runs = self._begun + len(self._expected)
        if self._past and fraction < self._past[-1][1]:
            self._past.clear()
        self._past.append((wall, fraction))
        before, earlier = self._past[0]
        rate = (fraction - earlier) / (wall - before) if wall > before else 0.0
        left = (1.0 - fraction) / rate if rate > 0.0 else None
        self._listener(
            Progress(
                t, self._duration, step, iterations, zones, wall, self._run, runs, self._name, fraction, left, touches
            )
        )


class StatusLine:
    """A line that is written over itself, on the error stream: what `progress=True` shows."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream, self._width = stream or sys.stderr, 0

    def __call__(self, progress: Progress) -> None:
        text = progress.text
        self._stream.write("\r" + text.ljust(self._width))
        self._stream.flush()
        self._width = len(text)

    def say(self, text: str) -> None:
        """A line of its own."""
        self.close()
        self._stream.write(text + "\n")
        self._stream.flush()

    def close(self) -> None:
        """End the line, if one was begun."""
        if self._width:
            self._stream.write("\n")
            self._width = 0


# Ctrl-C and SIGTERM as a flag that is looked at where work can stop.

# s between two signals of which the second ends a run at once: process managers may send the same one twice.
IMPATIENT = 1.0

_AT_ONCE = [0]  # how many sections are entered in which a signal is raised when it comes


@contextmanager
def interrupts() -> Iterator[Callable[[], bool]]:
    """Catch Ctrl-C and SIGTERM as a flag, which is yielded.

    A run then ends between two steps and its file is complete, and a study ends between two runs with its table
    written.  May be nested: the inner one gets a signal first.

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


# Progress of a run as a bar in a notebook (ipywidgets, the extra `notebook`); without it there is a line of text.

WITHOUT = f"progress as text; a bar in the notebook needs: {command_for('notebook')}"


def in_notebook() -> bool:
    """Whether the code runs in a kernel of Jupyter; IPython is not imported to find out."""
    ipython = sys.modules.get("IPython")
    return ipython is not None and getattr(ipython.get_ipython(), "kernel", None) is not None


def notebook_bar() -> NotebookBar | None:
    """A bar that is displayed at the first report; None, with a word on the error stream, without ipywidgets."""
    try:
        import ipywidgets
    except ImportError:
        sys.stderr.write(WITHOUT + "\n")
        return None
    return NotebookBar(ipywidgets)


class NotebookBar:
    """A bar with a line of text, in the cell that runs; it stays, with where the run ended."""

    def __init__(self, widgets: Any) -> None:
        self._bar = widgets.FloatProgress(value=0.0, min=0.0, max=1.0, layout=widgets.Layout(width="240px"))
        self._text = widgets.Label(value="")
        self._box = widgets.HBox([self._bar, self._text])
        self._shown = False

    def __call__(self, progress: Progress) -> None:
        self._show()
        self._bar.value, self._text.value = progress.fraction, progress.text

    def say(self, text: str) -> None:
        """A text beside the bar, until the first report."""
        self._show()
        self._text.value = text

    def _show(self) -> None:
        if not self._shown:
            from IPython.display import display

            display(self._box)
            self._shown = True

    def close(self) -> None:
        """Mark a bar that did not reach its end."""
        if self._shown and self._bar.value < 1.0:
            self._bar.bar_style = "warning"
