"""Derivatives of results at rest by numbers of the scene, from the factors of the equilibrium.

At an equilibrium R(q; p) = 0, so that  A dq/dp = dR/dp  with the matrix A of the modes (theory.md, 20): one solve for
each number, in place of two equilibria.  dR/dp is the change of the block rows of the same state between two lines, and
a result is differentiated along (dq, dp).
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple, overload

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from hybrid.accuracy.api import resolution_at_rest
from hybrid.errors import Complaint, ComputationError, Outcome, SceneError
from hybrid.kernels.algebra.block_elimination import SIZE, WIDTH
from hybrid.kernels.state.state import Floats, State
from hybrid.modal.matrices import ANCHOR, linear_line, rows_at_rest
from hybrid.model.build import Model, build
from hybrid.model.resolution import Resolution
from hybrid.outputs.probes import PROBES
from hybrid.scene.combinations import refuse_use
from hybrid.scene.read import SceneLike, as_scene_or_system, parse_either, scene_text
from hybrid.scene.schema import Scene
from hybrid.simulation.static_case import StaticCase
from hybrid.simulation.zone_switching import on_layout
from hybrid.solve.joined import JoinedLine
from hybrid.studies.sensitivity import Influence
from hybrid.studies.sensitivity import sensitivity as of_study

# Parts of a number by which lines and results are differentiated.
OF_LINE, OF_RESULT = 1e-5, 1e-4
# A number that is 0 is changed by this, in its own unit.
OF_NOTHING = 1e-6
# Error by that on half the cells, for results of second order; a fifth more, as of modes.
OF_DIFFERENCE = 0.4
NAME = re.compile(r"^(?:(max|min) )?([a-z_]+)(?:\.([xyz]))?(?:@(.+))?$")
AXES = "xyz"


class Derivative(NamedTuple):
    """What one result answers to one number: value of the result, of the number, derivative in their units, elasticity
    (per cent by per cent; NaN where one of them is 0), and the error of the derivative by the mesh."""

    of: str
    by: str
    result: float
    number: float
    derivative: float
    elasticity: float
    error: float


@overload
def sensitivity(scene: SceneLike, of: Sequence[str], by: Sequence[str]) -> list[Derivative]: ...


@overload
def sensitivity(scene: str | Path, of: str) -> list[Influence]: ...


def sensitivity(scene: Any, of: Any, by: Sequence[str] | None = None) -> Any:
    """Derivatives of results of the equilibrium of a cable by numbers of its scene.

    Without `by`, what each variable of a study does to the result `of` (`hybrid.studies.sensitivity`).

    of: results such as `tension@0` (at s, m), `max curvature`, `position.z@125`, `reaction_end.x`; by: keys of numbers
    such as `cable.sections[0].length`.  Friction of the bed is left out.  SceneError: a key or result that the scene
    does not have, or what has no derivative; ComputationError: no equilibrium.
    """
    if by is None:
        return of_study(scene, of)
    asked = cable_of(scene)
    wanted = [parse_result(x, asked.length) for x in of]
    numbers = [number_of(asked, key) for key in by]
    fine, coarse = (AtRest(asked, cells, wanted) for cells in (1.0, 2.0))
    out = []
    for key, number in zip(by, numbers, strict=True):
        found, rough = fine.by(key, number), coarse.by(key, number)
        for k, name in enumerate(of):
            value, result = float(found[k]), float(fine.values[k])
            elastic = value * number / result if result != 0.0 and number != 0.0 else math.nan
            out.append(
                Derivative(name, key, result, number, value, elastic, OF_DIFFERENCE * abs(value - float(rough[k])))
            )
    return out


def cable_of(scene: SceneLike) -> Scene:
    """The scene of one cable; SceneError: it is of several lines."""
    asked = as_scene_or_system(scene)
    if isinstance(asked, Scene):
        return asked
    refuse_use(asked, "derivatives", given="hybrid sensitivity")
    raise AssertionError("derivatives of several lines are refused by the table")


class Wanted(NamedTuple):
    """A result in parts: `max` or `min` of a quantity or "", its name, its component or "", and its place, m."""

    extreme: str
    name: str
    axis: str
    at: float | None


def parse_result(text: str, length: float) -> Wanted:
    """The parts of a result such as `position.z@125` of a cable of length m; SceneError: it is none."""
    found = NAME.match(text)
    expected = "NAME@S, NAME.x@S, max NAME or min NAME, such as tension@0 or max curvature"
    if found is None:
        raise SceneError([Complaint("of", text, expected, "tension@0")])
    extreme, name, axis, at = found.groups()
    try:
        s = None if at is None else float(at)
    except ValueError:
        raise SceneError([Complaint("of", text, expected, "a number of metres behind @")]) from None
    if s is not None and not 0.0 <= s <= length:
        raise SceneError([Complaint("of", text, f"an arc length between 0 and {length:g} m", f"{name}@{length:g}")])
    return Wanted(extreme or "", name, axis or "", s)


def number_of(scene: Scene, key: str) -> float:
    """The value of a key."""
    value: Any = scene.model_dump(mode="python")
    for part in re.findall(r"[^.\[\]]+", key):
        try:
            value = value[int(part)] if isinstance(value, list | tuple) else value[part]
        except (KeyError, IndexError, TypeError, ValueError):
            expected = "a key of the scene that has a number"
            raise SceneError([Complaint("by", key, expected, "cable.sections[0].length, for example")]) from None
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise SceneError([Complaint("by", key, f"a number, which {key} is not in this scene", "another key")])
    return float(value)


def changed_scene(scene: Scene, key: str, value: float) -> Scene:
    """The scene with another number at a key."""
    found, _ = parse_either(scene_text(scene), overrides=[f"{key}={float(value)!r}"])
    assert isinstance(found, Scene)
    return found


class AtRest:
    """The equilibrium on one mesh, its factors, and the values of results."""

    def __init__(self, scene: Scene, cells: float, wanted: Sequence[Wanted]) -> None:
        case = StaticCase(scene)
        resolution: Resolution = resolution_at_rest(case)
        self.scene, self.wanted = case.scene, wanted
        refuse_use(self.scene, "derivatives", given="hybrid sensitivity")  # with the model that accuracy has chosen
        self.resolution = resolution.coarser(cells=cells) if cells > 1.0 else resolution
        self.case = case
        self.model, found = case.at_rest(self.resolution)
        if found.touch.size:
            expected = "an equilibrium in which the line does not touch itself"
            raise SceneError([Complaint("contact.self", "a line that touches itself", expected, "another shape")])
        self.found, self.state = found, found.state
        self.x = self._joined(self.model)
        linear = linear_line(self.x, "cable", self.state, False)
        self.line, self.free = linear.line, np.flatnonzero(linear.free)
        self.factors = splu(sparse.csc_array(linear.stiffness[self.free][:, self.free]))
        self.values = self._results(self.model, self.state)

    def number(self, key: str) -> float:
        """The value of a key of the scene."""
        return number_of(self.scene, key)

    def _joined(self, model: Model) -> JoinedLine:
        sea, ends = model.sea.at(np.inf), model.ends.at(np.inf)
        return JoinedLine(model.line, sea, ends, model.length, model.tension_scale, -np.inf, (-1, -1))

    def _with(self, key: str, value: float) -> Model:
        model, here = build(changed_scene(self.scene, key, value), self.resolution), self.model.layout
        if model.layout is not None and here is not None and np.array_equal(model.layout.parts, here.parts):
            model = on_layout(model, model.layout._replace(rod=here.rod, here=here.here))  # zones stay what they are
        if model.line.s.size != self.model.line.s.size:
            detail = f"{key}: a change of it changes the number of cells; give `mesh: {{cells: ..}}`"
            raise ComputationError(Outcome.NOT_CONVERGED, None, None, detail)
        return model

    def _moved(self, model: Model) -> State:
        """The state with its held ends where another model has them."""
        state, ends = self.state.copy(), model.ends.at(np.inf)
        for k in (0, 1):
            if ends.held[k]:
                shift = ends.position[k] - state.r[-k]
                state.r[-k] += shift
                state.e[-k] += shift if k else -shift
        return state

    def _left(self, model: Model) -> tuple[Floats, Floats]:
        """Right-hand side (5 (N+1),) of the equations of another line at this state; places (2, 3) of its ends."""
        state, x = self._moved(model), self._joined(model)
        line = model.line._replace(bits=self.line.bits, law_at=self.line.law_at)
        rows = np.zeros((line.s.size, SIZE * WIDTH))
        rows_at_rest(line, x, x.ends, state, (0.0, ANCHOR), rows)
        right = rows.reshape(-1, SIZE, WIDTH)[:, :, -1].copy()
        right[:, 1:] *= -1.0
        return right.ravel(), state.r[[0, -1]].copy()

    def by(self, key: str, number: float) -> Floats:
        """Derivatives of all results by a number."""
        step = OF_LINE * abs(number) or OF_NOTHING
        (above, ends_above), (below, ends_below) = (self._left(self._with(key, number + d)) for d in (step, -step))
        right = (above - below) / (2.0 * step)
        q = np.zeros((self.line.s.size, SIZE))
        q.ravel()[self.free] = self.factors.solve(right[self.free])
        for k in (0, 1):
            if self.x.ends.held[k]:
                q[-k, 1:4] = (ends_above[k] - ends_below[k]) / (2.0 * step)
        step = OF_RESULT * abs(number) or OF_NOTHING
        both = [self._results(self._with(key, number + d), _along(self.state, q, d)) for d in (step, -step)]
        return (both[0] - both[1]) / (2.0 * step)

    def _results(self, model: Model, state: State) -> Floats:
        values = self.case.values_at(model, state, self.found, [x.at for x in self.wanted if x.at is not None])
        return np.array([self._result(x, *values) for x in self.wanted])

    def _result(self, wanted: Wanted, s: Floats, values: dict[str, Floats]) -> float:
        if wanted.name not in values:
            names = ", ".join(sorted(x for x in values if "/" not in x))
            raise SceneError([Complaint("of", wanted.name, f"one of {names}", "tension@0")])
        value, dims = np.asarray(values[wanted.name], float), PROBES[wanted.name].dims if wanted.name in PROBES else ()
        if dims[-1:] == ("xyz",):
            value = value[..., AXES.index(wanted.axis)] if wanted.axis else np.linalg.norm(value, axis=-1)
        if "edge" in dims:  # where contact begins and ends: the last of them
            value = np.append(np.nan, value[np.isfinite(value)])[-1]
        if "s" not in dims:
            return float(value)
        if wanted.extreme:
            return float(value.max() if wanted.extreme == "max" else value.min())
        if wanted.at is None:
            raise SceneError(
                [Complaint("of", wanted.name, "a place or an extreme", f"{wanted.name}@0, max {wanted.name}")]
            )
        return float(np.interp(wanted.at, s, value))


def _along(state: State, q: Floats, step: float) -> State:
    """A state moved by step times q (N+1, 5)."""
    out = state.copy()
    shift = step * q[:, 1:4]
    out.r[:] += shift
    out.e[:] += np.diff(shift, axis=0)
    out.T[:] += step * q[1:, 0]
    d = out.e / np.linalg.norm(out.e, axis=1)[:, None]
    a = out.a1 - np.einsum("ij,ij->i", out.a1, d)[:, None] * d
    a = a + step * q[:-1, 4][:, None] * np.cross(d, a)
    out.a1[:] = a / np.maximum(np.linalg.norm(a, axis=1), 1e-300)[:, None]
    return out
