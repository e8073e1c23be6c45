"""What is wrong with a text that is not YAML, at the line where it has to be changed.

A parser stops where it can read no further, which is often a line after the fault: at the first colon behind a key
without one, at the first key behind a bracket that was never closed, at the end of the text behind an open quote.
"""

from __future__ import annotations

import re
import warnings
from contextlib import suppress
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, ReusedAnchorWarning, YAMLError
from ruamel.yaml.reader import ReaderError
from ruamel.yaml.tokens import (
    FlowMappingEndToken,
    FlowMappingStartToken,
    FlowSequenceEndToken,
    FlowSequenceStartToken,
    ScalarToken,
)

from hybrid.errors import Complaint
from hybrid.scene.base import PATHS
from hybrid.scene.yaml_nodes import READABLE, WRITE_OUT

OPENING, CLOSING = (FlowMappingStartToken, FlowSequenceStartToken), (FlowMappingEndToken, FlowSequenceEndToken)
BRACKETS = {"{": "}", "[": "]"}
_COLON = "a key needs a colon and a space behind it"

# Line and column, counted from 0; what is wrong there; the remedy.
Fault = tuple[int, int, str, str]


def compose(text: str) -> Any:
    """The tree of a text as ruamel.yaml reads it, or a complaint that says what is wrong with it."""
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


def not_yaml(text: str, error: MarkedYAMLError) -> Complaint:
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


def odd_character(text: str, error: ReaderError) -> Complaint:
    """A character that no YAML text may have."""
    before = text[: error.position]
    line, column = before.count("\n") + 1, error.position - before.rfind("\n")
    given = f"the character U+{ord(text[error.position]):04X}"
    return Complaint("YAML", given, f"{READABLE}; it has no such characters", "take it out", line, column)


def _fault(text: str, lines: list[str], error: MarkedYAMLError) -> Fault:
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
        if isinstance(token, ScalarToken) and token.style in ("'", '"') and token.start_mark.line < line:
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
    opened, closing = unclosed[-1], "".join(BRACKETS[_sign(x)] for x in reversed(unclosed))
    where = "" if opened.start_mark.line == last else f" of line {opened.start_mark.line + 1}"
    or_comma = ", or put a comma behind the entry" if end is None and here.strip() and not where else ""
    return last, behind, f"the bracket {_sign(opened)}{where} is not closed", f"close it with {closing}{or_comma}"


def _end_of_content(lines: list[str], token: Any, line: int) -> int | None:
    """The first line, up to one, that begins something new behind an open bracket: a key, an entry, a like bracket."""
    opened = token.start_mark
    first = lines[opened.line][: opened.column].strip() == ""
    new = rf"- |[A-Za-z_]\w*\s*:|{re.escape(_sign(token))}" if first else r"- |[A-Za-z_]\w*\s*:"
    for k in range(opened.line + 1, min(line + 1, len(lines))):
        if _content(lines[k]) and _indent(lines[k]) <= _indent(lines[opened.line]) and re.match(new, lines[k].lstrip()):
            return k
    return None


def _sign(token: Any) -> str:
    return "{" if isinstance(token, FlowMappingStartToken) else "["


def _open_after(tokens: list[Any], line: int) -> list[Any]:
    """The brackets that are open where a line begins, outermost first."""
    still: list[Any] = []
    for token in tokens:
        if token.start_mark.line >= line:
            break
        if isinstance(token, OPENING):
            still.append(token)
        elif isinstance(token, CLOSING) and still:
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
