"""The schema as a tree: what a location or a path leads to, and which keys, kinds and descriptions stand there.

Everything is read off the models: types, bounds, units (in the descriptions) and the tags of unions, which show as
``<tag>`` in pydantic's locations and are dropped from the paths of keys.
"""

from __future__ import annotations

import dataclasses
import re
import types
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, reduce
from operator import or_
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import Tag
from pydantic.fields import FieldInfo

from hybrid.scene.base import Place, PlainNumber, Table, dotted


@dataclass(frozen=True)
class Spot:
    """Where a location leads: the type there, the table and field it belongs to, the tag of that table.

    kinds: of a union the tables by tag; beside: those of the union that the owner is of.
    """

    annotation: Any
    metadata: tuple[Any, ...]
    owner: type[Table] | None = None
    field: FieldInfo | None = None
    kind: str = ""
    kinds: dict[str, type[Table]] = dataclasses.field(default_factory=dict)
    beside: dict[str, type[Table]] = dataclasses.field(default_factory=dict)


def arms(annotation: Any, metadata: tuple[Any, ...] = ()) -> Iterator[tuple[Any, tuple[Any, ...]]]:
    """The types a value may have: unions and Annotated taken apart, None left out."""
    origin = get_origin(annotation)
    if origin is Annotated:
        inner, *extra = get_args(annotation)
        flat = [m for e in extra for m in (e.metadata if isinstance(e, FieldInfo) else [e])]
        yield from arms(inner, (*flat, *metadata))
    elif origin is Union or origin is types.UnionType:
        for arm in get_args(annotation):
            yield from arms(arm, metadata)
    elif annotation is not type(None):
        yield annotation, metadata


def tables(annotation: Any) -> list[type[Table]]:
    """The tables that a value may be."""
    return [a for a, _ in arms(annotation) if isinstance(a, type) and issubclass(a, Table)]


def item(annotation: Any, index: int) -> Any:
    """The type of one entry of a list, or of a table whose keys are names; None if there is none."""
    found = []
    for a, _ in arms(annotation):
        args = get_args(a)
        if get_origin(a) is dict:
            found.append(args[1])
        if get_origin(a) is tuple and args:
            found.append(args[0] if args[-1] is Ellipsis else args[min(index, len(args) - 1)])
    return reduce(or_, found) if found else None


def _named(annotation: Any) -> bool:
    """Whether a type is a table whose keys are names."""
    return any(get_origin(a) is dict for a, _ in arms(annotation))


def is_tag(part: Any) -> bool:
    return isinstance(part, str) and part.startswith("<") and part.endswith(">")


def spot_of(root: type[Table], loc: Place) -> Spot:
    """What the schema has at pydantic's location `loc`."""
    spot = Spot(root, ())
    for part in loc:
        if isinstance(part, int) or _named(spot.annotation):
            spot = Spot(
                item(spot.annotation, 0 if isinstance(part, str) else part), (), spot.owner, spot.field, spot.kind
            )
        elif is_tag(part):
            every = list(arms(spot.annotation, spot.metadata))
            chosen = [(a, m) for a, m in every if Tag(part) in m]
            # several arms under one tag are told apart by the tag that follows
            annotation, metadata = chosen[0] if len(chosen) == 1 else (spot.annotation, spot.metadata)
            kinds = {mark.tag.strip("<>"): a for a, m in every for mark in m if isinstance(mark, Tag) and tables(a)}
            spot = Spot(annotation, metadata, spot.owner, spot.field, part.strip("<>"), kinds)
        else:
            found = tables(spot.annotation)
            owner = found[0] if len(found) == 1 else None
            own = owner.model_fields.get(owner.former.get(part, part)) if owner is not None else None
            annotation, metadata = (own.annotation, tuple(own.metadata)) if own is not None else (None, ())
            spot = Spot(annotation, metadata, owner, own, spot.kind, {}, spot.kinds)
    return spot


def tables_at(root: type[Table], path: Place) -> list[type[Table]]:
    """The tables that any branch of the schema has at `path`."""
    return [table for a in _types_at(root, path) for table in tables(a)]


def has_names(root: type[Table], path: Place) -> bool:
    """Whether what is at `path` may be a table whose keys are names."""
    return any(_named(a) for a in _types_at(root, path))


def _types_at(root: type[Table], path: Place) -> list[Any]:
    annotations: list[Any] = [root]
    for part in path:
        if isinstance(part, int) or any(_named(a) for a in annotations):
            annotations = [item(a, 0 if isinstance(part, str) else part) for a in annotations]
        else:
            found = [t.model_fields.get(t.former.get(part, part)) for a in annotations for t in tables(a)]
            annotations = [field.annotation for field in found if field is not None]
        annotations = [a for a in annotations if a is not None]
    return annotations


def keys_at(root: type[Table], path: Place) -> list[str]:
    """All keys that any branch of the schema knows in the table at `path`, those of today first."""
    found = tables_at(root, path)
    return list(dict.fromkeys([*(n for t in found for n in t.model_fields), *(n for t in found for n in t.former)]))


def shorthand_keys(root: type[Table], path: Place) -> tuple[str, ...]:
    """The keys that a bare word or number at `path` stands for (``model: rod`` is ``{kind: rod}``)."""
    spot = spot_of(root, path)
    for mark in [*spot.metadata, *(m for _, found in arms(spot.annotation) for m in found)]:
        if isinstance(mark, PlainNumber):
            return mark.keys
    return ("kind",) if "kind" in keys_at(root, path) else ()


def meaning(of: FieldInfo | None) -> str:
    """The beginning of a description, up to its first stop."""
    text = (of.description or "") if of is not None else ""
    return re.split(r"[;:(\[]", text)[0].strip(" ,")


@cache
def all_keys(root: type[Table]) -> dict[str, str]:
    """The description of every key of the schema, by its path without brackets of lists."""
    return dict(_every_key(root, ()))


def _every_key(root: type[Table], path: Place) -> Iterator[tuple[str, str]]:
    for name, own in root.model_fields.items():
        yield dotted((*path, name)), own.description or ""
        for annotation, _ in arms(own.annotation):
            for table in tables(item(annotation, 0) or annotation):
                yield from _every_key(table, (*path, name))
