"""A result in a notebook: its figure in space, a page made of the notebook in a browser, progress as a widget."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from reported import reported

import hybrid
from hybrid.simulation import progress
from hybrid.simulation.progress import Progress, StatusLine, listener_of
from hybrid.view.figure import KIND_COLOURS
from hybrid.view.report import MIME, MOST_FRAMES, MOST_POINTS, bundle, picture

CELL = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parents[1])!r})
from hybrid.simulation.progress import Progress, listener_of
from reported import reported
tell = listener_of(True)  # what `hybrid.run(.., progress=True)` calls
for t in (2.0, 10.0):
    tell(Progress(t, 10.0, 5, 3, (), 0.5, fraction=t / 10.0))
tell.close()
reported(outputs=41)
"""


@pytest.fixture(scope="module")
def figure() -> Any:
    return hybrid.plot_space(reported(outputs=301, points=201))


def curves(traces: Any) -> list[Any]:
    return [trace for trace in traces if trace.type == "scatter3d" and trace.mode == "lines" and trace.x[0] is not None]


def test_the_slider_has_the_moments_of_the_result(figure: Any) -> None:
    result = reported(outputs=301, points=201)
    steps = figure.layout.sliders[0].steps
    assert len(steps) == len(figure.frames) == MOST_FRAMES
    for k, output in ((0, 0), (40, 150), (80, 300)):
        assert float(steps[k].label) == pytest.approx(result.times[output], rel=1e-3)
        frame = next(frame for frame in figure.frames if frame.name == steps[k].args[0][0])
        (line,) = curves(frame.data)
        assert len(line.x) == MOST_POINTS
        drawn = np.column_stack([line.x, line.y, line.z])
        places = result.at(s=np.asarray(line.customdata), names=["position"])["position"][output]
        assert np.abs(drawn - places).max() < 1e-3  # of four bytes, at points that are nearly those of s
        assert figure.data[frame.traces[0]].type == "scatter3d"


def test_what_is_drawn_besides(figure: Any) -> None:
    assert {"seabed", "touchdown", "start", "end", "catenary", "rod"} <= {trace.name for trace in figure.data}
    low, high = figure.layout.scene.zaxis.range
    assert low <= -30.0 <= high, "the seabed is in the box"


def test_colours_and_refusals() -> None:
    result = reported()
    line = curves(hybrid.plot_space(result, "tension").frames[5].data)[0].line
    assert np.allclose(line.color, 1e-3 * result.tension[5], rtol=1e-5) and line.showscale  # kN
    with pytest.raises(hybrid.ResultError, match="zone or tension or curvature"):
        hybrid.plot_space(result, "colour")
    with pytest.raises(hybrid.ResultError, match="no output"):
        hybrid.plot_space(reported(outputs=0))
    still = hybrid.plot_space(reported(outputs=1))
    assert not still.frames and not still.layout.sliders


def test_a_cell_is_small_and_brings_the_script_once(figure: Any) -> None:
    later = bundle(figure, with_script=False)
    assert len(str(later[MIME])) < 500e3 and len(later["text/html"]) < 500e3
    assert "DecompressionStream" in bundle(figure, with_script=True)["text/html"]
    assert "<script>" in later["text/html"] and "</script>" not in later["text/html"][:-9]
    hostile = bundle(hybrid.plot_space(reported(title="</script><b>x")), with_script=False)["text/html"]
    assert hostile.count("</script>") == 1 and "<b>" not in hostile


def test_outside_a_notebook_ipython_shows_something_else() -> None:
    with pytest.raises(NotImplementedError):  # IPython's sign for it
        reported()._ipython_display_()


def test_progress_is_text_where_there_is_no_notebook_or_no_widget(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert isinstance(listener_of(True), StatusLine)
    monkeypatch.setattr("hybrid.simulation.progress.in_notebook", lambda: True)
    monkeypatch.setitem(__import__("sys").modules, "ipywidgets", None)
    assert isinstance(listener_of(True), StatusLine)
    assert 'pip install "hybrid-cable[notebook]"' in capsys.readouterr().err
    assert listener_of(False) is None


@pytest.mark.needs("ipywidgets")
def test_the_bar_follows_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    import ipywidgets as widgets

    bar = progress.NotebookBar(widgets)
    shown: list[Any] = []
    monkeypatch.setattr("IPython.display.display", shown.append)
    for t in (1.0, 4.0):
        bar(Progress(t, 10.0, 5, 3, (), 0.5, fraction=t / 10.0))
    (box,) = shown
    assert box.children[0].value == 0.4 and "40 % done" in box.children[1].value
    bar.close()
    assert box.children[0].bar_style == "warning"


@pytest.mark.slow  # a kernel, and a browser that starts plotly
@pytest.mark.needs("nbconvert", "ipykernel", "ipywidgets", "playwright")
def test_a_notebook_made_into_a_page_moves_its_line(tmp_path: Path, browser: Any) -> None:
    """Executed by nbclient, exported by nbconvert, opened in Chromium without a network: the slider moves the line."""
    import nbclient
    import nbconvert
    import nbformat

    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(CELL)])
    nbclient.NotebookClient(book, kernel_name="python3", timeout=300).execute()
    outputs = [output for output in book.cells[0].outputs if "data" in output]
    assert [k for output in outputs for k in output["data"] if "json" in k] == [
        "application/vnd.jupyter.widget-view+json",
        MIME,
    ]
    states = book.metadata.widgets["application/vnd.jupyter.widget-state+json"]["state"].values()
    (bar,) = [x["state"] for x in states if x["model_name"] == "FloatProgressModel"]
    (words,) = [x["state"] for x in states if x["model_name"] == "LabelModel"]
    assert bar["value"] == 1.0 and "100 % done" in words["value"]

    page_file = tmp_path / "book.html"
    page_file.write_text(nbconvert.HTMLExporter().from_notebook_node(book)[0], encoding="utf-8")
    page = browser.new_page(viewport={"width": 1000, "height": 1100})
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.route("http*://**", lambda route: route.abort())  # what nbconvert's page asks for: RequireJS and MathJax
    page.goto(page_file.as_uri())
    page.wait_for_selector("[data-drawn]", timeout=60_000)
    end = "(() => { const all = document.querySelector('[data-drawn]')._fullData.filter((x) => x.mode === 'lines');"
    end += " return all[0].z[all[0].z.length - 1]; })()"
    assert page.evaluate(end) == pytest.approx(0.0, abs=1e-6)
    rail = page.query_selector(".slider-rail-touch-rect")
    rail.scroll_into_view_if_needed()
    box = rail.bounding_box()
    heights = []
    for part in (0.25, 0.75):
        page.mouse.click(box["x"] + part * box["width"], box["y"] + box["height"] / 2)
        page.wait_for_timeout(500)
        heights.append(page.evaluate(end))
    assert heights == pytest.approx([2.0, -2.0], abs=0.1), "the end heaves by 2 m every 10 s"
    from PIL import Image

    picture = Image.open(io.BytesIO(page.query_selector("[data-drawn]").screenshot())).convert("RGB")
    blue = (np.abs(np.asarray(picture).astype(int) - (0x00, 0x72, 0xB2)).max(axis=2) < 40).sum()
    assert blue > 300 and not problems, "the line in the colour of catenaries"
    page.close()


# What a notebook shows of a result: light, still, safe, and never an error.


def test_a_result_shows_itself_with_facts_and_a_picture() -> None:
    shown = reported()._repr_html_()
    for words in ("Made-up mooring", "complete", "21 outputs", "Largest tension", "21 kN", "<svg", "On the seabed"):
        assert words in shown
    assert len(shown) < 40_000 and "<script" not in shown and "plotly" not in shown


def test_the_picture_shows_zones_in_their_colours() -> None:
    drawing = ElementTree.fromstring(picture(reported()))
    space = "{http://www.w3.org/2000/svg}"
    lines = [x.get("stroke") for x in drawing.iter(f"{space}path")]
    assert lines[-3:] == [KIND_COLOURS["catenary"], KIND_COLOURS["rod"], KIND_COLOURS["catenary"]]
    strips = {x.get("fill") for x in drawing.iter(f"{space}rect")}
    assert strips == {KIND_COLOURS["catenary"], KIND_COLOURS["rod"]}
    width, height = (float(x) for x in drawing.get("viewBox", "").split()[2:])
    assert all(float(x.get("x", 0)) + float(x.get("width", 0)) < width for x in drawing.iter(f"{space}rect"))
    assert all(float(x.get("y", 0)) < height for x in drawing.iter(f"{space}text"))


@pytest.mark.parametrize(
    "asked",
    [{"outputs": 0}, {"outputs": 1}, {"outputs": 2, "rod": False, "seabed": False, "energy": False}, {"points": 2}],
    ids=str,
)
def test_it_never_raises(asked: dict) -> None:
    result = reported(**asked)
    assert "Made-up mooring" in result._repr_html_()
    result.close()
    assert "Made-up mooring" in result._repr_html_()  # closed: what was read is there, or its name at least


def test_a_closed_result_shows_its_name(monkeypatch: pytest.MonkeyPatch) -> None:
    result = reported(title="<b>odd</b>")
    result.close()
    monkeypatch.setattr("hybrid.view.report.card", lambda result: 1 / 0)
    assert result._repr_html_().startswith("<pre>") and "<b>" not in result._repr_html_()
    monkeypatch.setattr(type(result), "__repr__", lambda self: str(1 / 0))
    assert "can no longer be read" in result._repr_html_()


def test_titles_are_escaped_and_failures_said() -> None:
    shown = reported(title="<script>x</script>", status="failed", message="it diverged\n  try: less")._repr_html_()
    assert "<script>" not in shown and "&lt;script&gt;" in shown and "failed: it diverged" in shown


def test_a_cell_of_a_long_run_is_small() -> None:
    assert len(reported(outputs=501)._repr_html_()) < 100e3
