"""The scene of a cable as a network of one line, and where the keys of the one are in the other.

Words of the short form, left, and of the network:

    cable.sections, cable.attachments        lines.cable.sections, lines.cable.attachments
    model, mesh, resolution, contact, initial    lines.cable.model, ...
    ends.end of kind pinned or clamped       points.end of kind fixed; how the line is held: lines.cable.connections.end
    ends.end of kind guided                  points.end of kind guided, with such a connection
    ends.end of kind free or body            points.end of kind free
    everything else                          as it is

The line is called `cable`, and the points are called as the ends are.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

from pydantic import ValidationError

from hybrid.errors import Complaint, ComputationError, SceneError
from hybrid.scene.analysis import CatenaryModel, Output
from hybrid.scene.base import Finding, Place, dotted
from hybrid.scene.combinations import value_at
from hybrid.scene.ends import End, Release
from hybrid.scene.network_scene import Network
from hybrid.scene.points import Failure
from hybrid.scene.root import Scene
from hybrid.scene.schema import LineScene

LINE = "cable"
ENDS = ("start", "end")
MOST_KEPT = 8  # networks, of the scenes asked for last: to validate one takes 1 ms, and it keeps the scene of its line
# Tables of a scene that a line has.
OF_LINE = ("mesh", "resolution", "contact", "initial")
# Of an end by its kind: the kind of its point, what keys of the point are called there, which keys the connection has.
POINTS: dict[str, tuple[str, dict[str, str], tuple[str, ...]]] = {
    "pinned": ("fixed", {"release_at": "break_at"}, ("payout",)),
    "clamped": (
        "fixed", {"release_at": "break_at"}, ("tangent", "normal", "turns", "swivel", "bend_stiffness", "payout"),
    ),
    "guided": ("guided", {}, ("tangent", "normal", "turns")),
    "free": ("free", {}, ()),
    "body": ("free", {"thrust": "force"}, ()),
}  # fmt: skip

# What networks say of points, and what is said of ends.
WORDS = {
    "gives way": "is let go",
    "break_at": "release_at",
    "; what came loose is free": " and is free",
    "a moment at a point": "an end moment",
    "points and bodies move otherwise": "the ends move otherwise",
}


class NotInNetwork(SceneError):
    """The scene of a cable has what a network of one line cannot have yet."""


@dataclass(frozen=True)
class ShortForm:
    """Where keys of a network are in the scene that it was made of.

    pairs: places in the network and in the scene; what is below such a place is below the other one.  Without any the
    scene is that network.  names: of the lines of the network, each as in the scene: "" of the one without a name.
    """

    pairs: tuple[tuple[Place, Place], ...]
    names: Mapping[str, str]

    def place(self, at: Place) -> Place:
        """Where a key of the network is in the scene."""
        known = [x for x in self.pairs if at[: len(x[0])] == x[0]]
        if not known:
            return at
        there, here = max(known, key=lambda x: len(x[0]))
        return (*here, *at[len(there) :])

    def text(self, message: str) -> str:
        """A message about the network in words of the scene."""
        if not self.pairs:
            return message
        for there, here in sorted(self.pairs, key=lambda x: -len(x[0])):
            message = re.sub(rf"\b{re.escape(dotted(there))}\b", dotted(here), message)
        message = re.sub(rf"\bline {LINE}\b", "the cable", message)
        for words, instead in WORDS.items():
            message = message.replace(words, instead)
        return re.sub(r"\bpoint (start|end)\b", r"ends.\1", message)

    @contextmanager
    def said(self) -> Iterator[None]:
        """What fails within, of the network, is said in words of the scene."""
        try:
            yield
        except ComputationError as error:
            raise self.error(error) from None
        except SceneError as error:
            said = [
                replace(
                    x,
                    where=self.text(x.where),
                    value=self.text(x.value),
                    expected=self.text(x.expected),
                    fix=self.text(x.fix),
                )
                for x in error.complaints
            ]
            raise SceneError(said, error.file) from None

    def error(self, error: ComputationError) -> ComputationError:
        """What has failed of the network, in words of the scene."""
        if not self.pairs:
            return error
        detail, first = re.sub(r"^the cable(; |$)", "", self.text(error.detail)), self.text(error.first)
        return ComputationError(error.outcome, error.t, error.s, detail, error.snapshot, first)

    def finding(self, found: Finding) -> Finding:
        """What is wrong with the network, of the scene."""
        given = None if found.given is None else self.text(found.given)
        return Finding(self.place(found.at), self.text(found.expected), self.text(found.fix), given)


class _This:
    """A scene as a key: itself, and none that is equal."""

    def __init__(self, scene: LineScene) -> None:
        self.scene = scene

    def __hash__(self) -> int:
        return id(self.scene)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _This) and other.scene is self.scene


def network_of(scene: Scene) -> Network:
    """The network that computes what a scene asks for: itself, or of one line.  NotInNetwork: there is none yet."""
    if isinstance(scene, LineScene):
        return _made_of(_This(scene))
    assert isinstance(scene, Network)
    return scene


@lru_cache(maxsize=MOST_KEPT)
def _made_of(key: _This) -> Network:
    """The network of a scene, kept for whoever asks for it next."""
    scene = key.scene
    made = {name: _end(getattr(scene.ends, name)) for name in ENDS}
    line: dict[str, Any] = {name: getattr(scene, name) for name in OF_LINE if getattr(scene, name) is not None}
    line |= {"start": "start", "end": "end", "connections": {name: held for name, (_, held) in made.items()}}
    line |= {key: getattr(scene.cable, key) for key in type(scene.cable).model_fields}
    if "model" in scene.model_fields_set or not isinstance(scene.model, CatenaryModel):
        line["model"] = scene.model  # else a catenary stands for none, and is a rod where it goes slack
    tables: dict[str, Any] = {
        "points": {name: point for name, (point, _) in made.items()}, "lines": {LINE: line},
        "output": _output(scene.output),
    }  # fmt: skip
    same = ("title", "environment", "obstacles", "time", "accuracy", "dimension")
    tables |= {name: getattr(scene, name) for name in same if getattr(scene, name) is not None}
    kept = {}  # an accuracy of a model that is chosen, in whose place no error figure is wanted
    if scene.output.errors is False and "accuracy" in tables:
        kept["accuracy"] = tables.pop("accuracy")
    try:
        return Network.model_validate(tables).model_copy(update=kept)
    except ValidationError as error:
        raise NotInNetwork(list(_complaints(scene, error))) from None


def short_form(scene: Scene) -> ShortForm:
    """Where the keys of the network of a scene are in that."""
    if not isinstance(scene, LineScene):
        return ShortForm((), {name: name for name in scene.lines})
    pairs: list[tuple[Place, Place]] = [(("lines", LINE), ("cable",))]
    pairs += [(("lines", LINE, name), (name,)) for name in ("model", *OF_LINE)]
    pairs += [(("output", name, LINE), ("output", name)) for name in ("points", "history")]
    for name in ENDS:
        _, called, _ = POINTS[getattr(scene.ends, name).kind]
        pairs += [(("points", name), ("ends", name)), (("lines", LINE, "connections", name), ("ends", name))]
        pairs += [(("points", name, there), ("ends", name, here)) for here, there in called.items()]
    return ShortForm(tuple(pairs), {LINE: ""})


def _end(end: End) -> tuple[dict[str, Any], dict[str, Any]]:
    """The point of an end, and how the line is connected to it."""
    kind, called, connected = POINTS[end.kind]
    given = {key: getattr(end, key) for key in type(end).model_fields if key != "kind"}
    given = {key: x for key, x in given.items() if x is not None}
    point = {called.get(key, key): _table(x) for key, x in given.items() if key not in connected}
    held = {key: x for key, x in given.items() if key in connected}
    return {"kind": kind} | point, {"kind": "clamped" if "tangent" in held else "pinned"} | held


def _table(value: Any) -> Any:
    """When an end is let go, as a point says it; all else as it is."""
    return Failure(time=value.time, tension=value.tension) if isinstance(value, Release) else value


def _output(output: Output) -> dict[str, Any]:
    """What is kept, by the name of the line where lines have their own."""
    found = {key: getattr(output, key) for key in type(output).model_fields if getattr(output, key) is not None}
    found["quantities"] = {name: q.model_copy(update={"line": LINE}) for name, q in output.quantities.items()}
    for key in ("points", "history"):
        if isinstance(found.get(key), tuple):
            found[key] = {LINE: found[key]}
    return found


def _complaints(scene: LineScene, error: ValidationError) -> Iterator[Complaint]:
    """What a network refuses, where the scene has it."""
    form = short_form(scene)
    for each in error.errors(include_url=False):
        at = tuple(x for x in each["loc"] if not str(x).startswith("<"))
        findings = (each.get("ctx") or {}).get("findings") or [Finding((), "what a network of one line has")]
        for x in findings:
            found = form.finding(Finding((*at, *x.at), x.expected, x.fix, x.given))
            yield Complaint(dotted(found.at), found.given or value_at(scene, found.at), found.expected, found.fix)
