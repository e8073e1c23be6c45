"""The command: `python -m board`, in the folder bench."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import hybrid
from board import against_peers
from board import problems as ours
from board.answers import Answer, Problem, references
from board.page import page
from board.picture import draw

DOCS = Path(__file__).parents[2] / "docs"
PROBLEMS: dict[str, Callable[[str], list[Answer]]] = {
    "lazy_wave_80": lambda name: ours.lazy_wave(name) + against_peers.cabledyn_on(name),
    "span_80": lambda name: ours.span(name) + against_peers.cabledyn_on(name),
    "lazy_wave_800": lambda name: ours.lazy_wave(name) + against_peers.cabledyn_on(name),
    "touchdown_bending": ours.touchdown_bending,
    "chain_current": ours.chain_current,
    "chain_heave": ours.chain_heave,
    "touchdown": against_peers.touchdown,
    "mooring": against_peers.mooring,
    "suspension": against_peers.suspended,
    "power_cables": ours.power_cables,
    "helix": ours.helix,
}
PACKAGES = {
    "CableDyn": "cabledyn",
    "MoorDyn": "moordyn",
    "MoorPy": "moorpy",
    "Exudyn": "exudyn",
    "PyElastica": "pyelastica",
}


def solved(name: str) -> Problem:
    """A problem of the table with what was computed; a reference that a program computes is taken from its answers."""
    table = references()["problems"][name]
    quantities, answers = table["quantities"], PROBLEMS[name](name)
    source = table.get("computed")
    for answer in (x for x in answers if x.program == source):
        quantities = {quantity: {source: value} for quantity, value in answer.values.items()}
    return Problem(name, table["title"], table["statement"], quantities, [x for x in answers if x.program != source])


def programs() -> tuple[str, str]:
    """Versions of those that are installed; names of those that are not."""
    there, missing = [f"hybrid {hybrid.__version__}"], []
    for name, package in PACKAGES.items():
        try:
            there.append(f"{name} {version(package)}")
        except PackageNotFoundError:
            missing.append(name)
    return ", ".join(there), ", ".join(missing) or "none"


def board(names: list[str], folder: Path, command: str) -> str:
    """Compute problems, write board.md and pictures/board.png to the folder; the page."""
    found = []
    for name in names:
        print(f"{name} ...", file=sys.stderr, flush=True)
        found.append(solved(name))
    text = page(found, command, *programs())
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "board.md").write_text(text, encoding="utf-8")
    draw(found, folder / "pictures" / "board.png")
    return text


def main() -> None:
    """Compute, print, write."""
    ask = argparse.ArgumentParser(prog="python -m board", description=sys.modules["board"].__doc__)
    ask.add_argument("--problems", nargs="+", choices=list(PROBLEMS), default=list(PROBLEMS), metavar="NAME")
    ask.add_argument("-o", "--output", type=Path, help="folder; else docs, and build/board for a part of the problems")
    given = ask.parse_args()
    whole = given.problems == list(PROBLEMS)
    folder = given.output or (DOCS if whole else DOCS.parent / "build" / "board")
    print(board(given.problems, folder, shlex.join(["python", "-m", "board", *sys.argv[1:]])))


if __name__ == "__main__":
    main()
