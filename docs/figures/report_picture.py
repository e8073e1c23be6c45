"""The picture of docs/report.md: the upper part of a report, as Chromium shows it.

    python docs/figures/report_picture.py [chromium]

Needs playwright and a Chromium (named, or `chromium` on PATH).
"""

from __future__ import annotations

import io
import shutil
import sys
import tempfile
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

import hybrid

ROOT = Path(__file__).parents[2]
SETTINGS = ["accuracy=1%", "cable.sections[0].min_bend_radius=30"]
FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]


def main() -> None:
    program = sys.argv[1] if len(sys.argv) > 1 else shutil.which("chromium")
    scene = hybrid.load_scene(ROOT / "examples" / "touchdown.yaml", SETTINGS)
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as play:
        file = hybrid.report(hybrid.run(scene, progress=False), Path(folder) / "touchdown.html")
        browser = play.chromium.launch(executable_path=program, args=FLAGS)
        page = browser.new_page(viewport={"width": 1120, "height": 2140}, reduced_motion="reduce")
        page.goto(file.as_uri())
        page.wait_for_function("window.report && window.report.cable")  # it is in view
        page.click("#fact-bend button.show")
        page.evaluate("scrollTo(0, 0)")
        page.wait_for_timeout(2000)
        picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
        browser.close()
    small = picture.resize((840, 1605), Image.Resampling.LANCZOS)
    small.quantize(256, Image.Quantize.MAXCOVERAGE, kmeans=8, dither=Image.Dither.NONE).save(
        ROOT / "docs" / "pictures" / "report.png", optimize=True
    )


if __name__ == "__main__":
    main()
