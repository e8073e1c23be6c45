"""What the pages promise: commands run, scenes load, links lead somewhere, numbers are those of the code."""

from __future__ import annotations

import importlib
import json
import os
import re
import runpy
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
from ruamel.yaml import YAML

import hybrid
from hybrid.cli.commands import UsageError, app, main
from hybrid.designs.problem import scenes_of
from hybrid.scene.read import as_scene, read_text
from hybrid.scene.study import DESIGN, study_from
from hybrid.studies.cases import cases_of

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
PAGES = [README, *sorted((ROOT / "docs").rglob("*.md"))]
EXAMPLES = sorted((ROOT / "examples").glob("*.yaml"))
PICTURES = ROOT / "docs" / "pictures"


def blocks(page: Path, language: str) -> list[str]:
    """Fenced blocks of a page in one language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)


def commands(page: Path = README) -> Iterator[list[str]]:
    """Arguments of every `hybrid ...` in a page's shell blocks, in order."""
    for block in blocks(page, "bash"):
        for line in block.splitlines():
            for part in line.split("&&"):
                words = shlex.split(part, comments=True)
                if words[:1] == ["hybrid"]:
                    yield words[1:]


@pytest.fixture(scope="module")
def clone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the examples, as in a fresh clone."""
    folder = tmp_path_factory.mktemp("clone")
    shutil.copytree(ROOT / "examples", folder / "examples")
    return folder


@pytest.mark.slow  # half a minute
def test_commands_run(clone: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(clone)
    page = ROOT / "docs" / "commands.md"
    found = [*commands(), *commands(page)]
    named = {arguments[0] for arguments in found} | set(re.findall(r"`hybrid (\w+)", page.read_text(encoding="utf-8")))
    assert named == set(typer.main.get_command(app).commands), "the page has every command"
    for arguments in found:
        with pytest.raises(SystemExit) as left:
            main(arguments)
        assert not left.value.code, f"hybrid {' '.join(arguments)}: {capsys.readouterr().err}"
    for name in ("touchdown", "02_suspension"):
        assert (clone / f"{name}.h5").is_file() and (clone / f"{name}.png").is_file()


@pytest.mark.long
def test_readme_says_what_the_first_command_says(
    clone: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(clone)
    with pytest.raises(SystemExit):
        main(next(iter(commands())))
    out = capsys.readouterr()
    promised = blocks(README, "text")[0]
    for line in promised.splitlines():
        if line.startswith("note:"):
            assert line in " ".join(out.err.split()), "README.md shows another note than the program"
        if " steps, " in line:  # a step more or less is no matter
            steps = r"^100 s in 10\d\d steps, "
            assert re.match(steps, line) and re.search(steps, out.out, re.M)
            assert line.split("->")[1].split() == out.out.split("->")[1].split()
        if line.startswith(("rod", "largest", "smallest")):
            assert " ".join(line.split()) in " ".join(out.out.split())  # a narrow terminal breaks the longest


@pytest.mark.long
def test_readme_python_runs(clone: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(clone)
    (block,) = blocks(README, "python")
    exec(compile(block, "README.md", "exec"), {})
    said = capsys.readouterr().out
    assert said.startswith("(501, 101) N\n"), "as the comment beside it says"
    assert (clone / "mooring.png").stat().st_size > 10_000


def test_ci_reads_its_commands_from_the_readme() -> None:
    first, second, *_ = blocks(README, "bash")
    assert len(first.splitlines()) == 1, "one line to copy"
    assert re.fullmatch(
        r"python3 -m venv \S+ && \. \S+/bin/activate && pip install -e \. && hybrid run \S+ --plot\n", first
    )
    assert second == 'pip install -e ".[test]" && pytest\n'
    later = [line for block in blocks(README, "bash")[2:] for line in block.splitlines()]
    assert all(line.startswith("hybrid ") for line in later), "test_commands_run runs these and no others"
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    assert "first=$(block 1)" in script and "second=$(block 2)" in script
    newcomer, _, developer = script.partition('eval "$second"')
    # extras go into an environment that the newcomer's commands do not use, and are waited for
    assert re.findall(r"^ *(.*pip install.*)$", newcomer, re.M) == [".venv-dev/bin/pip install -q -e '.[dev]'"]
    assert developer.index('wait "$extras" || {') < developer.index(". .venv-dev/bin/activate\n")
    assert 'HYBRID_TEST_EXTRAS=all pytest -m "not bench and (slow or long or needs)"' in developer, (
        "no test is lost, none skips"
    )


@pytest.mark.long
@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_scenes_on_pages_load(page: Path) -> None:
    for text in blocks(page, "yaml"):
        if re.search(r"^unknowns:", text, re.MULTILINE):
            task = DESIGN.of_data(YAML(typ="safe").load(text), ROOT / "examples" / "designs")
            scenes_of(task, as_scene(task.asked.scene))
        elif "\nscene:" in text:
            cases_of(study_from(YAML(typ="safe").load(text), ROOT / "examples" / "studies"))
        else:
            hybrid.plan(read_text(text, str(page))[0])


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_links_lead_somewhere(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        file, _, anchor = target.partition("#")
        there = page.parent / file if file else page
        if there == ROOT / "docs" / "evidence" / "validation.md":
            continue  # the tests write it
        assert there.exists(), f"{page.name} links to {target}"
        if anchor:
            heads = re.findall(r"^#+ (.*)$", there.read_text(encoding="utf-8"), re.MULTILINE)
            known = {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}
            assert anchor in known, f"{page.name} links to {target}"


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_pages_name_no_place_but_their_own(page: Path) -> None:
    assert not re.search(r"/work/|/tmp/|/home/|https?://", page.read_text(encoding="utf-8"))


@pytest.mark.parametrize(("name", "script"), [("scene", "scene_reference"), ("examples", "examples_page")])
def test_generated_pages_are_fresh(name: str, script: str) -> None:
    make = runpy.run_path(str(ROOT / "docs" / f"make_{script}.py"))
    page = (ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8")
    assert page == make["page"](), f"run: python docs/make_{script}.py"


def test_trade_pages_begin_as_their_script_says() -> None:
    heads = runpy.run_path(str(ROOT / "docs" / "make_trade.py"))["HEADS"]
    for name, head in heads.items():
        assert (ROOT / "docs" / "evidence" / f"{name}.md").read_text(encoding="utf-8").startswith(head)


def test_pages_of_evidence_are_short_and_name_their_commands() -> None:
    made = runpy.run_path(str(ROOT / "docs" / "make_evidence.py"))
    pages = sorted((ROOT / "docs" / "evidence").glob("*.md"))
    assert set(made["WRITTEN"]) < {page.stem for page in pages}
    for page in pages:
        text = page.read_text(encoding="utf-8")
        assert len(text.splitlines()) <= 300, page.name
        found = made["commands"](page)
        assert found and all(f"`{command}`" in text for command in found), f"{page.name} names no command"


def test_cited_files_exist() -> None:
    """Paths in backticks or code, such as `hybrid/kernels/laws/water.py`."""
    for page in PAGES:
        text = re.sub(r"^```diff\n.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
        for name in re.findall(r"\b((?:hybrid|tests|docs|examples)/[\w/]+\.(?:py|md|yaml|png))", text):
            assert (ROOT / name).exists() or name == "docs/evidence/validation.md", f"{page.name} names {name}"


def test_architecture_names_what_is_there() -> None:
    """Files, below hybrid/ or by their name alone, and names in the sources."""
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    files = [*(ROOT / "hybrid").rglob("*.py")]
    sources = "".join(x.read_text(encoding="utf-8") for x in (*files, ROOT / "tests" / "test_house.py"))
    for name in re.findall(r"`([^`\n]+)`", re.sub(r"```.*?```", "", text, flags=re.DOTALL)):
        if "/" in name or name.endswith(".py"):
            places = [ROOT / "hybrid" / name, ROOT / name, *(x for x in files if x.name == name)]
            assert any(x.exists() for x in places), name
        else:
            assert re.search(rf"\b{re.escape(name)}\b", sources), name


def test_cited_equations_exist() -> None:
    """Equations are numbered without a gap, and docstrings cite none that is not there."""
    text = (ROOT / "docs" / "theory.md").read_text(encoding="utf-8")
    numbers = [int(n) for n in re.findall(r"^\(T(\d+)\)  ", text, re.MULTILINE)]
    assert numbers == list(range(1, len(numbers) + 1))
    for file in (ROOT / "hybrid").rglob("*.py"):
        cited = re.findall(r"\(T(\d+)\)", file.read_text(encoding="utf-8"))
        assert {int(n) for n in cited} <= set(numbers), file


# Every constant of docs/theory.md section 12 that stands alone in the code: module, name, value, as on the page.
CONSTANTS = (
    ("kernels.step.line_step", "TOLERANCE", 1e-9, "10⁻⁹"),
    ("kernels.step.line_step", "ROUND_OFF", 1e-6, "10⁻⁶"),
    ("kernels.step.line_step", "LOW_TENSION", 1e-3, "10⁻³ of the scale"),
    ("kernels.step.line_step", "LARGEST_TURN", 0.7, "0.7 rad"),
    ("kernels.step.step", "LARGEST_STEP_TURN", 1.0, "1 rad"),
    ("solve.stepper", "REACH", 0.1, "0.1 L"),
    ("solve.network_solver", "REACH", 0.1, "0.1 L"),
    ("solve.stepper", "MOST_ITERATIONS", 20, "20 in motion"),
    ("solve.network_solver", "MOST_ITERATIONS", 40, "40 in statics"),
    ("solve.search", "LOAD_STEPS", (1, 8, 64), "1, 8, 64 steps"),
    ("model.build", "SLACK_FLOOR", -1e-6, "−10⁻⁶ of the scale"),
    ("simulation.diagnostics", "UNRESOLVED", 1.0, "1 rad per cell"),
    ("solve.stepper", "HEAVY", 1e36, "10³⁶ 1/s²"),
    ("kernels.step.step_control", "HALVINGS", 10, "| halvings of a step | 10 |"),
    ("model.mesh", "DEFAULT_CELLS", 100, "| cells of a silent scene | 100 |"),
)


@pytest.mark.parametrize(("module", "name", "value", "said"), CONSTANTS, ids=[f"{m}.{n}" for m, n, *_ in CONSTANTS])
def test_constants_are_those_of_the_code(module: str, name: str, value: object, said: str) -> None:
    assert getattr(importlib.import_module(f"hybrid.{module}"), name) == value
    assert said in (ROOT / "docs" / "theory.md").read_text(encoding="utf-8")


# --- examples ----------------------------------------------------------------------------------


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda p: p.stem)
def test_example_loads_and_is_planned(example: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert hybrid.load_scene(example).title
    with pytest.raises(SystemExit) as left:
        main(["plan", str(example)])
    assert not left.value.code
    assert "unknowns" in capsys.readouterr().out


@pytest.mark.parametrize(
    "example",
    [*EXAMPLES, *(ROOT / "examples" / "contact").glob("*.yaml"), ROOT / "examples" / "08_python_api.py"],
    ids=lambda p: p.stem,
)
def test_example_has_a_header_and_a_picture(example: Path) -> None:
    text = example.read_text(encoding="utf-8")
    for entry in ("Shows:", "Physics:", "Look at:", "Run time:", "Source:"):
        assert entry in text, entry
    picture = PICTURES / f"{example.stem}.png"
    assert 10_000 < picture.stat().st_size <= 150_000, "run: python docs/figures/make_pictures.py"


def test_every_picture_is_small() -> None:
    """Those on pages; the four sheets that show all pages of the manual are linked to, 31 pages on each."""
    sheets = [*PICTURES.glob("manual_*.webp")]
    assert len(sheets) == 4 and all(sheet.stat().st_size <= 400_000 for sheet in sheets)
    assert all(picture.stat().st_size <= 150_000 for picture in PICTURES.iterdir() if picture not in sheets)


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_no_figure_is_still_to_come(page: Path) -> None:
    """A cell that is one word in capitals is a place kept for a number; so is such a line of a block of output."""
    text = re.sub(r"```(diff|python|yaml)\n.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    assert not re.findall(r"(?:^|\| )([A-Z]{4,}(?:_[A-Z]+)*)(?: \||$)", text, re.MULTILINE)


def test_films_of_the_gallery_are_there_and_small() -> None:
    made = runpy.run_path(str(ROOT / "docs" / "make_gallery.py"))
    assert (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8") == made["page"](), "python docs/make_gallery.py"
    films = {file.stem: file.stat().st_size for file in (ROOT / "docs" / "films").iterdir()}
    assert set(films) == set(made["SHOWN"])
    assert all(10_000 < size < made["LARGEST"] for size in films.values()), films


@pytest.mark.slow  # seven commands
def test_the_tutorial_shows_what_its_commands_print(tmp_path: Path) -> None:
    made = runpy.run_path(str(ROOT / "docs" / "make_tutorial.py"))
    constant = made["constant"]
    page = constant((ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8"))
    assert constant(made["page"](tmp_path)) == page, "python docs/make_tutorial.py"
    assert "Traceback" not in page and "tow.html" in page
    assert constant("4 min 2 s of wall time (compilation included)") == constant("0.9 s of wall time (70 x real time)")


# --- Every command on a page is one that works: blocks are run, in order and in an empty folder; quoted ones are
# parsed ---
# A block that cannot be run here says so, and why, in the line above it:
#
#     <!-- not run in CI: takes 40 minutes -->

MARK = re.compile(r"^<!-- not run in CI: *(.*?) *-->\n\Z", re.MULTILINE)
# Pinned, so that nobody marks a block in passing: page, blocks that are not run.
MARKED = {"index.md": 1, "studies.md": 1, "trade.md": 1}
# extend.md is tests/test_extend.py, export.md tests/exports/test_export_lines.py; of the README .ci/run runs the first two blocks, and test_docs.py the others, commands.md and tutorial.md.
ELSEWHERE = {"extend.md", "export.md", "README.md", "tutorial.md", "commands.md"}
# Files that run examples as they stand and check their figures: examples.md does not run those again.
FIGURES = ("test_examples.py", "test_examples.py", "simulation/test_stepping.py", "couple/test_fmu.py")


class Block(NamedTuple):
    """A fenced block: its language, its text, and why it is not run ("" if it is; None: marked without a reason)."""

    language: str
    text: str
    unrun: str | None


def blocks_run(page: Path) -> list[Block]:
    text = page.read_text(encoding="utf-8")
    out = []
    for found in re.finditer(r"^```(\w+)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE):
        before = text[: found.start()]
        mark = MARK.search(before[before.rfind("\n", 0, -1) + 1 :])
        out.append(Block(found[1], found[2], (mark[1] or None) if mark else ""))
    return out


def runs(page: Path) -> bool:
    return page.name not in ELSEWHERE and any(b.language in ("bash", "python") for b in blocks_run(page))


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


def commands_run(text: str) -> list[list[str]] | None:
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
    for block in blocks_run(page):
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
        elif block.language == "bash" and (ours := commands_run(block.text)) is not None:
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
        marked = [block for block in blocks_run(page) if block.unrun != ""]
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
