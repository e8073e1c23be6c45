"""The page: a table to every problem, with the command that printed it."""

from __future__ import annotations

from board.answers import Answer, Problem

FAR = 0.005
HEAD = """\
# Board

Use this page to see how near `hybrid` and other programs come to published values and closed forms, and at what cost.
`{command}`, in the folder `bench`, wrote it; `bench/board/references.json` has the references and their sources.

- Brackets: distance to the reference. ±: the program's own error figure.
- CPU time is that of the whole computation, as the bench of that program takes it: median of three (of peers on the
  mooring line the fastest of three, MoorDyn's one run), kernels loaded. Times are ratios within one run on a busy machine.
- Versions: {versions}. Not installed: {missing}.
  A program without a row has no adapter for that problem.
- {short}

![Error against CPU time of every program](pictures/board.png)
"""


def number(value: float) -> str:
    """Five digits."""
    return f"{value:.5g}" if abs(value) < 1e5 else f"{value:.0f}"


def cell(problem: Problem, answer: Answer, quantity: str) -> str:
    """A value with its error figure and distance."""
    if quantity not in answer.values:
        return ""
    value = answer.values[quantity]
    text = number(value)
    if quantity in answer.figures:
        text += f" ± {answer.figures[quantity]:.1g}"
    references = problem.references[quantity]
    if not references or not next(iter(references.values())):
        return text
    return f"{text} ({100 * problem.error(answer, quantity):+.2f} %)"


def table(problem: Problem) -> list[str]:
    """Rows of references and programs."""
    names = list(problem.references)
    sources = list(dict.fromkeys(source for x in problem.references.values() for source in x))
    rows = [["program", *names, "CPU, s"]]
    for source in sources:
        values = [problem.references[name].get(source) for name in names]
        rows += [[source, *("" if x is None else number(x) for x in values), ""]]
    for answer in problem.answers:
        said = f"{answer.program}, {answer.words}" if answer.words else answer.program
        cost = "" if answer.cpu is None else f"{answer.cpu:.2g}" if answer.cpu < 10.0 else f"{answer.cpu:.0f}"
        rows += [[said, *(cell(problem, answer, name) for name in names), cost]]
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    return [lines[0], "|---" * len(rows[0]) + "|", *lines[1:]]


def within(problem: Problem) -> str:
    """Of a problem whose references disagree: which of them lies within the error figure of ours."""
    (ours,) = (x for x in problem.answers if x.figures)
    found = []
    for name, values in problem.references.items():
        inside = [s for s, v in values.items() if abs(v - ours.values[name]) <= ours.figures[name]]
        nearest = min(values, key=lambda source: abs(values[source] - ours.values[name]))
        found.append(f"{name}: {', '.join(inside) or 'none'} (nearest {nearest})")
    return "Within the error figure of hybrid: " + "; ".join(found) + "."


def section(problem: Problem) -> list[str]:
    """Title, statement, table."""
    lines = [f"## {problem.title}", problem.statement]
    if not problem.references:
        return [*lines, *(f"{x.program}: {x.words}; CPU {x.cpu:.2g} s in the median." for x in problem.answers)]
    lines += ["", *table(problem)]
    if not any(problem.references.values()):
        lines += ["", "No reference: the program that computes it is not installed."]
    return [*lines, "", within(problem)] if problem.disputed else lines


def falls_short(problems: list[Problem]) -> str:
    """Problems where even the nearest run of ours is farther than FAR from the reference."""
    far = []
    for problem in problems:
        errors = [problem.largest_error(x) for x in problem.answers if x.program == "hybrid"]
        least = min((x for x in errors if x is not None), default=0.0)
        if least > FAR:
            far.append(f"{problem.title.lower()} ({100 * least:.2g} %)")
    return f"Where `hybrid` is farther than {100 * FAR:g} % from the first reference: {', '.join(far) or 'nowhere'}."


def page(problems: list[Problem], command: str, versions: str, missing: str) -> str:
    """The whole page."""
    said = {"command": command, "versions": versions, "missing": missing, "short": falls_short(problems)}
    lines = HEAD.format(**said).splitlines()
    for problem in problems:
        lines += ["", *section(problem)]
    return "\n".join(lines) + "\n"
