"""How wrong a result is, and how finely to compute for an accuracy that was asked for.

Coarser runs say it: one with longer cells and steps shows what both do, a second with longer steps what the steps do,
a third how fast errors fall.  Together they cost less than half of the result.  Where an accuracy is asked for, cells
and steps of the next run follow from what was found, and the last run is the result.
docs/accuracy.md
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from math import sqrt
from typing import Any

import numpy as np

from hybrid.errors import ComputationError
from hybrid.kernels.state import Floats
from hybrid.model.build import Model
from hybrid.model.mesh_grading import Grading, grading
from hybrid.model.plan import output_times
from hybrid.model.resolution import Asked, Effort, first_effort
from hybrid.outputs.probes import output_points
from hybrid.scene.schema import Scene
from hybrid.simulation.restore import effort_from, effort_tree
from hybrid.store.named_arrays import Tree, matched

# The order that errors are taken to fall with, where three runs do not show it, and what they may show.  A smooth
# motion has 2, contact and blows have 1; a figure by 1.5 is 1.6 times too large for the first, half of the second.
# Below 1.25 it is most often the coarsest run that is too coarse to say: errors are bounded, however coarse a run.
ORDER, ORDERS = 1.5, (1.25, 2.0)
# Times as long as others that steps must be to tell from both what the step does.
LEAST_RATIO = 1.1
# Coarser runs have cells and steps so many times as long.
COARSER = 2.0
# Part of what is asked that the next run aims at.
AIM = 0.7
# Zones become stricter when the model makes more than the first of what is asked, so that it makes the second.
MOST_OF_MODEL, OF_MODEL = 0.5, 0.25
# A finer run whose error is more than this part of that before it tells that more will not help: zones that change a
# little earlier or later, or friction that holds elsewhere, are what is left.
STALLED = 0.8
# Processor time, s, after which runs are not made finer for what they miss: a longer wait should be asked for.
MOST_CPU = 600.0
# Times what zones may make of bending at which its estimated effect is not believed: what lies loose drifts for ever.
BELIEVED = 30.0
# Runs that may follow the first result; each is at most this much finer.
MOST_RUNS, MOST_FINER = 3, 3.0
# Rod cells in a base cell of zones that move.
MOST_PARTS = 24.0
# What a run is compared by, as names of outputs; those that are not there are left out.
COMPARED = ("position", "tension", "curvature", "bending_moment", "reaction_start", "reaction_end")
END_FORCES = {"reaction_start": "end_force_start", "reaction_end": "end_force_end"}
# The run that looks how the cable bends: cells and steps so many times as long as those of the first result.
SURVEY_CELLS, SURVEY_STEPS, SURVEY_POINTS = 2.0, 4.0, 201


@dataclass(frozen=True)
class Sketch:
    """What is compared of a run: how finely it was computed, and its outputs (nt, ...) by name."""

    effort: Effort
    values: Mapping[str, np.ndarray]
    cells: int  # of zones that move: base cells
    steps: int
    cpu: float  # s
    every: int = 1  # outputs of the result to one of these; the last is there always
    unresolved: bool = False  # whether a bend was sharper than its cells can show
    model_error: Mapping[str, np.ndarray] = field(default_factory=dict)
    bound: float = 0.0  # m, that the criteria of zones that move let pass; 0 where there are none
    notes: tuple[tuple[str, str], ...] = ()  # what the result should say of it: kind and text of events

    @property
    def step(self) -> float:
        """Mean step, in parts of the run."""
        return 1.0 / max(self.steps, 1)

    def at(self, name: str, every: int) -> np.ndarray:
        """An output at one of so many times."""
        values = self.values[name]
        return values[_thin(len(values), every // self.every)]

    @property
    def largest_end_force(self) -> float:
        """The largest force at the ends, N."""
        return max(
            (float(np.linalg.norm(self.values[x], axis=1).max()) for x in END_FORCES if x in self.values), default=0.0
        )

    def checkpoint(self) -> Tree:
        """All of it, as named arrays and plain values."""
        return {x.name: getattr(self, x.name) for x in fields(self)} | {"effort": effort_tree(self.effort)}


def sketch_from(tree: Any, scene: Scene, outputs: int) -> Sketch:
    """A sketch from a checkpoint; outputs: of the result.  ResultError or ValueError: it is none of this scene."""
    blank = Sketch(first_effort(scene), {}, 1, 1, 0.0).checkpoint()
    saved = matched(tree, blank | dict.fromkeys(("effort", "values", "model_error", "notes")), "run")
    if min(saved["cells"], saved["steps"], saved["every"]) < 1 or saved["bound"] < 0.0:
        raise ValueError("a run without cells, steps or outputs")
    count = _thin(outputs, saved["every"]).size
    return Sketch(
        **saved | {
            "effort": effort_from(saved["effort"], scene), "values": arrays_from(saved["values"], scene, count),
            "model_error": arrays_from(saved["model_error"], scene, count), "notes": notes_from(saved["notes"]),
        }
    )  # fmt: skip


def arrays_from(tree: Any, scene: Scene, count: int) -> dict[str, np.ndarray]:
    """Outputs (count, ...) by name from a checkpoint.  ResultError: they are of another shape."""
    ns, points = output_points(scene.output.points, scene.length).size, {"position": (3,)}
    template = {}
    for name, value in tree.items():
        full = (count, 3) if name in END_FORCES else (count,) if name in END_FORCES.values() else (count, ns)
        scalar = name == "position" and np.ndim(value) == 2  # of an error, its size
        template[name] = np.zeros((*full, *(() if scalar else points.get(name, ()))))
    if not set(tree) <= {*COMPARED, *END_FORCES.values()}:
        raise ValueError(f"outputs that are not compared: {', '.join(tree)}")
    return dict(matched(tree, template, "outputs"))


def notes_from(tree: Any) -> tuple[tuple[str, str], ...]:
    """Events, kind and text, from a checkpoint."""
    return tuple((kind, text) for kind, text in matched(tree, [["", ""]] * len(tree), "notes"))


@dataclass(frozen=True)
class Errors:
    """Estimated errors of a run: kind ("mesh", "time", "model", "total") -> output -> size (nt, ...) of the error."""

    fields: Mapping[str, Mapping[str, np.ndarray]]

    def largest(self, kind: str, name: str) -> float:
        """Largest error of an output; 0 where it is not estimated."""
        found = self.fields.get(kind, {}).get(name)
        return float(np.max(found, initial=0.0)) if found is not None else 0.0


def _thin(count: int, every: int) -> np.ndarray:
    """Numbers of every so many-th of `count` outputs, and of the last."""
    return np.unique(np.append(np.arange(0, count, every), count - 1))


class Estimate:
    """Errors of the last of several runs, by what finer cells and steps have changed.

    Of an error that falls with order p, a run on cells k times as long has k^p times as much.
    """

    def __init__(self, final: Sketch, coarse: Sketch, rough: Sketch | None, coarsest: Sketch | None) -> None:
        """coarse: longer cells, and steps if there are any; rough: its cells, steps longer still; coarsest: both.

        None: it failed, or nothing moves.
        """
        self.run = final
        self.order = {name: _order(name, final, coarse, coarsest) for name in final.values if name in coarse.values}
        self.take_model(coarse)
        self.late: dict[str, np.ndarray] = {}
        self.cells: dict[str, np.ndarray] = {}
        for name, p in self.order.items():
            if rough is not None and name in rough.values and coarse.steps > LEAST_RATIO * rough.steps:
                late = (coarse.at(name, rough.every) - rough.values[name]) / ((coarse.steps / rough.steps) ** p - 1.0)
                late = late / (final.steps / coarse.steps) ** p
                self.late[name] = _spread(late, len(final.values[name]), rough.every)
            if final.cells < LEAST_RATIO * coarse.cells:
                continue
            change = final.at(name, coarse.every) - coarse.values[name]
            self.cells[name] = self._of_cells(name, _spread(change, len(final.values[name]), coarse.every), coarse)

    def checkpoint(self) -> Tree:
        """All of it, as named arrays and plain values."""
        found = {"order": self.order, "late": self.late, "cells": self.cells, "model": self._model, "notes": self.notes}
        return found | {"run": self.run.checkpoint()}

    @classmethod
    def restored(cls, tree: Any, scene: Scene, outputs: int) -> Estimate:
        """An estimate from a checkpoint.  ResultError or ValueError: it is none of this scene."""
        self = cls.__new__(cls)
        self.run, self.notes = sketch_from(tree["run"], scene, outputs), notes_from(tree["notes"])
        self.order = matched(tree["order"], dict.fromkeys(tree["order"], 1.0), "order")
        late, cells, model = (arrays_from(tree[name], scene, outputs) for name in ("late", "cells", "model"))
        self.late, self.cells, self._model = late, cells, model
        if not (set(late) | set(cells) <= set(self.order) <= set(self.run.values) and self.run.every == 1):
            raise ValueError("errors of outputs that are not there")
        if not all(ORDERS[0] <= p <= ORDERS[1] for p in self.order.values()):
            raise ValueError("orders that no errors have")
        return self

    def _of_cells(self, name: str, change: np.ndarray, before: Sketch) -> np.ndarray:
        """What cells make wrong, by a change since a run with others: less what steps have changed."""
        p = self.order[name]
        if name in self.late:
            change = change - self.late[name] * ((self.run.steps / before.steps) ** p - 1.0)
        return np.asarray(change / ((self.run.cells / before.cells) ** p - 1.0))

    def take_model(self, coarse: Sketch) -> None:
        """The model error is that of a coarser run: it hardly depends on cells and steps."""
        doubtful = _beyond(coarse)
        self.notes = (*coarse.notes, *((("model error not estimated", doubtful),) if doubtful else ()))
        count = len(next(iter(self.run.values.values())))
        left = coarse.model_error if not doubtful else {}
        self._model = {name: _spread(x, count, coarse.every) for name, x in left.items() if len(x)}

    def follow(self, final: Sketch) -> None:
        """A finer run has become the result."""
        before, self.run = self.run, final
        finer, shorter = final.cells / before.cells, final.steps / before.steps
        for name, p in self.order.items():
            change = final.values[name] - before.values[name]
            if finer > LEAST_RATIO and name in self.cells:
                if name in self.late:
                    self.late[name] = self.late[name] / shorter**p
                self.cells[name] = self._of_cells(name, change, before)
            elif shorter > LEAST_RATIO:
                self.late[name] = change / (shorter**p - 1.0)

    @property
    def model(self) -> dict[str, np.ndarray]:
        """Errors of leaving bending out: what a corrected run says of itself, else those of a coarser run."""
        return self._model | dict(self.run.model_error)

    @property
    def errors(self) -> Errors:
        """What it comes to.  Causes add up in size: that they cancel is seldom true at all times."""
        out: dict[str, dict[str, np.ndarray]] = {"mesh": {}, "time": {}, "model": self.model, "total": {}}
        for name, cells in self.cells.items():
            late, called = self.late.get(name), END_FORCES.get(name, name)
            out["mesh"][called] = total = _size(cells, name)
            if late is not None:
                out["time"][called] = _size(late, name)
                total = total + out["time"][called]
            out["total"][called] = total + out["model"].get(called, 0.0)
        return Errors({kind: fields for kind, fields in out.items() if fields})


def _beyond(coarse: Sketch) -> str:
    """What to say where the model error of a line whose zones move is so large that it cannot be true; else empty."""
    left = coarse.model_error.get("position")
    if left is None or not coarse.bound or float(np.max(left, initial=0.0)) <= BELIEVED * coarse.bound:
        return ""
    return (
        f"the error of leaving bending out comes to {float(np.max(left)):.3g} m, beyond what its criteria let pass "
        f"({coarse.bound:.3g} m): it is not believed, and not part of the error; compare with model: rod"
    )


def _order(name: str, final: Sketch, coarse: Sketch, coarsest: Sketch | None) -> float:
    """The order with which an output converges, by three runs; bounded, because a ratio of noise is one as well."""
    if coarsest is None or name not in coarsest.values:
        return ORDER
    every = coarsest.every
    later = float(np.linalg.norm(final.at(name, every) - coarse.at(name, every)))  # of all times: peaks jump about
    earlier = float(np.linalg.norm(coarse.at(name, every) - coarsest.values[name]))
    if not (later > 0.0 and earlier > 0.0):
        return ORDER
    return float(np.clip(np.log(earlier / later) / np.log(COARSER), *ORDERS))


def _spread(error: np.ndarray, count: int, every: int) -> np.ndarray:
    """Errors at some outputs at all of them; in between the larger of the two beside it: peaks are not averaged out."""
    if every == 1:
        return error
    at = np.arange(count)
    known = _thin(count, every)
    right = np.clip(np.searchsorted(known, at), 1, known.size - 1)
    before, after = error[right - 1], error[right]
    between = np.where(np.abs(before) > np.abs(after), before, after)
    exact = np.isin(at, known)
    between[exact] = error
    return np.asarray(between)


def _size(error: np.ndarray, name: str) -> np.ndarray:
    """Of vectors their length, of numbers their size."""
    return np.asarray(np.linalg.norm(error, axis=-1) if name == "position" or name in END_FORCES else np.abs(error))


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
    for name in END_FORCES.values():
        if asked.tension is not None:
            bounds.append((name, "N", asked.tension))
        if asked.of_pull is not None:
            bounds.append((name, "N", asked.of_pull * run.largest_end_force))
    if asked.of_curvature is not None and "curvature" in run.values:
        bounds.append(("curvature", "1/m", asked.of_curvature * float(run.values["curvature"].max())))
    worst = Verdict(0.0, 0.0, 0.0, 0.0, "nothing is asked")
    for name, unit, bound in bounds:
        if bound <= 0.0:
            continue
        total = errors.largest("total", name)
        if total / bound >= worst.ratio:
            model = errors.largest("model", name)
            mesh, time = (errors.largest(kind, name) / bound for kind in ("mesh", "time"))
            quantity = name.replace("end_force_", "force at the ")
            text = f"{quantity}: error {total:.3g} {unit}, asked {bound:.3g} {unit}"
            worst = Verdict(total / bound, mesh, time, model / bound, text)
    return worst


def finer(
    effort: Effort, verdict: Verdict, mesh_is_free: bool, steps_are_free: bool, zones_are_free: bool = False
) -> Effort | None:
    """What should meet what is asked, by order 2, at least cost; None: nothing that is free would help.

    Errors of mesh and step add, and cost grows with fineness over step: half of what is asked is for each.
    """
    zones, model = effort.zones, verdict.model
    if zones_are_free and model > MOST_OF_MODEL:
        zones *= max(OF_MODEL / model, 1.0 / MOST_FINER)
        model = OF_MODEL
    if model >= AIM or (verdict.mesh > 1.0 and not mesh_is_free) or (verdict.time > 1.0 and not steps_are_free):
        return None  # what is fixed is wrong by more than is asked
    goal = AIM - model
    mesh = verdict.mesh if mesh_is_free else 0.0
    time = verdict.time if steps_are_free else 0.0
    goal_mesh = goal - (verdict.time if not steps_are_free else min(time, 0.5 * goal))
    goal_time = goal - (verdict.mesh if not mesh_is_free else min(mesh, 0.5 * goal))
    least = 1.0 / MOST_FINER
    cells = min(max(sqrt(max(goal_mesh, 0.0) / mesh), least), 1.0) if mesh > 0.0 else 1.0
    steps = min(max(sqrt(max(goal_time, 0.0) / time), least), 1.0) if time > 0.0 else 1.0
    if min(cells, steps) > 0.95 and zones == effort.zones:
        if mesh == time == 0.0:
            return None
        cells, steps = (0.8, steps) if mesh >= time else (cells, 0.8)
    return replace(effort.coarser(cells, steps), zones=zones)


def comparison_efforts(effort: Effort, moves: bool) -> tuple[Effort, Effort, Effort]:
    """Of the runs to compare with: longer cells and steps; the same cells, longer steps still; longer cells as well."""
    longer = COARSER if moves else 1.0
    return (
        effort.coarser(COARSER, longer), effort.coarser(COARSER, longer**2), effort.coarser(COARSER**2, longer**2),
    )  # fmt: skip


# --- where cells should be ----------------------------------------------------------------------


def survey_effort(effort: Effort) -> Effort:
    """Of the run that looks how the cable bends."""
    return effort.coarser(SURVEY_CELLS, SURVEY_STEPS)


def survey_grading(model: Model, s: Floats, run: Mapping[str, np.ndarray], rod_cell: Floats | None) -> Grading:
    """Where cells should be short, by a run with curvature and tension (nt, K) at s (K,) m.

    rod_cell: (K,) m, of lines whose zones move: what cells of rods are then, of which a base cell has some.
    """
    curvature = run["curvature"].max(axis=0)
    material = model.cable
    of = material.piece(s)
    fade, disturbed = np.zeros(s.size), []
    if rod_cell is None:
        middle = 0.5 * (model.line.s[:-1] + model.line.s[1:])
        rod = np.interp(s, middle, model.line.spin.astype(float)) > 0.5
        low = np.maximum(run["tension"].min(axis=0), 1e-3 * model.tension_scale)
        fade[rod] = np.sqrt(material.weakest_bending[of] / low)[rod]
        disturbed = [z.s_b for z in model.zones[:-1]] + list(model.attached)
        disturbed += [x for x, held in zip((0.0, model.length), material.held_tangent, strict=True) if held]
    found = grading(s, curvature, fade, disturbed, model.length)
    if rod_cell is None:
        return found
    most = MOST_PARTS * np.interp(found.s, s, rod_cell)
    return replace(found, density=np.maximum(found.density, 1.0 / most))


# --- the climb ----------------------------------------------------------------------------------


@dataclass
class Climb:
    """Chooses efforts until what is asked is met.

    asked: None asks for an error figure alone.  sketch: computes with an effort, for comparison; result: computes
    the result; both raise ComputationError.  What it has found until then is in the file of every result, so that a
    climb that was cut off goes on with `go_on`.
    """

    asked: Asked | None
    mesh_is_free: bool
    steps_are_free: bool
    zones_are_free: bool
    moves: bool  # whether there is a time
    sketch: Callable[[Effort], Sketch]
    result: Callable[[Effort], Sketch]
    runs: list[float] = field(default_factory=list)  # s of processor time, of all runs so far
    next: Effort | None = None  # of the result that is to be computed
    coarse: tuple[Sketch, Sketch | None, Sketch | None] | None = None  # what the first result is compared with
    estimate: Estimate | None = None  # of the result as it is
    _ratio: float = np.inf  # of the error of the result to what is asked, and how that has changed
    _finer: int = 0  # results that were judged
    _notes: list[tuple[str, str]] = field(default_factory=list)

    def checkpoint(self) -> Tree:
        """What it has found until now, as named arrays and plain values."""
        return {
            "runs": np.array(self.runs), "next": self.next and effort_tree(self.next),
            "coarse": self.coarse and [x and x.checkpoint() for x in self.coarse],
            "estimate": self.estimate and self.estimate.checkpoint(),
            "ratio": self._ratio, "finer": self._finer, "notes": self._notes,
        }  # fmt: skip

    def restore(self, tree: Mapping[str, Any], scene: Scene) -> None:
        """Go on as `checkpoint` has said.  ResultError or ValueError: it is none of this scene."""
        template = {"runs": np.zeros(0), "ratio": np.inf, "finer": 0}
        saved = matched(tree, template | dict.fromkeys(("next", "coarse", "estimate", "notes")), "error control")
        outputs = len(output_times(scene)) + 1
        self.runs, self._ratio, self._finer = saved["runs"].tolist(), saved["ratio"], saved["finer"]
        self._notes = list(notes_from(saved["notes"]))
        self.next = effort_from(saved["next"], scene) if saved["next"] is not None else None
        if saved["coarse"] is not None:
            first, second, third = (x and sketch_from(x, scene, outputs) for x in saved["coarse"])
            self.coarse = first, second, third
        if saved["estimate"] is not None:
            self.estimate = Estimate.restored(saved["estimate"], scene, outputs)
        if self.next is None and self.estimate is None:
            raise ValueError("neither a result nor one that is to come")

    @property
    def notes(self) -> tuple[tuple[str, str], ...]:
        """Events of the result, kind and text: of the climb, of the result itself, and of its model error."""
        found = self.estimate
        return (*self._notes, *((*found.run.notes, *found.notes) if found is not None else ()))

    def stopped(self) -> tuple[Sketch, Errors]:
        """The result before a finer run that was stopped from outside, and its errors."""
        return self._kept("a finer run was stopped from outside")

    def reach(self, effort: Effort) -> tuple[Sketch, Errors | None]:
        """From a first effort to the result and its errors, None where they cannot be told."""
        self.coarse, self.next = self._coarse(effort), effort
        return self.go_on()

    def go_on(self) -> tuple[Sketch, Errors | None]:
        """The same from the next result on."""
        while self.next is not None:
            effort = self.next
            try:
                final = self._counted(self.result(effort))
            except ComputationError as error:
                if self.estimate is None:
                    raise
                return self._kept(f"a finer run failed: {str(error).splitlines()[0]}")
            if self.estimate is not None:
                stricter = effort.zones < self.estimate.run.effort.zones
                self.estimate.follow(final)
                if stricter:
                    self._model_anew(self.estimate, effort)
            elif not self._compared(final):
                return final, None
            self.next = self._better()
        assert self.estimate is not None
        errors = self.estimate.errors
        if self.asked is not None:
            verdict = judge(self.asked, errors, self.estimate.run)
            if verdict.ratio > 1.0:
                self._missed(verdict)
        return self.estimate.run, errors

    def _compared(self, final: Sketch) -> bool:
        """Compare the first result with the coarser runs; whether they say anything."""
        if self.coarse is None:
            self._notes += final.notes
            return False
        estimate = Estimate(final, *self.coarse)
        if not estimate.cells:
            text = f"no error figure: {final.cells} cells are so few that there is nothing coarser to compare with"
            self._notes.append(("no error figure", text))
            self._notes += [*final.notes, *estimate.notes]
            return False
        if self.moves and not estimate.late:
            text = (
                "the share of the time step is not known: runs with longer steps fail, or are halved to what they were"
            )
            fix = "ask for a smaller error" if self.steps_are_free else "leave time.step out"
            self._notes.append(("error uncertain", f"{text}; the error may be larger; {fix}"))
        self.estimate, self.coarse = estimate, None
        return True

    def _better(self) -> Effort | None:
        """The effort of the next result; None: what is asked is met, or more of it would not help."""
        assert self.estimate is not None
        if self.asked is None:
            return None
        run, before = self.estimate.run, self._ratio
        verdict = judge(self.asked, self.estimate.errors, run)
        self._ratio, falls = verdict.ratio, verdict.ratio / before  # 0 for the first
        self._finer += 1
        left = MOST_RUNS + 1 - self._finer
        last = left == 0 or falls > STALLED or verdict.ratio * falls**left > 1.0
        if (verdict.ratio <= 1.0 and not (run.unresolved and self.mesh_is_free)) or last or self._spent():
            return None
        return finer(run.effort, verdict, self.mesh_is_free, self.steps_are_free, self.zones_are_free)

    def _kept(self, why: str) -> tuple[Sketch, Errors]:
        """The result as it is, where a finer one did not come to its end."""
        assert self.estimate is not None and self.asked is not None
        run, errors = self.estimate.run, self.estimate.errors
        verdict = judge(self.asked, errors, run)
        if verdict.ratio > 1.0:
            self._notes.append(("accuracy missed", f"{verdict.text}; {why}"))
        return run, errors

    def _spent(self) -> bool:
        """Whether so much has been computed that more of it should be asked for."""
        return sum(self.runs) > MOST_CPU

    def _counted(self, run: Sketch) -> Sketch:
        self.runs.append(run.cpu)
        return run

    def _coarse(self, effort: Effort) -> tuple[Sketch, Sketch | None, Sketch | None] | None:
        """The runs to compare with; None: the first has failed."""
        found: list[Sketch | None] = []
        for rough in comparison_efforts(effort, self.moves):
            try:
                same = not self.moves and len(found) == 1
                rough = replace(rough, follow=not found)
                found.append(None if same else self._counted(self.sketch(rough)))
            except ComputationError as error:
                if not found:
                    text = f"no error figure: a coarser run to compare with failed: {str(error).splitlines()[0]}"
                    self._notes.append(("no error figure", text))
                    return None
                found.append(None)
        assert found[0] is not None
        return found[0], found[1], found[2]

    def _model_anew(self, estimate: Estimate, effort: Effort) -> None:
        """Zones have become stricter: what they leave out now."""
        longer = COARSER if self.moves else 1.0
        try:
            estimate.take_model(self._counted(self.sketch(replace(effort.coarser(COARSER, longer), follow=True))))
        except ComputationError as error:
            text = f"the effect of bending that is left out is that of a run before: {str(error).splitlines()[0]}"
            self._notes.append(("error uncertain", text))

    def _missed(self, verdict: Verdict) -> None:
        """Say that what was asked is not met, whose doing it is, and what to try."""
        main = max((verdict.mesh, "mesh"), (verdict.time, "time step"), (verdict.model, "model"))[1]
        free = {"mesh": self.mesh_is_free, "time step": self.steps_are_free, "model": self.zones_are_free}[main]
        fixed = {"mesh": "mesh (or cells of zones)", "time step": "time.step", "model": "model, or its tolerance"}[main]
        try_ = "ask for less" + ", or compare with model: rod" * (verdict.model > 0.0) if free else f"leave {fixed} out"
        if main == "model" and not free:
            try_ = "model: adaptive, or rod"
        text = f"{verdict.text}; most of it is of the {main}, {len(self.runs)} runs; try: {try_}"
        self._notes.append(("accuracy missed", text))


def summary(errors: Errors) -> dict[str, float]:
    """The largest errors of position (m) and of the end forces (N), by kind, for the file and for people."""
    out = {}
    for kind in errors.fields:
        out[f"error_{kind}_position"] = errors.largest(kind, "position")
        out[f"error_{kind}_end_force"] = max(errors.largest(kind, name) for name in END_FORCES.values())
    return out
