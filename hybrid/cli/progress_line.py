"""The line that a run draws over itself on a terminal: which pass, how far, how fast, how long still.

Where the error stream is no terminal it is a line of its own every few seconds.  It is written to the error stream, so
that the output stays free for results.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from math import ceil, floor, log10
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console
    from rich.text import Text

    from hybrid.model.mesh import Zone
    from hybrid.simulation.progress import Progress

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

    def __init__(self, console: Console | None = None) -> None:
        from rich.console import Console

        self._console = console or Console(stderr=True, highlight=False)
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
