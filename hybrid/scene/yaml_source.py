"""The text of a scene as a tree that remembers where everything was written.

YAML 1.2: `on`, `no` and `yes` are words, 1e-3 is a number.  The tree carries line and column
(from 1) of every key and value, so that a complaint can point at its cause.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, ClassVar

import yaml

from hybrid.errors import Complaint
from hybrid.scene.base import PATHS, READABLE, WRITE_OUT, Place, Table, decimal_comma, did_you_mean, dotted
from hybrid.scene.schema_messages import has_names, keys_at, shorthand_keys, tables_at

Spot = tuple[int, int]

# A table or list as written may be long; a complaint shows its beginning.
SHOWN = 60

# Values that a scene may have once its aliases are written out: a list of every node of a fine mesh, or tens of
# thousands of attachments, are below, and a few lines of aliases of aliases are far above.
MOST_VALUES = 500_000

# Levels of tables within tables: a scene has eight.
DEEPEST = 100

# Names of points, bodies and lines are keys too: they may begin with a digit, and have hyphens and blanks in them.
_PATH = re.compile(r"[A-Za-z_]\w*(\[\d+\])*(\.\w[\w -]*(\[\d+\])*)*")
# A key and its value that YAML takes for a key: any value behind a colon without a space, a number without a colon.
_KEY_AND_VALUE = re.compile(r"([A-Za-z_]\w*)(?::| +(?=[-+.]?\d))([^\s:]+)")
_QUOTE = "write one word before the colon; close brackets and braces"
_EXAMPLE = "key=value, such as time.step=0.005 or cable.sections[0].mass=2"


_DIGITS = "0123456789"
# What a word without quotes is: tag, characters that it may begin with ("": it is empty), and what it must match.
RULES = (
    ("bool", [*"tTfF"], r"^(?:true|True|TRUE|false|False|FALSE)$"),
    ("float", [*"-+", *_DIGITS, "."],
     r"^(?:[-+]?(?:[0-9][0-9_]*)\.[0-9_]*(?:[eE][-+]?[0-9]+)?|[-+]?(?:[0-9][0-9_]*)(?:[eE][-+]?[0-9]+)"
     r"|[-+]?\.[0-9_]+(?:[eE][-+][0-9]+)?|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN))$"),
    ("int", [*"-+", *_DIGITS], r"^(?:[-+]?0b[0-1_]+|[-+]?0o?[0-7_]+|[-+]?[0-9_]+|[-+]?0x[0-9a-fA-F_]+)$"),
    ("merge", ["<"], r"^(?:<<)$"),
    ("null", ["~", "n", "N", ""], r"^(?:~|null|Null|NULL|)$"),
)  # fmt: skip


class _Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
    """Nodes of YAML 1.2 by libyaml, with the rules of ruamel.yaml: twenty times as fast.

    That is slow to import, and is asked only for a text that is odd or wrong, or where PyYAML came without libyaml.
    """

    yaml_implicit_resolvers: ClassVar[dict[str, list[tuple[str, re.Pattern[str]]]]] = {
        first: [(f"tag:yaml.org,2002:{tag}", re.compile(x)) for tag, begins, x in RULES if first in begins]
        for first in {first for _, begins, _ in RULES for first in begins}
    }


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
        if hasattr(yaml, "CSafeLoader") and (found := yaml.compose(text, Loader=_Loader)) is not None:
            return found
    except yaml.MarkedYAMLError as error:
        if error.problem == _DEEPER_THAN_LIBYAML and error.problem_mark is not None:
            raise _too_deep(error.problem_mark) from None
    except yaml.YAMLError:
        pass  # ruamel.yaml says what is wrong, or reads what is odd
    found = compose(text)
    if isinstance(found, Complaint):
        raise Unreadable(found)
    return found


_DEEPER_THAN_LIBYAML = "exceeded maximum nesting depth"  # as its error says


def _too_deep(mark: Any) -> Unreadable:
    return Unreadable(Complaint("YAML", "nested too deeply", READABLE, WRITE_OUT, mark.line + 1, mark.column + 1))


def _place(node: Any) -> Spot:
    return node.start_mark.line + 1, node.start_mark.column + 1


def _values(node: Any, path: Place, known: dict[int, int]) -> int:
    """Values below a node of YAML and itself, aliases written out, each node counted once; Unreadable for a cycle."""
    if id(node) in known:
        if known[id(node)] == 0:
            fault = "an alias of itself", "a value", "write it out"
            raise Unreadable(Complaint(dotted(path), *fault, *_place(node)))
        return known[id(node)]
    if node.id != "scalar" and len(path) >= DEEPEST:
        raise _too_deep(node.start_mark)
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
        if parts and not key_node.style and value_node.value == "":  # {z:-20} and {z -20} are a key without a value
            fix, expected = f"write `{parts[1]}: {parts[2]}`", "a key, a colon, a space, a value"
            complaints.append(Complaint(dotted((*path, parts[1])), key, expected, fix, *spot))
            table.value[parts[1]] = from_text(parts[2])[0]
            table.value[parts[1]].place = table.key_places[parts[1]] = spot
            continue
        if key_node.tag == "tag:yaml.org,2002:merge":
            built = _build(value_node, path, complaints)
            for source in built.value if isinstance(built.value, list) else [built]:
                if isinstance(source.value, dict):
                    merged = {**source.value, **merged}
                else:
                    at, fix = dotted((*path, key)), "`<<` takes an alias of a table; or leave it out"
                    complaints.append(Complaint(at, source.show(), "a table to merge", fix, *spot))
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


# --- what is wrong with a text that is not YAML, at the line where it has to be changed -----------------
#
# A parser stops where it can read no further, which is often a line after the fault: at the first colon behind a key
# without one, at the first key behind a bracket that was never closed, at the end of the text behind an open quote.

BRACKETS = {"{": "}", "[": "]"}
_COLON = "a key needs a colon and a space behind it"

# Line and column, counted from 0; what is wrong there; the remedy.
Fault = tuple[int, int, str, str]


def compose(text: str) -> Any:
    """The tree of a text as ruamel.yaml reads it, or a complaint that says what is wrong with it."""
    from ruamel.yaml import YAML  # slow to import
    from ruamel.yaml.error import MarkedYAMLError, ReusedAnchorWarning, YAMLError
    from ruamel.yaml.reader import ReaderError

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", ReusedAnchorWarning)
            return YAML(typ="safe", pure=True).compose(text)
    except MarkedYAMLError as error:
        return not_yaml(text, error)
    except ReusedAnchorWarning as warning:
        return anchor_twice(str(warning))
    except ReaderError as error:
        return odd_character(text, error)
    except (YAMLError, RecursionError, ValueError) as error:
        why = "nested too deeply" if isinstance(error, RecursionError) else str(error).splitlines()[0]
        return Complaint("YAML", why, READABLE, WRITE_OUT, 1, 1)


def not_yaml(text: str, error: Any) -> Complaint:
    """The complaint about a text that ruamel.yaml has refused with `error`."""
    lines = re.split("\r\n|[\n\r\x85\u2028\u2029]", text)  # as ruamel.yaml counts them
    line, column, problem, fix = _fault(text, lines, error)
    given = lines[line].strip() if line < len(lines) else "the end of the text"
    return Complaint("YAML", given or "nothing", f"{READABLE}; {problem}", fix, line + 1, column + 1)


def anchor_twice(warning: str) -> Complaint:
    """`warning` names both places, the later one last."""
    line, column = map(int, re.findall(r"line (\d+), column (\d+)", warning)[-1])
    name = re.findall(r"duplicate anchor '(.*)'", warning)[0]
    return Complaint("YAML", f"the anchor &{name} twice", "every anchor once", "give it another name", line, column)


def odd_character(text: str, error: Any) -> Complaint:
    """A character that no YAML text may have."""
    before = text[: error.position]
    line, column = before.count("\n") + 1, error.position - before.rfind("\n")
    given = f"the character U+{ord(text[error.position]):04X}"
    return Complaint("YAML", given, f"{READABLE}; it has no such characters", "take it out", line, column)


def _fault(text: str, lines: list[str], error: Any) -> Fault:
    mark = error.problem_mark or error.context_mark
    if mark is None:
        return 0, 0, (error.problem or "").strip(), "check indentation, brackets and quotes"
    problem = (error.problem or "").strip().replace("<stream end>", "the end of the text").replace("\\t", "tab")
    here = lines[mark.line] if mark.line < len(lines) else ""
    context = error.context_mark
    if context is not None and "could not find expected ':'" in problem:
        return context.line, context.column, problem, _COLON
    if context is not None and "quoted scalar" in (error.context or "") and "unexpected end" in problem:
        return context.line, context.column, "this quote is not closed", f"close it with {text[context.index]}"
    tokens = _tokens_before(text, mark.index)
    quote = _quote_across_lines(tokens, mark.line)
    if quote is not None:
        line, column = quote.start_mark.line, quote.start_mark.column
        return line, column, f"this quote is closed only in line {mark.line + 1}", f"close it with {quote.style}"
    if "expected ',' or" in problem:
        other = re.search(r"or '(.)', but got '[}\]]'", problem)
        fix = f"put {other[1]} before it" if other else "close the bracket, or put a comma between the entries"
        return _unclosed(lines, tokens, mark) or (mark.line, mark.column, problem, fix)
    if "mapping values are not allowed" in problem:
        begin = _without_colon(lines, mark.line, mark.column)
        if begin is not None:
            return begin, len(lines[begin].rstrip()), "this key has no colon", _COLON
        if re.match(r"\s*(- +)?[A-Za-z_]\w* *[{\[]", here):
            return mark.line, mark.column, problem, _COLON
        return mark.line, mark.column, problem, "check the indentation, and put text that contains a colon in quotes"
    fix = _remedy(problem, here)
    if "escape" in problem:
        problem = "in double quotes \\ begins a special character"
    return mark.line, mark.column, problem, fix


def _remedy(problem: str, here: str) -> str:
    """What to try where a fault is where the parser stopped."""
    if "escape" in problem:
        return PATHS
    if "tab" in problem or "\t" in here:
        return "indent with spaces, not tabs"
    if "undefined alias" in problem:
        return "give the anchor (&name) before the alias (*name)"
    if re.search(r"found '[}\]]'", problem):
        return "take the bracket out: none is open here"
    if "another document" in problem:
        return "one scene to a file: take out --- and what follows it, or put that into a file of its own"
    if "cannot start any token" in problem:
        return "put the text in quotes"
    return "check indentation, brackets and quotes here and in the line before"


def _tokens_before(text: str, index: int) -> list[Any]:
    """The tokens of a text that begin before a place, as far as it can be scanned."""
    from ruamel.yaml import YAML
    from ruamel.yaml.error import MarkedYAMLError

    found = []
    with suppress(MarkedYAMLError):
        for token in YAML(typ="safe", pure=True).scan(text):
            if token.start_mark.index >= index:
                break
            found.append(token)
    return found


def _quote_across_lines(tokens: list[Any], line: int) -> Any:
    """The quoted text that begins before a line and ends in it: its quote was probably meant to be closed before."""
    for token in reversed(tokens):
        if token.end_mark.line < line:
            return None
        if token.id == "<scalar>" and token.style in ("'", '"') and token.start_mark.line < line:
            return token
    return None


def _unclosed(lines: list[str], tokens: list[Any], mark: Any) -> Fault | None:
    """Where a bracket should have been closed, or a comma stand, in a line before the one at which the parser stopped.

    None: it may be at fault itself.  A line that begins something new, indented no more than the one in which a bracket
    was opened, ends what is within the bracket; else the line before is at fault if the parser stopped at the first
    word of a line.
    """
    still = _open_after(tokens, mark.line + 1)
    if not still:
        return None
    here = lines[mark.line] if mark.line < len(lines) else ""
    ends = {id(token): _end_of_content(lines, token, mark.line) for token in still}
    end = min((line for line in ends.values() if line is not None), default=None)
    if end is None and (mark.line == still[0].start_mark.line or re.search(r"[][{},'\"]|: ", here[: mark.column])):
        return None
    last = max((k for k in range(mark.line if end is None else end) if _content(lines[k])), default=0)
    unclosed = [x for x in _open_after(tokens, last + 1) if end is None or ends.get(id(x)) == end]
    behind = len(lines[last].rstrip())
    if end is None and here.strip():  # within the brackets of several lines
        unclosed = [x for x in unclosed if x.start_mark.line == last]
        if not unclosed and _content(lines[last])[-1] != ",":
            return last, behind, "no comma behind this entry", "put a comma there, or close the bracket"
        unclosed = unclosed or still[-1:]
    opened, closing = unclosed[-1], "".join(BRACKETS[x.id] for x in reversed(unclosed))
    where = "" if opened.start_mark.line == last else f" of line {opened.start_mark.line + 1}"
    or_comma = ", or put a comma behind the entry" if end is None and here.strip() and not where else ""
    return last, behind, f"the bracket {opened.id}{where} is not closed", f"close it with {closing}{or_comma}"


def _end_of_content(lines: list[str], token: Any, line: int) -> int | None:
    """The first line, up to one, that begins something new behind an open bracket: a key, an entry, a like bracket."""
    opened = token.start_mark
    first = lines[opened.line][: opened.column].strip() == ""
    new = rf"- |[A-Za-z_]\w*\s*:|{re.escape(token.id)}" if first else r"- |[A-Za-z_]\w*\s*:"
    for k in range(opened.line + 1, min(line + 1, len(lines))):
        if _content(lines[k]) and _indent(lines[k]) <= _indent(lines[opened.line]) and re.match(new, lines[k].lstrip()):
            return k
    return None


def _open_after(tokens: list[Any], line: int) -> list[Any]:
    """The brackets that are open where a line begins, outermost first."""
    still: list[Any] = []
    for token in tokens:
        if token.start_mark.line >= line:
            break
        if token.id in BRACKETS:
            still.append(token)
        elif token.id in BRACKETS.values() and still:
            still.pop()
    return still


def _without_colon(lines: list[str], line: int, column: int) -> int | None:
    """The first of the lines without a colon that YAML reads as the beginning of the key at a place; None: none."""
    if re.search(r":(\s|$)", lines[line][:column]):
        return None
    begin = None
    for k in range(line - 1, -1, -1):
        content = _content(lines[k])
        if content and (re.search(r":(\s|$)", content) or content[-1] in "}],"):
            break
        begin = k if content else begin
    return begin


def _content(line: str) -> str:
    """A line without its comment and the spaces around it."""
    return re.sub(r"(^|\s)#.*", "", line).strip()


def _indent(line: str) -> int:
    return len(line) - len(line.lstrip(" "))
