"""Pictures of the live view for docs/view.md, in headless Chromium: wide and on a phone, light and dark.

python docs/figures/view_pictures.py [--scene] [--result] [--new] [FOLDER]      # all, or those of one kind
"""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import sync_playwright

import hybrid

ROOT = Path(__file__).parents[2]
PICTURES = ROOT / "docs" / "pictures"
QUIET = ("--no-sandbox", "--disable-gpu")
SCREENS: dict[int, dict[str, Any]] = {
    1400: {"viewport": {"width": 1400, "height": 900}},
    400: {"viewport": {"width": 400, "height": 860}, "has_touch": True, "is_mobile": True},
}


@contextmanager
def viewed(folder: Path, *file: str) -> Iterator[str]:
    """The address of a view, until the end."""
    call = f"from hybrid.cli.commands import main; main(['view', '--no-browser', '--json', *{list(file)!r}])"
    with subprocess.Popen([sys.executable, "-c", call], cwd=folder, stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        try:
            yield json.loads(child.stdout.readline())["address"]
        finally:
            child.send_signal(signal.SIGINT)


def small(picture: Path) -> None:
    """Keep 256 colours, which is a third of the size."""
    Image.open(picture).convert("RGB").quantize(256).save(picture, optimize=True)


def opened(browser: Any, address: str, width: int, scheme: str) -> Any:
    """A page of the view; playwright waits by a way that the policy of the page forbids."""
    page = browser.new_context(bypass_csp=True, color_scheme=scheme, **SCREENS[width]).new_page()
    page.goto(address)
    return page


def kept(page: Any, file: Path) -> None:
    """Save what a page shows."""
    page.wait_for_timeout(800)
    page.screenshot(path=file)
    small(file)
    page.context.close()


def of_a_scene(browser: Any, folder: Path, to: Path, width: int, scheme: str) -> None:
    """A scene while it is written; on a wide screen with something wrong, and the last good picture."""
    with viewed(folder, "touchdown.yaml") as address:
        page = opened(browser, address, width, scheme)
        page.wait_for_function("view.drawn >= 0", timeout=120_000)
        if width == 1400:
            page.evaluate("view.editor.editor.setValue(view.editor.text().replace('mass: 20', 'mass: -20'))")
            page.wait_for_function("document.querySelector('#list .problem')")
            page.evaluate("view.editor.skipHead()")
        kept(page, to / f"view_{width}_{scheme}.png")


def of_a_result(browser: Any, folder: Path, to: Path, width: int, scheme: str) -> None:
    """A result that is played, coloured by tension."""
    with viewed(folder / "results", "touchdown.h5") as address:
        page = opened(browser, address, width, scheme)
        page.wait_for_function("view.frames > 1", timeout=120_000)
        page.select_option("#colour", "tension")
        page.fill("#time", "218")
        page.evaluate("document.activeElement.blur()")
        kept(page, to / f"view_play_{width}_{scheme}.png")


def of_a_new_scene(browser: Any, folder: Path, to: Path, width: int, scheme: str) -> None:
    """Five questions, and what they make."""
    with viewed(folder) as address:
        page = opened(browser, address, width, scheme)
        page.click("#new >> text=lay")
        page.wait_for_timeout(300)
        page.screenshot(path=to / f"view_new_{width}_{scheme}.png")
        small(to / f"view_new_{width}_{scheme}.png")
        page.click("text=Make the scene")
        page.wait_for_function("document.getElementById('verdict').className === 'good'", timeout=120_000)
        kept(page, to / f"view_made_{width}_{scheme}.png")


PARTS = {"scene": of_a_scene, "result": of_a_result, "new": of_a_new_scene}


def main(to: Path, parts: list[str]) -> None:
    with tempfile.TemporaryDirectory() as name, sync_playwright() as play:
        folder = Path(name)
        shutil.copy(ROOT / "examples" / "touchdown.yaml", folder)
        if "result" in parts:
            (folder / "results").mkdir()
            hybrid.run(folder / "touchdown.yaml", output=folder / "results" / "touchdown.h5", progress=False)
        program = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
        browser = play.chromium.launch(executable_path=program, args=list(QUIET))
        for part in parts:
            for width in SCREENS:
                for scheme in ("light", "dark"):
                    PARTS[part](browser, folder, to, width, scheme)
        browser.close()


if __name__ == "__main__":
    asked = [argument.removeprefix("--") for argument in sys.argv[1:] if argument.startswith("--")]
    folders = [argument for argument in sys.argv[1:] if not argument.startswith("--")]
    main(Path(folders[0]) if folders else PICTURES, asked or list(PARTS))
