"""A material on base cells whose rods come and go: lines on any cells of them, compiled (kernels.zone_line)."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from hybrid.kernels.binding import Packed, Table
from hybrid.kernels.forces import BODIES, FRICTION, SEABED
from hybrid.kernels.state import NO_PLANE, NO_TORSION, TENSION_TORQUE, Floats, Line, blank_line
from hybrid.kernels.zone_criteria import NodeKinds, blank_kinds
from hybrid.kernels.zone_line import Cable, blank_kinds_job, blank_line_job, fill_kinds, fill_line
from hybrid.model.layout import Layout
from hybrid.model.line import spins_freely, torsion_zones
from hybrid.model.material import LEAST_TENSION, POINT, TENSION_FLOOR, Material

lines = Packed(blank_line, given=("bits", "plane", "torsion", *TENSION_TORQUE))
kinds_of = Packed(lambda n: blank_kinds(n, 1), given=("free",))
# What a base cell has per length, under the names of the material.
_OTHER = ("polar", "points", "springs")  # which a cable on base cells has in another form
PER_LENGTH = tuple(x.name for x in fields(Material) if x.name in Cable._fields and x.name not in _OTHER)


class LineOnBase:
    """A material on base cells: its lines, and what criteria know of their nodes."""

    def __init__(self, material: Material, base: Floats) -> None:
        """base: (n+1,) m, nodes that are always there."""
        of = material.piece(0.5 * (base[:-1] + base[1:]))
        per_length = {name: np.ascontiguousarray(getattr(material, name)[of]) for name in PER_LENGTH}
        polar = material.polar[of] if spins_freely(material) else np.full(of.size, np.nan)
        place = material.point_nodes(base)
        load, turns = np.zeros(base.size, np.int8), np.zeros(base.size, np.int8)
        turns[material.swivel_nodes(base)] = 1
        load[place] = 1
        self._points, self._place, self._material = np.zeros((10, base.size)), place, material
        held = np.array([material.held_tangent, material.held_twist], np.int8).T.copy()
        EI, w = material.mean_bending[of], np.abs(material.submerged_weight[of])
        self._cable = Cable(
            **per_length,
            polar=polar,
            EI=EI,
            w=w,
            points=self._points,
            blank=np.zeros(10),
            load=load,
            turns=turns,
            held=held,
            springs=np.array(material.springs),
        )
        self._line_job, self._kinds_job = Table(blank_line_job), Table(blank_kinds_job)
        self._bits, self._of = -1, of
        self._passes_torque = material.passes_torque

    @property
    def cable(self) -> Cable:
        """What lines are made of; its points are those of the forces that the last line had."""
        return self._cable

    def line(self, layout: Layout, bits: int, plane: Floats = NO_PLANE) -> Line:
        """The line on a layout; bits: all forces that are on."""
        if bits != self._bits:
            self._fill_points(bits)
        torsion, of = NO_TORSION, self._of[layout.base_of_cell]
        lengths = np.diff(layout.nodes)
        if self._passes_torque:
            torsion = torsion_zones(self._material, lengths, layout.rod_cells, of)
        by_tension = dict(zip(TENSION_TORQUE, self._material.torque_by_tension(lengths, of), strict=True))
        line: Line = lines(layout.base_of_cell.size, bits=bits, plane=plane, torsion=torsion, **by_tension)
        self._line_job.bind(
            cable=self._cable, nodes=layout.nodes, base_of_cell=layout.base_of_cell, rod=layout.rod_cells, line=line
        )
        fill_line(self._line_job.numbers)
        return line

    def _fill_points(self, bits: int) -> None:
        """Bodies at base nodes; what is off is not a number."""
        material, blank = self._material, self._cable.blank
        for k, name in enumerate(POINT):
            blank[k] = 0.0 if name == "point_mass" or bits & BODIES else np.nan
            self._points[k] = blank[k]
            self._points[k, self._place] = material.points[name] if blank[k] == 0.0 else np.nan
        k = len(POINT)
        self._points[k:] = 0.0
        self._points[k, self._place] = material.lift
        rests = material.footing.size > 0 or bits & (SEABED | FRICTION)
        blank[k + 1] = 0.0 if rests else np.nan
        self._points[k + 1] = blank[k + 1]
        if material.footing.size:
            self._points[k + 1, self._place] = material.footing
        self._bits = bits

    def kinds(self, layout: Layout, free: np.ndarray, scale: float) -> NodeKinds:
        """What criteria know of the nodes of a layout; free: (n,) of base cells; scale: tension scale, N."""
        kinds: NodeKinds = kinds_of(layout.base_of_cell.size, free=free)
        self._kinds_job.bind(
            cable=self._cable, base_of_cell=layout.base_of_cell, kinds=kinds, floor_part=TENSION_FLOOR,
            least=LEAST_TENSION * scale,
        )  # fmt: skip
        fill_kinds(self._kinds_job.numbers)
        return kinds
