"""A line at rest without most of the nodes on which its results do not depend.

What results ask for stands beside their places and beside the ends.  Of what lies in between one cell is left, whose
numbers mean nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hybrid.kernels.state.state import FIELDS, Floats, Line, State
from hybrid.model.build import Model

# Nodes that stay to either side of a place and beside ends; and beside what cuts the line.
REACH, BESIDE_CUTS = 8, 2
# Part of the nodes that stay, at most: else it does not pay.
WORTH = 0.5


class Stretch:
    """Which nodes (n,) and cells (n-1,) of a line stay."""

    def __init__(self, nodes: np.ndarray) -> None:
        self.nodes, self.cells = nodes, nodes[:-1]
        self._gaps = np.flatnonzero(np.diff(nodes) > 1)

    def line(self, line: Line, names: Sequence[str] = tuple(FIELDS)) -> Line:
        """The line; names: fields that are cut, others stay as long as they were."""
        found = {name: getattr(line, name) for name in names}
        cut = {name: x[self.nodes if FIELDS[name].of_node else self.cells] for name, x in found.items() if x.size}
        cut["h"][self._gaps] = np.diff(cut["s"])[self._gaps]
        out: Line = line._replace(**cut)
        return out

    def model(self, model: Model, names: Sequence[str] = tuple(FIELDS)) -> Model:
        """A model with the line."""
        return replace(model, line=self.line(model.line, names))

    def state(self, state: State) -> State:
        """The state, with straight chords over what is left out."""
        n = len(state.r)
        rows = [x[self.nodes] if x.shape[0] == n else x[self.cells] if x.shape[0] == n - 1 else x.copy() for x in state]
        out = State(*rows)
        out.e[self._gaps] = np.diff(out.r, axis=0)[self._gaps]
        return out


def stretch_of(model: Model, places: Sequence[int]) -> Stretch | None:
    """What stays beside nodes where results stand; None: too little could be left out."""
    s = model.line.s
    stays = np.zeros(s.size, bool)
    cuts = [*model.cable.bounds, *model.attached, *(x for zone in model.zones for x in (zone.s_a, zone.s_b))]
    for reach, nodes in ((REACH, [0, s.size - 1, *places]), (BESIDE_CUTS, [int(np.abs(s - x).argmin()) for x in cuts])):
        for i in nodes:
            stays[max(i - reach, 0) : i + reach + 1] = True
    return Stretch(np.flatnonzero(stays)) if stays.mean() <= WORTH else None


def anywhere(state: State, size: int) -> Floats:
    """(1, N+1, size) a movement of all unknowns that stretches and turns all cells alike."""
    scale = np.ones(size)
    scale[0], scale[1:4] = np.abs(state.T).max() or 1.0, np.linalg.norm(state.e, axis=1).mean()
    out = np.random.default_rng(1).uniform(0.5, 1.0, (1, len(state.r), size)) * scale
    out[:, 1::2] *= -1.0  # else nodes would go along with their neighbours
    return np.asarray(out)
