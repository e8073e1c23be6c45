"""Still graphs of a report: their numbers, marks and texts, against the panels that they show."""

from __future__ import annotations

import base64
import io
import re
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image
from reported import reported

from hybrid.view.curves import kept
from hybrid.view.figure import Axis, Band, Box, Line, Map, Marks, Panel, Rule, Text
from hybrid.view.panels import end_forces, ranges
from hybrid.view.plotly_backend import draw_graph, png, ticks_of
from hybrid.view.zones import zone_map

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
