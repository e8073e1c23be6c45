"""What leaving bending out changes in a run: the same with rods in place of catenaries is computed, and compared.

Lines that are joined move each other: all get the error that one of them has.  The rods have the cells and the very
steps of the run, and where zones have moved those of its rods, so that both have the same error by the mesh and by the
step.  Beside point loads and clamps that catenaries bend at they have shorter cells, within which bending fades.  A run
to compare with, whose cells and steps are longer, shows it of catenaries that move and touch nothing; else the result
does.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import Any, NamedTuple, Protocol

import numpy as np

from hybrid.accuracy.error_order import magnitude
from hybrid.errors import ComputationError, SceneError
from hybrid.model.build import Model
from hybrid.model.mesh import GROWTH
from hybrid.model.network import NetworkModel, NetworkResolution, build_system
from hybrid.model.resolution import Resolution
from hybrid.model.sections import OutputPoints
from hybrid.scene.analysis import CatenaryZone, Mesh, RodModel, RodZone, ZonesModel
from hybrid.scene.network import JoinedLine, Network
from hybrid.simulation.run_sample import END_FORCES, NOT_ESTIMATED, RIGHT, RunSample, Samples

Stretches = Collection[tuple[float, float]]  # m, of s
CELLS = 4.0  # of rods to a length sqrt(EI/T) beside point loads and clamps: the curvature there is 1 % off


class _EndCell(NamedTuple):
    """Outputs within a cell at an end: a rod and a catenary are drawn there each in its own way.

    How far each is off is an error of cells (outputs.edge_errors).
    """

    within: np.ndarray  # their numbers
    nodes: tuple[int, int]  # of the output at the end, and the first beyond the cell
    parts: np.ndarray  # (2, n) of the values at these two, in the values within


class Comparable(Protocol):
    """What of a case is asked here."""

    scene: Any
    moves: bool
    points: dict[str, OutputPoints]

    @property
    def names(self) -> Mapping[str, str]: ...
    def instead(self, scene: Any) -> AbstractContextManager[None]: ...
    def sample(self, resolution: NetworkResolution) -> Samples: ...


def with_model_errors(case: Comparable, runs: Samples, costs: list[float]) -> Samples:
    """A run with what leaving bending out changes in it.

    costs: s of processor time, to which that of the rods is added.  All lines get the error, because what one of them
    leaves out moves the others.
    """
    network = case.scene
    names = [name for name, x in runs.items() if leaves_bending_out(network.lines[name], x)]
    if not names:
        return dict(runs)
    finely = NetworkResolution({name: _in_steps_of(x) for name, x in runs.items()})
    changes, finely, ends = as_rods(network, finely, {name: runs[name] for name in names}, case.points)
    try:
        with case.instead(case.scene.with_lines(changes)):
            rods = case.sample(finely)
    except (ComputationError, SceneError) as error:
        text = f"with rods in place of them: {str(error).splitlines()[0]}; `model: rod`, or a finer mesh, tells why"
        note = ((NOT_ESTIMATED, f"what bending would change in its catenaries is not known: {text}"),)
        return {name: replace(x, notes=(*x.notes, *note)) if name in names else x for name, x in runs.items()}
    costs.append(next(iter(rods.values())).cpu)
    return {name: replace(x, model_error=_difference(x, rods[name], ends.get(name, ()))) for name, x in runs.items()}


def _in_steps_of(run: RunSample) -> Resolution:
    """The resolution of a run in the very steps that it took: of others, the difference would be of steps."""
    if run.resolution.local is None or not len(run.forces):
        return run.resolution
    return replace(run.resolution, local=None, ends=tuple(run.forces[:, 0].tolist()))


def goes_by_cells(case: Comparable, runs: Samples) -> bool:
    """Whether longer cells do not show what leaving bending out changes, or hardly cost less.

    They do not beside joints of rods and catenaries, and where a line touches down: bending fades within a cell there.
    An equilibrium costs little on any cells.
    """
    network = case.scene
    left_out = [x for name, x in runs.items() if leaves_bending_out(network.lines[name], x)]
    return not case.moves or any(x.rods or may_touch(network) for x in left_out)


def may_touch(network: Network) -> bool:
    """Whether there is a bed or an obstacle."""
    return network.environment.seabed is not None or bool(network.surfaces)


def can_leave_bending_out(line: JoinedLine) -> bool:
    """Whether a line that can bend may be catenary somewhere."""
    return any(x.weakest_bending for x in line.sections) and not isinstance(line.chosen_model, RodModel)


def leaves_bending_out(line: JoinedLine, run: RunSample) -> bool:
    """Whether a line that can bend was catenary anywhere, at any time of a run."""
    if not can_leave_bending_out(line):
        return False
    if run.catenary.size:  # zones have moved
        return bool(run.catenary.any())
    return sum(b - a for a, b in _joined(run.rods)) < line.cable.length * (1 - 1e-9)


def as_rods(
    network: Network, resolution: NetworkResolution, runs: Samples, points: Mapping[str, OutputPoints]
) -> tuple[dict[str, dict[str, Any]], NetworkResolution, dict[str, list[_EndCell]]]:
    """Tables of lines with rods in place of catenaries, by name, how finely they are computed, and their end cells.

    resolution: of a run of the network; runs: of the lines that change in it; points: where outputs of lines are.
    """
    model, tables, finely = build_system(network, resolution=resolution), {}, dict(resolution.lines)
    ends: dict[str, list[_EndCell]] = {}
    for name, run in runs.items():
        line, s = _model_of(model, name), points[name].s
        tension = np.asarray(run.values["tension"]).max(axis=0)
        nodes, s = _nodes(line, run.rods), s[run.places] if run.places.size else s
        ends[name] = list(_end_cells(line, nodes, s))
        for at, short in _kinks(line, s, tension):
            nodes = _with_layer(nodes, at, short, run.rods)
        tables[name] = {"model": _rods(network.lines[name]), "mesh": Mesh(nodes=tuple(nodes.tolist()))}
        finely[name] = replace(resolution.lines[name], fineness=1.0, grading=None, parts=1)
    return tables, NetworkResolution(finely), ends


def _difference(run: RunSample, rods: RunSample, ends: Iterable[_EndCell]) -> dict[str, np.ndarray]:
    """By quantity; of moments, which a catenary has none of, all of them.

    ends: cells within which curvature differs as it does from node to node.
    """
    called, there = END_FORCES | RIGHT, {name: np.asarray(x) for name, x in run.values.items()}
    found = {
        called.get(name, name): magnitude(np.asarray(x) - there.get(name, 0.0), name) for name, x in rods.values.items()
    }
    for x in ends if "curvature" in found else ():
        found["curvature"][:, x.within] = found["curvature"][:, list(x.nodes)] @ x.parts
    return found


def _model_of(model: NetworkModel, name: str) -> Model:
    return model.models[model.names.index(name)]


def _joined(stretches: Stretches) -> list[tuple[float, float]]:
    """The same without overlaps, in order."""
    out: list[tuple[float, float]] = []
    for a, b in sorted(stretches):
        if out and a <= out[-1][1]:
            out[-1] = out[-1][0], max(b, out[-1][1])
        else:
            out.append((a, b))
    return out


def _nodes(model: Model, rods: Stretches) -> np.ndarray:
    """Nodes (m) of a line whose zones stay, or, where they move, of base cells and of rods where there were any."""
    layout = model.layout
    if layout is None:
        return model.line.s
    s, near = layout.finest.nodes, 1e-9 * model.length
    kept = np.zeros(s.size, bool)
    kept[layout.starts] = True
    for a, b in rods:
        kept |= (s >= a - near) & (s <= b + near)
    return s[kept]


def _end_cells(model: Model, nodes: np.ndarray, s: np.ndarray) -> Iterator[_EndCell]:
    """The cells at ends that turn freely, of nodes and outputs at these s (m), where there is one at the end."""
    ends, cells = (0, s.size - 1), (nodes[1] - nodes[0], nodes[-1] - nodes[-2])
    for end, place, cell, held in zip(ends, (nodes[0], nodes[-1]), cells, model.cable.held_tangent, strict=True):
        away = np.abs(s - place)
        within, beyond = np.flatnonzero((away > 0.0) & (away < cell)), np.flatnonzero(away >= cell)
        if not held and away[end] == 0.0 and within.size and beyond.size:
            other = int(beyond[np.argmin(away[beyond])])
            part = away[within] / away[other]
            yield _EndCell(within, (end, other), np.array([1.0 - part, part]))


def _kinks(model: Model, s: np.ndarray, tension: np.ndarray) -> Iterator[tuple[float, float]]:
    """Point loads and clamps (m), and how long cells of rods are there; tension: N, the largest at s (m).

    None of a line that is paid out, whose winch makes its cells.
    """
    cable, ends = model.cable, (0.0, model.length)
    for at in (
        ()
        if model.payout is not None
        else {*model.attached, *(x for x, held in zip(ends, cable.held_tangent, strict=True) if held)}
    ):
        EI, T = float(cable.mean_bending[cable.piece(np.array([at]))[0]]), float(np.interp(at, s, tension))
        if EI > 0.0 < T:
            yield at, float(np.sqrt(EI / T)) / CELLS


def _with_layer(nodes: np.ndarray, at: float, short: float, rods: Stretches) -> np.ndarray:
    """Nodes (m) with others beside a place: cells of a length there, which grow away from it, in place of longer ones.

    rods: stretches that keep their cells.
    """
    more = list[float]()
    for way, end in ((-1.0, nodes[0]), (1.0, nodes[-1])):
        far = step = short
        while far < way * (end - at):
            x = at + way * far
            k = min(max(int(np.searchsorted(nodes, x)), 1), nodes.size - 1)
            if any(a <= x <= b for a, b in rods) or nodes[k] - nodes[k - 1] < step:
                break
            if min(nodes[k] - x, x - nodes[k - 1]) > 0.5 * step:
                more.append(x)
            step = short + GROWTH * far
            far += step
    return np.union1d(nodes, more)


def _rods(line: JoinedLine) -> RodModel | ZonesModel:
    """Rod wherever a line can bend."""
    kinds = [bool(x.weakest_bending) for x in line.sections]
    if all(kinds):
        return RodModel()
    lengths: list[tuple[bool, float]] = []
    for kind, section in zip(kinds, line.sections, strict=True):
        before = lengths.pop()[1] if lengths and lengths[-1][0] is kind else 0.0
        lengths.append((kind, before + section.length))
    zones = tuple(RodZone(rod=x) if kind else CatenaryZone(catenary=x) for kind, x in lengths)
    return ZonesModel(zones=zones)
