"""The root of every scene: what its two forms, `cable` with `ends` and `points` with `lines`, have in common."""

from __future__ import annotations

import math
from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal, Self, TypeVar

from pydantic import Field, GetCoreSchemaHandler
from pydantic.json_schema import models_json_schema
from pydantic_core import CoreSchema, core_schema

from hybrid.errors import SceneError
from hybrid.scene.accuracy import Accuracy
from hybrid.scene.analysis import OUTPUTS, PER_PERIOD, UNASKED_BYTES, VALUES, Time, missing_time
from hybrid.scene.base import Table, Text
from hybrid.scene.cable import Environment
from hybrid.scene.motion_tables import Motion
from hybrid.scene.obstacles import Obstacles

# Where the classes of the two forms are, which know this one: of one cable, and of points and lines.
SHORT, LONG = ("hybrid.scene.schema", "LineScene"), ("hybrid.scene.network_scene", "Network")
# pydantic leaves a bound under its own name where a validator of ours stands before the number
_STANDARD = {"gt": "exclusiveMinimum", "ge": "minimum", "lt": "exclusiveMaximum", "le": "maximum"}


def names_lines(data: Any) -> bool:
    """Whether the tables of a scene are points and lines, and not a cable and its ends."""
    return isinstance(data, Mapping) and ("lines" in data or "points" in data) and "cable" not in data


def form_of(data: Any) -> type[Scene]:
    """The class of the form in which a scene or its tables are written; it takes some time to make."""
    if isinstance(data, Scene):
        return type(data)
    home, name = LONG if names_lines(data) else SHORT
    found: type[Scene] = getattr(import_module(home), name)  # by name: both are made of this file
    return found


class Scene(Table):
    """What is there and what is asked: lines, points and bodies, or a cable and its ends, and their environment."""

    title: Text = Field(default="", description="a line for people; it heads plots and reports")
    environment: Environment = Field(default=Environment(), description="what acts from outside")

    if TYPE_CHECKING:  # what both forms have, each in its own way, and what the short one has

        def __init__(self, **tables: Any) -> None: ...
        @property
        def lines(self) -> Mapping[str, Any]: ...
        @property
        def points(self) -> Mapping[str, Any]: ...
        @property
        def bodies(self) -> Mapping[str, Any]: ...
        @property
        def cable(self) -> Any: ...
        @property
        def ends(self) -> Any: ...
        @property
        def initial(self) -> Any: ...
        @property
        def model(self) -> Any: ...
        @property
        def mesh(self) -> Any: ...
        @property
        def resolution(self) -> Any: ...
        @property
        def contact(self) -> Any: ...
        @property
        def obstacles(self) -> Obstacles: ...
        @property
        def time(self) -> Time | None: ...
        @property
        def output(self) -> Any: ...
        @property
        def accuracy(self) -> Accuracy | None: ...
        @property
        def dimension(self) -> Literal[2, 3] | None: ...
        @property
        def free(self) -> tuple[str, ...]: ...
        @property
        def adaptive(self) -> tuple[str, ...]: ...
        @property
        def starts_as_placed(self) -> bool: ...
        @property
        def motions(self) -> list[Motion]: ...
        @property
        def length(self) -> float: ...
        @property
        def points_kept(self) -> int: ...
        @property
        def lasting_period(self) -> float: ...
        @property
        def scenes_of_lines(self) -> Mapping[str, Any]: ...
        def scene_of(self, name: str) -> Any: ...
        def key_of(self, name: str) -> str: ...
        def without_friction(self) -> Self: ...
        def with_lines(self, changes: Mapping[str, Mapping[str, Any]]) -> Self: ...

    def __new__(cls, **tables: Any) -> Self:
        """A scene of the form in which its tables are written."""
        kind: Any = form_of(tables) if cls is Scene else cls
        found: Self = super().__new__(kind)
        return found

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(_as_written) if cls is Scene else handler(source)

    @classmethod
    def model_json_schema(cls, *args: Any, **kwargs: Any) -> dict[str, Any]:
        """JSON Schema of a scene file; bounds in the words that editors know."""
        if cls is not Scene:
            return dict(_standard(super().model_json_schema(*args, **kwargs)))
        short, long = form_of({}), form_of({"lines": {}})
        refs, found = models_json_schema([(short, "validation"), (long, "validation")])
        keys = {"if": {"anyOf": [{"required": ["lines"]}, {"required": ["points"]}], "not": {"required": ["cable"]}}}
        forms = {"then": refs[long, "validation"], "else": refs[short, "validation"]}
        return dict(_standard(keys | forms | found))

    def require_time(self) -> Time:
        """The `time` table; SceneError if there is none."""
        if self.time is None:
            raise SceneError([missing_time()])
        return self.time

    @property
    def size_of_output(self) -> int:
        """Bytes of an output in the file, roughly."""
        asked = self.output.errors
        wanted = self.accuracy is not None or (self.time is not None and self.time.controlled)
        return int(8 * VALUES * self.points_kept * (1 + (wanted if asked is None else asked)))

    @property
    def output_interval(self) -> float:
        """Time between two outputs [s]."""
        if self.output.every is not None:
            return float(self.output.every)
        time = self.require_time()
        wanted = max(OUTPUTS, math.ceil(min(PER_PERIOD * time.duration / self.lasting_period, 1e9)))
        most = max(OUTPUTS, int(UNASKED_BYTES / self.size_of_output))
        return max(time.duration / min(wanted, most), time.step or 0.0)


SomeScene = TypeVar("SomeScene", bound=Scene)


def _as_written(data: Any) -> Scene:
    """A scene of the form in which its tables are written; one that is read already as it is."""
    return form_of(data).model_validate(data)


def _standard(schema: Any) -> Any:
    if isinstance(schema, dict):
        return {_STANDARD.get(k, k) if not isinstance(v, dict) else k: _standard(v) for k, v in schema.items()}
    return [_standard(x) for x in schema] if isinstance(schema, list) else schema
