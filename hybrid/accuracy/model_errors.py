"""What leaving bending out changes in a run.

Of a cable it is followed along a run to compare with.  Lines that are joined move each other: they are computed once
more, as rods, and compared.  As of one cable the figure is that of a run to compare with, whose cells and steps are
longer.  The rods have the cells of that run, and where zones have moved those of its rods, so that both have the same
error by the mesh.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from hybrid.accuracy.error_order import COARSER, magnitude
from hybrid.errors import ComputationError, SceneError
from hybrid.model.build import Model
from hybrid.model.network import NetworkModel, NetworkResolution, build_system
from hybrid.scene.analysis import CatenaryZone, Mesh, RodModel, RodZone, ZonesModel
from hybrid.scene.network import JoinedLine
from hybrid.scene.network_scene import Network
from hybrid.simulation.run_sample import END_FORCES, NOT_ESTIMATED, RIGHT, RunSample, Samples

Stretches = Collection[tuple[float, float]]  # m, of s


class Comparable(Protocol):
    """What of a case is asked here."""

    moves: bool
    flat: bool

    @property
    def network(self) -> Network: ...
    def instead(self, scene: Any) -> AbstractContextManager[None]: ...
    def sample(self, resolution: NetworkResolution, *, model: bool = False) -> Samples: ...


def with_model_errors(case: Comparable, runs: Samples, costs: list[float]) -> Samples:
    """A run with what leaving bending out changes in it, where none could follow that.

    costs: s of processor time, to which that of the rods is added.
    """
    if case.flat:
        return runs
    finely = NetworkResolution({name: x.resolution for name, x in runs.items()})
    rods, finely, names = as_rods(case.network, finely, {name: x.rods for name, x in runs.items()})
    found, failed = None, ""
    try:
        if names:
            with case.instead(rods):
                found = case.sample(finely)
            costs.append(next(iter(found.values())).cpu)
    except (ComputationError, SceneError) as error:
        failed = str(error).splitlines()[0]
    return against_rods(runs, found, names, failed)


def model_errors_of(case: Comparable, result: Samples, costs: list[float]) -> Samples:
    """A run with what leaving bending out changes in a result: on its cells in longer steps, or beside rods.

    costs: as of `with_model_errors`.  ComputationError.
    """
    if not case.flat:
        return with_model_errors(case, result, costs)
    finely = NetworkResolution({name: x.resolution for name, x in result.items()})
    found = case.sample(finely.coarser(1.0, COARSER if case.moves else 1.0), model=True)
    costs.append(next(iter(found.values())).cpu)
    return found


def leaves_bending_out(line: JoinedLine) -> bool:
    """Whether a line that can bend has catenaries."""
    return any(x.weakest_bending for x in line.sections) and not isinstance(line.chosen_model, RodModel)


def as_rods(
    system: Network, resolution: NetworkResolution, rods: Mapping[str, Stretches]
) -> tuple[Network, NetworkResolution, list[str]]:
    """The same with rods in place of catenaries, how finely, and the names of the lines that this changes.

    resolution: of a run of the system; rods: stretches of its lines that were rod at some time in it.
    """
    names = [
        name
        for name, line in system.lines.items()
        if leaves_bending_out(line) and sum(b - a for a, b in _joined(rods[name])) < line.cable.length * (1 - 1e-9)
    ]
    if not names:
        return system, resolution, []
    model, lines, finely = build_system(system, resolution=resolution), dict(system.lines), dict(resolution.lines)
    for name in names:
        nodes = _nodes(_model_of(model, name), rods[name])
        update = {"model": _rods(system.lines[name]), "mesh": Mesh(nodes=tuple(nodes.tolist()))}
        lines[name] = system.lines[name].model_copy(update=update)
        finely[name] = replace(resolution.lines[name], fineness=1.0, grading=None)
    return system.model_copy(update={"lines": lines}), NetworkResolution(finely), names


def against_rods(
    runs: Mapping[str, RunSample], rods: Mapping[str, RunSample] | None, names: Collection[str], failed: str = ""
) -> Samples:
    """Samples of a run with what leaving bending out changes in them.

    rods: samples of the same lines as rods; None: there are none, because that run failed; names: of the lines that
    leave bending out.  All lines get the error, because what one of them leaves out moves the others.
    """
    if not names:
        return dict(runs)
    if rods is None:
        text = f"what bending would change in its catenaries is not known: with rods in place of them: {failed}"
        note = ((NOT_ESTIMATED, f"{text}; `model: rod`, or a finer mesh, tells why"),)
        return {name: replace(x, notes=(*x.notes, *note)) if name in names else x for name, x in runs.items()}
    return {name: replace(x, model_error=_difference(x, rods[name])) for name, x in runs.items()}


def _difference(run: RunSample, rods: RunSample) -> dict[str, np.ndarray]:
    called = END_FORCES | RIGHT
    both = [name for name in run.values if name in rods.values]
    return {
        called.get(name, name): magnitude(np.asarray(rods.values[name]) - np.asarray(run.values[name]), name)
        for name in both
    }


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
