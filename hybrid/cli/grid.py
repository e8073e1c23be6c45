"""Rows of a few words in columns: as text where they fit, by rich where they have to be wrapped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

BETWEEN = 2  # blanks between columns


@dataclass(frozen=True)
class Grid:
    """Rows, whose cells may have several lines, and a line below them."""

    rows: Sequence[Sequence[str]]
    below: str = ""

    def text(self) -> str:
        lines = [line for row in self.rows for line in zip_longest(*(x.split("\n") for x in row), fillvalue="")]
        widths = [max(map(len, column)) for column in zip_longest(*lines, fillvalue="")]
        out = [(" " * BETWEEN).join(map(str.ljust, line, widths)).rstrip() for line in lines]
        return "\n".join([*out, *([self.below] if self.below else [])])

    def table(self) -> Any:
        """For rich."""
        from rich.console import Group
        from rich.table import Table

        table = Table.grid(padding=(0, BETWEEN))
        for row in self.rows:
            table.add_row(*row)
        return Group(table, *([self.below] if self.below else []))
