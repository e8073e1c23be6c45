"""What a command says where the machine fails it: a full disk, a link to itself, no memory; one message, no traceback."""

from __future__ import annotations

from pathlib import Path

import pytest

import hybrid
from hybrid.cli.app import FAILED, REFUSED, report_error
from hybrid.cli.commands import main
from hybrid.cli.console import Console


@pytest.mark.parametrize("command", ["schema", "--help", "import"])
def test_a_full_disk_behind_the_output_takes_one_line(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    deck = Path(__file__).parents[1] / "data" / "moordyn" / "chain.txt"
    arguments = [command, str(deck), "-o", str(tmp_path)] if command == "import" else [command]
    with open("/dev/full", "w") as full:
        monkeypatch.setattr("sys.stdout", full)
        with pytest.raises(SystemExit) as ended:
            main(arguments)
        monkeypatch.undo()
    assert ended.value.code == FAILED
    said = [line for line in capsys.readouterr().err.splitlines() if "space" in line or "bug" in line]
    assert said == ["the output: No space left on device", "    try:      a folder you may write to, with free space"]


@pytest.mark.parametrize("options", [["--json"], []])
def test_a_run_whose_output_finds_no_space_is_kept_to_its_end(
    options: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Progress as JSON ended it, as failed."""
    scene, result = tmp_path / "scene.yaml", tmp_path / "run.h5"
    scene.write_text(
        "cable: {sections: [{length: 10, mass: 1, axial_stiffness: 1e5}]}\ninitial: equilibrium\n"
        "ends: {start: {kind: pinned, position: [0, 0, 0]}, end: {kind: pinned, position: [8, 0, 0]}}\n"
        "time: {duration: 1, step: 0.05}\n"
    )
    with open("/dev/full", "w") as full:
        monkeypatch.setattr("sys.stdout", full)
        with pytest.raises(SystemExit) as ended:
            main(["run", str(scene), "-o", str(result), *options])
        monkeypatch.undo()
    assert ended.value.code == FAILED
    said = [line for line in capsys.readouterr().err.splitlines() if "space left" in line or "bug" in line]
    assert said == [f"the output: No space left on device; the result is kept in {result}"]
    assert hybrid.open(result).status == "complete"


def test_a_link_that_leads_to_itself_is_no_bug(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "loop.h5").symlink_to("loop.h5")
    with pytest.raises(SystemExit) as ended:
        main(["report", str(tmp_path / "loop.h5")])
    said = capsys.readouterr().err.splitlines()
    assert ended.value.code == REFUSED and len(said) == 2
    assert said[0].startswith(f"{tmp_path}/loop.h5: ") and "link" in said[1]


def test_memory_that_has_run_out_is_told_behind_what_fails_after_it(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ValueError) as late:
        try:
            raise MemoryError("Unable to allocate 4.00 GiB")
        finally:
            raise ValueError("I/O operation on closed file")
    assert report_error(Console(False, False), late.value) == FAILED
    said = capsys.readouterr().err
    assert said.startswith("not enough memory\n") and "fewer cells" in said and "bug" not in said
