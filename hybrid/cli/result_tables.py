"""What run and static print of lines, and of the points and bodies where they meet."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import hybrid
from hybrid.cli.console import Console, Grid, table_of
from hybrid.cli.tables import (
    ends_rows,
    equilibrium_facts,
    errors_facts,
    errors_table,
    extremes_facts,
    extremes_rows,
    quantities_facts,
    search_rows,
    vector_text,
    verdict_text,
    verdicts_of,
    zones_line,
    zones_over_time,
)
from hybrid.errors import Complaint, SceneError
from hybrid.store.envelope import NOT_VERIFIED, TOUCH
from hybrid.store.records import error_words

if TYPE_CHECKING:
    from hybrid.store.reader import Result


# Lines, points and bodies that are listed each; of more so many, the worst, are shown.
MOST_LISTED = 12
SHOWN = 8


def show_motion(console: Console, asked: Any, result: Result, target: Path) -> tuple[str, dict[str, Any]]:
    """Print what a run has reached; what to say of it behind its length, and for programs."""
    console.events(result.events)
    adaptive = {asked.form.names[name] for name in asked.adaptive}
    zones = {name: zones_over_time(line) for name, line in result.each_line() if name in adaptive}
    for name, found in [*zones.items()][:MOST_LISTED]:
        console.show(partial(zones_line, found, target, name))
    errors = _show_errors(console, result)
    more = "; error not estimated" if not errors else ""
    if errors and result.lines:
        more = f"; estimated error {error_words(result.attributes)}"
    lines = _facts_of_lines(result)
    rest = _show_lines(console, result, lines)
    if "" in lines:
        return more, zones.get("", {}) | {"errors": errors, "extremes": lines[""]}
    return more, {"lines": {name: facts | zones.get(name, {}) for name, facts in lines.items()}} | rest


def show_equilibrium(console: Console, result: Result) -> dict[str, Any]:
    """The same of an equilibrium."""
    lines = _facts_of_lines(result)
    whole = {x: result.attributes[f"static_{x}"] for x in ("path", "residual")}  # how it was found
    if "" in lines:
        whole = equilibrium_facts(result)
    rest = _show_lines(console, result, lines, whole)
    errors = _show_errors(console, result)
    console.events(result.events)
    return whole | ({"errors": errors} if "" in lines else {"lines": lines} | rest)


def _facts_of_lines(result: Result) -> dict[str, Any]:
    """What each line has reached, and whether that is accurate; of many the worst come first."""
    from hybrid.view.curves import worst_first

    each = dict(result.each_line())
    names = [*each] if len(each) <= MOST_LISTED else worst_first(result)
    return {name: extremes_facts(each[name]) | (verdicts_of(each[name]) if name else {}) for name in names}


def _show_errors(console: Console, result: Result) -> dict[str, Any]:
    """Print the estimated errors of a line alone; those of the result."""
    errors = errors_facts(result)
    if errors and not result.lines:
        console.show(lambda: errors_table(errors, result))
    return errors


def _show_lines(
    console: Console, result: Result, lines: dict[str, Any], search: dict[str, Any] | None = None
) -> dict[str, Any]:
    """Print what lines, points and bodies have reached, and return that of the latter.

    search: of an equilibrium, how it was found.
    """
    points, bodies, held = _last(result, "points"), _last(result, "bodies"), list[dict[str, Any]]()
    end = float(result.times[-1]) if search is None and len(result.times) > 1 else None
    meetings: list[tuple[float, str]] = []
    if "" not in lines:  # else they are among the facts of the line
        held, meetings = quantities_facts(result), [(x.t, x.text) for x in result.events if x.kind == TOUCH]
        meetings += [(x.t_force, f"{x.partner}: {x.text}") for x in result.contacts()]
    many = len(lines) > MOST_LISTED
    rows = [*search_rows(search)] if search is not None else []
    for name, facts in () if many else lines.items():
        rows += _rows_of_line(name, facts, end is not None)
    rows += ends_rows(search) if search is not None and "" in lines else []
    rows += _rows_beside(points, bodies, held, end, meetings)
    if many:
        console.show(lambda: _ranked(lines, end is not None))
        console.show(lambda: "")
    console.show(lambda: Grid(rows))
    return {"points": points, "bodies": bodies, "quantities": held}


def _last(result: Result, group: str) -> dict[str, dict[str, Any]]:
    """The last value of all that is known of each point or body, by its name."""
    found: dict[str, dict[str, Any]] = {}
    for full in result.names:
        if full.startswith(f"{group}/"):
            name, _, key = full.removeprefix(f"{group}/").partition("/")
            found.setdefault(name, {})[key] = result[full][-1].tolist()
    return found


def _rows_beside(
    points: dict[str, Any], bodies: dict[str, Any], held: list[dict[str, Any]], end: float | None,
    meetings: list[tuple[float, str]],
) -> Iterator[tuple[str, str]]:  # fmt: skip
    """Rows of points and bodies, of lines that meet, and of what is held.

    end: s, time of the last output, of which points and bodies are; None: of an equilibrium; meetings: of lines, when
    (s) and where they touched first, and with what force.
    """
    last = "" if end is None else f"at t = {end:.5g} s: "
    yield from _shown(points, "point", last + "{}", _of_point)
    yield from _shown(bodies, "body", last + "{}", _of_body)
    for t, text in meetings[:SHOWN]:
        yield "contact", f"{'' if end is None else f't = {t:.5g} s: '}{text}"
    if len(meetings) > SHOWN:
        yield "", f"{len(meetings) - SHOWN} more contacts are among the events of the report"
    for x in held:
        yield x["name"], x["text"] + x["when"] + x["ending"]


def _rows_of_line(name: str, facts: dict[str, Any], moves: bool) -> Iterator[tuple[str, str]]:
    """What a line has reached, of one with a name in as few rows as will do; moves: whether there are times."""
    rows = [*extremes_rows(facts, moves)]
    if not name:
        yield from rows
        return
    (_, most), (_, least), *others = rows
    texts, bound = [f"tension {least}, to {most}"], any(x["limit"] == "min_bend_radius" for x in facts["limits"])
    names = {x["name"] for x in facts["quantities"]}  # which say it themselves
    for title, text in others:
        if bound or title != "smallest bend radius":
            texts.append(text if title in names else f"{title} {text}")
    texts += map(verdict_text, facts.get("accuracy", ()))
    yield from ((f"line {name}" * (not k), text) for k, text in enumerate(texts))


def _ranked(lines: dict[str, Any], moves: bool) -> Any:
    """A row for each of the worst of many lines, which come first, and one for all others."""
    from hybrid.view.figure import prefix

    most = max(x["tension_max"]["value"] for x in lines.values())
    factor, unit = prefix("N", most)
    where, verdict = ["s (m)"] + ["t (s)"] * moves, "limits and accuracy"
    heads = ["line", f"largest {unit}", *where, f"smallest {unit}", *where, verdict]
    table = table_of(heads, [], ("line", verdict), [verdict])
    table.columns[0].style = "bold"
    for name, facts in [*lines.items()][:SHOWN]:
        ends = [facts["tension_max"], facts["tension_min"]]
        cells = [[f"{factor * x['value']:.4g}", f"{x['s']:.4g}", *[f"{x['t']:.4g}"] * moves] for x in ends]
        table.add_row(name, *cells[0], *cells[1], _verdict(facts))
    others = dict([*lines.items()][SHOWN:])
    highest = factor * max(x["tension_max"]["value"] for x in others.values())
    least = min(others, key=lambda name: others[name]["tension_min"]["value"])
    low = factor * others[least]["tension_min"]["value"]
    text = f"{len(others)} other lines: tension from {low:.4g} {unit} ({least}) to {highest:.4g} {unit}"
    table.caption = f"{text}; `hybrid report` has them all"
    table.caption_justify = "left"
    return table


def _verdict(facts: dict[str, Any]) -> str:
    """What of the limits and of the accuracy of a line is broken, missed or not verified."""
    held = [*facts["limits"], *facts["quantities"]]
    broken = [x["limit"] for x in held if x["broken"]]
    words = [f"{', '.join(broken)} BROKEN"] if broken else []
    open_ = sum(x["verdict"] == NOT_VERIFIED for x in held)
    words += [f"{open_} of {len(held)} not verified"] if open_ else []
    words += ["within limits"] if held and not words else []
    return "; ".join(words + sorted({x["verdict"] for x in facts.get("accuracy", ())}))


def _shown(
    each: dict[str, dict[str, Any]], what: str, around: str, text: Callable[[dict[str, Any]], str]
) -> Iterator[tuple[str, str]]:
    """Names and texts of points or bodies; of many those with the largest forces, and how many others there are."""
    names = list(each)
    if len(names) > MOST_LISTED:
        names.sort(key=lambda name: -math.hypot(*each[name].get("force", (0.0,))))
        names = names[: SHOWN // 2]
    for name in names:
        yield f"{what} {name}", around.format(text(each[name]))
    if len(names) < len(each):
        yield "", f"{len(each) - len(names)} others with smaller forces: `hybrid report` has them all"


def _of_point(facts: dict[str, Any]) -> str:
    turned = f", turned by {vector_text(facts['rotation'], 1e-6)} deg" if "rotation" in facts else ""
    force = f", force of the lines {vector_text(facts['force'])} N" if "force" in facts else ""
    moment = f", moment {vector_text(facts['moment'])} N m" if "moment" in facts else ""
    return f"{vector_text(facts['position'])} m{turned}{force}{moment}"


def _of_body(facts: dict[str, Any]) -> str:
    turned = f"{vector_text(facts['position'])} m, turned by {vector_text(facts['rotation'], 1e-6)} deg"
    return f"{turned}, force of the lines {vector_text(facts['force'])} N, moment {vector_text(facts['moment'])} N m"


# What `hybrid static --stiffness` and `--offsets` print.

COUNT = 11  # offsets from one side to the other
NAMES = ("x", "y", "z", "roll", "pitch", "yaw")


def check_holding(asked: Any, stiffness: str | None, offsets: str | None, reach: float | None, heading: float) -> None:
    """SceneError where what is asked cannot be had, before anything is computed."""
    if reach is not None and offsets is None:
        raise SceneError([Complaint("--reach", f"{reach:g}", "a point or body to shift", "--offsets point:NAME")])
    given = {name: at for name, at in (("--stiffness", stiffness), ("--offsets", offsets)) if at is not None}
    if given:
        from hybrid.simulation.lines_stiffness import target_of

        for at in given.values():
            target_of(asked, at)
    if offsets is not None:
        if reach is None:
            fix = "add --reach 20 (m), the largest offset to either side"
            raise SceneError([Complaint("--offsets", offsets, "how far", fix)])
        if not 0.0 < reach < np.inf:
            raise SceneError([Complaint("--reach", f"{reach:g}", "a length > 0, in m", "--reach 20")])
        if not np.isfinite(heading):
            raise SceneError([Complaint("--heading", f"{heading:g}", "an angle in deg", "--heading 90")])


def show_holding(
    console: Console, asked: Any, stiffness: str | None, offsets: str | None, reach: float | None, heading: float,
) -> None:  # fmt: skip
    """Print the stiffness at a point or body, and the forces on one that is held beside its equilibrium."""
    if stiffness is not None:
        found = hybrid.stiffness(asked, stiffness)
        facts = {
            key: value.tolist() if isinstance(value, np.ndarray) else value for key, value in asdict(found).items()
        }
        console.json("stiffness", **facts)
        units = "N/m" if len(found.matrix) == 3 else "N/m, N/rad, N m/m, N m/rad"
        console.show(lambda: _matrix(f"stiffness at {found.at} ({units})", found.matrix))
        if not np.array_equal(found.matrix, found.lines):
            console.show(lambda: _matrix("of it, by the lines", found.lines))
    if offsets is not None and reach is not None:
        curve = hybrid.offsets(asked, offsets, np.linspace(-reach, reach, COUNT).tolist(), heading)
        console.json(
            "offsets", at=curve.at, heading=curve.heading, distance=curve.distance.tolist(),
            force=curve.force.tolist(), moment=None if curve.moment is None else curve.moment.tolist(),
            restoring=curve.restoring.tolist(), tension={k: v.tolist() for k, v in curve.tension.items()},
        )  # fmt: skip
        console.show(lambda: _curve(curve))


def _matrix(title: str, matrix: Any) -> Any:
    heads, big = ["", *NAMES[: len(matrix)]], np.abs(matrix).max(initial=0.0)
    rows = [
        [name, *(f"{x if abs(x) > 1e-9 * big else 0.0:.5g}" for x in row)]
        for name, row in zip(NAMES, matrix, strict=False)
    ]
    return table_of(heads, rows, (), heads, title=title, min_width=len(title))


def _curve(curve: Any) -> Any:
    title, rows = f"{curve.at} held at offsets along {curve.heading:g} deg, without friction", []
    for k, distance in enumerate(curve.distance):
        line = max(curve.tension, key=lambda name: curve.tension[name][k])
        least = 1e-9 * float(np.abs(curve.force).max())
        forces = [f"{x if abs(x) > least else 0.0:.5g}" for x in (curve.restoring[k], curve.force[k, 2])]
        rows.append([f"{distance:.5g}", *forces, f"{curve.tension[line][k]:.5g}", line])
    heads = ("offset (m)", "restoring force (N)", "vertical force (N)", "largest tension (N)", "in line")
    return table_of(heads, rows, (), heads, title=title)
