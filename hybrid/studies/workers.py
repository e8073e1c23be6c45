"""What runs on a worker of a study, and what it keeps.

A worker runs a batch of cases, and keeps numbers, histories and profiles of each, with units.
"""

from __future__ import annotations

import os
import re
import time as clock
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hybrid.accuracy.passes import run, static
from hybrid.errors import EVENTS_BY_WEIGHT, HybridError, ResultError, SceneError
from hybrid.scene.study import LIMIT_OF, Kept
from hybrid.simulation.own_parts import RunPart
from hybrid.statistics import moments
from hybrid.store.envelope import extreme, farthest
from hybrid.store.histories import History, extreme_of, history_of, lies_along
from hybrid.store.limits import at_every_step
from hybrid.store.reader import Result
from hybrid.store.study_file import DONE, FAILED, NOT_WRITTEN, OWN, Column, StudyFile, accuracy_of_case
from hybrid.store.tables import too_far_apart
from hybrid.store.verdicts import section_limits
from hybrid.studies.cases import scene_of

Floats = np.ndarray
HOUR = 3600.0  # s
# What is kept where a study does not say: name, quantity, what of it.
USUAL: dict[str, tuple[str, tuple[str, ...]]] = {
    "end_force_start": ("end_force_start", ("max", "min", "mean", "deviation")),
    "end_force_end": ("end_force_end", ("max", "min", "mean", "deviation")),
    "tension": ("tension", ("max", "min")),
    "curvature": ("curvature", ("max",)),
}
AT_REST: dict[str, tuple[str, tuple[str, ...]]] = {
    "tension": ("tension", ("max", "min", "profile")),
    "curvature": ("curvature", ("max",)),
}
# Of a summary, and its unit; none: that of the quantity.
OF_SUMMARY: dict[str, tuple[str, str | None]] = {"mean": ("mean", None), "deviation": ("standard_deviation", None)}
OF_SUMMARY |= {"skewness": ("skewness", ""), "period": ("crossing_period", "s")}
OF_SUMMARY |= {"significant": ("significant_range", None)}
WORDS = {"max": "largest", "min": "smallest", "mean": "mean of", "median": "median of", "skewness": "skewness of"}
WORDS |= {"deviation": "standard deviation of", "period": "period between up-crossings of the mean of"}
WORDS |= {"significant": "significant range of", "extreme": "most probable maximum (MPM) of", "history": "history"}
WORDS |= {"fractile": "P90 of the maximum of", "damage": "fatigue damage", "exceedance": "part of the time"}
WORDS |= {"utilisation": "largest part that is used of", "profile": "largest at each place"}


class Variable(NamedTuple):
    """One thing that is kept: its unit, what it is, its dimensions beside `case`, and their coordinates with units."""

    unit: str
    description: str
    dims: tuple[str, ...]
    coordinates: Mapping[str, tuple[str, Floats]]


def usual(static: bool, lines: Sequence[str] = ()) -> dict[str, Kept]:
    """What is kept where a study does not say; lines: names of several lines, of each of which it is kept."""
    table = AT_REST if static else USUAL
    if not lines:
        return {name: Kept(quantity=q, take=take) for name, (q, take) in table.items()}
    return {
        re.sub(r"\W", "_", f"{line}_{name}"): Kept(quantity=q, take=take, line=line)
        for line in lines
        for name, (q, take) in table.items()
    }


def names_of(wanted: Mapping[str, Kept]) -> dict[str, tuple[str, str]]:
    """Names under which things are kept: of which entry of `collect`, and what is taken."""
    found: dict[str, tuple[str, str]] = {}
    for name, kept in wanted.items():
        for take in kept.take:
            found[f"{name}_{take}" if len(kept.take) > 1 or take in ("history", "profile") else name] = (name, take)
    return found


def one_value_of(quantity: str) -> str:
    """What to keep instead of a quantity that has several values at a time."""
    if quantity in ("touchdown", "touchdown_position"):
        return "output.quantities of the scene: {td: {kind: touchdown, end: end}}, and collect td"
    return "end_force_end, or one of output.quantities of the scene"


class NotAlwaysThere(ResultError):
    """A quantity of this run has times without a value, or a value that is not verified.

    Such as a touchdown point while nothing touches.
    """


class Collected(NamedTuple):
    """What is kept of a result, and the reasons for what is not, by name.

    absent: the first reason that has nothing to do with the values of this run, such as a quantity that it does not
    have; "": there is none.
    """

    kept: dict[str, tuple[Variable, Floats]]
    reasons: dict[str, str]
    absent: str


def collected(result: Result, wanted: Mapping[str, Kept]) -> Collected:
    """What is wanted of a result, by name: `<name>_<take>`, or the name alone where one thing is taken."""
    kept: dict[str, tuple[Variable, Floats]] = {}
    reasons, absent = {}, ""
    memory: dict[tuple[str, str], Any] = {}
    for key, (name, take) in names_of(wanted).items():
        try:
            of = result if wanted[name].line is None else result.line(str(wanted[name].line))
            kept[key] = _taken(of, name, wanted[name], take, memory)
        except (HybridError, KeyError, AttributeError) as error:
            reasons[key] = str(error).splitlines()[0]
            if not isinstance(error, NotAlwaysThere):
                absent = absent or reasons[key]
    return Collected(kept, reasons, absent)


def _taken(
    result: Result, own: str, kept: Kept, take: str, memory: dict[tuple[str, str], Any]
) -> tuple[Variable, Floats]:
    """One thing that is kept of a result under the name `own`; its times and places are dimensions of that name.

    memory: the history under a name and its summary, for the next thing that is taken of it.
    """
    name, at = kept.quantity, None if kept.at is None else np.atleast_1d(np.asarray(kept.at, float))
    if take in ("max", "min") and at is None and kept.times is None:
        known = _over_steps(result, name, take)
        if known is not None:
            unit = result.units[name if name in result else f"envelope/{name}_{take}"]
            return Variable(unit, f"{WORDS[take]} {name}, every step", (), {}), np.asarray(known)
    if take == "utilisation":
        limit = LIMIT_OF[name]
        return Variable("", f"{WORDS[take]} {limit}, every step", (), {}), np.asarray(_utilisation(result, name, limit))
    if take == "damage":
        return _damage(result, own, kept, at)
    if at is not None and not lies_along(result, name):
        raise ResultError(f"'{name}' has no value at an arc length")
    history = memory.get((own, "history")) or history_of(result, name, kept.times, at)
    memory[own, "history"] = history
    if history.values.ndim > (1 if history.s is None else 2):
        count, fix = history.values[0].size, one_value_of(name)
        raise ResultError(f"'{name}' has {count} values at a time, and one is kept\n    try:      {fix}")
    dims, places = ((), {}) if at is None or history.s is None else _places(own, history.s)
    unit, about = history.unit, f"{name}, {history.basis}"
    values = history.values
    if take == "profile":
        return _profile(history, name, "s" if kept.line is None else f"{own}_s", f"{WORDS[take]}: {about}")
    if take == "history":
        if history.s is not None and at is None:
            raise ResultError(f"a history of '{name}' is at a place\n    try:      at: [0]")
        time = f"{own}_time"
        axes = {time: ("s", history.t)} | places
        return Variable(unit, about, (time, *dims), axes), values if dims else values.reshape(-1)
    flat = values.reshape(history.t.size, -1)
    if take not in ("max", "min") and not np.isfinite(flat).all():
        raise NotAlwaysThere(f"'{name}' has times or places without a value, and {take} needs all of them")
    text = f"{WORDS[take]} {about}"
    if take in ("extreme", "fractile"):
        found = [_extreme(result, history, flat[:, k], kept.hours, take) for k in range(flat.shape[1])]
        return _placed(Variable(unit, f"{text} ({kept.hours:g} h)", dims, places), np.array(found))
    if take in ("max", "min"):
        worst = (np.fmax if take == "max" else np.fmin).reduce(flat, axis=0)
        return _placed(Variable(unit, text, dims, places), worst, take)
    if take == "exceedance":
        side, value = ("above", kept.above) if kept.above is not None else ("below", kept.below)
        text = f"{WORDS[take]} {side} {value:g} {unit}: {about}"
        part = moments.exceedance(history.t, flat, kept.above, kept.below)
        return _placed(Variable("", text, dims, places), part)
    if take == "median":
        return _placed(Variable(unit, text, dims, places), moments.median_over_time(history.t, flat))
    attribute, other = OF_SUMMARY[take]
    summary = memory.get((own, "summary")) or moments.summary(history.t, flat)
    memory[own, "summary"] = summary
    variable = Variable(unit if other is None else other, text, dims, places)
    return _placed(variable, getattr(summary, attribute))


def _profile(history: History, name: str, along: str, label: str) -> tuple[Variable, Floats]:
    """The largest values along the line, over the dimension `along`."""
    if history.s is None:
        raise ResultError(f"'{name}' has no profile: it is no quantity along the line")
    s, values = _once(history.s, np.fmax.reduce(history.values, axis=0))
    return Variable(history.unit, label, (along,), {along: ("m", s)}), values


def _once(s: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Places (n,) m and values (n,) there; of two at one place the larger: all that lies along a line has one axis."""
    first = np.flatnonzero(np.insert(np.diff(s) > 0.0, 0, True))
    return s[first], np.fmax.reduceat(values, first)


def _over_steps(result: Result, name: str, take: str) -> float | None:
    """The largest or smallest value over every step, NaN without one; None: the result knows that of outputs only."""
    if f"envelope/{name}_{take}" in result:
        farther = (farthest if name in result else extreme)(result, name, take)
        return np.nan if farther is None else farther.value
    known = at_every_step(result, name, "largest" if take == "max" else "smallest")
    return None if known is None else known[0]


def _utilisation(result: Result, name: str, limit: str) -> float:
    """The used part of a limit of sections, over every step."""
    judged = next((x for x in section_limits(result) if x.limit == limit), None)
    if judged is None:
        raise ResultError(f"no section has a {limit}, which {name} would be held against")
    if judged.used is None:
        raise NotAlwaysThere(f"utilisation of {limit} {judged.not_verified}")
    return judged.used


def _damage(result: Result, own: str, kept: Kept, at: Floats | None) -> tuple[Variable, Floats]:
    """Fatigue damage along the line, or at the arc lengths `at`, m."""
    assert kept.curve is not None
    s, damage = result.damage(kept.curve, strength=kept.strength, section=kept.section, times=kept.times, at=at)
    if few := too_far_apart(result, float(s[np.argmax(damage)]), kept.times):
        raise NotAlwaysThere(few)
    text = f"fatigue damage by {kept.curve}"
    if at is None:
        along = "s" if kept.line is None else f"{own}_s"
        s, damage = _once(s, damage)
        return Variable("", text, (along,), {along: ("m", s)}), damage
    dims, places = _places(own, s)
    return Variable("", text, dims, places), damage if dims else damage[0]


def _places(own: str, s: Floats) -> tuple[tuple[str, ...], dict[str, tuple[str, Floats]]]:
    """Dimension and coordinate of several places s (m); none of one.  Where a quantity jumps a place comes twice."""
    return ((), {}) if s.size == 1 else ((f"{own}_at",), {f"{own}_at": ("m", s)})


def _extreme(result: Result, history: History, x: Floats, hours: float, take: str) -> float:
    """NaN where there are too few peaks, of round-off, and beyond what an angle can be."""
    try:
        found = extreme_of(result, history.name, history.unit, history.t, x, hours * HOUR)
    except ResultError:
        return np.nan
    return found.most_probable if take == "extreme" else found.fractile


def _placed(variable: Variable, values: Floats, take: str = "max") -> tuple[Variable, Floats]:
    """Values (n,) at the places that are wanted; without any the largest of all (of smallest values the smallest)."""
    if variable.dims:
        return variable, values
    known = values[np.isfinite(values)]
    return variable, np.asarray((known.min() if take == "min" else known.max()) if known.size else np.nan)


# How the reason of a case begins that was computed, and of which something could not be kept.
NOT_KEPT = "not kept: "


class Job(NamedTuple):
    """What a worker needs to know of a batch: the scene, the keys, and the rows of its cases."""

    base: Mapping[str, Any]
    keys: Mapping[str, tuple[str, ...]]
    rows: list[dict[str, Any]]
    wanted: Mapping[str, Kept]
    static: bool
    first: int = 0  # number of the first case
    files: str = ""  # folder for whole results; "": they are not kept
    parts: Sequence[RunPart] = ()  # of all runs, of the user's own


class Outcome(NamedTuple):
    """Of one case: status, reason, events, s of processor time, steps, what was kept, and the accuracy it met.

    absent: why something can be kept of no run like this one; "": it can.  accuracy_verdict, accuracy_used: of what
    was asked, as of `accuracy_of_case`.
    """

    status: int
    reason: str
    events: str
    cpu: float
    steps: int
    kept: dict[str, tuple[Variable, np.ndarray]]
    absent: str = ""
    accuracy_verdict: str = ""
    accuracy_used: float = np.nan


def compute_batch(job: Job) -> list[Outcome]:
    """Compute the cases of a batch, one after the other, in one thread."""
    os.environ["HYBRID_THREADS"] = "1"
    return [_computed(job, row, job.first + k) for k, row in enumerate(job.rows)]


def _computed(job: Job, row: dict[str, Any], case: int) -> Outcome:
    begin = clock.process_time()
    try:
        scene = scene_of(job.base, job.keys, row)
        target = Path(job.files) / f"case-{case:06d}.h5" if job.files else None
        result = static(scene, target) if job.static else run(scene, target, parts=job.parts)
    except SceneError as error:
        first = error.complaints[0]
        reason = f"refused: {first.where}: given {first.value}, expected {first.expected}"
        return Outcome(FAILED, reason, "", clock.process_time() - begin, -1, {})
    except HybridError as error:
        around = NOT_WRITTEN if isinstance(error, ResultError) else ""
        return Outcome(FAILED, around + str(error).splitlines()[0], "", clock.process_time() - begin, -1, {})
    except (ArithmeticError, ValueError, LookupError, TypeError, AssertionError) as error:
        return Outcome(FAILED, f"a bug: {type(error).__name__}: {error}", "", clock.process_time() - begin, -1, {})
    spent = clock.process_time() - begin
    with result:
        kinds = {event.kind for event in result.events}
        events = ", ".join([*(k for k in EVENTS_BY_WEIGHT if k in kinds), *sorted(kinds - set(EVENTS_BY_WEIGHT))])
        logged = next(x for _, x in result.each_line())
        steps = len(logged["steps/t"]) if "steps/t" in logged else 0
        found = collected(result, job.wanted)
        why = "; ".join(f"{name}: {reason}" for name, reason in found.reasons.items())
        status = DONE if found.kept else FAILED
        met = accuracy_of_case(result)
        return Outcome(status, NOT_KEPT * bool(why) + why, events, spent, steps, found.kept, found.absent, *met)


# Outcomes of the cases of a batch as columns of a study.


def has_something_new(file: StudyFile, outcomes: list[Outcome]) -> bool:
    """Whether a case of a batch keeps something that no case of the study has kept before."""
    return any(name not in file for one in outcomes for name in one.kept)


def write_outcomes(file: StudyFile, batch: int, outcomes: list[Outcome]) -> None:
    """Outcomes of a batch as columns; arrays that do not fit those of the study are left out, with the reason."""
    shapes: dict[str, tuple[int, ...]] = {}
    variables: dict[str, Variable] = {}
    coordinates: dict[str, Column] = {}
    fitting = []
    for one in outcomes:
        kept, why = dict(one.kept), []
        for name, (variable, values) in one.kept.items():
            if not _fits(file, shapes, coordinates, name, variable, values):
                why.append(f"{name}, whose times or places are not those of the cases before")
                del kept[name]
        if why:
            before = [one.reason.removeprefix(NOT_KEPT)] if one.reason else []
            one = one._replace(reason=NOT_KEPT + "; ".join(before + why), kept=kept)
        for name, (variable, _) in one.kept.items():
            variables.setdefault(name, variable)
        fitting.append(one)
    columns: dict[str, Column] = {}
    for name, variable in variables.items():
        values = np.full((len(fitting), *shapes[name]), np.nan)
        for k, one in enumerate(fitting):
            if name in one.kept:
                values[k] = one.kept[name][1]
        columns[name] = Column(variable.unit, variable.description, variable.dims, values)
    for name, (unit, text, kind, _) in OWN.items():
        array = np.array([getattr(one, name) for one in fitting], dtype=object if kind is str else kind)
        columns[name] = Column(unit, text, (), array)
    file.add(batch, columns, coordinates)


def _fits(
    file: StudyFile,
    shapes: dict[str, tuple[int, ...]],
    coordinates: dict[str, Column],
    name: str,
    variable: Variable,
    values: np.ndarray,
) -> bool:
    """Whether an array has the shape, times and places of the study; those of the first one become the study's."""
    new = {}
    for dim, (unit, along) in variable.coordinates.items():
        known = coordinates[dim].values if dim in coordinates else file.coordinate(dim)
        if known is None:
            new[dim] = Column(unit, "arc length" if unit == "m" else "time", (), np.asarray(along, float))
        elif known.shape != np.shape(along) or not np.allclose(known, along, rtol=1e-9, atol=1e-12):
            return False
    if shapes.get(name, file.shape_of(name) if name in file else values.shape) != values.shape:
        return False
    shapes[name] = values.shape
    coordinates.update(new)
    return True
