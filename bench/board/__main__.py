"""The command: `python -m board`, in the folder bench."""

from __future__ import annotations

import argparse
import json
import shlex
import sys
from collections.abc import Callable
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import hybrid
from board import against_peers
from board import problems as ours
from board.answers import Answer, Problem, references
from board.page import page
from board.picture import draw
from board.ropes import cosseratbench

DOCS = Path(__file__).parents[2] / "docs"
KEPT = DOCS.parent / "build" / "board"
PROBLEMS: dict[str, Callable[[str], list[Answer]]] = {
    "lazy_wave_80": lambda name: ours.lazy_wave(name) + against_peers.cabledyn_on(name),
    "span_80": lambda name: ours.span(name) + against_peers.cabledyn_on(name),
    "lazy_wave_800": lambda name: ours.lazy_wave(name) + against_peers.cabledyn_on(name),
    "touchdown_bending": ours.touchdown_bending,
    "chain_current": lambda name: ours.chain_current(name) + against_peers.cabledyn_in_current(name),
    "chain_heave": lambda name: ours.chain_heave(name) + against_peers.heaved_chains(name),
    "touchdown": against_peers.touchdown,
    "mooring": against_peers.mooring,
    "moorings_at_rest": against_peers.moorings_at_rest,
    "suspension": against_peers.suspended,
    "power_cables": ours.power_cables,
    "helix": ours.helix,
    "cosseratbench": cosseratbench,
}
PACKAGES = {
    "CableDyn": "cabledyn",
    "MoorDyn": "moordyn",
    "MoorPy": "moorpy",
    "Exudyn": "exudyn",
    "PyElastica": "pyelastica",
    "MuJoCo": "mujoco",
    "cosseratbench": "cosseratbench",
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


def board(names: list[str], folder: Path, command: str, again: bool) -> str:
    """Compute problems, write board.md and pictures/board.png to the folder; the page.

    What a problem gave is kept in KEPT; unless again, it is taken from there where all versions are the same.
    """
    found, versions = [], programs()
    KEPT.mkdir(parents=True, exist_ok=True)
    for name in names:
        file = KEPT / f"{name}.json"
        kept = json.loads(file.read_text(encoding="utf-8")) if file.exists() and not again else {}
        if kept.get("versions") == list(versions):
            given = kept["problem"]
            found.append(Problem(**given | {"answers": [Answer(**x) for x in given["answers"]]}))
            continue
        print(f"{name} ...", file=sys.stderr, flush=True)
        if again and name == "cosseratbench":
            for pair in KEPT.glob("*-*-*.json"):
                pair.unlink()
        found.append(solved(name))
        file.write_text(
            json.dumps({"versions": versions, "problem": asdict(found[-1])}, default=float), encoding="utf-8"
        )
    text = page(found, command, *versions)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "board.md").write_text(text, encoding="utf-8")
    draw(found, folder / "pictures" / "board.png")
    return text


def main() -> None:
    """Compute, print, write."""
    ask = argparse.ArgumentParser(prog="python -m board", description=sys.modules["board"].__doc__)
    ask.add_argument("--problems", nargs="+", choices=list(PROBLEMS), default=list(PROBLEMS), metavar="NAME")
    ask.add_argument("-o", "--output", type=Path, help="folder; else docs, and build/board for a part of the problems")
    ask.add_argument("--kept", action="store_true", help="take what an earlier call of the same versions computed")
    given = ask.parse_args()
    whole = given.problems == list(PROBLEMS)
    folder = given.output or (DOCS if whole else KEPT)
    command = shlex.join(["python", "-m", "board", *(x for x in sys.argv[1:] if x != "--kept")])
    print(board(given.problems, folder, command, not given.kept))


if __name__ == "__main__":
    main()
