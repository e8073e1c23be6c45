"""Run every example and draw the pictures of README and docs into docs/pictures.

    python docs/figures/make_pictures.py [name ...]

The pages are those of `hybrid plot`, stored as palettes to keep the repository small.
"""

from __future__ import annotations

import io
import re
import runpy
import sys
from pathlib import Path

from PIL import Image

import hybrid

ROOT = Path(__file__).parents[2]
EXAMPLES, PICTURES = ROOT / "examples", ROOT / "docs" / "pictures"

COLOURS = 256


def shrink(page: bytes, file: Path) -> None:
    """Store a page with a palette of greatest coverage, then of least distance: lines and areas keep their colours."""
    look = {"method": Image.Quantize.MAXCOVERAGE, "kmeans": 3, "dither": Image.Dither.NONE}
    Image.open(io.BytesIO(page)).convert("RGB").quantize(COLOURS, **look).save(file, optimize=True)


def first_scene() -> hybrid.Scene:
    """The scene of docs/index.md."""
    page = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    found = re.search(r"^```yaml\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)
    assert found is not None
    return hybrid.parse_scene(found[1], "docs/index.md")


def main(names: list[str]) -> None:
    scenes: dict[str, Path | hybrid.Scene] = {
        path.stem: path for path in sorted([*EXAMPLES.glob("*.yaml"), *(EXAMPLES / "contact").glob("*.yaml")])
    }
    scenes["first"] = first_scene()
    for name, scene in scenes.items():
        if names and name not in names:
            continue
        page = io.BytesIO()
        figure = hybrid.plot(hybrid.run(scene))
        figure.savefig(page, dpi=150)
        shrink(page.getvalue(), PICTURES / f"{name}.png")
    for script in sorted(EXAMPLES.glob("[0-9]*.py")):
        if names and script.stem not in names:
            continue
        picture = PICTURES / f"{script.stem}.png"
        runpy.run_path(str(script))["main"](str(picture))
        shrink(picture.read_bytes(), picture)


if __name__ == "__main__":
    main(sys.argv[1:])
