"""The one root of a scene, and the short form of one line.

A scene is points, bodies, lines and their environment, also where it was written as a cable: a network of one line.

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
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

from pydantic import (
    PrivateAttr,
    SerializationInfo,
    SerializerFunctionWrapHandler,
    ValidationError,
    model_serializer,
    model_validator,
)
from pydantic.functional_validators import ModelWrapValidatorHandler as Handler
from pydantic.json_schema import models_json_schema

from hybrid.errors import Complaint, ComputationError, SceneError
from hybrid.scene.analysis import CatenaryModel, Output
from hybrid.scene.base import Finding, Place, dotted, refuse
from hybrid.scene.cable import Contact
from hybrid.scene.ends import (
    Body,
    Clamped,
    ClampedConnection,
    Connection,
    End,
    Ends,
    Free,
    FreePoint,
    Guided,
    Pinned,
    Point,
)
from hybrid.scene.motion_checks import motion_findings
from hybrid.scene.network import Network
from hybrid.scene.network_checks import findings_of
from hybrid.scene.schema import CableScene, LineScene, standard_schema

LINE = "cable"
SHORT = "short form"  # under which a scene keeps its tables in that
ENDS = ("start", "end")
# Tables of a scene that a line has.
OF_LINE = ("mesh", "resolution", "contact", "initial")
# Those that both forms have.
SAME = ("title", "environment", "obstacles", "time", "accuracy", "dimension")
# Keys of the output that are by name of the line.
OF_PLACES = ("points", "history")
# Of an end by its kind: the kind of its point, what keys of the point are called there, which keys the connection has.
POINTS: dict[str, tuple[str, dict[str, str], tuple[str, ...]]] = {
    "pinned": ("fixed", {"release_at": "break_at"}, ("payout",)),
    "clamped": (
        "fixed",
        {"release_at": "break_at"},
        ("tangent", "normal", "turns", "swivel", "bend_stiffness", "payout"),
    ),
    "guided": ("guided", {}, ("tangent", "normal", "turns")),
    "free": ("free", {}, ()),
    "body": ("free", {"thrust": "force"}, ()),
}

# What networks say of points, and what is said of ends.
WORDS = {
    "gives way": "is let go",
    "break_at": "release_at",
    "; what came loose is free": " and is free",
    "a moment at a point": "an end moment",
    "points and bodies move otherwise": "the ends move otherwise",
}


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
    def in_words(self) -> Iterator[None]:
        """What fails within, of the network, is said in words of the scene."""
        try:
            yield
        except ComputationError as error:
            raise self.error(error) from None
        except SceneError as error:
            t = self.text
            said = [
                Complaint(t(x.where), t(x.value), t(x.expected), t(x.fix), x.line, x.column) for x in error.complaints
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


def network_tables(scene: CableScene) -> dict[str, Any]:
    """The tables of the network of a cable."""
    made = {name: _point_of(getattr(scene.ends, name)) for name in ENDS}
    line: dict[str, Any] = {name: getattr(scene, name) for name in OF_LINE if getattr(scene, name) is not None}
    line |= {"start": "start", "end": "end", "connections": {name: held for name, (_, held) in made.items()}}
    line |= {key: getattr(scene.cable, key) for key in type(scene.cable).model_fields}
    if "model" in scene.model_fields_set or not isinstance(scene.model, CatenaryModel):
        line["model"] = scene.model  # else a catenary stands for none, and is a rod where it goes slack
    tables: dict[str, Any] = {
        "points": {name: point for name, (point, _) in made.items()},
        "lines": {LINE: line},
        "output": _output(scene.output),
    }
    return tables | {name: getattr(scene, name) for name in SAME if getattr(scene, name) is not None}


def line_of(network: Network) -> CableScene:
    """The cable of which a network was made."""
    line = network.lines[LINE]
    tables: dict[str, Any] = {name: getattr(line, name) for name in (*OF_LINE, "cable")}
    tables |= {name: getattr(network, name) for name in SAME}
    tables |= {"model": line.chosen_model, "accuracy": line.accuracy or network.accuracy}
    tables["ends"] = Ends(**{name: _end_of(network.points[name], getattr(line.connections, name)) for name in ENDS})
    kept = {key: getattr(network.output, key) for key in Output.model_fields}
    kept |= {"points": network.output.points_of(LINE), "history": network.output.history.get(LINE)}
    kept["quantities"] = {name: q.model_copy(update={"line": None}) for name, q in kept["quantities"].items()}
    return CableScene.model_construct(**tables, output=Output.model_construct(**kept))


def tables_of_cable(update: Mapping[str, Any]) -> dict[str, Any]:
    """Of changed tables those that a cable has, and a network has not, or of another kind."""
    own = {"cable", "ends", "model", *OF_LINE} - {"contact"}
    return {key: x for key, x in update.items() if key in own or type(x) in (Output, Contact)}


def short_form(scene: CableScene) -> ShortForm:
    """Where the keys of the network of a cable are in its scene."""
    pairs: list[tuple[Place, Place]] = [(("lines", LINE), ("cable",))]
    pairs += [(("lines", LINE, name), (name,)) for name in ("model", *OF_LINE)]
    pairs += [(("output", name, LINE), ("output", name)) for name in OF_PLACES]
    for name in ENDS:
        _, called, _ = POINTS[getattr(scene.ends, name).kind]
        pairs += [(("points", name), ("ends", name)), (("lines", LINE, "connections", name), ("ends", name))]
        pairs += [(("points", name, there), ("ends", name, here)) for here, there in called.items()]
    return ShortForm(tuple(pairs), {LINE: ""})


def _point_of(end: End) -> tuple[dict[str, Any], dict[str, Any]]:
    """The point of an end, and how the line is connected to it."""
    kind, called, connected = POINTS[end.kind]
    given = {key: getattr(end, key) for key in type(end).model_fields if key != "kind"}
    given = {key: x for key, x in given.items() if x is not None}
    point = {called.get(key, key): x for key, x in given.items() if key not in connected}
    held = {key: x for key, x in given.items() if key in connected}
    return {"kind": kind} | point, {"kind": "clamped" if "tangent" in held else "pinned"} | held


def _end_of(point: Point, held: Connection) -> End:
    """The end of a cable from its point and how the line is connected to that."""
    clamped, body = isinstance(held, ClampedConnection), isinstance(point, FreePoint) and point.is_body
    made = {"fixed": Clamped if clamped else Pinned, "guided": Guided, "free": Body if body else Free}[point.kind]
    _, called, connected = POINTS[made.model_fields["kind"].default]
    keys = [key for key in made.model_fields if key != "kind"]
    given = {key: getattr(held if key in connected else point, called.get(key, key)) for key in keys}
    return made(**given)


def _output(output: Output) -> dict[str, Any]:
    """What is kept, by the name of the line where lines have their own."""
    found = {key: getattr(output, key) for key in type(output).model_fields if getattr(output, key) is not None}
    found["quantities"] = {name: q.model_copy(update={"line": LINE}) for name, q in output.quantities.items()}
    for key in OF_PLACES:
        if isinstance(found.get(key), tuple):
            found[key] = {LINE: found[key]}
    return found


def names_lines(data: Any) -> bool:
    """Whether the tables of a scene are points and lines, and not a cable and its ends."""
    return isinstance(data, Mapping) and ("lines" in data or "points" in data) and "cable" not in data


def _of_cable(key: str) -> Any:
    """A table of a scene that was written as a cable; AttributeError: it was not."""

    def table(scene: Scene) -> Any:
        if scene.written is scene:
            raise AttributeError(key)
        return getattr(scene.written, key)

    return property(table)


class Scene(Network):
    """What is there and what is asked: points, bodies, lines, and their environment.

    `cable` and `ends`, the short form of one line, are turned into these where a scene is read; `form` tells what
    everything is called there, and a scene is written as it was read.
    """

    _short: bool = PrivateAttr(default=False)

    # What Python code reads of a cable: tables that a network has under its lines and points.
    cable, ends, initial, model = (_of_cable(key) for key in ("cable", "ends", "initial", "model"))
    mesh, resolution = (_of_cable(key) for key in ("mesh", "resolution"))

    if TYPE_CHECKING:

        def __init__(self, **tables: Any) -> None: ...

    def __eq__(self, other: object) -> bool:
        """Whether all tables are the same, in whatever form they were written."""
        return isinstance(other, Scene) and dict(self) == dict(other)

    @model_validator(mode="wrap")
    @classmethod
    def _as_written(cls, data: Any, handler: Handler[Self]) -> Self:
        """A scene of its tables, in either form."""
        line = data
        if isinstance(data, Mapping) and not names_lines(data):
            line = CableScene.model_validate(data)
        if not isinstance(line, CableScene):
            scene = handler(data)
            for findings in findings_of(scene):
                refuse(findings)
            return scene
        refuse(motion_findings({name: getattr(line, name) for name in CableScene.model_fields}))
        try:
            scene = handler(network_tables(line))
        except ValidationError as error:
            refuse(short_form(line).finding(x) for x in _refused(error))
            raise
        for findings in findings_of(scene, judged=True):
            refuse(short_form(line).finding(x) for x in findings)
        scene._short = True
        scene._known_scenes[SHORT] = line
        return scene

    @model_serializer(mode="wrap")
    def _written(self, handler: SerializerFunctionWrapHandler, info: SerializationInfo) -> dict[str, Any]:
        keys = ("mode", "by_alias", "exclude_unset", "exclude_defaults", "exclude_none", "include", "exclude")
        asked = {key: getattr(info, key) for key in keys}
        return self.written.model_dump(**asked) if self._short else dict(handler(self))

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """The same with other tables, in the form in which it was written or as a network."""
        cable = tables_of_cable(update or {}) if self._short else {}
        made = super().model_copy(update={k: x for k, x in (update or {}).items() if k not in cable}, deep=deep)
        return self.model_validate(made._as_cable.model_copy(update=cable)) if cable else made

    @classmethod
    def model_json_schema(cls, *args: Any, **kwargs: Any) -> dict[str, Any]:
        """JSON Schema of a scene file, in either form."""
        refs, found = models_json_schema([(CableScene, "validation"), (Network, "validation")])
        keys = {"if": {"anyOf": [{"required": ["lines"]}, {"required": ["points"]}], "not": {"required": ["cable"]}}}
        forms = {"then": refs[Network, "validation"], "else": refs[CableScene, "validation"]}
        return dict(standard_schema(keys | forms | found))

    # --- as it was written ----------------------------------------------------------------------

    @property
    def written(self) -> CableScene | Network:
        """The tables in the form in which it was written."""
        return self._as_cable if self._short else self

    @property
    def _as_cable(self) -> CableScene:
        """The tables in the short form."""
        known = self._known_scenes
        if SHORT not in known:
            known[SHORT] = line_of(self)
        return known[SHORT]

    @property
    def form(self) -> ShortForm:
        """What keys, lines and places are called where it was written."""
        return short_form(self._as_cable) if self._short else ShortForm((), {name: name for name in self.lines})

    @property
    def asked_lines(self) -> Mapping[str, Any]:
        """The lines by the names that they have where the scene was written, "" of a cable."""
        return {"": self.asked_scene("")} if self._short else self.lines

    @property
    def asked_scenes(self) -> dict[str, LineScene]:
        """Each line with the points that it carries, by the same names."""
        return {"": self.asked_scene("")} if self._short else self.scenes_of_lines

    def asked_scene(self, name: str) -> LineScene:
        """A line as it was asked for; name: here or where it was written."""
        if not self._short:
            return self.scene_of(name)
        known = self._known_scenes
        if ("", ()) not in known:
            known["", ()] = LineScene(**dict(self._as_cable))
        return known["", ()]


def in_full(scene: Scene) -> Scene:
    """The scene with points and lines, also where it was written as a cable."""
    return Scene.model_validate(network_tables(scene._as_cable)) if scene._short else scene


def _refused(error: ValidationError) -> Iterator[Finding]:
    """What tables of a network refuse, each under its own key of the network."""
    for each in error.errors(include_url=False):
        at = tuple(x for x in each["loc"] if not str(x).startswith("<"))
        for x in (each.get("ctx") or {}).get("findings") or [Finding((), "what a network of one line has")]:
            yield Finding((*at, *x.at), x.expected, x.fix, x.given)
