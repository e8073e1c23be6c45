"""The live view in a browser: pictures follow the text and the file, runs, new scenes, two browsers, lost connections.

What it needs is said in tests/browsed.py.
"""

from __future__ import annotations

import json
import random
import time
from pathlib import Path
from typing import Any

import extras
import pytest

pytestmark = extras.of_file("playwright", "starlette", "uvicorn", "websockets")

from browsed import Visited
from viewed import SCENE, random_edit, served

LONG = 400.0  # s: kernels may have to be compiled


class Visit(Visited):
    """A page of the view."""

    def __init__(self, browser: Any, address: str, **screen: Any) -> None:
        super().__init__(browser, address, **screen)
        self.wait("window.view && view.ready && view.connected")

    def type(self, text: str) -> None:
        """Put a text into the editor, as a paste does."""
        self.page.evaluate("text => view.editor.editor.setValue(text)", text)

    def text(self) -> str:
        return str(self.page.evaluate("view.editor.text()"))

    def wait(self, condition: str) -> None:
        """Look again and again: playwright's own way to wait is forbidden by the policy of the page."""
        end = time.monotonic() + LONG
        while not self.page.evaluate(f"Boolean({condition})"):
            assert time.monotonic() < end, f"waited in vain for {condition}"
            self.page.wait_for_timeout(20)

    def title(self, text: str) -> None:
        """Wait for the picture of a scene with this title."""
        self.wait(f"document.getElementById('title').textContent === {json.dumps(text)}")

    def good(self) -> None:
        self.wait("document.getElementById('verdict').className === 'good'")

    def ink(self, canvas: str = "#space") -> int:
        """Pixels of a canvas that are not of one colour with its background."""
        return int(self.page.evaluate(
            "canvas => { const c = document.querySelector(canvas), d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;"
            " let n = 0; for (let k = 3; k < d.length; k += 4) if (d[k] > 0) n++; return n; }",
            canvas,
        ))  # fmt: skip


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    file = tmp_path / "scene.yaml"
    file.write_text(SCENE)
    return file


@pytest.mark.long
def test_a_scene_is_seen_changed_run_played_and_saved(browser: Any, scene: Path) -> None:
    with served(scene) as (address, _):
        visit = Visit(browser, address)
        visit.title("A line")
        visit.good()
        assert visit.ink() > 2000
        assert visit.ink("#graphs canvas") > 5000
        visit.page.hover("#graphs canvas", position={"x": 300, "y": 100})
        assert {"tension", "|moment|", "clearance", "rod"} <= set(visit.page.inner_text("#graphs .tip").split())
        assert "rod" in visit.page.inner_text("#legend")
        # what is wrong stands at its line, and the picture stays
        visit.type(SCENE.replace("mass: 2.0", "mass: -2.0"))
        visit.wait("document.querySelector('#list .problem')")
        assert "line 6" in visit.page.inner_text("#list")
        assert visit.page.query_selector(".CodeMirror .line-problem") is not None
        assert visit.ink() > 2000 and "last good" in visit.page.inner_text("#verdict")
        assert visit.page.is_disabled("#run")
        # the file, changed elsewhere, is not taken over what is unsaved; saved elsewhere after that it is
        visit.type(SCENE.replace("A line", "Mine"))
        visit.title("Mine")
        visit.page.keyboard.press("Control+s")
        visit.wait("document.getElementById('save').disabled")
        assert "title: Mine" in scene.read_text()
        scene.write_text(SCENE.replace("A line", "From another editor"))
        visit.title("From another editor")
        assert "From another editor" in visit.text()
        # run, and the result
        visit.page.focus("#fit")
        visit.page.keyboard.press("Control+Enter")
        visit.wait("document.getElementById('progress-text').textContent.includes('complete') && view.frames > 10")
        visit.wait("view.frame === view.frames - 1")  # a run that is followed is shown as it is now
        visit.page.click("#play")
        visit.wait("view.frame > 2")
        visit.page.click("#play")
        assert scene.with_suffix(".h5").exists()
        assert sorted(x.name for x in scene.parent.iterdir()) == ["scene.h5", "scene.yaml"]
        assert not visit.complaints and visit.page.evaluate("view.errors") == 0
        host = address.split("/")[2]
        assert all(url.split("/")[2] == host for url in visit.asked if url.startswith("http"))
        visit.context.close()


@pytest.mark.slow
def test_a_new_scene_by_five_questions_and_its_completion(
    browser: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with served(None) as (address, _):
        visit = Visit(browser, address)
        assert len(visit.page.query_selector_all("#examples button")) > 10
        visit.page.click("text=suspended span")
        visit.page.fill("#answer-distance", "200")
        visit.page.click("text=Make the scene")
        visit.title("Span of 200 m in the wind")
        visit.good()
        assert not list(tmp_path.iterdir()), "nothing is written until it is saved"
        visit.page.click("#save")
        visit.page.fill("#answer", "span")
        visit.page.click("#choices button.main")
        visit.wait("document.getElementById('file').textContent === 'span.yaml'")
        assert (tmp_path / "span.yaml").read_text() == visit.text()
        # completion and help
        put = "([line, text]) => { const e = view.editor.editor; e.replaceRange(text, {line, ch: 0}); e.setCursor(line, text.length); }"
        last = visit.page.evaluate("view.editor.editor.lineCount()") - 1
        visit.page.evaluate(put, [last, "dimen"])
        assert visit.page.evaluate("view.editor.hints().list.map(x => x.text)") == ["dimension: "]
        visit.page.evaluate(put, [last, "contact: {self: t"])
        assert visit.page.evaluate("view.editor.hints().list.map(x => x.text)") == ["true"]
        lines = visit.text().splitlines()
        row = next(k for k, line in enumerate(lines) if "axial_stiffness" in line)
        about = visit.page.evaluate("([l, c]) => view.editor.aboutAt(l, c)", [row, lines[row].index("axial") + 3])
        assert "(N)" in about
        # help under the mouse goes when one writes, and comes back when the mouse is moved, not when the text moves
        tip, at = "#editor > .tip", {"line": row, "ch": lines[row].index("axial") + 3}
        place = visit.page.evaluate(
            "at => { const e = view.editor.editor; e.setCursor({line: 0, ch: 0}); e.scrollIntoView(at, 60);"
            " const p = e.charCoords(at, 'window'); return [p.left, (p.top + p.bottom) / 2]; }", at
        )  # fmt: skip
        visit.page.mouse.move(*place)
        visit.wait(f"!document.querySelector('{tip}').hidden")
        assert "(N)" in visit.page.inner_text(tip)
        visit.page.focus("#editor textarea")
        for key in ("ArrowDown", "a"):
            visit.page.keyboard.press(key)
            for _ in range(20):
                assert visit.page.is_hidden(tip)
                visit.page.wait_for_timeout(20)
        visit.page.keyboard.press("Escape")
        visit.page.mouse.move(place[0] + 1, place[1])
        visit.wait(f"!document.querySelector('{tip}').hidden")
        assert not visit.complaints
        visit.context.close()


@pytest.mark.long
def test_two_browsers_and_a_lost_connection_lose_nothing(browser: Any, scene: Path) -> None:
    with served(scene) as (address, session):
        one, two = Visit(browser, address), Visit(browser, address)
        for visit in (one, two):
            visit.title("A line")
        one.type(SCENE.replace("A line", "By one"))
        two.title("By one")
        assert two.text() == one.text()
        # the lid is closed: what is written meanwhile, here and there, is merged when it opens
        two.context.set_offline(True)
        for client in list(session._clients)[1:]:
            client.waiting.put_nowait(None)  # the connection ends
        two.wait("!view.connected")
        two.type(two.text().replace("mass: 2.0", "mass: 2.5"))
        one.type(one.text().replace("duration: 4.0", "duration: 5.0"))
        two.context.set_offline(False)
        both = "view.editor.text().includes('mass: 2.5') && view.editor.text().includes('duration: 5.0')"
        for visit in (one, two):
            visit.wait(both)
            visit.good()
        assert one.text() == two.text()
        assert one.page.evaluate("view.errors") == two.page.evaluate("view.errors") == 0
        one.context.close()
        two.context.close()


def hammer(browser: Any, scene: Path, count: int, seed: int) -> None:
    """Random edits in a page, faster than pictures can be computed: no error, and a page that lives."""
    rng, text = random.Random(seed), SCENE
    with served(scene) as (address, _):
        visit = Visit(browser, address)
        visit.good()
        for k in range(count):
            text = random_edit(rng, text if rng.random() < 0.6 and text else SCENE)
            visit.type(text)
            visit.page.wait_for_timeout(rng.choice((0, 20, 120)))
            if k % 50 == 49:
                assert "Traceback" not in visit.page.inner_text("#list")
        visit.type(SCENE.replace("A line", "The end"))
        visit.title("The end")
        visit.good()
        assert visit.ink() > 2000
        assert visit.page.evaluate("view.errors") == 0 and not visit.complaints
        assert scene.read_text() == SCENE, "nothing is written unasked"
        visit.context.close()


@pytest.mark.parametrize(
    "many", [pytest.param(200, marks=pytest.mark.slow), pytest.param(1000, marks=pytest.mark.bench)]
)
def test_random_edits_leave_the_page_alive(browser: Any, scene: Path, many: int) -> None:
    hammer(browser, scene, many, 4)


@pytest.mark.slow
@pytest.mark.needs("axe-playwright-python")
def test_nothing_is_out_of_reach_of_a_screen_reader(browser: Any, scene: Path) -> None:
    from axe_playwright_python.sync_playwright import Axe

    axe = Axe()
    with served(scene) as (address, _):
        for scheme in ("light", "dark"):
            visit = Visit(browser, address, color_scheme=scheme)
            visit.good()
            found = axe.run(visit.page).response["violations"]
            worst = [
                (x["id"], [n["target"] for n in x["nodes"]]) for x in found if x["impact"] in ("serious", "critical")
            ]
            assert not worst
            visit.context.close()
