"""What would be computed for a scene, said before anything is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import ceil

from hybrid.errors import Complaint, SceneError
from hybrid.kernels.forces import ADDED_MASS, DRAG, FRICTION, ROTARY, SEABED, STIFFNESS_DAMPING, SURFACE, WAVES
from hybrid.model.build import build
from hybrid.model.ledger import Entry
from hybrid.model.mesh import Zone
from hybrid.model.resolution import first_resolution, wants_errors
from hybrid.scene.read import SceneLike, as_scene
from hybrid.scene.schema import Scene


@dataclass(frozen=True)
class Plan:
    """What a scene requires: the ledger, the mesh, the unknowns, and a cost estimate."""

    ledger: tuple[Entry, ...]
    zones: tuple[Zone, ...]
    cells: tuple[int, ...]  # per zone
    base_cells: int | None  # where zones move: cells if all were catenary; `cells` are those if all were rod
    unknowns: int
    steps: int
    step: float  # s, of most steps: the scene's, shortened to fit between outputs
    seconds: float  # of processor time, from the measured cost per cell and iteration


# Processor time per cell and Newton iteration (s), per step and per output, as bench/test_bench_cost.py and
# test_bench_parts.py print them on one core; a plan promises an order of magnitude, not more.
COST = {"rod": 0.45e-6, "catenary": 0.15e-6}
FLAT_COST = {"rod": 0.15e-6, "catenary": 0.08e-6}  # in a plane, with the push that watches it
# What optional forces add to that, in space and in a plane; those that are not here add nothing that can be seen.
MORE = {
    DRAG: (0.045e-6, 0.010e-6), ADDED_MASS: (0.045e-6, 0.013e-6), STIFFNESS_DAMPING: (0.05e-6, 0.0),
    ROTARY: (0.025e-6, 0.005e-6), SURFACE: (0.035e-6, 0.015e-6), WAVES: (0.025e-6, 0.025e-6),
    SEABED: (0.03e-6, 0.018e-6), FRICTION: (0.01e-6, 0.005e-6),
}  # fmt: skip
COST_STEP, COST_MANAGER, COST_OUTPUT = 25e-6, 15e-6, 0.3e-3
USUAL_ITERATIONS = 2.2
COST_ERRORS = 1.9  # times a run that a run with its coarser ones costs (bench/test_bench_accuracy.py, share)
COST_CORRECTOR = 0.3  # of the catenary's own, where the error of leaving bending out is followed
MOST_OUTPUTS, MOST_STEPS = 1_000_000, 1e12
# Numbers that a result has per point and output, some twenty, and the largest file that still fits a disk.
VALUES, MOST_BYTES = 20, 1e11
OUTPUTS = 100  # of a run whose scene does not say how often


def parts(length: float, step: float) -> int:
    """How many equal parts, none longer than `step` but for round-off, make up `length`."""
    return max(1, ceil(min(length / step, 1e18) * (1.0 - 1e-12) - 1e-9))


def output_interval(scene: Scene) -> float:
    """Time between two outputs, s; a scene that does not say how often gets OUTPUTS, or one a step."""
    time = scene.require_time()
    return scene.output.every or max(time.duration / OUTPUTS, time.step or 0.0)


def refuse_too_much(scene: Scene) -> None:
    """SceneError for more outputs, points or steps than a disk and a life have room for, before any is made."""
    time, every = scene.require_time(), output_interval(scene)
    count = time.duration / every
    if count > MOST_OUTPUTS:
        fix = f"output.every: {time.duration / 1000:.3g} makes a thousand"
        expected = f"at most {MOST_OUTPUTS} outputs"
        raise SceneError([Complaint("output.every", f"{every:g} s, {count:.3g} outputs", expected, fix)])
    points = scene.output.points if isinstance(scene.output.points, int) else len(scene.output.points)
    size = (count + 1.0) * points * VALUES * 8
    if size > MOST_BYTES:
        given = f"{points} points at {count + 1.0:.6g} times, some {size / 1e9:.3g} GB"
        fix = f"output.points: 101, or output.every: {time.duration / 100:.3g}"
        raise SceneError([Complaint("output.points", given, f"a result of at most {MOST_BYTES / 1e9:g} GB", fix)])
    steps = time.duration / (time.step or time.duration)
    if steps > MOST_STEPS:
        expected = f"at most {MOST_STEPS:g} steps, some months of computing"
        raise SceneError([Complaint("time.step", f"{time.step:g} s, {steps:.3g} steps", expected, "make it larger")])


def output_times(scene: Scene) -> list[float]:
    """Times (s) of the outputs after the first."""
    refuse_too_much(scene)
    time, every = scene.require_time(), output_interval(scene)
    return [k * every for k in range(1, parts(time.duration, every))] + [time.duration]


def step_ends(start: float, stop: float, step: float) -> Iterator[float]:
    """End times of equal steps, none longer than `step`, from `start` to `stop`."""
    n = parts(stop - start, step)
    for k in range(1, n):
        yield start + (stop - start) * k / n
    yield stop


def count_steps(scene: Scene) -> int:
    """Steps of a run: each interval between two outputs is cut into equal ones (a load that stops may add one).

    Where steps follow the motion: the least that there may be.
    """
    time, every = scene.require_time(), output_interval(scene)
    step = first_resolution(scene).step
    whole = parts(time.duration, every) - 1
    last = time.duration - whole * every
    return whole * parts(every, step) + parts(last, step)


def plan(scene: SceneLike) -> Plan:
    """What would be computed for a scene (a Scene, the path of a scene file, or a dict); nothing is computed."""
    scene = as_scene(scene)
    if scene.time:
        refuse_too_much(scene)
    model = build(scene)
    middle = 0.5 * (model.line.s[:-1] + model.line.s[1:])
    cells = tuple(int(((middle > z.s_a) & (middle < z.s_b)).sum()) for z in model.zones)
    steps, step = 0, 0.0
    if scene.time:
        every = output_interval(scene)
        steps, step = count_steps(scene), every / parts(every, first_resolution(scene).step)
    cost = COST if model.plane is None else FLAT_COST
    each = sum(cost[z.kind] * c for z, c in zip(model.zones, cells, strict=True))
    each += model.cells * sum(x[model.plane is not None] for bit, x in MORE.items() if model.line.bits & bit)
    each *= 1.0 + COST_CORRECTOR * model.follows_error
    names = {"catenary": "corrected"} if model.corrected else {}
    zones = tuple(replace(z, kind=names.get(z.kind, z.kind)) for z in model.zones)
    per_step = COST_STEP + (COST_MANAGER if model.layout is not None else 0.0)
    outputs = scene.time.duration / output_interval(scene) if scene.time else 0.0
    seconds = steps * (USUAL_ITERATIONS * each + per_step) + outputs * COST_OUTPUT
    seconds *= COST_ERRORS if wants_errors(scene) else 1.0
    return Plan(
        model.ledger, zones, cells, model.layout.rod.size if model.layout else None, model.unknowns, steps, step,
        seconds,
    )  # fmt: skip
