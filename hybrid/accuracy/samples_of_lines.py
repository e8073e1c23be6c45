"""What is compared of the lines of a system: of a run that is only to be compared with, and of a complete result."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hybrid.model.build import Model
from hybrid.model.resolution import Resolution, follows_curvature, has_limits
from hybrid.outputs.edge_errors import EDGE_ERRORS, MISSED
from hybrid.scene.network_scene import Network
from hybrid.scene.schema import AdaptiveModel
from hybrid.simulation.line_result import LineResult
from hybrid.simulation.network_run import NetworkRun
from hybrid.simulation.run_sample import COMPARED, RunSample, catenary_share, compared_cells, split_outputs, usual_cells
from hybrid.store.comparison_recorder import ComparisonRecorder
from hybrid.store.envelope import GROUP as ENVELOPE
from hybrid.store.limits import EXTREMES, extremes_about
from hybrid.store.reader import Result
from hybrid.store.records import THERE


def compared(line: LineResult, run: NetworkRun, cpu: float) -> RunSample:
    """What is compared of a line in a run that is only to be compared with; cpu: s, of all lines."""
    found, resolution = line.recorder, run.resolution.lines[line.name]
    assert isinstance(found, ComparisonRecorder)
    values, _ = split_outputs({name: found[name] for name in found.names})
    catenary = found.catenary if isinstance(line.scene.model, AdaptiveModel) else np.zeros(0)
    fineness = resolution.fineness if follows_curvature(line.scene) else 0.0
    asked = run.quantities.ranges_of(line.name)
    held = {x.name: y for x, y in line.envelope.fixed()} if asked or has_limits(line.scene) else {}
    held |= line.envelope.values(line.model.nodes, line.books.extremes, run.t) | asked
    return RunSample(
        resolution, values, compared_cells(line.model, fineness), max(run.steps, 1), cpu, resolution.every,
        forces=found.steps, catenary=catenary, extremes=extremes_about(held, line.observer.s),
    )  # fmt: skip


def touch_unasked(system: Network, result: Result) -> bool:
    """Whether a line of which contact is not asked for touches itself in a result."""
    return any(
        system.lines[name].contact.self is None and any(event.kind == "line touches itself" for event in line.events)
        for name, line in result.lines.items()
    )


def extremes_of(system: Network, result: Result, name: str) -> dict[str, np.ndarray]:
    """What limits of a line, and of quantities that are asked of it, are held against."""
    line, asked = result.lines[name], (f"{EXTREMES}/{x}" for x, q in system.output.quantities.items() if q.line == name)
    held = {x: line[x] for x in line.names if x.startswith((ENVELOPE, EXTREMES))}
    return extremes_about(held | {x: result[x] for x in asked if x in result}, line.s)


def sample_of(
    line: Result, resolution: Resolution, model: Model, cpu: float, extremes: Mapping[str, np.ndarray]
) -> RunSample:
    """What is compared of a line in a complete result; model: as it began; cpu: s, of all lines; extremes: of it."""
    values = {name: np.asarray(line[name]) for name in COMPARED if name in line}
    columns = [f"steps/{name}" for name in ("t", "end_force_start", "end_force_end")]
    forces = np.zeros((0, 3))
    if len(line.times) > 1 and columns[0] in line:
        forces = np.column_stack([line[name] for name in columns])
    unresolved = any(event.kind == "unresolved bend" for event in line.events)
    catenary = np.array([catenary_share(zones) for zones in line.zones]) if model.layout is not None else np.zeros(0)
    cells = compared_cells(model)
    if THERE in line:
        cells = compared_cells(model, resolution.fineness, usual_cells(line[THERE]))
    return RunSample(
        resolution, values, cells, max(len(forces), 1), cpu, resolution.every, unresolved,
        forces=forces, catenary=catenary, extremes=extremes if len(line.times) > 1 else {},
        at_edges={x: np.asarray(line[EDGE_ERRORS + x]) for x in MISSED if EDGE_ERRORS + x in line},
    )  # fmt: skip
