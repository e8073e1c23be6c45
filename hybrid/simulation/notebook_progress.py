"""Progress of a run as a bar in a notebook (ipywidgets, the extra `notebook`); without it there is a line of text."""

from __future__ import annotations

import sys
from typing import Any, Protocol

from hybrid.errors import command_for

WITHOUT = f"progress as text; a bar in the notebook needs: {command_for('notebook')}"


class Reported(Protocol):
    """What a bar reads of a `Progress`."""

    @property
    def fraction(self) -> float: ...

    @property
    def text(self) -> str: ...


def in_notebook() -> bool:
    """Whether the code runs in a kernel of Jupyter; IPython is not imported to find out."""
    ipython = sys.modules.get("IPython")
    return ipython is not None and getattr(ipython.get_ipython(), "kernel", None) is not None


def notebook_bar() -> NotebookBar | None:
    """A bar that is displayed at the first report; None, with a word on the error stream, without ipywidgets."""
    try:
        import ipywidgets
    except ImportError:
        sys.stderr.write(WITHOUT + "\n")
        return None
    return NotebookBar(ipywidgets)


class NotebookBar:
    """A bar with a line of text, in the cell that runs; it stays, with where the run ended."""

    def __init__(self, widgets: Any) -> None:
        self._bar = widgets.FloatProgress(value=0.0, min=0.0, max=1.0, layout=widgets.Layout(width="240px"))
        self._text = widgets.Label(value="")
        self._box = widgets.HBox([self._bar, self._text])
        self._shown = False

    def __call__(self, progress: Reported) -> None:
        self._show()
        self._bar.value, self._text.value = progress.fraction, progress.text

    def say(self, text: str) -> None:
        """A text beside the bar, until the first report."""
        self._show()
        self._text.value = text

    def _show(self) -> None:
        if not self._shown:
            from IPython.display import display

            display(self._box)
            self._shown = True

    def close(self) -> None:
        """Mark a bar that did not reach its end."""
        if self._shown and self._bar.value < 1.0:
            self._bar.bar_style = "warning"
