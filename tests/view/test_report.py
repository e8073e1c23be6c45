"""The report as a file: it holds what it should for every kind of result, harms no other file, and asks for nothing."""

from __future__ import annotations

import gzip
import json
import os
import re
from base64 import b64decode
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reported import reported

import hybrid
from hybrid.errors import ResultError
from hybrid.view.curves import MOST_VALUES, kept, outline
from hybrid.view.report import html, write_report
from hybrid.view.report_parts import verdict_html
from hybrid.view.summary import facts_of
from tests.scenes import cable_scene, pinned_at, pulled, span


def index_of(page: str) -> dict[str, Any]:
    found = re.search(r'<script type="application/json" id="index">(.*?)</script>', page, re.DOTALL)
    assert found
    return json.loads(found[1])


def block_of(page: str, name: str) -> bytes:
    found = re.search(rf'<script type="text/plain" id="{name}">(.*?)</script>', page, re.DOTALL)
    assert found
    return gzip.decompress(b64decode(found[1]))


def array(page: str, ref: dict[str, Any]) -> np.ndarray:
    kind = {"f4": "<f4", "u1": "<u1"}[ref["type"]]
    count = int(np.prod(ref["shape"]))
    return np.frombuffer(block_of(page, "data"), kind, count, ref["$at"]).reshape(ref["shape"])


def highest(page: str, label: str) -> dict[str, Any]:
    """The curve of highest values along s of a range graph, by what stands on its axis."""
    figures = [f for f in index_of(page)["figures"] if f["layout"]["yaxis"]["title"]["text"] == label]
    return next(trace for f in figures for trace in f["data"] if trace["name"] == "highest")


def text_of(page: str) -> str:
    body = page[page.index("<body>") : page.index('<script type="application/json"')]
    return unescape(re.sub(r"<[^>]*>", " ", body))


CASES: dict[str, dict[str, Any]] = {
    "usual": {},
    "with everything": {
        "errors": True,
        "allowed": 60.0,
        "torque": 2000.0,
        "events": [(5.0, 40.0, 60.0, "split", "bend")],
    },
    "static": {"outputs": 1},
    "two outputs": {"outputs": 2},
    "no output": {"outputs": 0, "status": "failed", "message": "nothing moved"},
    "bare": {"rod": False, "seabed": False, "energy": False, "steps": False},
    "bare and static": {"rod": False, "seabed": False, "energy": False, "outputs": 1},
    "interrupted": {"status": "interrupted", "message": "stopped from outside"},
    "failed": {"status": "failed", "message": "it diverged\n    try:      smaller steps", "outputs": 4},
    "a point": {"points": 1},
    "two points": {"points": 2},
    "long": {"outputs": 1501, "points": 301},
}


@pytest.mark.long
@pytest.mark.parametrize("case", CASES)
def test_every_kind_of_result_has_a_report(case: str) -> None:
    result = reported(**CASES[case])
    page, n = html(result), len(result.times)
    index = index_of(page)
    text = text_of(page)
    assert "{{" not in page[: page.index('id="plotly"')] and "How it ended" in text
    assert (index["scene"] is None) == (n == 0)
    keys = set(re.findall(r'id="plot-([\w-]+)"', page))
    assert ("range-tension" in keys) == (n > 0)
    assert ("zones" in keys) == ("end-forces" in keys or case == "bare") == (n > 1)
    assert ("energy" in keys) == (n > 1 and "bare" not in case)
    assert ('id="play"' in page) == (n > 1)
    if result.status != "complete":
        assert "Look at this first" in text and result.message.split("\n")[0] in text
    size = len(page.encode())
    assert 1.5e6 < size < 8e6
    for ref in re.findall(r'\{"\$at":\d+,"type":"\w+","shape":\[[\d,]*\]', page):  # every reference is inside the block
        array(page, json.loads(ref + "}"))


@pytest.mark.long
def test_what_is_drawn_is_what_is_in_the_file() -> None:
    result = reported()
    page = html(result)
    scene = index_of(page)["scene"]
    for k, axis in enumerate("xyz"):
        assert array(page, scene[axis]) == pytest.approx(result.position[..., k], abs=1e-4)
    tension = next(c for c in scene["colours"] if c["key"] == "tension")
    assert tension["unit"] == "kN" and array(page, tension["values"]) == pytest.approx(result.tension / 1e3, rel=1e-6)
    zone = next(c for c in scene["colours"] if c["key"] == "zone")
    kinds = [name for name, _ in zone["legend"]]
    last = [kinds[k] for k in array(page, zone["values"])[-1]]
    assert last[20] == "rod" and last[0] == last[-1] == "catenary" and set(array(page, zone["values"])[0]) == {0}
    high = highest(page, "tension (kN)")
    assert array(page, high["y"]) == pytest.approx(result.tension.max(axis=0) / 1e3, rel=1e-6)


@pytest.mark.long
def test_a_long_run_is_thinned_and_says_so_but_its_extremes_are_exact() -> None:
    short, long = reported(), reported(outputs=1501, points=301)
    assert "To keep this file small" not in html(short)
    page = html(long)
    assert "Long curves are drawn by the lowest" in page
    scene = index_of(page)["scene"]
    nf, ns = array(page, scene["x"]).shape
    assert nf * ns <= MOST_VALUES + 20 * ns and ns <= 251
    notice = re.search(r'id="thinned">(.*?)<', page)
    assert notice and f"{nf} of 1501 outputs and {ns} of 301 points" in notice[1]
    when = [fact.t for fact in hybrid.view.summary.facts_of(long) if fact.t is not None]
    assert set(when) <= set(scene["times"]), "the moments of the summary are among the frames"
    peak = array(page, highest(page, "tension (kN)")["y"]).max()
    assert peak == pytest.approx(long.tension.max() / 1e3, rel=1e-6)


def test_a_map_of_many_events_says_that_it_marks_the_worst() -> None:
    events = [(0.001 * k, 0.0, 10.0, "snap" if k % 100 == 0 else "grow", f"number {k}") for k in range(2000)]
    page = html(reported(events=events))
    assert "Of 2000 events the 600 that matter most are marked." in page and "1600 more are in the result file" in page
    marks = {t["name"]: t for f in index_of(page)["figures"] for t in f["data"] if t.get("mode") == "markers"}
    assert len(marks["warning"]["x"]) == 20 and len(marks["grow"]["x"]) == 580


def test_thinning_keeps_ends_peaks_and_asked_moments() -> None:
    y = np.sin(np.linspace(0.0, 50.0, 100_001))
    y[77_777], y[22_222] = 5.0, -7.0
    k = outline(y, 400)
    assert len(k) <= 402 and {0, 100_000, 77_777, 22_222} <= set(k.tolist()) and (np.diff(k) > 0).all()
    y[40_000:40_003] = np.nan  # a short gap stays one, with its rims, and hides no peak beside it
    y[40_010] = 9.0
    k = outline(y, 400)
    assert len(k) <= 408 and {39_999, 40_000, 40_002, 40_003, 40_010} <= set(k.tolist())
    shown = kept(reported(outputs=1501, points=301), [3.215, None])
    assert {0, 1500} <= set(shown.frames.tolist()) and shown.points[[0, -1]].tolist() == [0, 300]
    assert 482 in shown.frames.tolist()  # t = 3.2133 s, the output nearest to 3.215 s


def test_texts_of_the_scene_cannot_become_markup() -> None:
    evil = '</script><script>window.evil = 1</script><img src=x onerror="window.evil = 1">'
    events = [(1.0, 0.0, 10.0, "snap", evil), (6.0, 40.0, 60.0, "split", evil)]
    page = html(reported(title=evil, scene=f"title: {evil}\n# {{{{plotly}}}} <!-- ", events=events))
    assert "<script>window.evil" not in page and "<img" not in page.replace("<image", "")
    assert page.count("<script") == page[: page.index('id="plotly"')].count("<script") + 1
    labels = [text for f in index_of(page)["figures"] for t in f["data"] for text in t.get("text", [])]
    assert labels and not any("<script" in text or "<img" in text for text in labels)
    assert "{{plotly}}" in page, "text of a scene is no placeholder"


def test_nothing_is_asked_for_from_outside() -> None:
    page = html(reported())
    shell = page[: page.index('id="plotly"')] + page[page.index("<script>", page.index('id="plotly"')) :]
    links = re.findall(r"""(?:src|href|action)\s*=\s*["']?([^"'\s>]+)|url\(([^)]*)\)|@import""", shell)
    assert {a or b for a, b in links if not a.startswith(("#", "data:image/png;base64,"))} == {"data:,"}
    assert "default-src 'none'" in page and "showSendToCloud: false" in page
    assert not re.search(r"https?://(?!www\.w3\.org/2000/svg)", shell)


@pytest.mark.long
def test_only_a_report_of_ours_is_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    result, page = reported(outputs=2), tmp_path / "run.html"
    assert hybrid.report(result, page) == page
    before = page.read_bytes()
    hybrid.report(result, str(page))
    assert page.read_bytes() == before and [x.name for x in tmp_path.iterdir()] == ["run.html"]
    other = tmp_path / "other.html"
    other.write_text("<html>mine</html>")
    for target, words in (
        (other, "was not made by hybrid"),
        (tmp_path, "is a folder"),
        (tmp_path / "missing" / "run.html", "there is no folder"),
    ):
        with pytest.raises(ResultError, match=words) as refused:
            write_report(result, target)
        assert "    try:      " in str(refused.value)
    assert other.read_text() == "<html>mine</html>"

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(ResultError, match=r"cannot be written\n    detail:   .*No space left"):
        write_report(result, page)
    assert page.read_bytes() == before and len(list(tmp_path.iterdir())) == 2


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
def test_a_read_only_folder_is_refused(tmp_path: Path) -> None:
    tmp_path.chmod(0o555)
    with pytest.raises(ResultError, match="cannot be written"):
        write_report(reported(outputs=2), tmp_path / "run.html")
    tmp_path.chmod(0o755)


def test_statistics_are_those_of_the_histories() -> None:
    result = hybrid.run(
        cable_scene({"length": 30, "mass": 2, "axial_stiffness": 1e5, "diameter": 0.05, "drag": {"normal": 1.2}},
                    pinned_at(0, 0, 0), pinned_at(20, 0, 0), initial={"kind": "equilibrium", "guess": "catenary"},
                    model="catenary", mesh=10, time=(6, 0.1),
                    output={"every": 0.1,
                            "quantities": {"hang_off": {"kind": "end_angle", "end": "end", "direction": [0, 0, -1],
                                                        "largest": 10}}}) | {"environment": {"fluid": {"density": 1.2, "current": {"kind": "uniform", "velocity": [0, 9, 0], "ramp": 2}}}}
    )  # fmt: skip
    page = text_of(html(result))
    found = result.statistics()["hang_off"]
    row = re.search(r"hang_off \(deg\)\s+([\d.]+)\s+([\d.]+)\s+([\d.]+)\s+([\d.]+)", page)
    assert re.search(r"Statistics of \d histories", page) and row
    expected = [found.mean, found.standard_deviation, found.minimum, found.maximum]
    assert [float(x) for x in row.groups()] == pytest.approx([float(x) for x in expected], rel=1e-3)
    assert "Hang off" in page and "above the 10 deg allowed" in page


def test_the_head_counts_limits_of_quantities() -> None:
    """It said that there were no limits, or that the one was kept."""
    head = verdict_html(facts_of(hybrid.static(span(output=pulled("pull", 1e5)))), False)
    assert "no limits were given" not in head and "1 of 1 limits not verified" in head
