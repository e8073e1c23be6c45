"""hybrid import: files, streams, exit codes, and what is there already."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import hybrid
from tests.called import Call

DECKS = Path(__file__).parents[1] / "data" / "moordyn"


@pytest.fixture(autouse=True)
def folder(call: Call) -> None:
    """Where the decks are."""
    for deck in DECKS.glob("*.txt"):
        shutil.copy(deck, Path())


def scenes() -> set[str]:
    return {path.as_posix() for path in Path().rglob("*.yaml")}


def test_one_cable_is_one_scene_in_this_folder(call: Call) -> None:
    said = call("import", "chain.txt")
    assert said.code == 0 and scenes() == {"chain.yaml"}
    assert said.out == "1 scene, 0 left out -> chain.yaml\n"
    assert "chain.txt:11: taken as: 2 Coupled 205 0 -2 0 0 0 0\n" in said.err
    assert "give ends.end.motion" in said.err and "    18: 0.001 dtM" in said.err
    assert hybrid.load_scene("chain.yaml").cable.length == 250.0


def test_several_cables_go_into_a_folder(call: Call) -> None:
    said = call("import", "three_lines.txt", "-o", "scenes/new", "--separate")
    assert said.code == 0
    assert scenes() == {f"scenes/new/three_lines.line{k}.yaml" for k in (1, 2, 3)}
    said = call("import", "three_lines.txt", "-o", "all.yaml", "--separate")
    assert said.code == 1 and "all.yaml for 3 cables" in said.err and "--line 1" in said.err
    assert call("import", "three_lines.txt", "-o", "second.yaml", "--line", "2").code == 0
    assert hybrid.load_scene("second.yaml").title == "line2 of three_lines.txt"


def test_several_cables_are_one_scene(call: Call) -> None:
    said = call("import", "three_lines.txt")
    assert said.code == 0 and said.out == "1 scene, 0 left out -> three_lines.yaml\n"
    assert "give points.point4.motion" in said.err
    assert list(hybrid.load_scene("three_lines.yaml").lines) == ["line1", "line2", "line3"]
    said = call("import", "rods_and_bodies.txt")
    assert said.code == 1 and "rods_and_bodies.txt:43: left out" in said.err and "--separate" in said.err


def test_a_result_is_written_as_a_deck(call: Call) -> None:
    assert call("import", "chain.txt").code == 0
    for arguments, code, says in (
        (["static", "chain.yaml"], 0, "equilibrium"),
        (["export", "chain.static.h5", "--moordyn", "-o", "back.txt"], 0, "MoorDyn deck -> back.txt"),
        (["export", "chain.static.h5", "--moordyn", "-o", "back.txt", "--no-overwrite"], 1, "not there yet"),
        (["export", "chain.static.h5", "--moordyn", "--at", "1"], 1, "--at: of other exports"),
    ):
        said = call(*arguments)
        assert said.code == code and says in said.out + said.err
    assert call("import", "back.txt").code == 0
    ours, theirs = hybrid.load_scene("chain.yaml"), hybrid.load_scene("back.yaml")
    assert (ours.cable, ours.ends, ours.mesh, ours.environment) == (
        theirs.cable, theirs.ends, theirs.mesh, theirs.environment,
    )  # fmt: skip


def test_what_is_there_is_not_replaced_unless_asked(call: Call) -> None:
    assert call("import", "chain.txt").code == 0
    Path("chain.yaml").write_text("edited by hand")
    said = call("import", "chain.txt")
    assert said.code == 1 and said.out == "" and "--overwrite" in said.err and "edited by hand" in said.err
    assert Path("chain.yaml").read_text() == "edited by hand"
    assert call("import", "chain.txt", "--overwrite").code == 0
    assert hybrid.load_scene("chain.yaml").cable.length == 250.0


def test_nothing_is_written_if_one_of_several_is_there(call: Call) -> None:
    Path("three_lines.line2.yaml").write_text("mine")
    assert call("import", "three_lines.txt", "--separate").code == 1
    assert scenes() == {"three_lines.line2.yaml"}


def test_a_place_that_cannot_be_written_to(call: Call) -> None:
    Path("file").write_text("")
    said = call("import", "chain.txt", "-o", "file/scene.yaml")
    assert said.code == 1 and "can be written to" in said.err


def test_json_has_every_note_and_quiet_has_none(call: Call) -> None:
    said = call("import", "rods_and_bodies.txt", "--json", "--separate")
    events = said.lines
    assert said.code == 0 and said.err == ""
    notes = [event for event in events if event["event"] == "note"]
    assert {"kind", "line", "text", "why", "instead", "scene"} <= notes[0].keys()
    assert events[-1]["event"] == "done" and len(events[-1]["files"]) == 5
    assert events[-1]["left_out"] == sum(note["kind"] == "left out" for note in notes) == 16
    assert call("import", "rods_and_bodies.txt", "--quiet", "--overwrite", "--separate") == (0, "", "")


def test_a_refused_deck_leaves_with_1_and_says_where(call: Call) -> None:
    Path("bad.txt").write_text(Path("chain.txt").read_text().replace("2.0e8", "nan"))
    said = call("import", "bad.txt")
    assert said.code == 1 and said.out == "" and not scenes()
    assert said.err.startswith("bad.txt:6: EA (N)\n    given:    nan\n    expected: a finite number")
    (event,) = call("import", "bad.txt", "--json").lines
    assert event["event"] == "error" and event["complaints"][0]["line"] == 6
    assert call("import", "nothing.txt").code == 1
    assert call("import", "chain.txt", "--line", "9").code == 1
    assert call("import", "chain.txt", "--line", "one").code == 1


def test_the_scene_of_a_deck_is_planned_by_the_next_command(call: Call) -> None:
    call("import", "rope_and_chain.txt")
    said = call("plan", "rope_and_chain.yaml")
    assert not said.code and "line1+2 of rope_and_chain.txt" in said.out
