"""The equilibrium of one cable, and what its results answer to numbers of the scene.

At an equilibrium R(q; p) = 0, so that  A dq/dp = dR/dp  with the matrix A of the modes (theory.md, 20): one solve for
each number, in place of two equilibria, or for each result where numbers are many (designs.gradients).  dR/dp is the
change of the block rows of the same state between two lines.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from scipy import sparse

from hybrid.accuracy.api import resolution_at_rest
from hybrid.designs.factors import Factors
from hybrid.designs.gradients import Gradients
from hybrid.designs.line_at_rest import LEFT_OUT, Beside, LineAtRest, parse_result
from hybrid.designs.numbers import OfScene, at_a_bound, is_allowed, with_number
from hybrid.errors import Complaint, ComputationError, Outcome, SceneError
from hybrid.kernels.algebra.block_elimination import SIZE
from hybrid.kernels.state.state import Floats
from hybrid.linear.matrices import linear_line
from hybrid.model.build import Model, places_of
from hybrid.model.nearby import nearby
from hybrid.model.resolution import Resolution
from hybrid.scene.combinations import refuse_use
from hybrid.scene.schema import Scene
from hybrid.simulation.static_case import StaticCase

# Places of nodes (`Resolution.places`) by line, "" of one that is alone; empty: as the scene asks for.
Places = Mapping[str, tuple[float, ...]]
NO_PLACES: Places = MappingProxyType({})


class CableAtRest(OfScene):
    """The equilibrium on one mesh, its factors, and the values of results."""

    scene: Scene

    contact = None  # with other lines

    def __init__(self, scene: Scene, cells: float, of: Sequence[str], places: Places = NO_PLACES) -> None:
        """cells: their lengths over the usual, 0.5 or more; of: results; places: of an equilibrium with these cells.

        SceneError, ComputationError: as of `hybrid.sensitivity`.
        """
        wanted, case = [parse_result(x, scene.length) for x in of], StaticCase(scene)
        resolution: Resolution = resolution_at_rest(case)
        self.scene = case.scene
        refuse_use(self.scene, "derivatives", given="hybrid sensitivity")  # with the model that accuracy has chosen
        resolution = replace(resolution, places=places.get("", ())).of_cells(cells)
        self.model, found = case.at_rest(resolution)
        self.places = {"": places_of(self.model, self.scene)}
        self.resolution = replace(resolution, places=self.places[""], parts=1)
        if found.touch.size:
            expected = "an equilibrium in which the line does not touch itself"
            raise SceneError([Complaint("contact.self", "a line that touches itself", expected, "another shape")])
        self.line = LineAtRest(self.scene, self.model, found.state, wanted)
        self.lines = [self.line]
        linear = linear_line(self.line.joined(self.line.here), "cable", found.state, sticks=False, quick=False)
        free, held = linear.free.reshape(-1, SIZE).copy(), self.line.here.ends.held
        for k in (0, 1):
            if held[k]:
                free[-k, 1:4] = False
        self._free, self._held = np.flatnonzero(free.ravel()), [k for k in (0, 1) if held[k]]
        of_free = (linear.stiffness + linear.by_layers)[self._free]
        self._factors = Factors(sparse.csc_array(of_free[:, self._free]))
        self._by_ends = {k: of_free[:, self._of_end(k)].toarray() for k in self._held}
        self.values, self.gradients = self.line.values(), Gradients(self.line)

    def _of_end(self, k: int) -> np.ndarray:
        """Which unknowns are the place of an end."""
        size = SIZE * self.model.line.s.size
        return np.arange(1, 4) + (size - SIZE if k else 0)

    def off_by_contact(self, keys: Sequence[str], found: Floats) -> Floats:
        """(P, W) by how much derivatives may be off by the sample points of contact, of which there is none."""
        return np.zeros_like(found)

    def by(self, keys: Sequence[str]) -> Floats:
        """(P, W) derivatives of all results by numbers."""
        if not keys:
            return np.zeros((0, self.values.size))
        numbers, steps = self.numbers_and_steps(keys)
        pairs = [self._beside(*row) for row in zip(keys, numbers.tolist(), steps.tolist(), strict=True)]
        lines = [x for pair in pairs for x in pair]
        left, reports = zip(*(self.line.left(x) for x in lines), strict=True)
        right = np.stack([x - y for x, y in zip(left[::2], left[1::2], strict=True)], axis=1)[self._free]
        right /= 2.0 * steps
        shifts = np.zeros((len(keys), self.model.line.s.size, SIZE))
        for k in self._held:
            shift = np.stack([a.ends.position[k] - b.ends.position[k] for a, b in pairs], axis=1) / (2.0 * steps)
            right -= self._by_ends[k] @ shift
            shifts[:, -k, 1:4] = shift.T
        by_scene = self.line.by_scene([*zip(lines, reports, strict=True)], steps)
        by_state = self.transposed if self.gradients.pay_for(len(keys)) else self.forward
        return by_scene + by_state(right, shifts)

    def forward(self, right: Floats, shifts: Floats) -> Floats:
        """(P, W) by a solve for each number: right (free, P), shifts (P, N+1, 5) of held ends."""
        return self.line.by_state(self.movements(right, shifts))

    def movements(self, right: Floats, shifts: Floats) -> Floats:
        """(P, N+1, 5) of the state by numbers."""
        q = shifts.copy()
        q.reshape(len(q), -1)[:, self._free] = self._factors.solve(right).T
        return q

    def transposed(self, right: Floats, shifts: Floats) -> Floats:
        """(P, W) the same by a transposed solve for each result."""
        by_unknowns = self.gradients.by_unknowns.reshape(len(self.line.wanted), -1)
        prices = self._factors.solve(by_unknowns[:, self._free].T, transposed=True)
        return np.asarray(right.T @ prices + shifts.reshape(len(shifts), -1) @ by_unknowns.T)

    def _beside(self, key: str, number: float, step: float) -> tuple[Beside, Beside]:
        """The line with a number that is more by a step, and less."""
        more, less = (with_number(self.scene, key, number + d) for d in (step, -step))
        found = []
        for scene in (more, less):
            if number == 0.0:
                refuse_use(scene, "derivatives", given=key)  # what it switches on
            model = nearby(self.model, self.scene, scene, self.resolution, LEFT_OUT)
            if model is None:
                detail = f"{key}: a change of it changes the number of cells; give `mesh: {{cells: ..}}`"
                raise ComputationError(Outcome.NOT_CONVERGED, None, None, detail)
            if scene is more and not same_places(model, self.model) and not is_allowed(more):
                fix = "a number that others do not have to match, as lengths of zones have to"
                raise SceneError([Complaint("by", key, "a number that may change by itself", fix)])
            try:
                found.append(self.line.beside(scene, model))
            except ValueError:
                raise at_a_bound(key, number) from None
        return found[0], found[1]


def same_places(a: Model, b: Model) -> bool:
    """Whether nodes, sections and attachments of two models are at the same arc lengths."""
    pairs = (a.line.s, b.line.s), (a.cable.bounds, b.cable.bounds), (a.cable.at, b.cable.at)
    return all(np.array_equal(x, y) for x, y in pairs)
