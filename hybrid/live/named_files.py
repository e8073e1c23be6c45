"""Files that the text of a scene names: motions, loads, depths, RAOs, laws of stretch."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

# Files that are watched: of a text with more of them, the first.
MOST_FILES = 50
_NAMED = re.compile(r"""(?<!\w)(?:file|rao)["']?:[ \t]+("[^"\n]+"|'[^'\n]+'|[^\s"'#{\[,}\]][^\n,}\]#]*)""")


def named_files(text: str, folder: Path) -> list[Path]:
    """Paths of the files that keys `file` and `rao` name, also in a text that is no valid scene."""
    return list(dict.fromkeys(_paths(text, folder)))[:MOST_FILES]


def _paths(text: str, folder: Path) -> Iterator[Path]:
    for line in text.splitlines():
        if line.lstrip().startswith("#"):
            continue
        for found in _NAMED.finditer(line):
            name = found[1].strip().strip("\"'")
            if name and "\0" not in name:
                yield folder / name
