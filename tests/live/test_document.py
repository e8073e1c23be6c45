"""The text of a scene with its revisions, its file, and two people who change it."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest

import hybrid
from hybrid.live.document import Document, Refused, example_text, examples, merged, new_scene, questions
from hybrid.live.pictures import picture_of

BASE = "a\nb\nc\nd\ne\n"


@pytest.mark.parametrize(
    ("mine", "theirs", "both"),
    [
        ("A\nb\nc\nd\ne\n", "a\nb\nc\nd\nE\n", "A\nb\nc\nd\nE\n"),
        ("a\nb\nc\nd\ne\n", "x\n", "x\n"),
        ("new\na\nb\nc\nd\ne\n", "a\nb\nd\ne\n", "new\na\nb\nd\ne\n"),
        ("a\nB\nc\nd\ne\n", "a\nother\nc\nd\nE\n", "a\nB\nc\nd\nE\n"),
        ("a\nb\nc\nd\ne\nf\n", "0\na\nb\nc\nd\ne\n", "0\na\nb\nc\nd\ne\nf\n"),
        ("a\nb\nc\n", "a\nb\nc\nd\ne\n", "a\nb\nc\n"),
        ("a\nb\nx\nc\nd\ne\n", "a\nb\nc\ny\nd\ne\n", "a\nb\nx\nc\ny\nd\ne\n"),
        ("", "a\nb\nc\nd\ne\n", ""),
    ],
)
def test_changes_of_both_are_kept(mine: str, theirs: str, both: str) -> None:
    assert merged(BASE, mine, theirs) == both


def test_changes_of_different_lines_are_always_kept() -> None:
    """Random texts: every line that one of two changed, in places that do not touch, is in what comes out."""
    rng = random.Random(1)
    for _ in range(300):
        base = [f"line {k}\n" for k in range(30)]
        mine, theirs, expected = base.copy(), base.copy(), base.copy()
        for k in rng.sample(range(0, 30, 2), 8):
            who = rng.choice((mine, theirs))
            text = rng.choice(("", f"new {k}\n", f"two {k}\nlines {k}\n"))
            who[k] = expected[k] = text
        assert merged("".join(base), "".join(mine), "".join(theirs)) == "".join(expected)


def test_an_edit_of_an_older_revision_keeps_what_others_did() -> None:
    document = Document(BASE)
    document.edit("A\nb\nc\nd\ne\n", 0)
    assert document.edit("a\nb\nc\nd\nE\n", 0) == "A\nb\nc\nd\nE\n"
    assert document.revision == 2


def test_saving_writes_the_file_and_keeps_its_permissions(tmp_path: Path) -> None:
    file = tmp_path / "scene.yaml"
    file.write_text(BASE)
    file.chmod(0o640)
    document = Document(BASE, file)
    document.edit("x\nµ\n", 0)
    assert document.changed
    document.save()
    assert file.read_bytes() == "x\nµ\n".encode()
    assert file.stat().st_mode & 0o777 == 0o640
    assert not document.changed
    assert list(tmp_path.iterdir()) == [file]
    assert document.compare_with_disk() == ""


def test_ends_of_lines_stay_those_of_the_file(tmp_path: Path) -> None:
    file = tmp_path / "scene.yaml"
    file.write_bytes(b"a\r\nb\r\n")
    document = Document(file.read_bytes().decode(), file)
    assert document.text == "a\nb\n"
    document.edit("a\nc\n", 0)
    document.save()
    assert file.read_bytes() == b"a\r\nc\r\n"
    file.write_bytes(b"a\r\nd\r\n")
    assert (document.compare_with_disk(), document.text) == ("taken", "a\nd\n")


def test_a_file_changed_by_another_program_is_not_replaced_unasked(tmp_path: Path) -> None:
    file = tmp_path / "scene.yaml"
    file.write_text(BASE)
    document = Document(BASE, file)
    document.edit("mine\n", 0)
    file.write_text("theirs\n")
    with pytest.raises(Refused, match="changed on disk"):
        document.save()
    assert file.read_text() == "theirs\n"
    assert document.compare_with_disk() == "differs"
    assert document.text == "mine\n"
    document.save(force=True)
    assert file.read_text() == "mine\n"


def test_a_file_that_was_deleted_is_written_anew(tmp_path: Path) -> None:
    file = tmp_path / "scene.yaml"
    file.write_text("a: 1\n")
    document = Document("a: 1\n", file)
    document.edit("a: 2\n", document.revision)
    file.unlink()
    assert document.compare_with_disk() == "gone"
    document.save()
    assert file.read_text() == "a: 2\n" and document.compare_with_disk() == "" and not document.changed


def test_a_change_on_disk_is_taken_where_nothing_is_unsaved(tmp_path: Path) -> None:
    file = tmp_path / "scene.yaml"
    file.write_text(BASE)
    document = Document(BASE, file)
    file.write_text("other text\n")
    assert document.compare_with_disk() == "taken"
    assert document.text == "other text\n"
    assert not document.changed
    file.unlink()
    assert document.compare_with_disk() == "gone"
    assert document.text == "other text\n"


@pytest.mark.parametrize(
    "name", ["../a.yaml", "a/b.yaml", "/etc/a.yaml", "..", ".hidden.yaml", "", "a\0.yaml", "C:a.yaml", "a\\b"]
)
def test_new_files_have_plain_names_in_the_folder(tmp_path: Path, name: str) -> None:
    document = Document(BASE, folder=tmp_path)
    with pytest.raises(Refused):
        document.save(name)
    assert not list(tmp_path.iterdir())


def test_a_new_file_replaces_no_other(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text("there")
    document = Document(BASE, folder=tmp_path)
    with pytest.raises(Refused, match="exists"):
        document.save("a")
    assert (tmp_path / "a.yaml").read_text() == "there"
    document.save("b")
    assert (tmp_path / "b.yaml").read_text() == BASE


def test_a_text_too_large_is_refused() -> None:
    document = Document(BASE)
    with pytest.raises(Refused, match="4 MB"):
        document.edit("x" * 4_000_001, 0)
    assert document.text == BASE


def test_a_link_out_of_the_folder_is_not_written_through(tmp_path: Path) -> None:
    """Of a new name, or one that has become a link since it was opened; who opens a link edits what it leads to."""
    folder, other = tmp_path / "scenes", tmp_path / "other"
    folder.mkdir()
    other.mkdir()
    document = Document(BASE, folder=folder)
    for name, there in (("there.yaml", "theirs\n"), ("dangling.yaml", None)):
        (folder / name).symlink_to(other / name)
        if there:
            (other / name).write_text(there)
        with pytest.raises(Refused, match="outside"):
            document.save(name, force=True)
    assert [x.name for x in other.iterdir()] == ["there.yaml"] and (other / "there.yaml").read_text() == "theirs\n"
    document.save("mine.yaml")
    (folder / "mine.yaml").unlink()
    (folder / "mine.yaml").symlink_to(other / "there.yaml")
    with pytest.raises(Refused, match="outside"):
        document.save(force=True)
    opened = Document("theirs\n", folder / "there.yaml")
    opened.edit(BASE, opened.revision)
    opened.save()
    assert (other / "there.yaml").read_text() == BASE and (folder / "there.yaml").is_symlink()
    (folder / "near.yaml").symlink_to("real.yaml")
    Document(BASE, folder=folder).save("near.yaml")
    assert (folder / "real.yaml").read_text() == BASE


# Scenes made by five questions, and examples: all are read, and have an equilibrium.


KINDS = {x["kind"]: x["questions"] for x in questions()}


@pytest.mark.parametrize("kind", KINDS)
def test_the_usual_answers_make_a_scene_with_an_equilibrium_and_a_motion(kind: str) -> None:
    assert max(map(len, new_scene(kind, {}).splitlines())) <= 60, "lines that fit in the editor"
    text = new_scene(kind, {})
    picture, _ = picture_of(text, "", lambda: None)
    assert picture["problems"] == []
    assert picture["moves"]
    assert not [fact for fact in picture["facts"] if fact["weight"] == "alarm"]


@pytest.mark.parametrize("kind", KINDS)
def test_random_answers_make_a_scene_that_is_read_or_are_refused_in_words(kind: str) -> None:
    rng = random.Random(kind)
    made = 0
    for _ in range(40):
        answers = {}
        for question in KINDS[kind]:
            low = max(question["low"], 1e-3 * question["high"])
            answers[question["key"]] = float(f"{low * (question['high'] / low) ** rng.random():.3g}")
        try:
            text = new_scene(kind, answers)
        except Refused as refused:
            assert re.search("must|no number from|expected:", str(refused))
            continue
        hybrid.parse_scene(text)
        made += 1
    assert made > 5


@pytest.mark.parametrize(
    "answers", [{"depth": "deep"}, {"depth": -1}, {"depth": None}, {"depth": "nan"}, {"depth": [1]}]
)
def test_answers_that_are_no_numbers_are_refused(answers: dict) -> None:
    with pytest.raises(Refused, match="water depth"):
        new_scene("mooring", answers)


def test_examples_are_named_and_begin_scenes() -> None:
    found = examples()
    assert len(found) > 10
    assert all(len(x["text"]) > 20 for x in found)
    for one in found:
        hybrid.parse_scene(example_text(one["name"]))


@pytest.mark.parametrize("name", ["../pyproject", "/etc/passwd", "touchdown.yaml", "", "studies/x"])
def test_other_files_are_no_examples(name: str) -> None:
    with pytest.raises(Refused):
        example_text(name)


def test_lines_that_one_adds_behind_a_line_that_the_other_changes():
    """They came twice, and the change was lost."""
    base, mine, theirs = "1\n2\n3\n4\n", "1\n2\n3\nX\n4\n", "1\n2\nT\n4\n"
    assert merged(base, mine, theirs) == merged(base, theirs, mine) == "1\n2\nT\nX\n4\n"


def test_a_name_of_many_bytes_is_refused(tmp_path):
    with pytest.raises(Refused):
        Document("a\n", None, tmp_path).save("ü" * 150)
