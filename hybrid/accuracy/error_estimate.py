"""Estimated errors of a result, from coarser runs of the same scene.

A run with longer cells and steps shows what both do, a second with longer steps what the steps do, a third with which
order errors fall.  Together they cost less than half of the result.
docs/errors.md
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any, Self

import numpy as np

from hybrid.accuracy.error_order import (
    CLEARLY_FINER,
    COARSER,
    EXCEEDED,
    MOST,
    MOST_ORDER,
    ORDERS,
    RUBBING_ORDERS,
    Between,
    Block,
    Errors,
    Falls,
    around,
    as_halved,
    at_all_outputs,
    blended,
    confirmed_order,
    exceeds,
    falls,
    force_orders,
    magnitude,
    order,
    refinement,
    squares,
    start_change,
    start_order,
    step_share,
    times_foretold,
    with_neighbours,
)
from hybrid.scene.schema import LineScene
from hybrid.simulation.run_sample import (
    END_FORCES,
    NOT_ESTIMATED,
    RIGHT,
    Notes,
    Outputs,
    RunSample,
    every_of,
    restored_notes,
    restored_outputs,
    restored_sample,
)
from hybrid.store.integrity import Tree, matched

# Errors by mesh and time step add with their signs, as in the difference of two runs that they follow from; the sum is
# this much larger, and this part of it is that of their sizes.  docs/evidence/accuracy.md has what it was worth.
SAFETY, OF_SIZES = 1.2, 0.2
# Equilibria whose positions differ by more than these parts are different solutions; and the event that says so.
OTHER_SOLUTION = 0.75  # of what those of coarser cells differed by
VISIBLE = 2e-3  # of the length
SEVERAL = "several equilibria"
# A quantity that finer runs change by more than this part of what coarser ones did does not converge; unless it is by
# less than a part of its largest value that nobody asks for.
NOT_CONVERGED, NOTHING = 0.9, 0.005
# The same of tension along the line in the first three runs: order 0.4.
HARDLY_CONVERGES = 0.75
# Halved cells and steps leave more than this of a difference (order 1): of vibrations that last, runs this coarse have
# damped what longer steps change, so that what steps make of it is not known from them, if it is most of it.
SLOWLY_CONVERGES, MOST_BY_STEPS = 0.5, 0.5
# What a finer run has changed less than this part of what was foretold may have changed so little by chance.
LEAST_PART = 0.25
# Ratio of step or cell lengths of two runs below which their difference does not show the effect of either.
LEAST_RATIO = 1.1
# Part of the length of catenaries, or of rods, by which two runs may differ whose model errors count as the same.
OTHER_ZONES = 0.1
# Outputs whose errors all steps show where those at outputs do not.
PULLS = (*END_FORCES, "tension", "right/tension")
# What a checkpoint calls the cells, the outputs and the catenaries of the run that model errors are of.
MODEL_OF = "cells", "every", "catenary"


def _halved_falls(
    name: str, result: RunSample, coarse: RunSample, rough: RunSample | None, coarsest: RunSample | None
) -> Falls:
    """What a halving of cells and steps leaves of the difference to the run before; NaN where it is not known."""
    found = falls(name, result, coarse, coarsest)
    cells, steps = refinement(result.resolution, coarse.resolution)
    finer = cells, steps if steps > 1.0 else COARSER  # there may be no steps
    if coarsest is None or finer == (COARSER, COARSER):
        return found
    return as_halved(found, finer, step_share(name, coarse, rough, coarsest))


class Estimate:
    """Errors of the last of several runs, by what finer cells and steps have changed.

    An error of order p is k^p times as large on cells k times as long.
    """

    length = 0.0  # m, of the line, which positions are parts of; 0: not known, they are of the largest coordinate
    cancels = True  # whether errors by mesh and time step add with their signs; else their sizes add
    between: Mapping[str, Between] = MappingProxyType({})  # of end forces whose outputs do not show all that they do
    _apart: RunSample | None = None  # a finer run that is no better, from which the result is not less far than it is
    _errors: Errors | None = None  # of the result and the model error as they are; None: not asked for yet

    def __init__(
        self,
        result: RunSample,
        coarse: RunSample,
        rough: RunSample | None,
        coarsest: RunSample | None,
        from_rest: bool = True,
        rubs: bool = False,
    ) -> None:
        """coarse: longer cells, and steps if there are any; rough: its cells, steps longer still; coarsest: both.

        None: it failed, or nothing moves.  from_rest: it begins from an equilibrium, or is one.  rubs: on obstacles.
        """
        self._include(result)
        self.shares_mixed = set[str]()
        self._from_rest, self._rubs = from_rest, rubs
        both = [name for name in result.values if name in coarse.values]
        fall = {name: _halved_falls(name, result, coarse, rough, coarsest) for name in both}
        own = [name for name in both if name in END_FORCES and not from_rest]  # with an order at the start
        cells, _ = refinement(result.resolution, coarse.resolution)
        self.falls = {name: found.mean for name, found in fall.items()}
        self.order = {name: order(max(x.mean, x.largest), self._bounds(name, x)) for name, x in fall.items()}
        # Orders of the error by the mesh at the first output, where it has one of its own.
        self.at_start = {x: min(start_order(x, result, coarse, coarsest, cells), self.order[x]) for x in own}
        self.changes = {name: (x.change, x.before) for name, x in fall.items()}  # of each output, root mean square
        self.start = start_change(result, coarse), start_change(coarse, coarsest)
        self.set_model_errors(coarse)
        self._coarse, self._of_steps = coarse, self._pair(rough, coarse)
        # Errors by the time step and by the mesh, with their sign, once they are kept.
        self.by_step: dict[str, np.ndarray] | None = None
        self.by_mesh: dict[str, np.ndarray] | None = None
        self.has_step = self._of_steps is not None
        self.has_mesh = bool(self.order) and result.cells >= LEAST_RATIO * coarse.cells
        # Steps of the result are shorter than those of the coarser run, and what that does is not known.
        self.share_unknown = not self.has_step and coarse.steps > 0 and self._shorter(result, coarse) >= LEAST_RATIO
        # Outputs of which the runs with longer steps do not show it either (docs/errors.md).  Forces at ends after a
        # shock are of order 1 to 1.5 whatever lasts: their slow fall is in their order.
        if self.has_step and self.cancels:
            slow = {x for x, y in fall.items() if x not in own and max(y.mean, y.largest) > SLOWLY_CONVERGES}
            self.shares_mixed = {x for x in slow if step_share(x, coarse, rough, coarsest) > MOST_BY_STEPS}

    def _mixes(self, name: str) -> bool:
        """Whether what cells and steps make of an output is not known apart."""
        return self.share_unknown or name in self.shares_mixed

    def _pair(self, slow: RunSample | None, fast: RunSample) -> tuple[RunSample, RunSample] | None:
        """Two runs on the same cells, of longer and of shorter steps, that show what steps do; None: they do not."""
        shows = slow is not None and self._shorter(fast, slow) > LEAST_RATIO
        return (slow, fast) if slow and shows and any(name in slow.values for name in self.order) else None

    def _shorter(self, fast: RunSample, slow: RunSample) -> float:
        """How many times as short the steps of a run mostly are as those of another."""
        for known_fast, known_slow, ratio in self._ratios:
            if known_fast is fast and known_slow is slow:
                return ratio
        ratio = usual_ratio(fast, slow)
        self._ratios.append((fast, slow, ratio))
        return ratio

    def _shorter_for(self, fast: RunSample, slow: RunSample, name: str) -> float:
        """The same for what steps make of an output.

        What they make of a vibration that lasts adds up: it goes by all steps, where there are more of these.
        """
        of_all = fast.steps / max(slow.steps, 1)
        return of_all if name in self.shares_mixed and of_all > 1.0 else self._shorter(fast, slow)

    def show_steps(self, fast: RunSample) -> None:
        """Take a run on the cells of the coarser one in shorter steps, where that in longer steps shows nothing."""
        self._errors, self._of_steps = None, self._pair(self._coarse, fast)
        self.has_step = self._of_steps is not None
        self.share_unknown = self.share_unknown and not self.has_step

    def _bounds(self, name: str, found: Falls) -> tuple[float, float]:
        """Bounds of the order of convergence of an output."""
        if name == "tension" and self._rubs:
            return RUBBING_ORDERS
        shaken = self.run.resolution.later > 0.0
        return force_orders(found, self._from_rest, shaken) if name in END_FORCES else ORDERS

    def _signed(self, name: str, a: int, b: int) -> tuple[np.ndarray | None, np.ndarray | None]:
        """Errors by time step and mesh of the outputs from number a to b, with their sign; None: not known."""
        if self.by_step is not None and self.by_mesh is not None:
            step, mesh = self.by_step.get(name), self.by_mesh.get(name)
            return step if step is None else step[a:b], mesh if mesh is None else mesh[a:b]
        result, coarse = self.run, self._coarse
        count, by_step = len(result.values[name]), self._by_step(name, a, b)
        if not self.has_mesh:
            return by_step, None
        known, own = around(every_of(count, coarse.every), a, b)
        change = result.some(name, known) - coarse.values[name][own]
        return by_step, self._mesh_error(name, at_all_outputs(change, known, a, b), by_step, coarse, a)

    def _by_step(self, name: str, a: int, b: int) -> np.ndarray | None:
        """Error by the time step of the outputs from number a to b, with its sign; None: not known."""
        if self._of_steps is None or name not in self._of_steps[0].values:
            return None
        (slow, fast), p = self._of_steps, self.order[name]
        known, own = around(every_of(len(self.run.values[name]), slow.every), a, b)
        faster = fast.some(name, every_of(len(fast.values[name]), slow.every // fast.every)[own])
        shown, left = (self._shorter_for(*x, name) ** p for x in ((fast, slow), (self.run, fast)))
        return at_all_outputs((faster - slow.values[name][own]) / (shown - 1.0) / left, known, a, b)

    def _mesh_error(
        self, name: str, change: np.ndarray, by_step: np.ndarray | None, before: RunSample, a: int = 0
    ) -> np.ndarray:
        """Error by the mesh, from a change since a run with other cells: less what its steps have changed.

        Where that is not known it is of both, and falls as what has become finer by less.  a: number of the first of
        these outputs.
        """
        p, finer = self.order[name], self.run.cells / before.cells
        if self._mixes(name) and (shorter := self._shorter(self.run, before)) > LEAST_RATIO:
            finer = min(finer, shorter)
        if by_step is not None:
            change = change - by_step * (self._shorter_for(self.run, before, name) ** p - 1.0)
        error = np.asarray(change / (finer**p - 1.0))
        if not a and name in self.at_start:
            error[0] = change[0] / (finer ** self.at_start[name] - 1.0)
        return error

    def _keep(self) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Errors by time step and by mesh of all outputs, kept from here on; the runs before are done with."""
        if self.by_step is None or self.by_mesh is None:
            signed = {name: self._signed(name, 0, len(self.run.values[name])) for name in self.order}
            self.by_step = {name: x for name, (x, _) in signed.items() if x is not None}
            self.by_mesh = {name: x for name, (_, x) in signed.items() if x is not None}
            del self._coarse, self._of_steps
        return self.by_step, self.by_mesh

    def _include(self, result: RunSample) -> None:
        """Take over a result."""
        self.run, self._errors = result, None
        self._ratios: list[tuple[RunSample, RunSample, float]] = []  # `usual_ratio` of runs compared from here on
        # Times as large as they were thought to be, by an order that is known now, are errors of the run before.
        self.revised: dict[str, float] = {}

    def set_model_errors(self, coarse: RunSample) -> None:
        """Take the model error of a coarser run: it hardly depends on cells and steps."""
        self._errors, self._model_every = None, coarse.every
        self.notes: Notes = coarse.notes
        self._model: Mapping[str, Outputs] = {name: x for name, x in coarse.model_error.items() if len(x)}
        self._model_of = coarse.cells, coarse.every, coarse.catenary

    def set_apart(self, finer: RunSample) -> None:
        """A finer run is no better, and either may be wrong: the error is nowhere less than what they differ by."""
        self._apart, self._errors = finer, None

    def forget_errors(self) -> None:
        """Let errors be computed anew from what is known now."""
        self._errors = None

    def differs_in_zones(self, result: RunSample) -> bool:
        """Whether a finer result has other zones than this one by more than OTHER_ZONES of its catenaries or rods."""
        before, after = self.run.catenary, result.catenary
        return before.size == after.size and _are_others(before, after)

    def lacks_model_errors(self) -> bool:
        """Whether the model error is not known, or of a run whose zones have moved otherwise, or of much longer cells.

        Zones of coarse cells are rod where fine ones need not be.
        """
        now, (cells, every, then) = self.run.catenary, self._model_of
        if not (self._model or NOT_ESTIMATED in dict(self.notes)):
            return True
        if not now.any():
            return False
        if self.run.cells > LEAST_RATIO * COARSER * cells or not then.size:
            return True
        return _are_others(now[every_of(now.size, every)], then)

    def update(self, result: RunSample) -> None:
        """A finer run has become the result."""
        by_step, by_mesh = self._keep()
        before = self.run
        self._include(result)
        self.start = start_change(result, before), self.start[0]
        finer, shorter = result.cells / before.cells, self._shorter(result, before)
        other_zones = result.resolution.zones != before.resolution.zones
        more = not other_zones and self._exceeds("position", before, finer, shorter)
        if more:  # what cells and steps make of all outputs is not what it was thought to be
            self.shares_mixed = set(self.order)
        for name, p in list(self.order.items()):
            each = self._shorter_for(result, before, name)
            self.changes[name] = np.nan, self.changes[name][0]
            if other_zones:  # what has changed is not by cells and steps alone
                for found, ratio in ((by_step, each), (by_mesh, finer)):
                    if name in found:
                        found[name] = found[name] / ratio**p
                continue
            change = np.asarray(result.values[name]) - np.asarray(before.values[name])
            if name in END_FORCES and self.cancels:
                p = self._confirmed_order(name, change, finer, shorter)
            self.changes[name] = float(np.sqrt(squares(change) / max(1, change.size))), self.changes[name][1]
            clearly = min(shorter, finer) > CLEARLY_FINER and not more
            if clearly and self._foretold(name, change, each, finer):
                continue
            if finer > LEAST_RATIO and name in by_mesh:
                self._renew_mesh_error(name, change, before, each, more and name == "position")
            elif shorter > LEAST_RATIO:
                by_ratio = each**p
                shown = change / (by_ratio - 1.0)
                by_step[name] = blended(shown, by_step[name] / by_ratio, shorter, p) if name in by_step else shown

    def _foretold(self, name: str, change: np.ndarray, shorter: float, finer: float) -> bool:
        """Let the errors of an output be as they were foretold, by as much less as its change was; False: it was more.

        Where cells and steps are refined together their change does not show which of the two has made it.  shorter,
        finer: how many times as short steps are, and how many times as many cells there are.
        """
        by_step, by_mesh = self._keep()
        if not (self.cancels and name in by_step and name in by_mesh) or self._mixes(name):
            return False
        p = self.order[name]
        times = times_foretold(name, p, change, [(by_step[name], shorter), (by_mesh[name], finer)])
        if times is None or max(times) > EXCEEDED:
            return False
        kept, part = by_mesh[name], max(*times, LEAST_PART)
        by_step[name], by_mesh[name] = part * by_step[name] / shorter**p, part * kept / finer**p
        self._renew_start(name, change, kept, finer)
        return True

    def _renew_mesh_error(
        self, name: str, change: np.ndarray, before: RunSample, each: float, shown_alone: bool
    ) -> None:
        """The error by the mesh of an output that finer cells have changed.

        each: how many times as short steps are; shown_alone: nothing of what was foretold counts.
        """
        by_step, by_mesh = self._keep()
        p, finer, shorter = self.order[name], self.run.cells / before.cells, self._shorter(self.run, before)
        if name in by_step:
            by_step[name] = by_step[name] / each**p
        shown, kept = self._mesh_error(name, change, by_step.get(name), before), by_mesh[name]
        both = min(finer, shorter) if name in self.shares_mixed and shorter > LEAST_RATIO else finer
        by_mesh[name] = shown if shown_alone else blended(shown, kept / both**p, both, p)
        if self._mixes(name) and shorter <= LEAST_RATIO:  # what steps make of it has not changed
            left = kept - change
            by_mesh[name] = np.where(np.abs(left) > np.abs(by_mesh[name]), left, by_mesh[name])
        self._renew_start(name, change, kept, finer)

    def _renew_start(self, name: str, change: np.ndarray, kept: np.ndarray, finer: float) -> None:
        """The error by the mesh at the first output, where it has an order of its own; kept: before."""
        if name in self.at_start:
            _, by_mesh = self._keep()
            q = self.at_start[name]
            by_mesh[name][:1] = blended(change[:1] / (finer**q - 1.0), kept[:1] / finer**q, finer, q)

    def _exceeds(self, name: str, before: RunSample, finer: float, shorter: float) -> bool:
        """Whether a finer run in shorter steps has changed an output by clearly more than was foretold."""
        by_step, by_mesh = self._keep()
        if not (self.has_step and self.cancels and name in by_step and name in by_mesh and finer > LEAST_RATIO):
            return False
        change = np.asarray(self.run.values[name]) - np.asarray(before.values[name])
        return exceeds(name, self.order[name], change, [(by_step[name], shorter), (by_mesh[name], finer)])

    def _confirmed_order(self, name: str, change: np.ndarray, finer: float, shorter: float) -> float:
        """The order of a force, after a finer run: another, where that changes it by less or more than was foretold.

        Errors until now become what they would have been by that order.
        """
        by_step, by_mesh = self._keep()
        known, p = [(x, r) for x, r in ((by_step, shorter), (by_mesh, finer)) if name in x], self.order[name]
        later = slice(int(name in self.at_start), None)  # the first output has an order of its own
        now = self.order[name] = confirmed_order(name, p, change[later], [(x[name][later], r) for x, r in known])
        self.revised[name] = (COARSER**p - 1.0) / (COARSER**now - 1.0)  # of runs twice as fine as those before
        for found, _ in known:  # copies: the result before keeps its own
            found[name] = np.concatenate([found[name][: later.start], self.revised[name] * found[name][later]])
        return now

    @property
    def not_converged(self) -> dict[str, float]:
        """Outputs whose last change was no smaller than that before, and how many times as large it was.

        Tension along the line also where the first three runs have shown that it hardly converges: friction of a bed
        that holds here or there jumps, and finer cells alone show little of that.
        """
        found = {}
        for name in (x for x in self.changes if x not in RIGHT):
            last, before = self.change(name)
            if last > NOT_CONVERGED * before and not self._is_of_edges(name) and last > NOTHING * self.size(name):
                found[END_FORCES.get(name, name)] = last / before
        fall = self.falls.get("tension", np.nan)
        return found | ({"tension": fall} if fall > HARDLY_CONVERGES else {})

    def change(self, name: str) -> tuple[float, float]:
        """Of an output, on both sides of places where it has two, the last change and that before, root mean square."""
        sides = [x for x in (name, f"right/{name}") if x in self.changes]
        count = [float(np.prod(self.run.values[x].shape)) for x in sides]
        last, before = np.sqrt(np.average(np.square([self.changes[x] for x in sides]), axis=0, weights=count))
        return float(last), float(before)

    def size(self, name: str) -> float:
        """The largest value of an output; of positions, which hang on where the origin is, the length of the line."""
        return self.length if name == "position" and self.length > 0.0 else self.run.largest(name)

    def _is_of_edges(self, name: str) -> bool:
        """Whether the largest error of an equilibrium by its cells is known otherwise than by what these change."""
        edges = self.run.at_edges.get(name)
        if edges is None or self._count > 1:
            return False
        return bool(edges.max(initial=0.0) >= self.errors.largest("mesh", name) > 0.0)

    @property
    def several_equilibria(self) -> Notes:
        """The event that says so where equilibria of other meshes are other solutions: finer cells change no less."""
        last, before = self.start
        if not (last > OTHER_SOLUTION * before and last > VISIBLE * self.size("position")):
            return ()
        text = (
            f"equilibria of two meshes are {last:.3g} m apart, those of coarser cells {before:.3g} m: they are "
            "different solutions, and which is found depends on the mesh; initial.points near one of them choose it"
        )
        return ((SEVERAL, text),)

    def _model_error(self, quantity: str, a: int, b: int) -> np.ndarray | None:
        """Errors of neglecting bending, of a coarser run."""
        if quantity not in self._model:
            return None
        known, own = around(every_of(self._count, self._model_every), a, b)
        return at_all_outputs(np.asarray(self._model[quantity][own]), known, a, b)

    @property
    def _count(self) -> int:
        """Outputs of the result."""
        return len(next(iter(self.run.values.values())))

    @property
    def errors(self) -> Errors:
        """Magnitudes by cause.  That of the model adds to the others: how they cancel is not known."""
        if self._errors is None:
            self._errors = self._all_errors()
        return self._errors

    def _all_errors(self) -> Errors:
        shapes: dict[str, dict[str, tuple[int, ...]]] = {cause: {} for cause in ("mesh", "time", "model", "total")}
        for quantity, name, shape in self._quantities():
            step, mesh = self._knows(name)
            known = {"mesh": mesh, "time": mesh and step, "model": quantity in self._model, "total": mesh}
            size = shape[: 0 if quantity in END_FORCES.values() else 1]  # of vectors their length
            for cause in [cause for cause, there in known.items() if there]:
                shapes[cause][quantity] = (self._count, *size)
        return Errors({cause: found for cause, found in shapes.items() if found}, self._blocks)

    def _quantities(self) -> Iterator[tuple[str, str, tuple[int, ...]]]:
        """All that have errors, the output that they are of (empty: it is not compared), and the shape of one of it."""
        names = {(END_FORCES | RIGHT).get(name, name): name for name in self.order}
        for quantity in dict.fromkeys([*names, *self._model]):
            name = names.get(quantity, "")
            of = self.run.values[name] if name else self._model[quantity]
            yield quantity, name, of.shape[1:]

    def _knows(self, name: str) -> tuple[bool, bool]:
        """Whether errors of an output by the time step, and by the mesh, are known."""
        if self.by_step is not None and self.by_mesh is not None:
            return name in self.by_step, name in self.by_mesh
        return self._of_steps is not None and name in self._of_steps[0].values, bool(name) and self.has_mesh

    def _blocks(self) -> Iterator[Block]:
        """All errors, in blocks of so many outputs."""
        for quantity, name, shape in self._quantities():
            rows = max(1, MOST // max(1, int(np.prod(shape))))
            for a in range(0, self._count, rows):
                b = min(a + rows, self._count)
                yield from (Block(cause, quantity, a, x) for cause, x in self._causes(name, quantity, a, b).items())

    def _causes(self, name: str, quantity: str, a: int, b: int) -> dict[str, np.ndarray]:
        """Magnitudes by cause of the outputs from number a to b; name: of the output, empty if it is not compared."""
        before, after = max(a - 1, 0), min(b + 1, self._count)
        by_step, by_mesh = self._signed(name, before, after) if name else (None, None)
        model, out = self._model_error(quantity, a, b), dict[str, np.ndarray]()
        if model is not None:
            out["model"] = model
        if by_mesh is not None:
            found = {"mesh": magnitude(by_mesh, name)}
            total = found["mesh"]
            if by_step is not None:
                found["time"] = magnitude(by_step, name)
                total = total + found["time"]
                if self.cancels:
                    both = magnitude(by_mesh + by_step, name)
                    total = SAFETY * ((1.0 - OF_SIZES) * both + OF_SIZES * total)
            for cause, error in (found | {"total": total}).items():
                out[cause] = with_neighbours(error, a - before, b - before, starts=a == 0)
            if name in self.run.at_edges:
                at_edges = self.run.at_edges[name][a:b]
                out["mesh"], out["total"] = np.maximum(out["mesh"], at_edges), np.maximum(out["total"], at_edges)
            out["total"] = out["total"] + (model if model is not None else 0.0)
            if self.between and name in PULLS:
                out["total"] = np.maximum(out["total"], self._by_steps(name, a, b))
            if self._apart is not None and name in self._apart.values:
                far = np.asarray(self.run.values[name][a:b]) - np.asarray(self._apart.values[name][a:b])
                out["total"] = np.maximum(out["total"], magnitude(far, name))
        return out

    def _by_steps(self, name: str, a: int, b: int) -> np.ndarray:
        """Errors that all steps show of the outputs from number a to b: of an end force, or of tension along the line.

        Of tension that of the end where it is less: what rings at both ends has run along the line.
        """
        known = {raw: self.between[shown].errors[a:b] for raw, shown in END_FORCES.items() if shown in self.between}
        if name in END_FORCES:
            return known.get(name, np.zeros(b - a))
        return np.min([*known.values()], axis=0)[:, None] if len(known) == len(END_FORCES) else np.zeros((b - a, 1))

    def checkpoint(self) -> Tree:
        """All of it, as named arrays and plain values."""
        by_step, by_mesh = self._keep()
        known = every_of(self._count, self._model_every)
        model = {name: at_all_outputs(np.asarray(x), known, 0, self._count) for name, x in self._model.items()}
        changes = {name: np.array(x) for name, x in self.changes.items()}
        found: Tree = {x: getattr(self, x) for x in ("order", "at_start", "share_unknown", "falls")}
        found |= {"shares_mixed": sorted(self.shares_mixed), "changes": changes, "start": np.array(self.start)}
        found |= {"late": by_step, "cells": by_mesh, "model": model}
        of = dict(zip(MODEL_OF, self._model_of, strict=True))
        found |= {"notes": self.notes, "run": self.run.checkpoint(), "model_of": of}
        between = {name: {"errors": x.errors, "order": x.order} for name, x in self.between.items()}
        return found | {"between": between}

    @classmethod
    def restored(cls, tree: Any, scene: LineScene, shape: tuple[int, int, int]) -> Self:
        """An estimate from a checkpoint; shape, errors: as of `restored_sample`."""
        self = cls.__new__(cls)
        self.run, self.notes = restored_sample(tree["run"], scene, shape), restored_notes(tree["notes"])
        self.revised, self._ratios = {}, []
        self.order = matched(tree["order"], dict.fromkeys(tree["order"], 1.0), "order")
        at_start = tree.get("at_start", {})  # of checkpoints that have it
        self.at_start = matched(at_start, dict.fromkeys(at_start, 1.0), "order at the start")
        self.falls = matched(tree["falls"], dict.fromkeys(tree["order"], np.nan), "falls")
        unseen = np.full(2, np.nan)  # of checkpoints that do not have it
        start = matched([tree.get("start", unseen)], [unseen], "start")[0]
        self.start = float(start[0]), float(start[1])
        unknown = dict.fromkeys(tree["order"], np.full(2, np.nan))  # of checkpoints that do not have them
        changes = matched(tree.get("changes", unknown), unknown, "changes")
        self.changes = {name: (float(x[0]), float(x[1])) for name, x in changes.items()}
        late, cells, model = (restored_outputs(tree[name], shape) for name in ("late", "cells", "model"))
        self.by_step, self.by_mesh, self._model, self._model_every = late, cells, model, 1
        older = dict(zip(MODEL_OF, (1, 1, np.zeros(0)), strict=True))  # checkpoints of 0.6 do not say
        count, every, catenary = matched(tree.get("model_of", older), older, "model error").values()
        if min(count, every) < 1 or catenary.shape not in ((0,), every_of(shape[0], every).shape):
            raise ValueError("a model error of no run")
        self._model_of = count, every, catenary
        self.has_step, self.has_mesh = bool(late), bool(cells)
        self.share_unknown = bool(tree.get("share_unknown", False))  # of checkpoints that have it
        self.shares_mixed = {name for name in self.order if name in list(tree.get("shares_mixed", ()))}
        row = {"errors": np.zeros(shape[0]), "order": 1.0}
        between = tree.get("between", {})  # of checkpoints that have it
        between = matched(between, {name: row for name in between}, "errors between outputs")
        self.between = {name: Between(**x) for name, x in between.items() if name in END_FORCES.values()}
        if not (set(late) | set(cells) <= set(self.order) <= set(self.run.values) and self.run.every == 1):
            raise ValueError("errors of outputs that are not there")
        if not (set(self.at_start) <= set(self.order) and set(self.at_start) <= set(END_FORCES)):
            raise ValueError("orders at the start of outputs that have none")
        if not all(1.0 <= p <= MOST_ORDER for p in (*self.order.values(), *self.at_start.values())):
            raise ValueError("orders that no errors have")
        return self


# How many times as short the steps of a run mostly are as those of another.
#
# Steps that follow the motion, or are halved where Newton's method fails, are not everywhere as much shorter in a finer
# run as the counts of steps say: a run whose steps are limited to a third of a period may have more of them than a run
# with twice as fine a limit, where a few moments are hard for it.

# Steps are counted over so many usual steps of the slower run, before and after each of so many times.
AROUND, TIMES = 2.0, 200


def _are_others(before: np.ndarray, after: np.ndarray) -> bool:
    """Whether parts of the line that are catenaries differ at an output by more than OTHER_ZONES of them or of rods."""
    return bool((np.abs(before - after) > OTHER_ZONES * np.minimum(before, 1.0 - before)).any())


def usual_ratio(fast: RunSample, slow: RunSample) -> float:
    """The median over the time of the run; of runs that have not kept when their steps end, of their counts."""
    logs = [np.append(0.0, run.forces[:, 0]) for run in (fast, slow)]
    if any(x.size != run.steps + 1 or x.size < 3 for x, run in zip(logs, (fast, slow), strict=True)):
        return fast.steps / max(slow.steps, 1)
    usual = np.diff(logs[1])
    near = AROUND * float((usual * usual).sum() / usual.sum())
    t = np.linspace(0.0, logs[1][-1], TIMES)
    steps = [np.interp(t + near, x, np.arange(x.size)) - np.interp(t - near, x, np.arange(x.size)) for x in logs]
    return float(np.median(steps[0] / np.maximum(steps[1], 1e-9)))
