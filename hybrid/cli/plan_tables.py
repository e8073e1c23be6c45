"""What `hybrid plan` prints: a row for each thing, or everything that is on and off, and by which key."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from math import isfinite
from textwrap import shorten, wrap
from typing import TYPE_CHECKING, Any

from hybrid.cli.console import counted, span
from hybrid.kernels.state.report import FORCES
from hybrid.model.contents import OTHERS, WHERE_NEAR
from hybrid.model.plan import NetworkPlan, Plan, parts, size_of_result
from hybrid.scene.analysis import PER_PERIOD
from hybrid.scene.network import Network
from hybrid.scene.root import Scene
from hybrid.store.capacity import kink_torque

if TYPE_CHECKING:
    from hybrid.simulation.run_quantities import Listed

NAME, COLUMNS = 13, 80  # columns of names, and of the short form
LARGE = 2e7  # bytes of a file that are worth a word
MOST_LISTED = 12  # lines with a row each: of more, those that are alike share one
MOST_PAIRS = 6  # of lines that touch each other, by name
# Forces whose names are too long for it.
SHORT = {
    "mass-proportional damping": "mass damping",
    "stiffness-proportional damping": "stiffness damping",
    "partly wetted cells at the surface": "surface",
    "drag, added mass or wetting of bodies": "bodies",
    "seabed contact": "seabed",
    "seabed friction": "friction",
    "contact of the line with itself": "contact with itself",
    "friction of the line on itself": "friction on itself",
}


def plan_facts(plan: Plan | NetworkPlan) -> dict[str, Any]:
    """A plan for programs."""
    found = asdict(plan)
    if "zones" in found:
        cells = found["cells"]
        zones = [zone | {"cells": n} for zone, n in zip(found["zones"], cells, strict=True)]
        found |= {"zones": zones, "cells": sum(cells)}
    return found


def plan_rows(scene: Scene, plan: Plan | NetworkPlan) -> list[str]:
    """A plan for people, in rows of COLUMNS columns: its lines, and what they have in common."""
    each = dict(plan.each_line())
    alone, every = each.get(""), list(each.values())
    on = {entry.what: entry.why for line in every for entry in line.contents if entry.on}
    figured = any(what.startswith("error figure") for what in on)
    rows = _rows_of_lines(scene, each) if alone is None else _rows_of_line(scene, alone, on)
    rows |= {
        "mesh": _mesh(every),
        "payout": _payout(alone),
        "forces": ", ".join(SHORT.get(name, name) for name in ("gravity", "buoyancy", *FORCES) if name in on),
        "contact": "; ".join(x for x in (_of_lines(scene, on) if alone is None else "", _contact(on)) if x),
        "hockling": _hockling(alone),
        "time": _steps(scene, plan),
        "runs": _runs(max(every, key=lambda x: x.most_runs)),
        "outputs": _outputs(scene),
        "accuracy": on.get("accuracy", "not asked for") + "; no error figure" * (not figured),
        "assumed": "; ".join(what for what, why in on.items() if why.startswith("assumed")),
    }
    return [
        shorten(scene.title, 160, placeholder=" …") or "untitled scene",
        *_table(rows),
        "all that is on and off, and why: --verbose",
    ]


def contents_tables(plan: Plan | NetworkPlan) -> list[Callable[[], Any]]:
    """What makes everything that is on and off of a plan, of lines with names one after another."""
    found: list[Callable[[], Any]] = []
    for name, line in plan.each_line():
        found += [partial(str, f"line {name}")] * bool(name) + [partial(_contents_table, line)]
    return found


def _rows_of_line(scene: Scene, plan: Plan, on: Mapping[str, str]) -> dict[str, str]:
    """Rows of a line without a name, as far as its model; on: what is on."""
    sections, attached = scene.cable.sections, len(scene.cable.attachments)
    length = sum(section.length for section in sections)
    line = [f"{length:.6g} m", counted(len(sections), "section")] + ([counted(attached, "attachment")] * bool(attached))
    plane = any(what.startswith("computed in a plane") for what in on)
    return {
        "implausible": _noted(plan, "implausible"),
        "ignored": _noted(plan, "ignored"),
        "line": ", ".join(line),
        "ends": "; ".join(what.removeprefix("ends.") for what in on if what.startswith("ends.")),
        "model": _model(plan),
        "dimension": "2: all of the scene lies in a plane" if plane else "3",
    }


def _rows_of_lines(network: Any, each: Mapping[str, Plan]) -> dict[str, str]:
    """A row for each line, with its ends, of many one for all that are alike, with their names; points and bodies."""
    rows: dict[str, str] = {}
    alike: dict[str, list[str]] = {}
    for name, line in each.items():
        joined = network.lines[name]
        length = sum(section.length for section in joined.sections)
        what = f"{_model(line)}, {counted(sum(line.cells), 'cell')}"
        what += "".join(f"; {text}" for text in _clamps(network, name))
        if len(each) > MOST_LISTED:
            alike.setdefault(f"{length:.6g} m, {what} each", []).append(name)
        else:
            rows[f"line {name}"] = f"{length:.6g} m, {joined.start} to {joined.end}, {what}"
        rows |= {f"  {name}, {kind}": _noted(line, kind) for kind in ("implausible", "ignored")}
        rows |= {f"  {name}, payout": _payout(line), f"  {name}, hockling": _hockling(line)}
    groups: dict[str, str] = {}
    for what, names in alike.items():
        key = counted(len(names), "line")
        while key in groups:
            key += " "  # another row of the same name
        groups[key] = f"{what}: {', '.join(names)}" if len(names) > 1 else f"{what.removesuffix(' each')}: {names[0]}"
    bodies = ", ".join(f"{name} ({body.kind})" for name, body in network.bodies.items())
    return groups | rows | {"free points": ", ".join(network.free) or "none", "bodies": bodies}


def _noted(plan: Plan, kind: str) -> str:
    """Entries of the contents for which a result gets an event of a kind."""
    return "; ".join(f"{entry.what}: {entry.why}" for entry in plan.contents if entry.event == kind)


def _table(rows: Mapping[str, str]) -> list[str]:
    """Names and texts, those that there are; a text that is too long for a line goes on in the next."""
    rows = {name: text for name, text in rows.items() if text}
    wide = max(NAME, *(len(name) + 2 for name in rows))
    whole: dict[str, Any] = {"break_long_words": False, "break_on_hyphens": False}  # words and keys
    lines = []
    for name, text in rows.items():
        indents: dict[str, Any] = {"initial_indent": f"{name:<{wide}s}", "subsequent_indent": " " * wide}
        lines += wrap(text, max(COLUMNS, wide + 40), **indents, **whole)
    return lines


def _contact(on: Mapping[str, str]) -> str:
    """Why a line may touch itself where nobody asks for it, and what that costs."""
    why = on.get("contact of the line with itself", "")
    return f"of the line with itself, {why}" if why.startswith(WHERE_NEAR) else ""


def _of_lines(network: Any, on: Mapping[str, str]) -> str:
    """Which lines touch each other, and what else they touch."""
    pairs, found = [f"{a} with {b}" for a, b in network.meeting_pairs], []
    if pairs:
        named = ", ".join(pairs[:MOST_PAIRS]) + (
            f" and {len(pairs) - MOST_PAIRS} more" if len(pairs) > MOST_PAIRS else ""
        )
        rubs = (
            f", friction {network.contact.friction:g}"
            if network.contact is not None and network.contact.friction
            else ""
        )
        found.append(f"of lines with each other{rubs}: {named}")
    elif OTHERS in on:
        found.append(f"of lines with each other, {on[OTHERS]}")
    elif network.contact is not None and network.contact.between is None:
        found.append("lines cannot reach each other")
    elif len(network.lines) > 1:
        found.append("lines pass through each other, and an event says where: contact: {} keeps them apart")
    shapes = [name for name, body in network.free_bodies.items() if body.shape is not None]
    for what, names in (("obstacles", [*network.obstacles]), ("bodies", shapes)):
        found += [f"of every line with {what} {', '.join(names)}"] if names else []
    return "; ".join(found)


def _outputs(scene: Scene) -> str:
    """How often and how much, where the file is large or they do not show the shortest period of waves and motions."""
    if scene.time is None:
        return ""
    every, period, size = scene.output_interval, scene.lasting_period, size_of_result(scene)
    if size < LARGE and every * PER_PERIOD <= 1.01 * period:
        return ""
    count = parts(scene.time.duration, every) + 1
    large = f"{size / 1e9:.2g} GB" if size >= 1e9 else f"{max(size / 1e6, 0.1):.2g} MB"
    few = f"; fewer than {PER_PERIOD} in the period of {period:.3g} s: set output.every"
    return f"{count}, every {every:.4g} s, in a file of some {large}{few * (every * PER_PERIOD > 1.01 * period)}"


def _clamps(network: Network, name: str) -> list[str]:
    """How the ends of a line are clamped, those that are."""
    found = []
    for end in ("start", "end"):
        held = network.clamp(name, end)
        if held is not None:
            spring = "" if held.bend_stiffness is None else f" by {held.bend_stiffness:g} N m/rad"
            found.append(f"{end} clamped{spring}{', free to spin' if held.swivel else ''}")
    return found


def _model(plan: Plan) -> str:
    """Kinds of zones; the first four of many."""
    if plan.choice:
        each = ", ".join(f"{kind} {span(seconds)}" for kind, seconds in plan.choice)
        none = f"; no catenary: {plan.no_choice}" if plan.no_choice else ""
        if plan.chosen:
            return f"{plan.chosen}, chosen by a pre-run: {plan.why}"
        return f"the cheapest by a pre-run: {each}{none}"
    if plan.base_cells is not None:
        return "adaptive: rod where a criterion asks for it, catenary elsewhere"
    if len(plan.zones) == 1:
        return plan.zones[0].kind
    kinds = [f"{zone.kind} {zone.s_b - zone.s_a:.6g} m" for zone in plan.zones]
    return ", ".join(kinds[:4]) + (f" and {len(kinds) - 4} more" if len(kinds) > 4 else "")


def _mesh(plans: Sequence[Plan]) -> str:
    """Cells and unknowns of all lines."""
    cells, unknowns = sum(sum(x.cells) for x in plans), sum(x.unknowns for x in plans)
    if any(x.base_cells is not None for x in plans):
        base = sum(sum(x.cells) if x.base_cells is None else x.base_cells for x in plans)
        few = f"{base} cells as catenary, " if base < cells else ""
        return f"{few}{counted(cells, 'cell')} ({unknowns} unknowns) if all is rod"
    return f"{counted(cells, 'cell')}, {unknowns} unknowns"


def _payout(plan: Plan | None) -> str:
    """How long the line will be, its largest rate, and its cells then."""
    paid = None if plan is None else plan.payout
    if paid is None:
        return ""
    cells = f"up to {paid.cells} cells"
    if paid.by:
        return f"{paid.by}: {paid.first:.6g} m at t = 0, up to {paid.longest:.6g} m; {cells}"
    turns = [f"{x:.6g}" for x in (paid.first, paid.last)]
    far = [x for x in (paid.shortest, paid.longest) if min(abs(x - paid.first), abs(x - paid.last)) > 1e-3]
    way = f" through {' and '.join(f'{x:.6g}' for x in far)} m" if far else ""
    return f"{turns[0]} to {turns[1]} m{way}, at most {paid.rate:.3g} m/s; {cells}"


def _hockling(plan: Plan | None) -> str:
    """The torque with which the line could throw a loop as it hangs, and from which on that would kink."""
    found = None if plan is None else plan.critical_torque
    if found is None:
        return ""
    about = "about " if found.rough else ""
    text = f"a loop can form from {about}{found.torque:.3g} N m on (s = {found.s:.4g} m)"
    if found.rough:
        text += " of the line hung without bed and bending; `hybrid static` has its tension"
    if found.of_tension:
        text += f", of which tension makes {abs(found.of_tension):.3g}"
    if found.diameter > 0.0 and found.min_bend_radius > 0.0:
        kink = kink_torque(found.stiffness, found.diameter, found.min_bend_radius)
        text += f"; a loop kinks from {kink:.3g} N m on" if isfinite(kink) else "; no torque makes a loop kink"
    return text


def _steps(scene: Scene, plan: Plan | NetworkPlan) -> str:
    time = scene.time
    if time is None:
        return "no motion, statics only"
    cpu = _cpu(scene, plan)
    if time.controlled:
        return f"{time.duration:.6g} s in about {plan.steps} steps, as the motion asks; {cpu}"
    steps = f"{time.duration:.6g} s in {plan.steps} steps"
    asked = time.step or plan.step
    short = f" ({asked:.6g} s asked)" if plan.step < 0.999 * asked else ""
    return f"{steps} of {plan.step:.6g} s{short}; {cpu}"


def _cpu(scene: Scene, plan: Plan | NetworkPlan) -> str:
    """Processor time of all runs, and what it rests on."""
    most, each = plan.most_seconds, dict(plan.each_line())
    finer = any(x.most_runs > x.runs for x in each.values())
    why = "finer runs are needed" if finer else "a line goes slack and becomes a rod"
    notes = [f"up to {span(most)} if {why}"] if most is not None and most > 1.05 * plan.seconds else []
    if any(scene.asked_scene(name).contact.self for name in each):  # and nobody knows for how long it touches
        notes.append("several times as much while it touches itself")
    notes += [] if plan.measured else ["estimated from tables: no step was tried"]
    return f"about {span(plan.seconds)} of CPU for all runs" + (f" ({'; '.join(notes)})" if notes else "")


def _runs(plan: Plan) -> str:
    """How many runs an accuracy, or an error figure, takes; empty of one."""
    if plan.most_runs == 1:
        return ""
    more = f", {plan.most_runs} at most" if plan.most_runs > plan.runs else ""
    return f"{plan.runs} with those to compare with{more}"


def _contents_table(plan: Plan) -> Any:
    """Everything: what is on and by which key, what is off and what would switch it on, cells of every zone."""
    from rich.console import Group
    from rich.table import Table

    entries = Table.grid(padding=(0, 3, 0, 0))
    entries.add_column(no_wrap=True)
    entries.add_column(overflow="fold")
    for on, what, why in ((True, "on", "asked for by"), (False, "off", "why, or what would switch it on")):
        entries.add_row(what, why, style="bold")
        for entry in (e for e in plan.contents if e.on == on):
            entries.add_row(entry.what, entry.why, style="" if on else "dim")
        entries.add_row()
    zones = Table.grid(padding=(0, 3, 0, 0))
    zones.add_row("zone", "from", "to", "cells", style="bold")
    moving = plan.base_cells is not None
    for zone, cells in zip(plan.zones, plan.cells, strict=True):
        fewest = f"{plan.base_cells} to " if moving and plan.base_cells != cells else ""
        kind, count = "adaptive" if moving else zone.kind, f"{fewest}{cells}"
        zones.add_row(kind, f"{zone.s_a:.6g} m", f"{zone.s_b:.6g} m", count)
    return Group("", entries, zones)


def outputs_table(found: Sequence[Listed], more: Sequence[Listed]) -> Any:
    """What a result will hold, and kinds of quantities that the scene could ask for."""
    from rich.console import Group
    from rich.table import Table

    table = Table.grid(padding=(0, 2))
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    table.add_row("recorded", "unit", "over", "what it is", style="bold")
    for x in found:
        table.add_row(x.name, x.unit or "-", ", ".join(x.dims), x.description)
    table.add_row()
    table.add_row("on request", "unit", "", "output.quantities: {name: {kind: ...}}", style="bold")
    for x in more:
        table.add_row(x.name, x.unit, "", x.description)
    table.add_row("wall_tension, von_mises", "N, Pa", "", "cable.sections[..].pipe: {wall: ...}")
    table.add_row("capacity_used", "%", "", "cable.sections[..].capacity: [[tension, 0], .., [0, curvature]]")
    table.add_row("code_used", "%", "", "cable.sections[..].code: {kind: E301, ...} or {kind: F201, ...}")
    table.add_row("elevation", "m", "", "output.elevation: [[x, y], ...], in waves")
    return Group("", table)
