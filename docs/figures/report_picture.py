"""The pictures of docs/report.md: the upper part of a report, and of one of two runs, on wide screens and on a phone.

    python docs/figures/report_picture.py [--two] [chromium]      # --two: that of two runs alone

Needs playwright and a Chromium (named, or `chromium` on PATH).
"""

from __future__ import annotations

import io
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Literal

from PIL import Image
from playwright.sync_api import Browser, sync_playwright

import hybrid

ROOT = Path(__file__).parents[2]
SETTINGS = ["accuracy=1%", "cable.sections[0].min_bend_radius=30"]
HEAVIER = "cable.sections[0].mass=26"  # of the run that is laid over the first
SCHEMES: tuple[Literal["light", "dark"], ...] = ("light", "dark")
FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]


def saved(picture: Image.Image, name: str) -> None:
    """Save a picture in docs/pictures, with 256 colours."""
    few = picture.quantize(256, Image.Quantize.MAXCOVERAGE, kmeans=8, dither=Image.Dither.NONE)
    few.save(ROOT / "docs" / "pictures" / f"{name}.png", optimize=True)


def shown(browser: Browser, file: Path, size: tuple[int, int], scheme: Literal["light", "dark"]) -> Image.Image:
    """The upper part of a report of so many pixels, of one run at the time of the smallest bend radius."""
    view = {"width": size[0], "height": size[1]}
    page = browser.new_page(viewport=view, reduced_motion="reduce", color_scheme=scheme)
    page.goto(file.as_uri())
    if page.query_selector("#fact-bend button.show"):
        page.click("#fact-bend button.show")
        page.wait_for_function("window.report && window.report.cable")  # it is gone to
        page.evaluate("scrollTo(0, 0)")
    page.wait_for_timeout(2000)
    picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    page.close()
    return picture


def main() -> None:
    names = [argument for argument in sys.argv[1:] if argument != "--two"]
    program = names[0] if names else shutil.which("chromium")
    scene = hybrid.load_scene(ROOT / "examples" / "touchdown.yaml", SETTINGS)
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as play:
        run = hybrid.run(scene, progress=False)
        other = hybrid.run(
            hybrid.load_scene(ROOT / "examples" / "touchdown.yaml", [*SETTINGS, HEAVIER]), progress=False
        )
        two = hybrid.compare({"20 kg/m": run, "26 kg/m": other}, Path(folder) / "two.html")
        files = {"report_two": two}
        browser = play.chromium.launch(executable_path=program, args=FLAGS)
        if "--two" not in sys.argv:
            file = files["report"] = hybrid.report(run, Path(folder) / "touchdown.html")
            saved(shown(browser, file, (1120, 2140), "light").resize((840, 1605), Image.Resampling.LANCZOS), "report")
        for name, file in files.items():
            for width, height in ((1400, 1200), (400, 900)):
                for scheme in SCHEMES:
                    saved(shown(browser, file, (width, height), scheme), f"{name}_{width}_{scheme}")
        browser.close()


if __name__ == "__main__":
    main()
