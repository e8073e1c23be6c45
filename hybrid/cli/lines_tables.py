"""What run and static print of lines with names, and of the points and bodies where they meet."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

import hybrid
from hybrid.cli.tables import (
    extremes_facts,
    judged_text,
    place_text,
    quantities_facts,
    unknown_text,
    verdict_text,
    verdicts_of,
)
from hybrid.errors import Complaint, SceneError
from hybrid.store.envelope import NOT_VERIFIED, TOUCH

if TYPE_CHECKING:
    from hybrid.cli.console import Console
    from hybrid.store.reader import Result


# Lines, points and bodies that are listed each; of more so many, the worst, are shown.
MOST_LISTED = 12
SHOWN = 8


def show_lines(console: Console, result: Result) -> dict[str, Any]:
    """Print what lines, points and bodies have reached, and return it."""
    from hybrid.view.along import worst_first

    names = list(result.lines) if len(result.lines) <= MOST_LISTED else worst_first(result)
    lines = {name: extremes_facts(result.lines[name]) | verdicts_of(result.lines[name]) for name in names}
    held = quantities_facts(result)
    points, bodies = _last(result, "points"), _last(result, "bodies")
    console.events(result.events)
    end = float(result.times[-1]) if len(result.times) > 1 else None
    meetings = [(x.t, x.text) for x in result.events if x.kind == TOUCH]
    meetings += [(x.t_force, f"{x.partner}: {x.text}") for x in result.contacts()]
    console.show(lambda: _table(lines, points, bodies, held, end, meetings))
    return {"lines": lines, "points": points, "bodies": bodies, "quantities": held}


def _last(result: Result, group: str) -> dict[str, dict[str, Any]]:
    """The last value of all that is known of each point or body, by its name."""
    found: dict[str, dict[str, Any]] = {}
    for full in result.names:
        if full.startswith(f"{group}/"):
            name, _, key = full.removeprefix(f"{group}/").partition("/")
            found.setdefault(name, {})[key] = result[full][-1].tolist()
    return found


def _table(
    lines: dict[str, Any], points: dict[str, Any], bodies: dict[str, Any], held: list[dict[str, Any]],
    end: float | None, meetings: list[tuple[float, str]],
) -> Any:  # fmt: skip
    """end: s, time of the last output, of which points and bodies are; None: of an equilibrium; meetings: of lines,

    when (s) and where they touched first, and with what force.
    """
    from rich.console import Group
    from rich.table import Table

    last = "" if end is None else f"at t = {end:.5g} s: "
    table = Table.grid(padding=(0, 2))
    for name, facts in lines.items() if len(lines) <= MOST_LISTED else ():
        for k, text in enumerate(_of_line(facts, end is not None)):
            table.add_row("" if k else f"line {name}", text)
    for name, text in _shown(points, "point", last + "{}", _of_point):
        table.add_row(name, text)
    for name, text in _shown(bodies, "body", last + "{}", _of_body):
        table.add_row(name, text)
    for t, text in meetings[:SHOWN]:
        table.add_row("contact", f"{'' if end is None else f't = {t:.5g} s: '}{text}")
    if len(meetings) > SHOWN:
        table.add_row("", f"{len(meetings) - SHOWN} more contacts are among the events of the report")
    for x in held:
        table.add_row(x["name"], x["text"] + x["when"] + x["ending"])
    table.columns[0].style = "bold"
    return table if len(lines) <= MOST_LISTED else Group(_ranked(lines, end is not None), "", table)


def _of_line(facts: dict[str, Any], moves: bool) -> Iterator[str]:
    """What a line has reached; moves: whether there are times."""

    def at(x: dict[str, Any], unit: str) -> str:
        return f"{x['value']:.5g} {unit} {place_text(x)}" + f", t = {x['t']:.5g} s" * moves

    most, least = facts["tension_max"], facts["tension_min"]
    limits = {x["limit"]: x for x in facts["limits"]}
    low, high = (
        at(x, "N") + judged_text(limits.get(limit), "N", x)
        for x, limit in ((least, "min_tension"), (most, "max_tension"))
    )
    yield f"tension {low}, to {high}{unknown_text(facts, 'N')}"
    bent, bend = facts.get("bend_radius_min"), limits.get("min_bend_radius")
    if bent is not None and bend is not None:
        yield f"smallest bend radius {at(bent, 'm')}{judged_text(bend, 'm', bent)}{unknown_text(facts, 'm')}"
    if (pressed := facts.get("contact_max")) is not None:
        held = judged_text(limits.get("max_contact_force"), "N/m", pressed)
        yield f"largest contact force {at(pressed, 'N/m')}, of {pressed['partner']}{held}"
    yield from (x["text"] + x["when"] + x["ending"] for x in facts["quantities"])
    yield from map(verdict_text, facts.get("accuracy", ()))


def _ranked(lines: dict[str, Any], moves: bool) -> Any:
    """A row for each of the worst of many lines, which come first, and one for all others."""
    from rich.table import Table

    from hybrid.view.figure import prefix

    most = max(x["tension_max"]["value"] for x in lines.values())
    factor, unit = prefix("N", most)
    table = Table(box=None, padding=(0, 1), pad_edge=False)
    where = ["s (m)"] + ["t (s)"] * moves
    table.add_column("line", style="bold", no_wrap=True)
    for name in (f"largest {unit}", *where, f"smallest {unit}", *where):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("limits and accuracy")
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
    turned = f", turned by {_vector(facts['rotation'], 1e-6)} deg" if "rotation" in facts else ""
    force = f", force of the lines {_vector(facts['force'])} N" if "force" in facts else ""
    moment = f", moment {_vector(facts['moment'])} N m" if "moment" in facts else ""
    return f"{_vector(facts['position'])} m{turned}{force}{moment}"


def _of_body(facts: dict[str, Any]) -> str:
    turned = f"{_vector(facts['position'])} m, turned by {_vector(facts['rotation'], 1e-6)} deg"
    return f"{turned}, force of the lines {_vector(facts['force'])} N, moment {_vector(facts['moment'])} N m"


def _vector(x: list[float], least: float = 0.0) -> str:
    zero = max(1e-9 * max(abs(c) for c in x), least)
    return "[" + ", ".join(f"{c if abs(c) > zero else 0.0:.5g}" for c in x) + "]"


# What `hybrid static --stiffness` and `--offsets` print.

COUNT = 11  # offsets from one side to the other
NAMES = ("x", "y", "z", "roll", "pitch", "yaw")


def check_holding(asked: Any, stiffness: str | None, offsets: str | None, reach: float | None, heading: float) -> None:
    """SceneError where what is asked cannot be had, before anything is computed."""
    if reach is not None and offsets is None:
        raise SceneError([Complaint("--reach", f"{reach:g}", "a point or body to shift", "--offsets point:NAME")])
    given = {name: at for name, at in (("--stiffness", stiffness), ("--offsets", offsets)) if at is not None}
    if given:
        from hybrid.scene.short_form import network_of
        from hybrid.simulation.lines_stiffness import target_of

        for at in given.values():
            target_of(network_of(asked), at)
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
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=None, padding=(0, 2), min_width=len(title))
    size, big = len(matrix), np.abs(matrix).max(initial=0.0)
    for name in ("", *NAMES[:size]):
        table.add_column(name, justify="right")
    for name, row in zip(NAMES, matrix, strict=False):
        table.add_row(name, *(f"{x if abs(x) > 1e-9 * big else 0.0:.5g}" for x in row))
    return table


def _curve(curve: Any) -> Any:
    from rich.table import Table

    title = f"{curve.at} held at offsets along {curve.heading:g} deg, without friction"
    table = Table(title=title, title_justify="left", box=None, padding=(0, 2))
    for name in ("offset (m)", "restoring force (N)", "vertical force (N)", "largest tension (N)", "in line"):
        table.add_column(name, justify="right")
    for k, distance in enumerate(curve.distance):
        line = max(curve.tension, key=lambda name: curve.tension[name][k])
        least = 1e-9 * float(np.abs(curve.force).max())
        forces = [f"{x if abs(x) > least else 0.0:.5g}" for x in (curve.restoring[k], curve.force[k, 2])]
        table.add_row(f"{distance:.5g}", *forces, f"{curve.tension[line][k]:.5g}", line)
    return table
