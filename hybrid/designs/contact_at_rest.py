"""Contact of lines with each other in an equilibrium: its stiffness, and what its forces answer to numbers of a scene.

Contact has an energy, whose second derivative by the places of the nodes belongs to the matrix.  Diameters, bending
stiffness and lengths change the forces of the same shapes; sample points stay as many as they are.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import sparse

from hybrid.designs.line_at_rest import Beside
from hybrid.errors import Complaint, SceneError
from hybrid.kernels.algebra.block_elimination import SIZE
from hybrid.kernels.state.state import Floats
from hybrid.linear.touching import stiffness_between
from hybrid.model.sections import merged_sections, tension_scale
from hybrid.simulation.lines_contact import strand_in
from hybrid.solve.joined import NetworkState
from hybrid.solve.network_solver import NetworkSolver
from hybrid.solve.shared_contact import TouchingLine

# Part of their diameters by which lines are thicker, and thinner, to tell whether they have only begun to touch.
BEGUN = 0.01


# How many times as many sample points tell what their spacing does to derivatives, and by how much more than the change
# these may be off: of hoses over wires, 16 show 0.8 of what is left, 4 a third (tests/designs/test_touching_lines.py).
FINER = {16: 1.5, 4: 4.0}


class ContactAtRest:
    """Of the lines of a solver that touch in states at rest."""

    def __init__(
        self, solver: NetworkSolver, states: NetworkState, names: Sequence[str], lines: Sequence[Beside]
    ) -> None:
        """lines: those of the equilibrium.  SceneError: a line touches itself alone, or something at its very end."""
        if any(x.counts.points for x, of in solver.contacts_at(states) if len(of) == 1) or solver.shared is None:
            raise _refused("contact of a line with itself", "no line touches itself")
        self._solver, self._states, self._shared = solver, states, solver.shared
        self._here = [lines[k] for k in self._shared.lines]
        self._nodes = np.array([x.line.s.size for x in solver.lines])
        begins = np.concatenate([[0], np.cumsum(self._nodes)[:-1]])
        self._node_of = np.concatenate([begins[k] + np.arange(self._nodes[k]) for k in self._shared.lines])
        self._ends = np.concatenate([begins, np.cumsum(self._nodes) - 1])
        self.stiffness = self._stiffness()
        bends = np.concatenate([x.line.element for x in solver.lines])
        self._kinks = not bends[np.unique(self.stiffness.nonzero()[0] // SIZE)].all()
        self.begins = self._begun(names)

    def _stiffness(self) -> sparse.csr_array:
        """(unknowns of all lines) N/m, of contact as it was looked at last."""
        found = stiffness_between(self._shared.contact, self._node_of, SIZE * int(self._nodes.sum()))
        if np.isin(found.nonzero()[0] // SIZE, self._ends).any():
            raise _refused("contact at an end of a line", "what touches does so away from the ends of lines")
        return found

    def finer(self) -> tuple[sparse.csr_array, float] | None:
        """The stiffness with more sample points, and by how much more than what it changes derivatives may be off.

        Between sample points a line lies as in hollows, and does not slide as it would.  None: that is not known, as of
        a line without bending stiffness, whose kink lies as in hollows between its nodes too.
        """
        if self._kinks:
            return None
        for finer, off in FINER.items():
            self._solver.contacts_at(self._states, finer)
            if not self._shared.contact.counts.overflow:
                return self._stiffness(), off
        return None

    def forces(self, lines: Sequence[Beside]) -> Floats:
        """(unknowns of all lines,) N, of the same shapes, on nodes of lines with other numbers."""
        now = [lines[k] for k in self._shared.lines]
        if all(x.model is y.model for x, y in zip(now, self._here, strict=True)):
            return self._pushes()
        self._shared.put([_strand(x) for x in now])
        try:
            return self._pushes()
        finally:
            self._shared.put([_strand(x) for x in self._here])

    def _pushes(self) -> Floats:
        self._solver.contacts_at(self._states)
        out = np.zeros((int(self._nodes.sum()), SIZE))
        out[self._node_of, 1:4] = np.concatenate([*self._shared.forces().values()])
        return out.ravel()

    def _begun(self, names: Sequence[str]) -> list[tuple[str, str]]:
        """Lines that would not touch if they were a little thinner, or would if they were a little thicker."""
        thick, thin = (self._touching(1.0 + part) for part in (BEGUN, -BEGUN))
        self._touching(1.0)
        return [(names[a], names[b]) for a, b in sorted(thick - thin)]

    def _touching(self, wider: float) -> set[tuple[int, int]]:
        strands = [_strand(x) for x in self._here]
        self._shared.put([x._replace(width=wider * x.width) for x in strands])
        self._solver.contacts_at(self._states)
        self._shared.put(strands)
        return {(min(a, b), max(a, b)) for (a, _), (b, _) in self._shared.points_between()}


def _strand(x: Beside) -> TouchingLine:
    """What contact takes of a line, whose tension scale is that of its scene."""
    strand = strand_in(x.model)
    if strand.bending.all():
        return strand
    sections, fastest = merged_sections(x.scene.cable.sections), float(np.linalg.norm(x.sea.current, axis=1).max())
    scale = tension_scale(x.scene, sections, bool(x.model.line.spin.any()), fastest)
    return strand._replace(tension_scale=scale)


def _refused(given: str, expected: str) -> SceneError:
    return SceneError([Complaint("lines", given, f"an equilibrium in which {expected}", "a shape that is apart")])
