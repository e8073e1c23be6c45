"""Morison members of a free body about rest in the sea: what waves do to the body, and linear drag of its pieces.

A piece at an arm a from the origin moves by  T q,  T = [1, -[a]x],  of the shifts and turns q of its body.  With the
linear drag B of a half cell (hybrid.linear.drag) for its velocity relative to the water, amplitudes of a frequency are

    damping  sum T^T B T,    load  sum T^T (B u + w cm (a_w - d (d.a_w)) + dw/dz eta F_U),

u, a_w and eta of the waves: velocity and acceleration of the water at its middle, elevation above it; w its wetted part
at rest, F_U the drag of the current on it if it were wet.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from hybrid.kernels.junctions.bodies import FRAME, NUMBERS, OWN, PLACE, V
from hybrid.kernels.laws.members import ALONG, CM, CN, CT, MIDDLE, PIECE, PUSH, WATER, WET
from hybrid.kernels.state.state import Floats
from hybrid.linear.drag import axes_across, of_cylinders, phases_of
from hybrid.linear.excitation import SAME, water_of_wave
from hybrid.linear.matrices import SHIFT, TURN, rotation
from hybrid.model.bodies import Members
from hybrid.solve.joined import NetworkState
from hybrid.solve.network_solver import NetworkSolver

# Part of the wet length of all members over which the surface goes up and down (up to 0.24 a buoy of slender members
# surges and pitches within 3 % of a run, at 0.47 within 12 %), and turn of a body, rad (standard deviation), beyond
# which the motion is not linear.
WETTED, LARGE_TURN = 0.25, 0.2


class LoadedMembers:
    """The members of one body, their drag, and what excites them."""

    def __init__(self, name: str, members: Members, state: Floats, omegas: Floats) -> None:
        """state: (STATE,) of the body at rest; omegas: (F,) 1/s."""
        self.name, self.omegas, self.phases, R = name, omegas, phases_of(omegas), state[FRAME:V].reshape(3, 3)
        rows = members.pieces.copy()
        members.stir(np.inf, state, 0.0, rows)
        arms, self.d = rows[:, MIDDLE:ALONG] @ R.T, rows[:, ALONG:CN] @ R.T
        self.axes, self.current, self.wet = axes_across(self.d), rows[:, WATER:PUSH].copy(), rows[:, WET].copy()
        self.cn, self.ct, self.length = self.wet * rows[:, CN], self.wet * rows[:, CT], members.lengths
        self.T = np.zeros((len(rows), 3, 6))
        self.T[:, :, :3] = np.eye(3)
        self.T[:, :, 3:] = np.cross(np.eye(3), arms[:, None]).transpose(0, 2, 1)
        self.place = state[PLACE:FRAME] + arms
        self.high, self.surface = members.heights(R), members.sea.surface
        self.water, self.force, self.rise = self._by_waves(members, rows)
        self.q = np.zeros((len(omegas), 6), complex)
        self.blocks = np.zeros((len(rows), 3, 3))

    def _by_waves(self, members: Members, rows: Floats) -> tuple[Floats, Floats, Floats]:
        """Amplitudes at every frequency: velocity of the water (F, n, 3) m/s, force but for drag (F, n, 3) N, rise of

        the surface (F, n) m.
        """
        count, n, sea = len(self.omegas), len(rows), members.sea
        water, push, rise = (
            np.zeros((count, n, 3), complex),
            np.zeros((count, n, 3), complex),
            np.zeros((count, n), complex),
        )
        for f, omega in enumerate(self.omegas):
            for wave in sea.waves[np.abs(sea.waves[:, 1] - omega) <= SAME * omega]:
                found = wave[0] * np.exp(1j * wave[4]) * water_of_wave(sea, wave, self.place)
                water[f] += found[:, :3]
                push[f] += found[:, 3:6]
                rise[f] += found[:, 6]
        across = np.eye(3) - self.d[:, :, None] * self.d[:, None, :]
        force = np.einsum("n,nij,fnj->fni", self.wet * rows[:, CM], across, push)
        ut = np.einsum("ni,ni->n", self.current, self.d)
        un = self.current - ut[:, None] * self.d
        drag = (
            rows[:, [CN]] * np.linalg.norm(un, axis=1)[:, None] * un + (rows[:, CT] * np.abs(ut) * ut)[:, None] * self.d
        )
        crossing = (self.wet > 0.0) & (self.wet < 1.0)
        force += np.where(crossing, rise / self.high, 0.0)[:, :, None] * drag
        return water, force, rise

    def drag_blocks(self, which: np.ndarray, start: bool) -> Floats:
        """Linear drag (n, 3, 3) N s/m of every piece, as of hybrid.linear.loaded_line."""
        u = math.sqrt(len(self.omegas) / which.size) * self.relative(which, start)
        return of_cylinders(self.d, self.axes, (self.cn, self.ct), self.current, u, self.phases)

    def relative(self, which: np.ndarray, start: bool = False) -> Floats:
        """Velocity (F, n, 3) m/s of the water relative to the pieces, by the motion found last; start: none."""
        motion = np.einsum("nij,fj->fni", self.T, self.q[which] * (0.0 if start else 1.0))
        return np.asarray(self.water[which] + 1j * self.omegas[which, None, None] * motion)

    def damping(self) -> Floats:
        """(6, 6) N s/m, .. of the drag as it is, against velocities of the body."""
        return np.asarray(np.einsum("nia,nij,njb->ab", self.T, self.blocks, self.T))

    def loads(self, which: np.ndarray) -> Floats:
        """(6, F) N, N m on the body."""
        force = self.force[which] + np.einsum("nij,fnj->fni", self.blocks, self.water[which])
        return np.asarray(np.einsum("nia,fni->af", self.T, force))

    def doubts(self) -> Iterator[str]:
        """What of the members is wet now and then: where two standard deviations bring the surface."""
        if not math.isfinite(self.surface):
            return
        rise = self.rise - np.einsum("nj,fj->fn", self.T[:, 2], self.q)
        deviation = np.sqrt(0.5 * (np.abs(rise) ** 2).sum(axis=0))
        upper = np.minimum(self.place[:, 2] + 0.5 * self.high, self.surface + 2.0 * deviation)
        lower = np.maximum(self.place[:, 2] - 0.5 * self.high, self.surface - 2.0 * deviation)
        swept = float((np.maximum(upper - lower, 0.0) / self.high) @ self.length)
        if swept > WETTED * float(self.wet @ self.length):
            yield (
                f"about {swept:.3g} m of the members of body {self.name} come out of the water and go under, and have "
                "the drag and inertia of how they are wet at rest"
            )


def turning_doubts(name: str, q: Floats) -> Iterator[str]:
    """Whether a body turns by so much that it is not linear; q: (F, 6) m, rad."""
    turn = math.sqrt(0.5 * float((np.abs(q[:, 3:]) ** 2).sum()))
    if turn > LARGE_TURN:
        yield f"body {name} turns by {turn:.2g} rad (standard deviation)"


def stiffness_by_water(solver: NetworkSolver, states: NetworkState, b: int, members: Members) -> Floats:
    """(6, 6) stiffness of the water around the members of body b, which is another where it shifts and turns."""
    K, step, numbers = np.zeros((6, 6)), np.repeat([SHIFT * solver.length, TURN], 3), solver.bodies.copy()
    pieces = slice(NUMBERS, NUMBERS + PIECE * len(members.pieces))
    for k in range(6):
        for sign in (1.0, -1.0):
            moved = states.copy()
            if k < 3:
                moved.bodies[b, PLACE + k] += sign * step[k]
            else:
                frame = moved.bodies[b, FRAME:V].reshape(3, 3)
                moved.bodies[b, FRAME:V] = (rotation(sign * step[k] * np.eye(3)[k - 3]) @ frame).ravel()
            solver.evaluate_forces(moved, 0.0)
            before = solver.body_work[b, OWN : OWN + 6].copy()
            members.stir(np.inf, moved.bodies[b], 0.0, solver.bodies[b, pieces].reshape(-1, PIECE))
            solver.evaluate_forces(moved, 0.0)
            K[:, k] -= sign * (solver.body_work[b, OWN : OWN + 6] - before) / (2.0 * step[k])
            solver.bodies[:] = numbers
    solver.evaluate_forces(states, 0.0)
    return K
