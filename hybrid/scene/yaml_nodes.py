"""The nodes of a YAML text, by libyaml: twenty times as fast as ruamel.yaml, which says what is wrong with a text.

Tags are those of YAML 1.2, by the rules of ruamel.yaml, so that both make the same tree.  It takes long to import, and
is asked only for a text that is odd or wrong.
"""

from __future__ import annotations

import re
from functools import cache
from typing import Any

import yaml

try:
    from yaml.cyaml import CParser
except ImportError:  # PyYAML was built without libyaml
    CParser = None

# What complaints about a whole text say.
READABLE = "a text that YAML can read"
WRITE_OUT = "begin anew from an example; every scene is a few tables within tables"
# Levels of tables within tables: a scene has eight.
DEEPEST = 100
_TAG = "tag:yaml.org,2002:"


_DEEPER_THAN_LIBYAML = "exceeded maximum nesting depth"  # as its error says


class TooDeep(Exception):
    """Tables or lists within more than DEEPEST others, on which ruamel.yaml would spend seconds; `place` is theirs."""

    def __init__(self, mark: Any) -> None:
        self.place = (mark.line + 1, mark.column + 1)
        super().__init__(f"nested too deeply at {self.place}")


def composed(text: str) -> yaml.Node | None:
    """The tree of a text; None: ruamel.yaml has to read it, or to say what is wrong with it; TooDeep."""
    if CParser is None:
        return None
    parser = CParser(text)
    try:
        return _tree(parser)
    except yaml.MarkedYAMLError as error:
        if error.problem == _DEEPER_THAN_LIBYAML:
            raise TooDeep(error.problem_mark) from None
        return None
    except (yaml.YAMLError, _Odd):
        return None
    finally:
        parser.dispose()


class _Odd(Exception):
    """Something that no scene needs."""


def _tree(parser: Any) -> yaml.Node:
    """Events put together; a loop, not a recursion, so that no text can exhaust the stack of C."""
    anchors: dict[str, yaml.Node] = {}
    inside: list[list[yaml.Node]] = []  # of each open table or list what it holds, keys and values in turn
    opened: list[yaml.Node] = []
    top: list[yaml.Node] = []
    while True:
        event = parser.get_event()
        kind = type(event)
        holds = inside[-1] if inside else top
        if kind is yaml.ScalarEvent:
            style = event.style or None  # of plain text libyaml says ""
            node: yaml.Node = yaml.ScalarNode(_tag(event), event.value, event.start_mark, event.end_mark, style)
            holds.append(node)
        elif kind is yaml.MappingStartEvent or kind is yaml.SequenceStartEvent:
            new = yaml.MappingNode if kind is yaml.MappingStartEvent else yaml.SequenceNode
            node = new(event.tag, [], event.start_mark, event.end_mark)
            holds.append(node)
            opened.append(node)
            inside.append([])
            if len(inside) > DEEPEST:
                raise TooDeep(event.start_mark)
        elif kind is yaml.MappingEndEvent or kind is yaml.SequenceEndEvent:
            values = inside.pop()
            pairs = zip(values[::2], values[1::2], strict=True)
            opened.pop().value[:] = pairs if kind is yaml.MappingEndEvent else values
            continue
        elif kind is yaml.AliasEvent and event.anchor in anchors:
            holds.append(anchors[event.anchor])
            continue
        elif kind is yaml.AliasEvent:
            raise _Odd
        elif kind is yaml.StreamEndEvent:
            break
        else:  # begin and end of the text
            continue
        if event.anchor is not None:
            if event.anchor in anchors:
                raise _Odd
            anchors[event.anchor] = node
    if len(top) != 1:
        raise _Odd
    return top[0]


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
    ("timestamp", [*_DIGITS],
     r"^(?:[0-9][0-9][0-9][0-9]-[0-9][0-9]-[0-9][0-9]|[0-9][0-9][0-9][0-9]-[0-9][0-9]?-[0-9][0-9]?(?:[Tt]|[ \t]+)"
     r"[0-9][0-9]?:[0-9][0-9]:[0-9][0-9](?:\.[0-9]*)?(?:[ \t]*(?:Z|[-+][0-9][0-9]?(?::[0-9][0-9])?))?)$"),
    ("value", ["="], r"^(?:=)$"),
    ("yaml", [*"!&*"], r"^(?:!|&|\*)$"),
)  # fmt: skip


@cache
def _rules() -> dict[str, list[tuple[str, str]]]:
    """By the first character of a word, the tags that it may have, and what it must match."""
    rules: dict[str, list[tuple[str, str]]] = {}
    for tag, first, pattern in RULES:
        for character in first:
            rules.setdefault(character, []).append((tag, pattern))
    return rules


def _tag(event: Any) -> str:
    """The tag of a value: as it is written, or by its text, if that has no quotes."""
    if event.tag not in (None, "!"):
        return str(event.tag)
    if event.implicit[0]:
        word = event.value
        for tag, pattern in _rules().get(word[:1], ()):
            if re.match(pattern, word):
                return _TAG + tag
    return _TAG + "str"
