"""What the live line says, at every width."""

from __future__ import annotations

import io
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from rich.console import Console

import hybrid
from hybrid.cli import console as commands_console
from hybrid.cli.console import ProgressLine, span, speed, zones_in_short
from hybrid.model.mesh import Zone
from hybrid.simulation.progress import Progress

TWO = (Zone("catenary", 0.0, 1.5), Zone("rod", 1.5, 2.0))
SEVEN = tuple(Zone(("catenary", "rod")[k % 2], 10.0 * k, 10.0 * (k + 1)) for k in range(7))


def progress(t: float, wall: float, zones: tuple[Zone, ...] = TWO, duration: float = 20.0) -> Progress:
    return Progress(t, duration, round(100 * t), 3, zones, wall)


def screen(width: int = 80) -> tuple[ProgressLine, io.StringIO]:
    stream = io.StringIO()
    return ProgressLine(Console(file=stream, force_terminal=True, width=width, color_system=None, _environ={})), stream


def test_zones_in_short() -> None:
    assert zones_in_short((Zone("rod", 0, 5),), 40) == "rod"
    assert zones_in_short(TWO, 40) == "catenary 1.5 m | rod 0.5 m"
    assert zones_in_short(TWO, 18) == "2 zones, 25 % rod"
    assert zones_in_short(SEVEN, 40) == "7 zones, 43 % rod"


def test_contact_of_a_line_with_itself_is_told() -> None:
    line, _ = screen()
    line(progress(0.0, 0.0))
    plain, told = (line.text(replace(progress(1.0, 1.0), touches=on), 100).plain for on in (False, True))
    assert "contact" in told and "contact" not in plain
    assert "contact" in replace(progress(1.0, 1.0), touches=True).text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.0042, "0.0042 s"),
        (0.52, "0.52 s"),
        (12.3, "12 s"),
        (99.6, "1 min 40 s"),
        (245, "4 min 05 s"),
        (12000, "3 h 20 min"),
    ],
)
def test_span(seconds: float, text: str) -> None:
    assert span(seconds) == text


def test_speed() -> None:
    assert [speed(x) for x in (140.4, 40, 3.21, 0.0412)] == ["140", "40", "3.2", "0.041"]


@pytest.mark.parametrize("width", range(5, 160, 5))
def test_the_line_never_wraps(width: int) -> None:
    line, _ = screen()
    for k in range(20):
        line(progress(k, 0.5 * k))
        assert line.text(progress(k, 0.5 * k, SEVEN), width).cell_len <= width


def test_a_wide_screen_shows_everything_and_a_narrow_one_the_essence() -> None:
    line, _ = screen()
    line(progress(2.0, 1.0))
    line(progress(4.0, 1.5))
    wide = line.text(replace(progress(4.0, 1.5), fraction=0.2, seconds_left=3.9), 119).plain
    for words in (" 4.00 / 20 s", "step 400", "3 Newton", "catenary 1.5 m | rod 0.5 m", "4 x real time", "0:04 left"):
        assert words in wide
    narrow = line.text(replace(progress(4.0, 1.5), fraction=0.2, seconds_left=3.9), 79).plain
    for words in (" 4.00 / 20 s", "step 400", "3 it", "2 zones, 25 % rod", "4 x", "0:04 left"):
        assert words in narrow
    assert "4.00 / 20 s" in line.text(progress(4.0, 1.5), 20).plain


def test_the_line_does_not_dance() -> None:
    line, _ = screen()
    widths = set()
    for k in range(1, 199):
        p = progress(0.1 * k, 0.05 * k)
        line(p)
        if k > 1:
            widths.add((line.text(p, 119).cell_len, line.text(p, 119).plain.index("/ 20 s")))
    assert len(widths) == 1


def test_the_first_report_promises_nothing() -> None:
    line, _ = screen()
    line(progress(0.01, 11.0))  # the kernels were compiled in its time
    assert "... left" in line.text(progress(0.01, 11.0), 119).plain


def test_it_draws_on_a_terminal_and_goes_away_at_the_end() -> None:
    line, stream = screen()
    line(progress(1.0, 1.0))
    line(progress(2.0, 2.0))
    assert "\n" not in stream.getvalue() and stream.getvalue().count("\r") == 2
    line(progress(20.0, 3.0))
    assert stream.getvalue().endswith("\r\x1b[2K")
    size = len(stream.getvalue())
    line.close()
    assert len(stream.getvalue()) == size


def test_it_says_nothing_elsewhere(capsys: pytest.CaptureFixture[str]) -> None:
    line = ProgressLine()
    for t in (1.0, 20.0):
        line(progress(t, t))
    assert tuple(capsys.readouterr()) == ("", "")


def test_compilation_is_announced_before_it_happens(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = hybrid.load_scene(Path(hybrid.__file__).parents[1] / "examples" / "02_suspension.yaml")
    monkeypatch.setattr("hybrid.kernels.machine.compile.is_warm", lambda _: False)
    assert commands_console.Console(as_json=False, quiet=False).compiling(scene)
    assert capsys.readouterr().err.startswith("compiling the kernels for this machine (first use only")
    assert commands_console.Console(as_json=True, quiet=False).compiling(scene)
    assert capsys.readouterr().out == '{"event": "compiling"}\n'
    monkeypatch.setattr("hybrid.kernels.machine.compile.is_warm", lambda _: True)
    assert not commands_console.Console(as_json=False, quiet=False).compiling(scene)
    assert tuple(capsys.readouterr()) == ("", "")


def test_a_notebook_sees_one_display_that_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[str] = []

    def display(bundle: dict[str, str], *, raw: bool, display_id: bool = False) -> SimpleNamespace:
        assert raw
        shown.append(bundle["text/plain"])
        return SimpleNamespace(update=display)

    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace())
    monkeypatch.setitem(sys.modules, "IPython.display", SimpleNamespace(display=display))
    line = ProgressLine(Console(file=io.StringIO(), force_jupyter=True))
    for t in (1.0, 2.0, 20.0):
        line(progress(t, t))
    assert "1.00 / 20 s" in shown[0] and "2.00 / 20 s" in shown[1] and shown[2:] == [""]


def test_one_bar_over_all_passes_and_the_pass_is_named() -> None:
    line, stream = screen(140)
    one = replace(progress(20.0, 1.0), run=2, runs=4, name="error estimation", fraction=0.4, seconds_left=61.2)
    line(one)
    assert "\x1b[2K" not in stream.getvalue(), "the line stays until the last pass is done"
    text = line.text(one, 140).plain
    assert "run 2 of 4: error estimation" in text and "1:02 left" in text
    bar = text.split("  ")[0]
    assert bar.count("━") == round(0.4 * len(bar))
    line(replace(progress(20.0, 2.0), run=4, runs=4, name="result", fraction=1.0, seconds_left=0.0))
    assert stream.getvalue().endswith("\x1b[2K")


def test_shells_complete_commands(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """As the script of --install-completion asks; --show-completion would need a shell among the parent processes."""
    from hybrid.cli.commands import main

    request = {"_HYBRID_COMPLETE": "complete_bash", "COMP_WORDS": "hybrid re", "COMP_CWORD": "1"}
    for name, value in request.items():
        monkeypatch.setenv(name, value)
    with pytest.raises(SystemExit):
        main([])
    assert capsys.readouterr().out.split() == ["resume", "report", "response"]


def test_without_a_terminal_there_is_a_line_every_few_seconds() -> None:
    stream = io.StringIO()
    line = ProgressLine(Console(file=stream, force_terminal=False, width=40, color_system=None, _environ={}))
    for wall in (0.0, 4.9, 5.1, 9.0, 10.2):
        line(progress(wall, wall))
    line.close()
    assert [text.split(",")[0] for text in stream.getvalue().splitlines()] == ["t = 5.1 of 20 s", "t = 10.2 of 20 s"]
