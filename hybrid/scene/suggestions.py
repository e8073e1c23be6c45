"""What a word that the schema does not know may have meant: by its spelling, or by descriptions."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping

# Of a path of Windows in double quotes, where YAML takes \n and \t for characters.
PATHS = "write the path with /, as in C:/folder/file.csv, or in single quotes"
MOST = 3  # so many of the schema's words are proposed at most


def nearest(word: str, known: Mapping[str, str] | Iterable[str], shown: Mapping[str, str] | None = None) -> str:
    """What `word` may have meant among the words `known`, as a question; empty if nothing is near.

    known: words, or words with their descriptions, which hold symbols and other names (``EI``, ``wind``).
    shown: what to show of a word that is known by its description, such as its unit.
    """
    texts = known if isinstance(known, Mapping) else dict.fromkeys(known, "")
    meant = [name for name, text in texts.items() if speaks_of(text, word)]
    near = difflib.get_close_matches(word.lower(), texts, n=1, cutoff=0.6)
    if near and not meant:
        return f"did you mean {near[0]}?"
    if not meant and len(word) > MOST:
        meant = [name for name, text in texts.items() if _like_a_word_of(text, word)]
    return f"did you mean {' or '.join((shown or {}).get(name, name) for name in meant[:MOST])}?" if meant else ""


def speaks_of(text: str, word: str) -> bool:
    """Whether a description holds a word, or the words of a key."""
    return re.search(rf"\b{re.escape(word.lower().replace('_', ' '))}\b", text.lower()) is not None


def _like_a_word_of(text: str, word: str) -> bool:
    return bool(difflib.get_close_matches(word.lower(), re.findall(r"\w+", text.lower()), n=1, cutoff=0.8))


def did_you_mean(word: str, known: Mapping[str, str] | Iterable[str]) -> str:
    """The fix for a misspelt word: the nearest known one, or all of them."""
    words = list(known)
    return nearest(word, known) or f"known here: {', '.join(words)}"


def decimal_comma(text: str) -> str:
    """The fix for a number with a decimal comma."""
    return f"a decimal comma? write {text.replace(',', '.').strip()}"
