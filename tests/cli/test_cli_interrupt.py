"""A run that is stopped: by Ctrl-C, by SIGTERM, by a reader who goes away; and the live line on a terminal."""

from __future__ import annotations

import json
import os
import pty
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import typer

import hybrid
from hybrid.cli.app import session

LONG = """\
title: a pendulum that swings for days
cable: {sections: [{length: 1.0, mass: 1.0, axial_stiffness: 1.0e4}]}
ends:
  start: {kind: pinned, position: [0, 0, 0]}
  end: {kind: free}
initial: equilibrium
model: catenary
mesh: {cells: 4}
time: {duration: 1.0e5, step: 0.01}
output: {every: 0.1, points: 3}
"""
COMMAND = [sys.executable, "-c", "from hybrid.cli.commands import main; main()", "run", "long.yaml"]
PATIENCE = 60  # s, for a machine that has to compile the kernels first


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("long.yaml").write_text(LONG)


def start() -> subprocess.Popen[str]:
    """A run that has begun to move."""
    process = subprocess.Popen(
        [*COMMAND, "--json"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, bufsize=1
    )
    assert process.stdout is not None
    while json.loads(process.stdout.readline()).get("t", 0.0) < 0.2:  # two outputs
        pass
    return process


def check_file() -> float:
    """The file is whole up to its last output; returns the time of that."""
    with hybrid.open("long.h5") as result:
        assert result.status == "interrupted"
        assert len(result.times) > 1 and np.isfinite(result.position).all()
        np.testing.assert_allclose(np.diff(result.times), 0.1, rtol=1e-6)
        return float(result.times[-1])


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_leaves_a_whole_file(number: signal.Signals) -> None:
    process = start()
    with process:
        process.send_signal(number)
        out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    last = json.loads(out.splitlines()[-1])
    assert (last["event"], last["status"], last["file"]) == ("done", "interrupted", "long.h5")
    assert last["t"] == check_file()
    assert err == f"interrupted; long.h5 is complete up to t = {last['t']:.6g} s; `hybrid resume long.h5` goes on\n"


@pytest.mark.long
def test_a_reader_who_goes_away_ends_the_run() -> None:
    process = start()
    assert process.stdout is not None and process.stderr is not None
    with process:
        process.stdout.close()
        err = process.stderr.read()
    assert process.returncode == 130
    assert err == f"interrupted; long.h5 is complete up to t = {check_file():.6g} s; `hybrid resume long.h5` goes on\n"


@pytest.mark.long
def test_the_live_line_on_a_terminal_and_ctrl_c() -> None:
    here, there = pty.openpty()
    environment = os.environ | {"TERM": "xterm", "COLUMNS": "80", "LINES": "24"}
    process = subprocess.Popen(COMMAND, stdin=there, stdout=there, stderr=there, env=environment)
    os.close(there)
    seen = b""
    while seen.count(b"left") < 4:
        seen += os.read(here, 4096)
    process.send_signal(signal.SIGINT)
    try:
        while more := os.read(here, 4096):
            seen += more
    except OSError:  # Linux says so when the other side is closed
        pass
    os.close(here)
    assert process.wait(timeout=PATIENCE) == 130
    drawn, _, after = seen.decode().rpartition("left")
    plain = [re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", line) for line in drawn.split("\r")]
    lines = [line for line in plain if "step" in line]
    assert len(lines) >= 3 and all("\n" not in line and len(line) <= 80 for line in lines)
    assert "/ 100000 s" in lines[-1] and "catenary" in lines[-1] and " x" in lines[-1]
    # The line is taken away before anything else is said.
    assert after.index("\x1b[2K") < after.index("interrupted; long.h5 is complete up to t = ")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_stop_that_ends_as_another_exception(number: signal.Signals, capsys: pytest.CaptureFixture[str]) -> None:
    """As where it comes while a module is imported: libraries turn it into exceptions of their own."""
    before, handler = signal.signal(number, signal.default_int_handler), signal.default_int_handler
    try:
        _stopped(number, capsys)
        assert signal.getsignal(number) is handler
    finally:
        signal.signal(number, before)  # a background shell has SIGINT ignored


def _stopped(number: signal.Signals, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(typer.Exit) as ended, session(as_json=True, quiet=False):
        try:
            os.kill(os.getpid(), number)
            signal.sigtimedwait([], 5.0)  # until it is heard
        except KeyboardInterrupt:
            raise ImportError("cannot import name 'core'") from None
    assert ended.value.exit_code == 130
    heard = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [line["event"] for line in heard] == ["done"] and heard[0]["status"] == "interrupted"


def test_an_exception_that_nobody_stopped_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(typer.Exit) as ended, session(as_json=True, quiet=False):
        raise ImportError("cannot import name 'core'")
    told = json.loads(capsys.readouterr().out)
    assert ended.value.exit_code == 2 and told["event"] == "error" and "ImportError: cannot import" in told["message"]
