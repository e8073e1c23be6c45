"""What was measured of an equilibrium: a table of arc lengths and quantities, as results and numbers."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from hybrid.designs.equilibria import AnyScene
from hybrid.designs.problem import cable_of
from hybrid.errors import Complaint, SceneError
from hybrid.kernels.state.state import Floats
from hybrid.outputs.probes import PROBES
from hybrid.scene.base import Finding
from hybrid.scene.design import Design
from hybrid.scene.schema import Scene
from hybrid.scene.task_file import TaskFile
from hybrid.studies.csv_table import Table, read_table

COORDINATES = {"x": "position.x", "y": "position.y", "z": "position.z"}
OF_ROW = ("s", "line", "case")


class Measurements(NamedTuple):
    """wanted: case and result of each; rows (M,): which of these each number is; values (M,) and deviations (M,) in the

    units of results; None: they are not stated.  places: of each case and line, arc lengths (m,), m, and places (m, 3),
    NaN where not measured.
    """

    wanted: list[tuple[str, str]]
    rows: np.ndarray
    values: Floats
    deviations: Floats | None
    places: dict[tuple[str, str], tuple[Floats, Floats]]


def measurements(task: TaskFile[Design], scene: AnyScene) -> Measurements:
    """What the file of a design says; SceneError: what it does not have, or cannot mean, with its line."""
    asked = task.asked.measured
    assert asked is not None
    table = read_table(asked.file, "measured.file")
    columns = _columns(task, table, scene)
    wanted: dict[tuple[str, str], int] = {}
    rows, values, deviations = list[int](), list[float](), list[float]()
    places: dict[tuple[str, str], list[list[float]]] = {}
    for line, texts in table.rows:
        cells = dict(zip(table.header, texts, strict=True))
        case, name = _where(task, cells, scene, line)
        s = _number(asked.file, "s", cells["s"], line)
        length = cable_of(scene, name).length
        if s is None or not 0.0 <= s <= length:
            expected = f"an arc length between 0 and {length:g} m"
            raise SceneError([Complaint("s", cells["s"] or "nothing", expected, line=line)], asked.file)
        place = [math.nan] * 3
        for column, result in columns.items():
            value = _number(asked.file, column, cells[column], line)
            if value is None:
                continue
            if column in COORDINATES:
                place["xyz".index(column)] = value
            prefix = "" if isinstance(scene, Scene) else f"{name}/"
            at = "end" if s == length else repr(s)  # the end stays it where the length is sought
            rows.append(wanted.setdefault((case, f"{prefix}{result}@{at}"), len(wanted)))
            values.append(value)
            deviations.append(asked.deviations.get(column, asked.deviation or math.nan))
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
        [*wanted], np.array(rows), np.array(values), None if np.isnan(stated).any() else stated, by_line
    )


def _columns(task: TaskFile[Design], table: Table, scene: AnyScene) -> dict[str, str]:
    """Results of columns, by their names."""
    asked = task.asked.measured
    assert asked is not None
    needed = ["s", *([] if isinstance(scene, Scene) else ["line"]), *(["case"] if len(task.asked.cases) > 1 else [])]
    header = ",".join(table.header)
    for name in needed:
        if name not in table.header:
            raise SceneError([Complaint("measured.file", header, f"a column {name}", line=1)], asked.file)
    columns = {x: COORDINATES.get(x, x) for x in table.header if x not in OF_ROW}
    known = [x for x, probe in PROBES.items() if probe.dims[-1:] == ("s",) and "/" not in x]
    for name in columns:
        if name not in COORDINATES and name not in known:
            expected = f"a column of x, y, z, or one of: {', '.join(known)}"
            raise SceneError([Complaint("measured.file", name, expected, line=1)], asked.file)
    if absent := [x for x in asked.deviations if x not in columns]:
        expected = f"a column of {asked.file}: {', '.join(columns)}"
        raise task.refusal([Finding(("measured", "deviations", absent[0]), expected)])
    return columns


def _where(task: TaskFile[Design], cells: dict[str, str], scene: AnyScene, line: int) -> tuple[str, str]:
    """Case and line of a row; "": there is one."""
    asked, cases = task.asked.measured, task.asked.cases
    assert asked is not None
    case, name = cells.get("case", next(iter(cases), "")), cells.get("line", "")
    lines = [""] if isinstance(scene, Scene) else [*scene.lines]
    if case not in (list(cases) or [""]):
        raise SceneError([Complaint("case", case, f"one of: {', '.join(cases)}", line=line)], asked.file)
    if name not in lines:
        raise SceneError([Complaint("line", name, f"one of: {', '.join(lines)}", line=line)], asked.file)
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
