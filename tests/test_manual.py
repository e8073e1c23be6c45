"""The manual as a site: it is built without a warning, asks no other host for anything, and leaves out no message."""

from __future__ import annotations

import ast
import re
import runpy
import subprocess
import sys
import unicodedata
import xml.etree.ElementTree as xml
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import hybrid
from hybrid.errors import EVENTS_BY_WEIGHT, ZONE_EVENTS, Outcome
from hybrid.model.plan import CHOSEN
from hybrid.scene.checks import CHECKS

pytestmark = pytest.mark.needs("mkdocs-material", "playwright")
ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
EQUATIONS: dict[str, Any] = runpy.run_path(str(DOCS / "manual" / "equations.py"))


# --- the examples on the site ----------------------------------------------------------------------


def test_results_that_lie_among_the_examples_are_no_part_of_the_site(tmp_path: Path) -> None:
    """`hybrid trade` and `hybrid run` may have been called there: a folder is no file to copy."""
    hooks = runpy.run_path(str(DOCS / "manual" / "hooks.py"))
    on_files = hooks["on_files"]
    on_files.__globals__["ROOT"] = tmp_path
    (tmp_path / "examples" / "a.trade").mkdir(parents=True)
    (tmp_path / "examples" / "folder.yaml").mkdir()
    for name in ("a.yaml", "a.h5", "b.py"):
        (tmp_path / "examples" / name).touch()
    plugins = SimpleNamespace(_current_plugin=None)
    config = SimpleNamespace(site_dir=str(tmp_path), use_directory_urls=True, plugins=plugins)
    assert [file.src_uri for file in on_files([], config)] == ["examples/a.yaml", "examples/b.py"]


# --- every message has an entry --------------------------------------------------------------------


@cache
def kinds_in_code() -> set[str]:
    """Kinds of events that the sources name where they write one: `event(..., kind, text)`, `note`, `event=`."""
    found = set()
    for file in (ROOT / "hybrid").rglob("*.py"):
        if file.relative_to(ROOT / "hybrid").parts[0] in ("scene", "interop"):
            continue  # have no events; their notes are of another kind
        text = file.read_text(encoding="utf-8")
        for node in ast.walk(ast.parse(text)) if re.search(r"event\(|note\(|event=|_notes", text) else ():
            if isinstance(node, ast.Call):
                name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
                place = {"event": 3, "note": 2 if len(node.args) > 2 else 0}.get(name)
                args = [x for arg in node.args for x in [arg] * (1 + isinstance(arg, ast.Starred))]  # two places, s
                given = [] if place is None else args[place : place + 1]
                given += [k.value for k in node.keywords if k.arg == "event"]
                if name == "append" and node.args and isinstance(node.args[0], ast.Tuple):  # notes of the error figure
                    given += node.args[0].elts[:1] if "_notes" in ast.unparse(node.func) else []
                found |= {x.value for x in given if isinstance(x, ast.Constant) and isinstance(x.value, str)}
    return {kind for kind in found if re.fullmatch(r"[a-z]+( [a-z]+)*", kind)} | {CHOSEN}


def entries() -> list[str]:
    """What stands in the headings of docs/troubleshooting.md."""
    text = (DOCS / "troubleshooting.md").read_text(encoding="utf-8")
    heads = re.findall(r"^#### (.*)\n(.*)", text, re.MULTILINE)
    assert all(body.strip() for _, body in heads), "an entry without a word"
    return [name for head, _ in heads for name in re.findall(r"`([^`]+)`", head)]


def test_every_kind_of_event_is_explained() -> None:
    kinds = kinds_in_code()
    assert len(kinds) > 20 and "coarse step" in kinds and "accuracy missed" in kinds, "found where they are written"
    missing = (kinds | set(EVENTS_BY_WEIGHT) | set(ZONE_EVENTS)) - set(entries())
    assert not missing, f"docs/troubleshooting.md says nothing of {sorted(missing)}"


def test_every_outcome_is_explained_in_its_words() -> None:
    text = (DOCS / "troubleshooting.md").read_text(encoding="utf-8")
    named = entries()
    for outcome in set(Outcome) - {Outcome.OK}:
        assert outcome.name.lower() in named, outcome
        begin = re.split(r"[;:,(]", outcome.cause)[0].strip()
        assert begin.lower() in text.lower(), f"the words of {outcome.name} are not on the page: {begin}"


def test_nothing_is_explained_that_cannot_be_said() -> None:
    known = kinds_in_code() | set(EVENTS_BY_WEIGHT) | set(ZONE_EVENTS) | {x.name.lower() for x in Outcome}
    assert set(entries()) <= known


def test_every_family_of_refusals_is_explained() -> None:
    text = (DOCS / "troubleshooting.md").read_text(encoding="utf-8")
    named = re.findall(r"<!-- (\w+) -->", text)
    assert sorted(named) == sorted(check.__name__ for check in CHECKS)


def test_every_public_name_is_on_the_page() -> None:
    text = (DOCS / "api.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"^::: hybrid\.(\w+)$", text, re.MULTILINE)) == sorted(hybrid.__all__)


def test_every_page_begins_with_what_it_is_for() -> None:
    for page in sorted(DOCS.rglob("*.md")):
        first = page.read_text(encoding="utf-8").split("\n\n")[1]
        assert re.match(r"Use this page to [^.]*[^.]*[.:]", first.replace("examples/", "")), (
            f"{page.name}: {first[:80]}"
        )


def test_tables_of_the_scene_reference_are_closed_and_name_their_keys() -> None:
    text = (DOCS / "scene.md").read_text(encoding="utf-8")
    folds = re.findall(
        r"^### (\w+)\n\n.*\n\n<details markdown=\"1\">\n<summary>(.*)</summary>\n\n((?:\|.*\n)+)\n</details>$",
        text,
        re.M,
    )
    assert len(folds) > 40 and len({name for name, _, _ in folds}) == len(folds), "headings to link to"
    for name, summary, table in folds:
        keys = set(re.findall(r"^\| `(\w+)` \|", table, re.M))
        assert set(re.findall(r"<code>(\w+)</code>", summary)) == keys, name
    links = set(re.findall(r"\]\(#(\w+)\)", text))
    assert links <= {name.lower() for name, _, _ in folds}


# --- equations -------------------------------------------------------------------------------------


def test_an_equation_is_set() -> None:
    math = EQUATIONS["math"]
    assert math("c_k") == "<msub><mi>c</mi><mrow><mi>k</mi></mrow></msub>"
    assert math("(a + b)/c²") == (
        "<mfrac><mrow><mi>a</mi><mo>+</mo><mi>b</mi></mrow>"
        "<mrow><msup><mi>c</mi><mrow><mi>2</mi></mrow></msup></mrow></mfrac>"
    )
    assert "<mover" in math("v̇") and "<mo>˙</mo>" in math("v̇")
    assert math("x_{i+1}").count("<mo>+</mo>") == 1


def test_all_equations_are_well_formed_and_leave_nothing_unset() -> None:
    text = (DOCS / "theory.md").read_text(encoding="utf-8")
    found = EQUATIONS["NUMBERED"].findall(text)
    assert len(found) > 40
    for number, line in found:
        block = EQUATIONS["equation"](number, line).replace("&nbsp;", " ")
        words = "".join(xml.fromstring(block).itertext())
        assert not re.search(r"[_{}^`\\]", words), f"({number}) {words}"
        assert words.count("(") == words.count(")") and words.count("[") == words.count("]"), number
        letters = re.sub(r"[^A-Za-z]", "", unicodedata.normalize("NFD", line.replace("ᵀ", "T")))
        assert re.sub(r"[^A-Za-z]", "", words.replace(f"({number})", "")) == letters, number


def test_prose_keeps_what_is_no_equation() -> None:
    page = EQUATIONS["page"]
    text = "`a_b` and [x](a_b.md) and s_tether\n\n```python\nr_i = 1  # (T1)\n```\n"
    assert page(text, "theory.md") == text
    assert page("as r_i by (T3a), k^p", "theory.md") == "as r<sub>i</sub> by [(T3a)](theory.md#T3a), k<sup>p</sup>"


# --- the site --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the site."""
    folder = tmp_path_factory.mktemp("manual") / "site"
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-q", "-d", str(folder)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.mark.slow
def test_the_site_is_built_strictly_and_asks_no_other_host(site: Path) -> None:
    pages = sorted(site.rglob("*.html"))
    assert len(pages) > 12
    asks = r"<(?:script|img|iframe|source)\b[^>]*\bsrc=\"(?:https?:)?//|<link\b[^>]*\bhref=\"(?:https?:)?//"
    for page in pages:
        assert not re.search(asks, page.read_text(encoding="utf-8")), page
    for sheet in site.rglob("*.css"):
        assert not re.search(r"url\([\"']?(?:https?:)?//|@import", sheet.read_text(encoding="utf-8")), sheet
    index = (site / "index.html").read_text(encoding="utf-8")
    assert '<script src="manual/iframe-worker.js">' in index and (site / "search" / "search_index.js").is_file()
    assert "<math" in (site / "theory.html").read_text(encoding="utf-8")
    api = (site / "api.html").read_text(encoding="utf-8")
    assert all(f'id="hybrid.{name}"' in api for name in hybrid.__all__)


@pytest.mark.slow
def test_a_link_to_a_closed_table_opens_it(site: Path, browser: Any) -> None:
    page = browser.new_page(viewport={"width": 400, "height": 800})
    page.goto((site / "scene.html").as_uri() + "#section")
    is_open = "name => document.getElementById(name).parentElement.querySelector(`#${name} ~ details`).open"
    assert page.evaluate(is_open, "section") and not page.evaluate(is_open, "clump")
    page.evaluate("location.hash = 'clump'")
    page.wait_for_function("document.querySelector('#clump ~ details').open")
    page.click("text=Open all tables")
    assert page.evaluate("[...document.querySelectorAll('article details')].every((fold) => fold.open)")
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), "no sideways scrolling on a phone"
    page.close()


# --- The manual that is written by hand for users is short, and so are its sentences ---
# `python tests/test_manual.py` prints the lines of each page.

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
