"""A material on base cells whose rods come and go: lines on any cells of them, compiled (kernels.mesh.zone_line)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hybrid.kernels.machine.binding import Packed, Table
from hybrid.kernels.mesh.zone_criteria import HINGE, NodeKinds, blank_kinds
from hybrid.kernels.mesh.zone_line import Cable, blank_kinds_job, blank_line_job, fill_kinds
from hybrid.kernels.state.state import NO_MOVED, NO_PLANE, Floats, Line
from hybrid.model.layout import Layout
from hybrid.model.line import cable_on, inertia_of_zones, on_base, put_points
from hybrid.model.material import LEAST_TENSION, TENSION_FLOOR, Material

kinds_of = Packed(lambda n: blank_kinds(n, 1), given=("free",))


class LineOnBase:
    """A material on base cells: its lines, and what criteria know of their nodes."""

    def __init__(self, material: Material, base: Floats) -> None:
        """base: (n+1,) m, nodes that are always there."""
        self._material, self._place, self._bits = material, material.point_nodes(base), 0
        self._cable = cable_on(material, base, 0, inertia_of_zones(material))
        self._line_job, self._kinds_job = Table(blank_line_job), Table(blank_kinds_job)

    @property
    def cable(self) -> Cable:
        """What lines are made of; its points are those of the forces that the last line had."""
        return self._cable

    def line(self, layout: Layout, bits: int, plane: Floats = NO_PLANE, moved: NDArray[np.int8] = NO_MOVED) -> Line:
        """The line on a layout; bits: all forces that are on; moved: as of `Line`, of the obstacles around it."""
        if bits != self._bits:
            put_points(self._material, self._place, self._cable, bits)
            self._bits = bits
        cells = layout.base_of_cell, layout.rod_cells
        line = on_base(self._material, self._cable, layout.nodes, *cells, bits, plane, self._line_job)
        return line._replace(moved=moved)

    def kinds(self, layout: Layout, free: np.ndarray, scale: float) -> NodeKinds:
        """What criteria know of the nodes of a layout; free: (n,) of base cells; scale: tension scale, N."""
        kinds: NodeKinds = kinds_of(layout.base_of_cell.size, free=free)
        self._kinds_job.bind(
            cable=self._cable, base_of_cell=layout.base_of_cell, kinds=kinds, floor_part=TENSION_FLOOR,
            least=LEAST_TENSION * scale,
        )  # fmt: skip
        fill_kinds(self._kinds_job.numbers)
        kinds.node[[0, -1]] = np.where(self._material.hinges[:2, 0] > 0.0, HINGE, kinds.node[[0, -1]])
        return kinds
