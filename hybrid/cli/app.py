"""The command line application: options that commands share, and the session that turns errors into exit codes."""

from __future__ import annotations

import errno
import os
import signal
import threading
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TextIO

import typer
import typer.core

import hybrid
from hybrid.cli.console import OUTPUT, Console, raise_lost_output
from hybrid.errors import ComputationError, ResultError, ResultHeld, SceneError

if TYPE_CHECKING:
    from hybrid.scene.root import Scene
    from hybrid.store.reader import Result

# Exit codes.
REFUSED = 1  # the input was refused
FAILED = 2  # a computation failed
INTERRUPTED = 130  # 128 + SIGINT
_ELSEWHERE = "a folder you may write to, with free space"
# What a disk says of a file, and what to try: no bug, wherever it is raised.
DISK_ERRORS = {
    errno.ENAMETOOLONG: "a shorter name",
    errno.EACCES: "a file that you may read, or a folder you may write to",
    errno.EPERM: _ELSEWHERE,
    errno.EROFS: _ELSEWHERE,
    errno.ENOSPC: _ELSEWHERE,
    errno.EDQUOT: _ELSEWHERE,
    errno.ELOOP: "a file that is no link to itself",
}


LOOP = "Symlink loop from"  # how Path.resolve begins to say so
LESS = "fewer cells (mesh), fewer output.points, a larger output.every"


# In the help commands stand as they are needed: a scene, its result, what else it may be asked, and other programs.
ORDER = "run resume static plan view plot report export stats modes response seek sensitivity design study trade"
ORDER += " import schema"


class _Commands(typer.core.TyperGroup):
    """Help as plain text: the boxes of rich take half of its time."""

    def list_commands(self, context: Any) -> list[str]:
        return sorted(self.commands, key=ORDER.split().index)

    def format_commands(self, context: Any, formatter: Any) -> None:
        """Each command with the whole first sentence of its help."""
        with formatter.section("Commands"):
            formatter.write_dl(
                [(x, self.commands[x].get_short_help_str(limit=1000)) for x in self.list_commands(context)]
            )


app = typer.Typer(
    cls=_Commands,
    rich_markup_mode=None,
    help="Dynamics of long cables: flexible catenaries where they are taut, rods where they bend.",
    epilog="Exit codes: 0 done, 1 input refused, 2 computation failed, 130 interrupted.",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
UsageError: Any = typer.BadParameter.__mro__[1]  # typer has no public name for it


def numbers(text: str) -> list[float]:
    try:
        return [float(x) for x in text.split(",")]
    except ValueError:
        raise typer.BadParameter(f"'{text}' is no list of numbers such as 0,1.5,2") from None


def words(text: str) -> list[str]:
    return [word.strip() for word in text.split(",") if word.strip()]


def window(text: str) -> tuple[float | None, float | None]:
    first, colon, last = text.partition(":")
    try:
        window = (float(first) if first.strip() else None, float(last) if last.strip() else None)
    except ValueError:
        colon = ""
    if not colon:
        raise typer.BadParameter(f"'{text}' is no window of time such as 20:60, 20: or :60")
    return window


def option(metavar: str, help: str, *names: str, **how: Any) -> Any:
    """An option of a command that takes a value; its name is that of its parameter unless names are given."""
    return typer.Option(*names, metavar=metavar, help=help, **how)


def argument(metavar: str, help: str) -> Any:
    """What a command needs, in its place."""
    return typer.Argument(metavar=metavar, help=help, show_default=False)


def flag(*names: str, help: str) -> Any:
    return typer.Option(*names, metavar="", help=help)  # it takes no value, so none is named


def plot_option(what: str) -> Any:
    return typer.Option("--plot", metavar="FILE", help=f"Draw {what} into a PNG, PDF or SVG.")


def output_option(help: str, metavar: str = "FILE") -> Any:
    return typer.Option("--output", "-o", metavar=metavar, help=help)


SceneFile = Annotated[Path, argument("SCENE.yaml", "The scene to read.")]
RunFile = Annotated[Path | None, output_option("Result; else SCENE.h5, in this folder.")]
StaticFile = Annotated[Path | None, output_option("Result; else SCENE.static.h5, here.")]
Picture = Annotated[Path | None, output_option("PNG, PDF or SVG; else RUN.png, RUN.zones.png.")]
LineName = Annotated[str | None, option("NAME", "Of several lines, this one.", "--line")]
Settings = Annotated[list[str] | None, option("KEY=VALUE", "Change a value, as in time.step=0.005.", "--set")]
Drawn = Annotated[bool, flag("--plot", help="Draw it as well, as PNG beside it.")]
Keep = Annotated[bool, flag("--no-overwrite", help="Refuse to replace an older result.")]
Foreign = Annotated[bool, flag("--overwrite", help="Replace a file that is not of hybrid.")]
Quiet = Annotated[bool, flag("--quiet", "-q", help="Print nothing but errors.")]
Json = Annotated[bool, flag("--json", help="Print JSON, one object per line.")]


@app.callback(invoke_without_command=True)
def hybrid_(
    context: typer.Context, version: Annotated[bool, flag("--version", help="Print the version.")] = False
) -> None:
    if version:
        from hybrid.kernels.machine.cache import code_in_use

        print(f"hybrid {hybrid.__version__}\nmachine code: {code_in_use()}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        print(context.get_help())


@contextmanager
def session(as_json: bool, quiet: bool) -> Iterator[Console]:
    """The console of one command; errors become words and exit codes."""
    console, code = Console(as_json, quiet), 0
    with _stops() as heard, _cache_warnings(console):
        try:
            yield console
            raise_lost_output()
        except typer.Exit:
            raise
        except (Exception, KeyboardInterrupt) as error:
            # Where a stop comes while modules are imported or compiled, it can end as any exception.
            stopped = bool(heard) or isinstance(error, KeyboardInterrupt)
            code = INTERRUPTED if stopped else report_error(console, error)
            if stopped:
                console.interrupted()
    if code:
        raise typer.Exit(code)


@contextmanager
def _cache_warnings(console: Console) -> Iterator[None]:
    """Warnings of the cache of machine code as notes of one line; others as ever."""
    as_ever = warnings.showwarning

    def show(
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        if category.__name__ != "CacheWarning":  # its module imports what not every command needs
            as_ever(message, category, filename, lineno, file, line)
            return
        console.json("note", text=str(message))
        console.note(f"note: {message}")

    warnings.showwarning = show
    try:
        yield
    finally:
        warnings.showwarning = as_ever


@contextmanager
def _stops() -> Iterator[list[int]]:
    """Raise KeyboardInterrupt by Ctrl-C and SIGTERM; gives the signals that came.  An ignored Ctrl-C stays ignored."""
    heard: list[int] = []

    def stop(number: int, _frame: object) -> None:
        heard.append(number)
        raise KeyboardInterrupt

    numbers = [signal.SIGTERM] if signal.getsignal(signal.SIGINT) is signal.SIG_IGN else [signal.SIGINT, signal.SIGTERM]
    in_main = threading.current_thread() is threading.main_thread()
    before = {number: signal.signal(number, stop) for number in numbers} if in_main else {}
    try:
        yield heard
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _ran_out(error: BaseException) -> bool:
    """Whether memory ran out: in an error, or in one on the way of which it came."""
    seen: BaseException | None = error
    while seen is not None:
        if isinstance(seen, MemoryError):
            return True
        seen = seen.__cause__ or seen.__context__
    return False


def report_error(console: Console, error: BaseException) -> int:
    """Say what went wrong; gives the exit code."""
    match error:
        case SceneError():
            from hybrid.scene.read import located

            console.refused(located(error, console.source, console.settings) if console.source else error)
            return REFUSED
        case ComputationError():
            console.failed(error)
            return FAILED
        case ResultHeld():
            console.error("result", str(error))
            return REFUSED
        case ResultError():
            console.error("result", str(error), file=console.written)
            return FAILED if console.written else REFUSED
        case OSError() if error.errno in DISK_ERRORS and error.filename:
            name = os.fspath(error.filename)
            name = name if len(name) <= 200 else f"{name[:100]} ... {name[-40:]}"
            kept = f"; the result is kept in {console.written}" if name == OUTPUT and console.written else ""
            console.error("result", f"{name}: {error.strerror}{kept}\n    try:      {DISK_ERRORS[error.errno]}")
            return FAILED if console.written or name == OUTPUT else REFUSED
        case RuntimeError() if str(error).startswith(LOOP):  # of Path.resolve
            name = str(error).removeprefix(LOOP).strip(" '")
            console.error("result", f"{name}: {os.strerror(errno.ELOOP)}\n    try:      {DISK_ERRORS[errno.ELOOP]}")
            return REFUSED
        case _ if _ran_out(error):
            console.error("memory", f"not enough memory\n    try:      {LESS}", file=console.written)
            return FAILED
    head = f"this is a bug in hybrid {hybrid.__version__}; please report it with the scene and these lines"
    console.error("bug", f"{head}\n{''.join(traceback.format_exception(error))}")
    return FAILED


def load(console: Console, path: Path, settings: list[str] | None) -> Scene:
    """The scene of a command; keys with a former name are noted."""
    from hybrid.scene.read import read_scene

    console.source, console.settings = str(path), settings or []
    scene, renamed = read_scene(path, console.settings)
    for key in renamed:
        console.json("note", text=str(key), **vars(key))
        console.note(f"note: {key}")
    return scene


@contextmanager
def opened_line(result: Path, line: str | None) -> Iterator[tuple[Result, Path]]:
    """A result, of several lines the one named or all, and the name of its file, by which others are called."""
    with hybrid.open(result) as whole:
        names = list(whole.lines)
        if line is None:
            yield whole, result
            return
        if line not in names:
            known = ", ".join(names)
            why = f"holds the lines {known}" if names else "holds one cable, and no lines by name"
            fix = f"--line {names[0]}" if names else "leave --line out"
            raise ResultError(f"{result} {why}\n    given:    --line {line or ''}\n    try:      {fix}")
        with whole.line(line) as one:
            yield one, result.with_name(f"{result.stem}.{line}{result.suffix}")


def picture_beside(target: Path, plot: bool) -> Path | None:
    """Where a picture beside a result goes, checked before the work; None: none is asked for."""
    from hybrid.view.figure import PICTURES, check_target

    return check_target(target.with_suffix(".png"), PICTURES) if plot else None
