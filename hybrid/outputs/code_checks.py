"""How much of what its codes allow a line uses, of a batch of states: hybrid.store.code_checks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hybrid.kernels.state.state import Floats
from hybrid.model.payout import whole_scene
from hybrid.model.sections import bending_stiffness
from hybrid.outputs.probes import Probe
from hybrid.store.code_checks import CLAUSES, E301, F201, NAME, Row, moment_of, use

if TYPE_CHECKING:
    from hybrid.outputs.observation import Observation
    from hybrid.scene.cable import Section
    from hybrid.scene.schema import Scene


class Codes:
    """The codes of one line.  Only for a scene that has some."""

    def __init__(self, scene: Scene) -> None:
        fluid, gravity = scene.environment.fluid, scene.environment.gravity
        self._water = fluid.density * gravity if fluid is not None else 0.0
        self._surface = 0.0 if fluid is None or fluid.surface is None else fluid.surface
        self._gravity = gravity
        whole, begin = whole_scene(scene)
        sections = whole.cable.sections
        ends = begin + np.cumsum([x.length for x in sections])
        begins = np.concatenate([[begin], ends[:-1]])
        self._ends, self._near = ends[:-1], 1e-9 * sum(x.length for x in sections)
        self._rows = [self._row(*x) for x in zip(sections, begins.tolist(), ends.tolist(), strict=True)]
        self._kinds = list(dict.fromkeys(x.code.kind for x in sections if x.code is not None))

    def _row(self, section: Section, first: float, last: float) -> Row | None:
        code, pipe = section.code, section.pipe
        if code is None:
            return None
        if code.kind == "E301":
            numbers = (code.pretension_factor, code.environment_factor, code.pretension, 0.0, code.strength)
            return Row(first, last, E301, *numbers, *[0.0] * 13)
        assert pipe is not None
        numbers = (
            code.functional_factor,
            code.environment_factor,
            code.functional_tension,
            code.functional_moment,
            0.0,
        )
        outer = pipe.outer_diameter or section.diameter or np.nan
        of_wall = (code.safety, outer, pipe.wall, pipe.modulus, code.yield_strength, code.tensile_strength)
        tube = pipe.modulus * np.pi / 64.0 * (outer**4 - (outer - 2.0 * pipe.wall) ** 4)
        natural = float(np.hypot(*(section.intrinsic_curvature or (0.0, 0.0))[:2]))
        of_bend = (max(bending_stiffness(section)) or tube, natural)
        z = self._surface if pipe.pressure_z is None else pipe.pressure_z
        pressures = (pipe.pressure, z, pipe.content_density * self._gravity, self._water, self._surface)
        return Row(first, last, F201, *numbers, *of_wall, code.ovality, code.fabrication, *pressures, *of_bend)

    def probes(self) -> dict[str, Probe]:
        """Probes by name."""
        which = "; ".join(CLAUSES[kind] for kind in self._kinds)
        return {NAME: Probe("%", f"part used of what codes allow: {which}; NaN: none given", ("s",), self.used)}

    def used(self, v: Observation) -> Floats:
        """(ns, nb) %."""
        s = v.grid.points
        section = np.searchsorted(self._ends, s + (self._near if v.grid.after else -self._near))
        z, found = (v.grid.nodes @ v.r)[:, 2], np.full(v.tension.shape, np.nan)
        catenary = np.asarray(v.grid.sides @ (~v.side_is_rod[:, None]).astype(float)) > 0.0
        for i, row in enumerate(self._rows):
            if row is not None:
                of_curvature = moment_of(row, v.curvature_twist[:, 0]) if row.kind == F201 else 0.0
                M = np.where(catenary, of_curvature, v.bending_moment)
                found = np.where(section == i, 100.0 * use(row, v.tension, M, z), found)
        return found

    def rows(self) -> Floats:
        """(K, columns) of `Row`."""
        return np.array([x for x in self._rows if x is not None], float)
