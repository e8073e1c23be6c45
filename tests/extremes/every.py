"""All extreme cases in the order of their page, and the page itself."""

from __future__ import annotations

import csv
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

EVIDENCE = Path(__file__).parents[2] / "docs" / "evidence"
PAGE, TABLE = EVIDENCE / "extremes.md", EVIDENCE / "extremes.csv"
COLUMNS = ("family", "case", "model", "outcome", "figure", "error", "tolerance", "truth", "said")
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
    """Outcomes of docs/evidence/extremes.csv by the key of their case."""
    return {" | ".join((row["family"], row["case"], row["model"])): row["outcome"] for row in read()}


def read() -> list[dict[str, str]]:
    """The rows of the table; empty if it has not been written."""
    if not TABLE.exists():
        return []
    with TABLE.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


HEAD = """\
# Extreme cases

Use this page to see where each model holds, where it warns, and where it refuses.
Every case was computed, and this page and its table written, by
`pytest tests/extremes -m "not bench" --write-extremes`; [extremes.csv](extremes.csv) has all cases, one a row.

*Right*: within the tolerance of the truth, by the figure that comes nearest to it.  *Warned*: not within it, and the
result says so in an event.  *Refused*: a scene that is refused or a computation that stops, with its true cause.
There is no fourth kind: a test fails where an answer is wrong and nothing says so, where anything but a
`SceneError` or a `ComputationError` comes out, and where a case takes more than 20 s.
The families, their truths and the reasons for the tolerances are in tests/extremes.  SI units.

"""


def rows(judged: Sequence[tuple[Case, Verdict]]) -> list[dict[str, str]]:
    """The table of all cases, by family."""
    ordered = sorted(judged, key=lambda x: FAMILIES.index(x[0].family))
    return [row(case, verdict) for case, verdict in ordered]


def row(case: Case, v: Verdict) -> dict[str, str]:
    """One case of the table."""
    figures = ("", "", "") if v.outcome == "refused" else (v.what, f"{v.error:.1e}", f"{v.tolerance:.1e}")
    said = v.said.splitlines()
    brief = said[0] if v.outcome == "refused" and len(said) == 1 else " ".join(x.strip() for x in said[:2])
    values = (case.family, case.name, case.model, v.outcome, *figures, case.source, re.sub(r"\s+", " ", brief)[:160])
    return dict(zip(COLUMNS, values, strict=True))


def page(table: Sequence[dict[str, str]]) -> str:
    """docs/evidence/extremes.md: the summary of family x model, and what each family is compared with."""
    text = HEAD + f"{len(table)} cases.\n\n| family | " + " | ".join(MODELS) + " | worst error / tolerance |\n"
    text += "|---" * (len(MODELS) + 2) + "|\n"
    truths = "\n## Truths\n\n"
    for family, members in groupby(table, key=lambda x: x["family"]):
        cases = list(members)
        cells = []
        for model in MODELS:
            count = Counter(x["outcome"] for x in cases if x["model"] == model)
            cells.append(
                ", ".join(f"{count[x]} {x}" for x in ("right", "warned", "refused", "wrong") if count[x]) or "–"
            )
        worst = max((float(x["error"]) / float(x["tolerance"]) for x in cases if x["outcome"] == "right"), default=0.0)
        text += f"| {family} | " + " | ".join(cells) + f" | {worst:.2g} |\n"
        truths += f"- **{family.capitalize()}**: " + "; or ".join(dict.fromkeys(x["truth"] for x in cases)) + "\n"
    return text + truths


def write(table: Sequence[dict[str, str]]) -> None:
    """The table of all cases, and the page made from it."""
    with TABLE.open("w", encoding="utf-8", newline="") as file:
        out = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        out.writeheader()
        out.writerows(table)
    PAGE.write_text(page(table), encoding="utf-8")
