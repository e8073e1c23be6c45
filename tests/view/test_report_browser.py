"""The report in a browser, without a screen: it opens, moves, explains itself, fits a phone, and complains of nothing.

What it needs is said in tests/browsed.py.
"""

from __future__ import annotations

import io
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import extras
import numpy as np
import pytest

pytestmark = extras.of_file("playwright")

from browsed import Visited
from PIL import Image
from reported import reported

import hybrid
from hybrid.view.report import write_report

DRAWN = "document.getElementById('plot-end-forces').classList.contains('drawn')"
EVENTS = [(5.5, 40.0, 60.0, "split", "bend 1.05 > 1 at s = 49 to 51 m"), (7.0, 0.0, 100.0, "snap", "a <b>peak</b>")]


@pytest.fixture(scope="module")
def page_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    result = reported(events=EVENTS, errors=True, allowed=60.0, outputs=101)
    return write_report(result, tmp_path_factory.mktemp("report") / "run.html")


class Visit(Visited):
    """A report that is open, with the seconds that it took."""

    def __init__(self, browser: Any, file: Path, cable: bool = True, **screen: Any) -> None:
        """cable: whether to look at the cable, which is drawn then, and go back to the top."""
        begin = time.perf_counter()
        super().__init__(browser, file.resolve().as_uri(), **({"viewport": {"width": 1280, "height": 900}} | screen))
        self.page.wait_for_function("window.report && window.report.ready", timeout=60_000)
        self.seconds = time.perf_counter() - begin
        if cable and self.page.query_selector("#cable-plot"):
            self.shown("#cable-plot")
            self.page.wait_for_function("window.report.cable", timeout=60_000)
            self.page.evaluate("scrollTo(0, 0)")

    def shown(self, selector: str) -> Any:
        """Scroll to an element and wait until plotly has drawn it."""
        self.page.eval_on_selector(selector, "x => x.scrollIntoView({block: 'center'})")
        self.page.wait_for_function(f"document.querySelector('{selector}').querySelector('.main-svg') !== null")
        self.page.wait_for_timeout(300)
        return self.page.query_selector(selector)

    def cable(self) -> np.ndarray:
        """Places of the cable as drawn, (3, ns)."""
        text = "['x', 'y', 'z'].map(a => Array.from(document.getElementById('cable-plot').data[1][a]))"
        return np.array(self.page.evaluate(text))

    def pixels(self, selector: str) -> np.ndarray:
        picture = self.shown(selector).screenshot()
        return np.asarray(Image.open(io.BytesIO(picture)).convert("RGB"), float)


@pytest.fixture
def visit(browser: Any, page_file: Path, request: pytest.FixtureRequest) -> Iterator[Visit]:
    """Of a screen that a test asks for by `on`."""
    opened = Visit(browser, page_file, **getattr(request, "param", {}))
    yield opened
    opened.context.close()
    assert not opened.complaints
    assert [url.split(":")[0] for url in opened.asked if not url.startswith(("data:", "blob:"))] == ["file"]


def on(*screens: dict[str, Any]) -> pytest.MarkDecorator:
    return pytest.mark.parametrize("visit", screens, indirect=True)


@pytest.mark.long
def test_it_opens_complete_and_without_complaint(visit: Visit) -> None:
    for plot in visit.page.query_selector_all(".plot[data-figure]"):
        visit.shown(f"#{plot.get_attribute('id')}")
    assert visit.page.title() == "Made-up mooring"
    assert visit.page.query_selector("#summary").is_visible()
    assert not visit.page.query_selector_all(".problem")
    upload = visit.page.query_selector_all("[data-title*='hare'], [data-title*='loud']")
    assert not upload, "plotly would offer to upload the picture"


@pytest.mark.slow
def test_its_pictures_are_not_blank(visit: Visit) -> None:
    for name in ("cable", "zones", "end-forces", "range-tension", "energy"):
        assert visit.pixels("#cable-plot" if name == "cable" else f"#plot-{name}").std() > 5.0, name


@pytest.mark.long
def test_the_slider_moves_the_cable_and_the_cursors(visit: Visit) -> None:
    first = visit.cable()
    visit.shown("#plot-end-forces")
    visit.page.eval_on_selector("#time", "x => { x.value = '25'; x.dispatchEvent(new Event('input')); }")
    moved = visit.cable()
    s = np.linspace(0.0, 100.0, 41)
    assert moved[2] - first[2] == pytest.approx(2.0 * s / 100.0, abs=1e-4)  # the sine is 1 at t = 2.5 s
    assert visit.page.inner_text("#now") == "t = 2.50 s"
    cursor = visit.page.evaluate("document.getElementById('plot-end-forces').layout.shapes[0].x0")
    assert cursor == pytest.approx(2.5)
    visit.shown("#plot-range-tension")
    now = "document.getElementById('plot-range-tension').data.find(t => t.name === 'now').y[40]"
    assert visit.page.evaluate(now) == pytest.approx(21.0, rel=1e-5)


@pytest.mark.long
def test_play_moves_time_and_stops_again(visit: Visit) -> None:
    visit.page.select_option("#pace", "1")
    visit.page.click("#play")
    visit.page.wait_for_function("window.report.frame > 3", timeout=20_000)
    assert visit.page.inner_text("#play") == "Pause"
    visit.page.click("#play")
    frame = visit.page.evaluate("window.report.frame")
    visit.page.wait_for_timeout(400)
    assert visit.page.evaluate("window.report.frame") == frame and visit.page.inner_text("#play") == "Play"
    visit.page.select_option("#pace", "100")
    visit.page.click("#play")
    visit.page.wait_for_function("document.getElementById('play').textContent === 'Play'", timeout=20_000)
    assert visit.page.evaluate("window.report.frame") == 100, "it ends at the last frame"


@pytest.mark.long
def test_pointing_at_an_event_shows_what_happened(visit: Visit) -> None:
    visit.shown("#plot-zones")
    for name, words in (("split", "bend 1.05 > 1 at s = 49 to 51 m"), ("warning", "a <b>peak</b>")):
        place = """name => {
            const plot = document.getElementById('plot-zones'), box = plot.getBoundingClientRect();
            const trace = plot.data.find(t => t.name === name), {xaxis, yaxis} = plot._fullLayout;
            return [box.x + xaxis._offset + xaxis.d2p(trace.x[0]), box.y + yaxis._offset + yaxis.d2p(trace.y[0])];
        }"""
        x, y = visit.page.evaluate(place, name)
        visit.page.mouse.move(x - 40, y)
        visit.page.mouse.move(x, y)
        visit.page.wait_for_selector("#plot-zones .hoverlayer .hovertext", timeout=5000)
        visit.page.wait_for_timeout(200)
        assert words in visit.page.text_content("#plot-zones .hoverlayer").replace("\xa0", " ")


@pytest.mark.slow
def test_colours_and_axes_switch(visit: Visit) -> None:
    def look() -> tuple[list[float], dict[str, float]]:
        colours = visit.page.evaluate("Array.from(document.getElementById('cable-plot').data[1].line.color)")
        return colours, visit.page.evaluate("document.getElementById('cable-plot').layout.scene.aspectratio")

    zones, equal = look()
    assert set(zones) == {0}  # all of it is catenary at first
    visit.page.click("#colour button:has-text('tension')")
    tension, _ = look()
    assert tension[0] == pytest.approx(10.0) and tension[-1] == pytest.approx(20.0)
    assert visit.page.get_attribute("#colour button:has-text('tension')", "aria-pressed") == "true"
    assert "tension (kN)" in visit.page.inner_text("#cable-legend")
    box = np.array(visit.page.evaluate("document.getElementById('cable-plot').layout.scene").get("xaxis")["range"])
    depth = np.array(visit.page.evaluate("document.getElementById('cable-plot').layout.scene").get("zaxis")["range"])
    assert equal["x"] / equal["z"] == pytest.approx(np.ptp(box) / np.ptp(depth), rel=1e-6)  # one scale for both
    visit.page.click("#axes button:has-text('stretched')")
    _, stretched = look()
    assert stretched["y"] / stretched["x"] > 2.0 * equal["y"] / equal["x"]
    assert "Axes stretched: y ×" in visit.page.inner_text("#cable-said")


@pytest.mark.slow
def test_show_takes_the_reader_to_the_moment(visit: Visit) -> None:
    visit.page.click("#fact-tension button.show")
    assert visit.page.inner_text("#now") == "t = 2.50 s"
    marked = visit.page.evaluate("['x', 'z'].map(a => document.getElementById('cable-plot').data[2][a].at(-1))")
    assert marked == pytest.approx([90.0, 2.0], abs=1e-3)  # the end, where the tension is largest
    visit.page.click("#events tr.warning")
    assert visit.page.inner_text("#now") == "t = 7.00 s"


@pytest.mark.slow
@on({"viewport": {"width": 390, "height": 844}, "is_mobile": True, "has_touch": True})
def test_a_phone_shows_it_without_scrolling_sideways(visit: Visit) -> None:
    for plot in visit.page.query_selector_all(".plot[data-figure]"):
        visit.shown(f"#{plot.get_attribute('id')}")
    assert visit.page.evaluate("document.documentElement.scrollWidth") == 390
    for target in visit.page.query_selector_all("button, select, input, summary"):
        size = target.bounding_box()
        assert size and size["height"] >= 44 and size["width"] >= 44 and size["x"] + size["width"] <= 390
    small = visit.page.evaluate(
        "[...document.querySelectorAll('.plot text')].map(x => parseFloat(getComputedStyle(x).fontSize)).filter(x => x < 11)"
    )
    assert not small


@pytest.mark.parametrize(
    "asked",
    [
        pytest.param({"outputs": 1}, marks=pytest.mark.slow),
        {"outputs": 0, "status": "failed", "message": "nothing moved"},
        pytest.param(
            {
                "rod": False,
                "seabed": False,
                "energy": False,
                "steps": False,
                "status": "interrupted",
                "message": "Ctrl-C",
            },
            marks=pytest.mark.slow,
        ),
        {"title": "<script>window.evil = 1</script><img src=x onerror='window.evil = 1'>", "outputs": 3}
        | {
            "scene": "</script><script>window.evil = 1</script>",
            "events": [(1, 0, 9, "snap", "<img src=x onerror=evil()>")],
        },
    ],
    ids=["static", "no output", "bare", "hostile"],
)
def test_other_results_open_without_complaint(browser: Any, tmp_path: Path, asked: dict[str, Any]) -> None:
    opened = Visit(browser, write_report(reported(**asked), tmp_path / "run.html"))
    for plot in opened.page.query_selector_all(".plot[data-figure]"):
        opened.shown(f"#{plot.get_attribute('id')}")
    assert not opened.complaints and opened.page.evaluate("window.evil") is None
    assert [url.split(":")[0] for url in opened.asked if not url.startswith(("data:", "blob:"))] == ["file"]
    assert not opened.page.query_selector_all(".problem")
    opened.context.close()


@pytest.mark.long
@on({"cable": False, "viewport": {"width": 1280, "height": 500}})
def test_the_cable_is_drawn_when_it_is_looked_at_as_it_is_then(visit: Visit, browser: Any, page_file: Path) -> None:
    """Until then its still drawing is there; time that went on before is that of the drawing."""
    assert visit.page.query_selector("#cable-plot svg.poster").is_visible()
    assert visit.page.evaluate("window.report.cable === undefined && !document.querySelector('#cable-plot canvas')")
    high = visit.page.evaluate("document.getElementById('cable-plot').clientHeight")
    visit.page.eval_on_selector("#time", "x => { x.value = '25'; x.dispatchEvent(new Event('input')); }")
    visit.shown("#cable-plot")
    visit.page.wait_for_function("window.report.cable", timeout=60_000)
    assert not visit.page.query_selector("#cable-plot svg.poster").is_visible()
    assert visit.page.evaluate("document.getElementById('cable-plot').clientHeight") == high, "nothing moves"
    moved, first = visit.cable(), Visit(browser, page_file).cable()
    assert moved[2] - first[2] == pytest.approx(2.0 * np.linspace(0.0, 100.0, 41) / 100.0, abs=1e-4)


@pytest.mark.long
@on({"cable": False, "viewport": {"width": 1280, "height": 400}})
def test_stills_stand_until_plotly_draws(visit: Visit) -> None:
    """plotly starts with the first picture that is looked at; its graph has the limits of the still drawing."""
    assert visit.page.evaluate("window.Plotly === undefined")
    stills = visit.page.query_selector_all(".plot svg.still")
    assert len(stills) == len(visit.page.query_selector_all(".plot[data-figure]")) > 5
    assert all(still.is_visible() for still in stills)
    graph = visit.shown("#plot-end-forces")
    visit.page.wait_for_function(DRAWN)
    assert not graph.query_selector("svg.still").is_visible() and graph.query_selector(".main-svg").is_visible()
    assert visit.page.query_selector("#plot-energy svg.still").is_visible()
    visit.shown("#cable-plot")
    visit.page.wait_for_function("window.report.cable", timeout=60_000)


@pytest.mark.long
def test_without_javascript_every_picture_is_there(browser: Any, page_file: Path) -> None:
    context = browser.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto(page_file.resolve().as_uri())
    pictures = page.query_selector_all("svg.still, svg.poster")
    assert len(pictures) == len(page.query_selector_all(".plot")) > 5
    for picture in pictures:
        assert picture.is_visible()
        assert np.asarray(Image.open(io.BytesIO(picture.screenshot())).convert("L"), float).std() > 5.0
    assert "0.015 1/m" in page.inner_text("#zones .legend")
    context.close()


def test_without_webgl_the_cable_is_shown_still(browser: Any, page_file: Path) -> None:
    context = browser.new_context()
    context.add_init_script("HTMLCanvasElement.prototype.getContext = () => null;")
    page = context.new_page()
    page.goto(page_file.resolve().as_uri())
    page.wait_for_function("window.report && window.report.ready", timeout=60_000)
    assert page.query_selector("#cable-plot svg.poster").is_visible() and "no WebGL" in page.inner_text("#cable-said")
    context.close()


@pytest.mark.long
@pytest.mark.needs("pypdfium2")
@on({"cable": False, "color_scheme": "dark"})
def test_paper_has_every_picture(visit: Visit) -> None:
    """Printed from a dark screen before anything was scrolled to: A4, light, every still drawing, folds open."""
    import pypdfium2 as pdfium

    sheets = pdfium.PdfDocument(visit.page.pdf(prefer_css_page_size=True, print_background=True))
    plain = pdfium.PdfDocument(visit.page.pdf(prefer_css_page_size=True))  # as browsers print unless told otherwise
    assert visit.page.evaluate("window.Plotly === undefined"), "paper does not need it"
    graphs = len(visit.page.query_selector_all(".plot[data-figure]"))
    text, ink = "", []
    for sheet, bare in zip(sheets, plain, strict=True):
        pair = [np.asarray(x.render(scale=0.7).to_pil(), float) for x in (sheet, bare)]
        assert np.array_equal(*pair), "swatches of legends, colour scales and bars are printed"
        assert sheet.get_size() == pytest.approx((595.3, 841.9), abs=1.5)
        text += sheet.get_textpage().get_text_range()
        picture = np.asarray(sheet.render(scale=0.7).to_pil().convert("L"), float)
        assert np.median(picture) > 250.0, "paper is white"
        ink.append((picture < 250.0).mean(axis=1))
    for k in range(graphs + 1):
        assert f"Figure {k + 1}." in text
    assert "Made-up mooring" in text and "title: Made-up mooring" in text  # the scene, which is folded on a screen
    visit.page.emulate_media(media="print")
    stills = visit.page.query_selector_all(".plot svg.still, .plot svg.poster")
    assert len(stills) == graphs + 1 and all(still.is_visible() for still in stills)
    for still in stills:
        assert np.asarray(Image.open(io.BytesIO(still.screenshot())).convert("L"), float).std() > 5.0
    for name in ("force (kN)", "tension (kN)", "energy (J)", "zone boundary"):
        assert name in text.replace("\r\n", " "), f"{name} is a text of a graph"
    for rows in ink[:-1]:  # the last page ends where it ends
        filled = np.flatnonzero(rows)
        gap = max(np.diff(filled).max(), len(rows) - filled[-1])
        assert gap < 0.5 * len(rows), "half a page is empty"


@pytest.mark.long
@on({"color_scheme": "dark"})
def test_a_dark_screen_gets_a_dark_page_and_the_other_way_round(visit: Visit) -> None:
    assert visit.pixels("#plot-end-forces").mean() < 80.0 and visit.pixels("#cable-plot").mean() < 80.0
    visit.page.emulate_media(color_scheme="light")
    visit.page.wait_for_timeout(500)
    assert visit.pixels("#plot-end-forces").mean() > 200.0 and visit.pixels("#cable-plot").mean() > 200.0


@pytest.mark.long
@pytest.mark.needs("axe-playwright-python")
@on(*({"color_scheme": scheme, "bypass_csp": True} for scheme in ("light", "dark")))
def test_nothing_serious_for_screen_readers_and_keyboards(visit: Visit) -> None:
    from axe_playwright_python.sync_playwright import Axe

    found = Axe().run(visit.page).response["violations"]
    serious = [(x["id"], [n["target"] for n in x["nodes"]]) for x in found if x["impact"] in ("serious", "critical")]
    assert not serious


@pytest.mark.bench
def test_the_report_of_a_touchdown_opens_in_two_seconds(browser: Any, tmp_path: Path) -> None:
    """Open: texts, tables and still pictures are there, controls and links work; then the time that a reader waits who
    goes to the cable, or to a graph, at once."""
    scene = hybrid.load_scene(Path(__file__).parents[2] / "examples" / "touchdown.yaml")
    begin = time.perf_counter()
    file = write_report(hybrid.run(scene, progress=False), tmp_path / "touchdown.html")
    wrote = time.perf_counter() - begin
    opened, waited = [], dict[str, list[float]]()
    for _ in range(5):
        for name, drawn in (("#cable-plot", "window.report.cable"), ("#plot-end-forces", DRAWN)):
            visit = Visit(browser, file, cable=False)
            opened.append(visit.seconds)
            assert len(visit.page.query_selector_all("svg.still, svg.poster")) == len(
                visit.page.query_selector_all(".plot")
            )
            begin = time.perf_counter()
            visit.page.eval_on_selector(name, "x => x.scrollIntoView({block: 'center'})")
            visit.page.wait_for_function(drawn, timeout=60_000)
            waited.setdefault(name, []).append(time.perf_counter() - begin)
            marks = "Object.fromEntries(performance.getEntriesByType('mark').map(m => [m.name, m.startTime / 1000]))"
            when = visit.page.evaluate(marks)
            visit.context.close()
    size, seconds = file.stat().st_size, sorted(opened)
    print(f"\nreport of 100 s of touchdown: {size / 1e6:.2f} MB, run and written in {wrote:.1f} s, opens in", end=" ")
    print(f"{np.median(seconds):.2f} s (median of 10, {seconds[0]:.2f} to {seconds[-1]:.2f} s);", end=" ")
    for name, each in waited.items():
        print(
            f"{name} drawn {np.median(each):.2f} s after it is gone to ({min(each):.2f} to {max(each):.2f} s),", end=" "
        )
    print(f"of which plotly takes {when['plotly'] - when['unpacked']:.2f} s to start (one visit)")
    assert size <= 4e6 and seconds[0] <= 2.0  # the quickest: what others do at the same time only adds
