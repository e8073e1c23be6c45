"""Rows of a few words in columns: as text where they fit, by rich where they have to be wrapped."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

BETWEEN = 2  # blanks between columns


class Trimmed:
    """What rich prints, without blanks at the ends of lines: rich fills every cell up to the width of its column."""

    def __init__(self, content: Any) -> None:
        self.content = content

    def __rich_console__(self, console: Any, options: Any) -> Iterator[Any]:
        from rich.segment import Segment

        for line in console.render_lines(self.content, options, pad=False):
            while line and not line[-1].text.strip():
                line.pop()
            if line:
                line[-1] = Segment(line[-1].text.rstrip(), line[-1].style)
            yield from (*line, Segment.line())


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
