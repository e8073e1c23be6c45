"""What a cell of a notebook shows of a result: its card, and below it the cable in space with a slider over time.

JupyterLab and VS Code draw the figure with plotly's own script.  For pages made of a notebook (nbconvert) the first
result that a kernel shows brings plotly.js, packed, and asks no other host for it.
"""

from __future__ import annotations

import json
from html import escape
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from hybrid.store.reader import Result
from hybrid.view.decimate import script_json
from hybrid.view.figure import ALARM, GREY, INK, short
from hybrid.view.panels import shape
from hybrid.view.plotly_backend import WIDTH, draw
from hybrid.view.report_parts import packed, page_file, plotly_script
from hybrid.view.space import HEIGHT, plot_space
from hybrid.view.summary import attention, facts_of, length_of
from hybrid.view.zones import strip

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


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
    drawing = f'<div style="flex:0 1 {WIDTH:.0f}px;min-width:220px">{picture(result)}</div>' if n else ""
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
