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
from hybrid.view.report_parts import packed, page_file, plotly_script
from hybrid.view.space import HEIGHT, plot_space

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
