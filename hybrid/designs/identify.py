"""Numbers of a scene from what was measured of its equilibrium or motion.

What was measured is a table of places, times and quantities.  Of each number it is said how well it is known, or that
it is not.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import chi2, norm, t

from hybrid.designs.case_results import FINER, IN_MOTION, AnyScene, Equilibria, Point
from hybrid.designs.in_motion import NAMES as EDGES
from hybrid.designs.nearest import AT_BOUND, Rows, Space, nearest
from hybrid.designs.numbers_and_results import of_line, scale_of
from hybrid.designs.problem import cable_of
from hybrid.errors import Complaint, ComputationError, SceneError
from hybrid.kernels.state.state import Floats
from hybrid.outputs.probes import PROBES
from hybrid.scene.base import Finding
from hybrid.scene.read import TaskFile
from hybrid.scene.study import Design
from hybrid.studies.cases import Table, read_table

COORDINATES = {"x": "position.x", "y": "position.y", "z": "position.z"}
OF_ROW = ("t", "s", "line", "case")


class History(NamedTuple):
    """What was measured over time of a result such as `tension@end`: rows (m,) of measurements, by time t (m,), s."""

    case: str
    result: str
    rows: np.ndarray
    t: Floats


class Measurements(NamedTuple):
    """Measured numbers (M,), and which results of which cases they are.

    wanted: case and result of each; rows (M,): which of these each number is; values (M,) and deviations (M,) in the
    units of results; None: they are not stated.  places: of each case and line, arc lengths (m,), m, and places (m, 3),
    NaN where not measured; histories: what was measured over time.
    """

    wanted: list[tuple[str, str]]
    rows: np.ndarray
    values: Floats
    deviations: Floats | None
    places: dict[tuple[str, str], tuple[Floats, Floats]]
    histories: tuple[History, ...]


def measurements(task: TaskFile[Design], scene: AnyScene) -> Measurements:
    """What the file of a design says; SceneError: what it does not have, or cannot mean, with its line."""
    asked = task.asked.measured
    assert asked is not None
    table = read_table(asked.file, "measured.file")
    columns = _columns(task, table, scene)
    wanted: dict[tuple[str, str], int] = {}
    rows, values, deviations = list[int](), list[float](), list[float]()
    places: dict[tuple[str, str], list[list[float]]] = {}
    histories: dict[tuple[str, str], list[tuple[float, int]]] = {}
    for line, texts in table.rows:
        cells = dict(zip(table.header, texts, strict=True))
        case, name = _where(task, cells, scene, line)
        time = _number(asked.file, "t", cells.get("t", ""), line)
        _check_time(asked.file, scene, cells.get("t", ""), time, line)
        s, place = None, [math.nan] * 3
        for column, result in columns.items():
            value = _number(asked.file, column, cells[column], line)
            if value is None:
                continue
            at = ""
            if has_place(result):
                s = _arc_length(task, cells, cable_of(scene, name).length, line)
                at = "@end" if s == cable_of(scene, name).length else f"@{s!r}"  # it stays the end of another length
            of = f"{of_line(name)}{result}{at}"
            key = (case, of if time is None else f"t={time!r} {of}{IN_MOTION}")
            if time is not None:
                histories.setdefault((case, of), []).append((time, len(rows)))
            elif column in COORDINATES:
                place["xyz".index(column)] = value
            rows.append(wanted.setdefault(key, len(wanted)))
            values.append(value)
            deviations.append(asked.deviations.get(column, asked.deviation or math.nan))
        if time is None and s is not None:
            places.setdefault((case, name), []).append([s, *place])
    if not values:
        raise SceneError([Complaint("measured.file", asked.file, "at least one number that was measured")], asked.file)
    stated = np.array(deviations)
    if np.isnan(stated).any() and (
        len({PROBES[x.split(".")[0]].unit for x in columns.values()}) > 1 or asked.deviations
    ):
        expected = "a deviation of every column, because they are of several kinds"
        raise task.refusal([Finding(("measured", "deviations"), expected, "deviations: {z: 0.002, tension: 50}")])
    by_line = {key: (np.array(x)[:, 0], np.array(x)[:, 1:]) for key, x in places.items()}
    over_time = []
    for key, x in histories.items():
        times, of_rows = (np.array(each) for each in zip(*sorted(x), strict=True))
        over_time.append(History(*key, of_rows, times))
    given = None if np.isnan(stated).any() else stated
    return Measurements([*wanted], np.array(rows), np.array(values), given, by_line, tuple(over_time))


def quantity_of(result: str) -> str:
    """The quantity of a result such as `east/reaction_end.x` or `tension@end`."""
    return result.split("@")[0].split("/")[-1].split(".")[0]


def has_place(result: str) -> bool:
    """Whether a result such as `tension` or `reaction_end.x` is of a place of the line."""
    return "s" in PROBES[quantity_of(result)].dims


def _arc_length(task: TaskFile[Design], cells: dict[str, str], length: float, line: int) -> float:
    """Where a row was measured, m."""
    asked = task.asked.measured
    assert asked is not None
    if asked.at is not None:
        s = {"start": 0.0, "end": length}[asked.at] if isinstance(asked.at, str) else asked.at
        if not 0.0 <= s <= length:
            expected = f"an arc length between 0 and {length:g} m"
            raise task.refusal([Finding(("measured", "at"), expected, given=f"{s:g}")])
        return s
    found = _number(asked.file, "s", cells["s"], line)
    if found is None or not 0.0 <= found <= length:
        expected = f"an arc length between 0 and {length:g} m"
        raise SceneError([Complaint("s", cells["s"] or "nothing", expected, line=line)], asked.file)
    return found


def _check_time(file: str, scene: AnyScene, text: str, time: float | None, line: int) -> None:
    """SceneError: a time that is not in the run."""
    if time is None:
        return
    if scene.time is None:
        expected = "a scene with time, which says how long it moves, in which steps"
        raise SceneError([Complaint("t", text, expected, "time: {duration: 20, step: 0.05}", line=line)], file)
    if not 0.0 <= time <= scene.time.duration:
        raise SceneError([Complaint("t", text, f"a time between 0 and {scene.time.duration:g} s", line=line)], file)


def _columns(task: TaskFile[Design], table: Table, scene: AnyScene) -> dict[str, str]:
    """Results of columns, by their names."""
    asked = task.asked.measured
    assert asked is not None
    columns = {x: COORDINATES.get(x, x) for x in table.header if x not in OF_ROW}
    for name, result in columns.items():
        if not _is_measured(result):
            whole = [x for x in PROBES if _is_measured(x)]
            vectors = [f"{x}.x" for x in PROBES if _is_measured(f"{x}.x")]
            expected = f"a column of x, y, z, or one of: {', '.join([*whole, *vectors])}"
            raise SceneError([Complaint("measured.file", name, expected, line=1)], asked.file)
    needed = ["s"] if asked.at is None and (not columns or any(map(has_place, columns.values()))) else []
    needed += ["line"] if len(scene.lines) > 1 else []
    needed += ["case"] if len(task.asked.cases) > 1 else []
    header = ",".join(table.header)
    for name in needed:
        if name not in table.header:
            raise SceneError([Complaint("measured.file", header, f"a column {name}", line=1)], asked.file)
    if asked.at is not None and "s" in table.header:
        expected = f"nothing, because {asked.file} has a column s"
        raise task.refusal([Finding(("measured", "at"), expected)])
    if absent := [x for x in asked.deviations if x not in columns]:
        expected = f"a column of {asked.file}: {', '.join(columns)}"
        raise task.refusal([Finding(("measured", "deviations", absent[0]), expected)])
    return columns


def _is_measured(result: str) -> bool:
    """Whether it is one number of a quantity, of a place or of the whole line, that changes evenly."""
    name, _, axis = result.partition(".")
    if name not in PROBES or "/" in name or name in EDGES:
        return False
    return (axis in ("x", "y", "z")) if PROBES[name].dims[-1:] == ("xyz",) else not axis


def _where(task: TaskFile[Design], cells: dict[str, str], scene: AnyScene, line: int) -> tuple[str, str]:
    """Case and line of a row; "": there is one."""
    asked, cases = task.asked.measured, task.asked.cases
    assert asked is not None
    case, name = cells.get("case", next(iter(cases), "")), cells.get("line", next(iter(scene.asked_lines)))
    if case not in (list(cases) or [""]):
        raise SceneError([Complaint("case", case, f"one of: {', '.join(cases)}", line=line)], asked.file)
    if name not in scene.asked_lines:
        raise SceneError([Complaint("line", name, f"one of: {', '.join(scene.asked_lines)}", line=line)], asked.file)
    return case, name


def _number(file: str, column: str, text: str, line: int) -> float | None:
    """A number of a cell; None: it is empty."""
    if not text:
        return None
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise SceneError([Complaint(column, text, "a number, or nothing where nothing was measured", line=line)], file)
    return value


# Standard deviation of the logarithm of a combination of unknowns from which on it counts as not known.
UNKNOWN = 1.0
# What parts of a combination count, and are alike.
PART, ALIKE = 0.05, 0.03
SINGULAR = 1e-6  # singular values, as parts of the largest, that are 0
LEAST = 1e-4  # where no deviation is stated, part of the largest number below which unknowns stay
GAIN = 1e-7  # part of the sum of squares that is worth a step
CONFIDENCE = 0.95  # of the intervals of estimates
DOUBT = 0.005  # probability below which deviations as large, or as alike, are no chance
# Readings one after another from which on it is judged whether they are independent.
FEWEST = 8


class Estimate(NamedTuple):
    """A number that was found, its standard deviation, and between what it is with 95 %; infinite: not known by itself.

    by_cells: by how much it changes on cells half as long; NaN: there is no equilibrium on these.
    """

    name: str
    value: float
    deviation: float
    low: float
    high: float
    by_cells: float


class Apart(NamedTuple):
    """Unknowns that cannot be told apart: the parts by which they may change together, unseen, and in words."""

    parts: Mapping[str, float]
    text: str


def fit(measured: Measurements, equilibria: Equilibria, space: Space) -> tuple[Point, dict[str, Any]]:
    """The values of unknowns nearest to what was measured, and what an `Identified` says of them.

    ComputationError, SceneError: where it begins there is no equilibrium, or no such scene.
    """
    rows, values = measured.rows, measured.values
    known = measured.deviations is not None
    scene, largest = next(iter(equilibria.scenes.values())), float(np.abs(values).max(initial=0.0))
    typical = scale_of(scene, quantity_of(measured.wanted[0][1]), largest) or 1.0
    scale = measured.deviations if measured.deviations is not None else np.full(values.size, typical)

    def off(x: Floats) -> Rows:
        point = equilibria.point_of(x)
        return Rows(point, (point.values[rows] - values) / scale, lambda: point.slopes[rows] / scale[:, None])

    def refresh(point: Point) -> bool:
        return point.refresh({*equilibria.motions.rows})

    least = 1.0 / UNKNOWN if known else LEAST
    best = nearest(off, space, least, GAIN, refresh)
    refresh(best.point)
    sizes = space.sizes(best.point.x)
    slopes = best.slopes() * sizes
    u, s, v = np.linalg.svd(slopes, full_matrices=values.size < sizes.size)
    freedom = values.size - int(np.sum(s > max(SINGULAR * s.max(initial=0.0), least)))
    unit = 1.0 if known else math.sqrt(2.0 * best.cost / freedom) if freedom > 0 else math.inf
    s = np.append(s, np.zeros(sizes.size - s.size))
    seen = s > unit / UNKNOWN
    # what may be 0 is sought by parts of its range, and told apart by those of itself, or of what it may be off by
    off_by = (unit if seen.any() else 0.0) * sizes * np.sqrt(((v[seen] / s[seen, None]) ** 2).sum(axis=0))
    own = np.minimum(np.fmax(np.abs(best.point.x), off_by), sizes)
    own[own == 0.0] = sizes[own == 0.0]
    estimates, correlations = _estimates(
        space.names, best, sizes, own, s, v, seen, unit, freedom if not known else None
    )
    finer, notes = _by_cells(equilibria, best, rows, scale, u, s, v, seen, sizes)
    estimates = tuple(x._replace(by_cells=float(y)) for x, y in zip(estimates, finer, strict=True))
    parts = v * sizes / own
    apart = tuple(_apart(space.names, best.point.x, parts[k], parts, s, seen, unit) for k in np.flatnonzero(~seen))
    scatter = math.sqrt(2.0 * best.cost / values.size) * (1.0 if known else float(scale[0]))
    notes += [f"the search stopped before it was done: {best.stopped}"] if best.stopped else []
    notes += _doubts(best, freedom, known) + _after_each_other(best.values, measured.histories)
    pull = slopes.T @ best.values  # to lower values
    beyond = np.stack([pull, -pull], axis=1) > AT_BOUND * (slopes**2).sum(axis=0)[:, None]
    notes += [
        f"{space.names[i]} is at its bound ({('low', 'high')[k]}): what was measured would have it beyond"
        for i, k in np.argwhere(space.at_bounds(best.point.x) & beyond)
    ]
    found = {"estimates": estimates, "correlations": correlations, "apart": apart, "count": values.size}
    found |= {"scatter": scatter, "notes": tuple(notes), "stated": known, "settled": not best.stopped}
    return best.point, found


def _estimates(
    names: Sequence[str],
    best: Rows,
    sizes: Floats,
    own: Floats,
    s: Floats,
    v: Floats,
    seen: np.ndarray,
    unit: float,
    freedom: int | None,
) -> tuple[tuple[Estimate, ...], Floats]:
    """Estimates and correlations; freedom: of a deviation that is estimated, too; None: it is stated."""
    covariance = (v[seen].T / s[seen] ** 2) @ v[seen] * unit**2
    spread = sizes * np.sqrt(np.diag(covariance))
    unseen = v[~seen] * sizes / own
    hidden = (np.abs(unseen) > PART * np.linalg.norm(unseen, axis=1, keepdims=True)).any(axis=0)
    spread[hidden] = np.inf
    level = 0.5 * (1.0 + CONFIDENCE)
    times = float(t.ppf(level, freedom if freedom is not None else np.inf)) if freedom != 0 else np.inf
    x = best.point.x
    out = tuple(
        Estimate(name, float(a), float(d), float(a - times * d), float(a + times * d), math.nan)
        for name, a, d in zip(names, x, spread, strict=True)
    )
    size = np.sqrt(np.diag(covariance))
    correlations = covariance / np.maximum(np.outer(size, size), 1e-300)
    correlations[hidden] = correlations[:, hidden] = np.nan
    return out, correlations


def _by_cells(
    equilibria: Equilibria,
    best: Rows,
    rows: np.ndarray,
    scale: Floats,
    u: Floats,
    s: Floats,
    v: Floats,
    seen: np.ndarray,
    sizes: Floats,
) -> tuple[Floats, list[str]]:
    """By how much unknowns change on cells half as long: one more step from there."""
    try:
        finer = equilibria.point_of(best.point.x, FINER)
    except ComputationError as error:
        return np.full(sizes.size, np.nan), [f"not checked on twice the cells: {str(error).splitlines()[0]}"]
    change = (finer.values - best.point.values)[rows] / scale
    k = np.flatnonzero(seen[: u.shape[1]])
    return sizes * (v[k].T @ (-(u[:, k].T @ change) / s[k])), []


def _doubts(best: Rows, freedom: int, known: bool) -> list[str]:
    if freedom <= 0:
        return ["as many numbers are sought as are seen in what was measured: nothing is left to check them by"]
    if known and chi2.sf(2.0 * best.cost, freedom) < DOUBT:
        times = math.sqrt(2.0 * best.cost / freedom)
        return [
            f"what is left is {times:.3g} times the stated deviation: the scene is another line than was measured, or "
            "the deviation is larger; intervals are too narrow"
        ]
    return []


def _after_each_other(left: Floats, histories: Sequence[History]) -> list[str]:
    """Doubts about readings that are no readings by themselves: intervals count each as one.

    Of independent ones the correlation is normal, with a deviation of 1 / sqrt(count).
    """
    every = [left[x.rows] for x in histories]
    square, count = sum(float(x @ x) for x in every), sum(x.size - 1 for x in every)
    likeness = sum(float(x[1:] @ x[:-1]) for x in every) / square if square > 0.0 else 0.0
    if count < FEWEST or likeness * math.sqrt(count) <= norm.isf(DOUBT):
        return []
    times = math.sqrt((1.0 + likeness) / max(1.0 - likeness, 1e-3))
    return [
        f"what is left at a time is like that at the time before (correlation {likeness:.2g}): the scene moves "
        f"otherwise than was measured, or readings are closer than their noise changes; intervals are about "
        f"{times:.2g} times too narrow"
    ]


def _apart(
    names: Sequence[str], x: Floats, direction: Floats, v: Floats, s: Floats, seen: np.ndarray, unit: float
) -> Apart:
    """A combination of unknowns that what was measured does not show, and of two what it shows instead."""
    direction = direction / direction[np.abs(direction).argmax()]
    involved = [k for k in np.argsort(-np.abs(direction)) if abs(direction[k]) > PART]
    parts = {names[k]: float(direction[k]) for k in sorted(involved)}
    if len(involved) == 1:
        return Apart(parts, f"{names[involved[0]]}: what was measured does not depend on it")
    if len(involved) == 2 and x[involved].all():
        a, b = sorted(involved)
        power = float(-direction[a] / direction[b])  # a * b**power stays what it is
        if abs(abs(power) - 1.0) < ALIKE:
            power = math.copysign(1.0, power)
        word = f"{names[a]} {'*' if power > 0.0 else '/'} {names[b]}"
        word += "" if abs(power) == 1.0 else f"**{abs(power):.2g}"
        what = {1.0: "their product", -1.0: "their ratio"}.get(power, "their combination")
        weights = np.zeros(x.size)
        weights[a], weights[b] = 1.0, power
        log = unit * math.sqrt(float((((v[seen] @ weights) / s[seen]) ** 2).sum()))
        value = abs(float(x[a])) * abs(float(x[b])) ** power
        return Apart(
            parts, f"{names[a]} and {names[b]}: only {what} is known, {word} = {value:.5g} ± {value * log:.2g}"
        )
    change = ", ".join(f"{name} by {100 * part:+.0f} %" for name, part in parts.items())
    return Apart(parts, f"{' and '.join(parts)}: a change of {change} together is not seen (nor one in proportion)")
