"""Free bodies, and points that lines are clamped to, at rest: what their equations leave over when their scene changes.

Of a body that lines pull at with forces f at arms a, and with moments m where they are clamped,

    R = (F + sum f,  M + sum (a x f + m)),

a change of the scene changes its own F and M (weight, water, loads), the arms, and the forces and moments of the same
shapes of the lines.  What lines leave over at their ends comes through the place of the ends (linear.matrices).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import sparse

from hybrid.designs.line_at_rest import LEFT_OUT, Beside, Frames
from hybrid.kernels.junctions.bodies import FRAME, OWN, PIECES, SOFTEST, V
from hybrid.kernels.junctions.carried_frames import TURNS
from hybrid.kernels.state.obstacle_rows import RADIUS
from hybrid.kernels.state.state import Floats, Line
from hybrid.linear.loaded_line import stiffness_by_water
from hybrid.model.bodies import loads_of
from hybrid.model.network import NetworkModel, bodies_of
from hybrid.scene.network import Network
from hybrid.scene.points import Fairlead
from hybrid.solve.joined import NetworkState
from hybrid.solve.network_solver import NetworkSolver


class BodiesAtRest:
    """What turns by the moments of its lines, in the equilibrium of a scene."""

    def __init__(self, solver: NetworkSolver, states: NetworkState, model: NetworkModel) -> None:
        """solver: of the lines in their equilibrium, whose numbers of bodies are those there."""
        self._solver, self._states, self._model = solver, states, model
        self.count, self._points = len(solver.bodies), len(solver.net)
        self._numbers = solver.bodies.copy()

    def axes(self, b: int) -> Floats:
        """Axes (3, 3) of a body, as columns."""
        return np.asarray(self._states.bodies[b, FRAME:V].reshape(3, 3))

    def body_at(self, l: int, k: int) -> int:
        """The body at end k of line l; -1: there is none."""
        return max(int(self._solver.joints[l, k]) - self._points, -1)

    def turns(self, l: int) -> list[int]:
        """Ends of line l whose frames turn with a body."""
        return [k for k in (0, 1) if self.body_at(l, k) >= 0 and self._solver.lines[l].seats[k, TURNS] != 0.0]

    def frames(self, l: int, seats: Floats) -> Frames:
        """Frames of the ends of line l that turn with bodies, with seats (2, SEAT) in these."""
        return {k: (self.axes(self.body_at(l, k)) @ seats[k, :TURNS].reshape(3, 3)).ravel() for k in self.turns(l)}

    def arms(self, l: int, fairleads: Floats) -> Floats:
        """(2, 3) m from the origin of the body to each end of line l, inertial, with fairleads (2, 3) on it."""
        bodies = [self.body_at(l, k) for k in (0, 1)]
        return np.stack([self.axes(b) @ x if b >= 0 else np.zeros(3) for b, x in zip(bodies, fairleads, strict=True)])

    def loads_besides_lines(self, model: NetworkModel) -> Floats:
        """(B, 6) N, N m, on the bodies but for their lines, as a model has them where they are.

        ValueError: the model has other members.
        """
        numbers = model.body_numbers(np.inf)
        if numbers.shape != self._numbers.shape or not np.array_equal(numbers[:, PIECES], self._numbers[:, PIECES]):
            raise ValueError("other pieces of members")
        model.update_water(np.inf, self._states.bodies, 0.0, numbers)
        self._solver.bodies[:] = numbers
        try:
            self._solver.evaluate_forces(self._states, 0.0)
            return np.asarray(self._solver.body_work[:, OWN : OWN + 6].copy())
        finally:
            self._solver.bodies[:] = self._numbers

    def pressed(self, lines: Sequence[Beside]) -> Floats:
        """(B, 6) N, N m, of lines that touch bodies on these, of the same shapes, with the numbers of other scenes.

        What bodies carry is brought to where they are in the seas of the lines.
        """
        out = np.zeros((self.count, 6))
        if self._solver.meets:
            both = zip(self._solver.lines, lines, strict=True)
            of = [x._replace(line=smooth(y.model.line), sea=y.sea) for x, y in both]
            solver = NetworkSolver(of, self._points, self._numbers)
            _, _, wrench, carriers = solver.pressed_bodies(self._states)
            out[carriers] = wrench
        return out

    def stiffness_besides(self, stiffness: sparse.csc_array) -> sparse.csc_array:
        """Stiffness (q, q) of bodies, the last of q, that the matrix of the network leaves out.

        Water around members that is another where they go, and a spring against turns that nothing holds, as Newton's
        method has it.
        """
        first = stiffness.shape[0] - 6 * self.count
        blocks = [sparse.csc_array((first, first))]
        diagonal, x = np.abs(stiffness.diagonal()[first:].reshape(-1, 6)), self._solver.lines[0]
        for b in range(self.count):
            block = self._by_water(b)
            stiffest = float(diagonal[b, 3:].max())
            if (mine := np.flatnonzero(x.rides == b)).size:  # what touches it may roll
                stiffest = max(stiffest, float(diagonal[b, :3].max() * x.sea.obstacles[mine, RADIUS].max() ** 2))
            block[3:, 3:] += SOFTEST * (stiffest or 1.0) * np.eye(3)
            blocks.append(sparse.csc_array(block))
        return sparse.csc_array(sparse.block_diag(blocks, format="csc"))

    def _by_water(self, b: int) -> Floats:
        """(6, 6) stiffness of the water around the members of a body; zeros: it has none."""
        members = self._model.bodies[b].members if b < len(self._model.bodies) else None
        return np.zeros((6, 6)) if members is None else stiffness_by_water(self._solver, self._states, b, members)


def smooth(line: Line) -> Line:
    """A line without what does not act at rest, or depends on the way there."""
    return line._replace(bits=line.bits & ~LEFT_OUT)


def with_bodies(model: NetworkModel, system: Network) -> NetworkModel:
    """The model with the bodies of a changed scene, and moments on its points; its lines stay as they are."""
    free = system.free_bodies
    held = [[system.points[x] for x in (line.start, line.end)] for line in system.lines.values()]
    places = [
        [x.place if isinstance(x, Fairlead) and x.body in free else (0.0, 0.0, 0.0) for x in pair] for pair in held
    ]
    moments = tuple(loads_of(system.moments_on(x)) for x in system.rigid)
    return replace(model, bodies=bodies_of(system), fairleads=np.array(places), moments=moments)
