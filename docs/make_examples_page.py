"""Write docs/examples.md from the headers of examples/ and the pictures of docs/pictures.

    python docs/make_examples_page.py

A header begins with a sentence and goes on with `Shows:`, `Physics:`, `Look at:`, `Run time:`, `Source:`; to change
the page, change them.  Examples stand from easy to hard: the numbered ones, then those of the sea by what they need.
"""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = Path(__file__).with_name("examples.md")
SEA = ("touchdown", "s_tether", "rov_tether", "laying", "slack_on_seabed", "irregular_sea")
ENTRIES = ("Shows", "Physics", "Look at", "Run time", "Source")
HEAD = """\
# Examples

Use this page to find a scene to copy: every one is a file of `examples/`, commented line by line.
The tests run all of them (tests/test_examples.py).
Run times are of one core of a 2024 server, without the compilation of the first run.

This page is made from the headers of these files by `python docs/make_examples_page.py`.

"""


def header(path: Path) -> tuple[str, dict[str, str]]:
    """The sentence a file begins with, and its entries by name."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        lines = text.split('"""')[1].splitlines()
    else:
        lines = [line[2:] if line.startswith("# ") else "" for line in text.split("\n\n")[0].splitlines()]
    entries: dict[str, str] = {}
    first, name = "", ""
    for line in lines:
        found = re.match(rf"({'|'.join(ENTRIES)}): +(.*)", line)
        if found:
            name, line = found[1], found[2]
            entries[name] = ""
        elif name and line and not line.startswith(" "):
            break  # the header is over
        if not line.strip():
            name = "" if name == ENTRIES[-1] else name
        elif name:
            entries[name] += ("" if not entries[name] else "\n") + line.strip()
        elif not entries:
            first += (" " if first else "") + line.strip()
    return first, entries


def title(path: Path) -> str:
    """What the page calls an example."""
    if path.suffix == ".py":
        return header(path)[0].partition(":")[0].rstrip(".")
    found = re.search(r"^title: (.*)$", path.read_text(encoding="utf-8"), re.MULTILINE)
    assert found, path
    return found[1]


def escaped(text: str) -> str:
    """Prose as Markdown that means nothing else by its signs."""
    parts = text.split("`")
    parts[::2] = [re.sub(r"([*_<>|\[\]])", r"\\\1", part) for part in parts[::2]]
    return "`".join(parts)


def section(path: Path) -> str:
    first, entries = header(path)
    place = path.relative_to(ROOT).as_posix()
    command = f"hybrid run {place} --plot"
    if path.suffix == ".py":
        command = f"python examples/{path.name} {path.stem}.png"
    elif (ROOT / "docs" / "pictures" / f"{path.stem}_zones.png").exists():
        command += f"\nhybrid plot --zones {path.stem}.h5"
    out = f"## {title(path)}\n\n{escaped(first)}\n\n"
    out += f"![{title(path)}](pictures/{path.stem}.png)\n\n"
    out += f"```bash\n{command}\n```\n\n"
    out += "| | |\n|---|---|\n"
    for name in ("Shows", "Look at", "Physics", "Run time", "Source"):
        out += f"| **{name}** | {escaped(entries[name]).replace(chr(10), ' ')} |\n"
    out += f"| **File** | [{path.name}](../{place}) |\n\n"
    zones = ROOT / "docs" / "pictures" / f"{path.stem}_zones.png"
    if zones.exists():
        out += f"![Zones over time: {title(path)}](pictures/{zones.name})\n\n"
    return out


def page() -> str:
    """The whole page."""
    numbered = sorted((ROOT / "examples").glob("[0-9]*.*"))
    sea = [ROOT / "examples" / f"{name}.yaml" for name in SEA]
    others = sorted(set((ROOT / "examples").glob("*.yaml")) - {*numbered, *sea})
    contact = sorted((ROOT / "examples" / "contact").glob("*.yaml"))
    sections = [section(path) for path in (*numbered, *sea, *others, *contact)]
    return (HEAD + "".join(sections)).rstrip() + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
