"""What a program answers to a problem, and how far it is from the reference."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any, TypeVar

Found = TypeVar("Found")
REFERENCES = Path(__file__).with_name("references.json")
ROUNDS = 3


@dataclass(frozen=True)
class Answer:
    """Of one program to one problem: values by quantity in its unit, its own error figures, CPU time (s).

    words: what is said in place of values, of a program that has none, or beside them.  walls: wall times (s) by quantity,
    where each has a run of its own.  note: a sentence below the table.  finer: a run of ours that others are held against.
    """

    program: str
    values: dict[str, float] = field(default_factory=dict)
    figures: dict[str, float] = field(default_factory=dict)
    cpu: float | None = None
    words: str = ""
    walls: dict[str, float] = field(default_factory=dict)
    note: str = ""
    finer: bool = False


@dataclass(frozen=True)
class Problem:
    """A problem, its references by quantity and source (the first one counts), and what programs answered."""

    name: str
    title: str
    statement: str
    references: dict[str, dict[str, float]]
    answers: list[Answer]

    def error(self, answer: Answer, quantity: str) -> float:
        """Of an answer against the reference, as a part of it; of a reference of 0 the value itself."""
        right = next(iter(self.references[quantity].values()))
        return answer.values[quantity] / right - 1.0 if right else answer.values[quantity]

    def largest_error(self, answer: Answer) -> float | None:
        """Over all quantities; None of a program without values, or without references."""
        known = [abs(self.error(answer, name)) for name in answer.values if self.references.get(name)]
        return max(known) if known else None

    @property
    def disputed(self) -> bool:
        """Whether there is more than one reference."""
        return any(len(x) > 1 for x in self.references.values())


def references() -> dict[str, Any]:
    """The table of statements and published values."""
    return dict(json.loads(REFERENCES.read_text(encoding="utf-8")))


def timed(compute: Callable[[], Found], rounds: int = ROUNDS) -> tuple[Found, float]:
    """What a computation of ours returns, and its CPU time (s): median of `rounds` after one that loads what is needed."""
    compute()
    spent = []
    for _ in range(rounds):
        begin = time.process_time()
        found = compute()
        spent.append(time.process_time() - begin)
    return found, median(spent)
