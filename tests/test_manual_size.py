"""The manual that is written by hand for users is short, and so are its sentences.

`python tests/test_manual_size.py` prints the lines of each page.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"
# Written by commands: make_scene_reference.py, make_examples_page.py, make_gallery.py, make_tutorial.py, `python -m board`.
MADE = {"scene", "examples", "gallery", "tutorial", "board"}
FOR_DEVELOPERS = {"theory", "errors", "zone_rules", "architecture", "extend", "dependencies"}
BY_HAND = [
    page
    for page in sorted(DOCS.rglob("*.md"))
    if page.parent.name == "howto" or (page.parent == DOCS and page.stem not in MADE | FOR_DEVELOPERS)
]
MOST_LINES, MOST_WORDS = 3804, 30
HISTORY = {"changes"}  # which grows, and whose sentences name several keys and figures


def lines(page: Path) -> int:
    return len(page.read_text(encoding="utf-8").splitlines())


def sentences(text: str) -> list[str]:
    """Sentences of prose: code in a line is one word, tables and blocks are none."""
    text = re.sub(r"^```.*?^```$|<!--.*?-->", "", text, flags=re.DOTALL | re.MULTILINE)
    found = []
    for part in re.split(r"\n\s*\n|\n(?=[-|#!<]|\d+\. )", text):
        if part.strip() and part.strip()[0] not in "|#!<":
            prose = re.sub(r"\]\([^)]*\)", "]", re.sub(r"`[^`]*`", "x", part.strip()))
            found += re.split(r"(?<=[.!?:])[*)\]]*\s+", prose)
    return found


def words(sentence: str) -> int:
    return sum(bool(re.search(r"\w", word)) for word in sentence.split())


def test_the_manual_by_hand_is_short() -> None:
    assert len(BY_HAND) > 30, "pages are found"
    total = sum(lines(page) for page in BY_HAND if page.stem not in HISTORY)
    assert total <= MOST_LINES, f"{total} lines: what is measured goes to docs/evidence, what is repeated goes"


def test_every_page_has_its_place_in_the_navigation() -> None:
    nav = (DOCS.parent / "mkdocs.yml").read_text(encoding="utf-8").partition("\nnav:\n")[2]
    parts = dict(zip(*[iter(re.split(r"^  - (.*):$", nav, flags=re.MULTILINE)[1:])] * 2, strict=True))
    developers = {Path(page).stem for page in re.findall(r": (\S+\.md)$", parts["For developers"], re.MULTILINE)}
    evidence = set(re.findall(r": (\S+\.md)$", parts["Evidence"], re.MULTILINE))
    assert developers == FOR_DEVELOPERS
    assert evidence == {f"evidence/{page.name}" for page in (DOCS / "evidence").glob("*.md")} | {"board.md"}


@pytest.mark.parametrize("page", [x for x in BY_HAND if x.stem not in HISTORY], ids=lambda p: p.name)
def test_sentences_are_short(page: Path) -> None:
    long = [sentence for sentence in sentences(page.read_text(encoding="utf-8")) if words(sentence) > MOST_WORDS]
    assert not long, f"{page.name}: {long}"


def test_a_long_sentence_is_noticed() -> None:
    assert [words(s) for s in sentences("One two three.\n\n| a | b |\n\n- Four `f i v e` six: seven.\n")] == [3, 3, 1]
    assert words(sentences(" ".join(["word"] * 31) + ".")[0]) > MOST_WORDS


if __name__ == "__main__":
    for page in sorted(BY_HAND, key=lines):
        print(lines(page), page.relative_to(DOCS))
    history = sum(lines(page) for page in BY_HAND if page.stem in HISTORY)
    total = sum(map(lines, BY_HAND))
    print(f"{total} with the history of changes, {total - history} without, of at most {MOST_LINES}")
