"""A process that turns texts of scenes into pictures: one line of JSON in, lines of JSON out.

Asked {"do": "picture", "text", "file"} it answers "compiling" perhaps, then "picture" and JSON; asked
{"do": "report", "file"} the report of a result file, or of the last picture with file null: "report" and JSON;
{"do": "modes", "text", "file"} the page of natural modes of a scene: "modes" and JSON.
The first word of an answer and a tab stand before its JSON, so that the server passes it on without reading it.
"""

from __future__ import annotations

import json
import os
import sys
import traceback
from pathlib import Path
from typing import Any, TextIO

# A scene whose equilibrium is found before the first text comes, so that the kernels are in memory by then.
SAMPLE = """\
environment: {seabed: {z: -5, stiffness: 1.0e+3}}
cable: {sections: [{length: 20, mass: 1, diameter: 0.02, axial_stiffness: 1.0e+6, bending_stiffness: 1}]}
ends: {start: {kind: pinned, position: [0, 0, -5]}, end: {kind: pinned, position: [16, 0, 0]}}
initial: equilibrium
model: rod
mesh: {cells: 20}
"""


def main() -> None:
    """Answer until the input ends; what anything here prints goes to the error stream."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8", buffering=1)
    os.dup2(2, 1)
    worker = Worker(answers)
    worker.warm_up()
    for line in sys.stdin:
        worker.answer(json.loads(line))


class Worker:
    """Answers of one process; it keeps the result of its last picture, for a report."""

    def __init__(self, answers: TextIO) -> None:
        self._answers = answers
        self._last: Any = None

    def warm_up(self) -> None:
        """Bring what the first picture needs into memory, unless it would have to be compiled first."""
        from hybrid.kernels.machine.compile import is_warm
        from hybrid.live.pictures import picture_of
        from hybrid.scene.read import parse_scene
        from hybrid.simulation.first_use import kernels_of

        if is_warm(kernels_of(parse_scene(SAMPLE), static=True)):
            picture_of(SAMPLE, "", lambda: None)
        self._say("ready", {})

    def answer(self, asked: dict[str, Any]) -> None:
        """Answer once; what goes wrong here is a bug of ours, and is said as one."""
        try:
            if asked["do"] == "report":
                self._say("report", self._report(asked["file"]))
            elif asked["do"] == "modes":
                self._say("modes", self._modes(asked["text"], asked["file"]))
            else:
                self._say("picture", self._picture(asked["text"], asked["file"]))
        except Exception:
            text = f"this is a bug in hybrid; please report it with the scene and these lines\n{traceback.format_exc()}"
            bug = {"line": None, "where": "bug", "given": "", "text": text}
            self._say(asked["do"], {"problems": [bug], "notes": [], "bug": True})

    def _picture(self, text: str, file: str) -> dict[str, Any]:
        from hybrid.live.pictures import picture_of

        picture, result = picture_of(text, file, lambda: self._say("compiling", {}))
        self._last = result or self._last
        return picture

    def _report(self, file: str | None) -> dict[str, Any]:
        from hybrid.errors import ResultError
        from hybrid.store.reader import open_result
        from hybrid.view.report import html

        try:
            if file is not None:
                with open_result(Path(file)) as result:
                    return {"html": html(result)}
            return {"html": html(self._last)} if self._last is not None else {"refused": "there is no equilibrium yet"}
        except ResultError as error:
            return {"refused": str(error)}

    def _modes(self, text: str, file: str) -> dict[str, Any]:
        from hybrid.errors import HybridError
        from hybrid.modal.api import modes
        from hybrid.scene.read import read_text
        from hybrid.view.modes_page import html

        try:
            return {"html": html(modes(read_text(text, file)[0]))}
        except HybridError as error:
            return {"refused": str(error)}

    def _say(self, what: str, content: dict[str, Any]) -> None:
        self._answers.write(f"{what}\t{json.dumps(content, allow_nan=False)}\n")
        self._answers.flush()
