"""What was measured of an equilibrium or a motion: a table of places, times and quantities, as results and numbers."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from hybrid.designs.edges import NAMES as EDGES
from hybrid.designs.equilibria import AnyScene
from hybrid.designs.motions import IN_MOTION
from hybrid.designs.problem import cable_of
from hybrid.designs.wanted import of_line
from hybrid.errors import Complaint, SceneError
from hybrid.kernels.state.state import Floats
from hybrid.outputs.probes import PROBES
from hybrid.scene.base import Finding
from hybrid.scene.design import Design
from hybrid.scene.read import TaskFile
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
    return Measurements(
        [*wanted], np.array(rows), np.array(values), None if np.isnan(stated).any() else stated, by_line,
        tuple(_history(*key, found) for key, found in histories.items()),
    )  # fmt: skip


def _history(case: str, result: str, found: list[tuple[float, int]]) -> History:
    t, rows = zip(*sorted(found), strict=True)
    return History(case, result, np.array(rows), np.array(t))


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
