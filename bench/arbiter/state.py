"""What the arbiter reports: the line at one time, in the field's terms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .fields import RodFields, moment
from .line import Line
from .newton import Solved
from .rotations import Array


@dataclass(frozen=True)
class ShootingState:
    """The line at one time; points of a joint, or of a change of section, appear twice (left, right).

    t s; s (n,) m; rod (n,) true on rod points; r (n, 3) m, v (n, 3) m/s, tangent (n, 3), force (n, 3) N
    on the +s face, moment (n, 3) N m (zero on catenaries), all inertial; tension (n,) N; frame (n, 3, 3)
    columns a_i, curvature (n, 3) 1/m and spin (n, 3) 1/s in body axes (NaN on catenaries).
    iterations of Newton; residual and condition as Newton left them: the largest scaled residual, and the
    condition of the far-end fit; growth: how much the homogeneous solutions grew along s.
    """

    t: float
    s: Array
    rod: NDArray[np.bool_]
    r: Array
    v: Array
    tangent: Array
    force: Array
    tension: Array
    moment: Array
    frame: Array
    curvature: Array
    spin: Array
    iterations: int
    residual: float
    growth: float
    condition: float


def at(state: ShootingState, s: Array) -> dict[str, Array]:
    """Position (n, 3) m, tension (n,) N and bending moment (n,) N m of a state at arc lengths s (n,) m."""

    def along(x: Array) -> Array:
        flat = x.reshape(x.shape[0], -1)
        columns = [np.interp(s, state.s, flat[:, k]) for k in range(flat.shape[1])]
        return np.column_stack(columns).reshape(s.size, *x.shape[1:])

    tangent, moment = along(state.tangent), along(state.moment)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    torque = np.einsum("ij,ij->i", moment, tangent)
    bending = np.linalg.norm(moment - torque[:, None] * tangent, axis=1)
    return {"position": along(state.r), "tension": along(state.tension), "bending_moment": bending}


def state_of(line: Line, solved: Solved, t: float) -> ShootingState:
    """The state of solved fields at time t."""
    rows: dict[str, list[Array]] = {k: [] for k in ("r", "v", "tangent", "force", "moment", "frame", "k", "w")}

    def add(**values: Array) -> None:
        for name, value in values.items():
            rows[name].append(value)

    for piece, y in zip(line.pieces, solved.fields, strict=True):
        n = len(piece.s)
        if isinstance(y, RodFields):
            turn = lambda b, R=y.R: np.einsum("nij,nj->ni", R, b)  # noqa: E731
            add(r=y.x, v=turn(y.v), tangent=y.R[:, :, 2], force=turn(y.f), moment=turn(moment(piece, y)))
            add(frame=y.R, k=y.k, w=y.w)
        else:
            none = np.full((n, 3), np.nan)
            add(r=y.x, v=y.v, tangent=y.t, force=y.T[:, None] * y.t, moment=np.zeros((n, 3)))
            add(frame=np.full((n, 3, 3), np.nan), k=none, w=none)
    whole = {name: np.concatenate(values) for name, values in rows.items()}
    return ShootingState(
        t=t,
        s=np.concatenate([p.s for p in line.pieces]),
        rod=np.concatenate([np.full(len(p.s), p.rod) for p in line.pieces]),
        r=whole["r"],
        v=whole["v"],
        tangent=whole["tangent"],
        force=whole["force"],
        tension=np.einsum("ni,ni->n", whole["force"], whole["tangent"]),
        moment=whole["moment"],
        frame=whole["frame"],
        curvature=whole["k"],
        spin=whole["w"],
        iterations=solved.iterations,
        residual=solved.residual,
        growth=solved.growth,
        condition=solved.condition,
    )
