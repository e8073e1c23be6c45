"""What the pages promise: commands run, scenes load, links lead somewhere, numbers are those of the code."""

from __future__ import annotations

import importlib
import re
import runpy
import shlex
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer
from ruamel.yaml import YAML

import hybrid
from hybrid.cli.commands import app, main
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
    ("kernels.step.newton", "TOLERANCE", 1e-9, "10⁻⁹"),
    ("kernels.step.newton", "ROUND_OFF", 1e-6, "10⁻⁶"),
    ("kernels.step.newton", "LOW_TENSION", 1e-3, "10⁻³ of the scale"),
    ("kernels.step.newton", "LARGEST_TURN", 0.7, "0.7 rad"),
    ("kernels.step.step", "LARGEST_STEP_TURN", 1.0, "1 rad"),
    ("solve.stepper", "REACH", 0.1, "0.1 L"),
    ("solve.line_solver", "REACH", 0.1, "0.1 L"),
    ("solve.stepper", "MOST_ITERATIONS", 20, "20 in motion"),
    ("solve.line_solver", "MOST_ITERATIONS", 40, "40 in statics"),
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
