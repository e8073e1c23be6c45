"""A seafloor file of MoorDyn: numbers of x and y, the x, the y, then a row x y z for every point; z is negative."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from hybrid.interop.moordyn.rows import Row, Source, number
from hybrid.scene.depths import MOST_POINTS

FIX = "line 1 has the numbers of x and y, line 2 the x, line 3 the y, each further one x y z with z < 0"
LARGEST = 50_000_000  # bytes


class Seafloor(NamedTuple):
    """Depths (m) under z = 0 at x and y (m): a row for each x."""

    x: list[float]
    y: list[float]
    depth: list[list[float]]
    row: Row


def read_seafloor(source: Source, row: Row, name: str) -> Seafloor | None:
    """The file that a row of the deck names, relative to the deck; complains of what it does not understand.

    None also if there is no such file.
    """

    def wrong(expected: str, line: int | None = None, given: str = "") -> None:
        where = f"{name}, line {line}" if line is not None else name
        source.complain("SeafloorFile", f"{where}{': ' + given if given else ''}", expected, FIX, row.line)

    path = Path(source.file).parent / name
    try:
        if not path.is_file():
            return None
        if path.stat().st_size > LARGEST:
            wrong(f"a file of at most {LARGEST / 1e6:g} MB")
            return None
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError):
        wrong("a text file")
        return None
    table = [[number(cell) for cell in line.split()] for line in lines]
    while table and not table[-1]:
        table.pop()
    head = [[x for x in cells if x is not None] for cells in table[:3]]
    if len(table) < 4 or any(len(a) != len(b) for a, b in zip(head, table, strict=False)) or len(head[0]) != 2:
        wrong("at least four lines of numbers")
        return None
    (n, m), x, y = head
    if not 4 <= n * m <= MOST_POINTS or [len(x), len(y)] != [n, m] or x != sorted(set(x)) or y != sorted(set(y)):
        wrong(f"{n:g} rising x in line 2 and {m:g} rising y in line 3")
        return None
    depth: list[list[float | None]] = [[None] * len(y) for _ in x]
    for k, cells in enumerate(table[3:], start=4):
        if not cells:
            continue
        if len(cells) != 3 or any(c is None for c in cells):
            wrong("three numbers x y z", k, lines[k - 1])
            return None
        a, b, z = (c or 0.0 for c in cells)
        if a not in x or b not in y or not z < 0.0:
            wrong("an x of line 2, a y of line 3 and a height below 0", k, lines[k - 1])
            return None
        depth[x.index(a)][y.index(b)] = -z
    if any(d is None for of_x in depth for d in of_x):
        wrong(f"a height for each of the {len(x)} x {len(y)} points; MoorDyn takes 0 for those that are missing")
        return None
    return Seafloor(x, y, [[d or 0.0 for d in of_x] for of_x in depth], row)
