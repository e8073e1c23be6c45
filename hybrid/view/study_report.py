"""The page of a study: ranges, response curves, exceedance, parallel coordinates, and a table to sort and filter."""

from __future__ import annotations

import json
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from hybrid.store.study_file import DONE, FAILED, OPEN, counts_of, open_study, unmet_accuracy
from hybrid.view.report_parts import footer, packed, page_file, page_of, plotly_script
from hybrid.view.save import PAGES, REPORT_MARK, check_target, write_file

STATUS = {OPEN: "open", DONE: "done", FAILED: "failed"}
# Own columns of a study, behind what was varied and kept.
OWN = ("cpu", "steps", "events", "accuracy_used", "accuracy_verdict", "reason")


def write_study_report(study: str | Path, path: str | Path, *, overwrite: bool = False) -> Path:
    """Write the page of a study (a Zarr folder) as .html and return where it is; ResultError where it cannot be."""
    target = check_target(path, PAGES, overwrite=overwrite)
    return write_file(target, lambda new: new.write_text(html(Path(study)), encoding="utf-8"))


def html(study: Path) -> str:
    """The page as text."""
    found = open_study(study)
    variables = [name for name in json.loads(found.attrs["variables"]) if name in found]
    results = sorted(
        str(name) for name in found.data_vars
        if found[name].dims == ("case",) and name not in (*OWN, "status") and found[name].dtype.kind == "f"
    )  # fmt: skip
    columns = {"case": _column(found, "case")} | {name: _column(found, name) for name in variables}
    columns["status"] = {"unit": "", "description": "", "values": [STATUS[int(k)] for k in found["status"].values]}
    columns |= {name: _column(found, name) for name in (*results, *OWN) if name in found}
    texts = [name for name, each in columns.items() if any(isinstance(x, str) for x in each["values"])]
    again = f"hybrid study {study.name} --case 0 -o case0.h5"
    data = {"columns": columns, "variables": variables, "results": results, "texts": texts, "again": again}
    counts = counts_of(found["status"].values)
    parts = {
        "title": escape(str(found.attrs["title"])),
        "subtitle": escape(_subtitle(found, counts)),
        "failures": _failures(found) + _accuracy(found),
        "ranges": _ranges(found, results),
        "shares": _shares(found),
        "example": escape(_example(found, variables)),
        "again": escape(again),
        "footer": escape(footer()),
        "mark": REPORT_MARK,
        "css": page_file("report.css") + page_file("study.css"),
        "js": page_file("study.js"),
        "data": packed(json.dumps(data, allow_nan=False).encode()),
        "plotly": packed(plotly_script().encode()),
    }
    return page_of("study.html", parts)


def _column(found: Any, name: str) -> dict[str, Any]:
    values = found[name].values
    if values.dtype.kind == "f":
        plain: list[Any] = [x if np.isfinite(x) else None for x in values.tolist()]
    else:
        plain = [x if isinstance(x, int | str) else str(x) for x in values.tolist()]
    attrs = found[name].attrs
    return {"unit": attrs.get("units", ""), "description": attrs.get("long_name", ""), "values": plain}


def _subtitle(found: Any, counts: dict[str, int]) -> str:
    n, spent = found.sizes["case"], float(np.nansum(found["cpu"].values))
    left = f", {counts['left']} not yet computed" if counts["left"] else ""
    made = str(found.attrs["created"])[:16].replace("T", " ")
    return (
        f"{n} cases of {found.attrs['scene_file']}: {counts['done']} done, {counts['failed']} failed{left}; "
        f"{spent:.3g} s of processor time; begun {made} UTC with hybrid-cable {found.attrs['version_hybrid']}"
    )


def _failures(found: Any) -> str:
    """Reasons of failures, and of what could not be kept of cases that are done, those of most cases first."""
    failed, reason = found["status"].values == FAILED, found["reason"].values
    return _reasons(found, failed, "failed") + _reasons(found, ~failed & (reason != ""), "not kept in full")


def _reasons(found: Any, failed: np.ndarray, what: str) -> str:
    if not failed.any():
        return ""
    reasons: dict[str, list[int]] = {}
    for number, reason in zip(found["case"].values[failed].tolist(), found["reason"].values[failed], strict=True):
        reasons.setdefault(str(reason).split(" (t = ")[0], []).append(number)
    rows = "".join(
        f"<li><b>{len(numbers)} case{'s' * (len(numbers) > 1)}</b>, such as {numbers[0]}: {escape(text)}</li>"
        for text, numbers in sorted(reasons.items(), key=lambda item: -len(item[1]))
    )
    return f'<div class="attention" role="alert"><h2>{int(failed.sum())} {what}</h2><ul>{rows}</ul></div>'


def _accuracy(found: Any) -> str:
    """How many cases missed the accuracy asked, or had it not verified, which is worst, and what to do."""
    rows = "".join(f"<li>{escape(str(unmet))}</li>" for unmet in unmet_accuracy(found))
    return f'<div class="attention" role="alert"><h2>Accuracy asked</h2><ul>{rows}</ul></div>' if rows else ""


def _ranges(found: Any, results: list[str]) -> str:
    rows = []
    for name in results:
        values = found[name].values
        if np.isfinite(values).any():
            worst = found["case"].values[int(np.nanargmax(values))]
            figures = (np.nanmin(values), np.nanmedian(values), np.nanmax(values))
            cells = "".join(f'<td class="number">{x:.5g}</td>' for x in (*figures, worst))
            about = escape(str(found[name].attrs.get("long_name", "")))
            unit = escape(str(found[name].attrs.get("units", "")))
            rows.append(f"<tr><td>{escape(name)}</td><td>{about}</td><td>{unit}</td>{cells}</tr>")
    heads = ("", "what it is", "unit", "smallest", "median", "largest", "in case")
    head = "".join(f'<th scope="col"{" class=number" if k > 2 else ""}>{text}</th>' for k, text in enumerate(heads))
    return f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>"


def _shares(found: Any) -> str:
    """What `hybrid.shares` has found of results: a table of each, or why it claims nothing."""
    parts = []
    for name, each in json.loads(found.attrs.get("shares", "{}")).items():
        heads = ("", "derivative", "share", "first order from", "to", "Sobol: first order", "total")
        head = "".join(f'<th scope="col"{" class=number" if k else ""}>{x}</th>' for k, x in enumerate(heads))
        rows = ""
        for row in each["rows"]:
            numbers = (row[x] for x in ("derivative", "share", "low", "high", "first", "total"))
            cells = "".join(f'<td class="number">{"" if x != x else f"{x:.4g}"}</td>' for x in numbers)
            rows += f"<tr><td>{escape(row['variable'])}</td>{cells}</tr>"
        about = f"R² {each['r2']:.4f} over {each['cases']} cases"
        about = f"No shares: {escape(each['why'])}." if each["why"] else f"{escape(each['of'])} at the mean; {about}."
        parts.append(
            f'<h3>{escape(name)}</h3><p class="quiet">{about}</p><div class="scroll"><table><thead><tr>{head}</tr>'
            f"</thead><tbody>{rows}</tbody></table></div>"
        )
    if not parts:
        return ""
    return f'<section id="shares"><h2>Shares of the spread, by derivatives</h2>{"".join(parts)}</section>'


def _example(found: Any, variables: list[str]) -> str:
    """A filter that could be meant."""
    numbers = [name for name in variables if found[name].dtype.kind == "f"]
    parts = [f"{name} > {float(np.nanmedian(found[name].values)):.4g}" for name in numbers[:2]]
    return " and ".join(parts) or "failed"
