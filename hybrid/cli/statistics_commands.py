"""The commands response, modes and stats: the linear answer to a sea, natural periods, statistics of a result."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf, isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

import hybrid
from hybrid.cli.app import (
    Json,
    LineName,
    Quiet,
    SceneFile,
    Settings,
    UsageError,
    app,
    argument,
    flag,
    load,
    numbers,
    opened_line,
    option,
    session,
    window,
    words,
)
from hybrid.cli.console import Console, table_of
from hybrid.errors import ResultError
from hybrid.linear.response_results import ADDED, OF_LARGEST, LineResponse, Response
from hybrid.statistics.fatigue import life_in_years

if TYPE_CHECKING:
    from hybrid.modal.api import Modes
    from hybrid.store.reader import Result

MOTIONS = ("x", "y", "z", "roll", "pitch", "yaw")
LEAST = 1e-6  # of the largest: smaller motions are those of round-off


@app.command()
def response(
    scene: SceneFile,
    settings: Settings = None,
    hours: Annotated[float, option("H", "Largest values of so many hours.")] = 3.0,
    smooth: Annotated[bool, flag("--smooth", help="Without friction of the bed, which else holds the line.")] = False,
    check: Annotated[float | None, option("S", "Compare with a run in time of so many s.")] = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Standard deviations and largest values in the waves of a scene, by frequency, without a run in time."""
    if not 0.0 < hours < np.inf:
        raise UsageError(f"--hours: {hours:g} is no time; give a number above 0, such as 3")
    with session(as_json, quiet) as console:
        found = hybrid.response(load(console, scene, settings), friction=not smooth, check=check)
        rows = _rows(found, hours)
        console.show(lambda: _response_table(found, rows, hours))
        for text in _unresolved(found):
            console.note(text)
        for name, (here, there) in found.checks.items():
            console.note(f"{name}: standard deviation {here:.4g}, in a run of {check:g} s {there:.4g}")
        for note in found.notes:
            console.note(f"note: {note}")
        console.json(
            "response", valid=found.valid, notes=list(found.notes), hours=hours, rows=rows, checks=dict(found.checks)
        )


def _unresolved(found: Response) -> Iterator[str]:
    """Along which part of each line curvature is not known, as it varies too little or too much is left out of it."""
    for name, line in found.lines.items():
        known, deviation = line.resolved("curvature"), line.deviation("curvature")
        if not known.all() and deviation.any():
            of = f"line {name}: " if len(found.lines) > 1 else ""
            most, part = OF_LARGEST * deviation.max(), 100.0 * ADDED["curvature"]
            where = "" if known[deviation.argmax()] else "; where it varies most is such a place"
            yield (
                f"{of}curvature is not known where its standard deviation is below a fifth of the largest, "
                f"{most:.3g} 1/m, or where more than {part:.2g} % of it are left out, "
                f"{100.0 * (1.0 - known.mean()):.0f} % of the line: it may vary several times as much{where}"
            )


def _rows(found: Response, hours: float) -> list[dict[str, Any]]:
    """One for each quantity at the place where it varies most."""
    rows = []
    for name, line in found.lines.items():
        of = f"{name} " if len(found.lines) > 1 else ""
        rows.append(_row(found, line, f"{of}tension", "tension", line.middle, line.mean_tension, "N", hours))
        if (line.mean_curvature > 0.0).any():
            rows.append(_row(found, line, f"{of}curvature", "curvature", line.s, line.mean_curvature, "1/m", hours))
        most = line.deviation("position").max()
        for k, axis in enumerate("xyz"):
            deviation = line.deviation("position")[:, k]
            at = int(deviation.argmax())
            if deviation[at] < LEAST * most:
                continue
            mean = line.mean_position[at, k]
            row = {"quantity": f"{of}{axis}", "unit": "m", "s": line.s[at], "mean": mean, "deviation": deviation[at]}
            row["period"] = line.period("position")[at, k]
            row["largest"] = mean + line.most_probable("position", hours)[at, k]
            each = {key: x if isinstance(x, str) else float(x) for key, x in row.items()}
            rows.append(each | {"valid": found.valid_for("position")})
    for kind, parts, axes in (("point", found.points, "xyz"), ("body", found.bodies, MOTIONS)):
        for name, x in parts.items():
            for k, axis in enumerate(axes):
                unit = "deg" if k > 2 else "m"
                size = float(np.sqrt(0.5 * (np.abs(x[:, k]) ** 2).sum())) * (180.0 / np.pi if k > 2 else 1.0)
                held = {"quantity": f"{kind} {name} {axis}", "unit": unit, "deviation": size}
                rows.append(held | {"valid": found.valid_for("position")})
    return rows


def _row(
    found: Response, line: LineResponse, label: str, name: str, s: Any, mean: Any, unit: str, hours: float
) -> dict[str, Any]:
    deviation = line.deviation(name)
    at = int(deviation.argmax())
    known = name not in ADDED or bool(line.resolved(name)[at])
    row: dict[str, Any] = {"quantity": label, "unit": unit, "s": float(s[at]), "mean": float(mean[at])}
    row |= {"deviation": float(deviation[at]), "valid": found.valid_for(name) and known}
    largest = float(mean[at] + line.most_probable(name, hours)[at])
    return row | {"period": float(line.period(name)[at]), "largest": largest}


def _response_table(found: Response, rows: list[dict[str, Any]], hours: float) -> Any:
    title = f"{found.title or 'response'}, where each varies most"
    heads = ("quantity", "s (m)", "mean", "standard\ndeviation", "mean\nperiod (s)", f"MPM\nin {hours:g} h", "unit")
    texts = []
    for row in rows:
        cells = [f"{row[key]:.4g}" if key in row else "" for key in ("s", "mean", "deviation", "period", "largest")]
        texts.append([row["quantity"] + ("" if row["valid"] else ", not valid"), *cells, row["unit"]])
    how = {"title": title, "padding": (0, 1), "min_width": min(len(title), 80)}
    return table_of(heads, texts, ("quantity", "unit"), ("quantity",), **how)


# The command modes: natural periods of a scene about its equilibrium.

SHOWN = 3  # parts of the energy of a mode
LEAST_SHARE = 0.05  # of the energy, the least part that is shown


@app.command()
def modes(
    scene: SceneFile,
    settings: Settings = None,
    count: Annotated[int, option("N", "How many, the longest periods first.", "--count")] = 10,
    near: Annotated[float | None, option("S", "Those nearest to this period (s) instead.")] = None,
    smooth: Annotated[bool, flag("--smooth", help="Without friction of the bed, which else holds the line.")] = False,
    plot: Annotated[Path | None, option("FILE", "Draw the shapes: PNG, PDF, SVG; HTML, where they swing.")] = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Natural periods and shapes of a cable, or of lines with their points and bodies, about the equilibrium."""
    with session(as_json, quiet) as console:
        from hybrid.view.figure import PAGES, PICTURES, check_target

        asked = load(console, scene, settings)
        picture = check_target(plot, (*PICTURES, *PAGES)) if plot is not None else None
        found = hybrid.modes(asked, count, near, friction=not smooth)
        if picture is not None and picture.suffix.lower() in PAGES:
            from hybrid.view.report_parts import write_modes

            write_modes(found, picture)
        elif picture is not None:
            from hybrid.view.report_parts import plot_modes

            plot_modes(found, picture)
        console.show(lambda: _modes_table(found))
        for note in found.notes:
            console.note(f"note: {note}")
        modes = []
        for x in found.modes:
            numbers = {"period": x.period, "error": x.error, "frequency": x.frequency, "what": x.what}
            modes.append(numbers | {"energy": dict(x.energy), "mass": x.mass.tolist()})
        whole = {"cells": found.cells, "mass": found.mass.tolist(), "notes": list(found.notes)}
        console.json("modes", **whole, picture=picture and str(picture), modes=modes)


def _modes_table(found: Modes) -> Any:
    title, rows = f"{found.title or 'modes'}: {len(found.modes)} modes on {found.cells} cells", []
    for k, x in enumerate(found.modes, start=1):
        parts = [f"{word} {100.0 * part:.0f} %" for word, part in x.energy.items() if part >= LEAST_SHARE][:SHOWN]
        masses = [100.0 * m / a if a > 0.0 else 0.0 for m, a in zip(x.mass, found.mass, strict=True)]
        error = "not known" if x.error is None else f"{x.error:.2g}"
        rows.append([str(k), f"{x.period:.5g}", error, ", ".join(parts), "  ".join(f"{m:4.1f}" for m in masses)])
    moves, how = "moves, by kinetic energy", {"title": title, "padding": (0, 1), "min_width": min(len(title), 80)}
    return table_of(("", "period (s)", "error (s)", moves, "mass x, y, z (%)"), rows, (moves,), (moves,), **how)


HOUR = 3600.0  # s

# Options of fatigue and of mooring lines, which only `stats` has.
Strength = Annotated[float | None, option("N", ".. of tension over this strength (N), or ..")]
Section = Annotated[Any, option("A,D,E", ".. of stress: area (m2), diameter (m), modulus (Pa).", parser=numbers)]
Mooring = Annotated[float | None, option("N", "Utilisation by DNV-OS-E301 of this strength (N), with ..")]
LoadFactors = Annotated[Any, option("A,B", ".. load factors of pretension and environment, and ..", parser=numbers)]
Pretension = Annotated[str | None, option("N|REST.h5", ".. a pretension (N), or the equilibrium that has it.")]


@app.command()
def stats(
    result: Annotated[Path, argument("RUN.h5", "The result to look at.")],
    names: Annotated[Any, option("NAME,..", "These quantities; else forces, tension, bending.", parser=words)] = None,
    at: Annotated[Any, option("S,S,..", "At these arc lengths (m); else where it is largest.", parser=numbers)] = None,
    times: Annotated[Any, option("A:B", "Only from A to B (s).", parser=window)] = None,
    hours: Annotated[float, option("H", "Extremes of so many hours.")] = 3.0,
    above: Annotated[
        float | None, option("X", "Also the part of the time above X, in the unit of the quantity.")
    ] = None,
    below: Annotated[
        float | None, option("X", "Also the part of the time below X, in the unit of the quantity.")
    ] = None,
    curve: Annotated[str | None, option("NAME", "Fatigue damage by this curve ..")] = None,
    strength: Strength = None,
    section: Section = None,
    mooring: Mooring = None,
    factors: LoadFactors = None,
    pretension: Pretension = None,
    line: LineName = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Statistics of a result, where each quantity is largest or at the places of --at.

    Mean, standard deviation, extremes, period, most probable maximum (MPM) and P90 in 3 h, fatigue damage and life.
    """
    if not 0.0 < hours < inf:
        raise UsageError(f"--hours: {hours:g} is no time; give a number above 0, such as 3")
    _refuse_alone(curve, strength, section, (mooring, factors, pretension))
    with session(as_json, quiet) as console, opened_line(result, line) as (opened, result):
        from hybrid.store.tables import rows_of

        opened = _asked_line(opened, result, names)
        if len(opened.times) == 1 and opened.status == "complete" and (above, below, curve, mooring) == (None,) * 4:
            _show_values(console, opened, names, at)
            console.json("done", file=str(result), status=opened.status)
            return
        facts = {} if curve is None else _fatigue(opened, curve, strength, section, times, at)
        _refuse_several(names, above, below)
        rows = rows_of(opened, names, at, times, hours * HOUR, above, below)
        more = _show_rows(console, opened, rows, hours)
        if lines := [*_parts_of_time(rows, above, below), *_limit_lines(opened)]:
            console.show(lambda: "\n".join(lines))
        if curve is not None:
            console.show(lambda: _fatigue_lines(curve, facts))
        if mooring is not None:
            moored = _moored(opened, mooring, tuple(factors), str(pretension), line)
            console.show(lambda: moored["text"])
            more["mooring"] = moored
        used = {} if opened.lines else {name: found._asdict() for name, found in opened.utilisation().items()}
        console.json("done", file=str(result), status=opened.status, fatigue=facts, utilisation=used, **more)


def _asked_line(opened: Result, result: Path, names: Any) -> Result:
    """The only line of a result, where quantities are of lines; ResultError: it has several."""
    from hybrid.store.histories import component_of, usual_names

    if not opened.lines or (names is not None and all(component_of(opened, name)[0] in opened for name in names)):
        return opened
    first, *others = opened.lines
    if others:
        own = ",".join(usual_names(opened))
        fix = f"--line {first}" + (f", or --names {own}" if own else "")
        raise ResultError(f"{result} holds the lines {', '.join(opened.lines)}\n    try:      {fix}")
    return opened.lines[first]


def _show_values(console: Console, opened: Result, names: Any, at: Any) -> None:
    """Values of an equilibrium."""
    from hybrid.store.tables import values_of

    values = values_of(opened, names, at)
    for row in values:
        console.json("statistics", **row)
    texts = (["" if x is None else f"{x:.5g}" for x in (row["s"], row["value"])] for row in values)
    names = [f"{row['quantity']} ({row['unit']})" for row in values]
    console.show(lambda: table_of(("", "s (m)", "value"), [[x, *text] for x, text in zip(names, texts, strict=True)]))
    console.note("note: of an equilibrium, which has values and no statistics")


def _refuse_several(names: Any, above: float | None, below: float | None) -> None:
    """ResultError: parts of the time above or below a value, of several quantities."""
    for key, value in (("--above", above), ("--below", below)):
        if value is not None and (names is None or len(names) > 1):
            fix = f"hybrid stats RUN.h5 --names end_force_end {key} 5e4"
            raise ResultError(f"{key} is of one quantity\n    try:      {fix}")


def _show_rows(console: Console, opened: Result, rows: list[dict[str, Any]], hours: float) -> dict[str, Any]:
    """Statistics, and notes of what limits them; returned: which part of the run is stored, if it is not whole."""
    from hybrid.store.envelope import stored_window

    for row in rows:
        console.json("statistics", **row)
    console.show(lambda: _statistics_table(rows, hours))
    stored = {} if opened.status == "complete" else {"stored": stored_window(opened)}
    if stored:
        text = f"{opened.status_text}; stored is {stored['stored']}"
        console.note(f"note: of a run that has not come to its end; {text}")
    elif opened.pending:
        console.note(f"note: {opened.pending}")
    without: dict[str, dict[str, None]] = {}
    for row in rows:
        if "no_extreme" in row:
            without.setdefault(row["no_extreme"], {})[row["quantity"]] = None
    for text, of in without.items():
        console.note(f"note: no MPM in {hours:g} h of {', '.join(of)}: {text}")
    if any(row["extreme"] for row in rows):
        console.note(f"note: MPM: most probable maximum of {hours:g} h; P90: what it does not exceed with 90 %")
    for text in [row["beyond_outputs"] for row in rows if "beyond_outputs" in row]:
        console.note(f"note: {text}")
    return stored


def _refuse_alone(curve: str | None, strength: float | None, section: Any, moored: tuple[Any, Any, Any]) -> None:
    """UsageError: options without those that belong to them; moored: --mooring, --factors, --pretension."""
    if curve is None and (strength is not None or section is not None):
        name = "--strength" if strength is not None else "--section"
        raise UsageError(f"{name}: of fatigue damage, which needs a curve; add --curve NAME, such as --curve 'D sea'")
    given = [x is not None for x in moored]
    if any(given) and not all(given):
        raise UsageError("--mooring, --factors and --pretension go together; there is no usual factor")


def _fatigue(result: Result, curve: str, strength: float | None, section: Any, times: Any, at: Any) -> dict[str, Any]:
    """Damage and life where the damage is largest, with what errors leave of it, and at the places that are asked."""
    from hybrid.store.tables import life_within

    s, damage = result.damage(curve, strength=strength, section=section, times=times, at=at)
    facts = _fatigue_facts(result, s, damage, times, section is not None)
    if facts["life"] is not None:
        facts |= life_within(result, facts, curve, strength, section, times)
    facts["places"] = [] if at is None else _fatigue_at(s, damage, facts)
    return facts


def _moored(
    result: Result, strength: float, factors: tuple[float, ...], pretension: str, line: str | None
) -> dict[str, Any]:
    """Where a mooring line is used most by DNV-OS-E301, in numbers and in words; pretension: N, or a file."""
    from hybrid.store.verdicts import doubt_of

    try:
        number = float(pretension)
    except ValueError:
        with opened_line(Path(pretension), line) as (rest, _):
            s, _, most = result.mooring(strength, factors, rest)
    else:
        s, _, most = result.mooring(strength, factors, number)
    k, doubt = int(most.argmax()), doubt_of(result, "tension")
    text = (
        f"mooring line by DNV-OS-E301 (2021), factors {', '.join(f'{x:g}' for x in factors)}, strength {strength:g} N: "
        f"{100.0 * most[k]:.4g} % used at s = {s[k]:.5g} m, of the largest tension at output points at every step"
    )
    text += "" if doubt is None else f"; {doubt.text}"
    return {"s": float(s[k]), "used": float(most[k]), "text": text, "not_verified": "" if doubt is None else doubt.text}


def _statistics_table(rows: list[dict[str, Any]], hours: float) -> Any:
    def text(x: float | None) -> str:
        return "" if x is None else f"{x:.5g}"

    heads = ["", "s (m)", "mean", "standard\ndeviation", "skewness", "smallest", "largest", "period (s)"]
    heads += [f"MPM\nin {hours:g} h", f"P90\nin {hours:g} h"]
    texts = []
    for row in rows:
        numbers = [row[x] for x in ("s", "mean", "standard_deviation", "minimum", "maximum", "crossing_period")]
        numbers += [row["extreme"] and row["extreme"][x] for x in ("most_probable", "fractile")]
        skewness = "" if row["skewness"] is None else f"{row['skewness']:.2f}"
        cells = [text(x) for x in numbers]
        texts.append([f"{row['quantity']} ({row['unit']})", *cells[:3], skewness, *cells[3:]])
    return table_of(heads, texts)


def _parts_of_time(rows: list[dict[str, Any]], above: float | None, below: float | None) -> list[str]:
    """For which part of the time quantities are above, or below, a value."""
    found = []
    for key, side, value in (("exceedance", "above", above), ("exceedance_below", "below", below)):
        for row in rows if value is not None else ():
            place = "" if row["s"] is None else f" at s = {row['s']:.5g} m"
            part = f"{100.0 * row[key]:.3g} % of the time"
            found.append(f"{row['quantity']}{place} is {side} {value:g} {row['unit']} for {part}")
    return found


def _limit_lines(result: Result) -> list[str]:
    """Which part of the limits of sections is used, and the limits of quantities."""
    from hybrid.store.capacity import clauses_of
    from hybrid.store.envelope import largest_contact
    from hybrid.store.verdicts import quantity_limits

    found, pressed = [], None if result.lines else largest_contact(result)
    if pressed is not None:
        partner, most = pressed
        at = f"s = {most.s:.5g} m, t = {most.t:.5g} s"
        found.append(f"largest contact force: {most.value:.5g} N/m of {partner}, {at}")
    found += [f"contact, {x.partner}: {x.text}, t = {x.t_force:.5g} s, of every output" for x in result.contacts()]
    for x in () if result.lines else result.utilisation().values():
        part = "" if x.used is None else f"{100.0 * x.used:.4g} % of {x.limit} used: "
        if x.limit == "min_bend_radius" and x.used is not None:
            part = f"MBR utilisation of {100.0 * x.used:.4g} %: "
        found.append(f"{part}{x.text}, s = {x.s:.5g} m, t = {x.t:.5g} s, of every step and output{x.ending}")
    found += [f"{x.text}{x.when}{x.ending}" for x in quantity_limits(result)]
    return found + ([f"code_used is by {clauses}"] if (clauses := clauses_of(result)) else [])


def _fatigue_facts(result: Result, s: np.ndarray, damage: np.ndarray, times: Any, bends: bool) -> dict[str, Any]:
    """bends: whether stresses of bending are counted."""
    from hybrid.store.histories import history_of
    from hybrid.store.verdicts import doubt_of

    t = history_of(result, "tension", times).t
    k, duration = int(damage.argmax()), float(t[-1] - t[0])
    life = float(life_in_years([damage[k]], [1.0], duration))
    doubt = doubt_of(result, "tension", *(["curvature"] if bends else []))
    return {
        "s": float(s[k]),
        "damage": float(damage[k]),
        "duration": duration,
        "life": life if isfinite(life) and doubt is None else None,
        "life_not_verified": "" if doubt is None else doubt.text,
    }


def _fatigue_at(s: np.ndarray, damage: np.ndarray, facts: dict[str, Any]) -> list[dict[str, Any]]:
    """Damage and fatigue life at each place that was chosen; one where the line jumps comes twice."""
    years = facts["life"]
    return [
        {"s": float(x), "damage": float(d), "life": years * facts["damage"] / float(d) if years and d > 0.0 else None}
        for x, d in zip(s, damage, strict=True)
    ]


def _fatigue_lines(curve: str, facts: dict[str, Any]) -> str:
    """The largest damage, or that at each place that was chosen, and the life that goes with it."""
    lines = []
    for x in facts["places"] or [facts]:
        life = "unlimited" if x["life"] is None else f"{x['life']:.3g} years"
        if x["life"] is not None and facts.get("life_least") is not None:
            scale = x["life"] / facts["life"]
            most = "unlimited" if facts["life_most"] is None else f"{scale * facts['life_most']:.3g}"
            life += f", {scale * facts['life_least']:.3g} to {most} by the errors of what varies"
        life = facts["life_not_verified"] or life
        place = f"{'' if facts['places'] else 'largest '}damage at s = {x['s']:.5g} m"
        lines.append(f"{place}: {x['damage']:.3g} in {facts['duration']:.6g} s; fatigue life {life}")
    return "\n".join(f"fatigue by {curve}: {line}" for line in lines)
