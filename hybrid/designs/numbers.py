"""Numbers of a scene by their keys: what they are, and the scene with another one."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar, cast

import numpy as np

from hybrid.errors import Complaint, SceneError
from hybrid.kernels.state.state import Floats
from hybrid.scene.base import Invalid, Table, unit_of
from hybrid.scene.read import parse_either, scene_text
from hybrid.scene.schema import Scene
from hybrid.scene.system import System

AnyScene = TypeVar("AnyScene", bound=Scene | System)
PART = re.compile(r"[^.\[\]]+")
# Part of a number by which lines are differentiated; one that is 0 is changed by this, in its own unit.  Lengths are
# changed by less: a place that is at a node would see the cell to one side of it as much as that to the other.
OF_NUMBER, OF_LENGTH, LENGTH = 1e-4, 1e-5, re.compile(r"\blength$")


def number_of(scene: Scene | System, key: str) -> float:
    """The value of a key such as `cable.sections[0].length`; SceneError: it has no number."""
    value: Any = scene.model_dump(mode="python")
    for part in PART.findall(key):
        try:
            value = value[int(part)] if isinstance(value, list | tuple) else value[part]
        except (KeyError, IndexError, TypeError, ValueError):
            expected = "a key of the scene that has a number"
            raise SceneError([Complaint("by", key, expected, "cable.sections[0].length, for example")]) from None
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise SceneError([Complaint("by", key, f"a number, which {key} is not in this scene", "another key")])
    return float(value)


def unit_of_key(scene: Scene | System, key: str) -> str:
    """The unit that the reference of scenes has for a key; "": none."""
    value, unit = cast(Any, scene), ""
    for part in PART.findall(key):
        if isinstance(value, Table):
            unit, value = unit_of(type(value).model_fields.get(part)), getattr(value, part)
        else:
            value = value[part] if isinstance(value, Mapping) else value[int(part)]
    return unit


class OfScene:
    """What is computed of a scene, and differentiated by its numbers."""

    scene: Scene | System

    def number(self, key: str) -> float:
        """The value of a key of the scene."""
        return number_of(self.scene, key)

    def numbers_and_steps(self, keys: Sequence[str]) -> tuple[Floats, Floats]:
        """(P,) values of keys, and by how much lines with more and with less of each differ from the scene."""
        numbers = np.array([self.number(key) for key in keys])
        parts = np.array([OF_LENGTH if LENGTH.search(key) else OF_NUMBER for key in keys])
        return numbers, np.where(numbers == 0.0, parts, parts * np.abs(numbers))


def changed_scene(scene: AnyScene, key: str, value: float) -> AnyScene:
    """The scene with another number at a key, read and checked as a file is; SceneError: it may not be that."""
    found, _ = parse_either(scene_text(scene), overrides=[f"{key}={float(value)!r}"])
    assert type(found) is type(scene)
    return found


def with_number(scene: AnyScene, key: str, value: float) -> AnyScene:
    """The scene with another number at a key, unchecked: tables beside the key are those of the scene itself."""
    found: AnyScene = _put(scene, PART.findall(key), float(value))
    return found


def is_allowed(scene: Scene | System) -> bool:
    """Whether a scene that was made by `with_number` is one that could be read."""
    try:
        type(scene).model_validate(scene.model_dump(mode="python"))
    except Invalid:
        return False
    return True


def is_allowed_line(system: System, name: str) -> bool:
    """The same of one line of several that was made by `with_number`."""
    try:
        system.checked_scene(name)
    except Invalid:
        return False
    return True


def scene_with(scene: AnyScene, keys: Sequence[tuple[str, ...]], x: Floats) -> AnyScene:
    """A scene with values at keys of each unknown; SceneError: it may not have these."""
    given = [(key, float(value)) for group, value in zip(keys, x, strict=True) for key in group]
    changed = scene
    for key, value in given:
        changed = with_number(changed, key, value)
    if not is_allowed(changed):
        for key, value in given:
            scene = changed_scene(scene, key, value)
        return scene
    return changed


def _put(value: Any, parts: list[str], number: float) -> Any:
    if not parts:
        return number
    first, rest = parts[0], parts[1:]
    if isinstance(value, Table):
        return value.model_copy(update={first: _put(getattr(value, first), rest, number)})
    if isinstance(value, Mapping):
        return {**value, first: _put(value[first], rest, number)}
    place = int(first)
    return type(value)([_put(x, rest, number) if k == place else x for k, x in enumerate(value)])
