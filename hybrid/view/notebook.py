"""What a cell of a notebook shows of a result.

It is the card of the result, and below it the cable in space as a figure of plotly, with a slider over time.  The
figure holds all moments that it shows, so that its slider works without a kernel: in a notebook that is opened again,
and in one exported to HTML.

JupyterLab and VS Code draw the figure with plotly's own script.  For pages made of a notebook (nbconvert) the first
result that a kernel shows brings plotly.js, packed, and asks no other host for it.
"""

from __future__ import annotations

import json
from html import escape
from typing import TYPE_CHECKING, Any
from uuid import uuid4

import numpy as np

from hybrid.errors import ResultError
from hybrid.store.reader import Result
from hybrid.view.curves import Kept, Store, even, script_json
from hybrid.view.figure import ALARM, GREY, INK, short
from hybrid.view.lines import AllLines, scenery
from hybrid.view.panels import shape
from hybrid.view.plotly_backend import NARROW, draw
from hybrid.view.report_parts import packed, page_file, plotly_script
from hybrid.view.summary import attention, facts_of, length_of
from hybrid.view.zones import strip

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

# A slider is some 600 pixels wide, and a cell is to stay near 300 kB: places of the slider, points of all lines.
MOST_FRAMES, MOST_POINTS = 81, 121
PLAYED = 12.0  # s that playing all of it takes, at the least
HEIGHT = 460  # pixels: with the slider, what a notebook shows without scrolling
_GRID = "#E4E4E4"


class Arrays(Store):
    """In place of a page's references: the arrays themselves."""

    def add(self, array: Any, kind: str = "f4") -> Any:
        """The array with the type that a page would have."""
        return np.ascontiguousarray(array, dtype=kind)


def plot_space(result: Result, colour: str | None = None) -> Figure:
    """The cable, or all lines, in space (m, inertial frame, z up) as a plotly figure with a slider over time.

    colour: "zone", "tension" or "curvature" of one line, "line" or "tension" of several; None: by zone, or by line.
    Of long runs at most 81 moments and about 121 points are in it.  ResultError: a result without an output, or a
    colour that it does not have.
    """
    from plotly.graph_objects import Figure

    scene = _scene(result)
    if not scene:
        raise ResultError(f"the result holds no output to draw ({result.status_text})")
    ways = {way["key"]: way for way in scene["colours"]}
    if colour is not None and colour not in ways:
        raise ResultError(f"this result cannot be coloured by {colour!r}\n    expected: {' or '.join(ways)}")
    way = ways[colour] if colour is not None else next(iter(ways.values()), None)
    still = [_plane(plane) for plane in scene["planes"] if plane]
    first, moving = len(still), len(scene["times"])
    frames = [
        {"name": str(k), "data": _moment(scene, way, k), "traces": list(range(first, first + 1 + len(scene["marks"])))}
        for k in range(moving)
    ]
    nowhere = {"type": "scatter3d", "mode": "lines", "x": [None], "y": [None], "z": [None], "hoverinfo": "skip"}
    legend = (way or {}).get("legend", [])
    entries = [nowhere | {"name": name, "line": {"color": shade, "width": 6}} for name, shade in legend]
    data = [*still, *frames[0]["data"], *entries]
    layout = _layout(result, scene) | (_controls(scene) if moving > 1 else {})
    return Figure({"data": data, "layout": layout, "frames": frames if moving > 1 else []})


def _scene(result: Result) -> dict[str, Any]:
    """What there is to draw, with arrays; {} without outputs."""
    every = AllLines(result)
    frames, each = even(every.outputs, MOST_FRAMES), max(5, MOST_POINTS // len(every.lines))
    shown = {
        name: Kept(frames, even(len(line.s), each), every.outputs, len(line.s)) for name, line in every.lines.items()
    }
    return scenery(result, every, shown, Arrays())


def _moment(scene: dict[str, Any], way: dict[str, Any] | None, k: int) -> list[dict[str, Any]]:
    """The curve and the marks of the k-th moment."""
    line: dict[str, Any] = {"width": 6, "color": scene["ink"]}
    hover = "s = %{customdata:.5g} m<br>x = %{x:.5g}, y = %{y:.5g}, z = %{z:.5g} m"
    values = None
    if way is not None:
        values = np.asarray(way["values"])[k].astype("f4")
        line |= {"color": values, "colorscale": way["scale"], "cmin": way["low"], "cmax": way["high"]}
        if way.get("log"):
            line["color"] = np.log10(np.maximum(values, way["low"]))
            line |= {"cmin": np.log10(way["low"]), "cmax": np.log10(way["high"])}
        elif "unit" in way:
            line |= {"showscale": True, "colorbar": {"title": {"text": way["label"]}, "len": 0.7, "thickness": 12}}
    curve = {
        "type": "scatter3d", "mode": "lines", "name": "cable", "line": line, "showlegend": False,
        "x": scene["x"][k], "y": scene["y"][k], "z": scene["z"][k], "customdata": scene["s"],
        "hovertemplate": hover + "<extra></extra>",
    }  # fmt: skip
    if values is not None and "unit" in (way or {}):
        curve |= {"text": [f"{x:.4g}" for x in values]}
        curve["hovertemplate"] = f"{hover}<br>{(way or {})['key']} %{{text}} {(way or {})['unit']}<extra></extra>"
    marks = [
        {
            "type": "scatter3d", "mode": "markers", "name": mark["name"], "showlegend": bool(mark["name"]),
            "x": mark["x"][k], "y": mark["y"][k], "z": mark["z"][k], "hoverinfo": "name",
            "marker": {"symbol": mark["symbol"], "color": mark["colour"], "size": mark["size"]},
        }
        for mark in scene["marks"]
    ]  # fmt: skip
    return [curve, *marks]


def _plane(plane: dict[str, Any]) -> dict[str, Any]:
    corners = {key: plane[key] for key in "ijk"} if "i" in plane else {"i": [0, 0], "j": [1, 2], "k": [2, 3]}
    look = {"type": "mesh3d", "color": plane["fill"], "opacity": plane["solid"], "hoverinfo": "skip"}
    where = {axis: plane[axis] for axis in "xyz"}
    return look | where | corners | {"name": plane["name"], "showlegend": True, "flatshading": True}


def _layout(result: Result, scene: dict[str, Any]) -> dict[str, Any]:
    box, title = scene["box"], escape(result.title or "(no title)", quote=False)  # plotly finds no tag in it
    wide, deep = (high - low for low, high in box[:2])
    largest = max(high - low for low, high in box)
    eye = {"x": 0.5, "y": -1.9, "z": 0.5} if wide >= deep else {"x": 1.9, "y": 0.5, "z": 0.5}
    axes = {
        f"{axis}axis": {
            "title": {"text": f"{axis} (m)"}, "range": [low, high], "backgroundcolor": "#FFFFFF", "gridcolor": _GRID,
            "zeroline": False, "nticks": 6 if high - low > 0.3 * largest else 2,
        }
        for axis, (low, high) in zip("xyz", box, strict=True)
    }  # fmt: skip
    return {
        "height": HEIGHT, "margin": {"l": 0, "r": 0, "t": 36, "b": 0}, "paper_bgcolor": "#FFFFFF",
        "title": {"text": title, "font": {"size": 15}, "x": 0.01, "xanchor": "left"},
        "font": {"color": scene["ink"]}, "legend": {"x": 0.99, "xanchor": "right", "y": 0.99, "yanchor": "top"},
        "scene": {"aspectmode": "data", "camera": {"eye": eye}} | axes,
    }  # fmt: skip


def _controls(scene: dict[str, Any]) -> dict[str, Any]:
    """The slider, and the buttons that play and stop."""
    times = scene["times"]
    each = 1e3 * max(PLAYED, (times[-1] - times[0]) / scene["speed"]) / len(times)

    def shown(duration: float) -> dict[str, Any]:
        frame = {"duration": duration, "redraw": True}
        return {"mode": "immediate", "fromcurrent": True, "frame": frame, "transition": {"duration": 0}}

    steps = [{"method": "animate", "label": short(t, 4), "args": [[str(k)], shown(0.0)]} for k, t in enumerate(times)]
    slider = {
        "active": 0, "steps": steps, "x": 0.12, "len": 0.86, "y": 0.0, "pad": {"t": 8, "b": 8},
        "currentvalue": {"prefix": "t = ", "suffix": " s", "xanchor": "left"}, "transition": {"duration": 0},
        "font": {"size": 11}, "ticklen": 3,
    }  # fmt: skip
    buttons = [
        {"label": "Play", "method": "animate", "args": [None, shown(each)]},
        {"label": "Stop", "method": "animate", "args": [[None], shown(0.0)]},
    ]
    menu = {
        "type": "buttons", "direction": "left", "buttons": buttons, "showactive": False, "x": 0.0, "xanchor": "left",
        "y": 0.0, "yanchor": "top", "pad": {"t": 28, "r": 8},
    }  # fmt: skip
    return {"sliders": [slider], "updatemenus": [menu]}


MIME = "application/vnd.plotly.v1+json"
CONFIG = {"displaylogo": False, "responsive": True}
_scripts_cell: list[str | None] = []  # the cell that brought plotly.js, once one has


def show(result: Result) -> None:
    """Display a result in the cell that runs; NotImplementedError where there is none, as in a terminal."""
    if (shell := _shell()) is None:
        raise NotImplementedError  # IPython then shows what else the result has
    from IPython.display import HTML, display

    display(HTML(result._repr_html_()))
    try:
        figure = plot_space(result)
        display(bundle(figure, with_script=_first(shell)), raw=True)
    except Exception as error:  # a cell must never fail because its result is closed, empty or odd
        reason = (str(error) or type(error).__name__).splitlines()[0]
        display(HTML(f"<small>No picture in space: {escape(reason)}</small>"))


def bundle(figure: Figure, with_script: bool) -> dict[str, Any]:
    """The figure as Jupyter's front ends take it, and as HTML; with_script: plotly.js is in the HTML."""
    data = json.loads(figure.to_json()) | {"config": CONFIG}
    name = f"hybrid-{uuid4().hex}"
    script = page_file("notebook.js").replace("__FIGURE__", script_json(data)).replace("__NAME__", name)
    if with_script:
        script = page_file("unpack.js").replace("__PACKED__", packed(plotly_script().encode())) + script
    page = f'<div id="{name}" style="height:{HEIGHT}px;width:100%;background:#fff"></div><script>{script}</script>'
    return {MIME: data, "text/html": page, "text/plain": "the cable in space, a figure of plotly"}


def _first(shell: Any) -> bool:
    """Whether plotly.js must come with this output: none had it, or the cell that had it runs again."""
    try:
        cell = shell.kernel.get_parent()["metadata"].get("cellId")
    except (AttributeError, KeyError, TypeError):
        cell = None
    if _scripts_cell and (cell is None or cell != _scripts_cell[0]):
        return False
    _scripts_cell[:] = [cell]
    return True


def _shell() -> Any:
    """The shell of IPython in a kernel of Jupyter; None elsewhere."""
    try:
        from IPython import get_ipython
    except ImportError:
        return None
    shell = get_ipython()
    return shell if getattr(shell, "kernel", None) is not None else None


# A result at a glance, as light HTML: title, status, key facts, and a small drawing of shapes and zones.
#
# It costs milliseconds and a few kilobytes.

_POINTS = 120  # on a curve
_SHOWN = ("tension", "bend", "slack", "seabed", "errors")  # facts with a line each
_FRAME = "font-family:system-ui,sans-serif;font-size:13px;line-height:1.45;color:#222;background:#fff;padding:10px 12px"
_FRAME += ";border:1px solid #ddd;border-radius:6px;max-width:900px"


def card(result: Result) -> str:
    """The HTML of one result; it holds no script and asks for nothing from outside."""
    facts = facts_of(result)
    first = attention(facts)
    good = result.done
    n, s = len(result.times), result.s
    span = f"t = {short(result.times[0], 6)} … {short(result.times[-1], 6)} s" if n > 1 else ""
    span = "static" if n == 1 and result.status == "complete" else span
    head = (
        f"{n} output{'s' * (n != 1)}"
        + f", {span}" * bool(span)
        + f"; {len(s)} points on {short(length_of(result), 6)} m"
    )
    status = result.status if good else result.status_text.splitlines()[0]
    colour = GREY if good else ALARM
    rows = [(f.title, f.text) for f in facts if f.key in _SHOWN and f.weight != "absent"]
    cells = "".join(
        f'<tr><td style="text-align:left;vertical-align:top;white-space:nowrap;padding:1px 10px 1px 0;color:{GREY};'
        f'border:0;background:#fff">{escape(title)}</td><td style="text-align:left;padding:1px 0;color:{INK};'
        f'border:0;background:#fff">{escape(text)}</td></tr>'
        for title, text in rows
    )
    alarms = [f"{fact.title}: {fact.text.splitlines()[0]}" for fact in first if fact.key != "status"]
    alarm = "".join(f'<div style="color:{ALARM}">{escape(_cut(text))}</div>' for text in alarms[:3])
    alarm += f'<div style="color:{ALARM}">and {len(alarms) - 3} more</div>' if len(alarms) > 3 else ""
    drawing = f'<div style="flex:0 1 {NARROW:.0f}px;min-width:220px">{picture(result)}</div>' if n else ""
    title = escape(result.title or "(no title)")
    return (
        f'<div style="{_FRAME}"><div style="font-weight:600;font-size:15px">{title}</div>'
        f'<div style="color:{colour}">{escape(_cut(status))}; {escape(head)}</div>{alarm}'
        f'<div style="display:flex;flex-wrap:wrap;gap:14px;margin-top:6px">{drawing}<table style="flex:1 1 280px;'
        f'border-collapse:collapse;font-size:12.5px;margin:0;display:block;border:0">{cells}</table></div></div>'
    )


def _cut(text: str, most: int = 220) -> str:
    return text if len(text) <= most else text[: most - 2].rsplit(" ", 1)[0] + " …"


def picture(result: Result) -> str:
    """SVG: the last shape by zones over earlier ones, seabed and water; below it the zones over time."""
    panels = [shape(result, most=_POINTS)]
    if len(result.times) > 1 and any(result.zones):
        panels.append(strip(result))
    return draw(panels)
