"""Tables in CSV files: a header and rows, with their lines in the file."""

from __future__ import annotations

import csv
from typing import NamedTuple

from hybrid.errors import Complaint, SceneError
from hybrid.scene.read import text_of


class Table(NamedTuple):
    """Names of columns; rows as numbers of lines, counted from 1, and texts of cells."""

    header: list[str]
    rows: list[tuple[int, list[str]]]


def read_table(file: str, where: str) -> Table:
    """The table of a file, without lines that are empty or begin with #; where: the key that names it.

    SceneError: no header or no row, columns without names, rows of another length.
    """
    lines = text_of(file).splitlines()
    numbered = [(i + 1, line) for i, line in enumerate(lines) if line.strip() and not line.startswith("#")]
    if len(numbered) < 2:
        raise SceneError([Complaint(where, file, "a header and one row or more")], file)
    header = [x.strip() for x in next(csv.reader([numbered[0][1]]))]
    if len(set(header)) < len(header) or not all(header):
        expected = "a name for each column"
        raise SceneError([Complaint(where, ",".join(header), expected, line=numbered[0][0])], file)
    rows = []
    for line, text in numbered[1:]:
        cells = [x.strip() for x in next(csv.reader([text]))]
        if len(cells) != len(header):
            expected = f"{len(header)}, one for each column"
            raise SceneError([Complaint(where, f"{len(cells)} values", expected, line=line)], file)
        rows.append((line, cells))
    return Table(header, rows)
