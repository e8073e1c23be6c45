"""Cycles of tension and curvature at the places that matter, for fatigue: histories, and rainflow counts of them.

Places: both ends, the touchdown (where in its range the curvature ranges most), the place where the curvature
ranges most of all, and those asked for.  At the ends the tension is the end force of the step log, known at every step;
all else is known at the outputs.  Curvature is counted about one axis fixed in space, the one the cable bends most
about at that place: a magnitude would fold a bend to both sides into half its range.

Not done: stress (it needs the section), S-N curves, damage and life.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from hybrid.errors import ResultError, optional_package
from hybrid.store.histories import Bends, bends_of
from hybrid.store.selection import Part, error_name, head_lines

# A sine read n times a period shows 1 - cos(pi/n) less than its range at worst: 5 % for 10.
_SAMPLES = 10
# Cycles of less than this part of the largest range say nothing about how quick the load is.
_MAJOR = 0.1
# Below this part of the largest value at any of the places a cycle is the tolerance of Newton's method, not a load.
_NOISE = 1e-6
# The power of the range by which what is lost is weighed: the slope of S-N curves of chain and of welded steel is 3.
_SLOPE = 3
# A bend is counted about one axis; if less than this part of its square lies about it, the head of the file warns.
_PLANAR = 0.95
# Histories of one interval that show less than this part of the range of an end force are reported to lose some of it.
_KEPT = 0.99
# A touchdown so near to an end of the cable (part of its length) is that end.
_AT_END = 0.005

_SIDES = (", just before the point", ", just after the point")
_UNITS = {"tension": "N", "end_force": "N", "curvature": "1/m"}


class Series(NamedTuple):
    """One quantity at one place: times (n,) s, values (n,), and how the head of the file describes it."""

    place: str
    s: float
    quantity: str
    t: np.ndarray
    values: np.ndarray
    basis: str


class Counted(NamedTuple):
    """Two tables, cycles and histories, by the names of their columns; the head of both; what to warn of."""

    head: list[str]
    cycle_names: list[str]
    cycles: list[np.ndarray]
    history_names: list[str]
    histories: list[np.ndarray]
    notes: list[str]
    places: int


def count(chosen: Part) -> Counted:
    """Cycles in the outputs and steps that were chosen, at the places that matter and those that were asked for.

    ResultError when there are fewer than three outputs, or rainflow is not installed.
    """
    optional_package("rainflow", "counting cycles", "export")
    part, asked = replace(chosen, at=None), [] if chosen.at is None else chosen.at.tolist()
    if len(part.times) < 3:
        raise ResultError(
            f"{len(part.times)} output{'s have' if len(part.times) > 1 else ' has'} no cycles\n"
            "    try:      a result of `hybrid run`, and a window of time with more outputs"
        )
    bends = bends_of(part.result, part.rows)
    places = _places(part, bends, asked)
    series = [x for s, name in places.items() for x in _series_at(part, bends, s, name)]
    largest = {q: max((np.abs(x.values).max() for x in series if x.quantity == q), default=0.0) for q in _UNITS}
    noise, rows = 0, []
    for x in series:
        for size, mean, number, a, b in _cycles(x.values):
            if size <= _NOISE * largest[x.quantity]:
                noise += 1
                continue
            rows.append((x.place, x.s, x.quantity, _UNITS[x.quantity], size, mean, number, x.t[a], x.t[b]))
    rows.sort(key=lambda row: (row[1], row[2], -row[4]))
    names = ["place", "s (m)", "quantity", "unit", "range", "mean", "count", "t_from (s)", "t_to (s)"]
    columns = list(zip(*rows, strict=True)) if rows else [()] * len(names)
    base, notes = _base(part, series)
    names_of = {f"{x.quantity} ({_UNITS[x.quantity]}) at s = {x.s:.9g} m": x for x in series}
    histories = [base, *(np.interp(base, x.t, x.values) for x in names_of.values())]
    notes += [note for x in series if x.quantity == "end_force" for note in _too_slow(part, x)]
    head = [*head_lines(part), *(f"note: {note}" for note in notes)]
    head += ["cycles: rainflow (ASTM E1049), of every value that was recorded; a count of 0.5 is half a cycle"]
    head += [f"left out: {noise} cycles below {_NOISE:g} of the largest of all places, the solver's tolerance"]
    head += ["not done: stress from tension and curvature, which needs the section; S-N curves; damage"]
    head += [f"{x.quantity} at s = {x.s:.9g} m ({x.place}): {x.basis}" for x in series]
    return Counted(
        head, names, [np.array(column) for column in columns], ["t (s)", *names_of], histories, notes, len(places)
    )


# ---- where ----------------------------------------------------------------------------------------


def _places(part: Part, bends: Bends, asked: Sequence[float]) -> dict[float, str]:
    """Arc lengths (m) in their order, and why each is there."""
    s, result = bends.s, part.result
    largest = np.ptp(_about_main_axis(bends.vectors)[0], axis=0)
    found = [(s[0], "start"), (s[-1], "end")]
    if "touchdown" in result:
        edges, length = part.array("touchdown"), s[-1] - s[0]
        for k in (0, 1):
            edge = edges[np.isfinite(edges[:, k]), k]
            if len(edge) and not np.all(np.abs(edge - s[[0, -1]][k]) < _AT_END * length):
                a, b = np.searchsorted(s, [edge.min(), edge.max()])
                near = slice(max(a - 1, 0), b + 1)  # the points on both sides of where it goes
                found.append((s[near][largest[near].argmax()], "touchdown"))
    found.append((s[largest.argmax()], "largest range of curvature"))
    found += [(float(x), "asked for") for x in asked]
    places: dict[float, str] = {}
    for x, why in sorted(found):
        places[float(x)] = f"{places[x]} and {why}" if x in places else why
    return places


def _about_main_axis(bends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The component about the axis of most bending, per place (nt, n), and its share of the square (n,)."""
    axes = np.linalg.eigh(np.einsum("tni,tnj->nij", bends, bends))[1][..., -1]
    values = np.einsum("tni,ni->tn", bends, axes)
    values *= np.where(values.sum(axis=0) < 0.0, -1.0, 1.0)
    whole = (bends**2).sum(axis=(0, 2))
    return values, np.divide((values**2).sum(axis=0), whole, out=np.ones_like(whole), where=whole > 0.0)


# ---- what -----------------------------------------------------------------------------------------


def _series_at(part: Part, bends: Bends, s: float, place: str) -> list[Series]:
    """End force or tension, and curvature, at one place; of two values the one that has the larger range."""
    result, times = part.result, part.times
    series = []
    end_force = {part.s[0]: "end_force_start", part.s[-1]: "end_force_end"}.get(s, "")
    if end_force and f"steps/{end_force}" in result and len(part.array("steps/t")) > 2:
        basis = "magnitude of the force that holds the end (of an end body: tension of the last cell), at every step"
        series.append(Series(place, s, "end_force", part.array("steps/t"), part.array(f"steps/{end_force}"), basis))
    else:
        found = [result.at(s=s, names=["tension"], side=side)["tension"][part.rows] for side in ("left", "right")]
        k = int(np.ptp(found[1]) > np.ptp(found[0]))
        side = _SIDES[k] if part.after("tension", s) is not None else ""
        series.append(
            Series(place, s, "tension", times, found[k], f"at every output{side}" + _error(part, "tension", s, k))
        )
    values, share = _about_main_axis(bends.interpolated(np.array([s])).vectors)
    k = int(np.ptp(values, axis=0).argmax())
    side = _SIDES[k] if values.shape[1] > 1 else ""
    basis = f"about the axis it bends most about, at every output{side}; zones: " + _kinds(part, s)
    if share[k] < _PLANAR:
        basis += (
            f"; only {100 * share[k]:.0f} % of its square: it bends about other axes too, and those are not counted"
        )
    series.append(Series(place, s, "curvature", times, values[:, k], basis + _error(part, "curvature", s, k)))
    return series


def _kinds(part: Part, s: float) -> str:
    found, names = part.zone_kinds(np.array([s]))
    shares = {name: np.mean(found == k) for k, name in enumerate(names)}
    return ", ".join(f"{name} {100 * share:.0f} % of the outputs" for name, share in shares.items() if share)


def _error(part: Part, name: str, s: float, k: int) -> str:
    """What is known of an error at a place; k: 0 on the left of a jump, 1 on its right."""
    error, basis = error_name(part, name)
    if not error:
        return "; error not estimated"
    most = part.result.at(s=s, names=[error], side=("left", "right")[k])[error][part.rows].max()
    return f"; error at most {most:.3g} {_UNITS[name]}, {basis}"


def _cycles(values: np.ndarray) -> list[Any]:
    """Range, mean, count, and the indices between which it lies, of every cycle."""
    import rainflow

    return list(rainflow.extract_cycles(values.tolist()))


# ---- how well -------------------------------------------------------------------------------------


def _base(part: Part, series: Sequence[Series]) -> tuple[np.ndarray, list[str]]:
    """Times of one interval (n,) s for all histories: that of the outputs, or a whole part of it for the step log."""
    outputs, notes = part.times, []
    gaps = np.diff(outputs)
    every = float(gaps.mean())
    if np.ptp(gaps) > 1e-6 * every:
        every = float(gaps.min())
        notes.append(f"the outputs are {every:.4g} to {gaps.max():.4g} s apart: histories are linear between them")
    logs = [x for x in series if x.quantity == "end_force"]
    steps = [np.median(np.diff(x.t)) for x in logs]
    interval = every / max([1, *(int(np.ceil(every / step - 1e-6)) for step in steps)])
    first, last = max(x.t[0] for x in series), min(x.t[-1] for x in series)
    begin = outputs[0] + interval * np.ceil((first - outputs[0]) / interval - 1e-6)
    base = begin + interval * np.arange(int((last - begin) / interval + 1e-6) + 1)
    for x in logs:
        whole = np.ptp(x.values)
        kept = np.ptp(np.interp(base, x.t, x.values)) / whole if whole > _NOISE * np.abs(x.values).max() else 1.0
        if kept < _KEPT:
            notes.append(
                f"the histories of the end force at s = {x.s:.6g} m show {100 * kept:.1f} % of its range: steps are "
                f"shorter than {interval:.4g} s at times; the cycles are counted at every step"
            )
    return base, notes


def _too_slow(part: Part, log: Series) -> list[str]:
    """A warning when outputs or steps are too far apart for the fastest cycles at an end."""
    cycles = _cycles(log.values)
    largest = max((c[0] for c in cycles), default=0.0)
    major = [c for c in cycles if c[0] >= _MAJOR * largest and largest > _NOISE * np.abs(log.values).max()]
    if not major:
        return []
    # what begins or ends with the record is cut off, and looks quicker than it is
    major = [c for c in major if c[3] > 0 and c[4] < len(log.t) - 1] or major
    period = min(2.0 * (log.t[c[4]] - log.t[c[3]]) for c in major)
    every, step = float(np.diff(part.times).max()), float(np.median(np.diff(log.t)))
    notes = []
    if every * _SAMPLES > period * (1 + 1e-9):
        seen = _cycles(np.interp(part.times, log.t, log.values))
        lost_range = 1.0 - max((c[0] for c in seen), default=0.0) / largest
        weights = [sum(c[2] * c[0] ** _SLOPE for c in found) for found in (cycles, seen)]
        notes.append(
            f"outputs every {every:.4g} s are far apart for cycles of {period:.4g} s in the end force at "
            f"s = {log.s:.6g} m: at the outputs alone its largest range would be {100 * lost_range:.2g} % smaller "
            f"and the sum of count x range^{_SLOPE} {100 * (1 - weights[1] / weights[0]):.2g} % smaller; at other "
            f"places the loss is unknown; "
            f"try output: {{every: {period / _SAMPLES:.2g}}}"
        )
    if step * _SAMPLES > period * (1 + 1e-9):
        notes.append(
            f"steps of {step:.4g} s are long for cycles of {period:.4g} s in the end force at s = {log.s:.6g} m; "
            f"try time.step: {period / _SAMPLES:.2g}"
        )
    return notes
