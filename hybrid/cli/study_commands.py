"""The commands design and study.

design: numbers of a scene for which its equilibrium is what is asked; study: many runs of one scene with other values.
"""

from __future__ import annotations

import dataclasses
import math
import time as clock
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import hybrid
from hybrid.cli.app import (
    Json,
    Quiet,
    SceneFile,
    Settings,
    UsageError,
    app,
    argument,
    flag,
    load,
    option,
    output_option,
    plot_option,
    session,
    words,
)
from hybrid.cli.console import Console, span, table_of

if TYPE_CHECKING:
    from hybrid.designs.design import Found, Identified, Kept
    from hybrid.designs.sensitivity import Derivative
    from hybrid.scene.root import Scene

WORDS = {0: "=", 1: "<=", -1: ">="}


@app.command()
def design(
    source: Annotated[Path, argument("DESIGN.yaml", "The design file.")],
    output: Annotated[Path | None, output_option("Write the scene with the numbers found.")] = None,
    plot: Annotated[Path | None, plot_option("before and after")] = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Find numbers of a scene for which its equilibrium is what is asked: within limits, least of something."""
    with session(as_json, quiet) as console:
        from hybrid.designs.design import Identified
        from hybrid.view.figure import PICTURES, check_target

        console.source = ""
        picture = check_target(plot, PICTURES) if plot is not None else None
        if output is not None and output.exists():
            raise hybrid.ResultError(f"{output} exists\n    try:      another name")
        found = hybrid.design(source)
        if output is not None:
            output.write_text(found.scene_text(output.parent), encoding="utf-8")
        if picture is not None:
            from hybrid.view.several_runs import plot_design

            plot_design(found, picture)
        console.show(lambda: _identified(found) if isinstance(found, Identified) else _tables(found))
        for note in found.notes:
            console.note(f"note: {note}")
        files = {"scene": output and str(output), "picture": picture and str(picture)}
        console.json("design", **_as_data(found), **files)


def _as_data(found: Found) -> dict[str, Any]:
    own = {f.name for f in dataclasses.fields(found)} & {"estimates", "apart", "count", "scatter", "stated"}
    more: dict[str, Any] = {name: getattr(found, name) for name in sorted(own)}
    for name in {"estimates", "apart"} & own:
        more[name] = [x._asdict() for x in more[name]]
    if own:
        more["correlations"] = found.correlations.tolist()  # type: ignore[attr-defined]
    whole = ("title", "minimised", "minimised_at_start", "equilibria", "runs", "settled")
    more |= {name: getattr(found, name) for name in whole}
    more |= {name: [dataclasses.asdict(x) for x in getattr(found, name)] for name in ("kept", "bounds")}
    more |= {name: dict(getattr(found, name)) for name in ("numbers", "start", "ways")}
    return more | {"notes": list(found.notes)}


def _tables(found: Found) -> Any:
    from rich.console import Group

    took = [f"{found.equilibria} equilibria"] if found.equilibria else []
    took += [f"{found.runs} runs ({found.runs / found.moving:.3g} of each case)"] if found.moving else []
    head = f"{found.title or 'found'}: {', '.join(took)}"
    heads = ("", "found", "start", "")
    numbers = table_of(heads, [], free=heads, title=head, min_width=min(len(head), 80))
    at = {x.name: x for x in found.bounds}
    for name, x in found.numbers.items():
        bound = at.get(name)
        word = "" if bound is None else f"at its bound ({bound.which})"
        if bound is not None and bound.price:
            word += f", price {bound.price:.3g}"
        numbers.add_row(name, f"{x:.6g}", f"{found.start[name]:.6g}", word)
    if found.minimised is not None:
        word = "" if found.settled else "no optimum: see the note"
        numbers.add_row("minimised", f"{found.minimised:.6g}", f"{found.minimised_at_start:.6g}", word)
    if not found.kept:
        return Group(numbers, *_ways(found))
    words = ("", "result")
    kept = table_of((*words, "value", "asked", "2 x cells", "price"), [], words, words, title=None)
    for row in shown(found.kept):
        name = f"{row.name} ({row.case})" if row.case else row.name
        price = f"{row.price:.3g}" if row.active and found.minimised is not None else "active" * row.active
        finer = "" if row.finer is None else f"{row.finer:.6g}"
        kept.add_row(name, row.result, f"{row.value:.6g}", f"{WORDS[row.side]} {row.bound:.6g}", finer, price)
    return Group(numbers, "", kept, *_ways(found))


def _ways(found: Found) -> list[str]:
    """How slopes of motions were found: of all cases, or of which."""
    out = []
    for way in dict.fromkeys(found.ways.values()):
        cases = [case for case, x in found.ways.items() if x == way]
        which = f" ({', '.join(cases)})" if len(cases) < len(found.ways) else ""
        out.append(f"slopes{which} by {way}")
    return out


def _identified(found: Identified) -> Any:
    from rich.console import Group

    left = f"{found.scatter:.3g}" + (" of the stated deviation" if found.stated else "")
    head = f"{found.title or 'found'}: {found.count} numbers"
    head += f", {found.equilibria} equilibria" if found.equilibria else ""
    head += f", {found.runs} runs" if found.runs else ""
    head += f"; left over {left} (r.m.s.)"
    heads = ("", "found", "deviation", "95 % from", "to", "by cells", "start")
    table = table_of(heads, [], free=heads, title=head, min_width=min(len(head), 80))
    for x in found.estimates:
        spread = [f"{x.deviation:.3g}", f"{x.low:.6g}", f"{x.high:.6g}"]
        spread = spread if x.deviation < float("inf") else ["not known", "", ""]
        by_cells = f"{x.by_cells:.2g}" if x.by_cells == x.by_cells else ""
        table.add_row(x.name, f"{x.value:.6g}", *spread, by_cells, f"{found.start[x.name]:.6g}")
    parts: list[Any] = [table, *(f"  not told apart: {x.text}" for x in found.apart)]
    if len(found.estimates) > 1 and (found.correlations == found.correlations).sum() > len(found.estimates):
        each = zip(found.numbers, found.correlations.tolist(), strict=True)
        related = [[name, *(f"{y:.3f}" if y == y else "" for y in row)] for name, row in each]
        named = ("", *found.numbers)
        parts += ["", table_of(named, related, free=named, title="correlations")]
    return Group(*parts, *_ways(found))


def shown(kept: tuple[Kept, ...]) -> list[Kept]:
    """Of each limit and case what is active, else what is nearest to its bound."""
    groups: dict[tuple[str, str, int], list[Kept]] = {}
    for x in kept:
        groups.setdefault((x.name, x.case, x.side), []).append(x)
    out = []
    for group in groups.values():
        active = [x for x in group if x.active]
        out += active or [min(group, key=lambda x: abs(x.value - x.bound))]
    return out


# The command seek: numbers of a scene for which its equilibrium is what is asked.


@app.command()
def seek(
    scene: SceneFile,
    target: Annotated[list[str], option("RESULT=VALUE", "Such as tension@250=25000; more than once.", "--target")],
    by: Annotated[Any, option("KEY,..", "As many numbers to change.", "--by", parser=words)],
    settings: Settings = None,
    output: Annotated[Path | None, output_option("Write the scene with the numbers found.")] = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Find numbers of a scene with which results of its equilibrium are what is asked."""
    targets = {}
    for each in target:
        name, equals, value = each.rpartition("=")
        try:
            targets[name.strip()] = float(value)
        except ValueError:
            equals = ""
        if not equals:
            raise UsageError(f"--target: '{each}' is no RESULT=VALUE such as tension@250=25000")
    with session(as_json, quiet) as console:
        found = hybrid.seek(load(console, scene, settings), targets, by)
        if output is not None:
            if output.exists():
                raise hybrid.ResultError(f"{output} exists\n    try:      another name")
            output.write_text(hybrid.scene_text(found.scene), encoding="utf-8")
        lines, heads = [[key, f"{x:.8g}", ""] for key, x in found.numbers.items()], ("", "value", "asked")
        lines += [[name, f"{x:.8g}", f"{found.targets[name]:.8g}"] for name, x in found.results.items()]
        title = f"found in {found.equilibria} equilibria"
        console.show(lambda: table_of(heads, lines, free=heads, title=title))
        facts: dict[str, Any] = {x: dict(getattr(found, x)) for x in ("numbers", "results", "targets")}
        console.json("sought", **facts, equilibria=found.equilibria, scene=output and str(output))


# The command sensitivity: what results at rest answer to the numbers of a scene.


@app.command()
def sensitivity(
    scene: SceneFile,
    settings: Settings = None,
    of: Annotated[
        list[Any] | None, option("RESULT,..", "Results such as tension@0, max curvature.", "--of", parser=words)
    ] = None,
    by: Annotated[
        list[Any] | None, option("KEY,..", "Numbers; else all of the sections.", "--by", parser=words)
    ] = None,
    motion: Annotated[
        bool, flag("--motion", help="Of a run, in steps that stay: of 'max tension@end', 'std position.z@100'.")
    ] = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Derivatives and elasticities (% by %) of an equilibrium, or a motion, by the numbers of its scene."""
    with session(as_json, quiet) as console:
        asked = load(console, scene, settings)
        results, numbers = (list(chain.from_iterable(x or ())) for x in (of, by))
        found = hybrid.sensitivity(asked, results or _results(asked, motion), numbers or _numbers(asked), motion)
        console.show(lambda: _sensitivity_tables(found))
        for x in found:
            console.json("derivative", **x._asdict())


def _results(scene: Scene, motion: bool) -> list[str]:
    """What engineers ask first."""
    from hybrid.designs.numbers_and_results import of_line

    tensions = [f"{of_line(x)}tension@{end}" for x in scene.asked_lines for end in ("start", "end")]
    if motion:
        return [f"max {name}" for name in tensions]
    bent = [x for x in scene.asked_lines if scene.asked_scene(x).model.kind != "catenary"]
    return [*tensions, *(f"max {of_line(x)}curvature" for x in bent)]


def _numbers(scene: Scene) -> list[str]:
    """All numbers of the sections that are not 0."""
    out = []
    for line, x in scene.asked_lines.items():
        for i, section in enumerate(x.cable.sections):
            for name, value in section.model_dump().items():
                if isinstance(value, float) and value != 0.0 and name != "max_strain":
                    out.append(f"{scene.key_of(line)}.sections[{i}].{name}")
    return out


def _sensitivity_tables(found: list[Derivative]) -> Any:
    """One for each result, what it answers to most first."""
    from rich.console import Group

    tables = []
    for result in dict.fromkeys(x.of for x in found):
        rows = [x for x in found if x.of == result]
        rows.sort(key=lambda x: -abs(x.elasticity) if math.isfinite(x.elasticity) else 0.0)
        title = f"{result}: {rows[0].result:.6g}"
        texts = []
        for x in rows:
            elastic = f"{x.elasticity:.3g}" if math.isfinite(x.elasticity) else ""
            texts.append([x.by, f"{x.number:.5g}", f"{x.derivative:.5g}", f"{x.error:.1g}", elastic])
        heads, by = ("by", "value", "derivative", "error", "% by %"), ("by",)
        tables.append(table_of(heads, texts, by, by, title=title, padding=(0, 1), min_width=len(title)))
    ways = dict.fromkeys(x.way for x in found)
    return Group(*tables, *(f"by {way}" if len(ways) == 1 else f"{_keys(found, way)} by {way}" for way in ways))


def _keys(found: list[Derivative], way: str) -> str:
    """By which numbers derivatives were found in a way; results, where these are what tells ways apart."""
    own = [x for x in found if x.way == way]
    results = dict.fromkeys(x.of for x in own)
    of_results = sum(x.of in results for x in found) == len(own)
    return ", ".join(results if of_results else dict.fromkeys(x.by for x in own))


# Reasons of failed cases that are printed, those of most cases first.
REASONS_SHOWN = 5


@app.command()
def study(
    source: Annotated[Path, argument("STUDY.yaml", "The study file, or its results.")],
    output: Annotated[Path | None, output_option("Results (Zarr); else STUDY.zarr there.", "FOLDER")] = None,
    workers: Annotated[int | None, option("N", "Processes; else one for each core.", min=1)] = None,
    scheduler: Annotated[
        str | None, option("ADDRESS", "Of a dask scheduler, such as tcp://host:8786, instead.")
    ] = None,
    batch: Annotated[int | None, option("N", "Cases in a batch; else by their cost.", min=1)] = None,
    netcdf: Annotated[Path | None, option("FILE.nc", "The results as netCDF as well.")] = None,
    case: Annotated[int | None, option("N", "Run one case of STUDY.zarr again, with its whole result.", min=0)] = None,
    sensitivity: Annotated[str | None, option("RESULT", "What each variable of STUDY.zarr does to a result.")] = None,
    derivatives: Annotated[
        bool, flag("--derivatives", help="With --sensitivity: shares of the spread by derivatives at the mean.")
    ] = False,
    overwrite: Annotated[bool, flag("--overwrite", help="Begin anew where there is a study.")] = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Compute a scene with other values of its keys, many times; a second call does what is missing."""
    if source.is_dir() and case is None and sensitivity is None:
        raise UsageError(
            f"{source} is a folder; a study file is expected, or --case N, --sensitivity RESULT for what it holds"
        )
    if derivatives and sensitivity is None:
        raise UsageError("--derivatives goes with --sensitivity RESULT")
    of_runs = {"--workers": workers, "--scheduler": scheduler, "--batch": batch, "--netcdf": netcdf}
    of_runs |= {"--overwrite": overwrite or None, "--output": output if case is None else None}
    of_runs |= {"--sensitivity": sensitivity if case is not None else None}
    if (case, sensitivity) != (None, None) and (unfit := [k for k, x in of_runs.items() if x is not None]):
        raise UsageError(f"{', '.join(unfit)}: not with {'--case' if case is not None else '--sensitivity'}")
    with session(as_json, quiet) as console:
        if netcdf is not None:
            from hybrid.store.reader import check_target

            check_target(netcdf, overwrite=True)  # before the work
        if case is not None:
            target = console.will_write(output or Path(f"{source.stem}.case{case}.h5"))
            result = hybrid.study_case(source, case, target)
            console.events(result.events)
            console.done(f"case {case}", target, status=result.status)
            return
        if sensitivity is not None:
            _show_sensitivity(console, source, sensitivity, derivatives)
            return
        console.source = ""
        folder = output or source.with_suffix(".zarr")
        console.left = f"{folder} keeps what is done; the same command goes on"
        begin = clock.perf_counter()
        with console.study_running() as listener:
            how: dict[str, Any] = {"workers": workers, "scheduler": scheduler, "batch": batch}
            found = hybrid.study(source, folder, **how, overwrite=overwrite, progress=listener)
        _show(console, found, folder, clock.perf_counter() - begin, netcdf)


def _show_sensitivity(console: Console, source: Path, result: str, derivatives: bool) -> None:
    """What each variable of a study does to a result; derivatives: shares of its spread as well."""
    rows = hybrid.sensitivity(source, result)
    for row in rows:
        console.json("influence", **row._asdict())
    heads = HEADS[rows[0].method] if rows else ("nothing varies",)
    texts = ([f"{x:.3g}" if x == x else "" for x in (row.first, row.total, row.interval)] for row in rows)
    lines = [[row.variable, *text] for row, text in zip(rows, texts, strict=True)]
    console.show(lambda: table_of(("", *heads), lines))
    if derivatives:
        _show_shares(console, hybrid.shares(source, result))
    console.json("done", file=str(source))


def _show(console: Console, found: Any, folder: Path, wall: float, netcdf: Path | None) -> None:
    """Ranges of what was kept, reasons of what failed, and where it is."""
    from hybrid.store.study_file import DONE, FAILED, counts_of, ranges_of, reasons_of, unmet_accuracy

    counts = counts_of(found["status"].values)
    done = found.isel(case=found["status"].values == DONE)
    failed = found.isel(case=found["status"].values == FAILED)
    rows = ranges_of(done)
    for row in rows:
        console.json("range", **row)
    if rows:
        console.show(lambda: _study_table(rows))
    for text, numbers in reasons_of(failed)[:REASONS_SHOWN]:
        console.json("failed", reason=text, cases=numbers)
        console.note(f"note: {len(numbers)} failed, such as case {numbers[0]}: {text}")
    lacking = done.isel(case=done["reason"].values != "")
    if lacking["case"].size:
        text = str(lacking["reason"].values[0])
        console.json("not_kept", reason=text, cases=lacking["case"].values.tolist())
        console.note(
            f"note: {lacking['case'].size} not kept in full, such as case {int(lacking['case'].values[0])}: {text}"
        )
    for unmet in unmet_accuracy(found):
        console.json("accuracy", **unmet._asdict())
        console.note(f"note: {unmet}")
    empty = [row["name"] for row in rows if row["case"] is None]
    if empty:
        console.note(f"note: {', '.join(empty)}: in no case (too few peaks or up-crossings in the record)")
    if netcdf is not None:
        from hybrid.store.reader import write_atomically

        write_atomically({netcdf: found.to_netcdf(engine="h5netcdf")}, overwrite=True)
    text = f"{counts['done']} cases done, {counts['failed']} failed, in {span(wall)} of wall time"
    console.done(text, folder, netcdf, **counts, wall=wall)


HEADS = {
    "sobol": ("first order", "total", "± (95 %)"),
    "morris": ("mean effect", "standard deviation", "± (95 %)"),
    "rank": ("rank correlation", "", "by chance"),
}


def _show_shares(console: Console, found: Any) -> None:
    rows = []
    for row in found.rows:
        parts = (f"{x:.3f}" if x == x else "" for x in (row.share, row.low, row.high))
        rows.append([row.variable, f"{row.derivative:.4g}", *parts])
    console.json("shares", **found._asdict() | {"rows": [x._asdict() for x in found.rows]})
    console.show(lambda: table_of(("", "derivative", "share", "first order from", "to"), rows))
    if found.why:
        console.note(f"note: no shares by derivatives: {found.why}")
    else:
        console.note(f"note: of {found.of} at the mean; R² {found.r2:.4f} over {found.cases} cases")


def _study_table(rows: list[dict[str, Any]]) -> Any:
    texts = []
    for row in rows:
        name = f"{row['name']} ({row['unit']})" if row["unit"] else row["name"]
        figures = ("" if row[key] is None else f"{row[key]:.5g}" for key in ("smallest", "median", "largest"))
        texts.append([name, *figures, "" if row["case"] is None else str(row["case"])])
    return table_of(("", "smallest", "median", "largest", "in case"), texts)
