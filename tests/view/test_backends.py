"""One description, several back ends: what matplotlib, plotly and the small SVG draw of a panel is the same."""

from __future__ import annotations

import ast
import base64
import io
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image
from reported import reported

import hybrid.view
from hybrid.store.reader import Result
from hybrid.view import panels, zones
from hybrid.view.curves import Store, kept
from hybrid.view.figure import Area, Axis, Band, Box, Line, Map, Marks, Panel, Rule, Text
from hybrid.view.matplotlib_backend import draw_panel, new_axes
from hybrid.view.panels import end_forces, ranges
from hybrid.view.plotly_backend import draw, draw_graph, figure_of, png, ticks_of
from hybrid.view.zones import zone_map

EVENTS = [(5.5, 40.0, 60.0, "split", "bend <b>1.05</b> > 1"), (7.0, 0.0, 100.0, "snap", "a blow")]


def shown(result: Result) -> list[Panel]:
    """Every panel that both paper and page can show."""
    whole = kept(result)
    parts = [panels.end_forces(result), *(panels.energy(result, group) for group in ("energy", "work"))]
    assert all(parts), "this result has them all"
    over = [panels.history(result, "tension", [0.0, 33.0]), panels.history(result, "position", [50.0], component=2)]
    along = [panels.profiles(result, "curvature"), *panels.ranges(result, whole)]
    return [*filter(None, parts), *over, panels.touchdown(result), *along, zones.zone_map(result, whole)]


def array(block: bytes, value: Any) -> np.ndarray:
    if not isinstance(value, dict):
        return np.array(value, dtype=float)
    return np.frombuffer(block, f"<{value['type']}", int(np.prod(value["shape"])), value["$at"])


def test_texts_of_a_page_stand_beside_their_places() -> None:
    items = (
        Line(np.zeros(2), np.ones(2)),
        Text(4.0, 0.5, "<b>", offset=(3.0, -2.0), up="baseline"),
        Text(0.2, 1.0, "a", parts="x"),
    )
    first, second = figure_of(Panel("k", "t", Axis("t", "s"), Axis("z", "m"), list(items)), Store())["layout"][
        "annotations"
    ]
    assert (first["text"], first["x"], first["y"], first["xref"], first["yref"]) == ("&lt;b&gt;", 4.0, 0.5, "x", "y")
    assert (first["xshift"], first["yshift"], first["yanchor"]) == (3.0, -2.0, "bottom")
    assert (second["xref"], second["yref"]) == ("x domain", "y")


def test_paper_and_page_show_the_same_curves_and_limits() -> None:
    for panel in shown(reported(errors=True, allowed=60.0, events=EVENTS)):
        ax, store = Figure().subplots(), Store()
        draw_panel(panel, ax)
        figure = figure_of(panel, store)
        drawn = [line.get_xydata() for line in ax.lines]
        curves = [t for t in figure["data"] if t.get("mode") in ("lines", "markers") and "fill" not in t]
        assert curves and sum(isinstance(item, Band) for item in panel.items) == sum(
            "fill" in t for t in figure["data"]
        )
        for trace in curves:
            x, y = (array(store.block, trace[axis]) for axis in "xy")
            if np.isfinite(x).any():
                same = [np.allclose(np.column_stack([x, y]), d, 1e-6, 1e-6, True) for d in drawn if len(d) == len(x)]
                assert any(same), (panel.key, trace["name"])
        for axis, limits in (("xaxis", ax.get_xlim()), ("yaxis", ax.get_ylim())):
            assert figure["layout"][axis]["range"] == pytest.approx(limits)
        labels = [figure["layout"][axis]["title"]["text"] for axis in ("xaxis", "yaxis")]
        assert labels == [ax.get_xlabel(), ax.get_ylabel()]
        names = {trace["name"] for trace in figure["data"] if trace.get("showlegend")}
        assert names <= {label.replace("_", "", label[0] == "_") for label in ax.get_legend_handles_labels()[1]}


def test_pieces_of_a_line_are_all_on_the_page() -> None:
    """A boundary of zones is many pieces; thinned as a curve it would lose some."""
    x = np.column_stack([np.arange(1000.0), np.arange(1000.0), np.full(1000, np.nan)]).ravel()
    store = Store()
    (trace,) = figure_of(Panel("p", "p", Axis("x", "m"), Axis("y", "m"), [Line(x, np.sin(x))]), store)["data"]
    assert np.allclose(array(store.block, trace["x"]), x, equal_nan=True)


def test_a_name_is_in_a_legend_once() -> None:
    x = np.linspace(0.0, 1.0, 3)
    items: list[Any] = [Line(x, k * x, "the <same>") for k in (1.0, 2.0)]
    panel = Panel("p", "p", Axis("x", "m"), Axis("y", "m"), items)
    ax = Figure().subplots()
    draw_panel(panel, ax)
    assert ax.get_legend_handles_labels()[1] == ["the <same>"]
    traces = figure_of(panel, Store())["data"]
    assert [(t["name"], t["showlegend"]) for t in traces] == [("the &lt;same&gt;", True), ("the &lt;same&gt;", False)]


def test_limits_hold_what_is_drawn_and_no_round_off() -> None:
    x = np.array([0.0, 1.0, 2.0])
    panel = Panel("p", "p", Axis("x", "m"), Axis("y", "m"), [Line(x, np.array([1.0, np.nan, 3.0])), Band(x, -x, x)])
    (left, right), (low, high) = panel.limits()
    assert (left, right, low, high) == pytest.approx((-0.1, 2.1, -2.25, 3.25))
    still = Panel("p", "p", Axis("x", "m"), Axis("y", "m", peak=500.0), [Line(x, 7.0 + 1e-12 * x)])
    assert still.limits()[1] == pytest.approx((6.75, 7.25))


def test_a_name_far_outside_leaves_the_axes_their_room() -> None:
    """The still water of a cable 200 m below it: the axes of the page collapsed, and their numbers lay on each other."""
    x = np.linspace(0.0, 50.0, 3)
    items: list[Any] = [Line(x, x - 230.0), Text(50.0, 0.0, "still water")]
    ax = new_axes()
    draw_panel(Panel("p", "shape", Axis("x", "m"), Axis("z", "m"), items, aspect=1.0), ax)
    ax.set_autoscale_on(False)
    ax.figure.canvas.draw()
    assert ax.get_ylim()[1] < -100.0 and ax.get_position().height > 0.6


@pytest.mark.parametrize(("at", "up"), [(0.0, "top"), (0.0, "bottom"), (10.0, "top"), (10.0, "bottom")])
def test_a_name_at_the_edge_of_a_small_drawing_is_not_cut(at: float, up: str) -> None:
    x = np.linspace(0.0, 100.0, 11)
    items: list[Any] = [Line(x, 0.1 * x), Text(50.0, at, "seabed", up=up)]
    drawn = draw([Panel("shape", "shape", Axis("x", "m"), Axis("z", "m"), items, aspect=1.0)])
    height = re.search(r'<svg x="2" y="0" width="\d+" height="(\d+)"', drawn)
    base = re.search(r'<text x="[^"]*" y="(-?[\d.]+)" text-anchor="start"[^>]*>seabed', drawn)
    assert height and base and 10.0 <= float(base[1]) <= float(height[1]) - 3.0


def test_a_back_end_says_what_it_cannot_draw() -> None:
    unit = Axis("", "", 0.0, 1.0)
    with pytest.raises(TypeError, match="str"):
        figure_of(Panel("p", "p", unit, unit, ["no item"]), Store())  # type: ignore[list-item]
    with pytest.raises(TypeError, match="str"):
        draw([Panel("p", "p", unit, unit, ["no item"])])  # type: ignore[list-item]


def test_a_plan_on_a_page_has_one_scale_and_what_is_around() -> None:
    """An obstacle is an area, and a circle of lines stays one: 100 m by 10 m in a drawing of three to two."""
    shape = Area(np.array([[[0.0, 0.0], [10.0, 0.0], [10.0, 5.0]]]), "#D9D4CF", "obstacle")
    panel = Panel("plan", "plan", Axis("x", "m", 0.0, 100.0), Axis("y", "m", 0.0, 10.0), [shape], aspect=1.0)
    (trace,) = figure_of(panel, Store())["data"]
    assert trace["fill"] == "toself" and trace["fillcolor"] == "#D9D4CF"
    (points,) = re.findall(r'<path d="M([^"]*)Z" fill="#D9D4CF"', draw_graph(panel))
    (x0, y0), (x1, y1), (x2, y2) = (map(float, at.split()) for at in points.split("L"))
    assert y0 == y1 and x1 == x2 and (x1 - x0) / (y1 - y2) == pytest.approx(2.0, rel=0.15)


def test_libraries_that_draw_are_known_to_their_back_end_only() -> None:
    for file in Path(hybrid.view.__file__).parent.glob("*.py"):
        tree = ast.parse(file.read_text())
        names = {node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
        if file.name not in (
            "matplotlib_backend.py",
            "quantities.py",
            "figure.py",
            "several_runs.py",
        ):  # types of results there
            assert not any(name.startswith("matplotlib") for name in names), file


# Still graphs of a report: their numbers, marks and texts, against the panels that they show.


SVG = "{http://www.w3.org/2000/svg}"


def panel(*items: Any, x: Axis | None = None, y: Axis | None = None, title: str = "a graph") -> Panel:
    return Panel("graph", title, x or Axis("t", "s", 0.0, 10.0), y or Axis("force", "kN", -1.0, 1.0), list(items))


def places(svg: str, colour: str) -> list[list[tuple[float, float]]]:
    """Pieces of the curve of a colour, px."""
    found = re.search(rf'<path d="([^"]+)" fill="none" stroke-linejoin="round"[^>]*stroke="{colour}"', svg)
    assert found, f"no curve of {colour}"
    pieces = [re.findall(r"(-?[\d.]+) (-?[\d.]+)", piece) for piece in found[1].split("M")[1:]]
    return [[(float(a), float(b)) for a, b in piece] for piece in pieces]


def numbers(svg: str, anchor: str) -> dict[float, float]:
    """Places, px, of the numbers of an axis."""
    at = 1 if anchor == "middle" else 2
    texts = re.findall(rf'<text x="([-\d.]+)" y="([-\d.]+)" text-anchor="{anchor}">([-\d.]+)</text>', svg)
    return {float(text[2]): float(text[at - 1]) - (4.0 if at == 2 else 0.0) for text in texts}


def test_curves_lie_where_the_numbers_of_the_axes_say() -> None:
    t = np.linspace(0.0, 10.0, 41)
    y = np.where(t == 5.0, np.nan, np.sin(t))
    svg = draw_graph(panel(Line(t, y, "force", "#123456")))
    across, up = numbers(svg, "middle"), numbers(svg, "end")
    assert list(across) == [0.0, 2.0, 4.0, 6.0, 8.0, 10.0] and list(up) == [-1.0, -0.5, 0.0, 0.5, 1.0]
    first, second = places(svg, "#123456")  # with a gap where there is no value
    drawn = np.array(first + second)
    shown = np.isfinite(y)
    assert drawn[:, 0] == pytest.approx(np.interp(t[shown], list(across), list(across.values())), abs=0.11)
    assert drawn[:, 1] == pytest.approx(np.interp(y[shown], list(up), list(up.values())), abs=0.11)


def test_texts_stand_beside_their_places() -> None:
    """By values of the axes, or by parts of the panel; offsets up are less px."""
    curve, beside = Line(np.array([0.0, 10.0]), np.zeros(2), colour="#123456"), (3.0, -2.0)
    items = curve, Text(4.0, 0.5, "low <tension>", offset=beside), Text(0.25, 0.75, "peak", across="right", parts="xy")
    svg = draw_graph(panel(*items))
    across, up = numbers(svg, "middle"), numbers(svg, "end")
    found = {
        text: (float(x), float(y))
        for x, y, text in re.findall(r'<text x="([\d.]+)" y="([\d.]+)"[^>]*fill[^>]*>([^<]+)<', svg)
    }
    assert found["low &lt;tension&gt;"] == pytest.approx((across[4.0] + 3.0, up[0.5] + 2.0), abs=0.11)
    assert found["peak"] == pytest.approx((0.75 * across[0.0] + 0.25 * across[10.0], up[0.5]), abs=0.11)


def test_no_peak_of_a_long_curve_is_lost() -> None:
    t, y = np.linspace(0.0, 10.0, 100_001), np.zeros(100_001)
    y[77_777] = 0.9
    svg = draw_graph(panel(Line(t, y, colour="#123456")))
    up = numbers(svg, "end")
    (piece,) = places(svg, "#123456")
    assert len(piece) < 1000 and len(svg) < 20_000
    assert min(b for _, b in piece) == pytest.approx(np.interp(0.9, list(up), list(up.values())), abs=0.11)


@pytest.mark.parametrize(
    ("low", "high", "texts"),
    [
        (0.0, 100.0, ["0", "20", "40", "60", "80", "100"]), (-0.013, 0.0231, ["-0.01", "0.00", "0.01", "0.02"]),
        (0.0, 3e7, ["0", "5e+06", "1e+07", "1.5e+07", "2e+07", "2.5e+07", "3e+07"]),
        (99.95, 100.05, ["99.96", "99.98", "100.00", "100.02", "100.04"]),
    ],
)  # fmt: skip
def test_ticks_are_round_numbers(low: float, high: float, texts: list[str]) -> None:
    assert [text for _, text in ticks_of(Axis("x", "m"), low, high, 6)] == texts


def test_ticks_tell_numbers_apart() -> None:
    """Whatever the span: 3 to 7 of them, inside, each with a text of its own that is its number."""
    rng = np.random.default_rng(3)
    for _ in range(500):
        middle, span = rng.normal() * 10.0 ** rng.uniform(-6, 8), 10.0 ** rng.uniform(-6, 8)
        span = max(span, 1e-6 * abs(middle))
        found = ticks_of(Axis("x", "m"), middle - span, middle + span, 6)
        assert 2 <= len(found) <= 7 and len({text for _, text in found}) == len(found)
        for value, text in found:
            assert middle - 1.0001 * span <= value <= middle + 1.0001 * span
            assert float(text) == pytest.approx(value, abs=0.01 * span)


def test_every_kind_of_item_is_drawn_and_named_once() -> None:
    x = np.array([0.0, 5.0, 10.0])
    svg = draw_graph(
        panel(
            Band(x, -0.5 * x / 10, 0.5 * x / 10, "<b>error</b>"), Box((1.0, 2.0), None, "box"), Rule("x", [3.0], "rule"),
            *(Marks(x, 0.1 * x, symbol, "marks") for symbol in "os^vD+xX"), Line(x, 0.0 * x, "line", casing="#000000"),
        )
    )  # fmt: skip
    root = ElementTree.fromstring(svg)
    texts = [text.text for text in root.iter(f"{SVG}text")]
    assert [name for name in texts if name in ("<b>error</b>", "box", "rule", "marks", "line")] == [
        "<b>error</b>", "box", "rule", "marks", "line",
    ]  # fmt: skip
    assert "force (kN)" in texts and "t (s)" in texts
    assert len(list(root.iter(f"{SVG}circle"))) == 4  # three, and that of the legend


def test_a_map_has_the_colours_of_its_cells() -> None:
    values = np.array([[0.0, 10.0], [np.nan, 5.0]])
    shown = Map(np.array([0.0, 4.0, 10.0]), np.array([-1.0, 0.0, 1.0]), values, "rod", "curvature", "1/m",
                ("#000000", "#FF0000"), 0.0, 10.0)  # fmt: skip
    data = re.search(r"data:image/png;base64,([^\"]+)", draw_graph(panel(shown)))
    assert data
    picture = np.asarray(Image.open(io.BytesIO(base64.b64decode(data[1]))))
    high, wide, _ = picture.shape
    assert picture[high - 1, 0].tolist() == [0, 0, 0, 255] and picture[high - 1, wide - 1].tolist() == [255, 0, 0, 255]
    assert picture[0, 0, 3] == 0 and picture[0, wide - 1].tolist() == [128, 0, 0, 255]
    assert picture[high - 1, int(0.39 * wide)].tolist() == [0, 0, 0, 255], "cells of other widths"
    assert picture[high - 1, int(0.41 * wide)].tolist() == [255, 0, 0, 255]


def test_png_is_read_back() -> None:
    pixels = np.random.default_rng(1).integers(0, 256, (7, 5, 4), np.uint8)
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(png(pixels)))), pixels)


def test_a_logarithmic_axis_is_refused() -> None:
    with pytest.raises(ValueError, match="logarithmic"):
        draw_graph(panel(x=Axis("t", "s", 1.0, 10.0, log=True)))


def test_graphs_of_a_report_are_sound() -> None:
    result = reported(outputs=101, errors=True)
    for each in (end_forces(result), zone_map(result, kept(result)), *ranges(result, kept(result))):
        root = ElementTree.fromstring(draw_graph(each))
        assert root.get("class") == "still" and len(list(root.iter())) > 20
