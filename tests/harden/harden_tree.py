"""A scene as a tree of texts that can be harmed: keys may be there twice, values may be anything, places are known.

`to_tree` reads a scene of plain data, `write` puts every key on a line of its own and says which line each has.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any


@dataclass(eq=False)
class Leaf:
    """A value as it is written."""

    text: str


@dataclass(eq=False)
class Row:
    """A list."""

    entries: list[Any] = field(default_factory=list)


@dataclass(eq=False)
class Entry:
    """A key with its value."""

    key: str
    value: Any


@dataclass(eq=False)
class Box:
    """A table."""

    entries: list[Entry] = field(default_factory=list)

    def find(self, key: str) -> Entry | None:
        return next((e for e in self.entries if e.key == key), None)

    def get(self, *path: str) -> Any:
        """The value at a path of keys; None if there is none."""
        here: Any = self
        for key in path:
            found = here.find(key) if isinstance(here, Box) else None
            if found is None:
                return None
            here = found.value
        return here

    def put(self, key: str, value: Any) -> Entry:
        found = self.find(key)
        if found is None:
            found = Entry(key, value)
            self.entries.append(found)
        found.value = value
        return found


def to_tree(data: Any) -> Any:
    if isinstance(data, dict):
        return Box([Entry(str(k), to_tree(v)) for k, v in data.items()])
    if isinstance(data, list | tuple):
        return Row([to_tree(v) for v in data])
    if data is None:
        return Leaf("null")
    if isinstance(data, bool):
        return Leaf(str(data).lower())
    if isinstance(data, int | float):
        text = repr(data)
        return Leaf(text.replace("e", ".0e") if "e" in text and "." not in text else text)
    return Leaf('"' + str(data).replace("\\", "\\\\").replace('"', '\\"') + '"')


def walk(node: Any, inside: tuple[Any, ...] = ()) -> Iterator[tuple[tuple[Any, ...], Entry]]:
    """Every entry of every table, with the tables and lists around it, the outermost first."""
    if isinstance(node, Box):
        for entry in node.entries:
            yield (*inside, node), entry
            yield from walk(entry.value, (*inside, node))
    elif isinstance(node, Row):
        for value in node.entries:
            yield from walk(value, (*inside, node))


def write(tree: Box) -> tuple[str, dict[int, int]]:
    """The text, and the line of every entry and table by its identity."""
    lines: list[str] = []
    places: dict[int, int] = {id(tree): 1}

    def flow(value: Any) -> str:
        if isinstance(value, Leaf):
            return value.text
        if isinstance(value, Row):
            return "[" + ", ".join(flow(v) for v in value.entries) + "]"
        places.setdefault(id(value), len(lines) + 1)
        for entry in value.entries:
            places[id(entry)] = len(lines) + 1
        return "{" + ", ".join(f"{e.key}: {flow(e.value)}" for e in value.entries) + "}"

    def tables(value: Any) -> bool:
        return isinstance(value, Row) and bool(value.entries) and all(isinstance(v, Box) for v in value.entries)

    def block(box: Box, indent: str, first: str) -> None:
        for k, entry in enumerate(box.entries):
            head = first if k == 0 else indent
            places[id(entry)] = len(lines) + 1
            value = entry.value
            if isinstance(value, Box) and value.entries:
                places[id(value)] = len(lines) + 1
                lines.append(f"{head}{entry.key}:")
                block(value, indent + "  ", indent + "  ")
            elif tables(value):
                places[id(value)] = len(lines) + 1
                lines.append(f"{head}{entry.key}:")
                for each in value.entries:
                    places[id(each)] = len(lines) + 1
                    if each.entries:
                        block(each, indent + "    ", indent + "  - ")
                    else:
                        lines.append(indent + "  - {}")
            else:
                lines.append(f"{head}{entry.key}: {flow(value)}")
                places[id(value)] = len(lines)

    block(tree, "", "")
    return "\n".join(lines) + "\n", places
