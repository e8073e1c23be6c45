"""docs/extend.md: every change it shows is made in a copy of the package, and every proof beside them is run."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.kernels.test_signatures import ALL_SIGNATURES, ALONE, too_many

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "extend.md"
UNCHANGED = 2  # proofs before the first change


def blocks(language: str) -> list[str]:
    text = PAGE.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)


def change(diff: str, root: Path) -> list[Path]:
    """Make the changes of a unified diff without line numbers; each place must be found once.  The files changed."""
    done = []
    for part in re.split(r"^(?=--- )", diff, flags=re.MULTILINE)[1:]:
        head, *hunks = re.split(r"^@@\n", part, flags=re.MULTILINE)
        was, now = re.findall(r"^[-+]{3} (\S+)$", head, re.MULTILINE)
        assert was == now
        file = root / now
        text = file.read_text(encoding="utf-8") if file.exists() else ""
        for hunk in hunks:
            lines = hunk.splitlines(keepends=True)
            assert all(line[0] in " +-" or line == "\n" for line in lines), f"{now}: no diff: {hunk}"
            old = "".join(line[1:] or "\n" for line in lines if line[0] in " -\n")
            new = "".join(line[1:] or "\n" for line in lines if line[0] in " +\n")
            assert text.count(old) == 1 if text else not old, f"docs/extend.md, {now}: stands not once: {old}"
            text = text.replace(old, new) if text else new
        file.write_text(text, encoding="utf-8")
        done.append(file)
    return done


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of the package with all changes of the page, and the examples beside it."""
    shutil.copytree(ROOT / "hybrid", tmp_path / "hybrid", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    changed = [file for diff in blocks("diff") for file in change(diff, tmp_path)]
    assert len(set(changed)) > 10
    for file in changed:
        compile(file.read_text(encoding="utf-8"), str(file), "exec")
    return tmp_path


def test_every_change_can_be_made(copy: Path) -> None:
    assert "LAMINAR" in (copy / "hybrid" / "kernels" / "laws" / "node_forces.py").read_text(encoding="utf-8")


def test_a_change_that_no_longer_fits_is_noticed(copy: Path) -> None:
    with pytest.raises(AssertionError, match="stands not once"):
        change(blocks("diff")[0], copy)


def prove(proofs: list[str], package: Path, folder: Path, **more: str) -> str:
    """What proofs print that are run in a process of their own, with the package in `package`."""
    here = os.environ | {"PYTHONPATH": str(package)} | more
    command = [sys.executable, "-P", "-W", "error", "-c", "\n".join(proofs)]
    done = subprocess.run(command, cwd=folder, env=here, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.long
def test_what_needs_no_change_holds_as_it_is(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    prove(blocks("python")[:UNCHANGED], ROOT, tmp_path)


# After the proofs, in the process that has compiled the kernels: what carries the fields of a line, with the one that was
# added, and the signatures of all that was read meanwhile.
WALKS = """
import pytest
assert pytest.main(["-q", "-n", "0", "-p", "no:cacheprovider", {walk!r}]) == 0, "a field that is not carried"
"""


# Read for two kinds of arguments each, which takes little: bits and truths, numbers of cells and kinds of them; blocks of
# a line by itself, and of joined lines with columns beside them.
TWICE = {"hybrid.kernels.mesh.remesh.fill_element", "hybrid.kernels.mesh.cell_changes.begin_anew"}
TWICE |= {"hybrid.kernels.algebra.block_elimination.substitute"}
# Read for steps, which have a state and books, and for outputs, whose tables are both: 4 s of the first use of outputs.
TWICE |= {"hybrid.kernels.watch.extremes.node_pressure", "hybrid.kernels.laws.element.frames_at"}
# Read for knots in a row and for a column of a table.
TWICE |= {"hybrid.kernels.algebra.sparse_rows.interval_within"}
SIDES = "hybrid.kernels.watch.sides."


@pytest.mark.slow  # minutes: the kernels of the copy are compiled
def test_every_proof_of_a_change_holds_and_a_force_is_carried(copy: Path) -> None:
    """And what kernels inline has one signature: of compiled kernels elsewhere nothing is read."""
    walk = WALKS.format(walk=str(ROOT / "tests" / "model" / "test_fields_of_a_line.py"))
    once = {"HYBRID_CACHE_DIR": str(copy / "cache"), "NUMBA_OPT": "1"}  # they run for a moment
    said = prove([ALONE, *blocks("python")[UNCHANGED:], walk, ALL_SIGNATURES], copy, copy, **once)
    found = json.loads(said.splitlines()[-1])
    assert sum(map(bool, found.values())) > 400, "or nothing was read"
    twice = too_many(found)
    sides = {name: len(x) for name, x in twice.items() if name.startswith(SIDES)}
    assert {*sides.values()} == {2} and {*twice} - {*sides} == TWICE, (sides, {*twice} - {*sides} - TWICE)


def test_there_is_a_proof_for_every_seam() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert text[: text.index("```diff")].count("```python") == UNCHANGED
    sections = {part.partition("\n")[0]: part for part in re.split(r"^## ", text, flags=re.MULTILINE)[1:]}
    for seam, part in sections.items():
        if seam not in ("Kernels", "Before a change is merged"):
            assert "assert " in part, f"{seam} has no proof"
