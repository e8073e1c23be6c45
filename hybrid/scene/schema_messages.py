"""The schema in plain words: what a key expects, and what to try when it got something else.

Everything is read off the models: types, bounds, units (in the descriptions) and the tags of
unions, which show as ``<tag>`` in pydantic's locations and are dropped from the paths of keys.
"""

from __future__ import annotations

import re
import types
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import reduce
from operator import or_
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import annotated_types
from pydantic import Tag
from pydantic.fields import FieldInfo

from hybrid.scene.base import Finding, Kinds, Place, PlainNumber, Table, Words, dotted, unit_of
from hybrid.scene.suggestions import decimal_comma, did_you_mean, nearest

# What pydantic calls "extra" is often a condition that another kind of end takes.
OTHER_KIND = {
    ("pinned", "force"): "a pinned end takes no force; use kind: free or guided",
    ("pinned", "moment"): "a pinned end takes no moment; use kind: free",
    ("pinned", "tangent"): "a pinned end turns freely; kind: clamped holds a tangent",
    ("pinned", "normal"): "a pinned end turns freely; kind: clamped holds a normal",
    ("pinned", "swivel"): "a pinned end turns freely already; leave swivel out",
    ("clamped", "force"): "a clamped end takes no force; use kind: guided, or free",
    ("clamped", "moment"): "a clamped end takes no moment; use kind: free",
    ("guided", "position"): "a guided end has no position; kind: clamped holds position and tangent",
    ("guided", "moment"): "a guided end takes no moment; use kind: free",
    ("guided", "swivel"): "a guided end spins freely unless it has a normal; leave swivel out",
    ("free", "position"): "a free end has no position; kind: pinned holds one",
    ("free", "tangent"): "a free end has no tangent; kind: guided holds one",
    ("free", "normal"): "a free end has no normal; kind: guided holds one",
    ("free", "motion"): "a free end cannot be moved; use kind: pinned or clamped",
    ("free", "mass"): "a free end has no mass; kind: body carries one",
    ("free", "volume"): "a free end has no volume; kind: body has one",
    ("free", "thrust"): "use force; kind: body takes a thrust",
    ("free", "initial_guess"): "kind: body has a place near which it floats or hangs; a free end has none",
    ("pinned", "mass"): "a held end carries no mass; kind: body carries one and is not held",
    ("clamped", "mass"): "a held end carries no mass; kind: body carries one and is not held",
    ("guided", "mass"): "a guided end carries no mass; kind: body carries one and is free",
    (
        "body",
        "position",
    ): "a body is not held; initial_guess says where the search starts, kind: pinned holds a position",
    ("body", "tangent"): "a body turns freely; kind: clamped or guided holds a tangent",
    ("body", "motion"): "a body moves with the cable; kind: pinned or clamped is moved",
    ("body", "force"): "use thrust",
    ("body", "moment"): "a body takes no moment; use kind: free",
    (
        "body",
        "buoyancy",
    ): "use volume (m^3): the fluid that the body displaces; net buoyancy is density x volume - mass",
    ("body", "weight"): "use mass (kg), in air, and volume (m^3), displaced",
    ("float", "range"): "a float sits at one arc length; kind: modules goes over a stretch",
    ("float", "weight"): "use mass (kg): the weight in air / gravity",
    ("clump", "range"): "a clump sits at one arc length; kind: modules goes over a stretch",
    ("clump", "weight"): "use mass (kg): the weight in air / gravity",
    ("clump", "buoyancy"): "use volume (m^3) for the fluid that a clump displaces; kind: float for what lifts",
    ("modules", "at"): "modules go over a stretch, range: [from, to]; kind: float sits at one arc length",
    ("modules", "weight"): "use mass (kg/m): the weight in air / gravity",
    ("modules", "height"): "modules have the extent of the cable; leave height out",
    ("regular", "gamma"): "regular waves have one period and no spectrum; use kind: jonswap",
    ("regular", "seed"): "regular waves have nothing random; use kind: jonswap",
    ("regular", "components"): "regular waves are one component; use kind: jonswap",
    ("jonswap", "phase"): "the phases are random; another seed gives another sea",
    ("uniform", "table"): "use kind: profile",
    ("profile", "velocity"): "use kind: uniform, or give a velocity in each entry of the table",
    ("power_law", "table"): "use kind: profile",
    ("rod", "slack"): "a rod may go slack; leave slack out",
    ("rod", "zones"): "use kind: zones",
    ("catenary", "zones"): "use kind: zones",
    ("corrected", "zones"): "use kind: zones",
}

# A larger number would not help, as an example of how to write it.
LARGEST = 1e12

# How to write what "[x, y, z]" or "..." would not tell.
SHAPES = {
    "direction": "[1, 0, 0]",
    "zones": "[{rod: ...}, {catenary: ...}]",
    "points": "[[x, y, z], [x, y, z]]",
    "sections": "[{length: ..., mass: ...}]",
    "table": "[{z: ..., velocity: [x, y, z]}, {z: ..., velocity: [x, y, z]}]",
    "range": "[from, to]",
}


@dataclass(frozen=True)
class Spot:
    """Where a location leads: the type there, the table and field it belongs to, the tag of that table."""

    annotation: Any
    metadata: tuple[Any, ...]
    owner: type[Table] | None
    field: FieldInfo | None
    kind: str


# --- walking the schema ------------------------------------------------------------------------


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


def _tables(annotation: Any) -> list[type[Table]]:
    return [a for a, _ in arms(annotation) if isinstance(a, type) and issubclass(a, Table)]


def _item(annotation: Any, index: int) -> Any:
    """The type of one entry of a list; None if there is none."""
    found = []
    for a, _ in arms(annotation):
        args = get_args(a)
        if get_origin(a) is tuple and args:
            found.append(args[0] if args[-1] is Ellipsis else args[min(index, len(args) - 1)])
    return reduce(or_, found) if found else None


def is_tag(part: Any) -> bool:
    return isinstance(part, str) and part.startswith("<") and part.endswith(">")


def follow(root: type[Table], loc: Place) -> Spot:
    """What the schema has at pydantic's location `loc`."""
    spot = Spot(root, (), None, None, "")
    for part in loc:
        if isinstance(part, int):
            spot = Spot(_item(spot.annotation, part), (), spot.owner, spot.field, spot.kind)
        elif is_tag(part):
            chosen = [(a, m) for a, m in arms(spot.annotation, spot.metadata) if Tag(part) in m]
            # several arms under one tag are told apart by the tag that follows
            annotation, metadata = chosen[0] if len(chosen) == 1 else (spot.annotation, spot.metadata)
            spot = Spot(annotation, metadata, spot.owner, spot.field, part.strip("<>"))
        else:
            tables = _tables(spot.annotation)
            owner = tables[0] if len(tables) == 1 else None
            field = owner.model_fields.get(owner.former.get(part, part)) if owner is not None else None
            annotation, metadata = (field.annotation, tuple(field.metadata)) if field is not None else (None, ())
            spot = Spot(annotation, metadata, owner, field, spot.kind)
    return spot


def tables_at(root: type[Table], path: Place) -> list[type[Table]]:
    """The tables that any branch of the schema has at `path`."""
    annotations: list[Any] = [root]
    for part in path:
        if isinstance(part, int):
            annotations = [_item(a, part) for a in annotations]
        else:
            tables = [t for a in annotations for t in _tables(a)]
            found = [t.model_fields.get(t.former.get(part, part)) for t in tables]
            annotations = [field.annotation for field in found if field is not None]
        annotations = [a for a in annotations if a is not None]
    return [table for a in annotations for table in _tables(a)]


def keys_at(root: type[Table], path: Place) -> list[str]:
    """All keys that any branch of the schema knows in the table at `path`, those of today first."""
    tables = tables_at(root, path)
    return list(dict.fromkeys([*(n for t in tables for n in t.model_fields), *(n for t in tables for n in t.former)]))


def shorthand_keys(root: type[Table], path: Place) -> tuple[str, ...]:
    """The keys that a bare word or number at `path` stands for (``model: rod`` is ``{kind: rod}``)."""
    spot = follow(root, path)
    for item in [*spot.metadata, *(m for _, found in arms(spot.annotation) for m in found)]:
        if isinstance(item, PlainNumber):
            return item.keys
    return ("kind",) if "kind" in keys_at(root, path) else ()


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
    item = _item(annotation, 0)
    return bool(_tables(annotation if item is None else item))


def _type_in_words(annotation: Any, metadata: tuple[Any, ...]) -> str:
    for item in metadata:
        if isinstance(item, Words):
            return item.text
        if isinstance(item, Kinds):
            return f"a table with kind: {' | '.join(item.names)}"
    if annotation is float or annotation is int:
        return ("a number" if annotation is float else "a whole number") + _bounds(metadata)
    if annotation is bool:
        return "true or false"
    if get_origin(annotation) is Literal:
        return f"one of: {', '.join(map(str, get_args(annotation)))}"
    if get_origin(annotation) is tuple:
        least = next((m.min_length for m in metadata if isinstance(m, annotated_types.MinLen)), 0)
        entry = " or ".join(dict.fromkeys(_type_in_words(a, m) for a, m in arms(get_args(annotation)[0])))
        return f"a list of at least {least} entries, each {entry}" if least > 1 else f"a list, each entry {entry}"
    if isinstance(annotation, type) and issubclass(annotation, Table):
        needed = [name for name, f in annotation.model_fields.items() if f.is_required()]
        some = needed or list(annotation.model_fields)[:2]
        return f"a table {{{', '.join(f'{name}: ...' for name in some)}}}"
    return "something else"


def _bounds(metadata: tuple[Any, ...]) -> str:
    words = []
    for item in metadata:
        for name, sign in (("gt", ">"), ("ge", ">="), ("lt", "<"), ("le", "<=")):
            if getattr(item, name, None) is not None:
                words.append(f"{sign} {getattr(item, name):g}")
    return " " + " and ".join(dict.fromkeys(words)) if words else ""


# --- errors in words ---------------------------------------------------------------------------


def explain(root: type[Table], error: Mapping[str, Any]) -> list[tuple[Finding, bool]]:
    """One pydantic error as findings with full paths; True: the key itself is what is wrong."""
    kind, loc, value = error["type"], tuple(error["loc"]), error.get("input")
    path = tuple(part for part in loc if not is_tag(part))
    context = error.get("ctx") or {}
    if kind == "findings":
        return [(Finding((*path, *f.at), f.expected, f.fix, f.given), False) for f in context["findings"]]
    if kind == "default_factory_not_called":
        return []  # a key that is absent, and whose default waits for a table that is wrong
    if kind == "too_short" and isinstance(value, list | tuple) and len(value) >= context.get("min_length", 0):
        return []  # pydantic counts only the entries that are right; those that are wrong speak for themselves
    spot = follow(root, loc)
    if kind in ("extra_forbidden", "invalid_key"):
        return [(_unknown_key(path, spot), True)]
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


def _unknown_key(path: Place, spot: Spot) -> Finding:
    key = str(path[-1])
    known = list(spot.owner.model_fields) if spot.owner is not None else []
    fix = OTHER_KIND.get((spot.kind, key)) or did_you_mean(key, known)
    if spot.owner is not None and key in spot.owner.former:
        fix = f"leave one of them out: {key} is the former name of {spot.owner.former[key]}"
    table = "a scene" if len(path) == 1 else f"kind: {spot.kind}" if "kind" in known else dotted(path[:-1])
    return Finding(path, f"a key of {table}", fix)


def _missing_fix(key: str, words: str, spot: Spot, bare: bool) -> str:
    """What to add; `bare`: the table says nothing but its kind, and may be that word alone."""
    unit = unit_of(spot.field)
    if (spot.kind, key) == ("guided", "tangent"):
        return "add `tangent: [x, y, z]`, the direction of increasing s at this end; kind: free holds none"
    if bare and spot.owner is not None:
        return f"write `{_example(spot.kind, spot.owner)}`"
    found = list(arms(spot.annotation, spot.metadata))
    kinds = next((mark for _, marks in found for mark in marks if isinstance(mark, Kinds)), None)
    if kinds is None and words.startswith("a table {"):
        return f"add `{key}: {words.removeprefix('a table ')}`"
    if kinds is None:
        return f"add `{key}: {_shape(key, spot.annotation, spot.metadata)}`" + (f" ({unit})" if unit else "")
    tables = {kind: a for kind in kinds.usual for a, marks in found if Tag(f"<{kind}>") in marks}
    return "add " + " or ".join(f"`{key}: {_example(kind, table)}`" for kind, table in tables.items())


def _example(kind: str, table: type[Table]) -> str:
    """The shortest table of a kind, or its bare word."""
    needs = {name: field for name, field in table.model_fields.items() if field.is_required()}
    shapes = [f", {name}: {_shape(name, field.annotation, tuple(field.metadata))}" for name, field in needs.items()]
    return f"{{kind: {kind}{''.join(shapes)}}}" if shapes else kind


def _shape(key: str, annotation: Any, metadata: tuple[Any, ...]) -> str:
    marks = [mark for _, found in arms(annotation, metadata) for mark in found]
    vector = any(isinstance(mark, Words) and "[x, y, z]" in mark.text for mark in marks)
    shape = SHAPES.get(key) if annotation is not float else None
    return shape or ("[x, y, z]" if vector else "...")


def _number_for_more(key: str, value: float, spot: Spot) -> str:
    """One number where a vector or a table is expected: how it would be written there."""
    marks = [mark for _, found in arms(spot.annotation, spot.metadata) for mark in found]
    if key and any(isinstance(mark, Words) and mark.text.startswith("three numbers") for mark in marks):
        return f"write `{key}: [0, 0, {value}]`" if key in ("force", "value") else f"write `{key}: [{value}, 0, 0]`"
    if key and any(isinstance(mark, Words) and mark.text == "two numbers" for mark in marks):
        return f"write `{key}: [{value}, 0]`"
    tables = _tables(spot.annotation)
    if len(tables) != 1:
        return ""
    fields = tables[0].model_fields
    first, *others = [name for name, field in fields.items() if field.is_required()] or list(fields)[:1]
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
        least = next((m.min_length for _, marks in arms(spot.annotation, spot.metadata) for m in marks
                      if isinstance(m, annotated_types.MinLen)), 1)  # fmt: skip
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
        return "take out line breaks and control characters"
    if kind == "tuple_type" and isinstance(value, Mapping):
        return "start each entry with a dash"
    if kind in ("greater_than", "greater_than_equal") and isinstance(value, int | float) and value < 0:
        return "check the sign"
    return ""


def _usual_fix(key: str, words: str, spot: Spot) -> str:
    """What to try where nothing is known of why a value is wrong: how a right one is written, or to do without."""
    found = list(arms(spot.annotation, spot.metadata))
    shape = _shape(key, spot.annotation, spot.metadata)
    optional = key and spot.owner is not None and spot.field is not None and not spot.field.is_required()
    without = f", or leave {key} out" if optional else ""
    if any(get_origin(a) is Literal for a, _ in found) or words.startswith("one of"):
        return f"write one of these{without}"
    if shape != "...":
        return f"write `{key}: {shape}`{without}"
    tables = [a for a, _ in found if isinstance(a, type) and issubclass(a, Table)]
    if tables and key:
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
