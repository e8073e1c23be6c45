"""Pictures of every page of the manual on four sheets for docs/view.md: wide and on a phone, light and dark.

python docs/figures/manual_sheets.py [--whole FOLDER]      # --whole: each page in its full height as well, to look at

A sheet has the upper part of every page.  Pages that are wider than the screen, and pictures that do not load, are
printed, and the exit code is 1.
"""

from __future__ import annotations

import io
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from PIL import Image, ImageDraw, ImageFont
from playwright.sync_api import sync_playwright

ROOT = Path(__file__).parents[2]
PICTURES = ROOT / "docs" / "pictures"
HEIGHTS = {1400: 1600, 400: 1600}  # pixels of a page that are shown, by the width of the screen
SHEET = {1400: (7, 392), 400: (11, 192)}  # pages in a row, and how wide each is on the sheet
GAP, NAME = 12, 22  # pixels
LARGEST = 400_000  # bytes
BEYOND = """() => {
  const wide = document.documentElement.scrollWidth - document.documentElement.clientWidth;
  const lost = [...document.images].filter(x => x.complete && !x.naturalWidth).map(x => x.getAttribute('src'));
  return (wide > 0 ? [`${wide} px wider than the screen`] : []).concat(lost.map(x => `no picture ${x}`));
}"""
LOADED = """async () => {
  for (const x of document.images) x.loading = 'eager';
  await Promise.all([...document.images].map(x => x.decode().catch(() => 0)));
}"""


def captured(browser: Any, page: Path, width: int, scheme: str, whole: Path | None) -> tuple[Image.Image, list[str]]:
    """The upper part of a page, and what is wrong with it."""
    context = browser.new_context(color_scheme=scheme, viewport={"width": width, "height": 900})
    tab = context.new_page()
    tab.goto(page.as_uri())
    tab.evaluate(LOADED)
    tab.wait_for_timeout(200)
    faults = [f"{page.stem} at {width} px, {scheme}: {x}" for x in tab.evaluate(BEYOND)]
    if whole is not None:
        tab.screenshot(path=whole / f"{page.stem}_{width}_{scheme}.png", full_page=True)
    tab.set_viewport_size({"width": width, "height": HEIGHTS[width]})
    data = tab.screenshot()
    context.close()
    return Image.open(io.BytesIO(data)).convert("RGB"), faults


def sheet(pictures: dict[str, Image.Image], width: int, scheme: str) -> Image.Image:
    """All pages in rows, each with its name."""
    columns, across = SHEET[width]
    high = round(HEIGHTS[width] * across / width)
    rows = -(-len(pictures) // columns)
    paper, ink = ("#d0d4d8", "#000000") if scheme == "light" else ("#505458", "#ffffff")
    size = (GAP + columns * (across + GAP), GAP + rows * (high + NAME + GAP))
    out = Image.new("RGB", size, paper)
    draw, font = ImageDraw.Draw(out), ImageFont.load_default(15)
    for k, (name, picture) in enumerate(pictures.items()):
        x, y = GAP + (k % columns) * (across + GAP), GAP + (k // columns) * (high + NAME + GAP)
        draw.text((x, y), name, ink, font)
        out.paste(picture.resize((across, high), Image.Resampling.LANCZOS), (x, y + NAME))
    return out


def save(picture: Image.Image, file: Path) -> None:
    """As WebP, as good as the size allows."""
    for quality in range(80, 0, -10):
        picture.save(file, quality=quality, method=6)
        if file.stat().st_size <= LARGEST:
            return


def main(whole: Path | None) -> int:
    faults = list[str]()
    with tempfile.TemporaryDirectory() as made, sync_playwright() as player:
        subprocess.run([sys.executable, "-m", "mkdocs", "build", "--strict", "-q", "-d", made], cwd=ROOT, check=True)
        pages = sorted(x for x in Path(made).glob("*.html") if x.stem != "404")
        program = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
        browser = player.chromium.launch(executable_path=program, args=["--no-sandbox", "--disable-gpu"])
        for width in SHEET:
            for scheme in ("light", "dark"):
                pictures = {}
                for page in pages:
                    pictures[page.stem], found = captured(browser, page, width, scheme, whole)
                    faults += found
                save(sheet(pictures, width, scheme), PICTURES / f"manual_{width}_{scheme}.webp")
        browser.close()
    print("\n".join(faults))
    return bool(faults)


if __name__ == "__main__":
    folder = Path(sys.argv[2]) if sys.argv[1:2] == ["--whole"] else None
    if folder is not None:
        folder.mkdir(exist_ok=True)
    raise SystemExit(main(folder))
