"""The one root of a scene: points, bodies, lines and their environment, also where it was written as a cable."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
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

from hybrid.scene.base import Finding, refuse
from hybrid.scene.motion_checks import motion_findings
from hybrid.scene.network import Network
from hybrid.scene.network_checks import findings_of
from hybrid.scene.schema import LineScene, SceneTables, standard_schema
from hybrid.scene.short_form import ShortForm, line_of, network_tables, short_form, tables_of_cable


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
            line = LineScene.model_validate(data)
        if not isinstance(line, LineScene):
            return handler(data)
        refuse(motion_findings({name: getattr(line, name) for name in LineScene.model_fields}))
        try:
            scene = handler(network_tables(line))
        except ValidationError as error:
            refuse(_refused(line, error))
            raise
        scene._short = True
        scene._known_scenes["", ()] = line
        return scene

    @model_validator(mode="after")
    def _no_contradiction(self) -> Self:
        for findings in findings_of(self):
            refuse(findings)
        return self

    @model_serializer(mode="wrap")
    def _written(self, handler: SerializerFunctionWrapHandler, info: SerializationInfo) -> dict[str, Any]:
        keys = ("mode", "by_alias", "exclude_unset", "exclude_defaults", "exclude_none", "include", "exclude")
        asked = {key: getattr(info, key) for key in keys}
        return self.written.model_dump(**asked) if self._short else dict(handler(self))

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """The same with other tables, in the form in which it was written or as a network."""
        cable = tables_of_cable(update or {}) if self._short else {}
        made = super().model_copy(update={k: x for k, x in (update or {}).items() if k not in cable}, deep=deep)
        return self.model_validate(made.asked_scene("").model_copy(update=cable)) if cable else made

    @classmethod
    def model_json_schema(cls, *args: Any, **kwargs: Any) -> dict[str, Any]:
        """JSON Schema of a scene file, in either form."""
        refs, found = models_json_schema([(LineScene, "validation"), (Network, "validation")])
        keys = {"if": {"anyOf": [{"required": ["lines"]}, {"required": ["points"]}], "not": {"required": ["cable"]}}}
        forms = {"then": refs[Network, "validation"], "else": refs[LineScene, "validation"]}
        return dict(standard_schema(keys | forms | found))

    # --- as it was written ----------------------------------------------------------------------

    @property
    def written(self) -> SceneTables:
        """The tables in the form in which it was written."""
        return self.asked_scene("") if self._short else self

    @property
    def form(self) -> ShortForm:
        """What keys, lines and places are called where it was written."""
        return short_form(self.asked_scene("")) if self._short else ShortForm((), {name: name for name in self.lines})

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
            known["", ()] = line_of(self)
        return known["", ()]


def in_full(scene: Scene) -> Scene:
    """The scene with points and lines, also where it was written as a cable."""
    return Scene.model_validate(network_tables(scene.asked_scene(""))) if scene.written is not scene else scene


def _refused(line: LineScene, error: ValidationError) -> Iterator[Finding]:
    """What the network of a cable refuses, where the cable has it."""
    form = short_form(line)
    for each in error.errors(include_url=False):
        at = tuple(x for x in each["loc"] if not str(x).startswith("<"))
        for x in (each.get("ctx") or {}).get("findings") or [Finding((), "what a network of one line has")]:
            yield form.finding(Finding((*at, *x.at), x.expected, x.fix, x.given))
