"""Plans, equilibria, motions, errors and studies as facts for programs and as tables for people.

Of lines, and of the points and bodies where they meet.
rich is imported when a table is made: a command that prints JSON does without.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import hybrid
from hybrid.cli.console import Console, Grid, table_of
from hybrid.errors import OMITTED, ZONE_EVENTS, Complaint, SceneError
from hybrid.store.envelope import NOT_VERIFIED, TOUCH, largest_contact
from hybrid.store.records import UNKNOWN, error_words, not_converged_in

if TYPE_CHECKING:
    from hybrid.interop.moordyn import ImportedDeck
    from hybrid.store.reader import Result
    from hybrid.store.tables import Row, TradeTable
    from hybrid.studies.tradeoff import LevelTable

Facts = dict[str, Any]
ANCHORED = 1.0  # m
LEVEL = 1e-9  # of the length: heights that differ by less are one, because equilibria are solved to about this


def equilibrium_facts(result: Result) -> dict[str, Any]:
    """What one asks of an equilibrium first; None for what its solver does not report."""
    s, position = result.s, result.position[-1]
    bottom = lowest_node(s, position)
    force = {end: result[f"reaction_{end}"][-1].tolist() for end in ("start", "end") if f"reaction_{end}" in result}
    return {
        "path": result.attributes.get("static_path", result.message),
        "residual": result.attributes.get("static_residual"),
        **extremes_facts(result),
        "lowest": {"position": position[bottom].tolist(), "s": float(s[bottom])},
        "force": force,
        "zones": [zone._asdict() if hasattr(zone, "_asdict") else asdict(zone) for zone in result.zones[-1]],
    } | _on_the_seabed(result)


def lowest_node(s: np.ndarray, r: np.ndarray) -> int:
    """The first of the nodes s (n,) m, r (n, 3) m, that are as low as the lowest one, to within LEVEL."""
    z = r[:, 2]
    return int((z <= z.min() + LEVEL * (s[-1] - s[0])).argmax())


def extremes_facts(result: Result) -> dict[str, Any]:
    """Extremes of a result with s (m) and t (s), and the limits of sections.

    Largest and smallest tension (N), smallest bend radius (m), largest contact force (N/m) where something touches.
    Of every accepted step where the file has its envelope, and of the outputs.
    """
    from hybrid.store.verdicts import section_limits
    from hybrid.view.curves import worst

    found: dict[str, Any] = {}
    for key, low in (("tension_max", False), ("tension_min", True)):
        x = worst(result, "tension", lowest=low)
        found[key] = {"value": x.value + 0.0, "s": x.s, "t": x.t}  # a tension of -0 is 0
        found[key] |= {"s_range": list(x.over)} if x.over is not None else {}
    if "curvature" in result:
        x = worst(result, "curvature")
        straight = not x.value * float(result.s[-1] - result.s[0]) > 1e-6
        found["bend_radius_min"] = None if straight else {"value": 1.0 / x.value, "s": x.s, "t": x.t}
    if (pressed := largest_contact(result)) is not None:
        partner, most = pressed
        found["contact_max"] = {"value": most.value, "s": most.s, "t": most.t, "partner": partner}
    found["not_converged"] = sorted(not_converged_in(result.attributes))
    found["quantities"] = quantities_facts(result)
    return found | {"limits": [x._asdict() | {"not_verified": x.not_verified} for x in section_limits(result)]}


def quantities_facts(result: Result) -> list[dict[str, Any]]:
    """The limits of named quantities and of stress, with their verdicts."""
    from hybrid.store.verdicts import quantity_limits

    moves = len(result.times) > 1
    return [x._asdict() | {"text": x.text, "when": x.when * moves, "ending": x.ending} for x in quantity_limits(result)]


def extremes_rows(facts: dict[str, Any], moves: bool) -> Iterator[tuple[str, str]]:
    """The same in words; moves: whether there are times."""
    limits = {x["limit"]: x for x in facts["limits"]}
    rows = (
        ("largest tension", "tension_max", "N", "max_tension"),
        ("smallest tension", "tension_min", "N", "min_tension"),
        ("smallest bend radius", "bend_radius_min", "m", "min_bend_radius"),
        ("largest contact force", "contact_max", "N/m", "max_contact_force"),
    )
    for title, key, unit, limit in rows:
        x, held = facts.get(key), limits.get(limit)
        if x is None:
            continue
        place = "from s = {:.5g} to {:.5g}".format(*x["s_range"]) if "s_range" in x else f"at s = {x['s']:.5g}"
        text = f"{x['value']:.5g} {unit} {place} m" + f", t = {x['t']:.5g} s" * moves
        text += f", of {x['partner']}" if "partner" in x else ""
        of = {"N": "tension", "m": "curvature"}.get(unit)  # whose error does not converge
        yield title, text + judged_text(held, unit, x) + f"; {UNKNOWN}" * (of in facts["not_converged"])
    for x in facts["quantities"]:
        yield x["name"], x["text"] + x["when"] + x["ending"]


def judged_text(held: dict[str, Any] | None, unit: str, extreme: dict[str, Any]) -> str:
    """Whether a limit of sections is kept, behind the extreme that it is about; "" without a limit."""
    if held is None:
        return ""
    if held["not_verified"]:
        side = "at most" if held["limit"].startswith("max") else "at least"
        return f"; {held['limit']}, {side} {held['allowed']:.5g} {unit}, {held['not_verified']}"
    if not held["broken"]:
        return f"; within {held['limit']}"
    there = "" if (held["s"], held["t"]) == (extreme["s"], extreme["t"]) else f" at s = {held['s']:.5g} m"
    return f"; {held['limit']} of {held['allowed']:.5g} {unit} BROKEN{there}"


def _on_the_seabed(result: Result) -> dict[str, Any]:
    """Touchdown, grounded length and contact force, where there is a seabed; None where nothing touches."""
    if "grounded_length" not in result:
        return {}
    edges = [float(x) if x == x else None for x in result["touchdown"][-1]]
    grounded, force = float(result.grounded_length[-1]), float(result.contact_force[-1])
    found = {"touchdown": edges, "grounded_length": grounded, "contact_force": force}
    lifts = {end: [float(x[-1]) for x in result.uplift(end)] for end in ("start", "end") if _is_anchor(result, end)}
    return found | ({"uplift": {k: {"force": f, "angle": a} for k, (f, a) in lifts.items()}} if lifts else {})


def _is_anchor(result: Result, end: str) -> bool:
    """Whether an end is held on the seabed, at most ANCHORED above it."""
    if f"reaction_{end}" not in result or not result[f"reaction_{end}"][-1].any():
        return False
    *normal, offset = result["seabed"].tolist()
    zones, k = result.zones[-1], 0 if end == "start" else -1
    if abs(result.s[k] - (zones[0].s_a if end == "start" else zones[-1].s_b)) > LEVEL * (zones[-1].s_b - zones[0].s_a):
        return False  # output.points leave that end out
    place = result.position[-1, k]
    if "seabed_height" in result:
        from hybrid.view.projections import bed_heights

        return float(place[2] - bed_heights(result, place[:1], place[1:2])[0]) <= ANCHORED
    return float(place @ normal) - offset <= ANCHORED


def ends_rows(facts: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Forces at the ends of a line at rest, what lies on the seabed, its zones and its lowest point."""
    for end, force in facts["force"].items():
        yield f"force at {end}", f"{vector_text(force)} N on the cable"
    if facts.get("grounded_length"):
        a, b = facts["touchdown"]
        yield "on the seabed", f"{facts['grounded_length']:.5g} m between s = {a:.5g} and {b:.5g} m"
        yield "contact force", f"{facts['contact_force']:.5g} N"
    elif "grounded_length" in facts:
        yield "on the seabed", "nothing"
    for end, lift in facts.get("uplift", {}).items():
        yield f"uplift at {end}", f"{lift['force']:.5g} N, {lift['angle']:.3g} deg from the seabed"
    if len(facts["zones"]) > 1:
        yield "zones", "\n".join(f"{z['kind']} {z['s_a']:.5g} to {z['s_b']:.5g} m" for z in facts["zones"])
    yield "lowest point", f"{vector_text(facts['lowest']['position'])} m at s = {facts['lowest']['s']:.5g} m"


def vector_text(x: list[float], least: float = 0.0) -> str:
    """Numbers of a vector, with 0 for round-off, and for what is below `least`."""
    zero = max(1e-9 * max(abs(c) for c in x), least)
    return "[" + ", ".join(f"{c if abs(c) > zero else 0.0:.5g}" for c in x) + "]"


def zones_over_time(result: Result) -> dict[str, Any]:
    """What zones that move have done: shares of the line that were rod, and changes."""
    rods = [sum(z.s_b - z.s_a for z in zones if z.kind == "rod") for zones in result.zones]
    shares = [rod / (zones[-1].s_b - zones[0].s_a) for rod, zones in zip(rods, result.zones, strict=True)]
    events = result.events
    changes = sum(e.kind in ZONE_EVENTS for e in events)
    changes += sum(int(e.value or 0) for e in events if e.kind == OMITTED and e.criterion in ZONE_EVENTS)
    rod = {"least": min(shares), "mean": sum(shares) / len(shares), "most": max(shares)}
    return {"rod": rod, "zone_changes": changes}


def errors_facts(result: Result) -> dict[str, Any]:
    """The estimated errors: largest of position (m) and of the end forces (N), by kind; whether they are met."""
    from hybrid.store.verdicts import MET, MISSED, accuracy_text, asked_accuracy, worst_accuracy

    found: dict[str, Any] = {k[6:]: float(x) for k, x in result.attributes.items() if k.startswith("error_")}
    if found and (each := asked_accuracy(result)):
        found["met"] = {MET: True, MISSED: False}.get(worst_accuracy(each).verdict)
        found["verdict"] = accuracy_text(each)
    unknown = not_converged_in(result.attributes)
    return found | ({"not_converged": sorted(unknown)} if found and unknown else {})


def verdicts_of(line: Result) -> dict[str, Any]:
    """What was asked of a line of several, and whether it is met, by quantity; empty if nothing was."""
    from hybrid.store.verdicts import MET, MISSED, asked_accuracy

    met = {MET: True, MISSED: False}
    found = [x._asdict() | {"met": met.get(x.verdict), "text": x.text} for x in asked_accuracy(line)]
    return {"accuracy": found} if found else {}


def verdict_text(found: Mapping[str, Any]) -> str:
    """The same of one quantity, for people."""
    name = str(found["quantity"]).replace("end_force_", "force at the ").replace("_", " ")
    if found["error"] is None:
        return f"{name}: asked, {found['text']}"
    unit = found["unit"]
    return f"{name}: error {_short(found['error'])} {unit}, asked {_short(found['asked'])} {unit}: {found['text']}"


def errors_table(errors: dict[str, Any], result: Result) -> Any:
    """The same for people: by cause, beside what was asked."""
    from hybrid.view.summary import length_of

    forces = [result[name] for name in ("reaction_start", "reaction_end") if name in result]
    most = max((float((x**2).sum(axis=1).max()) ** 0.5 for x in forces), default=0.0)
    kinds = [kind for kind in ("mesh", "time", "model", "total") if f"{kind}_position" in errors]
    extremes = "extremes_total_position" in errors
    of, unknown = "extremes_" if extremes else "", not_converged_in(result.attributes)
    not_known = [*[""] * (len(kinds) - 1), "not known", "not converged"]
    rows: list[tuple[str, ...]] = [("error by", *({"time": "step"}.get(kind, kind) for kind in kinds), "")]
    for what, unit, whole in (("position", "m", length_of(result)), ("end_force", "N", most)):
        if what in unknown:
            rows.append(("position" if what == "position" else "end force", *not_known))
            continue
        total = errors[f"{of}total_{what}"]
        share = (
            f"{100 * total / whole:.2g} % of {'the length' if what == 'position' else f'{_short(whole)} N'}"
            if whole
            else ""
        )
        sizes = (f"{_short(errors[f'{of}{kind}_{what}'], total)} {unit}" for kind in kinds)
        name = "position" if what == "position" else "end force"
        rows.append((f"{name}, extremes" if extremes else name, *sizes, share))
        if extremes:
            now = errors[f"total_{what}"]
            rows.append((f"{name}, at an instant", *[""] * (len(kinds) - 1), f"{_short(now)} {unit}", ""))
    if "errors/model/bending_moment" in result or "errors/total/bending_moment" in result:
        names = [f"errors/{kind}/bending_moment" for kind in kinds]
        found = {name: float(result[name].max()) for name in names if name in result}
        most = max(found.values())
        sizes = (f"{_short(found[name], most)} N m" if name in found else "" for name in names)
        name = "moment, at an instant" if extremes else "moment"
        rows.append((name, *(not_known if "bending_moment" in unknown else [*sizes, _largest_moment(result)])))
    asked = result.attributes.get("accuracy_asked")
    return Grid(rows, f"asked {asked}: {errors['verdict']}" if asked else "")


def _largest_moment(result: Result) -> str:
    """The bending moment that its error is to be compared with, or why there is none."""
    if "bending_moment" in result:
        return f"of {_short(float(result['bending_moment'].max()))} N m"
    if any(zone.kind == "rod" for zones in result.zones for zone in zones):
        return "the moment is not among the outputs"
    return "a catenary has no moment; `model: rod` computes it"


def _short(x: float, beside: float = 0.0) -> str:
    """Two digits, without an exponent where that is as short; round-off beside another number is nothing."""
    x = 0.0 if abs(x) < 1e-9 * beside else x
    return f"{float(f'{x:.2g}'):.6g}" if 1e-4 <= abs(x) < 1e6 or x == 0.0 else f"{x:.1e}"


def zones_line(facts: dict[str, Any], file: Path, name: str = "") -> str:
    """The same in words; name: of the line, if it has one."""
    rod, changes, of = facts["rod"], facts["zone_changes"], f"line {name}, " * bool(name)
    if not changes:
        return f"{of}rod: {rod['mean']:.0%} of the line, all the time"
    times = f"{changes} change{'s' * (changes > 1)} of zones"
    part = f"{of}rod: {rod['least']:.0%} to {rod['most']:.0%} of the line, {rod['mean']:.0%} on average"
    return f"{part}; {times}: hybrid plot --zones {file}{f' --line {name}' * bool(name)}"


def judged(table: TradeTable, row: Row) -> dict[str, Any]:
    """Score of a row, and whether it is on the Pareto front or recommended."""
    score = table.score(row) if row.is_choice else None
    return {"score": score, "pareto": row in table.front(), "recommended": row == table.recommended}


def trade_table(table: TradeTable) -> Any:
    """The rows as a terminal has room for them."""
    from hybrid.studies.tradeoff import percent

    out = table_of(("run", "position", "end force", "cells", "steps", "CPU", ""), [], ("run", ""), ("",))
    front, best = table.front(), table.recommended
    for row in table.rows:
        remark = "recommended" if row == best else "Pareto front" if row in front else ""
        remark = ", ".join(x for x in (remark, "" if row.status == "done" else row.status, row.cause) if x)
        style = "bold green" if row == best else "" if row in front else "yellow" if not row.is_choice else "dim"
        figures = [percent(row.position_part), percent(row.end_force_part), str(row.cells or ""), str(row.steps or "")]
        out.add_row(row.name, *figures, f"{row.cpu:.3g} s" if row.cpu else "", remark, style=style)
    return out


def level_table(table: LevelTable) -> Any:
    """What each level costs with every model."""
    from hybrid.studies.tradeoff import percent, status_of

    heads = ("level, model", "position", "end force", "moment", "curvature", "cells", "CPU", "")
    out = table_of(heads, [], (heads[0], ""), ("",))
    for row in table.rows:
        best = row == table.cheapest(row.level)
        figures = [percent(x) for x in (row.position, row.end_force, row.moment, row.curvature)]
        cpu = f"{row.cpu:.3g} s" if row.cpu else ""
        remark = "cheapest" if best else status_of(row)
        style = "bold green" if best else "" if row.meets else "yellow"
        out.add_row(f"{row.level} {row.model}", *figures, str(row.cells or ""), cpu, remark, style=style)
    return out


def import_notes(made: ImportedDeck) -> list[str]:
    """What could not be carried over from a deck: of the deck, then of each scene what the others do not share."""
    parts = [note.text_in(made.file) for note in made.notes if note.kind != "not needed"]
    shared = set.intersection(*(set(scene.notes) for scene in made.scenes.values()))
    parts += [note.text_in(made.file) for note in next(iter(made.scenes.values())).notes if note in shared]
    for name, scene in made.scenes.items():
        parts += [f"{name}: {note.text_in(made.file)}" for note in scene.notes if note not in shared]
    settings = [f"    {note.line}: {note.text}" for note in made.notes if note.kind == "not needed"]
    if settings:
        parts += ["not needed, MoorDyn's own settings and outputs (reasons with --json):", *settings]
    return parts


# --- what run and static print -----------------------------------------------------------------

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
    rows = [("found by", search["path"].replace("; ", "\n"))] if search is not None else []
    if search is not None and search["residual"] is not None:
        rows.append(("residual force", f"{search['residual']:.2g} N at most"))
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
    points: Facts, bodies: Facts, held: list[Facts], end: float | None, meetings: list[tuple[float, str]]
) -> Iterator[tuple[str, str]]:
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
    if heading and offsets is None:
        raise SceneError([Complaint("--heading", f"{heading:g}", "a point or body to shift", "--offsets point:NAME")])
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
    console: Console, asked: Any, stiffness: str | None, offsets: str | None, reach: float | None, heading: float
) -> None:
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
        facts = {x: getattr(curve, x).tolist() for x in ("distance", "force", "restoring")}
        facts |= {"moment": None if curve.moment is None else curve.moment.tolist()}
        tension = {k: v.tolist() for k, v in curve.tension.items()}
        console.json("offsets", at=curve.at, heading=curve.heading, **facts, tension=tension)
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
