"""What commands print: results, notes, errors and progress, for people or as JSON.

The line of progress tells which pass, how far, how fast, how long still, and is drawn over itself on a terminal.  Where
the error stream is no terminal it is a line of its own every few seconds.  It is written to the error stream, so
that the output stays free for results.
"""

from __future__ import annotations

import io
import json
import math
import os
import shutil
import stat
import sys
import time as clock
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import cached_property
from itertools import zip_longest
from math import ceil, floor, log10
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import hybrid
from hybrid.errors import EXPECTED, ComputationError, SceneError, is_of_the_run, weight_of_event

if TYPE_CHECKING:
    from rich.console import Console as RichConsole
    from rich.text import Text

    from hybrid.model.mesh import Zone
    from hybrid.scene.root import Scene
    from hybrid.simulation.progress import Progress
    from hybrid.store.records import Event
    from hybrid.studies.runs import StudyProgress
    from hybrid.studies.study import StudyRunning

REMEMBERED = (
    50  # reports (about 5 s) that the speed shown is taken from: the compilation of the first step is not in it
)
LINE_EVERY = 5.0  # s of wall time between two lines where there is no terminal: a long run must not fill a log
BAR = (4, 36)  # columns, least and most: less shows nothing, more pushes the numbers apart
MARGIN = 3  # columns left free: the terminal writes ^C there, and wraps what does not fit


def span(seconds: float) -> str:
    """A time as people say it: "0.52 s", "12 s", "4 min 05 s", "3 h 20 min"."""
    if seconds < 99.5:
        return f"{seconds:.2g} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02d} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60:02d} min"


def counted(n: int, what: str) -> str:
    """A number of things: "1 line", "3 lines"."""
    return f"{n} {what}{'s' * (n != 1)}"


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


class ProgressLine:
    """Draws one line over itself on a terminal or in a notebook, gone when all passes are done.

    Elsewhere a line now and then.
    """

    def __init__(self, console: RichConsole | None = None) -> None:
        from rich.console import Console as RichConsole

        self._console = console or RichConsole(stderr=True, highlight=False)
        self._past: deque[tuple[float, float]] = deque(maxlen=REMEMBERED)  # wall time and t of this pass
        self._run = 0
        self._told = 0.0  # s of wall time, of the last line of its own
        self._drawn = False
        self._display: Any = None

    def __call__(self, progress: Progress) -> None:
        if progress.run != self._run:  # another pass has begun
            self._past.clear()
            self._run = progress.run
        self._past.append((progress.wall, progress.t))
        if progress.t >= progress.duration and progress.run >= progress.runs:
            self.close()
        elif self._console.is_jupyter:
            self._show(self.text(progress, 100).plain)
        elif self._console.is_terminal and not self._console.is_dumb_terminal:
            self._draw(self.text(progress, self._console.width - MARGIN))
        elif progress.wall - self._told >= LINE_EVERY:
            self._told = progress.wall
            self._console.print(progress.text, soft_wrap=True)

    def close(self) -> None:
        """Take the line away; a second call does nothing."""
        if self._display is not None:
            self._show("")
        elif self._drawn:
            from rich.control import Control
            from rich.segment import ControlType

            self._console.control(Control(ControlType.CARRIAGE_RETURN, (ControlType.ERASE_IN_LINE, 2)))
        self._drawn = False

    def text(self, progress: Progress, width: int) -> Text:
        """The line for a screen of `width` columns: as many facts as fit, and a bar in what is left."""
        from rich.text import Text

        for facts in self._choices(progress):
            room = width - sum(2 + len(fact) for fact in facts)
            if room >= BAR[0]:
                break
        size = max(0, min(room, BAR[1]))
        done = int(progress.fraction * size + 0.5)
        line = Text(no_wrap=True, end="")
        full, empty = ("#", "-") if self._console.options.ascii_only else ("━", "─")
        line.append(full * done, style="cyan").append(empty * (size - done), style="bright_black")
        line.append("  " if size else "").append(facts[0], style="bold")
        for fact in facts[1:]:
            line.append(f"  {fact}")
        line.truncate(width)
        return line

    def _choices(self, p: Progress) -> Iterator[list[str]]:
        """The facts to print, from many to few.  Numbers keep their width, so that the line does not dance."""
        places = min(6, max(0, 3 - floor(log10(p.duration))))
        widest = len(f"{p.duration:.{places}f}")
        time = f"{p.t:{widest}.{places}f} / {p.duration:.8g} s"
        step, rate, left = f"step {p.step:<5d}", self._speed(p), _left(p.seconds_left)
        which = [f"run {p.run} of {p.runs}: {p.name}"] if p.runs > 1 else []
        touches = ["contact"] if p.touches else []
        for zones, newton, real in (
            (40, " Newton", " x real time"),
            (18, " Newton", " x real time"),
            (18, " it", " x"),
        ):
            kinds = zones_in_short(p.zones, zones)
            yield [*which, time, *touches, step, f"{p.iterations:2d}{newton}", kinds, rate + real, left]
        yield [*which, time, *touches, step, rate + " x", left]
        yield [*which, time, left]
        yield [time, left]
        yield [time]

    def _speed(self, p: Progress) -> str:
        """Speed of this pass, times real time; "..." until it is known."""
        wall, t = self._past[0]
        return f"{speed((p.t - t) / (p.wall - wall)):>4}" if p.wall > wall and p.t > t else " ..."

    def _draw(self, text: Text) -> None:
        """The new line over the old one in a single write: what does not change does not flicker."""
        from rich.control import Control
        from rich.segment import ControlType

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


def _left(seconds: float | None) -> str:
    """Wall time that all passes still take, h:mm:ss."""
    if seconds is None:
        return "  ... left"
    minutes, rest = divmod(ceil(seconds), 60)
    left = f"{minutes}:{rest:02d}" if minutes < 60 else f"{minutes // 60}:{minutes % 60:02d}:{rest:02d}"
    return f"{left:>5} left"


JSON_EVERY = 1.0  # s of wall time between two progress lines for programs: a long run must not fill a log
BAR_EVERY = 0.5  # s of wall time between two drawings of the bar of a study: below 1 % of what its runs cost
AT_ONCE = 1.0  # s of wall time: a run that is over by then shows no line, and does without rich
COLOURED = {"FORCE_COLOR", "TTY_COMPATIBLE"}  # of the environment: colours in files and pipes too
KINDS_SHOWN = 3  # kinds of events named at the end of a run; the report has them all


def _finite(facts: Any) -> Any:
    """The same with None for numbers that are not finite."""
    if isinstance(facts, dict):
        return {name: _finite(x) for name, x in facts.items()}
    if isinstance(facts, list | tuple):
        return [_finite(x) for x in facts]
    return None if isinstance(facts, float) and not math.isfinite(facts) else facts


class Console:
    """What a command prints: for people, for programs (JSON), or errors only (quiet)."""

    def __init__(self, as_json: bool, quiet: bool) -> None:
        self.as_json, self.quiet = as_json, quiet
        self.source = ""  # the scene file, for complaints that do not know it
        self.settings: list[str] = []  # what the command changes in it
        self.left = ""  # what Ctrl-C leaves behind, of commands that write more than a file
        self._file: Path | None = None
        self._before: tuple[int, int] | None = None

    @cached_property
    def _out(self) -> RichConsole:
        from rich.console import Console as RichConsole

        return RichConsole(highlight=False, markup=False, emoji=False, width=_width(sys.stdout))

    @cached_property
    def _err(self) -> RichConsole:
        from rich.console import Console as RichConsole

        return RichConsole(stderr=True, highlight=False, markup=False, emoji=False, width=_width(sys.stderr))

    def json(self, event: str, **facts: Any) -> None:
        """A line for programs; nothing for people.  A number that is not finite is null: JSON has none."""
        if not self.as_json:
            return
        sys.stdout.write(json.dumps({"event": event} | _finite(facts), default=str, allow_nan=False) + "\n")
        sys.stdout.flush()
        if event == "progress" and (stream := _output_stream()) is not None and stream.dropped:
            raise KeyboardInterrupt  # nobody follows the run: end it as by Ctrl-C

    def note(self, text: str) -> None:
        if not (self.quiet or self.as_json):
            self._print_error(text, "yellow", wrap=True)

    def compiling(self, scene: Scene, static: bool = False) -> bool:
        """Whether kernels of a scene have to be compiled first, which takes long; if so, say it beforehand.

        static: for its equilibrium alone, whose stability is judged.
        """
        from hybrid.kernels.machine.compile import is_warm
        from hybrid.simulation.first_use import kernels_of
        from hybrid.simulation.progress import COMPILING

        if is_warm(kernels_of(scene, static)):
            return False
        self.json("compiling")
        self.note(COMPILING)
        return True

    def show(self, content: Callable[[], Any]) -> None:
        """Something for people; made only if it is shown."""
        if not (self.quiet or self.as_json):
            made = content()
            columns = min(80, shutil.get_terminal_size().columns)
            text = made.text() if isinstance(made, Grid) else made
            if isinstance(text, str) and all(len(x) <= columns and x.isprintable() for x in text.splitlines()):
                sys.stdout.write(f"{text}\n")  # rich, which takes long to import, has nothing to do
            else:
                self._out.print(Trimmed(made.table() if isinstance(made, Grid) else made))

    def _print_error(self, text: str, style: str, wrap: bool = False) -> None:
        """A line of the error stream; in colour, and wrapped between words, where somebody reads it."""
        if sys.stderr.isatty() or COLOURED & set(os.environ):
            self._err.print(text, style=style, soft_wrap=not (wrap and self._err.is_terminal))
        else:
            sys.stderr.write(f"{text}\n")

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
        """What `hybrid.run` calls while it runs: a progress line, JSON lines, or nothing."""
        line, begin = None, clock.perf_counter()

        def show(progress: Progress) -> None:
            nonlocal line
            if line is None and clock.perf_counter() - begin > AT_ONCE:
                line = ProgressLine(self._err)
            if line is not None:
                line(progress)

        try:
            yield False if self.quiet else self._json_progress() if self.as_json else show
        finally:
            if line is not None:
                line.close()

    @contextmanager
    def study(self) -> Iterator[Callable[[StudyProgress], None] | None]:
        """What `hybrid.trade` calls: a bar over all runs, JSON lines, or nothing."""
        if self.quiet or self.as_json:
            yield None if self.quiet else self._json_study()
            return
        with self._bar(auto_refresh=False) as bar:  # no thread draws it: what is timed would pay for that
            task, last = bar.add_task(""), -BAR_EVERY

            def show(run: StudyProgress) -> None:
                nonlocal last
                now = clock.monotonic()
                if now - last < BAR_EVERY and 0.0 < run.part < 1.0:
                    return
                last = now
                what = run.what + (f", {run.part:.0%}" if run.part else "")
                bar.update(task, total=run.total, completed=run.done, description=what, refresh=True)

            yield show

    @contextmanager
    def study_running(self) -> Iterator[Callable[[StudyRunning], None] | None]:
        """What `hybrid.study` calls: a bar over all cases with failures, time left and dask's dashboard; JSON lines."""
        if self.quiet or self.as_json:
            yield None if self.quiet else lambda now: self.json("progress", **asdict(now), left=now.left)
            return
        shown = self._err.is_terminal  # elsewhere an empty line would be left of it
        with self._bar(disable=not shown) as bar:
            task, begun, told = bar.add_task("starting workers"), [-1, 0.0], [0.0]

            def show(now: StudyRunning) -> None:
                ended = now.done + now.failed
                if begun[0] < 0:  # what an earlier call has done says nothing of the pace
                    begun[:] = [ended, now.elapsed]
                pace = (now.elapsed - begun[1]) / (ended - begun[0]) if ended > begun[0] else None
                parts = [f"{now.failed} failed"] if now.failed else []
                parts += [f"{span(pace * now.left)} left"] if pace is not None else []
                parts += [now.dashboard] if now.dashboard else []
                bar.update(task, total=now.total, completed=ended, description=", ".join(parts))
                if not shown and now.elapsed - told[0] >= LINE_EVERY:
                    told[0] = now.elapsed
                    self._err.print(", ".join([f"{ended} of {now.total} cases", *parts]), soft_wrap=True)

            yield show

    def _bar(self, **how: Any) -> Any:
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

        columns = BarColumn(24), MofNCompleteColumn(), TextColumn("{task.description}", markup=False)
        return Progress(*columns, TimeElapsedColumn(), console=self._err, transient=True, **how)

    def _json_study(self) -> Callable[[StudyProgress], None]:
        last = ""

        def show(run: StudyProgress) -> None:
            nonlocal last
            if run.what != last:
                last = run.what
                self.json("progress", done=run.done, total=run.total, what=run.what)

        return show

    def _json_progress(self) -> Callable[[Progress], None]:
        last = -JSON_EVERY

        def show(progress: Progress) -> None:
            nonlocal last
            if progress.wall - last >= JSON_EVERY or progress.t >= progress.duration:
                last = progress.wall
                self.json("progress", **asdict(progress))

        return show

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
            when = "" if is_of_the_run(found[0].kind, found[0].t) else f"t = {found[0].t:.4g} s: "
            self.note(f"note: {when}{found[0].text}{more}")
        rest = [found[0].kind for found in news[KINDS_SHOWN:]]
        if rest:
            self.note(f"note: and {len(rest)} more: {', '.join(rest)}; see the events of the result")

    def done(self, text: str, *files: Path | None, **facts: Any) -> None:
        """The closing line."""
        names = [str(file) for file in files if file is not None]
        self.json("done", file=names[0], files=names, **facts)
        if not (self.quiet or self.as_json):
            sys.stdout.write(f"{text} -> {' and '.join(', '.join(names).rsplit(', ', 1))}\n")

    def interrupted(self) -> None:
        """What the file holds after Ctrl-C."""
        t, pending, text = None, "", self.left or "no result yet: nothing was written"
        if self.written:
            with hybrid.open(self.written) as result:
                t = float(result.times[-1]) if len(result.times) else None
                pending = result.pending
            text = f"{self.written} " + ("holds no output yet" if t is None else f"is complete up to t = {t:.6g} s")
            if pending:
                text += f"; {pending.replace(f'resume {self.written.name}', f'resume {self.written}')}"
            elif t is not None:
                text += f"; `hybrid resume {self.written}` goes on"
        self.json("done", file=self.written, status="interrupted", t=t, pending=pending)
        self._print_error(f"interrupted; {text}", "yellow")

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
            self._print_error(line, "" if line.startswith(" ") else "bold red", wrap=True)


def _width(stream: TextIO) -> int | None:
    """Columns to write for a file or a pipe, where nobody's window ends; None: those of the terminal."""
    return None if stream.isatty() or "COLUMNS" in os.environ else 200


def _stamp(file: Path) -> tuple[int, int] | None:
    """What changes when a file is written; None of a folder, which others change, and of no file."""
    try:
        found = file.stat()
    except OSError:
        return None
    return None if stat.S_ISDIR(found.st_mode) else (found.st_ino, found.st_mtime_ns)


# Rows of a few words in columns: as text where they fit, by rich where they have to be wrapped.

BETWEEN = 2  # blanks between columns
Words = Sequence[str]


class Trimmed:
    """What rich prints, without blanks at the ends of lines: rich fills every cell up to the width of its column."""

    def __init__(self, content: Any) -> None:
        self.content = content

    def __rich_console__(self, console: Any, options: Any) -> Iterator[Any]:
        from rich.segment import Segment

        for line in console.render_lines(self.content, options, pad=False):
            while line and not line[-1].text.strip():
                line.pop()
            if line:
                line[-1] = Segment(line[-1].text.rstrip(), line[-1].style)
            yield from (*line, Segment.line())


@dataclass(frozen=True)
class Grid:
    """Rows, whose cells may have several lines, and a line below them."""

    rows: Sequence[Sequence[str]]
    below: str = ""

    def text(self) -> str:
        lines = [line for row in self.rows for line in zip_longest(*(x.split("\n") for x in row), fillvalue="")]
        widths = [max(map(len, column)) for column in zip_longest(*lines, fillvalue="")]
        out = [(" " * BETWEEN).join(map(str.ljust, line, widths)).rstrip() for line in lines]
        return "\n".join([*out, *([self.below] if self.below else [])])

    def table(self) -> Any:
        """For rich."""
        from rich.console import Group
        from rich.table import Table

        table = Table.grid(padding=(0, BETWEEN))
        for row in self.rows:
            table.add_row(*row)
        return Group(table, *([self.below] if self.below else []))


def table_of(heads: Words, rows: Iterable[Words], words: Words = ("",), free: Words = (), **how: Any) -> Any:
    """A table for rich without lines.

    words: heads of columns that are no numbers, which stand on the right; free: of those that may be wrapped; how: as
    rich has it.
    """
    from rich.table import Table

    titled = {"title_justify": "left", "padding": (0, 2)} if "title" in how else {"pad_edge": False}
    table = Table(box=None, **{**titled, "header_style": "bold", **how})
    for head in heads:
        how_wide: Any = {"overflow": "fold" if head in words else "ellipsis"} if head in free else {"no_wrap": True}
        table.add_column(head, justify="left" if head in words else "right", **how_wide)
    for row in rows:
        table.add_row(*row)
    return table


# The output and error streams where they are no terminal, as in `hybrid schema | head`, `hybrid schema > file`.

OUTPUT = "the output"  # name of the stream, for messages


class _Stream(io.FileIO):
    """A stream to a pipe or file: what cannot be written is dropped, and a computation goes on.

    What nobody reads any more, as behind `| head`, is no error; that a disk is full is one, at the end of the command.
    """

    dropped = False  # as nobody reads it
    error: OSError | None = None

    def write(self, data: Any) -> int:
        try:
            return super().write(data) or 0
        except OSError as error:
            self.dropped = isinstance(error, BrokenPipeError)
            self.error = None if self.dropped else OSError(error.errno, error.strerror, OUTPUT)
            os.dup2(os.open(os.devnull, os.O_WRONLY), self.fileno())
            return memoryview(data).nbytes


def guard_output() -> None:
    """Let a reader that has gone end no command, cause no error message and change no exit code."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        try:
            piped = not os.isatty(stream.fileno())
        except (OSError, ValueError, AttributeError):  # a stream without a file, as in tests; none under pythonw
            continue
        if piped and isinstance(stream, io.TextIOWrapper):
            raw = _Stream(stream.fileno(), "w", closefd=False)
            to = io.BufferedWriter(raw)
            setattr(
                sys, name, io.TextIOWrapper(to, stream.encoding, stream.errors, line_buffering=stream.line_buffering)
            )


def raise_lost_output() -> None:
    """Raise, once, that output could not be written."""
    sys.stdout.flush()
    stream = _output_stream()
    if stream is not None and (error := stream.error) is not None:
        stream.error = None
        raise error


def _output_stream() -> _Stream | None:
    raw = getattr(getattr(sys.stdout, "buffer", None), "raw", None)
    return raw if isinstance(raw, _Stream) else None
