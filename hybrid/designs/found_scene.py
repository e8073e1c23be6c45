"""The text of a scene with other numbers: that of its file, with all that is written in it, where that can be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from hybrid.designs.numbers import PART
from hybrid.errors import SceneError
from hybrid.scene.read import read_text, scene_text, text_of
from hybrid.scene.root import Scene
from hybrid.scene.yaml_source import Node, Unreadable, from_text


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
