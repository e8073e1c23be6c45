"""The text of a scene as a tree that remembers where everything was written.

YAML 1.2: `on`, `no` and `yes` are words, 1e-3 is a number.  The tree carries line and column
(from 1) of every key and value, so that a complaint can point at its cause.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from hybrid.errors import Complaint
from hybrid.scene.base import Place, Table, decimal_comma, did_you_mean, dotted
from hybrid.scene.schema_messages import has_names, keys_at, shorthand_keys, tables_at
from hybrid.scene.yaml_nodes import READABLE, WRITE_OUT, TooDeep, composed

Spot = tuple[int, int]

# A table or list as written may be long; a complaint shows its beginning.
SHOWN = 60

# Values that a scene may have once its aliases are written out: a list of every node of a fine mesh, or tens of
# thousands of attachments, are below, and a few lines of aliases of aliases are far above.
MOST_VALUES = 500_000

# Names of points, bodies and lines are keys too: they may begin with a digit, and have hyphens and blanks in them.
_PATH = re.compile(r"[A-Za-z_]\w*(\[\d+\])*(\.\w[\w -]*(\[\d+\])*)*")
# A key and its value that YAML takes for a key: any value behind a colon without a space, a number without a colon.
_KEY_AND_VALUE = re.compile(r"([A-Za-z_]\w*)(?::| +(?=[-+.]?\d))([^\s:]+)")
_QUOTE = "write one word before the colon; close brackets and braces"
_EXAMPLE = "key=value, such as time.step=0.005 or cable.sections[0].mass=2"


@dataclass
class Node:
    """A value of the scene: a scalar, ``{key: Node}`` or ``[Node]``, with its place and its text.

    `note` is where it comes from if not from the text.
    """

    value: Any
    place: Spot | None = None
    written: str = ""
    key_places: dict[str, Spot] = field(default_factory=dict)
    note: str = ""

    def plain(self) -> Any:
        """The value without places: dicts, lists and scalars."""
        if isinstance(self.value, dict):
            return {key: node.plain() for key, node in self.value.items()}
        if isinstance(self.value, list):
            return [node.plain() for node in self.value]
        return self.value

    def show(self) -> str:
        """The value as it was written, on one line."""
        text = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in " ".join(self._flow().split()))
        if len(text) > SHOWN:
            text = text[: SHOWN - 4] + " ..."
        return (text or "nothing") + (f" ({self.note})" if self.note else "")

    def _flow(self) -> str:
        if isinstance(self.value, dict):
            return "{" + ", ".join(f"{key}: {node._flow()}" for key, node in self.value.items()) + "}"
        if isinstance(self.value, list):
            return "[" + ", ".join(node._flow() for node in self.value) + "]"
        return self.written


class Unreadable(Exception):
    """The text is not YAML; `complaint` has place and reason."""

    def __init__(self, complaint: Complaint) -> None:
        self.complaint = complaint
        super().__init__(complaint.text())


def from_text(text: str) -> tuple[Node, list[Complaint]]:
    """The tree of a YAML text, and complaints about its keys; Unreadable if it is not YAML."""
    top = _composed(text)
    if top is None:
        raise Unreadable(Complaint("scene", "nothing", "a scene", "begin with a table `cable:`", 1, 1))
    complaints: list[Complaint] = []
    try:
        if _values(top, (), {}) > MOST_VALUES:
            given = f"more than {MOST_VALUES} values, aliases written out"
            fix = "write it without aliases of aliases"
            raise Unreadable(Complaint("YAML", given, "a scene of fewer", fix, *_place(top)))
        return _build(top, (), complaints), complaints
    except RecursionError:
        raise Unreadable(Complaint("YAML", "nested too deeply", "a scene", WRITE_OUT, 1, 1)) from None


def _composed(text: str) -> Any:
    """The tree of a text as YAML sees it."""
    try:
        found = composed(text)
    except TooDeep as error:
        raise Unreadable(Complaint("YAML", "nested too deeply", READABLE, WRITE_OUT, *error.place)) from None
    if found is not None:
        return found
    from hybrid.scene.yaml_faults import compose

    found = compose(text)
    if isinstance(found, Complaint):
        raise Unreadable(found)
    return found


def _place(node: Any) -> Spot:
    return node.start_mark.line + 1, node.start_mark.column + 1


def _values(node: Any, path: Place, known: dict[int, int]) -> int:
    """Values below a node of YAML and itself, aliases written out, each node counted once; Unreadable for a cycle."""
    if id(node) in known:
        if known[id(node)] == 0:
            fault = "an alias of itself", "a value", "write it out"
            raise Unreadable(Complaint(dotted(path), *fault, *_place(node)))
        return known[id(node)]
    below: Any = ()
    if node.id == "sequence":
        below = enumerate(node.value)
    elif node.id == "mapping":
        below = ((str(key.value), value) for key, value in node.value)
    known[id(node)] = 0  # open
    known[id(node)] = 1 + sum(_values(value, (*path, at), known) for at, value in below)
    return known[id(node)]


def _build(node: Any, path: Place, complaints: list[Complaint]) -> Node:
    """The tree below a node of YAML, aliases written out."""
    place = _place(node)
    if node.id == "sequence":
        entries = [_build(entry, (*path, i), complaints) for i, entry in enumerate(node.value)]
        return Node(entries, place)
    if node.id == "mapping":
        return _build_table(node, path, complaints, place)
    written = f'"{node.value}"' if node.style in ("'", '"') else str(node.value)
    return Node(_scalar(node), place, written)


def _build_table(
    node: Any,
    path: Place,
    complaints: list[Complaint],
    place: Spot,
) -> Node:
    table = Node({}, place)
    merged: dict[str, Node] = {}
    for i, (key_node, value_node) in enumerate(node.value):
        spot = (key_node.start_mark.line + 1, key_node.start_mark.column + 1)
        if key_node.id != "scalar":
            complaints.append(
                Complaint(dotted(path) or "scene", "a list or table as key", "a word as key", _QUOTE, *spot)
            )
            continue
        key = str(key_node.value)
        before = str(node.value[i - 1][0].value) if i else ""
        if before in table.value and _is_behind_comma(node.value[i - 1][1], key_node, value_node):
            written = f"{node.value[i - 1][1].value},{key}"
            number = Node(float(written.replace(",", ".")), table.value[before].place, written)
            fix, there = decimal_comma(written), number.place or spot
            complaints.append(Complaint(dotted((*path, before)), written, "a number", fix, *there))
            table.value[before] = number
            continue
        parts = _KEY_AND_VALUE.fullmatch(key)
        if parts and key_node.style is None and value_node.value == "":  # {z:-20} and {z -20} are a key without a value
            complaints.append(Complaint(dotted((*path, parts[1])), key, "a key, a colon, a space, a value",
                                        f"write `{parts[1]}: {parts[2]}`", *spot))  # fmt: skip
            table.value[parts[1]] = from_text(parts[2])[0]
            table.value[parts[1]].place = table.key_places[parts[1]] = spot
            continue
        if key_node.tag == "tag:yaml.org,2002:merge":
            built = _build(value_node, path, complaints)
            for source in built.value if isinstance(built.value, list) else [built]:
                if isinstance(source.value, dict):
                    merged = {**source.value, **merged}
                else:
                    complaints.append(
                        Complaint(
                            dotted((*path, key)),
                            source.show(),
                            "a table to merge",
                            "`<<` takes an alias of a table; or leave it out",
                            *spot,
                        )
                    )
            continue
        if key in table.value:
            first = table.key_places[key]
            fix = f"keep one of them; the first is in line {first[0]}"
            complaints.append(Complaint(dotted((*path, key)), f"{key} twice", "every key once", fix, *spot))
            continue
        value = _build(value_node, (*path, key), complaints)
        if value.value is None and not value.written:
            value.place = spot  # an empty value stands nowhere; its key does
        table.value[key] = value
        table.key_places[key] = spot
    for key, value in merged.items():
        table.value.setdefault(key, value)
    return table


def _is_behind_comma(before: Any, key: Any, value: Any) -> bool:
    """Whether a key is what stands behind a decimal comma: YAML reads {mass: 2,5} as mass: 2 and a key 5."""
    return (
        before.id == "scalar"
        and not isinstance(value.value, list)
        and value.value == ""
        and before.end_mark.index + 1 == key.start_mark.index
        and re.fullmatch(r"[-+]?\d+", str(before.value)) is not None
        and re.fullmatch(r"\d+([eE][-+]?\d+)?", str(key.value)) is not None
    )


def _scalar(node: Any) -> Any:
    text, tag = str(node.value), str(node.tag).rpartition(":")[2]
    try:
        if tag == "null":
            return None
        if tag == "bool":
            return text.lower() == "true"
        if tag == "int":
            digits = text.replace("_", "")
            return int(digits, 0) if re.match(r"[-+]?0[xob]", digits) else int(digits)
        if tag == "float":
            return float(text.replace("_", "").lower().replace(".inf", "inf").replace(".nan", "nan"))
    except ValueError:
        pass  # an explicit tag that does not fit, or a number of thousands of digits: the schema refuses text
    return text


def from_data(data: Any) -> Node:
    """The tree of Python data, without places."""
    if isinstance(data, Table):
        data = {name: getattr(data, name) for name in type(data).model_fields}
    if hasattr(data, "tolist"):
        data = data.tolist()
    if isinstance(data, Mapping):
        return Node({str(key): from_data(value) for key, value in data.items()})
    if isinstance(data, list | tuple):
        return Node([from_data(value) for value in data])
    return Node(data, None, repr(data))


# --- overrides ---------------------------------------------------------------------------------


def override(root: Node, text: str, schema: type[Table]) -> Complaint | None:
    """Set one value of the tree, ``cable.sections[0].mass=2``; the complaint if that cannot be.

    A whole entry is added where keys are names, ``points.c={position: [0, 0, 0]}``; null takes a key or entry out.
    """
    name, equals, value_text = text.partition("=")
    name = name.strip()
    if not equals or not _PATH.fullmatch(name):
        return Complaint("override", text or "nothing", _EXAMPLE, "name the key as `hybrid plan` and docs/scene.md do")
    parts = re.findall(r"\[\d+|[^.\[\]]+", name)
    path: Place = tuple(int(p[1:]) if p[0] == "[" else p for p in parts)
    try:
        value, complaints = from_text(value_text) if value_text.strip() else (Node(None), [])
    except Unreadable as error:
        return Complaint(name, value_text.strip(), error.complaint.expected, error.complaint.fix)
    if complaints:
        first = complaints[0]
        return Complaint(name, first.value, first.expected, first.fix)
    _annotate(value, "override")

    here = root
    for depth, part in enumerate(path):
        _open(here, schema, path[:depth])
        if isinstance(part, int):
            refusal = _no_entry(here, path[:depth], part)
        elif isinstance(here.value, list) and here.value:
            entry: Place = (int(part),) if part.isdecimal() else (0, part)
            fix = f"{dotted((*path[:depth], *entry, *path[depth + 1 :]))}=value"
            refusal = f"the number of an entry of {dotted(path[:depth])} in brackets, counted from 0", fix
        else:
            known = keys_at(schema, path[:depth])
            named = not known and has_names(schema, path[:depth]) and isinstance(here.value, dict)
            if named and (part in here.value or (depth == len(path) - 1 and value.value is not None)):
                refusal = None
            elif named:
                whole = f"{dotted(path[: depth + 1])}={{...}} adds it, with all of its keys"
                fix = f"{did_you_mean(part, list(here.value))}; {whole}" if here.value else whole
                refusal = f"an entry of {dotted(path[:depth])} that exists", fix
            else:
                refusal = _no_key(here, path[:depth], part, known)
        if refusal is not None:
            return Complaint(name, text, *refusal)
        if isinstance(part, str):
            part = _spelling(here.value, part, tables_at(schema, path[:depth]))
        if depth == len(path) - 1:
            here.key_places.pop(str(part), None)
            if value.value is None and value.written and isinstance(part, str):
                here.value.pop(part, None)
            else:
                here.value[part] = value
            return None
        if isinstance(part, str) and part not in here.value:
            here.value[part] = Node({}, None, note="override")
        here = here.value[part]
    return None


def _spelling(table: dict[str, Node], key: str, tables: list[type[Table]]) -> str:
    """How a key is spelt in a table as it is written: by the name of today, or a former one."""
    kind = table["kind"].value if "kind" in table else None
    for each in tables:
        of_kind = each.model_fields["kind"].default if "kind" in each.model_fields else None
        same = [name for name in table if each.former.get(name, name) == each.former.get(key, key)]
        if same and kind in (None, of_kind) and key not in table:
            return same[0]
    return key


def _no_entry(here: Node, path: Place, index: int) -> tuple[str, str] | None:
    """Why there is no entry `index` at `path`: what was expected, and the fix."""
    count = len(here.value) if isinstance(here.value, list) else 0
    if index < count:
        return None
    number = f"{count} entr{'y' if count == 1 else 'ies'}, counted from 0" if count else "no entries"
    return f"an entry that exists: {dotted(path)} has {number}", "change the entry in the file, or count again"


def _no_key(here: Node, path: Place, key: str, known: list[str]) -> tuple[str, str] | None:
    """Why there is no `key` in the table at `path`: what was expected, and the fix."""
    table = dotted(path) or "a scene"
    if not known:
        return f"a key that exists; {table} has none below it", f"{table}=value"
    if key not in known:
        return f"a key of {table}", did_you_mean(key, known)
    if not isinstance(here.value, dict):
        return f"{table} to be a table; it is {here.show()}", f"mend {table} in the file first"
    return None


def _open(node: Node, schema: type[Table], path: Place) -> None:
    """Turn nothing, or a word that stands for a table, into that table."""
    if node.value is None:
        node.value = {}
    elif not isinstance(node.value, dict | list):
        keys = shorthand_keys(schema, path)
        if keys:
            node.value = {key: Node(node.value, node.place, node.written) for key in keys}


def _annotate(node: Node, note: str) -> None:
    node.place, node.note = None, note
    node.key_places = {}
    children = (
        node.value.values() if isinstance(node.value, dict) else node.value if isinstance(node.value, list) else ()
    )
    for child in children:
        _annotate(child, note)
