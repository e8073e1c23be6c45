"""The schema as a tree and in plain words.

The tree says what a location leads to, the words what a key expects, and what to try when it got something else.

Everything is read off the models: types, bounds, units (in the descriptions) and the tags of unions, which show as
``<tag>`` in pydantic's locations and are dropped from the paths of keys.
"""

from __future__ import annotations

import dataclasses
import math
import re
import types
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache, reduce
from operator import or_
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import annotated_types
from pydantic import Tag
from pydantic.fields import FieldInfo

from hybrid.scene.base import (
    PATHS,
    Finding,
    Kinds,
    Place,
    PlainNumber,
    Table,
    Words,
    by_kinds,
    decimal_comma,
    dotted,
    nearest,
    speaks_of,
    unit_of,
)


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
    elif (origin is Union or origin is types.UnionType) and any(isinstance(m, Kinds) for m in metadata):
        kinds = by_kinds(annotation)
        words = Words(f"a table with kind: {' | '.join(kinds)}")
        for kind, arm in kinds.items():
            yield from arms(arm, (Tag(f"<{kind}>"), words, *metadata))
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


def _is_named(annotation: Any) -> bool:
    """Whether a type is a table whose keys are names."""
    return any(get_origin(a) is dict for a, _ in arms(annotation))


def is_tag(part: Any) -> bool:
    return isinstance(part, str) and part.startswith("<") and part.endswith(">")


def spot_of(root: type[Table], loc: Place) -> Spot:
    """What the schema has at pydantic's location `loc`."""
    spot = Spot(root, ())
    for part in loc:
        if isinstance(part, int) or _is_named(spot.annotation):
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
    return any(_is_named(a) for a in _types_at(root, path))


def _types_at(root: type[Table], path: Place) -> list[Any]:
    annotations: list[Any] = [root]
    for part in path:
        if isinstance(part, int) or any(_is_named(a) for a in annotations):
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


# A larger number would not help, as an example of how to write it.
LARGEST = 1e12

# --- types in words ----------------------------------------------------------------------------


def expected(annotation: Any, metadata: tuple[Any, ...], field: FieldInfo | None) -> str:
    """What a value should be: ``a number > 0, in kg/m``."""
    found = list(arms(annotation, metadata))
    texts = list(dict.fromkeys(_type_in_words(a, m) for a, m in found))
    # What is counted has no unit, and the keys of a table have their own.
    unit = "" if all(a is int or _tabular(a) for a, _ in found) else unit_of(field)
    return " or ".join(texts) + (f", in {unit}" if unit else "")


def _tabular(annotation: Any) -> bool:
    """Whether a type is a table, or a list of tables."""
    entry = item(annotation, 0)
    return bool(tables(annotation if entry is None else entry))


def _type_in_words(annotation: Any, metadata: tuple[Any, ...]) -> str:
    for mark in metadata:
        if isinstance(mark, Words):
            return mark.text
    if annotation is float or annotation is int:
        return ("a number" if annotation is float else "a whole number") + _bounds(metadata)
    if annotation is bool:
        return "true or false"
    if get_origin(annotation) is dict:
        return "a table with a name for each entry"
    if get_origin(annotation) is Literal:
        return f"one of: {', '.join(map(str, get_args(annotation)))}"
    if get_origin(annotation) is tuple:
        least = next((m.min_length for m in metadata if isinstance(m, annotated_types.MinLen)), 0)
        entry = " or ".join(dict.fromkeys(_type_in_words(a, m) for a, m in arms(get_args(annotation)[0])))
        return f"a list of at least {least} entries, each {entry}" if least > 1 else f"a list, each entry {entry}"
    if isinstance(annotation, type) and issubclass(annotation, Table):
        some = annotation.shown() or list(annotation.model_fields)[:2]
        return f"a table {{{', '.join(f'{name}: ...' for name in some)}}}"
    return "something else"


def _bounds(metadata: tuple[Any, ...]) -> str:
    words = []
    for mark in metadata:
        for name, sign in (("gt", ">"), ("ge", ">="), ("lt", "<"), ("le", "<=")):
            if getattr(mark, name, None) is not None:
                words.append(f"{sign} {getattr(mark, name):g}")
    return " " + " and ".join(dict.fromkeys(words)) if words else ""


# --- errors in words ---------------------------------------------------------------------------


def explain(root: type[Table], error: Mapping[str, Any]) -> list[tuple[Finding, bool]]:
    """One pydantic error as findings with full paths; True: the key itself is what is wrong."""
    kind, loc, value = error["type"], tuple(error["loc"]), error.get("input")
    path = tuple(part for part in loc if not is_tag(part))
    context = error.get("ctx") or {}
    if path and path[-1] == "[key]":  # pydantic's word for a name that its table does not take
        *at, name = path[:-1]
        words, fix = "a name of one line, without / and .: it is a key of the result file", _plain_name(str(name))
        return [(Finding((*at, name), words, f"call it {fix}"), True)]
    if kind == "findings":
        return [(Finding((*path, *f.at), f.expected, f.fix, f.given), False) for f in context["findings"]]
    if kind == "default_factory_not_called":
        return []  # a key that is absent, and whose default waits for a table that is wrong
    if kind == "too_short" and isinstance(value, list | tuple) and len(value) >= context.get("min_length", 0):
        return []  # pydantic counts only the entries that are right; those that are wrong have complaints of their own
    spot = spot_of(root, loc)
    if kind in ("extra_forbidden", "invalid_key"):
        return [(_unknown_key(root, path, spot), True)]
    words = expected(spot.annotation, spot.metadata, spot.field)
    if kind == "missing":
        bare = isinstance(value, Mapping) and list(value) == ["kind"]
        return [(Finding(path, words, _missing_fix(str(path[-1]), words, spot, bare)), False)]
    key = path[-1] if path and isinstance(path[-1], str) else ""
    if kind == "large_number":
        most = "" if "<=" in words else f", and at most {context['most']:g}"
        return [(Finding(path, words + most, "check the number and its unit: no cable needs as many"), False)]
    if kind == "tiny_number":
        zero = "" if " > 0" in words else ", or write 0"
        return [(Finding(path, f"{words}, and no less than {context['least']:g}", f"check the unit{zero}"), False)]
    return [(Finding(path, words, _fix(kind, key, value, spot) or _usual_fix(key, words, spot)), False)]


def _plain_name(name: str) -> str:
    """A name that the result file takes, as much like another as can be."""
    return "_".join(re.findall(r"\w+", name)) or "line1"


def _unknown_key(root: type[Table], path: Place, spot: Spot) -> Finding:
    """A key that its table does not have: one of another kind, misspelt, called otherwise, or of another table."""
    key, owner = str(path[-1]), spot.owner
    if owner is None:
        return Finding(path, f"a key of {dotted(path[:-1]) or _kind_of_file(root)}", "take it out")
    has_kind = bool(spot.kind) and "kind" in owner.model_fields
    table = _kind_of_file(root) if len(path) == 1 else f"kind: {spot.kind}" if has_kind else dotted(path[:-1])
    kinds = [kind for kind, other in spot.beside.items() if key in other.model_fields or key in other.former]
    own = {name: f for name, f in owner.model_fields.items() if name != "kind"}
    known = {name: f.description or "" for name, f in own.items()}
    if key in owner.instead:
        fix = owner.instead[key]
    elif key in owner.former:
        fix = f"leave one of them out: {key} is the former name of {owner.former[key]}"
    elif kinds and "kind" in owner.model_fields and not any(speaks_of(text, key) for text in known.values()):
        fix = f"use kind: {' or '.join(kinds)}, which takes {key}"
    else:
        near = nearest(key, known, {name: _named(name, f) for name, f in own.items()})
        fix = near or _elsewhere(root, key) or f"known here: {', '.join(owner.model_fields)}"
    return Finding(path, f"a key of {table}", fix)


def _kind_of_file(root: type[Table]) -> str:
    return {"Design": "a design", "Study": "a study"}.get(root.__name__, "a scene")


def _elsewhere(root: type[Table], key: str) -> str:
    """Where in the schema a key belongs that is not of its table; empty if nobody knows."""
    every = all_keys(root)
    called = [path for path in every if path.rpartition(".")[2] == key]
    described = [path for path, text in every.items() if len(key) > 1 and speaks_of(text, key)]
    found = sorted(called or described, key=lambda path: path.count("."))
    shown = [path if "." in path else f"{path} at the top of the file" for path in found[:2]]
    return f"did you mean {' or '.join(shown)}?" if found else ""


def _named(name: str, own: FieldInfo) -> str:
    """A key with its unit, or with what its table begins with."""
    unit = unit_of(own)
    inner = [table for a, _ in arms(own.annotation) for table in tables(a)]
    return f"{name} ({unit})" if unit and not inner else f"{name}: {_example('', inner[0])}" if inner else name


def _missing_fix(key: str, words: str, spot: Spot, bare: bool) -> str:
    """What to add; `bare`: the table has nothing but its kind, and may be that word alone."""
    unit, what = unit_of(spot.field), meaning(spot.field)
    found = list(arms(spot.annotation, spot.metadata))
    kinds = next((mark for _, marks in found for mark in marks if isinstance(mark, Kinds)), None)
    if bare and spot.owner is not None:
        fix = f"write `{_example(spot.kind, spot.owner)}`"
    elif kinds is None and words.startswith("a table {"):
        fix = f"add `{key}: {words.removeprefix('a table ')}`"
    elif kinds is None:
        fix = f"add `{key}: {_shape(spot)}`" + (f" ({unit})" if unit else "")
    else:
        usual = {kind: a for kind in kinds.usual for a, marks in found if Tag(f"<{kind}>") in marks}
        return "add " + " or ".join(f"`{key}: {_example(kind, table)}`" for kind, table in usual.items())
    article = "" if what.startswith(("how ", "what ", "where ", "its ", "one ")) else "the "
    return f"{fix}, {article}{what.removeprefix('the ')}" if what else fix


def _example(kind: str, table: type[Table]) -> str:
    """The shortest table of a kind, or its bare word; without a kind, a table with what it needs."""
    needs = {name: table.model_fields[name] for name in table.shown()}
    if not kind and not needs:
        needs = dict(list(table.model_fields.items())[:1])
    shapes = [f"{name}: {_shape(Spot(own.annotation, tuple(own.metadata), table, own))}" for name, own in needs.items()]
    if not kind or shapes:
        return "{" + ", ".join([f"kind: {kind}"] * bool(kind) + shapes) + "}"
    return kind


def _shape(spot: Spot) -> str:
    """How a value is written: ``[x, y, z]``, ``[{rod: ...}, {catenary: ...}]``; ``...`` where that would not help."""
    description = (spot.field.description or "") if spot.field is not None else ""
    if description.startswith("["):
        return description[: description.index("]") + 1]
    for annotation, marks in arms(spot.annotation, spot.metadata):
        words = next((mark.text for mark in marks if isinstance(mark, Words)), "")
        if "[x, y, z]" in words:
            return "[1, 0, 0]" if words.startswith("a direction") else "[x, y, z]"
        if get_origin(annotation) is tuple:
            entries = [_entry(a, m) for a, m in arms(item(annotation, 0))]
            least = next((mark.min_length for mark in marks if isinstance(mark, annotated_types.MinLen)), 0)
            shown = entries[:2] if len(entries) > 1 else entries * max(least, 1)
            return f"[{', '.join(shown)}]"
    return "..."


def _entry(annotation: Any, marks: tuple[Any, ...]) -> str:
    """How one entry of a list is written."""
    return _example("", annotation) if tables(annotation) else _shape(Spot(annotation, marks))


def _number_for_more(key: str, value: float, spot: Spot) -> str:
    """One number where a vector or a table is expected: how it would be written there."""
    marks = [mark for _, found in arms(spot.annotation, spot.metadata) for mark in found]
    if not key:  # an entry of a list
        for words in (mark.text for mark in marks if isinstance(mark, Words)):
            shape = "[x, y]" if words == "two numbers" else "[x, y, z]" if words.startswith("three numbers") else ""
            if shape:
                return f"write each entry as a list of its own, `[{shape}]` where there is one"
    if key and any(isinstance(mark, Words) and mark.text.startswith("three numbers") for mark in marks):
        return f"write `{key}: [0, 0, {value}]`" if key in ("force", "value") else f"write `{key}: [{value}, 0, 0]`"
    if key and any(isinstance(mark, Words) and mark.text == "two numbers" for mark in marks):
        return f"write `{key}: [{value}, 0]`"
    inner = tables(spot.annotation)
    if len(inner) != 1:
        return ""
    fields = inner[0].model_fields
    first, *others = inner[0].shown() or list(fields)[:1]
    if all(a is not float for a, _ in arms(fields[first].annotation)):
        return ""
    written = f"{{{first}: {value}{''.join(f', {name}: ...' for name in others)}}}"
    return f"write `{key}: {written}`" if key else f"write {written}"


def _fix(kind: str, key: str, value: Any, spot: Spot) -> str:
    unit = unit_of(spot.field)
    if kind == "literal_error":  # what is expected lists them all
        return nearest(str(value), [str(x) for a, _ in arms(spot.annotation) for x in get_args(a)])
    if kind in ("vector", "model_type") and isinstance(value, int | float) and not isinstance(value, bool):
        return _number_for_more(key, value, spot) if abs(value) < LARGEST else ""
    if value is None:
        return "give a value, or leave the key out"
    if kind in ("number", "whole_number") and isinstance(value, str):
        return _number_in_text(value, unit)
    if kind == "whole_number" and isinstance(value, float):
        return "round it" if abs(value) >= 1.5 else ""
    if kind == "finite_number":
        return "give a finite number"
    if kind == "too_short":
        marks = (m for _, each in arms(spot.annotation, spot.metadata) for m in each)
        least = next((m.min_length for m in marks if isinstance(m, annotated_types.MinLen)), 1)
        return f"give at least {least} entries" if least > 1 else "give at least one entry"
    if kind == "vector" and isinstance(value, str):
        return "write the numbers in brackets, with commas between them"
    if kind == "vector" and isinstance(value, list | tuple):
        commas = "; decimals take a point, not a comma" if len(value) > 3 else ""
        return f"count the numbers: there {'is' if len(value) == 1 else 'are'} {len(value)}{commas}"
    if kind == "truth":
        return "write true or false"
    if kind == "string_type":
        return "put it in quotes"
    if kind == "one_line":
        if isinstance(value, str) and re.search(r"(^|/)[A-Za-z]:[\a\b\t\n\v\f\r]", value):  # "C:\new.csv"
            return PATHS
        return "take out line breaks and control characters"
    if kind == "tuple_type" and isinstance(value, Mapping):
        return "start each entry with a dash"
    if kind in ("greater_than", "greater_than_equal") and isinstance(value, int | float) and value < 0:
        return "check the sign"
    return ""


def _usual_fix(key: str, words: str, spot: Spot) -> str:
    """What to try where nothing is known of why a value is wrong: how a right one is written, or to do without."""
    found = list(arms(spot.annotation, spot.metadata))
    shape = _shape(spot)
    optional = key and spot.owner is not None and spot.field is not None and not spot.field.is_required()
    without = f", or leave {key} out" if optional else ""
    if any(get_origin(a) is Literal for a, _ in found) or words.startswith("one of"):
        return f"write one of these{without}"
    if shape != "...":
        return f"write `{key}: {shape}`{without}" if key else f"write `{shape}`"
    if tables(spot.annotation) and key:
        return f"write `{key}: {words.removeprefix('a table ')}`{without}"
    if any(a is float or a is int for a, _ in found):
        return f"give {words.partition(',')[0]}{without}"
    return f"write it as in docs/scene.md{without}"


# What stands before a unit, and what it is worth.
_PREFIXES = {"": 1.0, "m": 1e-3, "c": 1e-2, "k": 1e3, "M": 1e6, "G": 1e9}


def _number_in_text(text: str, unit: str) -> str:
    words = text.split()
    if not words:
        return "give a number"
    if _is_number(text) and not math.isfinite(float(text)):
        return "give a finite number"
    if _is_number(text):
        return f"write {text.strip()} without quotes"
    if _is_number(text.replace(",", ".")):
        return decimal_comma(text)
    quantity = re.fullmatch(r"\s*([-+0-9.eE]+?)\s*([a-zA-Zµ%°].*)", text)
    if quantity and _is_number(quantity[1]):
        number, word = float(quantity[1]), quantity[2].strip()
        if not unit:
            return f"write a number alone: it is a part of 1, without a unit ({word})"
        scale = next((k for prefix, k in _PREFIXES.items() if word == prefix + unit), None)
        if scale is None:
            return f"write the number alone; the unit is {unit}"
        return f"write the number alone, {number * scale:.12g}; the unit is {unit}"
    return ""


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
