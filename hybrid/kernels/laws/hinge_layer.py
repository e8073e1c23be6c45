"""The layer in which the curvature of a rod fades to nothing at a hinge: what a joint, or a pin, takes of it.

    symbol   meaning                                            unit
    lam      sqrt(EI/T), over which a bend fades in a taut rod   m
    h        length of a cell                                    m
    f        part of the layer that is left a cell further on    1

Far from the hinge the moment M of a rod is EI times the curvature of the line without stiffness, and what is missing
of it, D, obeys EI D'' = T D.  On equal cells that is D_(i+1) - (2 + (h/lam)^2) D_i + D_(i-1) = 0, hence D_i = D_0 f^i
with f + 1/f = 2 + (h/lam)^2: the discrete layer, which is what the nodes of a rod have, whatever h is.

Beside the end of a catenary, whose cells have no such layer, it is that of the line, (EI/T D')' = D, for tension that
changes little within lam:  D = D_0 (T/T_0)^(1/4) exp(-int ds/lam).

At a joint D_0 is the curvature kappa_J that the line would have at the hinge.  The forces at the hinge, whose rod ends without a
moment, are in balance with the turn of its chords, per length k_J:  with B = lam^2/(h_n h) on either side, a that of the
catenary, b that of the rod,

    (1 + B_a + B_b (1 - f)) kappa_J = k_J + B_a kappa_a

is the same balance with the moments of a line that goes on: kappa_a that of the next node of the catenary, on the other
side f kappa_J more than the rod has.  What loads the hinge alone is in k_J; neighbours do not know it.
"""

from __future__ import annotations

import math

from hybrid.kernels.machine.compile import inner

FADED = 1e-3  # part of a layer that no longer counts
FARTHEST = 200  # nodes over which it is put back at most


@inner
def fade(square):
    """f, of (h/lam)^2; nothing fades without tension."""
    half = 1.0 + 0.5 * max(square, 0.0)
    return 1.0 / (half + math.sqrt(half * half - 1.0))


@inner
def depth_of(T, EI, h):
    """Integral of sqrt(T/EI) over a cell of h, m: by what the layer of a hinge that the cells know nothing of fades."""
    return math.sqrt(T / EI) * h if T > 0.0 else math.inf


@inner
def left_of(depth, T, end):
    """Part of such a layer at a depth, where the tension is T, N, and at the end `end`, N."""
    return (T / end) ** 0.25 * math.exp(-depth)


@inner
def stiffness_share(EI, T, hn, h):
    """B, of a cell of h, m, beside a node that stands for hn, m; nothing without tension."""
    return EI / (T * hn * h) if T > 0.0 else 0.0


@inner
def at_hinge(turn, along, outer, before, after, part):
    """kappa_J, 1/m, negative where it is against the curvature `outer` of the next node of the catenary.

    turn: of the chords at the hinge, in a direction of cosine `along` to that; before, after: B there and on the rod's
    side; part: f of the rod's first cell.
    """
    held, whole = before * outer, 1.0 + before + after * (1.0 - part)
    square = turn * turn + 2.0 * along * turn * held + held * held
    return math.copysign(math.sqrt(max(square, 0.0)) / whole, along * turn + held)
