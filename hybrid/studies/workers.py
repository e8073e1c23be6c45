"""What runs on a worker of a study: a batch of cases, and what is kept of each."""

from __future__ import annotations

import os
import time as clock
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hybrid.accuracy.api import run, static
from hybrid.errors import EVENTS_BY_WEIGHT, HybridError, ResultError, SceneError
from hybrid.scene.study import Kept
from hybrid.simulation.own_parts import RunPart
from hybrid.store.study_file import DONE, FAILED, NOT_WRITTEN, OWN, Column, StudyFile, accuracy_of_case
from hybrid.studies.cases import scene_of
from hybrid.studies.collect import Variable, collected

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
    file: StudyFile, shapes: dict[str, tuple[int, ...]], coordinates: dict[str, Column], name: str, variable: Variable,
    values: np.ndarray,
) -> bool:  # fmt: skip
    """Whether an array has the shape, times and places of the study; those of the first one become the study's."""
    new = {}
    for dim, (unit, along) in variable.coordinates.items():
        known = coordinates[dim].values if dim in coordinates else file.coordinate(dim)
        if known is None:
            new[dim] = Column(unit, "arc length" if unit == "m" else "time", (), np.asarray(along, float))
        elif known.shape != np.shape(along) or not np.allclose(known, along, rtol=1e-9, atol=1e-12):
            return False
    if shapes.get(name, values.shape) != values.shape:
        return False
    shapes[name] = values.shape
    coordinates.update(new)
    return True
