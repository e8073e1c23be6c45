"""Every command on a page is one that works: blocks are run, in order and in an empty folder; quoted ones are parsed.

A block that cannot be run here says so, and why, in the line above it:

    <!-- not run in CI: takes 40 minutes -->
"""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import typer
from test_docs import PAGES, ROOT

from hybrid.cli.commands import UsageError, app, main

MARK = re.compile(r"^<!-- not run in CI: *(.*?) *-->\n\Z", re.MULTILINE)
# Pinned, so that nobody marks a block in passing: page, blocks that are not run.
MARKED = {"index.md": 1, "studies.md": 1, "trade.md": 1}
# extend.md is tests/test_extend.py, export.md tests/exports/test_export_page.py; of the README .ci/run runs the first two blocks, and test_docs.py the others, commands.md and tutorial.md.
ELSEWHERE = {"extend.md", "export.md", "README.md", "tutorial.md", "commands.md"}
# Files that run examples as they stand and check their figures: examples.md does not run those again.
FIGURES = ("test_examples.py", "test_examples_contact.py", "simulation/test_stepping.py", "couple/test_fmu.py")


class Block(NamedTuple):
    """A fenced block: its language, its text, and why it is not run ("" if it is; None: marked without a reason)."""

    language: str
    text: str
    unrun: str | None


def blocks(page: Path) -> list[Block]:
    text = page.read_text(encoding="utf-8")
    out = []
    for found in re.finditer(r"^```(\w+)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE):
        before = text[: found.start()]
        mark = MARK.search(before[before.rfind("\n", 0, -1) + 1 :])
        out.append(Block(found[1], found[2], (mark[1] or None) if mark else ""))
    return out


def runs(page: Path) -> bool:
    return page.name not in ELSEWHERE and any(b.language in ("bash", "python") for b in blocks(page))


def checked(block: Block) -> bool:
    """Whether a test checks the figures of the example that a block runs."""
    tests = "".join((ROOT / "tests" / file).read_text(encoding="utf-8") for file in FIGURES)
    examples = [Path(x) for x in re.findall(r"examples/[\w/]+\.(?:yaml|py)", block.text)]
    assert examples and all((ROOT / x).is_file() for x in examples)
    return all(re.search(rf'"{x.stem}({x.suffix})?"', tests) for x in examples)


def shape(line: str) -> str:
    """A line without its numbers, which differ from machine to machine."""
    return " ".join(re.sub(r"[-+]?\d[\d.]*(e[-+]?\d+)?", "#", line).split())


def figures(line: str) -> str:
    """A pattern of a line in which every number is a group, but times, which a peak of many may change."""
    parts = re.split(r"((?:t = )?[-+]?\d[\d.]*(?:e[-+]?\d+)?)", " ".join(line.split()))
    number = r"[-+]?\d[\d.]*(?:e[-+]?\d+)?"
    holes = [rf"t = {number}" if part.startswith("t = ") else f"({number})" for part in parts[1::2]]
    texts = [re.escape(part) for part in parts[::2]]
    return "".join(text + hole for text, hole in zip(texts, [*holes, ""], strict=True))


def shown(line: str, said: str) -> bool:
    """Whether a program said this line, each number within 2 % of that on the page."""
    pattern = figures(line)
    on_page = re.fullmatch(pattern, " ".join(line.split()))
    assert on_page
    wanted = [float(x) for x in on_page.groups()]
    said_now = [map(float, found.groups()) for found in re.finditer(pattern, " ".join(said.split()))]
    return any(all(abs(x - w) <= 0.02 * abs(w) for x, w in zip(now, wanted, strict=True)) for now in said_now)


def in_shell(command: list[str]) -> str:
    """Run it in this folder as a user would; what it says."""
    here = os.environ | {"PYTHONPATH": str(ROOT)}
    here["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    done = subprocess.run(command, env=here, capture_output=True, text=True)
    assert done.returncode == 0, f"{command[-1]}\n{done.stdout}{done.stderr}"
    return done.stdout + done.stderr


def commands(text: str) -> list[list[str]] | None:
    """Arguments of the commands of a block that has nothing but `hybrid ...`; None: it needs a shell."""
    lines = [shlex.split(line, comments=True) for line in text.splitlines()]
    plain = all(words[:1] == ["hybrid"] and not set(words) & {"&&", "|", ">", ";"} for words in lines)
    return [words[1:] for words in lines] if plain else None


@pytest.mark.slow  # half a minute for all
@pytest.mark.parametrize("page", [p for p in PAGES if runs(p)], ids=lambda p: p.name)
def test_every_block_runs(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    said = ""
    names: dict[str, Any] = {"__name__": "__main__"}  # blocks of one page follow one another
    for block in blocks(page):
        name = re.match(r"# (\w+\.yaml)\n", block.text)
        if block.language == "yaml" and name:  # "save this as"
            (tmp_path / name[1]).write_text(block.text, encoding="utf-8")
        if block.language == "text" and page.name == "index.md":  # what the command before it says
            flat = " ".join(map(shape, said.splitlines()))
            for line in block.text.splitlines():
                assert shape(line) in flat, f"{page.name} shows what the program does not say: {line}"
        if block.language == "text" and page.parent.name == "howto":
            for line in block.text.splitlines():
                assert shown(line, said), f"{page.name} shows what the program does not say: {line}\n{said}"
        if block.unrun != "" or (page.name == "examples.md" and checked(block)):
            continue
        if block.language == "python":
            exec(compile(block.text, page.name, "exec"), names)
        elif block.language == "bash" and (ours := commands(block.text)) is not None:
            said = ""
            for words in ours:  # as the shell would, without a second to start each
                with pytest.raises(SystemExit) as left:
                    main(words)
                told = capsys.readouterr()
                assert not left.value.code, f"{page.name}: hybrid {shlex.join(words)}\n{told.out}{told.err}"
                said += told.out + told.err
        elif block.language == "bash":
            said = in_shell(["bash", "-euo", "pipefail", "-c", block.text])


def test_what_a_page_shows_is_compared_with_what_is_said() -> None:
    said = "largest  tension 1000.4 N at s = 2.5e+2 m,\nt = 77.3 s"
    assert shown("largest tension   1000 N at s = 250 m, t = 12 s", said)
    assert not shown("largest tension   1030 N at s = 250 m, t = 77.3 s", said)
    assert not shown("smallest tension   1000 N", said)


def test_blocks_that_are_not_run_say_why() -> None:
    found: dict[str, int] = {}
    for page in PAGES:
        marked = [block for block in blocks(page) if block.unrun != ""]
        assert all(block.unrun for block in marked), f"{page.name}: a block is marked without a reason"
        assert all(block.language in ("bash", "python") for block in marked)
        if marked:
            found[page.name] = len(marked)
        stray = len(re.findall(r"not run in CI", page.read_text(encoding="utf-8")))
        assert stray == len(marked), f"{page.name}: a mark that is not right above its block"
    assert found == MARKED


def test_no_command_hides_in_an_indented_block() -> None:
    for page in PAGES:
        prose = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
        assert not re.search(r"^(?: {4}|\t)\$? ?(hybrid|pytest|python3?|pip) ", prose, re.MULTILINE), page.name


# --- quoted in a line ----------------------------------------------------------------------------


def quoted(start: str) -> Iterator[tuple[Path, str]]:
    """Commands in backticks that begin with a word, by page; blocks do not count."""
    for page in PAGES:
        prose = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
        yield from ((page, text) for text in re.findall(r"`([^`\n]+)`", prose) if text.split()[0] == start)


@cache
def program() -> Any:
    """The commands of `hybrid`, made once: that takes as long as a hundred of them to parse."""
    return typer.main.get_command(app)


def parse(words: list[str]) -> None:
    """Parse a command without running it; what is only missing may be missing."""
    group = program()
    if words[0].startswith("-"):  # an option of the program, not a command
        assert words[0] in {name for option in group.params for name in option.opts}, f"there is no option {words[0]}"
        return
    outer = group.make_context("hybrid", words, resilient_parsing=True)
    assert words[0] in group.commands, f"there is no command {words[0]}"
    inner = group.commands[words[0]]
    try:
        inner.make_context(words[0], list(words[1:]), parent=outer)
    except UsageError as error:
        if type(error).__name__ != "MissingParameter":
            raise AssertionError(error.format_message()) from None


def test_quoted_commands_of_ours_parse() -> None:
    seen = 0
    for page, text in quoted("hybrid"):
        words = shlex.split(text)[1:]
        if not words:
            continue  # the program's name
        for each in [[word] for word in words if word != "|"] if "|" in words else [words]:
            try:
                parse(each)
            except AssertionError as error:
                raise AssertionError(f"{page.name}: {text}: {error}") from None
            seen += 1
    assert seen > 20


def test_a_command_that_does_not_exist_is_noticed() -> None:
    for wrong in (["walk"], ["--walk"], ["run", "--fast", "x.yaml"], ["trade", "x.yaml", "--repeat", "often"]):
        with pytest.raises(AssertionError):
            parse(wrong)


SELECT = """
import json, os, shlex
from _pytest.mark import deselect_by_keyword, deselect_by_mark

def pytest_collection_finish(session):
    found = {}
    for text, files in json.loads(os.environ["QUOTED"]).items():
        words = shlex.split(text)[1:]
        option = session.config.option
        option.keyword = words[words.index("-k") + 1] if "-k" in words else ""
        option.markexpr = words[words.index("-m") + 1] if "-m" in words else "not slow and not bench"
        items = [i for i in session.items if any(i.nodeid.startswith(f) for f in files)]
        deselect_by_keyword(items, session.config)
        deselect_by_mark(items, session.config)
        found[text] = len(items)
    nodes = [i.nodeid for i in session.items]
    with open(os.environ["FOUND"], "w") as file:
        json.dump({"selected": found, "nodes": nodes}, file)
"""
KNOWN = {"-k", "-m", "-s", "-q", "--write-validation", "--write-extremes"}


def named_files(text: str) -> list[str]:
    """Files and folders in a pytest command."""
    words = shlex.split(text)[1:]
    return [x for i, x in enumerate(words) if not x.startswith("-") and words[i - 1] not in ("-k", "-m")]


@pytest.fixture(scope="module")
def collected(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """How many tests each quoted pytest command selects, and the names of all in the files that they name."""
    folder = tmp_path_factory.mktemp("collected")
    (folder / "select_quoted.py").write_text(SELECT, encoding="utf-8")
    commands = [text for _, text in quoted("pytest")]
    commands += [f"pytest bench -m bench {text}" for _, text in quoted("-k")]
    commands.append("pytest bench -m bench -k no_such_test_anywhere")
    files = {text: named_files(text) for text in commands}
    assert all(files.values()), "a command that names no file or folder"
    here = os.environ | {
        "PYTHONPATH": f"{folder}{os.pathsep}{ROOT}", "QUOTED": json.dumps(files), "FOUND": str(folder / "found.json"),
    }  # fmt: skip
    command = [sys.executable, "-m", "pytest", "-p", "select_quoted", "--collect-only", "-qq", "-m", ""]
    command += sorted({name for names in files.values() for name in names})
    done = subprocess.run(command, cwd=ROOT, env=here, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    found: dict[str, Any] = json.loads((folder / "found.json").read_text(encoding="utf-8"))
    return found


@pytest.mark.slow  # a third of the tests is collected once more
def test_quoted_tests_exist(collected: dict[str, Any]) -> None:
    selected = dict(collected["selected"])
    assert selected.pop("pytest bench -m bench -k no_such_test_anywhere") == 0, "or this test could not fail"
    for text, count in selected.items():
        words = shlex.split(text)[1:]
        assert {w for w in words if w.startswith("-")} <= KNOWN, text
        assert count > 0, f"selects no test: {text}"
    assert len(selected) > 20


@pytest.mark.slow
def test_tests_named_in_validation_exist(collected: dict[str, Any]) -> None:
    page = (ROOT / "docs" / "evidence" / "validation.md").read_text(encoding="utf-8")
    named = re.findall(r"`(test_\w+\.py::[^`]+)` \|$", page, re.MULTILINE)
    rows = [line for line in page.splitlines() if line.startswith("| ") and not line.startswith("| case")]
    assert len(named) == len(rows) > 100, "every row names its test"
    assert {f"tests/validation/{name}" for name in named} <= set(collected["nodes"])
    assert all(line.count(" | ") >= 4 and " |  | " not in line for line in rows), "case, source, figure, acceptance"


def test_quoted_scripts_exist() -> None:
    for page, text in quoted("python"):
        first, *rest = text.split()[1:]
        assert find_spec(rest[0]) if first == "-m" else (ROOT / first).is_file(), f"{page.name}: {text}"
