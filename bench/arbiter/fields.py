"""The field equations of rod and catenary, box rule along s, with exact derivatives.

Both kinds are written as Z' + G = 0 with Z and G functions of the unknowns at one node, and
the box rule on a cell of unstretched length h is

    Z_{j+1} - Z_j + h/2 (G_j + G_{j+1}) = 0        (second order, node to node: nothing but neighbours)

    symbol      meaning                                             unit        frame
    x           position                                            m           inertial
    v           velocity                                            m/s         rod: body, catenary: inertial
    R           body frame, columns a_i, a_3 = tangent              -           inertial
    f, q        internal force, moment on the +s face               N, N m      body
    k, w        curvature and twist per unstretched length; spin    1/m, 1/s    body
    T, t        tension, unit tangent                               N, -        inertial
    theta, phi  spherical angles of t about the chosen polar axis   rad

Rod, GP (6)-(9), with the stretch 1 + e = 1 + c_k f_3 the paper leaves out (c_k = 0: inextensible):

    v' + k x v = (1+e) w x e3 + e_t e3                    w' + k x w = k_t
    q' + k x q = I w_t + w x I w + (1+e) f x e3           f' + k x f = m (v_t + w x v) - F

Catenary, GP (1)-(4) with n = T t (GP's Eq. 4 is misprinted: its third component is cos theta):

    v' = {(1 + c_k T) t}_t                                n' = m v_t - F

Statics is the limit of the same fields: v and w give way to x and R, so that v' and w' become
x' = (1+e) t and R' = R hat(k), the latter as log(R_j^T R_{j+1}) = h (k_j + k_{j+1})/2.

n and (1+e) t are differenced as vectors, so the answer does not know the polar axis.  The
spherical coordinates have a pole where t lies along that axis; it is the inertial axis least
aligned with the tangents of the piece, chosen anew at every Newton iteration.

Unknowns in a column: rod (v or x, f, k, w or turn), catenary (v or x, T, theta, phi).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .line import Piece
from .rotations import Array, exp, hat, log, right, right_inverse

E3 = np.array([0.0, 0.0, 1.0])
HAT3 = hat(E3)
PLACE, FORCE, BEND, TURN = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12)


@dataclass(frozen=True)
class RodFields:
    """Nodes of one rod piece; shapes (n, 3) and R (n, 3, 3); frames as in the table above."""

    x: Array
    v: Array
    R: Array
    f: Array
    k: Array
    w: Array


@dataclass(frozen=True)
class CatenaryFields:
    """Nodes of one catenary piece; x, v, t (n, 3) inertial, T (n,); order (3,): inertial axes, the polar one last."""

    x: Array
    v: Array
    T: Array
    t: Array
    order: Array

    @staticmethod
    def of(x: Array, v: Array, T: Array, t: Array) -> CatenaryFields:
        """With the polar axis least aligned with the tangents."""
        polar = int(np.argmin(np.abs(t).max(0)))
        return CatenaryFields(x, v, T, t, np.array([(polar + 1) % 3, (polar + 2) % 3, polar]))


Fields = RodFields | CatenaryFields


@dataclass(frozen=True)
class Clock:
    """What the time scheme tells the fields of one piece: rate of y = c0 y + its history.

    c0 1/s.  Histories per node: v, and for a rod w, k (rates per second), the strain e (n,), the
    turn (n, 3) from the frames `R` at the last step; for a catenary g = (1+e) t; x for both.
    """

    c0: float
    x: Array
    v: Array
    g: Array
    w: Array
    k: Array
    e: Array
    turn: Array
    R: Array

    def turned(self, w: Array) -> Array:
        """Rotation vector (body) from the last step's frame to this one's for the spin w."""
        out: Array = (w - self.turn) / self.c0
        return out

    def lever(self, w: Array) -> Array:
        """Turn of the frame (body) for a change of the spin w: (n, 3, 3), s."""
        return right(self.turned(w)) / self.c0


def moment(piece: Piece, y: RodFields) -> Array:
    """GP (5) with intrinsic curvature: q = B (k - k0), body axes."""
    return piece.stiffness * (y.k - piece.curvature)


def lever(y: RodFields, clock: Clock | None) -> Array:
    """How the frames (n) turn with the last three unknowns: identity in statics."""
    return np.broadcast_to(np.eye(3), (len(y.x), 3, 3)) if clock is None else clock.lever(y.w)


def _square(u: Array) -> tuple[Array, Array]:
    """|u| u and its derivative; zero, with zero derivative, at u = 0."""
    size = np.linalg.norm(u, axis=-1)[..., None]
    inverse = 1.0 / np.where(size > 0.0, size, 1.0)
    return size * u, size[..., None] * np.eye(3) + inverse[..., None] * u[..., :, None] * u[..., None, :]


def rod_nodes(piece: Piece, y: RodFields, clock: Clock | None) -> tuple[Array, Array, Array, Array]:
    """Z (n, 12), dZ (n, 12, 12), G (n, 12), dG (n, 12, 12) of a rod; the turn's Z is zero in statics (see `cells`)."""
    n, eye, c = len(y.x), np.eye(3), piece.compliance
    q, stretch = moment(piece, y), (1.0 + c * y.f[:, 2])[:, None]
    weight = np.einsum("nji,j->ni", y.R, piece.weight)
    flow = np.einsum("nji,j->ni", y.R, piece.current)
    arm = lever(y, clock)
    Z, dZ, G, dG = np.zeros((n, 12)), np.zeros((n, 12, 12)), np.zeros((n, 12)), np.zeros((n, 12, 12))

    u = (0.0 if clock is None else y.v) - flow
    across, d_across = _square(u * (1.0 - E3))
    drag = -piece.drag_n * across - piece.drag_t * np.abs(u[:, 2:]) * u * E3
    d_drag = -piece.drag_n * d_across * (1.0 - E3)
    d_drag[:, 2, 2] = -2.0 * piece.drag_t * np.abs(u[:, 2])
    F = weight + drag
    dF_turn = (hat(weight) - d_drag @ hat(flow)) @ arm

    Z[:, FORCE], Z[:, BEND] = y.f, q
    dZ[:, FORCE, FORCE], dZ[:, BEND, BEND] = eye, np.diag(piece.stiffness)
    G[:, FORCE] = np.cross(y.k, y.f) + F
    dG[:, FORCE, FORCE], dG[:, FORCE, BEND], dG[:, FORCE, TURN] = hat(y.k), -hat(y.f), dF_turn
    bow = np.cross(y.f, E3)
    G[:, BEND] = np.cross(y.k, q) - stretch * bow
    dG[:, BEND, FORCE] = stretch[..., None] * HAT3
    dG[:, BEND, 5] -= c * bow
    dG[:, BEND, BEND] = hat(y.k) * piece.stiffness - hat(q)

    if clock is None:
        Z[:, PLACE], dZ[:, PLACE, PLACE] = y.x, eye
        G[:, PLACE] = -stretch * y.R[:, :, 2]
        dG[:, PLACE, TURN] = stretch[..., None] * y.R @ HAT3
        dG[:, PLACE, 5] = -c * y.R[:, :, 2]
        G[:, TURN] = -y.k
        dG[:, TURN, BEND] = -eye
        return Z, dZ, G, dG

    c0, mass = clock.c0, piece.mass + np.array([piece.added_n, piece.added_n, piece.added_t])
    whirl = np.cross(y.w, E3)
    Z[:, PLACE], Z[:, TURN] = y.v, y.w
    dZ[:, PLACE, PLACE] = dZ[:, TURN, TURN] = eye
    G[:, PLACE] = np.cross(y.k, y.v) - stretch * whirl - (c0 * c * y.f[:, 2] + clock.e)[:, None] * E3
    dG[:, PLACE, PLACE], dG[:, PLACE, BEND] = hat(y.k), -hat(y.v)
    dG[:, PLACE, 5] = -c * (whirl + c0 * E3)
    dG[:, PLACE, TURN] = stretch[..., None] * HAT3
    G[:, FORCE] -= mass * (c0 * y.v + clock.v + np.cross(y.w, y.v)) + piece.damping * piece.mass * y.v
    dG[:, FORCE, PLACE] = d_drag - mass[:, None] * (c0 * eye + hat(y.w)) - piece.damping * piece.mass * eye
    dG[:, FORCE, TURN] += mass[:, None] * hat(y.v)
    spun = piece.inertia * y.w
    G[:, BEND] -= piece.inertia * (c0 * y.w + clock.w) + np.cross(y.w, spun)
    dG[:, BEND, TURN] = -c0 * np.diag(piece.inertia) - hat(y.w) * piece.inertia + hat(spun)
    G[:, TURN] = np.cross(y.k, y.w) - c0 * y.k - clock.k
    dG[:, TURN, BEND] = -hat(y.w) - c0 * eye
    dG[:, TURN, TURN] = hat(y.k)
    return Z, dZ, G, dG


def angles(t: Array, order: Array) -> tuple[Array, Array]:
    """Spherical angles theta, phi (n,) of the unit vectors t, GP (4) with the axes in this order."""
    u = t[:, order]
    return np.arctan2(np.hypot(u[:, 0], u[:, 1]), u[:, 2]), np.arctan2(u[:, 1], u[:, 0])


def direction(theta: Array, phi: Array, order: Array) -> tuple[Array, Array]:
    """Tangents (n, 3) of the angles, and their derivatives (n, 3, 2)."""
    st, ct, sp, cp = np.sin(theta), np.cos(theta), np.sin(phi), np.cos(phi)
    t, dt = np.empty((len(theta), 3)), np.zeros((len(theta), 3, 2))
    t[:, order] = np.stack([st * cp, st * sp, ct], -1)  # GP (4), third component as it should read
    dt[:, order, 0] = np.stack([ct * cp, ct * sp, -st], -1)
    dt[:, order[:2], 1] = np.stack([-st * sp, st * cp], -1)
    return t, dt


def bent(theta: Array, phi: Array, order: Array) -> Array:
    """Second derivatives (n, 3, 2, 2) of the tangents with the angles."""
    st, ct, sp, cp = np.sin(theta), np.cos(theta), np.sin(phi), np.cos(phi)
    d = np.zeros((len(theta), 3, 2, 2))
    d[:, order, 0, 0] = -np.stack([st * cp, st * sp, ct], -1)
    d[:, order[:2], 1, 1] = -np.stack([st * cp, st * sp], -1)
    d[:, order[:2], 0, 1] = d[:, order[:2], 1, 0] = np.stack([-ct * sp, ct * cp], -1)
    return d


def pull(y: CatenaryFields) -> tuple[Array, Array]:
    """n = T t (n, 3) and its derivative with T, theta, phi (n, 3, 3), GP (15)."""
    dt = direction(*angles(y.t, y.order), y.order)[1]
    return y.T[:, None] * y.t, np.concatenate([y.t[:, :, None], y.T[:, None, None] * dt], 2)


def catenary_nodes(piece: Piece, y: CatenaryFields, clock: Clock | None) -> tuple[Array, Array, Array, Array]:
    """Z (n, 6), dZ (n, 6, 6), G (n, 6), dG (n, 6, 6) of a catenary."""
    n, eye, c, t = len(y.x), np.eye(3), piece.compliance, y.t
    dt = direction(*angles(t, y.order), y.order)[1]
    outer = t[:, :, None] * t[:, None, :]
    Z, dZ, G, dG = np.zeros((n, 6)), np.zeros((n, 6, 6)), np.zeros((n, 6)), np.zeros((n, 6, 6))
    stretch = (1.0 + c * y.T)[:, None]
    g, dg = stretch * t, np.concatenate([c * t[:, :, None], stretch[..., None] * dt], 2)

    u = (0.0 if clock is None else y.v) - np.broadcast_to(piece.current, (n, 3))
    along = np.einsum("ni,ni->n", u, t)[:, None]
    across, d_across = _square(u - along * t)
    drag = -piece.drag_n * across - piece.drag_t * np.abs(along) * along * t
    d_drag = -piece.drag_n * d_across @ (eye - outer) - 2.0 * piece.drag_t * np.abs(along)[..., None] * outer
    tu = t[:, :, None] * u[:, None, :]
    F = piece.weight + drag
    dF_t = piece.drag_n * d_across @ (tu + along[..., None] * eye)
    dF_t -= piece.drag_t * np.abs(along)[..., None] * (2.0 * tu + along[..., None] * eye)

    Z[:, FORCE], dZ[:, FORCE, FORCE] = pull(y)
    if clock is None:
        Z[:, PLACE], G[:, PLACE], dG[:, PLACE, FORCE] = y.x, -g, -dg
    else:
        c0, extra = clock.c0, piece.added_t - piece.added_n
        Z[:, PLACE], G[:, PLACE], dG[:, PLACE, FORCE] = y.v, -(c0 * g + clock.g), -c0 * dg
        a = c0 * y.v + clock.v
        a_along = np.einsum("ni,ni->n", a, t)[:, None]
        F = F - (piece.mass + piece.added_n) * a - extra * a_along * t - piece.damping * piece.mass * y.v
        dF_t -= extra * (t[:, :, None] * a[:, None, :] + a_along[..., None] * eye)
        dG[:, FORCE, PLACE] = (
            d_drag - c0 * ((piece.mass + piece.added_n) * eye + extra * outer) - piece.damping * piece.mass * eye
        )
    dZ[:, PLACE, PLACE] = eye
    G[:, FORCE] = F
    dG[:, FORCE, 4:6] = dF_t @ dt
    return Z, dZ, G, dG


def cells(piece: Piece, y: Fields, clock: Clock | None) -> tuple[Array, Array, Array]:
    """Residual (n-1, m) of every cell and its derivatives (n-1, m, m) with its left and right node."""
    if isinstance(y, RodFields):
        Z, dZ, G, dG = rod_nodes(piece, y, clock)
    else:
        Z, dZ, G, dG = catenary_nodes(piece, y, clock)
    h = np.diff(piece.s)[:, None]
    half = 0.5 * h[..., None]
    residual = Z[1:] - Z[:-1] + 0.5 * h * (G[1:] + G[:-1])
    left, right_ = half * dG[:-1] - dZ[:-1], half * dG[1:] + dZ[1:]
    if isinstance(y, RodFields) and clock is None:
        bend = log(np.swapaxes(y.R[:-1], 1, 2) @ y.R[1:])
        residual[:, TURN] += bend
        left[:, TURN, TURN] -= right_inverse(-bend)
        right_[:, TURN, TURN] += right_inverse(bend)
    return residual, left, right_


def moved(y: Fields, d: Array, clock: Clock | None) -> Fields:
    """The fields after the change d (n, m) of their unknowns."""
    if isinstance(y, CatenaryFields):
        theta, phi = angles(y.t, y.order)
        t = direction(theta + d[:, 4], phi + d[:, 5], y.order)[0]
        if clock is None:
            return CatenaryFields.of(y.x + d[:, PLACE], y.v, y.T + d[:, 3], t)
        v = y.v + d[:, PLACE]
        return CatenaryFields.of((v - clock.x) / clock.c0, v, y.T + d[:, 3], t)
    f, k = y.f + d[:, FORCE], y.k + d[:, BEND]
    if clock is None:
        return RodFields(y.x + d[:, PLACE], y.v, y.R @ exp(d[:, TURN]), f, k, y.w)
    v, w = y.v + d[:, PLACE], y.w + d[:, TURN]
    R = clock.R @ exp(clock.turned(w))
    x = (np.einsum("nij,nj->ni", R, v) - clock.x) / clock.c0
    return RodFields(x, v, R, f, k, w)
