"""Run every example and draw the pictures of README and docs into docs/pictures.

    python docs/figures/make_pictures.py [name ...]

The pages are those of `hybrid plot`, stored as palettes to keep the repository small.
"""

from __future__ import annotations

import io
import runpy
import sys
from pathlib import Path

from PIL import Image

import hybrid

ROOT = Path(__file__).parents[2]
EXAMPLES, PICTURES = ROOT / "examples", ROOT / "docs" / "pictures"

# Which earlier shapes tell the story (s); evenly spread ones where nothing is said.
SETTLING = (0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.4, 2.0)
TIMES = {
    "02_suspension": SETTLING,
    "03_suspension_rod": SETTLING,
    "04_suspension_catenary": SETTLING,
    "05_cantilever": (0.0, 0.32, 0.36, 0.4, 0.44, 0.5, 0.6),
    "06_whip": (0.0, 0.15, 0.25, 0.33, 0.39, 0.42, 0.435, 0.445, 0.46, 0.5, 0.6),
}
COLOURS = 256


def shrink(page: bytes, file: Path) -> None:
    """Store a page with a palette (of greatest coverage: the thin lines keep their colours)."""
    Image.open(io.BytesIO(page)).convert("RGB").quantize(COLOURS, method=Image.Quantize.MAXCOVERAGE).save(
        file, optimize=True
    )


def main(names: list[str]) -> None:
    for scene in sorted(EXAMPLES.glob("*.yaml")):
        if names and scene.stem not in names:
            continue
        page = io.BytesIO()
        figure = hybrid.plot(hybrid.run(hybrid.load_scene(scene)), times=TIMES.get(scene.stem))
        figure.savefig(page, dpi=150)
        shrink(page.getvalue(), PICTURES / f"{scene.stem}.png")
    script = EXAMPLES / "08_python_api.py"
    if not names or script.stem in names:
        picture = PICTURES / f"{script.stem}.png"
        runpy.run_path(str(script))["main"](str(picture))
        shrink(picture.read_bytes(), picture)


if __name__ == "__main__":
    main(sys.argv[1:])
