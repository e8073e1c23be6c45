"""Pages in a browser without a screen.

Needs playwright and a Chromium: named by HYBRID_CHROMIUM, or `chromium`, `chromium-browser` or `google-chrome` on PATH,
or the one of `playwright install chromium`.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import extras
import pytest

extras.skip_without("playwright", whole_file=True)

from playwright import sync_api

QUIET = ("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking")
QUIET += ("--disable-component-update", "--disable-sync")


def chromium(own: str) -> str:
    """A Chromium; own: where playwright keeps the one that it can download."""
    named = os.environ.get("HYBRID_CHROMIUM")
    if named and not Path(named).is_file():
        pytest.fail(f"HYBRID_CHROMIUM names {named}, which is no file")
    on_path = map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))
    found = named or next(filter(None, on_path), None) or own
    if not Path(found).is_file():
        pytest.skip(
            "no Chromium: not named by HYBRID_CHROMIUM, not on PATH, and `playwright install chromium` not done"
        )
    return found


@contextmanager
def opened_browser() -> Iterator[Any]:
    """A browser for the tests of a module."""
    with sync_api.sync_playwright() as play:
        opened = play.chromium.launch(executable_path=chromium(play.chromium.executable_path), args=list(QUIET))
        yield opened
        opened.close()


class Visited:
    """A page in a context of its own, with what it complained of and asked for."""

    def __init__(self, browser: Any, address: str, **screen: Any) -> None:
        self.context = browser.new_context(**({"viewport": {"width": 1400, "height": 900}} | screen))
        self.page = self.context.new_page()
        self.complaints: list[str] = []
        self.asked: list[str] = []
        self.page.on("console", lambda m: self.complaints.append(m.text) if m.type == "error" else None)
        self.page.on("pageerror", lambda e: self.complaints.append(str(e)))
        self.page.on("request", lambda r: self.asked.append(r.url))
        self.page.goto(address)
