"""Derivatives of results by numbers of the scene, and what part of the spread of a result each variable makes.

Derivatives at rest come with the error of their mesh.

Shares are those of a study, from derivatives where the mean of its cases is.  With independent variables of standard
deviations σ, a result that is linear in them has the variance Σ (g σ)², and (g σ)² over that is the part of each.
R² = 1 - var(y - g x)/var(y) over the cases that were computed says how linear it is.  What is left over, (1 - R²) of
the variance, bounds the first-order index S of Sobol: a conditional mean varies no more than what it is the mean of, so
that |√S - |g| σ/σ_y| <= √(1 - R²).
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple, overload

import numpy as np
from scipy.stats import pearsonr

from hybrid.designs.in_motion import WAY as BY_CELLS
from hybrid.designs.in_motion import by_cells, in_motion, is_edge, refuse_edges
from hybrid.designs.network_at_rest import NetworkAtRest, at_rest
from hybrid.designs.numbers_and_results import AnyScene, number_of, refuse_computing
from hybrid.errors import Complaint, ComputationError, Outcome, ResultError, SceneError
from hybrid.kernels.state.state import Floats
from hybrid.outputs.probes import PROBES
from hybrid.scene.read import SceneLike, as_scene
from hybrid.scene.root import Scene
from hybrid.scene.study import Kept
from hybrid.store.hdf5_file import locked
from hybrid.store.records import ALIASES
from hybrid.store.study_file import StudyFile
from hybrid.studies.cases import DESIGNS, Influence, StudyResult, digest_of, result_of, scene_of
from hybrid.studies.cases import sensitivity as of_study
from hybrid.studies.workers import names_of

# Error by that on half the cells, for results of second order; a fifth more, as of modes.  Part of one on a bed
# that is never said to be known: 60 to 120 cells of a leg are off by 0.5 to 1.7 %.
OF_DIFFERENCE, ON_BED = 0.4, 0.01
AT_REST = "factors of the equilibrium"  # the way to derivatives of one


class Derivative(NamedTuple):
    """The derivative of one result by one number.

    Value of the result, of the number, derivative in their units, elasticity (per cent by per cent; NaN where one of
    them is 0), the error of the derivative, and the way to it.
    """

    of: str
    by: str
    result: float
    number: float
    derivative: float
    elasticity: float
    error: float
    way: str


@overload
def sensitivity(scene: SceneLike, of: Sequence[str], by: Sequence[str], motion: bool = False) -> list[Derivative]: ...


@overload
def sensitivity(scene: str | Path, of: str) -> list[Influence]: ...


def sensitivity(scene: Any, of: Any, by: Sequence[str] | None = None, motion: bool = False) -> Any:
    """Derivatives of results of an equilibrium, or of a motion, by numbers of the scene.

    Without `by`, what each variable of a study does to the result `of` (`hybrid.studies.cases`).

    of: results such as `tension@0` (at s, m), `max curvature`, `position.z@125`, `reaction_end.x`; of named lines
    `east/tension@end`, `max hose/curvature`.  by: keys of numbers such as `cable.sections[0].length`.  Friction of the
    bed is left out.  motion: of a run with friction, of results such as `max tension@end` (`hybrid.designs.in_motion`),
    with errors of the way to them.  SceneError: a key or result that the scene does not have, or what has
    no derivative; ComputationError: no equilibrium, or runs that do not go on as the one between them.
    """
    if by is None:
        return of_study(scene, of)
    asked = as_scene(scene)
    for key in by:
        refuse_computing(key)
    numbers = [number_of(asked, key) for key in by]
    edges = [] if motion else [k for k, x in enumerate(of) if is_edge(asked, x)]
    if motion:
        values, found, errors, ways = in_motion(asked, of, by)
    else:
        fine = at_rest(asked, of)
        values, found, ways = fine.values, fine.by(by), len(by) * (way_at_rest(asked, fine),)
        errors = OF_DIFFERENCE * np.abs(found - at_rest(asked, of, 2.0).by(by))
        errors = np.maximum(errors, fine.off_by_contact(by, found))
        if asked.environment.seabed is not None:  # there it goes up and down with the cells: two may be alike by chance
            errors = np.maximum(errors, ON_BED * np.abs(found))
        if edges:
            names = [of[k] for k in edges]
            if lost := [of[k] for k in edges if not math.isfinite(values[k])]:
                raise ComputationError(Outcome.NOT_REACHED, None, None, f"{lost[0]} has no value in the equilibrium")
            for i, key in enumerate(by):
                each = by_cells(asked, fine, key, lambda x: at_rest(x, names, 1.0, fine.places).values)
                found[i, edges], errors[i, edges] = each
    out = []
    for i, (key, number) in enumerate(zip(by, numbers, strict=True)):
        for k, name in enumerate(of):
            value, result = float(found[i, k]), float(values[k])
            elastic = value * number / result if result != 0.0 and number != 0.0 else math.nan
            way = BY_CELLS if k in edges else ways[i]
            out.append(Derivative(name, key, result, number, value, elastic, float(errors[i, k]), way))
    return out


def way_at_rest(asked: Scene, rest: NetworkAtRest) -> str:
    """The way to derivatives at rest, with what is left out of them, and lines that have only begun to touch."""
    bed = asked.environment.seabed
    rubs = [bed and bed.friction, *(y.friction for y in asked.obstacles.values())]
    contact = rest.contact
    if contact is not None:
        between = asked.contact.friction if asked.contact is not None else 0.0
        rubs += [between, *(x.contact.friction for x in asked.lines.values())]
    begun = [f"lines {a} and {b} begin to touch" for a, b in contact.begins] if contact is not None else []
    return ", ".join([AT_REST, *(["friction left out"] if any(rubs) else []), *begun])


# --- shares of the spread of a study -----------------------------------------------------------

# Part of the variance that the line through the mean has to explain: a tenth is left to curves and interactions.
LINEAR = 0.9
# Correlation of two variables that are no longer independent, where chance makes it in fewer than this part of samples.
TOGETHER, BY_CHANCE = 0.3, 0.01
# What a run calls what is kept, where a result of a derivative is called otherwise.
ENDS = {"end_force_start": "reaction_start", "end_force_end": "reaction_end"}
IN_MOTION = {"max": "max", "min": "min", "mean": "mean", "deviation": "std"}


class Share(NamedTuple):
    """What one variable makes of the spread of a result.

    derivative: at the mean of the cases, in the unit of the result by that of the variable; share: of the variance of
    the linear result; low, high: between what its first-order index of Sobol is (all three NaN: not claimed); first,
    total: indices of Sobol of a design for these, else NaN.
    """

    variable: str
    derivative: float
    share: float
    low: float
    high: float
    first: float
    total: float


class Shares(NamedTuple):
    """Shares of a result, the largest first; R² of the linear result over so many cases; why nothing is claimed, or "".

    of: the result as `hybrid.sensitivity` names it.
    """

    result: str
    unit: str
    of: str
    rows: tuple[Share, ...]
    r2: float
    cases: int
    why: str


def shares(study: str | Path, result: str) -> Shares:
    """What part of the spread of a result each variable of a study makes, by derivatives at the mean of its cases.

    study: the folder of its results, which keeps the answer for `hybrid report`; result: a number that was kept of each
    run: the largest or smallest value, of a motion mean and deviation as well, at one place or of all.  It takes an
    equilibrium, or of motions a run and four for each variable.  Shares are given where the line through the mean
    explains 0.9 of the variance of the cases and variables are independent (`why` says what is against it).

    SceneError: a result or variable without a derivative; ResultError: a study without such a result, or of too few
    cases; ComputationError: no equilibrium at the mean, or runs beside that do not go as the one there.
    """
    found = result_of(study, result)
    stored = json.loads(found.data.attrs["study"])
    changed = [x for x, digest in json.loads(found.data.attrs["files"]).items() if digest_of(x) != digest]
    if changed:
        raise ResultError(
            f"{', '.join(changed)} has changed since {study} was computed: derivatives would be of another"
        )
    names = _variables(found, stored)
    x = np.stack([found.data[name].values[found.done] for name in names], axis=1)
    row = stored["rows"][int(found.done.argmax())] | dict(zip(names, x.mean(axis=0).tolist(), strict=True))
    scene = scene_of(stored["base"], stored["keys"], row)
    text = _derived_from(found, result, bool(stored["static"]))
    g = _slopes(scene, text, {name: stored["keys"][name] for name in names}, bool(stored["static"]))
    made = _shares(found, result, text, names, x, g, _indices(study, result, found))
    path = Path(study).resolve()
    with locked(path):
        StudyFile(path).keep("shares", {result: made._asdict() | {"rows": [x._asdict() for x in made.rows]}})
    return made


def _variables(found: StudyResult, stored: Mapping[str, Any]) -> list[str]:
    """Variables that differ among the cases; SceneError: one of them is no number."""
    names = []
    for name, keys in stored["keys"].items():
        column = found.data[name].values[found.done]
        if not keys or len(set(column.tolist())) == 1:
            continue
        if column.dtype.kind != "f":
            expected = "variables that are numbers, by which a result has derivatives"
            raise SceneError([Complaint("vary", name, expected, "a study of one of its values")])
        names.append(name)
    return names


def _derived_from(found: StudyResult, result: str, static: bool) -> str:
    """A result of a study as `hybrid.sensitivity` names it; SceneError: it has no derivative."""
    if "collect" not in found.data.attrs:
        raise ResultError("the study is of a release that did not write what is kept\n    try:      --overwrite")
    wanted = {name: Kept.model_validate(x) for name, x in json.loads(found.data.attrs["collect"]).items()}
    name, take = names_of(wanted)[result]
    kept = wanted[name]
    quantity = ALIASES.get(kept.quantity, kept.quantity)
    places = kept.at if isinstance(kept.at, tuple) else () if kept.at is None else (kept.at,)
    known = ("max", "min") if static else tuple(IN_MOTION)
    if take not in known or len(places) > 1 or (kept.times is not None and not static):
        what = f"{take} of {kept.quantity}{' in a part of the time' if kept.times is not None else ''}"
        expected = f"{', '.join(known)} at one place or of all, of the whole time, which have derivatives"
        raise SceneError([Complaint(f"collect.{name}", what, expected, "indices of Sobol: sample: {method: saltelli}")])
    line = f"{kept.line}/" if kept.line is not None else ""
    place = "" if not places else f"@{places[0]!r}"
    whole = f"{line}{ENDS.get(quantity, quantity)}{place}"
    if static:
        along = quantity in PROBES and "s" in PROBES[quantity].dims
        return f"{take} {whole}" if along and not places else whole
    return f"{IN_MOTION[take]} {whole}"


def _slopes(scene: AnyScene, text: str, keys: Mapping[str, list[str]], static: bool) -> Floats:
    """(P,) derivatives of a result by variables, each of which sets its keys."""
    each = [key for group in keys.values() for key in group]
    if static:
        refuse_edges(scene, [text])
        by_key = at_rest(scene, [text]).by(each)[:, 0]
    else:
        by_key = in_motion(scene, [text], each).derivatives[:, 0]
    owner = np.repeat(np.arange(len(keys)), [len(group) for group in keys.values()])
    return np.asarray(np.bincount(owner, by_key, len(keys)), float)


def _indices(study: str | Path, result: str, found: StudyResult) -> dict[str, tuple[float, float]]:
    """First-order and total indices of Sobol by variable, of a design for them of which all cases are done."""
    if found.method != DESIGNS[0] or not found.done.all():
        return {}
    with suppress(ResultError):  # a design that only_if has cut, or that lists cross
        return {x.variable: (x.first, x.total) for x in of_study(study, result)}
    return {}


def _shares(
    found: StudyResult,
    result: str,
    text: str,
    names: list[str],
    x: Floats,
    g: Floats,
    indices: Mapping[str, tuple[float, float]],
) -> Shares:
    """x: (cases, P) values of variables; g: (P,) derivatives."""
    y = found.values[found.done]
    parts, spread = np.abs(g) * x.std(axis=0), float(y.std())
    left = (y - y.mean()) - (x - x.mean(axis=0)) @ g
    r2 = 1.0 - float(left.var()) / spread**2 if spread > 0.0 else math.nan
    why = _against(x, names, r2)
    rows = []
    for name, slope, part in zip(names, g.tolist(), parts.tolist(), strict=True):
        share = low = high = math.nan
        if not why:
            off = math.sqrt(max(1.0 - r2, 0.0))
            share = part**2 / float(parts @ parts)
            low, high = max(part / spread - off, 0.0) ** 2, min((part / spread + off) ** 2, 1.0)
        rows.append(Share(name, slope, share, low, high, *indices.get(name, (math.nan, math.nan))))
    order = np.argsort(-parts, kind="stable")
    unit = str(found.data[result].attrs.get("units", ""))
    return Shares(result, unit, text, tuple(rows[k] for k in order), r2, int(y.size), why)


def _against(x: Floats, names: list[str], r2: float) -> str:
    """Why shares are not claimed; "": nothing is against it."""
    if not math.isfinite(r2):
        return "the result is the same in all cases"
    for i in range(len(names)):
        for k in range(i):
            related = pearsonr(x[:, k], x[:, i])
            if abs(related.statistic) > TOGETHER and related.pvalue < BY_CHANCE:
                return f"{names[k]} and {names[i]} are not independent: their correlation is {related.statistic:.2f}"
    if r2 < LINEAR:
        return f"the line through the mean explains {max(r2, 0.0):.2f} of the variance (R²), less than {LINEAR:g}"
    return ""
