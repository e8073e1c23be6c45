"""The layer in which the curvature of a rod fades to nothing at a hinge: what a joint, or a pin, takes of it.

    symbol   meaning                                            unit
    lam      sqrt(EI/T), over which a bend fades in a taut rod   m
    h        length of a cell                                    m
    f        part of the layer that is left a cell further on    1

Far from the hinge the moment M of a rod is EI times the curvature of the line without stiffness, and what is missing
of it, D, obeys EI D'' = T D.  On equal cells that is D_(i+1) - (2 + (h/lam)^2) D_i + D_(i-1) = 0, hence D_i = D_0 f^i
with f + 1/f = 2 + (h/lam)^2: the discrete layer, which is what the nodes of a rod have, whatever h is.

D_0 is the curvature kappa_J that the line would have at the hinge.  It lies on a straight line between that of the
next node of the catenary and that of the next node of the rod, with D_1 put back.  (On from two nodes of the catenary it
would be as wrong as three times the error of one of them: at a contact edge beside the joint, a quarter of the jump.)
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
def at_hinge(outer, inner_, before, after, part):
    """kappa_J, 1/m: outer, of the catenary's node, `before` m from the hinge; inner_, of the rod's, `after` m from it.

    part: f of the rod's first cell.
    """
    a = before / (before + after)
    return max(((1.0 - a) * outer + a * inner_) / (1.0 - a * part), 0.0)
