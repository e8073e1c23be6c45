"""How much processor time a run takes: what its steps, cells and outputs cost, as bench/test_bench_plan.py measures it.

Costs are those of one core of a server of 2024; on another machine all of them change by one factor.  Those of cells
and steps are in ratio to a bare rod's cell in space, as bench/test_bench_prices.py measures them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hybrid.kernels.laws.water import calm_below
from hybrid.kernels.state.forces import ADDED_MASS, DRAG, FRICTION, ROTARY, SEABED, STIFFNESS_DAMPING, SURFACE
from hybrid.kernels.step.generalized_alpha import weights
from hybrid.kernels.step.step_law import SAFETY
from hybrid.model.build import Model
from hybrid.model.resolution import Resolution, requested_accuracy, wants_errors
from hybrid.scene.schema import LineScene

# s per cell and Newton iteration, in space and in a plane.
COST = {"rod": (0.4e-6, 0.16e-6), "catenary": (0.095e-6, 0.09e-6)}
# What optional forces add to that; those that are not here add nothing measurable.
MORE = {
    DRAG: (0.03e-6, 0.025e-6), ADDED_MASS: (0.03e-6, 0.025e-6), STIFFNESS_DAMPING: (0.05e-6, 0.0),
    SURFACE: (0.035e-6, 0.015e-6), SEABED: (0.024e-6, 0.018e-6), FRICTION: (0.01e-6, 0.005e-6),
}  # fmt: skip
MORE_OF_RODS = {ROTARY: (0.025e-6, 0.005e-6)}
# s per node, step and wave: sines and exponentials; of nodes that are not below all motion of the water.
COST_WAVE = 10e-9
# s of a run, a step, an output.
COST_RUN, COST_STEP, COST_OUTPUT = 0.02, 12e-6, 0.1e-3
# s of a step of zones that move, and of each of their cells: criteria, and the joints of a rod.
COST_MANAGER, COST_CRITERIA = 3e-6, 0.03e-6
COST_CORRECTOR = 0.23e-6  # s per cell and step, where the error of leaving bending out is followed
USUAL_ITERATIONS = 2.1
# Part of a line of moving zones that is rod, on average over scenes, which differ from none to all.
ROD_SHARE = 0.38
# Moments at which the motion of the ends is looked at to foretell its steps, spread as multiples of this part of its
# duration, which no period shares; m/s3, less of which counts as none.
LOOKS, GOLDEN, TINY_RATE = 48, 0.6180339887498949, 1e-12
# Steps that follow the motion, of the least number there may be, and of those that the motion of its ends asks for: a
# line moves more sharply.
MORE_STEPS, SHARPER = 1.5, 2.2
# Times a run that a run with its coarser ones costs; with an accuracy, also the mesh pre-run and, perhaps, a finer run.
COST_ERRORS, COST_ACCURACY = 2.1, 2.6
COST_SURVEY = 0.1  # s, of the mesh pre-run and of judging errors, whatever the scene


def foretold_steps(scene: LineScene, model: Model, resolution: Resolution, least: int) -> int:
    """Steps of a run: `least` where they are of fixed length, else as many as the motion is likely to ask for.

    The error of a step grows with the rate at which the acceleration changes (docs/theory.md, (T3c)), of which that of
    the ends is known beforehand.
    """
    time, longest = scene.require_time(), resolution.step
    if resolution.local is None:
        return least
    more = MORE_STEPS * least
    if not model.ends.motions:
        return round(more)
    apart = 0.25 * longest
    moments = np.maximum((np.arange(LOOKS) * GOLDEN % 1.0) * time.duration, 2.0 * apart)
    found = [model.ends.acceleration(t + apart, apart) - model.ends.acceleration(t - apart, apart) for t in moments]
    model.ends.at(0.0)
    rate = np.linalg.norm(found, axis=2).max(axis=1) / (2.0 * apart)
    *_, part = weights.py_func(time.rho_inf, time.rho_inf, 1.0)
    lengths = SAFETY * (resolution.local / np.maximum(part * rate, TINY_RATE)) ** (1.0 / 3.0)
    return round(max(more, SHARPER * float(np.mean(time.duration / np.minimum(lengths, longest)))))


def step_time(
    scene: LineScene, model: Model, rods: float, catenaries: float, moves: bool = False, followed: float = 0.0
) -> float:
    """Processor time, s, of a step of a line of so many cells of either kind.

    model: of the scene, with whatever cells; moves: zones move; followed: part of the steps at which the error of
    leaving bending out is followed.
    """
    flat, total, bits = model.plane is not None, rods + catenaries, model.line.bits
    each = COST["rod"][flat] * rods + COST["catenary"][flat] * catenaries
    each += total * sum(cost[flat] for bit, cost in MORE.items() if bits & bit)
    each += rods * sum(cost[flat] for bit, cost in MORE_OF_RODS.items() if bits & bit)
    each *= USUAL_ITERATIONS
    waves = scene.environment.waves
    if waves is not None:
        each += COST_WAVE * waves.waves_in_sum * total * _stirred(model)
    each += COST_CORRECTOR * total * followed
    return each + COST_STEP + (COST_MANAGER + COST_CRITERIA * total) * moves


def _stirred(model: Model) -> float:
    """Part of the nodes of the first shape that waves reach; below them no wave is summed up."""
    return float(np.mean(model.start.r[:, 2] > calm_below.py_func(model.sea.values)))


def processor_time(scene: LineScene, model: Model, cells: Sequence[int], steps: int, outputs: float) -> float:
    """Processor time, s, of a run with so many steps; cells: of each zone of the model, if all is rod."""
    if scene.time is None:
        return 0.0
    counts = {"rod": 0.0, "catenary": 0.0}
    for zone, count in zip(model.zones, cells, strict=True):
        counts[zone.kind] += count
    if model.layout is not None:
        counts = {"rod": ROD_SHARE * model.cells, "catenary": (1.0 - ROD_SHARE) * model.layout.rod.size}
    step = step_time(scene, model, counts["rod"], counts["catenary"], model.layout is not None, model.follows_error)
    one = COST_RUN + steps * step + outputs * COST_OUTPUT
    if not wants_errors(scene):
        return one
    return COST_ERRORS * one if requested_accuracy(scene) is None else COST_ACCURACY * one + COST_SURVEY
