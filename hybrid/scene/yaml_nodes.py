"""The nodes of a long YAML text, by libyaml: twenty times as fast as ruamel.yaml, which reads everything else.

Tags are those of YAML 1.2, by the rules of ruamel.yaml, so that both make the same tree.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import yaml
from ruamel.yaml.resolver import implicit_resolvers
from yaml.cyaml import CParser

# Levels of tables within tables: a scene has eight, and deeper ones are ruamel.yaml's to refuse.
DEEPEST = 100
_TAG = "tag:yaml.org,2002:"


def composed(text: str) -> yaml.Node | None:
    """The tree of a text; None: ruamel.yaml has to say what is wrong with it."""
    parser = CParser(text)
    try:
        return _tree(parser)
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
    while not isinstance(event := parser.get_event(), yaml.StreamEndEvent):
        holds = inside[-1] if inside else top
        if isinstance(event, yaml.AliasEvent):
            if event.anchor not in anchors:
                raise _Odd
            holds.append(anchors[event.anchor])
        elif isinstance(event, yaml.CollectionEndEvent):
            node, values = opened.pop(), inside.pop()
            table = isinstance(node, yaml.MappingNode)
            node.value[:] = zip(values[::2], values[1::2], strict=True) if table else values
            node.end_mark = event.end_mark
        elif isinstance(event, yaml.NodeEvent):
            node = _node(event)
            if event.anchor is not None:
                if event.anchor in anchors:
                    raise _Odd
                anchors[event.anchor] = node
            holds.append(node)
            if not isinstance(event, yaml.ScalarEvent):
                opened.append(node)
                inside.append([])
                if len(inside) > DEEPEST:
                    raise _Odd
    if len(top) != 1:
        raise _Odd
    return top[0]


def _node(event: Any) -> yaml.Node:
    if isinstance(event, yaml.ScalarEvent):
        tag = event.tag if event.tag not in (None, "!") else _tag(event.value) if event.implicit[0] else _TAG + "str"
        return yaml.ScalarNode(tag, event.value, event.start_mark, event.end_mark, style=event.style)
    kind = yaml.SequenceNode if isinstance(event, yaml.SequenceStartEvent) else yaml.MappingNode
    return kind(event.tag, [], event.start_mark, event.end_mark)


@cache
def _rules() -> dict[str, list[tuple[str, Any]]]:
    """By the first character of a word, the tags that it may have, and what it must match."""
    rules: dict[str, list[tuple[str, Any]]] = {}
    for versions, tag, pattern, first in implicit_resolvers:
        if (1, 2) in versions:
            for character in first:
                rules.setdefault(character, []).append((tag, pattern))
    return rules


def _tag(word: str) -> str:
    """The tag of a word without quotes."""
    return next((tag for tag, pattern in _rules().get(word[:1], ()) if pattern.match(word)), _TAG + "str")
