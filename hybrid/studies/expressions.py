"""Arithmetic that users write: conditions of a study, columns derived from others, what a design minimises."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

from hybrid.errors import Complaint, SceneError, optional_package


def evaluated(where: str, text: str, rows: Sequence[Mapping[str, Any]]) -> list[Any]:
    """The value of an expression for each row; SceneError for what is none, or a name that is not known."""
    package = optional_package("simpleeval", "an expression", "studies")
    functions = {name: getattr(math, name) for name in ("sqrt", "exp", "log", "sin", "cos", "tan", "radians", "pi")}
    pi = functions.pop("pi")
    functions |= {"abs": abs, "min": min, "max": max, "round": round}
    evaluator = package.SimpleEval(functions=functions)
    try:
        found = []
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # an assignment, m = 5 for m == 5, is only warned of
            tree = evaluator.parse(text)
            for row in rows:
                evaluator.names = {"pi": pi, **row}
                found.append(evaluator.eval(text, tree))
        return found
    except Exception as error:
        expected = f"arithmetic and comparisons of {', '.join(rows[0])}; {error}"
        raise SceneError([Complaint(where, text, expected)]) from None
