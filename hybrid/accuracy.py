"""How wrong a result is, and how finely to compute for an accuracy that was asked for.

Three runs say it: one on a coarser mesh shows what the mesh does, one more with longer steps what the steps do.  Where
an accuracy is asked for, cells and steps of the next run follow from what was found; the last run is the result.
docs/accuracy.md
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from math import sqrt

import numpy as np

from hybrid.errors import ComputationError
from hybrid.model.build import Model
from hybrid.model.effort import Asked, Effort
from hybrid.model.grade import Grading, grading
from hybrid.model.state import Floats

# The order that errors are taken to fall with.  A smooth motion has 2, contact and blows have 1; of 1.5 the figure is
# 1.6 times too large for the first and half as large as it should be for the second.
ORDER = 1.5
# Times as long as others that steps must be to tell from both what the step does.
LEAST_RATIO = 1.1
# Coarser runs have cells and steps so many times as long.
COARSER = 2.0
# Part of what is asked that the next run aims at.
AIM = 0.7
# Runs that may follow the first result; each is at most this much finer.
MOST_RUNS, MOST_FINER = 3, 5.0
# What a run is compared by, as names of outputs; those that are not there are left out.
COMPARED = ("position", "tension", "curvature", "bending_moment", "reaction_start", "reaction_end")
PULLS = {"reaction_start": "pull_start", "reaction_end": "pull_end"}
# The run that looks how the cable bends: cells and steps so many times as long as those of the first result.
SURVEY_CELLS, SURVEY_STEPS, SURVEY_POINTS = 1.0, 4.0, 201


@dataclass(frozen=True)
class Sketch:
    """What is compared of a run: how finely it was computed, and its outputs (nt, ...) by name."""

    effort: Effort
    values: Mapping[str, np.ndarray]
    steps: int
    cpu: float  # s
    every: int = 1  # outputs of the result to one of these; the last is there always
    unresolved: bool = False  # whether a bend was sharper than its cells can show
    model_error: Mapping[str, np.ndarray] = field(default_factory=dict)

    @property
    def step(self) -> float:
        """Mean step, in parts of the run."""
        return 1.0 / max(self.steps, 1)

    def at(self, name: str, every: int) -> np.ndarray:
        """An output at one of so many times."""
        values = self.values[name]
        return values[_thin(len(values), every // self.every)]

    @property
    def pull(self) -> float:
        """The largest force at the ends, N."""
        return max(
            (float(np.linalg.norm(self.values[x], axis=1).max()) for x in PULLS if x in self.values), default=0.0
        )


@dataclass(frozen=True)
class Errors:
    """Estimated errors of a run: kind ("mesh", "time", "total") -> output -> size (nt, ...) of the error."""

    fields: Mapping[str, Mapping[str, np.ndarray]]

    def largest(self, kind: str, name: str) -> float:
        """Largest error of an output; 0 where it is not estimated."""
        found = self.fields.get(kind, {}).get(name)
        return float(np.max(found, initial=0.0)) if found is not None else 0.0


def _thin(count: int, every: int) -> np.ndarray:
    """Numbers of every so many-th of `count` outputs, and of the last."""
    return np.unique(np.append(np.arange(0, count, every), count - 1))


def estimate(final: Sketch, mesh: Sketch | None, steps: tuple[Sketch, Sketch] | None) -> Errors:
    """Errors of `final`.

    mesh: a run on a coarser mesh; steps: two runs on one mesh, the second with the shorter steps.  None: it cannot
    be told, or there is nothing to tell.
    """
    out: dict[str, dict[str, np.ndarray]] = {"mesh": {}, "time": {}, "total": {}}
    if steps is not None and steps[0].step < LEAST_RATIO * steps[1].step:
        steps = None
    for name, values in final.values.items():
        late = np.zeros_like(values)
        if steps is not None and name in steps[0].values:
            rough, fine = steps
            change = fine.at(name, rough.every) - rough.values[name]
            error = change / ((rough.step / fine.step) ** ORDER - 1.0) * (final.step / fine.step) ** ORDER
            late = _spread(error, len(values), rough.every)
        cells = np.zeros_like(values)
        if mesh is not None and name in mesh.values:
            change = values - mesh.values[name]
            ratio = mesh.step / final.step
            if ratio > LEAST_RATIO:  # what shorter steps have changed is not the mesh's doing
                change = change - late * (ratio**ORDER - 1.0)
            cells = change / ((final.effort.fineness / mesh.effort.fineness) ** ORDER - 1.0)
        for kind, error in (("mesh", cells), ("time", late), ("total", cells + late)):
            if (kind == "mesh" and mesh is None) or (kind == "time" and steps is None):
                continue
            out[kind][PULLS.get(name, name)] = _size(error, name)
        model = final.model_error.get(PULLS.get(name, name))
        if model is not None:
            out["total"][PULLS.get(name, name)] = out["total"][PULLS.get(name, name)] + model
    return Errors({kind: fields for kind, fields in out.items() if fields})


def _spread(error: np.ndarray, count: int, every: int) -> np.ndarray:
    """Errors at some outputs at all of them, linear in between."""
    if every == 1:
        return error
    at = np.arange(count)
    known = _thin(count, every)
    right = np.clip(np.searchsorted(known, at), 1, known.size - 1)
    x = (at - known[right - 1]) / (known[right] - known[right - 1])
    x = x.reshape(-1, *([1] * (error.ndim - 1)))
    return np.asarray(error[right - 1] * (1.0 - x) + error[right] * x)


def _size(error: np.ndarray, name: str) -> np.ndarray:
    """Of vectors their length, of numbers their size."""
    return np.asarray(np.linalg.norm(error, axis=-1) if name == "position" or name in PULLS else np.abs(error))


# --- what is asked ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Verdict:
    """Estimated error over what is asked, of the quantity where that is largest; and what makes up the error."""

    ratio: float
    mesh: float
    time: float
    model: float
    text: str


def judge(asked: Asked, errors: Errors, run: Sketch) -> Verdict:
    """Whether a run is as right as it was asked to be: at a ratio of 1 or less it is."""
    bounds: list[tuple[str, str, float]] = []
    if asked.position is not None:
        bounds.append(("position", "m", asked.position))
    for name in PULLS.values():
        if asked.tension is not None:
            bounds.append((name, "N", asked.tension))
        if asked.of_pull is not None:
            bounds.append((name, "N", asked.of_pull * run.pull))
    worst = Verdict(0.0, 0.0, 0.0, 0.0, "nothing is asked")
    for name, unit, bound in bounds:
        if bound <= 0.0:
            continue
        total = errors.largest("total", name)
        if total / bound >= worst.ratio:
            model = float(np.max(run.model_error.get(name, np.zeros(1)), initial=0.0))
            mesh, time = (errors.largest(kind, name) / bound for kind in ("mesh", "time"))
            text = f"{name.replace('_', ' at the ')}: error {total:.3g} {unit}, asked {bound:.3g} {unit}"
            worst = Verdict(total / bound, mesh, time, model / bound, text)
    return worst


def finer(effort: Effort, verdict: Verdict, mesh_is_free: bool, steps_are_free: bool) -> Effort | None:
    """What should meet what is asked, by order 2, at least cost; None: nothing that is free would help.

    Errors of mesh and step add, and cost grows with fineness over step: half of what is asked is for each.
    """
    goal = max(AIM - verdict.model, 0.25 * AIM)
    mesh = verdict.mesh if mesh_is_free else 0.0
    time = verdict.time if steps_are_free else 0.0
    goal_mesh = goal - (verdict.time if not steps_are_free else min(time, 0.5 * goal))
    goal_time = goal - (verdict.mesh if not mesh_is_free else min(mesh, 0.5 * goal))
    least = 1.0 / MOST_FINER
    cells = min(max(sqrt(max(goal_mesh, 0.0) / mesh), least), 1.0) if mesh > 0.0 else 1.0
    steps = min(max(sqrt(max(goal_time, 0.0) / time), least), 1.0) if time > 0.0 else 1.0
    zones = effort.zones
    if verdict.model > 0.6:
        zones *= max(0.3 / verdict.model, least)
    if min(cells, steps) > 0.95 and zones == effort.zones:
        if mesh == time == 0.0:
            return None
        cells, steps = (0.8, steps) if mesh >= time else (cells, 0.8)
    return replace(effort.coarser(cells, steps), zones=zones)


# --- where cells should be ----------------------------------------------------------------------


def survey_grading(model: Model, s: Floats, run: Mapping[str, np.ndarray], rod_cell: Floats | None) -> Grading:
    """Where cells should be short, by a run with curvature and tension (nt, K) at s (K,) m.

    rod_cell: (K,) m, of lines whose zones move: what cells of rods are then, of which a base cell has some.
    """
    curvature = run["curvature"].max(axis=0)
    material = model.cable
    of = np.clip(np.searchsorted(material.bounds, s) - 1, 0, material.mass.size - 1)
    fade, disturbed = np.zeros(s.size), []
    if rod_cell is None:
        middle = 0.5 * (model.line.s[:-1] + model.line.s[1:])
        rod = np.interp(s, middle, model.line.spin.astype(float)) > 0.5
        low = np.maximum(run["tension"].min(axis=0), 1e-3 * model.tension_scale)
        fade[rod] = np.sqrt(material.B[of, 0] / low)[rod]
        disturbed = [z.s_b for z in model.zones[:-1]] + list(model.attached)
        disturbed += [x for x, held in zip((0.0, model.length), material.held_tangent, strict=True) if held]
    found = grading(s, curvature, fade, disturbed, model.length)
    if rod_cell is None:
        return found
    most = 24.0 * np.interp(found.s, s, rod_cell)  # rod cells in a base cell
    return replace(found, density=np.maximum(found.density, 1.0 / most))


# --- the climb ----------------------------------------------------------------------------------


@dataclass
class Climb:
    """Chooses efforts until what is asked is met.

    asked: None asks for an error figure alone.  sketch: computes with an effort, for comparison; result: computes
    the result; both raise ComputationError.
    """

    asked: Asked | None
    mesh_is_free: bool
    steps_are_free: bool
    moves: bool  # whether there is a time
    sketch: Callable[[Effort], Sketch]
    result: Callable[[Effort], Sketch]
    told: Callable[[str], None]
    notes: list[tuple[str, str]] = field(default_factory=list)  # events: kind, text
    runs: list[Sketch] = field(default_factory=list)

    def reach(self, effort: Effort) -> tuple[Sketch, Errors | None]:
        """From a first effort to the result and its errors, None where they cannot be told."""
        steps, mesh = self._coarse(effort)
        final = self._counted(self.result(effort))
        for k in range(MOST_RUNS + 1):
            if mesh is None and steps is None:
                return final, None
            errors = estimate(final, mesh, steps)
            if self.asked is None:
                return final, errors
            verdict = judge(self.asked, errors, final)
            if verdict.ratio <= 1.0 and not (final.unresolved and self.mesh_is_free and k < MOST_RUNS):
                return final, errors
            better = finer(final.effort, verdict, self.mesh_is_free, self.steps_are_free)
            if better is None or k == MOST_RUNS:
                return final, self._missed(verdict, errors, better is None)
            self.told(f"{verdict.text}: computed more finely")
            last, final = final, self._counted(self.result(better))
            if final.effort.fineness > last.effort.fineness:
                mesh = last
            if final.effort.fineness == last.effort.fineness and final.step < last.step:
                steps = (last, final)
        raise AssertionError("unreachable: the loop returns")

    def _counted(self, run: Sketch) -> Sketch:
        self.runs.append(run)
        return run

    def _coarse(self, effort: Effort) -> tuple[tuple[Sketch, Sketch] | None, Sketch | None]:
        """Runs to compare with: two that differ in their steps, and one on a coarser mesh."""
        try:
            mesh = self._counted(self.sketch(effort.coarser(cells=COARSER)))
            if not self.moves:
                return None, mesh
            rough = self._counted(self.sketch(effort.coarser(cells=COARSER, steps=COARSER)))
            return (rough, mesh), mesh
        except ComputationError as error:
            text = f"no error figure: a coarser run to compare with failed: {str(error).splitlines()[0]}"
            self.notes.append(("no error figure", text))
            return None, None

    def _missed(self, verdict: Verdict, errors: Errors, stuck: bool) -> Errors:
        """Say that what was asked is not met."""
        why = "the scene fixes its mesh and its step" if stuck else f"after {len(self.runs)} runs"
        parts = ((verdict.mesh, "mesh"), (verdict.time, "time step"), (verdict.model, "model"))
        main = max(parts)[1]
        self.notes.append(("accuracy missed", f"{verdict.text}, {why}; most of it is of the {main}"))
        return errors


def summary(errors: Errors) -> dict[str, float]:
    """The largest errors of position (m) and of the pulls at the ends (N), by kind, for the file and for people."""
    out = {}
    for kind in errors.fields:
        out[f"error_{kind}_position"] = errors.largest(kind, "position")
        out[f"error_{kind}_pull"] = max(errors.largest(kind, name) for name in PULLS.values())
    return out
