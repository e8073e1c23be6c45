"""The command study: many runs of one scene with other values."""

from __future__ import annotations

import time as clock
from pathlib import Path
from typing import Annotated, Any

import typer

import hybrid
from hybrid.cli.app import Json, Quiet, UsageError, app, flag, session
from hybrid.cli.console import Console
from hybrid.cli.progress_line import span

# Reasons of failed cases that are printed, those of most cases first.
REASONS_SHOWN = 5


@app.command()
def study(
    source: Annotated[
        Path, typer.Argument(metavar="STUDY.yaml", help="The study file, or its results.", show_default=False)
    ],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FOLDER", help="Results (Zarr); else STUDY.zarr there.")
    ] = None,
    workers: Annotated[int | None, typer.Option(metavar="N", min=1, help="Processes; else one for each core.")] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Of a dask scheduler, such as tcp://host:8786, instead.")
    ] = None,
    batch: Annotated[int | None, typer.Option(metavar="N", min=1, help="Cases in a batch; else by their cost.")] = None,
    netcdf: Annotated[Path | None, typer.Option(metavar="FILE.nc", help="The results as netCDF as well.")] = None,
    case: Annotated[
        int | None, typer.Option(metavar="N", min=0, help="Run one case of STUDY.zarr again, with its whole result.")
    ] = None,
    sensitivity: Annotated[
        str | None, typer.Option(metavar="RESULT", help="What each variable of STUDY.zarr does to a result.")
    ] = None,
    derivatives: Annotated[
        bool, flag("--derivatives", help="With --sensitivity: shares of the spread by derivatives at the mean.")
    ] = False,
    overwrite: Annotated[bool, flag("--overwrite", help="Begin anew where there is a study.")] = False,
    quiet: Quiet = False, as_json: Json = False,
) -> None:  # fmt: skip
    """Compute a scene with other values of its keys, many times; a second call does what is missing."""
    if source.is_dir() and case is None and sensitivity is None:
        raise UsageError(
            f"{source} is a folder; a study file is expected, or --case N, --sensitivity RESULT for what it holds"
        )
    if derivatives and sensitivity is None:
        raise UsageError("--derivatives goes with --sensitivity RESULT")
    with session(as_json, quiet) as console:
        if netcdf is not None:
            from hybrid.store.selection import check_target

            check_target(netcdf, overwrite=True)  # before the work
        if case is not None:
            target = console.will_write(output or Path(f"{source.stem}.case{case}.h5"))
            result = hybrid.study_case(source, case, target)
            console.events(result.events)
            console.done(f"case {case}", target, status=result.status)
            return
        if sensitivity is not None:
            rows = hybrid.sensitivity(source, sensitivity)
            for row in rows:
                console.json("influence", **row._asdict())
            console.show(lambda: _influences(rows))
            if derivatives:
                _show_shares(console, hybrid.shares(source, sensitivity))
            console.json("done", file=str(source))
            return
        console.source = ""
        folder = output or source.with_suffix(".zarr")
        console.left = f"{folder} keeps what is done; the same command goes on"
        begin = clock.perf_counter()
        with console.study_running() as listener:
            found = hybrid.study(
                source, folder, workers=workers, scheduler=scheduler, batch=batch, overwrite=overwrite,
                progress=listener,
            )  # fmt: skip
        _show(console, found, folder, clock.perf_counter() - begin, netcdf)


def _show(console: Console, found: Any, folder: Path, wall: float, netcdf: Path | None) -> None:
    """Ranges of what was kept, reasons of what failed, and where it is."""
    from hybrid.store.study_file import DONE, FAILED, counts_of, unmet_accuracy

    counts = counts_of(found["status"].values)
    done = found.isel(case=found["status"].values == DONE)
    failed = found.isel(case=found["status"].values == FAILED)
    rows = ranges_of(done)
    for row in rows:
        console.json("range", **row)
    if rows:
        console.show(lambda: _table(rows))
    reasons: dict[str, list[int]] = {}
    for number, reason in zip(failed["case"].values.tolist(), failed["reason"].values.tolist(), strict=True):
        reasons.setdefault(_kind(str(reason)), []).append(number)
    for text, numbers in sorted(reasons.items(), key=lambda x: -len(x[1]))[:REASONS_SHOWN]:
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
        from hybrid.store.selection import write_atomically

        write_atomically({netcdf: found.to_netcdf(engine="h5netcdf")}, overwrite=True)
    text = f"{counts['done']} cases done, {counts['failed']} failed, in {span(wall)} of wall time"
    console.done(text, folder, netcdf, **counts, wall=wall)


def ranges_of(done: Any) -> list[dict[str, Any]]:
    """Of each number that was kept: smallest, median and largest value of all cases, and the case of the largest."""
    import numpy as np

    from hybrid.store.study_file import OWN

    rows = []
    for name in done.data_vars:
        values = done[name].values
        if done[name].dims != ("case",) or values.dtype.kind != "f" or name in OWN:
            continue
        if not np.isfinite(values).any():
            blank = {key: None for key in ("smallest", "median", "largest", "case")}
            rows.append({"name": str(name), "unit": done[name].attrs.get("units", "")} | blank)
            continue
        worst = int(np.nanargmax(values))
        rows.append({
            "name": str(name), "unit": done[name].attrs.get("units", ""), "smallest": float(np.nanmin(values)),
            "median": float(np.nanmedian(values)), "largest": float(values[worst]),
            "case": int(done["case"].values[worst]),
        })  # fmt: skip
    return sorted(rows, key=lambda row: row["name"])


HEADS = {
    "sobol": ("first order", "total", "± (95 %)"), "morris": ("mean effect", "standard deviation", "± (95 %)"),
    "rank": ("rank correlation", "", "by chance"),
}  # fmt: skip


def _influences(rows: list[Any]) -> Any:
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("", no_wrap=True)
    for title in HEADS[rows[0].method] if rows else ("nothing varies",):
        table.add_column(title, justify="right", no_wrap=True)
    for row in rows:
        figures = (f"{x:.3g}" if x == x else "" for x in (row.first, row.total, row.interval))
        table.add_row(row.variable, *figures)
    return table


def _show_shares(console: Console, found: Any) -> None:
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("", no_wrap=True)
    for title in ("derivative", "share", "first order from", "to"):
        table.add_column(title, justify="right", no_wrap=True)
    for row in found.rows:
        parts = (f"{x:.3f}" if x == x else "" for x in (row.share, row.low, row.high))
        table.add_row(row.variable, f"{row.derivative:.4g}", *parts)
    console.json("shares", **found._asdict() | {"rows": [x._asdict() for x in found.rows]})
    console.show(lambda: table)
    if found.why:
        console.note(f"note: no shares by derivatives: {found.why}")
    else:
        console.note(f"note: of {found.of} at the mean; R² {found.r2:.4f} over {found.cases} cases")


def _kind(reason: str) -> str:
    """A reason without its place and time, so that those of one kind are counted together."""
    return reason.split(" (t = ")[0]


def _table(rows: list[dict[str, Any]]) -> Any:
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="bold")
    table.add_column("", no_wrap=True)
    for title in ("smallest", "median", "largest", "in case"):
        table.add_column(title, justify="right", no_wrap=True)
    for row in rows:
        name = f"{row['name']} ({row['unit']})" if row["unit"] else row["name"]
        figures = ("" if row[key] is None else f"{row[key]:.5g}" for key in ("smallest", "median", "largest"))
        table.add_row(name, *figures, "" if row["case"] is None else str(row["case"]))
    return table
