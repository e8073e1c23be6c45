"""What would be computed for a scene, said before anything is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import ceil

from hybrid.errors import Complaint, SceneError
from hybrid.model.build import build
from hybrid.model.ledger import Entry
from hybrid.model.mesh import Zone
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


# Processor time per cell and Newton iteration (s) and per step, as tests/bench/test_bench_cost.py
# prints them on one core; a plan promises an order of magnitude, not more.
COST = {"rod": 0.45e-6, "catenary": 0.15e-6}
COST_STEP = 25e-6
COST_CORRECTOR = 0.3  # of the catenary's own, where the error of leaving bending out is followed
USUAL_ITERATIONS = 2.5
MOST_OUTPUTS, MOST_STEPS = 1_000_000, 1e12
OUTPUTS = 100  # of a run whose scene does not say how often


def parts(length: float, step: float) -> int:
    """How many equal parts, none longer than `step` but for round-off, make up `length`."""
    return max(1, ceil(min(length / step, 1e18) * (1.0 - 1e-12) - 1e-9))


def output_interval(scene: Scene) -> float:
    """Time between two outputs, s; a scene that does not say how often gets OUTPUTS, or one a step."""
    time = scene.require_time()
    return scene.output.every or max(time.duration / OUTPUTS, time.step)


def output_times(scene: Scene) -> list[float]:
    """Times (s) of the outputs after the first."""
    time, every = scene.require_time(), output_interval(scene)
    count = time.duration / every
    if count > MOST_OUTPUTS:
        fix = f"output.every: {time.duration / 1000:.3g} makes a thousand"
        expected = f"at most {MOST_OUTPUTS} outputs"
        raise SceneError([Complaint("output.every", f"{every:g} s, {count:.3g} outputs", expected, fix)])
    steps = time.duration / time.step
    if steps > MOST_STEPS:
        expected = f"at most {MOST_STEPS:g} steps, some months of computing"
        raise SceneError([Complaint("time.step", f"{time.step:g} s, {steps:.3g} steps", expected, "make it larger")])
    return [k * every for k in range(1, parts(time.duration, every))] + [time.duration]


def step_ends(start: float, stop: float, step: float) -> Iterator[float]:
    """End times of equal steps, none longer than `step`, from `start` to `stop`."""
    n = parts(stop - start, step)
    for k in range(1, n):
        yield start + (stop - start) * k / n
    yield stop


def count_steps(scene: Scene) -> int:
    """Steps of a run: each interval between two outputs is cut into equal ones (a load that stops may add one)."""
    time, every = scene.require_time(), output_interval(scene)
    whole = parts(time.duration, every) - 1
    last = time.duration - whole * every
    return whole * parts(every, time.step) + parts(last, time.step)


def plan(scene: Scene) -> Plan:
    """Say what would be computed for a scene, and compute nothing."""
    model = build(scene)
    middle = 0.5 * (model.line.s[:-1] + model.line.s[1:])
    cells = tuple(int(((middle > z.s_a) & (middle < z.s_b)).sum()) for z in model.zones)
    steps, step = 0, 0.0
    if scene.time:
        every = output_interval(scene)
        steps, step = count_steps(scene), every / parts(every, scene.time.step)
    each = sum(COST[z.kind] * c for z, c in zip(model.zones, cells, strict=True))
    names = {"catenary": "corrected"} if model.corrected else {}
    zones = tuple(replace(z, kind=names.get(z.kind, z.kind)) for z in model.zones)
    each *= 1.0 + COST_CORRECTOR * model.follows_error
    return Plan(
        model.ledger, zones, cells, model.layout.rod.size if model.layout else None, model.unknowns, steps, step,
        steps * (USUAL_ITERATIONS * each + COST_STEP),
    )  # fmt: skip
