"""What a correction does to the configuration: positions, chords, tensions, directors and rates.

`plane` is the plane of a line that is computed in one, else None; `space` is None for such a line, else 1.  numba
drops what stands behind `is not None` of the one that is None, so what the other kind needs is not compiled.
"""

from __future__ import annotations

import math

from hybrid.kernels.algebra.plane import carried, chord2, vector_in_plane
from hybrid.kernels.algebra.rotations import dot, get3, spin_about, transport
from hybrid.kernels.laws.cell import chord
from hybrid.kernels.machine.compile import inner, kernel


@inner
def carry_director(plane, space, a, e, en):
    """Director a of a cell whose chord turns from e to en, without spin about it."""
    out = a
    if space is not None:
        d, _, _ = chord(e)
        dn, _, _ = chord(en)
        out = transport(a, d, dn)
    if plane is not None:
        p, _, _ = chord2(vector_in_plane(plane, e))
        q, _, _ = chord2(vector_in_plane(plane, en))
        out = carried(plane, a, p, q)
    return out


@inner
def measure(e, T, x):
    """Size of a Newton correction x, and the largest tension.

    Largest shift, largest turn of a chord or spin and its cell, largest change of tension.
    """
    n = e.shape[0]
    shift, turn, pull, big, where = 0.0, 0.0, 0.0, 0.0, -1
    for i in range(n + 1):
        shift = max(shift, abs(x[i, 1]) + abs(x[i, 2]) + abs(x[i, 3]))
        pull = max(pull, abs(x[i, 0]))
        if i < n:
            de = (x[i + 1, 1] - x[i, 1], x[i + 1, 2] - x[i, 2], x[i + 1, 3] - x[i, 3])
            ei = (e[i, 0], e[i, 1], e[i, 2])
            t = max(math.sqrt(dot(de, de) / dot(ei, ei)), abs(x[i, 4]))
            big = max(big, abs(T[i]))
            if t > turn:
                turn, where = t, i
    return shift, turn, where, pull, big


@inner
def turned_chord(e, de):
    """The chord e turned and stretched by de: the same as e + de to first order, but no turn stretches it."""
    d, l, il = chord(e)
    along = dot(d, de)
    across = (de[0] - along * d[0], de[1] - along * d[1], de[2] - along * d[2])
    q = math.sqrt(dot(across, across))
    if not q > 0.0:
        return (e[0] + de[0], e[1] + de[1], e[2] + de[2])
    c, s = (l + along) * math.cos(q * il), (l + along) * math.sin(q * il) / q
    return (c * d[0] + s * across[0], c * d[1] + s * across[1], c * d[2] + s * across[2])


@kernel
def update(plane, space, line, state, cv, ca, part, turning, work):
    """Apply `part` of the correction work.x to everything that depends on it.

    With `turning` chords are turned and stretched by the correction instead of shifted:
    the same to first order, but a large turn does not stretch the line.  Positions then
    follow from the start along the chords, and a held end is met again by the next correction.
    """
    u, x, e, a1 = work.u, work.x, state.e, state.a1
    n = e.shape[0]
    drift = (0.0, 0.0, 0.0)
    for i in range(n):
        ei = get3(e, i)
        de = (part * (x[i + 1, 1] - x[i, 1]), part * (x[i + 1, 2] - x[i, 2]), part * (x[i + 1, 3] - x[i, 3]))
        en = (ei[0] + de[0], ei[1] + de[1], ei[2] + de[2])
        if turning:
            turned = turned_chord(ei, de)
            drift = (drift[0] + turned[0] - en[0], drift[1] + turned[1] - en[1], drift[2] + turned[2] - en[2])
            en = turned
            u[i + 1, 0] += drift[0]
            u[i + 1, 1] += drift[1]
            u[i + 1, 2] += drift[2]
        state.T[i] += part * x[i + 1, 0]
        e[i, 0], e[i, 1], e[i, 2] = en
        if line.spin[i]:
            a = carry_director(plane, space, get3(a1, i), ei, en)
            if space is not None:
                dpsi = part * x[i, 4]
                if dpsi != 0.0:
                    dn, _, _ = chord(en)
                    a = spin_about(a, dn, dpsi)
                state.w[i] += cv * dpsi
                state.wd[i] += ca * dpsi
            a1[i, 0], a1[i, 1], a1[i, 2] = a
    for i in range(n + 1):
        for k in range(3):
            dr = part * x[i, k + 1]
            u[i, k] += dr
            state.v[i, k] += cv * dr
            state.vd[i, k] += ca * dr


@inner
def first_bad(x, e):
    """The first cell that is not finite: its chord, or else its correction (substitution goes backwards)."""
    for i in range(e.shape[0]):
        if not abs(e[i, 0]) + abs(e[i, 1]) + abs(e[i, 2]) < math.inf:
            return i
    for i in range(x.shape[0] - 1, -1, -1):
        if not abs(x[i, 0]) + abs(x[i, 1]) + abs(x[i, 2]) + abs(x[i, 3]) + abs(x[i, 4]) < math.inf:
            return i
    return -1
