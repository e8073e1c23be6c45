"""The size of the house: lines by room, median and longest file and function.

pytest bench -m bench -s -k house
"""

import ast
from pathlib import Path
from statistics import median

import pytest

import hybrid

pytestmark = pytest.mark.bench
PACKAGE = Path(hybrid.__file__).parent


def test_house():
    files = {p: len(p.read_text(encoding="utf-8").splitlines()) for p in sorted(PACKAGE.rglob("*.py"))}
    pages = {p: len(p.read_text(encoding="utf-8").splitlines()) for p in (PACKAGE / "view" / "page").iterdir()}
    rooms: dict[str, int] = {}
    for path, count in files.items():
        room = path.relative_to(PACKAGE).with_suffix("").parts[0]
        rooms[room] = rooms.get(room, 0) + count
    functions = [
        (node.end_lineno - node.lineno + 1, f"{path.relative_to(PACKAGE)}: {node.name}")
        for path in files
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef) and node.end_lineno is not None
    ]
    print(f"\n{sum(files.values())} lines of Python and {sum(pages.values())} of page in {len(files)} files")
    print(", ".join(f"{room} {count}" for room, count in sorted(rooms.items(), key=lambda x: -x[1])))
    print(f"file: median {median(files.values()):g}, longest", end=" ")
    print(", ".join(f"{p.relative_to(PACKAGE)} {n}" for p, n in sorted(files.items(), key=lambda x: -x[1])[:5]))
    print(f"function: median {median(n for n, _ in functions):g}, longest", end=" ")
    print(", ".join(f"{name} {n}" for n, name in sorted(functions, reverse=True)[:5]))
    assert rooms
