"""The cases of a study, and which variables matter.

Cases are a table of variables, and a scene of each row.  Which variables matter: indices of Sobol, elementary effects
of Morris, rank correlations.  SALib makes the designs and evaluates them; what was sampled otherwise has rank
correlations (Spearman), which any table has.
"""

from __future__ import annotations

import csv
import hashlib
import json
import math
import re
import warnings
from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from itertools import pairwise, product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hybrid.errors import Complaint, ResultError, SceneError, optional_package
from hybrid.scene.base import FORMER_NAMES, places_of_files
from hybrid.scene.read import as_scene, read_text, text_of
from hybrid.scene.root import Scene
from hybrid.scene.study import MOST_CASES, TAKEN, Study
from hybrid.store.study_file import DONE, open_study

# Designs for sensitivity, and the levels of a Morris design.
DESIGNS = ("saltelli", "morris")
LEVELS = 4
# Resamples of the intervals.
RESAMPLES = 200
# Cases of which correlations are computed.
LEAST = 3


class Influence(NamedTuple):
    """What one variable does to a result.

    method "sobol": `first` is the part of the variance that it makes alone, `total` that with all it interacts with;
    "morris": `first` is the mean of the sizes of its elementary effects, `total` their deviation, in the unit of the
    result over the range of the variable; "rank": `first` is the rank correlation, `total` NaN.  interval: half width
    of the 95 % interval of `first` ("sobol", "morris"), of "rank" the probability of such a correlation by chance.
    """

    variable: str
    method: str
    first: float
    total: float
    interval: float


class StudyResult(NamedTuple):
    """A result of a study: all of its data, values (n,), which cases have one, how they were sampled (None: not)."""

    data: Any
    values: np.ndarray
    done: np.ndarray
    sample: dict[str, Any] | None

    @property
    def method(self) -> str:
        """Of its sample; "": it has none."""
        return str(self.sample["method"]) if self.sample else ""


def design(method: str, names: list[str], count: int, seed: int) -> np.ndarray:
    """Points (n, m) between 0 and 1 of a design for m variables; count: its base size."""
    optional_package("SALib", "a design for sensitivity", "studies")
    from SALib.sample import morris, sobol

    problem = _problem(names, [(0.0, 1.0)] * len(names))
    if method == "saltelli":
        return np.asarray(sobol.sample(problem, count, calc_second_order=False, seed=seed))
    return np.asarray(morris.sample(problem, count, num_levels=LEVELS, seed=seed))


def sensitivity(study: str | Path, result: str) -> list[Influence]:
    """What each variable of a study does to one of its results, the strongest first.

    study: the folder of its results; result: a number that was kept of each run.  A study sampled by `saltelli` has
    indices of Sobol, by `morris` elementary effects, any other rank correlations.  ResultError for a result that is not
    there or known of too few cases, or a design of which cases have failed.
    """
    asked = result_of(study, result)
    found, values, done, sample = asked
    method = asked.method
    if sample is not None and method in DESIGNS:
        if not done.all():
            raise ResultError(
                f"{int((~done).sum())} of {done.size} cases have no '{result}', and a design of {method} needs all\n"
                "    try:      bounds in which every case can be computed, or a sample latin_hypercube"
            )
        bounds = json.loads(found.attrs["bounds"])
        if done.size != sample["count"] * (len(bounds) + (2 if method == "saltelli" else 1)):
            raise ResultError(
                f"{study} has {done.size} cases, and not those of a design of {method} alone\n"
                "    try:      a study without only_if, without cases, and of one value of each list"
            )
        return _of_design(method, bounds, found, values)
    return _ranked(found, values, done)


def result_of(study: str | Path, result: str) -> StudyResult:
    """A number that was kept of each run; ResultError: it is not there, or known of too few cases."""
    found = open_study(study)
    if result not in found or found[result].dims != ("case",) or found[result].dtype.kind != "f":
        numbers = [str(n) for n in found.data_vars if found[n].dims == ("case",) and found[n].dtype.kind == "f"]
        raise ResultError(f"{study} has no result '{result}'\n    expected: one of {', '.join(numbers)}")
    values = found[result].values
    done = (found["status"].values == DONE) & np.isfinite(values)
    if done.sum() < LEAST:
        raise ResultError(f"{int(done.sum())} of {done.size} cases have a '{result}'\n    expected: {LEAST} at least")
    return StudyResult(found, values, done, json.loads(found.attrs.get("sample", "null")))


def _of_design(method: str, bounds: dict[str, Any], found: Any, values: np.ndarray) -> list[Influence]:
    optional_package("SALib", "sensitivity", "studies")
    names = list(bounds)
    problem = _problem(names, [(0.0, 1.0)] * len(names))
    if method == "saltelli":
        from SALib.analyze import sobol

        made = sobol.analyze(problem, values, calc_second_order=False, num_resamples=RESAMPLES, seed=0)
        rows = zip(names, made["S1"], made["ST"], made["S1_conf"], strict=True)
        return _in_order([Influence(n, "sobol", float(a), float(b), float(c)) for n, a, b, c in rows], "total")
    from SALib.analyze import morris

    low, high = (np.array([bounds[name][k] for name in names]) for k in (0, 1))
    points = (np.stack([found[name].values for name in names], axis=1) - low) / (high - low)
    made = morris.analyze(problem, points, values, num_levels=LEVELS, num_resamples=RESAMPLES, seed=0)
    rows = zip(names, made["mu_star"], made["sigma"], made["mu_star_conf"], strict=True)
    return _in_order([Influence(n, "morris", float(a), float(b), float(c)) for n, a, b, c in rows], "first")


def _ranked(found: Any, values: np.ndarray, done: np.ndarray) -> list[Influence]:
    from scipy.stats import spearmanr

    rows = []
    for name in json.loads(found.attrs["variables"]):
        column = found[name].values
        if column.dtype.kind == "f" and np.ptp(column[done]) > 0.0 and np.ptp(values[done]) > 0.0:
            rank = spearmanr(column[done], values[done])
            rows.append(Influence(name, "rank", float(rank.statistic), np.nan, float(rank.pvalue)))
    return _in_order(rows, "first")


def _in_order(rows: list[Influence], by: str) -> list[Influence]:
    return sorted(rows, key=lambda row: -abs(getattr(row, by)))


def _problem(names: list[str], bounds: list[tuple[float, float]]) -> dict[str, Any]:
    """What SALib calls a problem."""
    return {"num_vars": len(names), "names": names, "bounds": [list(b) for b in bounds]}


Row = dict[str, Any]
LONGEST_PATH = 4096


def digest_of(file: str) -> str:
    """A hash of a file; empty if it is not there."""
    try:
        return hashlib.sha256(Path(file).read_bytes()).hexdigest()[:16]
    except OSError:
        return ""


@dataclass(frozen=True)
class Cases:
    """The scene as data, the keys that each variable sets, and one row of values for each case.

    bounds: of what is sampled; derived: values (n,) of columns computed from them; units: of variables; all by name.
    """

    base: dict[str, Any]
    keys: dict[str, tuple[str, ...]]
    rows: list[Row]
    derived: dict[str, np.ndarray]
    units: dict[str, str]
    static: bool
    bounds: dict[str, tuple[float, float]]

    def scene(self, case: int) -> Scene:
        """The scene of a case; SceneError if it is refused."""
        return scene_of(self.base, self.keys, self.rows[case])

    @property
    def lines(self) -> tuple[str, ...]:
        """Names of the lines of a scene of several; empty of a scene of one."""
        return tuple(self.base.get("lines", ()))

    @property
    def identity(self) -> str:
        """A hash of all that decides results, files that the scene reads included."""
        digest = hashlib.sha256(json.dumps([self.base, self.keys, self.static], sort_keys=True).encode())
        for row in self.rows:
            digest.update(json.dumps(row, sort_keys=True).encode())
        digest.update(json.dumps(self.files, sort_keys=True).encode())
        return digest.hexdigest()[:16]

    @property
    def files(self) -> dict[str, str]:
        """Hashes of the files that scenes read, by path."""
        named = {x for row in self.rows for x in row.values() if isinstance(x, str)}
        named |= {x for *_, x in places_of_files([self.base, self.rows])}
        return {x: digest_of(x) for x in sorted(named) if len(x) < LONGEST_PATH and Path(x).is_file()}


def cases_of(study: Study) -> Cases:
    """The cases of a study; SceneError if its scene, its keys or its table of cases is refused, or none is left."""
    text = text_of(study.scene)
    scene, _ = read_text(text, study.scene)
    if not study.static:
        scene.require_time()
    keys = {name: each.keys or (each.key or name,) for name, each in study.vary.items()}
    units = {name: each.unit or "" for name, each in study.vary.items()}
    rows = _rows(study)
    for name in rows[0] if rows else ():
        keys.setdefault(name, () if name in study.carry else (name,))
        units.setdefault(name, "")
    short = short_names(keys)
    keys = {short[name]: paths for name, paths in keys.items()}
    units = {short[name]: unit for name, unit in units.items()}
    _refuse_names(keys, study)
    rows = _chosen(study, [{short[name]: value for name, value in row.items()} for row in rows])
    if not rows:
        raise SceneError([Complaint("only_if", str(study.only_if), "a condition that some case fulfils", "relax it")])
    settings = [f"{path}={json.dumps(rows[0][name])}" for name, paths in keys.items() for path in paths]
    read_text(text, study.scene, settings)  # refused with the names of the keys
    of_files = {name for name, paths in keys.items() if any(re.search(r"\.(file|rao)$", path) for path in paths)}
    for row in rows:
        row |= {k: deepcopy(x) for k, x in row.items() if isinstance(x, dict | list)}
        within = [(row, k, row[k]) for k in of_files if isinstance(row.get(k), str)]
        for table, key, path in [*within, *places_of_files([x for x in row.values() if isinstance(x, dict | list)])]:
            table[key] = str((Path(study.scene).parent / path).absolute())
    base = scene.model_dump(mode="json", exclude_none=True)
    written = scene.model_dump(mode="json", exclude_none=True, exclude_unset=True)
    for table in (path.removesuffix(".kind") for paths in keys.values() for path in paths if path.endswith(".kind")):
        _set(base, table, _table_at(written, table))  # defaults are those of a kind
    bounds = {short[name]: (each.low, each.high) for name, each in study.vary.items() if each.low is not None}
    derived = {name: np.array(evaluated(f"derive.{name}", x, rows)) for name, x in study.derive.items()}
    return Cases(base, keys, rows, derived, units, study.static, bounds)  # type: ignore[arg-type]


def _refuse_names(keys: Mapping[str, Sequence[str]], study: Study) -> None:
    """SceneError for a name that means two things, or a key that two variables set."""
    known: dict[str, str] = {}
    for name, paths in keys.items():
        if name in TAKEN or name in study.derive:
            expected = f"a name of its own, none of {', '.join(TAKEN)}, and not that of a derived column"
            raise SceneError([Complaint("vary", name, expected, f"{name}_: {{key: ...}}")])
        for path in paths:
            if path in known:
                expected = f"a key of its own: {known[path]} sets it too"
                raise SceneError([Complaint(f"vary.{name}", path, expected, "leave one of them out")])
            known[path] = name


def scene_of(base: Mapping[str, Any], keys: Mapping[str, Sequence[str]], row: Row) -> Scene:
    """The scene, of one line or several, with the values of a row; SceneError if it is refused."""
    data = deepcopy(dict(base))
    for name, paths in keys.items():
        for path in paths:
            _set(data, path, row[name])
    return as_scene(data)


def short_names(names: Iterable[str]) -> dict[str, str]:
    """A short name for each variable, some of which are named by their keys: the last word, if no other has it."""
    short = {name: re.findall(r"[A-Za-z_]\w*", name)[-1] for name in names}
    found: dict[str, str] = {}
    for name, last in short.items():
        free = list(short.values()).count(last) == 1 and last not in TAKEN
        found[name] = last if free else re.sub(r"\W+", "_", name).strip("_")
    return found


def _rows(study: Study) -> list[Row]:
    """Rows of variables, before any condition."""
    lists = {name: values for name, each in study.vary.items() if (values := each.listed()) is not None}
    tables = [_read_table(study)] if study.cases is not None else []
    sampled = {name: (each.low, each.high) for name, each in study.vary.items() if each.low is not None}
    if study.sample is not None:
        tables.append(_sample(study, sampled))
    if lists and study.combine == "zip":
        tables.append([dict(zip(lists, values, strict=True)) for values in zip(*lists.values(), strict=True)])
    elif lists:
        _refuse_too_many([len(x) for x in lists.values()])
        tables.append([dict(zip(lists, values, strict=True)) for values in product(*lists.values())])
    _refuse_too_many([len(x) for x in tables])
    return [{k: v for part in parts for k, v in part.items()} for parts in product(*tables)]


def _refuse_too_many(counts: list[int]) -> None:
    if math.prod(counts) > MOST_CASES:
        given = " x ".join(map(str, counts))
        raise SceneError([Complaint("vary", f"{given} cases", f"{MOST_CASES} at most", "a sample, or fewer values")])


def _sample(study: Study, bounds: Mapping[str, tuple[Any, Any]]) -> list[Row]:
    from scipy.stats import qmc

    assert study.sample is not None
    if study.sample.method in DESIGNS:
        points = design(study.sample.method, list(bounds), study.sample.count, study.sample.seed)
        return [dict(zip(bounds, row, strict=True)) for row in scaled(points, bounds)]
    kind = qmc.Sobol if study.sample.method == "sobol" else qmc.LatinHypercube
    points = kind(len(bounds), rng=np.random.default_rng(study.sample.seed)).random(study.sample.count)
    return [dict(zip(bounds, row, strict=True)) for row in scaled(points, bounds)]


def scaled(points: np.ndarray, bounds: Mapping[str, tuple[Any, Any]]) -> list[list[float]]:
    """Points (n, m) between 0 and 1, between the bounds of m variables."""
    low, high = np.array([x[0] for x in bounds.values()]), np.array([x[1] for x in bounds.values()])
    return [[float(x) for x in row] for row in low + (high - low) * points]


def _read_table(study: Study) -> list[Row]:
    """Rows of the CSV file of cases: numbers where they are, else words."""
    assert study.cases is not None
    table = read_table(study.cases, "cases")
    header = table.header
    rows = [dict(zip(header, map(_number_or_word, cells), strict=True)) for _, cells in table.rows]
    empty = [name for name, each in study.vary.items() if each.listed() is None and each.low is None]
    if absent := [name for name in (*study.carry, *empty) if name not in header]:
        expected = f"columns of the table: {', '.join(header)}"
        raise SceneError([Complaint("cases", ", ".join(absent), expected, "add the column")], study.cases)
    both = set(header) & {name for name, each in study.vary.items() if each.listed() is not None}
    if both:
        raise SceneError([Complaint("vary", ", ".join(both), "in vary or in the table of cases, not in both")])
    return rows


def _number_or_word(text: str) -> Any:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def _chosen(study: Study, rows: list[Row]) -> list[Row]:
    """The rows that fulfil the condition."""
    if study.only_if is None:
        return rows
    return [row for row, is_in in zip(rows, evaluated("only_if", study.only_if, rows), strict=True) if is_in]


def _parts(path: str) -> list[str | int]:
    """Names and numbers that lead to a value in tables and lists."""
    return [int(x[1:]) if x[0] == "[" else x.strip() for x in re.findall(r"\[\d+|[^.\[\]]+", path)]


def _key(data: Any, part: str | int) -> str | int:
    """What a part of a path is called in a table, which has keys of today."""
    if isinstance(data, dict) and part not in data:
        return next((now for now, former in FORMER_NAMES.items() if part in former and now in data), part)
    return part


def _table_at(data: Any, path: str) -> Any:
    """The table at a path; {} where there is none."""
    for part in _parts(path):
        data = data[part] if isinstance(part, int) else data.get(_key(data, part), {})
    return data


def _set(data: Any, path: str, value: Any) -> None:
    """Set a value in tables and lists; tables that are not there are made."""
    parts = _parts(path)
    for former, after in pairwise(parts):
        part = _key(data, former)
        if isinstance(data, dict) and not isinstance(data.get(part), dict | list):
            data[part] = {} if isinstance(after, str) else []
        data = data[part]
    data[_key(data, parts[-1])] = value


# Tables in CSV files: a header and rows, with their lines in the file.


class Table(NamedTuple):
    """Names of columns; rows as numbers of lines, counted from 1, and texts of cells."""

    header: list[str]
    rows: list[tuple[int, list[str]]]


def read_table(file: str, where: str) -> Table:
    """The table of a file, without lines that are empty or begin with #; where: the key that names it.

    SceneError: no header or no row, columns without names, rows of another length.
    """
    lines = text_of(file).splitlines()
    numbered = [(i + 1, line) for i, line in enumerate(lines) if line.strip() and not line.startswith("#")]
    if len(numbered) < 2:
        raise SceneError([Complaint(where, file, "a header and one row or more")], file)
    header = [x.strip() for x in next(csv.reader([numbered[0][1]]))]
    if len(set(header)) < len(header) or not all(header):
        expected = "a name for each column"
        raise SceneError([Complaint(where, ",".join(header), expected, line=numbered[0][0])], file)
    rows = []
    for line, text in numbered[1:]:
        cells = [x.strip() for x in next(csv.reader([text]))]
        if len(cells) != len(header):
            expected = f"{len(header)}, one for each column"
            raise SceneError([Complaint(where, f"{len(cells)} values", expected, line=line)], file)
        rows.append((line, cells))
    return Table(header, rows)


# Arithmetic that users write: conditions of a study, columns derived from others, what a design minimises.


def evaluated(where: str, text: str, rows: Sequence[Mapping[str, Any]]) -> list[Any]:
    """The value of an expression for each row; SceneError for what is none, or a name that is not known."""
    package = optional_package("simpleeval", "an expression", "studies")
    functions = {name: getattr(math, name) for name in ("sqrt", "exp", "log", "sin", "cos", "tan", "radians", "pi")}
    pi = functions.pop("pi")
    functions |= {"abs": abs, "min": min, "max": max, "round": round}
    evaluator = package.SimpleEval(functions=functions)
    try:
        found = []
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # an assignment, m = 5 for m == 5, is only warned of
            tree = evaluator.parse(text)
            for row in rows:
                evaluator.names = {"pi": pi, **row}
                found.append(evaluator.eval(text, tree))
        return found
    except Exception as error:
        expected = f"arithmetic and comparisons of {', '.join(rows[0])}; {error}"
        raise SceneError([Complaint(where, text, expected)]) from None
