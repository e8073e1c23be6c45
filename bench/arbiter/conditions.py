"""What closes the fields: the conditions at the two ends and where two pieces meet.

Each is a residual with its exact derivatives, so that Newton's correction d obeys C d = -residual.
Place, force and moment pass a spherical joint as in GP (10)-(12).  GP freeze the rotation L_r of
the joint at the guess; here its turn is kept, because in statics it is not small.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .fields import (
    BEND,
    FORCE,
    PLACE,
    TURN,
    CatenaryFields,
    Clock,
    Fields,
    RodFields,
    angles,
    bent,
    catenary_nodes,
    direction,
    lever,
    moment,
    pull,
)
from .line import Hold, Line, Piece
from .rotations import Array, hat, log, right_inverse, turn

TIP = 1.0e-8  # of the line's weight: the tension left at a free catenary end; half the digits of a double
SETTLE = 4.0  # steps in which a held end that has drifted off its target comes back (e-fold): third order small


@dataclass(frozen=True)
class Node:
    """One node of one piece: fields with a leading axis of one, and the turn per unit of the last unknowns."""

    piece: Piece
    y: Fields
    clock: Clock | None
    lever: Array

    @property
    def place(self) -> tuple[Array, Array]:
        """Position (statics) or velocity (dynamics), inertial, (3,), and its derivative (3, m)."""
        C = np.zeros((3, self.piece.unknowns))
        if self.clock is None:
            C[:, PLACE] = np.eye(3)
            return self.y.x[0], C
        if isinstance(self.y, CatenaryFields):
            C[:, PLACE] = np.eye(3)
            return self.y.v[0], C
        return self._out(self.y.v[0], C, PLACE, np.eye(3))

    @property
    def force(self) -> tuple[Array, Array]:
        """Force on the +s face, inertial, (3,), and its derivative."""
        C = np.zeros((3, self.piece.unknowns))
        if isinstance(self.y, CatenaryFields):
            n, C_n = pull(self.y)
            C[:, FORCE] = C_n[0]
            return n[0], C
        return self._out(self.y.f[0], C, FORCE, np.eye(3))

    @property
    def moment(self) -> tuple[Array, Array]:
        """Moment on the +s face, body axes, (3,), and its derivative; rods only."""
        C = np.zeros((3, self.piece.unknowns))
        C[:, BEND] = np.diag(self.piece.stiffness)
        return moment(self.piece, self.rod)[0], C

    @property
    def rod(self) -> RodFields:
        assert isinstance(self.y, RodFields)
        return self.y

    def _out(self, b: Array, C: Array, where: slice, dB: Array) -> tuple[Array, Array]:
        """R b and its derivative, b in body axes."""
        R = self.rod.R[0]
        C[:, where] = R @ dB
        C[:, TURN] = -R @ hat(b) @ self.lever
        return R @ b, C


def node(piece: Piece, y: Fields, clock: Clock | None, i: int) -> Node:
    """The node i (0 or -1) of a piece."""
    pick = slice(i, None) if i == -1 else slice(i, i + 1)
    one = type(y)(**{name: value if name == "order" else value[pick] for name, value in vars(y).items()})
    now = None if clock is None else Clock(**{k: v if k == "c0" else v[pick] for k, v in vars(clock).items()})
    arm = lever(one, now)[0] if isinstance(one, RodFields) else np.zeros((3, 3))
    return Node(piece, one, now, arm)


@dataclass(frozen=True)
class Before:
    """Where an end stood at the last step: time (s), step (s), position (3,), frame (3, 3) or None."""

    t: float
    dt: float
    x: Array
    R: Array | None


def end_rows(
    hold: Hold, at: Node, side: float, t: float, before: Before | None, spin_free: bool, length: float
) -> tuple[Array, Array]:
    """Residual (m/2,) and derivative (m/2, m) at an end; side +1 at s = L, -1 at s = 0.

    Statics holds place and tangent themselves.  Dynamics holds velocity and spin, as GP's fields
    ask, and adds what the last step's error needs to vanish within SETTLE steps.  spin_free: nothing
    holds the turn of a round rod about itself; its torsion row, which is then redundant, gives
    way to "do not turn" (statics, or a rod without polar inertia).
    """
    target = hold.at(t)
    rate = 0.0 if before is None else 1.0 / (SETTLE * before.dt)
    earlier = target if before is None else hold.at(before.t)
    if hold.place:
        residual, C = at.place
        assert target.position is not None and earlier.position is not None
        if before is None:
            residual = residual - target.position
        else:
            residual = residual - target.velocity - rate * (earlier.position - before.x)
    elif not at.piece.rod and not hold.force(t).any():
        residual, C = _tip(at, length)
    else:
        residual, C = at.force
        residual = residual - side * hold.force(t)
    if not at.piece.rod:
        return residual, C

    R = at.rod.R[0]
    moment_, C_moment = at.moment
    applied = side * R.T @ hold.moment(t)
    C_moment[:, TURN] -= hat(applied) @ at.lever
    low, C_low = moment_ - applied, C_moment
    if hold.tangent:
        held, C_held = _turned(at, hold, target.frame, target.spin, earlier.frame, rate, before)
        # In motion a clamp without a normal keeps the twist it started with.
        twist = hold.twist or (before is not None and hold.place and hold.table.holds_twist)
        rows = 3 if twist else 2
        low, C_low = np.concatenate([held[:rows], low[rows:]]), np.concatenate([C_held[:rows], C_low[rows:]])
    if spin_free:
        low[2], C_low[2] = 0.0, 0.0
        C_low[2, TURN.stop - 1] = 1.0
    return np.concatenate([residual, low]), np.concatenate([C, C_low])


def _tip(at: Node, length: float) -> tuple[Array, Array]:
    """Free end of a catenary: no tension, and a tangent along m a - F, for there n' = T' t.

    Where T = 0 the angles drop out of n = T t and a march cannot reach the last node: TIP keeps it in sight.
    """
    assert isinstance(at.y, CatenaryFields)
    G, dG = (block[0, FORCE] for block in catenary_nodes(at.piece, at.y, at.clock)[2:])
    theta, phi = angles(at.y.t, at.y.order)
    dt = direction(theta, phi, at.y.order)[1][0]
    twice = bent(theta, phi, at.y.order)[0]
    C = np.zeros((3, 6))
    C[0, 3] = 1.0
    C[1:] = dt.T @ dG
    C[1:, 4:] += np.einsum("iab,i->ab", twice, G)
    load = np.linalg.norm(at.piece.weight) or at.piece.mass
    return np.array([at.y.T[0] - TIP * length * load, *(length * dt.T @ G)]), np.array([C[0], *(length * C[1:])])


def _turned(
    at: Node, hold: Hold, goal: Array | None, spin: Array, earlier: Array | None, rate: float, before: Before | None
) -> tuple[Array, Array]:
    """How far (body, rad; dynamics rad/s) the end is turned off its target frame, and the derivative (3, 12)."""
    assert goal is not None and earlier is not None
    C = np.zeros((3, 12))
    R = at.rod.R[0]
    if before is None:
        off = log(_aligned(goal, R, hold.twist).T @ R)
        C[:, TURN] = right_inverse(off)
        return off, C
    assert before.R is not None
    off = before.R @ log(_aligned(earlier, before.R, hold.twist).T @ before.R)
    wanted = R.T @ (spin - rate * off)
    C[:, TURN] = np.eye(3) - hat(wanted) @ at.lever
    return at.rod.w[0] - wanted, C


def _aligned(goal: Array, R: Array, twist: bool) -> Array:
    """The target frame; where the twist is not held, R itself turned the shortest way onto the target tangent."""
    return goal if twist else turn(R[:, 2], goal[:, 2]) @ R


def meeting(a: Node, b: Node) -> tuple[Array, Array, Array]:
    """Residual and derivatives with the unknowns of the left node a and the right node b, two pieces meeting.

    Rows: place and force for all; moment of the rod at a joint, GP (10); moment and frame between two rods.
    """
    (pa, Cpa), (pb, Cpb) = a.place, b.place
    (fa, Cfa), (fb, Cfb) = a.force, b.force
    residual, left, right = [pb - pa, fb - fa], [-Cpa, -Cfa], [Cpb, Cfb]
    if a.piece.rod and b.piece.rod:
        (qa, Cqa), (qb, Cqb) = a.moment, b.moment
        turned = np.zeros((3, 12))
        turned[:, TURN] = np.eye(3)
        if a.clock is None:
            off = log(a.rod.R[0].T @ b.rod.R[0])
            Ca = np.zeros((3, 12))
            Ca[:, TURN], turned[:, TURN] = -right_inverse(-off), right_inverse(off)
        else:
            off, Ca = b.rod.w[0] - a.rod.w[0], -turned
        residual += [qb - qa, off]
        left += [-Cqa, Ca]
        right += [Cqb, turned]
    elif a.piece.rod != b.piece.rod:
        rod = a if a.piece.rod else b
        q, Cq = rod.moment
        empty = np.zeros((3, 6))
        residual.append(q)
        left.append(Cq if rod is a else empty)
        right.append(Cq if rod is b else empty)
    return np.concatenate(residual), np.concatenate(left), np.concatenate(right)


def spinning(line: Line, moving: bool) -> list[bool]:
    """Per piece: does it open a run of rods that nothing holds against turning about itself?

    Only a round rod can: its torsion is then the same along the run, and one of the two torsion
    conditions repeats the other.  With polar inertia, in motion, the turn is an unknown like any other.
    """
    free = [False] * len(line.pieces)
    for i, piece in enumerate(line.pieces):
        if not piece.rod or (i and line.pieces[i - 1].rod):
            continue
        last = i
        while last + 1 < len(line.pieces) and line.pieces[last + 1].rod:
            last += 1
        run = line.pieces[i : last + 1]
        ends = ([line.start] if i == 0 else []) + ([line.end] if last + 1 == len(line.pieces) else [])
        held = any(h.twist or (moving and h.place and h.tangent and h.table.holds_twist) for h in ends)
        inert = not moving or not any(p.inertia[2] for p in run)
        # An applied moment at the first end would be dropped with the row: leave it, and let the fit say "singular".
        loaded = i == 0 and line.start.moment(0.0).any()
        free[i] = all(p.round for p in run) and not held and inert and not loaded
    return free
