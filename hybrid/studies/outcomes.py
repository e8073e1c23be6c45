"""Outcomes of the cases of a batch as columns of a study."""

from __future__ import annotations

import numpy as np

from hybrid.store.study_file import OWN, Column, StudyFile
from hybrid.studies.collect import Variable
from hybrid.studies.workers import NOT_KEPT, Outcome


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
