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
  mooring line the fastest of three, of MoorDyn and of chains in heave one run), kernels loaded. Compare times within a problem.
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
    if quantity in answer.walls:
        return f"{value:.2g}; {answer.walls[quantity]:.2g} s"
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
    """Of a problem whose references disagree, or are far: which of them lies within the error figure of ours."""
    ours = next(x for x in problem.answers if x.figures)
    if not problem.disputed:
        near = [
            n
            for n, (v,) in ((n, x.values()) for n, x in problem.references.items())
            if abs(v - ours.values[n]) <= ours.figures[n]
        ]
        return f"The reference lies within the error figure of hybrid: {', '.join(near) or 'in no column'}."
    found = []
    for name, values in problem.references.items():
        inside = [s for s, v in values.items() if abs(v - ours.values[name]) <= ours.figures[name]]
        nearest = min(values, key=lambda source: abs(values[source] - ours.values[name]))
        found.append(f"{name}: {', '.join(inside) or 'none'} (nearest {nearest})")
    return "Within the error figure of hybrid: " + "; ".join(found) + "."


def held(problem: Problem) -> list[str]:
    """Whether the error figure of ours holds against a finer run."""
    ours = next((x for x in problem.answers if x.figures), None)
    finer = next((x for x in problem.answers if x.finer), None)
    if ours is None or finer is None:
        return []
    ratios = {name: abs(finer.values[name] - ours.values[name]) / ours.figures[name] for name in finer.values}
    beyond = [f"{name} ({ratio:.1f} of it)" for name, ratio in ratios.items() if ratio > 1.0]
    said = f"not: {', '.join(beyond)}" if beyond else f"at most {max(ratios.values()):.2f} of it"
    return [f"The finer run lies within the error figure: {said}."]


def beside(problem: Problem) -> list[str]:
    """Of a problem whose references disagree: how far programs that were run here are from ours."""
    if not problem.disputed:
        return []
    ours, names = next(x for x in problem.answers if x.figures), list(problem.references)
    found = []
    for other in (x for x in problem.answers if x.program != "hybrid"):
        off = [100.0 * abs(other.values[x] / ours.values[x] - 1.0) for x in names]
        found.append(f"{other.program} by {min(off):.2g} to {max(off):.2g} %")
    return [f"Programs that were run here differ from hybrid: {', '.join(found)}."] if found else []


def section(problem: Problem) -> list[str]:
    """Title, statement, table."""
    lines = [f"## {problem.title}", problem.statement]
    if not problem.references:
        return [*lines, *(f"{x.program}: {x.words}; CPU {x.cpu:.2g} s in the median." for x in problem.answers)]
    lines += ["", *table(problem)]
    if not any(problem.references.values()):
        lines += ["", "No reference: the program that computes it is not installed."]
    notes = [*held(problem), *beside(problem), *(x.note for x in problem.answers if x.note)]
    if problem.disputed or (notes and any(x.figures for x in problem.answers)):
        notes.insert(0, within(problem))
    return [*lines, "", " ".join(notes)] if notes else lines


def falls_short(problems: list[Problem]) -> str:
    """Problems where even the nearest run of ours is farther than FAR from the reference."""
    far = []
    for problem in problems:
        if any(x.walls for x in problem.answers):
            continue  # several problems, each with its own measure
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
