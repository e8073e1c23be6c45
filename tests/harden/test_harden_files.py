"""Result files that are spoilt: opened as they were written, or refused; never other numbers, never an open end.

The HDF5 library itself may crash on tables that are spoilt in a clever way, so every file is opened in a process
of its own, and crashes are counted:

    pytest tests/harden -m bench -s -k spoilt_files
"""

from __future__ import annotations

import json
import queue
import shutil
import signal
import subprocess
import sys
import threading
from collections import Counter
from pathlib import Path

import pytest
from test_result_file import writer_of

import hybrid

WORKER = Path(__file__).with_name("harden_files.py")
WIRE = """\
title: a wire that swings
cable: {sections: [{length: 2.0, mass: 1.0, axial_stiffness: 1.0e5, bending_stiffness: 0.01, damping: 1.0}]}
ends: {start: {kind: pinned, position: [0, 0, 0]}, end: {kind: free, force: {value: [5, 0, 0], until: 0.02}}}
initial: equilibrium
model: {kind: zones, zones: [{catenary: 1.0, cells: 5}, {rod: 1.0, cells: 5}]}
time: {duration: 0.05, step: 0.005}
output: {every: 0.01, points: 5}
"""
# s: a process that prints nothing for so long, importing the package included, hangs in HDF5, where no signal of Python
# reaches it.  A file takes milliseconds: the bound is for a busy machine.
PATIENCE = 120.0


@pytest.fixture
def good(tmp_path: Path) -> Path:
    """A small result, complete."""
    (tmp_path / "wire.yaml").write_text(WIRE)
    hybrid.run(hybrid.load_scene(tmp_path / "wire.yaml"), tmp_path / "good.h5").close()
    return tmp_path / "good.h5"


def _pass_on(worker: subprocess.Popen[str], lines: queue.Queue[str]) -> None:
    for line in worker.stdout:
        lines.put(line)
    lines.put("")


def opened(good: Path, numbers: range, plot_every: int) -> tuple[Counter[str], list[str]]:
    """How variants of a file end, and what is wrong; a process that dies or hangs is counted, and another goes on."""
    count: Counter[str] = Counter()
    bad: list[str] = []
    number = numbers.start
    while number < numbers.stop:
        asked = [sys.executable, *map(str, (WORKER, good, good.parent, number, numbers.stop, plot_every))]
        worker = subprocess.Popen(asked, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        lines: queue.Queue[str] = queue.Queue()
        reader = threading.Thread(target=_pass_on, args=(worker, lines))
        reader.start()
        begun = None
        while True:
            try:
                line = lines.get(timeout=PATIENCE)
            except queue.Empty:
                worker.kill()
                worker.wait()
                assert begun is not None, "the process printed nothing, and had opened no file"
                count["hung in HDF5"] += 1
                print(f"{begun} hangs")
                break
            if not line:
                worker.wait()
                if worker.returncode < 0:
                    count[f"crashed in HDF5 ({signal.Signals(-worker.returncode).name})"] += 1
                else:
                    assert worker.returncode == 0, worker.stderr.read()[-2000:]
                break
            said = json.loads(line)
            if "begins" in said:
                begun = said["begins"]
                continue
            begun = None
            count[said["kind"]] += 1
            if said["kind"] in ("fault", "other"):
                bad.append(f"{said['number']}: {said['kind']}: {said['text']}")
        reader.join()
        worker.stdout.close()
        worker.stderr.close()
        number = numbers.stop if begun is None else begun + 1
    return count, bad


def _told(what: str, numbers: range, count: Counter[str]) -> None:
    said = ", ".join(f"{n} {kind}" for kind, n in count.most_common())
    print(f"\n{len(numbers)} variants of {what}: {said}")


@pytest.mark.long
def test_spoilt_files(good: Path) -> None:
    count, bad = opened(good, range(10_000, 10_100), 25)
    _told("a complete result", range(100), count)
    assert not bad, "\n".join(bad[:20])
    assert count["refused"] and count["whole"]
    assert count["hung in HDF5"] == 0


@pytest.mark.bench
def test_three_thousand_spoilt_files(good: Path) -> None:
    count, bad = opened(good, range(3000), 50)
    _told("a complete result", range(3000), count)
    assert not bad, "\n".join(bad[:20])
    assert count["hung in HDF5"] == 0
    # What the library does with tables that are wrong and have the right checksum is not in our hands.
    assert sum(n for kind, n in count.items() if kind.startswith("crashed")) <= 60


@pytest.mark.long
def test_spoilt_files_of_a_run_that_was_killed(tmp_path: Path) -> None:
    """They have no sums, so other numbers are told and not promised; but they do not keep a reader waiting.

    With a reader in SWMR mode 61 of 200 variants never opened; without, 2 of 200 hang and 1 crashes the process.
    """
    killed = tmp_path / "killed.h5"
    with writer_of(killed, 300) as writer:
        assert writer.wait() == -signal.SIGKILL
    count, bad = opened(killed, range(40), 0)
    _told("the file of a killed run", range(40), count)
    assert not [x for x in bad if ": fault: " in x], "\n".join(bad[:20])
    assert count["refused"] >= 10 and count["whole"] >= 10
    assert sum(n for kind, n in count.items() if "HDF5" in kind) <= 1, count


def test_a_file_that_is_cut_off_is_said_at_once(good: Path) -> None:
    """HDF5 would read its tables again and again, twice as late each time."""
    whole = good.read_bytes()
    for size in (9, 47, 48, 1000, len(whole) // 2, len(whole) - 100):
        cut = good.with_name("cut.h5")
        cut.write_bytes(whole[:size])
        with pytest.raises(hybrid.ResultError, match=r"cut off|spoilt|does not begin"):
            hybrid.open(cut)


def test_a_number_that_has_changed_is_not_taken_for_a_result(good: Path) -> None:
    """One bit of one number: HDF5 does not notice, the sum behind its end does."""
    whole = good.read_bytes()
    with hybrid.open(good) as result:
        wanted = result.tension[-1, -2:].tobytes()
    at = whole.index(wanted)
    other = good.with_name("other.h5")
    other.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
    with pytest.raises(hybrid.ResultError, match="it has changed since it was written"):
        hybrid.open(other)
    other.write_bytes(other.read_bytes()[:-1])
    with pytest.raises(hybrid.ResultError, match="it has changed since it was written"):
        hybrid.open(other)
    shutil.copy(good, other)
    with hybrid.open(other) as result:
        assert result.tension.shape == (6, 5)
