"""Write the pages of docs/evidence: what is measured, each page with the commands that print it.

    python docs/make_evidence.py [page ...]     # run the commands of these pages, or of all: hours
    python docs/make_evidence.py --list         # pages and their commands

Tables are written by their commands.  Of a page of figures in words the commands that it quotes are run, and what they
print is kept in build/evidence/PAGE.txt, to be compared with the page.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
EVIDENCE = ROOT / "docs" / "evidence"
WRITTEN = {
    "validation": 'pytest tests/validation -m "not bench" --write-validation',
    "extremes": 'pytest tests/extremes -m "not bench" --write-extremes',
    "trade": "python docs/make_trade.py",
    "levels": "python docs/make_trade.py --levels",
}


def commands(page: Path) -> list[str]:
    """The commands that print a page, each once, in its order."""
    if page.stem in WRITTEN:
        return [WRITTEN[page.stem]]
    quoted = re.findall(r"`((?:pytest|python) [^`\n]+)`", page.read_text(encoding="utf-8"))
    return list(dict.fromkeys(quoted))


def main(names: list[str]) -> None:
    pages = [page for page in sorted(EVIDENCE.glob("*.md")) if page.stem in (names or [page.stem])]
    for page in pages:
        kept = ROOT / "build" / "evidence" / f"{page.stem}.txt"
        kept.parent.mkdir(parents=True, exist_ok=True)
        with kept.open("w", encoding="utf-8") as file:
            for command in commands(page):
                file.write(f"$ {command}\n")
                file.flush()
                program, *rest = shlex.split(command)
                words = [sys.executable, *(["-m", "pytest"] if program == "pytest" else []), *rest]
                subprocess.run(words, cwd=ROOT, stdout=file, stderr=subprocess.STDOUT, check=False)
        print(f"{page.relative_to(ROOT)}: {kept.relative_to(ROOT)}")


if __name__ == "__main__":
    if "--list" in sys.argv:
        for page in sorted(EVIDENCE.glob("*.md")):
            print(page.stem, *commands(page), sep="\n    ")
    else:
        main(sys.argv[1:])
