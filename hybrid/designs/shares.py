"""What part of the spread of a result of a study each variable makes, from derivatives where the mean of its cases is.

With independent variables of standard deviations σ, a result that is linear in them has the variance Σ (g σ)², and
(g σ)² over that is the part of each.  R² = 1 - var(y - g x)/var(y) over the cases that were computed says how linear it
is.  What is left over, (1 - R²) of the variance, bounds the first-order index S of Sobol: a conditional mean varies no
more than what it is the mean of, so that |√S - |g| σ/σ_y| <= √(1 - R²).
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import pearsonr

from hybrid.designs.in_motion import in_motion, refuse_edges
from hybrid.designs.network_at_rest import at_rest
from hybrid.designs.numbers import AnyScene
from hybrid.errors import Complaint, ResultError, SceneError
from hybrid.kernels.state.state import Floats
from hybrid.outputs.probes import PROBES
from hybrid.scene.study import Kept
from hybrid.store.hdf5_file import locked
from hybrid.store.records import ALIASES
from hybrid.store.study_file import StudyFile
from hybrid.studies.cases import DESIGNS, StudyResult, digest_of, result_of, scene_of, sensitivity
from hybrid.studies.workers import names_of

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
    row = stored["rows"][0] | dict(zip(names, x.mean(axis=0).tolist(), strict=True))
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
    return {x.variable: (x.first, x.total) for x in sensitivity(study, result)}


def _shares(
    found: StudyResult, result: str, text: str, names: list[str], x: Floats, g: Floats,
    indices: Mapping[str, tuple[float, float]],
) -> Shares:  # fmt: skip
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
