"""The live view: from a save of the scene to the new picture in view, in headless Chromium.

    pytest bench/test_bench_view.py -m bench -n 0 -s

The clock starts before the file is written, and stops when the browser has painted the picture of that text.  Also the
part of it that is computing: CPU time of a picture in a process that has made one before.

And from the command `hybrid view scene.yaml` to the first picture, kernels and byte code being there.
"""

from __future__ import annotations

import json
import os
import resource
import shutil
import signal
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

sync_api = pytest.importorskip("playwright.sync_api")
pytest.importorskip("starlette")
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "live"))
from viewed import served  # noqa: E402

from hybrid.live.pictures import picture_of  # noqa: E402

pytestmark = pytest.mark.bench

TOUCHDOWN = (Path(__file__).parents[1] / "examples" / "touchdown.yaml").read_text(encoding="utf-8")
WATCH = """() => { window.seen = []; let was = view.drawn;
  const look = () => { if (view.drawn !== was) { was = view.drawn; requestAnimationFrame(() => setTimeout(() => seen.push(Date.now()))); } setTimeout(look, 1); };
  look(); }"""


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    found = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    with sync_api.sync_playwright() as play:
        opened = play.chromium.launch(executable_path=found, args=["--no-sandbox", "--disable-gpu"])
        yield opened
        opened.close()


def scene_of(cells: int, model: str, k: int) -> str:
    """The touchdown scene; every k is another place of the fairlead."""
    text = TOUCHDOWN.replace("mesh: {cells: 100}", f"mesh: {{cells: {cells}}}")
    text = text.replace("model: {kind: adaptive, tolerance: 2.0e-5}", f"model: {model}")
    return text.replace("[205, 0, 0]", f"[{200 + k % 9}.{k:03d}, 0, 0]")


@pytest.mark.parametrize(("cells", "model", "edits", "most"), [(200, "rod", 200, 0.15), (200, "adaptive", 60, 0.15), (5000, "catenary", 40, 1.0), (5000, "rod", 40, 1.0)])  # fmt: skip
def test_from_save_to_picture(browser: Any, tmp_path: Path, cells: int, model: str, edits: int, most: float) -> None:
    file = tmp_path / "scene.yaml"
    file.write_text(scene_of(cells, model, 0))
    spent = []
    for k in range(6):
        begin = time.process_time()
        assert picture_of(scene_of(cells, model, k), "", lambda: None)[0]["problems"] == []
        spent.append(time.process_time() - begin)
    found = []
    with served(file) as (address, _):
        page = browser.new_context(bypass_csp=True, viewport={"width": 1400, "height": 900}).new_page()
        page.goto(address)
        page.wait_for_function("view.drawn >= 0", timeout=120_000)
        page.evaluate(WATCH)
        for k in range(1, edits + 1):
            begin = time.time()
            file.write_text(scene_of(cells, model, k))
            page.wait_for_function("n => seen.length >= n", arg=k, timeout=60_000, polling=5)
            found.append(page.evaluate(f"seen[{k - 1}]") / 1e3 - begin)
            time.sleep(0.05)
        page.context.close()
    found.sort()
    middle, late = statistics.median(found), found[int(0.95 * len(found))]
    load = os.getloadavg()[0]
    print(f"\n{cells} cells, {model}: median {1e3 * middle:.0f} ms, 95th percentile {1e3 * late:.0f} ms of {edits} edits; "
          f"computing {1e3 * statistics.median(spent[1:]):.0f} ms of CPU; load {load:.1f}")  # fmt: skip
    assert late <= most


def test_from_the_command_to_the_first_picture(browser: Any, tmp_path: Path) -> None:
    """A browser that is open, as a user has it: the fifth of five starts, wall time until painted and the server's CPU time."""
    file = tmp_path / "scene.yaml"
    file.write_text(TOUCHDOWN)
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    environment["PYTHONPYCACHEPREFIX"] = str(tmp_path / "bytes")
    walls, spent = [], []
    for _ in range(6):
        page = browser.new_context(bypass_csp=True, viewport={"width": 1400, "height": 900}).new_page()
        before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        command = [sys.executable, "-m", "hybrid", "view", "--no-browser", "--json", file.name]
        with subprocess.Popen(command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, text=True) as child:
            assert child.stdout is not None
            page.goto(json.loads(child.stdout.readline())["address"])
            page.wait_for_function("view.drawn >= 0", timeout=120_000, polling=5)
            walls.append(time.perf_counter() - begin)
            page.context.close()
            child.send_signal(signal.SIGINT)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    wall, cpu = (statistics.median(x[1:]) for x in (walls, spent))
    print(f"\nfrom the command to the first picture: median {wall:.2f} s of wall time, least {min(walls):.2f} s, "
          f"{cpu:.2f} s of CPU time of hybrid until it ended; load {os.getloadavg()[0]:.1f}")  # fmt: skip
