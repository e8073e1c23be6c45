"""One description, several back ends: what matplotlib, plotly and the small SVG draw of a panel is the same."""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from reported import reported

import hybrid.view
from hybrid.store.reader import Result
from hybrid.view import panels, zones
from hybrid.view.curves import Store, kept
from hybrid.view.figure import Area, Axis, Band, Line, Panel, Text
from hybrid.view.matplotlib_backend import draw_panel, new_axes
from hybrid.view.plotly_backend import draw, draw_graph, figure_of

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
            "study_report.py",
        ):  # types of results there
            assert not any(name.startswith("matplotlib") for name in names), file
