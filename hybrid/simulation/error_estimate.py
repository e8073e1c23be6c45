"""Estimated errors of a result, from coarser runs of the same scene.

A run with longer cells and steps shows what both do, a second with longer steps what the steps do, a third with which
order errors fall.  Together they cost less than half of the result.
docs/accuracy.md
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from hybrid.model.build import Model
from hybrid.model.resolution import Resolution, first_resolution
from hybrid.outputs.probes import SIDED_ERRORS
from hybrid.scene.schema import Scene
from hybrid.simulation.restore import resolution_from, resolution_tree
from hybrid.store.named_arrays import Tree, matched

# The order of convergence where three runs do not show it, and the bounds of what they may show.  A smooth motion has
# 2, contact and impact have 1; a figure by 1.5 is 1.6 times too large for the first, half of the second.  Below 1.25 it
# is most often the coarsest run that is too coarse to say: errors are bounded, however coarse a run.
ORDER, ORDERS = 1.5, (1.25, 2.0)
# Ratio of step or cell lengths of two runs below which their difference does not show the effect of either.
LEAST_RATIO = 1.1
# Cells and steps of a coarser run are so many times as long.
COARSER = 2.0
# Model errors beyond so many times what the criteria of zones let pass are not believed: a loose line drifts for ever.
BELIEVED = 30.0
# Outputs by which runs are compared; those that a run does not have are skipped.
RIGHT = {f"right/{name}": f"right_{name}" for name in SIDED_ERRORS}  # and under which names their errors are reported
COMPARED = ("position", "tension", "curvature", "bending_moment", "reaction_start", "reaction_end", *RIGHT)
# Of reactions, the magnitude is reported, under these names.
END_FORCES = {"reaction_start": "end_force_start", "reaction_end": "end_force_end"}

# What datasets of errors of neglected bending begin with, and the kind of events that say they are not known.
MODEL_ERRORS, NOT_ESTIMATED = "errors/model/", "model error not estimated"

Notes = tuple[tuple[str, str], ...]  # events of the whole line, at t = 0: kind and text


@dataclass(frozen=True)
class RunSample:
    """What is compared of a run: how finely it was computed, and its outputs (nt, ...) by name."""

    resolution: Resolution
    values: Mapping[str, np.ndarray]
    cells: int  # of zones that move: base cells
    steps: int
    cpu: float  # s
    every: int = 1  # outputs of the result to one of these; the last is there always
    unresolved: bool = False  # whether a bend was sharper than its cells can show
    model_error: Mapping[str, np.ndarray] = field(default_factory=dict)
    bound: float = 0.0  # m, that the criteria of zones that move let pass; 0 where there are none
    notes: Notes = ()  # that the result should carry

    def at(self, name: str, every: int) -> np.ndarray:
        """Every so many-th value of an output, and the last."""
        values = self.values[name]
        return values[_every(len(values), every // self.every)]

    @property
    def largest_end_force(self) -> float:
        """The largest force at the ends, N."""
        return max(
            (float(np.linalg.norm(self.values[x], axis=1).max()) for x in END_FORCES if x in self.values), default=0.0
        )

    def checkpoint(self) -> Tree:
        """All of it, as named arrays and plain values."""
        return {x.name: getattr(self, x.name) for x in fields(self)} | {"resolution": resolution_tree(self.resolution)}


@dataclass(frozen=True)
class Errors:
    """Estimated errors of a run: cause ("mesh", "time", "model", "total") -> output -> magnitude (nt, ...)."""

    fields: Mapping[str, Mapping[str, np.ndarray]]

    def largest(self, cause: str, name: str) -> float:
        """Largest error of an output; 0 where it is not estimated."""
        found = self.fields.get(cause, {}).get(name)
        return float(np.max(found, initial=0.0)) if found is not None else 0.0


def compared_cells(model: Model) -> int:
    """Cells by which meshes of one scene are compared: of zones that move, their base cells."""
    return model.cells if model.layout is None else int(model.layout.rod.size)


class Estimate:
    """Errors of the last of several runs, by what finer cells and steps have changed.

    An error of order p is k^p times as large on cells k times as long.
    """

    def __init__(
        self, result: RunSample, coarse: RunSample, rough: RunSample | None, coarsest: RunSample | None
    ) -> None:
        """coarse: longer cells, and steps if there are any; rough: its cells, steps longer still; coarsest: both.

        None: it failed, or nothing moves.
        """
        self.run = result
        self.order = {name: _order(name, result, coarse, coarsest) for name in result.values if name in coarse.values}
        self.set_model_errors(coarse)
        self.by_step: dict[str, np.ndarray] = {}  # errors of the result by its time step, with their sign
        self.by_mesh: dict[str, np.ndarray] = {}  # the same by its mesh
        for name, p in self.order.items():
            count = len(result.values[name])
            if rough is not None and name in rough.values and coarse.steps > LEAST_RATIO * rough.steps:
                late = (coarse.at(name, rough.every) - rough.values[name]) / ((coarse.steps / rough.steps) ** p - 1.0)
                late = late / (result.steps / coarse.steps) ** p
                self.by_step[name] = _at_all_outputs(late, count, rough.every)
            if result.cells < LEAST_RATIO * coarse.cells:
                continue
            change = result.at(name, coarse.every) - coarse.values[name]
            self.by_mesh[name] = self._mesh_error(name, _at_all_outputs(change, count, coarse.every), coarse)

    def _mesh_error(self, name: str, change: np.ndarray, before: RunSample) -> np.ndarray:
        """Error by the mesh, from a change since a run with other cells: less what its steps have changed."""
        p = self.order[name]
        if name in self.by_step:
            change = change - self.by_step[name] * ((self.run.steps / before.steps) ** p - 1.0)
        return np.asarray(change / ((self.run.cells / before.cells) ** p - 1.0))

    def set_model_errors(self, coarse: RunSample) -> None:
        """Take the model error of a coarser run: it hardly depends on cells and steps."""
        doubtful = _implausible(coarse)
        self.notes: Notes = (*coarse.notes, *(((NOT_ESTIMATED, doubtful),) if doubtful else ()))
        count = len(next(iter(self.run.values.values())))
        found = coarse.model_error if not doubtful else {}
        self._model = {name: _at_all_outputs(x, count, coarse.every) for name, x in found.items() if len(x)}

    def update(self, result: RunSample) -> None:
        """A finer run has become the result."""
        before, self.run = self.run, result
        finer, shorter = result.cells / before.cells, result.steps / before.steps
        for name, p in self.order.items():
            change = result.values[name] - before.values[name]
            if finer > LEAST_RATIO and name in self.by_mesh:
                if name in self.by_step:
                    self.by_step[name] = self.by_step[name] / shorter**p
                self.by_mesh[name] = self._mesh_error(name, change, before)
            elif shorter > LEAST_RATIO:
                self.by_step[name] = change / (shorter**p - 1.0)

    @property
    def model(self) -> dict[str, np.ndarray]:
        """Errors of neglecting bending: what a corrected run says of itself, else those of a coarser run."""
        return self._model | dict(self.run.model_error)

    @property
    def errors(self) -> Errors:
        """Magnitudes by cause.  Causes add up in magnitude: that they cancel is seldom true at all times."""
        out: dict[str, dict[str, np.ndarray]] = {"mesh": {}, "time": {}, "model": self.model, "total": {}}
        for name, by_mesh in self.by_mesh.items():
            by_step, quantity = self.by_step.get(name), (END_FORCES | RIGHT).get(name, name)
            out["mesh"][quantity] = total = _magnitude(by_mesh, name)
            if by_step is not None:
                out["time"][quantity] = _magnitude(by_step, name)
                total = total + out["time"][quantity]
            out["total"][quantity] = total + out["model"].get(quantity, 0.0)
        return Errors({cause: found for cause, found in out.items() if found})

    def checkpoint(self) -> Tree:
        """All of it, as named arrays and plain values."""
        found = {"order": self.order, "late": self.by_step, "cells": self.by_mesh, "model": self._model}
        return found | {"notes": self.notes, "run": self.run.checkpoint()}

    @classmethod
    def restored(cls, tree: Any, scene: Scene, shape: tuple[int, int, int]) -> Estimate:
        """An estimate from a checkpoint; shape, errors: as of `restored_sample`."""
        self = cls.__new__(cls)
        self.run, self.notes = restored_sample(tree["run"], scene, shape), restored_notes(tree["notes"])
        self.order = matched(tree["order"], dict.fromkeys(tree["order"], 1.0), "order")
        late, cells, model = (_restored_outputs(tree[name], shape) for name in ("late", "cells", "model"))
        self.by_step, self.by_mesh, self._model = late, cells, model
        if not (set(late) | set(cells) <= set(self.order) <= set(self.run.values) and self.run.every == 1):
            raise ValueError("errors of outputs that are not there")
        if not all(ORDERS[0] <= p <= ORDERS[1] for p in self.order.values()):
            raise ValueError("orders that no errors have")
        return self


def summary(errors: Errors) -> dict[str, float]:
    """The largest errors of position (m) and of the end forces (N), by cause, as attributes of a result."""
    out = {}
    for cause in errors.fields:
        out[f"error_{cause}_position"] = errors.largest(cause, "position")
        out[f"error_{cause}_end_force"] = max(errors.largest(cause, name) for name in END_FORCES.values())
    return out


# --- parts of the estimate ----------------------------------------------------------------------


def _order(name: str, result: RunSample, coarse: RunSample, coarsest: RunSample | None) -> float:
    """The order with which an output converges, by three runs; bounded, because a ratio of noise is one as well."""
    if coarsest is None or name not in coarsest.values:
        return ORDER
    every = coarsest.every
    later = _size(result.at(name, every) - coarse.at(name, every))  # of all times: peaks jump about
    earlier = _size(coarse.at(name, every) - coarsest.values[name])
    if not (later > 0.0 and earlier > 0.0):
        return ORDER
    return float(np.clip(np.log(earlier / later) / np.log(COARSER), *ORDERS))


def _size(x: np.ndarray) -> float:
    """Root of the sum of all squares; numpy's norm wakes the threads of BLAS, which takes a hundred times as long."""
    return float(np.sqrt((x * x).sum()))


def _implausible(coarse: RunSample) -> str:
    """What to say where the model error of a line whose zones move is too large to be true; else empty."""
    error = coarse.model_error.get("position")
    if error is None or not coarse.bound or float(np.max(error, initial=0.0)) <= BELIEVED * coarse.bound:
        return ""
    return (
        f"the error of leaving bending out comes to {float(np.max(error)):.3g} m, beyond what its criteria let pass "
        f"({coarse.bound:.3g} m): it is not believed, and not part of the error; compare with model: rod"
    )


def _every(count: int, step: int) -> np.ndarray:
    """Numbers of every `step`-th of `count` outputs, and of the last."""
    return np.unique(np.append(np.arange(0, count, step), count - 1))


def _at_all_outputs(error: np.ndarray, count: int, every: int) -> np.ndarray:
    """Errors at some outputs at all of them; in between the larger of the two beside it: peaks are not averaged out."""
    if every == 1:
        return error
    at = np.arange(count)
    known = _every(count, every)
    right = np.clip(np.searchsorted(known, at), 1, known.size - 1)
    before, after = error[right - 1], error[right]
    between = np.where(np.abs(before) > np.abs(after), before, after)
    exact = np.isin(at, known)
    between[exact] = error
    return np.asarray(between)


def _magnitude(error: np.ndarray, name: str) -> np.ndarray:
    """Of vectors their length, of numbers their size."""
    return np.asarray(np.linalg.norm(error, axis=-1) if name == "position" or name in END_FORCES else np.abs(error))


# --- from a checkpoint --------------------------------------------------------------------------


def restored_sample(tree: Any, scene: Scene, shape: tuple[int, int, int]) -> RunSample:
    """A sample from a checkpoint; shape: number of outputs of the result, of its output points, and of its jumps.

    ResultError or ValueError: it is none of this scene.
    """
    blank = RunSample(first_resolution(scene), {}, 1, 1, 0.0).checkpoint()
    saved = matched(tree, blank | dict.fromkeys(("resolution", "values", "model_error", "notes")), "run")
    if min(saved["cells"], saved["steps"], saved["every"]) < 1 or saved["bound"] < 0.0:
        raise ValueError("a run without cells, steps or outputs")
    shape = (_every(shape[0], saved["every"]).size, *shape[1:])
    return RunSample(
        **saved | {
            "resolution": resolution_from(saved["resolution"], scene), "notes": restored_notes(saved["notes"]),
            "values": _restored_outputs(saved["values"], shape),
            "model_error": _restored_outputs(saved["model_error"], shape),
        }
    )  # fmt: skip


def restored_notes(tree: Any) -> Notes:
    """Events from a checkpoint."""
    return tuple((kind, text) for kind, text in matched(tree, [["", ""]] * len(tree), "notes"))


def _restored_outputs(tree: Any, shape: tuple[int, int, int]) -> dict[str, np.ndarray]:
    """Outputs by name from a checkpoint; shape: as of `restored_sample`.  ResultError: they are of another shape."""
    (count, ns, jumps), points, template = shape, {"position": (3,)}, {}
    right = {*RIGHT, *RIGHT.values()}
    for name, value in tree.items():
        along = (count, jumps if name in right else ns)
        full = (count, 3) if name in END_FORCES else (count,) if name in END_FORCES.values() else along
        scalar = name == "position" and np.ndim(value) == 2  # of an error, its size
        template[name] = np.zeros((*full, *(() if scalar else points.get(name, ()))))
    if not set(tree) <= {*COMPARED, *END_FORCES.values(), *right}:
        raise ValueError(f"outputs that are not compared: {', '.join(tree)}")
    return dict(matched(tree, template, "outputs"))
