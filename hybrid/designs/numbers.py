"""Numbers of a scene by their keys: what they are, and the scene with another one."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar, cast

from hybrid.errors import Complaint, SceneError
from hybrid.kernels.state.state import Floats
from hybrid.scene.base import Invalid, Table, unit_of
from hybrid.scene.read import read_text, scene_text, text_of
from hybrid.scene.root import Scene
from hybrid.scene.yaml_source import Node, Unreadable, from_text

AnyScene = TypeVar("AnyScene", bound=Scene)
PART = re.compile(r"[^.\[\]]+")
# Part of a number by which lines are differentiated; one that is 0 is changed by this, in its own unit.
# Lengths are changed by less: a place that is at a node would see the cell to one side of it as much as that to the
# other.  So are diameters, on which it depends how deep a line lies in obstacles.
OF_NUMBER = 1e-4
OF_LENGTH = 1e-5
LENGTH = re.compile(r"\b(length|diameter)$")
# Coordinates: what they are depends on where the origin is.  Where the bed and obstacles are counts in parts of how
# deep a line lies in them: they are changed by this part, coordinates by this part of the longest line.
PLACE = re.compile(r"(position\[\d\]|centre\[\d\]|\.z|\.surface|\.at\[\d\]|\.depth\[\d+\]\[\d+\])$")
TOUCHED = re.compile(
    r"^(obstacles|environment\.seabed|bodies\.[^.]+\.shape)\.(?!.*(stiffness|damping|friction|soil))|\.surface$"
)
OF_TOUCHED = 3e-8
# What runs, and equilibria far apart, differ by parts of: of coordinates this part of the longest line, of angles (deg)
# at least a radian.
PART_OF_LENGTH, RADIAN = 0.1, math.degrees(1.0)
# Tables of how a scene is computed and written, and of what has names of its own.
COMPUTING = ("time", "output", "mesh", "accuracy", "model", "resolution")
NAMED = ("lines", "points", "bodies", "obstacles")


def number_of(scene: Scene, key: str) -> float:
    """The value of a key such as `cable.sections[0].length`; SceneError: it has no number."""
    return number_in(scene.written, key)


def number_in(tables: Table, key: str) -> float:
    """The same of tables, whatever form they have."""
    value: Any = tables
    for part in PART.findall(key):
        try:
            if isinstance(value, Table):
                value = {name: getattr(value, name) for name in type(value).model_fields}
            value = value[_index(part)] if isinstance(value, list | tuple) else value[part]
        except (KeyError, IndexError, TypeError, ValueError):
            expected = "a key of the scene that has a number"
            raise SceneError([Complaint("by", key, expected, "cable.sections[0].length, for example")]) from None
    if not isinstance(value, float):
        refuse_computing(key)
        kind = "a number that may change by a little" if isinstance(value, int) else "a number"
        raise SceneError([Complaint("by", key, f"{kind}, which {key} is not in this scene", "another key")])
    return float(value)


def _index(part: str) -> int:
    """Of a list, counted from 0; ValueError: it is written in another way."""
    if part != str(abs(int(part))):
        raise ValueError(part)
    return int(part)


def computing(key: str) -> str:
    """The part of a key by which it is of how a scene is computed; "": of what is there."""
    parts = PART.findall(key)
    return next((x for x in (parts[2:] if parts[0] in NAMED else parts) if x in COMPUTING), "")


def refuse_computing(key: str) -> None:
    """SceneError: a number of how the scene is computed, on which results depend by their errors alone."""
    if computing(key):
        expected = "a number of what is computed: of the cable, its ends, what is around it"
        raise SceneError([Complaint("by", key, expected, "cable.sections[0].length, for example")])


def at_a_bound(key: str, number: float) -> SceneError:
    """A number that may not be a little more, or less."""
    fix = f"another number than {number:g}, which is the least or the largest that it may be"
    return SceneError([Complaint("by", key, "a number that may be a little more, and less", fix)])


def size_of(asked: Scene, key: str, number: float) -> float:
    """What runs differ by parts of; SceneError: a number of how the scene is computed, which has no derivative."""
    refuse_computing(key)
    if PLACE.search(key):
        return PART_OF_LENGTH * asked.length
    if unit_of_key(asked, key) == "deg":
        return max(abs(number), RADIAN)
    return abs(number) or 1.0


def unit_of_key(scene: Scene, key: str) -> str:
    """The unit that the reference of scenes has for a key; "": none."""
    value, unit = cast(Any, scene.written), ""
    for part in PART.findall(key):
        if isinstance(value, Table):
            unit, value = unit_of(type(value).model_fields.get(part)), getattr(value, part)
        else:
            value = value[part] if isinstance(value, Mapping) else value[int(part)]
    return unit


def step_at_rest(scene: Scene, key: str, number: float) -> float:
    """By how much lines at rest with more and with less of a number differ from the scene."""
    if TOUCHED.search(key):
        return OF_TOUCHED * (scene.length if PLACE.search(key) else abs(number) or 1.0)
    return (OF_LENGTH if LENGTH.search(key) else OF_NUMBER) * (abs(number) or 1.0)


def changed_scene(scene: AnyScene, key: str, value: float) -> AnyScene:
    """The scene with another number at a key, read and checked as a file is; SceneError: it may not be that."""
    found, _ = read_text(scene_text(scene), overrides=[f"{key}={float(value)!r}"])
    assert type(found) is type(scene)
    return found


def with_number(scene: AnyScene, key: str, value: float) -> AnyScene:
    """The scene with another number at a key, not `allowed` as yet: tables beside it are those of the scene itself."""
    first, *rest = PART.findall(key)
    tables = scene.written if first in type(scene.written).model_fields else scene
    return scene.model_copy(update={first: _put(getattr(tables, first), rest, float(value))})


def allowed(scene: AnyScene) -> AnyScene:
    """A scene that was made by `with_number`; Invalid: it is none that could be read."""
    scene.model_validate(scene.model_dump(mode="python"))
    return scene


def scene_with(scene: AnyScene, keys: Sequence[tuple[str, ...]], x: Floats) -> AnyScene:
    """A scene with values at keys of each unknown; SceneError: it may not have these."""
    given = [(key, float(value)) for group, value in zip(keys, x, strict=True) for key in group]
    changed = scene
    with suppress(Invalid):
        for key, value in given:
            changed = with_number(changed, key, value)
        return allowed(changed)
    for key, value in given:
        scene = changed_scene(scene, key, value)
    return scene


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


# The text of a scene with other numbers: that of its file, with all that is written in it, where that can be.


def text_of_found(
    scene: Scene, file: str, keys: Mapping[str, Sequence[str]], numbers: Mapping[str, float],
    folder: str | Path | None = None,
) -> str:  # fmt: skip
    """The scene as YAML.  file: what it was read from, "": nothing; folder: where the text is to go, None: anywhere.

    The text of the file, with its comments, stays where every number stands in it once, and names of other files mean
    the same in the folder.
    """
    whole = scene_text(scene)
    if not file:
        return whole
    text = text_of(file)
    for name, group in keys.items():
        for key in group:
            changed = _replaced(text, key, numbers[name])
            if changed is None:
                return whole
            text = changed
    try:
        place = str(Path(folder).absolute() / "scene.yaml") if folder is not None else ""
        return text if read_text(text, place)[0] == scene else whole
    except SceneError:
        return whole


def _replaced(text: str, key: str, number: float) -> str | None:
    """The text with another number at a key; None: it does not stand there as a number of its own."""
    try:
        node: Node = from_text(text)[0]
    except Unreadable:
        return None
    for part in PART.findall(key):
        inside = node.value
        if isinstance(inside, list) and part.isdecimal() and int(part) < len(inside):
            node = inside[int(part)]
        elif isinstance(inside, dict) and part in inside:
            node = inside[part]
        else:
            return None
    lines = text.splitlines(keepends=True)
    if node.place is None or not isinstance(node.value, int | float) or node.place[0] > len(lines):
        return None
    row, column = node.place[0] - 1, node.place[1] - 1
    line = lines[row]
    if not line[column:].startswith(node.written):
        return None
    lines[row] = line[:column] + repr(number) + line[column + len(node.written) :]
    return "".join(lines)
