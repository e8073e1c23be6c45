"""`hybrid trade`: what it says, what it writes, its exit codes, and what Ctrl-C leaves."""

from __future__ import annotations

import csv
import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.called import Call

SAG = """\
title: a line that sags
environment: {fluid: {density: 1025}}
cable:
  sections:
    - {length: 12.0, diameter: 0.03, mass: 2.0, axial_stiffness: 1.0e+5, bending_stiffness: 20.0,
       drag: {normal: 1.2}, added_mass: {normal: 1.0}}
ends:
  start: {kind: pinned, position: [0, 0, -5]}
  end: {kind: pinned, position: [10, 0, -5], motion: {heave: {amplitude: 0.3, period: 2.0}, ramp: 1}}
initial: equilibrium
model: adaptive
time: {duration: 1.0, step: 0.05}
output: {every: 0.1, points: 25}
"""
SHORT = ["--models", "rod,catenary", "--accuracies", "10%", "--reference", "3%"]
PATIENCE = 120  # s, for a machine that has to compile the kernels first, and is shared


@pytest.fixture(autouse=True)
def folder(call: Call) -> None:
    """Where sag.yaml is."""
    Path("sag.yaml").write_text(SAG)


@pytest.mark.long
def test_trade_writes_into_the_current_folder_and_says_what_to_take(call: Call) -> None:
    Path("there").mkdir()
    Path("sag.yaml").rename("there/sag.yaml")
    said = call("trade", "there/sag.yaml", *SHORT)
    assert said.code == 0, said.err
    folder = Path("sag.trade")
    assert {x.name for x in folder.iterdir()} == {"runs", "trade.csv", "trade.md", "trade.png"}
    assert "rod 3%" in said.out and "reference" in said.out and "catenary 10%" in said.out
    whole = " ".join(said.out.split())
    assert "For 1% use model " in whole or "No run met 1%" in whole
    assert f"4 runs -> {folder}/trade.md, {folder}/trade.csv and {folder}/trade.png" in whole
    page = (folder / "trade.md").read_text()
    assert f"`hybrid trade there/sag.yaml {' '.join(SHORT)}`" in page
    assert call("trade", "there/sag.yaml", *SHORT, "--quiet")[1:] == ("", ""), "its runs are kept"


@pytest.mark.long
def test_json_has_a_line_for_every_row(call: Call) -> None:
    said = call("trade", "sag.yaml", *SHORT, "-o", "out", "--for", "10%", "--json")
    assert said.code == 0, said.err
    lines = said.lines
    rows = [line for line in lines if line["event"] == "row"]
    with (Path("out") / "trade.csv").open() as file:
        read = list(csv.DictReader(file))
    assert [(r["model"], r["asked"], r["status"]) for r in rows] == [
        (r["model"], r["asked"], r["status"]) for r in read
    ]
    (best,) = (r for r in rows if r["recommended"])
    assert best["score"] <= 1.0 and best["pareto"]
    assert lines[-1]["event"] == "done" and lines[-1]["recommended"] == f"{best['model']} {best['asked']}"
    assert [line["what"] for line in lines if line["event"] == "progress"][1] == "rod 3%"


@pytest.mark.parametrize(
    ("options", "where"),
    [
        (["--models", "string"], "models"),
        (["--accuracies", "1%,2 feet"], "accuracies"),
        (["--for", "0"], "for"),
        (["--reference", "5%", "--accuracies", "3%"], "reference"),
        (["--set", "time.duration=-1"], "time.duration"),
    ],
)
def test_nonsense_is_refused(call: Call, options: list[str], where: str) -> None:
    said = call("trade", "sag.yaml", *options)
    assert said.code == 1 and where in said.err and "expected:" in said.err and not Path("sag.trade").exists()


@pytest.mark.parametrize("more", [[], ["--levels"]])
def test_who_asks_for_other_programs_is_told_where_they_are(call: Call, more: list[str]) -> None:
    said = call("trade", "sag.yaml", "--peers", *more)
    assert said.code == 1 and "python -m peers.trade SCENE.yaml" in " ".join(said.err.split())
    assert not Path("sag.trade").exists()


def test_a_file_in_the_place_of_the_folder_is_refused(call: Call) -> None:
    said = call("trade", "sag.yaml", *SHORT, "-o", "sag.yaml")
    assert said.code == 1 and "sag.yaml is no folder for a study" in said.err and "Traceback" not in said.err
    assert Path("sag.yaml").read_text() == SAG


def test_a_reference_that_fails_is_exit_2(call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    import hybrid.studies.runs as rungs
    from hybrid.errors import ComputationError, Outcome

    def run(*_: object, **__: object) -> None:
        raise ComputationError(Outcome.NOT_CONVERGED, 0.4, 3.0)

    monkeypatch.setattr(rungs, "run", run)
    said = call("trade", "sag.yaml", *SHORT)
    assert said.code == 2 and "the reference run, rod 3%, failed" in " ".join(said.err.split())


@pytest.mark.long
def test_ctrl_c_leaves_what_is_done_and_the_same_command_goes_on(call: Call) -> None:
    Path("long.yaml").write_text(SAG.replace("duration: 1.0", "duration: 200.0"))  # runs of about half a second
    arguments = ["trade", "long.yaml", *SHORT, "--json"]
    command = [sys.executable, "-c", "import sys; from hybrid.cli.commands import main; main(sys.argv[1:])", *arguments]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, bufsize=1)
    assert process.stdout is not None
    with process:
        while json.loads(process.stdout.readline()).get("done") != 1:
            pass
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert "interrupted; long.trade keeps the runs that are done; the same command makes the others" in err
    kept = {file.name: file.stat().st_mtime_ns for file in Path("long.trade/runs").glob("*.json")}
    missing = 4 - len(kept)  # on a busy machine more than one may be done when the signal comes
    words = "1 run is missing" if missing == 1 else f"{missing} runs are missing"
    assert 1 <= len(kept) <= 3 and words in Path("long.trade/trade.md").read_text()
    said = call(*arguments)
    assert said.code == 0
    now = {file.name: file.stat().st_mtime_ns for file in Path("long.trade/runs").glob("*.json")}
    assert len(now) == 4 and all(now[name] == stamp for name, stamp in kept.items())
    assert "missing" not in Path("long.trade/trade.md").read_text()
