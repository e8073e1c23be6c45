"""Shorter cells where a rod bends within less than a cell, of a scene that leaves the mesh open and asks for nothing.

    symbol   meaning                                                             unit
    EI       bending stiffness, about the weaker axis                            N m2
    lambda   sqrt(EI/T), over which a bend at a clamp or point load fades        m

What the equilibrium on the usual mesh shows decides: where cells are longer than a part of lambda beside a clamp, a
point load or a change of section that bends the line, or turn too far.  Elsewhere, and where nothing is hidden, the
mesh stays as it is.  Where an accuracy is asked for, a pre-run places the cells (`mesh_survey`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from hybrid.errors import ComputationError
from hybrid.kernels.state.state import Floats, State
from hybrid.model.build import Model, twist_rate
from hybrid.model.mesh import DEFAULT_CELLS, GROWTH, SAMPLES, Grading, layers
from hybrid.model.network import NetworkResolution, build_system
from hybrid.model.payout import payout_of
from hybrid.model.resolution import Resolution, follows_curvature, mesh_is_free, shows_bends, wants_survey
from hybrid.scene.network import Network
from hybrid.scene.schema import LineScene
from hybrid.simulation.mesh_survey import MORE
from hybrid.simulation.progress import at_once

# Cells to a length lambda at a place that bends a rod, and beyond how many such lengths a longer cell hides the bend:
# the curvature at the end of an exponential layer is then off by 1 % and by about 4 %.
CELLS, HIDDEN = 4.0, 0.5
# Shortest length lambda that is shown, as a part of the line: below, cells would be shorter than any cable is thick.
SHORTEST = 1e-6
# rad by which a point load or a change of section turns a line before it counts; a clamp always does.
TURNED = 0.02
# rad that a cell may turn through before it is cut, and does turn through then.
MOST_TURN, TURN = 0.3, 0.1
# rad that a cell of a pre-run may turn through in its first state, and how often its cells are placed anew until then.
MOST_FOLD, ROUNDS = 0.6, 6
# Places in geometric order on either side of a disturbed one, as parts of lambda.
BESIDE = np.concatenate([[0.0], np.geomspace(0.05, 20.0, 40)])


# Gives models of lines with their first states, by name, on such cells.  ComputationError: there is no equilibrium.
Rests = Callable[[NetworkResolution], Mapping[str, tuple[Model, State]]]


def layered(scenes: Mapping[str, LineScene], resolution: NetworkResolution, rests: Rests) -> NetworkResolution:
    """With cells as bends and layers of the equilibrium ask for, of rods whose mesh is left open, without a pre-run.

    scenes: of the lines by name.  Zones that move have the mesh of rods, hence that of an equilibrium of rods.
    """
    wanted = [x for x, scene in scenes.items() if _is_open(scene, resolution.lines[x]) and not wants_survey(scene)]
    if not any(shows_bends(scenes[name]) for name in wanted):
        return resolution
    try:
        rest = rests(resolution)
    except ComputationError:
        return resolution  # the run says why
    found = {name: grading_of(scenes[name], *rest[name]) for name in wanted}
    return _graded(resolution, found)


def shown(scenes: Mapping[str, LineScene], resolution: NetworkResolution, rests: Rests) -> NetworkResolution:
    """With cells on which the equilibrium is found, and bends no rod by more than MOST_FOLD from one cell to the next.

    Of lines that have a pre-run.  A slack bend is often shorter than the cells of that by far, and on such cells it may
    be anywhere.
    """
    wanted = [x for x, scene in scenes.items() if _is_open(scene, resolution.lines[x]) and wants_survey(scene)]
    tried, found = resolution, resolution
    for _ in range(ROUNDS if wanted else 0):
        try:
            rest = rests(tried)
        except ComputationError:
            lines = tried.lines.items()
            tried = NetworkResolution({k: x.coarser(cells=0.5) if k in wanted else x for k, x in lines})
            continue
        found, finer = tried, _graded(tried, {name: _unfolded(scenes[name], *rest[name]) for name in wanted})
        if finer is tried:
            return tried
        tried = finer
    return found


def _graded(resolution: NetworkResolution, gradings: Mapping[str, Grading | None]) -> NetworkResolution:
    """With cells of lines placed, by name; the same where none are."""
    found = {name: x for name, x in gradings.items() if x is not None}
    if not found:
        return resolution
    lines = resolution.lines.items()
    return NetworkResolution({k: replace(x, grading=found[k]) if k in found else x for k, x in lines})


def rods_at_rest(network: Network, resolution: NetworkResolution, moves: bool) -> dict[str, tuple[Model, State]]:
    """Models of lines with their first states, by name, before zones move: as rods.  ComputationError.

    moves: the equilibrium is that with which a motion begins, else that under full loads.
    """
    from hybrid.simulation.equilibrium import equilibrium_of

    with at_once():
        model = build_system(network, resolution=resolution)
        states: Sequence[State] = [x.start for x in model.models]
        if not (moves and network.starts_as_placed):
            states = equilibrium_of(network, model, 0.0 if moves else np.inf).state.lines
    return dict(zip(model.names, zip(model.models, states, strict=True), strict=True))


def _unfolded(scene: LineScene, model: Model, state: State) -> Grading | None:
    """The cells that show the bends of a state, where a rod folds from one cell to the next; None: none does."""
    return grading_of(scene, model, state) if float(_turns(model, state).max()) > MOST_FOLD else None


def _is_open(scene: LineScene, resolution: Resolution) -> bool:
    """Whether the cells of a line are for the program to place, and not yet placed."""
    placed = follows_curvature(scene) or resolution.grading is not None or payout_of(scene) is not None
    return mesh_is_free(scene) and not placed


def grading_of(scene: LineScene, model: Model, state: State) -> Grading | None:
    """The cells that show all bends of a state; None: its own do."""
    line, length = model.line, model.length
    if not line.spin.any():
        return None
    turns = _turns(model, state)
    sharp = np.where(turns > MOST_TURN, _rounded(turns / line.hn / TURN), 0.0)  # 1/m
    found = [(s, float(_rounded(fade))) for s, fade, cell in _layers(model, state, turns) if cell > HIDDEN * fade]
    for s, _ in found:
        sharp[np.abs(line.s - s) <= line.h.max()] = 0.0  # that bend is the layer's
    if not found and not sharp.any():
        return None
    beside = [s + sign * fade * BESIDE for s, fade in found for sign in (-1.0, 1.0)]
    x = np.unique(np.concatenate([np.linspace(0.0, length, SAMPLES), line.s, *beside]))
    x = x[(x >= 0.0) & (x <= length)]
    density = np.interp(x, line.s, np.maximum(sharp, 0.0)) + DEFAULT_CELLS / length
    for s, fade in found:
        density += layers(x, np.array([0.0, length]), np.full(2, fade), [s], CELLS)
    density = np.maximum(density, twist_rate(scene, model.cable, x))
    grown = GROWTH * x
    cell = np.minimum.accumulate(1.0 / density - grown) + grown
    cell = np.minimum.accumulate((cell + grown)[::-1])[::-1] - grown
    return Grading(x, 1.0 / cell)


def _layers(model: Model, state: State, turns: Floats) -> Iterator[tuple[float, float, float]]:
    """Places that bend a rod (s, m), the shorter lambda (m) beside them, and the longest cell there (m)."""
    line, cable = model.line, model.cable
    near = 1e-9 * model.length
    last = line.s.size - 1
    places = [node for node, held in zip((0, last), cable.held_tangent, strict=True) if held]
    inner = {*np.searchsorted(line.s, np.array(model.attached) - near).tolist()} - {0, last}
    changes = {*np.searchsorted(line.s, cable.bounds[1:-1] - near).tolist()}
    for node in sorted(changes - {0, last}):
        EI = cable.weakest_bending[cable.piece(line.s[node] + np.array([-near, near]))]
        if EI.max() > MORE * EI.min() > 0.0:
            inner.add(node)
    places += [node for node in sorted(inner) if turns[node] > TURNED]
    for node in places:
        cells = [k for k in (node - 1, node) if 0 <= k < last and line.spin[k]]
        if not cells:
            continue
        middle = 0.5 * (line.s[:-1] + line.s[1:])[cells]
        T, EI = np.asarray(state.T)[cells], cable.weakest_bending[cable.piece(middle)]
        fades = np.sqrt(EI[T > 0.0] / T[T > 0.0])
        fades = fades[fades > SHORTEST * model.length]
        if fades.size:
            yield float(line.s[node]), float(fades.min()), float(line.h[cells].max())


def _rounded(x: Floats | float) -> Floats:
    """To half a percent, so that round-off of an equilibrium (in a plane, in space) does not move nodes."""
    return np.asarray(np.exp(0.01 * np.round(100.0 * np.log(np.maximum(x, 1e-300)))))


def _turns(model: Model, state: State) -> Floats:
    """Angles (N+1,) rad by which rods turn at their inner nodes; 0 at the ends and beside catenaries."""
    d = state.e / np.linalg.norm(state.e, axis=1)[:, None]
    out, spin = np.zeros(model.line.s.size), model.line.spin.astype(bool)
    cosine = np.clip((d[1:] * d[:-1]).sum(axis=1), -1.0, 1.0)
    out[1:-1] = np.where(spin[1:] & spin[:-1], np.arccos(cosine), 0.0)
    return out
