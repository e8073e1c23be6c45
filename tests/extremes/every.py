"""All extreme cases in the order of their page, and the page itself."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from functools import cache
from itertools import groupby
from pathlib import Path
from typing import Any

import chains
import lines
import motions
import pytest
import rods
from extreme import MODELS, Case, Verdict

PAGE = Path(__file__).parents[2] / "docs" / "extremes.md"
CASES: list[Case] = [*lines.CASES, *rods.CASES, *motions.CASES, *chains.CASES]

FAMILIES = list(dict.fromkeys(case.family for case in CASES))


def takes_long(case: Case) -> bool:
    """About a second or more: thousands of cells in zones that move, stiff links for scipy, thousands of steps."""
    cells = case.scene.get("mesh", {}).get("cells", 0)
    time = case.scene.get("time")
    steps = time["duration"] / time["step"] if time else 0
    stiff = case.family == "whips and chains" and "(1 w L" in case.name
    return stiff or (case.model == "adaptive" and (cells >= 1000 or steps > 600))


def parameters(cases: Sequence[Case]) -> list[Any]:
    """The cases of a file for pytest, slow ones marked."""
    return [
        pytest.param(c, id=c.key.replace(" | ", "; "), marks=[pytest.mark.slow] if takes_long(c) else []) for c in cases
    ]


@cache
def listed() -> dict[str, str]:
    """Outcomes of docs/extremes.md by the key of their case."""
    found, family = {}, ""
    for row in PAGE.read_text(encoding="utf-8").splitlines() if PAGE.exists() else ():
        if row.startswith("## "):
            family = next((x for x in FAMILIES if x.lower() == row[3:].lower()), "")
        elif family and row.startswith("| ") and not row.startswith("| case "):
            name, model, outcome = row[2:].split(" | ")[:3]
            found[f"{family} | {name} | {model}"] = outcome
    return found


HEAD = """\
# Extreme cases

Use this page to see where each model holds, where it warns, and where it refuses.
Every line below was computed, and this page written, by
`pytest tests/extremes -m "not bench" --write-extremes`.

*Right*: within the tolerance of the truth, by the figure that comes nearest to it.  *Warned*: not within it, and the
result says so in an event.  *Refused*: a scene that is refused or a computation that stops, with its true cause.
There is no fourth kind: a test fails where an answer is wrong and nothing says so, where anything but a
`SceneError` or a `ComputationError` comes out, and where a case takes more than 20 s.
The families, their truths and the reasons for the tolerances are in tests/extremes.  SI units.

"""


def page(judged: Sequence[tuple[Case, Verdict]]) -> str:
    """docs/extremes.md: the summary of family x model, and every case."""
    rows = sorted(judged, key=lambda x: FAMILIES.index(x[0].family))
    text = HEAD + f"{len(rows)} cases.\n\n| family | " + " | ".join(MODELS) + " | worst error / tolerance |\n"
    text += "|---" * (len(MODELS) + 2) + "|\n"
    tables = ""
    for family, members in groupby(rows, key=lambda x: x[0].family):
        cases = list(members)
        cells = []
        for model in MODELS:
            count = Counter(verdict.outcome for case, verdict in cases if case.model == model)
            cells.append(
                ", ".join(f"{count[x]} {x}" for x in ("right", "warned", "refused", "wrong") if count[x]) or "–"
            )
        worst = max((v.ratio for _, v in cases if v.outcome == "right"), default=0.0)
        text += f"| {family} | " + " | ".join(cells) + f" | {worst:.2g} |\n"
        sources = list(dict.fromkeys(case.source for case, _ in cases))
        tables += f"\n## {family.capitalize()}\n\n" + "".join(f"{k}. {x}\n" for k, x in enumerate(sources, 1))
        tables += f'\n<details markdown="1">\n<summary>{len(cases)} cases</summary>\n'
        tables += "\n| case | model | outcome | error | tolerance | truth | warnings or refusal |\n|---|---|---|---|---|---|---|\n"
        for case, v in cases:
            tables += line(case, v, sources.index(case.source) + 1) + "\n"
        tables += "\n</details>\n"
    return text + tables


def line(case: Case, v: Verdict, source: int) -> str:
    """One row of a family's table."""
    figures = ("", "") if v.outcome == "refused" else (f"{v.what} {v.error:.1e}", f"{v.tolerance:.1e}")
    said = v.said.splitlines()
    brief = said[0] if v.outcome == "refused" and len(said) == 1 else " ".join(x.strip() for x in said[:2])
    brief = re.sub(r"\s+", " ", brief).replace("|", "\\|")
    return f"| {case.name} | {case.model} | {v.outcome} | {figures[0]} | {figures[1]} | {source} | {brief[:160]} |"
