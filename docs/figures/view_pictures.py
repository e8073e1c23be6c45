"""Pictures of the live view for docs/view.md, in headless Chromium: wide and on a phone, light and dark.

python docs/figures/view_pictures.py [--new] [FOLDER]      # --new: those of a new scene alone
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


def main(to: Path, all_of_them: bool = True) -> None:
    with tempfile.TemporaryDirectory() as name, sync_playwright() as play:
        folder = Path(name)
        shutil.copy(ROOT / "examples" / "touchdown.yaml", folder)
        program = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
        browser = play.chromium.launch(executable_path=program, args=list(QUIET))
        for scheme in ("light", "dark") if all_of_them else ():
            for width, screen in SCREENS.items():
                with viewed(folder, "touchdown.yaml") as address:
                    # playwright waits by a way that the policy of the page forbids
                    page = browser.new_context(bypass_csp=True, color_scheme=scheme, **screen).new_page()
                    page.goto(address)
                    page.wait_for_function("view.drawn >= 0", timeout=120_000)
                    if width == 1400:  # with something wrong, and the last good picture
                        page.evaluate(
                            "view.editor.editor.setValue(view.editor.text().replace('mass: 20', 'mass: -20'))"
                        )
                        page.wait_for_function("document.querySelector('#list .problem')")
                        page.evaluate("view.editor.skipHead()")
                    page.wait_for_timeout(800)
                    file = to / f"view_{width}_{scheme}.png"
                    page.screenshot(path=file)
                    small(file)
        for width, scheme in ((1400, "light"), (400, "light"), (400, "dark")):
            with viewed(folder) as address:
                page = browser.new_context(bypass_csp=True, color_scheme=scheme, **SCREENS[width]).new_page()
                page.goto(address)
                page.click("text=mooring")
                page.wait_for_timeout(300)
                file = to / f"view_new_{width}_{scheme}.png"
                page.screenshot(path=file)
                small(file)
        browser.close()


if __name__ == "__main__":
    folders = [argument for argument in sys.argv[1:] if argument != "--new"]
    main(Path(folders[0]) if folders else PICTURES, "--new" not in sys.argv)
