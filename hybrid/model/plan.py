"""What would be computed for a scene, said before anything is."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

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
    unknowns: int
    steps: int
    seconds: float  # of processor time, from the measured cost per cell and iteration


# Processor time per cell and Newton iteration (s) and per step, as tests/bench/bench_cost.py
# prints them on one core; a plan promises an order of magnitude, not more.
COST = {"rod": 0.3e-6, "catenary": 0.1e-6}
COST_STEP = 50e-6
USUAL_ITERATIONS = 2.5


def plan(scene: Scene) -> Plan:
    """Say what would be computed for a scene, and compute nothing."""
    model = build(scene)
    middle = 0.5 * (model.line.s[:-1] + model.line.s[1:])
    cells = tuple(int(((middle > z.s_a) & (middle < z.s_b)).sum()) for z in model.zones)
    steps = ceil(scene.time.duration / scene.time.step - 1e-9) if scene.time else 0
    each = sum(COST[z.kind] * c for z, c in zip(model.zones, cells, strict=True))
    return Plan(model.ledger, model.zones, cells, model.unknowns, steps, steps * (USUAL_ITERATIONS * each + COST_STEP))
