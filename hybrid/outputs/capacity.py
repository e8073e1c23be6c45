"""How much of the capacity of its sections a line uses, of a batch of states."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hybrid.kernels.state.state import Floats
from hybrid.model.payout import whole_scene
from hybrid.outputs.probes import Probe
from hybrid.store.capacity import NAME, used

if TYPE_CHECKING:
    from hybrid.outputs.observation import Observation
    from hybrid.scene.schema import Scene


class Capacities:
    """The capacity polygons of one line.  Only for a scene that has some."""

    def __init__(self, scene: Scene) -> None:
        whole, begin = whole_scene(scene)
        sections = whole.cable.sections
        ends = begin + np.cumsum([x.length for x in sections])
        self._ends, self._near = ends[:-1], 1e-9 * sum(x.length for x in sections)
        self._corners = [None if x.capacity is None else np.array(x.capacity, float) for x in sections]
        self._begins = np.concatenate([[begin], ends[:-1]])
        self._whole = ends

    def probes(self) -> dict[str, Probe]:
        """Probes by name."""
        text = "part of the capacity that tension and curvature use together; NaN: none given"
        return {NAME: Probe("%", text, ("s",), self.used)}

    def used(self, v: Observation) -> Floats:
        """(ns, nb) %."""
        s, curvature = v.grid.points, v.curvature_twist[:, 0]
        section = np.searchsorted(self._ends, s + (self._near if v.grid.after else -self._near))
        found = np.full(v.tension.shape, np.nan)
        for i, corners in enumerate(self._corners):
            if corners is not None:
                found = np.where(section == i, 100.0 * used(corners, v.tension, curvature), found)
        return found

    def rows(self) -> Floats:
        """(K, 4): from and to (m), tension (N) and curvature (1/m) of each corner of each section that has any."""
        found = [
            np.column_stack([np.full(len(x), self._begins[i]), np.full(len(x), self._whole[i]), x])
            for i, x in enumerate(self._corners)
            if x is not None
        ]
        return np.concatenate(found)
