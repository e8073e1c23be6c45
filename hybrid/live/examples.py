"""The examples that a new scene can begin with: as they stand in the folder of examples."""

from __future__ import annotations

import re
import sys
from functools import cache
from pathlib import Path

from hybrid.live.document import Refused

# Beside the package in a checkout; where a wheel puts them.
FOLDERS = (Path(__file__).parents[2] / "examples", Path(sys.prefix) / "share" / "hybrid-cable" / "examples")


@cache
def examples() -> list[dict[str, str]]:
    """Name and first sentence of every example that needs no other file."""
    found = []
    for file in sorted(next((x for x in FOLDERS if x.is_dir()), Path(__file__).parent).glob("*.yaml")):
        text = file.read_text(encoding="utf-8")
        if ".csv" not in text.split("\ntitle:", 1)[-1]:
            head = re.match(r"((?:# .*\n)+)", text)
            words = " ".join(line[2:] for line in (head[1] if head else "").splitlines())
            found.append({"name": file.stem, "text": re.split(r"(?<=[.:])\s", words)[0].rstrip(":")})
    return found


def example_text(name: str) -> str:
    """The text of an example; Refused where there is none of that name."""
    if name not in {x["name"] for x in examples()}:
        raise Refused(f"there is no example {name[:100]!r}")
    folder = next(x for x in FOLDERS if x.is_dir())
    return (folder / f"{name}.yaml").read_text(encoding="utf-8")
