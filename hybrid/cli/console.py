"""What is said while something is computed and when it is done: the live line, notes, errors.

`live_line()` gives a function to call with each `Progress`: it draws one line over itself,
on the error stream, so that the output stays free for results.  `Voice` is how the command
line speaks: to people, or to programs in JSON, one object per line.
"""

from __future__ import annotations

import json
import os
import sys
import time as clock
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from functools import cached_property
from math import ceil, floor, log10
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from rich.console import Console
from rich.control import Control
from rich.segment import ControlType
from rich.text import Text

import hybrid
from hybrid.errors import EXPECTED, weight_of_event

if TYPE_CHECKING:
    from hybrid.errors import ComputationError, SceneError
    from hybrid.model.mesh import Zone
    from hybrid.simulation.progress import Progress
    from hybrid.store.reader import Event
    from hybrid.studies.runs import Doing

# The speed shown is that of the last so many reports (about 5 s): the compilation of the
# first step, or a slow stretch long past, says nothing about the time that is left.
REMEMBERED = 50
BAR = (4, 36)  # columns, least and most: less shows nothing, more pushes the numbers apart
MARGIN = 3  # columns left free: the terminal writes ^C there, and wraps what does not fit
JSON_EVERY = 1.0  # s of wall time between two progress lines for programs: a long run must not fill a log
BAR_EVERY = 0.5  # s of wall time between two drawings of the bar of a ladder: below 1 % of what its runs cost
KINDS_SHOWN = 3  # kinds of events named at the end of a run; more is a matter for a report


def span(seconds: float) -> str:
    """A time as people say it: "0.52 s", "12 s", "4 min 05 s", "3 h 20 min"."""
    if seconds < 99.5:
        return f"{seconds:.2g} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02d} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60:02d} min"


def speed(factor: float) -> str:
    """How many times faster than real time: "40", "3.2", "0.041"."""
    return f"{factor:.0f}" if factor >= 10 else f"{factor:.2g}"


def zones_in_short(zones: tuple[Zone, ...], width: int) -> str:
    """ "catenary 1.5 m | rod 0.5 m", or "7 zones, 23 % rod" when that is longer than `width`."""
    if len(zones) == 1:
        return zones[0].kind
    text = " | ".join(f"{z.kind} {z.s_b - z.s_a:.4g} m" for z in zones)
    rod = sum(z.s_b - z.s_a for z in zones if z.kind == "rod") / (zones[-1].s_b - zones[0].s_a)
    return text if len(text) <= width else f"{len(zones)} zones, {100 * rod:.0f} % rod"


def live_line() -> LiveLine:
    """A line for a run; call it with each `hybrid.simulation.progress.Progress`."""
    return LiveLine()


class LiveLine:
    """Draws the line on a terminal or in a notebook, nowhere else; gone when t reaches the duration."""

    def __init__(self, console: Console | None = None) -> None:
        self._console = console or Console(stderr=True, highlight=False)
        self._past: deque[tuple[float, float]] = deque(maxlen=REMEMBERED)
        self._drawn = False
        self._display: Any = None

    def __call__(self, progress: Progress) -> None:
        if self._past and progress.t < self._past[-1][1]:
            self._past.clear()  # another run has begun
        self._past.append((progress.wall, progress.t))
        if progress.t >= progress.duration:
            self.close()
        elif self._console.is_jupyter:
            self._show(self.text(progress, 100).plain)
        elif self._console.is_terminal and not self._console.is_dumb_terminal:
            self._draw(self.text(progress, self._console.width - MARGIN))

    def close(self) -> None:
        """Take the line away; a second call does nothing."""
        if self._display is not None:
            self._show("")
        elif self._drawn:
            self._console.control(Control(ControlType.CARRIAGE_RETURN, (ControlType.ERASE_IN_LINE, 2)))
        self._drawn = False

    def text(self, progress: Progress, width: int) -> Text:
        """The line for a screen of `width` columns: as many facts as fit, and a bar in what is left."""
        for facts in self._choices(progress):
            room = width - sum(2 + len(fact) for fact in facts)
            if room >= BAR[0]:
                break
        size = max(0, min(room, BAR[1]))
        done = int(progress.t / progress.duration * size + 0.5)
        line = Text(no_wrap=True, end="")
        full, empty = ("#", "-") if self._console.options.ascii_only else ("━", "─")
        line.append(full * done, style="cyan").append(empty * (size - done), style="bright_black")
        line.append("  " if size else "").append(facts[0], style="bold")
        for fact in facts[1:]:
            line.append(f"  {fact}")
        line.truncate(width)
        return line

    def _choices(self, p: Progress) -> Iterator[list[str]]:
        """What to say, from much to little.  Numbers keep their width, so that the line does not dance."""
        places = min(6, max(0, 3 - floor(log10(p.duration))))
        widest = len(f"{p.duration:.{places}f}")
        time = f"{p.t:{widest}.{places}f} / {p.duration:.8g} s"
        step, rate, left = f"step {p.step:<5d}", *self._pace(p)
        if p.runs > 1:
            step = f"run {p.run} of {p.runs}: {p.name:<16s}  {step}"
        for zones, newton, real in (
            (40, " Newton", " x real time"),
            (18, " Newton", " x real time"),
            (18, " it", " x"),
        ):
            yield [time, step, f"{p.iterations:2d}{newton}", zones_in_short(p.zones, zones), rate + real, left]
        yield [time, step, rate + " x", left]
        yield [time, left]
        yield [time]

    def _pace(self, p: Progress) -> tuple[str, str]:
        """Speed (times real time) and wall time left (h:mm:ss); "..." until something can be said."""
        wall, t = self._past[0]
        if p.wall <= wall or p.t <= t:
            return " ...", "  ... left"
        factor = (p.t - t) / (p.wall - wall)
        minutes, seconds = divmod(ceil((p.duration - p.t) / factor), 60)
        left = f"{minutes}:{seconds:02d}" if minutes < 60 else f"{minutes // 60}:{minutes % 60:02d}:{seconds:02d}"
        return f"{speed(factor):>4}", f"{left:>5} left"

    def _draw(self, text: Text) -> None:
        """The new line over the old one in a single write: what does not change does not flicker."""
        with self._console:
            self._console.control(Control(ControlType.CARRIAGE_RETURN))
            self._console.print(text, end="", overflow="crop", no_wrap=True)
            self._console.control(Control((ControlType.ERASE_IN_LINE, 0)))
        self._drawn = True

    def _show(self, text: str) -> None:
        from IPython.display import display  # a notebook has it

        if self._display is None:
            self._display = display({"text/plain": text}, raw=True, display_id=True)
        else:
            self._display.update({"text/plain": text}, raw=True)


class Voice:
    """How the command line speaks: to people, to programs (JSON), or only when it must (quiet)."""

    def __init__(self, as_json: bool, quiet: bool) -> None:
        self.as_json, self.quiet = as_json, quiet
        self.source = ""  # the scene file, for complaints that do not know it
        self.settings: list[str] = []  # what the command changes in it
        self.left = ""  # what Ctrl-C leaves, of commands that write more than a file
        self._file: Path | None = None
        self._before: tuple[int, int] | None = None

    @cached_property
    def _out(self) -> Console:
        return Console(highlight=False, markup=False, emoji=False, width=_width(sys.stdout))

    @cached_property
    def _err(self) -> Console:
        return Console(stderr=True, highlight=False, markup=False, emoji=False, width=_width(sys.stderr))

    def json(self, event: str, **facts: Any) -> None:
        """A line for programs; nothing for people."""
        if not self.as_json:
            return
        try:
            sys.stdout.write(json.dumps({"event": event} | facts, default=str) + "\n")
            sys.stdout.flush()
        except BrokenPipeError:  # nobody listens any more: end as if by Ctrl-C, and speak to the wall
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            raise KeyboardInterrupt from None

    def note(self, text: str) -> None:
        if not (self.quiet or self.as_json):
            self._err.print(text, style="yellow", soft_wrap=not self._err.is_terminal)

    def compiling(self, kernels: Sequence[str] = ("newton.advance",)) -> bool:
        """Whether kernels have to be compiled first, which takes long; if so, say it beforehand."""
        from hybrid.kernels.compile import is_warm

        if is_warm(kernels):
            return False
        self.json("compiling")
        self.note("compiling the kernels for this machine (first use only, about half a minute) ...")
        return True

    def show(self, content: Callable[[], Any]) -> None:
        """Something for people; made only if it is shown."""
        if not (self.quiet or self.as_json):
            self._out.print(content())

    def will_write(self, file: Path) -> Path:
        """Remember the file as it is now: only if it changes was it this command that wrote it."""
        self._file, self._before = file, _stamp(file)
        return file

    @property
    def written(self) -> Path | None:
        """The file to be written, once this command has begun to write it."""
        changed = self._file is not None and _stamp(self._file) not in (None, self._before)
        return self._file if changed else None

    @contextmanager
    def progress(self) -> Iterator[Callable[[Progress], None] | bool]:
        """What `hybrid.run` is to call while it runs: a live line, JSON lines, or nothing."""
        line = LiveLine(self._err)
        try:
            yield False if self.quiet else self._json_progress() if self.as_json else line
        finally:
            line.close()

    @contextmanager
    def ladder(self) -> Iterator[Callable[[Doing], None] | None]:
        """What `hybrid.trade` is to call: a bar over all runs, JSON lines, or nothing."""
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

        if self.quiet or self.as_json:
            yield None if self.quiet else self._json_ladder()
            return
        columns = (
            BarColumn(24),
            MofNCompleteColumn(),
            TextColumn("{task.description}", markup=False),
            TimeElapsedColumn(),
        )
        # No thread draws it: what is timed would pay for that.
        with Progress(*columns, console=self._err, transient=True, auto_refresh=False) as bar:
            task, last = bar.add_task(""), -BAR_EVERY

            def tell(doing: Doing) -> None:
                nonlocal last
                now = clock.monotonic()
                if now - last < BAR_EVERY and 0.0 < doing.part < 1.0:
                    return
                last = now
                what = doing.what + (f", {doing.part:.0%}" if doing.part else "")
                bar.update(task, total=doing.total, completed=doing.done, description=what, refresh=True)

            yield tell

    def _json_ladder(self) -> Callable[[Doing], None]:
        last = ""

        def tell(doing: Doing) -> None:
            nonlocal last
            if doing.what != last:
                last = doing.what
                self.json("progress", done=doing.done, total=doing.total, what=doing.what)

        return tell

    def _json_progress(self) -> Callable[[Progress], None]:
        last = -JSON_EVERY

        def tell(progress: Progress) -> None:
            nonlocal last
            if progress.wall - last >= JSON_EVERY or progress.t >= progress.duration:
                last = progress.wall
                self.json("progress", **asdict(progress))

        return tell

    def events(self, events: list[Event]) -> None:
        """The first event of each kind, those that matter most first; changes of zones only in JSON."""
        kinds: dict[str, list[Event]] = {}
        for event in sorted(events, key=lambda e: (weight_of_event(e.kind), e.t)):
            kinds.setdefault(event.kind, []).append(event)
        for found in kinds.values():
            self.json("note", **found[0]._asdict(), count=len(found))
        news = [found for kind, found in kinds.items() if kind not in EXPECTED]
        for found in news[:KINDS_SHOWN]:
            more = f" ({len(found) - 1} more like this)" if len(found) > 1 else ""
            self.note(f"note: t = {found[0].t:.4g} s: {found[0].text}{more}")
        rest = [found[0].kind for found in news[KINDS_SHOWN:]]
        if rest:
            self.note(f"note: and {len(rest)} more: {', '.join(rest)}; see the events of the result")

    def done(self, text: str, *files: Path | None, **facts: Any) -> None:
        """The closing line."""
        names = [str(file) for file in files if file is not None]
        self.json("done", file=names[0], files=names, **facts)
        if not (self.quiet or self.as_json):
            self._out.print(f"{text} -> {_listed(names)}", soft_wrap=True)

    def interrupted(self) -> None:
        """What the file holds after Ctrl-C."""
        t, text = None, self.left or "nothing was written"
        if self.written:
            with hybrid.open(self.written) as result:
                t = float(result.times[-1]) if len(result.times) else None
            text = f"{self.written} " + ("holds no output yet" if t is None else f"is complete up to t = {t:.6g} s")
            if t is not None:
                text += f"; `hybrid resume {self.written}` goes on"
        self.json("done", file=self.written, status="interrupted", t=t)
        self._err.print(f"interrupted; {text}", style="yellow", soft_wrap=True)

    def refused(self, error: SceneError) -> None:
        """Everything that is wrong with the scene."""
        file = error.file or self.source
        complaints = [asdict(c) for c in error.complaints]
        self.error("scene", "\n".join(c.text(file) for c in error.complaints), file=file, complaints=complaints)

    def failed(self, error: ComputationError) -> None:
        """Why the computation stopped, and what is left of it."""
        kept = f"\n    file:     {self.written} holds what was computed until then" if self.written else ""
        facts = {name: getattr(error, name) for name in ("t", "s", "detail", "snapshot")}
        facts |= {"outcome": error.outcome.name, "cause": error.outcome.cause, "remedy": error.outcome.remedy}
        self.error("computation", str(error) + kept, file=self.written, **facts)

    def error(self, kind: str, text: str, **facts: Any) -> None:
        self.json("error", kind=kind, message=text, **facts)
        for line in text.splitlines():
            self._err.print(line, style="" if line.startswith(" ") else "bold red", soft_wrap=not self._err.is_terminal)


def _width(stream: TextIO) -> int | None:
    """Columns to write for a file or a pipe, where nobody's window ends; None: those of the terminal."""
    return None if stream.isatty() or "COLUMNS" in os.environ else 200


def _listed(names: list[str]) -> str:
    return " and ".join(", ".join(names).rsplit(", ", 1))


def _stamp(file: Path) -> tuple[int, int] | None:
    try:
        found = file.stat()
    except OSError:
        return None
    return found.st_ino, found.st_mtime_ns
