"""Derivatives of results at rest by numbers of the scene, with the error of their mesh."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple, overload

import numpy as np

from hybrid.designs.in_motion import WAY as BY_CELLS
from hybrid.designs.in_motion import by_cells, in_motion, is_edge
from hybrid.designs.network_at_rest import NetworkAtRest, at_rest
from hybrid.designs.numbers import number_of, refuse_computing
from hybrid.errors import ComputationError, Outcome
from hybrid.scene.read import SceneLike, as_scene
from hybrid.scene.root import Scene
from hybrid.studies.cases import Influence
from hybrid.studies.cases import sensitivity as of_study

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
